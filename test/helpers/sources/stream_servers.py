"""Network cameras on the loopback that send compressed video as an MPEG transport stream: over RTSP, and as UDP packets."""

import socket
import struct
import threading
import time
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np

WIDTH, HEIGHT, RATE_HZ = 160, 120, 25.0
_PACKETS = 7 * 188  # bytes that go together


def write_stream(path: Path, n_images: int = 100) -> bytes:
    """Images whose brightness rises from 20 to 220, noisy enough for several packets each; ``path`` must end in .ts."""
    noise = np.random.default_rng(0).integers(-20, 21, (HEIGHT, WIDTH, 3))
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), RATE_HZ, (WIDTH, HEIGHT))
    for i in range(n_images):
        writer.write((20 + 200 * i // n_images + np.roll(noise, 7 * i, axis=1)).clip(0, 255).astype(np.uint8))
    writer.release()
    return path.read_bytes()


class _Sender:
    """Calls ``send`` with one part of the stream after the other, in its own time, again and again until it is closed."""

    def __init__(self, stream: bytes, n_images: int = 100):
        self.off = threading.Event()
        self._parts = [stream[i : i + _PACKETS] for i in range(0, len(stream), _PACKETS)]
        self._pause_s = n_images / RATE_HZ / len(self._parts)

    def run(self, send) -> None:
        while not self.off.is_set():
            for part in self._parts:
                if self.off.wait(self._pause_s):
                    return
                send(part)


class UdpServer(_Sender):
    """Sends to a port of the loopback, whether anybody listens or not."""

    def __init__(self, stream: bytes, port: int):
        super().__init__(stream)
        self.url = f"udp://127.0.0.1:{port}"
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        threading.Thread(target=self.run, args=(lambda part: self._send(part, port),), daemon=True).start()

    def _send(self, part: bytes, port: int) -> None:
        with suppress(ConnectionRefusedError):
            self._socket.sendto(part, ("127.0.0.1", port))

    def close(self) -> None:
        self.off.set()


class RtspServer(_Sender):
    """RTSP (RFC 2326) with RTP in its own connection; payload 33 is an MPEG transport stream (RFC 3551)."""

    def __init__(self, stream: bytes, port: int = 0):
        super().__init__(stream)
        self._server = socket.create_server(("127.0.0.1", port))
        self.port = self._server.getsockname()[1]
        self.url = f"rtsp://127.0.0.1:{self.port}/camera"
        self._connections: list[socket.socket] = []
        threading.Thread(target=self._accept, daemon=True).start()

    def _accept(self) -> None:
        while True:
            try:
                connection, _ = self._server.accept()
            except OSError:
                return
            self._connections.append(connection)
            threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection: socket.socket) -> None:
        description = "v=0\r\no=- 0 0 IN IP4 127.0.0.1\r\ns=camera\r\nt=0 0\r\nm=video 0 RTP/AVP 33\r\na=control:track0\r\n"
        extra = {
            "OPTIONS": ("Public: OPTIONS, DESCRIBE, SETUP, PLAY, TEARDOWN", ""),
            "DESCRIBE": (f"Content-Base: {self.url}/\r\nContent-Type: application/sdp", description),
            "SETUP": ("Transport: RTP/AVP/TCP;unicast;interleaved=0-1\r\nSession: 1", ""),
            "PLAY": ("Session: 1\r\nRTP-Info: url=track0;seq=0;rtptime=0", ""),
        }
        requests = connection.makefile("rb")
        with suppress(OSError):
            while line := requests.readline():
                verb, sequence = line.split(b" ")[0].decode("ascii", "replace"), b"0"
                while field := requests.readline().strip():
                    if field.lower().startswith(b"cseq:"):
                        sequence = field.split(b":")[1].strip()
                headers, body = extra.get(verb, ("Session: 1", ""))
                answer = f"RTSP/1.0 200 OK\r\nCSeq: {sequence.decode()}\r\n{headers}\r\nContent-Length: {len(body)}\r\n\r\n{body}"
                connection.sendall(answer.encode())
                if verb == "PLAY":
                    threading.Thread(target=self._play, args=(connection,), daemon=True).start()

    def _play(self, connection: socket.socket) -> None:
        began_s, number = time.monotonic(), 0

        def send(part: bytes) -> None:
            nonlocal number
            ticks = int(90_000 * (time.monotonic() - began_s)) & 0xFFFFFFFF
            packet = struct.pack(">BBHII", 0x80, 33, number & 0xFFFF, ticks, 1) + part
            connection.sendall(struct.pack(">cBH", b"$", 0, len(packet)) + packet)
            number += 1

        with suppress(OSError):
            self.run(send)

    def close(self) -> None:
        """Switch it off: connections break, new ones are refused."""
        self.off.set()
        with suppress(OSError):
            self._server.shutdown(socket.SHUT_RDWR)  # else it goes on listening while somebody waits for a connection
        self._server.close()
        for connection in self._connections:
            with suppress(OSError):
                connection.shutdown(socket.SHUT_RDWR)
            connection.close()
