"""Files with truth, sorted into positions of joints and degrees of freedom."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import TrackerError
from ..model.articulated import ArticulatedModel
from .review import Truth
from .truth.joints import OWN_TIME, load_truth
from .truth.states import holds_states, load_true_states


def truth_of(paths: Sequence[str], y_up: bool | None, model: ArticulatedModel | None) -> Truth:
    """The truth in some files: joints, states, both or nothing.

    Parameters
    ----------
    paths : at most one file with positions (TRC, C3D, CSV) and one with degrees of freedom (MOT, STO, CSV).
    y_up : whether the files have y up; None: as `truth.joints.load_truth` and `truth.states.load_true_states` take it.
    model : body that the degrees of freedom are of; None where no file has any.

    Returns
    -------
    Truth, with None for what no file holds.

    Raises
    ------
    TrackerError : two files of one kind, or one that cannot be read.
    """
    states = [path for path in paths if holds_states(path)]
    joints = [path for path in paths if path not in states]
    for of, what in ((states, "states"), (joints, "joints")):
        if len(of) > 1:
            raise TrackerError(f"truth: expected one file with {what}, got {', '.join(of)}")
    return Truth(
        load_truth(joints[0], y_up) if joints else None,
        load_true_states(states[0], model, y_up) if states else None,
        *(bool(of) and Path(of[0]).suffix.lower() in OWN_TIME for of in (joints, states)),
    )
