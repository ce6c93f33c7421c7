"""The joints that a person's motion is judged by, and the bones between them."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from ...model.articulated import ArticulatedModel

SIDES = ("left", "right")
PAIRED = ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
EVALUATED_JOINTS = ("neck", "head", *(f"{side}_{joint}" for side in SIDES for joint in PAIRED))

BONES = (
    *((f"{side}_{a}", f"{side}_{b}") for side in SIDES for a, b in (("shoulder", "elbow"), ("elbow", "wrist"))),
    *((f"{side}_{a}", f"{side}_{b}") for side in SIDES for a, b in (("hip", "knee"), ("knee", "ankle"))),
    ("left_shoulder", "right_shoulder"),
    ("left_hip", "right_hip"),
    ("neck", "head"),
)
LIMBS = {  # limb -> its end joint
    **{f"{side} arm": f"{side}_wrist" for side in SIDES},
    **{f"{side} leg": f"{side}_ankle" for side in SIDES},
}


def common_joints(model_names: Collection[str], truth_names: Sequence[str]) -> tuple[str, ...]:
    """Joints to judge: those of `EVALUATED_JOINTS` that both have; for another body every name that both have.

    Parameters
    ----------
    model_names : landmarks of the model.
    truth_names : points of the truth.

    Returns
    -------
    Their names.
    """
    both = [name for name in truth_names if name in model_names]
    human = tuple(name for name in EVALUATED_JOINTS if name in both)
    return human or tuple(both)


def common_bones(names: Collection[str]) -> tuple[tuple[str, str], ...]:
    """`BONES` whose both ends are in ``names``."""
    return tuple(bone for bone in BONES if bone[0] in names and bone[1] in names)


def offset_links(model: ArticulatedModel, names: Sequence[str]) -> np.ndarray:
    """Links in whose frames the constant offsets of landmarks are estimated.

    It is the landmark's own link, but the parent's for one on a last link (hand, foot, head): how that turns is hardly
    observed.

    Parameters
    ----------
    model : the body.
    names : m landmarks.

    Returns
    -------
    (m,) indices of links.
    """
    chain = model.chain
    links = np.array([model.landmark_links[model.landmark_index(name)] for name in names], dtype=int)
    has_child = np.isin(np.arange(len(chain.links)), chain.parents)
    return np.where(has_child[links] | (chain.parents[links] < 0), links, chain.parents[links])
