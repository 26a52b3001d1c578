"""Many environments of one scene, stepped on all cores."""
from __future__ import annotations

from typing import Any, Mapping, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._core import Frame, Motion
from ._derivatives import Array
from ._errors import Error, flag, input_error, numbers, one_of, real, seed_of, whole
from ._gradients import Product, Rollout, each
from ._overrides import Source
from ._pictures import Camera, Picture
from ._scene import Scene, load
from ._simulation import Forces, Simulation
from ._smoothing import Smoothing

MOST = 1_000_000
Mask = Optional[NDArray[np.bool_]]
Randomise = Optional[Mapping[str, Sequence[Any]]]


def _drawn(randomise: Randomise) -> list[tuple[str, str, float, float]]:
    out: list[tuple[str, str, float, float]] = []
    if randomise is None:
        return out
    if not isinstance(randomise, Mapping):
        raise input_error("randomise", type(randomise).__name__, "a mapping: name to distribution")
    for name, spec in randomise.items():
        if not isinstance(spec, (tuple, list)) or len(spec) != 3 or not isinstance(spec[0], str):
            raise input_error(f"randomise.{name}", repr(spec), '("uniform", low, high), ("log_uniform", low, high) or '
                              '("normal", mean, deviation)')
        out.append((str(name), spec[0], real(f"randomise.{name}", spec[1]), real(f"randomise.{name}", spec[2])))
    return out


class Batch:
    """n environments of one scene. Every environment has the same bits in a batch of any size, with any number of
    threads, and alone.

    The arrays are views without copies of the batch's own memory: they show the state after every step and reset, do
    not move, cannot be written, and keep the batch alive while they exist. Copy them to keep their values.
    """

    def __init__(self, scene: Union[Scene, Source], n: int, *, observe: Sequence[str] = ("q", "u"),
                 randomise: Randomise = None, seed: int = 0, threads: int = 0, watch: bool = False) -> None:
        """
        :param scene: a Scene, or what `load` takes
        :param n: number of environments, 1 to 1,000,000
        :param observe: parts of `observation`, in its order: time, q, u, tau, wrists, fingertips, objects,
            finger_contacts, taxels, contact_pairs, excitation, activation, fibre_length, fibre_speed, tendon_length,
            tendon_force, failed (docs/environment.md has their numbers); failed needs ``watch``
        :param randomise: what a reset draws, by name: ``{"objects.0.mass": ("uniform", 0.1, 0.5)}``; also
            ``("log_uniform", low, high)`` and ``("normal", mean, deviation)``. Names: gravity, objects.I.mass,
            objects.I.friction, objects.I.position, gains, torque_limits, q.
        :param seed: 0 or more, below 2^64; environment i draws in its k-th reset a function of seed, i and k alone
        :param threads: at most 1024; 0: one for each core
        :param watch: measures the scene's criteria, for the observation ``failed``
        :raises Error: of kind input where the scene does not run, or a name or bound is wrong
        """
        self.scene = scene if isinstance(scene, Scene) else load(scene)
        observe = [observe] if isinstance(observe, str) else list(observe)
        for name in observe:
            if not isinstance(name, str):
                raise input_error("observe", repr(name), "names of parts")
        names = [*observe, *(name for name in ("q", "u") if name not in observe)]
        self._core = _core.batch(self.scene._core, whole("n", n, 1, MOST), names, _drawn(randomise), seed_of(seed),
                                 whole("threads", threads, 0), flag("watch", watch))
        self._threads = threads
        self._all: Array = self._core.observations()
        self._parts = {name: (first, columns) for name, first, columns in self._core.parts()}
        width = sum(len(self._parts[name][1]) for name in observe)
        self.observation: Array = self._all[:, :width]
        """What ``observe`` names, shape (n, numbers)."""
        self.columns: list[str] = [column for name in observe for column in self._parts[name][1]]
        """Names of the columns of `observation`, with units."""
        self.q: Array = self["q"]
        """Coordinates [rad] or [m], shape (n, coordinates), in the order of `Scene.coordinates`."""
        self.u: Array = self["u"]
        """Rates [rad/s] or [m/s], shape (n, coordinates)."""
        self._others: dict[int, Scene] = {}
        self.failed: NDArray[np.bool_] = self._core.failed()
        """Environments whose motion diverged, shape (n,): they rest until their reset; `failure` says why."""
        if randomise:
            self.reset()

    def __len__(self) -> int:
        return int(self._all.shape[0])

    def __getitem__(self, part: str) -> Array:
        """The columns of one observed part, e.g. ``batch["fingertips"]``, shape (n, numbers)."""
        if not isinstance(part, str) or part not in self._parts:
            raise input_error("part", part, f"one of {', '.join(self._parts)}; others have to stand in observe")
        first, columns = self._parts[part]
        return self._all[:, first:first + len(columns)]

    def columns_of(self, part: str) -> list[str]:
        """Names of the columns of one observed part."""
        self[part]
        return list(self._parts[part][1])

    def step(self, torques: Optional[ArrayLike] = None, *, targets: Optional[ArrayLike] = None,
             excitations: Optional[ArrayLike] = None, wrists: Optional[ArrayLike] = None, forces: Forces = None,
             substeps: int = 1) -> None:
        """Steps all environments that have not failed, on all cores; the action holds for all substeps.

        Arrays as in `Simulation.step` with a row for each environment: torques (n, coordinates), targets (n, axes),
        excitations (n, muscles), wrists (n, wrists, 7), forces by body name (n, 3) or (n, 6). float64 in C order is not copied. Ctrl-C ends the
        call; the environments are then at different times until their reset.

        :raises Error: of kind input for another shape or dtype, or numbers that are not finite. A motion that diverges
            does not raise: see `failed`.
        """
        self._core.step(torques, targets, excitations, wrists, forces, whole("substeps", substeps, 1))

    def reset(self, mask: Mask = None, *, seed: Optional[int] = None, seeds: Optional[ArrayLike] = None,
              to: Optional[Motion] = None) -> None:
        """To the start, with numbers drawn by ``randomise``.

        :param mask: environments to reset, shape (n,), dtype bool; None: all
        :param seed: begins the draws of all environments anew, as a new batch with this seed
        :param seeds: a seed for each environment, shape (n,), in place of the batch's own
        :param to: a motion of this Scene (`Simulation.motion`, `motion`) in place of its start
        """
        if seed is not None:
            self._core.seed(seed_of(seed))
        self._core.reset(mask, seeds, to)

    def replace(self, environment: int, scene: Scene) -> None:
        """The environment becomes one of another scene, e.g. of another person, at that scene's start. A Scene that is
        given again is prepared once.

        :raises Error: of kind input where bodies, joints, driven axes, muscles, wrists, observed numbers, engine or step
            differ from the batch's
        """
        self._core.replace(self._index(environment), one_of("scene", scene, Scene)._core)
        self._others[environment] = scene

    def scene_of(self, environment: int) -> Scene:
        """That of `replace`, else the batch's."""
        return self._others.get(self._index(environment), self.scene)

    def set(self, name: str, values: ArrayLike) -> None:
        """Sets a number (names as for ``randomise``) from the next reset on, shape (n, numbers) or (n,)."""
        try:
            array = np.asarray(values)
        except (TypeError, ValueError):
            raise input_error(name, "no array", "numbers, shape (n, numbers) or (n,)") from None
        before = self.get(name)
        try:
            self._core.set(name, array[:, np.newaxis] if array.ndim == 1 else array)
        except Error:
            self._core.set(name, before)  # some environments may have taken theirs
            raise

    def get(self, name: str) -> Array:
        """A number of all environments, shape (n, numbers): as last set or drawn."""
        return self._core.get(name)

    def _index(self, environment: int) -> int:
        return whole("environment", environment, 0, len(self) - 1)

    def failure(self, environment: int) -> Optional[str]:
        """Why an environment failed; None if it did not."""
        return self._core.failure(self._index(environment))

    def motion(self, environment: int) -> Motion:
        """The motion of one environment now, for `reset`."""
        return self._core.motion(self._index(environment))

    def _rollouts(self, actions: ArrayLike, kind: str, every: Optional[int], work: Any,
                  smoothing: Any) -> list[Any]:
        all_actions: Array = numbers("actions", actions, f"shape ({len(self)}, steps, numbers)", 3)
        if len(all_actions) != len(self):
            raise input_error("actions", f"shape {all_actions.shape}", f"shape ({len(self)}, steps, numbers)")

        def one(i: int) -> Any:
            simulation = Simulation(self.scene_of(i))
            simulation.reset(self.motion(i))
            return work(i, Rollout(simulation, all_actions[i], kind, every=every, smoothing=smoothing))
        return each(one, len(self), self._threads)

    def vjp(self, actions: ArrayLike, end: ArrayLike, kind: str = "torques", *,
            every: Optional[int] = None, smoothing: Union[Smoothing, float, None] = None) -> list[Product]:
        """Gradients of a scalar function of each environment's run of many steps, on all cores; the batch stays where it
        is. Each environment keeps what its `Rollout` says.

        :param actions: shape (n, steps, numbers)
        :param end: gradient of the function by the state at the end (`Derivatives.names`), shape (n, s)
        :param kind: torques, targets or excitations
        :param every: steps from one kept motion to the next; None: the root of their number
        :param smoothing: as in `Rollout`
        """
        rows: Array = numbers("end", end, f"shape ({len(self)}, s)", 2)
        if len(rows) != len(self):
            raise input_error("end", f"shape {rows.shape}", f"shape ({len(self)}, s)")
        return self._rollouts(actions, kind, every, lambda i, run: run.vjp(rows[i]), smoothing)

    def jvp(self, actions: ArrayLike, start: Optional[ArrayLike] = None, changes: Optional[ArrayLike] = None,
            kind: str = "torques", *, smoothing: Union[Smoothing, float, None] = None) -> Array:
        """Changes of the states after each step, shape (n, steps, s), with changes of the starts, shape (n, s), and of the
        actions, as these; smoothing as in `Rollout`."""
        def rows(key: str, of: Optional[ArrayLike], shape: str, axes: int) -> Any:
            out = [None] * len(self) if of is None else numbers(key, of, f"shape ({len(self)}, {shape})", axes)
            if len(out) != len(self):
                raise input_error(key, f"shape {out.shape}", f"shape ({len(self)}, {shape})")
            return out
        starts, changed = rows("start", start, "s", 2), rows("changes", changes, "steps, numbers", 3)
        return np.array(self._rollouts(actions, kind, None, lambda i, run: run.jvp(starts[i], changed[i]), smoothing))

    def frame(self, environment: int) -> Frame:
        """The state of one environment for `Scene.draw_frames`."""
        return self._core.frame(self._index(environment))

    def draw(self, environment: int = 0, *, size: Optional[tuple[int, int]] = None, view: Optional[str] = None,
             camera: Optional[Camera] = None) -> Picture:
        """A picture of one environment now; options as in `Scene.draw`."""
        return self.scene_of(environment).draw_frames([self.frame(environment)], size=size, view=view, camera=camera)[0]

    def __repr__(self) -> str:
        return f"<handsim.Batch: {len(self)} x {self.scene.title}>"
