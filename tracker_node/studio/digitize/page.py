"""The page on which points are digitized: requests in, what comes of the clicks out."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Literal

import numpy as np
from starlette.routing import BaseRoute

from ...calibration.points.dlt import CONSTRAINTS
from ...camera.rig import CameraRig, epipolar_curve
from ...errors import FileFormatError, UnknownNameError
from ...loaders.file_model import FileModel, PositiveNumber, numbers
from ...loaders.json_values import finite
from ...loaders.rig.control_points import load_places
from ..endpoints import get, post
from ..session import StudioSession
from . import digitizing
from .click_store import PASSES, Clicked, ClickStore

CONTROL = "control"


class Asked(FileModel):
    """What a page wants to see: clicks of a pass (or ``control``) at image set ``set``, curves of ``point``."""

    set: int
    sheet: Literal["first", "second", "third", "control"]
    point: str = ""
    sigma_px: PositiveNumber = 1.0
    constraint: Literal["none", "no_skew", "square", "radial", "centered"] = "square"


class AskedClick(Asked):
    """The same after a click, or the end of one (``pixel`` null)."""

    camera: str
    pixel: numbers(2, what="two finite numbers") | None = None  # type: ignore[valid-type]


class AskedName(FileModel):
    """A point of one's own."""

    name: str


def routes(session: StudioSession) -> Sequence[BaseRoute]:
    """Below ``/api/digitizing/``."""
    page = DigitizePage(session)
    return [
        get("/api/digitizing", page.facts),
        post("/api/digitizing/sheet", Asked, page.sheet),
        post("/api/digitizing/click", AskedClick, page.click),
        post("/api/digitizing/point", AskedName, page.add_point),
        post("/api/digitizing/repeatability", Asked, page.repeatability),
        post("/api/digitizing/save", Asked, page.save),
    ]


class DigitizePage:
    """Answers of the page; from any thread, one at a time."""

    def __init__(self, session: StudioSession):
        self._session = session
        self._lock = threading.RLock()

    @cached_property
    def _store(self) -> ClickStore:
        """To read; to change anything, `_own_store`."""
        return self._loaded(self._session.files.clicks)

    @cached_property
    def _own_store(self) -> ClickStore:
        """The same from the first change on, once no other studio can change it; read anew, since one may have until then."""
        self._store = self._loaded(self._session.claimed_clicks)
        return self._store

    def _loaded(self, folder: Path) -> ClickStore:
        known = self._session.files.control_points
        return ClickStore(folder, self._rig.names, {} if known is None else load_places(known))

    @property
    def _rig(self) -> CameraRig:
        return self._session.needed_rig()

    def _stamp_ns(self, index: int) -> int:
        sets = self._session.needed_images().sets
        if not 0 <= index < len(sets):
            raise FileFormatError("request", "set", f"a number of an image set below {len(sets)}", index)
        return sets[index].stamp_ns

    def facts(self) -> dict[str, Any]:
        """What does not change from click to click."""
        with self._lock:
            sets = self._session.needed_images().sets
            return {
                "folder": str(self._store.folder.path),
                "points": self._points(),
                "places": {name: place.tolist() for name, place in self._store.places.items()},
                "counts": [self._store.count(s.stamp_ns) for s in sets],
                "passes": PASSES,
                "constraints": list(CONSTRAINTS),
            }

    def _points(self) -> list[str]:
        """Landmarks of the model, names of one's own, and whatever else was ever clicked on."""
        model = self._session.model
        landmarks = () if model is None else model.landmark_names
        return list(dict.fromkeys([*landmarks, *self._store.clicked_names()]))

    def sheet(self, asked: Asked) -> dict[str, Any]:
        """Clicks, and what comes of them."""
        with self._lock:
            stamp_ns = self._stamp_ns(asked.set)
            clicked = self._clicked(asked)
            sheet = self._control_sheet(asked) if asked.sheet == CONTROL else self._point_sheet(asked, clicked)
            curves = self._curves(clicked, asked.point)
            return {"clicks": _listed(clicked), "curves": curves, "count": self._store.count(stamp_ns), **sheet}

    def _clicked(self, asked: Asked) -> Clicked:
        if asked.sheet == CONTROL:
            return self._store.control
        return self._store.clicked(asked.sheet, self._stamp_ns(asked.set))

    def click(self, asked: AskedClick) -> dict[str, Any]:
        """Put, move or delete a click: the sheet with it, and the pixel that was there ``before``."""
        with self._lock:
            if asked.camera not in self._rig.names:
                raise UnknownNameError("camera", asked.camera, self._rig.names)
            pixel = None if asked.pixel is None else np.array(asked.pixel)
            if pixel is not None and not self._rig[asked.camera].model.in_image(pixel):
                raise FileFormatError("request", "pixel", f"a pixel on the image of camera '{asked.camera}'", asked.pixel)
            store = self._own_store
            known = store.places if asked.sheet == CONTROL else self._points()
            if asked.point not in known:
                raise UnknownNameError("point", asked.point, known)
            before = self._clicked(asked).get(asked.camera, {}).get(asked.point)
            if asked.sheet == CONTROL:
                store.set_control_click(asked.camera, asked.point, pixel)
            else:
                store.set_click(asked.sheet, self._stamp_ns(asked.set), asked.camera, asked.point, pixel)
            return {"before": None if before is None else before.tolist(), **self.sheet(asked)}

    def add_point(self, asked: AskedName) -> dict[str, Any]:
        """A point of one's own."""
        with self._lock:
            self._own_store.add_name(asked.name)
            return self.facts()

    def repeatability(self, asked: Asked) -> dict[str, Any]:
        """How well whoever has clicked would do so again."""
        with self._lock:
            found = digitizing.repeatability_of(self._rig, self._store, PASSES)
        return {name: finite(value) for name, value in vars(found).items()}

    def save(self, asked: Asked) -> dict[str, Any]:
        """Trajectories into the folder of the clicks."""
        with self._lock:
            written = digitizing.save_trajectories(self._rig, self._own_store)
            apart = digitizing.contradictions(self._rig, self._own_store)
        return {"written": [str(path) for path in written], "contradictions": apart}

    def _point_sheet(self, asked: Asked, clicked: Clicked) -> dict[str, Any]:
        points = {
            name: {
                "position": point.position_m.tolist(),
                "sigma": point.sigma_m.tolist(),
                "rms_px": point.rms_px,
                "residuals": dict(zip(cameras, point.residuals_px.tolist(), strict=True)),
                "seen": self._seen(point.position_m),
            }
            for name, (cameras, point) in digitizing.reconstruct(self._rig, clicked, asked.sigma_px).items()
        }
        return {"points": points}

    def _control_sheet(self, asked: Asked) -> dict[str, Any]:
        assessments, errors = digitizing.judge_control(self._rig, self._store.control_points(), asked.constraint)
        cameras = {
            name: {
                "problem": assessment.problem,
                "rms_px": _rms(assessment.residuals_px),
                "residuals": {}
                if assessment.residuals_px is None
                else dict(zip(assessment.seen.names, assessment.residuals_px.tolist(), strict=True)),
            }
            for name, assessment in assessments.items()
        }
        object_rms = float(np.sqrt(np.mean(errors**2))) if len(errors) else None
        expected = {name: self._seen(place) for name, place in self._store.places.items()}
        return {"cameras": cameras, "object_rms_m": object_rms, "object_points": len(errors), "expected": expected}

    def _seen(self, position: np.ndarray) -> dict[str, list[float]]:
        """Where the cameras of the rig see a place, of those whose images show it."""
        seen = {camera.name: camera.project(position) for camera in self._rig}
        return {name: pixel.tolist() for name, (pixel, ok) in seen.items() if ok and self._rig[name].model.in_image(pixel)}

    def _curves(self, clicked: Clicked, point: str) -> list[dict[str, Any]]:
        """Epipolar curves of the clicks on one point, in all other cameras."""
        pairs = [(a, b) for a in self._rig for b in self._rig if a.name != b.name and point in clicked.get(a.name, {})]
        return [
            {"of": a.name, "in": b.name, "pixels": np.round(epipolar_curve(a, clicked[a.name][point], b), 2).tolist()}
            for a, b in pairs
        ]


def _listed(clicked: Clicked) -> dict[str, dict[str, list[float]]]:
    return {camera: {point: pixel.tolist() for point, pixel in points.items()} for camera, points in clicked.items()}


def _rms(residuals_px: np.ndarray | None) -> float | None:
    return None if residuals_px is None else float(np.sqrt((residuals_px**2).sum(axis=1).mean()))
