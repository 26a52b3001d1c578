"""Forces of captured sequences of hands with objects, by object and person: a table of docs/forces.md (numbers only).

    HANDSIM_RECORDINGS=FOLDER PYTHONPATH=build/release/python /usr/bin/python3 tests/python/captured_forces.py --out out/captured

The files of the folder are no part of the project; without it nothing is done. A file PERSON_OBJECT_....npz has `right` and `left`, (frames, 21, 3) in
metres at 30 frames a second in MANO's own order, zeros where there is no hand, and `object`, (frames, 7): angle of the hinge [rad], rotation vector
[rad], translation [mm]. No sequence is left out: one that does not run through is a row that says so, and its status is 1.
"""
from __future__ import annotations

import argparse
import json
import math
import os
import subprocess
import sys
from pathlib import Path
from typing import Any, Optional, Sequence

import numpy as np

from handsim._model import turn_of

RATE = 30.0


def write_recording(source: Path, out: Path) -> Path:
    """As JSON. Of a hand nothing is written where it is not seen: in frames of zeros, and in the three that follow them, which lie off."""
    data = np.load(source)
    thing = source.stem.split("_")[1]
    seen = {side: np.abs(data[side]).max(axis=(1, 2)) > 0 for side in ("right", "left")}
    for each in seen.values():
        off = np.flatnonzero(each & ~np.concatenate([[False], each[:-1]]))
        for first in off[off > 0]:
            each[first:first + 3] = False
    frames = []
    for k, row in enumerate(data["object"].astype(float)):
        hands = [{"side": side, "points": np.round(data[side][k].astype(float), 6).tolist()} for side in seen if seen[side][k]]
        frames.append({"time": k / RATE, "hands": hands, "objects": [
            {"name": thing, "position": (1e-3 * row[4:]).tolist(), "quaternion": turn_of(row[1:4]).tolist(), "angle": row[0]}]})
    out.mkdir(parents=True, exist_ok=True)
    path = out / "recording.json"
    path.write_text(json.dumps({"rate": RATE, "unit": "m", "frames": frames}))
    return path


def run(source: Path, folder: Path, more: Sequence[str]) -> Optional[dict[str, Any]]:
    """Figures of a sequence (forces.json); None where it did not run through, with the reason on stderr."""
    thing = source.stem.split("_")[1]
    path = write_recording(source, folder)
    words = [sys.executable, "-m", "handsim", "track", str(path), "--points", "mano_joints", "--object",
             f"{thing}={source.parent / 'objects' / thing / thing}.urdf", "--out", str(folder / "tracked"), *more]
    done = subprocess.run(words, capture_output=True, text=True)
    (folder / "track.txt").write_text(done.stdout + done.stderr)
    if done.returncode != 0:
        print(f"{source.stem}: status {done.returncode}: {done.stderr.strip().splitlines()[-1:]}", file=sys.stderr)
        return None
    figures: dict[str, Any] = json.loads((folder / "tracked/forces/forces.json").read_text())
    return figures


def replays(rows: Sequence[dict[str, Any]]) -> str:
    """With --replay: lifts that are held to their end, and how much longer than with angles alone, in the median."""
    lifts = [lift for row in rows for lift in row["lifts"]]
    if not lifts:
        return ""
    longer = np.median([lift["held_s"]["forces"] / max(lift["held_s"]["angles"], 1 / RATE) for lift in lifts])
    return f"   {sum(lift['held_to_the_end'] for lift in lifts)} of {len(lifts)} lifts held, {longer:.1f} times as long as by angles"


def line(name: str, rows: Sequence[dict[str, Any]]) -> str:
    """Of some sequences: frames that are lifted, and of them those whose residual is small."""
    lifted = sum(row["lifted"] for row in rows)
    good = sum(row["lifted"] * (row["share_of_lifted_frames_with_residual_at_most_10_percent"] or 0) for row in rows)
    square = sum(row["lifted"] * (row["residual_share_rms"] or 0)**2 for row in rows)
    time = sum(row["frames"] * row["cpu_ms_per_frame"] for row in rows) / max(1, sum(row["frames"] for row in rows))
    short, deep = sum(row["short"] for row in rows), max((row["deepest_mm"] or 0 for row in rows), default=math.nan)
    return (f"{name:<22} {sum(row['frames'] for row in rows):>7} {lifted:>7} {100 * good / max(lifted, 1):>10.0f} % "
            f"{100 * math.sqrt(square / max(lifted, 1)):>8.0f} % {short:>7} {deep:>8.1f} {time:>6.1f}{replays(rows)}")


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("out/captured"))
    parser.add_argument("--only", nargs="*", default=[""], help="beginnings of names")
    asked, more = parser.parse_known_args()
    if "HANDSIM_RECORDINGS" not in os.environ:
        print("skipped: HANDSIM_RECORDINGS names no folder of captured sequences")
        return 0
    sources = [each for each in sorted(Path(os.environ["HANDSIM_RECORDINGS"]).glob("*.npz")) if each.name.startswith(tuple(asked.only))]
    rows: dict[str, dict[str, Any]] = {}
    print(f"{'sequence':<22} {'frames':>7} {'lifted':>7} {'within 10 %':>12} {'residual':>10} {'short':>7} {'deepest':>8} {'ms':>6}")
    for source in sources:
        found = run(source, asked.out / source.stem, more)
        if found is None:
            print(f"{source.stem:<22} did not run through", flush=True)
        else:
            rows[source.stem] = found
            print(line(source.stem, [found]), flush=True)
    for part in (1, 0):
        for key in sorted({name.split("_")[part] for name in rows}):
            print(line(f"all of {key}", [row for name, row in rows.items() if name.split("_")[part] == key]))
    print(line("all", list(rows.values())))
    return 0 if len(rows) == len(sources) else 1


if __name__ == "__main__":
    sys.exit(main())
