"""The body of a clip's person made from the network's points in its first image sets, without the static trial."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from benchmark.clothed._people import KeptPeople
from benchmark.clothed._recording import CHAINS, JOINTS, ClothedClip
from tracker_node.calibration.body_from_points import body_from_points
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model

SETS = 5
BONES = tuple(pair for chain in CHAINS for pair in pairwise(chain))
"""Joints of `JOINTS` at the ends of the eight bones of the limbs."""


def with_own_body(clip: ClothedClip, people: KeptPeople) -> ClothedClip:
    """The clip with a body made from its first image sets.

    Parameters
    ----------
    clip : whose images are looked at.
    people : finds people in them.

    Returns
    -------
    The same but for the body.
    """
    seen = [[people.find(np.ascontiguousarray(image.bgr), None).people for image in each.images] for each in clip.sets(0, SETS)]
    return replace(clip, model=body_from_points(human_model(), clip.rig, seen).model)


def bone_error_mm(clip: ClothedClip, model: ArticulatedModel) -> float:
    """Mean absolute error of the lengths of the eight bones of the limbs, against their mean lengths in the clip."""
    places = Configuration(model, State.neutral(model)).landmarks_world[[model.landmark_index(joint) for joint in JOINTS]]
    found = np.array([np.linalg.norm(places[a] - places[b]) for a, b in BONES])
    true = np.array([np.linalg.norm(clip.truth_m[:, a] - clip.truth_m[:, b], axis=1).mean() for a, b in BONES])
    return float(1e3 * np.abs(found - true).mean())
