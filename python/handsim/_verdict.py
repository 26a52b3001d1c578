"""Figures of a run with the limits of the scene's criteria."""
from __future__ import annotations

from typing import Any, NamedTuple, Optional, Sequence


class Verdict(NamedTuple):
    """A figure and its limit."""

    name: str
    unit: str
    measured: Optional[float]
    """None: the run had nothing to measure."""
    limit: Optional[float]
    """None: the figure is measured, not judged."""
    least: bool
    """True for a lower limit."""
    held: bool
    """The limit holds; True without one."""
    time: float
    """Of the figure [s]."""
    where: str
    """Joint or body of the figure."""


def verdicts_of(rows: Sequence[Sequence[Any]]) -> list[Verdict]:
    return [Verdict(*row) for row in rows]
