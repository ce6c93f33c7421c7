"""Names of cameras from other programs' files."""

from __future__ import annotations

import re


def identifier(name: str) -> str:
    """A name that can be part of a topic: ``0`` becomes ``cam_0``."""
    name = re.sub(r"\W", "_", name, flags=re.ASCII)
    return name if name.isidentifier() else f"cam_{name}"
