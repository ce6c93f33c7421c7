from dataclasses import replace
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from helpers.cameras.board_scenes import CHARUCO, CHESSBOARD, LENSES, corners_seen, ring
from helpers.cameras.camera_rigs import circle_rig
from tracker_node.calibration.board.adjustment import lens_vector
from tracker_node.calibration.board.board import Board, BoardView
from tracker_node.calibration.board.intrinsics import calibrate_lens
from tracker_node.calibration.board.refinement import BoardRigOptions
from tracker_node.calibration.board.report import (
    camera_metrics,
    coverage_notes,
    covered,
    late_cameras,
    pair_metrics,
    rig_tables,
    worst_views,
    write_rig_page,
)
from tracker_node.calibration.board.rig import calibrate_rig, first_camera_world, given_lenses, with_clocks
from tracker_node.calibration.board.views import BoardTimeStep, chosen, group_views, speeds, with_neighbors
from tracker_node.calibration.tracked_body.rig_fit import world_of_most
from tracker_node.camera.model import CameraModel
from tracker_node.errors import CalibrationError, TrackerError
from tracker_node.geometry import se3, so3


def differences(found, true):
    """Largest distance (m) and angle (rad) between cameras of two rigs laid onto each other."""
    wanted = np.array([true[name].T_world_cam for name in found.names])
    poses = np.array([camera.T_world_cam for camera in found])
    poses = wanted[0] @ se3.inverse(poses[0]) @ poses
    poses = world_of_most(poses, wanted, scaled=False)[0] @ poses
    turns = [np.linalg.norm(so3.log(a[:3, :3].T @ b[:3, :3])) for a, b in zip(poses, wanted, strict=True)]
    return np.linalg.norm(poses[:, :3, 3] - wanted[:, :3, 3], axis=1).max(), max(turns)


@pytest.fixture(scope="module")
def exact():
    """Six cameras of three lens models, corners with 0.3 px of noise."""
    rig = ring()
    seen = corners_seen(rig, n=150, period_s=0.3)
    return rig, seen, calibrate_rig(CHARUCO, seen, BoardRigOptions(clocks="exact"))


def test_rig_and_lenses_are_found(exact):
    rig, _, found = exact
    place, turn = differences(found.rig, rig)
    assert place < 0.012 and np.degrees(turn) < 0.25
    for camera in found.rig:
        np.testing.assert_allclose(np.diag(camera.model.K), np.diag(rig[camera.name].model.K), rtol=3e-3)
    assert not found.outliers and found.adjustment.converged


def test_sigmas_are_as_large_as_the_errors(exact):
    rig, _, found = exact
    ratios = []
    for name, figures in camera_metrics(found).items():
        error = lens_vector(found.rig[name].model)[:4] - lens_vector(rig[name].model)[:4]
        ratios.append(error / figures.lens_sigma[:4])
    assert 0.4 < np.sqrt(np.mean(np.square(ratios))) < 2.0  # 24 normal numbers


def test_the_world_is_that_of_the_first_camera(exact):
    _, _, found = exact
    first = found.rig.cameras[0]
    np.testing.assert_allclose(first.center, 0.0, atol=1e-9)
    np.testing.assert_allclose(first.T_world_cam[:3, 2], [1.0, 0.0, 0.0], atol=1e-9)  # looks along x
    np.testing.assert_allclose(first.T_world_cam[:3, 1], [0.0, 0.0, -1.0], atol=1e-9)  # its rows go down
    assert np.allclose(first_camera_world(found.rig).cameras[3].T_world_cam, found.rig.cameras[3].T_world_cam)


def test_pairs_agree_to_the_noise(exact, tmp_path):
    _, seen, found = exact
    pairs = pair_metrics(found)
    assert len(pairs) >= 6 and all(0.1 < error < 0.45 for n, error in pairs.values() if n > 5)
    cameras, table, *_ = rig_tables(found, seen)
    assert [row[0] for row in cameras.table[1:]] == list(seen) and len(table.table[1:]) == len(pairs)
    assert len(worst_views(found)) == 5
    write_rig_page(tmp_path / "rig.html", found, seen)
    page = (tmp_path / "rig.html").read_text()
    assert page.count("data:image/png") == 6 and "http" not in page.replace("http://www.w3.org", "")


@pytest.mark.long
def test_clocks_and_stamps_that_are_off_are_found():
    rig, late_s = ring(8, ["plumb_bob"]).subset(["cam1", "cam2", "cam3"]), [0.0, 0.04, -0.03]
    seen = corners_seen(rig, n=150, noise_px=0.2, late_s=late_s, jitter_s=0.008)
    lenses = {camera.name: camera.model for camera in rig}
    free, believed = (
        calibrate_rig(CHARUCO, seen, BoardRigOptions(clocks=clocks, free_lenses=False), lenses) for clocks in ("free", "exact")
    )
    figures = camera_metrics(free)
    for name, true_s in zip(rig.names, late_s, strict=True):
        assert abs(figures[name].clock_s - true_s) <= 3.0 * figures[name].clock_sigma_s < 0.012
    assert figures["cam2"].clock_is_off and figures["cam3"].clock_is_off and not figures["cam1"].clock_is_off
    assert set(late_cameras(free)) == {"cam2", "cam3"} and late_cameras(free)["cam2"] == figures["cam2"].clock_s
    assert differences(free.rig, rig)[0] < 0.5 * differences(believed.rig, rig)[0]
    assert figures["cam2"].rms_px < 0.5 < 1.0 < camera_metrics(believed)["cam2"].rms_px
    assert 0.004 < figures["cam2"].jitter_s < 0.012


def test_views_that_do_not_fit_are_left_out_and_named():
    rig = ring(8, ["plumb_bob"]).subset(["cam1", "cam2", "cam3"])
    seen = corners_seen(rig, n=70, period_s=0.3)
    views = list(seen["cam2"].views)
    others = {view.image for name in ("cam1", "cam3") for view in seen[name].views}
    wrong = [i for i, view in enumerate(views) if view.image in others][3:10:6]
    for i in wrong:
        views[i] = replace(views[i], pixels=views[i].pixels + np.array([25.0, 12.0]))
    seen["cam2"] = replace(seen["cam2"], views=tuple(views))
    found = calibrate_rig(CHARUCO, seen, BoardRigOptions(clocks="exact"))
    expected = {("cam2", views[i].image) for i in wrong}
    # Where two cameras alone see the board, and disagree, both may be left out
    assert {view.image for _, view in found.outliers} == {image for _, image in expected}
    together = [i for i in found.time_steps if len(i.views) > 1]
    assert not any(view.image in {views[i].image for i in wrong} for i in together for view in i.views.values())
    assert differences(found.rig, rig)[0] < 0.02


@pytest.mark.parametrize("kind", list(LENSES))
def test_a_lens_alone_is_that_of_opencv(kind):
    camera = ring(1, [kind]).cameras[0]
    views = corners_seen(ring(1, [kind]), n=200, period_s=0.4)["cam1"].views
    found = calibrate_lens("cam1", CHARUCO, views, (camera.model.width, camera.model.height), kind)
    assert 0.35 < found.rms_px < 0.5 and len(found.views) <= 80
    assert np.all(np.abs(lens_vector(found.lens) - lens_vector(camera.model))[:4] < 4.0 * found.sigma[:4])
    assert found.sigma[:4].max() < 6.0
    points = [CHARUCO.corners[v.ids].astype(np.float32) for v in found.views]
    pixels = [v.pixels.astype(np.float32) for v in found.views]
    if kind == "plumb_bob":
        _, K, distortion, _, _ = cv2.calibrateCamera(points, pixels, (1280, 800), None, None)
        np.testing.assert_allclose(found.lens.K, K, atol=1.5)
        np.testing.assert_allclose(found.lens.distortion[:4], distortion.ravel()[:4], atol=0.02)


def test_a_lens_of_another_board_or_that_is_hardly_known_is_not_to_be_used():
    seen = [corners_seen(ring(1, ["plumb_bob"]), n=200, noise_px=noise_px)["cam1"].views for noise_px in (0.3, 6.0)]
    assert calibrate_lens("cam1", CHARUCO, seen[0], (1280, 800)).doubt == ""
    doubt = calibrate_lens("cam1", CHARUCO, seen[0][:6], (1280, 800)).doubt
    assert "show the board in more places, and tilted in other ways" in doubt
    with pytest.raises(CalibrationError, match=r"fit to \d\.\d px only: is it the board you gave, and a lens of plumb_bob\?"):
        calibrate_lens("cam1", CHARUCO, seen[1], (1280, 800))


def test_cameras_that_do_not_hang_together_are_named():
    seen = corners_seen(ring(4, ["plumb_bob"]), n=120)
    for name in ("cam3", "cam4"):  # their clock is another day's
        seen[name] = replace(seen[name], views=tuple(replace(v, stamp_ns=v.stamp_ns + 10**13) for v in seen[name].views))
    with pytest.raises(TrackerError, match=r"the cameras fall apart: \{cam1, cam2\} and \{cam3, cam4\}"):
        calibrate_rig(CHARUCO, seen)
    pair = {name: seen[name] for name in ("cam1", "cam3")}
    with pytest.raises(TrackerError, match="never seen by two cameras together"):
        calibrate_rig(CHARUCO, pair)


def test_boards_and_views_that_do_not_do_are_refused():
    seen = corners_seen(ring(2, ["plumb_bob"]), n=60)
    with pytest.raises(TrackerError, match="looks the same upside down"):
        calibrate_rig(Board("chessboard", 8, 6, 0.1), seen)
    with pytest.raises(TrackerError, match="at least two cameras"):
        calibrate_rig(CHARUCO, {"cam1": seen["cam1"]})
    with pytest.raises(CalibrationError, match=r"'cam1'.*at least 4 sharp images, got 3"):
        calibrate_lens("cam1", CHARUCO, seen["cam1"].views[:3], (1280, 800))
    still = [replace(view, image=view.image + k) for k in range(30) for view in seen["cam1"].views[:1]]
    with pytest.raises(CalibrationError, match="4 views of the board that are unlike, got 1 of 30"):
        calibrate_lens("cam1", CHARUCO, still, (1280, 800))
    frontal = [replace(v, ids=np.arange(48), pixels=640.0 + (200 + 10 * i) * CHARUCO.corners[:, :2]) for i, v in
               enumerate(seen["cam1"].views[:8])]  # fmt: skip
    with pytest.raises(CalibrationError, match="parallel to the image"):
        calibrate_lens("cam1", CHARUCO, frontal, (1280, 800))


def test_too_little_coverage_is_said():
    everywhere = np.stack(np.meshgrid(np.arange(10.0, 1280.0, 40.0), np.arange(10.0, 800.0, 40.0)), axis=-1).reshape(-1, 2)
    left = everywhere[everywhere[:, 0] < 400.0]
    sizes = {"whole": (1280, 800), "left": (1280, 800)}
    assert covered(everywhere, (1280, 800)) == 1.0 and covered(left, (1280, 800)) == pytest.approx(3 / 8)
    (note,) = coverage_notes({"whole": everywhere, "left": left}, sizes)
    assert "cover 38 % of the image of left" in note


def test_views_are_grouped_by_their_stamps():
    a, b = corners_seen(ring(8, ["plumb_bob"]).subset(["cam1", "cam2"]), CHESSBOARD, n=60).values()
    moved = [replace(v, stamp_ns=v.stamp_ns + 30_000_000) for v in b.views]
    together = [i for i in group_views({"a": a.views, "b": moved}, 0.05) if len(i.views) == 2]
    assert together and all(i.views["a"].image == i.views["b"].image for i in together)
    assert all(len(i.views) == 1 for i in group_views({"a": a.views, "b": moved}, 0.02))
    assert together[0].stamp_ns == together[0].views["a"].stamp_ns + 15_000_000


def test_still_boards_in_new_places_are_chosen():
    views = list(corners_seen(ring(1, ["plumb_bob"]), n=120, noise_px=0.0)["cam1"].views)
    still = [replace(views[0], stamp_ns=v.stamp_ns, image=v.image) for v in views[:20]] + views[20:]
    pace = speeds(still)
    assert pace[5] == 0.0 and np.nanmax(pace) > 50.0
    time_steps = [BoardTimeStep({"cam1": view}) for view in still]
    paces = {("cam1", v.image): float(p) for v, p in zip(still, pace, strict=True)}
    some = chosen(time_steps, paces, 12)
    assert len(some) == 12
    assert sum(i.views["cam1"].image <= still[19].image for i in some) <= 2  # twenty times the same
    assert len(with_neighbors(some, time_steps)) > 20


def test_the_only_link_between_two_cameras_is_kept():
    """A camera that saw the board with another one four times, while it was moved quickly, beside a hundred better time steps."""
    rng, grid = np.random.default_rng(0), np.array([[x, y] for x in range(4) for y in range(3)], dtype=float)

    def view(i: int, place) -> BoardView:
        return BoardView(round(1e9 * i), np.arange(12), 5.0 * grid + place, image=i)

    time_steps = [BoardTimeStep({name: view(i, rng.uniform(0, 1000, 2)) for name in ("a", "b")}) for i in range(100)]
    time_steps += [BoardTimeStep({name: view(i, [5.0 * i, 5.0]) for name in ("b", "c")}) for i in range(100, 104)]
    paces = {(name, i): 1.0 if i < 100 else 1000.0 + 10.0 * i for name in ("a", "b", "c") for i in range(104)}
    some = chosen(time_steps, paces, 20)
    assert len(some) == 20 and some == sorted(some, key=lambda time_step: time_step.stamp_ns)
    assert sum("c" in time_step.views for time_step in some) == 2
    assert any(time_step.views["b"].image == 100 for time_step in some)  # the stillest of them
    assert len(chosen(time_steps, paces, 3)) == 4  # fewer would not link three cameras


def test_corners_that_a_given_lens_cannot_show_are_left_out():
    rig = ring(8, ["none"]).subset(["cam1", "cam2", "cam3"])
    seen = corners_seen(rig, n=70, period_s=0.3)
    lenses = {camera.name: camera.model for camera in rig}
    # Folds back 23 degrees off its axis, so that it has nothing to say of what lies farther out
    lenses["cam2"] = CameraModel(1280, 800, rig["cam2"].model.K, "plumb_bob", np.array([-1.8, 0.0, 0.0, 0.0, 0.0]))
    found = calibrate_rig(CHARUCO, seen, BoardRigOptions(clocks="exact", free_lenses=False), lenses)
    assert any(name == "cam2" for name, _ in found.outliers)


def test_given_lenses_are_of_the_recordings_size():
    rig = circle_rig(2)
    found = given_lenses(rig, {"cam02": SimpleNamespace(width=640, height=480, path="a.mp4")})
    assert list(found) == ["cam02"]
    np.testing.assert_allclose(found["cam02"].K, rig["cam02"].model.K)
    for width, height in ((480, 640), (640, 481), (639, 480)):
        with pytest.raises(CalibrationError, match="cam01"):
            given_lenses(rig, {"cam01": SimpleNamespace(width=width, height=height, path="a.mp4")})


def test_clocks_that_are_off_are_written_in_nanoseconds():
    result = with_clocks(circle_rig(2), {"cam02": 0.0125})
    assert [camera.time_offset_ns for camera in result] == [0, 12_500_000]
