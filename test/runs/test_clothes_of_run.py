"""Masks, overlays and body.yaml of a run in which surfaces were followed, and of one in which they were not."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from helpers.ros.samples import moving_state, small_rig, some_estimate, tracked_arm
from tracker_node.loaders.bag.reader import BagReader
from tracker_node.loaders.bag.writer import BagExistsError
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.model.clothes import with_surfaces
from tracker_node.model.configuration import Configuration
from tracker_node.observation.image_set import CameraImage, ImageSet
from tracker_node.render.raycast.raycaster import render_mask
from tracker_node.runs.outputs import CAMERA_OUTPUTS, Tracked, recorded
from tracker_node.runs.writer import BODY, RunWriter
from tracker_node.tracking.estimate import Status, TrackEstimate

ARM = tracked_arm()
STAMP_NS = 1_000_000_000
THICK = np.tile([0.03, 0.0, 0.0, 0.0], (len(ARM.shapes), 1))


def estimate(surfaces: np.ndarray | None, status: Status = Status.TRACKING, stamp_ns: int = STAMP_NS) -> TrackEstimate:
    return replace(some_estimate(ARM, stamp_ns), status=status, state=moving_state(ARM, 0), surfaces=surfaces)


def images(folder: Path, stamp_ns: int = STAMP_NS) -> ImageSet:
    gray = np.full((120, 160, 3), 90, np.uint8)
    return ImageSet(stamp_ns, tuple(CameraImage(name, stamp_ns, gray) for name in small_rig(folder).names))


def drawn(folder: Path, what: TrackEstimate, output: str) -> np.ndarray:
    """The pixels of an output of the first camera."""
    rig = small_rig(folder)
    (made,) = recorded(CAMERA_OUTPUTS, [output])
    content = made.content(Tracked(what, images(folder), rig, Configuration(ARM, what.state)), rig.cameras[0])
    assert content is not None
    if output == "mask":
        return np.frombuffer(content["data"], np.uint8).reshape(120, 160)
    return cv2.imdecode(np.frombuffer(content["data"], np.uint8), cv2.IMREAD_COLOR)


def test_masks_are_those_of_the_body_in_its_clothes(tmp_path: Path) -> None:
    bare, wide = (drawn(tmp_path, estimate(surfaces), "mask") for surfaces in (None, THICK))
    camera = small_rig(tmp_path).cameras[0]
    expected = render_mask(Configuration(with_surfaces(ARM, THICK), moving_state(ARM, 0)), camera)
    np.testing.assert_array_equal(wide, expected)
    assert (wide[bare > 0] > 0).all() and (wide > 0).sum() > 1.2 * (bare > 0).sum() > 0
    assert not drawn(tmp_path, estimate(THICK, Status.INITIALIZING), "mask").any()


@pytest.mark.parametrize("output", ["overlay", "masked_image"])
def test_images_are_drawn_with_clothes(tmp_path: Path, output: str) -> None:
    """Where only the clothes are, the picture is another; far from the body it is the same."""
    bare, wide = (drawn(tmp_path, estimate(surfaces), output).astype(int) for surfaces in (None, THICK))
    masks = [drawn(tmp_path, estimate(surfaces), "mask") > 0 for surfaces in (None, THICK)]
    only_clothes = masks[1] & ~masks[0]
    assert np.abs(wide - bare).max(axis=2)[only_clothes].mean() > 20.0
    beyond = cv2.dilate(masks[1].astype(np.uint8), np.ones((25, 25))) == 0
    assert np.abs(wide - bare).max(axis=2)[beyond].mean() < 0.5


def write(folder: Path, *surfaces: np.ndarray | None) -> Path:
    with RunWriter(folder / "run", small_rig(folder), ARM, masks=True) as writer:
        for i, each in enumerate(surfaces):
            writer.append(estimate(each, stamp_ns=STAMP_NS + i), images(folder, STAMP_NS + i))
    return folder / "run"


def test_a_run_leaves_the_body_as_it_was_seen_last(tmp_path: Path) -> None:
    shifted = THICK + np.array([-0.01, 0.005, 0.0, -0.005])
    run = write(tmp_path, THICK, shifted)
    seen, expected = load_model(run / BODY), with_surfaces(ARM, shifted)
    assert seen.chain.dof_names == ARM.chain.dof_names and seen.landmark_names == ARM.landmark_names
    np.testing.assert_allclose(seen.chain.offsets, ARM.chain.offsets, atol=1e-9)
    np.testing.assert_allclose(seen.landmark_positions, ARM.landmark_positions, atol=1e-9)
    camera = small_rig(tmp_path).cameras[1]
    masks = [render_mask(Configuration(model, moving_state(ARM, 0)), camera) for model in (seen, expected)]
    assert (masks[0] != masks[1]).mean() < 1e-3
    with BagReader(run / "bag") as reader:
        topic = "/tracker/cam2/mask"
        written = [reader.decode(message) for message in reader.messages([topic])]
    areas = [int((np.frombuffer(bytes(message.data), np.uint8) > 0).sum()) for message in written]
    assert areas[1] == (masks[1] > 0).sum() < areas[0]


def test_without_clothes_there_is_no_body_file(tmp_path: Path) -> None:
    assert not (write(tmp_path, None, None) / BODY).exists()


def test_a_body_that_is_there_is_not_overwritten(tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / BODY).write_text("mine")
    with pytest.raises(BagExistsError, match=BODY):
        write(tmp_path, THICK)
    assert (tmp_path / "run" / BODY).read_text() == "mine"
