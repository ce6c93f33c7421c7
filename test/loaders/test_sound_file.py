"""Sound tracks as they stand in videos."""

import wave

import numpy as np
import pytest

from benchmark.calibration.synchronize import SOUND_HZ, write_video
from tracker_node.errors import FileFormatError, MissingExtraError
from tracker_node.loaders.images.video_tracks import read_sound


def black(n: int):
    return (np.zeros((36, 64, 3), np.uint8) for _ in range(n))


@pytest.fixture(scope="module")
def video(tmp_path_factory):
    sound = np.zeros(3 * SOUND_HZ, np.float32)
    sound[SOUND_HZ : SOUND_HZ + 500] = 0.5 * np.random.default_rng(0).normal(size=500)
    path = tmp_path_factory.mktemp("sound") / "clap.mp4"
    write_video(path, black(60), 30.0, sound)
    return path


def test_a_clap_is_where_it_was(video):
    found = read_sound(video)
    first = np.flatnonzero(np.abs(found.samples) > 0.1)[0]
    assert found.rate_hz == SOUND_HZ and found.samples.dtype == np.float32
    assert found.after_images_s + first / SOUND_HZ == pytest.approx(1.0, abs=5e-4)


def test_only_the_beginning_is_read(video):
    assert len(read_sound(video, 1.0).samples) == pytest.approx(SOUND_HZ, abs=2048)


def test_a_sound_file_of_two_channels(tmp_path):
    with wave.open(str(tmp_path / "a.wav"), "wb") as file:
        file.setnchannels(2)
        file.setsampwidth(2)
        file.setframerate(8000)
        file.writeframes(np.column_stack([np.full(800, 16384), np.zeros(800)]).astype("<i2").tobytes())
    found = read_sound(tmp_path / "a.wav")
    assert (found.rate_hz, found.after_images_s, len(found.samples)) == (8000.0, 0.0, 800)
    assert found.samples == pytest.approx(0.25, abs=1e-3)


def test_what_has_no_sound_is_named(tmp_path):
    write_video(tmp_path / "mute.mp4", black(5), 30.0)
    with pytest.raises(FileFormatError, match="expected a sound track, got 'none'"):
        read_sound(tmp_path / "mute.mp4")
    (tmp_path / "text.mp4").write_text("no video")
    with pytest.raises(FileFormatError, match="can be decoded"):
        read_sound(tmp_path / "text.mp4")
    with pytest.raises(FileFormatError, match="no such file"):
        read_sound(tmp_path / "none.mp4")


def test_without_the_extra_it_is_named(video, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "av", None)
    with pytest.raises(MissingExtraError, match="sound"):
        read_sound(video)
