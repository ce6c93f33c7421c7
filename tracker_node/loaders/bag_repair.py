"""A finished, sound bag from an unfinished or damaged one, so that tools without our patience can open it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ..errors import FileFormatError
from .bag_reader import BagReader
from .bag_scan import SCANNERS
from .bag_writer import BagWriter
from .message_types import MessageType


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

    Raises
    ------
    FileFormatError : nothing in ``source`` can be read.
    BagExistsError : there is something at ``destination``.
    """
    with BagReader(source) as reader:
        custom, problem = reader.custom, reader.problem
        scannable = all(file.suffix in SCANNERS for file in reader.files)
    with BagReader(source, scanned=scannable) as reader:
        with BagWriter(destination, custom=custom, compression=compression) as writer:
            for topic in reader.topics.values():
                definition = MessageType(topic.type_name, topic.definition, topic.type_hash)
                writer.add_topic(topic.name, topic.type_name, topic.qos, definition)
            try:
                for message in reader.messages():
                    writer.write(message.topic, message.stamp_ns, message.data)
            except FileFormatError as error:  # of a file that is compressed as a whole
                problem = problem or str(error)
        return Repair(sum(topic.message_count for topic in writer.topics.values()), problem or reader.problem)
