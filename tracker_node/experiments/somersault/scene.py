"""The somersault as the experiments use it: two bodies in one posture, cameras, light, and target images by either renderer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.humans.surfaces18 import ellipsoid_human, nurbs_human
from ...render.raycast import raycaster
from ..plots import bgr_of
from ..target_images import TargetStudio
from .motion import POSTURE_DEG, rigid_body, somersault_rig, somersault_states, somersault_variables

BACKENDS = ("pyrender", "raycaster")  # the renderer that does not score comes first


@dataclass(frozen=True, eq=False)
class SomersaultScene:
    """``measured`` is the body in the target images, ``tracked`` the one that looks for it, rigid both; they have the true
    ``variables`` (n, 6) and are in the states ``truth`` (n)."""

    measured: ArticulatedModel
    tracked: ArticulatedModel
    rig: CameraRig
    variables: np.ndarray
    truth: Sequence[State]

    def film(self, body: ArticulatedModel, backend: str = BACKENDS[0]) -> list[list[np.ndarray]]:
        """(n image sets) of BGR images on black, in the order of the rig."""
        with TargetStudio(self.rig, backend) as studio:
            return [studio.images(Configuration(body, state)) for state in self.truth]

    def draw(self, body: ArticulatedModel, states: Sequence[State]) -> list[list[np.ndarray]]:
        """The same of a body in any states, by the renderer that scores."""
        return [
            [bgr_of(raycaster.render_color(Configuration(body, state), camera, self.rig.lights), camera) for camera in self.rig]
            for state in states
        ]


def somersault_scene(n_images: int = 11, width: int = 768) -> SomersaultScene:
    """The paper's experiment, or the first images of it, smaller."""
    measured, tracked = rigid_body(nurbs_human(), POSTURE_DEG), rigid_body(ellipsoid_human(), POSTURE_DEG)
    variables = somersault_variables()[:n_images]
    return SomersaultScene(measured, tracked, somersault_rig(width), variables, somersault_states(tracked, variables, {}))
