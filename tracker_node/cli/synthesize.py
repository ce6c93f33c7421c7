"""``tracker_node synthesize``: a synthetic recording with exact truth."""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from .arguments.cameras import size_option

if TYPE_CHECKING:
    from ..synthesis.scenes.scene import SceneConfig

SUMMARY = "render a person in a room, seen by several cameras, with exact joint centers as truth"
EXAMPLE = (
    "tracker_node synthesize --motion swing --output out/synthetic/swing\n"
    "  tracker_node synthesize --motion walk --motions clips/ --cameras 6 --output out/synthetic/walk\n"
    "  tracker_node track --rig out/synthetic/swing/rig.yaml --model out/synthetic/swing/person.yaml"
    " --initial-state out/synthetic/swing/state.yaml --output out/swing"
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    from ..synthesis.recording import COLORS, SUBJECTS, default_motions
    from ..synthesis.scenes.scene import SceneConfig

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
    parser.add_argument("--no-backgrounds", action="store_true", help="no images of the background are recorded")
    parser.add_argument("--lossless", action="store_true", help="images as PNG rather than JPEG")
    parser.add_argument("--seed", type=int, default=scene.seed, help="of noise and rig (default: %(default)s)")
    parser.add_argument("--force", action="store_true", help="render again even if the folder holds this very recording")


def run(args: argparse.Namespace) -> int:
    from ..synthesis.recording import WAVES, Request, produce, show_progress

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
    from ..synthesis.scenes.scene import SceneConfig

    width, height = size_option("--size", args.size)
    for name, value, low in (("--cameras", args.cameras, 1), ("--images", args.images, 1), ("--rate", args.rate, 1e-3)):
        if value is not None and value < low:
            raise FileFormatError("command line", name, f"a number of at least {low}", value)
    scene = SceneConfig(
        n_cameras=args.cameras, width=width, height=height, noise_levels=args.noise, blur_px=args.blur,
        shadow=not args.no_shadow, seed=args.seed, surroundings=args.surroundings, backgrounds=not args.no_backgrounds,
        lossless=args.lossless,
    )  # fmt: skip
    scene = replace(scene, focal_px=scene.focal_px * height / SceneConfig().height)
    return replace(scene, distortion=()) if args.no_distortion else scene
