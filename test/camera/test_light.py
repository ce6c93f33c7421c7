"""Lights: which are refused, and the rows that the kernels read."""

import math

import numpy as np
import pytest

from tracker_node.camera.light import Light, pack_lights


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ({"kind": "sun"}, r"expected a kind of light, one of .*'spot'.*, got 'sun'"),
        ({"kind": "point"}, "expected a position for a point light"),
        ({"kind": "spot", "direction": (0, 0, 1), "half_angle": 0.5}, "expected a position for a spot light"),
        ({"kind": "directional"}, "direction of non-zero length for a directional light, got None"),
        ({"kind": "directional", "direction": (0, 0, 0)}, "direction of non-zero length"),
        ({"kind": "spot", "position": (0, 0, 0), "half_angle": 0.5}, "direction of non-zero length for a spot light"),
        ({"kind": "spot", "position": (0, 0, 0), "direction": (1, 0, 0)}, r"half angle in \(0, pi\) radians .*, got None"),
        ({"kind": "spot", "position": (0, 0, 0), "direction": (1, 0, 0), "half_angle": 0.0}, "half angle"),
        ({"kind": "spot", "position": (0, 0, 0), "direction": (1, 0, 0), "half_angle": math.pi}, "half angle"),
        ({"kind": "ambient", "intensity": (1.0, -0.1, 1.0)}, r"expected an intensity >= 0, got \(1.0, -0.1, 1.0\)"),
    ],
)
def test_refusals(fields, said):
    with pytest.raises(ValueError, match=said):
        Light(**fields)


def test_lights_need_no_more_than_their_kind_asks_for():
    assert Light("ambient", (0.0, 0.0, 0.0)).intensity == (0.0, 0.0, 0.0)
    assert Light("point", position=(1, 2, 3)).direction is None
    assert Light("directional", direction=(0, 0, -0.001)).position is None
    assert Light("spot", (1, 1, 1), (0, 0, 0), (1, 0, 0), 3.1).half_angle == 3.1


def test_rows_of_all_kinds():
    """Kind, color, place, direction, cosines of the edge and of four fifths of it."""
    spot = Light("spot", (0.1, 0.2, 0.3), (1, 2, 3), (3, 0, 4), math.pi / 3)
    rows = pack_lights([Light("ambient", (0.5, 0.6, 0.7)), Light("directional", direction=(0, 0, -2)), spot])
    assert rows.shape == (3, 12) and rows.dtype == np.float64
    assert rows[0].tolist() == [0, 0.5, 0.6, 0.7, 0, 0, 0, 0, 0, 0, 0, 0]
    assert rows[1].tolist() == [1, 1, 1, 1, 0, 0, 0, 0, 0, -1, 0, 0]
    assert rows[2] == pytest.approx([3, 0.1, 0.2, 0.3, 1, 2, 3, 0.6, 0, 0.8, 0.5, math.cos(math.radians(48.0))])
    point = pack_lights([Light("point", position=(1, 2, 3))])
    assert point.tolist() == [[2, 1, 1, 1, 1, 2, 3, 0, 0, 0, 0, 0]]


def test_without_lights_all_is_shown_as_it_is():
    assert pack_lights([]).tolist() == [[0, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0]]
