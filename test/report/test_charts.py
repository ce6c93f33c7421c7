"""Charts for print show the numbers of their document."""

import numpy as np
import pytest
from matplotlib.colors import to_hex
from matplotlib.figure import Figure

from tracker_node.report.charts import draw, draw_curve, height_in, label_in
from tracker_node.report.document import Bars, Block, Chart, Curve, HeatMap, Line, Moving, Scene, Strip, Strips

X = np.array([0.0, 1.0, 2.0, 4.0])


def drawn(block):
    figure = Figure()
    ax = figure.subplots()
    draw(block, ax)
    return ax


def test_heights_and_labels_leave_room_for_what_is_drawn():
    rows = ("a", "a longer name of a row")
    assert height_in(Block("k", "t")) == 0.0
    assert height_in(Chart("k", "t")) == 2.5
    assert height_in(Bars("k", "t")) == 2.9
    for kind in (Strips, HeatMap):
        one, two = height_in(kind("k", "t", rows=rows[:1])), height_in(kind("k", "t", rows=rows))
        assert one < two < 1.5 * one
        assert label_in(kind("k", "t", rows=rows)) == pytest.approx(0.2 + 0.052 * 22)
        assert label_in(kind("k", "t", rows=rows[:1])) == 0.55
    assert height_in(Strips("k", "t", rows=rows)) == pytest.approx(1.25)
    assert height_in(HeatMap("k", "t", rows=rows)) == pytest.approx(1.09)
    assert label_in(Chart("k", "t")) == 0.55


def test_what_is_no_chart_cannot_be_drawn():
    with pytest.raises(ValueError, match="expected a chart, got Block"):
        drawn(Block("k", "t"))


def test_a_chart():
    lines = (Line("a", X, X**2, "#ff0000", 2.0, dashed=True), Line("b", X, X, "#00ff00", points=True))
    ax = drawn(Chart("k", "t", "", "x", "y", lines, [(1.0, 1.5)], [(3.0, "level")], 0.0, 20.0))
    a, b, level = ax.lines
    assert np.array_equal(a.get_ydata(), X**2)
    assert np.array_equal(b.get_xdata(), X)
    assert (a.get_linestyle(), a.get_marker(), a.get_linewidth(), a.get_color()) == ("--", "", 1.5, "#ff0000")
    assert (b.get_linestyle(), b.get_marker(), b.get_label()) == ("-", "o", "b")
    assert list(level.get_ydata()) == [3.0, 3.0]
    assert [text.get_text() for text in ax.texts] == ["level"]
    assert ax.get_ylim() == pytest.approx((0.0, 20.6))
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("x", "y")
    (band,) = ax.patches
    assert (band.get_x(), band.get_width()) == (1.0, 0.5)
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["a", "b"]
    assert not ax.spines["top"].get_visible()
    assert ax.spines["left"].get_visible()


def test_a_chart_without_upper_end_shows_everything():
    ax = drawn(Chart("k", "t", lines=[Line("", X, 7.0 * X)]))
    low, high = ax.get_ylim()
    assert low == 0.0
    assert high >= 28.0
    assert ax.get_legend() is None


def test_a_logarithmic_chart():
    ax = drawn(Chart("k", "t", lines=[Line("a", X + 1.0, 10.0**X)], log_y=True, y_max=3.0))
    assert ax.get_yscale() == "log"
    assert ax.get_ylim()[1] > 1e4
    assert ax.yaxis.get_major_formatter()(1000.0) == "1000"
    assert drawn(Chart("k", "t")).get_yscale() == "linear"


@pytest.mark.parametrize("n", [1, 2, 3])
def test_bars_of_one_category_stand_beside_each_other_about_its_place(n):
    series = [(f"s{i}", np.array([1.0 + i, np.nan]), "#0000ff") for i in range(n)]
    ax = drawn(Bars("k", "t", "", ["one name", "two"], series, "y"))
    bars = np.array([[(bar.get_x(), bar.get_width(), bar.get_height()) for bar in group] for group in ax.containers])
    middles = bars[:, :, 0] + 0.5 * bars[:, :, 1]
    assert middles.mean(axis=0) == pytest.approx([0.0, 1.0], abs=1e-9)
    assert np.all(np.diff(middles[:, 0]) > bars[:-1, 0, 1])  # none over another
    assert bars[:, 0, 1] == pytest.approx(0.92 * 0.8 / n)
    assert bars[:, 0, 2].tolist() == [1.0 + i for i in range(n)]
    assert not bars[:, 1, 2].any()
    assert [label.get_text() for label in ax.get_xticklabels()] == ["one\nname", "two"]


@pytest.mark.parametrize(("n", "angle"), [(18, 0.0), (19, 45.0)])
def test_many_categories_have_slanting_names(n, angle):
    ax = drawn(Bars("k", "t", "", [str(i) for i in range(n)], [("s", np.ones(n), "#0000ff")]))
    assert {label.get_rotation() for label in ax.get_xticklabels()} == {angle}


def test_strips_lie_in_their_rows_the_first_on_top():
    bad = [Strip("a", 0.0, 2.0, "bad", "#ff0000"), Strip("b", 5.0, 6.0, "bad", "#ff0000")]
    strips = [Strip("b", 1.0, 3.0, "good", "#00ff00"), *bad]
    ax = drawn(Strips("k", "t", "", ("a", "b"), strips))
    boxes = [[path.get_extents().extents.tolist() for path in one.get_paths()] for one in ax.collections]
    assert [[pytest.approx(box) for box in row] for row in boxes] == [
        [[0.0, -0.4, 2.0, 0.4]], [[1.0, 0.6, 3.0, 1.4], [5.0, 0.6, 6.0, 1.4]],
    ]  # fmt: skip
    assert [to_hex(color) for color in ax.collections[1].get_facecolor()] == ["#00ff00", "#ff0000"]
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["good", "bad"]
    assert [label.get_text() for label in ax.get_yticklabels()] == ["a", "b"]
    bottom, top = ax.get_ylim()
    assert top < -0.4
    assert bottom > 1.4


def test_a_heat_map_has_a_cell_for_each_row_and_time():
    times, values = np.array([0.0, 0.5, 1.0]), np.arange(6.0).reshape(3, 2)
    ax = drawn(HeatMap("k", "t", "", times, ("a", "b"), values, "px", 4.0))
    (mesh,) = ax.collections
    assert np.array_equal(np.asarray(mesh.get_array()).reshape(2, 3), values.T)
    corners = np.asarray(mesh.get_coordinates())
    assert corners[0, :, 0] == pytest.approx([-0.25, 0.25, 0.75, 1.25])  # each time in the middle of its cells
    assert corners[:, 0, 1].tolist() == [0.0, 1.0, 2.0]
    assert mesh.get_clim() == (0, 4.0)
    assert list(ax.get_yticks()) == [0.5, 1.5]
    assert ax.yaxis_inverted()
    single = drawn(HeatMap("k", "t", "", times[:1], ("a", "b"), values[:1]))
    assert np.asarray(single.collections[0].get_coordinates())[0, :, 0] == pytest.approx([-0.5, 0.5])


def panel(*lines):
    figure = Figure()
    draw_curve(Curve("g", "knee", "deg", [("", ()), ("flexion", lines)]), 1, figure, (0.2, 0.4, 0.5, 0.1))
    return figure


def test_a_small_curve_fills_its_box():
    up, flat = Line("a", X, 3.0 * X - 2.0, dashed=True, width=2.0), Line("b", X, np.array([np.nan, 1.0, 1.0, 1.0]))
    figure = panel(up, flat)
    frame, first, second = figure.artists
    assert np.array_equal(frame.get_xydata(), [[0.2, 0.5], [0.2, 0.4], [0.7, 0.4]])
    assert first.get_xdata() == pytest.approx(0.2 + 0.5 * X / 4.0)
    assert first.get_ydata() == pytest.approx(0.4 + 0.1 * X / 4.0)
    assert (first.get_linestyle(), second.get_linestyle()) == ("--", "-")
    assert first.get_linewidth() == pytest.approx(1.2)
    assert second.get_ydata()[1:] == pytest.approx(0.425)
    assert {text.get_text() for text in figure.texts} == {"knee flexion [deg]", "10", "-2", "0", "4 s"}
    places = {text.get_text(): text.get_position() for text in figure.texts}
    assert places["10"] == pytest.approx((0.196, 0.5))
    assert places["-2"] == pytest.approx((0.196, 0.4))
    assert places["0"] == pytest.approx((0.2, 0.398))
    assert places["4 s"] == pytest.approx((0.7, 0.398))
    assert places["knee flexion [deg]"][1] > 0.5


def test_a_curve_that_stays_or_is_not_known_has_some_height():
    (_, stays) = panel(Line("a", X, np.full(4, 5.0))).artists
    assert stays.get_ydata() == pytest.approx(0.45)
    texts = {text.get_text() for text in panel(Line("a", X, np.full(4, np.nan))).texts}
    assert {"0", "1"} <= texts
    assert len(panel().artists) == 1


def test_a_scene_shows_a_few_instants_beside_each_other():
    points = np.zeros((20, 3, 3))
    points[:, 1, 2], points[:, 2] = 1.0, [0.1, 0.0, 0.5]
    points[:3] = np.nan
    body = Moving("a", points, rods=[(0, 1, 0.1, 0.1, "#0072b2")], wires=[(0, 2, "#d55e00")], dots=[(2, "#1d2730")])
    block = Scene("s", "t", "", np.arange(20) * 0.1, [body], [("tracking", "#009e73")] * 20, {"cam": np.full((5, 3), 3.0)})
    ax = drawn(block)
    assert [text.get_text() for text in ax.texts] == ["0.30 s", "0.60 s", "0.90 s", "1.30 s", "1.60 s", "1.90 s"]
    rods = [line for line in ax.lines if to_hex(line.get_color()) == "#0072b2"]
    assert len(rods) == 6 and len(ax.lines) == 18 and all(line.get_ydata() == pytest.approx([0.0, 1.0]) for line in rods)
    places = [line.get_xdata()[0] for line in rods]
    assert places == sorted(places) and places[0] < places[-1]
    assert height_in(block) > 1.0 and not drawn(Scene("s", "t")).lines
