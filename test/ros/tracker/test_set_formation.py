"""Accounts of image sets, read by another thread while cameras come and go."""

import threading

import numpy as np

from tracker_node.observation.image_set import CameraImage
from tracker_node.ros.tracker.set_formation import SetFormation
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
