"""What the doctor can find."""

from __future__ import annotations

from dataclasses import dataclass, field

FAULTS = {
    "source": "no images",
    "resolution": "wrong resolution",
    "swapped": "swapped cameras",
    "mirrored": "mirrored axis",
    "unit": "wrong unit",
    "place": "wrong place of a camera",
    "moved": "camera moved during the recording",
    "focal": "wrong focal length",
    "clock": "clock offset",
    "exposure": "exposure changes",
    "interlaced": "interlaced video",
    "repeated": "repeated images",
    "rate": "too low image rate",
}


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong.

    Parameters
    ----------
    fault : key of `FAULTS`.
    cameras : those it concerns; empty for the whole rig.
    sentence : what is wrong, in plain words, and what to do.
    values : the measured numbers behind it.
    """

    fault: str
    cameras: tuple[str, ...]
    sentence: str
    values: dict[str, float] = field(default_factory=dict)
