"""Masses of a person's segments, their centers and moments of inertia, scaled to the lengths of a body.

P. de Leva, *Adjustments to Zatsiorsky-Seluyanov's segment inertia parameters*, J. Biomech. 29 (1996) 1223-1230, table 4; the mean
of women and men, who differ by 2 % of the height in the trunk and less elsewhere. Points as there, but for the head, which is
taken from its top to the base of the neck, and hands, whose centers lie a quarter of the forearm beyond the wrist.

A body's trunk is divided elsewhere than his, into as many links as it has. Each of his three parts is taken as a slab with its
radii of gyration, evenly heavy along the trunk, and cut where the body's joints are; so is a foot whose toes move.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...errors import ModelError
from ..articulated import ArticulatedModel
from ..configuration import Configuration, State
from .measures import mirrored_name

Triple = tuple[float, float, float]
_HAND_BEYOND = 1.25  # of the way from elbow to wrist


@dataclass(frozen=True)
class Segment:
    """A segment between two (means of) landmarks.

    Attributes
    ----------
    links : whose mass it is, the last ones beyond their joints.
    mass : share of the body's.
    center : its share of the way from the first to the last landmarks.
    first, last : landmarks.
    gyration : radii about the sagittal (forward), transverse and longitudinal axes, in that length.
    """

    links: tuple[str, ...]
    mass: float
    center: float
    first: tuple[str, ...]
    last: tuple[str, ...]
    gyration: Triple


def _of_side(side: str) -> tuple[Segment, ...]:
    def segment(links: tuple[str, ...], mass: float, center: float, first: str, last: str, gyration: Triple) -> Segment:
        own = tuple(f"{side}_{link}" for link in links)
        return Segment(own, mass, center, (f"{side}_{first}",), (f"{side}_{last}",), gyration)

    return (
        segment(("upper_arm",), 0.0263, 0.576, "shoulder", "elbow", (0.282, 0.265, 0.153)),
        segment(("forearm",), 0.0150, 0.457, "elbow", "wrist", (0.269, 0.261, 0.108)),
        segment(("hand",), 0.0058, _HAND_BEYOND, "elbow", "wrist", (0.178, 0.149, 0.113)),
        segment(("thigh",), 0.1447, 0.385, "hip", "knee", (0.349, 0.347, 0.156)),
        segment(("shank",), 0.0457, 0.437, "knee", "ankle", (0.259, 0.254, 0.097)),
        segment(("foot", "toes"), 0.0133, 0.421, "heel", "big_toe", (0.278, 0.262, 0.132)),
    )


_HIPS, _SHOULDERS = ("left_hip", "right_hip"), ("left_shoulder", "right_shoulder")
_TRUNK_LINKS = ("pelvis", "abdomen", "torso", "chest")
SEGMENTS = (
    Segment(("head",), 0.0681, 0.492, ("head",), ("neck",), (0.287, 0.305, 0.261)),
    Segment(_TRUNK_LINKS, 0.4302, 0.405, _SHOULDERS, _HIPS, (0.382, 0.359, 0.189)),
    *_of_side("left"),
    *_of_side("right"),
)
# Lower, middle and upper part of the trunk: share of the body's mass; center above the hips, and radii of gyration, in the length
# from hips to shoulders
_TRUNK_PARTS = (
    (0.1182, 0.145, (0.169, 0.154, 0.166)),
    (0.1549, 0.551, (0.190, 0.153, 0.183)),
    (0.1571, 0.969, (0.226, 0.148, 0.213)),
)


@dataclass(frozen=True, eq=False)
class Inertial:
    """Of a link, in its axes: ``mass`` in kilograms, ``center`` (3,) meters, ``inertia`` (3, 3) kg m^2 about the center."""

    mass: float
    center: np.ndarray
    inertia: np.ndarray


def present(names: Iterable[str]) -> tuple[Segment, ...]:
    """The segments of a body with these landmarks.

    Those of one side may be missing, as a lost foot is, where the other side has them; else there are none, since a body without
    them is no person or not all of one.
    """
    known = set(names)
    found = [segment for segment in SEGMENTS if {*segment.first, *segment.last} <= known]
    for segment in SEGMENTS:
        if segment not in found:
            twin = {mirrored_name(name) for name in (*segment.first, *segment.last)}
            if twin == {*segment.first, *segment.last} or not twin <= known:
                return ()
    return tuple(found)


def inertials(model: ArticulatedModel, mass_kg: float) -> dict[str, Inertial]:
    """What each link of a person weighs.

    Parameters
    ----------
    model : the body; parts that it lacks weigh nothing.
    mass_kg : of the whole body, as weighed.

    Returns
    -------
    By link; links without a mass of their own, such as clavicles, are left out.

    Raises
    ------
    ModelError : the body has not the landmarks of a person.
    """
    segments = present(model.landmark_names)
    if not segments:
        raise ModelError(f"masses: '{model.name}' has not the landmarks of a person (head, neck, left_shoulder, ...)")
    neutral = Configuration(model, State.neutral(model))
    places = dict(zip(model.landmark_names, neutral.landmarks_world, strict=True))
    scale = mass_kg / sum(segment.mass for segment in segments)
    slabs: dict[str, list[_Slab]] = {}
    for segment in segments:
        links = [link for link in segment.links if link in model.chain.links]
        start, end = (np.mean([places[name] for name in names], axis=0) for names in (segment.first, segment.last))
        parts = [(segment.mass, segment.center, segment.gyration)]
        if segment.links == _TRUNK_LINKS:
            parts = [(mass, 1.0 - at, gyration) for mass, at, gyration in _TRUNK_PARTS]
            links.reverse()  # from the shoulders down, as the segment goes
        whole = [_slab(scale * mass, start, end, at, gyration) for mass, at, gyration in parts]
        distal = links[:-1] if segment.links == _TRUNK_LINKS else links[1:]
        cuts = [neutral.Ts_world_link[model.chain.link_index(link), :3, 3] for link in distal]
        for slab in whole:
            for link, piece in zip(links, slab.cut(cuts), strict=True):
                if piece.mass > 0.0:
                    slabs.setdefault(link, []).append(piece)
    return {link: _together(own, neutral.Ts_world_link[model.chain.link_index(link)]) for link, own in slabs.items()}


@dataclass(frozen=True, eq=False)
class _Slab:
    """Evenly heavy along ``axis`` (3,), ``length`` long; ``across``: variances of the mass along the two other axes, m^2; neutral
    pose, world."""

    mass: float
    center: np.ndarray
    axis: np.ndarray
    length: float
    across: tuple[float, float]

    def cut(self, places: Sequence[np.ndarray]) -> list[_Slab]:
        """The pieces before, between and beyond places (3,) along the axis."""
        half = 0.5 * self.length
        ends = np.clip([-half, *sorted(float((p - self.center) @ self.axis) for p in places), half], -half, half).tolist()
        pieces = []
        for low, high in pairwise(ends):
            middle = self.center + 0.5 * (low + high) * self.axis
            pieces.append(replace(self, mass=self.mass * (high - low) / self.length, center=middle, length=high - low))
        return pieces

    @property
    def inertia(self) -> np.ndarray:
        """(3, 3) about its center, world: the transverse axis is y, or what is nearest to it across the slab."""
        y = np.array([0.0, 1.0, 0.0]) - self.axis[1] * self.axis
        y /= np.linalg.norm(y)
        R = np.column_stack([np.cross(y, self.axis), y, self.axis])
        variances = np.array([*self.across, self.length**2 / 12.0])
        return self.mass * R @ np.diag(variances.sum() - variances) @ R.T


def _slab(mass: float, start: np.ndarray, end: np.ndarray, center: float, gyration: Triple) -> _Slab:
    """The slab between two points (3,) with a center on the way and radii of gyration in that length."""
    length = float(np.linalg.norm(end - start))
    x, y, z = (length * length * radius * radius for radius in gyration)
    along, forward, sideways = 0.5 * (x + y - z), 0.5 * (y + z - x), 0.5 * (x + z - y)
    return _Slab(mass, start + center * (end - start), (end - start) / length, math.sqrt(12.0 * along), (forward, sideways))


def _together(slabs: Sequence[_Slab], T_world_link: np.ndarray) -> Inertial:
    mass = sum(slab.mass for slab in slabs)
    center = sum((slab.mass * slab.center for slab in slabs), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for slab in slabs:
        r = slab.center - center
        inertia += slab.inertia + slab.mass * ((r @ r) * np.eye(3) - np.outer(r, r))
    R = T_world_link[:3, :3]
    return Inertial(mass, R.T @ (center - T_world_link[:3, 3]), R.T @ inertia @ R)


def mass_center(names: Sequence[str], points: np.ndarray) -> np.ndarray | None:
    """Where the body's center of mass is.

    Parameters
    ----------
    names : of the landmarks.
    points : (..., n_landmarks, 3) meters.

    Returns
    -------
    (..., 3) meters; None of a body that has not all of the landmarks, but for limbs that one side lacks.
    """
    segments = present(names)
    if not segments:
        return None
    rows = {name: row for row, name in enumerate(names)}
    total, center = 0.0, np.zeros((*points.shape[:-2], 3))
    for segment in segments:
        first, last = (points[..., [rows[name] for name in ends], :].mean(axis=-2) for ends in (segment.first, segment.last))
        center += segment.mass * (first + segment.center * (last - first))
        total += segment.mass
    return center / total
