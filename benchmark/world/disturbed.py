#!/usr/bin/env python3
"""What becomes of a perfect track when light or a camera changes: a figure of cones, a rigid box, a clothed person.

``light_step``: from a set on all cameras are darker, x0.6. ``flicker``: in every set all are brighter or darker by up to half.
``one_dark``: one camera is, x0.5. ``calm``: nothing happens. Of one camera: ``frozen``, it repeats its image for ten sets;
``bumped``, it is turned by half a degree; ``defocused``, blurred by a hundredth of its width; ``covered``, a hand is before the
lens; ``noisy``, a third of its pixels show anything; ``delayed``, its images are ten sets old, which points of people tell;
``upside_down``, ever since the tracker was started. Each else begins when the body has been followed for twenty sets; seeds say
at which part of the clip, and which camera. From the true pose, no backgrounds; the person as `track` follows people, by
contours and points, and again by contours alone, in keys of their own (``<clip>_contours``). A set is lost that is called LOST,
or has a joint more than 200 mm off (the box: its middle more than 20 mm); one is turned whose heading is more than 90 degrees
off; ``named``: sets until the camera is named, ``others``: cameras that are named and should not be; ``settled_mm``: the
largest mean error from ten sets after a bump on.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.clothed._recording import JOINTS, default_folders, load_clip
from benchmark.contour._runs import clip_parser, configured, print_circumstances, recorded
from benchmark.contour.box import box_model, box_rig, box_states, image_sets
from benchmark.contour.figure import FIGURE_SCENE, true_states
from benchmark.contour.self_check import turn_of_pixels
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import TrackerError
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.people.detection import DetectionOptions, PeopleDetection
from tracker_node.synthesis.recording import FIGURE_IMAGES, Request
from tracker_node.tracking.config import KEYPOINTS, REGION, TrackerConfig
from tracker_node.tracking.estimate import Status, TrackEstimate
from tracker_node.tracking.tracker import Tracker

BEFORE, DISTURBED, LONG = 20, 20, 60  # image sets
FROZEN_SETS = LATE_SETS = 10
DRAWN = Path("out/clothed")
LOST_JOINT_MM, LOST_BOX_MM, TURNED_COS = 200.0, 20.0, 0.0


BUMPED_DEG, HAND_SHARE, RAIN_SHARE, SENSOR_NOISE = 0.5, 0.8, 0.3, 3.0
TROUBLES = ("frozen", "bumped", "defocused", "covered", "noisy", "delayed", "upside_down")
"""What happens to one camera, which is to be named."""
NAMED_LATE = ("bumped", "covered", "delayed")  # by what agrees less for long; by a detector, after a second
SETTLED_SETS = 10  # after the change, from which on a camera that was bumped is known
ALONE = "_contours"


@dataclass(frozen=True, eq=False)
class Scene:
    """A part of a clip: image sets, where (n, k, 3) joints truly are, and ``places`` (k, 3) of the same in a state.

    ``headings`` are true rotations of the root, (n, 3, 3); None: nobody knows. ``modalities`` are what it is followed by.
    """

    name: str
    rig: CameraRig
    model: ArticulatedModel
    start: State
    sets: list[ImageSet]
    truth_m: np.ndarray
    headings: np.ndarray | None
    places: Callable[[State], np.ndarray]
    lost_mm: float
    modalities: tuple[str, ...] = (REGION,)


def lit(image: CameraImage, factor: float) -> CameraImage:
    pixels = image.pixels.astype(np.float32)
    return replace(image, pixels=np.clip(np.rint(factor * pixels), 0, 255).astype(np.uint8))


Change = Callable[[int, int, CameraImage], CameraImage]
"""The image as it becomes, of sets since the change began, the number of the camera, and the image."""


def handed(image: CameraImage, k: int, rng_seed: int) -> CameraImage:
    """A hand before the lens: out of focus, the color of skin, over most of the image, never quite still."""
    pixels = image.pixels.copy()
    height, width = pixels.shape[:2]
    rng = np.random.default_rng(rng_seed)
    side, tone = rng.uniform(-0.1, 0.1, 2), np.array([120.0, 150.0, 200.0]) * rng.uniform(0.5, 1.0)
    wobble = 0.02 * np.array([np.sin(0.9 * k), np.cos(0.7 * k)])
    center = ((0.5 + side[0] + wobble[0]) * width, (0.5 + side[1] + wobble[1]) * height)
    mask = np.zeros((height, width), dtype=np.float32)
    cv2.ellipse(mask, (center, (HAND_SHARE * width, 1.2 * HAND_SHARE * height), 20.0), 1.0, -1)
    mask = cv2.GaussianBlur(mask, (0, 0), width / 40.0)[..., None]
    return replace(image, pixels=np.rint(mask * tone + (1.0 - mask) * pixels).astype(np.uint8))


def noisy(image: CameraImage, k: int, seed: int) -> CameraImage:
    """A rain of noise: a third of the pixels show any color."""
    rng = np.random.default_rng((seed, k))
    shape = image.pixels.shape
    rain = rng.integers(0, 256, shape, dtype=np.uint8)
    return replace(image, pixels=np.where(rng.random(shape[:2])[..., None] < RAIN_SHARE, rain, image.pixels))


def defocused(image: CameraImage, k: int, seed: int) -> CameraImage:
    """Out of focus; the sensor's noise is as sharp as ever."""
    blurred = cv2.GaussianBlur(image.pixels, (0, 0), image.pixels.shape[1] / 100.0)
    noise = np.random.default_rng((seed, k)).normal(0.0, SENSOR_NOISE, blurred.shape)
    return replace(image, pixels=np.clip(np.rint(blurred + noise), 0, 255).astype(np.uint8))


def bumped(image: CameraImage, camera: Camera, axis: np.ndarray) -> CameraImage:
    source = turn_of_pixels(camera, np.radians(BUMPED_DEG) * axis)
    return replace(image, pixels=cv2.remap(image.pixels, *source, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def troubled(scene: Scene, seed: int) -> int:
    """The camera that something happens to, where it happens to one."""
    return int(np.random.default_rng(seed).integers(len(scene.rig)))


def changes(scene: Scene, seed: int) -> dict[str, Change]:
    """What is done to the images, by name."""
    rng = np.random.default_rng(seed)
    camera, flicker = int(rng.integers(len(scene.rig))), rng.uniform(0.5, 1.5, DISTURBED)
    stuck = scene.sets[BEFORE].images[camera].pixels
    axis = rng.choice([-1.0, 1.0]) * np.eye(3)[int(rng.integers(2))]
    own = [one.images[camera] for one in scene.sets]
    late = {image.stamp_ns: own[max(row - LATE_SETS, 0)].pixels for row, image in enumerate(own)}

    def one(change: Callable[[int, CameraImage], CameraImage]) -> Change:
        return lambda k, i, image: change(k, image) if i == camera else image

    return {
        "bumped": one(lambda k, image: bumped(image, scene.rig.cameras[camera], axis)),
        "defocused": one(lambda k, image: defocused(image, k, seed)),
        "covered": one(lambda k, image: handed(image, k, seed)),
        "noisy": one(lambda k, image: noisy(image, k, seed)),
        "delayed": one(lambda k, image: replace(image, pixels=late[image.stamp_ns])),
        "upside_down": one(lambda k, image: replace(image, pixels=np.ascontiguousarray(image.pixels[::-1, ::-1]))),
        "calm": lambda k, i, image: image,
        "light_step": lambda k, i, image: lit(image, 0.6),
        "flicker": lambda k, i, image: lit(image, float(flicker[k])),
        "one_dark": one(lambda k, image: lit(image, 0.5)),
        "frozen": one(lambda k, image: replace(image, pixels=stuck) if 0 < k <= FROZEN_SETS else image),
    }


def disturbed(scene: Scene, change: Change, since: int = BEFORE, n_sets: int = DISTURBED) -> Iterator[ImageSet]:
    """The sets of a scene, which change from one on."""
    yield from scene.sets[:since]
    for k, one in enumerate(scene.sets[since : BEFORE + n_sets]):
        yield replace(one, images=tuple(change(k, i, image) for i, image in enumerate(one.images)))


DISTURBANCES = ("calm", "light_step", "flicker", "one_dark", *TROUBLES)


def figure_scene(cache: Path, seed: int) -> Scene:
    clip = recorded("figure", Request(subject="figure", n_images=FIGURE_IMAGES, scene=FIGURE_SCENE), cache)
    states, n = true_states(clip), BEFORE + LONG
    first = int(np.random.default_rng(seed).integers(len(states) - n + 1))
    last = first + n
    sets, states = [one for k, one in enumerate(clip.sets(limit=last)) if k >= first], states[first:last]

    def places(state: State) -> np.ndarray:
        return Configuration(clip.model, state).landmarks_world

    truth, headings = np.array([places(s) for s in states]), np.array([s.T_world_root[:3, :3] for s in states])
    return Scene("figure", clip.rig, clip.model, states[0], sets, truth, headings, places, LOST_JOINT_MM)


def box_scene(cache: Path, seed: int) -> Scene:
    model, rig = box_model(), box_rig()
    states = box_states(model, BEFORE + LONG, seed)
    truth, headings = np.array([s.T_world_root[None, :3, 3] for s in states]), np.array([s.T_world_root[:3, :3] for s in states])
    sets = list(image_sets(rig, model, states))
    return Scene("box", rig, model, states[0], sets, truth, headings, lambda s: s.T_world_root[None, :3, 3], LOST_BOX_MM)


def clothed_scene(folder: Path, seed: int) -> Scene:
    clip = load_clip(folder)
    n = min(BEFORE + LONG, len(clip))
    first = int(np.random.default_rng(seed).integers(len(clip) - n + 1))
    last = first + n
    rows = [clip.model.landmark_index(joint) for joint in JOINTS]
    return Scene(
        clip.name, clip.rig, clip.model, clip.start(first), [clip.image_set(row) for row in range(first, last)],
        clip.truth_m[first:last], None, lambda s: Configuration(clip.model, s).landmarks_world[rows], LOST_JOINT_MM,
        (REGION, KEYPOINTS),
    )  # fmt: skip


def judged(scene: Scene, run: list[TrackEstimate], camera: str, since: int = BEFORE) -> dict[str, float]:
    """Lost and turned sets, and the largest mean error, of those from the change on; when ``camera`` was named, and others."""
    changed = range(since, len(run))
    off = [1e3 * np.linalg.norm(scene.places(run[k].state) - scene.truth_m[k], axis=1) for k in changed]
    lost = [run[k].status is Status.LOST or errors.max() > scene.lost_mm for k, errors in zip(changed, off, strict=True)]
    said = [run[k].status is Status.LOST for k in changed]
    turned = 0
    if scene.headings is not None:
        turned = sum(float(run[k].state.T_world_root[:3, 0] @ scene.headings[k][:, 0]) < TURNED_COS for k in changed)
    named_in = [k - since for k in changed if camera in {fault.camera for fault in run[k].faults}]
    others = {fault.camera for k in changed for fault in run[k].faults} - {camera}
    worst = max(errors.mean() for errors in off)
    settled = max((errors.mean() for errors in off[SETTLED_SETS:]), default=0.0)
    return {"lost": sum(lost), "unsaid": sum(a and not b for a, b in zip(lost, said, strict=True)), "turned": turned,
            "worst_mm": float(worst), "settled_mm": float(settled), "named": float(named_in[0]) if named_in else np.inf,
            "others": len(others)}  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    cv2.setNumThreads(1)
    seeds = range(1, 2 if args.quick else 6)
    folder = args.clip or next(iter(default_folders(DRAWN)), None)
    figures: dict[str, float | int] = {}
    try:
        for seed in seeds:
            scenes = [figure_scene(args.cache, seed), box_scene(args.cache, seed)]
            if folder is not None:
                person = clothed_scene(folder, seed)
                scenes += [person, replace(person, name=f"{person.name}{ALONE}", modalities=(REGION,))]
            for scene in scenes:
                config = configured(args.changes, modalities=scene.modalities)
                for name in (name for name in DISTURBANCES if name in (args.only or DISTURBANCES)):
                    if name == "delayed" and KEYPOINTS not in scene.modalities:
                        continue
                    add(figures, scene, name, measured(scene, name, seed, config), seed)
    except TrackerError as error:
        print(f"disturbed: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def measured(scene: Scene, name: str, seed: int, config: TrackerConfig) -> dict[str, float]:
    """What becomes of one scene by one change."""
    tracker = Tracker(scene.rig, scene.model, config, None, scene.start)
    since = 0 if name == "upside_down" else BEFORE  # the tracker is restarted, and knows nothing else
    sets = disturbed(scene, changes(scene, seed)[name], since, LONG if name in NAMED_LATE else DISTURBED)
    if KEYPOINTS in config.modalities:
        detection = PeopleDetection(scene.rig, config, DetectionOptions())
        sets = (detection.with_people(tracker, one) for one in sets)
    return judged(scene, [tracker.step(one) for one in sets], scene.rig.names[troubled(scene, seed)], since)


def add(figures: dict[str, float | int], scene: Scene, name: str, found: dict[str, float], seed: int) -> None:
    """Take the result of one run into the figures, and print it."""
    print(f"{name}, {scene.name}, seed {seed}: {found}", file=sys.stderr, flush=True)
    for owner in (f"{name}.{scene.name}", *(() if scene.name.endswith(ALONE) else (name,))):
        for key, counted in (("lost", "lost_sets"), ("unsaid", "unsaid_sets"), ("turned", "turned")):
            figures[f"{owner}.{counted}"] = figures.get(f"{owner}.{counted}", 0) + int(found[key])
        figures[f"{owner}.error_mm"] = max(figures.get(f"{owner}.error_mm", 0.0), found["worst_mm"])
        figures[f"{owner}.others_named"] = figures.get(f"{owner}.others_named", 0) + int(found["others"])
        if name == "bumped":
            figures[f"{owner}.settled_mm"] = max(figures.get(f"{owner}.settled_mm", 0.0), found["settled_mm"])
        if name in TROUBLES:
            figures[f"{owner}.named_sets"] = max(figures.get(f"{owner}.named_sets", 0.0), found["named"])


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = clip_parser(
        __doc__, "python benchmark/world/disturbed.py --only light_step frozen --clip out/clothed/clip_318", list(DISTURBANCES)
    )
    what = "of a clothed person (default: jump of TRACKER_SHARED_DATA, or one of draw_clips.py)"
    parser.add_argument("--clip", type=Path, metavar="FOLDER", help=what)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
