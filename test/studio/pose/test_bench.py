"""Fits and scores in the images of a session, whatever their size and the engine."""

import numpy as np
import pytest

from helpers.cameras.small_clip import make_clip
from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.model.configuration import Configuration, State
from tracker_node.studio import images as outlines
from tracker_node.studio.pose.bench import PoseBench
from tracker_node.studio.session import StudioFiles, open_session


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    return make_clip(tmp_path_factory.mktemp("clip"), n_images=16)


def bench_of(clip, config=""):
    path = clip.folder / "bench.yaml"
    path.write_text(config or "threads: 2\n")
    return PoseBench(open_session(StudioFiles(rig=clip.rig_file, model=clip.model_file, config=path)))


def off_mm(clip, state, truth):
    found = Configuration(clip.model, state).landmarks_world - Configuration(clip.model, truth).landmarks_world
    return 1e3 * np.linalg.norm(found, axis=1).max()


@pytest.mark.parametrize(("modality", "score"), [("region", "outline found"), ("color", "colors agree")])
def test_the_engine_of_the_parameters_scores_and_fits(clip, modality, score):
    bench, truth = bench_of(clip, f"modalities: [{modality}]\n"), clip.states[2]
    assert bench.scorer.name == score
    start = State(truth.T_world_root, truth.joint_positions + np.array([0.15, -0.25, 0.25]))
    fitted = bench.fit(start, 2)
    assert off_mm(clip, fitted.state, truth) < 0.5 * off_mm(clip, start, truth)
    assert bench.score(fitted.state, 2).total > bench.score(start, 2).total


def test_large_images_are_made_smaller_for_it(clip, monkeypatch):
    monkeypatch.setattr(outlines, "WORKING_HEIGHT_PX", 80)
    bench, truth = bench_of(clip), clip.states[1]
    assert bench.factor == 2
    image_set = bench.image_set(1)
    assert {image.pixels.shape for image in image_set.images} == {(60, 80, 3)}
    assert bench.score(truth, 1).total > 0.8
    assert off_mm(clip, bench.fit(truth, 1).state, truth) < 30.0


def test_each_set_is_scored_in_its_own_images(clip):
    bench = bench_of(clip)
    chosen = (0, 7, 15)
    totals = np.array([[bench.score(clip.states[k], i).total for k in chosen] for i in chosen])
    assert (totals.argmax(axis=1) == np.arange(3)).all(), totals
    with pytest.raises(FileFormatError, match="below 16"):
        bench.score(clip.states[0], 16)


def test_a_session_without_images_says_why(clip, tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text(clip.rig_file.read_text())  # whose sources lie beside it
    with pytest.raises(TrackerError, match=r"cam01.*no such file"):
        PoseBench(open_session(StudioFiles(rig=rig, model=clip.model_file)))
    with pytest.raises(TrackerError, match="--rig"):
        PoseBench(open_session(StudioFiles(model=clip.model_file)))
