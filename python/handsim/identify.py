"""Numbers of a scene from a recorded motion: Gauss-Newton steps on the gradients of a run.

    from handsim.identify import identify
    found = identify(scene, {"objects.0.mass": 0.05}, actions, {"card.shift.z": heights}, deviation=1e-3)
"""
from __future__ import annotations

from typing import Callable, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import input_error, numbers as numbers_of, real, whole
from ._derivatives import exact_step, state_names
from ._gradients import Rollout
from ._overrides import Source
from ._scene import Scene, load, with_value
from ._simulation import Parameters, Simulation

Array = NDArray[np.float64]
PARTS = (0.25, 0.5, 1.0)
"""Of a recording, fitted one after the other."""
FAR = 3.0
"""Deviations from which a difference counts linearly: the force of an impact a step too early says little."""
NO_NUMBERS = ("solver", "duration", "record", "pictures", "criteria")
"""Keys of a scene that say how it is run."""
CHANGE = 1e-3
"""Of whole runs, from which derivatives of forces and of places of joined bodies are differences: share of a number."""


class Identified(NamedTuple):
    """What a recording says of numbers of a scene."""

    names: list[str]
    values: Array
    interval: Array
    """Half of the 95 % interval of each value: that of a linear model with independent errors of the stated deviation;
    infinite where the recording says nothing of a number."""
    residual: float
    """Root mean square of what the recording and the run differ by, over the deviation: near 1 where the model fits."""
    iterations: int


def identify(scene: Union[Scene, Source], numbers: Mapping[str, float], actions: ArrayLike, recorded: Mapping[str, ArrayLike], *,
             deviation: Union[float, Mapping[str, float]], kind: str = "targets",
             begin: Optional[Callable[[Simulation], None]] = None, most: int = 10,
             times: Optional[ArrayLike] = None) -> Identified:
    """Fits numbers of a scene to a recording.

    :param scene: what `load` takes
    :param numbers: by dotted key the value to start from (SI): ``contacts.materials.0.friction``
    :param actions: of each step, shape (steps, numbers), of a `kind` of `Rollout`
    :param recorded: by name its value at each time, shape (times,); NaN: none. Names are those of a state's numbers
        (`Derivatives.names`): coordinates [rad] or [m], shifts of free bodies as positions in the world [m], rates;
        or ``BODY.place.x``, a mass centre in the world [m], and ``SHAPE.force.x``, the sum of its contact forces [N]
    :param deviation: of the recording's errors, in its units, or by name
    :param begin: brings a new simulation to the recording's start; None: the scene's
    :param most: iterations at most; they end where no value changes by more than 1e-6 of its size
    :param times: of the recording after its start [s], within the steps; None: the end of each step
    """
    whole("most", most, 1)
    scene = scene if isinstance(scene, Scene) else load(scene)
    actions = _array("actions", actions, 2)
    if times is not None:
        times = _times(times, scene.step, len(actions))
    count = len(actions) if times is None else len(times)
    data = _recorded(recorded, count)
    spread = np.repeat(_spread(deviation, data), count)
    given = np.concatenate(list(data.values()))
    ends = np.arange(1, count + 1) / count if times is None else times / np.max(times)
    values, iteration = np.array(list(_numbers(numbers).values())), 0
    # Through impacts a whole run is far from linear: the first part of the recording comes first.
    for share in PARTS:
        seen = np.isfinite(given) & np.tile(ends <= share + 1e-9, len(data))
        if not seen.any():
            continue
        part = actions[:max(1, int(np.ceil(share * len(actions) - 1e-9)))]
        model = _Model(scene, list(numbers), part, kind, list(data), begin, times, count)

        def errors(at: Array) -> Array:
            out: Array = ((given - at) / spread)[seen]
            return out

        error = errors(model.run(values))
        for _ in range(most):
            iteration += 1
            scale = np.maximum(np.abs(values), 1e-12)
            slope = (model.slopes(values) / spread[:, None])[seen] * scale
            # A number keeps its sign, and goes no further than half-way to zero; a worse step is halved.
            weight = np.sqrt(np.minimum(1, FAR / np.maximum(np.abs(error), 1e-300)))
            change = np.clip(np.linalg.lstsq(weight[:, None] * slope, weight * error, rcond=1e-9)[0], -0.5, 1.0)
            for _ in range(6):
                next_error = errors(model.run(values + scale * change))
                if _size(next_error) <= _size(error) * (1 + 1e-12):
                    values, error = values + scale * change, next_error
                    break
                change = change / 2
            if np.abs(change).max() < (1e-6 if share == 1 else 1e-2):
                break
    return Identified(list(numbers), values, 1.96 * scale * _deviations(slope), float(np.sqrt(np.mean(error**2))), iteration)


def _size(error: Array) -> float:
    """Huber's."""
    far = np.abs(error)
    return float(np.where(far < FAR, far**2, FAR * (2 * far - FAR)).sum())


def _array(key: str, given: object, axes: int) -> Array:
    """Of finite numbers, or NaN, and of one number at least."""
    out: Array = numbers_of(key, given, f"an array of {axes} axes", axes, finite=False)
    if len(out) == 0 or np.isinf(out).any():
        raise input_error(key, "an infinite number" if len(out) else "none", f"an array of finite numbers of {axes} axes")
    return out


def _times(given: ArrayLike, step: float, steps: int) -> Array:
    out = _array("times", given, 1)
    if not step * (1 - 1e-9) <= out.min() <= out.max() <= step * (steps + 1e-6):
        raise input_error("times", f"{out.min():g} to {out.max():g} s", f"times of the steps, {step:g} to {step * steps:g} s")
    return out


def _recorded(recorded: Mapping[str, ArrayLike], count: int) -> dict[str, Array]:
    if not isinstance(recorded, Mapping) or not recorded:
        raise input_error("recorded", repr(recorded)[:80], "a mapping: name to values")
    out = {}
    for name, values in recorded.items():
        out[str(name)] = column = _array(f"recorded.{name}", values, 1)
        if column.shape != (count,):
            raise input_error(f"recorded.{name}", f"shape {column.shape}", f"shape ({count},)")
        if np.isnan(column).all():
            raise input_error(f"recorded.{name}", "no number", "one at least that is not NaN")
    return out


def _spread(deviation: Union[float, Mapping[str, float]], names: Mapping[str, Array]) -> list[float]:
    of_names = deviation if isinstance(deviation, Mapping) else {name: deviation for name in names}
    missing = [name for name in names if name not in of_names]
    if missing:
        raise input_error("deviation", f"none of {', '.join(missing)}", "one of each name")
    out = [real("deviation", of_names[name]) for name in names]
    if min(out) <= 0:
        raise input_error("deviation", f"{min(out):g}", "numbers above 0")
    return out


def _numbers(numbers: Mapping[str, float]) -> dict[str, float]:
    """With a key that is no number of the model."""
    if not isinstance(numbers, Mapping) or not numbers:
        raise input_error("numbers", repr(numbers)[:80], "a mapping: dotted key to the value to start from")
    for key in numbers:
        if not isinstance(key, str) or key.partition(".")[0] in NO_NUMBERS:
            raise input_error("numbers", repr(key), f"a number of hands, objects, contacts or control: the recording says nothing of {', '.join(NO_NUMBERS)}")
    return {key: real(key, value) for key, value in numbers.items()}


def _deviations(slope: Array) -> Array:
    """Of numbers, of a linear model; infinite along what it does not show."""
    size, axes = np.linalg.eigh(slope.T @ slope)
    hidden = size <= 1e-13 * max(size[-1], 1e-300)
    variance = (axes[:, ~hidden]**2) @ (1 / size[~hidden])
    variance[(np.abs(axes[:, hidden]) > 1e-3).any(axis=1)] = np.inf
    out: Array = np.sqrt(variance)
    return out


class _Model:
    """What a recording would be with given numbers, and its slopes by them."""

    def __init__(self, scene: Union[Scene, Source], keys: list[str], actions: Array, kind: str, names: Sequence[str],
                 begin: Optional[Callable[[Simulation], None]], times: Optional[ArrayLike],
                 count: int) -> None:
        self.count = count
        self.scene, self.keys, self.actions, self.kind, self.begin = scene, keys, actions, kind, begin
        self.names = list(names)
        self.times = None if times is None else np.asarray(times, dtype=float)
        self.made: Optional[tuple[Simulation, Parameters, Rollout, Array]] = None

    def _start(self, values: Array) -> Simulation:
        simulation = Simulation(_with_values(self.scene, self.keys, values))
        if self.begin:
            self.begin(simulation)
        return simulation

    def _at_times(self, simulation: Simulation, of_steps: Array) -> Array:
        """Rows at the ends of steps as columns one after the other, at the recording's times."""
        if self.times is None:
            return np.pad(of_steps, ((0, self.count - len(of_steps)), (0, 0))).T.ravel()
        step = simulation.scene.step
        at = np.clip(self.times / step - 1, 0, len(of_steps) - 1)
        low = np.minimum(at.astype(int), max(len(of_steps) - 2, 0))
        share = (at - low)[:, None]
        rows: Array = (1 - share) * of_steps[low] + share * of_steps[np.minimum(low + 1, len(of_steps) - 1)]
        return rows.T.ravel()

    def _watched(self, simulation: Simulation, names: Sequence[str]) -> Array:
        """Values of names that are no state's, after each step of a new run."""
        out = []
        for action in self.actions:
            exact_step(simulation, {self.kind: action})
            out.append([_value(simulation, name) for name in names])
        return np.array(out).reshape(len(self.actions), len(names))

    def run(self, values: Array) -> Array:
        simulation = self._start(values)
        parameters = Parameters(simulation, dict(zip(self.keys, (float(v) for v in values))))
        known = state_names(simulation, [simulation.scene.bodies[i] for i in parameters.free])
        self.rows = {name: known.index(name) for name in self.names if name in known and ".turn." not in name}
        self.others = [name for name in self.names if name not in self.rows]
        for name in self.others:
            stem, _, axis = name.rpartition(".")
            body, _, word = stem.rpartition(".")
            if axis not in ("x", "y", "z") or word not in ("force", "place") or word == "place" and body not in simulation.scene.bodies:
                raise input_error("recorded", repr(name), "names of numbers of the state, without turns; BODY.place.x or SHAPE.force.x")
        start = simulation.motion()
        watched = self._watched(simulation, self.others) if self.others else np.zeros((len(self.actions), 0))
        simulation.reset(start)
        run = Rollout(simulation, self.actions, self.kind, keep=True)
        self.made = simulation, parameters, run, np.array(values)
        of = {name: run.states[:, row] for name, row in self.rows.items()}
        of.update({name: watched[:, i] for i, name in enumerate(self.others)})
        return self._at_times(simulation, np.array([of[name] for name in self.names]).T)

    def slopes(self, values: Array) -> Array:
        """Shape (recorded, numbers)."""
        if self.made is None or (self.made[3] != values).any():
            self.run(values)
        assert self.made is not None
        simulation, parameters, run, _ = self.made
        by = run.sensitivities(parameters) if self.rows else np.zeros((len(run), 0, len(values)))
        out = []
        for k, value in enumerate(values):
            of = {name: by[:, row, k] for name, row in self.rows.items()}
            if self.others:
                size = CHANGE * max(abs(value), 1e-9)
                ends = [self._watched(self._start(values + sign * size * (np.arange(len(values)) == k)), self.others) for sign in (1, -1)]
                of.update({name: (ends[0] - ends[1])[:, i] / (2 * size) for i, name in enumerate(self.others)})
            out.append(self._at_times(simulation, np.array([of[name] for name in self.names]).T))
        return np.array(out).T


def _value(simulation: Simulation, name: str) -> float:
    stem, _, axis = name.rpartition(".")
    body, _, word = stem.rpartition(".")
    column = "xyz".index(axis)
    if word == "place":
        return float(simulation.bodies.position[simulation.scene.bodies.index(body), column])
    contacts = simulation.contacts
    return float(sum((force[column] * ((a == body) - (b == body)) for a, b, force in zip(contacts.a, contacts.b, contacts.force)), 0.0))


def _with_values(scene: Union[Scene, Source], keys: list[str], values: Array) -> Scene:
    out = scene if isinstance(scene, Scene) else load(scene)
    for key, value in zip(keys, values):
        assert out._origin is not None
        source, changes = out._origin
        out = with_value(out, key, float(value))
        out._origin = source, [*changes, f"{key}={float(value)!r}"]
    return out

