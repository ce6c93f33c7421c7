"""The grammar of image sources."""

import argparse
import dataclasses
import json
import sys
from pathlib import Path
from urllib.parse import quote

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker_node.cli.arguments.run_images import named_options
from tracker_node.errors import FileFormatError, SourceError, shown, without_password
from tracker_node.loaders.images.source import list_images, open_source, size_contradiction
from tracker_node.loaders.projects import recordings_in, subfolders
from tracker_node.loaders.rig.capture_yaml import changed_settings, split_change
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.loaders.source_address import SourceAddress, parse_source, relocated, sources_for_child, sources_from_parent
from tracker_node.report.metrics_file import command_line

RIG = """
cameras:
  left:
    image_size: [64, 48]
    K: [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]
    T_world_cam: [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    source: SOURCE
    capture: {pixel_format: MJPG, exposure_us: 4000, gain: 12, controls: {focus_absolute: 30}, publish: jpeg}
"""


@pytest.mark.parametrize(
    ("text", "address", "live"),
    [
        ("videos/cam1.mp4", SourceAddress("file", "videos/cam1.mp4"), False),
        ("file:videos/a b.mp4", SourceAddress("file", "videos/a b.mp4"), False),
        ("file:///data/cam1.mp4", SourceAddress("file", "/data/cam1.mp4"), False),
        ("images/%04d.png", SourceAddress("file", "images/%04d.png"), False),
        ("bag:run/bag", SourceAddress("bag", "run/bag"), False),
        ("bag:run/bag#/left/image_raw", SourceAddress("bag", "run/bag", "/left/image_raw"), False),
        ("v4l2:/dev/v4l/by-id/usb-A_B-video-index0", SourceAddress("v4l2", "/dev/v4l/by-id/usb-A_B-video-index0"), True),
        ("topic:/left/image_raw/compressed", SourceAddress("topic", "/left/image_raw/compressed"), True),
        ("rtsp://user:pw@10.0.0.2:554/h264", SourceAddress("stream", "rtsp://user:pw@10.0.0.2:554/h264"), True),
        ("http://127.0.0.1:8080/?action=stream", SourceAddress("stream", "http://127.0.0.1:8080/?action=stream"), True),
        ("udp://@:5000", SourceAddress("stream", "udp://@:5000"), True),
    ],
)
def test_every_kind_of_source(text: str, address: SourceAddress, live: bool):
    assert parse_source(text) == address and address.is_live is live
    assert parse_source(str(address)) == address


FORMS = (
    "{scheme}://{user}:{secret}@10.0.0.2:554/h264", "{scheme}://{user}:{secret}@10.0.0.2/h264?user={user}&pwd={secret}",
    "{scheme}://10.0.0.2/video?user={user}&password={secret}", "{scheme}://10.0.0.2/video?pwd={secret}&usr={user}&channel=1",
    "{scheme}://10.0.0.2/user={user}_password={secret}_channel=1", "{scheme}://10.0.0.2/a?token={secret}#t=1",
    "{user}:{secret}@10.0.0.2/a",
    "{scheme}:/{user}:{secret}@10.0.0.2/a", "{scheme}:{user}:{secret}@10.0.0.2", "{scheme}://10.0.0.2/live;key={secret};x=1",
)  # fmt: skip
_TEXT = st.text(alphabet="aZ09/@:?#&=%;.,!$'\"*+[]~-_ä", max_size=8)


@given(
    form=st.sampled_from(FORMS), scheme=st.sampled_from(["rtsp", "RTSPS", "http", "https", "srt", "rtmp", "rtps"]), user=_TEXT,
    parts=st.tuples(_TEXT, _TEXT), quoted=st.booleans(), camera=st.sampled_from(["", "left="]),
)  # fmt: skip
def test_no_password_is_shown_in_any_form(form, scheme, user, parts, quoted, camera):
    """Whatever it holds: not itself, and not a piece of it."""
    secret = f"QQ{parts[0]}JJ{parts[1]}XX"
    texts = [quote(text, safe="") if quoted else text for text in (user, secret)]
    text = camera + form.format(scheme=scheme, user=texts[0], secret=texts[1])
    for said in (without_password(text), str(SourceError(text, "no answer")), shown(text)):
        assert not any(piece in said for piece in ("QQ", "JJ", "XX")), said


def test_a_child_gets_sources_where_nobody_else_reads_them(monkeypatch):
    sources = {"left": "rtsp://user:s3@cret@host/a"}
    for name, value in sources_for_child(sources).items():
        monkeypatch.setenv(name, value)
    assert dict(sources_from_parent()) == sources


def test_what_is_kept_of_a_command_line_has_no_password(monkeypatch):
    monkeypatch.setattr(sys, "argv", ["tracker_node", "pipeline", "--source", "left=rtsp://user:s3@cret@host/a"])
    args = argparse.Namespace(**dict.fromkeys(("rig", "model", "initial_state", "occluders", "config")))
    args.source, args.ros_args = [("left", "http://host/a?user=u&pwd=s3@cret")], ["-p", "x:=rtsp://u:s3cret@host/a"]
    for said in (command_line(), json.dumps(named_options(args))):
        assert "cret" not in said and "***" in said, said


@pytest.mark.parametrize("program", ["bin/tracker_node", "tracker_node/__main__.py", "tracker_node/cli/main.py"])
def test_a_command_line_is_kept_as_it_is_typed(monkeypatch, program):
    monkeypatch.setattr(sys, "argv", [f"/there/{program}", "track", "my recording.yaml"])
    assert command_line() == "tracker_node track 'my recording.yaml'"


@pytest.mark.parametrize(
    ("text", "masked"),
    [
        ("rtsp://admin:s3cret@10.0.0.2:554/h264", "rtsp://***@10.0.0.2:554/h264"),
        ("rtsp://admin:s3@cret@10.0.0.2/h264", "rtsp://***@10.0.0.2/h264"),
        ("rtsp://admin:s3/cret@10.0.0.2/h264", "rtsp://***@10.0.0.2/h264"),
        ("RTSP://10.0.0.2:554/user=admin&password=s3cret&channel=1", "RTSP://10.0.0.2:554/user=***"),
        ("http://10.0.0.2/video?user=admin&pwd=s3cret", "http://10.0.0.2/video?***"),
        ("http://10.0.0.2/?to=a@b", "http://***"),  # the host may be b
        ("udp://@:5000", "udp://@:5000"),
        ("v4l2:/dev/video0", "v4l2:/dev/video0"),
    ],
)
def test_passwords_are_not_shown(text: str, masked: str):
    assert parse_source(text).shown == masked
    assert masked in size_contradiction((64, 48), (32, 24), text)


@pytest.mark.parametrize("text", ["rtsp://admin:s3cret@host/a", "gopher://admin:s3cret@host/a"])
def test_messages_about_sources_have_no_passwords(text: str):
    with pytest.raises(SourceError) as caught:
        open_source(text)
    assert "***@host/a" in str(caught.value) and "s3cret" not in str(caught.value)


@pytest.mark.parametrize("text", ["vfl2:/dev/video0", "gopher://x/y", "v4l2:", "topic:", "topic:/a//b", "topic:/käse", "bag:#/a"])
def test_what_is_no_source_is_refused(text: str):
    with pytest.raises(SourceError, match=r"unknown kind of source|expected a"):
        parse_source(text)


def test_a_file_with_a_colon_in_its_name_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "take:1.avi").touch()
    assert parse_source("take:1.avi").kind == "file"


def test_paths_are_relative_to_the_rig_and_addresses_are_not(tmp_path: Path):
    assert relocated("a.mp4", "/rigs") == "/rigs/a.mp4"
    assert relocated("bag:b#/t", "/rigs") == "bag:/rigs/b#/t"
    assert relocated("/rigs/x/a.mp4", "/rigs") == "/rigs/x/a.mp4"
    assert relocated("a.mp4", "/rigs/old", "/rigs/new") == "../old/a.mp4"
    for text in ("v4l2:/dev/video0", "topic:left/image_raw", "rtsp://host/path"):
        assert relocated(text, "/rigs", "/elsewhere") == text


def test_rig_files_keep_sources_and_settings(tmp_path: Path):
    source = "v4l2:/dev/v4l/by-id/usb-A_B-video-index0"
    (tmp_path / "rig.yaml").write_text(RIG.replace("SOURCE", source))
    rig = load_rig(tmp_path / "rig.yaml")
    write_rig_file(rig_file_of(rig), tmp_path / "again.yaml")
    for camera in (rig["left"], load_rig(tmp_path / "again.yaml")["left"]):
        assert camera.source == source
        assert (camera.capture.pixel_format, camera.capture.exposure_us, camera.capture.gain) == ("MJPG", 4000.0, 12)
        assert camera.capture.controls == {"focus_absolute": 30} and camera.capture.publish == "jpeg"


@pytest.mark.parametrize(
    ("old", "new", "field"),
    [
        ("SOURCE", "gopher://x", "source"),
        ("MJPG", "mjpeg", "pixel_format"),
        ("exposure_us: 4000", "exposure_us: -1", "exposure_us"),
        ("exposure_us", "exposure", "exposure"),
        ("publish: jpeg", "publish: png", "publish"),
    ],
)
def test_mistakes_in_a_rig_file_are_named(tmp_path: Path, old: str, new: str, field: str):
    (tmp_path / "rig.yaml").write_text(RIG.replace(old, new).replace("SOURCE", "a.mp4"))
    with pytest.raises(FileFormatError, match=rf"cameras\.left\.(capture\.)?{field}"):
        load_rig(tmp_path / "rig.yaml")


def test_settings_from_the_command_line(tmp_path: Path):
    (tmp_path / "rig.yaml").write_text(RIG.replace("SOURCE", "a.mp4"))
    before = load_rig(tmp_path / "rig.yaml")["left"].capture
    after = changed_settings(before, [("exposure_us", "2500"), ("controls.brightness", "3"), ("publish", "color")])
    assert after == dataclasses.replace(
        before, exposure_us=2500.0, controls={"focus_absolute": 30, "brightness": 3}, publish="color"
    )
    with pytest.raises(FileFormatError, match=r"--capture: field 'exposure'"):
        changed_settings(before, [("exposure", "2500")])
    assert split_change("left.gain=3", ["left"]) == ("left", "gain", "3")
    assert split_change("controls.gain=3", ["left"]) == (None, "controls.gain", "3")


def test_a_live_source_is_not_read_as_a_recording():
    with pytest.raises(SourceError, match="is live"):
        open_source("v4l2:/dev/video0")


@pytest.mark.parametrize(
    "stems",
    [
        ["img_1", "img_2", "img_10"], ["frame0001", "frame0002", "frame0010"], ["1", "2", "10"], ["cam1_9", "cam1_10", "cam2_1"],
        ["IMG_1", "img_2", "IMG_10"], ["1_walk", "2_walk", "walk"], ["a01", "a1"], ["1²3"],
    ],
)  # fmt: skip
def test_images_videos_and_folders_have_one_natural_order(tmp_path: Path, stems: list[str]):
    """Images went by capitals first, videos and folders did not; a01 and a1 as the file system has them; 1²3 was an error."""
    for stem in reversed(stems):
        (tmp_path / f"images/{stem}.png").parent.mkdir(exist_ok=True)
        (tmp_path / f"images/{stem}.png").touch()
        (tmp_path / f"videos/{stem}.mp4").parent.mkdir(exist_ok=True)
        (tmp_path / f"videos/{stem}.mp4").touch()
        (tmp_path / "folders" / stem).mkdir(parents=True)
    assert [Path(file).stem for file in list_images(str(tmp_path / "images"))] == stems
    assert [file.stem for file in recordings_in(tmp_path / "videos")] == stems
    assert [folder.name for folder in subfolders(tmp_path / "folders")] == stems
