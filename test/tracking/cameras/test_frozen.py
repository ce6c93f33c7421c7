"""Cameras that repeat an image are left out while the body moves on, then named."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at
from helpers.cameras.small_clip import body
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import State
from tracker_node.tracking.cameras.frozen import FrozenCameras
from tracker_node.tracking.estimate import FROZEN

MODEL = body()
LENS = CameraModel(64, 48, np.array([[56.0, 0.0, 31.5], [0.0, 56.0, 23.5], [0.0, 0.0, 1.0]]))
RIG = CameraRig(tuple(look_at(eye, (0.0, 0.0, 0.4), LENS, f"cam{i}") for i, eye in enumerate([(2, 0, 1), (0, 2, 1), (-2, 1, 1)])))
STEP_NS = 10**8


def at(x: float, turn: float = 0.0) -> State:
    return State.neutral(MODEL, se3.from_rotation_translation(so3.exp(np.array([0.0, 0.0, turn])), np.array([x, 0.0, 0.4])))


def images(n: int, stuck: dict[int, int] | None = None) -> list[np.ndarray | None]:
    """Noise that is new in every set ``n``; of ``stuck`` cameras that of another set."""
    return [np.random.default_rng((i, (stuck or {}).get(i, n))).integers(0, 255, (48, 64, 3), dtype=np.uint8) for i in range(3)]


def looked(frozen: FrozenCameras, n: int, stuck: dict[int, int], state: State | None) -> list[int]:
    return frozen.look(n * STEP_NS, images(n, stuck), state)


@pytest.mark.parametrize("moved", [(0.05, 0.0), (0.0, 0.1)])
def test_a_camera_that_repeats_its_image_is_left_out_at_once_and_named_at_the_second_time(moved):
    frozen = FrozenCameras(RIG, MODEL)
    states = [at(n * moved[0], n * moved[1]) for n in range(6)]
    assert looked(frozen, 0, {}, states[0]) == [] == looked(frozen, 1, {}, states[1])
    assert looked(frozen, 2, {1: 1}, states[2]) == [1] and frozen.faults == ()
    assert looked(frozen, 3, {1: 1}, states[3]) == [1]
    (fault,) = frozen.faults
    assert (fault.camera, fault.kind, fault.since_ns, fault.size) == ("cam1", FROZEN, STEP_NS, pytest.approx(0.2))
    assert "cam1 repeats its image of 200 ms ago" in fault.text
    assert looked(frozen, 4, {}, states[4]) == [] and frozen.faults == ()


def test_two_cameras_are_left_out_where_the_third_goes_on():
    frozen = FrozenCameras(RIG, MODEL)
    for n in range(4):
        stuck = {0: min(n, 1), 2: min(n, 1)}
        assert looked(frozen, n, stuck, at(0.05 * n)) == ([] if n < 2 else [0, 2])
    assert [fault.camera for fault in frozen.faults] == ["cam0", "cam2"]


def test_a_recording_that_pauses_is_no_fault():
    frozen = FrozenCameras(RIG, MODEL)
    for n in range(5):
        assert looked(frozen, n, dict.fromkeys(range(3), min(n, 1)), at(0.05 * n)) == [] and frozen.faults == ()


@pytest.mark.parametrize("states", [[at(0.0)] * 5, [None] * 5, [at(0.0), *[None] * 4], [at(9.0 + 0.1 * n) for n in range(5)]])
def test_images_of_a_body_that_stands_or_is_not_known_or_not_seen_may_be_equal(states):
    """As drawn images without noise are."""
    frozen = FrozenCameras(RIG, MODEL)
    for n, state in enumerate(states):
        assert looked(frozen, n, {0: min(n, 1)}, state) == [] and frozen.faults == ()


def test_a_camera_that_gave_no_image_goes_on_from_the_one_before():
    frozen = FrozenCameras(RIG, MODEL)
    looked(frozen, 0, {}, at(0.0))
    frozen.look(STEP_NS, [images(1)[0], None, images(1)[2]], at(0.05))
    assert looked(frozen, 2, {1: 0}, at(0.1)) == [1]
    frozen.reset()
    assert looked(frozen, 3, {1: 0}, at(0.15)) == []


def test_a_covered_lens_is_not_frozen():
    frozen = FrozenCameras(RIG, MODEL)
    for n in range(4):
        black = [images(n)[0], np.zeros((48, 64, 3), dtype=np.uint8), images(n)[2]]
        assert frozen.look(n * STEP_NS, black, at(0.05 * n)) == [] and frozen.faults == ()
