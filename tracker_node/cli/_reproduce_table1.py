"""``tracker_node reproduce table1``: the half-twisting somersault (Trewartha, Yeadon & Knight, Table 1 and Fig. 4)."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

SUMMARY = "track a somersault of 11 synthetic images and three cameras by color; errors beside the paper's Table 1"
EXAMPLE = "tracker_node reproduce table1 --output out/reproduce/table1"

START_ERROR = (30.0, -30.0, 20.0, 4.0, -3.0, 4.0)  # of the first image set, mm and degrees: the paper says "approximate"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--output", default="out/reproduce/table1", metavar="DIR", help="folder of the results (%(default)s)")
    parser.add_argument("--quick", action="store_true", help="three small images: shows that it runs, the figures mean nothing")


@dataclass(frozen=True, eq=False)
class _Method:
    """One way to track: key, title, what drew the target images, how an image set is fitted, and from where."""

    key: str
    title: str
    backend: str
    fit: Callable[[Any], Any]
    from_truth: bool = False  # every image set, instead of the estimate before it


def run(args: argparse.Namespace) -> int:
    from ..evaluation import color_experiments as experiments
    from ..evaluation.metrics_file import format_metrics, write_metrics
    from ..objective.color_score import ColorObjective
    from ._somersault_scene import BACKENDS, somersault_scene

    folder = Path(args.output)
    folder.mkdir(parents=True, exist_ok=True)
    scene = somersault_scene(3, 192) if args.quick else somersault_scene()
    images = {}
    for backend in BACKENDS:
        _say(f"drawing {len(scene.truth)} target image sets with {backend}")
        images[backend] = scene.film(scene.measured, backend)
    objective = ColorObjective(scene.tracked, scene.rig)
    methods, tracked = list(_methods(objective, scene.tracked.chain)), {}
    for method in methods:

        def show(i: int, backend: str = method.backend) -> None:
            objective.set_images(images[backend][i])

        if method.from_truth:
            tracked[method.key] = experiments.fit_each(show, scene.truth, method.fit)
        else:
            start = experiments.moved(scene.truth[0], START_ERROR)
            tracked[method.key] = experiments.track(show, len(scene.truth), start, method.fit)
        _say(f"{method.title}: done")
    errors = {method.key: tracked[method.key].errors(scene.truth) for method in methods}
    metrics: dict[str, float | int] = {}
    for method in methods:
        metrics |= experiments.error_metrics(f"table1.{method.key}", errors[method.key])
    metrics["table1.evaluations_per_variable"] = tracked["stepping"].evaluations_per_variable
    metrics["table1.best.evaluations_per_variable"] = tracked["best"].evaluations_per_variable
    metrics["table1.mask_pixels"] = _mask_pixels(objective, images[BACKENDS[0]], scene.truth)
    table = experiments.table1({m.title: errors[m.key] for m in methods}, experiments.motion_ranges(scene.variables))
    text = "\n".join([experiments.text_table(table), "", _remarks(metrics), "", format_metrics(metrics)])
    print(text)
    (folder / "table.txt").write_text(text + "\n")
    write_metrics(folder / "metrics.json", metrics)
    _write_pictures(folder, scene, images[BACKENDS[0]], tracked["stepping"].states, table, _remarks(metrics))
    _say(f"wrote {folder}/table.txt, metrics.json, fig4.png and report.html")
    return 0


def _methods(objective: Any, chain: Any) -> Iterator[_Method]:
    """The paper's method and its open choice, better optimizers, the floor, and the paper's with one renderer for all."""
    from math import radians

    from ..model.pose_variables import N_ROOT
    from ..optimize.simplex import SimplexOptions, SimplexStage, search_simplex
    from ..optimize.stepping import FIVE_LOOPS, SteppingOptions, step_downhill

    rigid = range(N_ROOT)
    fine = SimplexOptions((SimplexStage(0.010, radians(1.0), 0.1), SimplexStage(0.002, radians(0.2), 0.005, max_evaluations=100)))

    def stepping(v: str) -> Callable[[Any], Any]:
        return lambda start: step_downhill(objective, start, chain, SteppingOptions(FIVE_LOOPS, v=v), rigid)

    def minimum(start: Any) -> Any:
        return search_simplex(objective, start, chain, fine, rigid)

    def best(start: Any) -> Any:
        from dataclasses import replace

        stepped = stepping("every_line")(start)
        polished = minimum(stepped.state)
        return replace(polished, evaluations=stepped.evaluations + polished.evaluations)

    yield _Method("stepping", "stepping", "pyrender", stepping("every_line"))
    yield _Method("stepping_v_last_loop", "V in last loop only", "pyrender", stepping("last_loop"))
    yield _Method("best", "then simplex", "pyrender", best)
    yield _Method("floor", "floor", "pyrender", minimum, from_truth=True)
    yield _Method("same_backend", "stepping, one renderer", "raycaster", stepping("every_line"))
    yield _Method("same_backend_best", "then simplex, one renderer", "raycaster", best)


def _mask_pixels(objective: Any, images: Any, truth: Any) -> int:
    """Mean size of the mask over the image sets, all cameras together."""
    total = 0
    for image_set, state in zip(images, truth, strict=True):
        objective.set_images(image_set)
        total += int(objective.evaluate(state).camera_pixels.sum())
    return total // len(truth)


def _remarks(metrics: dict[str, float | int]) -> str:
    from ..evaluation.color_experiments import PAPER_EVALUATIONS_PER_VARIABLE

    start = ", ".join(f"{value:+g}" for value in START_ERROR)
    return "\n".join([
        f"Scores for each variable of an image set: {metrics['table1.evaluations_per_variable']:.1f} stepping,"
        f" {metrics['table1.best.evaluations_per_variable']:.1f} with the simplex"
        f" (paper: about {PAPER_EVALUATIONS_PER_VARIABLE}). Mask: {metrics['table1.mask_pixels']} pixels.",
        f"Error of the first start (mm: vertical, A-P, lateral; degrees: somersault, tilt, twist): {start}.",
        "Floor: the minimum of the score, searched from the truth; what is left are the two bodies' different shapes.",
    ])  # fmt: skip


def _write_pictures(folder: Path, scene: Any, targets: Any, states: Any, table: Any, remarks: str) -> None:
    """Fig. 4, and the page."""
    from ..evaluation.color_plots import save, sequence_figure
    from ..evaluation.experiment_page import Section, write_page

    tracked = scene.show(scene.tracked, states)
    rows = {}
    for camera, name in enumerate(scene.rig.names[:2]):
        rows[f"target, {name} view"] = [image_set[camera] for image_set in targets]
        rows[f"tracked, {name} view"] = [image_set[camera] for image_set in tracked]
    save(sequence_figure(rows), folder / "fig4.png")
    write_page(folder / "report.html", "Half-twisting somersault, tracked by color", [
        Section("Table 1", remarks, table),
        Section("Fig. 4", "What was filmed, and the ellipsoid body where stepping found it.", picture=folder / "fig4.png"),
    ])  # fmt: skip


def _say(text: str) -> None:
    print(text, file=sys.stderr, flush=True)
