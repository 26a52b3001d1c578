"""MJCF, the model format of MuJoCo (2.2 and newer): bodies, joints with ranges and tissue, shapes, contact pairs and surfaces, masses,
an actuator on every axis, the start as keyframe ``initial``.

Body frames are the model's (origin at the centre of mass), angles are in radians, and all digits are written. Each joint axis becomes a
joint named ``joint.axis``; a ball joint keeps its name; an actuator has the name of its joint. Joint limits need the effect joint_stops,
joint stiffness and damping passive_tissue, gravity the effect gravity, friction the effect friction. Kinematic bodies are fixed at their
start, driven ones are mocap bodies. Loops are closed by ``connect`` constraints, which are compliant in MuJoCo. Axes with a drive get a
position actuator with its gains and torque limit (without integral), others a motor. Muscles and bands in effect become fixed tendons
with the moment arms of the start, and actuators of the muscles' names with their isometric forces there.
"""
from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ._model import Array, Axis, Joint, Model, Path, Shape, Touch, compose, inverse, posed, product, quaternion_of, turn_of, turned
from ._xml import attribute, number, numbers, refuse

MOST_GROUPS = 32
PLANE_SPACING = 0.1
"""Of the grid that MuJoCo draws [m]."""


def coordinate(joint: Joint, axis: Axis) -> str:
    return attribute(f"{joint.name}.{axis.name}")


def _check(model: Model) -> None:
    """:raises Error: of kind input for what MJCF has no words for"""
    problems = []
    if model.groups > MOST_GROUPS:
        problems.append(("groups", str(model.groups), "at most 32 for MJCF"))
    problems += [(joint.name, "a loop closed by a universal or slider joint", "a ball joint or hinge there, for MJCF")
                 for joint in model.joints if joint.closes_loop and joint.kind in ("universal", "slider")]
    refuse(problems)


class _Writer:
    def __init__(self, model: Model) -> None:
        self.model = model
        self.lines: list[str] = []
        self.actuators: list[str] = []
        self.targets: list[str] = []
        self.positions: list[str] = []
        self.velocities: list[str] = []

    def run(self) -> str:
        model = self.model
        _check(model)
        self.lines += ['<mujoco model="handsim">', '  <compiler angle="radian" coordinate="local" boundmass="0" boundinertia="0"/>',
                       f'  <option timestep="{number(model.step)}" gravity="{numbers(model.pull())}"{self._solver()}/>']
        # MuJoCo computes the convex hull of the vertices itself.
        self._block("asset", [f'    <mesh name="{attribute(shape.name)}" vertex="{numbers(shape.corners)} "/>'
                              for shape in model.shapes if shape.kind == "convex_mesh"])
        self.lines.append("  <worldbody>")
        self._shapes(0, "    ")
        for body in model.roots():
            self._root(body)
        self._children(0, "    ")
        self.lines.append("  </worldbody>")
        self._block("contact", [*self._excluded(), *_pairs(model)])
        self._block("equality", self._loops())
        self._block("tendon", self._tendons())
        self._block("actuator", self.actuators)
        if self.positions:
            targets = f' ctrl="{" ".join(self.targets)}"' if self.actuators else ""
            state = f'qpos="{" ".join(self.positions)}" qvel="{" ".join(self.velocities)}"'
            self.lines += ["  <keyframe>", f'    <key name="initial" {state}{targets}/>', "  </keyframe>"]
        return "\n".join([*self.lines, "</mujoco>", ""])

    def _block(self, tag: str, lines: list[str]) -> None:
        if lines:
            self.lines += [f"  <{tag}>", *lines, f"  </{tag}>"]

    def _name(self, body: int) -> str:
        return attribute(self.model.bodies[body].name)

    def _solver(self) -> str:
        """Friction as handsim has it: a round cone, no creep where surfaces stick. With servos: implicit dampers."""
        friction = self.model.rules and "friction" in self.model.effects
        return ((' cone="elliptic" impratio="1000" noslip_iterations="10"' if friction else "") +
                (' integrator="implicit"' if self.model.implicit else ""))

    def _open(self, index: int, pose: Array, indent: str) -> None:
        body = self.model.bodies[index]
        mocap = ' mocap="true"' if self.model.drive(index) else ""
        # Principal axes: those that MuJoCo finds itself have an error of 1e-9.
        moments, axes = np.linalg.eigh(body.inertia)
        if np.linalg.det(axes) < 0:
            axes[:, 2] *= -1
        self.lines += [f'{indent}<body name="{self._name(index)}" pos="{numbers(pose[:3])}" quat="{numbers(pose[3:])}"{mocap}>',
                       f'{indent}  <inertial pos="0 0 0" quat="{numbers(quaternion_of(axes))}" mass="{number(body.mass)}" '
                       f'diaginertia="{numbers(moments)}"/>']

    def _close(self, index: int, indent: str) -> None:
        self._shapes(index, indent + "  ")
        self._children(index, indent + "  ")
        self.lines.append(indent + "</body>")

    def _root(self, index: int) -> None:
        start = self.model.start
        pose = start.poses[index]
        self._open(index, pose, "    ")
        if not self.model.bodies[index].fixed:
            self.lines.append(f'      <freejoint name="{self._name(index)}"/>')
            self.positions.append(numbers(pose))
            self.velocities += [numbers(start.velocities[index]), numbers(turned(inverse(pose)[3:], start.turning[index]))]
        self._close(index, "    ")

    def _children(self, body: int, indent: str) -> None:
        for joint in self.model.joints:
            if joint.closes_loop or joint.parent != body:
                continue
            self._open(joint.child, compose(joint.parent_frame, inverse(joint.child_frame)), indent)
            if not self.model.bodies[joint.child].fixed:
                self._joint(joint, indent + "  ")
            self._close(joint.child, indent)

    def _joint(self, joint: Joint, indent: str) -> None:
        model, place, turn = self.model, numbers(joint.child_frame[:3]), joint.child_frame[3:]
        q, u = (of[joint.first:joint.first + len(joint.slides)] for of in (model.start.q, model.start.u))
        if joint.spherical:
            self.lines.append(f'{indent}<joint name="{attribute(joint.name)}" type="ball" pos="{place}"/>')
            # MuJoCo's ball joint has its rotation and rates in body axes.
            back, own = turn * [1, -1, -1, -1], turn_of(q)
            self.positions.append(numbers(product(product(turn, own), back)))
            self.velocities.append(numbers(turned(turn, turned(own * [1, -1, -1, -1], u))))
            return
        for i, axis in enumerate(joint.axes):
            name = coordinate(joint, axis)
            text = (f'{indent}<joint name="{name}" type="{"slide" if joint.slides[i] else "hinge"}" pos="{place}" '
                    f'axis="{numbers(turned(turn, axis.axis))}"')
            text += f' limited="true" range="{numbers([axis.low, axis.high])}"' if model.stopped(axis) else ' limited="false"'
            if model.passive(axis):
                text += f' stiffness="{number(axis.stiffness)}" springref="{number(axis.rest)}" damping="{number(axis.damping)}"'
            self.lines.append(text + "/>")
            self._actuator(name, joint.first + i)
            self.positions.append(number(q[i]))
            self.velocities.append(number(u[i]))

    def _actuator(self, name: str, dof: int) -> None:
        """MuJoCo's ``position``, whose damping older versions do not read."""
        servo = self.model.servos.get(dof)
        if servo is None:
            self.actuators.append(f'    <motor name="{name}" joint="{name}"/>')
            self.targets.append("0")
            return
        stiffness, limit = number(servo.stiffness), number(servo.limit)
        self.actuators.append(f'    <general name="{name}" joint="{name}" gainprm="{stiffness}" biastype="affine" '
                              f'biasprm="{number(servo.feed)} '
                              f'-{stiffness} -{number(servo.damping)}" forcelimited="true" forcerange="-{limit} {limit}"/>')
        self.targets.append(number(self.model.start.q[dof] + servo.error))

    def _affinity(self, group: int) -> int:
        """Bits of the groups that a group has rules with: shapes touch if contype and conaffinity share one."""
        bits = 0
        for a, b in self.model.rules:
            bits |= (1 << b if a == group else 0) | (1 << a if b == group else 0)
        return bits

    def _shapes(self, body: int, indent: str) -> None:
        for shape in self.model.shapes:
            if shape.body == body:
                self.lines.append(f'{indent}<geom name="{attribute(shape.name)}" {_form(shape)} pos="{numbers(shape.pose[:3])}" '
                                  f'quat="{numbers(shape.pose[3:])}" contype="{1 << shape.group}" '
                                  f'conaffinity="{self._affinity(shape.group)}"'
                                  f'{_friction(self.model, shape)} mass="0"/>')

    def _excluded(self) -> list[str]:
        """No contact between bodies that a joint connects."""
        return [f'    <exclude body1="{self._name(joint.parent)}" body2="{self._name(joint.child)}"/>'
                for joint in self.model.joints if joint.parent]

    def _loops(self) -> list[str]:
        out = []
        for joint in self.model.joints:
            if joint.closes_loop:
                # A hinge needs two points of its axis.
                points = [joint.child_frame]
                if joint.kind == "hinge":
                    points.append(compose(joint.child_frame, posed(0.01 * joint.axes[0].axis)))
                out += [f'    <connect body1="{self._name(joint.child)}" body2="{self._name(joint.parent)}" anchor="{numbers(point[:3])}"/>'
                        for point in points]
        return out

    def _tendons(self) -> list[str]:
        """Fixed tendons have constant moment arms: those at the start; an actuator has its muscle's isometric force there, per activation,
        beside the passive one. MuJoCo's law of activation is handsim's. MJCF knows no tendon without a joint."""
        model, out = self.model, []
        names = {joint.first + i: coordinate(joint, axis) for joint in model.joints for i, axis in enumerate(joint.axes)}
        for muscle in model.muscles if "muscles" in model.effects else ():
            if muscle.path.dofs:
                name = attribute(muscle.name)
                out += _fixed(name, muscle.path, names, "")
                self.actuators.append(
                    f'    <general name="{name}" tendon="{name}" dyntype="muscle" '
                    f'dynprm="{numbers([muscle.activation_time, muscle.deactivation_time])}" '
                    f'gaintype="fixed" gainprm="{number(-muscle.isometric)}" biastype="affine" biasprm="{number(-muscle.passive)} 0 0" '
                    'ctrllimited="true" ctrlrange="0 1"/>')
                self.targets.append("0")
        for band in model.bands if "tendon_coupling" in model.effects else ():
            if band.path.dofs:
                # MuJoCo's length is that of constant arms: its rest length differs as the lengths do at the start.
                length = 0.0
                for arm, dof in zip(band.path.arms, band.path.dofs):
                    length -= arm * model.start.q[dof]
                rest = number(band.rest + length + band.path.excursion)
                # A band that goes slack is a limit there: MuJoCo's springs work both ways.
                law = (f' stiffness="{number(band.stiffness)}" damping="{number(band.damping)}" springlength="{rest}"' if band.both_ways
                       else f' limited="true" range="-1 {rest}"')
                out += _fixed(attribute(band.name), band.path, names, law)
        return out


def _fixed(name: str, path: Path, names: dict[int, str], attributes: str) -> list[str]:
    """A fixed tendon, whose length is the sum of coefficients times angles: coefficients are minus the arms."""
    arms = (f'      <joint joint="{names[dof]}" coef="{number(-arm)}"/>' for dof, arm in zip(path.dofs, path.arms))
    return [f'    <fixed name="{name}"{attributes}>', *arms, "    </fixed>"]


def _form(shape: Shape) -> str:
    """Type, and the attribute of its size."""
    if shape.kind == "convex_mesh":
        return f'type="mesh" mesh="{attribute(shape.name)}"'
    sizes: dict[str, ArrayLike] = {"box": 0.5 * shape.edges, "sphere": [shape.radius], "plane": [0, 0]}
    size = sizes.get(shape.kind, [shape.radius, 0.5 * shape.length])
    return f'type="{shape.kind}" size="{numbers(size)}{f" {PLANE_SPACING:g}" if shape.kind == "plane" else ""}"'


def _friction(model: Model, surface: Shape | Touch) -> str:
    """Attributes ``condim`` and ``friction`` of a geom, or of a pair, whose friction has five numbers."""
    if "friction" not in model.effects:
        return ' condim="1"'
    mu, spin, roll = surface.friction, surface.spinning_friction, surface.rolling_friction
    condim = 6 if roll > 0 else 4 if spin > 0 else 3 if mu > 0 else 1
    return f' condim="{condim}" friction="{numbers([mu, mu, spin, roll, roll] if isinstance(surface, Touch) else [mu, spin, roll])}"'


def _combined_there(a: Shape, b: Shape, pair: Touch, friction: bool) -> bool:
    """Whether MuJoCo makes this of two surfaces by itself: it takes the greater coefficient of friction."""
    if pair.spring is not None:
        return False
    return not friction or (pair.friction == max(a.friction, b.friction)
                            and pair.rolling_friction == max(a.rolling_friction, b.rolling_friction)
                            and pair.spinning_friction == max(a.spinning_friction, b.spinning_friction))


def _spring_damper(spring: list[float], mobility: float, h: float) -> str:
    """A spring-damper at the step's end, f = -(K (r + h v+) + c v+) for a gap r and its rate v+ after the step of length h.

    MuJoCo's contact is f = -(a + b v + k r) / R with the acceleration a = (v+ - v) / h, so b = 1 / h, R = 1 / (h (c + h K)) and k = K R. It
    takes R from the impedance d, as (1 - d) / d times the mobility of the two bodies, and from ``solref`` d k and d b. Friction shares b:
    it stops a slip within a step."""
    stiffness, damping = spring
    R = 1 / (h * (damping + h * stiffness))
    d = mobility / (mobility + R)
    return f' solref="{numbers([-d * stiffness * R, -d / h])}" solimp="{numbers([d, d])} 0.001"'


def _pairs(model: Model) -> list[str]:
    """A ``pair`` for every two shapes that may touch and whose surfaces MuJoCo combines otherwise than handsim: its soft contacts are no
    springs in series."""
    out: list[str] = []
    stiffens = False
    for i, k, place in model.pairs:
        a, b, pair = model.shapes[i], model.shapes[k], model.touches[place]
        if pair.stiffens and not stiffens:
            out.append(f"    <!-- Pads that stiffen: the secant and the area of a lasting press of {model.lasting_load:g} N -->")
            stiffens = True
        if _combined_there(a, b, pair, "friction" in model.effects):
            continue
        text = f'    <pair geom1="{attribute(a.name)}" geom2="{attribute(b.name)}"{_friction(model, pair)}'
        if pair.spring is not None and model.mobilities is not None:
            text += _spring_damper(pair.spring, model.mobilities[a.body] + model.mobilities[b.body], model.step)
        out.append(text + "/>")
    return out


def mjcf_of(model: Model) -> str:
    """:raises Error: of kind input for loops closed by universal or slider joints and more than 32 contact groups"""
    return _Writer(model).run()
