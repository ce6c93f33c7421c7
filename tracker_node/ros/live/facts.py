"""What a live view remembers of a tracker and of /diagnostics, as plain values."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from tracker_msgs.msg import TrackedState

from ...loaders.json_values import finite
from ...tracking.estimate import LimbStatus, Status
from ..conversions import stamp_ns_of

HISTORY = 4000  # states: more than two minutes at 30 Hz
_RATE_OVER_S = 2.0
_LIKELY_LATENCY_S = 600.0  # stamps farther from now are of another clock, such as those of a file


@dataclass(frozen=True)
class StatePoint:
    """One state, for curves; ``latency_ms`` from its stamp to its arrival, None where stamps are not of this clock."""

    number: int
    arrival_s: float
    status: str
    residual: float | None
    total_ms: float | None
    latency_ms: float | None


class LiveTracker:
    """The newest state of a tracker, and a history of figures."""

    def __init__(self) -> None:
        self._history: deque[StatePoint] = deque(maxlen=HISTORY)
        self.latest: TrackedState | None = None

    def take(self, message: TrackedState) -> None:
        """A state that has arrived."""
        latency_s = 1e-9 * (time.time_ns() - stamp_ns_of(message.header.stamp))
        likely = -0.1 < latency_s < _LIKELY_LATENCY_S
        number = self._history[-1].number + 1 if self._history else 1
        self._history.append(
            StatePoint(
                number, time.monotonic(), _name(Status, message.status), finite(message.residual), finite(message.total_ms),
                1e3 * latency_s if likely else None,
            )
        )  # fmt: skip
        self.latest = message

    def points_after(self, number: int) -> list[StatePoint]:
        """States that arrived after that of this number; from any thread."""
        return [point for point in tuple(self._history) if point.number > number]

    def rate_hz(self) -> float:
        """States per second, of the last two seconds."""
        since_s = time.monotonic() - _RATE_OVER_S
        return sum(point.arrival_s > since_s for point in tuple(self._history)) / _RATE_OVER_S

    def facts(self) -> dict[str, Any] | None:
        """The newest state in plain values; None before the first."""
        message = self.latest
        if message is None:
            return None
        limbs = zip(message.limbs, message.limb_status, message.limb_lost_probability, message.limb_reasons, strict=False)
        cameras = zip(message.cameras, message.camera_residuals, message.camera_samples, strict=False)
        return {
            "age_s": time.monotonic() - self._history[-1].arrival_s,
            "status": _name(Status, message.status),
            "reason": message.status_reason,
            "model": message.model,
            "stamp_s": 1e-9 * stamp_ns_of(message.header.stamp),
            "residual": finite(message.residual),
            "residual_unit": message.residual_unit,
            "iterations": message.iterations,
            "dofs": [[name, finite(value)] for name, value in zip(message.dof_names, message.values, strict=False)],
            "limbs": [[name, _name(LimbStatus, status), finite(lost), reason] for name, status, lost, reason in limbs],
            "cameras": [[name, finite(residual), samples] for name, residual, samples in cameras],
        }


class LiveDiagnostics:
    """The newest status of every part of every node."""

    def __init__(self) -> None:
        self._statuses: dict[tuple[str, str], tuple[float, Any]] = {}

    def take(self, message: DiagnosticArray) -> None:
        """Statuses that have arrived."""
        for status in message.status:
            self._statuses[status.name, status.hardware_id] = time.monotonic(), status

    def facts(self) -> list[dict[str, Any]]:
        """Statuses in plain values, by name; ``level`` 0 (OK) to 3 (STALE); ``age_s`` since they were said last."""
        now_s = time.monotonic()
        return [
            {
                "name": status.name,
                "hardware_id": status.hardware_id,
                "level": _level(status.level),
                "message": status.message,
                "values": [[value.key, value.value] for value in status.values],
                "age_s": now_s - arrival_s,
            }
            for _, (arrival_s, status) in sorted(self._statuses.copy().items())
        ]


def _level(level: bytes | Sequence[int] | int) -> int:
    """A ROS byte, which is ``bytes`` of length one."""
    return level if isinstance(level, int) else level[0]


def _name(kind: type[IntEnum], number: int) -> str:
    """Others may send any number."""
    return kind(number).name if number in set(kind) else f"{kind.__name__.upper()} {number}"
