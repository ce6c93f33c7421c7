"""A network camera on the loopback: JPEG images over HTTP, as web cameras send them, that can be switched off and on again."""

import threading
from collections.abc import Callable
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import cv2
import numpy as np

WIDTH, HEIGHT = 160, 120


def numbered_jpeg(i: int, width: int = WIDTH, height: int = HEIGHT) -> bytes:
    """An image that says its number by its gray level (modulo 20), also when it is made smaller."""
    image = np.full((height, width, 3), 20 + 10 * (i % 20), np.uint8)
    image[: height // 8, : width // 8] = 255
    return cv2.imencode(".jpg", image)[1].tobytes()


def number_of(bgr: np.ndarray) -> int:
    """The number of a `numbered_jpeg`, modulo 20."""
    return round((float(np.median(bgr)) - 20) / 10)


class MjpegServer:
    """Serves ``image(i)`` for i = 0, 1, ... at a rate, to each connection from its own beginning.

    ``pause`` sends nothing any more and keeps connections open, as a camera whose firmware hangs.
    """

    def __init__(self, image: Callable[[int], bytes] = numbered_jpeg, rate_hz: float = 30.0, port: int = 0):
        self.pause = threading.Event()
        self._off = threading.Event()
        server = self

        class Handler(BaseHTTPRequestHandler):
            def log_message(self, *_) -> None:
                pass

            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "multipart/x-mixed-replace; boundary=frame")
                self.end_headers()
                i = 0
                while not server._off.wait(1.0 / rate_hz):
                    if server.pause.is_set():
                        continue
                    data = image(i)
                    head = f"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: {len(data)}\r\n\r\n".encode()
                    try:
                        self.wfile.write(head + data + b"\r\n")
                    except OSError:
                        return
                    i += 1

        self._http = ThreadingHTTPServer(("127.0.0.1", port), Handler)
        self._http.daemon_threads = True
        self.port = self._http.server_address[1]
        self.url = f"http://127.0.0.1:{self.port}/stream"
        threading.Thread(target=self._http.serve_forever, kwargs={"poll_interval": 0.05}, daemon=True).start()

    def close(self) -> None:
        """Switch it off: connections break, new ones are refused."""
        self._off.set()
        self._http.shutdown()
        self._http.server_close()
