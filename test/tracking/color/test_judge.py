"""What is said of colors, by how far they agree in each camera and part."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at
from tracker_node.camera.rig import CameraRig
from tracker_node.model.articulated import ArticulatedModel, Shape
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.kinematic_chain import KinematicChain
from tracker_node.model.shapes.primitives import Ellipsoid
from tracker_node.objective.points.photometry import PhotometryOptions
from tracker_node.synthesis.subjects.figure import figure_model
from tracker_node.tracking.assessment import Assessment
from tracker_node.tracking.color.agreement import ColorAgreement, agreement_of
from tracker_node.tracking.color.judge import ColorLimbs, _common_shift, assess_colors, with_limbs
from tracker_node.tracking.config import ColorConfig
from tracker_node.tracking.estimate import LimbStatus, Status

CONFIG = ColorConfig(degraded_agreement=0.6, lost_agreement=0.4, min_pixels=100, few_pixels=1000)
BALLS = ArticulatedModel(
    "balls", KinematicChain(("base",), ()), (Shape("body", "base", Ellipsoid((0.3, 0.3, 0.3)), color_rgb=(200, 40, 40)),
                                             Shape("cap", "base", Ellipsoid((0.2, 0.2, 0.5)), color_rgb=(40, 40, 200)))
)  # fmt: skip
UNSEEN = None


def assessed(*cameras, parts=(1.0, 1.0), pixels=6000.0, chance=(100.0, 100.0), absent=0) -> Assessment:
    """``cameras``: the agreement in each, or `UNSEEN`; ``parts``: what the agreement of each part is multiplied by."""
    n = len(cameras)
    counts = np.array([[0.0 if share is UNSEEN else pixels / n / 2] * 2 for share in cameras])
    expected = counts * np.array(chance)
    squares = expected * (1.0 - np.outer([0.0 if share is UNSEEN else share for share in cameras], parts))
    lens = LENSES["plain"]
    rig = CameraRig(tuple(look_at((1.0 + i, 0.0, 0.0), (0.0, 0.0, 0.0), lens, f"cam{i}") for i in range(n)))
    return assess_colors(ColorAgreement(squares, expected, counts), BALLS, rig, rig.names[: n - absent], CONFIG)


@pytest.mark.parametrize(
    ("cameras", "options", "status", "said"),
    [
        ((0.9, 0.8, 0.95), {}, Status.TRACKING, ""),
        ((0.9, 0.9, UNSEEN), {}, Status.TRACKING, ""),
        ((0.9,), {}, Status.TRACKING, ""),
        ((0.9, 0.9, UNSEEN), {"absent": 1}, Status.DEGRADED, "2 of 3 cameras"),
        ((0.9, UNSEEN, UNSEEN), {}, Status.DEGRADED, "only cam0 sees"),
        ((0.9, 0.1, 0.8), {}, Status.DEGRADED, "colors do not agree in cam1 (10 %)"),
        ((0.9, 0.9, -3.0), {}, Status.DEGRADED, "in cam2 (0 %)"),
        ((0.9, 0.9), {"parts": (1.1, 0.4)}, Status.DEGRADED, "colors do not agree of cap (36 %)"),
        ((0.9, 0.9), {"parts": (1.0, 0.3), "chance": (100.0, 20.0)}, Status.TRACKING, ""),  # as plain as what is around it
        ((0.5, 0.5, 0.9), {}, Status.DEGRADED, "agree to 50 %"),
        ((0.9, 0.2, 0.3), {}, Status.LOST, "agree to 30 %"),
        ((0.9, 0.9), {"pixels": 900.0}, Status.DEGRADED, "the body covers only 900 pixels"),
        ((0.9, 0.9), {"pixels": 50.0}, Status.LOST, "the body covers only 50 pixels"),
        ((UNSEEN, UNSEEN), {}, Status.LOST, "no camera sees"),
    ],
)
def test_the_median_camera_decides_and_what_disagrees_is_named(cameras, options, status, said):
    found = assessed(*cameras, **options)
    assert found.status is status
    assert said in found.reason and bool(found.reason) == bool(said)


def test_noise_is_told_from_a_body_that_is_off():
    assert assessed(0.05, 0.0, -0.1).noise and assessed(UNSEEN, UNSEEN).noise
    assert not assessed(0.3, 0.3).noise and not assessed(0.9, 0.9).noise


def test_agreement_is_the_share_of_the_mask_that_lies_on_the_body():
    """A ball of one color before a plain ground: half of its mask is covered by the ground's color."""
    model = ArticulatedModel("ball", BALLS.chain, BALLS.shapes[:1])
    camera = look_at((0.0, -2.0, 0.0), (0.0, 0.0, 0.0), LENSES["plain"])
    rig, state = CameraRig((camera,)), State.neutral(model)
    ground, ball = np.array([90, 120, 60]), np.array(model.shapes[0].color_rgb[::-1])
    image = np.tile(ground, (camera.model.height, camera.model.width, 1)).astype(np.uint8)
    (u, v), _ = camera.project(np.zeros(3))
    for share, until in ((1.0, camera.model.width), (0.5, round(u)), (0.0, 0)):
        shown = image.copy()
        shown[:, :until] = ball
        shown[(np.hypot(*(np.mgrid[: image.shape[0], : image.shape[1]] - np.array([v, u])[:, None, None]))) > 27] = ground
        found = agreement_of([model], rig, [shown], state, PhotometryOptions("raw"))
        assert found.median == pytest.approx(share, abs=0.1)
        assert found.camera_rms[0] == pytest.approx(np.sqrt((1 - share) * ((ground - ball) ** 2).mean()), abs=12.0)


ARMED = figure_model()
LIMBS = ColorLimbs(ARMED)


def agreeing(shares: dict[str, float], seen: float = 2000.0) -> ColorAgreement:
    """Of two cameras: 0.95 everywhere, but for all parts of some limbs."""
    squares = np.full((2, len(ARMED.shapes)), 0.05)
    for limb in LIMBS.limbs:
        squares[:, limb.shapes] = 1.0 - shares.get(limb.name, 0.95)
    pixels = np.full_like(squares, seen)
    return ColorAgreement(100.0 * pixels * squares, 100.0 * pixels, pixels)


def said(agreement: ColorAgreement) -> dict[str, LimbStatus]:
    return {limb.name: limb.status for limb in LIMBS.reports(agreement)}


def test_a_limb_whose_colors_are_not_there_is_lost_and_the_others_are_not():
    names = [limb.name for limb in LIMBS.limbs]
    assert set(said(agreeing({})).values()) == {LimbStatus.TRACKING}
    found = said(agreeing({names[1]: 0.05}))
    assert found.pop(names[1]) is LimbStatus.LOST
    assert set(found.values()) == {LimbStatus.TRACKING}
    assert set(said(agreeing({}, seen=10.0)).values()) == {LimbStatus.UNSEEN}


def test_one_part_of_a_body_with_joints_makes_its_limb_doubtful_and_of_a_thing_lost():
    limb = next(limb for limb in LIMBS.limbs[1:] if limb.shapes.sum() > 1)
    agreement = agreeing({})
    agreement.squares[:, np.flatnonzero(limb.shapes)[0]] *= 20.0  # that part does not agree at all
    assert said(agreement)[limb.name] is LimbStatus.DEGRADED
    rigid = ColorLimbs(ArticulatedModel("rigid", BALLS.chain, BALLS.shapes))
    pixels, squares = np.full((2, 2), 2000.0), np.array([[0.3, 1.3]] * 2)
    (whole,) = rigid.reports(ColorAgreement(100.0 * pixels * squares, 100.0 * pixels, pixels))
    assert whole.status is LimbStatus.LOST


def test_probability_grows_as_agreement_shrinks():
    name = LIMBS.limbs[1].name
    found = [LIMBS.reports(agreeing({name: share}))[1].probability for share in (0.95, 0.7, 0.4, 0.1)]
    assert (np.diff(found) > 0.0).all() and found[0] < 0.1 and found[-1] > 0.8


def test_a_body_is_doubtful_with_a_limb_and_lost_with_its_trunk():
    name = LIMBS.limbs[1].name
    tracking = Assessment(Status.TRACKING, "")
    with_limb = with_limbs(tracking, LIMBS.reports(agreeing({name: 0.0})))
    assert with_limb.status is Status.DEGRADED and name in with_limb.reason
    assert with_limbs(tracking, LIMBS.reports(agreeing({LIMBS.limbs[0].name: -0.5}))).status is Status.LOST
    lost = with_limbs(Assessment(Status.LOST, "nothing"), LIMBS.reports(agreeing({})))
    assert lost.limbs[0].status is LimbStatus.LOST and lost.limbs[0].probability == 1.0


def covariance(shares: dict[str, float]) -> np.ndarray:
    """Of the neutral body, whose links are known to five millimeters and milliradians where all agree to 0.95."""
    agreement, normal = agreeing(shares), np.tile(4e4 * np.eye(6), (len(ARMED.chain.links), 1, 1))
    reports = LIMBS.reports(agreement)
    return LIMBS.covariance(normal, 1.0, agreement, reports, Configuration(ARMED, State.neutral(ARMED)))[0]


def test_images_say_nothing_of_a_lost_limb():
    limb = LIMBS.limbs[1]
    lost = covariance({limb.name: 0.0})
    ranges = (ARMED.chain.upper - ARMED.chain.lower)[limb.dofs[6:]]
    assert np.diag(lost)[limb.dofs] == pytest.approx(ranges**2 / 12.0, rel=2e-2)
    assert np.abs(lost[limb.dofs][:, ~limb.dofs]).max() < 1e-3 * np.diag(lost)[limb.dofs].min()
    assert np.diag(lost)[~limb.dofs].max() < 1e-2


def test_what_does_not_agree_is_less_certain_by_its_square():
    """Three times as much disagrees, of the whole body and of one limb."""
    sound, all_off = covariance({}), covariance({limb.name: 0.85 for limb in LIMBS.limbs})
    assert np.diag(all_off) == pytest.approx(9.0 * np.diag(sound), rel=0.05)
    limb = LIMBS.limbs[1]
    one_off = np.diag(covariance({limb.name: 0.85})) / np.diag(sound)
    assert one_off[limb.dofs].min() > 3.0 and one_off[~limb.dofs].max() < 2.0


def test_shading_hardly_tells_how_a_round_part_is_turned_about_its_axis():
    turned = Configuration(ARMED, State.neutral(ARMED).retract(np.linspace(-0.2, 0.3, ARMED.n_dof)))
    axis = LIMBS._axes[1]
    T = turned.Ts_world_link[axis.link]
    direction, point = T[:3, :3] @ axis.direction, T[:3, :3] @ axis.point + T[:3, 3]
    roll = np.concatenate([np.cross(point, direction), direction])
    normal = np.tile(np.diag(np.arange(1.0, 7.0)), (len(ARMED.chain.links), 1, 1))
    before = normal[axis.link].copy()
    axis.weaken(normal, turned)
    assert roll @ normal[axis.link] @ roll == pytest.approx(0.1 * (roll @ before @ roll))
    other = np.arange(6.0) - roll * (roll @ before @ np.arange(6.0)) / (roll @ before @ roll)
    assert normal[axis.link] @ other == pytest.approx(before @ other)
    assert np.array_equal(np.delete(normal, axis.link, axis=0), np.tile(np.diag(np.arange(1.0, 7.0)), (len(normal) - 1, 1, 1)))


def test_upright_cameras_around_a_body_share_no_shift_but_up_and_down():
    places = [(np.cos(a), np.sin(a), 0.0) for a in np.deg2rad([0.0, 90.0, 180.0, 270.0])]
    rig = CameraRig(tuple(look_at(place, (0.0, 0.0, 0.0), LENSES["plain"], f"cam{i}") for i, place in enumerate(places)))
    shift = _common_shift(rig, np.zeros(3))
    assert np.abs(shift @ shift.T) == pytest.approx(np.diag([0.0, 0.0, (0.07 / rig.cameras[0].model.params[1]) ** 2]), abs=1e-12)
