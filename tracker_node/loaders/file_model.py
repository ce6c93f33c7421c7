"""Formats of files as classes of pydantic: a closed set of fields, and errors that name file, field and what was expected.

A file of another kind is recognized by its keys, so that who gives the wrong file reads which one it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError, model_validator
from pydantic_core import PydanticCustomError

from ..errors import FileFormatError, WrongKindOfFileError, shown

LARGEST = 1e12  # no length, angle or pixel of a real scene is beyond
_MOST_REPORTED = 5  # problems of a file, in one message
UNKNOWN = "unknown_keys"  # type of pydantic's error for them


class FileModel(BaseModel):
    """Base of every validated part of a file: closed set of fields, no coercion of text to numbers.

    ``KIND``: what a whole file is called (`check_kind`); empty for parts.
    """

    KIND: ClassVar[str] = ""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=False, arbitrary_types_allowed=False)

    @model_validator(mode="before")
    @classmethod
    def _known_fields_only(cls, values: Any) -> Any:
        if isinstance(values, dict):
            unknown = [key for key in values if key not in cls.model_fields]
            if unknown:
                free = [name for name in cls.model_fields if name not in values]
                context = {"keys": unknown, "valid": sorted(cls.model_fields), "free": free}
                raise PydanticCustomError(UNKNOWN, "unknown keys", context)
        elif not isinstance(values, BaseModel):
            raise problem("a mapping", values)
        return values


def problem(expected: str, got: object, field: str = "") -> PydanticCustomError:
    """The error that a validator raises.

    Parameters
    ----------
    expected, got : what the message says.
    field : relative to where the validator stands.

    Returns
    -------
    Error to raise.
    """
    context = {"expected": expected, "got": list(got) if isinstance(got, tuple) else got, "field": field}
    return PydanticCustomError("format", "expected {expected}", context)


def is_number(value: Any) -> bool:
    """True for a number that a file may hold; beyond `LARGEST` squares and cosines lose their meaning."""
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) <= LARGEST


def are_numbers(value: Any, n: int) -> bool:
    """Whether a value of a file is a list of numbers.

    Parameters
    ----------
    value, n : anything; the length it is to have.

    Returns
    -------
    True for ``n`` numbers, each as `is_number` wants it.
    """
    return isinstance(value, (list, tuple)) and len(value) == n and all(map(is_number, value))


def floats(values: Iterable[float]) -> tuple[float, ...]:
    """The numbers as a tuple of float."""
    return tuple(map(float, values))


def checked(expected: str, holds: Callable[[Any], Any], made: Callable[[Any], Any] = lambda value: value) -> BeforeValidator:
    """Validator of a field by one condition.

    Parameters
    ----------
    expected : what the message says was expected.
    holds, made : condition that a value must meet; what becomes of one that does.

    Returns
    -------
    Metadata for ``Annotated``.
    """

    def check(value: Any) -> Any:
        if not holds(value):
            raise problem(expected, value)
        return made(value)

    return BeforeValidator(check)


def _checked_numbers(value: Any, shape: tuple[int | None, ...]) -> Any:
    array = value.tolist() if isinstance(value, np.ndarray) else value
    if not shape:
        if not is_number(array):
            raise ValueError
        return float(array)
    if not isinstance(array, (list, tuple)) or (shape[0] is not None and len(array) != shape[0]):
        raise ValueError
    return tuple(_checked_numbers(item, shape[1:]) for item in array)


def numbers(*shape: int | None, what: str = "") -> Any:
    """Type of finite numbers of a shape, for fields of a `FileModel`.

    Parameters
    ----------
    *shape : such as ``numbers(3, 3)``; ``None`` stands for any length; ``numbers()`` is one number.
    what : expectation in the message; by default the shape.

    Returns
    -------
    Annotated tuple of tuples of float.
    """
    sizes = " x ".join("n" if size is None else str(size) for size in shape)
    expected = what or (f"{sizes} finite numbers" if shape else "a finite number")

    def check(value: Any) -> Any:
        try:
            return _checked_numbers(value, shape)
        except (ValueError, OverflowError):
            raise problem(expected, value) from None

    inner: Any = float
    for _ in shape:
        inner = tuple[inner, ...]
    return Annotated[inner, BeforeValidator(check)]


Number = numbers()
PositiveNumber = Annotated[float, checked("a positive number", lambda value: is_number(value) and value > 0.0, float)]
T = TypeVar("T", bound=BaseModel)


def validate(format_class: type[T], values: dict[str, Any], path: str | Path) -> T:
    """Content of a file checked against a format.

    Parameters
    ----------
    format_class, values, path : class of the format; content; file, for messages.

    Returns
    -------
    Object of ``format_class``.

    Raises
    ------
    WrongKindOfFileError : the file is a body where a rig is asked for, say.
    FileFormatError : with all that is wrong, up to a handful: unknown keys before what may come of them.
    """
    try:
        return format_class.model_validate(values)
    except ValidationError as error:
        if issubclass(format_class, FileModel) and format_class.KIND:
            check_kind(values, format_class.KIND, path)
        problems = [found for one in error.errors(include_url=False) for found in _problems_of(one, values)]
        problems.sort(key=lambda found: not found.unknown)  # stable
        first, *others = _together(problems)
        also = [f"the same in {first.elsewhere}"] if first.elsewhere else []
        also += [found.sentence() for found in others[: _MOST_REPORTED - 1]]
        if len(others) >= _MOST_REPORTED:
            also.append(f"and {len(others) - _MOST_REPORTED + 1} more problems in this file")
        raise FileFormatError(path, first.field, first.expected, first.got, also) from None


class _Problem(NamedTuple):
    """A problem of a file, in the file's own terms."""

    field: str
    expected: str
    got: object
    unknown: bool = False
    elsewhere: str = ""  # fields with the same

    def sentence(self) -> str:
        same = f"; the same in {self.elsewhere}" if self.elsewhere else ""
        return f"field '{self.field}': expected {self.expected[:400]}, got {shown(self.got)}{same}"


def _together(problems: Iterable[_Problem]) -> list[_Problem]:
    """The problems, with one for a key that is unknown in several places: of each camera, say."""
    groups: dict[tuple[str, str, int], list[_Problem]] = {}
    for i, found in enumerate(problems):
        groups.setdefault((found.expected, shown(found.got), -1 if found.unknown else i), []).append(found)
    merged = []
    for first, *others in groups.values():
        fields = [f"'{found.field}'" for found in others[:_MOST_REPORTED]]
        more = [f"{len(others) - _MOST_REPORTED} more"] if len(others) > _MOST_REPORTED else []
        merged.append(first._replace(elsewhere=", ".join(fields + more)))
    return merged


def _problems_of(error: Any, values: Any) -> list[_Problem]:
    """The problems that an error of pydantic stands for: one, or each of several keys that are not known."""
    context = error.get("ctx", {})
    field = _dotted(error["loc"], values, error["type"])
    if error["type"] == UNKNOWN:
        return [_unknown_key(field, str(key), context["valid"], context["free"]) for key in context["keys"]]
    if error["type"] == "format":
        field = ".".join(part for part in (field, context["field"]) if part)
        return [_Problem(field or "(top level)", context["expected"], context["got"])]
    return [_Problem(field or "(top level)", *_expected_and_got(error))]


def _unknown_key(field: str, key: str, valid: list[str], free: list[str]) -> _Problem:
    return _Problem(".".join(part for part in (field, key) if part), known_keys(key, valid, free), key, unknown=True)


def known_keys(key: str, valid: list[str], free: list[str]) -> str:
    """What was expected in place of an unknown key: first the one that may have been meant.

    Parameters
    ----------
    key, valid, free : unknown one; known ones; those of them that are not there yet.

    Returns
    -------
    Text for a message.
    """
    near = get_close_matches(key, free, n=1, cutoff=0.6) or get_close_matches(key, valid, n=1, cutoff=0.8)
    return f"'{near[0]}', or another of {valid}" if near else f"one of {valid}"


def _expected_and_got(error: Any) -> tuple[str, object]:
    if error["type"] == "missing":
        return "a value", "nothing"
    if error["type"] == "union_tag_not_found":
        return f"a field {error['ctx']['discriminator']}", "none"
    if error["type"] == "union_tag_invalid":
        return f"{error['ctx']['discriminator']} to be one of {error['ctx']['expected_tags']}", error["ctx"]["tag"]
    message = error["msg"]
    for prefix in ("Input should be ", "Value error, "):
        message = message.removeprefix(prefix)
    return message, error["input"]


def _dotted(location: tuple[int | str, ...], values: Any, kind: str) -> str:
    """Dotted path of an error in the file's own terms: tags that pydantic adds for unions are left out."""
    parts, here = [], values
    for i, part in enumerate(location):
        last = i == len(location) - 1
        if isinstance(here, dict) and part in here:
            here = here[part]
        elif isinstance(here, (list, tuple)) and isinstance(part, int) and part < len(here):
            here = here[part]
        elif not (last and kind == "missing"):
            continue
        parts.append(str(part))
    return ".".join(parts)


RIG, BODY, STATE, RECORDING, PARAMETERS = "a rig", "a body", "a state", "a recording", "a file of parameters"
KEYPOINTS, TRIALS = "a table of keypoints", "a list of trials"
_SECTIONS = {  # of parameters; but keypoints, which a recording has, too
    *("synchronizer", "initialization", "motion", "background", "region", "chamfer", "color", "texture"),
    *("color_over_background", "joint", "collision", "floor", "status", "limb_search", "self_check"),
    *("evidence", "optimizer", "start", "together"),  # of version 0.1
}


def kind_of(values: Mapping[Any, Any]) -> str:
    """Kind of a file, with its article; empty where its keys do not identify one."""
    if isinstance(values.get("metrics"), dict):
        return "a file of metrics"
    if "image_sets" in values and "status_counts" in values:
        return "the summary of a run"
    if "rosbag2_bagfile_information" in values:
        return "the metadata of a bag"
    if "image_width" in values and ("camera_matrix" in values or "camera_name" in values):
        return "a ROS camera_info file (rig import reads it)"
    cameras = values.get("cameras")
    if isinstance(cameras, dict) and "rig" not in values:
        masks = any(isinstance(entry, dict) and not {"polygons", "still"}.isdisjoint(entry) for entry in cameras.values())
        return "a file of reference masks" if masks else RIG
    if isinstance(values.get("links"), list):
        return BODY
    if isinstance(values.get("rig"), str) and "model" in values:
        return RECORDING
    if isinstance(values.get("root"), dict):
        return STATE
    if isinstance(values.get("points"), dict):
        return KEYPOINTS
    if isinstance(values.get("trials"), dict):
        return TRIALS
    sections = [value for value in values.values() if isinstance(value, dict)]
    if any("ros__parameters" in section for section in sections):
        return PARAMETERS
    return PARAMETERS if any(key in _SECTIONS and isinstance(value, dict) for key, value in values.items()) else ""


def check_kind(values: Mapping[Any, Any], wanted: str, path: str | Path) -> None:
    """Refuse a file that is known to be of another kind.

    Parameters
    ----------
    values, wanted, path : content; one of the kinds of this module; file, for messages.

    Raises
    ------
    WrongKindOfFileError : with the kind that it is.
    """
    found = kind_of(values)
    if found and found != wanted:
        raise WrongKindOfFileError(path, found, wanted)
