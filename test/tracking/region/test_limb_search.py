"""Looking for lost limbs, on an objective whose answer is known."""

import numpy as np
import pytest

from tracker_node.model.configuration import Configuration, State
from tracker_node.objective.lines.correspondences import PartEvidence
from tracker_node.objective.normal_equations import NormalEquations
from tracker_node.optimize.fitter import Fitter, Stage
from tracker_node.optimize.levenberg_marquardt import LevenbergMarquardtOptions
from tracker_node.synthesis.subjects.figure import figure_model
from tracker_node.tracking.config import LimbSearchConfig, StatusConfig
from tracker_node.tracking.estimate import LimbReport, LimbStatus
from tracker_node.tracking.limbs.judge import LimbJudge
from tracker_node.tracking.poses import Poses
from tracker_node.tracking.region.limb_modes import PartPose
from tracker_node.tracking.region.limb_search import LimbSearch

MODEL = figure_model()
REST = State.neutral(MODEL)
REACH_M = 0.15  # landmarks farther from where they belong are not felt


class Felt:
    """Landmarks are pulled to where they are in ``truth``, if they are near it; a limb's outline is found there."""

    def __init__(self, truth: State):
        self._truth = Configuration(MODEL, truth).landmarks_world
        self.drawn, self.tried = 0, 0

    def correspond(self, state: State, detail: float) -> "Felt":
        self.drawn += 1
        return self

    def fit_part(self, state: State, dofs: np.ndarray) -> PartPose:
        stages = [Stage(scale, LevenbergMarquardtOptions(3, tolerance=1e-3), dofs=dofs) for scale in (4.0, 2.0, 1.0)]
        found = Fitter(MODEL).fit(state, self, stages).state
        return PartPose(found, self.part_evidence(found, 2.0))

    def linearize(self, state: State) -> NormalEquations:
        body = Configuration(MODEL, state)
        apart = body.landmarks_world - self._truth
        near = np.linalg.norm(apart, axis=1) < REACH_M
        J, r = body.landmark_jacobian()[near].reshape(-1, MODEL.n_dof), apart[near].ravel()
        return NormalEquations(J.T @ J + 1e-9 * np.eye(MODEL.n_dof), J.T @ r, float(r @ r), len(r))

    def part_evidence(self, state: State, close_px: float) -> PartEvidence:
        apart = np.linalg.norm(Configuration(MODEL, state).landmarks_world - self._truth, axis=1)
        shares = np.array([np.exp(-((apart[MODEL.landmark_links == link] / 0.1) ** 2)).mean() for link in MODEL.shape_links])
        expected = np.full((3, len(MODEL.shapes)), 30.0)
        close = expected * shares
        return PartEvidence(expected, expected, close, expected, 12.0 * close, 0.0 * expected, expected - close)

    def gains(self, poses: Poses, shapes: np.ndarray) -> np.ndarray:
        """Hundred cells, in which colors agree the better the nearer the limb's landmarks are to where they belong."""
        own = np.isin(MODEL.landmark_links, MODEL.shape_links[shapes])
        gains = []
        for i in range(len(poses)):
            found = Configuration(MODEL, poses.state(i)).landmarks_world
            gains.append(100.0 * np.exp(-np.linalg.norm(found - self._truth, axis=1)[own] / 0.3).mean())
        self.tried += len(poses)
        return np.stack([np.array(gains), np.full(len(poses), 100.0)], axis=1)


def bent(side: str, flexion_deg: float, elbow_deg: float) -> State:
    angles = REST.joint_positions.copy()
    angles[MODEL.chain.axis_index(f"{side}_shoulder_flexion")] += np.radians(flexion_deg)
    angles[MODEL.chain.axis_index(f"{side}_elbow_flexion")] += np.radians(elbow_deg)
    return State(REST.T_world_root, angles)


def prepared(config: LimbSearchConfig | None = None) -> tuple[LimbJudge, LimbSearch]:
    """A judge that has seen the body well."""
    judge = LimbJudge(MODEL, StatusConfig())
    for _ in range(5):
        judge.update(Felt(REST).part_evidence(REST, 2.0), REST)
    return judge, LimbSearch(MODEL, judge, config or LimbSearchConfig())


def index(judge: LimbJudge, name: str) -> int:
    return [limb.name for limb in judge.limbs].index(name)


def wrist_error(state: State, truth: State) -> float:
    i = MODEL.landmark_index("left_wrist")
    return float(np.linalg.norm((Configuration(MODEL, state).landmarks_world - Configuration(MODEL, truth).landmarks_world)[i]))


@pytest.mark.parametrize("truth", [REST, bent("left", 10.0, -15.0)], ids=["at rest", "near rest"])
def test_a_limb_is_found_and_nothing_else_is_moved(truth):
    judge, search = prepared()
    lost, felt = bent("left", 110.0, -60.0), Felt(truth)
    found = search.recover(search.doubtful(felt.part_evidence(lost, 2.0)), lost, lost, felt)
    assert found is not None and wrist_error(lost, truth) > 0.4 and wrist_error(found, truth) < 0.02
    own = judge.limbs[index(judge, "left_forearm")].dofs
    assert not np.any(found.difference(lost)[~own])
    assert felt.tried <= 1.1 * LimbSearchConfig().poses and felt.drawn <= 3 * LimbSearchConfig().fits


def test_a_limb_is_looked_for_where_it_was_last_sound():
    judge, search = prepared(LimbSearchConfig(poses=1))
    sound = bent("left", 70.0, 20.0)
    i = index(judge, "left_forearm")
    assert search.recover({i: 3.0}, REST, REST, Felt(sound)) is None
    reports = [LimbReport(limb.name, LimbStatus.TRACKING, "", 0.0) for limb in judge.limbs]
    search.remember(sound, reports)
    found = search.recover({i: 3.0}, REST, REST, Felt(sound))
    assert found is not None and wrist_error(found, sound) < 0.01


def test_where_nothing_is_found_nothing_is_changed():
    _, search = prepared()
    far = REST.retract(np.append([3.0, 0.0, 0.0], np.zeros(MODEL.n_dof - 3)))
    assert search.recover({1: 3.0, 2: 3.0}, REST, REST, Felt(far)) is None


def test_a_limb_that_was_looked_for_in_vain_pauses():
    judge, search = prepared(LimbSearchConfig(interval_sets=4))
    lost = bent("left", 110.0, -60.0)
    far = Felt(REST.retract(np.append([3.0, 0.0, 0.0], np.zeros(MODEL.n_dof - 3))))
    evidence, reports = Felt(REST).part_evidence(lost, 2.0), [LimbReport(x.name, LimbStatus.LOST, "", 0.9) for x in judge.limbs]
    i, looked_for = index(judge, "left_forearm"), []
    for _ in range(12):
        doubtful = search.doubtful(evidence)
        looked_for.append(i in doubtful)
        assert search.recover(doubtful, lost, lost, far) is None
        search.remember(lost, reports)
    assert looked_for == [True, True, False, False, False, True, False, False, False, True, False, False]


def test_a_lost_limb_that_was_looked_over_in_vain_pauses_too():
    judge, search = prepared(LimbSearchConfig(interval_sets=4))
    lost = bent("left", 110.0, -60.0)
    far = Felt(REST.retract(np.append([3.0, 0.0, 0.0], np.zeros(MODEL.n_dof - 3))))
    i, reports = index(judge, "left_forearm"), [LimbReport(x.name, LimbStatus.LOST, "", 0.9) for x in judge.limbs]
    paused = []
    for _ in range(8):
        paused.append(search.pauses(i))
        if not paused[-1]:
            assert search.try_elsewhere([i], lost, lost, far) is None
        search.remember(lost, reports)
    assert paused == [False, False, True, True, True, False, True, True]


def test_limbs_that_are_where_they_belong_are_not_in_doubt():
    judge, search = prepared()
    felt, lost = Felt(REST), bent("left", 110.0, -60.0)
    assert not search.doubtful(felt.part_evidence(REST, 2.0))
    assert list(search.doubtful(felt.part_evidence(lost, 2.0))) == [index(judge, "left_forearm")]


def test_a_limb_is_found_far_from_anything_likely():
    _, search = prepared()
    truth, lost = bent("left", 120.0, 30.0), bent("left", -60.0, -15.0)
    felt = Felt(truth)
    found = search.recover(search.doubtful(felt.part_evidence(lost, 2.0)), lost, lost, felt)
    assert found is not None and wrist_error(found, truth) < 0.02


def test_lost_limbs_take_turns():
    judge, search = prepared()
    lost = bent("left", 110.0, -60.0)
    searched: list[tuple] = []

    class Watched(Felt):
        def gains(self, poses, shapes):
            searched.append(tuple(np.flatnonzero(shapes)))
            return np.stack([np.zeros(len(poses)), np.full(len(poses), 100.0)], axis=1)

    far = REST.retract(np.append([3.0, 0.0, 0.0], np.zeros(MODEL.n_dof - 3)))
    for _ in range(4):
        search.recover(dict.fromkeys([1, 2, 3, 4], 3.0), lost, lost, Watched(far))
    assert set(searched) == {tuple(np.flatnonzero(limb.shapes)) for limb in judge.limbs[1:]}


def test_places_that_colors_speak_for_are_followed_beside_that_of_an_unsure_limb():
    judge, search = prepared()
    i, truth = index(judge, "right_forearm"), bent("right", 50.0, 20.0)
    search.look_elsewhere(i, REST, REST, Felt(truth))
    assert search.modes.followed == [i]
    for images in (Felt(truth), Felt(truth)):
        found = search.modes.follow(REST, images.part_evidence(REST, 2.0), images)
    np.testing.assert_allclose(judge.tip(i, found[i]), judge.tip(i, truth), atol=0.02)


def test_a_lost_limb_that_is_not_found_is_followed_where_it_was_and_one_that_is_found_is_not():
    judge, search = prepared()
    i, gone = index(judge, "right_forearm"), bent("right", 50.0, 20.0)
    search.remember(REST, [LimbReport(limb.name, LimbStatus.TRACKING, "", 0.0) for limb in judge.limbs])
    assert search.recover({i: 3.0}, gone, gone, Felt(gone)) is None
    assert search.modes.followed == [i]
    assert search.recover({i: 3.0}, REST, REST, Felt(gone)) is not None
    assert search.modes.followed == []
    search.try_elsewhere([i], REST, REST, Felt(REST))
    assert search.modes.followed == []  # it is where it is taken to be


def poses_tried() -> np.ndarray:
    """(n, n_axes) of a search for an arm."""
    judge, search = prepared()
    start, tried = bent("left", 150.0, 30.0), []

    class Watched(Felt):
        def gains(self, poses, shapes):
            tried.append(poses.joints.copy())
            return super().gains(poses, shapes)

    search.recover({index(judge, "left_forearm"): 3.0}, start, REST, Watched(REST))
    return np.concatenate(tried)


def test_poses_that_are_tried_are_within_the_limits_and_the_same_again():
    first, again = poses_tried(), poses_tried()
    np.testing.assert_array_equal(first, again)
    assert (first >= MODEL.chain.lower - 1e-12).all() and (first <= MODEL.chain.upper + 1e-12).all()


def test_a_trunk_that_is_elsewhere_is_found_with_all_that_hangs_on_it():
    _, search = prepared()
    shift = np.zeros(MODEL.n_dof)
    shift[:6] = 0.08, -0.06, 0.03, 0.0, 0.15, 0.25
    truth = REST.retract(shift)
    found = search.find_trunk(REST, REST, Felt(truth))
    assert found is not None
    before, after = (np.linalg.norm(state.difference(truth)[:6]) for state in (REST, found))
    assert after < 0.6 * before
    np.testing.assert_array_equal(found.joint_positions, REST.joint_positions)
    assert search.find_trunk(truth, REST, Felt(truth)) is None
