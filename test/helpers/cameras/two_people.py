"""Two people of different colors who pass each other before small cameras, drawn by the ray-caster over clutter."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from helpers.cameras.start_scenes import Scene, scene, standing
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.model.configuration import Configuration, State
from tracker_node.observation.image_set import ImageSet
from tracker_node.render.raycast.raycaster import render_view

N_SETS, GAP_M = 30, 0.35
SCENE: Scene = scene()
ONE = SCENE.model
OTHER = replace(ONE, shapes=tuple(replace(s, color_rgb=s.color_rgb[1:] + s.color_rgb[:1]) for s in ONE.shapes))
MODELS = {"one": ONE, "other": OTHER}


def states(i: int) -> dict[str, State]:
    """Where both are in image set ``i``: each goes 1.2 meters along x, past the other."""
    along, swing = 1.2 * i / (N_SETS - 1) - 0.6, 20.0 * np.sin(0.3 * i)
    stride = {"left_hip_flexion": swing, "right_hip_flexion": -swing}
    return {
        "one": standing(ONE, along, 0.5 * GAP_M, 0.0, **stride),
        "other": standing(OTHER, -along, -0.5 * GAP_M, np.pi, **stride),
    }


def pictures(i: int) -> list[np.ndarray]:
    """Noisy BGR images of both."""
    rng, each, found = np.random.default_rng(i), states(i), []
    for camera in SCENE.rig:
        picture = SCENE.backgrounds[camera.name].astype(np.float64)
        depth = np.full(picture.shape[:2], np.inf)
        for name, model in MODELS.items():
            view = render_view(Configuration(model, each[name]), camera)
            for k, shape in enumerate(model.shapes):
                picture[(view.labels == k + 1) & (view.depth < depth)] = shape.color_rgb[::-1]
            depth = np.minimum(depth, view.depth)
        picture = cv2.GaussianBlur(picture, (0, 0), 0.6) + rng.normal(0.0, 3.0, picture.shape)
        found.append(np.clip(picture, 0, 255).astype(np.uint8))
    return found


def image_set(i: int) -> ImageSet:
    """The images, at 30 Hz."""
    return SCENE.image_set(i, pictures(i))


def mean_error_m(name: str, found: State, i: int) -> float:
    """Of the landmarks of a body."""
    model = MODELS[name]
    off = Configuration(model, found).landmarks_world - Configuration(model, states(i)[name]).landmarks_world
    return float(np.linalg.norm(off, axis=1).mean())


def write_recording(folder: Path, n_sets: int) -> Path:
    """``recording.yaml`` with the first image sets as files, and all that it names."""
    cameras = []
    for k, camera in enumerate(SCENE.rig):
        (folder / camera.name).mkdir(parents=True)
        cameras.append(replace(camera, source=f"{camera.name}/*.png"))
        for i in range(n_sets):
            cv2.imwrite(str(folder / camera.name / f"{i:03d}.png"), pictures(i)[k])
    write_rig_file(rig_file_of(replace(SCENE.rig, cameras=tuple(cameras))), folder / "rig.yaml")
    for name, model in MODELS.items():
        dump_model(model, folder / f"{name}.yaml")
        dump_state(states(0)[name], model, folder / f"{name}_start.yaml")
    bodies = [f"  {name}: {{model: {name}.yaml, initial_state: {name}_start.yaml}}" for name in MODELS]
    path = folder / "recording.yaml"
    (folder / "tracker.yaml").write_text("modalities: [region]\n")  # a network does not know what is drawn so
    lines = ["rig: rig.yaml", "output: out", "config: tracker.yaml", "images: {rate_hz: 30}", "bodies:", *bodies]
    path.write_text("\n".join(lines) + "\n")
    return path
