"""``tracker_node calibrate background``: images of the background."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "make images of the background (the empty scene) from the recordings of a rig, and from stills if there are any"
EXAMPLE = "tracker_node calibrate background --rig rig.yaml --stills empty_room/ --output-dir plates -o rig_with_plates.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--rig", required=True, metavar="RIG", help="rig.yaml whose cameras have sources")
    parser.add_argument(
        "--stills",
        metavar="DIR",
        help="one image a camera, named as the camera, in the pixels of its recording: for places where somebody always stands",
    )
    parser.add_argument(
        "--images", type=int, default=25, metavar="N", help="images of each recording to look at (default: %(default)s)"
    )
    parser.add_argument("--output-dir", default="plates", metavar="DIR", help="folder for the images (default: %(default)s)")
    parser.add_argument("-o", "--output", metavar="FILE", help="rig file to write, with the images in it (default: none)")
    parser.add_argument("--force", action="store_true", help="overwrite the images and the output")


def run(args: argparse.Namespace) -> int:
    from ...calibration.background import build_background, spread_images, write_image
    from ...errors import CalibrationError, FileFormatError
    from ...loaders.rig.rig_yaml import build_rig, read_rig_file, write_rig_file

    if args.images < 3:
        raise FileFormatError("command line", "--images", "at least 3", args.images)
    rig_file, base = read_rig_file(args.rig), Path(args.rig).parent
    rig = build_rig(rig_file, base)
    backgrounds = {name: Path(args.output_dir) / f"{name}.png" for name in rig.names}
    refuse_to_overwrite(args, *backgrounds.values(), *([args.output] if args.output else []))
    images_of = {}
    for camera in rig:
        if camera.source is None:
            raise CalibrationError(camera.name, f"has no source in {args.rig}")
        images = spread_images(camera.source, args.images)
        still = _still(args.stills, camera.name, images.shape[1:]) if args.stills else None
        found = build_background(images, still)
        images_of[camera.name] = found.image
        unknown = 100.0 * (1.0 - float(found.known.mean()))
        rest = "from the still" if still is not None else "not known, somebody is there too often"
        print(f"{camera.name}: {unknown:.1f} % of the background {rest}", flush=True)
    for name, image in images_of.items():
        write_image(backgrounds[name], image)
        print(f"wrote {backgrounds[name]}")
    if args.output:
        entries = {
            name: entry.model_copy(update={"background": str(backgrounds[name].absolute())})
            for name, entry in rig_file.cameras.items()
        }
        write_rig_file(rig_file.model_copy(update={"cameras": entries}), args.output, base_dir=base)
        print(f"wrote {args.output}")
    return 0


def _still(folder: str, camera: str, shape: tuple[int, ...]):
    import cv2

    from ...errors import CalibrationError, SourceError
    from ...loaders.images.source import IMAGE_SUFFIXES

    found = [Path(folder) / f"{camera}{suffix}" for suffix in IMAGE_SUFFIXES if (Path(folder) / f"{camera}{suffix}").exists()]
    image = cv2.imread(str(found[0])) if found else None
    if image is None:
        raise SourceError(folder, f"has no image named {camera} ({', '.join(IMAGE_SUFFIXES)})")
    if image.shape != shape:
        size = f"{image.shape[1]}x{image.shape[0]}"
        raise CalibrationError(
            camera, f"its still is {size}, its recording {shape[1]}x{shape[0]}; bring the still to that size first"
        )
    return image
