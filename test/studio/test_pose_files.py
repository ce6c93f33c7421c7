"""Poses by name: nothing outside of the folder, nothing overwritten unasked."""

import numpy as np
import pytest

from helpers.cameras.small_clip import body, motion
from tracker_node.errors import FileFormatError
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.studio.live.page import Errand, LivePage
from tracker_node.studio.session import ExistsError, PoseFiles, StudioFiles, StudioSession

STATE, OTHER = motion(2)


def test_a_saved_pose_is_a_state_file(tmp_path):
    files = PoseFiles(tmp_path / "poses")
    assert files.names() == []
    path = files.save("first", STATE, body(), "By hand.")
    assert path == tmp_path / "poses/first.yaml" and path.read_text().startswith("# By hand.")
    np.testing.assert_allclose(load_state(path, body()).joint_positions, STATE.joint_positions, atol=1e-12)
    assert files.names() == ["first.yaml"]
    np.testing.assert_allclose(files.load("first.yaml", body()).T_world_root, STATE.T_world_root, atol=1e-12)


def test_nothing_is_overwritten_unasked(tmp_path):
    files = PoseFiles(tmp_path)
    path = files.save("pose.yaml", STATE, body(), "")
    before = path.read_bytes()
    with pytest.raises(ExistsError, match=r"pose\.yaml is there already"):
        files.save("pose", OTHER, body(), "")
    assert path.read_bytes() == before
    files.save("pose", OTHER, body(), "", overwrite=True)
    assert path.read_bytes() != before


def test_what_is_no_state_is_never_overwritten(tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text("cameras: {}\n")
    with pytest.raises(FileFormatError, match=r"rig\.yaml"):
        PoseFiles(tmp_path).save("rig", STATE, body(), "", overwrite=True)
    assert rig.read_text() == "cameras: {}\n"


@pytest.mark.parametrize("name", ["../pose", "/tmp/pose", "a/b", "..", ".hidden", "", "nul\0", "c:\\pose", "x" * 200, "a\nb"])
def test_names_lead_nowhere_else(tmp_path, name):
    files = PoseFiles(tmp_path / "poses")
    for attempt in (lambda: files.save(name, STATE, body(), ""), lambda: files.load(name, body())):
        with pytest.raises(FileFormatError, match="name"):
            attempt()
    assert not (tmp_path / "pose.yaml").exists()


def test_a_link_out_of_the_folder_is_not_followed(tmp_path):
    outside = tmp_path / "outside.yaml"
    outside.write_text("precious: 1\n")
    (tmp_path / "poses").mkdir()
    (tmp_path / "poses/pose.yaml").symlink_to(outside)
    files = PoseFiles(tmp_path / "poses")
    with pytest.raises(FileFormatError):
        files.save("pose", STATE, body(), "", overwrite=True)
    assert outside.read_text() == "precious: 1\n"
    assert files.names() == []
    live = LivePage(StudioSession(StudioFiles(folder=tmp_path / "poses"), model=body()))
    assert live.facts()["states"] == []
    with pytest.raises(FileFormatError, match="file"):
        live.ask(Errand(tracker="/tracker", service="set_state", file="pose.yaml"))
