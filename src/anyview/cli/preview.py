"""Live views of cameras in a browser: MJPEG over HTTP, on the loopback interface only."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from time import sleep
from typing import Any

import cv2

from anyview.cli.cameras import Camera
from anyview.runtime.errors import AnyviewError

_FRAMES_PER_SECOND = 10
_WIDTH = 640
_PAGE = """<!doctype html><meta charset="utf-8"><title>anyview record</title>
<style>body{{margin:2rem;font-family:sans-serif;background:#111;color:#eee}}
figure{{display:inline-block;margin:0 1rem 1rem 0}}</style>
{figures}"""
_FIGURE = (
    '<figure><img src="/{index}.mjpg" alt="view of camera {name}"><figcaption>{name}</figcaption></figure>'
)


@contextmanager
def serving(cameras: Sequence[Camera], port: int = 0) -> Iterator[str]:
    """Serve the live views at the address that is yielded; ``port`` 0 takes a free one."""

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            # A page elsewhere whose name was made to point here must not see the room.
            if self.headers.get("Host", "").rpartition(":")[0] not in ("127.0.0.1", "localhost"):
                self.send_error(403)
            elif self.path == "/":
                figures = "\n".join(_FIGURE.format(index=i, name=c.name) for i, c in enumerate(cameras))
                self._begin("text/html; charset=utf-8")
                self.wfile.write(_PAGE.format(figures=figures).encode())
            elif self.path in (f"/{index}.mjpg" for index in range(len(cameras))):
                self._begin("multipart/x-mixed-replace; boundary=frame")
                with suppress(ConnectionError):  # the browser went away
                    self._stream(cameras[int(self.path[1:-5])])
            else:
                self.send_error(404)

        def _begin(self, kind: str) -> None:
            self.send_response(200)
            self.send_header("Content-Type", kind)
            self.send_header("Cache-Control", "no-store")
            self.end_headers()

        def _stream(self, camera: Camera) -> None:
            while not stopping.is_set():
                picture = jpeg(camera)
                self.wfile.write(b"--frame\r\nContent-Type: image/jpeg\r\n")
                self.wfile.write(b"Content-Length: %d\r\n\r\n%s\r\n" % (len(picture), picture))
                sleep(1 / _FRAMES_PER_SECOND)

        def log_message(self, format: str, *args: Any) -> None:
            """Keep requests off the terminal."""

    stopping = threading.Event()
    try:
        server = ThreadingHTTPServer(("127.0.0.1", port), Handler)
    except OSError as error:
        raise AnyviewError(f"--port {port}: {error.strerror}; choose another, or 0 for a free one") from None
    with server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            stopping.set()
            server.shutdown()


def jpeg(camera: Camera) -> bytes:
    """The newest frame, at most 640 pixels wide."""
    picture = cv2.cvtColor(camera.newest()[0], cv2.COLOR_RGB2BGR)
    height, width = picture.shape[:2]
    if width > _WIDTH:
        picture = cv2.resize(picture, (_WIDTH, height * _WIDTH // width), interpolation=cv2.INTER_AREA)
    return cv2.imencode(".jpg", picture)[1].tobytes()
