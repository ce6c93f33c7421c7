"""Hypothesis strategies of rotations and poses that dwell near the places where formulas break."""

import numpy as np
from hypothesis import strategies as st

_finite = st.floats(-1.0, 1.0, allow_nan=False)
directions = (
    st.tuples(_finite, _finite, _finite)
    .map(np.array)
    .filter(lambda v: np.linalg.norm(v) > 1e-3)
    .map(lambda v: v / np.linalg.norm(v))
)
_tiny = st.integers(-12, -1).map(lambda exponent: 10.0**exponent)
# The switches of the implementation are at 1e-4 from the identity, and where the sine is 1e-5 near pi.
angles = st.one_of(
    st.floats(0.0, np.pi),
    st.sampled_from([0.0, 1e-7, 0.99e-4, 1e-4, 1.01e-4, np.pi - 1.01e-5, np.pi - 1e-5, np.pi - 0.99e-5, np.pi - 1e-7]),
    _tiny,
    _tiny.map(lambda d: np.pi - d),
)
rotation_vectors = st.builds(lambda axis, angle: axis * angle, directions, angles)
translations = st.tuples(*[st.floats(-10.0, 10.0)] * 3).map(np.array)
twists = st.builds(lambda v, w: np.concatenate([v, w]), translations, rotation_vectors)
