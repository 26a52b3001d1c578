"""Rollouts: the same bytes however they are computed, kept and resumed."""
import csv
import json
import os
import random
import re
import signal
import subprocess
import sys
import time
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest
from rollout_studies import FILES, contents, write_study

import handsim as hs
from handsim import _core, _rollouts, _rollouts_files
from handsim._rollouts import PARTS, Asked, Parts, Rows, open_study, rows_of, work_of

try:
    import h5py
except ImportError:
    h5py = None
pytestmark = pytest.mark.skipif(h5py is None, reason="h5py is not installed: rollouts.h5 is not written")


def command(*words, **more):
    return subprocess.run([sys.executable, "-m", "handsim", *map(str, words)], capture_output=True, text=True, timeout=300, **more)


def started(*words):
    return subprocess.Popen([sys.executable, "-m", "handsim", *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def wait_for_rows(out: Path, least: int = 1) -> None:
    """Until rows are on the disk, at most a minute."""
    for _ in range(6000):
        if (out / PARTS).exists() and (out / PARTS).read_bytes().count(_rollouts.MARK) >= least:
            return
        time.sleep(0.01)
    raise AssertionError("no rows within a minute")


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A study, and its files as one thread makes them."""
    folder = tmp_path_factory.mktemp("whole")
    file = write_study(folder)
    hs.study.rollouts(file, threads=1, out=folder / "out")
    return file, contents(folder / "out")


@pytest.fixture(scope="module")
def longer(tmp_path_factory):
    """Long enough to be ended in the middle."""
    folder = tmp_path_factory.mktemp("longer")
    file = write_study(folder, count=150)
    hs.study.rollouts(file, out=folder / "out")
    return file, contents(folder / "out")


def opened(file, **more):
    asked = Asked(file, **more)
    study = open_study(asked, str(Path.cwd()), {})
    return study, work_of(asked, study, str(Path.cwd()))


# Oracle: one thread.
def test_any_threads_and_executors_give_the_same_bytes(whole, tmp_path):
    file, expected = whole
    hs.study.rollouts(file, threads=2, out=tmp_path / "two")
    assert contents(tmp_path / "two") == expected
    assert not (tmp_path / "two" / PARTS).exists()
    with ThreadPoolExecutor(3) as pool:
        hs.study.rollouts(file, client=pool, out=tmp_path / "pool")
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        hs.study.rollouts(file, client=pool, out=tmp_path / "processes")
    assert contents(tmp_path / "pool") == contents(tmp_path / "processes") == expected


# Oracle: the function itself, in the order of the units.
def test_any_pure_function_of_a_number_is_computed():
    told = []
    executor = _rollouts.executor_of(None, 2)
    assert _rollouts.map_units(executor, pow, 3, 50, told=told.append) == [3**unit for unit in range(50)]
    executor.close()
    assert told[-1] == 1 and told == sorted(told)
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        assert _rollouts.map_units(_rollouts.executor_of(pool, 0), pow, 3, 50) == [3**unit for unit in range(50)]


def _dies(work, first, last):
    if first <= 5 < last:
        os._exit(9)
    return rows_of(work, first, last)


# Oracle: an executor of the standard library is broken for good by one process that dies; rows that came before stay.
def test_a_broken_executor_is_a_sentence(whole, tmp_path):
    class Dying:
        def __init__(self, pool):
            self.pool = pool

        def submit(self, _, *arguments):
            return self.pool.submit(_dies, *arguments)

    with ProcessPoolExecutor(1, get_context("spawn")) as pool, pytest.raises(hs.Error, match="what computes the rows has gone") as lost:
        hs.study.rollouts(whole[0], client=Dying(pool), out=tmp_path)
    assert lost.value.kind == "output" and (tmp_path / PARTS).exists()
    hs.study.rollouts(whole[0], resume=True, out=tmp_path)
    assert contents(tmp_path) == whole[1]


# Oracle: the study that was never stopped; the second command finds the rows of the first.
def test_a_killed_study_goes_on_to_the_same_bytes(longer, tmp_path):
    file, expected = longer
    words = ("rollouts", file, "--out", tmp_path / "out")
    process = started(*words, "--jobs", 1)
    wait_for_rows(tmp_path / "out", 3)
    process.kill()
    process.communicate()
    assert process.returncode == -signal.SIGKILL and not (tmp_path / "out/rollouts.csv").exists()
    refused = command(*words)
    assert refused.returncode == 2 and "need --resume" in refused.stderr
    resumed = command(*words, "--resume")
    assert resumed.returncode == 0, resumed.stderr
    assert contents(tmp_path / "out") == expected
    # What a job that is queued again finds.
    assert "complete already" in command(*words, "--resume").stdout


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_stopped_study_keeps_what_is_done(longer, tmp_path, number):
    file, expected = longer
    process = started("rollouts", file, "--out", tmp_path, "--jobs", 1)
    wait_for_rows(tmp_path, 2)
    process.send_signal(number)
    _, errors = process.communicate()
    told = re.search(r"stopped: (\d+) of 300 rollouts are done; the same command with --resume goes on", errors)
    assert process.returncode == 1 and told and 0 < int(told[1]) < 300, errors
    again = command("rollouts", file, "--out", tmp_path, "--resume")
    assert f"  {300 - int(told[1])} rollouts in " in again.stdout, again.stderr
    assert contents(tmp_path) == expected


# Oracle: the whole study; files of ranges, one after the other, are that of all.
def test_ranges_are_one_study_after_cat(whole, tmp_path):
    file, expected = whole
    (tmp_path / "all").mkdir()
    with open(tmp_path / "all" / PARTS, "wb") as joined:
        for first, last in ((8, 12), (0, 5), (4, 9)):
            part = tmp_path / str(first)
            done = command("rollouts", file, "--out", part, "--range", f"{first}:{last}")
            assert done.returncode == 0 and not (part / "rollouts.csv").exists(), done.stderr
            joined.write((part / PARTS).read_bytes())
    done = command("rollouts", file, "--out", tmp_path / "all", "--resume")
    assert done.returncode == 0 and "  0 rollouts in " in done.stdout, done.stderr
    assert contents(tmp_path / "all") == expected
    for wrong in ("5:3", "5", ":", "-1:3", "0:13", "a:b"):
        assert command("rollouts", file, "--out", tmp_path / "no", "--range", wrong).returncode == 2


# Oracle: what is damaged is computed again, to the bytes of the whole study, or is refused and left as it is.
def test_damaged_rows_are_computed_again(whole, tmp_path):
    file, expected = whole
    dice = random.Random(5)
    command("rollouts", file, "--out", tmp_path / "part", "--range", "0:12")
    good = (tmp_path / "part" / PARTS).read_bytes()
    for trial in range(25):
        data = bytearray(good)
        for _ in range(dice.choice([1, 1, 3])):
            at = dice.randrange(len(data))
            kind = dice.randrange(5)
            if kind == 0:
                del data[max(at, 1):]
            elif kind == 1:
                data[at] ^= 1 << dice.randrange(8)
            elif kind == 2:
                data[at:at] = data[at:dice.randrange(at, len(data)) + 1]
            elif kind == 3:
                data += bytes(dice.randrange(5000))
            else:
                data = data + good[dice.randrange(len(good)):]
        out = tmp_path / str(trial)
        out.mkdir()
        (out / PARTS).write_bytes(data)
        try:
            hs.study.rollouts(file, resume=True, out=out)
        except hs.Error as error:
            assert error.kind == "input" and (out / PARTS).read_bytes() == data
            continue
        assert contents(out) == expected


def test_what_is_no_file_of_rows_is_refused(whole, tmp_path):
    file, _ = whole
    (tmp_path / PARTS).write_bytes(b"something else")
    with pytest.raises(hs.Error, match="a file that is none"):
        hs.study.rollouts(file, resume=True, out=tmp_path)
    command("rollouts", file, "--out", tmp_path / "part", "--range", "0:2")
    # 50 GB of zeros are refused; they are not read.
    os.truncate(tmp_path / "part" / PARTS, 50 << 30)
    with pytest.raises(hs.Error, match="bytes after the last whole record"):
        hs.study.rollouts(file, resume=True, out=tmp_path / "part")


# Oracle: rows and files of another study, which must stay.
def test_another_study_is_named_and_left_alone(whole, tmp_path):
    file, _ = whole
    hs.study.rollouts(file, out=tmp_path / "done")
    before = contents(tmp_path / "done")
    with pytest.raises(hs.Error, match=r"\(seed 3, study .*\(seed 77, study "):
        hs.study.rollouts(file, seed=77, resume=True, out=tmp_path / "done")
    assert contents(tmp_path / "done") == before
    command("rollouts", file, "--out", tmp_path / "part", "--range", "0:2")
    rows = (tmp_path / "part" / PARTS).read_bytes()
    with pytest.raises(hs.Error, match=r"another study or build \(seed 3, study .*\(seed 77, study "):
        hs.study.rollouts(file, seed=77, resume=True, out=tmp_path / "part")
    assert (tmp_path / "part" / PARTS).read_bytes() == rows
    (tmp_path / "done/summary.json").write_text("{}")
    with pytest.raises(hs.Error, match="no summary of rollouts"):
        hs.study.rollouts(file, resume=True, out=tmp_path / "done")


# Oracle: a table that cannot be written costs no row; the exit status is that of lost output.
def test_a_table_that_cannot_be_written_leaves_its_rows(longer, tmp_path):
    file, expected = longer
    process = started("rollouts", file, "--out", tmp_path, "--jobs", 1)
    wait_for_rows(tmp_path)
    (tmp_path / "rollouts.h5/in_the_way").mkdir(parents=True)
    _, errors = process.communicate()
    assert process.returncode == 1 and "300 rows without their table" in errors
    (tmp_path / "rollouts.h5/in_the_way").rmdir()
    (tmp_path / "rollouts.h5").rmdir()
    again = command("rollouts", file, "--out", tmp_path, "--resume")
    assert "  0 rollouts in " in again.stdout, again.stderr
    assert contents(tmp_path) == expected


def limited(size):
    def limit():
        import resource

        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return limit


# Oracle: where no file may be so large, rows or table are lost output, with a reason and without a crash; what was kept
# before is whole. HDF5 meets the end of the disk in its first dataset, in a later one, and when it closes the file.
@pytest.mark.parametrize("share, lost", [(0.3, "rollouts.part"), (0.7, "rollouts.h5"), (0.9, "rollouts.h5"), (0.999, "rollouts.h5")])
def test_a_full_disk_is_a_sentence(whole, tmp_path, share, lost):
    file, expected = whole
    size = int(share * len(expected["rollouts.h5"]))
    done = command("rollouts", file, "--out", tmp_path, preexec_fn=limited(size))
    assert done.returncode == 1 and f"{tmp_path / lost}: got a file that cannot be written" in done.stderr and "Traceback" not in done.stderr, done.stderr
    assert [each.name for each in tmp_path.iterdir()] == [PARTS]
    assert command("rollouts", file, "--out", tmp_path, "--resume").returncode == 0
    assert contents(tmp_path) == expected


class KilledWorker(Exception):
    """As that of distributed, for a worker that has died."""


class Faults:
    """An executor whose processes die: at some rows always, and now and then by chance."""

    _max_workers = 2

    def __init__(self, crashing, chance=0.0):
        self.crashing, self.chance, self.random, self.calls = crashing, chance, random.Random(2), 0

    def submit(self, call, work, first, last):
        self.calls += 1
        future = Future()
        if any(first <= row < last for row in self.crashing) or (last - first > 1 and self.random.random() < self.chance):
            future.set_exception(KilledWorker(first))
        else:
            future.set_result(call(work, first, last))
        return future


# Oracle: the table without crashes, but for the lines of those rows.
def test_a_row_that_ends_its_worker_is_a_row(whole, tmp_path):
    file, expected = whole
    study = hs.study.rollouts(file, client=Faults({4, 9}, 0.3), out=tmp_path)
    lines, good = (text.decode().splitlines() for text in (contents(tmp_path)["rollouts.csv"], expected["rollouts.csv"]))
    assert [i - 1 for i, (a, b) in enumerate(zip(lines, good)) if a != b] == [4, 9]
    row = next(csv.DictReader([lines[0], lines[5]]))
    assert row["ended"] == "crashed" and row["error"] == "ended the worker that computed it, 2 times alone (KilledWorker)"
    assert lines[5].split(",")[:6] == good[5].split(",")[:6], "what was drawn is known"
    assert study.summary["ended"] == {"crashed": 2, "end": 10}
    hs.study.rollouts(file, client=Faults(set(), 0.5), out=tmp_path / "chance")
    assert contents(tmp_path / "chance") == expected


# Oracle: the same rows from what travels, in a process that has neither the files nor the folder.
def test_study_and_meshes_travel_with_the_work(tmp_path):
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0], [0, 0, 0.1]])
    facets = "".join("facet normal 0 0 0\nouter loop\n" + "".join(f"vertex {x} {y} {z}\n" for x, y, z in corners[list(face)]) + "endloop\nendfacet\n"
                     for face in ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)))
    (tmp_path / "wedge.stl").write_text(f"solid wedge\n{facets}endsolid\n")
    (tmp_path / "scene.yaml").write_text("objects: [{name: wedge, shape: convex_mesh, mesh: wedge.stl, mass: 1, position: [0, 0, 0]}]\n"
                                         "effects: [gravity]\nduration: 0.02\n")
    (tmp_path / "study.yaml").write_text("scene: scene.yaml\ncount: 8\nvary: {objects.0.mass: {normal: {sd: 20}}}\n")
    _, work = opened(tmp_path / "study.yaml")
    here = rows_of(work, 0, 8).csv
    assert b"refused" in here and b",end," in here
    for file in tmp_path.iterdir():
        file.unlink()
    with ProcessPoolExecutor(1, get_context("spawn"), initializer=os.chdir, initargs=("/",)) as pool:
        assert pool.submit(rows_of, work, 0, 8).result().csv == here


# Oracle: the sentence names worker, difference and need, and no row is computed.
@pytest.mark.parametrize("part, other", [(2, "handsim 0.0.1, commit 0123456"), (3, "another mathematics library"), (1, "scene 0123456789abcdef")])
def test_another_build_data_or_library_is_refused_by_name(whole, part, other):
    _, work = opened(whole[0])
    wrong = work._replace(origin=[*work.origin[:part], other, *work.origin[part + 1:]], key=f"other {part}")
    with pytest.raises(hs.Error, match=rf"^worker .*: got {re.escape(work.origin[part])}, need {re.escape(other)}, as where the study was begun"):
        rows_of(wrong, 0, 1)


def test_what_cannot_compute_is_refused(whole, tmp_path):
    for wrong in (3, "tcp://localhost:8786", object()):
        with pytest.raises(hs.Error, match="client: got "):
            hs.study.rollouts(whole[0], client=wrong, out=tmp_path)
    for address in ("localhost:8786", "dask://localhost", "dask://127.0.0.1:1"):
        done = command("rollouts", whole[0], "--out", tmp_path, "--on", address)
        assert done.returncode == 2 and done.stderr.startswith("--on: got "), done.stderr
    for option, value in (("--count", "0"), ("--count", "two"), ("--jobs", "-1"), ("--seed", "1e3"), ("--engine", "bullet"), ("--chunk", "4")):
        done = command("rollouts", whole[0], "--out", tmp_path, option, value)
        assert done.returncode == 2 and done.stderr.startswith(f"{option}: got "), done.stderr
    assert not list(tmp_path.iterdir())


# Oracle: chunks of about a second; towards the end all slots have work.
def test_chunks_are_a_second_of_work():
    waiting = _rollouts._Queue([(0, 10_000)])
    assert waiting.next(4) == (0, 1)
    waiting.measured(Rows(0, 1, b"", {}, [], 0.01))
    assert waiting.next(4) == (1, 101)
    waiting.measured(Rows(1, 101, b"", {}, [], 100.0))
    first, last = waiting.next(4)
    assert last - first == 3
    for _ in range(200):
        waiting.measured(Rows(0, 1, b"", {}, [], 1e-5))
    sizes = []
    while chunk := waiting.next(4):
        sizes.append(chunk[1] - chunk[0])
    assert sum(sizes) == 10_000 - 104 and sizes[-1] <= 2 and max(sizes) == (10_000 - 104) // 8 + 1
    assert sizes == sorted(sizes, reverse=True)


# Oracle: of 21 evenly spaced numbers the 5th, 50th and 95th percentile are the 2nd, 11th and 20th. A curve that ends early
# counts as long as it lasts.
def test_bands_are_the_percentiles_of_the_curves_that_are_there():
    names = ["time[s]", "x.torque[N_m]"]
    curves = [(names, np.array([[0.5, i]] + [[1, 70]] * (i == 7))) for i in range(21, 0, -1)]
    assert _rollouts_files.bands_text(curves) == "time[s],x.torque.p5[N_m],x.torque.p50[N_m],x.torque.p95[N_m]\n0.5,2,11,20\n1,70,70,70\n"


# Oracle: a ball of radius 0.1 m falls 0.78 m in 0.4 s, and touches the ground from a height of 0.3 m alone.
def test_outcomes_are_figures_or_paths_of_the_summary(tmp_path):
    (tmp_path / "ball.yaml").write_text("objects: [{name: ball, shape: sphere, radius: 0.1, mass: 1, position: [0, 0, 0]}]\n"
                                        "effects: [gravity, object_contact, ground_contact]\nground: {height: 0}\n")
    (tmp_path / "study.yaml").write_text("scene: ball.yaml\nset: {duration: 0.4}\ncount: 8\nvary:\n  objects.0.position.2: {each: [0.3, 1.5, 5]}\n"
                                         "  objects.0.mass: {uniform: [1, 2]}\noutcome: [penetration, counts.contacts]\n")
    summary = hs.study.rollouts(tmp_path / "study.yaml").summary
    of = summary["outcomes"]["counts.contacts"]
    means = of["keys"]["objects.0.position.2"]["means"]
    assert of["of"] == 24 and len(means) == 3 and means[0]["mean"]["value"] > 0 and means[2]["mean"]["value"] == 0
    assert of["variance_shares"]["objects.0.position.2"] > 0.9 and "penetration[m]" in summary["outcomes"]


# Oracle: the text of the table, and memory for one column alone.
def test_columns_are_read_in_groups_that_fit(longer, tmp_path, monkeypatch):
    file, expected = longer
    monkeypatch.setattr(_rollouts_files, "BUDGET", 1.0)
    hs.study.rollouts(file, out=tmp_path)
    assert contents(tmp_path) == expected
    rows = list(csv.DictReader(expected["rollouts.csv"].decode().splitlines()))
    with h5py.File(tmp_path / "rollouts.h5") as file:
        for name, data in file["rollouts"].items():
            column = [row[name.replace(" per ", "/")] for row in rows]
            if h5py.check_string_dtype(data.dtype):
                assert list(data.asstr()) == column, name
            else:
                assert np.array_equal(data[:], [float(text or "nan") for text in column], equal_nan=True), name
    assert json.loads(expected["summary.json"])["table_hash"] == f"{_core.bytes_hash(expected['rollouts.csv']):016x}"


def test_parts_of_a_torn_record_are_left_out(whole, tmp_path):
    study, work = opened(whole[0])
    parts = Parts(tmp_path / PARTS, study.head)
    for first, last in ((4, 6), (0, 1), (7, 9)):
        parts.add(rows_of(work, first, last))
    parts.close()
    os.truncate(parts.path, len(parts) - 3)
    again = Parts(parts.path, study.head)
    again.read()
    assert again.missing(0, 12) == [(1, 4), (6, 12)]
    again.add(rows_of(work, 6, 8))
    again.close()
    last = Parts(parts.path, study.head)
    last.read()
    assert last.missing(0, 12) == [(1, 4), (8, 12)]
    assert b"".join(last.lines(5, 7)) == rows_of(work, 5, 7).csv
