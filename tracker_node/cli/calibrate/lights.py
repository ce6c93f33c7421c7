"""``tracker_node calibrate lights``: lights, and the cameras' answers to them, from images of a body in known poses."""

from __future__ import annotations

import argparse
from pathlib import Path

from ...errors import FileFormatError
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
    from ...calibration.light_fit import fit_lights, load_pose_images, with_lights
    from ...loaders.model.model_yaml import load_model
    from ...loaders.model.state_yaml import load_state
    from ...loaders.rig.rig_yaml import build_rig, read_rig_file, write_rig_file
    from ...model.configuration import Configuration

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
    _print(rig, fit)
    left_out = [name for name in rig.names if name not in fit.n_pixels]
    if left_out:
        print(f"note: no images of {', '.join(left_out)}; gain and gamma stay as they were")
    print(f"wrote {args.output}")
    return 0


def _print(rig, fit) -> None:
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
