#!/usr/bin/env python3
"""How many fused scores one image by pyrender costs: the ellipsoid human in one camera of 768x576, in the same run.

``score.pyrender_full_ms`` is one image by pyrender as it comes: its own materials and samples, an ellipsoid of 1280 triangles for
each segment, the whole image drawn and read back. ``score.pyrender_cropped_ms`` is the same with only the body's bounding box.
``score.pyrender_backend_ms`` is one of our `PyrenderRenderer`: cropped, with finer triangles, labels and the light of the
ray-caster. ``score.fused_one_camera_ms`` is one score of one camera on one thread, which writes no image.
``score.pyrender_ratio`` is the first over the last. Medians; the calls take turns, so that all see the same machine.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import trimesh

from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.model.configuration import Configuration
from tracker_node.objective.color.score import ColorObjective
from tracker_node.parallel import Workers
from tracker_node.render.opengl.renderer import OpenGLContext, PyrenderRenderer
from tracker_node.render.raycast.extent import body_extent
from tracker_node.render.renderer import Region
from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark._reference import reference_ms
from benchmark.color._scene import ColorScene, make_scene

WARM_UP = 3
FUSED_CALLS = 20  # timed together: one is too short for the clock


class PlainPyrender:
    """The scene as a user of pyrender would build it."""

    def __init__(self, scene: ColorScene, camera: Camera, configuration: Configuration):
        self._context = OpenGLContext()
        self._camera, pyrender = camera, self._context.pyrender
        self._scene = pyrender.Scene(bg_color=[0.0, 0.0, 0.0, 0.0])
        for shape, T in zip(scene.model.shapes, configuration.Ts_world_shape, strict=True):
            sphere = trimesh.creation.icosphere(subdivisions=3)
            sphere.apply_scale(shape.primitive.radii)
            sphere.visual.vertex_colors = shape.color_rgb
            self._scene.add(pyrender.Mesh.from_trimesh(sphere), pose=T)
        for light in scene.rig.lights:
            if light.kind == "ambient":
                self._scene.ambient_light = np.array(light.intensity)
            elif light.direction is not None:
                sun = pyrender.DirectionalLight(intensity=3.0 * light.intensity[0])
                self._scene.add(sun, pose=_looking_along(light.direction))
        self._node = self._scene.add(pyrender.IntrinsicsCamera(1.0, 1.0, 0.0, 0.0))
        self._scene.set_pose(self._node, camera.T_world_cam @ np.diag([1.0, -1.0, -1.0, 1.0]))

    def draw(self, region: Region) -> np.ndarray:
        """RGB (h, w, 3) uint8 of a part of the image."""
        K, pyrender = self._camera.model.K, self._context.pyrender
        center = K[0, 2] + 0.5 - region[0], K[1, 2] + 0.5 - region[1]
        self._node.camera = pyrender.IntrinsicsCamera(K[0, 0], K[1, 1], *center)
        renderer: Any = self._context.offscreen
        renderer.viewport_width, renderer.viewport_height = region[2] - region[0], region[3] - region[1]
        return renderer.render(self._scene)[0]

    def close(self) -> None:
        self._context.close()


def _looking_along(direction: tuple[float, float, float]) -> np.ndarray:
    pose, z = np.eye(4), -np.asarray(direction) / np.linalg.norm(direction)
    x = np.cross([0.0, 1.0, 0.0], z)
    pose[:3, :3] = np.column_stack([x / np.linalg.norm(x), np.cross(z, x / np.linalg.norm(x)), z])
    return pose


def medians_ms(works: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    """Median duration of each, called in turns."""
    times: dict[str, list[float]] = {name: [] for name in works}
    for i in range(WARM_UP + rounds):
        for name, work in works.items():
            start = time.perf_counter()
            work()
            if i >= WARM_UP:
                times[name].append(1e3 * (time.perf_counter() - start))
    return {name: float(np.median(values)) for name, values in times.items()}


def measure(rounds: int) -> dict[str, float]:
    """All figures."""
    scene = make_scene(1)
    camera, state = scene.rig.cameras[0], scene.truth[0]
    configuration = Configuration(scene.model, state)
    objective = ColorObjective(scene.model, CameraRig((camera,), lights=scene.rig.lights), workers=Workers(1))
    objective.set_images(scene.images[0][:1])
    whole = 0, 0, camera.model.width, camera.model.height
    part = body_extent(configuration, camera, whole) or whole
    cropped, plain = PlainPyrender(scene, camera, configuration), PlainPyrender(scene, camera, configuration)
    with PyrenderRenderer() as backend:
        times = medians_ms(
            {
                "full": lambda: plain.draw(whole),
                "cropped": lambda: cropped.draw(part),
                "backend": lambda: backend.render_color(configuration, camera, scene.rig.lights, part),
                "fused": lambda: [objective.score(state) for _ in range(FUSED_CALLS)],
            },
            rounds,
        )
    for renderer in (plain, cropped):
        renderer.close()
    fused = times["fused"] / FUSED_CALLS
    return {
        "score.reference_ms": reference_ms(),
        "score.pyrender_egl": float(os.environ.get("PYOPENGL_PLATFORM") == "egl"),
        "score.one_camera_pixels": float(objective.evaluate(state).camera_pixels[0]),
        "score.fused_one_camera_ms": fused,
        "score.pyrender_full_ms": times["full"],
        "score.pyrender_cropped_ms": times["cropped"],
        "score.pyrender_backend_ms": times["backend"],
        "score.pyrender_ratio": times["full"] / fused,
        "score.pyrender_cropped_ratio": times["cropped"] / fused,
        "score.pyrender_backend_ratio": times["backend"] / fused,
    }


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(
        __doc__, "python benchmark/color/against_pyrender.py --json out/color_pyrender.json", "ten rounds instead of a hundred"
    )
    args = parser.parse_args(arguments)
    metrics = measure(10 if args.quick else 100)
    report_metrics(metrics, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
