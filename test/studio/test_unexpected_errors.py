"""An endpoint that fails in a way that nobody has foreseen: a sentence for the page, the error for the terminal."""

import asyncio
import json

from tracker_node.studio.endpoints import get
from tracker_node.studio.server import Access, make_app
from tracker_node.studio.session import StudioFiles, StudioSession, open_session


def failing(session: StudioSession):
    return [get("/api/failing", lambda: [].index(3))]


def answer(app, path: str, access: Access) -> tuple[int, dict]:
    headers = [(b"host", f"127.0.0.1:{access.port}".encode()), (b"cookie", f"{access.cookie}={access.token}".encode())]
    scope = {"type": "http", "method": "GET", "path": path, "query_string": b"", "headers": headers, "http_version": "1.1"}
    sent = []

    async def receive():
        return {"type": "http.request", "body": b""}

    async def send(message):
        sent.append(message)

    asyncio.run(app(scope, receive, send))
    body = b"".join(message.get("body", b"") for message in sent)
    return sent[0]["status"], json.loads(body)


def test_the_page_gets_a_sentence_and_the_terminal_the_error():
    told, access = [], Access(1234, "token")
    session = open_session(StudioFiles())
    with session.closing:
        app = make_app(session, access, [failing], told.append)
        status, said = answer(app, "/api/failing", access)
    assert status == 500
    assert said == {"error": "an error inside the studio (ValueError): its terminal says more"}
    assert [type(error) for error in told] == [ValueError]
