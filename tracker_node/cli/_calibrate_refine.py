"""``tracker_node calibrate refine``: camera places from two-dimensional joints."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

SUMMARY = "refine the places of the cameras by bundle adjustment on 2D joints that OpenPose found in their images"
EXAMPLE = "tracker_node calibrate refine --rig rig.yaml --points2d pose/ -o rig_refined.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", required=True, metavar="RIG", help="rig.yaml to start from")
    parser.add_argument(
        "--points2d",
        required=True,
        metavar="DIR|ZIP",
        help="OpenPose JSON files, one folder a camera, named as the camera (cam01, cam01_json) or with its number",
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
    parser.add_argument("--report", metavar="FILE", help="where to write the figures as JSON (default: beside the output, .json)")


def run(args: argparse.Namespace) -> int:
    from ..calibration.bundle_adjustment import AdjustmentOptions
    from ..calibration.rig_refinement import collect_joints, refine_rig
    from ..errors import CalibrationError, FileFormatError
    from ..evaluation.metrics_file import write_metrics
    from ..loaders.openpose_json import load_openpose, match_cameras
    from ..loaders.rig_yaml import build_rig, read_rig_file, write_rig_file

    if not 0.0 < args.robust_px < 1e6:
        raise FileFormatError("command line", "--robust-px", "a positive number of pixels", args.robust_px)
    rig_file = read_rig_file(args.rig)
    mapped = [name for name, entry in rig_file.cameras.items() if entry.pixel_map is not None]
    if mapped and args.pixels is None:
        raise CalibrationError(
            mapped[0], "has a pixel_map: say with --pixels whether the joints are in file or calibration pixels"
        )
    rig = build_rig(rig_file.in_calibration_pixels() if args.pixels == "calibration" else rig_file, ".")
    groups = match_cameras(load_openpose(args.points2d), rig.names)
    joints = collect_joints(rig, [list(groups[name].people) for name in rig.names])
    options = AdjustmentOptions(robust_scale_px=args.robust_px)
    refinement = refine_rig(rig, joints, options, args.min_confidence)
    refined = rig_file.with_extrinsics({camera.name: camera.T_world_cam for camera in refinement.rig})
    write_rig_file(refined, args.output, base_dir=Path(args.rig).parent)
    report = args.report or str(Path(args.output).with_suffix(".json"))
    write_metrics(report, figures(refinement))
    print_table(refinement)
    print(f"wrote {args.output} and {report}")
    if not refinement.converged:
        print(f"note: not converged after {refinement.iterations} iterations; the figures above say whether it is good enough")
    return 0


def figures(refinement) -> dict[str, float | int]:
    """Figures of a refinement as flat metrics, ``refine.<camera>.<figure>``."""
    metrics: dict[str, float | int] = {
        "refine.iterations": refinement.iterations,
        "refine.converged": int(refinement.converged),
        "refine.joint_shift_mm": 1000.0 * refinement.shift_m,
    }
    squares, total = {"before": 0.0, "after": 0.0}, 0
    for name, camera in refinement.cameras.items():
        total += camera.n_points
        for when in squares:
            rms = getattr(camera, f"rms_{when}_px")
            squares[when] += camera.n_points * rms**2
            metrics[f"refine.{name}.rms_{when}_px"] = rms
            metrics[f"refine.{name}.median_{when}_px"] = getattr(camera, f"median_{when}_px")
        metrics[f"refine.{name}.moved_mm"] = 1000.0 * camera.moved_m
        metrics[f"refine.{name}.turned_deg"] = math.degrees(camera.turned_rad)
        metrics[f"refine.{name}.lag_images"] = camera.lag_images
    for when, square in squares.items():
        metrics[f"refine.rms_{when}_px"] = math.sqrt(square / max(total, 1))
    return metrics


def print_table(refinement) -> None:
    """The figures per camera, as a table."""
    print(f"{'camera':12} {'joints':>7} {'rms px':>16} {'median px':>16} {'moved':>9} {'turned':>9} {'late':>12}")
    for name, camera in refinement.cameras.items():
        rms = f"{camera.rms_before_px:6.2f} -> {camera.rms_after_px:6.2f}"
        median = f"{camera.median_before_px:6.2f} -> {camera.median_after_px:6.2f}"
        moves = f"{1000 * camera.moved_m:6.1f} mm {math.degrees(camera.turned_rad):5.2f} deg {camera.lag_images:z5.2f} images"
        print(f"{name:12} {camera.n_points:7d} {rms} {median} {moves}")
    overall = figures(refinement)
    print(
        f"all cameras: rms {overall['refine.rms_before_px']:.2f} -> {overall['refine.rms_after_px']:.2f} px; the joints move by"
    )
    print(f"{overall['refine.joint_shift_mm']:.1f} mm (rms), the world frame stays ({refinement.iterations} iterations)")
