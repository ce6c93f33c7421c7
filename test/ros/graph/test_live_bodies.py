"""Several bodies in one graph: topics and services of each, and the same states as offline."""

import json
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticStatus
from std_srvs.srv import Trigger
from tracker_msgs.srv import SetState

from helpers.cameras.two_people import MODELS, write_recording
from helpers.ros.processes import Process
from tracker_node.cli.main import main
from tracker_node.loaders.bag.images import stamp_ns_of
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.runs.load import load_run

N = 5


@pytest.fixture(scope="module")
def two_people(tmp_path_factory) -> Path:
    recording = write_recording(tmp_path_factory.mktemp("two"), N)
    recording.write_text(recording.read_text().replace("_start.yaml}", "_start.yaml, evaluate: {}}"))
    return recording


@pytest.mark.long
def test_live_states_of_all_bodies_are_those_of_an_offline_run(two_people, tmp_path):
    pipeline = Process("pipeline", str(two_people), "--output", str(tmp_path / "live"))
    assert pipeline.process.wait(240) == 0, pipeline.text
    with BagReader(tmp_path / "live/bag") as live:
        first_ns = min(stamp_ns_of(message.header.stamp) for _, message in live.decoded("/tracker/one/state"))
        again = ["--output", str(tmp_path / "offline"), "--base-stamp-ns", str(first_ns), "--quiet"]
        assert main(["track", str(two_people), *again]) == 0
        for name in MODELS:
            sources = (tmp_path / "live" / name / "report.html").read_text()
            assert str(tmp_path / "live" / name) in sources and (tmp_path / "offline" / name / "report.html").exists()
            with BagReader(tmp_path / "offline" / name / "bag") as offline:
                before = [message for _, message in live.decoded(f"/tracker/{name}/state")]
                after = [message for _, message in offline.decoded("/tracker/state")]
            assert len(before) == len(after) == N
            for one, other in zip(before, after, strict=True):
                np.testing.assert_array_equal(one.values, other.values)
                assert (one.status, one.score, one.model) == (other.status, other.score, MODELS[name].name)
        together = [message for _, message in live.decoded("/tracker/bodies")]
        assert [list(message.names) for message in together] == [list(MODELS)] * N
        said = json.loads((tmp_path / "live/run.json").read_text())["bodies"]
        assert list(said) == list(MODELS) and {each["image_sets"] for each in said.values()} == {N}
        found = load_run(tmp_path / "live" / name)
        np.testing.assert_array_equal(found.values, [message.values for message in before])
        assert main(["export", str(tmp_path / "live" / name), "--output", str(tmp_path / f"{name}.trc")]) == 0
        assert [int(message.status[1]) for message in together] == [message.status for message in before]
        topics = set(live.topics)
    assert not {"/tracker/state", "/robot_description"} & topics
    assert {f"/{name}/robot_description" for name in MODELS} <= topics


def test_each_body_is_asked_by_its_name(two_people, probe, launch):
    tracker = launch("tracker", "--rig", two_people.parent / "rig.yaml", "--bodies", two_people)
    probe.until_known("tracker")
    for name, model in MODELS.items():
        answer = probe.ask(SetState, f"tracker/{name}/set_state", SetState.Request(dof_names=["root_x"], values=[0.4]))
        assert answer.success, answer.message
        answer = probe.ask(SetState, f"tracker/{name}/set_state", SetState.Request(dof_names=["tail"], values=[0.4]))
        assert not answer.success and "tail" in answer.message and model.chain.dof_names[0] in answer.message
        assert probe.ask(Trigger, f"tracker/{name}/reinitialize", Trigger.Request()).success
    assert probe.ask(Trigger, "tracker/reset", Trigger.Request()).success
    probe.spin_until(lambda: "tracker: lifecycle" in probe.diagnostics, "the diagnostics")
    assert probe.diagnostics["tracker: lifecycle"].level == DiagnosticStatus.OK
    tracker.interrupt()
    assert tracker.wait() == 0, tracker.err


def test_mistakes_in_bodies_of_a_node_are_said(two_people, tmp_path, capsys):
    rig, start = str(two_people.parent / "rig.yaml"), str(two_people.parent / "one_start.yaml")
    alone = two_people.parent / "alone.yaml"
    alone.write_text("rig: rig.yaml\nmodel: one.yaml\noutput: out\n")
    own = two_people.parent / "own.yaml"
    (two_people.parent / "config.yaml").write_text("")
    own.write_text("rig: rig.yaml\noutput: out\nbodies: {one: {model: one.yaml, config: config.yaml}}\n")
    for arguments, said in [
        (["--bodies", str(alone)], "field 'bodies': expected several bodies by name"),
        (["--bodies", str(own)], "field 'bodies.one.config': expected nothing: a node has one set of parameters"),
        (["--bodies", str(two_people), "--initial-state", start], "--initial-state"),
        (["--bodies", str(two_people), "--wait-for", "nobody/state=1"], "'--wait-for': expected topics of one, other"),
    ]:
        assert main(["tracker", "--rig", rig, *arguments]) == 2
        assert said in capsys.readouterr().err


@pytest.mark.long
def test_joint_states_of_a_robot_are_not_those_of_several_bodies(two_people):
    bodies = ["--rig", str(two_people.parent / "rig.yaml"), "--bodies", str(two_people)]
    tracker = Process("tracker", *bodies, "--end-on-failure", "--ros-args", "-p", "joint_states:=/joints")
    assert tracker.process.wait(120) == 2 and "'joint_states': expected nothing beside several bodies" in tracker.text
