"""The experiment on the wooden cross in interlaced video (Trewartha, Yeadon & Knight, Figs 3 and 7 to 10).

Images of the wooden cross, like Figs 7 to 10 of Trewartha, Yeadon & Knight. Images are BGR uint8.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import N_ROOT, ROOT_NAMES, Configuration, State, to_variables
from ...render.overlay import masked_image
from ...render.palette import BLUE, GRAY, GREEN, ORANGE, PURPLE
from ...report.html import PageSection, text_table, write_page
from ...report.metrics_file import format_metrics, write_metrics
from ...report.progress import say
from ..plots import plan_figure, save
from ..rigid_tracking import UNITS, VARIABLES, pose_error
from .methods import AS_PUBLISHED, BEST, METHODS, estimated_times, track, velocities
from .scene import SHUTTER_S, cross_scene
from .throw import FIELD_PERIOD_S, LATE_CAMERA, LATE_S

PAPER = {"side": (10.0, 3.0), "twist": (17.0, 9.0)}  # mm and degrees that the rms differences to digitizing stay below
FIGURES = {"side": (7, 9), "twist": (8, 10)}  # numbers in the paper
_SHOWN_FIELDS = 7
_BACKEND = "pyrender"  # not the renderer that scores


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
        for shutter_s in dict.fromkeys(method.shutter_s for method in methods):
            say(f"{trial.name} somersault: filming {trial.n_fields} fields of {1e3 * shutter_s:g} ms")
            footage[shutter_s] = scene.film(trial, _BACKEND, shutter_s)
        digitized = scene.digitize(trial)
        say(f"{trial.name} somersault: when each camera exposes")
        estimated = estimated_times(scene, trial, footage[BEST.shutter_s])
        late_s = {"known": scene.late_s, "estimated": estimated, "ignored": (0.0,) * len(estimated)}
        tracked = {}
        for method in methods:
            say(f"{trial.name} somersault: {method.title}")
            tracked[method] = track(scene, trial, footage[method.shutter_s], method, late_s[method.times])
        metrics[f"cross.{trial.name}.phase_ms"] = 1e3 * (max(estimated, key=abs) - LATE_S)
        table = _compare(trial, tracked, digitized, metrics)
        said = f"Rms / maximum of the worst variable; camera {LATE_CAMERA} is {1e3 * LATE_S:g} ms late,"
        said += f" {1e3 * max(estimated, key=abs):.2f} ms by its video."
        text += [f"{trial.name} somersault, {trial.n_fields} fields. {said}", text_table(table), ""]
        sections.append(PageSection(f"The {trial.name} somersault", said, table))
        sections += _images(folder, scene, trial, footage[BEST.shutter_s], tracked, digitized, estimated)
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
    folder: Path, scene: Any, trial: Any, footage: Any, tracked: Mapping[Any, Any], digitized: Sequence[Any],
    late_s: Sequence[float],
) -> list[Any]:  # fmt: skip
    """An interlaced image, and the figures 7 to 10."""
    mask_number, pose_number = FIGURES[trial.name]
    masks, poses = folder / f"fig{mask_number}_{trial.name}_mask.png", folder / f"fig{pose_number}_{trial.name}_pose.png"
    video, errors = folder / f"{trial.name}_video.png", folder / f"{trial.name}_errors.png"
    middle = trial.n_fields // 2
    cv2.imwrite(str(video), np.hstack([footage.images[0][middle // 2], *footage.interpolated(middle)[:1]]))
    best, published = tracked[BEST], tracked[AS_PUBLISHED]
    fields = sorted({int(i) for i in np.linspace(0, trial.n_fields - 1, _SHOWN_FIELDS)})
    moving = velocities(best.states, FIELD_PERIOD_S)
    seen = {field: [best.states[field].retract(late * moving[field]) for late in late_s] for field in fields}
    images = {field: footage.interpolated(field) for field in fields}
    save(through_mask_figure(scene.model, scene.rigs[BEST.rig], images, seen), masks)
    truth = trial.states()
    curves = {"truth": truth, BEST.title: best.states, "stepping, as published": published.states, "digitizing": digitized}
    save(pose_figure(curves), poses)
    save(error_figure({m.title: tracked[m].errors(truth) for m in (BEST, AS_PUBLISHED)}), errors)
    text = "Against truth; stepping as published, with cameras of seven parameters that are taken for simultaneous."
    filmed = f"Left: an interlaced image, fields of {1e3 * SHUTTER_S:g} ms. Right: one of them, missing lines interpolated."
    return [
        PageSection("As filmed", filmed, image=video),
        PageSection(f"Target through the mask (Fig. {mask_number})", image=masks),
        PageSection(f"Pose (Fig. {pose_number})", image=poses),
        PageSection("Errors", text, image=errors),
    ]


_STYLES = ((GRAY, "-", 3.5), (BLUE, "-", 1.4), (GREEN, "--", 1.4), (ORANGE, ".", 1.0), (PURPLE, ":", 1.4))
_MARGIN = 14  # pixels around what an image shows


def through_mask_figure(
    model: ArticulatedModel, rig: CameraRig, image_sets: Mapping[int, Sequence[np.ndarray]], states: Mapping[int, Sequence[State]]
) -> Figure:
    """Targets through the masks of the tracked body (Figs 7 and 8): a row for each camera, a column for each field.

    Parameters
    ----------
    model : the cross.
    rig : the cameras.
    image_sets : number of the field -> its images, in the order of the rig.
    states : number of the field -> the tracked state, as each camera sees it.

    Returns
    -------
    The figure.
    """
    figure = Figure(figsize=(1.75 * len(image_sets), 1.9 * len(rig)), layout="constrained")
    axes = figure.subplots(len(rig), len(image_sets), squeeze=False)
    for row, camera in enumerate(rig):
        images = {
            field: masked_image(images[row], Configuration(model, states[field][row]), camera)
            for field, images in image_sets.items()
        }
        half = max(_half_size(image) for image in images.values())
        for ax, (field, image) in zip(axes[row], images.items(), strict=True):
            ax.imshow(_window(image, half)[:, :, ::-1], interpolation="nearest")
            ax.set_xticks([])
            ax.set_yticks([])
            if row == 0:
                ax.set_title(f"field {field + 1}", fontsize=9)
        axes[row, 0].set_ylabel(camera.name, fontsize=9)
    return figure


def pose_figure(curves: Mapping[str, Sequence[State | None]]) -> Figure:
    """The six variables against the number of the field (Figs 9 and 10); the first curve is the truth.

    Parameters
    ----------
    curves : title -> a state for each field, or None where there is none.
    """
    truth = _unwrapped(next(iter(curves.values())))
    values = {title: _unwrapped(states, truth) for title, states in curves.items()}
    return _six_panels(values, "{name} [{unit}]")


def error_figure(curves: Mapping[str, np.ndarray]) -> Figure:
    """Errors (n, 6), mm and degrees, of several ways to track against the number of the field."""
    return _six_panels({"": np.zeros((0, N_ROOT)), **curves}, "error of {name} [{unit}]")


def _six_panels(curves: Mapping[str, np.ndarray], label: str) -> Figure:
    figure = Figure(figsize=(10.0, 5.4), layout="constrained")
    for column, ax in enumerate(figure.subplots(2, 3, sharex=True).ravel()):
        for (title, values), (color, line, width) in zip(curves.items(), _STYLES, strict=False):
            fields = np.arange(1, len(values) + 1)
            ax.plot(fields, values[:, column], line, color=color, lw=width, ms=5, label=title)
        ax.set_ylabel(label.format(name=VARIABLES[column].replace("ap", "A-P"), unit=UNITS[column]), fontsize=9)
        ax.spines[["top", "right"]].set_visible(False)
        ax.grid(axis="y", color="#e3e3e3", lw=0.7)
        ax.tick_params(labelsize=8)
        if column >= 3:
            ax.set_xlabel("field", fontsize=9)
    handles, titles = figure.axes[0].get_legend_handles_labels()
    shown = [(h, t) for h, t in zip(handles, titles, strict=True) if t]
    figure.legend(*zip(*shown, strict=True), loc="outside upper center", ncols=len(shown), frameon=False, fontsize=9)
    return figure


def _unwrapped(states: Sequence[State | None], near: np.ndarray | None = None) -> np.ndarray:
    """(n, 6) in the order of `VARIABLES`, mm and degrees; full turns count on, or near ``near``; nan where there is no state."""
    columns = [ROOT_NAMES.index(name) for name in ("z", "x", "y", "somersault", "tilt", "twist")]
    scales = np.array([1e3] * 3 + [np.degrees(1.0)] * 3)
    rows = np.full((len(states), N_ROOT), np.nan)
    last = None
    for i, state in enumerate(states):
        if state is not None:
            if near is not None:
                last = np.empty(N_ROOT)
                last[columns] = near[i] / scales
            last = to_variables(state, last)[:N_ROOT]
            rows[i] = last[columns] * scales
    return rows


def _half_size(image: np.ndarray) -> int:
    rows, columns = np.nonzero(image.max(axis=2))
    return max(int(np.ptp(rows)), int(np.ptp(columns))) // 2 + _MARGIN if len(rows) else _MARGIN


def _window(image: np.ndarray, half: int) -> np.ndarray:
    """The square of ``half`` the width around what is not black; black beyond the image."""
    rows, columns = np.nonzero(image.max(axis=2))
    v, u = ((int(r.min()) + int(r.max())) // 2 if len(r) else half for r in (rows, columns))
    padded = np.pad(image, ((half, half), (half, half), (0, 0)))
    return padded[v : v + 2 * half, u : u + 2 * half]
