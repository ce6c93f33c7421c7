"""``tracker_node calibrate intrinsics``: lenses of cameras from recordings of a board, each by itself."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..arguments.board import add_board_arguments, board_of, detect, sources_of
from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "find the lenses of cameras from videos or image folders of a chessboard or a ChArUco board, each camera by itself"
EXAMPLE = "tracker_node calibrate intrinsics --videos lens/cam01.mp4 lens/cam02.mp4 --chessboard 9x6 --square 0.03 -o lenses.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add_board_arguments(parser)
    parser.add_argument("--views", type=int, default=80, metavar="N", help="views used at most (default: %(default)s)")
    parser.add_argument(
        "-o", "--output", default="lenses.yaml", metavar="FILE",
        help="rig.yaml to write; all cameras stand at the world's origin in it (default: %(default)s)",
    )  # fmt: skip


def run(args: argparse.Namespace) -> int:
    import numpy as np

    from ...calibration.board.intrinsics import LEAST_VIEWS, calibrate_lens
    from ...calibration.board.report import (
        coverage_notes,
        covered,
        lens_images,
        lens_table,
        outlier_table,
        write_images,
    )
    from ...camera.rig import Camera, CameraRig
    from ...errors import FileFormatError
    from ...loaders.rig.rig_yaml import rig_file_of, write_rig_file
    from ...report.page import PageSection, text_table, write_page
    from ...report.progress import StageProgress

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
    print(f"wrote {args.output}, {page} and {', '.join(map(str, files))}; places are still to be found (calibrate rig --lenses)")
    return 1 if left_out else 0
