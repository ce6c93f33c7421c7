"""``tracker_node calibrate lights``: lights, and the cameras' answers to them, from images of a body in known poses."""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from ...errors import FileFormatError, SourceError
from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "find lights, and gain and gamma of every camera, from images of a body in known poses"
EXAMPLE = (
    "tracker_node calibrate lights --rig rig.yaml --model body.yaml --state pose1.yaml pose2.yaml"
    " --images 'pose1/{name}.png' 'pose2/{name}.png' -o rig_lit.yaml"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
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


def run(args: argparse.Namespace) -> int:
    from ...calibration.light_fit import LightFitOptions, fit_lights
    from ...loaders.model.model_yaml import load_model
    from ...loaders.model.state_yaml import load_state
    from ...loaders.rig.rig_yaml import build_rig, read_rig_file, rig_file_of, write_rig_file
    from ...model.configuration import Configuration

    refuse_to_overwrite(args, args.output)
    if len(args.state) != len(args.images):
        raise FileFormatError("command line", "--images", f"one pattern for each of {len(args.state)} states", len(args.images))
    if not 0.0 < args.position_sigma_m < 100.0:
        raise FileFormatError("command line", "--position-sigma-m", "a positive number of meters", args.position_sigma_m)
    rig_file, model = read_rig_file(args.rig), load_model(args.model)
    rig = build_rig(rig_file, Path(args.rig).parent)
    configurations = [Configuration(model, load_state(path, model)) for path in args.state]
    images = [[_image(pattern, name) for name in rig.names] for pattern in args.images]
    seen = [name for i, name in enumerate(rig.names) if any(each[i] is not None for each in images)]
    if not seen:
        raise SourceError(args.images[0], "there is no image of any camera there")
    chosen = [[each[rig.names.index(name)] for name in seen] for each in images]
    options = LightFitOptions(free_cameras=not args.keep_cameras, position_sigma_m=args.position_sigma_m)
    fit = fit_lights(rig.subset(seen), configurations, chosen, options)
    found = rig_file_of(fit.rig)
    cameras = {
        name: entry.model_copy(update={"gain": found.cameras[name].gain, "gamma": found.cameras[name].gamma})
        if name in found.cameras else entry
        for name, entry in rig_file.cameras.items()
    }  # fmt: skip
    changed = rig_file.model_copy(update={"cameras": cameras, "lights": found.lights})
    write_rig_file(changed, args.output, base_dir=Path(args.rig).parent)
    _print(rig, fit)
    left_out = [name for name in rig.names if name not in seen]
    if left_out:
        print(f"note: no images of {', '.join(left_out)}; gain and gamma stay as they were")
    print(f"wrote {args.output}")
    return 0


def _image(pattern: str, name: str) -> np.ndarray | None:
    """The image of a camera, or None where there is no such file."""
    import cv2

    try:
        path = Path(pattern.format(name=name))
    except (KeyError, IndexError, ValueError) as error:
        raise SourceError(pattern, "expected a pattern with {name}, such as 'pose1/{name}.png'") from error
    if not path.exists():
        return None
    image = cv2.imread(str(path), cv2.IMREAD_COLOR)
    if image is None:
        raise SourceError(path, "cannot be read as an image")
    return image


def _print(rig, fit) -> None:
    """What has been found, as two tables."""
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
