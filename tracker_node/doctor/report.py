"""What the doctor leaves: an image per camera, a page with all of them, and the findings as JSON."""

from __future__ import annotations

import json
import math
import textwrap
from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np

from ..camera.rig import Camera, CameraRig, epipolar_curve
from ..report.html import PageSection, write_page
from .diagnosis import Examination
from .recording import CameraRecording
from .setup import FAULTS, Finding, Setup

PAGE, JSON = "index.html", "findings.json"
_LONGER_SIDE = 960
_LETTER_PX = 8  # of a banner, a little more than most
_COLORS_BGR = ((60, 60, 230), (60, 180, 60), (230, 120, 40), (30, 190, 230), (200, 70, 200), (190, 190, 60))
_MOVES = 0.3  # fraction of full motion from which on a place is drawn
_LINE_TEXT = (
    "Filled: what moves. Lines, in the other cameras' colors: where the highest and the lowest place that moves in their images"
    " must lie if lenses, places and clocks are true; they should run through the same parts here."
)


def write_examination(
    folder: str | Path, rig: CameraRig, recordings: Mapping[str, CameraRecording], examination: Examination
) -> Path:
    """Write ``<camera>.png``, `PAGE` and `JSON`.

    Parameters
    ----------
    folder : where; it is made.
    rig : the cameras.
    recordings : camera -> its images.
    examination : what was found.

    Returns
    -------
    The path of the page.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    colors = {name: _COLORS_BGR[i % len(_COLORS_BGR)] for i, name in enumerate(rig.names)}
    sections = [
        PageSection("Findings", _summary(examination), preformatted="\n\n".join(f.sentence for f in examination.findings))
    ]
    for camera in rig:
        recording = recordings[camera.name]
        if recording.shown is None:
            continue
        path = folder / f"{camera.name}.png"
        own = [finding for finding in examination.findings if not finding.cameras or camera.name in finding.cameras]
        cv2.imwrite(str(path), _page_image(camera, recording, examination, own, colors))
        sections.append(PageSection(camera.name, " ".join(f.sentence for f in own) or "Nothing found.", image=path))
    sections.insert(1, PageSection("The images", _LINE_TEXT))
    write_page(folder / PAGE, "Check of a rig", sections)
    (folder / JSON).write_text(json.dumps(as_json(examination), indent=2) + "\n", encoding="utf-8")
    return folder / PAGE


def as_json(examination: Examination) -> dict[str, object]:
    """Findings and notes as plain values; not-a-number is None."""
    findings = [
        {
            "fault": finding.fault,
            "cameras": list(finding.cameras),
            "sentence": finding.sentence,
            "values": {key: value if math.isfinite(value) else None for key, value in finding.values.items()},
        }
        for finding in examination.findings
    ]
    return {"findings": findings, "notes": list(examination.notes), "compared": examination.compared}


def _summary(examination: Examination) -> str:
    nothing = "nothing is wrong" if examination.compared else "nothing is wrong with the images of single cameras"
    faults = ", ".join(dict.fromkeys(FAULTS[finding.fault] for finding in examination.findings)) or nothing
    return " ".join([f"{faults[0].upper()}{faults[1:]}.", *examination.notes])


def _page_image(
    camera: Camera,
    recording: CameraRecording,
    examination: Examination,
    findings: list[Finding],
    colors: Mapping[str, tuple[int, int, int]],
) -> np.ndarray:
    """The camera's image of a time step in mid-recording, with what moves in it and what the other cameras say about that."""
    image = recording.shown
    assert image is not None
    factor = _LONGER_SIDE / max(image.shape[:2])
    image = cv2.resize(image, None, fx=factor, fy=factor, interpolation=cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR)
    setup = examination.setup
    if setup is not None and camera.name in setup.motions:
        time_step = int(np.abs(examination.grid_ns - recording.stamps_ns[recording.shown_index]).argmin())
        _draw_motion(image, camera.name, setup, time_step, colors, factor)
    text = " ".join(finding.sentence for finding in findings) or f"{camera.name}: nothing found"
    return np.vstack([_banner(text, image.shape[1], bool(findings)), image])


def _draw_motion(
    image: np.ndarray, name: str, setup: Setup, time_step: int, colors: Mapping[str, tuple[int, int, int]], factor: float
) -> None:
    camera = next(c for c in setup.cameras if c.name == name)
    own = setup.motions[name]
    amounts = own.at(time_step)
    tint = image.copy()
    for u, v in own.pixels[amounts > _MOVES] * factor:
        cv2.circle(tint, (round(u), round(v)), 3, colors[name], -1, cv2.LINE_AA)
    cv2.addWeighted(tint, 0.5, image, 0.5, 0.0, dst=image)
    for other in setup.cameras:
        motion = setup.motions[other.name]
        moving = motion.pixels[motion.at(time_step) > _MOVES]
        if other.name == name or not len(moving):
            continue
        for pixel in (moving[np.argmin(moving[:, 1])], moving[np.argmax(moving[:, 1])]):
            line = epipolar_curve(other, pixel, camera) * factor
            cv2.polylines(image, [np.round(line).astype(np.int32)], False, colors[other.name], 2, cv2.LINE_AA)
        cv2.putText(
            image, other.name, (6, 22 + 22 * list(colors).index(other.name)), cv2.FONT_HERSHEY_SIMPLEX, 0.6, colors[other.name],
            2, cv2.LINE_AA,
        )  # fmt: skip


def _banner(text: str, width: int, alarm: bool) -> np.ndarray:
    """Lines of text on red or green, as wide as the image."""
    size, height = 0.5, 20
    lines = textwrap.wrap(text, max(1, (width - 12) // _LETTER_PX))
    banner = np.full((height * len(lines) + 10, width, 3), (40, 40, 170) if alarm else (60, 110, 40), dtype=np.uint8)
    for i, words in enumerate(lines):
        place = (6, height * (i + 1))
        cv2.putText(banner, words, place, cv2.FONT_HERSHEY_SIMPLEX, size, (255, 255, 255), 1, cv2.LINE_AA)
    return banner
