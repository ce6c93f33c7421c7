"""Cameras whose picture of the room turns are named, and their images turned back."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at
from helpers.cameras.small_clip import body
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3
from tracker_node.model.configuration import State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.keypoints.people import Person, Silhouette
from tracker_node.tracking.cameras.bumped import BumpedCameras
from tracker_node.tracking.cameras.trust import CameraTrust
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import BUMPED

MODEL = body()
WIDTH, HEIGHT, FOCAL = 480, 360, 420.0
LENS = CameraModel(WIDTH, HEIGHT, np.array([[FOCAL, 0.0, 239.5], [0.0, FOCAL, 179.5], [0.0, 0.0, 1.0]]))
EYES = [(4, 0, 1), (0, 4, 1), (-4, 1, 1)]
RIG = CameraRig(tuple(look_at(eye, (0.0, 0.0, 0.4), LENS, f"cam{i}") for i, eye in enumerate(EYES)))
STATE = State.neutral(MODEL, se3.from_rotation_translation(np.eye(3), np.array([0.0, 0.0, 0.4])))
STEP_NS = 33_000_000
MARGIN, BEFORE = 80, 20


def room(seed: int, size: int = 12) -> np.ndarray:
    """Blots of any gray, wider than an image."""
    rng = np.random.default_rng(seed)
    shape = (HEIGHT + 2 * MARGIN) // size + 1, (WIDTH + 2 * MARGIN) // size + 1
    blots = cv2.resize(rng.integers(20, 235, shape, dtype=np.uint8), None, fx=size, fy=size, interpolation=cv2.INTER_CUBIC)
    return np.repeat(blots[:, :, None], 3, axis=2)


ROOMS = [room(i) for i in range(3)]


def shown(i: int, turn_deg: float = 0.0, roll_deg: float = 0.0, rng_seed: int = 0, light: float = 1.0) -> np.ndarray:
    """The room as camera ``i`` shows it, turned aside, with noise."""
    shift = MARGIN + FOCAL * np.tan(np.radians(turn_deg))
    turn = cv2.getRotationMatrix2D((239.5, 179.5), roll_deg, 1.0)
    whole = np.vstack([turn, [0, 0, 1]]) @ np.array([[1, 0, -shift], [0, 1, -MARGIN], [0, 0, 1.0]])
    image = cv2.warpAffine(ROOMS[i], whole[:2], (WIDTH, HEIGHT)).astype(np.float64)
    noise = np.random.default_rng(rng_seed).normal(0.0, 3.0, image.shape)
    return np.clip(np.rint(light * image + noise), 0, 255).astype(np.uint8)


def still(k: int) -> list[np.ndarray]:
    return [shown(i, rng_seed=3 * k + i) for i in range(3)]


def followed(images=still) -> BumpedCameras:
    cameras = BumpedCameras(RIG, MODEL, np.radians(0.3))
    for k in range(BEFORE):
        cameras.look(k * STEP_NS, images(k), STATE)
    assert cameras.faults == ()
    return cameras


def went_on(cameras: BumpedCameras, picture, n: int, since: int = BEFORE) -> None:
    """Camera 1 shows something else."""
    for k in range(since, since + n):
        cameras.look(k * STEP_NS, [still(k)[0], picture(k), still(k)[2]], STATE)


@pytest.mark.parametrize(("turn", "roll"), [(0.5, 0.0), (-2.0, 0.0), (0.0, 1.0), (0.4, -0.4)])
def test_a_camera_that_is_turned_is_named_within_some_sets_with_its_turn(turn, roll):
    cameras = followed()
    went_on(cameras, lambda k: shown(1, turn, roll, k), 6)
    (fault,) = cameras.faults
    assert (fault.camera, fault.kind, fault.rivals) == ("cam1", BUMPED, ())
    assert np.degrees(fault.size) == pytest.approx(np.hypot(turn, roll), abs=0.05)
    assert BEFORE * STEP_NS <= fault.since_ns <= (BEFORE + 3) * STEP_NS
    assert "cam1 has been bumped" in fault.text
    went_on(cameras, lambda k: shown(1, rng_seed=k), 6, BEFORE + 6)
    assert cameras.faults == ()


def test_its_images_and_the_people_in_them_are_turned_back():
    cameras = followed()
    went_on(cameras, lambda k: shown(1, 1.0, 0.5, k), 6)
    there, silhouette = np.array([[100.0, 200.0], [300.0, 90.0]]), np.full((300, 200), 255, np.uint8)
    turned = cv2.getRotationMatrix2D((239.5, 179.5), 0.5, 1.0)
    shift = FOCAL * np.tan(np.radians(1.0))
    moved = (there - (shift, 0.0)) @ turned[:, :2].T + turned[:, 2]
    person = Person(("a", "b"), moved, np.tile(np.eye(2), (2, 1, 1)), np.ones(2), 1.0, (*moved.min(axis=0), *moved.max(axis=0)),
                    Silhouette(silhouette, (2, 10)))  # fmt: skip
    images = tuple(CameraImage(f"cam{i}", 0, pixels) for i, pixels in enumerate([still(0)[0], shown(1, 1.0, 0.5), still(0)[2]]))
    images = (images[0], replace(images[1], people=(person,)), images[2])
    back = cameras.turned_back(ImageSet(0, images))
    assert back.images[0] is images[0] and back.images[2] is images[2]
    inner = slice(40, -40)
    rms = np.sqrt(np.mean((back.images[1].pixels[inner, inner].astype(float) - shown(1, rng_seed=9)[inner, inner]) ** 2))
    assert rms < 7.0  # two noises of 3, and interpolation; as it was shown, 40
    (found,) = back.images[1].people
    assert np.abs(found.pixels - there).max() < 0.5
    assert np.abs(np.subtract(found.silhouette.origin, (2 + shift, 9.5))).max() <= 1.0
    assert found.box[0] == pytest.approx(100.0, abs=3.0)


def test_a_silhouette_that_leaves_the_image_is_cut():
    cameras = followed()
    went_on(cameras, lambda k: shown(1, -1.0, 0.0, k), 6)
    silhouette = Silhouette(np.ones((20, 30), np.uint8), (0, 0))
    person = Person(("a",), np.zeros((1, 2)), np.eye(2)[None], np.ones(1), 1.0, (0, 0, 9, 9), silhouette)
    image = CameraImage("cam1", 0, shown(1, -1.0), people=(person,))
    (found,) = cameras.turned_back(ImageSet(0, (image,))).images[0].people
    assert found.silhouette.origin == (0, 0) and found.silhouette.probabilities.shape == (20, 30 - 7)
    small = replace(person, silhouette=Silhouette(np.ones((20, 5), np.uint8), (0, 0)))
    (found,) = cameras.turned_back(ImageSet(0, (replace(image, people=(small,)),))).images[0].people
    assert found.silhouette is None


def test_light_and_noise_turn_nobody():
    cameras = followed()
    went_on(cameras, lambda k: shown(1, rng_seed=k, light=0.5 + 0.1 * (k % 5)), 12)
    assert cameras.faults == ()


def somebody(k: int, i: int, speed: float, room_too: bool = True, turn: float = 0.0) -> np.ndarray:
    """A textured board, a third of the picture, that walks before the room."""
    image = shown(i, turn, rng_seed=k) if room_too else np.full((HEIGHT, WIDTH, 3), 120, np.uint8)
    left = int(20 + speed * k) % 200
    image[40:320, left : left + 200] = room(7, 9)[:280, :200]
    return image


def test_who_walks_by_is_no_turn_of_the_camera():
    for room_too in (True, False):
        cameras = followed(lambda k, there=room_too: [somebody(k, i, 3.0, there) for i in range(3)])
        went_on(cameras, lambda k, there=room_too: somebody(k, 1, 3.0, there), 20)
        assert cameras.faults == ()


def test_who_stood_and_walks_off_is_no_turn_of_the_camera():
    for room_too in (True, False):
        cameras = followed(lambda k, there=room_too: [somebody(0, i, 0.0, there) for i in range(3)])
        went_on(cameras, lambda k, there=room_too: somebody(k - BEFORE, 1, 2.0, there), 12)
        assert cameras.faults == ()


def test_what_is_in_the_way_undoes_no_turn():
    cameras = followed()
    went_on(cameras, lambda k: shown(1, 0.8, rng_seed=k), 6)
    went_on(cameras, lambda k: np.full((HEIGHT, WIDTH, 3), 90, np.uint8), 10, BEFORE + 6)
    (fault,) = cameras.faults
    assert np.degrees(fault.size) == pytest.approx(0.8, abs=0.05)


def test_a_plain_wall_tells_nothing():
    plain = np.full((HEIGHT, WIDTH, 3), 128, np.uint8)
    cameras = followed(lambda k: [plain] * 3)
    went_on(cameras, lambda k: plain, 5)
    assert cameras.faults == ()
    cameras.look(20 * 10**9, still(0), STATE)  # a lens cap is taken off
    for k in range(1, 15):
        cameras.look(20 * 10**9 + k * STEP_NS, still(k), STATE)
    for k in range(15, 20):
        cameras.look(20 * 10**9 + k * STEP_NS, [still(k)[0], shown(1, 0.5, rng_seed=k), still(k)[2]], STATE)
    assert [fault.camera for fault in cameras.faults] == ["cam1"]


def test_daylight_that_moves_on_is_learned():
    """After a minute nothing is as it was at first, and a turn is told all the same."""
    def dusk(k: int, i: int, turn: float = 0.0) -> np.ndarray:
        share = min(k / 90.0, 1.0)
        first, last = shown(i, turn, rng_seed=k).astype(float), cv2.GaussianBlur(shown(i, turn, rng_seed=k), (0, 0), 4.0)[::-1]
        return np.rint((1.0 - share) * first + share * last).astype(np.uint8)

    cameras = BumpedCameras(RIG, MODEL, np.radians(0.3))
    for k in range(100):
        cameras.look(k * 10**9, [dusk(k, i) for i in range(3)], STATE)
        assert cameras.faults == ()
    for k in range(100, 106):
        cameras.look(k * 10**9, [dusk(k, 0), dusk(k, 1, 0.6), dusk(k, 2)], STATE)
    assert [fault.camera for fault in cameras.faults] == ["cam1"]


def sets(k: int, turns: dict[int, float], cameras: int = 3) -> ImageSet:
    images = [CameraImage(f"cam{i}", k * STEP_NS, shown(i, turns.get(i, 0.0), rng_seed=k)) for i in range(cameras)]
    return ImageSet(k * STEP_NS, tuple(images))


class _Fit:
    state = STATE


class _Assessment:
    support = None


CASES = [(True, 5.0, 3, ["cam1"]), (True, 7.0, 3, ["cam1"]), (True, 5.0, 2, []), (True, 1.0, 3, []), (False, 5.0, 3, [])]


@pytest.mark.parametrize(("enabled", "deg", "n_cameras", "out"), CASES)
def test_a_camera_that_is_far_off_is_left_out_where_two_others_remain(enabled, deg, n_cameras, out):
    config = TrackerConfig()
    config = replace(config, self_check=replace(config.self_check, enabled=enabled))
    rig = CameraRig(RIG.cameras[:n_cameras])
    trust = CameraTrust(rig, MODEL, config)
    for k in range(BEFORE + 8):
        given = sets(k, {1: deg} if k >= BEFORE else {}, n_cameras)
        used = trust.trusted(given, STATE, False)
        trust.look(given.stamp_ns, [image.pixels for image in given.images], _Fit(), _Assessment())
    assert trust.left_out == out and [camera for camera in rig.names if camera not in out] == list(used.cameras)
    assert [fault.kind for fault in trust.faults] == [BUMPED] * enabled
