"""``tracker_node calibrate refine``: camera places from two-dimensional joints, or from the body that a run has tracked."""

from __future__ import annotations

import argparse
import math
from functools import partial
from pathlib import Path

from ...arguments.run_images import add_run_arguments, check, evidence_of, load_run_images, named_file, refuse_to_overwrite
from ...arguments.verbs import Subverb


def _add_refine_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", metavar="RIG", help="rig.yaml to start from (default: what the run names)")
    parser.add_argument(
        "--points2d",
        metavar="PATH",
        help="points in the images from the files of any detector (docs/formats.md), such as OpenPose's, one folder a camera",
    )
    parser.add_argument("-o", "--output", default="rig_refined.yaml", metavar="FILE", help="file to write (default: %(default)s)")
    parser.add_argument(
        "--pixels",
        choices=("file", "calibration"),
        help="the pixels that the joints are in, where the rig has a pixel_map: those of the image files, or of the calibration",
    )
    parser.add_argument(
        "--min-confidence", type=float, default=0.3, metavar="C", help="leave out joints below it (default: %(default)s)"
    )
    parser.add_argument(
        "--robust-px", type=float, default=8.0, metavar="PX", help="scale of the robust loss (default: %(default)s)"
    )
    parser.add_argument("--report", metavar="FILE", help="where to write the metrics as JSON (default: beside the output, .json)")
    add_run_arguments(parser, n_sets=30)
    parser.add_argument("--model", metavar="FILE",
                        help="with --from-run: body of the run (default: body.yaml in it, or what it names)")  # fmt: skip
    parser.add_argument("--keep-places", action="store_true", help="with --from-run: only time offsets (and focal lengths)")
    parser.add_argument("--keep-times", action="store_true", help="with --from-run: only places (and focal lengths)")
    parser.add_argument(
        "--drift", action="store_true", help="with --from-run: clocks may run at different rates, too (long runs)"
    )
    parser.add_argument("--focal", action="store_true", help="with --from-run: focal lengths as well")
    parser.add_argument("--scale", action="store_true",
                        help="with --from-run: the scale as well, where the size of the body is known better")  # fmt: skip
    parser.add_argument(
        "--center-sigma-mm", type=float, default=30.0, metavar="MM",
        help="with --from-run: how far a camera may be from where the rig has it, a standard deviation (default: %(default)s)",
    )  # fmt: skip


def _run_refine(args: argparse.Namespace) -> int:
    if args.from_run:
        return _from_run(args)
    for option, value in (("--rig", args.rig), ("--points2d", args.points2d)):
        check(value, option, "a file (with --points2d), or a run with --from-run")
    return _from_points(args)


def _from_run(args: argparse.Namespace) -> int:
    """Places and clocks from the images in which a run has tracked a body."""
    from ....calibration.tracked_body.body_fit import BodyFitOptions
    from ....calibration.tracked_body.report import rig_metrics, write_rig_report
    from ....calibration.tracked_body.rig_drift import drift_metrics, fit_clocks, stretches, with_drift
    from ....calibration.tracked_body.rig_fit import RigFitOptions, fit_rig, with_fit
    from ....loaders.rig.rig_yaml import read_rig_file, write_rig_file
    from ....report.metrics_file import write_metrics
    from ....report.progress import StageProgress
    from ....runs.load import run_info

    check(not args.points2d, "--from-run", "no --points2d beside it", args.points2d)
    check(0.0 < args.center_sigma_mm < 1e4, "--center-sigma-mm", "a positive number of millimeters", args.center_sigma_mm)
    check(not (args.scale and args.keep_places), "--scale", "no --keep-places beside it")
    check(not (args.keep_places and args.keep_times and not args.focal), "--keep-places", "something that may change")
    report = Path(args.report or Path(args.output).with_suffix(".json"))
    page = report.with_suffix(".html")
    refuse_to_overwrite(args, args.output, report, page)
    images = load_run_images(args, dressed=True)
    if args.drift:
        check(not args.keep_times, "--drift", "no --keep-times beside it")
        check(images.first_image == 0, "--drift", "a run from the first images on", f"one from image {images.first_image}")
        stretches([1e-9 * image_set.stamp_ns for image_set in images.sets])  # refuses what is too short before the work begins
    options = RigFitOptions(
        places=not args.keep_places, times=not args.keep_times, focal=args.focal, scale=args.scale,
        center_sigma_m=1e-3 * args.center_sigma_mm,
        body=BodyFitOptions(groups=(), config=images.config),
    )  # fmt: skip
    progress = None if args.quiet else StageProgress("calibrate refine")
    evidence = evidence_of(args.evidence, images)
    fit = fit_rig(images.model, images.rig, images.sets, images.states, images.velocities, options, progress, evidence=evidence)
    clocks = fit_clocks(images, fit, options, partial(evidence_of, args.evidence), progress) if args.drift else {}
    rig_path = named_file(args, run_info(args.from_run), "rig")
    rig_file = with_drift(with_fit(read_rig_file(rig_path), fit), fit, clocks, images.begins_s)
    write_rig_file(rig_file, args.output, base_dir=Path(rig_path).parent)
    write_rig_report(page, images.model, images.rig, images.sets, fit)
    write_metrics(report, rig_metrics(fit) | drift_metrics(clocks))
    _print_cameras(fit)
    if options.places:
        taken = "taken" if args.scale else "kept (--scale takes it)"
        print(f"scale: by the size of the body {fit.scale:.3f} times the rig's, {taken}")
    for name, clock in clocks.items():
        print(f"{name:12} drift {1e6 * clock.drift:8.1f} +- {1e6 * clock.drift_sigma:6.1f} ppm")
    print(f"wrote {args.output}, {page} and {report}")
    return 0


def _print_cameras(fit) -> None:
    """What has been found, as a table."""
    print(f"{'camera':12} {'lines':>7} {'rms px':>16} {'moved mm':>16} {'turned deg':>16} {'later ms':>16}")
    for name, c in fit.cameras.items():
        rms = f"{c.before.rms_px:6.2f} -> {c.after.rms_px:6.2f}"
        moves = f"{1e3 * c.moved_m:6.1f} +- {1e3 * c.moved_sigma_m:6.1f}"
        turns = f"{math.degrees(c.turned_rad):6.2f} +- {math.degrees(c.turned_sigma_rad):6.2f}"
        late = f"{1e3 * c.later_s:6.1f} +- {1e3 * c.later_sigma_s:6.1f}"
        print(f"{name:12} {c.after.count:7d} {rms:>16} {moves:>16} {turns:>16} {late:>16}")
    before, after = fit.overall
    print(f"all cameras: rms {before.rms_px:.2f} -> {after.rms_px:.2f} px in {fit.n_sets} image sets")


def _from_points(args: argparse.Namespace) -> int:
    from ....calibration.points.bundle_adjustment import AdjustmentOptions
    from ....calibration.points.rig_refinement import load_joints, refine_rig
    from ....errors import CalibrationError, FileFormatError
    from ....loaders.rig.rig_yaml import build_rig, read_rig_file, write_rig_file
    from ....report.metrics_file import write_metrics

    if not 0.0 < args.robust_px < 1e6:
        raise FileFormatError("command line", "--robust-px", "a positive number of pixels", args.robust_px)
    report = Path(args.report or Path(args.output).with_suffix(".json"))
    refuse_to_overwrite(args, args.output, report)
    rig_file = read_rig_file(args.rig)
    mapped = [name for name, entry in rig_file.cameras.items() if entry.pixel_map is not None]
    if mapped and args.pixels is None:
        raise CalibrationError(
            mapped[0], "has a pixel_map: say with --pixels whether the joints are in file or calibration pixels"
        )
    rig = build_rig(rig_file.in_calibration_pixels() if args.pixels == "calibration" else rig_file, ".")
    options = AdjustmentOptions(robust_scale_px=args.robust_px)
    refinement = refine_rig(rig, load_joints(args.points2d, rig), options, args.min_confidence)
    refined = rig_file.with_extrinsics({camera.name: camera.T_world_cam for camera in refinement.rig})
    write_rig_file(refined, args.output, base_dir=Path(args.rig).parent)
    write_metrics(report, refinement.metrics())
    print(refinement.table())
    print(f"wrote {args.output} and {report}")
    if not refinement.converged:
        print(f"note: not converged after {refinement.iterations} iterations; the metrics above say whether it is good enough")
    return 0


SUBVERBS = (
    Subverb(
        "refine",
        "refine the places of the cameras from 2D joints in their images, or places and clocks from the images of a run",
        "tracker_node calibrate refine --rig rig.yaml --points2d pose/ -o rig_refined.yaml\n"
        "  tracker_node calibrate refine --from-run out/run1 -o rig_refined.yaml",
        _add_refine_arguments,
        _run_refine,
    ),
)
