"""Files of points in images as other programs write them, from arrays (n_people, n_points, 3) of u, v, score, one an image."""

from __future__ import annotations

import csv
import json
import pickle
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

Images = Sequence[np.ndarray]


def some_people(n_points: int, n_images: int = 4, n_people: int = 2, seed: int = 3) -> list[np.ndarray]:
    """People at random; in the second image nobody, in the third the first one lacks a point."""
    rng = np.random.default_rng(seed)
    images = [rng.uniform([100.0, 50.0, 0.2], [500.0, 400.0, 1.0], (n_people, n_points, 3)).round(3) for _ in range(n_images)]
    images[1] = images[1][:0]
    images[2][0, n_points - 1] = 0.0
    return images


def write_openpose(folder: Path, images: Images, first: int = 0) -> Path:
    """One file an image."""
    folder.mkdir(parents=True, exist_ok=True)
    for i, people in enumerate(images):
        content = {"version": 1.3, "people": [{"pose_keypoints_2d": person.ravel().tolist()} for person in people]}
        (folder / f"{folder.name}_{first + i:012d}_keypoints.json").write_text(json.dumps(content))
    return folder


def write_openpose_zip(path: Path, images: Images) -> Path:
    """One file an image of ``cam1``, not packed."""
    with zipfile.ZipFile(path, "w") as archive:
        for i, people in enumerate(images):
            content = {"people": [{"pose_keypoints_2d": person.ravel().tolist()} for person in people]}
            archive.writestr(f"cam1/cam1_{i:06d}.json", json.dumps(content))
    return path


def _instances(people: np.ndarray) -> list[dict]:
    return [
        {"keypoints": person[:, :2].tolist(), "keypoint_scores": person[:, 2].tolist(), "bbox_score": 0.9} for person in people
    ]


def write_mmpose_images(folder: Path, images: Images) -> Path:
    """One file an image."""
    folder.mkdir(parents=True, exist_ok=True)
    for i, people in enumerate(images):
        (folder / f"{i:06d}.json").write_text(json.dumps(_instances(people)))
    return folder


def write_mmpose_video(path: Path, images: Images, names: Sequence[str] = (), first: int = 1) -> Path:
    """One file for all images; with names as the demos write it, else as the inferencer does."""
    listed = [{"frame_id": first + i, "instances": _instances(people)} for i, people in enumerate(images)]
    meta = {"keypoint_id2name": {str(i): name for i, name in enumerate(names)}}
    path.write_text(json.dumps({"meta_info": meta, "instance_info": listed} if names else listed))
    return path


def write_coco(path: Path, images: Images, wholebody: bool = False) -> Path:
    """A list of results."""
    results = []
    for i, people in enumerate(images):
        for person in people:
            parts = {"keypoints": person}
            if wholebody:
                cuts = np.split(person, [17, 23, 91, 112])
                parts = dict(zip(("keypoints", "foot_kpts", "face_kpts", "lefthand_kpts", "righthand_kpts"), cuts, strict=True))
            points = {key: values.ravel().tolist() for key, values in parts.items()}
            results.append({"image_id": i, "category_id": 1, **points, "score": 0.8})
    path.write_text(json.dumps(results))
    return path


def write_mediapipe_json(path: Path, images: Images, width: int, height: int) -> Path:
    """Shares of the image, several people."""
    size = np.array([width, height])
    frames = []
    for i, people in enumerate(images):
        listed = [
            [dict(zip("xy", ((p[:2] + 0.5) / size).tolist(), strict=True), z=0.0, visibility=p[2]) for p in person]
            for person in people
        ]
        frames.append({"frame": i, "pose_landmarks": listed})
    path.write_text(json.dumps(frames))
    return path


def write_mediapipe_csv(path: Path, images: Images, width: int, height: int) -> Path:
    """The first person of each image, columns x1, y1, z1, v1."""
    n = max(people.shape[1] for people in images)
    rows = []
    for people in images:
        cells = [""] * (4 * n)
        for i, (u, v, score) in enumerate(people[0] if len(people) else []):
            cells[4 * i : 4 * i + 4] = [repr(float(u + 0.5) / width), repr(float(v + 0.5) / height), "0", repr(float(score))]
        rows.append(cells)
    return _csv(path, [[f"{letter}{i + 1}" for i in range(n) for letter in "xyzv"], *rows])


def _columns(names: Sequence[str], individuals: Sequence[str]) -> list[tuple[str, ...]]:
    levels = [("net", *((individual,) if individual else ()), name, c) for individual in individuals for name in names
              for c in ("x", "y", "likelihood")]  # fmt: skip
    return levels


def _table(images: Images, n_individuals: int, n_points: int) -> np.ndarray:
    rows = np.full((len(images), n_individuals, n_points, 3), np.nan)
    for i, people in enumerate(images):
        rows[i, : len(people)] = np.where(people[:, :, 2:] > 0.0, people, np.nan)
    return rows.reshape(len(images), -1)


def write_deeplabcut_csv(path: Path, images: Images, names: Sequence[str], individuals: Sequence[str] = ("",)) -> Path:
    """A level of individuals only where they have names."""
    columns = _columns(names, individuals)
    levels = ("scorer", "bodyparts", "coords") if individuals == ("",) else ("scorer", "individuals", "bodyparts", "coords")
    header = [[level, *(column[i] for column in columns)] for i, level in enumerate(levels)]
    rows = [[i, *("" if np.isnan(x) else repr(float(x)) for x in row)]
            for i, row in enumerate(_table(images, len(individuals), len(names)))]  # fmt: skip
    return _csv(path, [*header, *rows])


def write_deeplabcut_h5(path: Path, images: Images, names: Sequence[str], individuals: Sequence[str] = ("",)) -> Path:
    """As pandas writes tables by PyTables."""
    import h5py

    columns, values = _columns(names, individuals), _table(images, len(individuals), len(names))
    rows = np.zeros(len(images), [("index", "i8"), ("values_block_0", "f8", (len(columns),))])
    rows["index"], rows["values_block_0"] = np.arange(len(images)), values
    with h5py.File(path, "w") as file:
        table = file.create_group("df_with_missing").create_dataset("table", data=rows)
        table.attrs["values_block_0_kind"] = np.bytes_(pickle.dumps(columns, 0))
    return path


def write_sleap_h5(path: Path, images: Images, names: Sequence[str]) -> Path:
    """An analysis file."""
    import h5py

    n_tracks = max(len(people) for people in images)
    values = _table(images, n_tracks, len(names)).reshape(len(images), n_tracks, len(names), 3)
    with h5py.File(path, "w") as file:
        file["tracks"] = values[..., :2].transpose(1, 3, 2, 0)
        file["point_scores"] = values[..., 2].transpose(1, 2, 0)
        file["node_names"] = [name.encode() for name in names]
        file["track_occupancy"] = np.ones((len(images), n_tracks), np.uint8)
    return path


def write_sleap_csv(path: Path, images: Images, names: Sequence[str]) -> Path:
    """An analysis as a table."""
    header = ["track", "frame_idx", "instance.score", *(f"{name}.{end}" for name in names for end in ("x", "y", "score"))]
    rows = [
        [f"track_{k}", i, 0.9, *(repr(float(x)) if found else "" for *_, found, xs in _cells(person) for x in xs)]
        for i, people in enumerate(images)
        for k, person in enumerate(people)
    ]
    return _csv(path, [header, *rows])


def _cells(person: np.ndarray) -> list[tuple[bool, np.ndarray]]:
    return [(bool(point[2] > 0.0), point) for point in person]


def _csv(path: Path, rows: Sequence[Sequence[object]]) -> Path:
    with path.open("w", newline="") as stream:
        csv.writer(stream).writerows(rows)
    return path


def same_people(people: Mapping, images: Images, first_only: bool = False) -> None:
    """Raises AssertionError unless the people read are those of the arrays, whatever their covariances."""
    for i, expected in enumerate(images):
        found = people.get(i, ())
        expected = expected[:1] if first_only else expected
        assert len(found) == len(expected), i
        for person, points in zip(found, expected, strict=True):
            seen = points[:, 2] > 0.0
            np.testing.assert_allclose(person.pixels[seen], points[seen, :2], atol=1e-6)
            np.testing.assert_allclose(person.scores, points[:, 2], atol=1e-9)
            assert np.isfinite(person.pixels).all() and np.isfinite(person.covariances).all()
