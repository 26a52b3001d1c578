"""The hand of a person, as tables and as a model."""
from __future__ import annotations

import html
from functools import cached_property
from os import PathLike, fspath
from typing import Any, Mapping, NamedTuple, Optional, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _core
from ._errors import Error, Problem, flags, input_error, numbers, seed_of, whole
from ._glb import glb_of_model
from ._model import Model, SkinParts, bent, compose, inverse, skins_of
from ._pictures import Camera, Picture, html_picture
from ._scene import Scene, load
from ._shipped import data_path
from ._table import Quantities, Table, rows_table

MOST_PERSONS = 1_000_000
PERSON = "hands.0.person."
WHAT_IF = ("without", "transfers", "pulleys", "strength", "fused", "range_limits")

Point = Union[str, tuple[str, ArrayLike]]
"""A point of a hand: a fingertip, a body (its centre of mass), or a body and an offset [m] in its frame."""


def draw_persons(count: int, *, population: str = "ansur2", seed: int = 0) -> list[dict[str, Any]]:
    """Persons of a survey, as `Hand` and scenes take them: ``Hand(**person)``. Person k depends on seed and k alone.

    :param population: ``ansur2``: the US Army's of 2012, women and men with equal chances
    """
    drawn = _core.draw_persons(str(population), whole("count", count, 1, MOST_PERSONS), seed_of(seed), None)
    return [{"stature": stature, "mass": mass, "sex": sex} for stature, mass, sex in drawn]


class Poses(NamedTuple):
    """Frames of a hand's bodies in the hand frame; row i is body i of `Hand.bodies`."""

    position: NDArray[np.float64]
    """Centres of mass [m], shape (bodies, 3)."""
    quaternion: NDArray[np.float64]
    """w x y z, from body axes to those of the hand frame, shape (bodies, 4)."""


class Mesh(NamedTuple):
    """The skin of a hand: a closed surface. For the eye: contact is between the `shapes`."""

    vertices: NDArray[np.float64]
    """In the hand frame [m], shape (n, 3)."""
    faces: NDArray[np.uint32]
    """Rows of the corners of each triangle, counter-clockwise seen from outside, shape (m, 3)."""
    weights: NDArray[np.float64]
    """Share of each body in the motion of each vertex, shape (n, bodies); rows sum to 1, columns as `Hand.bodies`."""


class Hand:
    """A hand computed from body data. Can be pickled.

    Positions are in the hand frame H: origin at the wrist joint centre, y distal along the third ray, z dorsal (out
    of the back of the hand), x = y × z. Fingers are straight in the tables. Units are SI: m, kg, rad, N.
    """

    def __init__(self, stature: Optional[float] = None, mass: Optional[float] = None, sex: str = "unknown",
                 side: str = "right", *, model: Union[str, "PathLike[str]"] = "anatomical",
                 person: Union[str, "PathLike[str]", Mapping[str, Any], None] = None, muscles: bool = False,
                 what_if: Optional[Mapping[str, Any]] = None, **measures: float) -> None:
        """
        :param stature: [m], 0.5 to 2.5
        :param mass: of the body [kg], 2 to 400
        :param sex: ``male``, ``female`` or ``unknown``
        :param side: ``right`` or ``left``
        :param model: ``anatomical``, ``prototype``, or the path of a hand model file
        :param person: name of a shipped person (``median_man``), path of a person file, or a mapping with the keys of one,
            in place of all measures
        :param muscles: with the hand model's muscles and tendons, which exports then have, too
        :param what_if: what is changed of the hand, as the keys of a scene's hand: ``without`` (with muscles), ``transfers``,
            ``pulleys``, ``strength``, ``fused``, ``range_limits``
        :param measures: measured values in place of predicted ones: ``hand_length``, ``hand_breadth``,
            ``hand_circumference`` [m], ``hand_mass`` [kg], ``grip_strength`` [N], ``age`` [years],
            ``hand_length_percentile`` (0 to 100); a person file may also have bones, radii and fingers
        :raises Error: of kind input with every impossible value
        """
        flags(muscles=muscles)
        given: dict[str, Any] = {"stature": stature, "mass": mass, **measures}
        given = {key: value for key, value in given.items() if value is not None}
        who: Any = {**given, "sex": sex}
        if person is not None:
            if given:
                raise Error("person: got measures beside a person, need one of the two", "input",
                            [Problem(None, None, None, "person", "measures beside a person", "one of the two")])
            who = person if isinstance(person, Mapping) else _shipped(person, "config/persons")
        self.side = side
        hand = {"model": _shipped(model, "handmodels"), "person": who, "side": side,
                "wrist": {"mount": "fixed", "position": [0, 0, 0.2]}}
        if not isinstance(what_if, (Mapping, type(None))):
            raise input_error("what_if", what_if, "a mapping")
        changes = dict(what_if or {})
        for key in changes:
            if key not in WHAT_IF:
                raise input_error("what_if", key, f"one of {', '.join(WHAT_IF)}")
        scene: dict[str, Any] = {"title": f"{side} hand", "hands": [hand], "duration": "1 s",
                                 "pictures": {"view": "dorsal"}}
        try:
            # A hand model may have no tissue, as the prototype: auto has the effects that the model has data for.
            self.scene: Scene = load({**scene, "effects": "auto"})
            if muscles or changes:
                more = ["muscles", "tendon_coupling"] if muscles else []
                self.scene = load({**scene, "hands": [{**hand, **changes}], "effects": [*self.scene.effects, *more]})
        except Error as error:
            raise _of_arguments(error) from None

    @property
    def bodies(self) -> list[str]:
        """Names of the bodies: the palm, then the segments from base to tip; the rows of `segments` and `poses`."""
        return list(self.segments["name"])

    @property
    def coordinates(self) -> list[str]:
        """Names of the joint coordinates, e.g. ``index_mcp.flexion``: the order of ``q``, ``u`` and ``a`` [rad] in all
        functions below, and of the rows of `joints`."""
        return list(self.joints["name"])

    @cached_property
    def muscles(self) -> list[str]:
        """Names of the muscles, the rows of `moment_arms`; none without ``muscles=True``."""
        return [muscle.name.partition(".")[2] for muscle in self.scene.muscles]

    @cached_property
    def tips(self) -> Table:
        """The fingertips: name (``index_tip``), body, position [m] in the body's frame."""
        tips = self._model.hands[0].tips
        return Table({"name": [_part(name) for name, _, _ in tips], "body": [_part(self._model.bodies[body].name) for _, body, _ in tips],
                      "position[m]": np.array([point for _, _, point in tips])}, "fingertips")

    @cached_property
    def shapes(self) -> Table:
        """The geometry: name, body, kind (box, capsule, cylinder, sphere, convex_mesh), radius [m], length [m] (capsule:
        between the cap centres; both along the shape's z axis), edges [m] of a box, position [m] and quaternion (w x y z)
        in the body's frame."""
        own = [shape for shape in self._model.shapes if shape.body in self._model.hands[0].bodies]
        columns: dict[str, Any] = {"name": [_part(shape.name) for shape in own],
                                   "body": [_part(self._model.bodies[shape.body].name) for shape in own],
                                   "kind": [shape.kind for shape in own]}
        for key, of in (("radius[m]", [shape.radius for shape in own]), ("length[m]", [shape.length for shape in own]),
                        ("edges[m]", [shape.edges for shape in own]), ("position[m]", [shape.pose[:3] for shape in own]),
                        ("quaternion", [shape.pose[3:] for shape in own])):
            columns[key] = np.array(of)
        return Table(columns, "shapes")

    @property
    def _model(self) -> Model:
        return self.scene._model

    @cached_property
    def _skins(self) -> list[SkinParts]:
        return skins_of(self.scene._core)

    def poses(self, q: ArrayLike) -> Poses:
        """Forward kinematics: the frames of all bodies in H.

        :param q: joint coordinates [rad], shape (coordinates,); they may lie beyond the stops
        :return: positions [m], shape (bodies, 3), and quaternions, shape (bodies, 4). A body's frame has its origin at
            the centre of mass; with straight fingers its x axis is ulnar on a right hand, y distal, z dorsal
        """
        return Poses(*_core.hand_poses(self.scene._core, q))

    def mesh(self, q: Optional[ArrayLike] = None) -> Mesh:
        """The skin in a posture, made of the hand's shapes (some 14,000 triangles, 0.1 s; later calls 1 ms). Faces and
        weights do not depend on the posture.

        :param q: joint coordinates [rad], shape (coordinates,); default: straight fingers
        :return: vertices [m], shape (n, 3), faces, shape (m, 3), and weights, shape (n, bodies)
        """
        skin, bodies, poses = self._skins[0], self._model.hands[0].bodies, self.poses(np.zeros(len(self.coordinates)) if q is None else q)
        rows = [bodies.index(body) for body in skin.bodies]
        weights = np.zeros((len(skin.points), len(bodies)))
        weights[:, rows] = skin.weights
        points = bent(skin, np.concatenate([poses.position, poses.quaternion], axis=1)[rows])
        return Mesh(points, skin.faces.astype(np.uint32), weights)

    def to_glb(self, q: Optional[ArrayLike] = None, *, times: Optional[ArrayLike] = None) -> bytes:
        """The skin as binary glTF 2.0, with a skeleton and weights: Y up, metres. Viewers bend skin linearly, so it is
        thinner at bent joints than `mesh`.

        :param q: a posture, shape (coordinates,), default straight fingers; with times a motion, shape (times,
            coordinates) [rad]
        :param times: of an animation [s], rising, shape (times,)
        :return: the content of a ``.glb`` file
        :raises Error: of kind input for another shape
        """
        zero = np.zeros(len(self.coordinates))
        angles = numbers("q", zero if q is None else q, "angles [rad]")
        clock = None if times is None else numbers("times", times, "shape (times,)")
        if clock is not None and (clock.ndim != 1 or len(clock) == 0 or np.any(np.diff(clock) <= 0) or clock[0] < 0 or
                                  angles.shape != (len(clock), len(zero))):
            raise input_error("times", f"shapes {clock.shape} and {angles.shape}",
                              f"rising times of 0 or more, shape (times,), and q of shape (times, {len(zero)})")
        model = self._model
        moments = [self.poses(each) for each in (angles if clock is not None else angles[None])]
        poses = np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(moments), len(model.bodies), 1))
        for row, moment in zip(poses, moments):
            row[model.hands[0].bodies] = np.concatenate([moment.position, moment.quaternion], axis=1)
        names = [f"{self.side} hand", *(_part(body.name) for body in model.bodies[1:])]
        return glb_of_model(model, self._skins, poses, clock, names=names)

    def position(self, q: ArrayLike, point: Point) -> NDArray[np.float64]:
        """Forward kinematics of one point.

        :param q: joint coordinates [rad], shape (coordinates,)
        :param point: a fingertip (``index_tip``), a body (``index_distal``: its centre of mass), or a body and an offset
            [m], shape (3,), in the body's frame
        :return: position in H [m], shape (3,)
        """
        body, r = self._point(point)
        position, quaternion = self.poses(q)
        w, v = quaternion[body, 0], quaternion[body, 1:]
        return np.asarray(position[body] + r + 2 * np.cross(v, np.cross(v, r) + w * r))

    def jacobian(self, q: ArrayLike, point: Point) -> NDArray[np.float64]:
        """Jacobian J of a point: J u is its motion with a fixed palm, and J[:3].T f are the joint torques [N m] with
        which it presses with a force f [N] in H.

        :param q: joint coordinates [rad], shape (coordinates,)
        :param point: as in `position`
        :return: shape (6, coordinates), axes of H: rows 0 to 2 velocity of the point [m/rad], rows 3 to 5 angular
            velocity of its body [rad/rad]
        """
        return _core.hand_jacobian(self.scene._core, q, *self._point(point))

    def mass_matrix(self, q: ArrayLike) -> NDArray[np.float64]:
        """Joint-space mass matrix M [kg m^2] with a fixed palm: u.T M u / 2 is the kinetic energy [J].

        :param q: joint coordinates [rad], shape (coordinates,)
        :return: shape (coordinates, coordinates), symmetric, positive definite
        """
        return _core.hand_mass_matrix(self.scene._core, q)

    def inverse_dynamics(self, q: ArrayLike, u: ArrayLike, a: ArrayLike, *,
                         gravity: ArrayLike = (0, 0, -9.80665)) -> NDArray[np.float64]:
        """Joint torques of a motion with a fixed palm: M(q) a, with Coriolis and centrifugal terms, less gravity. Passive
        tissue, stops and muscles are part of these torques.

        :param q: joint coordinates [rad], shape (coordinates,)
        :param u: their rates [rad/s], shape (coordinates,)
        :param a: their accelerations [rad/s^2], shape (coordinates,)
        :param gravity: in H [m/s^2], shape (3,); default: the palm faces down
        :return: torques [N m], shape (coordinates,), positive along the coordinate
        """
        return _core.hand_inverse_dynamics(self.scene._core, q, u, a, gravity)

    def moment_arms(self, q: ArrayLike) -> NDArray[np.float64]:
        """Moment arms R of the muscles: R.T f are the joint torques [N m] of tendon tensions f [N].

        :param q: joint coordinates [rad], shape (coordinates,)
        :return: [m], shape (muscles, coordinates); positive where tension drives the coordinate up, 0 for those that a
            tendon does not cross
        :raises Error: of kind input for a hand without muscles
        """
        if not self.muscles:
            raise Error("muscles: got a hand without muscles, need Hand(..., muscles=True)", "input",
                        [Problem(None, None, None, "muscles", "a hand without muscles", "Hand(..., muscles=True)")])
        return _core.hand_muscles(self.scene._core, q)[0]

    def _point(self, point: Point) -> tuple[int, NDArray[np.float64]]:
        """Row of the body, and offset in its frame."""
        if not isinstance(point, str) and not (isinstance(point, (tuple, list)) and len(point) == 2 and isinstance(point[0], str)):
            raise input_error("point", repr(point)[:80], "a name, or a body and its offset [m]")
        name, offset = (point, (0.0, 0.0, 0.0)) if isinstance(point, str) else point
        if isinstance(point, str) and name in self.tips["name"]:
            tip = self.tips.row(self.tips["name"].index(name))
            name, offset = tip["body"], tip["position"]
        if name not in self.bodies:
            known = ", ".join([*self.tips["name"], *self.bodies])
            raise Error(f"point: got {name}, need one of {known}", "input",
                        [Problem(None, None, None, "point", name, f"one of {known}")])
        place = numbers("offset", offset, "shape (3,)", 1)
        if place.shape != (3,):
            raise input_error("offset", f"shape {place.shape}", "shape (3,)")
        return self.bodies.index(name), place

    @cached_property
    def dimensions(self) -> Quantities:
        """Size of the hand: length (wrist to middle fingertip), breadth, palm_length, circumference, thickness,
        thumb_length, index_length, middle_length (from the crease at the base) and centre_of_mass (from the wrist) in m,
        mass in kg, grip_strength in N: ``dimensions["length"]``, ``dimensions.units["length"]``."""
        return Quantities(_core.hand_dimensions(self.scene._core))

    @cached_property
    def segments(self) -> Table:
        """The palm and the segments: name, proximal joint, parent (row of the body that carries it; -1: none), length [m],
        radius [m], mass [kg], centre_of_mass [m] in H, inertia [kg m^2] about the centre of mass along the segment's x, y (distal) and z axes."""
        return Table(_core.hand_segments(self.scene._core), "segments")

    @cached_property
    def joints(self) -> Table:
        """Every axis: name, type of its joint, low [rad] and high [rad] of its stop, stiffness [N m/rad],
        damping [N m s/rad] and rest [rad] of passive tissue, centre [m] of the joint in H. Flexion is positive toward
        the palm."""
        model, hand = self._model, self._model.hands[0]
        to_hand = inverse(compose(model.bodies[hand.palm].zero, hand.wrist))
        rows = [(joint, axis) for joint in (model.joints[i] for i in hand.joints) for axis in joint.axes]
        columns: dict[str, Any] = {"name": [f"{_part(joint.name)}.{axis.name}" for joint, axis in rows],
                                   "type": ["hinge" if len(joint.axes) == 1 else "universal" for joint, _ in rows]}
        for key, unit in (("low", "rad"), ("high", "rad"), ("stiffness", "N m/rad"), ("damping", "N m s/rad"), ("rest", "rad")):
            columns[f"{key}[{unit}]"] = np.array([getattr(axis, key) for _, axis in rows])
        columns["centre[m]"] = np.array([compose(to_hand, compose(model.bodies[joint.child].zero, joint.child_frame))[:3] for joint, _ in rows])
        return Table(columns, "joints")

    def to_mjcf(self) -> str:
        """The hand as MJCF, MuJoCo's format, with a fixed palm."""
        return self.scene.to_mjcf()

    def to_urdf(self) -> str:
        """The hand as URDF, with a fixed palm. :raises Error: of kind input for a hand model with meshes"""
        return self.scene.to_urdf()

    def to_osim(self) -> str:
        """The hand as .osim, OpenSim 4's format, with a fixed palm."""
        return self.scene.to_osim()

    def draw(self, *, size: Optional[tuple[int, int]] = None, view: Optional[str] = None,
             camera: Optional[Camera] = None) -> Picture:
        """A picture, from the back of the hand; options as in `Scene.draw`."""
        return self.scene.draw(size=size, view=view, camera=camera)

    def __repr__(self) -> str:
        size = self.dimensions
        return (f"<handsim.Hand: {self.side}, {1e3 * size['length']:.1f} mm long, "
                f"{1e3 * size['breadth']:.1f} mm broad, {1e3 * size['mass']:.0f} g>")

    def _repr_html_(self) -> str:
        sizes = self.dimensions
        table = rows_table(["dimension", "value", "unit"], [(name, sizes[name], sizes.units[name]) for name in sizes])
        picture = html_picture(self.draw(size=(480, 480)), 320) if _core.has_pictures() else ""
        notes = "".join(f"<p>{html.escape(text)}</p>" for text in self.scene.warnings)
        return table._repr_html_() + notes + picture + self.segments._repr_html_() + self.joints._repr_html_()


def _part(name: str) -> str:
    """A name without that of the hand."""
    return name.partition(".")[2]


def _shipped(name: Union[str, "PathLike[str]"], folder: str) -> str:
    """The path of a shipped file by name, or the path as given."""
    shipped = data_path() / folder / f"{fspath(name)}.yaml"
    return str(shipped) if shipped.exists() else fspath(name)


def _of_arguments(error: Error) -> Error:
    """The error of a scene as one of the arguments: without its place, keys without their block."""
    def renamed(problem: Problem) -> Problem:
        problem = problem._replace(key=problem.key.replace(PERSON, "").replace("hands.0.", ""))
        in_file = problem.file not in (None, "scene")
        return problem if in_file else problem._replace(file=None, line=None, column=None)

    problems = [renamed(each) for each in error.problems]
    text = "\n".join(f"{f'{p.file}:{p.line}:{p.column}: ' if p.file else ''}{p.key}: got {p.got}, need {p.need}"
                     for p in problems)
    return Error(text, error.kind, problems, error.fault)
