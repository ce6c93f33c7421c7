"""Cameras brought to one time by whichever of their recordings' signals one asks for, and the picture that shows how well."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from ...camera.rig import Camera, CameraRig, axes_equations
from ...errors import CalibrationError
from ...loaders.images.source import open_camera_source
from ...loaders.images.video_tracks import DAY_S, Timecode, read_sound, read_timecode
from ...parallel import Workers
from ...render.palette import CYCLE
from .flashes import Flashes, flash_lags, seen_blinking, seen_flashes
from .motion import MOST_AT_ONCE, Lag, beginning, measured_motions, pairs_that_agree
from .offsets import ClockOptions, Clocks, clocks_of_pairs, estimate_clocks
from .sound import SPEED_OF_SOUND, Heard, sound_lags

MOTION, SOUND, FLASH, BLINKING, TIMECODE = WAYS = ("motion", "sound", "flash", "blinking", "timecode")
_KNOWN_M, _SOMEWHERE_M, _ANYWHERE_M = 0.1, 1.0, 3.0  # how well the place of a sound is known
_SHOWN_S = 1.0  # on either side of the strongest event
_SHOWN_TIMECODE_S = 10.0
_ENVELOPE_S = 1e-3

Signal = tuple[np.ndarray, np.ndarray]
Progress = Callable[[str, str], None]


@dataclass(frozen=True, eq=False)
class Synchronization:
    """Clocks, and what they were found from.

    Attributes
    ----------
    clocks : of all cameras.
    first_s : camera -> stamp of its first image, as it was read.
    signals : camera -> times of its own stamps, and a signal that rises where something happened.
    what : the signals are.
    """

    clocks: Clocks
    first_s: Mapping[str, float]
    signals: Mapping[str, Signal]
    what: str


def synchronized(
    rig: CameraRig, way: str, options: ClockOptions, seconds: float = 60.0, *, whole_images: bool = False,
    place: Sequence[float] | None = None, progress: Progress = lambda camera, what: None,
) -> Synchronization:  # fmt: skip
    """Find the clocks of a rig's cameras.

    Parameters
    ----------
    rig : with sources.
    way : of `WAYS`.
    options : largest offset, and whether drift is estimated, which motion alone tells.
    seconds : how much of each source is read.
    whole_images : of motion: how much moves altogether, for cameras whose places are not known.
    place : (3,) meters, world: where a sound was made; None: where the cameras look, within a meter or so.
    progress : called with a camera and what was read of it.

    Returns
    -------
    Clocks with their uncertainty.

    Raises
    ------
    CalibrationError : a camera that shows or hears nothing that others do.
    FileFormatError : a source without sound, or timecode.
    """
    if way == MOTION:
        motions = measured_motions(rig, seconds, whole_images, lambda camera, n: progress(camera, f"{n} images"))
        altogether = {m.camera: (m.times_s, np.mean([p.mean(axis=1) for p in m.profiles.values()], axis=0)) for m in motions}
        return Synchronization(estimate_clocks(motions, options), {m.camera: m.first_s for m in motions}, altogether, "motion")
    if way == TIMECODE:
        return _by_timecode(rig, progress)
    if way == SOUND:
        return _by_sound(rig, options, seconds, place, progress)
    return _by_light(rig, options, seconds, progress, seen_blinking if way == BLINKING else seen_flashes)


def _by_timecode(rig: CameraRig, progress: Progress) -> Synchronization:
    """By what the cameras have written: their images are exposed at any time within the period of their number."""
    found: dict[str, tuple[float, Timecode]] = {}
    for camera in rig:
        found[camera.name] = _first_stamp_s(camera), read_timecode(camera.source or camera.name)
        progress(camera.name, f"timecode {found[camera.name][1].label} at {found[camera.name][1].rate_hz:.5g} Hz")

    def lag(a: tuple[float, Timecode], b: tuple[float, Timecode]) -> Lag:
        apart_s = (b[1].seconds - a[1].seconds + 0.5 * DAY_S) % DAY_S - 0.5 * DAY_S  # also over midnight
        return Lag(b[0] - a[0] - apart_s, a[1].sigma_s**2 + b[1].sigma_s**2, 1.0, 0.0)

    pairs, runners_up = pairs_that_agree(list(found.values()), lag)
    first_s = {name: first for name, (first, _) in found.items()}
    clocks = clocks_of_pairs(pairs, rig.names, runners_up, float(np.median(list(first_s.values()))), what=TIMECODE)
    signals, shifts = {}, {name: clock.offset_s for name, clock in clocks.cameras.items()}
    begun_s = max(first + shifts[name] for name, (first, _) in found.items())  # all of them, in common time
    for name, (first, timecode) in found.items():
        since_s = begun_s - shifts[name] - first + np.arange(0.0, _SHOWN_TIMECODE_S, 1.0 / timecode.rate_hz)
        signals[name] = first + since_s, -((timecode.seconds + since_s) % 1.0)  # rises with each whole second
    return Synchronization(clocks, first_s, signals, "rest of the timecode's second")


def _first_stamp_s(camera: Camera) -> float:
    stamp_ns, _ = next(iter(open_camera_source(camera)), (None, None))
    if stamp_ns is None:
        raise CalibrationError(camera.name, "has no image")
    return 1e-9 * stamp_ns


def _by_sound(
    rig: CameraRig, options: ClockOptions, seconds: float, place: Sequence[float] | None, progress: Progress
) -> Synchronization:
    ways, known_m = _ways(rig, place)
    heard, first_s = [], {}
    for camera, way_m in zip(rig, ways, strict=True):
        first_s[camera.name] = _first_stamp_s(camera)
        pace = 1.0 + 1e-6 * camera.time_drift_ppm  # of common time to the camera's own, as its images are stamped
        way = way_m / SPEED_OF_SOUND, known_m / SPEED_OF_SOUND
        heard.append(_heard(camera.name, camera.source or camera.name, seconds, first_s[camera.name], pace, way))
        progress(camera.name, f"{len(heard[-1].samples) * pace / heard[-1].rate_hz:.1f} s of sound")
    clocks = _clocks_by_sound(heard, options.max_offset_s)
    return Synchronization(clocks, first_s, {one.camera: _loudness(one) for one in heard}, "loudness")


def _heard(
    name: str, source: str, seconds: float, first_s: float = 0.0, pace: float = 1.0, way: tuple[float, float] | None = None
) -> Heard:
    track = read_sound(source, seconds)
    way = way or (0.0, _ANYWHERE_M / SPEED_OF_SOUND)
    return Heard(name, track.rate_hz / pace, first_s + pace * track.after_images_s, track.samples, *way)


def _clocks_by_sound(heard: Sequence[Heard], max_offset_s: float) -> Clocks:
    pairs, runners_up = sound_lags(heard, max_offset_s)
    middle_s = float(np.median([0.5 * (one.first_s + one.last_s) for one in heard]))
    return clocks_of_pairs(pairs, [one.camera for one in heard], runners_up, middle_s, what=SOUND)


def clocks_of_videos(videos: Mapping[str, str], max_offset_s: float, seconds: float = 60.0) -> Clocks:
    """Clocks of cameras of which nothing is known, by the sound tracks of their videos, whose first images are at 0.

    Parameters
    ----------
    videos : camera -> its video, of two cameras at least.
    max_offset_s : largest offset.
    seconds : how much of each is read.

    Returns
    -------
    Clocks, to some milliseconds: sound takes 3 ms a meter.

    Raises
    ------
    CalibrationError : a camera that hears nothing that others do.
    FileFormatError : a video without sound.
    """
    return _clocks_by_sound([_heard(name, video, seconds) for name, video in videos.items()], max_offset_s)


def _ways(rig: CameraRig, place: Sequence[float] | None) -> tuple[np.ndarray, float]:
    """Meters from a sound to each camera, and how well they are known."""
    centers = np.array([camera.center for camera in rig])
    if np.ptp(centers, axis=0).max() < 1e-6:  # their places are not known
        return np.zeros(len(rig)), _ANYWHERE_M
    at = np.linalg.lstsq(*axes_equations(rig), rcond=None)[0] if place is None else np.asarray(place, dtype=np.float64)
    return np.linalg.norm(centers - at, axis=1), _SOMEWHERE_M if place is None else _KNOWN_M


def _loudness(heard: Heard) -> Signal:
    step = max(round(_ENVELOPE_S * heard.rate_hz), 1)
    n = len(heard.samples) // step
    loud = np.sqrt(np.mean(heard.samples[: n * step].reshape(n, step) ** 2, axis=1))
    return heard.first_s + (np.arange(n) + 0.5) * step / heard.rate_hz, loud


def _by_light(
    rig: CameraRig, options: ClockOptions, seconds: float, progress: Progress, see: Callable[..., Flashes]
) -> Synchronization:
    def seen(index: int):
        camera = rig.cameras[index]
        found = see(camera.name, beginning(open_camera_source(camera), seconds))
        changes = "flashes" if found.kinds is None else "changes of a light"
        progress(camera.name, f"{len(found.times_s)} {changes} in {len(found.stamps_s)} images")
        return found

    flashes = Workers(min(MOST_AT_ONCE, len(rig))).map(seen, range(len(rig)))
    pairs, runners_up = flash_lags(flashes, options.max_offset_s)
    middle_s = float(np.median([0.5 * (f.stamps_s[0] + f.stamps_s[-1]) for f in flashes]))
    clocks = clocks_of_pairs(pairs, rig.names, runners_up, middle_s, what="light")
    first_s = {f.camera: float(f.stamps_s[0]) for f in flashes}
    return Synchronization(clocks, first_s, {f.camera: (f.stamps_s, f.levels) for f in flashes}, "brightness")


def draw_synchronization(found: Synchronization, path: Path) -> None:
    """A picture of the signals: all of them by the stamps as they are, and the strongest event in common time.

    Parameters
    ----------
    found, path : what is drawn, and the PNG file.
    """
    n = len(found.signals)
    figure = Figure(figsize=(9.0, 1.0 + 0.75 * n), layout="constrained")
    axes = np.atleast_2d(figure.subplots(n, 2, sharex="col", width_ratios=(2, 1)))
    shifts = {name: clock.offset_s for name, clock in found.clocks.cameras.items()}
    first = next(iter(found.signals))
    times, values = found.signals[first]
    event_s = float(times[np.argmax(np.diff(values, prepend=values[0]))] + shifts[first])
    for i, (name, (times, values)) in enumerate(found.signals.items()):
        clock, color = found.clocks.cameras[name], CYCLE[i % len(CYCLE)]
        common = times + clock.offset_s + clock.drift * (times - found.clocks.middle_s)
        near = np.abs(common - event_s) <= _SHOWN_S
        axes[i, 0].plot(times, values, color=color, lw=0.7)
        axes[i, 1].plot(common[near] - event_s, values[near], color=color, lw=0.9)
        axes[i, 1].axvline(0.0, color="#777777", lw=0.6)
        axes[i, 0].set_ylabel(name, rotation=0, ha="right", size=8, parse_math=False)
        said = f"{1e3 * clock.offset_s:+.1f} ± {1e3 * clock.offset_sigma_s:.1f} ms"
        axes[i, 1].set_title(said, size=8, loc="right", pad=2)
        for ax in axes[i]:
            ax.set_yticks([])
            ax.tick_params(labelsize=7)
            ax.spines[["top", "right", "left"]].set_visible(False)
    axes[-1, 1].set_xticks([-_SHOWN_S, 0.0, _SHOWN_S])
    axes[0, 0].set_title(f"{found.what}, as the stamps say", size=9, loc="left")
    axes[0, 1].set_title("in common time", size=9, loc="left")
    axes[-1, 0].set_xlabel("s", size=8)
    axes[-1, 1].set_xlabel("s from the strongest event", size=8)
    figure.savefig(path, dpi=120, metadata={"Software": None})
