"""A clip as a folder: rig.yaml, cam01..cam04 with a JPEG an image set, stills, static.trc, truth.trc, clip.json."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from benchmark.clothed._cameras import View, rig_of
from benchmark.clothed._recording import ROTATIONS
from benchmark.clothed._sensor import Sensor, draw_sensor
from benchmark.clothed._staging import Stage
from benchmark.clothed.person._body import MARKERS
from benchmark.clothed.person._clothes import PATTERNS, SHIRT, TROUSERS
from benchmark.clothed.person._motions import RATE_HZ
from benchmark.clothed.person._posing import POSED, Pose, skin
from benchmark.clothed.render._empty_scene import EmptyScene, draw_empty_scene
from benchmark.clothed.render._people import draw_people, moment
from benchmark.clothed.render._raster import nearest, project
from tracker_node.geometry import so3
from tracker_node.loaders.motion.trc import MarkerTrajectories, dump_trc
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file

_STATIC_ROWS = 10
_FOLDS_PER_SET = 0.12  # phase of the fabric's folds from set to set
_FACING = so3.exp([0.0, 0.0, -np.pi / 2])  # of the T-pose in static.trc: -y


def write_clip(stage: Stage, folder: Path) -> None:
    """Draw a clip.

    Parameters
    ----------
    stage : what to draw.
    folder : made if it is missing; images in it are replaced.
    """
    folder.mkdir(parents=True, exist_ok=True)
    write_rig_file(rig_file_of(rig_of(stage.views)), folder / "rig.yaml")
    write_markers(stage.truth, folder / "truth.trc")
    write_markers(np.repeat((stage.t_pose.markers @ _FACING.T)[None], _STATIC_ROWS, axis=0), folder / "static.trc")
    np.savez_compressed(folder / ROTATIONS, names=list(POSED), rotations=stage.rotations)
    (folder / "clip.json").write_text(json.dumps(description(stage), indent=2) + "\n", encoding="utf-8")
    scenes = [draw_empty_scene(stage.room, view.K, view.T_world_cam, view.size) for view in stage.views]
    sensors = [_write_still(stage, number, scene, folder) for number, scene in enumerate(scenes)]
    for view in stage.views:
        _emptied(folder / view.name)
    for i in range(len(stage.poses[0])):
        _write_set(stage, i, scenes, sensors, folder)


def _emptied(folder: Path) -> None:
    folder.mkdir(exist_ok=True)
    for image in folder.glob("*.jpg"):
        image.unlink()


def _write_still(stage: Stage, number: int, scene: EmptyScene, folder: Path) -> Sensor:
    """Write the image of the empty scene, at another exposure than the others; returns the camera's sensor."""
    rng = np.random.default_rng([8, stage.seed, number])
    empty = scene.ambient + scene.by_lamp.sum(axis=0)
    sensor = draw_sensor(empty, rng)
    exposure = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.02, 0.07) + 1.0)
    (folder / "stills").mkdir(exist_ok=True)
    sensor.write(sensor.develop(empty, rng, exposure), folder / "stills" / f"{stage.views[number].name}.jpg")
    return sensor


def _write_set(stage: Stage, i: int, scenes: list[EmptyScene], sensors: list[Sensor], folder: Path) -> None:
    now = moment(stage.people, [poses[i] for poses in stage.poses], stage.room, _FOLDS_PER_SET * i)
    for number, (view, scene, sensor) in enumerate(zip(stage.views, scenes, sensors, strict=True)):
        light = draw_people(scene, stage.room, stage.people, now, view.matrix)
        image = sensor.develop(light, np.random.default_rng([9, stage.seed, number, i]))
        sensor.write(image, folder / view.name / f"{i:04d}.jpg")


def write_markers(positions: np.ndarray, path: Path) -> None:
    """Write a TRC file.

    Parameters
    ----------
    positions : (n, 17, 3) meters, world with z up.
    path : of the file.
    """
    n = len(positions)
    valid = np.ones(positions.shape[:2], dtype=bool)
    dump_trc(MarkerTrajectories(MARKERS, np.arange(n) / RATE_HZ, positions, RATE_HZ, valid), path)


def description(stage: Stage) -> dict:
    """What a clip shows, for people who read it."""
    traits, outfit = stage.traits, stage.people.dressed[0].outfit
    return {
        "seed": stage.seed,
        "body": traits.cast.body,
        "stature_m": round(stage.people.dressed[0].body.stature, 3),
        "motion": traits.motion.name,
        "mirrored": traits.motion.mirrored,
        "speed": round(traits.motion.speed, 3),
        "sets": len(stage.poses[0]),
        "second_person": traits.passer,
        "obstacle": traits.cast.has_obstacle,
        "shirt_like_wall": outfit.near_wall,
        "trousers_like_floor": outfit.near_floor,
        "shirt": PATTERNS[outfit.patterns[SHIRT]],
        "trousers": PATTERNS[outfit.patterns[TROUSERS]],
        "sleeve": outfit.sleeve,
        "trouser_leg": outfit.trouser_leg,
        "height_px": [round(height) for height in heights_px(stage)],
        "joints_inside": round(joints_inside(stage), 4),
    }


def heights_px(stage: Stage) -> list[float]:
    """Height of the tracked person standing at the middle of the motion, in every camera."""
    foot = stage.truth.reshape(-1, 3).mean(axis=0) * [1.0, 1.0, 0.0]
    ends = np.array([foot, foot])
    ends[1, 2] = stage.people.dressed[0].body.stature
    return [float(np.linalg.norm(np.diff(project(view.matrix, ends)[:, :2], axis=0))) for view in stage.views]


def joints_inside(stage: Stage, every: int = 10) -> float:
    """Fraction of truth markers that lie within the body's own silhouette, over all cameras.

    Parameters
    ----------
    stage : of the clip.
    every : so many image sets one is taken.

    Returns
    -------
    Between 0 and 1; about 1 where truth is right.
    """
    inside = [_inside(stage, view, pose) for pose in stage.poses[0][::every] for view in stage.views]
    return float(np.mean(inside))


def _inside(stage: Stage, view: View, pose: Pose) -> np.ndarray:
    """(17,) whether a marker is in the image, and on the body or a pixel beside it."""
    person = stage.people.dressed[0]
    width, height = view.size
    inverse_depth, face = np.zeros((height, width), np.float32), np.full((height, width), -1, np.int32)
    vertices = skin(person.body, pose, person.rest)
    nearest(project(view.matrix, vertices), person.body.faces.astype(np.int64), True, inverse_depth, face)
    covered = np.pad(face >= 0, 1)
    u, v = np.round(project(view.matrix, pose.markers)[:, :2]).astype(int).T
    seen = (u >= 0) & (u < width) & (v >= 0) & (v < height)
    u, v = np.clip(u, 0, width - 1), np.clip(v, 0, height - 1)
    near = [covered[v + dv, u + du] for du in range(3) for dv in range(3)]
    return seen & np.any(near, axis=0)
