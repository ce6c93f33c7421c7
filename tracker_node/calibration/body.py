"""A body scaled to a person: segment lengths from the joints of a static trial, girths from the person's size.

Joints that a detector finds are off by a centimeter or two, the same way in every image, and so are the lengths between them. A
measured length is therefore weighed against the one that a person of this size has on average.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from ..errors import FileFormatError, ModelError, TrackerError
from ..geometry import se3
from ..loaders.motion.trajectory_file import read_states
from ..loaders.motion.trc import MarkerTrajectories
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..model.humans.measures import landmark_of_marker, mirrored_name
from ..model.variants import LinkScale, scaled_by_link, with_landmarks
from .pose import fit_state_to_landmarks

SIDES = ("left", "right")
_BESIDE_JOINTS = 0.02  # weight of a landmark that is no joint of a measured length
_DETECTED_M, _DETECTED_WEIGHT = 0.015, 0.25  # error of a length between detected joints, and how many pairs it is worth
_LARGE_DIFFERENCE_M = 0.025  # of left and right: more than joints are off by


@dataclass(frozen=True)
class Segment:
    """A length between two (means of) landmarks, and what it stretches.

    ``links`` are stretched along ``axis`` (0, 1, 2), in places and sizes; those in ``places_only`` only in places.
    """

    name: str
    start: tuple[str, ...]
    end: tuple[str, ...]
    links: tuple[str, ...]
    axis: int = 2
    places_only: tuple[str, ...] = ()


_HIPS, _SHOULDERS = ("left_hip", "right_hip"), ("left_shoulder", "right_shoulder")
# Names of both bodies; a body is stretched where it has the link.
_GIRDLE = ("left_clavicle", "right_clavicle", "left_shoulder", "right_shoulder")
SEGMENTS: tuple[Segment, ...] = (
    Segment("trunk", _HIPS, _SHOULDERS, ("pelvis", "abdomen", "torso", "chest")),
    Segment("shoulders to head", _SHOULDERS, ("head",), ()),
    Segment("shoulder breadth", _SHOULDERS[:1], _SHOULDERS[1:], _GIRDLE, 1, ("torso", "chest")),
    Segment("hip breadth", _HIPS[:1], _HIPS[1:], (), 1, ("pelvis",)),
    *(
        Segment(f"{side}_{link}", (f"{side}_{start}",), (f"{side}_{end}",), (f"{side}_{link}",))
        for side in SIDES
        for link, start, end in (
            ("upper_arm", "shoulder", "elbow"),
            ("forearm", "elbow", "wrist"),
            ("thigh", "hip", "knee"),
            ("shank", "knee", "ankle"),
        )
    ),
)
# Lengths that add up to the stature, so that what a detector takes from one of them and gives to the next cancels.
SIZE_SEGMENTS = ("trunk", "shoulders to head", "left_thigh", "right_thigh", "left_shank", "right_shank")


@dataclass(frozen=True)
class ScalingOptions:
    """``joint_sigma_m``: systematic error of a measured length (0: it is exact; None: `error_of_lengths`); ``variation``:
    standard deviation of a segment's length among people of one size, as a share; ``symmetric``: make left and right equal;
    ``stature_m``: if known."""

    joint_sigma_m: float | None = None
    variation: float = 0.05
    symmetric: bool = True
    stature_m: float | None = None


@dataclass(frozen=True)
class SegmentFit:
    """Meters: what the joints say, what a person of this size has on average, and what the body was given."""

    name: str
    measured_m: float
    expected_m: float
    used_m: float


@dataclass(frozen=True, eq=False)
class ScaledBody:
    """A scaled body and how it came about; ``size`` is the person's size as a multiple of the model's; ``differing`` are segments
    of the left that differ much from those of the right, and by how many meters. ``trial_size`` is what the trial alone says."""

    model: ArticulatedModel
    size: float
    segments: tuple[SegmentFit, ...]
    trial_size: float = 1.0
    differing: Mapping[str, float] = field(default_factory=dict)
    residual_m: float = 0.0
    states: tuple[State, ...] = field(default=(), repr=False)


def model_stature(model: ArticulatedModel) -> float:
    """Height of the highest over the lowest point of the body's outline in neutral, meters.

    Raises
    ------
    ModelError : a body without shapes.
    """
    if not model.shapes:
        raise ModelError(f"model '{model.name}' has no shapes to take a stature from")
    configuration = Configuration(model, State.neutral(model))
    tops, bottoms = [], []
    for shape, transform in zip(model.shapes, configuration.Ts_world_shape, strict=True):
        low, high = _vertical_extent(shape.primitive, transform)
        bottoms.append(low)
        tops.append(high)
    return max(tops) - min(bottoms)


def _vertical_extent(primitive, T_world_shape: np.ndarray) -> tuple[float, float]:
    """Lowest and highest z of a shape."""
    up, height = T_world_shape[2, :3], T_world_shape[2, 3]  # the shape's axes, seen along the world's z
    if hasattr(primitive, "radii"):
        reach = float(np.linalg.norm(up * primitive.radii))
        return height - reach, height + reach
    if hasattr(primitive, "size"):
        reach = float(0.5 * np.abs(up) @ primitive.size)
        return height - reach, height + reach
    if hasattr(primitive, "vertices"):
        z = primitive.vertices @ up + height
        return float(z.min()), float(z.max())
    ends = []
    for z in (primitive.z1, primitive.z2):
        reach = (1.0 + primitive.k * z) * float(np.hypot(primitive.a * up[0], primitive.b * up[1]))
        ends += [height + up[2] * z - reach, height + up[2] * z + reach]
    return float(min(ends)), float(max(ends))


def scale_to_trial(model: ArticulatedModel, markers: MarkerTrajectories, options: ScalingOptions | None = None) -> ScaledBody:
    """The body scaled to the joints of a static trial, its landmarks put where the trial has them.

    Parameters
    ----------
    model : the body.
    markers : joints of the static trial, in landmark names.
    options : priors on lengths, symmetry, stature.

    Returns
    -------
    The scaled body, the lengths behind it, and its states in the trial.

    Raises
    ------
    TrackerError : the trial has none of the joints that lengths are taken from.
    """
    options = options or ScalingOptions()
    measured = _measured_lengths(model, markers)
    trial_size = _size_of_lengths(model, measured)
    size = trial_size if options.stature_m is None else options.stature_m / model_stature(model)
    fits = _fit_lengths(model, measured, size, options)
    scales = _link_scales(model, size, fits)
    differing = {name: abs(left - right) for name, left, right in _pairs(measured) if abs(left - right) > _LARGE_DIFFERENCE_M}
    segments = tuple(fits[segment.name] for segment in SEGMENTS if segment.name in fits)
    fit = ScaledBody(scaled_by_link(model, scales), size, segments, trial_size, differing)
    states = pose_trial(fit.model, markers, weights=_of_joints(fit.model))
    scaled = place_landmarks(fit.model, states, [targets_of(fit.model, markers, row) for row in range(len(markers))], options)
    residuals = [
        np.mean(np.linalg.norm(_offsets(scaled, state, targets_of(scaled, markers, row)), axis=1))
        for row, state in enumerate(states)
    ]
    return replace(fit, model=scaled, residual_m=float(np.median(residuals)), states=tuple(states))


def targets_of(model: ArticulatedModel, markers: MarkerTrajectories, row: int) -> dict[str, np.ndarray]:
    """Markers of one row as targets of landmarks.

    Parameters
    ----------
    model : the body.
    markers : trajectories, meters in the world.
    row : of the trajectories.

    Returns
    -------
    Landmark -> world position (3,) of the markers that are valid there and that the model knows.
    """
    columns = {landmark_of_marker(name): column for column, name in enumerate(markers.names) if markers.valid[row, column]}
    return {name: markers.positions_m[row, column] for name, column in columns.items() if name in model.landmark_names}


def _of_joints(model: ArticulatedModel) -> dict[str, float]:
    """Weights of landmarks: others than joints of measured lengths are put where the trial has them, and are not to pull."""
    joints = {name for segment in SEGMENTS for name in segment.start + segment.end if name.startswith(("left_", "right_"))}
    return {name: 1.0 if name in joints else _BESIDE_JOINTS for name in model.landmark_names}


def pose_trial(
    model: ArticulatedModel, markers: MarkerTrajectories, weights: Mapping[str, float] | None = None
) -> list[State]:
    """Fit the body to every row of a trial, each from the row before.

    Parameters
    ----------
    model : the body.
    markers : trajectories, meters in the world.
    weights : by landmark; None: all count alike.

    Returns
    -------
    A state for each row.

    Raises
    ------
    TrackerError : a row has fewer than three of the model's landmarks at the start.
    """
    states: list[State] = []
    for row in range(len(markers)):
        targets = targets_of(model, markers, row)
        if not states and len(targets) < 3:
            raise TrackerError(
                f"row {row + 1}: expected at least 3 markers that are landmarks of '{model.name}', got {len(targets)}"
            )
        states.append(fit_state_to_landmarks(model, targets, states[-1] if states else None, weights).state)
    return states


def place_landmarks(
    model: ArticulatedModel,
    states: Sequence[State],
    targets: Sequence[Mapping[str, np.ndarray]],
    options: ScalingOptions | None = None,
) -> ArticulatedModel:
    """Each landmark moved to the mean place, in its link, of the points that it was measured at.

    A landmark on its link's own long axis (an elbow on the upper arm) stays on that axis: a static trial shows how far down it
    is, but not how the link is turned about that axis.

    Parameters
    ----------
    model : the body.
    states, targets : one of each per image; a target is name -> world position (3,).
    options : symmetry.

    Returns
    -------
    The body with its landmarks moved.
    """
    options = options or ScalingOptions()
    collected: dict[str, list[np.ndarray]] = {}
    for state, points in zip(states, targets, strict=True):
        configuration = Configuration(model, state)
        for name, point in points.items():
            link = model.landmark_links[model.landmark_index(name)]
            collected.setdefault(name, []).append(se3.apply(se3.inverse(configuration.Ts_world_link[link]), point))
    positions = {name: robust_mean(np.array(places)) for name, places in collected.items()}
    nominal = {landmark.name: np.array(landmark.position) for landmark in model.landmarks}
    for name, position in positions.items():
        direction = nominal[name]
        if np.linalg.norm(direction) > 0.1 and np.count_nonzero(np.abs(direction) > 1e-6) == 1:
            axis = direction / np.linalg.norm(direction)
            positions[name] = axis * (axis @ position)
    if options.symmetric:
        mirror = np.array([1.0, -1.0, 1.0])
        twins = {name: positions.get(mirrored_name(name), mirror * position) for name, position in positions.items()}
        positions = {name: 0.5 * (position + mirror * twins[name]) for name, position in positions.items()}
    return with_landmarks(model, positions)


def place_by_states(
    model: ArticulatedModel, markers: MarkerTrajectories, states_file: str | Path, options: ScalingOptions | None = None
) -> ArticulatedModel:
    """The body with the landmarks where the markers of a trial are, which a run has tracked.

    States and markers belong together by the time since the first of each.

    Parameters
    ----------
    model : that the run has tracked.
    markers : of the trial.
    states_file : states.csv of the run.
    options : as for `place_landmarks`.

    Returns
    -------
    The body with its landmarks moved.

    Raises
    ------
    FileFormatError : states of another body, or none that is not lost.
    """
    trajectory = read_states(states_file)
    if tuple(trajectory.dof_names) != tuple(model.chain.dof_names):
        raise FileFormatError(states_file, "columns", f"the degrees of freedom of {model.name}", trajectory.dof_names)
    tracked = [i for i, row in enumerate(trajectory.rows) if row.status not in ("LOST", "INITIALIZING")]
    if not tracked:
        raise FileFormatError(states_file, "rows", "at least one state that is not lost", f"none in {len(trajectory.rows)} rows")
    seconds = (trajectory.stamps_ns - trajectory.stamps_ns[0]) * 1e-9 + markers.times_s[0]
    nearest = [int(np.abs(markers.times_s - seconds[i]).argmin()) for i in tracked]
    states = [State.from_values(trajectory.rows[i].values) for i in tracked]
    return place_landmarks(model, states, [targets_of(model, markers, row) for row in nearest], options)


def robust_mean(values: np.ndarray) -> np.ndarray:
    """Mean (...) of those rows of (n, ...) that are within 3.5 robust standard deviations of the median."""
    values = np.asarray(values, dtype=np.float64)
    distance = np.abs(values - np.median(values, axis=0))
    if values.ndim > 1:
        distance = np.linalg.norm(distance.reshape(len(values), -1), axis=1)
    spread = 1.4826 * np.median(distance)
    return values[distance <= 3.5 * spread + 1e-12].mean(axis=0)


def _offsets(model: ArticulatedModel, state: State, targets: Mapping[str, np.ndarray]) -> np.ndarray:
    landmarks = Configuration(model, state).landmarks_world
    return np.array([landmarks[model.landmark_index(name)] - point for name, point in targets.items()]).reshape(-1, 3)


def _length(points: Mapping[str, np.ndarray], segment: Segment) -> float:
    ends = [np.mean([points[name] for name in names], axis=0) for names in (segment.start, segment.end)]
    return float(np.linalg.norm(ends[1] - ends[0]))


def _measured_lengths(model: ArticulatedModel, markers: MarkerTrajectories) -> dict[str, float]:
    """Meters, by segment."""
    rows = [targets_of(model, markers, row) for row in range(len(markers))]
    measured: dict[str, float] = {}
    for segment in SEGMENTS:
        needed = segment.start + segment.end
        lengths = [_length(points, segment) for points in rows if all(name in points for name in needed)]
        if lengths:
            measured[segment.name] = float(robust_mean(np.array(lengths)))
    if not measured:
        joints = sorted({name for segment in SEGMENTS for name in segment.start + segment.end})
        raise TrackerError(
            f"the trial has no length to scale by; of these joints it must have two neighbors: {', '.join(joints)}"
        )
    return measured


def _reference_lengths(model: ArticulatedModel, names: Collection[str]) -> dict[str, float]:
    """Meters of segments as the model has them."""
    neutral = dict(zip(model.landmark_names, Configuration(model, State.neutral(model)).landmarks_world, strict=True))
    return {segment.name: _length(neutral, segment) for segment in SEGMENTS if segment.name in names}


def _size_of_lengths(model: ArticulatedModel, measured: Mapping[str, float]) -> float:
    reference = _reference_lengths(model, measured)
    used = [name for name in SIZE_SEGMENTS if name in measured] or list(measured)
    # A leg counts half where both are there, so that legs and trunk weigh as they do in the stature.
    weight = {name: 0.5 if mirrored_name(name) in used and mirrored_name(name) != name else 1.0 for name in used}
    return sum(weight[n] * measured[n] for n in used) / sum(weight[n] * reference[n] for n in used)


def _fit_lengths(
    model: ArticulatedModel, by_side: Mapping[str, float], size: float, options: ScalingOptions
) -> dict[str, SegmentFit]:
    measured = dict(by_side)
    if options.symmetric:
        measured = {name: 0.5 * (length + measured.get(mirrored_name(name), length)) for name, length in measured.items()}
    reference = _reference_lengths(model, measured)
    fits = {}
    sigma = options.joint_sigma_m if options.joint_sigma_m is not None else error_of_lengths(by_side, options.symmetric)
    for name, length in measured.items():
        expected = size * reference[name]
        gain = 1.0 / (1.0 + (sigma / (options.variation * expected)) ** 2)
        fits[name] = SegmentFit(name, length, expected, gain * length + (1.0 - gain) * expected)
    return fits


def error_of_lengths(lengths: Mapping[str, float], symmetric: bool = True) -> float:
    """Standard deviation of a measured length, by how far those of left and right differ.

    Parameters
    ----------
    lengths : meters, by segment.
    symmetric : the person is; else the half of the pairs that differs more may really do so, and the other half counts.

    Returns
    -------
    Meters; that of detected joints where no segment has a twin.
    """
    squares = sorted(0.5 * (left - right) ** 2 for _, left, right in _pairs(lengths))
    if not symmetric and squares:
        squares = [squares[(len(squares) - 1) // 2]] * len(squares)
    return math.sqrt((_DETECTED_WEIGHT * _DETECTED_M**2 + sum(squares)) / (_DETECTED_WEIGHT + len(squares)))


def _pairs(lengths: Mapping[str, float]) -> list[tuple[str, float, float]]:
    """Left segments that have a twin: name, its length, that of the right."""
    left = [name for name in lengths if name.startswith("left_") and mirrored_name(name) in lengths]
    return [(name, lengths[name], lengths[mirrored_name(name)]) for name in left]


def _link_scales(model: ArticulatedModel, size: float, fits: Mapping[str, SegmentFit]) -> dict[str, LinkScale]:
    places = {link: [size] * 3 for link in model.chain.links}
    sizes = {link: [size] * 3 for link in model.chain.links}
    for segment in SEGMENTS:
        if segment.name not in fits:
            continue
        fit = fits[segment.name]
        factor = size * fit.used_m / fit.expected_m
        for link in segment.links + segment.places_only:
            if link in places:
                places[link][segment.axis] = factor
        for link in segment.links:
            if link in sizes:
                sizes[link][segment.axis] = factor
    return {link: LinkScale(_triple(places[link]), _triple(sizes[link])) for link in places}


def _triple(values: Sequence[float]) -> tuple[float, float, float]:
    x, y, z = values
    return x, y, z
