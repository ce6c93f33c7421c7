"""The points page in a browser: what is clicked on is reconstructed, saved as it is made, and there again."""

import cv2
import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at
from helpers.studio.browser import browser_tab
from helpers.studio.points_hands import Hands
from helpers.studio.studio_process import running_studio
from tracker_node.camera.rig import CameraRig
from tracker_node.cli.main import main
from tracker_node.evaluation.truth.files import load_truth
from tracker_node.loaders.rig.control_points import load_clicks, load_control_points
from tracker_node.loaders.rig.rig_yaml import load_rig, rig_file_of, write_rig_file
from tracker_node.studio.digitize.digitizing import reconstruct

pytestmark = pytest.mark.long  # a browser and a studio for each test

EYES = {"left": (2.0, 0.3, 1.2), "back": (-0.6, 2.1, 1.0), "right": (-1.5, -1.6, 1.4)}
PLACE = np.array([0.12, -0.21, 0.93])
N_SETS = 3


def make_rig(folder, lens="radial"):
    """Three cameras with gray images of some instants in ``folder``."""
    cameras = []
    for name, eye in EYES.items():
        camera = look_at(eye, (0.0, 0.0, 0.8), LENSES[lens], name)
        (folder / name).mkdir()
        for i in range(N_SETS):
            picture = np.full((camera.model.height, camera.model.width), 60 + 40 * i, np.uint8)
            cv2.imwrite(str(folder / name / f"{i}.png"), picture)
        cameras.append(type(camera)(name, camera.model, camera.T_world_cam, source=name))
    rig = CameraRig(tuple(cameras))
    write_rig_file(rig_file_of(rig), folder / "rig.yaml")
    return rig


@pytest.fixture
def desk(tmp_path):
    rig = make_rig(tmp_path)
    with running_studio("--rig", tmp_path / "rig.yaml", "--clicks", tmp_path / "clicks") as studio, browser_tab() as tab:
        tab.page.set_default_timeout(20_000)
        yield studio, tab, Hands(tab.page, rig), tmp_path
    assert tab.errors == []


def test_clicks_in_three_views_are_reconstructed_saved_and_there_again(desk):
    studio, tab, hands, folder = desk
    hands.open(studio.page("digitizing.html"))
    hands.add_point("left_knee")
    meant = {camera.name: hands.click(camera.name, camera.project(PLACE)[0]) for camera in hands.rig}
    hands.wait_for("#points tr[aria-selected=true]", "3")
    hands.wait_for("#coordinates", "z")
    hands.saved()
    clicked = load_clicks(folder / "clicks/first/0.csv")
    for name, pixel in meant.items():
        np.testing.assert_allclose(clicked[name]["left_knee"], pixel, atol=1e-6)
    shown = [float(row.split()[1]) for row in hands.text("#coordinates").splitlines()]
    scale = 150.0 / 2.2  # pixels per meter: focal length over distance
    half_screen_pixel = 0.5 * np.sqrt(2.0) * max(np.abs(meant[c.name] - c.project(PLACE)[0]).max() for c in hands.rig)
    assert np.linalg.norm(np.array(shown) - PLACE) < 2.0 * half_screen_pixel / scale + 1e-4
    tab.page.reload()
    hands.wait_for("#coordinates", f"{shown[0]:.4f}")


def test_keys_nudge_delete_and_step(desk):
    studio, tab, hands, folder = desk
    saved = folder / "clicks/first/0.csv"
    hands.open(studio.page("digitizing.html"))
    for name in ("hip", "knee"):
        hands.add_point(name)
    hands.click("back", (40.0, 50.0))
    hands.saved()
    start = load_clicks(saved)["back"]["knee"]
    for key in ("ArrowRight", "ArrowRight", "Shift+ArrowUp", "Shift+ArrowUp", "Shift+ArrowUp"):
        tab.page.keyboard.press(key)
    hands.saved()
    np.testing.assert_allclose(load_clicks(saved)["back"]["knee"], start + np.array([2.0, -0.3]), atol=1e-9)
    for _ in range(2):
        tab.page.keyboard.press("Control+z")
    hands.saved()
    np.testing.assert_allclose(load_clicks(saved)["back"]["knee"], start + np.array([2.0, -0.1]), atol=1e-9)
    tab.page.keyboard.press("p")
    tab.page.wait_for_selector('#points tr[aria-selected=true]:has(td[title="hip"])')
    tab.page.keyboard.press(".")
    hands.wait_for("#time", "1 / 2")
    hands.click("left", (80.0, 60.0))
    hands.saved()
    assert list(load_clicks(next((folder / "clicks/first").glob("[1-9]*.csv")))["left"]) == ["hip"]
    tab.page.keyboard.press(",")
    hands.wait_for("#time", "0 / 2")
    tab.page.keyboard.press("n")
    tab.page.wait_for_selector('#points tr[aria-selected=true]:has(td[title="knee"])')
    tab.page.keyboard.press("2")
    hands.wait_for("#views-of-point", "4")
    assert tab.page.locator(".view:visible").count() == 1
    tab.page.keyboard.press("Delete")
    hands.saved()
    assert not saved.exists()
    tab.page.keyboard.press("2")
    tab.page.wait_for_function("() => [...document.querySelectorAll('.view')].every((view) => !view.hidden)")


def test_a_drag_keeps_hold_of_the_mark_and_is_one_change(desk):
    studio, tab, hands, folder = desk
    saved, mouse = folder / "clicks/first/0.csv", tab.page.mouse
    hands.open(studio.page("digitizing.html"))
    hands.add_point("knee")
    start = hands.click("left", (80.0, 60.0))
    hands.saved()
    at, _ = hands.on_screen("left", start)
    scale = hands.on_screen("left", np.add(start, [10.0, 0.0]))[0][0] - at[0]  # screen pixels for ten of the image
    mouse.move(*(at + 4))
    mouse.down()
    mouse.move(*(at + 5))  # not yet a drag
    mouse.move(*(at + 4 + [3 * scale, -2 * scale]), steps=8)
    mouse.up()
    hands.saved()
    np.testing.assert_allclose(load_clicks(saved)["left"]["knee"], np.add(start, [30.0, -20.0]), atol=0.7)
    tab.page.keyboard.press("Control+z")
    hands.saved()
    np.testing.assert_allclose(load_clicks(saved)["left"]["knee"], start, atol=1e-6)
    at, _ = hands.on_screen("left", start)
    mouse.click(*(at + 4))
    tab.page.keyboard.press("Control+z")  # the first click: a press on the mark has changed nothing
    hands.saved()
    assert not saved.exists()


def test_a_click_before_the_saved_ones_have_come_is_taken_back_to_what_was_saved(desk):
    studio, tab, hands, folder = desk
    saved, page, held = folder / "clicks/first/0.csv", tab.page, []
    hands.open(studio.page("digitizing.html"))
    hands.add_point("knee")
    start = hands.click("left", (80.0, 60.0))
    hands.saved()
    page.keyboard.press(".")
    hands.wait_for("#time", "1 / 2")
    page.wait_for_selector("body[aria-busy=false]")
    page.route("**/api/digitizing/sheet", lambda route: held.append(route))
    page.keyboard.press(",")
    hands.wait_for("#time", "0 / 2")
    hands.click("left", (40.0, 30.0))
    hands.saved()
    assert held and np.abs(load_clicks(saved)["left"]["knee"] - start).max() > 20.0
    page.keyboard.press("Control+z")
    hands.saved()
    np.testing.assert_allclose(load_clicks(saved)["left"]["knee"], start, atol=1e-6)
    for route in held:
        route.continue_()
    page.unroute("**/api/digitizing/sheet")


def test_trajectories_of_all_images_are_truth(desk):
    studio, tab, hands, folder = desk
    hands.open(studio.page("digitizing.html"))
    hands.add_point("left_knee")
    for i in range(N_SETS):
        hands.wait_for("#time", f"{i} / 2")
        hands.click_all(PLACE + np.array([0.0, 0.0, 0.05 * i]))
        hands.wait_for("#coordinates", "x")
        tab.page.keyboard.press(".")
    hands.saved()
    tab.page.click("#save")
    hands.wait_for(".message", "wrote")
    for name in ("joints.csv", "joints.trc"):
        truth = load_truth(folder / "clicks" / name)
        assert truth.valid.all() and truth.positions_m.shape == (N_SETS, 1, 3)
        np.testing.assert_allclose(np.diff(truth.positions_m[:, 0, 2]), 0.05, atol=0.01)
    (folder / "clicks/joints.trc").write_text("somebody's own")
    tab.page.click("#save")
    hands.wait_for(".message.bad", "joints.trc")
    tab.errors.clear()  # the browser calls the refusal an error
    assert (folder / "clicks/joints.trc").read_text() == "somebody's own"


def test_the_second_time_begins_without_the_first_and_tells_how_well_one_repeats(desk):
    studio, tab, hands, _ = desk
    hands.open(studio.page("digitizing.html"))
    hands.add_point("knee")
    hands.click_all(PLACE)
    hands.wait_for("#points tr[aria-selected=true]", "3")
    tab.page.select_option("#sheet", "second")
    tab.page.wait_for_function("() => !document.querySelector('#points tr[aria-selected=true]').innerText.includes('3')")
    for camera in hands.rig:
        hands.click(camera.name, camera.project(PLACE)[0] + [2.0, 0.0])
    hands.wait_for("#repeatability", "rms along u and v (6 degrees of freedom)")
    shown = float(hands.text("#repeatability").split()[2])
    assert shown == pytest.approx(1.0, abs=0.4)  # 2 px apart along u only: 2 / sqrt 2 / sqrt 2


def test_control_points_become_a_file_for_calibrate_dlt(tmp_path):
    rig = make_rig(tmp_path, "plain")
    rng = np.random.default_rng(1)
    places = {f"p{i}": p for i, p in enumerate(rng.uniform((-0.3, -0.3, 0.5), (0.3, 0.3, 1.1), (7, 3)))}
    rows = [f"{name},{','.join(map(repr, place.tolist()))}" for name, place in places.items()]
    (tmp_path / "object.csv").write_text("\n".join(["point,x,y,z", *rows]) + "\n")
    named = ("--rig", tmp_path / "rig.yaml", "--clicks", tmp_path / "clicks", "--control-points", tmp_path / "object.csv")
    with running_studio(*named) as studio, browser_tab() as tab:
        hands = Hands(tab.page, rig)
        hands.open(studio.page("digitizing.html"))
        tab.page.select_option("#sheet", "control")
        tab.page.select_option("#then", "point")
        for camera in rig:
            tab.page.click('#points td[title="p0"]')
            for place in places.values():
                hands.click(camera.name, camera.project(place)[0])
        hands.wait_for("#place", "7 points reconstructed")
        assert tab.errors == []
    seen = load_control_points(tmp_path / "clicks/control_points.csv")
    assert list(seen) == list(rig.names) and all(points.names == tuple(places) for points in seen.values())
    arguments = ["--points", str(tmp_path / "clicks/control_points.csv"), "--size", "160x120", "-o", str(tmp_path / "dlt.yaml")]
    assert main(["calibrate", "dlt", *arguments]) == 0
    by_hand = load_rig(tmp_path / "dlt.yaml")
    seen_again = {camera.name: {"p": camera.project(PLACE)[0]} for camera in rig}
    (_, found) = reconstruct(by_hand, seen_again)["p"]
    assert np.linalg.norm(found.position_m - PLACE) < 0.01


def test_a_click_that_cannot_be_saved_is_taken_back_and_the_reason_told(desk):
    studio, tab, hands, folder = desk
    hands.open(studio.page("digitizing.html"))
    hands.add_point("knee")
    (folder / "clicks/first").write_text("where the folder should be")
    hands.click("left", (80.0, 60.0))
    hands.wait_for(".message.bad", "clicks/first")
    tab.page.wait_for_function("() => !document.querySelector('#views-of-point').innerText.includes('80')")
    tab.errors.clear()  # the browser calls the refusal an error


def test_without_cameras_the_page_says_what_to_do():
    with running_studio() as studio, browser_tab() as tab:
        tab.page.goto(studio.page("digitizing.html"))
        tab.page.wait_for_selector(".notice")
        assert "--rig" in tab.page.inner_text(".notice")
