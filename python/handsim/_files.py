"""How Python writes files, and what its commands share: their options and how they end.

A file gets its name when it is complete, and what is the user's stays: docs/outputs.md, "How files are written". The rules are the
program's own (src/handsim/output/atomic_file.h, output_folder.h).
"""
from __future__ import annotations

import difflib
import glob
import os
import sys
from contextlib import suppress
from os import PathLike
from pathlib import Path
from typing import IO, Any, Callable, Iterable, Mapping, Optional, Sequence, Union

from . import _core
from ._errors import Error, Problem, input_error
from ._formats import FORMATS

PathText = Union[str, "PathLike[str]"]
KINDS: dict[str, tuple[str, bytes]] = {
    "png": ("a PNG picture", b"\x89PNG"), "mp4": ("an MP4 video", b"ftyp"), "html": ("a page of handsim", _core.page_mark),
    "convention": ("a convention that handsim has fitted", b"handsim track --convention-from"),
    "object": ("an object that handsim object has written", b"# Made by handsim object"),
    "hull": ("a hull that handsim object has written", b"# Made by handsim object"),
    **{name: (of.file, of.mark) for name, of in FORMATS.items()}}
"""What a file of an ending may replace: its name, and what the first 1000 bytes have."""


def path_of(key: str, path: Any) -> Path:
    """A path from an argument. :raises Error: of kind input for anything else"""
    try:
        text = os.fsdecode(os.fsencode(path))
    except (TypeError, ValueError):
        text = ""
    if isinstance(path, bytes) or not text or "\0" in text:
        raise input_error(key, repr(path)[:200], "a path")
    return Path(text)


def check_target(option: str, path: PathText, kind: str, inputs: Iterable[PathText] = ()) -> Path:
    """Before the work. :raises Error: of kind input where the file may not be written: it is an input, or none of its kind"""
    target = path_of(option, path)
    _core.check_target(option, target, *KINDS[kind], [Path(each) for each in inputs])
    return target


def write_file(path: Path, content: bytes) -> None:
    """:raises Error: of kind output on a full disk, of kind input where there can be no such file"""
    _core.write_file(path, content)


class NewFolder:
    """Of a ``with``: folders that are made within it up to a path go away with an error that comes before their files."""

    def __init__(self, path: Path) -> None:
        self._made = [each for each in (path, *path.parents) if not os.path.lexists(each)]

    def __enter__(self) -> "NewFolder":
        return self

    def __exit__(self, *_: object) -> None:
        for each in self._made:
            with suppress(OSError):  # there are files in it
                each.rmdir()


class OutputFolder:
    """The folder of a command's files, from before its work to the end of ``with``. Other commands cannot use it meanwhile.

    A folder that was made for it goes away with an error that comes before its files.
    """

    def __init__(self, out: PathText, own: str, mark: bytes, names: Iterable[str], inputs: Iterable[PathText]) -> None:
        """
        :param own: the file by which an earlier output of the command is known: it begins with `mark`
        :param names: of the other files
        :param inputs: files that stay
        :raises Error: of kind input for a folder that cannot be written or is in use, and where a file of these names is a folder,
            device or link, an input, or of anybody but this command
        """
        self.path = path_of("--out", out)
        self._new = NewFolder(self.path)
        every = [own, *names]
        try:
            self._core = _core.output_folder(self.path, [glob.escape(name) for name in every], [Path(each) for each in inputs])
            foreign = [name for name in every if os.path.lexists(self.path / name)]
            if foreign and not self._begins(own, mark):
                raise input_error("--out", f"{self.path}, whose {', '.join(foreign)} this command did not write", "another folder, or one without them")
        except Error:
            self._new.__exit__()
            raise

    def _begins(self, name: str, mark: bytes) -> bool:
        with suppress(OSError), open(self.path / name, "rb") as file:
            return file.read(len(mark)) == mark
        return False

    def write(self, files: Mapping[str, bytes]) -> None:
        """Replaces those of an earlier output; the first is `own`. :raises Error: of kind output on a full disk"""
        self._core.clear()
        for name, content in files.items():
            try:
                (self.path / name).parent.mkdir(exist_ok=True)
            except OSError as error:
                raise Error(f"{self.path / name}: {error.strerror}", "output") from None
            write_file(self.path / name, content)

    def told(self, files: Iterable[str]) -> str:
        return f"wrote {', '.join(str(self.path / name) for name in files)}"

    def __enter__(self) -> "OutputFolder":
        return self

    def __exit__(self, *_: object) -> None:
        del self._core  # ends the lock
        self._new.__exit__()


def ended(work: Callable[[], int]) -> int:
    """The exit status of a command's work. What goes wrong is a sentence on stderr."""
    try:
        status = work()
        sys.stdout.flush()
        return status
    except Error as error:
        message, status = str(error), 2 if error.kind == "input" else 1
    except MemoryError:
        message, status = "not enough memory", 1
    except OSError as error:
        message, status = f"output was lost: {error.strerror or error}", 1
        _silence(sys.stdout)
    try:
        print(message, file=sys.stderr)
    except OSError:
        _silence(sys.stderr)
    return status


def _silence(stream: IO[str]) -> None:
    """What a stream could not write stays in its buffer: Python would write it again at its end, fail, and exit with status 120."""
    with suppress(OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def usage(text: str, arguments: Sequence[str]) -> Optional[int]:
    """Prints the usage where it is asked for, or on stderr where nothing is.

    :return: exit status; None: there is work to do
    """
    if arguments and not any(each in ("-h", "--help") for each in arguments):
        return None
    print(text, end="", file=sys.stdout if arguments else sys.stderr)
    return 0 if arguments else 2


def read_options(command: str, arguments: Sequence[str], place: str, flags: Sequence[str], values: Sequence[str],
                 required: Sequence[str], least: int = 1, most: int = 1, lists: Sequence[str] = ()) -> dict[str, Any]:
    """Options by their names, ``--set`` and ``lists`` as lists, and by ``place`` the one argument without a name, which may be absent
    where ``least`` is 0, or a list of them where ``most`` is above 1.

    :param lists: options that take all words to the next option
    """
    out: dict[str, Any] = {"--set": [], **{name: [] for name in lists}}
    places: list[str] = []
    many: list[str] = places
    rest = iter(arguments)
    for each in rest:
        name, equals, value = each.partition("=") if each.startswith("--") else (each, "", "")
        if not each.startswith("-"):
            many.append(each)
            continue
        many = places
        if name in flags:
            out[name] = True
        elif name in values or name in lists:
            given = value if equals else next(rest, "")
            # The next option is no value: one was forgotten.
            if not given or not equals and given.partition("=")[0] in (*flags, *values, *lists):
                raise input_error(name, "nothing", "a value")
            if name in lists:
                many = out[name]
            if isinstance(out.get(name), list):
                out[name].append(given)
            else:
                out[name] = given
        else:
            near = difflib.get_close_matches(name, [*flags, *values, *lists], 1)
            raise input_error(name, "an unknown option", f"one of handsim {command} --help" + (f" (nearest: {near[0]})" if near else ""))
    if most == 0 and places:
        raise input_error("arguments", f"one too many, {places[0]}", "no more; put a value that contains a blank in quotes")
    wrong = {name: "nothing" for name in required if name not in out}
    if not least <= len(places) <= most:
        wrong[place] = str(len(places) or "nothing")
    if wrong:
        raise Error("\n".join(f"{name}: got {got}, need one" for name, got in wrong.items()), "input",
                    [Problem(None, None, None, name, got, "one") for name, got in wrong.items()])
    return {**out, place: places} if most > 1 else {**out, **{place: each for each in places}}
