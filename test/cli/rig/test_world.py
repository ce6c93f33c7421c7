"""``tracker_node rig world``: a rig that stands elsewhere comes back by points, axes, a board, a wand, a plumb line."""

import cv2
import numpy as np
import pytest

from helpers.cameras.moving_balls import balls_rig
from tracker_node.calibration.world_frame import WorldChange, onto_points, upright
from tracker_node.camera.light import Light
from tracker_node.camera.model import CameraModel
from tracker_node.camera.rig import Camera
from tracker_node.cli.main import main
from tracker_node.errors import TrackerError
from tracker_node.geometry import so3
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.synthesis.scenes.scene import looking_at

POINTS = {"a": (0.3, 0.2, 0.1), "b": (-0.4, 0.3, 0.2), "c": (0.1, -0.5, 0.4), "d": (0.0, 0.1, -0.3)}
MOVED = WorldChange(so3.exp(np.array([0.3, -0.2, 0.5])), np.array([0.4, -1.0, 2.0]))
SCALED = WorldChange(MOVED.rotation, MOVED.translation, 1.1)


@pytest.fixture
def truth():
    rig = balls_rig(3)
    return type(rig)(rig.cameras, lights=(Light("point", position=(0.0, 1.0, 2.0)),))


def write(tmp_path, rig):
    write_rig_file(rig_file_of(rig), tmp_path / "rig.yaml")
    return str(tmp_path / "rig.yaml")


def clicks(tmp_path, rig, points, with_places=False):
    """A CSV file of where OpenCV sees the points, in all cameras of ``rig``."""
    lines = ["camera,point,x,y,z,u,v" if with_places else "camera,point,u,v"]
    for camera in rig:
        rvec = cv2.Rodrigues(camera.T_cam_world[:3, :3].copy())[0]
        for name, place in points.items():
            lens = camera.model
            pixel, _ = cv2.projectPoints(np.array([place], dtype=float), rvec, camera.T_cam_world[:3, 3], lens.K, lens.distortion)
            u, v = pixel.ravel().tolist()
            xyz = ",".join(map(str, place)) + "," if with_places else ""
            lines.append(f"{camera.name},{name},{xyz}{u},{v}")
    path = tmp_path / f"{'_'.join(points)}.csv"
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def same(path, truth, tolerance=1e-6):
    rig = load_rig(path)
    for a, b in zip(rig, truth, strict=True):
        np.testing.assert_allclose(a.T_world_cam, b.T_world_cam, atol=tolerance)
    np.testing.assert_allclose(rig.lights[0].position, truth.lights[0].position, atol=10 * tolerance)


def test_points_of_known_place(tmp_path, truth, capsys):
    rig, output = write(tmp_path, MOVED.rig(truth)), str(tmp_path / "out.yaml")
    points = clicks(tmp_path, truth, POINTS, with_places=True)
    assert main(["rig", "world", rig, "--points", points, "-o", output]) == 0
    same(output, truth)
    told = capsys.readouterr().out
    assert "4 points fitted to 0.0 mm" in told and "times 1.0000" in told
    assert main(["rig", "world", rig, "--points", points, "-o", output]) == 2  # is there already


def test_a_wrong_scale_is_told_and_mended_only_when_asked_for(tmp_path, truth, capsys):
    rig, output = write(tmp_path, SCALED.rig(truth)), str(tmp_path / "out.yaml")
    points = clicks(tmp_path, truth, POINTS, with_places=True)
    assert main(["rig", "world", rig, "--points", points]) == 0
    assert "times 0.9091" in capsys.readouterr().out
    assert main(["rig", "world", rig, "--points", points, "--scale", "-o", output]) == 0
    same(output, truth)


def test_a_board_lying_in_the_origin(tmp_path, truth):
    board = cv2.aruco.CharucoBoard((5, 4), 0.3, 0.225, cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_1000))
    picture = cv2.copyMakeBorder(board.generateImage((1500, 1200)), 150, 150, 150, 150, cv2.BORDER_CONSTANT, value=255)
    # Pixels of the picture to the plane z = 0: x to its right, y to its top, the middle of the board in the origin
    plane = np.array([[1e-3, 0, -1e-3 * 899.5], [0, -1e-3, 1e-3 * 749.5], [0, 0, 1]])
    lens = CameraModel(1280, 960, np.array([[1200.0, 0, 639.5], [0, 1200.0, 479.5], [0, 0, 1]]))
    centers = np.array([[1.0, -1.5, 2.5], [-1.2, -1.0, 2.2]])
    above = [Camera(f"cam{i}", lens, looking_at(center, np.zeros(3))) for i, center in enumerate(centers)]
    truth = type(truth)(tuple(above), lights=truth.lights)
    images = []
    for camera in truth:
        to_image = camera.model.K @ camera.T_cam_world[:3, [0, 1, 3]] @ plane
        cv2.imwrite(str(tmp_path / f"{camera.name}.png"), cv2.warpPerspective(picture, to_image, (1280, 960), borderValue=128))
        images.append(f"{camera.name}={tmp_path / camera.name}.png")
    rig, output = write(tmp_path, MOVED.rig(truth)), str(tmp_path / "out.yaml")
    board_is = ["--charuco", "5x4", "--square", "0.3"]
    assert main(["rig", "world", rig, "--board-images", *images, *board_is, "-o", output]) == 0
    same(output, truth, tolerance=0.005)


def test_axes_then_a_wand_and_a_plumb_line_as_a_check(tmp_path, truth, capsys):
    rig, output = write(tmp_path, SCALED.rig(truth)), str(tmp_path / "out.yaml")
    axes = clicks(tmp_path, truth, {"origin": (0, 0, 0), "x": (0.5, 0, 0), "y": (0.1, 0.4, 0)})
    wand = clicks(tmp_path, truth, {"1a": (0, 0, 0.1), "1b": (0.5, 0, 0.1), "2a": (0, 0.2, 0), "2b": (0, 0.2, 0.5)})
    plumb = clicks(tmp_path, truth, {"top": (0.1, 0.1, 0.5), "bottom": (0.1, 0.1, -0.2)})
    arguments = ["--axes", axes, "--wand", wand, "--length", "0.5", "--plumb", plumb]
    assert main(["rig", "world", rig, *arguments, "-o", output]) == 0
    same(output, truth)
    told = capsys.readouterr().out
    assert "0.00 degrees off" in told and "550.0 mm long in the rig" in told and "scaled by 0.9091" in told


def test_a_plumb_line_alone_sets_the_vertical(tmp_path, truth, capsys):
    tilted = WorldChange(so3.exp(np.radians([4.0, 0.0, 0.0])), np.zeros(3))
    rig, output = write(tmp_path, tilted.rig(truth)), str(tmp_path / "out.yaml")
    plumb = clicks(tmp_path, truth, {"top": (0.1, 0.1, 0.5), "bottom": (0.1, 0.1, -0.2)})
    assert main(["rig", "world", rig, "--plumb", plumb, "-o", output]) == 0
    assert "4.00 degrees off" in capsys.readouterr().out
    same(output, truth)


def test_y_up_becomes_z_up(tmp_path, truth):
    rig, output = write(tmp_path, truth), str(tmp_path / "out.yaml")
    assert main(["rig", "world", rig, "--up", "y", "-o", output]) == 0
    for now, before in zip(load_rig(output), truth, strict=True):
        assert now.center[2] == pytest.approx(before.center[1])
        assert np.linalg.det(now.T_world_cam[:3, :3]) == pytest.approx(1.0)


@pytest.mark.parametrize("up", [(0, 0, 1), (0, 0, -1), (1, 0, 0), (0.1, -2, 0.3)])
def test_upright_turns_any_vertical_up(up):
    change = upright(np.array(up, dtype=float))
    np.testing.assert_allclose(change.points(np.array(up)) / np.linalg.norm(up), [0, 0, 1], atol=1e-12)
    assert np.linalg.det(change.rotation) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("points", "arguments", "message"),
    [
        ({"a": (0, 0, 0), "b": (0.2, 0, 0), "c": (0.4, 0, 0)}, ["--points"], "do not span a plane"),
        ({"a": (0, 0, 0), "b": (0.2, 0, 0)}, ["--points"], "do not span a plane"),
        ({k: tuple(1000.0 * v for v in place) for k, place in POINTS.items()}, ["--points"], "not in meters"),
        ({"a": (0.1, 0, 0), "b": (0.1, 0, 0), "c": (0.1, 0, 0)}, ["--points"], "do not span a plane"),
        ({"origin": (0, 0, 0), "x": (0.2, 0, 0)}, ["--axes"], "a point named 'y'"),
        ({"origin": (0, 0, 0), "x": (0, 0, 0), "y": (0, 0.2, 0)}, ["--axes"], "the point on x is at the same place"),
        ({"origin": (0, 0, 0), "x": (0.2, 0, 0), "y": (0.4, 0, 0)}, ["--axes"], "lie on one line"),
        ({"top": (0, 0, 0.1), "bottom": (0, 0, 0.1)}, ["--plumb"], "top and bottom are at the same place"),
        ({"1a": (0, 0, 0.1), "1b": (0, 0, 0.1)}, ["--length", "0.5", "--wand"], "ends of the wand are at the same place"),
        ({"1a": (0, 0, 0), "2b": (0.2, 0, 0)}, ["--length", "0.5", "--wand"], "two ends at least"),
        ({"1a": (0, 0, 0), "1b": (0.2, 0, 0)}, ["--wand"], "needs --wand and its --length"),
    ],
)
def test_what_cannot_be_is_one_line_and_nothing_is_written(tmp_path, truth, points, arguments, message, capsys):
    places = {name: tuple(0.001 * v for v in place) if abs(max(place)) > 50 else place for name, place in points.items()}
    path = clicks(tmp_path, truth, places, with_places="--points" in arguments)
    if places != points:
        text = (tmp_path / path).read_text()
        for name, place in places.items():
            text = text.replace(",".join(map(str, place)), ",".join(map(str, points[name])))
        (tmp_path / path).write_text(text)
    assert main(["rig", "world", write(tmp_path, truth), *arguments, path, "-o", str(tmp_path / "out.yaml")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out.yaml").exists()


def test_a_point_that_one_camera_sees_is_named(tmp_path, truth, capsys):
    path = clicks(tmp_path, truth, {"top": (0, 0, 1.0), "bottom": (0, 0, 0)})
    lines = [line for line in (tmp_path / path).read_text().splitlines() if not line.startswith(("cam2,top", "cam3,top"))]
    (tmp_path / path).write_text("\n".join(lines))
    assert main(["rig", "world", write(tmp_path, truth), "--plumb", path]) == 2
    assert "camera 'cam1': point 'top' has to be seen by another camera too" in capsys.readouterr().err


def test_a_similarity_of_noisy_points_is_the_planted_one():
    rng = np.random.default_rng(0)
    points = rng.normal(size=(30, 3))
    change = onto_points(points, SCALED.points(points) + rng.normal(0.0, 1e-3, (30, 3)), with_scale=True)
    assert change.scale == pytest.approx(1.1, abs=1e-3)
    np.testing.assert_allclose(change.rotation, SCALED.rotation, atol=2e-3)
    with pytest.raises(TrackerError, match="span a plane"):
        onto_points(points[:2], points[:2])
