"""The demo over an earlier one: what that left makes room, what is not the demo's stays."""

from argparse import Namespace
from pathlib import Path

import pytest

from tracker_node.cli import demo, sample
from tracker_node.loaders.bag.writer import BagExistsError
from tracker_node.runs.writer import run_of_bag


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with a finished run; in place of tracking anew only its place is looked at, as pipeline does."""
    (tmp_path / "bag").mkdir()
    for name in ("bag/metadata.yaml", "run.json"):
        (tmp_path / name).write_text("{}")
    monkeypatch.setattr(sample, "prepare", lambda folder, fresh: 0)

    def looks(*arguments: str | Path) -> int:
        return 0 if run_of_bag(Path(arguments[-1]) / "bag") else 1

    monkeypatch.setattr(demo, "run_verb", looks)
    return tmp_path


def test_it_runs_again_over_its_own_run_also_where_that_was_killed_early(folder: Path) -> None:
    arguments = Namespace(output=str(folder), fresh=False)
    assert demo.run(arguments) == 0 and list(folder.iterdir()) == []
    (folder / "run.json").write_text("{}")  # written before the first message
    assert demo.run(arguments) == 0


def test_an_offline_run_is_left_as_it_is(folder: Path) -> None:
    (folder / "states.csv").write_text("")
    with pytest.raises(BagExistsError, match=r"states\.csv"):
        demo.run(Namespace(output=str(folder), fresh=False))
    assert (folder / "bag" / "metadata.yaml").exists() and (folder / "run.json").exists()
