"""Turned and delayed cameras are named; the residuals come from projections of the body as it really is."""

from dataclasses import replace

import numpy as np
import pytest
from render_scenes import look_at
from small_clip import body

from tracker_node.camera.camera_model import CameraModel
from tracker_node.camera.camera_rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.normal_equations import CameraEquations, Comparison, NormalEquations
from tracker_node.tracking.camera_fault import DELAYED, TURNED, CameraFault
from tracker_node.tracking.self_check import SelfCheck

RATE_HZ, BEGIN_NS, SIGMA_PX = 30.0, 10**9, 1.0
MODEL = body()
LENS = CameraModel(640, 480, np.array([[560.0, 0.0, 319.5], [0.0, 560.0, 239.5], [0.0, 0.0, 1.0]]))


def ring(n: int) -> CameraRig:
    angles = 2.0 * np.pi * np.arange(n) / n
    eyes = [(2.5 * np.cos(a), 2.5 * np.sin(a), 0.8 + 0.3 * (i % 2)) for i, a in enumerate(angles)]
    return CameraRig(tuple(look_at(eye, (0.0, 0.0, 0.4), LENS, f"cam{i + 1:02d}") for i, eye in enumerate(eyes)))


def state_at(t: float) -> State:
    """Fast and never one way for long: hands at some 2 m/s."""
    turn = so3.exp(np.array([0.2 * np.sin(3.1 * t), 0.2 * np.sin(2.3 * t), 0.8 * np.sin(2.0 * t)]))
    place = np.array([0.25 * np.sin(2.7 * t), 0.2 * np.cos(3.3 * t), 0.4 + 0.1 * np.sin(4.1 * t)])
    joints = np.array([0.6 * np.sin(5.0 * t), -0.6 + 0.9 * np.sin(4.3 * t + 1.0), -1.0 + 0.9 * np.sin(6.1 * t)])
    return State(se3.from_rotation_translation(turn, place), joints)


def turned(camera: Camera, degrees: float, axis) -> Camera:
    """About its center, ``axis`` in its own frame."""
    T = camera.T_world_cam.copy()
    T[:3, :3] = T[:3, :3] @ so3.exp(np.radians(degrees) * np.asarray(axis) / np.linalg.norm(axis))
    return replace(camera, T_world_cam=T)


class World:
    """Cameras that see points of a moving body, each across one direction of its image, with noise.

    The tracker that is told of it minimizes over the state with the cameras of ``believed``.
    """

    def __init__(self, believed: CameraRig, seed: int = 3, n_points: int = 25):
        self.believed = believed
        self._rng = np.random.default_rng(seed)
        self._points = self._rng.uniform(-0.15, 0.15, (len(MODEL.chain.links), n_points, 3))

    def points(self, state: State) -> np.ndarray:
        T = Configuration(MODEL, state).Ts_world_link
        return np.einsum("lij,lnj->lni", T[:, :3, :3], self._points) + T[:, None, :3, 3]

    def step(self, check: SelfCheck, k: int, true: CameraRig, delays_s) -> tuple[CameraFault, ...]:
        t, n_links = k / RATE_HZ, len(MODEL.chain.links)
        directions = self._rng.normal(size=(len(true.cameras), *self._points.shape[:2], 2))
        directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
        noise = self._rng.normal(0.0, SIGMA_PX, directions.shape[:-1])
        seen = [camera.project(self.points(state_at(t - d)).reshape(-1, 3))[0] for camera, d in zip(true, delays_s, strict=True)]
        state = state_at(t)
        for last in (False, True):  # Gauss-Newton, and what is left at the end
            cameras, H, g = [], np.zeros((MODEL.n_dof, MODEL.n_dof)), np.zeros(MODEL.n_dof)
            configuration = Configuration(MODEL, state)
            points = self.points(state)
            A = MODEL.chain.link_moved_by[:, :, None] * configuration.twists  # (l, n_dof, 6)
            for i, camera in enumerate(self.believed):
                pixels = camera.project(points.reshape(-1, 3))[0]
                r = (np.einsum("nk,nk->n", directions[i].reshape(-1, 2), pixels - seen[i]) + noise[i].ravel()) / SIGMA_PX
                h = np.einsum("lnk,lnkj->lnj", directions[i], self._pixel_D_point(camera, points)) / SIGMA_PX
                W = np.concatenate([h, np.cross(points, h)], axis=-1)
                normal = np.einsum("lna,lnb->lab", W, W)
                gradient = np.einsum("lna,ln->la", W, r.reshape(n_links, -1))
                cameras.append(CameraEquations(normal, gradient))
                H += np.einsum("lda,lab,leb->de", A, normal, A)
                g += np.einsum("lda,la->d", A, gradient)
            if not last:
                state = state.retract(-np.linalg.solve(H, g))
        return check.add(BEGIN_NS + round(1e9 * t), Comparison(state, NormalEquations(H, g, 0.0, 1), cameras))

    @staticmethod
    def _pixel_D_point(camera: Camera, points: np.ndarray) -> np.ndarray:
        """(l, n, 2, 3) of a lens without distortion."""
        x, y, z = np.moveaxis(se3.apply(camera.T_cam_world, points.reshape(-1, 3)), -1, 0)
        zero, f = np.zeros_like(z), LENS.K[0, 0]
        J = f * np.stack([np.stack([1 / z, zero, -x / z**2], -1), np.stack([zero, 1 / z, -y / z**2], -1)], -2)
        return (J @ camera.T_cam_world[:3, :3]).reshape(*points.shape[:2], 2, 3)


def watch(rig: CameraRig, n_sets: int, onset: int, true: CameraRig | None = None, delays=None, end: int = 10**6):
    """Faults after each set; the rig is as believed, and images in time, before set ``onset`` and from ``end`` on."""
    world, check, none = World(rig), SelfCheck(rig, MODEL), (0.0,) * len(rig.cameras)
    told = []
    for k in range(n_sets):
        faulty = onset <= k < end
        told.append(world.step(check, k, true or rig if faulty else rig, delays or none if faulty else none))
    return told


def changed(rig: CameraRig, i: int, camera: Camera) -> CameraRig:
    return replace(rig, cameras=(*rig.cameras[:i], camera, *rig.cameras[i + 1 :]))


def kinds(faults) -> set[tuple[str, str]]:
    return {(fault.camera, fault.kind) for fault in faults}


def test_no_camera_is_blamed_for_noise():
    assert not any(watch(ring(4), 150, 0))


@pytest.mark.parametrize(("i", "axis"), [(0, (0, 1, 0)), (2, (1, 0, 0)), (3, (1, 1, 1))])
def test_a_turned_camera_is_named_within_seconds_and_nobody_else_is(i, axis):
    rig, onset = ring(5), 45
    told = watch(rig, onset + 90, onset, changed(rig, i, turned(rig.cameras[i], 1.0, axis)))
    name = rig.names[i]
    assert all(kinds(faults) <= {(name, TURNED)} and not any(fault.rivals for fault in faults) for faults in told)
    first = next(k for k, faults in enumerate(told) if faults)
    assert onset <= first < onset + 75
    (fault,) = told[-1]
    assert np.degrees(fault.size) == pytest.approx(1.0, abs=0.05)
    assert fault.since_ns == pytest.approx(BEGIN_NS + 1e9 * onset / RATE_HZ, abs=0.6e9)
    assert f"{name} is turned by 1.0 degrees" in fault.text


@pytest.mark.parametrize("images", [2.0, -1.5])
def test_a_delayed_camera_is_named_with_its_delay(images):
    rig, onset, delay_s = ring(4), 40, images / RATE_HZ
    told = watch(rig, onset + 90, onset, delays=(0.0, delay_s, 0.0, 0.0))
    assert all(kinds(faults) <= {("cam02", DELAYED)} for faults in told)
    (fault,) = told[-1]
    assert fault.size == pytest.approx(delay_s, abs=0.1 * abs(delay_s))
    assert ("late" if images > 0 else "early") in fault.text


def test_turned_and_delayed_at_once():
    rig = ring(5)
    told = watch(rig, 75, 0, changed(rig, 1, turned(rig.cameras[1], 1.5, (1, 0, 1))), (0.0, 0.08, 0.0, 0.0, 0.0))
    assert kinds(told[-1]) == {("cam02", TURNED), ("cam02", DELAYED)}


def test_two_faulty_cameras_of_five_are_both_named():
    rig = ring(5)
    true = changed(changed(rig, 0, turned(rig.cameras[0], 1.2, (1, 0, 0))), 3, turned(rig.cameras[3], -1.2, (0, 1, 0)))
    assert {fault.camera for fault in watch(rig, 75, 0, true)[-1]} == {"cam01", "cam04"}


def test_the_alarm_ends_with_the_fault():
    rig = ring(5)
    told = watch(rig, 150, 0, changed(rig, 2, turned(rig.cameras[2], 1.0, (1, 0, 0))), end=60)
    assert told[59] and not told[-1]


def test_cameras_that_face_each_other_are_named_together_for_a_turn_sideways():
    """A body near a point, seen sideways by two opposite cameras only: whichever has been turned shifts it by as much."""
    rig = ring(4)
    told = watch(rig, 75, 0, changed(rig, 0, turned(rig.cameras[0], 1.0, (0, 1, 0))))
    (fault,) = told[-1]
    assert {fault.camera, *fault.rivals} == {"cam01", "cam03"}
    assert fault.text.startswith(("cam01 or cam03 is turned", "cam03 or cam01 is turned"))


def test_two_cameras_disagree_and_nobody_knows_which_is_right():
    rig = ring(8).subset(("cam01", "cam03"))
    (fault,) = watch(rig, 75, 0, changed(rig, 1, turned(rig.cameras[1], 1.0, (1, 0, 0))))[-1]
    assert {fault.camera, *fault.rivals} == {"cam01", "cam03"}


def test_a_body_that_stands_still_says_nothing_of_delays():
    rig, still = ring(4), state_at(0.3)
    check, n = SelfCheck(rig, MODEL), MODEL.n_dof
    rng = np.random.default_rng(5)
    for k in range(90):
        cameras = [CameraEquations(np.tile(np.eye(6), (3, 1, 1)), rng.normal(size=(3, 6))) for _ in range(4)]
        fit = Comparison(still, NormalEquations(np.eye(n), np.zeros(n), 0.0, 1), cameras)
        assert not check.add(BEGIN_NS + round(1e9 * k / RATE_HZ), fit)


def test_what_comes_after_a_reset_is_looked_at_afresh():
    rig = ring(5)
    world, check = World(rig), SelfCheck(rig, MODEL)
    true, none = changed(rig, 2, turned(rig.cameras[2], 1.0, (1, 0, 0))), (0.0,) * 5
    for k in range(60):
        world.step(check, k, true, none)
    assert check.faults
    check.reset()
    assert not any(world.step(check, k, rig, none) for k in range(60))


def test_a_single_camera_contradicts_nobody():
    """Whatever it says, as where a prior pulls the body away from what it sees."""
    rig, rng = ring(3), np.random.default_rng(2)
    check, n = SelfCheck(rig, MODEL), MODEL.n_dof
    for k in range(90):
        camera = CameraEquations(np.tile(100.0 * np.eye(6), (3, 1, 1)), rng.normal(5.0, 0.1, (3, 6)))
        fit = Comparison(state_at(k / RATE_HZ), NormalEquations(1e6 * np.eye(n), np.zeros(n), 0.0, 1), [None, camera, None])
        assert not check.add(BEGIN_NS + round(1e9 * k / RATE_HZ), fit)
