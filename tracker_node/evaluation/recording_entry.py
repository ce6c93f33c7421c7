"""What a recording says that its runs are compared with, checked before they are tracked."""

from __future__ import annotations

from pathlib import Path

from ..errors import FileFormatError
from ..loaders.recording_yaml import EvaluateEntry
from ..model.articulated import ArticulatedModel
from .masks.reference import load_reference_masks
from .report.summary import parse_target
from .truth.files import truth_of


def check_evaluation(where: str | Path, entry: EvaluateEntry, model: ArticulatedModel | None) -> None:
    """Report mistakes that would else come up when the run is there.

    Parameters
    ----------
    where, entry : the recording, as a message names it, and what it says of its evaluation.
    model : the body; None where no truth is named.

    Raises
    ------
    TrackerError : a truth or masks that cannot be read, a target that is none.
    """
    for target in entry.targets:
        try:
            parse_target(target)
        except ValueError:
            raise FileFormatError(where, "evaluate.targets", "KEY<=NUMBER or KEY>=NUMBER", target) from None
    truth_of(entry.truth, entry.y_up, model)
    if entry.masks is not None:
        load_reference_masks(entry.masks)
