"""The hand of a person, as tables and as a model."""
from __future__ import annotations

import html
from functools import cached_property
from os import PathLike, fspath
from typing import Any, Optional, Union

from . import _core
from ._errors import Error, Problem, flags
from ._pictures import Picture, html_picture
from ._scene import Camera, Scene, data_path, load
from ._table import Table, rows_table

PERSON = "hands.0.person."


class Hand:
    """A hand computed from body data. Can be pickled.

    Positions are in the hand frame H: origin at the wrist joint centre, y distal along the third ray, z dorsal (out
    of the back of the hand), x = y × z. Fingers are straight in the tables. Units are SI: m, kg, rad, N.
    """

    def __init__(self, stature: Optional[float] = None, mass: Optional[float] = None, sex: str = "unknown",
                 side: str = "right", *, model: Union[str, "PathLike[str]"] = "anatomical",
                 person: Union[str, "PathLike[str]", None] = None, muscles: bool = False, **measures: float) -> None:
        """
        :param stature: [m], 0.5 to 2.5
        :param mass: of the body [kg], 2 to 400
        :param sex: ``male``, ``female`` or ``unknown``
        :param side: ``right`` or ``left``
        :param model: ``anatomical``, ``prototype``, or the path of a hand model file
        :param person: name of a shipped person (``median_man``) or path of a person file, in place of all measures
        :param muscles: with the hand model's muscles and tendons, which exports then have, too
        :param measures: measured values in place of predicted ones: ``hand_length``, ``hand_breadth``,
            ``hand_circumference`` [m], ``hand_mass`` [kg], ``grip_strength`` [N], ``age`` [years],
            ``hand_length_percentile`` (0 to 100)
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
            who = _shipped(person, "config/persons")
        self.side = side
        hand = {"model": _shipped(model, "handmodels"), "person": who, "side": side,
                "wrist": {"mount": "fixed", "position": [0, 0, 0.2]}}
        effects = ["gravity", "joint_stops", "passive_tissue"]
        if muscles:
            effects += ["muscles", "tendon_coupling"]
        for without in ("", "passive_tissue"):
            try:
                self.scene: Scene = load({
                    "title": f"{side} hand", "hands": [hand], "duration": "1 s", "pictures": {"view": "dorsal"},
                    "effects": [effect for effect in effects if effect != without]})
                break
            except Error as error:
                # A hand model may have no tissue, as the prototype.
                if not any(problem.got == "passive_tissue without tissue" for problem in error.problems):
                    raise _of_arguments(error) from None

    @cached_property
    def dimensions(self) -> dict[str, float]:
        """Size of the hand: length (wrist to middle fingertip), breadth, palm_length, circumference, thickness and
        centre_of_mass (from the wrist) in m, mass in kg, grip_strength in N."""
        return _core.hand_dimensions(self.scene._core)

    @cached_property
    def segments(self) -> Table:
        """The palm and the segments: name, proximal joint, length[m], radius[m], mass[kg], centre_of_mass[m] in H,
        inertia[kg m^2] about the centre of mass along the segment's x, y (distal) and z axes."""
        return Table(_core.hand_segments(self.scene._core), "segments")

    @cached_property
    def joints(self) -> Table:
        """Every axis: name, type of its joint, low[rad] and high[rad] of its stop, stiffness[N m/rad],
        damping[N m s/rad] and rest[rad] of passive tissue, centre[m] of the joint in H. Flexion is positive toward
        the palm."""
        return Table(_core.hand_joints(self.scene._core), "joints")

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
        return (f"<handsim.Hand: {self.side}, {1e3 * size['length[m]']:.1f} mm long, "
                f"{1e3 * size['breadth[m]']:.1f} mm broad, {1e3 * size['mass[kg]']:.0f} g>")

    def _repr_html_(self) -> str:
        table = rows_table(["dimension", "value"], list(self.dimensions.items()))
        picture = html_picture(self.draw(size=(480, 480)), 320) if _core.has_pictures else ""
        notes = "".join(f"<p>{html.escape(text)}</p>" for text in self.scene.warnings)
        return table._repr_html_() + notes + picture + self.segments._repr_html_() + self.joints._repr_html_()


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
