"""The one exception of handsim, with the places of its problems."""
from __future__ import annotations

import math
import operator
import re
from typing import Any, Callable, NamedTuple, Optional, Sequence


class Problem(NamedTuple):
    """One thing that is wrong with an input: ``file:line:column: key: got X, need Y``."""

    file: Optional[str]
    """Name of the file; None for a problem outside any file."""
    line: Optional[int]
    """From 1."""
    column: Optional[int]
    """From 1."""
    key: str
    """Dotted path, e.g. ``hands.0.wrist.position``; the argument's name where no file is meant."""
    got: str
    need: str


class Fault(NamedTuple):
    """A simulation that failed."""

    time: float
    """Simulated time [s]."""
    where: str
    """Name of the body or joint."""
    quantity: str
    """What left its bounds, with its unit."""
    detail: str
    """Value, bound and remedy."""


class Error(Exception):
    """All that a file, an argument or the physics can cause. ``str(error)`` has every problem on a line of its own."""

    def __init__(self, message: str, kind: str = "input", problems: Sequence[Problem] = (),
                 fault: Optional[Fault] = None) -> None:
        super().__init__(message, kind, tuple(problems), fault)
        self.kind = kind
        """``input``: a file, key, number or argument is wrong; ``physics``: the motion diverged; ``output``: a file
        could not be written."""
        self.problems: tuple[Problem, ...] = tuple(problems)
        """All problems of an input or output; empty for physics."""
        self.fault = fault
        """Set for physics."""

    def __str__(self) -> str:
        return str(self.args[0])


def from_core(message: str, kind: str, problems: Sequence[Any], fault: Any) -> Error:
    return Error(message, kind, [Problem(*each) for each in problems], None if fault is None else Fault(*fault))


def input_error(key: str, got: object, need: str) -> Error:
    """An input error outside any file."""
    return Error(f"{key}: got {got}, need {need}", "input", [Problem(None, None, None, key, str(got), need)])


def renamed(error: Error, file: Any, by: Any, line: Callable[[int], int] = lambda line: line) -> Error:
    """The same of the file that another one stands for. :param line: of that file, by the line of the one that was read"""
    def place(found: "re.Match[str]") -> str:
        return str(by) + (f":{line(int(found[1]))}" if found[1] else "")
    problems = [each._replace(file=str(by), line=None if each.line is None else line(each.line)) if each.file == str(file) else
                each._replace(key=str(by)) if each.key == str(file) else each for each in error.problems]
    return Error(re.sub(re.escape(str(file)) + r"(?::(\d+))?", place, str(error)), error.kind, problems, error.fault)


LARGEST = 2**31 - 1


def whole(key: str, value: Any, least: int, most: int = LARGEST) -> int:
    """A whole number of Python or numpy within its range. :raises Error: of kind input for anything else"""
    try:
        number = operator.index(value)
    except TypeError:
        number = least - 1
    if not least <= number <= most:
        raise input_error(key, repr(value), f"a whole number, {least} to {most}")
    return number


def flag(key: str, value: Any) -> bool:
    """True or False. :raises Error: of kind input for anything else"""
    if type(value).__name__ not in ("bool", "bool_"):
        raise input_error(key, repr(value), "True or False")
    return bool(value)


def flags(**named: Any) -> None:
    """Each True or False."""
    for key, value in named.items():
        flag(key, value)


def seed_of(value: Any) -> int:
    """A seed of 64 bits."""
    return whole("seed", value, 0, 2**64 - 1)


def numbers(key: str, value: Any, shape: str, axes: Optional[int] = None, finite: bool = True) -> Any:
    """A copy as an array of float64. :raises Error: of kind input for anything else, and for another number of axes"""
    import numpy as np

    try:
        out = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise input_error(key, type(value).__name__, f"numbers, {shape}") from None
    if axes is not None and out.ndim != axes:
        raise input_error(key, f"shape {out.shape}", shape)
    if finite and not np.isfinite(out).all():
        raise input_error(key, "a number that is not finite", f"finite numbers, {shape}")
    return out


def one_of(key: str, value: Any, kind: type) -> Any:
    """An object of a class. :raises Error: of kind input for anything else"""
    if not isinstance(value, kind):
        raise input_error(key, type(value).__name__, f"a {kind.__name__}")
    return value


def real(key: str, value: Any) -> float:
    """A finite number. :raises Error: of kind input for anything else"""
    try:
        number = float(value) if not isinstance(value, str) else math.nan
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not math.isfinite(number):
        raise input_error(key, repr(value), "a finite number")
    return number
