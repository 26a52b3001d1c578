"""The command line: ``python -m handsim run two_hands.yaml --out out``."""
from __future__ import annotations

import signal
import sys

from . import _core


def main() -> int:
    # Ctrl-C ends the program at once, as the program without Python.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _core.command_line(sys.argv[1:])


if __name__ == "__main__":
    sys.exit(main())
