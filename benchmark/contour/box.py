#!/usr/bin/env python3
"""How a rigid object with edges is tracked: a red box of 20 x 12 x 8 cm at 1.1 m, by three cameras and by one.

It moves by 10 mm and turns by 3 degrees from image to image, before cluttered pictures; nobody has seen the empty scene.
Color images of 640x480, f = 560 px, noise of 4 gray levels, blur of 0.6 px, drawn by another renderer than the tracker's. It
starts 5 mm and 2 degrees off. The tracker's parameters are the defaults. Lost: image sets without a track, or in which the box
is more than 100 mm or 30 degrees from the truth.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark._arguments import parser_of
from benchmark.contour._runs import RATE_HZ, Clip, Run, configured, image_set, print_circumstances, time_figures, track
from tracker_node.camera.light import Light
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import TrackerError
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.geometry import so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Box
from tracker_node.observation.image_set import ImageSet
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.scenes.room import cluttered_background
from tracker_node.tracking.estimate import Status

SIZE = (0.20, 0.12, 0.08)
COLOR_RGB = (190, 60, 45)
STEP_M, STEP_RAD = 0.010, np.radians(3.0)
DISTANCE_M, FOCAL_PX, NOISE_LEVELS, BLUR_PX = 1.1, 560.0, 4.0, 0.6
ROOM_M = 0.10  # how far the box goes from where the cameras look
AZIMUTHS_DEG, ELEVATIONS_DEG = (0.0, 115.0, 235.0), (25.0, 35.0, 20.0)
LIGHTS = (Light("ambient", (0.5, 0.5, 0.5)), Light("directional", (0.45, 0.45, 0.45), direction=(-0.4, -0.7, -1.0)))
SETS = {"quick": 20, "full": 150}
START_OFF_M, START_OFF_RAD = 0.005, np.radians(2.0)
LOST_M, LOST_RAD = 0.100, np.radians(30.0)
CAMERAS = {"box_3cams": (0, 1, 2), "box_1cam": (0,)}


def box_model() -> ArticulatedModel:
    return ArticulatedModel("box", KinematicChain(("box",), ()), (Shape("box", "box", Box(SIZE), color_rgb=COLOR_RGB),))


def box_rig() -> CameraRig:
    return rig_around(zip(AZIMUTHS_DEG, ELEVATIONS_DEG, strict=True))


def rig_around(
    directions_deg: Iterable[tuple[float, float]], distance_m: float = DISTANCE_M, focal_px: float = FOCAL_PX,
    middle: tuple[float, float, float] = (0.0, 0.0, 0.0),
) -> CameraRig:  # fmt: skip
    """Cameras of 640x480, all at the same distance from where they look, by azimuth and elevation."""
    K = np.array([[focal_px, 0.0, 319.5], [0.0, focal_px, 239.5], [0.0, 0.0, 1.0]])
    cameras = []
    for i, (azimuth, elevation) in enumerate(np.radians(np.array(list(directions_deg)))):
        back = np.array([np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        T = np.eye(4)
        T[:3, :3] = np.column_stack([right, np.cross(-back, right), -back])
        T[:3, 3] = distance_m * back + middle
        cameras.append(Camera(f"cam{i + 1:02d}", CameraModel(640, 480, K), T))
    return CameraRig(tuple(cameras), lights=LIGHTS)


def box_states(
    model: ArticulatedModel, n: int, seed: int | Sequence[int] = 7, step_m: float = STEP_M, step_rad: float = STEP_RAD,
    on_table: bool = False,
) -> list[State]:  # fmt: skip
    """The box goes a fixed way and turns by a fixed angle from state to state, in directions that change slowly.

    On a table it slides, with rests, ten states or so at first.
    """
    rng = np.random.default_rng(seed)
    rotation = so3.exp((0.0, 0.0, rng.uniform(-np.pi, np.pi)) if on_table else rng.normal(size=3))
    position, heading, axis, goes = np.zeros(3), rng.normal(size=3), rng.normal(size=3), np.ones(n)
    if on_table:
        goes = np.clip(np.sin(0.13 * np.arange(n) - rng.uniform(1.0, 1.3)) * 1.5, 0.0, 1.0)
    states = []
    for go in goes:
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = rotation, position
        states.append(State.neutral(model, T))
        # A pull to the middle keeps it in view
        heading = heading / np.linalg.norm(heading) + 0.15 * rng.normal(size=3) - 0.3 * position / ROOM_M
        axis = axis / np.linalg.norm(axis) + 0.15 * rng.normal(size=3)
        if on_table:
            heading[2], axis[:2] = 0.0, 0.0
        position = position + go * step_m * heading / np.linalg.norm(heading)
        rotation = so3.exp(go * step_rad * axis / np.linalg.norm(axis)) @ rotation
    return states


def image_sets(rig: CameraRig, model: ArticulatedModel, states: list[State], seed: int = 3) -> Iterator[ImageSet]:
    """What the cameras see; drawn as they are asked for."""
    backgrounds = [cluttered_background(camera, seed) for camera in rig]
    with TargetStudio(rig) as studio:
        for number, state in enumerate(states):
            yield sensed(rig, studio.images(Configuration(model, state), backgrounds), number)


def sensed(rig: CameraRig, images: list[np.ndarray], number: int, rate_hz: float = RATE_HZ) -> ImageSet:
    """The image set of drawn images, with the lens's blur and the sensor's noise."""
    for i, image in enumerate(images):
        blurred = cv2.GaussianBlur(image.astype(np.float32), (0, 0), BLUR_PX)
        noise = np.random.default_rng([5, i, number]).standard_normal(image.shape, dtype=np.float32)
        images[i] = np.clip(np.rint(blurred + NOISE_LEVELS * noise), 0, 255).astype(np.uint8)
    return image_set(rig, images, round(number * 1e9 / rate_hz))


def displaced(
    state: State, seed: int | Sequence[int] = 1, off_m: float = START_OFF_M, off_rad: float = START_OFF_RAD
) -> State:  # fmt: skip
    """The state with its root off by so much, in directions drawn by seed."""
    root, tangent = np.random.default_rng(seed).normal(size=6), np.zeros(6 + state.joint_positions.size)
    tangent[:3], tangent[3:6] = off_m * root[:3] / np.linalg.norm(root[:3]), off_rad * root[3:] / np.linalg.norm(root[3:])
    return state.retract(tangent)


def accuracy(run: Run, states: list[State], name: str) -> dict[str, float | int]:
    """Means and maxima of the errors of the root, the middle of the box, over all image sets that are not lost."""
    off = np.array([e.state.difference(truth) for e, truth in zip(run.estimates, states, strict=True)])
    position, angle = np.linalg.norm(off[:, :3], axis=1), np.linalg.norm(off[:, 3:6], axis=1)
    said = np.array([e.status in (Status.LOST, Status.INITIALIZING) for e in run.estimates])
    lost = said | (position > LOST_M) | (angle > LOST_RAD)
    kept = position[~lost], angle[~lost]
    mean, highest = ((np.mean, np.max) if len(kept[0]) else (lambda _: np.nan,) * 2)  # fmt: skip
    figures = {
        "position_mm": 1e3 * float(mean(kept[0])),
        "angle_deg": float(np.degrees(mean(kept[1]))),
        "position_max_mm": 1e3 * float(highest(kept[0])),
        "angle_max_deg": float(np.degrees(highest(kept[1]))),
        "lost": int(lost.sum()),
        "said_lost": int(said.sum()),
        "sets": len(states),
    }
    return {f"{name}.{key}": value for key, value in figures.items()}


def main() -> int:
    args = _arguments()
    model, rig = box_model(), box_rig()
    states = box_states(model, SETS["quick" if args.quick else "full"])
    metrics: dict[str, float | int] = {}
    try:
        config = configured(args.set)
        sets = list(image_sets(rig, model, states))
        if args.pictures:
            write_pictures(args.pictures, sets)
        for name in args.only or CAMERAS:
            chosen = CameraRig(tuple(rig.cameras[i] for i in CAMERAS[name]))
            clip = Clip(Path(), chosen, model, displaced(states[0]))
            shown = [ImageSet(s.stamp_ns, tuple(s.images[i] for i in CAMERAS[name])) for s in sets]
            run = track(clip, config, shown)
            metrics |= accuracy(run, states, name) | time_figures(run, config, name)
    except TrackerError as error:
        print(f"contour_box: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(metrics, args.json)
    return 0


def write_pictures(folder: Path, sets: list[ImageSet]) -> None:
    """The first image set and the middle one."""
    folder.mkdir(parents=True, exist_ok=True)
    for i in (0, len(sets) // 2):
        cv2.imwrite(str(folder / f"set{i:03d}.png"), np.hstack([image.pixels for image in sets[i].images]))


def _arguments() -> argparse.Namespace:
    parser = parser_of(
        __doc__,
        "python benchmark/contour/box.py --quick --json out/benchmark/contour_box.json",
        "few image sets: shows that it runs",
    )
    parser.add_argument("--only", nargs="+", metavar="NAME", choices=CAMERAS, help=f"of {', '.join(CAMERAS)}")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="write two image sets there")
    parser.add_argument("--set", nargs="+", default=[], metavar="KEY=VALUE", help="parameters of the tracker, e.g. threads=1")
    return parser.parse_args()


if __name__ == "__main__":
    sys.exit(main())
