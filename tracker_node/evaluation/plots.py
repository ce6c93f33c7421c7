"""The plots of the report, each as an SVG in text."""

from __future__ import annotations

import io
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure

from ..tracking.estimate import Status
from .evaluate import Evaluation
from .metrics import LOST_JOINT_M

# A palette that stays distinct for color-blind readers (Okabe and Ito).
BLUE, ORANGE, GREEN, RED, PURPLE, GREY = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#777777"
CYCLE = (BLUE, ORANGE, GREEN, RED, PURPLE, "#56b4e9", "#999933", GREY)
STATUS_COLORS = {
    Status.INITIALISING: "#56b4e9",
    Status.TRACKING: GREEN,
    Status.DEGRADED: ORANGE,
    Status.LOST: RED,
}


def landmark_errors(e: Evaluation) -> str:
    """Mean error of every landmark, as it is and with its constant offset taken out."""
    figure, ax = _axes(9.5, 3.6)
    at = np.arange(len(e.joints))
    series = (
        ("as tracked", e.raw, BLUE),
        ("without offset, in the segment", e.offset_free, GREEN),
        ("without offset, in the world", e.offset_free_world, ORANGE),
    )
    for i, (label, errors, color) in enumerate(series):
        ax.bar(at + (i - 1) * 0.27, np.nan_to_num(errors.per_joint_mm()), 0.25, label=label, color=color)
    ax.set_xticks(at, [joint.replace("_", "\n") for joint in e.joints])
    ax.set_ylabel("mean error [mm]")
    _legend(ax, columns=3)
    return _svg(figure)


def errors_over_time(e: Evaluation) -> str:
    """Mean and worst joint of every set, and the sets counted as lost."""
    figure, ax = _axes(9.5, 3.2)
    errors = np.where(e.raw.valid, 1e3 * e.raw.errors_m, np.nan)
    judged = e.raw.valid.any(axis=1)
    worst = np.full(len(e.times_s), np.nan)
    worst[judged] = np.nanmax(errors[judged], axis=1)
    ax.plot(e.times_s, worst, color=RED, lw=1, label="worst joint")
    ax.plot(e.times_s, e.raw.per_set_mm(), color=BLUE, lw=1.8, label="mean of the joints")
    ax.plot(e.times_s, e.offset_free.per_set_mm(), color=GREEN, lw=1.2, label="mean without offsets (segment)")
    ax.axhline(1e3 * LOST_JOINT_M, color=GREY, lw=0.8, ls="--", label="a joint beyond this loses the set")
    for time in e.times_s[e.lost]:
        ax.axvspan(time - e.period_s / 2, time + e.period_s / 2, color=RED, alpha=0.15, lw=0)
    ax.set_ylim(bottom=0)
    ax.set_ylabel("error [mm]")
    _time_axis(ax)
    _legend(ax, columns=4)
    return _svg(figure)


def joints_over_time(e: Evaluation) -> str:
    """Error of every joint in every set, as a colored table."""
    figure, ax = _axes(9.5, 0.26 * len(e.joints) + 1.0)
    errors = np.where(e.raw.valid, 1e3 * e.raw.errors_m, np.nan)
    top = max(50.0, float(np.nanpercentile(errors, 99)))
    edges = np.append(e.times_s - e.period_s / 2, e.times_s[-1] + e.period_s / 2)
    mesh = ax.pcolormesh(
        edges, np.arange(len(e.joints) + 1), errors.T, cmap="viridis", vmin=0, vmax=top, rasterized=True
    )
    ax.set_yticks(np.arange(len(e.joints)) + 0.5, [joint.replace("_", " ") for joint in e.joints])
    ax.invert_yaxis()
    ax.grid(False)
    figure.colorbar(mesh, ax=ax, label="error [mm]", pad=0.01)
    _time_axis(ax)
    return _svg(figure)


def bone_lengths(e: Evaluation) -> str:
    """Mean length of every bone and its spread over the run, tracked and true."""
    figure, ax = _axes(9.5, 3.2)
    bones = e.bones
    at = np.arange(len(bones.bones))
    for shift, label, mean, std, color in (
        (-0.2, "tracked", bones.estimate_mean_mm, bones.estimate_std_mm, BLUE),
        (0.2, "truth", bones.truth_mean_mm, bones.truth_std_mm, ORANGE),
    ):
        ax.bar(at + shift, np.nan_to_num(mean), 0.38, yerr=np.nan_to_num(std), label=label, color=color, capsize=3)
    ax.set_xticks(at, [f"{a}\nto {b}".replace("_", " ").replace("left ", "l. ").replace("right ", "r. ") for a, b in bones.bones])
    ax.tick_params(axis="x", labelsize=7)
    ax.set_ylabel("length, bar: one std [mm]")
    _legend(ax, columns=2)
    return _svg(figure)


def silhouettes(e: Evaluation) -> str:
    """Intersection over union over the images, per camera."""
    figure, ax = _axes(9.5, 2.9)
    for i, (camera, ious) in enumerate(e.silhouettes.ious.items()):
        numbers, few = e.silhouettes.numbers[camera], len(ious) < 20
        ax.plot(numbers, ious, "o" if few else "-", ms=5, lw=1.5, color=CYCLE[i % len(CYCLE)], label=camera)
    ax.set_ylim(0, 1)
    ax.set_ylabel("intersection over union")
    ax.set_xlabel("image")
    _legend(ax, columns=6)
    return _svg(figure)


def residuals(e: Evaluation) -> str:
    """Rms contour distance per camera and over all."""
    figure, ax = _axes(9.5, 2.9)
    for i, camera in enumerate(e.cameras):
        values = np.where(e.camera_residuals_px[:, i] > 0, e.camera_residuals_px[:, i], np.nan)
        ax.plot(e.times_s, values, lw=1.1, color=CYCLE[i % len(CYCLE)], label=camera)
    ax.plot(e.times_s, e.residual_px, lw=1.8, color="black", label="all cameras")
    ax.set_ylim(bottom=0)
    ax.set_ylabel("rms distance [px]")
    _time_axis(ax)
    _legend(ax, columns=7)
    return _svg(figure)


def iterations(e: Evaluation) -> str:
    """Steps of the optimizer per set."""
    figure, ax = _axes(9.5, 1.9)
    ax.bar(e.times_s, e.iterations, width=0.9 * e.period_s, color=BLUE)
    ax.set_ylabel("iterations")
    _time_axis(ax)
    return _svg(figure)


def status_timeline(e: Evaluation) -> str:
    """What the tracker said of itself, above what the truth says."""
    figure, ax = _axes(9.5, 1.5)
    half = e.period_s / 2
    for status, color in STATUS_COLORS.items():
        times = e.times_s[e.status == status]
        ax.broken_barh([(t - half, e.period_s) for t in times], (1, 0.8), color=color, label=status.name.lower())
    judged = e.raw.valid.any(axis=1)
    for flags, color in ((~judged, "#dddddd"), (judged & ~e.lost, GREEN), (e.lost, RED)):
        ax.broken_barh([(t - half, e.period_s) for t in e.times_s[flags]], (0, 0.8), color=color)
    ax.set_yticks([0.4, 1.4], ["from truth", "tracker's own"])
    ax.grid(False)
    _time_axis(ax)
    _legend(ax, columns=4)
    return _svg(figure)


def _axes(width: float, height: float) -> tuple[Figure, Axes]:
    figure = Figure(figsize=(width, height), layout="constrained")
    ax = figure.add_subplot()
    ax.grid(axis="y", color="#e3e3e3", lw=0.7)
    ax.set_axisbelow(True)
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=8)
    return figure, ax


def _legend(ax: Axes, columns: int) -> None:
    if ax.get_legend_handles_labels()[0]:
        ax.legend(loc="lower left", bbox_to_anchor=(0, 1.0), ncols=columns, frameon=False, fontsize=8, borderaxespad=0.2)


def _time_axis(ax: Axes) -> None:
    ax.margins(x=0.01)
    ax.set_xlabel("time since the first image set [s]")


def _svg(figure: Figure) -> str:
    stream = io.StringIO()
    FigureCanvasSVG(figure).print_svg(stream, metadata={"Date": None})
    return stream.getvalue()


def all_plots(e: Evaluation) -> Sequence[tuple[str, str, str]]:
    """(heading, explanation, SVG) in the order of the report; those without data are left out."""
    plots = [
        (
            "Status",
            "What the tracker said of itself, and what the truth says: green judged and near, red lost, grey without truth.",
            status_timeline(e),
        ),
        (
            "Joint error per landmark",
            "Mean distance to truth. A constant offset is a matter of where a landmark sits on the body, not of tracking.",
            landmark_errors(e),
        ),
        ("Joint error over time", "Red bands are lost sets.", errors_over_time(e)),
        ("Every joint over time", "Blank where there is no truth.", joints_over_time(e)),
    ]
    if e.bones.bones:
        text = "A rigid body keeps its lengths; what varies in the truth is the truth's own noise."
        plots.append(("Bone lengths", text, bone_lengths(e)))
    if e.silhouettes.ious:
        kinds = ", ".join(f"{camera}: {kind}" for camera, kind in e.silhouettes.kind.items())
        plots.append(("Silhouettes", f"Agreement of the model's mask with reference masks ({kinds}).", silhouettes(e)))
    plots.append(("Residuals", "Distance of the predicted contours from those seen, after the fit.", residuals(e)))
    plots.append(("Iterations", "Steps of the optimizer per image set.", iterations(e)))
    return plots
