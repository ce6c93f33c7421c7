"""The part ``capture`` of a camera in a rig file, and the same on the command line."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from typing import Any, Literal

from pydantic import Field, model_validator

from ...camera.rig import CaptureSettings
from ...errors import TrackerError
from ..file_model import FileModel, PositiveNumber, problem, validate
from ..yaml_file import parse_value


class CaptureEntry(FileModel):
    """`CaptureSettings` as a file states them."""

    pixel_format: str | None = None
    rate_hz: PositiveNumber | None = None
    exposure_us: PositiveNumber | None = None
    gain: int | None = None
    controls: dict[str, int] = Field(default_factory=dict)
    bayer: Literal["rggb", "bggr", "gbrg", "grbg"] | None = None
    publish: Literal["color", "mono", "native", "jpeg"] = "color"
    camera_info_url: str | None = None

    @model_validator(mode="after")
    def _usable(self) -> CaptureEntry:
        try:
            self.settings()
        except ValueError as error:
            raise problem(str(error).partition(", got")[0].removeprefix("expected "), self.pixel_format, "pixel_format") from None
        return self

    def settings(self) -> CaptureSettings:
        """The settings that the entry states."""
        return CaptureSettings(**self.model_dump())


def capture_entry(settings: CaptureSettings) -> CaptureEntry | None:
    """The entry that states ``settings``; None when they are the default."""
    return None if settings == CaptureSettings() else CaptureEntry(**dataclasses.asdict(settings))


def changed_settings(settings: CaptureSettings, changes: Iterable[tuple[str, str]]) -> CaptureSettings:
    """Settings with fields from the command line.

    Parameters
    ----------
    settings, changes : to start from; such as ``("exposure_us", "4000")``, ``("controls.brightness", "3")``.

    Returns
    -------
    New settings.

    Raises
    ------
    FileFormatError : naming the field that is not known, or whose value is wrong.
    """
    values: dict[str, Any] = dataclasses.asdict(settings)
    for name, text in changes:
        group, _, control = name.partition(".")
        if control and group == "controls":
            values["controls"] = {**values["controls"], control: parse_value(text)}
        else:
            values[name] = parse_value(text)
    return validate(CaptureEntry, values, "--capture").settings()


def split_change(text: str, cameras: Iterable[str]) -> tuple[str | None, str, str]:
    """Parts of a change: ``cam1.exposure_us=4000`` -> (``cam1``, ``exposure_us``, ``4000``).

    Parameters
    ----------
    text, cameras : from the command line; names of the cameras.

    Returns
    -------
    (camera or None, field, value).

    Raises
    ------
    TrackerError : no ``=`` in it.
    """
    name, equals, value = text.partition("=")
    if not equals:
        raise TrackerError(f"--capture {text}: expected [CAMERA.]FIELD=VALUE")
    camera, dot, field = name.partition(".")
    return (camera, field, value) if dot and camera in cameras else (None, name, value)
