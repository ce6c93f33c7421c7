"""Figures of a calibration from a board: of cameras and boards whose figures are known beforehand."""

from dataclasses import replace

import numpy as np
import pytest

from helpers.cameras.board_scenes import CHARUCO, PERIOD_S, board_pose, corners_seen, ring
from tracker_node.calibration.board.adjustment import BoardAdjustment, BoardState
from tracker_node.calibration.board.refinement import rows_of
from tracker_node.calibration.board.report import (
    CameraMetrics,
    camera_metrics,
    coverage_notes,
    covered,
    pair_metrics,
    rig_metrics,
    rms,
    worst_views,
)
from tracker_node.calibration.board.rig import BoardRig
from tracker_node.calibration.board.views import group_views
from tracker_node.camera.rig import CameraRig

N_PARAMETERS = 16


@pytest.fixture(scope="module")
def found():
    """Three cameras at their true places, boards at theirs, corners as they are projected: nothing is off."""
    rig = CameraRig(ring(8, ("plumb_bob",)).cameras[:3])  # near enough to each other to see the same boards
    seen = corners_seen(rig, n=40, noise_px=0.0)
    time_steps = tuple(group_views({name: views.views for name, views in seen.items()}, 0.01))
    boards = np.array([board_pose(round(time_step.stamp_ns * 1e-9 / PERIOD_S) * PERIOD_S) for time_step in time_steps])
    state = BoardState.at(tuple(c.model for c in rig), np.array([c.T_cam_world for c in rig]), boards)
    n = len(rows_of(rig.names, time_steps).camera)
    sigmas = tuple(np.arange(1.0, 1.0 + N_PARAMETERS) * (i + 1) for i in range(3))
    adjustment = BoardAdjustment(state, np.zeros((n, 2)), sigmas, 3, True)
    return BoardRig(rig, CHARUCO, time_steps, adjustment, np.zeros((len(time_steps), 6)), ())


def with_residuals(found, residuals, **state):
    adjustment = replace(found.adjustment, residuals_px=residuals, state=replace(found.state, **state))
    return replace(found, adjustment=adjustment)


def figures(clock_s=0.0, sigma_s=0.0):
    empty = np.array([[3.0, 4.0], [0.0, 1.0], [0.0, 0.0]])
    return CameraMetrics(empty, empty, 1, 0.0, 0.0, clock_s, sigma_s, 0.0, np.zeros(4))


def test_rms_is_of_lengths():
    assert rms(np.array([[3.0, 4.0], [0.0, 5.0]])) == pytest.approx(5.0)
    assert rms(np.array([[3.0, 4.0], [0.0, 0.0]])) == pytest.approx(5.0 / np.sqrt(2.0))
    assert figures().rms_px == pytest.approx(np.sqrt(26.0 / 3.0))
    assert figures().median_px == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("clock_s", "sigma_s", "off"),
    [(0.9e-3, 0, False), (1.1e-3, 0, True), (-1.1e-3, 0, True), (0.029, 0.01, False), (0.031, 0.01, True), (-0.031, 0.01, True)],
)  # fmt: skip
def test_a_clock_is_off_by_more_than_three_sigmas_and_a_millisecond(clock_s, sigma_s, off):
    assert figures(clock_s, sigma_s).clock_is_off == off


def test_figures_of_cameras(found):
    rows = rows_of(found.rig.names, found.time_steps)
    residuals = np.tile([[0.5, -0.5]], (len(rows.camera), 1)) * (1 + rows.camera[:, None])
    jitter_s = np.full((len(found.time_steps), 3), 0.02)
    result = camera_metrics(with_residuals(found, residuals, clocks_s=np.array([0.0, 0.1, -0.2]), jitter_s=jitter_s))
    assert list(result) == list(found.rig.names)
    for i, (name, c) in enumerate(result.items()):
        seen = [time_step.views[name] for time_step in found.time_steps if name in time_step.views]
        sigma = 1.4826 * 0.5 * (i + 1) * found.adjustment.sigmas[i]
        assert (c.views, len(c.pixels)) == (len(seen), sum(len(view.ids) for view in seen))
        assert np.allclose(c.pixels, np.concatenate([view.pixels for view in seen]))
        assert c.rms_px == c.median_px == pytest.approx((i + 1) * np.sqrt(0.5))
        assert c.place_sigma_m == pytest.approx(np.linalg.norm(sigma[:3]))
        assert c.turn_sigma_rad == pytest.approx(np.linalg.norm(sigma[3:6]))
        assert c.clock_sigma_s == pytest.approx(sigma[6])
        assert np.allclose(c.lens_sigma, sigma[7:])
        assert c.jitter_s == pytest.approx(0.02)
    assert [c.clock_s for c in result.values()] == [0.0, 0.1, -0.2]


def test_pairs_that_are_true_agree(found):
    result = pair_metrics(found)
    assert len(result) == 2  # the first and the last see no board together
    for (a, b), (n, error) in result.items():
        together = [i for i in found.time_steps if a in i.views and b in i.views and set(i.views[a].ids) & set(i.views[b].ids)]
        assert n == len(together) > 0
        assert error < 1e-3
    assert all(found.rig.names.index(a) < found.rig.names.index(b) for a, b in result)


def test_a_camera_whose_corners_are_off_disagrees_with_the_others_alone(found):
    """Corners of one camera lie 2 px off across its images: pairs with it are about half of that off in each image."""
    rows = rows_of(found.rig.names, found.time_steps)
    off = np.where((rows.camera == 2)[:, None], [0.0, 2.0], 0.0)
    good = {pair for pair in pair_metrics(found) if found.rig.names[2] not in pair}
    for pair, (_, error) in pair_metrics(with_residuals(found, off)).items():
        if pair in good:
            assert error < 1e-3
        else:
            assert 0.05 < error < 2.0


def test_a_pair_that_sees_no_board_together_is_left_out(found):
    first = found.rig.names[0]
    alone = tuple(replace(i, views={first: i.views[first]}) for i in found.time_steps if first in i.views)
    state = replace(
        found.state, Ts_world_board=found.state.Ts_world_board[: len(alone)], jitter_s=found.state.jitter_s[: len(alone)]
    )
    n = sum(len(i.views[first].ids) for i in alone)
    lonely = replace(found, time_steps=alone, adjustment=replace(found.adjustment, state=state, residuals_px=np.zeros((n, 2))))
    assert pair_metrics(lonely) == {}


def test_flat_metrics_say_the_same(found):
    rows = rows_of(found.rig.names, found.time_steps)
    wrong = with_residuals(found, np.tile([[0.3, 0.4]], (len(rows.camera), 1)), clocks_s=np.array([0.0, 0.002, 0.0]))
    metrics = rig_metrics(wrong)
    a, b, _ = found.rig.names
    assert metrics["rig.sets"] == len(found.time_steps)
    assert metrics["rig.corners"] == len(rows.camera)
    assert metrics["rig.rms_px"] == metrics["rig.median_px"] == pytest.approx(0.5)
    assert (metrics["rig.outliers"], metrics["rig.converged"]) == (0, 1)
    assert metrics[f"rig.{b}.later_ms"] == pytest.approx(2.0)
    assert metrics[f"rig.{b}.place_sigma_mm"] == pytest.approx(1e3 * camera_metrics(wrong)[b].place_sigma_m)
    assert metrics[f"rig.{a}_{b}.sets"] == pair_metrics(wrong)[a, b][0]


def test_worst_views_come_first(found):
    rows = rows_of(found.rig.names, found.time_steps)
    residuals = np.zeros((len(rows.camera), 2))
    for k, time_step in enumerate(found.time_steps[:4]):
        residuals[(rows.time_step == k) & (rows.camera == found.rig.names.index(next(iter(time_step.views)))), 0] = 1.0 + k
    worst = worst_views(with_residuals(found, residuals), 3)
    assert [error for *_, error in worst] == pytest.approx([4.0, 3.0, 2.0])
    for (name, image, _), time_step in zip(worst, found.time_steps[3:0:-1], strict=True):
        assert (name, image) == (next(iter(time_step.views)), time_step.views[name].image)


@pytest.mark.parametrize("size", [(800, 600), (600, 800)])
def test_a_corner_covers_its_cell(size):
    width, height = size
    n = 48  # eight by six cells of 100 pixels
    assert covered(np.array([[50.0, 50.0]]), size) == pytest.approx(1 / n)
    assert covered(np.array([[1.0, 1.0], [99.0, 99.0]]), size) == pytest.approx(1 / n)
    assert covered(np.array([[99.0, 50.0], [101.0, 50.0], [50.0, 101.0]]), size) == pytest.approx(3 / n)
    assert covered(np.array([[width - 0.5, height - 0.5], [width + 5.0, height + 5.0]]), size) == pytest.approx(1 / n)
    u, v = np.meshgrid(np.arange(50.0, width, 100.0), np.arange(50.0, height, 100.0))
    assert covered(np.stack([u.ravel(), v.ravel()], axis=1), size) == 1.0


def test_a_note_for_each_camera_whose_image_is_covered_too_little():
    u, v = np.meshgrid(np.arange(50.0, 800.0, 100.0), np.arange(50.0, 600.0, 100.0))
    cells = np.stack([u.ravel(), v.ravel()], axis=1)
    notes = coverage_notes({"few": cells[:19], "enough": cells[:20]}, {"few": (800, 600), "enough": (800, 600)})
    assert len(notes) == 1
    assert "40 % of the image of few" in notes[0]
