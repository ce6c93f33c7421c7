"""A whole recording as one YAML file: what is tracked, from which images, what is kept, and what it is compared with.

``tracker_node pipeline`` and ``track`` take it; the format is described in docs/formats.md.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import BeforeValidator, Field, model_validator

from ..errors import FileFormatError, SourceError
from .file_kind import RECORDING
from .rig.rig_yaml import ImageSize
from .source_address import filled, parse_source, relocated, sources_by_name
from .yaml_file import FileModel, PositiveNumber, is_number, problem, read_mapping, validate

MOST_LAG_IMAGES = 1000
FILES = ("rig", "model", "initial_state", "occluders", "config")


def _whole(value: Any) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value <= 1_000_000_000:
        raise problem("a whole number, 0 or more", value)
    return value


def _at_least_one(value: Any) -> int:
    if _whole(value) < 1:
        raise problem("a whole number, 1 or more", value)
    return value


def _sources(value: Any) -> str | dict[str, str]:
    """One pattern for all cameras, or a source for each; not a union of types, whose errors would name neither."""
    if isinstance(value, str):
        try:
            filled(value, "cam", 1)
        except SourceError:
            raise problem("a pattern with {name} or {number}, or a source for each camera", value) from None
        return _source(value, "")
    if not isinstance(value, dict):
        raise problem("a pattern with {name} or {number}, or a source for each camera", value)
    return {str(name): _source(source, str(name)) for name, source in value.items()}


def _source(value: Any, field: str) -> str:
    try:
        if not isinstance(value, str):
            raise SourceError(str(value), "is no text")
        parse_source(value)
    except SourceError as error:
        raise problem("a path, or a source of a known kind (docs/cameras.md)", error.source, field) from None
    return value


def _switch(value: Any) -> bool:
    if not isinstance(value, bool):
        raise problem("true or false", value)
    return value


def _files(value: Any) -> tuple[str, ...]:
    """One file, or several."""
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
        raise problem("a file, or a list of files", value)
    return tuple(names)


def _lag(value: Any) -> Any:
    if value != "auto" and not (is_number(value) and abs(value) <= MOST_LAG_IMAGES):
        raise problem(f"'auto' or a number of images, at most {MOST_LAG_IMAGES}", value)
    return value


def _name(value: Any) -> str:
    if not isinstance(value, str) or not value.strip():
        raise problem("a name", value)
    return value


Files = Annotated[tuple[str, ...], BeforeValidator(_files)]
Whole = Annotated[int, BeforeValidator(_whole)]
Positive = Annotated[int, BeforeValidator(_at_least_one)]
Sources = Annotated[str | dict[str, str], BeforeValidator(_sources)]
Switch = Annotated[bool, BeforeValidator(_switch)]
Lag = Annotated[str | float, BeforeValidator(_lag)]
Name = Annotated[str, BeforeValidator(_name)]


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


class RecordEntry(FileModel):
    """What goes into the bag besides states, poses, joints, calibrations and diagnostics, and how it is written."""

    masks: Switch = False
    overlays: Switch = False
    through_masks: Switch = False
    markers: Switch = False
    images: Switch = False
    split_mb: PositiveNumber | None = None
    compression: Literal["none", "lz4", "zstd"] = "none"


class EvaluateEntry(FileModel):
    """How the run is reported on when it is over, and what it is held against; see docs/results.md."""

    truth: Files = ()
    y_up: Switch | None = None
    align: Literal["auto", "first", "stamp"] = "auto"
    lag: Lag = "auto"
    masks: str | None = None
    name: Name = "run"
    image_sets: Whole = 0
    targets: tuple[str, ...] = ()


class RecordingFile(FileModel):
    """A whole recording."""

    KIND: ClassVar[str] = RECORDING

    rig: str
    model: str
    initial_state: str | None = None
    occluders: str | None = None
    config: str | None = None
    output: str
    cameras: tuple[str, ...] | None = Field(default=None, min_length=1)
    sources: Sources = Field(default_factory=dict)
    images: ImagesEntry = Field(default_factory=ImagesEntry)
    record: RecordEntry = Field(default_factory=RecordEntry)
    real_time: Switch = False
    loop: Switch = False
    evaluate: EvaluateEntry | None = None

    @model_validator(mode="after")
    def _ends(self) -> RecordingFile:
        if self.loop and self.evaluate is not None:
            raise problem("no loop where the run is evaluated when it is over", self.loop, "loop")
        return self

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
    recording = validate(RecordingFile, read_mapping(path), path)
    base = Path(path).parent
    changes: dict[str, Any] = {name: _existing(path, name, getattr(recording, name)) for name in FILES}
    changes["output"] = os.path.join(base, recording.output)
    if isinstance(recording.sources, str):
        changes["sources"] = relocated(recording.sources, base)
    else:
        changes["sources"] = {name: relocated(source, base) for name, source in recording.sources.items()}
    if recording.evaluate is not None:
        entry = recording.evaluate
        truth = tuple(_existing(path, "evaluate.truth", name) for name in entry.truth)
        masks = _existing(path, "evaluate.masks", entry.masks)
        changes["evaluate"] = entry.model_copy(update={"truth": truth, "masks": masks})
    return recording.model_copy(update=changes)


def _existing(recording: str | Path, field: str, name: str | None) -> str | None:
    """Path of a file that a recording names, from here."""
    if name is None:
        return None
    file = os.path.join(Path(recording).parent, name)
    if not os.path.isfile(file):
        raise FileFormatError(recording, field, "an existing file", file)
    return file
