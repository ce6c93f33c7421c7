"""Fixtures of the tests of the command line."""

import pytest


@pytest.fixture
def no_index(monkeypatch, tmp_path):
    """An empty cache, and a package index that has nothing."""
    monkeypatch.setenv("PIP_NO_INDEX", "1")
    monkeypatch.setenv("PIP_CONFIG_FILE", "/dev/null")
    monkeypatch.delenv("PIP_FIND_LINKS", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
