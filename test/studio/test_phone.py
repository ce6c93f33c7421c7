"""Every page of the studio on a phone: as wide as the screen, and large enough to touch."""

import pytest

from helpers.cameras.small_clip import make_clip
from helpers.studio.browser import SMALL, TOO_WIDE, browser_tab
from helpers.studio.studio_process import running_studio
from tracker_node.cli.main import main

pytestmark = pytest.mark.long  # a browser and a studio

WIDTH, HEIGHT = 390, 844
PAGES = ("index", "pose", "digitizing", "playback", "live")



@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    clip = make_clip(tmp_path_factory.mktemp("clip"), n_images=4)
    assert main(["track", *clip.arguments(), "--output", str(clip.folder / "run"), "--quiet"]) == 0
    files = ["--rig", clip.rig_file, "--model", clip.model_file, "--initial-state", clip.state_file]
    with running_studio(*files, "--run", clip.folder / "run") as studio, browser_tab(WIDTH, HEIGHT) as tab:
        yield studio, tab


@pytest.mark.parametrize("name", PAGES)
def test_nothing_is_wider_than_the_screen_or_too_small_to_touch(desk, name):
    studio, tab = desk
    tab.page.goto(studio.page(f"{name}.html"))
    tab.page.wait_for_selector("header.studio nav a")
    tab.page.wait_for_selector("body[aria-busy=false]")
    assert tab.page.evaluate("document.querySelector('meta[name=viewport]').content") == "width=device-width, initial-scale=1"
    assert tab.page.evaluate("document.documentElement.scrollWidth") <= WIDTH
    assert tab.page.evaluate(TOO_WIDE) == []
    assert tab.page.evaluate(SMALL) == []
    for view in tab.page.locator(".view").all():
        box = view.bounding_box()
        assert box["width"] > 0.8 * WIDTH and box["height"] > 100
    assert tab.errors == []
