"""``handsim report RUN`` and ``handsim view SCENE``: pages for a browser."""
from __future__ import annotations

import os
import shlex
import stat
import subprocess
import tempfile
from pathlib import Path
from typing import Callable, Sequence

from . import _core
from ._errors import Error, input_error
from ._files import ended, read_options, usage, write_file
from ._overrides import command_overrides
from ._run_page import RunTitle, run_page, write_page
from ._shipped import find_file

USAGE = {"report": """handsim report FOLDER [OTHER] [--out PAGE]

One HTML page of a finished run or study, or of two runs in comparison: the second as a ghost (docs/report.md).

  --out PAGE         default: report.html in the first folder

Example: handsim report out/two_hands
""", "view": """handsim view SCENE

Simulates a scene in a temporary folder and shows its report in the browser. SCENE is a file or a shipped name.

  --set KEY=VALUE    a change of the scene; may be repeated
  --engine ENGINE    ode, dae, articulated or auto
  --no-browser       only prints where the page is

Example: handsim view config/two_hands.yaml
"""}


def _report(arguments: Sequence[str]) -> int:
    options = read_options("report", arguments, "folders", (), ("--out",), (), most=2)
    out = options.get("--out")
    print(write_page([Path(each) for each in options["folders"]], None if out is None else Path(out)))
    return 0


def _pages_folder() -> Path:
    """The user's own folder for pages that are only looked at. Other users cannot write into it."""
    out = Path(tempfile.gettempdir()) / f"handsim-{os.getuid()}"
    try:
        out.mkdir(0o700, exist_ok=True)
        found = out.lstat()
        own = stat.S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o022
    except OSError:
        own = False
    if not own:
        raise input_error(str(out), "no folder that only you can write", "to remove it, or another folder for temporary files (TMPDIR)")
    return out


def _shown(page: Path) -> bool:
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    try:
        return subprocess.run(["xdg-open", str(page.absolute())], stdout=subprocess.DEVNULL, check=False).returncode == 0
    except OSError:
        return False


def _view(arguments: Sequence[str]) -> int:
    options = read_options("view", arguments, "SCENE", ("--no-browser",), ("--set", "--engine"), ())
    _core.require_three()
    scene, overrides = find_file(options["SCENE"]), command_overrides(options)
    command = " ".join(["handsim run", shlex.quote(str(scene)), *(f"--set {shlex.quote(each)}" for each in overrides), "--out again"])
    pages = _pages_folder()
    page = pages / f"{scene.stem}.html"
    written = False

    def write(folder: str) -> str:
        nonlocal written
        try:
            write_file(page, run_page([Path(folder)], RunTitle(str(scene), command)).encode())
        except Error as error:
            return str(error)
        written = True
        return ""

    with tempfile.TemporaryDirectory(prefix="run-", dir=pages) as folder:
        status = _core.run_for_page(scene, overrides, folder, write)
    # The browser may read the page after this program has ended.
    if written and ("--no-browser" in options or not _shown(page)):
        print(f"open it in a browser: {page}")
    return status


def _command(name: str, work: Callable[[Sequence[str]], int]) -> Callable[[Sequence[str]], int]:
    def command(arguments: Sequence[str]) -> int:
        """:return: exit status"""
        if (status := usage(USAGE[name], arguments)) is not None:
            return status
        return ended(lambda: work(arguments))
    return command


report = _command("report", _report)
view = _command("view", _view)
