"""Message classes by name, and quality of service as bags state it."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

from ..errors import TrackerError
from ..loaders.bag.metadata import OfferedQos


def message_class(type_name: str) -> Any:
    """Class of a type such as ``sensor_msgs/msg/Image``.

    Raises
    ------
    TrackerError : its package is not installed, or has no such type.
    """
    package, _, rest = type_name.partition("/")
    kind, _, name = rest.partition("/")
    try:
        return getattr(import_module(f"{package}.{kind}"), name)
    except (ImportError, AttributeError, TypeError, ValueError) as error:  # a name without a package is a TypeError
        raise TrackerError(f"message type '{type_name}' cannot be used here: {error}") from None


def qos_profile(offered: OfferedQos) -> QoSProfile:
    """Profile to publish or subscribe with."""
    return QoSProfile(
        reliability=ReliabilityPolicy.BEST_EFFORT if offered.reliability == "best_effort" else ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if offered.durability == "transient_local" else DurabilityPolicy.VOLATILE,
        history=HistoryPolicy.KEEP_ALL if offered.history == "keep_all" else HistoryPolicy.KEEP_LAST,
        depth=max(1, offered.depth),
    )


def offered_qos(profiles: list[QoSProfile], depth: int = 10) -> OfferedQos:
    """The weakest of what several publishers offer: who asks for it gets the messages of all of them.

    ``depth`` stands in where a publisher's depth is not known from outside, which is the rule.
    """
    reliable = all(p.reliability != ReliabilityPolicy.BEST_EFFORT for p in profiles)
    latched = bool(profiles) and all(p.durability == DurabilityPolicy.TRANSIENT_LOCAL for p in profiles)
    return OfferedQos(
        reliability="reliable" if reliable else "best_effort",
        durability="transient_local" if latched else "volatile",
        history="keep_all" if profiles and all(p.history == HistoryPolicy.KEEP_ALL for p in profiles) else "keep_last",
        depth=max([depth, *(p.depth for p in profiles)]),
    )
