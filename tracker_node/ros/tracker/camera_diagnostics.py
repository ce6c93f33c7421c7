"""What /diagnostics says of each camera of a tracker: images by what became of them, calibration, contradictions."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Mapping

import numpy as np
from sensor_msgs.msg import CameraInfo

from ...camera.model import CameraModel
from ...camera.rig import CameraRig
from ...errors import TrackerError
from ...runs.messages import lens_of
from ...tracking.estimate import CameraFault
from ..diagnostics import ERROR, OK, PAUSED, STALE, WARN, Diagnostics, statuses_of
from .image_inbox import ImageInbox
from .worker import TrackingWorker

SILENT_S = 2.0  # a camera without an image for so long is reported
_SILENT_LOSSLESS_S = 10.0  # the same of sources that wait for us, and end
_FIRST_S = 30.0  # the same before any camera has sent one: they may be started after us
_SAME_PX = 1.0  # lenses agree that put no ray farther apart than this
_GRID = 5  # rays a side
_PROFILE = ": its driver needs FASTRTPS_DEFAULT_PROFILES_FILE, too (docs/nodes.md, Transport)"
_RIG_FILE, _FIRST_MESSAGE = "the rig file", "its first message"
_ANEW = "; to take it, the node is to be cleaned up and configured"
_UNUSED = ("late", "duplicate", "incomplete", "too_old", "ahead", "clock_jump")  # what one camera alone may be to blame for
_MUCH = 0.1  # of a camera's images lost on the way, or thrown away
_FEW = 4  # images, of which nothing is said


class CameraDiagnostics:
    """Told of contradicted cameras by the tracking thread, and asked for a report once a second by the event loop.

    Parameters
    ----------
    rig : all cameras, with the lenses of the rig file.
    from_topics : lenses are those that camera_info said first; what the rig says of them does not matter.
    """

    def __init__(self, diagnostics: Diagnostics, rig: CameraRig, inbox: ImageInbox, from_topics: bool):
        self._diagnostics, self._rig, self._inbox, self._from_topics = diagnostics, rig, inbox, from_topics
        self._contradicted: set[str] = set()
        self._received_before: dict[str, int] = {}
        self._unused_before: dict[str, Counter[str]] = {}
        self._gone_before: dict[str, Counter[str]] = {}
        self._compared: set[str] = set()  # cameras of whose calibration something has been said
        self.restart()

    def restart(self) -> None:
        """The node is active again: only from now on is a camera silent."""
        self._began_s = self._before_s = time.monotonic()
        self._images_came = False

    def contradicted(self, faults: Iterable[CameraFault]) -> None:
        """Cameras that the others contradict, and those that they no longer do."""
        statuses = statuses_of(faults)
        for camera, (level, said, values) in statuses.items():
            self._diagnostics.report(f"{camera} against the others", level, said, values, hardware_id=camera)
        for camera in self._contradicted - set(statuses):
            self._diagnostics.report(f"{camera} against the others", OK, "agrees with them", hardware_id=camera)
        self._contradicted = set(statuses)

    def report(self, worker: TrackingWorker, cameras: tuple[str, ...]) -> None:
        """Once a second, while the node is active.

        Parameters
        ----------
        worker : of the tracker.
        cameras : names of those in use.
        """
        now, counters = time.monotonic(), worker.formation.counters
        elapsed_s = max(now - self._before_s, 1e-3)
        if self._inbox.last_arrival_s and not self._images_came:
            self._images_came, self._began_s = True, now  # only from now on a camera without an image is silent
        for name in self._rig.names:
            values = self._counts(name, worker, counters.get(name, {}))
            arrived = self._inbox.arrived[name]
            rate = (arrived - self._received_before.get(name, 0)) / elapsed_s
            n_new, self._received_before[name] = arrived - self._received_before.get(name, 0), arrived
            unused, gone = self._newly_unused(name, counters.get(name, {})), self._newly_gone(name)
            level, said = self._assessment(name, worker, now) if name in cameras else (OK, "not in use")
            if level == OK and 2 * unused.total() > max(n_new, _FEW):
                reasons = ", ".join(f"{reason} {n}" for reason, n in unused.items())
                level, said = WARN, f"most of its images are in no set ({reasons})"
            elif self._inbox.most_bytes is not None and gone["overflowed"]:
                most = f"{self._inbox.most_bytes / 2**20:.0f} MiB of images wait"
                level, said = ERROR, f"images are lost though none may be: {most}, the tracker is too slow for these cameras"
            elif level == OK and gone.total() > _MUCH * (n_new + gone["lost in transport"]):
                remedy = _PROFILE if gone["lost in transport"] else ""
                level, said = WARN, f"images are lost ({', '.join(f'{reason} {n}' for reason, n in gone.items())}){remedy}"
            self._diagnostics.report(name, level, said, {"images per second": rate, **values}, hardware_id=name)
        self._before_s = now
        for name in self._contradicted if worker.paused else ():
            self._diagnostics.report(f"{name} against the others", OK, PAUSED, hardware_id=name)
        if self._from_topics and worker.rig is not None:
            self._report_calibration(cameras, worker.rig, _FIRST_MESSAGE)
        elif not self._from_topics:
            self._report_calibration(cameras, self._rig, _RIG_FILE)

    def _newly_unused(self, name: str, counter: Mapping[str, int]) -> Counter[str]:
        """Images since the last report that came and are in no set, by the reason."""
        unused = Counter({reason: counter.get(reason, 0) for reason in _UNUSED})
        new = unused - self._unused_before.get(name, Counter())
        self._unused_before[name] = unused
        return new

    def _gone(self, name: str) -> Counter[str]:
        """Images that did not get as far as the synchronizer, for want of time or room."""
        return Counter({"lost in transport": self._inbox.lost[name], "overflowed": self._inbox.overflowed[name]})

    def _newly_gone(self, name: str) -> Counter[str]:
        gone = self._gone(name)
        new = gone - self._gone_before.get(name, Counter())
        self._gone_before[name] = gone
        return new

    def _counts(self, name: str, worker: TrackingWorker, counter: Mapping[str, int]) -> dict[str, object]:
        counts = worker.counts
        idle = {reason: by_camera[name] for reason, by_camera in counts.idle.items()}
        return {**counter, **self._gone(name), "refused": counts.refused[name], **idle}

    def _assessment(self, name: str, worker: TrackingWorker, now: float) -> tuple[bytes, str]:
        problem = worker.counts.problems.get(name)
        if problem:
            return ERROR, problem
        last_s = self._inbox.last_arrival_s.get(name)
        silent_s = now - (self._began_s if last_s is None else last_s)
        patience_s = _SILENT_LOSSLESS_S if worker.lossless and last_s is not None else SILENT_S
        if silent_s < (patience_s if self._images_came else _FIRST_S):
            return OK, "waiting for the first image" if last_s is None else "receiving"
        if any(now - other_s < 0.5 * SILENT_S for other_s in list(self._inbox.last_arrival_s.values())):
            return ERROR, "has sent no image yet" if last_s is None else "has stopped sending images"
        # While we are at work, a source that waits for our answers is rightly silent.
        return (OK, "waits for the tracker") if worker.busy else (STALE, "no camera sends images")

    def _report_calibration(self, cameras: tuple[str, ...], rig: CameraRig, source: str) -> None:
        """``rig`` has the lenses in use, which are from ``source``."""
        infos = dict(self._inbox.infos)
        for name in cameras:
            if name in infos and name in rig.names:
                level, said = compared_lenses(name, infos[name], rig[name].model, source)
                self._diagnostics.report(f"calibration of {name}", level, said, hardware_id=name)
                self._compared.add(name)
        for name in self._compared - set(cameras):
            self._diagnostics.report(f"calibration of {name}", OK, "not in use", hardware_id=name)


def compared_lenses(camera: str, info: CameraInfo, lens: CameraModel, source: str = _RIG_FILE) -> tuple[bytes, str]:
    """Whether the calibration that a camera publishes is the one in use.

    Parameters
    ----------
    camera : its name.
    info : what the camera publishes.
    lens : in use.
    source : where that is from.

    Returns
    -------
    level, text : for /diagnostics.
    """
    if info.k[0] == 0.0:
        return OK if source == _RIG_FILE else WARN, f"that of {source} (camera_info: uncalibrated)"
    try:
        other = lens_of(camera, info)
    except TrackerError as error:
        return WARN, f"that of {source}; {error}"
    if (other.width, other.height) != (lens.width, lens.height):
        sizes = f"{other.width}x{other.height}, {source} of {lens.width}x{lens.height}"
        remedy = "; --calibration camera_info takes the former" if source == _RIG_FILE else _ANEW
        return WARN, f"camera_info speaks of images of {sizes}{remedy}"
    distance_px = lens_distance(lens, other)
    if not distance_px <= _SAME_PX:  # nan too
        if source == _RIG_FILE:
            return WARN, f"camera_info and the rig file are up to {distance_px:.1f} px apart; the rig file's is used"
        return WARN, f"camera_info is up to {distance_px:.1f} px from {source}, which is used{_ANEW}"
    return OK, f"calibrated: camera_info and {source} agree"


def lens_distance(one: CameraModel, other: CameraModel) -> float:
    """Largest distance [px] between where two lenses of one image size put the rays of a grid of pixels of the first.

    Parameters
    ----------
    one, other : lenses for images of one size.

    Returns
    -------
    distance : in pixels; infinite where they see no ray in common.
    """
    u, v = np.meshgrid(np.linspace(0, one.width - 1, _GRID), np.linspace(0, one.height - 1, _GRID))
    pixels = np.column_stack([u.ravel(), v.ravel()])
    rays, known = one.rays(pixels)
    seen, valid = other.project(rays)
    both = known & valid
    return float(np.linalg.norm(seen - pixels, axis=1)[both].max()) if both.any() else float("inf")
