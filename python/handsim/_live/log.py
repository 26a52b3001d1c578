"""The recording of a live session: each input with its step, and hashes of the state between them.

A file of lines of JSON. The first has the scene's files; each other one is an event ``{"at": step, ...}`` of `Course.apply`
or a check ``{"at": step, "hash": ...}``. Going back in time takes the lines after that step away: a recording has what led
to the present, and no other thing.
"""
from __future__ import annotations

import base64
import io
import json
import zlib
from collections import deque
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO, Iterator, Mapping, Optional, Union

from .. import _core
from .._errors import Error, input_error
from .course import Course, Event, Files

FORMAT = 1
LARGEST_FILE = 1 << 30
"""Bytes; a recording ends there."""
LARGEST_LINE = 1 << 26
CHECK_EVERY = 1000
"""Steps between two hashes."""


class Log:
    """Written as the session goes on. The last seconds of events stay in memory, to repeat them."""

    def __init__(self, files: Files, overrides: Mapping[str, Any], path: Union[str, "PathLike[str]", None] = None) -> None:
        import tempfile

        self._file: BinaryIO
        if path is None:
            self._file = tempfile.TemporaryFile(prefix="handsim_live_")  # type: ignore[assignment]
        else:
            self._file = open(path, "w+b")  # closed by `close`
        self._recent: deque[tuple[int, int, int, Event]] = deque()
        self._waiting: list[tuple[int, Event]] = []
        self._written = 0
        self.full = False
        content = {name: base64.b64encode(zlib.compress(data)).decode() for name, data in files.content.items()}
        self._line({"handsim_live": FORMAT, "version": _core.version, "commit": _core.commit, "overrides": dict(overrides),
                    "files": content})

    def _line(self, of: Mapping[str, Any]) -> int:
        place = self._file.tell()
        text = json.dumps(of, separators=(",", ":"), allow_nan=False).encode() + b"\n"
        if place + len(text) > LARGEST_FILE:
            self.full = True
        if not self.full:
            self._file.write(text)
        return place

    def add(self, tick: int, event: Event) -> None:
        """An event that acts before the step after `tick` steps. `flush` writes it: a step does not wait for that."""
        self._waiting.append((tick, event))

    def flush(self) -> None:
        for tick, event in self._waiting:
            place = self._line({"at": tick, **event})
            self._recent.append((tick, place, self._written, event))
            self._written += 1
        self._waiting.clear()

    @property
    def count(self) -> int:
        """Of events."""
        return self._written + len(self._waiting)

    def forget(self, tick: int) -> None:
        """Events before this step are no longer repeated by the session; the file keeps them."""
        self.flush()
        while self._recent and self._recent[0][0] < tick:
            self._recent.popleft()

    def since(self, count: int, end: int) -> list[tuple[int, Event]]:
        """Events from the one of this number on, of steps before `end`, without checks."""
        self.flush()
        return [(at, event) for at, _, number, event in self._recent
                if number >= count and at < end and not event.keys() & {"hash", "failed"}]

    def cut(self, tick: int) -> None:
        """Takes away all from this step on."""
        self.flush()
        place = None
        while self._recent and self._recent[-1][0] >= tick:
            _, place, self._written, _ = self._recent.pop()
        if place is not None and place < self._file.tell():
            self._file.seek(place)
            self._file.truncate()
            self.full = False

    def text(self, tick: int, state_hash: str) -> bytes:
        """The recording up to now, with the state's hash at its end."""
        self.flush()
        here = self._file.tell()
        self._file.seek(0)
        out = self._file.read()
        self._file.seek(here)
        return out + json.dumps({"at": tick, "end": state_hash}).encode() + b"\n"

    def close(self, tick: int, state_hash: Optional[str]) -> None:
        self.flush()
        if state_hash is not None:
            self._line({"at": tick, "end": state_hash})
        self._file.close()


def lines_of(source: BinaryIO, name: str) -> Iterator[tuple[int, dict[str, Any]]]:
    number = 0
    while True:
        line = source.readline(LARGEST_LINE)
        if not line:
            return
        number += 1
        try:
            value = json.loads(line)
        except (ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            raise Error(f"{name}:{number}:1: got {line[:40]!r}, need a JSON object on each line", "input")
        yield number, value


class Replay:
    """Repeats a recording and compares its hashes."""

    def __init__(self, path: Union[str, "PathLike[str]", bytes]) -> None:
        self.name = "recording" if isinstance(path, bytes) else str(path)
        source: BinaryIO = io.BytesIO(path) if isinstance(path, bytes) else Path(path).open("rb")
        self._lines = lines_of(source, self.name)
        head: dict[str, Any] = next((line for _, line in self._lines), {})
        if head.get("handsim_live") != FORMAT or not isinstance(head.get("files"), dict) or "resolved.yaml" not in head["files"]:
            raise input_error(self.name, "another file", "a recording of handsim live")
        self.version = f"{head.get('version')} ({head.get('commit')})"
        try:
            files = {name: zlib.decompress(base64.b64decode(data)) for name, data in head["files"].items()}
        except (ValueError, TypeError, zlib.error):
            raise input_error(self.name, "files that cannot be read", "a recording of handsim live") from None
        self.course = Course(Files(files), head.get("overrides") or {})
        self.checks = 0
        self.end: Optional[str] = None
        """The hash that the recording has of its end."""

    def run(self) -> None:
        """:raises Error: of kind physics at the first hash that differs, of kind input for a line that does not fit"""
        for number, event in self._lines:
            at = event.pop("at", None)
            if type(at) is not int or not self.course.tick <= at:
                raise Error(f"{self.name}:{number}:1: at: got {at!r}, need a step from {self.course.tick} on", "input")
            while self.course.tick < at and not self.course.failed:
                self.course.advance(at - self.course.tick)
            if "hash" in event or "end" in event:
                self.end = event.get("end")
                self._check(event.get("hash") or event.get("end"), at)
                continue
            if "failed" in event:
                if not self.course.failed:
                    raise Error(f"{self.name}:{number}: the motion did not diverge at step {at}, as recorded", "physics")
                self.course.tick = at
                continue
            try:
                self.course.apply(event)
            except (KeyError, TypeError, ValueError, AttributeError) as error:
                raise Error(f"{self.name}:{number}:1: got an input that does not fit ({error}), need one of this scene",
                            "input") from None

    def _check(self, wanted: Any, at: int) -> None:
        found = self.course.state_hash()
        if found != wanted:
            raise Error(f"{self.name}: step {at}, {self.course.time:.6g} s: the state's hash is {found}, recorded: {wanted}; "
                        f"recorded by handsim {self.version}", "physics")
        self.checks += 1
