"""The states of a run, and what a tracker says beside them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..camera.rig import CameraRig
from ..errors import FileFormatError
from ..model.articulated import ArticulatedModel
from ..model.configuration import Configuration, State
from ..tracking.estimate import PX, LimbStatus, Status, TrackEstimate


@dataclass(frozen=True, eq=False)
class RunDetails:
    """What a tracker says beside its n states; only bags hold it.

    Parameters
    ----------
    limb_status : (n, l) numbers of `tracking.estimate.LimbStatus`, per name of ``limbs``; l = 0 when limbs are not judged.
    timings_ms : (n, 3) to observe, to optimize, in all; NaN for a set that the bag does not hold.
    covariances : (n, n_dof, n_dof) float32 in the tangent of `model.configuration.State`; zero where nothing is known.
    """

    limbs: tuple[str, ...]
    limb_status: np.ndarray
    timings_ms: np.ndarray
    covariances: np.ndarray

    @classmethod
    def unknown(cls, n: int, n_dof: int, limbs: tuple[str, ...] = ()) -> RunDetails:
        """Nothing is known of any set.

        Parameters
        ----------
        n : image sets.
        n_dof : degrees of freedom.
        limbs : names.

        Returns
        -------
        details : of n sets.
        """
        unseen = np.full((n, len(limbs)), int(LimbStatus.UNSEEN))
        return cls(limbs, unseen, np.full((n, 3), np.nan), np.zeros((n, n_dof, n_dof), dtype=np.float32))

    def at(self, rows: np.ndarray) -> RunDetails:
        """Those of some sets; nothing is known where a row is -1."""
        found = RunDetails.unknown(len(rows), self.covariances.shape[1], self.limbs)
        for name in ("limb_status", "timings_ms", "covariances"):
            getattr(found, name)[rows >= 0] = getattr(self, name)[rows[rows >= 0]]
        return found


@dataclass(frozen=True, eq=False)
class RunData:
    """States over n image sets, in the order of their stamps.

    Parameters
    ----------
    stamps_ns : (n,) of the image sets.
    status : (n,) numbers of `tracking.estimate.Status`.
    values : (n, n_dof) as `model.configuration.State.to_values`, in the order of ``dof_names``; NaN in sets without a state: the
        body had not been found (status INITIALIZING).
    residual : (n,) rms over all cameras in ``residual_unit``, NaN without a state. iterations : (n,).
    camera_residuals, camera_samples : (n, c), per name of ``cameras``; c = 0 when the run does not tell.
    info : content of ``run.json``, empty without one.
    details : None for a run without a bag.
    """

    path: Path
    dof_names: tuple[str, ...]
    stamps_ns: np.ndarray
    status: np.ndarray
    values: np.ndarray
    residual: np.ndarray
    iterations: np.ndarray
    cameras: tuple[str, ...]
    camera_residuals: np.ndarray
    camera_samples: np.ndarray
    bag: Path | None = None
    info: Mapping[str, Any] = field(default_factory=dict)
    residual_unit: str = PX
    details: RunDetails | None = None

    def __repr__(self) -> str:
        """In a line: which run, how long, what became of it, by which cameras."""
        seconds = (self.stamps_ns[-1] - self.stamps_ns[0]) * 1e-9 if len(self) else 0.0
        where = str(self.path) if self.path.exists() else "that was not written"
        said = f"{len(self)} image sets in {seconds:.2f} s, {self.status_text or 'no states'}"
        return f"<{type(self).__name__} {where}: {said}{', cameras ' * bool(self.cameras)}{', '.join(self.cameras)}>"

    @classmethod
    def of_estimates(cls, path: Path, model: ArticulatedModel, rig: CameraRig, estimates: Sequence[TrackEstimate]) -> RunData:
        """What a tracker of ``model`` before the cameras of ``rig`` has returned, one estimate for each image set.

        Parameters
        ----------
        path : of the run, for messages.
        model : the body.
        rig : the cameras, in the order of the reports.
        estimates : in the order of their stamps.

        Returns
        -------
        run : without a bag.
        """
        return cls(
            path=path,
            dof_names=model.chain.dof_names,
            stamps_ns=np.array([e.stamp_ns for e in estimates], dtype=np.int64),
            status=np.array([int(e.status) for e in estimates]),
            values=np.array([e.state.to_values() for e in estimates]),
            residual=np.array([e.residual for e in estimates]),
            iterations=np.array([e.iterations for e in estimates]),
            cameras=rig.names,
            camera_residuals=np.array([[c.residual for c in e.cameras] for e in estimates]),
            camera_samples=np.array([[c.samples for c in e.cameras] for e in estimates]),
            residual_unit=next((e.residual_unit for e in estimates), PX),
        ).without_guesses()

    @property
    def residual_key(self) -> str:
        """Key of the residual among metrics, which has its unit at its end."""
        return "residual_px" if self.residual_unit == PX else "residual_gray_levels"

    def without_guesses(self) -> RunData:
        """NaN instead of the neutral state that is written before the body is found."""
        found = self.has_state & np.array([Status(int(status)).has_state for status in self.status], dtype=bool)
        values, residual = np.where(found[:, None], self.values, np.nan), np.where(found, self.residual, np.nan)
        details = self.details
        if details is not None:
            details = replace(details, covariances=np.where(found[:, None, None], details.covariances, np.float32(0.0)))
        return replace(self, values=values, residual=residual, details=details)

    def __len__(self) -> int:
        return len(self.stamps_ns)

    def at(self, rows: np.ndarray) -> RunData:
        """Some of the image sets."""
        per_set = ("stamps_ns", "status", "values", "residual", "iterations", "camera_residuals", "camera_samples")
        details = None if self.details is None else self.details.at(rows)
        return replace(self, details=details, **{name: getattr(self, name)[rows] for name in per_set})

    @property
    def has_state(self) -> np.ndarray:
        """(n,) bool."""
        return np.isfinite(self.values).all(axis=1)

    @property
    def tracked(self) -> np.ndarray:
        """(n,) bool: with a state that the tracker does not call LOST."""
        return self.has_state & (self.status != int(Status.LOST))

    @property
    def status_text(self) -> str:
        """How many sets have each status, for messages: ``12 INITIALIZING, 3 LOST``."""
        counts = [(int((self.status == int(status)).sum()), status.name) for status in Status]
        return ", ".join(f"{count} {name}" for count, name in counts if count)

    def configuration(self, model: ArticulatedModel, i: int) -> Configuration:
        """The model as tracked in image set ``i``.

        Parameters
        ----------
        model : of the run.
        i : row of the image set.

        Returns
        -------
        configuration : the model in that state.

        Raises
        ------
        ValueError : a set without a state.
        """
        if not np.isfinite(self.values[i]).all():
            raise ValueError(f"expected an image set with a state, got {i}, {Status(int(self.status[i])).name}")
        return Configuration(model, State.from_values(self.values[i]))

    def check_model(self, model: ArticulatedModel, model_path: str | Path) -> None:
        """Raises FileFormatError when ``model`` has other degrees of freedom than the run.

        Parameters
        ----------
        model : to be used with the run.
        model_path : its file, for messages.
        """
        if self.dof_names != model.chain.dof_names:
            only_run = sorted(set(self.dof_names) - set(model.chain.dof_names))[:2]
            only_model = sorted(set(model.chain.dof_names) - set(self.dof_names))[:2]
            problem = f"{len(model.chain.dof_names)}, e.g. {only_model or 'another order'} and not {only_run}"
            expected = f"the {len(self.dof_names)} degrees of freedom of {self.path}"
            raise FileFormatError(model_path, "joints", expected, problem)
