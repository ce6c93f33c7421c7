"""Arguments of runs and of what begins with their images, what every verb checks of its own, and how ``run.json`` has them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import FileFormatError, TrackerError

if TYPE_CHECKING:
    from ...calibration.tracked_body.lines import LineEvidence
    from ...runs.images import RunImages
import math
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING

from ...errors import without_password
from ...loaders.source_address import relocated

if TYPE_CHECKING:
    import numpy as np

def add_person_argument(parser: argparse._ActionsContainer) -> None:
    """``--person X Y Z``.

    Parameters
    ----------
    parser : of a verb, or a group of its arguments.
    """
    parser.add_argument(
        "--person", nargs=3, type=float, metavar=("X", "Y", "Z"),
        help="of several people, the one nearest to this place, meters (default: nearest to where the cameras look)",
    )  # fmt: skip


def place_of_person(args: argparse.Namespace) -> np.ndarray | None:
    """(3,) meters, world, of the command line; None where no person is named.

    Raises
    ------
    FileFormatError : it is not finite.
    """
    import numpy as np

    if args.person is None:
        return None
    place = np.array(args.person)
    if not np.isfinite(place).all():
        raise FileFormatError("command line", "--person", "a place in meters", args.person)
    return place


_FILES = ("rig", "model", "initial_state", "occluders", "config")


def named_options(args: argparse.Namespace) -> dict[str, Any]:
    """The options of a command line by name, files and sources with their whole paths."""
    changed: dict[str, Any] = {name: Path(value) for name in _FILES if (value := getattr(args, name))}
    if changed.get("model"):
        changed["model"] = whole_name(args.model)
    if getattr(args, "source", None):
        changed["source"] = [(camera, relocated(source, Path.cwd())) for camera, source in args.source]
    return {name: _plain(value) for name, value in {**vars(args), **changed}.items() if not name.startswith("_")}


def whole_name(model: str | Path) -> str:
    """The whole path of a model's file; a word that names a body of the package stays."""
    from ...loaders.model.model_yaml import is_named

    return str(model) if is_named(model) else str(Path(model).resolve())


def _plain(value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, str):
        return without_password(value)
    if value == math.inf:
        return "all"
    return str(value.resolve()) if isinstance(value, Path) else value


EX_NOTHING_TRACKED = 3


def nothing_tracked(verb: str, counts: Mapping[str, int], reason: str, state_given: bool, body: str = "") -> int:
    """Say so where the body is tracked in no image set.

    Parameters
    ----------
    verb : that was run.
    counts : image sets by the name of their status.
    reason : what most of them say; may be empty.
    state_given : whether the run began with a state.
    body : name of one of several.

    Returns
    -------
    status : exit status; 0 where the body is tracked in at least one set, else 3.
    """
    from ...tracking.estimate import known_sets

    if known_sets(counts):
        return 0
    n = sum(counts.values())
    if not n:
        what = "no image set was formed, so nothing is tracked: look at the stamps of the cameras and at synchronizer.*"
    elif counts.get("LOST"):
        what = f"the body is LOST in all {n} image sets"
        if counts["LOST"] < n:
            what = f"the body is tracked in none of {n} image sets"
        what += f" (mostly: {reason})" if reason else ""
        likely = "the initial state is not where the body is in the first images" if state_given else "the start was wrong"
        what += f"; likely {likely}, or rig and images do not fit: {_next_step(state_given)}"
    else:
        what = f"the body was found in none of {n} image sets" + (f" ({reason})" if reason else "")
        what += f": {_next_step(state_given)}"
    print(f"tracker_node {verb}: {body and f'{body}: '}{what}", file=sys.stderr)
    return EX_NOTHING_TRACKED


def _next_step(state_given: bool) -> str:
    first = "leave out the initial state, so that the body is searched in the images"
    if not state_given:
        first = "give --initial-state (calibrate pose)"
    return f"{first}; tracker_node rig check finds faults of the rig; see docs/troubleshooting.md"


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
