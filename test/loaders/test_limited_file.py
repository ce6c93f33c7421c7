"""No file fills the memory or holds up the process: devices, pipes and what is too large are refused in one line."""

import os
import zipfile
from pathlib import Path

import pytest

from tracker_node.errors import FileFormatError
from tracker_node.evaluation.masks.reference import load_reference_masks
from tracker_node.loaders.csv_file import CsvTable
from tracker_node.loaders.json_values import read_json
from tracker_node.loaders.limited_file import SETTINGS_BYTES, TABLE_BYTES, read_bytes
from tracker_node.loaders.model.urdf_xml import read_robot
from tracker_node.loaders.motion.openpose_json import load_openpose
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.picture_file import read_picture
from tracker_node.loaders.rig.formats import detect
from tracker_node.loaders.rig.opencv_storage import load_opencv
from tracker_node.loaders.rig.pose2sim_toml import load_pose2sim
from tracker_node.loaders.rig.qualisys_xml import load_qualisys
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.runs.config_file import load_config

READERS = [
    load_rig, load_config, load_pose2sim, load_qualisys, load_trc, read_robot, detect, read_json, load_reference_masks, CsvTable,
    lambda path: load_opencv([path]), lambda path: read_picture(path, "model.yaml", "texture"),
]  # fmt: skip


def sparse(path: Path, size: int) -> Path:
    with path.open("wb") as stream:
        stream.truncate(size)
    return path


@pytest.mark.parametrize("reader", READERS)
def test_devices_pipes_and_giants_are_refused(tmp_path: Path, reader) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "zero").symlink_to("/dev/zero")
    for path in (tmp_path / "pipe", tmp_path / "zero", sparse(tmp_path / "giant", TABLE_BYTES + 1)):
        with pytest.raises(FileFormatError, match=r"a regular file|at most [\d ]+ MB|existing picture"):
            reader(path)


def test_the_limit_and_the_size_are_told(tmp_path: Path) -> None:
    path = sparse(tmp_path / "rig.yaml", 40_000_000)
    with pytest.raises(FileFormatError, match=r"rig.yaml.*at most 16 MB, got '40 MB'"):
        load_rig(path)
    assert len(read_bytes(sparse(tmp_path / "fits", SETTINGS_BYTES))) == SETTINGS_BYTES


def test_a_file_that_does_not_say_its_size(tmp_path: Path) -> None:
    (tmp_path / "maps").symlink_to("/proc/self/maps")
    with pytest.raises(FileFormatError, match="at most"):
        read_bytes(tmp_path / "maps", limit=10)


def test_archives_unpack_to_a_limit(tmp_path: Path) -> None:
    path = tmp_path / "points.zip"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("cam1/a_0.json", b" " * 5_000_000)
    with pytest.raises(FileFormatError, match=r"cam1/a_0.json.*at most 4 MB of JSON, got '5 MB'"):
        load_openpose(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        member = b" " * 4_000_000
        for i in range(501):
            archive.writestr(f"cam1/a_{i}.json", member)
    with pytest.raises(FileFormatError, match=r"at most 2000 MB unpacked, got '2004 MB'"):
        load_openpose(path)
