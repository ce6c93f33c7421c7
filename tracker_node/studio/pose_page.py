"""The page on which a body is posed by hand."""

from __future__ import annotations

from collections.abc import Sequence

from starlette.routing import BaseRoute

from .session import StudioSession


def routes(session: StudioSession) -> Sequence[BaseRoute]:
    """Below ``/api/pose/``."""
    return ()
