"""Every parameter of the tracker, once: default, unit, range and meaning.

The same frozen dataclasses drive the node (parameters are declared from them), the offline run and the tests. Nested
dataclasses become dotted names: ``evidence.canny_high``.
"""

from __future__ import annotations

from dataclasses import MISSING, dataclass, field, fields, is_dataclass
from typing import Any

from ..errors import FileFormatError


def parameter(default: Any, doc: str, unit: str = "", low: float | None = None, high: float | None = None, choices: tuple = ()):
    """A dataclass field that carries what a parameter declaration needs."""
    return field(default=default, metadata={"doc": doc, "unit": unit, "low": low, "high": high, "choices": choices})


@dataclass(frozen=True)
class SynchronizerConfig:
    """How images become image sets."""

    image_period_s: float = parameter(1 / 30, "nominal time between two images of a camera", "s", 1e-4, 60.0)
    tolerance: float = parameter(0.4, "largest spread of stamps in a set, as a fraction of the image period", "1", 0.0, 0.5)
    queue_s: float = parameter(1.0, "how long an image waits for its partners", "s", 0.0, 60.0)
    min_cameras: int = parameter(0, "smallest number of cameras in a set; 0 means all", "", 0, 64)


@dataclass(frozen=True)
class EvidenceConfig:
    """From images to silhouettes, edges and distances."""

    silhouette: str = parameter("auto", "source of the silhouette", choices=("auto", "plate", "color", "both"))
    canny_low: float = parameter(40.0, "lower hysteresis threshold of the edge detector", "grey levels", 0, 1000)
    canny_high: float = parameter(100.0, "upper hysteresis threshold of the edge detector", "grey levels", 0, 1000)
    margin_px: int = parameter(24, "border around the predicted body that is looked at", "px", 4, 1000)


@dataclass(frozen=True)
class OptimizerConfig:
    """Levenberg-Marquardt on the contour residuals."""

    max_iterations: int = parameter(5, "iterations per image set", "", 1, 200)
    robust_scale_px: float = parameter(8.0, "scale of the robust kernel", "px", 0.1, 1000)
    samples_per_line: int = parameter(25, "contour samples per generator line", "", 2, 1000)
    sliding: bool = parameter(True, "include the sliding of the contour generator in the Jacobian")


@dataclass(frozen=True)
class MotionConfig:
    """Prediction between image sets."""

    velocity_gain: float = parameter(0.5, "how fast the filtered velocity follows the measured one", "1", 0.0, 1.0)


@dataclass(frozen=True)
class TrackerConfig:
    """The tracker's parameters."""

    synchronizer: SynchronizerConfig = field(default_factory=SynchronizerConfig)
    evidence: EvidenceConfig = field(default_factory=EvidenceConfig)
    optimizer: OptimizerConfig = field(default_factory=OptimizerConfig)
    motion: MotionConfig = field(default_factory=MotionConfig)
    threads: int = parameter(2, "worker threads; sums are in fixed order whatever their number", "", 1, 64)


def flatten(config: Any, prefix: str = "") -> dict[str, Any]:
    """``{"evidence.canny_low": 40.0, ...}`` of a config."""
    result: dict[str, Any] = {}
    for f in fields(config):
        value = getattr(config, f.name)
        if is_dataclass(value):
            result.update(flatten(value, f"{prefix}{f.name}."))
        else:
            result[prefix + f.name] = value
    return result


def describe(cls: type = TrackerConfig, prefix: str = "") -> dict[str, dict[str, Any]]:
    """Dotted name -> {default, doc, unit, low, high, choices} of every parameter."""
    result: dict[str, dict[str, Any]] = {}
    for f in fields(cls):
        if f.default_factory is not MISSING:
            result.update(describe(f.default_factory, f"{prefix}{f.name}."))  # type: ignore[arg-type]
        else:
            result[prefix + f.name] = {"default": f.default, **f.metadata}
    return result


def from_dict(values: dict[str, Any], source: str = "tracker config") -> TrackerConfig:
    """Config from a nested (or dotted) mapping; unknown keys, wrong types and values out of range are refused.

    Raises
    ------
    FileFormatError : naming ``source`` and the field.
    """
    return _build(TrackerConfig, _nested(values, source), source, "")


def _nested(values: dict[str, Any], source: str) -> dict[str, Any]:
    result: dict[str, Any] = {}
    for key, value in values.items():
        *path, last = str(key).split(".")
        here = result
        for part in path:
            here = here.setdefault(part, {})
        if isinstance(value, dict):
            value = _nested(value, source)
            here.setdefault(last, {}).update(value)
        else:
            here[last] = value
    return result


def _build(cls: type, values: dict[str, Any], source: str, prefix: str):
    known = {f.name: f for f in fields(cls)}
    for key in values:
        if key not in known:
            raise FileFormatError(source, prefix + key, f"one of {sorted(known)}", key)
    arguments: dict[str, Any] = {}
    for name, value in values.items():
        f = known[name]
        if f.default_factory is not MISSING:
            if not isinstance(value, dict):
                raise FileFormatError(source, prefix + name, "a mapping", value)
            arguments[name] = _build(f.default_factory, value, source, f"{prefix}{name}.")  # type: ignore[arg-type]
        else:
            arguments[name] = _checked(value, f, source, prefix + name)
    return cls(**arguments)


def _checked(value: Any, f, source: str, name: str):
    kind = type(f.default)
    if kind is float and isinstance(value, int) and not isinstance(value, bool):
        value = float(value)
    if type(value) is not kind:
        raise FileFormatError(source, name, f"a {kind.__name__}", value)
    low, high, choices = f.metadata["low"], f.metadata["high"], f.metadata["choices"]
    if kind in (int, float) and not ((low is None or value >= low) and (high is None or value <= high)):
        raise FileFormatError(source, name, f"a number in [{low}, {high}] {f.metadata['unit']}".rstrip(), value)
    if choices and value not in choices:
        raise FileFormatError(source, name, f"one of {sorted(choices)}", value)
    return value
