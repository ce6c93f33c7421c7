"""Many poses of a body against maps of evidence: the kernels.

A map says of every pixel how much speaks for a part of the body there. The score of a pose is the sum of the maps over the pixels
that the posed parts cover: what is left out of the body is missing in it, what is covered beside it counts against it.

Where some parts stay as they are (the rest of the body of one limb), they are drawn once. Where the rest is before a moved part,
that changes nothing; where it is behind, what it would have gained there is lost.
"""

from __future__ import annotations

import numpy as np

from ...camera.model import NEAR
from ...compiled.kernels import compiled
from ...model.kinematic_chain import forward_kinematics
from ...render.raycast.coefficients import (
    INVISIBLE,
    N_COEFFICIENTS,
    farthest_depth,
    normalized_box,
    pixel_box,
    shape_coefficients,
)
from ...render.raycast.kernels import draw_shape
from ...render.shape_arrays import CONE
from ..color.drawing import (
    BEHIND,
    FAST,
    HEIGHT,
    LABEL_BITS,
    LANES,
    NOT_SMOOTH,
    WIDTH,
    box_of_all,
    draw_smooth,
    find_spans,
    prepare_camera,
)

_ZERO, _ONE = np.float32(0.0), np.float32(1.0)


@compiled
def _cone_box(dims, T, box):
    """Normalized coordinates (x0, y0, x1, y1) around the spheres about a cone's ends; False when these are not in front."""
    box[0], box[1], box[2], box[3] = 1e30, 1e30, -1e30, -1e30
    for end in range(2):
        z = dims[3 + end]
        radius = max(dims[0], dims[1]) * (1.0 + dims[2] * z)
        depth = T[2, 2] * z + T[2, 3]
        if depth < radius + NEAR:
            return False
        # sine of half the sphere's angle over its cosine, and what an oblique view adds
        reach = radius / np.sqrt(depth * depth - radius * radius)
        for i in range(2):
            middle = (T[i, 2] * z + T[i, 3]) / depth
            reach_i = reach * (1.0 + middle * middle)
            box[i], box[2 + i] = min(box[i], middle - reach_i), max(box[2 + i], middle + reach_i)
    return True


@compiled
def _draw_any(kinds, dims, T_cam_world, Ts_world_shape, params, limits, xs, ys, size, coefficients, buffer, out):
    """Draw all shapes into ``buffer`` (h, w rounded up to sixteen), before what is farther; ``out`` (4,): what they may cover."""
    T, box, pixels, whole = np.empty((4, 4)), np.empty(4), np.empty(4, dtype=np.int64), np.zeros(4, dtype=np.int64)
    whole[2], whole[3] = size[0], size[1]
    corner = np.int64(0)  # as 0, its value would be part of a type
    out[0], out[1], out[2], out[3] = size[0], size[1], 0, 0
    for s in range(kinds.shape[0]):
        for i in range(4):
            for j in range(4):
                value = 0.0
                for m in range(4):
                    value += T_cam_world[i, m] * Ts_world_shape[s, m, j]
                T[i, j] = value
        if farthest_depth(kinds[s], dims[s], T) < NEAR:
            continue
        bounds = shape_coefficients(kinds[s], dims[s], T, coefficients)
        if bounds == INVISIBLE:
            continue
        inside = _cone_box(dims[s], T, box) if kinds[s] == CONE else normalized_box(kinds[s], dims[s], T, box)
        if inside:
            pixel_box(params, box, limits, whole, pixels)
        else:
            for i in range(4):
                pixels[i] = whole[i]
        if pixels[2] <= pixels[0] or pixels[3] <= pixels[1]:
            continue
        draw_shape(kinds[s], bounds, coefficients, s + 1, xs, ys, pixels, corner, corner, buffer)
        out[0], out[1] = min(out[0], pixels[0] // LANES * LANES), min(out[1], pixels[1])
        out[2], out[3] = max(out[2], pixels[2]), max(out[3], pixels[3])


@compiled(fastmath=FAST)
def _draw(shapes, smooth, Ts_world_shape, camera, view, rays, tables, work, buffer, stride, region):
    """Draw shapes into the flat ``buffer`` (h * ``stride``), labeled from 1 on, before what is farther.

    ``region`` (4,) gets what they may cover. Returns whether that has been done with the spans of all of them in ``work``: by
    vector instructions, where the closed form of smooth shapes holds.
    """
    kinds, dims, colors, used = shapes
    params, limits, T_cam_world = camera
    coefficients, surfaces, boxes, spans = work
    status = NOT_SMOOTH
    if smooth:
        whole = np.zeros(4, dtype=np.int64)
        whole[2], whole[3] = view[WIDTH], view[HEIGHT]
        status = prepare_camera(
            kinds, dims, colors, T_cam_world, Ts_world_shape, params, limits, view, whole, used, coefficients, surfaces, boxes
        )
    if status == NOT_SMOOTH:
        xs, ys = tables
        size = (view[WIDTH], view[HEIGHT])
        square = buffer[: view[HEIGHT] * stride].reshape(view[HEIGHT], stride)
        _draw_any(
            kinds, dims, T_cam_world, Ts_world_shape, params, limits, xs, ys, size, np.empty(N_COEFFICIENTS, np.float32), square,
            region,
        )  # fmt: skip
        return False
    region[0], region[1], region[2], region[3] = 0, 0, 0, 0
    if status == BEHIND:
        return True
    u0, v0, u1, v1 = box_of_all(boxes)
    if u1 <= u0:
        return True
    region[0], region[1], region[2], region[3] = u0, v0, u1, v1
    for s in range(kinds.shape[0]):
        if boxes[s, 2] > boxes[s, 0] and boxes[s, 3] > boxes[s, 1]:
            find_spans(coefficients[s], view, rays, boxes[s], spans[s])
            draw_smooth(coefficients[s], s + 1, view, rays, boxes[s], spans[s], (np.int64(0), np.int64(0)), stride, buffer)
    return True


@compiled(fastmath=True)
def _add_spans(label, box, spans, stride, buffer, values, gains, total):
    """Add what one shape's pixels gain by its map ``values`` (h, w) over ``gains`` (h, w), and their number, to ``total``."""
    tag, low_bits = np.int32(label), np.int32(LABEL_BITS)
    gain, pixels = 0.0, 0.0
    for v in range(box[1], box[3]):
        row = v * stride
        row_gain, kept = _ZERO, _ZERO
        for u in range(spans[v, 0], spans[v, 1]):
            own = _ONE if (buffer[np.uint64(row + u)] & low_bits) == tag else _ZERO
            row_gain += own * (values[v, np.uint64(u)] - gains[v, np.uint64(u)])
            kept += own
        gain += float(row_gain)
        pixels += float(kept)
    total[0] += gain
    total[1] += pixels


@compiled
def draw_rest(shapes, smooth, Ts_world_shape, camera, view, rays, tables, maps, map_of_shape, work, stride, buffer, gains):
    """Draw the parts that stay, and what they gain by pixel.

    Parameters
    ----------
    shapes, smooth : see `score_poses`.
    Ts_world_shape : (n, 4, 4).
    camera, view, rays, tables, maps, map_of_shape, work, stride : see `score_poses`.
    buffer : (h * ``stride``,) int32, all zero; their depths are written, without labels: parts that move
        lie before them where both are as near, as they do in a body whose limbs' ends come last.
    gains : (h, w) float32, overwritten: the value of the part's map where it shows, else 0.
    """
    region = np.zeros(4, dtype=np.int64)
    _draw(shapes, smooth, Ts_world_shape, camera, view, rays, tables, work, buffer, stride, region)
    gains[:] = np.float32(0.0)
    for v in range(region[1], region[3]):
        for u in range(region[0], min(region[2], view[WIDTH])):
            at = v * stride + u
            label = buffer[at] & LABEL_BITS
            if label > 0:
                gains[v, u] = maps[map_of_shape[label - 1], v, u]
                buffer[at] &= ~LABEL_BITS


@compiled
def score_poses(
    shapes, smooth, Ts_world_shape, camera, view, rays, tables, maps, map_of_shape, work, stride, rest, gains, buffer, totals
):  # fmt: skip
    """Add what posed parts gain, and the pixels in which they show, in one camera.

    Parameters
    ----------
    shapes : kinds (n,), dims (n, 5), colors (n, 3) for kernels that shade (not used here), used (n,), of the parts.
    smooth : whether all of them are ellipsoids or cones.
    Ts_world_shape : (n_poses, n, 4, 4).
    camera : params, limits, T_cam_world.
    view, rays : row and rays of `ColorViews`.
    tables : xs, ys of `RayTable`.
    maps : (n_maps, h, w) float32.
    map_of_shape : (n,) which of them a part reads.
    work : coefficients, surfaces, boxes, spans.
    stride : of the rows of ``buffer``, at least sixteen more than the image has columns.
    rest, gains : of `draw_rest`; zeros where nothing stays.
    buffer : a copy of ``rest``, and left so.
    totals : (n_poses, 2) gain and pixels, added to.
    """
    boxes, spans = work[2], work[3]
    region = np.zeros(4, dtype=np.int64)
    for n in range(Ts_world_shape.shape[0]):
        if _draw(shapes, smooth, Ts_world_shape[n], camera, view, rays, tables, work, buffer, stride, region):
            if region[2] <= region[0]:
                continue
            for s in range(shapes[0].shape[0]):
                if boxes[s, 2] > boxes[s, 0] and boxes[s, 3] > boxes[s, 1]:
                    _add_spans(s + 1, boxes[s], spans[s], stride, buffer, maps[map_of_shape[s]], gains, totals[n])
        else:
            gain, seen = 0.0, 0
            for v in range(region[1], region[3]):
                for u in range(region[0], min(region[2], view[WIDTH])):
                    label = buffer[v * stride + u] & LABEL_BITS
                    if label > 0:
                        gain += maps[map_of_shape[label - 1], v, u] - gains[v, u]
                        seen += 1
            totals[n, 0] += gain
            totals[n, 1] += seen
        first, last = region[0] // LANES * LANES, min(region[2] + LANES, stride)
        for v in range(region[1], region[3]):
            for at in range(v * stride + first, v * stride + last):
                buffer[at] = rest[at]


@compiled
def place_shapes(chain, links, Ts_link_shape, roots, joints, Ts_world_shape):
    """Poses of all shapes in many states.

    Parameters
    ----------
    chain : what `forward_kinematics` takes of a kinematic chain.
    links, Ts_link_shape : (n_shapes,) and (n_shapes, 4, 4).
    roots, joints : (n, 4, 4) world_T_root, and (n, n_axes).
    Ts_world_shape : (n, n_shapes, 4, 4), overwritten.
    """
    parents, offsets, axis_start, axis_count, directions = chain
    Ts_world_link, twists = np.empty((parents.shape[0], 4, 4)), np.empty((6 + joints.shape[1], 6))
    for n in range(roots.shape[0]):
        forward_kinematics(parents, offsets, axis_start, axis_count, directions, roots[n], joints[n], Ts_world_link, twists)
        for s in range(links.shape[0]):
            for i in range(4):
                for j in range(4):
                    value = 0.0
                    for m in range(4):
                        value += Ts_world_link[links[s], i, m] * Ts_link_shape[s, m, j]
                    Ts_world_shape[n, s, i, j] = value
