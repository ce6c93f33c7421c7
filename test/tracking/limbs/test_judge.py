"""What evidence makes of the probability that a limb is lost."""

from dataclasses import fields, replace

import numpy as np
import pytest

from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.lines.correspondences import PartEvidence
from tracker_node.synthesis.subjects.figure import figure_model
from tracker_node.tracking.config import StatusConfig
from tracker_node.tracking.estimate import LimbReport, LimbStatus, Status
from tracker_node.tracking.limbs.judge import LOST_TIP_M, LimbJudge, body_status, is_noise, limb_measures
from tracker_node.tracking.limbs.tree import length_scale

MODEL = figure_model()
STATE = State.neutral(MODEL)
N_CAMERAS, N_SHAPES = 4, len(MODEL.shapes)
NAMES = ["trunk", "left_forearm", "left_shank", "right_forearm", "right_shank"]


def evidence(close=0.85, **limbs) -> PartEvidence:
    """20 samples of every shape in every camera, of which a share is found: that of the shape's limb, if it is named."""
    judge = LimbJudge(MODEL, StatusConfig())
    shares = np.full(N_SHAPES, close)
    expected = np.full((N_CAMERAS, N_SHAPES), 20.0)
    for limb in judge.limbs:
        share = limbs.get(limb.name, close)
        if share is None:
            expected[:, limb.shapes] = 0.0
        shares[limb.shapes] = share or 0.0
    close = expected * shares
    return PartEvidence(expected, close, close, close, 14.0 * close, 0.0 * expected, expected - close)


def told(judge: LimbJudge, seen: PartEvidence, sets: int = 1, covariance=None, **options) -> dict[str, LimbReport]:
    reports: tuple[LimbReport, ...] = ()
    for _ in range(sets):
        reports = judge.update(seen, STATE, covariance, **options)
    return {report.name: report for report in reports}


def statuses(reports: dict[str, LimbReport]) -> dict[str, LimbStatus]:
    return {name: report.status for name, report in reports.items() if report.status is not LimbStatus.TRACKING}


def test_measures_are_shares_of_what_should_be_seen():
    seen = evidence()
    seen.close[0] = 0.0  # one camera is covered: the mean falls, the median camera does not
    share, median, ratio, worst = limb_measures(seen, judge_limb("left_forearm").shapes)
    assert (share, median, worst) == pytest.approx((0.75 * 0.85, 0.85, 0.75 * 0.85)) and ratio == pytest.approx(14.0 * 0.85)
    assert limb_measures(evidence(left_forearm=None), judge_limb("left_forearm").shapes) is None


def test_an_outline_over_the_limbs_own_colors_is_not_expected_up_to_half_of_it():
    shapes = judge_limb("left_forearm").shapes
    seen, plain = evidence(close=0.4), limb_measures(evidence(close=0.4), shapes)
    half = limb_measures(replace(seen, filled=0.5 * seen.expected), shapes)
    np.testing.assert_allclose(half, 2.0 * plain)
    np.testing.assert_allclose(limb_measures(replace(seen, filled=seen.expected), shapes), half)


def test_a_limb_whose_colors_go_on_beyond_its_outline_is_degraded_and_not_lost():
    judge, seen = LimbJudge(MODEL, StatusConfig()), evidence(left_forearm=0.1)
    told(judge, evidence(), 20)
    reports = told(judge, replace(seen, empty=0.1 * seen.expected), 30)
    assert statuses(reports) == {"left_forearm": LimbStatus.DEGRADED} and judge.lost == []
    assert statuses(told(judge, seen, 3)) == {"left_forearm": LimbStatus.LOST}
    assert statuses(told(judge, replace(seen, empty=0.1 * seen.expected), 3)) == {"left_forearm": LimbStatus.LOST}


def test_a_limb_whose_colors_are_all_around_is_degraded_and_not_lost():
    judge, seen = LimbJudge(MODEL, StatusConfig()), evidence(left_forearm=0.1, left_shank=0.1)
    told(judge, evidence(), 20)
    common = np.array([limb.name == "left_forearm" for limb in judge.limbs])
    for _ in range(30):
        reports = judge.update(seen, State.neutral(MODEL), common=common)
    of_limbs = statuses({report.name: report for report in reports})
    assert of_limbs == {"left_forearm": LimbStatus.DEGRADED, "left_shank": LimbStatus.LOST}


def judge_limb(name):
    return next(limb for limb in LimbJudge(MODEL, StatusConfig()).limbs if limb.name == name)


def test_a_limb_that_is_not_found_is_lost_within_two_sets_and_the_others_are_not():
    judge = LimbJudge(MODEL, StatusConfig())
    assert list(told(judge, evidence(), 20)) == NAMES
    assert statuses(told(judge, evidence())) == {}
    lost = told(judge, evidence(left_shank=0.2), 2)
    assert statuses(lost) == {"left_shank": LimbStatus.LOST}
    assert "20 % of its outline" in lost["left_shank"].reason
    assert body_status(tuple(lost.values())) == (Status.DEGRADED, "left_shank lost")
    assert statuses(told(judge, evidence(), 4)) == {}


def test_a_body_that_never_fits_well_is_sound_and_lost_when_it_fits_worse():
    judge = LimbJudge(MODEL, StatusConfig())
    assert statuses(told(judge, evidence(0.5), 10)) == {}
    assert "right_forearm" in statuses(told(judge, evidence(0.5, right_forearm=0.15), 3))


def test_a_start_that_is_nowhere_is_lost_at_once():
    reports = tuple(told(LimbJudge(MODEL, StatusConfig()), evidence(0.15)).values())
    assert body_status(reports)[0] is Status.LOST
    assert is_noise(evidence(0.15)) and not is_noise(evidence(0.5))


def test_what_hangs_on_a_lost_trunk_is_lost():
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(), 10)
    lost = evidence(trunk=0.1, left_forearm=0.2, left_shank=0.2)
    assert set(statuses(told(judge, lost, 3))) == set(NAMES)


@pytest.mark.parametrize(("found", "in_place"), [({}, True), ({"left_shank": 0.1}, True), ({"left_shank": None}, True),
                                                 ({"left_shank": None, "right_shank": None}, False)])  # fmt: skip
def test_a_trunk_before_a_wall_of_its_color_is_where_most_of_its_limbs_are_in_place(found, in_place):
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(), 10)
    reports = told(judge, evidence(trunk=0.03, **found), 4)
    assert (reports["trunk"].status is LimbStatus.TRACKING) is in_place
    assert (body_status(tuple(reports.values()))[0] is Status.LOST) is not in_place


def test_a_trunk_that_no_camera_should_see_is_unseen_whatever_its_limbs_are():
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(), 10)
    assert told(judge, evidence(trunk=None))["trunk"].status is LimbStatus.UNSEEN


def test_a_hidden_limb_is_unseen_and_less_and_less_certain():
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(), 10)
    hidden = evidence(left_forearm=None)
    first = told(judge, hidden)["left_forearm"]
    assert first.status is LimbStatus.UNSEEN
    later = told(judge, hidden, 10)["left_forearm"]
    assert first.probability < later.probability < 0.5
    vague = told(judge, hidden, 1, np.eye(MODEL.n_dof) * 0.2**2)["left_forearm"]
    assert vague.probability > 0.5


def test_the_end_of_a_limb_is_as_uncertain_as_states_drawn_from_the_covariance():
    """Against drawing: the largest standard deviation of the wrist's place, over directions."""
    rng = np.random.default_rng(1)
    root = rng.normal(size=(MODEL.n_dof, MODEL.n_dof)) * 2e-4
    covariance = root @ root.T
    judge, wrist = LimbJudge(MODEL, StatusConfig()), MODEL.landmark_index("left_wrist")
    places = [
        Configuration(MODEL, STATE.retract(root @ rng.normal(size=MODEL.n_dof))).landmarks_world[wrist] for _ in range(4000)
    ]
    drawn = np.sqrt(np.linalg.eigvalsh(np.cov(np.array(places).T))[-1])
    assert judge.tip_sigmas(STATE, covariance)[1] == pytest.approx(drawn, rel=0.05)
    wide = covariance * (LOST_TIP_M * length_scale(MODEL) / drawn) ** 2  # one standard deviation is the limit: 32 % beyond it
    told(judge, evidence(), 20)
    assert told(judge, evidence(), 1, wide)["left_forearm"].probability == pytest.approx(0.317, abs=0.02)


def test_information_on_a_lost_limb_is_not_believed():
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(), 10)
    reports = tuple(told(judge, evidence(left_forearm=0.1), 3).values())
    share, own = judge.dof_weights(reports), judge_limb("left_forearm").dofs
    assert (share[~own] == 1.0).all() and (share[own] < 0.3).all()


def beside(**odds: float) -> np.ndarray:
    return np.array([odds.get(name, 0.0) for name in NAMES])


def told_beside(judge: LimbJudge, seen: PartEvidence, others: np.ndarray, sets: int = 1) -> dict[str, LimbReport]:
    for _ in range(sets):
        reports = judge.update(seen, STATE, None, others)
    return {one.name: one for one in reports}


def stepped(p: float, odds: float, config: StatusConfig) -> float:
    """One image set: the limb may have got lost or been found, then the odds."""
    p = p * (1.0 - config.limb_recovery) + (1.0 - p) * config.limb_loss
    return 1.0 / (1.0 + (1.0 - p) / p * np.exp(-odds))


def test_points_say_which_limb_it_is_and_outlines_count_little_beside_them():
    """An arm of whose outline nothing is found adds 1 to the log odds, and one that is well found takes 1 off."""
    config = StatusConfig()
    for close, outline in ((0.0, 1.0), (0.85, -1.0)):
        judge = LimbJudge(MODEL, config)
        told(judge, evidence(), 20)
        judge.probabilities[:] = 0.1
        seen = evidence(left_forearm=close, left_shank=None, trunk=0.85)
        found = told_beside(judge, seen, beside(left_forearm=-2.0, left_shank=3.0))
        assert judge.probabilities[1] == pytest.approx(stepped(0.1, outline - 2.0, config))
        assert judge.probabilities[2] == pytest.approx(stepped(0.1, 3.0, config))  # of which no outline is to be seen
        assert found["left_shank"].status is not LimbStatus.UNSEEN


def test_outlines_on_the_shapes_of_a_clothed_body_count_in_full_beside_points():
    config, p = StatusConfig(), []
    for own in (False, True):
        judge = LimbJudge(MODEL, config)
        told(judge, evidence(), 20)
        judge.update(evidence(), STATE, None, beside(left_forearm=4.0), own_surfaces=own)
        p.append(judge.probabilities[1])
    assert p[0] > 0.1 > 0.05 > p[1]


def test_limbs_without_other_evidence_are_judged_by_outlines_alone():
    one, other = LimbJudge(MODEL, StatusConfig()), LimbJudge(MODEL, StatusConfig())
    told(one, evidence(), 10)
    told(other, evidence(), 10)
    seen = evidence(left_shank=0.3, right_shank=None)
    told(one, seen)
    found = told_beside(other, seen, beside(left_forearm=1.5))
    np.testing.assert_array_equal(one.probabilities[2:], other.probabilities[2:])  # the trunk's: see below
    assert other.probabilities[1] > one.probabilities[1] and found["right_shank"].status is LimbStatus.UNSEEN
    assert told_beside(other, seen, np.zeros(5))["right_shank"].status is LimbStatus.UNSEEN


def sure_beside(**odds: float) -> np.ndarray:
    """Points of all limbs are where they should be, but those of the limbs named."""
    return np.array([odds.get(name, -6.0) for name in NAMES])


@pytest.mark.parametrize(
    ("close", "odds", "status"),
    [
        (0.85, -2.5, LimbStatus.TRACKING), (0.85, -1.5, LimbStatus.DEGRADED),  # a good outline counts for 1, ...
        (0.40, -5.5, LimbStatus.DEGRADED), (0.40, -6.0, LimbStatus.TRACKING),  # ... a bad one (log odds of 2.7) in full
        (0.85, 0.0, LimbStatus.DEGRADED), (0.85, np.nan, LimbStatus.TRACKING),  # guessed everywhere; no points at all
    ],
)  # fmt: skip
def test_a_limb_whose_points_are_guessed_is_not_tracking_however_well_it_was_seen_before(close, odds, status):
    judge = LimbJudge(MODEL, StatusConfig())
    assert not statuses(told_beside(judge, evidence(), sure_beside(), 20))
    found = told_beside(judge, evidence(left_forearm=close), sure_beside(left_forearm=odds))
    assert found["left_forearm"].status is status and judge.probabilities[1] < StatusConfig().limb_degraded
    assert statuses(found) == ({} if status is LimbStatus.TRACKING else {"left_forearm": status})
    if status is LimbStatus.DEGRADED:
        assert found["left_forearm"].reason == "hidden, or not where a detector guesses it"


def test_a_hidden_limb_stays_degraded_until_points_confirm_it_and_does_not_change_what_is_usual_of_it():
    judge = LimbJudge(MODEL, StatusConfig())
    told_beside(judge, evidence(), sure_beside(), 20)
    usual = judge._levels.copy()
    found = told_beside(judge, evidence(left_forearm=0.4), sure_beside(left_forearm=-4.0), 5)
    assert statuses(found) == {"left_forearm": LimbStatus.DEGRADED}
    np.testing.assert_allclose(judge._levels[1], usual[1])
    assert statuses(told(judge, evidence(), 2)) == {"left_forearm": LimbStatus.DEGRADED}  # sets at which no detector looked
    assert not statuses(told_beside(judge, evidence(), sure_beside()))
    told_beside(judge, evidence(), sure_beside(left_forearm=0.0))
    judge.restart()
    assert not statuses(told(judge, evidence(), 3))


def test_a_limb_that_may_as_well_be_elsewhere_is_degraded_until_it_may_not_and_is_not_less_in_place():
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(), 20)
    assert judge.unsure == []
    judge.rivals[3] = True
    reports = told(judge, evidence())
    assert statuses(reports) == {"right_forearm": LimbStatus.DEGRADED} and "elsewhere" in reports["right_forearm"].reason
    assert judge.unsure == [3] and judge.probabilities[3] == judge.probabilities[1]
    judge.rivals[3] = False
    assert statuses(told(judge, evidence())) == {} and judge.unsure == []


@pytest.mark.parametrize(
    ("usual", "close", "unsure"),
    [(0.65, 0.62, [1, 2, 3, 4]), (0.65, 0.4, [1, 2, 3, 4]), (0.65, 0.05, [2, 3, 4]), (0.85, 0.52, [])],
)
def test_limbs_whose_outlines_are_hard_to_find_are_unsure_unless_they_are_lost(usual, close, unsure):
    judge = LimbJudge(MODEL, StatusConfig())
    assert judge.unsure == []
    told(judge, evidence(usual), 20)
    told(judge, evidence(usual, left_forearm=close), 2)
    assert judge.unsure == unsure


def test_the_end_of_a_limb_is_where_its_link_carries_it():
    judge, state = LimbJudge(MODEL, StatusConfig()), STATE.retract(np.r_[0.1, 0.2, 0.3, np.zeros(MODEL.n_dof - 3)])
    for i in range(len(judge.limbs)):
        np.testing.assert_allclose(judge.tip(i, state) - judge.tip(i, STATE), [0.1, 0.2, 0.3], atol=1e-12)


@pytest.mark.parametrize(("sigma_m", "confirmed"), [(0.028, True), (0.032, False)])
def test_a_limb_whose_end_is_not_known_to_a_fifth_of_lost_is_degraded(sigma_m, confirmed):
    judge = LimbJudge(MODEL, StatusConfig())
    told_beside(judge, evidence(), sure_beside(), 20)
    unit = judge.tip_sigmas(STATE, np.diag(judge.limbs[1].dofs.astype(float)))[1]
    covariance = np.diag(judge.limbs[1].dofs * (sigma_m / unit) ** 2)
    found = {each.name: each for each in judge.update(evidence(), STATE, covariance, sure_beside())}["left_forearm"]
    assert found.status is (LimbStatus.TRACKING if confirmed else LimbStatus.DEGRADED)
    assert found.reason == ("" if confirmed else "its end is known to 32 mm")
    alone = judge.update(evidence(), STATE, covariance, None)[1]  # outlines alone keep to 150 mm
    assert alone.status is found.status
    judge.restart()
    told(judge, evidence(), 5)
    assert judge.update(evidence(), STATE, covariance, None)[1].status is LimbStatus.TRACKING


@pytest.mark.parametrize(("sigma_m", "weight"), [(0.02, 0.1), (0.04, 1.0)])
def test_what_images_seem_to_know_of_a_limb_that_its_points_do_not_confirm_counts_little(sigma_m, weight):
    judge = LimbJudge(MODEL, StatusConfig())
    told_beside(judge, evidence(), sure_beside(), 20)
    own = judge.limbs[1].dofs
    unit = judge.tip_sigmas(STATE, np.diag(own.astype(float)))[1]
    covariance = np.diag(own * (sigma_m / unit) ** 2)
    weights = judge.dof_weights(judge.update(evidence(), STATE, covariance, sure_beside(left_forearm=-1.0)))
    assert (weights[own] == weight).all() and (weights[~own] == 1.0).all()
    unlooked = judge.dof_weights(judge.update(evidence(), STATE, covariance, None))
    np.testing.assert_array_equal(unlooked, weights)  # until a detector looks again
    assert (judge.dof_weights(judge.update(evidence(), STATE, covariance, sure_beside())) == 1.0).all()


def test_a_set_of_points_and_outlines_cannot_say_more_than_the_limit():
    config = replace(StatusConfig(), evidence_limit=1.5, limb_loss=1e-6, limb_recovery=0.0)
    judge = LimbJudge(MODEL, config)
    told(judge, evidence())
    judge.probabilities[:] = [1e-4, 0.2, 1e-4, 1e-4, 1e-4]
    told_beside(judge, evidence(), beside(left_forearm=6.0))
    assert judge.probabilities[1] / (1.0 - judge.probabilities[1]) == pytest.approx(0.25 * np.exp(1.5), rel=1e-3)


def test_whoever_says_more_of_a_lost_limb_is_named():
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(), 10)
    found = told_beside(judge, evidence(left_shank=0.1), beside(left_forearm=6.0, left_shank=0.5), 4)
    assert found["left_forearm"].reason == "its points are elsewhere"
    assert "10 % of its outline" in found["left_shank"].reason
    hidden = told_beside(judge, evidence(right_shank=None), beside(right_shank=6.0), 4)["right_shank"]
    assert hidden.status is LimbStatus.LOST and hidden.reason == "its points are elsewhere"


def report(status, name="x"):
    return LimbReport(name, status, "why", 0.5)


@pytest.mark.parametrize(
    ("limbs", "expected"),
    [
        ("TTTTT", Status.TRACKING), ("TTTTD", Status.DEGRADED), ("TTLTT", Status.DEGRADED), ("TULTT", Status.DEGRADED),
        ("LTTTT", Status.LOST), ("TLLLT", Status.LOST), ("TLLTT", Status.DEGRADED), ("UUUUU", Status.LOST),
        ("TTTLLL", Status.DEGRADED), ("TTLLLL", Status.LOST), ("TLLUT", Status.DEGRADED), ("TLLUU", Status.LOST),
        ("T", Status.TRACKING), ("L", Status.LOST), ("U", Status.LOST),
    ],
)  # fmt: skip
def test_the_body_by_its_trunk_and_most_of_its_limbs(limbs, expected):
    kinds = {"T": LimbStatus.TRACKING, "D": LimbStatus.DEGRADED, "L": LimbStatus.LOST, "U": LimbStatus.UNSEEN}
    status, reason = body_status([report(kinds[letter], f"limb{i}") for i, letter in enumerate(limbs)])
    assert status is expected and bool(reason) == (expected is not Status.TRACKING)


def test_no_image_at_all():
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(), 10)
    reports = judge.nothing_seen()
    assert body_status(reports)[0] is Status.LOST and all(r.status is LimbStatus.UNSEEN for r in reports)


def test_a_set_cannot_change_the_odds_by_more_than_the_limit():
    config = replace(StatusConfig(), evidence_limit=1.0, limb_loss=1e-6, limb_recovery=0.0)
    judge = LimbJudge(MODEL, config)
    told(judge, evidence())
    judge.probabilities[:] = [1e-4, 0.2, 1e-4, 1e-4, 1e-4]
    p = told(judge, evidence(left_forearm=0.0))["left_forearm"].probability
    assert p / (1.0 - p) == pytest.approx(0.25 * np.e, rel=0.01)


def table(*rows) -> np.ndarray:
    return np.array(rows, dtype=np.float64)


def parts(expected, close, ratio=None) -> PartEvidence:
    zero = np.zeros_like(expected)
    return PartEvidence(expected, zero, close, zero, zero if ratio is None else ratio, zero, expected - close)


def test_measures_of_a_limb_of_two_shapes_in_three_cameras():
    expected = table([10.0, 10.0, 50.0], [20.0, 0.0, 50.0], [2.0, 2.0, 50.0])  # the third camera sees too little
    close = table([5.0, 3.0, 50.0], [18.0, 0.0, 50.0], [2.0, 2.0, 50.0])
    ratio = table([10.0, 20.0, 999.0], [40.0, 0.0, 999.0], [7.0, 7.0, 999.0])
    found = limb_measures(parts(expected, close, ratio), np.array([True, True, False]))
    worst = min(25.0 / 32.0, 1.0)  # the second shape has 12 samples: too few for itself
    assert found == pytest.approx([26.0 / 40.0, 0.9, 70.0 / 40.0, worst])


@pytest.mark.parametrize(("samples", "known"), [(5.0, True), (4.9, False)])
def test_a_camera_needs_five_samples_of_a_limb(samples, known):
    found = limb_measures(parts(table([samples]), table([1.0])), np.array([True]))
    assert (found is not None) is known
    if known:
        assert found == pytest.approx([0.2, 0.2, 0.0, 0.2])  # no part has enough for itself: the limb's share


def test_a_part_needs_fifteen_samples_to_be_the_worst():
    for samples, worst in ((15.0, 0.2), (14.9, 1.0)):
        seen = parts(table([20.0, samples]), table([20.0, 0.2 * samples]))
        assert limb_measures(seen, np.array([True, True]))[3] == pytest.approx(worst)


def test_of_an_even_number_of_cameras_the_better_is_the_middle_one():
    expected = np.full((4, 1), 10.0)
    close = table([1.0], [9.0], [3.0], [6.0])
    assert limb_measures(parts(expected, close), np.array([True]))[1] == pytest.approx(0.6)


def test_noise_is_less_than_a_fifth_of_the_outline():
    expected = np.full((2, 3), 10.0)
    assert is_noise(parts(expected, np.full((2, 3), 1.99))) and not is_noise(parts(expected, np.full((2, 3), 2.0)))


def test_reports_in_words():
    judge = LimbJudge(MODEL, StatusConfig())
    assert not judge.knows and judge.lost == [] and not judge.body_lost and judge.was_lost
    told(judge, evidence(), 10)
    assert judge.knows and judge.lost == []
    fine = told(judge, evidence())
    assert all(report.reason == "" for report in fine.values())
    hidden = told(judge, evidence(left_forearm=None))["left_forearm"]
    assert (hidden.status, hidden.reason) == (LimbStatus.UNSEEN, "hidden, or in no image")
    vague = told(judge, evidence(), 1, np.eye(MODEL.n_dof) * 0.2**2)["left_shank"]
    assert vague.status is LimbStatus.LOST and vague.reason.startswith("its end may be elsewhere: known to ")
    sigma = judge.tip_sigmas(STATE, np.eye(MODEL.n_dof) * 0.2**2)[NAMES.index("left_shank")]
    assert vague.reason.endswith(f"{1e3 * sigma:.0f} mm")
    trunk = told(judge, evidence(trunk=0.1, left_forearm=0.1, right_shank=0.1), 3)
    assert trunk["left_shank"].reason == "the trunk is" and "10 % of its outline" in trunk["trunk"].reason
    assert 0 in judge.lost and judge.body_lost


def test_a_body_is_lost_with_more_than_half_of_its_limbs():
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(), 10)
    judge.probabilities[:] = [0.1, 0.5, 0.6, 0.1, 0.49]
    assert judge.lost == [1, 2] and not judge.body_lost
    judge.probabilities[4] = 0.5
    assert judge.lost == [1, 2, 4] and judge.body_lost
    judge.restart()
    assert judge.was_lost and judge.probabilities == pytest.approx(0.3)
    told(judge, evidence(), 3)
    judge.restart()
    assert not judge.was_lost


def test_without_evidence_a_limb_is_less_and_less_certain_by_the_rates_configured():
    config = replace(StatusConfig(), limb_loss=0.1, limb_recovery=0.3)
    judge = LimbJudge(MODEL, config)
    told(judge, evidence(), 10)
    judge.probabilities[:] = [0.0, 0.2, 0.2, 0.2, 0.2]
    hidden = told(judge, evidence(left_forearm=None))["left_forearm"]
    assert judge.probabilities[1] == pytest.approx(0.2 * 0.7 + 0.8 * 0.1)
    assert hidden.probability == pytest.approx(1.0 - (1.0 - 0.22) * (1.0 - judge.probabilities[0]), abs=1e-9)
    judge.probabilities[:] = 0.2
    assert [r.probability for r in judge.nothing_seen()] == pytest.approx([0.2 + 0.8 * 0.1] * 5)


def test_levels_follow_what_is_seen_while_all_is_well_and_never_below_the_least():
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(0.6))
    assert judge.shares == pytest.approx(1.0)
    told(judge, evidence(0.8))
    assert judge.shares == pytest.approx(0.8 / 0.6)
    level = 0.6 + 0.05 * 0.2
    told(judge, evidence(0.8))
    assert judge.shares == pytest.approx(0.8 / level)
    told(judge, evidence(1.0, left_shank=None))
    assert np.isnan(judge.shares[NAMES.index("left_shank")]).all() and np.nanmax(judge.shares) == pytest.approx(1.5)
    poor = LimbJudge(MODEL, StatusConfig())
    told(poor, evidence(0.2))
    assert poor.shares[:, :2] == pytest.approx(0.2 / 0.4) and poor.shares[:, 3] == pytest.approx(0.2 / 0.3)


def test_parts_of_limbs_that_are_tracked_count_and_others_do_not():
    judge = LimbJudge(MODEL, StatusConfig())
    told(judge, evidence(), 10)
    reports = tuple(told(judge, evidence(left_shank=0.1, right_forearm=None), 3).values())
    weights = judge.part_weights(reports)
    assert weights.shape == (N_SHAPES,)
    for limb in judge.limbs:
        assert (weights[limb.shapes] == (limb.name not in ("left_shank", "right_forearm"))).all()


def test_the_share_believed_of_a_lost_limb_is_the_root_of_what_it_may_be_right_by():
    judge = LimbJudge(MODEL, StatusConfig())
    lost = {"left_forearm": 0.64, "left_shank": 1.0}
    share = judge.dof_weights([
        LimbReport(name, LimbStatus.LOST if name in lost else LimbStatus.DEGRADED, "", lost.get(name, 0.4)) for name in NAMES
    ])  # fmt: skip
    arm, shank = judge_limb("left_forearm").dofs, judge_limb("left_shank").dofs
    assert share[arm] == pytest.approx(0.6) and share[shank] == pytest.approx(0.01)
    assert (share[~(arm | shank)] == 1.0).all()


def test_the_body_in_words():
    def said(letters):
        kinds = {"T": LimbStatus.TRACKING, "D": LimbStatus.DEGRADED, "L": LimbStatus.LOST, "U": LimbStatus.UNSEEN}
        return body_status([report(kinds[letter], f"limb{i}") for i, letter in enumerate(letters)])[1]

    assert said("TLLLT") == "3 of 4 limbs that should be seen are lost"
    assert said("TLLUU") == "2 of 2 limbs that should be seen are lost"
    assert said("TLUUU") == "limb1 lost"  # one alone does not tell of the body
    assert said("TLDUD") == "limb1 lost" and said("TTDUD") == "limb2, limb4 uncertain" and said("TTTUU") == "limb3, limb4 unseen"
    assert said("LTTTT") == "limb0: why" and said("UUU") == "no camera sees the body where it is expected"
    assert said("UTT") == "limb0 unseen"


def test_outlines_are_compared_with_those_of_sets_in_which_silhouettes_help_as_much():
    """In clothes of the wall's colors nothing but a silhouette finds an outline; that points said where it is, is remembered."""
    judge, sure = LimbJudge(MODEL, StatusConfig()), np.full(len(NAMES), -6.0)
    judge.update(evidence(0.9), STATE, None, sure, True)
    assert statuses(told(judge, evidence(0.15), 5)) == {}
    assert judge.odds(1, np.zeros(4)) < 7.3 / 2.0  # an outline that is hardly ever found says little
    unknown = LimbJudge(MODEL, StatusConfig())
    assert statuses(told(unknown, evidence(0.9))) == {}
    assert set(statuses(told(unknown, evidence(0.15), 5)).values()) == {LimbStatus.LOST}


def test_what_is_narrower_than_its_contours_are_told_apart_is_not_tracking():
    judge = LimbJudge(MODEL, StatusConfig())
    reports = told(judge, evidence(), 3)
    assert {each.status for each in reports.values()} == {LimbStatus.TRACKING}
    assert not statuses(told(judge, evidence(), px_per_m=50.0))  # forearms of 4 pixels
    narrow = told(judge, evidence(), px_per_m=25.0)
    assert statuses(narrow) == dict.fromkeys(NAMES[1:2] + NAMES[3:4], LimbStatus.DEGRADED)
    assert narrow["left_forearm"].reason == "it is 1.8 pixels wide"


def test_a_limb_of_which_one_camera_alone_sees_enough_is_degraded_unless_points_or_joints_are_told():
    judge, seen = LimbJudge(MODEL, StatusConfig()), evidence()
    forearm = judge_limb("left_forearm").shapes
    seen.expected[1:, forearm] *= 0.2
    seen.close[1:, forearm] *= 0.2
    for _ in range(3):
        reports = told(judge, seen)
        assert statuses(reports) == {"left_forearm": LimbStatus.DEGRADED}
        assert reports["left_forearm"].reason == "one camera alone sees its outline"
        assert judge.part_weights(tuple(reports.values())).all()  # it goes on to be learned
    assert not statuses(told(judge, seen, told_joints=True))
    assert not statuses(told(judge, seen, others=np.full(len(NAMES), -6.0)))
    assert not statuses(told(judge, seen))  # two have seen it just now
    assert statuses(told(judge, seen)) == {"left_forearm": LimbStatus.DEGRADED}
    seen.expected[1, forearm] *= 2.0
    assert not statuses(told(judge, seen))


def test_of_a_body_before_one_camera_nothing_is_tracking():
    one = PartEvidence(*(getattr(evidence(), field.name)[:1] for field in fields(PartEvidence)))
    assert statuses(told(LimbJudge(MODEL, StatusConfig()), one)) == dict.fromkeys(NAMES, LimbStatus.DEGRADED)


def test_a_limb_that_is_mostly_hidden_is_degraded_unless_what_is_in_view_is_found():
    """What is left of an outline lies on another one by chance."""
    judge, seen, clear = LimbJudge(MODEL, StatusConfig()), evidence(0.7), evidence(0.9)
    assert not statuses(told(judge, seen, 5))
    for each in (seen, clear):
        forearm = judge_limb("left_forearm").shapes
        each.expected[:, forearm] *= 0.5
        each.close[:, forearm] *= 0.5
    reports = told(judge, seen)
    assert statuses(reports) == {"left_forearm": LimbStatus.DEGRADED}
    assert reports["left_forearm"].reason == "50 % of its outline is in view"
    assert not judge.part_weights(tuple(reports.values()))[forearm].any()  # what it lies on may be another thing
    assert not statuses(told(judge, clear)) and not statuses(told(judge, seen, told_joints=True))
    seen.expected[2:], seen.close[2:] = 0.0, 0.0  # by half of the cameras as much as by all
    seen.expected[:2, forearm] *= 2.0
    seen.close[:2, forearm] *= 2.0
    assert not statuses(told(judge, seen))
    judge.reset()  # another body, or another place
    seen.expected[:, forearm] *= 0.5
    assert not statuses(told(judge, seen, 5))
