"""Quality of service of every topic, and the transport settings that images at rate need."""

from __future__ import annotations

import os
import sys
from collections.abc import MutableMapping
from copy import copy
from pathlib import Path
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.qos_overriding_options import QoSOverridingOptions

from ..loaders.bag.metadata import OfferedQos

PROFILE_VARIABLE = "FASTRTPS_DEFAULT_PROFILES_FILE"

RESULT = QoSProfile(depth=100, reliability=ReliabilityPolicy.RELIABLE)
"""Messages that nobody wants to miss: poses, states, masks, calibrations, diagnostics.

The depth is for a recorder on a busy machine: a reliable writer forgets what is older, delivered or not.
"""

LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Sent to subscribers that come later, too: robot_description."""

SENSOR = qos_profile_sensor_data
"""What a viewer of live images asks for: the newest, none of them twice."""

LIVE_IMAGES = QoSProfile(depth=30, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.BEST_EFFORT)
"""What a live tracker asks for: a second of images; it leaves out itself what is older than the newest."""


def images_published(depth: int = 10) -> QoSProfile:
    """Images of a camera: reliable, so that any consumer may choose (REP-2003)."""
    return QoSProfile(depth=depth, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)


def images_subscribed(lossless: bool, depth: int = 100) -> QoSProfile:
    """Profile to subscribe to images with.

    Parameters
    ----------
    lossless : every image in order; else the newest as they come.
    depth : of the queue where lossless.

    Returns
    -------
    profile : of rclpy.
    """
    return images_published(depth) if lossless else LIVE_IMAGES


def qos_profile(offered: OfferedQos) -> QoSProfile:
    """Profile to publish or subscribe with."""
    return QoSProfile(
        reliability=ReliabilityPolicy.BEST_EFFORT if offered.reliability == "best_effort" else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if offered.durability == "transient_local" else DurabilityPolicy.VOLATILE,
        history=HistoryPolicy.KEEP_ALL if offered.history == "keep_all" else HistoryPolicy.KEEP_LAST,
        depth=max(1, offered.depth),
    )


def offered_qos(profiles: list[QoSProfile], depth: int = 10) -> OfferedQos:
    """The weakest of the profiles of several publishers: a subscription with it gets the messages of all of them.

    Parameters
    ----------
    profiles : of the publishers.
    depth : in place of unknown ones; usually none is known from outside.

    Returns
    -------
    offered : as bags state it.
    """
    reliable = all(p.reliability != ReliabilityPolicy.BEST_EFFORT for p in profiles)
    latched = bool(profiles) and all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
    return OfferedQos(
        reliability="reliable" if reliable else "best_effort",
        durability="transient_local" if latched else "volatile",
        history="keep_all" if profiles and all(p.history == HistoryPolicy.KEEP_ALL for p in profiles) else "keep_last",
        depth=max([depth, *(p.depth for p in profiles)]),
    )


def overridable(qos: QoSProfile) -> dict[str, Any]:
    """Arguments of ``create_publisher`` or ``create_subscription``: a profile that parameters ``qos_overrides.<topic>`` change.

    rclpy writes what they say into the profile, so it is a copy.
    """
    return {"qos_profile": copy(qos), "qos_overriding_options": QoSOverridingOptions.with_default_policies()}


def policy_name(kind: int) -> str:
    """The name of a policy in an event of incompatible quality of service."""
    return QoSPolicyKind(kind).name.lower()


def config_file(name: str) -> Path:
    """A file of this package's ``config`` folder, in a source tree or installed.

    Raises
    ------
    FileNotFoundError : naming the places that were searched.
    """
    places = [Path(__file__).resolve().parents[2] / "config"]
    prefixes = [*os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep), sys.prefix]
    places += [Path(prefix) / "share" / "tracker_node" / "config" for prefix in prefixes if prefix]
    for place in places:
        if (place / name).is_file():
            return place / name
    raise FileNotFoundError(f"'{name}' is in none of {', '.join(str(place) for place in places)}")


def use_fastdds_profile(environment: MutableMapping[str, str] = os.environ) -> str:
    """Name our transport profile in the environment unless the user named one; call it before ``rclpy.init``.

    Only when discovery is limited to this machine is UDP bound to the loopback. Returns the profile in use.
    """
    if not environment.get(PROFILE_VARIABLE):
        local = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper() == "LOCALHOST"
        name = "fastdds_profile_localhost.xml" if local else "fastdds_profile.xml"
        environment[PROFILE_VARIABLE] = str(config_file(name))
    return environment[PROFILE_VARIABLE]
