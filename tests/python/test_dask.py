"""Rollouts on a Dask cluster of processes, of which some die, come and differ; more kills, and killed schedulers: cluster_kills.py."""
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from rollout_studies import SHORT_CHUNKS, Cluster, Killer, contents, records, wait_for_workers, write_study

import handsim as hs
from handsim import _rollouts
from handsim._rollouts import PARTS
from handsim._validate import Measurements

try:
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
def cluster(tmp_path_factory):
    # A task whose worker has died twice is given back. Workers have no nannies: those of Dask of 2022 may give up after some deaths, or begin a
    # worker whose name the scheduler still has.
    with Cluster(tmp_path_factory.mktemp("cluster"), 2, DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES="1") as made:
        ended = threading.Event()

        def keep_two() -> None:
            while not ended.wait(0.1):
                made.replace_ended()

        keeper = threading.Thread(target=keep_two)
        keeper.start()
        yield made
        ended.set()
        keeper.join()


@pytest.fixture
def client(cluster):
    with distributed.Client(cluster.address, set_as_default=False) as made:
        wait_for_workers(made, 2)
        yield made


class Proxy:
    """A client that does something else with what is submitted."""

    def __init__(self, client):
        self._client = client

    def __getattr__(self, name):
        return getattr(self._client, name)


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

    class Crashing(Proxy):
        """At row 4 the process of the worker ends."""

        def submit(self, call, *arguments, **more):
            return client.submit(call if len(arguments) == 1 else _dies_at_4, *arguments, **more)

    hs.study.rollouts(file, client=Crashing(client), out=tmp_path / "out")
    rows = (tmp_path / "out/rollouts.csv").read_text().splitlines()
    assert [i - 1 for i, row in enumerate(rows) if "crashed" in row] == [4] and len(rows) == 7
    wait_for_workers(client, 2)


def _dies_at_4(work, first, last):
    if first <= 4 < last:
        os._exit(9)
    return _rollouts.rows_of(work, first, last)


# Oracle: one machine. A chunk for which no worker is good enough stands for one that the scheduler has lost.
def test_what_a_scheduler_has_lost_is_sent_again(whole, client, tmp_path, monkeypatch, capfd):
    file, expected = whole
    monkeypatch.setattr(_rollouts, "QUIET", 2)

    class Losing(Proxy):
        lost = False

        def submit(self, call, *arguments, **more):
            if len(arguments) > 1 and not self.lost:
                self.lost = True
                more["resources"] = {"nobody": 1}
            return client.submit(call, *arguments, **more)

    hs.study.rollouts(file, client=Losing(client), out=tmp_path)
    assert "nothing has come for 2 s, and no worker computes any of it: what is in work is sent again" in capfd.readouterr().err
    assert contents(tmp_path) == expected


# Oracle: what the units themselves write.
def test_what_takes_long_is_computed_once(client, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr(_rollouts, "QUIET", 0.5)
    assert _rollouts.map_units(_rollouts.executor_of(client, 0), _slow, str(tmp_path), 3) == [0, 1, 2]
    assert [(tmp_path / str(unit)).read_text() for unit in range(3)] == ["x"] * 3
    assert "sent again" not in capfd.readouterr().err


def _slow(folder, unit):
    with open(os.path.join(folder, str(unit)), "a") as file:
        file.write("x")
    time.sleep(3)
    return unit


# Oracle: the worker's name, and what is other; no row is there.
def test_a_worker_of_another_build_is_refused_by_name(whole, client, tmp_path):
    class Other(Proxy):
        def submit(self, call, *arguments, **more):
            if len(arguments) == 1:
                work = arguments[0]
                arguments = (work._replace(origin=[*work.origin[:2], "handsim 0.0.1, commit 0123456", *work.origin[3:]], key="other"),)
            return client.submit(call, *arguments, **{**more, **({"key": "other"} if "key" in more else {})})

    with pytest.raises(hs.Error, match=r"^worker tcp://127.0.0.1:\d+: got handsim .*, need handsim 0.0.1, commit 0123456, as where the study was begun"):
        hs.study.rollouts(whole[0], client=Other(client), out=tmp_path)
    assert not (tmp_path / PARTS).exists()


FAULT_AFTER_A_CHUNK = """
import os, time
from handsim import _rollouts
add, _rollouts.SILENT = _rollouts.Parts.add, 3
def then_fault(self, rows):
    add(self, rows)
    os.kill({process}, {fault})
    print(time.monotonic(), flush=True)
_rollouts.Parts.add = then_fault
"""


# Oracle: one machine, and a time limit. Dask's client alone waits for minutes for a scheduler that is killed or hangs.
@pytest.mark.parametrize("fault", [signal.SIGKILL, signal.SIGSTOP])
def test_a_scheduler_that_is_gone_ends_the_study_soon(whole, tmp_path, fault):
    file, expected = whole
    command = ["rollouts", str(file), "--out", str(tmp_path / "out"), "--resume", "--on"]
    with Cluster(tmp_path, 2) as cluster:
        code = FAULT_AFTER_A_CHUNK.format(process=cluster.scheduler.pid, fault=int(fault)) + SHORT_CHUNKS
        run = subprocess.run([sys.executable, "-c", code, *command, cluster.on], capture_output=True, text=True, timeout=200)
        assert time.monotonic() - float(run.stdout.split()[0]) < 18
    assert run.returncode == 1 and re.search(r"^what computes the rows has gone \(.+\); the same command with --resume goes on$", run.stderr, re.M)
    assert records(tmp_path / "out") > 0
    with Cluster(tmp_path, 1) as cluster:
        subprocess.run([sys.executable, "-m", "handsim", *command, cluster.on], check=True)
    assert contents(tmp_path / "out") == expected


# Oracle: a worker that comes after the line; the table of one machine.
def test_a_cluster_without_workers_is_said(whole, tmp_path, monkeypatch, capfd):
    file, expected = whole
    monkeypatch.setattr(_rollouts, "ALONE", 0.5)
    with Cluster(tmp_path, 0) as cluster, distributed.Client(cluster.address) as client:
        run = threading.Thread(target=hs.study.rollouts, args=(file,), kwargs={"client": client, "out": tmp_path / "out"})
        run.start()
        errors, end = "", time.monotonic() + 60
        while "has no worker" not in errors and time.monotonic() < end:
            time.sleep(0.1)
            errors += capfd.readouterr().err
        assert re.search(rf"^waiting for \d+ s: the scheduler {cluster.address} has no worker; dask worker {cluster.address} starts one$", errors, re.M)
        cluster.add()
        run.join()
    assert errors.count("has no worker") == 1 and contents(tmp_path / "out") == expected


# Oracle: the function itself, and its own error: also one of the system is no sign that the workers have gone.
def test_any_pure_function_of_a_number_is_computed(client):
    assert _rollouts.map_units(_rollouts.executor_of(client, 0), pow, 3, 200) == [3**unit for unit in range(200)]
    with pytest.raises(ZeroDivisionError):
        _rollouts.map_units(_rollouts.executor_of(client, 0), divmod, 3, 2)
    with pytest.raises(hs.Error, match="^rows 0 to 0: FileNotFoundError: .*No such file or directory: '/no/such/folder'") as raised:
        _rollouts.map_units(_rollouts.executor_of(client, 0), _listed, "/no/such/folder", 1)
    assert raised.value.kind == "output" and isinstance(raised.value.__cause__, FileNotFoundError)
    with pytest.raises(hs.Error, match="_exit: unit 0 ended the worker that computed it, 2 times alone"):
        _rollouts.map_units(_rollouts.executor_of(client, 0), _exit, 9, 1)
    wait_for_workers(client, 2)


def _exit(status, unit):
    os._exit(status)


def _listed(folder, unit):
    return os.listdir(folder)


# Oracle: one process. The files travel: their folder is gone when workers read them.
def test_drawn_hands_of_measurements_are_measured_by_workers(client, tmp_path, monkeypatch):
    own, text = tmp_path / "own", (hs.data_path() / "config/validate.yaml").read_text()
    for name in ("config/persons", "handmodels"):
        shutil.copytree(hs.data_path() / name, own / name)
    # The first rows: arms of muscles.
    (own / "config/few.yaml").write_text("\n  - {name:".join(text.split("\n  - {name:")[:4]))
    monkeypatch.chdir(own)
    rows, file = Measurements(Path("config/few.yaml")), own / "config/few.yaml"
    one = [rows.drawn_values(hand) for hand in range(20)]
    assert hs.study.validate(file, uncertain=20, client=client).text == hs.study.validate(file, uncertain=20).text
    shutil.rmtree(own)
    assert np.isfinite(one).all() and np.std(one, axis=0).all()
    assert np.array_equal(_rollouts.map_units(_rollouts.executor_of(client, 0), Measurements.drawn_values, rows, 20), one)
    with pytest.raises(hs.Error, match="client: got one without drawn hands, need uncertain beside it"):
        hs.study.validate(client=client)


# Oracle: the worker's name, and what is other.
def test_units_are_refused_by_workers_of_another_build(client, monkeypatch):
    monkeypatch.setattr(_rollouts, "units_origin", lambda: ("handsim 0.0.1, commit 0123456", *_rollouts._core.mathematics))
    with pytest.raises(hs.Error, match=r"^worker tcp://127.0.0.1:\d+: got handsim .*, need handsim 0.0.1, commit 0123456"):
        _rollouts.map_units(_rollouts.executor_of(client, 0), pow, 3, 2)
