"""Experiments on contours as calls: the error as one variable leaves the truth, by silhouettes, edges and their sum (Knossow,
Ronfard, Horaud & Devernay, Fig. 3), methods to track by, and the Jacobian without its sliding term."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...camera.rig import CameraRig
from ...evaluation.evaluate import Evaluation
from ...model.articulated import ArticulatedModel
from ...model.configuration import State
from ...objective.chamfer.correspondences import ContourCorrespondences
from ...observation.image_set import ImageSet
from ...parallel import serial
from ...tracking.chamfer.modality import FINE, ChamferModality
from ...tracking.config import TrackerConfig
from ..rigid_tracking import basin

PUBLISHED = ("silhouette", "edges", "sum")
"""What the error of a contour sample is: its distance to the silhouette, that to the nearest edge within it, or their sum."""
METHODS = (*PUBLISHED, "split", "region")
TITLES = {
    "silhouette": "silhouettes only", "edges": "edges only", "sum": "sum of both (the paper's)",
    "split": "this tracker's distances", "region": "this tracker's regions (default)",
}  # fmt: skip
REACH_PX = 120  # of distances, where no tracker has to be quick
FLAT_RISE_PX = 0.25  # of an error that a valley's floor is no higher than
ABLATION_ITERATIONS = 50
_PLAIN_SQUARES_PX = 1000.0  # scale of a robust kernel that changes nothing


def by_method(config: TrackerConfig, method: str) -> TrackerConfig:
    """Parameters to track by one of `METHODS`; a lost body is not detected again.

    Parameters
    ----------
    config : parameters to start from.
    method : of `METHODS`.

    Returns
    -------
    The parameters.
    """
    config = replace(config, initialization=replace(config.initialization, enabled=False))
    if method == "region":
        return replace(config, modalities=("region",))
    return replace(config, modalities=("chamfer",), chamfer=replace(config.chamfer, distances=method))


def until_converged(config: TrackerConfig, sliding: bool) -> TrackerConfig:
    """Parameters with enough iterations for their number to differ.

    Parameters
    ----------
    config : parameters to start from.
    sliding : whether the Jacobian has the sliding of the contour generator.

    Returns
    -------
    The parameters.
    """
    return replace(config, chamfer=replace(config.chamfer, sliding=sliding, max_iterations=ABLATION_ITERATIONS))


def run_metrics(result: Evaluation) -> dict[str, float | int]:
    """Metrics of a run, by the names that ``tracker_node evaluate`` has for them."""
    found = result.metrics()
    keys = ("mpjpe_mm", "mpjpe_offset_free_mm", "lost_sets", "lost_limbs", "iterations", "residual_px", "image_sets")
    return {key: found[f"{result.name}.{key}"] for key in keys}


def images_of(image_set: ImageSet, rig: CameraRig) -> list[np.ndarray | None]:
    """BGR pixels by camera, as engines take them.

    Parameters
    ----------
    image_set : the images.
    rig : cameras, which give the order.

    Returns
    -------
    (h, w, 3) uint8 each; None where the set has none.
    """
    return [None if image is None else image.bgr for image in map(image_set.get, rig.names)]


class ContourError:
    """How far the contours of a body are from what the images show: rms over all samples seen, pixels, no kernel that forgives.

    Parameters
    ----------
    rig, model, backgrounds : as for the `Tracker`.
    distances : one of `PUBLISHED`.
    """

    def __init__(self, rig: CameraRig, model: ArticulatedModel, backgrounds: Mapping[str, np.ndarray | list], distances: str):
        self._rig = rig
        self._modality = ChamferModality(rig, model, far_sighted(by_method(TrackerConfig(), distances)), backgrounds, serial)
        self._contours: ContourCorrespondences | None = None

    def look(self, image_set: ImageSet, body: State) -> None:
        """Observe images; which samples are seen is decided in the state of the body.

        Parameters
        ----------
        image_set : the images.
        body : state of the body in them.
        """
        self._modality.set_images(images_of(image_set, self._rig), body)
        self._contours = self._modality.correspond(body, FINE)

    def at(self, state: State) -> float:
        """In a state; NaN where all contours are out of the images."""
        assert self._contours is not None, "look first"
        found = self._contours.linearize(state)
        if not found.count:
            return float("nan")
        return float(np.sqrt(found.cost * self._contours.options.variance_px2 / found.count))

    def along(self, body: State, direction: np.ndarray, changes: np.ndarray) -> np.ndarray:
        """Error along a direction.

        Parameters
        ----------
        body : state to start from.
        direction : (n_dof,) tangent of the state.
        changes : (n,) multiples of it.

        Returns
        -------
        (n,) pixels.
        """
        return np.array([self.at(body.retract(change * direction)) for change in changes])


def far_sighted(config: TrackerConfig) -> TrackerConfig:
    """Distances are not cut off nearby, every residual counts by its square, and silhouettes come from plates alone."""
    chamfer = replace(
        config.chamfer, silhouette="background", reach_px=REACH_PX, margin_px=REACH_PX, truncation_px=float(REACH_PX),
        edge_truncation_px=float(REACH_PX), fine_robust_scale_px=_PLAIN_SQUARES_PX,
    )  # fmt: skip
    return replace(config, chamfer=chamfer)


@dataclass(frozen=True)
class Valley:
    """Of an error along a variable: where it is lowest, how wide its floor is (`FLAT_RISE_PX`), and how far it rises without a
    fall on the side where that ends sooner; in the unit of the variable."""

    minimum: float
    flat: float
    rising: float


def valley(changes: np.ndarray, errors: np.ndarray) -> Valley:
    """The valley of an error along a variable.

    Parameters
    ----------
    changes : (n,) of the variable, increasing.
    errors : (n,) pixels.

    Returns
    -------
    Its minimum and widths.
    """
    lowest, left, right = basin(changes, errors)
    at = int(np.flatnonzero(changes == lowest)[0])
    above = np.flatnonzero(~(errors <= errors[at] + FLAT_RISE_PX))
    first = above[above < at].max(initial=-1) + 1
    last = above[above > at].min(initial=len(errors)) - 1
    return Valley(lowest, float(changes[last] - changes[first]), min(left, right))


def direction_of(model: ArticulatedModel, dof_name: str) -> np.ndarray:
    """Tangent along one degree of freedom.

    Parameters
    ----------
    model : the body.
    dof_name : of the degree of freedom.

    Returns
    -------
    (n_dof,) a unit vector.
    """
    return np.eye(model.n_dof)[model.chain.dof_names.index(dof_name)]


def displaced(pose: State, angle: float, shift_m: float, rng: np.random.Generator) -> State:
    """Displace a pose at random.

    Parameters
    ----------
    pose : to start from.
    angle : radians, of every joint one way or the other, and of the root.
    shift_m : of the root, meters.
    rng : random directions and signs.

    Returns
    -------
    The displaced state.
    """
    shift, axis = rng.standard_normal((2, 3))
    signs = rng.choice([-1.0, 1.0], len(pose.joint_positions))
    unit = (shift_m * shift / np.linalg.norm(shift), angle * axis / np.linalg.norm(axis))
    return pose.retract(np.concatenate([*unit, angle * signs]))
