"""Offline runs on a small clip with the real tracker: what they write, and that they repeat."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.cameras.small_clip import Clip, make_clip
from helpers.one_run import run_offline
from helpers.sources.tables import read_numbers
from tracker_node.cli.main import main
from tracker_node.errors import SourceError
from tracker_node.loaders.bag.message_types import TRACKED_STATE, message_of
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagExistsError, BagWriter
from tracker_node.loaders.images.source import SourceOptions, open_camera_source
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.motion.trajectory_file import read_joints, read_states
from tracker_node.loaders.rig.rig_yaml import load_rig, read_rig_file, write_rig_file
from tracker_node.model.configuration import Configuration
from tracker_node.runs import recorded_sets
from tracker_node.runs.config_file import load_config
from tracker_node.runs.messages import IMAGE, image
from tracker_node.runs.offline import OfflineRun

N_IMAGES = 12
BASE_NS = 1_700_000_000_000_000_000


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    return make_clip(tmp_path_factory.mktemp("clip"), N_IMAGES)


@pytest.fixture
def own_clip(clip: Clip, tmp_path: Path) -> Clip:
    """A copy that a test may damage."""
    shutil.copytree(clip.folder, tmp_path / "clip")
    return replace(clip, folder=tmp_path / "clip", rig=load_rig(tmp_path / "clip/rig.yaml"))


def offline_run(clip: Clip, **options) -> OfflineRun:
    model = load_model(clip.model_file)
    return OfflineRun(
        rig=load_rig(clip.rig_file),
        model=model,
        config=load_config(clip.config_file),
        initial_state=load_state(clip.state_file, model),
        **options,
    )


@pytest.fixture(scope="module")
def finished(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict]:
    output = tmp_path_factory.mktemp("finished") / "run"
    seen = []
    summary = run_offline(
        offline_run(clip, masks=True, masked_images=True), output, lambda done, expected, estimate: seen.append((done, expected))
    )
    assert seen == [(i + 1, N_IMAGES) for i in range(N_IMAGES)]
    return output, summary


def image_bag(clip: Clip, path: Path, with_states_of: Path | None = None) -> Path:
    """A bag with the clip's images, as a recorder beside the cameras would make; and the states of an earlier run."""
    with BagWriter(path) as writer:
        streams = [(c, iter(open_camera_source(c, SourceOptions(base_stamp_ns=BASE_NS)))) for c in load_rig(clip.rig_file)]
        for i in range(N_IMAGES):
            for camera, stream in streams:
                stamp_ns, bgr = next(stream)
                log_ns = BASE_NS + i * 40_000_000
                message = message_of(IMAGE, image(stamp_ns, camera.frame_id, bgr))
                writer.write_message(f"/{camera.name}/image_raw", log_ns, message)
        if with_states_of is not None:
            with BagReader(with_states_of) as reader:
                for stamp_ns, message in reader.decoded("/tracker/state"):
                    reread = type(message)(**vars(message))
                    writer.add_topic("/tracker/state", TRACKED_STATE)
                    raw = reader._store.serialize_cdr(reread, TRACKED_STATE)
                    writer.write("/tracker/state", stamp_ns + 7, bytes(raw))
    return path


def test_the_body_is_found(clip: Clip, finished: tuple[Path, dict]) -> None:
    """The tracker on its own model's pictures, of which a pixel is a centimeter wide."""
    output, summary = finished
    joints = read_joints(output / "joints.csv")
    assert joints.names == clip.model.landmark_names
    truth = np.array([Configuration(clip.model, state).landmarks_world for state in clip.states])
    errors_m = np.linalg.norm(joints.positions_m - truth, axis=2)
    assert errors_m.mean() < 0.03
    assert errors_m.max() < 0.08
    assert summary["status_counts"]["TRACKING"] == N_IMAGES


def test_the_files_agree_with_each_other(clip: Clip, finished: tuple[Path, dict]) -> None:
    output, _ = finished
    states, poses = read_states(output / "states.csv"), read_numbers(output / "poses.csv")[1]
    assert states.dof_names == clip.model.chain.dof_names
    with BagReader(output / "bag") as reader:
        messages = [message for _, message in reader.decoded("/tracker/state")]
        pose_messages = [message for _, message in reader.decoded("/tracker/pose")]
        joint_messages = [message for _, message in reader.decoded("/tracker/joint_states")]
        infos = [message for _, message in reader.decoded("/cam02/camera_info")]
        masks = [message for _, message in reader.decoded("/tracker/cam02/mask")]
        seen = [message for _, message in reader.decoded("/tracker/cam02/masked_image/compressed")]
    assert np.array([message.values for message in messages]).tobytes() == states.values.tobytes()
    assert [message.residual for message in messages] == [row.residual for row in states.rows]
    assert [message.pose.pose.orientation.w for message in pose_messages] == poses[:, 6].tolist()
    assert (np.array([message.position for message in joint_messages]) == states.values[:, 6:]).all()
    assert joint_messages[0].name == ["shoulder_x", "shoulder_y", "elbow_flexion"]
    assert len(infos) == N_IMAGES
    assert infos[0].header.frame_id == "cam02_optical_frame"
    assert infos[0].k[0] == 150.0
    picture = masks[3].data.reshape(120, 160)
    assert set(np.unique(picture)) == {0, 255}
    assert 300 < (picture > 0).sum() < 8000
    image, through = cv2.imread(str(clip.folder / "cam02/0003.png")), cv2.imdecode(seen[3].data, cv2.IMREAD_COLOR)
    inside = cv2.erode(picture, np.ones((5, 5), np.uint8)) > 0
    outside = cv2.dilate(picture, np.ones((33, 33), np.uint8)) == 0  # JPEG has blocks of 16
    assert inside.sum() > 100 and outside.sum() > 5000
    assert np.abs(image[inside].astype(int) - through[inside]).mean() < 6.0
    assert through[outside].max() < 10


def test_the_summary_says_how_it_went(clip: Clip, finished: tuple[Path, dict]) -> None:
    output, summary = finished
    assert json.loads((output / "run.json").read_text()) == summary
    assert (summary["image_sets"], summary["expected_image_sets"], summary["lost_sets"]) == (N_IMAGES, N_IMAGES, 0)
    assert summary["images"]["cam01"] == {"received": N_IMAGES, "used": N_IMAGES}
    assert 0 < summary["ms_per_set"]["p50"] <= summary["ms_per_set"]["p95"]
    assert 1 <= summary["iterations"]["mean"] <= summary["iterations"]["max"]
    assert summary["errors"] == []
    assert summary["parameters"]["threads"] == 2
    assert {"tracker_node", "numpy", "numba"} <= set(summary["versions"])


def test_a_second_run_writes_the_same_bytes(clip: Clip, finished: tuple[Path, dict], tmp_path: Path) -> None:
    run_offline(offline_run(clip), tmp_path / "again")
    for name in ("states.csv", "joints.csv", "poses.csv"):
        assert (tmp_path / "again" / name).read_bytes() == (finished[0] / name).read_bytes(), name


def test_images_of_a_bag_give_the_states_of_the_files(clip: Clip, finished: tuple[Path, dict], tmp_path: Path) -> None:
    bag = image_bag(clip, tmp_path / "images")
    summary = run_offline(offline_run(clip, bag=bag), tmp_path / "run")
    assert (summary["image_sets"], summary["errors"]) == (N_IMAGES, [])
    expected = read_states(finished[0] / "states.csv").values
    assert read_states(tmp_path / "run/states.csv").values.tobytes() == expected.tobytes()


def test_a_recorded_run_is_made_again_set_by_set(clip: Clip, tmp_path: Path) -> None:
    """Also when the live tracker skipped sets: only those that the states list are used."""
    images = image_bag(clip, tmp_path / "images")
    thinned = tmp_path / "thinned"
    with BagReader(images) as reader, BagWriter(thinned) as writer:
        for number, message in enumerate(reader.messages()):
            if (number // 3) % 4 != 2:  # every fourth set is missing
                writer.add_topic(message.topic, message.type_name)
                writer.write(message.topic, message.stamp_ns, message.data)
    first = run_offline(offline_run(clip, bag=thinned), tmp_path / "first")
    assert first["image_sets"] == N_IMAGES * 3 // 4
    recorded = image_bag(clip, tmp_path / "recorded", with_states_of=tmp_path / "first/bag")
    second = run_offline(offline_run(clip, bag=recorded, from_run=True), tmp_path / "second")
    assert (second["errors"], second["notes"], second["sets_not_made_again"]) == ([], [], 0)
    assert (tmp_path / "second/states.csv").read_bytes() == (tmp_path / "first/states.csv").read_bytes()
    everything = run_offline(offline_run(clip, bag=recorded), tmp_path / "everything")
    assert everything["image_sets"] == N_IMAGES


def test_a_loop_is_made_again_pass_by_pass(clip: Clip, tmp_path: Path) -> None:
    """Stamps that come again: the tracker begins anew, as the node does."""
    run_offline(offline_run(clip, images=SourceOptions(base_stamp_ns=BASE_NS)), tmp_path / "once")
    single = image_bag(clip, tmp_path / "single", with_states_of=tmp_path / "once/bag")
    with BagReader(single) as reader, BagWriter(tmp_path / "twice") as writer:
        for turn in range(2):
            for message in reader.messages():
                writer.add_topic(message.topic, message.type_name)
                writer.write(message.topic, message.stamp_ns + turn * 10**10, message.data)
    summary = run_offline(offline_run(clip, bag=tmp_path / "twice", from_run=True), tmp_path / "run")
    assert (summary["image_sets"], summary["errors"]) == (2 * N_IMAGES, [])
    once, twice = read_states(tmp_path / "once/states.csv").values, read_states(tmp_path / "run/states.csv").values
    assert twice.tobytes() == np.vstack([once, once]).tobytes()


def test_a_run_without_images_is_made_again_from_the_sources(
    clip: Clip, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And differs where it began otherwise."""
    monkeypatch.setattr(recorded_sets, "_SAME_M", 0.0)
    options = SourceOptions(base_stamp_ns=BASE_NS, start=2)
    run_offline(offline_run(clip, images=options), tmp_path / "first")
    again = offline_run(clip, bag=tmp_path / "first/bag", from_run=True, images=SourceOptions(start=2))
    summary = run_offline(again, tmp_path / "second")
    assert (summary["errors"], summary["notes"], summary["image_sets"]) == ([], [], N_IMAGES - 2)
    assert (tmp_path / "second/states.csv").read_bytes() == (tmp_path / "first/states.csv").read_bytes()
    assert again.initial_state is not None
    T = again.initial_state.T_world_root.copy()
    T[0, 3] += 0.5
    restarted = replace(again, initial_state=replace(again.initial_state, T_world_root=T))
    (note,) = run_offline(restarted, tmp_path / "restarted")["notes"]
    assert "states differ from the recorded ones from 0.00 s on" in note
    wrong = replace(again, images=SourceOptions(rate_hz=25.0))
    with pytest.raises(SourceError, match="not those of the rig's sources"):
        run_offline(wrong, tmp_path / "third")


def test_a_run_from_stamp_0_on_that_began_without_a_camera_is_made_again(own_clip: Clip, tmp_path: Path) -> None:
    """In the message of a set at stamp 0, 0 says that a camera gave no image, or one at 0."""
    rig = read_rig_file(own_clip.rig_file)
    write_rig_file(rig.with_cameras({"cam02": {"time_offset_s": 0.1}}), own_clip.rig_file)
    run_offline(offline_run(own_clip), tmp_path / "first")
    summary = run_offline(offline_run(own_clip, bag=tmp_path / "first/bag", from_run=True), tmp_path / "second")
    assert summary["errors"] == []
    assert (tmp_path / "second/states.csv").read_bytes() == (tmp_path / "first/states.csv").read_bytes()


def test_an_image_of_another_size_is_named_and_the_others_of_its_camera_go_on(own_clip: Clip, tmp_path: Path) -> None:
    files = sorted((own_clip.folder / "cam02").iterdir())
    files[2].write_bytes(b"not an image")
    cv2.imwrite(str(files[4]), np.zeros((10, 20, 3), np.uint8))
    summary = run_offline(offline_run(own_clip), tmp_path / "run")
    (error,) = summary["errors"]
    assert f"camera 'cam02' after {N_IMAGES - 2} images" in error
    assert files[2].name in error and f"{files[4].name} is of 20x10 pixels" in error


def test_a_video_that_breaks_off_leaves_the_other_cameras(own_clip: Clip, tmp_path: Path) -> None:
    for path in sorted((own_clip.folder / "cam02").iterdir())[5:]:
        path.write_bytes(b"not an image")
    summary = run_offline(offline_run(own_clip), tmp_path / "run")
    assert summary["image_sets"] == N_IMAGES
    (error,) = summary["errors"]
    assert "camera 'cam02' after 5 images" in error
    assert "0005.png" in error
    with BagReader(tmp_path / "run/bag") as reader:
        stamps = [message.camera_stamps for _, message in reader.decoded("/tracker/state")]
    assert all(s[1].sec or s[1].nanosec for s in stamps[1:5])
    assert not any(s[1].sec or s[1].nanosec for s in stamps[5:])
    assert summary["images"]["cam02"]["used"] == 5
    assert summary["images"]["cam01"]["used"] == N_IMAGES


def test_an_image_that_is_missing_in_a_folder_shifts_nothing(own_clip: Clip, finished: tuple[Path, dict], tmp_path: Path) -> None:
    (own_clip.folder / "cam02/0005.png").unlink()
    summary = run_offline(offline_run(own_clip), tmp_path / "run")
    assert summary["image_sets"] == N_IMAGES and summary["images"]["cam02"]["used"] == N_IMAGES - 1
    assert summary["errors"] == []  # cameras drop images: no reason for a run to end as one that has failed
    assert f"camera 'cam02': 1 of {N_IMAGES} numbered images are missing, first 0005.png" in summary["notes"]
    whole, got = read_states(finished[0] / "states.csv"), read_states(tmp_path / "run/states.csv")
    assert np.abs(got.rows[-1].values - whole.rows[-1].values).max() < 0.01


def test_gray_images_are_told_where_outlines_go_by_colors(own_clip: Clip, tmp_path: Path) -> None:
    path = own_clip.folder / "cam02/0000.png"
    cv2.imwrite(str(path), cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2GRAY))
    run = offline_run(own_clip, max_sets=1)
    for modalities, told in ((("region",), ["cam02"]), (("chamfer",), [])):
        config = replace(run.config, modalities=modalities)
        notes = run_offline(replace(run, config=config), tmp_path / modalities[0])["notes"]
        assert [note.split()[0] for note in notes if "without colors" in note] == told


def test_folders_that_begin_at_different_numbers_are_told(own_clip: Clip) -> None:
    for i in range(3):
        (own_clip.folder / f"cam02/{i:04d}.png").unlink()
    (note,) = offline_run(own_clip).image_sets().notes
    assert "'cam01' at 0, 'cam02' at 3, 'cam03' at 0; their first images are taken to be of the same time" in note
    rig = read_rig_file(own_clip.rig_file)
    write_rig_file(rig.with_cameras({"cam02": {"time_offset_s": 0.1}}), own_clip.rig_file)
    assert offline_run(own_clip).image_sets().notes == []


def test_a_camera_that_stops_is_named_and_the_others_go_on_if_they_may(own_clip: Clip, tmp_path: Path) -> None:
    for path in sorted((own_clip.folder / "cam02").iterdir())[5:]:
        path.unlink()
    own_clip.config_file.write_text("synchronizer: {queue_s: 0.1, min_cameras: 0}\n")
    summary = run_offline(offline_run(own_clip), tmp_path / "strict")
    assert summary["image_sets"] == 5
    assert summary["errors"] == ["camera 'cam02' stopped 0.23 s before the others; a set needs all cameras"]
    own_clip.config_file.write_text("synchronizer: {queue_s: 0.1, min_cameras: 2}\n")
    summary = run_offline(offline_run(own_clip), tmp_path / "lenient")
    assert summary["image_sets"] == N_IMAGES
    assert "at least 2 cameras" in summary["errors"][0]


def test_a_camera_without_a_file_is_named_and_left_out(own_clip: Clip, tmp_path: Path) -> None:
    shutil.rmtree(own_clip.folder / "cam03")
    summary = run_offline(offline_run(own_clip), tmp_path / "run")
    assert summary["image_sets"] == N_IMAGES
    assert ["cam03" in error and "left out" in error for error in summary["errors"]] == [True]
    for camera in ("cam01", "cam02"):
        shutil.rmtree(own_clip.folder / camera)
    with pytest.raises(SourceError, match=r"no camera has a source.*cam01.*cam02") as told:
        run_offline(offline_run(own_clip, asked={"rig": "my/rig.yaml"}), tmp_path / "none")
    text = str(told.value)
    assert text.startswith("image source 'my/rig.yaml': ") and text.count("no such file or folder") == 1
    assert "left out" not in text and f"cam01 ({own_clip.folder / 'cam01'})" in text
    assert not (tmp_path / "none").exists()


def test_images_of_another_size_are_named_and_left_out(own_clip: Clip, tmp_path: Path) -> None:
    for path in (own_clip.folder / "cam01").iterdir():
        cv2.imwrite(str(path), np.zeros((60, 80, 3), np.uint8))
    summary = run_offline(offline_run(own_clip), tmp_path / "run")
    assert summary["image_sets"] == N_IMAGES
    assert "expected 160x120, got 80x60" in summary["errors"][0]


def test_a_bag_cut_in_the_middle_is_tracked_as_far_as_it_goes(clip: Clip, finished: tuple[Path, dict], tmp_path: Path) -> None:
    bag = image_bag(clip, tmp_path / "images")
    (file,) = bag.glob("*.mcap")
    file.write_bytes(file.read_bytes()[: int(file.stat().st_size * 0.6)])
    summary = run_offline(offline_run(clip, bag=bag), tmp_path / "run")
    assert summary["image_sets"] == 7
    assert "breaks off" in summary["errors"][0]
    expected = read_states(finished[0] / "states.csv").values[:7]
    assert read_states(tmp_path / "run/states.csv").values.tobytes() == expected.tobytes()


def test_missing_images_of_a_recorded_run_are_reported(clip: Clip, finished: tuple[Path, dict], tmp_path: Path) -> None:
    options = SourceOptions(base_stamp_ns=BASE_NS)
    run_offline(offline_run(clip, images=options), tmp_path / "first")
    full = image_bag(clip, tmp_path / "full", with_states_of=tmp_path / "first/bag")
    with BagReader(full) as reader, BagWriter(tmp_path / "holes") as writer:
        for number, message in enumerate(reader.messages()):
            if number != 13:
                writer.add_topic(message.topic, message.type_name)
                writer.write(message.topic, message.stamp_ns, message.data)
    summary = run_offline(offline_run(clip, bag=tmp_path / "holes", from_run=True), tmp_path / "run")
    assert summary["sets_not_made_again"] == 1
    assert summary["image_sets"] == N_IMAGES - 1
    assert "images are missing: cam" in summary["errors"][0]


def test_an_earlier_run_is_not_written_over(clip: Clip, finished: tuple[Path, dict]) -> None:
    before = (finished[0] / "run.json").read_bytes()
    with pytest.raises(BagExistsError, match="exists already"):
        run_offline(offline_run(clip), finished[0])
    assert (finished[0] / "run.json").read_bytes() == before


def test_what_was_tracked_survives_a_crash(clip: Clip, tmp_path: Path) -> None:
    def fail_at_seven(done: int, expected: int | None, estimate) -> None:
        if done == 7:
            raise RuntimeError("power cut")

    with pytest.raises(RuntimeError):
        run_offline(offline_run(clip), tmp_path / "run", fail_at_seven)
    assert len(read_states(tmp_path / "run/states.csv").rows) == 7
    assert json.loads((tmp_path / "run/run.json").read_text())["image_sets"] == 7
    with BagReader(tmp_path / "run/bag") as reader:
        assert (reader.topic("/tracker/state").message_count, reader.recovered) == (7, False)


def test_command(clip: Clip, finished: tuple[Path, dict], tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    arguments = ["track", *clip.arguments(), "--output", str(tmp_path / "run")]
    assert main([*arguments, "--max-sets", "3"]) == 0
    printed = capsys.readouterr()
    assert "3 image sets: 3 TRACKING" in printed.out
    assert "image sets" in printed.err
    assert printed.err.count("no rate in image folders: 30 Hz assumed; --rate,") == 1
    assert (tmp_path / "run/states.csv").read_text().splitlines()[:4] == (
        (finished[0] / "states.csv").read_text().splitlines()[:4]
    )
    assert main(arguments) == 2
    assert "exists already" in capsys.readouterr().err
    options = json.loads((tmp_path / "run/run.json").read_text())["options"]
    assert (options["max_sets"], options["model"]) == (3, str(clip.model_file))
    assert main([*arguments[:-1], str(tmp_path / "at_30_hz"), "--max-sets", "1", "--rate", "30"]) == 0
    assert "assumed" not in capsys.readouterr().err
    written = ["-o", str(tmp_path / "recording.yaml")]
    assert main(["new", "recording", "--rig", str(clip.rig_file), "--model", str(clip.model_file), *written]) == 0
    assert f"30 Hz assumed; rate_hz below images in {written[1]} says another" in capsys.readouterr().err


def test_command_reports_partial_success(own_clip: Clip, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    shutil.rmtree(own_clip.folder / "cam03")
    assert main(["track", *own_clip.arguments(), "--output", str(tmp_path / "run"), "--quiet"]) == 1
    printed = capsys.readouterr()
    assert "cam03" in printed.err
    assert printed.out == ""
    assert main(["track", *own_clip.arguments(), "--output", str(tmp_path / "x"), "--start", "-3"]) == 2


WITHOUT_ROS = """
import sys
class NoRos:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in ("rclpy", "sensor_msgs", "std_msgs", "tracker_msgs", "geometry_msgs"):
            raise ImportError(f"{name} is not installed")
sys.meta_path.insert(0, NoRos())
from tracker_node.cli.main import main
sys.exit(main(sys.argv[1:]))
"""


def test_ros_is_not_needed(clip: Clip, tmp_path: Path) -> None:
    arguments = ["track", *clip.arguments(), "--output", str(tmp_path / "run"), "--max-sets", "2", "--masks"]
    done = subprocess.run([sys.executable, "-c", WITHOUT_ROS, *arguments], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    with BagReader(tmp_path / "run/bag") as reader:
        assert reader.topic("/tracker/state").message_count == 2


def test_a_run_that_is_interrupted_says_so_here_and_later(clip, tmp_path, capsys, monkeypatch):
    def interrupted(self, done, expected, estimate):
        if done == 5:
            raise KeyboardInterrupt

    monkeypatch.setattr("tracker_node.cli.track._Progress.__call__", interrupted)
    output = tmp_path / "run"
    files = ["--rig", str(clip.rig_file), "--model", str(clip.model_file), "--initial-state", str(clip.state_file)]
    assert main(["track", *files, "--config", str(clip.config_file), "--output", str(output)]) == 130
    assert f"ended by Ctrl-C; what was tracked until then is in {output}" in capsys.readouterr().err
    info = json.loads((output / "run.json").read_text())
    assert info["image_sets"] == 5 and info["errors"] == ["ended by Ctrl-C before the last image set"]
    assert main(["evaluate", str(output), "--pictures", "0"]) == 0
    assert "ended by Ctrl-C before the last image set" in (output / "report.html").read_text()
