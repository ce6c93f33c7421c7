"""Whether a limb is where a fit has it, by the points found on it."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.detected_people import HUMAN, NAMES, posed, seen_by, without
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.camera.rig import CameraRig
from tracker_node.model.configuration import Configuration, Neighbor
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.objective.keypoints.correspondences import KeypointCorrespondences
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.observation.keypoints.people import Person
from tracker_node.tracking.config import KeypointConfig
from tracker_node.tracking.keypoints.judge import lost_odds, shares_found
from tracker_node.tracking.keypoints.modality import KeypointModality
from tracker_node.tracking.limbs.tree import limbs_of

RIG, TRUE = circle_rig(3), posed(4)
LIMBS = limbs_of(HUMAN)
SOMEBODY = Neighbor(Configuration(HUMAN, TRUE), np.zeros(len(HUMAN.shapes), dtype=int), (None,) * len(RIG))
CONFIG = KeypointConfig(sigma_fraction=0.02, offset_scale=1e-3)  # offsets are known: what is off is off


def index(ending: str) -> int:
    return next(i for i, limb in enumerate(LIMBS) if limb.name == ending)


ARM, OTHER, LEG = index("left_hand"), index("right_hand"), index("left_foot")


def shifted(person: Person, name: str, by_px: float) -> Person:
    pixels = person.pixels.copy()
    pixels[NAMES.index(name)] += by_px
    return replace(person, pixels=pixels)


def compared(people: list) -> KeypointCorrespondences:
    made = KeypointModality(RIG, HUMAN, CONFIG, BLAZEPOSE)
    made.set_images((), TRUE, None, people)
    return made.correspond(TRUE, 1.0)


def odds(people: list, body_px: float = 200.0) -> np.ndarray:
    return lost_odds(compared(people), TRUE, LIMBS, body_px)


def ratio(person: Person, square: float, score: float, body_px: float = 200.0) -> float:
    """Of one point in one camera: log of elsewhere against here, either of them an outlier perhaps."""
    left, top, right, bottom = person.box
    size = max(right - left, bottom - top)
    variance, q = 1.0 + (0.02 * size) ** 2, 0.02 + 0.4 * (1.0 - score)
    outlier = q / (1.0 - q) * 2.0 * np.pi * variance / size**2
    away = 1.0 / (1.0 + 55.0**2 * (body_px / 200.0) ** 2 / variance)
    return np.log((away + outlier) / (np.exp(-0.5 * square) + outlier))


def shares(people: list, rig: CameraRig = RIG, others: tuple[Neighbor, ...] = (), looked: bool = True) -> list[float]:
    """Of the body's points; where ``people`` has None a detector has looked and found nobody, or not ``looked``."""
    blank = np.zeros((480, 640, 3), dtype=np.uint8)
    found = [() if person is None and looked else person and (person,) for person in people]
    images = tuple(CameraImage(name, 1, blank, people=who) for name, who in zip(rig.names, found, strict=True))
    return np.round(shares_found(compared(people), TRUE, rig, ImageSet(1, images, neighbors=others)), 2).tolist()


def test_a_camera_shows_the_body_by_sure_points_that_are_where_it_is():
    people = seen_by(RIG, TRUE)
    guessed = replace(people[1], scores=np.full(len(NAMES), 0.3))
    elsewhere = replace(people[2], pixels=people[2].pixels + 60.0)
    assert min(shares(people)) > 0.9
    first, second, third = shares([people[0], guessed, elsewhere])
    assert first > 0.9 and 0.2 < second < 0.4 and third < 0.1


def test_a_camera_that_should_show_the_body_and_does_not_has_a_share_of_nothing():
    """Unless nobody has looked, it is out of the image, or others stand before it."""
    first, _, third = seen_by(RIG, TRUE)
    assert shares([first, None, third])[1] == 0.0
    assert np.isnan(shares([first, None, third], looked=False)[1])
    camera = RIG.cameras[1]
    away = replace(camera, T_world_cam=camera.T_world_cam @ np.diag([-1.0, 1.0, -1.0, 1.0]))
    assert np.isnan(shares([first, None, third], replace(RIG, cameras=(RIG.cameras[0], away, RIG.cameras[2])))[1])
    assert np.isnan(shares([first, None, third], others=(SOMEBODY,))[1])


def test_limbs_whose_points_are_in_place_are_not_lost():
    found = odds(seen_by(RIG, TRUE))
    assert found.shape == (len(LIMBS),) and (found < -2.0).all()


def test_a_point_that_is_elsewhere_in_two_cameras_tells_of_its_limb_alone():
    people, sound = seen_by(RIG, TRUE), odds(seen_by(RIG, TRUE))
    found = odds([shifted(people[0], "left_wrist", 40.0), shifted(people[1], "left_wrist", -40.0), people[2]])
    assert found[ARM] > 1.0
    np.testing.assert_allclose(np.delete(found, ARM), np.delete(sound, ARM))


def test_odds_of_a_point_in_two_cameras_by_hand():
    """The worst of a limb's points counts, summed over cameras of which 1.5 share one error."""
    people = [replace(person, score=0.7, scores=0.7 * person.scores) for person in seen_by(RIG, TRUE)]
    for body_px in (50.0, 100.0):
        found = odds([people[0], shifted(people[1], "left_ankle", 12.0), None], body_px)
        left, top, right, bottom = people[1].box
        variance = 1.0 + (0.02 * max(right - left, bottom - top)) ** 2
        expected = ratio(people[0], 0.0, 0.7, body_px) + ratio(people[1], 2.0 * 12.0**2 / variance, 0.7, body_px)
        assert found[LEG] == pytest.approx(0.7 * expected / 1.5, abs=0.05)  # the offset takes a little of it
        in_place = ratio(people[0], 0.0, 0.7, body_px) + ratio(people[1], 0.0, 0.7, body_px)
        assert found[OTHER] == pytest.approx(0.7 * in_place / 1.5, abs=1e-3)


def test_points_that_are_guessed_in_all_cameras_say_nothing():
    """A limb that nobody sees is where the detector guesses it, and guesses agree."""
    people = seen_by(RIG, TRUE)
    guessed = []
    for person in people:
        scores = person.scores.copy()
        scores[[person.names.index(name) for name in ("left_elbow", "left_wrist")]] = 0.2
        guessed.append(replace(person, scores=scores))
    found, sound = odds(guessed), odds(people)
    assert found[ARM] == 0.0
    np.testing.assert_allclose(np.delete(found, ARM), np.delete(sound, ARM))


def test_a_narrow_error_that_runs_aslant_is_as_small_as_its_determinant():
    """Elsewhere is then less likely: by the root of the determinant of the inverse covariance."""
    people, slant = seen_by(RIG, TRUE), 300.0 * np.array([[1.0, 0.98], [0.98, 1.0]])
    found = odds([replace(p, covariances=np.tile(slant, (len(NAMES), 1, 1))) for p in people[:2]] + [None], 50.0)
    expected = 0.0
    for person in people[:2]:
        left, top, right, bottom = person.box
        size = max(right - left, bottom - top)
        root = np.sqrt(np.linalg.det(slant + (0.02 * size) ** 2 * np.eye(2)))
        outlier = 0.02 / 0.98 * 2.0 * np.pi * root / size**2
        away = 1.0 / (1.0 + 55.0**2 * 0.25**2 / root)
        expected += np.log((away + outlier) / (1.0 + outlier)) / 1.5
    assert found[OTHER] == pytest.approx(expected, abs=1e-3)


def test_a_point_of_one_camera_counts_where_no_other_is_seen_by_two():
    own = tuple(f"left_{name}" for name in ("shoulder", "elbow", "wrist"))
    people = [without(shifted(person, "left_wrist", 40.0), ()) for person in seen_by(RIG, TRUE)]
    alone = [people[0], without(people[1], own), without(people[2], own)]
    assert odds(alone)[ARM] > 0.5
    with_elbow = [people[0], without(people[1], ("left_wrist", "left_shoulder")), without(people[2], own)]
    assert odds(with_elbow)[ARM] < -1.0  # the elbow, in two cameras, is in place


def test_points_of_one_camera_alone_say_little_for_a_limb():
    first, *_ = seen_by(RIG, TRUE)
    assert (odds([first, None, None]) == -1.5).all()  # depths may be mirrored
    found = odds([shifted(first, "left_wrist", 60.0), None, None])
    assert found[ARM] > 0.5 and (np.delete(found, ARM) == -1.5).all()


def test_an_end_of_which_one_camera_alone_is_sure_says_little_for_its_limb():
    """The others guess it behind something: what two of three are sure of is as good as what all are."""
    def unsure(person: Person) -> Person:
        hand = np.isin(person.names, ["left_wrist", "left_index", "left_pinky", "left_thumb"])
        return replace(person, scores=np.where(hand, 0.5, person.scores))

    first, second, third = seen_by(RIG, TRUE)
    by_one, by_two = odds([first, unsure(second), unsure(third)]), odds([first, second, unsure(third)])
    assert by_one[ARM] == -1.5 and by_two[ARM] < -2.0
    assert np.delete(by_one, ARM) == pytest.approx(np.delete(by_two, ARM))
    hand = ("left_wrist", "left_index", "left_pinky", "left_thumb")
    by_none = odds([without(person, hand) for person in (first, second, third)])
    assert by_none[ARM] == -1.5  # an elbow does not tell where the hand is


def test_a_limb_without_points_has_no_evidence():
    own = tuple(f"left_{name}" for name in ("shoulder", "elbow", "wrist"))
    found = odds([without(person, own) for person in seen_by(RIG, TRUE)])
    assert np.isnan(found[ARM]) and (np.delete(found, ARM) < 0.0).all()
    assert np.isnan(odds([None, None, None])).all()


def test_no_point_says_more_than_the_limit():
    people = [replace(shifted(person, "left_wrist", 300.0), box=(0.0, 0.0, 2000.0, 2000.0)) for person in seen_by(RIG, TRUE)]
    made = KeypointModality(RIG, HUMAN, replace(CONFIG, sigma_fraction=1e-4, outlier_fraction=1e-4), BLAZEPOSE)
    made.set_images((), TRUE, None, people)
    found = lost_odds(made.correspond(TRUE, 1.0), TRUE, LIMBS, 2000.0)
    assert found[ARM] == 6.0 and found[OTHER] == -6.0
