"""Parts of the contour experiments that track nothing: changes of variables, figures of valleys and runs, what is compared."""

from types import SimpleNamespace

import numpy as np
import pytest

from tracker_node.experiments.contour import clips, experiment, figures, tracking
from tracker_node.experiments.plots import Profile
from tracker_node.model.configuration import Configuration, State
from tracker_node.tracking.config import TrackerConfig


def test_changes_have_the_truth_in_their_middle():
    variable = tracking.Variable("x", "mm", 150.0, 2.0)
    assert variable.changes(1).tolist() == list(range(-150, 151, 2))
    assert variable.changes(10).tolist() == [20.0 * i for i in range(-7, 8)]
    assert variable.si == 1e-3
    assert tracking.Variable("a", "deg", 40.0, 1.0).si == pytest.approx(np.pi / 180.0)


def test_profiles_are_averaged_at_each_change():
    changes = np.array([-1.0, 0.0, 1.0])
    mean = tracking.mean_profile([Profile(changes, np.array([3.0, 1.0, 5.0])), Profile(changes, np.array([5.0, 2.0, 1.0]))])
    assert mean.changes is changes
    assert mean.scores.tolist() == [4.0, 1.5, 3.0]


def test_valleys_are_told_by_their_means_and_the_shortest_rise():
    changes = np.arange(-50.0, 51.0, 10.0)
    left = Profile(changes, np.abs(changes + 10.0) / 10.0)  # lowest at -10
    right = Profile(changes, np.abs(changes - 20.0) / 10.0)  # at 20, rising for 30 to the end
    found = tracking.valley_metrics("p", "mm", [left, right])
    assert set(found) == {"p.minimum_off_mm", "p.flat_mm", "p.rising_mm"}
    assert found["p.minimum_off_mm"] == pytest.approx(15.0)
    assert found["p.rising_mm"] == pytest.approx(30.0)
    assert tracking.valley_metrics("p", "mm", [left])["p.rising_mm"] == pytest.approx(40.0)


def test_what_is_compared_is_with_over_without():
    """Of the sliding term: iterations, their ratio, and errors, for each kind of distance."""
    clip = SimpleNamespace(config=TrackerConfig())
    asked = []

    def measure(config):
        asked.append(config)
        return (4.0, 20.0) if len(asked) % 2 else (10.0, 25.0)

    found = tracking._ablated(clip, "c", measure)
    for distances in ("sum", "split"):
        prefix = f"contours.c.sliding_{distances}"
        assert [found[f"{prefix}.iterations_{key}"] for key in ("with", "without", "ratio")] == [4.0, 10.0, 2.5]
        assert [found[f"{prefix}.mpjpe_{key}_mm"] for key in ("with", "without")] == [20.0, 25.0]
    assert len(found) == 10
    assert asked[0] != asked[1]


def test_true_sets_are_spread_over_the_clip_without_its_ends(tmp_path, monkeypatch):
    rows = [SimpleNamespace(values=np.arange(6.0) + i) for i in range(11)]
    monkeypatch.setattr(tracking, "read_states", lambda path: SimpleNamespace(rows=rows))
    clip = SimpleNamespace(folder=tmp_path, sets_at=lambda numbers: numbers)
    states, numbers = tracking._true_sets(clip, 4)
    assert numbers == [2, 4, 6, 8]
    assert [state.T_world_root[0, 3] for state in states] == [2.0, 4.0, 6.0, 8.0]
    assert tracking._true_sets(clip, 1)[1] == [5]


@pytest.mark.parametrize("thickness", [1.0, 0.8])
def test_the_part_is_as_thick_as_it_is_told_to_be(thickness):
    """Half a meter long from its root; at height z its half axes are 0.08 and 0.07 m times 1 - 0.55 z."""
    model = experiment.part_model(thickness)
    (shape,) = model.shapes
    cone = shape.primitive
    assert (cone.a, cone.b) == pytest.approx((0.08 * thickness, 0.07 * thickness))
    assert (cone.k, cone.z1, cone.z2) == (-0.55, 0.0, 0.5)
    assert Configuration(model, State.neutral(model)).Ts_world_shape[0] == pytest.approx(np.eye(4))
    assert [title for title, _ in experiment.MODELS.values()] == ["a model of its size", "a model a fifth thinner"]
    assert [share for _, share in experiment.MODELS.values()] == [1.0, 0.8]


def sequence_numbers(n, monkeypatch):
    asked = []
    monkeypatch.setattr(figures, "_sequence", lambda clip, run, camera, numbers: (asked.extend(numbers), ([], []))[1])
    clip = SimpleNamespace(rig=SimpleNamespace(cameras=["first"]), name="c")
    assert figures.sequence_figures(None, clip, SimpleNamespace(estimates=[None] * n)) == []
    return asked


def test_six_time_steps_are_shown_of_the_whole_clip(monkeypatch):
    assert sequence_numbers(60, monkeypatch) == [5, 16, 27, 37, 48, 59]
    assert sequence_numbers(3, monkeypatch) == [0, 1, 2]


def test_a_shot_is_of_the_pose_before_and_the_one_found(monkeypatch):
    states = [State(np.eye(4), np.zeros(0)) for _ in range(3)]
    taken = []
    monkeypatch.setattr(
        figures, "shoot", lambda camera, image, before, found, *_: taken.append((before.state, found.state)) or "shot"
    )
    camera = SimpleNamespace(name="a")
    clip = SimpleNamespace(backgrounds={"a": np.zeros(1)}, model=experiment.part_model(), config=TrackerConfig())
    run = SimpleNamespace(estimates=[SimpleNamespace(state=state) for state in states])
    image_set = SimpleNamespace(get=lambda name: SimpleNamespace(bgr=np.zeros((2, 2, 3))))
    assert figures._shot(clip, run, camera, 2, image_set) == "shot"
    assert figures._shot(clip, run, camera, 0, image_set) == "shot"
    (before, found), (first, same) = taken
    assert before is states[1]
    assert found is states[2]
    assert first is same is states[0]
    assert figures._shot(clip, run, camera, 1, SimpleNamespace(get=lambda name: None)) is None
    clip.backgrounds = {}
    assert figures._shot(clip, run, camera, 1, image_set) is None


def test_recordings_are_kept_by_name_and_length(tmp_path, monkeypatch, capsys):
    made = []
    monkeypatch.setattr(clips, "produce", lambda request, folder, progress: made.append(folder) or len(made) == 1)
    assert clips.rendered("cones", clips.Request(n_images=60), tmp_path) == tmp_path / "cones-60"
    assert "rendered into" in capsys.readouterr().err
    assert clips.rendered("kick", clips.Request(), tmp_path) == tmp_path / "kick"
    assert "found in" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("motions", "small", "name", "motion", "n_images"),
    [(None, False, "mannequin_swing", "swing", 60), ("folder", False, "mannequin_spinkick", "spinkick", None),
     ("folder", True, "mannequin_swing", "swing", 6), (None, True, "mannequin_swing", "swing", 6)],
)  # fmt: skip
def test_the_mannequin_swings_where_there_are_no_captured_motions(tmp_path, monkeypatch, motions, small, name, motion, n_images):
    asked = []
    monkeypatch.setattr(clips, "rendered", lambda name, request, cache: asked.append((name, request)) or cache / name)
    monkeypatch.setattr(clips, "synthetic_clip", lambda folder, name: (folder, name))
    assert clips.mannequin_clip(tmp_path, motions, small)[1] == name
    ((rendered, request),) = asked
    assert rendered == (f"small_{name}" if small else name)
    assert (request.motion, request.n_images) == (motion, n_images)
    assert (request.scene.n_cameras == 3 and request.scene.width == 320) == small
