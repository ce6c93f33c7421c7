"""``tracker_node reproduce contours``: silhouettes, edges and their sum, and the sliding term (Knossow et al., Figs 3 to 6)."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from ...report.progress import say

SUMMARY = "the contour paper's error by silhouettes, edges and their sum, tracking by each, and the Jacobian without sliding"
EXAMPLE = "tracker_node reproduce contours --output out/reproduce/contours"

CLIPS = ("cones", "mannequin", "balancing")
BODY_SETS = 4  # image sets in which a whole body leaves the truth
DISPLACED_STARTS = 20
QUICK_COARSENESS = 5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("-o", "--output", default="out/reproduce/contours", metavar="DIR", help="folder of the results (default: %(default)s)")
    add(
        "--clips", nargs="+", choices=CLIPS, metavar="NAME",
        help=f"only these of {', '.join(CLIPS)} (default: all that are to be had; quick: the first two)",
    )  # fmt: skip
    add("--recordings", default="out/synthetic", metavar="DIR", help="where rendered clips are kept (default: %(default)s)")
    add(
        "--motions", metavar="DIR",
        help="captured clips, humanoid3d_<name>.txt, for the mannequin's kick (default: bullet_motions in the folder that"
        " TRACKER_SHARED_DATA names; without them it swings its limbs)",
    )  # fmt: skip
    add(
        "--sample", default="out/demo/sample", metavar="DIR",
        help="the Balancing clip as `tracker_node sample` prepares it, made if it is not there (default: %(default)s)",
    )  # fmt: skip
    add("--quick", action="store_true", help="six small images of each clip: shows that it runs, the figures mean little")


def run(args: argparse.Namespace) -> int:
    from ...experiments.contour import tracking
    from ...experiments.contour.errors import METHODS
    from ...experiments.contour.shots import PICTURED, evidence_pictures, sequence_pictures
    from ...experiments.rigid_tracking import text_table
    from ...report.metrics_file import format_metrics, write_metrics
    from ...report.page import Section, write_page

    folder = Path(args.output)
    folder.mkdir(parents=True, exist_ok=True)
    clips = _clips(args)
    metrics: dict[str, float | int] = {}
    sections = [_part(folder, metrics)]
    if "cones" in clips:
        sections.append(_body(folder, clips["cones"], args.quick, metrics))
    runs, pictures = {}, []
    for name, clip in clips.items():
        say(f"{clip.name}: tracking")
        runs[clip.name] = tracking.track_by(clip, METHODS[:-1] if args.quick else METHODS)
        metrics |= tracking.tracking_figures(clip.name, runs[clip.name]) | tracking.sliding_figures(clip)
        if name == "cones":
            metrics |= tracking.displaced_figures(clip, 2 if args.quick else DISPLACED_STARTS)
        if name == "mannequin" or len(clips) == 1:
            pictures += evidence_pictures(folder, clip, runs[clip.name][PICTURED])
        pictures += sequence_pictures(folder, clip, runs[clip.name][PICTURED])
    tables = _tables(runs, metrics)
    text = "\n".join(f"{title}\n{text_table(table)}\n" for title, table in tables.items()) + "\n" + format_metrics(metrics)
    print(text)
    (folder / "table.txt").write_text(text + "\n")
    write_metrics(folder / "metrics.json", metrics)
    sections += [_errors(folder, runs), *(Section(title, table=table) for title, table in tables.items()), *pictures]
    write_page(folder / "report.html", "Silhouettes, edges, and contours that slide", sections)
    say(f"wrote {folder}/report.html, table.txt, metrics.json and the pictures")
    return 0


def _tables(runs: dict[str, dict[str, Any]], metrics: dict[str, float | int]) -> dict[str, list[list[str]]]:
    from ...experiments.contour import tracking

    ablated = [key.split(".")[1] for key in metrics if key.endswith(".sliding_sum.iterations_ratio")]
    return {
        "Tracking by each": tracking.tracking_table(runs),
        "The Jacobian with and without the sliding term": tracking.sliding_table(ablated, metrics),
    }


def _clips(args: argparse.Namespace) -> dict[str, Any]:
    """The recordings by the names of `CLIPS`; a real one that cannot be had is left out, unless it was asked for."""
    from ...errors import TrackerError
    from ..synthesize import default_motions
    from ._contour_clips import balancing_clip, cones_clip, mannequin_clip

    cache, motions = Path(args.recordings), args.motions or default_motions()
    make = {
        "cones": lambda: cones_clip(cache, args.quick),
        "mannequin": lambda: mannequin_clip(cache, motions, args.quick),
        "balancing": lambda: balancing_clip(Path(args.sample), args.quick),
    }
    clips = {}
    for name in dict.fromkeys(args.clips or (CLIPS[:2] if args.quick else CLIPS)):
        try:
            clips[name] = make[name]()
        except TrackerError as error:
            if args.clips or name != "balancing":
                raise
            say(f"NOT MEASURED: balancing: {error}")
    return clips


def _part(folder: Path, metrics: dict[str, float | int]) -> Any:
    """Fig. 3: one part along a row."""
    from ...experiments.contour.part import MODELS, part_row
    from ...experiments.contour.plots import row_figure
    from ...experiments.contour.tracking import valley_figures
    from ...experiments.plots import save
    from ...report.page import Section

    say("one part, moved along a row of its image")
    picture = part_row()
    for name, (title, _) in MODELS.items():
        for key, profile in picture.errors[title].items():
            metrics |= valley_figures(f"contours.row.{name}.{key}", "px", [profile])
    save(row_figure(picture), folder / "fig3_row.png")
    text = "Distances along a row (red line) of one part's image, and the rms error of a model of it, moved along that row."
    return Section("Silhouette, edges, and the sum of both (Fig. 3)", text, picture=folder / "fig3_row.png")


def _body(folder: Path, clip: Any, quick: bool, metrics: dict[str, float | int]) -> Any:
    """The same of a whole body in all cameras."""
    from ...experiments.contour.plots import variables_figure
    from ...experiments.contour.tracking import VARIABLES, body_profiles, mean_profile, valley_figures
    from ...experiments.plots import save
    from ...report.page import Section

    say("a whole body, moved along single variables")
    profiles = body_profiles(clip, 1, QUICK_COARSENESS) if quick else body_profiles(clip, BODY_SETS)
    panels = {}
    for dof, variable in VARIABLES.items():
        for key, of in profiles[dof].items():
            metrics |= valley_figures(f"contours.row.{dof}.{key}", variable.unit, of)
        panels[f"{variable.title} [{variable.unit}]"] = {key: mean_profile(of) for key, of in profiles[dof].items()}
    save(variables_figure(panels), folder / "fig3_body.png")
    text = f"Rms error of a body of cones in {len(clip.rig)} cameras as one variable leaves the truth; mean over image sets."
    return Section("A whole body", text, picture=folder / "fig3_body.png")


def _errors(folder: Path, runs: dict[str, dict[str, Any]]) -> Any:
    from ...experiments.contour.plots import tracking_figure
    from ...experiments.plots import save
    from ...report.page import Section

    panels = {}
    for clip, by_method in runs.items():
        found = {method: run.evaluation for method, run in by_method.items()}
        times = next(iter(found.values())).times_s
        panels[clip] = (times, {method: each.raw.per_set_mm() for method, each in found.items()})
    save(tracking_figure(panels), folder / "fig3_tracking.png")
    return Section("Error over time", "Mean distance of joints from the truth.", picture=folder / "fig3_tracking.png")
