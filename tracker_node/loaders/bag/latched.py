"""What latched topics have said last, for the files of a bag that begin later."""

from __future__ import annotations

import struct
from typing import Any

from rosbags.serde import SerdeError

from .message_types import typestore
from .metadata import TopicRecord

_TRANSFORMS = "tf2_msgs/msg/TFMessage"


class LatchedMessages:
    """Keeps the last message of every latched topic, to be told again at the beginning of the next file.

    Of several publishers of one topic only the last that has spoken is known. Transforms (``/tf_static``) are the exception,
    for there several publishers are the rule: one message holds the last of every child frame, whoever sent it.

    Parameters
    ----------
    wanted : otherwise nothing is kept.

    Attributes
    ----------
    told : topics of which this file holds a message again.
    """

    def __init__(self, wanted: bool):
        self._wanted = wanted
        self._last: dict[str, tuple[int, bytes]] = {}  # topic -> when it was sent, and the message
        self._due: dict[str, tuple[int, bytes]] = {}
        self._frames: dict[str, dict[str, Any]] = {}  # topic -> child frame -> its transform
        self.told: set[str] = set()

    def keep(self, topic: TopicRecord, publish_ns: int, data: bytes) -> None:
        """A message has been written."""
        if self._wanted and topic.qos.durability == "transient_local":
            self._last[topic.name] = (publish_ns, self._merged(topic.name, data) if topic.type_name == _TRANSFORMS else data)

    def _merged(self, topic: str, data: bytes) -> bytes:
        """The transforms of a message with those that the topic has told of other frames."""
        try:
            said: Any = typestore().deserialize_cdr(data, _TRANSFORMS)
        except (SerdeError, struct.error, ValueError, IndexError, KeyError):
            return data  # as with any other topic
        frames = self._frames.setdefault(topic, {})
        frames.update({transform.child_frame_id: transform for transform in said.transforms})
        message = typestore().types[_TRANSFORMS](transforms=list(frames.values()))
        return bytes(typestore().serialize_cdr(message, _TRANSFORMS))

    def begin_file(self) -> None:
        """All that is kept is to be told again in it."""
        self._due, self.told = dict(self._last), set()

    def take(self, topic: str) -> list[tuple[str, int, bytes]]:
        """Topic, time and bytes of what comes before the first message of a file, which is one of ``topic``."""
        due = [(name, *kept) for name, kept in self._due.items() if name != topic or name in self._frames]
        self._due = {}
        self.told.update(name for name, _, _ in due)
        return due
