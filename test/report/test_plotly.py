"""What of a document becomes plotly figures."""

import json

import numpy as np
import pytest

from tracker_node.report.document import Bars, Chart, HeatMap, Line, Strip, Strips, Table
from tracker_node.report.html import COLUMNS, figure_of, plain


def test_lines_break_where_nothing_is_known_and_json_has_them():
    chart = Chart("c", "c", lines=[Line("a", np.arange(3.0), np.array([1.0, np.nan, np.inf]), dashed=True)], bands=[(0.5, 1.5)])
    figure = figure_of(chart)
    assert figure["data"][0]["y"] == [1.0, None, None] and figure["data"][0]["line"]["dash"] == "dash"
    assert figure["layout"]["shapes"][0]["x0"] == 0.5
    json.dumps(figure, allow_nan=False)


def test_digits_that_no_screen_shows_are_left_out():
    assert plain([123.456789, 1e-7 / 3, -0.0]) == [123.46, 3.3333e-08, -0.0]


def test_times_of_an_hour_are_those_of_its_images():
    times = 3600.0 + np.arange(4) / 240.0
    (line,) = figure_of(Chart("c", "c", lines=[Line("a", times, np.zeros(4))]))["data"]
    assert line["x"] == pytest.approx(times, abs=1e-5)
    strips = figure_of(Strips("s", "s", "", ["one"], [Strip("one", times[1], times[2], "lost", "#000")]))["data"][0]
    assert strips["base"] == pytest.approx([times[1]], abs=1e-5) and strips["x"] == pytest.approx([1 / 240], rel=1e-6)


def test_long_heat_maps_show_the_largest_of_neighbors():
    values = np.zeros((2 * COLUMNS + 1, 2))
    values[7, 0], values[2 * COLUMNS, 1], values[100, 1] = 5.0, 7.0, np.nan
    figure = figure_of(HeatMap("h", "h", "", np.arange(len(values)) * 0.1, ["a", "b"], values, "mm", 10.0))
    z = np.array(figure["data"][0]["z"], dtype=float)
    assert z.shape == (2, len(figure["data"][0]["x"])) and z.shape[1] <= COLUMNS
    assert z[0].max() == 5.0 == z[0, 7 // 3] and z[1, -1] == 7.0 and not np.isnan(z).any()
    short = figure_of(HeatMap("h", "h", "", np.arange(3.0), ["a", "b"], np.arange(6.0).reshape(3, 2), "mm", 10.0))
    assert short["data"][0]["z"] == [[0.0, 2.0, 4.0], [1.0, 3.0, 5.0]]


def test_strips_say_from_when_to_when():
    block = Strips(
        "s", "s", "", ["one", "two"], [Strip("one", 0.0, 1.5, "lost", "#d55e00"), Strip("two", 1.0, 2.0, "lost", "#d55e00")]
    )
    (trace,) = figure_of(block)["data"]
    assert (trace["base"], trace["x"], trace["customdata"], trace["y"]) == ([0.0, 1.0], [1.5, 1.0], [1.5, 2.0], ["one", "two"])


def test_other_blocks_are_no_figures():
    assert figure_of(Table("t", "t")) is None
    bars = figure_of(Bars("b", "b", "", ["x"], [("a", np.array([2.0]), "#000")], "mm"))
    assert bars["data"][0]["y"] == pytest.approx([2.0])
