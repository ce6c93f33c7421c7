"""OpenCap's pickles: read as numbers, whatever wrote them, and never run."""

import io
import os
import pickle
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.sources import projects
from tracker_node.errors import CalibrationError, FileFormatError
from tracker_node.loaders.rig.opencap_pickle import load_opencap

FILE = "Videos/Cam0/cameraIntrinsicsExtrinsics.pickle"


def written(folder: Path, protocol: int = 4, **changes) -> list[Path]:
    """Pickles of a session, with some values of the first camera changed."""

    def dump(values, stream):
        first = str(stream.name).endswith(FILE)
        stream.write(pickle.dumps({**values, **(changes if first else {})}, protocol))

    projects.opencap(folder, dump=dump)
    return sorted(folder.rglob("*.pickle"))


@pytest.mark.parametrize("protocol", range(pickle.HIGHEST_PROTOCOL + 1))
@pytest.mark.parametrize("by_columns", [False, True])
def test_pickles_of_every_protocol(tmp_path, protocol, by_columns):
    K = np.asarray(projects.rig().cameras[0].model.K, order="F" if by_columns else "C")
    files = written(
        tmp_path, protocol, intrinsicMat=K, rotation_EulerAngles=[np.float64(0.5), 3], imageSize=np.array([480.0, 640.0])
    )
    rig = load_opencap(files)
    assert rig.names == ("Cam0", "Cam1", "Cam2")
    point = np.array([[0.1, 0.2, 0.9]])
    for file, camera in zip(files, rig, strict=True):
        values = pickle.loads(file.read_bytes())
        numbers = (values["rotation"], values["translation"], values["intrinsicMat"], values["distortion"])
        expected = cv2.projectPoints(1000.0 * point @ projects.WALL, *numbers)[0][0, 0]
        np.testing.assert_allclose(camera.project(point @ projects.WALL)[0][0], expected, atol=1e-9)
        assert (camera.model.width, camera.model.height) == (640, 480)


def test_pickles_of_numpy_1(tmp_path):
    """What numpy 2 calls ``numpy._core`` was ``numpy.core``; the text of protocol 0 lets it be renamed."""
    files = written(tmp_path, 0)
    expected = load_opencap(files)
    assert b"numpy._core" in files[0].read_bytes()
    for file in files:
        file.write_bytes(file.read_bytes().replace(b"numpy._core", b"numpy.core"))
    for a, b in zip(load_opencap(files), expected, strict=True):
        np.testing.assert_array_equal(a.T_world_cam, b.T_world_cam)


class Evil:
    """Leaves a file behind where it is unpickled."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self):
        return os.mkdir, (str(self.path),)


@pytest.mark.parametrize("protocol", [0, 2, 4, 5])
def test_nothing_in_a_pickle_is_run(tmp_path, protocol):
    for what in (Evil(tmp_path / "done"), np.array([Evil(tmp_path / "done")], dtype=object)):
        file = tmp_path / FILE
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(pickle.dumps({"intrinsicMat": what}, protocol))
        with pytest.raises(FileFormatError, match="numbers and arrays of numpy alone"):
            load_opencap([file])
        assert not (tmp_path / "done").exists()
        pickle.loads(file.read_bytes())
        os.rmdir(tmp_path / "done")  # it does run where it may


def test_names_that_lead_to_functions_by_a_detour(tmp_path):
    for module, name in (
        ("numpy", "ndarray.tofile"),
        ("numpy.core.multiarray", "fromfile"),
        ("builtins", "eval"),
        ("numpy", "load"),
    ):
        file = tmp_path / FILE
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(
            b"\x80\x04"
            + b"\x8c"
            + bytes([len(module)])
            + module.encode()
            + b"\x8c"
            + bytes([len(name)])
            + name.encode()
            + b"\x93."
        )
        with pytest.raises(FileFormatError, match=r"(numpy|builtins)"):
            load_opencap([file])


def test_damaged_pickles_are_named(tmp_path):
    files = written(tmp_path)
    content = files[0].read_bytes()
    for end in range(0, len(content), 7):
        files[0].write_bytes(content[:end])
        with pytest.raises(FileFormatError) as caught:
            load_opencap(files)
        assert caught.value.file == str(files[0])
    rng = np.random.default_rng(1)
    for _ in range(400):
        changed = bytearray(content)
        for place in rng.integers(0, len(content), 3):
            changed[place] = rng.integers(0, 256)
        files[0].write_bytes(bytes(changed))
        try:
            load_opencap(files)
        except (FileFormatError, CalibrationError) as error:
            assert str(files[0]) in str(error)


@pytest.mark.parametrize(
    ("changes", "field"),
    [
        ({"imageSize": np.array([[480]])}, "imageSize"),
        ({"imageSize": np.array([[480.5], [640]])}, "imageSize"),
        ({"intrinsicMat": np.eye(4)}, "intrinsicMat"),
        ({"intrinsicMat": np.array([["a", "b", "c"]] * 3)}, "(content)"),
        ({"intrinsicMat": "K"}, "intrinsicMat"),
        ({"distortion": np.zeros((1, 3))}, "distortion"),
        ({"rotation": np.diag([1.0, 1.0, -1.0])}, "rotation"),
        ({"rotation": np.array([0.0, np.nan, 0.0])}, "rotation"),
        ({"translation": np.zeros(2)}, "rotation"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, changes, field):
    files = written(tmp_path, **changes)
    with pytest.raises(FileFormatError) as caught:
        load_opencap(files)
    assert (caught.value.file, caught.value.field) == (str(files[0]), field)


def test_fields_that_are_missing_other_objects_and_uncalibrated_cameras(tmp_path):
    files = written(tmp_path, intrinsicMat=np.diag([0.0, 0.0, 1.0]))
    with pytest.raises(CalibrationError, match="camera 'Cam0': uncalibrated"):
        load_opencap(files)
    stream = io.BytesIO(files[1].read_bytes())
    values = pickle.load(stream)
    del values["rotation"]
    for content, field in ((values, "rotation"), ([1, 2], "(content)")):
        files[1].write_bytes(pickle.dumps(content))
        with pytest.raises(FileFormatError) as caught:
            load_opencap(files[1:])
        assert caught.value.field == field
    with pytest.raises(FileFormatError, match="no such file"):
        load_opencap([tmp_path / "none.pickle"])
