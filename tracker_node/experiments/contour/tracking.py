"""What `reproduce contours` measures on recordings: errors along variables of a whole body, runs by all methods, the ablation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...loaders.motion.trajectory_file import read_states
from ...model.configuration import Configuration, State
from ...observation.image_set import ImageSet
from ...report.progress import say
from ...tracking.config import TrackerConfig
from ...tracking.engines import make_engine
from ..plots import Profile
from .clips import Clip, TrackedClip, track_clip
from .errors import (
    PUBLISHED,
    TITLES,
    ContourError,
    by_method,
    direction_of,
    displaced,
    images_of,
    run_metrics,
    until_converged,
    valley,
)


@dataclass(frozen=True)
class Variable:
    """One degree of freedom that is moved by up to ``reach``, in steps; ``unit`` is mm or deg."""

    title: str
    unit: str
    reach: float
    step: float

    @property
    def si(self) -> float:
        """Meters or radians in its unit."""
        return 1e-3 if self.unit == "mm" else float(np.radians(1.0))

    def changes(self, coarseness: int) -> np.ndarray:
        """(n,) with the truth in the middle."""
        n = int(self.reach / (coarseness * self.step))
        return coarseness * self.step * np.arange(-n, n + 1)


VARIABLES = {
    "root_x": Variable("whole body along x", "mm", 150.0, 2.0),
    "root_rz": Variable("whole body about the vertical", "deg", 40.0, 1.0),
    "right_elbow_flexion": Variable("right elbow", "deg", 60.0, 1.0),
    "left_hip_flexion": Variable("left hip", "deg", 40.0, 1.0),
}
ABLATED = ("sum", "split")
_ABLATION_KEYS = ("iterations_with", "iterations_without", "iterations_ratio", "mpjpe_with_mm", "mpjpe_without_mm")
DISPLACED, DISPLACED_DEG, DISPLACED_MM = "displaced", 4.0, 20.0
Profiles = Mapping[str, Mapping[str, Sequence[Profile]]]
"""Degree of freedom -> kind of distance -> a profile for each image set."""


def body_profiles(clip: Clip, n_sets: int, coarseness: int = 1) -> Profiles:
    """Error of a body whose true states are known, as one variable leaves the truth.

    Parameters
    ----------
    clip : of the tracker's own model.
    n_sets : image sets that are used.
    coarseness : multiplies the steps.

    Returns
    -------
    By degree of freedom and kind of distance.
    """
    states, sets = _true_sets(clip, n_sets)
    profiles: dict[str, dict[str, list[Profile]]] = {dof: {key: [] for key in PUBLISHED} for dof in VARIABLES}
    for key in PUBLISHED:
        error = ContourError(clip.rig, clip.model, clip.backgrounds, key)
        for state, image_set in zip(states, sets, strict=True):
            error.look(image_set, state)
            for dof, variable in VARIABLES.items():
                changes = variable.changes(coarseness)
                direction = variable.si * direction_of(clip.model, dof)
                profiles[dof][key].append(Profile(changes, error.along(state, direction, changes)))
    return profiles


def _true_sets(clip: Clip, n: int) -> tuple[list[State], list[ImageSet]]:
    """Up to ``n`` image sets all over a clip of the tracker's own model, and the states in them."""
    truth = read_states(clip.folder / "true_states.csv").rows
    numbers = sorted({round(i) for i in np.linspace(0, len(truth) - 1, n + 2)[1:-1]})
    return [State.from_values(truth[i].values) for i in numbers], clip.sets_at(numbers)


def valley_metrics(prefix: str, unit: str, profiles: Sequence[Profile]) -> dict[str, float]:
    """Metrics of valleys: mean distance of the minimum from the truth, mean width of the floor, shortest rise.

    Parameters
    ----------
    prefix : of the metrics' names.
    unit : of the changes.
    profiles : along one variable.

    Returns
    -------
    Metric -> value.
    """
    valleys = [valley(profile.changes, profile.scores) for profile in profiles]
    return {
        f"{prefix}.minimum_off_{unit}": float(np.mean([abs(v.minimum) for v in valleys])),
        f"{prefix}.flat_{unit}": float(np.mean([v.flat for v in valleys])),
        f"{prefix}.rising_{unit}": min(v.rising for v in valleys),
    }


def mean_profile(profiles: Sequence[Profile]) -> Profile:
    """Of profiles along one variable."""
    return Profile(profiles[0].changes, np.mean([profile.scores for profile in profiles], axis=0))


def track_by(clip: Clip, methods: Sequence[str]) -> dict[str, TrackedClip]:
    """Track a clip by each method from its first pose.

    Parameters
    ----------
    clip : the recording.
    methods : of `METHODS`.

    Returns
    -------
    Method -> run.
    """
    runs = {}
    for method in methods:
        runs[method] = track_clip(clip, by_method(clip.config, method))
        found = runs[method].evaluation
        say(f"  {TITLES[method]}: {found.raw.mean_mm:.1f} mm, {int(found.lost.sum())} of {found.image_sets} image sets lost")
    return runs


def tracking_metrics(clip: str, runs: Mapping[str, TrackedClip]) -> dict[str, float | int]:
    """Metrics of all runs on one clip.

    Parameters
    ----------
    clip : its name.
    runs : method -> run.

    Returns
    -------
    ``contours.<clip>.<method>.<metric>`` -> value.
    """
    return {
        f"contours.{clip}.{method}.{key}": value
        for method, run in runs.items()
        for key, value in run_metrics(run.evaluation).items()
    }


def sliding_metrics(clip: Clip) -> dict[str, float | int]:
    """Iterations and errors with and without the sliding term of the Jacobian, tracking till each image set has converged."""

    def measure(config: TrackerConfig) -> tuple[float, float]:
        found = track_clip(clip, config).evaluation
        return float(found.iterations.mean()), found.raw.mean_mm

    return _ablated(clip, clip.name, measure)


def displaced_metrics(clip: Clip, n_starts: int) -> dict[str, float | int]:
    """The same of single fits, each from a true state with all joints displaced: steps far longer than those of tracking.

    Parameters
    ----------
    clip : of the tracker's own model.
    n_starts : number of fits.

    Returns
    -------
    Metric -> value.
    """
    states, sets = _true_sets(clip, n_starts)

    def measure(config: TrackerConfig) -> tuple[float, float]:
        chamfer = replace(config.chamfer, first_iterations=config.chamfer.max_iterations, silhouette="background")
        config = replace(config, chamfer=chamfer)
        engine = make_engine(clip.rig, clip.model, config, clip.backgrounds)
        rng, found, errors_m = np.random.default_rng(1), [], []
        for state, image_set in zip(states, sets, strict=True):
            start = displaced(state, np.radians(DISPLACED_DEG), 1e-3 * DISPLACED_MM, rng)
            engine.observe(images_of(image_set, clip.rig), start)
            found.append(engine.fit(start, first=True))
            joints = [Configuration(clip.model, each).landmarks_world for each in (found[-1].state, state)]
            errors_m.append(np.linalg.norm(joints[0] - joints[1], axis=1).mean())
        return float(np.mean([each.iterations for each in found])), 1e3 * float(np.mean(errors_m))

    return _ablated(clip, f"{clip.name}_{DISPLACED}", measure)


def _ablated(clip: Clip, name: str, measure: Callable[[TrackerConfig], tuple[float, float]]) -> dict[str, float | int]:
    """What ``measure`` says, iterations and mm, with the sliding term and without it."""
    figures: dict[str, float | int] = {}
    for distances in ABLATED:
        prefix, config = f"contours.{name}.sliding_{distances}", by_method(clip.config, distances)
        with_, error_with_mm = measure(until_converged(config, True))
        without, error_without_mm = measure(until_converged(config, False))
        values = (with_, without, without / with_, error_with_mm, error_without_mm)
        figures |= {f"{prefix}.{key}": value for key, value in zip(_ABLATION_KEYS, values, strict=True)}
        say(f"  {name}, {TITLES[distances]}: {without / with_:.2f} times the iterations without the sliding term")
    return figures


def tracking_table(clips: Mapping[str, Mapping[str, TrackedClip]]) -> list[list[str]]:
    """Rows of text, the first one the headings."""
    rows = [["", "joint error", "offset-free", "sets lost", "limbs lost", "iterations", "residual"]]
    for clip, runs in clips.items():
        for method, run in runs.items():
            found = run_metrics(run.evaluation)
            rows.append([
                f"{clip}, {TITLES[method]}", f"{found['mpjpe_mm']:.1f} mm", f"{found['mpjpe_offset_free_mm']:.1f} mm",
                f"{found['lost_sets']} of {found['image_sets']}", str(found["lost_limbs"]), f"{found['iterations']:.1f}",
                f"{found['residual_px']:.1f} px",
            ])  # fmt: skip
    return [*rows, ["paper: sum of both, two real sequences", "", "", "", "", "< 5", "about 1 px"]]


def sliding_table(clips: Sequence[str], metrics: Mapping[str, float | int]) -> list[list[str]]:
    """As `tracking_table`, of the ablation.

    Parameters
    ----------
    clips : names.
    metrics : of the ablation.

    Returns
    -------
    Rows of text, the first one the headings.
    """
    rows = [["", "iterations with", "without", "ratio", "joint error with", "without"]]
    for clip in clips:
        for distances in ABLATED:
            of = {key: metrics[f"contours.{clip}.sliding_{distances}.{key}"] for key in _ABLATION_KEYS}
            numbers = [f"{of[key]:.2f}" for key in _ABLATION_KEYS[:3]] + [f"{of[key]:.1f} mm" for key in _ABLATION_KEYS[3:]]
            rows.append([f"{clip}, {TITLES[distances]}", *numbers])
    return [*rows, ["paper: synthetic and real", "", "", "2", "the same", ""]]
