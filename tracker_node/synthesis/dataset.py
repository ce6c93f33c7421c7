"""Synthetic sequences in a folder, in the same formats as real ones, with their truth.

=====================  ==========================================================================================
``rig.yaml``           cameras; sources and backgrounds relative to the folder
``cam01/000000.jpg``   images of each camera (JPEG of quality 95 without chroma subsampling, or PNG)
``backgrounds/cam01.png``   mean of the images in ``backgrounds/cam01/``, each with its own noise (optional)
``truth.csv``          joint centers, in the format of joints.csv
``true_states.csv``    states, in the format of states.csv, of a subject that has them
``static.trc``         joint centers in a T-pose, in landmark names (scales the tracker's model to the subject)
``synthetic.json``     how it was made; written last
=====================  ==========================================================================================
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path

import cv2
import numpy as np

from ..camera.rig import CameraRig
from ..errors import SourceError
from ..loaders.motion.trajectory_file import JointsWriter, StateRow, StateTrajectory, write_states
from ..loaders.motion.trc import MarkerTrajectories, dump_trc
from ..loaders.rig.rig_yaml import rig_file_of, write_rig_file
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..version import __version__
from .motions.motion import Motion
from .scenes.rasterizer import ColoredMesh
from .scenes.scene import SceneConfig, Studio, make_rig
from .subjects.cones import ModelSubject
from .subjects.mannequin import LANDMARKS, MannequinSubject

N_BACKGROUNDS = 10
_JPEG = [cv2.IMWRITE_JPEG_QUALITY, 95, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]
_STATIC_IMAGES = 5
_DRAWING = ("dataset", "scenes/*", "subjects/cones", "subjects/mannequin")


@dataclass(frozen=True, eq=False)
class PosedSubject:
    """One time step of a subject: its mesh and its landmarks (m, 3), meters, world."""

    mesh: ColoredMesh
    landmarks: np.ndarray


@dataclass(frozen=True, eq=False)
class Sequence:
    """What is to be recorded.

    Parameters
    ----------
    name : for messages.
    landmark_names : in the order of every time step's landmarks.
    time_steps : one per image set, made while it is recorded.
    n_images : their number.
    rate_hz : image sets per second.
    static_landmarks : (m, 3) landmarks in a T-pose, or None.
    states : of a subject that is the tracker's model, one per image set, with their ``dof_names``; or None.
    parameters : what else decides the content, for `describe`; plain values.
    """

    name: str
    landmark_names: tuple[str, ...]
    time_steps: Iterable[PosedSubject]
    n_images: int
    rate_hz: float = 30.0
    static_landmarks: np.ndarray | None = None
    states: tuple[State, ...] | None = None
    dof_names: tuple[str, ...] = ()
    parameters: dict = field(default_factory=dict)


def record(
    sequence: Sequence, scene: SceneConfig, folder: str | Path, progress: Callable[[int, int], None] = lambda i, n: None
) -> CameraRig:  # fmt: skip
    """Render a sequence into a folder.

    ``synthetic.json`` is written last: a folder that has it is complete.

    Parameters
    ----------
    sequence : subject in motion.
    scene : cameras and imaging.
    folder : where; it is made.
    progress : called with the image sets done and all of them.

    Returns
    -------
    The rig.

    Raises
    ------
    SourceError : an image cannot be written.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "synthetic.json").unlink(missing_ok=True)
    rig = make_rig(scene)
    for camera in rig:
        _clear(folder / camera.name)
    with Studio(rig, scene) as studio, JointsWriter(folder / "truth.csv", sequence.landmark_names) as truth:
        if scene.backgrounds:
            _write_backgrounds(studio, folder / "backgrounds")
        suffix = ".png" if scene.lossless else ".jpg"
        for i, time_step in enumerate(sequence.time_steps):
            for camera, image in zip(rig, studio.images(time_step.mesh, i), strict=True):
                _write(folder / camera.name / f"{i:06d}{suffix}", image)
            truth.append(round(i * 1e9 / sequence.rate_hz), time_step.landmarks)
            progress(i + 1, sequence.n_images)
    _write_rig(rig, folder, scene.backgrounds)
    (folder / "true_states.csv").unlink(missing_ok=True)
    if sequence.states is not None:
        _write_states(sequence, folder / "true_states.csv")
    if sequence.static_landmarks is not None:
        _write_static(sequence, folder / "static.trc")
    text = json.dumps(describe(sequence, scene), indent=2)
    (folder / "synthetic.json").write_text(text + "\n", encoding="utf-8")
    return rig


def describe(sequence: Sequence, scene: SceneConfig) -> dict:
    """All that decides the content of a recorded folder; equal descriptions mean equal folders.

    Parameters
    ----------
    sequence : subject in motion.
    scene : cameras and imaging.

    Returns
    -------
    Plain values.
    """
    return {
        "made_by": f"tracker_node {__version__}",
        "code": _code_digest(),
        "name": sequence.name,
        "rate_hz": sequence.rate_hz,
        "images": sequence.n_images,
        "scene": {key: list(value) if isinstance(value, tuple) else value for key, value in asdict(scene).items()},
        **sequence.parameters,
    }


@cache
def _code_digest() -> str:
    """Fingerprint of the code that draws: recordings of other code are not taken for this one's.

    Motions are not in it: a sequence has their content among its parameters.
    """
    folder = Path(__file__).parent
    files = [file for name in _DRAWING for file in sorted(folder.glob(f"{name}.py"))]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest()[:16]


def is_recorded(folder: str | Path, description: dict) -> bool:
    """Whether a folder holds the complete recording of a description.

    Parameters
    ----------
    folder : of the recording.
    description : see `describe`.

    Returns
    -------
    False where the folder is of something else, or incomplete.
    """
    try:
        found = json.loads((Path(folder) / "synthetic.json").read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return False
    return found == json.loads(json.dumps(description))


def _clear(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("[0-9]*.*"):
        old.unlink()


def _write(path: Path, image: np.ndarray) -> None:
    if not cv2.imwrite(str(path), image, _JPEG if path.suffix == ".jpg" else []):
        raise SourceError(path, "cannot write the image")


def _write_backgrounds(studio: Studio, folder: Path) -> None:
    for index, camera in enumerate(studio.rig):
        _clear(folder / camera.name)
        images = [studio.empty_image(index, i) for i in range(N_BACKGROUNDS)]
        for i, image in enumerate(images):
            _write(folder / camera.name / f"{i:02d}.jpg", image)
        mean = np.rint(np.mean(images, axis=0)).astype(np.uint8)
        _write(folder / f"{camera.name}.png", mean)


def _write_rig(rig: CameraRig, folder: Path, backgrounds: bool) -> None:
    changes = {
        camera.name: {
            "source": camera.name, "background": f"backgrounds/{camera.name}.png" if backgrounds else camera.background
        } for camera in rig
    }  # fmt: skip
    write_rig_file(rig_file_of(rig).with_cameras(changes), folder / "rig.yaml")


def _write_states(sequence: Sequence, path: Path) -> None:
    rows = (
        StateRow(round(i * 1e9 / sequence.rate_hz), "TRACKING", "truth", state.to_values())
        for i, state in enumerate(sequence.states or ())
    )
    write_states(path, StateTrajectory(sequence.dof_names, tuple(rows)))


def _write_static(sequence: Sequence, path: Path) -> None:
    positions = np.repeat(np.asarray(sequence.static_landmarks)[None], _STATIC_IMAGES, axis=0)
    times = np.arange(_STATIC_IMAGES) / sequence.rate_hz
    valid = np.ones(positions.shape[:2], dtype=np.bool_)
    dump_trc(MarkerTrajectories(tuple(sequence.landmark_names), times, positions, sequence.rate_hz, valid), path)


def mannequin_sequence(
    motion: Motion, stature: float = 1.75, part_colors_rgb: Mapping[str, tuple[int, int, int]] | None = None
) -> Sequence:
    """The mannequin in a motion, dressed or in the colors of its parts; truth is its own joints.

    Parameters
    ----------
    motion : of its segments.
    stature : meters.
    part_colors_rgb : part of the tracker's human -> color; None: clothes and skin.

    Returns
    -------
    The sequence, with a T-pose.
    """
    subject = MannequinSubject(stature, part_colors_rgb)
    colors = {} if part_colors_rgb is None else {"colors": digest(subject.colors_rgb)}

    def time_steps() -> Iterator[PosedSubject]:
        for body in subject.follow(motion):
            yield PosedSubject(ColoredMesh(body.vertices, subject.faces, subject.colors_rgb), body.landmarks)

    return Sequence(
        name=f"mannequin_{motion.name}", landmark_names=LANDMARKS, time_steps=time_steps(), n_images=len(motion),
        rate_hz=motion.rate_hz, static_landmarks=subject.t_pose().landmarks,
        parameters={"stature": stature, "motion": digest(motion.root_positions, motion.rotations), **colors},
    )  # fmt: skip


def model_sequence(model: ArticulatedModel, states: Iterable[State], rate_hz: float, name: str = "cones") -> Sequence:
    """The tracker's own model in given states; truth is its landmarks.

    Parameters
    ----------
    model : the body.
    states : one per image set.
    rate_hz : image sets per second.
    name : of the sequence.

    Returns
    -------
    The sequence, with its states.
    """
    subject = ModelSubject(model)
    states = list(states)

    def time_steps() -> Iterator[PosedSubject]:
        for state in states:
            configuration = Configuration(model, state)
            yield PosedSubject(subject.mesh(configuration), np.array(configuration.landmarks_world))

    rest = subject.mesh(Configuration(model, State.neutral(model)))
    content = digest(rest.vertices, rest.colors_rgb, *(state.to_values() for state in states))
    return Sequence(
        name, model.landmark_names, time_steps(), len(states), rate_hz,
        states=tuple(states), dof_names=model.chain.dof_names, parameters={"motion": content},
    )  # fmt: skip


def digest(*arrays: np.ndarray) -> str:
    """Fingerprint of arrays (rounded, so that it does not hang on the last bits of a machine's arithmetic)."""
    return hashlib.sha256(b"".join(np.round(a, 6).tobytes() for a in map(np.asarray, arrays))).hexdigest()[:16]
