"""Fixtures of the tests on a real graph."""

from ros_processes import start

__all__ = ["start"]
