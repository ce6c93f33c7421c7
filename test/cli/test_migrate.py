"""``tracker_node migrate``: parameter files of version 0.1."""

from pathlib import Path

import pytest

from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError
from tracker_node.loaders.rig.rig_yaml import read_rig_file
from tracker_node.runs.config_file import load_config

OLD = """# by hand
/**:
  ros__parameters:
    engine: color
    color: {representation: affine, search_radius: 0.45}
    evidence: {canny_high: 90.0}
    start: {keep: 3}
"""


def test_a_file_is_rewritten_and_the_old_one_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "tracker.yaml"
    file.write_text(OLD)
    assert main(["migrate", str(file)]) == 0
    config = load_config(file)
    assert (config.modalities, config.texture.search_radius, config.initialization.candidates) == (("texture",), 0.45, 3)
    assert (tmp_path / "tracker.yaml.old").read_text() == OLD
    said = capsys.readouterr()
    assert "tracker.yaml.old" in said.out and "left out: chamfer.canny_high" in said.err
    file.write_text(OLD)
    assert main(["migrate", str(file)]) == 2 and "tracker.yaml.old" in capsys.readouterr().err
    assert file.read_text() == OLD


def test_another_place_and_what_no_version_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, other = tmp_path / "tracker.yaml", tmp_path / "new.yaml"
    file.write_text("region: {clamp: 3.0}\n")
    assert main(["migrate", str(file), "-o", str(other)]) == 0
    assert load_config(other).region.max_log_ratio == 3.0 and file.read_text() == "region: {clamp: 3.0}\n"
    file.write_text("region: {clam: 3.0}\n")
    assert main(["migrate", str(file), "-o", str(other)]) == 2
    assert "region.clam" in capsys.readouterr().err


def test_a_rig_keeps_its_comments(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    entry = "image_size: [64, 48], K: [[50, 0, 32], [0, 50, 24], [0, 0, 1]], T_world_cam: {}".format(
        "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]"
    )
    file = tmp_path / "rig.yaml"
    file.write_text(f"# my room\ncameras:\n  a: {{{entry}, plate: a.png}}\n  b: {{{entry}}}\n")
    with pytest.raises(FileFormatError, match=r"background \(`tracker_node migrate`") as caught:
        read_rig_file(file)
    assert caught.value.field == "cameras.a.plate"
    assert main(["migrate", str(file)]) == 0
    assert read_rig_file(file).cameras["a"].background == "a.png" and file.read_text().startswith("# my room")
