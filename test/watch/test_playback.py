"""Files of Rerun, read back by Rerun's reader, have the numbers of the runs that they are of."""

import json
import shutil
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

pytest.importorskip("rerun", reason="the extra rerun is not installed")

from helpers.cameras import small_clip, two_people
from helpers.rerun_file import RerunFile
from tracker_node.cli.main import main
from tracker_node.geometry import so3
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.motion.trajectory_file import read_joints, read_states
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import Configuration, State
from tracker_node.render.overlay import part_outlines
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.runs.load import TOPIC, load_run
from tracker_node.runs.writer import SUMMARY
from tracker_node.watch.playback import _bodies_in
from tracker_node.watch.view import HIDDEN, SIGMAS

F32 = {"rtol": 1e-6, "atol": 1e-6}  # positions are float32 in Rerun


@pytest.fixture(scope="module")
def clip(tmp_path_factory) -> Path:
    """The folder of a small clip with a run of it."""
    folder = small_clip.make_clip(tmp_path_factory.mktemp("played"), 5).folder
    files = ("--rig", folder / "rig.yaml", "--model", folder / "model.yaml", "--initial-state", folder / "start.yaml")
    assert main([*map(str, ("track", *files, "--output", folder / "run", "--smooth", 1.0)), "--quiet"]) == 0
    return folder


def played(*arguments: object) -> RerunFile:
    *_, output = arguments
    assert main(["rerun", *map(str, arguments[:-1]), "--output", str(output)]) == 0
    return RerunFile(output)


@pytest.fixture(scope="module")
def file(clip, tmp_path_factory) -> RerunFile:
    return played(clip / "run", tmp_path_factory.mktemp("rrd") / "run.rrd")


def test_poses_are_those_of_the_run(clip, file):
    model, states = load_model(clip / "model.yaml"), read_states(clip / "run/states.csv")
    for k, link in enumerate(model.chain.links):
        entity = f"/world/bodies/body/{link}"
        stamps, _ = file.over_time(entity, "Transform3D:translation")
        np.testing.assert_array_equal(stamps, states.stamps_ns)
        Ts = np.array([Configuration(model, State.from_values(values)).Ts_world_link[k] for values in states.values])
        np.testing.assert_allclose(file.array(entity, "Transform3D:translation"), Ts[:, :3, 3], **F32)
        turns = np.array([so3.matrix_from_xyzw(q) for q in file.array(entity, "Transform3D:quaternion")])
        np.testing.assert_allclose(turns, Ts[:, :3, :3], **F32)
        np.testing.assert_array_equal(file.array(entity, "Transform3D:scale"), 1.0)


def test_curves_are_columns_of_the_states(clip, file):
    states = read_states(clip / "run/states.csv")
    assert file.static("/angles/body", "SeriesLines:names") == list(states.dof_names[6:])
    angles = np.array(file.over_time("/angles/body", "Scalars:scalars")[1])
    np.testing.assert_allclose(angles, np.degrees(states.values[:, 6:]), rtol=1e-12)
    np.testing.assert_array_equal(np.array(file.over_time("/positions/body", "Scalars:scalars")[1]), states.values[:, :3])
    np.testing.assert_array_equal(file.array("/residual/body", "Scalars:scalars"), [row.residual for row in states.rows])
    assert file.array("/status/body", "StateChange:state").tolist() == [row.status for row in states.rows]
    said = file.array("/said/body", "TextDocument:text")
    for text, row in zip(said, states.rows, strict=True):
        assert row.status in text and f"residual {row.residual:.2f} px" in text


def test_ellipsoids_are_the_covariances_of_landmarks(clip, file):
    run, model, joints = load_run(clip / "run"), load_model(clip / "model.yaml"), read_joints(clip / "run/joints.csv")
    entity = "/world/bodies/body/uncertainty"
    centers, axes, turns = (
        np.array(file.over_time(entity, f"Ellipsoids3D:{name}")[1]) for name in ("centers", "half_sizes", "quaternions")
    )
    np.testing.assert_allclose(centers, joints.positions_m, **F32)
    for i in range(len(run)):
        J = run.configuration(model, i).landmark_jacobian()
        covariances = J @ run.details.covariances[i] @ np.swapaxes(J, 1, 2)
        for k, covariance in enumerate(covariances):
            R = so3.matrix_from_xyzw(turns[i, k])
            np.testing.assert_allclose(R * (axes[i, k] / SIGMAS) ** 2 @ R.T, covariance, rtol=1e-3, atol=1e-9)


def test_images_have_the_outlines_of_their_states(clip, file):
    run, model = load_run(clip / "run"), load_model(clip / "model.yaml")
    for camera in load_rig(clip / "rig.yaml"):
        place = f"/world/cameras/{camera.name}"
        stamps, blobs = file.over_time(f"{place}/image", "EncodedImage:blob")
        np.testing.assert_array_equal(stamps, run.stamps_ns)
        for i, (blob,) in enumerate(blobs):
            shown = cv2.imdecode(np.array(blob, np.uint8), cv2.IMREAD_COLOR)
            taken = cv2.imread(str(clip / camera.name / f"{i:04d}.png"))
            assert shown.shape == taken.shape and np.abs(shown.astype(int) - taken).mean() < 6.0
        K = np.array(file.static(place, "Pinhole:image_from_camera")).reshape(3, 3).T
        np.testing.assert_allclose(K[:2, 2], camera.model.K[:2, 2] + 0.5, **F32)
        np.testing.assert_allclose(file.static(place, "Transform3D:translation")[0], camera.center, **F32)
        _, outlines = file.over_time(f"{place}/body", "LineStrips2D:strips")
        for i, strips in enumerate(outlines):
            filled = np.zeros((camera.model.height, camera.model.width), np.uint8)
            for strip in strips:
                cv2.fillPoly(filled, [np.round(np.array(strip) - 0.5).astype(np.int32)], 255)
            mask = render_mask(run.configuration(model, i), camera)
            assert (filled & mask).sum() / (filled | mask).sum() > 0.97


def test_outlines_of_parts_are_around_their_labels(clip):
    run, model, (camera, *_) = load_run(clip / "run"), load_model(clip / "model.yaml"), load_rig(clip / "rig.yaml")
    assert {part for part, _ in part_outlines(run.configuration(model, 0), camera)} == {0, 1, 2}


def test_the_blueprint_shows_what_there_is(file):
    assert file.application == "tracker_node"
    assert file.views == {
        "world": "3D", "world/cameras/cam01": "2D", "world/cameras/cam02": "2D", "world/cameras/cam03": "2D",
        "angles/body": "TimeSeries", "residual": "TimeSeries", "status": "StateTimeline", "said/body": "TextDocument",
    }  # fmt: skip
    assert all(any(entity.startswith(f"/{place}") for entity in file.entities) for place in file.views)


def test_a_set_without_a_state_hides_the_body(clip, tmp_path):
    shutil.copytree(clip / "run", tmp_path / "run")
    shutil.rmtree(tmp_path / "run/bag")
    lines = (tmp_path / "run/states.csv").read_text().splitlines()
    cells = lines[1].split(",")
    lines[1] = ",".join([cells[0], "INITIALIZING", "waiting", *[""] * (len(cells) - 7), *cells[-4:]])
    lines[3] = lines[3].replace("TRACKING", "LOST")
    (tmp_path / "run/states.csv").write_text("\n".join(lines) + "\n")
    file = played(tmp_path / "run", "--no-images", tmp_path / "run.rrd")
    scales = file.array("/world/bodies/body/trunk", "Transform3D:scale")
    np.testing.assert_array_equal(scales, np.repeat([[HIDDEN], [1], [1], [1], [1]], 3, axis=1).astype(np.float32))
    stamps, tints = file.over_time("/world/bodies/body/trunk", "Mesh3D:albedo_factor")
    states = read_states(tmp_path / "run/states.csv").stamps_ns
    np.testing.assert_array_equal(stamps, states[[0, 1, 2, 3]])
    assert [tint & 255 for (tint,) in tints] == [255, 255, 90, 255] and tints[2] != tints[1]
    assert np.isnan(file.array("/residual/body", "Scalars:scalars")).tolist() == [True, False, False, False, False]
    assert not any(entity.endswith("/image") for entity in file.entities)


def test_smoothed_states_are_shown_over_the_images_of_their_run(clip, tmp_path):
    file = played(clip / "run/smoothed", tmp_path / "smoothed.rrd")
    states = read_states(clip / "run/smoothed/states.csv")
    np.testing.assert_array_equal(np.array(file.over_time("/positions/body", "Scalars:scalars")[1]), states.values[:, :3])
    assert len(file.over_time("/world/cameras/cam01/image", "EncodedImage:blob")[1]) == 5
    assert "/world/bodies/body/uncertainty" in file.entities


@pytest.fixture(scope="module")
def together(tmp_path_factory) -> Path:
    recording = two_people.write_recording(tmp_path_factory.mktemp("two"), 2)
    assert main(["track", str(recording), "--quiet"]) == 0
    return recording.parent


def test_several_bodies_are_shown_together(together, tmp_path):
    file = played(together / "out", tmp_path / "both.rrd")
    for name in two_people.MODELS:
        states = read_states(together / "out" / name / "states.csv")
        np.testing.assert_allclose(
            file.array(f"/world/bodies/{name}/pelvis", "Transform3D:translation"), states.values[:, :3], **F32
        )
        assert len(file.over_time(f"/world/cameras/cam0/{name}", "LineStrips2D:strips")[1]) == 2
    assert file.views["angles/one"] == file.views["angles/other"] == "TimeSeries"
    colors = [file.static(f"/world/bodies/{name}/uncertainty", "Ellipsoids3D:colors") for name in two_people.MODELS]
    assert colors[0] != colors[1]


def test_bodies_of_a_live_run_are_those_that_have_a_folder_with_their_topic(tmp_path):
    """Also those who have joined, whom recording.yaml does not name; a name that nobody got has no folder."""
    for name in ("anna", "person_1"):
        (tmp_path / name).mkdir()
        (tmp_path / name / SUMMARY).write_text(json.dumps({TOPIC: f"/tracker/{name}/state"}))
    (tmp_path / "keypoints").mkdir()
    found = _bodies_in(tmp_path, None)
    assert found == [(name, tmp_path / name, f"/tracker/{name}/state", None) for name in ("anna", "person_1")]


def test_a_run_and_its_smoothed_states_have_names(clip, tmp_path):
    file = played(clip / "run", clip / "run/smoothed", clip / "run", "--no-images", tmp_path / "three.rrd")
    for name in ("run", "smoothed", "run_2"):
        assert f"/world/bodies/{name}/trunk" in file.entities


def test_mistakes_are_said(clip, tmp_path, capsys, monkeypatch):
    output = tmp_path / "run.rrd"
    shutil.copytree(clip / "run", tmp_path / "alone")
    info = json.loads((tmp_path / "alone/run.json").read_text())
    info["options"] |= {"model": None, "rig": None}
    (tmp_path / "alone/run.json").write_text(json.dumps(info))
    for arguments, said in [
        ([str(clip / "cam01")], "neither"),
        ([str(clip / "run"), "--rig", str(tmp_path / "no.yaml")], "no.yaml"),
        ([str(tmp_path / "alone")], "does not name its body model; give --model FILE"),
        ([str(clip / "run"), "--model", "a", "b"], "'--model': expected one, or 1: one for each body, got 2"),
    ]:
        assert main(["rerun", *arguments, "--output", str(output)]) == 2
        assert said in capsys.readouterr().err
        assert not output.exists() and not list(tmp_path.glob("*.part"))
    assert main(["rerun", str(tmp_path / "alone"), "--model", str(clip / "model.yaml"), "--output", str(output)]) == 0
    assert "give --rig FILE" in capsys.readouterr().err
    assert main(["rerun", str(clip / "run"), "--output", str(output)]) == 2
    assert "--force" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "rerun", None)
    assert main(["rerun", str(clip / "run"), "--output", str(output), "--force"]) == 2
    assert "pip install 'tracker_node[rerun]'" in capsys.readouterr().err
