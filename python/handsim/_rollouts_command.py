"""``handsim rollouts STUDY --out DIR``, and what draws uncertain hands for `run`, `grasp` and `inverse`."""
from __future__ import annotations

import json
import signal
import sys
from pathlib import Path
from typing import Any, Callable, Optional, Sequence

from . import _core
from ._errors import Error, input_error
from ._files import ended, read_options
from ._overrides import command_overrides
from ._progress import bar, print_line
from ._rollouts import Asked, Executor, Range, Threads, dask_at
from ._rollouts_run import Finished, Stopped, remove_rows, rollouts_order, run, uncertain_grasps
from ._shipped import find_file
from ._study_files import plot_note, whole_option

USAGE = """handsim rollouts STUDY [--out DIR]

Thousands of runs of a scene, each with its own person, mass, friction or pose, on all cores or on many machines: one table, what makes
them held, a plot (docs/rollouts.md). STUDY is a file or a shipped name. Rows are kept in DIR/rollouts.part as they come.

  --out DIR          out/STUDY
  --set KEY=VALUE    a change of the scene; may be repeated
  --engine ENGINE    of all rollouts: ode, dae, articulated or auto
  --count N          draws, in place of the study's
  --seed N           in place of the study's
  --jobs N           threads; as many as the machine has cores
  --on ADDRESS       dask://HOST:PORT of a Dask scheduler, whose workers compute in place of this machine
  --resume           goes on with a study that was stopped
  --range A:B        rollouts A to B - 1 alone: rollouts.part of several ranges, one after the other, are that of the study
  --report           report.html: tables to sort and a plot, for a browser

Exit status 1: stopped, or a file could not be written.

Example: handsim rollouts config/rollouts_power_can.yaml --out out/power_can --count 100
"""
MOST_COUNT = 100_000_000
VALUES = ("--out", "--set", "--engine", "--count", "--seed", "--jobs", "--on", "--range")


def _range(text: Optional[str]) -> Optional[Range]:
    if text is None:
        return None
    first, _, last = text.partition(":")
    if not (text.isascii() and first.isdigit() and last.isdigit() and int(first) < int(last)):
        raise input_error("--range", text, "A:B, from rollout A to before B, such as 0:1000")
    return int(first), int(last)


def _stopping() -> Callable[[], None]:
    """What raises Stopped after Ctrl-C and at the end of a job's time; a second signal ends the program at once."""
    asked = False

    def handler(number: int, _: Any) -> None:
        nonlocal asked
        asked = True
        signal.signal(number, signal.SIG_DFL)

    def wait() -> None:
        if asked:
            raise Stopped

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)
    return wait


def executor_at(address: str, threads: int = 0) -> Executor:
    if not address:
        return Threads(threads)
    out = dask_at(address)
    if out.page:
        print_line(f"Dask's page: {out.page}")
    return out


def _end(finished: Finished, out: Path, drawn: bool, again: str) -> int:
    """Prints what has come of it. :returns: exit status"""
    if finished.before:
        print(f"complete already: files in {out}")
        return 0
    if finished.done < finished.size:
        print_line(f"stopped: {finished.done} of {finished.size} rollouts are done; the same command{again} goes on")
        return 1
    for what in finished.missing:
        print_line(f"missing: {what}")
    print(finished.text, end="")
    rate = f" ({finished.computed / finished.seconds:.3g} a second)" if finished.seconds > 0 and finished.computed else ""
    plots, status = plot_note(finished.plotted)
    print(f"files in {out}{plots}" if drawn else f"  {finished.computed} rollouts in {finished.seconds:.3g} s{rate}; files in {out}{plots}")
    return status


def _work(options: dict[str, Any]) -> int:
    study = find_file(options["STUDY"], "study")
    out = Path(options.get("--out") or Path("out") / study.stem)
    asked = Asked(study, False, tuple(command_overrides(options)), whole_option(options, "--count", 1, MOST_COUNT), whole_option(options, "--seed", 0, 2**31 - 1))
    threads, only = whole_option(options, "--jobs", 1, 4096) or 0, _range(options.get("--range"))
    order = rollouts_order(asked, out, resume="--resume" in options, only=only, report="--report" in options)
    wait = _stopping()
    with executor_at(options.get("--on", ""), threads) as executor, bar(True, "rollouts") as told:
        finished = run(order, executor, told, wait, note=print_line)
    if only and finished.done == finished.size and not finished.before:
        print(f"rollouts {only[0]} to {only[1] - 1} are in {out / 'rollouts.part'}: cat those of all ranges into one file, then --resume in its folder "
              "makes the table")
        return 0
    return _end(finished, out, False, " with --resume")


def drawn(job: dict[str, Any]) -> int:
    """What another command asks for: its hands are drawn."""
    out, count, overrides = Path(job["out"]), int(job["count"]), tuple(job["overrides"])
    wait = _stopping()
    with executor_at(job["on"]) as executor, bar(True, "hands") as told:
        if "scenes" in job:
            finished = uncertain_grasps([Path(each) for each in job["scenes"]], job["sides"], [Path(each) for each in job["persons"]], overrides, count,
                                        out, executor, told, wait, print_line)
            if finished.done == finished.size:
                _core.finish_study(out, job["command"], {}, {}, job["report"])
            return _end(finished, out, True, "")
        inverse = job.get("inverse")
        asked = Asked(job["file"], True, overrides, count, inverse=tuple(inverse) if inverse else None)
        order = rollouts_order(asked, out, report=job["report"], resume=(out / "rollouts.part").exists())
        if inverse:
            # What it reads of the motion is no part of a study's name.
            remove_rows(out)
            order = order._replace(command=job["command"], row="", resume=False, inputs=[Path(each) for each in inverse[:3] if each])
        finished = run(order, executor, told, wait, "hands", print_line)
    return _end(finished, out, False, "")


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if arguments[:1] == ["--job"]:
        return ended(lambda: drawn(json.loads(arguments[1])))
    if not arguments:
        print("rollouts: got no STUDY, need a file or the name of a shipped study; see handsim rollouts --help", file=sys.stderr)
        return 2
    if any(each in ("-h", "--help") for each in arguments):
        print(USAGE, end="")
        return 0
    return ended(lambda: _work(read_options("rollouts", arguments, "STUDY", ("--resume", "--report"), VALUES, ())))
