"""A studio's page of steps, asked over HTTP."""

import http.client
import json
import time
from urllib.parse import urlsplit


class Client:
    """The page's requests."""

    def __init__(self, url: str):
        parts = urlsplit(url.replace("/wizard.html?", "/?"))
        self.host, token = parts.netloc, parts.query.split("token=")[1]
        cookie = f"studio_{parts.port}={token}"
        self.headers = {"Cookie": cookie, "Origin": f"http://{self.host}", "Content-Type": "application/json"}

    def ask(self, path: str, values: dict | None = None):
        """Status, content and headers."""
        connection = http.client.HTTPConnection(self.host, timeout=60)
        try:
            body = None if values is None else json.dumps(values)
            connection.request("GET" if values is None else "POST", path, body, self.headers)
            answer = connection.getresponse()
            return answer.status, answer.read().decode(errors="replace"), answer.headers
        finally:
            connection.close()

    def json(self, path: str, values: dict | None = None, status: int = 200):
        got, text, _ = self.ask(path, values)
        assert got == status, text
        return json.loads(text)

    def step(self, name: str) -> dict:
        return next(step for step in self.json("/api/wizard/steps")["steps"] if step["name"] == name)

    def do(self, step: str, way: str, **values: str) -> dict:
        """Start a step and wait for its end."""
        self.json("/api/wizard/start", {"step": step, "way": way, "values": values})
        for _ in range(1500):
            job = self.json("/api/wizard/job")
            if not job["running"]:
                return job
            time.sleep(0.1)
        raise AssertionError(job)
