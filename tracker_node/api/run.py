"""A run: what a tracker found in a recording, with accessors for numpy, pandas and xarray."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import FileFormatError
from ..loaders.model.model_yaml import load_model
from ..model.articulated import ArticulatedModel
from ..runs import load
from ..runs.data import RunData
from ..runs.images import file_of
from ..runs.motion import RunMotion, motion_of_run
from ..tracking.estimate import Status
from . import tables

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True, eq=False)
class Run:
    """States of a body over n image sets.

    Parameters
    ----------
    data : states, statuses and residuals as arrays (`runs.data.RunData`).
    model : body that they are of.

    Examples
    --------
    >>> run = load_run("out/run")  # doctest: +SKIP
    >>> run.joint_angles()["left_knee_flexion"].max()  # doctest: +SKIP
    """

    data: RunData
    model: ArticulatedModel

    def __len__(self) -> int:
        """Number n of image sets."""
        return len(self.data)

    @property
    def path(self) -> Path | None:
        """Folder or bag of the run; None for a run that was not written."""
        return self.data.path if self.data.path.exists() else None

    @property
    def info(self) -> Mapping[str, Any]:
        """Content of ``run.json``: options, parameters, versions, errors and notes."""
        return self.data.info

    @property
    def stamps_ns(self) -> np.ndarray:
        """(n,) int64 stamps of the image sets, nanoseconds."""
        return self.data.stamps_ns

    @property
    def times_s(self) -> np.ndarray:
        """(n,) seconds since the first image set."""
        return (self.data.stamps_ns - self.data.stamps_ns[0]) * 1e-9

    @property
    def status(self) -> tuple[str, ...]:
        """n names of `tracking.estimate.Status`, such as ``TRACKING``."""
        return tuple(Status(int(number)).name for number in self.data.status)

    @cached_property
    def motion(self) -> RunMotion:
        """The motion with gaps where the body is LOST or not found yet.

        Raises
        ------
        FileFormatError : no state is left.
        """
        return motion_of_run(self.data, self.model)

    def states(self) -> pandas.DataFrame:
        """States as a table, one row per image set, as ``states.csv`` has them.

        Returns
        -------
        DataFrame with the index ``time_s`` (seconds since the first image set) and the columns ``stamp_ns`` (nanoseconds),
        ``status``, one per degree of freedom (root translation in m and rotation vector in rad, world axes; joint angles in
        rad, sliding joints in m; NaN in sets without a state), ``residual`` and ``iterations``.

        Raises
        ------
        MissingExtraError : pandas is not installed.
        """
        return tables.states(self.data)

    def joints(self) -> pandas.DataFrame:
        """Positions of the landmarks (joint centers and other named points), m, in world axes.

        Returns
        -------
        DataFrame with the index ``time_s`` and columns of two levels, landmark and axis (x, y, z); NaN in gaps. So
        ``run.joints()["left_knee"]`` is a table of three columns.

        Raises
        ------
        MissingExtraError : pandas is not installed.
        """
        return tables.joints(self.motion)

    def joint_angles(self, convention: str = "model", unit: str = "deg") -> pandas.DataFrame:
        """Joint angles as a table.

        Parameters
        ----------
        convention : "model": turns about the model's own joint axes, as in `states`; "isb": as the International Society of
            Biomechanics recommends them, for a model of a person.
        unit : "deg" or "rad".

        Returns
        -------
        DataFrame with the index ``time_s`` and one column per angle, such as ``left_knee_flexion``; NaN in gaps.

        Raises
        ------
        MissingExtraError : pandas is not installed.
        ModelError : angles after the ISB of a body without the segments of a person.
        """
        return tables.joint_angles(self.motion, convention, unit)

    def to_xarray(self) -> xarray.Dataset:
        """Everything as one labeled dataset.

        Returns
        -------
        Dataset with the dimensions ``time`` (seconds), ``dof``, ``landmark``, ``axis``, and, as far as the run has a bag,
        ``camera``, ``limb`` and ``dof_2``. Variables: ``state`` (time, dof), ``position`` (time, landmark, axis) in m, ``status``
        (time), ``residual`` (time), ``camera_residual`` (time, camera), ``limb_status`` (time, limb), ``covariance`` (time, dof,
        dof_2) in the tangent of the state. Units stand in the attributes.

        Raises
        ------
        MissingExtraError : xarray is not installed.
        """
        return tables.dataset(self.data, self.motion)


def load_run(path: str | Path, model: ArticulatedModel | str | Path | None = None, topic: str | None = None) -> Run:
    """Read a run that `track`, the command line or the live tracker has written.

    Parameters
    ----------
    path : folder of a run, or a bag with tracked states.
    model : body, or its file; None: the file that ``run.json`` names.
    topic : of the states, where the bag has those of several bodies.

    Returns
    -------
    The run.

    Raises
    ------
    FileFormatError : no run there, no model named, or a model with other degrees of freedom.

    Examples
    --------
    >>> run = load_run("out/run1")  # doctest: +SKIP
    """
    found = load.load_run(path, topic)
    named: str | Path | None = None
    if not isinstance(model, ArticulatedModel):
        named = model or file_of(found.info, "model")
        if not named:
            raise FileFormatError(path, "options.model", "a run that names its body model, or load_run(path, model)", "none")
        model = load_model(named)
    found.check_model(model, named or model.name)
    return Run(found, model)


def unwritten(run: RunData) -> RunData:
    """The same run without the files that it was read from, which are about to be deleted."""
    return replace(run, path=Path(f"(run of {len(run)} image sets, not written)"), bag=None)
