"""Accounts of image sets, read by another thread while cameras come and go."""

import threading

import numpy as np

from tracker_node.observation.image_set import CameraImage
from tracker_node.runs.loop import SetFormation
from tracker_node.tracking.config import SynchronizerConfig

CAMERAS = ("left", "right")
PIXELS = np.zeros((1, 1, 3), np.uint8)


def test_accounts_neither_double_nor_shrink_while_cameras_come_and_go():
    """No reading counts an image twice or forgets one, also in the middle of an exchange."""
    formation = SetFormation(CAMERAS, SynchronizerConfig())
    sent, ended, wrong = 0, threading.Event(), []

    def read() -> None:
        before = 0
        while not ended.is_set():
            received = formation.counters["left"]["received"]
            if not before <= received <= sent + 1:
                wrong.append((before, received, sent))
            before = received

    reader = threading.Thread(target=read)
    reader.start()
    try:
        for i in range(1500):
            formation.add(CameraImage("left", i * 33_000_000, PIXELS))
            sent += 1
            formation.change(CAMERAS[: 1 + i % 2], SynchronizerConfig())
    finally:
        ended.set()
        reader.join()
    assert not wrong
    assert formation.counters["left"]["received"] == 1500


def images(formation, stamps_ms, cameras=CAMERAS):
    return [s for ms in stamps_ms for c in cameras for s in formation.add(CameraImage(c, ms * 1_000_000, PIXELS))]


def test_a_change_counts_what_waits_and_keeps_the_accounts():
    formation = SetFormation(CAMERAS, SynchronizerConfig())
    assert len(images(formation, [0, 33])) == 2
    images(formation, [66], ("left",))
    formation.change(("left",), SynchronizerConfig())
    assert formation.cameras == ("left",) and len(images(formation, [99], ("left",))) == 1
    counters = formation.counters
    assert (counters["left"]["used"], counters["left"]["reset"], counters["right"]["used"]) == (3, 1, 2)
    sets = formation.sets
    assert (sets["complete"], sets["of fewer cameras"], sets["not formed, reset"]) == (3, 0, 1)
    assert formation.sets_not_formed["reset"] == 1


def test_a_change_to_the_same_resets_nothing():
    formation = SetFormation(CAMERAS, SynchronizerConfig())
    images(formation, [0], ("left",))
    formation.change(CAMERAS, SynchronizerConfig())
    assert len(images(formation, [0], ("right",))) == 1 and formation.counters["left"]["reset"] == 0


def test_a_camera_that_leaves_is_matched_up_to_its_last_image():
    formation = SetFormation(CAMERAS, SynchronizerConfig())
    formation.drop("right", 33_000_000)
    sets = images(formation, [0, 33]) + images(formation, [66, 99], ("left",))
    assert [s.cameras for s in sets] == [CAMERAS, CAMERAS, ("left",), ("left",)] and formation.cameras == ("left",)
    assert formation.counters["left"]["used"] == 4 and formation.counters["right"]["used"] == 2
    assert formation.sets["complete"] == 4 and not any(formation.sets_not_formed.values())


def test_with_fewer_cameras_than_asked_for_all_make_a_set():
    formation = SetFormation(CAMERAS, SynchronizerConfig(min_cameras=3))
    assert len(images(formation, [0])) == 1
