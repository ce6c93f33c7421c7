"""``sample`` and ``demo``: with no network, and with everything in the cache."""

import os
from types import SimpleNamespace

import pytest

from helpers.sources.sample import sample_or_skip
from tracker_node.cli.main import main
from tracker_node.cli.sample import prepare, run_verb
from tracker_node.loaders.fetched_files import data_file, fetch_sample
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.recording_yaml import load_recording
from tracker_node.loaders.rig.rig_yaml import load_rig


@pytest.mark.parametrize("command", [["sample", "balancing", "--output"], ["demo", "--output"]])
def test_without_network_and_cache_it_is_said_in_one_line(no_index, tmp_path, capsys, command):
    assert main([*command, str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "pose2sim==0.8.4" in error and "could not be fetched from the package index" in error
    assert "Traceback" not in error and error.count("\n") <= 2
    assert not (tmp_path / "out").exists()


@pytest.mark.long
def test_the_whole_sample(tmp_path, capsys, monkeypatch):
    sample_or_skip()
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    folder = tmp_path / "balancing"
    assert main(["sample", "balancing", "--output", str(folder)]) == 0
    assert "calibrate body" in capsys.readouterr().out
    rig = load_rig(folder / "rig_refined.yaml")
    assert all(os.path.exists(path) for camera in rig for path in (camera.source, camera.background))
    model = load_model(folder / "person.yaml")
    load_state(folder / "initial_state.yaml", model)
    assert load_recording(folder / "recording.yaml").evaluate.masks == str(folder / "masks.json")
    assert "Redistribution and use" in (folder / "LICENSE").read_text()
    # A second run makes nothing anew.
    stamps = {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}
    assert main(["sample", "balancing", "--output", str(folder)]) == 0
    assert stamps == {path: path.stat().st_mtime_ns for path in folder.rglob("*") if path.is_file()}


def test_unknown_samples_are_named():
    with pytest.raises(Exception, match="unknown sample 'juggling'; valid: balancing"):
        fetch_sample("juggling")


# What is fetched and refined takes minutes: these steps are put down here as they are called, and leave their files.


@pytest.fixture
def steps(monkeypatch):
    """Calls of the long steps, in order, as tuples; ``statuses`` by verb and sub-verb are what the verbs return."""
    from tracker_node.calibration import balancing
    from tracker_node.cli import sample
    from tracker_node.loaders import fetched_files

    made, statuses = [], {}

    def copy_files(files, folder):
        made.append(("copy", files, folder))
        folder.mkdir(parents=True, exist_ok=True)

    def write_rigs(folder):
        made.append(("rigs", folder))
        (folder / "rig_refined.yaml").write_text("refined")
        return SimpleNamespace(table=lambda: "refinement")

    def write_backgrounds(folder):
        made.append(("plates", folder))
        (folder / "plates.made").write_text("")

    def write_masks(folder, drawn):
        made.append(("masks", folder, drawn.name))
        (folder / "masks.json").write_text("{}")

    def run_verb(*arguments):
        made.append(("verb", *map(str, arguments)))
        status = statuses.get(arguments[1], 0)
        if not status:
            arguments[arguments.index("-o") + 1].write_text("made")
        return status

    monkeypatch.setattr(fetched_files, "fetch_sample", lambda name: {"from": name})
    monkeypatch.setattr(balancing, "copy_files", copy_files)
    monkeypatch.setattr(balancing, "write_rigs", write_rigs)
    monkeypatch.setattr(balancing, "has_backgrounds", lambda folder: (folder / "plates.made").exists())
    monkeypatch.setattr(balancing, "write_backgrounds", write_backgrounds)
    monkeypatch.setattr(balancing, "write_masks", write_masks)
    monkeypatch.setattr(sample, "run_verb", run_verb)
    return made, statuses


def all_steps(folder, *force):
    person = str(folder / "person.yaml")
    return [
        ("copy", {"from": "balancing"}, folder),
        ("rigs", folder),
        ("plates", folder),
        ("verb", "calibrate", "body", "--trc", str(folder / "static.trc"), "-o", person, *force),
        (
            *("verb", "calibrate", "pose", "--model", person, "--trc", str(folder / "truth.trc"), "--row", "0"),
            *("-o", str(folder / "initial_state.yaml"), *force),
        ),
        ("masks", folder, "balancing_masks.json"),
    ]


def test_all_that_is_missing_is_made_in_order(steps, tmp_path, capsys):
    folder = tmp_path / "clip"
    assert main(["sample", "balancing", "--output", str(folder)]) == 0
    assert steps[0] == all_steps(folder)
    assert (folder / "recording.yaml").read_bytes() == data_file("config/balancing_recording.yaml").read_bytes()
    assert (folder / "tracker.yaml").read_bytes() == data_file("config/balancing.yaml").read_bytes()
    out = capsys.readouterr().out
    said = ("Balancing clip", "Refining the places", "\nrefinement\n", "images of the background")
    assert sorted(map(out.index, said)) == [out.index(text) for text in said]
    assert f"{folder} is ready. Track it, and see how well, with one of\n" in out
    assert f"  tracker_node pipeline {folder}/recording.yaml " in out
    assert f"  tracker_node track {folder}/recording.yaml " in out


def test_what_is_there_is_kept_and_fresh_makes_it_anew(steps, tmp_path, capsys):
    made, _ = steps
    folder = tmp_path / "clip"
    assert prepare(folder) == 0
    targets = ("recording.yaml", "tracker.yaml", "masks.json", "person.yaml", "initial_state.yaml", "rig_refined.yaml")
    for name in targets:
        (folder / name).write_text("the user's own")
    made.clear()
    capsys.readouterr()
    assert prepare(folder) == 0
    assert [step[0] for step in made] == ["copy"]
    assert all((folder / name).read_text() == "the user's own" for name in targets)
    assert "Refining" not in (out := capsys.readouterr().out) and "empty scene" not in out
    made.clear()
    assert main(["sample", "balancing", "--output", str(folder), "--fresh"]) == 0
    assert made == all_steps(folder, "--force")
    assert not any((folder / name).read_text() == "the user's own" for name in targets)


@pytest.mark.parametrize(
    "gone, again",
    [
        ("rig_refined.yaml", ["rigs"]),
        ("plates.made", ["plates"]),
        ("person.yaml", ["body"]),
        ("initial_state.yaml", ["pose"]),
        ("masks.json", ["masks"]),
        ("recording.yaml", []),
        ("tracker.yaml", []),
    ],
)
def test_only_what_is_gone_is_made_again(steps, tmp_path, gone, again):
    made, _ = steps
    prepare(tmp_path)
    (tmp_path / gone).unlink()
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    made.clear()
    assert prepare(tmp_path) == 0
    assert [step[2] if step[0] == "verb" else step[0] for step in made[1:]] == again
    assert (tmp_path / gone).exists() and all(path.stat().st_mtime_ns == stamp for path, stamp in kept.items())


def test_a_body_that_fails_ends_the_sample_with_its_status(steps, tmp_path, capsys):
    made, statuses = steps
    statuses["body"] = 2
    assert main(["sample", "balancing", "--output", str(tmp_path)]) == 2
    assert [step[2] for step in made if step[0] == "verb"] == ["body"]  # no pose of a body that is not there
    assert "is ready" not in capsys.readouterr().out
    statuses.update(body=0, pose=70)
    assert main(["sample", "balancing", "--output", str(tmp_path)]) == 70
    assert [step[2] for step in made if step[0] == "verb"] == ["body", "body", "pose"]
    assert "is ready" not in capsys.readouterr().out


def test_the_folder_is_the_samples_name_unless_said(steps, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["sample", "balancing"]) == 0
    assert (tmp_path / "balancing" / "recording.yaml").exists()


def test_a_verb_is_shown_as_a_user_would_give_it(tmp_path, capsys):
    missing = tmp_path / "two words.mcap"
    assert run_verb("bag", "info", missing) == 2
    said = capsys.readouterr()
    assert said.out == f"$ tracker_node bag info '{missing}'\n"
    assert "two words.mcap" in said.err
