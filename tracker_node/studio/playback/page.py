"""The page of a finished run: overlays, status, residuals and angles over time."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from starlette.routing import BaseRoute

from ...errors import FileFormatError, TrackerError, UnknownNameError
from ...loaders.file_model import FileModel
from ...loaders.json_values import finite_list
from ...model.articulated import ArticulatedModel
from ...tracking.estimate import LimbStatus, Status
from ..endpoints import get, image, post
from ..images import RecordedImages
from ..outlines import OutlineDrawer
from ..session import StudioSession, made_once
from .run import PlayedRun, open_run

_ROTATION = [3, 4, 5]  # columns of the root's rotation vector


class AskedRow(FileModel):
    """A state by its number in the run."""

    row: int


class AskedCurve(FileModel):
    """A degree of freedom by its name."""

    name: str


class PlaybackPage:
    """What the page asks for, each answer as plain values."""

    def __init__(self, session: StudioSession):
        self._session = session

    @made_once
    def _run(self) -> PlayedRun:
        return open_run(self._session)

    @made_once
    def _drawer(self) -> OutlineDrawer:
        return OutlineDrawer(self._run.rig, self._run.model)

    def images(self) -> RecordedImages:
        """Those of the run."""
        if self._run.images is None:
            raise TrackerError(self._run.problem)
        return self._run.images

    def run(self) -> dict[str, Any]:
        """All that does not change from state to state, and what the curves and strips show."""
        run, data, drawer = self._run, self._run.data, self._drawer
        details = data.details
        judged = details is not None and details.limbs
        return {
            "path": str(data.path),
            "problem": run.problem,
            "seconds": np.round((data.stamps_ns - data.stamps_ns[0]) * 1e-9, 6).tolist(),
            "begins_ns": int(data.stamps_ns[0]),
            "status": data.status.tolist(),
            "reasons": run.reasons,
            "statuses": {int(status): status.name.lower() for status in Status},
            "residual": finite_list(data.residual, 3),
            "residual_unit": data.residual_unit,
            "cameras": [{"name": c.name, "width": c.model.width, "height": c.model.height} for c in run.rig],
            "residual_cameras": list(data.cameras),
            "camera_residuals": finite_list(np.where(data.camera_samples > 0, data.camera_residuals, np.nan), 2),
            "numbers": [dict(numbers) for numbers in run.numbers],
            "limbs": list(details.limbs) if judged and details is not None else [],
            "limb_status": details.limb_status.tolist() if judged and details is not None else [],
            "limb_statuses": {int(status): status.name.lower() for status in LimbStatus},
            "dofs": [{"name": name, "unit": unit} for name, unit in zip(data.dof_names, _units(run.model), strict=True)],
            "parts": [{"name": s.name, "color": c} for s, c in zip(run.model.shapes, drawer.colors(), strict=True)],
            "bones": drawer.handles.bones,
        }

    def drawn(self, asked: AskedRow) -> dict[str, Any]:
        """The body of a state in all cameras; nothing where there is no state yet."""
        data = self._run.data
        if not 0 <= asked.row < len(data):
            raise FileFormatError("request", "row", f"a number below {len(data)}", asked.row)
        if not data.has_state[asked.row]:
            return {"cameras": {camera.name: {"parts": [], "handles": []} for camera in self._run.rig}}
        return {"cameras": self._drawer.drawn(data.configuration(self._run.model, asked.row).state)}

    def curve(self, asked: AskedCurve) -> dict[str, Any]:
        """A degree of freedom over the run, degrees or meters."""
        data = self._run.data
        if asked.name not in data.dof_names:
            raise UnknownNameError("degree of freedom", asked.name, data.dof_names)
        i = data.dof_names.index(asked.name)
        if i in _ROTATION:
            values = np.rad2deg(continuous_rotations(data.values[:, _ROTATION])[:, _ROTATION.index(i)])
        elif _units(self._run.model)[i] == "deg":
            values = np.rad2deg(continuous_angles(data.values[:, i]))
        else:
            values = data.values[:, i]
        return {"values": finite_list(values, 5)}


def routes(session: StudioSession) -> Sequence[BaseRoute]:
    """Below ``/api/playback/``."""
    page = PlaybackPage(session)
    return [
        get("/api/playback/run", page.run),
        post("/api/playback/drawn", AskedRow, page.drawn),
        post("/api/playback/curve", AskedCurve, page.curve),
        image("/api/playback/images/{camera}/{number}", page.images),
    ]


def _units(model: ArticulatedModel) -> list[str]:
    return ["m" if unit == "m" else "deg" for unit in model.chain.dof_units]


def continuous_angles(angles: np.ndarray) -> np.ndarray:
    """(n,) radians, each within half a turn of the finite one before; others stay as they are."""
    found, finite = np.array(angles), np.isfinite(angles)
    found[finite] = np.unwrap(angles[finite])
    return found


def continuous_rotations(vectors: np.ndarray) -> np.ndarray:
    """(n, 3) rotation vectors, radians, of the same rotations, each nearest to the finite one before; others stay as they are.

    One rotation has a vector for every number of full turns about its axis, so the components cannot be treated one by one.
    """
    found, before = np.array(vectors), np.zeros(3)
    for i in np.flatnonzero(np.isfinite(vectors).all(axis=1)):
        angle = np.linalg.norm(vectors[i])
        along = vectors[i] if angle > 0.0 else before  # after full turns no axis is left but that of the turns
        axis = along / max(np.linalg.norm(along), np.finfo(float).tiny)
        turns = np.round((before @ axis - angle) / (2.0 * np.pi))
        found[i] = before = vectors[i] + 2.0 * np.pi * turns * axis
    return found
