"""A model of OpenSim with a trunk and two legs of hinges, in the size of one of our bodies, written by OpenSim itself."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from tracker_node.loaders.motion.bvh import AXES_Y_UP
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State

TRUNK = ("left_hip", "right_hip", "left_shoulder", "right_shoulder")


def write_legs(osim: Any, model: ArticulatedModel, path: Path) -> Path:
    """Write it. Coordinates: those of a free pelvis, ``hip_flexion_left``, ``knee_angle_left`` (flexion negative) and so on.

    Parameters
    ----------
    osim : the package.
    model : whose neutral landmarks are joints and markers.
    path : of the file.

    Returns
    -------
    The path.
    """
    landmarks = Configuration(model, State.neutral(model)).landmarks_world @ AXES_Y_UP.T
    at = dict(zip(model.landmark_names, landmarks, strict=True))
    legs = osim.Model()
    legs.setName("legs")
    pelvis = _body(osim, legs, "pelvis")
    origin = 0.5 * (at["left_hip"] + at["right_hip"])
    legs.addJoint(osim.FreeJoint("ground_pelvis", legs.getGround(), pelvis))
    for name in TRUNK:
        _marker(osim, legs, name, pelvis, at[name] - origin)
    for side in ("left", "right"):
        parent, place = pelvis, origin
        for joint, part, coordinate, end in (
            ("hip", "thigh", "hip_flexion", "knee"), ("knee", "shank", "knee_angle", "ankle"),
        ):  # fmt: skip
            body, center = _body(osim, legs, f"{side}_{part}"), at[f"{side}_{joint}"]
            # The hinge's z is the body's right: a leg swings forward by a positive angle
            turned = osim.Vec3(0.0, -np.pi / 2.0, 0.0)
            zero = osim.Vec3(0.0)
            pin = osim.PinJoint(f"{side}_{joint}", parent, osim.Vec3(*(center - place)), turned, body, zero, turned)
            pin.updCoordinate().setName(f"{coordinate}_{side}")
            legs.addJoint(pin)
            _marker(osim, legs, f"{side}_{end}", body, at[f"{side}_{end}"] - center)
            parent, place = body, center
    legs.finalizeConnections()
    legs.printToXML(str(path))
    return path


def _body(osim: Any, model: Any, name: str) -> Any:
    body = osim.Body(name, 1.0, osim.Vec3(0.0), osim.Inertia(0.1))
    model.addBody(body)
    return body


def _marker(osim: Any, model: Any, name: str, body: Any, place: np.ndarray) -> None:
    model.addMarker(osim.Marker(name, body, osim.Vec3(*map(float, place))))
