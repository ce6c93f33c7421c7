"""Arguments of calibrations from the images of an earlier run, and what every verb checks of its arguments."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import FileFormatError, TrackerError

if TYPE_CHECKING:
    from ...calibration.tracked_body.lines import LineEvidence
    from ...runs.images import RunImages

EVIDENCE = ("region", "silhouette")


def add_run_arguments(parser: argparse.ArgumentParser, n_sets: int) -> None:
    """Arguments of every calibration from a run, and ``--force``, which holds for those from other files too.

    Parameters
    ----------
    parser : of a verb.
    n_sets : default number of image sets.
    """
    parser.add_argument("--force", action="store_true", help="overwrite the output and the report")
    group = parser.add_argument_group("from a run")
    add = group.add_argument
    add("--from-run", metavar="RUN", help="folder written by track, or a bag with tracked states and images")
    add("--sets", type=int, default=n_sets, metavar="N", help="image sets, spread over the run (default: %(default)s)")
    add("--evidence", choices=EVIDENCE, default=EVIDENCE[0],
        help="region: colors on either side of contours; silhouette: needs good backgrounds (default: %(default)s)")  # fmt: skip
    add("--config", metavar="FILE", help="tracker parameters, for how the images are processed (default: the run's)")
    add("--quiet", action="store_true", help="no progress on stderr")


def check(condition: object, option: str, expected: str, got: object = "nothing") -> None:
    """Raise a `FileFormatError` that names an option of the command line unless ``condition``.

    Parameters
    ----------
    condition : that must hold.
    option, expected, got : for the message.
    """
    if not condition:
        raise FileFormatError("command line", option, expected, got)


def refuse_to_overwrite(args: argparse.Namespace, *paths: str | Path) -> None:
    """Check that output files can be written without loss.

    Parameters
    ----------
    args : of the command line; ``force`` allows to overwrite files.
    *paths : files to be written.

    Raises
    ------
    TrackerError : a file that is there already and may not be overwritten, a folder, or two paths of one file.
    """
    seen: dict[Path, str | Path] = {}
    for path in paths:
        if Path(path).is_dir():
            raise TrackerError(f"{path}: expected a file to write, got a folder")
        place = Path(path).resolve()
        if place in seen:
            raise TrackerError(f"{seen[place]} and {path} are one file; give different names with --output and --report")
        seen[place] = path
        if Path(path).exists() and not args.force:
            other = "--output or --report" if hasattr(args, "report") else "--output"
            raise TrackerError(f"{path} is there already; give another {other}, or --force to overwrite it")


def load_run_images(args: argparse.Namespace, dressed: bool = False) -> RunImages:
    """The images and states that the arguments of `add_run_arguments`, ``--rig`` and ``--model`` ask for.

    Parameters
    ----------
    args : of the command line.
    dressed : the body has the clothes that the run has found, unless ``--model`` names another.

    Returns
    -------
    Of the run.

    Raises
    ------
    TrackerError : a run without states, or that does not say its rig or model, or whose images are not there.
    """
    from ...loaders.model.model_yaml import load_model
    from ...loaders.rig.rig_yaml import load_rig
    from ...runs.config_file import load_config
    from ...runs.images import config_of_run, images_of_run, rig_of_run
    from ...runs.load import body_of_run, load_run

    if args.sets < 1:
        raise FileFormatError("command line", "--sets", "a number of at least 1", args.sets)
    run = load_run(args.from_run)
    rig_path, model_path = named_file(args, run.info, "rig"), named_file(args, run.info, "model")
    model = load_model(model_path)
    run.check_model(model, model_path)
    if dressed and args.model is None:
        model = body_of_run(Path(args.from_run), model)
    rig = rig_of_run(load_rig(rig_path), run.info, other_file=args.rig is not None)
    config = load_config(args.config) if args.config else config_of_run(run.info)
    return images_of_run(run, rig, model, args.sets, config)


def evidence_of(kind: str, images: RunImages) -> LineEvidence:
    """Contour evidence of a run's images.

    Parameters
    ----------
    kind : one of `EVIDENCE`.
    images : of the run.

    Returns
    -------
    evidence : for the fit of a rig or a body.
    """
    from ...calibration.tracked_body.lines import RegionEvidence, SilhouetteEvidence

    make = SilhouetteEvidence if kind == "silhouette" else RegionEvidence
    return make(images.sets, images.config, images.backgrounds)


def named_file(args: argparse.Namespace, info: Any, key: str) -> str:
    """File that the command line names, or else the run.

    Parameters
    ----------
    args : of the command line.
    info : content of ``run.json``.
    key : ``rig`` or ``model``.

    Returns
    -------
    path : of the file.
    """
    from ...runs.images import file_of

    found = getattr(args, key) or file_of(info, key)
    if found:
        return found
    raise FileFormatError("command line", f"--{key}", f"a {key} file, since the run does not name it", "nothing")
