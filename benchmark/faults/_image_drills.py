"""Faults of images and calibrations: late, doubled, in another order, damaged, of another size, with wrong clocks."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterable
from itertools import pairwise

import numpy as np
from sensor_msgs.msg import CameraInfo, CompressedImage, Image

from benchmark.faults._graph import ERROR, OK, PERIOD_NS, WARN, Drill, Graph, N, Outcome, Sender, image_set_of, load_rig
from helpers.ros.graph import stamps
from tracker_node.ros.conversions import camera_info_message, jpeg_message
from tracker_node.ros.qos import images_published
from tracker_node.runs.messages import jpeg_of

CAMERA = "tracker: cam2"
EVERY_S = 0.2  # a set, while a report is waited for
FATES = ("used", "late", "duplicate", "incomplete", "too_old", "ahead", "clock_jump", "reset", "waiting")


def begun(graph: Graph, *options: str) -> Sender:
    """A tracker that takes everything, tracking."""
    graph.tracker("--lossless", *options)
    sender = graph.sender()
    sender.tracked(5)
    return sender


def _receiving_again(graph: Graph, send: Callable[[], None]) -> None:
    """Sends sets, one at a time, until the camera is said to be fine, which is said only while images come."""
    mark, sent_s = len(graph.said), 0.0

    def said() -> bool:
        nonlocal sent_s
        if time.monotonic() - sent_s > EVERY_S:
            send()
            sent_s = time.monotonic()
        return any(part.endswith(CAMERA) and level == OK and "receiving" in text for part, level, text in graph.said[mark:])

    graph.until(said, f"'{CAMERA}' says that it is receiving again")


def sound_again(graph: Graph, sender: Sender, n_missing: int = 0) -> None:
    """More sound sets; all sets so far have a state but for so many at most, and the camera is fine."""
    sender.sets(12)
    _receiving_again(graph, sender.sets)
    n_expected = sender.number - n_missing
    graph.until(lambda: len(graph.states) >= n_expected, f"{n_expected} states")


def _refused(damage: Callable[[Image], Image], *texts: str) -> Callable[[Graph], Outcome]:
    def inject(graph: Graph) -> Outcome:
        sender = begun(graph)
        sender.sets(3, {"cam2": lambda image: [damage(image)]})
        said = graph.wait_said(CAMERA, ERROR, *texts)
        sound_again(graph, sender)
        refused = graph.count(CAMERA, "refused")
        return Outcome(
            f"ERROR cam2: {said}; then OK; {len(graph.states)} of {sender.number} sets tracked", f"{refused} images", refused == 3
        )

    return inject


def truncated(image: Image) -> Image:
    image._data = image.data[: len(image.data) // 2]
    return image


def _smaller(image: Image) -> Image:
    pixels = np.frombuffer(image.data, np.uint8).reshape(image.height, image.width, 3)[::2, ::2]
    small = Image(height=pixels.shape[0], width=pixels.shape[1], encoding="bgr8", step=3 * pixels.shape[1])
    small.header, small.data = image.header, pixels.tobytes()
    return small


def _of_floats(image: Image) -> Image:
    image.encoding, image.step = "32FC3", 12 * image.width
    return image


def _late(graph: Graph) -> Outcome:
    sender = begun(graph)
    held: list[Image] = []
    sender.sets(1, {"cam2": lambda image: held.append(image) or []})  # type: ignore[func-returns-value]
    sender.sets(4)
    graph.until(lambda: len(graph.states) >= 10, "states")
    sender.publish("cam2", held[0])
    sound_again(graph, sender)
    graph.until(lambda: graph.count(CAMERA, "late") == 1, "one image counted as late")
    return Outcome(f"set tracked without it; 1 counted as late; {len(graph.states)} of {sender.number} sets tracked", "1 image")


def _doubled(graph: Graph) -> Outcome:
    sender = begun(graph)
    sender.sets(4, {"cam2": lambda image: [image, image]})
    sound_again(graph, sender)
    graph.until(lambda: graph.count(CAMERA, "duplicate") == 4, "four images counted as duplicate")
    seen = f"4 counted as duplicate; {len(graph.states)} of {sender.number} sets tracked, once each"
    return Outcome(seen, "nothing", len(graph.states) == sender.number)


def _reordered(graph: Graph) -> Outcome:
    sender = begun(graph)
    for _ in range(4):  # the second image of cam2 before the first, whose partners wait
        first, second = sender.number, sender.number + 1
        for camera, order in (("cam1", (first, second)), ("cam2", (second, first)), ("cam3", (first, second))):
            for number in order:
                sender.publish(camera, sender.message(camera, number))
        sender.number += 2
    sound_again(graph, sender, 4)
    values = {key: int(value) for key, value in graph.values[CAMERA].items() if key in FATES or key == "received"}
    stamps_ns = stamps(graph.states)
    forward = all(a < b for a, b in pairwise(stamps_ns))
    accounted = sum(values[fate] for fate in FATES) == values["received"]
    seen = f"{len(stamps_ns)} of {sender.number} sets tracked, in order; all images accounted for"
    return Outcome(seen, f"{values['late']} images", forward and accounted)


def _clock_back(graph: Graph) -> Outcome:
    sender = begun(graph)
    sender.offset_ns -= 500_000_000
    before = len(graph.states)
    sender.sets(8)
    graph.until(lambda: len(graph.states) >= before + 7, f"states after the jump, of {len(graph.states)}")
    said = graph.wait_said("tracker: clock", WARN, "went back")
    graph.wait_said("tracker: clock", OK, "forward", since=len(graph.said))
    went_back = any(b < a for a, b in pairwise(stamps(graph.states)))
    n = len(graph.states) - before
    seen = f"WARN clock: {said}; then OK; {n} of 8 sets tracked after the jump"
    return Outcome(seen, f"{8 - n} sets", went_back and 7 <= n <= 8)


def _offset_jumps(graph: Graph) -> Outcome:
    sender = begun(graph)
    sender.sets(20, shift_ns=10 * 10**9)
    said = graph.wait_said(CAMERA, WARN, "in no set")
    graph.until(lambda: len(graph.states) >= 24, f"24 states, of {len(graph.states)}")
    sender.sets(20)
    _receiving_again(graph, sender.sets)
    graph.until(lambda: len(graph.states) >= sender.number - 2, f"{sender.number - 2} states")
    values = graph.values[CAMERA]
    lost = sum(int(values[key]) for key in ("ahead", "incomplete", "too_old", "clock_jump"))
    return Outcome(
        f"WARN cam2: {said}; then OK; {len(graph.states)} of {sender.number} sets tracked",
        f"{lost} images of cam2",
        20 <= lost <= 22,
    )


def _bad_jpeg(graph: Graph) -> Outcome:
    graph.tracker("--lossless", "--compressed")
    create, names = graph.probe.node.create_publisher, load_rig(graph.recording / "rig.yaml").names
    publishers = {name: create(CompressedImage, f"{name}/image_raw/compressed", images_published(50)) for name in names}
    graph.until(lambda: all(publisher.get_subscription_count() for publisher in publishers.values()), "subscriptions")

    def send(numbers: Iterable[int], n_bytes: int | None = None) -> None:
        for i in numbers:
            for image in image_set_of(graph.recording, i % N).images:
                message = jpeg_message(10**9 + i * PERIOD_NS, "", jpeg_of(image.pixels))
                message._data = message.data[: n_bytes if image.camera == "cam2" else None]
                publishers[image.camera].publish(message)

    send(range(5))
    graph.wait_for_states(5)
    send(range(5, 8), n_bytes=40)
    said = graph.wait_said(CAMERA, ERROR, "cam2", "cannot decode")
    numbers = itertools.count(8)
    _receiving_again(graph, lambda: send([next(numbers)]))
    n = next(numbers)
    graph.until(lambda: len(graph.states) >= n, f"{n} states")
    refused = graph.count(CAMERA, "refused")
    return Outcome(f"ERROR cam2: {said}; then OK; {len(graph.states)} of {n} sets tracked", f"{refused} images", refused == 3)


def _calibration(spoil: Callable[[CameraInfo], None], *texts: str) -> Callable[[Graph], Outcome]:
    def inject(graph: Graph) -> Outcome:
        graph.tracker("--lossless", "--calibration", "camera_info")
        sender = graph.sender()

        def calibrate(spoilt: bool) -> None:
            for camera in sender.rig:
                info = camera_info_message(10**9, camera.frame_id, camera.model)
                if spoilt and camera.name == "cam2":
                    spoil(info)
                sender.cameras.infos[camera.name].publish(info)

        def calibrated(spoilt: bool, level: bytes, *texts: str) -> str:
            """What is said; calibrations come with each image in real graphs, so that none is lost for good."""
            mark, sent_s = len(graph.said), 0.0

            def found() -> list[str]:
                nonlocal sent_s
                if time.monotonic() - sent_s > EVERY_S:
                    calibrate(spoilt)
                    sent_s = time.monotonic()
                new = [text for name, at, text in graph.said[mark:] if name == "tracker: calibration" and at == level]
                return [text for text in new if all(part in text for part in texts)]

            graph.until(found, f"'tracker: calibration' says {texts}")
            return found()[0]

        said = calibrated(True, ERROR, "cam2", *texts)
        tracked_meanwhile = len(graph.states)
        calibrated(False, OK, "complete")
        sender.tracked(5)
        seen = f"ERROR calibration: {said}; nothing tracked; the right one is taken: 5 of 5 sets tracked"
        return Outcome(seen, "nothing", tracked_meanwhile == 0)

    return inject


def _nan(info: CameraInfo) -> None:
    info.k[0] = float("nan")


def _uncalibrated(info: CameraInfo) -> None:
    info.k[:] = 0.0


def _region_beyond(info: CameraInfo) -> None:
    info.roi.x_offset = 2**32 - 1


def _no_focal_length(info: CameraInfo) -> None:
    info.k[0] = 1e-300


DRILLS = (
    Drill("image late", "its set goes on without it after the queue's time; counted as late", _late),
    Drill("image doubled", "counted as duplicate, each set tracked once", _doubled),
    Drill("images in another order", "sets in order; every image used or counted", _reordered),
    Drill(
        "image data shorter than announced",
        "refused, the camera named; the others go on",
        _refused(truncated, "contradicts itself"),
    ),
    Drill("image of another size", "refused, both sizes named; the others go on", _refused(_smaller, "calibration", "80x60")),
    Drill("image of another encoding", "refused, the encoding named; the others go on", _refused(_of_floats, "32FC3")),
    Drill("damaged JPEG", "refused, the camera named; the others go on", _bad_jpeg),
    Drill("clock jumps back", "the tracker begins again by itself", _clock_back),
    Drill("a camera's clock jumps ahead", "sets of the others go on, its images counted; whole again after", _offset_jumps),
    Drill("calibration with NaN", "named, nothing tracked; the right one is taken", _calibration(_nan, "nan")),
    Drill("uncalibrated camera", "named, nothing tracked; the right one is taken", _calibration(_uncalibrated, "uncalibrated")),
    Drill(
        "calibration with a region beyond the image",
        "named, nothing tracked; the right one is taken",
        _calibration(_region_beyond, "roi", "4294967295"),
    ),
    Drill(
        "calibration with a focal length of 1e-300",
        "named, nothing tracked; the right one is taken",
        _calibration(_no_focal_length, "fx", "1e-300"),
    ),
)
