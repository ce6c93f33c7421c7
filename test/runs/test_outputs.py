"""One list of topics: what a node publishes, what an offline run writes, what the command line and the pipeline name."""

import pytest

from helpers.ros.samples import small_rig, tracked_arm
from tracker_node.cli.nodes.tracker import OUTPUTS
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagExistsError
from tracker_node.runs.outputs import BODY_OUTPUTS, CAMERA_OUTPUTS, MARKERS, recorded
from tracker_node.runs.writer import RunWriter, run_of_bag


def test_the_state_is_the_last_of_all():
    assert BODY_OUTPUTS[-1].name == "state"


def test_what_can_be_waited_for_is_published():
    published = {output.name for output in (*BODY_OUTPUTS, *CAMERA_OUTPUTS)} | {MARKERS}
    assert set(OUTPUTS) == published - {"twist", "crops", "camera_info"}


def test_an_offline_run_announces_what_a_pipeline_records(tmp_path):
    """But for diagnostics and transforms, which an offline run has nobody to tell."""
    pytest.importorskip("rclpy", reason="ROS is not installed")
    from tracker_node.ros.pipeline import PipelineOptions

    rig = small_rig(tmp_path)
    with RunWriter(tmp_path / "run", rig, tracked_arm(), masks=True, masked_images=True):
        pass
    with BagReader(tmp_path / "run/bag") as reader:
        written = {name: topic.type_name for name, topic in reader.topics.items()}
    pipeline = PipelineOptions([], [], rig.names, masks=True, masked_images=True)
    live = dict(topic.lstrip("/").partition(":")[::2] for topic in pipeline.recorded_topics())
    live = {f"/{name}": kind for name, kind in live.items() if name != "diagnostics" and not name.startswith("tf")}
    assert {name: kind or "std_msgs/msg/String" for name, kind in live.items()} == written
    assert sorted(pipeline.recorded_names()) == ["joint_states", "mask", "masked_image", "pose", "state", "state_covariance"]


def test_only_what_is_requested_is_recorded_besides_what_is_always_made():
    assert [output.name for output in recorded(BODY_OUTPUTS, ["twist"])] == ["pose", "joint_states", "state_covariance", "state"]
    assert [output.name for output in recorded(CAMERA_OUTPUTS, ["overlay"])] == ["overlay"]
    assert recorded(CAMERA_OUTPUTS, []) == []


def test_a_node_makes_covariances_only_while_somebody_listens_but_a_bag_holds_them():
    assert [output.name for output in BODY_OUTPUTS if output.on_request] == ["twist", "crops", "state_covariance"]


def test_jpegs_have_the_names_that_image_transport_looks_for():
    topics = [output.topic for output in (*BODY_OUTPUTS, *CAMERA_OUTPUTS)]
    assert topics[-4:] == ["camera_info", "mask", "overlay/compressed", "masked_image/compressed"]
    assert topics[:-4] == ["twist", "pose", "joint_states", "crops", "state_covariance", "state"]


def test_a_bag_named_bag_is_that_of_a_run_which_must_not_be_there(tmp_path):
    assert run_of_bag(tmp_path / "bag") == tmp_path
    assert run_of_bag(tmp_path / "other") is None
    (tmp_path / "run.json").write_text("{}")
    with pytest.raises(BagExistsError, match=r"run\.json"):
        run_of_bag(tmp_path / "bag")
    assert run_of_bag(tmp_path / "other") is None
