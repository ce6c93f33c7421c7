"""What goes into a file for another program, and in which axes and units."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...errors import FileFormatError
from ...loaders.motion.bvh import AXES_Y_UP
from ...model.articulated import ArticulatedModel
from ...model.humans.landmark_names import MARKER_OF_LANDMARK


@dataclass(frozen=True)
class ExportOptions:
    """How a motion is written.

    Parameters
    ----------
    y_up : the file's axes are (x, y, z) = (y, z, x) of the world, as OpenSim and Pose2Sim have them; otherwise the world's.
    unit : of lengths: m, cm, mm. degrees : of angles; otherwise radians. Where the format leaves a choice.
    landmarks : names, in the order of the file; empty: all of the model (BVH: none).
    openpose_names : landmarks under the names of OpenPose and Pose2Sim (``RKnee``), where they have one.
    link : whose pose is written to TUM files; empty: the root.
    opensim : coordinates of OpenSim's models of a person instead of the model's own, in MOT, STO and CSV.
    isb_angles : also joint angles after the ISB, in C3D and CSV.

    Raises
    ------
    FileFormatError : a landmark given twice, which readers would refuse.
    """

    y_up: bool
    unit: str = "m"
    degrees: bool = True
    landmarks: tuple[str, ...] = ()
    openpose_names: bool = False
    link: str = ""
    opensim: bool = False
    isb_angles: bool = False

    def __post_init__(self) -> None:
        twice = sorted({name for name in self.landmarks if self.landmarks.count(name) > 1})
        if twice:
            raise FileFormatError("export", "landmarks", "each name once", ", ".join(twice))

    @property
    def axes(self) -> np.ndarray:
        """(3, 3): file = axes @ world."""
        return AXES_Y_UP if self.y_up else np.eye(3)

    @property
    def angle_unit(self) -> str:
        return "deg" if self.degrees else "rad"

    def columns(self, model: ArticulatedModel) -> list[int]:
        """Indices of the landmarks. Raises UnknownNameError."""
        return [model.landmark_index(name) for name in self.landmarks or model.landmark_names]

    def labels(self, model: ArticulatedModel) -> tuple[str, ...]:
        """Names of the landmarks in the file."""
        names = self.landmarks or model.landmark_names
        return tuple(MARKER_OF_LANDMARK.get(name, name) for name in names) if self.openpose_names else tuple(names)
