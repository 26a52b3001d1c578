"""Files and text of forces between hands and an object."""
from __future__ import annotations

import math
from itertools import chain
from pathlib import Path
from typing import Any, Callable, Iterator, NamedTuple, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._forces import STATES, Result
from ._forces_frames import Asked
from ._objects import Thing
from ._study_files import json_file, number, origin, plain

Array = NDArray[np.float64]
NAMES = ["contact_forces.csv", "contact_forces.sto", "loads.csv", "object.csv", "torques.sto", "activations.sto", "forces.json", "forces.csv", "forces.gp", "forces.html",
         "finger_forces.png", "finger_forces.svg"]
BLOCK = 2048
"""Rows of a table."""
FEW = 5.0
"""Percent of the lifted frames: with so many the strength may be too little for the heaviest mass, as single frames are noise."""
PARTS = ("x[m]", "y[m]", "z[m]", "qw", "qx", "qy", "qz")


def _number(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.6g}"


class Column(NamedTuple):
    """Of a table."""

    name: str
    values: NDArray[Any]
    text: Callable[[Any], str] = _number


def _blocks(count: int) -> Iterator[slice]:
    """Of rows whose text is in memory at once."""
    for first in range(0, count, BLOCK):
        yield slice(first, first + BLOCK)


def _rows(times: Array, columns: Sequence[Column]) -> Iterator[bytes]:
    """Text of a table, a block of rows after the other."""
    yield (",".join(["time[s]", *(column.name for column in columns)]) + "\n").encode()
    for rows in _blocks(len(times)):
        texts = [map(column.text, column.values[rows].tolist()) for column in columns]
        yield ("\n".join(map(",".join, zip((f"{time:.12g}" for time in times[rows]), *texts))) + "\n").encode()


def contact_columns(of: Result, figures: "Figures") -> list[Column]:
    """A row for each frame: its state, the wrench, what is left of it, by finger normal forces with bands, by segment force, centre and friction."""
    columns = [Column("state", of.state, STATES.__getitem__), Column("load", of.load)]
    for what, values in (("wrench", of.wrench), ("residual", of.residual)):
        for k, name in enumerate(("force.x[N]", "force.y[N]", "force.z[N]", "moment.x[N m]", "moment.y[N m]", "moment.z[N m]")):
            columns.append(Column(f"{what}.{name}", values[:, k]))
    columns.append(Column("residual.share", of.share))
    for i, finger in enumerate(of.fingers):
        if not figures.pressing[i]:
            continue
        columns.append(Column(f"{finger}.normal[N]", of.by_finger[:, i]))
        if of.bands is not None:
            columns += [Column(f"{finger}.normal.{word}[N]", of.bands[:, i, k]) for k, word in enumerate(("low", "high"))]
    for i in figures.touching:
        name = of.segments[i]
        if name not in of.fingers:  # the palm is a finger of its own
            columns.append(Column(f"{name}.normal[N]", of.normal[:, i]))
        columns += [Column(f"{name}.force.{axis}[N]", of.force[:, i, k]) for k, axis in enumerate("xyz")]
        columns += [Column(f"{name}.{axis}[m]", of.centre[:, i, k]) for k, axis in enumerate("xyz")]
        columns += [Column(f"{name}.friction", of.used[:, i]), Column(f"{name}.gap[mm]", of.gap[:, i], lambda gap: _number(1e3 * gap))]
    return columns


LOADS = b"time[s],body,x[m],y[m],z[m],force.x[N],force.y[N],force.z[N]\n"


def load_rows(of: Result, touch: Sequence[int]) -> Iterator[bytes]:
    """The forces on the hands, for `handsim inverse --loads`, without their head. A segment without a force has a row of zero beside those with one."""
    for rows in _blocks(len(of.times)):
        lines = []
        for row, time in enumerate(of.times[rows].tolist(), rows.start):
            for i in touch:
                if of.normal[max(0, row - 1):row + 2, i].max() > 1e-6:
                    place = np.nan_to_num(of.centre[row, i])
                    lines.append(",".join([f"{time:.12g}", of.segments[i], *(f"{each:.7g}" for each in (*place, *-of.force[row, i]))]) + "\n")
        yield "".join(lines).encode()


def object_columns(name: str, of: Result) -> list[Column]:
    poses = of.motion.poses
    moving = [("velocity", of.motion.velocity, "m/s"), ("angular_velocity", of.motion.turning, "rad/s"), ("acceleration", of.motion.acceleration, "m/s^2"),
              ("angular_acceleration", of.motion.turning_up, "rad/s^2")]
    columns = [Column(f"object.{name}.{part}", poses[:, k], number) for k, part in enumerate(PARTS)]
    return columns + [Column(f"object.{name}.{what}.{axis}[{unit}]", values[:, k]) for what, values, unit in moving for k, axis in enumerate("xyz")]


class Figures:
    """Of a recording, or of a part of it."""

    def __init__(self, of: Result, first: int = 0) -> None:
        """:param first: frame of the recording that is the first one here"""
        lifted, share = of.lifted, of.share
        self.frames, self.lifted = len(of.times), int(lifted.sum())
        self.counts = {state: int(np.count_nonzero(of.state == k)) for k, state in enumerate(STATES)}
        self.good, self.squares = int(np.count_nonzero(share[lifted] <= 0.1)), float((share[lifted]**2).sum())
        self.names, held = of.fingers, of.normal.sum(axis=1) > 1e-6
        self.held, self.peaks = int(held.sum()), of.by_finger.max(axis=0, initial=0)
        self.sums: Array = np.array([column[held].sum() for column in of.by_finger.T])
        self.strongest = of.normal.max(axis=0, initial=0)
        self.strong = of.heaviest[lifted & np.isfinite(of.heaviest)]
        self.effort = float(np.nanmax(of.effort)) if np.isfinite(of.effort).any() else math.nan
        inside = np.where(of.normal > 1e-6, of.gap, np.nan)
        self.deepest = -float(np.nanmin(inside)) if np.isfinite(inside).any() else math.nan
        too_deep = np.flatnonzero(np.nanmin(np.where(np.isfinite(inside), inside, np.inf), axis=1) < -2 * of.noise)
        apart = np.flatnonzero(lifted & ~of.touching.any(axis=1))
        self.too_deep, self.too_deep_at, self.apart_at = first + too_deep, of.times[too_deep], of.times[apart]
        used = of.used[lifted]
        self.used = float(np.nanmax(used)) if np.isfinite(used).any() else math.nan
        self.mass, self.noise, self.reach, self.ground, self.unsure, self.motion_noise = of.mass, of.noise, of.reach, of.ground, of.unsure, of.motion.noise

    @property
    def enough(self) -> float:
        """Share of the lifted frames whose residual is small."""
        return self.good / self.lifted if self.lifted else math.nan

    @property
    def residual(self) -> float:
        """RMS over the lifted frames, as a share of the weight."""
        return math.sqrt(self.squares / self.lifted) if self.lifted else math.nan

    @property
    def pressing(self) -> list[bool]:
        """By finger: it bears a force in some frame."""
        return [bool(peak > 1e-3) for peak in self.peaks]

    @property
    def touching(self) -> list[int]:
        """Segments that bear a force in some frame."""
        return [i for i, strongest in enumerate(self.strongest) if strongest > 1e-3]

    @property
    def fingers(self) -> dict[str, tuple[float, float]]:
        """Peak and mean of those that press [N]."""
        return {name: (float(peak), float(total / self.held)) for name, peak, total, own in zip(self.names, self.peaks, self.sums, self.pressing)
                if own and self.held}

    @property
    def heaviest(self) -> float:
        return float(np.percentile(self.strong, FEW)) if len(self.strong) else math.nan

    def add(self, other: "Figures") -> None:
        """Those of the part of the recording that comes next; its fingers and segments are the same."""
        before, after = (max(1e-9, each.frames - each.counts["unseen"]) for each in (self, other))
        for name in ("frames", "lifted", "good", "squares", "held", "sums"):
            setattr(self, name, getattr(self, name) + getattr(other, name))
        self.counts = {state: count + other.counts[state] for state, count in self.counts.items()}
        self.peaks, self.strongest = np.maximum(self.peaks, other.peaks), np.maximum(self.strongest, other.strongest)
        for name in ("strong", "too_deep", "too_deep_at", "apart_at"):
            setattr(self, name, np.concatenate([getattr(self, name), getattr(other, name)]))
        for name in ("effort", "deepest", "used"):
            setattr(self, name, float(np.fmax(getattr(self, name), getattr(other, name))))
        # Deviations: in the mean of squares, over frames in which the object was seen.
        own, its = before / (before + after), after / (before + after)
        self.unsure = np.sqrt(own * self.unsure**2 + its * other.unsure**2)
        self.motion_noise = math.hypot(math.sqrt(own) * self.motion_noise[0], math.sqrt(its) * other.motion_noise[0]), math.hypot(
            math.sqrt(own) * self.motion_noise[1], math.sqrt(its) * other.motion_noise[1])


def margin(figures: Figures, asked: Asked) -> float:
    """Friction over that which the most used pad takes, while lifted."""
    return asked.friction / figures.used if figures.used > 0 else math.nan


def strength_text(asked: Asked, figures: Figures) -> str:
    if asked.weighed:
        return f"effort {100 * figures.effort:.0f} % of the strength about an axis"
    return f"the strength about the joint axes suffices up to {figures.heaviest:.2g} kg"


def summary(thing: Thing, asked: Asked, figures: Figures, cpu: float, lifts: Sequence[dict[str, Any]]) -> str:
    out: dict[str, Any] = {
        "object": thing.name, "file": thing.file.name, "mass_kg": figures.mass, "frames": figures.frames, **figures.counts, "lifted": figures.lifted,
        "share_of_lifted_frames_with_residual_at_most_10_percent": figures.enough, "residual_share_rms": figures.residual,
        "wrench_deviation": figures.unsure.tolist(), "object_noise_mm": 1e3 * figures.motion_noise[0], "object_noise_deg": math.degrees(figures.motion_noise[1]),
        "touches_within_mm": 1e3 * figures.reach, "place_noise_mm": 1e3 * figures.noise, "deepest_mm": 1e3 * figures.deepest, "frames_too_deep": figures.too_deep.tolist()[:1000],
        "support_height_m": figures.ground, "friction": asked.friction, "margin_against_slip": margin(figures, asked),
        "mass_is_known": asked.weighed, "effort": figures.effort if asked.weighed else None, "heaviest_kg": figures.heaviest,
        "fingers": {finger: {"peak_N": peak, "mean_N": mean} for finger, (peak, mean) in figures.fingers.items()}, "lifts": list(lifts), "cpu_s": cpu,
        "cpu_ms_per_frame": 1e3 * cpu / max(1, figures.frames), **origin()}
    return json_file({key: None if isinstance(value, float) and math.isnan(value) else value for key, value in out.items()})


def plot_of(of: Result, whole: Figures) -> tuple[str, str, str]:
    """Of the table that stands beside it; `of` is the recording, or a part of it."""
    head = ["time[s]", *(column.name for column in contact_columns(of, whole))]
    curves = []
    fingers = [finger for finger in of.fingers if f"{finger}.normal[N]" in head]
    inks = ("#1b6ca8", "#c8553d", "#3a7d44", "#8a5a9e", "#b5834f", "#4a4a4a")
    for i, finger in enumerate(fingers):
        ink, column = inks[i % len(inks)], head.index(f"{finger}.normal[N]") + 1
        if of.bands is not None:
            curves.append(f"'contact_forces.csv' skip 1 using 1:{column + 1}:{column + 2} with filledcurves fs solid 0.18 lc rgb '{ink}' notitle")
        curves.append(f"'contact_forces.csv' skip 1 using 1:{column} with lines lw 1.6 lc rgb '{ink}' title '{plain(finger)}'")
    share = head.index("residual.share") + 1
    commands = ("  set multiplot layout 2,1\nset datafile separator ','\nset autoscale xfix\nset grid lc rgb '#d0d0d0'\nset key outside right top\n"
                "set lmargin 10\nset rmargin 24\nset ylabel 'normal force [N]'\nset yrange [0:*]\n"
                f"plot {', '.join(curves) or '0 notitle'}\nset xlabel 'time [s]'\nset ylabel 'share of the weight'\n"
                f"plot 'contact_forces.csv' skip 1 using 1:{share} with lines lw 1.4 lc rgb '#c8553d' title 'residual', "
                "0.1 with lines dt 2 lc rgb '#808080' title 'limit'\nunset multiplot\nset yrange [*:*]\nunset xlabel\n")
    return "finger_forces", "noenhanced size 1200,800 font 'DejaVu Sans,10'", commands


def figure_rows(figures: Figures) -> bytes:
    """Of forces.csv."""
    return ("finger,peak[N],mean[N]\n" + "".join(f"{finger},{number(peak)},{number(mean)}\n" for finger, (peak, mean) in figures.fingers.items())).encode()


def motions(thing: Thing, of: Result) -> Iterator[tuple[str, str, list[str], Array, Array]]:
    """Name, title, columns, times and values of the files .sto."""
    yield "contact_forces.sto", f"{thing.name}: normal forces [N]", of.fingers, of.times, of.by_finger
    torque = np.isfinite(of.torque).all(axis=1)
    yield "torques.sto", f"{thing.name}: torques about the joint axes with the contacts [N m]", of.axes, of.times[torque], of.torque[torque]
    if of.muscles:
        active = np.isfinite(of.activation).all(axis=1)
        yield "activations.sto", f"{thing.name}: activations", of.muscles, of.times[active], of.activation[active]


def tables(thing: Thing, of: Result, whole: Figures) -> dict[str, Iterator[bytes]]:
    """Texts of the tables, each with its head first. :param whole: of the whole recording"""
    return {"contact_forces.csv": _rows(of.times, contact_columns(of, whole)), "loads.csv": chain([LOADS], load_rows(of, whole.touching)),
            "object.csv": _rows(of.times, object_columns(thing.name, of))}


def write(thing: Thing, asked: Asked, of: Result, cpu: float, out: Path, lifts: Sequence[dict[str, Any]] = ()) -> bool:
    """:returns: False if gnuplot is missing or fails"""
    figures = Figures(of)
    for name, parts in tables(thing, of, figures).items():
        _core.write_parts(out / name, parts)
    _core.write_file(out / "forces.json", summary(thing, asked, figures, cpu, lifts).encode())
    _core.write_file(out / "forces.csv", figure_rows(figures))
    for name, title, columns, times, values in motions(thing, of):
        _core.write_motion(out / name, title, columns, False, len(times), times, values)
    drawn: bool = _core.write_plots(out, "forces", "", [plot_of(of, figures)])
    return drawn


def screen_text(thing: Thing, asked: Asked, figures: Figures, cpu: float) -> str:
    counts = figures.counts
    weight = f"{1e3 * figures.mass:.4g} g" if asked.weighed else "of unknown mass, forces for each kilogram"
    out = (f"{thing.name}: {weight}, {figures.frames} frames: {counts['held']} held, {counts['supported']} on its support and touched, "
           f"{counts['apart']} apart, {counts['short']} with too little contact, {counts['unseen']} unseen; noise {1e3 * figures.motion_noise[0]:.2g} mm, "
           f"{math.degrees(figures.motion_noise[1]):.2g} deg\n")
    if figures.lifted:
        out += (f"  residual at most 10 % of the weight in {100 * figures.enough:.0f} % of {figures.lifted} lifted frames; RMS {100 * figures.residual:.3g} % "
                "(every frame: residual.share of contact_forces.csv)\n")
    for finger, (peak, mean) in figures.fingers.items():
        out += f"  {finger:<16} {peak:6.2f} N at most, {mean:6.2f} N in the mean\n"
    if figures.fingers:
        out += f"  margin against slip {margin(figures, asked):.3g} with friction {asked.friction:g}; {strength_text(asked, figures)}\n"
    if len(figures.too_deep):
        first = ", ".join(f"{time:.2f}" for time in figures.too_deep_at[:5])
        out += (f"  hand and object are more than twice their noise of {1e3 * figures.noise:.1f} mm inside each other in {len(figures.too_deep)} frames, up to "
                f"{1e3 * figures.deepest:.1f} mm (at {first} s{', ...' if len(figures.too_deep) > 5 else ''})\n")
    if len(figures.apart_at):
        first = ", ".join(f"{time:.2f}" for time in figures.apart_at[:5])
        out += (f"  lifted, but nothing within {1e3 * figures.reach:.1f} mm in {len(figures.apart_at)} frames (at {first} s"
                f"{', ...' if len(figures.apart_at) > 5 else ''})\n")
    return out + "  how hard opposite fingers squeeze does not show in motion: it is what people take, docs/forces.md\n" + f"  {cpu:.3g} s of CPU time\n"
