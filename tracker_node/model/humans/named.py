"""Humans by name: wherever a model file may be named, one of these words may stand."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..articulated import ArticulatedModel
from .human import gait_human, human_model
from .surfaces18 import ellipsoid_human, nurbs_human

HUMANS: Mapping[str, Callable[[], ArticulatedModel]] = {
    "human": human_model,
    "gait_human": gait_human,
    "ellipsoid_human": ellipsoid_human,
    "nurbs_human": nurbs_human,
}
