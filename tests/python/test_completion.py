"""Completion of shells has the options of the package's commands. Oracle: their own help."""
import os
import re
import subprocess
import sys

import pytest

from handsim.__main__ import COMMANDS

PROGRAM = os.environ.get("HANDSIM_PROGRAM", "")


@pytest.mark.skipif(not PROGRAM, reason="the program is not in the path (HANDSIM_PROGRAM)")
@pytest.mark.parametrize("command", list(COMMANDS))
def test_completion_offers_the_options_of_the_help(command):
    text = subprocess.run([sys.executable, "-m", "handsim", command, "--help"], capture_output=True, text=True, check=True).stdout
    script = subprocess.run([PROGRAM, "completion", "bash"], capture_output=True, text=True, check=True).stdout
    offered = re.search(rf"'{command} '\*\).*words='([^']*)' ;;\n", script)
    own = set(re.findall(r"^ +(?:-\w, )?(--[a-z-]+)", text, re.MULTILINE)) - {"--help"}
    assert own and set(offered[1].split()) - {"--help"} == own
