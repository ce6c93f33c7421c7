"""People as a detector would find them: the landmarks of a body in a known state, with known offsets, in the images of a rig."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.model.humans.keypoints import BLAZEPOSE, GUESSED_SIZE
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.keypoints.blazepose import NAMES
from tracker_node.observation.keypoints.people import People, Person, Silhouette
from tracker_node.render.raycast.raycaster import render_mask

HUMAN = human_model()
POINTS = tuple(name for name in NAMES if name in BLAZEPOSE and BLAZEPOSE[name].landmark in HUMAN.landmark_names)
"""Those of the detector's points that the human has, in the detector's order."""
ROWS = [NAMES.index(name) for name in POINTS]
_SIDES = str.maketrans({"<": "right", ">": "left"})
_MIRRORED = [NAMES.index(name.replace("left", "<").replace("right", ">").translate(_SIDES)) for name in NAMES]


def standing(x: float = 0.0, y: float = 0.0, turned: float = 0.0, model: ArticulatedModel = HUMAN, **degrees: float) -> State:
    """A person on the floor, turned about the vertical, some joint angles other than neutral."""
    state = State.neutral(model, se3.from_rotation_translation(so3.exp(np.array([0.0, 0.0, turned])), np.array([x, y, 0.95])))
    for name, angle in degrees.items():
        state.joint_positions[model.chain.axis_index(name)] = np.radians(angle)
    return state


def posed(seed: int, share: float = 0.5, tilt: float = 0.3, model: ArticulatedModel = HUMAN) -> State:
    """Somewhere near the middle, turned any way about the vertical and tilted a little; joints within a share of their ranges."""
    rng, chain = np.random.default_rng(seed), model.chain
    turn = so3.exp(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)])) @ so3.exp(tilt * rng.uniform(-1.0, 1.0, 3))
    root = se3.from_rotation_translation(turn, np.array([*rng.uniform(-0.3, 0.3, 2), rng.uniform(0.9, 1.1)]))
    neutral = State.neutral(model).joint_positions
    low, high = np.maximum(chain.lower, -1.5), np.minimum(chain.upper, 1.5)
    to = np.where(rng.random(chain.n_axes) < 0.5, low, high)
    return State(root, neutral + share * rng.random(chain.n_axes) * (to - neutral))


def places(state: State, model: ArticulatedModel = HUMAN, offsets: Mapping[str, np.ndarray] | None = None) -> np.ndarray:
    """(n_points, 3) meters, world, of `POINTS`: landmarks, moved in the axes of their links by the offsets.

    ``offsets`` None: those of the table, for a body of the default size.
    """
    body, found = Configuration(model, state), []
    for name in POINTS:
        row = model.landmark_index(BLAZEPOSE[name].landmark)
        offset = np.array(BLAZEPOSE[name].offset) if offsets is None else offsets[name]
        found.append(body.landmarks_world[row] + body.Ts_world_link[model.landmark_links[row], :3, :3] @ offset)
    return np.array(found)


def person_at(
    camera: Camera, points: np.ndarray, rng: np.random.Generator | None = None, sigma_px: float = 0.0, stated_px: float = 1.0,
    score: float = 1.0, silhouette: Silhouette | None = None,
) -> Person:  # fmt: skip
    """Points of the world (n_points, 3) as one camera sees them, with noise; those of `NAMES` that are none are not found."""
    own, seen = camera.project(points)
    if rng is not None:
        own = own + sigma_px * rng.normal(size=own.shape)
    pixels, scores = np.zeros((len(NAMES), 2)), np.zeros(len(NAMES))
    pixels[ROWS], scores[ROWS] = own, np.where(seen, score, 0.0)
    (left, top), (right, bottom) = own[seen].min(axis=0).tolist(), own[seen].max(axis=0).tolist()
    covariances = np.tile(stated_px**2 * np.eye(2), (len(NAMES), 1, 1))
    return Person(NAMES, pixels, covariances, scores, score, (left, top, right, bottom), silhouette)


def seen_by(
    rig: CameraRig, state: State, rng: np.random.Generator | None = None, sigma_px: float = 0.0,
    offsets: Mapping[str, np.ndarray] | None = None, model: ArticulatedModel = HUMAN, **more: float,
) -> list[Person]:  # fmt: skip
    """A body in each camera of a rig."""
    points = places(state, model, offsets)
    return [person_at(camera, points, rng, sigma_px, **more) for camera in rig]


def with_skeletons(rig: CameraRig, people: Sequence[Person], state: State) -> list[Person]:
    """People with guesses that are right: of a body of usual size in a state, in the axes of each camera."""
    result = []
    for camera, person in zip(rig, people, strict=True):
        skeleton = np.full((len(NAMES), 3), np.nan)
        skeleton[ROWS] = places(state) @ camera.T_cam_world[:3, :3].T / GUESSED_SIZE
        result.append(replace(person, skeleton=skeleton))
    return result


def swapped(person: Person) -> Person:
    """As a detector that takes left for right says it; not by the functions of the package."""
    return replace(person, **{field: getattr(person, field)[_MIRRORED] for field in ("pixels", "covariances", "scores")})


def without(person: Person, names: tuple[str, ...]) -> Person:
    """Some of the points not found: they are anywhere, with a score of 0."""
    pixels, scores = person.pixels.copy(), person.scores.copy()
    for name in names:
        pixels[NAMES.index(name)], scores[NAMES.index(name)] = np.nan, 0.0
    return replace(person, pixels=pixels, scores=scores)


def with_mask(person: Person, camera: Camera, state: State, model: ArticulatedModel = HUMAN) -> Person:
    """With the pixels that the body covers as its silhouette."""
    mask = render_mask(Configuration(model, state), camera)
    return replace(person, silhouette=Silhouette(np.where(mask > 0, 255, 0).astype(np.uint8), (0, 0)))


def image_set(rig: CameraRig, people: list[People | None], stamp_ns: int = 0, pixels: np.ndarray | None = None) -> ImageSet:
    """Images that show nothing, with the people that a detector has found in them."""
    size = rig.cameras[0].model
    pixels = np.full((size.height, size.width, 3), 90, np.uint8) if pixels is None else pixels
    images = (CameraImage(name, stamp_ns, pixels, people=found) for name, found in zip(rig.names, people, strict=True))
    return ImageSet(stamp_ns, tuple(images))


def off_m(one: State, other: State, model: ArticulatedModel = HUMAN) -> np.ndarray:
    """(n_landmarks,) meters between the landmarks of a body in two states."""
    return np.linalg.norm(Configuration(model, one).landmarks_world - Configuration(model, other).landmarks_world, axis=1)
