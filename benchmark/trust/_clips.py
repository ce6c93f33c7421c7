"""The clips of the trust experiment: sound ones in fast motion, and events; rendered once, kept as images.

Two sets that share nothing but the bodies and the room: ``fit``, from which thresholds are taken, and ``judge``. Every clip has
`N_SETS` image sets. Every other sound clip is the one before played backwards. An event takes the images of a sound clip, but for
those sets in which it shows. Images are kept without noise, which each clip adds anew.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np

from benchmark.trust import _lost_events as events
from tracker_node.camera.rig import CameraRig
from tracker_node.evaluation.metrics import LOST_JOINT_M
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.synthesis.scenes.rasterizer import ColoredMesh
from tracker_node.synthesis.scenes.scene import SceneConfig, Studio, make_rig
from tracker_node.synthesis.subjects.cones import ModelSubject, waves
from tracker_node.synthesis.subjects.figure import figure_model, figure_motion
from tracker_node.tracking.limbs.tree import Limb, limbs_of

N_SETS, RATE_HZ = 30, 30.0
BEGINS, ENDS = 8, 18
NOISE_LEVELS = 4.0
SCENE = SceneConfig(
    n_cameras=4, radius=3.2, focal_px=560.0, distortion=(), noise_levels=0.0, blur_px=0.6, shadow=False, surroundings="clutter"
)
FIRST_SEED = {"fit": 100, "judge": 500}
# Per body: sound clips, and events of each kind
COUNTS = {
    "fit": (10, {"occluded": 3, "exit": 1, "teleport": 4, "wrong_start": 4, "hidden": 5, "swapped": 6, "mirrored": 6}),
    "judge": (20, {"occluded": 6, "exit": 6, "teleport": 7, "wrong_start": 6, "hidden": 9, "swapped": 8, "mirrored": 8}),
    "quick": (4, {"occluded": 1, "exit": 1, "teleport": 1, "wrong_start": 1, "hidden": 2, "swapped": 1, "mirrored": 1}),
}


def _figure(seed: int) -> tuple[ArticulatedModel, list[State]]:
    return figure_model(), figure_motion(RATE_HZ, N_SETS, seed)


def _human(seed: int) -> tuple[ArticulatedModel, list[State]]:
    model = human_model()
    return model, waves(model, 0.5 * RATE_HZ, N_SETS, seed)  # at twice its speed


@dataclass(frozen=True)
class Kind:
    """A body and how it moves, by seed; how many clips, as `COUNTS` has them. It is lost from ``lost_m`` meters off. Each camera
    has an exposure of its own, up to exp(+-``light``) of what the model knows."""

    motion: Callable[[int], tuple[ArticulatedModel, list[State]]]
    counts: Mapping[str, tuple[int, Mapping[str, int]]]
    lost_m: float = LOST_JOINT_M
    light: float = 0.0


BODIES = {"figure": Kind(_figure, COUNTS), "human": Kind(_human, COUNTS)}


@dataclass(frozen=True, eq=False)
class Recorded:
    """A clip with its images: set i is image set ``sources[i]`` (folder, number)."""

    body: str
    model: ArticulatedModel
    clip: events.EventClip
    sources: tuple[tuple[Path, int], ...]
    lost_m: float
    light: float

    def image_sets(self, rig: CameraRig) -> Iterator[ImageSet]:
        """One set after the other, read when asked for."""
        rng = np.random.default_rng([ord(letter) for letter in self.body + self.clip.name])
        exposures = np.exp(rng.uniform(-1.0, 1.0, len(rig)) * self.light) if self.light else np.ones(len(rig))
        for i, source in enumerate(self.sources):
            stamp = round(i * 1e9 / RATE_HZ)
            images = [(camera.name, cv2.imread(str(_path(*source, camera.name)))) for camera in rig]
            pairs = zip(images, exposures, strict=True)
            yield ImageSet(stamp, tuple(CameraImage(name, stamp, _noisy(image, e, rng)) for (name, image), e in pairs))


_GRAIN = np.random.default_rng(0).standard_normal((1200, 1200, 3), dtype=np.float32)


def _noisy(image: np.ndarray, exposure: float, rng: np.random.Generator) -> np.ndarray:
    """In an exposure, with sensor noise as `synthesis.scenes.scene` has it, from a random place in a store of grain."""
    height, width = image.shape[:2]
    v, u = rng.integers(0, _GRAIN.shape[0] - height), rng.integers(0, _GRAIN.shape[1] - width)
    bright = np.float32(exposure) * image.astype(np.float32)
    noise = _GRAIN[v : v + height, u : u + width] * np.sqrt(0.5 + bright / 255.0)
    return np.clip(np.rint(bright + NOISE_LEVELS * noise), 0, 255).astype(np.uint8)


def _path(folder: Path, number: int, camera: str) -> Path:
    return folder / f"{number:02d}_{camera}.png"


class LateStudio:
    """Opens a `Studio` when the first image is asked for."""

    def __init__(self, rig: CameraRig, scene: SceneConfig):
        self._rig, self._scene = rig, scene
        self._studio: Studio | None = None

    def images(self, mesh: ColoredMesh, number: int) -> list[np.ndarray]:
        self._studio = self._studio or Studio(self._rig, self._scene).__enter__()
        return self._studio.images(mesh, number)

    def close(self) -> None:
        if self._studio is not None:
            self._studio.__exit__(None, None, None)


def record(
    part: str, size: str, folder: Path, bodies: Mapping[str, Kind] = BODIES, scene: SceneConfig = SCENE
) -> tuple[CameraRig, list[Recorded]]:  # fmt: skip
    """All clips of one part; what is not in ``folder`` yet is rendered."""
    rig = make_rig(scene)
    studio = LateStudio(rig, scene)
    result: list[Recorded] = []
    for body, kind in bodies.items():
        counts = kind.counts["quick" if size == "quick" else part]
        result += _record_body(part, body, kind, *counts, folder / f"{part}_{size}_{body}", rig, studio)
    studio.close()
    return rig, result


def _record_body(part, body, kind: Kind, n_sound, counts, folder: Path, rig, studio: LateStudio) -> list[Recorded]:
    sound, subject = [], None
    for seed in range(FIRST_SEED[part], FIRST_SEED[part] + n_sound // 2):
        model, states = kind.motion(seed)
        subject = subject or ModelSubject(model)
        clip = events.EventClip(f"sound_{seed}", "sound", events.placed(states, np.random.default_rng(seed)))
        sources = _render(clip, range(N_SETS), subject, folder / clip.name, rig, studio)
        back = events.EventClip(f"sound_{seed}_back", "sound", clip.states[::-1])
        both = ((clip, sources), (back, sources[::-1]))
        sound += [Recorded(body, model, one, tuple(each), kind.lost_m, kind.light) for one, each in both]
    assert subject is not None
    result = list(sound)
    rng = np.random.default_rng([FIRST_SEED[part], len(body)])
    for event in (*events.BODY_KINDS, *events.LIMB_KINDS):
        for number in range(counts.get(event, 0)):
            name, base = f"{event}_{number}", (number * 3 + len(result)) % n_sound
            clip = _event(event, name, subject, [s.clip.states for s in sound], base, number, rng)
            sources = list(sound[base].sources)
            if event == "teleport":
                sources[BEGINS:] = sound[_another(base, n_sound)].sources[BEGINS:]
            elif event == "occluded":  # the crate stands still, and hides all that moves
                still = _render(clip, range(BEGINS, BEGINS + 1), subject, folder / name, rig, studio)
                sources[BEGINS:ENDS] = still * (ENDS - BEGINS)
            elif event in ("exit", "hidden"):
                sources[BEGINS:ENDS] = _render(clip, range(BEGINS, ENDS), subject, folder / name, rig, studio)
            result.append(Recorded(body, subject.model, clip, tuple(sources), kind.lost_m, kind.light))
    return result


def _another(base: int, n_sound: int) -> int:
    """A clip of another motion, not the same one backwards."""
    return (base + 2) % n_sound


def _event(kind, name, subject: ModelSubject, motions, base: int, number: int, rng) -> events.EventClip:
    model, states = subject.model, motions[base]
    if kind == "occluded":
        return events.occluded(name, subject, states, BEGINS, ENDS, rng)
    if kind == "exit":
        return events.exits(name, states, BEGINS, ENDS)
    if kind == "teleport":
        return events.teleports(name, states, motions[_another(base, len(motions))], BEGINS)
    if kind == "wrong_start":
        return events.wrong_start(name, model, states, rng)
    pairs = _pairs(model)
    for attempt in range(len(pairs)):
        limb, partner = pairs[(number + attempt) % len(pairs)]
        if kind == "hidden":
            return events.hidden(name, subject, states, limb, BEGINS, ENDS, rng)
        made = (
            events.swapped(name, model, states, limb, partner, BEGINS)
            if kind == "swapped"
            else events.mirrored(name, model, states, limb, BEGINS)
        )
        if made is not None:
            return made
    raise ValueError(f"{name}: expected a limb that can be {kind}, got none")


def _pairs(model: ArticulatedModel) -> list[tuple[Limb, Limb]]:
    """Limbs with their partners on the other side."""
    limbs = {limb.name: limb for limb in limbs_of(model)}
    other = {"left": "right", "right": "left"}
    split = [(limb, *limb.name.partition("_")) for limb in limbs.values()]
    return [(limb, limbs[f"{other[side]}_{rest}"]) for limb, side, _, rest in split if side in other]


def _render(
    clip: events.EventClip, sets: range, subject: ModelSubject, folder: Path, rig, studio: LateStudio
) -> list[tuple[Path, int]]:
    """Where the images of some sets of a clip are; a file written last says that all are there, and of what."""
    sources = [(folder, i) for i in sets]
    told = repr([np.round(clip.states[i].to_values(), 6).tolist() for i in sets])
    note = folder / "states.txt"
    if note.exists() and note.read_text() == told:
        return sources
    folder.mkdir(parents=True, exist_ok=True)
    for i, mesh in enumerate(clip.meshes(subject)):
        if i in sets:
            for camera, image in zip(rig, studio.images(mesh, i), strict=True):
                cv2.imwrite(str(_path(folder, i, camera.name)), image)
    note.write_text(told)
    print(f"rendered {folder}", file=sys.stderr, flush=True)
    return sources


def truth_of(recorded: Recorded) -> np.ndarray:
    """(n_sets, n_landmarks, 3) meters."""
    return np.array([Configuration(recorded.model, state).landmarks_world for state in recorded.clip.states])
