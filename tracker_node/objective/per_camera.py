"""What objectives of several cameras have in common: a camera's constants for kernels, the body as each sees it, a serial map.

The contours of a body that one camera sees, sample by sample.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..camera.rig import Camera
from ..geometry import so3
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State, configured
from ..render.contour import samples as cs
from ..render.contour.generators import N_COLUMNS, world_spheres
from ..render.shape_arrays import ShapeArrays


def camera_constants(camera: Camera) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """(params, R_cam_world (3, 3), t_cam_world (3,), center in the world (3,)), contiguous."""
    T = camera.T_cam_world
    return (
        camera.model.params,
        np.ascontiguousarray(T[:3, :3]),
        np.ascontiguousarray(T[:3, 3]),
        np.ascontiguousarray(camera.center),
    )


def moved_configuration(model: ArticulatedModel, state: State, offset: np.ndarray) -> Configuration:
    """A body a moment before or after a state: what a camera sees that does not expose with the others.

    A small turn d of the root before it has turned by w on the way is the turn exp(w) d after it; all else adds up.

    Parameters
    ----------
    model, state : the body.
    offset : (n_dof,) tangent from ``state``, held fixed.

    Returns
    -------
    The body in ``state.retract(offset)``, with ``twists`` that are derivatives by ``state``.
    """
    configuration = Configuration(model, state.retract(offset))
    configuration.twists[3:6] = so3.exp(offset[3:6]).T @ configuration.twists[3:6]
    return configuration


def moved_state(state: State, offset: np.ndarray | None) -> State:
    """The state of `moved_configuration`.

    Parameters
    ----------
    state, offset : of the body; None: it is seen in ``state``.

    Returns
    -------
    Where a camera sees the body.
    """
    return state if offset is None else state.retract(offset)


def bodies_seen(model: ArticulatedModel, state: State, offsets: Sequence[np.ndarray | None]) -> list[Configuration]:
    """The body as each camera sees it.

    Parameters
    ----------
    model, state : the body.
    offsets : of each camera, see `moved_configuration`; None: it sees the body in ``state``.

    Returns
    -------
    One a camera; one and the same where there is no offset.
    """
    common = configured(model, state)
    return [common if offset is None else moved_configuration(model, state, offset) for offset in offsets]


def cameras_by_body(cameras: Sequence[int], bodies: Sequence[Configuration]) -> list[list[int]]:
    """Cameras that see one and the same configuration.

    Parameters
    ----------
    cameras : indices.
    bodies : of `bodies_seen`.

    Returns
    -------
    Groups of these indices, in order.
    """
    groups: dict[int, list[int]] = {}
    for i in cameras:
        groups.setdefault(id(bodies[i]), []).append(i)
    return list(groups.values())


_OUTWARD_PX = 3.0  # how far beyond a contour it is decided what lies there


@dataclass(frozen=True, eq=False)
class SeenSamples:
    """n samples, those of one shape together: ``rows`` (n, 12) as in `generators`, ``pixels`` (n, 11) and ``info`` (n, 4) as
    in `render.contour.samples`."""

    rows: np.ndarray
    pixels: np.ndarray
    info: np.ndarray


def samples_seen(
    configuration: Configuration, arrays: ShapeArrays, camera: Camera, n_samples: int
) -> SeenSamples:
    """All contour samples that a camera sees.

    Parameters
    ----------
    configuration, arrays : the body in its state, and its shapes.
    camera : that sees it.
    n_samples : on a generator line.

    Returns
    -------
    The samples, those of one shape together.
    """
    Ts = configuration.Ts_world_shape
    spheres = np.empty((len(Ts), 4))
    world_spheres(Ts, arrays.bounds, spheres)
    most = cs.most_samples(arrays.packed, n_samples)
    rows, pixels = np.empty((most, N_COLUMNS)), np.empty((most, cs.N_PIXEL_COLUMNS))
    info = np.empty((most, cs.N_INFO_COLUMNS), dtype=np.int32)
    place = camera_constants(camera)
    n = cs.collect_samples(arrays.packed, Ts, spheres, place, n_samples, _OUTWARD_PX, rows, pixels, info)
    return SeenSamples(rows[:n], pixels[:n], info[:n])
