"""What a recorder says of itself on /diagnostics."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field

from ..diagnostics import ERROR, OK, WARN

MB = 2**20
FULL_SOON_S = 600.0
FULL_NOW_S = 60.0
_BEHIND = 0.5  # fraction of the queue
_STUCK_S = 2.0  # without handing anything to the operating system
_SILENT_S = 3.0
_SILENT_PERIODS = 10.0
_STEADY = 30  # messages, over at least _SILENT_S, from which on a topic has a rate
ON_OCCASION = frozenset(  # types of messages that tell of events, and have no rate
    f"{package}/msg/{name}"
    for package, name in (
        ("rcl_interfaces", "ParameterEvent"), ("rcl_interfaces", "Log"), ("lifecycle_msgs", "TransitionEvent"),
        ("action_msgs", "GoalStatusArray"), ("service_msgs", "ServiceEventInfo"),
    )
)  # fmt: skip

WHILE_KNOWN = ("pose", "twist", "joint_states")  # a tracker publishes these, and /tf, while it knows where the body is


@dataclass
class TopicPace:
    """How messages of one topic come, ``count`` since the last pause; times in seconds of the monotonic clock.

    ``on_occasion``: they tell of events, so that no silence is a fault.
    """

    count: int = 0
    first_s: float = 0.0
    last_s: float = 0.0
    before: int = 0  # messages before the last pause
    on_occasion: bool = False

    def add(self) -> None:
        """A message has come."""
        self.last_s = time.monotonic()
        if not self.count:
            self.first_s = self.last_s
        self.count += 1

    def begin_again(self) -> None:
        """After a pause, in which nothing was counted."""
        self.before, self.count = self.before + self.count, 0

    @property
    def rate_hz(self) -> float:
        """Mean rate from the first message to the last; 0 while there are less than two."""
        return (self.count - 1) / (self.last_s - self.first_s) if self.count > 1 and self.last_s > self.first_s else 0.0

    def silent_s(self, now_s: float) -> float:
        """How long nothing has come where something should have; 0 if all is well."""
        burst = self.last_s - self.first_s < _SILENT_S  # what a node says once as it starts
        if self.on_occasion or burst or self.count < _STEADY or self.rate_hz < 1.0:
            return 0.0
        silent_s = now_s - self.last_s
        return silent_s if silent_s > max(_SILENT_S, _SILENT_PERIODS / self.rate_hz) else 0.0


@dataclass(frozen=True)
class RecorderState:
    """What is known of a recorder at one moment.

    Parameters
    ----------
    problem : why it has stopped; empty while it records.
    paused : by somebody who asked for it.
    messages : in the bag.
    size, free_bytes, room_bytes : of the bag; on its disk; on its disk until it stops.
    waiting : fraction of the queue that is in use, 0 to 1.
    unsaved_s : age of the oldest message that a kill would cost.
    lost, dropped : messages that did not arrive; that came and were not written.
    dropping : whether some were dropped since the last report.
    bytes_per_s, messages_per_s : over the last reports.
    refused : topics that are not recorded, with the reason.
    """

    problem: str = ""
    paused: bool = False
    messages: int = 0
    size: int = 0
    free_bytes: int = 0
    room_bytes: int = 0
    waiting: float = 0.0
    unsaved_s: float = 0.0
    lost: int = 0
    dropped: int = 0
    dropping: bool = False
    bytes_per_s: float = 0.0
    messages_per_s: float = 0.0
    topics: int = 0
    files: int = 1
    refused: Mapping[str, str] = field(default_factory=dict)

    @property
    def full_in_s(self) -> float:
        """Seconds until the disk is full at this rate; infinite while nothing is written."""
        return self.room_bytes / self.bytes_per_s if self.bytes_per_s > 0 else float("inf")

    def status(self) -> tuple[bytes, str]:
        """Level and message, the worst first."""
        if self.problem:
            return ERROR, self.problem
        if self.dropping:
            return ERROR, f"the disk is too slow: {self.dropped} messages dropped so far"
        if self.full_in_s < FULL_NOW_S:
            return ERROR, f"the disk is full in {self.full_in_s:.0f} s"
        warning = self._warning()
        if warning:
            return WARN, warning
        if self.paused:
            return OK, "paused"
        return OK, "recording" if self.messages else "waiting for messages"

    def _warning(self) -> str:
        if self.dropped:
            return f"{self.dropped} messages are missing: the disk was too slow"
        if self.lost:
            return f"{self.lost} messages are missing: they did not arrive"
        if self.full_in_s < FULL_SOON_S:
            return f"the disk is full in {self.full_in_s / 60.0:.0f} min"
        if self.waiting > _BEHIND:
            return f"the disk falls behind: {100.0 * self.waiting:.0f} % of the queue is in use"
        if self.unsaved_s > _STUCK_S:
            return f"the disk stands still: nothing written for {self.unsaved_s:.0f} s"
        if self.refused:
            return f"not recorded: {', '.join(sorted(self.refused))}"
        return ""

    def values(self) -> dict[str, object]:
        """Counts and rates, as shown."""
        return {
            "topics": self.topics,
            "messages": self.messages,
            "rate [1/s]": self.messages_per_s,
            "written [MB/s]": self.bytes_per_s / MB,
            "size [MB]": self.size / MB,
            "files": self.files,
            "free [MB]": self.free_bytes // MB,
            "full in [s]": f"{self.full_in_s:.0f}",
            "queue [%]": 100.0 * self.waiting,
            "unsaved [s]": self.unsaved_s,
            "lost": self.lost,
            "dropped": self.dropped,
        }


def topics_status(
    paces: Mapping[str, TopicPace], lost: Mapping[str, int], published: Mapping[str, int], now_s: float
) -> tuple[bytes, str, dict[str, object]]:
    """Diagnostic status of the recorded topics.

    Parameters
    ----------
    paces : by topic.
    lost : messages that never arrived, by topic.
    published : publishers by topic; a topic without any may be silent.
    now_s : steady time, as of the paces.

    Returns
    -------
    level, message, values : WARN where a published topic is silent; a line for each topic.
    """
    silent = {}
    values: dict[str, object] = {}
    for topic, pace in sorted(paces.items()):
        missing = f", {lost[topic]} lost" if lost.get(topic) else ""
        values[topic] = f"{pace.before + pace.count} messages, {pace.rate_hz:.1f} Hz{missing}"
        silent_s = pace.silent_s(now_s)
        if silent_s and published.get(topic):
            silent[topic] = f"{topic} for {silent_s:.0f} s"
    if silent:
        return WARN, f"published, but nothing comes: {', '.join(silent.values())}", values
    return OK, f"{len(paces)} topics", values
