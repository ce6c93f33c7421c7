"""The benchmarks of contours without plates, each at a tiny size: figure, persons, long run, core, live."""

import importlib
from dataclasses import replace

import numpy as np
import pytest

from benchmark import core
from benchmark.contour import _fitted_body
from benchmark.contour import _runs as _contour_runs
from benchmark.contour import figure as contour_figure
from benchmark.contour import mannequins as contour_mannequin
from benchmark.ros import live
from tracker_node.errors import FileFormatError
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.motion.trajectory_file import read_joints
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import ImageSet
from tracker_node.synthesis.recording import Request, produce
from tracker_node.synthesis.scenes.scene import SceneConfig
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import CameraReport, Status, Timings, TrackEstimate

SCENE = SceneConfig(
    n_cameras=4, width=256, height=192, focal_px=224.0, radius=3.2, distortion=(), noise_levels=4.0, shadow=False,
    surroundings="clutter", backgrounds=False, lossless=True,
)  # fmt: skip
N_IMAGES = 6


@pytest.fixture(scope="module")
def figure(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figure")
    produce(Request(subject="figure", n_images=N_IMAGES, scene=SCENE), folder)
    return folder


@pytest.fixture(scope="module")
def person(tmp_path_factory):
    folder = tmp_path_factory.mktemp("person")
    produce(Request(motion="swing", n_images=2, scene=replace(SCENE, n_cameras=2)), folder)
    return folder


def estimate(stamp_ns: int, state: State) -> TrackEstimate:
    n = 6 + len(state.joint_positions)
    reports, timings = (CameraReport("cam01", stamp_ns, 1.0, 7),), Timings(1.0, 2.0, 3.0)
    return TrackEstimate(
        stamp_ns, Status.TRACKING, "", state, np.zeros(n), np.eye(n), 0.0, 1.0, reports, 4, 5, timings
    )  # fmt: skip


def test_a_run_on_truth_has_no_error_and_one_beside_it_has_that(figure):
    runs, program = _contour_runs, contour_figure
    clip = runs.Clip.load(figure)
    truth = program.true_states(clip)
    shift = np.zeros(clip.model.n_dof)
    for shift[1], lost in ((0.0, 0), (0.05, 0), (0.3, N_IMAGES)):
        run = runs.Run(tuple(estimate(round(i * 1e9 / 30), s.retract(shift)) for i, s in enumerate(truth)), np.ones(N_IMAGES))
        figures = runs.accuracy_figures(runs.judged(clip, run, "x"))
        assert figures["x.joint_error_mm"] == pytest.approx(1e3 * shift[1], abs=1e-6)
        assert figures["x.joint_error_max_mm"] == pytest.approx(1e3 * shift[1], abs=1e-6)
        assert figures["x.lost_sets"] == lost and figures["x.lost_limbs"] == (4 if lost else 0)


def test_lost_limbs_are_named_with_their_image_sets(figure, capsys):
    runs, program = _contour_runs, contour_figure
    clip = runs.Clip.load(figure)
    bent = np.zeros(clip.model.n_dof)
    bent[clip.model.chain.dof_names.index("left_elbow_flexion")] = -1.0  # takes the wrist 0.26 m away
    states = [s.retract(bent * (i in (1, 2, 4))) for i, s in enumerate(program.true_states(clip))]
    run = runs.Run(tuple(estimate(round(i * 1e9 / 30), s) for i, s in enumerate(states)), np.ones(N_IMAGES))
    runs.report_lost(runs.judged(clip, run, "x"))
    assert capsys.readouterr().err == "x: left arm more than 150 mm off in sets 1-2, 4-4\n"


def test_strides_and_cameras_are_those_asked_for(figure):
    clip = _contour_runs.Clip.load(figure)
    sets = list(clip.with_cameras([0, 2]).sets(stride=2))
    assert [one.stamp_ns for one in sets] == [round(i * 1e9 / 30) for i in (0, 2, 4)]
    assert sets[0].cameras == ("cam01", "cam03")
    whole = list(clip.sets())
    np.testing.assert_array_equal(sets[1].get("cam03").pixels, whole[2].get("cam03").pixels)
    assert len(list(clip.sets(stride=2, limit=2))) == 2


@pytest.mark.long
def test_figure_tracks_and_judges(figure):
    program = contour_figure
    clip = _contour_runs.Clip.load(figure)
    figures = program.sequence_figures(clip, "stride2", ["modalities=region", "threads=1"], None)
    assert figures["figure_stride2.sets"] == 3 and np.isfinite(figures["figure_stride2.joint_error_mm"])
    figures = program.sequence_figures(clip, "figure", ["modalities=region", "threads=1"], None)
    assert figures["figure.sets"] == N_IMAGES and figures["figure.threads"] == 1
    assert 0.0 < figures["figure.joint_error_mm"] < 20.0
    assert figures["figure.set_ms_p5"] <= figures["figure.set_ms"] <= figures["figure.set_ms_p95"]
    assert figures["figure.set_in_references"] == pytest.approx(figures["figure.set_ms"] / figures["figure.reference_ms"])
    assert figures["figure.motion_mm_per_image"] < 43.0


def test_basin_starts_are_off_by_what_is_said(figure):
    program = contour_figure
    clip = _contour_runs.Clip.load(figure)
    pose = program.true_states(clip)[0]
    start = program.displaced(pose, np.radians(6.0), 0.02, np.random.default_rng(1))
    off = start.difference(pose)
    assert np.linalg.norm(off[:3]) == pytest.approx(0.02) and np.linalg.norm(off[3:6]) == pytest.approx(np.radians(6.0))
    np.testing.assert_allclose(np.abs(off[6:]), np.radians(6.0))
    assert 0 < (off[6:] > 0).sum() < 16


@pytest.mark.long
def test_basin_counts_trials_that_arrive(figure, monkeypatch):
    program, runs = contour_figure, _contour_runs
    clip = runs.Clip.load(figure)
    truth = program.true_states(clip)
    seen: list[ImageSet] = []
    arrived = iter([truth[0], truth[N_IMAGES // 2].retract(np.eye(clip.model.n_dof)[2] * 0.021)])

    def fake(clip, config, sets):
        seen.extend(sets)
        return runs.Run((estimate(0, next(arrived)),), np.ones(1))

    monkeypatch.setattr(program, "track", fake)
    figures = program.basin_figures(clip, SCENE, "6deg_20mm", TrackerConfig(), trials=2, n_sets=2)
    assert figures["figure_basin.6deg_20mm"] == 0.5 and figures["figure_basin.6deg_20mm_trials"] == 2
    first, second = (one.get("cam01").pixels.astype(int) for one in seen[:2])
    assert 3.0 < (first - second).std() < 8.0  # the same still pose under another noise: sqrt(2) times its sigma


def test_parameters_of_the_command_line():
    configured = _contour_runs.configured
    config = configured(["modalities=chamfer", "chamfer.tolerance=0.5"], threads=1, synchronizer__image_period_s=0.1)
    assert (config.modalities, config.chamfer.tolerance, config.threads) == (("chamfer",), 0.5, 1)
    assert config.synchronizer.image_period_s == 0.1
    with pytest.raises(FileFormatError, match="KEY=VALUE"):
        configured(["threads"])
    with pytest.raises(FileFormatError, match="chamfer"):
        configured(["chamfer.kinds=region"])


@pytest.mark.long
def test_a_person_is_tracked_with_another_body(person):
    program, runs, body = contour_mannequin, _contour_runs, _fitted_body
    clip = runs.Clip.load(person)
    dump_model(human_model(), person / "fitted.yaml")
    other = body.fitted_body(clip, TrackerConfig())  # the one that lies there
    assert other.name == "human" and other.shapes[0].primitive != clip.model.shapes[0].primitive
    clip = body.with_body(clip, other)
    points = dict(zip(other.landmark_names, Configuration(other, clip.start).landmarks_world, strict=True))
    truth = read_joints(person / "truth.csv")
    off = [np.linalg.norm(points[n] - p) for n, p in zip(truth.names, truth.positions_m[0], strict=True) if n in points]
    assert len(off) == 14 and np.mean(off) < 0.05
    run = runs.track(clip, runs.configured(["modalities=region"]), clip.sets())
    figures = program.person_figures(runs.judged(clip, run, "mannequin_x"))
    assert figures["mannequin_x.sets"] == 2
    assert figures["mannequin_x.mpjpe_mm"] <= figures["mannequin_x.mpjpe_raw_mm"]


@pytest.mark.parametrize("name", ["mannequins", "long_run"])
def test_without_the_clips_it_says_so(name, monkeypatch, capsys):
    program = importlib.import_module(f"benchmark.contour.{name}")
    monkeypatch.setattr(program, "default_motions", lambda: None)
    assert program.main(["--quick"]) == 2
    assert "--motions or TRACKER_SHARED_DATA" in capsys.readouterr().err


@pytest.mark.long
def test_core_times_image_sets_after_the_first_ones(figure):
    program = core
    config = program.configuration(1, ["modalities=region"])
    times, stages, counts = program.measure(figure, config, rounds=2)
    assert times.shape == (2 * (N_IMAGES - program.WARM_UP), 2) and times.max() > stages[1] > 0.0
    assert (times[:, 1] < times[:, 0]).all()  # what is learned does not hold the state up
    assert counts[0] > 0 and counts[1] > 100
    figures = program.timing_figures("roi_", "_one_thread", times, stages, counts, 2.0)
    assert figures["core.roi_set_in_references_p50_one_thread"] == pytest.approx(np.median(times[:, 0]) / 2.0)
    assert figures["core.roi_latency_ms_p50_one_thread"] == pytest.approx(np.median(times[:, 1]))
    assert program.full_images(config).chamfer.reach_px > 640


def test_live_figures_compare_what_was_sent_with_what_came():
    sent = [i * 10**8 for i in range(11)]
    states = [(s, s + (5 + i) * 10**6, int(Status.TRACKING)) for i, s in enumerate(sent) if i not in (3, 4)]
    states[-1] = (*states[-1][:2], int(Status.LOST))
    figures = live.live_figures(sent, [(-5, 0, 0), *states])
    assert figures["live.lost"] == 2 and figures["live.sets"] == 11 and figures["live.not_tracking"] == 1
    assert figures["live.rate_hz"] == pytest.approx(10.0)
    assert figures["live.latency_ms_max"] == pytest.approx(15.0) and figures["live.latency_ms_p50"] == pytest.approx(11.0)
    assert live.live_figures(sent, [])["live.lost"] == 11


def test_live_images_go_forward_and_backward(figure, tmp_path):
    clip = _contour_runs.Clip.load(figure)
    rig = load_rig(live.there_and_back(clip, tmp_path))
    shown = [path.resolve().stem for path in sorted((tmp_path / "cam02").iterdir())]
    assert shown == [f"{i:06d}" for i in (0, 1, 2, 3, 4, 5, 4, 3, 2, 1)]
    assert rig["cam02"].source == str(tmp_path / "cam02")


@pytest.mark.long
def test_live_graph(figure, monkeypatch):
    """States come for images that are sent; how many in time is the machine's business here."""
    pytest.importorskip("rclpy")
    program = live
    monkeypatch.setattr(program, "SETTLE_S", 0.2)
    clip = _contour_runs.Clip.load(figure)
    figures = program.measure(clip, _contour_runs.configured([]), 2.0)
    assert 40 <= figures["live.sets"] <= 61 and figures["live.lost"] < figures["live.sets"]
    assert figures["live.rate_hz"] == pytest.approx(30.0, rel=0.2)
    assert 0.0 < figures["live.latency_ms_p50"] <= figures["live.latency_ms_p95"] <= figures["live.latency_ms_max"]
