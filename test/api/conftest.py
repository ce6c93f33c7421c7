"""A small clip, and what the command line makes of it."""

from pathlib import Path

import pytest

from helpers.cameras import small_clip
from helpers.docs.place import Shelf
from tracker_node.cli.main import main


@pytest.fixture(scope="session")
def shelf(tmp_path_factory) -> Shelf:
    """With the clip ``arm``, tracked by the command line, and its true joints in ``truth.csv``."""
    return Shelf(tmp_path_factory.mktemp("api"))


@pytest.fixture(scope="session")
def folder(shelf) -> Path:
    """rig.yaml, model.yaml, start.yaml, truth.csv, recording.yaml, and ``run``: that recording by ``track``."""
    folder = shelf.arm
    text = "rig: rig.yaml\nmodel: model.yaml\ninitial_state: start.yaml\noutput: described\nimages: {start: 2, end: 8}\n"
    (folder / "recording.yaml").write_text(text)
    assert main(["track", str(folder / "recording.yaml"), "--quiet", "--output", str(folder / "by_command")]) == 0
    return folder


@pytest.fixture(scope="session")
def model():
    return small_clip.body()
