"""Colors of lines, of sides, and of the states of bodies and limbs: the same in reports, studio, layouts, markers and overlays.

After Okabe and Ito: distinct for color-blind readers, too. `WORDS` are darker, for text on white (contrast above 4.5).
"""

from __future__ import annotations

BLUE, ORANGE, GREEN, RED, PURPLE, GRAY = "#0072b2", "#e69f00", "#009e73", "#d55e00", "#cc79a7", "#777777"
SKY, OLIVE, BLACK = "#56b4e9", "#999933", "#1d2730"  # the last is that of ink
CYCLE = (BLUE, ORANGE, GREEN, RED, PURPLE, SKY, OLIVE, GRAY)
SIDES = {"left": BLUE, "right": ORANGE}
STATES = {"initializing": SKY, "tracking": GREEN, "degraded": ORANGE, "lost": RED, "unseen": "#d5dadf"}
WORDS = {"initializing": "#23749f", "tracking": "#00765a", "degraded": "#8a5a00", "lost": "#a84300", "unseen": "#5b6770"}
_NAMES = dict(zip(CYCLE, ("blue", "orange", "green", "red", "purple", "light blue", "olive", "gray"), strict=True))


def color_name(color: str) -> str:
    """What people call a color of this module; another one as it is."""
    return _NAMES.get(color, color)


def rgb_of(state: str) -> tuple[float, float, float]:
    """Red, green and blue of a state, 0..1."""
    return rgb(STATES[state])


def rgb(color: str) -> tuple[float, float, float]:
    """Red, green and blue of ``#rrggbb``, 0..1."""
    red, green, blue = (int(color[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return red, green, blue
