"""The wooden cross and its three cameras as files: clicks on control points, and images of two poses under known lights."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from tracker_node.experiments.cross.throw import control_points, cross_rig, measured_lights, twisting_somersault, yellow_stick
from tracker_node.experiments.target_images import TargetStudio
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.model.state_yaml import dump_state
from tracker_node.loaders.rig.control_points import COLUMNS
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.model.configuration import Configuration


def control_point_rows() -> list[list[str]]:
    """Exact clicks of all cameras on the same points, as the lines of the file have them."""
    points, rows = control_points(np.random.default_rng(0)), []
    for camera in cross_rig():
        for i, (point, pixel) in enumerate(zip(points, camera.project(points)[0], strict=True)):
            rows.append([camera.name, f"p{i}", *map(repr, map(float, (*point, *pixel)))])
    return rows


def write_control_points(path: Path, rows: list[list[str]] | None = None, header: tuple[str, ...] = COLUMNS) -> Path:
    """A file of `control_point_rows`, or of others."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(",".join(row) for row in [header, *(control_point_rows() if rows is None else rows)]) + "\n")
    return path


def write_lit_cross(folder: Path) -> None:
    """``rig.yaml`` with rough lights, ``body.yaml``, ``pose1.yaml``, ``pose2.yaml``, and images of two of the three cameras."""
    model, rig = yellow_stick(), cross_rig()
    rough = replace(rig, lights=measured_lights(rig.lights, np.random.default_rng(1)))
    write_rig_file(rig_file_of(rough), folder / "rig.yaml")
    dump_model(model, folder / "body.yaml")
    with TargetStudio(rig, "pyrender", supersampling=1, noise_levels=1.0) as studio:
        for k, field in enumerate((5, 25)):
            state = twisting_somersault(model).state(field)
            dump_state(state, model, folder / f"pose{k + 1}.yaml")
            (folder / f"pose{k + 1}").mkdir()
            for name, image in zip(rig.names[:2], studio.images(Configuration(model, state), None, k), strict=False):
                cv2.imwrite(str(folder / f"pose{k + 1}" / f"{name}.png"), image)
