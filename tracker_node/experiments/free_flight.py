"""A rigid body thrown into the air: its center of mass falls, its rotation is free of torque (Euler's equations).

So a flat body that turns about its axis of middle inertia begins to twist by itself, as a wooden cross that is thrown does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from ..geometry import se3, so3
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..model.shapes.primitives import Box

GRAVITY = 9.81  # m/s^2


@dataclass(frozen=True, eq=False)
class MassProperties:
    """Of a rigid body of one kilogram, in the axes of its root: ``center`` (3,) meters, ``inertia`` (3, 3) about it."""

    center: np.ndarray
    inertia: np.ndarray


def mass_properties(model: ArticulatedModel) -> MassProperties:
    """Of a body made of boxes of one density; what two boxes share counts twice."""
    masses, centers, inertias = [], [], []
    for shape, T in zip(model.shapes, Configuration(model, State.neutral(model)).Ts_world_shape, strict=True):
        if not isinstance(shape.primitive, Box):
            raise ValueError(f"expected a body of boxes, got shape '{shape.name}', {type(shape.primitive).__name__}")
        squares = np.square(shape.primitive.size)
        mass = float(np.prod(shape.primitive.size))
        masses.append(mass)
        centers.append(T[:3, 3])
        inertias.append(T[:3, :3] @ np.diag(mass / 12.0 * (squares.sum() - squares)) @ T[:3, :3].T)
    total = np.sum(masses)
    center = np.average(centers, axis=0, weights=masses)
    inertia = np.sum(inertias, axis=0)
    for mass, place in zip(masses, centers, strict=True):
        r = place - center
        inertia += mass * ((r @ r) * np.eye(3) - np.outer(r, r))
    return MassProperties(center, inertia / total)


class FreeFlight:
    """The motion of a thrown body.

    Parameters
    ----------
    body : its mass properties.
    start : at time zero; the body has no joints.
    velocity : (3,) of the center of mass at time zero, m/s, world.
    spin : (3,) angular velocity at time zero, rad/s, axes of the root.
    duration : seconds.
    """

    def __init__(self, body: MassProperties, start: State, velocity: np.ndarray, spin: np.ndarray, duration: float):
        self._body, self._velocity = body, np.asarray(velocity, dtype=np.float64)
        self._center = se3.apply(start.T_world_root, body.center)
        inverse = np.linalg.inv(body.inertia)

        def rates(_: float, y: np.ndarray) -> np.ndarray:
            rotation, omega = y[:9].reshape(3, 3), y[9:]
            return np.concatenate([(rotation @ so3.hat(omega)).ravel(), inverse @ np.cross(body.inertia @ omega, omega)])

        y0 = np.concatenate([start.T_world_root[:3, :3].ravel(), spin])
        solution = solve_ivp(rates, (0.0, duration), y0, "DOP853", rtol=1e-10, atol=1e-12, dense_output=True)
        self._turning = solution.sol

    def state(self, t: float) -> State:
        """At ``t`` seconds, 0 to ``duration``."""
        u, _, vt = np.linalg.svd(self._turning(t)[:9].reshape(3, 3))  # a rotation to the last digit
        rotation = u @ vt
        center = self._center + t * self._velocity - [0.0, 0.0, 0.5 * GRAVITY * t * t]
        return State(se3.from_rotation_translation(rotation, center - rotation @ self._body.center), np.zeros(0))

    def spin(self, t: float) -> np.ndarray:
        """Angular velocity (3,) rad/s in the axes of the root."""
        return self._turning(t)[9:]
