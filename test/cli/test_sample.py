"""``sample`` and ``demo``: with no network, and with everything in the cache."""

import io
import os

import pytest

from tracker_node.cli._progress import ByteProgress
from tracker_node.cli.main import main
from tracker_node.loaders import wheel_cache
from tracker_node.loaders.model_yaml import load_model
from tracker_node.loaders.recording_yaml import load_recording
from tracker_node.loaders.rig_yaml import load_rig
from tracker_node.loaders.sample_data import SAMPLES, fetch_sample
from tracker_node.loaders.state_yaml import load_state


@pytest.mark.parametrize("command", [["sample", "balancing", "--output"], ["demo", "--output"]])
def test_without_network_and_cache_it_is_said_in_one_line(no_index, tmp_path, capsys, command):
    assert main([*command, str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert "pose2sim==0.8.4" in error and "could not be fetched from the package index" in error
    assert "Traceback" not in error and error.count("\n") <= 2
    assert not (tmp_path / "out").exists()


@pytest.fixture
def cached_or_network(monkeypatch):
    """The user's own cache when it is full, else the network if TRACKER_NETWORK says so."""
    cache = wheel_cache.cache_folder()
    full = all(wheel_cache._is_good(wheel_cache._cached(cache, member), member) for member in SAMPLES["balancing"])
    if not full and not os.environ.get("TRACKER_NETWORK"):
        pytest.skip(f"the sample is not in {cache}, and TRACKER_NETWORK is not set")
    if full:
        monkeypatch.setenv("PIP_NO_INDEX", "1")


@pytest.mark.long
def test_the_whole_sample(cached_or_network, tmp_path, capsys):
    folder = tmp_path / "balancing"
    assert main(["sample", "balancing", "--output", str(folder)]) == 0
    assert "calibrate body" in capsys.readouterr().out
    rig = load_rig(folder / "rig_refined.yaml")
    assert all(os.path.exists(path) for camera in rig for path in (camera.source, camera.plate))
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


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_rewrites_a_line_on_a_terminal_only():
    terminal, file = Terminal(), io.StringIO()
    for output in (terminal, file):
        progress = ByteProgress(output)
        for done in range(0, 101, 2):
            progress("clip==1.0", done * 10**6, 10**8)
    assert terminal.getvalue().count("\r") == 51 and terminal.getvalue().count("\n") == 1
    assert file.getvalue().count("\n") == 11 and "\r" not in file.getvalue()
    assert "100.0 of 100.0 MB (100 %)" in file.getvalue().splitlines()[-1]
