"""Tables and charts of a report as files: names, headers, rows, and numbers that CSV and JSON have."""

import json

import numpy as np
import pytest

from tracker_node.report.document import (
    Bars,
    Block,
    Cell,
    Chart,
    Column,
    Curve,
    Curves,
    Document,
    DocumentSection,
    HeatMap,
    Line,
    Pictures,
    Strip,
    Strips,
    Table,
    cell_text,
    columns_of,
    file_name,
    strips_of,
    write_figure_files,
)

ONE = Line("left", np.array([0.0, 1.0]), np.array([1.0 / 3.0, np.nan]))
TWO = Line("right", np.array([2.0]), np.array([-5.0]))
RMS, MOST = ("rms", np.array([1.0, 2.0]), ""), ("max", np.array([3, 4]), "")
TABLE = Table("t", "Table", columns=(Column("n"), Column("rms", group="leg")), rows=((Cell(3, "*"), 0.5), (None, float("inf"))))


@pytest.mark.parametrize(
    ("block", "header", "rows"),
    [
        (TABLE, ["n", "leg: rms"], [[3, 0.5], [None, None]]),
        (
            Chart("c", "", x_label="time s", y_label="error mm", lines=(ONE, TWO)), ["line", "time s", "error mm"],
            [["left", 0.0, 0.333333333], ["left", 1.0, None], ["right", 2.0, -5.0]],
        ),
        (Chart("c", "", x_label="x", lines=()), ["line", "x", "value"], []),
        (
            Bars("b", "", categories=("hip", "knee"), series=(RMS, MOST), y_label="mm"),
            ["category", "series", "mm"], [["hip", "rms", 1.0], ["knee", "rms", 2.0], ["hip", "max", 3], ["knee", "max", 4]],
        ),
        (
            Strips("s", "", rows=("arm",), strips=(Strip("arm", 0.5, 1.5, "LOST", "red"),)), ["row", "start_s", "end_s", "label"],
            [["arm", 0.5, 1.5, "LOST"]],
        ),
        (
            HeatMap("h", "", times=np.array([0.0, 0.1]), rows=("a", "b"), values=np.array([[1.0, 2.0], [np.nan, 4.0]])),
            ["time_s", "a", "b"], [[0.0, 1.0, 2.0], [0.1, None, 4.0]],
        ),
        (
            Curves("k", "", curves=(Curve("arm", "elbow", "deg", (("angle", (TWO,)), ("error", (ONE,)))),)),
            ["group", "name", "unit", "panel", "line", "time_s", "value"],
            [["arm", "elbow", "deg", "angle", "right", 2.0, -5.0], ["arm", "elbow", "deg", "error", "left", 0.0, 0.333333333],
             ["arm", "elbow", "deg", "error", "left", 1.0, None]],
        ),
    ],
)  # fmt: skip
def test_columns_of_a_block(block, header, rows):
    assert columns_of(block) == (header, rows)


def test_other_blocks_show_no_numbers():
    with pytest.raises(ValueError, match="got Block"):
        columns_of(Block("x", ""))


@pytest.mark.parametrize(
    ("key", "name"), [("a b/c", "a_b_c"), ("..run", "run"), ("", "figure"), ("...", "figure"), ("A-9_z.x", "A-9_z.x")]
)
def test_names_are_what_files_can_have(key, name):
    assert file_name(key) == name


def test_two_files_are_written_of_each_block_but_of_pictures(tmp_path):
    other = Chart("t.", "Other", note="noted", x_label="x", y_label="y", lines=(TWO,))
    same = Table("t", "Again", columns=(Column("n"),), rows=((7,),))
    blocks = (TABLE, Pictures("p", "Pictures"), other, same)
    written = write_figure_files(tmp_path, Document("", "", (), (), (DocumentSection("s", "", blocks),)))
    folder = tmp_path / "figures"
    assert written == [folder / f"{name}.{kind}" for name in ("t", "t.", "t_2") for kind in ("csv", "json")]
    assert (folder / "t.csv").read_text().splitlines() == ["n,leg: rms", "3,0.5", ","]
    assert json.loads((folder / "t.json").read_text()) == {
        "title": "Table", "note": "", "columns": ["n", "leg: rms"], "rows": [[3, 0.5], [None, None]],
    }  # fmt: skip
    assert (folder / "t_2.csv").read_text().splitlines() == ["n", "7"]


@pytest.mark.parametrize(
    ("cell", "text"),
    [(1.26, "1.3"), (Cell(1.26, "*", 2), "1.26"), (Cell(1.26), "1.3"), (Cell(1.26, digits=0), "1"), (3, "3"), (None, "–"),
     (float("nan"), "–"), (-0.01, "0.0"), ("text", "text"), (np.float64(2.0), "2.0")],
)  # fmt: skip
def test_cells_have_the_digits_of_their_column_or_their_own(cell, text):
    assert cell_text(cell, Column("x", 1)) == text


def test_strips_join_what_follows_within_a_period():
    times = np.array([0.0, 1.0, 2.0, 4.0, 5.0])
    strips = strips_of("arm", ["a", "a", "b", "b", "b"], times, 1.0, {"a": "red", "b": "blue"})
    assert [(s.row, s.label, s.start, s.end, s.color) for s in strips] == [
        ("arm", "a", -0.5, 1.5, "red"), ("arm", "b", 1.5, 2.5, "blue"), ("arm", "b", 3.5, 5.5, "blue"),
    ]  # fmt: skip
