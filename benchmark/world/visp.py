#!/usr/bin/env python3
"""Rigid boxes side by side with ViSP's model-based tracker (edges, KLT, both), in one run, one thread each.

``box``: a plain box, three cameras. ``teabox``: a box with a picture on every side that is carried on a patterned board, seen by
two cameras side by side. Clips of `box.py` and `things.py`, 90 image sets, five seeds; the start is a little off. ViSP's settings
are those of its tutorial for a box (edges 10 px around, 300 points); ours are the defaults, with the pictures of the model
beside its contours (`modalities: [region, texture]`) for ``teabox``. Errors are medians of the sets that are right (10 mm,
3 degrees); ``ratio_error`` and ``ratio_ms``: ours over the best of ViSP's three that has as many sets right as any, infinite
where we have fewer. ``--tutorial``: the real stereo teabox, beside ViSP's edges and points. It needs a compiler and ViSP (on
Debian ``libvisp-dev``).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from xml.etree import ElementTree

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmark.contour._runs import configured, image_set, print_circumstances
from benchmark.contour.box import box_rig, box_states
from benchmark.world._arguments import seeded_parser, seeds_of
from benchmark.world.things import FAST, RIGHT_M, RIGHT_RAD, SETS, Scene, carried_board, drawn_box, drawn_color, rigid, start_of
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import TrackerError
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import Shape
from tracker_node.model.configuration import State
from tracker_node.model.shapes.primitives import Box
from tracker_node.observation.image_set import ImageSet
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.scenes.room import cluttered_background
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.tracker import Tracker

TEXTURED = "region,texture"  # our modalities where the model has its pictures
WAYS = {"visp_edges": 1, "visp_klt": 2, "visp_both": 3}
SOURCE = Path(__file__).with_name("visp_track.cpp")
LIBRARIES = ("visp_mbt", "visp_io", "visp_core", "visp_klt", "visp_me", "visp_vision")
# The box of the tutorial, and where six of its corners (signs of x, y, z) are in the first image of the left camera
TEABOX_M = (0.165, 0.068, 0.080)
TEABOX_CORNERS = ((-1, 1, 1), (1, 1, 1), (1, -1, 1), (-1, -1, 1), (-1, -1, -1), (1, -1, -1))
TEABOX_PX = ((251.3, 251.3), (501.3, 234.7), (523.3, 324.7), (246.7, 340.0), (266.7, 401.3), (512.0, 385.3))
FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))
CONFIG = """<?xml version="1.0"?>
<conf>
<ecm><mask><size>5</size><nb_mask>180</nb_mask></mask><range><tracking>10</tracking></range>
<contrast><edge_threshold>10000</edge_threshold><mu1>0.5</mu1><mu2>0.5</mu2></contrast><sample><step>4</step></sample></ecm>
<klt><mask_border>5</mask_border><max_features>300</max_features><window_size>5</window_size><quality>0.015</quality>
<min_distance>8</min_distance><harris>0.01</harris><size_block>3</size_block><pyramid_lvl>3</pyramid_lvl></klt>
<camera><u0>{cx}</u0><v0>{cy}</v0><px>{fx}</px><py>{fy}</py></camera>
<face><angle_appear>70</angle_appear><angle_disappear>80</angle_disappear><near_clipping>0.01</near_clipping>
<far_clipping>10</far_clipping><fov_clipping>1</fov_clipping></face>
</conf>
"""


@dataclass(frozen=True, eq=False)
class Poses:
    """What a tracker made of a clip: poses of the box in the world, None where it said that it has none, and milliseconds."""

    poses: list[np.ndarray | None]
    times_ms: np.ndarray


def plain_box(seed: int) -> Scene:
    """Three cameras around a box of one color, before clutter."""
    thing, rig = rigid((Shape("box", "thing", drawn_box(seed), color_rgb=drawn_color(seed)),), "box"), box_rig()
    states = box_states(thing, SETS, [seed, 11], *FAST)
    return Scene(rig, thing, (), states, [cluttered_background(camera, seed + 80) for camera in rig])


def pictured_box(seed: int) -> Scene:
    """A box with a picture on every side, carried on a board."""
    scene = carried_board(seed)
    (shape,) = scene.thing.shapes
    lens = replace(scene.rig.cameras[0], name="side")
    pictures = tuple(np.ascontiguousarray(cluttered_background(lens, 100 * seed + i)[::2, ::2, ::-1]) for i in range(6))
    assert isinstance(shape.primitive, Box)
    return replace(scene, thing=rigid((replace(shape, primitive=Box(shape.primitive.size, textures=pictures)),), "box"))


SCENES: dict[str, Callable[[int], Scene]] = {"box": plain_box, "teabox": pictured_box}


def built(folder: Path) -> Path:
    """ViSP's program, compiled."""
    flags = subprocess.run(["pkg-config", "--cflags", "visp"], capture_output=True, text=True, check=True).stdout.split()
    program = folder / "visp_track"
    libraries = [f"-l{name}" for name in LIBRARIES]
    subprocess.run(["g++", "-O3", "-march=native", "-std=c++17", "-o", program, SOURCE, *flags, *libraries], check=True)
    return program


def by_visp(program: Path, folder: Path, way_number: int, scene: Scene, sets: Sequence[ImageSet], start: State) -> Poses:
    """Poses by ViSP; the images are written to files first, whose reading is not timed."""
    (shape,) = scene.thing.shapes
    assert isinstance(shape.primitive, Box)
    corners = 0.5 * np.array(shape.primitive.size) * [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    lines = ["V1", "8", *(f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in corners), "0", "0", "6"]
    (folder / "box.cao").write_text("\n".join([*lines, *(" ".join(map(str, (4, *face))) for face in FACES), "0", "0", ""]))
    first, arguments = scene.rig.cameras[0], []
    for i, camera in enumerate(scene.rig):
        place = folder / camera.name
        place.mkdir(exist_ok=True)
        fx, fy, cx, cy = camera.model.params[:4]
        (folder / f"{camera.name}.xml").write_text(CONFIG.format(fx=fx, fy=fy, cx=cx, cy=cy))
        np.savetxt(folder / f"{camera.name}.txt", camera.T_cam_world @ first.T_world_cam)
        for number, one in enumerate(sets):
            cv2.imwrite(str(place / f"{number:03d}.png"), cv2.cvtColor(one.images[i].pixels, cv2.COLOR_BGR2GRAY))
        arguments += [folder / f"{camera.name}.xml", folder / f"{camera.name}.txt", place]
    result = folder / "poses.txt"
    np.savetxt(result, first.T_cam_world @ start.T_world_root)
    command = ["taskset", "-c", "0", program, folder / "box.cao", str(way_number), result, *arguments]
    subprocess.run(command, check=True, capture_output=True)  # it says every point that it loses
    poses, times = [], []
    for line in result.read_text().splitlines():
        ms, *numbers = line.split()
        times.append(float(ms))
        poses.append(None if numbers == ["lost"] else first.T_world_cam @ np.array(numbers, dtype=float).reshape(4, 4))
    return Poses(poses, np.array(times))


def by_us(config: TrackerConfig, scene: Scene, sets: Sequence[ImageSet], start: State) -> Poses:
    tracker, poses, times = Tracker(scene.rig, scene.thing, config, None, start), [], []
    for one in sets:
        began = time.perf_counter()
        estimate = tracker.step(one)
        times.append(1e3 * (time.perf_counter() - began))
        poses.append(estimate.state.T_world_root)
    return Poses(poses, np.array(times))


def judged(found: Poses, states: Sequence[State], scene: Scene) -> tuple[np.ndarray, np.ndarray]:
    """(sets,) errors in meters and radians; infinite where there is no pose."""
    off = np.full((len(states), 2), np.inf)
    for row, T, truth in zip(off, found.poses, states, strict=True):
        if T is not None and np.isfinite(T).all():
            difference = State.neutral(scene.thing, T).difference(truth)
            row[:] = np.linalg.norm(difference[:3]), np.linalg.norm(difference[3:6])
    return off[:, 0], off[:, 1]


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    cv2.setNumThreads(1)
    figures: dict[str, float | int] = {}
    try:
        config = configured(args.changes, threads=1)
        with tempfile.TemporaryDirectory() as place:
            program = built(Path(place))
            if args.tutorial:
                figures = recorded(args.tutorial, program, Path(place), config)
            for name in () if args.tutorial else args.only or SCENES:
                ours = configured([f"modalities={TEXTURED}", *args.changes], threads=1) if name == "teabox" else config
                figures |= compared(name, seeds_of(args), program, Path(place), ours)
    except (OSError, subprocess.CalledProcessError) as error:
        wanted = "ViSP's tracker cannot be built or run (on Debian: apt install g++ libvisp-dev)"
        print(f"visp: error: {wanted}: {error}", file=sys.stderr)
        return 2
    except TrackerError as error:
        print(f"visp: error: {error}", file=sys.stderr)
        return 2
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def recorded(tutorial: Path, program: Path, folder: Path, config: TrackerConfig) -> dict[str, float | int]:
    """A real box that is carried on a table, beside ViSP's edges and points: nobody knows the truth any better."""
    first_lens, second_lens = (_lens(tutorial / f"teabox_{side}.xml") for side in ("left", "right"))
    T_right_left = np.loadtxt(tutorial / "cRightMcLeft.txt")
    cameras = Camera("left", first_lens, np.eye(4)), Camera("right", second_lens, se3.inverse(T_right_left))
    rig, thing = CameraRig(cameras), rigid((Shape("box", "thing", Box(TEABOX_M)),), "teabox")
    videos = [cv2.VideoCapture(str(tutorial / f"teabox_{camera.name}.mp4")) for camera in rig]
    sets: list[ImageSet] = []
    while True:
        shown = [video.read() for video in videos]
        if not all(there for there, _ in shown):
            break
        sets.append(image_set(rig, [image for _, image in shown], len(sets) * 40_000_000))
    corners = 0.5 * np.array(TEABOX_M) * np.array(TEABOX_CORNERS)
    _, turn, move = cv2.solvePnP(corners, np.array(TEABOX_PX), first_lens.K, None)
    start = State.neutral(thing, se3.from_rotation_translation(so3.exp(turn.ravel()), move.ravel()))
    scene = Scene(rig, thing, (), [], [])
    truth = [State.neutral(thing, T) for T in by_visp(program, folder, WAYS["visp_both"], scene, sets, start).poses]
    position, angle = judged(by_us(config, scene, sets, truth[0]), truth, scene)
    right = (position <= RIGHT_M) & (angle <= RIGHT_RAD)
    return {
        "visp.tutorial.ours.right": float(right.mean()), "visp.tutorial.ours.apart_mm": 1e3 * float(np.median(position)),
        "visp.tutorial.ours.apart_deg": float(np.degrees(np.median(angle))), "visp.tutorial.sets": len(sets),
    }  # fmt: skip


def _lens(config: Path) -> CameraModel:
    fx, fy, cx, cy = (float(ElementTree.parse(config).findtext(f"camera/{name}", "")) for name in ("px", "py", "u0", "v0"))
    return CameraModel(640, 480, np.array([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]))


def compared(name: str, seeds: Sequence[int], program: Path, folder: Path, config: TrackerConfig) -> dict[str, float | int]:
    """Fractions of the sets that are right, median errors and times of all four trackers on one kind of clip, and ratios."""
    errors: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {who: [] for who in ("ours", *WAYS)}
    times: dict[str, list[np.ndarray]] = {who: [] for who in errors}
    for seed in seeds:
        scene = SCENES[name](seed)
        sets, start = list(scene.sets()), start_of(scene, seed)
        for who in errors:
            if who == "ours":
                found = by_us(config, scene, sets, start)
            else:
                found = by_visp(program, folder, WAYS[who], scene, sets, start)
            errors[who].append(judged(found, scene.states, scene))
            times[who].append(found.times_ms[5:])
            right = np.mean((errors[who][-1][0] <= RIGHT_M) & (errors[who][-1][1] <= RIGHT_RAD))
            said = f"right {right:.2f}, {np.median(found.times_ms):.1f} ms"
            print(f"{name}, seed {seed}, {who}: {said}", file=sys.stderr, flush=True)
    figures: dict[str, float | int] = {}
    for who in errors:
        position, angle = (np.concatenate(part) for part in zip(*errors[who], strict=True))
        right = (position <= RIGHT_M) & (angle <= RIGHT_RAD)
        figures |= {
            f"visp.{name}.{who}.right": float(right.mean()),
            f"visp.{name}.{who}.error_mm": 1e3 * float(np.median(position[right])) if right.any() else np.inf,
            f"visp.{name}.{who}.angle_deg": float(np.degrees(np.median(angle[right]))) if right.any() else np.inf,
            f"visp.{name}.{who}.ms": float(np.median(np.concatenate(times[who]))),
        }
    most = max(figures[f"visp.{name}.{who}.right"] for who in WAYS)
    best = [who for who in WAYS if figures[f"visp.{name}.{who}.right"] >= most - 0.01]
    for ratio, key in (("ratio_error", "error_mm"), ("ratio_ms", "ms")):
        least = min(figures[f"visp.{name}.{who}.{key}"] for who in best)
        loses_more = figures[f"visp.{name}.ours.right"] < most - 0.01  # then the errors of the others do not count
        figures[f"visp.{name}.{ratio}"] = np.inf if loses_more else figures[f"visp.{name}.ours.{key}"] / least
    return figures


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = seeded_parser(__doc__, "visp.py --only box --seeds 3", SCENES)
    what = "only the real teabox: the folder tutorial/tracking/model-based/generic-stereo of ViSP's source"
    parser.add_argument("--tutorial", type=Path, metavar="FOLDER", help=what)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
