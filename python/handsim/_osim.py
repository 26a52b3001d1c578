"""The model format of OpenSim 4: bodies, joints with ranges, springs and dampers of tissue, muscles and bands, the points that motion
capture follows as markers, spheres and planes as contact geometry, shapes to look at.

Body frames are the model's, with all digits. Hinges, universal joints, sliders and ball joints become OpenSim's own, with one coordinate
named ``joint.axis`` for each axis, of the same sign. A free palm's coordinates ``right.palm.world.rx`` to ``.tz`` move its hand frame (an
object's: its body) relative to the start, where they are zero; those of a driven palm are prescribed, sampled every 10 ms. A fixed body
is welded to the ground. Ranges need the effect joint_stops, springs passive_tissue, gravity the effect gravity. Muscles in effect become
RigidTendonMuscles along paths whose lengths are polynomials of the coordinates: with the model's moment arms within the range of their
polynomials, its forces at rest, and its force by speed at full activation; activation is excitation, and elastic tendons are rigid. Left
out: contact forces, stops as forces, motors, boxes, cylinders and meshes as contact geometry.
"""
from __future__ import annotations

import math
from typing import Iterator, NamedTuple, Sequence

import numpy as np

from ._model import IDENTITY, Array, Band, Drive, Joint, Model, Muscle, Path, Shape, compose, inverse, posed, quaternion_of, turn_of, turned
from ._xml import attribute, element, number, numbers, refuse, rotation_matrix

VERSION = 40000
"""Any file of OpenSim 4 may have this: what is written here has not changed since."""
FREE_TRAVEL = 10.0
"""Range of a coordinate without a stop [m]."""
PERPENDICULAR = 1e-9
"""Cosine of a universal joint's axes."""
QUARTER = (math.cos(math.pi / 4), math.sin(math.pi / 4))


def xyz_angles(q: Array) -> Array:
    """Angles a, b, c with R = Rx(a) Ry(b) Rz(c): OpenSim's ``orientation`` and its free and ball coordinates."""
    R = rotation_matrix(q)
    flat = math.hypot(R[0, 0], R[0, 1])
    b = math.atan2(R[0, 2], flat)
    if flat < 1e-12:
        return np.array([0, b, math.atan2(R[1, 0], R[1, 1])])
    return np.array([math.atan2(-R[1, 2], R[2, 2]), b, math.atan2(-R[0, 1], R[0, 0])]) + 0.0  # no -0


def _nearest_angles(q: Array, before: Array) -> Array:
    """The equivalent triple of angles nearest to that before: passes a right angle of the middle without a jump."""
    found = xyz_angles(q)
    other = np.array([found[0] + math.pi, math.pi - found[1], found[2] + math.pi])
    both = [each + 2 * math.pi * np.round((before - each) / (2 * math.pi)) for each in (found, other)]
    return min(both, key=lambda each: float(np.linalg.norm(each - before)))


def _between(start: Array, end: Array) -> Array:
    """The quaternion of the shortest turn from one direction to another."""
    a, b = start / np.linalg.norm(start), end / np.linalg.norm(end)
    normal, cosine = np.cross(a, b), float(a @ b)
    if cosine < -1 + 1e-4:
        # Near opposite directions 1 + cosine has lost its digits: half a turn, and what is left.
        beside = np.array([-a[1], a[0], 0]) if abs(a[0]) + abs(a[1]) > 1e-9 else np.array([0, -a[2], a[1]])
        across = normal if np.linalg.norm(normal) > 1e-12 else beside
        half = np.array([0.0, *(across / np.linalg.norm(across))])
        return compose(posed(turn=_between(-a, b)), posed(turn=half))[3:]
    s = math.sqrt(2 * (1 + cosine))
    return np.array([0.5 * s, *(normal / s)])


def _place(location: str, pose: Array) -> str:
    return element(location, numbers(pose[:3])) + element("orientation", numbers(xyz_angles(pose[3:])))


class _Coordinate(NamedTuple):
    """Of a joint, in the order of OpenSim's axes. Not clamped to its range: with bounds, OpenSim's inverse kinematics stops a millimetre
    from the markers of a hand, 0.15 rad off."""

    name: str
    value: float
    speed: float
    low: float
    high: float
    prescribed: str = ""
    """A function of time; empty: the coordinate is free."""

    def text(self) -> str:
        moved = element("prescribed_function", self.prescribed) + element("prescribed", "true") if self.prescribed else ""
        return (f'<Coordinate name="{attribute(self.name)}">{element("default_value", self.value)}'
                f'{element("default_speed_value", self.speed)}'
                f'{element("range", numbers([self.low, self.high]))}{element("clamped", "false")}{moved}</Coordinate>')


def _ends(shape: Shape) -> Iterator[tuple[str, Array]]:
    """The centres of a capsule's caps, in the frame of the shape."""
    for word, side in ((".near", -0.5), (".far", 0.5)):
        yield word, posed([0, 0, side * shape.length])


class _Writer:
    def __init__(self, model: Model) -> None:
        self.model = model
        self.lines: list[str] = []

    def run(self) -> str:
        model = self.model
        refuse([(joint.name, got, need) for joint in model.joints for wrong, got, need in (
            (joint.closes_loop, "a loop", "a tree of joints, for OpenSim"),
            (joint.kind == "universal" and abs(joint.axes[0].axis @ joint.axes[1].axis) > PERPENDICULAR, "axes that are not perpendicular",
             "perpendicular axes, for OpenSim")) if wrong])
        self.lines += ['<?xml version="1.0" encoding="UTF-8"?>', f'<OpenSimDocument Version="{VERSION}">', '<Model name="handsim">',
                       element("length_units", "meters") + element("force_units", "N") + element("gravity", numbers(model.pull())),
                       '<Ground name="ground">']
        self._visible(0)
        self.lines.append("</Ground>")
        for tag, write in (("BodySet", self._bodies), ("JointSet", self._joints), ("ForceSet", self._forces), ("MarkerSet", self._markers),
                           ("ContactGeometrySet", self._contact_geometry)):
            self.lines.append(f'<{tag} name="{tag.lower()}"><objects>')
            write()
            self.lines.append(f"</objects></{tag}>")
        return "\n".join([*self.lines, "</Model>", "</OpenSimDocument>", ""])

    def _path(self, body: int) -> str:
        return "/bodyset/" + attribute(self.model.bodies[body].name) if body else "/ground"

    def _bodies(self) -> None:
        for index, body in list(enumerate(self.model.bodies))[1:]:
            moments = [*np.diag(body.inertia), body.inertia[0, 1], body.inertia[0, 2], body.inertia[1, 2]]
            self.lines.append(f'<Body name="{attribute(body.name)}">')
            self._visible(index)
            self.lines += [element("mass", body.mass) + element("mass_center", "0 0 0") + element("inertia", numbers(moments)), "</Body>"]

    def _visible(self, body: int) -> None:
        """Shapes as OpenSim draws them, each in a frame of its own. A mesh needs a file of its own; OpenSim draws its own floor."""
        frames: list[str] = []

        def add(shape: Shape, suffix: str, pose: Array, geometry: str) -> None:
            frames.append(f'<PhysicalOffsetFrame name="{attribute(shape.name)}{suffix}"><attached_geometry>{geometry}</attached_geometry>'
                          f'<socket_parent>..</socket_parent>{_place("translation", compose(shape.pose, pose))}</PhysicalOffsetFrame>')

        for shape in self.model.shapes:
            if shape.body != body:
                continue
            ball = f'<Sphere>{element("radius", shape.radius)}</Sphere>'
            if shape.kind == "box":
                add(shape, "", IDENTITY, f'<Brick>{element("half_lengths", numbers(0.5 * shape.edges))}</Brick>')
            if shape.kind == "sphere":
                add(shape, "", IDENTITY, ball)
            if shape.kind == "capsule":
                for suffix, pose in _ends(shape):
                    add(shape, suffix, pose, ball)
            if shape.kind in ("capsule", "cylinder"):
                # OpenSim's cylinder lies along y.
                rod = f'<Cylinder>{element("radius", shape.radius)}{element("half_height", 0.5 * shape.length)}</Cylinder>'
                add(shape, "", posed(turn=[QUARTER[0], QUARTER[1], 0, 0]), rod)
        if frames:
            self.lines += ["<components>", *frames, "</components>"]

    def _joints(self) -> None:
        for body in self.model.roots():
            self._root(body)
        for joint in self.model.joints:
            self._own_joint(joint)

    def _joint(self, kind: str, name: str, in_parent: Array, parent: int, in_child: Array, child: int,
               coordinates: Sequence[_Coordinate]) -> None:
        self.lines.append(f'<{kind} name="{attribute(name)}"><socket_parent_frame>parent_offset</socket_parent_frame>'
                          "<socket_child_frame>child_offset</socket_child_frame>")
        if coordinates:
            self.lines += ["<coordinates>", *(each.text() for each in coordinates), "</coordinates>"]
        self.lines.append("<frames>")
        self.lines += [f'<PhysicalOffsetFrame name="{of}"><socket_parent>{self._path(body)}</socket_parent>'
                       f'{_place("translation", pose)}</PhysicalOffsetFrame>'
                       for of, body, pose in (("parent_offset", parent, in_parent), ("child_offset", child, in_child))]
        self.lines.append(f"</frames></{kind}>")

    def _root(self, index: int) -> None:
        """A body without a parent. Its coordinates are zero at the start, far from where three angles fail."""
        model, body, drive = self.model, self.model.bodies[index], self.model.drive(index)
        # Its coordinates say the motion of the driven frame, of a hand that of the wrist.
        own = next((hand.wrist for hand in model.hands if hand.palm == index), IDENTITY)
        in_body = drive.frame if drive else own
        start = model.start.poses[index]
        in_world = compose(start, in_body)
        name = body.name + ".world"
        if body.fixed and not drive:
            return self._joint("WeldJoint", name, in_world, 0, in_body, index, [])
        back = inverse(in_world)[3:]
        turning = turned(back, model.start.turning[index])
        moving = turned(back, model.start.velocities[index] + np.cross(model.start.turning[index], in_world[:3] - start[:3]))
        curves = _prescribed(drive, in_world) if drive else [""] * 6
        speeds = [0.0] * 6 if drive else [*turning, *moving]
        far = [math.pi] * 3 + [FREE_TRAVEL] * 3
        return self._joint("FreeJoint", name, in_world, 0, in_body, index,
                           [_Coordinate(f"{name}.{axis}", 0, speed, -limit, limit, curve)
                            for axis, speed, limit, curve in zip(("rx", "ry", "rz", "tx", "ty", "tz"), speeds, far, curves)])

    def _own_joint(self, joint: Joint) -> None:
        if self.model.bodies[joint.child].fixed:
            return self._joint("WeldJoint", joint.name, joint.parent_frame, joint.parent, joint.child_frame, joint.child, [])
        # OpenSim's joints turn about fixed axes of their frames: a pin about z, a universal joint about x and then y; a slider moves
        # along x. At zero coordinates both frames coincide, in OpenSim and here.
        turn = IDENTITY
        if joint.kind in ("hinge", "slider"):
            turn = posed(turn=_between(np.array([0.0, 0, 1] if joint.kind == "hinge" else [1.0, 0, 0]), joint.axes[0].axis))
        if joint.kind == "universal":
            x = joint.axes[0].axis
            z = np.cross(x, joint.axes[1].axis)
            z = z / np.linalg.norm(z)
            turn = posed(turn=quaternion_of(np.stack([x, np.cross(z, x), z], axis=1)))
        kind = {"hinge": "PinJoint", "universal": "UniversalJoint", "slider": "SliderJoint", "ball": "BallJoint"}[joint.kind]
        return self._joint(kind, joint.name, compose(joint.parent_frame, turn), joint.parent, compose(joint.child_frame, turn), joint.child,
                           self._coordinates(joint))

    def _coordinates(self, joint: Joint) -> list[_Coordinate]:
        q, u = (of[joint.first:joint.first + len(joint.slides)] for of in (self.model.start.q, self.model.start.u))
        if joint.spherical:
            return [_Coordinate(f"{joint.name}.{axis}", angle, rate, -math.pi, math.pi)
                    for axis, angle, rate in zip("xyz", xyz_angles(turn_of(q)), u)]
        out = []
        for i, axis in enumerate(joint.axes):
            far = FREE_TRAVEL if joint.slides[i] else math.pi
            low, high = (axis.low, axis.high) if self.model.stopped(axis) else (-far, far)
            out.append(_Coordinate(f"{joint.name}.{axis.name}", q[i], u[i], low, high))
        return out

    def _forces(self) -> None:
        """Muscles, bands and passive tissue."""
        model = self.model
        self.lines += _pulls(model)
        for joint in model.joints:
            for axis in joint.axes:
                if model.passive(axis) and not model.bodies[joint.child].fixed:
                    name = attribute(f"{joint.name}.{axis.name}")
                    self.lines.append(f'<SpringGeneralizedForce name="{name}.tissue">{element("coordinate", name)}'
                                      f'{element("stiffness", axis.stiffness)}'
                                      f'{element("rest_length", axis.rest)}{element("viscosity", axis.damping)}</SpringGeneralizedForce>')

    def _markers(self) -> None:
        self.lines += [f'<Marker name="{attribute(name)}"><socket_parent_frame>{self._path(body)}</socket_parent_frame>'
                       f'{element("location", numbers(point))}</Marker>'
                       for name, body, point in self.model.markers]

    def _contact_geometry(self) -> None:
        """Spheres and planes: OpenSim has no other shapes for contact without a file."""
        def add(kind: str, shape: Shape, suffix: str, pose: Array, more: str) -> None:
            self.lines.append(f'<{kind} name="{attribute(shape.name)}{suffix}"><socket_frame>{self._path(shape.body)}</socket_frame>'
                              f'{_place("location", compose(shape.pose, pose))}{more}</{kind}>')

        for shape in self.model.shapes:
            radius = element("radius", shape.radius)
            if shape.kind == "sphere":
                add("ContactSphere", shape, "", IDENTITY, radius)
            if shape.kind == "capsule":
                for suffix, pose in _ends(shape):
                    add("ContactSphere", shape, suffix, pose, radius)
            # OpenSim's half space is solid where x > 0, handsim's where z < 0.
            if shape.kind == "plane":
                add("ContactHalfSpace", shape, "", posed(turn=[QUARTER[0], 0, QUARTER[1], 0]), "")


def _prescribed(drive: Drive, start: Array) -> list[str]:
    """Functions of time of a driven body's coordinates."""
    moved = compose(inverse(start), drive.poses)
    before, angles = np.zeros(3), []
    for pose in moved:
        before = _nearest_angles(pose[3:], before)
        angles.append(before)
    times = element("x", numbers(drive.times))
    return [f'<SimmSpline>{times}{element("y", numbers(values))}</SimmSpline>' for values in [*np.transpose(angles), *moved[:, :3].T]]


# Muscles and bands in effect: each length is one polynomial of its coordinates, exact within its arms' range; OpenSim's arms are its
# derivatives. Coordinates of welded joints stay at the start.

Powers = tuple[int, ...]


def _length(path: Path, length: float, model: Model, moves: set[int]) -> tuple[list[int], dict[Powers, float]]:
    """The coordinates, and the factor of each term by their powers: the length at zero coordinates less the excursion."""
    dofs = [dof for dof in path.dofs if dof in moves]
    terms: dict[Powers, float] = {}

    def subtract(factor: float, *of: tuple[int, int]) -> None:
        powers = [0] * len(dofs)
        for arm, power in of:
            dof = path.dofs[arm]
            if dof in moves:
                powers[dofs.index(dof)] = power
            else:
                factor *= math.pow(model.start.q[dof], power)
        terms[tuple(powers)] = terms.get(tuple(powers), 0.0) - factor

    subtract(-length)
    for arm, polynomial in enumerate(path.polynomials):
        for k, c in enumerate(polynomial):
            if c != 0:
                subtract(c / (k + 1), (arm, k + 1))
    for a, b, power_a, power_b, factor in path.products:
        subtract(factor, (a, power_a), (b, power_b))
    return dofs, terms


def _all_powers(count: int, most: int) -> Iterator[Powers]:
    """In OpenSim's order: all powers whose sum is at most ``most``, the last variable's first."""
    if count == 0:
        yield ()
        return
    for power in range(most + 1):
        for rest in _all_powers(count - 1, most - power):
            yield power, *rest


def _path_element(dofs: list[int], terms: dict[Powers, float], places: dict[int, str]) -> str:
    order = max(sum(powers) for powers in terms)
    factors = [terms.get(powers, 0.0) for powers in _all_powers(len(dofs), order)]
    return (f'<FunctionBasedPath name="path">{element("coordinate_paths", " ".join(places[dof] for dof in dofs))}<length_function>'
            f'<MultivariatePolynomialFunction>{element("coefficients", " ".join(map(number, factors)))}<dimension>{len(dofs)}</dimension>'
            f"<order>{order}</order></MultivariatePolynomialFunction></length_function></FunctionBasedPath>")


def _curves(of: dict[str, float]) -> str:
    """The curves of src/handsim/model/muscle_curves.h; that of the speed at full activation."""
    shape, strain = of["passive_shape"], of["passive_strain"]
    scale, end = number(math.expm1(shape)), number(1 + strain)
    slope = number(shape / strain * math.exp(shape) / math.expm1(shape))
    laws = {"active_force_length_curve": f"exp(-(x-1)^2/{number(of['active_width'])})*step(x-{number(of['shortest'])})"
                                         f"*step({number(of['longest'])}-x)",
            "passive_force_length_curve": f"step(x-1)*((exp({number(shape)}*(min(x,{end})-1)/{number(strain)})-1)/{scale}"
                                          f"+{slope}*max(0,x-{end}))",
            "force_velocity_curve": f"(1+max(-1,min(x,0)))/(1-max(-1,min(x,0))/{number(of['speed_shape'])})"
                                    f"+(1+{number(of['steep'] * of['lengthening'])}*max(x,0))/(1+{number(of['steep'])}*max(x,0))-1"}
    return "".join(f'<ExpressionBasedFunction name="{name}">{element("expression", law)}{element("variables", "x")}'
                   "</ExpressionBasedFunction>" for name, law in laws.items())


def _muscle(muscle: Muscle, path: str, curves: str) -> str:
    numbers_of = {"max_isometric_force": muscle.force, "optimal_fiber_length": muscle.fibre_length,
                  "tendon_slack_length": muscle.slack_length,
                  "pennation_angle_at_optimal": muscle.pennation, "max_contraction_velocity": muscle.max_speed}
    return (f'<RigidTendonMuscle name="{attribute(muscle.name)}">{element("min_control", 0.0)}'
            f'{element("max_control", muscle.excitable)}{path}'
            f'{"".join(element(tag, x) for tag, x in numbers_of.items())}{element("ignore_tendon_compliance", "true")}'
            f'{element("ignore_activation_dynamics", "true")}{curves}</RigidTendonMuscle>')


def _band(band: Band, path: str) -> str:
    """A slack band's stretch is clamped at zero, where it has no force even while it gets longer."""
    pull = f"{number(band.stiffness)}*s+{number(band.damping)}*ldot"
    return (f'<ExpressionBasedPathForce name="{attribute(band.name)}">{path}{element("resting_length", band.rest)}'
            f'{element("expression", pull if band.both_ways else f"(1-step(-s))*max(0,{pull})")}'
            f'{element("clamp_stretch", "false" if band.both_ways else "true")}</ExpressionBasedPathForce>')


def _pulls(model: Model) -> list[str]:
    """OpenSim has no path that depends on no coordinate: these are left out."""
    moves = {joint.first + i for joint in model.joints for i in range(len(joint.slides)) if not model.bodies[joint.child].fixed}
    places = {joint.first + i: attribute(f"/jointset/{joint.name}/{joint.name}.{axis.name}")
              for joint in model.joints for i, axis in enumerate(joint.axes)}
    curves, out = _curves(model.curves), []
    for muscle in model.muscles if "muscles" in model.effects else ():
        dofs, terms = _length(muscle.path, muscle.length, model, moves)
        if dofs:
            out.append(_muscle(muscle, _path_element(dofs, terms, places), curves))
    for band in model.bands if "tendon_coupling" in model.effects else ():
        dofs, terms = _length(band.path, 0, model, moves)
        if dofs:
            out.append(_band(band, _path_element(dofs, terms, places)))
    return out


def osim_of(model: Model) -> str:
    """:raises Error: of kind input for loops and for universal joints whose axes are not perpendicular"""
    return _Writer(model).run()
