"""Who computes which rows of a study of rollouts, and how they are kept until all are there.

The one unit of work is `rows_of`: rows [first, last) as a pure function of study, seed and range. Threads call it on this
machine, the workers of a Dask cluster on many, and whatever else has ``submit`` as the executors of concurrent.futures.
`map_units` has any other pure function of a number computed in the same ways.
"""
from __future__ import annotations

import asyncio
import concurrent.futures
import hashlib
import json
import os
import queue
import threading
import time
import uuid
import zlib
from collections import deque
from concurrent.futures import BrokenExecutor, CancelledError, ThreadPoolExecutor
from contextlib import suppress
from functools import lru_cache
from pathlib import Path
from typing import Any, Callable, Iterator, NamedTuple, Optional, Sequence, Union

import numpy as np

from . import _core
from ._errors import Error, Problem, input_error
from ._files import PathText
from ._progress import print_line

Series = tuple[list[str], Any]
"""Curves of one rollout: names with units, and numbers row by row."""
Range = tuple[int, int]

PARTS = "rollouts.part"
"""The file of the rows that are there, while a study runs."""
MARK = b"\n#handsim-rows "
SECONDS = 1.0
"""Work of a chunk of rows, at least: a crash costs so much."""
SECONDS_A_SLOT = 0.004
"""The same for each core: a scheduler that needs 1 ms for a task is idle for three quarters of the time."""
MOST_ROWS = 20_000
"""Of a chunk."""
TRIES = 2
"""Of a row that ends its worker, alone, once it is the suspect of a crash."""
MOST_DAMAGED = 1 << 30
"""Bytes in a row that are no record: more is a file of something else."""
PATIENCE = 2.0
"""Seconds for what a scheduler that is there does at once."""
QUIET = 60.0
"""Seconds without any chunk before it is asked whether any worker computes one, and if none does all are sent again; twice as long the next time."""
ASKED = 2.0
"""Seconds from one question to a scheduler how many threads it has to the next."""
SILENT = 30.0
"""Seconds without an answer of a scheduler before the study ends."""
ALONE, ALONE_AGAIN = 10.0, 60.0
"""Seconds without any worker before a line says so, and until the next line."""
TIMEOUTS = (asyncio.TimeoutError, concurrent.futures.TimeoutError)
STUDIES = 4
"""That a worker keeps in memory."""
STUDY = "handsim-study-"
"""How the keys of studies begin that Dask has."""
CRASHES = {"KilledWorker", "WorkerCrashedError", "LocalRayletDiedError", "NodeDiedError", "OutOfMemoryError"}
"""What executors raise for work whose process has ended."""


class Asked(NamedTuple):
    """A study as a command names it."""

    file: PathText
    uncertain: bool = False
    """The file is a scene, whose uncertain hands are drawn."""
    overrides: tuple[str, ...] = ()
    draws: Optional[int] = None
    seed: Optional[int] = None
    bands: bool = True
    inverse: Optional[tuple[Any, ...]] = None
    """Motion, names, loads, cut-off, clamp and least activation of `handsim inverse`."""


class Work(NamedTuple):
    """A study that travels to any machine: what is asked, and all that it reads."""

    asked: Asked
    folder: str
    """From which its paths go."""
    files: dict[str, bytes]
    """Contents by absolute path."""
    origin: list[str]
    """What rows depend on: study, scene, build, mathematics library."""
    key: str
    """The hash of all these."""

    def __repr__(self) -> str:
        return f"<{self.asked.file}, {self.key}>"


class Rows(NamedTuple):
    """Rows [first, last) of a study."""

    first: int
    last: int
    csv: bytes
    trajectories: dict[int, Series]
    curves: list[Series]
    seconds: float
    """That they took."""


def open_study(asked: Asked, folder: str, files: dict[str, bytes]) -> Any:
    """:raises Error: of kind input with the problems of the study"""
    return _core.rollouts(Path(asked.file), asked.uncertain, list(asked.overrides), asked.draws, asked.seed, asked.bands, asked.inverse,
                          Path(folder), files)


@lru_cache(maxsize=1)
def _own_build() -> list[str]:
    """What a commit does not say: a module that was built from changed sources."""
    if "dirty" not in _core.commit:
        return []
    return [f"module {hashlib.sha256(Path(_core.__file__).read_bytes()).hexdigest()[:16]}"]


@lru_cache(maxsize=1)
def units_origin() -> tuple[str, ...]:
    """Of results that are computed in Python."""
    return (f"handsim {_core.version}, commit {_core.commit}", *_own_build(), _core.mathematics, f"numpy {np.__version__}")


def _check_origin(own: Sequence[str], needed: Sequence[str]) -> None:
    """:raises Error: of kind input where a worker would compute other bits"""
    has, needs = ([part for part in mine if part not in other] for mine, other in ((own, needed), (needed, own)))
    if has or needs:
        raise input_error(f"worker {_place()}", ", ".join(has), ", ".join(needs) + ", as where the study was begun")


def work_of(asked: Asked, study: Any, folder: str) -> Work:
    parts = (asked._replace(file=str(asked.file)), folder, study.carried, study.head["origin"] + _own_build())
    return Work(*parts, key=hashlib.sha256(repr(parts).encode()).hexdigest()[:24])


_lock = threading.Lock()
_studies: dict[str, Any] = {}


def _place() -> str:
    """The name of this worker."""
    try:
        from distributed import get_worker

        return str(get_worker().address)
    except (ImportError, ValueError):
        import socket

        return f"{socket.gethostname()}, process {os.getpid()}"


def _study_of(work: Work) -> Any:
    """The study in this process, read once. :raises Error: of kind input where its rows would be others here"""
    with _lock:
        found = _studies.get(work.key)
        if found is None:
            try:
                found = open_study(work.asked, work.folder, work.files)
            except Error as error:
                raise Error(f"worker {_place()}: {error}", error.kind, error.problems) from None
            _check_origin(found.head["origin"] + _own_build(), work.origin)
            while len(_studies) >= STUDIES:
                del _studies[next(iter(_studies))]
            _studies[work.key] = found
    return found


_never = _core.stop()


def rows_of(work: Work, first: int, last: int, stop: Any = None) -> Rows:
    """Rows [first, last): a pure function, which any thread, process or machine may call.

    :param stop: ends it early, with the rows that are done; of this process
    :raises Error: of kind input where build, data or mathematics library differ from those of the study's beginning
    """
    study = _study_of(work)
    begin = time.perf_counter()
    end, csv, trajectories, curves = study.rows(first, last, _never if stop is None else stop)
    return Rows(first, end, csv, trajectories, curves, time.perf_counter() - begin)


class Units(NamedTuple):
    """A pure function of a number, which travels with what it needs."""

    call: Callable[[Any, int], Any]
    """Of a module, which each worker imports."""
    shared: Any
    """Its first argument."""
    key: str
    origin: Sequence[str]
    """What its results depend on beside these: build, libraries."""


class Answers(NamedTuple):
    """Of the units [first, last)."""

    first: int
    last: int
    results: list[Any]
    seconds: float
    """That they took."""


def answers_of(work: Units, first: int, last: int, stop: Any = None) -> Answers:
    """A pure function as `rows_of`. :raises Error: of kind input on a worker of another build"""
    _check_origin(units_origin(), work.origin)
    begin = time.perf_counter()
    return Answers(first, last, [work.call(work.shared, unit) for unit in range(first, last)], time.perf_counter() - begin)


def keep_study(work: Work, study: Any) -> None:
    """What was read for the command serves its threads, too."""
    with _lock:
        _studies[work.key] = study


class Gone(Error):
    """Nobody computes anything any more."""

    def __init__(self, why: object) -> None:
        super().__init__(f"what computes the rows has gone ({why})", "output")


class Lost(Exception):
    """Nobody computes it any more, and nobody has its rows."""


class Executor:
    """Any executor in the manner of concurrent.futures: Ray's, those of mpi4py and of the standard library."""

    def __init__(self, executor: Any, slots: Optional[int] = None) -> None:
        self._executor = executor
        self._slots = slots or getattr(executor, "_max_workers", None) or os.cpu_count() or 1

    def slots(self) -> int:
        """How many chunks are computed at the same time."""
        return int(self._slots)

    def submit(self, call: Callable[..., Any], work: Any, first: int, last: int) -> Any:
        """:param call: `rows_of` or `answers_of`"""
        return self._executor.submit(call, work, first, last)

    def check(self) -> str:
        """Is called while nothing comes. :returns: a line for people, or nothing. :raises Gone: where nobody computes any more"""
        return ""

    def lost(self) -> Optional[bool]:
        """Is called after some time in which nothing came. :returns: True: there are workers, and none computes any of what is in work. None: not known yet"""
        return False

    def cancel(self, futures: list[Any]) -> None:
        """What nobody waits for any more."""
        for future in futures:
            with suppress(OSError):
                future.cancel()

    def close(self) -> None:
        pass

    def __enter__(self) -> Executor:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class Threads(Executor):
    """The cores of this machine."""

    def __init__(self, threads: int) -> None:
        count = threads or len(os.sched_getaffinity(0))
        super().__init__(ThreadPoolExecutor(count, "rollouts"), count)
        self._stop = _core.stop()

    def submit(self, call: Callable[..., Any], work: Any, first: int, last: int) -> Any:
        return self._executor.submit(call, work, first, last, self._stop)

    def close(self) -> None:
        self._stop.set()
        self._executor.shutdown(cancel_futures=True)


class Dask(Executor):
    """The workers of a Dask cluster, of which some may come and go.

    Dask's client waits for an answer as long as it takes, and for a connection 30 s each time that it is asked for something. So nothing
    here waits for the scheduler but within a time limit, and a question that is always on its way tells whether it is there.
    """

    def __init__(self, client: Any, own: bool = False) -> None:
        """:param own: the client was made for this study"""
        self._client, self._own = client, own
        self._study: Optional[Any] = None
        self._flying: dict[Any, Any] = {}
        """Futures of Dask by those that `submit` has returned."""
        self._count, self._sent = 0, 0
        self._question: Optional[Any] = None
        self._stacks: Optional[Any] = None
        """The question what workers compute."""
        self._asked, self._looked, self._silent = -np.inf, time.monotonic(), 0.0
        self._alone: Optional[float] = None
        """Since when there is no worker."""
        self._told = 0.0

    @property
    def page(self) -> str:
        """The address of Dask's own page; empty where the scheduler has none."""
        return str(self._client.dashboard_link) if "dashboard" in self._client.scheduler_info()["services"] else ""

    def _begun(self, coroutine: Any) -> Any:
        """What Dask is to do while this thread goes on. :returns: its future"""
        return asyncio.run_coroutine_threadsafe(coroutine, self._client.loop.asyncio_loop)

    def slots(self) -> int:
        self._listen()
        return max(1, self._count)

    def _listen(self) -> None:
        """:raises Gone: where the scheduler has not answered for SILENT seconds, or the client has given it up"""
        if self._client.status not in ("running", "connecting"):
            raise Gone("no scheduler answers")
        now = time.monotonic()
        # A long time without a look, as of a program that was stopped, is no time in which an answer could come.
        self._silent += min(now - self._looked, 2 * PATIENCE)
        self._looked = now
        if self._question is None and now - self._asked > ASKED:
            first, self._asked = self._asked < 0, now
            self._question = self._begun(self._threads())
            if first:
                concurrent.futures.wait([self._question], PATIENCE)
        if self._question is not None and self._question.done():
            question, self._question = self._question, None
            with suppress(Exception):
                self._count, self._silent = question.result(), 0.0
                if self._count:
                    self._alone = None
                elif self._alone is None:
                    self._alone, self._told = now, now + ALONE - ALONE_AGAIN
        if self._silent > SILENT:
            raise Gone(f"no scheduler has answered for {SILENT:.0f} s")

    async def _threads(self) -> int:
        """That the workers have together."""
        return sum((await self._client.scheduler.ncores(workers=None)).values())

    def submit(self, call: Callable[..., Any], work: Any, first: int, last: int) -> Any:
        try:
            # The study is a task of its own: it goes once to each worker, and again where all that had it have gone.
            if self._study is None or self._study.status in ("cancelled", "lost", "error"):
                self._sent += 1
                self._study = self._client.submit(_itself, work, key=f"{STUDY}{work.key}-{self._sent}")
            future = self._client.submit(call, self._study, first, last, pure=False)
        except Exception:
            # A client that has closed in the meantime has no exception of its own for it.
            self._listen()
            raise
        begun = self._begun(self._fetched(future))
        self._flying[begun] = future
        begun.add_done_callback(lambda done: self._flying.pop(done, None))
        return begun

    async def _fetched(self, future: Any) -> Any:
        """The rows, once they are here. Dask fetches what is done at the same time together, and computes again what a worker that has died had
        in its memory. No time limit is set: what is cut off begins again, and a slow machine would never have it."""
        try:
            return await self._client.gather(future, asynchronous=True)
        except (CancelledError, OSError, *TIMEOUTS) as error:
            if future.status == "error":
                raise
            raise Lost(str(error)) from None

    def check(self) -> str:
        self._listen()
        now = time.monotonic()
        if self._alone is None or now - self._told < ALONE_AGAIN:
            return ""
        self._told = now
        address = self._client.scheduler.address
        return f"waiting for {now - self._alone:.0f} s: the scheduler {address} has no worker; dask worker {address} starts one"

    def lost(self) -> Optional[bool]:
        # A scheduler of 2022 may hold a task for one of a worker that has just come and does not know of it: workers are asked.
        if self._alone is not None:
            return False
        if self._stacks is None:
            self._stacks = self._begun(self._computed())
        if not self._stacks.done():
            return None
        asked, self._stacks = self._stacks, None
        with suppress(Exception):
            return not asked.result()
        return None

    async def _computed(self) -> bool:
        """Any of what is in work is computed by a worker, or is done and on its way."""
        flying = list(self._flying.values())
        if any(future.status == "finished" for future in flying):
            return True
        own = {str(future.key) for future in [*flying, self._study] if future is not None}
        stacks = await self._client.scheduler.call_stack(keys=None)
        return any(key in own for of_worker in stacks.values() for key in of_worker)

    def cancel(self, futures: list[Any]) -> None:
        self._study = None
        sent = [self._flying[each] for each in futures if each in self._flying]
        if sent and self._client.status == "running":
            asked = self._begun(self._client.cancel(sent, asynchronous=True))
            with suppress(OSError, CancelledError, *TIMEOUTS):
                asked.result(PATIENCE)
            asked.cancel()
            super().cancel(futures)

    def close(self) -> None:
        self._study = None
        for question in (self._question, self._stacks):
            if question is not None:
                question.cancel()
        if self._own:
            with suppress(OSError, *TIMEOUTS):
                self._client.close(timeout=PATIENCE)


def _itself(work: Any) -> Any:
    return work


def dask_at(address: str) -> Dask:
    """:param address: ``dask://HOST:PORT`` of a scheduler. :raises Error: of kind input"""
    host = address.removeprefix("dask://")
    if host == address or not host.rpartition(":")[2].isdigit():
        raise input_error("--on", address, "dask://HOST:PORT of a Dask scheduler")
    try:
        import distributed
    except ImportError:
        raise input_error("--on", "no package distributed", "pip install distributed, or apt install python3-distributed") from None
    connect: Any = distributed.Client
    try:
        return Dask(connect(f"tcp://{host}", timeout=20, set_as_default=False), own=True)
    except (OSError, TimeoutError) as error:
        raise input_error("--on", f"{address}, where no scheduler answers ({str(error)[:200]})", "that of dask scheduler") from None


def executor_of(client: Any, threads: int) -> Executor:
    """:param client: a client or cluster of Dask, an executor, or None: this machine"""
    if client is None:
        return Threads(threads)
    if hasattr(client, "nthreads") and hasattr(client, "scatter"):
        return Dask(client)
    if not callable(getattr(client, "submit", None)):
        raise input_error("client", type(client).__name__, "a distributed.Client, or an executor with submit as in concurrent.futures")
    return Executor(client)


def _is_crash(error: BaseException) -> bool:
    return any(each.__name__ in CRASHES for each in type(error).__mro__)


class _Queue:
    """Ranges that nobody computes yet, in chunks of about a second."""

    def __init__(self, missing: list[Range]) -> None:
        self._ranges = deque(missing)
        self.left = sum(last - first for first, last in missing)
        self._seconds: Optional[float] = None

    def measured(self, rows: Union[Rows, Answers]) -> None:
        each = rows.seconds / max(1, rows.last - rows.first)
        self._seconds = each if self._seconds is None else 0.7 * self._seconds + 0.3 * each

    def next(self, slots: int) -> Optional[Range]:
        """Towards the end chunks are smaller, so that all workers end together."""
        if not self._ranges:
            return None
        size = 1
        if self._seconds is not None:
            wanted = max(SECONDS, SECONDS_A_SLOT * slots) / max(self._seconds, 1e-9)
            size = int(min(MOST_ROWS, max(1, wanted), self.left / (2 * slots) + 1))
        first, last = self._ranges.popleft()
        end = min(last, first + size)
        if end < last:
            self._ranges.appendleft((end, last))
        self.left -= end - first
        return first, end

    def again(self, *ranges: Range) -> None:
        self._ranges.extendleft(reversed(ranges))
        self.left += sum(last - first for first, last in ranges)


def collect(call: Callable[..., Any], work: Any, executor: Executor, missing: list[Range], keep: Callable[[Any], None], crashed: Callable[[int, str], None],
            wait: Callable[[], None], say: Callable[[str], None]) -> None:
    """Has all of the missing ranges computed, in any order.

    :param call: `rows_of` with a `Work`, or `answers_of` with `Units`
    :param keep: gets the rows as they come
    :param crashed: gets a row that ends its workers, and the reason
    :param wait: is called now and then; may raise, which ends the work
    :param say: gets lines for people
    :raises Gone: where nobody computes any more
    :raises Error: that of a worker; of kind output where a row has an error of the system, as of a full disk
    :raises Exception: any other of a row
    """
    waiting, done = _Queue(missing), queue.SimpleQueue[Any]()
    flying: dict[Any, Range] = {}
    suspects: deque[int] = deque()
    tries: dict[int, int] = {}
    heard, patience = time.monotonic(), QUIET
    try:
        while waiting.left or flying or suspects:
            slots = executor.slots()
            if suspects and not waiting.left and not flying:
                # Alone: another's crash is not blamed on this row.
                waiting.again((suspects[0], suspects.popleft() + 1))
            while len(flying) < 2 * slots + 1 and (chunk := waiting.next(slots)):
                try:
                    future = executor.submit(call, work, *chunk)
                except OSError as error:
                    raise Gone(error) from None
                flying[future] = chunk
                future.add_done_callback(done.put)
            try:
                future = done.get(timeout=0.2)
            except queue.Empty:
                wait()
                if line := executor.check():
                    say(line)
                lost = executor.lost() if time.monotonic() - heard > patience else None
                if lost:
                    say(f"nothing has come for {patience:.0f} s, and no worker computes any of it: what is in work is sent again")
                    executor.cancel(list(flying))
                    waiting.again(*flying.values())
                    flying.clear()
                    patience *= 2
                if lost is not None:
                    heard = time.monotonic()
                continue
            if future not in flying:
                continue
            heard = time.monotonic()
            first, last = flying.pop(future)
            try:
                rows = future.result()
            except (CancelledError, Lost):
                executor.check()
                waiting.again((first, last))
            except OSError as error:
                # Of the row: an executor that cannot be reached has said so when it was asked.
                raise Error(f"rows {first} to {last - 1}: {type(error).__name__}: {error}", "output") from error
            except Exception as error:
                if not _is_crash(error):
                    raise
                if str(getattr(error, "task", "")).startswith(STUDY):
                    # Workers died with the study, not with these rows: it is sent again.
                    waiting.again((first, last))
                elif last - first > 1:
                    waiting.again((first, (first + last) // 2), ((first + last) // 2, last))
                elif tries.setdefault(first, 0) < TRIES:
                    tries[first] += 1
                    suspects.append(first)
                else:
                    crashed(first, f"ended the worker that computed it, {TRIES} times alone ({type(error).__name__})")
            else:
                keep(rows)
                waiting.measured(rows)
                if rows.last < last:
                    waiting.again((rows.last, last))
            wait()
    except BrokenExecutor as error:
        raise Gone(error) from None
    finally:
        executor.cancel(list(flying))


def map_units(executor: Executor, call: Callable[[Any, int], Any], shared: Any, count: int, wait: Callable[[], None] = lambda: None,
              say: Callable[[str], None] = print_line, told: Optional[Callable[[float], object]] = None) -> list[Any]:
    """``[call(shared, 0), ..., call(shared, count - 1)]``, in chunks of about a second.

    :param call: a pure function of a module
    :param shared: goes to each worker once
    :param told: gets the share done
    :raises Error: of kind output for a unit that ends its workers, and as `collect`
    """
    out: list[Any] = [None] * count
    done = 0

    def keep(answers: Answers) -> None:
        nonlocal done
        out[answers.first:answers.last] = answers.results
        done += answers.last - answers.first
        if told is not None:
            told(done / count)

    def crashed(unit: int, text: str) -> None:
        raise Error(f"{call.__name__}: unit {unit} {text}", "output")

    collect(answers_of, Units(call, shared, uuid.uuid4().hex, units_origin()), executor, [(0, count)], keep, crashed, wait, say)
    return out


class Parts:
    """The rows that are there, as a file: records in the order in which they came. Files one after the other are such a file,
    too, and a record that is torn or damaged is left out.
    """

    def __init__(self, path: Path, head: dict[str, Any]) -> None:
        self.path = path
        self.id = hashlib.sha256(repr([head["origin"], head["csv"]]).encode()).hexdigest()[:16]
        self._told = {"seed": head["seed"], "size": head["size"], "origin": head["origin"]}
        self._found: list[tuple[int, int, int, list[Any]]] = []
        self._file: Any = None
        self._synced = 0.0

    def read(self) -> None:
        """Finds what is there. :raises Error: of kind input for a file that is none, or of another study or build"""
        strangers: Optional[dict[str, Any]] = None
        with open(self.path, "rb") as file:
            size = os.fstat(file.fileno()).st_size
            if file.read(len(MARK)) != MARK:
                raise input_error(str(self.path), "a file that is none", "rows of handsim rollouts")
            place = 0
            while place < size:
                record = self._record(file, place, size)
                if record is None:
                    whole, place = place, _next_mark(file, place + 1, size)
                    if place - whole > MOST_DAMAGED:
                        raise input_error(str(self.path), f"{place - whole} bytes after the last whole record, which ends at byte {whole}", "rows of handsim rollouts")
                    continue
                head, begin, end = record
                if head["id"] == self.id:
                    self._found.append((head["first"], head["last"], begin, head["parts"]))
                else:
                    strangers = strangers or head
                place = end
        if strangers:
            has, needs = parts_beyond(strangers, self._told), parts_beyond(self._told, strangers)
            raise input_error(str(self.path), f"one of another study or build ({has})", f"one of this study, by this build ({needs})")
        self._found.sort(key=lambda each: each[:3])

    @staticmethod
    def _record(file: Any, place: int, size: int) -> Optional[tuple[dict[str, Any], int, int]]:
        file.seek(place)
        line = file.readline(1 << 20)
        if line == b"\n":
            line += file.readline(1 << 20)
        try:
            if not line.startswith(MARK):
                return None
            told, _, text = line[len(MARK):].partition(b" ")
            head = json.loads(text)
            begin, length = place + len(line), sum(part[0] for part in head["parts"])
            if begin + length > size:
                return None
            crc, left = zlib.crc32(text), length
            while left:
                block = file.read(min(left, 1 << 20))
                crc, left = zlib.crc32(block, crc), left - len(block)
            return (head, begin, begin + length) if crc == int(told, 16) and head["first"] < head["last"] <= head["size"] else None
        except (ValueError, KeyError, TypeError):
            return None

    def missing(self, first: int, last: int) -> list[Range]:
        """Of [first, last)."""
        out, at = [], first
        for begin, end, *_ in self._found:
            if begin > at and at < last:
                out.append((at, min(begin, last)))
            at = max(at, end)
        if at < last:
            out.append((at, last))
        return out

    def __len__(self) -> int:
        """Bytes that are there."""
        return self.path.stat().st_size if self.path.exists() else 0

    def add(self, rows: Rows) -> None:
        """:raises Error: of kind output on a full disk; what was there before stays"""
        if rows.first == rows.last:
            return
        arrays = [(*trajectory, number) for number, trajectory in rows.trajectories.items()] + [(*curves, None) for curves in rows.curves]
        parts: list[list[Any]] = [[len(rows.csv)], *([values.nbytes, values.shape[0], names, number] for names, values, number in arrays)]
        content = b"".join([rows.csv, *(values.tobytes() for _, values, _ in arrays)])
        head = {"first": rows.first, "last": rows.last, "id": self.id, "parts": parts, **self._told}
        try:
            if self._file is None:
                self._file = open(self.path, "ab", buffering=0)
            text = json.dumps(head).encode() + b"\n"
            record = MARK + b"%08x " % zlib.crc32(content, zlib.crc32(text)) + text + content
            begin = self._file.tell()
            if self._file.write(record) != len(record):
                self._file.truncate(begin)
                raise OSError("no room on the disk")
            if time.monotonic() - self._synced > 1:
                self.sync()
        except OSError as error:
            raise Error(f"{self.path}: got a file that cannot be written ({error.strerror or error}), need room on the disk; then --resume goes on "
                        "from what is there", "output", [Problem(str(self.path), None, None, "", "a file that cannot be written", "room on the disk")]) from None
        place = (rows.first, rows.last, begin + len(record) - len(content), parts)
        self._found.append(place)

    def sync(self) -> None:
        """All that is there survives a crash of the machine."""
        if self._file is not None:
            os.fdatasync(self._file.fileno())
            self._synced = time.monotonic()

    def close(self) -> None:
        if self._file is not None:
            self.sync()
            self._file.close()
            self._file = None

    def lines(self, first: int, last: int) -> Iterator[bytes]:
        """The rows [first, last) as text of CSV, in their order, in pieces. All of them are there."""
        self._found.sort(key=lambda each: each[:3])
        at = first
        with open(self.path, "rb") as file:
            for begin, end, place, parts in self._found:
                if end <= at or begin >= last:
                    continue
                file.seek(place)
                text = file.read(parts[0][0])
                if begin < at or end > last:
                    text = b"".join(text.splitlines(keepends=True)[at - begin:last - begin])
                yield text
                at = min(end, last)

    def series(self, curves: bool) -> Iterator[tuple[int, Series]]:
        """Trajectories with their rollouts, or curves, in the order of the rollouts."""
        places: dict[tuple[int, int], tuple[int, int, int, list[str]]] = {}
        for begin, _, place, parts in self._found:
            place += parts[0][0]
            for i, (size, count, names, number) in enumerate(parts[1:]):
                if (number is None) == curves:
                    places.setdefault((begin, i) if number is None else (number, 0), (place, size, count, names))
                place += size
        with open(self.path, "rb") as file:
            for (number, _), (place, size, count, names) in sorted(places.items()):
                file.seek(place)
                yield number, (names, np.frombuffer(file.read(size)).reshape(count, -1))


def _next_mark(file: Any, place: int, size: int) -> int:
    """Where the next record may begin; the end where there is none, or none near."""
    block, begin = 1 << 20, place
    while place < size and place - begin <= MOST_DAMAGED:
        file.seek(place)
        found = file.read(block + len(MARK)).find(MARK)
        if found >= 0:
            return int(place + found)
        place += block
    return size


def parts_beyond(of: dict[str, Any], other: dict[str, Any]) -> str:
    """What the first study has and the second has not, as ``seed 1, study 0123456789abcdef``."""
    out = [f"seed {of['seed']}"] if of["seed"] != other["seed"] else []
    out += [f"{of['size']} rollouts"] if of["size"] != other["size"] else []
    return ", ".join(out + [part for part in of["origin"] if part not in other["origin"]])
