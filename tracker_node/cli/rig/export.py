"""``tracker_node rig export``: a rig in other programs' formats."""

from __future__ import annotations

import argparse
from pathlib import Path

from ..arguments.run_images import refuse_to_overwrite

SUMMARY = "write a rig in another program's format, and say what that cannot hold"
EXAMPLE = (
    "tracker_node rig export rig.yaml --to pose2sim -o Calib.toml\n  tracker_node rig export rig.yaml --to camera_info -o lenses/"
)
FORMATS = ("pose2sim", "anipose", "caliscope", "camera_info", "opencv", "qualisys", "dlt")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("rig", metavar="RIG", help="rig.yaml")
    parser.add_argument("--to", required=True, choices=FORMATS, help="the format")
    parser.add_argument(
        "-o", "--output", required=True, metavar="PATH", help="file to write (camera_info: folder, one file per camera)"
    )
    parser.add_argument("--force", action="store_true", help="overwrite the output")


def run(args: argparse.Namespace) -> int:
    from ...loaders.rig import formats as rig_formats
    from ...loaders.rig.rig_yaml import build_rig, read_rig_file

    rig_file = read_rig_file(args.rig)
    rig = build_rig(rig_file, Path(args.rig).parent)
    refuse_to_overwrite(args, *_written(rig, args))
    _write(rig, args.to, Path(args.output))
    print(f"wrote {args.output}")
    target = {"camera_info": rig_formats.CAMERA_INFO, "dlt": rig_formats.DLT}.get(args.to, args.to)
    dropped = rig_formats.dropped(rig_file, target)
    if dropped:
        print(f"Not in it, since {args.to} cannot hold it: " + "; ".join(dropped) + ".")
    return 0


def _written(rig, args: argparse.Namespace) -> list[str]:
    if args.to != "camera_info":
        return [args.output]
    return [str(Path(args.output) / f"{camera.name}.yaml") for camera in rig]


def _write(rig, target: str, output: Path) -> None:
    from ...calibration.points.dlt import dlt_parameters
    from ...loaders.rig.calibration_toml import dump_calibration_toml
    from ...loaders.rig.camera_info import dump_camera_info
    from ...loaders.rig.dlt_text import dump_dlt
    from ...loaders.rig.opencv_storage import dump_opencv
    from ...loaders.rig.qualisys_xml import dump_qualisys

    (output if target == "camera_info" else output.parent).mkdir(parents=True, exist_ok=True)
    if target == "camera_info":
        for camera in rig:
            dump_camera_info(camera.name, camera.model, output / f"{camera.name}.yaml")
    elif target == "opencv":
        dump_opencv(rig, output)
    elif target == "qualisys":
        dump_qualisys(rig, output)
    elif target == "dlt":
        dump_dlt([dlt_parameters(camera) for camera in rig], output)
    else:
        dump_calibration_toml(rig, output, target)
