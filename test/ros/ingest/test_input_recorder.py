"""Images that go in, in a bag: on which topics, as which types, and with which stamps."""

import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import CaptureSettings
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.ros.ingest.cameras import IngestCamera
from tracker_node.ros.ingest.outlet import InputRecorder, _encoding

LENS = CameraModel(4, 3, np.array([[5.0, 0.0, 1.5], [0.0, 6.0, 1.0], [0.0, 0.0, 1.0]]))


@pytest.mark.parametrize(
    ("shape", "bayer", "encoding"), [((3, 4, 3), None, "bgr8"), ((3, 4), None, "mono8"), ((3, 4), "rggb", "bayer_rggb8")]
)
def test_encodings_are_those_of_the_pixels(shape, bayer, encoding):
    assert _encoding(np.zeros(shape, np.uint8), bayer) == encoding


def camera(name, lens):
    return IngestCamera(name, "", CaptureSettings(), lens)


def test_everything_is_kept_as_it_came(tmp_path):
    recorder = InputRecorder(tmp_path / "bag")
    gray = np.arange(12, dtype=np.uint8).reshape(3, 4)
    recorder.record(camera("a", LENS), 5_000_000_007, gray, "grbg")
    recorder.record(camera("b", None), 6_000_000_008, b"\xff\xd8 a picture")
    recorder.close()
    assert (recorder.problem, recorder.written, recorder.dropped) == ("", 3, 0)
    with BagReader(tmp_path / "bag") as reader:
        assert sorted(reader.topics) == ["/a/camera_info", "/a/image_raw", "/b/image_raw/compressed"]
        ((stamp_ns, raw),) = reader.decoded("/a/image_raw")
        ((info_ns, info),) = reader.decoded("/a/camera_info")
        ((jpeg_ns, jpeg),) = reader.decoded("/b/image_raw/compressed")
    assert (stamp_ns, info_ns, jpeg_ns) == (5_000_000_007, 5_000_000_007, 6_000_000_008)
    assert (raw.header.stamp.sec, raw.header.stamp.nanosec, raw.header.frame_id) == (5, 7, "a_optical_frame")
    assert (raw.height, raw.width, raw.encoding, bytes(raw.data)) == (3, 4, "bayer_grbg8", gray.tobytes())
    assert (info.header.stamp.nanosec, info.width, info.height, info.k[0], info.k[4]) == (7, 4, 3, 5.0, 6.0)
    assert bytes(jpeg.data) == b"\xff\xd8 a picture"
    assert jpeg.header.frame_id == "b_optical_frame"
