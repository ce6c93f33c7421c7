"""``tracker_node calibrate texture``: a flat box with a texture on it, as a model that the engine of colors can track."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...errors import FileFormatError
from ..arguments.board import add_markers, check_markers
from ..arguments.cameras import size_option

SUMMARY = "make a model of a flat plate with a texture on it: a photo or print file, or a ChArUco board that is drawn"
EXAMPLE = "tracker_node calibrate texture --charuco 4x5 --square 0.054 --border 20 --border-gray 20 -o plate.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    what = parser.add_mutually_exclusive_group(required=True)
    what.add_argument("--image", metavar="FILE", help="image of the plate's face, undistorted and cropped to it")
    what.add_argument("--charuco", metavar="COLUMNSxROWS", help="draw a ChArUco board of so many squares")
    parser.add_argument("--width", type=float, metavar="M", help="with --image: width of the plate, meters")
    parser.add_argument("--square", type=float, metavar="M", help="with --charuco: edge of a square, meters")
    add_markers(parser)
    parser.add_argument("--border", type=int, default=0, metavar="MM", help="width of a plain border around the image")
    parser.add_argument("--border-gray", type=int, default=20, metavar="0..255", help="its gray level (default: %(default)s)")
    parser.add_argument("--thickness", type=float, default=0.005, metavar="M", help="of the plate (default: %(default)s)")
    parser.add_argument("--name", default="plate", help="name of the body (default: %(default)s)")
    parser.add_argument("-o", "--output", default="plate.yaml", metavar="FILE", help="model to write (default: %(default)s)")


def run(args: argparse.Namespace) -> int:
    from ...calibration.texture import framed, plate_model
    from ...loaders.model.model_yaml import dump_model

    image, texels_per_m = _drawn(args) if args.charuco else _read(args)
    height, width = image.shape[:2]
    if not 0 <= args.border <= 1000 or not 0 <= args.border_gray <= 255 or not 0.0 < args.thickness < 1.0:
        options = "--border, --border-gray, --thickness"
        raise FileFormatError("command line", options, "0..1000 mm, 0..255, 0..1 m", vars(args)["border"])
    wide = round(1e-3 * args.border * texels_per_m)
    whole = framed(image, [(wide, wide, wide, wide, args.border_gray)])
    origin = wide + width / 2.0, wide + height / 2.0
    model = plate_model(args.name, whole, texels_per_m, origin, args.thickness)
    dump_model(
        model, args.output, "Flat box with a texture on its face +z; the origin is the middle of the image, x right, y up."
    )
    x, y, _ = model.shapes[0].primitive.size  # type: ignore[union-attr]
    print(f"{args.name}: {1e3 * x:.1f} x {1e3 * y:.1f} mm, {texels_per_m:.0f} texels a meter; wrote {args.output}")
    return 0


def _read(args: argparse.Namespace):
    from ...loaders.model.mesh_file import read_texture

    if args.width is None or not 0.0 < args.width < 100.0:
        raise FileFormatError("command line", "--width", "the plate's width in meters, with --image", args.width)
    image = read_texture(Path(args.image), "command line", "--image")
    return image, image.shape[1] / args.width


def _drawn(args: argparse.Namespace):
    import cv2

    from ...calibration.texture import charuco_texture

    columns, rows = size_option("--charuco", args.charuco, "columns x rows from 2x2 to 100x100, such as 4x5", 2, 100)
    if args.square is None or not 0.0 < args.square < 10.0:
        raise FileFormatError("command line", "--square", "the edge of a square in meters, with --charuco", args.square)
    check_markers(args)
    texels_per_m = max(1000.0, 40.0 / args.square)
    try:
        board = (columns, rows, args.square, args.marker_ratio, args.dictionary, args.inverted)
        return charuco_texture(*board, texels_per_m), texels_per_m
    except cv2.error as error:
        expected = "a board that OpenCV can draw with this dictionary"
        raise FileFormatError("command line", "--charuco", expected, str(error).strip()) from None
