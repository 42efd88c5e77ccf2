"""FFmpeg behind OpenCV: what it may open, and what it says while it decodes."""

import os
import re
import tempfile
import threading
from collections.abc import Iterator
from contextlib import contextmanager

import cv2

# Containers that a camera, a phone or a screen recorder writes. Playlists and image patterns, which make
# FFmpeg open further files, are left out.
_OPTIONS = (
    "protocol_whitelist;file|"
    "format_whitelist;avi,mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,mpeg,mpegts,flv,asf,ogg"
)
_ERROR_LEVEL = "16"  # AV_LOG_ERROR
_MOST = 1 << 20  # bytes of messages that are looked at
_DAMAGE = re.compile(
    r"damaged|error|corrupt|invalid|conceal|truncat|missing|illegal|out of range|not reached", re.I
)
_HARMLESS = re.compile(r"APP fields|co located POCs|mmco", re.I)


class Messages:
    """What FFmpeg said since this object was made."""

    def __init__(self, log: int):
        self._log = log
        self._start = os.fstat(log).st_size

    def damage(self) -> str:
        """The first message that speaks of damaged data, or nothing."""
        for line in os.pread(self._log, _MOST, self._start).decode(errors="replace").splitlines():
            if _DAMAGE.search(line) and not _HARMLESS.search(line):
                return re.sub(r"^(\[[^]]*\] ?)+", "", line).strip()
        return ""


_lock = threading.Lock()
_users = 0
_log = _standard_error = -1  # file descriptors


@contextmanager
def listening() -> Iterator[Messages]:
    """Collect FFmpeg's messages instead of showing them.

    OpenCV returns a damaged frame like any other; only FFmpeg's log, on standard error, tells. So standard
    error is a file for as long as anybody listens. Threads that listen at once hear each other's messages.
    """
    global _log, _users, _standard_error
    _set_environment()
    with _lock:
        if _users == 0:
            with tempfile.TemporaryFile("a+b") as file:
                _log, _standard_error = os.dup(file.fileno()), os.dup(2)
            os.dup2(_log, 2)
        _users += 1
        messages = Messages(_log)
    try:
        yield messages
    finally:
        with _lock:
            _users -= 1
            if _users == 0:
                os.dup2(_standard_error, 2)
                os.close(_standard_error)
                os.close(_log)


def _set_environment() -> None:
    """OpenCV reads these at its first use of FFmpeg, the capture options at each."""
    os.environ["OPENCV_FFMPEG_LOGLEVEL"] = _ERROR_LEVEL
    os.environ["OPENCV_FFMPEG_SKIP_LOG_CALLBACK"] = "1"
    os.environ["OPENCV_FFMPEG_CAPTURE_OPTIONS"] = _OPTIONS
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
