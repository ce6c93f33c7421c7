"""Calibrations of OpenCap: a pickle for each camera, ``Cam*/cameraIntrinsicsExtrinsics.pickle``.

``imageSize`` (height, width), ``intrinsicMat`` (3 x 3), ``distortion`` (k1 k2 p1 p2 k3), ``rotation`` (3 x 3) and ``translation``
(millimeters), from the checkerboard to the camera. A pickle can run any code where it is read. Here nothing of it is called: what
stands for arrays of numpy, of any version, becomes plain arrays of numbers, and everything else is refused.
"""

from __future__ import annotations

import io
import pickle
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...camera.rig import Camera, CameraRig
from ...errors import FileFormatError
from ...geometry import se3
from ..source_address import identifier
from ..whole_file import read_bytes
from .lens import array_of, lens_of, pose_of, rig_of, size_of

MM = 1000.0
FILE_NAME = "cameraIntrinsicsExtrinsics.pickle"
_MOST_BYTES = 1_000_000
_NUMBERS = re.compile(r"[<>=|]?(?:[iu][1248]|f[248])")  # codes of numpy
_EXPECTED = "numbers and arrays of numpy alone, as OpenCap writes them"


def load_opencap(paths: Sequence[str | Path]) -> CameraRig:
    """The rig of a session's pickles; each camera has the name of its folder. The world is the checkerboard's, in meters.

    Raises
    ------
    FileFormatError : no such file, one that is damaged or holds something else than numbers, a field that is missing or wrong.
    CalibrationError : for a camera without calibration (focal length 0).
    """
    return rig_of(paths[0] if paths else FILE_NAME, "(folder)", [_camera(Path(path)) for path in paths])


def _camera(path: Path) -> Camera:
    values, name = _values(path), identifier(path.absolute().parent.name)
    sides = array_of(path, "imageSize", values["imageSize"]).ravel().tolist()
    if len(sides) != 2:
        raise FileFormatError(path, "imageSize", "height and width", sides)
    size = size_of(path, "imageSize", sides[1], sides[0])
    K = array_of(path, "intrinsicMat", values["intrinsicMat"], (3, 3))
    distortion = array_of(path, "distortion", values["distortion"]).ravel()
    lens = lens_of(path, ("intrinsicMat", "distortion"), name, size, K, distortion)
    rotation, translation = (array_of(path, part, values[part]) for part in ("rotation", "translation"))
    return Camera(name, lens, se3.inverse(pose_of(path, "rotation", rotation, translation / MM)))


def _values(path: Path) -> dict[str, Any]:
    """The fields that are used."""
    content = read_bytes(path, _MOST_BYTES)
    try:
        values = _NumbersOnly(io.BytesIO(content)).load()
    except Exception as error:  # damaged pickles raise nearly anything
        raise FileFormatError(path, "(content)", f"a pickle with {_EXPECTED}", str(error) or type(error).__name__) from None
    if not isinstance(values, dict):
        raise FileFormatError(path, "(content)", "a pickled dictionary", type(values).__name__)
    found = {}
    for name in ("imageSize", "intrinsicMat", "distortion", "rotation", "translation"):
        if name not in values:
            raise FileFormatError(path, name, "an array", "none")
        value = values[name]
        found[name] = value.array if isinstance(value, _Array) else value
    return found


class _NumbersOnly(pickle.Unpickler):
    """Puts what stands for numbers in numpy's place; any other name is an error, whatever it would do."""

    def find_class(self, module: str, name: str) -> Any:
        place = module.replace("numpy._core", "numpy.core")  # renamed in numpy 2
        found = _STAND_INS.get((place, name))
        if found is None:
            raise pickle.UnpicklingError(f"{module}.{name}")
        return found

    def persistent_load(self, pid: Any) -> Any:
        raise pickle.UnpicklingError("a reference to something outside")


class _Array:
    """Stands for ``numpy.ndarray``, which is made empty and gets its content afterwards."""

    array: np.ndarray

    def __init__(self, *_: Any):
        self.array = np.zeros(0)

    def __setstate__(self, state: tuple) -> None:
        _, shape, kind, by_columns, raw = state
        self.array = _numbers(raw, kind, shape, "F" if by_columns else "C")


class _Kind:
    """Stands for ``numpy.dtype``."""

    def __init__(self, code: str, *_: Any):
        self.code = code

    def __setstate__(self, state: tuple) -> None:
        self.code = f"{state[1]}{self.code}"


def _numbers(raw: Any, kind: Any, shape: Any, order: Any = "C") -> np.ndarray:
    if not isinstance(kind, _Kind) or not _NUMBERS.fullmatch(kind.code):
        raise pickle.UnpicklingError(f"an array of {getattr(kind, 'code', type(kind).__name__)}")
    if not isinstance(raw, (bytes, bytearray)):
        raise pickle.UnpicklingError(f"an array made of {type(raw).__name__}")
    flat = np.frombuffer(raw, kind.code)
    return flat.reshape(shape, order=order).astype(np.float64)


def _from_buffer(raw: Any, kind: Any, shape: Any, order: Any) -> _Array:
    made = _Array()
    made.array = _numbers(raw, kind, shape, order)
    return made


def _encoded(text: str, encoding: str) -> bytes:
    """Bytes in pickles of old protocols."""
    return text.encode({"latin1": "latin1", "latin-1": "latin1"}[encoding])


_STAND_INS = {
    ("numpy", "ndarray"): _Array,
    ("numpy", "dtype"): _Kind,
    ("numpy.core.multiarray", "_reconstruct"): lambda *_: _Array(),
    ("numpy.core.multiarray", "scalar"): lambda kind, raw: float(_numbers(raw, kind, ())),
    ("numpy.core.numeric", "_frombuffer"): _from_buffer,
    ("_codecs", "encode"): _encoded,
}
