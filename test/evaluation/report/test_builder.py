"""The report as people get it: the page in a real browser, the PDF through another reader, tables and charts as files."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pypdf
import pytest
from matplotlib import get_data_path
from PIL import ImageFont

from helpers.bodies.stick_person import Motion, motion, write_run, write_state_bag
from helpers.studio.browser import browser_tab
from tracker_node.evaluation.evaluate import EvaluationOptions
from tracker_node.evaluation.masks.silhouettes import Picture
from tracker_node.evaluation.motion.gait import N_PARTS, Gait, Strides
from tracker_node.evaluation.report import kinematics
from tracker_node.evaluation.report.builder import ReportOptions, _facts, contact_sheets, write_report
from tracker_node.evaluation.report.summary import Target, summary_table
from tracker_node.evaluation.review import Review, Truth, review
from tracker_node.evaluation.truth.files import TrueStates, unwrapped
from tracker_node.loaders.motion.trajectory_file import Trajectories
from tracker_node.model.configuration import variable_names
from tracker_node.report.document import Cell, Column, Document, DocumentSection, Table, file_name, strips_of, write_figure_files
from tracker_node.report.html import render_html
from tracker_node.report.pdf import write_pdf
from tracker_node.runs.load import load_run

N = 24


def truth_of(tracked: Motion) -> Truth:
    """Joints 30 mm beside, and states as they are."""
    positions = tracked.landmarks_m + np.array([0.03, 0.0, 0.0])
    joints = Trajectories(tracked.model.landmark_names, tracked.stamps_ns, positions, np.ones(positions.shape[:2], dtype=bool))
    values = unwrapped(np.array([state.to_values() for state in tracked.states]))
    states = TrueStates(variable_names(tracked.model), tracked.stamps_ns, values, np.ones(values.shape, dtype=bool))
    return Truth(joints, states)


def reviewed(folder: Path, name: str = "walk", truth: bool = True, seed: int = 3) -> Review:
    tracked = motion(N, seed)
    write_run(folder / name, tracked, ["TRACKING"] * 10 + ["LOST"] * 3 + ["TRACKING"] * (N - 13))
    write_state_bag(folder / name / "bag", tracked)
    run = load_run(folder / name)
    of = motion(N)
    found = review(run, of.model, truth_of(of) if truth else Truth(), EvaluationOptions(name, 0.0), {"run": str(folder / name)})
    picture = np.full((60, 40, 3), 90, dtype=np.uint8)
    pictures = [
        Picture(camera, i, picture, kind) for kind in ("overlay", "mask") for i in (0, 9) for camera in ("cam01", "cam02")
    ]
    return replace(found, pictures=pictures, problems=["a <b>camera</b> </script> is gone"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Reports of one run, of two that are compared, and of one without truth."""
    folder = tmp_path_factory.mktemp("reports")
    one, other = reviewed(folder), reviewed(folder, "run", seed=4)
    write_report(folder / "one", [one], ReportOptions({"mpjpe_mm": Target(60.0, True)}, figure_files=True))
    write_report(folder / "two", [one, other], ReportOptions(figure_files=True))
    write_report(folder / "alone", [reviewed(folder, "alone", truth=False)])
    return folder


@pytest.mark.parametrize(("report", "charts"), [("one", 9), ("two", 12), ("alone", 5)])
def test_the_page_draws_every_chart_in_a_browser(folder, report, charts):
    with browser_tab() as tab:
        asked = []
        tab.page.on("request", lambda request: asked.append(request.url))
        tab.page.goto((folder / report / "report.html").as_uri())
        tab.page.wait_for_function("document.documentElement.dataset.drawn", timeout=60_000)
        assert tab.errors == []
        assert [url for url in asked if not url.startswith(("data:", "blob:"))] == [(folder / report / "report.html").as_uri()]
        drawn = tab.page.locator("[data-chart] .main-svg, #curve .main-svg")
        assert tab.page.locator("[data-chart]").count() == charts
        assert drawn.count() >= charts + 1
        lines = tab.page.locator("#curve .scatterlayer .trace path.js-line")
        assert lines.count() >= 1
        assert tab.page.locator("figure img").count() >= 4
        widths = tab.page.evaluate(WIDTHS)
        assert len(widths) >= 4 and all(width > 0 for width in widths)
        assert tab.page.evaluate(MARKS) == []


WIDTHS = "Promise.all([...document.images].map(async i => { i.loading = 'eager'; await i.decode(); return i.naturalWidth }))"
MARKS = """[...document.querySelectorAll('[data-chart]')].filter(e => {
  const lines = [...e.querySelectorAll('.scatterlayer path.js-line')].filter(p => (p.getAttribute('d') || '').length > 3).length;
  const bars = e.querySelectorAll('.barlayer .point path').length, maps = e.querySelectorAll('.heatmaplayer image').length;
  const of = kind => e.data.filter(t => t.type === kind);
  return !e.data.length || lines !== of('scatter').length || maps !== of('heatmap').length
    || bars !== of('bar').reduce((n, t) => n + t.x.length, 0);
}).map(e => e.dataset.chart)"""  # charts that do not show a line per series, a bar per value, an image per map


@pytest.mark.parametrize("width", [600, 390])
def test_a_narrow_page_scrolls_its_parts_and_not_itself(folder, width):
    with browser_tab(width) as tab:
        tab.page.goto((folder / "two" / "report.html").as_uri())
        tab.page.wait_for_function("document.documentElement.dataset.drawn", timeout=60_000)
        assert tab.page.evaluate("document.documentElement.scrollWidth") <= width
        meanings = tab.page.evaluate("[...document.querySelectorAll('td.meaning')].map(cell => cell.clientHeight)")
        assert meanings and max(meanings) < 90  # pixels: some lines, no column of single words
        assert min(tab.page.evaluate("[...document.querySelectorAll('figure')].map(f => f.clientWidth)")) >= 140


def test_a_curve_is_chosen_by_keyboard_and_by_button(folder):
    with browser_tab() as tab:
        tab.page.goto((folder / "two" / "report.html").as_uri())
        tab.page.wait_for_function("document.documentElement.dataset.drawn", timeout=60_000)
        title = tab.page.locator("#curve .ytitle").first
        assert title.text_content() == "flexion [°]"  # of a joint, which is what people ask for
        assert tab.page.locator("#curve-choice option").count() < 12
        tab.page.locator("#curve-after").click()
        groups = tab.page.locator("#curve-group option").all_text_contents()
        assert groups == ["joint angles", "angular velocities", "landmarks", "degrees of freedom"]
        tab.page.select_option("#curve-group", label="degrees of freedom")
        tab.page.wait_for_function("document.querySelector('#curve .ytitle').textContent == 'x [mm]'")
        tab.page.locator("#curve-before").click()
        tab.page.wait_for_function("document.getElementById('curve-group').value == 'landmarks'")
        tab.page.locator("#curve-choice").focus()
        tab.page.select_option("#curve-choice", label="left wrist")
        tab.page.wait_for_function("document.querySelectorAll('#curve .ytitle, #curve .y2title, #curve .y3title').length == 3")
        names = tab.page.locator("#curve .legendtext").all_text_contents()
        assert names == ["truth", "walk", "run"]
        assert tab.errors == []


def test_names_cannot_break_out_of_the_page(folder):
    text = (folder / "one" / "report.html").read_text()
    assert "a <b>camera</b> </script>" not in text and "a &lt;b&gt;camera&lt;/b&gt; &lt;/script&gt;" in text


def test_the_pdf_has_the_same_tables_in_print(folder):
    reader = pypdf.PdfReader(folder / "one" / "report.pdf")
    text = "\n".join(page.extract_text() for page in reader.pages)
    assert len(reader.pages) >= 4
    width, height = reader.pages[0].mediabox.width, reader.pages[0].mediabox.height
    assert (float(width), float(height)) == pytest.approx((595, 842), abs=2)
    for said in ("Evaluation of walk", "Joint error (MPJPE)", "30.0 (met)", "Errors per degree of freedom", "range of motion",
                 "somersault", "left wrist", "Lost intervals", "Constant offsets", "page 1", "Target through mask"):  # fmt: skip
        assert said in text, said
    assert sum(len(page.images) for page in reader.pages) >= 8
    compared = "\n".join(page.extract_text() for page in pypdf.PdfReader(folder / "two" / "report.pdf").pages)
    assert "Comparison of walk, run" in compared and "worse" in compared


def test_nothing_is_printed_beyond_the_edge(folder):
    for page in pypdf.PdfReader(folder / "two" / "report.pdf").pages:
        places = []

        def note(text, cm, tm, font, size, places=places):
            if text.strip():
                places.append((tm[4] * cm[0] + tm[5] * cm[2] + cm[4], tm[4] * cm[1] + tm[5] * cm[3] + cm[5]))

        page.extract_text(visitor_text=note)
        x, y = np.array(places).T
        assert x.min() >= 20 and x.max() <= 575 and y.min() >= 15 and y.max() <= 830


def test_every_table_and_chart_is_there_as_csv_and_json(folder):
    files = sorted(path.name for path in (folder / "one" / "figures").iterdir())
    keys = ("summary", "joints_walk", "dofs_walk", "errors", "curves", "status", "joint_map_walk", "pck")
    assert {f"{key}.{kind}" for key in keys for kind in ("csv", "json")} <= set(files)
    with (folder / "one" / "figures" / "joints_walk.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    wrist = next(row for row in rows if row["joint"] == "left wrist")
    assert float(wrist["as tracked: mean"]) == pytest.approx(30.0) == float(wrist["as tracked: max"])
    errors = json.loads((folder / "one" / "figures" / "errors.json").read_text())
    means = [value for line, _, value in errors["rows"] if line == "mean"]
    assert len(means) == N and means == pytest.approx([30.0] * N)
    curves = json.loads((folder / "one" / "figures" / "curves.json").read_text())["rows"]
    wrist = [row for row in curves if row[1] == "left wrist" and row[3] == "y"]
    assert [row[6] for row in wrist if row[4] == "truth"] == pytest.approx([row[6] for row in wrist if row[4] == "walk"])


def test_figures_of_all_runs_are_in_one_file(folder):
    metrics = json.loads((folder / "two" / "report.json").read_text())["metrics"]
    assert metrics["walk.mpjpe_mm"] == pytest.approx(30.0) and metrics["run.mpjpe_mm"] > 30.0
    assert metrics["walk.said_lost_sets"] == 3 and metrics["walk.total_ms_p99"] == pytest.approx(3.0)


def test_runs_over_the_same_images_are_shown_side_by_side(tmp_path):
    one, other = reviewed(tmp_path), reviewed(tmp_path, "run", seed=4)
    overlays, masks = contact_sheets([one, other])
    assert (overlays.title, masks.title) == ("Contact sheet, side by side", "Target through mask, side by side")
    captions = [[caption for caption, _ in row] for row in overlays.rows]
    assert captions[1] == ["walk: cam02, image 0", "run: cam02, image 0"] and len(captions) == 4
    apart = [sheet.title for sheet in contact_sheets([one, replace(other, pictures=other.pictures[:2])])]
    assert apart == ["Contact sheet: walk", "Contact sheet: run", "Target through mask: walk"]
    assert [sheet.title for sheet in contact_sheets([one])] == ["Contact sheet", "Target through mask"]


def test_what_runs_have_in_common_is_said_once(tmp_path):
    reviews = [replace(reviewed(tmp_path, name), sources={"run": name, "rig": "r.yaml"}) for name in ("a", "b")]
    facts = [label for label, _ in _facts(reviews)]
    assert facts[0] == "rig" and "a, run" in facts and "b, run" in facts and "a, rig" not in facts


def test_differences_say_which_run_is_better(tmp_path):
    one, other = reviewed(tmp_path), reviewed(tmp_path, "run", seed=4)
    table = summary_table([one, other], {})
    column = [c.title for c in table.columns].index("difference")
    by_key = {row[-1].value: row for row in table.rows}
    assert by_key["mpjpe_mm"][column].mark == "worse" and by_key["mpjpe_mm"][column].value.startswith("+")
    assert by_key["pck_50mm"][column].mark == "worse" and by_key["pck_50mm"][column].value.startswith("-")
    assert by_key["image_sets"][column].mark == "" == by_key["residual_px"][column].mark
    back = {row[-1].value: row for row in summary_table([other, one], {}).rows}
    assert back["mpjpe_mm"][column].mark == "better"


def test_targets_for_what_is_not_measured_are_missed(tmp_path):
    table = summary_table([reviewed(tmp_path, truth=False)], {"mpjpe_mm": Target(60.0, True), "said_lost_sets": Target(3, True)})
    marks = {row[-1].value: row[1].mark for row in table.rows}
    assert marks["walk.mpjpe_mm"] == "bad" and marks["walk.said_lost_sets"] == "good" and marks["walk.residual_px"] == ""


def test_strips_join_what_is_alike_and_leave_gaps():
    times = np.array([0.0, 0.1, 0.2, 0.5, 0.6])
    strips = strips_of("row", ["a", "a", "b", "b", "b"], times, 0.1, {"a": "#000", "b": "#fff"})
    assert [(s.label, round(s.start, 3), round(s.end, 3)) for s in strips] == [
        ("a", -0.05, 0.15),
        ("b", 0.15, 0.25),
        ("b", 0.45, 0.65),
    ]


def test_tables_show_dashes_for_what_is_not_known():
    table = Table("t", "t", "", [Column("a", 2), Column("b", 0)], [[float("nan"), None], [-0.001, 3]])
    assert table.texts() == [["–", "–"], ["0.00", "3"]]


def test_names_of_files_are_harmless():
    assert file_name("joints_../../etc/passwd") == "joints_.._.._etc_passwd" and file_name("..") == "figure"
    assert file_name("a b/ü") == "a_b_"


def test_names_that_files_cannot_tell_apart_get_files_of_their_own(tmp_path):
    blocks = [Table(key, "t", "", [Column("a", is_text=True)], [[key]]) for key in ("a/b", "a:b")]
    written = write_figure_files(tmp_path, Document("t", "d", [], [], [DocumentSection("s", "s", blocks)]))
    assert len(set(written)) == 4
    assert sorted(path.read_text().split()[1] for path in written if path.suffix == ".csv") == ["a/b", "a:b"]


def test_a_page_without_charts_needs_no_plotly(folder):
    assert len(render_html(Document("t", "d", [], [], []))) < 20_000


FONTS = {False: "DejaVuSans.ttf", True: "DejaVuSans-Bold.ttf"}
WIDE = "WWWW MMMM " * 60 + "W" * 400  # letters far wider than the mean


def printed(path) -> list[tuple[str, float, float]]:
    """Pieces of text of a PDF, the sizes of their letters in points, and inches to where they end."""
    fonts = {bold: ImageFont.truetype(Path(get_data_path(), "fonts/ttf", name), 100) for bold, name in FONTS.items()}
    found = []

    def note(text, cm, tm, font, size):
        text, scale = text.rstrip("\n"), abs(tm[0] * cm[0])
        if text.strip():
            wide = fonts["Bold" in font["/BaseFont"]].getlength(text) / 100 * size * scale
            found.append((text.strip(), size * scale, (tm[4] * cm[0] + cm[4] + wide) / 72))

    for page in pypdf.PdfReader(path).pages:
        page.extract_text(visitor_text=note)
    return found


def test_wide_text_ends_before_the_right_edge(tmp_path):
    columns = [Column("figure", is_text=True), Column("value"), Column("meaning", is_text=True)]
    table = Table("t", "Table", WIDE, columns, [["WWWW", 1.0, WIDE], ["W", 2.0, "M"]])
    document = Document("MWM " * 20, "d", [("fact", WIDE)], [WIDE], [DocumentSection("s", "S", [table])])
    assert write_pdf(tmp_path / "wide.pdf", document) > 0
    texts = printed(tmp_path / "wide.pdf")
    assert len(texts) > 20 and 7.0 < max(end for _, _, end in texts) <= 8.27 - 0.55
    assert min(size for _, size, _ in texts) >= 6.0 - 1e-6
    said = "".join(text for text, _, _ in texts).replace(" ", "")
    assert said.count(WIDE.replace(" ", "")) == 4  # nothing is lost where lines and words are broken


def test_very_many_columns_are_continued_below(tmp_path):
    """Legibly, with the first column before each part, no group torn apart, and titles of any length."""
    numbers = [Column(f"title{i:02}", 2, f"group{i // 4}") for i in range(40)]
    columns = [Column("figure", is_text=True), Column("key"), *numbers, Column("M" * 200), Column("a", is_text=True)]
    rows = [[f"row{k}", Cell("k.k", "code"), *(100.0 * k + i for i in range(40)), Cell(7.0, "bad"), "said"] for k in range(3)]
    write_pdf(
        tmp_path / "many.pdf", Document("t", "d", [], [], [DocumentSection("s", "S", [Table("t", "T", "", columns, rows)])])
    )
    texts = printed(tmp_path / "many.pdf")
    assert min(size for _, size, _ in texts) >= 6.0 - 1e-6 and max(end for _, _, end in texts) <= 8.27 - 0.55
    said = [word for text, _, _ in texts for word in text.split()]
    parts = said.count("figure")
    assert 3 <= parts <= 8 and [said.count(f"row{k}") for k in range(3)] == [parts] * 3
    assert all(said.count(f"title{i:02}") == said.count(f"{200 + i}.00") == 1 for i in range(40))
    assert all(said.count(f"group{g}") == 1 for g in range(10))
    assert "".join(word for word in said if set(word) == {"M"}) == "M" * 200
    assert said.count("(missed)") == 3 and "k.k" not in said  # lights are words; nobody copies keys from paper


def test_a_table_that_is_longer_than_a_page_has_its_titles_on_each(tmp_path):
    columns = [Column("name", is_text=True), Column("value")]
    table = Table("t", "T", "", columns, [[f"row{i}", float(i)] for i in range(200)])
    n = write_pdf(tmp_path / "long.pdf", Document("t", "d", [], [], [DocumentSection("s", "S", [table])]))
    pages = [page.extract_text() for page in pypdf.PdfReader(tmp_path / "long.pdf").pages]
    assert len(pages) == n and n >= 3 and all("value" in page for page in pages if "row" in page)
    assert [word for page in pages for word in page.split() if word.startswith("row")] == [f"row{i}" for i in range(200)]


def test_the_first_thing_on_the_page_is_the_motion_and_it_plays(folder):
    with browser_tab() as tab:
        tab.page.goto((folder / "one" / "report.html").as_uri())
        tab.page.wait_for_function("document.documentElement.dataset.drawn", timeout=60_000)
        assert tab.page.locator("h2").first.text_content() == "The motion"
        frame = "document.querySelector('[data-scene] input').value"
        before = tab.page.evaluate(PICTURE)
        assert before["colors"] > 3  # limbs of both sides, the trunk, the floor
        tab.page.locator("[data-scene] .play").click()
        tab.page.wait_for_function(f"Number({frame}) > 3", timeout=60_000)
        tab.page.locator("[data-scene] canvas").focus()
        tab.page.keyboard.press("ArrowRight")  # stops it, too
        at = tab.page.evaluate(frame)
        assert tab.page.evaluate(PICTURE)["pixels"] != before["pixels"]
        box = tab.page.locator("[data-scene] canvas").bounding_box()
        still = tab.page.evaluate(PICTURE)["pixels"]
        tab.page.mouse.move(box["x"] + 200, box["y"] + 200)
        tab.page.mouse.down()
        tab.page.mouse.move(box["x"] + 300, box["y"] + 220)
        tab.page.mouse.up()
        assert tab.page.evaluate(PICTURE)["pixels"] != still and tab.page.evaluate(frame) == at
        assert tab.page.locator("[data-scene] .said").text_content().endswith(("tracking", "lost"))
        assert tab.errors == []


PICTURE = """(() => {
  const canvas = document.querySelector('[data-scene] canvas');
  const data = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
  const counts = new Map();
  let sum = 0;
  for (let i = 0; i < data.length; i += 4) {
    if (data[i + 3] === 0) continue;
    const color = (data[i] << 16) | (data[i + 1] << 8) | data[i + 2];
    counts.set(color, (counts.get(color) || 0) + 1);
    sum = (sum * 31 + i + color) % 1000000007;
  }
  return { colors: [...counts.values()].filter(n => n > 200).length, pixels: sum };
})()"""  # how many colors cover more than 200 pixels, and a number that changes with the picture


def test_who_walks_gets_strides_and_who_does_not_gets_none(tmp_path):
    found = reviewed(tmp_path)
    assert found.gait is None and kinematics.gait_table(found) is None and kinematics.gait_charts(found) == []
    start = np.array([0.0, 1.0, 2.1])
    angles = {"knee_flexion": np.linspace(0.0, 60.0, N_PARTS) + np.arange(3.0)[:, None]}
    foot = Strides(start, start + 0.6, start + 1.0, np.full(3, 1.4), np.array([0.5, np.nan, 0.6]), angles)
    other = replace(foot, lengths_m=np.full(3, 1.0))
    walking = replace(found)
    walking.__dict__["gait"] = Gait({"left": foot, "right": other}, 1.25)
    rows = {row[0]: row[1:] for row in kinematics.gait_table(walking).rows}
    assert [cell.value for cell in rows["Stride length"][:5]] == pytest.approx([1.4, 0.0, 1.0, 0.0, 1.4])
    assert rows["Step time"][0].value == pytest.approx(0.55) and rows["Stance"][2].value == pytest.approx(60.0)
    (chart,) = kinematics.gait_charts(walking)
    assert [line.label for line in chart.lines] == ["left", "right"]
    assert chart.lines[1].spread == pytest.approx(np.ones(N_PARTS))
    metrics = walking.metrics()
    assert metrics["walk.cadence_per_min"] == pytest.approx(60.0 / 0.55) and metrics["walk.strides_right"] == 3
    write_report(tmp_path / "report", [walking], ReportOptions(pdf=False))
    page = (tmp_path / "report" / "report.html").read_text()
    assert "Whole ones: 3 of the left foot and 3 of the right foot" in page and "Stride length left" in page
