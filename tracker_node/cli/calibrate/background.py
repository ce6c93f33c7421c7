"""``tracker_node calibrate background``: images of the background."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..arguments.run_images import refuse_to_overwrite

SUMMARY = (
    "make images of the background (the empty scene) from the recordings of a rig, and from images of it alone if there are any"
)
EXAMPLE = "tracker_node calibrate background --rig rig.yaml --background-images empty_room/ -o rig_with_backgrounds.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", required=True, metavar="RIG", help="rig.yaml whose cameras have sources")
    parser.add_argument(
        "--background-images",
        metavar="DIR",
        help="one image a camera, named as the camera, in the pixels of its recording: for places where somebody always stands",
    )
    parser.add_argument(
        "--images", type=int, default=25, metavar="N", help="images of each recording to look at (default: %(default)s)"
    )
    parser.add_argument("--output-dir", default="backgrounds", metavar="DIR", help="folder for the images (default: %(default)s)")
    parser.add_argument("-o", "--output", metavar="FILE", help="rig file to write, with the images in it (default: none)")
    parser.add_argument("--force", action="store_true", help="overwrite the images and the output")


def run(args: argparse.Namespace) -> int:
    from ...calibration.background import build_backgrounds, with_backgrounds, write_image
    from ...errors import FileFormatError
    from ...loaders.rig.rig_yaml import build_rig, read_rig_file, write_rig_file

    if args.images < 3:
        raise FileFormatError("command line", "--images", "at least 3", args.images)
    rig_file, base = read_rig_file(args.rig), Path(args.rig).parent
    rig = build_rig(rig_file, base)
    paths = {name: Path(args.output_dir) / f"{name}.png" for name in rig.names}
    refuse_to_overwrite(args, *paths.values(), *([args.output] if args.output else []))
    images = {}
    for name, background in build_backgrounds(rig, args.images, args.background_images):
        images[name] = background.image
        unknown = 100.0 * (1.0 - float(background.known.mean()))
        rest = "from its image alone" if args.background_images else "not known, somebody is there too often"
        print(f"{name}: {unknown:.1f} % of the background {rest}", flush=True)
    for name, image in images.items():
        write_image(paths[name], image)
        print(f"wrote {paths[name]}")
    if args.output:
        write_rig_file(with_backgrounds(rig_file, paths), args.output, base_dir=base)
        print(f"wrote {args.output}")
    return 0
