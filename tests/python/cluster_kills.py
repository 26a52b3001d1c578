#!/usr/bin/env python3
"""Rollouts on a Dask cluster while faults come at random: cluster_kills.py [--count 50] [--seed 1]. Oracle: the bytes of one thread.

A fault is a worker that is killed or that comes, or a scheduler that is killed, after which the command is given again with --resume.
"""
import argparse
import random
import tempfile
import time
from collections import Counter
from pathlib import Path

from rollout_studies import contents, with_faults, write_study

import handsim as hs


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    pick = random.Random(options.seed)
    faults = pick.choices(("kill", "add", "scheduler"), (5, 2, 2), k=options.count)
    came: Counter[str] = Counter()
    begin, studies, wrong = time.monotonic(), 0, 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = write_study(folder, count=100)
        hs.study.rollouts(file, threads=1, out=folder / "one")
        expected = contents(folder / "one")
        while faults:
            out, own = folder / str(studies), [faults.pop() for _ in range(min(len(faults), pick.randint(1, 3)))]
            came.update(with_faults(file, out, folder, own, pick, 1.0))
            studies += 1
            faults += own
            equal = contents(out) == expected
            wrong += not equal
            print(f"study {studies}: {came['kill']} workers killed, {came['add']} added, {came['scheduler']} schedulers killed: "
                  f"{'the same bytes' if equal else 'OTHER BYTES'}", flush=True)
    print(f"{came.total()} faults during {studies} studies of 200 rollouts in {time.monotonic() - begin:.0f} s: {wrong} with other bytes")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
