"""OpenGL without a display: on which platform, and what to say to a user who has none.

Traps that this module deals with: pyrender's platform is chosen before its first import, by an environment variable; and closing
one of its EGL contexts would end the display that all contexts of the process share.
"""

from __future__ import annotations

import ctypes
import os
from typing import Any

from ...errors import TrackerError

_PLATFORMS = (("egl", ("libEGL.so.1",)), ("osmesa", ("libOSMesa.so.8", "libOSMesa.so.6", "libOSMesa.so")))
_INSTALL = (
    "install a software OpenGL: sudo apt-get install libegl1 libgl1-mesa-dri libgl1 (or libosmesa6 with"
    " PYOPENGL_PLATFORM=osmesa); the ray-caster needs none (renderer 'raycaster')"
)


class RendererError(TrackerError):
    """No OpenGL to render with."""


def platform() -> str:
    """PyOpenGL's name of the platform to draw on without a display: what the environment says, else what is installed."""
    if "PYOPENGL_PLATFORM" in os.environ:
        return os.environ["PYOPENGL_PLATFORM"]
    for name, libraries in _PLATFORMS:
        for library in libraries:
            try:
                ctypes.CDLL(library)
            except OSError:
                continue
            return name
    return "egl"


def import_pyrender() -> Any:
    """The module ``pyrender``, on a platform that needs no display.

    Raises
    ------
    RendererError : PyOpenGL finds no library for the platform.
    """
    os.environ["PYOPENGL_PLATFORM"] = name = platform()
    try:
        import pyrender
    except Exception as error:  # PyOpenGL raises many kinds, and all mean the same to a user
        raise RendererError(f"pyrender cannot start with PYOPENGL_PLATFORM={name} ({_line(error)}); {_INSTALL}") from None
    return pyrender


class OpenGLContext:
    """An OpenGL context with pyrender's renderer. Close it with `close`, and use it on the thread that made it.

    Attributes
    ----------
    pyrender : the module.
    offscreen : its ``OffscreenRenderer``.
    """

    def __init__(self):
        self.pyrender = import_pyrender()
        try:
            self.offscreen = self.pyrender.OffscreenRenderer(64, 64)
        except Exception as error:
            raise RendererError(
                f"no OpenGL context with PYOPENGL_PLATFORM={platform()} ({_line(error)}); {_INSTALL}"
            ) from None  # fmt: skip

    @property
    def is_open(self) -> bool:
        return self.offscreen is not None

    def close(self) -> None:
        """Free what the context holds."""
        if not self.is_open:
            return
        egl = self.offscreen._platform
        if hasattr(egl, "_egl_display"):
            from OpenGL.EGL import eglDestroyContext

            egl.make_current()
            self.offscreen._renderer.delete()
            eglDestroyContext(egl._egl_display, egl._egl_context)
            egl._egl_display = None  # so that pyrender does not end the display, which other contexts use
            self.offscreen._renderer = self.offscreen._platform = None
        else:
            self.offscreen.delete()
        self.offscreen = None


def _line(error: Exception) -> str:
    """An error in one line."""
    text = str(error).strip().splitlines()
    return f"{type(error).__name__}: {text[0]}" if text else type(error).__name__
