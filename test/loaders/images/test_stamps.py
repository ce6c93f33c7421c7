"""Stamps from files and containers, and clocks that are off: real videos, and the stamp file of a real recording."""

import struct
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.errors import FileFormatError, SourceError
from tracker_node.loaders.images.source import PreloadedSource, SourceOptions, open_camera_source
from tracker_node.loaders.images.stamps import (
    common_ns,
    field_times,
    file_times,
    load_stamp_file,
    period_ns,
    presentation_times,
    stamps_of_times_ns,
)
from tracker_node.loaders.rig.rig_yaml import load_rig, read_rig_file, write_rig_file

N, RATE_HZ, SIZE = 12, 25.0, (64, 48)
LENS = CameraModel(*SIZE, np.array([[50.0, 0.0, 32.0], [0.0, 50.0, 24.0], [0.0, 0.0, 1.0]]))


@pytest.fixture
def video(tmp_path: Path) -> Path:
    path = tmp_path / "cam_1.mp4"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"mp4v"), RATE_HZ, SIZE)
    for i in range(N):
        writer.write(np.full((SIZE[1], SIZE[0], 3), 10 + 20 * i, np.uint8))
    writer.release()
    return path


def camera(source: Path, **fields) -> Camera:
    return Camera("cam_1", LENS, np.eye(4), source=str(source), **fields)


def stamps(source) -> list[int]:
    return [stamp_ns for stamp_ns, _ in source]


def with_variable_rate(path: Path, ticks: list[int]) -> None:
    """Rewrite the table of durations (``stts``) of an MP4 whose index stands at the end, one duration an image."""
    data = bytearray(path.read_bytes())
    place = data.rindex(b"stts") - 4
    old = struct.unpack_from(">I", data, place)[0]
    body = b"stts" + struct.pack(">II", 0, len(ticks)) + b"".join(struct.pack(">II", 1, t) for t in ticks)
    new = struct.pack(">I", len(body) + 4) + body
    for box in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
        at = data.rindex(box, 0, place) - 4
        struct.pack_into(">I", data, at, struct.unpack_from(">I", data, at)[0] + len(new) - old)
    data[place : place + old] = new
    path.write_bytes(bytes(data).replace(b"edts", b"free"))  # the edit list would cut off what is longer now


def test_a_container_has_times_that_its_rate_does_not(video):
    assert presentation_times(video) == pytest.approx([i * 40_000_000 for i in range(N)], abs=1)
    tick = struct.unpack_from(">I", video.read_bytes(), video.read_bytes().rindex(b"stts") + 16)[0]
    with_variable_rate(video, [tick, 3 * tick, tick, tick, 2 * tick] + [tick] * (N - 5))
    wanted = [0, 40, 160, 200, 240, 320, 360, 400, 440, 480, 520, 560]
    source = open_camera_source(camera(video, stamps="container", time_offset_ns=5))
    assert stamps(source) == pytest.approx([1e6 * ms + 5 for ms in wanted], abs=1)
    assert source.rate_hz == pytest.approx(25.0)
    with pytest.raises(SourceError, match="no times of images"):
        presentation_times(Path(__file__))


def test_stamps_of_a_real_recording(shared_data):
    folder = shared_data / "caliscope_board/post_optimization"
    times = {i: load_stamp_file(folder / "timestamps.csv", f"cam_{i}") for i in range(4)}
    assert [len(t) for t in times.values()] == [57] * 4
    assert (times[2][0], times[0][0]) == (25_000_978_700, 25_001_196_550)
    spread_ns = np.ptp(np.array(list(times.values())), axis=0)
    assert np.median(spread_ns) < 3e6 and spread_ns.max() < 21e6
    lens = CameraModel(1280, 720, np.array([[900.0, 0.0, 640.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]]))
    webcam = Camera("cam_2", lens, np.eye(4), str(folder / "cam_2.mp4"), stamp_file=str(folder / "timestamps.csv"))
    source = open_camera_source(webcam, SourceOptions(start=3, end=6))
    assert stamps(source) == list(times[2][3:6])
    assert 5.5 < source.rate_hz < 6.5


@pytest.mark.parametrize(
    "text",
    [
        "".join(f"{100 + 0.04 * i:.2f}\n" for i in range(N)),
        "time_ns\n" + "".join(f"{100_000_000_000 + 40_000_000 * i}\n" for i in range(N)),
        "frame,timestamp_ms\n" + "".join(f"{i + 1},{100_000 + 40 * i}\n" for i in reversed(range(N))),
        "port,time,sync_index\n" + "".join(f"{port},{100 + 0.04 * i},{7 * i}\n" for i in range(N) for port in (0, 1)),
        "camera,time\n" + "".join(f"cam_1,{100 + 0.04 * i}\ncam_11,{0.5 * i}\n" for i in range(N)),
    ],
    ids=["plain", "ns", "numbered from 1", "ports", "names"],
)  # fmt: skip
def test_forms_of_stamp_files(video, tmp_path, text):
    file = tmp_path / "stamps.csv"
    file.write_text(text)
    source = open_camera_source(camera(video, stamp_file=str(file)))
    assert stamps(source) == [100_000_000_000 + 40_000_000 * i for i in range(N)]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("when,camera\n1,cam_1\n", "field 'header': expected one column of times"),
        ("time,camera\n1,left\n2,right\n", r"field 'camera': expected camera 'cam_1', or its number, got \['left', 'right'\]"),
        ("time\n1\nsoon\n", "line 3.*a time, got 'soon'"),
        ("frame,time\n0,1\n1,3\n2,2\n", r"line 4.*after that of the image before \(3.000000 s\), got '2'"),
        ("frame,time\n0,1\n2,2\n", "line 3, column 'frame'.*got '2'"),
        ("time\n" + "".join(f"{10**18 + i * 10**9}\n" for i in range(9)), "a time in its column's unit"),
        ("time\n" + "".join(f"{i * 33_000_000}\n" for i in range(9)), r"unit in the column's name.*3.3e\+07 s between"),
        ("time\n", "a line for each image"),
        ("time\n" + "".join(f"{0.1 * i}\n" for i in range(N - 1)), "has 11 times for camera 'cam_1', but .*cam_1.mp4 has 12"),
    ],
)  # fmt: skip
def test_stamp_files_that_cannot_be_used(video, tmp_path, text, said):
    file = tmp_path / "stamps.csv"
    file.write_text(text)
    with pytest.raises((FileFormatError, SourceError), match=said):
        open_camera_source(camera(video, stamp_file=str(file)))


def test_a_file_has_no_stamps_of_a_device(video):
    with pytest.raises(SourceError, match="the rig asks for device stamps; files have rate or container"):
        open_camera_source(camera(video, stamps="device"))
    assert stamps(open_camera_source(camera(video, stamps="rate"))) == stamps(open_camera_source(camera(video)))


@given(st.integers(-(10**18), 10**18), st.integers(0, 10**13), st.integers(-(10**12), 10**12), st.floats(-1000, 1000))
def test_a_clock_that_drifts(first, passed, offset, ppm):
    """Common time is off by the offset at the first image, and by so many microseconds more after each second."""
    found = common_ns(first + passed, first, offset, ppm) - (first + offset)
    assert found == pytest.approx(passed * (1.0 + 1e-6 * ppm), abs=2.0, rel=1e-12)


def test_drift_goes_on_through_a_loop_and_from_a_later_start(video, tmp_path):
    file = tmp_path / "stamps.txt"
    file.write_text("".join(f"{50 + 0.04 * i:.2f}\n" for i in range(N)))
    drifting = camera(video, stamp_file=str(file), time_drift_ppm=1000.0, time_offset_ns=7)
    whole = stamps(open_camera_source(drifting))
    assert whole == [50_000_000_007 + round(40_040_000 * i) for i in range(N)]
    late = open_camera_source(drifting, SourceOptions(start=4, loop=True))
    assert [stamp for _, (stamp, _) in zip(range(20), late, strict=False)] == [whole[4] + 40_040_000 * i for i in range(20)]
    assert stamps(PreloadedSource(open_camera_source(drifting, SourceOptions(start=4)))) == whole[4:]


def test_the_rig_file_keeps_them(tmp_path, video):
    entry = {"image_size": [64, 48], "K": [[50, 0, 32], [0, 50, 24], [0, 0, 1]], "T_world_cam": np.eye(4).tolist()}
    text = f"cameras: {{cam_1: {{{', '.join(f'{k}: {v}' for k, v in entry.items())}, %s}}}}\n"
    rig = tmp_path / "rig.yaml"
    rig.write_text(text % "stamp_file: times.csv, time_drift_ppm: 12.5")
    (tmp_path / "sub").mkdir()
    write_rig_file(read_rig_file(rig), tmp_path / "sub/rig.yaml", base_dir=tmp_path)
    moved = load_rig(tmp_path / "sub/rig.yaml")["cam_1"]
    assert (Path(moved.stamp_file).resolve(), moved.time_drift_ppm) == ((tmp_path / "times.csv").resolve(), 12.5)
    for fields, said in (
        ("stamps: clock", "cameras.cam_1.stamps"),
        ("stamps: rate, stamp_file: a.csv", "either stamps or a stamp_file"),
        ("time_drift_ppm: 1e6", "at most 100000 millionths"),
    ):
        rig.write_text(text % fields)
        with pytest.raises(FileFormatError, match=said):
            load_rig(rig)
    assert replace(moved, stamp_file=None).stamps is None


def test_times_of_a_file_by_where_they_come_from(video, tmp_path):
    assert file_times(camera(video), N) is None and file_times(camera(video, stamps="rate"), N) is None
    contained = camera(video, stamps="container")
    times = file_times(contained, N)
    assert times == presentation_times(video) and len(times) == N
    assert file_times(contained, N - 2) == times
    longer = file_times(contained, N + 2)  # two images more than the container has times: a period after another
    assert longer[:N] == times
    assert longer[N:] == pytest.approx([480_000_000, 520_000_000], abs=2)
    stamp_file = tmp_path / "stamps.txt"
    stamp_file.write_text("1\n2\n")
    given_file = camera(video, stamp_file=str(stamp_file))
    assert file_times(given_file, 2) == (1_000_000_000, 2_000_000_000)
    for n in (1, 3):
        with pytest.raises(SourceError, match=f"has 2 times for camera 'cam_1', but .* has {n} images"):
            file_times(given_file, n)


def test_the_period_is_the_median_time_between_images():
    assert period_ns([]) == 0 and period_ns([7]) == 0
    assert period_ns([7, 17]) == 10 and period_ns([0, 10, 40, 50, 60]) == 10
    assert type(period_ns([0, 3])) is int


def test_the_second_field_is_half_a_period_later():
    assert field_times([100, 140, 180]) == (100, 120, 140, 160, 180, 200)
    assert field_times([5]) == (5, 5)


def test_nanoseconds_of_times():
    assert stamps_of_times_ns("a.csv", np.array([10.0, 10.5, 12.25])).tolist() == [10_000_000_000, 10_500_000_000, 12_250_000_000]
    assert stamps_of_times_ns("a.csv", np.array([0.0, 1e-9, 3e-9])).tolist() == [0, 1, 3]
    assert stamps_of_times_ns("a.csv", np.array([3.0])).dtype == np.int64
    with pytest.raises(FileFormatError, match=r"a.csv: field 'times': expected times a nanosecond apart at least, got 'closer"):
        stamps_of_times_ns("a.csv", np.array([0.0, 1.0, 1.0]))
    with pytest.raises(FileFormatError, match=r"a nanosecond apart"):
        stamps_of_times_ns("a.csv", np.array([0.0, 1.0, 0.5]))
    for last in (3.2e9, np.nan):
        with pytest.raises(FileFormatError, match=r"field 'times': expected a span of less than 3200000000 s"):
            stamps_of_times_ns("a.csv", np.array([0.0, last]))
    for first in (-3.2e9, 3.2e9):
        with pytest.raises(FileFormatError, match=r"expected a first one within 3200000000 s of 0"):
            stamps_of_times_ns("a.csv", np.array([first, first + 1.0]))
    assert stamps_of_times_ns("a.csv", np.array([0.0, 3.1e9])).tolist() == [0, 3_100_000_000_000_000_000]


def load(tmp_path: Path, text: str, name: str = "cam_1") -> tuple[int, ...]:
    file = tmp_path / "stamps.csv"
    file.write_text(text)
    return load_stamp_file(file, name)


@pytest.mark.parametrize(
    ("column", "unit_ns"),
    [("time", 10**9), ("stamp_s", 10**9), ("timestamp_ms", 10**6), ("frame_time_us", 10**3), ("t_ns", 1), (" Seconds ", 10**9)],
)
def test_units_of_columns(tmp_path, column, unit_ns):
    assert load(tmp_path, f"{column}\n3\n5\n") == (3 * unit_ns, 5 * unit_ns)


def test_lines_are_in_order_of_number_or_else_of_time(tmp_path):
    assert load(tmp_path, "time\n3\n1.5\n10\n") == (1_500_000_000, 3_000_000_000, 10_000_000_000)
    assert load(tmp_path, "image,time\n1,5\n0,4\n") == (4_000_000_000, 5_000_000_000)
    assert load(tmp_path, "image,time\n2,5\n1,4\n") == (4_000_000_000, 5_000_000_000)
    with pytest.raises(FileFormatError, match=r"line 2, column 'image'.*for every image from 0 or 1 on, here 0, got '2'"):
        load(tmp_path, "image,time\n2,4\n3,5\n")
    with pytest.raises(FileFormatError, match=r"line 3, column 'image'.*here 2, got '3'"):
        load(tmp_path, "image,time\n1,4\n3,5\n")
    with pytest.raises(FileFormatError, match=r"line 3, column 'image'.*here 1, got '0'"):
        load(tmp_path, "image,time\n0,4\n0,5\n")


def test_the_greatest_stamps_are_those_of_ros(tmp_path):
    assert load(tmp_path, "2147483647\n") == (2_147_483_647_000_000_000,)
    assert load(tmp_path, "-2147483647\n") == (-2_147_483_647_000_000_000,)
    for text in ("2147483648\n", "-2147483648\n"):
        with pytest.raises(FileFormatError, match=r"line 1.*seconds, if it names none\), of at most 2147483647, what a ROS"):
            load(tmp_path, text)


def test_images_are_at_most_a_hundred_seconds_apart(tmp_path):
    assert load(tmp_path, "0\n100\n") == (0, 100_000_000_000)
    with pytest.raises(FileFormatError, match=r"100.5 s between two images"):
        load(tmp_path, "0\n100.5\n")
    with pytest.raises(FileFormatError, match=r"line 2.*after that of the image before \(1.000000 s\), got '1'"):
        load(tmp_path, "1\n1\n")
    for text in ("time\nnan\n", "time\ninf\n"):
        with pytest.raises(FileFormatError, match=r"line 2.*a time"):
            load(tmp_path, text)


def test_cameras_by_name_or_else_by_the_number_that_they_end_with(tmp_path):
    assert load(tmp_path, "port,time\n1,4\n01x,6\n2,5\n") == (4_000_000_000,)
    assert load(tmp_path, "camera,time\nleft_01,4\nleft_2,5\n") == (4_000_000_000,)
    assert load(tmp_path, "camera,time\n1,4\n cam_1 ,5\n") == (5_000_000_000,)
    assert load(tmp_path, "cam,time\nside,4\nfront,5\n", "side") == (4_000_000_000,)
    for name, text in (("cam_1", "port,time\n1,4\n01,5\n"), ("side", "port,time\n1,4\n"), ("cam_1", "port,time\n2,4\n")):
        with pytest.raises(FileFormatError, match=f"field 'port': expected camera '{name}', or its number"):
            load(tmp_path, text, name)
    with pytest.raises(FileFormatError, match=r"field '\(file\)': expected camera 'cam_1'"):
        load(tmp_path, "port,time\n")
    with pytest.raises(FileFormatError, match=r"field 'header': expected one column of times .*time, timestamp"):
        load(tmp_path, "time,stamp\n1,2\n")
