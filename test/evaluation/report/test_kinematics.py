"""What the report says of a walk and of a jump that are known."""

import json
from dataclasses import replace

import numpy as np
import pytest

from helpers.bodies.stick_person import write_run, write_state_bag
from helpers.motion import known_motions as known
from helpers.motion.opensim_legs import write_legs
from helpers.studio.browser import browser_tab
from tracker_node.cli.main import main
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.consistency import landmark_sds
from tracker_node.evaluation.evaluate import EvaluationOptions
from tracker_node.evaluation.motion.jumps import GRAVITY
from tracker_node.evaluation.report import kinematics
from tracker_node.evaluation.report.builder import ReportOptions, write_report
from tracker_node.evaluation.report.charts import covariance_charts
from tracker_node.evaluation.review import Review, Truth, review
from tracker_node.loaders.model.model_yaml import dump_model
from tracker_node.loaders.motion.trc import load_table
from tracker_node.render.palette import SIDES
from tracker_node.runs.data import RunDetails
from tracker_node.runs.load import load_run

OMEGA = 2.0 * np.pi / known.STRIDE_S


def reviewed(folder, motion, **options) -> Review:
    write_run(folder, motion)
    return review(load_run(folder), motion.model, Truth(), EvaluationOptions(folder.name, **options))


@pytest.fixture(scope="module")
def walk(tmp_path_factory) -> Review:
    return reviewed(tmp_path_factory.mktemp("walk") / "walk", known.walk(), cutoff_hz=6.0)


@pytest.fixture(scope="module")
def jump(tmp_path_factory) -> Review:
    return reviewed(tmp_path_factory.mktemp("jump") / "jump", known.jump(2.6, times=2))


def test_ranges_speeds_and_symmetry_of_the_walk(walk):
    made = {table.key: table for table in kinematics.range_tables(walk)}
    rows = {row[0]: row[1:] for row in made["ranges_walk"].rows}
    left, right = (2.0 * value for value in known.KNEE_DEG)
    low, high, width, sd = rows["knee flexion"][:4]
    assert (low, high, width) == pytest.approx(
        (known.KNEE_MEAN_DEG - 0.5 * left, known.KNEE_MEAN_DEG + 0.5 * left, left), abs=0.3
    )
    assert sd < 0.3 and rows["knee flexion"][6] == pytest.approx(right, abs=0.3)
    assert rows["knee flexion"][8] == pytest.approx(200.0 * (left - right) / (left + right), abs=0.6)
    assert "hip adduction" not in rows and list(rows)[:3] == ["hip flexion", "knee flexion", "elbow flexion"]  # what moves
    assert "Robinson" in made["ranges_walk"].note and "Butterworth, 4th order, no lag, 6 Hz" in made["ranges_walk"].note
    speeds = {row[0]: row[1:] for row in made["speeds_walk"].rows}
    assert speeds["hip flexion"][0] == pytest.approx(known.HIP_DEG[0] * OMEGA, rel=0.02)
    assert speeds["hip flexion"][2] == pytest.approx(known.HIP_DEG[1] * OMEGA, rel=0.02)
    single = {row[0]: row[1:] for row in made["single_ranges_walk"].rows}
    assert single["spine turn left"][2] == pytest.approx(2.0 * known.TURN_DEG, abs=0.2)


def test_curves_of_a_joint_have_both_sides_and_name_the_filter(walk):
    found = {(curve.group, curve.name): curve for curve in kinematics.joint_curves([walk])}
    assert next(iter(found)) == (kinematics.ANGLES, "hip")
    knee = found[kinematics.VELOCITIES, "knee"]
    axis, lines = knee.panels[0]
    assert (axis, knee.unit, knee.filter) == ("flexion", "°/s", "Butterworth, 4th order, no lag, 6 Hz")
    assert [(line.label, line.color) for line in lines] == list(SIDES.items())
    assert np.nanmax(lines[0].y) == pytest.approx(known.KNEE_DEG[0] * OMEGA, rel=0.02)
    both = {curve.name: curve for curve in kinematics.joint_curves([walk, replace(walk, name="again")])}
    assert [line.label for line in both["hip"].panels[0][1]] == ["again, left", "again, right", "walk, left", "walk, right"]


def test_events_of_the_walk(walk):
    strips = kinematics.event_strips(walk)
    assert strips.rows == ["left foot", "right foot"]
    floor = [strip for strip in strips.strips if strip.row == "left foot" and strip.label == "on the floor"]
    assert np.diff([strip.start for strip in floor]) == pytest.approx(known.STRIDE_S, abs=0.01)
    charts = {chart.title: chart for chart in kinematics.gait_charts(walk)}
    assert set(charts) == {"Hip flexion", "Knee flexion"} and charts["Hip flexion"].filter.endswith("6 Hz")
    left = charts["Knee flexion"].lines[0]
    assert np.ptp(left.y) == pytest.approx(2.0 * known.KNEE_DEG[0], abs=0.4) and left.spread.max() < 0.5
    assert kinematics.jump_table(walk) is None is kinematics.jump_chart(walk)


def test_heights_of_the_jumps(jump):
    height = 100.0 * 2.6**2 / (2.0 * GRAVITY)
    table = kinematics.jump_table(jump)
    assert len(table.rows) == 2 and table.columns[2].group.startswith("rise")
    for row in table.rows:
        for value, sd in (row[2:4], row[4:6], row[6:8]):
            assert abs(value - height) < 1.5 * sd < 2.5  # centimeters
        assert row[10] == pytest.approx(GRAVITY, rel=1e-3)
    metrics = jump.metrics()
    assert metrics["jump.jumps"] == 2 and metrics["jump.jump_height_take_off_m"] == pytest.approx(0.01 * height, abs=0.01)
    chart = kinematics.jump_chart(jump)
    assert len(chart.bands) == 2 and chart.filter == "not filtered" and np.ptp(chart.lines[0].y) > height
    strips = kinematics.event_strips(jump).strips
    assert [strip.row for strip in strips] == [*["left foot"] * 3, *["right foot"] * 3, *["jumps"] * 2]
    for foot in (strips[:3], strips[3:6]):  # on the floor before, between and after the jumps
        for before, flight, after in zip(foot, strips[6:], foot[1:], strict=False):
            assert before.end == pytest.approx(flight.start, abs=0.06)
            assert after.start == pytest.approx(flight.end, abs=0.06)
    assert metrics["jump.contacts_left"] == 3 and 50.0 < metrics["jump.contact_percent_left"] < 90.0
    assert kinematics.gait_table(jump) is None


def test_uncertainties_are_the_roots_of_the_covariance(walk):
    run = walk.run
    n, d = len(run), walk.model.chain.n_dof
    covariances = np.tile(np.diag(np.full(d, np.radians(2.0) ** 2)), (n, 1, 1)).astype(np.float32)
    covariances[:, :3, :3] = np.diag([0.01**2, 0.02**2, 0.03**2])
    covariances[:, 10, 10] = np.radians(6.0) ** 2
    told = replace(walk, run=replace(run, details=replace(RunDetails.unknown(n, d), covariances=covariances)))
    angles, root = covariance_charts(told)
    assert angles.lines[0].y == pytest.approx(2.0, rel=1e-4) and angles.lines[1].y == pytest.approx(6.0, rel=1e-4)
    assert [float(line.y[5]) for line in root.lines] == pytest.approx([10.0, 20.0, 30.0], rel=1e-4)
    assert list(covariance_charts(walk)) == []


@pytest.mark.parametrize("cutoff_hz", [0.0, 28.0, float("nan"), "sometimes"])
def test_a_cutoff_that_the_rate_does_not_allow_is_refused(tmp_path, cutoff_hz):
    with pytest.raises(FileFormatError, match=r"'--filter': expected one of auto, none, or a cutoff in \(0, 27\] Hz"):
        reviewed(tmp_path / "w", known.walk(seconds=1.0), cutoff_hz=cutoff_hz)


def test_the_page_is_in_the_order_in_which_people_ask(tmp_path, walk, jump):
    for found in (walk, jump):
        write_report(tmp_path / found.name, [found], ReportOptions(figure_files=True, pdf=False))
        page = tmp_path / found.name / "report.html"
        assert page.stat().st_size < 4e6
        with browser_tab() as tab:
            tab.page.goto(page.as_uri())
            tab.page.wait_for_function("document.documentElement.dataset.drawn", timeout=60_000)
            titles = tab.page.locator("h2").all_text_contents()
            assert titles[:6] == ["The motion", "Curves", "Events", "Ranges and symmetry", "Quality", "Figures"]
            assert tab.page.evaluate(UNSAID) == []
            assert tab.page.locator("details").count() == 1 and not tab.page.locator("details table").is_visible()
            asked = tab.page.locator("h4").all_text_contents()
            assert asked[0] == "How does the body move?" and asked[1] == "Is it found in every image set?"
            assert tab.errors == []


def test_printed_charts_are_as_wide_as_the_paper(tmp_path, walk):
    write_report(tmp_path, [walk], ReportOptions(pdf=False))
    with browser_tab() as tab:
        tab.page.goto((tmp_path / "report.html").as_uri())
        tab.page.wait_for_function("document.documentElement.dataset.drawn", timeout=60_000)
        widths = "[...document.querySelectorAll('.main-svg')].map(e => e.clientWidth || e.getBoundingClientRect().width)"
        assert max(tab.page.evaluate(widths)) > 1000
        tab.page.evaluate("dispatchEvent(new Event('beforeprint'))")
        assert 650 < max(tab.page.evaluate(widths)) <= 710
        tab.page.evaluate("dispatchEvent(new Event('afterprint'))")
        tab.page.wait_for_function(f"Math.max(...{widths}) > 1000", timeout=10_000)


UNSAID = """[...document.querySelectorAll('[data-chart], #curve')].filter(e =>
    e.data.every(t => t.type === 'scatter') && !e.textContent.includes('Filter: ')
).map(e => e.id || e.dataset.chart)"""  # plots of signals that do not say how they were filtered


def test_residuals_of_opensim_are_in_the_report(opensim, tmp_path):
    """Legs in the size of the body leave nothing but what the turn of the trunk does to the shoulders, which are fixed there."""
    motion = known.walk(seconds=3.0)
    legs = write_legs(opensim, motion.model, tmp_path / "legs.osim")
    write_run(tmp_path / "walk", motion)
    write_state_bag(tmp_path / "walk" / "bag", motion)
    dump_model(motion.model, tmp_path / "person.yaml")
    given = ["evaluate", str(tmp_path / "walk"), "--model", str(tmp_path / "person.yaml"), "--opensim", str(legs), "--csv"]
    assert main([*given, "--no-pdf", "--name", "walk", "--output", str(tmp_path / "out")]) == 0
    metrics = json.loads((tmp_path / "out" / "report.json").read_text())["metrics"]
    assert metrics["walk.opensim_sets"] == len(motion.states)
    assert 1.0 < metrics["walk.opensim_marker_rms_mm"] < 15.0 < metrics["walk.opensim_marker_max_mm"] + 10.0 < 40.0
    table = load_table(tmp_path / "out" / "opensim.mot")
    assert np.ptp(table.values[:, table.names.index("knee_angle_left")]) == pytest.approx(2.0 * known.KNEE_DEG[0], abs=2.0)
    rows = (tmp_path / "out" / "figures" / "opensim_walk.csv").read_text().splitlines()
    assert rows[0].startswith("marker,rms [mm]") and len(rows) == 9
    with browser_tab() as tab:
        tab.page.goto((tmp_path / "out" / "report.html").as_uri())
        tab.page.wait_for_function("document.documentElement.dataset.drawn", timeout=60_000)
        assert tab.page.locator("[data-chart=opensim_residual_walk] .main-svg").count() >= 1 and tab.errors == []
        tab.page.select_option("#curve-group", label="coordinates of OpenSim")
        assert "knee angle left" in tab.page.locator("#curve-choice option").all_text_contents()


def test_landmarks_are_as_sure_as_the_covariance_says(walk):
    n, d = len(walk.run), walk.model.chain.n_dof
    covariances = np.zeros((n, d, d), dtype=np.float32)
    covariances[:, :3, :3] = np.diag([0.01**2, 0.02**2, 0.03**2])  # of the root's place alone, which all landmarks share
    told = replace(walk.run, details=replace(RunDetails.unknown(n, d), covariances=covariances))
    sds = landmark_sds(told, walk.model)
    assert sds == pytest.approx(np.full(sds.shape, np.sqrt(14.0 / 3.0) * 0.01), rel=1e-4)
    assert landmark_sds(walk.run, walk.model) is None
