"""The motion in space: each part where kinematics has it, truth and cameras beside, and nothing where nothing is known."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.stick_person import motion, write_run
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.evaluation.evaluate import EvaluationOptions
from tracker_node.evaluation.report.scene import MOST_FRAMES, _drawn, _nearest, scene
from tracker_node.evaluation.review import Review, review
from tracker_node.evaluation.truth.files import Truth
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.model.configuration import Configuration
from tracker_node.model.shapes.primitives import Box, Ellipsoid, Mesh, TruncatedCone
from tracker_node.render.palette import BLUE, CYCLE, ORANGE
from tracker_node.runs.load import load_run

N = 12


@pytest.fixture
def made(tmp_path):
    def make(name: str = "run", n: int = N, truth: bool = False) -> Review:
        tracked = motion(n)
        write_run(tmp_path / name, tracked, ["TRACKING"] * (n - 2) + ["LOST"] * 2)
        known = np.ones(tracked.landmarks_m.shape[:2], dtype=bool)
        known[3, 0] = False
        joints = Trajectories(tracked.model.landmark_names, tracked.stamps_ns, tracked.landmarks_m, known)
        given = Truth(joints, None) if truth else Truth()
        return review(load_run(tmp_path / name), tracked.model, given, EvaluationOptions(name, 0.0))

    return make


def test_parts_are_where_the_state_has_them(made):
    found = made()
    view = scene([found])
    (body,) = view.bodies
    model = found.model
    assert view.times == pytest.approx(found.times_s) and body.points.shape[0] == N
    Ts = found.run.configuration(model, 5).Ts_world_shape
    for k, (a, b, _, _, color) in enumerate(body.rods):
        shape = model.shapes[k]
        ends, _, _ = _drawn(shape.primitive)
        assert body.points[5, [a, b]] == pytest.approx(ends @ Ts[k, :3, :3].T + Ts[k, :3, 3])
        side = shape.link.split("_")[0]
        assert (color == BLUE) == (side == "left") and (color == ORANGE) == (side == "right")
    assert [state for state, _ in view.states] == ["tracking"] * (N - 2) + ["lost"] * 2
    assert len({color for _, color in view.states}) == 2


def test_truth_is_dots_and_a_joint_that_is_not_known_has_none(made):
    found = made(truth=True)
    truth = scene([found]).bodies[-1]
    assert truth.label == "truth" and len(truth.dots) == len(found.joints.joints) and not truth.rods
    assert np.isnan(truth.points[3, 0]).all() and np.isfinite(truth.points[3, 1:]).all()
    assert truth.points[5] == pytest.approx(found.joints.truth_m[5])


def test_several_runs_have_a_color_each_and_the_time_of_the_first(made):
    one, other = made("one"), made("other", n=N - 4)
    view = scene([one, other])
    assert [body.label for body in view.bodies] == ["one", "other"]
    assert {rod[4] for rod in view.bodies[0].rods} == {CYCLE[0]} and {rod[4] for rod in view.bodies[1].rods} == {CYCLE[1]}
    assert np.isfinite(view.bodies[1].points[: N - 4]).all() and np.isnan(view.bodies[1].points[N - 4 :]).all()
    assert "one blue, other orange; the status is that of one" in view.note


def test_a_long_run_is_thinned(made):
    view = scene([made(n=MOST_FRAMES + 1)])
    assert len(view.times) == len(view.states) == len(view.bodies[0].points) == (MOST_FRAMES + 2) // 2


def test_cameras_stand_where_they_are_and_look_where_they_look(made):
    rig = circle_rig(3)
    found = replace(made(), rig=rig)
    cameras = scene([found]).cameras
    assert list(cameras) == list(rig.names)
    for camera in rig:
        center, *corners = cameras[camera.name]
        assert center == pytest.approx(camera.center)
        pixels, ahead = camera.project(np.array(corners))
        width, height = camera.model.width, camera.model.height
        assert ahead.all()
        assert pixels == pytest.approx(np.array([[0, 0], [width - 1, 0], [width - 1, height - 1], [0, height - 1]]), abs=30)


def test_a_run_without_any_state_has_no_view(made):
    found = made()
    assert scene([replace(found, run=replace(found.run, values=np.full(found.run.values.shape, np.nan)))]) is None


@pytest.mark.parametrize(
    ("primitive", "ends", "radii"),
    [
        (TruncatedCone(0.1, 0.06, -1.0, 0.0, 0.5), [[0, 0, 0], [0, 0, 0.5]], (0.08, 0.04)),
        (Ellipsoid((0.1, 0.3, 0.06)), [[0, -0.22, 0], [0, 0.22, 0]], (0.08, 0.08)),
    ],
)
def test_limbs_are_rods(primitive, ends, radii):
    found, widths, edges = _drawn(primitive)
    assert found == pytest.approx(np.array(ends, dtype=float)) and widths == pytest.approx(radii) and edges == []


@pytest.mark.parametrize(
    "primitive",
    [Box((0.2, 0.4, 0.6)), Mesh(np.array([[-0.1, -0.2, -0.3], [0.1, -0.2, 0.3], [0.1, 0.2, 0.3]]), np.array([[0, 1, 2]]))],
)
def test_things_are_the_twelve_edges_of_a_box(primitive):
    corners, radii, edges = _drawn(primitive)
    assert radii == () and len(edges) == 12 and np.abs(corners).max(axis=0) == pytest.approx([0.1, 0.2, 0.3])
    assert sorted(np.linalg.norm(corners[a] - corners[b]) for a, b in edges) == pytest.approx([0.2] * 4 + [0.4] * 4 + [0.6] * 4)


def test_sets_are_those_nearest_in_time():
    times = np.array([0.0, 0.1, 0.2, 0.4])
    assert _nearest(times, np.array([-0.04, 0.04, 0.06, 0.3, 0.41, 0.6]), 0.1).tolist() == [0, 0, 1, -1, 3, -1]


def test_what_the_view_shows_is_what_kinematics_says(made):
    found = made()
    direct = Configuration(found.model, motion(N).states[7]).Ts_world_shape
    mine = found.run.configuration(found.model, 7).Ts_world_shape
    assert mine == pytest.approx(direct, abs=1e-6)
