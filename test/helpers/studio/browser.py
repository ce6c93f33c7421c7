"""A headless browser, so that pages are tested where people see them."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

import pytest

# Of what is wider than the screen of a phone, and of what is too small to touch
TOO_WIDE = """[...document.querySelectorAll('body *')].filter((e) => {
  if (e.getBoundingClientRect().right <= innerWidth + 1) return false;
  for (let at = e.parentElement; at && at !== document.body; at = at.parentElement) {
    if (getComputedStyle(at).overflowX !== 'visible') return false;
  }
  return true;
}).map((e) => `${e.tagName}.${e.className}#${e.id}`)"""
SMALL = """[...document.querySelectorAll('main button, main select, header nav a')].filter((e) => e.offsetParent).filter((e) => {
  const { width, height } = e.getBoundingClientRect();
  return Math.min(width, height) < 36;
}).map((e) => e.id || e.textContent)"""
NAMES = ("chromium", "chromium-browser", "google-chrome")


@dataclass
class Tab:
    """A page of playwright's, and everything that its console has called an error."""

    page: Any
    errors: list[str] = field(default_factory=list)


@contextmanager
def browser_tab(width: int = 1400, height: int = 900) -> Iterator[Tab]:
    """An empty tab of a browser of its own. Skips the test where no browser is installed."""
    binary = next((path for path in map(shutil.which, NAMES) if path), None)
    if binary is None:
        pytest.skip("no browser: sudo apt-get install -y chromium")
    from playwright.sync_api import sync_playwright

    # Debian's build, run as root in containers with a small /dev/shm; the loopback only.
    arguments = ["--no-sandbox", "--disable-dev-shm-usage", "--disable-background-networking", "--disable-gpu"]
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=binary, headless=True, args=arguments)
        try:
            tab = Tab(browser.new_page(viewport={"width": width, "height": height}))
            tab.page.on("console", lambda said: tab.errors.append(said.text) if said.type == "error" else None)
            tab.page.on("pageerror", lambda error: tab.errors.append(str(error)))
            yield tab
        finally:
            browser.close()
