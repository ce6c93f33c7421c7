"""Runs in which something is wrong on purpose: a limb or all of the start, left and right, the person, a limb that is hidden."""

from __future__ import annotations

import argparse
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmark.clothed._recording import CHAINS, ENDS, JOINTS, LIMB_NAMES, ClothedClip, Cover, limbs_shown
from benchmark.clothed._runs import TOGETHER, Run, WithPeople, replayed, settings, track
from tracker_node.camera.rig import Camera
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import N_ROOT_DOF
from tracker_node.observation.image_set import ImageSet
from tracker_node.observation.keypoints.people import People, Person
from tracker_node.tracking.keypoints.people_groups import mirrored
from tracker_node.tracking.limbs.tree import limbs_of

_LEAST_OFF_M, _TRIES = 0.25, 500  # of the end of a limb that is put wrong
_BEYOND, _MARGIN_M = 0.5, 0.12  # a cover reaches beyond the limb's end by this share of its last bone, and this far around
_GRAY, _NOISE = 110.0, 6.0
_WRONG, _SWAPPED, _HIDDEN, _LATER = "wrong start", "swapped", "hidden", "start of another moment"
_WRONG_SETS, _HIDDEN_SETS, _LATER_SETS, _COVERED = 25, 30, 12, (8, 22)
_DISTURBED = 0.2
AS_FOUND, EXCHANGED, REPLACED = 0, 1, 2
"""What was done to a detection."""


def wrong_limb(clip: ClothedClip, state: State, limb: int, rng: np.random.Generator) -> State:
    """A state with one limb elsewhere.

    Parameters
    ----------
    clip, state : body, and where it is.
    limb : index into `LIMB_NAMES`.
    rng : draws the limb's joint angles within their limits.

    Returns
    -------
    The first one drawn whose end is far enough off; else the farthest.
    """
    dofs = next(each.dofs for each in limbs_of(clip.model) if each.name == LIMB_NAMES[limb])[N_ROOT_DOF:]
    row, chain = clip.model.landmark_index(JOINTS[ENDS[limb]]), clip.model.chain
    place = Configuration(clip.model, state).landmarks_world[row]
    best, farthest = state, 0.0
    for _ in range(_TRIES):
        angles = np.where(dofs, rng.uniform(chain.lower, chain.upper), state.joint_positions)
        wrong = State(state.T_world_root, angles)
        off = float(np.linalg.norm(Configuration(clip.model, wrong).landmarks_world[row] - place))
        if off > farthest:
            best, farthest = wrong, off
        if farthest > _LEAST_OFF_M:
            break
    return best


def disturb(
    people: Sequence[Sequence[People | None]], others: Sequence[Person], fraction: float, rng: np.random.Generator
) -> tuple[list[list[People | None]], np.ndarray]:
    """People with some of them exchanged or replaced.

    Parameters
    ----------
    people : by image set and camera.
    others : people of other clips, who may stand in; empty: sides are exchanged only.
    fraction : of the images; in half of these left and right are exchanged, in half it is another person who was found.
    rng : draws which.

    Returns
    -------
    People by image set and camera, and (n, n_cameras) what was done.
    """
    result, done = [], np.zeros((len(people), max(map(len, people), default=0)), dtype=int)
    for i, row in enumerate(people):
        disturbed: list[People | None] = []
        for camera, found in enumerate(row):
            if found and rng.random() < fraction:
                done[i, camera] = EXCHANGED if not others or rng.random() < 0.5 else REPLACED
            if done[i, camera] == EXCHANGED:
                found = tuple(mirrored(person) for person in found or ())
            elif done[i, camera] == REPLACED:
                found = (others[int(rng.integers(len(others)))],)
            disturbed.append(found)
        result.append(disturbed)
    return result, done


_CLEARLY, _ELSEWHERE, _IS_BODY = 0.05, 0.25, 0.10  # distances as shares of the body's size in the image


@dataclass(frozen=True)
class Decisions:
    """Images with a person in them by what was decided: all, and those of three mistakes."""

    images: int = 0
    left_right_wrong: int = 0
    other_taken: int = 0
    body_left_out: int = 0

    def __add__(self, other: Decisions) -> Decisions:
        return Decisions(
            self.images + other.images, self.left_right_wrong + other.left_right_wrong,
            self.other_taken + other.other_taken, self.body_left_out + other.body_left_out,
        )  # fmt: skip

    @property
    def wrong(self) -> float:
        """Fraction of the images in which a mistake was made."""
        mistakes = self.left_right_wrong + self.other_taken + self.body_left_out
        return mistakes / self.images if self.images else float("nan")


def decisions_of(clip: ClothedClip, run: Run) -> Decisions:
    """What was decided in each image of a run, by the truth."""
    total = Decisions()
    for truth, people, chosen in zip(run.truth_m, run.people, run.chosen, strict=True):
        for i, (camera, found) in enumerate(zip(clip.rig, people, strict=True)):
            if found:
                pixels, seen = camera.project(truth)
                total += decision(found, chosen[i] if chosen else None, pixels[seen], np.flatnonzero(seen))
    return total


def decision(people: People, chosen: Person | None, pixels: np.ndarray, rows: np.ndarray) -> Decisions:
    """Whether the right one was taken for the body, and the right way round.

    Parameters
    ----------
    people : who was found in the image.
    chosen : who of them was taken, as it was read; None: nobody.
    pixels : (k, 2) where the true joints are.
    rows : (k,) which of the 12 they are.

    Returns
    -------
    Of one image. A side is wrong where the other reading is clearly nearer; the person is where half of the joints are
    far away; the body is left out where somebody who was found is clearly it.
    """
    if len(rows) < len(JOINTS) // 2:
        return Decisions()
    size = max(float(np.ptp(pixels, axis=0).max()), 1.0)

    def distances(person: Person) -> np.ndarray:
        own = person.pixels[[person.names.index(JOINTS[row]) for row in rows]]
        return np.linalg.norm(own - pixels, axis=1) / size

    if chosen is None:
        best = min(float(np.median(distances(each))) for person in people for each in (person, mirrored(person)))
        return Decisions(1, body_left_out=int(best < _IS_BODY))
    found, other = distances(chosen), distances(mirrored(chosen))
    if min(np.median(found), np.median(other)) > _ELSEWHERE:
        return Decisions(1, other_taken=1)
    return Decisions(1, left_right_wrong=int(found.mean() - other.mean() > _CLEARLY))


def covers_of(clip: ClothedClip, limb: int, row: int) -> list[Cover | None]:
    """What hides the last part of a limb in each camera."""
    middle, end = clip.truth_m[row, list(CHAINS[limb][1:])]
    points = np.array([middle, end, end + _BEYOND * (end - middle)])
    return [_cover(camera, points) for camera in clip.rig]


def _cover(camera: Camera, points: np.ndarray) -> Cover | None:
    pixels, seen = camera.project(points)
    if not seen.all():
        return None
    depth = float(((points - camera.center) @ camera.T_world_cam[:3, 2]).mean())
    margin = _MARGIN_M * float(camera.model.K[0, 0]) / depth
    low, high = np.floor(pixels.min(axis=0) - margin).astype(int), np.ceil(pixels.max(axis=0) + margin).astype(int)
    size = [camera.model.width, camera.model.height]
    (left, top), (right, bottom) = np.clip(low, 0, size).tolist(), np.clip(high, 0, size).tolist()
    return (left, top, right, bottom) if right > left and bottom > top else None


def covered_sets(clip: ClothedClip, limb: int, covered: range, rows: range) -> Iterator[ImageSet]:
    """Image sets with a gray board before a limb in all cameras.

    Parameters
    ----------
    clip, limb : which, and the index into `LIMB_NAMES`.
    covered : rows in which it is there.
    rows : all.

    Returns
    -------
    One after the other.
    """
    for row in rows:
        image_set = clip.image_set(row)
        if row in covered:
            rng = np.random.default_rng([limb, row])
            images = []
            for image, cover in zip(image_set.images, covers_of(clip, limb, row), strict=True):
                pixels = image.pixels.copy()
                if cover is not None:
                    left, top, right, bottom = cover
                    board = rng.normal(_GRAY, _NOISE, (bottom - top, right - left, 3))
                    pixels[top:bottom, left:right] = np.clip(board, 0, 255)
                images.append(replace(image, pixels=pixels))
            image_set = replace(image_set, images=tuple(images))
        yield image_set


def disturbed_runs(
    clip: ClothedClip, run: Run, others: Sequence[Run], with_people: WithPeople, args: argparse.Namespace
) -> Iterator[tuple[Run, np.ndarray, Decisions]]:
    """Runs in which something is wrong on purpose.

    Parameters
    ----------
    clip, run : its undisturbed run.
    others : undisturbed runs of other clips, whose people stand in.
    with_people : the detector.
    args : of the command line.

    Returns
    -------
    Each run, what the cameras show of its limbs, and the decisions about people, where these were disturbed.
    """
    config, rng = settings(TOGETHER, args.changes), np.random.default_rng(zlib.crc32(clip.name.encode()))
    start = clip.start()
    for limb in rng.permutation(len(LIMB_NAMES))[: 1 if args.quick else 4]:
        rows = range(min(_WRONG_SETS, len(clip)))
        wrong = wrong_limb(clip, start, int(limb), rng)
        tried = track(clip, _WRONG, config, replayed(run.people), wrong, map(clip.image_set, rows))
        yield tried, limbs_shown(clip, tried.rows), Decisions()
    strangers = [person for other in others for row in other.people for people in row for person in people or ()]
    for _ in range(1 if args.quick else 3):
        people, _ = disturb(run.people, [replace(each, silhouette=None) for each in strangers], _DISTURBED, rng)
        tried = track(clip, _SWAPPED, config, replayed(people), start)
        yield tried, limbs_shown(clip, tried.rows), decisions_of(clip, tried)
    for limb in rng.permutation(len(LIMB_NAMES))[: 1 if args.quick else 2]:
        first = int(rng.integers(max(len(clip) - _HIDDEN_SETS, 0) + 1))
        rows = range(first, min(first + _HIDDEN_SETS, len(clip)))
        covered = range(first + _COVERED[0], first + _COVERED[1])
        sets = covered_sets(clip, int(limb), covered, rows)
        tried = track(clip, _HIDDEN, config, with_people, clip.start(first), sets, first)
        covers = [covers_of(clip, int(limb), row) if row in covered else [None] * len(clip.rig) for row in rows]
        yield tried, limbs_shown(clip, rows, covers), Decisions()
    for quarter in range(1, 2 if args.quick else 4):
        first = quarter * len(clip) // 4
        rows = range(first, min(first + _LATER_SETS, len(clip)))
        tried = track(clip, _LATER, config, replayed(run.people[first:]), start, map(clip.image_set, rows), first)
        yield tried, limbs_shown(clip, tried.rows), Decisions()
