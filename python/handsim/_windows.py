"""Long recordings: a window of frames is tracked after the other, and its forces are found, so that memory does not grow with the recording.

What belongs to the whole recording is found in stretches of it: the person, where points lie on the hand, and what an object stands on. Windows overlap, and
each gives the frames in its middle. What a window gives is kept in a file until tables are written, a window after the other; of the rest of the recording only
states, times and what figures need are in memory. A recording of one window is read whole (`_track.study`, `_forces_command.find`).
"""
from __future__ import annotations

import math
import pickle
import tempfile
import time
from array import array
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Iterator, NamedTuple, Optional, Sequence

import numpy as np

from . import _conventions, _core, _forces, _forces_command, _forces_files, _forces_frames, _forces_object, _forces_page, _track
from ._errors import Error, input_error, renamed
from ._files import NewFolder
from ._guess import Guess
from ._objects import Course, read_courses
from ._progress import Told
from ._track import Array, Asked, Between, Hand, Result

LONGEST = 18_000
"""Frames of a recording that is read whole."""
WINDOW = 12_000
"""Frames that a window gives, at most."""
OVERLAP = 240
"""Frames that it reads beside them, either way: longer than motion is smoothed, and than hands take to bear an object."""
STRETCHES, STRETCH = 30, 200
"""Of consecutive frames, in which is found what belongs to the whole recording."""
NO_HAND = ("no frame in which a point of a hand was seen", "fewer than three frames that show a hand")
WAIT, FURTHEST = 0.5, 1e5
"""A hand that is seen within the first, in a recording that ends before the second, has the recording's own times [s] (src/handsim/study/track)."""


class Window(NamedTuple):
    """Frames of a recording: it gives those from `first` to `last`, and reads those from `low` to `high`."""

    first: int
    last: int
    low: int
    high: int

    @property
    def own(self) -> slice:
        """Of what it reads."""
        return slice(self.first - self.low, self.last - self.low)


class Table:
    """A recording .csv whose rows are found again by their place in the file."""

    def __init__(self, path: Path) -> None:
        self.path, self.starts = path, array("q")
        with open(path, "rb") as file:
            at = len(file.readline())
            self.head = at
            for line in file:
                if line.strip():
                    self.starts.append(at)
                at += len(line)
        self.starts.append(at)

    def __len__(self) -> int:
        return len(self.starts) - 1

    def write(self, out: Path, ranges: Sequence[tuple[int, int]]) -> Path:
        """The head and some rows, as a file of the same name in a folder."""
        out.mkdir()
        path = out / self.path.name
        with open(self.path, "rb") as file, open(path, "wb") as to:
            to.write(file.read(self.head))
            for first, last in ranges:
                file.seek(self.starts[first])
                to.write(file.read(self.starts[last] - self.starts[first]))
        return path

    def line(self, ranges: Sequence[tuple[int, int]], line: int) -> int:
        """Of the recording, by the line of a file of some rows."""
        left = line - 2
        with open(self.path, "rb") as file:
            for first, last in ranges:
                file.seek(0)
                before, own = file.read(self.starts[first]).count(b"\n"), file.read(self.starts[last] - self.starts[first]).count(b"\n")
                if left < own:
                    return before + 1 + left
                left -= own
        return line


def windows(count: int) -> list[Window]:
    parts = max(1, math.ceil(count / WINDOW))
    ends = [count * i // parts for i in range(parts + 1)]
    return [Window(first, last, max(0, first - OVERLAP), min(count, last + OVERLAP)) for first, last in zip(ends, ends[1:])]


def stretches(count: int) -> list[tuple[int, int]]:
    """Evenly over the recording."""
    length = min(STRETCH, count // STRETCHES)
    return [(first, first + length) for first in ((count - length) * np.arange(STRETCHES) // (STRETCHES - 1)).tolist()]


@dataclass
class Work:
    """Of a recording that is read whole."""

    asked: Asked

    def study(self, out: Path, told: Told = None) -> tuple[Result, bool]:
        """Tracks, and writes the files. :returns: what was found, and False if gnuplot is missing or fails"""
        self.found, plotted = _track.study(self.asked, out, told)
        return self.found, plotted

    def forces(self, of: _forces_command.Request, out: Path, told: Told = None) -> tuple[str, bool]:
        """Finds the forces, and writes their files. :returns: the text for the screen, and False if gnuplot is missing or fails"""
        return _forces_command.find(of, self.asked, self.found, out, told)


def _part(told: Told, i: int, count: int) -> Told:
    """Of the work's i-th part."""
    if told is None:
        return None
    of_whole = told
    return lambda share: of_whole((i + share) / count)


class LongWork(Work):
    """Of one that is read a window after the other."""

    def __init__(self, asked: Asked, table: Table, folder: Path) -> None:
        super().__init__(asked)
        self.table, self.folder, self.windows = table, folder, windows(len(table))
        self.files = [table.write(folder / f"window_{i}", [(each.low, each.high)]) for i, each in enumerate(self.windows)]

    def _keep(self, what: str, i: int, content: Any) -> None:
        with open(self.folder / f"{what}_{i}.pickle", "wb") as file:
            pickle.dump(content, file, pickle.HIGHEST_PROTOCOL)

    def _kept(self, what: str) -> Iterator[Any]:
        for i in range(len(self.windows)):
            with open(self.folder / f"{what}_{i}.pickle", "rb") as file:
                yield pickle.load(file)

    def sample(self) -> Optional[Result]:
        """The person, and where points lie. None where no hand is in the sample, or where points are not where joints are and no convention says so: only a
        recording that is read whole has their places."""
        ranges = stretches(len(self.table))
        path = self.table.write(self.folder / "sample", ranges)
        try:
            found = _track.track(self.asked._replace(recording=path, truth=None))
        except Error as error:
            if _without_hand(error):
                return None
            raise renamed(error, path, self.asked.recording, lambda line: self.table.line(ranges, line)) from None
        if len(found.shares) and found.guess.name is None and self.asked.points is None:
            return None
        return found._replace(warnings=[each.replace(str(path), str(self.asked.recording)) for each in found.warnings])

    def study(self, out: Path, told: Told = None) -> tuple[Result, bool]:
        asked, count = self.asked, len(self.windows)
        inputs = [each for each in (asked.recording, asked.person, asked.markers, asked.points, asked.names, asked.truth, _track.model_file(asked)) if each]
        with NewFolder(out):
            whole = self.sample()
            if whole is None:
                # Not `super()`: what is found is that of the whole.
                self.windows = []
                return Work.study(self, out, told)
            folder = _core.output_folder(out, _track.names(), inputs)
            person = self.folder / "person.yaml"
            person.write_text(whole.person, encoding="utf-8")
            held = asked._replace(person=person if asked.fit_bones else asked.person, fit_bones=False, points=self._convention(whole))
            parts = [self._track(i, held._replace(recording=path, seed=asked.seed + i), _part(told, i, count)) for i, path in enumerate(self.files)]
            self.start, names = _start(parts), [hand.name for part in parts for hand in part.hands]
            names = [name for name in ("right", "left") if name in names]
            if not names:
                raise input_error(str(asked.recording), NO_HAND[0], "three frames that show a hand")
            like = {hand.name: hand for part in parts for hand in part.hands}
            like = {name: hand._replace(determined=[any(each) for each in zip(*(
                own.determined for part in parts for own in part.hands if own.name == name))]) for name, hand in like.items()}
            self.like = {name: like[name] for name in names}
            self.found = self._joined(parts, whole)
            folder.clear()
            for name, rows in self._tables().items():
                _core.write_parts(out / name, rows)
            for name, text in (("person.yaml", whole.person), ("summary.csv", _track.summary_rows(self.found)), ("summary.json", _track.summary_text(asked, self.found)),
                               ("scene.yaml", self._scene())):
                if text:
                    _core.write_file(out / name, text.encode())
            drawn: bool = _core.write_plots(out, "summary", "", _track.plots(self.found))
            return self.found, drawn

    def _convention(self, whole: Result) -> Optional[Path]:
        """With the points where they lie on this hand."""
        file = self.asked.points or _track.convention_file(whole.guess)
        if file is None or not len(whole.shares):
            return file
        names = [feature.partition(".")[2] for feature in whole.hands[0].features]
        text, at = file.read_text(encoding="utf-8"), dict(zip(names, whole.shares))
        here = self.folder / file.name
        here.write_text(_conventions.written(text, at, {name: np.zeros(3) for name in at}, 17), encoding="utf-8")
        return here

    def _track(self, i: int, asked: Asked, told: Told) -> Result:
        """Keeps what was tracked; returns it with its own frames alone, without what tables need."""
        try:
            found = _track.track(asked, told)
        except Error as error:
            if not _without_hand(error):
                ranges = [self.windows[i][2:]]
                raise renamed(error, asked.recording, self.asked.recording, lambda line: self.table.line(ranges, line)) from None
            times = np.loadtxt(asked.recording, delimiter=",", skiprows=1, usecols=0, ndmin=1)
            found = Result(times, 0.0, 0.0, [], [], Between(0, 0.0, 0.0, "", 0.0), "", False, {}, {}, np.zeros((0, 3)), "", Guess(None, ""))
        found = found._replace(times=found.times + found.start, warnings=[each.replace(str(asked.recording), str(self.asked.recording)) for each in found.warnings
                                                                           if "is 0 in all that is written" not in each])
        self._keep("tracked", i, found)
        own = self.windows[i].own
        return found._replace(times=found.times[own], hands=[_slim(hand, own) for hand in found.hands])

    def _joined(self, parts: Sequence[Result], whole: Result) -> Result:
        """Of the whole recording, without what tables need."""
        times = np.concatenate([part.times for part in parts]) - self.start
        hands = []
        for name, like in self.like.items():
            every = [next((hand for hand in part.hands if hand.name == name), _unseen(like, len(part.times))) for part in parts]
            seen = np.array([max(1e-12, len(hand.tracked)) for hand in every])
            pairs: dict[str, tuple[str, float, float]] = {}
            for hand, part in zip(every, parts):
                for where, depth, at in hand.overlaps[2]:
                    if depth > pairs.get(where, ("", 0.0, 0.0))[1]:
                        pairs[where] = where, depth, at + part.start - self.start
            truth = [(axis, math.sqrt(float(np.average([hand.truth[k][1]**2 if hand.truth else 0.0 for hand in every],
                                                       weights=[len(hand.tracked) if hand.truth else 1e-12 for hand in every])))) for k, (axis, _) in enumerate(like.truth)]
            hands.append(like._replace(
                status=np.concatenate([hand.status for hand in every]), rms=np.concatenate([hand.rms for hand in every]),
                overlaps=(sum(hand.overlaps[0] for hand in every), sum(hand.overlaps[1] for hand in every), [pairs[where] for where in sorted(pairs)]),
                truth=truth, noise=math.sqrt(float(np.average([hand.noise**2 for hand in every], weights=seen)))))
        deepest = max(parts, key=lambda part: part.between.depth)
        between = deepest.between._replace(frames=sum(part.between.frames for part in parts), time=deepest.between.time + deepest.start - self.start,
                                           moved=max(part.between.moved for part in parts))
        warnings = [each for each in whole.warnings if "is 0 in all that is written" not in each]
        if self.start:
            warnings.append(f"{self.asked.recording}: a hand is first seen at {self.start:.12g} s, which is 0 in all that is written")
        warnings += [f"read in {len(parts)} windows of at most {WINDOW} frames: the person is found in {STRETCHES} stretches of {STRETCH} frames"]
        return whole._replace(times=times, start=self.start, cpu=whole.cpu + sum(part.cpu for part in parts), hands=hands, between=between,
                              warnings=list(dict.fromkeys([*warnings, *(each for part in parts for each in part.warnings)])))

    def _aligned(self) -> Iterator[tuple[Window, Result]]:
        """What windows read, with the same hands and times from the recording's start."""
        for window, found in zip(self.windows, self._kept("tracked")):
            own = {hand.name: hand for hand in found.hands}
            yield window, found._replace(times=found.times - self.start, start=self.start, hands=[
                own[name]._replace(determined=like.determined) if name in own else _unseen(like, len(found.times)) for name, like in self.like.items()])

    def _own(self) -> Iterator[Result]:
        """What windows give."""
        for window, found in self._aligned():
            yield found._replace(times=found.times[window.own], hands=[hand.rows(window.own) for hand in found.hands])

    def _tables(self) -> dict[str, Iterator[bytes]]:
        def frames() -> Iterator[bytes]:
            for i, found in enumerate(self._own()):
                yield _track.frames_text(found).split("\n", 1 if i else 0)[-1].encode()

        def of_hand(name: str, file: str, count: int) -> Iterator[bytes]:
            for i, found in enumerate(self._own()):
                hand = next(each for each in found.hands if each.name == name)
                yield _body(_track.hand_files(found.times, hand)[file], i == 0, count)

        out = {"frames.csv": frames()}
        for hand in self.found.hands:
            count = len(hand.tracked)
            names = [f"{hand.name}_wrist.csv", *([f"{hand.name}.mot"] if any(hand.determined) else [])]
            out.update({file: of_hand(hand.name, file, count) for file in names if count})
        return out

    def _scene(self) -> str:
        """By the first frame of each hand, and the last of all."""
        first: dict[str, Array] = {}
        for found in self._own():
            for hand in found.hands:
                if len(hand.tracked) and hand.name not in first:
                    first[hand.name] = hand.angles[hand.tracked[0]]
            if len(first) == len(self.like):
                break
        return _track.scene_text(self.asked, self.found, first) if first else ""

    def forces(self, of: _forces_command.Request, out: Path, told: Told = None) -> tuple[str, bool]:
        if not self.windows:
            return Work.forces(self, of, out, told)
        asked, count = self.asked, len(self.windows)
        folder, begin = _forces_command.folder_of(of, asked, out), time.process_time()
        course = _forces_command.upright(asked, self.found.guess, of.course)
        course = course._replace(times=course.times - self.start)
        common, step = self._common(of, course), _forces_page.every(len(self.table))
        figures: Optional[_forces_files.Figures] = None
        drawn: list[_forces_page.Drawn] = []
        for i, (window, found) in enumerate(self._aligned()):
            hands = [each._replace(noise=whole.noise, rms=float(np.sqrt(np.mean(whole.rms[whole.tracked]**2)))) for each, whole in zip(
                _forces_command.motions(asked, found.hands, out / "person.yaml", of.asked.muscles), self.found.hands)]
            own = _between(course, found.times)
            hidden = np.count_nonzero(np.isfinite(own.poses).all(axis=1)) < 4
            solver = _forces_frames.Solver(of.thing, found.times, _anywhere(course, own.times) if hidden else own, hands,
                                           of.asked._replace(seed=of.asked.seed + 10_000 * i), common)
            if hidden:
                solver.of.seen[:] = False
            solved = _forces.solve(solver, _part(told, i, count))
            rows = np.arange(-(-window.first // step) * step, window.last, step) - window.low
            drawn.append(_forces_page.drawn(solver, solved, rows))
            result = solved.rows(window.own)
            self._keep("forces", i, result)
            part = _forces_files.Figures(result, window.first)
            if figures is None:
                figures = part
            else:
                figures.add(part)
        assert figures is not None
        cpu = time.process_time() - begin
        folder.clear()
        return self._write(of, figures, _forces_page.joined(drawn), cpu, out / "forces")

    def _common(self, of: _forces_command.Request, course: Course) -> _forces_object.Common:
        """Of the object in stretches of the recording."""
        parts = []
        for first, last in stretches(len(course.times)):
            own = Course(course.times[first:last], course.poses[first:last], course.angles[first:last])
            if np.count_nonzero(np.isfinite(own.poses).all(axis=1)) >= STRETCH // 2:
                parts.append(_forces_object.needed(of.thing, own.times, own))
        return _forces_object.common_of(parts or [_forces_object.needed(of.thing, course.times, course)])

    def _write(self, of: _forces_command.Request, figures: _forces_files.Figures, drawn: _forces_page.Drawn, cpu: float, out: Path) -> tuple[str, bool]:
        def rows(name: str) -> Iterator[bytes]:
            for i, result in enumerate(self._kept("forces")):
                parts = _forces_files.tables(of.thing, result, figures)[name]
                if i:
                    next(parts)  # the head
                yield from parts

        for name in ("contact_forces.csv", "loads.csv", "object.csv"):
            _core.write_parts(out / name, rows(name))
        counts: dict[str, int] = {}
        for result in self._kept("forces"):
            for name, _, _, times, _ in _forces_files.motions(of.thing, result):
                counts[name] = counts.get(name, 0) + len(times)

        def motion(wanted: str, count: int) -> Iterator[bytes]:
            for i, result in enumerate(self._kept("forces")):
                for name, title, columns, times, values in _forces_files.motions(of.thing, result):
                    if name == wanted:
                        part = self.folder / name
                        _core.write_motion(part, title, columns, False, len(times), times, values)
                        yield _body(part.read_text(encoding="utf-8"), i == 0, count)

        for name, count in counts.items():
            _core.write_parts(out / name, motion(name, count))
        _core.write_file(out / "forces.json", _forces_files.summary(of.thing, of.asked, figures, cpu, []).encode())
        _core.write_file(out / "forces.csv", _forces_files.figure_rows(figures))
        _core.write_file(out / "forces.html", _forces_page.page(of.thing, of.asked, drawn, figures))
        plotted: bool = _core.write_plots(out, "forces", "", [_forces_files.plot_of(drawn.found, figures)])
        return _forces_files.screen_text(of.thing, of.asked, figures, cpu), plotted


def _without_hand(error: Error) -> bool:
    return any(each in str(error) for each in NO_HAND)


def _start(parts: Sequence[Result]) -> float:
    """Time in the recording that is 0 in what is written."""
    begins = [float(part.times[hand.tracked[0]]) for part in parts for hand in part.hands if len(hand.tracked)]
    begin = min(begins, default=float(parts[0].times[0]))
    return 0.0 if 0 <= begin <= WAIT and parts[-1].times[-1] <= FURTHEST else begin


def _slim(hand: Hand, rows: slice) -> Hand:
    """Without what tables need."""
    none = np.zeros((0, 0))
    return hand._replace(status=hand.status[rows].astype(np.int8), rms=hand.rms[rows], angles=none, wrist=none, distances=none)


def _unseen(like: Hand, count: int) -> Hand:
    """In a window in which there is none."""
    return like._replace(status=np.ones(count, dtype=np.intp), rms=np.full(count, np.nan), angles=np.full((count, len(like.axes)), np.nan),
                         wrist=np.full((count, 7), np.nan), distances=np.full((count, len(like.features)), np.nan), overlaps=(0, 0, []), truth=[], noise=0.0)


def _body(text: str, first: bool, count: int) -> bytes:
    """Of a table of a part of the rows: with its head only at first, which says how many rows the whole has."""
    head, ends, rows = text.partition("endheader\n")
    if not ends:
        head, rows = "", text
    elif first:
        head = "".join(f"nRows={count}\n" if line.startswith("nRows=") else line for line in head.splitlines(keepends=True)) + ends
    return (head + rows if first else rows.partition("\n")[2]).encode()


def _between(course: Course, times: Array) -> Course:
    """Its part beside some times, with one frame more either way."""
    low, high = np.searchsorted(course.times, [times[0] - 1e-6, times[-1] + 1e-6])
    rows = slice(max(0, int(low) - 1), int(high) + 1)
    return Course(course.times[rows], course.poses[rows], course.angles[rows])


def _anywhere(course: Course, times: Array) -> Course:
    """At rest where it was seen first."""
    seen = np.flatnonzero(np.isfinite(course.poses).all(axis=1))[0]
    return Course(times, np.tile(course.poses[seen], (len(times), 1)), np.full(len(times), course.angles[seen]))


@contextmanager
def opened(asked: Asked, replay: bool = False) -> Iterator[Work]:
    """The work of a recording: a table .csv of more than LONGEST frames is read in windows, all else whole.

    :param replay: of lifts, too
    :raises Error: of kind input where lifts of a long one are asked for
    """
    table = Table(asked.recording) if asked.recording.suffix.lower() == ".csv" and asked.recording.is_file() else None
    if table is None or len(table) <= LONGEST:
        yield Work(asked)
        return
    if replay:
        raise input_error("--replay", f"a recording of {len(table)} frames", f"one of at most {LONGEST}")
    with tempfile.TemporaryDirectory(prefix="handsim_track_") as folder:
        yield LongWork(asked, table, Path(folder))
