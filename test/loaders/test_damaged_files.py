"""Other programs' files, damaged or strange in ways that their libraries do not foresee: one line that names the file."""

import json
import struct
import zipfile
from decimal import Decimal

import numpy as np
import pytest

from helpers.cameras.small_clip import body
from tracker_node.errors import FileFormatError, SourceError
from tracker_node.evaluation.masks.reference import load_reference_masks
from tracker_node.loaders.images.recorded_source import SourceOptions
from tracker_node.loaders.images.stamps import MOST_NS, load_stamp_file
from tracker_node.loaders.json_values import parse_json
from tracker_node.loaders.keypoints.formats import load_points
from tracker_node.loaders.motion.trajectory_file import StateRow, StateTrajectory, read_states, write_states
from tracker_node.loaders.rig.qualisys_xml import load_qualisys
from tracker_node.runs.load import load_run

DEEP = "[" * 100_000


def archive(path, compression=zipfile.ZIP_DEFLATED) -> bytes:
    people = json.dumps({"people": [{"pose_keypoints_2d": list(range(75))}] * 20})
    with zipfile.ZipFile(path, "w", compression) as opened:
        opened.writestr("cam1/cam1_0001.json", people)
    return path.read_bytes()


def set_in_headers(data: bytes, local: int, central: int, value: int) -> bytes:
    """A field of 16 bits of both headers of the one file."""
    changed = bytearray(data)
    struct.pack_into("<H", changed, local, value)
    struct.pack_into("<H", changed, data.index(b"PK\x01\x02") + central, value)
    return bytes(changed)


ARCHIVES = {
    "damaged data": lambda data: data[:80] + bytes(30) + data[110:],
    "encrypted": lambda data: set_in_headers(data, 6, 8, 1),
    "unknown packing": lambda data: set_in_headers(data, 8, 10, 99),
    "another packing": lambda data: set_in_headers(data, 8, 10, zipfile.ZIP_LZMA),
    "no end": lambda data: data[:-30],
    "wrong place of the file": lambda data: data.replace(b"cam1/cam1_0001", b"cam1/cam1_0002", 1),
}


@pytest.mark.parametrize("kind", ARCHIVES)
def test_damaged_archives_of_points(tmp_path, kind):
    path = tmp_path / "points.zip"
    path.write_bytes(ARCHIVES[kind](archive(path)))
    with pytest.raises(FileFormatError, match=r"points\.zip"):
        load_points(path)


@pytest.mark.parametrize("points", [DEEP, "1" * 5000, json.dumps([10**400] * 3)])
def test_points_without_end(tmp_path, points):
    (tmp_path / "cam1").mkdir()
    (tmp_path / "cam1/cam1_1.json").write_text(f'{{"people": [{{"pose_keypoints_2d": {points}}}]}}')
    with pytest.raises(FileFormatError, match=r"cam1_1\.json"):
        load_points(tmp_path)


@pytest.mark.parametrize("encoding", ["klingon", "utf-7", "shift_jisx0213", "idna"])
def test_a_calibration_in_an_unknown_encoding(tmp_path, encoding):
    path = tmp_path / "c.qca.txt"
    path.write_text(f'<?xml version="1.0" encoding="{encoding}"?><calibration><cameras/></calibration>')
    with pytest.raises(FileFormatError, match=r"c\.qca\.txt"):
        load_qualisys(path)


MASKS = {
    "deep": DEEP,
    "number": '{"cameras": {"cam1": {"image_size": [9, 9], "polygons": {"\u00b2": []}}}}',
    "long number": f'{{"cameras": {{"cam1": {{"image_size": [9, 9], "polygons": {{"{"9" * 5000}": []}}}}}}}}',
    "size": '{"cameras": {"cam1": {"image_size": [9, 1000000000], "still": ""}}}',
    "outline": f'{{"cameras": {{"cam1": {{"image_size": [9, 9], "polygons": {{"1": [[{10**400}, 1, 2, 3, 4, 5]]}}}}}}}}',
}


@pytest.mark.parametrize("kind", MASKS)
def test_masks_that_cannot_be_meant(tmp_path, kind):
    path = tmp_path / "masks.json"
    path.write_text(MASKS[kind])
    with pytest.raises(FileFormatError, match=r"masks\.json"):
        load_reference_masks(path)


def test_nearly_endless_values_are_not_shown():
    """They can just be read, but not be written into a message."""
    value: list = []
    for _ in range(5000):
        value = [value]
    assert "a list that is too long to be shown" in str(FileFormatError("f", "x", "a number", value))
    assert parse_json("[1]", "f") == [1]


@pytest.mark.parametrize("time", ["1e30", "1e999999", "-1e30", str(Decimal(2**31)), "9" * 400])
def test_stamps_beyond_what_ros_holds(tmp_path, time):
    path = tmp_path / "timestamps.csv"
    path.write_text(f"camera,time\ncam1,{time}\n")
    with pytest.raises(FileFormatError, match=r"line 2.*2147483647"):
        load_stamp_file(path, "cam1")
    path.write_text(f"camera,time_ns\ncam1,{MOST_NS}\n")
    assert load_stamp_file(path, "cam1") == (MOST_NS,)


def test_stamps_of_a_trajectory_beyond_int64(tmp_path):
    names = tuple(body().chain.dof_names)
    row = StateRow(5, "TRACKING", "", np.zeros(len(names)), 0.0, 0.0, 1, 1)
    path = tmp_path / "states.csv"
    write_states(path, StateTrajectory(names, (row,)))
    path.write_text(path.read_text().replace("\n5,", f"\n{2**63},"))
    for read in (read_states, load_run):
        with pytest.raises(FileFormatError, match=r"line 2, column 'stamp_ns'.*64 bits"):
            read(path if read is read_states else tmp_path)


def test_an_offset_that_takes_stamps_beyond_what_ros_holds(tmp_path):
    from tracker_node.loaders.images.source import FolderSource

    (tmp_path / "1.png").write_bytes(PNG)
    source = FolderSource(str(tmp_path), SourceOptions(base_stamp_ns=2**63))
    with pytest.raises(SourceError, match="beyond what a ROS time can hold"):
        source.stamp_ns(0)


PNG = bytes.fromhex(
    "89504e470d0a1a0a0000000d49484452000000010000000108000000003a7e9b550000000a49444154789c636000000002000148afa4710000000049454e44ae426082"
)
