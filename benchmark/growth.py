#!/usr/bin/env python3
"""How the time of an image set grows: with cameras (1 to 12), degrees of freedom (6 to 78), pixels (VGA to 4K), and image rate.

A body of a trunk and arms of two links each, four degrees of freedom an arm, swings before colored patterns; one thing is changed
at a time from three cameras of 640x480 at 30 Hz and 22 degrees of freedom. The focal length goes with the height of the image.
``exponent``: of the power of the last half of the range by which the time grows, 1 where it doubles with what is doubled.
``pixels.ratio_4k``: time with images of 3840x2160, to that with 640x480. Drawn by another renderer than the tracker's; parameters
are the defaults. One plot with all four goes to ``--plot``.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmark._arguments import parser_of
from benchmark._reference import reference_ms
from benchmark.contour._runs import WARM_UP, configured, print_circumstances
from benchmark.contour.box import rig_around, sensed
from tracker_node.camera.rig import CameraRig
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.geometry import se3, so3
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import Axis, Joint, KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid, TruncatedCone
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.scenes.room import cluttered_background
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status
from tracker_node.tracking.tracker import Tracker

TRUNK_M, ARM_M, RADIUS_M = (0.16, 0.13, 0.20), 0.26, 0.035
SWING_RAD, SWING_HZ = np.radians(15.0), 0.5
SETS = {"quick": 8, "full": 30}
CAMERAS, ARMS, RATES_HZ = (1, 2, 3, 4, 6, 9, 12), (0, 2, 4, 8, 12, 18), (15.0, 30.0, 60.0, 120.0)
SIZES = ((640, 480), (1280, 720), (1920, 1080), (2560, 1440), (3840, 2160))
QUICK = {"cameras": (1, 3), "dof": (0, 4), "pixels": (0, 1), "rate": (30.0, 60.0)}


@dataclass(frozen=True)
class Case:
    """One point of a curve."""

    cameras: int = 3
    arms: int = 4
    size: tuple[int, int] = SIZES[0]
    rate_hz: float = 30.0


CURVES: dict[str, tuple[Sequence[float], Callable[[float], Case], Callable[[float], float], str]] = {
    "cameras": (CAMERAS, lambda n: Case(cameras=int(n)), lambda n: n, "cameras"),
    "dof": (ARMS, lambda n: Case(arms=int(n)), lambda n: 6 + 4 * n, "degrees of freedom"),
    "pixels": (range(len(SIZES)), lambda i: Case(size=SIZES[int(i)]), lambda i: 1e-6 * np.prod(SIZES[int(i)]), "megapixels"),
    "rate": (RATES_HZ, lambda hz: Case(rate_hz=hz), lambda hz: hz, "images a second"),
}  # fmt: skip


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    config, reference = configured(args.changes), reference_ms()
    figures: dict[str, float | int] = {"growth.reference_ms": reference}
    curves = {}
    for name, (values, case, amount, _) in CURVES.items():
        values = QUICK[name] if args.quick else values
        points = []
        for value in values:
            times, tracking = measured(case(value), config, SETS["quick" if args.quick else "full"])
            points.append((amount(value), *np.percentile(times, [50, 95])))
            key = f"growth.{name}_{amount(value):.3g}"
            figures |= {f"{key}.set_ms": float(points[-1][1]), f"{key}.tracking": tracking}
            print(f"{name} {amount(value):.3g}: {points[-1][1]:.2f} ms, p95 {points[-1][2]:.2f} ms", flush=True)
        curves[name] = np.array(points)
        figures[f"growth.{name}.exponent"] = exponent(curves[name])
    figures["growth.pixels.ratio_4k"] = float(curves["pixels"][-1, 1] / curves["pixels"][0, 1])
    if args.plot is not None:
        plot(curves, args.plot)
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def exponent(curve: np.ndarray) -> float:
    """Of the power by which the times (n, 3) grow over the last half of the points."""
    (x0, t0, _), (x1, t1, _) = curve[(len(curve) - 1) // 2], curve[-1]
    return float(np.log(t1 / t0) / np.log(x1 / x0))


def body(arms: int) -> ArticulatedModel:
    """A trunk with arms that point to all sides; each in colors of its own."""
    rng = np.random.default_rng(3)
    links, joints = ["trunk"], []
    shapes = [Shape("trunk", "trunk", Ellipsoid(TRUNK_M), color_rgb=(176, 52, 46))]
    for i in range(arms):
        height = 1.0 - (2.0 * i + 1.0) / max(arms, 1)
        azimuth = 2.399963 * i  # the golden angle: none is behind another
        out = np.array([np.sqrt(1.0 - height**2) * np.cos(azimuth), np.sqrt(1.0 - height**2) * np.sin(azimuth), height])
        turn = so3.exp(np.cross([0.0, 0.0, 1.0], out) * np.arccos(height) / max(np.sqrt(1.0 - height**2), 1e-9))
        upper, lower = f"upper_{i}", f"lower_{i}"
        links += [upper, lower]
        place = se3.from_rotation_translation(turn, 0.9 * np.array(TRUNK_M) * out)
        axes = [Axis(f"{upper}_{name}", tuple(np.eye(3)[k]), -1.5, 1.5) for k, name in enumerate("xyz")]
        joints.append(Joint(f"shoulder_{i}", "trunk", upper, place, tuple(axes)))
        elbow = se3.from_rotation_translation(so3.exp(np.array([0.6, 0.0, 0.0])), np.array([0.0, 0.0, ARM_M]))
        joints.append(Joint(f"elbow_{i}", upper, lower, elbow, (Axis(f"{lower}_x", (1.0, 0.0, 0.0), -1.5, 1.5),)))
        for link in (upper, lower):
            cone = TruncatedCone(RADIUS_M, 0.8 * RADIUS_M, -0.3 / ARM_M, -0.02, ARM_M)
            r, g, b = (int(c) for c in rng.integers(40, 220, 3))
            shapes.append(Shape(link, link, cone, color_rgb=(r, g, b)))
    return ArticulatedModel("star", KinematicChain(tuple(links), tuple(joints)), tuple(shapes))


def rig_of(case: Case) -> CameraRig:
    """Cameras all around, at one distance; the body is as large in images of any size."""
    rig = rig_around([(360.0 * i / case.cameras, 15.0 + 20.0 * (i % 2)) for i in range(case.cameras)], distance_m=2.6)
    width, height = case.size
    scale = height / 480.0
    cameras = []
    for camera in rig:
        K = camera.model.K.copy()
        K[:2] *= scale
        K[0, 2], K[1, 2] = 0.5 * (width - 1), 0.5 * (height - 1)
        cameras.append(replace(camera, model=replace(camera.model, width=width, height=height, K=K)))
    return replace(rig, cameras=tuple(cameras))


def measured(case: Case, config: TrackerConfig, sets: int) -> tuple[np.ndarray, float]:
    """Milliseconds of every image set but the first ones, and the share of them that are TRACKING."""
    rig, model = rig_of(case), body(case.arms)
    backgrounds = [cluttered_background(camera, 3) for camera in rig]
    rng = np.random.default_rng(7)
    phases = rng.uniform(0.0, 2.0 * np.pi, model.n_dof)
    tracker = Tracker(rig, model, config, None, swung(model, phases, 0.0))
    times, tracking = [], []
    with TargetStudio(rig, supersampling=1) as studio:
        for i in range(WARM_UP + sets):
            images = studio.images(Configuration(model, swung(model, phases, i / case.rate_hz)), backgrounds)
            one = sensed(rig, images, i, case.rate_hz)
            began = time.perf_counter()
            estimate = tracker.step(one)
            if i >= WARM_UP:
                times.append(1e3 * (time.perf_counter() - began))
                tracking.append(estimate.status is Status.TRACKING)
    return np.array(times), float(np.mean(tracking))


def swung(model: ArticulatedModel, phases: np.ndarray, time_s: float) -> State:
    swing = SWING_RAD * np.sin(2.0 * np.pi * SWING_HZ * time_s + phases)
    root = np.concatenate([0.2 * swing[:3], 0.5 * swing[3:6]])
    return State.neutral(model).retract(np.concatenate([root, swing[6:]]))


def plot(curves: dict[str, np.ndarray], file: Path) -> None:
    """All curves, with lines of proportion."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    for ax, (name, curve) in zip(figure.subplots(2, 2).ravel(), curves.items(), strict=True):
        x, p50, p95 = curve.T
        ax.fill_between(x, p50, p95, alpha=0.2, lw=0.0)
        ax.plot(x, p50, "o-", ms=4, label="median, and up to the 95th percentile")
        ax.plot(x, p50[-1] * x / x[-1], color="0.6", lw=0.8, ls="--", label="proportion")
        ax.set_xlabel(CURVES[name][3])
        ax.set_ylabel("ms an image set")
        ax.set_xlim(0.0)
        ax.set_ylim(0.0)
        ax.spines[["top", "right"]].set_visible(False)
    figure.axes[0].legend(frameon=False, fontsize=8)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=110)


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(
        __doc__, "python benchmark/growth.py --plot out/benchmark/growth.png", "two points a curve, few image sets"
    )
    parser.add_argument("--set", dest="changes", nargs="+", default=[], metavar="KEY=VALUE", help="parameters, e.g. threads=1")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="draw the curves there, PNG or SVG")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    cv2.setNumThreads(1)
    sys.exit(main())
