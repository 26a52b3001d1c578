"""What drivers in Python share: the cases' tables as arrays, and the writing of results. README.md says what the files have."""
from __future__ import annotations

import argparse
import csv
import json
import math
import sys
import time
import traceback
from pathlib import Path
from typing import Any, Callable, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
HEAD = "time,body,x,y,z,qw,qx,qy,qz,vx,vy,vz,wx,wy,wz,fx,fy,fz,normal"


class Row:
    """Of a table: numbers by column."""

    def __init__(self, cells: dict[str, str]) -> None:
        self.cells = cells

    def __getitem__(self, name: str) -> float:
        return float(self.cells[name])

    def text(self, name: str) -> str:
        return self.cells[name]

    def vector(self, *names: str) -> Array:
        return np.array([float(self.cells[name]) for name in names])


def read_table(path: Path) -> list[Row]:
    with open(path, newline="", encoding="utf-8") as file:
        return [Row(row) for row in csv.DictReader(file)]


class Case:
    """A folder of the suite."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.name = folder, folder.name
        self.spec: dict[str, Any] = json.loads((folder / "case.json").read_text(encoding="utf-8"))
        self.step: float = self.spec["step"]
        self.steps = round(self.spec["duration"] / self.step)
        self.every = round(self.spec["record"]["every"] / self.step)
        """Steps from a row of the results to the next."""
        self.recorded: list[str] = self.spec["record"]["bodies"]
        self.touched: Optional[str] = self.spec["record"]["forces"]
        """The body whose contact forces are asked for."""
        self.bodies = {row.text("body"): row for row in read_table(folder / "bodies.csv")}
        self.joints = {row.text("joint"): row for row in read_table(folder / "joints.csv") if not row["closes_loop"]}
        self.pairs = read_table(folder / "pairs.csv")
        shaken = self.spec["shaken"]
        motion = read_table(folder.parent / shaken["table"]) if shaken else []
        self._times = np.array([row["time"] for row in motion])
        self._moved = np.array([row.vector("x", "y", "z", "ax", "ay", "az") for row in motion]).reshape(-1, 6)
        self._first: float = shaken["from"] if shaken else 0.0

    def _of_base(self, time: float, first: int) -> Array:
        if not len(self._times):
            return np.zeros(3)
        return np.array([np.interp(time - self._first, self._times, self._moved[:, k]) for k in range(first, first + 3)])

    def moved(self, time: float) -> Array:
        """Displacement of the base from its start [m]."""
        return self._of_base(time, 0)

    def gravity(self, time: float) -> Array:
        """As the bodies feel it where the base stands still: less the base's acceleration [m/s2]."""
        return np.asarray(np.array(self.spec["gravity"]) - self._of_base(time, 3))


class Results:
    """The table of a case."""

    def __init__(self, path: Path) -> None:
        self._path, self._lines = path, [HEAD]

    def add(self, time: float, body: str, position: Sequence[float], quaternion: Sequence[float], velocity: Sequence[float],
            angular_velocity: Sequence[float], force: Optional[Sequence[float]] = None, normal: Optional[float] = None) -> None:
        """A row: the pose and twist of a body in the world, and where they are known the contact forces on it.

        :raises FloatingPointError: for numbers that are not finite, or beyond all bounds: the case broke off
        """
        values = [*position, *quaternion, *velocity, *angular_velocity]
        if not all(math.isfinite(x) and abs(x) < 1e6 for x in values):
            raise FloatingPointError(f"{body} is not finite at {time:g} s")
        forces = ["", "", ""] if force is None else [f"{x:.9g}" for x in force]
        self._lines.append(",".join([f"{time:.9g}", body, *(f"{x:.12g}" for x in values), *forces, "" if normal is None else f"{normal:.9g}"]))

    def write(self) -> None:
        self._path.write_text("\n".join(self._lines) + "\n", encoding="utf-8")


def run(engine: str, version: str, options: str, simulate: Callable[[Case, Results], None]) -> int:
    """The command of a driver: simulates the cases, and writes the results. ``--out DIR``, ``--suite DIR``, ``--only CASE ...``."""
    parser = argparse.ArgumentParser(description=f"The suite in {engine}")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--suite", type=Path, default=Path(__file__).resolve().parent)
    parser.add_argument("--only", nargs="*", default=[])
    options_given = parser.parse_args()
    options_given.out.mkdir(parents=True, exist_ok=True)
    told: dict[str, dict[str, Any]] = {}
    for folder in sorted(path.parent for path in options_given.suite.glob("*/case.json")):
        if options_given.only and folder.name not in options_given.only:
            continue
        case, results = Case(folder), Results(options_given.out / f"{folder.name}.csv")
        begin = time.process_time()
        try:
            simulate(case, results)
            told[case.name] = {"cpu_s": round(time.process_time() - begin, 4)}
        except Exception as error:  # noqa: BLE001: an engine's own
            traceback.print_exc()
            told[case.name] = {"cpu_s": round(time.process_time() - begin, 4), "failed": f"{type(error).__name__}: {error}".splitlines()[0][:200]}
        results.write()
        print(case.name, told[case.name], file=sys.stderr, flush=True)
        # After each case: a driver that is stopped leaves what it has done.
        (options_given.out / "run.json").write_text(
            json.dumps({"engine": engine, "version": version, "options": options, "cases": told}, indent=1) + "\n", encoding="utf-8")
    return 0
