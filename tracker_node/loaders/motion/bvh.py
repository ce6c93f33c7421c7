"""Motions of a body in BVH files, the hierarchies of animation programs.

A BVH joint is a link of the model, placed by ``OFFSET`` and turned by three Euler angles; the format knows no turned offsets. So
the frames of all joints are those of the file's world where the body stands with the root unturned and all joint angles zero,
and what turns them are rotations against that pose. A joint of any axes becomes one rotation; one that slides gets position
channels, which hold its whole place in its parent and so stand in for the offset. Landmarks, where asked for, are joints
``landmark_NAME`` that never turn, since a joint has one end only.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ..whole_file import write_whole
from .trc import METERS_PER_UNIT

AXES_Y_UP = np.eye(3)[[1, 2, 0]]  # file = AXES_Y_UP @ world
ORDER = "ZXY"
_POSITION = ("Xposition", "Yposition", "Zposition")
_ROTATION = tuple(f"{axis}rotation" for axis in ORDER)


@dataclass(frozen=True, eq=False)
class _Bone:
    """A link as the file has it: ``offset``, ``end`` (3,) in file units; ``channels`` (n, 3 or 6)."""

    name: str
    children: tuple[int, ...]
    offset: np.ndarray
    end: np.ndarray
    channels: np.ndarray


def dump_bvh(
    model: ArticulatedModel,
    Ts_world_link: np.ndarray,
    period_s: float,
    path: str | Path,
    y_up: bool = True,
    unit: str = "m",
    landmarks: Sequence[str] = (),
) -> None:
    """Write a motion at a constant rate.

    Parameters
    ----------
    model, Ts_world_link : body; (n, n_links, 4, 4), the format has no way to leave one out.
    period_s, path : seconds between two; BVH file.
    y_up : turn the world's axes to those of `trc.dump_trc`; the body then looks along z in the pose of zeros.
    unit : of lengths, m, cm or mm.
    landmarks : names of those that become joints.
    """
    bones = _bones(model, Ts_world_link, AXES_Y_UP if y_up else np.eye(3), 1.0 / METERS_PER_UNIT[unit], landmarks)
    lines = ["HIERARCHY", *_hierarchy(bones, 0, ""), "MOTION"]
    lines += [f"Frames: {len(Ts_world_link)}", f"Frame Time: {period_s:.10g}"]
    channels = np.concatenate([bones[i].channels for i in _depth_first(bones, 0)], axis=1)
    lines += [" ".join(f"{value:.9g}" for value in row) for row in channels]
    write_whole(path, "\n".join(lines) + "\n")


def _bones(
    model: ArticulatedModel, Ts_world_link: np.ndarray, axes: np.ndarray, scale: float, landmarks: Sequence[str]
) -> list[_Bone]:
    """Links, then landmarks."""
    chain = model.chain
    zeros = Configuration(model, State(np.eye(4), np.zeros(chain.n_axes)))
    still = axes @ zeros.Ts_world_link[:, :3, :3]
    marked = [model.landmark_index(name) for name in landmarks]
    hangs_on = np.concatenate([chain.parents, model.landmark_links[marked]]).astype(int)
    turned, places = axes @ Ts_world_link[..., :3, :3] @ np.swapaxes(still, -1, -2), scale * Ts_world_link[..., :3, 3] @ axes.T
    channels = _channels(model, turned, places)
    bones = []
    for i, (name, parent) in enumerate(zip(chain.links, chain.parents, strict=True)):
        children = tuple(int(child) for child in np.flatnonzero(hangs_on == i))
        offset = scale * still[parent] @ chain.offsets[i, :3, 3] if parent >= 0 else np.zeros(3)
        bones.append(_Bone("_".join(name.split()), children, offset, scale * still[i] @ _end(model, i), channels[i]))
    for name, mark in zip(landmarks, marked, strict=True):
        offset = scale * still[model.landmark_links[mark]] @ model.landmark_positions[mark]
        unturned = np.zeros((len(Ts_world_link), 3))
        bones.append(_Bone("landmark_" + "_".join(name.split()), (), offset, np.zeros(3), unturned))
    return bones


def _channels(model: ArticulatedModel, turned: np.ndarray, places: np.ndarray) -> list[np.ndarray]:
    """Of every link (n, 3 or 6), of links ``turned`` (n, n_links, 3, 3) from where they stand still, at ``places``."""
    chain, channels = model.chain, []
    for i, parent in enumerate(chain.parents):
        local, place = turned[:, i], places[:, i]
        if parent >= 0:
            to_parent = np.swapaxes(turned[:, parent], -1, -2)
            local, place = to_parent @ local, np.einsum("nij,nj->ni", to_parent, place - places[:, parent])
        angles = np.unwrap(Rotation.from_matrix(local).as_euler(ORDER, degrees=True), axis=0, period=360.0)
        own = chain.axes[chain.axis_start[i] : chain.axis_start[i] + chain.axis_count[i]]
        moves = parent < 0 or any(axis.prismatic for axis in own)
        channels.append(np.concatenate([place, angles], axis=1) if moves else angles)
    return channels


def _end(model: ArticulatedModel, link: int) -> np.ndarray:
    """Where the bone of a last link ends, in the link's frame: its farthest landmark, else the middle of its farthest shape."""
    points = model.landmark_positions[model.landmark_links == link]
    if not len(points):
        points = model.Ts_link_shape[model.shape_links == link][:, :3, 3]
    return points[np.argmax(np.linalg.norm(points, axis=1))] if len(points) else np.zeros(3)


def _hierarchy(bones: list[_Bone], i: int, indent: str) -> Iterator[str]:
    bone, inner = bones[i], indent + "  "
    names = (*_POSITION, *_ROTATION) if bone.channels.shape[1] == 6 else _ROTATION
    yield f"{indent}{'ROOT' if i == 0 else 'JOINT'} {bone.name}"
    yield indent + "{"
    yield inner + _offset(bone.offset)
    yield f"{inner}CHANNELS {len(names)} {' '.join(names)}"
    for child in bone.children:
        yield from _hierarchy(bones, child, inner)
    if not bone.children:
        yield from (inner + "End Site", inner + "{", f"{inner}  {_offset(bone.end)}", inner + "}")
    yield indent + "}"


def _offset(place: np.ndarray) -> str:
    return "OFFSET " + " ".join(f"{value:.9g}" for value in place + 0.0)


def _depth_first(bones: list[_Bone], i: int) -> Iterator[int]:
    yield i
    for child in bones[i].children:
        yield from _depth_first(bones, child)
