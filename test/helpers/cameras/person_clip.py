"""A clip of a person for tests of whole programs, and a detector that knows where the person is in each of its images."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import numpy as np

from helpers.cameras.render_scenes import look_at
from helpers.cameras.small_clip import RATE_HZ, Clip
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.observation.keypoints.blazepose import NAMES
from tracker_node.observation.keypoints.crop import Crop
from tracker_node.observation.keypoints.people import People, Person, Silhouette
from tracker_node.render.raycast.raycaster import render_mask, render_view

CAMERAS = {"cam01": (3.0, 0.4, 1.2), "cam02": (-0.6, 3.0, 1.0), "cam03": (-2.2, -2.2, 1.6)}
_SIGMA_PX = 1.0


def make_person_clip(folder: Path, n_images: int = 6) -> Clip:
    """Render the clip into ``folder``: one folder of PNG files per camera, and all the files that a run needs."""
    folder.mkdir(parents=True, exist_ok=True)
    rng, model = np.random.default_rng(3), human_model()
    lens = CameraModel(200, 200, np.array([[230.0, 0.0, 99.5], [0.0, 230.0, 99.5], [0.0, 0.0, 1.0]]))
    states, cameras = _states(n_images), []
    for name, eye in CAMERAS.items():
        camera = look_at(eye, (0.1, 0.1, 0.9), lens, name)
        scene = cv2.GaussianBlur(rng.uniform(90, 230, (200, 200, 3)), (0, 0), 6).astype(np.float64)
        (folder / name).mkdir()
        for i, state in enumerate(states):
            labels, picture = render_view(Configuration(model, state), camera).labels, scene.copy()
            for k, shape in enumerate(model.shapes):
                picture[labels == k + 1] = shape.color_rgb[::-1]
            picture = np.clip(picture + rng.normal(0.0, 2.0, picture.shape), 0, 255).astype(np.uint8)
            cv2.imwrite(str(folder / name / f"{i:04d}.png"), picture)
        cameras.append(Camera(name, lens, camera.T_world_cam, source=name))
    rig = CameraRig(tuple(cameras))
    write_rig_file(rig_file_of(rig), folder / "rig.yaml")
    dump_model(model, folder / "model.yaml")
    dump_state(states[0], model, folder / "start.yaml")
    (folder / "config.yaml").write_text("modalities: [region, keypoints]\nthreads: 2\n")
    return Clip(folder, model, rig, states)


def _states(n: int) -> tuple[State, ...]:
    chain, found = human_model().chain, []
    lower, upper = np.maximum(chain.lower, -0.4), np.minimum(chain.upper, 0.4)
    for t in np.arange(n) / RATE_HZ:
        root = se3.from_rotation_translation(so3.exp(np.array([0.0, 0.0, 0.6 * t])), np.array([0.3 * t, 0.1, 0.95]))
        swing = np.sin(4.0 * t) * np.cos(np.arange(chain.n_axes))
        found.append(State(root, 0.5 * (lower + upper) + 0.5 * (upper - lower) * swing))
    return tuple(found)


@dataclass
class TrueDetector:
    """Finds the person of a clip where they are, with noise that depends on the image alone.

    Attributes
    ----------
    asked : camera, number of the image and where to look, of each call; of all detectors that share it.
    """

    clip: Clip
    asked: list[tuple[str, int, tuple[Crop, ...]]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self._images = {
            cv2.imread(str(path)).tobytes(): (camera, int(path.stem))
            for camera in self.clip.rig
            for path in sorted((self.clip.folder / camera.name).glob("*.png"))
        }

    def detect(self, image: np.ndarray, expected: Sequence[Crop] = ()) -> People:
        camera, number = self._images[image.tobytes()]
        self.asked.append((camera.name, number, tuple(expected)))
        return (true_person(self.clip, camera, number),)


def true_person(clip: Clip, camera: Camera, number: int) -> Person:
    """The person in one image: points of `BLAZEPOSE`, the others not found."""
    body, rng = Configuration(clip.model, clip.states[number]), np.random.default_rng([number, *camera.name.encode()])
    pixels, scores = np.zeros((len(NAMES), 2)), np.zeros(len(NAMES))
    for name, point in BLAZEPOSE.items():
        if name in NAMES and point.landmark in clip.model.landmark_names:
            landmark = clip.model.landmark_index(point.landmark)
            R = body.Ts_world_link[clip.model.landmark_links[landmark], :3, :3]
            place = body.landmarks_world[landmark] + R @ np.array(point.offset)
            projected, seen = camera.project(place[None])
            pixels[NAMES.index(name)] = projected[0] + rng.normal(0.0, _SIGMA_PX, 2)
            scores[NAMES.index(name)] = rng.uniform(0.8, 1.0) * seen[0]
    covariances = rng.uniform(0.5, 2.0, (len(NAMES), 1, 1)) * np.eye(2) * _SIGMA_PX**2
    mask = render_mask(body, camera)
    left, top, width, height = cv2.boundingRect(mask)
    silhouette = Silhouette(mask[top : top + height, left : left + width].copy(), (left, top))
    box = float(left), float(top), float(left + width), float(top + height)
    return Person(NAMES, pixels, covariances, scores, 0.9, box, silhouette)
