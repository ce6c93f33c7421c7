"""A desk and a post before a person, drawn by another renderer: known, they are in nobody's way."""

from functools import cache

import numpy as np
import pytest

from helpers.studio.small_studio import RATE_HZ, Recording
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box, TruncatedCone
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.synthesis.scenes.rasterizer import ColoredMesh
from tracker_node.synthesis.scenes.scene import SceneConfig, Studio, make_rig
from tracker_node.synthesis.subjects.cones import ModelSubject, waves
from tracker_node.tracking.config import from_dict
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.tracker import Tracker

SCENE = SceneConfig(n_cameras=4, width=320, height=240, focal_px=290.0, noise_levels=2.0, surroundings="clutter")


def at(x: float, y: float, z: float) -> np.ndarray:
    return se3.from_rotation_translation(np.eye(3), np.array([x, y, z]))


def furniture(rig) -> ArticulatedModel:
    """A desk that hides the legs from the first camera, and a post that hides a part of the trunk from the second."""
    towards = [c.center[:2] / np.linalg.norm(c.center[:2]) for c in rig]
    desk, post = 1.3 * towards[0], 1.2 * towards[1]
    shapes = (
        Shape("desk", "room", Box((1.2, 1.2, 0.75)), at(*desk, 0.375), (120, 90, 60)),
        Shape("post", "room", TruncatedCone(0.06, 0.06, 0.0, 0.0, 2.2), at(*post, 0.0), (60, 110, 110)),
    )
    return ArticulatedModel("furniture", KinematicChain(("room",), ()), shapes)


def together(a: ColoredMesh, b: ColoredMesh) -> ColoredMesh:
    return ColoredMesh(
        np.concatenate([a.vertices, b.vertices]), np.concatenate([a.faces, b.faces + len(a.vertices)]),
        np.concatenate([a.colors_rgb, b.colors_rgb]), np.concatenate([a.normals, b.normals]),
    )  # fmt: skip


@cache
def recording(n_images: int = 10) -> tuple[Recording, ArticulatedModel]:
    rig, model = make_rig(SCENE), human_model()
    room = furniture(rig)
    things = ModelSubject(room).mesh(Configuration(room, State.neutral(room)))
    states, subject, sets = waves(model, RATE_HZ, n_images), ModelSubject(model), []
    with Studio(rig, SCENE) as studio:
        backgrounds = dict(zip(rig.names, studio.images(things, 10**6), strict=True))
        for i, state in enumerate(states):
            stamp_ns = 10**9 + round(i * 1e9 / RATE_HZ)
            images = studio.images(together(subject.mesh(Configuration(model, state)), things), i)
            shots = (CameraImage(c.name, stamp_ns, image) for c, image in zip(rig, images, strict=True))
            sets.append(ImageSet(stamp_ns, tuple(shots)))
    return Recording(rig, model, tuple(states), tuple(sets), backgrounds), room


def tracked(kind: str, room: ArticulatedModel | None):
    clip, _ = recording()
    tracker = Tracker(
        clip.rig,
        clip.model,
        from_dict({"modalities": [kind], **({"region.first_scales": "8 5 3 2 1"} if kind == "region" else {})}),
        clip.backgrounds,
        clip.states[0],
        room,
    )
    return clip, [tracker.step(s) for s in clip.sets]


@pytest.mark.parametrize("kind", ["region", "chamfer"])
def test_a_person_behind_furniture_is_followed(kind):
    clip, found = tracked(kind, recording()[1])
    errors = clip.errors_mm(found)
    assert {e.status for e in found} == {Status.TRACKING}
    assert errors.mean() < 10.0
    assert errors.max() < 80.0  # of a foot that one camera sees


def test_borders_of_furniture_are_not_taken_for_the_body():
    """Silhouettes end where the desk begins."""
    known, unknown = (clip.errors_mm(found) for clip, found in (tracked("chamfer", room) for room in (recording()[1], None)))
    assert known.mean() < 0.9 * unknown.mean()
    assert known.max() < 0.7 * unknown.max()
