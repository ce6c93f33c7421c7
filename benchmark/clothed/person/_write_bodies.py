#!/usr/bin/env python3
"""Skinned bodies of the package anny as .npz files, so that drawing needs neither anny nor torch.

This program runs in an environment of its own; it imports nothing of this project. Bodies stand in body axes (x forward, y left,
z up), soles at z = 0; the bones of anny are merged into the joints that motions turn.

With ``--lengths N`` it draws N people instead, fat and thin, children and old, and writes how long their segments are:
``python -m benchmark.clothed._fit --lengths FILE`` makes the table of `tracker_node.model.shape_parameters` of them.
"""

from __future__ import annotations

import argparse
import csv
import sys
from pathlib import Path

import numpy as np

# Name -> what anny is asked for, and stature in meters. Gender 0: male, 1: female; age 0.33: child, 0.67: adult, 1: old; weight
# beyond 1: extrapolated.
BODIES: dict[str, tuple[dict[str, float], float]] = {
    "man": ({"gender": 0.0, "age": 0.67, "muscle": 0.55, "weight": 0.5, "height": 0.45, "proportions": 0.6}, 1.78),
    "woman": ({"gender": 1.0, "age": 0.62, "muscle": 0.5, "weight": 0.45, "height": 0.45, "proportions": 0.6}, 1.66),
    "child": ({"gender": 0.0, "age": 0.34, "muscle": 0.5, "weight": 0.5, "height": 0.4, "proportions": 0.5}, 1.30),
    "heavy_man": ({"gender": 0.0, "age": 0.78, "muscle": 0.45, "weight": 1.9, "height": 0.4, "proportions": 0.35}, 1.74),
    "heavy_woman": ({"gender": 1.0, "age": 0.8, "muscle": 0.45, "weight": 1.8, "height": 0.4, "proportions": 0.35}, 1.63),
    "tall_man": ({"gender": 0.0, "age": 0.6, "muscle": 0.45, "weight": 0.22, "height": 0.7, "proportions": 0.6}, 1.96),
    "athlete": ({"gender": 0.0, "age": 0.67, "muscle": 0.95, "weight": 0.55, "height": 0.5, "proportions": 0.7}, 1.85),
    "old_woman": ({"gender": 1.0, "age": 0.97, "muscle": 0.35, "weight": 0.55, "height": 0.35, "proportions": 0.4}, 1.56),
    "teenager": ({"gender": 1.0, "age": 0.5, "muscle": 0.45, "weight": 0.35, "height": 0.45, "proportions": 0.55}, 1.52),
    "girl": ({"gender": 1.0, "age": 0.35, "muscle": 0.5, "weight": 0.6, "height": 0.35, "proportions": 0.5}, 1.24),
    "stout_old_man": ({"gender": 0.0, "age": 0.95, "muscle": 0.4, "weight": 1.5, "height": 0.35, "proportions": 0.4}, 1.69),
    "sportswoman": ({"gender": 1.0, "age": 0.64, "muscle": 0.85, "weight": 0.45, "height": 0.55, "proportions": 0.7}, 1.75),
    "tall_woman": ({"gender": 1.0, "age": 0.66, "muscle": 0.5, "weight": 0.6, "height": 0.65, "proportions": 0.5}, 1.81),
    "small_man": ({"gender": 0.0, "age": 0.7, "muscle": 0.5, "weight": 0.4, "height": 0.3, "proportions": 0.4}, 1.62),
}

# Joint -> its parent, and the bones of anny that it carries: the first is where it sits, and all that hang from them.
_SPINE = {
    "pelvis": ("", ("root", "pelvis.L", "pelvis.R", "spine05")),
    "spine1": ("pelvis", ("spine04", "spine03")),
    "spine2": ("spine1", ("spine02",)),
    "spine3": ("spine2", ("spine01",)),
    "neck": ("spine3", ("neck01", "neck02", "neck03")),
    "head": ("neck", ("head",)),
}
_LIMBS = {
    "clavicle": ("spine3", ("clavicle", "shoulder01")),
    "shoulder": ("clavicle", ("upperarm01", "upperarm02")),
    "elbow": ("shoulder", ("lowerarm01", "lowerarm02")),
    "wrist": ("elbow", ("wrist",)),
    "hip": ("pelvis", ("upperleg01", "upperleg02")),
    "knee": ("hip", ("lowerleg01", "lowerleg02")),
    "ankle": ("knee", ("foot",)),
}
_BODY_FROM_ANNY = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # anny: x left, y backward, z up
_N_WEIGHTS = 4  # joints a vertex, at most
_SEED = 1  # of the people whose lengths are written...
_SEED_OF_PEOPLE = 77  # ...and of those whose bodies are

# Length -> the joints at its ends, the middle of both sides where a joint has no side.
LENGTHS = {
    "upper_arm": ("left_shoulder", "left_elbow"),
    "forearm": ("left_elbow", "left_wrist"),
    "thigh": ("left_hip", "left_knee"),
    "shank": ("left_knee", "left_ankle"),
    "trunk": ("shoulder", "hip"),
    "shoulders": ("left_shoulder", "right_shoulder"),
    "hips": ("left_hip", "right_hip"),
}


def joint_table() -> dict[str, tuple[str, tuple[str, ...]]]:
    """Every joint after its parent, and the bones that it carries."""
    table = dict(_SPINE)
    for side, letter in (("left", "L"), ("right", "R")):
        for joint, (parent, bones) in _LIMBS.items():
            up = parent if parent in _SPINE else f"{side}_{parent}"
            table[f"{side}_{joint}"] = (up, tuple(f"{bone}.{letter}" for bone in bones))
    return table


def _joint_of_bones(labels: list[str], parents: list[int]) -> np.ndarray:
    """(n_bones,) joint that carries every bone."""
    table = joint_table()
    names = list(table)
    carried = {bone: names.index(joint) for joint, (_, bones) in table.items() for bone in bones}
    found: list[int] = []
    for i, label in enumerate(labels):
        found.append(carried.get(label, found[parents[i]] if i else 0))
    return np.array(found)


def _strongest(joint_of_bone: np.ndarray, indices: np.ndarray, weights: np.ndarray, n_joints: int):
    """Joints and weights (n, 4) of every vertex."""
    dense = np.zeros((len(weights), n_joints))
    rows = np.repeat(np.arange(len(weights)), weights.shape[1])
    np.add.at(dense, (rows, joint_of_bone[indices].ravel()), weights.ravel())
    order = np.argsort(-dense, axis=1, kind="stable")[:, :_N_WEIGHTS]
    kept = np.take_along_axis(dense, order, axis=1)
    return order.astype(np.int32), (kept / kept.sum(axis=1, keepdims=True)).astype(np.float32)


def body_arrays(model, phenotype: dict[str, float], stature: float) -> dict[str, np.ndarray]:
    """What the file of a body holds.

    Parameters
    ----------
    model : anny's.
    phenotype : values between 0 and 1.
    stature : meters.

    Returns
    -------
    Arrays by name; places in meters.
    """
    vertices, bones = _at_rest(model, phenotype)
    scale = stature / np.ptp(vertices[:, 2])
    floor = np.array([0.0, 0.0, vertices[:, 2].min()])
    vertices, bones = (vertices - floor) * scale, (bones - floor) * scale
    labels, table = list(model.bone_labels), joint_table()
    joint_of_bone = _joint_of_bones(labels, list(model.bone_parents))
    indices, weights = _strongest(joint_of_bone, model.vertex_bone_indices.numpy(), model.vertex_bone_weights.numpy(), len(table))
    eyes = np.isin(model.vertex_bone_indices.numpy(), [labels.index("eye.L"), labels.index("eye.R")])
    return {
        "vertices": vertices,
        "faces": model.faces.numpy().astype(np.int32),
        "joints": np.array([bones[labels.index(held[0])] for _, held in table.values()]),
        "weight_joints": indices,
        "weights": weights,
        "toes": np.array([bones[labels.index(f"toe1-1.{letter}")] for letter in "LR"]),
        "eyes": (eyes * model.vertex_bone_weights.numpy()).sum(axis=1) > 0.5,
    }


def _at_rest(model, phenotype: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Places of the vertices and of the bones' heads, meters, body axes."""
    rest = model(phenotype_kwargs=phenotype)
    vertices = rest["rest_vertices"][0].numpy().astype(np.float64) @ _BODY_FROM_ANNY.T
    return vertices, rest["rest_bone_heads"][0].numpy().astype(np.float64) @ _BODY_FROM_ANNY.T


def draw_phenotype(rng: np.random.Generator) -> dict[str, float]:
    """What anny is asked for: a quarter children, two of five heavy."""
    return {
        "gender": float(rng.integers(0, 2)),
        "age": float(rng.choice([rng.uniform(0.33, 0.5), rng.uniform(0.5, 1.0)], p=[0.25, 0.75])),
        "muscle": rng.uniform(0.35, 0.95),
        "weight": float(rng.choice([rng.uniform(0.2, 0.6), rng.uniform(0.6, 1.9)], p=[0.6, 0.4])),
        "height": float(np.clip(rng.normal(0.5, 0.12), 0.2, 0.8)),
        "proportions": rng.uniform(0.35, 0.7),
    }


def segment_lengths(model, phenotype: dict[str, float]) -> list[float]:
    """The `LENGTHS` of a person.

    Parameters
    ----------
    model : anny's.
    phenotype : values between 0 and 1, weight beyond.

    Returns
    -------
    Meters.
    """
    _, bones = _at_rest(model, phenotype)
    labels = list(model.bone_labels)
    joints = {name: bones[labels.index(held[0])] for name, (_, held) in joint_table().items()}
    for name in ("shoulder", "hip"):
        joints[name] = 0.5 * (joints[f"left_{name}"] + joints[f"right_{name}"])
    return [float(np.linalg.norm(joints[one] - joints[other])) for one, other in LENGTHS.values()]


def _write_lengths(path: Path, model, n_people: int) -> None:
    rng = np.random.default_rng(_SEED)
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(LENGTHS)
        for _ in range(n_people):
            writer.writerow([f"{length:.6f}" for length in segment_lengths(model, draw_phenotype(rng))])
    print(f"wrote {path}")


def _write_people(folder: Path, model, n_people: int) -> None:
    rng = np.random.default_rng(_SEED_OF_PEOPLE)
    for i in range(n_people):
        phenotype = draw_phenotype(rng)
        vertices, _ = _at_rest(model, phenotype)
        np.savez_compressed(folder / f"p{i}.npz", **body_arrays(model, phenotype, float(np.ptp(vertices[:, 2]))))
        print(f"wrote {folder / f'p{i}.npz'}", flush=True)


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__.splitlines()[0],
        epilog="example:\n  out/anny/bin/python benchmark/clothed/person/_write_bodies.py --output out/clothed/bodies",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--output", type=Path, default=Path("out/clothed/bodies"), metavar="FOLDER", help="default: %(default)s")
    parser.add_argument("--people", type=int, metavar="N", help="write N people who are drawn instead, p0.npz and so on")
    parser.add_argument("--lengths", type=int, metavar="N", help="write lengths.csv of N people who are drawn instead")
    args = parser.parse_args(arguments)
    import anny
    import torch

    torch.set_num_threads(1)
    args.output.mkdir(parents=True, exist_ok=True)
    model = anny.Anny(rig="anny", topology="anny", extrapolate_phenotypes=True)
    with torch.no_grad():
        if args.lengths:
            _write_lengths(args.output / "lengths.csv", model, args.lengths)
            return 0
        if args.people:
            _write_people(args.output, model, args.people)
            return 0
        for name, (phenotype, stature) in BODIES.items():
            np.savez_compressed(args.output / f"{name}.npz", **body_arrays(model, phenotype, stature))
            print(f"wrote {args.output / name}.npz", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
