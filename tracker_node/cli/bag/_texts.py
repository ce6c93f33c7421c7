"""Texts that the sub-verbs of ``bag`` share."""

from __future__ import annotations

from datetime import UTC, datetime


def time_text(stamp_ns: int) -> str:
    """A time as people write it (UTC), or as seconds where no year comes out of it."""
    try:
        return f"{datetime.fromtimestamp(stamp_ns // 10**9, UTC):%Y-%m-%d %H:%M:%S} UTC"
    except (ValueError, OverflowError, OSError):
        return f"{stamp_ns * 1e-9:.3f} s"
