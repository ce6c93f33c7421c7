"""Cameras a third of an image period apart, drawn by another renderer, before a body in fast motion."""

from dataclasses import dataclass

import numpy as np
import pytest

from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.synchronizer import ImageSynchronizer
from tracker_node.synthesis.scenes.scene import SceneConfig, Studio, make_rig
from tracker_node.synthesis.subjects.cones import ModelSubject
from tracker_node.synthesis.subjects.figure import figure_model, figure_motion
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.tracker import Tracker

SCENE = SceneConfig(
    n_cameras=4,
    width=320,
    height=240,
    radius=3.2,
    focal_px=290.0,
    distortion=(),
    noise_levels=3.0,
    shadow=False,
    surroundings="clutter",
)
PERIOD_NS = 33_333_333
THIRDS = (0, 1, 2, 1)  # of a period that each camera is late
N_SETS = 7


@dataclass(frozen=True, eq=False)
class Film:
    """Images with the stamps of their exposure, the empty scene, and the true state at every third of a period."""

    images: tuple[CameraImage, ...]
    backgrounds: dict[str, np.ndarray]
    states: tuple[State, ...]


@pytest.fixture(scope="module")
def film() -> Film:
    """Limbs of up to 13 cm and 22 degrees an image."""
    rig, model = make_rig(SCENE), figure_model()
    states, subject, images = figure_motion(30.0, 3 * N_SETS), ModelSubject(model), []
    with Studio(rig, SCENE) as studio:
        backgrounds = {camera.name: studio.empty_image(i, 0) for i, camera in enumerate(rig)}
        for instant, state in enumerate(states):
            pictures = studio.images(subject.mesh(Configuration(model, state)), instant)
            for camera, picture, third in zip(rig, pictures, THIRDS, strict=True):
                if (instant - third) % 3 == 0:
                    images.append(CameraImage(camera.name, 10**9 + instant * PERIOD_NS // 3, picture))
    return Film(tuple(images), backgrounds, tuple(states))


def sets_of(film: Film, tolerance: float) -> list[ImageSet]:
    rig = make_rig(SCENE)
    synchronizer = ImageSynchronizer(rig.names, image_period_s=1e-9 * PERIOD_NS, tolerance=tolerance, queue_s=1.0)
    found = [image_set for image in film.images for image_set in synchronizer.add(image)]
    return found + synchronizer.flush()


def errors_mm(film: Film, sets: list[ImageSet], kind: str) -> np.ndarray:
    """(n,) mean distance of the landmarks from where they are at each set's stamp."""
    model = figure_model()
    config = from_dict({"modalities": [kind], "synchronizer.tolerance": 0.7})
    tracker = Tracker(make_rig(SCENE), model, config, film.backgrounds, film.states[0])
    result = []
    for image_set in sets:
        estimate = tracker.step(image_set)
        truth = film.states[round((image_set.stamp_ns - 10**9) * 3 / PERIOD_NS)]
        pair = [Configuration(model, state).landmarks_world for state in (estimate.state, truth)]
        result.append(1e3 * np.linalg.norm(pair[0] - pair[1], axis=1).mean())
    return np.array(result)


@pytest.mark.parametrize("kind", ["chamfer", "region"])
def test_each_camera_sees_the_body_at_its_own_instant(film, kind):
    sets = sets_of(film, 0.7)
    assert [len(s.images) for s in sets] == [4] * N_SETS
    alike = [ImageSet(s.stamp_ns, tuple(CameraImage(i.camera, s.stamp_ns, i.pixels) for i in s.images)) for s in sets]
    own, forced = errors_mm(film, sets, kind), errors_mm(film, alike, kind)
    assert own[2:].mean() < 0.65 * forced[2:].mean()
    assert own[2:].mean() < 6.0
