"""A camera that the others contradict."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

TURNED, DELAYED = "turned", "delayed"


@dataclass(frozen=True)
class CameraFault:
    """A camera that disagrees with the others in one way.

    ``kind`` is `TURNED` (``size`` and ``sigma`` in radians: since the calibration, about its center) or `DELAYED` (seconds by
    which its images are later than their stamps say; negative: earlier). ``rivals`` are cameras of which it might as well be one.
    """

    camera: str
    kind: str
    size: float
    sigma: float
    since_ns: int
    rivals: tuple[str, ...] = ()

    @property
    def text(self) -> str:
        """For people."""
        who = " or ".join((self.camera, *self.rivals))
        if self.kind == TURNED:
            turn = f"{np.degrees(self.size):.1f} degrees (+- {np.degrees(self.sigma):.1f})"
            return f"{who} is turned by {turn} from where its calibration has it"
        when = "late" if self.size > 0 else "early"
        return f"images of {who} are {1e3 * abs(self.size):.0f} ms (+- {1e3 * self.sigma:.0f}) {when}"
