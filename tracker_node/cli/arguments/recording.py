"""``recording.yaml`` on the command line: it fills in what the command line leaves out."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ...loaders.recording_yaml import RecordingFile


def add_recording_argument(parser: argparse.ArgumentParser, built_in: Mapping[str, Any]) -> None:
    """The positional argument for a recording, after all others.

    Parameters
    ----------
    parser : of a verb.
    built_in : options that become None where they are not given.
    """
    parser.add_argument(
        "recording",
        nargs="?",
        type=Path,
        metavar="RECORDING",
        help="recording.yaml that says all of this (docs/formats.md); options given beside it go before what it says",
    )
    parser.add_argument("--no-evaluate", action="store_true", help="even where the recording says what the run is compared with")
    parser.set_defaults(**dict.fromkeys(built_in))


def fill_in(args: argparse.Namespace, built_in: Mapping[str, Any]) -> RecordingFile | None:
    """Complete the command line from the recording, if there is one, and then from the defaults.

    Parameters
    ----------
    args : of the command line; changed in place.
    built_in : option -> default.

    Returns
    -------
    recording : None where none is given.

    Raises
    ------
    TrackerError : a mistake in the recording; no rig or no model.
    """
    from ...errors import TrackerError
    from ...loaders.recording_yaml import load_recording

    recording = load_recording(args.recording) if args.recording else None
    if recording is not None and args.no_evaluate:
        recording = recording.model_copy(update={"evaluate": None})
    said = _values(recording) if recording else {}
    values = {**built_in, **{name: value for name, value in said.items() if value is not None}}
    for name, value in values.items():
        if hasattr(args, name) and getattr(args, name) is None:
            setattr(args, name, value)
    several = recording is not None and recording.several
    if args.rig is None or (args.model is None and not several):
        raise TrackerError("what is tracked: give a recording.yaml, or --rig and --model")
    for name, (own, of_body) in by_body(args, recording).items():
        if of_body is not None and of_body.evaluate is not None:
            from ...evaluation.run_review import check_evaluation
            from ...loaders.model.model_yaml import load_model

            where = f"{args.recording}, bodies.{name}" if name else args.recording
            check_evaluation(where, of_body.evaluate, load_model(own.model) if of_body.evaluate.truth else None)
    return recording


def by_body(
    args: argparse.Namespace, recording: RecordingFile | None
) -> dict[str, tuple[argparse.Namespace, RecordingFile | None]]:
    """The command line, and the recording, as if each of several bodies were alone.

    Parameters
    ----------
    args, recording : of `fill_in`.

    Returns
    -------
    By the name of the body, without those who join; "" where there is only one.

    Raises
    ------
    TrackerError : the command line names what each body has of its own.
    """
    from ...errors import TrackerError
    from ...loaders.recording_yaml import OF_ONE_BODY

    if recording is None or not recording.several:
        return {"": (args, recording)}
    for name in OF_ONE_BODY:
        if getattr(args, name, None) is not None:
            bodies = ", ".join(recording.bodies) or "those who join"
            raise TrackerError(f"--{name.replace('_', '-')}: expected nothing beside several bodies ({bodies})")
    found: dict[str, tuple[argparse.Namespace, RecordingFile | None]] = {}
    for name, entry in recording.bodies.items():
        alone = recording.of_body(name) if not args.no_evaluate else recording.of_body(name).model_copy(update={"evaluate": None})
        own = argparse.Namespace(**vars(args))
        own.model, own.person = Path(entry.model), None if entry.person is None else list(entry.person)
        own.initial_state = None if entry.initial_state is None else Path(entry.initial_state)
        own.config = _config(args, recording, entry.config)
        own.output = None if args.output is None else Path(args.output) / name
        found[name] = own, alone
    return found


def of_those_who_join(args: argparse.Namespace, recording: RecordingFile | None) -> argparse.Namespace | None:
    """The command line as if somebody who joins were alone.

    Parameters
    ----------
    args, recording : of `fill_in`.

    Returns
    -------
    None where nobody may join.
    """
    if recording is None or recording.joining is None:
        return None
    own = argparse.Namespace(**vars(args))
    own.model, own.config = Path(recording.joining.model), _config(args, recording, recording.joining.config)
    own.person = own.initial_state = None
    return own


def _config(args: argparse.Namespace, recording: RecordingFile, of_body: str | None) -> Path | None:
    """Parameters of a body: the command line's go before its own, and those before the recording's."""
    given: Path | None = args.config if args.config != (recording.config and Path(recording.config)) else None
    return given or (Path(of_body) if of_body else args.config)


def _values(recording: RecordingFile) -> dict[str, Any]:
    """What a recording says, by the names that arguments have."""
    from ...loaders.recording_yaml import FILES

    files = {name: Path(getattr(recording, name)) if getattr(recording, name) else None for name in FILES}
    images = recording.images
    return {
        **files,
        "output": Path(recording.output),
        "cameras": list(recording.cameras) if recording.cameras else None,
        "source": _sources(recording),
        "start": images.start,
        "end": images.end,
        "rate": images.rate_hz,
        "resize": images.resize,
        "shrink": images.shrink,
        **_points(recording),
        **_joint_states(recording),
        **recording.record.model_dump(),
        "real_time": recording.real_time,
        "loop": recording.loop,
    }


def _points(recording: RecordingFile) -> dict[str, Any]:
    """Of people; ``keypoints`` are files, as `track` has them."""
    entry = recording.keypoints
    files = {"keypoints": entry.files, "keypoints_table": entry.table, "keypoints_weights": entry.weights}
    return {
        **{name: None if file is None else Path(file) for name, file in files.items()},
        "keypoints_first": entry.first,
        "keypoints_every": entry.every_sets,
        "person": None if recording.person is None else list(recording.person),
    }


def _joint_states(recording: RecordingFile) -> dict[str, Any]:
    entry = recording.joint_states
    return {} if entry is None else {"joint_states": Path(entry.file), "joint_states_topic": entry.topic}


def _sources(recording: RecordingFile) -> list[tuple[str, str]]:
    """(camera, source) of the sources that a recording names."""
    from ...loaders.rig.rig_yaml import load_rig

    cameras = load_rig(recording.rig).names if isinstance(recording.sources, str) else ()
    return list(recording.sources_of(cameras).items())


def evaluate_recording(recording: RecordingFile, args: argparse.Namespace, run: Path, output: Path) -> int:
    """Evaluate a run as the recording says, as ``tracker_node evaluate`` does.

    Parameters
    ----------
    recording : with the truth and the targets.
    args : of the command line.
    run : folder or bag.
    output : folder of the report.

    Returns
    -------
    status : exit status.
    """
    from .verbs import run_verb

    arguments = evaluation_of(recording, args, {"": run}, output)
    return run_verb(*arguments) if arguments else 0


def evaluation_of(recording: RecordingFile, args: argparse.Namespace, runs: Mapping[str, Path], output: Path) -> list[str]:
    """Command line of ``evaluate`` for runs of a recording.

    Parameters
    ----------
    recording : with the truth and the targets.
    args : of the command line.
    runs : what is added to the recording's name -> folder or bag.
    output : folder of the report.

    Returns
    -------
    arguments : the verb and its arguments; empty where the recording names no evaluation.
    """
    entry = recording.evaluate
    if entry is None:
        return []
    arguments: list[str | Path] = ["evaluate", *runs.values(), "--rig", args.rig]  # run.json has the body
    for suffix in runs:
        arguments += ["--name", f"{entry.name}{suffix}"]
    arguments += ["--align", entry.align, "--lag", str(entry.lag)]
    arguments += ["--first-image", str(args.start), "--output", output]
    if (args.start, args.end, getattr(args, "max_sets", None)) == (recording.images.start, recording.images.end, None):
        arguments += ["--image-sets", str(entry.image_sets)]  # of the whole recording
    for truth in entry.truth:
        arguments += ["--truth", truth]
    if entry.y_up is not None:
        arguments += ["--y-up" if entry.y_up else "--no-y-up"]
    if entry.masks is not None:
        arguments += ["--masks", entry.masks]
    for target in entry.targets:
        arguments += ["--target", target]
    return [str(argument) for argument in arguments]
