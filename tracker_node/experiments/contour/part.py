"""One part of a body before one camera, and the error of its contours as it moves along a row of the image."""

from __future__ import annotations

import numpy as np

from ...camera.rig import CameraRig
from ...geometry import se3
from ...model.articulated import ArticulatedModel, Shape
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import KinematicChain
from ...model.shapes.primitives import TruncatedCone
from ...observation.chamfer.distance_transform import distance_to
from ...observation.image_set import CameraImage, ImageSet
from ...synthesis.dataset import N_PLATES
from ...synthesis.scenes.scene import SceneConfig, Studio, make_rig
from ...synthesis.subjects.cones import ModelSubject
from ...tracking.config import TrackerConfig
from ..plots import Profile
from .errors import PUBLISHED, REACH_PX, ContourError, by_method, far_sighted
from .pictures import shoot
from .plots import RowPicture

MODELS = {"part": ("a model of its size", 1.0), "thin_part": ("a model a fifth thinner", 0.8)}
"""By the names of figures: what it is called, and how thick it is against the part in the image."""
_LENGTH_M, _MIDDLE_HEIGHT_M = 0.5, 1.0
_SCENE = SceneConfig(n_cameras=1, radius=1.6, target_height=_MIDDLE_HEIGHT_M, distortion=())
_SHIFTS_PX = np.linspace(-60.0, 60.0, 121)


def part_model(thickness: float = 1.0) -> ArticulatedModel:
    """A tapered cone like a thigh, upright, its root at the lower end."""
    cone = TruncatedCone(0.08 * thickness, 0.07 * thickness, -0.55, 0.0, _LENGTH_M)
    return ArticulatedModel("part", KinematicChain(("part",), ()), (Shape("part", "part", cone, color_rgb=(190, 90, 90)),))


def part_row() -> RowPicture:
    """The part is filmed in a furnished room; then models of it are moved along the row through its middle."""
    rig, model = make_rig(_SCENE), part_model()
    camera = rig.cameras[0]
    middle = np.array([0.0, 0.0, _MIDDLE_HEIGHT_M])
    state = State.neutral(model, se3.from_rotation_translation(np.eye(3), middle - [0.0, 0.0, 0.5 * _LENGTH_M]))
    body = Configuration(model, state)
    with Studio(rig, _SCENE) as studio:
        plates = [studio.empty_image(0, i) for i in range(N_PLATES)]
        (image,) = studio.images(ModelSubject(model).mesh(body), 0)
    (u, v), _ = camera.project(middle)
    direction = np.zeros(model.n_dof)
    direction[:3] = camera.T_world_cam[:3, 0] * se3.apply(camera.T_cam_world, middle)[2] / camera.model.K[0, 0]
    image_set = ImageSet(0, (CameraImage(camera.name, 0, image),))
    errors = _errors_along(rig, {camera.name: plates}, image_set, state, direction)
    shot = shoot(camera, image, body, body, plates, far_sighted(by_method(TrackerConfig(), "sum")), REACH_PX)
    assert shot is not None, "the part is in the middle of the image"
    row = round(float(v))
    distances = {key: distance_to(mask, REACH_PX)[row] for key, mask in (("silhouette", shot.silhouette), ("edges", shot.edges))}
    distances["sum"] = distances["silhouette"] + distances["edges"]
    return RowPicture(shot.silhouette, shot.edges, row, float(u), distances, errors)


def _errors_along(
    rig: CameraRig, plates: dict[str, list[np.ndarray]], image_set: ImageSet, state: State, direction: np.ndarray
) -> dict[str, dict[str, Profile]]:
    """Of every model, by every kind of distance; ``direction`` is a tangent that moves the part by a pixel."""
    errors: dict[str, dict[str, Profile]] = {}
    for title, thickness in MODELS.values():
        errors[title] = {}
        for key in PUBLISHED:
            error = ContourError(rig, part_model(thickness), plates, key)
            error.look(image_set, state)
            errors[title][key] = Profile(_SHIFTS_PX, error.along(state, direction, _SHIFTS_PX))
    return errors
