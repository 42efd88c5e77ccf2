"""Structure of video containers: files that were cut short or altered, which FFmpeg plays as far as it goes.

The parts of AVI (RIFF), MP4 and MOV (ISO 14496-12), Matroska and WebM (RFC 9559) must tile the file, level by
level, and claim no giant picture. The packets of an MPEG transport stream must be whole. Only headers are
read. What is wrong with the frames themselves shows when they are decoded.
"""

import os
import struct
from itertools import count
from pathlib import Path
from typing import BinaryIO, ClassVar

MAX_PIXELS = 4096 * 2304  # of a picture
_MAX_PARTS = 200_000  # of one file; ten minutes of video have a tenth of that
_MAX_DEPTH = 10
_PACKET = 188  # bytes of a transport stream, the first of each a G


class Damaged(Exception):
    """What is wrong with a file, in a few words."""


def check_container(path: Path) -> None:
    """Raise ``Damaged`` if the file's parts do not add up to the file, or claim an impossible picture."""
    with path.open("rb") as file:
        size = os.fstat(file.fileno()).st_size
        start = file.read(_PACKET + 1)
        if start[:4] == b"RIFF" and start[8:12] == b"AVI ":
            _Avi(file).check(0, size)
        elif start[4:8] in (b"ftyp", b"moov", b"mdat", b"wide", b"free", b"skip"):
            _Mp4(file).check(0, size)
        elif start[:4] == b"\x1a\x45\xdf\xa3":
            _Matroska(file).check(0, size)
        elif start[:1] == start[_PACKET:] == b"G" and size % _PACKET:
            raise Damaged("cut short")


class _Container:
    """A file of parts that lie end to end; those in ``parents`` consist of parts themselves."""

    parents: frozenset[bytes | int]

    def __init__(self, file: BinaryIO):
        self._file = file
        self._reads = count(1)

    def read(self, offset: int, length: int) -> bytes:
        if next(self._reads) > _MAX_PARTS:
            raise Damaged("too many parts")
        self._file.seek(offset)
        content = self._file.read(length)
        if len(content) != length:
            raise Damaged("cut short")
        return content

    def check(self, offset: int, end: int, parent: bytes | int | None = None, depth: int = 0) -> None:
        """Check the parts between ``offset`` and ``end``, those of ``parent``."""
        if depth > _MAX_DEPTH:
            raise Damaged("nested too deeply")
        while offset < end:
            name, start, stop, following = self.part(offset, end, parent)
            if not start <= stop <= end:
                raise Damaged("cut short or altered, or followed by foreign bytes")
            if name in self.parents:
                self.check(start, stop, name, depth + 1)
            else:
                self.check_content(name, start, stop)
            offset = following

    def part(self, offset: int, end: int, parent: bytes | int | None) -> tuple[bytes | int, int, int, int]:
        """Of the part at ``offset``: name, where its content starts and stops, where the next part begins."""
        raise NotImplementedError

    def check_content(self, name: bytes | int, start: int, stop: int) -> None:
        """Check a part that has no parts itself."""
        raise NotImplementedError


def _check_picture(width: int, height: int) -> None:
    if width < 1 or height == 0 or width * abs(height) > MAX_PIXELS:
        raise Damaged(f"claims a picture of {width} x {height}")


class _Avi(_Container):
    parents = frozenset((b"RIFF", b"LIST"))

    def part(self, offset: int, end: int, parent: bytes | int | None) -> tuple[bytes, int, int, int]:
        name, length = struct.unpack("<4sI", self.read(offset, 8))
        if (parent is None and name != b"RIFF") or not (name.isascii() and name.decode().isprintable()):
            raise Damaged("altered, or followed by foreign bytes")
        stop = offset + 8 + length
        return name, offset + (12 if name in self.parents else 8), stop, stop + length % 2

    def check_content(self, name: bytes | int, start: int, stop: int) -> None:
        if name == b"avih":
            _check_picture(*struct.unpack("<II", self.read(start + 32, 8)))
        elif name == b"strf":
            size, width, height = struct.unpack("<Iii", self.read(start, 12))
            if size == 40:  # a video stream's
                _check_picture(width, height)


class _Mp4(_Container):
    parents = frozenset((b"moov", b"trak", b"edts", b"mdia", b"minf", b"stbl"))

    def part(self, offset: int, end: int, parent: bytes | int | None) -> tuple[bytes, int, int, int]:
        length, name = struct.unpack(">I4s", self.read(offset, 8))
        start = offset + 8
        if length == 1:
            length, start = struct.unpack(">Q", self.read(start, 8))[0], start + 8
        if any(byte < 0x20 for byte in name):
            raise Damaged("altered, or followed by foreign bytes")
        stop = offset + length if length else end
        return name, start, stop, stop

    def check_content(self, name: bytes | int, start: int, stop: int) -> None:
        if name == b"tkhd":
            width, height = (side >> 16 for side in struct.unpack(">II", self.read(stop - 8, 8)))
            if width and height:  # sound has none
                _check_picture(width, height)
        elif name == b"elst":
            entry = 20 if self.read(start, 1)[0] == 1 else 12
            if struct.unpack(">I", self.read(start + 4, 4))[0] * entry > stop - start - 8:
                raise Damaged("altered")
        elif name == b"stsz" and struct.unpack(">I", self.read(start + 8, 4))[0] > _MAX_PARTS:
            raise Damaged("too many parts")


class _Matroska(_Container):
    _SEGMENT, _CLUSTER, _TRACKS, _TRACK, _VIDEO = 0x18538067, 0x1F43B675, 0x1654AE6B, 0xAE, 0xE0
    _INDEX, _INFO, _TAGS, _VOID, _WIDTH, _HEIGHT = 0x114D9B74, 0x1549A966, 0x1254C367, 0xEC, 0xB0, 0xBA
    parents = frozenset((_SEGMENT, _CLUSTER, _TRACKS, _TRACK, _VIDEO, _INDEX, _INFO, _TAGS))
    _of_a_segment = frozenset(  # and of a cluster, because a cluster's length may be unknown
        (
            *(_CLUSTER, _TRACKS, _INDEX, _INFO, _TAGS, 0x1C53BB6B, 0x1941A469, 0x1043A770),
            *(0xE7, 0xAB, 0xA7, 0xA3, 0xA0, 0x5854, _VOID, 0xBF),
        )
    )
    _allowed: ClassVar[dict[bytes | int | None, frozenset[int]]] = {
        None: frozenset((0x1A45DFA3, _SEGMENT, _VOID)),
        _SEGMENT: _of_a_segment,
        _CLUSTER: _of_a_segment,
    }
    _width = 1

    def part(self, offset: int, end: int, parent: bytes | int | None) -> tuple[int, int, int, int]:
        """Live recordings have parts of unknown length.

        A segment then reaches to the end; a cluster is taken for empty, so that its blocks follow it.
        """
        element, start, _ = self._number(offset, marked=True)
        length, start, unknown = self._number(start, marked=False)
        if element not in self._allowed.get(parent, (element,)):
            raise Damaged("altered, or followed by foreign bytes")
        stop = start + length
        if unknown:
            stop = start if element == self._CLUSTER else end
        return element, start, stop, stop

    def check_content(self, name: bytes | int, start: int, stop: int) -> None:
        if name in (self._WIDTH, self._HEIGHT):
            side = int.from_bytes(self.read(start, min(stop - start, 8)), "big")
            self._width = side if name == self._WIDTH else self._width
            _check_picture(self._width, side if name == self._HEIGHT else 1)

    def _number(self, offset: int, marked: bool) -> tuple[int, int, bool]:
        """A variable-length number: (value, offset behind it, whether all its bits are set)."""
        first = self.read(offset, 1)[0]
        length = 9 - first.bit_length()
        if length > (4 if marked else 8):
            raise Damaged("altered, or followed by foreign bytes")
        value = int.from_bytes(self.read(offset, length), "big")
        bits = value & ((1 << 7 * length) - 1)
        return (value if marked else bits), offset + length, bits == (1 << 7 * length) - 1
