"""``tracker_node calibrate dlt``: lenses and places of cameras from control points."""

from __future__ import annotations

import argparse
from dataclasses import replace

from ...loaders.source_address import sources_by_name
from ..arguments.cameras import add_sources_argument, size_option
from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "make a rig from control points of known place, clicked on in one image of every camera (DLT)"
EXAMPLE = (
    "tracker_node calibrate dlt --points control_points.csv --size 768x576 --sources 'videos/{name}.avi' -o rig.yaml\n"
    "  tracker_node calibrate dlt --points control_points.csv --size 768x576 --stages -o restricted.yaml"
)


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
    parser.add_argument(
        "--stages", action="store_true",
        help="from eleven parameters to the seven of a centered camera by simulated annealing, with the errors of every stage",
    )  # fmt: skip
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of the annealing (default: %(default)s)")
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
    sources = sources_by_name(args.sources, seen)
    for name, points in seen.items():
        check_control_points(name, points, size)
    cameras = _in_stages(args, seen, size) if args.stages else _constrained(args, seen, size)
    cameras = [replace(camera, source=sources[camera.name]) for camera in cameras]
    write_rig_file(rig_file_of(CameraRig(tuple(cameras))), args.output, base_dir=".")
    print(f"wrote {args.output}")
    return 0


def _constrained(args: argparse.Namespace, seen, size: tuple[int, int]) -> list:
    """Cameras that fit best within the constraint; printed: how well, and the worst point of each."""
    import numpy as np

    from ...calibration.points.dlt import calibrate

    cameras = []
    print(f"{'camera':<12} {'points':>6} {'rms px':>8} {'worst px':>9}  worst point")
    for name, points in seen.items():
        found = calibrate(name, points.points, points.pixels, size, args.constraint)
        distances = np.linalg.norm(found.residuals_px, axis=1)
        worst = int(distances.argmax())
        print(f"{name:<12} {len(points.names):>6} {found.rms_px:>8.2f} {distances[worst]:>9.2f}  {points.names[worst]}")
        cameras.append(found.camera)
    return cameras


def _in_stages(args: argparse.Namespace, seen, size: tuple[int, int]) -> list:
    """Cameras of the last stage; printed: the errors of all stages."""
    import numpy as np

    from ...calibration.points.dlt_stages import STAGES, calibrate_in_stages, object_errors_m

    found = {name: calibrate_in_stages(name, points.points, points.pixels, size, args.seed) for name, points in seen.items()}
    common = _common(seen)
    print(f"{'stage':<12} {'parameters':>10} " + " ".join(f"{name:>10}" for name in seen) + f" {'object mm':>10}")
    for k, stage in enumerate(STAGES):
        errors = object_errors_m([stages[k].camera for stages in found.values()], *common)
        space = f"{1e3 * np.sqrt(np.mean(errors**2)):10.2f}" if len(errors) else f"{'-':>10}"
        pixels = " ".join(f"{stages[k].rms_px:10.2f}" for stages in found.values())
        print(f"{stage:<12} {11 if k < 2 else 7:>10} {pixels} {space}")
    print("rms: pixels in each camera's image, millimeters between the points and where several cameras reconstruct them")
    return [stages[-1].camera for stages in found.values()]


def _common(seen):
    """All points of all cameras: places (n, 3), pixels (n, c, 2), and weights (n, c)."""
    import numpy as np

    names = list(dict.fromkeys(name for points in seen.values() for name in points.names))
    number = {name: i for i, name in enumerate(names)}
    places, pixels, weights = np.zeros((len(names), 3)), np.zeros((len(names), len(seen), 2)), np.zeros((len(names), len(seen)))
    for c, points in enumerate(seen.values()):
        rows = [number[name] for name in points.names]
        places[rows], pixels[rows, c], weights[rows, c] = points.points, points.pixels, 1.0
    return places, pixels, weights
