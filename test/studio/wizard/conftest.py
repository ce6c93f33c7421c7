"""A person before three cameras, as a user has it: videos, a calibration of Pose2Sim, markers; and a studio asked over HTTP."""

import http.client
import json
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

from helpers.cameras.person_clip import make_person_clip
from helpers.docs.given import write_trc, write_video
from tracker_node.cli.main import main
from tracker_node.loaders.motion.trajectory_file import JointTrajectory
from tracker_node.model.configuration import Configuration


class Client:
    """The page's requests."""

    def __init__(self, url: str):
        parts = urlsplit(url.replace("/wizard.html?", "/?"))
        self.host, token = parts.netloc, parts.query.split("token=")[1]
        cookie = f"studio_{parts.port}={token}"
        self.headers = {"Cookie": cookie, "Origin": f"http://{self.host}", "Content-Type": "application/json"}

    def ask(self, path: str, values: dict | None = None):
        """Status, content and headers."""
        connection = http.client.HTTPConnection(self.host, timeout=60)
        try:
            body = None if values is None else json.dumps(values)
            connection.request("GET" if values is None else "POST", path, body, self.headers)
            answer = connection.getresponse()
            return answer.status, answer.read().decode(errors="replace"), answer.headers
        finally:
            connection.close()

    def json(self, path: str, values: dict | None = None, status: int = 200):
        got, text, _ = self.ask(path, values)
        assert got == status, text
        return json.loads(text)

    def step(self, name: str) -> dict:
        return next(step for step in self.json("/api/wizard/steps")["steps"] if step["name"] == name)

    def do(self, step: str, way: str, **values: str) -> dict:
        """Start a step and wait for its end."""
        self.json("/api/wizard/start", {"step": step, "way": way, "values": values})
        for _ in range(1500):
            job = self.json("/api/wizard/job")
            if not job["running"]:
                return job
            time.sleep(0.1)
        raise AssertionError(job)


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
    write_trc(folder / "markers.trc", JointTrajectory(clip.model.landmark_names, stamps, positions, valid))
    return folder
