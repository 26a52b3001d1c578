#!/usr/bin/env python3
"""What Dask costs beside the threads of one machine, and how a scheduler does with many workers.

    cluster_cost.py overhead STUDY [--count 1000] [--engine articulated] [--repeats 5] [--workers 2]
    cluster_cost.py sleepers [--workers 64] [--span 40] [--row 0.05] [--late 0.5] [--seconds 0.1 0.2 0.5 1 2 4]

`overhead` runs `handsim rollouts STUDY` by threads and on a cluster of processes in turn, and prints wall and CPU time of each,
medians, and ratios. CPU time of the second way is that of client, scheduler and workers together; processes of the cluster start
before, as they do for users.

Processes of Dask take CPU time for each second of wall time, also idle: they sample their own stacks, and watch
themselves and each other. Where the machine has other work, a study takes longer and has more of this. The rate is therefore
measured first, of the idle cluster, and a second ratio of CPU times leaves out what falls into time beyond that of free cores.

`sleepers` has a real scheduler in a process of its own and many workers of one thread in another, whose rows sleep in place of computing; every tenth
chunk ends late. Bytes are the same by tests; here only the time of scheduler and client counts: what a chunk costs each of them says with how many
chunks a second it has no time left.
"""
import argparse
import os
import statistics
import subprocess
import sys
import tempfile
import time
import zlib
from pathlib import Path

from rollout_studies import Cluster, wait_for_workers

from handsim import _rollouts


def timed(words: list[object]) -> tuple[float, float]:
    """Wall and CPU time of a command [s]."""
    begin = time.monotonic()
    process = subprocess.Popen([sys.executable, "-m", "handsim", *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert process.stderr
    errors = process.stderr.read()
    _, status, usage = os.wait4(process.pid, 0)
    if status:
        raise SystemExit(f"{words}: {errors}")
    return time.monotonic() - begin, usage.ru_utime + usage.ru_stime


CALM = {"DASK_DISTRIBUTED__WORKER__PROFILE__INTERVAL": "1s"}
"""As docs/rollouts.md says to start workers: they sample their own stacks once a second, and not a hundred times."""


def overhead(options: argparse.Namespace) -> None:
    import distributed

    ratios: list[tuple[float, float, float]] = []
    with tempfile.TemporaryDirectory() as name, Cluster(Path(name), options.workers, **CALM) as cluster:
        with distributed.Client(cluster.address) as client:
            wait_for_workers(client, options.workers)
            client.run(__import__, "handsim")
        before, begin = cluster.seconds(), time.monotonic()
        time.sleep(options.idle)
        idle = (sum(cluster.seconds()) - sum(before)) / (time.monotonic() - begin)
        print(f"idle, the cluster takes {idle:.3f} s of CPU time a second")
        base = ["rollouts", options.study, "--count", options.count, *(["--engine", options.engine] if options.engine else [])]
        print("repeat  threads: wall, CPU [s]  Dask: wall, CPU [s] = client + scheduler + workers")
        for repeat in range(options.repeats):
            threads = timed([*base, "--out", f"{name}/threads{repeat}", "--jobs", options.workers])
            before = cluster.seconds()
            wall, client_cpu = timed([*base, "--out", f"{name}/dask{repeat}", "--on", cluster.on])
            scheduler, *workers = (after - then for after, then in zip(cluster.seconds(), before))
            cpu = client_cpu + scheduler + sum(workers)
            # At most what the idle cluster takes in the time that other work has added.
            beyond = idle * max(0.0, wall - threads[1] / options.workers)
            ratios.append((wall / threads[0], cpu / threads[1], (cpu - beyond) / threads[1]))
            print(f"{repeat:6}  {threads[0]:13.2f} {threads[1]:8.2f}  {wall:10.2f} {cpu:8.2f} = {client_cpu:.2f} + {scheduler:.2f} + {sum(workers):.2f}", flush=True)
            for file in ("rollouts.csv", "summary.json"):
                assert Path(name, f"threads{repeat}", file).read_bytes() == Path(name, f"dask{repeat}", file).read_bytes(), file
    walls, cpus, free = zip(*ratios)
    print(f"{options.study}, {options.count} draws, {options.workers} cores: Dask over threads, medians of {options.repeats}: wall {statistics.median(walls):.3f} "
          f"({min(walls):.3f} to {max(walls):.3f}), CPU time {statistics.median(cpus):.3f} ({min(cpus):.3f} to {max(cpus):.3f}), "
          f"on free cores {statistics.median(free):.3f} ({min(free):.3f} to {max(free):.3f})")


IDLE = {"DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False", "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "1s", "DASK_LOGGING__DISTRIBUTED": "error",
        "DASK_DISTRIBUTED__ADMIN__SYSTEM_MONITOR__INTERVAL": "60s", "DASK_DISTRIBUTED__WORKER__MEMORY__MONITOR_INTERVAL": "60s"}
"""Of many workers in one process: each samples its stack 100 times a second and looks at its own loop and memory, which is more than all that this process
can do for 64 of them. Chunks would wait for that."""


class Sleep:
    """Rows that sleep; every tenth chunk is late."""

    def __init__(self, row: float, late: float) -> None:
        self.row, self.late, self.key = row, late, f"sleep {time.time()}"


def sleeping_rows(work: Sleep, first: int, last: int) -> _rollouts.Rows:
    time.sleep((last - first) * work.row + (work.late if zlib.crc32(b"%d" % first) % 10 == 0 else 0))
    return _rollouts.Rows(first, last, b"0" * 650 * (last - first), {}, [], (last - first) * work.row)


def workers(options: argparse.Namespace) -> None:
    """Workers of one thread, all in this process, until it is killed."""
    import asyncio

    import distributed

    async def work() -> None:
        made = [distributed.Worker(options.address, nthreads=1, dashboard=False) for _ in range(options.workers)]
        for each in made:
            await each
        await asyncio.gather(*(each.finished() for each in made))

    asyncio.run(work())


def sleepers(options: argparse.Namespace) -> None:
    import distributed

    print("least work of a chunk  rows in it  chunks  wall [s]  workers busy  CPU time a chunk [ms]: client  scheduler  chunks a second: came  of one scheduler")
    for seconds in options.seconds:
        _rollouts.SECONDS, _rollouts.SECONDS_A_SLOT = seconds, 0
        chunks: list[int] = []

        def keep(rows: _rollouts.Rows, chunks: list[int] = chunks) -> None:
            chunks.append(rows.last - rows.first)

        def crashed(row: int, text: str) -> None:
            raise SystemExit(f"row {row} {text}")

        with tempfile.TemporaryDirectory() as name, Cluster(Path(name), 0) as cluster, distributed.Client(cluster.address) as client:
            process = subprocess.Popen([sys.executable, __file__, "workers", cluster.address, "--workers", str(options.workers)],
                                       env={**os.environ, **IDLE, "DASK_TEMPORARY_DIRECTORY": name})
            try:
                wait_for_workers(client, options.workers)
                rows = int(options.span * options.workers / options.row)
                begin, before, scheduler = time.monotonic(), time.process_time(), cluster.seconds()[0]
                _rollouts.collect(sleeping_rows, Sleep(options.row, options.late), _rollouts.Dask(client), [(0, rows)], keep, crashed, lambda: None, print)
                wall, own, scheduler = time.monotonic() - begin, time.process_time() - before, cluster.seconds()[0] - scheduler
            finally:
                process.kill()
                process.wait()
        assert sum(chunks) == rows
        print(f"{seconds:21}  {statistics.median(chunks):10}  {len(chunks):6}  {wall:8.1f}  {100 * rows * options.row / wall / options.workers:10.0f} %  "
              f"{1e3 * own / len(chunks):29.2f}  {1e3 * scheduler / len(chunks):9.2f}  {len(chunks) / wall:21.0f}  {len(chunks) / scheduler:16.0f}", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    ways = parser.add_subparsers(dest="way", required=True)
    one = ways.add_parser("overhead")
    one.add_argument("study")
    one.add_argument("--count", type=int, default=1000)
    one.add_argument("--engine")
    one.add_argument("--repeats", type=int, default=5)
    one.add_argument("--workers", type=int, default=2)
    one.add_argument("--idle", type=float, default=15, help="seconds")
    two = ways.add_parser("sleepers")
    two.add_argument("--workers", type=int, default=64)
    two.add_argument("--span", type=float, default=40, help="seconds that the rows take where workers never wait")
    two.add_argument("--row", type=float, default=0.05, help="seconds")
    two.add_argument("--late", type=float, default=0.5, help="seconds")
    two.add_argument("--seconds", type=float, nargs="+", default=[0.1, 0.2, 0.5, 1, 2, 4], help="least work of a chunk, one study for each")
    three = ways.add_parser("workers")
    three.add_argument("address")
    three.add_argument("--workers", type=int)
    options = parser.parse_args()
    {"overhead": overhead, "sleepers": sleepers, "workers": workers}[options.way](options)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
