"""The page on which points are digitized, in a browser: what a person does there."""

import numpy as np


class Hands:
    """What a person does on the page."""

    def __init__(self, page, rig):
        self.page, self.rig = page, rig

    def open(self, url):
        self.page.goto(url)
        self.page.wait_for_selector("main:not([hidden]) .view canvas")
        self.page.wait_for_function("() => document.querySelector('#time').textContent !== ''")

    def text(self, selector):
        return self.page.inner_text(selector)

    def wait_for(self, selector, text):
        self.page.wait_for_function("([s, t]) => document.querySelector(s)?.innerText.includes(t)", arg=[selector, text])

    def add_point(self, name):
        self.page.fill("#name", name)
        self.page.keyboard.press("Enter")
        self.page.wait_for_selector(f'#points tr[aria-selected=true]:has(td[title="{name}"])')

    def click(self, camera, pixel):
        """Press where an image pixel is on the screen; the pixel that the whole screen pixel there means."""
        at, meant = self.on_screen(camera, pixel)
        self.page.mouse.click(*at)
        return meant

    def on_screen(self, camera, pixel):
        """Whole pixel of the screen at which an image pixel is, and the image pixel that it means."""
        box = self.page.locator(f"canvas[aria-label='camera {camera}']").bounding_box()
        model = self.rig[camera].model
        scale = min(box["width"] / model.width, box["height"] / model.height)
        middle = np.array([box["x"] + box["width"] / 2, box["y"] + box["height"] / 2])
        center = np.array([(model.width - 1) / 2, (model.height - 1) / 2])
        at = np.round(middle + (np.asarray(pixel) - center) * scale)
        return at, center + (at - middle) / scale

    def click_all(self, place):
        for camera in self.rig:
            self.click(camera.name, camera.project(place)[0])

    def saved(self):
        """Until nothing waits to be saved: the page asks before it is left."""
        self.page.wait_for_function("() => window.dispatchEvent(new Event('beforeunload', { cancelable: true }))")
