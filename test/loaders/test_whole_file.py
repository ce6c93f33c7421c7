"""Files that are written whole or not at all."""

import errno
import os
import zipfile
from pathlib import Path

import numpy as np
import pytest

from helpers.sources.small_disk import limited_files, small_disk
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.masks.reference import load_reference_masks
from tracker_node.loaders.csv_file import CsvTable
from tracker_node.loaders.json_values import read_json
from tracker_node.loaders.keypoints.formats import load_points
from tracker_node.loaders.layouts import ViewedGraph, write_foxglove_layout, write_plotjuggler_layout
from tracker_node.loaders.model.mesh_file import read_texture
from tracker_node.loaders.model.urdf_xml import read_robot
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.rig.calibration_toml import dump_calibration_toml, load_pose2sim
from tracker_node.loaders.rig.control_points import dump_dlt
from tracker_node.loaders.rig.formats import detect
from tracker_node.loaders.rig.opencv_storage import dump_opencv, load_opencv
from tracker_node.loaders.rig.qualisys_xml import dump_qualisys, load_qualisys
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.loaders.whole_file import SETTINGS_BYTES, TABLE_BYTES, read_bytes, whole_file, write_whole
from tracker_node.report.metrics_file import write_metrics
from tracker_node.runs.config_file import load_config

__all__ = ["small_disk"]

LENS = CameraModel(640, 480, np.array([[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]))
RIG = CameraRig((Camera("left", LENS, np.eye(4)),))
GRAPH = ViewedGraph(("left",), (("elbow", 0),), "world")
WRITERS = {
    "dlt.csv": lambda path: dump_dlt(np.ones((3, 11)) / 3.0, path),
    "rig.toml": lambda path: dump_calibration_toml(RIG, path),
    "rig.qca.txt": lambda path: dump_qualisys(RIG, path),
    "rig.yml": lambda path: dump_opencv(RIG, path),
    "foxglove.json": lambda path: write_foxglove_layout(GRAPH, path),
    "plotjuggler.xml": lambda path: write_plotjuggler_layout(GRAPH, path),
    "figures.json": lambda path: write_metrics(path, {"a": 1.0}),
}


def test_another_file_takes_the_place_at_the_end_and_not_before(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with whole_file(path, ".part") as draft:
        draft.write_text("new")
        assert path.read_text() == "old" and draft.parent == tmp_path and draft.suffix == ".part"
    assert path.read_text() == "new" and [file.name for file in tmp_path.iterdir()] == ["a.txt"]


def test_whatever_goes_wrong_what_was_there_stays_and_nothing_is_left(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(KeyError), whole_file(path) as draft:
        draft.write_text("half of it")
        raise KeyError
    with limited_files(1000), pytest.raises(OSError) as caught:
        write_whole(path, "x" * 2000)
    assert caught.value.filename == str(path.resolve()) and caught.value.errno == errno.EFBIG
    assert path.read_text() == "old" and [file.name for file in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("name", WRITERS)
def test_writers_replace_files_only_as_a_whole(tmp_path, name):
    path = tmp_path / name
    path.write_text("old")
    with limited_files(100), pytest.raises(OSError) as caught:
        WRITERS[name](path)
    assert caught.value.filename == str(path.resolve()) and caught.value.errno == errno.EFBIG
    assert path.read_text() == "old" and list(tmp_path.iterdir()) == [path]
    WRITERS[name](path)
    assert path.stat().st_size > 100 and list(tmp_path.iterdir()) == [path]


def test_a_full_disk(small_disk):
    path = small_disk(1) / "a.txt"
    write_whole(path, "old" * 100_000)
    with pytest.raises(OSError, match="No space left on device") as caught:
        write_whole(path, "new" * 300_000)
    assert caught.value.filename == str(path.resolve())
    assert path.read_text() == "old" * 100_000 and list(path.parent.iterdir()) == [path]


def test_what_is_no_file_is_not_replaced(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "null").symlink_to("/dev/null")
    for name in ("folder", "null", "absent/a.txt"):
        with pytest.raises(OSError) as caught:
            write_whole(tmp_path / name, "text")
        assert caught.value.filename == str((tmp_path / name).resolve())
    assert (tmp_path / "null").is_symlink() and sorted(file.name for file in tmp_path.iterdir()) == ["folder", "null"]


def test_the_name_of_another_file_that_fails_is_kept(tmp_path):
    with pytest.raises(FileNotFoundError) as caught, whole_file(tmp_path / "a.txt") as draft:
        draft.write_text((tmp_path / "absent").read_text())
    assert caught.value.filename == str(tmp_path / "absent") and list(tmp_path.iterdir()) == []


READERS = [
    load_rig, load_config, load_pose2sim, load_qualisys, load_trc, read_robot, detect, read_json, load_reference_masks, CsvTable,
    lambda path: load_opencv([path]), lambda path: read_texture(path, "model.yaml", "texture"),
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
        with pytest.raises(FileFormatError, match=r"a regular file|at most [\d ]+ MB|existing texture"):
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
        load_points(path)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        member = b" " * 4_000_000
        for i in range(501):
            archive.writestr(f"cam1/a_{i}.json", member)
    with pytest.raises(FileFormatError, match=r"at most 2000 MB unpacked, got '2004 MB'"):
        load_points(path)
