"""Weights of the networks that find people: fetched from a wheel on the package index, checked and kept, or files of the user.

BlazePose comes with MediaPipe (Google, Apache-2.0). Its wheel is used as an archive and never installed; it is the same file
whatever this machine is.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from ..errors import FileFormatError, SourceError, TrackerError, extra_module
from ..observation.keypoints.blazepose import BlazePoseFiles
from .sample_files import Member, Wheel, cache_folder, cached_path, fetch

_WHEEL = Wheel(
    "mediapipe==0.10.9", "2c31ea1160c118daa50f7d43f0027d2480664568df53b7d7a7835b6e966f2cc2", ("3.11", "manylinux2014_x86_64")
)
DETECTOR, POINTS = "pose_detection.tflite", "pose_landmark_full.tflite"
_SHA256 = {
    DETECTOR: "9ba9dd3d42efaaba86b4ff0122b06f29c4122e756b329d89dca1e297fd8f866c",
    POINTS: "e9a5c5cb17f736fafd4c2ec1da3b3d331d6edbe8a0d32395855aeb2cdfd64b9f",
    "pose_landmark_heavy.tflite": "59e42d71bcd44cbdbabc419f0ff76686595fd265419566bd4009ef703ea8e1fe",
    "pose_landmark_lite.tflite": "f17bfbecadb61c3be1baa8b8d851cc6619c870a87167b32848ad20db306b9d61",
}
_MEMBERS = (
    Member(_WHEEL, f"mediapipe/modules/pose_detection/{DETECTOR}", DETECTOR, _SHA256[DETECTOR]),
    Member(_WHEEL, f"mediapipe/modules/pose_landmark/{POINTS}", POINTS, _SHA256[POINTS]),
)
_MARK = b"TFL3"  # of a file of TensorFlow Lite, behind its first four bytes


class MissingWeightsError(TrackerError):
    """Weights that are neither in the cache nor to be had from the package index; the message says where to put them."""

    def __init__(self, cache: Path, problem: SourceError):
        self.cache, self.problem = cache, problem
        places = ", ".join(f"{member.name} as {cached_path(member, cache)}" for member in _MEMBERS)
        super().__init__(
            f"the weights of the detector of people: {problem.source} {problem.problem}; without network, put"
            f" files of {_WHEEL.requirement} there: {places}"
        )


def pose_weights(points: Path | None = None, cache: Path | None = None) -> BlazePoseFiles:
    """Files of the networks; those that are missing or damaged in the cache are fetched.

    Parameters
    ----------
    points : weights of the network that finds points, such as ``pose_landmark_heavy.tflite``; None: those of the full size, which
        are fetched.
    cache : folder; None: `sample_files.cache_folder`.

    Returns
    -------
    files : checked by their SHA-256, but for a file of a name that is not known.

    Raises
    ------
    MissingWeightsError : they are not in the cache and cannot be fetched.
    FileFormatError : ``points`` is not there, no file of TensorFlow Lite, or not what its name says.
    """
    if points is not None:
        _check(points)
    cache = cache or cache_folder()
    try:
        files = fetch(_MEMBERS, cache)
    except SourceError as error:
        raise MissingWeightsError(cache, error) from error
    return BlazePoseFiles(files[DETECTOR], points or files[POINTS])


def usable_weights(points: Path | None = None) -> BlazePoseFiles:
    """`pose_weights` where the package that runs them is installed, and nothing fetched where it is not.

    Raises
    ------
    TrackerError : no points of people can be found here; the message says what mends it.
    """
    extra_module("ai_edge_litert", "keypoints")
    return pose_weights(points)


def detector_name(points: Path | None = None) -> str:
    """What finds the people, for people: ``BlazePose full``; of a file of the user its name."""
    name = POINTS if points is None else points.name
    return f"BlazePose {name.removeprefix('pose_landmark_').removesuffix('.tflite')}"


def _check(path: Path) -> None:
    try:
        content = path.read_bytes()
    except OSError as error:
        raise FileFormatError(path, "(file)", "weights of a network that finds points of people", error.strerror) from error
    if content[4:8] != _MARK:
        raise FileFormatError(path, "(file)", "a file of TensorFlow Lite", f"{len(content)} bytes that are none")
    expected, got = _SHA256.get(path.name), hashlib.sha256(content).hexdigest()
    if expected is not None and got != expected:
        raise FileFormatError(path, "(SHA-256)", f"{expected} for a file of this name", got)
