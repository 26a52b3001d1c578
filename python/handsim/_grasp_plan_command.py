"""``handsim grasp plan OBJECT``, and `handsim.grasps`."""
from __future__ import annotations

import sys
from contextlib import ExitStack
from os import PathLike
from pathlib import Path
from typing import Any, Mapping, Sequence, Union

from . import _core, _grasp_plan_files
from ._errors import flag, whole
from ._files import ended, read_options
from ._grasp_plan import Plan, object_file, planned
from ._object import Object
from ._progress import Progress, bar
from ._study_files import whole_option

MOST_THREADS = 1024
USAGE = """handsim grasp plan OBJECT [--person PERSON] [--type TYPE ...] [--count N] [--out DIR]

Finds grasps of an object by a person's hand: of the 33 types of the GRASP taxonomy, fitted to the hand, held and shaken with 2 g on the
articulated engine and at half the step, ranked by margin, effort and naturalness (docs/planning.md). OBJECT is an object file or the name
of a shipped one; handsim object makes one of a mesh.

  --person PERSON   person file or the name of a shipped one; median_man
  --side SIDE       right or left hand; right
  --type TYPE ...   only these types, such as tripod lateral; all of them
  --count N         grasps, 1 to 99; 5
  --others OBJ ...  other objects, as another size of it, on which who.yaml has the best grasp, too
  --ode             each grasp on ODE, too, which takes from seconds to minutes for each
  --threads N       of this machine; one for each core. The list is the same for any number
  --report          best.html: the motion of the best grasp in 3D, for a browser
  --out DIR         table of all that was tried, a scene of each grasp, a sheet of pictures, and who.yaml: a study for handsim rollouts, by which
                    persons the best of them is held; out/OBJECT_grasps

Exit status 1: no grasp was found, or one is not held on ODE.

Example: handsim grasp plan mug --person small_woman --count 10 --out out/mug
"""


def grasps(object: Union[str, "PathLike[str]"], person: Union[str, "PathLike[str]", Mapping[str, Any]] = "median_man", *, side: str = "right",
           types: Sequence[str] = (), count: int = 5, others: Sequence[Union[str, "PathLike[str]"]] = (), ode: bool = False, threads: int = 0,
           out: Union[str, "PathLike[str]", None] = None, report: bool = False, progress: Progress = None) -> Plan:
    """Grasps of an object by a person's hand, the best first, as ``handsim grasp plan``: ``plan.grasps``, each with its ``scene()``.

    :param object: an `Object`, the path of an object file, or the name of a shipped one
    :param person: name of a shipped person, path of a person file, or a mapping with the keys of one
    :param side: ``right`` or ``left`` hand
    :param types: names of types; none: all 33
    :param count: grasps, 1 to 99
    :param others: other objects, as another size of this one, on which the study of ``who.yaml`` has the best grasp, too
    :param ode: each grasp on ODE, too
    :param threads: of this machine; 0: one for each core
    :param out: folder for the table, a scene of each grasp, a sheet of pictures and ``who.yaml`` for `study.rollouts`
    :param report: with `out`: also the page ``best.html`` of the best grasp
    :raises Error: of kind input for what is no object that moves, no person and no type. An object that cannot be held is no error: see
        ``plan.why()``
    """
    flag("ode", ode), flag("report", report), whole("count", count, 1, _grasp_plan_files.MOST), whole("threads", threads, 0, MOST_THREADS)
    if isinstance(types, str):
        types = [types]
    return _planned(object, person, side, types, count, others, ode, threads, out, report, progress)[0]


def _planned(object: Union[str, "PathLike[str]"], person: Union[str, "PathLike[str]", Mapping[str, Any]], side: str, types: Sequence[str], count: int,
             others: Sequence[Union[str, "PathLike[str]"]], ode: bool, threads: int, out: Union[str, "PathLike[str]", None],
             report: bool, progress: Progress) -> tuple[Plan, list[str]]:
    """The plan, and the files that could not be made."""
    if report:
        _core.require_three()
    with ExitStack() as stack:
        folder = None if out is None else stack.enter_context(_grasp_plan_files.folder_of(out, [object_file(each) for each in (object, *others)]))
        if folder is not None and isinstance(object, Object):  # its own file goes with it
            object = object.write(folder.path / "object.yaml")
        with bar(progress, "grasps") as told:
            plan = planned(object, person=person, side=side, types=types, count=count, ode=ode, threads=threads, others=others, told=told)
        missing = [] if folder is None else _grasp_plan_files.write(plan, folder, report)
    return plan, missing


def _work(options: dict[str, Any]) -> int:
    count = whole_option(options, "--count", 1, _grasp_plan_files.MOST) or 5
    threads = whole_option(options, "--threads", 1, MOST_THREADS) or 0
    out = Path(options.get("--out") or Path("out") / f"{Path(options['OBJECT']).stem}_grasps")
    plan, missing = _planned(options["OBJECT"], options.get("--person", "median_man"), options.get("--side", "right"), options["--type"], count,
                             options["--others"], "--ode" in options, threads, out, "--report" in options, True)
    print(_grasp_plan_files.screen_text(plan) + f"files in {out}")
    for each in missing:
        print(f"missing: {each}", file=sys.stderr)
    return 0 if plan.grasps and all(grasp.outcome_ode in ("", "held") for grasp in plan.grasps) else 1


def main(arguments: Sequence[str]) -> int:
    """The command. :return: exit status"""
    if not arguments or any(each in ("-h", "--help") for each in arguments):
        print(USAGE, end="")
        return 0 if arguments else 2
    return ended(lambda: _work(read_options("grasp plan", arguments, "OBJECT", ("--ode", "--report"), ("--person", "--side", "--count", "--threads", "--out"), (),
                                            lists=("--type", "--others"))))
