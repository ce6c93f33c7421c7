"""A body of a person's size and its first pose: ``tracker_node calibrate body`` and ``pose``."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from ....errors import FileFormatError, TrackerError
from ...arguments.run_images import (
    add_person_argument,
    add_run_arguments,
    check,
    evidence_of,
    load_run_images,
    place_of_person,
    refuse_to_overwrite,
)
from ...arguments.verbs import Subverb

_STATURE_M = (0.4, 3.0)
_PERSON_M = 1.7
_CONTRADICTS = 0.1  # share of the stature by which that of a trial may differ
GROUPS = ("size", "length", "breadth", "girth", "section", "taper", "shift")


def _add_body_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--model", metavar="MODEL",
        help="model.yaml to start from, or gait_human, with wrists and toes (default: the human that comes with the package)",
    )  # fmt: skip
    parser.add_argument(
        "--without", nargs="+", metavar="LINK", default=[], help="the person lacks this and what hangs on it, e.g. left_shank"
    )
    parser.add_argument(
        "--replace", nargs="+", metavar="LINK=FILE", default=[],
        help="a prosthesis (URDF or model.yaml, in its own size) in the place of such a part, e.g. left_foot=prosthesis.urdf",
    )  # fmt: skip
    parser.add_argument("--trc", metavar="FILE", help="joints or markers of a static trial, TRC or C3D")
    _add_up_arguments(parser)
    parser.add_argument(
        "--stature", type=float, metavar="M", help="height of the person in meters; with --trc it fixes the girths"
    )
    parser.add_argument("--child", action="store_true", help="with --stature: in the proportions of a child of that stature")
    parser.add_argument(
        "--joint-sigma-mm",
        type=float,
        metavar="MM",
        help="systematic error of the lengths between joints: about 15 for detected joints, 2 for markers (default: as left and"
        " right differ)",
    )
    points = parser.add_argument_group("from points")
    points.add_argument(
        "--from-points", metavar="RIG", help="rig.yaml with the videos or folders of a recording in which the person is seen"
    )
    points.add_argument(
        "--keypoints", type=Path, metavar="PATH", help="points of another detector, as for track (default: the embedded one)"
    )
    points.add_argument("--keypoints-table", type=Path, metavar="FILE", help="keypoints.yaml: what they are on the body")
    points.add_argument("--keypoints-weights", type=Path, metavar="FILE", help="weights of another size of the network")
    add_person_argument(points)
    parser.add_argument("--stiff-ankles", action="store_true", help="feet do not bend at the ankles, as in Knossow et al. (2008)")
    parser.add_argument("--asymmetric", action="store_true", help="keep differences between left and right")
    parser.add_argument(
        "--states",
        metavar="CSV",
        help="states.csv of a run that tracked the static trial with MODEL: keep the body, only place its landmarks",
    )
    add_run_arguments(parser, n_sets=20)
    parser.add_argument("--rig", metavar="FILE", help="with --from-run: rig.yaml (default: what the run names)")
    parser.add_argument(
        "--only", nargs="+", metavar="GROUP", choices=GROUPS, default=GROUPS,
        help=f"with --from-run: what of the body may change, of {', '.join(GROUPS)} (default: all)",
    )  # fmt: skip
    parser.add_argument("--report", metavar="FILE", help="with --from-run: page of the fit (default: beside the output, .html)")
    parser.add_argument("-o", "--output", default="person.yaml", metavar="FILE", help="model to write (default: %(default)s)")


def _add_up_arguments(parser: argparse.ArgumentParser) -> None:
    """``--y-up`` and ``--z-up``: the axes of a file of markers."""
    up = parser.add_mutually_exclusive_group()
    up.add_argument(
        "--y-up", dest="y_up", action="store_true", default=None, help="the file has y up (OpenSim, Pose2Sim; the default of TRC;"
        " C3D says it itself)",
    )  # fmt: skip
    up.add_argument(
        "--z-up", "--no-y-up", dest="y_up", action="store_false", default=None, help="the file has z up and the axes of the world"
    )  # fmt: skip


def _run_body(args: argparse.Namespace) -> int:
    from ....calibration.body import ScalingOptions, model_stature, place_by_states, scale_to_trial
    from ....loaders.model.model_yaml import dump_model
    from ....loaders.motion.c3d_file import load_markers
    from ....model.humans.measures import unused_markers
    from ....model.variants import scaled_uniformly

    given = args.model or args.from_run
    lacks = args.without or args.replace
    check(not (args.from_run and lacks), "--without, --replace", "no --from-run, whose body has its parts")
    check(not (args.stiff_ankles and given), "--stiff-ankles", "no --model or --from-run, which have their own joints", "both")
    if args.from_run:
        return _fit_to_images(args)
    if args.from_points:
        return _from_points(args)
    for option, value in _of_points(args).items():
        check(value is None, option, "--from-points beside it", str(value))
    expected = "a TRC or C3D file, a stature with --stature, a recording with --from-points, or a run with --from-run"
    check(args.trc or args.stature, "--trc", expected)
    low, high = _STATURE_M
    check(args.stature is None or low <= args.stature <= high, "--stature", f"{low:g} to {high:g} meters", args.stature)
    check(args.joint_sigma_mm is None or 0.0 <= args.joint_sigma_mm < 1e4, "--joint-sigma-mm", "0 to 10000", args.joint_sigma_mm)
    check(not args.states or (args.model and args.trc), "--states", "--model and --trc beside it", args.states)
    refuse_to_overwrite(args, args.output)
    model, prostheses, whole = _started(args)
    # Who lacks both feet still has the stature that a whole body of this size has
    stature = args.stature and args.stature * model_stature(model) / model_stature(whole)
    sigma_m = None if args.joint_sigma_mm is None else args.joint_sigma_mm / 1000.0
    options = ScalingOptions(sigma_m, symmetric=not args.asymmetric, stature_m=stature)
    if not args.trc:
        scaled = scaled_uniformly(model, stature / model_stature(model))
    elif args.states:
        scaled = place_by_states(model, load_markers(args.trc, args.y_up), args.states, options)
        print(f"placed the landmarks of {model.name} by the states of {args.states}")
    else:
        trial = load_markers(args.trc, args.y_up)
        if said := unused_markers(trial.names, model.landmark_names):
            print(f"note: {said}")
        try:
            fit = scale_to_trial(model, trial, options)
        except TrackerError as error:
            raise FileFormatError(args.trc, "markers", "joints of the body", str(error)) from error
        scaled = fit.model
        _check_size(args, fit, fit.trial_size * model_stature(whole))
        _print_fit(fit)
        if not args.asymmetric:
            for name, meters in fit.differing.items():
                differ = f"note: left and right {name.removeprefix('left_')} differ by {1000 * meters:.0f} mm"
                print(f"{differ}, taken as an error of all lengths: mend the trial, or --asymmetric where the person is so")
    scaled = _completed(scaled, prostheses)
    dump_model(scaled, args.output, _comment(scaled.name, args))
    print(f"stature {model_stature(scaled):.3f} m; wrote {args.output}")
    return 0


def _check_size(args: argparse.Namespace, fit, stature_m: float) -> None:
    """Whether the lengths of a trial are those of a person, and of the one whose stature is given."""
    from math import log

    from ....calibration.body import SIZE_SEGMENTS
    from ....loaders.motion.trc import METERS_PER_UNIT

    low, high = _STATURE_M
    if not low <= stature_m <= high:
        wrong = {(has, says): METERS_PER_UNIT[says] / METERS_PER_UNIT[has] for has in METERS_PER_UNIT for says in METERS_PER_UNIT}
        has, says = min(wrong, key=lambda pair: abs(log(stature_m / wrong[pair] / _PERSON_M)))
        got = f"{stature_m:.4g} m: the file says {says}, its lengths look like those of {has}"
        raise FileFormatError(args.trc, "(unit)", f"a person of {low:g} to {high:g} m", got)
    if not args.stature and not any(segment.name in SIZE_SEGMENTS for segment in fit.segments):
        print("note: the trial has neither trunk nor thighs nor shanks: the person's size is a guess (--stature)")
    if args.stature and abs(stature_m / args.stature - 1.0) > _CONTRADICTS:
        print(f"note: --stature {args.stature:g} m, but the lengths of the trial are those of a person of {stature_m:.2f} m")


def _from_points(args: argparse.Namespace) -> int:
    """From the points of a recording's images."""
    from ....calibration.body import model_stature
    from ....camera.rig import check_metres
    from ....loaders.images.source import SourceOptions
    from ....loaders.model.model_yaml import dump_model
    from ....loaders.rig.rig_yaml import load_rig
    from ....report.progress import StageProgress
    from ....runs.config_file import load_config
    from ....runs.image_sets import SourceStream
    from ....runs.people.detection import people_of_sets
    from ....tracking.config import TrackerConfig
    from ....tracking.initialization.detector import body_size
    from ....tracking.keypoints.body_from_points import body_from_points

    given = args.trc or args.stature or args.states or args.rig or args.report or args.asymmetric
    check(not given, "--from-points", "no --trc, --stature, --states, --rig, --report or --asymmetric beside it")
    check(args.joint_sigma_mm is None, "--joint-sigma-mm", "--trc beside it", args.joint_sigma_mm)
    check(args.only is GROUPS, "--only", "--from-run beside it", args.only)
    check(args.sets >= 1, "--sets", "a number of at least 1", args.sets)
    near = place_of_person(args)
    refuse_to_overwrite(args, args.output)
    model, prostheses, whole = _started(args)
    config = load_config(args.config) if args.config else TrackerConfig()
    rig = load_rig(args.from_points)
    check_metres(rig.cameras, body_size(whole))  # before people are found, which takes long, and whose rays would not meet
    stream = SourceStream(rig, config.synchronizer, SourceOptions(), str(args.from_points))
    find, table = _finder(args, rig, model, config, stream)
    people = people_of_sets(stream, args.sets, find, (lambda *_: None) if args.quiet else StageProgress("calibrate body"))
    for sentence in (*stream.errors, *stream.notes):
        print(f"calibrate body: {sentence}", file=sys.stderr)
    if not any(sum(map(bool, seen)) > 1 for seen in people):
        got = f"none in {len(people)} image sets of {len(rig)} camera{'s'[: len(rig) > 1]}; --stature makes a body of a height"
        raise FileFormatError(args.from_points, "(images)", "a person in two cameras at once", got)
    fit = body_from_points(model, rig, people, table, config, near)
    name = Path(args.from_points).name
    body = _completed(fit.model, prostheses)
    dump_model(body, args.output, f"{body.name}, from points of {len(fit.rows)} image sets of {name}. Units: meters.")
    print(f"{'length':20} {'change':>7} {'sigma':>6}   %")
    for length in fit.lengths:
        print(f"{length.name:20} {100 * length.value:+7.1f} {100 * length.sigma:6.1f}")
    print(f"points of {len(fit.rows)} of {len(people)} image sets, {fit.residual_px:.1f} px off (median)")
    print(f"stature {model_stature(body):.3f} m; wrote {args.output}")
    return 0


def _started(args: argparse.Namespace):
    """The body to start from, of lost parts only the bare links that others take the places of; link -> what is put there; and
    the whole body."""
    from ....loaders.model.model_yaml import load_model
    from ....model.humans.human import human_model
    from ....model.variants import without_links

    if args.child:
        model = _child(args)
    else:
        model = load_model(args.model) if args.model else human_model(ankles=not args.stiff_ankles)
    prostheses = {}
    for text in args.replace:
        link, found, file = text.partition("=")
        check(found and link and file, "--replace", "LINK=FILE", text)
        joint = next((joint for joint in model.chain.joints if joint.child == link), None)
        check(joint, "--replace", f"a link of {model.name} but its root: {', '.join(model.chain.links[1:])}", link)
        prostheses[link] = load_model(file)
    unknown = [link for link in args.without if link not in model.chain.links[1:]]
    check(not unknown, "--without", f"links of {model.name} but its root: {', '.join(model.chain.links[1:])}", *unknown[:1])
    below = [joint.child for joint in model.chain.joints if joint.parent in prostheses]
    left = without_links(model, [*args.without, *below])
    shapes = tuple(shape for shape in left.shapes if shape.link not in prostheses)
    landmarks = tuple(landmark for landmark in left.landmarks if landmark.link not in prostheses)
    return replace(left, shapes=shapes, landmarks=landmarks), prostheses, model


def _child(args: argparse.Namespace):
    from ....model.humans.human import gait_human, human_model
    from ....model.humans.measures import CHILDREN_M, HumanMeasures

    low, high = CHILDREN_M
    check(args.stature and not args.trc and not args.from_points, "--child", "--stature alone beside it")
    check(args.model in (None, "gait_human"), "--child", "no --model but gait_human", args.model)
    check(low <= args.stature <= high, "--stature", f"{low} to {high} meters of a child", args.stature)
    measures = HumanMeasures.of_child(args.stature)
    return gait_human(measures) if args.model else human_model(measures, ankles=not args.stiff_ankles)


def _completed(model, prostheses):
    """The body with each prosthesis in its place."""
    from ....model.variants import with_part

    for link, part in prostheses.items():
        model = with_part(model, link, part)
    return model


def _of_points(args: argparse.Namespace) -> dict[str, object]:
    """Options that only ``--from-points`` knows."""
    return {
        "--keypoints": args.keypoints, "--keypoints-table": args.keypoints_table, "--keypoints-weights": args.keypoints_weights,
        "--person": args.person,
    }  # fmt: skip


def _finder(args: argparse.Namespace, rig, model, config, stream):
    """What finds people in the images, and what their points are on the body."""
    from ....model.humans.keypoints import BLAZEPOSE
    from ....runs.people.detection import DetectionOptions, PeopleDetection
    from ....runs.people.recorded import PointFiles, open_recorded_people

    if args.keypoints is None:
        check(args.keypoints_table is None, "--keypoints-table", "--keypoints beside it", "none")
        return PeopleDetection(rig, config, DetectionOptions(args.keypoints_weights)).with_people, BLAZEPOSE
    check(args.keypoints_weights is None, "--keypoints-weights", "no --keypoints beside it", str(args.keypoints))
    files = PointFiles(args.keypoints, args.keypoints_table)
    recorded = open_recorded_people(files, model, rig, rig, stream.image_numbers())
    return recorded.with_people, recorded.table


def _fit_to_images(args: argparse.Namespace) -> int:
    """From the images of a run, with its poses."""
    from ....calibration.tracked_body.body_fit import BodyFitOptions, fit_body
    from ....calibration.tracked_body.report import body_metrics, write_body_report
    from ....loaders.model.model_yaml import dump_model
    from ....report.metrics_file import write_metrics
    from ....report.progress import StageProgress

    given = args.trc or args.stature or args.states or args.from_points
    check(not given, "--from-run", "no --trc, --stature, --states or --from-points beside it")
    page = Path(args.report or Path(args.output).with_suffix(".html"))
    refuse_to_overwrite(args, args.output, page, page.with_suffix(".json"))
    run = load_run_images(args)
    options = BodyFitOptions(symmetric=not args.asymmetric, groups=tuple(args.only), config=run.config)
    progress = None if args.quiet else StageProgress("calibrate body")
    evidence = evidence_of(args.evidence, run)
    fit = fit_body(run.model, run.rig, run.sets, run.states, options, progress, evidence=evidence, velocities=run.velocities)
    comment = f"{fit.model.name}, fitted to {len(run.sets)} image sets of {args.from_run}. Units: meters, degrees."
    dump_model(fit.model, args.output, f"{comment} Format: docs/formats.md.")
    write_body_report(page, run.model, run.rig, run.sets, fit)
    write_metrics(page.with_suffix(".json"), body_metrics(fit))
    _print_parameters(fit.report)
    print(f"wrote {args.output}, {page} and {page.with_suffix('.json')}")
    return 0


def _print_parameters(report) -> None:
    print(f"{'parameter':28} {'value':>8} {'sigma':>7} {'prior':>7}   %")
    for p in report.parameters:
        print(f"{p.name:28} {100 * p.value:+8.1f} {100 * p.sigma:7.1f} {100 * p.prior_sigma:7.0f}")
    before, after = report.overall
    print(f"contours: rms {before.rms_px:.2f} -> {after.rms_px:.2f} px, {after.count} lines in {report.n_sets} image sets")


def _comment(name: str, args: argparse.Namespace) -> str:
    import os

    parts = [f"from {os.path.basename(args.model)}"] if args.model else []
    parts += [f"scaled to {os.path.basename(args.trc)}"] if args.trc else []
    parts += [f"for a stature of {args.stature:g} m"] if args.stature else []
    lines = [f"{name}, {', '.join(parts)}. Units: meters, degrees. Format: docs/formats.md."]
    if not args.model:
        lines.append("Lengths and girths: tracker_node/model/humans/measures.py names their sources.")
    return "\n".join(lines)


def _print_fit(fit) -> None:
    print(f"{'segment':20} {'measured':>9} {'expected':>9} {'used':>9}   mm")
    for segment in fit.segments:
        numbers = (segment.measured_m, segment.expected_m, segment.used_m)
        print(f"{segment.name:20} " + " ".join(f"{1000 * number:9.1f}" for number in numbers))
    print(f"size {fit.size:.3f} of the model; joints of the trial fitted to {1000 * fit.residual_m:.1f} mm")


def _add_pose_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--model", required=True, metavar="MODEL", help="model.yaml of the person")
    parser.add_argument("--trc", required=True, metavar="FILE", help="joints or markers, TRC or C3D")
    _add_up_arguments(parser)
    parser.add_argument("--row", type=int, default=0, metavar="N", help="row to fit, counted from 0 (default: %(default)s)")
    parser.add_argument("-o", "--output", default="state.yaml", metavar="FILE", help="state to write (default: %(default)s)")
    parser.add_argument("--force", action="store_true", help="overwrite the output")


def _run_pose(args: argparse.Namespace) -> int:
    from ....calibration.body import targets_of
    from ....calibration.pose import fit_state_to_landmarks
    from ....loaders.model.model_yaml import load_model
    from ....loaders.model.state_yaml import dump_state
    from ....loaders.motion.c3d_file import load_markers

    refuse_to_overwrite(args, args.output)
    model, markers = load_model(args.model), load_markers(args.trc, args.y_up)
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


SUBVERBS = (
    Subverb(
        "body",
        "make a person's body: from the images of a recording by a detector's points, scaled to the joints of a static trial"
        " (TRC, C3D) or to stature, or fitted to the images of a run",
        "tracker_node calibrate body --from-points rig.yaml -o person.yaml\n"
        "  tracker_node calibrate body --trc static.trc --y-up -o scaled.yaml\n"
        "  tracker_node track --rig rig.yaml --model scaled.yaml --initial-state start.yaml --output out/run1\n"
        "  tracker_node calibrate body --from-run out/run1 -o person.yaml",
        _add_body_arguments,
        _run_body,
    ),
    Subverb(
        "pose",
        "pose a body to one row of a TRC or C3D file: a first state to track from",
        "tracker_node calibrate pose --model person.yaml --trc joints.trc --y-up --row 0 -o start.yaml",
        _add_pose_arguments,
        _run_pose,
    ),
)
