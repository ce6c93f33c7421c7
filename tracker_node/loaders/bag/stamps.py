"""builtin_interfaces/Time and integer nanoseconds."""

from __future__ import annotations

from typing import Any

NS_PER_S = 1_000_000_000


def time_of(stamp_ns: int) -> dict[str, int]:
    """Fields of the Time; its nanoseconds are never negative, also before 1970."""
    seconds, nanoseconds = divmod(int(stamp_ns), NS_PER_S)
    return {"sec": seconds, "nanosec": nanoseconds}


def stamp_ns_of(stamp: Any) -> int:
    """Integer nanoseconds of a Time, of ROS or of a bag."""
    return int(stamp.sec) * NS_PER_S + int(stamp.nanosec)
