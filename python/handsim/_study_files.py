"""What the commands and the files of all studies share: options, numbers and texts in tables and plots, the end of a command."""
from __future__ import annotations

import json
import math
import shutil
import sys
from pathlib import Path
from typing import Any, Mapping, Optional, Sequence, Union

from . import _core
from ._errors import input_error

PLOT_CONTROLS = {ord(c): " " for c in "'`\"\\" + "".join(map(chr, range(32)))}


def whole_option(options: dict[str, Any], name: str, least: int, most: int, what: str = "a whole number") -> Optional[int]:
    text = options.get(name)
    if text is None:
        return None
    if not text.isascii() or not text.isdigit() or not least <= int(text) <= most:
        raise input_error(name, text, f"{what}, {least} to {most}")
    return int(text)


def real_of(name: str, text: str, least: float, most: float, need: str) -> float:
    """The number of an option."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not least <= value <= most:
        raise input_error(name, text, need)
    return value


def study_names(name: str, plots: Sequence[str]) -> list[str]:
    """Names of a study's files."""
    return [name + ".csv", name + ".json", name + ".gp", "study.json", "report.html", *(plot + kind for plot in plots for kind in (".png", ".svg"))]


def plain(text: str) -> str:
    """Without what gnuplot reads as its own."""
    return text.translate(PLOT_CONTROLS)


def number(value: float) -> str:
    """As the shortest text that reads back as the same."""
    return repr(float(value)).removesuffix(".0")


def quoted(text: str) -> str:
    """A field of CSV."""
    return '"' + text.replace("\n", " ").replace('"', '""') + '"'


def csv_text(head: str, rows: Sequence[Mapping[str, str]]) -> str:
    """CSV with the columns of the head, as ``method,step[s]``; empty where a row has none of this name."""
    names = [name.partition("[")[0] for name in head.split(",")]
    return "".join(line + "\n" for line in (head, *(",".join(row.get(name, "") for name in names) for row in rows)))


def origin() -> dict[str, Any]:
    """``machine``, and ``versions`` of handsim and the compiler."""
    out: dict[str, Any] = json.loads(_core.origin())
    return out


def json_file(content: Union[Mapping[str, Any], Sequence[Mapping[str, Any]]]) -> str:
    text: str = _core.json_text(json.dumps(content, ensure_ascii=False))
    return text


def plot_note(plotted: bool) -> tuple[str, int]:
    """What stands after ``files in DIR``, and the exit status: 1 if gnuplot fails; that it is missing is no failure."""
    if plotted:
        return "", 0
    found = shutil.which("gnuplot") is not None
    return f" (no plots: gnuplot {'failed' if found else 'is missing'}; the .gp file is its script)", int(found)


def print_files(out: Path, plotted: bool) -> int:
    """Prints where the files are. :returns: exit status"""
    note, status = plot_note(plotted)
    print(f"files in {out}{note}")
    return status


def warn(warnings: Sequence[str]) -> None:
    for warning in warnings:
        print(f"warning: {warning}", file=sys.stderr)
