"""OpenCV's files read without OpenCV: the same numbers, and nothing that a file holds ends the process."""

import random
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.errors import TrackerError
from tracker_node.geometry import se3
from tracker_node.loaders.rig.opencv_storage import dump_opencv, load_opencv, read_storage

MATRIX = np.array([[1681.25, 0.0, 533.0], [0.0, 1.5e-7, -948.125], [0.0, 0.0, 1.0]])
N_FUZZED = 300  # of each format


def written(extension: str) -> str:
    storage = cv2.FileStorage(extension, cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("camera_matrix", MATRIX)
    storage.write("distortion_coefficients", np.arange(5.0)[None] / 7)
    storage.write("pairs", np.arange(12, dtype=np.int32).reshape(2, 3, 2))
    storage.write("image_width", 640)
    storage.write("image_height", 480)
    storage.write("camera_model", "pin hole")
    storage.startWriteStruct("cameras_", cv2.FILE_NODE_SEQ)
    for i in range(2):
        storage.startWriteStruct("", cv2.FILE_NODE_MAP)
        storage.write("name", f"left{i}")
        storage.endWriteStruct()
    storage.endWriteStruct()
    return storage.releaseAndGetString()


@pytest.mark.parametrize("extension", [".yml", ".xml", ".json"])
def test_what_opencv_writes_is_read(tmp_path: Path, extension: str) -> None:
    path = tmp_path / f"a{extension}"
    path.write_text(written(extension))
    nodes = read_storage(path)
    np.testing.assert_allclose(nodes["camera_matrix"], MATRIX, rtol=1e-15)
    np.testing.assert_allclose(nodes["distortion_coefficients"], np.arange(5.0)[None] / 7, rtol=1e-15)
    assert nodes["pairs"].tolist() == np.arange(12).reshape(2, 3, 2).tolist()
    assert (nodes["image_width"], nodes["camera_model"]) == (640, "pin hole")
    assert [camera["name"] for camera in nodes["cameras_"]] == ["left0", "left1"]


ARRAYS = {
    ".yml": "%YAML:1.0\n---\nd: !!opencv-nd-matrix\n   sizes: [ 3 ]\n   dt: d\n   data: [ 0., 1., 2. ]\n"
    "e: !!opencv-nd-matrix { sizes: [ 2, 1 ], dt: d, data: [ 3., 4. ] }\n",
    ".xml": '<?xml version="1.0"?><opencv_storage><d type_id="opencv-nd-matrix"><sizes>\n    3</sizes><dt>d</dt><data>\n 0. 1. 2.'
    '</data></d><e type_id="opencv-nd-matrix"><sizes>2 1</sizes><dt>d</dt><data>3. 4.</data></e></opencv_storage>',
    ".json": '{"d": {"type_id": "opencv-nd-matrix", "sizes": [3], "dt": "d", "data": [0.0, 1.0, 2.0]},'
    ' "e": {"type_id": "opencv-nd-matrix", "sizes": [2, 1], "dt": "d", "data": [3.0, 4.0]}}',
}


@pytest.mark.parametrize("extension", ARRAYS)
def test_arrays_as_opencv_5_writes_them_are_read(tmp_path: Path, extension: str) -> None:
    path = tmp_path / f"a{extension}"
    path.write_text(ARRAYS[extension])
    nodes = read_storage(path)
    assert nodes["d"].tolist() == [0.0, 1.0, 2.0]
    assert nodes["e"].tolist() == [[3.0], [4.0]]


DEEP = 100_000
ENTITIES = (f'<!ENTITY a{i} "&a{i - 1};&a{i - 1};">' for i in range(1, 30))
BOMB = '<!DOCTYPE a [<!ENTITY a0 "aaaaaaaaaa">' + "".join(ENTITIES)


@pytest.mark.parametrize(
    "text",
    [
        "%YAML:1.0\n---\na: " + "[" * DEEP, "%YAML:1.0\n---\na: " + "{b: " * DEEP, '{"a": ' + "[" * DEEP, '{"a": ' * DEEP,
        '<?xml version="1.0"?><opencv_storage>' + "<_>" * DEEP,
        "<opencv_storage>" + "<_>" * DEEP + "</_>" * DEEP + "</opencv_storage>",
        f'<?xml version="1.0"?>{BOMB}]><opencv_storage>&a29;</opencv_storage>', "%YAML:1.0\n---\nK: !!opencv-matrix [1]",
        "%YAML:1.0\n---\nK: !!opencv-matrix {rows: 1000000000, cols: 1000000000, dt: d, data: [1]}",
        "%YAML:1.0\n---\nK: !!opencv-matrix {rows: -3, cols: -3, dt: d, data: [1, 2, 3, 4, 5, 6, 7, 8, 9]}",
        "%YAML:1.0\n---\nK: !!opencv-nd-matrix {sizes: [3, 1, 3], dt: d, data: [1, 2, 3, 4, 5, 6, 7, 8, 9]}",
        '<?xml version="1.0" encoding="utf-9"?><opencv_storage/>', "<opencv_storage><K>" + "9" * 5000 + "</K></opencv_storage>",
    ],
)  # fmt: skip
def test_nothing_ends_the_process(tmp_path: Path, text: str) -> None:
    path = tmp_path / "a.yml"
    path.write_text(text)
    with pytest.raises(TrackerError) as error:
        load_opencv([path])
    assert len(str(error.value)) < 1000


@pytest.mark.parametrize("extension", [".yml", ".xml", ".json"])
def test_damaged_files_are_read_or_refused(tmp_path: Path, extension: str) -> None:
    sound, generator = written(extension).encode(), random.Random(17)
    path = tmp_path / f"a{extension}"
    refused = 0
    for _ in range(N_FUZZED):
        content = bytearray(sound)
        for _ in range(generator.randint(1, 8)):
            at = generator.randrange(len(content))
            kind = generator.randrange(3)
            content[at : at + generator.randint(1, 20) * (kind > 0)] = generator.randbytes(1) if kind < 2 else content[:at][-30:]
        path.write_bytes(content)
        try:
            load_opencv([path])
        except TrackerError:
            refused += 1
    assert refused > N_FUZZED // 4


def test_rotations_of_a_few_digits_are_taken_as_the_nearest_proper_ones(tmp_path: Path) -> None:
    """Five digits are rigid to 1e-5 only, a rig to 1e-6: that was no line, but an exception nobody had foreseen."""
    rig, path = circle_rig(3), tmp_path / "a.json"
    dump_opencv(rig, path)
    digits = re.compile(r"-?0\.[0-9]{6,}")
    path.write_text(digits.sub(lambda found: f"{float(found[0]):.5f}", path.read_text()))
    for camera, right in zip(load_opencv([path]), rig, strict=True):
        assert se3.is_rigid(camera.T_world_cam, tolerance=1e-12)
        np.testing.assert_allclose(camera.T_world_cam, right.T_world_cam, atol=1e-4)


def nested(levels: int, opened: str, closed: str, key: str) -> str:
    return '{"a": ' + opened * levels + key + closed * levels + "}"


@pytest.mark.parametrize(("opened", "closed"), [("[", "]"), ('{"b": ', "}")])
def test_twenty_levels_are_read_and_no_more(tmp_path: Path, opened: str, closed: str) -> None:
    path = tmp_path / "a.json"
    path.write_text(nested(20, opened, closed, "1"))
    node = read_storage(path)["a"]
    for _ in range(20):
        node = node[0] if isinstance(node, list) else node["b"]
    assert node == 1
    path.write_text(nested(21, opened, closed, "1"))
    with pytest.raises(TrackerError, match="at most 20 levels"):
        read_storage(path)
