"""C3D files, written through ezc3d and read back by it and by another reader."""

import struct
import warnings
from pathlib import Path

import c3d
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from helpers.sources.small_disk import limited_files
from tracker_node.errors import FileFormatError
from tracker_node.loaders.motion.c3d_file import (
    MOST_EVENTS,
    MOST_FRAMES,
    AnglesOverTime,
    TimedEvent,
    _actual_fields,
    dump_c3d,
    load_c3d,
)
from tracker_node.loaders.motion.trc import MarkerTrajectories


def trajectories(n=20, m=3, rate_hz=59.94, seed=0):
    rng = np.random.default_rng(seed)
    valid = rng.random((n, m)) > 0.3
    positions = rng.normal(size=(n, m, 3)) * valid[..., None]
    return MarkerTrajectories(tuple(f"left_marker_{i}" for i in range(m)), np.arange(n) / rate_hz, positions, rate_hz, valid)


def read_by_another(path):
    """Labels, rate, and (n, m, 5) x y z residual cameras, by py-c3d."""
    with path.open("rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = c3d.Reader(stream)
        frames = np.array([points for _, points, _ in reader.read_frames()])
        return [label.strip() for label in reader.point_labels], reader.point_rate, frames, reader


def test_another_reader_sees_points_units_rate_and_gaps(tmp_path):
    written = trajectories()
    angles = AnglesOverTime(("LeftKneeAngles",), np.full((20, 1, 3), 0.5), np.ones((20, 1), dtype=bool))
    dump_c3d(written, tmp_path / "a.c3d", unit="mm", descriptions=["one", "two", "three"], angles=angles)
    labels, rate, frames, reader = read_by_another(tmp_path / "a.c3d")
    assert labels == [*written.names, "LeftKneeAngles"]
    assert rate == pytest.approx(59.94)
    assert reader.get("POINT:UNITS").string_value.strip() == "mm"
    assert [text.strip() for text in reader.get("POINT:DESCRIPTIONS").string_array[:3]] == ["one", "two", "three"]
    assert [text.strip() for text in reader.get("POINT:ANGLES").string_array] == ["LeftKneeAngles"]
    seen = frames[:, :3, 3] >= 0.0
    assert np.array_equal(seen, written.valid)
    assert np.all(frames[:, :3, 3][~seen] == -1.0)
    assert frames[:, :3, :3][seen] == pytest.approx(1000.0 * written.positions_m[seen], abs=1e-3)
    assert frames[:, 3, :3] == pytest.approx(np.full((20, 3), np.rad2deg(0.5)), abs=1e-4)


def test_another_reader_sees_events_in_order_of_time(tmp_path):
    off, strike = TimedEvent(61.5, "Left", "Foot Off"), TimedEvent(0.25, "Right", "Foot Strike")
    dump_c3d(trajectories(), tmp_path / "a.c3d", events=[off, strike])
    reader = read_by_another(tmp_path / "a.c3d")[3]
    assert [text.strip() for text in reader.get("EVENT:LABELS").string_array] == ["Foot Strike", "Foot Off"]
    assert [text.strip() for text in reader.get("EVENT:CONTEXTS").string_array] == ["Right", "Left"]
    assert reader.get("EVENT:USED").int16_value == 2
    assert reader.get("EVENT:TIMES").float_array.ravel() == pytest.approx([0.0, 0.25, 1.0, 1.5])  # minutes, seconds
    dump_c3d(trajectories(), tmp_path / "b.c3d")
    assert read_by_another(tmp_path / "b.c3d")[3].get("EVENT") is None
    assert load_c3d(tmp_path / "a.c3d").names == load_c3d(tmp_path / "b.c3d").names


def test_of_too_many_events_the_first_are_written(tmp_path):
    dump_c3d(trajectories(), tmp_path / "a.c3d", events=[TimedEvent(0.1 * i, "Left", "Foot Off") for i in range(600)])
    reader = read_by_another(tmp_path / "a.c3d")[3]
    assert reader.get("EVENT:USED").int16_value == MOST_EVENTS == len(reader.get("EVENT:LABELS").string_array)
    assert load_c3d(tmp_path / "a.c3d").names == trajectories().names


def test_y_up_is_a_turn_of_the_axes(tmp_path):
    written = trajectories()
    dump_c3d(written, tmp_path / "a.c3d", y_up=True, unit="m")
    frames = read_by_another(tmp_path / "a.c3d")[2]
    assert frames[..., 1] == pytest.approx(written.positions_m[..., 2], abs=1e-6)  # the file's y is the world's z
    read = load_c3d(tmp_path / "a.c3d")
    assert read.positions_m == pytest.approx(written.positions_m, abs=1e-6)
    assert load_c3d(tmp_path / "a.c3d", y_up=False).positions_m[..., 1] == pytest.approx(written.positions_m[..., 2], abs=1e-6)


@settings(max_examples=8, deadline=None)
@given(st.integers(1, 12), st.integers(1, 6), st.sampled_from(["m", "cm", "mm"]), st.booleans(), st.integers(0, 999))
def test_any_trajectories_come_back(tmp_path_factory, n, m, unit, y_up, seed):
    path = tmp_path_factory.mktemp("c3d") / "a.c3d"
    written = trajectories(n, m, 100.0, seed)
    dump_c3d(written, path, y_up, unit)
    read = load_c3d(path)
    assert read.names == written.names and read.rate_hz == 100.0
    assert np.array_equal(read.valid, written.valid)
    assert read.positions_m == pytest.approx(written.positions_m, abs=1e-6)
    assert read.times_s == pytest.approx(written.times_s, abs=1e-9)


def test_a_file_that_cannot_be_written_is_an_error(tmp_path):
    (tmp_path / "full.c3d").symlink_to("/dev/full")
    for path in (Path("/proc/x.c3d"), tmp_path / "full.c3d", tmp_path / "no folder" / "a.c3d"):
        with pytest.raises(OSError) as caught:
            dump_c3d(trajectories(), path)
        assert caught.value.filename == str(path.resolve())
    assert [path.name for path in tmp_path.iterdir()] == ["full.c3d"]


@pytest.mark.parametrize("room", [100, 1500, 20_000])
def test_a_full_disk_is_an_error_and_spares_what_was_there(tmp_path, room):
    path = tmp_path / "a.c3d"
    path.write_bytes(b"mine")
    with limited_files(room), pytest.raises(OSError, match=r"whole.*a\.c3d"):
        dump_c3d(trajectories(500, 4), path)
    assert path.read_bytes() == b"mine" and len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("name", ["walk", "walk.C3D", "walk.c3d.part"])
def test_the_file_has_the_name_that_was_given(tmp_path, name):
    dump_c3d(trajectories(), tmp_path / name)
    assert [path.name for path in tmp_path.iterdir()] == [name]


def test_a_link_is_written_through(tmp_path):
    (tmp_path / "link.c3d").symlink_to(tmp_path / "a.c3d")
    dump_c3d(trajectories(), tmp_path / "link.c3d")
    assert (tmp_path / "link.c3d").is_symlink() and load_c3d(tmp_path / "a.c3d").names == trajectories().names


@pytest.mark.parametrize("damage", [
    lambda content: b"",
    lambda content: content[:300],
    lambda content: b"\x00" * len(content),
    lambda content: b"\x00" + content[1:],
    lambda content: content[:1024],
    lambda content: content[: len(content) - 700],
    lambda content: content[:512] + bytes(reversed(content[512:1536])) + content[1536:],
    lambda content: b"PathFileType\t4\t(X/Y/Z)" + content[22:],
])  # fmt: skip
def test_what_is_no_c3d_file_is_named(tmp_path, damage):
    dump_c3d(trajectories(200, 5), tmp_path / "a.c3d")
    content = (tmp_path / "a.c3d").read_bytes()
    (tmp_path / "a.c3d").write_bytes(damage(content))
    with pytest.raises(FileFormatError, match=r"a\.c3d"):
        load_c3d(tmp_path / "a.c3d")


def test_more_frames_than_the_header_counts(tmp_path):
    n = MOST_FRAMES + 5
    positions = np.ones((n, 1, 3)) * (1.0 + np.arange(n)[:, None, None] % 100)
    markers = MarkerTrajectories(("a",), np.arange(n) / 100.0, positions, 100.0, np.ones((n, 1), dtype=bool))
    dump_c3d(markers, tmp_path / "a.c3d", unit="m")
    with (tmp_path / "a.c3d").open("rb") as stream, warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader = c3d.Reader(stream)
        assert (reader.first_frame, reader.last_frame) == (1, n)
        last = [points for _, points, _ in reader.read_frames()][-1]
    assert last[0, 0] == positions[-1, 0, 0]
    with pytest.raises(FileFormatError, match=f"{n} frames"):
        load_c3d(tmp_path / "a.c3d")


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(FileFormatError, match=r"nowhere\.c3d"):
        load_c3d(tmp_path / "nowhere.c3d")


@pytest.mark.parametrize("seed", range(6))
def test_bytes_gone_wrong_are_read_or_named(tmp_path, seed):
    """Of these six some crash ezc3d itself."""
    rng = np.random.default_rng(seed)
    dump_c3d(trajectories(30, 3), tmp_path / "a.c3d")
    content = np.frombuffer((tmp_path / "a.c3d").read_bytes(), dtype=np.uint8).copy()
    content[rng.integers(0, 1500, 4)] = rng.integers(0, 256, 4)
    (tmp_path / "a.c3d").write_bytes(content.tobytes())
    try:
        read = load_c3d(tmp_path / "a.c3d")
    except FileFormatError as error:
        assert "a.c3d" in str(error)
        return
    assert np.isfinite(read.positions_m).all() and not read.positions_m[~read.valid].any()


def trial(start, end):
    fields = {"ACTUAL_START_FIELD": start, "ACTUAL_END_FIELD": end}
    return {name: {"value": np.array(words)} for name, words in fields.items() if words is not None}


@pytest.mark.parametrize(
    ("start", "end", "both"),
    [
        ([1, 0], [10, 0], (1, 10)), ([5, 0], [5, 0], (5, 5)), ([1, 0], [0, 1], (1, 65536)), ([3, 2], [2, 3], (131075, 196610)),
        ([1, 0], [-1, 0], (1, 65535)), ([2, 0], [1, 0], (0, 0)), ([0, 0], [9, 0], (0, 0)), ([1], [9, 0], (0, 0)),
        ([1, 0], None, (0, 0)), (None, None, (0, 0)), ([[1, 0]], [[4, 0]], (1, 4)),
    ],
)  # fmt: skip
def test_both_ends_are_read(start, end, both):
    assert _actual_fields(trial(start, end)) == both


def test_times_of_a_trimmed_file_begin_at_its_first_frame(tmp_path):
    dump_c3d(trajectories(n=20, rate_hz=50.0), tmp_path / "a.c3d")
    content = bytearray((tmp_path / "a.c3d").read_bytes())
    struct.pack_into("<2H", content, 6, 101, 120)  # numbers of the first and the last frame
    (tmp_path / "a.c3d").write_bytes(content)
    assert load_c3d(tmp_path / "a.c3d").times_s == pytest.approx(2.0 + np.arange(20) / 50.0)
