"""The page on which a body is posed by hand, as the papers' authors set their first pose: sliders, mouse, and a score."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
from starlette.routing import BaseRoute

from ...errors import FileFormatError, UnknownNameError
from ...loaders.file_model import FileModel, Number, numbers
from ...loaders.json_values import finite
from ...model.configuration import State
from ..endpoints import get, post
from ..outlines import OutlineDrawer
from ..session import ExistsError, PoseFiles, StudioSession, made_once
from .bench import PoseBench
from .drag import MODES, Grip, drag
from .values import dof_groups, state_of, values_of


class Pose(FileModel):
    """Values of all degrees of freedom, as `values` orders them."""

    values: list[Number]


class PoseInSet(Pose):
    """A pose in the images of one set."""

    set: int


class Drag(Pose):
    """A handle taken from a pose and dragged to a pixel of a camera."""

    handle: int
    camera: str
    pixel: numbers(2)  # type: ignore[valid-type]
    mode: str = "limb"


class Saved(PoseInSet):
    """A pose to be written."""

    name: str
    overwrite: bool = False


class Nothing(FileModel):
    """No more than that it is asked for."""


class Loaded(FileModel):
    """A file to be read."""

    name: str


class PosePage:
    """What the page asks for, each answer as plain values."""

    def __init__(self, session: StudioSession):
        self._session = session
        self._files = PoseFiles(session.files.folder)
        self._kept: PoseInSet | None = None

    @made_once
    def _drawer(self) -> OutlineDrawer:
        return OutlineDrawer(self._session.needed_rig(), self._session.needed_model())

    @made_once
    def _bench(self) -> PoseBench:
        return PoseBench(self._session)

    def body(self) -> dict[str, Any]:
        """All that does not change while a pose is set, and the first pose."""
        model, handles = self._session.needed_model(), self._drawer.handles
        self._session.needed_images()
        first = self._session.initial_state or State.neutral(model)
        values = values_of(first, model)
        links = model.chain.links
        return {
            "values": values,
            "groups": dof_groups(model, values),
            "handles": [{"name": name, "link": links[link]} for name, link in zip(handles.names, handles.links, strict=True)],
            "bones": handles.bones,
            "parts": [{"name": s.name, "color": c} for s, c in zip(model.shapes, self._drawer.colors(), strict=True)],
            "score": {"name": self._bench.scorer.name, "meaning": self._bench.scorer.meaning, "shrunk": self._bench.factor},
            "folder": str(self._session.files.folder),
            "kept": None if self._kept is None else {"values": self._kept.values, "set": self._kept.set},
        }

    def keep(self, asked: PoseInSet) -> dict[str, Any]:
        """Keep the pose for a page that is loaded again, as long as the studio runs."""
        state_of(asked.values, self._session.needed_model())  # refuses what is no pose of the body
        self._kept = asked
        return {}

    def discard(self) -> dict[str, Any]:
        """Forget the kept pose: the next page begins with the first one."""
        self._kept = None
        return {}

    def show(self, asked: Pose) -> dict[str, Any]:
        """The pose within its limits, and drawn."""
        return self._shown(state_of(asked.values, self._session.needed_model()))

    def _shown(self, state: State) -> dict[str, Any]:
        return {"values": values_of(state, self._session.needed_model()), "cameras": self._drawer.drawn(state)}

    def drag(self, asked: Drag) -> dict[str, Any]:
        """The pose with the handle where the mouse is, drawn."""
        model, handles = self._session.needed_model(), self._drawer.handles
        if not 0 <= asked.handle < len(handles.names):
            raise FileFormatError("request", "handle", f"a number below {len(handles.names)}", asked.handle)
        if asked.mode not in MODES:
            raise UnknownNameError("mode", asked.mode, MODES)
        grip = Grip(int(handles.links[asked.handle]), handles.points[asked.handle], self._session.needed_rig()[asked.camera])
        return self._shown(drag(model, state_of(asked.values, model), grip, np.array(asked.pixel), asked.mode))

    def score(self, asked: PoseInSet) -> dict[str, Any]:
        """What the engine would say of the pose."""
        found = self._bench.score(state_of(asked.values, self._session.needed_model()), asked.set)
        cameras = {c.camera: {"value": c.value, "samples": c.samples} for c in found.cameras}
        return {"total": found.total, "cameras": cameras, "parts": found.parts}

    def fit(self, asked: PoseInSet) -> dict[str, Any]:
        """The pose that the engine finds from here."""
        began = time.perf_counter()
        found = self._bench.fit(state_of(asked.values, self._session.needed_model()), asked.set)
        limbs = [{"name": limb.name, "status": limb.status.name, "reason": limb.reason} for limb in found.limbs]
        result = {"status": found.status.name, "reason": found.status_reason}
        result |= {"residual": finite(found.residual), "unit": found.residual_unit}
        return {**self._shown(found.state), **result, "limbs": limbs, "seconds": time.perf_counter() - began}

    def names(self) -> dict[str, Any]:
        """Files that may be loaded."""
        return {"names": self._files.names()}

    def load(self, asked: Loaded) -> dict[str, Any]:
        """The pose of a file, drawn."""
        return self._shown(self._files.load(asked.name, self._session.needed_model()))

    def save(self, asked: Saved) -> dict[str, Any]:
        """Write the pose: ``path``; ``exists`` where a file of that name is there, and nobody has said to replace it."""
        model = self._session.needed_model()
        comment = f"Set by hand in image set {asked.set}; the format is described in docs/formats.md."
        try:
            path = self._files.save(asked.name, state_of(asked.values, model), model, comment, asked.overwrite)
        except ExistsError as error:
            return {"exists": str(error)}
        return {"path": str(path)}


def routes(session: StudioSession) -> Sequence[BaseRoute]:
    """Below ``/api/pose/``: questions by GET, poses by POST."""
    page = PosePage(session)
    return [
        get("/api/pose/body", page.body),
        get("/api/pose/names", page.names),
        post("/api/pose/keep", PoseInSet, page.keep),
        post("/api/pose/discard", Nothing, lambda asked: page.discard()),
        post("/api/pose/show", Pose, page.show),
        post("/api/pose/drag", Drag, page.drag),
        post("/api/pose/score", PoseInSet, page.score),
        post("/api/pose/fit", PoseInSet, page.fit),
        post("/api/pose/load", Loaded, page.load),
        post("/api/pose/save", Saved, page.save),
    ]
