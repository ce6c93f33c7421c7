"""Names of cameras on the command line become names of topics."""

import argparse

import pytest

from tracker_node.cli.nodes.camera_ingest import named_source


def test_a_camera_and_its_source():
    assert named_source("left_2=rtsp://host/a?b=c") == ("left_2", "rtsp://host/a?b=c")


@pytest.mark.parametrize(
    ("text", "message"),
    [("käse=a.mp4", "'käse': expected a-z"), ("a b=a.mp4", "expected CAMERA=SOURCE"), ("left=", "expected CAMERA=SOURCE")],
)
def test_names_that_no_topic_can_have_are_refused(text: str, message: str):
    with pytest.raises(argparse.ArgumentTypeError, match=message):
        named_source(text)
