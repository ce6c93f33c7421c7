"""BlazePose (Bazarevsky et al., 2020): a detector of people, and a network that finds 33 points of each.

The weights are files of TensorFlow Lite, run on this machine by `ai_edge_litert`; images never leave it. The detector looks at
the whole image and gives each person's hips, and the radius of a circle around the body; the second network takes a square around
that, and gives points, heat maps and a silhouette. Where somebody knows where the person is, the detector is not asked.

Points and their covariances from the heat maps of a network.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from ...compiled.kernels import compiled
from ...errors import extra_module
from .crop import Crop, mapped
from .people import People, Person, Silhouette

_LEFT_RIGHT = ("shoulder", "elbow", "wrist", "pinky", "index", "thumb", "hip", "knee", "ankle", "heel", "foot_index")
NAMES: tuple[str, ...] = (
    "nose", "left_eye_inner", "left_eye", "left_eye_outer", "right_eye_inner", "right_eye", "right_eye_outer", "left_ear",
    "right_ear", "mouth_left", "mouth_right", *(f"{side}_{name}" for name in _LEFT_RIGHT for side in ("left", "right")),
)  # fmt: skip
N_POINTS = len(NAMES)
_DETECTOR_SIDE, _SIDE, _CELL = 224, 256, 4
_STRIDES = ((8, 2), (16, 2), (32, 6))  # of the detector's cells, and anchors in each
_LEAST_PERSON = 0.3  # probability of a detection; of several people the smaller ones have no more
_LEAST_PRESENCE = 0.5  # of a person in a crop
_SAME_PERSON = 0.3  # overlap of two boxes (intersection over union) of one person
_ROUNDS = 3  # of the detector, each without the people of those before: it hardly sees smaller ones beside a large one
_MARGIN = 1.25  # of the crop around the circle
_LEAST_PEAK = 0.3  # of a heat map that says where its point is; others leave it to the network's first guess
# Errors of the points in cells have the variance `_SPREAD` m S / p^2 where the second moments of a map are S, of mean m, and its
# peak p: one that is twice as wide is four times as wrong. On eight rendered people in clothes 0.09 describes the errors of one
# image (`benchmark/clothed/_fit.py`); the next images err likewise, and joints are nearest where points weigh a third of that
_SPREAD = 0.25


@dataclass(frozen=True, eq=False)
class Found:
    """A person found by the detector: probability, and the crop around."""

    score: float
    crop: Crop


class _Network:
    """A file of TensorFlow Lite in memory."""

    def __init__(self, path: str | Path, threads: int):
        extra_module("ai_edge_litert", "keypoints")
        from ai_edge_litert.interpreter import Interpreter

        self._run = Interpreter(model_path=str(path), num_threads=threads)
        self._run.allocate_tensors()
        self._input = self._run.get_input_details()[0]["index"]
        self._outputs = [each["index"] for each in self._run.get_output_details()]

    def __call__(self, image: np.ndarray) -> list[np.ndarray]:
        """All outputs for one image (side, side, 3) float32, without their first axis."""
        self._run.set_tensor(self._input, image[None])
        self._run.invoke()
        return [self._run.get_tensor(index)[0] for index in self._outputs]


class PersonDetector:
    """Finds the people in a whole image.

    Parameters
    ----------
    path : of the weights, ``pose_detection.tflite``.
    threads : of the network.
    """

    def __init__(self, path: str | Path, threads: int = 1):
        self._network = _Network(path, threads)
        self._anchors = _anchors()

    def find(self, image: np.ndarray) -> list[Found]:
        """The people in an image.

        Parameters
        ----------
        image : (height, width, 3) BGR.

        Returns
        -------
        The likeliest first.
        """
        height, width = image.shape[:2]
        whole = Crop((0.5 * (width - 1), 0.5 * (height - 1)), float(max(height, width)))
        rgb = cv2.cvtColor(whole.cut(image, _DETECTOR_SIDE), cv2.COLOR_BGR2RGB)
        values, logits = self._network(rgb.astype(np.float32) * (2.0 / 255.0) - 1.0)
        scores = 1.0 / (1.0 + np.exp(-np.clip(logits[:, 0], -80.0, 80.0)))
        likely = np.flatnonzero(scores >= _LEAST_PERSON)
        order = likely[np.argsort(-scores[likely], kind="stable")]
        boxes = np.hstack([values[order, :2] + self._anchors[order] - 0.5 * values[order, 2:4], values[order, 2:4]])
        points = values[order, 4:8].reshape(-1, 2, 2) + self._anchors[order, None]
        to_image, found = whole.to_image(_DETECTOR_SIDE), []
        while len(order):
            same = _overlaps(boxes[0], boxes) > _SAME_PERSON
            weights = scores[order[same]]
            center, top = mapped(to_image, np.average(points[same], axis=0, weights=weights) - 0.5)
            found.append(Found(float(scores[order[0]]), _crop_around(center, top)))
            order, boxes, points = order[~same], boxes[~same], points[~same]
        return found


class PointNetwork:
    """Finds the points of a person in a crop.

    Parameters
    ----------
    path : of the weights, ``pose_landmark_full.tflite`` or another size.
    threads : of the network.
    """

    def __init__(self, path: str | Path, threads: int = 1):
        self._network = _Network(path, threads)
        # Compiled before somebody waits for the first image's points
        read_heat_maps(np.zeros((1, 1, 1), np.float32), np.zeros((1, 2)), np.empty((1, 2)), np.empty((1, 2, 2)), np.empty(1))

    def read(self, image: np.ndarray, crop: Crop) -> Person | None:
        """The person in a crop.

        Parameters
        ----------
        image : (height, width, 3) BGR.
        crop : around the person.

        Returns
        -------
        None where there is nobody.
        """
        rgb = cv2.cvtColor(crop.cut(image, _SIDE), cv2.COLOR_BGR2RGB)
        values, presences, mask, maps, guessed = self._network(rgb.astype(np.float32) * (1.0 / 255.0))
        presence = float(presences[0])
        if not presence >= _LEAST_PRESENCE:
            return None
        values = values.reshape(-1, 5)
        points = values[:, :2].astype(np.float64) - 0.5
        n = len(points)
        cells, moments, peaks = np.empty((n, 2)), np.empty((n, 2, 2)), np.empty(n)
        read_heat_maps(maps, (points + 0.5) / _CELL, cells, moments, peaks)  # a cell is where its first pixel begins
        refined = np.where(peaks[:, None] >= _LEAST_PEAK, cells * _CELL - 0.5, points)
        to_image = crop.to_image(_SIDE)
        A = to_image[:, :2]
        pixels = mapped(to_image, refined)
        spreads = _SPREAD * 0.5 * np.trace(moments, axis1=1, axis2=2) / np.maximum(peaks, _LEAST_PEAK) ** 2
        covariances = _CELL**2 * (A @ (spreads[:, None, None] * moments) @ A.T)
        scores = 1.0 / (1.0 + np.exp(-values[:, 3].astype(np.float64)))
        silhouette = _silhouette(mask[:, :, 0], crop, image.shape[:2])
        seen = slice(N_POINTS)
        skeleton = guessed.reshape(-1, 3).astype(np.float64)[seen]
        skeleton[:, :2] = skeleton[:, :2] @ A.T / crop.size * _SIDE  # turned as the crop is
        return Person(NAMES, pixels[seen], covariances[seen], scores[seen], presence, _box(pixels[seen]), silhouette, skeleton)


@dataclass(frozen=True)
class BlazePoseFiles:
    """Paths of the weights: of the detector of people, and of the network that finds their points."""

    detector: Path
    points: Path


class BlazePose:
    """Finds people and their points in images.

    Parameters
    ----------
    files : the weights.
    threads : of the networks.
    most : people that points are found of, at most.
    """

    names = NAMES

    def __init__(self, files: BlazePoseFiles, threads: int = 1, most: int = 4):
        self._detector, self._points = PersonDetector(files.detector, threads), PointNetwork(files.points, threads)
        self._most = most

    def detect(self, image: np.ndarray, expected: Sequence[Crop] = ()) -> People:
        """The people in an image.

        Parameters
        ----------
        image : (height, width, 3) BGR.
        expected : around people whose places are known; the detector is then not asked.

        Returns
        -------
        Those with a person in it.
        """
        if expected:
            return tuple(person for crop in expected if (person := self._points.read(image, crop)) is not None)
        people: list[Person] = []
        left = image
        for _ in range(_ROUNDS):
            crops = [found.crop for found in self._detector.find(left)[: self._most - len(people)]]
            found = [person for crop in crops if (person := self._points.read(left, crop)) is not None]
            people += found
            if not found or len(people) >= self._most:
                break
            left = _without(left, found)
        return tuple(people)


def _anchors() -> np.ndarray:
    """(2254, 2) centers of the detector's cells, pixels of its input from the corner."""
    rows: list[Any] = []
    for stride, count in _STRIDES:
        n = _DETECTOR_SIDE // stride
        y, x = np.mgrid[:n, :n]
        rows.append(np.repeat(np.column_stack([x.ravel(), y.ravel()]) * stride + 0.5 * stride, count, axis=0))
    return np.vstack(rows)


def _overlaps(box: np.ndarray, boxes: np.ndarray) -> np.ndarray:
    """Intersection over union of one box with others (n, 4): left, top, width, height."""
    low = np.maximum(box[:2], boxes[:, :2])
    high = np.minimum(box[:2] + box[2:], boxes[:, :2] + boxes[:, 2:])
    common = np.prod(np.maximum(high - low, 0.0), axis=1)
    return common / np.maximum(box[2] * box[3] + boxes[:, 2] * boxes[:, 3] - common, 1e-9)


def _crop_around(center: np.ndarray, top: np.ndarray) -> Crop:
    """Of the circle about ``center`` through ``top``, the person's head on that side."""
    du, dv = top - center
    radius = math.hypot(du, dv)
    return Crop((float(center[0]), float(center[1])), max(2.0 * _MARGIN * radius, 8.0), math.atan2(du, -dv))


def _without(image: np.ndarray, people: Sequence[Person]) -> np.ndarray:
    """The image with people covered by its mean color."""
    result, mean = image.copy(), image.reshape(-1, 3).mean(axis=0).astype(np.uint8)
    for person in people:
        if person.silhouette is not None:
            u, v = person.silhouette.origin
            shown = cv2.dilate(person.silhouette.probabilities, np.ones((5, 5), np.uint8)) > 64
            result[v : v + shown.shape[0], u : u + shown.shape[1]][shown] = mean
    return result


def _box(pixels: np.ndarray) -> tuple[float, float, float, float]:
    """Around all points."""
    (left, top), (right, bottom) = pixels.min(axis=0).tolist(), pixels.max(axis=0).tolist()
    return left, top, right, bottom


def _silhouette(logits: np.ndarray, crop: Crop, size: tuple[int, int]) -> Silhouette:
    """Of the whole crop, in pixels of the image."""
    height, width = size
    matrix = crop.to_image(_SIDE)
    corners = mapped(matrix, np.array([[0.0, 0.0], [_SIDE, 0.0], [0.0, _SIDE], [_SIDE, _SIDE]]))
    low = np.clip(np.floor(corners.min(axis=0)), 0, [width - 1, height - 1]).astype(int)
    high = np.clip(np.ceil(corners.max(axis=0)) + 1, 1, [width, height]).astype(int)
    matrix[:, 2] -= low
    wide, high_ = np.maximum(high - low, 1).tolist()
    grown = cv2.warpAffine(np.ascontiguousarray(logits), matrix, (wide, high_), flags=cv2.INTER_LINEAR, borderValue=-20.0)
    probabilities = 255.0 / (1.0 + np.exp(-np.clip(grown, -20.0, 20.0)))
    return Silhouette(np.rint(probabilities).astype(np.uint8), (int(low[0]), int(low[1])))


_LEAST = 0.05  # cells^2: a map cannot tell a place more finely
_REACH = 3  # cells around the first guess in which the peak is searched, and around the peak that have a say, on either side


@compiled
def read_heat_maps(logits, points, means, covariances, peaks):
    """Mean and second moments of the squares of each map, around its peak beside a first guess.

    Squares, since the skirts of a map that is cut off would draw its mean to the middle of what is left.

    Parameters
    ----------
    logits : (height, width, n) float32, log odds of a cell to hold the point.
    points : (n, 2) first guess, cells.
    means : (n, 2) cells, overwritten.
    covariances : (n, 2, 2) cells^2 of the map around its mean, overwritten.
    peaks : (n,) largest probability there, overwritten; 0 where the guess is off the map.
    """
    height, width, n = logits.shape
    for k in range(n):
        column, row = int(np.floor(points[k, 0] + 0.5)), int(np.floor(points[k, 1] + 0.5))
        highest, top, left = np.float32(-np.inf), row, column
        for i in range(max(row - _REACH, 0), min(row + _REACH + 1, height)):
            for j in range(max(column - _REACH, 0), min(column + _REACH + 1, width)):
                if logits[i, j, k] > highest:
                    highest, top, left = logits[i, j, k], i, j
        peaks[k] = 1.0 / (1.0 + np.exp(-np.float64(highest)))
        total, x, y, xx, xy, yy = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for i in range(max(top - _REACH, 0), min(top + _REACH + 1, height)):
            for j in range(max(left - _REACH, 0), min(left + _REACH + 1, width)):
                p = (1.0 / (1.0 + np.exp(-np.float64(logits[i, j, k])))) ** 2
                total, x, y = total + p, x + p * j, y + p * i
                xx, xy, yy = xx + p * j * j, xy + p * i * j, yy + p * i * i
        means[k, 0], means[k, 1] = points[k, 0], points[k, 1]
        covariances[k] = np.eye(2) * (_REACH * _REACH)
        if total > 0.0:
            x, y = x / total, y / total
            means[k, 0], means[k, 1] = x, y
            covariances[k, 0, 0] = max(xx / total - x * x, 0.0) + _LEAST
            covariances[k, 1, 1] = max(yy / total - y * y, 0.0) + _LEAST
            covariances[k, 0, 1] = xy / total - x * y
            covariances[k, 1, 0] = covariances[k, 0, 1]
