"""Cameras from a board or from control points: ``tracker_node calibrate rig``, ``intrinsics`` and ``dlt``."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from ....errors import FileFormatError
from ...arguments.board import add_board_arguments, board_of, check_different, detect, recordings_of, sources_of
from ...arguments.cameras import add_pixel_map_argument, add_sources_argument, size_option, sources_of_cameras
from ...arguments.run_images import refuse_to_overwrite
from ...arguments.verbs import Subverb

LONGEST_APART_S = 30.0  # of phones that are started one by one
RUNNER_UP = 0.8


def _add_rig_arguments(parser: argparse.ArgumentParser) -> None:
    add_board_arguments(parser)
    add = parser.add_argument
    add("--lenses", metavar="RIG", help="rig.yaml with lenses, such as that of `calibrate intrinsics`")
    add("--keep-lenses", action="store_true", help="with --lenses: do not refine them")
    add("--stamps", metavar="CSV", help="times of the images of all cameras (columns camera and time, such as timestamps.csv)")
    add("--clocks", choices=("auto", "exact", "offset", "free", "sound"), default="auto",
        help="exact: stamps are right; offset: each camera's clock may be off; free: each stamp, too; sound: as free, for videos"
        " begun one by one, with claps; auto: exact for folders of images, else free (default: %(default)s)")  # fmt: skip
    add("--stamp-sigma-ms", type=float, default=20.0, metavar="MS",
        help="how far off single stamps are usually, with clocks that are free (default: %(default)s)")  # fmt: skip
    add("--tolerance-ms", type=float, metavar="MS", help="images so near in time belong together (default: half a period)")
    add("--sets", type=int, default=100, metavar="N", help="image sets used at most (default: %(default)s)")
    add_sources_argument(parser)
    add_pixel_map_argument(parser)
    add("--write-clocks", action="store_true", help="write clocks that are off as time_offset_s: for cameras that keep running")
    add("-o", "--output", default="rig.yaml", metavar="FILE", help="file to write (default: %(default)s)")


def _run_rig(args: argparse.Namespace) -> int:
    from ....calibration.board.report import (
        camera_metrics,
        coverage_notes,
        late_cameras,
        rig_images,
        rig_metrics,
        rig_tables,
        worst_views,
        write_images,
        write_rig_page,
    )
    from ....calibration.board.rig import calibrate_rig, check_for_rig, given_lenses, with_clocks
    from ....calibration.video_pixels import parsed_choices, rig_of_videos
    from ....loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
    from ....report.html import text_table
    from ....report.metrics_file import write_metrics
    from ....report.progress import StageProgress

    page = Path(args.report or Path(args.output).with_suffix(".html"))
    metrics_file = page.with_suffix(".json")
    refuse_to_overwrite(args, args.output, page, metrics_file)
    board = board_of(args)
    check_for_rig(board)
    check_different(recordings_of(args))
    begun_s = _by_sound(args) if args.clocks == "sound" else {}
    sources = sources_of(args, args.stamps, begun_s)
    tracked_later = sources_of_cameras(args.sources, list(sources), print)
    pixels = parsed_choices("--pixel-map", args.pixel_map)
    rig_of_videos(_of_their_sizes(sources, tracked_later), pixels, lambda sentence: None)  # before what takes minutes
    options = _rig_options(args)
    lenses = given_lenses(load_rig(args.lenses), sources) if args.lenses else None
    seen, left_out = detect(args, sources, board, least=2)
    lenses = None if lenses is None else {name: lens for name, lens in lenses.items() if name in seen}
    found = calibrate_rig(board, seen, options, lenses, None if args.quiet else StageProgress("calibrate rig"))
    late_s = late_cameras(found)
    whole_s = {name: begun_s.get(name, 0.0) + late_s.get(name, 0.0) for name in found.rig.names}
    rig = with_clocks(found.rig, whole_s if args.write_clocks else {})
    rig = rig.with_sources({name: tracked_later.get(name) for name in rig.names})
    rig = rig_of_videos(rig, pixels, print)
    write_rig_file(rig_file_of(rig), args.output, base_dir=".")
    for name, seconds in late_s.items():
        print(f"{name}: its images are {1e3 * seconds:.1f} ms later than they say, beside {found.rig.names[0]}")
    write_rig_page(page, found, seen)
    write_metrics(metrics_file, rig_metrics(found))
    files = write_images(page.parent, found.rig.names, rig_images(found, seen))
    cameras, pairs, *_, outliers = rig_tables(found, seen)
    for table in (cameras, pairs):
        print(text_table(table.table))
    for name, image, error in worst_views(found, 3):
        print(f"worst view: image {image} of {name}, {error:.2f} px")
    for row in outliers.table[1:]:
        print(f"left out: image {row[1]} of {row[0]}")
    if not args.keep_lenses:
        corners = {name: each.pixels for name, each in camera_metrics(found).items()}
        for note in coverage_notes(corners, {name: camera.image_size for name, camera in seen.items()}):
            print(f"note: {note}")
    if not found.adjustment.converged:
        problem = f"warning: not converged after {found.adjustment.iterations} iterations: do not use {args.output} unseen;"
        print(f"{problem} videos that were begun one after another need --clocks sound, or stamps", file=sys.stderr)
    print(f"wrote {args.output}, {page}, {metrics_file} and {', '.join(map(str, files))}")
    return 1 if left_out or not found.adjustment.converged else 0


def _of_their_sizes(sources, tracked_later):
    """Cameras of any lens and place, with the sizes that the calibration will be for."""
    import numpy as np

    from ....camera.model import CameraModel
    from ....camera.rig import Camera, CameraRig

    cameras = []
    for name, source in sources.items():
        width, height = source.native_width, source.native_height
        lens = CameraModel(width, height, np.diag([width, width, 1.0]))
        cameras.append(Camera(name, lens, np.eye(4), tracked_later.get(name)))
    return CameraRig(tuple(cameras))


def _by_sound(args: argparse.Namespace) -> dict[str, float]:
    """By how much the images of each camera are later than they say, by the claps in their videos."""
    from ....calibration.clocks.synchronization import clocks_of_videos

    if args.stamps:
        raise FileFormatError("command line", "--clocks", "no sound beside --stamps, which say when images were taken", "sound")
    clocks = clocks_of_videos(recordings_of(args), LONGEST_APART_S)
    for name, clock in clocks.cameras.items():
        said = f"{name}: begun {clock.offset_s:+.3f} +- {clock.offset_sigma_s:.3f} s beside the others, by its sound"
        print(said + ("; another lag fits about as well" if clock.runner_up > RUNNER_UP else ""))
    return {name: clock.offset_s for name, clock in clocks.cameras.items()}


def _rig_options(args: argparse.Namespace):
    from ....calibration.board.refinement import BoardRigOptions

    for option, value in (("--stamp-sigma-ms", args.stamp_sigma_ms), ("--tolerance-ms", args.tolerance_ms)):
        if value is not None and not 0.0 < value < 1e4:
            raise FileFormatError("command line", option, "a positive number of milliseconds", value)
    if args.sets < 3:
        raise FileFormatError("command line", "--sets", "at least 3", args.sets)
    if args.keep_lenses and not args.lenses:
        raise FileFormatError("command line", "--keep-lenses", "lenses to keep, with --lenses", "none")
    clocks = "free" if args.clocks == "sound" else args.clocks
    if clocks == "auto":
        still = not args.stamps and any(Path(text.partition("=")[2] or text).is_dir() for text in args.videos)
        clocks = "exact" if still else "free"
    tolerance = None if args.tolerance_ms is None else 1e-3 * args.tolerance_ms
    return BoardRigOptions(args.distortion, not args.keep_lenses, clocks, 1e-3 * args.stamp_sigma_ms, tolerance, args.sets)


def _add_intrinsics_arguments(parser: argparse.ArgumentParser) -> None:
    add_board_arguments(parser)
    parser.add_argument("--views", type=int, default=80, metavar="N", help="views used at most (default: %(default)s)")
    parser.add_argument(
        "-o", "--output", default="lenses.yaml", metavar="FILE",
        help="rig.yaml to write; all cameras stand at the world's origin in it (default: %(default)s)",
    )  # fmt: skip


def _run_intrinsics(args: argparse.Namespace) -> int:
    import numpy as np

    from ....calibration.board.intrinsics import LEAST_VIEWS, calibrate_lens
    from ....calibration.board.report import (
        coverage_notes,
        covered,
        lens_images,
        lens_table,
        outlier_table,
        write_images,
    )
    from ....camera.rig import Camera, CameraRig
    from ....errors import FileFormatError
    from ....loaders.rig.rig_yaml import rig_file_of, write_rig_file
    from ....report.html import PageSection, text_table, write_page
    from ....report.progress import StageProgress

    page = Path(args.report or Path(args.output).with_suffix(".html"))
    refuse_to_overwrite(args, args.output, page)
    if args.views < LEAST_VIEWS:
        raise FileFormatError("command line", "--views", f"at least {LEAST_VIEWS}", args.views)
    board = board_of(args)
    seen, left_out = detect(args, sources_of(args), board, least=1)
    progress, found = None if args.quiet else StageProgress("calibrate intrinsics"), {}
    for done, (name, camera) in enumerate(seen.items(), start=1):
        found[name] = calibrate_lens(name, board, camera.views, camera.image_size, args.distortion, args.views)
        if progress:
            progress("lenses", done, len(seen))
    rows = []
    for name, lens in found.items():
        fraction = covered(np.concatenate([view.pixels for view in lens.views]), seen[name].image_size)
        K, sigma = lens.lens.K, lens.sigma
        rows.append((name, str(len(lens.views)), str(len(lens.outliers)), f"{lens.rms_px:.2f}", f"{100 * fraction:.0f}",
                     f"{K[0, 0]:.1f} ± {sigma[0]:.1f}", f"{K[0, 2]:.1f} {K[1, 2]:.1f} ± {max(sigma[2:4]):.1f}"))  # fmt: skip
    table = PageSection("Cameras", table=[("camera", "views", "left out", "rms px", "covered %", "focal px", "center px"), *rows])
    outliers = outlier_table([(name, view) for name, lens in found.items() for view in lens.outliers])
    images = lens_images(found, seen)
    rig = CameraRig(tuple(Camera(name, lens.lens, np.eye(4)) for name, lens in found.items()))
    write_rig_file(rig_file_of(rig), args.output)
    tables = [table, *(lens_table(name, lens.lens, lens.sigma) for name, lens in found.items()), outliers]
    text = f"{board}. Sigmas take the corners' errors as independent: lower bounds."
    write_page(page, "Lenses from a board", [PageSection(text=text), *tables, *images])
    files = write_images(page.parent, list(found), images)
    print(text_table(table.table))
    for row in outliers.table[1:]:
        print(f"left out: image {row[1]} of {row[0]}")
    pixels = {name: np.concatenate([view.pixels for view in lens.views]) for name, lens in found.items()}
    for note in coverage_notes(pixels, {name: camera.image_size for name, camera in seen.items()}):
        print(f"note: {note}")
    doubts = [f"{name}: {lens.doubt}" for name, lens in found.items() if lens.doubt]
    for doubt in doubts:
        print(f"warning: {doubt}", file=sys.stderr)
    print(f"wrote {args.output}, {page} and {', '.join(map(str, files))}; places are still to be found (calibrate rig --lenses)")
    return 1 if left_out or doubts else 0


def _add_dlt_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--points", required=True, metavar="CSV", help="columns camera,point,x,y,z,u,v: meters and pixels")
    parser.add_argument("--size", required=True, metavar="WxH", help="size of the images, such as 768x576")
    parser.add_argument(
        "--constraint",
        choices=("none", "no_skew", "square", "radial", "centered"),
        default="square",
        help="none: all eleven parameters; square: square pixels without skew; radial: also the distortion of the lens; centered:"
        " square, with the principal point in the middle of the image, for few or poor points (default: %(default)s)",
    )
    add_sources_argument(parser)
    parser.add_argument("-o", "--output", default="rig.yaml", metavar="FILE", help="file to write (default: %(default)s)")
    parser.add_argument("--force", action="store_true", help="overwrite the output")


def _run_dlt(args: argparse.Namespace) -> int:
    from ....calibration.points.dlt import check_control_points
    from ....camera.rig import CameraRig
    from ....loaders.rig.control_points import load_control_points
    from ....loaders.rig.rig_yaml import rig_file_of, write_rig_file

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

    from ....calibration.points.dlt import calibrate, object_errors_m

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


SUBVERBS = (
    Subverb(
        "dlt",
        "make a rig from control points of known place, clicked on in one image of every camera (DLT)",
        "tracker_node calibrate dlt --points control_points.csv --size 768x576 --sources 'videos/{name}.avi' -o rig.yaml",
        _add_dlt_arguments,
        _run_dlt,
    ),
    Subverb(
        "intrinsics",
        "find the lenses of cameras from videos or image folders of a chessboard or a ChArUco board, each camera by itself",
        "tracker_node calibrate intrinsics --videos lens/cam01.mp4 lens/cam02.mp4 --chessboard 9x6 --square 0.03 -o lenses.yaml",
        _add_intrinsics_arguments,
        _run_intrinsics,
    ),
    Subverb(
        "rig",
        "make a rig from videos or image folders in which several cameras see a chessboard or a ChArUco board",
        "tracker_node calibrate rig --videos calib/cam01.mp4 calib/cam02.mp4 --charuco 7x5 --square 0.08 -o rig.yaml",
        _add_rig_arguments,
        _run_rig,
    ),
)
