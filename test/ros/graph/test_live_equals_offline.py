"""The real graph (processes, DDS, bag) and the offline run give the same states, bit for bit."""

from argparse import Namespace
from pathlib import Path

import numpy as np
import pytest

from helpers.cameras.small_clip import Clip, make_clip
from helpers.ros.processes import Process

pytest.importorskip("rclpy", reason="ROS is not installed")

from tracker_node.cli.arguments.run_images import load_run_images
from tracker_node.cli.main import main
from tracker_node.loaders.bag.images import stamp_ns_of
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.motion.trajectory_file import read_states
from tracker_node.model.configuration import Configuration, State

pytestmark = pytest.mark.long
N_IMAGES = 12


@pytest.fixture(scope="module")
def clip(tmp_path_factory: pytest.TempPathFactory) -> Clip:
    return make_clip(tmp_path_factory.mktemp("clip"), N_IMAGES)


@pytest.fixture(scope="module")
def live(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The bag of a lossless run with everything in it."""
    bag = tmp_path_factory.mktemp("live") / "bag"
    run_pipeline(Process, clip, bag, "--images", "--masks", "--masked-images")
    return bag


def run_pipeline(start, clip: Clip, bag: Path, *options: str) -> None:
    pipeline = start("pipeline", *clip.arguments(), "--bag", str(bag), *options)
    assert pipeline.process.wait(120) == 0, pipeline.text


def track_again(clip: Clip, output: Path, *options: str) -> None:
    assert main(["track", *clip.arguments(), "--output", str(output), "--quiet", *options]) == 0


def decoded(bag: Path, topic: str) -> list:
    with BagReader(bag) as reader:
        return [message for _, message in reader.decoded(topic)]


FIELDS = ("values", "velocities", "score", "residual", "camera_residuals", "camera_samples")


def assert_same_states(live: Path, offline: Path) -> None:
    """Everything but wall-clock times and, where the two runs had other clocks, stamps."""
    before, after = decoded(live, "/tracker/state"), decoded(offline, "/tracker/state")
    assert len(before) == len(after)
    for old, new in zip(before, after, strict=True):
        for name in FIELDS:
            assert np.array(getattr(old, name)).tobytes() == np.array(getattr(new, name)).tobytes(), name
        assert (old.status, old.status_reason, old.model) == (new.status, new.status_reason, new.model)
        assert (old.iterations, old.evaluations) == (new.iterations, new.evaluations)
        assert (old.dof_names, old.cameras) == (new.dof_names, new.cameras)
        assert repr(old.root_pose) == repr(new.root_pose)
        assert old.residual_unit == new.residual_unit
    covariances = [decoded(bag, "/tracker/state_covariance") for bag in (live, offline)]
    for states, of_states in zip((before, after), covariances, strict=True):
        assert [repr(message.header) for message in states] == [repr(message.header) for message in of_states]
    for old, new in zip(*covariances, strict=True):
        assert len(old.covariance) == len(old.dof_names) ** 2
        for name in ("covariance", "velocity_covariance"):
            assert getattr(old, name).tobytes() == getattr(new, name).tobytes(), name


def test_a_recorded_run_is_reproduced_bit_for_bit(clip: Clip, live: Path, tmp_path: Path) -> None:
    track_again(clip, tmp_path / "again", "--from-run-bag", str(live), "--masks", "--masked-images")
    offline = tmp_path / "again/bag"
    assert len(decoded(live, "/tracker/state")) == N_IMAGES
    assert_same_states(live, offline)
    with BagReader(live) as before, BagReader(offline) as after:
        for name in after.topics:
            old, new = before.topic(name), after.topic(name)
            assert (old.type_name, old.type_hash, old.definition) == (new.type_name, new.type_hash, new.definition)
            assert old.message_count == new.message_count
            assert (old.qos.reliability, old.qos.durability) == (new.qos.reliability, new.qos.durability)
        extra = set(before.topics) - set(after.topics) - {"/diagnostics"}
        assert {name.rpartition("/")[2] for name in extra} == {"image_raw"}
    described = [[message.data for message in decoded(bag, "/robot_description")] for bag in (live, offline)]
    assert described[0] == described[1]
    assert "<robot" in described[0][0]
    ends = ("pose", "joint_states", "cam02/mask", "cam02/masked_image/compressed")
    for topic in (*(f"/tracker/{end}" for end in ends), "/cam01/camera_info"):
        for old, new in zip(decoded(live, topic), decoded(offline, topic), strict=True):
            assert repr(old.header) == repr(new.header)
            assert_same_arrays(old, new)


def assert_same_arrays(old, new) -> None:
    for name in ("position", "velocity", "data", "d", "k", "r", "p"):
        assert np.array_equal(getattr(old, name, 0), getattr(new, name, 0)), name


def test_files_and_bags_without_the_graph_give_the_states_of_the_graph(clip: Clip, live: Path, tmp_path: Path) -> None:
    """Not from the recorded sets: from the rig's sources or all recorded images, through the same synchronizer and tracker."""
    track_again(clip, tmp_path / "files")
    assert_same_states(live, tmp_path / "files/bag")
    track_again(clip, tmp_path / "images", "--bag", str(live))
    assert_same_states(live, tmp_path / "images/bag")


def test_a_run_in_real_time_is_reproduced_from_the_files(clip: Clip, tmp_path: Path, start) -> None:
    """Stamps of the clock, perhaps sets left out, no images in the bag: the stamps in the states say which images to read."""
    live = tmp_path / "live"
    run_pipeline(start, clip, live, "--real-time")
    track_again(clip, tmp_path / "again", "--from-run-bag", str(live))
    assert_same_states(live, tmp_path / "again/bag")
    stamps = [stamp_ns_of(message.header.stamp) for message in decoded(live, "/tracker/state")]
    assert stamps[0] > 10**18
    assert read_states(tmp_path / "again/states.csv").stamps_ns.tolist() == stamps


def test_a_composed_run_gives_the_states_of_the_files_without_sending_an_image(clip: Clip, tmp_path: Path, start) -> None:
    """One process for ingest and tracker; a recorder beside takes states, and images of one camera because it asks for them."""
    topics = ["tracker/state:tracker_msgs/msg/TrackedState", "tracker/state_covariance:tracker_msgs/msg/StateCovariance"]
    recorder = start("recorder", "--output", str(tmp_path / "bag"), "--topics", *topics, "cam02/image_raw:sensor_msgs/msg/Image")
    recorder.wait_for("recorder: ready")
    composed = start("compose", *clip.arguments(), "--lossless", "--wait-for", "state=2", "state_covariance=1")
    assert composed.process.wait(240) == 0, composed.text
    assert composed.text.count(f": {N_IMAGES} published") == 3, composed.text
    assert recorder.end() == 0, recorder.text
    assert len(decoded(tmp_path / "bag", "/tracker/state")) == N_IMAGES
    assert len(decoded(tmp_path / "bag", "/cam02/image_raw")) == N_IMAGES
    track_again(clip, tmp_path / "files")
    assert_same_states(tmp_path / "bag", tmp_path / "files/bag")


def test_a_composed_run_in_real_time_ends_with_its_sources_and_by_a_signal(clip: Clip, start) -> None:
    composed = start("compose", *clip.arguments(), "--cameras", "cam01", "cam02", "--wait-for", "state=0")
    assert composed.process.wait(240) == 0, composed.text
    assert "cam03" not in composed.text
    assert "first image set tracked" in composed.text
    endless = start("compose", *clip.arguments(), "--loop", "--preload")
    endless.wait_for("first image set tracked")
    assert endless.end() == 0, endless.text
    assert "Traceback" not in endless.text


def test_a_composed_tracker_refuses_to_subscribe_to_compressed_images(clip: Clip, start) -> None:
    refused = start("compose", *clip.arguments(), "--ros-args", "-p", "compressed:=true")
    assert refused.process.wait(120) == 2, refused.text
    assert "compressed" in refused.text and "no image comes from a topic" in refused.text


def test_resampled_images_are_tracked_with_the_recorded_calibration(clip: Clip, tmp_path: Path, start) -> None:
    live = tmp_path / "live"
    run_pipeline(start, clip, live, "--images", "--resize", "120x90", "--cameras", "cam01", "cam03")
    track_again(clip, tmp_path / "again", "--from-run-bag", str(live), "--cameras", "cam01", "cam03")
    assert_same_states(live, tmp_path / "again/bag")


def test_a_resampled_run_without_images_is_fitted_to(clip: Clip, tmp_path: Path, start) -> None:
    """As the demo's: the images are read from the rig's sources again, and made as small."""
    run_pipeline(start, clip, tmp_path / "run/bag", "--resize", "120x90")
    images = load_run_images(Namespace(from_run=str(tmp_path / "run"), sets=4, rig=None, model=None, config=None))
    assert {(camera.model.width, camera.model.height) for camera in images.rig} == {(120, 90)}
    assert {image.pixels.shape[:2] for image_set in images.sets for image in image_set.images} == {(90, 120)}
    fit = ["--from-run", str(tmp_path / "run"), "--sets", "4", "--quiet"]
    assert main(["calibrate", "body", *fit, "--only", "girth", "-o", str(tmp_path / "body.yaml")]) == 0
    assert main(["calibrate", "refine", *fit, "--keep-places", "-o", str(tmp_path / "rig.yaml")]) == 0


def test_the_engine_of_colors_is_reproduced_bit_for_bit(clip: Clip, tmp_path: Path, start) -> None:
    """With colors learnt from the first images, and a limb looked for; what the mask shows of the images is the same too."""
    color = {"learn_colors": "true", "color_rate": 0.1, "degraded_agreement": 0.95, "search_states": 60, "levels": 3}
    config = tmp_path / "config.yaml"
    config.write_text("modalities: [color]\n" + "".join(f"color.{name}: {value}\n" for name, value in color.items()))
    colored = replace_option(clip.arguments(), "--config", config)
    pipeline = start("pipeline", *colored, "--bag", str(tmp_path / "live"), "--images", "--masked-images")
    assert pipeline.process.wait(120) == 0, pipeline.text
    again = ["track", *colored, "--output", str(tmp_path / "again"), "--quiet", "--masked-images"]
    assert main([*again, "--from-run-bag", str(tmp_path / "live")]) == 0
    assert_same_states(tmp_path / "live", tmp_path / "again/bag")
    states = decoded(tmp_path / "live", "/tracker/state")
    assert len(states) == N_IMAGES
    wrists = [
        Configuration(clip.model, State.from_values(np.array(m.values))).landmarks_world[2] for m in (states[0], states[-1])
    ]
    truth = [Configuration(clip.model, clip.states[i]).landmarks_world[2] for i in (0, N_IMAGES - 1)]
    assert np.linalg.norm(np.array(wrists) - truth, axis=1).max() < 0.03
    topic = "/tracker/cam02/masked_image/compressed"
    live, offline = decoded(tmp_path / "live", topic), decoded(tmp_path / "again/bag", topic)
    assert len(live) == N_IMAGES
    assert [m.data.tobytes() for m in live] == [m.data.tobytes() for m in offline]


def replace_option(arguments: list[str], name: str, value: Path) -> list[str]:
    """The arguments with another value of one option."""
    place = arguments.index(name) + 1
    return [*arguments[:place], str(value), *arguments[place + 1 :]]
