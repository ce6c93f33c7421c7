"""Image sets of an earlier run with the states that were tracked in them: what calibration from a run starts with."""

from __future__ import annotations

import argparse
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import FileFormatError, TrackerError

if TYPE_CHECKING:
    from ...calibration.tracked_body.lines import LineEvidence
    from ...camera.rig import CameraRig
    from ...model.articulated import ArticulatedModel
    from ...model.configuration import State
    from ...observation.image_set import ImageSet
    from ...tracking.config import TrackerConfig

EVIDENCE = ("region", "silhouette")


@dataclass(frozen=True, eq=False)
class RunImages:
    """Chosen image sets of a run, with states and velocities (tangent a second), in the order of time.

    ``begins_s`` is the stamp of the run's first set, ``first_image`` the number of its images in their sources.
    """

    rig: CameraRig
    model: ArticulatedModel
    rig_path: str
    model_path: str
    config: TrackerConfig
    plates: dict[str, np.ndarray]
    sets: tuple[ImageSet, ...]
    states: tuple[State, ...]
    velocities: tuple[np.ndarray, ...]
    begins_s: float
    first_image: int

    def subset(self, rows: np.ndarray) -> RunImages:
        """Only some of the image sets."""
        sets, states, velocities = (tuple(x[i] for i in rows) for x in (self.sets, self.states, self.velocities))
        return replace(self, sets=sets, states=states, velocities=velocities)

    def evidence(self, kind: str) -> LineEvidence:
        """Of a kind of `EVIDENCE`."""
        from ...calibration.tracked_body.lines import SilhouetteEvidence
        from ...calibration.tracked_body.region_lines import RegionEvidence

        if kind == "silhouette":
            return SilhouetteEvidence(self.sets, self.config, self.plates)
        return RegionEvidence(self.sets, self.config, self.plates)


def add_run_arguments(parser: argparse.ArgumentParser, n_sets: int) -> None:
    """Arguments of every calibration from a run, and ``--force``, which goes for those from other files too."""
    parser.add_argument("--force", action="store_true", help="overwrite the output and the report")
    group = parser.add_argument_group("from a run")
    add = group.add_argument
    add("--from-run", metavar="RUN", help="folder written by track_offline, or a bag with tracked states and images")
    add("--sets", type=int, default=n_sets, metavar="N", help="image sets, spread over the run (default: %(default)s)")
    add("--evidence", choices=EVIDENCE, default=EVIDENCE[0],
        help="region: colors on either side of contours; silhouette: needs plates to be good (default: %(default)s)")  # fmt: skip
    add("--config", metavar="FILE", help="tracker parameters, for how the images are looked at (default: the run's)")
    add("--quiet", action="store_true", help="no progress on stderr")


def refuse_to_overwrite(args: argparse.Namespace, *paths: str | Path) -> None:
    """Raise a `TrackerError` for the first path that is there already, unless ``--force``.

    Even with it for a folder, and for two paths of one file, of which the second would overwrite the first.
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
            raise TrackerError(f"{path} is there already; give another --output or --report, or --force to overwrite it")


def load_run_images(args: argparse.Namespace) -> RunImages:
    """The images and states that the arguments of `add_run_arguments`, ``--rig`` and ``--model`` ask for.

    Raises
    ------
    TrackerError : a run without states, or that does not say its rig or model, or whose images are not there.
    """
    from ...loaders.images.background_file import load_plates, resized_plates
    from ...loaders.model.model_yaml import load_model
    from ...loaders.rig.rig_yaml import load_rig
    from ...runs.config_file import load_config
    from ...runs.data import load_run
    from ...runs.images import config_of_run, rig_of_run

    if args.sets < 1:
        raise FileFormatError("command line", "--sets", "a number of at least 1", args.sets)
    run = load_run(args.from_run)
    rig_path, model_path = named_file(args, run.info, "rig"), named_file(args, run.info, "model")
    model, given = load_model(model_path), rig_of_run(load_rig(rig_path), run.info, other_file=args.rig is not None)
    run.check_model(model, model_path)
    config = load_config(args.config) if args.config else config_of_run(run.info)
    chosen = chosen_rows(run, args.sets)
    rig, images = _images(run, given, [int(run.stamps_ns[i]) for i in chosen])
    found = [i for i in chosen if int(run.stamps_ns[i]) in images]
    if not found:
        raise FileFormatError(args.from_run, "(images)", "images of the tracked sets, in its bag or the rig's sources", "none")
    return RunImages(
        rig, model, str(rig_path), str(model_path), config, resized_plates(load_plates(given), rig),
        tuple(images[int(run.stamps_ns[i])] for i in found),
        tuple(_state(run, i) for i in found),
        tuple(velocity_at(run, i) for i in found),
        1e-9 * float(run.stamps_ns[0]), int((run.info.get("options") or {}).get("start") or 0),
    )  # fmt: skip


def chosen_rows(run: Any, n: int) -> list[int]:
    """Rows of a run spread over its time, of each stretch the one whose residual is least; lost ones only if all are."""
    from ...tracking.estimate import Status

    good = np.flatnonzero(run.status == int(Status.TRACKING))
    if len(good) < min(n, len(run)):
        good = np.flatnonzero(run.believed)
    if not len(good):
        raise FileFormatError(run.path, "(states)", "image sets in which the body was tracked", run.status_text)
    parts = np.array_split(good, min(n, len(good)))
    return [int(part[np.argmin(run.residual_px[part])]) for part in parts]


def velocity_at(run: Any, row: int) -> np.ndarray:
    """(n_dof,) tangent a second at a row of a run, from the rows around it in which the body was tracked."""
    first, last = (beside if 0 <= beside < len(run) and run.believed[beside] else row for beside in (row - 1, row + 1))
    seconds = 1e-9 * float(run.stamps_ns[last] - run.stamps_ns[first])
    tangent = _state(run, last).difference(_state(run, first))
    return tangent / seconds if seconds > 0.0 else np.zeros_like(tangent)


def _state(run: Any, row: int) -> State:
    from ...model.configuration import State

    return State.from_values(run.values[row])


def _images(run: Any, rig: CameraRig, stamps_ns: list[int]) -> tuple[CameraRig, dict[int, ImageSet]]:
    """The rig for the images of a run, and its image sets by stamp."""
    from ...loaders.bag.reader import BagReader
    from ...runs.images import run_stream

    if run.bag is None:
        raise FileFormatError(run.path, "(bag)", "the bag of the run, which lists the images of every state", "none")
    wanted, images = set(stamps_ns), {}
    with BagReader(run.bag) as reader:
        rig, stream = run_stream(rig, reader, run.info)
        for image_set in stream:
            if image_set.stamp_ns in wanted:
                images[image_set.stamp_ns] = image_set
                if len(images) == len(wanted):
                    break
    return rig, images


def named_file(args: argparse.Namespace, info: Any, key: str) -> str:
    """A file that the command line names, or else the run."""
    from ...runs.images import file_of

    found = getattr(args, key) or file_of(info, key)
    if found:
        return found
    raise FileFormatError("command line", f"--{key}", f"a {key} file, since the run does not name it", "nothing")


class FitProgress:
    """One line on a terminal, else one line a stage."""

    def __init__(self, program: str):
        self._program, self._began, self._stage = program, time.monotonic(), ""

    def __call__(self, what: str, done: int, total: int) -> None:
        text = f"{self._program}: fitting {what}, round {done} of {total}, {time.monotonic() - self._began:.0f} s"
        if sys.stderr.isatty():
            print(f"\r{text:<70}", end="\n" if done == total else "", file=sys.stderr, flush=True)
        elif what != self._stage or done == total:
            print(text, file=sys.stderr, flush=True)
        self._stage = what
