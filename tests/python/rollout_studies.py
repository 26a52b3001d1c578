"""A small study for tests of rollouts, and clusters of processes for them."""
import os
import random
import signal
import threading
import time
from contextlib import suppress
from pathlib import Path

import handsim as hs

FILES = ("rollouts.csv", "rollouts.h5", "summary.json")


def write_study(folder: Path, count: int = 6, more: str = "") -> Path:
    """Two rollouts of some milliseconds for each draw: two limp hands for twenty steps, on two engines."""
    file = folder / "study.yaml"
    file.write_text(f"""scene: {hs.data_path() / "config/two_hands.yaml"}
set: {{duration: 0.02 s, record.every: 5 ms}}
count: {count}
seed: 3
vary:
  hands.*.person: {{population: ansur2}}
  hands.0.tissue.damping: {{log_uniform: [0.5, 2]}}
  gravity: {{normal: {{sd: [0, 0.1 m/s2, 0]}}}}
  solver.engine: {{each: [ode, articulated]}}
record: {{trajectories: 2}}
{more}""")
    return file


def contents(folder: Path) -> dict[str, bytes]:
    return {name: (folder / name).read_bytes() for name in FILES}


class Killer(threading.Thread):
    """Kills a worker process of a cluster with nannies now and then, at random."""

    def __init__(self, client, seed: int, most: int, every: float) -> None:
        super().__init__(daemon=True)
        self.client, self.random, self.most, self.every = client, random.Random(seed), most, every
        self.kills, self.ended = 0, threading.Event()
        self.seen: dict[int, float] = {}

    def run(self) -> None:
        while self.kills < self.most and not self.ended.wait(self.random.uniform(0.3, 1) * self.every):
            try:
                pids = list(self.client.run(os.getpid).values())
            except Exception:  # noqa: BLE001  a worker has just gone
                continue
            # A nanny whose process dies while it starts gives up.
            pids = [pid for pid in pids if time.monotonic() - self.seen.setdefault(pid, time.monotonic()) > 2]
            if pids:
                with suppress(ProcessLookupError):
                    os.kill(self.random.choice(pids), signal.SIGKILL)
                    self.kills += 1

    def __enter__(self) -> "Killer":
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.ended.set()
        self.join()


def wait_for_workers(client, count: int) -> None:
    end = time.monotonic() + 60
    while len(client.nthreads()) < count and time.monotonic() < end:
        time.sleep(0.05)
