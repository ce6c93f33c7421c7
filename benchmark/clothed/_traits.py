"""What a seed decides: who does what in which clothes, and what makes it hard.

Seeds 1 to 8 and 101 to 106 have a cast that is stated here, so that bodies and motions are spread; other seeds draw it. Seeds
from 101 on have other bodies than those below.
"""

from __future__ import annotations

import colorsys
from dataclasses import dataclass, replace

import numpy as np

from benchmark.clothed.person._clothes import CHECKS, HAIR, HOOPS, PLAIN, SHIRT, SHOES, SKIN, STRIPES, TROUSERS, Outfit
from benchmark.clothed.person._motions import CAPTURED, MOTIONS, MotionChoice

FIRST_HELD_OUT = 101
BODIES = ("child", "woman", "tall_man", "man", "heavy_man", "old_woman", "heavy_woman", "athlete")
HELD_OUT_BODIES = ("sportswoman", "girl", "stout_old_man", "small_man", "teenager", "tall_woman")


@dataclass(frozen=True)
class Cast:
    """Body, motion, whether a second person walks by, and whether something stands before the legs in one camera."""

    body: str
    motion: str
    has_passer: bool = False
    has_obstacle: bool = False


CASTS = {
    1: Cast("child", "walk"),
    2: Cast("woman", "dance_a"),
    3: Cast("tall_man", "kick"),
    4: Cast("man", "guard", has_passer=True),
    5: Cast("heavy_man", "squat"),
    6: Cast("old_woman", "wave_and_turn", has_obstacle=True),
    7: Cast("heavy_woman", "sit"),
    8: Cast("athlete", "jump", has_passer=True),
    101: Cast("sportswoman", "cross_arms", has_obstacle=True),
    102: Cast("girl", "dance_b"),
    103: Cast("stout_old_man", "punch", has_passer=True),
    104: Cast("small_man", "spin"),
    105: Cast("teenager", "sit"),
    106: Cast("tall_woman", "guard", has_passer=True),
}

_SKINS = ((0.93, 0.76, 0.66), (0.87, 0.67, 0.54), (0.78, 0.58, 0.44), (0.62, 0.44, 0.32), (0.45, 0.31, 0.23), (0.3, 0.2, 0.15))
_HAIRS = ((0.1, 0.08, 0.07), (0.24, 0.15, 0.1), (0.42, 0.28, 0.16), (0.72, 0.58, 0.36), (0.62, 0.61, 0.6), (0.36, 0.14, 0.08))


@dataclass(frozen=True)
class Traits:
    """Of one clip.

    Parameters
    ----------
    cast : who does what.
    motion : how.
    n_images : image sets.
    passer : body of the second person, or None.
    """

    cast: Cast
    motion: MotionChoice
    n_images: int
    passer: str | None


def draw_traits(seed: int, rng: np.random.Generator, body: str | None = None, motion: str | None = None) -> Traits:
    """What a seed decides before anything is drawn.

    Parameters
    ----------
    seed : of the clip.
    rng : made of the seed.
    body, motion : instead of the cast's.

    Returns
    -------
    The traits.
    """
    bodies = HELD_OUT_BODIES if seed >= FIRST_HELD_OUT else BODIES
    drawn = _draw_cast(bodies, rng)
    cast = CASTS.get(seed, drawn)
    cast = replace(cast, body=body or cast.body, motion=motion or cast.motion)
    speed = float(rng.uniform(0.85, 1.15)) if cast.motion in CAPTURED else 1.0
    choice = MotionChoice(cast.motion, speed, bool(rng.random() < 0.5), float(rng.uniform(-np.pi, np.pi)))
    others = [name for name in bodies if name != cast.body]
    passer = (body or str(rng.choice(others))) if cast.has_passer else None
    return Traits(cast, choice, int(rng.integers(60, 91)), passer)


def _draw_cast(bodies: tuple[str, ...], rng: np.random.Generator) -> Cast:
    body, motion = str(rng.choice(bodies)), str(rng.choice(MOTIONS))
    passes, hides = rng.random(2) < (0.3, 0.15)
    return Cast(body, motion, bool(passes), bool(hides and not passes))


def draw_outfit(wall: np.ndarray, floor: np.ndarray, rng: np.random.Generator) -> Outfit:
    """Clothes; half of the shirts are near the wall's color, half of the trousers near the floor's.

    Parameters
    ----------
    wall, floor : (3,) sRGB between 0 and 1.
    rng : decides.

    Returns
    -------
    The outfit.
    """
    near_wall, near_floor = bool(rng.random() < 0.5), bool(rng.random() < 0.5)
    skin, hair = _SKINS[rng.integers(len(_SKINS))], _HAIRS[rng.integers(len(_HAIRS))]
    colors = np.empty((5, 3))
    colors[SHIRT] = _near(wall, rng) if near_wall else _any_color(rng)
    colors[TROUSERS] = _near(floor, rng) if near_floor else _any_color(rng)
    colors[SHOES] = _any_color(rng)
    colors[HAIR], colors[SKIN] = hair, skin
    colors = np.clip(colors + rng.normal(0.0, 0.015, (5, 1)), 0.04, 0.95)
    second = np.clip(colors * rng.choice([0.6, 0.75, 1.35], (5, 1)) + rng.normal(0.0, 0.03, (5, 3)), 0.03, 0.97)
    patterns = np.zeros(5, dtype=np.int64)
    patterns[SHIRT] = rng.choice([PLAIN, STRIPES, HOOPS, CHECKS], p=[0.4, 0.2, 0.2, 0.2])
    patterns[TROUSERS] = rng.choice([PLAIN, STRIPES, CHECKS], p=[0.8, 0.1, 0.1])
    loose = rng.uniform(0.0, 1.0)
    hair_low = -1.0 if rng.random() < 0.12 else float(rng.uniform(0.1, 0.9))
    return Outfit(
        colors, second, patterns, rng.uniform(0.025, 0.08, 5),
        np.array([0.006 + 0.014 * loose, 0.005 + 0.012 * loose, 0.009, 0.014]),
        np.array([0.002 + 0.006 * loose, 0.002 + 0.005 * loose, 0.0, 0.003]),
        sleeve=float(rng.choice([0.3, 0.45, 0.93])), trouser_leg=float(rng.choice([0.45, 0.75, 0.97], p=[0.25, 0.15, 0.6])),
        hem_m=float(rng.uniform(-0.12, 0.1)), hair_low=hair_low, near_wall=near_wall, near_floor=near_floor,
    )  # fmt: skip


def _near(color: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    return np.clip(color * rng.uniform(0.92, 1.08) + rng.normal(0.0, 0.02, 3), 0.05, 0.95)


def _any_color(rng: np.random.Generator) -> np.ndarray:
    return np.array(colorsys.hsv_to_rgb(rng.random(), rng.uniform(0.05, 0.85), rng.uniform(0.12, 0.9)))
