"""Which change of the rig would make its cameras agree on where something moves.

`motion.agreement` says how well two cameras agree. Each way in which a rig can be wrong is tried out as a correction:
two cameras exchanged, images mirrored, a clock shifted, a focal length, a place fitted. The correction that makes cameras agree
best, the simpler of two that are alike, is the diagnosis; none, if nothing helps much. After it, what remains is examined again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import minimize

from ..camera.rig import Camera
from ..geometry import se3, so3
from .motion import LEAST_TIME_STEPS, ImageMotion, agreements
from .setup import Setup

LEAST_GAIN = 0.012  # of agreement, after the price
_PRICE = 0.004  # of each fitted number beyond the first
_LEAST_ZOOM = 0.03
_LEAST_SHIFT = 0.008  # of the distance to the scene: how far points appear to be off
_WORTH_MORE = 0.006  # gain by a turn from which on a shift is tried too
_PRIOR = 0.002
_STEP = np.radians(3.0)
_OPTICAL_FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # y up, z backward (OpenGL) to y down, z forward
_MANY_ROUNDS = 3


@dataclass(frozen=True, eq=False)
class Correction:
    """A change that makes the cameras agree better.

    Parameters
    ----------
    kind : ``swapped``, ``mirrored``, ``upside_down``, ``axes``, ``inverted``, ``clock``, ``focal``, ``place``.
    cameras : names of those it concerns; empty for all.
    gain : by how much the agreement of a camera with the others grows, less the price of fitted numbers.
    setup : the cameras and their motion after it.
    values : what was fitted: ``late_s``, ``factor`` of the focal length, or ``turned_deg`` and ``moved_m``.
    """

    kind: str
    cameras: tuple[str, ...]
    gain: float
    setup: Setup
    values: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Corrections in the order in which they were found, and the agreement of each camera's pairs before and after."""

    corrections: tuple[Correction, ...]
    before: np.ndarray
    after: np.ndarray
    setup: Setup


def diagnose(setup: Setup, period_s: float, settled: frozenset[str] = frozenset()) -> Diagnosis:
    """Search up to three corrections, each after the one before.

    Parameters
    ----------
    setup : cameras, and what moves in their images.
    period_s : time from time step to time step of the motions.
    settled : cameras that are known to look where they should, more exactly than by motion: only their clocks are corrected.

    Returns
    -------
    The corrections, and the agreement before and after.
    """
    before = agreements(setup.cameras, setup.motions)
    corrections: list[Correction] = []
    while len(corrections) < _MANY_ROUNDS:
        best = _best_repair(setup, period_s, settled)
        if best is None:
            break
        corrections.append(best)
        setup = best.setup
    return Diagnosis(tuple(corrections), before, agreements(setup.cameras, setup.motions), setup)


def _best_repair(setup: Setup, period_s: float, settled: frozenset[str]) -> Correction | None:
    base = agreements(setup.cameras, setup.motions)
    if len(setup.cameras) < 2 or not np.isfinite(base).any():
        return None
    found = (r for r in (*_exchanges(setup, base), *_fits(setup, period_s, settled)) if r.gain > LEAST_GAIN)
    known = [r for r in found if r.kind == "clock" or settled.isdisjoint(r.cameras or settled)]  # none: of all cameras
    return max(known, key=lambda correction: correction.gain, default=None)


def _total_gain(setup: Setup, base: np.ndarray) -> float:
    now = agreements(setup.cameras, setup.motions)
    changes = np.where(np.isfinite(now - base), setup.weights * (now - base), 0.0)
    # As if one camera were concerned, so that corrections of one and of several can be compared
    return float(changes.sum() / 2.0 / np.median(setup.weights.sum(axis=1)))


def _exchanges(setup: Setup, base: np.ndarray) -> Iterator[Correction]:
    """Corrections without a number to fit."""
    n = len(setup.cameras)
    for i, a in enumerate(setup.cameras):
        yield _exchange("mirrored", (a.name,), _mirrored(setup, [i]), base)
        yield _exchange("upside_down", (a.name,), setup.with_camera(i, _placed(a, np.diag([-1.0, -1.0, 1.0, 1.0]))), base)
        for b in setup.cameras[:i]:
            yield _exchange("swapped", (b.name, a.name), _swapped(setup, a, b), base)
    # Planes through a ray do not tell it from its opposite: axes as in OpenGL agree as an axis of the world that is mirrored does
    away, flipped = _looks_away(setup), tuple(_placed(camera, _OPTICAL_FLIP) for camera in setup.cameras)
    if away or n > 2:  # two cameras see a world in a mirror as well
        yield _exchange("axes" if away else "mirrored", (), replace(setup, cameras=flipped), base)
    if n > 2:
        yield _exchange("mirrored", (), _mirrored(setup, range(n)), base)
    inverted = tuple(replace(camera, T_world_cam=se3.inverse(camera.T_world_cam)) for camera in setup.cameras)
    yield _exchange("inverted", (), replace(setup, cameras=inverted), base)


def _looks_away(setup: Setup) -> bool:
    """Whether what moves is behind most cameras, as the rig has them."""
    behind = [se3.apply(camera.T_cam_world, setup.center)[2] < 0.0 for camera in setup.cameras]
    return sum(behind) > len(behind) / 2


def _exchange(kind: str, cameras: tuple[str, ...], setup: Setup, base: np.ndarray) -> Correction:
    return Correction(kind, cameras, _total_gain(setup, base), setup)


def _mirrored(setup: Setup, indices: Sequence[int] | range) -> Setup:
    cameras = [setup.cameras[i] for i in indices]
    return setup.with_motions({c.name: setup.motions[c.name].mirrored(c.model.width) for c in cameras})


def _swapped(setup: Setup, a: Camera, b: Camera) -> Setup:
    def moved(source: Camera, target: Camera) -> ImageMotion:
        motion = setup.motions[source.name]
        scale = np.array([target.model.width / source.model.width, target.model.height / source.model.height])
        return replace(motion, pixels=(motion.pixels + 0.5) * scale - 0.5)

    return setup.with_motions({a.name: moved(b, a), b.name: moved(a, b)})


def _placed(camera: Camera, turn: np.ndarray) -> Camera:
    return replace(camera, T_world_cam=camera.T_world_cam @ turn)


def _fits(setup: Setup, period_s: float, settled: frozenset[str]) -> Iterator[Correction]:
    for index in range(len(setup.cameras)):
        base = setup.agreement_of(index)
        if np.isfinite(base):
            yield from _clock(setup, index, base, period_s)
            if setup.cameras[index].name not in settled:
                yield from _focal_length(setup, index)
                yield from _place(setup, index)


def _clock(setup: Setup, index: int, base: float, period_s: float) -> Iterator[Correction]:
    name = setup.cameras[index].name
    n = len(setup.motions[name].valid)
    furthest = max(1, min(round(1.0 / period_s), n // 3, n - LEAST_TIME_STEPS))

    def shifted(k: int) -> Setup:
        return setup.with_motions({name: setup.motions[name].shifted(k)})

    shifts = np.array([k for k in range(-furthest, furthest + 1)])
    gains = np.array([shifted(k).agreement_of(index) - base for k in shifts])
    best = int(np.nanargmax(gains))
    late = float(shifts[best])
    if 0 < best < len(shifts) - 1 and np.isfinite(gains[best - 1 : best + 2]).all():
        low, middle, high = gains[best - 1 : best + 2]
        late += 0.5 * (low - high) / min(low - 2.0 * middle + high, -1e-9)
    if shifts[best]:
        values = {"late_s": late * period_s}
        yield Correction("clock", (name,), float(gains[best]), shifted(int(shifts[best])), values)


def _focal_length(setup: Setup, index: int) -> Iterator[Correction]:
    camera = setup.cameras[index]

    def repaired(zoom: np.ndarray) -> Camera:
        K = camera.model.K.copy()
        K[0, 0], K[1, 1] = K[0, 0] * np.exp(zoom[0]), K[1, 1] * np.exp(zoom[0])
        return replace(camera, model=replace(camera.model, K=K))

    for start in (np.array([-0.15]), np.array([0.15])):
        zoom, gain = _fitted(setup, index, repaired, np.vstack([start, 0.0 * start]), np.array([0.3]))
        if abs(zoom[0]) >= _LEAST_ZOOM:
            values = {"factor": float(np.exp(zoom[0]))}
            yield Correction("focal", (camera.name,), gain, setup.with_camera(index, repaired(zoom)), values)


def _place(setup: Setup, index: int) -> Iterator[Correction]:
    camera = setup.cameras[index]
    distance = float(np.linalg.norm(camera.center - setup.center))
    to_scene = se3.apply(camera.T_cam_world, setup.center)
    for n_free in (3, 6):
        scale = _STEP * np.array([1.0, 1.0, 1.0, distance, distance, distance])[:n_free]

        def repaired(p: np.ndarray, scale: np.ndarray = scale) -> Camera:
            step = np.zeros(6)
            step[: len(p)] = p * scale
            return replace(camera, T_world_cam=camera.T_world_cam @ se3.from_rotation_translation(so3.exp(step[:3]), step[3:]))

        simplex = np.vstack([np.zeros(n_free), np.eye(n_free)])
        p, gain = _fitted(setup, index, repaired, simplex, np.ones(n_free))
        now = repaired(p)
        seen_at = se3.apply(now.T_cam_world, setup.center)
        off = float(np.linalg.norm(seen_at / np.linalg.norm(seen_at) - to_scene / np.linalg.norm(to_scene)))
        turned = float(np.linalg.norm(so3.log(camera.T_world_cam[:3, :3].T @ now.T_world_cam[:3, :3])))
        moved = float(np.linalg.norm(now.center - camera.center))
        if max(off, 0.2 * turned, 0.5 * moved / distance) >= _LEAST_SHIFT:
            values = {"turned_deg": math.degrees(turned), "moved_m": moved}
            yield Correction("place", (camera.name,), gain - _PRICE * (n_free - 1), setup.with_camera(index, now), values)
        if gain < _WORTH_MORE:
            return


def _fitted(
    setup: Setup, index: int, repaired: Callable[[np.ndarray], Camera], simplex: np.ndarray, sigmas: np.ndarray
) -> tuple[np.ndarray, float]:
    """Numbers that make a camera agree best with the others, and by how much; what is hardly seen is held at zero."""

    few = setup.thinned()
    base = few.agreement_of(index)

    def gain(p: np.ndarray) -> float:
        return few.with_camera(index, repaired(p)).agreement_of(index) - base

    options = {"initial_simplex": simplex, "xatol": 0.01, "fatol": 2e-4, "maxfev": 60 * len(sigmas)}

    def cost(p: np.ndarray) -> float:
        return _PRIOR * float(np.sum((p / sigmas) ** 2)) - gain(p)

    found = minimize(cost, simplex[0], method="Nelder-Mead", options=options).x
    return found, setup.with_camera(index, repaired(found)).agreement_of(index) - setup.agreement_of(index)
