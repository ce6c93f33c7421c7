"""Files that a verb cannot, or must not, write: one line, and what is there stays."""

from types import SimpleNamespace

import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.cli.arguments.run_images import refuse_to_overwrite
from tracker_node.cli.main import main
from tracker_node.errors import TrackerError
from tracker_node.loaders.rig.camera_info import dump_camera_info
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.loaders.yaml_file import write_mapping


def test_a_place_that_cannot_be_written_to_is_one_line(tmp_path, capsys):
    dump_camera_info("cam01", circle_rig(1).cameras[0].model, tmp_path / "cam01.yaml")
    (tmp_path / "file").write_text("no folder")
    assert main(["rig", "import", str(tmp_path / "cam01.yaml"), "-o", str(tmp_path / "file/rig.yaml")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and str(tmp_path / "file") in error


def test_nothing_is_left_where_a_mapping_cannot_be_put(tmp_path):
    (tmp_path / "rig.yaml").mkdir()
    with pytest.raises(OSError) as caught:
        write_mapping({"a": 1}, tmp_path / "rig.yaml")
    assert caught.value.filename == str(tmp_path / "rig.yaml")
    assert [path.name for path in tmp_path.iterdir()] == ["rig.yaml"]


@pytest.mark.parametrize("force", [False, True])
def test_folders_and_two_outputs_of_one_name_are_refused(tmp_path, force):
    args = SimpleNamespace(force=force)
    refuse_to_overwrite(args, tmp_path / "a.yaml", tmp_path / "a.json")
    with pytest.raises(TrackerError, match="got a folder"):
        refuse_to_overwrite(args, tmp_path)
    with pytest.raises(TrackerError, match="are one file"):
        refuse_to_overwrite(args, tmp_path / "a.json", str(tmp_path / "b" / ".." / "a.json"))


def test_figures_do_not_go_over_the_rig(tmp_path, capsys):
    write_rig_file(rig_file_of(circle_rig(2)), tmp_path / "rig.yaml")
    output = tmp_path / "timed.json"
    assert main(["synchronize", "--rig", str(tmp_path / "rig.yaml"), "-o", str(output)]) == 2
    assert "are one file" in capsys.readouterr().err and not output.exists()
