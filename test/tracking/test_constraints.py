"""What a body may not do, and its pull to the neutral pose."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import END, END_RADIUS, START, START_RADIUS
from tracker_node.objective.constraints.collision import CollisionObjective, FloorObjective
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.constraints import constraints_of, neutral_information, resting


def lowest_m(model: ArticulatedModel, state: State) -> float:
    """z of the lowest point of the round cones within a body."""
    places = Configuration(model, state).Ts_world_link[model.shape_links]
    ends = [
        se3.apply(T, cones[:, at : at + 3])[:, 2] - cones[:, radius]
        for T, cones in zip(places, model.capsules, strict=True)
        for at, radius in ((START, START_RADIUS), (END, END_RADIUS))
    ]
    return float(np.concatenate(ends).min())


def test_joints_are_pulled_by_their_stiffness_and_the_root_is_free():
    """A pull of 9 squared pixels is half a unit of information."""
    chain = crane().chain
    found = neutral_information(chain, replace(from_dict({}).motion, neutral_angle=9.0))
    assert found[:6].tolist() == [0.0] * 6
    assert found[6:] == pytest.approx([0.5 * axis.stiffness for axis in chain.axes])
    assert {axis.stiffness for axis in chain.axes} == {0.0, 5.0}


def test_rest_is_the_neutral_pose():
    model = crane()
    prior = resting(model, from_dict({}).motion)
    assert prior.mean.joint_positions.tolist() == [axis.neutral for axis in model.chain.axes]


def test_parts_that_may_collide_are_kept_apart_where_that_is_asked_for():
    model = human_model()
    kinds = [type(one) for one in constraints_of(model, from_dict({"collision.enabled": True}))]
    assert CollisionObjective in kinds
    kinds = [type(one) for one in constraints_of(model, from_dict({"collision.enabled": False}))]
    assert CollisionObjective not in kinds


def test_a_floor_is_there_where_one_is_said_to_be():
    model = human_model()
    assert not any(isinstance(one, FloorObjective) for one in constraints_of(model, from_dict({})))
    config = from_dict({"floor.enabled": True, "floor.height_m": 0.3})
    (floor,) = (one for one in constraints_of(model, config) if isinstance(one, FloorObjective))
    here, on_it = State.neutral(model), State.neutral(model)
    on_it.T_world_root[2, 3] += 0.3 - lowest_m(model, here)
    assert floor.linearize(on_it).cost < 1e-12 < floor.linearize(here).cost


def test_one_part_alone_has_nothing_to_collide_with():
    model = ArticulatedModel("one", KinematicChain(("base",), ()), crane().shapes[:1])
    assert constraints_of(model, from_dict({"collision.enabled": True})) == []
    assert np.all(neutral_information(model.chain, from_dict({}).motion) == 0.0)
