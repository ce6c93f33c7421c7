"""Joint states of a robot beside recorded images: from a CSV file or a bag."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import FileFormatError, TrackerError, shown
from ..loaders.bag.message_types import stamp_ns_of
from ..loaders.bag.reader import BagReader
from ..loaders.csv_file import CsvTable
from ..model.articulated import ArticulatedModel
from ..model.configuration import State
from ..model.kinematic_chain import Axis
from ..observation.image_set import ImageSet
from ..observation.joint_states import JointStates
from ..tracking.config import GEOMETRIC, TrackerConfig

JOINT_STATE = "sensor_msgs/msg/JointState"
USUAL_TOPIC = "/joint_states"
_BEYOND, _LEAST_BEYOND = 0.25, 0.1  # of a joint's range, and radians or meters, by which a robot may be beyond its limits
_NAMED = 8  # names in a message for people


@dataclass(frozen=True)
class JointStateFile:
    """Where joint states come from.

    Attributes
    ----------
    path : CSV file with ``stamp_ns`` and a column a joint, or a bag.
    topic : of the bag; None: ``/joint_states``, or the only one of that type.
    """

    path: Path
    topic: str | None = None


def axes_of(model: ArticulatedModel) -> tuple[str, ...]:
    """Names of what a robot may say something of."""
    return tuple(axis.name for axis in model.chain.axes)


def joint_states_of(model: ArticulatedModel, most: int | None = None) -> JointStates:
    """Where to keep what is said of a body's joints.

    Parameters
    ----------
    model, most : the body; how many readings of a joint are kept, None: all.

    Returns
    -------
    Nothing yet.
    """
    return JointStates(most, [axis.name for axis in model.chain.axes if axis.endless])


def check_use(model: ArticulatedModel, config: TrackerConfig) -> None:
    """Whether joint states tell a tracker anything.

    Parameters
    ----------
    model, config : the body, and what its images are compared by.

    Raises
    ------
    TrackerError : a body without joints; colors or textures alone, whose filter has no covariance.
    """
    if not model.chain.axes:
        raise TrackerError(f"joint states take a body with joints, got '{model.name}'")
    if not set(config.modalities) & set(GEOMETRIC):
        raise TrackerError(f"joint states take contours (region, chamfer), got the modality {config.colors} alone")


def positions_of(message: Any, axes: Collection[str]) -> list[tuple[str, float]]:
    """What a sensor_msgs/JointState says of a body's joints, live and from a bag.

    Parameters
    ----------
    message, axes : the message; names of the body's axes.

    Returns
    -------
    (name, radians or meters) of those of its joints that the body has.

    Raises
    ------
    TrackerError : as many names as positions were expected, and at least one that the body has.
    """
    names, positions = list(message.name), np.asarray(message.position, dtype=np.float64)
    if len(names) != len(positions):
        raise TrackerError(f"joint states: expected a position for each of {len(names)} names, got {len(positions)}")
    known = [(name, float(p)) for name, p in zip(names, positions, strict=True) if name in axes]
    if not known:
        raise TrackerError(f"joint states: expected positions of {_listed(axes)}, got those of {_listed(names)}")
    finite = [(name, position) for name, position in known if np.isfinite(position)]
    if not finite:
        raise TrackerError(f"joint states: expected a number for one of {_listed([name for name, _ in known])}, got none")
    return finite


def check_positions(positions: Iterable[tuple[str, float]], axes: Mapping[str, Axis]) -> None:
    """Whether a robot can be where a message says that it is.

    Parameters
    ----------
    positions, axes : of `positions_of`; the body's axes by name.

    Raises
    ------
    TrackerError : a joint is far beyond its limits, as in degrees.
    """
    for name, position in positions:
        low, high = _believed(axes[name])
        if not low <= position <= high:
            expected, unit = _limits_of(axes[name])
            raise TrackerError(f"joint states: {name}: expected {expected}, got {position:.3g}: {unit}")


def load_joint_states(file: JointStateFile, model: ArticulatedModel) -> JointStates:
    """Read all joint states of a file.

    Parameters
    ----------
    file, model : where they are; the body whose joints they are of.

    Returns
    -------
    Their positions over time.

    Raises
    ------
    TrackerError : a file that cannot be read, or that tells of no joint of the body.
    """
    if not file.path.exists():
        raise FileFormatError(file.path, "joint states", "a CSV file or a bag", "nothing")
    if file.path.is_dir() or file.path.suffix == ".mcap":
        states = _from_bag(file, model)
    elif file.topic is not None:
        raise FileFormatError(file.path, "topic", "a bag, where a topic is given", f"a {file.path.suffix or 'plain'} file")
    else:
        states = _from_csv(file.path, model)
    _check_limits(file.path, states, model)
    return states


def _check_limits(path: Path, states: JointStates, model: ArticulatedModel) -> None:
    """Positions most of which are far beyond a joint's limits are of another unit."""
    for axis in model.chain.axes:
        positions, (low, high) = states.positions(axis.name), _believed(axis)
        if len(positions) and np.mean((positions < low) | (positions > high)) > 0.5:
            expected, unit = _limits_of(axis)
            raise FileFormatError(path, axis.name, expected, f"{positions.min():.3g} to {positions.max():.3g}: {unit}")


def _believed(axis: Axis) -> tuple[float, float]:
    """Between which positions a robot may say that it is."""
    margin = max(_BEYOND * (axis.upper - axis.lower), _LEAST_BEYOND)
    return axis.lower - margin, axis.upper + margin


def _limits_of(axis: Axis) -> tuple[str, str]:
    """A joint's limits, and the unit that positions far beyond them may have, in words."""
    unit = "degrees?" if axis.unit == "rad" else "millimeters?"
    return f"{axis.unit} between the joint's limits, {axis.lower:.3g} and {axis.upper:.3g}", unit


def _from_csv(path: Path, model: ArticulatedModel) -> JointStates:
    table, result = CsvTable(path, ("stamp_ns",)), joint_states_of(model)
    columns = {}
    for axis in model.chain.axes:
        for name in (axis.name, f"{axis.name}_{axis.unit}"):
            if name in table.header:
                columns[axis.name] = table.header.index(name)
    if not columns:
        raise FileFormatError(path, "header", f"a column for one of {_listed(axes_of(model))}", _listed(table.header[1:]))
    for row in table.rows():
        result.add(row.integer(0), [(name, row.number(column)) for name, column in columns.items() if row.text[column]])
    return result


def _from_bag(file: JointStateFile, model: ArticulatedModel) -> JointStates:
    result, axes = joint_states_of(model), axes_of(model)
    with BagReader(file.path) as reader:
        topic = _topic_of(file, reader)
        for stamp_ns, message in reader.decoded(topic):
            try:
                result.add(stamp_ns_of(message.header.stamp) or stamp_ns, positions_of(message, axes))
            except TrackerError as error:
                raise TrackerError(f"{file.path}: topic {topic}: {error}") from None
    return result


def _topic_of(file: JointStateFile, reader: BagReader) -> str:
    topics = reader.topics_of_type(JOINT_STATE)
    wanted = file.topic or (topics[0] if len(topics) == 1 else USUAL_TOPIC)
    for topic in topics:
        if f"/{topic}".lstrip("/") == wanted.lstrip("/"):
            return topic
    raise FileFormatError(file.path, "topics", f"{wanted} of {JOINT_STATE}", _listed(topics))


def with_joint_states(states: JointStates, image_set: ImageSet) -> ImageSet:
    """An image set beside what a robot says at its time.

    Parameters
    ----------
    states, image_set : positions over time; the images.

    Returns
    -------
    The image set with ``joint_positions``.
    """
    return replace(image_set, joint_positions=states.at(image_set.stamp_ns))


class JointStatesBeside:
    """What a robot says, put beside image sets; it knows how often nothing was said.

    Parameters
    ----------
    states : positions over time.
    """

    def __init__(self, states: JointStates):
        self._states, self._sets, self._unsaid = states, 0, 0
        self._first_ns = self._last_ns = 0

    def with_joint_states(self, image_set: ImageSet) -> ImageSet:
        """The image set with the ``joint_positions`` of its time."""
        beside = with_joint_states(self._states, image_set)
        self._first_ns, self._last_ns = self._first_ns if self._sets else image_set.stamp_ns, image_set.stamp_ns
        self._sets += 1
        self._unsaid += not beside.joint_positions
        return beside

    @property
    def note(self) -> str:
        """In how many image sets nothing was said, and when; empty where something was in all of them."""
        if not self._unsaid:
            return ""
        said = self._states.span_ns
        there = "there are none" if said is None else f"they are from {1e-9 * said[0]:.3f} to {1e-9 * said[1]:.3f} s"
        without = "any" if self.unused else str(self._unsaid)
        images = f"images from {1e-9 * self._first_ns:.3f} to {1e-9 * self._last_ns:.3f} s"
        told = f"joint states: none at the time of {without} of {self._sets} image sets: {there}, {images}"
        return told + ("; do both stamps come from one clock?" if self.unused else "")

    @property
    def unused(self) -> bool:
        """Nothing was said of any image set."""
        return 0 < self._unsaid == self._sets


def _listed(names: Collection[str]) -> str:
    named = [shown(name) for name in list(names)[:_NAMED]]
    return (", ".join(named) or "none") + (f" and {len(names) - _NAMED} more" if len(names) > _NAMED else "")


@dataclass(frozen=True, eq=False)
class RobotImages:
    """Image sets of a robot, and where its joints were.

    Attributes
    ----------
    sets : a number of them, spread over the recording.
    poses : (n_axes,) radians or meters by set and camera of the rig, at the camera's own stamp.
    unsaid : joints that nothing is said of, and that no other drives; they are as given.
    """

    sets: tuple[ImageSet, ...]
    poses: tuple[tuple[np.ndarray, ...], ...]
    unsaid: tuple[str, ...]


def robot_images(
    stream: Iterable[ImageSet], n_expected: int, n_sets: int, states: JointStates, cameras: Sequence[str], given: State,
    model: ArticulatedModel,
) -> RobotImages:  # fmt: skip
    """Image sets of a recording, spread over it, with what a robot says at the times of their images.

    Parameters
    ----------
    stream, n_expected : all image sets, and about how many there are.
    n_sets : how many are wanted.
    states : positions of joints over time.
    cameras : names of the rig's.
    given, model : where joints are that nothing is said of, but for those that others drive; the robot.

    Returns
    -------
    As many sets as there are at most.

    Raises
    ------
    TrackerError : nothing is said at the time of any image.
    """
    every, sets, poses = max(1, n_expected // n_sets), [], []
    unsaid = tuple(name for name in axes_of(model) if name not in states.names)
    for number, image_set in enumerate(stream):
        if number % every or not (said := _said(states, image_set, cameras, given, model, unsaid)):
            continue
        sets.append(image_set)
        poses.append(said)
        if len(sets) == n_sets:
            break
    if not sets:
        raise TrackerError("nothing is said of the joints at the time of any image; do both stamps come from one clock?")
    driven = {axis.name for axis in model.chain.axes if axis.mimic is not None and axis.mimic.leader not in unsaid}
    return RobotImages(tuple(sets), tuple(poses), tuple(name for name in unsaid if name not in driven))


def _said(
    states: JointStates, image_set: ImageSet, cameras: Sequence[str], given: State, model: ArticulatedModel,
    unsaid: Collection[str],
) -> tuple[np.ndarray, ...]:
    """Positions for every camera; empty where some joint has no reading near."""
    result, axes = [], axes_of(model)
    for name in cameras:
        image = image_set.get(name)
        said = states.at(image_set.stamp_ns if image is None else image.stamp_ns)
        if len(said) < len(axes) - len(unsaid):
            return ()
        positions = np.array([said.get(axis, own) for axis, own in zip(axes, given.joint_positions, strict=True)])
        for follower, leader, following in model.chain.couplings:
            if axes[follower] in unsaid:
                positions[follower] = following.multiplier * positions[leader] + following.offset
        result.append(positions)
    return tuple(result)
