"""``python3 -m handsim live SCENE``: the command line of live sessions."""
from __future__ import annotations

import argparse
import contextlib
import signal
import sys
import threading
from typing import TYPE_CHECKING, NoReturn, Sequence

from .._errors import Error, input_error
from .._scene import load
from .._shipped import find_file

if TYPE_CHECKING:
    from . import Live

EXAMPLE = """Examples:
  python3 -m handsim live grasp_power_can --engine articulated
  python3 -m handsim live config/two_hands_contact.yaml --stream udp://127.0.0.1:5005 --record live.jsonl
  python3 -m handsim live --replay live.jsonl"""


class Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        print(f"live: {message} (python3 -m handsim live --help)", file=sys.stderr)
        sys.exit(2)


def parser() -> argparse.ArgumentParser:
    out = Parser(prog="handsim live", description="Simulate a scene in real time and take hold of it in the browser",
                 epilog=EXAMPLE, formatter_class=argparse.RawDescriptionHelpFormatter)
    out.add_argument("scene", nargs="?", metavar="SCENE", help="scene file, or the name of a shipped one")
    out.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="override a key of the scene; may be repeated")
    out.add_argument("--engine", choices=["ode", "dae", "articulated", "auto"], help="replaces the scene's engine")
    out.add_argument("--port", type=int, default=0, help="of the page (default: any that is free)")
    out.add_argument("--address", default="127.0.0.1",
                     help="of this machine that the page has (default 127.0.0.1). Another one lets others in who know the page's "
                          "token, without encryption")
    out.add_argument("--play", action="store_true", help="begin at once")
    out.add_argument("--no-browser", action="store_true", help="print the page's address only")
    out.add_argument("--record", metavar="FILE", help="write each input with its step to a file that --replay repeats")
    out.add_argument("--stream", action="append", default=[], metavar="WHERE",
                     help="tracked hands: udp://127.0.0.1:PORT, stdin, or ws (docs/live.md); may be repeated")
    out.add_argument("--replay", metavar="FILE", help="repeat a recording and compare the hashes of its states; no page")
    out.add_argument("--measure", action="store_true", help="measure time and latency of the scene; no browser")
    out.add_argument("--seconds", type=float, default=10, help="of --measure, 1 to 3600 (default 10)")
    return out


def main(arguments: Sequence[str]) -> int:
    """:returns: exit status: 0; 1 where a replay differs, the motion has diverged, or the session or its recording has ended
    by itself; 2 for wrong input"""
    options = parser().parse_args(arguments)
    try:
        if options.replay is not None:
            for name in ("scene", "record", "stream", "set", "engine", "play", "measure"):
                if getattr(options, name):
                    raise input_error("live", f"{name if name == 'scene' else '--' + name} beside --replay", "one of the two")
            return replay(options.replay)
        if options.scene is None:
            raise input_error("live", "no scene", "a scene, or --replay FILE")
        return run(options)
    except (Error, OSError) as error:
        print(f"error: {error}" if isinstance(error, OSError) else str(error), file=sys.stderr)
        return 1 if isinstance(error, Error) and error.kind != "input" else 2


def overrides_of(words: Sequence[str]) -> dict[str, str]:
    out = {}
    for text in words:
        key, equals, value = text.partition("=")
        if not equals or not key:
            raise input_error("--set", text, "KEY=VALUE")
        out[key] = value
    return out


def replay(path: str) -> int:
    from .replay import Replay, printable

    found = Replay(path)
    found.run()
    course = found.course
    print(f"{printable(path)}: {course.tick} steps to {course.time:.6g} s, {found.checks} hashes of the state are equal; the last: {course.state_hash()}"
          + ("" if found.end else "; the recording has no end"))
    return 0


def run(options: argparse.Namespace) -> int:
    from . import live, needs_aiohttp

    missing = needs_aiohttp()
    if missing:
        print(f"live: {missing}", file=sys.stderr)
        return 2
    if not 1 <= options.seconds <= 3600:
        raise input_error("--seconds", f"{options.seconds:g}", "1 to 3600")
    one_thread()
    scene = load(find_file(options.scene), overrides_of(options.set), engine=options.engine)
    if options.measure:
        from .measure import measure

        return measure(scene, options.seconds)
    sys.setswitchinterval(0.001)  # the session's thread waits less for the server's
    # Before the session: one that fails at once must still end as the words below say, whenever Ctrl-C comes.
    done = _end_of_session()
    page = live(scene, port=options.port, address=options.address, play=options.play, stream=options.stream, record=options.record)
    try:
        if options.address not in ("127.0.0.1", "::1", "localhost"):
            print(f"warning: {options.address} is open to other machines: who knows the address below can use the session, and what "
                  "they send is not encrypted", file=sys.stderr)
        print(f"{scene.title}: {page.url}\nCtrl-C ends it.", flush=True)
        if not options.no_browser:
            import webbrowser

            webbrowser.open(page.url)
        while not done.wait(3600):
            pass
    finally:
        page._end()
    return report(page)


def report(page: "Live") -> int:
    """What the command says at its end. :returns: exit status"""
    from .replay import printable

    problem, path, failed = page.failure(), page.session.log.path, page.session.course.failed
    if path and page.session.log.lost is None:
        print(f"recorded: {printable(path)}")
    if problem is not None:
        print(problem if isinstance(problem, Error) else f"error: {type(problem).__name__}: {problem}", file=sys.stderr)
    elif failed:
        print(f"error: {failed}", file=sys.stderr)
    return 0 if problem is None and not failed else 1


def one_thread() -> None:
    """Keeps OpenBLAS from waking threads for the small matrices of tracked hands; in this process alone."""
    import ctypes
    from pathlib import Path

    maps = Path("/proc/self/maps")
    for path in {line.split()[-1] for line in maps.read_text().splitlines() if "openblas" in line} if maps.exists() else ():
        for name in ("openblas_set_num_threads", "openblas_set_num_threads64_", "scipy_openblas_set_num_threads64_"):
            with contextlib.suppress(OSError, AttributeError):
                getattr(ctypes.CDLL(path), name)(1)


def _end_of_session() -> threading.Event:
    """:returns: what Ctrl-C and SIGTERM set from now on"""
    done = threading.Event()
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, lambda *_: done.set())
    return done
