"""``handsim validate [MEASUREMENTS]``."""
from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any, Optional, Sequence

from ._errors import input_error
from ._files import ended, read_options
from ._progress import Bar, bar
from ._rollouts_command import executor_at
from ._shipped import data_path, find_file
from ._validate_report import study

USAGE = """handsim validate [MEASUREMENTS] [--out DIR]

The hand against measurements: moment arms, forces, moments, masses beside their sources (docs/muscles.md). MEASUREMENTS is a file or a
shipped name; without one it is the shipped validate.yaml.

  --out DIR          folder for the study's files and runs/ (default with --runs or --report: out/MEASUREMENTS)
  --runs             also runs the rows that are simulations (a minute)
  --uncertain N      draws as many hands within what is uncertain of them: all figures with intervals, and which inputs own their variance
  --on ADDRESS       dask://HOST:PORT of a Dask scheduler, whose workers measure these hands
  --report           report.html: tables to sort and a plot, for a browser

Exit status 1: a required row falls short, a row has no value, or a file could not be written.

Example: handsim validate --out out/validate
"""
MOST_HANDS = 1_000_000


def _hands(text: Optional[str]) -> Optional[int]:
    if text is None:
        return None
    if not text.isascii() or not text.isdigit() or not 2 <= int(text) <= MOST_HANDS:
        raise input_error("--uncertain", text, "a whole number of hands, from 2")
    return int(text)


def _work(options: dict[str, Any]) -> int:
    given = options.get("MEASUREMENTS")
    file = data_path() / "config/validate.yaml" if given is None else find_file(given, "measurements")
    runs, report, uncertain = "--runs" in options, "--report" in options, _hands(options.get("--uncertain"))
    if uncertain is None and "--on" in options:
        raise input_error("--on", options["--on"], "--uncertain beside it")
    out = Path(options["--out"]) if "--out" in options else Path("out") / (file.stem if given else "validate") if runs or report else None
    with executor_at(options.get("--on", ""), 1) as executor, bar(True, "validate") as told:
        def show(text: str) -> None:
            if isinstance(told, Bar):
                told.close()
            print(text, end="", flush=True)

        end = study(file, out, runs=runs, uncertain=uncertain, report=report, told=told, show=show, executor=executor)
    lacks = not end.plotted and shutil.which("gnuplot") is not None
    if out is not None:
        plots = "" if end.plotted else f" (no plots: gnuplot {'failed' if lacks else 'is missing'}; the .gp file is its script)"
        print(f"files in {out}{plots}")
    return 0 if end.passed and not lacks else 1


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if any(each in ("-h", "--help") for each in arguments):
        print(USAGE, end="")
        return 0
    return ended(lambda: _work(read_options("validate", arguments, "MEASUREMENTS", ("--runs", "--report"), ("--out", "--uncertain", "--on"), (), least=0)))
