"""The tree of links and joints, and its forward kinematics.

A joint connects a parent link to a child link through a fixed offset and then zero to many axes in sequence, about which it turns
or along which it slides (a ball joint is three named revolutes, a weld is none). The root link floats: six degrees of freedom
come first in every tangent.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np

from ..compiled.kernels import compiled
from ..errors import ModelError, UnknownNameError, repeated

ROOT_DOF_NAMES = ("root_x", "root_y", "root_z", "root_rx", "root_ry", "root_rz")
N_ROOT_DOF = 6
ENDLESS_RAD = 2000.0 * np.pi  # a turn that no stop ends has these limits: finite, as searches and files want them
UNLIMITED_VELOCITY = 100.0  # rad/s or m/s: what files state as the limit of a joint that has none


@dataclass(frozen=True)
class Following:
    """An axis that another one drives, as gears and gripper fingers are: position = ``multiplier`` * leader + ``offset``.

    Positions are in radians and meters.
    """

    leader: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Axis:
    """One degree of freedom: a turn, or with ``prismatic`` a slide.

    ``direction`` (3,) unit, in the frame that the preceding axes have made; ``lower``/``upper`` in radians (meters); ``neutral``
    is where the weak prior pulls to, ``stiffness`` (1/rad^2, 1/m^2) how strongly (0: free; roll-like axes need some).
    ``mimic``: the axis that drives it, if one does. ``velocity_limit`` (rad/s, m/s): how fast it can move at all.
    """

    name: str
    direction: tuple[float, float, float]
    lower: float = -np.pi
    upper: float = np.pi
    neutral: float = 0.0
    stiffness: float = 0.0
    prismatic: bool = False
    mimic: Following | None = None
    velocity_limit: float = np.inf

    def __post_init__(self):
        if abs(np.linalg.norm(self.direction) - 1.0) > 1e-6:
            raise ValueError(f"axis '{self.name}': expected a unit direction, got {self.direction}")
        if not self.lower < self.upper:
            raise ValueError(f"axis '{self.name}': expected lower < upper, got [{self.lower}, {self.upper}]")
        if not self.lower <= self.neutral <= self.upper:
            raise ValueError(f"axis '{self.name}': expected neutral within the limits, got {self.neutral}")

    @property
    def endless(self) -> bool:
        """True for a turn without stops."""
        return not self.prismatic and self.lower <= -ENDLESS_RAD and self.upper >= ENDLESS_RAD

    @property
    def unit(self) -> str:
        return "m" if self.prismatic else "rad"


def followers_in_circle(axes: Iterable[Axis]) -> list[str]:
    """Names of axes that follow themselves in the end, or others that do."""
    leaders = {axis.name: axis.mimic.leader for axis in axes if axis.mimic is not None}
    last = {name: name for name in leaders}
    for _ in leaders:
        last = {name: leaders.get(at, at) for name, at in last.items()}
    return [name for name, at in last.items() if at in leaders]


def axes_in_degrees(rows: Iterable[tuple], prefix: str = "", sign: float = 1.0) -> tuple[Axis, ...]:
    """Axes of a joint by a table.

    Parameters
    ----------
    rows : of the left side or the trunk: name, direction, limits in degrees, stiffness[, neutral in degrees].
    prefix : of the names.
    sign : of y; -1 mirrors them to the right side.

    Returns
    -------
    An axis a row.
    """
    axes = []
    for name, (x, y, z), limits, stiffness, *neutral in rows:
        # A rotation axis is a pseudovector: mirrored in y, its x and z change sign. Adding 0.0 makes a -0.0 a plain zero, for
        # the sake of who reads the file.
        direction = (sign * x + 0.0, y + 0.0, sign * z + 0.0)
        lower, upper = np.deg2rad(limits).tolist()
        axes.append(Axis(prefix + name, direction, lower, upper, float(np.deg2rad(neutral[0])) if neutral else 0.0, stiffness))
    return tuple(axes)


@dataclass(frozen=True)
class Joint:
    """``child`` hangs on ``parent`` at ``T_parent_joint`` (4, 4), turned (or slid) by ``axes`` in order."""

    name: str
    parent: str
    child: str
    T_parent_joint: np.ndarray
    axes: tuple[Axis, ...] = ()


@compiled
def forward_kinematics(parents, offsets, axis_start, axis_count, directions, T_world_root, positions, Ts_world_link, twists):
    """World transforms of all links and the spatial twist of every degree of freedom.

    A twist is (v, omega) *at the world origin*: a body point p moved by dof i has velocity v + omega x p. Root: translation along
    world axes, then rotation about world axes through the root's origin.

    Parameters
    ----------
    parents, offsets : (n_links,) index, -1 for the root; (n_links, 4, 4) T_parent_joint.
    axis_start, axis_count : (n_links,) first axis of a link's joint, and their number.
    directions : (n_axes, 4) unit axis, and 1 where it slides.
    T_world_root, positions : (4, 4); (n_axes,) radians, meters where an axis slides.
    Ts_world_link, twists : (n_links, 4, 4) and (6 + n_axes, 6), which are filled.
    """
    for i in range(4):
        for j in range(4):
            Ts_world_link[0, i, j] = T_world_root[i, j]
    twists[:, :] = 0.0
    for i in range(3):
        twists[i, i] = 1.0
        twists[3 + i, 3 + i] = 1.0
    tx, ty, tz = T_world_root[0, 3], T_world_root[1, 3], T_world_root[2, 3]
    # v = -omega x t = t x omega
    twists[3, 0], twists[3, 1], twists[3, 2] = 0.0, tz, -ty
    twists[4, 0], twists[4, 1], twists[4, 2] = -tz, 0.0, tx
    twists[5, 0], twists[5, 1], twists[5, 2] = ty, -tx, 0.0
    rotation = np.empty((3, 3))
    turned = np.empty((3, 3))
    for link in range(1, parents.shape[0]):
        parent = parents[link]
        for i in range(3):
            for j in range(3):
                rotation[i, j] = (
                    Ts_world_link[parent, i, 0] * offsets[link, 0, j]
                    + Ts_world_link[parent, i, 1] * offsets[link, 1, j]
                    + Ts_world_link[parent, i, 2] * offsets[link, 2, j]
                )
        ox = Ts_world_link[parent, 0, 3]
        oy = Ts_world_link[parent, 1, 3]
        oz = Ts_world_link[parent, 2, 3]
        for j in range(3):
            ox += Ts_world_link[parent, 0, j] * offsets[link, j, 3]
            oy += Ts_world_link[parent, 1, j] * offsets[link, j, 3]
            oz += Ts_world_link[parent, 2, j] * offsets[link, j, 3]
        for axis in range(axis_start[link], axis_start[link] + axis_count[link]):
            ax, ay, az = directions[axis, 0], directions[axis, 1], directions[axis, 2]
            wx = rotation[0, 0] * ax + rotation[0, 1] * ay + rotation[0, 2] * az
            wy = rotation[1, 0] * ax + rotation[1, 1] * ay + rotation[1, 2] * az
            wz = rotation[2, 0] * ax + rotation[2, 1] * ay + rotation[2, 2] * az
            dof = 6 + axis
            if directions[axis, 3] != 0.0:
                twists[dof, 0], twists[dof, 1], twists[dof, 2] = wx, wy, wz
                ox, oy, oz = ox + positions[axis] * wx, oy + positions[axis] * wy, oz + positions[axis] * wz
                continue
            twists[dof, 0] = oy * wz - oz * wy
            twists[dof, 1] = oz * wx - ox * wz
            twists[dof, 2] = ox * wy - oy * wx
            twists[dof, 3], twists[dof, 4], twists[dof, 5] = wx, wy, wz
            # rotation <- rotation @ exp(axis * q), column-wise Rodrigues
            s, c = np.sin(positions[axis]), np.cos(positions[axis])
            t = 1.0 - c
            e00, e01, e02 = c + t * ax * ax, t * ax * ay - s * az, t * ax * az + s * ay
            e10, e11, e12 = t * ax * ay + s * az, c + t * ay * ay, t * ay * az - s * ax
            e20, e21, e22 = t * ax * az - s * ay, t * ay * az + s * ax, c + t * az * az
            for i in range(3):
                r0, r1, r2 = rotation[i, 0], rotation[i, 1], rotation[i, 2]
                turned[i, 0] = r0 * e00 + r1 * e10 + r2 * e20
                turned[i, 1] = r0 * e01 + r1 * e11 + r2 * e21
                turned[i, 2] = r0 * e02 + r1 * e12 + r2 * e22
            rotation, turned = turned, rotation
        for i in range(3):
            for j in range(3):
                Ts_world_link[link, i, j] = rotation[i, j]
            Ts_world_link[link, 3, i] = 0.0
        Ts_world_link[link, 0, 3], Ts_world_link[link, 1, 3], Ts_world_link[link, 2, 3] = ox, oy, oz
        Ts_world_link[link, 3, 3] = 1.0


@dataclass(frozen=True)
class KinematicChain:
    """Links in topological order (root first) with packed arrays for the kernels.

    Raises `ModelError` for a cycle, a link with two parents, several roots, or a joint to an unknown link.
    """

    links: tuple[str, ...]
    joints: tuple[Joint, ...]

    parents: np.ndarray = field(init=False, repr=False, compare=False)  # (n_links,), -1 for the root
    offsets: np.ndarray = field(init=False, repr=False, compare=False)  # (n_links, 4, 4) T_parent_joint
    axis_start: np.ndarray = field(init=False, repr=False, compare=False)  # (n_links,)
    axis_count: np.ndarray = field(init=False, repr=False, compare=False)
    directions: np.ndarray = field(init=False, repr=False, compare=False)  # (n_axes, 4): unit, 1 where it slides
    axes: tuple[Axis, ...] = field(init=False, repr=False, compare=False)
    link_moved_by: np.ndarray = field(init=False, repr=False, compare=False)  # (n_links, n_dof) bool
    lower: np.ndarray = field(init=False, repr=False, compare=False)  # (n_axes,) radians, meters; read-only
    upper: np.ndarray = field(init=False, repr=False, compare=False)
    neutral: np.ndarray = field(init=False, repr=False, compare=False)  # driven axes where their leaders put them
    couplings: tuple[tuple[int, int, Following], ...] = field(init=False, repr=False, compare=False)  # (axis, leader, how)

    def __repr__(self) -> str:
        """In a line, as of a body."""
        return f"<{type(self).__name__}: {len(self.links)} links from {self.links[0]!r} on, {self.n_dof} degrees of freedom>"

    def __post_init__(self):
        links, joint_of = _topological_order(self.links, self.joints)
        index = {name: i for i, name in enumerate(links)}
        n = len(links)
        parents, offsets = np.full(n, -1, dtype=np.int64), np.tile(np.eye(4), (n, 1, 1))
        axis_start, axis_count = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.int64)
        axes: list[Axis] = []
        moved: list[set[int]] = [set(range(N_ROOT_DOF))]
        for i, link in enumerate(links[1:], start=1):
            joint = joint_of[link]
            parents[i] = index[joint.parent]
            offsets[i] = joint.T_parent_joint
            axis_start[i], axis_count[i] = len(axes), len(joint.axes)
            own = {N_ROOT_DOF + len(axes) + j for j in range(len(joint.axes))}
            moved.append(moved[parents[i]] | own)
            axes.extend(joint.axes)
        names = [axis.name for axis in axes]
        if twice := repeated(names):
            raise ModelError(f"degree-of-freedom names must be unique; repeated: {twice}")
        for axis in axes:
            if axis.mimic is not None and (axis.mimic.leader not in names or axis.mimic.leader == axis.name):
                others = [name for name in names if name != axis.name]
                raise UnknownNameError(f"axis that '{axis.name}' follows", axis.mimic.leader, others)
        if circle := followers_in_circle(axes):
            raise ModelError(f"axes may not follow each other in a circle: {circle}")
        link_moved_by = np.zeros((n, N_ROOT_DOF + len(axes)), dtype=np.bool_)
        for i, dofs in enumerate(moved):
            link_moved_by[i, sorted(dofs)] = True
        set_ = object.__setattr__
        set_(self, "links", tuple(links))
        set_(self, "parents", parents)
        set_(self, "offsets", offsets)
        set_(self, "axis_start", axis_start)
        set_(self, "axis_count", axis_count)
        set_(self, "axes", tuple(axes))
        set_(self, "directions", np.array([(*a.direction, a.prismatic) for a in axes], dtype=np.float64).reshape(-1, 4))
        set_(self, "link_moved_by", link_moved_by)
        followers = [(i, axis.mimic) for i, axis in enumerate(axes) if axis.mimic is not None]
        set_(self, "couplings", tuple((i, names.index(mimic.leader), mimic) for i, mimic in followers))
        set_(self, "lower", np.array([axis.lower for axis in axes]))
        set_(self, "upper", np.array([axis.upper for axis in axes]))
        set_(self, "neutral", self.followed(np.array([axis.neutral for axis in axes])))
        for constant in (self.lower, self.upper, self.neutral):
            constant.flags.writeable = False

    @property
    def n_axes(self) -> int:
        return len(self.axes)

    @property
    def n_dof(self) -> int:
        return N_ROOT_DOF + len(self.axes)

    @property
    def dof_names(self) -> tuple[str, ...]:
        """Names in tangent order: six of the root, then the joint axes."""
        return ROOT_DOF_NAMES + tuple(axis.name for axis in self.axes)

    @property
    def dof_units(self) -> tuple[str, ...]:
        """Units in tangent order, "m" or "rad"."""
        return ("m", "m", "m", "rad", "rad", "rad", *(axis.unit for axis in self.axes))

    def followed(self, positions: np.ndarray) -> np.ndarray:
        """Joint positions (n_axes,) with driven axes where their leaders put them, within their limits."""
        positions = np.array(positions, dtype=np.float64)
        for _ in self.couplings:  # a leader may itself be driven
            for i, leader, following in self.couplings:
                wanted = following.multiplier * positions[leader] + following.offset
                positions[i] = min(max(wanted, self.axes[i].lower), self.axes[i].upper)
        return positions

    def beyond_limits(self, positions: np.ndarray) -> list[str]:
        """Which joint positions (n_axes,) lie beyond their limits, in words: "elbow: 3.1 is not in [0, 2.6] rad"."""
        pairs = [(a, float(q)) for a, q in zip(self.axes, positions, strict=True) if not a.lower <= q <= a.upper]
        return [f"{axis.name}: {q:.4g} is not in [{axis.lower:.4g}, {axis.upper:.4g}] {axis.unit}" for axis, q in pairs]

    def dofs_of(self, links: Iterable[int]) -> np.ndarray:
        """(n_dof,) mask of the axes of the joints that links hang on."""
        mask = np.zeros(self.n_dof, dtype=np.bool_)
        for link in links:
            first = N_ROOT_DOF + self.axis_start[link]
            mask[first : first + self.axis_count[link]] = True
        return mask

    def link_index(self, name: str) -> int:
        if name not in self.links:
            raise UnknownNameError("link", name, self.links)
        return self.links.index(name)

    @property
    def slides(self) -> frozenset[str]:
        """Names of the axes along which links slide: their positions are meters."""
        return frozenset(axis.name for axis in self.axes if axis.prismatic)

    def axis_index(self, name: str) -> int:
        """Index into the joint positions of the axis ``name``."""
        for i, axis in enumerate(self.axes):
            if axis.name == name:
                return i
        raise UnknownNameError("joint axis", name, [axis.name for axis in self.axes])


def _topological_order(links: tuple[str, ...], joints: tuple[Joint, ...]) -> tuple[list[str], dict[str, Joint]]:
    if twice := repeated(links):
        raise ModelError(f"link names must be unique; repeated: {twice}")
    joint_of: dict[str, Joint] = {}
    for joint in joints:
        for link in (joint.parent, joint.child):
            if link not in links:
                raise UnknownNameError(f"link of joint '{joint.name}'", link, links)
        if joint.child in joint_of:
            raise ModelError(f"link '{joint.child}' has two parents: joints '{joint_of[joint.child].name}' and '{joint.name}'")
        joint_of[joint.child] = joint
    roots = [link for link in links if link not in joint_of]
    if not roots:
        raise ModelError("the kinematic tree has a cycle: every link has a parent")
    if len(roots) > 1:
        raise ModelError(f"the kinematic tree must have one root, got {roots}")
    ordered = [roots[0]]
    for link in ordered:  # grows while we walk: breadth first in the order of the file
        ordered.extend(child for child in links if child in joint_of and joint_of[child].parent == link)
    if len(ordered) != len(links):
        raise ModelError(f"the kinematic tree has a cycle through {sorted(set(links) - set(ordered))}")
    return ordered, joint_of
