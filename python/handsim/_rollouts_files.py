"""The files of a study of rollouts, from its rows: table, HDF5, summary, plot, bands, and the text for the screen.

Nothing here holds more than some columns of the table in memory.
"""
from __future__ import annotations

import csv
import math
import mmap
import os
from contextlib import suppress
from pathlib import Path
from typing import Any, Callable, Iterable, Iterator, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import Error
from ._rollouts import Parts
from ._statistics import Estimate, mean_of, owners_text, quantile, rank_correlation, share_of, variance_shares
from ._study_files import json_file, number, plain, quoted

Array = NDArray[np.float64]

BINS = 10
FEW_VALUES = 12
"""Numbers that take at most so many values are told value by value."""
TOLD = 6
"""If there are more outcomes, the screen shows one line for each, and only the first ones are plotted."""
MOST_LINES = 30
"""If outcomes times keys exceed this number, the screen shows one line for each outcome."""
MOST_PANELS = 24
WIDE_LABELS = 40
"""Letters of a panel's labels from which they are turned."""
BUDGET = 100e6
"""Bytes of columns that are in memory together."""
TEXT_BYTES = 100
FILES = ["rollouts.csv", "rollouts.json", "rollouts.gp", "study.json", "report.html", "rollouts.png", "rollouts.svg", "rollouts.h5", "summary.json",
         "bands.csv"]
COLOR = "#1f5fa8"


class Bin(NamedTuple):
    """The outcome at one value of a key, or in a range of its values."""

    label: str
    """Of a text."""
    low: float
    middle: float
    high: float
    outcomes: Array
    estimate: Estimate


class Key(NamedTuple):
    """What one varied column does to an outcome."""

    name: str
    text: bool
    correlation: Estimate
    bins: list[Bin]

    def telling(self) -> list[Bin]:
        """The bins that tell the effect: all levels; of ranges both ends, and between them one that is above or below both
        beyond their intervals."""
        if self.text or all(each.low == each.high for each in self.bins):
            return self.bins
        first, last = self.bins[0].estimate, self.bins[-1].estimate
        assert first and last
        beyond, extreme = 0.0, None
        for each in self.bins[1:-1]:
            assert each.estimate
            _, low, high = each.estimate
            off = max(low - max(first[2], last[2]), min(first[1], last[1]) - high)
            if off > beyond:
                beyond, extreme = off, each
        return [self.bins[0], *([extreme] if extreme else []), self.bins[-1]]


class Outcome(NamedTuple):
    """An outcome over all rows that have it."""

    name: str
    verdict: bool
    """0 or 1: shares, where others have means."""
    values: Array
    all: Estimate
    keys: list[Key]
    variance: list[tuple[str, float]]

    def varies(self) -> bool:
        return self.all is not None and (self.verdict or self.all[1] < self.all[2])

    def middle_90(self) -> tuple[float, float]:
        """The 5th and the 95th percentile."""
        ordered = np.sort(self.values)
        return quantile(ordered, 0.05), quantile(ordered, 0.95)


def _estimate(outcomes: Array, verdict: bool) -> Estimate:
    found: Estimate = share_of(int(np.count_nonzero(outcomes)), len(outcomes)) if verdict else mean_of(outcomes)
    return found


def _bins(values: Any, text: bool, outcomes: Array, verdict: bool) -> list[Bin]:
    def one(label: str, low: float, middle: float, high: float, of: Array) -> Bin:
        return Bin(label, low, middle, high, of, _estimate(of, verdict))

    if not len(outcomes):
        return []
    levels, which = np.unique(values, return_inverse=True)
    if text:
        return [one(str(level), i, i, i, outcomes[which == i]) for i, level in enumerate(levels)]
    if len(levels) <= FEW_VALUES:
        return [one("", level, level, level, outcomes[which == i]) for i, level in enumerate(levels.tolist())]
    order = np.argsort(values, kind="stable")
    ordered = values[order].tolist()
    out = []
    for b in range(BINS):
        begin, end = b * len(order) // BINS, (b + 1) * len(order) // BINS
        out.append(one("", ordered[begin], ordered[(begin + end) // 2], ordered[end - 1], outcomes[order[begin:end]]))
    return out


class Table:
    """The rows of a study that is complete."""

    def __init__(self, head: dict[str, Any], parts: Parts) -> None:
        self.head, self.parts = head, parts
        self.names: list[str] = [name for name, _, _ in head["columns"]]
        self.texts: list[bool] = [text for _, _, text in head["columns"]]
        self.drawn = [i for i, (_, role, _) in enumerate(head["columns"]) if role == "drawn"]
        self.outcomes = [self.names.index("held")] + [i for i, (_, role, _) in enumerate(head["columns"]) if role == "asked"]

    @property
    def size(self) -> int:
        return int(self.head["size"])

    def columns(self, wanted: Sequence[int]) -> dict[int, Any]:
        """Numbers as arrays, NaN where there is none, and texts as lists."""
        out: dict[int, Any] = {i: [] if self.texts[i] else np.empty(self.size) for i in wanted}
        at = 0
        for text in self.parts.lines(0, self.size):
            rows = list(csv.reader(text.decode().splitlines()))
            for i, column in out.items():
                if self.texts[i]:
                    column.extend(row[i] for row in rows)
                else:
                    column[at:at + len(rows)] = [float(row[i]) if row[i] else math.nan for row in rows]
            at += len(rows)
        return out

    def groups(self) -> Iterator[dict[int, Any]]:
        """All columns in their order, as many at a time as memory has room for."""
        bytes_of = [self.size * (TEXT_BYTES if text else 8) for text in self.texts]
        group: list[int] = []
        for i, size in enumerate(bytes_of):
            if group and sum(bytes_of[k] for k in group) + size > BUDGET:
                yield self.columns(group)
                group = []
            group.append(i)
        yield self.columns(group)

    def effects(self) -> list[Outcome]:
        """``held`` first, then the outcomes that the study names."""
        drawn = self.columns(self.drawn)
        return [self._effect(drawn, i, self.columns([i])[i]) for i in self.outcomes]

    def _effect(self, drawn: dict[int, Any], outcome: int, values: Array) -> Outcome:
        name = self.names[outcome]
        verdict = name == "held" or name.endswith(".held")
        there = np.isfinite(values)
        values = values[there]
        keys, inputs = [], []
        for i, column in drawn.items():
            of = np.asarray(column, object)[there].astype(str) if self.texts[i] else column[there]
            numbers = np.unique(of, return_inverse=True)[1].astype(float) if self.texts[i] and len(of) else of
            inputs.append((self.names[i], numbers if len(of) else np.empty(0), self.texts[i]))
            correlation = None if self.texts[i] else rank_correlation(of, values)
            keys.append(Key(self.names[i], self.texts[i], correlation, _bins(of, self.texts[i], values, verdict)))
        return Outcome(name, verdict, values, _estimate(values, verdict), keys, variance_shares(inputs, values))

    def endings(self) -> dict[str, int]:
        """How many rows ended in each way."""
        column = self.names.index("ended")
        words, counts = np.unique(self.columns([column])[column], return_counts=True)
        return {str(word): int(count) for word, count in zip(words, counts)}


# The summary.

def _estimate_json(of: Estimate) -> Any:
    return None if of is None else dict(zip(("value", "low", "high"), of))


def _verdicts_json(values: Array) -> dict[str, Any]:
    held = int(np.count_nonzero(values))
    return {"held": held, "of": len(values), "share": _estimate_json(share_of(held, len(values)))}


def _values_json(of: Outcome, values: Array, every: Estimate) -> dict[str, Any]:
    return _verdicts_json(values) if of.verdict else {"of": len(values), "mean": _estimate_json(every)}


def _keys_json(of: Outcome) -> Any:
    out: dict[str, Any] = {}
    for key in of.keys:
        entry: dict[str, Any] = {} if key.text else {"rank_correlation": _estimate_json(key.correlation)}
        shares = []
        for each in key.bins:
            where: dict[str, Any] = {"value": each.label} if key.text else {"from": each.low, "to": each.high}
            shares.append({**_values_json(of, each.outcomes, each.estimate), **where})
        if shares:
            entry["shares" if of.verdict else "means"] = shares
        out[key.name] = entry or None
    return out


def _outcome_json(of: Outcome) -> dict[str, Any]:
    out = _values_json(of, of.values, of.all)
    if not of.verdict and len(of.values):
        out["percentile_5"], out["percentile_95"] = of.middle_90()
    return {**out, "keys": _keys_json(of), "variance_shares": dict(of.variance)}


def _finite(value: Any) -> Any:
    """A number that JSON cannot have is null."""
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list):
        return [_finite(each) for each in value]
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value


def summary_text(table: Table, outcomes: list[Outcome], table_hash: int) -> str:
    first = outcomes[0]
    out = {"title": table.head["title"], "rollouts": table.size, "seed": table.head["seed"], "held": _verdicts_json(first.values),
           "ended": table.endings(), "keys": _keys_json(first), "variance_shares": dict(first.variance)}
    if len(outcomes) > 1:
        out["outcomes"] = {of.name: _outcome_json(of) for of in outcomes[1:]}
    out["table_hash"] = f"{table_hash:016x}"
    out["origin"] = table.head["origin"]
    return json_file(_finite(out))


# The plot.

def _tick_label(of: Bin) -> str:
    """Of a file its name alone."""
    return Path(of.label).stem if of.label.endswith(".yaml") else of.label


def _plot_data(outcomes: list[Outcome]) -> str:
    out, block = [], 0
    for of in outcomes:
        for key in of.keys:
            out.append(f"$key{block} << EOD\n")
            out += [f'{" ".join(map(number, (each.middle, each.low, each.high, *each.estimate)))} "{plain(_tick_label(each))}"\n'
                    for each in key.bins if each.estimate]
            out.append("EOD\n")
            block += 1
    return "".join(out)


def _tick(span: float) -> float:
    """A step of 1, 2 or 5 times a power of ten, of which three to seven are in a span."""
    power = 10 ** math.floor(math.log10(span / 3))
    return next((digit * power for digit in (5.0, 2.0) if span / 3 >= digit * power), power)


def _panel(of: Outcome, key: Key, block: int) -> str:
    """An outcome over a varied key."""
    if not key.bins:
        return "  set multiplot next\n"
    label = "share held" if of.name == "held" else plain(("share " if of.verdict else "mean ") + of.name)
    out = (f"  set xlabel '{plain(key.name)}' noenhanced\n  set ylabel '{label}' noenhanced\n"
           f"  set yrange {'[-0.03:1.03]' if of.verdict else '[*:*]'}\n")
    if key.text:
        turned = sum(len(_tick_label(each)) for each in key.bins) > WIDE_LABELS
        out += f"  set xrange [-0.5:{number(len(key.bins) - 0.5)}]\n  set xtics auto{' rotate by -20 noenhanced' if turned else ''}\n"
        return out + (f"  plot $key{block} using 1:4:5:6:xtic(7) with yerrorbars pt 7 lc rgb '{COLOR}'\n"
                      f"{'  set xtics norotate enhanced' + chr(10) if turned else ''}")
    low, high = key.bins[0].low, key.bins[-1].high
    margin = 0.03 * (high - low) if high > low else 1.0
    return out + (f"  set xrange [{number(low - margin)}:{number(high + margin)}]\n  set xtics {number(_tick(2 * margin + high - low))}\n"
                  f"  plot $key{block} using 1:4:2:3:5:6 with xyerrorbars pt 7 lc rgb '{COLOR}', $key{block} using 1:4 with lines lc rgb '{COLOR}'\n")


def _strongest(of: Outcome, most: int) -> list[int]:
    """Indices of keys; of more than `most` those with the largest differences between their bins."""
    spans = []
    for i, key in enumerate(of.keys):
        found = [each.estimate[0] for each in key.bins if each.estimate]
        spans.append((min(found) - max(found) if found else math.inf, i))
    if len(spans) > most:
        spans.sort()
    return [i for _, i in spans[:most]]


def _plot(table: Table, outcomes: list[Outcome]) -> tuple[str, str, str]:
    """A row of panels, or several, for each outcome; of many keys those with the largest differences."""
    count = len(outcomes[0].keys)
    keys = min(count, max(MOST_PANELS // len(outcomes), 1))
    dense, wide = keys < count and keys < 3, keys == 1 or (len(outcomes) > 1 and keys <= 6)
    columns = 4 if dense else keys if wide else min(3, (keys + 4) // 3)
    each = keys if dense else (keys + columns - 1) // columns * columns
    rows = (each * len(outcomes) + columns - 1) // columns
    more = f": of {count} keys the {keys} with the largest differences for each outcome" if keys < count else ""
    commands = f"  set multiplot layout {rows},{columns} title '{plain(table.head['title'])}{more}' noenhanced\n  set grid ytics\n  unset key\n  set zero 1e-30\n"
    for i, of in enumerate(outcomes):
        commands += "".join(_panel(of, of.keys[key], i * count + key) for key in _strongest(of, keys))
        commands += "  set multiplot next\n" * (each - keys)
    return "rollouts", f"size {480 * columns},{360 * rows}", commands + "  unset multiplot\n"


# The screen.

def _estimate_text(of: Estimate) -> str:
    return "{:.3f} ({:.3f} to {:.3f})".format(*of) if of else "-"


def _bin_text(key: Key, each: Bin) -> str:
    where = each.label if key.text else f"{each.low:.3g}" if each.low == each.high else f"{each.low:.3g} to {each.high:.3g}"
    assert each.estimate
    return f"{where}: {each.estimate[0]:.3g}"


def _keys_text(of: Outcome) -> str:
    """What each varied key does to an outcome, as a table."""
    out = f"  {'varied':<44} {'rank correlation':<26} {'share held' if of.verdict else 'mean'}\n"
    return out + "".join(f"  {key.name:<44} {_estimate_text(key.correlation):<26} {', '.join(_bin_text(key, each) for each in key.telling())}\n"
                         for key in of.keys)


def short_owners(shares: Sequence[tuple[str, float]]) -> str:
    """The owners by the last words of their keys."""
    out = []
    for name, share in shares:
        while (at := name.find("hands.")) >= 0:
            deviations = name.find("deviations.", at)
            name = name[:at] + name[at + 6 if deviations < 0 else deviations + 11:]
        out.append((name, share))
    return owners_text(out)


def _line(of: Outcome, width: int) -> str:
    """An outcome in one line; nothing of one that does not vary."""
    if not of.varies():
        return ""
    assert of.all
    low, high = of.middle_90()
    name, spread = (f"share {of.name}", f"({of.all[1]:.3f} to {of.all[2]:.3f}, 95 %)") if of.verdict else (of.name, f"{low:.4g} to {high:.4g}")
    return f"  {name:<{width}} {of.all[0]:>11.4g}  {spread:<25} {short_owners(of.variance)}\n"


def held_text(table: Table, held: Outcome) -> str:
    """``held in 87 % of 200 hands, 82 to 91 % (95 % interval)``; empty where nothing is judged."""
    if not held.all:
        return ""
    refused = table.endings().get("refused", 0)
    share, low, high = (100 * each for each in held.all)
    return f"held in {share:.0f} % of {len(held.values)} hands, {low:.0f} to {high:.0f} % (95 % interval)" + (f"; {refused} refused" if refused else "")


def screen_text(table: Table, outcomes: list[Outcome]) -> str:
    """How the rollouts ended, and each outcome with what the varied keys do to it."""
    ended = ", ".join(f"{count} {word}" for word, count in table.endings().items())
    out = [f"{table.head['title']}\n  {table.size} rollouts: {ended}\n"]
    width = max(34, *(len(of.name) for of in outcomes))
    for i, of in enumerate(outcomes):
        if len(outcomes) > TOLD or len(outcomes) * len(of.keys) > MOST_LINES:
            if i == 0:
                out.append((f"  {held_text(table, of)}\n" if of.all else "") + f"\n  {'figure':<{width}} {'mean':>11}  {'nine in ten':<25} variance of\n")
            out.append(_line(of, width))
            continue
        if of.verdict:
            out.append(f"  {of.name}: {np.count_nonzero(of.values == 1)} of {len(of.values)} judged, share {_estimate_text(of.all)} with its 95 % interval\n")
        else:
            out.append(f"\n  {of.name}: mean {_estimate_text(of.all)} with its 95 % interval, of {len(of.values)} rollouts")
            if len(of.values):
                out.append("; nine in ten from {:.4g} to {:.4g}".format(*of.middle_90()))
            out.append("\n")
        out.append(_keys_text(of) + (f"  variance of {of.name}: {owners_text(of.variance)}\n" if of.variance else ""))
    return "".join(out)


def figure_rows(head: str, outcomes: list[Outcome]) -> str:
    """Lines of uncertain.csv after their head: figure, hands, mean or share, ends of the middle 90 % or of the share's 95 %
    interval, owners of the variance."""
    out = []
    for of in outcomes:
        if len(of.values):
            assert of.all
            low, high = of.all[1:] if of.verdict else of.middle_90()
            out.append(f"{head},{quoted(of.name)},{len(of.values)},{of.all[0]:.7g},{low:.7g},{high:.7g},{quoted(short_owners(of.variance))}\n")
    return "".join(out)


# Files.

def _replaced(path: Path, write: Callable[[Path], None]) -> None:
    """The file has its name when it is whole. :raises Error: of kind output"""
    if path.is_symlink() or (path.exists() and not path.is_file()):
        raise Error(f"{path}: got something else than a file, need a name for one", "output")
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        write(part)
        with open(part, "rb") as file:
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        raise Error(f"{path}: got a file that cannot be written ({error.strerror or error}), need room on the disk", "output") from None
    finally:
        with suppress(OSError):
            part.unlink()


def write_csv(table: Table, path: Path) -> int:
    """:returns: the hash of the text"""
    def write(part: Path) -> None:
        with open(part, "wb") as file:
            file.write(table.head["csv"].encode())
            file.writelines(table.parts.lines(0, table.size))

    _replaced(path, write)
    with open(path, "rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        found: int = _core.bytes_hash(content)
    return found


def bands_text(curves: list[tuple[list[str], Array]]) -> str:
    """At each time the 5th, 50th and 95th percentile of each curve, ``NAME.p5[unit]``, of those that reach it.

    :param curves: with the same columns and times, some of which may end early
    """
    names, longest = max(curves, key=lambda each: len(each[1]))
    heads = [names[0]]
    for name in names[1:]:
        unit = name.find("[") if "[" in name else len(name)
        heads += [f"{name[:unit]}.{part}{name[unit:]}" for part in ("p5", "p50", "p95")]
    out = [",".join(f'"{head}"' if "," in head else head for head in heads)]
    for row in range(len(longest)):
        there = np.sort(np.stack([values[row] for _, values in curves if row < len(values)]), axis=0)
        bands = np.stack([quantile(there, share) for share in (0.05, 0.5, 0.95)], axis=1)[1:]
        out.append(",".join([number(longest[row, 0]), *(f"{value:.7g}" for value in bands.ravel().tolist())]))
    return "\n".join(out) + "\n"


class _Written:
    """A file for HDF5. Where the disk is full it keeps the reason and takes what else comes as written, so that HDF5 can close
    it: a file that it cannot finish ends the process.
    """

    def __init__(self, file: int) -> None:
        """:param file: its descriptor; empty"""
        self._file, self._place, self._size = file, 0, 0
        self.failure: Optional[OSError] = None

    def seek(self, place: int, whence: int = os.SEEK_SET) -> int:
        self._place = place + (self._size if whence == os.SEEK_END else 0)
        return self._place

    def tell(self) -> int:
        return self._place

    def readinto(self, into: Any) -> int:
        view = memoryview(into).cast("B")
        found = os.pread(self._file, len(view), self._place)
        view[:] = found.ljust(len(view), b"\0")
        self._place += len(view)
        return len(view)

    def write(self, data: Any) -> int:
        view = memoryview(data).cast("B")
        done = 0
        try:
            while self.failure is None and done < len(view):
                done += os.pwrite(self._file, view[done:], self._place + done)
        except OSError as error:
            self.failure = error.with_traceback(None)
        self._place += len(view)
        self._size = max(self._size, self._place)
        return len(view)

    def truncate(self, size: int) -> None:
        self._size = size
        try:
            os.ftruncate(self._file, size)
        except OSError as error:
            self.failure = self.failure or error.with_traceback(None)

    def flush(self) -> None:
        pass

    def check(self) -> None:
        """:raises OSError: where something was not written"""
        if self.failure is not None:
            raise self.failure


def _h5_file(written: _Written) -> Any:
    from h5py import h5f, h5fd, h5p

    # A traceback that holds this list until Python has gone ends the process: HDF5 frees it by calling Python.
    access = h5p.create(h5p.FILE_ACCESS)
    access.set_fileobj_driver(h5fd.fileobj_driver, written)
    # Closes what a traceback holds, too.
    access.set_fclose_degree(h5f.CLOSE_STRONG)
    # HDF5 2 writes times of groups, too.
    root = h5p.create(h5p.FILE_CREATE)
    root.set_obj_track_times(False)
    return h5f.create(b"rollouts.h5", h5f.ACC_TRUNC, root, access)


def _write_h5(table: Table, part: Path) -> None:
    """Equal tables give equal bytes: without times, by the calls of HDF5 in one order. A missing number is NaN, a missing text
    is empty; units are written ``[m per s]``, since a slash parts groups."""
    from h5py import h5a, h5d, h5g, h5p, h5s, h5t, string_dtype

    text_type = h5t.C_S1.copy()
    text_type.set_size(h5t.VARIABLE)
    text_type.set_cset(h5t.CSET_UTF8)
    plain = h5p.create(h5p.DATASET_CREATE)
    plain.set_obj_track_times(False)
    ordered = h5p.create(h5p.GROUP_CREATE)
    ordered.set_obj_track_times(False)
    ordered.set_link_creation_order(h5p.CRT_ORDER_TRACKED | h5p.CRT_ORDER_INDEXED)

    def texts(of: Iterable[str]) -> Any:
        return np.array([each.encode() for each in of], dtype=string_dtype())

    def attribute(name: bytes, of: list[str]) -> None:
        h5a.create(file, name, text_type, h5s.create_simple((len(of),))).write(texts(of))

    def dataset(group: Any, name: str, of: Any) -> None:
        numbers = isinstance(of, np.ndarray)
        made = h5d.create(group, name.replace("/", " per ").encode(), h5t.IEEE_F64LE if numbers else text_type,
                          h5s.create_simple(of.shape if numbers else (len(of),)), plain)
        made.write(h5s.ALL, h5s.ALL, np.ascontiguousarray(of) if numbers else texts(of))
        written.check()

    def fill() -> None:
        attribute(b"title", [table.head["title"]])
        attribute(b"seed", [table.head["seed"]])
        attribute(b"origin", table.head["origin"])
        group = h5g.create(file, b"rollouts", None, ordered)
        for columns in table.groups():
            for i, column in columns.items():
                dataset(group, table.names[i], column)
        group = h5g.create(file, b"trajectories", None, ordered)
        for number, (names, values) in table.parts.series(False):
            dataset(group, str(number), values)
            # A head of many names is too large for an attribute: a dataset beside it.
            dataset(group, f"{number}.columns", names)

    with open(part, "w+b", buffering=0) as raw:
        written = _Written(raw.fileno())
        file = _h5_file(written)
        try:
            fill()
        finally:
            file.close()
        written.check()


def write_files(table: Table, out: Path) -> tuple[list[Outcome], bool, list[str]]:
    """:returns: the outcomes, whether the plot was drawn, and what is missing, with the reason"""
    missing = []
    try:
        import h5py  # noqa: F401
    except ImportError:
        missing.append("rollouts.h5: no package h5py (pip install h5py, or apt install python3-h5py)")
    else:
        _replaced(out / "rollouts.h5", lambda part: _write_h5(table, part))
    outcomes = table.effects()
    plotted = [of for of in outcomes if of.varies()] or outcomes
    text_hash = write_csv(table, out / "rollouts.csv")
    drawn: bool = _core.write_plots(out, "rollouts", _plot_data(plotted[:TOLD]), [_plot(table, plotted[:TOLD])])
    curves = [of for _, of in table.parts.series(True)]
    if curves:
        _core.write_file(out / "bands.csv", bands_text(curves).encode())
    _core.write_file(out / "summary.json", summary_text(table, outcomes, text_hash).encode())
    return outcomes, drawn, missing
