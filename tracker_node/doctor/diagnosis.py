"""Faults of a rig, from a few seconds of its images.

Each check examines one thing; later ones know what earlier ones have found, so that one fault is reported once: images after a
camera was moved, repeated ones and cameras of the wrong size have no part in the comparison of cameras.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..camera.rig import Camera, CameraRig, wrong_unit
from ..geometry import se3
from .geometry import Correction, Diagnosis, diagnose
from .motion import common_grid, motion_on_grid
from .people import Comparison, Turn, common_joints, compared
from .recording import CameraRecording
from .setup import FAULTS, Finding, Setup
from .video import rate_problems, size_problems, source_problems, video_problems

_LEAST_AGREEMENT = 0.35
_NOT_CHECKED = "not checked: places, lenses and clocks. The cameras could not be compared"


@dataclass(frozen=True, eq=False)
class Examination:
    """All that was found, what was seen besides (``notes``), and, where cameras could be compared, what was compared: stamps
    (T,) of the time steps, the motion that every camera saw, and what became of it."""

    findings: tuple[Finding, ...]
    notes: tuple[str, ...]
    grid_ns: np.ndarray
    setup: Setup | None
    diagnosis: Diagnosis | None

    @property
    def compared(self) -> bool:
        """Whether any two cameras could be compared; if not, nothing is known of places, lenses and clocks."""
        return self.diagnosis is not None and bool(np.isfinite(self.diagnosis.after).any())


def examine(rig: CameraRig, recordings: Mapping[str, CameraRecording]) -> Examination:
    """Check for all faults of `FAULTS`.

    Parameters
    ----------
    rig : cameras as calibrated.
    recordings : camera name -> its images; one without images is reported as a fault.

    Returns
    -------
    Findings in the order of `FAULTS`, notes, and what was compared.
    """
    findings: list[Finding] = []
    notes: list[str] = []
    usable: dict[str, np.ndarray] = {}
    cameras: list[Camera] = []
    for camera in rig:
        recording = recordings[camera.name]
        notes += [f"{camera.name}: {note}" for note in recording.notes]
        findings += source_problems(recording)
        if not len(recording):
            continue
        size_findings, sized = size_problems(camera, recording)
        own, good = video_problems(recording, list(recordings.values()))
        findings += size_findings + own
        usable[camera.name] = good
        if sized is not None:
            cameras.append(sized)
    findings += rate_problems([recordings[name] for name in usable], usable)
    unit_findings, cameras = _units(cameras)
    findings += unit_findings
    seen = _compared(cameras, recordings, findings)
    if seen is not None:
        if seen.turn is None:
            notes.append(f"People's joints are {seen.apart_px:.1f} px from where other cameras have them (median, worst camera).")
        else:
            findings.append(_turned(seen.turn))
        cameras = [seen.rig[camera.name] if camera.name in seen.rig.names else camera for camera in cameras]
    setup = diagnosis = None
    grid = np.zeros(0, dtype=np.int64)
    moving = [camera for camera in cameras if usable[camera.name].sum() > 1]
    if len(moving) > 1:
        grid = common_grid({camera.name: recordings[camera.name] for camera in moving})
        if len(grid) > 1:
            motions = {c.name: motion_on_grid(recordings[c.name], grid, usable[c.name]) for c in moving}
            setup = Setup.of(moving, motions)
            settled = frozenset(seen.rig.names if seen is not None and seen.sound else ())
            diagnosis = diagnose(setup, 1e-9 * float(grid[1] - grid[0]), settled)
            findings += [_told(correction, rig, len(moving)) for correction in diagnosis.corrections]
            notes += _agreement_notes(diagnosis)
    if diagnosis is None:
        notes.append(f"{_NOT_CHECKED}: fewer than two of them have images at the same time.")
    order = list(FAULTS)
    return Examination(tuple(sorted(findings, key=lambda f: order.index(f.fault))), tuple(notes), grid, setup, diagnosis)


def _compared(
    cameras: Sequence[Camera], recordings: Mapping[str, CameraRecording], findings: Sequence[Finding]
) -> Comparison | None:
    """What people's joints say; None where there are none, or a camera was moved while it saw them."""
    joints = None if any(finding.fault == "moved" for finding in findings) else common_joints(cameras, recordings)
    return None if joints is None else compared(*joints)


def _units(cameras: list[Camera]) -> tuple[list[Finding], list[Camera]]:
    """Findings, and the cameras in meters."""
    wrong = wrong_unit(cameras)
    if wrong is None:
        return [], cameras
    in_metres = [
        replace(camera, T_world_cam=se3.scaled(camera.T_world_cam, wrong.factor)) if camera.name in wrong.cameras else camera
        for camera in cameras
    ]
    names = () if wrong.all_of_them else wrong.cameras
    values = {"apart_m": wrong.apart_m, "factor": wrong.factor}
    return [Finding("unit", names, wrong.sentence, values)], in_metres


def _told(correction: Correction, rig: CameraRig, n_compared: int) -> Finding:
    names = " and ".join(correction.cameras)
    values = {"gain": correction.gain, **correction.values}
    every = f"(agreement of the images grows by {correction.gain:.2f})"
    fault, sentence = {
        "swapped": ("swapped", f"{names} are exchanged: each has the other's images {every}. Exchange their sources."),
        "mirrored": (
            "mirrored",
            (f"{names}: its images are" if names else "An axis of the world is mirrored: all images are")
            + f" left-right mirrored against the calibration {every}. Correct the sign of that axis, or flip the images.",
        ),
        "upside_down": (
            "place",
            f"{names}: its images stand on their head {every}. Turn them, or the camera's place, by 180 degrees.",
        ),
        "axes": (
            "mirrored",
            f"The cameras' axes are mirrored {every}: y seems to point up and z backward, as in OpenGL. Here x points right, y"
            " down and z forward: change the signs of the second and third column of every T_world_cam.",
        ),
        "inverted": (
            "place",
            f"The places are inverted {every}: T_world_cam seems to hold the transforms from the world to the camera.",
        ),
        "clock": ("clock", _clock_sentence(correction, rig, every)),
        "focal": ("focal", _focal_sentence(correction, rig, every)),
        "place": ("place", _place_sentence(correction, every)),
    }[correction.kind]
    if n_compared == 2 and len(correction.cameras) == 1:
        sentence += " With two cameras it may as well be the other that is wrong."
    return Finding(fault, correction.cameras, sentence, values)


def _turned(turn: Turn) -> Finding:
    sentence = (
        f"{turn.camera}: does not look where the rig has it: turned by about {turn.turned_deg:.1f} degrees it has people's joints"
        f" where the other cameras have them ({turn.before_px:.1f} px off, then {turn.after_px:.1f})."
    )
    if turn.rivals:
        sentence += f" It may as well be {' or '.join(turn.rivals)}."
    sentence += " Refine the cameras' places (tracker_node calibrate refine), or calibrate them again."
    sentence += " A clock that is hundredths of a second late looks alike."
    values = {"turned_deg": turn.turned_deg, "share": turn.share, "before_px": turn.before_px, "after_px": turn.after_px}
    return Finding("place", (turn.camera,), sentence, values)


def _clock_sentence(correction: Correction, rig: CameraRig, every: str) -> str:
    if correction.kind != "clock":
        return ""
    late_ms = 1e3 * correction.values["late_s"]
    offset_s = 1e-9 * rig[correction.cameras[0]].time_offset_ns - correction.values["late_s"]
    which = "late" if late_ms > 0 else "early"
    return f"{correction.cameras[0]}: its clock is {abs(late_ms):.0f} ms {which} {every}. Set time_offset_s: {offset_s:.3f}."


def _focal_sentence(correction: Correction, rig: CameraRig, every: str) -> str:
    if correction.kind != "focal":
        return ""
    name, factor = correction.cameras[0], correction.values["factor"]
    focal = rig[name].model.K[0, 0]
    return (
        f"{name}: its focal length is wrong: {focal:.0f} px are given, {focal * factor:.0f} fit the other cameras {every}."
        " Was the zoom touched, or another lens put on? Calibrate it again."
    )


def _place_sentence(correction: Correction, every: str) -> str:
    if correction.kind != "place":
        return ""
    turned, moved = correction.values["turned_deg"], correction.values["moved_m"]
    return (
        f"{correction.cameras[0]}: does not stand where the rig has it: turned by about {turned:.1f} degrees"
        + (f" and moved by {100 * moved:.0f} cm" if moved > 0.005 else "")
        + f", it agrees with the others {every}. Calibrate the cameras' places again, or refine them."
    )


def _agreement_notes(diagnosis: Diagnosis) -> list[str]:
    known = diagnosis.after[np.isfinite(diagnosis.after)]
    if not len(known):
        return [f"{_NOT_CHECKED}: too little moves in the images."]
    notes = [f"Agreement of the cameras on where something moves: {np.mean(known):.2f} on average (1 is best)."]
    if np.mean(known) < _LEAST_AGREEMENT:
        notes.append("That is little: the recording shows too little common motion to judge places, lenses and clocks.")
    return notes
