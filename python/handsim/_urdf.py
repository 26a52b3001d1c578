"""URDF, the robot description of ROS: links with masses and collision shapes, joints with ranges.

The tree starts at link ``world``. A universal joint becomes two revolute joints with a link of 1e-12 kg between them. A capsule becomes a
cylinder with a sphere at each end (URDF has no capsule). A free body gets a floating joint, a kinematic body a fixed joint at its start.
URDF requires limits of effort and speed: effort is the drive's torque limit, and where a model has no limit both are 1000.
"""
from __future__ import annotations

import math
from typing import Optional, Sequence

import numpy as np

from ._model import IDENTITY, Array, Joint, Model, Shape, compose, inverse, posed
from ._xml import attribute, number, numbers, refuse, rotation_matrix

UNLIMITED = 1000.0
MIDDLE_MASS, MIDDLE_INERTIA = 1e-12, 1e-14
"""Of the link in the middle of a universal joint: programs that read URDF require mass on every moving link."""


def roll_pitch_yaw(q: Array) -> Array:
    """Angles with R = Rz(yaw) Ry(pitch) Rx(roll)."""
    R = rotation_matrix(q)
    flat = math.hypot(R[0, 0], R[1, 0])
    pitch = math.atan2(-R[2, 0], flat)
    if flat < 1e-9:
        return np.array([0, pitch, math.atan2(-R[0, 1], R[1, 1])])
    return np.array([math.atan2(R[2, 1], R[2, 2]), pitch, math.atan2(R[1, 0], R[0, 0])])


def _origin(pose: Array) -> str:
    return f'<origin xyz="{numbers(pose[:3])}" rpy="{numbers(roll_pitch_yaw(pose[3:]))}"/>'


def _inertial(pose: Array, mass: float, inertia: Array) -> str:
    words = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    moments = " ".join(f'{word}="{number(x)}"' for word, x in zip(words, inertia[np.triu_indices(3)]))
    return f'    <inertial>{_origin(pose)}<mass value="{number(mass)}"/><inertia {moments}/></inertial>'


def _solids(shape: Shape) -> list[tuple[Array, str]]:
    """What stands for a shape, each in its frame."""
    ball = f'<sphere radius="{number(shape.radius)}"/>'
    rod = f'<cylinder radius="{number(shape.radius)}" length="{number(shape.length)}"/>'
    if shape.kind == "box":
        return [(IDENTITY, f'<box size="{numbers(shape.edges)}"/>')]
    if shape.kind == "sphere":
        return [(IDENTITY, ball)]
    if shape.kind == "capsule":
        return [*((posed([0, 0, end * shape.length]), ball) for end in (-0.5, 0.5)), (IDENTITY, rod)]
    if shape.kind == "cylinder":
        return [(IDENTITY, rod)]
    # URDF has no plane: a wide block whose top lies in it.
    return [(posed([0, 0, -0.5]), '<box size="10 10 1"/>')]


class _Writer:
    def __init__(self, model: Model, root: Optional[int] = None, tree: Sequence[int] = ()) -> None:
        """:param root: of one tree of bodies alone, which is the file's base; None: all, from the world"""
        self.model, self.root = model, root
        self.bodies = range(len(model.bodies)) if root is None else tree
        self.lines: list[str] = []
        # Of each body: its pose in its link frame, which is the frame of its joint.
        self.in_link = [IDENTITY] * len(model.bodies)
        for joint in reversed(model.joints):
            self.in_link[joint.child] = inverse(joint.child_frame)

    def run(self) -> str:
        model = self.model
        refuse([(joint.name, "a loop" if joint.closes_loop else "a ball joint", "a tree of hinges, universal joints and sliders, for URDF")
                for joint in model.joints if joint.closes_loop or joint.spherical] +
               [(shape.name, "a mesh, which URDF requires in a separate file", "a box, sphere, cylinder or capsule, for URDF")
                for shape in model.shapes if shape.kind == "convex_mesh"])
        self.lines += ['<?xml version="1.0"?>', '<robot name="handsim">']
        for body in self.bodies:
            self._link(body)
        for body in model.roots() if self.root is None else ():
            name = model.bodies[body].name
            self._joint(name + ".world", "fixed" if model.bodies[body].fixed else "floating", "world", name, model.start.poses[body])
        for joint in model.joints:
            if joint.child in self.bodies:
                self._joints(joint)
        return "\n".join([*self.lines, "</robot>", ""])

    def _link(self, index: int) -> None:
        body, at = self.model.bodies[index], self.in_link[index]
        self.lines.append(f'  <link name="{attribute(body.name)}">')
        if index:
            self.lines.append(_inertial(at, body.mass, body.inertia))
        for shape in self.model.shapes:
            if shape.body == index:
                pose = compose(at, shape.pose)
                for place, text in _solids(shape):
                    # A frame's own place needs no arithmetic: its digits stay.
                    origin = _origin(pose if place is IDENTITY else compose(pose, place))
                    self.lines += [f"    <{use}>{origin}<geometry>{text}</geometry></{use}>" for use in ("visual", "collision")]
        self.lines.append("  </link>")

    def _joint(self, name: str, kind: str, parent: str, child: str, pose: Array, more: str = "") -> None:
        self.lines += [f'  <joint name="{attribute(name)}" type="{kind}">',
                       f'    {_origin(pose)}<parent link="{attribute(parent)}"/><child link="{attribute(child)}"/>{more}', "  </joint>"]

    def _joints(self, joint: Joint) -> None:
        model = self.model
        child, parent = model.bodies[joint.child], model.bodies[joint.parent].name
        # The joint frame in the parent's link frame.
        at = compose(self.in_link[joint.parent], joint.parent_frame)
        if child.fixed:
            return self._joint(joint.name, "fixed", parent, child.name, at)
        for i, axis in enumerate(joint.axes):
            name = f"{joint.name}.{axis.name}"
            to = child.name if i + 1 == len(joint.axes) else name + ".middle"
            if to != child.name:
                middle = _inertial(IDENTITY, MIDDLE_MASS, MIDDLE_INERTIA * np.eye(3))
                self.lines += [f'  <link name="{attribute(to)}">', middle, "  </link>"]
            stopped, slides = model.stopped(axis), joint.slides[i]
            servo = model.servos.get(joint.first + i)
            far = 1e3 if slides else 2 * math.pi
            low, high = (axis.low, axis.high) if stopped else (-far, far)
            range_of = f'lower="{number(low)}" upper="{number(high)}" ' if stopped or slides else ""
            more = (f'<axis xyz="{numbers(axis.axis)}"/><limit {range_of}effort="{number(servo.limit if servo else UNLIMITED)}" '
                    f'velocity="{UNLIMITED:g}"/>')
            if model.passive(axis):
                more += f'<dynamics damping="{number(axis.damping)}" friction="0"/>'
            self._joint(name, "prismatic" if slides else "revolute" if stopped else "continuous", parent, to, at, more)
            parent, at = to, IDENTITY
        return None


def urdf_of(model: Model) -> str:
    """:raises Error: of kind input for what URDF cannot express without more files: ball joints, loops, meshes"""
    return _Writer(model).run()


def urdf_of_tree(model: Model, root: int, bodies: Sequence[int]) -> str:
    """Of a body and those that joints carry on it, without the world and the start.

    :raises Error: as `urdf_of`, of the whole model
    """
    return _Writer(model, root, bodies).run()
