"""Files that are replaced whole, and only ours."""

import os
import subprocess
import sys

import pytest

from tracker_node.errors import FileFormatError, TrackerError
from tracker_node.loaders.owned_folder import OwnedFolder


def write(folder, name, text):
    return folder.write(name, lambda path: path.write_text(text))


def test_our_files_are_replaced_and_removed_also_after_a_restart(tmp_path):
    write(OwnedFolder(tmp_path), "first/1.csv", "a")
    again = OwnedFolder(tmp_path)
    assert write(again, "first/1.csv", "b").read_text() == "b"
    OwnedFolder(tmp_path).remove("first/1.csv")
    assert not (tmp_path / "first/1.csv").exists()


@pytest.mark.parametrize("changed", [False, True])
def test_files_of_others_are_refused_and_stay(tmp_path, changed):
    folder = OwnedFolder(tmp_path)
    if changed:
        write(folder, "joints.csv", "ours")
    (tmp_path / "joints.csv").write_text("theirs")
    with pytest.raises(FileFormatError, match=r"joints\.csv.*move this one away"):
        write(folder, "joints.csv", "new")
    with pytest.raises(FileFormatError):
        folder.remove("joints.csv")
    assert (tmp_path / "joints.csv").read_text() == "theirs"


def test_a_write_that_fails_leaves_the_old_file(tmp_path):
    folder = OwnedFolder(tmp_path)
    write(folder, "a.txt", "old")

    def half(path):
        path.write_text("ne")
        raise OSError("no space left")

    with pytest.raises(OSError, match="no space"):
        folder.write("a.txt", half)
    assert (tmp_path / "a.txt").read_text() == "old"
    assert write(OwnedFolder(tmp_path), "a.txt", "new").read_text() == "new"


def test_killed_between_any_two_writes_the_file_is_whole_and_still_ours(tmp_path):
    program = (
        "import sys; from tracker_node.loaders.owned_folder import OwnedFolder\n"
        "folder = OwnedFolder(sys.argv[1])\n"
        "for i in range(10**9):\n"
        "    folder.write('a.txt', lambda path: path.write_text(f'{i:09}' * 1000))\n"
        "    print(i, flush=True)\n"
    )
    for n in (1, 3, 6):
        writer = subprocess.Popen([sys.executable, "-c", program, str(tmp_path)], stdout=subprocess.PIPE, env=os.environ)
        for _ in range(n):
            writer.stdout.readline()
        writer.kill()
        writer.wait()
        text = (tmp_path / "a.txt").read_text()
        assert len(text) == 9000 and text == text[:9] * 1000
        write(OwnedFolder(tmp_path), "a.txt", text)


def test_two_programs_in_one_folder_know_each_others_files_and_replace_none(tmp_path):
    one, other = OwnedFolder(tmp_path), OwnedFolder(tmp_path)
    write(one, "1.csv", "by one")
    write(other, "2.csv", "by the other")
    write(one, "3.csv", "by one")
    with pytest.raises(FileFormatError, match=r"1\.csv"):
        write(other, "1.csv", "by the other")
    write(one, "1.csv", "by one again")
    later = OwnedFolder(tmp_path)
    for name in ("1.csv", "2.csv", "3.csv"):
        assert write(later, name, "later").read_text() == "later"


def test_programs_that_write_at_once_forget_nothing(tmp_path):
    program = (
        "import sys; from tracker_node.loaders.owned_folder import OwnedFolder\n"
        "folder = OwnedFolder(sys.argv[1])\n"
        "for i in range(20):\n"
        "    folder.write(f'{sys.argv[2]}/{i}.csv', lambda path: path.write_text(sys.argv[2]))\n"
    )
    writers = [
        subprocess.Popen([sys.executable, "-c", program, str(tmp_path), name], env=os.environ) for name in ("one", "other")
    ]
    assert [writer.wait() for writer in writers] == [0, 0]
    later = OwnedFolder(tmp_path)
    for name in ("one", "other"):
        for i in range(20):
            assert (tmp_path / name / f"{i}.csv").read_text() == name
            later.check(f"{name}/{i}.csv")


@pytest.mark.parametrize("text", ["{", "[1]", '{"a": 3}', '{"a": [3]}'])
def test_a_broken_ledger_is_named(tmp_path, text):
    (tmp_path / ".written.json").write_text(text)
    with pytest.raises(FileFormatError, match=r"written\.json"):
        OwnedFolder(tmp_path)


def test_a_folder_is_claimed_by_one_process_until_that_ends_or_dies(tmp_path):
    program = (
        "import sys; from tracker_node.loaders.owned_folder import OwnedFolder\n"
        "with OwnedFolder(sys.argv[1]).claimed():\n"
        "    print('claimed', flush=True); sys.stdin.read()\n"
    )
    for end in (lambda process: process.stdin.close(), lambda process: process.kill()):
        command = [sys.executable, "-c", program, str(tmp_path)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as other:
            assert other.stdout.readline() == "claimed\n"
            with pytest.raises(TrackerError, match=rf"process {other.pid} works in this folder"), OwnedFolder(tmp_path).claimed():
                pass
            end(other)
            other.wait()
            with OwnedFolder(tmp_path).claimed():
                assert (tmp_path / ".claimed").read_text() == f"{os.getpid()}\n"
