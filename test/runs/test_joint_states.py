"""Joint states from files: what they say moves the fit, and what cannot be read is named."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from helpers.bodies.two_links import two_links
from helpers.cameras.small_clip import make_clip
from tracker_node.cli.main import main
from tracker_node.errors import TrackerError
from tracker_node.loaders.bag.message_types import message_of
from tracker_node.loaders.bag.writer import BagWriter
from tracker_node.loaders.motion.trajectory_file import read_states
from tracker_node.loaders.yaml_file import read_mapping
from tracker_node.model.configuration import State
from tracker_node.model.kinematic_chain import Axis, Following, Joint, KinematicChain
from tracker_node.observation.image_set import ImageSet
from tracker_node.observation.joint_states import JointStates
from tracker_node.runs.joint_states import (
    JOINT_STATE,
    JointStateFile,
    JointStatesBeside,
    load_joint_states,
    positions_of,
    robot_images,
)

SECOND = 1_000_000_000


def table(path, text: str):
    path.write_text(text)
    return JointStateFile(path)


def bag(path, topics=("/joint_states",), names=("bend", "turn")) -> JointStateFile:
    with BagWriter(path) as writer:
        for topic in topics:
            writer.add_topic(topic, JOINT_STATE)
            for k in range(3):
                stamp = {"sec": k, "nanosec": 0}
                content = {"header": {"stamp": stamp, "frame_id": ""}, "name": list(names), "position": [0.1 * k, -0.1 * k]}
                writer.write_message(topic, k * SECOND, message_of(JOINT_STATE, content))
    return JointStateFile(path)


def test_a_table_has_a_column_a_joint_with_its_unit_or_without(tmp_path):
    states = load_joint_states(table(tmp_path / "a.csv", "stamp_ns,mode,bend,turn_rad\n5,x,0.25,\n"), two_links())
    assert states.at(5) == {"bend": 0.25}


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,bend\n0,1\n", "columns starting with stamp_ns"),
        ("stamp_ns,knee\n0,1\n", r"a column for one of 'bend', 'turn', got \"'knee'\""),
        ("stamp_ns,bend\n0,nan\n", "line 2, column 'bend'.*a finite number"),
        ("stamp_ns,bend\n0,1,2\n", "2 columns"),
    ],
)
def test_a_table_that_cannot_be_used_is_named(tmp_path, text, said):
    with pytest.raises(TrackerError, match=said):
        load_joint_states(table(tmp_path / "a.csv", text), two_links())


def test_positions_in_another_unit_are_refused(tmp_path):
    """In degrees most are beyond the limits; a robot may be a little beyond its own."""
    axis = two_links().chain.axes[0]
    reach = axis.upper - axis.lower
    table_of = lambda low, high: table(tmp_path / "a.csv", f"stamp_ns,{axis.name}\n0,{low}\n1,{high}\n2,{high}\n")  # noqa: E731
    with pytest.raises(TrackerError, match=rf"field '{axis.name}'.*between the joint's limits.*degrees\?"):
        load_joint_states(table_of(axis.lower, axis.upper + reach), two_links())
    assert load_joint_states(table_of(axis.lower, axis.upper + 0.1 * reach), two_links()).at(0)


def test_image_sets_of_which_nothing_is_said_are_counted(tmp_path):
    states = load_joint_states(table(tmp_path / "a.csv", f"stamp_ns,bend\n{SECOND},0.1\n{SECOND + 10**7},0.1\n"), two_links())
    beside = JointStatesBeside(states)
    assert beside.with_joint_states(ImageSet(SECOND, ())).joint_positions and beside.note == ""
    beside.with_joint_states(ImageSet(9 * SECOND, ()))
    assert "at the time of 1 of 2 image sets: they are from 1.000 to 1.010 s, images from 1.000 to 9.000 s" in beside.note
    never = JointStatesBeside(states)
    never.with_joint_states(ImageSet(9 * SECOND, ()))
    assert "at the time of any of 1 image sets" in never.note and never.note.endswith("one clock?")


def test_a_joint_that_another_drives_goes_with_it_and_needs_no_word():
    axes = (Axis("leads", (0.0, 0.0, 1.0)), Axis("follows", (0.0, 0.0, 1.0), mimic=Following("leads", -2.0)))
    chain = KinematicChain(("a", "b"), (Joint("b", "a", "b", np.eye(4), axes),))
    model = replace(two_links(), chain=chain, shapes=(), landmarks=())
    states = JointStates()
    states.add(5, [("leads", 0.1)])
    found = robot_images([ImageSet(5, ())], 1, 1, states, ["cam"], State(np.eye(4), np.zeros(2)), model)
    assert found.unsaid == () and found.poses[0][0].tolist() == pytest.approx([0.1, -0.2])


def test_a_bag_is_read_by_its_only_topic_the_usual_one_or_one_that_is_named(tmp_path):
    assert load_joint_states(bag(tmp_path / "a", ["/arm/said"]), two_links()).at(2 * SECOND) == {"bend": 0.2, "turn": -0.2}
    two = bag(tmp_path / "b", ["/other", "/joint_states"])
    assert load_joint_states(two, two_links()).at(0) == load_joint_states(replace(two, topic="other"), two_links()).at(0)
    with pytest.raises(TrackerError, match=r"expected /third of sensor_msgs/msg/JointState, got .*'/joint_states', '/other'"):
        load_joint_states(replace(two, topic="/third"), two_links())
    with pytest.raises(TrackerError, match="expected positions of 'bend', 'turn', got those of 'x', 'y'"):
        load_joint_states(bag(tmp_path / "c", names=("x", "y")), two_links())
    with pytest.raises(TrackerError, match="a CSV file or a bag, got 'nothing'"):
        load_joint_states(JointStateFile(tmp_path / "d"), two_links())


def test_a_message_that_contradicts_itself_is_refused():
    message = SimpleNamespace(name=["bend", "turn"], position=[0.0])
    with pytest.raises(TrackerError, match="a position for each of 2 names, got 1"):
        positions_of(message, ["bend"])
    message.position = [np.nan, 0.5]
    assert positions_of(message, ["bend", "turn"]) == [("turn", 0.5)]
    message.position = [np.nan, np.inf]
    with pytest.raises(TrackerError, match="a number for one of 'bend', 'turn', got none"):
        positions_of(message, ["bend", "turn"])


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return make_clip(tmp_path_factory.mktemp("clip"), 4)


def said(clip, path, off: float, name: str = "elbow_flexion"):
    j = clip.model.chain.axis_index(name)
    rows = [f"{round(k * SECOND / 30)},{state.joint_positions[j] + off:.9f}" for k, state in enumerate(clip.states)]
    path.write_text("\n".join([f"stamp_ns,{name}", *rows]) + "\n")
    return path


def elbow(clip, tmp_path, *options) -> np.ndarray:
    """(n,) how far the elbow is from the truth, rad."""
    output = tmp_path / "run"
    assert main(["track", *clip.arguments(), *map(str, options), "--quiet", "-o", str(output)]) == 0
    states = read_states(output / "states.csv")
    j = states.dof_names.index("elbow_flexion")
    return states.values[:, j] - [s.joint_positions[j - 6] for s in clip.states]


def test_a_robot_that_is_believed_has_its_joints_where_it_says(clip, tmp_path):
    path = said(clip, tmp_path / "said.csv", 0.05)
    config = tmp_path / "config.yaml"
    config.write_text("motion.joint_state_sigma_deg: 0.001\n")
    off = elbow(clip, tmp_path, "--joint-states", path, "--config", config)
    np.testing.assert_allclose(off, 0.05, atol=1e-3)
    again = tmp_path / "again"
    assert main(["track", *clip.arguments(), "--config", str(config), "--from-run-bag", str(tmp_path / "run/bag"), "--quiet",
                 "-o", str(again)]) == 0  # fmt: skip
    assert (again / "states.csv").read_bytes() == (tmp_path / "run/states.csv").read_bytes()
    assert read_mapping(again / "run.json")["options"]["joint_states"] == str(path)


def test_beside_images_it_is_one_of_two(clip, tmp_path):
    alone = elbow(clip, tmp_path)
    beside = elbow(clip, tmp_path / "b", "--joint-states", said(clip, tmp_path / "said.csv", 0.05))
    assert np.abs(alone).max() < 0.05 and (beside > alone).all() and beside.max() < 0.05


def test_what_cannot_go_with_it_is_said(clip, tmp_path, capsys):
    path = said(clip, tmp_path / "said.csv", 0.0)
    command = ["track", *clip.arguments(), "--quiet", "-o", str(tmp_path / "run")]
    assert main([*command, "--joint-states", str(path), "--smooth"]) == 2
    assert "either joint states or smoothing" in capsys.readouterr().err
    assert main([*command, "--joint-states-topic", "/a"]) == 2 and "--joint-states beside it" in capsys.readouterr().err
