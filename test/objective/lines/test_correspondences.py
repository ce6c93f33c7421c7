"""Correspondence lines against pictures whose edges are known in closed form: a disk is what a sphere ahead of a camera shows."""

from dataclasses import dataclass

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid
from tracker_node.objective.lines import table
from tracker_node.objective.lines.correspondences import LineCorrespondences, LineDrawer, LineOptions, View
from tracker_node.observation.region.background import RegionBackground
from tracker_node.observation.region.colors import RegionColors, color_classes, stated_densities, trust_stated_colors
from tracker_node.optimize.levenberg_marquardt import LevenbergMarquardtOptions, minimize
from tracker_node.render.shape_arrays import ShapeArrays

WIDTH, HEIGHT, FOCAL, DISTANCE = 200, 160, 300.0, 2.0
CENTER = np.array([99.5, 79.5])
BODY_BGR, SCENE_BGR = np.array([60, 90, 200]), np.array([180, 160, 90])
K = np.array([[FOCAL, 0.0, CENTER[0]], [0.0, FOCAL, CENTER[1]], [0.0, 0.0, 1.0]])


def ball(radius):
    chain = KinematicChain(("ball",), ())
    color = tuple(int(c) for c in BODY_BGR[::-1])
    return ArticulatedModel("ball", chain, (Shape("ball", "ball", Ellipsoid((radius,) * 3), color_rgb=color),))


def rig():
    return CameraRig((Camera("cam", CameraModel(WIDTH, HEIGHT, K), np.eye(4)),))


def at(x=0.0, y=0.0, z=DISTANCE):
    pose = np.eye(4)
    pose[:3, 3] = x, y, z
    return State(pose, np.zeros(0))


def disk(radius, noise=4.0, seed=0):
    """The image of a sphere straight ahead: a disk of radius f r / sqrt(d^2 - r^2), with soft borders and noise."""
    radius_px = FOCAL * radius / np.sqrt(DISTANCE**2 - radius**2)
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    share = np.clip(radius_px - np.hypot(u - CENTER[0], v - CENTER[1]) + 0.5, 0.0, 1.0)[..., None]
    image = share * BODY_BGR + (1.0 - share) * SCENE_BGR + np.random.default_rng(seed).normal(0.0, noise, (HEIGHT, WIDTH, 3))
    return np.clip(np.rint(image), 0, 255).astype(np.uint8), radius_px


@dataclass
class Drawing:
    """Lines of a ball in one image."""

    model: ArticulatedModel
    classes: np.ndarray
    options: LineOptions
    view: View

    def __post_init__(self):
        self.arrays = ShapeArrays.from_model(self.model)
        self.drawer = LineDrawer(rig(), self.model, self.arrays, self.classes, self.options)

    def draw(self, state: State, scale: float, model_sigma_px: float = 0.5, view: View | None = None) -> LineCorrespondences:
        return self.drawer.draw([view or self.view], state, scale, model_sigma_px)


def drawing_of(radius, image, learnt_at=(0.0, 0.0), radius_px=None, **options) -> Drawing:
    model = ball(radius)
    classes = color_classes(model)
    colors = RegionColors(classes, stated_densities(model, classes), 0.3)
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    inside = np.hypot(u - CENTER[0] - learnt_at[0], v - CENTER[1] - learnt_at[1]) < radius_px
    sound = np.ones(1, dtype=np.bool_)
    colors.learn(image, (0, 0, WIDTH, HEIGHT), inside.astype(np.uint8), 1.0, 3, 40, sound)
    return Drawing(model, classes, LineOptions(**options), View(image, (colors.body, colors.scene)))


@pytest.mark.parametrize("off_px", [-6.0, 0.3, 6.0])
def test_a_line_finds_how_far_its_contour_is(off_px):
    image, radius_px = disk(0.25)
    drawing = drawing_of(0.25, image, radius_px=radius_px, samples_per_line=40)
    lines = drawing.draw(at(x=off_px * DISTANCE / FOCAL), 1.0).cameras[0].lines
    normals = lines[:, table.LINE_NU : table.LINE_NV + 1]
    from_center = lines[:, table.LINE_U : table.LINE_V + 1] - CENTER
    # The circle along the ray from the sample: |p + t n| = R
    along = (from_center * normals).sum(axis=1)
    wanted = -along + np.sqrt(along**2 - (from_center**2).sum(axis=1) + radius_px**2)
    told = lines[:, table.PRECISION] > 1.0
    assert told.mean() > 0.9
    error = lines[told, table.MEAN] - wanted[told]
    assert abs(error.mean()) < 0.05
    assert error.std() < 0.25


def test_gradient_is_that_of_the_cost():
    image, radius_px = disk(0.25)
    lines = drawing_of(0.25, image, radius_px=radius_px, robust_sigmas=2.0).draw(at(x=0.01), 2.0)
    state, step = at(x=0.013, y=-0.004, z=DISTANCE + 0.01), 1e-6
    g = lines.linearize(state).g

    def cost(i, size):
        return lines.linearize(state.retract(size * np.eye(6)[i])).cost

    slope = np.array([(cost(i, step) - cost(i, -step)) / (4.0 * step) for i in range(3)])
    # The robust weights are held: g has the slope's direction, and more than its size where residuals are large
    assert g[:3] @ slope > 0.95 * np.linalg.norm(g[:3]) * np.linalg.norm(slope)


def test_coarse_to_fine_lines_lead_home_and_tell_how_surely():
    image, radius_px = disk(0.25, noise=4.0)
    drawing = drawing_of(0.25, image, (6.0, 2.0), radius_px, samples_per_line=40)
    state = at(x=0.08, y=-0.05, z=DISTANCE + 0.10)
    result = None
    for scale in (4.0, 4.0, 2.0, 1.0, 1.0):
        lines = drawing.draw(state, scale, 1.0)
        result = minimize(lines, state, drawing.model.chain, LevenbergMarquardtOptions(max_iterations=3))
        state = result.state
    error = state.T_world_root[:3, 3] - [0.0, 0.0, DISTANCE]
    assert np.abs(error[:2]).max() < 0.1 * DISTANCE / FOCAL  # a tenth of a pixel
    assert abs(error[2]) < 0.1 * DISTANCE / radius_px
    information = result.equations.H
    assert information[3:6, 3:6].max() < 1e-6 * information[0, 0]  # no contour tells how a ball is turned
    assert information[0, 0] > 20.0 * information[2, 2]


def test_a_part_that_is_narrower_than_its_line_is_found_as_a_whole():
    radius = 0.03
    image, radius_px = disk(radius)
    assert radius_px < 5.0
    drawing = drawing_of(radius, image, radius_px=radius_px, half_length=8)
    off_px = 11.0  # more than twice its own width
    lines = drawing.draw(at(x=off_px * DISTANCE / FOCAL), 2.0).cameras[0].lines
    across = np.abs(lines[:, table.LINE_NU]) > 0.95  # lines that run through the ball
    shifts = lines[across, table.MEAN] * lines[across, table.LINE_NU]
    assert across.sum() >= 4
    np.testing.assert_allclose(shifts, -off_px, atol=2.0)  # one place of the line


def test_evidence_tells_a_ball_that_is_there_from_one_that_is_not():
    image, radius_px = disk(0.25)
    shares = []
    for x in (0.0, 0.45):
        lines = drawing_of(0.25, image, radius_px=radius_px).draw(at(x=x), 1.0)
        evidence = lines.at(at(x=x)).part_evidence(2.5)
        shares.append(float(evidence.close.sum() / evidence.expected.sum()))
        assert np.all(evidence.found <= evidence.expected)
        assert np.all(evidence.close <= evidence.found)
    assert shares[0] > 0.9
    assert shares[1] < 0.3


def test_lines_over_bars_of_the_balls_color_are_told_from_those_of_a_ball_that_is_not_there():
    image, radius_px = disk(0.25)
    bars = image.copy()
    for row in range(0, len(image), 40):
        bars[row : row + 20] = image[int(len(image) / 2), int(image.shape[1] / 2)]
    found = []
    for shown, x in ((image, 0.0), (bars, 0.0), (image, 0.45)):
        lines = drawing_of(0.25, shown, radius_px=radius_px).draw(at(x=x), 1.0)
        evidence = lines.at(at(x=x)).part_evidence(2.5)
        found.append((evidence.close.sum() / evidence.expected.sum(), evidence.filled.sum() / evidence.expected.sum()))
    (close, filled), (barred_close, barred_filled), (away_close, away_filled) = found
    assert close > 0.9 and filled < 0.05
    assert 0.2 < barred_filled < 0.8 and barred_close > 0.9 * (1.0 - barred_filled) - 0.15
    assert away_close < 0.3 and away_filled < 0.3  # where it reaches over the ball


def test_the_spread_beyond_the_lines_own_is_that_of_a_wrong_model():
    image, radius_px = disk(0.25)
    spreads = []
    for radius in (0.25, 0.25 * (1.0 + 3.0 / radius_px)):
        spreads.append(drawing_of(radius, image, radius_px=radius_px).draw(at(), 1.0).at(at()).spread_px)
    assert spreads[0] < 0.3
    assert spreads[1] == pytest.approx(1.4826 * 3.0, abs=0.6)  # all of them are three pixels off


def test_a_known_room_of_the_bodys_color_still_shows_the_body():
    """A body before a wall that resembles it: histograms cannot tell them apart, what the pixels showed before can."""
    image, radius_px = disk(0.25, noise=2.0)
    wall = np.tile((BODY_BGR + np.array([11, -11, -12])).astype(np.float32), (HEIGHT, WIDTH, 1))
    share = np.all(np.abs(image.astype(int) - BODY_BGR) < 40, axis=2)[..., None]
    noise = np.random.default_rng(1).normal(0.0, 2.0, wall.shape)
    image = np.clip(np.where(share, BODY_BGR + noise, wall + noise), 0, 255).astype(np.uint8)
    errors = []
    for known in (False, True):
        drawing = drawing_of(0.25, image, (8.0, 0.0), radius_px, samples_per_line=40)
        if known:
            plate = np.clip(wall + np.random.default_rng(2).normal(0.0, 2.0, wall.shape), 0, 255).astype(np.uint8)
            drawing.view = View(image, drawing.view.densities, RegionBackground([plate], 3.0, 0.0, 4).packed)
        state = at(x=8.0 * DISTANCE / FOCAL)
        for scale in (2.0, 1.0):
            lines = drawing.draw(state, scale)
            state = minimize(lines, state, drawing.model.chain, LevenbergMarquardtOptions(max_iterations=3)).state
        errors.append(np.hypot(*state.T_world_root[:2, 3]) * FOCAL / DISTANCE)
    assert errors[1] < 0.5
    assert errors[1] < errors[0]


def test_stated_colors_are_believed_where_the_images_bear_them_out():
    image, radius_px = disk(0.25)
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    inside = (np.hypot(u - CENTER[0], v - CENTER[1]) < radius_px).astype(np.uint8)
    model = ball(0.25)
    classes = color_classes(model)
    stated = stated_densities(model, classes)
    elsewhere = np.roll(stated, 2000, axis=1)
    bins = (image[80, 100].astype(int) >> 4) @ [256, 16, 1]
    believed, refuted = RegionColors(classes, stated, 0.3), RegionColors(classes, elsewhere, 0.3)
    learnt_only = RegionColors(classes, np.zeros_like(stated), 0.3)
    for colors in (believed, refuted, learnt_only):
        colors.learn(image, (0, 0, WIDTH, HEIGHT), inside, 1.0, 3, 40)
    np.testing.assert_allclose(refuted.body, learnt_only.body)
    assert not np.allclose(believed.body, learnt_only.body)
    for colors in (believed, refuted):
        assert colors.body[0, bins] > 20.0 * colors.scene[bins]


def disks_of_three_colors(shift: int) -> tuple[np.ndarray, np.ndarray, ArticulatedModel]:
    """Image of three disks, labels of which the third is ``shift`` pixels to the left of it, and their model."""
    colors = [(200, 60, 60), (60, 180, 60), (60, 60, 200)]
    shapes = tuple(Shape(f"ball{i}", "ball", Ellipsoid((0.1,) * 3), color_rgb=c) for i, c in enumerate(colors))
    image = np.random.default_rng(6).integers(90, 230, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    labels = np.zeros((HEIGHT, WIDTH), dtype=np.uint8)
    v, u = np.mgrid[0:HEIGHT, 0:WIDTH]
    for i, (x, y) in enumerate([(40, 40), (40, 110), (140, 80)]):
        image[np.hypot(u - x, v - y) < 20] = colors[i][::-1]
        labels[np.hypot(u - x + (shift if i == 2 else 0), v - y) < 20] = i + 1
    return image, labels, ArticulatedModel("balls", KinematicChain(("ball",), ()), shapes)


def test_where_a_body_has_its_stated_colors_a_part_that_is_elsewhere_is_expected_to_have_them():
    image, labels, model = disks_of_three_colors(45)
    third, classes = (12 << 8) + (3 << 4) + 3, color_classes(model)
    seen = []
    for sound in (False, True):
        colors = RegionColors(classes, stated_densities(model, classes), 0.3)
        colors.learn(image, (0, 0, WIDTH, HEIGHT), labels, 1.0, 3, 80)
        before = colors.body[2, third]
        trust_stated_colors([colors])
        seen.append(colors.body[2, third])
        assert seen[-1] > 20.0 * before
        colors.learn(image, (0, 0, WIDTH, HEIGHT), labels, 0.5, 3, 80, np.array([True, True, sound]))
        seen.append(colors.body[2, third])
    at_first, unsound, _, sound = seen
    assert unsound > 1.2 * at_first > 1.2 * sound


def test_colors_that_the_images_do_not_bear_out_are_not_expected():
    image, labels, model = disks_of_three_colors(0)
    classes = color_classes(model)
    colors = RegionColors(classes, np.roll(stated_densities(model, classes), 1, axis=0), 0.3)  # each that of another part
    colors.learn(image, (0, 0, WIDTH, HEIGHT), labels, 1.0, 3, 80)
    before = colors.body.copy()
    trust_stated_colors([colors])
    np.testing.assert_array_equal(colors.body, before)


def test_what_lines_say_is_found_anew_for_other_states_other_lines_and_other_distances():
    image, radius_px = disk(0.25)
    drawing, state = drawing_of(0.25, image, radius_px=radius_px), at(x=8.0 * DISTANCE / FOCAL)
    lines = drawing.draw(state, 4.0)
    coarse, spread_px, equations = lines.at(state).part_evidence(2.5), lines.at(state).spread_px, lines.linearize(state)
    assert not np.array_equal(lines.linearize(at()).g, equations.g)
    np.testing.assert_array_equal(lines.linearize(state).H, equations.H)
    assert lines.at(state).part_evidence(20.0).close.sum() > coarse.close.sum()
    fine = drawing.draw(state, 1.0)
    assert fine.at(state).part_evidence(2.5).chi2.sum() != coarse.chi2.sum()
    assert fine.at(state).spread_px != spread_px
    assert not np.array_equal(fine.linearize(state).H, equations.H)
    nothing = drawing.drawer.draw([None], state, 1.0, 0.5)
    assert nothing.at(state).part_evidence(2.5).expected.sum() == 0.0
    assert nothing.camera_equations(state) == [None] and nothing.active == []


def test_lines_that_have_been_drawn_do_not_change_when_others_are():
    """The drawer's work arrays are used again; what is compared later, with whatever state, is compared with one's own lines."""
    image, radius_px = disk(0.25)
    drawing, state, other = drawing_of(0.25, image, radius_px=radius_px), at(x=0.02), at(x=-0.03, y=0.01)
    lines = drawing.draw(state, 2.0)
    kept, info = lines.cameras[0].lines.copy(), lines.cameras[0].info.copy()
    before = [(lines.linearize(s), lines.at(s).part_evidence(2.5), lines.at(s).spread_px) for s in (state, other)]
    drawing.draw(other, 4.0, 2.0).linearize(other)
    drawing.drawer.draw([None], other, 1.0, 0.5)
    np.testing.assert_array_equal(lines.cameras[0].lines, kept)
    np.testing.assert_array_equal(lines.cameras[0].info, info)
    for s, (equations, evidence, spread_px) in zip((state, other), before, strict=True):
        now, found = lines.linearize(s), lines.at(s).part_evidence(2.5)
        np.testing.assert_array_equal(now.H, equations.H)
        np.testing.assert_array_equal(now.g, equations.g)
        np.testing.assert_array_equal(found.chi2, evidence.chi2)
        assert (now.cost, lines.at(s).spread_px) == (equations.cost, spread_px)


def test_what_has_been_said_of_a_state_stays_as_it_is():
    """Also when the same lines have been compared with another state since, from which nothing is left over."""
    image, radius_px = disk(0.25)
    lines, state = drawing_of(0.25, image, radius_px=radius_px).draw(at(x=0.02), 2.0), at(x=0.03)
    there = lines.at(state)
    g, cost, gradient = there.equations.g.copy(), there.cost_per_line, lines.camera_equations(state)[0].gradient.copy()
    assert lines.at(state) is there  # asked again at once, nothing is summed again
    lines.linearize(at(x=-0.02))
    np.testing.assert_array_equal(there.equations.g, g)
    assert there.cost_per_line == cost
    np.testing.assert_array_equal(lines.camera_equations(state)[0].gradient, gradient)


def test_lines_of_a_camera_that_exposes_later_are_those_of_the_body_where_it_is_then():
    """Drawn, and compared with states, with the body moved by the offset: ahead of the state by six pixels."""
    image, radius_px = disk(0.25)
    drawing = drawing_of(0.25, image, radius_px=radius_px)
    offset = np.zeros(6)
    offset[0] = 6.0 * DISTANCE / FOCAL
    late = drawing.drawer.draw([drawing.view], at(x=-offset[0]), 1.0, 0.5, [offset])
    now = drawing.draw(at(), 1.0)
    np.testing.assert_allclose(late.cameras[0].lines, now.cameras[0].lines, atol=1e-9)
    np.testing.assert_allclose(late.linearize(at(x=0.01 - offset[0])).g, now.linearize(at(x=0.01)).g, rtol=1e-6, atol=1e-6)
