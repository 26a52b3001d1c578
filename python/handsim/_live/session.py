"""A session: the thread that steps a course in real time, takes inputs, goes back in time and publishes views.

Other threads only leave commands (`Session.send`, `Session.call`) and read `Session.view` and `Session.state`, which are
replaced and never changed. So no reader can make the simulation wait. Whatever goes wrong in the thread, `state` says so,
the session pauses, and the thread goes on to answer.
"""
from __future__ import annotations

import atexit
import sys
import threading
import time
from collections import deque
from concurrent.futures import Future
from os import PathLike
from typing import Any, Callable, Optional, TypeVar, Union

import numpy as np
from numpy.typing import NDArray

from .._errors import Error, input_error
from .._scene import Scene
from .commands import Command, Facts, event_of
from .course import Course, Event, Files
from .history import History
from .log import Log
from .views import View, look, tell

T = TypeVar("T")
FRAME = 1 / 60
"""Between two views [s]."""
SLOWEST = 0.1
"""A session that is later than this [s] gives up catching up: the factor shows it."""
INBOX = 256
"""Commands that wait at most. Continuous ones (springs, sliders) replace those before them."""


class Session:
    """A scene under the hand. Steps in a thread of its own from `start` to `close`.

    ``on_step`` may have functions ``f(session)``, called after each group of steps in the session's thread, at most every
    60th of a second; what they need to change they do by `send`.
    """

    def __init__(self, scene: Scene, record: Union[str, "PathLike[str]", None] = None) -> None:
        self.files = Files(scene._core.standalone())
        self.course = Course(self.files)
        self.log = Log(self.files, {}, record)
        self.history = History(self.course, self.log)
        self.on_step: list[Callable[["Session"], object]] = []
        self.on_view: Callable[[], object] = lambda: None
        """Called in the session's thread when `view` or `state` is new."""
        self.playing, self.speed = False, 1.0
        self.lateness: deque[NDArray[np.float64]] = deque(maxlen=512)
        """When steps were complete after they were due [s]; of groups of steps, newest last."""
        self.latencies: deque[float] = deque(maxlen=5000)
        """From a frame of a tracked hand to the end of the first step that had it [s]."""
        self.factor, self.load = 0.0, 0.0
        """Simulated seconds in a second, and the share of a core, of the last half second."""
        self.built, self.said = 0, 0
        """Counts of scenes that were built anew, and of notices."""
        self.tracked: dict[str, Any] = {}
        """By hand what was measured of it in a stream; replaced, not changed."""
        self.broken: Optional[str] = None
        """Why the session has paused by itself."""
        self.problem: Optional[BaseException] = None
        """The first exception that was nobody's wrong input."""
        self.trouble = threading.Event()
        """Set with `problem`."""
        self._born: Optional[float] = None
        self._followed = 0.0
        self._inbox: dict[object, tuple[Command, Optional["Future[Any]"]]] = {}  # in their order
        self._lock, self._news = threading.Lock(), threading.Event()
        self._closed, self._number, self._lost = False, 0, False
        self._notices: deque[str] = deque(maxlen=8)
        self._building: Optional[threading.Thread] = None
        self._ready: Optional[tuple[dict[str, Any], dict[str, Any], Any]] = None
        self._wanted: dict[str, Any] = {}
        self._clock = (0.0, 0)
        self._cost, self._since = 20e-6, (time.monotonic(), 0.0, 0.0)
        self._told, self._told_state = 0.0, 0.0
        self.facts = Facts.of(self.course)
        self.shape_index: dict[str, int] = {}
        """Numbers of the shapes' names in `View.shapes`; set before `start`."""
        self.view, self.state = self._look(), self._tell()
        self._thread = threading.Thread(target=self._run, name="handsim live", daemon=True)

    # For other threads.

    def start(self) -> None:
        """:raises Error: of kind input where the recording cannot begin"""
        self.log.begin()
        atexit.register(self.close)  # Python's end stops no thread that steps
        self._thread.start()

    def close(self) -> None:
        if self._closed:
            return
        with self._lock:
            self._closed = True
        atexit.unregister(self.close)
        self._ring()
        if self._thread.is_alive():
            self._thread.join()
        building = self._building
        if building is not None:
            building.join()
        for _, future in self._inbox.values():
            if future is not None:
                future.cancel()
        try:
            self.history.close()
        finally:
            self.files.close()

    def send(self, command: Command) -> None:
        """Leaves a checked command. :raises Error: where too many wait, or the session has ended"""
        self._put(command, None)

    def call(self, work: Callable[["Session"], T]) -> "Future[T]":
        """Runs a function in the session's thread between two steps."""
        future: "Future[T]" = Future()
        self._put(Command("call", {"work": work}), future)
        return future

    def notice(self, text: str) -> None:
        """A sentence for the pages."""
        with self._lock:
            self.said += 1
            self._notices.append(text[:2000])

    def report(self, error: Exception) -> None:
        """Something that no input of a user caused: pages and the terminal say it, and the command ends with status 1."""
        reason = str(error) if isinstance(error, Error) else f"{type(error).__name__}: {error}"
        if reason != self.broken:
            self.broken = reason
            self.notice(reason)
            print(f"live: {reason}", file=sys.stderr, flush=True)
        if self.problem is None:
            self.problem = error
            self.trouble.set()

    @property
    def notices(self) -> list[str]:
        with self._lock:
            return list(self._notices)

    def _put(self, command: Command, future: Optional["Future[Any]"]) -> None:
        key = command.slot or object()
        with self._lock:
            if self._closed:
                raise input_error("command", "a session that has ended", "one that runs")
            self._inbox.pop(key, None)
            if len(self._inbox) >= INBOX:
                raise input_error("command", f"more than {INBOX} that wait", "fewer in a second")
            self._inbox[key] = (command, future)
        self._ring()

    def _ring(self) -> None:
        self._news.set()
        self.course.wake()

    # The session's thread.

    def _run(self) -> None:
        while not self._closed:
            try:
                self._turn()
            except Exception as error:  # of whatever kind: the session pauses, and says why
                self._fail(error)

    def _turn(self) -> None:
        self._news.clear()
        self._take()
        if self.playing and not self.course.failed:
            self._advance()
        else:
            self._rest()

    def _fail(self, error: Exception) -> None:
        self.playing = False
        self.report(error)
        self._told_state = 0.0
        self._news.wait(FRAME)  # what fails again and again leaves the machine its time

    def _rest(self) -> None:
        self._publish(time.monotonic())
        self._news.wait(0.5)
        self._measure(time.monotonic())

    def _advance(self) -> None:
        course, step = self.course, self.course.scene.step
        period = step / self.speed
        now = time.monotonic()
        due = self._clock[0] + (course.tick - self._clock[1]) * period
        if now - due > SLOWEST:
            self._restart_clock(now)
            due = now
        # As many steps as a view takes, or those that its time is enough for.
        count = max(1, min(1000, int(FRAME / max(period, self._cost)))) if self._born is None else 1
        before = time.thread_time()
        late = self._step(count, due, period)
        spent = time.thread_time() - before
        used = self._born is not None and len(late) > 0
        if self._born is not None and used:
            self.latencies.append(due + float(late[0]) - self._born)
            self._born, self._followed = None, now
        if len(late):
            self._cost += 0.1 * (spent / len(late) - self._cost)
            self.lateness.append(late)
        now = time.monotonic()
        if (self._news.is_set() or not len(late)) and now - self._told < 2 * FRAME and not course.failed:
            return  # inputs first
        self._measure(now)
        # A view takes some of a step's time: with a tracker it is made after a frame, so that the next one need not wait.
        if now - self._told >= (0.55 if used or now - self._followed > 3 * FRAME else 1.2) * FRAME or course.failed:
            self._publish(now)
            for each in list(self.on_step):
                each(self)

    def _step(self, most: int, start: float = 0.0, period: float = 0.0) -> NDArray[np.float64]:
        failed = self.course.failed
        late = self.history.advance(most, start, period)
        if self.course.failed and not failed:
            self.notice(self.course.failed)
        return late

    def _steps(self, count: int) -> None:
        """So many steps, without a clock."""
        end = self.course.tick + count
        while self.course.tick < end and not self.course.failed and not self._closed:
            self._step(end - self.course.tick)

    def _restart_clock(self, now: float) -> None:
        self._clock = (now, self.course.tick)

    def _measure(self, now: float) -> None:
        begin, simulated, busy = self._since
        if now - begin < 0.5:
            return
        cpu = time.thread_time()
        self.factor = max(0.0, (self.course.time - simulated) / (now - begin))
        self.load = (cpu - busy) / (now - begin)
        self._since = (now, self.course.time, cpu)

    def _take(self) -> None:
        ready, self._ready = self._ready, None
        if ready is not None:
            self._swap(*ready)
        with self._lock:
            waiting = list(self._inbox.values())
            self._inbox.clear()
        for command, future in waiting:
            if future is not None and not future.set_running_or_notify_cancel():
                continue
            try:
                result = self._do(command)
                if future is not None:
                    future.set_result(result)
            except Exception as error:
                if future is not None:  # whoever called has it
                    future.set_exception(error)
                elif isinstance(error, Error):
                    self.notice(str(error))
                else:
                    self._fail(error)
        if waiting or ready:
            self._told_state = 0.0

    def _do(self, command: Command) -> Any:
        name, values = command.name, command.values
        if name == "call":
            return values["work"](self)
        if name == "play":
            self.play(values["on"])
        elif name == "step":
            self.play(False)
            self._steps(values["steps"])
        elif name == "speed":
            self.speed = values["value"]
            self._restart_clock(time.monotonic())
        elif name == "seek":
            self.seek(values["tick"] if "tick" in values else self.history.tick_at(values["time"]))
        elif name == "present":
            if self.history.present is not None:
                self.seek(self.history.present.tick)
        elif name == "scene":
            self._build(values["changes"])
        else:
            self.input(event_of(command, self.course, self.facts))
            self._born = values.get("born", self._born)
        return None

    def play(self, on: bool) -> None:
        if on and self.course.failed:
            self.notice("the motion has diverged: go back in time, or reset")
            return
        if on:
            self.broken = None
        self.playing = on
        self._restart_clock(time.monotonic())

    def input(self, event: Event, prepared: Any = None) -> None:
        """Applies and records an event before the next step."""
        self.history.input(event, prepared)
        if "scene" in event or "reset" in event:
            self.broken = None
            self._refresh()
            self._restart_clock(time.monotonic())

    def _refresh(self) -> None:
        """The scene may be another one."""
        if self.course.scene is not self.facts.scene:
            self.facts = Facts.of(self.course)
            self.built += 1

    def _build(self, changes: dict[str, Any]) -> None:
        """Compiles the scene anew beside the running one, and swaps them then."""
        self._wanted.update(changes)
        if self._building is not None or not self._wanted:
            return
        wanted, self._wanted, overrides = self._wanted, {}, dict(self.course.overrides)

        def work() -> None:
            prepared: Any = None
            try:
                prepared = self.course.prepare({**overrides, **wanted})
            except Exception as error:
                prepared = error
            self._ready = (wanted, overrides, prepared)
            self._ring()

        self._building = threading.Thread(target=work, name="handsim live builder", daemon=True)
        self._building.start()

    def _swap(self, changes: dict[str, Any], overrides: dict[str, Any], prepared: Any) -> None:
        self._building = None
        if isinstance(prepared, Error):
            self.notice(str(prepared))
        elif isinstance(prepared, Exception):
            self._fail(prepared)
        elif overrides != self.course.overrides:  # the session has gone back in time
            self._wanted = {**changes, **self._wanted}
        else:
            try:
                self.input({"scene": changes}, prepared)
            except Error as error:
                self.notice(str(error))
        self._build({})

    def seek(self, tick: int) -> None:
        """To a step of the last minute. What came after it stays until the session goes on from there."""
        self.play(False)
        self.history.seek(tick)
        self.broken = None
        self._refresh()

    def _publish(self, now: float) -> None:
        self._told = now
        self.log.flush()
        if bool(self.log.lost) != self._lost:
            self._lost = bool(self.log.lost)
            if self._lost:
                self.notice(f"the recording has ended: {self.log.lost}")
        self._number += 1
        self.view = self._look()
        if now - self._told_state > 0.25:
            self._told_state = now
            self.state = self._tell()
        self.on_view()

    def _look(self) -> View:
        return look(self.course, self._number, self.built, self.shape_index, self.facts.objects)

    def _tell(self) -> dict[str, Any]:
        own = {"playing": self.playing, "speed": self.speed, "factor": round(self.factor, 3), "load": round(self.load, 3),
               "notices": self.notices, "said": self.said, "recording_full": self.log.lost, "built": self.built, "tracked": self.tracked}
        return tell(self.course, self.history, list(self.lateness)[-256:], self.broken, own)
