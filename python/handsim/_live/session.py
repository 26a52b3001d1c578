"""A session: the thread that steps a course in real time, takes inputs, goes back in time and publishes views.

Other threads only leave commands (`Session.send`, `Session.call`) and read `Session.view` and `Session.state`, which are
replaced and never changed. So no reader can make the simulation wait.
"""
from __future__ import annotations

import threading
import time
from collections import deque
from concurrent.futures import Future
from os import PathLike
from typing import Any, Callable, NamedTuple, Optional, TypeVar, Union

import numpy as np
from numpy.typing import NDArray

from .._errors import Error, input_error
from .._scene import Scene
from .commands import Command, Facts, event_of
from .course import Course, Event, Files, Keyframe
from .log import CHECK_EVERY, Log

T = TypeVar("T")
KEPT = 60.0
"""Simulated time that one can go back [s]."""
KEYFRAME_EVERY = 0.25
"""[s]"""
FRAME = 1 / 60
"""Between two views [s]."""
SLOWEST = 0.1
"""A session that is later than this [s] gives up catching up: the factor shows it."""
INBOX = 256
"""Commands that wait at most. Continuous ones (springs, sliders) replace those before them."""


class View(NamedTuple):
    """The moment that pages draw."""

    number: int
    tick: int
    time: float
    poses: NDArray[np.float32]
    """x y z, quaternion x y z w of each body, shape (bodies, 7)."""
    contacts: NDArray[np.float32]
    """Place and force, shape (n, 6)."""
    shapes: NDArray[np.uint16]
    """The two of each contact, shape (n, 2)."""
    q: NDArray[np.float32]
    springs: NDArray[np.float32]
    """Body, its point, goal and force of each, shape (n, 10)."""
    targets: NDArray[np.float64]
    """Of the controller's axes [rad]."""
    wrists: NDArray[np.float64]
    """Of driven wrists: x y z, quaternion w x y z, shape (wrists, 7)."""
    touch: frozenset[str]
    """Shapes that touch objects."""
    built: int
    """Counts the scenes that were built: views of another one have other shapes."""


class Session:
    """A scene under the hand. Steps in a thread of its own from `start` to `close`.

    ``on_step`` may have functions ``f(session)``, called after each group of steps in the session's thread, at most every
    60th of a second; what they need to change they do by `send`.
    """

    def __init__(self, scene: Scene, record: Union[str, "PathLike[str]", None] = None) -> None:
        self.files = Files(scene._core.standalone())
        self.course = Course(self.files)
        self.log = Log(self.files, {}, record)
        self.on_step: list[Callable[["Session"], object]] = []
        self.on_view: Callable[[], object] = lambda: None
        """Called in the session's thread when `view` or `state` is new."""
        self.playing, self.speed = False, 1.0
        self.lateness: deque[NDArray[np.float64]] = deque(maxlen=512)
        """When steps were complete after they were due [s]; of groups of steps, newest last."""
        self.latencies: deque[float] = deque(maxlen=5000)
        """From a frame of a tracked hand to the end of the first step that had it [s]."""
        self._born: Optional[float] = None
        self._followed = 0.0
        self._inbox: dict[object, tuple[Command, Optional["Future[Any]"]]] = {}  # in their order
        self._lock, self._news = threading.Lock(), threading.Event()
        self._frames: deque[tuple[Keyframe, int]] = deque()  # with the number of events before it
        self._present: Optional[tuple[Keyframe, int]] = None
        self._closed, self._number, self._built = False, 0, 0
        self._notices: deque[str] = deque(maxlen=8)
        self._building: Optional[threading.Thread] = None
        self._wanted: dict[str, Any] = {}
        self._clock = (0.0, 0)
        self._cost, self._busy, self._since = 20e-6, 0.0, (time.monotonic(), 0, 0.0, 0.0)
        self._factor, self._load = 0.0, 0.0
        self._told, self._told_state, self._checked, self._said = 0.0, 0.0, 0, 0
        self.facts = Facts.of(self.course)
        self.shape_index: dict[str, int] = {}
        """Numbers of the shapes' names in `View.shapes`; set before `start`."""
        self._keep()
        self.view, self.state = self._look(), self._tell()
        self._thread = threading.Thread(target=self._run, name="handsim live", daemon=True)

    # For other threads.

    def start(self) -> None:
        self._thread.start()

    def close(self) -> None:
        if self._closed:
            return
        self._closed = True
        self._ring()
        if self._thread.is_alive():
            self._thread.join()
        if self._building is not None:
            self._building.join()
        self.log.close(self.course.tick, None if self.course.failed else self.course.state_hash())
        self.files.close()

    def send(self, command: Command) -> None:
        """Leaves a checked command. :raises Error: where too many wait"""
        self._put(command, None)

    def call(self, work: Callable[["Session"], T]) -> "Future[T]":
        """Runs a function in the session's thread between two steps."""
        future: "Future[T]" = Future()
        self._put(Command("call", {"work": work}), future)
        return future

    def _put(self, command: Command, future: Optional["Future[Any]"], most: int = INBOX) -> None:
        key = command.slot or object()
        with self._lock:
            self._inbox.pop(key, None)
            if len(self._inbox) >= most:
                raise input_error("command", f"more than {INBOX} that wait", "fewer in a second")
            self._inbox[key] = (command, future)
        self._ring()

    def _ring(self) -> None:
        self._news.set()
        self.course.wake()

    # The session's thread.

    def _run(self) -> None:
        while not self._closed:
            self._news.clear()
            self._take()
            if self.playing and not self.course.failed:
                self._advance()
            else:
                self._rest()

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
        count = max(1, min(1000, int(FRAME / max(period, self._cost))))
        count = min(count, self._until(KEYFRAME_EVERY / step), self._until(CHECK_EVERY), count if self._born is None else 1)
        before = time.thread_time()
        late = course.advance(count, due, period)
        spent = time.thread_time() - before
        used = self._born is not None and len(late) > 0
        if self._born is not None and used:
            self.latencies.append(due + float(late[0]) - self._born)
            self._born, self._followed = None, now
        self._busy += spent
        if len(late):
            self._cost += 0.1 * (spent / len(late) - self._cost)
            self.lateness.append(late)
        if course.failed:
            self.log.add(course.tick, {"failed": course.failed})
            self.notice(course.failed)
        elif self.course.tick % round(KEYFRAME_EVERY / step) == 0:
            self._keep()
        if not course.failed and course.tick % CHECK_EVERY == 0 and self._checked != course.tick:
            self._checked = course.tick
            self.log.add(course.tick, {"hash": course.state_hash()})
        now = time.monotonic()
        if (self._news.is_set() or not len(late)) and now - self._told < 2 * FRAME and not course.failed:
            return  # inputs first
        self._measure(now)
        # A view takes some of a step's time: with a tracker it is made after a frame, so that the next one need not wait.
        if now - self._told >= (0.55 if used or now - self._followed > 3 * FRAME else 1.2) * FRAME or course.failed:
            self._publish(now)
            for each in list(self.on_step):
                each(self)

    def _until(self, every: float) -> int:
        """Steps up to the next multiple."""
        whole = max(1, round(every))
        return whole - self.course.tick % whole

    def _restart_clock(self, now: float) -> None:
        self._clock = (now, self.course.tick)

    def _measure(self, now: float) -> None:
        """Simulated seconds in a second, and the share of a core, of the last half second."""
        begin, tick, simulated, busy = self._since
        if now - begin < 0.5:
            return
        cpu = time.thread_time()
        self._factor = max(0.0, (self.course.time - simulated) / (now - begin))
        self._load = (cpu - busy) / (now - begin)
        self._since = (now, self.course.tick, self.course.time, cpu)

    def _keep(self) -> None:
        """A keyframe of now; those of more than a minute ago are dropped."""
        frames = self._frames
        frames.append((self.course.save(), self.log.count))
        least = self.course.tick - KEPT / self.course.scene.step
        while len(frames) > 1 and (frames[1][0].tick <= least or len(frames) > 2 * KEPT / KEYFRAME_EVERY):
            frames.popleft()
        self.log.forget(frames[0][0].tick)

    def _take(self) -> None:
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
            except Error as error:
                if future is not None:
                    future.set_exception(error)
                self.notice(str(error))
            except Exception as error:  # a callable of the caller
                if future is None:
                    raise
                future.set_exception(error)
        if waiting:
            self._told_state = 0.0

    def notice(self, text: str) -> None:
        """A sentence for the pages."""
        self._said += 1
        self._notices.append(text[:2000])

    def _do(self, command: Command) -> Any:
        name, values = command.name, command.values
        if name == "call":
            return values["work"](self)
        if name == "play":
            self.play(values["on"])
        elif name == "step":
            self.play(False)
            self._go_on()
            self._to(self.course.tick + values["steps"])
            self._after_steps()
        elif name == "speed":
            self.speed = values["value"]
            self._restart_clock(time.monotonic())
        elif name == "seek":
            self.seek(values["tick"] if "tick" in values else self._tick_at(values["time"]))
        elif name == "present":
            if self._present is not None:
                self.seek(self._present[0].tick)
        elif name == "scene":
            self._build(values["changes"])
        elif name == "swap":
            self._swap(**values)
        else:
            self.input(event_of(command, self.course, self.facts))
            self._born = values.get("born", self._born)
        return None

    def play(self, on: bool) -> None:
        if on and self.course.failed:
            self.notice("the motion has diverged: go back in time, or reset")
            return
        if on:
            self._go_on()
        self.playing = on
        self._restart_clock(time.monotonic())

    def input(self, event: Event, prepared: Any = None) -> None:
        """Applies and records an event before the next step."""
        self._go_on()
        self.course.apply(event, prepared)
        self.log.add(self.course.tick, event)
        if "scene" in event or "reset" in event:
            self.facts = Facts.of(self.course)
            self._restart_clock(time.monotonic())
            self._keep()
        if "scene" in event:
            self._built += 1

    def _after_steps(self) -> None:
        if self.course.failed:
            self.log.add(self.course.tick, {"failed": self.course.failed})
            self.notice(self.course.failed)

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
            except Error as error:
                prepared = error
            self._put(Command("swap", {"changes": wanted, "overrides": overrides, "prepared": prepared}), None, 2 * INBOX)

        self._building = threading.Thread(target=work, daemon=True)
        self._building.start()

    def _swap(self, changes: dict[str, Any], overrides: dict[str, Any], prepared: Any) -> None:
        self._building = None
        if isinstance(prepared, Error):
            self.notice(str(prepared))
        elif overrides != self.course.overrides:  # the session has gone back in time
            self._wanted = {**changes, **self._wanted}
        else:
            try:
                self.input({"scene": changes}, prepared)
            except Error as error:
                self.notice(str(error))
        self._build({})

    # Back in time.

    def _tick_at(self, moment: float) -> int:
        """The step that ends nearest a simulated time, of the kept ones."""
        frames = [frame for frame, _ in [*self._frames, *([self._present] if self._present else [])]]
        before = [frame for frame in frames if frame.snapshot.time <= moment + 1e-9] or frames[:1]
        frame = before[-1]
        return frame.tick + max(0, round((moment - frame.snapshot.time) / frame.scene.step))

    def seek(self, tick: int) -> None:
        """To a step of the last minute. What came after it stays until the session goes on from there."""
        self.play(False)
        failed = bool(self.course.failed)
        if self._present is None and not failed:
            self._present = (self.course.save(), self.log.count)
        last = self._present[0].tick if self._present else self.course.tick - 1
        if self._present is not None and tick >= last:
            self.course.load(self._present[0])
            self._present = None
        else:
            tick = min(last, max(tick, self._frames[0][0].tick))
            frame, count = [each for each in self._frames if each[0].tick <= tick][-1]
            self.course.load(frame)
            for at, event in self.log.since(count, tick):
                self._to(at)
                self.course.apply(event)
            self._to(tick)
        if failed:  # what led to it is no longer there
            self.log.cut(self.course.tick)
            self._drop_frames()
        if self.course.scene is not self.facts.scene:
            self.facts = Facts.of(self.course)
            self._built += 1

    def _to(self, tick: int) -> None:
        while self.course.tick < tick and not self.course.failed:
            self.course.advance(tick - self.course.tick)

    def _go_on(self) -> None:
        """The future of a past moment ends here."""
        if self._present is None:
            return
        self._present = None
        self.log.cut(self.course.tick)
        self._drop_frames()

    def _drop_frames(self) -> None:
        while len(self._frames) > 1 and self._frames[-1][1] > self.log.count:
            self._frames.pop()
        while len(self._frames) > 1 and self._frames[-1][0].tick > self.course.tick:
            self._frames.pop()
        self._checked = 0

    # What others see.

    def _look(self) -> View:
        core = self.course.core
        position, quaternion, _, _ = core.bodies()
        poses = np.concatenate((position, quaternion[:, 1:], quaternion[:, :1]), axis=1, dtype=np.float32)
        a, b, places, _, _, forces = core.contacts()
        index = self.shape_index
        shapes = np.array([[index.get(x, 0), index.get(y, 0)] for x, y in zip(a, b)], dtype=np.uint16).reshape(-1, 2)
        springs = np.zeros((0, 10), dtype=np.float32)
        rows = list(self.course.controls["springs"].values())
        if rows:
            force = self.course.spring_forces if len(self.course.spring_forces) == len(rows) else np.zeros((len(rows), 3))
            springs = np.concatenate((np.array(rows)[:, :7], force), axis=1, dtype=np.float32)
        objects = self.facts.objects
        touch = frozenset(of for pair in zip(a, b) for of, on in (pair, pair[::-1]) if on.partition(".")[0] in objects)
        self._number += 1
        return View(self._number, self.course.tick, self.course.time, poses,
                    np.concatenate((places, forces), axis=1, dtype=np.float32), shapes,
                    np.array(core.q, dtype=np.float32), springs, core.targets(), core.wrists(), touch, self._built)

    def _tell(self) -> dict[str, Any]:
        """The slow things, as JSON."""
        course, first = self.course, self._frames[0][0]
        present = self._present[0].snapshot.time if self._present else course.time
        late = np.concatenate(list(self.lateness)[-256:]) if self.lateness else np.zeros(0)
        controls = course.controls
        ramp = controls["targets"]
        return {
            "playing": self.playing, "speed": self.speed, "factor": round(self._factor, 3), "load": round(self._load, 3),
            "lateness_p99_ms": round(1e3 * float(np.percentile(late, 99)), 3) if len(late) else None,
            "tick": course.tick, "time": course.time, "start": first.snapshot.time, "present": present,
            "past": self._present is not None, "failed": course.failed, "engine": course.scene.engine,
            "step": course.scene.step, "overrides": course.overrides, "numbers": controls["numbers"],
            "targets": None if ramp is None else np.round(ramp.ends[1], 6).tolist(),
            "torques": None if controls["torques"] is None else controls["torques"].tolist(),
            "excitations": None if controls["excitations"] is None else controls["excitations"].tolist(),
            "notices": list(self._notices), "said": self._said, "recording_full": self.log.full, "built": self._built,
            "verdicts": [{"name": each.name, "held": each.held, "measured": _finite(each.measured), "least": each.least,
                          "limit": _finite(each.limit), "unit": each.unit, "where": each.where} for each in ([] if course.failed else course.verdicts)]}

    def _publish(self, now: float) -> None:
        self._told = now
        self.log.flush()
        self.view = self._look()
        if now - self._told_state > 0.25:
            self._told_state = now
            self.state = self._tell()
        self.on_view()


def _finite(value: Any) -> Optional[float]:
    return float(value) if value is not None and np.isfinite(value) else None
