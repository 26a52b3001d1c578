"""Repeats a recording of a live session and compares its hashes. A recording may be a stranger's: nothing of it is trusted."""
from __future__ import annotations

import base64
import io
import json
import zlib
from os import PathLike
from pathlib import Path
from typing import Any, BinaryIO, Iterator, Mapping, NoReturn, Optional, Union

from .._errors import Error, Problem
from .course import Course, Event, Files
from .log import FORMAT, LARGEST_HEAD

LARGEST_LINE = 1 << 26
LARGEST_CONTENT = 1 << 28
"""Bytes of the scene's files."""
MOST_STEPS = 1_000_000
"""Between two lines; a session writes one each 1000."""
WRONG = (Error, KeyError, TypeError, ValueError, AttributeError, OverflowError, IndexError, OSError, zlib.error)
"""What an input raises that does not fit."""


def lines_of(source: BinaryIO, name: str) -> Iterator[tuple[int, dict[str, Any]]]:
    number = 0
    while True:
        line = source.readline(LARGEST_LINE if number else LARGEST_HEAD)
        if not line:
            return
        number += 1
        try:
            value = json.loads(line)
        except (ValueError, RecursionError):
            value = None
        if not isinstance(value, dict):
            refuse(f"{name}:{number}", "line", repr(line[:40]), "a JSON object on each line")
        yield number, value


def printable(text: object) -> str:
    """On one line, of characters that every terminal's encoding has a way to write."""
    return " ".join(str(text).encode("utf-8", "backslashreplace").decode().split())


def refuse(place: str, key: str, got: object, need: str) -> NoReturn:
    """:param place: name and line"""
    name, _, line = place.rpartition(":")
    text = printable(got)
    raise Error(f"{place}:1: {key}: got {text}, need {need}", "input", [Problem(name, int(line), 1, key, text, need)])


def unpacked(files: Mapping[str, Any]) -> dict[str, bytes]:
    """:raises ValueError: for files that are none, or that are larger than `LARGEST_CONTENT` together"""
    out, size = {}, 0
    for name, data in files.items():
        work = zlib.decompressobj()
        out[name] = work.decompress(base64.b64decode(data), LARGEST_CONTENT - size + 1)
        size += len(out[name])
        if size > LARGEST_CONTENT:
            raise ValueError(f"more than {LARGEST_CONTENT >> 20} MB")
        if not work.eof:
            raise ValueError(f"{name!r} that is cut off")
    return out


class Replay:
    """:raises Error: of kind input for a file that is no recording"""

    def __init__(self, path: Union[str, "PathLike[str]", bytes]) -> None:
        self.name = "recording" if isinstance(path, bytes) else str(path)
        source: BinaryIO = io.BytesIO(path) if isinstance(path, bytes) else Path(path).open("rb")
        self._lines = lines_of(source, self.name)
        head: dict[str, Any] = next((line for _, line in self._lines), {})
        place, files, overrides = f"{self.name}:1", head.get("files"), head.get("overrides", {})
        if head.get("handsim_live") != FORMAT or not isinstance(files, dict) or "resolved.yaml" not in files:
            refuse(place, "handsim_live", "another file", "a recording of handsim live")
        if not isinstance(overrides, dict):
            refuse(place, "overrides", repr(overrides)[:40], "an object of keys and values")
        self.version = printable(f"{head.get('version')} ({head.get('commit')})")[:100]
        try:
            self.files = Files(unpacked(files))
        except WRONG as error:
            refuse(place, "files", error, "those of a recording of handsim live, in its own folder")
        try:
            self.course = Course(self.files, overrides)
        except WRONG as error:
            refuse(place, "files", error, "a scene that loads")
        self.checks = 0
        self.end: Optional[str] = None
        """The hash that the recording has of its end."""

    def run(self) -> None:
        """:raises Error: of kind physics at the first hash that differs, of kind input for a line that does not fit"""
        course = self.course
        for number, event in self._lines:
            place, at = f"{self.name}:{number}", event.pop("at", None)
            if type(at) is not int or not course.tick <= at <= course.tick + MOST_STEPS:
                refuse(place, "at", repr(at)[:40], f"a step from {course.tick} to {course.tick + MOST_STEPS}")
            try:
                while course.tick < at and not course.failed:
                    course.advance(at - course.tick)
                self._line(event, at)
            except WRONG as error:
                if isinstance(error, Error) and error.kind == "physics":
                    raise
                refuse(place, "input", error, "one of this scene")

    def _line(self, event: Event, at: int) -> None:
        course = self.course
        if "hash" in event or "end" in event:
            self.end = event.get("end")
            self._check(event.get("hash") or self.end, at)
        elif "failed" in event:
            if not course.failed:  # in the step that follows
                course.advance(1)
            if not course.failed:
                raise Error(f"{self.name}: the motion did not diverge at step {at}, as recorded", "physics")
            course.tick = at
        else:
            course.apply(event)

    def _check(self, wanted: Any, at: int) -> None:
        found = self.course.state_hash()
        if found != wanted:
            raise Error(f"{self.name}: step {at}, {self.course.time:.6g} s: the state's hash is {found}, recorded: {printable(wanted)[:100]}; "
                        f"recorded by handsim {self.version}", "physics")
        self.checks += 1
