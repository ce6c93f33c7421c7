"""The reference of a recorded ChArUco plate: markers found in images, corners triangulated, a rigid fit. No tracker sees it."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from tracker_node.camera.rig import CameraRig
from tracker_node.geometry import se3

COLUMNS, ROWS, SQUARE_M, MARKER_SHARE, DICTIONARY = 4, 5, 0.054, 0.75, "DICT_4X4_1000"
LEAST_CORNERS = 4


class CharucoReference:
    """Poses of a plate, whose frame lies in the middle of its board with x along the columns, y up the rows, z out of it."""

    def __init__(self, rig: CameraRig):
        markers = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, DICTIONARY))
        board = cv2.aruco.CharucoBoard((COLUMNS, ROWS), SQUARE_M, SQUARE_M * MARKER_SHARE, markers)
        self._rig, self._detector = rig, cv2.aruco.CharucoDetector(board)
        # OpenCV's board has its origin in a corner, y down and z away from who looks at it
        middle = np.array([COLUMNS * SQUARE_M / 2.0, ROWS * SQUARE_M / 2.0, 0.0])
        self._corners = (board.getChessboardCorners() - middle) * [1.0, -1.0, -1.0]

    def pose(self, images: Sequence[np.ndarray]) -> tuple[np.ndarray, float, float] | None:
        """T_world_plate (4, 4), rms of the rigid fit (m) and of the corners' reprojection (px); None with too few corners."""
        seen: dict[int, list[tuple[int, np.ndarray]]] = {}
        for i, image in enumerate(images):
            pixels, ids, _, _ = self._detector.detectBoard(255 - image)  # black and white are exchanged on the plate
            for corner, pixel in zip(
                [] if ids is None else ids.ravel(), [] if ids is None else pixels.reshape(-1, 2), strict=True
            ):
                seen.setdefault(int(corner), []).append((i, pixel))
        found = {corner: self._triangulated(views) for corner, views in seen.items() if len(views) > 1}
        if len(found) < LEAST_CORNERS:
            return None
        on_plate, in_world = self._corners[list(found)], np.array(list(found.values()))
        T = se3.rigid_fit(on_plate, in_world)
        fit = float(np.sqrt(np.mean(np.sum((se3.apply(T, on_plate) - in_world) ** 2, axis=1))))
        return T, fit, self._reprojection(T, seen)

    def _triangulated(self, views: list[tuple[int, np.ndarray]]) -> np.ndarray:
        """The point nearest to all rays."""
        A, b = np.zeros((3, 3)), np.zeros(3)
        for i, pixel in views:
            camera = self._rig.cameras[i]
            ray = camera.T_world_cam[:3, :3] @ camera.model.rays(pixel[None].astype(float))[0][0]
            across = np.eye(3) - np.outer(ray, ray)
            A, b = A + across, b + across @ camera.center
        return np.linalg.solve(A, b)

    def _reprojection(self, T: np.ndarray, seen: dict[int, list[tuple[int, np.ndarray]]]) -> float:
        squares = []
        for corner, views in seen.items():
            for i, pixel in views:
                at, _ = self._rig.cameras[i].project(se3.apply(T, self._corners[corner : corner + 1]))
                squares.append(float(np.sum((at[0] - pixel) ** 2)))
        return float(np.sqrt(np.mean(squares)))
