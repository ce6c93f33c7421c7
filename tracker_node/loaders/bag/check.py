"""Check of a bag: everything in it read once, and compared with its metadata and index; and a finished copy of a damaged one."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from ...errors import FileFormatError
from ..yaml_file import read_mapping
from .mcap_recovery import LAST_NS, FileContents, one_text, scan
from .message_types import MessageType
from .metadata import METADATA_FILE, BagTopic, OfferedQos
from .reader import BagReader
from .writer import BagWriter

GAP_PERIODS = 3.0
_MOST_PROBLEMS = 20  # of one file
_STEADY = 10  # messages from which on a topic has a period
_STEADY_SPREAD = 0.5  # of the middle half of the periods, over their median


@dataclass(frozen=True)
class TopicMetrics:
    """One topic of a bag.

    Parameters
    ----------
    count : messages that can be read.
    rate_hz : their mean rate; 0 for less than two.
    longest_s : longest time between two.
    gaps : times that are longer than `GAP_PERIODS` usual periods, on a topic that comes at a steady rate.
    backwards : messages with an earlier time than the one before.
    """

    topic: BagTopic
    count: int = 0
    rate_hz: float = 0.0
    longest_s: float = 0.0
    gaps: int = 0
    backwards: int = 0


@dataclass
class BagCheck:
    """What was found.

    Attributes
    ----------
    remedy : what makes a finished bag of a damaged one of its kind.
    problems : what is wrong with the bag; empty for an undamaged one.
    notes : what is worth knowing of an undamaged one.
    seconds : from the first message to the last.
    """

    path: Path
    remedy: str
    topics: list[TopicMetrics] = field(default_factory=list)
    problems: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    files: int = 0
    size: int = 0
    start_ns: int = 0
    end_ns: int = 0
    repairable: bool = False

    @property
    def sound(self) -> bool:
        return not self.problems

    @property
    def seconds(self) -> float:
        return (self.end_ns - self.start_ns) * 1e-9

    @property
    def message_count(self) -> int:
        return sum(each.count for each in self.topics)

    @property
    def advice(self) -> str:
        """What to do about the problems; empty if there are none."""
        if not self.problems:
            return ""
        if not self.repairable:
            return "Nothing more can be read: take a copy from before the damage."
        return f"Readable as far as it goes by this package; {self.remedy} to a bag that everybody can open."


def check_bag(path: str | Path, on_file: Callable[[Path], None] = lambda file: None) -> BagCheck:
    """Read all of a bag, and compare what was read with what the bag says of itself.

    Parameters
    ----------
    path : bag folder, or a file of one.
    on_file : called before each file is read.

    Returns
    -------
    Problems, notes, and rate and gaps of every topic.

    Raises
    ------
    FileFormatError : no bag, or nothing in it can be read.
    """
    with BagReader(path) as reader:
        size = sum(file.stat().st_size for file in reader.files)
        check = BagCheck(reader.path, reader.remedy, files=len(reader.files), size=size)
        if reader.recovered:
            check.problems.append(f"not finished: {reader.problem}")
        else:
            _check_metadata(reader, check)
        stamps: dict[str, list[int]] = {name: [] for name in reader.topics}
        too_late: Counter[str] = Counter()
        known = dict(reader.topics)
        for topic, stamp_ns in _read_all(reader, check, on_file, known):
            stamps.setdefault(topic, []).append(min(stamp_ns, LAST_NS))
            too_late[topic] += stamp_ns > LAST_NS
        check.problems += [f"{name}: {n} messages with a time that ROS cannot hold" for name, n in sorted(too_late.items()) if n]
        check.topics = [figures_of(known[name], np.array(times, np.int64)) for name, times in sorted(stamps.items())]
        check.repairable = check.message_count > 0
        found = [time for times in stamps.values() for time in (min(times, default=None), max(times, default=None)) if time]
        check.start_ns, check.end_ns = min(found, default=0), max(found, default=0)
        _check_counts(reader, check)
        _note(reader, check)
    return check


def figures_of(topic: BagTopic, stamps_ns: np.ndarray) -> TopicMetrics:
    """Rate, gaps and order of a topic.

    Parameters
    ----------
    topic : as the bag lists it.
    stamps_ns : (n,) of its messages in nanoseconds, in the order of the file.

    Returns
    -------
    Count, rate and gaps; the latter two are zero for fewer than two messages.
    """
    n = len(stamps_ns)
    if n < 2:
        return TopicMetrics(topic, n)
    steps = np.diff(stamps_ns) * 1e-9
    span_s = (int(stamps_ns.max()) - int(stamps_ns.min())) * 1e-9
    usual = float(np.median(steps))
    low, high = np.percentile(steps, [25, 75])
    steady = n >= _STEADY and usual > 0 and high - low < _STEADY_SPREAD * usual
    gaps = int(np.count_nonzero(steps > GAP_PERIODS * usual)) if steady else 0
    rate_hz = (n - 1) / span_s if span_s > 0 else 0.0
    return TopicMetrics(topic, n, rate_hz, float(steps.max()), gaps, int(np.count_nonzero(steps < 0)))


def _read_all(
    reader: BagReader, check: BagCheck, on_file: Callable[[Path], None], topics: dict[str, BagTopic]
) -> Iterator[tuple[str, int]]:
    """Topic and time of every message, from the files themselves where they are MCAP and not compressed as a whole.

    Topics that only the files know, since they were renamed in one of the places, are added to ``topics``.
    """
    if reader.scannable:
        for file in reader.files:
            on_file(file)
            contents = FileContents()
            for message in scan(file, contents):
                name = contents.channels[message.channel].topic
                if name not in topics:
                    topics[name] = _unlisted(contents, message.channel)
                    check.problems.append(f"{name}: in {file.name}, but not in {METADATA_FILE}")
                yield name, message.stamp_ns
            if not reader.recovered:
                check.problems += [f"{file.name}: {problem}" for problem in _different(contents.problems)]
        return
    on_file(reader.path)
    try:
        for each in reader.messages():
            yield each.topic, each.stamp_ns
    except FileFormatError as error:
        check.problems.append(str(error))


def _unlisted(contents: FileContents, number: int) -> BagTopic:
    channel = contents.channels[number]
    schema = contents.schemas.get(channel.schema_id)
    name, definition = (schema.name, schema.data.decode(errors="replace")) if schema else ("", "")
    return BagTopic(channel.topic, name, "", OfferedQos(), definition=definition)


def _different(problems: list[str]) -> list[str]:
    different = list(dict.fromkeys(problems))
    more = len(different) - _MOST_PROBLEMS
    return [*different[:_MOST_PROBLEMS], f"and {more} more like these"] if more > 0 else different


def _check_metadata(reader: BagReader, check: BagCheck) -> None:
    if not reader.path.is_dir():
        check.notes.append(f"one file on its own: {METADATA_FILE} was not read")
        return
    if not (reader.path / METADATA_FILE).exists():
        check.problems.append(f"there is no {METADATA_FILE}")
        return
    information = _information(reader.path)
    listed = [str(name) for name in information.get("relative_file_paths", [])]
    outside = [name for name in listed if ".." in PurePosixPath(name).parts or PurePosixPath(name).is_absolute()]
    if outside:
        check.problems.append(f"{METADATA_FILE} names files elsewhere, which are not read: {', '.join(outside)}")
    names = {PurePosixPath(name).name for name in listed}
    unlisted = [file.name for file in reader.files if file.name not in names]
    if unlisted:
        check.problems.append(f"{METADATA_FILE} does not list {', '.join(unlisted)}")


def _information(folder: Path) -> dict[str, Any]:
    content = read_mapping(folder / METADATA_FILE)
    return dict(content["rosbag2_bagfile_information"])  # its form was checked by the reader


def _check_counts(reader: BagReader, check: BagCheck) -> None:
    if reader.recovered:
        return
    listed = Counter({name: topic.message_count for name, topic in reader.topics.items()})
    found = Counter({each.topic.name: each.count for each in check.topics})
    for name in sorted(listed):
        if listed[name] != found[name]:
            check.problems.append(f"{name}: {listed[name]} messages by the index, {found[name]} found")


def _note(reader: BagReader, check: BagCheck) -> None:
    for each in check.topics:
        if each.gaps:
            check.notes.append(f"{each.topic.name}: {each.gaps} gaps, the longest {each.longest_s:.3g} s")
        if each.backwards:
            check.notes.append(f"{each.topic.name}: {each.backwards} messages with an earlier time than the one before")
        if not each.count:
            check.notes.append(f"{each.topic.name}: no message")
        if not each.topic.definition and reader.path.is_dir():
            check.notes.append(f"{each.topic.name}: the definition of {each.topic.type_name} is not in the bag")


@dataclass(frozen=True)
class Repair:
    """What was copied.

    Parameters
    ----------
    count : messages.
    problem : what was wrong with the source; empty for an undamaged bag.
    """

    count: int
    problem: str


def repair_bag(source: str | Path, destination: str | Path, compression: str = "none") -> Repair:
    """Copy all that can be read of a bag to a new bag with MCAP storage.

    A message whose time ROS cannot hold (`LAST_NS`) gets that of the message before it.

    Parameters
    ----------
    source, destination : bag folder or file; folder of the new bag, which must not exist.
    compression : of the new bag's chunks, one of `mcap_writer.COMPRESSIONS`.

    Returns
    -------
    Number of messages, and what was wrong with the source.

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
