"""``tracker_node calibrate background``: images of the background."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..arguments.run_images import refuse_to_overwrite

SUMMARY = (
    "make images of the background (the empty scene) from the recordings of a rig, and from images of it alone if there are any"
)
EXAMPLE = (
    "tracker_node calibrate background --rig rig.yaml -o rig_with_backgrounds.yaml\n"
    "  tracker_node calibrate background --rig rig.yaml --background-images empty_room/ -o rig_with_backgrounds.yaml"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", required=True, metavar="RIG", help="rig.yaml whose cameras have sources")
    parser.add_argument(
        "--background-images",
        metavar="DIR",
        help="one image a camera, named as the camera: for places where somebody always stands (default: what lies beside the"
        " recordings, such as background/cam01.png or cam01_empty.mp4)",
    )
    parser.add_argument(
        "--most-unknown", type=float, default=5.0, metavar="PERCENT",
        help="without such an image: how much of it may never settle in the recording; a camera with more gets no background"
        " (default: %(default)s)",
    )  # fmt: skip
    parser.add_argument(
        "--images", type=int, default=25, metavar="N", help="images of each recording to look at (default: %(default)s)"
    )
    parser.add_argument("--output-dir", default="backgrounds", metavar="DIR", help="folder for the images (default: %(default)s)")
    parser.add_argument("-o", "--output", metavar="FILE", help="rig file to write, with the images in it (default: none)")
    parser.add_argument("--force", action="store_true", help="overwrite the images and the output")


def run(args: argparse.Namespace) -> int:
    from ...calibration.background import build_backgrounds, images_beside, with_backgrounds, write_image
    from ...errors import CalibrationError, FileFormatError
    from ...loaders.rig.rig_yaml import build_rig, read_rig_file, write_rig_file

    if args.images < 3:
        raise FileFormatError("command line", "--images", "at least 3", args.images)
    if not 0.0 <= args.most_unknown <= 100.0:
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
        doubt = "" if alone else background.doubt(0.01 * args.most_unknown)
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
