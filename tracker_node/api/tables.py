"""Tables of pandas and datasets of xarray from the arrays of a run; both are imported when they are first used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import extra_module
from ..evaluation.motion.isb_angles import isb_angles
from ..model.kinematic_chain import N_ROOT_DOF
from ..runs.data import RunData
from ..runs.motion import RunMotion
from ..tracking.estimate import LimbStatus, Status

if TYPE_CHECKING:
    import pandas
    import xarray

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
    return pd.DataFrame(_positions(motion).reshape(len(motion), -1), index=_times(pd, motion.stamps_ns), columns=names)


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
        found = isb_angles(motion)
        names = [name for triple in found.names for name in triple]
        radians = np.where(found.valid[..., None], found.radians, np.nan).reshape(len(motion), -1)
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
        "position": (("time", "landmark", "axis"), _positions(motion), {"units": "m", "long_name": "landmarks, world axes"}),
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


def _positions(motion: RunMotion) -> np.ndarray:
    """(n, n_landmarks, 3) m, NaN in gaps."""
    return np.where(motion.landmarks_valid()[..., None], motion.landmarks_m(), np.nan)


def _seconds(stamps_ns: np.ndarray) -> np.ndarray:
    return (stamps_ns - stamps_ns[0]) * 1e-9


def _times(pd: Any, stamps_ns: np.ndarray) -> Any:
    return pd.Index(_seconds(stamps_ns), name=TIME)
