"""Every declared parameter counts: another value changes what the tracker says, or a sentence here tells why it does not."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from helpers.bodies import textured_plate
from helpers.bodies.detected_people import seen_by, with_mask, with_skeletons
from helpers.cameras.start_scenes import scene, standing
from helpers.studio.small_studio import Recording, recording
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.tracking.config import TrackerConfig, describe, from_dict
from tracker_node.tracking.estimate import TrackEstimate
from tracker_node.tracking.tracker import Tracker

Estimates = Iterator[TrackEstimate]

WITHOUT_EFFECT = {
    "threads": "sums are in fixed order whatever the number of threads",
    "synchronizer.tolerance": "image sets are formed before the tracker sees them; see the tests of the synchronizer",
    "synchronizer.queue_s": "as synchronizer.tolerance",
    "synchronizer.min_cameras": "as synchronizer.tolerance",
    "self_check.delay_images": "a late camera is named after seconds of motion; see test/tracking/test_self_check.py",
    "synchronizer.image_period_s": "as self_check.delay_images, which counts in it",
    "initialization.min_cameras": "of images that too few cameras give; see test/tracking/initialization/test_detector.py",
    "initialization.interval_sets": "sets without a search after one that failed; see test/tracking/initialization",
    "initialization.after_lost_sets": "when a lost body is searched; see test/tracking/initialization/test_start_again.py",
    "initialization.repaired_candidates": "its search takes minutes here; another value changed what is said",
    "initialization.tracked_candidates": "where several starts are rivals; see test/tracking/initialization/test_trials.py",
    "initialization.tracked_sets": "as repaired_candidates",
    "limb_search.interval_sets": "as initialization.interval_sets; see test/tracking/region/test_limb_search.py",
    "color.few_pixels": "a threshold of a status that this scene never has; see test/tracking/color/test_judge.py",
    "motion.joint_state_sigma_m": "as joint_state_sigma_deg: no joint slides here; see test/tracking/motion/test_model.py",
    "motion.smoother_noise": "of smoothed states alone; see the tests of the smoother",
}
WAYS: dict[str, dict[str, Any]] = {
    "region": {"modalities": ["region"]},
    "chamfer": {"modalities": ["chamfer"]},
    "color": {"modalities": ["color"], "color.learn_colors": True},
    "stepping": {"modalities": ["color"], "color.learn_colors": True, "color.optimizer": "stepping"},
    "rigid": {"modalities": ["color"]},
    "texture": {"modalities": ["texture"]},
    "over background": {"modalities": ["color_over_background"], "color_over_background.learn_colors": True},
    "joint": {"modalities": ["color", "region"]},
    "keypoints": {"modalities": ["region", "keypoints"]},
    "fixed": {"motion.base": "fixed"},
    "floor": {"floor.enabled": True},
}
"""Names of the ways to track, with the parameters that choose them."""


def tilted(rig: CameraRig, degrees: float) -> CameraRig:
    """Its first camera turned: what the self-check finds."""
    first, *others = rig.cameras
    turn = se3.from_rotation_translation(so3.exp(np.radians([0.0, degrees, 0.0])), np.zeros(3))
    return replace(rig, cameras=(replace(first, T_world_cam=first.T_world_cam @ turn), *others))


def displaced(clip: Recording, off_m: float = 0.25) -> State:
    """The first state with an arm elsewhere and the root off: a limb is lost and searched for."""
    state = State(clip.states[0].T_world_root.copy(), clip.states[0].joint_positions.copy())
    state.T_world_root[:3, 3] += (off_m, 0.0, 0.02)  # too far for short lines
    state.joint_positions[clip.model.chain.axis_index("left_shoulder_elevation_front")] += np.radians(60.0)
    return state


def blank(image_set: ImageSet) -> ImageSet:
    return replace(image_set, images=tuple(replace(i, pixels=np.full_like(i.pixels, 90)) for i in image_set.images))


def staggered(image_set: ImageSet) -> ImageSet:
    """The last camera a quarter of a period late."""
    *others, last = image_set.images
    return replace(image_set, images=(*others, replace(last, stamp_ns=last.stamp_ns + 8_000_000)))


def told(e: TrackEstimate) -> bytes:
    """A digest of state, covariances, statuses and faults."""
    digest = hashlib.sha256()
    for array in (e.state.to_values(), e.covariance, e.velocity, e.velocity_covariance):
        digest.update(b"-" if array is None else np.ascontiguousarray(array).tobytes())
    digest.update(repr((e.status, e.status_reason, e.limbs, e.faults, e.residual)).encode())
    return digest.digest()


def followed(config: TrackerConfig) -> Estimates:
    """A person before four cameras, two with an image of the background: an arm is lost at first, then the body for four
    sets, and limbs for some more."""
    clip = recording(16)
    n_known = 4 if config.colors or config.chamfer.silhouette == "background" else 2
    backgrounds = {name: clip.backgrounds[name] for name in clip.rig.names[:n_known]}
    tracker = Tracker(tilted(clip.rig, 1.0), clip.model, config, backgrounds, displaced(clip))
    sets = [blank(s) if 6 <= i < 10 else staggered(s) if i % 2 else s for i, s in enumerate(clip.sets)]
    return map(tracker.step, sets[: 9 if config.colors else None])


def begun_far(config: TrackerConfig) -> Estimates:
    """The same person in one set, begun at many places: in some of them only the widest lines reach."""
    clip = recording(16)
    backgrounds = {name: clip.backgrounds[name] for name in clip.rig.names[:2]}
    for off_m in (0.35, 0.3, 0.4, 0.45, 0.5, -0.3, -0.4):
        yield Tracker(clip.rig, clip.model, config, backgrounds, displaced(clip, off_m)).step(clip.sets[0])


def beside_joint_states(config: TrackerConfig) -> Estimates:
    """The same person, who says where the joints are, some degrees off."""
    clip = recording()
    tracker = Tracker(clip.rig, clip.model, config, None, clip.states[0])
    names = [axis.name for axis in clip.model.chain.axes]
    for one, state in zip(clip.sets[:3], clip.states, strict=False):
        yield tracker.step(replace(one, joint_positions=dict(zip(names, state.joint_positions + 0.05, strict=True))))


def pointed(config: TrackerConfig) -> Estimates:
    """A person whom a detector finds in four cameras, with points and depths of which it is not quite sure."""
    clip = recording()
    tracker = Tracker(clip.rig, clip.model, config, None, clip.states[0])
    for i in range(3):
        people = seen_by(clip.rig, clip.states[i], np.random.default_rng(i), 1.5, score=0.8)
        people = with_skeletons(clip.rig, people, clip.states[0])
        masked = [with_mask(person, camera, clip.states[i]) for person, camera in zip(people, clip.rig, strict=True)]
        images = zip(clip.sets[i].images, masked, strict=True)
        yield tracker.step(replace(clip.sets[i], images=tuple(replace(one, people=(p,)) for one, p in images)))


def waved(config: TrackerConfig) -> Estimates:
    """The plate in three places, gone, and back far off."""
    places = [np.zeros(6), [0.01, 0, 0, 0.05, 0, 0], [0.02, 0.01, 0, 0.1, 0, 0], None, [0.12, -0.1, 0.05, 0.3, 0, 0.2]]
    rig, true = textured_plate.rig(), textured_plate.TRUE
    states = [None if p is None else State(true.T_world_root @ se3.exp(np.asarray(p, dtype=float)), np.zeros(0)) for p in places]
    tracker = Tracker(rig, textured_plate.MODEL, config, None, states[0])
    for n, state in enumerate(states):
        pictures = zip(rig, textured_plate.film(state, n), strict=True)
        images = tuple(CameraImage(camera.name, n * 10**8, pixels) for camera, pixels in pictures)
        yield tracker.step(ImageSet(n * 10**8, images))


def searched(config: TrackerConfig) -> Estimates:
    """A person whom nobody has told anything about, in a room seen empty by half of the cameras, then lost and back elsewhere."""
    made = scene()
    true = standing(made.model, 0.2, -0.2, 0.4, left_hip_flexion=25, right_knee_flexion=20, left_shoulder_elevation_front=40)
    tracker = Tracker(made.rig, made.model, config, {name: made.backgrounds[name] for name in made.rig.names[:2]})
    shots: list[list] = [made.images(None, 0) if n < 1 else made.images(true, n) for n in range(7)]
    shots[3][1:] = [None] * (len(made.rig) - 1)  # one camera alone
    return (tracker.step(made.image_set(n, images)) for n, images in enumerate(shots))


def checked(config: TrackerConfig) -> Estimates:
    """A camera that was turned: what the self-check names."""
    clip = recording()
    tracker = Tracker(tilted(clip.rig, 1.0), clip.model, config, clip.backgrounds, clip.states[0])
    return map(tracker.step, clip.sets)


CHECKED: dict[str, Any] = {"self_check.window_s": 0.2, "self_check.sigmas": 1.0}
QUICKLY_SEARCHED = (
    "enabled", "watch_sets", "size_px", "hypotheses", "candidates", "min_score", "seed",
)  # fmt: skip
"""Parameters of the search that count whatever follows it: the quicker modality."""
BRIEF: dict[str, Any] = {
    "initialization.size_px": 56, "initialization.hypotheses": 24, "initialization.candidates": 3, "initialization.watch_sets": 3,
    "initialization.repaired_candidates": 1, "initialization.tracked_candidates": 2, "initialization.tracked_sets": 2,
    "initialization.interval_sets": 1,
}  # fmt: skip


@cache
def plain(way: str, kind: str) -> list[bytes]:
    return list(map(told, run(way, kind, {})))


def counts(way: str, kind: str, values: dict[str, Any]) -> bool:
    """Whether anything else is said with these values; nothing is tracked beyond the first set of which it is."""
    return any(told(estimate) != before for estimate, before in zip(run(way, kind, values), plain(way, kind), strict=True))


def kind_of(name: str) -> str:
    """Which scene a parameter should count in."""
    if name.startswith("self_check."):
        return "checked"
    if name == "region.wide_scales":
        return "begun far"
    if name == "motion.joint_state_sigma_deg":
        return "joint states"
    return "searched" if name.startswith("initialization.") else "followed"


def run(way: str, kind: str, values: dict[str, Any]) -> Estimates:
    if kind == "searched":
        return searched(from_dict(WAYS[way] | BRIEF | values))
    if kind == "checked":
        return checked(from_dict(WAYS[way] | {"initialization.enabled": False} | CHECKED | values))
    config = from_dict(WAYS[way] | {"initialization.enabled": False} | values)
    if kind in ("begun far", "joint states"):
        return begun_far(config) if kind == "begun far" else beside_joint_states(config)
    if way == "keypoints":
        return pointed(config)
    return waved(config) if way in ("texture", "rigid") else followed(config)


def others(name: str, given: Any) -> Iterator[Any]:
    """Other values of a parameter, those most likely to matter first."""
    entry = describe()[name]
    if isinstance(given, bool):
        yield not given
    elif entry["choices"]:
        yield from (choice for choice in entry["choices"] if choice != given)
    elif isinstance(given, str):
        yield from ("4 1", "12 3")
    else:
        kind, low, high = type(given), entry["low"], entry["high"]
        for value in (2 * given, given / 2, given + 1, 0, 10 * given, low, high):
            value = kind(min(max(value, low), high, key=abs) if abs(value) > 1e6 else min(max(value, low), high))
            if value != given:
                yield value


def cases() -> list[tuple[str, str]]:
    """Each parameter once, with the first way to track that has it and in which it should count."""
    by_way = {
        "color.schedule": "stepping", "color.search_radius": "rigid", "color.fit_gain": "rigid", "combination": "joint",
        "motion.velocity_gain": "color", "motion.velocity_decay": "color",
        "self_check.enabled": "chamfer", "self_check.window_s": "chamfer",
        "self_check.angle_deg": "chamfer", "self_check.sigmas": "chamfer",
        **{f"initialization.{name}": "chamfer" for name in QUICKLY_SEARCHED},
    }  # fmt: skip
    found: dict[str, str] = {}
    for way, values in WAYS.items():
        for name in describe(from_dict(values)):
            if name != "modalities" and name not in WITHOUT_EFFECT:
                found.setdefault(name, by_way.get(name, way))
    return list(found.items())


@pytest.mark.long
@pytest.mark.parametrize(("name", "way"), cases(), ids=lambda value: value)
def test_another_value_changes_what_is_said(name, way):
    kind = kind_of(name)
    given = {"searched": BRIEF, "checked": CHECKED}.get(kind, {}) | WAYS[way]
    value = given.get(name, describe()[name]["default"])
    assert any(counts(way, kind, {name: other}) for other in others(name, value)), f"{name} is inert"


def test_exceptions_are_parameters():
    assert set(WITHOUT_EFFECT) <= set(describe())
