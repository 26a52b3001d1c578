"""The table, files and plot of rows beside measurements."""
from __future__ import annotations

import glob
import math
from pathlib import Path
from typing import Any, Callable, NamedTuple, Optional

from . import _core
from ._rollouts import Executor
from ._statistics import owners_text
from ._study_files import json_file, origin, plain, quoted
from ._validate import Filter, Measured, Measurements, Result, Row, Tally, Told, every, of_people, predicted

MOST_SPREADS = 4.0
"""Of the plot; rows beyond are at its edge."""
POINT_HEIGHT, TIC_HEIGHT = 0.3, 1.0
"""Of a row without and with its name, in lines."""
GROUP_HEIGHT, LINE_PIXELS = 2.0, 16
"""Two lines name a group."""
LONGEST_NAME = 56
"""Of a row, in bytes."""
VALUE_IS = ("fitted", "norm", "scaled", "predicted")
GROUPS: dict[str, Filter] = {
    "people, spread and conditions of the source": of_people,
    "people, some of these chosen": lambda row: row["of"] == "people" and not of_people(row),
    "cadavers": lambda row: bool(row["of"] == "cadavers"),
    "other models": lambda row: bool(row["of"] == "model")}
"""Rows by what they are, each in one."""
HEAD = ("quantity,ours,measured,spread,unit,deviation_over_spread,verdict,required,of,spread_is,value_is,chosen,weight,source,reason,"
        "percentile_5,percentile_95,inside\n")
NAMES = ["validate.csv", "validate.json", "validate.gp", "study.json", "report.html", "validate.png", "validate.svg"]


Show = Callable[[str], object]


class End(NamedTuple):
    """What a study has come to."""

    text: str
    """For the screen."""
    passed: bool
    plotted: bool
    """False: gnuplot is missing or has failed."""


def _groups(result: Result) -> dict[str, list[Measured]]:
    """The measured rows of each kind."""
    out: dict[str, list[Measured]] = {}
    for row in result.rows:
        if row.measured:
            out.setdefault(row.row["kind"], []).append(row)
    return out


# The plot.

def _shortened(text: str) -> str:
    """The first characters."""
    start = text.encode()[:LONGEST_NAME].decode(errors="ignore")
    return start + "..." if start != text else text


class _Layout:
    """Rows from the top, the kinds' names on the left, names of rows that fall short on the right."""

    def __init__(self, groups: dict[str, list[Measured]]) -> None:
        self.points = ""  # deviation, height, 1 for within, 2 for short, 3 for beyond
        self.kinds: list[str] = []  # tics
        self.short: list[str] = []
        self.between: list[float] = []  # heights of lines between kinds
        self.height = 0.0  # lines
        for kind, rows in groups.items():
            own = 0.0
            for row in rows:
                own += _height(row)
            whole = max(own, GROUP_HEIGHT) + 2 * POINT_HEIGHT
            within = sum(row.within for row in rows)
            self.kinds.append(f'"{kind.replace("_", " ")}\\n{within} of {len(rows)}" {_number(self.height + whole / 2)}')
            at = self.height + (whole - own) / 2
            for row in rows:
                self._add(row, at + _height(row) / 2)
                at += _height(row)
            self.height += whole
            self.between.append(self.height)

    def _add(self, row: Measured, height: float) -> None:
        away = math.copysign(row.deviation, row.ours - row.row["measured"])  # arms: of means
        which = 1 if row.within else 3 if row.deviation > MOST_SPREADS else 2
        self.points += f"{_number(min(max(away, -MOST_SPREADS), MOST_SPREADS))} {_number(height)} {which}\n"
        if not row.within:
            self.short.append(f"'{_shortened(plain(row.row['name']))}: {away:+.1f}' {_number(height)}")


def _height(row: Measured) -> float:
    return POINT_HEIGHT if row.within else TIC_HEIGHT


def _number(of: float) -> str:
    return repr(of).removesuffix(".0")


def _plots(result: Result) -> tuple[str, list[tuple[str, str, str]]]:
    """Data and plot of the differences over spreads, one point for each row, and a band of one spread."""
    layout = _Layout(_groups(result))
    if not layout.points:
        return "", []
    lines = "".join(f"set arrow from graph 0, first {_number(each)} to graph 1, first {_number(each)} nohead linecolor rgb '#bbbbbb'\n"
                    for each in layout.between)
    points = ", ".join(f"$rows using ($3 == {which} ? $1 : NaN):2 with points {style} title '{title}'" for which, style, title in (
        (1, "pointtype 7 pointsize 0.6 linecolor rgb '#2e7d32'", "within"), (2, "pointtype 7 pointsize 0.8 linecolor rgb '#c8553d'", "short"),
        (3, "pointtype 13 pointsize 1.2 linecolor rgb '#c8553d'", "beyond")))
    edge, bottom = _number(MOST_SPREADS + 0.2), _number(layout.height)
    commands = (f"  set title '{plain(result.title)}: {100 * result.within().share:.0f} % of values within one spread'\n"
                "set xlabel '(ours - measured) / spread; of moment arms the root mean square over the angles'\n"
                f"set xrange [-{edge}:{edge}]\nset yrange [{bottom}:0]\nset y2range [{bottom}:0]\nset grid xtics\n"
                f"set ytics scale 0 ({', '.join(layout.kinds)})\nset y2tics scale 0 ({', '.join(layout.short)})\nset lmargin at screen 0.14\n"
                "set rmargin at screen 0.62\nset key horizontal samplen 1 at screen 0.98, screen 0.995 right top\n"
                "set object 1 rectangle from -1, graph 0 to 1, graph 1 fillcolor rgb '#dcebd5' fillstyle solid noborder behind\n"
                f"{lines}plot {points}\n")
    terminal = f"noenhanced size 1100,{110 + LINE_PIXELS * layout.height:.0f} font 'DejaVu Sans,9'"
    return f"$rows << EOD\n{layout.points}EOD\n", [("validate", terminal, commands)]


# The screen.

def _tally_text(of: Tally) -> str:
    return f"{of.within:.4g} of {of.values:.4g}" if of.values > 0 else ""


def _both(first: Filter, value_is: str) -> Filter:
    return lambda row: first(row) and row["value_is"] == value_is


def _groups_table(result: Result) -> str:
    """Values within one spread by what they are (lines) and by how ours relate to them (columns)."""
    out = f"\n{'values within one spread, of':<45}" + "".join(f"{word:>15}" for word in VALUE_IS) + f"{'all':>17}"
    for name, has in [*GROUPS.items(), ("all", every)]:
        if result.within(has).values > 0:
            cells = "".join(f"{_tally_text(result.within(_both(has, word))):>15}" for word in VALUE_IS)
            out += f"\n{name:<45}{cells}{_tally_text(result.within(has)):>17}"
    return out + "\n"


def _coverage_text(result: Result) -> str:
    """Measured values within the middle 90 % of drawn hands, by kind."""
    whole, ours = result.covered(), result.covered(predicted)
    if whole.values == 0:
        return ""
    by_kind = [(kind, result.covered(lambda row, kind=kind: row["kind"] == kind)) for kind in _groups(result)]  # type: ignore[misc]
    told = ", ".join(f"{kind} {100 * of.share:.0f} % of {of.values:.0f}" for kind, of in by_kind if of.values > 0)
    return (f"{100 * whole.share:.0f} % of {whole.values:.0f} measured values are within the middle 90 % of drawn hands, their spread added "
            f"({100 * ours.share:.0f} % of {ours.values:.0f} predictions): {told}\n"
            f"{_calibration_text(result)}")


def _calibration_text(result: Result) -> str:
    """The same with intervals as wide as predictions of other sources need them."""
    drawn = [row.widened for row in result.rows if row.uncertainty]
    whole, ours = result.covered(calibrated=True), result.covered(predicted, calibrated=True)
    return (f"intervals that are {min(drawn):.2g} to {max(drawn):.2g} times as wide, by predictions of other sources, have {100 * whole.share:.0f} % "
            f"({100 * ours.share:.0f} % of predictions); by all predictions they have to be {result.widened:.2g} times as wide\n")


def _row_text(row: Measured, width: int) -> str:
    of, verdict = row.row, "within" if row.within else f"{row.deviation:.1f} x"
    if not row.within and of["required"]:
        verdict += " short"
    scale = 1 / of["scale"]
    out = (f"{of['name']:<{width}}  {scale * row.ours:>9.3g}  {scale * of['measured']:>9.3g} +- {scale * of['spread']:>5.2g}  {of['unit']:<6} "
           f"{verdict:<12} {of['of']}, {of['value_is']}: {of['source']}\n")
    if row.uncertainty:
        drawn = row.uncertainty
        missing = f", {drawn.missing} have none" if drawn.missing else ""
        out += (f"{'':>{width}}  nine in ten hands {scale * drawn.low:.3g} to {scale * drawn.high:.3g}{'' if row.inside else ', OUTSIDE with the spread'}"
                f"{missing}; {owners_text(drawn.variance)}\n")
    if of["chosen"]:
        out += f"{'':>{width}}  chosen: {of['chosen']}\n"
    for text in (row.note, "" if row.within else of["reason"]):
        out += f"{'':>{width}}  {text}\n" if text else ""
    return out


def table_text(result: Result) -> str:
    rows = [row for row in result.rows if row.measured]
    width = max([8, *(len(row.row["name"].encode()) for row in result.rows)])
    ours, people, whole = result.within(predicted), result.within(of_people), result.within()
    out = f"{'quantity':<{width}}  {'ours':>9}  {'measured +- spread':>18}  {'unit':<6} {'verdict':<12} source\n"
    out += "".join(_row_text(row, width) for row in rows if not predicted(row.row))
    if ours.values > 0:
        out += "\npredictions, to which neither a number of the hand nor a norm is fitted\n"
    out += "".join(_row_text(row, width) for row in rows if predicted(row.row))
    out += _groups_table(result)
    if people.values > 0:
        out += f"\n{_tally_text(people)} values of people with spread and conditions of their source are within it\n"
    if ours.values > 0:
        out += f"{_tally_text(ours)} predictions are within one spread\n"
    required = sum(row.row["required"] for row in rows)
    out += (f"{100 * whole.share:.0f} % of {whole.values:.4g} values are within one spread (goal {100 * result.goal:.0f} %); {required} rows are required, "
            f"{'all within' if result.passed else 'not all within'}\n")
    out += _coverage_text(result)
    left_out = len(result.rows) - len(rows)
    return out + (f"{left_out} rows are simulations, which --runs runs\n" if left_out else "")


# Files.

def csv_text(result: Result) -> str:
    out = HEAD
    for row in result.rows:
        if not row.measured:
            continue
        of, scale, drawn = row.row, row.row["scale"], row.uncertainty
        drawn_cells = f"{drawn.low / scale:.6g},{drawn.high / scale:.6g},{'yes' if row.inside else 'no'}" if drawn else ",,"
        out += (f"{quoted(of['name'])},{row.ours / scale:.6g},{of['measured'] / scale:.6g},{of['spread'] / scale:.6g},{of['unit']},{row.deviation:.4g},"
                f"{'within' if row.within else 'short'},{'yes' if of['required'] else 'no'},{of['of']},{of['spread_is']},{of['value_is']},{quoted(of['chosen'])},"
                f"{row.weight:.4g},{quoted(of['source'])},{quoted('; '.join(filter(None, (of['reason'], row.note))))},{drawn_cells}\n")
    return out


def json_text(result: Result) -> str:
    def tally(of: Tally) -> dict[str, float]:
        return {"within": of.within, "values": of.values}

    out: dict[str, Any] = {"title": result.title, "values_within_spread": tally(result.within()), "people_within_spread": tally(result.within(of_people)),
                           "predictions_within_spread": tally(result.within(predicted)), "goal": result.goal, "required_rows_within": result.passed}
    for name, has in GROUPS.items():
        for word in VALUE_IS:
            of = result.within(_both(has, word))
            if of.values > 0:
                out.setdefault("groups", {}).setdefault(name, {})[word] = tally(of)
    if result.covered().values > 0:
        out["inside_90"] = result.covered().share
        out["calibrated"] = {"widened": result.widened, "inside_90": result.covered(calibrated=True).share,
                             "predictions_inside_90": result.covered(predicted, calibrated=True).share}
    return json_file({**out, **origin()})


def write(result: Result, out: Path) -> bool:
    """The table, the JSON and the plot. :return: False if gnuplot is missing or fails"""
    _core.write_file(out / "validate.csv", csv_text(result).encode())
    _core.write_file(out / "validate.json", json_text(result).encode())
    data, plots = _plots(result)
    drawn: bool = _core.write_plots(out, "validate", data, plots)
    return drawn


def _commands(file: Path, runs: bool, result: Result) -> tuple[str, dict[str, list[str]]]:
    """What repeats the study, and its rows."""
    def of_row(row: Row) -> str:
        return _core.command_text(["run", row["scene"]], row.get("set", [])) if row["kind"] == "simulation" else ""

    words = ["validate", str(file), *(["--runs"] if runs else [])]
    return _core.command_text(words, []), {"validate.csv": [of_row(row.row) for row in result.rows if row.measured]}


def study(file: Path, out: Optional[Path], *, runs: bool = False, uncertain: Optional[int] = None, report: bool = False, told: Told = None,
          show: Show = lambda _: None, executor: Optional[Executor] = None) -> End:
    """The whole study.

    :param out: folder of its files; None: none are written, and no simulations are run
    :param show: gets the text before the files are written, which may fail
    :param executor: measures drawn hands; None: this process
    :raises Error: of kind input for a wrong file or folder, of kind physics for a row without a value
    """
    measurements = Measurements(file)
    if out is None:
        result = measurements.run(None, uncertain, told, executor)
        show(text := _text(result))
        return End(text, result.passed, True)
    folder = _core.output_folder(out, [glob.escape(name) for name in NAMES], [file])
    try:
        result = measurements.run(out / "runs" if runs else None, uncertain, told, executor)
        show(text := _text(result))
        folder.clear()
        plotted = write(result, out)
        command, rows = _commands(file, runs, result)
        _core.finish_study(out, command, rows, {}, report)
        return End(text, result.passed, plotted)
    finally:
        del folder  # ends the lock


def _text(result: Result) -> str:
    return f"{result.title}\n\n{table_text(result)}"
