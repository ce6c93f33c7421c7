"""Colors of a body's and a limb's states, the same in reports, the studio, layouts and markers.

After Okabe and Ito: distinct for color-blind readers, too. `WORDS` are darker, for text on white (contrast above 4.5).
"""

from __future__ import annotations

STATES = {"initializing": "#56b4e9", "tracking": "#009e73", "degraded": "#e69f00", "lost": "#d55e00", "unseen": "#d5dadf"}
WORDS = {"initializing": "#23749f", "tracking": "#00765a", "degraded": "#8a5a00", "lost": "#a84300", "unseen": "#5b6770"}


def rgb_of(state: str) -> tuple[float, float, float]:
    """Red, green and blue, 0..1."""
    red, green, blue = (int(STATES[state][i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    return red, green, blue
