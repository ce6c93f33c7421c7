"""builtin_interfaces/Time and integer nanoseconds."""

from __future__ import annotations

from builtin_interfaces.msg import Time

NS_PER_S = 1_000_000_000


def stamp_message(stamp_ns: int) -> Time:
    """Time of integer nanoseconds (negative ones too: nanosec is never negative)."""
    seconds, nanoseconds = divmod(int(stamp_ns), NS_PER_S)
    return Time(sec=seconds, nanosec=nanoseconds)


def stamp_ns_of(stamp: Time) -> int:
    """Integer nanoseconds of a Time."""
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)
