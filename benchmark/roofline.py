#!/usr/bin/env python3
"""Where the limit is: how near each kernel comes to what one thread of this machine can do.

The roofs are measured in the same run: single-precision operations a second (polynomials in vectors, a fused multiply-add counts
twice), and bytes a second of arrays that fit the second-level cache and of arrays that lie in memory. The operations of a kernel
are counted by hand from its source, for every pixel or place that it visits: additions, multiplications, divisions and roots;
comparisons and integers are not counted. Its bytes are those that it reads and writes there. A kernel can do at most the
smaller of the roof of operations, and its operations a byte times the roof of the cache; ``roofline.NAME.share`` is the part of
that which it does, ``of_memory`` the same with the roof of memory. Kernels get the arguments that a tracker has given them.
``--page`` writes docs/roofline.md and its picture.
"""

from __future__ import annotations

import importlib
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import cv2
import numba as nb
import numpy as np
from matplotlib.figure import Figure

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the repository

from benchmark import _reference
from benchmark._arguments import parser_of
from benchmark.color._scene import make_scene
from benchmark.color.score import AMBIENT, MASK_PIXELS, SUN, Drawing, zoomed
from benchmark.contour._runs import DEFAULT_CACHE, configured, print_circumstances
from benchmark.contour.box import box_model, box_rig, box_states, displaced, image_sets
from benchmark.core import N_IMAGES
from benchmark.kernels import make_cases
from benchmark.kernels import make_scene as make_person
from tracker_node.loaders.images.source import load_backgrounds
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.objective.color.score import ColorObjective
from tracker_node.objective.color.score_kernels import score_states
from tracker_node.objective.lines.camera import correspond_camera
from tracker_node.objective.lines.correspondence import HALF_LENGTH
from tracker_node.observation.image_set import ImageSet
from tracker_node.observation.region import background
from tracker_node.parallel import Workers
from tracker_node.render.raycast import raycaster
from tracker_node.render.raycast.kernels import LANES
from tracker_node.report.metrics_file import cpu, report_metrics
from tracker_node.runs.image_sets import SourceStream
from tracker_node.synthesis.recording import Request, produce, show_progress
from tracker_node.tracking.tracker import Tracker

ROOT = Path(__file__).resolve().parents[1]
PAGE, PICTURE = ROOT / "docs/roofline.md", ROOT / "docs/images/roofline.png"
CACHE_FLOATS, MEMORY_FLOATS = 16_384, 16_000_000  # of each of three arrays
DEGREE, POLYNOMIALS = 64, 4096
SECONDS = {"quick": 0.1, "full": 1.0}

# For each pixel or place
OPERATIONS = {"draw": 9, "score": 50, "raycast": 32, "background": 20, "log_odds": 28, "lines": 70}
BYTES = {"draw": 16, "score": 27, "raycast": 16, "background": 48, "log_odds": 36, "lines": 19}
MEANINGS = {
    "reference": "the fixed kernel that all times are stated in: 20 rounds of a root for each pixel",
    "draw": "first pass of a color score: part in front and depth, three views (objective/color/drawing.py)",
    "score": "a whole color score, one directional light (objective/color/score_kernels.py)",
    "raycast": "labels and depth of the human, all shapes' boxes (render/raycast/kernels.py)",
    "background": "the learned background follows its pixels (observation/region/background.py)",
    "log_odds": "body against background at each pixel of a region (observation/appearance_kernels.py)",
    "lines": "correspondence lines of one camera, drawn, fitted and summed (objective/lines/camera.py)",
}
LIMITS = {
    "reference": "latency of roots that wait for each other",
    "draw": "two of eighteen shapes cover one pixel; rows end in part-filled vectors",
    "score": "labels sort pixels by part: blocks are visited once for each part in them",
    "raycast": "a root for each pixel of each box, most of which show no part",
    "background": "memory: 48 bytes a pixel, which no cache keeps from set to set",
    "log_odds": "reads of tables that depend on the pixel's color",
    "lines": "reads scattered over the image and over tables; the rest goes by lines of 20 to 40 places, a few vectors each",
}
# Figures of the same work (docs/measured.md), and what others take for it: multiples of the reference kernel, one thread
RIVALS = (
    ("figure of ten cones, four cameras", "figure.set_ms", "M3T: 42; with half of its lines 19"),
    ("box, three cameras", "box_3cams.set_ms", "M3T: 3.3; with half of its lines 1.9. ViSP, edges: 2.1"),
    ("textured box, one camera", "visp.teabox.ratio_ms", "ViSP, points that it follows: 1.3"),
    ("figure, prototype of the method in numba", "figure.set_ms", "19.5 ms a set, half of its lines 9.7 ms, on a slower machine"),
)


@dataclass(frozen=True)
class Kernel:
    """Some work, and what it takes: operations and bytes of one call."""

    work: Callable[[], object]
    operations: float
    bytes: float


@nb.njit(cache=True, fastmath=True, nogil=True)
def _polynomials(x, y):
    """A polynomial of degree `DEGREE` at each place: multiplications and additions in registers."""
    for i in range(x.size):
        value = np.float32(0.1)
        for _ in range(DEGREE):
            value = value * x[i] + np.float32(0.5)
        y[i] = value


@nb.njit(cache=True, fastmath=True, nogil=True)
def _triad(a, b, c, rounds):
    for _ in range(rounds):
        for i in range(a.size):
            a[i] = b[i] + np.float32(0.5) * c[i]


def roofs(seconds: float) -> tuple[float, float, float]:
    """Operations a second, and bytes a second of the cache and of memory, of one thread."""
    x = np.linspace(0.1, 0.9, POLYNOMIALS, dtype=np.float32)
    y = np.empty_like(x)
    operations = 2.0 * DEGREE * POLYNOMIALS / best_s(lambda: _polynomials(x, y), seconds)
    small, large = (tuple(np.ones(n, dtype=np.float32) for _ in range(3)) for n in (CACHE_FLOATS, MEMORY_FLOATS))
    in_cache = 100 * 12.0 * CACHE_FLOATS / best_s(lambda: _triad(*small, 100), seconds)
    in_memory = 12.0 * MEMORY_FLOATS / best_s(lambda: _triad(*large, 1), seconds)
    return operations, in_cache, in_memory


def best_s(work: Callable[[], object], seconds: float) -> float:
    """The least time of a call, of all within so many seconds: what the machine can do."""
    work()
    best, until = np.inf, time.perf_counter() + seconds
    while time.perf_counter() < until:
        began = time.perf_counter()
        work()
        best = min(best, time.perf_counter() - began)
    return best


@contextmanager
def captured(module: str, name: str) -> Iterator[list[tuple[Any, ...]]]:
    """While the arguments of each call of a kernel are kept, by the name that its caller knows."""
    place = importlib.import_module(f"tracker_node.{module}")
    kernel, calls = getattr(place, name), []

    def keep(*arguments: Any) -> Any:
        calls.append(arguments)
        return kernel(*arguments)

    setattr(place, name, keep)
    try:
        yield calls
    finally:
        setattr(place, name, kernel)


def kernels(cache: Path) -> dict[str, Kernel]:
    """All kernels of the page, with arguments of real runs."""
    image = np.linspace(0.0, 4.0, 640 * 480, dtype=np.float32).reshape(480, 640)
    out = np.empty_like(image)
    pixels = image.size
    found = {
        "reference": Kernel(lambda: _reference._reference(image, out), 3.0 * _reference.ROUNDS * pixels, 8.0 * pixels),
        **_color(),
        **_pictures(),
        **_tracking(cache),
    }
    return {name: found[name] for name in MEANINGS}


def _of(name: str, work: Callable[[], object], visited: float) -> dict[str, Kernel]:
    return {name: Kernel(work, OPERATIONS[name] * visited, BYTES[name] * visited)}


def _color() -> dict[str, Kernel]:
    scene = make_scene(1)
    rig, state = zoomed(scene, MASK_PIXELS), scene.truth[0]
    drawing = Drawing(scene.model, rig)
    drawing.draw(state)
    objective = ColorObjective(scene.model, replace(rig, lights=(AMBIENT, SUN)), workers=Workers(1))
    objective.set_images(scene.images[0])
    with captured("objective.color.score", "score_states") as calls:
        objective.score(state)
    (arguments,) = calls
    visited = drawing.visited
    return _of("draw", lambda: drawing.draw(state), visited) | _of("score", lambda: score_states(*arguments), visited)


def _pictures() -> dict[str, Kernel]:
    person = make_person()
    cases = make_cases(person)
    with captured("render.raycast.raycaster", "_draw_shapes") as calls:
        cases["render_mask"]()
    (arguments,) = calls
    boxes = arguments[5]
    columns = -(-boxes[:, 2] // LANES) * LANES - boxes[:, 0] // LANES * LANES
    tested = float((np.maximum(columns, 0) * np.maximum(boxes[:, 3] - boxes[:, 1], 0)).sum())
    u0, v0, u1, v1 = person.region
    found = _of("raycast", lambda: raycaster._draw_shapes(*arguments), tested)
    return found | _of("log_odds", cases["appearance_log_odds"], float((u1 - u0) * (v1 - v0)))


def _tracking(cache: Path) -> dict[str, Kernel]:
    """Kernels of a tracker that is on its way, with the arguments of its last calls: lines of a person, a thing's background."""
    folder = cache / f"cones-{N_IMAGES}"
    produce(Request(subject="model", motion="waves", n_images=N_IMAGES), folder, progress=show_progress)
    rig, model = load_rig(folder / "rig.yaml"), load_model(folder / "person.yaml")
    config = configured([], threads=1)
    person = Tracker(rig, model, config, load_backgrounds(rig), load_state(folder / "state.yaml", model))
    drawn = _last_arguments(
        person, SourceStream(rig, config.synchronizer), "objective.lines.correspondences", "correspond_camera"
    )  # fmt: skip
    states = box_states(box_model(), 20)
    thing = Tracker(box_rig(), box_model(), config, None, displaced(states[0]))
    sets = image_sets(box_rig(), box_model(), states)
    learned = _last_arguments(thing, sets, "observation.region.background", "_learn")
    half, (u0, v0, u1, v1), (_, every) = int(drawn[10][HALF_LENGTH]), learned[1], learned[2]
    places = float(correspond_camera(*drawn) * 2 * half)
    return _of("lines", lambda: correspond_camera(*drawn), places) | _of(
        "background", lambda: background._learn(*learned), (u1 - u0) * (v1 - v0) / every
    )


def _last_arguments(tracker: Tracker, sets: Iterable[ImageSet], module: str, name: str) -> tuple[Any, ...]:
    """What a kernel was given last, while image sets were tracked."""
    with captured(module, name) as calls:
        for image_set in sets:
            tracker.step(image_set)
    return calls[-1]


def measure(cache: Path, seconds: float) -> dict[str, float]:
    """All figures; roofs in 10^9 a second."""
    cv2.setNumThreads(1)
    reference = _reference.reference_ms()
    operations, in_cache, in_memory = roofs(seconds)
    metrics = {
        "roofline.reference_ms": reference, "roofline.peak_gflops": 1e-9 * operations,
        "roofline.cache_gbs": 1e-9 * in_cache, "roofline.memory_gbs": 1e-9 * in_memory,
    }  # fmt: skip
    for name, kernel in kernels(cache).items():
        took = best_s(kernel.work, seconds)
        most, in_memory_most = (min(operations, kernel.operations / kernel.bytes * roof) for roof in (in_cache, in_memory))
        metrics |= {
            f"roofline.{name}.ms": 1e3 * took,
            f"roofline.{name}.in_references": 1e3 * took / reference,
            f"roofline.{name}.operations": kernel.operations,
            f"roofline.{name}.bytes": kernel.bytes,
            f"roofline.{name}.gflops": 1e-9 * kernel.operations / took,
            f"roofline.{name}.share": kernel.operations / took / most,
            f"roofline.{name}.of_memory": kernel.operations / took / in_memory_most,
        }
    return metrics


def page(metrics: dict[str, float]) -> str:
    """docs/roofline.md."""

    def of(name: str, key: str) -> float:
        return metrics[f"roofline.{name}.{key}"]

    peak, cache, memory = (metrics[f"roofline.{key}"] for key in ("peak_gflops", "cache_gbs", "memory_gbs"))
    lines = [
        "<!-- Generated by benchmark/roofline.py --page. -->\n",
        "# Where the limit is\n",
        f"You want to know what still can be gained. One thread of the machine below does at most {peak:.0f} single-precision"
        f" operations in a nanosecond, and moves {cache:.0f} bytes in one within the second-level cache, {memory:.0f} from and to"
        " memory. A kernel can be no faster than the lower of two roofs: that of operations, and that of bytes, which is the"
        " higher the more it does with each. `benchmark/roofline.py` measures both and says how operations are counted.\n",
        "![Each kernel under its roofs](images/roofline.png)\n",
        "| kernel | ms | references | 10^6 operations | 10^6 bytes | 10^9 operations / s | of the cache's roof | of memory's"
        " | what holds it |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for name, meaning in MEANINGS.items():
        millions = f"{1e-6 * of(name, 'operations'):.2f} | {1e-6 * of(name, 'bytes'):.2f}"
        times = f"{of(name, 'ms'):.3f} | {of(name, 'in_references'):.2f}"
        rates = f"{of(name, 'gflops'):.1f} | {of(name, 'share'):.0%} | {of(name, 'of_memory'):.0%}"
        lines.append(f"| `{name}`: {meaning} | {times} | {millions} | {rates} | {LIMITS[name]} |")
    lines += [
        "\n## What others need\n",
        "Multiples of the reference kernel for one image set, defaults, one thread: ViSP by `benchmark/world/visp.py`, M3T by"
        " hand. Ours are in [measured](measured.md) under the key.\n",
        "| work | ours | others, references |",
        "|---|---|---|",
        *(f"| {work} | `{ours}` | {theirs} |" for work, ours, theirs in RIVALS),
        f"\nMeasured on {cpu()['model']}, {cpu()['simd']}; reference kernel {metrics['roofline.reference_ms']:.2f} ms.",
    ]
    return "\n".join(lines) + "\n"


def draw_picture(metrics: dict[str, float], path: Path) -> None:
    """Kernels under their roofs, both axes logarithmic."""
    figure = Figure(figsize=(8.0, 4.6), dpi=110)
    ax = figure.subplots()
    x = np.geomspace(0.2, 20.0, 100)
    peak = metrics["roofline.peak_gflops"]
    for key, label, color in (("cache_gbs", "second-level cache", "#0072b2"), ("memory_gbs", "memory", "#777777")):
        rate = metrics[f"roofline.{key}"]
        ax.plot(x, np.minimum(peak, x * rate), color=color, label=f"{label}, {rate:.0f} GB/s")
    places = {}
    for name in MEANINGS:
        intensity = metrics[f"roofline.{name}.operations"] / metrics[f"roofline.{name}.bytes"]
        places[name] = intensity, metrics[f"roofline.{name}.gflops"]
    for name, (intensity, rate) in places.items():
        ax.plot(intensity, rate, "o", color="#d55e00")
        below = any(
            other != name and 0.0 <= np.log(places[other][1] / rate) < 0.25 and abs(np.log(places[other][0] / intensity)) < 1.0
            for other in places
        )
        ax.annotate(name, (intensity, rate), xytext=(6, -11 if below else -1), textcoords="offset points", fontsize=9)
    ax.set(xscale="log", yscale="log", xlabel="operations a byte", ylabel="10^9 operations a second, one thread")
    ax.grid(alpha=0.3, which="both")
    ax.legend(loc="center right", frameon=False)
    figure.tight_layout()
    figure.savefig(path)


def main(arguments: list[str] | None = None) -> int:
    parser = parser_of(
        __doc__,
        "python benchmark/roofline.py --quick --json out/benchmark/roofline.json",
        "a tenth of a second for each kernel instead of one",
    )
    parser.add_argument("--cache", type=Path, default=DEFAULT_CACHE, help="where recordings are kept (default: %(default)s)")
    parser.add_argument("--page", action="store_true", help="write docs/roofline.md and its picture")
    args = parser.parse_args(arguments)
    metrics = measure(args.cache, SECONDS["quick" if args.quick else "full"])
    print_circumstances()
    report_metrics(metrics, args.json)
    if args.page:
        draw_picture(metrics, PICTURE)
        PAGE.write_text(page(metrics), encoding="utf-8")
        print(f"wrote {PAGE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
