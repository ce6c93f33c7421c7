"""How functions that are called for every pixel are compiled: into their callers, and without counting references.

numba counts the references to arrays whenever they are passed on, by atomic operations that cost five times as much as the
arithmetic of shading a pixel. Without (``_nrt``) a function takes arrays and numbers, and neither makes nor returns arrays or
slices.
"""

from __future__ import annotations

from typing import Any

import numba as nb

_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "_nrt": False}

pixel_function: Any = nb.njit(forceinline=True, **_OPTIONS)
"""Decorator of a function at one pixel."""

pixel_loop: Any = nb.njit(**_OPTIONS)
"""Decorator of a kernel that calls such functions pixel by pixel."""
