"""Which cameras a tracker is made for, with which lenses, and by whom."""

import argparse
from dataclasses import replace

import numpy as np
import pytest

from helpers.ros.held_tracker import HeldTracker
from helpers.ros.samples import small_rig, some_state, tracked_arm
from tracker_node.cli.nodes.tracker import add_arguments, tracker_options
from tracker_node.compiled.ahead import show_progress
from tracker_node.errors import TrackerError
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.ros.tracker.image_inbox import InboxOptions
from tracker_node.ros.tracker.setup import BodyOptions, TrackerMaker, TrackerOptions
from tracker_node.tracking.config import TrackerConfig, from_dict

MODEL = tracked_arm()


@pytest.fixture
def rig(tmp_path):
    rig = small_rig(tmp_path)
    return replace(rig, cameras=tuple(replace(camera, background=None) for camera in rig))


def test_by_default_lenses_are_those_of_the_rig_and_it_starts_by_itself(rig):
    options = TrackerOptions(rig, MODEL)
    assert options.autostart and not options.calibration_from_topics and options.config == TrackerConfig()
    assert options.initial_state is None and options.occluders is None and options.make_tracker is None


def test_only_the_cameras_in_use_are_in_the_rig(rig):
    found = TrackerMaker(TrackerOptions(rig, MODEL)).rig(("cam1", "cam3"))
    assert found.names == ("cam1", "cam3") and found["cam1"].model is rig["cam1"].model


def test_without_the_lens_of_one_camera_in_use_there_is_no_rig(rig):
    maker, lens = TrackerMaker(TrackerOptions(rig, MODEL)), rig["cam1"].model
    other = replace(lens, K=2.0 * lens.K)
    assert maker.rig(("cam1", "cam2"), {"cam1": other}) is None and maker.rig(("cam1",), {}) is None
    found = maker.rig(("cam1", "cam2"), {"cam1": other, "cam2": lens})
    assert found["cam1"].model is other and found["cam2"].model is lens
    assert (found["cam2"].T_world_cam == rig["cam2"].T_world_cam).all()


def test_another_maker_is_given_everything_in_its_order(rig):
    given, tracker, state, config = [], HeldTracker(), some_state(MODEL), TrackerConfig()
    options = TrackerOptions(rig, MODEL, initial_state=state, make_tracker=lambda *args: given.append(args) or tracker)
    maker = TrackerMaker(options)
    maker.prepare(rig.names, config)  # nothing of ours is run
    maker.check(("nobody",), config)
    assert given == [] and maker.tracker(rig, config) is tracker
    assert given == [(rig, MODEL, config, state)]


def test_code_is_made_ready_once_for_each_configuration(rig, monkeypatch):
    warmed, config = [], TrackerConfig()
    other = from_dict({"threads": 1})
    monkeypatch.setattr("tracker_node.ros.tracker.setup.warm_up", lambda *args: warmed.append(args))
    state = some_state(MODEL)
    maker = TrackerMaker(TrackerOptions(rig, MODEL, initial_state=state))
    for wanted in (config, config, other, other):
        maker.prepare(("cam2",), wanted)
    assert [args[2] for args in warmed] == [config, other]
    cameras, *others = warmed[0]
    assert cameras.names == ("cam2",) and others == [MODEL, config, state, None, None, show_progress]


def test_bodies_of_a_recording_have_its_parameters_unless_others_are_given(rig, tmp_path):
    for name in ("rig.yaml", "model.yaml"):
        (tmp_path / name).touch()
    dump_model(MODEL, tmp_path / "model.yaml")
    (tmp_path / "own.yaml").write_text("modalities: [chamfer]\n")
    (tmp_path / "other.yaml").write_text("anna:\n  ros__parameters: {modalities: [color]}\n")
    recording = tmp_path / "recording.yaml"
    said = "rig: rig.yaml\noutput: out\noccluders: model.yaml\nbodies: {one: {model: model.yaml}, two: {model: model.yaml}}\n"
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    parser.set_defaults(ros_args=["-r", "__node:=anna"])

    def found(*more: str) -> TrackerOptions:
        arguments = ["--rig", "rig.yaml", "--bodies", str(recording), *more]
        return tracker_options(parser.parse_args(arguments), rig, InboxOptions())

    recording.write_text(said)
    assert found().config == TrackerConfig() and found().occluders is not None
    recording.write_text(said + "config: own.yaml\n")
    assert found().config.modalities == ("chamfer",)
    assert found("--config", str(tmp_path / "other.yaml")).config.modalities == ("color",)


def test_a_person_without_points_is_refused_before_lenses_are_known(rig):
    bodies = {"one": BodyOptions(MODEL), "two": BodyOptions(MODEL, person=np.zeros(3))}
    maker = TrackerMaker(TrackerOptions(rig, MODEL, bodies=bodies, calibration_from_topics=True))
    with pytest.raises(TrackerError, match=r"two: a person is chosen by points: .* got region"):
        maker.check(rig.names, from_dict({"modalities": ["region"]}))
