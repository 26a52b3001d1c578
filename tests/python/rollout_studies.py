"""A small study for tests of rollouts, and clusters of processes for them."""
import json
import os
import random
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path

import handsim as hs
from handsim import _rollouts

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


class Cluster:
    """A scheduler of Dask and its workers, each a process of its own without a nanny, so that each can be killed."""

    def __init__(self, folder: Path, workers: int, **environment: str) -> None:
        """:param environment: of all processes, beside that of this one"""
        # Workers import what tests send them by name.
        path = os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
        self._environment = {**os.environ, "PYTHONPATH": path, **environment}
        self._file, self.workers = folder / "scheduler.json", []
        self._log = open(folder / "cluster.log", "ab")
        self._file.unlink(missing_ok=True)
        self.scheduler = self._started("dask_scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--no-show", "--scheduler-file", self._file)
        self.address = self._address()
        for _ in range(workers):
            self.add()

    def _address(self) -> str:
        end = time.monotonic() + 60
        while time.monotonic() < end:
            with suppress(OSError, ValueError, KeyError):
                return str(json.loads(self._file.read_text())["address"])
            time.sleep(0.05)
        raise AssertionError("no scheduler within a minute")

    def _started(self, program: str, *words: object) -> subprocess.Popen:
        return subprocess.Popen([sys.executable, "-m", f"distributed.cli.{program}", *map(str, words)], stdout=self._log, stderr=self._log,
                                env=self._environment)

    @property
    def on(self) -> str:
        """For --on."""
        return self.address.replace("tcp://", "dask://")

    @property
    def processes(self) -> list[subprocess.Popen]:
        return [self.scheduler, *self.workers]

    def add(self) -> None:
        self.workers.append(self._started("dask_worker", self.address, "--nthreads", 1, "--no-nanny", "--no-dashboard", "--death-timeout", 20))

    def kill(self, worker: int) -> None:
        process = self.workers.pop(worker)
        process.kill()
        process.wait()

    def replace_ended(self, most: int = 2) -> None:
        """A new worker for each that has ended."""
        self.workers = [worker for worker in self.workers if worker.poll() is None]
        for _ in range(most - len(self.workers)):
            self.add()

    def seconds(self) -> list[float]:
        """CPU time of the scheduler and of the workers so far."""
        return [cpu_seconds(process.pid) for process in self.processes]

    def __enter__(self) -> "Cluster":
        return self

    def __exit__(self, *_: object) -> None:
        for process in self.processes:
            process.kill()
            process.wait()
        self._log.close()


def cpu_seconds(process: int) -> float:
    """Of a process so far, with all of its threads."""
    fields = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def records(out: Path) -> int:
    """How many chunks of rows are on the disk."""
    with suppress(OSError):
        return (out / _rollouts.PARTS).read_bytes().count(_rollouts.MARK)
    return 0


# The chunks of this command are short, so that there is time for faults.
SHORT_CHUNKS = "import sys; from handsim import _rollouts; _rollouts.SECONDS = 0.05; from handsim.__main__ import main; sys.exit(main())"


def with_faults(file: Path, out: Path, folder: Path, faults: list[str], pick: random.Random, pause: float) -> list[str]:
    """Runs a study on clusters to its end, by `handsim rollouts --on ... --resume`, while faults come: "kill" and "add" of a
    worker, "scheduler" killed, with a new one and the command again.

    :param faults: taken from the front; what is left was not reached
    :param pause: seconds between them at most, at random
    :returns: the faults that came while the study ran
    """
    came = []
    while True:
        with Cluster(folder, 2) as cluster:
            run = subprocess.Popen([sys.executable, "-c", SHORT_CHUNKS, "rollouts", str(file), "--out", str(out), "--on", cluster.on, "--resume"],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            begun = records(out)
            while run.poll() is None:
                if not faults or records(out) == begun:
                    time.sleep(0.02)
                    continue
                time.sleep(pick.uniform(0, pause))
                if run.poll() is not None:
                    break
                came.append(faults.pop(0))
                if came[-1] == "scheduler":
                    cluster.scheduler.kill()
                    break
                if came[-1] == "kill":
                    cluster.kill(pick.randrange(len(cluster.workers)))
                if came[-1] == "add" or len(cluster.workers) < 2:
                    cluster.add()
            output, errors = run.communicate(timeout=300)
            if run.returncode == 0:
                return came
            assert came and came[-1] == "scheduler" and "what computes the rows has gone" in errors, (run.returncode, output, errors)
