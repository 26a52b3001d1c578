"""The past of a course: keyframes of its last minute, and the log of the inputs between them.

A past moment is the nearest keyframe before it, and from there the logged inputs again: the bits that were there. What came
after it stays, in memory and in the log, until the motion goes on from the past moment.
"""
from __future__ import annotations

from collections import deque
from typing import Any, Optional

from .course import Array, Course, Event, Keyframe
from .log import CHECK_EVERY, Log

KEPT = 60.0
"""Simulated time that one can go back [s]."""
KEYFRAME_EVERY = 0.25
"""[s]"""


class History:
    """Steps a course and keeps what is needed to go back. Of the session's thread."""

    def __init__(self, course: Course, log: Log) -> None:
        self.course, self.log = course, log
        self.frames: deque[tuple[Keyframe, int]] = deque()
        """Each with the number of lines of the log before it."""
        self.present: Optional[Keyframe] = None
        """Where the motion has got to, while a past moment is shown."""
        self._here = 0
        """Lines of the log that led to the past moment."""
        self._keep()

    def advance(self, most: int, start: float = 0.0, period: float = 0.0) -> Array:
        """As `Course.advance`, up to the next keyframe or hash at most, which it then makes."""
        self._go_on()
        course, before, failed = self.course, self.course.tick, self.course.failed
        frame = max(1, round(KEYFRAME_EVERY / course.scene.step))
        late = course.advance(min(most, *(every - before % every for every in (frame, CHECK_EVERY))), start, period)
        if course.failed:
            if not failed:
                self.log.add(course.tick, {"failed": course.failed})
        elif course.tick > before:
            if course.tick % frame == 0:
                self._keep()
            if course.tick % CHECK_EVERY == 0:
                self.log.add(course.tick, {"hash": course.state_hash()})
        return late

    def input(self, event: Event, prepared: Any = None) -> None:
        """Applies and records an event before the next step. :raises Error: of kind input; nothing has changed then"""
        self._go_on()
        self.course.apply(event, prepared)
        self.log.add(self.course.tick, event)
        if "scene" in event or "reset" in event:
            self._keep()

    def seek(self, tick: int) -> None:
        """To a step of the last minute; of a motion that has failed, the way there is taken away."""
        course, failed = self.course, bool(self.course.failed)
        if self.present is None and not failed:
            self.present = course.save()
        first = self.frames[0][0].tick
        last = self.present.tick if self.present else max(first, course.tick - 1)
        if self.present is not None and tick >= last:
            course.load(self.present)
            self.present = None
            return
        tick = min(last, max(tick, first))
        frame, count = [each for each in self.frames if each[0].tick <= tick][-1]
        course.load(frame)
        for at, event in self.log.since(count, tick):
            self._to(at)
            course.apply(event)
        self._to(tick)
        self._here = self.log.reach(count, tick)
        if failed:
            self._cut()

    def tick_at(self, moment: float) -> int:
        """The step that ends nearest a simulated time, of the kept ones."""
        frames = [frame for frame, _ in self.frames] + ([self.present] if self.present else [])
        frame = next((frame for frame in reversed(frames) if frame.snapshot.time <= moment + 1e-9), frames[0])
        return frame.tick + max(0, round((moment - frame.snapshot.time) / frame.scene.step))

    def recording(self) -> bytes:
        """Of what led to the moment that is shown."""
        self.log.flush()
        return self.log.text(self.log.count if self.present is None else self._here, self.course.tick, self._hash())

    def close(self) -> None:
        """Ends the log at the present."""
        if self.present is not None:
            self.course.load(self.present)
            self.present = None
        self.log.close(self.course.tick, self._hash())

    def _hash(self) -> Optional[str]:
        return None if self.course.failed else self.course.state_hash()

    def _to(self, tick: int) -> None:
        while self.course.tick < tick and not self.course.failed:
            self.course.advance(tick - self.course.tick)

    def _keep(self) -> None:
        """A keyframe of now; those of more than a minute ago are dropped."""
        frames, course = self.frames, self.course
        if frames and frames[-1][0].tick == course.tick:  # with other inputs at the same step
            frames.pop()
        frames.append((course.save(), self.log.count))
        least = course.tick - KEPT / course.scene.step
        while len(frames) > 1 and (frames[1][0].tick <= least or len(frames) > 2 * KEPT / KEYFRAME_EVERY):
            frames.popleft()
        self.log.forget(frames[0][1])

    def _go_on(self) -> None:
        """The future of a past moment ends here."""
        if self.present is not None:
            self.present = None
            self._cut()

    def _cut(self) -> None:
        self.log.cut(self._here)
        while len(self.frames) > 1 and (self.frames[-1][1] > self._here or self.frames[-1][0].tick > self.course.tick):
            self.frames.pop()
