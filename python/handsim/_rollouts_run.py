"""A study of rollouts from its file to its files: for `handsim rollouts`, `--uncertain` of other commands, and `handsim.study`."""
from __future__ import annotations

import glob
import json
import os
import time
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Callable, Iterator, NamedTuple, Optional, Sequence

from . import _core
from ._errors import Error, Problem, input_error
from ._progress import Bar, Told, print_line
from ._rollouts import PARTS, Asked, Executor, Gone, Parts, Range, Rows, collect, keep_study, open_study, parts_beyond, rows_of, work_of
from ._rollouts_files import FILES, Outcome, Table, figure_rows, held_text, screen_text, write_files

NUMBER_BYTES, TEXT_BYTES = 20 + 20 + 8, 18 + 18 + 56
"""Of a number and of a text while rows are kept, in CSV and in HDF5."""
STATE_BYTES, NAME_BYTES, COLUMN_BYTES, PANEL_BYTES = 3 * 8, 3 * 64, 1000, 50e3
MOST_TRAJECTORY = 1 << 30
"""Bytes of one rollout that is written whole."""


class Stopped(Exception):
    """Somebody has ended the study; what is done is on the disk."""


class Finished(NamedTuple):
    """What a study has come to."""

    done: int
    """Rows that are there, of the range."""
    size: int
    """Rows of the range."""
    computed: int
    """Of those, by this call."""
    seconds: float
    text: str = ""
    """For the screen, of a study that is complete."""
    held: str = ""
    """In which share of the hands."""
    outcomes: Sequence[Outcome] = ()
    plotted: bool = True
    missing: Sequence[str] = ()
    before: bool = False
    """It was complete already."""


class Order(NamedTuple):
    """What is to be run, and where its files go."""

    asked: Asked
    out: Path
    command: str
    """That repeats the study."""
    row: str = ""
    """The command of a row, with its number in braces."""
    resume: bool = False
    only: Optional[Range] = None
    """Rows [first, last) alone, which are kept and not made into files."""
    report: bool = False
    inputs: Sequence[Path] = ()
    """Files that stay, beside those of the scene."""


def rollouts_order(asked: Asked, out: Path, **more: Any) -> Order:
    """With the commands of a study's file, or of `handsim run SCENE --uncertain`."""
    words, sets = [str(asked.file)], list(asked.overrides)
    if asked.uncertain:
        command = f"{_core.command_text(['run', *words], sets)} --uncertain {asked.draws}"
        return Order(asked, out, command, f"{command} --rollout {{rollout}}", **more)
    seed = "" if asked.seed is None else f" --seed {asked.seed}"
    return Order(asked, out, _core.command_text(["rollouts", *words], sets) + seed, _core.command_text(["run", *words], sets) + " --rollout {rollout}" + seed,
                 **more)


def _is_complete(head: dict[str, Any], out: Path) -> bool:
    """The folder has the files of the whole of this study, by this build. :raises Error: of kind input where it has those of another"""
    file = out / "summary.json"
    if (out / PARTS).exists() or not file.is_file():
        return False
    try:
        found = json.loads(file.read_bytes())
        told = {"seed": str(found["seed"]), "size": int(found["rollouts"]), "origin": [str(each) for each in found["origin"]]}
    except (ValueError, KeyError, TypeError):
        raise input_error(str(file), "a file that is no summary of rollouts", "--resume where this study was stopped, or another folder") from None
    has, needs = parts_beyond(told, head), parts_beyond(head, told)
    if has or needs:
        raise input_error(str(file), f"one of another study or build ({has})", f"the finished one of this study, or another folder ({needs})")
    return True


def _check_space(study: Any, head: dict[str, Any], count: int, out: Path, there: int) -> None:
    """:raises Error: of kind input where what will be written does not fit"""
    size = sum(count * (TEXT_BYTES if text else NUMBER_BYTES) + COLUMN_BYTES + (PANEL_BYTES if role == "drawn" else 0) for _, role, text in head["columns"])
    rows, width, whole = study.recorded
    if whole:
        one = width * (8 * rows + 40 + 64)
        if one > MOST_TRAJECTORY:
            raise input_error("record.trajectories", f"{one:.3g} bytes of a trajectory", f"at most {MOST_TRAJECTORY >> 20} MB (record.every of the scene)")
        size += min(whole, count) * width * (rows * STATE_BYTES + NAME_BYTES)
    _core.check_free(float(max(0, size - there)), out, "fewer rollouts or trajectories")


class _Progress:
    """The share that is done, with the rate on a bar of ours."""

    def __init__(self, told: Told, label: str, done: int, size: int) -> None:
        self._told, self._label, self._done, self._size = told, label, done, size
        self._first, self._begin = done, time.monotonic()
        if isinstance(told, Bar):
            told.first = done / size, self._begin - told.begin

    def add(self, rows: int) -> None:
        self._done += rows
        if self._told is None:
            return
        rate = (self._done - self._first) / max(1e-3, time.monotonic() - self._begin)
        if isinstance(self._told, Bar):
            self._told.label = f"{self._label}, {self._done} of {self._size} at {rate:.3g} a second"
        self._told(self._done / self._size)


def _nothing() -> None:
    """Nobody ends the work."""


def run(order: Order, executor: Executor, told: Told = None, wait: Callable[[], None] = _nothing, label: str = "rollouts",
        note: Callable[[str], None] = lambda _: None) -> Finished:
    """Computes what is missing, and once all rows are there writes the files.

    :param wait: is called now and then; may raise Stopped
    :param note: gets warnings of the study
    :raises Error: of kind input where the folder has rows and ``resume`` is not set, or those of another study, or no room; of
        kind output where a file cannot be written
    """
    begin, folder = time.monotonic(), os.getcwd()
    study = open_study(order.asked, folder, {})
    for warning in study.warnings:
        note(f"warning: {warning}")
    inputs = [*study.read, Path(order.asked.file), *order.inputs]
    with _locked(order.out, FILES, inputs) as clear:
        return _run(order, study, executor, told, wait, label, folder, clear, begin)


@contextmanager
def _locked(out: Path, names: Sequence[str], inputs: Sequence[Path]) -> Iterator[Callable[[], None]]:
    """The folder is nobody else's until the end, also where the traceback of an error is kept. :returns: what removes earlier files"""
    held = [_core.output_folder(out, [glob.escape(name) for name in names], inputs)]
    try:
        yield lambda: held[0].clear()
    finally:
        held.clear()


def _run(order: Order, study: Any, executor: Executor, told: Told, wait: Callable[[], None], label: str, folder: str, clear: Callable[[], None],
         begin: float) -> Finished:
    head = study.head
    first, last = order.only or (0, head["size"])
    if last > head["size"]:
        raise input_error("--range", f"{first}:{last}", f"a range of the {head['size']} rollouts")
    if order.resume and _is_complete(head, order.out):
        return Finished(last - first, last - first, 0, 0, before=True)
    parts = Parts(order.out / PARTS, head)
    if len(parts):
        if not order.resume:
            raise input_error(str(parts.path), "a study that was stopped", "--resume, or another folder")
        parts.read()
    elif parts.path.is_dir() or parts.path.is_symlink():
        raise input_error(str(parts.path), "something else than a file", "another folder")
    _check_space(study, head, last - first, order.out, len(parts))
    missing = parts.missing(first, last)
    work = work_of(order.asked, study, folder)
    keep_study(work, study)
    clear()
    todo = sum(b - a for a, b in missing)
    progress, computed = _Progress(told, label, last - first - todo, last - first), 0

    def keep(rows: Rows) -> None:
        nonlocal computed
        parts.add(rows)
        computed += rows.last - rows.first
        progress.add(rows.last - rows.first)

    def crashed(row: int, text: str) -> None:
        keep(Rows(row, row + 1, study.crashed(row, text), {}, [], 0))

    try:
        collect(rows_of, work, executor, missing, keep, crashed, wait, told.line if isinstance(told, Bar) else print_line)
    except Stopped:
        pass
    except Gone as error:
        raise Error(f"{error}; the same command with --resume goes on", "output") from None
    finally:
        parts.close()
    done = last - first - todo + computed
    if done < last - first or order.only:
        return Finished(done, last - first, computed, time.monotonic() - begin)
    table = Table(head, parts)
    try:
        outcomes, plotted, lacking = write_files(table, order.out)
    except Error as error:
        rows = Problem(str(parts.path), None, None, "", f"{done} rows without their table", "--resume, which writes the table of what is computed")
        raise Error(f"{error}\n{parts.path}: got {rows.got}, need {rows.need}", "output", [*error.problems, rows]) from None
    out = Finished(done, done, computed, time.monotonic() - begin, screen_text(table, outcomes), held_text(table, outcomes[0]), outcomes, plotted, lacking)
    parts.path.unlink()
    _core.finish_study(order.out, order.command, {}, {"rollouts.csv": order.row} if order.row else {}, order.report)
    return out


def remove_rows(out: Path) -> None:
    """Of a study that begins anew."""
    (out / PARTS).unlink(missing_ok=True)


def uncertain_grasps(scenes: Sequence[Path], sides: Sequence[str], persons: Sequence[Path], overrides: Sequence[str], count: int, out: Path,
                     executor: Executor, told: Told = None, wait: Callable[[], None] = _nothing, note: Callable[[str], None] = lambda _: None) -> Finished:
    """A study of uncertain hands for each scene, side and person, and OUT/uncertain.csv with the figures of all."""
    drawn, refused = _core.uncertain_grasps((list(scenes), list(sides), list(persons), list(overrides), out))
    with _locked(out, ["uncertain.csv", "study.json", "report.html"], list(scenes)) as clear:
        clear()
        return _uncertain_grasps(drawn, refused, count, out, executor, told, wait, note)


def _uncertain_grasps(drawn: list[Any], refused: list[Any], count: int, out: Path, executor: Executor, told: Told, wait: Callable[[], None],
                      note: Callable[[str], None]) -> Finished:
    csv, shares, text = "scene,side,figure,hands,mean,low,high,variance_of\n", "", ""
    finished = Finished(0, count * len(drawn), 0, 0)
    for i, (name, side, file, own, folder) in enumerate(drawn):
        order = rollouts_order(Asked(file, True, tuple(own), count, bands=False), folder, resume=not _is_whole(folder))
        if isinstance(told, Bar):
            part: Told = told
        else:
            part = None if told is None else lambda share, i=i, told=told: told((i + share) / len(drawn))  # type: ignore[misc]
        one = run(order, executor, part, wait, f"{name} {side}, {i + 1} of {len(drawn)}", note)
        finished = finished._replace(done=finished.done + one.done, computed=finished.computed + one.computed, seconds=finished.seconds + one.seconds,
                                     plotted=finished.plotted and one.plotted, missing=one.missing)
        if one.done < one.size:
            return finished
        csv += figure_rows(f"{name},{side}", list(one.outcomes))
        shares += f"{name} {side}: {one.held}\n"
        text = one.text + "\n" if len(drawn) == 1 else ""
    _core.write_file(out / "uncertain.csv", csv.encode())
    for name, side, why in refused:
        shares += f"not for this hand: {name} {side}: {why}\n"
    return finished._replace(text=text + shares)


def _is_whole(folder: Path) -> bool:
    """An earlier study has ended there: it is run anew."""
    return (folder / "summary.json").exists() and not (folder / PARTS).exists()
