"""Cameras that show another moment are named by the points of a person, with how late they are."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from helpers.bodies.detected_people import HUMAN, person_at, places, standing
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.camera.rig import CameraRig
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.tracking.assessment import Assessment
from tracker_node.tracking.cameras.delayed import DelayedCameras
from tracker_node.tracking.cameras.trust import CameraTrust
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import DELAYED, LimbReport, LimbStatus, Status

RIG = circle_rig(4)
BLACK = np.zeros((8, 8, 3), dtype=np.uint8)
N_SETS = 70


@cache
def walking(row: int) -> np.ndarray:
    """Where the points of a person are in image set ``row``, at 30 Hz."""
    t = row / 30.0
    swing = 30.0 * np.sin(5.0 * t)
    x, y = 0.8 * np.sin(1.1 * t), 0.5 * np.cos(1.7 * t)
    return places(standing(x, y, 0.6 * t, left_hip_flexion=swing, right_hip_flexion=-swing))


def still(row: int) -> np.ndarray:
    return walking(0)


def image_sets(late: dict[str, int], motion=walking, rig: CameraRig = RIG, n_people: int = 1, score: float = 1.0, first: int = 0):
    rng, found = np.random.default_rng(3), []
    for row in range(first, first + N_SETS):
        images = []
        for camera in rig:
            person = person_at(camera, motion(row - late.get(camera.name, 0)), rng, 2.0, score=score)
            images.append(CameraImage(camera.name, round(row * 1e9 / 30), BLACK, people=(person,) * n_people))
        found.append(ImageSet(images[0].stamp_ns, tuple(images)))
    return found


def looked(sets, rig: CameraRig = RIG) -> DelayedCameras:
    delayed = DelayedCameras(rig, HUMAN)
    for image_set in sets:
        delayed.look(image_set)
    return delayed


@pytest.mark.parametrize("late", [-15, -6, 6, 10, 24])
def test_a_camera_that_is_late_or_early_is_named_with_by_how_much(late):
    found = looked(image_sets({"cam03": late}))
    (fault,) = found.faults
    assert (fault.camera, fault.kind, fault.rivals) == ("cam03", DELAYED, ()) and found.far_off == [2]
    assert fault.size == pytest.approx(late / 30.0, abs=0.034)
    assert ("late" if late > 0 else "early") in fault.text


@pytest.mark.parametrize(("late", "motion"), [({}, walking), ({"cam03": 1}, walking), ({"cam03": 10}, still)])
def test_nobody_is_named_where_cameras_agree_or_nobody_moves(late, motion):
    assert looked(image_sets(late, motion)).faults == ()


def test_of_two_cameras_nobody_knows_which_and_none_is_left_out():
    rig = CameraRig(RIG.cameras[:2])
    found = looked(image_sets({"cam02": 10}, rig=rig), rig)
    assert [{fault.camera, *fault.rivals} for fault in found.faults] == [{"cam01", "cam02"}] and found.far_off == []


@pytest.mark.parametrize("n_cameras", [2, 4])
def test_a_body_between_two_moments_is_degraded_and_one_without_the_late_camera_is_not(n_cameras):
    rig = CameraRig(RIG.cameras[:n_cameras])
    trust, limb = CameraTrust(rig, HUMAN, TrackerConfig()), LimbReport("left_hand", LimbStatus.TRACKING, "", 0.01)
    found = Assessment(Status.TRACKING, "", limbs=(limb, replace(limb, status=LimbStatus.LOST)))
    sets = image_sets({"cam02": 10}, rig=rig)
    used = [trust.trusted(image_set, None, False) for image_set in sets]
    assert trust.doubted(replace(found, status=Status.LOST)).status is Status.LOST
    if n_cameras == 4:
        assert trust.doubted(found) is found and [image.camera for image in used[-1].images] == ["cam01", "cam03", "cam04"]
        return
    said = trust.doubted(found)
    assert used[-1] is sets[-1] and (said.status, said.limbs[0].status) == (Status.DEGRADED, LimbStatus.DEGRADED)
    assert said.reason == said.limbs[0].reason and "are 333 ms" in said.reason and said.limbs[1].status is LimbStatus.LOST


def test_a_clock_that_is_set_right_ends_it():
    found = looked(image_sets({"cam02": 12}))
    assert [fault.camera for fault in found.faults] == ["cam02"]
    for begin in (1, 2, 3):
        for image_set in image_sets({}, first=begin * N_SETS):
            found.look(image_set)
    assert found.faults == ()


@pytest.mark.parametrize("one_by_one", [False, True])
def test_points_that_come_late_count_for_the_image_that_shows_them(one_by_one):
    """As a detector beside a live tracker sends them: some sets later, of all cameras at once, or of one after the other."""
    sets, late = [], image_sets({"cam03": 10})
    for row, image_set in enumerate(late[6:], 6):
        images = []
        for i, image in enumerate(image_set.images):
            shown = late[row - 6 + (i if one_by_one else 0)]
            comes = row % 4 == (i if one_by_one else 0)
            images.append(replace(image, people=shown.images[i].people if comes else None, people_stamp_ns=shown.stamp_ns))
        sets.append(replace(image_set, images=tuple(images)))
    (fault,) = looked(sets).faults
    assert fault.camera == "cam03" and abs(fault.size - 10 / 30.0) < 1.1 * fault.sigma < 0.074


def test_images_with_several_people_and_unsure_points_say_nothing():
    late = {"cam03": 10}
    assert looked(image_sets(late, n_people=2)).faults == () == looked(image_sets(late, score=0.4)).faults


@pytest.mark.parametrize("stays", [0, 10])
def test_a_camera_that_shows_one_moment_all_the_time_is_not_late_by_any_time(stays):
    rng, found, blamed = np.random.default_rng(4), DelayedCameras(RIG, HUMAN), set()
    for row, image_set in enumerate(image_sets({})):
        images = list(image_set.images)
        if row >= stays:
            images[2] = replace(images[2], people=(person_at(RIG["cam03"], walking(stays), rng, 2.0),))
        found.look(replace(image_set, images=tuple(images)))
        blamed |= {(fault.camera, fault.size) for fault in found.faults}
    assert not blamed
