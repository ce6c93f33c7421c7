"""A whole recording as one YAML file: what is tracked, from which images, what is kept, and what it is compared with.

``tracker_node pipeline`` and ``track`` take it; the format is described in docs/formats.md.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from ..errors import FileFormatError, SourceError
from .file_model import RECORDING, FileModel, PositiveNumber, are_numbers, checked, floats, is_number, problem, validate
from .model.model_yaml import existing_model, is_named
from .rig.rig_yaml import ImageSize, check_source
from .source_address import filled, relocated, sources_by_name
from .yaml_file import read_mapping, write_mapping

MOST_LAG_IMAGES = 1000
FILES = ("rig", "model", "initial_state", "occluders", "config")


def _is_whole(value: Any) -> bool:
    return type(value) is int and 0 <= value <= 1_000_000_000


def _sources(value: Any) -> str | dict[str, str]:
    """One pattern for all cameras, or a source for each; not a union of types, whose errors would name neither."""
    try:
        if isinstance(value, str):
            filled(value, "cam", 1)
            return check_source(value)
        return {str(name): check_source(source, str(name)) for name, source in value.items()}
    except (AttributeError, SourceError):
        raise problem("a pattern with {name} or {number}, or a source for each camera", value) from None


def _names(value: Any) -> Any:
    return [value] if isinstance(value, str) else value


def _are_files(value: Any) -> bool:
    return isinstance(_names(value), (list, tuple)) and all(isinstance(name, str) for name in _names(value))


def _is_lag(value: Any) -> bool:
    return value == "auto" or (is_number(value) and abs(value) <= MOST_LAG_IMAGES)


Files = Annotated[tuple[str, ...], checked("a file, or a list of files", _are_files, lambda value: tuple(_names(value)))]
Whole = Annotated[int, checked("a whole number, 0 or more", _is_whole)]
Positive = Annotated[int, checked("a whole number, 1 or more", lambda value: _is_whole(value) and value >= 1)]
Sources = Annotated[str | dict[str, str], BeforeValidator(_sources)]
Switch = Annotated[bool, checked("true or false", lambda value: isinstance(value, bool))]
Lag = Annotated[str | float, checked(f"'auto' or a number of images, at most {MOST_LAG_IMAGES}", _is_lag)]
Place = Annotated[
    tuple[float, float, float], checked("a place: [x, y, z] in meters", lambda value: are_numbers(value, 3), floats)
]
_BODY_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_]*")
_NAME_EXPECTED = "a name of letters, digits and _, beginning with a letter"
Name = Annotated[str, checked("a name", lambda value: isinstance(value, str) and value.strip())]


class ImagesEntry(FileModel):
    """Which images of the sources, and in which size."""

    start: Whole = 0
    end: Positive | None = None
    rate_hz: PositiveNumber | None = None
    resize: ImageSize | None = None
    shrink: Positive = 1

    @model_validator(mode="after")
    def _some_images(self) -> ImagesEntry:
        if self.end is not None and self.end <= self.start:
            raise problem(f"more than start, which is {self.start}", self.end, "end")
        if self.resize is not None and self.shrink > 1:
            raise problem("either resize or shrink", "both", "shrink")
        return self


class KeypointsEntry(FileModel):
    """Where points come from; ``files`` with ``table`` and ``first`` are another detector's, else the network looks.

    ``table`` alone: another detector publishes its points.
    """

    files: str | None = None
    table: str | None = None
    first: Whole = 0
    weights: str | None = None
    every_sets: Positive = 1

    @model_validator(mode="after")
    def _one_detector(self) -> KeypointsEntry:
        if self.files is not None and self.weights is not None:
            raise problem("either files or weights", "both", "weights")
        return self


class JointStatesEntry(FileModel):
    """What a robot says of its joints: a CSV file, or a bag and its topic."""

    file: str
    topic: str | None = None


class RecordEntry(FileModel):
    """What goes into the bag besides states, poses, joints, calibrations and diagnostics, and how it is written."""

    masks: Switch = False
    overlays: Switch = False
    masked_images: Switch = False
    markers: Switch = False
    images: Switch = False
    split_mb: PositiveNumber | None = None
    compression: Literal["none", "lz4", "zstd"] = "none"

    @model_validator(mode="before")
    @classmethod
    def _present_names(cls, values: Any) -> Any:
        if isinstance(values, dict) and "through_masks" in values:
            expected = "its present name, masked_images (`tracker_node migrate` rewrites files)"
            raise problem(expected, values["through_masks"], "through_masks")
        return values


class EvaluateEntry(FileModel):
    """How the run is reported on when it is over, and what it is compared with; see docs/results.md."""

    truth: Files = ()
    y_up: Switch | None = None
    align: Literal["auto", "first", "stamp"] = "auto"
    lag: Lag = "auto"
    masks: str | None = None
    name: Name = "run"
    image_sets: Whole = 0
    targets: tuple[str, ...] = ()


class BodyEntry(FileModel):
    """One of several bodies."""

    model: str
    initial_state: str | None = None
    config: str | None = None
    person: Place | None = None
    evaluate: EvaluateEntry | None = None

    @model_validator(mode="after")
    def _one_start(self) -> BodyEntry:
        if self.initial_state is not None and self.person is not None:
            raise problem("either initial_state or person", "both", "person")
        return self


class JoiningEntry(FileModel):
    """People who come and go: whoever comes is a body ``<name>_1``, ``<name>_2``... like ``model``."""

    model: str
    config: str | None = None
    most: Positive = 4
    name: Annotated[str, checked(_NAME_EXPECTED, lambda value: isinstance(value, str) and _BODY_NAME.fullmatch(value))] = "person"
    gone_s: PositiveNumber = 2.0

    @property
    def names(self) -> tuple[str, ...]:
        """Of all who may join, in the order in which they come."""
        return tuple(f"{self.name}_{i + 1}" for i in range(self.most))


OF_ONE_BODY = ("model", "initial_state", "person", "joint_states", "evaluate")


class RecordingFile(FileModel):
    """A whole recording: of one body (``model``), or of several that are followed together, by name or as they come."""

    KIND: ClassVar[str] = RECORDING

    rig: str
    model: str | None = None
    bodies: dict[str, BodyEntry] = Field(default_factory=dict)
    joining: JoiningEntry | None = None
    initial_state: str | None = None
    occluders: str | None = None
    config: str | None = None
    output: str
    cameras: tuple[str, ...] | None = Field(default=None, min_length=1)
    sources: Sources = Field(default_factory=dict)
    images: ImagesEntry = Field(default_factory=ImagesEntry)
    keypoints: KeypointsEntry = Field(default_factory=KeypointsEntry)
    person: Place | None = None
    joint_states: JointStatesEntry | None = None
    record: RecordEntry = Field(default_factory=RecordEntry)
    real_time: Switch = False
    loop: Switch = False
    evaluate: EvaluateEntry | None = None

    @model_validator(mode="after")
    def _one_or_several(self) -> RecordingFile:
        if not self.several and self.model is None:
            raise problem("the body to track, or bodies, or who is joining", "none of them", "model")
        joining = () if self.joining is None else self.joining.names
        for name in self.bodies:
            if not _BODY_NAME.fullmatch(name):
                raise problem(_NAME_EXPECTED, name, "bodies")
            if name in joining:
                raise problem(f"another name than those of people who join ({', '.join(joining)})", name, "bodies")
        for name in OF_ONE_BODY:
            if self.several and getattr(self, name) is not None:
                raise problem("nothing beside bodies or joining, where each body has its own", getattr(self, name), name)
        return self

    @model_validator(mode="after")
    def _ends(self) -> RecordingFile:
        if self.loop and any(entry is not None for entry in (self.evaluate, *(body.evaluate for body in self.bodies.values()))):
            raise problem("no loop where the run is evaluated when it is over", self.loop, "loop")
        return self

    @property
    def several(self) -> bool:
        """Whether there may be several bodies, each with a folder, topics and parameters of its own."""
        return bool(self.bodies) or self.joining is not None

    @property
    def models(self) -> dict[str, str]:
        """By name of each of several bodies, also of who may join, the file of its model."""
        joining = {} if self.joining is None else dict.fromkeys(self.joining.names, self.joining.model)
        return {name: body.model for name, body in self.bodies.items()} | joining

    def of_body(self, name: str) -> RecordingFile:
        """The recording with one of its bodies alone, whose results go into a folder of its name."""
        body = self.bodies[name]
        own: dict[str, Any] = {field: getattr(body, field) for field in BodyEntry.model_fields}
        own |= {"config": body.config or self.config, "output": os.path.join(self.output, name)}
        return self.model_copy(update={**own, "bodies": {}, "joining": None})

    def of_those_who_join(self) -> RecordingFile:
        """The recording with somebody who joins alone; there is `joining`."""
        assert self.joining is not None
        own = {"model": self.joining.model, "config": self.joining.config or self.config}
        return self.model_copy(update={**own, "bodies": {}, "joining": None})

    def each(self) -> dict[str, RecordingFile]:
        """The recordings of all bodies with a name alone; "" of one that is alone."""
        return {name: self.of_body(name) for name in self.bodies} if self.several else {"": self}

    def sources_of(self, cameras: Iterable[str]) -> dict[str, str]:
        """Camera -> source, of the cameras whose sources are named here; a pattern is filled for each of ``cameras``."""
        if isinstance(self.sources, str):
            return {name: str(source) for name, source in sources_by_name(self.sources, cameras).items()}
        return dict(self.sources)


def load_recording(path: str | Path) -> RecordingFile:
    """The recording of a file, its paths relative to the folder of the file brought to the caller's.

    Raises
    ------
    FileFormatError : naming file and field; a file that it names and that is not there, too.
    """
    return located(validate(RecordingFile, read_mapping(path), path), path)


def located(recording: RecordingFile, path: str | Path) -> RecordingFile:
    """A recording with its paths brought to the caller's.

    Parameters
    ----------
    recording, path : as it stands in a file, and that file, whose folder its paths are relative to.

    Returns
    -------
    recording : the same otherwise.

    Raises
    ------
    FileFormatError : a file that it names is not there.
    """
    base = Path(path).parent
    changes: dict[str, Any] = {name: _existing(path, name, getattr(recording, name)) for name in FILES}
    changes["output"] = os.path.join(base, recording.output)
    if isinstance(recording.sources, str):
        changes["sources"] = relocated(recording.sources, base)
    else:
        changes["sources"] = {name: relocated(source, base) for name, source in recording.sources.items()}
    points = recording.keypoints
    changes["keypoints"] = points.model_copy(
        update={name: _existing(path, f"keypoints.{name}", getattr(points, name)) for name in ("files", "table", "weights")}
    )
    if recording.joint_states is not None:
        file = _existing(path, "joint_states.file", recording.joint_states.file)
        changes["joint_states"] = recording.joint_states.model_copy(update={"file": file})
    changes["evaluate"] = _located_evaluation(path, "evaluate", recording.evaluate)
    changes["bodies"] = {name: _located_body(path, f"bodies.{name}", body) for name, body in recording.bodies.items()}
    if recording.joining is not None:
        files = {name: _existing(path, f"joining.{name}", getattr(recording.joining, name)) for name in ("model", "config")}
        changes["joining"] = recording.joining.model_copy(update=files)
    return recording.model_copy(update=changes)


def _located_body(path: str | Path, field: str, body: BodyEntry) -> BodyEntry:
    files = {name: _existing(path, f"{field}.{name}", getattr(body, name)) for name in ("model", "initial_state", "config")}
    return body.model_copy(update={**files, "evaluate": _located_evaluation(path, f"{field}.evaluate", body.evaluate)})


def _located_evaluation(path: str | Path, field: str, entry: EvaluateEntry | None) -> EvaluateEntry | None:
    if entry is None:
        return None
    truth = tuple(_existing(path, f"{field}.truth", name) for name in entry.truth)
    return entry.model_copy(update={"truth": truth, "masks": _existing(path, f"{field}.masks", entry.masks)})


def _existing(recording: str | Path, field: str, name: str | None) -> str | None:
    """Path of a file that a recording names, from here; a model may be a word that names a body of the package."""
    if name is None:
        return None
    file, is_model = os.path.join(Path(recording).parent, name), field.rpartition(".")[2] == "model"
    if is_model and not os.path.exists(file) and is_named(name):
        return name
    if not (os.path.isfile(file) or (field in ("keypoints.files", "joint_states.file") and os.path.isdir(file))):
        raise FileFormatError(recording, field, existing_model(name) if is_model else "an existing file", file)
    return file


PARAMETERS = "tracker.yaml"
_FREE_TOLERANCE = 0.7  # of cameras that do not expose together


def write_recording(
    path: Path, files: Mapping[str, str | Path], modalities: Sequence[str], period_s: float, free: bool, comment: str
) -> None:
    """Write a recording, and beside it `PARAMETERS`.

    Parameters
    ----------
    path : of recording.yaml.
    files : ``rig``, ``model``, perhaps ``initial_state``, ``output``: as they are to stand in it.
    modalities : what the body is compared with.
    period_s : between two images.
    free : the cameras do not expose together.
    comment : at the top of the file.
    """
    synchronizer = {"image_period_s": round(period_s, 9)} | ({"tolerance": _FREE_TOLERANCE} if free else {})
    parameters = {"/**": {"ros__parameters": {"modalities": list(modalities), "synchronizer": synchronizer}}}
    write_mapping(parameters, path.parent / PARAMETERS, "Contours and points of people together." if len(modalities) > 1 else "")
    known = {name: str(file) for name, file in files.items()}
    first: dict[str, str] = {name: known.pop(name) for name in ("rig", "model", "initial_state") if name in known}
    values: dict[str, str] = {**first, "config": PARAMETERS, **known}
    write_mapping(values, path, f"{comment}; the format is described in docs/formats.md.")
