"""What /diagnostics says of a tracker does not flip from second to second, and is short."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy", reason="ROS is not installed")

from tracker_node.model.configuration import State
from tracker_node.model.humans.human import human_model
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.ros.diagnostics import OK, WARN
from tracker_node.ros.tracker.diagnostics import LeftOut, TrackerDiagnostics, unobservable_in_short
from tracker_node.ros.tracker.setup import WorkerCounts
from tracker_node.tracking.config import TrackerConfig
from tracker_node.tracking.estimate import Status, unknown_estimate


@pytest.mark.parametrize("pattern", [[2, 0], [1, 0, 0], [3, 3, 0], [0, 0, 0, 6]])
def test_image_sets_left_out_now_and_then_are_said_or_not_but_not_by_turns(pattern):
    judge = LeftOut()
    said = [judge.too_many(30 - n, n) for n in pattern * 20]
    assert sum(one != other for one, other in pairwise(said)) <= 1


def test_too_slow_is_said_at_once_and_taken_back_when_it_keeps_up():
    judge = LeftOut()
    assert not judge.too_many(30, 0) and judge.too_many(20, 10)
    later = [judge.too_many(30, 0) for _ in range(12)]
    assert later[0] and not later[-1] and sum(a != b for a, b in pairwise(later)) == 1


def test_directions_that_images_do_not_tell_are_told_in_short():
    names = [f"left_elbow_pronation_{i} -0.80 left_shoulder_internal_rotation" for i in range(20)]
    said = unobservable_in_short(names)
    assert len(said) < 200 and "20 directions" in said and "left_elbow_pronation_0" in said and "16 more" in said
    assert len(unobservable_in_short([*names, "root rotation about (0.00, 0.71, 0.71)"])) < 100
    assert "of the root" in unobservable_in_short(["root_rz"])
    assert "of the root" not in unobservable_in_short(["root_rz -0.60 torso_turn_left"])  # the pelvis within the body
    assert unobservable_in_short([]) == "the images tell every degree of freedom"


def test_a_camera_whose_stamps_go_back_alone_is_named():
    said, jumps, counters = {}, 0, {"cam1": {"clock_jump": 0}, "cam2": {"clock_jump": 0}}
    formation = SimpleNamespace(clock_jumps=jumps, counters=counters)
    told = TrackerDiagnostics(SimpleNamespace(report=lambda part, level, text, values: said.update({part: (level, text)})), None)

    def clock():
        told._report_clock(SimpleNamespace(formation=formation))
        return said["clock"]

    assert clock() == (OK, "stamps go forward")
    counters["cam1"]["clock_jump"] = 3
    assert clock() == (WARN, "stamps of cam1 went back: left out, the others go on")
    assert clock() == (OK, "stamps go forward")
    counters["cam2"]["clock_jump"], formation.clock_jumps = 3, 1
    assert clock() == (WARN, "stamps went back: tracking has begun again")


def test_who_comes_without_a_name_left_is_a_warning():
    told = {}
    diagnostics = TrackerDiagnostics(SimpleNamespace(report=lambda part, *status: told.update({part: status})), None)
    image_set = ImageSet(5, (CameraImage("cam01", 5, np.zeros((2, 2), np.uint8), "mono8"),))
    worker = SimpleNamespace(turned_away="", absent={}, estimates={}, step_ms=1.0)
    diagnostics.estimated(worker, image_set, 6)
    assert told == {}
    worker.absent = {"person_1": unknown_estimate(5, "has left", State.neutral(human_model()), ("cam01",), 0.0, Status.LOST)}
    worker.estimates = worker.absent
    diagnostics.estimated(worker, image_set, 6)
    assert told["joining"][0] == OK and told["person_1: status"] == (OK, "has left")
    worker.turned_away = "no name is left"
    diagnostics.estimated(worker, image_set, 6)
    assert told["joining"] == (WARN, "no name is left (~/reset frees all)")


def test_each_of_several_bodies_has_what_is_its_own():
    """Also where they have different numbers of degrees of freedom, and the node's model is that of one."""
    models = {"anna": human_model(ankles=True), "person_1": human_model(), "person_2": human_model()}
    told: dict[str, tuple] = {}
    report = lambda part, *status, logged=True: told.update({part: status})  # noqa: E731
    diagnostics = TrackerDiagnostics(SimpleNamespace(report=report), models["anna"])
    cameras, estimates = ("cam01",), {}
    for name, model in models.items():
        estimate = unknown_estimate(5, "", State.neutral(model), cameras, 0.0, Status.LOST if name == "anna" else Status.TRACKING)
        estimates[name] = replace(estimate, information=1e9 * np.eye(model.chain.n_dof))
    absent = {"person_2": estimates["person_2"]}
    counts = WorkerCounts(of_body=Counter(anna=28, person_1=9), lost=Counter(anna=2))
    worker = SimpleNamespace(
        turned_away="", absent=absent, estimates=estimates, step_ms=1.0, counts=counts, models=models
    )
    diagnostics.estimated(worker, ImageSet(5, (CameraImage("cam01", 5, np.zeros((2, 2), np.uint8), "mono8"),)), 6)
    counted = {name: told[f"{name}: status"][2] for name in ("anna", "person_1")}
    assert [counted[name]["image sets tracked"] for name in counted] == [28, 9]
    assert [counted[name]["image sets lost"] for name in counted] == [2, 0]
    diagnostics._report_unobservable(worker)
    assert told["anna: observability"][0] == OK == told["person_1: observability"][0]
    assert told["person_2: observability"] == (OK, "not here") and "observability" not in told


@pytest.mark.parametrize(
    ("period_ms", "takes_ms", "said"), [(33, 50, "the 33 ms"), (100, 50, ""), (100, 120, "the 100 ms"), (20, 30, "the 20 ms")]
)
def test_an_image_set_that_takes_too_long_is_judged_by_the_time_between_the_sets_that_come(period_ms, takes_ms, said):
    """Also where some are missing, and whatever period is configured."""
    told = {}
    diagnostics = TrackerDiagnostics(SimpleNamespace(report=lambda part, *status: told.update({part: status})), None)
    stamps_ns = np.delete(np.arange(60) * period_ms * 1_000_000, [7, 8, 9, 30]).tolist()
    worker = SimpleNamespace(formed_ns=stamps_ns, config=TrackerConfig(), lossless=False)
    for _ in range(30):
        diagnostics._latency_ms.append(60.0)
        diagnostics._processing_ms.append(takes_ms)
    diagnostics._report_times(worker)
    level, message, _ = told["latency"]
    assert level == (WARN if said else OK) and said in message
