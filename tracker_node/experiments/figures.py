"""Figures of the color paper: bodies, one match in five panels, plan view (Trewartha, Yeadon & Knight, Figs 1 to 3)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..camera.model import CameraModel
from ..camera.rig import Camera, CameraRig
from ..loaders.rig.rig_yaml import load_rig
from ..model.configuration import Configuration, State
from ..model.humans.segments18 import ellipsoid_human, nurbs_human
from ..render.raycast.raycaster import render_color
from ..report.html import PageSection, write_page
from ..report.metrics_file import write_metrics
from ..report.progress import say
from ..synthesis.scenes.scene import looking_at
from .cross.throw import cross_rig, side_somersault, twisting_somersault, yellow_stick
from .plots import bodies_figure, matching_figure, plan_figure, save
from .rigid_tracking import moved
from .somersault.scene import distance_table, segment_distances, somersault_rig, somersault_scene

SHOWN_IMAGE = 2  # of the somersault
ESTIMATE_ERROR = (40.0, -30.0, 20.0, 6.0, 3.0, -8.0)  # mm and degrees: a pose that still has to be improved


def draw_figures(folder: Path, rig_file: str | None, quick: bool) -> None:
    """Draw the figures, and write how far the surfaces of both bodies lie apart.

    Parameters
    ----------
    folder : where the results go; it is made.
    rig_file : rig.yaml of the plan view; None: the cameras around the wooden cross.
    quick : small images.
    """
    rig, paths = _plan(rig_file)
    folder.mkdir(parents=True, exist_ok=True)
    bodies = {"NURBS": nurbs_human(), "ellipsoids": ellipsoid_human()}
    say("drawing the bodies")
    standing = {title: Configuration(body, State.neutral(body)) for title, body in bodies.items()}
    save(bodies_figure(standing, _portrait_rig(160 if quick else 480)), folder / "fig1.png")
    target, view, camera = _match(192 if quick else 768)
    save(matching_figure(target, view, camera), folder / "fig2.png")
    save(plan_figure(rig, paths), folder / "fig3.png")
    table = distance_table(bodies["ellipsoids"], bodies["NURBS"])
    print(table)
    (folder / "surface_distance.txt").write_text(table + "\n")
    metrics = {}
    for row in segment_distances(bodies["ellipsoids"], bodies["NURBS"]):
        metrics[f"surface_distance.{row.segment}_mean_mm"] = row.mean_mm
        metrics[f"surface_distance.{row.segment}_max_mm"] = row.max_mm
    write_metrics(folder / "metrics.json", metrics)
    write_page(folder / "report.html", "Bodies, matching, cameras", [
        PageSection("Fig. 1", "The body of the target images, and the one that tracks it.", image=folder / "fig1.png"),
        PageSection("How far their surfaces lie apart", preformatted=table),
        PageSection("Fig. 2", "A target image, and the body in an estimate that is still off.", image=folder / "fig2.png"),
        PageSection("Fig. 3", "The cameras from above.", image=folder / "fig3.png"),
    ])  # fmt: skip
    say(f"wrote {folder}/fig1.png, fig2.png, fig3.png, surface_distance.txt, metrics.json and report.html")


def _portrait_rig(height: int) -> Any:
    """Front, side and half-side view of a standing body, upright images."""
    width, middle = round(0.5 * height), np.array([0.0, 0.0, -0.33])  # the pelvis is at the origin
    K = np.array([[3.7 * height, 0.0, 0.5 * (width - 1)], [0.0, 3.7 * height, 0.5 * (height - 1)], [0.0, 0.0, 1.0]])
    cameras = []
    for name, degrees in (("front", 0.0), ("half-side", -45.0), ("side", -90.0)):
        direction = np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees)), 0.0])
        cameras.append(Camera(name, CameraModel(width, height, K), looking_at(middle + 8.0 * direction, middle)))
    return CameraRig(tuple(cameras), lights=somersault_rig().lights)


def _match(width: int) -> tuple[Any, Any, Any]:
    """A target image of the side view, the tracked body in an estimate of its pose, and the camera."""
    scene = somersault_scene(SHOWN_IMAGE + 1, width)
    target = scene.film(scene.measured)[SHOWN_IMAGE][1]
    estimate = Configuration(scene.tracked, moved(scene.truth[SHOWN_IMAGE], ESTIMATE_ERROR))
    camera = scene.rig.cameras[1]
    return target, render_color(estimate, camera, scene.rig.lights), camera


def _plan(rig_file: str | None) -> tuple[Any, dict[str, Any]]:
    """The rig of the plan view, and the ways of what it films."""
    if rig_file:
        return load_rig(rig_file), {}
    model = yellow_stick()
    paths = {}
    for name, trial in (("side somersault", side_somersault(model)), ("twisting somersault", twisting_somersault(model))):
        paths[name] = np.array([state.T_world_root[:3, 3] for state in trial.states()])
    return cross_rig(), paths
