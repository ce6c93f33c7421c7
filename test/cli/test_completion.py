"""Shells complete verbs, sub-verbs, options and choices by the script that ``completion`` prints."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tracker_node.cli.completion import SHELLS
from tracker_node.cli.groups import calibrate
from tracker_node.cli.main import main, verbs

ASK = """
source "$PWD/bin/tracker_node.bash"
COMP_WORDS=({words}); COMP_CWORD={current}; COMP_LINE='{line}'; COMP_POINT={point}; COMP_TYPE=9
$(complete -p tracker_node | grep -oP -- '-F \\K\\S+') tracker_node
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.fixture
def folder(tmp_path, capsys) -> Path:
    """With this program as a command, the script for bash, and a file beside them."""
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin/tracker_node"
    program.write_text(f"#!{sys.executable}\nfrom tracker_node.cli.main import main\n\nmain()\n")
    program.chmod(0o755)
    assert main(["completion", "bash"]) == 0
    (tmp_path / "bin/tracker_node.bash").write_text(capsys.readouterr().out)
    (tmp_path / "rig.yaml").touch()
    return tmp_path


def completed(folder: Path, line: str) -> set[str]:
    """What bash offers for the last word of a line, which may be empty."""
    words = [*line.split(), *([""] if line.endswith(" ") else [])]
    asked = ASK.format(
        words=" ".join(f"'{word}'" for word in words), current=len(words) - 1, line=line, point=len(line)
    )
    path = f"{folder / 'bin'}{os.pathsep}{os.environ['PATH']}"
    environment = os.environ | {"PATH": path, "PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run(["bash", "-c", asked], capture_output=True, text=True, cwd=folder, env=environment, check=True)
    assert not done.stderr
    return set(done.stdout.split())


@pytest.mark.parametrize(("line", "offered"), [
    ("tracker_node exp", {"export"}),
    ("tracker_node calibrate in", {"intrinsics"}),
    ("tracker_node export --to ", {"trc", "mot", "sto", "c3d", "bvh", "tum", "csv"}),
    ("tracker_node export out/run --coordinates o", {"opensim"}),
    ("tracker_node export --isb", {"--isb-angles"}),
    ("tracker_node calibrate background --ri", {"--rig"}),
    ("tracker_node --ver", {"--version"}),
    ("tracker_node track --rig ", {"rig.yaml", "bin/"}),
    ("tracker_node nothing --x", set()),
])  # fmt: skip
def test_what_bash_offers(folder, line, offered):
    assert completed(folder, line) == offered


def test_every_verb_and_subverb_is_there(folder):
    assert completed(folder, "tracker_node ") >= set(verbs())
    assert completed(folder, "tracker_node calibrate ") >= {each.name for each in calibrate.SUBVERBS}
    assert completed(folder, "tracker_node completion ") >= set(SHELLS)


@pytest.mark.parametrize("shell", ["zsh", "fish"])
def test_other_shells_read_theirs(shell, tmp_path, capsys):
    path = tmp_path / "script"
    assert main(["completion", shell]) == 0
    path.write_text(capsys.readouterr().out)
    assert "tracker_node" in path.read_text()
    if shutil.which(shell) is None:
        pytest.skip(f"{shell} is not installed")
    subprocess.run([shell, "--no-execute", str(path)], check=True)
