"""A small animal is followed by points, too: what is a length of a person is one of its own size."""

import numpy as np
import pytest

from helpers.cameras.camera_rigs import circle_rig
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3
from tracker_node.model.articulated import ArticulatedModel, Landmark, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import BLAZEPOSE, LandmarkPoint
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid
from tracker_node.objective.lines.correspondences import PartEvidence
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.keypoints.people import Person
from tracker_node.tracking.config import KeypointConfig, StatusConfig, TrackerConfig
from tracker_node.tracking.estimate import LimbStatus, Status
from tracker_node.tracking.keypoints.modality import KeypointModality
from tracker_node.tracking.limbs.judge import LimbJudge, known_m
from tracker_node.tracking.tracker import Tracker

NAMES = ("nose", "neck", "left_ear", "right_ear", "rump", "tail")
TABLE = {name: LandmarkPoint(name, sigma=(0.001, 0.001, 0.001)) for name in NAMES}


def mouse(scale: float = 1.0) -> ArticulatedModel:
    """Ten centimeters from nose to tail."""
    bend = Axis("bend", (0.0, 0.0, 1.0), -1.0, 1.0), Axis("nod", (0.0, 1.0, 0.0), -1.0, 1.0)
    joints = (Joint("neck", "trunk", "head", se3.from_rotation_translation(np.eye(3), scale * np.array([0.03, 0, 0])), bend),)
    shapes = (
        Shape("body", "trunk", Ellipsoid((0.04 * scale, 0.015 * scale, 0.015 * scale))),
        Shape("skull", "head", Ellipsoid((0.015 * scale, 0.01 * scale, 0.01 * scale))),
    )
    at = {"nose": ("head", (0.03, 0, 0)), "left_ear": ("head", (0.01, 0.01, 0.01)), "right_ear": ("head", (0.01, -0.01, 0.01)),
          "neck": ("trunk", (0.03, 0, 0)), "rump": ("trunk", (-0.03, 0, 0.01)), "tail": ("trunk", (-0.07, 0, 0))}  # fmt: skip
    landmarks = tuple(Landmark(name, link, tuple(scale * np.array(place))) for name, (link, place) in at.items())
    return ArticulatedModel("mouse", KinematicChain(("trunk", "head"), joints), shapes, landmarks)


def small(rig: CameraRig, scale: float) -> CameraRig:
    """The rig with all distances times ``scale``."""
    cameras = []
    for camera in rig:
        T = camera.T_world_cam.copy()
        T[:3, 3] *= scale
        cameras.append(Camera(camera.name, camera.model, T))
    return CameraRig(tuple(cameras))


RIG = small(circle_rig(3), 0.08)
MODEL = mouse()


def state_at(k: int) -> State:
    place = np.array([0.001 * k - 0.02, 0.0, 0.08])
    return State(se3.from_rotation_translation(np.eye(3), place), 0.3 * np.sin([0.3 * k, 0.2 * k]))


def seen(camera: Camera, k: int, rng: np.random.Generator) -> Person:
    pixels, _ = camera.project(Configuration(MODEL, state_at(k)).landmarks_world[[MODEL.landmark_index(n) for n in NAMES]])
    pixels = pixels + rng.normal(0.0, 0.5, pixels.shape)
    box = (*pixels.min(axis=0).tolist(), *pixels.max(axis=0).tolist())
    return Person(NAMES, pixels, np.tile(np.eye(2), (len(NAMES), 1, 1)), np.ones(len(NAMES)), 1.0, box)


def image_set(k: int, found: bool = True) -> ImageSet:
    rng = np.random.default_rng(k)
    images = []
    for camera in RIG:
        pixels = np.zeros((camera.model.height, camera.model.width, 3), np.uint8)
        people = (seen(camera, k, rng),) if found else ()
        images.append(CameraImage(camera.name, k * 20_000_000, pixels, people=people))
    return ImageSet(k * 20_000_000, tuple(images))


def error_m(state: State, k: int) -> float:
    there = Configuration(MODEL, state_at(k)).landmarks_world
    return float(np.linalg.norm(Configuration(MODEL, state).landmarks_world - there, axis=1).max())


def test_lengths_go_by_the_size_of_bodies_that_are_no_people():
    for model, table, expected in ((human_model(), BLAZEPOSE, 1.0), (MODEL, TABLE, 0.0537), (mouse(120.0), TABLE, 6.44)):
        assert KeypointModality(RIG, model, KeypointConfig(), table).size == pytest.approx(expected, rel=0.01)
    assert [known_m(model) for model in (human_model(), MODEL, mouse(120.0))] == pytest.approx([0.03, 0.00264, 0.03], rel=0.01)


@pytest.mark.parametrize(
    ("sigma_m", "expected"), [(0.002, LimbStatus.TRACKING), (0.005, LimbStatus.DEGRADED), (0.02, LimbStatus.LOST)]
)
def test_a_limb_of_a_mouse_is_lost_within_less_than_that_of_a_person(sigma_m, expected):
    samples, covariance = np.full((3, 2), 20.0), np.zeros((MODEL.n_dof, MODEL.n_dof))
    found = 0.85 * samples
    evidence = PartEvidence(samples, found, found, found, 14.0 * found, 0.0 * samples, samples - found)
    covariance[0, 0] = sigma_m**2
    judge = LimbJudge(MODEL, StatusConfig())
    for _ in range(3):
        reports = judge.update(evidence, state_at(0), covariance, np.array([np.nan, -4.0]))
    assert reports[1].status is expected


def test_a_mouse_is_followed_by_points_alone_and_again_once_they_are_back():
    tracker = Tracker(RIG, MODEL, TrackerConfig(modalities=("keypoints",)), initial_state=state_at(0), keypoints=TABLE)
    for k in range(60):
        estimate = tracker.step(image_set(k, not 15 <= k < 40))
        if k < 15 or k > 42:
            assert estimate.status is Status.TRACKING and error_m(estimate.state, k) < 0.003
        if 35 <= k < 40:  # longer than after which bodies are searched in images, where points alone tell nothing
            assert estimate.status is Status.LOST
