"""``tracker_node import``: projects of other programs, ready to be tracked."""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterable
from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING

from .arguments.cameras import UNITS, add_pixel_map_argument
from .arguments.run_images import check, refuse_to_overwrite

if TYPE_CHECKING:
    from ..loaders.projects import ProjectTrial

SUMMARY = "make a project of Pose2Sim, Anipose, FreeMoCap, Caliscope or OpenCap ready to be tracked: rig, body and recording.yaml"
EXAMPLE = (
    "tracker_node import OpenCapData_1234 --trial squats -o squats\n"
    "  tracker_node import freemocap_data/recording_sessions/session1 --stature 1.78 -o session1"
)
PERSON, RECORDING, TRIALS = "person.yaml", "recording.yaml", "trials.yaml"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("folder", metavar="FOLDER", help="the project's folder, that of a session, or that of a trial")
    add("--trial", nargs="+", metavar="NAME", help="only these trials (default: all; each of several gets a folder)")
    add("--calibration", type=Path, metavar="FILE", help="calibration in place of the project's")
    add("--unit", choices=UNITS, help="of places in a TOML calibration (default: mm of Anipose and FreeMoCap, m of the others)")
    add_pixel_map_argument(parser)
    add("--stature", type=float, metavar="M", help="height of the person, meters (default: the project's, or 1.75)")
    add("--model", type=Path, metavar="FILE", help="body of another kind, such as an animal: its model file (default: a person)")
    add("-o", "--output", default="imported", metavar="DIR", help="folder to write (default: %(default)s)")
    add("--force", action="store_true", help="overwrite what is there")


def run(args: argparse.Namespace) -> int:
    from ..loaders.projects import find_trials
    from ..loaders.yaml_file import write_mapping

    check(args.stature is None or 0.4 <= args.stature <= 3.0, "--stature", "0.4 to 3 meters", args.stature)
    check(args.stature is None or args.model is None, "--stature", "no --model", args.stature)
    modalities = _modalities_of(args.model)
    trials = _chosen(find_trials(args.folder, args.calibration is not None), args.trial)
    output = Path(args.output)
    folders = {name: output / name if len(trials) > 1 else output for name in trials}
    together = output / (TRIALS if len(trials) > 1 else RECORDING)
    body = args.model or output / PERSON
    refuse_to_overwrite(args, together, *(folder / "rig.yaml" for folder in folders.values()), *[body] * (args.model is None))
    print(f"{len(trials)} trial{'s' * (len(trials) > 1)} of {next(iter(trials.values())).program}")
    for name, trial in trials.items():
        _write_trial(trial, name, folders[name], body, modalities, args)
    if len(trials) > 1:
        entries = {name: {"recording": f"{name}/{RECORDING}"} for name in trials}
        write_mapping({"output": "out", "trials": entries}, together, "Trials for `tracker_node batch`; see docs/own_data.md.")
    if args.model is None:
        _write_person(args, trials.values(), together, body, next(iter(folders.values())))
    else:
        points = "" if "keypoints" in modalities else " (points that a detector has found: `keypoints:` in recording.yaml)"
        print(f"wrote {together}, with {body}{points}. To track:")
    print(f"  tracker_node {'batch' if len(trials) > 1 else 'track'} {quote(str(together))}")
    return 0


def _modalities_of(model: Path | None) -> tuple[str, ...]:
    """What a body is tracked by: the built-in detector finds people."""
    from ..loaders.model.model_yaml import load_model
    from ..model.humans.keypoints import is_person

    return ("region", "keypoints") if model is None or is_person(load_model(model)) else ("region",)


def _chosen(found: list[ProjectTrial], wanted: list[str] | None) -> dict[str, ProjectTrial]:
    """Trials by the names that their folders get."""
    from ..errors import UnknownNameError

    trials = {re.sub(r"[^A-Za-z0-9_.+-]", "_", trial.name).lstrip("_.+-") or "trial": trial for trial in found}
    for given in wanted or ():
        if not any(given in (name, trial.name) for name, trial in trials.items()):
            raise UnknownNameError("trial", given, trials)
    return {name: trial for name, trial in trials.items() if wanted is None or name in wanted or trial.name in wanted}


def _write_trial(
    trial: ProjectTrial, name: str, folder: Path, body: Path, modalities: tuple[str, ...], args: argparse.Namespace
) -> None:
    from os.path import relpath

    from ..calibration.imported import rig_of_trial
    from ..calibration.video_pixels import parsed_choices
    from ..loaders.recording_yaml import write_recording
    from ..loaders.rig.rig_yaml import rig_file_of, write_rig_file

    pixels = parsed_choices("--pixel-map", args.pixel_map)
    found = rig_of_trial(trial, args.calibration, args.unit, lambda sentence: print(f"{name}: {sentence}"), pixels)
    folder.mkdir(parents=True, exist_ok=True)
    write_rig_file(rig_file_of(found.rig), folder / "rig.yaml", base_dir=".")
    files = {"rig": "rig.yaml", "model": relpath(body, folder), "output": "run"}
    write_recording(folder / RECORDING, files, modalities, found.period_s, trial.stamp_file is not None, f"From {trial.program}")
    cameras = ", ".join(f"{camera.name} ({Path(str(camera.source)).name})" for camera in found.rig)
    print(f"{name}: {cameras}, {1.0 / found.period_s:.5g} Hz")


def _write_person(args: argparse.Namespace, trials: Iterable[ProjectTrial], together: Path, body: Path, first: Path) -> None:
    from ..calibration.body import model_stature
    from ..loaders.model.model_yaml import dump_model
    from ..model.humans.human import human_model
    from ..model.variants import scaled_uniformly

    statures = [args.stature or trial.stature_m for trial in trials]
    if len(set(statures)) > 1:
        print("note: the trials are of people of several statures, and get one body; import each person with --trial")
    model = human_model(ankles=True)
    own = model_stature(model)
    stature = statures[0] or own
    dump_model(scaled_uniformly(model, stature / own), body, f"{model.name}, for a stature of {stature:.2f} m. Units: meters.")
    print(f"wrote {together}; a person of {stature:.2f} m in {body}. To measure the person, and to track:")
    print(f"  tracker_node calibrate body --from-points {quote(str(first / 'rig.yaml'))} -o {quote(str(body))} --force")
