#!/usr/bin/env python3
"""Rollouts on a LocalCluster whose workers are killed at random: cluster_kills.py [--count 50] [--seed 1]. Oracle: the bytes of one thread."""
import argparse
import tempfile
import time
from pathlib import Path

import dask
import distributed
from rollout_studies import Killer, contents, wait_for_workers, write_study

import handsim as hs
from handsim import _rollouts


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    _rollouts.SECONDS = 0.05
    begin, studies, wrong = time.monotonic(), 0, 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        file = write_study(folder, count=150)
        hs.study.rollouts(file, threads=1, out=folder / "one")
        expected = contents(folder / "one")
        # A nanny that Dask of 2022 closes with its worker is made again.
        with dask.config.set({"distributed.deploy.lost-worker-timeout": "10s"}), distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, distributed.Client(cluster) as client:
            cluster.adapt(minimum=2, maximum=2)
            wait_for_workers(client, 2)
            with Killer(client, options.seed, options.count, 2.0) as killer:
                while killer.kills < options.count:
                    hs.study.rollouts(file, client=client, out=folder / "out")
                    studies += 1
                    wrong += contents(folder / "out") != expected
            wait_for_workers(client, 2)
    print(f"{killer.kills} kills of workers during {studies} studies of 300 rollouts in {time.monotonic() - begin:.0f} s: {wrong} with other bytes")
    return 1 if wrong else 0


if __name__ == "__main__":
    raise SystemExit(main())
