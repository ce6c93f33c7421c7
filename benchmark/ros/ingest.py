#!/usr/bin/env python3
"""What it takes to publish four full HD cameras: files of 1920x1080 at 30 Hz, decoded, halved and sent in real time.

The files are made here: a textured, noisy ground that moves, MPEG-4 (what OpenCV can write everywhere), each image with its
number as a pattern of black and white squares. The sender is `tracker_node camera_ingest --shrink 2`; the receiver, a process of
its own, reads stamps and numbers. An image is lost if it has not come, and wrong if its number is not that of its stamp. Latency
is from the stamp, the time at which the image was due, to its arrival. Cores are processor time over time, all threads of the
process; on a machine that is busy with other things both processes get less than they need, and images are late or left out.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import sys
import tempfile
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import cv2
import numpy as np

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.errors import TrackerError
from tracker_node.loaders.images.source import open_source
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.report.metrics_file import report_metrics

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.ros.transport import cpu_s, wait_until

WIDTH, HEIGHT, RATE_HZ, N_CAMERAS = 1920, 1080, 30.0, 4
SHRINK = 2
SECONDS = {"quick": 6.0, "full": 20.0}
SQUARE, N_BITS = 32, 12  # of the pattern that holds an image's number
_EDGE_S = 1.0  # at both ends, in which processor time is not counted


def write_videos(folder: Path, seconds: float) -> list[Path]:
    """A file for each camera; those that are there already stay."""
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / f"cam{c + 1}_{seconds:g}s.mp4" for c in range(N_CAMERAS)]
    missing = [(c, file) for c, file in enumerate(files) if not file.exists()]
    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda item: _write_video(*item, round(seconds * RATE_HZ)), missing))
    return files


def _write_video(camera: int, file: Path, n_images: int) -> None:
    random = np.random.default_rng(camera)
    coarse = random.integers(0, 256, (HEIGHT // 8, WIDTH // 8, 3), dtype=np.uint8)
    ground = cv2.resize(coarse, (WIDTH + 400, HEIGHT + 200), interpolation=cv2.INTER_CUBIC)
    noise = [random.integers(0, 10, (HEIGHT, WIDTH, 3), dtype=np.uint8) for _ in range(3)]
    unfinished = file.with_name(f".{file.name}.{os.getpid()}.mp4")
    writer = cv2.VideoWriter(str(unfinished), cv2.VideoWriter.fourcc(*"mp4v"), RATE_HZ, (WIDTH, HEIGHT))
    for i in range(n_images):
        x, y = (round(a * (1.0 + np.sin(0.05 * i + camera + a))) for a in (200.0, 100.0))
        image = cv2.add(ground[y : y + HEIGHT, x : x + WIDTH], noise[i % 3])
        for bit in range(N_BITS):
            image[:SQUARE, bit * SQUARE : (bit + 1) * SQUARE] = 235 * (i >> bit & 1)
        writer.write(image)
    writer.release()
    unfinished.rename(file)


def number_of(pixels: np.ndarray) -> int:
    """The number in the pattern of a received image."""
    side = SQUARE // SHRINK
    middles = pixels[side // 2, side // 2 : N_BITS * side : side, 1]
    return int((middles > 128) @ (1 << np.arange(N_BITS)))


def write_rig(files: list[Path], rig_file: Path) -> None:
    """Cameras for these videos."""
    cameras = []
    for c, file in enumerate(files):
        source = open_source(file)
        width, height = source.width, source.height
        K = np.array([[1500.0, 0.0, (width - 1) / 2], [0.0, 1500.0, (height - 1) / 2], [0.0, 0.0, 1.0]])
        cameras.append(Camera(f"cam{c + 1}", CameraModel(width, height, K), np.eye(4), source=str(file.resolve())))
    write_rig_file(rig_file_of(CameraRig(tuple(cameras))), rig_file)


def measure(files: list[Path], options: list[str]) -> dict[str, float | int]:
    """Run both processes, and compare what the files hold with what came."""
    from tracker_node.ros.child_process import Child

    n_expected = sum(open_source(file).n_images for file in files)
    with tempfile.TemporaryDirectory(prefix="ingest_") as name:
        folder = Path(name)
        rig_file, result_file, ready_file = folder / "rig.yaml", folder / "received.json", folder / "ready"
        write_rig(files, rig_file)
        receiver = Child(["--receiver", str(rig_file), str(result_file), str(ready_file)], program=[__file__])
        said: list[str] = []
        usage: list[tuple[float, float, float]] = []
        try:
            wait_until("the receiver's start", ready_file.exists, 60.0)
            sender = Child(["camera_ingest", "--rig", str(rig_file), "--wait-for-subscribers", "1", *options], said.append)
            try:
                wait_until("the first image", lambda: ready_file.read_text() == "receiving", 60.0)
                while sender.returncode is None:
                    try:
                        usage.append((time.monotonic(), cpu_s(sender.pid), cpu_s(receiver.pid)))
                    except OSError:  # it has just ended
                        break
                    time.sleep(0.1)
            finally:
                sender.end(20.0)
            time.sleep(0.5)
        finally:
            receiver.end(20.0)
        received = json.loads(result_file.read_text())
    return figures(n_expected, said, received, usage)


def figures(n_expected: int, said: list[str], received: dict, usage: list[tuple[float, float, float]]) -> dict[str, float | int]:
    """The metrics of a run."""
    counted: dict[str, int] = {}
    for n, key in re.findall(r"(\d+) (\w+)", "\n".join(line.partition(": ")[2] for line in said)):
        counted[key] = counted.get(key, 0) + int(n)
    latencies = np.array(received["latencies_ms"])
    steady = [u for u in usage if usage[0][0] + _EDGE_S <= u[0] <= usage[-1][0] - _EDGE_S]
    elapsed_s, sender_s, receiver_s = (b - a for a, b in zip(steady[0], steady[-1], strict=True))
    return {
        "ingest.cameras": N_CAMERAS,
        "ingest.images": n_expected,
        "ingest.lost": n_expected - len(latencies),
        "ingest.wrong": received["wrong"],
        "ingest.published": counted.get("published", 0),
        "ingest.skipped_to_keep_the_rate": counted.get("dropped", 0) + counted.get("skipped", 0),
        "ingest.rate_hz": len(latencies) / N_CAMERAS / (received["span_s"] + 1.0 / RATE_HZ),
        "ingest.cpu_cores": sender_s / elapsed_s,
        "ingest.receiver_cpu_cores": receiver_s / elapsed_s,
        **{f"ingest.latency_ms_p{p}": float(np.percentile(latencies, p)) for p in (50, 95, 99)},
        "ingest.latency_ms_max": float(latencies.max()),
        "ingest.load_average": os.getloadavg()[0],
    }


def receive(rig_file: str, result_file: str, ready_file: str) -> int:
    """The receiving process: subscribe, note stamps and arrivals, write them down at the end."""
    from rclpy.node import Node
    from sensor_msgs.msg import Image

    from tracker_node.ros.conversions import decode_raw_image
    from tracker_node.ros.executor import ros_process, spin
    from tracker_node.ros.qos import images_published

    arrived: dict[str, list[tuple[int, int, int]]] = {name: [] for name in load_rig(rig_file).names}
    began = threading.Event()

    def subscribe(node: Node, camera: str) -> None:
        def on_image(data: bytes) -> None:
            now_ns = time.time_ns()
            image = decode_raw_image(camera, data)
            arrived[camera].append((image.stamp_ns, now_ns, number_of(image.pixels)))
            if not began.is_set():
                began.set()
                Path(ready_file).write_text("receiving")

        node.create_subscription(Image, f"{camera}/image_raw", on_image, images_published(50), raw=True)

    with ros_process([]) as stop:
        node = Node("ingest_receiver")
        for camera in arrived:
            subscribe(node, camera)
        Path(ready_file).write_text("ready")
        spin(node, stop)
        node.destroy_node()
    stamps = [stamp for images in arrived.values() for stamp, _, _ in images]
    first = min(stamps)
    wrong = sum(
        round((stamp - first) * 1e-9 * RATE_HZ) % (1 << N_BITS) != number
        for images in arrived.values()
        for stamp, _, number in images
    )
    result = {
        "latencies_ms": [1e-6 * (now - stamp) for images in arrived.values() for stamp, now, _ in images],
        "wrong": wrong,
        "span_s": 1e-9 * (max(stamps) - first),
    }
    Path(result_file).write_text(json.dumps(result))
    return 0


def main() -> int:
    parser = parser_of(
        __doc__,
        "python benchmark/ros/ingest.py --quick --json out/benchmark/ingest.json",
        f"{SECONDS['quick']:g} s instead of {SECONDS['full']:g}",
    )
    parser.add_argument(
        "--cache", type=Path, default=Path("out/benchmark/ingest"), help="where the videos are kept (%(default)s)"
    )
    parser.add_argument("--decode-threads", type=int, metavar="N", default=1, help="of each camera (default: %(default)s)")
    parser.add_argument("--no-frame-skip", action="store_true", help="publish late images instead of leaving them out")
    parser.add_argument("--receiver", nargs=3, metavar=("RIG", "RESULT", "READY"), help=argparse.SUPPRESS)
    args = parser.parse_args()
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    if args.receiver:
        return receive(*args.receiver)
    options = ["--shrink", str(SHRINK), "--decode-threads", str(args.decode_threads)]
    options += ["--no-frame-skip"] * args.no_frame_skip
    try:
        metrics = measure(write_videos(args.cache, SECONDS["quick" if args.quick else "full"]), options)
    except TrackerError as error:
        print(f"ingest: error: {error}", file=sys.stderr)
        return 2
    report_metrics(metrics, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
