"""Where the images of a camera go: to topics, with calibration and the service that sets it, and to a bag as they came.

And when recorded images are published: at their time, or as fast as a consumer has shown that it can take them.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from rclpy.serialization import serialize_message
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from sensor_msgs.srv import SetCameraInfo
from tracker_msgs.msg import Bodies, TrackedState

from ...camera.model import CameraModel
from ...errors import CalibrationError, TrackerError
from ...loaders.bag.images import COMPRESSED, RAW
from ...loaders.bag.message_types import message_type
from ...loaders.bag.metadata import OfferedQos
from ...loaders.bag.queue import BagQueue
from ...loaders.bag.writer import BagWriter
from ...loaders.decoding import JPEG, SourceImage
from ...loaders.rig.camera_info import save_lens
from ...runs.messages import jpeg_of, lens_of
from ..conversions import ImageBuffer, camera_info_message, image_message, jpeg_message, stamp_message, stamp_ns_of
from ..diagnostics import QosMismatches
from ..direct_images import DirectImages
from ..qos import RESULT, images_published, overridable
from .cameras import IngestCamera


class Pace:
    """When an image set is due: its distance in stamps from the first, on the steady clock.

    ``epoch_ns`` added to a stamp gives the time of day at which it is due.
    """

    def __init__(self) -> None:
        self._epoch_s: float | None = None
        self.epoch_ns = 0

    def wait(self, stamp_ns: int, stop: threading.Event) -> float:
        """Sleep until an image set is due.

        Parameters
        ----------
        stamp_ns : of the image set.
        stop : ends the sleep when it is set.

        Returns
        -------
        late_s : seconds by which that was missed.
        """
        now = time.monotonic()
        if self._epoch_s is None:
            self._epoch_s, self.epoch_ns = now - 1e-9 * stamp_ns, time.time_ns() - stamp_ns
        due = self._epoch_s + 1e-9 * stamp_ns
        if due > now:
            stop.wait(due - now)
        return max(0.0, time.monotonic() - due)


_FIRST_S = 180.0  # a consumer may have to compile before its first answer
_PATIENCE_S = 15.0  # a consumer that has all cameras answers, on a slow machine as well; more on their way would only be lost
_INCOMPLETE_S = 0.3
_TELL_S = 8.0  # without the first answer, until that is said


class ConsumerWindow:
    """Counts the image sets sent and answered.

    An answer is a `TrackedState`, or `Bodies` where there are several, whose stamp is that of the image set or later. When none
    comes for ``patience_s``, the window doubles, and shrinks again with each answer: a consumer that waits for a camera which is
    silent decides only when it has seen enough of the others. We know when a camera is silent, and are less patient then. So a
    lossless run goes on whatever the cameras do, and nothing but speed depends on the wall clock.

    Parameters
    ----------
    node, consumer : ours; the name of the one that answers on ``<consumer>/state`` or ``<consumer>/bodies``.
    size, largest : image sets that may be on their way, usually and at most.
    patience_s : without an answer.
    """

    def __init__(self, node: Node, consumer: str, size: int = 2, largest: int = 64, patience_s: float = _PATIENCE_S):
        self._node, self._consumer = node, consumer
        self._size, self._smallest, self._largest, self._patience_s = size, size, largest, patience_s
        self._complete = True
        self._condition = threading.Condition()
        self._on_their_way: deque[int] = deque()
        self._answered = 0
        self._closed = self._told = False
        self._topics = {TrackedState: f"{consumer}/state", Bodies: f"{consumer}/bodies"}
        self._subscriptions = [node.create_subscription(*each, self._on_answer, RESULT) for each in self._topics.items()]

    def _on_answer(self, message: TrackedState | Bodies) -> None:
        self.answer(stamp_ns_of(message.header.stamp))

    def answer(self, stamp_ns: int) -> None:
        """The consumer is done with everything up to this stamp."""
        with self._condition:
            self._answered += 1
            self._size = max(self._smallest, self._size - 1)
            while self._on_their_way and self._on_their_way[0] <= stamp_ns:
                self._on_their_way.popleft()
            self._condition.notify_all()

    def sent(self, stamp_ns: int, complete: bool = True) -> None:
        """Note that an image set is on its way.

        Parameters
        ----------
        stamp_ns : of the image set.
        complete : whether all cameras are in it.
        """
        with self._condition:
            self._complete = complete
            self._on_their_way.append(stamp_ns)

    def wait(self) -> bool:
        """Wait until another image set may be sent; False when closed."""
        with self._condition:
            while not self._closed and len(self._on_their_way) >= self._size:
                answered, patience_s = self._answered, self._patience()
                began = time.monotonic()
                self._condition.wait(timeout=patience_s if self._told or self._answered else min(_TELL_S, patience_s))
                waited_s = time.monotonic() - began
                if self._answered == answered and not self._closed:
                    if waited_s >= patience_s:
                        self._grow(patience_s)
                    elif waited_s >= _TELL_S:
                        self._tell()
            return not self._closed

    def _tell(self) -> None:
        """Nobody has answered yet: it may still be compiling, or be another node than the one that is asked."""
        self._told = True
        said = f"waiting for an answer on {' or '.join(self._topics.values())}"
        if any(map(self._node.count_publishers, self._topics.values())):
            self._node.get_logger().info(f"{said}: the node compiles, or came after the images (--wait-for-subscribers 1)")
        else:
            self._node.get_logger().warning(f"{said}, which nobody publishes: --consumer names another node")

    def _patience(self) -> float:
        if not self._answered:
            return _FIRST_S
        return self._patience_s if self._complete else min(self._patience_s, _INCOMPLETE_S)

    def _grow(self, waited_s: float) -> None:
        if self._size < self._largest:
            self._size = min(2 * self._size, self._largest)
            if self._complete:
                self._node.get_logger().warning(
                    f"no answer of '{self._consumer}' for {waited_s:g} s; letting {self._size} image sets be on their way"
                )
        else:  # whoever should answer is gone: do not keep the images for ever
            self._on_their_way.popleft()

    def wait_for_all(self) -> bool:
        """Until everything sent is answered, or no answer comes any more; True if all were."""
        with self._condition:
            while not self._closed and self._on_their_way:
                patience_s = self._patience_s if self._answered else _FIRST_S
                if not self._condition.wait(timeout=patience_s):
                    break
            return not self._on_their_way

    def close(self) -> None:
        """Wake and release whoever waits."""
        with self._condition:
            self._closed = True
            self._condition.notify_all()


class CameraOutlet:
    """Publishers, message memory and calibration of one camera.

    Only one thread may publish. A calibration that the service takes holds from the next image on.

    Parameters
    ----------
    node : that publishes.
    camera : its lens and capture settings.
    depth : images that may wait for a slow subscriber.
    compressed : offer JPEG images too.
    mismatches : is informed when a subscriber wants what we do not offer.
    direct : where images are handed to another node of this process; then topics get them only while somebody else subscribes.

    Attributes
    ----------
    camera : with the lens that holds now.
    """

    def __init__(
        self,
        node: Node,
        camera: IngestCamera,
        depth: int,
        compressed: bool,
        mismatches: QosMismatches,
        direct: DirectImages | None = None,
    ):
        self.camera, self._direct = camera, direct
        name = camera.name

        def create(message_type, topic: str, qos: QoSProfile) -> Publisher:
            mismatches.of_publisher(topic, topic)
            return node.create_publisher(message_type, topic, **overridable(qos))

        self.infos = create(CameraInfo, f"{name}/camera_info", RESULT)
        self.images = self.compressed = None
        if camera.capture.publish != JPEG:
            self.images = create(Image, f"{name}/image_raw", images_published(depth))
        if compressed or self.images is None:
            self.compressed = create(CompressedImage, f"{name}/image_raw/compressed", images_published(depth))
        self._service = node.create_service(SetCameraInfo, f"{name}/set_camera_info", self._on_set_camera_info)
        self._logger = node.get_logger()
        self._published: tuple[CameraModel | None, tuple[int, int], str] | None = None
        self._native_size = (0, 0)

    def publish(self, image: SourceImage, native_size: tuple[int, int], stamp_ns: int) -> None:
        """Publish an image with its calibration.

        Parameters
        ----------
        image : decoded, or a JPEG.
        native_size : (width, height) of the source's images in pixels.
        stamp_ns : time of exposure.
        """
        self._native_size = native_size
        self._prepare(image)
        self._info.header.stamp = stamp_message(stamp_ns)
        self.infos.publish(self._info)
        if self._direct is not None:
            self._direct.hand_over(self.camera.name, image, stamp_ns)
        topic = self.images
        if topic is not None and image.pixels is not None and (self._direct is None or topic.get_subscription_count()):
            topic.publish(self._buffer.fill(stamp_ns, image.pixels))
        if self.compressed is not None and (image.pixels is None or self.compressed.get_subscription_count()):
            self.compressed.publish(self._compressed(image, stamp_ns))

    def _prepare(self, image: SourceImage) -> None:
        """Messages for images of this kind; they change with a new calibration, or another connection to the camera."""
        lens, size = self.camera.lens, image.size
        if self._published is not None and self._published[0] is lens and self._published[1:] == (size, image.encoding):
            return
        if image.pixels is not None:
            self._buffer = ImageBuffer(self.camera.frame_id, *size, image.encoding)
        if lens is None:
            self._info = CameraInfo(width=size[0], height=size[1])  # K of zeros: uncalibrated
            self._info.header.frame_id = self.camera.frame_id
        else:
            own = lens if (lens.width, lens.height) == size else lens.resized(*size)
            self._info = camera_info_message(0, self.camera.frame_id, own)
        self._published = lens, size, image.encoding

    def _compressed(self, image: SourceImage, stamp_ns: int) -> CompressedImage:
        as_it_came = image.pixels is None or (image.jpeg and image.size == self._native_size)
        return jpeg_message(stamp_ns, self.camera.frame_id, image.jpeg if as_it_came else jpeg_of(image.bgr))

    def has_subscribers(self, to_images: int, to_infos: int) -> bool:
        """Whether enough subscribers listen.

        Parameters
        ----------
        to_images, to_infos : least number of subscribers of images and of calibrations.

        Returns
        -------
        enough : for both.
        """
        images = self.images or self.compressed
        assert images is not None
        direct = self._direct is not None and self._direct.has_listener(self.camera.name)
        return images.get_subscription_count() + direct >= to_images and self.infos.get_subscription_count() >= to_infos

    def wait_until_delivered(self, timeout_s: float) -> None:
        """Until everything has arrived at those who listen."""
        for publisher in (self.images, self.compressed, self.infos):
            if publisher is not None:
                publisher.wait_for_all_acked(Duration(seconds=timeout_s))

    def _on_set_camera_info(self, request: SetCameraInfo.Request, response: SetCameraInfo.Response) -> SetCameraInfo.Response:
        try:
            path = self._take(request.camera_info)
        except TrackerError as error:
            response.success, response.status_message = False, str(error)
            self._logger.error(f"{self.camera.name}: calibration refused: {error}")
            return response
        response.success, response.status_message = True, f"kept in {path}"
        if self.camera.of_rig and not self.camera.capture.camera_info_url:
            response.status_message += (
                "; at the next start the rig file's lens counts again, unless camera_info_url names this file"
            )
        self._logger.info(f"{self.camera.name}: calibration {response.status_message}")
        return response

    def _take(self, message: CameraInfo) -> Path:
        name = self.camera.name
        lens = lens_of(name, message)
        if self._published is None:
            raise CalibrationError(name, "no image has been published yet, so the size of its images is not known")
        _, size, _ = self._published
        if (lens.width, lens.height) != size:
            expected, got = f"{size[0]}x{size[1]}", f"{lens.width}x{lens.height}"
            raise CalibrationError(name, f"expected a calibration for images of {expected}, got one for {got}")
        if size != self._native_size:
            lens = lens.resized(*self._native_size)
        path = save_lens(self.camera.capture.camera_info_url or "", name, lens)
        self.camera = replace(self.camera, lens=lens)
        return path


CAMERA_INFO = "sensor_msgs/msg/CameraInfo"


class InputRecorder:
    """Writes ``/<cam>/image_raw``, or ``/<cam>/image_raw/compressed`` of JPEG images, and ``/<cam>/camera_info`` where known.

    `record` may be called from several threads; it never waits for the disk. What that cannot take is counted.

    Raises
    ------
    BagExistsError : there is something already.
    """

    def __init__(self, path: Path):
        self._bag = BagQueue(BagWriter(path))

    def record(self, camera: IngestCamera, stamp_ns: int, content: np.ndarray | bytes, bayer: str | None = None) -> None:
        """Write an image as its source gave it, and its calibration.

        Parameters
        ----------
        camera : whose image it is.
        stamp_ns : time of exposure.
        content : (h, w, 3) BGR, (h, w) gray or mosaic, or the bytes of a JPEG.
        bayer : pattern of a mosaic; None: there is none.
        """
        if isinstance(content, bytes):
            image = jpeg_message(stamp_ns, camera.frame_id, content)
            type_name, topic = COMPRESSED, "image_raw/compressed"
        else:
            image = image_message(stamp_ns, camera.frame_id, content, _encoding(content, bayer))
            type_name, topic = RAW, "image_raw"
        self._put(f"/{camera.name}/{topic}", type_name, stamp_ns, image)
        if camera.lens is not None:
            info = camera_info_message(stamp_ns, camera.frame_id, camera.lens)
            self._put(f"/{camera.name}/camera_info", CAMERA_INFO, stamp_ns, info)

    def _put(self, topic: str, type_name: str, stamp_ns: int, message) -> None:
        self._bag.add_topic(topic, type_name, OfferedQos(), message_type(type_name))
        self._bag.put(topic, stamp_ns, serialize_message(message))

    @property
    def problem(self) -> str:
        """Why nothing can be written any more; empty if it can."""
        return self._bag.problem

    @property
    def written(self) -> int:
        """Messages in the bag."""
        return sum(self._bag.written.values())

    @property
    def dropped(self) -> int:
        """Messages for which the disk was too slow."""
        return sum(self._bag.dropped.values())

    def abandon(self) -> None:
        """Leave out what waits."""
        self._bag.abandon()

    def close(self) -> None:
        """Write what waits, and the bag's index.

        Raises
        ------
        TrackerError : the disk is full, or the like.
        """
        self._bag.close()


def _encoding(pixels: np.ndarray, bayer: str | None) -> str:
    if pixels.ndim == 3:
        return "bgr8"
    return f"bayer_{bayer}8" if bayer else "mono8"


@dataclass
class CameraCounts:
    """Counts since the start, for /diagnostics and the last line of the node."""

    published: int = 0
    dropped: int = 0  # left out to keep the rate: published later, they would have delayed newer ones
    skipped: int = 0  # not even decoded as a whole: their time was over
    late: int = 0  # published more than half a period after their time
    duplicated: int = 0  # same pixels as the image before (published all the same)
    missing: int = 0  # announced by the file, but not there
    unusable: int = 0  # of another size than the calibration, or damaged
    unstamped: int = 0  # second fields before the rate was known
    connections: int = 0  # to a live source

    def values(self) -> dict[str, int]:
        """The counts by name."""
        return asdict(self)
