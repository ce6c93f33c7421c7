"""A tracker that a test can hold and break."""

import threading
import time
from dataclasses import replace

from helpers.ros.samples import some_estimate, tracked_arm
from tracker_node.tracking.estimate import Status, Timings


class HeldTracker:
    """Steps only while ``go`` is set, and fails at the stamps in ``failing``."""

    def __init__(self):
        self.go, self.stepping, self.failing = threading.Event(), threading.Event(), set()
        self.status, self.total_ms = Status.DEGRADED, 0.0  # that an image set takes
        self.learned, self.breaks_learning = 0, False
        self.told = []  # states, "reset" and "look anew"

    def estimate(self, image_set):
        self.stepping.set()
        assert self.go.wait(30.0)
        if image_set.stamp_ns in self.failing:
            raise RuntimeError("no good")
        time.sleep(1e-3 * self.total_ms)
        timings = Timings(0.0, 0.0, self.total_ms)
        return replace(some_estimate(tracked_arm(), image_set.stamp_ns), status=self.status, timings=timings)

    def learn(self):
        self.learned += 1
        if self.breaks_learning:
            raise RuntimeError("cannot learn")

    def reset(self):
        self.told.append("reset")

    def set_state(self, state):
        self.told.append(state.to_values()[-1])

    def take_over(self, other, image_set):
        self.told.append(("take over", other, image_set.stamp_ns))

    def reinitialize(self, near=None):
        self.told.append("look anew")


class Listening(HeldTracker):
    """Never waits, and keeps what it was given."""

    def __init__(self):
        super().__init__()
        self.go.set()
        self.sets = []

    def estimate(self, image_set):
        self.sets.append(image_set)
        return super().estimate(image_set)
