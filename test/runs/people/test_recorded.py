"""Runs by the points of another detector: of a person in OpenPose's files, of a machine by a table, and what is refused."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.cameras.person_clip import make_person_clip
from helpers.cameras.small_clip import Clip, make_clip
from helpers.one_run import run_offline
from helpers.sources import point_files as files
from tracker_node.api.functions import track
from tracker_node.api.recording import Recording
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.loaders.images.source import SourceOptions
from tracker_node.loaders.keypoints.files import BODY_25B
from tracker_node.loaders.motion.trajectory_file import read_joints
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.rig.calibration_toml import load_pose2sim
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import BODY_25B as TABLE
from tracker_node.model.humans.keypoints import KeypointTable, LandmarkPoint
from tracker_node.model.humans.measures import landmark_of_marker
from tracker_node.runs.config_file import load_config
from tracker_node.runs.offline import OfflineRun
from tracker_node.runs.people.recorded import PointFiles, open_recorded_people
from tracker_node.tracking.config import from_dict

N_IMAGES = 6
POINTS_ALONE = from_dict({"modalities": ["keypoints"], "threads": 2})


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    """With a folder ``pose`` as Pose2Sim has it: from image 2 on there is somebody else, too, and image 3 is missing."""
    clip = make_person_clip(tmp_path_factory.mktemp("clip") / "person", N_IMAGES)
    for camera in clip.rig.names:
        images = points_of(clip, camera, BODY_25B, TABLE)
        beside = np.array([60.0, 0.0, 0.0])
        others = [np.concatenate([np.where(image[:, :, 2:] > 0.0, image + beside, 0.0), image]) for image in images]
        folder = files.write_openpose(clip.folder / "pose" / f"{camera}_json", [*images[:2], *others[2:]])
        sorted(folder.iterdir())[3].unlink()
    return clip


def points_of(clip: Clip, camera: str, names: tuple[str, ...], table: KeypointTable) -> list[np.ndarray]:
    """(1, n, 3) By image: where a detector finds the points of a table, 1 px off."""
    rng, found = np.random.default_rng(5), []
    for state in clip.states:
        body, points = Configuration(clip.model, state), np.zeros((1, len(names), 3))
        for k, name in enumerate(names):
            if name in table:
                landmark = clip.model.landmark_index(table[name].landmark)
                R = body.Ts_world_link[clip.model.landmark_links[landmark], :3, :3]
                place = body.landmarks_world[landmark] + R @ np.array(table[name].offset)
                pixels, seen = clip.rig[camera].project(place[None])
                points[0, k] = [*(pixels[0] + rng.normal(0.0, 1.0, 2)), 0.9 * seen[0]]
        found.append(points)
    return found


def errors_m(clip: Clip, output: Path) -> np.ndarray:
    joints = read_joints(output / "joints.csv")
    truth = np.array([Configuration(clip.model, state).landmarks_world for state in clip.states])
    return np.linalg.norm(joints.positions_m - truth[: len(joints.positions_m)], axis=2)


def run_of(clip: Clip, **changes: Any) -> OfflineRun:
    given = {
        "rig": load_rig(clip.rig_file), "model": clip.model, "config": load_config(clip.config_file),
        "initial_state": clip.states[0], "points": PointFiles(clip.folder),
    }  # fmt: skip
    return OfflineRun(**{**given, **changes})


def test_a_person_by_the_points_of_a_project_of_pose2sim(clip: Clip, tmp_path: Path) -> None:
    summary = run_offline(run_of(clip), tmp_path / "run")
    assert summary["status_counts"]["TRACKING"] == N_IMAGES
    assert summary["detection"]["images"] == dict.fromkeys(clip.rig.names, N_IMAGES - 1)
    assert summary["detection"]["points"] == sorted(TABLE)
    assert errors_m(clip, tmp_path / "run").mean() < 0.03


def test_points_alone_on_smaller_images(clip: Clip, tmp_path: Path) -> None:
    """Points in pixels of the files are brought to the pixels of the images that are tracked."""
    options = SourceOptions(shrink=2)
    run_offline(run_of(clip, config=POINTS_ALONE, images=options), tmp_path / "run")
    assert errors_m(clip, tmp_path / "run").mean() < 0.05


def test_somebody_far_from_the_place_that_was_asked_for_is_noted(clip: Clip, tmp_path: Path) -> None:
    for place, noted in (([30.0, 30.0, 1.0], True), ([0.5, 0.0, 1.0], False)):
        asked = run_of(clip, initial_state=None, person=np.array(place), config=POINTS_ALONE, max_sets=2)
        summary = run_offline(asked, tmp_path / str(noted))
        assert summary["status_counts"]["INITIALIZING"] < 2
        notes = [note for note in summary["notes"] if note.endswith("m away: is it somebody else?")]
        assert len(notes) == noted and all("asked for at (30.0, 30.0, 1.0), the nearest was at (" in note for note in notes)


def test_the_command(clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = ["--keypoints", str(clip.folder / "pose"), "--output", str(tmp_path / "run"), "--max-sets", "3", "--quiet"]
    assert main(["track", *clip.arguments(), *points]) == 0
    assert errors_m(clip, tmp_path / "run").mean() < 0.03
    assert main(["track", *clip.arguments(), "--keypoints-table", "t.yaml", "--output", str(tmp_path / "other")]) == 2
    assert "field '--keypoints-table': expected --keypoints or" in capsys.readouterr().err


def test_in_python_with_a_table_of_a_machine(tmp_path: Path) -> None:
    """Animals' programs, and a body without a person's landmarks."""
    clip = make_clip(tmp_path / "clip", 4)
    table = {name: LandmarkPoint(name, sigma=(0.01, 0.01, 0.01)) for name in ("shoulder", "elbow", "wrist")}
    names = ("wrist", "elbow", "shoulder", "base")
    for camera in clip.rig.names:
        files.write_deeplabcut_csv(tmp_path / f"{camera}DLC_x.csv", points_of(clip, camera, names, table), names)
    keypoints = tmp_path / "keypoints.yaml"
    keypoints.write_text("points:\n" + "".join(f"  {name}: {{landmark: {name}, sigma: 0.01}}\n" for name in table))
    misspelt = tmp_path / "misspelt.yaml"
    misspelt.write_text(keypoints.read_text().replace("  elbow:", "  elbwo:"))
    with pytest.raises(FileFormatError, match=r"points.elbwo': expected a point of the files, such as 'elbow', got 'elbwo'"):
        open_recorded_people(PointFiles(tmp_path, misspelt), clip.model, load_rig(clip.rig_file), load_rig(clip.rig_file), {})
    recording = Recording(
        load_rig(clip.rig_file), clip.model, from_dict({"modalities": ["region", "keypoints"], "threads": 2}), clip.states[0],
        points=PointFiles(tmp_path, keypoints),
    )  # fmt: skip
    run = track(recording, tmp_path / "run")
    assert set(run.status) <= {"TRACKING", "DEGRADED"}  # points of a body this small hardly tell one place from another
    assert errors_m(clip, tmp_path / "run").mean() < 0.02
    assert run.info["options"]["keypoints_table"] == str(keypoints)


def test_numbers_of_images(clip: Clip) -> None:
    rig = load_rig(clip.rig_file)
    numbers = {"cam01": {100: 7, 200: 8}}
    people = open_recorded_people(PointFiles(clip.folder, first=5), clip.model, rig, rig, numbers)
    assert [people.of("cam01", i) is None for i in (4, 5, 8, 10, 11)] == [True, False, True, False, True]
    found = people.of("cam02", 7)
    assert found is not None and len(found) == 2 and set(TABLE) <= set(found[0].names)
    assert people.of("nobody", 7) is None


def test_five_hundred_people(clip: Clip, tmp_path: Path) -> None:
    crowd = np.concatenate([points_of(clip, "cam01", BODY_25B, TABLE)[0]] * 500)
    files.write_openpose(tmp_path / "cam01", [crowd])
    rig = load_rig(clip.rig_file)
    people = open_recorded_people(PointFiles(tmp_path), clip.model, rig, rig, {})
    found = people.of("cam01", 0)
    assert found is not None and len(found) == 50
    assert people.notes == ["camera 'cam02': no points in cam01", "camera 'cam03': no points in cam01"]


def test_what_is_refused(clip: Clip, tmp_path: Path) -> None:
    with pytest.raises(TrackerError, match=r"take the modality keypoints: set modalities: \[region, keypoints\]"):
        run_offline(run_of(clip, config=from_dict({"modalities": ["region"]})), tmp_path / "run")
    parts = ("left_paw", "right_paw")
    for camera in clip.rig.names:
        files.write_deeplabcut_csv(tmp_path / f"{camera}.csv", files.some_people(2, n_people=1), parts)
    with pytest.raises(TrackerError, match="a keypoint table is needed, with the points 'left_paw, right_paw"):
        run_offline(run_of(clip, points=PointFiles(tmp_path)), tmp_path / "run")
    (tmp_path / "t.yaml").write_text("points: {nose: {landmark: nose}}")
    with pytest.raises(TrackerError, match="no point that human has a landmark for: the table has nose, the files left_paw"):
        run_offline(run_of(clip, points=PointFiles(tmp_path, tmp_path / "t.yaml")), tmp_path / "run")
    files.write_openpose(tmp_path / "empty/cam01", [np.zeros((0, 25, 3))] * 3)
    with pytest.raises(TrackerError, match="nobody in any image"):
        run_offline(run_of(clip, points=PointFiles(tmp_path / "empty")), tmp_path / "run")


def test_the_real_clip(shared_data: Path) -> None:
    """Points are within pixels of the triangulated joints of the same man; somebody else is in some images, too."""
    folder = shared_data / "pose2sim_balancing"
    rig, model = load_pose2sim(folder / "Pose2Sim_cameras.toml"), human_model()
    people = open_recorded_people(PointFiles(folder / "openpose_body25b_json.zip"), model, rig, rig, {})
    markers, offs = load_trc(folder / "Pose2Sim_markers.trc"), []
    assert people.notes == []
    for camera in rig:
        for i in range(0, 100, 20):
            found = people.of(camera.name, i)
            assert found
            joints = {name: k for k, name in enumerate(markers.names) if landmark_of_marker(name) in TABLE}
            pixels, _ = camera.project(markers.positions_m[i, list(joints.values())])
            named = [landmark_of_marker(name) for name in joints]
            each = [person.pixels[[person.names.index(name) for name in named]] for person in found]
            offs.append(min(float(np.median(np.linalg.norm(points - pixels, axis=1))) for points in each))
    assert np.median(offs) < 12.0 and max(offs) < 40.0
