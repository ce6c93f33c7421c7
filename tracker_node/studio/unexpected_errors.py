"""What an endpoint has not foreseen: a sentence for the page, and one for the terminal."""

from __future__ import annotations

from collections.abc import Callable

from starlette.types import ASGIApp, Message, Receive, Scope, Send

from .endpoints import Answer


class UnexpectedErrors:
    """ASGI middleware that answers errors without a handler by status 500 with a sentence, as a user's mistakes are answered.

    Parameters
    ----------
    tell : is given each error, once.
    """

    def __init__(self, app: ASGIApp, tell: Callable[[Exception], object]):
        self._app, self._tell = app, tell

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        begun = False

        async def noticed(message: Message) -> None:
            nonlocal begun
            begun = True
            await send(message)

        try:
            await self._app(scope, receive, noticed)
        except Exception as error:
            self._tell(error)
            if scope["type"] == "http" and not begun:
                sentence = f"an error inside the studio ({type(error).__name__}): its terminal says more"
                await Answer({"error": sentence}, status_code=500)(scope, receive, send)
