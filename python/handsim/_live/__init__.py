"""Live simulations: a scene under the hand, in a browser or in Python."""
from __future__ import annotations

import html
from os import PathLike
from typing import TYPE_CHECKING, Any, Callable, Mapping, Optional, Sequence, Union

from .._errors import Error, input_error, whole
from .._overrides import Overrides, Source
from .._scene import Scene, load
from .session import Session
from .views import View

if TYPE_CHECKING:
    from .server import Server
    from .streams import Follower


class Live:
    """A scene that runs in real time, with its page. In a notebook it shows the page; close it when done with it.

        with hs.live("grasp_power_can") as live:
            print(live.url)
            live.on_step(lambda session: print(session.view.time))
            live.do("play", on=True)
            live.wait()
    """

    def __init__(self, session: Session, server: Optional["Server"], follower: Optional["Follower"]) -> None:
        self.session, self._server, self._follower = session, server, follower
        self._raised = False

    @property
    def url(self) -> str:
        """Of the page, with its token: who has it can use the session."""
        return "" if self._server is None else self._server.url

    @property
    def view(self) -> View:
        """The moment that was shown last."""
        return self.session.view

    @property
    def state(self) -> dict[str, Any]:
        """What the page tells: speed, factor, verdicts, values that were changed."""
        return self.session.state

    def do(self, name: str, /, **values: Any) -> None:
        """A command as the page gives it, e.g. ``live.do("pose", name="fist")`` (docs/live.md).

        :raises Error: of kind input for a command that does not fit
        """
        from .commands import read_command

        self.session.send(read_command({"do": name, **values}, self.session.facts))

    def frame(self, message: Mapping[str, Any]) -> None:
        """A frame of tracked hands, as streams have them (docs/live.md). :raises Error: of kind input"""
        from .streams import Follower

        if self._follower is None:
            self._follower = Follower(self.session)
        self._follower.message(message)

    def on_step(self, function: Callable[[Session], object]) -> None:
        """Calls ``function(session)`` at most 60 times a second, between steps, in the session's thread."""
        self.session.on_step.append(function)

    def wait(self) -> None:
        """Until Ctrl-C. :raises: what a function of `on_step` has raised, or whatever else has stopped the session"""
        import contextlib

        with contextlib.suppress(KeyboardInterrupt):
            self.session.trouble.wait()
        self._raise()

    def close(self) -> None:
        """Ends server and simulation. :raises: as `wait`; Error of kind output where the recording has ended before"""
        self._end()
        self._raise()

    def _end(self) -> None:
        if self._follower is not None:
            self._follower.close()
        if self._server is not None:
            self._server.close()
        self.session.close()

    def _raise(self) -> None:
        """Once."""
        problem = None if self._raised else self.failure()
        if problem is not None:
            self._raised = True
            raise problem

    def failure(self) -> Optional[BaseException]:
        """What has stopped the session or its recording."""
        log = self.session.log
        if self.session.problem is None and log.lost and log.path is not None:
            return Error(f"record: {log.path}: got a recording that has ended ({log.lost}), need a whole one", "output")
        return self.session.problem

    def __enter__(self) -> "Live":
        return self

    def __exit__(self, _: object, error: object, __: object) -> None:
        self._end()
        if error is None:
            self._raise()

    def _repr_html_(self) -> str:
        return f'<iframe src="{html.escape(self.url)}" style="width: 100%; height: 720px; border: 1px solid #ccc"></iframe>'

    def __repr__(self) -> str:
        return f"<handsim.Live: {self.session.course.scene.title}; {self.url}>"


def needs_aiohttp() -> Optional[str]:
    """A sentence where the page's server cannot run."""
    import importlib.util

    if importlib.util.find_spec("aiohttp") is None:
        return "got a Python without aiohttp, need it for the page: apt install python3-aiohttp, or pip install 'handsim[live]'"
    return None


def live(scene: Union[Scene, Source], overrides: Overrides = None, *, port: int = 0, address: str = "127.0.0.1",
         play: bool = False, stream: Sequence[str] = (), record: Union[str, "PathLike[str]", None] = None,
         page: bool = True) -> Live:
    """Starts a scene in real time, and its page in the browser, at `Live.url`.

    :param scene: a Scene, or what `load` takes, with its overrides
    :param port: 0: any that is free
    :param address: of this machine; another one than the loopback lets others in who know the token, without encryption
    :param play: begins at once; else paused
    :param stream: where tracked hands come from: ``udp://127.0.0.1:PORT``, ``stdin``, ``ws`` (docs/live.md)
    :param record: a file for the recording; without one it is saved from the page
    :param page: False: no page, no server and no aiohttp
    :raises Error: of kind input for a scene that does not run, a port that is taken, a recording that would replace another
        file, or without aiohttp
    """
    whole("port", port, 0, 65535)
    missing = needs_aiohttp() if page else None
    if missing:
        raise input_error("live", missing.partition(", need ")[0][4:], missing.partition(", need ")[2])
    out = Live(Session(scene if isinstance(scene, Scene) else load(scene, overrides), record), None, None)
    session = out.session
    try:
        if stream:
            from .streams import Follower

            out._follower = Follower(session, stream)
        if page:
            from .server import Server

            frames = out._follower.message if out._follower and any(each.partition("?")[0] == "ws" for each in stream) else None
            out._server = Server(session, port, address, frames)
            out._server.start()
        session.start()
        if out._follower is not None:
            out._follower.start()
    except BaseException:
        out._end()
        raise
    if play:
        out.do("play", on=True)
    return out
