"""Parts of the report's page."""

import base64
import json

import cv2
import numpy as np
import pytest

from tracker_node.report import html as page
from tracker_node.report.document import (
    Bars,
    Cell,
    Chart,
    Column,
    Curve,
    Curves,
    Document,
    DocumentSection,
    Line,
    Moving,
    Pictures,
    Scene,
    Table,
)


def grouped(*groups):
    return Table("t", "T", "", [Column(str(i), group=group) for i, group in enumerate(groups)], [])


@pytest.mark.parametrize(
    ("groups", "head"),
    [
        (("", "a", "a", "b"), [("", 1), ("a", 2), ("b", 1)]),
        (("a", "", "a"), [("a", 1), ("", 1), ("a", 1)]),
        (("", "", ""), []),
        ((), []),
        (("", "a"), [("", 1), ("a", 1)]),
    ],
)
def test_groups_stand_above_neighbours_that_share_them(groups, head):
    assert page._head_of(grouped(*groups)) == head


def test_cells_have_their_text_and_their_mark():
    columns = [Column("a", 2), Column("b", is_text=True), Column("c", 0)]
    table = Table("t", "T", "", columns, [])
    found = page._cells_of(table, [Cell(1.234, "good"), "x", None])
    assert found == [("1.23", Cell(1.234, "good"), columns[0]), ("x", Cell("x"), columns[1]), ("–", Cell(None), columns[2])]
    with pytest.raises(ValueError, match="zip"):
        page._cells_of(table, [1.0])


def test_kinds_of_blocks():
    blocks = [Table("t", "T"), Pictures("p", "P"), Curves("c", "C"), Scene("s", "S"), Chart("x", "X"), Bars("b", "B")]
    assert [page._kind_of(block) for block in blocks] == ["table", "pictures", "curves", "scene", "chart", "chart"]


def test_a_scene_has_whole_millimeters_and_nothing_where_nothing_is():
    points = np.array([[[0.0014, 0.0016, -1.0], [np.nan] * 3], [[np.nan] * 3] * 2])
    moving = Moving("a", points, rods=[(0, 1, 0.0504, 0.02, "#000")], dots=[(1, "#111")])
    data = page.scene_data(Scene("s", "S", "", np.array([0.0, 0.1]), [moving], [("lost", "#222")] * 2, {"cam": np.ones((5, 3))}))
    (body,) = data["bodies"]
    assert body["frames"] == [[1, 2, -1000, None, None, None], None] and body["rods"] == [[0, 1, 50, 20, "#000"]]
    assert data["cameras"] == [{"name": "cam", "points": [[1000] * 3] * 5}] and data["times"] == [0.0, 0.1]
    json.dumps(data, allow_nan=False)


def test_json_cannot_end_its_script():
    text = page._json({"a": "</script>\u2028\u2029<b>", "n": [1.5]})
    assert "<" not in text and "\u2028" not in text and "\u2029" not in text
    assert json.loads(text) == {"a": "</script>\u2028\u2029<b>", "n": [1.5]}
    with pytest.raises(ValueError, match="JSON"):
        page._json(float("nan"))


def test_pictures_are_jpegs_with_their_aspect():
    image = np.zeros((40, 60, 3), np.uint8)
    image[..., 2] = 200
    rows = page._sheet_of(Pictures("p", "P", "", [[("first", image), ("second", image[:, :20])], [("third", image)]]))
    assert [[cell[0] for cell in row] for row in rows] == [["first", "second"], ["third"]]
    assert [cell[2] for cell in rows[0]] == ["1.5000", "0.5000"]
    head, data = rows[0][0][1].split(",")
    read = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
    assert head == "data:image/jpeg;base64" and read.shape == (40, 60, 3)
    assert read[20, 30].tolist() == pytest.approx([0, 0, 200], abs=4)


def document(*blocks):
    return Document("A <title>", "today", [("fact", "told")], ["a problem"], [DocumentSection("s", "Section", blocks)])


def test_plotly_comes_with_charts_or_curves_only():
    line = Line("a line", np.arange(3.0), np.arange(3.0))
    table = Table("key_of_it", "A table", "a note", [Column("head")], [[1.25]])
    plain = page.render_html(document(table))
    size = len(page._template(page.PLOTLY))
    assert len(plain) < size
    for block in (Chart("c", "A chart", lines=[line]), Curves("v", "Curves", "", [Curve("g", "n", "mm", [("", [line])])])):
        assert len(page.render_html(document(block))) > size
    assert "A &lt;title&gt;" in plain and "<title>A <title>" not in plain
    assert all(text in plain for text in ("fact", "told", "a problem", "A table", "a note", "head", "1.2"))
