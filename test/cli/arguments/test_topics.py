"""Image topics that have other names than their cameras: from the rig, or from the command line."""

from argparse import ArgumentTypeError
from dataclasses import replace

import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.camera.rig import CameraRig
from tracker_node.cli.arguments.cameras import camera_topic, tracker_name, with_topics
from tracker_node.errors import FileFormatError, UnknownNameError
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file


def rig_with_topic(topic: str | None) -> CameraRig:
    rig = circle_rig(2)
    first, second = rig
    return replace(rig, cameras=(replace(first, topic=topic), second))


def rules_of(ros_args: list[str]) -> dict[str, str]:
    return dict(rule.split(":=") for rule in ros_args if ":=" in rule)


def test_the_rig_names_the_topics_and_what_is_given_goes_before():
    first, second = rig_with_topic(None).names
    rig = rig_with_topic("/front/image_color")
    assert rules_of(with_topics([], rig, {})) == {
        f"{first}/image_raw": "/front/image_color",
        f"{first}/image_raw/compressed": "/front/image_color/compressed",
        f"{first}/camera_info": "/front/camera_info",
    }
    given = rules_of(with_topics([], rig, {first: "color", second: "/b/image"}))
    assert (given[f"{first}/image_raw"], given[f"{first}/camera_info"]) == ("color", "camera_info")
    assert given[f"{second}/camera_info"] == "/b/camera_info"
    assert with_topics(["--ros-args", "-r", "a:=b"], rig, {})[:3] == ["--ros-args", "-r", "a:=b"]  # the first rule counts
    assert with_topics([], rig_with_topic(None), {}) == []


def test_unknown_cameras_and_names_that_are_none_are_refused():
    with pytest.raises(UnknownNameError, match="nobody"):
        with_topics([], rig_with_topic(None), {"nobody": "/a"})
    for text in ("cam01", "cam01=", "cam01=/a b", "=a"):
        with pytest.raises(ArgumentTypeError, match="CAMERA=TOPIC"):
            camera_topic(text)


def test_the_rig_file_keeps_the_topic(tmp_path):
    write_rig_file(rig_file_of(rig_with_topic("/front/image_color")), tmp_path / "rig.yaml")
    assert [camera.topic for camera in load_rig(tmp_path / "rig.yaml")] == ["/front/image_color", None]
    text = (tmp_path / "rig.yaml").read_text()
    (tmp_path / "rig.yaml").write_text(text.replace("/front/image_color", "front image"))
    with pytest.raises(FileFormatError, match=r"topic.*/front/image_raw"):
        load_rig(tmp_path / "rig.yaml")


@pytest.mark.parametrize(("ros_args", "own", "others"), [
    ("", "/tracker", "/tracker"),
    ("-r __node:=anna -r __ns:=/lab", "/lab/anna", "/lab/tracker"),
    ("-p a:=1 --remap tracker:__name:=anna -r keypoints:__ns:=/x --ros-args -r __ns:=/", "/anna", "/tracker"),
    ("-r __ns:=/a/b -r __ns:=/c", "/a/b/tracker", "/a/b/tracker"),
])  # fmt: skip
def test_the_name_of_a_tracker_is_what_rules_of_remapping_make_it(ros_args, own, others):
    assert tracker_name(ros_args.split()) == own and tracker_name(ros_args.split(), renamed=False) == others
