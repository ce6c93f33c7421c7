"""The benchmark of the box: its motion, its images, and that a few of them are tracked as told."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from benchmark.contour import box
from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import so3
from tracker_node.model.configuration import Configuration
from tracker_node.observation.image_set import ImageSet
from tracker_node.render.opengl.renderer import RendererError
from tracker_node.render.raycast.raycaster import render_mask

N = 8


@pytest.fixture(scope="module")
def film():
    """(model, rig, states, image sets)."""
    model, rig = box.box_model(), box.box_rig()
    states = box.box_states(model, N)
    try:
        return model, rig, states, list(box.image_sets(rig, model, states))
    except RendererError as error:
        pytest.skip(str(error))  # says what to install


def test_the_box_moves_as_told_and_stays_in_view():
    model, rig = box.box_model(), box.box_rig()
    states = box.box_states(model, 200)
    for before, after in pairwise(states):
        step = after.difference(before)
        assert np.linalg.norm(step[:3]) == pytest.approx(0.010)
        assert np.degrees(np.linalg.norm(step[3:6])) == pytest.approx(3.0)
    positions = np.array([state.T_world_root[:3, 3] for state in states])
    assert np.linalg.norm(positions, axis=1).max() < 0.25
    for camera in rig:
        assert np.linalg.norm(camera.center) == pytest.approx(1.1)
    turns = [np.linalg.norm(so3.log(s.T_world_root[:3, :3] @ states[0].T_world_root[:3, :3].T)) for s in states]
    assert max(turns) > np.pi / 2  # all sides are seen


def test_images_show_the_red_box_where_it_is(film):
    model, rig, states, sets = film
    for i, camera in enumerate(rig):
        mask = render_mask(Configuration(model, states[3]), camera) > 0
        image = sets[3].images[i].pixels.astype(float)
        assert image.shape == (480, 640, 3)
        red = image[..., 2] - image[..., :2].max(axis=2)
        assert red[mask].mean() > red[~mask].mean() + 40.0


@pytest.mark.parametrize(("name", "position_mm"), [("box_3cams", 0.5), ("box_1cam", 5.0)])
def test_the_box_is_tracked(film, name, position_mm):
    model, rig, states, sets = film
    cameras = box.CAMERAS[name]
    clip = box.Clip(Path(), CameraRig(tuple(rig.cameras[i] for i in cameras)), model, box.displaced(states[0]))
    shown = [ImageSet(s.stamp_ns, tuple(s.images[i] for i in cameras)) for s in sets]
    run = box.track(clip, box.configured([]), shown)
    figures = box.accuracy(run, states, name)
    assert figures[f"{name}.lost"] == 0 and figures[f"{name}.sets"] == N
    assert figures[f"{name}.position_mm"] < position_mm and figures[f"{name}.angle_deg"] < position_mm
