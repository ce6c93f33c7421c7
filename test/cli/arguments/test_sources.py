"""``--sources``: one pattern for all cameras."""

import argparse

import pytest

from tracker_node.cli.arguments.cameras import add_sources_argument
from tracker_node.errors import SourceError
from tracker_node.loaders.source_address import sources_by_name


def test_each_camera_by_its_name_or_its_number_from_one():
    assert sources_by_name("videos/{name}.mp4", ["left", "right"]) == {"left": "videos/left.mp4", "right": "videos/right.mp4"}
    assert sources_by_name("c{number}.mp4", iter(("left", "right"))) == {"left": "c1.mp4", "right": "c2.mp4"}


def test_without_a_pattern_nothing_is_said():
    assert sources_by_name(None, ["left", "right"]) == {"left": None, "right": None}


def test_patterns_with_other_fields_are_refused():
    with pytest.raises(SourceError):
        sources_by_name("videos/{camera}.mp4", ["left"])
    with pytest.raises(SourceError):
        sources_by_name("gopher://{name}", ["left"])


def test_the_option_is_optional():
    parser = argparse.ArgumentParser()
    add_sources_argument(parser)
    assert parser.parse_args([]).sources is None
    assert parser.parse_args(["--sources", "{name}.mp4"]).sources == "{name}.mp4"
    assert "{number} counts from 1" in parser.format_help()
