"""Bones of a streamed hand and where its points lie, measured from the stream's beginning as `handsim track` measures them.

Until then frames are scaled to the hand of the scene. What is found is a `Found`; the work is done in a thread of its own.
"""
from __future__ import annotations

import threading
from pathlib import Path
from typing import Any, NamedTuple, Optional

import numpy as np
from numpy.typing import NDArray

from .. import _core, _guess
from .._errors import Error
from .._scene import Scene
from .._shipped import data_path

Array = NDArray[np.float64]
MOMENTS = (3.0, 10.0, 30.0, 90.0)
"""A hand is measured when it was seen for so long [s], while the frames before have left something unmeasured; twice at least."""
APART = 0.05
"""Between frames that are kept, at first [s]."""
MOST = 400
"""Frames that are kept; of more every second one."""
LONGEST = 0.25
"""Between two frames, that counts as seen [s]."""
LEAST = 14
"""Points of a frame that is kept."""
KEYPOINTS = ["wrist", *(joint for finger in ("thumb", "index", "middle", "ring", "little") for joint in _guess.JOINTS[finger][1:])]
"""The 21 points in the order of cameras."""


class Layout(NamedTuple):
    """How a stream gives its points."""

    name: Optional[str]
    """Of the convention; None: of none."""
    by: str
    """Why it is taken."""
    file: Optional[Path]
    size: int
    """Points of a frame."""
    picked: list[int]
    """Those that are the keypoints, in the order of cameras."""
    names: list[str]
    """Of these."""

    @staticmethod
    def of(file: Optional[Path], by: str) -> "Layout":
        """:param file: of the convention; None: keypoints"""
        if file is None:
            return Layout(None, by, None, 21, list(range(21)), KEYPOINTS)
        points = _guess.points_of(file)
        rows = {joint: (i, name) for i, (name, joint) in enumerate(points.items()) if joint}
        places = [rows.get(joint, (-1, joint)) for joint in KEYPOINTS]
        return Layout(file.stem, by, file, len(points), [i for i, _ in places], [name for _, name in places])


def shipped(name: str, by: str) -> Layout:
    return Layout.of(data_path() / f"handmodels/points/{name}.yaml", by)


def guessed(points: Array) -> Layout:
    """By number and order of the points. :param points: of a few frames, shape (frames, points, 3)"""
    found = _guess.guess(_guess.Sample([str(i) for i in range(points.shape[1])], True, points))
    return Layout.of(data_path() / f"handmodels/points/{found.name}.yaml" if found.name else None, found.by)


class Found(NamedTuple):
    """What was measured of a hand."""

    fit: Optional[_core.HandFit]
    """None where the points make no hand of this side."""
    state: dict[str, Any]
    """For pages."""
    warnings: list[str]


def find(scene: Scene, hand: int, layout: Layout, times: list[float], points: Array) -> Found:
    """:param points: shape (frames, 21, 3) [m]"""
    name = scene.hands[hand]
    state: dict[str, Any] = {"points": layout.name, "by": layout.by}
    try:
        fit, length, breadth, noise, tracked, swapped, assumed, warnings = _core.measured_fit(
            scene._core, hand, times, points.reshape(len(times), 63), layout.names, layout.file)
    except Error as error:
        return Found(None, {**state, "trouble": str(error)}, [f"{name} hand: {error}"])
    if 2 * swapped >= len(times):
        side, other = ("left", "right") if name.startswith("left") else ("right", "left")
        text = f"what is streamed as the {side} hand has the shape of a {other} one: a {other} hand under the wrong name, or left-handed axes"
        return Found(None, {**state, "trouble": text}, [text])
    if 2 * tracked < len(times):
        text = f"{name} hand: {tracked} of {len(times)} frames are near a hand: its size is not measured"
        return Found(None, {**state, "trouble": text}, [text])
    state.update(hand_length_mm=round(1e3 * length, 1), hand_breadth_mm=round(1e3 * breadth, 1), noise_mm=round(1e3 * noise, 2), seconds=round(times[-1] - times[0], 1), assumed=assumed)
    return Found(fit, state, warnings)


class Measured:
    """Frames of a hand's beginning, and what they tell."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._points: list[Array] = []
        self._seen, self._last, self._apart = 0.0, 0.0, APART
        self._done, self._all = 0, False
        self._work: Optional[threading.Thread] = None
        self.found: Optional[Found] = None
        """New since it was taken."""

    def add(self, points: Array, moment: float) -> bool:
        """:returns: True when it is time to measure"""
        if self._done == len(MOMENTS) or self._all or np.isfinite(points).all(axis=1).sum() < LEAST or self._times and moment < self._times[-1] + self._apart:
            return False
        if len(self._times) == MOST:
            self._times, self._points, self._apart = self._times[::2], self._points[::2], 2 * self._apart
        if self._times and moment - self._last < LONGEST:
            self._seen += moment - self._last
        self._last = moment
        self._times.append(moment)
        self._points.append(points.copy())
        return self._seen >= MOMENTS[self._done] and self._work is None

    def start(self, scene: Scene, hand: int, layout: Layout) -> None:
        """Measures, in a thread."""
        times, points = list(self._times), np.array(self._points)
        self._done += 1

        def work() -> None:
            self.found = found = find(scene, hand, layout, times, points)
            self._all = self._done > 1 and found.fit is not None and not found.state["assumed"]
            self._work = None

        self._work = threading.Thread(target=work, name="handsim live measures a hand", daemon=True)
        self._work.start()

    def close(self) -> None:
        work = self._work
        if work is not None:
            work.join()
