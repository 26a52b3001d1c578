"""The recording of a live session: each input with its step, and hashes of the state between them.

A file of lines of JSON. The first has the scene's files; each other one is an event ``{"at": step, ...}`` of `Course.apply`
or a check ``{"at": step, "hash": ...}``. Going on from a past moment takes the lines after it away: a recording has what led
to the present, and no other thing.
"""
from __future__ import annotations

import base64
import json
import os
import zlib
from collections import deque
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO, Mapping, NamedTuple, Optional, Union

from .. import _core
from .._errors import Error, input_error
from .course import Event, Files

FORMAT = 1
BEGIN = b'{"handsim_live":'
"""Of each recording."""
LARGEST_FILE = 1 << 30
"""Bytes; a recording ends there."""
LARGEST_HEAD = 1 << 28
"""Bytes of the line with the scene's files."""
CHECK_EVERY = 1000
"""Steps between two hashes."""


class Line(NamedTuple):
    tick: int
    place: int
    """First byte in the file."""
    number: int
    """Of the line, from 0 after the head."""
    event: Event


def check_place(path: Union[str, "PathLike[str]"]) -> Path:
    """:raises Error: of kind input for a place that is no recording's: only an empty file or a recording is replaced"""
    try:
        out = Path(path)
        if "\0" in str(out):
            raise ValueError("a byte of 0")
        if out.exists():
            if not out.is_file():
                raise input_error("record", str(path), "a file")
            with out.open("rb") as of:
                begin = of.read(len(BEGIN))
            if begin not in (b"", BEGIN):
                raise input_error("record", f"{path}, which is another file", "a new file, an empty one or a recording")
        elif not out.parent.is_dir():
            raise input_error("record", f"{path}, whose folder is missing", "a file in a folder that is there")
        if not os.access(out if out.exists() else out.parent, os.W_OK):
            raise input_error("record", f"{path}, which cannot be written", "a place that can be written")
    except (OSError, TypeError, ValueError) as error:
        raise input_error("record", f"{path!r} ({error})", "a file") from None
    return out


class Log:
    """Written as the session goes on. The last minute of events stays in memory, to repeat them.

    :param path: of the recording, from `begin` on; None: a temporary file
    """

    def __init__(self, files: Files, overrides: Mapping[str, Any], path: Union[str, "PathLike[str]", None] = None) -> None:
        import tempfile

        self.path = None if path is None else check_place(path)
        self._file: BinaryIO = tempfile.TemporaryFile(prefix="handsim_live_", buffering=0)  # type: ignore[assignment]
        self._size, self._written = 0, 0
        self._recent: deque[Line] = deque()
        self._waiting: list[tuple[int, Event]] = []
        self._first_lost: Optional[int] = None
        self.lost: Optional[str] = None
        """Why the recording has ended before the session."""
        content = {name: base64.b64encode(zlib.compress(data)).decode() for name, data in files.content.items()}
        self._line({"handsim_live": FORMAT, "version": _core.version, "commit": _core.commit, "overrides": dict(overrides),
                    "files": content}, LARGEST_HEAD)

    def begin(self) -> None:
        """From now on the file of `path` has the recording. :raises Error: of kind input where it cannot"""
        if self.path is None:
            return
        check_place(self.path)
        self.flush()
        self._file.seek(0)
        content = self._file.read()
        try:
            out = open(self.path, "w+b", buffering=0)  # closed by `close`
        except OSError as error:
            raise input_error("record", f"{self.path} ({error.strerror or error})", "a file that can be written") from None
        self._file.close()
        self._file, self._size = out, 0
        self._put(content)

    def _put(self, text: bytes) -> None:
        """Whole, or not at all."""
        if self.lost is not None:
            return
        rest = memoryview(text)
        try:
            while rest:
                rest = rest[self._file.write(rest):]
            self._size += len(text)
        except OSError as error:
            self._lose(f"the disk: {error.strerror or error}")
            self._rewind(self._size)

    def _rewind(self, size: int) -> None:
        try:
            self._file.seek(size)
            self._file.truncate()
        except OSError as error:
            self._lose(f"the disk: {error.strerror or error}")

    def _lose(self, why: str) -> None:
        self.lost, self._first_lost = why, self._written

    def _line(self, of: Mapping[str, Any], largest: int = LARGEST_FILE) -> int:
        place = self._size
        text = json.dumps(of, separators=(",", ":"), allow_nan=False).encode() + b"\n"
        if self.lost is None and place + len(text) > largest:
            self._lose(f"it is full, at {largest >> 20} MB")
        self._put(text)
        return place

    def add(self, tick: int, event: Event) -> None:
        """An event that acts before the step after `tick` steps. `flush` writes it: a step does not wait for that."""
        self._waiting.append((tick, event))

    def flush(self) -> None:
        waiting, self._waiting = self._waiting, []
        for tick, event in waiting:
            place = self._line({"at": tick, **event})
            self._recent.append(Line(tick, place, self._written, event))
            self._written += 1

    @property
    def count(self) -> int:
        """Of lines."""
        return self._written + len(self._waiting)

    def forget(self, count: int) -> None:
        """Lines before this one are no longer repeated by the session; the file keeps them."""
        self.flush()
        while self._recent and self._recent[0].number < count:
            self._recent.popleft()

    def since(self, count: int, end: int) -> list[tuple[int, Event]]:
        """Events from the line of this number on, of steps before `end`, without checks."""
        self.flush()
        return [(line.tick, line.event) for line in self._recent
                if line.number >= count and line.tick < end and not line.event.keys() & {"hash", "failed"}]

    def reach(self, count: int, end: int) -> int:
        """Lines that led to a step: those before `count`, and those after it of steps before `end`."""
        self.flush()
        return next((line.number for line in self._recent if line.number >= count and line.tick >= end), self._written)

    def cut(self, count: int) -> None:
        """Takes away all from this line on."""
        self.flush()
        if self._first_lost is not None and self._first_lost >= count and self._size:
            self.lost = self._first_lost = None
        place = self._size
        while self._recent and self._recent[-1].number >= count:
            _, place, self._written, _ = self._recent.pop()
        if place < self._size:
            self._size = place
            self._rewind(place)

    def text(self, count: int, tick: int, state_hash: Optional[str]) -> bytes:
        """The recording up to a line, with the state's hash at its end. :raises Error: of kind output where it has ended"""
        self.flush()
        if self._first_lost is not None and self._first_lost < count:
            raise Error(f"recording: got one that has ended ({self.lost}), need a whole one", "output")
        place = next((line.place for line in self._recent if line.number >= count), self._size)
        self._file.seek(0)
        out = b""
        while len(out) < place:
            out += self._file.read(place - len(out))
        self._file.seek(self._size)
        return out + (b"" if state_hash is None else json.dumps({"at": tick, "end": state_hash}).encode() + b"\n")

    def close(self, tick: int, state_hash: Optional[str]) -> None:
        self.flush()
        if state_hash is not None:
            self._line({"at": tick, "end": state_hash})
        try:
            self._file.close()
        except OSError as error:
            self._lose(f"the disk: {error.strerror or error}")
