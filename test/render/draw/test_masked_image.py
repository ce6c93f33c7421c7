"""The target through the mask: the image where the body is, black where it is not."""

import numpy as np
import pytest

from helpers.cameras.render_scenes import LENSES, look_at, single_shape
from tracker_node.model.shapes.primitives import Ellipsoid
from tracker_node.render.draw.masked_image import target_through_mask

CAMERA = look_at((0.0, -1.5, 0.3), (0.0, 0.0, 0.0), LENSES["radial"])


def test_the_image_is_kept_within_the_outline_and_black_outside():
    """The outline of a sphere in front of a pinhole, from its tangent cone."""
    rng = np.random.default_rng(1)
    image = rng.integers(1, 255, (CAMERA.model.height, CAMERA.model.width, 3)).astype(np.uint8)
    configuration = single_shape(Ellipsoid((0.2, 0.2, 0.2)))
    seen = target_through_mask(image, configuration, CAMERA)
    center = CAMERA.T_cam_world[:3] @ np.append(configuration.Ts_world_shape[0][:3, 3], 1.0)
    v, u = np.mgrid[: CAMERA.model.height, : CAMERA.model.width]
    rays, _ = CAMERA.model.rays(np.stack([u, v], axis=-1).astype(float))
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    inside = rays @ center > np.sqrt(center @ center - 0.2**2)
    assert 100 < inside.sum() < inside.size // 2
    np.testing.assert_array_equal(seen, np.where(inside[:, :, None], image, 0))


def test_another_image_size_is_refused():
    configuration = single_shape(Ellipsoid((0.2, 0.2, 0.2)))
    with pytest.raises(ValueError, match=f"camera '{CAMERA.name}', got uint8 \\(4, 4, 3\\)"):
        target_through_mask(np.zeros((4, 4, 3), np.uint8), configuration, CAMERA)
