"""Only the studio's own pages are answered: other hosts, origins and paths are not, nor whoever lacks the token."""

import asyncio
import http.client
import json
from urllib.parse import urlsplit

import pytest
from starlette.websockets import WebSocket

from helpers.cameras.small_clip import make_clip
from helpers.studio.studio_process import running_studio
from tracker_node.studio.endpoints import Answer
from tracker_node.studio.server import Access, OnlyOwnPages


class Client:
    """Requests as they are, byte by byte: nothing is mended on the way."""

    def __init__(self, url):
        parts = urlsplit(url)
        self.host, self.token = parts.netloc, parts.query.split("token=")[1]
        self.cookie = f"studio_{parts.port}={self.token}"

    def ask(self, path, method="GET", body=None, **headers):
        named = {"Host": self.host, "Cookie": self.cookie}
        named |= {name.replace("_", "-"): value for name, value in headers.items()}
        connection = http.client.HTTPConnection("127.0.0.1", int(self.host.split(":")[1]), timeout=30)
        try:
            connection.putrequest(method, path, skip_host=True)
            for name, value in named.items():
                if value is not None:
                    connection.putheader(name, value)
            if body is not None and "Content-Length" not in named:
                connection.putheader("Content-Length", str(len(body)))
            connection.endheaders(body)
            response = connection.getresponse()
            return response.status, response.read().decode(errors="replace"), response.headers
        finally:
            connection.close()

    def post(self, path, values, **headers):
        named = {"Origin": f"http://{self.host}", "Content_Type": "application/json", **headers}
        return self.ask(path, "POST", json.dumps(values).encode(), **named)


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    clip = make_clip(tmp_path_factory.mktemp("studio"), n_images=2)
    with running_studio("--rig", clip.rig_file, "--model", clip.model_file, "--folder", clip.folder / "poses") as studio:
        yield Client(studio.url)


def test_own_pages_are_answered_and_closed_to_others(client):
    status, text, headers = client.ask("/pose.html")
    assert status == 200 and "<title>Pose" in text
    assert headers["Content-Security-Policy"].startswith("default-src 'self'") and "frame-ancestors 'none'" in headers[
        "Content-Security-Policy"
    ]
    assert headers["X-Content-Type-Options"] == "nosniff" and headers["Cross-Origin-Resource-Policy"] == "same-origin"


def test_the_token_becomes_a_cookie(client):
    status, text, headers = client.ask(f"/playback.html?token={client.token}", Cookie=None)
    assert status == 200 and client.token not in text and "url=/playback.html" in text
    cookie = headers["Set-Cookie"].lower()
    assert "samesite=strict" in cookie and "httponly" in cookie
    for cookie in (None, f"studio_1={client.token}", client.cookie[:-1], client.cookie + "x"):
        status, text, _ = client.ask("/", Cookie=cookie)
        assert status == 403 and client.token not in text
    assert client.ask("/?token=guessed", Cookie=None)[0] == 403


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "localhost.evil.example:80", "0.0.0.0:{port}", ""])
def test_other_hosts_are_refused(client, host):
    status, text, _ = client.ask("/api/session", Host=host.format(port=client.host.split(":")[1]))
    assert status == 403 and "answers to" in text


def test_localhost_is_this_machine(client):
    assert client.ask("/", Host=client.host.replace("127.0.0.1", "localhost"))[0] == 200


ORIGINS = ["http://evil.example", "null", "https://{host}", "http://127.0.0.1:1", "http://localhost:{port}", None]


@pytest.mark.parametrize("origin", ORIGINS)
def test_other_origins_change_nothing(client, origin):
    origin = origin and origin.format(host=client.host, port=client.host.split(":")[1])
    values = [0.0, 0.0, 0.4, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    status, text, _ = client.post("/api/pose/save", {"name": "stolen", "values": values, "set": 0}, Origin=origin)
    assert status == 403 and "origin" in text
    assert json.loads(client.ask("/api/pose/names")[1]) == {"names": []}
    if origin:
        assert client.ask("/api/session", Origin=origin)[0] == 403


@pytest.mark.parametrize(
    "path",
    ["/../server.py", "/%2e%2e/server.py", "/..%2fserver.py", "/....//server.py", "//etc/passwd", "/web/../../session.py",
     "/%2e%2e%5cserver.py", "/..%c0%afserver.py", "/pose.html/../../server.py", "/%00", "/images/../server.py",
     "/images/..%2f..%2f/0", "/images/cam01/../../server.py"],
)  # fmt: skip
def test_no_path_leads_out_of_the_folder(client, path):
    status, text, _ = client.ask(path)
    assert status in (400, 404) and "import" not in text and "root:" not in text


def test_images_are_not_kept_for_another_studio_on_the_same_port(client):
    status, _, headers = client.ask("/images/cam01/0")
    assert status == 200 and headers["Content-Type"] == "image/jpeg" and headers["Vary"] == "Cookie"
    assert client.ask("/api/session")[2]["Cache-Control"] == "no-store"


def test_bodies_are_bounded_and_checked(client):
    huge = {"Origin": f"http://{client.host}", "Content_Length": str(10**9)}
    assert client.ask("/api/pose/show", "POST", b"{}", **huge)[0] == 413
    assert client.ask("/api/pose/show", "POST", None, Origin=f"http://{client.host}", Transfer_Encoding="chunked")[0] == 413
    for values, said in (
        ([], "a JSON object"),
        ({"values": "x"}, "values"),
        ({"values": [1.0]}, "9 numbers"),
        ({"values": [float("nan")] * 9}, "values"),
        ({"values": [0.0] * 9, "more": 1}, "more"),
    ):
        status, text, _ = client.post("/api/pose/show", values)
        assert status == 400 and said in json.loads(text)["error"], text
    assert client.ask("/api/pose/show", "POST", b"{]", Origin=f"http://{client.host}")[0] == 400


@pytest.mark.parametrize(
    ("path", "values", "said"),
    [
        ("/images/cam01/0?shrink=" + 5000 * "1", None, "shrink"),
        ("/images/cam01/" + 5000 * "1", None, "image"),
        ("/api/playback/images/cam01/" + 5000 * "1", None, "image"),
        ("/api/pose/show", {"values": [], "\ud800": 1}, "a JSON object"),
        ("/api/live/service", {"tracker": "\ud800", "service": "reset"}, "a JSON object"),
    ],
)
def test_what_cannot_be_read_is_refused_in_words(client, path, values, said):
    status, text, _ = client.ask(path) if values is None else client.post(path, values)
    assert status == 400 and said in json.loads(text)["error"], text


def test_names_that_are_no_unicode_are_told():
    assert json.loads(Answer({"error": "no file 'a\udcff.yaml'"}).body) == {"error": "no file 'a\udcff.yaml'"}


def test_mistakes_are_one_sentence(client):
    for path, said in (("/images/cam09/0", "cam01"), ("/images/cam01/9", "[0, 1]"), ("/images/cam01/0?shrink=0", "shrink")):
        status, text, _ = client.ask(path)
        assert status == 400 and said in json.loads(text)["error"]
    status, text, _ = client.ask("/api/playback/run")
    assert status == 400 and "--run" in json.loads(text)["error"]


@pytest.mark.parametrize(
    ("headers", "accepted"),
    [
        ({"host": "127.0.0.1:9", "origin": "http://127.0.0.1:9", "cookie": "studio_9=secret"}, True),
        ({"host": "127.0.0.1:9", "origin": "http://evil.example", "cookie": "studio_9=secret"}, False),
        ({"host": "127.0.0.1:9", "cookie": "studio_9=secret"}, False),
        ({"host": "evil.example", "origin": "http://evil.example", "cookie": "studio_9=secret"}, False),
        ({"host": "127.0.0.1:9", "origin": "http://127.0.0.1:9"}, False),
    ],
)
def test_sockets_of_others_are_not_accepted(headers, accepted):
    async def application(scope, receive, send):
        await WebSocket(scope, receive, send).accept()

    sent = []

    async def send(message):
        sent.append(message["type"])

    async def receive():
        return {"type": "websocket.connect"}

    scope = {
        "type": "websocket", "path": "/", "query_string": b"token=secret", "subprotocols": [],
        "headers": [(name.encode(), value.encode()) for name, value in headers.items()],
    }  # fmt: skip
    asyncio.run(OnlyOwnPages(application, Access(9, "secret"))(scope, receive, send))
    assert sent == (["websocket.accept"] if accepted else ["websocket.close"])
