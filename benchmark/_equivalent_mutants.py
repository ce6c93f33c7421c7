"""Faults that change nothing that could be seen, each with its reason: (file, line before, line after)."""

EQUIVALENT: dict[tuple[str, str, str], str] = {}
