"""Files for viewers and other programs, from a scene, a finished run or a person: ``python3 -m handsim export``.

Formats are those of `FORMATS`: the ones that the package writes have a function in WRITERS, all others are the program's.
"""
from __future__ import annotations

import argparse
import struct
import sys
from pathlib import Path
from typing import Any, Callable, NamedTuple, NoReturn, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import Error, input_error
from ._files import check_target, ended, write_file
from ._formats import FORMATS
from ._glb import Y_UP, glb_of_model, shown_shapes
from ._hand import Hand
from ._mcap import mcap_of, needs_writer, samples
from ._model import Model, SkinParts, bent, compose, matrices, normals_of, skins_of, surface, turned
from ._progress import bar
from ._scene import Scene, files_of, load
from ._simulation import Simulation
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


def at_time(scene: Scene, time: float, show: bool) -> Array:
    """Poses at a time of the scene."""
    run = Simulation(scene, contact_forces=False)
    with bar(show, "simulates") as told:
        while run.time < time - 0.5 * scene.step:
            run.step(substeps=max(1, min(100, round((time - run.time) / scene.step))))
            if told:
                told(run.time / time)
    bodies = run.bodies
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


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        raise input_error("export", message, "python3 -m handsim export --help")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="handsim export", allow_abbrev=False, description=__doc__.partition("\n\n")[0] if __doc__ else None,
                     epilog="example: python3 -m handsim export config/grasp_power_can.yaml --out can.glb")
    parser.add_argument("source", nargs="?", help="scene file, name of a shipped scene, or folder of a finished run")
    parser.add_argument("--out", help="the file; its ending says the format; default: out/NAME with the ending of --format")
    parser.add_argument("--format", help="; ".join(f"{name}: {FORMATS[name].text}" for name in WRITERS))
    parser.add_argument("--time", type=float, help="the moment [s]; of glb and mcap the end of the motion; default: obj and stl the start, others all")
    parser.add_argument("--hands", choices=("skin", "shapes", "both"), default="skin", help="what is seen of hands (usda has both)")
    parser.add_argument("--fps", type=float, default=FRAMES, help="frames of an animation, or messages of a topic, in a second (60)")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", dest="overrides", help="overrides a key of the scene")
    parser.add_argument("--engine", help="ode, articulated, dae or auto")
    for name, kind in (("stature", float), ("mass", float), ("sex", str), ("side", str), ("model", str), ("person", str)):
        parser.add_argument(f"--{name}", type=kind, help="of a person, in place of a scene")
    parser.add_argument("--quiet", action="store_true", help="no bar of progress")
    return parser


def _format(out: str, given: Optional[str]) -> str:
    ending = Path(out).suffix.lower().lstrip(".")
    if given is not None and given not in FORMATS:
        raise input_error("--format", given, f"one of {', '.join(FORMATS)}")
    if given in FORMATS and given not in WRITERS:
        raise input_error("--out", out, f"a name that ends in {' or '.join(FORMATS[given].endings)} for --format {given}")
    if ending and given and ending != given:
        raise input_error("--out", out, f"a name that ends in .{given} for --format {given}")
    if (given or ending) not in WRITERS:
        raise input_error("--out", out, f"a name that ends in .{', .'.join(WRITERS)}")
    return given or ending


def _scene_of(arguments: argparse.Namespace) -> tuple[Scene, Optional[tuple[Array, Array]]]:
    """The scene, and the motion of a finished run."""
    person = {key: getattr(arguments, key) for key in ("stature", "mass", "sex", "side", "model", "person") if getattr(arguments, key)}
    if arguments.source is None:
        if not person:
            raise input_error("scene", "nothing", "a scene file, the folder of a run, or a person: --person, or --stature, --mass and --sex")
        if arguments.overrides or arguments.engine or arguments.time is not None:
            raise input_error("export", "--set, --engine or --time", "a scene or a run with them")
        return Hand(**person).scene, None
    if person:
        raise input_error("scene", arguments.source, "a scene or the options of a person, not both")
    if Path(arguments.source).is_dir():
        if arguments.overrides or arguments.engine:
            raise input_error("export", "--set or --engine", "a scene with them; a run has its own")
        scene, times, poses = recorded(Path(arguments.source))
        return scene, (times, poses)
    pairs = [each.partition("=") for each in arguments.overrides]
    wrong = [key for key, sign, _ in pairs if not sign or not key]
    if wrong:
        raise input_error("--set", wrong[0], "KEY=VALUE")
    return load(arguments.source, {key: value for key, _, value in pairs}, engine=arguments.engine), None


def _check_time(time: Optional[float], end: float) -> None:
    if time is not None and not 0 <= time <= end + 1e-9:
        raise input_error("--time", f"{time:g} s", f"0 to the end of the motion at {end:g} s")


def _motion(scene: Scene, run: Optional[tuple[Array, Array]], time: Optional[float], whole: bool, fps: float,
            show: bool) -> tuple[Optional[Array], Array]:
    """Times and poses of a motion, or no times and the poses of a moment."""
    _check_time(time, scene.duration if run is None else float(run[0][-1]))
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


def _glb(job: Job) -> tuple[bytes, str]:
    times, poses = job.moving(True)
    return glb_of_model(job.scene._model, job.skins, poses, times, hands=job.hands), job.told("glb", times)


def _usda(job: Job) -> tuple[bytes, str]:
    times, poses = job.moving(job.time is None)
    return usda_of(job.scene._model, skins_of(job.scene._core), poses, times, job.fps).encode(), job.told("usda", times)


def _obj(job: Job) -> tuple[bytes, str]:
    return obj_of(pieces(job.scene._model, job.skins, job.moving(False)[1][0], job.hands)), job.told("obj", None)


def _stl(job: Job) -> tuple[bytes, str]:
    return stl_of(pieces(job.scene._model, job.skins, job.moving(False)[1][0], job.hands)), job.told("stl", None)


def _mcap(job: Job) -> tuple[bytes, str]:
    """The motion of a finished run is simulated again, and compared with its table."""
    if job.still:
        raise input_error("export", "a person", "a scene or a run for the motion of an mcap file")
    needs_writer()
    end = job.scene.duration if job.run is None else float(job.run[0][-1])
    _check_time(job.time, end)
    motion = list(samples(job.scene, end if job.time is None else job.time, job.fps, job.show))
    if job.run is not None:
        times, poses = job.run
        for each in motion:
            row = int(np.argmin(np.abs(times - each.time)))
            if abs(times[row] - each.time) < 1e-9 and np.abs(poses[row] - each.poses).max() > 1e-6:
                raise input_error("export", f"a run that its resolved.yaml does not repeat at {each.time:g} s",
                                  "a run from its scene's start, of this build")
    return mcap_of(job.scene, motion), f"joint states, transforms and contact wrenches of {job.scene.title} as mcap"


WRITERS: dict[str, Callable[[Job], tuple[bytes, str]]] = {"glb": _glb, "usda": _usda, "obj": _obj, "stl": _stl, "mcap": _mcap}
"""By name of the format: content of the file, and what it has, in words."""


def run(arguments: argparse.Namespace) -> str:
    """Writes the file. :returns: what it has"""
    own_name = Path(arguments.source).resolve().stem if arguments.source else "hand"
    place = arguments.out or str(Path("out") / f"{own_name}.{arguments.format}")
    kind = _format(place, arguments.format)
    if not (np.isfinite(arguments.fps) and 1 <= arguments.fps <= 1000):
        raise input_error("--fps", arguments.fps, "1 to 1000")
    scene, motion = _scene_of(arguments)
    own = [] if motion is None else [Path(arguments.source) / "trajectory.csv"]
    if not arguments.out:
        Path("out").mkdir(exist_ok=True)
    out = check_target("--out", place, kind, [*files_of(scene), *own])
    show = sys.stderr.isatty() and not arguments.quiet
    content, told = WRITERS[kind](Job(scene, motion, arguments.source is None, arguments.time, arguments.hands, arguments.fps, show))
    write_file(out, content)
    return f"{place}: {told}, {len(content) / 1e6:.2f} MB"


def _ours(words: Sequence[str]) -> bool:
    """True for the formats of this module, by --format or the ending of --out; for all others the program answers."""
    for word, after in zip(words, [*words[1:], ""]):
        name, sign, own = word.partition("=")
        value = own if sign else after
        if name == "--format" and value in WRITERS or name == "--out" and Path(value).suffix.lower().lstrip(".") in WRITERS:
            return True
    return False


def main(words: Sequence[str]) -> int:
    """``export`` of the command line. :returns: the exit status"""
    if not _ours(words):
        return _core.command_line(["export", *words])

    def work() -> int:
        print(run(_parser().parse_args(list(words))))
        return 0
    return ended(work)
