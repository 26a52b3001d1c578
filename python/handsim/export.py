"""A scene's model or motion, a finished run, or a person's hands, as a file for other programs: ``handsim export``.

Formats are those of `FORMATS`.
"""
from __future__ import annotations

import argparse
import struct
import sys
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import Error, input_error
from ._files import check_target, ended, write_file
from ._formats import FORMATS, Format
from ._glb import Y_UP, glb_of_model, shown_shapes
from ._mcap import mcap_of, needs_writer, samples
from ._model import Model, SkinParts, bent, compose, matrices, normals_of, skins_of, surface, turned
from ._progress import bar
from ._scene import Scene, files_of, load
from ._simulation import Simulation
from ._suite import write_suite
from ._table_files import read_csv
from ._usd import usda_of

Array = NDArray[np.float64]
FRAMES = 60.0
"""Of an animation in a second, at most."""


def _names(scene: Scene) -> list[str]:
    return [f"{name}.{key}" for name in scene.bodies[1:] for key in ("x", "y", "z", "qw", "qx", "qy", "qz")]


def _with_world(rows: Array) -> Array:
    """Poses of all bodies, shape (rows, bodies, 7), with those of the world."""
    poses = rows.reshape(len(rows), -1, 7)
    return np.concatenate([np.tile([0.0, 0, 0, 1, 0, 0, 0], (len(rows), 1, 1)), poses], axis=1)


def _steady(times: Array, fps: float) -> NDArray[np.intp]:
    """Rows next to the frames of an animation; first and last among them."""
    wanted = np.arange(times[0], times[-1], 1 / fps)
    rows = np.searchsorted(times, wanted - 1e-9)
    out: NDArray[np.intp] = np.unique(np.concatenate([rows, [len(times) - 1]]))
    return out


def recorded(folder: Path) -> tuple[Scene, Array, Array]:
    """Scene, times and poses of a finished run."""
    for name in ("resolved.yaml", "trajectory.csv"):
        if not (folder / name).is_file():
            raise input_error(str(folder), f"a folder without {name}", "the folder of a run, or a scene file")
    scene = load(folder / "resolved.yaml")
    table = read_csv(folder / "trajectory.csv")
    missing = [name for name in _names(scene) if name not in table]
    if missing:
        raise input_error(str(folder / "trajectory.csv"), f"no column {missing[0]}", "the table of the run beside it")
    return scene, np.asarray(table["time"]), _with_world(np.stack([table[name] for name in _names(scene)], axis=1))


def simulated(scene: Scene, show: bool) -> tuple[Array, Array]:
    """Times and poses of a run. :raises Error: of kind physics where the motion diverges"""
    result = scene.run(frames=0, progress=show)
    if result.fault:
        raise Error(f"{scene.title} diverged at {result.fault.time:g} s: {result.fault.where}, {result.fault.quantity}", "physics",
                    fault=result.fault)
    table = result.trajectory
    return np.asarray(table["time"]), _with_world(np.stack([table[name] for name in _names(scene)], axis=1))


def run_to(scene: Scene, time: float, show: bool) -> Simulation:
    """The scene's run at a time."""
    run = Simulation(scene, contact_forces=False)
    with bar(show, "simulates") as told:
        while run.time < time - 0.5 * scene.step:
            run.step(substeps=max(1, min(100, round((time - run.time) / scene.step))))
            if told:
                told(run.time / time)
    return run


def at_time(scene: Scene, time: float, show: bool) -> Array:
    """Poses at a time of the scene."""
    bodies = run_to(scene, time, show).bodies
    return np.asarray(np.concatenate([bodies.position, bodies.quaternion], axis=1)[None])


# Surfaces of a moment.


def pieces(model: Model, skins: Sequence[SkinParts], poses: Array, hands: str) -> list[tuple[str, Array, Array, NDArray[Any]]]:
    """Name, points, normals and faces of all that is seen, in the world."""
    out: list[tuple[str, Array, Array, NDArray[Any]]] = []
    for skin, hand in zip(skins, model.hands) if hands != "shapes" else ():
        points = bent(skin, poses[skin.bodies])
        out.append((f"{hand.name} skin", points, normals_of(points, skin.faces.astype(int)), skin.faces))
    for shape in shown_shapes(model, skins, hands):
        x, of = compose(poses[shape.body], shape.pose), surface(shape)
        out.append((shape.name, x[:3] + turned(x[3:], of.points), turned(x[3:], of.normals), of.faces))
    return out


def obj_of(parts: Sequence[tuple[str, Array, Array, NDArray[Any]]]) -> bytes:
    """Wavefront OBJ: metres, y up."""
    lines, first = ["# handsim: metres, y up"], 1
    for name, points, normals, faces in parts:
        lines.append(f"o {name.replace(' ', '_')}")
        for word, rows in (("v", turned(Y_UP[3:], points)), ("vn", turned(Y_UP[3:], normals))):
            lines += [f"{word} {x:.7g} {y:.7g} {z:.7g}" for x, y, z in rows]
        lines += ["f " + " ".join(f"{corner}//{corner}" for corner in face) for face in (faces.astype(int) + first).tolist()]
        first += len(points)
    return ("\n".join(lines) + "\n").encode()


def stl_of(parts: Sequence[tuple[str, Array, Array, NDArray[Any]]]) -> bytes:
    """Binary STL: millimetres, z up, as printers' programs take it."""
    corners = np.concatenate([1e3 * points[faces.astype(int)] for _, points, _, faces in parts])
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    rows = np.zeros(len(corners), dtype=[("numbers", "<f4", 12), ("none", "<u2")])
    rows["numbers"] = np.concatenate([normals, corners.reshape(-1, 9)], axis=1)
    return b"handsim: millimetres, z up".ljust(80) + struct.pack("<I", len(rows)) + rows.tobytes()


# The command.


PERSON = ("stature", "mass", "sex", "age", "hand_length", "hand_breadth", "hand_circumference", "hand_mass", "hand_length_percentile")
"""Measures of a person, by key of a person file."""


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise input_error("export", message, "handsim export --help")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="handsim export", allow_abbrev=False, description=__doc__.partition("\n\n")[0] if __doc__ else None,
                     epilog="example: handsim export --stature 1.75 --mass 72 --sex male --side right --out right.osim")
    parser.add_argument("source", nargs="?", help="scene file, name of a shipped scene, or folder of a finished run; "
                        "without one: a person's hands")
    parser.add_argument("--out", help="the file; its ending says the format; default: out/NAME with the ending of --format")
    parser.add_argument("--format", help=f"default: by the file's ending, else {next(iter(FORMATS))}. " +
                        "; ".join(f"{name} ({of.endings_text}): {of.text}" for name, of in FORMATS.items()))
    parser.add_argument("--time", help="the moment [s, or with a unit]; of glb and mcap the end of the motion; default: mjcf, obj "
                        "and stl the start, others all")
    parser.add_argument("--hands", help="what is seen of hands: skin (default), shapes or both (usda has both)")
    parser.add_argument("--fps", type=float, help="frames of an animation, or messages of a topic, in a second (60)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="overrides a key of the scene")
    parser.add_argument("--engine", help="ode, articulated, dae or auto")
    parser.add_argument("--person", help="person file, or the name of a shipped one, in place of a scene")
    for name, text in zip(PERSON, ("m, or with a unit: 1.75, \"175 cm\"", "kg", "male, female or unknown",
                                   "years; without it a body of a child's size has a child's hand",
                                   "measured: wrist crease to middle fingertip [m]",
                                   "measured: across the knuckles [m]", "measured: around the knuckles [m]", "measured [kg]",
                                   "among people of this stature, mass and sex, 0.01 to 99.99")):
        parser.add_argument(f"--{name.replace('_', '-')}", help=text)
    parser.add_argument("--model", help="hand model file, or the name of a shipped one (default: the anatomical hand)")
    parser.add_argument("--side", help="which hands of a person: right, left or both (default)")
    parser.add_argument("--mount", help="how a person's palms are held: fixed (default), hinge, universal or free")
    parser.add_argument("--muscles", action="store_true", help="with the muscles of a person's hands")
    parser.add_argument("--suite", metavar="DIR", help="writes the suite of cases for other engines there, in place of a file")
    parser.add_argument("--quiet", action="store_true", help="no bar of progress")
    parser.add_argument("--formats", action="store_true", help=argparse.SUPPRESS)  # for completion
    return parser


def _parsed(words: Sequence[str]) -> argparse.Namespace:
    """:raises Error: of kind input for what no option can have"""
    arguments, unknown = _parser().parse_known_args(list(words))
    if unknown:
        raise input_error(unknown[0].partition("=")[0], "an unknown option" if unknown[0].startswith("-") else "a second scene",
                          "one of handsim export --help" if unknown[0].startswith("-") else "one")
    for option, known in (("format", list(FORMATS)), ("hands", ["skin", "shapes", "both"]),
                          ("engine", ["ode", "dae", "articulated", "auto"]),
                          ("side", ["right", "left", "both"]), ("mount", ["fixed", "hinge", "universal", "free"])):
        given = getattr(arguments, option)
        if given is not None and given not in known:
            raise input_error(f"--{option}", given or '""', _core.need_word(given, known))
    if arguments.suite is not None:
        given = next((word for word in words if word.partition("=")[0] not in ("--suite", "--quiet", arguments.suite)), None)
        if given is not None:
            raise input_error("--suite", f"{given} beside it", "--suite DIR alone, or with --quiet")
    if arguments.time is not None:
        time = _core.parse_time(arguments.time)
        if time is None or not time >= 0:
            raise input_error("--time", arguments.time or '""', 'a time from 0, such as 0.2 or "200 ms"')
        arguments.time = time
    if arguments.fps is not None and not (np.isfinite(arguments.fps) and 1 <= arguments.fps <= 1000):
        raise input_error("--fps", arguments.fps, "1 to 1000")
    for option in ("out", "source", "suite"):
        if getattr(arguments, option) == "":
            raise input_error("scene" if option == "source" else f"--{option}", '""', "a path")
    return arguments


def _format(out: str, given: Optional[str]) -> Format:
    """The requested format, which must agree with the file's ending; without both the first one."""
    ending, known = Path(out).suffix.lower(), [FORMATS[given]] if given else list(FORMATS.values())
    for of in known:
        if not ending or ending in of.endings:
            return of
    names = ", ".join(of.endings_text + ("" if given else f" ({of.name})") for of in known)
    raise input_error("--out", out, f"a name that ends in {names}" + (f" for --format {given}" if given else ""))


def _person_scene(arguments: argparse.Namespace, measures: dict[str, str]) -> Scene:
    person, model = (getattr(arguments, key) and _core.find_input(getattr(arguments, key), folder)
                     for key, folder in (("person", "config/persons"), ("model", "handmodels")))
    core, warnings = _core.person_hands(person, measures, model, arguments.side or "both", arguments.mount or "fixed", arguments.muscles)
    _warn(warnings)
    return Scene(core)


def _warn(texts: Sequence[str]) -> None:
    for text in texts:
        print(f"warning: {text}", file=sys.stderr)


def _check_source(arguments: argparse.Namespace, of: Format, measures: dict[str, str]) -> None:
    """Refuses options of a person beside a scene, those of a scene beside a person, and those of other formats."""
    time = arguments.time is not None
    if time and of.of_model and (arguments.source is None or of.name != "mjcf"):
        raise input_error("--time", f"{arguments.time:g} s", "a scene, and the format mjcf")
    for option, given in (("--hands", arguments.hands), ("--fps", arguments.fps)):
        if of.of_model and given is not None:
            raise input_error(option, given, f"a format with surfaces or a motion, and not {of.name}")
    person = arguments.person is not None or bool(measures)
    if arguments.source is None:
        if not person:
            folder = "the folder of a run, " if "run" in of.of else ""
            raise input_error("scene", "nothing", f"a scene file, {folder}or a person: --person, or --stature, --mass and --sex")
        for option, given in (("--set", arguments.overrides and arguments.overrides[0]), ("--engine", arguments.engine)):
            if given:
                raise input_error(option, given, "a scene, whose keys it overrides")
        if time:
            raise input_error("--time", f"{arguments.time:g} s", "a scene or a run")
        if "hand" not in of.of:
            raise input_error("export", "a person", f"a scene or a run for the motion of an {of.name} file")
    elif person or arguments.model or arguments.side or arguments.mount or arguments.muscles:
        raise input_error("scene", arguments.source, "a scene or the options of a person, not both")


def _scene_of(arguments: argparse.Namespace, of: Format) -> tuple[Scene, Optional[tuple[Array, Array]]]:
    """The scene, and the motion of a finished run."""
    measures = {key: getattr(arguments, key) for key in PERSON if getattr(arguments, key) is not None}
    _check_source(arguments, of, measures)
    if arguments.source is None:
        return _person_scene(arguments, measures), None
    if "run" in of.of and Path(arguments.source).is_dir():
        if arguments.overrides or arguments.engine:
            raise input_error("export", "--set or --engine", "a scene with them; a run has its own")
        scene, times, poses = recorded(Path(arguments.source))
        return scene, (times, poses)
    engine = [f"solver.engine={arguments.engine}"] if arguments.engine else []
    return Scene(_core.Scene.load(_core.find_input(arguments.source, "config"), [*engine, *arguments.overrides])), None


def _check_time(time: Optional[float], end: float, of_run: bool) -> None:
    if time is not None and not 0 <= time <= end + 1e-9:
        what = "the end of the motion at" if of_run else "the scene's duration of"
        raise input_error("--time", f"{time:g} s", f"0 to {what} {end:g} s")


def _motion(scene: Scene, run: Optional[tuple[Array, Array]], time: Optional[float], whole: bool, fps: float,
            show: bool) -> tuple[Optional[Array], Array]:
    """Times and poses of a motion, or no times and the poses of a moment."""
    _check_time(time, scene.duration if run is None else float(run[0][-1]), run is not None)
    if run is None and not whole:
        return None, at_time(scene, time or 0.0, show)
    times, poses = run or simulated(scene, show)
    if not whole:
        row = int(np.argmin(np.abs(times - (time or 0.0))))
        return None, poses[row:row + 1]
    rows = _steady(times, fps)
    rows = rows if time is None else rows[times[rows] <= time + 1e-9]
    return times[rows] - times[rows[0]], poses[rows]


class Job(NamedTuple):
    """What a file is made of."""

    scene: Scene
    run: Optional[tuple[Array, Array]]
    """Times and poses of a finished run."""
    still: bool
    """A person's hand, which has no motion."""
    time: Optional[float]
    hands: str
    fps: float
    show: bool

    def moving(self, whole: bool) -> tuple[Optional[Array], Array]:
        """Times and poses of the motion, or of a moment."""
        return _motion(self.scene, self.run, self.time, whole and not self.still, self.fps, self.show)

    def told(self, kind: str, times: Optional[Array]) -> str:
        moved = f", {times[-1]:g} s of motion" if times is not None and len(times) > 1 else ""
        return f"{len(self.scene._model.bodies) - 1} bodies, {len(self.scene.hands)} hands as {kind}{moved}"

    @property
    def skins(self) -> list[SkinParts]:
        return [] if self.hands == "shapes" else skins_of(self.scene._core)


def glb_file(job: Job) -> tuple[bytes, str]:
    times, poses = job.moving(True)
    return glb_of_model(job.scene._model, job.skins, poses, times, hands=job.hands), job.told("glb", times)


def usda_file(job: Job) -> tuple[bytes, str]:
    times, poses = job.moving(job.time is None)
    return usda_of(job.scene._model, skins_of(job.scene._core), poses, times, job.fps).encode(), job.told("usda", times)


def obj_file(job: Job) -> tuple[bytes, str]:
    return obj_of(pieces(job.scene._model, job.skins, job.moving(False)[1][0], job.hands)), job.told("obj", None)


def stl_file(job: Job) -> tuple[bytes, str]:
    return stl_of(pieces(job.scene._model, job.skins, job.moving(False)[1][0], job.hands)), job.told("stl", None)


def mcap_file(job: Job) -> tuple[bytes, str]:
    """The motion of a finished run is simulated again, and compared with its table."""
    needs_writer()
    end = job.scene.duration if job.run is None else float(job.run[0][-1])
    _check_time(job.time, end, job.run is not None)
    motion = list(samples(job.scene, end if job.time is None else job.time, job.fps, job.show))
    if job.run is not None:
        times, poses = job.run
        for each in motion:
            row = int(np.argmin(np.abs(times - each.time)))
            if abs(times[row] - each.time) < 1e-9 and np.abs(poses[row] - each.poses).max() > 1e-6:
                raise input_error("export", f"a run that its resolved.yaml does not repeat at {each.time:g} s",
                                  "a run from its scene's start, of this build")
    return mcap_of(job.scene, motion), f"joint states, transforms and contact wrenches of {job.scene.title} as mcap"


def _of_model(job: Job, of: Format) -> tuple[bytes, str]:
    """A file of the model alone."""
    model = job.scene._model
    if job.time:
        _check_time(job.time, job.scene.duration, False)
        model = Model(run_to(job.scene, job.time, job.show)._core.description(), job.scene.title)
    text: str = of.write(model)
    if of.name != "urdf" and any(muscle.elastic for muscle in model.muscles):
        _warn(["tendon_strain: elastic tendons are exported as rigid ones"])
    if of.name != "urdf" and any(muscle.short_range for muscle in model.muscles):
        _warn(["short_range_stiffness: muscles are exported without it"])
    return text.encode(), f"{len(model.bodies) - 1} bodies, {len(model.joints)} joints as {of.name}"


def run(arguments: argparse.Namespace) -> str:
    """Writes the file. :returns: what it has"""
    own_name = Path(arguments.source or "export").resolve().stem
    place = arguments.out or str(Path("out") / (own_name + FORMATS[arguments.format or next(iter(FORMATS))].endings[0]))
    of = _format(place, arguments.format)
    scene, motion = _scene_of(arguments, of)
    own = [] if motion is None else [Path(arguments.source) / "trajectory.csv"]
    if not arguments.out:
        Path("out").mkdir(exist_ok=True)
    out = check_target("--out", place, of.name, [*files_of(scene), *own])
    show = sys.stderr.isatty() and not arguments.quiet
    job = Job(scene, motion, arguments.source is None, arguments.time, arguments.hands or "skin", arguments.fps or FRAMES, show)
    content, told = _of_model(job, of) if of.of_model else of.write(job)
    write_file(out, content)
    return f"{place}: {told}, {len(content) / 1e6:.2f} MB"


def main(words: Sequence[str]) -> int:
    """``export`` of the command line. :returns: the exit status"""
    def work() -> int:
        arguments = _parsed(words)
        if arguments.suite is not None:
            with bar(sys.stderr.isatty() and not arguments.quiet, "cases") as told:
                print(write_suite(arguments.suite, told))
            return 0
        print(*FORMATS if arguments.formats else [run(arguments)])
        return 0
    return ended(work)
