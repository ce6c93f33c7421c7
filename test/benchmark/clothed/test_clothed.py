"""The benchmark of clothed people: what it prints, and a small clip from end to end, its points from the truth."""

import json
from pathlib import Path

import numpy as np
import pytest

from benchmark.clothed import _people, clothed
from benchmark.clothed._clip import write_clip
from benchmark.clothed._disturbed import Decisions, covered_sets, covers_of, wrong_limb
from benchmark.clothed._judged import LimbCounts
from benchmark.clothed._recording import ENDS, JOINTS, default_folders, limbs_shown, load_clip
from benchmark.clothed._runs import CONTOURS, POINTS, TOGETHER, Run, limbs_of
from benchmark.clothed._staging import Sources, set_stage
from benchmark.clothed._starts import Trial, first_rows
from tracker_node.model.configuration import Configuration
from tracker_node.model.humans.keypoints import BLAZEPOSE
from tracker_node.observation.keypoints.blazepose import NAMES, BlazePoseFiles
from tracker_node.observation.keypoints.people import Person
from tracker_node.tracking.estimate import LimbReport, LimbStatus, Status

SOURCES = Sources(Path("none"), None, body="mannequin", motion="guard")
SETS = 3


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Of a small clip."""
    path = tmp_path_factory.mktemp("clips") / "clip_1"
    write_clip(set_stage(1, SOURCES, n_images=SETS, scale=0.5), path)
    return path


@pytest.fixture(scope="module")
def clip(folder):
    return load_clip(folder)


def run_of(name, kind, off_m):
    truth = np.random.default_rng(1).normal(size=(30, len(JOINTS), 3))
    found = truth + off_m * np.random.default_rng(2).normal(size=truth.shape)
    said, limbs = np.full(30, int(Status.TRACKING)), np.ones((30, 4), dtype=int)
    variances = np.full(truth.shape, off_m**2)
    return Run(name, kind, np.arange(30), truth, found, variances, said, limbs, np.full(30, 20.0), np.full(30, 60.0), [], [])


@pytest.fixture
def found():
    made = clothed.Found(decisions=Decisions(200, 1, 1, 0), trials=[Trial(3, True, 0.5, 0, 20.0, 40.0)])
    for name in ("jump", "clip_1"):
        for kind, off_m in ((TOGETHER, 0.01), (POINTS, 0.02), (CONTOURS, 0.04)):
            made.runs[kind].append(run_of(name, kind, off_m))
            made.limbs[kind, name] = LimbCounts(10, 1, 0, 90, 2, 0, 80, 76)
    return made


def test_keys(found, capsys):
    figures = clothed.figures_of(found, "full")
    assert figures["clothed_jump.mpjpe12_mm"] == pytest.approx(16.0, abs=0.5)
    for name in ("clothed_jump", "clothed_jump_points", "clothed_clip_1_contours"):
        for key in ("mpjpe12_mm", "offset_free12_mm", "lost_limbs", "lost_sets", "first_state_set", "wrong_called_tracking"):
            assert f"{name}.{key}" in figures
    assert figures["clothed.wrong_limb_sets"] == 40  # not those of points alone
    assert figures["clothed.wrong_called_tracking"] == pytest.approx(0.1)
    assert figures["clothed.right_called_tracking"] == pytest.approx(0.95)
    assert figures["clothed.within_2_sigma"] == pytest.approx(0.95, abs=0.02)
    assert figures["clothed.together_over_best"] == pytest.approx(0.5, abs=0.03)
    assert figures["points.swaps_wrong"] == 0.01 and figures["start_clothed.cpu_s"] == 0.5
    assert figures["clothed.set_ms"] == 20.0 and figures["clothed.network_ms"] == 60.0
    clothed.print_table(found)
    assert "jump" in capsys.readouterr().out


def test_keys_of_another_network_are_others(found):
    full, heavy = clothed.figures_of(found, "full"), clothed.figures_of(found, "heavy")
    assert len(full) == len(heavy) and not full.keys() & heavy.keys()
    assert {"clothed_heavy_jump.mpjpe12_mm", "points_heavy.swaps_wrong", "start_clothed_heavy.fraction"} <= heavy.keys()


def test_a_limb_of_a_lost_body_is_lost():
    class Estimate:
        limbs = (LimbReport("left_hand", LimbStatus.DEGRADED, "", 0.3), LimbReport("head", LimbStatus.LOST, "", 1.0))

    estimate = Estimate()
    for status, expected in (
        (Status.TRACKING, [2, 1, 1, 1]), (Status.LOST, [3, 3, 3, 3]), (Status.INITIALIZING, [0, 0, 0, 0]),
    ):  # fmt: skip
        estimate.status = status
        assert limbs_of(estimate) == expected


def test_the_body_of_a_clip_suits_its_truth(clip):
    assert len(clip) == SETS and clip.truth_m.shape == (SETS, 12, 3)
    joints = Configuration(clip.model, clip.start()).landmarks_world[[clip.model.landmark_index(name) for name in JOINTS]]
    assert np.linalg.norm(joints - clip.truth_m[0], axis=1).max() < 0.04


def test_limbs_behind_a_board_are_not_shown(clip):
    shown = limbs_shown(clip, [0])
    assert shown.shape == (1, 4) and (shown > 0.3).all()
    covers = covers_of(clip, 1, 0)
    covered = limbs_shown(clip, [0], [covers])
    assert covered[0, 1] < 0.6 * shown[0, 1] and (covered <= shown).all()
    plain, board = clip.image_set(0), next(covered_sets(clip, 1, range(1), range(1)))
    for before, after, cover in zip(plain.images, board.images, covers, strict=True):
        rows, columns = np.nonzero((before.pixels != after.pixels).any(axis=2))
        assert cover[0] <= columns.min() and columns.max() < cover[2] and cover[1] <= rows.min() and rows.max() < cover[3]


def test_a_limb_that_is_put_wrong_is_the_only_one(clip):
    state = clip.start()
    wrong = wrong_limb(clip, state, 0, np.random.default_rng(4))
    off = [
        np.linalg.norm(np.diff([Configuration(clip.model, s).landmarks_world[clip.model.landmark_index(JOINTS[j])] for s in
                                (state, wrong)], axis=0))
        for j in ENDS
    ]  # fmt: skip
    assert off[0] > 0.25 and max(off[1:]) < 1e-9


def test_default_clips_are_those_that_are_there(tmp_path, monkeypatch):
    monkeypatch.setenv("TRACKER_SHARED_DATA", str(tmp_path))
    assert default_folders(tmp_path) == []
    for name in ("clothed_people/box", "clip_2", "clip_9"):
        (tmp_path / name).mkdir(parents=True)
    assert [path.name for path in default_folders(tmp_path)] == ["box", "clip_2"]
    assert clothed.main(["--clips", str(tmp_path / "clip_2" / "none")]) == 2


def test_first_sets_leave_room_for_those_after(clip):
    assert first_rows(clip, 2, 1) == first_rows(clip, 2, 1) == [0, 0]


class PointsOfTruth:
    """A detector that knows where the joints are, and which image it is shown."""

    def __init__(self, clip):
        self._images = {}
        for row in range(len(clip)):
            joints = {name: clip.targets[row][BLAZEPOSE[name].landmark] for name in NAMES if name in JOINTS}
            for camera, image in zip(clip.rig, clip.image_set(row).images, strict=True):
                self._images[image.pixels.tobytes()] = self._person(camera, joints)

    def _person(self, camera, joints):
        pixels, _ = camera.project(np.array(list(joints.values())))
        places, scores = np.tile(pixels.mean(axis=0), (len(NAMES), 1)), np.zeros(len(NAMES))
        for name, place in zip(joints, pixels, strict=True):
            places[NAMES.index(name)], scores[NAMES.index(name)] = place, 0.99
        box = (*pixels.min(axis=0).tolist(), *pixels.max(axis=0).tolist())
        return Person(NAMES, places, np.tile(np.eye(2), (len(NAMES), 1, 1)), scores, 1.0, box)

    def detect(self, image, expected=()):
        person = self._images.get(image.tobytes())
        return () if person is None else (person,)


def test_a_clip_from_end_to_end(folder, clip, tmp_path, monkeypatch, capsys):
    (tmp_path / "weights").write_bytes(b"none")
    monkeypatch.setattr(clothed, "weights_of", lambda size, given: BlazePoseFiles(tmp_path / "weights", tmp_path / "weights"))
    monkeypatch.setattr(_people, "BlazePose", lambda files: PointsOfTruth(clip))
    options = ["--quick", "--clips", str(folder), "--output", str(tmp_path), "--json", str(tmp_path / "figures.json")]
    assert clothed.main([*options, "--only", "trust", "contours"]) == 0
    figures = json.loads((tmp_path / "figures.json").read_text())["metrics"]
    assert figures["clothed_clip_1.first_state_set"] == figures["clothed_clip_1.lost_limbs"] == 0
    assert figures["clothed_clip_1.mpjpe12_mm"] < 40.0 and figures["clothed_clip_1_points.mpjpe12_mm"] < 40.0
    assert figures["points.swaps_images"] > 0 and figures["clothed.together_over_best"] < 3.0
    assert "clip_1, hidden" in capsys.readouterr().err
