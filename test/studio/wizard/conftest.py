"""A person before three cameras, as a user has it: videos, a calibration of Pose2Sim, markers."""

from pathlib import Path

import numpy as np
import pytest

from helpers.cameras.person_clip import make_person_clip
from helpers.docs.given import write_trc, write_video
from tracker_node.cli.main import main
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.model.configuration import Configuration


@pytest.fixture(scope="session")
def recorded(tmp_path_factory) -> Path:
    """To be copied."""
    clip = make_person_clip(tmp_path_factory.mktemp("clip"), n_images=40)
    folder = tmp_path_factory.mktemp("recorded")
    (folder / "videos").mkdir()
    for camera in clip.rig:
        write_video(folder / f"videos/{camera.name}.mp4", sorted((clip.folder / camera.name).glob("*.png")))
    assert main(["rig", "export", str(clip.rig_file), "--to", "pose2sim", "-o", str(folder / "Calib.toml")]) == 0
    positions = np.array([Configuration(clip.model, state).landmarks_world for state in clip.states])
    stamps = np.round(np.arange(len(positions)) * 1e9 / 30.0).astype(np.int64)
    valid = np.ones(positions.shape[:2], dtype=bool)
    write_trc(folder / "markers.trc", Trajectories(clip.model.landmark_names, stamps, positions, valid))
    return folder
