"""What the doctor leaves: findings as plain values, and images in which the places of motion and lines of sight are drawn."""

import json
from dataclasses import replace

import cv2
import numpy as np
import pytest

from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera, CameraRig
from tracker_node.doctor import report
from tracker_node.doctor.diagnosis import Examination
from tracker_node.doctor.geometry import Diagnosis
from tracker_node.doctor.motion import ImageMotion
from tracker_node.doctor.recording import CameraRecording
from tracker_node.doctor.setup import Finding, Setup
from tracker_node.synthesis.scenes.scene import looking_at

LENS = CameraModel(480, 240, np.array([[300.0, 0.0, 239.5], [0.0, 300.0, 119.5], [0.0, 0.0, 1.0]]))
MIDDLE = np.array([0.0, 0.0, 1.0])
RED, GREEN, ORANGE = report._COLORS_BGR[:3]
FIRST = Finding("clock", ("a",), "a is late.", {"late_s": 0.2, "px": float("nan")})
SECOND = Finding("unit", (), "Everything is in millimeters.")


def camera(name, x, y):
    return Camera(name, LENS, looking_at(np.array([x, y, 1.0]), MIDDLE))


A, B = camera("a", 0.0, -4.0), camera("b", 4.0, 0.0)
RIG = CameraRig((A, B))


def motion(camera, points, amounts):
    """Of points (n, 3) at time step 1 of three."""
    table = np.zeros((3, len(points)))
    table[1] = amounts
    return ImageMotion.of_table(camera.project(np.asarray(points))[0], table, np.ones(3, bool))


POINTS = [MIDDLE + np.array([0.0, 0.0, height]) for height in (0.0, 0.4, -0.5, 0.9)]
AMOUNTS = [1.0, 0.6, 0.5, 0.3]  # the last moves too little


def setup():
    return Setup.of((A, B), {c.name: motion(c, POINTS, AMOUNTS) for c in (A, B)})


def examination(findings=(), notes=(), compared=True):
    known = setup() if compared else None
    values = np.array([[np.nan, 0.9], [0.9, np.nan]])
    diagnosis = Diagnosis((), values, values, known) if known else None
    return Examination(tuple(findings), tuple(notes), np.array([0, 100, 200]), known, diagnosis)


def recording(name, level=0):
    result = CameraRecording(name, 3, 10.0, size=(480, 240), stamps_ns=[0, 100, 200])
    return replace(result, shown=np.full((240, 480, 3), level, np.uint8), shown_index=1)


def test_findings_are_plain_values():
    assert report.as_json(examination([FIRST, SECOND], ["a note."], compared=False)) == {
        "findings": [
            {"fault": "clock", "cameras": ["a"], "sentence": "a is late.", "values": {"late_s": 0.2, "px": None}},
            {"fault": "unit", "cameras": [], "sentence": "Everything is in millimeters.", "values": {}},
        ],
        "notes": ["a note."],
        "compared": False,
    }


@pytest.mark.parametrize(
    ("findings", "compared", "said"),
    [
        ([], True, "Nothing is wrong. A note."),
        ([], False, "Nothing is wrong with the images of single cameras. A note."),
        ([FIRST, SECOND, FIRST], True, "Clock offset, wrong unit. A note."),
    ],
)
def test_the_summary_names_each_kind_of_fault_once(findings, compared, said):
    assert report._summary(examination(findings, ["A note."], compared)) == said


def test_everything_is_written(tmp_path):
    recordings = {"a": recording("a"), "b": replace(recording("b"), shown=None)}
    page = report.write_examination(tmp_path / "new/folder", RIG, recordings, examination([FIRST, SECOND]))
    assert page == tmp_path / "new/folder/index.html"
    assert sorted(path.name for path in page.parent.iterdir()) == ["a.png", "findings.json", "index.html"]
    found = json.loads((page.parent / "findings.json").read_text())
    assert [finding["fault"] for finding in found["findings"]] == ["clock", "unit"]
    text = page.read_text()
    order = [text.index(part) for part in ("<h2>Findings", "<h2>The images", "<h2>a<")]
    assert order == sorted(order)
    assert "<h2>b<" not in text


def test_a_camera_s_own_findings_are_told_of_it(tmp_path):
    recordings = {name: recording(name) for name in "ab"}
    text = report.write_examination(tmp_path, RIG, recordings, examination([FIRST])).read_text()
    own = text[text.index("<h2>a<") : text.index("<h2>b<")]
    assert "a is late." in own
    assert "Nothing found." not in own
    other = text[text.index("<h2>b<") :]
    assert "Nothing found." in other
    assert "a is late." not in other


def images(findings=(), level=0, scale=1):
    shown = recording("a", level)
    shown.shown = cv2.resize(shown.shown, None, fx=scale, fy=scale)
    return report._page_image(A, shown, examination(findings), list(findings), {"a": RED, "b": GREEN})


@pytest.mark.parametrize("scale", [1, 4])
def test_pictures_are_960_pixels_wide_below_a_banner(scale):
    assert images(scale=scale).shape == (480 + 30, 960, 3)


def test_the_banner_is_red_with_findings_and_green_without():
    assert images([FIRST])[0, 0].tolist() == [40, 40, 170]
    assert images()[0, 0].tolist() == [60, 110, 40]


def test_long_banners_have_more_lines_of_whole_words():
    """No line is as wide as the image less a margin of 6 pixels on both sides."""
    text = " ".join(["word"] * 30)
    assert report._banner(text, 960, True).shape == (20 * 2 + 10, 960, 3)
    banner = report._banner(text, 172, True)
    assert banner.shape == (20 * 8 + 10, 172, 3)  # 4 words in a line
    written = (banner > 200).all(axis=2)
    rows, columns = np.flatnonzero(written.any(axis=1)), np.flatnonzero(written.any(axis=0))
    assert rows[0] > 6 and 155 < rows[-1] < 170
    assert columns[0] >= 6 and columns[-1] < 166


def test_what_moves_is_tinted_half_and_only_there():
    """Points of the camera's own motion, larger than 0.3, in its color; twice as far from the corner in the larger image."""
    image = np.zeros((480, 960, 3), np.uint8)
    only = Setup.of((A,), {"a": motion(A, POINTS, AMOUNTS)})
    report._draw_motion(image, "a", only, 1, {"a": RED}, 2.0)
    tinted = image.any(axis=2)
    for point, moves in zip(POINTS, (True, True, True, False), strict=True):
        u, v = np.round(2.0 * A.project(point)[0]).astype(int)
        assert tinted[v, u] == moves
        if moves:
            np.testing.assert_allclose(image[v, u], 0.5 * np.array(RED), atol=1.0)
    assert tinted.sum() < 3 * 64  # circles of 3 pixels
    still = np.zeros_like(image)
    report._draw_motion(still, "a", only, 0, {"a": RED}, 2.0)
    assert not still.any()


def test_lines_of_the_highest_and_the_lowest_place_of_the_others_are_drawn():
    """Cameras as high as the middle: a point at the other's height projects to a level line through the middle."""
    image = np.zeros((240, 480, 3), np.uint8)
    lines = Setup.of((A, B), {"a": motion(A, POINTS[:1], [0.1]), "b": motion(B, POINTS, AMOUNTS)})
    report._draw_motion(image, "a", lines, 1, {"a": RED, "b": GREEN}, 1.0)
    drawn = (image == GREEN).all(axis=2)
    for point in (POINTS[1], POINTS[2]):  # the highest and the lowest of those that move
        u, v = np.round(A.project(point)[0]).astype(int)
        assert drawn[v - 1 : v + 2, u].any()
    for point in (POINTS[0], POINTS[3]):
        u, v = np.round(A.project(point)[0]).astype(int)
        assert not drawn[v - 3 : v + 4, u].any()


def test_names_of_the_others_are_one_below_the_other():
    for place, row in (("a", 22), ("b", 44)):
        image = np.zeros((240, 480, 3), np.uint8)
        own = "b" if place == "a" else "a"
        cameras = {"a": A, "b": B}
        motions = {own: motion(cameras[own], POINTS[:1], [0.1]), place: motion(cameras[place], POINTS[:1], [1.0])}
        report._draw_motion(image, own, Setup.of((A, B), motions), 1, {"a": RED, "b": GREEN}, 1.0)
        rows = np.flatnonzero(image[:, :16].any(axis=(1, 2)))
        letters = rows[rows < 60]
        assert row - 16 <= letters[0] < letters[-1] <= row + 1
