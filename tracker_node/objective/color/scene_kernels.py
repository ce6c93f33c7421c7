"""A body of smooth shapes drawn over the empty scene, and how much better it explains an image than the empty scene alone.

Only labels are drawn (first pass of `drawing`); each part has one color per camera.
"""

from __future__ import annotations

import numba as nb
import numpy as np

from .drawing import (
    ALL_SMOOTH,
    HEIGHT,
    LABEL_BITS,
    LANES,
    PLANES,
    WIDTH,
    box_of_all,
    draw_smooth,
    find_spans,
    pose_shapes,
    prepare_camera,
)

_DARK = np.float32(30.0)  # added to an intensity, so that the hue of dark pixels, which is noise, counts little
_HUE, _ZERO, _ONE = np.float32(255.0), np.float32(0.0), np.float32(1.0)


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def color_cost(r, g, b, red, green, blue, caps):
    """Robust cost, 0..2, of one color against another: half of it by RGB, half by RGB over intensity.

    ``caps`` (2,) are the squared differences that cost one half of the most.
    """
    dr, dg, db = r - red, g - green, b - blue
    raw = dr * dr + dg * dg + db * db
    one, two = _HUE / (r + g + b + _DARK), _HUE / (red + green + blue + _DARK)
    dr, dg, db = r * one - red * two, g * one - green * two, b * one - blue * two
    hue = dr * dr + dg * dg + db * db
    return raw / (raw + caps[0]) + hue / (hue + caps[1])


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def scene_costs(planes, view, plate, caps, costs):
    """Cost (h * w) of every pixel of a camera if the empty scene (h, w, 3) RGB is what it shows."""
    size = view[WIDTH] * view[HEIGHT]
    at = view[PLANES]
    for i in range(size):
        v, u = i // view[WIDTH], i % view[WIDTH]
        costs[i] = color_cost(
            np.float32(planes[at + i]), np.float32(planes[at + size + i]), np.float32(planes[at + 2 * size + i]),
            np.float32(plate[v, u, 0]), np.float32(plate[v, u, 1]), np.float32(plate[v, u, 2]), caps,
        )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _add_shape(label, view, box, spans, u0, v0, stride, buffer, planes, costs, color, caps, total):
    """Add what one shape's pixels cost less than the scene's, and their number; one color, so that many pixels go at a time."""
    width = view[WIDTH]
    size = width * view[HEIGHT]
    red, green, blue, caps_0, caps_1 = color[0], color[1], color[2], caps[0], caps[1]
    of_color = _HUE / (red + green + blue + _DARK)
    hue_r, hue_g, hue_b = red * of_color, green * of_color, blue * of_color
    tag, low_bits = np.int32(label), np.int32(LABEL_BITS)
    gain, pixels = 0.0, 0.0
    for v in range(box[1], box[3]):
        row = (v - v0) * stride - u0
        pixel = v * width
        at = view[PLANES] + pixel
        row_gain, kept = _ZERO, _ZERO
        for u in range(spans[v, 0], spans[v, 1]):
            own = _ONE if (buffer[np.uint64(row + u)] & low_bits) == tag else _ZERO
            r, g = np.float32(planes[np.uint64(at + u)]), np.float32(planes[np.uint64(at + size + u)])
            b = np.float32(planes[np.uint64(at + 2 * size + u)])
            dr, dg, db = r - red, g - green, b - blue
            raw = dr * dr + dg * dg + db * db
            scale = _HUE / (r + g + b + _DARK)
            dr, dg, db = r * scale - hue_r, g * scale - hue_g, b * scale - hue_b
            hue = dr * dr + dg * dg + db * db
            row_gain += own * (costs[np.uint64(pixel + u)] - raw / (raw + caps_0) - hue / (hue + caps_1))
            kept += own
        gain += float(row_gain)
        pixels += float(kept)
    total[0] += gain
    total[1] += pixels


@nb.njit(cache=True, nogil=True, error_model="numpy", fastmath=True)
def _score_camera(shapes, camera, view, rays, planes, costs, colors, caps, work, Ts_world_shape, total):
    """Add to ``total``: by how much the body's pixels cost less than the scene's, and pixels; its third is why there are none."""
    kinds, dims, used, unused_colors = shapes
    params, limits, T_cam_world = camera
    coefficients, surfaces, boxes, spans, buffer = work
    region = np.empty(4, dtype=np.int64)
    region[0], region[1], region[2], region[3] = 0, 0, view[WIDTH], view[HEIGHT]
    total[2] = prepare_camera(
        kinds, dims, unused_colors, T_cam_world, Ts_world_shape, params, limits, view, region, used, coefficients, surfaces, boxes
    )
    if total[2] != ALL_SMOOTH:  # boxes are not valid then
        return
    u0, v0, u1, v1 = box_of_all(boxes)
    if u1 <= u0 or v1 <= v0:
        return
    stride = u1 - u0 + LANES
    buffer[: stride * (v1 - v0) + LANES] = 0
    for s in range(kinds.shape[0]):
        if boxes[s, 2] > boxes[s, 0] and boxes[s, 3] > boxes[s, 1]:
            find_spans(coefficients[s], view, rays, boxes[s], spans[s])
            draw_smooth(coefficients[s], s + 1, view, rays, boxes[s], spans[s], (u0, v0), stride, buffer)
    for s in range(kinds.shape[0]):
        if boxes[s, 2] > boxes[s, 0] and boxes[s, 3] > boxes[s, 1]:
            _add_shape(s + 1, view, boxes[s], spans[s], u0, v0, stride, buffer, planes, costs, colors[s], caps, total)


@nb.njit(cache=True, nogil=True, error_model="numpy")
def score_states(chain, shapes, cameras, images, colors, caps, roots, joints, seen, work, totals):
    """Gains, pixels and the verdict of `prepare_camera` (n_states, n_cameras, 3) of states.

    Parameters
    ----------
    chain : what `forward_kinematics` takes of a kinematic chain.
    shapes : kinds, dims, links (n,), Ts_link_shape (n, 4, 4), used (n,), colors for the kernels that shade (not used here).
    cameras : params, limits, T_cam_world, stacked over the cameras.
    images : views, rays, planes (flat), costs of the empty scene (flat, at a third of where the planes are).
    colors : (n_cameras, n_shapes, 3) float32.
    roots, joints : (n_states, 4, 4), (n_states, n_axes).
    seen : indices of the cameras with an image.
    """
    kinds, dims, links, Ts_link_shape, used, unused_colors = shapes
    params, limits, T_cam_world = cameras
    views, rays, planes, costs = images
    Ts_world_link, Ts_world_shape = np.empty((chain[0].shape[0], 4, 4)), np.empty((kinds.shape[0], 4, 4))
    twists = np.empty((6 + joints.shape[1], 6))
    for n in range(roots.shape[0]):
        pose_shapes(chain, links, Ts_link_shape, roots[n], joints[n], Ts_world_link, twists, Ts_world_shape)
        for index in range(seen.shape[0]):
            c = seen[index]
            _score_camera(
                (kinds, dims, used, unused_colors), (params[c], limits[c], T_cam_world[c]), views[c], rays, planes,
                costs[views[c, PLANES] // 3 :], colors[c], caps, work, Ts_world_shape, totals[n, c],
            )  # fmt: skip


@nb.njit(cache=True, nogil=True, error_model="numpy")
def add_labels(labels, u0, v0, view, planes, costs, colors, caps, total):
    """As `_add_shape` for all shapes, whose labels (h, w) on the region from (u0, v0) somebody else has drawn."""
    size = view[WIDTH] * view[HEIGHT]
    for row in range(labels.shape[0]):
        for column in range(labels.shape[1]):
            label = labels[row, column]
            if label > 0:
                pixel = (v0 + row) * view[WIDTH] + u0 + column
                at = view[PLANES] + pixel
                red, green, blue = colors[label - 1, 0], colors[label - 1, 1], colors[label - 1, 2]
                r, g, b = np.float32(planes[at]), np.float32(planes[at + size]), np.float32(planes[at + 2 * size])
                total[0] += costs[pixel] - color_cost(r, g, b, red, green, blue, caps)
                total[1] += 1.0
