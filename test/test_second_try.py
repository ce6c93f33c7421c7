"""What `.ci/run` does with tests that failed: pytest and its cache are the real ones."""

import inspect
import subprocess
import sys
from pathlib import Path

import conftest
import pytest

TESTS = """
from pathlib import Path
import pytest

def test_sound():
    assert Path("tries").open("a").write("x")

@pytest.mark.parametrize("word", ["with a space", "a::b"])
def test_second(word):
    known = Path(word)
    there = known.exists()
    known.touch()
    assert there

def test_never():
    assert Path("mended").exists()
"""


PASSED_SECOND = [f"== passed only at the second try: test_some.py::test_second[{word}]" for word in ("a::b", "with a space")]


@pytest.fixture
def project(tmp_path: Path, repository: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with tests of which one is sound, two pass at the second try, and one passes once a file is there."""
    hook = inspect.getsource(conftest.pytest_sessionfinish)
    (tmp_path / "conftest.py").write_text(f"import pytest\n\n\n{hook}")
    (tmp_path / "test_some.py").write_text(TESTS)
    (tmp_path / "pytest.ini").write_text("[pytest]\n")
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
    return tmp_path


def tries(project: Path, repository: Path, *options: str) -> tuple[int, list[str]]:
    """Both tries; status of the second, and what it says itself."""
    command = [sys.executable, "-m", "pytest", "-o", "cache_dir=c", *options]
    subprocess.run(command, cwd=project, capture_output=True, check=False, timeout=120)
    command = [sys.executable, repository / "tools/second_try.py", "c"]
    done = subprocess.run(command, cwd=project, capture_output=True, text=True, check=False, timeout=120)
    return done.returncode, [line for line in done.stdout.splitlines() if line.startswith("== ")]


@pytest.mark.long
def test_what_passes_only_at_the_second_try_is_named(project, repository):
    (project / "mended").touch()
    status, said = tries(project, repository, "-p", "xdist", "-n", "2", "--dist", "loadfile")
    assert (status, said[1:]) == (0, PASSED_SECOND)
    assert (project / "tries").read_text() == "x"  # what passed is not tried again


def test_what_fails_twice_fails(project, repository):
    status, said = tries(project, repository)
    assert (status, said[1:]) == (1, ["== failed twice: test_some.py::test_never", *PASSED_SECOND])


def test_what_was_not_run_to_the_end_is_not_tried_again(project, repository):
    status, said = tries(project, repository, "no_such_file.py")
    assert status == 1 and "no second try" in said[0]
