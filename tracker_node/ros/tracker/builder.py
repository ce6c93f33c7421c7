"""Trackers for changed parameters are made in a thread, so that the event loop receives meanwhile."""

from __future__ import annotations

import threading
import traceback
from collections.abc import Callable

from ...errors import TrackerError
from .setup import TrackingSetup


class SetupBuilder:
    """Makes what is asked for last, one at a time; `taken` hands it over to the event loop.

    What was asked for before something else is not handed over any more.

    Parameters
    ----------
    on_error : is told the details of what is not a `TrackerError`.
    """

    def __init__(self, on_error: Callable[[str], None] = lambda text: None):
        self._on_error = on_error
        self._condition = threading.Condition()
        self._asked: Callable[[], TrackingSetup] | None = None
        self._made: TrackingSetup | TrackerError | None = None
        self._at_work = False

    def ask(self, make: Callable[[], TrackingSetup]) -> None:
        """Make this, in a thread; ``make`` may raise."""
        with self._condition:
            self._asked, self._made = make, None
            if not self._at_work:
                self._at_work = True
                threading.Thread(target=self._run, name="make tracker", daemon=True).start()

    def forget(self) -> None:
        """Nothing is wanted any more."""
        with self._condition:
            self._asked = self._made = None

    @property
    def busy(self) -> bool:
        """Whether something that has been asked for has not been taken yet."""
        return self._asked is not None

    def taken(self) -> TrackingSetup | None:
        """What is made now, once; None while there is nothing.

        Raises
        ------
        TrackerError : it could not be made.
        """
        with self._condition:
            made = self._made
            if made is None:
                return None
            self._asked = self._made = None
        if isinstance(made, TrackerError):
            raise made
        return made

    def wait(self) -> None:
        """Until everything that is asked for is made."""
        with self._condition:
            self._condition.wait_for(lambda: self._asked is None or self._made is not None)

    def _run(self) -> None:
        while True:
            with self._condition:
                make = self._asked
                if make is None or self._made is not None:
                    self._at_work = False
                    return
            made = self._result(make)
            with self._condition:
                if self._asked is make:
                    self._made = made
                self._condition.notify_all()

    def _result(self, make: Callable[[], TrackingSetup]) -> TrackingSetup | TrackerError:
        try:
            return make()
        except TrackerError as error:
            return error
        except Exception as error:  # a mistake in the tracker must not leave its maker without an answer
            self._on_error("".join(traceback.format_exception(error)))
            return TrackerError(f"{type(error).__name__}: {error}")
