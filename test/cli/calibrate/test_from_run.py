"""``calibrate body --from-run`` and ``calibrate refine --from-run`` on the run of a small clip, as a user runs them."""

import json
import os
from argparse import Namespace
from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.small_clip import RATE_HZ, make_clip
from tracker_node.cli.arguments.run_images import load_run_images
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError
from tracker_node.loaders.bag.message_types import message_of
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.model.model_yaml import dump_model, load_model
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.shape_parameters import ShapeSpace
from tracker_node.runs.images import chosen_rows, velocity_at
from tracker_node.runs.load import load_run
from tracker_node.runs.messages import IMAGE, image
from tracker_node.studio.playback.page import open_run
from tracker_node.studio.session import StudioFiles, open_session
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A clip tracked with a body whose upper arm is a fifth too thick; the folder holds ``run``."""
    clip = make_clip(tmp_path_factory.mktemp("clip"), 8)
    space = ShapeSpace(clip.model, groups=("girth",))
    thick = space.body(np.array([0.2 if name == "girth upper" else 0.0 for name in space.names]))
    dump_model(thick, clip.model_file)
    assert main(["track", *clip.arguments(), "--output", str(clip.folder / "run"), "--quiet"]) == 0
    return clip


def calibrate(what, clip, *arguments):
    base = ["calibrate", what, "--from-run", str(clip.folder / "run"), "--sets", "4", "--quiet"]
    return main([*base, *map(str, arguments)])


def test_a_girth_is_found_and_nothing_is_overwritten(run, tmp_path, capsys):
    output = tmp_path / "body.yaml"
    assert calibrate("body", run, "-o", output, "--only", "girth") == 0
    fitted, wrong = load_model(output), load_model(run.model_file)
    radii = [next(s.primitive.a for s in model.shapes if s.name == "upper") for model in (run.model, fitted, wrong)]
    assert abs(radii[1] / radii[0] - 1.0) < 0.12 < 0.2 < radii[2] / radii[0] - 1.0  # of 160x120 pixels
    metrics = json.loads((tmp_path / "body.json").read_text())["metrics"]
    assert metrics["body.rms_after_px"] < metrics["body.rms_before_px"]
    assert metrics["body.girth_upper"] == pytest.approx(np.log(radii[1] / radii[2]), abs=1e-6)
    page = (tmp_path / "body.html").read_text()
    assert page.count("data:image/png") == 6 and "girth upper" in page  # two time steps, three cameras
    assert "girth upper" in capsys.readouterr().out
    assert calibrate("body", run, "-o", output) == 2
    assert "is there already" in capsys.readouterr().err


def test_a_rig_that_is_right_stays(run, tmp_path, capsys):
    output = tmp_path / "rig.yaml"
    assert calibrate("refine", run, "-o", output, "--keep-places", "--model", run.model_file) == 0
    given, found = load_rig(run.rig_file), load_rig(output)
    for a, b in zip(given, found, strict=True):
        assert np.allclose(a.T_world_cam, b.T_world_cam, atol=1e-9)
        assert abs(a.time_offset_ns - b.time_offset_ns) < 0.25e9 / RATE_HZ
        assert (a.source, a.background) == (b.source, b.background)
    assert "cam03" in capsys.readouterr().out
    assert "later, ms" in (tmp_path / "rig.html").read_text()


@pytest.mark.parametrize(
    ("what", "arguments", "message"),
    [
        ("body", ["--trc", "trial.trc"], "no --trc"),
        ("refine", ["--points2d", "pose"], "no --points2d"),
        ("refine", ["--keep-places", "--keep-times"], "something that may change"),
        ("refine", ["--center-sigma-mm", "-1"], "positive number"),
        ("refine", ["--drift", "--keep-times"], "no --keep-times"),
        ("refine", ["--drift"], "drift needs a run of 15 s"),
    ],
)
def test_options_that_contradict_each_other(run, tmp_path, capsys, what, arguments, message):
    assert calibrate(what, run, "-o", tmp_path / "out.yaml", *arguments) == 2
    assert message in capsys.readouterr().err


def test_a_folder_without_a_run(tmp_path, capsys):
    assert main(["calibrate", "body", "--from-run", str(tmp_path), "-o", str(tmp_path / "x.yaml")]) == 2
    assert "states.csv" in capsys.readouterr().err
    assert main(["calibrate", "refine", "-o", str(tmp_path / "x.yaml")]) == 2
    assert "--rig" in capsys.readouterr().err


def test_sets_are_spread_and_lost_ones_left_out(run):
    data = load_run(run.folder / "run")
    chosen = chosen_rows(data, 4)
    assert len(chosen) == 4 and chosen == sorted(chosen) and chosen[0] <= 1 and chosen[-1] >= 6
    half_lost = np.where(np.arange(len(data)) < 4, int(Status.LOST), int(Status.TRACKING))
    assert min(chosen_rows(replace(data, status=half_lost), 4)) >= 4
    with pytest.raises(FileFormatError, match="8 LOST"):
        chosen_rows(replace(data, status=np.full(len(data), int(Status.LOST))), 4)
    speed = velocity_at(data, 4)
    tangent = data.configuration(run.model, 5).state.difference(data.configuration(run.model, 3).state)
    assert np.allclose(speed, 0.5 * RATE_HZ * tangent, atol=1e-4)
    assert np.allclose(velocity_at(replace(data, stamps_ns=np.zeros(len(data), dtype=np.int64)), 4), 0.0)


@pytest.fixture(scope="module")
def taken_otherwise(tmp_path_factory):
    """A clip and a run of it with images, cameras and sources that are not the rig's."""
    clip = make_clip(tmp_path_factory.mktemp("otherwise"), 8)
    clip.config_file.write_text("/**:\n  ros__parameters:\n    threads: 1\n")
    (clip.folder / "elsewhere").mkdir()
    (clip.folder / "cam01").rename(clip.folder / "elsewhere" / "first")
    home = os.getcwd()
    os.chdir(clip.folder / "elsewhere")
    try:
        options = ["--resize", "120x90", "--source", "cam01=first", "--cameras", "cam01", "cam02", "--start", "1"]
        run = ["track", *clip.arguments(), *options, "--output", str(clip.folder / "run"), "--quiet"]
        assert main([*run, "--base-stamp-ns", "7000000000"]) == 0
    finally:
        os.chdir(home)
    return clip


@pytest.mark.parametrize("what", ["body", "refine"])
def test_images_are_taken_again_as_the_run_took_them(taken_otherwise, tmp_path, what):
    limits = ["--only", "girth"] if what == "body" else ["--keep-places"]
    assert calibrate(what, taken_otherwise, "-o", tmp_path / "found.yaml", *limits) == 0
    assert (tmp_path / "found.html").read_text().count("data:image/png") == 4  # two time steps, two cameras


def test_the_images_of_a_run_have_its_size_its_cameras_and_its_parameters(taken_otherwise):
    images = load_run_images(arguments_of(taken_otherwise))
    assert images.rig.names == ("cam01", "cam02")
    assert [(c.model.width, c.model.height) for c in images.rig] == [(120, 90)] * 2
    assert [i.pixels.shape[:2] for s in images.sets for i in s.images] == [(90, 120)] * 8
    assert all(plate.shape[:2] == (90, 120) for plate in images.backgrounds.values())
    assert images.config.threads == 1 != TrackerConfig().threads  # of the clip's config.yaml


def arguments_of(clip):
    return Namespace(from_run=str(clip.folder / "run"), sets=4, rig=None, model=None, config=None)


def test_it_is_tracked_again_evaluated_and_played(taken_otherwise, tmp_path):
    run = taken_otherwise.folder / "run"
    again = ["track", *taken_otherwise.arguments(), "--from-run-bag", str(run / "bag"), "--quiet"]
    assert main([*again, "--output", str(tmp_path / "again")]) == 0
    assert (tmp_path / "again" / "states.csv").read_bytes() == (run / "states.csv").read_bytes()
    assert main(["evaluate", str(run), "--no-pdf", "--output", str(tmp_path), "--pictures", "2"]) == 0
    page = (tmp_path / "report.html").read_text()
    assert "left out" not in page and all(f"{name}, image" in page for name in ("cam01", "cam02")) and "cam03, image" not in page
    files = StudioFiles(rig=taken_otherwise.rig_file, model=taken_otherwise.model_file, run=run)
    played = open_run(open_session(files))
    assert played.problem == "" and [dict(n) for n in played.numbers] == [{"cam01": i, "cam02": i} for i in range(1, 8)]


def test_a_run_of_a_bag_takes_its_images_from_that_bag(run, tmp_path):
    recorded = tmp_path / "recorded"
    with BagWriter(recorded) as writer:
        for i in range(8):
            for camera in run.rig:
                pixels = cv2.imread(str(run.folder / camera.name / f"{i:04d}.png"))
                stamp_ns = 10**9 + round(i * 1e9 / RATE_HZ)
                message = message_of(IMAGE, image(stamp_ns, camera.frame_id, pixels))
                writer.write_message(f"/{camera.name}/image_raw", stamp_ns, message)
    arguments = ["track", *run.arguments(), "--bag", str(recorded), "--output", str(tmp_path / "run"), "--quiet"]
    assert main(arguments) == 0
    images = load_run_images(Namespace(from_run=str(tmp_path / "run"), sets=4, rig=None, model=None, config=None))
    assert len(images.sets) == 4 and images.sets[0].stamp_ns >= 10**9
    assert main(["evaluate", str(tmp_path / "run"), "--no-pdf", "--pictures", "2"]) == 0
    assert "cam02, image" in (tmp_path / "run" / "report.html").read_text()
