"""Fixtures of the tests that draw."""

from collections.abc import Iterator

import pytest

from tracker_node.render.opengl.renderer import PyrenderRenderer, RendererError


@pytest.fixture(scope="module")
def renderer() -> Iterator[PyrenderRenderer]:
    """The renderer on OpenGL, opened."""
    try:
        opened = PyrenderRenderer()
    except RendererError as error:
        pytest.skip(str(error))  # says what to install
    with opened:
        yield opened
