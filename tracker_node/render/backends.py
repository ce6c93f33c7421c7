"""Renderers by name."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import UnknownNameError
from .raycast.raycaster import RaycastRenderer
from .renderer import Renderer

BACKENDS = ("raycaster", "pyrender")


@contextmanager
def make_renderer(name: str = "raycaster") -> Iterator[Renderer]:
    """The renderer ``name``, one of `BACKENDS`, for a ``with`` statement.

    Raises
    ------
    UnknownNameError : there is no such renderer.
    RendererError : ``pyrender`` finds no OpenGL; the ray-caster needs none.
    """
    if name == "raycaster":
        yield RaycastRenderer()
    elif name == "pyrender":
        from .opengl.renderer import PyrenderRenderer  # PyOpenGL is loaded only where it is wanted

        with PyrenderRenderer() as renderer:
            yield renderer
    else:
        raise UnknownNameError("renderer", name, BACKENDS)
