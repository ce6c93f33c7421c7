"""What latched topics have said last, for the files of a bag that begin later."""

from __future__ import annotations

from .bag_metadata import TopicRecord


class LatchedMessages:
    """Keeps the last message of every latched topic, to be told again at the beginning of the next file.

    Of several publishers of one topic only the last that has spoken is known.

    Parameters
    ----------
    wanted : otherwise nothing is kept.

    Attributes
    ----------
    told : topics of which this file holds a message again.
    size : bytes of these messages.
    """

    def __init__(self, wanted: bool):
        self._wanted = wanted
        self._last: dict[str, tuple[int, bytes]] = {}  # topic -> when it was sent, and the message
        self._due: dict[str, tuple[int, bytes]] = {}
        self.told: set[str] = set()
        self.size = 0

    def keep(self, topic: TopicRecord, publish_ns: int, data: bytes) -> None:
        """A message has been written."""
        if self._wanted and topic.qos.durability == "transient_local":
            self._last[topic.name] = (publish_ns, data)

    def begin_file(self) -> None:
        """All that is kept is to be told again in it."""
        self._due, self.told, self.size = dict(self._last), set(), 0

    def take(self, topic: str) -> list[tuple[str, int, bytes]]:
        """Topic, time and bytes of what comes before the first message of a file, which is one of ``topic``."""
        due = [(name, publish_ns, data) for name, (publish_ns, data) in self._due.items() if name != topic]
        self._due = {}
        self.told.update(name for name, _, _ in due)
        self.size += sum(len(data) for _, _, data in due)
        return due
