"""What the benchmarks of contours share: recordings, image sets of them, a timed run, and its figures."""

from __future__ import annotations

import argparse
import gc
import json
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np

from benchmark._arguments import parser_of
from benchmark._reference import reference_ms
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import FileFormatError, SourceError
from tracker_node.evaluation.evaluate import Evaluation, EvaluationOptions, evaluate
from tracker_node.evaluation.metrics import LOST_LIMB_M
from tracker_node.evaluation.truth.files import LIMBS, load_truth
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.model.articulated import ArticulatedModel
from tracker_node.model.configuration import State
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.report.metrics_file import cpu
from tracker_node.runs.data import RunData
from tracker_node.synthesis.recording import Request, produce, show_progress
from tracker_node.synthesis.scenes.scene import SceneConfig
from tracker_node.tracking.config import TrackerConfig, from_dict, updated
from tracker_node.tracking.estimate import TrackEstimate
from tracker_node.tracking.tracker import Tracker

RATE_HZ = 30.0
DEFAULT_CACHE = Path("out/synthetic")
WARM_UP = 5  # image sets that are not timed: the first one has more iterations
SCENE = SceneConfig(
    n_cameras=4, distortion=(), noise_levels=4.0, blur_px=0.6, shadow=False, surroundings="clutter", backgrounds=False,
    lossless=True,
)  # colored patterns all around, and nobody has seen the room empty


@dataclass(frozen=True)
class Clip:
    """A recording with truth, read into memory on demand."""

    folder: Path
    rig: CameraRig
    model: ArticulatedModel
    start: State

    @classmethod
    def load(cls, folder: Path) -> Clip:
        model = load_model(folder / "person.yaml")
        return cls(folder, load_rig(folder / "rig.yaml"), model, load_state(folder / "state.yaml", model))

    def with_cameras(self, numbers: Sequence[int]) -> Clip:
        return replace(self, rig=CameraRig(tuple(self.rig.cameras[i] for i in numbers)))

    def sets(self, stride: int = 1, limit: int | None = None) -> Iterable[ImageSet]:
        """Every ``stride``-th image set, at most ``limit`` of them."""
        files = [sorted(Path(camera.source).glob("[0-9]*.*")) for camera in self.rig]
        for i, row in list(enumerate(zip(*files, strict=True)))[::stride][:limit]:
            images = [read(path) for path in row]
            yield image_set(self.rig, images, round(i * 1e9 / RATE_HZ))


def read(path: Path) -> np.ndarray:
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise SourceError(path, "cannot be read as an image")
    return image


def image_set(rig: CameraRig, images: Sequence[np.ndarray], stamp_ns: int) -> ImageSet:
    return ImageSet(stamp_ns, tuple(CameraImage(c.name, stamp_ns, i) for c, i in zip(rig, images, strict=True)))


def recorded(name: str, request: Request, cache: Path) -> Clip:
    """The recording ``name``, rendered if it is not there as asked for."""
    made = produce(request, cache / name, progress=show_progress)
    print(f"{name}: {'rendered into' if made else 'found in'} {cache / name}", file=sys.stderr)
    return Clip.load(cache / name)


@dataclass(frozen=True, eq=False)
class Run:
    """Estimates of the image sets of a clip, with the milliseconds that each took."""

    estimates: tuple[TrackEstimate, ...]
    times_ms: np.ndarray


def track(
    clip: Clip, config: TrackerConfig, sets: Iterable[ImageSet], progress: Callable[[int], None] = lambda n: None,
    backgrounds: dict | None = None, people: Callable[[Tracker, ImageSet], ImageSet] | None = None,
) -> Run:  # fmt: skip
    """Track from the clip's first pose; no background is known unless ``backgrounds`` says so; ``people`` finds them."""
    tracker = Tracker(clip.rig, clip.model, config, backgrounds or {}, clip.start)
    estimates, times = [], []
    gc.collect()
    gc.disable()
    for one in sets:
        one = one if people is None else people(tracker, one)
        began = time.perf_counter()
        estimates.append(tracker.step(one))
        times.append(1e3 * (time.perf_counter() - began))
        progress(len(estimates))
    gc.enable()
    return Run(tuple(estimates), np.array(times))


def judged(clip: Clip, run: Run, name: str) -> Evaluation:
    """The run against the truth of its own image sets."""
    estimates = run.estimates
    data = RunData.of_estimates(clip.folder, clip.model, clip.rig, estimates)
    options = EvaluationOptions(name, lag_images=0.0, align="stamp", image_sets=len(estimates))
    return evaluate(data, clip.model, load_truth(clip.folder / "truth.csv"), options)


def accuracy_figures(result: Evaluation) -> dict[str, float | int]:
    """Figures of a run on the tracker's own body: whatever is off is the tracker's error."""
    figures: dict[str, float | int] = {
        "joint_error_mm": result.raw.mean_mm,
        "joint_error_median_mm": float(1e3 * np.median(result.raw.errors_m[result.raw.valid])),
        "joint_error_max_mm": float(1e3 * result.raw.errors_m[result.raw.valid].max()),
        "lost_limbs": len(result.lost_limbs),
        "lost_sets": int(result.lost.sum()) + result.missing_sets,
        "sets": result.image_sets,
    }
    return {f"{result.name}.{key}": value for key, value in figures.items()}


def report_lost(result: Evaluation) -> None:
    """Say which limbs are off by more than that of a lost one, and in which image sets."""
    for limb, joint in LIMBS.items():
        if joint not in result.joints:
            continue
        j = result.joints.index(joint)
        off = np.concatenate([[False], (result.raw.errors_m[:, j] > LOST_LIMB_M) & result.raw.valid[:, j], [False]])
        starts, ends = (np.flatnonzero(np.diff(off.astype(int)) == sign) for sign in (1, -1))
        if len(starts):
            stretches = ", ".join(f"{a}-{b - 1}" for a, b in zip(starts, ends, strict=True))
            print(f"{result.name}: {limb} more than {1e3 * LOST_LIMB_M:.0f} mm off in sets {stretches}", file=sys.stderr)


def time_figures(run: Run, config: TrackerConfig, name: str) -> dict[str, float | int]:
    """Milliseconds of an image set after the first ones, beside their multiple of the reference kernel."""
    times, estimates = run.times_ms[WARM_UP:], run.estimates[WARM_UP:]
    if not len(times):
        return {}
    reference = reference_ms()
    p5, p50, p95 = np.percentile(times, [5, 50, 95])
    figures: dict[str, float | int] = {
        "set_ms": float(times.mean()), "set_ms_p5": float(p5), "set_ms_p50": float(p50), "set_ms_p95": float(p95),
        "set_in_references": float(times.mean() / reference), "reference_ms": reference,
        "observe_ms": float(np.mean([e.timings.observe_ms for e in estimates])),
        "optimize_ms": float(np.mean([e.timings.optimize_ms for e in estimates])),
        "iterations": float(np.mean([e.iterations for e in estimates])),
        "samples": float(np.mean([sum(c.samples for c in e.cameras) for e in estimates])),
        "threads": config.threads,
    }  # fmt: skip
    return {f"{name}.{key}": value for key, value in figures.items()}


def clip_parser(doc: str | None, example: str, names: Sequence[str] = ()) -> argparse.ArgumentParser:
    """The options of programs that track clips; ``names`` are what ``--only`` may have."""
    parser = parser_of(doc, example, "fewer image sets")
    if names:
        parser.add_argument("--only", nargs="+", metavar="NAME", choices=names, help=f"of {', '.join(names)}")
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="where recordings are kept (default: %(default)s)")
    parser.add_argument(
        "--set", nargs="+", default=[], metavar="KEY=VALUE", dest="changes", help="parameters of the tracker, e.g. threads=1"
    )
    return parser


def configured(changes: Sequence[str], **values) -> TrackerConfig:
    """Default configuration with ``values`` (dots as two underscores), then with ``changes`` of the command line."""
    settings = {key.replace("__", "."): value for key, value in values.items()}
    return updated(from_dict(settings, "command line"), dict(map(setting, changes)), "command line")


def setting(change: str) -> tuple[str, object]:
    """Name and value of a ``KEY=VALUE`` of the command line; modalities are separated by commas."""
    key, equals, text = change.partition("=")
    if not equals:
        raise FileFormatError("command line", "--set", "KEY=VALUE", change)
    if key == "modalities":
        return key, text.split(",")
    try:
        return key, json.loads(text)  # a number, true or false
    except ValueError:
        return key, text


def print_circumstances() -> None:
    """What the figures in milliseconds hold for."""
    machine = cpu()
    print(f"{machine['model']}, {machine['cores']} cores, {machine['simd']}")
