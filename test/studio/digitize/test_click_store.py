"""Clicks that are saved as they are made, in the formats that the other commands read."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at
from tracker_node.camera.rig import CameraRig
from tracker_node.errors import FileFormatError
from tracker_node.evaluation.truth.files import load_truth
from tracker_node.loaders.motion.trc import load_trc
from tracker_node.loaders.rig.control_points import load_clicks, load_control_points, load_places
from tracker_node.studio.digitize import digitizing
from tracker_node.studio.digitize.click_store import ClickStore

EYES = {"left": (2.0, 0.3, 1.2), "back": (-0.6, 2.1, 1.0), "right": (-1.5, -1.6, 1.4)}
RIG = CameraRig(tuple(look_at(eye, (0.0, 0.0, 0.8), LENSES["radial"], name) for name, eye in EYES.items()))
PLAIN_RIG = CameraRig(tuple(look_at(eye, (0.0, 0.0, 0.8), LENSES["plain"], name) for name, eye in EYES.items()))


def click_all(store, pass_name, stamp_ns, point, place, noise=(0.0, 0.0), rig=RIG):
    for camera in rig:
        store.set_click(pass_name, stamp_ns, camera.name, point, camera.project(place)[0] + noise)


def test_clicks_are_in_the_file_at_once_and_come_back(tmp_path):
    store = ClickStore(tmp_path, RIG.names)
    store.add_name("tip, of the nose")
    store.set_click("first", 40_000_000, "left", "tip, of the nose", np.array([10.1, 20.25]))
    store.set_click("first", 40_000_000, "back", "hip", np.array([1 / 3, 5.0]))
    assert load_clicks(tmp_path / "first/40000000.csv")["back"]["hip"][0] == 1 / 3
    store.set_click("first", 40_000_000, "left", "tip, of the nose", None)
    again = ClickStore(tmp_path, RIG.names)
    assert again.names == ["tip, of the nose"] and again.stamps_ns() == [40_000_000]
    assert {camera: list(points) for camera, points in again.clicked("first", 40_000_000).items()} == {"back": ["hip"]}
    again.set_click("first", 40_000_000, "back", "hip", None)
    assert not (tmp_path / "first/40000000.csv").exists()


def test_a_click_that_cannot_be_saved_is_not_kept_either(tmp_path):
    (tmp_path / "first").mkdir()
    store = ClickStore(tmp_path, RIG.names)
    (tmp_path / "first/7.csv").write_text("camera,point,u,v\nleft,hip,1,2\n")
    with pytest.raises(FileFormatError, match=r"7\.csv"):
        store.set_click("first", 7, "left", "hip", np.array([3.0, 4.0]))
    assert store.clicked("first", 7) == {}
    assert (tmp_path / "first/7.csv").read_text().endswith("left,hip,1,2\n")


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("first/7.csv", "camera,point,u,v\ntop,hip,1,2\n", "one of left, back, right.*top"),
        ("first/seven.csv", "camera,point,u,v\nleft,hip,1,2\n", "STAMP_NS"),
        ("second/7.csv", "camera,point,u,v\nleft,hip,1,nan\n", "finite"),
        ("points.txt", "Fu\udcdfspitze\n", "UTF-8"),
        ("control_points.csv", "camera,point,x,y,z,u,v\nleft,corner,0,0,1,1,2\n", "the place known"),
    ],
)
def test_files_that_do_not_fit_are_named(tmp_path, name, content, said):
    (tmp_path / name).parent.mkdir(exist_ok=True)
    (tmp_path / name).write_text(content, errors="surrogateescape")
    with pytest.raises(FileFormatError, match=said):
        ClickStore(tmp_path, RIG.names, {"corner": np.zeros(3)})


@pytest.mark.parametrize("name", ["", "  ", "a\tb", "a\nb", "x" * 61])
def test_names_that_files_could_not_hold_are_refused(tmp_path, name):
    with pytest.raises(FileFormatError, match="printable"):
        ClickStore(tmp_path, RIG.names).add_name(name)


def test_trajectories_are_truth_to_the_evaluation(tmp_path):
    store = ClickStore(tmp_path, RIG.names)
    places = {stamp: np.array([0.01 * i, 0.1, 0.8]) for i, stamp in enumerate((0, 40_000_000, 80_000_000))}
    for stamp, place in places.items():
        click_all(store, "first", stamp, "left_hip", place)
        click_all(store, "first", stamp, "left_knee", place - [0.0, 0.0, 0.3])
    for camera in ("left", "back"):  # one view only: no place
        store.set_click("first", 40_000_000, camera, "left_knee", None)
    for path in digitizing.save_trajectories(RIG, store):
        truth = load_truth(path)
        assert truth.names == ("left_hip", "left_knee")
        np.testing.assert_array_equal(truth.stamps_ns, list(places))
        np.testing.assert_array_equal(truth.valid[:, 1], [True, False, True])
        np.testing.assert_allclose(truth.positions_m[:, 0], list(places.values()), atol=1e-6)


def test_the_rate_of_a_trc_file_is_that_of_the_digitized_instants(tmp_path):
    """Every fifth image of 25 Hz, and two of them left out: OpenSim and others go by the rate, not by the times."""
    store = ClickStore(tmp_path, RIG.names)
    digitized = {stamp: np.array([1e-10 * stamp, 0.1, 0.8]) for stamp in (0, 200_000_000, 400_000_000, 1_000_000_000)}
    for stamp, place in digitized.items():
        click_all(store, "first", stamp, "hip", place)
    table, trc = digitizing.save_trajectories(RIG, store)
    np.testing.assert_array_equal(load_truth(table).stamps_ns, list(digitized))
    read = load_trc(trc)
    assert read.rate_hz == 5.0
    np.testing.assert_allclose(read.times_s, np.arange(6) / 5.0, atol=1e-9)
    np.testing.assert_array_equal(read.valid[:, 0], [True, True, True, False, False, True])
    np.testing.assert_allclose(read.positions_m[read.valid[:, 0], 0], list(digitized.values()), atol=1e-6)


def test_clicks_that_cannot_be_of_one_place_are_told(tmp_path):
    store, place = ClickStore(tmp_path, RIG.names), np.array([0.0, 0.1, 0.8])
    for stamp in (0, 40_000_000):
        click_all(store, "first", stamp, "hip", place)
    assert digitizing.contradictions(RIG, store) == []
    pixel = store.clicked("first", 40_000_000)["left"]["hip"]
    store.set_click("first", 40_000_000, "left", "hip", pixel + 80.0)
    (told,) = digitizing.contradictions(RIG, store)
    assert told.startswith("hip at 0.040 s by ") and told.endswith(" px")


def test_nothing_is_saved_beside_a_file_of_somebody_else(tmp_path):
    store = ClickStore(tmp_path, RIG.names)
    click_all(store, "first", 0, "hip", np.array([0.0, 0.1, 0.8]))
    (tmp_path / "joints.trc").write_text("theirs")
    with pytest.raises(FileFormatError, match=r"joints\.trc"):
        digitizing.save_trajectories(RIG, store)
    assert not (tmp_path / "joints.csv").exists()


def test_repeated_digitizing_tells_the_digitizers_noise(tmp_path):
    rng, store = np.random.default_rng(3), ClickStore(tmp_path, RIG.names)
    for i in range(30):
        for name in ("first", "second"):
            for camera in RIG:
                seen = camera.project(np.array([0.0, 0.1, 0.8]))[0]
                store.set_click(name, i, camera.name, "hip", seen + 0.6 * rng.standard_normal(2))
    found = digitizing.repeatability_of(RIG, store, ("first", "second"))
    assert found.freedom == 30 * 3 * 2 and found.freedom_3d == 30 * 3
    assert found.pixels == pytest.approx(0.6, rel=0.15)
    (_, point) = digitizing.reconstruct(RIG, store.clicked("first", 0), 0.6)["hip"]
    assert found.meters == pytest.approx(np.sqrt(np.mean(point.sigma_m**2)), rel=0.25)


def test_control_points_calibrate_the_cameras_that_were_clicked_in(tmp_path):
    rng = np.random.default_rng(5)
    places = {f"p{i}": place for i, place in enumerate(rng.uniform((-0.3, -0.3, 0.5), (0.3, 0.3, 1.1), (10, 3)))}
    store = ClickStore(tmp_path, PLAIN_RIG.names, places)
    for name, place in places.items():
        for camera in PLAIN_RIG:
            store.set_control_click(camera.name, name, camera.project(place)[0])
    for name in list(places)[5:]:
        store.set_control_click("right", name, None)
    saved = load_control_points(tmp_path / "control_points.csv")
    np.testing.assert_array_equal(saved["left"].points[3], places["p3"])
    verdicts, errors = digitizing.judge_control(PLAIN_RIG, saved, "none")
    assert np.abs(verdicts["left"].residuals_px).max() < 1e-6
    assert verdicts["right"].residuals_px is None and verdicts["right"].problem == "expected 6 points or more, got 5"
    assert len(errors) == 10 and errors.max() < 1e-7
    assert ClickStore(tmp_path, PLAIN_RIG.names).places.keys() == places.keys()


def test_places_come_from_either_kind_of_file(tmp_path):
    (tmp_path / "object.csv").write_text("point,x,y,z\na,1,2,3\nb,4,5,6\n")
    places = load_places(tmp_path / "object.csv")
    assert list(places) == ["a", "b"] and places["b"].tolist() == [4.0, 5.0, 6.0]
    (tmp_path / "seen.csv").write_text("camera,point,x,y,z,u,v\nl,a,1,2,3,0,0\nr,a,1,2,3,0,0\n")
    assert load_places(tmp_path / "seen.csv")["a"].tolist() == [1.0, 2.0, 3.0]
    for text in ("point,x,y,z\n", "point,x,y,z\na,1,2,3\na,1,2,3\n", "name,x,y,z\na,1,2,3\n", "point,x,y,z\na,1,2,inf\n"):
        (tmp_path / "bad.csv").write_text(text)
        with pytest.raises(FileFormatError, match=r"bad\.csv"):
            load_places(tmp_path / "bad.csv")
