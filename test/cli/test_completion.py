"""Shells complete verbs, sub-verbs, options and choices by the script that ``completion`` prints."""

import shutil
import subprocess
from pathlib import Path

import pytest

from tracker_node.cli.arguments.verbs import subverbs
from tracker_node.cli.completion import SHELLS, all_words, script
from tracker_node.cli.main import main, verbs

ASK = """
source {script}
COMP_WORDS=({words}); COMP_CWORD={current}
_tracker_node
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.fixture(scope="module")
def bash(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("completion") / "tracker_node.bash"
    path.write_text(script("bash"))
    return path


def completed(bash: Path, line: str, folder: Path) -> set[str]:
    """What bash offers for the last word of a line, which may be empty."""
    words = [*line.split(), *([""] if line.endswith(" ") else [])]
    program = ASK.format(script=bash, words=" ".join(f"'{word}'" for word in words), current=len(words) - 1)
    done = subprocess.run(["bash", "-c", program], capture_output=True, text=True, cwd=folder, check=True)
    assert not done.stderr
    return set(done.stdout.split())


def test_the_command_prints_the_script(capsys, bash):
    assert main(["completion", "bash"]) == 0
    assert capsys.readouterr().out == bash.read_text()


@pytest.mark.parametrize(("line", "offered"), [
    ("tracker_node exp", {"export"}),
    ("tracker_node calibrate ", set(subverbs("calibrate"))),
    ("tracker_node calibrate in", {"intrinsics"}),
    ("tracker_node export --to ", {"trc", "mot", "sto", "c3d", "bvh", "tum", "csv"}),
    ("tracker_node export out/run --coordinates o", {"opensim"}),
    ("tracker_node export --isb", {"--isb-angles"}),
    ("tracker_node calibrate background --ri", {"--rig"}),
    ("tracker_node completion ", set(SHELLS)),
    ("tracker_node --ver", {"--version"}),
    ("tracker_node export --output ", set()),
    ("tracker_node nothing --x", set()),
])  # fmt: skip
def test_what_bash_offers(bash, tmp_path, line, offered):
    assert completed(bash, line, tmp_path) == offered


def test_every_verb_and_option_is_there(bash, tmp_path):
    assert completed(bash, "tracker_node ", tmp_path) == {*verbs(), "--help", "--version"}
    for words in all_words():
        assert completed(bash, f"tracker_node {words.key} -".replace("  ", " "), tmp_path) == set(words.options), words.key


def test_bash_takes_files_where_nothing_is_offered(bash, tmp_path):
    (tmp_path / "rig.yaml").touch()
    program = f"source {bash}; complete -p tracker_node"
    said = subprocess.run(["bash", "-c", program], capture_output=True, text=True, check=True).stdout
    assert "-o default" in said and "-F _tracker_node" in said


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_read_theirs(shell, tmp_path):
    path = tmp_path / "script"
    path.write_text(script(shell))
    assert "calibrate" in path.read_text() and "--isb-angles".lstrip("-") in path.read_text()
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    subprocess.run([shell, "--no-execute", str(path)], check=True)
