"""The largest grip of a hand with muscles: a simulation whose activations a linear program finds."""
from __future__ import annotations

from types import MappingProxyType
from typing import Callable, Mapping, NamedTuple, Sequence

import numpy as np

from . import _core
from ._scene import Scene
from ._simulation import Simulation
from ._statics import FINGERS, Array, Pressed, alone, cone, matrix_of, strongest


class _Touch(NamedTuple):
    """A contact of a finger with the object: its normal and force on the hand, at a point, all in the world."""

    segment: str
    point: Array
    normal: Array
    force: Array


class GripRun:
    """A hand whose palm is still, its wrist held at angles while its fingers close on an object. The palm's frame is the world's."""

    def __init__(self, load: Callable[[list[str]], Scene], wrist: Mapping[str, float], tilts: Sequence[float], friction: float,
                 balanced: Sequence[str] = (), fused: Mapping[str, str] = MappingProxyType({})) -> None:
        """:param load: the scene with more changes, as ``--set``
        :param wrist: by axis, where it is held [rad]
        :param tilts: of lines towards the palm, from its normal to distal [rad]
        :param balanced: axes about which muscles hold the wrist, as no splint does
        :param fused: joints of the hand that are fused, with their angles
        """
        self.wrist, self.tilts, self.friction = wrist, tilts, friction
        self.scene, bare = (load([f"hands.0.fused={{{', '.join(f'{axis}: {angle}' for axis, angle in axes.items())}}}", "record.contacts=true"])
                            for axes in ({**fused, **{axis: repr(angle) for axis, angle in wrist.items()}}, fused))
        # The same hand on a wrist that turns.
        self.of = alone(_core.hand_alone(bare._core))
        self._rows = [*self.of.rows(*(finger + "_" for finger in FINGERS)), *(self.of.names.index(axis) for axis in balanced)]
        self.simulation = Simulation(self.scene)
        self.along = np.zeros(3)
        """The line of the largest force."""
        self.activations = np.zeros(0)
        """Of the largest force, by muscle."""
        bodies = self.scene.bodies
        self.segments = {shape.name: bodies[shape.body] for shape in self.scene._model.shapes if shape.body >= 0}

    def force(self) -> float:
        """The scene closes the hand for half of its time. Then muscles have the activations of the largest force that the fingers can
        press along a line within the friction of their contacts, while `balanced` axes have no moment; each comes in a quarter of the time.

        :returns: the force along that line in the end [N]
        """
        steps = max(1, round(self.scene.duration / self.scene.step))
        if steps > 1:
            self.simulation.step(substeps=steps // 2)
        lines = [np.array([0, np.sin(tilt), -np.cos(tilt)]) for tilt in self.tilts]

        def held(i: int) -> tuple[float, int, Pressed]:
            found = self._held(lines[i])
            return found.sum, i, found

        _, best, pressed = strongest(held, range(len(lines)))
        self.activations = pressed.activations
        left = steps - steps // 2
        ramp = left // 2
        for i in range(1, ramp):
            self.simulation.step(excitations=i / ramp * pressed.activations)
        self.simulation.step(excitations=pressed.activations, substeps=left - max(0, ramp - 1))
        self.along = lines[best]
        return max(0.0, sum(self.by_finger().values()))

    def by_finger(self) -> dict[str, float]:
        """Of the force along that line, after `force`, what each finger presses [N]."""
        out = dict.fromkeys(FINGERS, 0.0)
        for touch in self._touches():
            out[touch.segment.partition("_")[0]] += float(touch.force @ self.along)
        return out

    def _touches(self) -> list[_Touch]:
        contacts, out = self.simulation.contacts, []
        for i in np.flatnonzero(~(contacts.depth < 0)):
            for name, side in ((contacts.a[i], 1.0), (contacts.b[i], -1.0)):
                hand, _, segment = self.segments.get(name, "").partition(".")
                if hand == "right" and "_" in segment and not segment.startswith("thumb_"):
                    out.append(_Touch(segment, contacts.position[i], side * contacts.normal[i], side * contacts.force[i]))
        return out

    def _held(self, along: Array) -> Pressed:
        """The largest force along a line by forces in the cones of friction of the contacts, whose sum across the line the palm's friction holds."""
        names = [name.partition(".")[2] for name in self.scene.coordinates]
        q = self.of.at({**self.wrist, **dict(zip(names, self.simulation.q))})
        bodies, touches = self.simulation.bodies, self._touches()
        columns, edges = [np.zeros((len(q), 0))], [np.zeros((0, 3))]
        for touch in touches:
            body = self.scene.bodies.index("right." + touch.segment)
            frame = matrix_of(bodies.quaternion[body]).T
            edges.append(cone(touch.normal, self.friction))
            forces = -edges[-1] @ frame.T @ self.of.axes(q, touch.segment).T
            columns.append(self.of.torques(q, (touch.segment, frame @ (touch.point - bodies.position[body])), forces))
        presses = np.vstack(edges)
        gain, first = presses @ along, np.array([1.0, 0, 0])
        across = presses @ np.stack([first, np.cross(along, first)], axis=1)
        less = np.stack([sign * across[:, i] - self.friction * gain for i in (0, 1) for sign in (1, -1)])
        return self.of.press(q, self._rows, np.hstack(columns), gain, less)
