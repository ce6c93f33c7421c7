"""What one camera publishes: images, JPEG images, calibrations; and the service that takes a new calibration."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from sensor_msgs.srv import SetCameraInfo

from ...camera.model import CameraModel
from ...errors import CalibrationError, TrackerError
from ...loaders.decoding import JPEG, SourceImage
from ...loaders.rig.camera_info import save_lens
from ...runs.messages import lens_of
from ..conversions import ImageBuffer, camera_info_message, compressed_message, jpeg_message, stamp_message
from ..qos import RESULT, images_published, overridable
from ..qos_mismatch import QosMismatches
from .cameras import IngestCamera


class CameraOutlet:
    """Publishers, message memory and calibration of one camera.

    Only one thread may publish. A calibration that the service takes holds from the next image on.

    Attributes
    ----------
    camera : with the lens that holds now.
    """

    def __init__(self, node: Node, camera: IngestCamera, depth: int, compressed: bool, mismatches: QosMismatches):
        self.camera = camera
        name = camera.name

        def create(message_type, topic: str, qos: QoSProfile) -> Publisher:
            events = mismatches.of_publisher(topic, topic)
            return node.create_publisher(message_type, topic, **overridable(qos), event_callbacks=events)

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
        """Publish an image with its calibration; ``native_size`` is (width, height) of the source's images."""
        self._native_size = native_size
        self._prepare(image)
        self._info.header.stamp = stamp_message(stamp_ns)
        self.infos.publish(self._info)
        if self.images is not None and image.pixels is not None:
            self.images.publish(self._buffer.fill(stamp_ns, image.pixels))
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
        if as_it_came:
            return jpeg_message(stamp_ns, self.camera.frame_id, image.jpeg)
        return compressed_message(stamp_ns, self.camera.frame_id, image.bgr)

    def has_subscribers(self, to_images: int, to_infos: int) -> bool:
        """Whether so many listen."""
        images = self.images or self.compressed
        assert images is not None
        return images.get_subscription_count() >= to_images and self.infos.get_subscription_count() >= to_infos

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
