"""Width of the color score's valley, and from how far each optimizer finds back (Trewartha, Yeadon & Knight, Figs 5 and 6)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...objective.color.alignment import PhotometricObjective
from ...objective.color.score import ColorObjective
from ...optimize.alignment import align
from ...optimize.robust_fit import align_robustly
from ...optimize.simplex import search_simplex
from ...optimize.stepping import step_downhill
from ...parallel import Workers
from ...report.html import PageSection, write_page
from ...report.metrics_file import format_metrics, write_metrics
from ...report.progress import say
from ..plots import Profile, convergence_figure, save, success_figure
from ..rigid_tracking import LABELS, UNITS, VARIABLES, basin, profile, success_rate
from .scene import somersault_scene

REACH_MM, REACH_DEG = 400.0, 80.0
SHOWN_IMAGE = 3  # the image set of the plots; the widths are over all
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
    _write_figures(folder, profiles, starts, rates, metrics)
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


def _write_figures(folder: Path, profiles: Any, starts: Any, rates: Any, metrics: dict[str, float | int]) -> None:
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
