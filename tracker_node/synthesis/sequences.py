"""The sequences that can be recorded: the mannequin in a motion, and the tracker's own model."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from .dataset import Instant, Sequence
from .motions.procedural import Motion
from .scenes.rasterizer import ColoredMesh
from .subjects.cones import ModelSubject
from .subjects.mannequin import LANDMARKS, MannequinSubject


def mannequin_sequence(
    motion: Motion, stature: float = 1.75, part_colors_rgb: Mapping[str, tuple[int, int, int]] | None = None
) -> Sequence:
    """The mannequin in ``motion``, dressed or in the colors of its parts; truth is its own joints."""
    subject = MannequinSubject(stature, part_colors_rgb)
    colors = {} if part_colors_rgb is None else {"colors": digest(subject.colors_rgb)}

    def instants() -> Iterator[Instant]:
        for body in subject.follow(motion):
            yield Instant(ColoredMesh(body.vertices, subject.faces, subject.colors_rgb), body.landmarks)

    return Sequence(
        name=f"mannequin_{motion.name}", landmark_names=LANDMARKS, instants=instants(), n_images=len(motion),
        rate_hz=motion.rate_hz, static_landmarks=subject.t_pose().landmarks,
        parameters={"stature": stature, "motion": digest(motion.root_positions, motion.rotations), **colors},
    )  # fmt: skip


def model_sequence(model: ArticulatedModel, states: Iterable[State], rate_hz: float, name: str = "cones") -> Sequence:
    """The tracker's own model in the given states; truth is its landmarks."""
    subject = ModelSubject(model)
    states = list(states)

    def instants() -> Iterator[Instant]:
        for state in states:
            configuration = Configuration(model, state)
            yield Instant(subject.mesh(configuration), np.array(configuration.landmarks_world))

    rest = subject.mesh(Configuration(model, State.neutral(model)))
    content = digest(rest.vertices, rest.colors_rgb, *(state.to_values() for state in states))
    return Sequence(
        name, model.landmark_names, instants(), len(states), rate_hz,
        states=tuple(states), dof_names=model.chain.dof_names, parameters={"motion": content},
    )  # fmt: skip


def digest(*arrays: np.ndarray) -> str:
    """Fingerprint of arrays (rounded, so that it does not hang on the last bits of a machine's arithmetic)."""
    return hashlib.sha256(b"".join(np.round(a, 6).tobytes() for a in map(np.asarray, arrays))).hexdigest()[:16]
