"""Trials read from one file: what is said once holds for all, and a mistake is named where it stands."""

from pathlib import Path

import pytest

from tracker_node.errors import FileFormatError, WrongKindOfFileError
from tracker_node.loaders.trials_yaml import load_trials

TRIALS = """output: out/day
common:
  rig: rig.yaml
  sources: "{subject}/{trial}/{name}.mp4"
  images: {start: 2, rate_hz: 60}
subjects:
  anna: {model: anna.yaml}
  ben: {model: ben.yaml, images: {shrink: 2}}
trials:
  walk1: {subject: anna}
  walk2: {subject: ben, images: {start: 5}}
  jump: {subject: ben, sources: {cam1: jump.mp4}, evaluate: {truth: jump.trc}}
"""


@pytest.fixture
def write(tmp_path):
    for name in ("rig", "anna", "ben"):
        (tmp_path / f"{name}.yaml").write_text("")
    (tmp_path / "jump.trc").write_text("")

    def write(text: str) -> Path:
        path = tmp_path / "trials.yaml"
        path.write_text(text)
        return path

    return write


def test_trials_take_what_is_common_then_what_is_the_subjects_then_their_own(write, tmp_path):
    found = load_trials(write(TRIALS))
    assert found.output == tmp_path / "out/day"
    walk1, walk2, jump = found.trials
    assert (walk1.name, walk1.subject, walk1.problem) == ("walk1", "anna", "")
    assert walk1.recording.model == str(tmp_path / "anna.yaml")
    assert walk1.recording.output == str(tmp_path / "out/day/walk1")
    assert walk1.recording.sources == str(tmp_path / "anna/walk1/{name}.mp4")
    images = walk2.recording.images
    assert (images.start, images.rate_hz, images.shrink) == (5, 60, 2)
    assert jump.recording.sources == {"cam1": str(tmp_path / "jump.mp4")}
    assert jump.recording.evaluate.truth == (str(tmp_path / "jump.trc"),)


def test_another_output_may_be_given(write, tmp_path):
    found = load_trials(write(TRIALS), tmp_path / "elsewhere")
    assert found.output == tmp_path / "elsewhere"
    assert found.trials[0].recording.output == str(tmp_path / "elsewhere/walk1")


def test_a_trial_may_have_a_recording_of_its_own(write, tmp_path):
    folder = tmp_path / "own"
    folder.mkdir()
    (folder / "recording.yaml").write_text("{rig: ../rig.yaml, model: ../ben.yaml, output: run, real_time: true}")
    text = TRIALS + "  own: {recording: own/recording.yaml, subject: ben}\n"
    own = load_trials(write(text)).trials[-1]
    assert own.recording.output == str(tmp_path / "out/day/own") and not own.recording.real_time
    assert Path(own.recording.model).resolve() == tmp_path / "ben.yaml" and own.subject == "ben"


@pytest.mark.parametrize(
    ("before", "after", "field", "expected"),
    [
        ("{subject: anna}", "{subject: carl}", "trials.walk1.subject", "one of the subjects, anna, ben"),
        ("{subject: anna}", "{subject: [anna]}", "trials.walk1.subject", "one of the subjects"),
        ("{subject: anna}", "{subject: }", "trials.walk1.subject", "one of the subjects"),
        ("start: 2", "start: -2", "common.images.start", "a whole number, 0 or more"),
        ("shrink: 2", "shrink: 0", "subjects.ben.images.shrink", "a whole number, 1 or more"),
        ("images: {start: 5}", "imges: {start: 5}", "trials.walk2.imges", "'images', or another of"),
        ("  rig: rig.yaml\n", "", "trials.walk1.rig", "a value"),
        ("{subject: anna}", "{subject: anna, output: x}", "trials.walk1.output", "none: results go below the output"),
        ("  walk1:", "  ../walk1:", "trials", "(first a letter or digit; at most 100), not 'failed', got '../walk1'"),
        ("  walk1:", "  failed:", "trials", "not 'failed', got 'failed'"),
        ("  jump:", "  Lauf 3 Käthe:", "trials", "a name of ASCII letters, digits, _ . + - ("),
        ("  jump:", "  Lauf 3 Käthe:", "trials", "got 'Lauf 3 Käthe'"),
        ("  ben:", "  b n:", "subjects", "got 'b n'"),
        ("  walk1:", "  17:", "trials", "a name in quotes where it is a number or a word of YAML, got 17"),
        ("  walk1: {subject: anna}", "  walk1: 3", "trials", "a mapping for each name, as for walk1, got 3"),
        ("  walk2:", "  walk1:", "walk1", "each key once"),
        ("{subject: anna}", "{subject: anna, recording: a.yaml, images: {}}", "trials.walk1.recording", "nothing else but"),
        ("output: out/day\n", "", "output", "a value"),
    ],
)
def test_a_mistake_is_named_where_it_stands(write, before, after, field, expected):
    assert before in TRIALS
    with pytest.raises(FileFormatError) as caught:
        load_trials(write(TRIALS.replace(before, after, 1)))
    assert "trials.yaml" in str(caught.value) and f"field '{field}'" in str(caught.value) and expected in str(caught.value)


@pytest.mark.parametrize(
    ("before", "after", "field", "meant", "of_a_trial"),
    [
        ("{subject: anna}", "{sbject: anna}", "trials.walk1.sbject", "'subject', or another of", True),
        ("{subject: anna}", "{recordingg: own.yaml}", "trials.walk1.recordingg", "'recording', or another of", True),
        ("{model: anna.yaml}", "{modell: anna.yaml}", "subjects.anna.modell", "'model', or another of", False),
        ("  rig: rig.yaml", "  xyz: rig.yaml", "common.xyz", "one of", False),
    ],
)
def test_a_typo_is_answered_with_what_may_stand_there(write, before, after, field, meant, of_a_trial):
    with pytest.raises(FileFormatError) as caught:
        load_trials(write(TRIALS.replace(before, after, 1)))
    assert (caught.value.field, caught.value.expected.partition(" [")[0]) == (field, meant)
    assert ("'recording'" in caught.value.expected, "'subject'" in caught.value.expected) == (of_a_trial, of_a_trial)
    assert not any(f"'{name}'" in caught.value.expected for name in ("output", "real_time", "loop", "joining"))
    assert "'rig'" in caught.value.expected


def test_a_missing_file_is_the_trials_own_problem(write):
    text = TRIALS.replace("{model: anna.yaml}", "{model: nobody.yaml}") + "  own: {recording: none.yaml}\n"
    walk1, walk2, jump, own = load_trials(write(text)).trials
    assert walk1.recording is None and own.recording is None
    assert "field 'subjects.anna.model': expected an existing file" in walk1.problem and "none.yaml" in own.problem
    assert walk2.recording is not None and jump.recording is not None


def test_another_kind_of_file_is_recognized(write):
    with pytest.raises(WrongKindOfFileError, match="this is a recording, not a list of trials"):
        load_trials(write("{rig: rig.yaml, model: anna.yaml, output: x}"))
