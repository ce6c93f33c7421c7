"""Surfaces of parts as unknowns of lines: derivatives, the profile over the unknowns, what priors make of it."""

import numpy as np
import pytest

from helpers.bodies.bodies import crane
from helpers.cameras.camera_rigs import circle_rig
from helpers.numeric.finite_difference import numerical_jacobian
from test.objective.lines.test_correspondences import DISTANCE, FOCAL, at, disk, drawing_of
from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.lines import correspondence as kernel
from tracker_node.objective.lines import table
from tracker_node.objective.lines.correspondences import (
    CameraLines,
    LineCorrespondences,
    LineSums,
    _Drawn,
)
from tracker_node.objective.lines.surfaces import N_UNKNOWNS, Surfaces, SurfaceSums, shift_means, sum_surfaces
from tracker_node.objective.per_camera import camera_constants
from tracker_node.render.contour.samples import LINK, N_INFO_COLUMNS, SHAPE

MODEL, RIG = crane(), circle_rig(3)
N_SHAPES = len(MODEL.shapes)
STATE = State.neutral(MODEL).retract(np.array([0.1, 0.2, 1.0, 0.1, -0.2, 0.3, 0.3, -0.2, 0.5, 0.1][: MODEL.n_dof]))
SIGMA = np.array([0.02, 0.012, 0.01, 0.015])
MEANS = np.array([0.02, 0.01, -0.015, 0.005]) * np.array([[1.0], [0.5], [-1.0], [2.0], [0.1]])


def surfaces(sigma=SIGMA, means=MEANS) -> Surfaces:
    return Surfaces(means, np.tile(np.diag(np.broadcast_to(sigma, 4) ** 2), (N_SHAPES, 1, 1)))


def options(robust: float = 1e6, model_sigma_px: float = 0.7, correlation: float = 3.0) -> np.ndarray:
    packed = np.zeros(kernel.N_OPTIONS)
    packed[kernel.ROBUST], packed[kernel.MODEL_VARIANCE], packed[kernel.CORRELATION] = robust, model_sigma_px**2, correlation
    return packed


def invented(
    camera: int, state: State = STATE, n: int = 60, seed: int = 0, spread_px: float = 2.0
) -> tuple[np.ndarray, np.ndarray]:
    """Lines of points anywhere on the crane's parts, with normals, means and precisions drawn by chance."""
    rng = np.random.default_rng([0, camera])
    body = Configuration(MODEL, STATE)
    lines, info = np.zeros((n, table.N_LINE_COLUMNS)), np.zeros((n, N_INFO_COLUMNS), np.int32)
    shapes = rng.integers(0, N_SHAPES, n)
    info[:, SHAPE], info[:, LINK] = shapes, MODEL.shape_links[shapes]
    lines[:, table.POINT : table.POINT + 3] = rng.uniform(-0.2, 0.2, (n, 3))
    T = body.Ts_world_link[info[:, LINK]]
    places = np.einsum("nij,nj->ni", T[:, :3, :3], lines[:, :3]) + T[:, :3, 3]
    lines[:, [table.LINE_U, table.LINE_V]] = RIG.cameras[camera].project(places)[0]
    angles = rng.uniform(-np.pi, np.pi, n)
    lines[:, table.LINE_NU], lines[:, table.LINE_NV] = np.cos(angles), np.sin(angles)
    lines[:, table.MEAN], lines[:, table.PRECISION] = spread_px * rng.normal(size=n), rng.uniform(0.2, 4.0, n)
    lines[rng.choice(n, n // 6, replace=False), table.PRECISION] = 0.0  # those say nothing
    return lines, info


def correspondences(
    known: Surfaces | None, packed: np.ndarray | None = None, offsets=(None, None, None), **more
) -> LineCorrespondences:
    """Of all cameras but the second, drawn at `STATE`."""
    drawn = []
    for i, camera in enumerate(RIG):
        if i == 1:
            drawn.append(None)
            continue
        lines, info = invented(i, **more)
        if known is not None:
            body = Configuration(MODEL, STATE)
            shift_means(lines, info, len(lines), body.Ts_world_link, camera_constants(camera), known.means)
        drawn.append(CameraLines(lines, info, camera_constants(camera)))
    fixed = _Drawn(MODEL, tuple(drawn), options() if packed is None else packed, (None,) * len(RIG), known)
    return LineCorrespondences(fixed, LineSums.empty(State.neutral(MODEL), [], 0))  # that state is never asked for


def rows_by_hand(state: State, known: Surfaces) -> list[tuple[int, float, float, np.ndarray, np.ndarray]]:
    """Of each line: its part, residual at the surface expected, weight, derivatives by the unknowns and by the state."""
    found = []
    for i in (0, 2):
        camera, (lines, info) = RIG.cameras[i], invented(i)
        drawn_at, body = Configuration(MODEL, STATE), Configuration(MODEL, state)
        for line, (shape, link) in zip(lines, info[:, [SHAPE, LINK]], strict=True):
            if line[table.PRECISION] <= 0.0:
                continue
            normal = line[[table.LINE_NU, table.LINE_NV]]

            def along(where: Configuration, y: np.ndarray, line=line, link=link, camera=camera, normal=normal) -> float:
                """Pixels along the normal of a point that lies outside, and beside, its place on the part."""
                T = where.Ts_world_link[link]
                place = T[:3, :3] @ (line[:3] + y[1:]) + T[:3, 3]
                depth = camera.T_cam_world[2] @ [*(T[:3, :3] @ line[:3] + T[:3, 3]), 1.0]
                focal = np.sqrt(camera.model.K[0, 0] * camera.model.K[1, 1])
                return float(normal @ camera.project(place[None])[0][0]) + focal / depth * y[0]

            first = numerical_jacobian(lambda y, along=along, at=drawn_at: np.array(along(at, y)), 4, 1e-5)
            a = numerical_jacobian(lambda y, along=along, at=body: np.array(along(at, y)), 4, 1e-5)
            G = numerical_jacobian(
                lambda d, along=along: np.array(along(Configuration(MODEL, state.retract(d)), np.zeros(4))), MODEL.n_dof, 1e-5
            )
            r = (
                along(body, np.zeros(4))
                - normal @ line[[table.LINE_U, table.LINE_V]]
                - line[table.MEAN]
                + first @ known.means[shape]
            )
            w = 1.0 / (1.0 / line[table.PRECISION] + 0.7**2) / 3.0
            found.append((int(shape), r, w, a, G))
    return found


@pytest.fixture(scope="module")
def near() -> State:
    return STATE.retract(0.004 * np.random.default_rng(2).normal(size=MODEL.n_dof))


def profile(rows, known: Surfaces, shift: np.ndarray | None = None) -> float:
    """The least over all unknowns y of the sum of w (r + a (y - m) [+ G d])^2 and of the priors."""
    cost = 0.0
    for shape in range(N_SHAPES):
        own = [(r if shift is None else r + G @ shift, w, a) for s, r, w, a, G in rows if s == shape]
        A = np.array([np.sqrt(w) * a for _, w, a in own] + list(np.linalg.cholesky(known.priors[shape]).T))
        b = np.array([np.sqrt(w) * r for r, w, _ in own] + [0.0] * 4)
        y, *_ = np.linalg.lstsq(A, -b, rcond=None)
        cost += float(((A @ y + b) ** 2).sum())
    return cost


def test_the_cost_is_the_least_over_all_surfaces(near):
    known = surfaces()
    found, rows = correspondences(known).linearize(near), rows_by_hand(near, known)
    assert found.cost == pytest.approx(profile(rows, known), rel=1e-5)
    assert found.count == len(rows) == 100
    assert found.cost < sum(w * r * r for _, r, w, _, _ in rows) - 1.0


def test_equations_are_those_of_the_profile(near):
    """The least over the surfaces of linear lines is a parabola of the state: its slope and curvature are exact."""
    known = surfaces()
    found, rows = correspondences(known).linearize(near), rows_by_hand(near, known)
    n = MODEL.n_dof
    slope = numerical_jacobian(lambda d: np.array(profile(rows, known, d)), n, 1e-4)
    np.testing.assert_allclose(2.0 * found.g, slope, atol=1e-4 * np.abs(slope).max())
    zero, alone = profile(rows, known), [profile(rows, known, a) for a in np.eye(n)]
    curvature = np.array([
        [profile(rows, known, a + b) - alone[i] - alone[j] + zero for j, b in enumerate(np.eye(n))]
        for i, a in enumerate(np.eye(n))
    ])  # fmt: skip
    np.testing.assert_allclose(2.0 * found.H, curvature, atol=1e-4 * np.abs(curvature).max())


def test_the_gradient_is_that_of_the_cost(near):
    """By differences of the cost, where the lines are straight enough: a part's own derivatives hardly change."""
    made = correspondences(surfaces())
    slope = numerical_jacobian(lambda d: np.array(made.linearize(near.retract(d)).cost), MODEL.n_dof, 1e-5)
    g = made.linearize(near).g
    assert np.abs(2.0 * g - slope).max() < 0.03 * np.abs(slope).max()


def test_what_is_known_of_surfaces_moves_their_lines():
    """A line's mean is where the contour is beside the shape's: less what the surface is expected to be outside of it."""
    known = surfaces()
    for i in (0, 2):
        lines, info = invented(i)
        before = lines[:, table.MEAN].copy()
        body = Configuration(MODEL, STATE)
        shift_means(lines, info, 40, body.Ts_world_link, camera_constants(RIG.cameras[i]), known.means)
        np.testing.assert_array_equal(lines[40:, table.MEAN], before[40:])
        for j in range(40):
            T, (link, shape) = body.Ts_world_link[info[j, LINK]], info[j, [LINK, SHAPE]]
            d, *o = MEANS[shape]
            place = T[:3, :3] @ lines[j, :3] + T[:3, 3]
            depth = RIG.cameras[i].T_cam_world[2] @ [*place, 1.0]
            there = RIG.cameras[i].project((place + 1e-3 * T[:3, :3] @ o)[None])[0][0]
            normal = lines[j, [table.LINE_NU, table.LINE_NV]]
            moved = 1e3 * normal @ (there - RIG.cameras[i].project(place[None])[0][0]) + np.sqrt(600.0 * 605.0) / depth * d
            assert before[j] - lines[j, table.MEAN] == pytest.approx(moved, abs=0.01)
            assert link == MODEL.shape_links[shape]


def test_surfaces_that_are_known_change_nothing(near):
    tight = surfaces(1e-7, np.zeros((N_SHAPES, 4)))
    free, known = correspondences(None).linearize(near), correspondences(tight).linearize(near)
    assert correspondences(None).at(near).surfaces is None
    np.testing.assert_allclose(known.H, free.H, rtol=1e-6, atol=1e-6 * np.abs(free.H).max())
    np.testing.assert_allclose(known.g, free.g, atol=1e-6 * np.abs(free.g).max())
    assert known.cost == pytest.approx(free.cost, rel=1e-6)


def test_the_less_is_known_of_surfaces_the_less_lines_say(near):
    before = correspondences(None).linearize(near).H
    for sigma in (0.001, 0.01, 0.1, 1.0):
        H = correspondences(surfaces(sigma)).linearize(near).H
        np.testing.assert_allclose(H, H.T, atol=1e-9 * np.abs(H).max())
        assert np.linalg.eigvalsh(H)[0] > -1e-6 * np.abs(H).max()
        assert np.linalg.eigvalsh(before - H)[0] > -1e-6 * np.abs(before).max() and np.trace(H) < np.trace(before)
        before = H


def test_robust_weights_are_those_of_the_lines():
    """Lines that count less for their residuals count less for the surfaces, too."""
    packed = options(robust=1.5)
    made = correspondences(surfaces(), packed, spread_px=6.0)
    sums = made.at(STATE).surfaces
    H, b = np.zeros((N_SHAPES, 4, 4)), np.zeros((N_SHAPES, 4))
    for i in (0, 2):
        own = made.cameras[i]
        residuals = made.at(STATE).residuals[i]
        for j, line in enumerate(own.lines):
            if line[table.PRECISION] > 0.0:
                one = CameraLines(own.lines[j : j + 1], own.info[j : j + 1], own.camera)
                alone = _sums_of(one, i, options(model_sigma_px=0.7, correlation=3.0))
                precision = 1.0 / (1.0 / line[table.PRECISION] + 0.7**2)
                share = (1.5**2 / (1.5**2 + residuals[j] ** 2 * precision)) ** 2
                H += share * alone[0]
                b += share * alone[1]
    np.testing.assert_allclose(sums.H, H, rtol=1e-6)
    np.testing.assert_allclose(sums.b, b, atol=1e-6 * np.abs(b).max())


def _sums_of(own: CameraLines, i: int, packed: np.ndarray) -> tuple[np.ndarray, ...]:
    out = np.zeros((N_SHAPES, 4, 4)), np.zeros((N_SHAPES, 4)), np.zeros((N_SHAPES, 6, 4))
    sum_surfaces(
        own.lines, own.info, len(own.lines), Configuration(MODEL, STATE).Ts_world_link, own.camera, packed[kernel.ROBUST] ** 2,
        packed[kernel.MODEL_VARIANCE], 1.0 / packed[kernel.CORRELATION], *out,
    )  # fmt: skip
    return out


def test_sums_of_links_are_those_of_their_parts():
    rng = np.random.default_rng(1)
    half = rng.normal(size=(3, 4, 4))
    priors, H = half @ np.swapaxes(half, 1, 2) + np.eye(4), np.tile(np.diag([1.0, 2.0, 3.0, 4.0]), (3, 1, 1))
    b, C = rng.normal(size=(3, 4)), rng.normal(size=(3, 6, 4))
    sums = SurfaceSums(H, b, C, priors, np.array([2, 0, 2]))
    for k in range(3):
        np.testing.assert_allclose(sums.covariances[k] @ (H[k] + priors[k]), np.eye(4), atol=1e-9)
    lost, pulls = sums.of_links(4), sums.pulls(4)
    own = [C[k] @ sums.covariances[k] @ C[k].T for k in range(3)]
    np.testing.assert_allclose(lost, [own[1], np.zeros((6, 6)), own[0] + own[2], np.zeros((6, 6))])
    pull = [C[k] @ sums.covariances[k] @ b[k] for k in range(3)]
    np.testing.assert_allclose(pulls, [pull[1], np.zeros(6), pull[0] + pull[2], np.zeros(6)])
    assert sums.cost == pytest.approx(sum(b[k] @ sums.covariances[k] @ b[k] for k in range(3)))
    between = rng.normal(size=(3, 4, 4))
    np.testing.assert_allclose(sums.of_links(4, between)[0], C[1] @ between[1] @ C[1].T)


def ball_lines(known: Surfaces | None, radius: float = 0.25, state: State | None = None) -> LineCorrespondences:
    """A picture of a ball of 0.25 m straight ahead, compared with one of this radius."""
    image, radius_px = disk(0.25)
    drawing = drawing_of(radius, image, radius_px=radius_px, samples_per_line=40)
    return drawing.drawer.draw([drawing.view], state or at(), 1.0, 0.5, None, known)


def of_ball(sigmas, means=(0.0,) * N_UNKNOWNS) -> Surfaces:
    return Surfaces(np.array([means]), np.diag(np.array(sigmas) ** 2)[None])


def test_a_ball_in_clothes_is_as_far_away_as_its_thickness_is_known():
    """A model that is 1 cm too small seems nearer; with the cloth known it is in its place, with it unknown nobody knows."""
    thin = 0.24
    bare, dressed = ball_lines(None, thin), ball_lines(of_ball([1e-6] * 4, [0.01, 0.0, 0.0, 0.0]), thin)
    closer = [made.linearize(at()).g[2] / made.linearize(at()).H[2, 2] for made in (bare, dressed)]
    assert closer[0] > 0.05 and abs(closer[1]) < 0.1 * closer[0]  # by Gauss-Newton: toward the camera is -z
    unknown = ball_lines(of_ball([0.02, 1e-6, 1e-6, 1e-6]), thin)
    assert unknown.linearize(at()).H[2, 2] < 0.05 * bare.linearize(at()).H[2, 2]
    assert unknown.linearize(at()).H[0, 0] == pytest.approx(bare.linearize(at()).H[0, 0], rel=0.05)  # across, both sides tell


def test_one_side_of_a_ball_says_little_where_its_surface_is_not_known():
    """More than half of the ball is beyond the image: what is seen may as well be thicker cloth."""
    x = 0.8
    image, radius_px = disk(0.25)
    drawing = drawing_of(0.25, np.roll(image, round(x * FOCAL / DISTANCE), axis=1), (x * FOCAL / DISTANCE, 0.0), radius_px)
    shares = []
    for state in (at(), at(x=x)):
        H = [
            drawing.drawer.draw([drawing.view], state, 1.0, 0.5, None, known).linearize(state).H[0, 0]
            for known in (of_ball([1e-6] * 4), of_ball([0.05, 1e-6, 1e-6, 1e-6]))
        ]
        shares.append(H[1] / H[0])
    assert shares[0] > 0.95 and shares[1] < 0.3


def test_a_shift_that_is_not_known_leaves_where_the_part_is_unknown():
    """What the lines say of its place is then (A^-1 + s^2)^-1."""
    free, loose = ball_lines(None).linearize(at()).H[0, 0], ball_lines(of_ball([1e-6, 0.03, 1e-6, 1e-6])).linearize(at()).H[0, 0]
    assert loose == pytest.approx(1.0 / (1.0 / free + 0.03**2), rel=1e-3)


def test_lines_are_drawn_about_surfaces_that_are_expected_outside():
    """A centimeter of cloth, two meters away: contours are 1.5 pixels nearer to what is expected."""
    bare, dressed = (ball_lines(known, 0.24).cameras[0].lines for known in (None, of_ball([0.01] * 4, [0.01, 0.0, 0.0, 0.0])))
    nearer = bare[:, table.MEAN] - dressed[:, table.MEAN]
    np.testing.assert_allclose(nearer, 0.01 * FOCAL / DISTANCE, rtol=0.02)
    np.testing.assert_array_equal(np.delete(bare, table.MEAN, axis=1), np.delete(dressed, table.MEAN, axis=1))


def test_points_behind_a_camera_say_nothing():
    camera = RIG.cameras[0]
    lines, info = invented(0)
    behind = STATE.retract(np.concatenate([2.5 * (camera.center - STATE.T_world_root[:3, 3]), np.zeros(MODEL.n_dof - 3)]))
    before = lines.copy()
    T = Configuration(MODEL, behind).Ts_world_link
    shift_means(lines, info, len(lines), T, camera_constants(camera), MEANS)
    np.testing.assert_array_equal(lines, before)
    out = np.zeros((N_SHAPES, 4, 4)), np.zeros((N_SHAPES, 4)), np.zeros((N_SHAPES, 6, 4))
    sum_surfaces(lines, info, len(lines), T, camera_constants(camera), 9.0, 0.25, 1.0, *out)
    assert not any(array.any() for array in out)
