#!/usr/bin/env python3
"""How well `tracker_node synchronize` brings cameras to one time, by sound, by flashes, by a light and by motion.

Recordings are drawn by seed. Four cameras on a circle about a room, with rates of 25, 29.97, 30 and 59.94 Hz, are started up to
0.8 s apart. Sound: five claps at a known place, with a room's echoes (0.4 s), noise at a thirtieth of their strength, gains from
0.3 to 3, AAC in MP4; ``sync.sound_ms``, and ``sync.sound_somewhere_ms`` where the place is not said: half a meter at most from
where the cameras look. Flashes: 20 of 5 ms at uneven times in a minute, before somebody who moves and lamps that hum; one
that falls between two exposures is not seen. Blinking: a small light that is on and off for 0.3 to 0.9 s at a time, before the
same. Motion: the mannequin of `calibration.py`, one of four cameras running freely.
Errors are of each camera against the mean of the others: root of the mean square, and the largest.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import av
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # the repository

from benchmark._arguments import parser_of
from benchmark.calibration._time import FREE, record_free_running
from benchmark.contour._runs import print_circumstances
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.cli.main import main as tracker_node
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.report.metrics_file import report_metrics
from tracker_node.synthesis.recording import default_motions

RATES_HZ = (25.0, 30000 / 1001, 30.0, 60000 / 1001)
SOUND_HZ, SPEED_OF_SOUND = 48_000, 343.0
LATEST_S, DISTANCES_M, HEIGHTS_M = 0.8, (2.5, 4.5), (1.0, 2.2)
N_CLAPS, CLIP_S, ECHO_S = 5, 12.0, 0.4
N_FLASHES, FLASH_S, FLASHED_S, EXPOSED = 20, 0.005, 60.0, 0.9
BLINKING_S = 30.0
SIZE = (64, 36)
SEEDS = {"quick": 2, "full": 8}


@dataclass(frozen=True, eq=False)
class Room:
    """Cameras and when they were started: the clock of each is behind common time by so much."""

    rig: CameraRig
    late_s: np.ndarray


def make_room(seed: int) -> Room:
    rng = np.random.default_rng([seed, 11])
    cameras = []
    for i, angle in enumerate(np.linspace(0.0, 2.0 * np.pi, len(RATES_HZ), endpoint=False) + rng.uniform(-0.3, 0.3, 4)):
        distance, height = rng.uniform(*DISTANCES_M), rng.uniform(*HEIGHTS_M)
        center = np.array([distance * np.cos(angle), distance * np.sin(angle), height])
        ahead = np.array([0.0, 0.0, 1.0]) - center
        ahead /= np.linalg.norm(ahead)
        right = np.cross(ahead, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = np.column_stack([right, np.cross(ahead, right), ahead]), center
        K = np.array([[60.0, 0.0, 31.5], [0.0, 60.0, 17.5], [0.0, 0.0, 1.0]])
        cameras.append(Camera(f"cam{i + 1}", CameraModel(*SIZE, K), T, source=f"cam{i + 1}.mp4"))
    return Room(CameraRig(tuple(cameras)), rng.uniform(0.0, LATEST_S, len(cameras)))


def write_sounds(room: Room, folder: Path, seed: int, place: np.ndarray) -> None:
    """Videos of black images with what each camera's microphone hears of claps at a place."""
    rng = np.random.default_rng([seed, 12])
    claps_s = np.sort(rng.uniform(1.5, CLIP_S - 1.5, N_CLAPS))
    n = np.arange(round(0.03 * SOUND_HZ))
    claps = [rng.normal(size=len(n)) * np.exp(-n / (0.004 * SOUND_HZ)) * rng.uniform(0.5, 1.0) for _ in claps_s]
    for camera, late_s, rate_hz in zip(room.rig, room.late_s, RATES_HZ, strict=True):
        way_s = float(np.linalg.norm(camera.center - place)) / SPEED_OF_SOUND
        track = np.zeros(round((CLIP_S + 1.0) * SOUND_HZ))
        for at_s, clap in zip(claps_s, claps, strict=True):
            _add(track, clap, (at_s + way_s - late_s) * SOUND_HZ)
        m = np.arange(round(ECHO_S * SOUND_HZ))
        tail = rng.normal(size=len(m)) * np.exp(-6.9 * m / len(m)) * (m > 0.004 * SOUND_HZ) * 0.06
        tail[0] = 1.0
        heard = np.convolve(track, tail)[: len(track)]
        heard *= rng.uniform(0.3, 3.0) * 0.15 / np.abs(heard).max()
        heard += 0.1 * np.abs(heard).max() / 3.0 * rng.normal(size=len(heard))
        images = (np.zeros((SIZE[1], SIZE[0], 3), np.uint8) for _ in range(round(CLIP_S * rate_hz)))
        write_video(folder / camera.source, images, rate_hz, np.clip(heard, -1.0, 1.0).astype(np.float32))


def _add(track: np.ndarray, clap: np.ndarray, at: float) -> None:
    """A clap at a place between two samples."""
    first, part = int(np.floor(at)), at - np.floor(at)
    moved = np.fft.irfft(np.fft.rfft(clap, 4096) * np.exp(-2j * np.pi * np.fft.rfftfreq(4096) * part), 4096)
    track[first : first + 4096] += moved[: len(track) - first]


def write_flashes(room: Room, folder: Path, seed: int) -> None:
    """Videos of a room with somebody who moves, and flashes."""
    rng = np.random.default_rng([seed, 13])
    flashes_s = np.sort(rng.uniform(2.0, FLASHED_S - 2.0, N_FLASHES))
    for camera, late_s, rate_hz in zip(room.rig, room.late_s, RATES_HZ, strict=True):
        middles = np.arange(round(FLASHED_S * rate_hz)) / rate_hz + late_s  # of the exposures, in common time
        half = 0.5 * EXPOSED / rate_hz
        parts = np.zeros(len(middles))
        for at_s in flashes_s:
            parts += np.clip(np.minimum(middles + half, at_s + FLASH_S) - np.maximum(middles - half, at_s), 0.0, None) / FLASH_S
        still = rng.uniform(40.0, 120.0, (SIZE[1], SIZE[0], 3))
        shown = enumerate(zip(middles, parts, strict=True))
        images = (_lit(still, t, part, np.random.default_rng([seed, i])) for i, (t, part) in shown)
        write_video(folder / camera.source, images, rate_hz)


def write_blinking(room: Room, folder: Path, seed: int, seconds: float = BLINKING_S) -> None:
    """Videos of a room with somebody who moves, and a small light that blinks."""
    rng = np.random.default_rng([seed, 15])
    edges_s = np.cumsum(rng.uniform(0.3, 0.9, round(seconds / 0.3)))
    for camera, late_s, rate_hz in zip(room.rig, room.late_s, RATES_HZ, strict=True):
        middles = np.arange(round(seconds * rate_hz)) / rate_hz + late_s
        half, lit_s = 0.5 * EXPOSED / rate_hz, _lit_until(edges_s)
        on = (lit_s(middles + half) - lit_s(middles - half)) / (2.0 * half)
        still, at = rng.uniform(40.0, 120.0, (SIZE[1], SIZE[0], 3)), (rng.integers(2, 8), rng.integers(50, 60))
        shown = enumerate(zip(middles, on, strict=True))
        images = (_with_light(still, t, part, at, np.random.default_rng([seed, i])) for i, (t, part) in shown)
        write_video(folder / camera.source, images, rate_hz)


def _lit_until(edges_s: np.ndarray) -> Callable[[np.ndarray], np.ndarray]:
    """How long the light has been on until a time; it is off at first."""
    on, off = edges_s[0::2], edges_s[1::2]
    on = on[: len(off)]
    return lambda t: np.clip(t[:, None] - on, 0.0, off - on).sum(axis=1)


def _with_light(still: np.ndarray, t: float, part: float, at: tuple[int, int], rng: np.random.Generator) -> np.ndarray:
    image = _lit(still, t, 0.0, rng).astype(float)
    image[at] += part * 90.0
    return np.clip(image, 0, 255).astype(np.uint8)


def _lit(still: np.ndarray, t: float, flash: float, rng: np.random.Generator) -> np.ndarray:
    image = still * (1.0 + 0.01 * np.sin(2.0 * np.pi * 7.3 * t)) + 60.0 * flash
    u, v = int(32 + 20 * np.sin(0.9 * t)), int(16 + 6 * np.sin(1.7 * t))
    image[v : v + 12, u : u + 8] = 30.0 + 40.0 * flash
    return np.clip(image + rng.normal(0.0, 3.0, image.shape), 0, 255).astype(np.uint8)


def write_video(path: Path, images, rate_hz: float, sound: np.ndarray | None = None, size: tuple[int, int] = SIZE) -> None:
    """An MP4 of images (h, w, 3) BGR, with sound where there is any.

    Parameters
    ----------
    path, images, rate_hz : of the video.
    sound : (n,) float32 at `SOUND_HZ`.
    size : (width, height) of the images.
    """
    with av.open(str(path), "w") as container:
        video = container.add_stream("mpeg4", rate=Fraction(rate_hz).limit_denominator(1001))
        video.width, video.height, video.pix_fmt, video.bit_rate = *size, "yuv420p", 2_000_000 if size == SIZE else 20_000_000
        audio = None
        if sound is not None:
            audio = container.add_stream("aac", rate=SOUND_HZ)
            audio.layout = "mono"
        for i, image in enumerate(images):
            frame = av.VideoFrame.from_ndarray(image, format="bgr24")
            frame.pts = i
            container.mux(video.encode(frame))
        container.mux(video.encode())
        if sound is not None and audio is not None:
            for first in range(0, len(sound), 1024):
                frame = av.AudioFrame.from_ndarray(sound[None, first : first + 1024], format="fltp", layout="mono")
                frame.sample_rate, frame.pts = SOUND_HZ, first
                container.mux(audio.encode(frame))
            container.mux(audio.encode())


def errors_ms(room: Room, folder: Path, *options: str) -> np.ndarray:
    """Of each camera's offset against the mean of the others."""
    write_rig_file(rig_file_of(room.rig), folder / "rig.yaml")
    output = folder / "rig_timed.yaml"
    arguments = ["synchronize", "--rig", str(folder / "rig.yaml"), "-o", str(output), "--force", "--quiet", *options]
    if tracker_node(arguments) != 0:
        return np.full(len(room.rig), np.nan)
    found = np.array([1e-9 * camera.time_offset_ns for camera in load_rig(output)])
    n = len(found)
    off = found - room.late_s
    return 1e3 * (off - off.mean()) * n / (n - 1)


def by_sound(seed: int, folder: Path) -> dict[str, np.ndarray]:
    room, rng = make_room(seed), np.random.default_rng([seed, 14])
    place = np.array([0.0, 0.0, 1.0]) + rng.uniform(-0.3, 0.3, 3)
    write_sounds(room, folder, seed, place)
    known = errors_ms(room, folder, "--by", "sound", "--at", *map(str, place))
    return {"sound": known, "sound_somewhere": errors_ms(room, folder, "--by", "sound")}


def by_flash(seed: int, folder: Path) -> dict[str, np.ndarray]:
    room = make_room(seed)
    write_flashes(room, folder, seed)
    return {"flash": errors_ms(room, folder, "--by", "flash")}


def by_blinking(seed: int, folder: Path) -> dict[str, np.ndarray]:
    room = make_room(seed)
    write_blinking(room, folder, seed)
    return {"blinking": errors_ms(room, folder, "--by", "blinking")}


def by_motion(folder: Path) -> float:
    """Of the free camera of `calibration.py` against the mean of the others, milliseconds."""
    true_s = record_free_running(folder)
    output = folder / "rig_synchronized.yaml"
    if tracker_node(["synchronize", "--rig", str(folder / "rig.yaml"), "-o", str(output), "--force", "--quiet"]) != 0:
        return float("nan")
    offsets = [1e-9 * camera.time_offset_ns for camera in load_rig(output)]
    return 1e3 * (offsets[FREE] - float(np.mean([o for i, o in enumerate(offsets) if i != FREE])) - true_s)


def measure(seeds: int, motion: bool = True) -> dict[str, float | int]:
    """All figures."""
    errors: dict[str, list[np.ndarray]] = {}
    ways: tuple[Callable[[int, Path], dict[str, np.ndarray]], ...] = (by_sound, by_flash, by_blinking)
    for seed in range(seeds):
        for way in ways:
            with tempfile.TemporaryDirectory(prefix="synchronize-") as scratch:
                for name, found in way(seed, Path(scratch)).items():
                    errors.setdefault(name, []).append(found)
    metrics: dict[str, float | int] = {"sync.seeds": seeds, "sync.flashes": N_FLASHES, "sync.claps": N_CLAPS}
    for name, found in errors.items():
        every = np.array(found)
        metrics |= {f"sync.{name}_ms": float(np.sqrt(np.mean(every**2))), f"sync.{name}_max_ms": float(np.abs(every).max())}
    if motion and default_motions() is not None:
        metrics["sync.motion_ms"] = abs(by_motion(Path("out/calibration/free_running_dance_a_150")))
    return metrics


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(
        __doc__, "python benchmark/calibration/synchronize.py --quick --json out/benchmark/synchronize.json", "fewer seeds"
    )
    args = parser.parse_args(arguments)
    metrics = measure(SEEDS["quick" if args.quick else "full"])
    print_circumstances()
    report_metrics(metrics, args.json)
    return 0


if __name__ == "__main__":
    sys.exit(main())
