"""The page of the seven steps in a browser: what somebody does there, and reads; and the same by the commands that it shows."""

import shlex
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from helpers.studio.browser import browser_tab
from helpers.studio.studio_process import running_studio
from tracker_node.cli.main import main


class Hands:
    """What somebody does on the page, and reads there."""

    def __init__(self, page):
        self.page = page

    def open(self, step: str) -> None:
        if not self.page.evaluate(f"document.querySelector('#step-{step}').open"):
            self.page.click(f"#step-{step} > summary")

    def fill(self, step: str, values: dict[str, str]) -> None:
        """Choose and type."""
        self.open(step)
        for name, value in values.items():
            at = self.page.locator(f"#step-{step} [data-{name}]" if name == "way" else f"#step-{step} [data-field={name}]")
            if at.evaluate("e => e.tagName") == "SELECT":
                at.select_option(value)
            else:
                at.click()
                at.press("Control+a")
                self.page.keyboard.type(value)

    def press(self, step: str) -> list[str]:
        """The step's button, twice as some people do, once its command lines are there; they are returned."""
        self.page.wait_for_function(f"() => document.querySelector('#step-{step} pre').textContent.startsWith('tracker_node ')")
        self.page.wait_for_selector("body[aria-busy=false]")
        shown = self.page.locator(f"#step-{step} pre").first.inner_text().splitlines()
        with self.page.expect_response("**/api/wizard/start"):
            self.page.dblclick(f"#step-{step} button.primary")
        self.page.wait_for_selector("body[aria-busy=false]")  # what an earlier command has said is gone
        return shown

    def wait(self, step: str) -> None:
        """Until what runs is over, and the step is done."""
        self.page.wait_for_selector(f"#step-{step}")
        over = f"#step-{step}:not(:has(#cancel)) > summary > .state.good, #step-{step}:not(:has(#cancel)) .job .bad"
        self.page.locator(over).first.wait_for(timeout=120_000)
        self.page.wait_for_selector("body[aria-busy=false]")
        assert self.page.locator(f"#step-{step} .job .bad").all_inner_texts() == []

    def do(self, step: str, **values: str) -> list[str]:
        self.fill(step, values)
        shown = self.press(step)
        self.wait(step)
        return shown

    def missing(self, step: str, **values: str) -> str:
        """What the step still needs with these values; its button cannot be pressed."""
        self.fill(step, values)
        self.page.wait_for_function(f"() => document.querySelector('#step-{step} pre.soft')")
        self.page.wait_for_selector("body[aria-busy=false]")
        assert self.page.is_disabled(f"#step-{step} button.primary")
        return self.page.locator(f"#step-{step} pre").first.inner_text()

    def refused(self, step: str, **values: str) -> str:
        """Why the step's command has ended with an error."""
        self.fill(step, values)
        self.press(step)
        error = self.page.locator(f"#step-{step}:not(:has(#cancel)) .job .bad")
        error.wait_for(timeout=120_000)
        self.page.wait_for_selector("body[aria-busy=false]")
        return error.inner_text()

    def said(self, step: str) -> str:
        return self.page.inner_text(f"#step-{step}")


@contextmanager
def hands_on(folder: Path, width: int = 1280) -> Iterator[Hands]:
    """The page of a folder; nothing may be an error there."""
    with running_studio("--new", folder) as studio, browser_tab(width, 900) as tab:
        tab.page.goto(studio.url)
        tab.page.wait_for_selector("#step-look")
        tab.page.wait_for_selector("body[aria-busy=false]")
        yield Hands(tab.page)
        assert tab.errors == []


def same_by_hand(shown: list[str], by_page: Path, by_hand: Path, *written: str, monkeypatch) -> None:
    """The commands that the page has shown write the same files elsewhere."""
    monkeypatch.chdir(by_hand)
    for line in shown:
        assert main(shlex.split(line.removeprefix("tracker_node "))) == 0, line
    for name in written:
        assert (by_page / name).read_bytes() == (by_hand / name).read_bytes(), name
