"""The contour paper's experiment: silhouettes, edges and their sum, and the sliding term (Knossow et al., Figs 3 to 6).

Errors of one part along a row of its image and of a whole body along single variables, tracking by each distance, figures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

import numpy as np

from ...camera.rig import CameraRig
from ...errors import TrackerError
from ...geometry import se3
from ...model.articulated import ArticulatedModel, Shape
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import KinematicChain
from ...model.shapes.primitives import TruncatedCone
from ...observation.chamfer.distance_transform import distance_to
from ...observation.image_set import CameraImage, ImageSet
from ...report.html import PageSection, text_table, write_page
from ...report.metrics_file import format_metrics, write_metrics
from ...report.progress import say
from ...synthesis.dataset import N_BACKGROUNDS
from ...synthesis.recording import default_motions
from ...synthesis.scenes.scene import SceneConfig, Studio, make_rig
from ...synthesis.subjects.cones import ModelSubject
from ...tracking.config import TrackerConfig
from ..plots import Profile, save
from . import tracking
from .clips import Clip, TrackedClip, balancing_clip, cones_clip, mannequin_clip
from .errors import METHODS, PUBLISHED, REACH_PX, ContourError, by_method, far_sighted
from .figures import DRAWN, RowFigure, evidence_figures, row_figure, sequence_figures, shoot, tracking_figure, variables_figure
from .tracking import VARIABLES, body_profiles, mean_profile, valley_metrics

CLIPS = ("cones", "mannequin", "balancing")
BODY_SETS = 4  # image sets in which a whole body leaves the truth
DISPLACED_STARTS = 20
QUICK_COARSENESS = 5
MODELS = {"part": ("a model of its size", 1.0), "thin_part": ("a model a fifth thinner", 0.8)}
"""By the names of figures: what it is called, and how thick it is against the part in the image."""
_LENGTH_M, _MIDDLE_HEIGHT_M = 0.5, 1.0
_SCENE = SceneConfig(n_cameras=1, radius=1.6, target_height=_MIDDLE_HEIGHT_M, distortion=())
_SHIFTS_PX = np.linspace(-60.0, 60.0, 121)


def run_contours(folder: Path, clips: Mapping[str, Clip], quick: bool) -> None:
    """Measure all recordings, and write table, metrics, figures and report.

    Parameters
    ----------
    folder : where the results go; it is made.
    clips : recordings by the names of `CLIPS`, see `make_clips`.
    quick : fewer profiles, methods and starts: shows that it runs.
    """
    folder.mkdir(parents=True, exist_ok=True)
    metrics: dict[str, float | int] = {}
    sections = [_part(folder, metrics)]
    if "cones" in clips:
        sections.append(_body(folder, clips["cones"], quick, metrics))
    runs, images = {}, []
    for name, clip in clips.items():
        say(f"{clip.name}: tracking")
        runs[clip.name] = tracking.track_by(clip, METHODS[:-1] if quick else METHODS)
        metrics |= tracking.tracking_metrics(clip.name, runs[clip.name]) | tracking.sliding_metrics(clip)
        if name == "cones":
            metrics |= tracking.displaced_metrics(clip, 2 if quick else DISPLACED_STARTS)
        if name == "mannequin" or len(clips) == 1:
            images += evidence_figures(folder, clip, runs[clip.name][DRAWN])
        images += sequence_figures(folder, clip, runs[clip.name][DRAWN])
    tables = _tables(runs, metrics)
    text = "\n".join(f"{title}\n{text_table(table)}\n" for title, table in tables.items()) + "\n" + format_metrics(metrics)
    print(text)
    (folder / "table.txt").write_text(text + "\n")
    write_metrics(folder / "metrics.json", metrics)
    sections += [_errors(folder, runs), *(PageSection(title, table=table) for title, table in tables.items()), *images]
    write_page(folder / "report.html", "Silhouettes, edges, and contours that slide", sections)
    say(f"wrote {folder}/report.html, table.txt, metrics.json and the images")


def _tables(runs: dict[str, dict[str, TrackedClip]], metrics: dict[str, float | int]) -> dict[str, list[list[str]]]:
    ablated = [key.split(".")[1] for key in metrics if key.endswith(".sliding_sum.iterations_ratio")]
    return {
        "Tracking by each": tracking.tracking_table(runs),
        "The Jacobian with and without the sliding term": tracking.sliding_table(ablated, metrics),
    }


def make_clips(
    names: Sequence[str] | None, recordings: Path, motions: str | None, sample: Callable[[], Path], quick: bool
) -> dict[str, Clip]:
    """The recordings that contours are measured on; synthetic ones are rendered where they are not there yet.

    Parameters
    ----------
    names : of `CLIPS`; None: all that can be had, with ``quick`` the synthetic ones.
    recordings : folder in which rendered recordings are kept.
    motions : folder of captured motions; None: that of `default_motions`, and without it the mannequin swings its limbs.
    sample : prepares the Balancing sample and returns its folder; called only where it is used.
    quick : six small images of each.

    Returns
    -------
    By name. A real one that cannot be had is left out, unless ``names`` has it.

    Raises
    ------
    TrackerError : a recording of ``names`` that cannot be made.
    """
    motions = motions or default_motions()
    make = {
        "cones": lambda: cones_clip(recordings, quick),
        "mannequin": lambda: mannequin_clip(recordings, motions, quick),
        "balancing": lambda: balancing_clip(sample(), quick),
    }
    clips = {}
    for name in dict.fromkeys(names or (CLIPS[:2] if quick else CLIPS)):
        try:
            clips[name] = make[name]()
        except TrackerError as error:
            if names or name != "balancing":
                raise
            say(f"NOT MEASURED: balancing: {error}")
    return clips


def _part(folder: Path, metrics: dict[str, float | int]) -> PageSection:
    """Fig. 3: one part along a row."""
    say("one part, moved along a row of its image")
    row = _part_row()
    for name, (title, _) in MODELS.items():
        for key, profile in row.errors[title].items():
            metrics |= valley_metrics(f"contours.row.{name}.{key}", "px", [profile])
    save(row_figure(row), folder / "fig3_row.png")
    text = "Distances along a row (red line) of one part's image, and the rms error of a model of it, moved along that row."
    return PageSection("Silhouette, edges, and the sum of both (Fig. 3)", text, image=folder / "fig3_row.png")


def _body(folder: Path, clip: Clip, quick: bool, metrics: dict[str, float | int]) -> PageSection:
    """The same of a whole body in all cameras."""
    say("a whole body, moved along single variables")
    profiles = body_profiles(clip, 1, QUICK_COARSENESS) if quick else body_profiles(clip, BODY_SETS)
    panels = {}
    for dof, variable in VARIABLES.items():
        for key, of in profiles[dof].items():
            metrics |= valley_metrics(f"contours.row.{dof}.{key}", variable.unit, of)
        panels[f"{variable.title} [{variable.unit}]"] = {key: mean_profile(of) for key, of in profiles[dof].items()}
    save(variables_figure(panels), folder / "fig3_body.png")
    text = f"Rms error of a body of cones in {len(clip.rig)} cameras as one variable leaves the truth; mean over image sets."
    return PageSection("A whole body", text, image=folder / "fig3_body.png")


def _errors(folder: Path, runs: dict[str, dict[str, TrackedClip]]) -> PageSection:
    panels = {}
    for clip, tracked in runs.items():
        found = {method: run.evaluation for method, run in tracked.items()}
        times = next(iter(found.values())).times_s
        panels[clip] = (times, {method: each.raw.per_set_mm() for method, each in found.items()})
    save(tracking_figure(panels), folder / "fig3_tracking.png")
    return PageSection("Error over time", "Mean distance of joints from the truth.", image=folder / "fig3_tracking.png")


def part_model(thickness: float = 1.0) -> ArticulatedModel:
    """A tapered cone like a thigh, upright, its root at the lower end."""
    cone = TruncatedCone(0.08 * thickness, 0.07 * thickness, -0.55, 0.0, _LENGTH_M)
    return ArticulatedModel("part", KinematicChain(("part",), ()), (Shape("part", "part", cone, color_rgb=(190, 90, 90)),))


def _part_row() -> RowFigure:
    """The part is filmed in a furnished room; then models of it are moved along the row through its middle."""
    rig, model = make_rig(_SCENE), part_model()
    camera = rig.cameras[0]
    middle = np.array([0.0, 0.0, _MIDDLE_HEIGHT_M])
    state = State.neutral(model, se3.from_rotation_translation(np.eye(3), middle - [0.0, 0.0, 0.5 * _LENGTH_M]))
    body = Configuration(model, state)
    with Studio(rig, _SCENE) as studio:
        backgrounds = [studio.empty_image(0, i) for i in range(N_BACKGROUNDS)]
        (image,) = studio.images(ModelSubject(model).mesh(body), 0)
    (u, v), _ = camera.project(middle)
    direction = np.zeros(model.n_dof)
    direction[:3] = camera.T_world_cam[:3, 0] * se3.apply(camera.T_cam_world, middle)[2] / camera.model.K[0, 0]
    image_set = ImageSet(0, (CameraImage(camera.name, 0, image),))
    errors = _errors_along(rig, {camera.name: backgrounds}, image_set, state, direction)
    shot = shoot(camera, image, body, body, backgrounds, far_sighted(by_method(TrackerConfig(), "sum")), REACH_PX)
    assert shot is not None, "the part is in the middle of the image"
    row = round(float(v))
    distances = {key: distance_to(mask, REACH_PX)[row] for key, mask in (("silhouette", shot.silhouette), ("edges", shot.edges))}
    distances["sum"] = distances["silhouette"] + distances["edges"]
    return RowFigure(shot.silhouette, shot.edges, row, float(u), distances, errors)


def _errors_along(
    rig: CameraRig, backgrounds: dict[str, list[np.ndarray]], image_set: ImageSet, state: State, direction: np.ndarray
) -> dict[str, dict[str, Profile]]:
    """Of every model, by every kind of distance; ``direction`` is a tangent that moves the part by a pixel."""
    errors: dict[str, dict[str, Profile]] = {}
    for title, thickness in MODELS.values():
        errors[title] = {}
        for key in PUBLISHED:
            error = ContourError(rig, part_model(thickness), backgrounds, key)
            error.look(image_set, state)
            errors[title][key] = Profile(_SHIFTS_PX, error.along(state, direction, _SHIFTS_PX))
    return errors
