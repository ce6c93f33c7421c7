"""The somersault as the experiments use it: two bodies in one posture, cameras, light, and target images by either renderer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np

from ..camera.camera_rig import CameraRig
from ..evaluation.color_plots import bgr_of
from ..model.articulated_model import ArticulatedModel
from ..model.configuration import Configuration, State
from ..model.ellipsoid_human import ellipsoid_human
from ..model.nurbs_human import nurbs_human
from ..render import raycaster
from ..render.backends import make_renderer
from ..render.renderer import Renderer
from ..synthesis.somersault import somersault_rig, somersault_states, somersault_variables

# A little piked, arms at the sides with the hands before the belly, toes pointed: as twisting somersaults are flown.
POSTURE_DEG = {"torso_flexion": 8.0, "chest_flexion": 6.0, "head_flexion": 10.0} | {
    f"{side}_{axis}": degrees
    for side in ("left", "right")
    for axis, degrees in (("hip_flexion", 28.0), ("knee_flexion", 12.0), ("ankle_dorsiflexion", -45.0), ("elbow_flexion", 75.0))
}
BACKENDS = ("pyrender", "raycaster")  # the renderer that does not score comes first


@dataclass(frozen=True, eq=False)
class SomersaultScene:
    """``measured`` is the body in the target images, ``tracked`` the one that looks for it; both have the true ``variables``
    (n, 6) and are in the states ``truth`` (n)."""

    measured: ArticulatedModel
    tracked: ArticulatedModel
    rig: CameraRig
    variables: np.ndarray
    truth: Sequence[State]

    def film(self, body: ArticulatedModel, backend: str = BACKENDS[0]) -> list[list[np.ndarray]]:
        """(n image sets) of BGR images on black, in the order of the rig; in whole grey levels, as any image has them."""
        with make_renderer(backend) as renderer:
            return [self._draw(renderer, Configuration(body, state)) for state in self.truth]

    def show(self, body: ArticulatedModel, states: Sequence[State]) -> list[list[np.ndarray]]:
        """The same of a body in other states, by the renderer that scores."""
        return [self._draw(cast(Renderer, raycaster), Configuration(body, state)) for state in states]

    def _draw(self, renderer: Renderer, configuration: Configuration) -> list[np.ndarray]:
        return [bgr_of(renderer.render_color(configuration, camera, self.rig.lights), camera) for camera in self.rig]


def somersault_scene(n_images: int = 11, width: int = 768) -> SomersaultScene:
    """The paper's experiment, or the first images of it, smaller."""
    tracked, variables = ellipsoid_human(), somersault_variables()[:n_images]
    return SomersaultScene(
        nurbs_human(), tracked, somersault_rig(width), variables, somersault_states(tracked, variables, POSTURE_DEG)
    )
