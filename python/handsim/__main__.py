"""The command line: ``python -m handsim run two_hands.yaml --out out``.

Commands of COMMANDS are functions of Python modules, ``main(arguments) -> exit status``; all others are the program's.
"""
from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from pathlib import Path

from . import _core

COMMANDS: dict[str, str] = {
    "accuracy": "handsim._accuracy",
    "compare": "handsim.compare",
    "effects": "handsim._effects",
    "export": "handsim.export",
    "grasp": "handsim._grasps",
    "hand": "handsim._hand_command",
    "identify": "handsim._identify_command",
    "inverse": "handsim._inverse",
    "live": "handsim._live.command",
    "object": "handsim._object_command",
    "optimise": "handsim._optimise_command",
    "report": "handsim._report_command:report",
    "rollouts": "handsim._rollouts_command",
    "track": "handsim._track_command",
    "validate": "handsim._validate_command",
    "view": "handsim._report_command:view",
}
"""Commands in Python, by name: the module of each, and the function where it is not main."""


def page_of_run(folder: str) -> str:
    from ._run_page import page_of_run

    return page_of_run(folder)


def main() -> int:
    # Ctrl-C ends the program at once, as the program without Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    arguments = sys.argv[1:]
    if arguments and arguments[0] in COMMANDS:
        module, _, function = COMMANDS[arguments[0]].partition(":")
        status: int = getattr(import_module(module), function or "main")(arguments[1:])
        return status
    # Commands with uncertain hands go on as `rollouts`, in a new process of this interpreter.
    os.environ.setdefault("HANDSIM_PYTHON", sys.executable)
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [str(Path(__file__).absolute().parents[1]), os.environ.get("PYTHONPATH")]))
    return _core.command_line(arguments, page_of_run)


if __name__ == "__main__":
    sys.exit(main())
