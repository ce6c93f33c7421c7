"""The robot description that the tracker publishes, read by urdfdom and by kinpy: joints, limits, and where the links are.

robot_state_publisher is not here; urdfdom is its parser, and kinpy moves the links as it does.
"""

import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import kinpy
import numpy as np
import pytest
from lxml import etree

from helpers.bodies.bodies import crane, random_state
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.urdf_writer import urdf_of
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.human import human_model
from tracker_node.model.kinematic_chain import N_ROOT_DOF


def robot_arm(repository):
    return load_model(repository / "config/models/robot_arm.urdf")


def cross(repository):
    return load_model(repository / "config/models/yellow_stick.yaml")


BODIES = {"human": lambda repository: human_model(), "robot_arm": robot_arm, "crane": lambda repository: crane(), "cross": cross}


@pytest.fixture(params=BODIES)
def model(request, repository):
    return BODIES[request.param](repository)


@pytest.mark.parametrize("seed", range(3))
def test_links_are_where_a_third_party_reader_puts_them(model, seed):
    if len(model.chain.links) == 1:
        pytest.skip("kinpy reads no robot without joints; there is nothing to move either")
    state = random_state(model, np.random.default_rng(seed))
    chain = kinpy.build_chain_from_urdf(urdf_of(model))
    names = model.chain.dof_names[N_ROOT_DOF:]
    assert sorted(chain.get_joint_parameter_names()) == sorted(names)
    theirs = chain.forward_kinematics(dict(zip(names, state.joint_positions, strict=True)))
    configuration = Configuration(model, state)
    T_root_world = np.linalg.inv(configuration.Ts_world_link[0])
    for link, T_world_link in zip(model.chain.links, configuration.Ts_world_link, strict=True):
        np.testing.assert_allclose(theirs[link].matrix(), T_root_world @ T_world_link, atol=1e-7)


def test_names_and_limits_are_those_of_the_joint_states(model):
    """robot_state_publisher leaves out joints that it does not know, without an error."""
    robot = ElementTree.fromstring(urdf_of(model))
    joints = {joint.get("name"): joint for joint in robot.findall("joint") if joint.get("type") != "fixed"}
    assert list(joints) == list(model.chain.dof_names[N_ROOT_DOF:])
    for axis in model.chain.axes:
        joint, limit = joints[axis.name], joints[axis.name].find("limit")
        assert {"effort", "velocity"} <= set(limit.attrib)  # urdfdom refuses a limit without them
        if axis.endless:
            assert joint.get("type") == "continuous"
            continue
        assert joint.get("type") == ("prismatic" if axis.prismatic else "revolute")
        assert float(limit.get("lower")) == pytest.approx(axis.lower, abs=1e-8)
        assert float(limit.get("upper")) == pytest.approx(axis.upper, abs=1e-8)


def test_the_human_turns_within_limits_everywhere():
    robot = ElementTree.fromstring(urdf_of(human_model()))
    assert {joint.get("type") for joint in robot.findall("joint")} - {"fixed"} == {"revolute"}
    for limit in robot.iter("limit"):
        assert -7.0 < float(limit.get("lower")) < float(limit.get("upper")) < 7.0


def test_it_is_a_tree_with_one_root(model):
    """What urdfdom asks for: every link but one is a child once, every name is there once."""
    robot = etree.fromstring(urdf_of(model).encode())
    links = [link.get("name") for link in robot.findall("link")]
    children = [child.get("link") for child in robot.iterfind("joint/child")]
    parents = {parent.get("link") for parent in robot.iterfind("joint/parent")}
    assert len(set(links)) == len(links) and len(set(children)) == len(children)
    assert set(links) - set(children) == {model.chain.links[0]}
    assert parents <= set(links) and set(children) <= set(links)


def outline_of(model) -> list[str]:
    """The tree as urdfdom prints it, a line for each child link by its place: ``left_hand child(2)``."""
    children: dict[str, list[str]] = {}
    for joint in ElementTree.fromstring(urdf_of(model)).findall("joint"):
        children.setdefault(joint.find("parent").get("link"), []).append(joint.find("child").get("link"))

    def below(link: str) -> list[str]:
        return [name for child in children.get(link, []) for name in (child, *below(child))]

    return below(model.chain.links[0])


def test_the_parser_of_robot_state_publisher_takes_it(model, tmp_path):
    """urdfdom itself, by its own program."""
    program = Path(sys.executable).parent / "check_urdf"
    (tmp_path / "robot.urdf").write_text(urdf_of(model))
    done = subprocess.run([program, tmp_path / "robot.urdf"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "Successfully Parsed XML" in done.stdout and "Error" not in done.stdout + done.stderr
    assert f"root Link: {model.chain.links[0]}" in done.stdout
    assert sorted(re.findall(r"child\(\d+\): +(\S+)", done.stdout)) == sorted(outline_of(model))
