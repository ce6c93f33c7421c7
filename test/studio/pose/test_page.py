"""The pose page in a browser: sliders, mouse, keys, fit, undo and files do what they say."""

import numpy as np
import pytest

from helpers.cameras.small_clip import make_clip
from helpers.studio.browser import browser_tab
from helpers.studio.studio_process import running_studio
from tracker_node.loaders.model.state_yaml import load_state
from tracker_node.model.configuration import Configuration

pytestmark = pytest.mark.long  # a browser and a studio

SET = 1


class Hands:
    """What a person does on the page, and sees."""

    def __init__(self, page, clip):
        self.page, self.clip = page, clip

    def open(self, url):
        self.page.goto(url)
        self.page.wait_for_selector("#total")
        self.settled()

    def settled(self):
        """Nothing is on its way any more."""
        self.page.wait_for_selector("body[aria-busy=false]")

    def slider(self, dof):
        return self.page.locator(f"input[type=range][data-dof={dof}]")

    def number(self, dof):
        return self.page.locator(f"input[type=number][data-dof={dof}]")

    def value(self, dof):
        return float(self.number(dof).input_value())

    def score(self):
        return int(self.page.inner_text("#total").split()[0])

    def picture(self, camera):
        """Bytes of what a view shows."""
        return self.page.locator(f"canvas[aria-label='camera {camera}']").screenshot()

    def press(self, keys, n=1):
        for _ in range(n):
            self.page.keyboard.press(keys)
        self.settled()

    def on_screen(self, camera, pixel):
        box = self.page.locator(f"canvas[aria-label='camera {camera}']").bounding_box()
        lens = self.clip.rig[camera].model
        scale = min(box["width"] / lens.width, box["height"] / lens.height)
        middle = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
        return middle + (np.asarray(pixel) - ((lens.width - 1) / 2, (lens.height - 1) / 2)) * scale

    def drag(self, camera, start, end, modifier=None):
        if modifier:
            self.page.keyboard.down(modifier)
        self.page.mouse.move(*self.on_screen(camera, start))
        self.page.mouse.down()
        self.page.mouse.move(*self.on_screen(camera, (np.asarray(start) + end) / 2))
        self.page.mouse.move(*self.on_screen(camera, end))
        self.settled()
        self.page.mouse.up()
        if modifier:
            self.page.keyboard.up(modifier)
        self.settled()

    def save(self, name):
        """The state that is written under this name."""
        self.press("Control+s")
        self.page.fill("#name", name)
        self.page.click("#write")
        self.page.wait_for_selector("#saving:not([open])", state="attached")
        return load_state(self.clip.folder / f"poses/{name}.yaml", self.clip.model)


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    clip = make_clip(tmp_path_factory.mktemp("studio"), n_images=3)
    files = ["--rig", clip.rig_file, "--model", clip.model_file, "--initial-state", clip.state_file]
    with running_studio(*files, "--folder", clip.folder / "poses") as studio, browser_tab() as tab:
        yield studio, tab, clip


@pytest.fixture
def hands(desk):
    studio, tab, clip = desk
    hands = Hands(tab.page, clip)
    hands.open(studio.page("pose.html"))
    if tab.page.locator("#kept").is_visible():  # from the test before
        tab.page.click("#discard")
        hands.settled()
        hands.open(studio.page("pose.html"))
    tab.page.keyboard.press("0")
    yield hands
    assert tab.errors == []


def unzoomed(hands):
    for camera in hands.clip.rig.names:
        hands.page.locator(f"canvas[aria-label='camera {camera}']").dblclick(position={"x": 3, "y": 3})
    hands.settled()


def test_a_slider_moves_the_body_and_the_score(hands):
    before, score = hands.picture("cam01"), hands.score()
    assert score > 60 and hands.value("elbow_flexion") == pytest.approx(np.rad2deg(-0.7), abs=0.1)
    hands.slider("elbow_flexion").focus()
    hands.press("Control+ArrowLeft", 4)  # 40 degrees away
    assert hands.value("elbow_flexion") == pytest.approx(np.rad2deg(-0.7) - 40.0, abs=0.1)
    assert hands.picture("cam01") != before and hands.score() < score
    hands.press("Shift+ArrowRight", 5)
    assert hands.value("elbow_flexion") == pytest.approx(np.rad2deg(-0.7) - 39.5, abs=0.1)
    hands.press("Control+z", 2)
    assert hands.value("elbow_flexion") == pytest.approx(np.rad2deg(-0.7), abs=0.1) and hands.score() == score
    hands.press("Control+y")
    assert hands.value("elbow_flexion") < np.rad2deg(-0.7) - 30.0


def test_a_number_is_taken_and_limited(hands):
    hands.number("shoulder_y").fill("-45.5")
    hands.press("Enter")
    assert hands.value("shoulder_y") == -45.5
    assert float(hands.slider("shoulder_y").input_value()) == pytest.approx(-45.5)
    hands.number("shoulder_y").fill("900")
    hands.press("Tab")
    assert hands.value("shoulder_y") == pytest.approx(np.rad2deg(2.0), abs=0.1)


def test_the_mouse_takes_a_hand(hands):
    unzoomed(hands)
    camera = hands.clip.rig["cam02"]
    state = hands.clip.states[0]
    wrist = camera.project(Configuration(hands.clip.model, state).landmarks_world[2])[0]
    end = wrist + np.array([6.0, -7.0])
    hands.drag("cam02", wrist, end)
    moved = hands.save("dragged")
    found = camera.project(Configuration(hands.clip.model, moved).landmarks_world[2])[0]
    np.testing.assert_allclose(found, end, atol=0.6)  # a pixel of the screen is less than that
    np.testing.assert_allclose(moved.T_world_root, state.T_world_root, atol=1e-6)
    hands.press("Control+z")  # the whole drag is one step
    np.testing.assert_allclose(hands.save("undone").joint_positions, state.joint_positions, atol=1e-9)
    assert hands.page.locator("#undo").is_disabled()


def test_the_mouse_shifts_the_body(hands):
    unzoomed(hands)
    camera, state = hands.clip.rig["cam01"], hands.clip.states[0]
    elbow = camera.project(Configuration(hands.clip.model, state).landmarks_world[1])[0]
    hands.drag("cam01", elbow, elbow + np.array([-10.0, 5.0]), "Alt")
    moved = hands.save("shifted")
    found = camera.project(Configuration(hands.clip.model, moved).landmarks_world[1])[0]
    np.testing.assert_allclose(found, elbow + np.array([-10.0, 5.0]), atol=0.6)
    np.testing.assert_allclose(moved.joint_positions, state.joint_positions, atol=1e-6)


def test_the_engine_fits_from_the_pose(hands):
    hands.press(".", SET)
    assert f"set {SET} of 3" in hands.page.inner_text("#where")
    hands.slider("elbow_flexion").focus()
    hands.press("Control+ArrowLeft", 2)
    before = hands.score()
    hands.page.locator("canvas").first.focus()
    hands.page.keyboard.press("f")
    hands.page.wait_for_selector("#fitted:has-text('residual')", timeout=60000)
    hands.settled()
    assert hands.score() > before
    fitted, truth = hands.save("fitted"), hands.clip.states[SET]
    found = Configuration(hands.clip.model, fitted).landmarks_world - Configuration(hands.clip.model, truth).landmarks_world
    assert np.linalg.norm(found, axis=1).max() < 0.02


def test_a_pose_is_saved_loaded_and_not_overwritten_unasked(hands):
    path = hands.clip.folder / "poses/kept.yaml"
    first = hands.save("kept")
    np.testing.assert_allclose(first.joint_positions, hands.clip.states[0].joint_positions, atol=1e-9)
    hands.number("shoulder_y").fill("10")
    hands.press("Enter")
    content = path.read_bytes()
    hands.press("Control+s")
    hands.page.fill("#name", "kept")
    hands.page.click("#write")
    hands.page.wait_for_selector("#exists:not([hidden])")
    assert "is there already" in hands.page.inner_text("#exists") and path.read_bytes() == content
    hands.page.click("#write")  # "Replace"
    hands.page.wait_for_selector("#saving:not([open])", state="attached")
    assert np.rad2deg(load_state(path, hands.clip.model).joint_positions[1]) == pytest.approx(10.0)
    hands.press("Control+z")
    hands.page.select_option("#load", "kept.yaml")
    hands.settled()
    assert hands.value("shoulder_y") == 10.0


def test_keys_show_one_camera_and_hide_the_overlay(hands):
    shown = hands.page.locator(".view:not([hidden])")
    hands.press("2")
    assert shown.count() == 1 and "cam02" in shown.inner_text()
    with_overlay = hands.picture("cam02")
    hands.press("o")
    assert hands.picture("cam02") != with_overlay
    hands.press("o")
    hands.press("2")
    assert shown.count() == 3
    hands.press("?")
    assert hands.page.locator("#keys").is_visible()
    hands.press("Escape")


def test_a_page_without_its_files_says_which(desk):
    tab = desk[1]
    with running_studio() as studio:
        tab.page.goto(studio.page("pose.html"))
        tab.page.wait_for_selector(".notice")
        assert "--rig" in tab.page.inner_text(".notice") or "--model" in tab.page.inner_text(".notice")
        tab.page.goto(f"{studio.origin}/index.html")
        tab.page.wait_for_selector("#facts tr")
        assert "not given" in tab.page.inner_text("#facts")
    tab.errors.clear()  # the console names what the server has refused


def test_a_pose_that_is_not_saved_outlives_a_reload_until_it_is_discarded(desk, hands):
    studio, first = desk[0], pytest.approx(np.rad2deg(-0.7), abs=0.1)
    hands.number("elbow_flexion").fill("-77")
    hands.press("Enter")
    hands.page.locator("#set").fill("2")
    hands.settled()
    hands.open(studio.page("pose.html"))
    assert hands.value("elbow_flexion") == pytest.approx(-77.0, abs=0.1)
    assert hands.page.locator("#kept").is_visible() and "not saved" in hands.page.inner_text("#kept")
    assert hands.page.inner_text("#where").startswith("set 2 of 3")
    hands.page.click("#discard")
    hands.settled()
    assert hands.value("elbow_flexion") == first and hands.page.locator("#kept").is_hidden()
    hands.open(studio.page("pose.html"))
    assert hands.value("elbow_flexion") == first and hands.page.locator("#kept").is_hidden()
