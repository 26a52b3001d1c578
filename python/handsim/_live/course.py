"""The simulation of a live session: inputs that act from one step on, and its exact repetition.

A session and the replay of its recording apply the same events before the same steps of the same `Course`, so they have
the same bits. Nothing here knows a clock but `advance`, which only waits by it.
"""
from __future__ import annotations

import copy
import hashlib
import tempfile
from pathlib import Path
from typing import Any, Mapping, NamedTuple, Optional

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._errors import Error, input_error
from .._result import Verdict, verdicts_of
from .._scene import Scene, load

Array = NDArray[np.float64]
Event = dict[str, Any]
NO_SPRINGS = np.zeros((0, 10))


class Ramp(NamedTuple):
    """Targets, or poses of wrists, that go evenly from one value to another within steps."""

    ends: Array
    """First and last value, shape (2, ...)."""
    begin: int
    """Step before which it begins."""
    steps: int

    def at(self, tick: int) -> Array:
        share = min(1.0, max(0.0, (tick - self.begin) / self.steps))
        out: Array = self.ends[0] + share * (self.ends[1] - self.ends[0])
        return out


class Keyframe(NamedTuple):
    """All that a course needs to go on from a step."""

    tick: int
    scene: Scene
    overrides: dict[str, Any]
    controls: dict[str, Any]
    snapshot: "_core.Snapshot"


class Files:
    """A scene's files in a folder of their own, from which it is compiled again with other values."""

    def __init__(self, files: Mapping[str, bytes]) -> None:
        self.content = dict(files)
        self._folder = tempfile.TemporaryDirectory(prefix="handsim_live_")
        for name, content in files.items():
            path = (Path(self._folder.name) / name).resolve()
            if not path.is_relative_to(Path(self._folder.name).resolve()):
                raise input_error("scene", repr(name), "files below the recording's own folder")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)

    def close(self) -> None:
        self._folder.cleanup()

    def compile(self, overrides: Mapping[str, Any]) -> Scene:
        engine = overrides.get("solver.engine")
        others = {key: value for key, value in overrides.items() if key != "solver.engine"}
        return load(Path(self._folder.name) / "resolved.yaml", others, engine=engine)


def no_controls() -> dict[str, Any]:
    return {"springs": {}, "targets": None, "wrists": None, "torques": None, "excitations": None, "push": None,
            "numbers": {}}


class Course:
    """A scene that is stepped under inputs. One thread uses it; `wake` may be called by any."""

    def __init__(self, files: Files, overrides: Optional[Mapping[str, Any]] = None) -> None:
        self.files = files
        self.overrides: dict[str, Any] = dict(overrides or {})
        self.tick = 0
        """Steps since the start, of whichever step size."""
        self.controls = no_controls()
        self.failed: Optional[str] = None
        """Why the motion ended, until the next reset."""
        self.spring_forces: Array = np.zeros((0, 3))
        """Of the last step [N]."""
        self._use(files.compile(self.overrides))

    def _use(self, scene: Scene) -> None:
        self.scene = scene
        self.core = self._simulation(scene)

    @staticmethod
    def _simulation(scene: Scene) -> "_core.Simulation":
        return _core.simulation(scene._core, True, scene._core.has_contact)

    def advance(self, steps: int, start: float = 0.0, period: float = 0.0) -> Array:
        """Steps under the inputs; fewer where an input ends or `wake` is called.

        :param start: when the first step begins, by `time.monotonic`
        :param period: seconds between steps; 0: none waits
        :returns: of each step that was made, when it was complete after its beginning was due [s]
        """
        controls = self.controls
        push = controls["push"]
        forces = None
        if push is not None:
            steps = max(1, min(steps, push["until"] - self.tick))
            forces = {push["body"]: np.array(push["force"])}
        targets, wrists = controls["targets"], controls["wrists"]
        clocks = [(0, 1) if ramp is None else (min(self.tick - ramp.begin, ramp.steps), ramp.steps) for ramp in (targets, wrists)]
        springs = np.array(list(controls["springs"].values())) if controls["springs"] else NO_SPRINGS
        before = self.core.steps
        try:
            late, self.spring_forces = self.core.advance(
                controls["torques"], controls["excitations"], forces, None if targets is None else targets.ends,
                None if wrists is None else wrists.ends, springs, (clocks[0][0], clocks[1][0]),
                (clocks[0][1], clocks[1][1]), steps, start, period)
        except Error as error:
            if error.kind != "physics":
                raise
            self.failed = str(error)
            late = np.zeros(0)
        self.tick += max(len(late), self.core.steps - before)
        if push is not None and self.tick >= push["until"]:
            controls["push"] = None
        return late

    def apply(self, event: Event, prepared: Optional[tuple[Scene, "_core.Simulation"]] = None) -> None:
        """An input before the next step. :raises Error: of kind input where it does not fit; nothing has changed then"""
        if "scene" in event:
            self._rebuild(event["scene"], prepared)
        if "reset" in event:
            self.core.reset(None, None, None)
            self.failed = None
            self.controls = {**no_controls(), "numbers": self.controls["numbers"]}
        if "numbers" in event:
            self._set_numbers(event["numbers"])
        for name in ("torques", "excitations"):
            if name in event:
                self.controls[name] = None if event[name] is None else np.array(event[name], dtype=float)
        for name in ("targets", "wrists"):
            if name in event:
                self.controls[name] = None if event[name] is None else self._ramp(name, event[name])
        if "push" in event:
            push = event["push"]
            self.controls["push"] = None if push is None else {
                "body": str(push["body"]), "force": [float(each) for each in push["force"]],
                "until": self.tick + int(push["steps"])}
        if "springs" in event:
            rows = {name: np.array(row, dtype=float) for name, row in event["springs"].items()}
            if any(row.shape != (10,) or not np.isfinite(row).all() for row in rows.values()):
                raise input_error("springs", "other rows", "ten finite numbers each")
            self.controls["springs"] = {name: row.tolist() for name, row in rows.items()}

    def _ramp(self, name: str, given: Mapping[str, Any]) -> Ramp:
        now = self.controls[name]
        start = now.at(self.tick) if now is not None else self.core.targets() if name == "targets" else self.core.wrists()
        goal = np.array(given["to"], dtype=float).reshape(start.shape)
        if name == "wrists":  # the quaternion on the near side
            flip = np.sum(start[:, 3:] * goal[:, 3:], axis=1) < 0
            goal[flip, 3:] *= -1
            start = start.copy()
            start[:, 3:] /= np.linalg.norm(start[:, 3:], axis=1, keepdims=True)
        return Ramp(np.array([start, goal]), self.tick, int(given["steps"]))

    def _set_numbers(self, numbers: Mapping[str, Any]) -> None:
        old = {name: self.core.get(name) for name in numbers}
        snapshot = None if self.failed else self.core.snapshot()
        try:
            for name, values in numbers.items():
                self.core.set(name, np.atleast_1d(np.array(values, dtype=float)))
        except Error:
            for name, was in old.items():
                self.core.set(name, was)
            raise
        finally:
            if snapshot is not None:
                self.core.reset(None, None, None)
                self.core.restore(snapshot)
        self.controls["numbers"].update(numbers)

    def prepare(self, changes: Mapping[str, Any]) -> tuple[Scene, "_core.Simulation"]:
        """Compiles the scene with other values; may run in another thread."""
        scene = self.files.compile({**self.overrides, **changes})
        return scene, self._simulation(scene)

    def _rebuild(self, changes: Mapping[str, Any], prepared: Optional[tuple[Scene, "_core.Simulation"]]) -> None:
        scene, core = prepared or self.prepare(changes)
        # A number that the scene itself now says is no longer set apart from it.
        numbers = {name: values for name, values in self.controls["numbers"].items() if name not in changes}
        for name, values in numbers.items():
            core.set(name, np.atleast_1d(np.array(values, dtype=float)))
        if self.failed:
            core.reset(None, None, None)
        else:
            core.carry_over(self.core)
        self.overrides.update(changes)
        self.scene, self.core, self.failed = scene, core, None
        self.controls["numbers"] = numbers

    def save(self) -> Keyframe:
        return Keyframe(self.tick, self.scene, dict(self.overrides), copy.deepcopy(self.controls), self.core.snapshot())

    def load(self, frame: Keyframe) -> None:
        """Goes to a keyframe, with the bits that the course had there."""
        if frame.scene is not self.scene:
            self._use(frame.scene)
        changed = {name: values for name, values in frame.controls["numbers"].items()}
        # Numbers that were set later go back to those of the scene.
        later = self.controls["numbers"].keys() - changed.keys()
        if later:
            self._use(frame.scene)
        for name, values in changed.items():
            self.core.set(name, np.atleast_1d(np.array(values, dtype=float)))
        self.core.reset(None, None, None)
        self.core.restore(frame.snapshot)
        self.tick, self.overrides = frame.tick, dict(frame.overrides)
        self.controls, self.failed = copy.deepcopy(frame.controls), None

    def wake(self) -> None:
        """Ends `advance` at the next step. Any thread may call it."""
        self.core.wake()

    @property
    def time(self) -> float:
        return self.core.time

    @property
    def verdicts(self) -> list[Verdict]:
        return verdicts_of(self.core.verdicts())

    def state_hash(self) -> str:
        """Of the bits of the state now."""
        digest = hashlib.blake2b(digest_size=16)
        digest.update(np.array([self.core.time]).tobytes())
        for each in (*self.core.bodies(), self.core.q, self.core.u, self.core.tau):
            digest.update(np.ascontiguousarray(each).tobytes())
        return digest.hexdigest()
