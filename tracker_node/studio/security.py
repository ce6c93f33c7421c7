"""Who may talk to the studio: only pages that it has served itself, opened by whoever started it.

A server on the loopback is still in reach of every page that the same browser shows. Three checks keep them out: the Host must be
this machine's (DNS rebinding), the Origin this server's (cross-site requests and WebSockets), and a random token, which only the
address on the terminal has, must have become a cookie (other people and programs on the machine).
"""

from __future__ import annotations

import hmac
from dataclasses import dataclass
from html import escape
from urllib.parse import parse_qs, urlencode

from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.responses import HTMLResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

MOST_BODY_BYTES = 16 * 2**20
_SAFE_METHODS = ("GET", "HEAD")
_HOSTS = ("127.0.0.1", "localhost", "[::1]")
_HEADERS = {
    "Content-Security-Policy": "default-src 'self'; img-src 'self' blob: data:; frame-ancestors 'none'; base-uri 'none';"
    " form-action 'none'; object-src 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
}


@dataclass(frozen=True)
class Access:
    """What a request must show: the port that is served, and the token of this start."""

    port: int
    token: str

    @property
    def hosts(self) -> tuple[str, ...]:
        """Values of the header Host that are ours; a browser leaves out port 80."""
        named = tuple(f"{host}:{self.port}" for host in _HOSTS)
        return named + _HOSTS if self.port == 80 else named

    @property
    def cookie(self) -> str:
        """Cookies are shared by all ports of a host, so the port is in the name."""
        return f"studio_{self.port}"

    @property
    def start_url(self) -> str:
        return f"http://127.0.0.1:{self.port}/?{urlencode({'token': self.token})}"

    def is_token(self, text: str) -> bool:
        return hmac.compare_digest(text.encode(), self.token.encode())

    def problem(self, connection: HTTPConnection) -> str:
        """Why a request or a WebSocket is refused, in words; empty for one that is ours, its token aside."""
        host, origin = connection.headers.get("host", ""), connection.headers.get("origin")
        if host not in self.hosts:
            return f"the studio answers to {self.hosts[0]} only, not to the host '{host}'"
        safe = connection.scope["type"] == "http" and connection.scope["method"] in _SAFE_METHODS
        if origin is None and safe:
            return ""
        if origin != f"http://{host}":
            return f"expected a request from a page of the studio, got the origin '{origin}'"
        return ""


class OnlyOwnPages:
    """ASGI middleware that refuses whatever `Access` does not allow, and puts the headers of a closed page on every answer."""

    def __init__(self, app: ASGIApp, access: Access):
        self._app, self._access = app, access

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        refusal = self._refusal(HTTPConnection(scope))
        if scope["type"] == "websocket":
            if refusal is not None:
                await receive()  # the handshake
                await send({"type": "websocket.close", "code": 1008})  # before it is accepted: the browser sees a 403
                return
            await self._app(scope, receive, send)
            return
        answer: ASGIApp = refusal if refusal is not None else self._app
        await answer(scope, receive, _closed(send))

    def _refusal(self, connection: HTTPConnection) -> Response | None:
        access = self._access
        problem = access.problem(connection)
        if problem:
            return PlainTextResponse(problem, 403)
        length = connection.headers.get("content-length", "0")
        bounded = length.isdecimal() and len(length) < 12 and int(length) <= MOST_BODY_BYTES
        if not bounded or "transfer-encoding" in connection.headers:
            return PlainTextResponse(f"expected a body of known length, of at most {MOST_BODY_BYTES} bytes", 413)
        offered = parse_qs(connection.scope["query_string"].decode("latin-1")).get("token", [])
        if connection.scope["type"] == "http" and any(map(access.is_token, offered)):
            return self._let_in(connection)
        if not access.is_token(connection.cookies.get(access.cookie, "")):
            return PlainTextResponse("open the studio by the whole address that `tracker_node studio` has printed", 403)
        return None

    def _let_in(self, connection: HTTPConnection) -> Response:
        """The cookie, and on to the same page without the token in its address.

        By a page, not by a redirect: a browser that comes from another site would not send a strict cookie along with that.
        """
        path = escape("/" + connection.url.path.lstrip("/"), quote=True)
        head = f'<meta http-equiv="refresh" content="0;url={path}"><link rel="icon" href="data:,"><title>studio</title>'
        response = HTMLResponse(f"<!doctype html>{head}")
        response.set_cookie(self._access.cookie, self._access.token, httponly=True, samesite="strict", path="/")
        return response


def _closed(send: Send) -> Send:
    async def with_headers(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in _HEADERS.items():
                headers[name] = value
            headers.setdefault("Cache-Control", "no-store")
        await send(message)

    return with_headers
