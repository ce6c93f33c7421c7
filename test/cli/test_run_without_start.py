"""Everything that a user does with a run that looked for the body itself: its first image sets have no state."""

import json
from pathlib import Path

import numpy as np
import pytest

from helpers.cameras.small_clip import Clip, make_clip
from helpers.sources.tables import read_numbers
from tracker_node.cli.main import main
from tracker_node.loaders.bag.images import image_of
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.motion.trajectory_file import (
    StateRow,
    StateTrajectory,
    Trajectories,
    read_joints,
    read_states,
    write_joints,
    write_states,
)
from tracker_node.loaders.motion.trc import load_table, load_trc
from tracker_node.model.configuration import Configuration
from tracker_node.runs.load import load_run
from tracker_node.studio.playback.page import AskedCurve, AskedRow, PlaybackPage
from tracker_node.studio.session import StudioFiles, open_session

N, N_WITHOUT = 10, 2
CONFIG = """/**:
  ros__parameters:
    threads: 2
    initialization: {watch_sets: 3, hypotheses: 6, candidates: 1, repaired_candidates: 0, tracked_candidates: 1, size_px: 56}
"""
NO_STATE = [True] * N_WITHOUT + [False] * (N - N_WITHOUT)


@pytest.fixture(scope="module")
def clip(tmp_path_factory) -> Clip:
    """A clip without images of the background, tracked into ``run`` without an initial state, and truth for it."""
    clip = make_clip(tmp_path_factory.mktemp("clip"), N, with_backgrounds=False)
    clip.config_file.write_text(CONFIG)
    assert main(["track", *files(clip), "--output", str(clip.folder / "run"), "--smooth", "--masks", "--quiet"]) == 0
    stamps_ns, names = load_run(clip.folder / "run").stamps_ns, clip.model.landmark_names
    positions = np.array([Configuration(clip.model, state).landmarks_world for state in clip.states])
    write_joints(clip.folder / "truth.csv", Trajectories(names, stamps_ns, positions, np.ones(positions.shape[:2], bool)))
    rows = [StateRow(int(stamp), "TRACKING", "", s.to_values()) for stamp, s in zip(stamps_ns, clip.states, strict=True)]
    write_states(clip.folder / "true_states.csv", StateTrajectory(clip.model.chain.dof_names, tuple(rows)))
    return clip


def files(clip: Clip) -> list[str]:
    return ["--rig", str(clip.rig_file), "--model", str(clip.model_file), "--config", str(clip.config_file)]


def test_the_run_says_which_sets_have_no_state(clip):
    folder = clip.folder / "run"
    for part in (folder, folder / "smoothed"):
        states = read_states(part / "states.csv")
        assert states.status[:N_WITHOUT] == ("INITIALIZING",) * N_WITHOUT
        assert np.isnan(states.values).all(axis=1).tolist() == NO_STATE
        with_state = states.stamps_ns[N_WITHOUT:].tolist()
        assert read_joints(part / "joints.csv").stamps_ns.tolist() == with_state
        assert read_numbers(part / "poses.csv")[0].tolist() == with_state
    with BagReader(folder / "bag") as reader:
        messages = [message for message in reader.messages() if message.topic == "/tracker/cam01/mask"]
        masks = [image_of(reader, message, "cam01").pixels for message in messages]
    assert [not mask.any() for mask in masks] == NO_STATE


@pytest.mark.parametrize("part", ["", "bag", "smoothed"])
def test_it_is_loaded_with_nothing_where_nothing_is_known(clip, part):
    run = load_run(clip.folder / "run" / part)
    assert (~run.has_state).tolist() == NO_STATE and run.tracked.tolist() == run.has_state.tolist()
    assert np.isnan(run.residual).tolist() == NO_STATE
    assert run.details is not None and not run.details.covariances[:N_WITHOUT].any()
    assert run.details.covariances[N_WITHOUT:].any(axis=(1, 2)).all()
    with pytest.raises(ValueError, match="a state, got 0, INITIALIZING"):
        run.configuration(clip.model, 0)


def _no_pdf(part: str) -> list[str]:
    return ["--no-pdf"] if part else []


@pytest.mark.parametrize("part", ["", "bag", "smoothed"])
def test_evaluated_they_count_as_lost(clip, tmp_path, part, recwarn):
    truths = ["--truth", str(clip.folder / "truth.csv"), "--truth", str(clip.folder / "true_states.csv")]
    options = ["--model", str(clip.model_file), "--output", str(tmp_path), "--csv", "--lag", "0", *_no_pdf(part)]
    assert main(["evaluate", str(clip.folder / "run" / part), *truths, *options]) == 0
    figures = json.loads((tmp_path / "report.json").read_text())["metrics"]
    assert [figures[f"run.{key}"] for key in ("image_sets", "judged_sets", "lost_sets", "sets_without_state")] == [
        N, N - N_WITHOUT, N_WITHOUT, N_WITHOUT
    ]  # fmt: skip
    assert figures["run.mpjpe_mm"] < 10.0 and figures["run.segment_position_mm"] < 10.0
    assert figures["run.losses"] == 1 and figures["run.not_reacquired"] == 0
    assert 0.0 < figures["run.residual_px"] < 2.0 and figures["run.said_lost_sets"] == 0
    page = (tmp_path / "report.html").read_text()
    assert "Without a state" in page and ("initializing" in page)
    assert (tmp_path / "report.pdf").exists() == (not part)
    assert not [str(w.message) for w in recwarn if issubclass(w.category, RuntimeWarning)]


def test_its_states_serve_as_truth(clip, tmp_path):
    run = clip.folder / "run"
    arguments = ["--truth", str(run / "states.csv"), "--output", str(tmp_path), "--no-pdf", "--pictures", "0", "--lag", "0"]
    assert main(["evaluate", str(run), *arguments]) == 0
    figures = json.loads((tmp_path / "report.json").read_text())["metrics"]
    assert figures["run.judged_sets"] == N - N_WITHOUT and figures["run.mpjpe_mm"] < 1e-6


def exported(clip: Clip, path: Path, *options: str, part: str = "") -> Path:
    run, to = clip.folder / "run" / part, path.suffix.removeprefix(".")
    assert main(["export", str(run), "--to", to, "-o", str(path), "--model", str(clip.model_file), *options]) == 0
    return path


@pytest.mark.parametrize("part", ["", "smoothed"])
def test_exports_leave_gaps(clip, tmp_path, part, capsys):
    markers = load_trc(exported(clip, tmp_path / "x.trc", part=part))
    assert len(markers.times_s) == N and (~markers.valid).all(axis=1).tolist() == NO_STATE
    for to in ("mot", "sto"):
        assert len(load_table(exported(clip, tmp_path / f"x.{to}", part=part)).times_s) == N - N_WITHOUT
    poses = exported(clip, tmp_path / "x.tum", part=part).read_text().splitlines()
    assert len([line for line in poses if not line.startswith("#")]) == N - N_WITHOUT
    table = exported(clip, tmp_path / "x.csv", "--lost", "keep", part=part) / "coordinates.csv"
    cells = [line.split(",")[2:] for line in table.read_text().splitlines()[1:]]
    assert [not any(row) for row in cells] == NO_STATE
    exported(clip, tmp_path / "x.c3d", part=part)
    capsys.readouterr()
    exported(clip, tmp_path / "x.bvh", part=part)
    assert f"{N_WITHOUT} frames are interpolated" in capsys.readouterr().err


@pytest.mark.parametrize("what", ["body", "refine"])
def test_cameras_and_bodies_are_fitted_to_it(clip, tmp_path, what):
    base = ["calibrate", what, "--from-run", str(clip.folder / "run"), "--sets", "9", "--quiet"]
    limits = ["--only", "girth"] if what == "body" else ["--keep-places"]
    assert main([*base, *limits, "-o", str(tmp_path / "found.yaml")]) == 0
    assert (tmp_path / "found.html").exists()


def test_the_very_sets_are_tracked_again(clip, tmp_path):
    again = ["--from-run-bag", str(clip.folder / "run" / "bag"), "--output", str(tmp_path / "again"), "--quiet"]
    assert main(["track", *files(clip), *again]) == 0
    assert (tmp_path / "again" / "states.csv").read_bytes() == (clip.folder / "run" / "states.csv").read_bytes()


def test_it_is_played_without_a_body_where_there_is_none(clip):
    desk = PlaybackPage(open_session(StudioFiles(rig=clip.rig_file, model=clip.model_file, run=clip.folder / "run")))
    run = desk.run()
    assert run["problem"] == "" and [value is None for value in run["residual"]] == NO_STATE
    bodies = [desk.drawn(AskedRow(row=row))["cameras"]["cam01"]["parts"] for row in range(N)]
    assert [not parts for parts in bodies] == NO_STATE
    curve = desk.curve(AskedCurve(name="root_rz"))["values"]
    assert [value is None for value in curve] == NO_STATE
    assert desk.images() is not None


def test_a_run_that_never_found_the_body(clip, tmp_path, capsys):
    run = tmp_path / "run"
    main(["track", *files(clip), "--output", str(run), "--max-sets", "2", "--smooth", "--quiet"])
    truth = ["--truth", str(clip.folder / "truth.csv"), "--truth", str(clip.folder / "true_states.csv")]
    assert main(["evaluate", str(run), *truth, "--no-pdf"]) == 0
    figures = json.loads((run / "report.json").read_text())["metrics"]
    assert (figures["run.lost_sets"], figures["run.sets_without_state"], figures["run.mpjpe_mm"]) == (2, 2, None)
    capsys.readouterr()
    assert main(["export", str(run), "--to", "trc", "-o", str(tmp_path / "x.trc")]) == 2
    assert "not LOST, got '2 INITIALIZING'" in capsys.readouterr().err
    assert main(["calibrate", "body", "--from-run", str(run), "-o", str(tmp_path / "x.yaml"), "--quiet"]) == 2
    assert "got '2 INITIALIZING'" in capsys.readouterr().err
