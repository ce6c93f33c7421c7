"""Files that are written whole or not at all."""

import errno

import pytest
from small_disk import limited_files, small_disk

from tracker_node.loaders.whole_file import whole_file, write_whole

__all__ = ["small_disk"]


def test_another_file_takes_the_place_at_the_end_and_not_before(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with whole_file(path, ".part") as draft:
        draft.write_text("new")
        assert path.read_text() == "old" and draft.parent == tmp_path and draft.suffix == ".part"
    assert path.read_text() == "new" and [file.name for file in tmp_path.iterdir()] == ["a.txt"]


def test_whatever_goes_wrong_what_was_there_stays_and_nothing_is_left(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")
    with pytest.raises(KeyError), whole_file(path) as draft:
        draft.write_text("half of it")
        raise KeyError
    with limited_files(1000), pytest.raises(OSError) as caught:
        write_whole(path, "x" * 2000)
    assert caught.value.filename == str(path.resolve()) and caught.value.errno == errno.EFBIG
    assert path.read_text() == "old" and [file.name for file in tmp_path.iterdir()] == ["a.txt"]


def test_a_full_disk(small_disk):
    path = small_disk(1) / "a.txt"
    write_whole(path, "old" * 100_000)
    with pytest.raises(OSError, match="No space left on device") as caught:
        write_whole(path, "new" * 300_000)
    assert caught.value.filename == str(path.resolve())
    assert path.read_text() == "old" * 100_000 and list(path.parent.iterdir()) == [path]


def test_what_is_no_file_is_not_replaced(tmp_path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "null").symlink_to("/dev/null")
    for name in ("folder", "null", "absent/a.txt"):
        with pytest.raises(OSError) as caught:
            write_whole(tmp_path / name, "text")
        assert caught.value.filename == str((tmp_path / name).resolve())
    assert (tmp_path / "null").is_symlink() and sorted(file.name for file in tmp_path.iterdir()) == ["folder", "null"]


def test_the_name_of_another_file_that_fails_is_kept(tmp_path):
    with pytest.raises(FileNotFoundError) as caught, whole_file(tmp_path / "a.txt") as draft:
        draft.write_text((tmp_path / "absent").read_text())
    assert caught.value.filename == str(tmp_path / "absent") and list(tmp_path.iterdir()) == []
