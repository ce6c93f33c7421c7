"""``tracker_node calibrate dlt``: lenses and places of cameras from control points."""

from __future__ import annotations

import argparse
from dataclasses import replace

from ..arguments.cameras import add_sources_argument, size_option, sources_of_cameras
from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "make a rig from control points of known place, clicked on in one image of every camera (DLT)"
EXAMPLE = "tracker_node calibrate dlt --points control_points.csv --size 768x576 --sources 'videos/{name}.avi' -o rig.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--points", required=True, metavar="CSV", help="columns camera,point,x,y,z,u,v: meters and pixels")
    parser.add_argument("--size", required=True, metavar="WxH", help="size of the images, such as 768x576")
    parser.add_argument(
        "--constraint",
        choices=("none", "no_skew", "square", "centered"),
        default="square",
        help="none: all eleven parameters; square: square pixels without skew; centered: also the principal point in the middle"
        " of the image, for few or poor points (default: %(default)s)",
    )
    add_sources_argument(parser)
    parser.add_argument("-o", "--output", default="rig.yaml", metavar="FILE", help="file to write (default: %(default)s)")
    parser.add_argument("--force", action="store_true", help="overwrite the output")


def run(args: argparse.Namespace) -> int:
    from ...calibration.points.dlt import check_control_points
    from ...camera.rig import CameraRig
    from ...loaders.rig.control_points import load_control_points
    from ...loaders.rig.rig_yaml import rig_file_of, write_rig_file

    refuse_to_overwrite(args, args.output)
    size, seen = size_option("--size", args.size), load_control_points(args.points)
    sources = sources_of_cameras(args.sources, list(seen), print)
    for name, points in seen.items():
        check_control_points(name, points, size)
    cameras = [replace(camera, source=sources[camera.name]) for camera in _fitted(seen, size, args.constraint)]
    write_rig_file(rig_file_of(CameraRig(tuple(cameras))), args.output, base_dir=".")
    print(f"wrote {args.output}")
    return 0


def _fitted(seen, size: tuple[int, int], constraint: str) -> list:
    """Cameras that fit best within the constraint; printed: how well, the worst point of each, and how well they agree."""
    import numpy as np

    from ...calibration.points.dlt import calibrate, object_errors_m

    cameras = []
    print(f"{'camera':<12} {'points':>6} {'rms px':>8} {'worst px':>9}  worst point")
    for name, points in seen.items():
        found = calibrate(name, points.points, points.pixels, size, constraint)
        distances = np.linalg.norm(found.residuals_px, axis=1)
        worst = int(distances.argmax())
        print(f"{name:<12} {len(points.names):>6} {found.rms_px:>8.2f} {distances[worst]:>9.2f}  {points.names[worst]}")
        cameras.append(found.camera)
    errors = object_errors_m(cameras, seen)
    if len(errors):
        print(f"several cameras reconstruct the points {1e3 * np.sqrt(np.mean(errors**2)):.2f} mm from their places (rms)")
    return cameras
