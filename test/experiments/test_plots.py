"""Figures of the color experiments show the numbers and pixels that they are given."""

import numpy as np
import pytest

from helpers.bodies.two_links import cameras, two_links
from tracker_node.camera.light import Light
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.experiments.plots import (
    Profile,
    bgr_of,
    bodies_figure,
    body_box,
    convergence_figure,
    matching_figure,
    plan_figure,
    save,
    sequence_figure,
    success_figure,
)
from tracker_node.model.configuration import Configuration, State
from tracker_node.render.renderer import ColoredView
from tracker_node.synthesis.scenes.scene import looking_at

LENS = CameraModel(60, 40, np.array([[60.0, 0.0, 29.5], [0.0, 60.0, 19.5], [0.0, 0.0, 1.0]]))


def camera(name, *place, target=(0.0, 0.0, 1.0)):
    return Camera(name, LENS, looking_at(np.array(place, dtype=float), np.array(target)))


def body_image(top, bottom, left, right, color=(10, 20, 30)):
    image = np.zeros((40, 60, 3), np.uint8)
    image[top:bottom, left:right] = color
    return image


def drawn(u, v, rgb):
    """Six by four pixels of one color."""
    labels = np.ones((4, 6), np.uint8)
    return ColoredView(region=(u, v, u + 6, v + 4), labels=labels, depth=np.ones((4, 6)), rgb=np.full((4, 6, 3), rgb))


@pytest.mark.parametrize(
    ("rows", "columns", "margin", "box"),
    [
        ((10, 20), (30, 40), 0, (10, 20, 30, 40)),
        ((10, 20), (30, 40), 5, (5, 25, 25, 45)),
        ((3, 38), (2, 59), 5, (0, 40, 0, 60)),
        ((7, 8), (9, 10), 0, (7, 8, 9, 10)),
        ((0, 0), (0, 0), 5, (0, 40, 0, 60)),
    ],
)
def test_the_box_about_a_body(rows, columns, margin, box):
    mask = np.zeros((40, 60), dtype=bool)
    mask[slice(*rows), slice(*columns)] = True
    assert body_box(mask, margin) == box


def test_a_drawn_body_lies_in_its_region():
    image = bgr_of(drawn(10, 20, (300.0, 19.6, -5.0)), camera("a", 0, -3, 1))
    assert image.shape == (40, 60, 3)
    assert np.all(image[20:24, 10:16] == (0, 20, 255))
    image[20:24, 10:16] = 0
    assert not image.any()


def test_convergence_has_a_panel_for_each_pair_and_a_curve_for_each_variable():
    x = np.linspace(-3.0, 3.0, 7)
    panels = {"one": {"a": Profile(x, x**2), "b": Profile(x, 2 * x**2)}, "two": {"a": Profile(x, 3 * x**2)}}
    figure = convergence_figure(panels, "mm")
    assert [ax.get_title() for ax in figure.axes] == ["one", "two"]
    curves = [[line for line in ax.lines if len(line.get_xdata()) == 7] for ax in figure.axes]
    assert [[line.get_label() for line in one] for one in curves] == [["a", "b"], ["a"]]
    assert np.array_equal(curves[0][1].get_ydata(), 2 * x**2)
    assert np.array_equal(curves[1][0].get_xdata(), x)
    assert figure.axes[0].get_xlabel() == "difference from the true value [mm]"
    assert figure.axes[0].get_ylim()[0] == 0.0
    assert figure.axes[0].lines[-1].get_xdata()[0] == 0.0
    assert figure.axes[0].get_legend() is not None
    assert figure.axes[1].get_legend() is None


def test_success_is_a_share_by_the_start():
    (ax,) = success_figure(["small", "large"], {"a": [1.0, 0.5], "b": [0.9, 0.1]}).axes
    assert [list(line.get_ydata()) for line in ax.lines] == [[1.0, 0.5], [0.9, 0.1]]
    assert [label.get_text() for label in ax.get_xticklabels()] == ["small", "large"]
    assert [list(line.get_xdata()) for line in ax.lines] == [[0, 1], [0, 1]]
    assert len({line.get_marker() for line in ax.lines}) == 2
    assert ax.get_ylim() == pytest.approx((-0.03, 1.03))


def test_a_sequence_is_cut_to_the_widest_body_and_keeps_heights():
    """Bodies 10 and 20 wide, at heights 10..20 and 5..15 of the image: 33 rows no, 27 with margins of 6."""
    images = [body_image(10, 20, 20, 30), body_image(8, 15, 25, 45)]
    strip = np.asarray(sequence_figure({"row": images}).axes[0].images[0].get_array())
    half = (20 + 12) // 2 + 1
    assert strip.shape == (26 - 2, 4 * half, 3)  # rows 2 to 26
    inside = np.all(strip == (30, 20, 10), axis=2)
    assert inside.sum() == 100 + 140
    assert np.all(strip[~inside] == 255)
    rows, columns = np.nonzero(inside)
    assert (rows.min(), rows.max() + 1) == (6, 18)
    for i in range(2):  # each body in the middle of its piece
        own = columns[(columns >= 2 * half * i) & (columns < 2 * half * (i + 1))] - 2 * half * i
        assert 0.5 * (own.min() + own.max() + 1) == pytest.approx(half, abs=1)


def test_rows_of_a_sequence_have_titles_and_heights_as_their_pictures():
    figure = sequence_figure({"a": [body_image(10, 20, 20, 30)], "b": [body_image(5, 35, 20, 30)] * 3})
    assert [ax.get_title(loc="left") for ax in figure.axes] == ["a", "b"]
    shapes = [ax.images[0].get_array().shape for ax in figure.axes]
    ratios = figure.axes[0].get_subplotspec().get_gridspec().get_height_ratios()
    assert ratios[1] / ratios[0] == pytest.approx(shapes[1][0] / shapes[0][0])
    width = max(shape[1] for shape in shapes)
    assert figure.get_size_inches() == pytest.approx([10.5, sum(s[0] for s in shapes) * 10.5 / width + 0.64])


@pytest.mark.parametrize("on_black", [True, False])
def test_a_match_in_five_panels(on_black):
    """The generated body is 6 by 4 at (20, 18); the target another 8 to the right, by 3 gray levels another."""
    one = camera("a", 0, -3, 1)
    view = drawn(20, 18, (100.0, 100.0, 100.0))
    target = np.full((40, 60, 3), 0 if on_black else 200, np.uint8)
    target[18:22, 20:34] = 110
    figure = matching_figure(target, view, one)
    panels = [np.asarray(ax.images[0].get_array()) for ax in figure.axes]
    box = body_box(target.max(axis=2) == 110, 25) if on_black else body_box(panels_mask(), 25)
    cut = slice(box[0], box[1]), slice(box[2], box[3])
    mask = panels_mask()[cut]
    assert [ax.get_title()[:3] for ax in figure.axes] == ["(a)", "(b)", "(c)", "(d)", "(e)"]
    assert np.array_equal(panels[0], target[cut])
    assert np.array_equal(panels[1], np.where(mask[:, :, None], 100, np.zeros((*mask.shape, 3))))
    assert np.array_equal(panels[2], np.where(mask, 255, 0))
    assert np.array_equal(panels[3], np.where(mask[:, :, None], 110, np.zeros((*mask.shape, 3))))
    assert np.allclose(panels[4], np.where(mask, 255.0 - 20.0, 0.0))


def panels_mask():
    mask = np.zeros((40, 60), dtype=bool)
    mask[18:22, 20:26] = True
    return mask


def test_the_scene_from_above():
    level, above = camera("level", 4, 0, 1), Camera("above", LENS, np.diag([1.0, -1.0, -1.0, 1.0]))
    path = np.column_stack([np.linspace(-1, 1, 5), np.zeros(5), np.full(5, 7.0)])
    lights = (Light("point", position=(1, 2, 3)), Light("directional", direction=(0, 0, -1)), Light("ambient"))
    (ax,) = plan_figure(CameraRig((level, above), lights=lights), {"way": path}).axes
    lines = [np.array(line.get_xydata()) for line in ax.lines]
    assert np.array_equal(lines[-1], path[:, :2])
    assert ax.lines[-1].get_label() == "way"
    places = {tuple(line[0]) for line in lines if len(line) == 1}
    assert places == {(4.0, 0.0), (0.0, 0.0), (1.0, 2.0)}
    edges = [line for line in lines if len(line) == 2]
    assert len(edges) == 2  # of the level camera's view
    for edge, sign in zip(edges, (1, -1), strict=True):
        assert edge[0].tolist() == [4.0, 0.0]
        assert np.linalg.norm(edge[1] - edge[0]) == pytest.approx(1.15 * 4.0)
        towards = (edge[1] - edge[0]) / 4.6
        assert abs(towards[1]) == pytest.approx(np.sin(np.arctan(0.5)))  # 30 of 60 pixels to either side
        assert towards[0] < 0.0
        assert sign * towards[1] * edges[0][1][1] > 0.0
    assert {text.get_text() for text in ax.texts} == {"level", "above", "point"}
    assert plan_figure(CameraRig((level,)), {}).axes[0].get_legend() is None


def test_figures_are_written_to_new_folders(tmp_path):
    path = tmp_path / "a" / "b" / "figure.png"
    save(success_figure(["one"], {"a": [1.0]}), path, 20)
    assert path.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_bodies_stand_side_by_side_from_every_camera():
    arm = Configuration(two_links(), State.neutral(two_links()))
    rig = CameraRig(tuple(cameras()))
    figure = bodies_figure({"one": arm, "other": arm}, rig)
    assert [ax.get_title() for ax in figure.axes] == ["one,\nfront", "one,\nside", "other,\nfront", "other,\nside"]
    pictures = [np.asarray(ax.images[0].get_array()) for ax in figure.axes]
    assert len({picture.shape[0] for picture in pictures}) == 1  # of one height
    assert np.array_equal(pictures[0], pictures[2])
    for picture in pictures:
        body = picture.min(axis=2) < 255
        columns = np.flatnonzero(body.any(axis=0))
        assert (columns[0], picture.shape[1] - 1 - columns[-1]) == (12, 12)
    widths = figure.axes[0].get_subplotspec().get_gridspec().get_width_ratios()
    assert list(widths) == [picture.shape[1] for picture in pictures]
    assert figure.get_size_inches() == pytest.approx([5.6 * sum(widths) / pictures[0].shape[0], 6.0])
