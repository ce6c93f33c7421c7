"""Normal equations of cameras and the boards they see, board poses and stamps eliminated (Schur complement)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...optimize.descent import ArrowEquations

CLOCK, N_PLACE = 6, 7  # of a camera's parameters: six for its place, then the clock, then the lens


@dataclass(frozen=True, eq=False)
class CameraRows:
    """What one camera saw: m corners at the time steps ``time_step`` (m,), weights (m,), residuals (m, 2) and derivatives.

    ``by_camera`` (m, 2, p), ``by_pose`` (m, 2, 6) of the board, ``by_stamp`` (m, 2) of the time of the image.
    """

    camera: int
    time_step: np.ndarray
    weights: np.ndarray
    residuals: np.ndarray
    by_camera: np.ndarray
    by_pose: np.ndarray
    by_stamp: np.ndarray


class BoardEquations(ArrowEquations):
    """Cameras share the poses of the board at the time steps, which are the blocks; stamps are eliminated before.

    Parameters
    ----------
    offsets : (c + 1,) where each camera's parameters begin.
    n_time_steps : poses.
    """

    def __init__(self, offsets: np.ndarray, n_time_steps: int):
        super().__init__(int(offsets[-1]), n_time_steps, 6)
        self.offsets, self.n_time_steps = offsets, n_time_steps
        self.stamps: list[_Stamps] = []

    def part(self, camera: int) -> slice:
        return slice(self.offsets[camera], self.offsets[camera + 1])

    def add(self, rows: CameraRows) -> None:
        part = self.part(rows.camera)
        weighted_camera = rows.weights[:, None, None] * rows.by_camera
        weighted_pose = rows.weights[:, None, None] * rows.by_pose
        self.shared[part, part] += np.einsum("mri,mrj->ij", weighted_camera, rows.by_camera)
        self.gradient_shared[part] += np.einsum("mri,mr->i", weighted_camera, rows.residuals)
        self.blocks += self._by_time_step(rows, np.einsum("mri,mrj->mij", weighted_pose, rows.by_pose))
        self.gradient_blocks += self._by_time_step(rows, np.einsum("mri,mr->mi", weighted_pose, rows.residuals))
        self.mixed[:, part] += self._by_time_step(rows, np.einsum("mri,mrj->mij", weighted_camera, rows.by_pose))

    def eliminate_stamps(self, rows: CameraRows, late_s: np.ndarray, prior: float) -> None:
        """Eliminate the errors of the stamps of one camera's views.

        Parameters
        ----------
        rows : what the camera saw.
        late_s : (n,) seconds by which the views are later so far.
        prior : precision of a stamp, in the units of the cost.
        """
        weighted = rows.weights[:, None] * rows.by_stamp
        stamps = _Stamps(
            rows.camera,
            self._by_time_step(rows, (weighted * rows.by_stamp).sum(axis=1)) + prior,
            self._by_time_step(rows, (weighted * rows.residuals).sum(axis=1)) + prior * late_s,
            self._by_time_step(rows, np.einsum("mr,mri->mi", weighted, rows.by_camera)),
            self._by_time_step(rows, np.einsum("mr,mri->mi", weighted, rows.by_pose)),
        )
        part, slope = self.part(rows.camera), stamps.gradient / stamps.precision
        with_camera, with_pose = stamps.with_camera / stamps.precision[:, None], stamps.with_pose / stamps.precision[:, None]
        self.shared[part, part] -= stamps.with_camera.T @ with_camera
        self.gradient_shared[part] -= stamps.with_camera.T @ slope
        self.blocks -= with_pose[:, :, None] * stamps.with_pose[:, None]
        self.gradient_blocks -= stamps.with_pose * slope[:, None]
        self.mixed[:, part] -= with_camera[:, :, None] * stamps.with_pose[:, None]
        self.stamps.append(stamps)

    def add_lens_prior(self, camera: int, gradient: np.ndarray, precision: np.ndarray) -> None:
        """Add the prior on a camera's lens.


        Parameters
        ----------
        camera : its index.
        gradient, precision : (p,) half gradient and second derivative of the prior's cost, by lens parameter.
        """
        lens = np.arange(self.offsets[camera] + N_PLACE, self.offsets[camera + 1])
        self.shared[lens, lens] += precision
        self.gradient_shared[lens] += gradient

    def hold(self, free_cameras: bool, free_clocks: bool, free_lenses: bool) -> None:
        """Say what is estimated; place and clock of the first camera are always held.

        Parameters
        ----------
        free_cameras, free_clocks, free_lenses : places of the cameras, offsets of their clocks, lenses.
        """
        for k, start in enumerate(self.offsets[:-1]):
            self.free[start : start + CLOCK] = free_cameras and k > 0
            self.free[start + CLOCK] = free_clocks and k > 0
            self.free[start + N_PLACE : self.offsets[k + 1]] = free_lenses

    def step(self, damping: float) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """One damped Gauss-Newton step: moves of every camera's parameters, of the poses (n, 6), and of the stamps (n, c)."""
        moves, poses = self.move(damping)
        late_s = np.zeros((self.n_time_steps, len(self.offsets) - 1))
        for stamps in self.stamps:
            change = stamps.with_camera @ moves[self.part(stamps.camera)] + (stamps.with_pose * poses).sum(axis=1)
            late_s[:, stamps.camera] = -(stamps.gradient + change) / stamps.precision
        return np.split(moves, self.offsets[1:-1]), poses, late_s

    def covariance(self) -> np.ndarray:
        """(d, d) of all cameras' parameters for residuals with an error of one pixel; zeros for what is held."""
        return self.expanded(np.linalg.pinv(self.reduced(self.inverses(0.0), 0.0), hermitian=True))

    def _by_time_step(self, rows: CameraRows, values: np.ndarray) -> np.ndarray:
        """(n, ...) sums of values (m, ...) of the same time step."""
        result = np.zeros((self.n_time_steps, *values.shape[1:]))
        np.add.at(result, rows.time_step, values)
        return result


@dataclass(frozen=True, eq=False)
class _Stamps:
    """One camera's stamps before they were eliminated: precision and gradient (n,), mixed with camera (n, p) and poses (n, 6)."""

    camera: int
    precision: np.ndarray
    gradient: np.ndarray
    with_camera: np.ndarray
    with_pose: np.ndarray
