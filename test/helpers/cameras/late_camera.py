"""A cross in flight before three small cameras, of which the last is late."""

import numpy as np

from helpers.bodies.wooden_cross import cross
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.experiments.cross.throw import LATE_S, cross_rig, side_somersault
from tracker_node.model.configuration import Configuration
from tracker_node.render.raycast import raycaster

MODEL = cross()
_FULL = cross_rig()
RIG = CameraRig(tuple(Camera(c.name, c.model.resized(192, 144), c.T_world_cam) for c in _FULL), lights=_FULL.lights)
TRIAL = side_somersault(MODEL)
STATE = TRIAL.state(9)
VELOCITY = TRIAL.state(10).difference(STATE) / 0.02
LATE = (0.0, 0.0, LATE_S)


def images(late_s=LATE) -> list[np.ndarray]:
    """What the cameras show of the body at ``STATE``, each so much later."""
    pictures = []
    for camera, late in zip(RIG, late_s, strict=True):
        view = raycaster.render_color(Configuration(MODEL, TRIAL.state(9, late)), camera, RIG.lights)
        pictures.append(np.rint(view.rgb[:, :, ::-1]).astype(np.uint8))
    return pictures
