"""A finished, sound bag from an unfinished or damaged one, so that tools without our patience can open it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ...errors import FileFormatError
from .mcap.contents import LAST_NS, one_text
from .message_types import MessageType
from .reader import BagReader
from .writer import BagWriter


@dataclass(frozen=True)
class Repair:
    """What was copied.

    Parameters
    ----------
    count : messages.
    problem : what was wrong with the source; empty for a sound bag.
    """

    count: int
    problem: str


def repair_bag(source: str | Path, destination: str | Path, compression: str = "none") -> Repair:
    """Copy all that can be read of ``source`` to a new bag with MCAP storage.

    A message whose time ROS cannot hold (`LAST_NS`) gets that of the message before it.

    Raises
    ------
    FileFormatError : nothing in ``source`` can be read.
    BagExistsError : there is something at ``destination``.
    """
    with BagReader(source) as reader:
        custom, problem = reader.custom, reader.problem
    with BagReader(source, scanned=True) as reader:
        with BagWriter(destination, custom=custom, compression=compression) as writer:
            for topic in reader.topics.values():
                definition = MessageType(topic.type_name, topic.definition, topic.type_hash)
                writer.add_topic(topic.name, topic.type_name, topic.qos, definition)
            stamp_ns = n_too_late = 0
            try:
                for message in reader.messages():
                    n_too_late += message.stamp_ns > LAST_NS
                    stamp_ns = message.stamp_ns if message.stamp_ns <= LAST_NS else stamp_ns
                    publish_ns = stamp_ns if message.publish_ns is None else min(message.publish_ns, LAST_NS)
                    writer.write(message.topic, stamp_ns, message.data, publish_ns)
            except FileFormatError as error:  # of a file that is compressed as a whole
                problem = problem or str(error)
        if n_too_late:
            problem = one_text([problem or reader.problem, f"{n_too_late} messages had a time that ROS cannot hold"])
        return Repair(sum(topic.message_count for topic in writer.topics.values()), problem or reader.problem)
