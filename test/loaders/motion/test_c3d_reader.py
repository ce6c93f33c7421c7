"""Numbers of frames as C3D files state them: in words of 16 bits, the lower one first."""

import numpy as np
import pytest

from tracker_node.loaders.motion.c3d_reader import _actual_frames


def trial(start, end):
    fields = {"ACTUAL_START_FIELD": start, "ACTUAL_END_FIELD": end}
    return {name: {"value": np.array(words)} for name, words in fields.items() if words is not None}


@pytest.mark.parametrize(
    ("start", "end", "frames"),
    [
        ([1, 0], [10, 0], 10), ([5, 0], [5, 0], 1), ([1, 0], [0, 1], 65536), ([3, 2], [2, 3], 65536), ([1, 0], [-1, 0], 65535),
        ([2, 0], [1, 0], 0), ([0, 0], [9, 0], 0), ([1], [9, 0], 0), ([1, 0], None, 0), (None, None, 0), ([[1, 0]], [[4, 0]], 4),
    ],
)  # fmt: skip
def test_both_ends_are_counted(start, end, frames):
    assert _actual_frames(trial(start, end)) == frames
