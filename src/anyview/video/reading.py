"""Reading the video files and pictures of any camera, by PyAV, which carries its own FFmpeg.

A frame stays as it was decoded until its pixels are asked for: of most cameras' frames few are used.
"""

import math
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import av
import cv2
import numpy as np
from av.container import InputContainer
from av.filter import Graph
from av.video.frame import VideoFrame
from av.video.reformatter import VideoReformatter
from av.video.stream import VideoStream

from anyview.runtime.errors import AnyviewError
from anyview.video.containers import MAX_PIXELS, Damaged, check_container

MAX_RATE = 250.0  # frames a second
# What a camera, a phone or a screen recorder writes. Playlists, which make FFmpeg open other files, are not.
VIDEOS = "avi,mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,mpeg,mpegts,flv,asf,ogg,dv"
PICTURES = "image2,png_pipe,jpeg_pipe,webp_pipe,bmp_pipe,tiff_pipe"
_INDEXED = ("mov", "matroska")  # containers in which a search ends at the right key frame
_SEARCH_FROM = 5.0  # seconds; decoding up to there is as fast


class Frame(NamedTuple):
    """A decoded frame and its time, in seconds after the first frame of its file."""

    time: float
    content: VideoFrame


class Video:
    """An open video file. ``rate``, its frames per second, is measured if it states none that can be."""

    def __init__(self, path: Path, container: InputContainer, stream: VideoStream):
        self.rate = float(stream.guessed_rate or 0)
        if not 0 < self.rate <= MAX_RATE:  # the rate of a clock, perhaps
            self.rate = _measured_rate(container, stream)
        self._path, self._container, self._stream = path, container, stream
        self._clock = stream.time_base or Fraction(1)  # seconds in a unit of its times
        self._reformatter = VideoReformatter()

    def frames(self, begin: float = 0.0) -> Iterator[Frame]:
        """The frames in the order in which they are shown; interlaced ones are deinterlaced.

        Before ``begin``, in seconds after the first frame, only some of the frames come. Raises AnyviewError
        if a frame is damaged, or if the file has fewer frames than it claims.
        """
        origin, needed_from = None, -math.inf
        if begin > _SEARCH_FROM and self._container.format.name.startswith(_INDEXED):
            origin = float((self._stream.start_time or 0) * self._clock)
            needed_from = origin + begin
            self._container.seek(int(needed_from / self._clock), stream=self._stream)
        count, last, step = 0, 0.0, 0.0
        try:
            for content in _deinterlaced(self._stream, self._decoded(needed_from)):
                if origin is None:
                    origin = content.time or 0.0
                # The last frame of an MPEG program stream may have no time.
                time = last + step if content.time is None else content.time - origin
                yield Frame(time, content)
                count, last, step = count + 1, time, time - last
        except (av.FFmpegError, MemoryError):
            self._refuse(count)
        if begin == 0:
            self._check_count(count, last)

    def rgb(self, frame: Frame) -> np.ndarray:
        """A frame as it is to be seen, uint8 RGB (H, W, 3); pixels are taken for square."""
        return np.ascontiguousarray(np.rot90(self._converted(frame), _quarter_turns(frame)))

    def square(self, frame: Frame, size: int) -> np.ndarray:
        """The middle square of what a frame shows, averaged down to uint8 RGB (size, size, 3)."""
        picture = self._converted(frame)
        height, width = picture.shape[:2]
        aspect = float(self._stream.sample_aspect_ratio or 1)  # width of a pixel over its height
        side = min(height, width * aspect)
        rows, columns = max(round(side), 1), max(round(side / aspect), 1)
        top, left = (height - rows) // 2, (width - columns) // 2
        middle = picture[top : top + rows, left : left + columns]
        small = cv2.resize(middle, (size, size), interpolation=cv2.INTER_AREA)
        return np.ascontiguousarray(np.rot90(small, _quarter_turns(frame)))

    def _converted(self, frame: Frame) -> np.ndarray:
        content = frame.content
        if content.format.name in ("bgr0", "bgra"):  # FFV1 of our own; faster than the general way
            rows = np.frombuffer(memoryview(content.planes[0]), np.uint8).reshape(content.height, -1)
            pixels = rows[:, : 4 * content.width].reshape(content.height, content.width, 4)
            return cv2.cvtColor(pixels, cv2.COLOR_BGRA2RGB)
        return self._reformatter.reformat(content, format="rgb24", threads=1).to_ndarray()

    def _decoded(self, needed_from: float) -> Iterator[VideoFrame]:
        """Frames as they are decoded; before ``needed_from``, on the file's clock, they may be damaged."""
        started = False
        count = 0
        for packet in self._container.demux(self._stream):
            # What was cut out of a longer film may begin with frames that build on a lost one.
            started = started or packet.is_keyframe
            if not started:
                continue
            try:
                contents = packet.decode()
            except av.FFmpegError:
                if packet.pts is None or packet.pts * self._clock >= needed_from:
                    raise
                continue
            for content in contents:
                if content.is_corrupt and (content.time is None or content.time >= needed_from):
                    self._refuse(count)
                count += 1
                yield content

    def _refuse(self, count: int) -> None:
        if not count:
            raise AnyviewError(
                f"{self._path}: damaged, or of a codec that is unknown here: no frame can be decoded"
            )
        raise AnyviewError(f"{self._path}: damaged: frame {count + 1} cannot be decoded")

    def _check_count(self, count: int, last: float) -> None:
        """Raise AnyviewError if the file claims more than ``count`` frames, the last at ``last`` seconds."""
        if not count:
            self._refuse(count)
        step = last / max(count - 1, 1)
        seconds = float(self._stream.duration * self._clock) if self._stream.duration else 0.0
        if not seconds and len(self._container.streams) == 1 and self._container.duration:
            seconds = self._container.duration / av.time_base
        # A film that was trimmed without being written anew still has the frames that it does not show.
        claims = [claim for claim in (self._stream.frames, seconds / step if step else 0) if claim]
        claimed = min(claims, default=0)
        if count < claimed - max(2.0, 0.02 * claimed):
            raise AnyviewError(f"{self._path}: damaged: {count} of {claimed:.0f} frames can be decoded")


@contextmanager
def open_video(path: Path, formats: str = VIDEOS) -> Iterator[Video]:
    """Open a video file, or a picture by ``formats``, to be decoded by one thread.

    Raises AnyviewError naming the file if there is none, if it is no such file, or if it was cut short.
    """
    if not path.is_file():
        raise AnyviewError(f"{path}: no such file")
    try:
        check_container(path)
    except Damaged as fault:
        raise AnyviewError(f"{path}: damaged: {fault}") from None
    strict = {"max_pixels": str(MAX_PIXELS), "err_detect": "explode", "strict": "strict"}
    allowed = {"protocol_whitelist": "file", "format_whitelist": formats, "pattern_type": "none"}
    with ExitStack() as stack:
        try:
            # An absolute path cannot be taken for a protocol ("concat:...").
            container = stack.enter_context(
                av.open(str(path.resolve()), options=strict | allowed, metadata_errors="replace")
            )
            stream = next((each for each in container.streams.video if each.codec_context), None)
            if stream is None:
                raise AnyviewError(f"{path}: no video in it, or of a codec that is unknown here")
            width, height = stream.codec_context.width, stream.codec_context.height
            if width < 1 or height < 1 or width * height > MAX_PIXELS:
                raise AnyviewError(f"{path}: damaged: claims a picture of {width} x {height}")
            stream.codec_context.thread_count = 1
            stream.codec_context.options = strict
            video = Video(path, container, stream)
        except (av.FFmpegError, UnicodeError, MemoryError):
            raise AnyviewError(f"{path}: not a video that can be opened") from None
        yield video


def _deinterlaced(stream: VideoStream, contents: Iterator[VideoFrame]) -> Iterator[VideoFrame]:
    """The frames, from the first interlaced one on through a filter that leaves the others as they are."""
    graph: Graph | None = None
    for content in contents:
        if graph is None and content.interlaced_frame:
            graph = Graph()
            graph.threads = 1
            graph.link_nodes(
                graph.add_buffer(template=stream),
                graph.add("bwdif", "mode=send_frame:deint=interlaced"),
                graph.add("buffersink"),
            ).configure()
        if graph is None:
            yield content
        else:
            graph.push(content)
            yield from _pull(graph)
    if graph is not None:
        graph.push(None)
        yield from _pull(graph)


def _pull(graph: Graph) -> Iterator[VideoFrame]:
    while True:
        try:
            yield graph.vpull()
        except (av.BlockingIOError, av.EOFError):
            return


def _measured_rate(container: InputContainer, stream: VideoStream) -> float:
    times = [packet.pts for packet in container.demux(stream) if packet.pts is not None]
    container.seek(0)
    ticks = max(times, default=0) - min(times, default=0)
    return (len(times) - 1) / float(ticks * (stream.time_base or 1)) if ticks else MAX_RATE


def _quarter_turns(frame: Frame) -> int:
    """Counterclockwise turns by 90 degrees that bring a frame upright."""
    return round(frame.content.rotation / 90)
