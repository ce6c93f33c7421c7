"""A family of bodies around a given one: segment lengths, breadths, girths, sections, tapers and places of the flesh as numbers.

Every parameter is zero for the given body. Most are logarithms of scales, so that half and double are equally far and no
length becomes negative; a taper is the logarithm of the ratio of a cone's end radii, a shift moves a shape across its
link in units of its own mean radius. What people of one size differ by, the standard deviations of `SIGMAS`, are the prior.

`expected_lengths`: a detector's joints are those of people who clicked in pictures, or of skeletons of rendered bodies: an upper
arm between them is a seventh shorter than between the centers of rotation that anatomists tabulate, hips are a third farther
apart. The default body has the latter; one that is made from points alone is expected to have the former.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from .articulated import ArticulatedModel, Landmark, Shape
from .humans.measures import mirrored_name
from .kinematic_chain import KinematicChain
from .shapes.primitives import Primitive, TruncatedCone
from .variants import scaled_primitive

# Standard deviations. Gordon et al. (1989), 1988 Anthropometric Survey of U.S. Army Personnel: stature varies by 4 % of its mean,
# lengths of single segments by 5 to 6, breadths and depths of the trunk by 6 to 9, girths of limbs by 7 to 9 %. A tenth for
# all that is across leaves room for clothes, and for shapes that are no cones. Ratios, tapers and shifts: our own estimates.
SIGMAS: Mapping[str, float] = {
    "size": 0.04, "length": 0.05, "breadth": 0.08, "girth": 0.10, "section": 0.10, "taper": 0.15, "shift": 0.12,
}  # fmt: skip
GROUPS = tuple(SIGMAS)
_LEAST_BREADTH_M = 0.03  # joints nearer than this to their parent's axis are taken to lie on it
_LATERAL = 1  # the axis y of links, in which left and right mirror each other


@dataclass(frozen=True)
class ShapeParameter:
    """``name`` is its group and what it changes (``length thigh``); ``sigma`` its standard deviation among people of one size."""

    name: str
    group: str
    sigma: float


class ShapeSpace:
    """Bodies like ``model``, by a vector s (n,) with one entry a parameter, zero for ``model`` itself.

    Parameters
    ----------
    symmetric : links ``left_...`` and ``right_...`` share their parameters, and shapes without a side stay in the middle.
    groups : which of `GROUPS` may change.

    Attributes
    ----------
    parameters : of every entry of s.
    log_places : (n_links, 3, n) logarithm of the scale of what is fixed to a link, along the link's axes, by s.
    log_sizes : (n_shapes, 3, n) of each shape along its own axes.
    tapers : (n_shapes, n) logarithm of the ratio of end radii that is added.
    shifts : (n_shapes, 3, n) move of a shape along its link's axes, meters.
    """

    def __init__(self, model: ArticulatedModel, symmetric: bool = True, groups: tuple[str, ...] = GROUPS):
        unknown = sorted(set(groups) - set(GROUPS))
        if unknown:
            raise ValueError(f"expected groups of {GROUPS}, got {unknown}")
        self.model = model
        self._symmetric, self._groups = symmetric, groups
        self._entries: dict[str, tuple[ShapeParameter, list]] = {}
        self._long_axes = [_long_axis(model, link) for link in range(len(model.chain.links))]
        self._collect()
        self.parameters = tuple(parameter for parameter, _ in self._entries.values())
        n = len(self.parameters)
        self.log_places = np.zeros((len(model.chain.links), 3, n))
        self.log_sizes = np.zeros((len(model.shapes), 3, n))
        self.tapers = np.zeros((len(model.shapes), n))
        self.shifts = np.zeros((len(model.shapes), 3, n))
        for column, (_, effects) in enumerate(self._entries.values()):
            for array, index, factor in effects:
                getattr(self, array)[(*index, column)] += factor

    def __len__(self) -> int:
        return len(self.parameters)

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(parameter.name for parameter in self.parameters)

    @property
    def sigmas(self) -> np.ndarray:
        """(n,) standard deviations of the prior."""
        return np.array([parameter.sigma for parameter in self.parameters])

    def body(self, s: np.ndarray) -> ArticulatedModel:
        """The body of the parameters ``s`` (n,)."""
        chain, place = self.model.chain, np.exp(self.log_places @ s)
        joints = []
        for joint in chain.joints:
            T = np.array(joint.T_parent_joint)
            T[:3, 3] *= place[chain.link_index(joint.parent)]
            joints.append(replace(joint, T_parent_joint=T))
        shapes = tuple(self._shape(i, shape, s, place) for i, shape in enumerate(self.model.shapes))
        landmarks = []
        for landmark, link in zip(self.model.landmarks, self.model.landmark_links, strict=True):
            x, y, z = (float(v) for v in place[link] * landmark.position)
            landmarks.append(Landmark(landmark.name, landmark.link, (x, y, z)))
        return replace(self.model, chain=KinematicChain(chain.links, tuple(joints)), shapes=shapes, landmarks=tuple(landmarks))

    def _shape(self, i: int, shape: Shape, s: np.ndarray, place: np.ndarray) -> Shape:
        T = np.array(shape.T_link_shape)
        T[:3, 3] = T[:3, 3] * place[self.model.shape_links[i]] + self.shifts[i] @ s
        primitive = tapered(scaled_primitive(shape.primitive, np.exp(self.log_sizes[i] @ s)), float(self.tapers[i] @ s))
        return replace(shape, primitive=primitive, T_link_shape=T)

    def _add(self, group: str, what: str, effects: list) -> None:
        if group not in self._groups:
            return
        key = f"{group} {what}".strip()
        parameter = ShapeParameter(key, group, SIGMAS[group])
        self._entries.setdefault(key, (parameter, []))[1].extend(effects)

    def _collect(self) -> None:
        model, links = self.model, self.model.chain.links
        everything: list = [("log_places", (i, axis), 1.0) for i in range(len(links)) for axis in range(3)]
        everything += [("log_sizes", (i, axis), 1.0) for i in range(len(model.shapes)) for axis in range(3)]
        self._add("size", "", everything)
        for i, link in enumerate(links):
            axis, name = self._long_axes[i], self._common(link)
            own = [k for k in range(len(model.shapes)) if model.shape_links[k] == i]
            sizes: list = [("log_sizes", (k, _shape_axis(model.shapes[k], axis)), 1.0) for k in own]
            if sizes or np.any(np.abs(_children(model, i)[:, axis]) > _LEAST_BREADTH_M):
                self._add("length", name, [("log_places", (i, axis), 1.0), *sizes])
            for across in (k for k in range(3) if k != axis):
                if np.any(np.abs(_children(model, i)[:, across]) > _LEAST_BREADTH_M):
                    self._add("breadth", f"{name} {'xyz'[across]}", [("log_places", (i, across), 1.0)])
            for k in own:
                self._collect_section(k, axis)

    def _collect_section(self, k: int, axis: int) -> None:
        """Parameters of one shape across the long axis of its link."""
        shape = self.model.shapes[k]
        name, across = self._common(shape.name), [i for i in range(3) if i != axis]
        first, second = (_shape_axis(shape, i) for i in across)
        self._add("girth", name, [("log_sizes", (k, first), 1.0), ("log_sizes", (k, second), 1.0)])
        self._add("section", name, [("log_sizes", (k, first), 0.5), ("log_sizes", (k, second), -0.5)])
        if isinstance(shape.primitive, TruncatedCone):
            # A mirrored cone may stand the other way round on its link
            self._add(
                "taper", name, [("tapers", (k,), 1.0 if shape.T_link_shape[axis, 2] * self._side(shape.link, axis) > 0 else -1.0)]
            )
        unit = _mean_radius(shape.primitive, (first, second))
        for i in across:
            if self._symmetric and i == _LATERAL and shape.link == mirrored_name(shape.link):
                continue
            self._add("shift", f"{name} {'xyz'[i]}", [("shifts", (k, i), unit * self._side(shape.link, i))])

    def _common(self, name: str) -> str:
        """The name without its side, where both sides share their parameters."""
        return name.removeprefix("left_").removeprefix("right_") if self._symmetric else name

    def _side(self, link: str, axis: int) -> float:
        """-1 where what is the same on both sides goes the other way along an axis."""
        return -1.0 if self._symmetric and axis == _LATERAL and link.startswith("right_") else 1.0


def tapered(primitive: Primitive, taper: float) -> Primitive:
    """A cone with another ratio of end radii, their geometric mean kept.

    Parameters
    ----------
    primitive : shape; others than cones stay as they are.
    taper : logarithm of the factor of the ratio.

    Returns
    -------
    Shape of the same kind.
    """
    if not isinstance(primitive, TruncatedCone) or taper == 0.0:
        return primitive
    z1, z2, k = primitive.z1, primitive.z2, primitive.k
    near, far = (1.0 + k * z1) * np.exp(-0.5 * taper), (1.0 + k * z2) * np.exp(0.5 * taper)
    slope = (far - near) / (z2 - z1)
    middle = near - slope * z1  # radius at z = 0 as a multiple of the former one
    if middle <= 1e-6 * max(near, far):
        raise ValueError(f"a taper of {taper:.2f} would bring the apex of {primitive} to its origin")
    return TruncatedCone(primitive.a * middle, primitive.b * middle, slope / middle, z1, z2)


def _children(model: ArticulatedModel, link: int) -> np.ndarray:
    """(n, 3) places of the joints on a link."""
    chain = model.chain
    return chain.offsets[chain.parents == link, :3, 3].reshape(-1, 3)


def half_extents(primitive: Primitive) -> np.ndarray:
    """(3,) half of what a shape measures along its own axes, meters."""
    if isinstance(primitive, TruncatedCone):
        scale = 1.0 + 0.5 * primitive.k * (primitive.z1 + primitive.z2)
        return np.array([primitive.a * scale, primitive.b * scale, 0.5 * (primitive.z2 - primitive.z1)])
    if hasattr(primitive, "radii"):
        return np.array(primitive.radii)
    if hasattr(primitive, "size"):
        return 0.5 * np.array(primitive.size)
    return 0.5 * np.ptp(primitive.vertices, axis=0)


def _mean_radius(primitive: Primitive, axes: tuple[int, int]) -> float:
    return float(np.sqrt(np.prod(half_extents(primitive)[list(axes)])))


def _shape_axis(shape: Shape, link_axis: int) -> int:
    """The axis of a shape that lies nearest to an axis of its link, each taken once (x and y first)."""
    alignment = np.abs(shape.T_link_shape[:3, :3])
    free, result = [0, 1, 2], {}
    for axis in np.argsort(-alignment.max(axis=1), kind="stable"):
        result[axis] = max(free, key=lambda j: alignment[axis, j])
        free.remove(result[axis])
    return result[link_axis]


def _long_axis(model: ArticulatedModel, link: int) -> int:
    """Along which of its axes a link is long: that of its largest shape; without one, of its farthest joint."""
    own = [shape for shape, at in zip(model.shapes, model.shape_links, strict=True) if at == link]
    if own:
        largest = max(own, key=lambda shape: float(np.prod(half_extents(shape.primitive))))
        along = 2 if isinstance(largest.primitive, TruncatedCone) else int(np.argmax(half_extents(largest.primitive)))
        return int(np.argmax(np.abs(largest.T_link_shape[:3, along])))
    places = np.abs(_children(model, link))
    return int(np.argmax(places.max(axis=0))) if len(places) else 2


# Over 300 people of anny 0.6.2 (Brégier et al., Human Mesh Modeling for Anny Body, ECCV 2026): logarithms of lengths over those
# of the default body of the same size (trunk, thigh and shank together). Each is MEANS + SLOPES * (logarithm of the size), with
# covariance COVARIANCE. `benchmark/clothed/person/_write_bodies.py --lengths 300` draws them, `benchmark.clothed._fit --lengths`
# prints this. The Balancing clip's person, by OpenPose's joints, lies within but for a trunk that is longer by 7 % (3.4 sigma).
_ROWS = (
    ("length upper_arm",), ("length forearm",), ("length thigh",), ("length shank",),
    ("length pelvis", "length abdomen", "length torso"), ("length clavicle",), ("breadth pelvis y",),
)  # fmt: skip
_MEANS = np.array([-0.162, -0.024, 0.016, 0.035, -0.047, 0.006, 0.309])
_SLOPES = np.array([-0.083, 0.002, 0.230, -0.154, -0.058, -0.097, -0.140])
_COVARIANCE = 1e-4 * np.array([
    [2.68, -0.82, 4.36, -3.33, -0.66, -4.09, -6.11],
    [-0.82, 26.08, -2.40, 5.88, -3.28, 19.50, 21.33],
    [4.36, -2.40, 22.71, -14.86, -6.03, -19.27, -19.97],
    [-3.33, 5.88, -14.86, 11.44, 2.44, 16.43, 16.45],
    [-0.66, -3.28, -6.03, 2.44, 3.02, 1.70, 2.16],
    [-4.09, 19.50, -19.27, 16.43, 1.70, 33.22, 28.20],
    [-6.11, 21.33, -19.97, 16.45, 2.16, 28.20, 42.03],
])  # fmt: skip
_SIZE_SIGMA = 0.15  # children, too
_OWN_SIGMA = 0.01  # of a length that the drawn bodies do not vary by themselves
_WITHIN_TRUNK_SIGMA = 0.05  # of the ratio of two of its parts


def expected_lengths(space: ShapeSpace) -> tuple[np.ndarray, np.ndarray]:
    """What is expected of the shape parameters of a person whose joints a detector has found.

    Parameters
    ----------
    space : bodies like the default human, or like another model.

    Returns
    -------
    Mean (n,) and information (n, n) of the parameters; those of `ShapeSpace.sigmas` for a body that has not these lengths.
    """
    names, mean, information = space.names, np.zeros(len(space)), np.diag(space.sigmas**-2.0)
    if not {"size", *(name for row in _ROWS for name in row)} <= set(names):
        return mean, information
    columns = [[names.index(name) for name in row] for row in _ROWS]
    size, described = names.index("size"), [names.index("size"), *(column for row in columns for column in row)]
    information[described, described] = 0.0
    to_rows = np.zeros((len(_ROWS), len(space)))
    for k, row in enumerate(columns):
        to_rows[k, row] = 1.0 / len(row)
        mean[row] = _MEANS[k]
        for one, other in pairwise(row):
            information[np.ix_([one, other], [one, other])] += np.array([[1.0, -1.0], [-1.0, 1.0]]) / _WITHIN_TRUNK_SIGMA**2
    to_rows[:, size] -= _SLOPES
    information += to_rows.T @ np.linalg.inv(_COVARIANCE + _OWN_SIGMA**2 * np.eye(len(_ROWS))) @ to_rows
    information[size, size] += _SIZE_SIGMA**-2.0
    return mean, information
