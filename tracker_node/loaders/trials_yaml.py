"""Many trials as one YAML file: what each of them tracks, with what is common to all, or to those of a subject, said once.

``tracker_node batch`` takes it; the format is described in docs/own_data.md.
"""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar

from pydantic import BeforeValidator, Field

from ..errors import FileFormatError, TrackerError
from .file_model import TRIALS, FileModel, checked, known_keys, problem, validate
from .recording_yaml import RecordingFile, load_recording, located
from .yaml_file import read_mapping

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.+-]{0,99}")
_RESERVED = ("failed",)  # folder of the batch itself
_ELSEWHERE = ("output", "real_time", "loop")  # of a recording, what a trial does not say
_NEVER = ("joining",)
_OF_A_TRIAL = ("recording", "subject")


def _named(value: Any) -> dict[str, Any]:
    """By name what is said of each; raises a problem with the first name, or what is said of it, that cannot be."""
    if not isinstance(value, dict):
        raise problem("a mapping for each name", value)
    for name, entry in value.items():
        if not isinstance(name, str):
            raise problem("a name in quotes where it is a number or a word of YAML", name)
        if not _NAME.fullmatch(name) or name in _RESERVED:
            raise problem("a name of ASCII letters, digits, _ . + - (first a letter or digit; at most 100), not 'failed'", name)
        if not (entry is None or isinstance(entry, dict)):
            raise problem(f"a mapping for each name, as for {name}", entry)
    return {name: entry or {} for name, entry in value.items()}


Fields = Annotated[dict[str, Any], checked("a mapping", lambda value: isinstance(value, dict))]
Named = Annotated[dict[str, Any], BeforeValidator(_named)]


class TrialsFile(FileModel):
    """Trials as they stand in a file: ``common`` and ``subjects`` hold fields of a recording."""

    KIND: ClassVar[str] = TRIALS

    output: str
    common: Fields = Field(default_factory=dict)
    subjects: Named = Field(default_factory=dict)
    trials: Named = Field(min_length=1)


@dataclass(frozen=True)
class Trial:
    """One trial.

    Attributes
    ----------
    name, subject : of the file; empty without a subject.
    recording : what is tracked; paths are absolute. None: it cannot be, for what ``problem`` says.
    problem : of files that the trial names.
    """

    name: str
    subject: str
    recording: RecordingFile | None
    problem: str = ""


@dataclass(frozen=True)
class Trials:
    """All trials of a file, in its order; each leaves what it finds in a folder of its name below ``output``."""

    output: Path
    trials: tuple[Trial, ...]


def load_trials(path: str | Path, output: str | Path | None = None) -> Trials:
    """The trials of a file.

    Parameters
    ----------
    path : the file; paths in it are relative to its folder.
    output : folder in place of the one that the file names.

    Returns
    -------
    Trials; one whose files are missing or wrong has a problem, and is no mistake of this file.

    Raises
    ------
    FileFormatError : naming file and field.
    """
    path = Path(os.path.abspath(path))
    file = validate(TrialsFile, read_mapping(path), path)
    place = Path(os.path.normpath(path.parent / file.output)) if output is None else Path(os.path.abspath(output))
    return Trials(place, tuple(_trial(file, name, place, path) for name in file.trials))


def _trial(file: TrialsFile, name: str, output: Path, path: Path) -> Trial:
    entry = dict(file.trials[name])
    subject = entry.pop("subject", "")
    if subject != "" and not (isinstance(subject, str) and subject in file.subjects):
        expected = f"one of the subjects, {', '.join(file.subjects) or '(none)'}"
        raise FileFormatError(path, f"trials.{name}.subject", expected, subject)
    if "recording" in entry:
        return _from_recording(name, subject, entry, output, path)
    layers: dict[str, Mapping[str, Any]] = {"common": file.common}
    if subject:
        layers[f"subjects.{subject}"] = file.subjects[subject]
    layers[f"trials.{name}"] = entry
    for layer, values in layers.items():
        for key in _ELSEWHERE:
            if key in values:
                expected = "none: results go below the output at the top, as fast as they come"
                raise FileFormatError(path, f"{layer}.{key}", expected, values[key])
        _check_keys(path, layer, values, _OF_A_TRIAL if values is entry else ())
    merged: dict[str, Any] = {}
    for values in layers.values():
        merged = _merged(merged, values)
    merged = _filled(merged, {"trial": name, "subject": subject})

    def of_layer(error: FileFormatError) -> FileFormatError:
        """The mistake of the merged fields at the place of the file where it stands."""
        keys = error.field.split(".")
        layer = max(reversed(layers), key=lambda layer: _depth(layers[layer], keys))  # of several, the last one holds
        return FileFormatError(path, f"{layer}.{error.field}", error.expected, error.got)

    try:
        recording = validate(RecordingFile, merged | {"output": str(output / name)}, path)
    except FileFormatError as error:
        raise of_layer(error) from None
    _check_named(path, f"trials.{name}", recording)
    try:
        return Trial(name, subject, located(recording, path))
    except FileFormatError as error:
        return Trial(name, subject, None, str(of_layer(error)))


def _check_keys(path: Path, layer: str, values: Mapping[str, Any], more: tuple[str, ...]) -> None:
    """Refuse what neither a recording nor the trial knows, by what may stand there."""
    for key in values:
        if key not in RecordingFile.model_fields:
            valid = sorted({*RecordingFile.model_fields, *more} - {*_ELSEWHERE, *_NEVER})
            free = [name for name in valid if name not in values]
            raise FileFormatError(path, f"{layer}.{key}", known_keys(key, valid, free), key)


def _from_recording(name: str, subject: str, entry: dict[str, Any], output: Path, path: Path) -> Trial:
    """A trial that has a ``recording.yaml`` of its own."""
    others = [key for key in entry if key != "recording"]
    if others or not isinstance(entry["recording"], str):
        got = f"{', '.join(others)} beside it" if others else entry["recording"]
        raise FileFormatError(path, f"trials.{name}.recording", "a recording.yaml, and nothing else but a subject", got)
    try:
        recording = load_recording(path.parent / entry["recording"])
    except TrackerError as error:
        return Trial(name, subject, None, str(error))
    _check_named(path, f"trials.{name}.recording", recording)
    return Trial(name, subject, recording.model_copy(update={"output": str(output / name), "real_time": False, "loop": False}))


def _check_named(path: Path, field: str, recording: RecordingFile) -> None:
    """The report is about bodies that are the same in all trials."""
    if recording.joining is not None:
        raise FileFormatError(path, field, "bodies with names, and nobody who is joining", recording.joining.name)


def _depth(values: Any, keys: Sequence[str]) -> int:
    """How many of the keys lead on, each within the one before."""
    for i, key in enumerate(keys):
        if not isinstance(values, dict) or key not in values:
            return i
        values = values[key]
    return len(keys)


def _merged(values: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """``over`` before ``values``; mappings key by key."""
    both = dict(values)
    for key, value in over.items():
        before = both.get(key)
        both[key] = _merged(before, value) if isinstance(before, dict) and isinstance(value, dict) else value
    return both


def _filled(value: Any, words: Mapping[str, str]) -> Any:
    """The value with ``{trial}`` and ``{subject}`` put in, in every text of it."""
    if isinstance(value, str):
        for word, text in words.items():
            value = value.replace(f"{{{word}}}", text)
        return value
    if isinstance(value, dict):
        return {key: _filled(entry, words) for key, entry in value.items()}
    return [_filled(entry, words) for entry in value] if isinstance(value, list) else value
