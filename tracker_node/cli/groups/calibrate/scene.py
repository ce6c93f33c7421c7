"""What is there beside the body: ``tracker_node calibrate background`` and ``lights``; ``texture``, a plate that colors track."""

from __future__ import annotations

import argparse
from pathlib import Path

from ....errors import FileFormatError
from ...arguments.board import add_markers, check_markers
from ...arguments.cameras import size_option
from ...arguments.run_images import refuse_to_overwrite
from ...arguments.verbs import Subverb


def _add_background_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", required=True, metavar="RIG", help="rig.yaml whose cameras have sources")
    parser.add_argument(
        "--background-images",
        metavar="DIR",
        help="one image a camera, named as the camera: for places where somebody always stands (default: what lies beside the"
        " recordings, such as background/cam01.png or cam01_empty.mp4)",
    )
    parser.add_argument(
        "--most-unknown", type=float, metavar="PERCENT",
        help="without such an image: how much of it may never settle in the recording; a camera with more gets no background"
        " (default: 5)",
    )  # fmt: skip
    parser.add_argument(
        "--images", type=int, default=25, metavar="N", help="images of each recording to look at (default: %(default)s)"
    )
    parser.add_argument("--output-dir", default="backgrounds", metavar="DIR", help="folder for the images (default: %(default)s)")
    parser.add_argument("-o", "--output", metavar="FILE", help="rig file to write, with the images in it (default: none)")
    parser.add_argument("--force", action="store_true", help="overwrite the images and the output")


def _run_background(args: argparse.Namespace) -> int:
    from ....calibration.background import MOST_UNKNOWN, build_backgrounds, images_beside, with_backgrounds, write_image
    from ....errors import CalibrationError
    from ....loaders.rig.rig_yaml import build_rig, read_rig_file, write_rig_file

    if args.images < 3:
        raise FileFormatError("command line", "--images", "at least 3", args.images)
    if args.most_unknown is not None and args.background_images:
        expected = "none with --background-images, which show all of it"
        raise FileFormatError("command line", "--most-unknown", expected, args.most_unknown)
    most_unknown = MOST_UNKNOWN if args.most_unknown is None else 0.01 * args.most_unknown
    if not 0.0 <= most_unknown <= 1.0:
        raise FileFormatError("command line", "--most-unknown", "0 to 100 percent", args.most_unknown)
    rig_file, base = read_rig_file(args.rig), Path(args.rig).parent
    rig = build_rig(rig_file, base)
    paths = {name: Path(args.output_dir) / f"{name}.png" for name in rig.names}
    refuse_to_overwrite(args, *paths.values(), *([args.output] if args.output else []))
    found = {} if args.background_images else images_beside(rig)
    for name, path in found.items():
        print(f"{name}: its background alone is in {path}")
    images = {}
    for name, background in build_backgrounds(rig, args.images, args.background_images or found):
        unknown, alone = 100.0 * (1.0 - float(background.known.mean())), args.background_images or name in found
        rest = "from its image alone" if alone else "not known, somebody is there too often"
        print(f"{name}: {unknown:.1f} % of the background {rest}", flush=True)
        doubt = "" if alone else background.doubt(most_unknown)
        if doubt:
            print(f"note: {name} gets no background: {doubt}; put an image of it beside the videos, background/{name}.png")
        else:
            images[name] = background.image
    if not images:
        raise CalibrationError(", ".join(rig.names), "no background is to be relied on; see the notes, or --most-unknown")
    for name, image in images.items():
        write_image(paths[name], image)
        print(f"wrote {paths[name]}")
    if args.output:
        made = {name: paths[name] for name in images}
        write_rig_file(with_backgrounds(rig_file, made, base), args.output, base_dir=base)
        print(f"wrote {args.output}")
    return 0


def _add_lights_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--rig", required=True, metavar="RIG", help="rig.yaml with cameras, and lights roughly as they are")
    add("--model", required=True, metavar="MODEL", help="model.yaml of the body, with its colors")
    add("--state", required=True, nargs="+", metavar="STATE", help="state.yaml of each pose")
    add("--images", required=True, nargs="+", metavar="PATTERN",
        help="images of each pose, {name} is the camera's name; a camera without one is left out there")  # fmt: skip
    add("--keep-cameras", action="store_true", help="only the lights: gains and gammas stay")
    add("--position-sigma-m", type=float, default=1.0, metavar="M",
        help="how well the lights' places are known beforehand (default: %(default)s)")  # fmt: skip
    add("-o", "--output", default="rig_lit.yaml", metavar="FILE", help="file to write (default: %(default)s)")
    add("--force", action="store_true", help="overwrite the output")


def _run_lights(args: argparse.Namespace) -> int:
    from ....calibration.light_fit import fit_lights, load_pose_images, with_lights
    from ....loaders.model.model_yaml import load_model
    from ....loaders.model.state_yaml import load_state
    from ....loaders.rig.rig_yaml import build_rig, read_rig_file, write_rig_file
    from ....model.configuration import Configuration

    refuse_to_overwrite(args, args.output)
    if len(args.state) != len(args.images):
        raise FileFormatError("command line", "--images", f"one pattern for each of {len(args.state)} states", len(args.images))
    if not 0.0 < args.position_sigma_m < 100.0:
        raise FileFormatError("command line", "--position-sigma-m", "a positive number of meters", args.position_sigma_m)
    rig_file, model = read_rig_file(args.rig), load_model(args.model)
    rig = build_rig(rig_file, Path(args.rig).parent)
    configurations = [Configuration(model, load_state(path, model)) for path in args.state]
    images = load_pose_images(args.images, rig.names)
    fit = fit_lights(rig, configurations, images, args.position_sigma_m, not args.keep_cameras)
    write_rig_file(with_lights(rig_file, fit), args.output, base_dir=Path(args.rig).parent)
    _print_lights(rig, fit)
    left_out = [name for name in rig.names if name not in fit.n_pixels]
    if left_out:
        print(f"note: no images of {', '.join(left_out)}; gain and gamma stay as they were")
    print(f"wrote {args.output}")
    return 0


def _print_lights(rig, fit) -> None:
    """What has been found, as two tables."""
    import numpy as np

    print(f"{'camera':12} {'pixels':>7} {'rms levels':>16} {'gain':>20} {'gamma':>6}")
    for name, before in fit.rms_before.items():
        camera = fit.rig[name]
        gain = " ".join(f"{value:.3f}" for value in camera.gain)
        print(f"{name:12} {fit.n_pixels[name]:7d} {before:7.2f} -> {fit.rms_after[name]:5.2f} {gain:>20} {camera.gamma:6.3f}")
    print(f"{'light':12} {'intensity':>20} {'place m':>24} {'moved':>8}")
    for old, new, sigma in zip(rig.lights, fit.rig.lights, fit.position_sigma_m, strict=True):
        intensity = " ".join(f"{value:.3f}" for value in new.intensity)
        if new.position is None or old.position is None:
            print(f"{new.kind:12} {intensity:>20}")
            continue
        place = " ".join(f"{value:7.3f}" for value in new.position)
        moved = np.linalg.norm(np.subtract(new.position, old.position))
        print(f"{new.kind:12} {intensity:>20} {place:>24} {moved:6.3f} m (each axis known to {sigma:.3f} m)")
    if not fit.converged:
        print("note: not converged; the rms above says whether it is good enough")


def _add_texture_arguments(parser: argparse.ArgumentParser) -> None:
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
    parser.add_argument("--force", action="store_true", help="overwrite the output")


def _run_texture(args: argparse.Namespace) -> int:
    from ....calibration.texture import framed, plate_model
    from ....loaders.model.model_yaml import dump_model

    refuse_to_overwrite(args, args.output)
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
    from ....loaders.model.mesh_file import read_texture

    if args.width is None or not 0.0 < args.width < 100.0:
        raise FileFormatError("command line", "--width", "the plate's width in meters, with --image", args.width)
    image = read_texture(Path(args.image), "command line", "--image")
    return image, image.shape[1] / args.width


def _drawn(args: argparse.Namespace):
    import cv2

    from ....calibration.texture import charuco_texture

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


SUBVERBS = (
    Subverb(
        "background",
        "make images of the background (the empty scene) from the recordings of a rig, and from images of it alone if there"
        " are any",
        "tracker_node calibrate background --rig rig.yaml -o rig_with_backgrounds.yaml\n"
        "  tracker_node calibrate background --rig rig.yaml --background-images empty_room/ -o rig_with_backgrounds.yaml",
        _add_background_arguments,
        _run_background,
    ),
    Subverb(
        "lights",
        "find lights, and gain and gamma of every camera, from images of a body in known poses",
        "tracker_node calibrate lights --rig rig.yaml --model body.yaml --state pose1.yaml pose2.yaml"
        " --images 'pose1/{name}.png' 'pose2/{name}.png' -o rig_lit.yaml",
        _add_lights_arguments,
        _run_lights,
    ),
    Subverb(
        "texture",
        "make a model of a flat plate with a texture on it: a photo or print file, or a ChArUco board that is drawn",
        "tracker_node calibrate texture --charuco 4x5 --square 0.054 --border 20 --border-gray 20 -o plate.yaml",
        _add_texture_arguments,
        _run_texture,
    ),
)
