"""What is found in one file of a bag by reading it from its beginning, whatever its condition."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from mcap.records import Channel, Schema

MOST_BYTES = 2**30
"""Of one chunk or message when it is unpacked: what claims to be larger is taken as damaged."""
LAST_NS = 2**63 - 1
"""The latest time that ROS can hold (in the year 2262); MCAP files have room for later ones."""


@dataclass(frozen=True)
class RawMessage:
    """A message as it stands in the file."""

    channel: int
    stamp_ns: int
    publish_ns: int
    data: bytes


@dataclass
class FileContents:
    """What a file holds.

    Attributes
    ----------
    schemas, channels, counts : message types; topics; messages of each channel, by their numbers in the file.
    problems : what is wrong with it; empty for a finished, undamaged file.
    indexed : whether it has an index.
    """

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: dict[int, int] = field(default_factory=dict)
    start_ns: int = 0
    end_ns: int = 0
    problems: list[str] = field(default_factory=list)
    indexed: bool = False

    @property
    def message_count(self) -> int:
        return sum(self.counts.values())

    @property
    def problem(self) -> str:
        """The problems as one text."""
        return one_text(self.problems)

    def count(self, message: RawMessage) -> None:
        """Take note of a message."""
        if not self.counts:
            self.start_ns = self.end_ns = message.stamp_ns
        self.counts[message.channel] = self.counts.get(message.channel, 0) + 1
        self.start_ns = min(self.start_ns, message.stamp_ns)
        self.end_ns = max(self.end_ns, message.stamp_ns)


def one_text(problems: Iterable[str], most: int = 4) -> str:
    """Several problems as one text, the same ones once, and not more than a person reads."""
    different = list(dict.fromkeys(problems))
    more = [f"and {len(different) - most} more"] if len(different) > most else []
    return "; ".join([*different[:most], *more])
