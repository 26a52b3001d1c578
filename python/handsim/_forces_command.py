"""Forces of a tracked recording: the part of ``handsim track`` that --object asks for."""
from __future__ import annotations

import re
import time
from pathlib import Path
from typing import Any, NamedTuple, Optional, Sequence

import numpy as np

from . import _core, _forces, _forces_files, _forces_frames, _forces_hands, _forces_page, _replay, _track
from ._c3d import is_c3d
from ._errors import Error, input_error
from ._guess import Guess
from ._hand import Hand
from ._model import compose
from ._objects import Course, Thing, read_courses, read_object
from ._progress import Told
from ._shipped import data_path
from ._study_files import real_of, whole_option

SUPPORTS = ("table", "post", "none")
FREE = "free"
"""In place of a mass that nobody knows."""
LIGHTEST, HEAVIEST = 1e-3, 200.0
"""Masses of objects [kg]."""
UP = re.compile(r"^ *up: *(-?y|z)\b", re.MULTILINE)
FROM_Y = {"y": np.array([0, 0, 0, np.sqrt(0.5), np.sqrt(0.5), 0, 0]), "-y": np.array([0, 0, 0, np.sqrt(0.5), -np.sqrt(0.5), 0, 0])}
"""The world of a recording whose y axis points up, or down."""


class Request(NamedTuple):
    """What is asked for of an object."""

    thing: Thing
    course: Course
    asked: _forces_frames.Asked
    replay: bool = False
    """Simulates the lifts."""


def request(options: dict[str, Any], recording: Path) -> Optional[Request]:
    """Of the command's options; None without an object. :raises Error: of kind input"""
    others = [name for name in ("--friction", "--support", "--uncertain", "--muscles", "--replay", "--mass") if name in options]
    if "--object" not in options:
        if others:
            raise input_error(others[0], "no object", "--object NAME=FILE beside it")
        return None
    support = _track.choice(options, "--support", SUPPORTS) or "table"
    friction = real_of("--friction", options["--friction"], 0.05, 3, "a coefficient, 0.05 to 3") if "--friction" in options else _forces_frames.FRICTION
    # A friction that was measured is known to a tenth.
    spread = 0.1 * friction if "--friction" in options else _forces_frames.FRICTION_SPREAD
    draws = whole_option(options, "--uncertain", 2, 1000) or 0
    thing = read_object(options["--object"])
    weighed = options.get("--mass") != FREE
    mass: Optional[float] = None
    if "--mass" in options:
        mass = _core.parse_mass(options["--mass"]) if weighed else 1.0
        if mass is None or not LIGHTEST <= mass <= HEAVIEST:
            raise input_error("--mass", options["--mass"], f'a mass such as "350 g", {LIGHTEST:g} to {HEAVIEST:g} kg, or {FREE} for one that nobody knows')
    beside = [name for name in ("--muscles", "--replay") if name in options]
    if not weighed and beside:
        raise input_error(beside[0], f"--mass {FREE} beside it", "a mass: what muscles do and whether an object is held depends on it")
    labels = options.get("--names")
    course = read_courses(recording, [thing.name], None if labels is None else Path(labels), options.get("--up"))[thing.name]
    asked = _forces_frames.Asked(friction, spread, support, "--muscles" in options, draws, whole_option(options, "--seed", 0, 2**32 - 1) or 1, weighed)
    return Request(thing if mass is None else thing.of_mass(mass), course, asked, "--replay" in options)


def upright(asked: _track.Asked, guess: Guess, course: Course) -> Course:
    """In a world whose z axis points up; the reader of C3D has turned it."""
    if is_c3d(asked.recording):
        return course
    file = asked.points or (data_path() / f"handmodels/points/{guess.name}.yaml" if guess.name else None)
    said = UP.search(file.read_text(encoding="utf-8")) if file else None
    up = asked.up or (said[1] if said else "z")
    if asked.left_handed:
        raise input_error("--handedness", "left beside an object", "a recording with right-handed axes")
    return course if up == "z" else course._replace(poses=compose(np.broadcast_to(FROM_Y[up], course.poses.shape), course.poses))


def _hand(person: Path, side: str, model: Path, muscles: bool) -> Hand:
    """With muscles, for strengths, where its model has any. :raises Error: of kind input where it has none and they are asked for"""
    try:
        return Hand(person=person, side=side, model=model, muscles=True)
    except Error:
        if muscles:
            raise
        return Hand(person=person, side=side, model=model)


def motions(asked: _track.Asked, tracked: Sequence[_track.Hand], person: Path, muscles: bool) -> list[_forces_hands.HandMotion]:
    """:param tracked: hands that are tracked in the recording"""
    out = []
    for each in tracked:
        hand = _hand(person, each.name, _track.model_file(asked), muscles)
        names = list(hand.coordinates)
        order = [each.axes.index(name if name in each.axes else f"{each.name}.{name}") for name in names]
        seen = each.status == 0
        q = np.where(seen[:, None], np.nan_to_num(each.angles[:, order]), np.nan)
        rms = float(np.sqrt(np.mean(each.rms[seen]**2))) if seen.any() else 0.0
        out.append(_forces_hands.HandMotion(each.name, hand, q, np.where(seen[:, None], each.wrist, np.nan), each.noise, rms))
    return out


def folder_of(of: Request, asked: _track.Asked, out: Path) -> _core.OutputFolder:
    """For the files of forces."""
    return _core.output_folder(out / "forces", _forces_files.NAMES, [asked.recording, of.thing.file])


def find(of: Request, asked: _track.Asked, found: _track.Result, out: Path, told: Told = None) -> tuple[str, bool]:
    """Finds the forces and writes their files. :returns: the text for the screen, and False if gnuplot is missing or fails"""
    folder = folder_of(of, asked, out)
    course = upright(asked, found.guess, of.course)
    course = course._replace(times=course.times - found.start)
    begin = time.process_time()
    hands = motions(asked, [each for each in found.hands if len(each.tracked)], out / "person.yaml", of.asked.muscles)
    solver = _forces_frames.Solver(of.thing, found.times, course, hands, of.asked)
    result = _forces.solve(solver, told)
    cpu = time.process_time() - begin
    folder.clear()
    replayed = _replay.replay(of.thing, solver, result, _track.model_file(asked), out / "forces", told) if of.replay else []
    drawn = _forces_files.write(of.thing, of.asked, result, cpu, out / "forces", _replay.figures(replayed))
    figures = _forces_files.Figures(result)
    rows = np.arange(0, figures.frames, _forces_page.every(figures.frames))
    _core.write_file(out / "forces/forces.html", _forces_page.page(of.thing, of.asked, _forces_page.drawn(solver, result, rows), figures))
    return _forces_files.screen_text(of.thing, of.asked, figures, cpu) + _replay.text(replayed), drawn
