"""Routes from plain functions: what is taken, and what is refused."""

import asyncio
import json

import pytest
from starlette.applications import Starlette

from tracker_node.errors import FileFormatError
from tracker_node.loaders.file_model import FileModel
from tracker_node.studio.endpoints import Answer, get, image, json_object, post


class Asked(FileModel):
    name: str
    n: int = 1


class Reply:
    def __init__(self, status_code, headers, content):
        self.status_code, self.headers, self.content = status_code, headers, content

    def json(self):
        return json.loads(self.content)


class Client:
    """Asks an application as a server would."""

    def __init__(self, app):
        self._app = app

    def get(self, path):
        return self._ask("GET", path, b"")

    def post(self, path, json=None):
        return self._ask("POST", path, Answer(json).body)

    def _ask(self, method, path, body):
        path, _, query = path.partition("?")
        sent = []

        async def receive():
            return {"type": "http.request", "body": body, "more_body": False}

        async def send(message):
            sent.append(message)

        scope = {"type": "http", "method": method, "path": path, "query_string": query.encode(), "headers": []}
        asyncio.run(self._app(scope, receive, send))
        headers = {name.decode(): value.decode() for name, value in sent[0]["headers"]}
        return Reply(sent[0]["status"], headers, b"".join(message.get("body", b"") for message in sent[1:]))


class Images:
    def __init__(self):
        self.asked = []

    def jpeg(self, camera, number, shrink):
        self.asked.append((camera, number, shrink))
        return b"picture"


@pytest.fixture
def studio():
    images = Images()
    routes = [
        get("/told", lambda: {"a": [1, None]}),
        post("/said", Asked, lambda asked: {"name": asked.name, "n": asked.n}),
        image("/image/{camera}/{number}", lambda: images),
    ]
    return Client(Starlette(routes=routes)), images


def refused(client, path, field):
    with pytest.raises(FileFormatError) as told:
        client.get(path)
    assert told.value.field == field
    return str(told.value)


def test_a_function_without_arguments_is_a_get(studio):
    client, _ = studio
    assert client.get("/told").json() == {"a": [1, None]} and client.post("/told").status_code == 405
    assert client.get("/told").headers["content-type"] == "application/json"


def test_a_json_object_is_checked_before_it_is_answered(studio):
    client, _ = studio
    assert client.post("/said", json={"name": "a", "n": 3}).json() == {"name": "a", "n": 3}
    assert client.post("/said", json={"name": "a"}).json() == {"name": "a", "n": 1}
    assert client.get("/said").status_code == 405
    for body in ({"n": 3}, {"name": "a", "other": 1}, {"name": "a", "n": "many"}):
        with pytest.raises(FileFormatError):
            client.post("/said", json=body)


@pytest.mark.parametrize("text", ["[1]", "3", "null", "{", b"\xff", '"\\ud800"', '{"a": "\\ud800"}', "[" * 100_000])
def test_anything_but_an_object_is_refused(text):
    with pytest.raises(FileFormatError, match="a JSON object") as told:
        json_object(text)
    assert told.value.field == "(body)" and len(str(told.value)) < 400
    assert json_object('{"a": "\\u00e4"}') == {"a": "ä"} and json_object(b"{}") == {}


def test_answers_are_ascii_and_know_no_nan():
    assert Answer({"a": ["ä\udcff", 1]}).body == b'{"a":["\\u00e4\\udcff",1]}'
    with pytest.raises(ValueError, match="JSON"):
        Answer({"a": float("nan")})


def test_images_by_camera_number_and_shrink(studio):
    client, images = studio
    found = client.get("/image/cam01/0")
    assert found.content == b"picture" and found.headers["content-type"] == "image/jpeg"
    assert found.headers["cache-control"] == "private, max-age=3600" and found.headers["vary"] == "Cookie"
    for query in ("/image/cam02/7?shrink=1", "/image/cam02/1000000000?shrink=16", "/image/cam02/0007?shrink=02"):
        assert client.get(query).status_code == 200
    assert images.asked == [("cam01", 0, 1), ("cam02", 7, 1), ("cam02", 1_000_000_000, 16), ("cam02", 7, 2)]


def test_numbers_out_of_range_are_refused(studio):
    client, images = studio
    for number in ("-1", "1.5", "x", "1000000001", "9" * 5000, "00000000001"):
        assert "a whole number from 0 to 1000000000" in refused(client, f"/image/cam01/{number}", "image")
    for shrink in ("0", "17", "", "-1", "001"):
        assert "a whole number from 1 to 16" in refused(client, f"/image/cam01/1?shrink={shrink}", "shrink")
    assert not images.asked
