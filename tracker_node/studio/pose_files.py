"""States by name in the folder of a studio; nothing outside of it is read or written, and nothing is overwritten unasked."""

from __future__ import annotations

import re
from pathlib import Path

from ..errors import FileFormatError, TrackerError
from ..loaders.model.state_yaml import dump_state, load_state
from ..model.articulated import ArticulatedModel
from ..model.configuration import State

_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")


class ExistsError(TrackerError):
    """A file that would be overwritten."""


class PoseFiles:
    """The ``.yaml`` files of a folder."""

    def __init__(self, folder: Path):
        self._folder = folder

    def names(self) -> list[str]:
        """Of all files that may be states, in order; links, which may lead out of the folder, are none."""
        return sorted(path.name for path in self._folder.glob("*.yaml") if _NAME.fullmatch(path.name) and not path.is_symlink())

    def load(self, name: str, model: ArticulatedModel) -> State:
        """The state in a file.

        Raises
        ------
        FileFormatError : a name that is none, or a file that is no state of this model.
        """
        return load_state(self._path(name), model)

    def save(self, name: str, state: State, model: ArticulatedModel, comment: str, overwrite: bool = False) -> Path:
        """Write a state.

        Raises
        ------
        ExistsError : there is a file of that name, and it is not to be overwritten.
        FileFormatError : a name that is none, or the file to be overwritten is something else than a state of this model.
        """
        path = self._path(name if name.endswith(".yaml") else f"{name}.yaml")
        if path.exists():
            load_state(path, model)
            if not overwrite:
                raise ExistsError(f"{path} is there already")
        dump_state(state, model, path, comment)
        return path

    def _path(self, name: str) -> Path:
        path = self._folder / name
        if not _NAME.fullmatch(name) or path.is_symlink():
            raise FileFormatError("request", "name", "a file's name of letters, digits, _ - and . (no link)", name)
        return path
