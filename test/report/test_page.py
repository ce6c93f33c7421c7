"""The page of an experiment or a calibration."""

import base64

import cv2
import numpy as np
import pytest

from helpers.sources.small_disk import limited_files
from tracker_node.report.html import PageSection, write_page


def test_headings_tables_pictures_and_text_in_order(tmp_path):
    image = tmp_path / "a.png"
    image.write_bytes(b"pixels")
    sections = [
        PageSection("First <part>", "A sentence.", [("name", "heading of it"), ("a", "1.5")]),
        PageSection("Second", image=image, preformatted="as  it is"),
    ]
    path = tmp_path / "new" / "folder" / "page.html"
    write_page(path, "A title", sections)
    text = path.read_text(encoding="utf-8")
    assert "A title" in text and "First &lt;part&gt;" in text and "<part>" not in text
    places = [text.index(part) for part in ("First &lt;", "A sentence.", "heading of it", "Second", "as  it is")]
    assert places == sorted(places) and "1.5" in text[places[2] : places[3]]
    assert text.count("data:image/png;base64,") == 1
    assert f"data:image/png;base64,{base64.b64encode(b'pixels').decode()}" in text
    assert "UTC" in text


def test_what_is_empty_is_left_out(tmp_path):
    write_page(tmp_path / "page.html", "A title", [PageSection("Alone")])
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Alone" in text and "<img" not in text and "data:image" not in text
    write_page(tmp_path / "page.html", "Another", [])
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "Another" in text and "Alone" not in text


def test_pixels_are_a_picture_and_a_section_needs_no_heading(tmp_path):
    pixels = np.random.default_rng(0).integers(0, 256, (4, 6, 3), dtype=np.uint8)
    write_page(tmp_path / "page.html", "Arm & hand", [PageSection(text="seen <here>", image=pixels)])
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assert "<title>Arm &amp; hand</title>" in text and "seen &lt;here&gt;" in text and "<h2></h2>" not in text
    png = base64.b64decode(text.split("data:image/png;base64,")[1].split('"')[0])
    np.testing.assert_array_equal(cv2.imdecode(np.frombuffer(png, np.uint8), cv2.IMREAD_COLOR), pixels)


def test_headings_and_cells_are_escaped(tmp_path):
    write_page(tmp_path / "page.html", "A", [PageSection("A & B", table=[("x", "<y>"), ("1", "2")])])
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    for part in ("<h2>A &amp; B</h2>", "<th>&lt;y&gt;</th>", "<td>1</td><td>2</td>"):
        assert part in text


def test_a_full_disk_leaves_what_was_there_and_is_named(tmp_path):
    path = tmp_path / "page.html"
    path.write_text("whole")
    with limited_files(100), pytest.raises(OSError, match="File too large") as refused:
        write_page(path, "A title", [PageSection("First", "A sentence.")])
    assert refused.value.filename == str(path) and path.read_text() == "whole" and list(tmp_path.iterdir()) == [path]
