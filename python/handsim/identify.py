"""Numbers of a scene from a recorded motion: Gauss-Newton steps on the gradients of a run.

    from handsim.identify import identify
    found = identify(scene, {"objects.0.mass": 0.05}, actions, {"card.shift.z": heights}, deviation=1e-3)
"""
from __future__ import annotations

from typing import Callable, Mapping, NamedTuple, Optional

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import input_error, whole
from ._gradients import Parameters, Rollout, state_names
from ._scene import Scene, Source, load, with_value
from ._simulation import Simulation

Array = NDArray[np.float64]


class Identified(NamedTuple):
    """What a recording says of numbers of a scene."""

    names: list[str]
    values: Array
    interval: Array
    """Half of the 95 % interval of each value: that of a linear model with independent errors of the stated deviation."""
    residual: float
    """Root mean square of what the recording and the run differ by, over the deviation: near 1 where the model fits."""
    iterations: int


def identify(scene: Source, numbers: Mapping[str, float], actions: ArrayLike, recorded: Mapping[str, ArrayLike], *,
             deviation: float, kind: str = "targets", begin: Optional[Callable[[Simulation], None]] = None,
             most: int = 10) -> Identified:
    """Fits numbers of a scene to a recording.

    :param scene: what `load` takes
    :param numbers: by dotted key the value to start from (SI): ``contacts.materials.0.friction``
    :param actions: of each step, shape (steps, numbers), of a `kind` of `Rollout`
    :param recorded: by name of a state's number (`Derivatives.names`) its value after each step, shape (steps,); NaN:
        none. Coordinates [rad] or [m], shifts of free bodies as positions in the world [m], rates.
    :param deviation: of the recording's errors, in its units
    :param begin: brings a new simulation to the recording's start; None: the scene's
    :param most: iterations at most; they end where no value changes by more than 1e-6 of its size
    """
    actions = np.asarray(actions, dtype=float)
    data = {name: np.asarray(values, dtype=float) for name, values in recorded.items()}
    for name, values in data.items():
        if values.shape != (len(actions),):
            raise input_error(f"recorded.{name}", f"shape {values.shape}", f"shape ({len(actions)},)")
    keys, values = list(numbers), np.array(list(numbers.values()), dtype=float)
    for iteration in range(1, whole("most", most, 1) + 1):
        compiled = _with_values(scene, keys, values)
        simulation = Simulation(compiled)
        if begin:
            begin(simulation)
        parameters = Parameters(simulation, dict(zip(keys, (float(v) for v in values))))
        run = Rollout(simulation, actions, kind, keep=True)
        rows = _rows(simulation, parameters, list(data))
        error = np.concatenate([of - run.states[:, row] for of, row in zip(data.values(), rows)]) / deviation
        slope = np.concatenate([run.sensitivities(parameters)[:, row] for row in rows]) / deviation
        seen = np.isfinite(error)
        error, slope = error[seen], slope[seen]
        scale = np.maximum(np.abs(values), 1e-12)
        change = np.linalg.lstsq(slope * scale, error, rcond=None)[0]
        # A number keeps its sign, and goes no further than half-way to zero.
        values = values + scale * np.clip(change, -0.5, 1.0)
        if np.abs(change).max() < 1e-6:
            break
    covariance = np.linalg.pinv((slope * scale).T @ (slope * scale))
    return Identified(keys, values, 1.96 * scale * np.sqrt(np.diag(covariance)), float(np.sqrt(np.mean(error**2))),
                      iteration)


def _with_values(scene: Source, keys: list[str], values: Array) -> Scene:
    out = load(scene)
    for key, value in zip(keys, values):
        source, changes = out._origin or (scene, [])
        out = with_value(out, key, float(value))
        out._origin = source, [*changes, f"{key}={float(value)!r}"]
    return out


def _rows(simulation: Simulation, parameters: Parameters, names: list[str]) -> list[int]:
    known = state_names(simulation, [simulation.scene.bodies[i] for i in parameters.free])
    for name in names:
        if name not in known or ".turn." in name:
            raise input_error("recorded", repr(name), "names of numbers of the state, without turns")
    return [known.index(name) for name in names]
