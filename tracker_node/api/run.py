"""A run: what a tracker found in a recording, with accessors for numpy, pandas and xarray.

Tables of pandas and datasets of xarray from the arrays of a run; both are imported when they are first used.
"""

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

if TYPE_CHECKING:
    import pandas
    import xarray
from ..errors import extra_module
from ..evaluation.motion.isb_angles import isb_angles
from ..model.kinematic_chain import N_ROOT_DOF
from ..tracking.estimate import LimbStatus


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

    def __repr__(self) -> str:
        """Two lines, which end a cell of a notebook without flooding it."""
        return f"<{type(self).__name__} of {self.model!r}\n {self.data!r}>"

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
        """States as a table, one row per image set: part of ``states.csv``, by the names of the degrees of freedom.

        Returns
        -------
        DataFrame with the index ``time_s`` (seconds since the first image set) and the columns ``stamp_ns`` (nanoseconds),
        ``status``, one per degree of freedom (root translation in m and rotation vector in rad, world axes; joint angles in
        rad, sliding joints in m; NaN in sets without a state), ``residual`` and ``iterations``.

        Raises
        ------
        MissingExtraError : pandas is not installed.
        """
        return states(self.data)

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
        return joints(self.motion)

    def joint_angles(self, convention: str = "model", unit: str = "deg") -> pandas.DataFrame:
        """Joint angles as a table, by default not those of reports, which give people "isb": other names, turns and signs.

        Parameters
        ----------
        convention : "model": turns about the model's own joint axes, as in `states`: ``left_hip_abduction`` is positive outward;
            "isb": from segment to segment, as the International Society of Biomechanics recommends, for a model of a person:
            ``left_hip_adduction`` is positive inward. Turns that no joint of the model has, such as a hinge's adduction, are left
            out.
        unit : "deg" or "rad".

        Returns
        -------
        DataFrame with the index ``time_s`` and one column per angle, such as ``left_knee_flexion``; NaN in gaps.

        Raises
        ------
        MissingExtraError : pandas is not installed.
        ModelError : angles after the ISB of a body without the segments of a person.
        """
        return joint_angles(self.motion, convention, unit)

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
        return dataset(self.data, self.motion)


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


TIME = "time_s"
AXES = ("x", "y", "z")
CONVENTIONS, UNITS = ("model", "isb"), ("deg", "rad")


def states(run: RunData) -> pandas.DataFrame:
    """Table of `Run.states`."""
    pd = extra_module("pandas", "data")
    columns: dict[str, Any] = {"stamp_ns": run.stamps_ns, "status": [Status(int(number)).name for number in run.status]}
    columns |= dict(zip(run.dof_names, run.values.T, strict=True))
    columns |= {"residual": run.residual, "iterations": run.iterations}
    return pd.DataFrame(columns, index=_times(pd, run.stamps_ns))


def joints(motion: RunMotion) -> pandas.DataFrame:
    """Table of `Run.joints`."""
    pd = extra_module("pandas", "data")
    names = pd.MultiIndex.from_product([motion.model.landmark_names, AXES], names=["landmark", "axis"])
    return pd.DataFrame(motion.landmarks_or_nan_m().reshape(len(motion), -1), index=_times(pd, motion.stamps_ns), columns=names)


def joint_angles(motion: RunMotion, convention: str = "model", unit: str = "deg") -> pandas.DataFrame:
    """Table of `Run.joint_angles`.

    Parameters
    ----------
    motion : with gaps where there is no state.
    convention : one of `CONVENTIONS`.
    unit : one of `UNITS`.

    Returns
    -------
    One column per angle.
    """
    for value, known in ((convention, CONVENTIONS), (unit, UNITS)):
        if value not in known:
            raise ValueError(f"expected one of {known}, got {value!r}")
    pd = extra_module("pandas", "data")
    if convention == "isb":
        names, values, valid = isb_angles(motion).columns()
        radians = np.where(valid, values, np.nan)
    else:
        turning = [i for i, name in enumerate(motion.model.chain.dof_units) if name == "rad" and i >= N_ROOT_DOF]
        names = [motion.model.chain.dof_names[i] for i in turning]
        radians = np.where(motion.valid[:, None], motion.values[:, turning], np.nan)
    values = np.degrees(radians) if unit == "deg" else radians
    return pd.DataFrame(values, index=_times(pd, motion.stamps_ns), columns=pd.Index(names, name=f"angle_{unit}"))


def dataset(run: RunData, motion: RunMotion) -> xarray.Dataset:
    """Dataset of `Run.to_xarray`.

    Parameters
    ----------
    run : all that a tracker said.
    motion : of the same image sets.

    Returns
    -------
    Variables with their dimensions, coordinates and units.
    """
    xr = extra_module("xarray", "data")
    chain, model = motion.model.chain, motion.model
    names = np.array([Status(int(number)).name for number in run.status])
    variables: dict[str, Any] = {
        "state": (("time", "dof"), run.values, {"long_name": "root pose and joint angles, world axes"}),
        "status": (("time",), names),
        "residual": (("time",), run.residual),
        "iterations": (("time",), run.iterations),
        "position": (
            ("time", "landmark", "axis"), motion.landmarks_or_nan_m(), {"units": "m", "long_name": "landmarks, world axes"},
        ),
    }
    coordinates: dict[str, Any] = {
        "time": ("time", _seconds(run.stamps_ns), {"units": "s"}),
        "stamp_ns": ("time", run.stamps_ns),
        "dof": list(run.dof_names),
        "unit": ("dof", list(chain.dof_units)),
        "landmark": list(model.landmark_names),
        "axis": list(AXES),
    }
    if run.cameras:
        coordinates["camera"] = list(run.cameras)
        variables["camera_residual"] = (("time", "camera"), run.camera_residuals)
    if run.details is not None:
        coordinates["dof_2"] = list(run.dof_names)
        variables["covariance"] = (("time", "dof", "dof_2"), run.details.covariances)
        if run.details.limbs:
            coordinates["limb"] = list(run.details.limbs)
            limbs = np.array([[LimbStatus(int(number)).name for number in row] for row in run.details.limb_status])
            variables["limb_status"] = (("time", "limb"), limbs)
    return xr.Dataset(variables, coordinates, {"model": model.name})


def _seconds(stamps_ns: np.ndarray) -> np.ndarray:
    return (stamps_ns - stamps_ns[0]) * 1e-9


def _times(pd: Any, stamps_ns: np.ndarray) -> Any:
    return pd.Index(_seconds(stamps_ns), name=TIME)
