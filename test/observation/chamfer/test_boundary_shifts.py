"""Boundaries to a fraction of a pixel, where it is known exactly where they run."""

import cv2
import numpy as np
import pytest

from tracker_node.observation.chamfer.boundary import boundary_shifts, shift_map

RADIUS, CENTER = 30.4, np.array([59.7, 60.2])


def disc(radius: float, size: int = 120, fine: int = 8) -> np.ndarray:
    """Share of every pixel that a disc covers."""
    grid = (np.arange(size * fine) + 0.5) / fine - 0.5
    inside = np.hypot(grid[None, :] - CENTER[0], grid[:, None] - CENTER[1]) < radius
    return inside.reshape(size, fine, size, fine).mean(axis=(1, 3)).astype(np.float32)


def textured(rng: np.random.Generator) -> np.ndarray:
    return cv2.GaussianBlur(rng.uniform(60, 220, (120, 120, 3)).astype(np.float32), (0, 0), 3.0)


def picture(body: np.ndarray, scene: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    cover = cv2.GaussianBlur(disc(RADIUS), (0, 0), 0.5)[:, :, None]
    mixed = cover * body + (1.0 - cover) * scene
    return np.clip(np.rint(mixed + rng.normal(0.0, 2.0, mixed.shape)), 0, 255).astype(np.uint8)


def points(radius: float, n: int = 180) -> np.ndarray:
    angle = 2.0 * np.pi * np.arange(n) / n
    normal = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.hstack([CENTER + radius * normal, normal]).astype(np.float32)


@pytest.mark.parametrize("off", [-0.8, 0.0, 0.7, 1.2])
@pytest.mark.parametrize("brightness", [1.0, 0.7])
def test_the_boundary_is_found_on_a_textured_scene_and_in_shadow(off, brightness):
    rng = np.random.default_rng(3)
    scene = textured(rng)
    image = picture(np.array([40.0, 30.0, 200.0]), brightness * scene, rng)
    shifts, weights = boundary_shifts(image, scene, np.ones((120, 120), np.uint8), points(RADIUS + off))
    assert weights.mean() > 0.95
    seen = shifts[weights > 0]
    assert seen.mean() == pytest.approx(-off, abs=0.1)
    assert seen.std() < 0.25


def test_without_an_empty_scene_the_surroundings_stand_in():
    rng = np.random.default_rng(4)
    scene = np.full((120, 120, 3), (180.0, 150.0, 120.0), np.float32)
    image = picture(np.array([40.0, 60.0, 90.0]), scene, rng)
    shifts, weights = boundary_shifts(image, None, None, points(RADIUS + 0.6))
    assert weights.all() and shifts.mean() == pytest.approx(-0.6, abs=0.1)
    unknown = np.zeros((120, 120), np.uint8)
    other, _ = boundary_shifts(image, np.zeros((120, 120, 3), np.float32), unknown, points(RADIUS + 0.6))
    np.testing.assert_array_equal(shifts, other)


def test_nothing_is_moved_where_body_and_scene_look_alike_or_at_the_border():
    rng = np.random.default_rng(5)
    scene = np.full((120, 120, 3), 120.0, np.float32)
    image = picture(np.array([126.0, 120.0, 118.0]), scene, rng)
    shifts, weights = boundary_shifts(image, scene, np.ones((120, 120), np.uint8), points(RADIUS))
    assert not shifts.any() and not weights.any()
    corner = np.array([[2.0, 60.0, 1.0, 0.0], [118.5, 60.0, 1.0, 0.0], [60.0, 0.0, 0.0, -1.0]], np.float32)
    assert not boundary_shifts(image, scene, np.ones((120, 120), np.uint8), corner)[1].any()


def test_the_map_carries_shifts_to_their_surroundings_only():
    where = points(RADIUS)
    spread = shift_map(where, np.full(len(where), 0.5, np.float32), np.ones(len(where), np.float32), (120, 120))
    v, u = np.indices((120, 120))
    away = np.abs(np.hypot(u - CENTER[0], v - CENTER[1]) - RADIUS)
    np.testing.assert_allclose(spread[away < 3.0], 0.5, atol=1e-6)
    assert not spread[away > 7.5].any()
    none = shift_map(where, np.full(len(where), 0.5, np.float32), np.zeros(len(where), np.float32), (120, 120))
    assert not none.any()
