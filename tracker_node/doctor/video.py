"""What is wrong with the images of single cameras: their size, what they repeat, how they change, how often they come."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..camera.rig import Camera
from ..observation.deinterlace import COMB_THRESHOLD
from .motion import period_ns, speed
from .recording import CameraRecording
from .setup import Finding

_MOVED_SHARE = 0.004  # of the image's longer side
_EXPOSURE_CHANGE = 0.07
_REPEATED_FRACTION = 0.02
_GROWTH, _STEP = 1.36, 0.0125  # of `motion.Speed`
_HARDLY_MORE = 1.15  # growth at which flow cannot follow and says little about the step
_PRINCIPAL_POINT_OFF = 0.2  # of the image's width or height


def source_problems(recording: CameraRecording) -> list[Finding]:
    """What went wrong while the images were read."""
    name = recording.name
    if not len(recording):
        why = "; ".join(recording.problems) or "its source holds no images"
        return [Finding("source", (name,), f"{name}: no images: {why}.")]
    return [Finding("source", (name,), f"{name}: after {len(recording)} images: {problem}.") for problem in recording.problems]


def size_problems(camera: Camera, recording: CameraRecording) -> tuple[list[Finding], Camera | None]:
    """Compare the size of the images with that of the calibration.

    Parameters
    ----------
    camera : as calibrated.
    recording : its images.

    Returns
    -------
    Findings.
    The camera for the pixels of its images; None where they cannot be the calibration's, enlarged or reduced.
    """
    name, model = camera.name, camera.model
    width, height = recording.size
    calibrated = f"{model.width}x{model.height}"
    if (width, height) != (model.width, model.height):
        stretched = abs(width * model.height - height * model.width) > 0.01 * width * model.height
        advice = (
            "they were cropped, or come from another camera: say with pixel_map how their pixels lie in the calibration's"
            if stretched
            else f"if they were resampled by {width / model.width:g}, say so with pixel_map and file_image_size"
        )
        sentence = f"{name}: its images are {width}x{height}, the calibration is for {calibrated}; {advice}."
        sized = None if stretched else replace(camera, model=model.resized(width, height))
        return [Finding("resolution", (name,), sentence, {"width": width, "height": height})], sized
    off = np.abs(np.array([model.K[0, 2] / (width - 1), model.K[1, 2] / (height - 1)]) - 0.5)
    if off.max() > _PRINCIPAL_POINT_OFF:
        sentence = (
            f"{name}: the principal point ({model.K[0, 2]:.0f}, {model.K[1, 2]:.0f}) of K lies far from the middle of"
            f" {calibrated} images; K seems to be for images of about {2 * model.K[0, 2]:.0f}x{2 * model.K[1, 2]:.0f}."
        )
        return [Finding("resolution", (name,), sentence, {"principal_point_off": float(off.max())})], None
    return [], camera


def video_problems(recording: CameraRecording, everyone: list[CameraRecording]) -> tuple[list[Finding], np.ndarray]:
    """Check the images of one camera.

    Parameters
    ----------
    recording : its images.
    everyone : recordings of all cameras.

    Returns
    -------
    Findings.
    (n,) bool, which images can be compared with those of other cameras.
    """
    name, n = recording.name, len(recording)
    findings: list[Finding] = []
    good = np.ones(n, dtype=bool)
    start_ns = recording.stamps_ns[0]

    def seconds(index: int) -> float:
        return 1e-9 * (recording.stamps_ns[index] - start_ns)

    moved = recording.moved_from(_MOVED_SHARE * max(recording.size))
    if moved:
        first = moved[0].index
        before = max((s.index for s in recording.view_shifts if s.index < first), default=0)
        findings.append(
            Finding(
                "moved", (name,),
                f"{name}: was moved between {seconds(before):.1f} and {seconds(first):.1f} s: the background lies"
                f" {moved[-1].px:.0f} px from where it was. Its calibration holds for one of the two places only.",
                {"px": moved[-1].px, "after_s": seconds(before)},
            )
        )  # fmt: skip
        good[before + 1 :] = False
    repeated = recording.repeated(everyone)
    fraction = float(repeated[1:].mean()) if n > 1 else 0.0
    if fraction > _REPEATED_FRACTION:
        findings.append(
            Finding(
                "repeated", (name,),
                f"{name}: {repeated.sum()} of {n} images are the one before once more (the first at"
                f" {seconds(int(np.argmax(repeated))):.2f} s), though things move: images are lost on the way, or the"
                " file claims a higher rate than the camera's.",
                {"share": fraction},
            )
        )  # fmt: skip
    good &= ~repeated
    brightness = recording.brightness()[good]  # the first image always is
    change = float(brightness.max() / max(brightness.min(), 1e-6) - 1.0)
    if change > _EXPOSURE_CHANGE:
        sharpest = int(np.argmax(np.abs(np.diff(np.log(brightness)))))
        at = seconds(int(np.flatnonzero(good)[sharpest + 1]))
        findings.append(
            Finding(
                "exposure", (name,),
                f"{name}: the brightness of what stands still changes by {100 * change:.0f} %, most at {at:.1f} s: switch"
                " automatic exposure, gain and white balance off.",
                {"change": change, "at_s": at},
            )
        )  # fmt: skip
    if recording.combs and float(np.median(recording.combs)) > COMB_THRESHOLD:
        ratio = float(np.median(recording.combs))
        findings.append(
            Finding(
                "interlaced", (name,),
                f"{name}: is interlaced: what moves shows combs (ratio {ratio:.1f}, progressive video has less than"
                f" {COMB_THRESHOLD:g}), two time steps are in each image. Say `interlaced: top_first` or"
                " `bottom_first` in the rig.",
                {"comb_ratio": ratio},
            )
        )  # fmt: skip
    return findings, good


def rate_problems(recordings: list[CameraRecording], usable: Mapping[str, np.ndarray]) -> list[Finding]:
    """Check whether things move too far from image to image.

    Parameters
    ----------
    recordings : of all cameras.
    usable : camera -> (n,) bool of its images.

    Returns
    -------
    Findings.
    """
    speeds = [s for s in (speed(r, usable[r.name]) for r in recordings) if s is not None]
    if not speeds:
        return []
    growth = float(np.mean([s.growth for s in speeds]))
    step = float(np.mean([s.step for s in speeds]))
    if growth > _GROWTH or (step < _STEP and growth > _HARDLY_MORE):
        return []
    rate_hz = 1e9 / max(period_ns(r) for r in recordings)
    sentence = (
        f"The image rate ({rate_hz:.3g} Hz) is too low for this motion: over two images only {growth:.2f} times as much changes"
        " as over one (2 for slow motion); things are elsewhere in each image. Record faster, or ask for slower motion."
    )
    return [Finding("rate", (), sentence, {"growth": growth, "step": step, "rate_hz": rate_hz})]
