"""The simulation of a live session: inputs that act from one step on, and its exact repetition.

A session and the replay of its recording apply the same events before the same steps of the same `Course`, so they have
the same bits. Nothing here knows a clock but `advance`, which only waits by it.
"""
from __future__ import annotations

import copy
import hashlib
import math
import tempfile
from pathlib import Path
from typing import Any, Mapping, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from .. import _core
from .._errors import Error, input_error, whole
from .._scene import Scene, load
from .._verdict import Verdict, verdicts_of

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

    def rescaled(self, tick: int, ratio: float) -> "Ramp":
        """The rest of it from a step on, in `ratio` times as many steps."""
        left = max(0, self.begin + self.steps - tick)
        return Ramp(np.array([self.at(tick), self.ends[1]]), tick, max(1, math.ceil(left * ratio - 1e-9)))


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


def spring_row(row: Sequence[float], mass: float, step: float) -> list[float]:
    """A row of `advance` of body, point, goal, stiffness and largest force, soft enough for the step.

    A finger's last segment turns about its joint: at its tip a third of its mass counts. Explicit forces are stable for
    stiffness * step^2 and damping * step small against that.
    """
    stiffness = min(row[7], 0.1 * mass / 3 / step**2)
    return [*row[:7], stiffness, min(1.4 * math.sqrt(stiffness * mass / 3), 0.3 * mass / 3 / step), row[8]]


def numbers_of(scene: Scene, core: "_core.Simulation") -> dict[str, Any]:
    """What can be changed while it runs, by name, with its values. Objects have their numbers of the scene's file."""
    names = ["gravity", *(["gains", "torque_limits"] if scene.axes else [])]
    for i, (_, moves) in enumerate(scene._core.all_objects()):
        names += [f"objects.{i}.{key}" for key in (("mass", "friction") if moves else ("friction",))]
    values = {name: core.get(name).tolist() for name in names}
    return {name: of if name == "gravity" else of[0] for name, of in values.items()}


def finite(name: str, given: Any) -> Array:
    """:raises Error: of kind input for what is no array of finite numbers"""
    try:
        out = np.array(given, dtype=float)
    except (TypeError, ValueError, OverflowError):
        out = np.array(np.nan)
    if not np.isfinite(out).all():
        raise input_error(name, "other values", "finite numbers")
    return out


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
        self._take(scene, self._simulation(scene))

    def _take(self, scene: Scene, core: "_core.Simulation", numbers: Optional[dict[str, Any]] = None) -> None:
        self.scene, self.core = scene, core
        self.numbers = numbers_of(scene, core) if numbers is None else numbers
        """What can be changed while it runs, with the scene's own values."""
        bodies, self._takes_wrists, self._takes_excitations = scene._core.takes()
        self._movable = frozenset(bodies)

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
        late = np.zeros(0)
        try:
            late, self.spring_forces = self.core.advance(
                controls["torques"], controls["excitations"], forces, None if targets is None else targets.ends,
                None if wrists is None else wrists.ends, springs, (clocks[0][0], clocks[1][0]),
                (clocks[0][1], clocks[1][1]), steps, start, period)
        except Error as error:
            if error.kind != "physics":
                raise
            self.failed = str(error)
        finally:
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
        controls = dict(self.controls)
        for name, size in (("torques", len(self.core.q)), ("excitations", len(self.scene.muscles))):
            if name in event:
                controls[name] = None if event[name] is None else finite(name, event[name]).reshape(size)
        for name in ("targets", "wrists"):
            if name in event:
                controls[name] = None if event[name] is None else self._ramp(name, event[name])
        if "push" in event:
            push = event["push"]
            controls["push"] = None if push is None else {
                "body": str(push["body"]), "force": finite("push", push["force"]).reshape(3).tolist(),
                "until": self.tick + whole("push", push["steps"], 1)}
        if "springs" in event:
            controls["springs"] = {name: finite("springs", row).reshape(10).tolist() for name, row in event["springs"].items()}
        wrong = self._beyond(controls)
        if wrong:
            name = next(iter(wrong))
            raise input_error(name, wrong[name], "what the scene's engine and effects can move")
        self.controls = controls

    def mass_of(self, body: int) -> float:
        """As it is now [kg]."""
        names = [name for name, _ in self.scene._core.all_objects()]
        name = self.scene.bodies[body]
        own = f"objects.{names.index(name)}.mass" if name in names else ""
        return float(self.controls["numbers"].get(own, self.scene.masses[body]))

    def _soften(self, springs: Mapping[str, list[float]]) -> dict[str, list[float]]:
        """Springs for bodies or a step that have changed."""
        return {name: spring_row([*row[:8], row[9]], self.mass_of(int(row[0])), self.scene.step) for name, row in springs.items()}

    def _beyond(self, controls: Mapping[str, Any]) -> dict[str, str]:
        """Controls that the scene cannot follow, and why."""
        out = {}
        push, bodies = controls["push"], self.scene.bodies
        if push is not None and push["body"] not in self._movable:
            out["push"] = f"{push['body']}, which no force moves"
        held = [row[0] for row in controls["springs"].values()]
        for body in held:
            if body not in range(1, len(bodies)) or bodies[int(body)] not in self._movable:
                out["springs"] = f"{bodies[int(body)] if body in range(len(bodies)) else f'body {body:g}'}, which no force moves"
        if controls["wrists"] is not None and not self._takes_wrists:
            out["wrists"] = "wrists that nothing drives"
        if controls["excitations"] is not None and not self._takes_excitations:
            out["excitations"] = "a scene without the muscles effect"
        return out

    def _ramp(self, name: str, given: Mapping[str, Any]) -> Ramp:
        now = self.controls[name]
        start = now.at(self.tick) if now is not None else self.core.targets() if name == "targets" else self.core.wrists()
        goal = finite(name, given["to"]).reshape(start.shape)
        if name == "wrists":  # the quaternion on the near side
            flip = np.sum(start[:, 3:] * goal[:, 3:], axis=1) < 0
            goal[flip, 3:] *= -1
            start = start.copy()
            start[:, 3:] /= np.linalg.norm(start[:, 3:], axis=1, keepdims=True)
        return Ramp(np.array([start, goal]), self.tick, whole(name, given["steps"], 1))

    def _set_numbers(self, numbers: Mapping[str, Any]) -> None:
        values = {name: np.atleast_1d(finite(name, of)) for name, of in numbers.items()}
        old = {name: self.core.get(name) for name in values}
        snapshot = None if self.failed else self.core.snapshot()

        def use(values: Mapping[str, Array]) -> None:
            for name, of in values.items():
                self.core.set(name, of)
            if snapshot is not None:  # they act from a reset on
                self.core.reset(None, None, None)
                self.core.restore(snapshot)
        try:
            use(values)
        except Error:
            use(old)
            raise
        self.controls["numbers"] = {**self.controls["numbers"], **numbers}
        self.controls["springs"] = self._soften(self.controls["springs"])

    def prepare(self, overrides: Mapping[str, Any]) -> tuple[Scene, "_core.Simulation"]:
        """Compiles the scene with values of keys; may run in another thread."""
        scene = self.files.compile(overrides)
        return scene, self._simulation(scene)

    def _rebuild(self, changes: Mapping[str, Any], prepared: Optional[tuple[Scene, "_core.Simulation"]]) -> None:
        scene, core = prepared or self.prepare({**self.overrides, **changes})
        own = numbers_of(scene, core)
        # A number that the scene itself now says is no longer set apart from it.
        numbers = {name: values for name, values in self.controls["numbers"].items() if name not in changes}
        for name, values in numbers.items():
            core.set(name, np.atleast_1d(np.array(values, dtype=float)))
        if self.failed:
            core.reset(None, None, None)
        else:
            core.carry_over(self.core)
        ratio = self.scene.step / scene.step
        self.overrides, self.failed = {**self.overrides, **changes}, None
        self._take(scene, core, own)
        self.controls["numbers"] = numbers
        self.controls = self._carried(dict(self.controls), ratio)

    def _carried(self, controls: dict[str, Any], ratio: float) -> dict[str, Any]:
        """Controls of the scene before, in a scene that has other steps and may follow fewer of them.

        :param ratio: the step before, by the new one
        """
        push = controls["push"]
        if ratio != 1:
            for name in ("targets", "wrists"):
                if controls[name] is not None:
                    controls[name] = controls[name].rescaled(self.tick, ratio)
            if push is not None:
                controls["push"] = {**push, "until": self.tick + max(1, math.ceil((push["until"] - self.tick) * ratio - 1e-9))}
        controls["springs"] = self._soften(controls["springs"])
        return {**controls, **{name: {} if name == "springs" else None for name in self._beyond(controls)}}

    def save(self) -> Keyframe:
        return Keyframe(self.tick, self.scene, dict(self.overrides), copy.deepcopy(self.controls), self.core.snapshot())

    def load(self, frame: Keyframe) -> None:
        """Goes to a keyframe, with the bits that the course had there."""
        changed = frame.controls["numbers"]
        # Numbers that were set later go back to those of the scene.
        if frame.scene is not self.scene or self.controls["numbers"].keys() - changed.keys():
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
