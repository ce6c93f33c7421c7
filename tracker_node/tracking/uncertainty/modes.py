"""Poses of a body that images do not tell apart: turns that map it onto itself, and modes beside the pose that was fitted.

Of a rigid body that was lost it is not known in which of its turns it was found. A turn about an axis of revolution, as of a
bottle or of a head that is a cone, is not told at all; lines that were drawn before the last step seem to tell a little of it.
Surface points of the turned body are compared with others of the body itself, in place and in color. Axes are those of the link,
of the shapes, and of inertia, through the middle of the surface; of a limb's end, that of its last joint.

A *mode* is another pose that explains the images nearly as well: found from starts beside the fit, tried again in the next sets,
and as far as it is probable the covariance is as wide as it is far.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Generic, Protocol, TypeVar

import numpy as np
import scipy  # imports its modules when they are first used

from ...camera.rig import Camera, CameraRig
from ...geometry import se3, so3
from ...model.articulated import ArticulatedModel, Shape
from ...model.configuration import Configuration, State, configured
from ...model.kinematic_chain import N_ROOT_DOF
from ...model.shapes.primitives import Ellipsoid, Mesh
from ...render.opengl.tessellation import Patch, tessellate

ANGLES = tuple(np.radians([35.0, 60.0, 72.0, 90.0, 120.0, 180.0]))  # the first: of bodies of revolution
_POINTS = 1500
_BELTS = 40  # of triangles on an ellipsoid
_MORE = 1.3  # times the distance of points to those of another sample, that is due to sampling
_MOST_OFF, _FEW = 0.06, 0.98  # of the size, that nearly all points may be off: a handle is more
_LEVELS = 300.0  # of color, that count as much as the size
_ALIKE = 0.999  # cosine of axes that are one


@dataclass(frozen=True, eq=False)
class Symmetry:
    """How a body may be turned without looking otherwise.

    Attributes
    ----------
    turns : angles about some axis of a body without joints, or of its base about the one joint on it, radians, from small to
        large; 35 degrees stand for any.
    axis : (2, 3) a point of the axis about which any turn of the whole body will do, meters in the frame of the root link, and
        its direction; (4, 3) three directions of a ball; None.
    dofs : indices of the joint axes that turn the end of a limb about its axis of revolution.
    base : index of the joint axis that a base of revolution may be turned about, and all else back; None.
    """

    turns: tuple[float, ...] = ()
    axis: np.ndarray | None = None
    dofs: tuple[int, ...] = ()
    base: int | None = None

    @property
    def has_spins(self) -> bool:
        """Whether there is any axis of revolution."""
        return self.axis is not None or bool(self.dofs) or self.base is not None

    def spins(self, body: Configuration) -> list[np.ndarray]:
        """Tangents (n_dof,) along which the body turns about an axis of revolution."""
        found = [np.eye(body.model.n_dof)[dof] for dof in self.dofs]
        if self.base is not None:
            found.append(np.eye(body.model.n_dof)[self.base])
            found[-1][:N_ROOT_DOF] = np.linalg.solve(body.twists[:N_ROOT_DOF].T, -body.twists[self.base])
        if self.axis is not None:
            T = body.Ts_world_link[0]
            for direction in self.axis[1:] @ T[:3, :3].T:
                twist = np.concatenate([np.cross(se3.apply(T, self.axis[0]), direction), direction])
                found.append(np.linalg.solve(body.twists[:N_ROOT_DOF].T, twist))
        return found


@lru_cache(maxsize=8)
def symmetry_of(model: ArticulatedModel, by_texture: bool = False) -> Symmetry:
    """The turns that map a body onto itself.

    Parameters
    ----------
    model : any body.
    by_texture : colors count point by point; else each shape has one.

    Returns
    -------
    ``turns`` and ``axis`` of a body without joints, ``dofs``, ``base`` and its ``turns`` of others.
    """
    if model.n_dof > N_ROOT_DOF:
        dof, turns = _of_base(model, by_texture)
        return Symmetry(turns, None, tuple(_rolls(model, by_texture)), dof if turns[:1] == ANGLES[:1] else None)
    whole = _Surface.of(model, range(len(model.shapes)), by_texture)
    if whole is None:
        return Symmetry()
    tried = ((angle, axis) for axis in _axes(model, whole.points) for angle in ANGLES)
    found = [(angle, axis) for angle, axis in tried if whole.is_mapped(whole.middle, axis, angle)]
    around = [axis for angle, axis in found if angle == ANGLES[0]]
    directions = around if len(around) < 2 else list(np.eye(3))  # more than one axis: a ball
    axis = np.array([whole.middle, *directions]) if directions else None
    return Symmetry(tuple(sorted({angle for angle, _ in found})), axis)


def _rolls(model: ArticulatedModel, by_texture: bool) -> Iterator[int]:
    """The last axes of the joints at the limbs' ends that turn what hangs on them about its own axis of revolution."""
    chain, neutral = model.chain, Configuration(model, State.neutral(model))
    axes = [axis for joint in chain.joints for axis in joint.axes]
    moved = chain.link_moved_by.T
    for dof in range(N_ROOT_DOF, model.n_dof):
        last = not any((moved[other] <= moved[dof]).all() for other in range(dof + 1, model.n_dof))
        if not last or axes[dof - N_ROOT_DOF].prismatic:
            continue
        end = _Surface.of(model, np.flatnonzero(moved[dof][model.shape_links]), by_texture)
        v, w = neutral.twists[dof, :3], neutral.twists[dof, 3:]
        if end is not None and end.is_mapped(np.cross(w, v), w, ANGLES[0]):
            yield dof


def _of_base(model: ArticulatedModel, by_texture: bool) -> tuple[int | None, tuple[float, ...]]:
    """Index of the only axis on the root link, where all else hangs on it, and the turns about it that map the base onto itself.

    Of a base without a shape, these are all.
    """
    moved = model.chain.link_moved_by[model.shape_links][:, N_ROOT_DOF:]
    on_base = ~moved.any(axis=1)
    first = np.flatnonzero((moved == ~on_base[:, None]).all(axis=0))
    axes = [axis for joint in model.chain.joints for axis in joint.axes]
    if not len(first) or axes[first[0]].prismatic:
        return None, ()
    dof = N_ROOT_DOF + int(first[0])
    base = _Surface.of(model, np.flatnonzero(on_base), by_texture)
    if base is None:
        return (None, ()) if on_base.any() else (dof, ANGLES)
    twist = Configuration(model, State.neutral(model)).twists[dof]
    about = np.cross(twist[3:], twist[:3]), twist[3:]
    return dof, tuple(angle for angle in ANGLES if base.is_mapped(*about, angle))


@dataclass(frozen=True, eq=False)
class _Surface:
    """Some shapes of the neutral body: ``points`` (n, 6) of their surface with colors, in sizes of the body, and others."""

    points: np.ndarray
    tree: scipy.spatial.cKDTree
    middle: np.ndarray
    size: float
    usual: float

    @classmethod
    def of(cls, model: ArticulatedModel, shapes: Iterable[int], by_texture: bool) -> _Surface | None:
        """None where there are no shapes, or textures count and there are any."""
        placed = Configuration(model, State.neutral(model)).Ts_world_shape
        triangles, tones = [], []
        for i in shapes:
            corners, colors = _triangles(model.shapes[i], by_texture)
            if colors is None:
                return None
            triangles.append(se3.apply(placed[i], corners.reshape(-1, 3)).reshape(-1, 3, 3))
            tones.append(colors)
        if not triangles:
            return None
        corners, colors = np.concatenate(triangles), np.concatenate(tones)
        points, more = _drawn(corners, colors, 1), _drawn(corners, colors, 2)
        middle = points[:, :3].mean(axis=0)
        size = float(np.linalg.norm(points[:, :3] - middle, axis=1).max())
        for sample in (points, more):
            sample[:, 3:] *= size / _LEVELS
        tree = scipy.spatial.cKDTree(more)
        return cls(points, tree, middle, size, float(tree.query(points)[0].mean()))

    def is_mapped(self, point: np.ndarray, axis: np.ndarray, angle: float) -> bool:
        """Whether a turn about an axis through a point maps the surface onto itself."""
        turned = self.points.copy()
        turned[:, :3] = (self.points[:, :3] - point) @ so3.exp(angle * axis).T + point
        off = self.tree.query(turned)[0]
        return bool(off.mean() < _MORE * self.usual and np.quantile(off, _FEW) < _MOST_OFF * self.size + self.usual)


def _triangles(shape: Shape, by_texture: bool) -> tuple[np.ndarray, np.ndarray | None]:
    """(n, 3, 3) corners in the frame of the shape and (n, 3) colors, 0..255, None of textures that count."""
    patches: tuple[Patch, ...] = ()
    if isinstance(shape.primitive, Mesh) and not by_texture:  # its own triangles will do, undivided
        corners = shape.primitive.vertices[shape.primitive.faces]
    elif isinstance(shape.primitive, Ellipsoid):  # what divides it evenly takes a quarter of a second to load
        corners = _globe() * shape.primitive.radii
    else:
        patches = tessellate(shape.primitive, shape.color_rgb)
        corners = np.concatenate([patch.vertices[patch.faces] for patch in patches])
    if not by_texture or not patches:
        return corners, np.tile(np.asarray(shape.color_rgb, dtype=np.float64), (len(corners), 1))
    if any(patch.texture is not None for patch in patches):
        return corners, None
    return corners, np.concatenate([255.0 * patch.colors[patch.faces].mean(axis=1) for patch in patches])


@cache
def _globe() -> np.ndarray:
    """(n, 3, 3) corners of triangles on the unit sphere, between circles of latitude and longitude."""
    polar, around = np.meshgrid(np.linspace(0.0, np.pi, _BELTS + 1), np.linspace(0.0, 2.0 * np.pi, 2 * _BELTS + 1), indexing="ij")
    points = np.stack([np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around), np.cos(polar)], axis=-1)
    a, b, c, d = points[:-1, :-1], points[1:, :-1], points[1:, 1:], points[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3, 3)


def _drawn(corners: np.ndarray, colors: np.ndarray, seed: int) -> np.ndarray:
    """(n, 6) points of the surface, evenly, with their colors."""
    rng = np.random.default_rng(seed)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = rng.choice(len(corners), _POINTS, p=areas / areas.sum())
    weights = rng.dirichlet(np.ones(3), _POINTS)
    return np.hstack([np.einsum("nk,nkj->nj", weights, corners[chosen]), colors[chosen]])


def _axes(model: ArticulatedModel, points: np.ndarray) -> Iterator[np.ndarray]:
    """Unit vectors, each direction once."""
    _, inertia = np.linalg.eigh(np.cov(points[:, :3].T))
    axes: list[np.ndarray] = []
    placed = Configuration(model, State.neutral(model)).Ts_world_shape[:20, :3, :3]
    for frame in (np.eye(3), *placed, inertia):
        for axis in frame.T:
            if all(abs(float(axis @ other)) < _ALIKE for other in axes):
                axes.append(axis)
                yield axis


TILTS = (np.radians(8.0), np.radians(20.0))
_TILT_AXES = 6
_SHIFT = 0.12  # of the size
N_TILTS, N_SHIFTS = len(TILTS) * _TILT_AXES, 6
FEW_CAMERAS = 2  # that see the body: more of them leave no such modes
_MOST_FOLLOWED = 2
_APART = 0.015  # of the size, that some point moves from one mode to another
_OF_A_TURN = np.radians(5.0)  # from a turn that maps the body onto itself
TAKEN, _DROPPED = 8.0, -6.0  # log odds of a mode against the fit


def tilted(model: ArticulatedModel, rig: CameraRig, state: State, which: Iterable[int] = range(N_TILTS)) -> list[State]:
    """States whose root is tilted about axes across the line of sight of the nearest camera, its middle staying in place.

    Parameters
    ----------
    model, rig : body and cameras.
    state : that is tilted.
    which : of the tilts, `_TILT_AXES` of each angle.

    Returns
    -------
    One for each of ``which``.
    """
    middle = _middle(model, state)
    camera = _nearest(rig, middle)
    sight = camera.T_cam_world[:3, :3] @ (middle - camera.center)
    sight /= np.linalg.norm(sight)
    across = np.cross(sight, [0.0, 1.0, 0.0] if abs(sight[1]) < 0.9 else [1.0, 0.0, 0.0])
    across /= np.linalg.norm(across)
    other = np.cross(sight, across)
    states = []
    for i in which:
        turn = (i % _TILT_AXES) * (2.0 * np.pi / _TILT_AXES)
        axis = camera.T_world_cam[:3, :3] @ (np.cos(turn) * across + np.sin(turn) * other)
        rotation = so3.exp(TILTS[i // _TILT_AXES] * axis)
        T = state.T_world_root.copy()
        T[:3, :3] = rotation @ T[:3, :3]
        T[:3, 3] = middle + rotation @ (T[:3, 3] - middle)
        states.append(State(T, state.joint_positions))
    return states


def shifted(
    model: ArticulatedModel, rig: CameraRig, state: State, size: float, which: Iterable[int] = range(N_SHIFTS)
) -> list[State]:  # fmt: skip
    """States that are shifted along the axes of the nearest camera, by a part of its size.

    Parameters
    ----------
    model, rig : body and cameras.
    state : that is shifted.
    size : of the body, meters.
    which : of the shifts, two for each axis.

    Returns
    -------
    One for each of ``which``.
    """
    axes, step = _nearest(rig, _middle(model, state)).T_cam_world[:3, :3], _SHIFT * size
    moves = [(1.0 if i % 2 else -1.0) * step * axes[i // 2] for i in which]
    return [state.retract(np.concatenate([move, np.zeros(model.n_dof - 3)])) for move in moves]


def _middle(model: ArticulatedModel, state: State) -> np.ndarray:
    return configured(model, state).Ts_world_shape[:, :3, 3].mean(axis=0)


def _nearest(rig: CameraRig, middle: np.ndarray) -> Camera:
    return min(rig, key=lambda camera: float(np.linalg.norm(camera.center - middle)))


class Posed(Protocol):
    """What a fit has at the least."""

    @property
    def state(self) -> State: ...


F = TypeVar("F", bound=Posed)


@dataclass(frozen=True, eq=False)
class Mode(Generic[F]):
    """A fit beside another one: ``tangent`` (n_dof,) from that to it, ``odds`` for it, natural logarithm."""

    fit: F
    tangent: np.ndarray
    odds: float


class Modes(Generic[F]):
    """The modes of one rigid body that are followed; deterministic in the fits since `reset`.

    Parameters
    ----------
    rig, model : cameras and body.
    size : of the body, meters.
    by_texture : colors tell turns apart point by point; else each shape has one.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, size: float, by_texture: bool = False):
        self._rig, self._model, self._size, self._by_texture = rig, model, size, by_texture
        self.reset()

    def reset(self) -> None:
        """Nothing is followed."""
        self._followed: list[np.ndarray] = []  # root of a mode in the frame of the fit's, (4, 4)
        self._next = 0

    def followed(self, state: State) -> list[State]:
        """Where the modes of the last set are beside a state."""
        return [State(state.T_world_root @ T, state.joint_positions) for T in self._followed]

    def starts(self, state: State, n: int | None = None) -> list[State]:
        """Starts beside a state.

        Parameters
        ----------
        state : of the body.
        n : so many, others with every image set; None: all.

        Returns
        -------
        Tilted and shifted states.
        """
        whole = N_TILTS + N_SHIFTS
        which = list(range(whole)) if n is None else [(self._next + i * (whole // n)) % whole for i in range(n)]
        self._next += n is not None
        tilts, shifts = [i for i in which if i < N_TILTS], [i - N_TILTS for i in which if i >= N_TILTS]
        return tilted(self._model, self._rig, state, tilts) + shifted(self._model, self._rig, state, self._size, shifts)

    def beside(self, fit: F, others: Iterable[tuple[F, float]]) -> list[Mode[F]]:
        """The modes beside a fit.

        Parameters
        ----------
        fit : of the present image set.
        others : of the same, with the log odds of each against it, natural logarithm.

        Returns
        -------
        The best first; those that are worth it, and apart from the fit and each other, but for turns that no image tells.
        """
        symmetry = symmetry_of(self._model, self._by_texture)
        spins, modes = symmetry.spins(configured(self._model, fit.state)), []
        turns = np.array([] if spins else symmetry.turns)
        for other, odds in others:
            tangent = _without(other.state.difference(fit.state), spins)
            aside = np.linalg.norm(_middle(self._model, other.state) - _middle(self._model, fit.state))
            in_place = aside < _APART * self._size
            turned = in_place & (np.abs(np.linalg.norm(tangent[3:6]) - turns) < _OF_A_TURN)
            if odds > _DROPPED and self.moved(fit.state, tangent) > _APART * self._size and not turned.any():
                modes.append(Mode(other, tangent, odds))
        modes.sort(key=lambda mode: -mode.odds)
        kept: list[Mode[F]] = []
        for mode in modes:
            if all(self.moved(fit.state, mode.tangent - each.tangent) > _APART * self._size for each in kept):
                kept.append(mode)
        return kept

    def follow(self, state: State, modes: Sequence[Mode[F]]) -> np.ndarray | None:
        """Follow the best modes from now on.

        Parameters
        ----------
        state : of the fit.
        modes : beside it, the best first.

        Returns
        -------
        (n_dof, n_modes) tangents to them, each times the root of its probability; None where there are none.
        """
        origin = se3.inverse(state.T_world_root)
        self._followed = [origin @ mode.fit.state.T_world_root for mode in modes[:_MOST_FOLLOWED]]
        if not modes:
            return None
        weights = np.exp([min(mode.odds, 0.0) for mode in modes])
        shares = np.sqrt(weights / (1.0 + weights.sum()))
        return np.stack([mode.tangent for mode in modes], axis=1) * shares

    def moved(self, state: State, tangent: np.ndarray) -> float:
        """How far some point of the body moves at most, about.

        Parameters
        ----------
        state, tangent : of the body, and (n_dof,) from it.

        Returns
        -------
        Meters.
        """
        lever = _middle(self._model, state) - state.T_world_root[:3, 3]
        shift = tangent[:3] + np.cross(tangent[3:6], lever)
        return float(np.linalg.norm(shift) + 0.5 * self._size * np.linalg.norm(tangent[3:6]))


def turn_sigma(model: ArticulatedModel, state: State, covariance: np.ndarray, by_texture: bool = False) -> float:
    """How well the turn of a body is known, but for one about an axis of revolution.

    Parameters
    ----------
    model : the body.
    state, covariance : of it, and (n_dof, n_dof) in its tangent.
    by_texture : of `symmetry_of`.

    Returns
    -------
    Standard deviation about the least known axis, radians.
    """
    told = np.eye(3)
    for spin in symmetry_of(model, by_texture).spins(configured(model, state)):
        axis = spin[3:6] / np.linalg.norm(spin[3:6])
        told -= np.outer(axis, axis)
    return float(np.sqrt(max(np.linalg.eigvalsh(told @ covariance[3:6, 3:6] @ told)[-1], 0.0)))


def point_sigma(model: ArticulatedModel, size: float, state: State, covariance: np.ndarray, by_texture: bool = False) -> float:
    """How well the points of a rigid body are known.

    Parameters
    ----------
    model, size : body and its size, meters.
    state, covariance, by_texture : of `turn_sigma`.

    Returns
    -------
    Standard deviation of the least known point, about, meters.
    """
    lever = _middle(model, state) - state.T_world_root[:3, 3]
    J = np.hstack([np.eye(3), -so3.hat(lever)])
    middle = float(np.linalg.eigvalsh(J @ covariance[:6, :6] @ J.T)[-1])
    return float(np.sqrt(middle + (0.5 * size * turn_sigma(model, state, covariance, by_texture)) ** 2))


def _without(tangent: np.ndarray, spins: list[np.ndarray]) -> np.ndarray:
    """A tangent without its parts along others."""
    for spin in spins:
        tangent = tangent - (tangent @ spin) / (spin @ spin) * spin
    return tangent
