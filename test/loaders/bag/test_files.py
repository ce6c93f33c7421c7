"""Files of a bag that are compressed as a whole do not fill the disk that they are unpacked to."""

import shutil
from collections import namedtuple
from pathlib import Path

import pytest
import zstandard

from tracker_node.errors import FileFormatError
from tracker_node.loaders.bag.metadata import check_room
from tracker_node.loaders.bag.reader import BagReader

METADATA = """rosbag2_bagfile_information:
  version: 8
  storage_identifier: mcap
  relative_file_paths: [a_0.mcap.zstd]
  duration: {nanoseconds: 0}
  starting_time: {nanoseconds_since_epoch: 0}
  message_count: 0
  topics_with_message_count: []
  compression_format: zstd
  compression_mode: file
  files: []
"""


@pytest.fixture
def bomb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A bag whose file is some kilobytes, 60 MB unpacked, on a machine with room for 100 MB."""
    usage = namedtuple("usage", "total used free")(10**9, 9 * 10**8, 10**8)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage)
    frame = zstandard.ZstdCompressor().compress(bytes(20_000_000))
    (tmp_path / "a_0.mcap.zstd").write_bytes(3 * frame)  # each says its own size only
    (tmp_path / "metadata.yaml").write_text(METADATA)
    return tmp_path


def test_what_does_not_fit_is_refused(bomb: Path) -> None:
    with pytest.raises(FileFormatError, match=r"a_0.mcap.zstd.*at most 50 MB unpacked"):
        check_room([bomb / "a_0.mcap.zstd"])
    with pytest.raises(FileFormatError, match="at most 50 MB unpacked"):
        BagReader(bomb)


def test_what_fits_is_not(bomb: Path) -> None:
    path = bomb / "a_0.mcap.zstd"
    path.write_bytes(zstandard.ZstdCompressor().compress(bytes(49_000_000)))
    check_room([path, bomb / "metadata.yaml"])


def test_damage_is_one_line(bomb: Path) -> None:
    path = bomb / "a_0.mcap.zstd"
    path.write_bytes(path.read_bytes()[:20] + b"damage" * 9)
    with pytest.raises(FileFormatError, match="undamaged"):
        check_room([path])
