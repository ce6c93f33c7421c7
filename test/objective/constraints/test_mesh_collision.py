"""Parts that are meshes do not go through each other, and are left alone where they do not touch."""

import numpy as np
import pytest

from helpers.bodies.bodies import random_state
from helpers.bodies.mesh_robot import folded, of_meshes, of_solids
from helpers.bodies.mesh_solids import is_inside
from helpers.numeric.finite_difference import assert_jacobian
from tracker_node.geometry import se3
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.model.urdf_writer import urdf_of
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.segments18 import ellipsoid_human, nurbs_human
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Mesh
from tracker_node.objective.constraints.collision import CollisionObjective
from tracker_node.objective.constraints.prior import Prior, SumObjective
from tracker_node.optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.constraints import constraints_of


@pytest.fixture(scope="module")
def robot(tmp_path_factory) -> ArticulatedModel:
    return of_meshes(tmp_path_factory.mktemp("meshes"))


@pytest.fixture(scope="module")
def solid_robot(tmp_path_factory) -> ArticulatedModel:
    return of_solids(tmp_path_factory.mktemp("solids"))


def bent(model: ArticulatedModel, degrees: float) -> State:
    return State(np.eye(4), folded(model, degrees))


def test_what_may_touch_is_left_out(robot, solid_robot):
    pairs = {frozenset(pair) for pair in CollisionObjective(robot).pair_names}
    assert pairs == {frozenset(pair) for pair in (("fore", "column"), ("hand", "upper"), ("hand", "column"))}
    assert pairs == {frozenset(pair) for pair in CollisionObjective(solid_robot).pair_names}


def test_parts_that_overlap_in_the_neutral_pose_are_left_out(robot):
    """A hand that reaches back over the elbow, as covers of joints do."""
    def longer(shape: Shape) -> Shape:
        hand = Mesh(shape.primitive.vertices * [-5.0, 1.0, 1.0], shape.primitive.faces[:, ::-1])
        return Shape(shape.name, shape.link, hand) if shape.name == "hand" else shape

    pairs = CollisionObjective(ArticulatedModel("robot", robot.chain, tuple(map(longer, robot.shapes)))).pair_names
    assert frozenset(("hand", "upper")) not in {frozenset(pair) for pair in pairs}


def collisions(model: ArticulatedModel, state: State, pairs) -> list[float]:
    """For each pair of shapes, by name: of the vertices of one within the other, how far the deepest is from that one's own."""
    shapes = {shape.name: shape.primitive for shape in model.shapes}
    places = dict(zip(shapes, Configuration(model, state).Ts_world_shape, strict=True))
    depths = []
    for one, other in pairs:
        depth = 0.0
        for a, b in ((one, other), (other, one)):
            points = se3.apply(se3.inverse(places[b]) @ places[a], shapes[a].vertices)
            low, high = shapes[b].vertices.min(axis=0), shapes[b].vertices.max(axis=0)
            points = points[((points > low) & (points < high)).all(axis=1)]
            for point in points[is_inside(shapes[b], points)]:
                depth = max(depth, float(np.linalg.norm(shapes[b].vertices - point, axis=1).min()))
        depths.append(depth)
    return depths


def assert_as_by_brute_force(model: ArticulatedModel, states, deep_m: float) -> None:
    """By every vertex of one part in the other: what is taken to collide does, and what collides deeply is."""
    objective, seen = CollisionObjective(model), {True: 0, False: 0}
    for state in states:
        gaps = objective.gaps(state)
        near = np.flatnonzero(np.isfinite(gaps))
        for depth, gap in zip(collisions(model, state, [objective.pair_names[i] for i in near]), gaps[near], strict=True):
            if gap < -0.004:
                assert depth > 0.0
            if depth > deep_m:
                assert gap < 0.0
            seen[bool(gap < 0.0)] += 1
    assert seen[True] > 5 and seen[False] > 10


def test_reachable_poses_of_a_robot_are_free_and_others_are_not(robot):
    rng = np.random.default_rng(0)
    assert_as_by_brute_force(robot, [random_state(robot, rng) for _ in range(60)], 0.03)


def test_reachable_poses_of_a_body_are_free_and_others_are_not():
    model, rng = nurbs_human(16, 0.05), np.random.default_rng(5)
    assert_as_by_brute_force(model, [random_state(model, rng, 0.6) for _ in range(6)], 0.05)


@pytest.mark.parametrize("degrees", [140.0, 146.0, 155.0])
def test_gradient_of_the_cost(robot, degrees):
    objective = CollisionObjective(robot, 0.01)
    state = bent(robot, degrees).retract(np.array([0.3, -0.2, 0.1, 0.2, 0.1, -0.3, 0.07, 0.0, 0.2]))
    equations, gaps = objective.linearize(state), objective.gaps(state)
    assert equations.count == (gaps < 0.0).sum() > 0
    assert equations.cost == pytest.approx(((gaps[gaps < 0.0] / 0.01) ** 2).sum(), rel=1e-12)
    assert_jacobian(
        2.0 * equations.g[None] / equations.cost,
        lambda d: np.array([objective.linearize(state.retract(d)).cost]) / equations.cost, step=1e-6, tolerance=1e-5,
    )  # fmt: skip


def pulled_in(model: ArticulatedModel, collisions: list) -> State:
    """Where the optimizer ends that is drawn to a folded arm and keeps to what it is given."""
    wanted = bent(model, 140.0)
    pull = Prior(wanted, np.full(model.n_dof, 100.0))
    options = LevenbergMarquardtOptions(max_iterations=60, tolerance=0.0, step_tolerance=1e-7)
    return minimize(SumObjective(collisions, priors=[pull]), State.neutral(model), model.chain, options).state


def test_a_hand_drawn_into_the_column_is_kept_out(robot, solid_robot):
    """At the same angle as that of boxes and cylinders."""
    depths, elbows = [], []
    for model in (robot, solid_robot):
        objective = CollisionObjective(model, 0.005)
        assert -objective.gaps(bent(model, 140.0)).min() > 0.03
        free, held = pulled_in(model, [CollisionObjective(model, 1e6)]), pulled_in(model, [objective])
        assert -objective.gaps(free).min() > 0.03
        depths.append(-objective.gaps(held).min())
        elbows.append(np.rad2deg(held.joint_positions[model.chain.axis_index("elbow")]))
    assert max(depths) < 0.006
    assert elbows[0] == pytest.approx(elbows[1], abs=3.0)


def test_the_tracker_keeps_to_it(robot):
    """By its own configuration; one rigid mesh has nothing to run into."""
    (constraint,) = constraints_of(robot, TrackerConfig())
    assert constraint.linearize(bent(robot, 140.0)).cost > 1.0
    assert constraint.linearize(State.neutral(robot)).cost == 0.0
    rigid = ArticulatedModel("one", KinematicChain(("column",), ()), robot.shapes[:1])
    assert constraints_of(rigid, TrackerConfig()) == []


def test_written_models_know_nothing_of_it(robot, tmp_path):
    text = urdf_of(robot)
    dump_model(robot, tmp_path / "before.yaml")
    fresh = ArticulatedModel(robot.name, robot.chain, robot.shapes, robot.landmarks)
    assert len(fresh.capsules) == len(robot.shapes) and fresh.capsules is fresh.capsules
    dump_model(fresh, tmp_path / "after.yaml")
    assert urdf_of(fresh) == text
    assert (tmp_path / "after.yaml").read_text().replace("after", "before") == (tmp_path / "before.yaml").read_text()


def test_two_bodies_of_one_man_agree():
    """A surface of measured sections, and an ellipsoid for each segment: much the same pairs, and the same poses are free."""
    measured, ellipsoids = CollisionObjective(nurbs_human(24, 0.03)), CollisionObjective(ellipsoid_human())
    for objective in (measured, ellipsoids):
        assert objective.linearize(State.neutral(objective.model)).cost == 0.0
    both = [{frozenset(pair) for pair in objective.pair_names} for objective in (measured, ellipsoids)]
    assert len(both[0] ^ both[1]) <= 0.1 * len(both[0])
    index = [{frozenset(p): i for i, p in enumerate(o.pair_names)} for o in (measured, ellipsoids)]
    rows = [[table[pair] for pair in sorted(both[0] & both[1], key=sorted)] for table in index]
    rng, differences = np.random.default_rng(0), []
    for _ in range(40):
        state = random_state(measured.model, rng, 0.5)
        gaps = np.array([o.gaps(state)[r] for o, r in zip((measured, ellipsoids), rows, strict=True)])
        near = np.isfinite(gaps).all(axis=0) & (np.abs(gaps) < 0.05).any(axis=0)
        differences.append(gaps[0, near] - gaps[1, near])
    spread = np.abs(np.concatenate(differences))
    assert len(spread) > 50
    assert np.median(spread) < 0.02
