"""What the pages of one studio work on: rig, body, images and folder, opened once; states in that folder."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from ..camera.rig import CameraRig
from ..errors import FileFormatError, TrackerError
from ..loaders.model.model_yaml import load_model
from ..loaders.model.state_yaml import dump_state, load_state
from ..loaders.owned_folder import OwnedFolder
from ..loaders.rig.rig_yaml import load_rig
from ..model.articulated import ArticulatedModel
from ..model.configuration import State
from ..runs.config_file import load_config
from ..tracking.config import TrackerConfig
from .images import RecordedImages

Made = TypeVar("Made")


class made_once(cached_property[Made]):
    """A `cached_property` that threads which ask for it at the same time get the same of; since Python 3.12 that has no lock."""

    def __init__(self, make: Callable[[Any], Made]):
        super().__init__(make)
        self._making = threading.RLock()

    def __get__(self, instance: Any, owner: type | None = None) -> Any:
        with self._making:
            return super().__get__(instance, owner)


@dataclass(frozen=True)
class StudioFiles:
    """What the command line names; each may be missing, and the pages that need it then say so.

    ``folder`` holds saved states, ``clicks`` where digitized points are, ``control_points`` known points; ``new`` is the folder
    of a recording that is led from videos to a report, and says what the other pages show.
    """

    rig: Path | None = None
    model: Path | None = None
    config: Path | None = None
    initial_state: Path | None = None
    run: Path | None = None
    folder: Path = Path("out/studio")
    clicks: Path = Path("out/digitized")
    control_points: Path | None = None
    new: Path | None = None


@dataclass(frozen=True, eq=False)
class StudioSession:
    """``closing`` ends what pages have begun."""

    files: StudioFiles
    rig: CameraRig | None = None
    model: ArticulatedModel | None = None
    config: TrackerConfig = field(default_factory=TrackerConfig)
    initial_state: State | None = None
    images: RecordedImages | None = None
    closing: ExitStack = field(default_factory=ExitStack)

    def missing(self, what: str, option: str, step: str) -> TrackerError:
        """A page cannot be shown.

        Parameters
        ----------
        what : it needs.
        option : of the command line that names it.
        step : of a recording's folder that makes it.

        Returns
        -------
        To be raised.
        """
        how = f"start with {option}" if self.files.new is None else f"the step {step} of the page New comes first"
        return TrackerError(f"this page needs {what}: {how}")

    def needed_rig(self) -> CameraRig:
        """The rig, or a `TrackerError` that says how to name one."""
        if self.rig is None:
            raise self.missing("cameras", "--rig rig.yaml", "Rig")
        return self.rig

    def needed_model(self) -> ArticulatedModel:
        """The body, or a `TrackerError` that says how to name one."""
        if self.model is None:
            raise self.missing("a body", "--model person.yaml", "Body")
        return self.model

    @made_once
    def claimed_clicks(self) -> Path:
        """The folder of digitized points, which is made, and which no other studio changes until this one ends, or a
        `TrackerError`."""
        self.closing.enter_context(OwnedFolder(self.files.clicks).claimed())
        return self.files.clicks

    def needed_images(self) -> RecordedImages:
        """The images, or a `TrackerError` that says why there are none."""
        self.needed_rig()
        if self.images is None or not self.images.sets:
            problems = "; ".join(self.images.problems) if self.images is not None else ""
            raise TrackerError(f"this page needs images, and the rig's sources give none: {problems or 'no image sets'}")
        return self.images


def open_session(files: StudioFiles) -> StudioSession:
    """Read all files and open the sources of the images.

    Raises
    ------
    TrackerError : a file that cannot be used, or a state without a model.
    """
    rig = None if files.rig is None else load_rig(files.rig)
    model = None if files.model is None else load_model(files.model)
    config = TrackerConfig() if files.config is None else load_config(files.config)
    if files.initial_state is not None and model is None:
        raise TrackerError("--initial-state is a state of a body: name that with --model")
    state = load_state(files.initial_state, model) if files.initial_state is not None and model is not None else None
    images = None if rig is None else RecordedImages(rig, None, config.synchronizer)
    return StudioSession(files, rig, model, config, state, images)


_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,99}")


class ExistsError(TrackerError):
    """A file that would be overwritten."""


class PoseFiles:
    """States by name in a folder; nothing outside of it is read or written, and nothing is overwritten unasked."""

    def __init__(self, folder: Path):
        self._folder = folder

    def names(self) -> list[str]:
        """Of all files that may be states, in order; links, which may lead out of the folder, are none."""
        return sorted(path.name for path in self._folder.glob("*.yaml") if _NAME.fullmatch(path.name) and not path.is_symlink())

    def load(self, name: str, model: ArticulatedModel) -> State:
        """The state in a file.

        Parameters
        ----------
        name : of the file.
        model : body that the state must be of.

        Returns
        -------
        The state.

        Raises
        ------
        FileFormatError : a name that is none, or a file that is no state of this model.
        """
        return load_state(self._path(name), model)

    def save(self, name: str, state: State, model: ArticulatedModel, comment: str, overwrite: bool = False) -> Path:
        """Write a state.

        Parameters
        ----------
        name : of the file, with its suffix or without.
        state, model : what is written, and its body.
        comment : at the top of the file.
        overwrite : replace a state of that name.

        Returns
        -------
        The file's path.

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
