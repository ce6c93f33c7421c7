"""Page of a fit to images: metrics before and after, and the outline before and after over some of the images."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import cv2
import numpy as np

from ...camera.rig import CameraRig
from ...model.articulated import ArticulatedModel
from ...model.configuration import Configuration, State
from ...model.kinematic_chain import N_ROOT_DOF
from ...model.shape_parameters import half_extents
from ...observation.image_set import ImageSet
from ...render.overlay import draw_overlay
from ...render.raycast.extent import body_extent
from ...report.html import PageSection, write_page
from .body_fit import BodyFit, BodyFitReport, LineMetrics
from .rig_fit import RigFit
from .robot_fit import RobotFit

_MARGIN_PX = 20  # around a body
_IMAGE_HEIGHT = 420  # pixels


def before_and_after(
    image_sets: Sequence[ImageSet],
    before: tuple[ArticulatedModel, CameraRig, Sequence[State]],
    after: tuple[ArticulatedModel, CameraRig, Sequence[State]],
    time_steps: int = 2,
) -> list[PageSection]:
    """Both bodies over the images of some sets, before to the left, cut out around them.

    Parameters
    ----------
    image_sets : images that were fitted.
    before, after : body, rig, and states of all sets.
    time_steps : image sets that are shown.

    Returns
    -------
    One section a camera and set.
    """
    images = []
    for k in np.unique(np.linspace(0, len(image_sets) - 1, min(time_steps, len(image_sets)) + 2).round().astype(int)[1:-1]):
        for i, camera in enumerate(after[1]):
            image = image_sets[k].get(camera.name)
            if image is None:
                continue
            sides, bounds = [], []
            for model, rig, states in (before, after):
                configuration = Configuration(model, states[k])
                sides.append(draw_overlay(image.bgr, configuration, rig.cameras[i], alpha=0.15, skeleton=True))
                bounds.append(body_extent(configuration, camera, (0, 0, camera.model.width, camera.model.height)))
            pair = np.hstack([_cut(side, bounds) for side in sides])
            caption = f"{camera.name}, image set {k + 1} of {len(image_sets)}: before and after"
            images.append(PageSection(text=caption, image=pair))
    return images


def _cut(image: np.ndarray, bounds: Sequence[tuple[int, int, int, int] | None]) -> np.ndarray:
    """The part of an image where bodies are, in the height of a page's images."""
    known = np.array([b for b in bounds if b is not None])
    if len(known):
        u0, v0 = np.maximum(known[:, :2].min(axis=0) - _MARGIN_PX, 0)
        u1, v1 = known[:, 2:].max(axis=0) + _MARGIN_PX
        image = image[v0:v1, u0:u1]
    scale = _IMAGE_HEIGHT / image.shape[0]
    return cv2.resize(image, (max(1, round(scale * image.shape[1])), _IMAGE_HEIGHT), interpolation=cv2.INTER_AREA)


def line_table(caption: str, name: str, metrics: Mapping[str, tuple[LineMetrics, LineMetrics]]) -> PageSection:
    """Table of distances of contour lines.

    Parameters
    ----------
    caption : of the table.
    name : heading of its first column.
    metrics : row -> before and after.

    Returns
    -------
    The table.
    """
    rows = [
        (key, str(b.count), f"{a.rms_px:.2f}", f"{b.rms_px:.2f}", f"{a.median_px:.2f}", f"{b.median_px:.2f}")
        for key, (a, b) in metrics.items()
    ]
    header = (name, "lines", "rms before, px", "after", "median before, px", "after")
    return PageSection(caption, table=(header, *rows))


def parameter_table(report: BodyFitReport) -> PageSection:
    """Shape parameters in percent, most of them logarithms of scales."""
    rows = []
    for p in report.parameters:
        relative = f"{p.value / p.prior_sigma:+.1f}" if p.prior_sigma else "held"
        rows.append((p.name, f"{100 * p.value:+.1f}", f"{100 * p.sigma:.1f}", f"{100 * p.prior_sigma:.0f}", relative))
    header = ("parameter", "value, %", "sigma, %", "prior sigma, %", "value in prior sigmas")
    return PageSection("Shape parameters", table=(header, *rows))


def measure_table(before: ArticulatedModel, fit: BodyFit) -> PageSection:
    """Table of the sizes of all parts and the distances of joints, millimeters.

    Parameters
    ----------
    before : the body as given.
    fit : the fitted one.

    Returns
    -------
    The table.
    """
    rows = []
    for shape, fitted in zip(before.shapes, fit.model.shapes, strict=True):
        sizes = [2e3 * half_extents(s.primitive) for s in (shape, fitted)]
        rows.append((shape.name, *(" x ".join(f"{x:.0f}" for x in size) for size in sizes)))
    for joint, fitted_joint in zip(before.chain.joints, fit.model.chain.joints, strict=True):
        lengths = [1e3 * float(np.linalg.norm(j.T_parent_joint[:3, 3])) for j in (joint, fitted_joint)]
        rows.append((f"{joint.parent} to joint {joint.name}", *(f"{length:.0f}" for length in lengths)))
    return PageSection("Sizes of shapes and distances of joints, mm", table=(("part", "before", "after"), *rows))


def camera_table(fit: RigFit) -> PageSection:
    """What has been found about each camera."""
    rows = []
    for name, c in fit.cameras.items():
        rows.append(
            (
                name,
                f"{1e3 * c.moved_m:.1f} ± {1e3 * c.moved_sigma_m:.1f}",
                f"{np.degrees(c.turned_rad):.3f} ± {np.degrees(c.turned_sigma_rad):.3f}",
                f"{1e3 * c.later_s:+.1f} ± {1e3 * c.later_sigma_s:.1f}",
                f"{100 * (c.focal_scale - 1):+.2f} ± {100 * c.focal_sigma:.2f}",
            )
        )
    header = ("camera", "moved, mm", "turned, deg", "later, ms", "focal length, %")
    return PageSection("Cameras", table=(header, *rows))


def write_body_report(
    path: str | Path, before: ArticulatedModel, rig: CameraRig, image_sets: Sequence[ImageSet], fit: BodyFit
) -> None:
    """Write the HTML page of a fitted body.

    Parameters
    ----------
    path : of the page.
    before : the body as given.
    rig, image_sets : what it was fitted to.
    fit : the result.
    """
    report = fit.report
    first, last = report.overall
    note = PageSection(
        text=f"{report.n_sets} image sets, {last.count} contour lines: rms {first.rms_px:.2f} px with the body as given and its"
        f" poses fitted, {last.rms_px:.2f} px with the fitted body. Sigmas hold if the errors of the lines are independent beyond"
        " a few neighbors; what the shapes cannot represent is the same in every image, so take them as lower bounds."
    )
    tables = [
        line_table("Cameras", "camera", report.cameras), line_table("Parts", "part", report.parts), parameter_table(report),
        measure_table(before, fit),
    ]  # fmt: skip
    images = before_and_after(image_sets, (before, rig, report.states_before), (fit.model, rig, fit.states))
    write_page(path, f"Body of {before.name} from images", [note, *tables, *images])


def write_rig_report(
    path: str | Path, given: ArticulatedModel, rig: CameraRig, image_sets: Sequence[ImageSet], fit: RigFit
) -> None:
    """Write the HTML page of a fitted rig.

    Parameters
    ----------
    path : of the page.
    given, rig : body and rig as given.
    image_sets : what the rig was fitted to.
    fit : the result.
    """
    first, last = fit.overall
    note = PageSection(
        text=f"{fit.n_sets} image sets, {last.count} contour lines: rms {first.rms_px:.2f} px with the rig as given (poses"
        f" fitted), {last.rms_px:.2f} px with the fitted rig. The world and the common time are those in which most cameras stay"
        " what they were. 'Later' is by how much a camera's images are later than their stamps say; it is in time_offset_s of the"
        " rig, and a delay of less than three sigmas is taken for none."
    )
    cameras = {name: (c.before, c.after) for name, c in fit.cameras.items()}
    images = before_and_after(image_sets, (given, rig, fit.states_before), (fit.model, fit.rig, fit.states))
    tables = [camera_table(fit), line_table("Contour lines", "camera", cameras)]
    write_page(path, "Rig from the images of a body", [note, *tables, *images])


def write_robot_report(
    path: str | Path, model: ArticulatedModel, rig: CameraRig, images: Sequence[ImageSet], fit: RobotFit
) -> None:
    """Write the HTML page of a robot's place.

    Parameters
    ----------
    path : of the page.
    model, rig, images : the robot, the cameras, and what it was fitted to.
    fit : the result.
    """
    first, last = fit.overall
    note = PageSection(
        text=f"{len(images)} image sets, {last.count} contour lines: median {first.median_px:.2f} px where the base was said to"
        f" be, {last.median_px:.2f} px where it is. Sigmas are by how much image sets, or cameras, contradict each other. The"
        " turn of a base about its first joint, and that joint's zero, are hardly told apart."
    )
    sections = before_and_after(images, (model, rig, fit.states_before), (model, rig, fit.states))
    tables = [robot_table(model, fit), line_table("Contour lines", "camera", fit.cameras)]
    write_page(path, f"Place of {model.name} before the cameras", [note, *tables, *sections])


def robot_table(model: ArticulatedModel, fit: RobotFit) -> PageSection:
    """Place and offsets with their standard deviations.

    Parameters
    ----------
    model, fit : the robot, and what was found.

    Returns
    -------
    A table.
    """
    sigmas = fit.sigmas
    rows = [
        (f"base {axis}", f"{1e3 * fit.T_world_base[i, 3]:.1f} ± {1e3 * sigmas[i]:.1f} mm") for i, axis in enumerate("xyz")
    ]
    rows += [(f"base turned about {axis}", f"± {np.degrees(sigmas[3 + i]):.2f} deg") for i, axis in enumerate("xyz")]
    rows += [(f"zero of {name}", f"{value:+.2f} ± {sigma:.2f} {unit}") for name, value, sigma, unit in _zeros(model, fit)]
    return PageSection("Place", table=(("what", "found"), *rows))


def robot_metrics(model: ArticulatedModel, fit: RobotFit) -> dict[str, float | int]:
    """Flat metrics, ``robot.<what>``.

    Parameters
    ----------
    model, fit : the robot, and what was found.

    Returns
    -------
    Metrics in mm and degrees.
    """
    sigmas, found = fit.sigmas, fit.overall
    metrics: dict[str, float | int] = {
        "robot.sets": len(fit.states), "robot.lines": found[1].count, "robot.median_before_px": found[0].median_px,
        "robot.median_after_px": found[1].median_px, "robot.place_sigma_mm": 1e3 * float(np.linalg.norm(sigmas[:3])),
        "robot.turn_sigma_deg": float(np.degrees(np.linalg.norm(sigmas[3:6]))),
    }  # fmt: skip
    for name, value, sigma, unit in _zeros(model, fit):
        metrics[f"robot.{name}.offset_{unit}"], metrics[f"robot.{name}.offset_sigma_{unit}"] = value, sigma
    return metrics


def _zeros(model: ArticulatedModel, fit: RobotFit) -> Iterator[tuple[str, float, float, str]]:
    """Name, offset and standard deviation of each joint, and their unit."""
    for axis, offset, sigma in zip(model.chain.axes, fit.offsets, fit.sigmas[N_ROOT_DOF:], strict=True):
        unit, factor = ("mm", 1e3) if axis.prismatic else ("deg", 180.0 / np.pi)
        yield axis.name, factor * float(offset), factor * float(sigma), unit


def body_metrics(fit: BodyFit) -> dict[str, float | int]:
    """Flat metrics, ``body.<camera or parameter>.<metric>``."""
    report = fit.report
    metrics: dict[str, float | int] = {
        "body.sets": report.n_sets, "body.iterations": report.iterations, "body.lines": report.overall[1].count,
        "body.rms_before_px": report.overall[0].rms_px, "body.rms_after_px": report.overall[1].rms_px,
    }  # fmt: skip
    for kind in (report.cameras, report.parts):
        for name, (before, after) in kind.items():
            metrics[f"body.{name}.rms_before_px"], metrics[f"body.{name}.rms_after_px"] = before.rms_px, after.rms_px
    for parameter in report.parameters:
        key = f"body.{parameter.name.replace(' ', '_')}"
        metrics[key], metrics[f"{key}_sigma"] = parameter.value, parameter.sigma
    return metrics


def rig_metrics(fit: RigFit) -> dict[str, float | int]:
    """Flat metrics, ``refine.<camera>.<metric>``."""
    metrics: dict[str, float | int] = {
        "refine.sets": fit.n_sets, "refine.iterations": fit.iterations,
        "refine.rms_before_px": fit.overall[0].rms_px, "refine.rms_after_px": fit.overall[1].rms_px,
        "refine.scale": fit.scale,
    }  # fmt: skip
    for name, c in fit.cameras.items():
        metrics |= {
            f"refine.{name}.rms_before_px": c.before.rms_px, f"refine.{name}.rms_after_px": c.after.rms_px,
            f"refine.{name}.moved_mm": 1e3 * c.moved_m, f"refine.{name}.turned_deg": float(np.degrees(c.turned_rad)),
            f"refine.{name}.later_ms": 1e3 * c.later_s, f"refine.{name}.later_sigma_ms": 1e3 * c.later_sigma_s,
            f"refine.{name}.moved_sigma_mm": 1e3 * c.moved_sigma_m,
            f"refine.{name}.turned_sigma_deg": float(np.degrees(c.turned_sigma_rad)),
            f"refine.{name}.focal_scale": c.focal_scale,
        }  # fmt: skip
    return metrics
