"""Flights keep what physics keeps, and do what thrown crosses do."""

import numpy as np
import pytest

from helpers.bodies.wooden_cross import at, cross
from tracker_node.experiments.free_flight import FreeFlight, mass_properties
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, Ellipsoid

BODY = mass_properties(cross())
START = State(se3.from_rotation_translation(so3.exp(np.array([0.3, -0.2, 1.1])), np.array([0.2, 0.1, 1.0])), np.zeros(0))


def test_mass_properties_are_those_of_many_small_pieces():
    n = 20
    grid = np.stack(np.meshgrid(*[(np.arange(n) + 0.5) / n - 0.5] * 3), axis=-1).reshape(-1, 3)
    grid /= np.sqrt(1.0 - 1.0 / n**2)  # so much less do the middles of n pieces scatter than the whole
    sizes = [np.array(shape.primitive.size) for shape in cross().shapes]
    points = np.concatenate([
        se3.apply(shape.T_link_shape, grid * size) for shape, size in zip(cross().shapes, sizes, strict=True)
    ])  # fmt: skip
    masses = np.repeat([size.prod() for size in sizes], len(grid))
    center = np.average(points, axis=0, weights=masses)
    r = points - center
    second = (r.T * masses) @ r / masses.sum()
    np.testing.assert_allclose(BODY.center, center, atol=1e-12)
    np.testing.assert_allclose(BODY.inertia, np.trace(second) * np.eye(3) - second, rtol=1e-9, atol=1e-12)


def test_a_flight_keeps_angular_momentum_and_energy():
    flight = FreeFlight(BODY, START, np.array([1.0, 0.2, 3.0]), np.array([2.0, 9.0, -1.0]), 0.8)
    momenta, energies = [], []
    for t in np.linspace(0.0, 0.8, 9):
        omega = flight.spin(t)
        momenta.append(flight.state(t).T_world_root[:3, :3] @ BODY.inertia @ omega)
        energies.append(omega @ BODY.inertia @ omega)
    np.testing.assert_allclose(momenta, np.broadcast_to(momenta[0], (9, 3)), rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(energies, energies[0], rtol=1e-8)


def test_orientation_follows_the_spin():
    flight = FreeFlight(BODY, START, np.zeros(3), np.array([2.0, 9.0, -1.0]), 0.8)
    h = 1e-5
    before, after = (flight.state(0.4 + s).T_world_root[:3, :3] for s in (-h, h))
    rate = so3.log(before.T @ after) / (2 * h)
    np.testing.assert_allclose(rate, flight.spin(0.4), rtol=1e-6)


def test_the_center_of_mass_falls_freely_whatever_the_rotation():
    flight = FreeFlight(BODY, START, np.array([1.0, 0.2, 3.0]), np.array([0.0, 9.0, 0.4]), 0.8)
    np.testing.assert_allclose(flight.state(0.0).T_world_root, START.T_world_root, atol=1e-12)
    places = [se3.apply(flight.state(t).T_world_root, BODY.center) for t in (0.0, 0.4, 0.8)]
    np.testing.assert_allclose(places[0] - 2 * places[1] + places[2], [0.0, 0.0, -9.81 * 0.16], atol=1e-9)
    np.testing.assert_allclose(places[2] - places[0], [0.8, 0.16, 2.4 - 0.5 * 9.81 * 0.64], atol=1e-9)


def test_only_the_axis_of_middle_inertia_is_unstable():
    """The tennis racket theorem: spun about y, a cross in the plane of y and z twists by itself; about the others it does not."""
    for axis, unstable in ((0, False), (1, True), (2, False)):
        principal = np.linalg.eigh(BODY.inertia)[1][:, {0: 2, 1: 1, 2: 0}[axis]]
        spin = 9.0 * principal + [0.05, 0.05, 0.05]
        flight = FreeFlight(BODY, START, np.zeros(3), spin, 1.5)
        along = [abs(flight.spin(t) @ principal) / 9.0 for t in np.linspace(0.0, 1.5, 60)]
        assert (min(along) < 0.5) == unstable


def test_only_boxes_have_mass_properties():
    ball = ArticulatedModel("b", KinematicChain(("b",), ()), (Shape("ball", "b", Ellipsoid((1.0, 1.0, 1.0))),), ())
    with pytest.raises(ValueError, match=r"'ball', Ellipsoid"):
        mass_properties(ball)
    cube = ArticulatedModel("c", KinematicChain(("c",), ()), (Shape("cube", "c", Box((2.0, 2.0, 2.0)), at(1.0, 0.0, 0.0)),), ())
    np.testing.assert_allclose(mass_properties(cube).inertia, np.eye(3) * 2.0 / 3.0)
