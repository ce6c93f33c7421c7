"""What /diagnostics says of the tracking itself: status, limbs, rate, times, image sets, and what the images do not tell."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Mapping

import numpy as np

from ...model.articulated import ArticulatedModel
from ...observation.image_set import ImageSet
from ...tracking.estimate import LimbStatus, Status, TrackEstimate
from ...tracking.uncertainty.covariance import unobservable
from ..diagnostics import ERROR, OK, PAUSED, WARN, Diagnostics
from .setup import WorkerCounts
from .worker import TrackingWorker

_LEVELS = {Status.INITIALIZING: WARN, Status.TRACKING: OK, Status.DEGRADED: WARN, Status.LOST: ERROR}
_LIMB_LEVELS = {LimbStatus.TRACKING: OK, LimbStatus.UNSEEN: WARN, LimbStatus.DEGRADED: WARN, LimbStatus.LOST: ERROR}
_REMEMBERED = 150  # image sets that percentiles are of
_ENOUGH = 20  # of them, for an assessment
_JUDGED_REPORTS = 10  # what is left out is judged over so many seconds, or it would be said and unsaid by turns
_TOO_MANY, _TOLERATED = 0.05, 0.01  # fraction of image sets left out from which on, and down to which, it is reported
_SILENT_REPORTS = 2  # without an image set, until that is said to be wrong
_SILENT_REPORTS_LOSSLESS = 10  # the same of sources that wait for us, and end
_FIRST_REPORTS = 30  # the same for the first one: cameras may be started after us
_NAMED = 4  # degrees of freedom in a message
_LONG_S, _HANGS_S = 5.0, 60.0  # at work on one image set; compiled code may have to be loaded, or made
_OTHER_CLOCK_MS = 6e4  # stamps that are farther from now are not of this clock
_PASSING_S = 1.0  # of stamps: what is over by then is in the states, and no reason for a warning
_START_S = 10.0  # of stamps, for the body to be found


class LeftOut:
    """Whether too many image sets are left out, over some seconds: what is said does not change from one to the next."""

    def __init__(self) -> None:
        self._recent: deque[tuple[int, int]] = deque(maxlen=_JUDGED_REPORTS)
        self._is_said = False

    def too_many(self, tracked: int, left_out: int) -> bool:
        """So many were tracked and left out since the last call.

        Parameters
        ----------
        tracked, left_out : image sets since the last call.

        Returns
        -------
        too_many : as is to be said now.
        """
        self._recent.append((tracked, left_out))
        n_tracked, n_left_out = (sum(counts) for counts in zip(*self._recent, strict=True))
        self._is_said = n_left_out > (_TOLERATED if self._is_said else _TOO_MANY) * (n_tracked + n_left_out)
        return self._is_said


class TrackerDiagnostics:
    """Told of every estimate by the tracking thread, and asked for a report once a second by the event loop."""

    def __init__(self, diagnostics: Diagnostics, model: ArticulatedModel):
        self._diagnostics, self._model = diagnostics, model
        self._latency_ms: deque[float] = deque(maxlen=_REMEMBERED)
        self._processing_ms: deque[float] = deque(maxlen=_REMEMBERED)
        self._spread_ms: deque[float] = deque(maxlen=_REMEMBERED)
        self._before_s, self._tracked_before, self._skipped_before = time.monotonic(), 0, 0
        self._sets_before: Mapping[str, int] = {}
        self._jumps_of_clock, self._jumps_before = 0, (0, 0)  # of stamps, and of the clock
        self._back_before: Counter[str] = Counter()
        self._silent = 0
        self._left_out = LeftOut()
        self._limbs_reported: set[str] = set()
        self._bodies: set[str] = set()
        self._since_ns: dict[str, int] = {}  # part -> stamp from which on it has been in trouble

    def estimated(self, worker: TrackingWorker, image_set: ImageSet, now_ns: int) -> None:
        """One image set has been tracked and published, at ``now_ns`` of the clock that stamps are of.

        Parameters
        ----------
        worker : has tracked it.
        image_set : the images that it was made from.
        now_ns : of the clock that stamps are of.
        """
        stamps = [image.stamp_ns for image in image_set.images]
        self._latency_ms.append(1e-6 * (now_ns - image_set.stamp_ns))
        self._processing_ms.append(worker.step_ms)
        self._spread_ms.append(1e-6 * (max(stamps) - min(stamps)))
        if (said := worker.turned_away) or worker.absent:
            self._diagnostics.report("joining", WARN if said else OK, f"{said} (~/reset frees all)" if said else "names are left")
        absent = worker.absent
        for body, estimate in worker.estimates.items():
            of = f"{body}: " if body else ""
            if body in absent:
                self._report_absent(of, estimate.status_reason)
            else:
                self._report_body(body, of, estimate, worker.counts)

    def _report_absent(self, of: str, said: str) -> None:
        """Somebody who has not come, or has left: that is no trouble."""
        self._bodies.add(of)
        self._diagnostics.report(f"{of}status", OK, said)
        for part in (part for part in self._limbs_reported if part.startswith(of)):
            self._diagnostics.report(part, OK, said, logged=False)

    def _report_body(self, body: str, of: str, estimate: TrackEstimate, counts: WorkerCounts) -> None:
        self._bodies.add(of)
        values = {
            "image sets tracked": counts.of_body[body],
            "image sets skipped": counts.skipped,
            "image sets lost": counts.lost[body],
            "image sets failed": counts.failed,
            f"residual [{estimate.residual_unit}]": float(estimate.residual),
            "total [ms]": float(estimate.timings.total_ms),
        }
        said = estimate.status.name + (f": {estimate.status_reason}" if estimate.status_reason else "")
        status, level = estimate.status, _LEVELS[estimate.status]
        level = self._lasting(f"{of}start", level, status == Status.INITIALIZING, estimate.stamp_ns, _START_S)
        level = self._lasting(f"{of}status", level, status == Status.DEGRADED, estimate.stamp_ns)
        self._diagnostics.report(f"{of}status", level, said, values)
        for limb in estimate.limbs:
            said = limb.status.name + (f": {limb.reason}" if limb.reason else "")
            values = {"probability of being lost": float(limb.probability)}
            part, trouble = f"{of}limb {limb.name}", limb.status != LimbStatus.TRACKING
            self._limbs_reported.add(part)
            level = self._lasting(part, _LIMB_LEVELS[limb.status], trouble, estimate.stamp_ns)
            self._diagnostics.report(part, level, said, values, logged=False)

    def _lasting(self, part: str, level: bytes, trouble: bool, stamp_ns: int, passing_s: float = _PASSING_S) -> bytes:
        """``level``, but OK while a trouble has not yet lasted."""
        if not trouble:
            self._since_ns.pop(part, None)
            return level
        since_ns = self._since_ns[part] = min(stamp_ns, self._since_ns.get(part, stamp_ns))
        return level if stamp_ns - since_ns >= 1e9 * passing_s else OK

    def clock_jumped(self) -> None:
        """The simulated clock went back."""
        self._jumps_of_clock += 1

    def report(self, worker: TrackingWorker) -> None:
        """Once a second, while the node is active."""
        now, counts = time.monotonic(), worker.counts
        elapsed_s = max(now - self._before_s, 1e-3)
        tracked, skipped = counts.tracked - self._tracked_before, counts.skipped - self._skipped_before
        self._before_s, self._tracked_before, self._skipped_before = now, counts.tracked, counts.skipped
        values = {"image sets per second": tracked / elapsed_s, "skipped per second": skipped / elapsed_s}
        self._silent = 0 if tracked or worker.busy else self._silent + 1
        too_slow = self._left_out.too_many(tracked, skipped)
        self._diagnostics.report("rate", *_rate_assessment(worker, tracked, self._silent, too_slow), values)
        self._report_sets(worker)
        self._report_clock(worker)
        if worker.paused:
            self._report_pause()
        else:
            self._report_times(worker)
            self._report_unobservable(worker)

    def _report_pause(self) -> None:
        for part in ("latency", *(f"{of}{what}" for of in list(self._bodies) or [""] for what in ("status", "observability"))):
            self._diagnostics.report(part, OK, PAUSED)
        for part in list(self._limbs_reported):
            self._diagnostics.report(part, OK, PAUSED, logged=False)

    def _report_times(self, worker: TrackingWorker) -> None:
        config = worker.config.synchronizer
        latency, processing = _percentiles(self._latency_ms), _percentiles(self._processing_ms)
        if latency is None or processing is None:
            return
        values = {"processing p50 [ms]": processing[0], "processing p95 [ms]": processing[1]}
        level, said = OK, "from an image's stamp to the state"
        if abs(latency[0]) > _OTHER_CLOCK_MS:
            said = "stamps are not of this clock"
        else:
            values |= {"latency p50 [ms]": latency[0], "latency p95 [ms]": latency[1]}
            if len(self._latency_ms) >= _ENOUGH and latency[1] > 1e3 * config.queue_s:
                level, said = WARN, f"results come more than {config.queue_s:g} s after their images"
        stamps_ns = list(worker.formed_ns)
        period_ms = 1e-6 * float(np.median(np.diff(stamps_ns))) if len(stamps_ns) > _ENOUGH else 1e3 * config.image_period_s
        if not worker.lossless and len(self._processing_ms) >= _ENOUGH and processing[0] > period_ms:
            level, said = WARN, f"an image set takes longer than the {period_ms:.0f} ms from one to the next"
        self._diagnostics.report("latency", level, said, values)

    def _report_sets(self, worker: TrackingWorker) -> None:
        sets = worker.formation.sets
        new = {name: n - self._sets_before.get(name, 0) for name, n in sets.items()}
        self._sets_before = sets
        values: dict[str, object] = dict(sets)
        spread = _percentiles(self._spread_ms)
        if spread is not None:
            values |= {"spread of stamps p50 [ms]": spread[0], "spread of stamps p95 [ms]": spread[1]}
        complete, fewer = new.pop("complete"), new.pop("of fewer cameras")
        missed = {name.removeprefix("not formed, "): n for name, n in new.items() if n > 0}
        level, said = OK, "formed from the images by their stamps"
        if missed and not worker.paused:
            reasons = ", ".join(f"{reason} {n}" for reason, n in missed.items())
            level, said = WARN, f"some are not formed ({reasons})"
        elif fewer:
            level, said = WARN, f"{fewer} of {fewer + complete} are of fewer cameras than are in use"
        self._diagnostics.report("image sets", level, said, values)

    def _report_clock(self, worker: TrackingWorker) -> None:
        stamps, clock, (stamps_before, clock_before) = worker.formation.clock_jumps, self._jumps_of_clock, self._jumps_before
        self._jumps_before = stamps, clock
        back = Counter({camera: counts["clock_jump"] for camera, counts in worker.formation.counters.items()})
        alone, self._back_before = back - self._back_before, back
        level, said = OK, "stamps go forward"
        if stamps > stamps_before:
            level, said = WARN, "stamps went back: tracking has begun again"
        elif alone:
            level, said = WARN, f"stamps of {', '.join(alone)} went back: left out, the others go on"
        elif clock > clock_before:
            level, said = WARN, "the simulated clock went back"
        self._diagnostics.report("clock", level, said, {"jumps": stamps, "jumps of the simulated clock": clock})

    def _report_unobservable(self, worker: TrackingWorker) -> None:
        """What the latest images do not tell of each body, by name; a warning where it is of the body as a whole."""
        models, absent = worker.models, worker.absent
        for body, latest in worker.estimates.items():
            part = f"{body}: observability" if body else "observability"
            if body in absent or latest.information is None:
                said = "not here" if body in absent else "not known: the images have no weight"
                self._diagnostics.report(part, OK, said, logged=False)
                continue
            names = unobservable(latest.information, models.get(body, self._model))
            whole = any(map(_of_root, names))
            values = {f"unobservable {i + 1}": name for i, name in enumerate(names)}
            self._diagnostics.report(part, WARN if whole else OK, unobservable_in_short(names), values)


def _of_root(name: str) -> bool:
    """Whether `unobservable` says this of the whole body; ``root_rz -0.60 torso_turn_left`` is of the parts within it."""
    return name.startswith("root ") or (name.startswith("root_") and " " not in name)


def unobservable_in_short(names: list[str]) -> str:
    """How many directions the images do not tell, and of what, by the first names; the values have them all."""
    if not names:
        return "the images tell every degree of freedom"
    directions = "1 direction" if len(names) == 1 else f"{len(names)} directions"
    if any(map(_of_root, names)):
        return f"the images do not tell {directions}, some of them of the root"
    first = list(dict.fromkeys(name.split()[0] for name in names))
    more = f" and {len(first) - _NAMED} more" if len(first) > _NAMED else ""
    return f"the images do not tell {directions}: {', '.join(first[:_NAMED])}{more}"


def _rate_assessment(worker: TrackingWorker, tracked: int, silent: int, too_slow: bool) -> tuple[bytes, str]:
    if worker.fatal is not None:
        return ERROR, f"the tracking thread has ended: {worker.fatal}"
    if worker.paused:
        return OK, PAUSED
    since_s = worker.at_work_since_s
    at_work_s = 0.0 if since_s is None else time.monotonic() - since_s
    if at_work_s > _LONG_S:
        return WARN if at_work_s < _HANGS_S else ERROR, f"at work on one image set for {at_work_s:.0f} s"
    if too_slow:
        return WARN, f"too slow: image sets are left out (of the last {_JUDGED_REPORTS} s)"
    if tracked == 0:
        patience = _SILENT_REPORTS_LOSSLESS if worker.lossless else _SILENT_REPORTS
        patience = patience if worker.counts.tracked else _FIRST_REPORTS
        return (WARN, "no image sets") if silent >= patience else (OK, "waiting for image sets")
    return OK, "tracking"


def _percentiles(values: deque[float]) -> tuple[float, float] | None:
    """The 50th and the 95th; None without values."""
    copied = list(values)
    if not copied:
        return None
    p50, p95 = np.percentile(copied, [50, 95])
    return float(p50), float(p95)
