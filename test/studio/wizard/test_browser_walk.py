"""The seven steps by clicks and keys in a browser write what the commands that the page shows write, byte by byte."""

import shutil

import cv2
import numpy as np
import pytest

from helpers.cameras import board_films
from helpers.docs.given import write_video
from helpers.sources.weights import weights_or_skip
from helpers.studio.browser import TOO_WIDE
from helpers.studio.wizard_hands import hands_on, same_by_hand
from tracker_node.calibration.body import model_stature
from tracker_node.cli.main import main
from tracker_node.geometry import se3
from tracker_node.loaders.model.model_yaml import load_model
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.loaders.rig.rig_yaml import load_rig

pytestmark = pytest.mark.long  # a browser, a studio, and the commands

WIDTH = 390
BOARD = {"size": "7x5", "square": "0.08"}
STATURE_M = 1.84  # of the person in clothed_people


def test_boards_clocks_and_a_world(tmp_path, monkeypatch):
    """Cameras side by side; the origin is a board that lies, where all of them see it."""
    by_page, by_hand = tmp_path / "page/lab", tmp_path / "hand/lab"
    (by_page / "world").mkdir(parents=True)
    carried, lies = [board_films.pose(t) for t in np.arange(12) / 4.0], board_films.pose(0.4)
    later = [board_films.pose(t) for t in 5.0 + np.arange(30) / 10.0]
    for camera in board_films.rig():
        board_films.write_film(by_page / f"board/{camera.name}.mp4", camera, board_films.CARRIED, carried)
        board_films.write_film(by_page / f"videos/{camera.name}.mp4", camera, board_films.LYING, later)
        image = board_films.image_of(camera, board_films.CARRIED, lies)
        cv2.imwrite(str(by_page / f"world/{camera.name}.png"), image)
    shutil.copytree(by_page, by_hand)
    with hands_on(by_page) as hands:
        assert "still to be filled in" in hands.said("rig") and hands.page.is_disabled("#step-rig button.primary")
        hands.fill("rig", {**BOARD, "clocks": "exact", "backgrounds": "none"})
        shown = hands.press("rig")
        hands.page.wait_for_selector("#cancel")
        hands.page.reload()  # somebody is impatient; nothing is lost
        hands.wait("rig")
        assert hands.page.input_value("#step-rig [data-field=size]") == BOARD["size"]
        assert "bring the board nearer" in hands.page.locator("#step-rig .fair").first.inner_text()
        shown += hands.do("time")
        assert "cam02: +0.00" in hands.said("time")
        hands.page.wait_for_function("() => document.querySelector('#step-time img').naturalWidth > 300")
        shown += hands.do("world", **BOARD)
        assert "rig_world.yaml: origin" in hands.said("world")
        hands.page.set_viewport_size({"width": WIDTH, "height": 844})
        assert hands.page.evaluate("document.documentElement.scrollWidth") <= WIDTH and hands.page.evaluate(TOO_WIDE) == []
    written = ("rig.yaml", "rig_timed.yaml", "rig_world.yaml")
    same_by_hand(shown, by_page, by_hand, *written, monkeypatch=monkeypatch)
    for found, true in zip(load_rig(by_page / "rig_world.yaml"), board_films.rig(), strict=True):
        assert np.linalg.norm(found.center - se3.apply(se3.inverse(lies), true.center[None])[0]) < 0.02


def test_a_body_by_the_points_in_the_videos(shared_data, tmp_path, monkeypatch):
    weights_or_skip()
    by_page, by_hand = tmp_path / "page/walk", tmp_path / "hand/walk"
    (by_page / "videos").mkdir(parents=True)
    clip = shared_data / "clothed_people/jump"
    for camera in load_rig(clip / "rig.yaml"):
        write_video(by_page / f"videos/{camera.name}.mp4", sorted((clip / camera.name).glob("*.jpg"))[:24:8])
    monkeypatch.chdir(by_page)
    assert main(["rig", "export", str(clip / "rig.yaml"), "--to", "pose2sim", "-o", "Calib.toml"]) == 0
    assert main(["rig", "import", "Calib.toml", "--sources", "videos", "-o", "rig.yaml"]) == 0
    shutil.copytree(by_page, by_hand)
    with hands_on(by_page) as hands:
        shown = hands.do("body", sets="3")
        assert "human, from points of 3 image sets of rig.yaml" in hands.said("body")
        assert hands.page.locator("#step-start .state").inner_text() == "to do"
    assert shown == ["tracker_node calibrate body --from-points rig.yaml --sets 3 -o person.yaml"]
    same_by_hand(shown, by_page, by_hand, "person.yaml", monkeypatch=monkeypatch)
    assert model_stature(load_model(by_page / "person.yaml")) == pytest.approx(STATURE_M, abs=0.05)


def test_a_body_and_a_start_by_markers(shared_data, tmp_path, monkeypatch):
    """The trial of another size, and a row that the file lacks, are refused in words before."""
    by_page, by_hand = tmp_path / "page/lab", tmp_path / "hand/lab"
    (by_page / "videos").mkdir(parents=True)
    clip = shared_data / "clothed_people/jump"
    for camera in load_rig(clip / "rig.yaml"):
        write_video(by_page / f"videos/{camera.name}.mp4", sorted((clip / camera.name).glob("*.jpg"))[:2])
    for name in ("static.trc", "truth.trc"):
        shutil.copy(clip / name, by_page / name)
    monkeypatch.chdir(by_page)
    assert main(["rig", "export", str(clip / "rig.yaml"), "--to", "pose2sim", "-o", "Calib.toml"]) == 0
    assert main(["rig", "import", "Calib.toml", "--sources", "videos", "-o", "rig.yaml"]) == 0
    shutil.copytree(by_page, by_hand)
    with hands_on(by_page) as hands:
        shown = hands.do("body", way="trc", trc="static.trc")
        assert "expected" in hands.refused("start", way="trc", trc="truth.trc", row="900") and "900" in hands.said("start")
        shown += hands.do("start", row="1", compare="contours")
        hands.page.set_viewport_size({"width": WIDTH, "height": 844})
        assert hands.page.evaluate(TOO_WIDE) == []
    same_by_hand(shown, by_page, by_hand, "person.yaml", "start.yaml", "recording.yaml", monkeypatch=monkeypatch)
    model = load_model(by_page / "person.yaml")
    assert model_stature(model) == pytest.approx(STATURE_M, abs=0.05)
    state = load_state(by_page / "start.yaml", model)
    assert 0.7 < state.T_world_root[2, 3] < 1.2  # z is up


def test_a_start_from_a_saved_pose_then_run_and_look(recorded, tmp_path, monkeypatch):
    by_page, by_hand = tmp_path / "page/walk", tmp_path / "hand/walk"
    shutil.copytree(recorded, by_page)
    monkeypatch.chdir(by_page)
    assert main(["rig", "import", "Calib.toml", "--sources", "videos", "-o", "rig.yaml"]) == 0
    assert main(["calibrate", "body", "--stature", "1.75", "-o", "person.yaml"]) == 0
    shutil.copytree(by_page, by_hand)
    typed = {"x": 0.02, "y": 0.12, "z": 0.93, "yaw": 3.0}
    with hands_on(by_page) as hands:
        page = hands.page
        assert page.locator("#step-run .said").inner_text() == "needs recording.yaml, which the start writes"
        hands.fill("start", {"compare": "contours"})
        page.click("text=Set a pose by hand")
        page.wait_for_selector("#total", timeout=120_000)
        for name, value in typed.items():
            page.fill(f"input[type=number][data-dof={name}]", str(value))
            page.keyboard.press("Enter")
        page.wait_for_selector("body[aria-busy=false]")
        page.click("#save")
        page.fill("#name", "first")
        page.click("#write")
        page.wait_for_selector("#saving:not([open])", state="attached")
        page.click("header nav a:has-text('New')")
        page.wait_for_selector("#step-start [data-way]")
        assert "poses/first.yaml: Set by hand in image set 0" in hands.said("start")
        shown = hands.do("start", way="pose", compare="contours")
        assert hands.do("run", max_sets="2") == ["tracker_node track recording.yaml --max-sets 2"]
        assert "2 image sets: " in hands.said("run")
        assert "tracker_node track recording.yaml --max-sets 2 --output run_2" in hands.said("run")  # a bag is never written over
        look = hands.do("look")
        assert page.get_attribute("#step-look a:has-text('Open')", "href") == "/api/wizard/file/run/report.html"
        page.click("text=Play it back")
        page.wait_for_selector(".view canvas")
    assert look == ["tracker_node evaluate run"] and (by_page / "run/report.html").stat().st_size > 10_000
    state = load_state(by_page / "poses/first.yaml", load_model(by_page / "person.yaml"))
    np.testing.assert_allclose(state.T_world_root[:3, 3], [typed["x"], typed["y"], typed["z"]], atol=1e-6)
    shutil.copytree(by_page / "poses", by_hand / "poses")
    same_by_hand(shown, by_page, by_hand, "recording.yaml", "tracker.yaml", monkeypatch=monkeypatch)
