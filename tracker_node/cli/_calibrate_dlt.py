"""``tracker_node calibrate dlt``: lenses and places of cameras from control points."""

from __future__ import annotations

import argparse

SUMMARY = "make a rig from control points of known place, clicked on in one image of every camera (DLT)"
EXAMPLE = "tracker_node calibrate dlt --points control_points.csv --size 768x576 --sources 'videos/{name}.avi' -o rig.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--points", required=True, metavar="CSV", help="columns camera,point,x,y,z,u,v: metres and pixels")
    parser.add_argument("--size", required=True, metavar="WxH", help="size of the images, such as 768x576")
    parser.add_argument(
        "--constraint",
        choices=("none", "no_skew", "square", "centered"),
        default="square",
        help="none: all eleven parameters; square: square pixels without skew; centered: also the principal point in the middle"
        " of the image, for few or poor points (default: %(default)s)",
    )
    parser.add_argument("--sources", metavar="PATTERN", help="videos or image folders, {name} becomes the camera's name")
    parser.add_argument("-o", "--output", default="rig.yaml", metavar="FILE", help="file to write (default: %(default)s)")


def run(args: argparse.Namespace) -> int:
    from dataclasses import replace

    import numpy as np

    from ..calibration.dlt import calibrate
    from ..camera.camera_rig import CameraRig
    from ..loaders.control_points import load_control_points
    from ..loaders.rig_yaml import rig_file_of, write_rig_file

    size, cameras = _size(args.size), []
    print(f"{'camera':<12} {'points':>6} {'rms px':>8} {'worst px':>9}  worst point")
    for name, seen in load_control_points(args.points).items():
        found = calibrate(name, seen.points, seen.pixels, size, args.constraint)
        distances = np.linalg.norm(found.residuals_px, axis=1)
        worst = int(distances.argmax())
        print(f"{name:<12} {len(seen.names):>6} {found.rms_px:>8.2f} {distances[worst]:>9.2f}  {seen.names[worst]}")
        cameras.append(replace(found.camera, source=args.sources.format(name=name) if args.sources else None))
    write_rig_file(rig_file_of(CameraRig(tuple(cameras))), args.output)
    print(f"wrote {args.output}")
    return 0


def _size(text: str) -> tuple[int, int]:
    from ..errors import FileFormatError

    width, _, height = text.partition("x")
    if not (width.isdigit() and height.isdigit() and int(width) > 0 and int(height) > 0):
        raise FileFormatError("command line", "--size", "width x height in pixels, such as 768x576", text)
    return int(width), int(height)
