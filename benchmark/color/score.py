#!/usr/bin/env python3
"""How long one color score takes: 18 ellipsoids in three views of 768x576, about 50 000 pixels of mask.

The score is fused: no image is written. Median and 95th percentile in milliseconds on one thread and on two, as a multiple of the
fixed reference kernel; for each light and each way to compare; for many states at once; and what taking in the images costs.
The body stands under an ambient and one directional light unless the name says otherwise. ``score.draw_ms`` is the first pass
alone, from the state to the part in front at each pixel and its depth, in the same views with rows along the body.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from tracker_node.camera.light import Light
from tracker_node.camera.rig import CameraRig
from tracker_node.compiled.kernels import compiled
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import State
from tracker_node.objective.color.alignment import PhotometricObjective
from tracker_node.objective.color.drawing import LANES, N_SURFACE, draw_body, pose_shapes
from tracker_node.objective.color.score import ColorObjective, ColorOptions
from tracker_node.objective.color.views import EXCHANGE, ColorConstants, ColorViews, lying
from tracker_node.parallel import Workers
from tracker_node.render.raycast.coefficients import N_COEFFICIENTS
from tracker_node.report.metrics_file import cpu, report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark._reference import reference_ms
from benchmark.color._scene import ColorScene, make_scene

MASK_PIXELS = 50_000
TARGET_MS = {"avx512f": 0.15}  # with whole vectors of 512 bits; 0.25 with 256
AMBIENT, SUN = Light("ambient", (0.35, 0.35, 0.35)), Light("directional", (0.6, 0.6, 0.6), direction=(-0.5, 0.3, -0.8))
SPOT = Light("spot", (0.5, 0.5, 0.5), position=(3.0, -3.0, 4.0), direction=(-3.0, 3.0, -3.0), half_angle=0.6)
BATCH = 64


def zoomed(scene: ColorScene, pixels: int) -> CameraRig:
    """The rig with focal lengths such that the mask of the first state has about so many pixels."""
    rig = scene.rig
    for _ in range(3):
        count = mask_pixels(scene, rig)
        factor = np.sqrt(pixels / count)
        cameras = []
        for camera in rig:
            K = camera.model.K.copy()
            K[0, 0], K[1, 1] = K[0, 0] * factor, K[1, 1] * factor
            cameras.append(replace(camera, model=replace(camera.model, K=K)))
        rig = replace(rig, cameras=tuple(cameras))
    return rig


def mask_pixels(scene: ColorScene, rig: CameraRig) -> int:
    objective = ColorObjective(scene.model, rig, workers=Workers(1))
    objective.set_images(scene.images[0])
    return int(objective.evaluate(scene.truth[0]).camera_pixels.sum())


@compiled
def _draw(chain, shapes, cameras, images, root, joints, work):
    """The part in front, and its depth, in the buffer of each camera."""
    kinds, dims, links, Ts_link_shape, used, colors = shapes
    params, limits, Ts_cam_world = cameras
    views, rays = images
    Ts_world_link, twists, Ts_world_shape, arrays, buffer = work
    pose_shapes(chain, links, Ts_link_shape, root, joints, Ts_world_link, twists, Ts_world_shape)
    for i in range(views.shape[0]):
        draw_body(
            (kinds, dims, used), colors, Ts_cam_world[i], Ts_world_shape, params[i], limits[i], views[i], rays, arrays, buffer[i]
        )


class Drawing:
    """The first pass of a color score by itself.

    Parameters
    ----------
    model : of smooth shapes.
    rig : cameras without distortion, which the body stands upright in.
    """

    def __init__(self, model: ArticulatedModel, rig: CameraRig):
        cameras = [lying(camera) for camera in rig]
        views, constants = ColorViews(cameras), ColorConstants(model, rig, "raw", 0.0, None)
        chain, n = model.chain, len(model.shapes)
        side = max(max(camera.model.width, camera.model.height) for camera in cameras)
        self._chain = chain.parents, chain.offsets, chain.axis_start, chain.axis_count, chain.directions
        used = np.ones(n, dtype=np.bool_)
        self._shapes = constants.kinds, constants.dims, constants.links, model.Ts_link_shape, used, constants.colors_rgb[0]
        self._cameras = views.params, views.limits, EXCHANGE @ constants.Ts_cam_world
        self._images = views.views, views.rays
        arrays = (
            np.zeros((n, N_COEFFICIENTS), np.float32), np.zeros((n, N_SURFACE), np.float32), np.zeros((n, 4), np.int64),
            np.zeros((n, side, 2), np.int32),
        )  # fmt: skip
        buffers = np.zeros((len(cameras), (side + 2 * LANES) ** 2), np.int32)
        self._work = np.empty((len(chain.parents), 4, 4)), np.empty((model.n_dof, 6)), np.empty((n, 4, 4)), arrays, buffers

    def draw(self, state: State) -> None:
        """Every camera's buffer anew."""
        _draw(
            self._chain, self._shapes, self._cameras, self._images, state.T_world_root, state.joint_positions, self._work
        )  # fmt: skip

    @property
    def pixels(self) -> int:
        """How many pixels the body covers, cameras together, where it has been drawn."""
        return int((self._work[-1] != 0).sum())

    @property
    def visited(self) -> float:
        """Pixels that a drawing visits, where the body has been drawn: of each shape in each row, in whole vectors."""
        kinds, dims, _, _, used, colors = self._shapes
        _, _, Ts_world_shape, arrays, buffers = self._work
        boxes, spans, n = arrays[2], arrays[3], 0
        for i, (params, limits, T_cam_world) in enumerate(zip(*self._cameras, strict=True)):
            view, rays = self._images[0][i], self._images[1]
            shapes = kinds, dims, used
            draw_body(shapes, colors, T_cam_world, Ts_world_shape, params, limits, view, rays, arrays, buffers[i])
            for (_, first, _, end), rows in zip(boxes, spans, strict=True):
                n += int((-((rows[first:end, 0] - rows[first:end, 1]) // LANES) * LANES).sum())
        return float(n)


def timed(work: Callable[[], object], repeats: int) -> np.ndarray:
    """Milliseconds of each of ``repeats`` calls."""
    work()
    times = np.empty(repeats)
    for i in range(repeats):
        began = time.perf_counter()
        work()
        times[i] = 1e3 * (time.perf_counter() - began)
    return times


def measure(repeats: int) -> dict[str, float]:
    """All figures."""
    scene = make_scene(1)
    rig = zoomed(scene, MASK_PIXELS)
    state, images = scene.truth[0], scene.images[0]
    reference = reference_ms()
    metrics: dict[str, float] = {"score.reference_ms": reference}

    def objective(lights: tuple[Light, ...], threads: int = 1, **options) -> ColorObjective:
        made = ColorObjective(scene.model, replace(rig, lights=lights), ColorOptions(**options), workers=Workers(threads))
        made.set_images(images)
        return made

    def report(name: str, work: Callable[[], object], share: int = 1) -> None:
        times = timed(work, repeats) / share
        metrics[f"score.{name}"], metrics[f"score.{name}_p95"] = np.percentile(times, [50, 95]).tolist()
        metrics[f"score.{name}_per_reference"] = metrics[f"score.{name}"] / reference

    lit = objective((AMBIENT, SUN))
    metrics["score.mask_pixels"] = int(lit.evaluate(state).camera_pixels.sum())
    metrics["score.segments"] = len(scene.model.shapes)
    report("fused_ms_1t", lambda: lit.score(state))
    drawing = Drawing(scene.model, rig)
    report("draw_ms", lambda: drawing.draw(state))
    metrics["score.draw_pixels"] = drawing.pixels
    two = objective((AMBIENT, SUN), 2)
    report("fused_ms_2t", lambda: two.score(state))
    states = [state] * BATCH
    report("fused_batch_ms_1t", lambda: lit.scores(states), BATCH)
    report("fused_batch_ms_2t", lambda: two.scores(states), BATCH)
    for name, lights, options in (
        ("ambient", (AMBIENT,), {}),
        ("sun_and_spot", (AMBIENT, SUN, SPOT), {}),
        ("normalized", (AMBIENT, SUN), {"representation": "normalized"}),
        ("blend", (AMBIENT, SUN), {"representation": "blend"}),
        ("every_4th_row", (AMBIENT, SUN), {"row_step": 4}),
    ):
        other = objective(lights, **options)
        report(f"{name}_ms_1t", lambda other=other: other.score(state))

    def take_in() -> None:
        lit.set_images(images)
        lit.score(state)

    report("images_and_score_ms_1t", take_in)
    pyramid = PhotometricObjective(scene.model, replace(rig, lights=(AMBIENT, SUN)), workers=Workers(1))
    pyramid.set_images(images)
    for level in range(pyramid.n_levels):
        at = pyramid.at_level(level)
        report(f"linearize_level{level}_ms_1t", lambda at=at: at.linearize(state))
    return metrics


def main() -> int:
    parser = parser_of(__doc__, "benchmark/color/score.py --json out/benchmark/color_score.json", "fewer repetitions")
    args = parser.parse_args()
    metrics = measure(50 if args.quick else 1000)
    report_metrics(metrics, args.json)
    print(f"target of score.fused_ms_1t: {TARGET_MS.get(str(cpu()['simd']), 0.25)} ms ({cpu()['simd']})")
    return 0


if __name__ == "__main__":
    sys.exit(main())
