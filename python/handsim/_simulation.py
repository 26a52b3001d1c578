"""One simulation, step by step."""
from __future__ import annotations

from typing import Any, Callable, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike

from . import _core
from ._core import Frame, Motion, Snapshot
from ._derivatives import Array, Derivatives, _end, _free, exact_step
from ._errors import flag, input_error, one_of, real, whole
from ._overrides import Overrides, Source
from ._pictures import Camera, Picture
from ._scene import Scene, load, with_value
from ._smoothing import Smoothing, smoothing_of, step_with_derivatives
from ._verdict import Verdict, verdicts_of

Forces = Optional[Mapping[str, ArrayLike]]


def snapshot_of(text: bytes) -> Snapshot:
    """Of its pickle."""
    return _core.snapshot(text)


class Bodies(NamedTuple):
    """Poses and velocities of all bodies in the world; row i is body i of `Scene.bodies`."""

    position: Array
    """Centres of mass [m], shape (bodies, 3)."""
    quaternion: Array
    """w x y z, from body axes to world axes, shape (bodies, 4)."""
    velocity: Array
    """Of the centres of mass [m/s], shape (bodies, 3)."""
    angular_velocity: Array
    """World axes [rad/s], shape (bodies, 3)."""


class Contacts(NamedTuple):
    """Contact points of the last step, in world axes; n points."""

    a: list[str]
    """Name of the one shape of each point."""
    b: list[str]
    """Name of the other shape."""
    position: Array
    """[m], shape (n, 3)."""
    normal: Array
    """From b to a, unit, shape (n, 3)."""
    depth: Array
    """Penetration [m], shape (n,); negative: the gap of a contact that is about to close."""
    force: Array
    """On a's body, mean over the step, normal part and friction [N], shape (n, 3)."""


class Taxels(NamedTuple):
    """Points of touch on the pads of the last segments of fingers; n points, pad after pad."""

    pads: list[str]
    """Names of the fingertips, such as ``right.index_tip``."""
    counts: list[int]
    """How many points each pad has."""
    points: Array
    """In the frames of their bodies [m], shape (n, 3)."""
    areas: Array
    """The part of the pad's surface that each point stands for [m2], shape (n,)."""
    forces: Array
    """Normal forces [N], shape (n,); over the areas: pressures."""


class Muscles(NamedTuple):
    """The muscles now, in the order of `Scene.muscles`; each of shape (muscles,)."""

    excitation: Array
    """In the last step, 0 to 1."""
    activation: Array
    """0 to 1."""
    fibre_length: Array
    """[m]"""
    fibre_speed: Array
    """Lengthening, at the end of the last step [m/s]."""
    tendon_length: Array
    """[m]"""
    tendon_force: Array
    """At the end of the last step [N]."""


class Simulation:
    """A scene that is stepped. One thread at a time uses it; simulations in several threads run side by side, because
    stepping releases the GIL.

    ``q``, ``u`` and ``tau`` are views that show the state after every step; copy them to keep their values.
    """

    def __init__(self, scene: Union[Scene, Source], overrides: Overrides = None, *, watch: bool = False,
                 contact_forces: Optional[bool] = None) -> None:
        """
        :param scene: a Scene, or what `load` takes, with its overrides
        :param watch: measures the figures of the scene's criteria for `verdicts`; costs some time in each step
        :param contact_forces: `contacts` has forces; None: in scenes with contact
        :raises Error: of kind input where the scene does not run
        """
        self.scene = scene if isinstance(scene, Scene) else load(scene, overrides)
        forces = self.scene._core.has_contact if contact_forces is None else contact_forces
        self._core = _core.simulation(self.scene._core, flag("watch", watch), flag("contact_forces", forces))
        self.q: Array = self._core.q
        """Coordinates [rad] or [m], shape (coordinates,), in the order of `Scene.coordinates`; read-only view."""
        self.u: Array = self._core.u
        """Rates [rad/s] or [m/s], shape (coordinates,); read-only view."""
        self.tau: Array = self._core.tau
        """Torques of drives and tissue in the last step [N m] or [N], shape (coordinates,); read-only view."""

    def step(self, torques: Optional[ArrayLike] = None, *, targets: Optional[ArrayLike] = None,
             excitations: Optional[ArrayLike] = None, wrists: Optional[ArrayLike] = None, forces: Forces = None,
             substeps: int = 1) -> None:
        """Steps the solver; the action holds for all substeps. Ctrl-C ends it between two of them.

        :param torques: [N m] or [N], shape (coordinates,), positive along the coordinate; added to the scene's own
        :param targets: angles [rad] that the scene's controller holds in place of its poses, shape (axes,)
        :param excitations: of the muscles, 0 to 1, shape (muscles,), in place of those of the scene
        :param wrists: pose of the hand frame of each driven wrist at the end of the call: position [m] and quaternion
            w x y z, shape (wrists, 7); it moves there at constant velocity
        :param forces: by name of a body: force at its centre of mass [N], shape (3,), or with the moment [N m], shape
            (6,); world axes
        :param substeps: steps of the solver
        :raises Error: of kind input for another shape or dtype or numbers that are not finite: nothing has moved then;
            of kind physics where the motion diverges
        """
        self._core.step(torques, targets, excitations, wrists, forces, whole("substeps", substeps, 1))

    def derivatives(self, torques: Optional[ArrayLike] = None, *, targets: Optional[ArrayLike] = None,
                    excitations: Optional[ArrayLike] = None, wrists: Optional[ArrayLike] = None, forces: Forces = None,
                    bodies: Sequence[str] = (), advance: bool = False,
                    smoothing: Union[Smoothing, float, None] = None) -> Derivatives:
        """The Jacobians of the next step with this action, of the articulated engine with semi_implicit_euler. The
        step's contacts are solved to rounding, where `step` allows 1e-4 m/s^2.

        :param bodies: names of bodies whose forces are among the derivatives
        :param advance: makes the step; else the simulation stays
        :param smoothing: derivatives of the mean over disturbances of the state, or their deviation [m]; None: exact ones
        :raises Error: of kind input where there are no derivatives: another engine or method, closed loops, free hands,
            elastic tendons, a short-range stiffness of muscles, controllers with explicit torques or feed_forward, and a
            step whose contacts Newton's method does not solve
        """
        action = {"torques": torques, "targets": targets, "excitations": excitations, "wrists": wrists, "forces": forces}
        smooth, asked = smoothing_of(smoothing), [bodies] if isinstance(bodies, str) else bodies
        flag("advance", advance)
        if not isinstance(asked, (list, tuple)) or not all(isinstance(each, str) for each in asked):
            raise input_error("bodies", repr(bodies)[:80], "names of bodies")
        before = self.motion()
        made = False
        try:
            found = step_with_derivatives(self, action, list(asked), smooth)
            made = advance
            return found
        finally:
            if not made:
                self.reset(before)

    def parameters(self, numbers: Mapping[str, Optional[float]]) -> "Parameters":
        """Derivatives by numbers of the scene: ``{"objects.0.mass": None, "hands.0.person.stature": 1.755}``."""
        return Parameters(self, numbers)

    @property
    def time(self) -> float:
        """[s]"""
        return self._core.time

    @property
    def steps(self) -> int:
        """Of the solver since the start of the scene."""
        return self._core.steps

    @property
    def bodies(self) -> Bodies:
        """A copy of poses and velocities."""
        return Bodies(*self._core.bodies())

    @property
    def muscles(self) -> Muscles:
        """A copy of excitations, activations, fibres and tendons; arrays of no number in a scene without muscles."""
        found = self._core.muscles()
        return Muscles(*(found if len(found) else np.zeros((6, 0))))

    @property
    def contacts(self) -> Contacts:
        """A copy of the contact points of the last step."""
        return Contacts(*self._core.contacts())

    def taxels(self, spacing: float = 1e-3) -> Taxels:
        """A copy of the forces on points of the finger pads in the last step: each contact's normal force over the disc
        that it presses flat, by a paraboloid of pressure.

        :param spacing: of the points [m]
        """
        number = real("spacing", spacing)
        if not 1e-4 <= number <= 0.1:
            raise input_error("spacing", repr(spacing), "0.1 mm to 0.1 m")
        return Taxels(*self._core.taxels(number))

    @property
    def verdicts(self) -> list[Verdict]:
        """Figures so far with the limits of the scene's criteria; empty without ``watch=True``."""
        return verdicts_of(self._core.verdicts())

    def reset(self, to: Optional[Motion] = None, *, q: Optional[ArrayLike] = None, u: Optional[ArrayLike] = None,
              objects: Optional[ArrayLike] = None) -> None:
        """To the scene's start, with the bits of a new simulation; to a start of your own; or to a motion. Works
        after a motion that diverged, too.

        :param to: of `motion` of this or another simulation of the same Scene; then without the others
        :param q: [rad] or [m], shape (coordinates,), angles within half a turn, and at most 0.05 rad (5 mm) beyond a stop
            in effect: a simulation's own ``q`` can be so; None: the scene's
        :param u: [rad/s] or [m/s], shape (coordinates,); None: at rest, beside a q; else the scene's
        :param objects: of each object that can move (`Scene.objects`): position of its centre of mass [m] and quaternion
            w x y z, shape (objects, 7); None: the scene's
        :raises Error: of kind input for a motion of another scene, and with all coordinates out of range
        """
        if to is not None and not (q is u is objects is None):
            raise input_error("to", "a motion beside q, u or objects", "one of the two")
        if to is not None:
            self._core.reset_to_motion(to)
        else:
            self._core.reset(q, u, objects)

    def set(self, name: str, values: ArrayLike) -> None:
        """Sets a number of the scene from the next reset on, shape (numbers,): ``objects.0.mass`` [kg]; the names are those
        of `Batch`.

        :raises Error: of kind input for an unknown name, a wrong shape, or a number that has no effect in this scene
        """
        self._core.set(name, np.atleast_1d(values))

    def get(self, name: str) -> Array:
        """A number of the scene as last set, shape (numbers,)."""
        return self._core.get(name)

    def motion(self) -> Motion:
        """The motion now (engine and controller), for `reset` in this process; takes microseconds."""
        return self._core.motion()

    def snapshot(self) -> Snapshot:
        """The whole run now, with its figures. Can be pickled and used in another process of the same scene."""
        return self._core.snapshot()

    def restore(self, snapshot: Snapshot) -> None:
        """Continues from a snapshot with the same bits as the run that it is of, also after a motion that diverged.

        :raises Error: of kind input with the difference for a snapshot of another scene, settings, or of a simulation
            with other ``watch`` or ``contact_forces``
        """
        self._core.restore(snapshot)

    def frame(self) -> Frame:
        """The state now for `Scene.draw_frames`."""
        return self._core.frame()

    def draw(self, *, size: Optional[tuple[int, int]] = None, view: Optional[str] = None,
             camera: Optional[Camera] = None) -> Picture:
        """A picture of the state now; options as in `Scene.draw`."""
        return self.scene.draw_frames([self.frame()], size=size, view=view, camera=camera)[0]

    def __repr__(self) -> str:
        return f"<handsim.Simulation: {self.scene.title}; t = {self.time:g} s>"


SET = ("gravity", "gains", "torque_limits", ".mass", ".friction")
"""Ends of names of `Simulation.set` that change a scene's numbers."""
STEP = 3e-5
"""Of the differences, as a share of the number: an error of its fourth power beside rounding."""


class Parameters:
    """Derivatives of steps by numbers of a scene, by differences of steps of scenes that are compiled with other
    numbers. All that follows from a number changes with it: lengths, masses, inertias, gains and pads with a stature.
    """

    def __init__(self, simulation: Simulation, numbers: Mapping[str, Optional[float]]) -> None:
        """
        :param numbers: by dotted key, as ``--set`` of the command line, the value that it has (SI); or None for a name of
            `Simulation.set`: gravity (3 numbers), gains, torque_limits, objects.I.mass, objects.I.friction
        :raises Error: of kind input where a scene with another number does not compile
        """
        self.simulation = one_of("simulation", simulation, Simulation)
        if not isinstance(numbers, Mapping):
            raise input_error("numbers", type(numbers).__name__, "a mapping: dotted key to its value, or to None")
        self.free = _free(simulation)
        self.names: list[str] = []
        """One for each column."""
        self._beside: list[list[tuple[Simulation, float]]] = []

        def add(name: str, scale: float, make: Callable[[float], Simulation]) -> None:
            size = STEP * max(abs(scale), 1e-9)
            self.names.append(name)
            self._beside.append([(make(size * k), weight / (12 * size)) for k, weight in ((1, 8), (-1, -8), (2, -1), (-2, 1))])

        for key, value in numbers.items():
            if value is not None:
                number = real(str(key), value)
                add(key, number, lambda by: Simulation(with_value(simulation.scene, key, number + by)))
                continue
            if not isinstance(key, str):
                raise input_error("numbers", repr(key)[:80], "dotted keys")
            if not key.endswith(SET):
                raise input_error(key, "no value", "the value that the scene has")
            now = simulation.get(key)
            for k in range(len(now)):
                def changed(by: float) -> Simulation:
                    other = Simulation(simulation.scene)
                    other.set(key, now + by * (np.arange(len(now)) == k))
                    other.reset()
                    return other
                add(key if len(now) == 1 else f"{key}.{'xyz'[k]}", float(np.linalg.norm(now)), changed)

    def derivatives(self, **action: Any) -> Array:
        """Of the next step with an action as in `Simulation.step`: next state by numbers, shape (s, numbers). The
        simulation stays."""
        columns = []
        for beside in self._beside:
            ends = []
            for other, _ in beside:
                other._core.reset_beside(self.simulation._core, None)
                exact_step(other, action)
                ends.append(_end(other, self.free))
            columns.append(sum(weight * end.against(ends[0]) for end, (_, weight) in zip(ends, beside)))
        return np.array(columns).T
