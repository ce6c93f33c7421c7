"""Starts compared with each other: who goes on, who wins, and when."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from helpers.cameras.start_scenes import scene, standing
from tracker_node.observation.image_set import ImageSet
from tracker_node.parallel import Workers
from tracker_node.tracking.assessment import Assessment
from tracker_node.tracking.config import InitializationConfig
from tracker_node.tracking.estimate import LimbReport, LimbStatus, Status, Timings, TrackEstimate
from tracker_node.tracking.initialization.detector import Start
from tracker_node.tracking.initialization.initializer import Contest, Initializer, Trial, rivals
from tracker_node.tracking.initialization.initializer import standing as standing_of

SCENE = scene(1)
HERE = standing(SCENE.model, 0.0, 0.0, 0.0)
NEARLY = standing(SCENE.model, 0.02, 0.0, 0.0)
TURNED = standing(SCENE.model, 0.0, 0.0, np.pi)
NO_IMAGES = ImageSet(0, ())


def limb(probability: float) -> LimbReport:
    return LimbReport("arm", LimbStatus.LOST if probability > 0.5 else LimbStatus.TRACKING, "", probability)


def trial(state, log_ratio: float, *lost: float) -> Trial:
    return Trial(state, Assessment(Status.DEGRADED, "", limbs=tuple(limb(p) for p in lost), log_ratio=log_ratio))


@dataclass
class Scripted:
    """Follows a list of (log_ratio, status) instead of a body."""

    script: list[tuple[float | None, Status]]
    log_ratio: float | None = None
    calls: list[str] = field(default_factory=list)

    def reset(self) -> None:
        self.calls.append("reset")

    def set_state(self, state) -> None:
        self.calls.append("set_state")

    def step(self, image_set: ImageSet) -> TrackEstimate:
        self.log_ratio, status = self.script[self.calls.count("step")]
        self.calls.append("step")
        nothing = np.zeros(0)
        return TrackEstimate(
            0, status, "", HERE, nothing, nothing, 0.0, 0.0, (), 0, 0, Timings(0.0, 0.0, 0.0), limbs=(limb(0.0),)
        )  # fmt: skip


def test_a_search_that_fails_again_and_again_pauses_longer_and_longer(monkeypatch):
    made = Initializer(SCENE.rig, SCENE.model, InitializationConfig(interval_sets=2), {}, Workers(1), None, lambda: Scripted([]))
    searched = []

    def find(images, around):
        searched.append(len(searched))
        return [Start(HERE, 0.9)]

    monkeypatch.setattr(made._finder, "find", find)
    monkeypatch.setattr(made._finder, "watch", lambda images: None)
    monkeypatch.setattr(made, "_chosen", lambda *_: [HERE, TURNED])
    refused = []
    after = []
    for _ in range(40):
        assert made.find([], NO_IMAGES, None, lambda states: refused.extend(states) or []) is None
        after.append(len(searched))
    assert made.problem == "the colors that were learned speak against all poses that hold"
    assert refused == [HERE, TURNED] * len(searched)
    assert [after.index(n) for n in range(1, 5)] == [0, 3, 8, 17]  # pauses of 2, 4, 8 and then 16 image sets
    made.stop()
    assert made.find([], NO_IMAGES, None, lambda states: []) is None and len(searched) == after[-1] + 1


def test_likely_lost_limbs_count_less():
    assert standing_of(100.0, [limb(0.0), limb(0.5)]) == pytest.approx(75.0)
    assert standing_of(100.0, []) == 100.0
    assert standing_of(-100.0, [limb(0.9)]) == -100.0  # what is worse than chance does not get better by lost limbs


def test_rivals_are_near_the_best_and_differ_from_it():
    best, copy, other, far = trial(HERE, 100.0), trial(NEARLY, 99.0), trial(TURNED, 90.0), trial(TURNED, 50.0)
    assert rivals(SCENE.model, [far, other, copy, best], 1.8, 3) == [best, other]
    assert rivals(SCENE.model, [other, best], 1.8, 1) == [best]
    assert rivals(SCENE.model, [best, far], 1.8, 3) == [best]
    assert rivals(SCENE.model, [trial(HERE, 100.0, 0.9), trial(TURNED, 90.0, 0.0)], 1.8, 3)[0].state is TURNED


def test_a_start_without_rivals_that_is_tracked_is_taken_at_once():
    only = Scripted([(10.0, Status.TRACKING)])
    won = Contest([only], [HERE], 6).step(NO_IMAGES)
    assert won is not None and won[0] is only and won[1].status is Status.TRACKING
    assert only.calls == ["reset", "set_state", "step"]


def test_a_start_that_looked_right_at_first_loses():
    bright = Scripted([(100.0, Status.DEGRADED)] + [(70.0, Status.DEGRADED)] * 5)
    steady = Scripted([(90.0, Status.DEGRADED)] + [(95.0, Status.TRACKING)] * 5)
    contest = Contest([bright, steady], [HERE, TURNED], 6)
    assert [contest.step(NO_IMAGES) for _ in range(3)] == [None] * 3  # 240 against 280: not yet clear
    won = contest.step(NO_IMAGES)
    assert won is not None and won[0] is steady and won[1].status is Status.TRACKING


def test_the_best_is_taken_when_time_is_up():
    contest = Contest([Scripted([(50.0, Status.DEGRADED)] * 3), Scripted([(52.0, Status.DEGRADED)] * 3)], [HERE, TURNED], 3)
    assert contest.step(NO_IMAGES) is None and contest.step(NO_IMAGES) is None
    won = contest.step(NO_IMAGES)
    assert won is not None and won[0].log_ratio == 52.0 and contest.sets == 3


def test_an_engine_without_sureties_is_believed_at_once():
    won = Contest([Scripted([(None, Status.LOST)])], [HERE], 6).step(NO_IMAGES)
    assert won is not None


def test_starts_that_all_speak_against_themselves_are_still_compared():
    bad = Scripted([(5.0, Status.DEGRADED)] + [(-20.0, Status.LOST)] * 5)
    worse = Scripted([(4.8, Status.DEGRADED)] + [(-30.0, Status.LOST)] * 5)
    contest = Contest([bad, worse], [HERE, TURNED], 4)
    won = None
    while won is None:
        assert len(contest) > 0
        won = contest.step(NO_IMAGES)
    assert won[0] is bad
