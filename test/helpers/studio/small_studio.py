"""A person of the tracker's own shapes, moving before four small cameras, drawn with OpenGL: not by the tracker's renderer."""

from collections.abc import Callable, Container
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from tracker_node.camera.rig import CameraRig
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.synthesis.scenes.scene import SceneConfig, Studio, make_rig
from tracker_node.synthesis.subjects.cones import ModelSubject, waves
from tracker_node.tracking.estimate import TrackEstimate

RATE_HZ = 30.0
SCENE = SceneConfig(n_cameras=4, width=320, height=240, focal_px=290.0, noise_levels=2.0)


@dataclass(frozen=True, eq=False)
class Recording:
    """Image sets with the states that they show, and the empty scene by camera."""

    rig: CameraRig
    model: ArticulatedModel
    states: tuple[State, ...]
    sets: tuple[ImageSet, ...]
    backgrounds: dict[str, np.ndarray]

    def errors_mm(self, estimates: list[TrackEstimate]) -> np.ndarray:
        """(n, n_landmarks) distance of landmarks from where they are."""
        pairs = zip(estimates, self.states, strict=False)
        found = [[Configuration(self.model, state).landmarks_world for state in (e.state, truth)] for e, truth in pairs]
        return 1e3 * np.array([np.linalg.norm(a - b, axis=1) for a, b in found])


@cache
def recording(n_images: int = 12) -> Recording:
    """Made once per test process; treat it as constant."""
    rig, model = make_rig(SCENE), human_model()
    states, subject, sets = waves(model, RATE_HZ, n_images), ModelSubject(model), []
    with Studio(rig, SCENE) as studio:
        backgrounds = {camera.name: studio.empty_image(i, 0) for i, camera in enumerate(rig)}
        for i, state in enumerate(states):
            stamp_ns = 10**9 + round(i * 1e9 / RATE_HZ)
            images = studio.images(subject.mesh(Configuration(model, state)), i)
            sets.append(
                ImageSet(stamp_ns, tuple(CameraImage(c.name, stamp_ns, image) for c, image in zip(rig, images, strict=True)))
            )
    return Recording(rig, model, tuple(states), tuple(sets), backgrounds)


def changed(image_set: ImageSet, cameras: Container[str], pixels: Callable[[np.ndarray], np.ndarray] | None) -> ImageSet:
    """The set with other pixels in some cameras; ``pixels`` None leaves them out, a function makes them from the old ones."""
    images = [replace(i, pixels=pixels(i.pixels)) if i.camera in cameras and pixels else i for i in image_set.images]
    return replace(image_set, images=tuple(i for i in images if pixels or i.camera not in cameras))


def assert_same_bits(a: list[TrackEstimate], b: list[TrackEstimate]) -> None:
    for x, y in zip(a, b, strict=True):
        assert x.state.to_values().tobytes() == y.state.to_values().tobytes()
        assert x.covariance.tobytes() == y.covariance.tobytes()
        assert x.velocity.tobytes() == y.velocity.tobytes()
        assert (x.status, x.status_reason, x.score, x.residual) == (y.status, y.status_reason, y.score, y.residual)
        assert (x.cameras, x.iterations, x.evaluations) == (y.cameras, y.iterations, y.evaluations)
