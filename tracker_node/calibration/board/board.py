"""Calibration boards, chessboards and ChArUco boards, and their corners in images (found by OpenCV)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np

KINDS = ("chessboard", "charuco")
_SEARCH_WIDTH = 960  # an image is searched for a chessboard at this width at most; corners are refined in the whole image
_LEAST_CORNERS = 6  # of a ChArUco board that is partly in view
_EDGE_PX = 10  # edges are measured this far around a corner


@dataclass(frozen=True)
class Board:
    """A flat board.

    Its frame: origin in the middle, x along the columns, y up the rows, z out of the printed side; meters.

    Parameters
    ----------
    kind : one of `KINDS`.
    columns, rows : a chessboard's *inner corners* (as OpenCV and ROS count), a ChArUco board's *squares* (as OpenCV counts).
    square_m : edge of a square.
    marker_ratio, dictionary : of a ChArUco board: marker to square, and the name of an OpenCV dictionary.
    inverted : black and white are exchanged.
    legacy : a ChArUco board of OpenCV before 4.6 with an even number of rows (a marker in the first corner).
    """

    kind: str
    columns: int
    rows: int
    square_m: float
    marker_ratio: float = 0.75
    dictionary: str = "DICT_4X4_1000"
    inverted: bool = False
    legacy: bool = False

    def __post_init__(self):
        if self.kind not in KINDS:
            raise ValueError(f"expected a kind of board, one of {KINDS}, got {self.kind!r}")
        if min(self.columns, self.rows) < 3 or not self.square_m > 0.0:
            raise ValueError(f"expected at least 3 columns and rows and a positive square, got {self}")

    @property
    def grid(self) -> tuple[int, int]:
        """(columns, rows) of corners."""
        less = 1 if self.kind == "charuco" else 0
        return self.columns - less, self.rows - less

    @cached_property
    def corners(self) -> np.ndarray:
        """(n, 3) in the board's frame, row by row from the top left one, as OpenCV numbers them."""
        columns, rows = self.grid
        x, y = np.meshgrid(np.arange(columns) - 0.5 * (columns - 1), 0.5 * (rows - 1) - np.arange(rows))
        return self.square_m * np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])

    @property
    def n_markers(self) -> int:
        """Markers on a ChArUco board, one on every second square."""
        return self.columns * self.rows // 2 if self.kind == "charuco" else 0

    @property
    def turns_unseen(self) -> bool:
        """True for a chessboard that looks the same upside down: cameras would not agree on which corner is which."""
        return self.kind == "chessboard" and (self.columns + self.rows) % 2 == 0

    def __str__(self) -> str:
        return f"{self.kind} {self.columns}x{self.rows}, squares of {1e3 * self.square_m:g} mm"


def dictionaries() -> list[str]:
    """Names of the dictionaries of markers that OpenCV has."""
    return [name for name in dir(cv2.aruco) if name.startswith("DICT_")]


def n_markers(dictionary: str) -> int:
    """Number of the markers of a dictionary."""
    return len(_markers(dictionary).bytesList)


def _markers(dictionary: str) -> cv2.aruco.Dictionary:
    return cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, dictionary))


@dataclass(frozen=True, eq=False)
class BoardView:
    """The board in one image.

    Attributes
    ----------
    stamp_ns : of the image.
    ids : (n,) rows of `Board.corners`.
    pixels : (n, 2).
    edge_px : over how many pixels an edge at the corners goes from dark to bright (median): about 2 in a sharp image.
    image : number of the image in its source.
    """

    stamp_ns: int
    ids: np.ndarray
    pixels: np.ndarray
    edge_px: float = 0.0
    image: int = 0

    @property
    def spread_px(self) -> float:
        """Root mean square distance of the corners from their middle."""
        return float(np.sqrt(((self.pixels - self.pixels.mean(axis=0)) ** 2).sum(axis=1).mean()))


class BoardDetector:
    """Finds a board. Make one for each thread: OpenCV's detectors are not shared."""

    def __init__(self, board: Board):
        self.board = board
        if board.kind == "charuco":
            size = board.square_m, board.square_m * board.marker_ratio
            charuco = cv2.aruco.CharucoBoard((board.columns, board.rows), *size, _markers(board.dictionary))
            charuco.setLegacyPattern(board.legacy)
            self._charuco = cv2.aruco.CharucoDetector(charuco)

    def find(self, bgr: np.ndarray, stamp_ns: int = 0, image: int = 0) -> BoardView | None:
        """Detect the board in an image.

        Parameters
        ----------
        bgr : (h, w, 3) or gray (h, w), uint8.
        stamp_ns, image : stamp and number of the image, for the view.

        Returns
        -------
        The view; None where the board is not in the image, or too few of its corners span a plane.
        """
        gray = bgr if bgr.ndim == 2 else cv2.cvtColor(bgr, cv2.COLOR_BGR2GRAY)
        gray = 255 - gray if self.board.inverted else gray
        ids, pixels = self._charuco_corners(gray) if self.board.kind == "charuco" else self._chessboard_corners(gray)
        corners = self.board.corners[ids]
        if len(ids) < _LEAST_CORNERS or not _spans_plane(corners) or _is_reflected(corners, pixels):
            return None
        return BoardView(stamp_ns, ids, pixels, _edge_width(gray, corners, pixels), image)

    def sees_back(self, bgr: np.ndarray) -> bool:
        """Whether the board's mirrored back is in an image: a print that shows through, or one on both sides.

        Markers alone tell; a chessboard's back looks like a front whose corners are counted otherwise.
        """
        return self.board.kind == "charuco" and self.find(np.ascontiguousarray(bgr[:, ::-1])) is not None

    def _charuco_corners(self, gray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        pixels, ids, _, _ = self._charuco.detectBoard(gray)
        if ids is None or len(ids) == 0:
            return np.zeros(0, dtype=np.int64), np.zeros((0, 2))
        return ids.ravel().astype(np.int64), pixels.reshape(-1, 2).astype(np.float64)

    def _chessboard_corners(self, gray: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        columns, rows = self.board.grid
        scale = min(1.0, _SEARCH_WIDTH / max(gray.shape))
        small = gray if scale == 1.0 else cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        found, corners = cv2.findChessboardCornersSB(small, (columns, rows), flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
        if not found:
            return np.zeros(0, dtype=np.int64), np.zeros((0, 2))
        corners = (corners.reshape(-1, 2).astype(np.float64) + 0.5) / scale - 0.5
        if scale < 1.0:
            steps = np.linalg.norm(np.diff(corners.reshape(rows, columns, 2), axis=1), axis=2)
            half = max(2, int(0.3 * steps.min()))
            criteria = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)
            near = np.ascontiguousarray(corners, dtype=np.float32).reshape(-1, 1, 2)
            refined = cv2.cornerSubPix(gray, near, (min(half, 11), min(half, 11)), (-1, -1), criteria)
            corners = refined.reshape(-1, 2).astype(np.float64)
        return np.arange(columns * rows), _numbered(gray, corners.reshape(rows, columns, 2)).reshape(-1, 2)


def _numbered(gray: np.ndarray, grid: np.ndarray) -> np.ndarray:
    """Corners (rows, columns, 2) counted as seen from the printed side, and from the end whose first inner square is dark."""
    along, down = grid[0, -1] - grid[0, 0], grid[-1, 0] - grid[0, 0]
    if along[0] * down[1] - along[1] * down[0] < 0.0:
        grid = grid[:, ::-1]
    first, last = (_brightness(gray, corners) for corners in (grid[:2, :2], grid[-2:, -2:]))
    return grid if first <= last else grid[::-1, ::-1]


def _brightness(gray: np.ndarray, square: np.ndarray) -> float:
    """Mean gray level of the inner half of a square with corners (2, 2, 2)."""
    s, t = np.meshgrid(np.linspace(0.25, 0.75, 5), np.linspace(0.25, 0.75, 5))
    weights = np.stack([(1 - s) * (1 - t), s * (1 - t), (1 - s) * t, s * t], axis=-1)
    pixels = np.rint(weights @ square.reshape(4, 2)).astype(int)
    u, v = np.clip(pixels[..., 0], 0, gray.shape[1] - 1), np.clip(pixels[..., 1], 0, gray.shape[0] - 1)
    return float(gray[v, u].mean())


def _spans_plane(points: np.ndarray) -> bool:
    """True when points (n, 3) of a board are not all on one line of it."""
    singular = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return bool(singular[1] > 0.1 * singular[0])


def _is_reflected(points: np.ndarray, pixels: np.ndarray) -> bool:
    """True where corners turn the other way than on the printed side: by the sign of the homography's determinant.

    The board's y points up and the image's down, so that the printed side has a negative one.
    """
    H, _ = cv2.findHomography(points[:, :2], pixels, cv2.LMEDS)
    return H is not None and bool(np.linalg.det(_axes_at(H, points.mean(axis=0))) > 0.0)


def _edge_width(gray: np.ndarray, points: np.ndarray, pixels: np.ndarray) -> float:
    """Pixels over which edges at a board's corners go from dark to bright: contrast over slope, median over the corners.

    Of the two directions of edges the worse, since motion blurs the edges that lie across it only.

    Parameters
    ----------
    gray : (h, w) image.
    points : (n, 3) in the board's frame.
    pixels : (n, 2) where they are seen.
    """
    H, _ = cv2.findHomography(points[:, :2], pixels)
    if H is None:
        return 0.0
    du, dv = cv2.Scharr(gray, cv2.CV_32F, 1, 0) / 32.0, cv2.Scharr(gray, cv2.CV_32F, 0, 1) / 32.0
    widths = [_edge_widths(gray, du, dv, pixel, _axes_at(H, point)) for point, pixel in zip(points, pixels, strict=True)]
    return float(np.median(np.array(widths), axis=0).max())


def _axes_at(H: np.ndarray, point: np.ndarray) -> np.ndarray:
    """(2, 2) px/m: how pixels move as a point of the board moves along x (first column) and y, by its homography."""
    x = H @ [point[0], point[1], 1.0]
    return (H[:2, :2] - np.outer(x[:2] / x[2], H[2, :2])) / x[2]


def _edge_widths(gray: np.ndarray, du: np.ndarray, dv: np.ndarray, pixel: np.ndarray, axes: np.ndarray) -> tuple[float, float]:
    """Widths of the edges along both axes of the board around one corner."""
    u, v = np.rint(pixel).astype(int)
    window = slice(max(v - _EDGE_PX, 0), v + _EDGE_PX + 1), slice(max(u - _EDGE_PX, 0), u + _EDGE_PX + 1)
    low, high = np.percentile(gray[window], (5, 95))
    across_x, across_y = (np.array([-a[1], a[0]]) / np.linalg.norm(a) for a in axes.T)
    slopes = [np.percentile(np.abs(n[0] * du[window] + n[1] * dv[window]), 98) for n in (across_x, across_y)]
    return tuple((high - low) / max(float(slope), 1e-3) for slope in slopes)
