"""When recorded images are published: at their time, or as fast as a consumer has shown that it can take them."""

from __future__ import annotations

import threading
import time
from collections import deque

from rclpy.node import Node
from tracker_msgs.msg import TrackedState

from ..conversions import stamp_ns_of
from ..qos import RESULT


class Pace:
    """When an image set is due: its distance in stamps from the first, on the steady clock.

    ``epoch_ns`` added to a stamp gives the time of day at which it is due.
    """

    def __init__(self) -> None:
        self._epoch_s: float | None = None
        self.epoch_ns = 0

    def wait(self, stamp_ns: int, stop: threading.Event) -> float:
        """Sleep until an image set is due.

        Parameters
        ----------
        stamp_ns : of the image set.
        stop : ends the sleep when it is set.

        Returns
        -------
        late_s : seconds by which that was missed.
        """
        now = time.monotonic()
        if self._epoch_s is None:
            self._epoch_s, self.epoch_ns = now - 1e-9 * stamp_ns, time.time_ns() - stamp_ns
        due = self._epoch_s + 1e-9 * stamp_ns
        if due > now:
            stop.wait(due - now)
        return max(0.0, time.monotonic() - due)


_FIRST_S = 180.0  # a consumer may have to compile before its first answer
_PATIENCE_S = 15.0  # a consumer that has all cameras answers, on a slow machine as well; more on their way would only be lost
_INCOMPLETE_S = 0.3


class ConsumerWindow:
    """Counts the image sets sent and answered.

    An answer is a `TrackedState` whose stamp is that of the image set or later. When none comes for ``patience_s``, the window
    doubles, and shrinks again with each answer: a consumer that waits for a camera which is silent decides only when it has
    seen enough of the others. We know when a camera is silent, and are less patient then. So a lossless run goes on
    whatever the cameras do, and nothing but speed depends on the wall clock.
    """

    def __init__(self, node: Node, topic: str, size: int = 2, largest: int = 64, patience_s: float = _PATIENCE_S):
        self._node, self._topic = node, topic
        self._size, self._smallest, self._largest, self._patience_s = size, size, largest, patience_s
        self._complete = True
        self._condition = threading.Condition()
        self._on_their_way: deque[int] = deque()
        self._answered = 0
        self._closed = False
        self._subscription = node.create_subscription(TrackedState, topic, self._on_state, RESULT)

    def _on_state(self, message: TrackedState) -> None:
        self.answer(stamp_ns_of(message.header.stamp))

    def answer(self, stamp_ns: int) -> None:
        """The consumer is done with everything up to this stamp."""
        with self._condition:
            self._answered += 1
            self._size = max(self._smallest, self._size - 1)
            while self._on_their_way and self._on_their_way[0] <= stamp_ns:
                self._on_their_way.popleft()
            self._condition.notify_all()

    def sent(self, stamp_ns: int, complete: bool = True) -> None:
        """Note that an image set is on its way.

        Parameters
        ----------
        stamp_ns : of the image set.
        complete : whether all cameras are in it.
        """
        with self._condition:
            self._complete = complete
            self._on_their_way.append(stamp_ns)

    def wait(self) -> bool:
        """Wait until another image set may be sent; False when closed."""
        with self._condition:
            while not self._closed and len(self._on_their_way) >= self._size:
                answered, patience_s = self._answered, self._patience()
                began = time.monotonic()
                self._condition.wait(timeout=patience_s)
                if self._answered == answered and not self._closed and time.monotonic() - began >= patience_s:
                    self._grow(patience_s)
            return not self._closed

    def _patience(self) -> float:
        if not self._answered:
            return _FIRST_S
        return self._patience_s if self._complete else min(self._patience_s, _INCOMPLETE_S)

    def _grow(self, waited_s: float) -> None:
        if self._size < self._largest:
            self._size = min(2 * self._size, self._largest)
            if self._complete:
                self._node.get_logger().warning(
                    f"no answer on '{self._topic}' for {waited_s:g} s; letting {self._size} image sets be on their way"
                )
        else:  # whoever should answer is gone: do not keep the images for ever
            self._on_their_way.popleft()

    def wait_for_all(self) -> bool:
        """Until everything sent is answered, or no answer comes any more; True if all were."""
        with self._condition:
            while not self._closed and self._on_their_way:
                patience_s = self._patience_s if self._answered else _FIRST_S
                if not self._condition.wait(timeout=patience_s):
                    break
            return not self._on_their_way

    def close(self) -> None:
        """Wake and release whoever waits."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()
