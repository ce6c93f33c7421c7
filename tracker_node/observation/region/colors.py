"""Densities of color of a body's parts, and of what surrounds it, in one camera: for correspondence lines.

Parts that look alike share one histogram (`color_classes`), so that a limb that is off does not spoil its color. What is learned
on line is mixed with the color that the model states, where the images bear that out: a model's colors may be for show only.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache

import cv2
import numpy as np

from ...compiled.kernels import compiled
from ...model.articulated import ArticulatedModel
from ..appearance import BINS, Region, count_colors, spread_counts

N_COLORS = BINS**3
UNIFORM = 1.0 / N_COLORS
_MOST_TOLD, _LEAST_DENSITY = 2.0, 1e-9  # of `distinctness`
_MIX = 0.02  # a little of every color: none is impossible
_DOUBTFUL = 0.3  # weight of surroundings that may be the body's
_AS_LIKELY = 0.999  # times as much: colors that were seen nowhere have the same density everywhere
_LEAST_COUNT = 20  # pixels; fewer do not count
_SHADED = 0.3  # of the surroundings of a thing that may cast a shadow
_SHADOWS = (0.4, 0.5, 0.6, 0.7, 0.8)  # how bright they are there


@compiled
def mix_counts(shares, counts, rate):
    """Mix new counts of colors into a histogram. Counts are summed as integers: those are summed side by side.

    Parameters
    ----------
    shares : (`N_COLORS`,) float32 fractions, changed in place; zeros while nothing is known.
    counts : (`N_COLORS`,) float32 pixels.
    rate : weight of the new ones, float32.

    Returns
    -------
    How many pixels there are, or 0 if they are too few to count.
    """
    total = np.int32(0)
    for k in range(np.uint64(counts.size)):
        total += np.int32(counts[k])
    if total < _LEAST_COUNT:
        return 0
    old = np.float32(1.0) - rate if shares.any() else np.float32(0.0)
    new = (np.float32(1.0) - old) / np.float32(total)
    for k in range(np.uint64(shares.size)):
        shares[k] = old * shares[k] + new * counts[k]
    return total


@compiled
def mix_classes(parts, counts, rate, kinds, support):
    """Mix new counts of every class into its histogram.

    Parameters
    ----------
    parts : (n_classes, `N_COLORS`) float32 fractions, changed in place.
    counts : (n_classes, `N_COLORS`) float32 pixels.
    rate : weight of the new ones, float32.
    kinds : (n_classes, `N_COLORS`) bool, the colors that speak for the stated one.
    support : (n_classes,) becomes the fraction of pixels in those colors, where a class has such and enough pixels.
    """
    for i in range(len(parts)):
        total = mix_counts(parts[i], counts[i], rate)
        if total == 0 or not kinds[i].any():
            continue
        alike = np.int32(0)
        for k in range(np.uint64(N_COLORS)):
            alike += np.int32(counts[i, k]) * np.int32(kinds[i, k])
        support[i] = np.float32(alike) / np.float32(total)


@compiled
def fill_classes(parts, shades, stated, trusted, doubted, borne_out, prior_share, body):
    """Fill the densities of all classes from what is known of each.

    Parameters
    ----------
    parts : (n_classes, `N_COLORS`) float32, colors that were learned.
    shades : (n_classes, `N_COLORS`) float32, shades of the stated color that are seen.
    stated : (n_classes, `N_COLORS`) float32.
    trusted : (n_classes,) bool, shades count.
    doubted : (n_classes,) bool, and what was learned does not.
    borne_out : (n_classes,) bool, stated colors count for ``prior_share``.
    prior_share : fraction.
    body : (n_classes, `N_COLORS`) float32, filled.
    """
    for i in range(len(parts)):
        known, of_shades, of_stated = parts[i].any(), 0.0, 0.0  # shares
        if trusted[i] and shades[i].any():
            of_shades = 0.5 if known and not doubted[i] else 1.0
        if borne_out[i] and stated[i].any():
            of_stated = prior_share if known or of_shades > 0.0 else 1.0
        fill_density(parts[i], shades[i], of_shades, stated[i], of_stated, body[i])


@compiled
def fill_density(learned, shades, of_shades, stated, of_stated, density):
    """Fill one density: of what is learned and of shades, neighboring colors sharing, of what is stated, and a little of all.

    Parameters
    ----------
    learned, shades : (`N_COLORS`,) float32 fractions.
    of_shades : fraction of shades in what is seen.
    stated : (`N_COLORS`,) float32 fractions.
    of_stated : fraction of what is stated in the result.
    density : (`N_COLORS`,) float32, filled.
    """
    if of_shades == 0.0 and of_stated == 0.0 and not learned.any():
        density[:] = UNIFORM
        return
    density[:] = np.float32(0.0)
    if of_shades < 1.0:
        spread_counts(learned, density)
    if of_shades > 0.0:
        seen, share, rest = np.zeros_like(density), np.float32(of_shades), np.float32(1.0 - of_shades)
        spread_counts(shades, seen)
        for k in range(np.uint64(density.size)):
            density[k] = share * seen[k] + rest * density[k]
    both, prior = np.float32((1.0 - _MIX) * (1.0 - of_stated)), np.float32((1.0 - _MIX) * of_stated)
    for k in range(np.uint64(density.size)):
        density[k] = both * density[k] + prior * stated[k] + np.float32(_MIX * UNIFORM)


@compiled
def shade(lit, out):
    """Darken a part of some colors, as shadows do.

    Parameters
    ----------
    lit : (`N_COLORS`,) float32 fractions.
    out : (`N_COLORS`,) float32, overwritten: the same with `_SHADED` of them in shadows.
    """
    share = np.float32(_SHADED / len(_SHADOWS))
    for k in range(np.uint64(lit.size)):
        out[k] = np.float32(1.0 - _SHADED) * lit[k]
    for b in range(BINS):
        for g in range(BINS):
            for r in range(BINS):
                seen = lit[(b * BINS + g) * BINS + r]
                if seen == 0.0:
                    continue
                for gain in _SHADOWS:
                    x, y, z = int(gain * (b + 0.5)), int(gain * (g + 0.5)), int(gain * (r + 0.5))
                    out[(x * BINS + y) * BINS + z] += share * seen


_BIN_WIDTH = 256 // BINS
_SUPPORT = 0.1  # least fraction of a part's pixels in the stated color that makes the color count
_AS_STATED = 0.7  # least median of that fraction over the parts that makes all count; by chance, clothes come to 0.5
_SPARSE = 6  # every so many rows and columns of an image tell what is chance
_PRIOR_SIGMA = 14.0  # gray levels across, of a stated color
_PRIOR_GAINS = np.linspace(0.45, 1.15, 15)  # how bright surfaces of that color may be, in light and shade


def color_classes(model: ArticulatedModel) -> np.ndarray:
    """(n_shapes,) class of every shape: left and right of a pair with the same stated color are one."""
    side = re.compile(r"(^|_)(left|right|l|r)(?=_|$)")
    keys = [(side.sub(r"\1", shape.name.lower()), tuple(shape.color_rgb)) for shape in model.shapes]
    order = {key: i for i, key in enumerate(dict.fromkeys(keys))}
    return np.array([order[key] for key in keys], dtype=np.int32)


def stated_densities(model: ArticulatedModel, classes: np.ndarray) -> np.ndarray:
    """Densities of the colors that the model states.

    Parameters
    ----------
    model : its shapes may have colors.
    classes : (n_shapes,) of `color_classes`.

    Returns
    -------
    (n_classes, `N_COLORS`) float32 per bin; zeros where a class has no color.
    """
    result = np.zeros((int(classes.max(initial=-1)) + 1, N_COLORS), dtype=np.float32)
    for shape, kind in zip(model.shapes, classes, strict=True):
        if not shape.has_color or result[kind].any():
            continue
        result[kind] = _stated_density(tuple(float(value) for value in shape.color_rgb))
    return result


@lru_cache(maxsize=256)
def _stated_density(color_rgb: tuple[float, ...]) -> np.ndarray:
    """(`N_COLORS`,) of one color; kept, since every tracker of a body asks for the same ones."""
    middle = (np.arange(BINS) + 0.5) * _BIN_WIDTH
    b, g, r = np.meshgrid(middle, middle, middle, indexing="ij")
    colors = np.stack([b.ravel(), g.ravel(), r.ravel()], axis=1)
    shades = np.clip(_PRIOR_GAINS[:, None] * np.array(color_rgb[::-1]), 0.0, 255.0)
    squares = ((colors[:, None, :] - shades[None]) ** 2).sum(axis=2)
    density = np.exp(-0.5 * squares / _PRIOR_SIGMA**2).sum(axis=1)
    return density / density.sum()


def distinctness(part: np.ndarray, scene: np.ndarray) -> float:
    """How well the colors of a part tell it from its surroundings.

    Parameters
    ----------
    part, scene : (`N_COLORS`,) densities.

    Returns
    -------
    Log-likelihood ratio of a pixel of the part against its surroundings, clipped at `_MOST_TOLD`, on average over its colors.
    """
    ratios = np.log((part + _LEAST_DENSITY) / (scene + _LEAST_DENSITY))
    return float(part @ np.clip(ratios, -_MOST_TOLD, _MOST_TOLD) / max(float(part.sum()), _LEAST_DENSITY))


class RegionColors:
    """Color densities of one camera.

    Parameters
    ----------
    classes : (n_shapes,) of `color_classes`.
    stated : (n_classes, `N_COLORS`) of `stated_densities`.
    prior_share : fraction of the stated color in a part's, where the images bear it out.

    Attributes
    ----------
    body : (n_classes, `N_COLORS`) float32, densities per bin of every class.
    scene : (`N_COLORS`,) float32, of the surroundings.
    """

    def __init__(self, classes: np.ndarray, stated: np.ndarray, prior_share: float):
        self._classes, self._stated, self._prior_share = classes, stated, prior_share
        self._kinds = stated > UNIFORM  # colors that bear the stated one out
        self._parts = np.zeros_like(stated)
        self._around = np.zeros(N_COLORS, dtype=np.float32)
        self._shades = np.zeros_like(stated)  # those of the stated colors that are seen on the body or near it
        self._was_reliable, self._was_unreliable = np.zeros((2, len(stated)), dtype=np.bool_)
        self._support = np.full(len(stated), np.nan)  # fraction of a part's pixels in its stated color
        self._as_stated: bool | None = None  # whether the body has the stated colors on the whole, where that is known
        self.body = np.full_like(stated, UNIFORM)
        self.scene = np.full(N_COLORS, UNIFORM, dtype=np.float32)
        self.knows, self._casts_shadow = False, False

    def learn(
        self, bgr: np.ndarray, region: Region, labels: np.ndarray, rate: float, guard_px: int, reach_px: int,
        reliable: np.ndarray | None = None, sure_px: int | None = None, every: int = 1, others: np.ndarray | None = None,
    ) -> None:  # fmt: skip
        """Mix in the colors of one image.

        Parameters
        ----------
        bgr : (height, width, 3) uint8.
        region : (u0, v0, u1, v1) around the body.
        labels : (h, w) uint8 on the region, 1 + shape, 0 beside the body.
        rate : weight of this image, 0..1.
        guard_px : what is nearer to the outline is not learned as surroundings.
        reach_px : surroundings are what lies so near to the outline.
        reliable : (n_shapes,) bool, parts that are where they are drawn; nothing is learned of others.
        sure_px : what is nearer than ``guard_px``, but not than this, may be the body's, or its shadow, and counts a little, as
            do darker shades of all surroundings; None: they do not.
        every : so many pixels a side of a large image have one label, and one of them tells their colors as well.
        others : (h, w) bool, mask on the region of what is no surroundings, other bodies; None without any.
        """
        guard_px, reach_px, sure_px = guard_px // every, reach_px // every, None if sure_px is None else sure_px // every
        self._casts_shadow = sure_px is not None
        body = (labels > 0).view(np.uint8)
        square = np.ones((2 * guard_px + 1, 2 * guard_px + 1), dtype=np.uint8)
        inner = cv2.erode(body, np.ones((3, 3), dtype=np.uint8), borderValue=1)
        near = cv2.dilate(body, np.ones((2 * reach_px + 1, 2 * reach_px + 1), dtype=np.uint8)).view(np.bool_)
        if others is not None:
            near &= ~others
        around = near > cv2.dilate(body, square).view(np.bool_)
        kinds = np.zeros(256, dtype=np.uint8)  # by label
        kinds[1 : len(self._classes) + 1] = 1 + self._classes
        if reliable is not None:
            kinds[1 : len(reliable) + 1][~reliable] = 0
            self._was_reliable[self._classes[reliable]] = True
            self._was_unreliable[self._classes[~reliable]] = True
        counts, scene = np.zeros_like(self._parts), np.zeros(N_COLORS, dtype=np.float32)
        crop = np.empty((*labels.shape, 3), dtype=np.uint8)
        _pick(bgr, region[0], region[1], every, crop)
        count_colors(crop, cv2.LUT(labels, kinds) * inner, around, counts, scene)
        if sure_px is not None and sure_px < guard_px:
            inside = np.ones((2 * sure_px + 1, 2 * sure_px + 1), dtype=np.uint8)
            doubtful = cv2.dilate(body, square).view(np.bool_) > cv2.dilate(body, inside).view(np.bool_)
            scene += np.rint(_DOUBTFUL * _counts(crop, doubtful if others is None else doubtful & ~others))
        mix_classes(self._parts, counts, np.float32(rate), self._kinds, self._support)
        mix_counts(self._around, scene, np.float32(rate))
        if self._as_stated is not False and self._stated.any() and not self._was_reliable.all():
            self._shades = self._stated * np.maximum(_above_chance(bgr, crop, near), 0.0)
            self._shades /= np.maximum(self._shades.sum(axis=1, keepdims=True), 1e-12)
        self._tabulate()

    def as_likely_of(self, shapes: np.ndarray) -> np.ndarray:
        """(`N_COLORS`,) bool, colors that are as likely of some parts, (n_shapes,) mask, as of the scene; unseen ones, too."""
        return (self.body[np.unique(self._classes[shapes])] >= _AS_LIKELY * self.scene).any(axis=0)

    def _tabulate(self) -> None:
        trusted = ~self._was_reliable & bool(self._as_stated)
        borne_out = (self._support > _SUPPORT) | bool(self._as_stated)
        fill_classes(
            self._parts, self._shades, self._stated, trusted, self._was_unreliable, borne_out, self._prior_share, self.body
        )  # fmt: skip
        around = self._around
        if self._casts_shadow:
            shade(self._around, around := np.empty_like(around))
        fill_density(around, around, 0.0, around, 0.0, self.scene)
        self.knows = True


@compiled
def _pick(bgr, u0, v0, every, out):
    """The pixel in the middle of each cell of ``every`` pixels a side, from (u0, v0) on."""
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            v, u = v0 + i * every + every // 2, u0 + j * every + every // 2
            out[i, j, 0], out[i, j, 1], out[i, j, 2] = bgr[v, u, 0], bgr[v, u, 1], bgr[v, u, 2]


def trust_stated_colors(cameras: Sequence[RegionColors]) -> None:
    """Say whether the body has the stated colors on the whole, by what all cameras have learned of it.

    Where it has, a part that is not where it should be is expected to have them, too, whatever is seen in its place.
    """
    support = np.array([colors._support for colors in cameras])
    observed = np.isfinite(support)
    means = np.where(observed, support, 0.0).sum(axis=0)[observed.any(axis=0)] / observed.sum(axis=0)[observed.any(axis=0)]
    as_stated = means.size > 0 and float(np.median(means)) > _AS_STATED
    for colors in cameras:
        colors._as_stated = as_stated and colors._prior_share > 0.0
        if colors.knows:
            colors._tabulate()


def _above_chance(bgr: np.ndarray, crop: np.ndarray, mask: np.ndarray) -> np.ndarray:
    """(`N_COLORS`,) pixels of each color on the ``mask`` of a crop, less those of as many pixels anywhere in the image."""
    on_mask = _counts(crop, mask)
    anywhere = _counts(bgr[::_SPARSE, ::_SPARSE], np.ones(bgr[::_SPARSE, ::_SPARSE].shape[:2], dtype=np.bool_))
    return on_mask - anywhere * (on_mask.sum() / max(anywhere.sum(), 1.0))


def _counts(bgr: np.ndarray, mask: np.ndarray) -> np.ndarray:
    counts = np.zeros(N_COLORS, dtype=np.float32)
    nobody = np.zeros(mask.shape, dtype=np.uint8)
    count_colors(np.ascontiguousarray(bgr), nobody, mask, np.zeros((0, N_COLORS), dtype=np.float32), counts)
    return counts
