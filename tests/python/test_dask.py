"""Rollouts on a Dask cluster of processes, of which some die, come and differ; more kills: cluster_kills.py."""
import os
import subprocess
import sys
import threading
import time

import pytest
from rollout_studies import Killer, contents, wait_for_workers, write_study

import handsim as hs
from handsim import _rollouts
from handsim._rollouts import PARTS

try:
    import dask
    import distributed
    import h5py  # noqa: F401
except ImportError:
    distributed = None
pytestmark = pytest.mark.skipif(distributed is None, reason="python3-distributed or python3-h5py is not installed: rollouts on Dask are not tested")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    file = write_study(folder, count=100)
    hs.study.rollouts(file, out=folder / "out")
    return file, contents(folder / "out")


@pytest.fixture(scope="module")
def cluster():
    # A task whose worker has died twice is given back: each death takes seconds, until its nanny has a new process.
    # Dask of 2022 also closes the nanny of a worker that dies with a result that is asked for: the cluster makes another one.
    with dask.config.set({"distributed.scheduler.allowed-failures": 1, "distributed.deploy.lost-worker-timeout": "10s"}), \
            distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as made:
        made.adapt(minimum=2, maximum=2)
        yield made


@pytest.fixture
def client(cluster):
    with distributed.Client(cluster, set_as_default=False) as made:
        wait_for_workers(made, 2)
        yield made


# Oracle: one machine.
def test_two_workers_give_the_same_bytes(whole, client, tmp_path):
    file, expected = whole
    hs.study.rollouts(file, client=client, out=tmp_path)
    assert contents(tmp_path) == expected


# Oracle: one machine. Chunks of a row or two: there is time for kills.
def test_killed_workers_cost_no_row(whole, client, tmp_path, monkeypatch):
    file, expected = whole
    monkeypatch.setattr(_rollouts, "SECONDS", 0.02)
    with Killer(client, 3, 4, 1.0) as killer:
        end = time.monotonic() + 300
        while killer.kills < 3 and time.monotonic() < end:
            hs.study.rollouts(file, client=client, out=tmp_path)
            assert contents(tmp_path) == expected
    assert killer.kills >= 3
    wait_for_workers(client, 2)


def test_workers_that_come_are_used(whole, tmp_path, monkeypatch):
    file, expected = whole
    monkeypatch.setattr(_rollouts, "SECONDS", 0.02)
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1, dashboard_address=None) as cluster, distributed.Client(cluster) as client:
        adding = threading.Timer(0.3, cluster.scale, (2,))
        adding.start()
        hs.study.rollouts(file, client=client, out=tmp_path)
        adding.join()
        wait_for_workers(client, 2)
        assert contents(tmp_path) == expected and len(client.nthreads()) == 2


# Oracle: the table of one machine, but for that row; only a worker process can die so.
def test_a_row_that_crashes_its_worker_is_a_row(client, tmp_path):
    file = write_study(tmp_path, count=3)
    class Crashing:
        """At row 4 the process of the worker ends."""

        status, nthreads, scatter = "running", client.nthreads, client.scatter

        def submit(self, call, *arguments, **more):
            return client.submit(call if len(arguments) == 1 else _dies_at_4, *arguments, **more)

    hs.study.rollouts(file, client=Crashing(), out=tmp_path / "out")
    rows = (tmp_path / "out/rollouts.csv").read_text().splitlines()
    assert [i - 1 for i, row in enumerate(rows) if "crashed" in row] == [4] and len(rows) == 7
    # A nanny that is just starting a process does not end.
    wait_for_workers(client, 2)


def _dies_at_4(work, first, last):
    if first <= 4 < last:
        os._exit(9)
    return _rollouts.rows_of(work, first, last)


# Oracle: the worker's name, and what is other; no row is there.
def test_a_worker_of_another_build_is_refused_by_name(whole, client, tmp_path):
    class Other:
        status, nthreads, scatter = "running", client.nthreads, client.scatter

        def submit(self, call, *arguments, **more):
            if len(arguments) == 1:
                work = arguments[0]
                arguments = (work._replace(origin=[*work.origin[:2], "handsim 0.0.1, commit 0123456", *work.origin[3:]], key="other"),)
            return client.submit(call, *arguments, **{**more, **({"key": "other"} if "key" in more else {})})

    with pytest.raises(hs.Error, match=r"^worker tcp://127.0.0.1:\d+: got handsim .*, need handsim 0.0.1, commit 0123456, as where the study was begun"):
        hs.study.rollouts(whole[0], client=Other(), out=tmp_path)
    assert not (tmp_path / PARTS).exists()


# Oracle: one machine. The scheduler is killed, a new one is started, and the command is given again.
def test_a_killed_scheduler_and_the_command_again(whole, tmp_path):
    file, expected = whole

    def started(*words):
        return subprocess.Popen([sys.executable, "-m", *map(str, words)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def cluster(port):
        scheduler = started("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard", "--no-show")
        worker = started("distributed.cli.dask_worker", f"tcp://127.0.0.1:{port}", "--nthreads", 1, "--no-dashboard", "--death-timeout", 20)
        return scheduler, worker

    processes = []
    try:
        for attempt, port in enumerate((18786, 18787)):
            processes += (first := cluster(port))
            time.sleep(3)
            run = started("handsim", "rollouts", file, "--out", tmp_path / "out", "--on", f"dask://127.0.0.1:{port}", "--resume")
            processes.append(run)
            if attempt == 0:
                for _ in range(3000):
                    if (tmp_path / "out" / PARTS).exists():
                        break
                    time.sleep(0.01)
                first[0].kill()
            _, errors = run.communicate(timeout=120)
            assert run.returncode == 0 or (attempt == 0 and "what computes the rows has gone" in errors), errors
        assert contents(tmp_path / "out") == expected
    finally:
        for process in processes:
            process.kill()
            process.communicate()
