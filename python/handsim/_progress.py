"""A bar of progress: in a notebook by itself, on stderr where it is asked for."""
from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from typing import Any, Callable, Iterator, Optional, Union

from ._errors import input_error

Told = Optional[Callable[[float], object]]
Progress = Union[None, bool, Callable[[float], object]]
"""None: a bar in a notebook, nothing elsewhere; True: a bar here too, on stderr; False: none; or a function, which is
called with the share done, 0..1."""

QUIET = 0.5
"""Calls that end within this time [s] show no bar."""
WIDTH = 40
LINE = 10.0  # s between the lines of a piped bar


def in_notebook() -> bool:
    """True under a kernel of Jupyter. IPython is not imported for it: where it runs, it is imported already."""
    ipython = sys.modules.get("IPython")
    shell = getattr(ipython, "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


def print_line(text: str) -> None:
    """For people, on stderr."""
    print(text, file=sys.stderr, flush=True)


def _span(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 100 else f"{seconds / 60:.0f} min" if seconds < 6000 else f"{seconds / 3600:.3g} h"


class Bar:
    """A bar with the share done and the time that remains at the pace so far; a line every ten seconds where stderr is piped."""

    def __init__(self, label: str, notebook: bool) -> None:
        self.label = label
        self.notebook = notebook
        self.begin = time.monotonic()
        self.shown: Any = None
        self.length = 0
        self.told = 0.0
        self.first = 0.0, 0.0
        """The share from which the pace counts, and when: of work that goes on, what was done before."""

    def __call__(self, share: float) -> None:
        spent = time.monotonic() - self.begin
        if spent < QUIET:
            return
        gained, gone = share - self.first[0], spent - self.first[1]
        left = f", {_span(gone * (1 - share) / gained)} left" if gained > 0 and share > 0.01 else ""
        text = f"{self.label}: {share:.0%}{left}"
        if self.notebook:
            self._display(f'<progress max="1" value="{share:.3f}" style="width: 24em"></progress> {text}')
        elif not sys.stderr.isatty():
            if spent - self.told >= LINE:
                self.told = spent
                sys.stderr.write(f"progress: {text}\n")
                sys.stderr.flush()
        else:
            done = round(WIDTH * min(max(share, 0.0), 1.0))
            self._write(f"[{'#' * done}{'.' * (WIDTH - done)}] {text}")

    def line(self, text: str) -> None:
        """A line above the bar."""
        if self.length:
            self._write("")
            sys.stderr.write("\r")
        print_line(text)

    def close(self) -> None:
        """Takes the bar away."""
        if self.shown is not None:
            self._display("")
        if self.length:
            self._write("")
            sys.stderr.write("\r")
            sys.stderr.flush()

    def _display(self, content: str) -> None:
        from IPython.display import HTML, display

        if self.shown is None:
            self.shown = display(HTML(content), display_id=True)
        else:
            self.shown.update(HTML(content))

    def _write(self, line: str) -> None:
        sys.stderr.write("\r" + line.ljust(self.length))
        sys.stderr.flush()
        self.length = len(line)


@contextmanager
def bar(progress: Progress, label: str) -> Iterator[Told]:
    """What the core calls with the share done; the bar goes away at the end.

    :raises Error: of kind input for what is neither None, True, False nor a function
    """
    if callable(progress):
        yield progress
        return
    if progress is not None and not isinstance(progress, bool):
        raise input_error("progress", repr(progress), "True, False or a function of the share done")
    notebook = in_notebook()
    if progress is False or (progress is None and not notebook):
        yield None
        return
    shown = Bar(label, notebook)
    try:
        yield shown
    finally:
        shown.close()
