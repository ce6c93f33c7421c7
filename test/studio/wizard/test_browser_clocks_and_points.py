"""Clocks by claps, lights and timecode, and a world by points that are clicked on, in a browser: as by the commands."""

import shutil

import numpy as np
import pytest

from benchmark.calibration import synchronize as rooms
from helpers.cameras import board_films
from helpers.sources.timecoded_video import write_timecoded
from helpers.studio.browser import SMALL, TOO_WIDE
from helpers.studio.points_hands import Hands as Clicking
from helpers.studio.wizard_hands import hands_on, same_by_hand
from tracker_node.cli.main import main
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file

pytestmark = pytest.mark.long  # a browser, a studio, and the commands

WIDTH = 390
CLAP = np.array([-0.001, 0.2, 1.1])
LABELS = ("23:59:59:20", "00:00:00:00", "23:59:59:22", "00:00:00:10")  # of a generator, at 25 Hz
LABELED_MS = np.array([-0.2, 0.0, -0.12, 0.4]) * 1e3
TIMED = ("rig_timed.yaml", "rig_timed.png")
FRAME = np.array([0.0, 0.9, 0.0])  # of the points' world, in the rig's
PLACES = {"a": (-0.2, -0.2, 0.1), "b": (0.15, 0.1, -0.05), "c": (-0.05, 0.2, 0.12), "d": (0.2, -0.25, -0.1)}


def calibrated(rig, folder):
    """A folder with videos has the rig's calibration, too."""
    write_rig_file(rig_file_of(rig), folder / "known.yaml")
    assert main(["rig", "export", str(folder / "known.yaml"), "--to", "pose2sim", "-o", str(folder / "Calib.toml")]) == 0
    (folder / "known.yaml").unlink()


def write_labeled(room, folder):
    for camera, label in zip(room.rig, LABELS, strict=True):
        write_timecoded(folder / camera.source, label, 25, size=rooms.SIZE)


def dark(path):
    """A video in which nothing is to be seen or heard."""
    rooms.write_video(path, (np.full((36, 64, 3), 60, np.uint8) for _ in range(60)), 30.0)


def test_a_time_by_each_of_the_ways(tmp_path, monkeypatch):
    """One after the other, as somebody tries them, first with a camera that lacks what it takes."""
    for name, less in {"CLIP_S": 6.0, "ECHO_S": 0.02, "FLASHED_S": 12.0, "N_FLASHES": 8}.items():
        monkeypatch.setattr(rooms, name, less)
    room, by_page, by_hand = rooms.make_room(1), tmp_path / "page/room", tmp_path / "hand/room"
    written = {
        "sound": lambda folder: rooms.write_sounds(room, folder, 1, CLAP),
        "flash": lambda folder: rooms.write_flashes(room, folder, 1),
        "blinking": lambda folder: rooms.write_blinking(room, folder, 1, 7.0),
        "timecode": lambda folder: write_labeled(room, folder),
    }
    lacks = {"sound": "expected a sound track", "flash": "no flash is seen"}
    within_ms = {"sound": 1.0, "flash": 12.0, "blinking": 12.0, "timecode": 20.0}
    late_ms = 1e3 * room.late_s
    (by_page / "videos").mkdir(parents=True)
    written["sound"](by_page / "videos")
    calibrated(room.rig, by_page)
    with hands_on(by_page) as hands:
        hands.do("rig", backgrounds="none")
        for way, write in written.items():
            write(by_page / "videos")
            if way in lacks:
                kept = (by_page / "videos/cam3.mp4").read_bytes()
                dark(by_page / "videos/cam3.mp4")
                assert lacks[way] in (why := hands.refused("time", way=way)) and "cam3" in why
                (by_page / "videos/cam3.mp4").write_bytes(kept)
            hands.fill("time", {"way": way})
            if way == "sound":
                assert "where the clap was: expected three numbers" in hands.missing("time", at="0.2 1.1")
                assert "largest offset, s: expected a number, got '2,5'" in hands.missing("time", at="", max_offset="2,5")
                hands.fill("time", {"at": "-1e-3, 0.2, 1.1", "max_offset": "2"})
            assert hands.page.locator("#step-time [data-field=max_offset]").count() == (way != "timecode")  # which needs none
            hands.page.set_viewport_size({"width": WIDTH if way in ("flash", "timecode") else 1280, "height": 844})
            shown = hands.press("time")
            hands.page.wait_for_selector("#cancel")
            if way == "blinking":
                hands.page.reload()  # somebody is impatient
            hands.wait("time")
            assert hands.page.input_value("#step-time [data-way]") == way
            hands.page.wait_for_selector("header .about:text-is('rig_timed.yaml')")
            hands.page.wait_for_function("() => document.querySelector('#step-time img').naturalWidth > 300")
            if hands.page.viewport_size["width"] == WIDTH:
                assert hands.page.evaluate(TOO_WIDE) == [] and hands.page.evaluate(SMALL) == []
            shutil.rmtree(by_hand, ignore_errors=True)
            shutil.copytree(by_page, by_hand)
            for path in by_hand.glob("rig_timed.*"):
                path.unlink()
            same_by_hand(shown, by_page, by_hand, *TIMED, monkeypatch=monkeypatch)
            true_ms = LABELED_MS if way == "timecode" else late_ms
            found_ms = np.array([1e-6 * camera.time_offset_ns for camera in load_rig(by_page / "rig_timed.yaml")])
            assert np.abs((found_ms - found_ms.mean()) - (true_ms - true_ms.mean())).max() < within_ms[way], way
            assert ("--at -0.001 0.2 1.1" in shown[0]) == (way == "sound") and f"--by {way}" in shown[0]


def test_a_world_by_points_that_are_clicked_on(tmp_path, monkeypatch):
    """Whoever comes to the page Points too early reads what comes first; a table of a spreadsheet, put there later, is seen."""
    by_page, by_hand = tmp_path / "page/lab", tmp_path / "hand/lab"
    rig = board_films.rig()
    for camera in rig:
        board_films.write_film(by_page / f"videos/{camera.name}.mp4", camera, board_films.LYING, [board_films.pose(0.1)] * 4)
    calibrated(rig, by_page)
    with hands_on(by_page) as hands:
        page, clicking = hands.page, Clicking(hands.page, rig)

        def go(name):
            page.click(f"header nav a:has-text('{name}')")
            page.wait_for_selector("#step-look" if name == "New" else "main:not([hidden]) .view canvas")
            page.wait_for_selector("body[aria-busy=false]")

        hands.do("rig", backgrounds="none")
        go("Points")
        page.select_option("#sheet", "control")
        clicking.wait_for("#points", "put a CSV file point,x,y,z into the folder")
        rows = [f"{name},{','.join(map(str, place))}" for name, place in PLACES.items()]
        (by_page / "object.csv").write_text("\ufeff" + "\n".join(["point,x,y,z", *rows]) + "\n", encoding="utf-8")
        go("New")
        hands.open("world")
        assert page.locator("#step-world [data-way]").count() == 0  # but for an axis, nothing to go by
        page.click("text=Click on the points of object.csv")
        page.wait_for_selector("#points td[title=a]")
        page.select_option("#then", "point")
        for n_clicked, names in ((2, "ab"), (4, "cd")):
            for camera in rig:
                page.click(f"#points td[title={names[0]}]")
                for name in names:
                    clicking.click(camera.name, camera.project(FRAME + PLACES[name])[0])
            clicking.saved()
            clicking.wait_for("#control-cameras", f"expected 6 points or more, got {n_clicked}")
            go("New")
            if n_clicked == 2:
                assert "the 2 points, as seen, do not span a plane" in hands.refused("world", way="points")
                go("Points")
                page.select_option("#sheet", "control")
                page.select_option("#then", "point")
        shutil.copytree(by_page, by_hand)
        shown = hands.do("world", lengths="those of the points")
    assert shown == ["tracker_node rig world rig.yaml --points clicks/control_points.csv --scale -o rig_world.yaml"]
    same_by_hand(shown, by_page, by_hand, "rig_world.yaml", monkeypatch=monkeypatch)
    for found, true in zip(load_rig(by_page / "rig_world.yaml"), rig, strict=True):
        assert np.linalg.norm(found.center - (true.center - FRAME)) < 0.02
