"""The formats of ``handsim export``, of both languages: the table of src/output/export/export.h."""
from __future__ import annotations

from typing import NamedTuple

from . import _core


class Format(NamedTuple):
    """A format of a file for other programs."""

    name: str
    endings: list[str]
    """Of its files, each with its dot."""
    text: str
    """Whom it is for, and what is in it."""
    of: str
    """What it is written of: some of scene, hand and run."""
    needs: str
    """A package beside NumPy; may be empty."""
    file: str
    """What such a file is, for messages."""
    mark: bytes
    """What its beginning has."""
    by_program: bool
    """The program writes it; else `handsim.export`."""


FORMATS = {of.name: of for of in (Format(*each) for each in _core.formats())}
