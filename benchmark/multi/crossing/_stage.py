"""A recording of two people before and while it is drawn: who they are, cameras around them, room, clothes; then the images."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmark.clothed._cameras import SIZE, View, rig_of
from benchmark.clothed._clip import write_markers
from benchmark.clothed._sensor import draw_sensor
from benchmark.clothed._traits import BODIES, FIRST_HELD_OUT, HELD_OUT_BODIES, draw_outfit
from benchmark.clothed.person._body import Body, load_body
from benchmark.clothed.person._clothes import SHIRT, TROUSERS, Outfit, dress
from benchmark.clothed.person._posing import Pose, Poser, skin
from benchmark.clothed.render._empty_scene import draw_empty_scene
from benchmark.clothed.render._people import Crowd, crowd, draw_people, moment
from benchmark.clothed.render._raster import looking_at, nearest, project, view_of
from benchmark.clothed.render._room import Room, draw_room, draw_size
from benchmark.multi.crossing._motion import N_SETS, PHASES, draw_poses
from benchmark.multi.crossing._surfaces import gaps
from benchmark.multi.crossing._walker import RATE_HZ
from tracker_node.errors import SourceError
from tracker_node.geometry import so3
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.synthesis.recording import default_motions

PEOPLE = ("first", "second")
"""The taller one first, whose arms go over the other's shoulders."""
N_CAMERAS = 5

_STOUT = ("heavy_man", "heavy_woman", "stout_old_man")  # arms do not reach around them
_STATURES_M, _DIFFERENCE_M = (1.5, 2.0), (0.02, 0.25)  # of people who take part, and by how much one is taller
_CLOTHES_APART = 0.3  # distance of shirts, and of trousers, sRGB between 0 and 1
_DISTANCE_M, _HEIGHT_M, _MARGIN_PX, _WALL_M = (3.4, 4.8), (1.0, 2.45), 14.0, 0.25
_AROUND_M = 0.15  # hands and hair beyond the markers
_FOLDS_PER_SET, _STATIC_ROWS = 0.12, 10
_FACING = so3.exp([0.0, 0.0, -np.pi / 2])  # of the T-pose in static.trc: -y


@dataclass(frozen=True, eq=False)
class Stage:
    """All that a recording is drawn from; ``poses`` by person and image set."""

    seed: int
    poses: list[list[Pose]]
    views: list[View]
    room: Room
    people: Crowd

    def gaps(self, i: int) -> np.ndarray:
        """(n,) meters of all vertices from the other person's surface, clothes included; negative within."""
        people = self.people.dressed
        return gaps([each.body for each in people], [poses[i] for poses in self.poses], [each.rest for each in people])

    def on_body(self, person: int, i: int, view: View) -> np.ndarray:
        """Whether true joints are where an image has their person, whoever is in front.

        Parameters
        ----------
        person, i : whose joints, in which image set.
        view : a camera.

        Returns
        -------
        (17,) bool; a pixel beside the outline is on it.
        """
        dressed, pose, (width, height) = self.people.dressed[person], self.poses[person][i], view.size
        inverse_depth, face = np.zeros((height, width), np.float32), np.full((height, width), -1, np.int32)
        vertices = project(view.matrix, skin(dressed.body, pose, dressed.rest))
        nearest(vertices, dressed.body.faces.astype(np.int64), True, inverse_depth, face)
        covered = cv2.dilate((face >= 0).astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
        u, v = np.round(project(view.matrix, pose.markers)[:, :2]).astype(int).T
        inside = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        return inside & covered[np.clip(v, 0, height - 1), np.clip(u, 0, width - 1)]


def set_stage(seed: int, bodies: Path) -> Stage:
    """Everything about a recording but its images.

    Parameters
    ----------
    seed : of all that is drawn by chance.
    bodies : folder of the bodies of `benchmark/clothed`.

    Returns
    -------
    The stage.

    Raises
    ------
    SourceError : no captured walk, or no bodies; says how to get them.
    """
    motions = default_motions()
    if motions is None:
        raise SourceError("bullet_motions", "name the folder that holds the captured clips with TRACKER_SHARED_DATA")
    rng = np.random.default_rng([11, seed])
    pair = _draw_pair(seed, bodies, rng)
    poses = draw_poses(pair, Path(motions), rng)
    markers = np.array([[pose.markers for pose in each] for each in poses]).reshape(-1, 3)
    size = draw_size(rng)
    views = _draw_cameras(markers, size[0], rng)
    room = draw_room(size, [], np.array([(view.T_world_cam[:3, 3], at) for view in views for at in markers[::97]]), rng)
    people = [dress(*each) for each in zip(pair, _draw_outfits(room, rng), strict=True)]
    return Stage(seed, poses, views, room, crowd(people))


def _draw_pair(seed: int, folder: Path, rng: np.random.Generator) -> list[Body]:
    """Two grown people of different height, the taller one first."""
    names = HELD_OUT_BODIES if seed >= FIRST_HELD_OUT else BODIES
    everybody = [load_body(name, folder) for name in names if name not in _STOUT]
    grown = [body for body in everybody if _STATURES_M[0] < body.stature < _STATURES_M[1]]
    low, high = _DIFFERENCE_M
    pairs = [[a, b] for a in grown for b in grown if low < a.stature - b.stature < high]
    return pairs[int(rng.integers(len(pairs)))]


def _draw_outfits(room: Room, rng: np.random.Generator) -> list[Outfit]:
    """Clothes of two people who do not wear the same colors."""
    first = draw_outfit(room.wall_color, room.floor_color, rng)
    while True:
        second = draw_outfit(room.wall_color, room.floor_color, rng)
        if np.linalg.norm(first.colors - second.colors, axis=1)[[SHIRT, TROUSERS]].min() > _CLOTHES_APART:
            return [first, second]


def _draw_cameras(markers: np.ndarray, half_sizes: np.ndarray, rng: np.random.Generator) -> list[View]:
    """Cameras around people who stay whole in view."""
    points = (markers[:, None] + np.concatenate([np.eye(3), -np.eye(3)]) * _AROUND_M).reshape(-1, 3)
    angles = rng.uniform(0.0, 2.0 * np.pi) + np.arange(N_CAMERAS) * 2.0 * np.pi / N_CAMERAS + rng.uniform(-0.25, 0.25, N_CAMERAS)
    views = []
    for i, angle in enumerate(angles):
        place = np.array([np.cos(angle), np.sin(angle), 0.0]) * rng.uniform(*_DISTANCE_M)
        place = np.array([*np.clip(place[:2], _WALL_M - half_sizes, half_sizes - _WALL_M), rng.uniform(*_HEIGHT_M)])
        views.append(_aimed(f"cam{i + 1:02d}", place, points, rng))
    return views


def _aimed(name: str, place: np.ndarray, points: np.ndarray, rng: np.random.Generator) -> View:
    """A camera whose image the points fill."""
    pose = looking_at(place, 0.5 * (points.min(axis=0) + points.max(axis=0)))
    for _ in range(3):  # the middle of what is seen to the middle of the image
        uv = project(view_of(np.eye(3), pose), points)[:, :2]
        pose = looking_at(place, place + pose[:3, :3] @ [*(0.5 * (uv.min(axis=0) + uv.max(axis=0))), 1.0])
    middle = np.array(SIZE) / 2.0
    focal = ((middle - _MARGIN_PX) / np.abs(project(view_of(np.eye(3), pose), points)[:, :2]).max(axis=0)).min()
    K = np.diag([focal, focal, 1.0])
    K[:2, 2] = middle - 0.5 + rng.uniform(-4.0, 4.0, 2)
    return View(name, np.round(K, 1), pose, SIZE)


def write_recording(stage: Stage, folder: Path, code: str, seen: Mapping[str, range] | None = None) -> None:
    """Draw a recording: rig.yaml, cam01..cam05 with a JPEG an image set, PERSON/static.trc and truth.trc, clip.json.

    Parameters
    ----------
    stage : what to draw.
    folder : made if it is missing; images in it are replaced.
    code : kept in clip.json, which is written last.
    seen : by person, the image sets in which there is one; None: in all.
    """
    for name in (*PEOPLE, *(view.name for view in stage.views)):
        (folder / name).mkdir(parents=True, exist_ok=True)
    write_rig_file(rig_file_of(rig_of(stage.views)), folder / "rig.yaml")
    for name, person, poses in zip(PEOPLE, stage.people.dressed, stage.poses, strict=True):
        write_markers(np.array([pose.markers for pose in poses]), folder / name / "truth.trc")
        t_pose = Poser(person.body).t_pose().markers @ _FACING.T
        write_markers(np.repeat(t_pose[None], _STATIC_ROWS, axis=0), folder / name / "static.trc")
    _write_images(stage, folder, seen or dict.fromkeys(PEOPLE, range(N_SETS)))
    told = {
        "seed": stage.seed, "bodies": [person.body.name for person in stage.people.dressed], "rate_hz": RATE_HZ, "sets": N_SETS,
        "phases": PHASES, "code": code,
    }  # fmt: skip
    (folder / "clip.json").write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")


def _write_images(stage: Stage, folder: Path, seen: Mapping[str, range]) -> None:
    scenes = [draw_empty_scene(stage.room, view.K, view.T_world_cam, view.size) for view in stage.views]
    sensors = [
        draw_sensor(scene.ambient + scene.by_lamp.sum(axis=0), np.random.default_rng([12, stage.seed, number]))
        for number, scene in enumerate(scenes)
    ]
    together: dict[tuple[int, ...], Crowd] = {}
    for i in range(N_SETS):
        here = tuple(person for person, name in enumerate(PEOPLE) if i in seen[name])
        people = together[here] = together.get(here) or crowd([stage.people.dressed[person] for person in here]) if here else None
        now = None if people is None else moment(people, [stage.poses[p][i] for p in here], stage.room, _FOLDS_PER_SET * i)
        for number, (view, scene, sensor) in enumerate(zip(stage.views, scenes, sensors, strict=True)):
            light = scene.ambient + scene.by_lamp.sum(axis=0)
            if people is not None and now is not None:
                light = draw_people(scene, stage.room, people, now, view.matrix)
            image = sensor.develop(light, np.random.default_rng([13, stage.seed, number, i]))
            sensor.write(image, folder / view.name / f"{i:04d}.jpg")
