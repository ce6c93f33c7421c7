"""Silhouettes of a run are those of the body in the clothes that the run has found, unless another body is named."""

import json
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.bodies.stick_person import motion, write_run
from helpers.cameras.render_scenes import look_at
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.evaluation.masks.reference import load_reference_masks
from tracker_node.evaluation.run_review import RunFiles, review_run
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.rig.rig_yaml import rig_file_of, write_rig_file
from tracker_node.model.clothes import with_surfaces
from tracker_node.model.humans.segments18 import ellipsoid_human
from tracker_node.runs.writer import BODY

N = 2


@pytest.fixture
def run(tmp_path: Path) -> RunFiles:
    """Of a person whose masks are the whole image: the IoU is the share of it that the body covers."""
    tracked = motion(N)
    lens = CameraModel(240, 180, np.array([[150.0, 0.0, 119.5], [0.0, 150.0, 89.5], [0.0, 0.0, 1.0]]))
    place = look_at((2.5, 0.5, 1.2), (0.05, 0.0, 0.9), lens, "cam01").T_world_cam
    (tmp_path / "cam01").mkdir()
    for i in range(N):
        cv2.imwrite(str(tmp_path / "cam01" / f"{i}.png"), np.full((180, 240, 3), 90, np.uint8))
    rig = CameraRig((Camera("cam01", lens, place, source="cam01"),))
    write_rig_file(rig_file_of(rig), tmp_path / "rig.yaml")
    dump_model(tracked.model, tmp_path / "model.yaml")
    whole = [0, 0, 239, 0, 239, 179, 0, 179]
    masks = {"cam01": {"image_size": [240, 180], "polygons": {str(i): [whole] for i in range(N)}}}
    (tmp_path / "masks.json").write_text(json.dumps({"cameras": masks}))
    folder = write_run(tmp_path / "run", tracked)
    named = {"model": str(tmp_path / "model.yaml"), "rig": str(tmp_path / "rig.yaml")}
    (folder / "run.json").write_text(json.dumps({**named, "image_sets": N}))
    return RunFiles(str(folder), masks=load_reference_masks(tmp_path / "masks.json"), pictures=1)


def covered(files: RunFiles) -> float:
    ious = review_run(files, lambda line: None).silhouettes.ious["cam01"]
    assert len(ious) == N
    return float(np.mean(ious))


def test_silhouettes_in_clothes(run: RunFiles, tmp_path: Path) -> None:
    model = motion(N).model
    bare, folder = covered(run), Path(run.run)
    dump_model(with_surfaces(model, np.tile([0.03, 0.0, 0.0, 0.0], (len(model.shapes), 1))), folder / BODY)
    assert covered(run) > 1.2 * bare > 0.0
    assert covered(replace(run, model=str(tmp_path / "model.yaml"))) == bare


def test_a_file_of_another_body_is_not_taken(run: RunFiles) -> None:
    bare = covered(run)
    dump_model(ellipsoid_human(), Path(run.run) / BODY)
    assert covered(run) == bare
