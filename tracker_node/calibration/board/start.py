"""Where cameras and boards are, well enough to begin a bundle adjustment: from poses of the board in single images."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import breadth_first_order, connected_components

from ...camera.model import CameraModel
from ...geometry import se3, so3
from .adjustment import BoardState
from .board import Board, BoardView
from .views import BoardTimeStep, spanning_tree

_FOCAL_STEPS = np.geomspace(0.25, 4.0, 33)  # tried focal lengths, in image widths
_TRIED_VIEWS = 20  # that focal lengths are tried on, spread over all
_LARGE_PX = 1e6  # error of a pose that does not explain the view at all


def initial_lens(
    board: Board, views: Sequence[BoardView], image_size: tuple[int, int], distortion_model: str
) -> CameraModel:
    """A lens without distortion whose focal length explains the views best: the start of a calibration.

    Parameters
    ----------
    board : the board.
    views : of one camera.
    image_size : (width, height).
    distortion_model : of the lens; its coefficients are zero.

    Returns
    -------
    The lens, principal point in the middle of the image.
    """
    width, height = image_size
    n = {"none": 0, "plumb_bob": 5, "rational_polynomial": 8, "equidistant": 4}[distortion_model]
    some = [views[i] for i in np.unique(np.linspace(0, len(views) - 1, min(_TRIED_VIEWS, len(views))).astype(int))]

    def lens(focal: float) -> CameraModel:
        K = np.array([[focal, 0.0, (width - 1) / 2.0], [0.0, focal, (height - 1) / 2.0], [0.0, 0.0, 1.0]])
        return CameraModel(width, height, K, distortion_model, np.zeros(n))

    def error(model: CameraModel) -> float:
        return float(np.mean([min(board_poses(board, model, view)[1]) ** 2 for view in some]))

    return min((lens(fraction * max(width, height)) for fraction in _FOCAL_STEPS), key=error)


def board_poses(board: Board, lens: CameraModel, view: BoardView) -> tuple[list[np.ndarray], list[float]]:
    """Both poses that a flat board may have in one view.

    (Collins & Bartoli, "Infinitesimal plane-based pose estimation", 2014, as OpenCV has it.)

    Parameters
    ----------
    board : the board.
    lens : of the camera.
    view : its corners in the image.

    Returns
    -------
    Poses T_cam_board (4, 4), the better one first.
    Their rms errors, pixels; one large error where there is no pose.
    """
    rays, ok = lens.rays(view.pixels)
    ok &= rays[:, 2] > 0.05
    corners = board.corners[view.ids]
    if ok.sum() < 4:
        return [], [_LARGE_PX]
    normalized = rays[ok, :2] / rays[ok, 2:]
    found, turns, places, _ = cv2.solvePnPGeneric(corners[ok], normalized, np.eye(3), None, flags=cv2.SOLVEPNP_IPPE)
    poses, errors = [], []
    for turn, place in zip(turns, places, strict=True) if found else ():
        T = se3.from_rotation_translation(so3.exp(turn.ravel()), place.ravel())
        pixels, valid = lens.project(se3.apply(T, corners))
        if np.isfinite(T).all() and valid.all():
            poses.append(T)
            errors.append(float(np.sqrt(((pixels - view.pixels) ** 2).sum(axis=1).mean())))
    order = np.argsort(errors)
    return [poses[i] for i in order], [errors[i] for i in order] or [_LARGE_PX]


def common_time_steps(names: Sequence[str], time_steps: Sequence[BoardTimeStep]) -> np.ndarray:
    """Number of time steps in which two cameras both see the board.

    Parameters
    ----------
    names : of the c cameras.
    time_steps : with views by camera name.

    Returns
    -------
    (c, c) symmetric; each camera's own number on the diagonal.
    """
    seen = np.array([[name in time_step.views for name in names] for time_step in time_steps], dtype=int).reshape(-1, len(names))
    return seen.T @ seen


def groups(names: Sequence[str], common: np.ndarray, least: int = 1) -> list[list[str]]:
    """Cameras linked by boards that two of them saw.

    Parameters
    ----------
    names : of the c cameras.
    common : (c, c) time steps that two share.
    least : time steps that link two cameras.

    Returns
    -------
    Names of the cameras of each group, the largest group first.
    """
    linked = csr_matrix(np.triu(common, 1) >= least)
    n, label = connected_components(linked, directed=False)
    found = [[name for name, group in zip(names, label, strict=True) if group == k] for k in range(n)]
    return sorted(found, key=len, reverse=True)


def initial_state(
    board: Board, names: Sequence[str], lenses: Mapping[str, CameraModel], time_steps: Sequence[BoardTimeStep]
) -> BoardState:
    """Places of all cameras along the tree of the pairs that share most time steps, and of all boards.

    Parameters
    ----------
    board : the board.
    names : of the cameras; the first one is the origin.
    lenses : by camera.
    time_steps : with views by camera name.

    Returns
    -------
    The state that a bundle adjustment begins with.

    Raises
    ------
    ValueError : cameras that do not hang together (see `groups`).
    """
    poses = [
        {name: board_poses(board, lenses[name], view)[0] for name, view in time_step.views.items()} for time_step in time_steps
    ]
    common = common_time_steps(names, time_steps)
    tree = spanning_tree(common)
    order, before = breadth_first_order(tree + tree.T, 0, directed=False)
    if len(order) < len(names):
        raise ValueError(f"expected cameras that hang together, got {groups(names, common)}")
    Ts_cam_world = np.tile(np.eye(4), (len(names), 1, 1))
    for i in order[1:]:
        T = _relative(board, lenses, time_steps, poses, names[i], names[before[i]])
        Ts_cam_world[i] = T @ Ts_cam_world[before[i]]
    ordered = tuple(lenses[name] for name in names)
    boards = place_boards(board, names, BoardState.at(ordered, Ts_cam_world, np.zeros((0, 4, 4))), time_steps)
    return BoardState.at(ordered, Ts_cam_world, boards)


def place_boards(board: Board, names: Sequence[str], state: BoardState, time_steps: Sequence[BoardTimeStep]) -> np.ndarray:
    """Pose of the board at every time step: of the poses that single views allow, the one with the least error in all of them.

    Parameters
    ----------
    board : the board.
    names : of the cameras, in the order of the state.
    state : lenses and places of the cameras.
    time_steps : with views by camera name.

    Returns
    -------
    (n, 4, 4) T_world_board.
    """
    result = np.tile(np.eye(4), (len(time_steps), 1, 1))
    index = {name: i for i, name in enumerate(names)}
    for k, time_step in enumerate(time_steps):
        best = np.inf
        for name, view in time_step.views.items():
            i = index[name]
            for T in board_poses(board, state.lenses[i], view)[0]:
                T_world_board = se3.inverse(state.Ts_cam_world[i]) @ T
                error = sum(
                    _error(board, state.lenses[index[n]], state.Ts_cam_world[index[n]] @ T_world_board, v)
                    for n, v in time_step.views.items()
                )
                if error < best:
                    best, result[k] = error, T_world_board
    return result


def _relative(board: Board, lenses, time_steps, poses, a: str, b: str) -> np.ndarray:
    """T_a_b: of what single time steps say, the one that explains b's boards in a's images best at most time steps."""
    shared = [(i.views[a], p[a], p[b]) for i, p in zip(time_steps, poses, strict=True) if a in i.views and b in i.views]
    shared = [entry for entry in shared if entry[1] and entry[2]]
    candidates = [T_a @ se3.inverse(T_b) for _, in_a, in_b in shared for T_a in in_a for T_b in in_b]
    if not candidates:
        return np.eye(4)

    def misfit(T: np.ndarray) -> float:
        return float(np.median([min(_error(board, lenses[a], T @ T_b, view) for T_b in in_b) for view, _, in_b in shared]))

    if len(candidates) > 60:
        candidates = candidates[:: -(-len(candidates) // 60)]
    return min(candidates, key=misfit)


def _error(board: Board, lens: CameraModel, T_cam_board: np.ndarray, view: BoardView) -> float:
    """Root mean square distance in the image; bounded, large where a corner cannot be seen."""
    pixels, valid = lens.project(se3.apply(T_cam_board, board.corners[view.ids]))
    if not valid.all():
        return _LARGE_PX
    return float(np.sqrt(((pixels - view.pixels) ** 2).sum(axis=1).mean()))
