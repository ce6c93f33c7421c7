"""Text and tables in print."""

import pytest

from tracker_node.report.document import Cell, Column, Table
from tracker_node.report.print_layout import MARGIN_IN, PAGE_IN, SMALLEST, WIDTH_IN, table_parts, width_in, wrapped


def test_a_page_is_a4_with_margins():
    assert pytest.approx((210 / 25.4, 297 / 25.4), abs=0.005) == PAGE_IN
    assert pytest.approx(PAGE_IN[0]) == WIDTH_IN + 2 * MARGIN_IN


def test_width_grows_with_text_and_size():
    assert width_in("", 8) == 0.0 and width_in("mm", 8) == pytest.approx(2 * width_in("m", 8), rel=0.03)
    assert width_in("text", 16) == pytest.approx(2 * width_in("text", 8), rel=0.03)
    assert width_in("text", 8, True) > width_in("text", 8)
    assert 0.3 < width_in("m" * 4, 10) < 0.6


def test_words_go_on_a_line_while_they_fit():
    width = width_in("one two", 8)
    assert wrapped("one two three", 8, width) == ["one two", "three"]
    assert wrapped("one two", 8, width - 0.01) == ["one", "two"]
    assert wrapped("  one   two ", 8, width) == ["one two"] and wrapped("", 8, 1.0) == [""]


def test_a_word_that_is_wider_is_broken():
    width = width_in("aaaa", 8)
    assert wrapped("a" * 10, 8, width) == ["aaaa", "aaaa", "aa"]
    assert wrapped("b " + "a" * 6, 8, width) == ["b", "aaaa", "aa"]
    assert wrapped("aa", 8, 0.001) == ["a", "a"]  # one letter at least
    assert wrapped("a" * 5 + " a", 8, width) == ["aaaa", "a a"]


def table(n, group="", text=False, title="title", cell=1.0):
    columns = [Column("name", is_text=True), *(Column(f"{title}{i}", 1, group, is_text=text) for i in range(n))]
    return Table("t", "T", "", columns, [["row", *[cell] * n]])


def test_a_narrow_table_is_one_part():
    (part,) = table_parts(table(3))
    assert [column.title for column in part.columns] == ["name", "title0", "title1", "title2"]
    assert part.rows == [["row", 1.0, 1.0, 1.0]] and part.size == pytest.approx(6.8)
    assert part.titles == [["name"], ["title0"], ["title1"], ["title2"]] and part.cells == [[["row"], ["1.0"], ["1.0"], ["1.0"]]]
    assert part.widths[1] == pytest.approx(width_in("title0", 6.8) + 0.16)


def test_a_wide_table_has_its_first_column_in_every_part():
    parts = table_parts(table(60))
    assert len(parts) > 1 and all(part.columns[0].title == "name" for part in parts)
    titles = [column.title for part in parts for column in part.columns[1:]]
    assert titles == [f"title{i}" for i in range(60)]
    for part in parts:
        assert sum(part.widths) <= WIDTH_IN + 1e-5 and part.size >= SMALLEST
        assert len(part.rows[0]) == len(part.columns) == len(part.cells[0]) == len(part.widths)


def test_a_group_stays_together_where_it_can():
    columns = [Column("name", is_text=True)]
    columns += [Column(f"first number {i}", group="one") for i in range(6)] + [
        Column(f"other number {i}", group="two") for i in range(6)
    ]
    parts = table_parts(Table("t", "T", "", columns, [["row", *range(12)]]))
    assert [{column.group for column in part.columns[1:]} for part in parts] == [{"one"}, {"two"}]
    assert parts[1].rows == [["row", *range(6, 12)]] and parts[1].cells[0][1] == ["6"]


def test_keys_are_left_out_and_lights_are_words():
    columns = [Column("what", is_text=True), Column("key", is_text=True), Column("value")]
    rows = [["a", Cell("a.b", "code"), Cell(1.25, "good")], ["b", "c.d", Cell(2.0, "bad")], ["c", "e.f", Cell(3.0, "better")]]
    (part,) = table_parts(Table("t", "T", "", columns, rows))
    assert [column.title for column in part.columns] == ["what", "value"]
    assert [row[1] for row in part.cells] == [["1.2 (met)"], ["2.0 (missed)"], ["3.0"]]
    assert part.rows[0] == ["a", rows[0][2]]


def test_a_long_text_is_broken_and_the_text_smaller():
    columns = [Column("name", is_text=True), Column("says", is_text=True), Column("value")]
    (part,) = table_parts(Table("t", "T", "", columns, [["row", "many words " * 40, 1.0]]))
    assert part.size == pytest.approx(SMALLEST) and len(part.cells[0][1]) > 2 and part.cells[0][2] == ["1.0"]
    assert sum(part.widths) == pytest.approx(WIDTH_IN)
    assert all(width_in(line, part.size) <= part.widths[1] - 0.16 + 1e-5 for line in part.cells[0][1])


def test_a_long_title_is_broken():
    columns = [Column("name", is_text=True), Column("a very long title of many words that goes on and on and on")]
    (part,) = table_parts(Table("t", "T", "", columns, [["row", 1.0]]))
    assert len(part.titles[1]) > 1 and part.widths[1] == pytest.approx(1.5 + 0.16)
