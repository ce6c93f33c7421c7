"""Where a page of the documentation is walked through, and the recordings that several pages begin with."""

import shutil
from contextlib import ExitStack
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from helpers.cameras import board_films, small_clip
from helpers.docs.pages import ROOT
from tracker_node.cli.main import main
from tracker_node.loaders.motion.trajectory_file import Trajectories, write_joints
from tracker_node.model.configuration import Configuration


def run(*arguments: object) -> None:
    """A command of ours that has to end well."""
    assert main([str(argument) for argument in arguments]) == 0, arguments


class Shelf:
    """Folders that are made when the first page asks for them; to be copied, not changed."""

    def __init__(self, folder: Path):
        self._folder = folder

    @cached_property
    def arm(self) -> Path:
        """A small arm before three small cameras, its true joints, and a run of it."""
        clip = small_clip.make_clip(self._folder / "arm")
        write_joints(clip.folder / "truth.csv", _joints_of(clip))
        files = ("--rig", clip.rig_file, "--model", clip.model_file, "--initial-state", clip.state_file)
        run("track", *files, "--output", clip.folder / "run", "--quiet")
        return clip.folder

    @cached_property
    def person(self) -> Path:
        """The mannequin swings its arms before four cameras."""
        folder = self._folder / "person"
        run("synthesize", "--motion", "swing", "--images", 6, "--cameras", 4, "--size", "320x240", "--output", folder)
        return folder

    @cached_property
    def robot(self) -> Path:
        """The robot arm of the package before three cameras."""
        folder, body = self._folder / "robot", ROOT / "config/models/robot_arm.urdf"
        size = ("--images", 3, "--cameras", 3, "--size", "320x240")
        run("synthesize", "--subject", "model", "--model", body, *size, "--output", folder)
        return folder

    @cached_property
    def films(self) -> Path:
        """Boards before three cameras."""
        folder = self._folder / "films"
        board_films.write_films(folder)
        return folder


def _joints_of(clip: small_clip.Clip) -> Trajectories:
    positions = np.array([Configuration(clip.model, state).landmarks_world for state in clip.states])
    stamps = np.round(np.arange(len(positions)) * 1e9 / small_clip.RATE_HZ).astype(np.int64)
    return Trajectories(clip.model.landmark_names, stamps, positions, np.ones(positions.shape[:2], dtype=bool))


@dataclass
class Place:
    """The folder that is the current one, values for `doc_commands.CHANGED`, and what processes find in their environment."""

    folder: Path
    shelf: Shelf
    values: dict[str, str]
    env: dict[str, str] = field(default_factory=dict)
    closing: ExitStack = field(default_factory=ExitStack)

    def empty(self) -> None:
        """Take away all that is there."""
        for path in self.folder.iterdir():
            if path.is_dir() and not path.is_symlink():
                shutil.rmtree(path)
            else:
                path.unlink()

    def lay(self, source: Path, name: str = "") -> None:
        """Put a copy of a file, or of a folder's content, under a name."""
        target = self.folder / name
        if source.is_dir():
            shutil.copytree(source, target, dirs_exist_ok=True)
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(source, target)
