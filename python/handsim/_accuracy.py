"""Errors and CPU times of methods and steps on one scene: ``handsim accuracy``, and `study.accuracy`.

The core runs the rows (src/handsim/study/accuracy); what they show is written here.
"""
from __future__ import annotations

import json
import math
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Callable, NamedTuple, Optional, Sequence

from . import _core
from ._files import ended, read_options, usage
from ._progress import Told, bar
from ._shipped import find_file
from ._study_files import csv_text, json_file, number, origin, plain, print_files, quoted, real_of, study_names

USAGE = """handsim accuracy STUDY [--out DIR]

Errors and CPU times of methods and steps, as table, CSV, JSON and plots (docs/accuracy.md). STUDY is a file or a shipped name.

  --out DIR          out/STUDY
  --target ERROR     names the cheapest method and step that reaches this error; exit status 1 if none does
  --report           report.html: tables to sort and a plot, for a browser

Example: handsim accuracy config/accuracy_slider_crank.yaml --out out/accuracy --target 1e-3
"""
COST = "CPU seconds per simulated second"
COLOURS = ("#0060ad", "#d62728", "#2ca02c", "#ff7f0e", "#9467bd", "#8c564b", "#17becf", "#e377c2", "#7f7f7f", "#bcbd22")
"""Distinguishable on white."""
ERRORS = (0.1, 0.03, 0.01, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)

Row = dict[str, Any]
"""What `row_json` of src/handsim/study/accuracy/accuracy.cpp writes."""
Plot = tuple[str, str, str]


class Line(NamedTuple):
    """Of a plot: one method, or several with the same ``line`` of the study's file."""

    title: str
    peer: bool
    has_steps: bool
    """False if its methods differ in their tolerance instead of their step."""
    rows: list[Row]


def _read(text: str) -> dict[str, Any]:
    """What C++ found. JSON has null for a figure that is not finite; here it is NaN."""
    found: dict[str, Any] = json.loads(text)
    for row in found["rows"]:
        row.update({key: math.nan for key in ("rate_error", "early_rate_error", "position_error", "gap", "cpu") if row[key] is None})
    return found


def _finite(value: float) -> Optional[float]:
    return value if math.isfinite(value) else None


def _cost(row: Row) -> float:
    return float(row["cpu"])


def cheapest(found: dict[str, Any], target: float) -> Optional[Row]:
    """The row with the smallest cost whose whole-run error is at most the target. Where the study has a reference, rows with one of
    their own do not compete."""
    rows: list[Row] = [row for row in found["rows"] if row["fault"] is None and not row["is_reference"] and not (found["reference"] and row["own_reference"])
            and row["rate_error"] <= target]
    return min(rows, key=_cost) if rows else None


def _note(row: Row) -> str:
    return "its own reference" if row["is_reference"] else "compared with its smallest step" if row["own_reference"] else ""


def _csv_row(row: Row) -> dict[str, str]:
    out = {"method": quoted(row["method"]), "step": number(row["step"])}
    if row["fault"] is not None:
        return {**out, "note": quoted(row["fault"])}
    return {**out, "rate_error_rms": number(row["rate_error"]), "early_rate_error_rms": number(row["early_rate_error"]),
            "position_error_rms": number(row["position_error"]), "joint_gap": number(row["gap"]),
            "energy_error": "" if row["energy_error"] is None else number(row["energy_error"]), "cpu_seconds_per_second": number(row["cpu"]),
            "times_real_time": number(1 / row["cpu"]), "note": _note(row)}


def _json_row(row: Row) -> dict[str, Any]:
    out = {"method": row["method"], "step_s": row["step"]}
    if row["fault"] is not None:
        return {**out, "fault": row["fault"]}
    return {**out, "rate_error_rms": _finite(row["rate_error"]), "early_rate_error_rms": _finite(row["early_rate_error"]),
            "position_error_rms": _finite(row["position_error"]), "joint_gap_m": _finite(row["gap"]), "energy_error": row["energy_error"],
            "cpu_seconds_per_second": _finite(row["cpu"]), "times_real_time": _finite(1 / row["cpu"]),
            "own_reference": row["own_reference"], "is_reference": row["is_reference"]}


def _lines(found: dict[str, Any]) -> list[Line]:
    """Of plots of errors and costs, without methods whose own scene has another reference."""
    out = list[Line]()
    for method in found["methods"]:
        if method["own_scene"]:
            continue
        title = method["name"] if method["line"] is None else method["line"]
        if not out or out[-1].title != title:
            out.append(Line(title, method["outside"], method["line"] is None, []))
        out[-1].rows.extend(row for row in found["rows"] if row["method"] == method["name"] and row["fault"] is None and not row["is_reference"])
    return [line for line in out if line.rows]


def _style(index: int, dashed: bool) -> str:
    return f"linecolor rgb '{COLOURS[index % len(COLOURS)]}' dashtype {2 if dashed else 1} linewidth {2 if dashed else 1.5}"


def _plot_of(lines: Sequence[Line], columns: str, against_step: bool) -> str:
    """The plot command. Lines of handsim are solid, those of other engines dashed."""
    out = []
    count = {False: 0, True: 0}
    for i, line in enumerate(lines):
        colour = count[line.peer]
        count[line.peer] += 1
        if not against_step or line.has_steps:
            out.append(f" $m{i} using {columns} with linespoints {_style(colour, line.peer)} pointtype {i % 15 + 1} title '{plain(line.title)}' noenhanced")
    return "plot" * bool(out) + ", \\\n    ".join(out) + "\n"


def _velocity(found: dict[str, Any]) -> tuple[str, list[Plot]]:
    """The rate of the first observed coordinate and the reference: by step, handsim's and others' panels."""
    data, panels, block = "", list[str](), 0

    def add(series: dict[str, Any], title: str, style: str) -> str:
        nonlocal data, block
        data += f"$v{block} << EOD\n" + "".join(f"{time:.6g} {rate:.9g}\n" for time, rate in zip(series["time"], series["rate"])) + "EOD\n"
        block += 1
        return f"$v{block - 1} using 1:2 with lines {style} title '{plain(title)}' noenhanced"

    for step in found["plot_steps"]:
        for peer in (False, True):
            lines = list[str]()
            for method in found["methods"]:
                for row in found["rows"]:
                    if method["outside"] == peer and row["method"] == method["name"] and row["series"]["time"] and abs(row["step"] - step) < 1e-12:
                        lines.append(add(row["series"], row["method"], _style(len(lines), False)))
            if lines and found["reference"]:
                lines.append(add(found["reference"], "reference", "linecolor 'black' dashtype 3 linewidth 2.5"))
            if lines:
                panels.append(f"set title 'step {1e3 * step:g} ms{', other engines' if peer else ''}'\nplot {', '.join(lines)}\n")
    if not panels:
        return data, []
    return data, [("velocity", f"size 1400,{380 * len(panels)}",
                   f"  unset logscale\n  set format '%g'\n  set xlabel 'time [s]'\n  set ylabel 'rate [{found['unit']}/s]'\n"
                   f"  set key outside right font ',9'\n  set multiplot layout {len(panels)},1\n{''.join(panels)}  unset multiplot\n")]


def _plots(found: dict[str, Any]) -> tuple[str, list[Plot]]:
    """Data, and the plots."""
    lines = _lines(found)
    data = "".join(f"$m{i} << EOD\n" + "".join(f"{number(row['step'])} {number(row['rate_error'])} {number(row['early_rate_error'])} {number(row['cpu'])}\n"
                                               for row in line.rows) + "EOD\n" for i, line in enumerate(lines))
    data += "set logscale xy\nset format '10^{%L}'\nset grid\nset key outside right font ',11'\n"
    error = f"[{found['unit']}/s]"
    plots = [(name, "size 1400,800", f"  {autoscale}set title '{title}'\n  set xlabel '{x}'\n  set ylabel '{y}'\n  {_plot_of(lines, columns, bool(autoscale))}")
             for name, title, x, y, columns, autoscale in (
                 ("error_cost", "error against cost", COST, "RMS rate error over the whole run " + error, "4:2", ""),
                 ("cost_step", "cost against step", "step [s]", COST, "1:4", "set autoscale xfix\n  "),
                 ("error_step", "early error against step", "step [s]", f"RMS rate error up to {found['early']:g} s {error}", "1:3", "set autoscale xfix\n  "))]
    more, velocity = _velocity(found)
    return data + more, [*plots, *velocity]


def _table(found: dict[str, Any]) -> str:
    early = f"to {found['early']:g} s"
    out = (f"{'method':<34} {'step ms':>8} {'rate error':>12} {early:>12} {'pos. error':>12} {'gap m':>10} {'energy':>10} "
           f"{'CPU s per s':>12} {'x real':>10}\n")
    for row in found["rows"]:
        head = f"{row['method']:<34} {1e3 * row['step']:>8g} "
        if row["fault"] is not None:
            out += f"{head}{row['fault']}\n"
            continue
        errors = ("(reference)", "") if row["is_reference"] else (f"{row['rate_error']:.3g}", f"{row['early_rate_error']:.3g}")
        energy = "-" if row["energy_error"] is None else f"{row['energy_error']:.2g}"
        out += (f"{head}{errors[0]:>12} {errors[1]:>12} {row['position_error']:>12.3g} {row['gap']:>10.2g} {energy:>10} {row['cpu']:>12.3g} "
                f"{1 / row['cpu']:>10.3g}\n")
    return out


def cheapest_table(found: dict[str, Any]) -> str:
    """The cheapest row for each of a series of errors, down to the smallest that a row reaches; a row that is cheapest for several is
    at the smallest one. Empty if no row reaches the first."""
    best = list[tuple[float, Row]]()
    for error in ERRORS:
        row = cheapest(found, error)
        if row is None:
            break
        if best and best[-1][1] is row:
            best.pop()
        best.append((error, row))
    if not best:
        return ""
    return f"{'error at most':<16} {'cheapest':<34} {'step ms':>8} {'rate error':>12} {'CPU s per s':>12}\n" + "".join(
        f"{error:<16g} {row['method']:<34} {1e3 * row['step']:>8g} {row['rate_error']:>12.3g} {row['cpu']:>12.3g}\n" for error, row in best)


def screen_text(found: dict[str, Any]) -> str:
    cheap = "\n" + cheapest_table(found) if found["reference"] else ""
    return (f"{found['title']}\nRMS rate error [{found['unit']}/s] over the whole run and up to {found['early']:g} s; the error over the whole run saturates "
            f"once the motions are out of phase.\n\n{_table(found)}{cheap}\n")


def target_text(found: dict[str, Any], target: float) -> tuple[str, bool]:
    """What names the cheapest row that reaches the target, and whether there is one."""
    row = cheapest(found, target)
    if row is None:
        return f"no row reaches an error of {target:g} {found['unit']}/s\n", False
    return (f"cheapest at {target:g} {found['unit']}/s: {row['method']} at {1e3 * row['step']:g} ms, error {row['rate_error']:.3g}, {row['cpu']:.3g} CPU "
            "seconds per simulated second\n"), True


def names() -> list[str]:
    return study_names("accuracy", ["error_cost", "cost_step", "error_step", "velocity"])


def write(found: dict[str, Any], command: str, out: Path, report: bool = False) -> bool:
    """Writes the files of the study. :returns: False if gnuplot is missing or fails"""
    about = origin()
    about["versions"]["engines"] = found["engines"]
    unit = found["unit"]
    head = (f"method,step[s],rate_error_rms[{unit}/s],early_rate_error_rms[{unit}/s],position_error_rms[{unit}],joint_gap[m],energy_error,"
            "cpu_seconds_per_second,times_real_time,note")
    _core.write_file(out / "accuracy.csv", csv_text(head, [_csv_row(row) for row in found["rows"]]).encode())
    _core.write_file(out / "accuracy.json", json_file({"title": found["title"], "unit": unit, "early_window_s": found["early"], **about,
                                                       "rows": [_json_row(row) for row in found["rows"]]}).encode())
    plotted = _core.write_plots(out, "accuracy", *_plots(found))
    _core.finish_study(out, command, {"accuracy.csv": [row["command"] for row in found["rows"]]}, {}, report)
    return plotted


def study(file: Path, out: Path, told: Told = None, said: Callable[[str], object] = lambda text: None, report: bool = False) -> tuple[dict[str, Any], bool]:
    """The whole study, with its files.

    :param said: gets the text for the screen before files are written
    :returns: what was found, and False if gnuplot is missing or fails
    """
    of = _core.accuracy(file)
    folder = _core.output_folder(out, names(), [file, *of.scenes])
    found = _read(of.run(told))
    said(screen_text(found))
    folder.clear()
    return found, write(found, _core.command_text(["accuracy", str(file)], []), out, report)


def _shown(text: str) -> None:
    print(text, end="", flush=True)


def _target(text: Optional[str]) -> Optional[float]:
    return None if text is None else real_of("--target", text, math.ulp(0), sys.float_info.max, "an error above 0, such as 1e-3")


def _work(options: dict[str, Any]) -> int:
    file, target = find_file(options["STUDY"], "study"), _target(options.get("--target"))
    out = Path(options.get("--out") or Path("out") / file.stem)
    with ExitStack() as shown:
        bar_of = shown.enter_context(bar(True, "accuracy"))

        def said(text: str) -> None:
            shown.close()  # takes the bar away
            _shown(text)

        found, plotted = study(file, out, bar_of, said, "--report" in options)
    status = print_files(out, plotted)
    if target is None:
        return status
    text, reached = target_text(found, target)
    print(text, end="")
    return status if reached else 1


def _rows(file: Path, out: Path) -> int:
    """Writes the files of rows that another program has found: tests/peers/accuracy.cpp, with other engines."""
    folder = _core.output_folder(out, names(), [file])
    found = _read(sys.stdin.read())
    _shown(screen_text(found))
    folder.clear()
    return print_files(out, write(found, _core.command_text(["accuracy", str(file)], []), out))


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if arguments[:1] == ["--rows"]:
        return ended(lambda: _rows(*map(Path, arguments[1:3])))
    if (status := usage(USAGE, arguments)) is not None:
        return status
    return ended(lambda: _work(read_options("accuracy", arguments, "STUDY", ("--report",), ("--out", "--target"), ())))
