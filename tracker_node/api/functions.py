"""A recording tracked, a run compared with truth, a run exported: each one call, as the verbs of the command line do it."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..errors import TrackerError
from ..evaluation.evaluate import EvaluationOptions
from ..evaluation.motion.run_export import ExportRequest, export_run, format_of
from ..evaluation.review import review
from ..evaluation.truth.files import truth_of
from ..loaders.recording_yaml import load_recording
from ..runs.images import first_image_of
from ..runs.load import load_run
from ..runs.offline import JoiningRun, OfflineRun, Progress, run_together
from .recording import Recording, joining_of, open_recording, recordings_of
from .run import Run, unwritten
from .run import load_run as open_run


def track(recording: Recording | str | Path, output: str | Path | None = None, progress: Progress | None = None) -> Run:
    """Track a body through all image sets of a recording, as ``tracker_node track`` does.

    Where the stamps go backward, the tracker starts again. Sources that cannot be used, and images that break off, are
    warnings as long as something could be tracked.

    Parameters
    ----------
    recording : see `Recording`; or a ``recording.yaml``.
    output : folder for bag, ``states.csv``, ``joints.csv``, ``poses.csv`` and ``run.json``; None: nothing is kept on disk.
    progress : called after every image set with the number done, the number expected (or None) and the estimate.

    Returns
    -------
    The run, with one state per image set.

    Raises
    ------
    TrackerError : nothing can be tracked: no source, images of another size than the calibration, a run in ``output``.

    Examples
    --------
    >>> run = track("recording.yaml", "out/run")  # doctest: +SKIP
    >>> run.joint_angles().to_csv("angles.csv")  # doctest: +SKIP
    """
    if not isinstance(recording, Recording):
        recording = open_recording(recording)
    if output is not None:
        return _tracked({"": recording}, {"": Path(output)}, progress)[""]
    with tempfile.TemporaryDirectory(prefix="tracker_node-") as folder:
        run = _tracked({"": recording}, {"": Path(folder) / "run"}, progress)[""]
        return Run(unwritten(run.data), run.model)


def track_bodies(
    recordings: Mapping[str, Recording] | str | Path, output: str | Path, progress: Progress | None = None
) -> dict[str, Run]:
    """Track several bodies in the same images, each of which knows of the others, as ``tracker_node track`` does.

    Parameters
    ----------
    recordings : by the name of the body, see `open_bodies`; or a ``recording.yaml``. Cameras, images and points are those of the
        first. People join where the file says so.
    output : folder; the run of each body goes into a folder of its name there.
    progress : of `track`, with the estimate of whichever body is worst off.

    Returns
    -------
    By the name of the body, its run, also of who has joined.

    Raises
    ------
    TrackerError : of `track`; nobody has joined, and there was nobody else.

    Examples
    --------
    >>> runs = track_bodies("recording.yaml", "out/two")  # doctest: +SKIP
    """
    joining = None
    if not isinstance(recordings, Mapping):
        file = load_recording(recordings)
        recordings, joining = recordings_of(file), joining_of(file, Path(output))
    return _tracked(recordings, {name: Path(output) / name for name in recordings}, progress, joining)


def _tracked(
    recordings: Mapping[str, Recording], outputs: Mapping[str, Path], progress: Progress | None,
    joining: JoiningRun | None = None,
) -> dict[str, Run]:  # fmt: skip
    problems: list[str] = []
    runs = {name: OfflineRun(**vars(each), asked=each.named_options()) for name, each in recordings.items()}
    summaries = run_together(runs, outputs, progress, problems.append, joining)
    errors = [error for summary in summaries.values() for error in summary["errors"]]
    for sentence in dict.fromkeys([*problems, *errors]):
        warnings.warn(sentence, stacklevel=3)
    if not any(summary["image_sets"] for summary in summaries.values()):
        raise TrackerError("; ".join(dict.fromkeys(errors)) or "no image set was formed from the images of the recording")
    found = {name: Run(load_run(outputs[name]), each.model) for name, each in recordings.items()}
    for name in (name for name in summaries if name not in recordings):
        assert joining is not None
        found[name] = open_run(joining.output / name)
    return found


def evaluate(
    run: Run,
    truth: str | Path | Sequence[str | Path] = (),
    *,
    y_up: bool | None = None,
    align: str = "auto",
    lag_images: float | None = None,
    first_image: int | None = None,
    image_sets: int = 0,
) -> dict[str, float | int]:
    """Metrics of a run, as ``tracker_node evaluate`` computes them; those of silhouettes need the command.

    Parameters
    ----------
    run : from `track` or `load_run`.
    truth : file with positions (``.trc``, ``.c3d``, ``.csv``) or degrees of freedom (``.mot``, ``.sto``, ``.csv``), or one of
        each; empty: only what the run says of itself.
    y_up : axes of the files; None: C3D as it says itself, the others have y up.
    align : "stamp": both count the same time; "first": the truth's first row belongs to image 0; "auto".
    lag_images : constant lag of the images behind the truth, in images; None: estimated.
    first_image : number of the image that the first set shows; None: as ``run.json`` says, or 0.
    image_sets : number of sets that there should be; 0: as run and stamps say.

    Returns
    -------
    Metric -> value, such as ``mpjpe_mm``, ``lost_sets``; the unit ends the name. docs/results.md describes them.

    Raises
    ------
    FileFormatError : run and truth have no joint, or no time, in common.
    ValueError : a lag that is no number, or another way to align.

    Examples
    --------
    >>> evaluate(run, "markers.trc")["mpjpe_mm"]  # doctest: +SKIP
    """
    paths = [truth] if isinstance(truth, (str, Path)) else list(truth)
    first = first_image_of(run.info) if first_image is None else first_image
    options = EvaluationOptions("run", lag_images, align, image_sets, first)
    found = review(run.data, run.model, truth_of([str(path) for path in paths], y_up, run.model), options)
    return {key.removeprefix("run."): value for key, value in found.metrics().items()}


def export(
    run: Run,
    output: str | Path,
    to: str | None = None,
    *,
    overwrite: bool = False,
    landmarks: Sequence[str] = (),
    marker_names: str | None = None,
    coordinates: str | None = None,
    isb_angles: bool = False,
    link: str | None = None,
    lost: str = "gap",
    up: str | None = None,
    length: str | None = None,
    angle: str | None = None,
    rate_hz: float | None = None,
    filter_hz: float | str | None = None,
) -> list[str]:
    """Write a run for another program, as ``tracker_node export`` does.

    Parameters
    ----------
    run : from `track` or `load_run`.
    output : file to write; for CSV a folder of tables.
    to : "trc", "mot", "sto", "c3d", "bvh", "tum" or "csv"; None: by the suffix of ``output``.
    overwrite : replace what is there.
    landmarks : only these (TRC, C3D, CSV); joints of their own for these (BVH).
    marker_names : "model", or "openpose" for the names of OpenPose and Pose2Sim (TRC, C3D, CSV).
    coordinates : "model", or "opensim" for coordinates of OpenSim's models of a person (MOT, STO, CSV).
    isb_angles : also joint angles after the ISB (C3D, CSV).
    link : whose pose is written (TUM); None: the root.
    lost : states that are LOST are a gap ("gap"), single limbs too ("limbs"), or are kept ("keep").
    up : "y" or "z"; None: y for TRC, MOT, STO and BVH, else z.
    length : "m", "cm" or "mm"; None: mm for C3D, else m.
    angle : "deg" or "rad"; None: deg.
    rate_hz : resample to this rate; None: the run's.
    filter_hz : cutoff of a low-pass filter without lag; "auto": chosen by residual analysis; None: no filter.

    Returns
    -------
    What was done to the motion, and what the format could not hold, a sentence each.

    Raises
    ------
    FileFormatError : an option that the format has no use for.
    TrackerError : ``output`` is there already.

    Examples
    --------
    >>> export(run, "run.trc")  # doctest: +SKIP
    >>> export(run, "tables", "csv", isb_angles=True, filter_hz=6.0)  # doctest: +SKIP
    """
    output = Path(output)
    to = format_of(to, output)
    taken = output.exists() and (to != "csv" or not output.is_dir() or any(output.iterdir()))
    if taken and not overwrite:
        raise TrackerError(f"{output} is there already; give another output, or overwrite=True")
    request = ExportRequest(
        landmarks=tuple(landmarks),
        marker_names=marker_names,
        coordinates=coordinates,
        isb_angles=isb_angles,
        link=link,
        lost=lost,
        up=up,
        length=length,
        angle=angle,
        rate_hz=rate_hz,
        filter_hz=filter_hz,
    )
    return export_run(run.data, run.model, output, to, request).notes
