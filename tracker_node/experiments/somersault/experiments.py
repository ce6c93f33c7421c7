"""The half-twisting somersault, tracked by color: Table 1 and Fig. 4, and how far each optimizer finds back, Figs 5 and 6.

Trewartha, Yeadon & Knight. `run_table1` tracks it; `run_convergence` measures the width of the color score's valley.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import radians
from pathlib import Path
from typing import Any

import numpy as np

from ...objective.color.alignment import PhotometricObjective
from ...objective.color.score import ColorObjective, ColorOptions
from ...optimize.alignment import align
from ...optimize.robust_fit import align_robustly
from ...optimize.simplex import SimplexStage, search_simplex
from ...optimize.stepping import FIVE_LOOPS, SEVEN_LOOPS, SteppingOptions, step_downhill
from ...parallel import Workers
from ...report.html import PageSection, text_table, write_page
from ...report.metrics_file import format_metrics, write_metrics
from ...report.progress import say
from .. import rigid_tracking as experiments
from ..plots import (
    Profile,
    bias_figure,
    convergence_figure,
    cost_figure,
    save,
    sequence_figure,
    success_figure,
    valley_figure,
)
from ..rigid_tracking import LABELS, PAPER_EVALUATIONS_PER_VARIABLE, PAPER_RMS, UNITS, VARIABLES, basin, profile, success_rate
from .scene import BACKENDS, segment_distances, somersault_scene

ORDER = (0, 1, 2, 3, 4, 5)  # in which variables are stepped: A-P, lateral, vertical, then the angles
TABLE_ORDER = (2, 0, 1, 3, 4, 5)  # that of the rows of Table 1
AMBIENT = "ambient light"  # targets by the first backend, without the lights that have a direction
CAP = 30.0  # gray levels, of the corrected score: chosen on other postures, places and lights than the somersault's
TABLES = {
    "Table 1": ("stepping", "best", "floor", "floor_hard"),
    "Ambient light alone": ("stepping_ambient", "floor_ambient"),
    "What the paper leaves open": ("stepping_v_last_loop", "stepping_table_order", "stepping_seven_loops"),
    "Targets and score by one renderer": ("same_backend", "same_backend_best", "same_backend_floor"),
}
QUICK = ("stepping", "best", "floor", "floor_hard", "floor_ambient", "same_backend")
FLOORS = ("floor_hard", "floor_ambient", "floor")
START_ERROR = (30.0, -30.0, 20.0, 4.0, -3.0, 4.0)  # of the first image set, mm and degrees: the paper says "approximate"
N_STARTS, N_QUICK_STARTS = 10, 2  # with this error and with other signs of it: what stepping finds depends on the start
SHOWN_IMAGE = 3  # the image set of plots that show one
VALLEY_MM, VALLEY_DEG = np.linspace(-8.0, 8.0, 33), np.linspace(-3.0, 3.0, 49)  # lateral and twist errors


@dataclass(frozen=True, eq=False)
class _Method:
    """One way to track: key, title, which target images, how an image set is fitted, and from where."""

    key: str
    title: str
    targets: str
    fit: Callable[[Any], Any]
    from_truth: bool = False  # every image set, instead of the estimate before it
    several: bool = False  # starts


def run_table1(folder: Path, quick: bool) -> None:
    """Track the somersault by every method, and write the table beside the paper's, metrics, figure and report.

    Parameters
    ----------
    folder : where the results go; it is made.
    quick : three small images and few methods: shows that it runs.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scene = somersault_scene(3, 192) if quick else somersault_scene()
    images = {}
    for backend in BACKENDS:
        say(f"drawing {len(scene.truth)} target image sets with {backend}")
        images[backend] = scene.film(scene.measured, backend)
    images[AMBIENT] = scene.in_ambient_light().film(scene.measured)
    objectives = _Objectives(scene)
    methods = [method for method in _methods(objectives) if not quick or method.key in QUICK]
    tracked, errors = {}, {}
    for method in methods:

        def show(i: int, targets: str = method.targets) -> None:
            objectives.show(images[targets][i])

        if method.from_truth:
            runs = [experiments.fit_each(show, scene.truth, method.fit)]
        else:
            offs = start_errors((N_QUICK_STARTS if quick else N_STARTS) if method.several else 1)
            starts = [experiments.moved(scene.truth[0], off) for off in offs]
            runs = [experiments.track(show, len(scene.truth), start, method.fit) for start in starts]
        tracked[method.key] = runs[0]
        errors[method.key] = np.array([run.errors(scene.truth) for run in runs])
        say(f"{method.title}: done")
    metrics: dict[str, float | int] = {}
    for method in methods:
        metrics |= experiments.error_metrics(f"table1.{method.key}", errors[method.key])
    metrics |= _biases({key: errors[key][0] for key in FLOORS})
    metrics |= _circumstances(scene, objectives, images[BACKENDS[0]], tracked)
    worst = int(np.argmax(np.abs(errors["floor_hard"][0, :, -1])))
    objectives.show(images[BACKENDS[0]][worst])
    valleys = {"hard mask": _valley(objectives.score, scene.truth[worst]),
               f"capped at {CAP:.0f} gray levels": _valley(objectives.capped, scene.truth[worst])}  # fmt: skip
    metrics["table1.floor_hard.twist_worst_image"] = worst
    metrics |= _of_valleys(valleys.values())
    differences = _differences(scene, images[BACKENDS[0]])
    metrics |= _overhang(differences, images[BACKENDS[0]])
    motion = experiments.motion_ranges(scene.variables)
    tables = {
        title: experiments.table1({m.title: errors[m.key] for m in methods if m.key in keys}, motion)
        for title, keys in TABLES.items()
        if any(m.key in keys for m in methods)
    }
    remarks = _remarks(metrics)
    text = "\n\n".join([*map(text_table, tables.values()), remarks, format_metrics(metrics)])
    print(text)
    (folder / "table.txt").write_text(text + "\n")
    write_metrics(folder / "metrics.json", metrics)
    titles = {method.key: method.title for method in methods}
    save(bias_figure({titles[key]: errors[key][0] for key in FLOORS}, VARIABLES, UNITS), folder / "bias.png")
    shown = dict(zip(scene.rig.names, differences[min(SHOWN_IMAGE, len(differences) - 1)], strict=True))
    save(cost_figure(shown), folder / "cost.png")
    found = [errors[key][0, worst][[2, 5]] for key in ("floor_hard", "floor")]
    save(valley_figure(valleys, VALLEY_MM, found), folder / "valley.png")
    _write_figures(folder, scene, images[BACKENDS[0]], tracked["stepping"].states, tables, remarks)
    say(f"wrote {folder}/table.txt, metrics.json, fig4.png, bias.png, cost.png, valley.png and report.html")


def start_errors(n: int) -> np.ndarray:
    """(n, 6) errors of the first start: that of `START_ERROR`, then of it with other signs, all different."""
    signs = np.random.default_rng(0).permutation(np.array(list(product((1.0, -1.0), repeat=len(START_ERROR)))[1:]))
    return np.array(START_ERROR) * np.concatenate([np.ones((1, len(START_ERROR))), signs])[:n]


class _Objectives:
    """Scores of the tracked body: as published, corrected, in ambient light; and the first as a least-squares problem."""

    def __init__(self, scene: Any):
        self.chain = scene.tracked.chain
        self.score = ColorObjective(scene.tracked, scene.rig, workers=Workers(1))
        self.capped = ColorObjective(scene.tracked, scene.rig, ColorOptions(cap=CAP), workers=Workers(1))
        self.ambient = ColorObjective(scene.tracked, scene.in_ambient_light().rig, workers=Workers(1))
        self.pyramid = PhotometricObjective(scene.tracked, scene.rig, workers=Workers(1))

    def show(self, images: Any) -> None:
        """Images that all score from now on."""
        for objective in (self.score, self.capped, self.ambient, self.pyramid):
            objective.set_images(images)


def _methods(objectives: _Objectives) -> Iterator[_Method]:
    """The paper's method and what it leaves open, what is better, the floor, and one renderer for targets and score."""
    score, pyramid, chain = objectives.score, objectives.pyramid, objectives.chain
    # The bottom of the valley is flat and uneven: several times from coarse to fine, each from the best so far.
    sizes_mm = 4 * (20.0, 10.0, 5.0, 2.0, 1.0, 14.0, 7.0, 3.0, 1.0)
    stages = tuple(SimplexStage(1e-3 * mm, radians(0.1 * mm), 0.03, max_evaluations=100) for mm in sizes_mm)

    def stepping(score: Any = score, v: str = "every_line", loops: Any = FIVE_LOOPS, order: Any = ORDER) -> Callable[[Any], Any]:
        return lambda start: step_downhill(score, start, chain, SteppingOptions(loops, order, v=v))

    def minimum(score: Any) -> Callable[[Any], Any]:
        return lambda start: search_simplex(score, start, chain, stages)

    def best(start: Any) -> Any:
        aligned = align_robustly(score, pyramid, start, chain)
        found = minimum(objectives.capped)(aligned.state)
        return replace(found, evaluations=found.evaluations + aligned.evaluations)

    other, same = BACKENDS
    yield _Method("stepping", "stepping", other, stepping(), several=True)
    yield _Method("best", "alignment + simplex, capped", other, best)
    yield _Method("floor", "floor, capped", other, minimum(objectives.capped), from_truth=True)
    yield _Method("floor_hard", "floor, hard mask", other, minimum(score), from_truth=True)
    yield _Method("stepping_ambient", "stepping, ambient", AMBIENT, stepping(objectives.ambient))
    yield _Method("floor_ambient", "floor, hard mask, ambient", AMBIENT, minimum(objectives.ambient), from_truth=True)
    yield _Method("stepping_v_last_loop", "V in last loop", other, stepping(v="last_loop"))
    yield _Method("stepping_table_order", "order of Table 1", other, stepping(order=TABLE_ORDER))
    yield _Method("stepping_seven_loops", "seven loops", other, stepping(loops=SEVEN_LOOPS), several=True)
    yield _Method("same_backend", "one renderer: stepping", same, stepping())
    yield _Method("same_backend_best", "one renderer: best", same, best)
    yield _Method("same_backend_floor", "one renderer: floor", same, minimum(objectives.capped), from_truth=True)


def _biases(floors: Mapping[str, np.ndarray]) -> dict[str, float | int]:
    """Mean signed errors in the world of floors (n, 6), and what is left of their rms without them."""
    metrics: dict[str, float | int] = {}
    for key, errors in floors.items():
        for name, unit, column in zip(VARIABLES, UNITS, errors.T, strict=True):
            metrics[f"table1.{key}.{name}_bias_{unit}"] = float(column.mean())
            metrics[f"table1.{key}.{name}_rest_{unit}"] = float(column.std())
    return metrics


def _valley(score: Any, truth: Any) -> Profile:
    """Scores around the truth as a profile over twist, with a column for each lateral position."""
    grid = [experiments.moved(truth, [0.0, 0.0, mm, 0.0, 0.0, deg]) for deg in VALLEY_DEG for mm in VALLEY_MM]
    return Profile(VALLEY_DEG, score.scores(grid).reshape(len(VALLEY_DEG), len(VALLEY_MM)))


def _of_valleys(valleys: Iterable[Profile]) -> dict[str, float]:
    """How many degrees twist can move, the lateral position along with it, before the score rises by a hundredth."""
    metrics = {}
    for key, valley in zip(("hard", "capped"), valleys, strict=True):
        lowest = valley.scores.min(axis=1)
        metrics[f"table1.valley_{key}_twist_deg"] = float(np.ptp(valley.changes[lowest <= 1.01 * lowest.min()]))
    return metrics


def _differences(scene: Any, image_sets: Any) -> list[list[np.ndarray]]:
    """Differences (h, w) of the tracked body in the true states from targets, gray levels; nan where it does not cover."""
    drawn = scene.draw(scene.tracked, scene.truth)
    return [
        [np.where(body.any(axis=2), np.sqrt(np.mean((body - target.astype(float)) ** 2, axis=2)), np.nan)
         for body, target in zip(bodies, targets, strict=True)]
        for bodies, targets in zip(drawn, image_sets, strict=True)
    ]  # fmt: skip


def _overhang(differences: Any, image_sets: Any) -> dict[str, float]:
    """Which share of the mask lies over black at the truth, and which share of the squares is there."""
    all_off = np.concatenate([each.ravel() for of_set in differences for each in of_set])
    black = np.concatenate([~each.any(axis=2).ravel() for of_set in image_sets for each in of_set])
    over = all_off[black & ~np.isnan(all_off)]
    return {
        "table1.overhang_pixel_share": len(over) / float(np.sum(~np.isnan(all_off))),
        "table1.overhang_cost_share": float(np.sum(over**2) / np.nansum(all_off**2)),
    }


def _circumstances(scene: Any, objectives: _Objectives, images: Any, tracked: Any) -> dict[str, float | int]:
    """How many scores it took, how large the mask is, and how far apart the two bodies' surfaces lie."""
    pixels: list[int] = []
    scores: dict[str, list[float]] = {f"table1.{key}.score": [] for key in TABLES["Table 1"]}
    for i, (image_set, truth) in enumerate(zip(images, scene.truth, strict=True)):
        objectives.show(image_set)
        pixels.append(int(objectives.score.evaluate(truth).camera_pixels.sum()))
        for key in scores:
            scores[key].append(objectives.score.score(tracked[key.split(".")[1]].states[i]))
    distances = segment_distances(scene.tracked, scene.measured)
    return {
        "table1.evaluations_per_variable": tracked["stepping"].evaluations_per_variable,
        "table1.best.evaluations_per_variable": tracked["best"].evaluations_per_variable,
        **{key: float(np.mean(values)) for key, values in scores.items()},
        "table1.mask_pixels": round(float(np.mean(pixels))),
        "table1.surface_distance_mean_mm": float(np.mean([row.mean_mm for row in distances])),
        "table1.surface_distance_max_mm": max(row.max_mm for row in distances),
    }


def _remarks(metrics: dict[str, float | int]) -> str:
    floor = [metrics[f"table1.floor_hard.{name}_rms_{unit}"] for name, unit in zip(VARIABLES, UNITS, strict=True)]
    high = [LABELS[name] for name, rms, paper in zip(VARIABLES, floor, PAPER_RMS, strict=True) if rms > 0.5 * paper]
    start = ", ".join(f"{value:+g}" for value in START_ERROR)
    push = {key: float(np.linalg.norm([metrics[f"table1.{key}.{name}_bias_mm"] for name in VARIABLES[:3]])) for key in FLOORS}
    return (
        f"Scores for each variable of an image set: {metrics['table1.evaluations_per_variable']:.1f} stepping,"
        f" {metrics['table1.best.evaluations_per_variable']:.1f} for alignment + simplex, which searches around every start"
        f" (paper: about {PAPER_EVALUATIONS_PER_VARIABLE}). Mask: {metrics['table1.mask_pixels']} pixels.\n"
        f"Error of the first start (mm: vertical, A-P, lateral; degrees: somersault, tilt, twist): {start}. Stepping begins from"
        " this one and from others with its signs changed: medians, and the range of the rms.\n"
        "Floor: the minimum of the score, searched from the truth; what is left are the two bodies' different shapes:"
        f" {metrics['table1.surface_distance_mean_mm']:.1f} mm between their surfaces on average. With the hard mask it is above"
        f" half of the paper's rms in: {', '.join(high) or 'no variable'}.\n"
        "Where it comes from: at the truth the fat ellipsoids overhang the body, and"
        f" {100 * metrics['table1.overhang_cost_share']:.0f} % of the squares are on the"
        f" {100 * metrics['table1.overhang_pixel_share']:.0f} % of the mask that is over black. There a pixel costs its own"
        f" brightness, so that light pushes the body: on average by {push['floor_hard']:.1f} mm, in ambient light alone"
        f" {push['floor_ambient']:.1f}, and {push['floor']:.1f} where no pixel counts for more than {CAP:.0f} gray levels"
        " (capped).\n"
        f"Twist is worst in image {metrics['table1.floor_hard.twist_worst_image']} (from 0): with the lateral position it moves"
        f" {metrics['table1.valley_hard_twist_deg']:.1f} degrees before the score rises by 1 %"
        f" ({metrics['table1.valley_capped_twist_deg']:.1f} capped)."
    )


def _write_figures(folder: Path, scene: Any, targets: Any, states: Any, tables: Any, remarks: str) -> None:
    """Fig. 4, and the page."""
    tracked = scene.draw(scene.tracked, states)
    rows = {}
    for camera, name in enumerate(scene.rig.names[:2]):
        rows[f"target, {name} view"] = [image_set[camera] for image_set in targets]
        rows[f"tracked, {name} view"] = [image_set[camera] for image_set in tracked]
    save(sequence_figure(rows), folder / "fig4.png")
    write_page(folder / "report.html", "Half-twisting somersault, tracked by color", [
        PageSection("What it is", remarks),
        *(PageSection(title, "Maximum and rms over all image sets.", table) for title, table in tables.items()),
        PageSection("Fig. 4", "What was filmed, and the ellipsoid body where stepping found it.", image=folder / "fig4.png"),
        PageSection("Floors", "Signed errors in the world: mean (bars) and every image set (dots).", image=folder / "bias.png"),
        PageSection("Where the score is lost", "At the truth, gray levels.", image=folder / "cost.png"),
        PageSection("Where twist is worst", "The score over twist and lateral position.", image=folder / "valley.png"),
    ])  # fmt: skip


REACH_MM, REACH_DEG = 400.0, 80.0
NEAR_MM = {"ellipsoid": 5.0, "nurbs": 15.0}  # a fit so near the truth has arrived; where shapes differ, the minimum itself is off
TITLES = {"ellipsoid": "ellipsoids on ellipsoids", "nurbs": "ellipsoids on NURBS"}
START_ERRORS = ((60.0, 6.0), (100.0, 10.0), (150.0, 15.0), (200.0, 20.0), (300.0, 30.0))  # mm, degrees


def run_convergence(folder: Path, trials: int, quick: bool) -> None:
    """Score along each variable around the truth, and rates of success; write metrics, figures and report.

    Parameters
    ----------
    folder : where the results go; it is made.
    trials : starts for each size of the start's error.
    quick : few small images and two starts: shows that it runs.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scene = somersault_scene(2, 192) if quick else somersault_scene()
    score = ColorObjective(scene.tracked, scene.rig, workers=Workers(1))
    pyramid = PhotometricObjective(scene.tracked, scene.rig, workers=Workers(1))
    metrics: dict[str, float | int] = {}
    profiles, rates = {}, {}
    starts, trials = (START_ERRORS[:1], 2) if quick else (START_ERRORS, trials)
    for key, body in (("ellipsoid", scene.tracked), ("nurbs", scene.measured)):
        say(f"{TITLES[key]}: drawing {len(scene.truth)} target image sets")
        images = scene.film(body)

        def show(i: int, images: Any = images) -> None:
            score.set_images(images[i])
            pyramid.set_images(images[i])

        profiles[key] = _profiles(show, score, scene.truth, 9 if quick else 161)
        metrics |= _widths(f"convergence.{key}", profiles[key])
        rates[key] = _rates(show, _optimizers(score, pyramid, scene.tracked.chain), scene.truth, starts, trials, NEAR_MM[key])
        for name, values in rates[key].items():
            for (mm, deg), value in zip(starts, values, strict=True):
                metrics[f"convergence.{key}.{name}_{mm:.0f}mm_{deg:.0f}deg"] = value
    print(format_metrics(metrics))
    write_metrics(folder / "metrics.json", metrics)
    _write_convergence(folder, profiles, starts, rates, metrics)
    say(f"wrote {folder}/metrics.json, fig5.png, fig6.png, success_*.png and report.html")


def _optimizers(score: Any, pyramid: Any, chain: Any) -> dict[str, Callable[[Any], Any]]:
    """Name -> a fit from a start; ``default`` is what the tracker uses for rigid bodies."""
    return {
        "stepping": lambda start: step_downhill(score, start, chain),
        "simplex": lambda start: search_simplex(score, start, chain),
        "alignment": lambda start: align(pyramid, start, chain),
        "default": lambda start: align_robustly(score, pyramid, start, chain),
    }


def _profiles(show: Callable[[int], None], objective: Any, truth: Sequence[Any], points: int) -> list[dict[str, Any]]:
    """For every image set: variable -> scores along it."""
    result = []
    for image, state in enumerate(truth):
        show(image)
        of_image = {}
        for name, unit in zip(VARIABLES, UNITS, strict=True):
            changes = np.linspace(-1.0, 1.0, points) * (REACH_MM if unit == "mm" else REACH_DEG)
            of_image[name] = Profile(changes, profile(objective, state, name, changes))
        result.append(of_image)
    return result


def _widths(prefix: str, profiles: Sequence[dict[str, Any]]) -> dict[str, float]:
    """How far the score rises on the steeper and on the gentler side, over all image sets, and how far off the minimum is."""
    metrics = {}
    for name, unit in zip(VARIABLES, UNITS, strict=True):
        basins = np.array([basin(of[name].changes, of[name].scores) for of in profiles])
        metrics[f"{prefix}.{name}_basin_narrowest_{unit}"] = float(basins[:, 1:].min())
        metrics[f"{prefix}.{name}_basin_median_{unit}"] = float(np.median(basins[:, 1:]))
        metrics[f"{prefix}.{name}_minimum_off_{unit}"] = float(np.abs(basins[:, 0]).max())
    return metrics


def _rates(
    show: Callable[[int], None], fits: dict[str, Callable[[Any], Any]], truth: Sequence[Any], starts: Any, trials: int,
    near_mm: float,
) -> dict[str, list[float]]:  # fmt: skip
    """Optimizer -> fraction of starts that arrive, for each size of the start's error."""
    rates: dict[str, list[float]] = {}
    for name, fit in fits.items():
        rates[name] = [success_rate(show, truth, fit, mm, deg, trials, near_mm=near_mm) for mm, deg in starts]
        said = ", ".join(f"{mm:.0f} mm {rate:.0%}" for (mm, _), rate in zip(starts, rates[name], strict=True))
        say(f"  {name}: arrives from {said}")
    return rates


def _write_convergence(folder: Path, profiles: Any, starts: Any, rates: Any, metrics: dict[str, float | int]) -> None:
    sections = []
    for number, unit in ((5, "mm"), (6, "deg")):
        names = [name for name, own in zip(VARIABLES, UNITS, strict=True) if own == unit]
        panels = {
            TITLES[key]: {LABELS[name]: of[min(SHOWN_IMAGE, len(of) - 1)][name] for name in names} for key, of in profiles.items()
        }
        path = folder / f"fig{number}.png"
        save(convergence_figure(panels, unit), path)
        sections.append(PageSection(f"Fig. {number}", "The score as one variable leaves the truth.", image=path))
    for key, of in rates.items():
        path = folder / f"success_{key}.png"
        save(success_figure([f"{mm:.0f} mm\n{deg:.0f}°" for mm, deg in starts], of), path)
        title = f"From how far each optimizer arrives within {NEAR_MM[key]:.0f} mm, {TITLES[key]}"
        sections.append(PageSection(title, image=path))
    sections.append(PageSection("Figures", preformatted=format_metrics(metrics)))
    write_page(folder / "report.html", "How wide the score's valley is", sections)
