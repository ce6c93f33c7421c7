"""A gymnast who takes off, turns two somersaults and lands, filmed as interlaced video by two cameras and a third that is late.

The somersaults are planar: every segment has an angle about the lateral axis. In the air the mass center of the mesh is on a
parabola, and the turn is the faster the more the body is tucked, as if its angular momentum were kept. On the floor the legs bend
so that the feet stay where they are. World: x forward, y left, z up.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import cv2
import numpy as np
from scipy.interpolate import CubicHermiteSpline, PchipInterpolator

from tracker_node.calibration.body import ScalingOptions, scale_to_trial
from tracker_node.calibration.pose import fit_state_to_landmarks
from tracker_node.camera.rig import CameraRig
from tracker_node.experiments.cross.scene import TapeFaults, record
from tracker_node.geometry import so3
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.loaders.motion.trajectory_file import JointsWriter
from tracker_node.loaders.motion.trc import MarkerTrajectories
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.observation.deinterlace import first_line, weave_fields
from tracker_node.synthesis.scenes.rasterizer import ColoredMesh
from tracker_node.synthesis.scenes.scene import SceneConfig, Studio, make_rig
from tracker_node.synthesis.subjects.mannequin import LANDMARKS, MannequinSubject, PosedBody

FIELD_S = 0.02
LATE_CAMERA, LATE_S = "cam03", 0.011  # not genlocked: its fields are exposed so much later than the others'
GRAVITY = 9.81
TURNS = 2
MIDDLE_M = 1.5  # height of what the cameras look at: the middle of a volume of 4 m
SCENE = SceneConfig(
    n_cameras=3, width=768, height=576, radius=5.0, target_height=MIDDLE_M, focal_px=760.0, noise_levels=0.0, backgrounds=False,
)  # fmt: skip
TAPE = TapeFaults(luma_blur_px=0.8, chroma_blur_px=2.0, luma_noise=3.0, chroma_noise=5.0)

STAND_S, CROUCH_S, PUSH_S, ABSORB_S, RISE_S, END_S = 0.2, 0.38, 0.14, 0.15, 0.5, 0.2
STRETCHED, CROUCHED, ABSORBED = 0.985, 0.62, 0.68  # from hip to ankle, of the leg's length
INERTIA_TUCKED, INERTIA_PIKED = 0.35, 0.5  # of that of the open body
FLOOR_M = 0.08  # height of the ankles of the standing body

# Angles (rad) at: start, crouch, take-off, closed, open, landing, absorbed, end. Positive: trunk and head curl, hips, knees and
# shoulders bend to the front, elbows bend, arms are off the side.
TUCK = {"hip": 2.1, "knee": 2.1, "toes": 0.5}
PIKE = {"hip": 1.9, "knee": 0.1, "toes": 0.6}
KEYS = {
    "curl": (0.0, 0.3, -0.1, 0.5, 0.05, 0.15, 0.3, 0.0),
    "nod": (0.0, 0.0, -0.15, 0.3, 0.1, 0.1, 0.1, 0.0),
    "shoulder": (2.6, 0.9, 2.5, 0.9, 1.6, 1.4, 1.0, 2.4),
    "elbow": (0.2, 0.2, 0.15, 0.8, 0.3, 0.3, 0.3, 0.2),
    "aside": (0.15, 0.15, 0.15, 0.2, 0.5, 0.5, 0.4, 0.2),
}


@dataclass(frozen=True)
class Traits:
    """What differs between clips: ``direction`` 1 forward, -1 backward; lengths in meters, times in seconds, angles in rad."""

    direction: int
    piked: bool
    stature: float
    flight_s: float
    travel: float
    heading: float
    tempo: float
    uneven: Mapping[str, float]

    @classmethod
    def of(cls, seed: int) -> Traits:
        """Forward and backward, tucked and piked in turn; the rest at random."""
        rng = np.random.default_rng([seed, 41])
        return cls(
            direction=1 if seed % 2 else -1,
            piked=seed % 4 >= 2,
            stature=float(rng.uniform(1.58, 1.78)),
            flight_s=float(rng.uniform(0.98, 1.08)),
            travel=float(rng.uniform(1.0, 1.8)),
            heading=float(rng.uniform(-np.pi, np.pi)),
            tempo=float(rng.uniform(0.9, 1.15)),
            uneven={name: float(rng.normal(0.0, 0.08)) for name in ("hip", "knee", "shoulder", "elbow", "aside")},
        )


class DoubleSomersault:
    """A routine: poses of the subject at any time.

    Parameters
    ----------
    seed : of posture, tempo, direction, and of the recording's noise.
    colors_rgb : color of each part of the suit.

    Attributes
    ----------
    takeoff_s, landing_s, end_s : seconds from the start.
    """

    def __init__(self, seed: int, colors_rgb: Mapping[str, tuple[int, int, int]]):
        self.seed, self.traits = seed, Traits.of(seed)
        self.subject = MannequinSubject(self.traits.stature, colors_rgb)
        traits, k = self.traits, self.traits.tempo
        self._crouch_s = k * (STAND_S + CROUCH_S)
        self.takeoff_s = self._crouch_s + PUSH_S
        self.landing_s = self.takeoff_s + traits.flight_s
        self._absorbed_s = self.landing_s + ABSORB_S
        self._risen_s = self._absorbed_s + k * RISE_S
        self.end_s = self._risen_s + END_S
        closed, opened = 0.24 * traits.flight_s, 0.90 * traits.flight_s
        self._key_s = np.array([
            k * STAND_S, self._crouch_s, self.takeoff_s, self.takeoff_s + closed, self.takeoff_s + opened, self.landing_s,
            self._absorbed_s, self._risen_s,
        ])  # fmt: skip
        self._flight_keys = self.takeoff_s + traits.flight_s * np.array([0.0, 0.24, 0.68, 0.90, 1.0])

    @property
    def n_fields(self) -> int:
        """An even number: two make an image."""
        return 2 * int(self.end_s / (2.0 * FIELD_S))

    @cached_property
    def _turn(self) -> tuple[np.ndarray, np.ndarray]:
        """Times in the air, and the trunk's angle at them."""
        times = np.linspace(self.takeoff_s, self.landing_s, 2001)
        inertia = INERTIA_PIKED if self.traits.piked else INERTIA_TUCKED
        rate = 1.0 / (1.0 - (1.0 - inertia) * PchipInterpolator(self._flight_keys, [0.0, 1.0, 1.0, 0.1, 0.0])(times))
        angle = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(times))])
        begin, end = self._turn_ends
        return times, begin + (end - begin) * angle / angle[-1]

    @property
    def _turn_ends(self) -> tuple[float, float]:
        way = self.traits.direction
        return 0.2 * way, way * 2.0 * np.pi * TURNS + (-0.1 if way > 0 else 0.25)

    def turn(self, t: float) -> float:
        """Angle (rad) of the pelvis about the lateral axis, forward positive, counted on over full turns."""
        times, angles = self._turn
        if self.takeoff_s <= t <= self.landing_s:
            return float(np.interp(t, times, angles))
        stand = np.sign(angles[-1]) * 2.0 * np.pi * TURNS
        if t < self.takeoff_s:
            rate = (angles[1] - angles[0]) / (times[1] - times[0])
            keys, values, rates = self._key_s[:3], [0.0, 0.45, angles[0]], [0.0, 0.0, rate]
        else:
            rate = (angles[-1] - angles[-2]) / (times[-1] - times[-2])
            keys, values, rates = self._key_s[5:], [angles[-1], stand + 0.5, stand], [rate, 0.0, 0.0]
        return float(CubicHermiteSpline(keys, values, rates)(np.clip(t, keys[0], keys[-1])))

    def _legs(self, t: float) -> tuple[float, float]:
        """On the floor: how far hips are from ankles, of the leg's length, and how far the leg leans forward, rad."""
        start, crouch, takeoff, _, _, landing, absorbed, risen = self._key_s
        way = self.traits.direction
        lean = PchipInterpolator(
            [start, crouch, takeoff, landing, absorbed, risen], way * np.array([0.0, -0.02, 0.18, -0.15, -0.05, 0.0])
        )(np.clip(t, start, risen))
        if t < crouch:
            return STRETCHED - (STRETCHED - CROUCHED) * _smooth((t - start) / (crouch - start)), float(lean)
        if t <= takeoff:
            return CROUCHED + (STRETCHED - CROUCHED) * ((t - crouch) / (takeoff - crouch)) ** 2, float(lean)
        if t < absorbed:
            return ABSORBED + (STRETCHED - ABSORBED) * ((absorbed - t) / (absorbed - landing)) ** 2, float(lean)
        return ABSORBED + (STRETCHED - ABSORBED) * _smooth((t - absorbed) / (risen - absorbed)), float(lean)

    def _leg_angles(self, t: float) -> dict[str, float]:
        """Of hip, knee and toes."""
        if self.takeoff_s < t < self.landing_s:
            held = PIKE if self.traits.piked else TUCK
            ends = [self._leg_angles(end) for end in (self.takeoff_s, self.landing_s)]
            turns = 2.0 * np.pi * TURNS * self.traits.direction
            ends[1]["hip"] -= turns
            opened = {"hip": 0.35, "knee": 0.15, "toes": 0.3}
            return {
                name: float(
                    PchipInterpolator(self._flight_keys, [ends[0][name], *(2 * [held[name]]), opened[name], ends[1][name]])(t)
                )
                for name in held
            }
        stretched, lean = self._legs(t)
        bent = float(np.arccos(stretched))
        return {"hip": self.turn(t) - (lean - bent), "knee": 2.0 * bent, "toes": -(lean + bent)}

    def rotations(self, t: float) -> dict[str, np.ndarray]:
        """World rotation (3, 3) of every segment, body axes."""
        angles = {name: float(PchipInterpolator(self._key_s, values)(np.clip(t, self._key_s[0], self._key_s[-1])))
                  for name, values in KEYS.items()}  # fmt: skip
        angles |= self._leg_angles(t)
        world = {"pelvis": so3.exp([0.0, 0.0, self.traits.heading]) @ _bent(self.turn(t))}
        world["torso"] = world["pelvis"] @ _bent(angles["curl"])
        world["head"] = world["torso"] @ _bent(angles["nod"])
        in_air = _smooth(min(t - self.takeoff_s, self.landing_s - t) / 0.15)
        for side, sign in (("left", 1.0), ("right", -1.0)):
            own = {name: angle + 0.5 * sign * self.traits.uneven.get(name, 0.0) * (1.0 if name not in TUCK else in_air)
                   for name, angle in angles.items()}  # fmt: skip
            world[f"{side}_thigh"] = world["pelvis"] @ _bent(-own["hip"])
            world[f"{side}_shank"] = world[f"{side}_thigh"] @ _bent(own["knee"])
            world[f"{side}_foot"] = world[f"{side}_shank"] @ _bent(own["toes"])
            world[f"{side}_upper_arm"] = world["torso"] @ _bent(-own["shoulder"]) @ so3.exp([sign * own["aside"], 0.0, 0.0])
            world[f"{side}_forearm"] = world[f"{side}_upper_arm"] @ _bent(-max(own["elbow"], 0.02))
        return world

    def _standing(self, t: float, ankles: np.ndarray) -> np.ndarray:
        """(3,) point midway between the hips of the body whose ankles are about a point."""
        stretched, lean = self._legs(t)
        leg = stretched * self.subject.leg_length * np.array([np.sin(lean), 0.0, np.cos(lean)])
        return ankles + so3.exp([0.0, 0.0, self.traits.heading]) @ leg

    @cached_property
    def _path(self) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Ankles before and after, (3,) each; mass center and velocity at the take-off."""
        ahead = so3.exp([0.0, 0.0, self.traits.heading]) @ [0.5 * self.traits.direction * self.traits.travel, 0.0, 0.0]
        middle = np.array([0.0, 0.0, FLOOR_M])
        before, after = middle - ahead, middle + ahead
        ends = [
            self._standing(t, ankles) + mass_center(self.subject, self.subject.pose(self.rotations(t), np.zeros(3)))
            for t, ankles in ((self.takeoff_s, before), (self.landing_s, after))
        ]
        flight_s = self.traits.flight_s
        return before, after, ends[0], (ends[1] - ends[0]) / flight_s + [0.0, 0.0, 0.5 * GRAVITY * flight_s]

    def pose(self, t: float) -> PosedBody:
        """The body at a time."""
        before, after, begin, velocity = self._path
        rotations = self.rotations(t)
        if not self.takeoff_s < t < self.landing_s:
            return self.subject.pose(rotations, self._standing(t, before if t <= self.takeoff_s else after))
        elapsed = t - self.takeoff_s
        center = begin + elapsed * velocity - [0.0, 0.0, 0.5 * GRAVITY * elapsed**2]
        body = self.subject.pose(rotations, np.zeros(3))
        shift = center - mass_center(self.subject, body)
        return PosedBody(body.vertices + shift, body.landmarks + shift)


def mass_center(subject: MannequinSubject, body: PosedBody) -> np.ndarray:
    """(3,) meters: centroid of the volume of the mesh.

    Parameters
    ----------
    subject, body : the mesh, and its pose.

    Returns
    -------
    In the frame of the pose.
    """
    a, b, c = np.moveaxis(body.vertices[subject.faces], 1, 0)
    volumes = np.einsum("ni,ni->n", a, np.cross(b, c))
    return np.einsum("n,ni->i", volumes, a + b + c) / (4.0 * volumes.sum())


def _bent(angle: float) -> np.ndarray:
    """Rotation (3, 3) that bends a standing body forward."""
    return so3.exp([0.0, angle, 0.0])


def _smooth(x: float) -> float:
    x = float(np.clip(x, 0.0, 1.0))
    return x * x * (3.0 - 2.0 * x)


def exposure_s(camera: str, field: int) -> float:
    """When a field is exposed.

    Parameters
    ----------
    camera, field : its name and number.

    Returns
    -------
    Seconds from the start.
    """
    return FIELD_S * field + (LATE_S if camera == LATE_CAMERA else 0.0)


def film(routine: DoubleSomersault, model: ArticulatedModel, folder: Path) -> None:
    """Record a routine as interlaced video, with the tracker's files; ``rig.yaml`` is written last.

    Parameters
    ----------
    routine : what is filmed.
    model : the tracker's, to be scaled to the subject by its T-pose.
    folder : gets rig.yaml, images of every camera, person.yaml, state.yaml, truth.csv.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.yaml").unlink(missing_ok=True)
    scene = replace(SCENE, seed=routine.seed)
    rig = make_rig(scene)
    for late in (False, True):
        _film(routine, CameraRig(tuple(c for c in rig if (c.name == LATE_CAMERA) == late)), scene, folder)
    bodies = [routine.pose(FIELD_S * field).landmarks for field in range(routine.n_fields)]
    with JointsWriter(folder / "truth.csv", LANDMARKS) as truth:
        for field, landmarks in enumerate(bodies):
            truth.append(round(1e9 * FIELD_S * field), landmarks)
    trial = np.repeat(routine.subject.t_pose().landmarks[None], 2, axis=0)
    valid = np.ones(trial.shape[:2], dtype=np.bool_)
    static = MarkerTrajectories(LANDMARKS, np.array([0.0, FIELD_S]), trial, 1.0 / FIELD_S, valid)
    person = scale_to_trial(model, static, ScalingOptions(joint_sigma_m=0.0, symmetric=False)).model
    dump_model(person, folder / "person.yaml", comment="The tracker's model of the gymnast.")
    state = fit_state_to_landmarks(person, dict(zip(LANDMARKS, bodies[0], strict=True))).state
    dump_state(state, person, folder / "state.yaml", comment="Pose in the first field.")
    cameras = (
        replace(camera, interlaced="top_first", time_offset_ns=round(1e9 * exposure_s(camera.name, 0))) for camera in rig
    )
    described = rig_file_of(CameraRig(tuple(cameras))).with_cameras({name: {"source": name} for name in rig.names})
    write_rig_file(described, folder / "rig.yaml")


def _film(routine: DoubleSomersault, rig: CameraRig, scene: SceneConfig, folder: Path) -> None:
    """Images of cameras that expose at one time, every field with its own lines, chroma and noise."""
    subject, rng = routine.subject, np.random.default_rng([routine.seed, len(rig)])
    fields: list[list[np.ndarray]] = [[] for _ in rig]
    with Studio(rig, scene) as studio:
        for field in range(routine.n_fields):
            body = routine.pose(exposure_s(rig.names[0], field))
            mesh = ColoredMesh(body.vertices, subject.faces, subject.colors_rgb)
            for own, image in zip(fields, studio.images(mesh, field), strict=True):
                own.append(as_video(record(image[first_line(field % 2) :: 2], TAPE, rng)))
    for camera, own in zip(rig, fields, strict=True):
        (folder / camera.name).mkdir(exist_ok=True)
        for i, (earlier, later) in enumerate(zip(own[::2], own[1::2], strict=True)):
            cv2.imwrite(str(folder / camera.name / f"{i:06d}.png"), weave_fields(earlier, later))


def as_video(field: np.ndarray) -> np.ndarray:
    """A field (h, w, 3) uint8 BGR with a quarter of its chroma samples (4:2:0), as the decoder gives it back."""
    return cv2.cvtColor(cv2.cvtColor(np.ascontiguousarray(field), cv2.COLOR_BGR2YUV_I420), cv2.COLOR_YUV2BGR_I420)
