"""What `make` says about a machine that lacks something."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest


@pytest.fixture
def check_system(repository: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location("check_system", repository / "tools/check_system.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def bare_machine(check_system: ModuleType, monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script on a machine without compilers, headers, venv and graphics libraries."""
    monkeypatch.setattr(check_system.shutil, "which", lambda tool: None)
    monkeypatch.setattr(check_system.os.path, "exists", lambda path: False)
    monkeypatch.setattr(check_system.importlib.util, "find_spec", lambda name: None)
    monkeypatch.setattr(check_system, "has_library", lambda *names: False)
    monkeypatch.setattr(check_system, "python_prefix", lambda: "python3")
    return check_system


def test_names_every_missing_package_in_one_line(
    bare_machine: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["check_system.py"])
    assert bare_machine.main() == 1
    line = "sudo apt-get install -y python3-venv python3-dev build-essential libegl1 libgl1-mesa-dri libgl1\n"
    assert line in capsys.readouterr().err


def test_package_list_is_for_machines(
    bare_machine: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["check_system.py", "--packages"])
    assert bare_machine.main() == 0
    assert capsys.readouterr().out.split()[-2:] == ["libgl1", "chromium"]  # the browser is for tests only


def test_osmesa_will_do_instead_of_egl(check_system: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(check_system, "has_library", lambda *names: "libOSMesa.so.8" in names)
    assert check_system.has_offscreen_rendering()


def test_unsupported_python_is_the_only_complaint(
    check_system: ModuleType, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(check_system.sys, "version_info", (3, 13, 0))
    monkeypatch.setattr(check_system.sys, "argv", ["check_system.py"])
    assert check_system.main() == 1
    message = capsys.readouterr().err
    assert "Python 3.11 or 3.12" in message
    assert "3.13" in message
    assert "apt-get" not in message
