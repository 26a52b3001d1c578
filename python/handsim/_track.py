"""What `track` makes of recorded hands, and its files. The C++ reads the recording and fits the hands; `_track_command` is the command."""
from __future__ import annotations

import math
import os
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Callable, Mapping, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._c3d import as_csv, is_c3d
from ._errors import Error, input_error, renamed
from ._files import NewFolder
from ._guess import JOINTS, Guess, check_order, guess, points_of, sample
from ._objects import without_objects
from ._progress import Told
from ._shipped import data_path
from ._study_files import json_file, number, origin, study_names

Array = NDArray[np.float64]
STATUSES = ("tracked", "missing", "swapped", "poor")
INKS = ("#1b6ca8", "#c8553d")
"""Of the hands."""
CUTOFF = 6.0
"""Of the filter of the scene [Hz]; a motion of fewer frames a second has none."""
DEGREES = 1 / (math.pi / 180)


class Asked(NamedTuple):
    """What is tracked."""

    recording: Path
    person: Optional[Path] = None
    """None: the median man."""
    model: Optional[Path] = None
    """None: the anatomical hand."""
    markers: Optional[Path] = None
    truth: Optional[Path] = None
    fit_bones: bool = True
    smooth: bool = True
    noise: float = 0
    seed: int = 1
    names: Optional[Path] = None
    up: Optional[str] = None
    """y or z; None: as the recording or the convention says."""
    points: Optional[Path] = None
    """Convention of the tracker."""
    left_handed: Optional[bool] = None
    """Axes; None: as the convention says."""


class Hand(NamedTuple):
    """One hand of a recording; rows are frames."""

    name: str
    axes: list[str]
    determined: list[bool]
    """By axis: a feature moves with it."""
    features: list[str]
    status: NDArray[np.intp]
    """Index of STATUSES."""
    rms: Array
    """Distance of the points from the fit [m]; NaN where nothing was fitted."""
    angles: Array
    """Of all axes [rad]."""
    wrist: Array
    """x y z [m] and quaternion w x y z, in the world."""
    distances: Array
    """By feature [m]; NaN: not measured, or left out."""
    overlaps: tuple[int, int, list[tuple[str, float, float]]]
    """Frames tested, those with an overlap; by pair of parts the deepest one [m] and its time [s]."""
    truth: list[tuple[str, float]]
    """RMS difference from known angles, by axis [rad]."""
    noise: float
    """Of a coordinate [m]."""

    def rows(self, rows: slice) -> "Hand":
        """Of some frames."""
        return self._replace(**{name: getattr(self, name)[rows] for name in ("status", "rms", "angles", "wrist", "distances")})

    @property
    def deepest(self) -> tuple[str, float, float]:
        """Of the overlaps."""
        return max(self.overlaps[2], key=lambda each: each[1], default=("", 0.0, 0.0))

    @property
    def tracked(self) -> NDArray[np.intp]:
        return np.flatnonzero(self.status == 0)

    def count(self, status: str) -> int:
        return int(np.count_nonzero(self.status == STATUSES.index(status)))

    def difference(self, fingers: bool) -> Optional[float]:
        """RMS over the axes, or over the flexion axes of the fingers alone [rad]; None without any."""
        found = [rms for axis, rms in self.truth if not fingers or axis.endswith(".flexion") and not axis.startswith("thumb")]
        return math.sqrt(sum(rms * rms for rms in found) / len(found)) if found else None


class Between(NamedTuple):
    """Where two hands were inside each other, before their wrists were moved apart."""

    frames: int
    depth: float
    """The deepest [m]."""
    time: float
    """Of it [s]."""
    where: str
    moved: float
    """Of each wrist, at most [m]."""


class Result(NamedTuple):
    """What was tracked."""

    times: Array
    start: float
    """Time in the recording that is 0 in the files [s]."""
    cpu: float
    """Of the fits [s]."""
    warnings: list[str]
    hands: list[Hand]
    between: Between
    title: str
    """Of the person."""
    named: bool
    """Whether the person was named."""
    size: dict[str, float]
    """hand_length and hand_breadth [m], where they are known."""
    bones: dict[str, float]
    shares: Array
    """Where the points of a hand lie on their segments, if that was fitted; else no row."""
    person: str
    """Text of person.yaml."""
    guess: Guess
    """What the points were taken for, and by what."""


def hand_files(times: Array, hand: Hand) -> dict[str, str]:
    """Angles and wrist poses of the tracked frames."""
    axes = [i for i, each in enumerate(hand.determined) if each]
    head = "\t".join(["time", *(f"{hand.name}.{hand.axes[i]}" for i in axes)])
    rows = hand.tracked
    angles, labels = (DEGREES * hand.angles[rows][:, axes]).tolist(), [f"{times[row]:.12g}" for row in rows]
    mot = [f"{hand.name} hand, tracked\nversion=1\nnRows={len(rows)}\nnColumns={len(axes) + 1}\ninDegrees=yes\nendheader", head,
           *("\t".join([label, *map(number, row)]) for label, row in zip(labels, angles))]
    wrist = [",".join(["time[s]", *(f"{hand.name}.wrist.{part}" for part in ("x[m]", "y[m]", "z[m]", "qw", "qx", "qy", "qz"))]),
             *(",".join([label, *map(number, row)]) for label, row in zip(labels, hand.wrist[rows].tolist()))]
    files = {f"{hand.name}.mot": mot, f"{hand.name}_wrist.csv": wrist}
    return {name: "\n".join(lines) + "\n" for name, lines in files.items() if axes or lines is wrist}


def frames_text(of: Result) -> str:
    """Status and residuals of every frame; an empty field is a point that was not seen or was left out."""
    head = ["time[s]"]
    columns = [[f"{time:.12g}" for time in of.times]]
    for hand in of.hands:
        head += [f"{hand.name}.status", f"{hand.name}.rms[mm]", *(f"{feature}[mm]" for feature in hand.features)]
        columns.append([STATUSES[each] for each in hand.status])
        columns += [["" if math.isnan(value) else f"{value:.4g}" for value in (1e3 * column).tolist()] for column in (hand.rms, *hand.distances.T)]
    return "\n".join([",".join(head), *map(",".join, zip(*columns))]) + "\n"


def _filter_of(of: Result) -> str:
    """Nothing where a hand has too few tracked frames a second for such a filter."""
    for hand in of.hands:
        times = of.times[hand.tracked]
        if len(times) > 1 and len(times) - 1 < 2.001 * CUTOFF * (times[-1] - times[0]):
            return ""
    return f', filter: "{CUTOFF:g} Hz"'


def scene_text(asked: Asked, of: Result, first: Mapping[str, Array]) -> str:
    """A scene in which the tracked hands move. :param first: their angles where they are tracked first"""
    smooth, programs, seen = _filter_of(of), [], [hand for hand in of.hands if len(hand.tracked)]
    out = (f"# Written by handsim track from {asked.recording.name}. Frames without a tracked hand have no angles: the motion runs on\n"
           "# between the neighbouring frames (frames.csv lists them).\ntitle: tracked hands\nhands:\n")
    for hand in seen:
        pose: dict[str, list[str]] = {}
        for axis, angle in zip(hand.axes, first[hand.name]):
            pose.setdefault(axis.partition(".")[0], []).append(f"{angle:.17g}")
        joints = ", ".join(f"{joint}: [{', '.join(angles)}]" for joint, angles in pose.items())
        out += (f'  - model: "{os.path.abspath(model_file(asked))}"\n    person: person.yaml\n    side: {hand.name}\n'
                f"    wrist: {{mount: driven, motion: {{table: {hand.name}_wrist.csv{smooth}}}}}\n    pose: {{{joints}}}\n")
        if any(hand.determined):
            programs.append(f"{hand.name}: {hand.name}.mot")
    # Markers of the palm alone show no angle: the fingers are at rest.
    if programs:
        out += (f'control:\n  controller: "{data_path() / "controllers/feed_forward.yaml"}"\n  program: {{{", ".join(programs)}}}\n'
                f"  motion: {{clamp: true{smooth}}}\n")
    end = max(of.times[hand.tracked[-1]] for hand in seen)
    return out + (f"effects: [gravity, joint_stops, passive_tissue, {'actuation, ' if programs else ''}wrist_motion, self_contact, friction]\n"
                  'solver: {engine: ode, method: world_step, step: "1 ms"}\n'
                  f'duration: {number(max(1e-3, math.floor(1e3 * end) * 1e-3))}\nrecord: {{every: "10 ms"}}\n')


def summary_rows(of: Result) -> str:
    out = "hand,frames,tracked,missing,swapped,poor,noise[mm],rms[mm],overlapping_frames,deepest_overlap[mm]\n"
    for hand in of.hands:
        rms = hand.rms[hand.tracked]
        counts = ",".join(str(hand.count(status)) for status in STATUSES)
        out += (f"{hand.name},{len(of.times)},{counts},{1e3 * hand.noise:.4g},{1e3 * math.sqrt(np.mean(rms**2)) if len(rms) else 0:.4g},"
                f"{hand.overlaps[1]},{1e3 * hand.deepest[1]:.3g}\n")
    return out


def summary_text(asked: Asked, of: Result) -> str:
    """Of summary.json."""
    hands = []
    for hand in of.hands:
        tested, overlapping, pairs = hand.overlaps
        entry: dict[str, Any] = {
            "hand": hand.name, **{status: hand.count(status) for status in STATUSES}, "noise_mm": 1e3 * hand.noise,
            "undetermined_axes": [axis for axis, each in zip(hand.axes, hand.determined) if not each],
            "overlaps": {"frames_tested": tested, "frames_overlapping": overlapping, "deepest_mm": 1e3 * hand.deepest[1],
                         "pairs": [{"where": where, "deepest_mm": 1e3 * depth, "time_s": time} for where, depth, time in pairs]}}
        if hand.truth:
            entry.update(difference_rms_deg=DEGREES * (hand.difference(False) or 0.0),
                         finger_flexion_difference_rms_deg=DEGREES * (hand.difference(True) or 0.0),
                         difference_by_axis_rms_deg={axis: DEGREES * rms for axis, rms in hand.truth})
        hands.append(entry)
    points = {"points": {name.partition(".")[2]: row for name, row in zip(of.hands[0].features, of.shares.tolist())}} if len(of.shares) else {}
    taken = {"name": of.guess.name} if of.guess.name else {}
    between = {"hands_overlap": {"frames": of.between.frames, "deepest_mm": 1e3 * of.between.depth, "time_s": of.between.time, "where": of.between.where,
                                 "moved_mm": 1e3 * of.between.moved}} if of.between.frames else {}
    convention = {"convention": {**taken, "by": of.guess.by}} if of.guess.by else {}
    return json_file({
        "recording": asked.recording.name, "frames": len(of.times), "start_s": of.start, "added_noise_mm": 1e3 * asked.noise, "cpu_s": of.cpu,
        "frames_of_a_hand_per_s": len(of.times) * len(of.hands) / of.cpu if of.cpu > 0 else 0.0, **origin(),
        "person": {"bones_mm": {bone: 1e3 * length for bone, length in of.bones.items()}, **{f"{key}_mm": 1e3 * value for key, value in of.size.items()}},
        **points, **convention, **between, "warnings": of.warnings, "hands": hands})


def _angle_plot(hand: Hand) -> tuple[str, str, str]:
    """Angles of one hand by finger, from its .mot."""
    names = [axis for axis, each in zip(hand.axes, hand.determined) if each and not axis.startswith("wrist")]
    commands = (f"  set multiplot layout 5,1 title '{hand.name} hand: tracked joint angles'\nset datafile separator '\\t'\n"
                "set autoscale xfix\nset grid lc rgb '#d0d0d0'\nset key outside right top\nset lmargin 10\nset rmargin 34\nset ylabel 'angle [deg]'\n")
    panels = _core.hand_panels(names, lambda i, colour: f"'{hand.name}.mot' skip 7 using 1:{i + 2} with lines lw 1.4 lc rgb '{colour}' title '{names[i]}'")
    for part, drawn in panels:
        last = "set xlabel 'time [s]'\n" if part == panels[-1][0] else ""
        commands += f"{last}set title '{part}'\n{drawn}"
    return f"{hand.name}_angles", f"noenhanced size 1200,{60 + 220 * 5} font 'DejaVu Sans,10'", commands + "  unset multiplot\nunset xlabel\n"


def _residual_plot(of: Result) -> tuple[str, str, str]:
    """RMS distance of each frame, and the frames that are marked."""
    curves, column = [], 2
    for index, hand in enumerate(of.hands):
        seen, ink, name = f"strcol({column}) eq 'tracked'", INKS[index], hand.name
        curves.append(f"'frames.csv' skip 1 using 1:({seen} ? ${column + 1} : NaN) with lines lw 1.4 lc rgb '{ink}' title '{name}', "
                      f"'' skip 1 using 1:({seen} ? NaN : 0) with points pt {5 + 2 * index} lc rgb '{ink}' title '{name}: no hand'")
        column += 2 + len(hand.features)
    commands = ("  set datafile separator ','\nset grid lc rgb '#d0d0d0'\nset xlabel 'time [s]'\nset ylabel 'RMS distance [mm]'\n"
                "set key outside right top\nset title 'distance of the points from the fitted hand'\nset yrange [0:1e-3<*]\nplot ")
    return "residuals", "noenhanced size 1200,420 font 'DejaVu Sans,10'", f"{commands}{', '.join(curves)}\n"


def names() -> list[str]:
    """Of all files."""
    return [*study_names("summary", ["right_angles", "left_angles", "residuals"]), "right.mot", "left.mot", "right_wrist.csv", "left_wrist.csv",
            "frames.csv", "person.yaml", "scene.yaml"]


def write(asked: Asked, of: Result, out: Path) -> bool:
    """:returns: False if gnuplot is missing or fails"""
    seen = [hand for hand in of.hands if len(hand.tracked)]
    files = {"frames.csv": frames_text(of), "person.yaml": of.person, "summary.csv": summary_rows(of), "summary.json": summary_text(asked, of)}
    for hand in seen:
        files.update(hand_files(of.times, hand))
    if seen:
        files["scene.yaml"] = scene_text(asked, of, {hand.name: hand.angles[hand.tracked[0]] for hand in seen})
    for name, text in files.items():
        _core.write_file(out / name, text.encode())
    drawn: bool = _core.write_plots(out, "summary", "", plots(of))
    return drawn


def plots(of: Result) -> list[tuple[str, str, str]]:
    return [*(_angle_plot(hand) for hand in of.hands if len(hand.tracked) and any(hand.determined)), _residual_plot(of)]


def model_file(asked: Asked) -> Path:
    return asked.model or data_path() / "handmodels/moving_thenar.yaml"


def convention_file(guessed: Guess) -> Optional[Path]:
    """Of the convention that points were taken for; None: of none."""
    return data_path() / f"handmodels/points/{guessed.name}.yaml" if guessed.name else None


def _convention(asked: Asked, path: Path) -> tuple[Optional[Path], Guess]:
    """The convention of the points, which nobody or `points` has said. :raises Error: of kind input for points in another order"""
    seen = sample(path)
    if asked.points is not None:
        guessed, file, said = Guess(asked.points.stem, "--points"), asked.points, f"that of {asked.points.stem}"
    else:
        guessed = guess(seen)
        file, said = data_path() / f"handmodels/points/{guessed.name}.yaml", "that of cameras" if seen and seen.listed else "its names say"
    known = points_of(file) if guessed.name else {joint: joint for chain in JOINTS.values() for joint in chain}
    check_order(asked.recording, seen, said, known)
    return file if guessed.name else None, guessed


def track(asked: Asked, told: Told = None, begin: Callable[[], object] = lambda: None) -> Result:
    """:param begin: is called before the work, with all files read
    :raises Error: of kind input for a recording or another file that cannot be read
    """
    c3d = is_c3d(asked.recording)
    with ExitStack() as files:
        path = files.enter_context(without_objects(files.enter_context(as_csv(asked.recording, asked.names, asked.up)) if c3d else asked.recording))
        points, guessed = (None, Guess(None, "")) if asked.markers else _convention(asked, path)
        work = _core.track(path, asked.person, model_file(asked), asked.markers or points, None if c3d else asked.up, asked.left_handed, asked.truth,
                           asked.fit_bones, asked.smooth, asked.noise, asked.seed)
        begin()
        try:
            of = work.run(told)
        except Error as error:
            if c3d:
                raise
            raise renamed(error, path, asked.recording) from None
    of["hands"], of["between"] = [Hand(*hand) for hand in of["hands"]], Between(*of["between"])
    of["warnings"] = [each.replace(str(path), str(asked.recording)) for each in of["warnings"]]
    return Result(**of, guess=guessed)


def study(asked: Asked, out: Path, told: Told = None) -> tuple[Result, bool]:
    """Tracks, and writes the files.

    :returns: what was found, and False if gnuplot is missing or fails
    :raises Error: of kind input for a recording or another file that cannot be read
    """
    inputs = [each for each in (asked.recording, asked.person, asked.markers, asked.points, asked.names, asked.truth, model_file(asked)) if each]
    held = list[_core.OutputFolder]()
    with NewFolder(out):
        found = track(asked, told, lambda: held.append(_core.output_folder(out, names(), inputs)))
        held[0].clear()
        return found, write(asked, found, out)


def screen_text(of: Result) -> str:
    out = of.guess.told() + "\n" if of.guess.by not in ("", "--points") else ""
    for hand in of.hands:
        counts = [hand.count(status) for status in STATUSES]
        out += (f"{hand.name:<6} {len(of.times)} frames: {counts[0]} tracked, {counts[1]} without a hand, {counts[2]} swapped, {counts[3]} poor; "
                f"noise {1e3 * hand.noise:.3g} mm a coordinate\n")
        undetermined = hand.determined.count(False)
        if undetermined and counts[0]:
            out += f"       {undetermined} axes that no point or sensor determines: left out\n"
        tested, overlapping, _ = hand.overlaps
        if overlapping:
            where, depth, time = hand.deepest
            out += (f"       parts inside each other in {overlapping} of {tested} frames tested, up to {1e3 * depth:.2g} mm ({where} at {time:.2f} s): "
                    "handsim run of scene.yaml resolves them by contact\n")
        fingers = hand.difference(True)
        if fingers is not None:
            out += f"       difference from the known angles at the flexion axes of the fingers: {DEGREES * fingers:.3g} deg RMS\n"
    if of.between.frames:
        out += (f"hands inside each other in {of.between.frames} frames, up to {1e3 * of.between.depth:.2g} mm ({of.between.where} at {of.between.time:.2f} s): "
                f"each wrist is moved away by up to {1e3 * of.between.moved:.2g} mm\n")
    if len(of.size) == 2:
        out += f"hand length {1e3 * of.size['hand_length']:.1f} mm, breadth {1e3 * of.size['hand_breadth']:.1f} mm; "
    out += f"{of.cpu:.3g} s of CPU time\n"
    return out if of.named else out + f"stature, mass and sex are those of the {of.title}: --person states others\n"


def choice(options: Mapping[str, Any], name: str, of: Sequence[str]) -> Optional[str]:
    """One of a few words. :raises Error: of kind input for another"""
    value: Optional[str] = options.get(name)
    if value is not None and value not in of:
        raise input_error(name, repr(value), " or ".join(of))
    return value


def checked(asked: Asked) -> Asked:
    """:raises Error: of kind input for what does not go together"""
    if asked.names is not None and not is_c3d(asked.recording):
        raise input_error("names", str(asked.recording), "a recording in C3D with it")
    if asked.markers is not None and asked.points is not None:
        raise input_error("points", "markers beside it", "either of them")
    return asked
