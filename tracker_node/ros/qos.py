"""Quality of service of every topic, and the transport settings that images at rate need.

Messages that never came to a subscription, by the numbers that publishers give theirs.
"""

from __future__ import annotations

import inspect
import os
from collections.abc import Callable, MutableMapping
from copy import copy
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy, qos_profile_sensor_data
from rclpy.qos_overriding_options import QoSOverridingOptions

from ..loaders.bag.metadata import OfferedQos
from ..loaders.fetched_files import data_file

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


def images_subscribed(lossless: bool) -> QoSProfile:
    """Profile to subscribe to images with: every image in order where lossless, else the newest as they come."""
    return images_published(100) if lossless else LIVE_IMAGES


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


_POLICIES = {"reliable": "reliability", "transient local": "durability", "deadline": "deadline", "liveliness": "liveliness"}


def policy_of(reason: str) -> str:
    """The policy that `qos_check_compatible` speaks of, by which two ends of a topic do not match."""
    said = reason.lower()
    return next((policy for word, policy in _POLICIES.items() if word in said), "quality of service")


def use_fastdds_profile(environment: MutableMapping[str, str] = os.environ) -> str:
    """Name our transport profile in the environment unless the user named one; call it before ``rclpy.init``.

    Only when discovery is limited to this machine is UDP bound to the loopback. Returns the profile in use.
    """
    if not environment.get(PROFILE_VARIABLE):
        local = environment.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper() == "LOCALHOST"
        name = "fastdds_profile_localhost.xml" if local else "fastdds_profile.xml"
        environment[PROFILE_VARIABLE] = str(data_file(f"config/{name}"))
    return environment[PROFILE_VARIABLE]


def with_number(callback: Callable[[Any, int | None], None]) -> Callable[..., None]:
    """A subscription's callback that also gets the number of the message, None where the middleware does not give one."""
    return _with_info(callback, "publication_sequence_number")


def with_source_stamp(callback: Callable[[Any, int | None], None]) -> Callable[..., None]:
    """A subscription's callback that also gets the time of sending [ns], None where the middleware does not know it."""
    return _with_info(callback, "source_timestamp")


def _with_info(callback: Callable[[Any, int | None], None], key: str) -> Callable[..., None]:
    """A callback that is also given one of the things that the middleware knows of a message.

    rclpy hands over what it knows of a message when a callback takes two arguments: as two by the usual executors, but as one
    pair by the events executor of Jazzy.
    """

    def receive(*received: Any) -> None:
        message, info = received if len(received) == 2 else received[0]
        callback(message, info.get(key))

    two = [inspect.Parameter(name, inspect.Parameter.POSITIONAL_ONLY) for name in ("message", "info")]
    receive.__signature__ = inspect.Signature(two)  # type: ignore[attr-defined]
    return receive


class SequenceGaps:
    """Counts what one subscription has missed.

    A publisher numbers its messages one by one, but they do not say which publisher they are of. A number goes on from the
    nearest one below it that is a publisher's latest; or it is the first of a publisher that has not been heard of yet, and what
    that sent before was not for us. One that takes the place of another, as the only one, and has sent more than that by then
    is taken for it, and the numbers between count as lost.

    Parameters
    ----------
    publishers : how many there are now.

    Attributes
    ----------
    lost : messages so far, which never become fewer.
    """

    def __init__(self, publishers: Callable[[], int]):
        self._publishers = publishers
        self._latest: list[int] = []  # of each publisher, that heard of last at the end
        self.lost = 0

    def came(self, number: int | None) -> None:
        """A message with this number."""
        if number is None:
            return
        if number - 1 not in self._latest:
            self._look(number)
        else:
            self._latest.remove(number - 1)
        self._latest.append(number)

    def _look(self, number: int) -> None:
        """What a number means that does not follow on another."""
        n_publishers = max(1, self._publishers())
        del self._latest[:-n_publishers]  # of those that have left
        before = max((latest for latest in self._latest if latest < number), default=None)
        if before is not None and len(self._latest) == n_publishers:
            self.lost += number - before - 1
            self._latest.remove(before)
