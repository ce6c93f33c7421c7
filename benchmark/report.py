#!/usr/bin/env python3
"""How long the report of a long run takes to make, how large its page is, and how long a browser takes to show it.

The run is real: 700 image sets of six cameras of 640x480 are tracked offline. Its images are 30 rendered instants of the
40-degree-of-freedom human, shown forward and backward in turn, so that the motion goes on without a jump; truth are the states
that they were drawn from. ``build_s``: `tracker_node evaluate` as a process of its own, from its start to its end, with page, PDF
and contact sheets. ``load_s``: from the start of navigation until the page has loaded and all charts are drawn, in headless
Chromium; the fastest of a few, with the slowest beside it. Beside both stand seconds of processor time (``_cpu_s``; of the
page's own thread), which others on the machine change less, and the time of one fixed kernel. ``first_view_3d``: whether the page
begins with the motion.
"""

from __future__ import annotations

import argparse
import resource
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "test"))


from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.motion.trajectory_file import read_states, write_states
from tracker_node.loaders.rig.rig_yaml import load_rig
from tracker_node.report.metrics_file import report_metrics
from tracker_node.runs.offline import OfflineRun, run_together
from tracker_node.synthesis.recording import Request, produce, show_progress

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))  # the repository

from benchmark._arguments import parser_of
from benchmark._reference import reference_ms
from benchmark.contour._runs import print_circumstances

N_RENDERED, N_SETS, QUICK_SETS = 30, 700, 90
PERIOD_NS = 1e9 / 30.0
LOADS = 5


def main(arguments: list[str] | None = None) -> int:
    args = _arguments(arguments)
    n = QUICK_SETS if args.quick else N_SETS
    clip, folder = args.cache / f"cones-{N_RENDERED}", args.cache / f"report-{n}"
    produce(Request(subject="model", motion="waves", n_images=N_RENDERED), clip, progress=show_progress)
    if not (folder / "run" / "run.json").exists():
        shutil.rmtree(folder, ignore_errors=True)
        lengthen(clip, folder, n)
        track(folder, n)
    reference = reference_ms()
    build_s, build_cpu_s = evaluate(folder)
    page = folder / "report" / "report.html"
    loads = load_times(page, 2 if args.quick else LOADS)
    figures: dict[str, float | int] = {
        "report.image_sets": n,
        "report.cameras": len(load_rig(folder / "rig.yaml")),
        "report.build_s": build_s,
        "report.build_cpu_s": build_cpu_s,
        "report.first_view_3d": int(begins_with_motion(page)),
        "report.size_mb": page.stat().st_size / 1e6,
        "report.pdf_mb": page.with_suffix(".pdf").stat().st_size / 1e6,
        "report.load_s": min((load.drawn_s for load in loads), default=float("nan")),
        "report.load_s_slowest": max((load.drawn_s for load in loads), default=float("nan")),
        "report.load_event_s": min((load.event_s for load in loads), default=float("nan")),
        "report.load_cpu_s": min((load.cpu_s for load in loads), default=float("nan")),
        "report.reference_ms": reference,
        "report.build_in_reference": 1e3 * build_s / reference,
    }
    print_circumstances()
    report_metrics(figures, args.json)
    return 0


def begins_with_motion(page: Path) -> bool:
    """Whether the page's first section is the motion in space, to be played."""
    sections = page.read_text(encoding="utf-8").split("<h2 ")
    return len(sections) > 1 and 'id="view-section"' in sections[1] and "data-scene=" in sections[1]


def lengthen(clip: Path, folder: Path, n: int) -> None:
    """A recording of ``n`` image sets in ``folder`` from that in ``clip``, forward and backward in turn, with its truth."""
    order = forward_and_backward(N_RENDERED, n)
    rig = load_rig(clip / "rig.yaml")
    for name in rig.names:
        (folder / name).mkdir(parents=True)
        for i, image in enumerate(order):
            (folder / name / f"{i:06d}.jpg").symlink_to((clip / name / f"{image:06d}.jpg").resolve())
    for name in ("rig.yaml", "person.yaml", "state.yaml"):
        shutil.copy(clip / name, folder / name)
    (folder / "backgrounds").symlink_to((clip / "backgrounds").resolve())
    truth = read_states(clip / "true_states.csv")
    rows = tuple(replace(truth.rows[image], stamp_ns=round(i * PERIOD_NS)) for i, image in enumerate(order))
    write_states(folder / "true_states.csv", replace(truth, rows=rows))


def forward_and_backward(n: int, length: int) -> list[int]:
    """0, 1, ... n - 1, n - 2, ... 0, 1, ... of this length."""
    there_and_back = [*range(n), *range(n - 2, 0, -1)]
    return [there_and_back[i % len(there_and_back)] for i in range(length)]


def track(folder: Path, n: int) -> None:
    """Track the recording as `track` does."""
    model = load_model(folder / "person.yaml")
    files = {"rig": str(folder / "rig.yaml"), "model": str(folder / "person.yaml")}
    run = OfflineRun(load_rig(files["rig"]), model, initial_state=load_state(folder / "state.yaml", model), asked=files)

    def tell(done: int, expected: int | None, estimate: object) -> None:
        if done % 50 == 0:
            print(f"tracking: image set {done} of {n}", file=sys.stderr, flush=True)

    run_together({model.name: run}, {model.name: folder / "run"}, tell)


def evaluate(folder: Path) -> tuple[float, float]:
    """Seconds that the command takes, and seconds of processor time in it."""
    command = [sys.executable, "-m", "tracker_node.cli.main", "evaluate", str(folder / "run"), "--lag", "0", "--name", "long"]
    began, used = time.perf_counter(), _children_s()
    more = ["--truth", str(folder / "true_states.csv"), "--output", str(folder / "report")]
    subprocess.run([*command, *more], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - began, _children_s() - used


def _children_s() -> float:
    """Processor time of all processes that have ended."""
    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    return usage.ru_utime + usage.ru_stime


@dataclass(frozen=True)
class Load:
    """Seconds from the start of navigation to the load event, and until all charts are drawn; of the page's thread until then."""

    event_s: float
    drawn_s: float
    cpu_s: float


def load_times(page: Path, repeats: int) -> list[Load]:
    """Empty without a browser."""
    from pytest import skip

    from helpers.studio.browser import browser_tab

    times = []
    for _ in range(repeats):
        try:
            with browser_tab() as tab:
                devtools = tab.page.context.new_cdp_session(tab.page)
                devtools.send("Performance.enable", {"timeDomain": "threadTicks"})
                tab.page.goto(page.resolve().as_uri())
                tab.page.wait_for_function("document.documentElement.dataset.drawn", timeout=120_000)
                event, drawn = tab.page.evaluate(
                    "[performance.getEntriesByType('navigation')[0].loadEventEnd, Number(document.documentElement.dataset.drawn)]"
                )
                measured = {entry["name"]: entry["value"] for entry in devtools.send("Performance.getMetrics")["metrics"]}
                if tab.errors:
                    raise RuntimeError(f"{page}: the browser's console says: {tab.errors}")
        except skip.Exception as missing:
            print(f"report: {missing}", file=sys.stderr)
            return []
        times.append(Load(1e-3 * event, 1e-3 * drawn, measured["TaskDuration"]))
    return times


def _arguments(arguments: list[str] | None) -> argparse.Namespace:
    parser = parser_of(
        __doc__, "python benchmark/report.py --json out/benchmark/report.json", f"{QUICK_SETS} image sets: shows that it runs"
    )
    parser.add_argument("--cache", type=Path, default=Path("out/synthetic"), help="folder of recordings (default: %(default)s)")
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
