"""Turned and delayed cameras are named; the residuals come from projections of the body as it really is."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.cameras.render_scenes import look_at
from helpers.cameras.small_clip import body
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.geometry import se3, so3
from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.normal_equations import CameraEquations, Comparison, NormalEquations
from tracker_node.tracking.cameras.self_check import SelfCheck, SelfCheckOptions, _Block, _Fit, _regular, _turn_twists
from tracker_node.tracking.estimate import DELAYED, TURNED, CameraFault

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


def test_a_turned_camera_turns_about_its_center():
    """The twist at a point p is w x (p - c), w an axis of the camera."""
    T = se3.from_rotation_translation(so3.exp(np.array([0.4, -0.7, 1.1])), np.array([1.0, -2.0, 0.5]))
    twists, point = _turn_twists(T), np.array([0.3, 0.9, -0.4])
    for k in range(3):
        v, w = twists[:3, k], twists[3:, k]
        np.testing.assert_allclose(w, T[:3, k])
        np.testing.assert_allclose(v + np.cross(w, point), np.cross(T[:3, k], point - T[:3, 3]), atol=1e-12)


def test_faults_are_what_remains_when_the_state_is_free():
    """Against least squares over all rows: the part of the faults' columns that no motion of the body makes up for."""
    rig, rng = ring(3), np.random.default_rng(4)
    check, state, velocity = SelfCheck(rig, MODEL), state_at(0.7), rng.normal(size=MODEL.n_dof)
    moved, twists = MODEL.chain.link_moved_by, Configuration(MODEL, state).twists
    n_links, of_state, of_faults, residuals, cameras = len(moved), [], [], [], []
    for i in range(3):
        if i == 1:
            cameras.append(None)
            continue
        normal, gradient = np.zeros((n_links, 6, 6)), np.zeros((n_links, 6))
        for link in range(n_links):
            W, r = rng.normal(size=(8, 6)), rng.normal(size=8)
            normal[link], gradient[link] = W.T @ W, W.T @ r
            column = np.zeros((8, 12))
            column[:, 4 * i : 4 * i + 3] = W @ _turn_twists(rig.cameras[i].T_world_cam)
            column[:, 4 * i + 3] = -W @ ((moved[link] * velocity) @ twists)
            of_faults.append(column)
            of_state.append(W @ (moved[link][:, None] * twists).T)
            residuals.append(r)
        cameras.append(CameraEquations(normal, gradient))
    A, B, r = np.vstack(of_state), np.vstack(of_faults), np.concatenate(residuals)
    L, e = check._marginal(Comparison(state, NormalEquations(A.T @ A, A.T @ r, 0.0, 1), cameras), velocity)
    free = np.eye(len(A)) - A @ np.linalg.pinv(A)
    np.testing.assert_allclose(L, B.T @ free @ B, atol=1e-6)
    np.testing.assert_allclose(e, B.T @ free @ r, atol=1e-6)


def found(values, sigmas, chosen=(0, 1, 2, 3)) -> list[CameraFault]:
    """What is said of the second camera's fault with these values and standard deviations."""
    check = SelfCheck(ring(3), MODEL, SelfCheckOptions(angle_rad=0.01, delay_s=0.02, sigmas=5.0))
    check._blocks.append(_Block(77, np.zeros((12, 12)), np.zeros(12)))
    chosen = tuple(4 + k for k in chosen)
    fit = _Fit(1, chosen, np.array(values, dtype=float), np.diag(np.square(sigmas)), 100.0, 1.0, 4)
    return check._faults_of(fit, ("cam03",))


def test_a_fault_must_be_larger_than_it_matters_and_than_it_is_uncertain():
    small = 1e-4
    (turn,) = found([0.006, -0.0081, 0.0], [small] * 3, (0, 1, 2))  # 0.0101 in all
    assert (turn.camera, turn.kind, turn.rivals, turn.since_ns) == ("cam02", TURNED, ("cam03",), 77)
    assert turn.size == pytest.approx(np.hypot(0.006, 0.0081)) and turn.sigma == pytest.approx(small)
    assert found([0.006, -0.0079, 0.0], [small] * 3, (0, 1, 2)) == []
    assert found([0.0, 0.03], [1.0, 0.0061], (0, 1)) == []  # 4.9 standard deviations
    assert [fault.kind for fault in found([0.0, 0.03], [1.0, 0.0059], (0, 1))] == [TURNED]
    assert found([-0.021], [small], (3,))[0].size == -0.021 and found([-0.021], [small], (3,))[0].kind == DELAYED
    assert found([0.019], [small], (3,)) == [] and found([0.1], [0.0201], (3,)) == []
    assert found([0.1], [0.0199], (3,))[0].sigma == pytest.approx(0.0199)
    assert [f.kind for f in found([0.05, 0.0, 0.0, 0.1], [small] * 4)] == [TURNED, DELAYED]


def test_a_fault_begins_with_the_latest_blocks_that_it_explains():
    """phi.L.phi + 2 e.phi is negative where the fault phi explains more than it costs."""
    check = SelfCheck(ring(3), MODEL)
    for begin_ns, e in ((10, -9.0), (20, 9.0), (30, -2.0), (40, -9.0)):
        check._blocks.append(_Block(begin_ns, 3.0 * np.eye(12), np.full(12, e)))
    assert check._onset(_Fit(0, (3,), np.array([1.0]), np.eye(1), 1.0, 1.0, 4)) == 30  # 3 - 4 < 0 < 3 + 18
    assert check._onset(_Fit(0, (3,), np.array([2.0]), np.eye(1), 1.0, 1.0, 4)) == 40  # 12 - 8 > 0


def test_a_fault_that_goes_on_began_when_it_was_first_seen():
    check = SelfCheck(ring(3), MODEL)
    fault = CameraFault("cam02", DELAYED, 0.1, 0.01, 500, ())
    check._faults = (replace(fault, kind=TURNED, since_ns=1), replace(fault, camera="cam01", since_ns=2))
    assert check._remembered(fault).since_ns == 500
    check._faults += (replace(fault, since_ns=300),)
    assert check._remembered(fault) == replace(fault, since_ns=300)
    assert check._remembered(replace(fault, since_ns=200)).since_ns == 200


def test_a_set_that_is_not_believed_gives_no_velocity():
    """Three sets in a row are needed for that of the middle one."""
    rig = ring(3)

    def blocks(skipped: int | None, n: int = 3) -> int:
        world, check = World(rig), SelfCheck(rig, MODEL)
        for k in range(n):
            if k == skipped:
                check.skip()
            world.step(check, k, rig, (0.0,) * 3)
        return len(check._blocks)

    assert [blocks(None), blocks(1), blocks(2), blocks(None, 2)] == [1, 0, 0, 0]
    assert blocks(2, 5) == 1


def test_sets_are_summed_over_an_eighth_of_the_window():
    check = SelfCheck(ring(3), MODEL, SelfCheckOptions(window_s=0.8))
    for stamp_ns in (0, 99_999_999, 100_000_000, 150_000_000, 230_000_000):
        check._add_to_block(stamp_ns, np.eye(12), np.ones(12))
    assert [block.begin_ns for block in check._blocks] == [0, 100_000_000, 230_000_000]
    assert [block.L[0, 0] for block in check._blocks] == [2.0, 2.0, 1.0]
    assert [block.e[5] for block in check._blocks] == [2.0, 2.0, 1.0]


def test_a_degree_of_freedom_that_no_image_tells_of_is_no_obstacle():
    rig, n = ring(3), MODEL.n_dof
    H = np.eye(n)
    H[-1, -1] = 0.0
    nothing = [CameraEquations(np.zeros((3, 6, 6)), np.zeros((3, 6))) for _ in range(3)]
    fit = Comparison(state_at(0.1), NormalEquations(H, np.zeros(n), 0.0, 1), nothing)
    L, e = SelfCheck(rig, MODEL)._marginal(fit, np.ones(n))
    assert not L.any() and not e.any()


def test_what_is_told_of_a_fault_is_never_less_than_nothing():
    """Turns and delays have other units; a direction of negative information is one of which nothing is known."""
    axes = np.linalg.qr(np.random.default_rng(5).normal(size=(4, 4)))[0]
    scale = np.array([1e4, 1e4, 1e4, 3.0])
    for least in (0.2, -0.1):
        A = (axes * [1.0, 0.7, 0.4, least]) @ axes.T * np.outer(scale, scale)
        made = _regular(A)
        assert np.linalg.eigvalsh(made)[0] > 0.0 and (np.linalg.inv(made).diagonal() > 0.0).all()
        assert np.allclose(made, A, rtol=1e-9) == (least > 0.0)
    for A in (np.zeros((4, 4)), -np.eye(4), np.array([[-1e3, 1e4], [1e4, 2.0]]), np.array([[0.0, 1e4], [1e4, 1e8]])):
        assert np.isfinite(np.linalg.inv(_regular(A))).all() and (np.linalg.inv(_regular(A)).diagonal() > 0.0).all()
