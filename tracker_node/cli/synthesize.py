"""``tracker_node synthesize``: a synthetic recording with exact truth."""

from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass, field, replace
from pathlib import Path

from ..synthesis.scenes.scene import SceneConfig
from .arguments.cameras import size_option

SUMMARY = "render a person in a room, seen by several cameras, with exact joint centres as truth"
EXAMPLE = (
    "tracker_node synthesize --motion swing --output out/synthetic/swing\n"
    "  tracker_node synthesize --motion walk --motions clips/ --cameras 6 --output out/synthetic/walk\n"
    "  tracker_node track --rig out/synthetic/swing/rig.yaml --model out/synthetic/swing/person.yaml"
    " --initial-state out/synthetic/swing/state.yaml --output out/swing"
)
SUBJECTS = ("mannequin", "model", "figure")
COLORS = ("clothes", "parts")
WAVES = "waves"
DEFAULT_IMAGES, FIGURE_IMAGES = 60, 100  # of motions that have no end


@dataclass(frozen=True)
class Request:
    """What to synthesize; ``motions`` is the folder of captured clips, ``n_images`` None takes the whole clip."""

    subject: str = "mannequin"
    motion: str = "swing"
    n_images: int | None = None
    rate_hz: float = 30.0
    stature: float = 1.75
    motions: str | None = None
    model: str | None = None
    colors: str = "clothes"
    scene: SceneConfig = field(default_factory=SceneConfig)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-o", "--output", required=True, metavar="FOLDER", help="where to write; made if missing")
    parser.add_argument(
        "--subject",
        choices=SUBJECTS,
        default="mannequin",
        help="mannequin: a body that is not the tracker's; model: the tracker's own; figure: ten cones in fast motion",
    )
    parser.add_argument(
        "--motion",
        default=None,
        help="swing (procedural), the name of a captured clip, the path of one, or, for --subject model, waves",
    )
    parser.add_argument(
        "--motions",
        metavar="FOLDER",
        default=default_motions(),
        help="captured clips, humanoid3d_<name>.txt (default: bullet_motions in the folder that TRACKER_SHARED_DATA names)",
    )
    parser.add_argument("--model", metavar="FILE", help="the tracker's model (default: the human that is shipped)")
    parser.add_argument(
        "--colors",
        choices=COLORS,
        default=COLORS[0],
        help="of the mannequin: clothes and skin, or a suit in the colors of the model's parts (default: %(default)s)",
    )
    parser.add_argument("--images", type=int, metavar="N", help="images per camera (default: the whole clip)")
    parser.add_argument("--rate", type=float, default=30.0, metavar="HZ", help="images per second (default: %(default)s)")
    parser.add_argument("--stature", type=float, default=1.75, metavar="M", help="of the mannequin (default: %(default)s)")
    scene = SceneConfig()
    parser.add_argument("--cameras", type=int, default=scene.n_cameras, metavar="N", help="default: %(default)s")
    parser.add_argument(
        "--size", default=f"{scene.width}x{scene.height}", metavar="WxH", help="of the images (default: %(default)s)"
    )
    parser.add_argument(
        "--noise", type=float, default=scene.noise_levels, metavar="LEVELS", help="sensor noise (default: %(default)s)"
    )
    parser.add_argument("--blur", type=float, default=scene.blur_px, metavar="PX", help="of the optics (default: %(default)s)")
    parser.add_argument("--no-distortion", action="store_true", help="lenses without distortion")
    parser.add_argument("--no-shadow", action="store_true", help="the subject casts no shadow")
    parser.add_argument(
        "--surroundings", choices=("room", "clutter"), default=scene.surroundings, help="clutter: strongly colored patterns"
    )
    parser.add_argument("--no-backgrounds", action="store_true", help="the empty room is not recorded")
    parser.add_argument("--lossless", action="store_true", help="images as PNG rather than JPEG")
    parser.add_argument("--seed", type=int, default=scene.seed, help="of noise and rig (default: %(default)s)")
    parser.add_argument("--force", action="store_true", help="render again even if the folder holds this very recording")


def default_motions() -> str | None:
    """Folder of captured clips beside the other recordings that TRACKER_SHARED_DATA names, if there is one."""
    named = os.environ.get("TRACKER_SHARED_DATA")
    folder = Path(named) / "bullet_motions" if named else None
    return str(folder) if folder is not None and folder.is_dir() else None


def run(args: argparse.Namespace) -> int:
    request = Request(
        subject=args.subject,
        motion=args.motion or (WAVES if args.subject == "model" else "swing"),
        n_images=args.images,
        rate_hz=args.rate,
        stature=args.stature,
        motions=args.motions,
        model=args.model,
        colors=args.colors,
        scene=_scene(args),
    )
    made = produce(request, args.output, force=args.force, progress=show_progress)
    folder = Path(args.output)
    print(f"{'wrote' if made else 'already there:'} {folder}")
    names = {"rig": "rig.yaml", "model": "person.yaml", "first pose": "state.yaml", "truth": "truth.csv"}
    print("  " + ", ".join(f"{what} {folder / name}" for what, name in names.items()))
    return 0


def _scene(args: argparse.Namespace) -> SceneConfig:
    from ..errors import FileFormatError

    width, height = size_option("--size", args.size)
    for name, value, low in (("--cameras", args.cameras, 1), ("--images", args.images, 1), ("--rate", args.rate, 1e-3)):
        if value is not None and value < low:
            raise FileFormatError("command line", name, f"a number of at least {low}", value)
    scene = SceneConfig(
        n_cameras=args.cameras, width=width, height=height, noise_levels=args.noise, blur_px=args.blur,
        shadow=not args.no_shadow, seed=args.seed, surroundings=args.surroundings, plates=not args.no_backgrounds,
        lossless=args.lossless,
    )  # fmt: skip
    scene = replace(scene, focal_px=scene.focal_px * height / SceneConfig().height)
    return replace(scene, distortion=()) if args.no_distortion else scene


def show_progress(done: int, total: int) -> None:
    """Print the number of image sets on stderr: a line that rewrites itself, or a line every tenth when that is a file.

    Parameters
    ----------
    done, total : image sets.
    """
    if sys.stderr.isatty():
        print(f"\rrendering: image set {done} of {total}", end="\n" if done == total else "", file=sys.stderr, flush=True)
    elif 10 * done // total > 10 * (done - 1) // total:
        print(f"rendering: image set {done} of {total}", file=sys.stderr, flush=True)


def produce(request: Request, folder: str | Path, force: bool = False, progress=lambda done, total: None) -> bool:
    """Make a recording, unless the folder holds it already.

    Besides what `synthesis.dataset.record` writes there are ``person.yaml``, the tracker's model scaled to the subject by its
    static trial, and ``state.yaml``, the pose in the first image set.

    Parameters
    ----------
    request : subject, motion and scene.
    folder : of the recording.
    force : make it again.
    progress : called with the number of sets done and of all.

    Returns
    -------
    made : False where the folder holds it.
    """
    from ..loaders.model.model_yaml import dump_model
    from ..loaders.model.state_yaml import dump_state
    from ..synthesis.dataset import describe, is_recorded, record

    make = {"mannequin": _mannequin, "model": _own_model, "figure": _figure}[request.subject]
    sequence, body = make(request)
    folder = Path(folder)
    if not force and is_recorded(folder, describe(sequence, request.scene)) and (folder / "state.yaml").exists():
        return False
    record(sequence, request.scene, folder, progress)
    model, state = body(folder)
    dump_model(model, folder / "person.yaml", comment="The tracker's model of the subject of this recording.")
    dump_state(state, model, folder / "state.yaml", comment="Pose in the first image set.")
    return True


def _load_model(path: str | None):
    from ..loaders.model.model_yaml import load_model
    from ..model.humans.human import human_model

    return load_model(path) if path else human_model()


def _mannequin(request: Request):
    """The recording to be made, and what gives the model and its first pose from the recorded folder."""
    from ..calibration.body import ScalingOptions, scale_to_trial
    from ..calibration.pose import fit_state_to_landmarks
    from ..loaders.motion.trajectory_file import read_joints
    from ..loaders.motion.trc import load_trc
    from ..synthesis.motions.deepmimic import load_motion
    from ..synthesis.sequences import mannequin_sequence

    motion = load_motion(request.motion, request.rate_hz, request.n_images, request.motions)
    colors = {shape.name: shape.color_rgb for shape in _load_model(request.model).shapes} if request.colors == "parts" else None

    def body(folder: Path):
        exact = ScalingOptions(joint_sigma_m=0.0, symmetric=False)  # the trial's joints are the subject's own
        model = scale_to_trial(_load_model(request.model), load_trc(folder / "static.trc"), exact).model
        truth = read_joints(folder / "truth.csv")
        targets = dict(zip(truth.names, truth.positions_m[0], strict=True))
        return model, fit_state_to_landmarks(model, targets).state

    return mannequin_sequence(motion, request.stature, colors), body


def _own_model(request: Request):
    """As `_mannequin`; the subject is the model, so nothing has to be fitted."""
    from ..synthesis.sequences import model_sequence
    from ..synthesis.subjects.cones import waves

    model = _load_model(request.model)
    if request.motion == WAVES:
        states = waves(model, request.rate_hz, request.n_images or DEFAULT_IMAGES)
    else:
        states = _imitated(model, request)
    return model_sequence(model, states, request.rate_hz), lambda folder: (model, states[0])


def _figure(request: Request):
    """As `_own_model`, of the figure of ten cones in its own motion."""
    from ..synthesis.sequences import model_sequence
    from ..synthesis.subjects.figure import figure_model, figure_motion

    model, states = figure_model(), figure_motion(request.rate_hz, request.n_images or FIGURE_IMAGES)
    return model_sequence(model, states, request.rate_hz, "figure"), lambda folder: (model, states[0])


def _imitated(model, request: Request) -> list:
    """States in which the model does what the mannequin does in a motion."""
    from ..calibration.pose import fit_state_to_landmarks
    from ..synthesis.motions.deepmimic import load_motion
    from ..synthesis.subjects.mannequin import LANDMARKS, MannequinSubject

    motion = load_motion(request.motion, request.rate_hz, request.n_images, request.motions)
    states: list = []
    for body in MannequinSubject(request.stature).follow(motion):
        targets = {name: p for name, p in zip(LANDMARKS, body.landmarks, strict=True) if name in model.landmark_names}
        states.append(fit_state_to_landmarks(model, targets, states[-1] if states else None).state)
    return states
