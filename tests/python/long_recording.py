"""Memory and time of `handsim track --object` for long recordings: a table of docs/forces.md.

    PYTHONPATH=build/release/python /usr/bin/python3 tests/python/long_recording.py out/forces/pinch_median_woman

An own recording (recorded_forces.py) is repeated forwards and backwards; peak of the resident memory and user time are those that the system tells of the
process.
"""
from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Sequence

RATE = 60.0


def repeated(source: Path, out: Path, minutes: float) -> int:
    """:returns: its frames"""
    head, *lines = source.read_text().splitlines()
    rows = [line.partition(",")[2] for line in lines]
    order = [*range(len(rows)), *range(len(rows) - 2, 0, -1)]
    count = int(minutes * 60 * RATE)
    with open(out, "w", encoding="utf-8") as file:
        file.write(head + "\n")
        file.writelines(f"{i / RATE:.9g},{rows[order[i % len(order)]]}\n" for i in range(count))
    return count


def peak(words: Sequence[str]) -> tuple[float, float]:
    """Of a process that ends well: resident memory [MB], and user time [s]."""
    process = subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    _, status, used = os.wait4(process.pid, 0)
    if status:
        raise RuntimeError(f"status {status}: {' '.join(words)}")
    return used.ru_maxrss / 1e3, used.ru_utime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path, help="folder of an own recording")
    parser.add_argument("--minutes", type=float, nargs="*", default=[1, 10, 30])
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for minutes in asked.minutes:
            path = Path(folder) / "long.csv"
            count = repeated(asked.recording / "recording.csv", path, minutes)
            memory, user = peak([sys.executable, "-m", "handsim", "track", str(path), "--object", f"thing={asked.recording / 'thing.yaml'}", "--support", "post",
                                 "--out", str(Path(folder) / f"out_{minutes:g}")])
            print(f"{minutes:g} min, {count} frames: {memory:.0f} MB, {user:.0f} s", flush=True)


if __name__ == "__main__":
    main()
