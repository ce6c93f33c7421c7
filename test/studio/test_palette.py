"""The colors of states: one source, the same everywhere, told apart by everybody."""

import re
from itertools import combinations

import numpy as np
import pytest

from tracker_node.evaluation.report.charts import LIMB_COLORS, STATUS_COLORS, TRUTH_COLORS
from tracker_node.loaders import layouts
from tracker_node.render.palette import STATES, WORDS, rgb_of
from tracker_node.studio.server import WEB_FOLDER, palette_css
from tracker_node.tracking.estimate import LimbStatus, Status

# Machado, Oliveira and Fernandes, IEEE TVCG 15 (2009), severity 1.0; of linear RGB
SIGHTS = {
    "usual": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
XYZ = np.array([[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]])
WHITE = np.array([0.95047, 1.0, 1.08883])


def linear(color: str) -> np.ndarray:
    values = np.array([int(color[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


def lab(rgb: np.ndarray) -> np.ndarray:
    x = XYZ @ np.clip(rgb, 0.0, 1.0) / WHITE
    f = np.where(x > 0.008856, np.cbrt(x), 7.787 * x + 16.0 / 116.0)
    return np.array([116.0 * f[1] - 16.0, 500.0 * (f[0] - f[1]), 200.0 * (f[1] - f[2])])


def test_every_state_has_one_color_everywhere():
    assert {status.name.lower() for status in (*Status, *LimbStatus)} == set(STATES) == set(WORDS)
    assert {status.name.lower(): color for status, color in (*STATUS_COLORS.items(), *LIMB_COLORS.items())} == STATES
    assert TRUTH_COLORS["lost"] == STATES["lost"] and TRUTH_COLORS["near"] == STATES["tracking"]
    served = dict(re.findall(r"--([a-z]+): (#[0-9a-f]{6});", palette_css()))
    assert served == STATES
    assert dict(re.findall(r"--([a-z]+)-word: (#[0-9a-f]{6});", palette_css())) == WORDS
    shown = dict(zip(layouts._STATUS, layouts._STATUS_COLORS, strict=True))
    assert {name.lower(): color for name, color in shown.items()} == {n: c for n, c in STATES.items() if n != "unseen"}


def test_a_lost_body_is_drawn_in_the_color_of_lost():
    from tracker_node.model.humans.human import human_model
    from tracker_node.runs.messages.body import color

    lost = color(human_model().shapes[0], Status.LOST)
    assert (lost["r"], lost["g"], lost["b"]) == pytest.approx(rgb_of("lost"))
    assert rgb_of("lost") == pytest.approx(tuple(int(STATES["lost"][i : i + 2], 16) / 255 for i in (1, 3, 5)))


def test_no_page_has_colors_of_states_of_its_own():
    style = (WEB_FOLDER / "style.css").read_text()
    assert style.startswith('@import url("/palette.css");')
    for name, state in (("good", "tracking"), ("fair", "degraded"), ("bad", "lost"), ("first", "initializing")):
        assert f"--{name}: var(--{state});" in style
    own = re.compile(rf"({'|'.join(STATES)}|good|fair|bad)\W{{1,3}}#[0-9a-f]{{3}}", re.IGNORECASE)
    assert not [script.name for script in WEB_FOLDER.glob("*.js") if own.search(script.read_text())]


@pytest.mark.parametrize("sight", SIGHTS)
def test_states_are_told_apart(sight):
    seen = {name: lab(np.array(SIGHTS[sight]) @ linear(color)) for name, color in STATES.items()}
    apart = {pair: float(np.linalg.norm(seen[pair[0]] - seen[pair[1]])) for pair in combinations(seen, 2)}
    assert min(apart.values()) > 15.0, apart  # CIELAB; about 2 can just be seen


@pytest.mark.parametrize("state", WORDS)
def test_words_are_legible_on_white(state):
    brightness = float(linear(WORDS[state]) @ XYZ[1])
    assert 1.05 / (brightness + 0.05) >= 4.5  # WCAG 2, AA
