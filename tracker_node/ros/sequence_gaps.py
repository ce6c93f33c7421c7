"""Messages that never came to a subscription, by the numbers that publishers give theirs."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any


def with_number(callback: Callable[[Any, int | None], None]) -> Callable[..., None]:
    """A subscription's callback that also gets the number of the message, None where the middleware does not give one."""
    return _with_info(callback, "publication_sequence_number")


def with_source_stamp(callback: Callable[[Any, int | None], None]) -> Callable[..., None]:
    """A subscription's callback that also gets the time of sending [ns], None where the middleware does not know it."""
    return _with_info(callback, "source_timestamp")


def _with_info(callback: Callable[[Any, int | None], None], key: str) -> Callable[..., None]:
    """A callback that is also given one of the things that the middleware knows of a message.

    rclpy hands over what it knows of a message when a callback takes two arguments: as two by the usual executors, but as one
    pair by the events executor of Jazzy.
    """

    def receive(*received: Any) -> None:
        message, info = received if len(received) == 2 else received[0]
        callback(message, info.get(key))

    two = [inspect.Parameter(name, inspect.Parameter.POSITIONAL_ONLY) for name in ("message", "info")]
    receive.__signature__ = inspect.Signature(two)  # type: ignore[attr-defined]
    return receive


class SequenceGaps:
    """Counts what one subscription has missed.

    A publisher numbers its messages one by one, but they do not say which publisher they are of. A number goes on from the
    nearest one below it that is a publisher's latest; or it is the first of a publisher that has not been heard of yet, and what
    that sent before was not for us. One that takes the place of another, as the only one, and has sent more than that by then
    is taken for it, and the numbers between count as lost.

    Parameters
    ----------
    publishers : how many there are now.
    """

    def __init__(self, publishers: Callable[[], int]):
        self._publishers = publishers
        self._latest: list[int] = []  # of each publisher, that heard of last at the end
        self._missing = self._reported = 0

    @property
    def lost(self) -> int:
        """Messages so far, which never become fewer: by their numbers, or, without any, as the middleware tells."""
        return max(self._missing, self._reported)

    def reported(self, total: int) -> None:
        """So many messages are lost, says the middleware, which does not count those that it replaces by newer ones."""
        if not self._latest:
            self._reported = max(self._reported, total)

    def came(self, number: int | None) -> None:
        """A message with this number."""
        if number is None:
            return
        if number - 1 not in self._latest:
            self._look(number)
        else:
            self._latest.remove(number - 1)
        self._latest.append(number)

    def _look(self, number: int) -> None:
        """What a number means that does not follow on another."""
        n_publishers = max(1, self._publishers())
        del self._latest[:-n_publishers]  # of those that have left
        before = max((latest for latest in self._latest if latest < number), default=None)
        if before is not None and len(self._latest) == n_publishers:
            self._missing += number - before - 1
            self._latest.remove(before)
