"""The steps in a browser, on a phone: as wide as the screen, large enough to touch, and done by their buttons."""

import shutil

import pytest

from helpers.studio.browser import SMALL, TOO_WIDE, browser_tab
from helpers.studio.studio_process import running_studio

WIDTH, HEIGHT = 390, 844


@pytest.mark.long
def test_the_rig_is_made_by_its_button(recorded, tmp_path):
    shutil.copytree(recorded, tmp_path / "walk")
    with running_studio("--new", tmp_path / "walk") as studio, browser_tab(WIDTH, HEIGHT) as tab:
        page = tab.page
        page.goto(studio.url)
        page.wait_for_selector("#step-rig [data-field=backgrounds]")
        assert page.locator("#step-time .state").inner_text() == "not yet"
        page.select_option("#step-rig [data-field=backgrounds]", "none")
        page.wait_for_function("() => document.querySelector('#step-rig pre').textContent.includes('rig import Calib.toml')")
        page.click("#step-rig button.primary")
        page.wait_for_function("() => document.querySelector('#step-rig .state').textContent === 'done'", timeout=120_000)
        for step in ("rig", "time", "world", "body"):
            if not page.evaluate(f"document.querySelector('#step-{step}').open"):
                page.click(f"#step-{step} > summary")
        page.wait_for_selector("body[aria-busy=false]")
        assert "cam01.mp4, 200x200" in page.inner_text("#step-rig") and (tmp_path / "walk/rig.yaml").is_file()
        assert page.evaluate("document.documentElement.scrollWidth") <= WIDTH
        assert page.evaluate(TOO_WIDE) == [] and page.evaluate(SMALL) == []
        assert tab.errors == []
