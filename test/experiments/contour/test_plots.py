"""Charts of the contour experiments show the numbers that they are given."""

import numpy as np
import pytest

from tracker_node.experiments.contour.errors import PUBLISHED, TITLES
from tracker_node.experiments.contour.figures import RowFigure, row_figure, tracking_figure, variables_figure
from tracker_node.experiments.plots import Profile

X = np.linspace(-2.0, 2.0, 5)


def test_a_row_of_an_image():
    silhouette, edges = np.zeros((200, 300), bool), np.zeros((200, 300), bool)
    silhouette[80:120, 140:160], edges[90, 150] = True, True
    distances = {key: np.full(300, 1.0 + i) for i, key in enumerate(PUBLISHED)}
    errors = {
        "a model": {key: Profile(10.0 * X, X**2 + i) for i, key in enumerate(PUBLISHED)},
        "a thin one": {key: Profile(20.0 * X, X**2 + 10.0 * i) for i, key in enumerate(PUBLISHED)},
    }
    figure = row_figure(RowFigure(silhouette, edges, 100, 149.5, distances, errors))
    shown_edges, shown_silhouette, *charts = figure.axes
    assert np.array_equal(shown_silhouette.images[0].get_array(), silhouette[35:165, 95:205])
    assert np.array_equal(shown_edges.images[0].get_array(), edges[35:165, 95:205])
    assert list(shown_edges.lines[0].get_ydata()) == [65, 65]
    assert len(charts) == len(PUBLISHED)
    highest = 4.0 + 10.0 * (len(PUBLISHED) - 1)
    for i, (ax, key) in enumerate(zip(charts, PUBLISHED, strict=True)):
        row, model, thin = ax.lines
        assert np.array_equal(row.get_xdata(), np.arange(300) - 149.5)
        assert np.array_equal(row.get_ydata(), distances[key])
        assert np.array_equal(model.get_ydata(), X**2 + i)
        assert np.array_equal(thin.get_xdata(), 20.0 * X)
        assert (model.get_linestyle(), thin.get_linestyle()) == ("-", "--")
        assert ax.get_xlim() == (-40.0, 40.0)
        assert ax.get_ylim() == pytest.approx((0.0, 1.05 * highest))
        assert TITLES[key].startswith(ax.get_title())


def test_the_error_by_single_variables():
    knee = {"sum": Profile(X, X**2), "split": Profile(X, 2 * X**2)}
    panels = {"knee [deg]": knee, "height [mm]": {"sum": Profile(X, 3 * X**2)}}
    figure = variables_figure(panels)
    assert [ax.get_title() for ax in figure.axes] == ["knee", "height"]
    assert [ax.get_xlabel() for ax in figure.axes] == ["from the truth [deg]", "from the truth [mm]"]
    first, second, truth = figure.axes[0].lines
    assert np.array_equal(second.get_ydata(), 2 * X**2)
    assert first.get_label() == TITLES["sum"]
    assert list(truth.get_xdata()) == [0.0, 0.0]
    assert figure.axes[0].get_ylim()[0] == 0.0
    assert len(figure.legends) == 1


def test_errors_over_time():
    panels = {"a": (X, {"sum": X**2 + 1, "split": X**2 + 2}), "b": (X, {"sum": X**2 + 3})}
    figure = tracking_figure(panels)
    assert [len(ax.lines) for ax in figure.axes] == [2, 1]
    assert np.array_equal(figure.axes[0].lines[1].get_ydata(), X**2 + 2)
    assert {ax.get_yscale() for ax in figure.axes} == {"log"}
    assert [text.get_text() for text in figure.legends[0].get_texts()] == [TITLES["sum"], TITLES["split"]]
    assert figure.axes[0].get_ylabel() == "mean joint error [mm]"
