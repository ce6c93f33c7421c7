"""Plain values in each of Python's protocols; objects and damaged bytes are refused."""

import pickle
import random
from decimal import Decimal

import pytest

from tracker_node.loaders.keypoints.hdf5 import plain_value

VALUES = [[("net", "nose", "x"), ("net", "nose", "y")], [], (), [1, -2, 300, 70000, 2**40, 0.5, None], ("a", ("b", ["c"])), "é\n"]


@pytest.mark.parametrize("protocol", range(6))
@pytest.mark.parametrize("value", VALUES)
def test_plain_values(value, protocol):
    assert plain_value(pickle.dumps(value, protocol)) == value


@pytest.mark.parametrize("value", [Decimal(1), print, {1: 2}, {3}, object()])
@pytest.mark.parametrize("protocol", [0, 4])
def test_objects(value, protocol):
    with pytest.raises(ValueError, match="an object"):
        plain_value(pickle.dumps([value], protocol))


def test_damaged_bytes():
    valid, rng, refused = pickle.dumps(VALUES[0], 0), random.Random(1), 0
    for _ in range(500):
        content = bytearray(valid[: rng.randrange(1, len(valid) + 1)])
        content[rng.randrange(len(content))] = rng.randrange(256)
        try:
            plain_value(bytes(content))
        except ValueError:
            refused += 1
    assert refused > 300
