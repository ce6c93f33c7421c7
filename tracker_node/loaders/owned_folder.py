"""A folder of work in progress: files are replaced whole or not at all, and only those that this program has written.

What was written is remembered by its SHA-256 in ``.written.json``. A file that somebody else has made or changed is refused, so
nobody's work is lost to a program that saves by itself. Several programs may write into one folder: a file that another one has
changed since is refused as well. One that keeps in memory what the files hold claims the folder for itself.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import FileFormatError, TrackerError
from .json_values import read_json
from .whole_file import sync, write_whole

_LEDGER = ".written.json"
_DRAFTS = ".drafts"
_CLAIM = ".claimed"


class OwnedFolder:
    """Files below ``path``, which is made when the first of them is written.

    Raises
    ------
    FileFormatError : a ``.written.json`` that cannot be read.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self._digests: dict[str, list[str]] = _read_ledger(self.path / _LEDGER)

    def write(self, name: str, write: Callable[[Path], object]) -> Path:
        """Replace a file.

        Parameters
        ----------
        name, write : path below the folder; writes the file at the path that it is given.

        Returns
        -------
        Path of the file.

        Raises
        ------
        FileFormatError : a file of that name that this program has not written, or that was changed since.
        """
        with self._alone():
            self.check(name)
            draft, target = self.path / _DRAFTS / Path(name).name, self.path / name
            write(draft)
            digest = _digest(draft)
            # Both are remembered until the file is there: whenever the power goes, what lies there is known as ours
            self._remember(name, [*self._digests.get(name, [])[-1:], digest])
            target.parent.mkdir(parents=True, exist_ok=True)
            sync(draft)
            draft.replace(target)
            self._remember(name, [digest])
        return target

    def remove(self, name: str) -> None:
        """Delete a file of ours; one that is not there is no error."""
        with self._alone():
            self.check(name)
            (self.path / name).unlink(missing_ok=True)
            self._remember(name, [])

    def check(self, name: str) -> None:
        """Refuse a file that is not ours to replace.

        Raises
        ------
        FileFormatError : as for `write`.
        """
        path = self.path / name
        if path.exists() and _digest(path) not in self._digests.get(name, []):
            known = name in self._digests
            got = "one that was changed by something else since" if known else "one that this program has not written"
            raise FileFormatError(path, "(file)", "a file of ours to replace; move this one away", got)

    @contextmanager
    def claimed(self) -> Iterator[None]:
        """While nobody else may claim the folder, which is made; the operating system ends the claim of a process that has died.

        Raises
        ------
        TrackerError : another process has claimed it; says which.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        with (self.path / _CLAIM).open("a+", encoding="utf-8") as claim:
            try:
                fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                claim.seek(0)
                problem = f"process {claim.read().strip() or '(unknown)'} works in this folder; end it, or name another folder"
                raise TrackerError(f"{self.path}: {problem}") from None
            claim.truncate(0)
            claim.write(f"{os.getpid()}\n")
            claim.flush()
            yield

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """While no other program writes into the folder."""
        drafts = self.path / _DRAFTS
        drafts.mkdir(parents=True, exist_ok=True)
        handle = os.open(drafts, os.O_RDONLY)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX)
            yield
        finally:
            os.close(handle)

    def _remember(self, name: str, digests: list[str]) -> None:
        written = _read_ledger(self.path / _LEDGER)  # others may have written other files since
        for known in (self._digests, written):
            known.pop(name, None)
            if digests:
                known[name] = digests
        write_whole(self.path / _LEDGER, json.dumps(written, indent=1) + "\n")


def _read_ledger(path: Path) -> dict[str, list[str]]:
    if not path.exists():
        return {}
    read = read_json(path)
    if not isinstance(read, dict) or not all(
        isinstance(digests, list) and all(isinstance(digest, str) for digest in digests) for digests in read.values()
    ):
        raise FileFormatError(path, "(file)", "names with lists of digests", read)
    return read


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()
