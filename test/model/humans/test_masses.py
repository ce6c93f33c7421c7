"""Masses after de Leva on our bodies: they add up, agree with the center of mass, and grow as they should."""

from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest

from helpers.bodies.bodies import crane, random_state
from tracker_node.cli.main import main
from tracker_node.errors import ModelError
from tracker_node.model.configuration import Configuration, State
from tracker_node.model.humans.human import gait_human, human_model
from tracker_node.model.humans.masses import SEGMENTS, inertials, mass_center, present
from tracker_node.model.humans.measures import HumanMeasures
from tracker_node.model.humans.segments18 import ellipsoid_human

KG = 70.0


def center_of(model, state, masses):
    Ts = Configuration(model, state).Ts_world_link
    places = [Ts[model.chain.link_index(link), :3] @ np.append(own.center, 1.0) for link, own in masses.items()]
    return np.average(places, axis=0, weights=[own.mass for own in masses.values()])


@pytest.mark.parametrize("model", [gait_human(), human_model(), ellipsoid_human()], ids=lambda model: model.name)
def test_masses_add_up_and_agree_with_the_center_of_mass(model):
    masses = inertials(model, KG)
    assert sum(own.mass for own in masses.values()) == pytest.approx(KG)
    state = State.neutral(model)
    by_landmarks = mass_center(model.landmark_names, Configuration(model, state).landmarks_world)
    assert center_of(model, state, masses) == pytest.approx(by_landmarks, abs=0.003)


@pytest.mark.parametrize("seed", range(3))
def test_the_center_follows_the_pose(seed):
    """Of links and of landmarks, a bent trunk included, whose middle the landmarks take on the line from hips to shoulders."""
    model, masses = gait_human(), inertials(gait_human(), KG)
    state = random_state(model, np.random.default_rng(seed), 0.5)
    by_landmarks = mass_center(model.landmark_names, Configuration(model, state).landmarks_world)
    assert np.linalg.norm(center_of(model, state, masses) - by_landmarks) < 0.03


def test_inertias_are_those_of_solids_and_scale_with_mass_and_length():
    small, large = inertials(gait_human(), KG), inertials(gait_human(HumanMeasures.of_stature(1.1 * 1.75)), 2.0 * KG)
    for link, own in small.items():
        values = np.linalg.eigvalsh(own.inertia)
        assert values[0] > 0.0 and values[2] <= values[0] + values[1] + 1e-12, link  # of any solid
        assert large[link].inertia == pytest.approx(2.0 * 1.1**2 * own.inertia, rel=1e-3, abs=1e-9)
        assert large[link].center == pytest.approx(1.1 * own.center, abs=1e-6)
    thigh = small["left_thigh"]
    assert thigh.mass == pytest.approx(0.1447 * KG, rel=1e-3)
    assert np.sqrt(thigh.inertia[0, 0] / thigh.mass) == pytest.approx(0.349 * HumanMeasures().thigh_length, rel=1e-6)


def test_the_parts_of_the_trunk_are_together_his_whole_trunk():
    """Mass and center of table 4's trunk from its three parts; about the transverse axes, too, within the rounding of slabs."""
    masses, model = inertials(human_model(), KG), human_model()
    own, neutral = [masses[link] for link in ("pelvis", "abdomen", "torso")], Configuration(model, State.neutral(model))
    places = [neutral.Ts_world_link[model.chain.link_index(link), :3, 3] for link in ("pelvis", "abdomen", "torso")]
    centers = np.array([place + each.center for place, each in zip(places, own, strict=True)])
    mass = np.array([each.mass for each in own])
    middle, trunk = np.average(centers, axis=0, weights=mass), SEGMENTS[1]
    joints = dict(zip(model.landmark_names, neutral.landmarks_world, strict=True))
    shoulders, hips = (0.5 * (joints[f"left_{name}"] + joints[f"right_{name}"]) for name in ("shoulder", "hip"))
    length = np.linalg.norm(shoulders - hips)
    assert mass.sum() == pytest.approx(trunk.mass * KG, rel=1e-3)
    assert middle == pytest.approx(shoulders + trunk.center * (hips - shoulders), abs=0.004)
    about = sum(each.inertia[1, 1] + m * np.sum((c - middle)[[0, 2]] ** 2) for each, m, c in zip(own, mass, centers, strict=True))
    assert np.sqrt(about / mass.sum()) / length == pytest.approx(trunk.gyration[1], rel=0.06)


def test_who_has_lost_a_foot_weighs_nothing_there():
    model = gait_human()
    kept = tuple(mark for mark in model.landmarks if mark.name not in ("left_heel", "left_big_toe"))
    masses = inertials(replace(model, landmarks=kept), KG)
    assert not {"left_foot", "left_toes"} & set(masses) and sum(own.mass for own in masses.values()) == pytest.approx(KG)
    points = Configuration(model, State.neutral(model)).landmarks_world
    rows = [i for i, mark in enumerate(model.landmarks) if mark in kept]
    assert mass_center([mark.name for mark in kept], points[rows])[1] < 0.0  # to the right
    assert present(()) == () == present([name for name in model.landmark_names if "heel" not in name])


def test_a_body_that_is_no_person_has_none():
    with pytest.raises(ModelError, match="landmarks of a person"):
        inertials(crane(), KG)


def test_urdf_with_masses(capsys):
    assert main(["urdf", "gait_human", "--mass", "70"]) == 0
    links = ElementTree.fromstring(capsys.readouterr().out).findall("link")
    weighed = {link.get("name"): float(link.find("inertial/mass").get("value")) for link in links if link.find("inertial")}
    assert sum(weighed.values()) == pytest.approx(KG) and weighed["left_shank"] == pytest.approx(0.0457 * KG, rel=1e-3)
    shank = next(link for link in links if link.get("name") == "left_shank").find("inertial/inertia")
    assert float(shank.get("ixx")) == pytest.approx(inertials(gait_human(), KG)["left_shank"].inertia[0, 0], rel=1e-6)
    assert main(["urdf", "gait_human", "--mass", "7000"]) == 2
    assert "1 to 500 kilograms" in capsys.readouterr().err
    assert main(["urdf", "yellow_stick", "--mass", "70"]) == 2
