"""``tracker_node calibrate pose``: a first pose from points."""

from __future__ import annotations

import argparse

from ...errors import FileFormatError
from ..arguments.run_images import refuse_to_overwrite
from .body import add_up_arguments

SUMMARY = "pose a body to one row of a TRC file: a first state to track from"
EXAMPLE = "tracker_node calibrate pose --model person.yaml --trc joints.trc --y-up --row 0 -o start.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--model", required=True, metavar="MODEL", help="model.yaml of the person")
    parser.add_argument("--trc", required=True, metavar="FILE", help="joints or markers")
    add_up_arguments(parser)
    parser.add_argument("--row", type=int, default=0, metavar="N", help="row to fit, counted from 0 (default: %(default)s)")
    parser.add_argument("-o", "--output", default="state.yaml", metavar="FILE", help="state to write (default: %(default)s)")
    parser.add_argument("--force", action="store_true", help="overwrite the output")


def run(args: argparse.Namespace) -> int:
    from ...calibration.body import targets_of
    from ...calibration.pose import fit_state_to_landmarks
    from ...loaders.model.model_yaml import load_model
    from ...loaders.model.state_yaml import dump_state
    from ...loaders.motion.trc import load_trc

    refuse_to_overwrite(args, args.output)
    model, markers = load_model(args.model), load_trc(args.trc, args.y_up)
    if not 0 <= args.row < len(markers):
        raise FileFormatError("command line", "--row", f"a row of {args.trc}, 0 to {len(markers) - 1}", args.row)
    targets = targets_of(model, markers, args.row)
    if len(targets) < 3:
        got = f"{len(targets)} of {', '.join(markers.names)}"
        raise FileFormatError(args.trc, f"row {args.row}", f"at least 3 landmarks of model '{model.name}'", got)
    fit = fit_state_to_landmarks(model, targets)
    dump_state(fit.state, model, args.output, f"{model.name} posed to row {args.row} of {args.trc}.\nFormat: docs/formats.md.")
    worst = max(fit.residuals_m, key=lambda name: fit.residuals_m[name])
    print(f"{len(targets)} landmarks fitted to {1000 * fit.mean_residual_m:.1f} mm on average")
    print(f"worst: {worst} {1000 * fit.residuals_m[worst]:.1f} mm; wrote {args.output}")
    return 0
