"""Structure of video containers: find files that were cut short or altered, which FFmpeg plays all the same.

Covers AVI (RIFF), MP4 and MOV (ISO 14496-12), Matroska and WebM (RFC 9559); of MPEG transport streams, that
their packets are whole. A file of any other container is judged by decoding it. Only headers are read.
"""

import struct
from collections.abc import Iterator
from itertools import count
from pathlib import Path
from typing import BinaryIO

MAX_PIXELS = 4096 * 2304  # of a picture
_MAX_PARTS = 200_000  # of one file; ten minutes of video have a tenth of that
_PACKET = 188  # bytes of a transport stream, the first of each a G


class Damaged(Exception):
    """What is wrong with a file, in a few words."""


def check_container(path: Path) -> float:
    """Raise ``Damaged`` when the file's parts do not add up to the file, or claim an impossible picture.

    Returns the share of its frames that the file says to show: below 1 where it was trimmed without being
    written anew.
    """
    size = path.stat().st_size
    with path.open("rb") as handle:
        try:
            return _check(handle, size)
        except RecursionError:
            raise Damaged("nested too deeply") from None


def _check(handle: BinaryIO, size: int) -> float:
    start = handle.read(_PACKET + 1)
    if start[:4] == b"RIFF" and start[8:12] == b"AVI ":
        _Avi(handle, size).check()
    elif start[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"):
        return _Mp4(handle, size).check()
    elif start[:4] == b"\x1a\x45\xdf\xa3":
        _Matroska(handle, size).check()
    elif start[:1] == start[_PACKET:] == b"G" and size % _PACKET:
        raise Damaged("cut short")
    return 1.0


class _Container:
    """A file whose parts are looked at one by one."""

    def __init__(self, handle: BinaryIO, size: int):
        self._handle, self._size = handle, size
        self._parts = count(1)

    def read(self, offset: int, length: int) -> bytes:
        if next(self._parts) > _MAX_PARTS:
            raise Damaged("too many parts")
        self._handle.seek(offset)
        content = self._handle.read(length)
        if len(content) != length:
            raise Damaged("cut short")
        return content


def _check_picture(width: int, height: int) -> None:
    if width < 1 or height == 0 or width * abs(height) > MAX_PIXELS:
        raise Damaged(f"claims a picture of {width} x {height}")


class _Avi(_Container):
    """Chunks tile the file; header, data and index agree on the number of frames."""

    def check(self) -> None:
        declared, found, indexed = 0, 0, None
        offset = 0
        while offset < self._size:
            name, length = struct.unpack("<4sI", self.read(offset, 8))
            end = offset + 8 + length
            if name != b"RIFF" or end > self._size:
                raise Damaged("cut short, or followed by foreign bytes")
            for kind, start, stop in self._chunks(offset + 12, end):
                if kind == b"hdrl":
                    declared = self._header(start, stop)
                elif kind == b"movi":
                    found += self._frames(start, stop)
                elif kind == b"idx1":
                    if stop - start > 16 * _MAX_PARTS:
                        raise Damaged("too many parts")
                    entries = self.read(start, stop - start)
                    indexed = sum(
                        entries[i + 2 : i + 4] in (b"dc", b"db") for i in range(0, len(entries), 16)
                    )
                    if indexed != found:
                        raise Damaged(f"{found} frames, {indexed} in the index")
            offset = end + length % 2
        if not found or declared != found:
            raise Damaged(f"{found} of {declared} frames are there")

    def _chunks(self, offset: int, end: int) -> Iterator[tuple[bytes, int, int]]:
        """(name, start, stop) of the chunks between ``offset`` and ``end``; a list goes by its type."""
        while offset < end:
            name, length = struct.unpack("<4sI", self.read(offset, 8))
            start, stop = offset + 8, offset + 8 + length
            if stop > end or not name.isascii() or not name.decode().isprintable():
                raise Damaged("cut short or altered")
            if name == b"LIST":
                name, start = self.read(start, 4), start + 4
            yield name, start, stop
            offset = stop + length % 2

    def _header(self, offset: int, end: int) -> int:
        """Frames that the video stream's header declares."""
        period, frames = 0, 0
        for kind, start, stop in self._chunks(offset, end):
            if kind == b"avih":
                period, *_, width, height = struct.unpack("<10I", self.read(start, 40))
                _check_picture(width, height)
            if kind != b"strl":
                continue
            parts = {name: (first, last) for name, first, last in self._chunks(start, stop)}
            if b"strh" not in parts or b"strf" not in parts:
                raise Damaged("a stream without a header")
            header = self.read(parts[b"strh"][0], 48)
            if header[:4] == b"vids":
                scale, rate, _, frames = struct.unpack("<4I", header[20:36])
                _check_picture(*struct.unpack("<ii", self.read(parts[b"strf"][0] + 4, 8)))
                if not (scale and rate) or (period and abs(period * rate / scale / 1e6 - 1) > 0.02):
                    raise Damaged("states two frame rates")
        return frames

    def _frames(self, offset: int, end: int) -> int:
        found = 0
        for kind, start, stop in self._chunks(offset, end):
            if kind == b"rec ":
                found += self._frames(start, stop)
            elif kind[2:] in (b"dc", b"db"):
                found += 1
            elif kind[2:] not in (b"wb", b"tx", b"pc") and kind[:2] != b"ix" and kind != b"JUNK":
                raise Damaged("cut short or altered")
        return found


class _Mp4(_Container):
    """Boxes tile the file; every sample lies inside it."""

    _PARENTS = (b"moov", b"trak", b"edts", b"mdia", b"minf", b"stbl")

    def check(self) -> float:
        """The share of a track's length that its edit list shows, the least of all tracks."""
        self._clock, self._shown = 0, 1.0
        kinds = set()
        for kind, start, stop in self._boxes(0, self._size):
            kinds.add(kind)
            if kind == b"moov":
                self._movie(start, stop)
        if b"moov" not in kinds or not kinds & {b"mdat", b"moof"}:
            raise Damaged("no index of its frames, or no frames: cut short")
        return self._shown

    def _boxes(self, offset: int, end: int) -> Iterator[tuple[bytes, int, int]]:
        """(type, start, stop) of the contents of the boxes between ``offset`` and ``end``."""
        while offset < end:
            if end - offset < 8:
                raise Damaged("cut short, or followed by foreign bytes")
            length, kind = struct.unpack(">I4s", self.read(offset, 8))
            start = offset + 8
            if length == 1:
                length, start = struct.unpack(">Q", self.read(start, 8))[0], start + 8
            stop = end if length == 0 else offset + length
            if stop < start or stop > end or any(byte < 0x20 for byte in kind):
                raise Damaged("cut short or altered")
            yield kind, start, stop
            offset = stop

    def _movie(self, offset: int, end: int) -> None:
        samples = 0
        for kind, start, stop in self._boxes(offset, end):
            if kind == b"trak":
                self._length = self._edited = 0.0
            if kind in self._PARENTS:
                self._movie(start, stop)
            if kind == b"trak" and self._length and self._edited:
                self._shown = min(self._shown, self._edited / self._length)
            elif kind == b"mvhd":
                self._clock, _ = self._duration(start)
            elif kind == b"mdhd":
                scale, length = self._duration(start)
                self._length = length / max(scale, 1)
            elif kind == b"elst":
                self._edited = self._segments(start, stop) / max(self._clock, 1)
            elif kind == b"tkhd":
                width, height = (side >> 16 for side in struct.unpack(">II", self.read(stop - 8, 8)))
                if width * height > MAX_PIXELS:
                    raise Damaged(f"claims a picture of {width} x {height}")
            elif kind == b"stsz":
                fixed, samples = struct.unpack(">II", self.read(start + 4, 8))
                if samples > _MAX_PARTS:
                    raise Damaged("too many parts")
                if fixed * samples > self._size or (not fixed and 4 * samples > stop - start):
                    raise Damaged("claims more frames than it holds")
                if (
                    not fixed
                    and sum(struct.unpack(f">{samples}I", self.read(start + 12, 4 * samples))) > self._size
                ):
                    raise Damaged("claims more frames than it holds")
            elif kind in (b"stco", b"co64"):
                width = 4 if kind == b"stco" else 8
                entries = struct.unpack(">I", self.read(start + 4, 4))[0]
                if entries > _MAX_PARTS or width * entries > stop - start:
                    raise Damaged("altered")
                content = self.read(start + 8, width * entries)
                offsets = struct.unpack(f">{entries}{'I' if width == 4 else 'Q'}", content)
                if offsets and max(offsets) >= self._size:
                    raise Damaged("claims frames beyond its end")

    def _duration(self, offset: int) -> tuple[int, int]:
        """(time units in a second, duration in units) of a movie or media header."""
        long = self.read(offset, 1)[0] == 1
        if long:
            return struct.unpack(">IQ", self.read(offset + 20, 12))
        return struct.unpack(">II", self.read(offset + 12, 8))

    def _segments(self, offset: int, end: int) -> int:
        """Movie time units that an edit list shows; pauses, whose media time is -1, do not count."""
        entry = struct.Struct(">QqI" if self.read(offset, 1)[0] == 1 else ">IiI")
        count = struct.unpack(">I", self.read(offset + 4, 4))[0]
        if count * entry.size > end - offset - 8:
            raise Damaged("altered")
        entries = entry.iter_unpack(self.read(offset + 8, count * entry.size))
        return sum(length for length, begin, _ in entries if begin >= 0)


class _Matroska(_Container):
    """Elements tile the file, down to the blocks of its clusters."""

    _SEGMENT, _CLUSTER, _TRACKS, _VOID = 0x18538067, 0x1F43B675, 0x1654AE6B, 0xEC
    _TRACK, _VIDEO, _WIDTH, _HEIGHT = 0xAE, 0xE0, 0xB0, 0xBA
    _BLOCKS = frozenset((0xA3, 0xA0))
    _OTHERS = frozenset(
        (
            *(0x114D9B74, 0x1549A966, 0x1C53BB6B, 0x1941A469, 0x1043A770, 0x1254C367),  # index, titles, files
            *(0xE7, 0xAB, 0xA7, 0x5854),  # of a cluster
            *(0xEC, 0xBF),  # void, checksum
        )
    )

    def check(self) -> None:
        blocks = 0
        for element, start, stop in self._elements(0, self._size):
            if element == self._SEGMENT:
                blocks += self._segment(start, stop)
            elif element not in (0x1A45DFA3, self._VOID):
                raise Damaged("followed by foreign bytes")
        if not blocks:
            raise Damaged("no frames")

    def _segment(self, offset: int, end: int) -> int:
        """Number of blocks, checked on the way."""
        blocks = 0
        for element, start, stop in self._elements(offset, end):
            if element == self._CLUSTER:
                blocks += self._segment(start, stop)
            elif element == self._TRACKS:
                self._tracks(start, stop)
            elif element in self._BLOCKS:
                blocks += 1
            elif element not in self._OTHERS:
                raise Damaged("altered")
        return blocks

    def _tracks(self, offset: int, end: int) -> None:
        sides = {}
        for element, start, stop in self._elements(offset, end):
            if element in (self._TRACK, self._VIDEO):
                self._tracks(start, stop)
            sides[element] = int.from_bytes(self.read(start, min(stop - start, 8)), "big")
        if self._WIDTH in sides and self._HEIGHT in sides:
            _check_picture(sides[self._WIDTH], sides[self._HEIGHT])

    def _elements(self, offset: int, end: int) -> Iterator[tuple[int, int, int]]:
        """(id, start, stop) of elements between ``offset`` and ``end``.

        Live recordings have elements of unknown size: a segment then reaches to the end, a cluster is taken
        for empty, so that its blocks follow it.
        """
        while offset < end:
            element, start, _ = self._number(offset, marked=True)
            length, start, unknown = self._number(start, marked=False)
            stop = start + length
            if unknown:
                stop = start if element == self._CLUSTER else end
            if stop > end:
                raise Damaged("cut short or altered")
            yield element, start, stop
            offset = stop

    def _number(self, offset: int, marked: bool) -> tuple[int, int, bool]:
        """A variable-length number: (value, offset behind it, whether all its bits are set)."""
        first = self.read(offset, 1)[0]
        length = 9 - first.bit_length()
        if length > (4 if marked else 8):
            raise Damaged("altered")
        value = int.from_bytes(self.read(offset, length), "big")
        bits = value & ((1 << 7 * length) - 1)
        return (value if marked else bits), offset + length, bits == (1 << 7 * length) - 1
