"""What the tracking thread works with and counts; a thread makes it anew for changed parameters."""

from __future__ import annotations

import threading
import traceback
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field

from ...camera.rig import CameraRig
from ...errors import TrackerError
from ...runs.loop import StartRequest, Steppable
from ...tracking.config import TrackerConfig

PAUSED, INACTIVE, UNCALIBRATED = "paused", "inactive", "uncalibrated"  # why images that have come are not used
_IDLE = (PAUSED, INACTIVE, UNCALIBRATED)


@dataclass(frozen=True, eq=False)
class TrackingSetup:
    """What is tracked with, from one change of parameters to the next.

    ``cameras`` are those in use, and ``rig`` is of these alone; it and ``tracker`` are None where lenses are not known yet.
    """

    config: TrackerConfig
    cameras: tuple[str, ...]
    rig: CameraRig | None = None
    tracker: Steppable | None = None


class StartRequests:
    """Keeps the newest request for each body, which comes from any thread, until an image set has been tracked as requested."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._asked: dict[str, StartRequest] = {}

    def asked(self, body: str) -> StartRequest | None:
        """The newest for a body or for all, until it has been followed."""
        with self._lock:
            return self._asked.get(body, self._asked.get(""))

    def ask(self, request: StartRequest) -> None:
        """A new one; it takes the place of an earlier one, one for all bodies that of all."""
        with self._lock:
            self._asked = {**self._asked, request.body: request} if request.body else {"": request}

    def followed(self, requests: Iterable[StartRequest]) -> None:
        """An image set has been tracked as these said; what has been asked since is kept."""
        with self._lock:
            done = set(map(id, requests))
            self._asked = {body: request for body, request in self._asked.items() if id(request) not in done}


@dataclass
class WorkerCounts:
    """What became of images and image sets; read by the diagnostics."""

    tracked: int = 0
    skipped: int = 0  # sets not tracked since a newer one was there
    lost: int = 0
    failed: int = 0  # sets at which the tracker raised an error
    refused: Counter[str] = field(default_factory=Counter)  # camera -> images that could not be used
    problems: dict[str, str] = field(default_factory=dict)  # camera -> why
    idle: dict[str, Counter[str]] = field(default_factory=lambda: {reason: Counter() for reason in _IDLE})
    # reason -> camera -> images that came while nothing was to be tracked


class SetupBuilder:
    """Makes what is asked for last, one at a time; `taken` hands it over to the event loop.

    What was asked for before something else is not handed over any more.

    Parameters
    ----------
    on_error : called with the details of what is not a `TrackerError`.
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
