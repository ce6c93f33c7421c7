"""The experiment on the wooden cross in interlaced video (Trewartha, Yeadon & Knight, Figs 3 and 7 to 10)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...report.metrics_file import format_metrics, write_metrics
from ...report.page import PageSection, write_page
from ...report.progress import say
from ..plots import plan_figure, save
from ..rigid_tracking import pose_error, text_table
from . import plots as cross_plots
from .methods import AS_PUBLISHED, BEST, METHODS, camera_times, track
from .scene import cross_scene
from .throw import FIELD_PERIOD_S
from .video_tracking import velocities

PAPER = {"side": (10.0, 3.0), "twist": (17.0, 9.0)}  # mm and degrees that the rms differences to digitizing stay below
FIGURES = {"side": (7, 9), "twist": (8, 10)}  # numbers in the paper
_SHOWN_FIELDS = 7


def run_cross(folder: Path, seed: int, quick: bool) -> None:
    """Film and digitize both throws, track them by every method; write the table, metrics, figures and report.

    Parameters
    ----------
    folder : where the results go; it is made.
    seed : of noise, background, lights and control points.
    quick : three fields of each throw and two methods: shows that it runs.
    """
    folder.mkdir(parents=True, exist_ok=True)
    scene = cross_scene(seed, n_fields=3) if quick else cross_scene(seed)
    methods = (BEST, AS_PUBLISHED) if quick else METHODS
    metrics = _calibration_metrics(scene)
    text, sections = [], [_plan(scene, folder)]
    for trial in scene.trials:
        footage = {}
        for backend in dict.fromkeys(method.backend for method in methods):
            say(f"{trial.name} somersault: filming {trial.n_fields} fields with {backend}")
            footage[backend] = scene.film(trial, backend)
        digitized = scene.digitize(trial)
        tracked = {}
        for method in methods:
            say(f"{trial.name} somersault: {method.title}")
            late_s = camera_times(scene, trial, footage[method.backend], method)
            tracked[method] = track(scene, trial, footage[method.backend], method, late_s)
            if method.times == "estimated":
                metrics[f"cross.{trial.name}.{method.key}delay_ms"] = 1e3 * max(late_s, key=abs)
        table = _compare(trial, tracked, digitized, metrics)
        text += [f"{trial.name} somersault, {trial.n_fields} fields: rms / maximum of the worst variable", text_table(table), ""]
        sections.append(PageSection(f"The {trial.name} somersault", "Rms / maximum of the worst variable.", table))
        sections += _images(folder, scene, trial, footage[BEST.backend], tracked, digitized)
    text.append(format_metrics(metrics))
    print("\n".join(text))
    (folder / "table.txt").write_text("\n".join(text) + "\n")
    write_metrics(folder / "metrics.json", metrics)
    write_page(folder / "report.html", "The wooden cross", sections)
    say(f"wrote {folder}/report.html, table.txt, metrics.json and the images")


def _calibration_metrics(scene: Any) -> dict[str, float | int]:
    """How closely each kind of camera fits its control points, the worst of the three."""
    worst = {name: max(found.rms_px for found in cameras) for name, cameras in scene.calibrations.items()}
    return {f"cross.calibration.{name}_rms_px": float(value) for name, value in worst.items()}


def _compare(
    trial: Any, tracked: Mapping[Any, Any], digitized: Sequence[Any], metrics: dict[str, float | int]
) -> list[list[str]]:
    """Add the figures of a trial to ``metrics``; a table of them."""
    truth = trial.states()
    clicked = [i for i, state in enumerate(digitized) if state is not None]
    by_hand = np.array([pose_error(digitized[i], truth[i]) for i in clicked])
    paper = PAPER[trial.name]
    rows = [["", "position", "angle", "evaluations per variable"]]

    def add(key: str, title: str, errors: np.ndarray, evaluations: str = "") -> None:
        rms, most = np.sqrt((errors**2).mean(axis=0)), np.abs(errors).max(axis=0)
        cells = []
        for name, unit, part in (("position", "mm", slice(0, 3)), ("angle", "deg", slice(3, 6))):
            metrics[f"cross.{trial.name}.{key}{name}_rms_{unit}"] = float(rms[part].max())
            metrics[f"cross.{trial.name}.{key}{name}_max_{unit}"] = float(most[part].max())
            cells.append(f"{rms[part].max():.2f} / {most[part].max():.2f} {unit}")
        rows.append([title, *cells, evaluations])

    for method, sequence in tracked.items():
        add(method.key, f"{method.title}, against truth", sequence.errors(truth), f"{sequence.evaluations_per_variable:.0f}")
    add("digitizing.", "digitizing, against truth", by_hand)
    for method, key in ((BEST, "vs_digitizing."), (AS_PUBLISHED, f"{AS_PUBLISHED.key[:-1]}_vs_digitizing.")):
        states = tracked[method].states
        add(key, f"{method.title}, against digitizing", np.array([pose_error(states[i], digitized[i]) for i in clicked]))
    rows.append(["paper: stepping, against digitizing", f"< {paper[0]:g} mm", f"< {paper[1]:g} deg", "20"])
    metrics[f"cross.{trial.name}.evaluations_per_variable"] = tracked[BEST].evaluations_per_variable
    metrics[f"cross.{trial.name}.{AS_PUBLISHED.key}evaluations_per_variable"] = tracked[AS_PUBLISHED].evaluations_per_variable
    return rows


def _plan(scene: Any, folder: Path) -> Any:
    """Fig. 3."""
    paths = {f"{t.name} somersault": np.array([s.T_world_root[:3, 3] for s in t.states()]) for t in scene.trials}
    save(plan_figure(scene.rig, paths), folder / "fig3_plan.png")
    return PageSection("The cameras from above (Fig. 3)", image=folder / "fig3_plan.png")


def _images(
    folder: Path, scene: Any, trial: Any, footage: Any, tracked: Mapping[Any, Any], digitized: Sequence[Any]
) -> list[Any]:
    """An interlaced image, and the figures 7 to 10."""
    mask_number, pose_number = FIGURES[trial.name]
    masks, poses = folder / f"fig{mask_number}_{trial.name}_mask.png", folder / f"fig{pose_number}_{trial.name}_pose.png"
    video, errors = folder / f"{trial.name}_video.png", folder / f"{trial.name}_errors.png"
    middle = trial.n_fields // 2
    cv2.imwrite(str(video), np.hstack([footage.images[0][middle // 2], *footage.interpolated(middle)[:1]]))
    best, published = tracked[BEST], tracked[AS_PUBLISHED]
    fields = sorted({int(i) for i in np.linspace(0, trial.n_fields - 1, _SHOWN_FIELDS)})
    moving = velocities(best.states, FIELD_PERIOD_S)
    seen = {field: scene.seen(best.states[field], moving[field]) for field in fields}
    images = {field: footage.interpolated(field) for field in fields}
    save(cross_plots.through_mask_figure(scene.model, scene.rigs[BEST.rig], images, seen), masks)
    truth = trial.states()
    curves = {"truth": truth, BEST.title: best.states, "stepping, as published": published.states, "digitizing": digitized}
    save(cross_plots.pose_figure(curves), poses)
    save(cross_plots.error_figure({m.title: tracked[m].errors(truth) for m in (BEST, AS_PUBLISHED)}), errors)
    text = "Against truth; stepping as published, with cameras from DLT that are taken for simultaneous."
    return [
        PageSection("As filmed", "Left: an interlaced image. Right: one of its fields, missing lines interpolated.", image=video),
        PageSection(f"Target through the mask (Fig. {mask_number})", image=masks),
        PageSection(f"Pose (Fig. {pose_number})", image=poses),
        PageSection("Errors", text, image=errors),
    ]
