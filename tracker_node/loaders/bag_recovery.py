"""A finished bag from an unfinished one, so that tools without our patience can open it."""

from __future__ import annotations

from pathlib import Path

from .bag_reader import BagReader
from .bag_writer import BagWriter
from .message_types import MessageType


def recover_bag(source: str | Path, destination: str | Path) -> tuple[int, str]:
    """Copy all that can be read of ``source`` to a new bag.

    Returns
    -------
    The number of messages, and what was wrong with the source (empty for a finished bag).

    Raises
    ------
    FileFormatError : nothing in ``source`` can be read.
    BagExistsError : there is something at ``destination``.
    """
    with BagReader(source) as reader, BagWriter(destination, custom=reader.custom) as writer:
        for topic in reader.topics.values():
            definition = MessageType(topic.type_name, topic.definition, topic.type_hash)
            writer.add_topic(topic.name, topic.type_name, topic.qos, definition)
        count = 0
        for message in reader.messages():
            writer.write(message.topic, message.stamp_ns, message.data)
            count += 1
        return count, reader.problem
