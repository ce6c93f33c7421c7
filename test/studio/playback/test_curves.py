"""Curves of angles do not jump where a rotation goes on."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tracker_node.studio.playback.page import continuous_angles, continuous_rotations


def test_a_turn_about_a_slanted_axis_goes_on_past_half_and_full_turns():
    degrees = np.arange(-400.0, 800.0, 20.0)
    turned = np.deg2rad(degrees)[:, None] * np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0)
    shown = continuous_rotations(Rotation.from_rotvec(turned).as_rotvec())
    steps = np.rad2deg(np.diff(shown, axis=0))
    np.testing.assert_allclose(steps, np.tile(steps[0], (len(steps), 1)), atol=1e-6)
    np.testing.assert_allclose(np.abs(steps[0]), [20.0 / np.sqrt(2.0), 20.0 / np.sqrt(2.0), 0.0], atol=1e-6)


def test_what_is_not_finite_leaves_the_rest_as_it_is():
    turned = np.deg2rad(np.arange(100.0, 260.0, 10.0))[:, None] * [0.6, 0.0, 0.8]
    wrapped = Rotation.from_rotvec(turned).as_rotvec()
    wrapped[5, 1] = np.nan
    shown = continuous_rotations(wrapped)
    assert np.isnan(shown[5, 1])
    np.testing.assert_allclose(np.delete(shown, 5, axis=0), np.delete(turned, 5, axis=0), atol=1e-9)
    angles = np.array([3.0, np.nan, -3.0, -2.0])
    np.testing.assert_allclose(continuous_angles(angles), [3.0, np.nan, 2 * np.pi - 3.0, 2 * np.pi - 2.0])


@given(st.lists(st.tuples(*3 * [st.floats(-4.0, 4.0)]), min_size=1, max_size=8))
def test_rotations_stay_the_same(vectors):
    before = np.array(vectors)
    after = continuous_rotations(before)
    np.testing.assert_allclose(Rotation.from_rotvec(after).as_matrix(), Rotation.from_rotvec(before).as_matrix(), atol=1e-6)
