"""Scenes: compiled from files, run, drawn and exported; and the results of runs."""
from __future__ import annotations

import html
import json
import tempfile
from functools import cached_property
from os import PathLike, fspath
from pathlib import Path
from typing import TYPE_CHECKING, Any, Mapping, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import Fault, flags, input_error, real, whole
from ._files import check_target, write_file
from ._formats import FORMATS
from ._model import Model
from ._overrides import Overrides, Source, json_text, override_list
from ._pictures import Camera, Picture, contact_sheet, html_picture
from ._progress import Progress, bar
from ._run_page import run_page, write_page
from ._shipped import find_file
from ._table import Quantities, Table, rows_table
from ._table_files import read_csv
from ._verdict import verdicts_of

if TYPE_CHECKING:
    import pandas


class Muscle(NamedTuple):
    """A muscle of a hand, as `docs/muscles.md` describes it."""

    name: str
    """E.g. ``right.FDP2``."""
    moves: str
    """The finger that its tendon runs to, or ``wrist``."""
    nerve: str
    """That excites it; empty where the hand model does not say."""
    extrinsic: bool
    """Its belly lies in the forearm."""
    force: float
    """Largest isometric force of the fibres [N]."""
    fibre_length: float
    """Optimal [m]."""
    slack_length: float
    """Of the tendon [m]."""
    pennation: float
    """[rad]"""


class Scene:
    """A compiled scene. It does not change; simulations and batches share it. Can be pickled.

    Coordinates are those of all joints in order; angles in rad and lengths in m, rates per second. The world's z is
    up. All numbers are SI.
    """

    def __init__(self, core: _core.Scene) -> None:
        self._core = core
        self._origin: Optional[tuple[Source, list[str]]] = None  # What `load` made it from.

    @cached_property
    def _model(self) -> Model:
        return Model(_core.description(self._core), self.title)

    @property
    def title(self) -> str:
        return self._core.title

    @property
    def duration(self) -> float:
        """[s]"""
        return self._core.duration

    @property
    def step(self) -> float:
        """Step of the solver [s]."""
        return self._core.step

    @property
    def engine(self) -> str:
        """``ode``, ``articulated`` or ``dae``."""
        return self._core.engine

    @property
    def method(self) -> str:
        """Of the engine."""
        return self._core.method

    @property
    def effects(self) -> list[str]:
        """Effects that act, e.g. ``gravity``."""
        return self._core.effects()

    @property
    def hands(self) -> list[str]:
        """Names of the hands: ``right``, ``left``."""
        return self._core.hands()

    @property
    def objects(self) -> list[str]:
        """Names of the objects that can move."""
        return self._core.objects()

    @property
    def bodies(self) -> list[str]:
        """Names of all bodies; 0 is the world."""
        return self._core.bodies()

    @property
    def masses(self) -> NDArray[np.float64]:
        """Of the bodies [kg], shape (bodies,); the world's is 0."""
        return np.array([body.mass for body in self._model.bodies])

    @property
    def coordinates(self) -> list[str]:
        """Names of the joint coordinates, e.g. ``right.index_mcp.flexion``; flexion is positive toward the palm."""
        return self._core.coordinates()

    @property
    def limits(self) -> NDArray[np.float64]:
        """Stops of the coordinates [rad] or [m], shape (coordinates, 2); infinite where there is none."""
        free = (-np.inf, np.inf)
        return np.array([row for joint in self._model.joints for row in
                         [(axis.low, axis.high) for axis in joint.axes] + [free] * (3 * joint.spherical)]).reshape(-1, 2)

    @property
    def axes(self) -> list[str]:
        """Names of the coordinates that the scene's controller drives, in the order of ``targets``; empty without
        control."""
        return self._core.driven_axes()

    @property
    def axis_coordinates(self) -> NDArray[np.intp]:
        """Index in `coordinates` of each of `axes`."""
        return np.array(self._core.driven_coordinates(), dtype=np.intp)

    @property
    def muscles(self) -> list[Muscle]:
        """The muscles in effect, in the order of ``excitations``."""
        return [Muscle(*each) for each in self._core.muscles()]

    @property
    def muscle_groups(self) -> dict[str, NDArray[np.intp]]:
        """Indices in `muscles` by hand (``right``), by what they move (``thumb``, ``index``, ..., ``wrist``), by nerve
        (``median``, ``ulnar``, ``radial``), and ``extrinsic`` and ``intrinsic``."""
        of: dict[str, list[int]] = {}
        for i, each in enumerate(self.muscles):
            words = (each.name.partition(".")[0], each.moves, each.nerve, "extrinsic" if each.extrinsic else "intrinsic")
            for word in filter(None, words):
                of.setdefault(word, []).append(i)
        return {word: np.array(indices, dtype=np.intp) for word, indices in of.items()}

    @property
    def wrists(self) -> list[str]:
        """Names of the driven bodies, in the order of ``wrists`` of an action."""
        return self._core.driven_wrists()

    @property
    def warnings(self) -> list[str]:
        """Of reading and compiling, a sentence each."""
        return self._core.warnings

    @property
    def resolved(self) -> str:
        """The scene as YAML with every default and every file that it names in it."""
        return self._core.standalone()["resolved.yaml"].decode()

    def run(self, out: Union[str, "PathLike[str]", None] = None, *, frames: int = 12, poses: bool = False,
            plots: bool = False, report: bool = False, video: Union[str, "PathLike[str]", None] = None, fps: float = 30,
            speed: float = 1, stop_lost: bool = False, progress: Progress = None) -> Result:
        """Simulates the scene to its end, as ``handsim run``. Ctrl-C ends it within 0.1 s.

        :param out: folder for the files of ``handsim run``; None: nothing is written, and the result has the
            trajectory and the frames of its pictures in memory
        :param frames: pictures over the run; with a folder they are drawn and written
        :param poses: with a folder: pictures at the end of every hold or phase instead
        :param plots: with a folder: plots of a controlled scene by gnuplot
        :param report: with a folder: ``report.html``, a page with the motion in 3D; contacts, energies and residuals
            are recorded for it
        :param video: with a folder: path of a video of the run, ``.mp4`` or ``.gif``
        :param fps: frames in a second of video
        :param speed: simulated seconds in a second of video
        :param stop_lost: ends once a grasped object has moved too far or is lost
        :param progress: None: a bar in a notebook; True: a bar on stderr elsewhere, too; False: none; or a function of
            the share done, 0..1
        :raises Error: of kind input for a scene that cannot run. A motion that diverges does not raise: see
            `Result.fault`.
        """
        whole("frames", frames, 0)
        flags(poses=poses, plots=plots, report=report, stop_lost=stop_lost)
        if out is None:
            if report or video is not None:
                raise input_error("out", "none", "a folder for the files of report and video; in memory: "
                                  "Result.report, Scene.video")
            with bar(progress, "run") as told:
                return Result(self, _core.run(self._core, frames, stop_lost, told))
        folder = Path(out)
        film = None if video is None else (Path(fspath(video)), real("fps", fps), real("speed", speed))
        with bar(progress, "run") as told:
            values = _core.run_to_folder(self._core, folder, frames if _core.has_pictures() and not poses else 0, poses,
                                         plots, report, film, stop_lost, told)
        if report:
            write_page([folder])
        return Result(self, values, folder)

    def video(self, path: Union[str, "PathLike[str]"], time: Optional[float] = None, *, fps: float = 30,
              speed: float = 1, size: Optional[tuple[int, int]] = None, view: Optional[str] = None,
              camera: Optional[Camera] = None, progress: Progress = None) -> None:
        """Simulates the scene and writes a video of it, as ``handsim render --video``, by the program ffmpeg.

        :param path: ends in ``.mp4`` (H.264) or ``.gif``
        :param time: end of the video [s]; None: `duration`
        :param fps: frames in a second of video; at most 240, in a GIF 50
        :param speed: simulated seconds in a second of video
        :param size: and view, camera: as in `draw`
        :param progress: as in `run`
        :raises Error: of kind input without pictures or without ffmpeg; of kind physics where the motion diverges
        """
        end = self.duration if time is None else real("time", time)
        with bar(progress, "video") as told:
            _core.film(self._core, (Path(fspath(path)), real("fps", fps), real("speed", speed)), end, size, view, camera, told)

    def draw(self, time: float = 0, *, size: Optional[tuple[int, int]] = None, view: Optional[str] = None,
             camera: Optional[Camera] = None) -> Picture:
        """A picture at a time.

        :param time: [s], 0 to `duration`; the scene is simulated up to there
        :param size: width and height [pixels]; None: the scene's
        :param view: ``dorsal``, ``palmar``, ``radial`` or ``three_quarter``, framing all that moves
        :param camera: position [m], target [m] and vertical field of view [rad], in place of a view
        :returns: shape (height, width, 3), dtype uint8
        :raises Error: of kind input in a build without pictures (`handsim.has_pictures`)
        """
        return self.draw_frames([_core.frame_at(self._core, real("time", time))], size=size, view=view, camera=camera)[0]

    def draw_frames(self, frames: Sequence["_core.Frame"], *, size: Optional[tuple[int, int]] = None,
                    view: Optional[str] = None, camera: Optional[Camera] = None) -> list[Picture]:
        """Pictures of frames (`Simulation.frame`, `Batch.frame`, `Result.frames`) with one common camera; options as
        in `draw`."""
        return _core.draw(self._core, list(frames), size, view, camera)

    def to_format(self, format: str) -> str:
        """The model as text of a format without a motion, by its name for ``handsim export --format``.

        :raises Error: of kind input for another name, and for what the format cannot express
        """
        known = [name for name, of in FORMATS.items() if of.of_model]
        if format not in known:
            raise input_error("format", format, _core.need_word(str(format), known))
        text: str = FORMATS[format].write(self._model)
        return text

    def to_mjcf(self) -> str:
        """The model as MJCF, MuJoCo's format. :raises Error: of kind input for what MJCF cannot express"""
        return self.to_format("mjcf")

    def to_urdf(self) -> str:
        """The model as URDF. :raises Error: of kind input for what URDF cannot express, e.g. meshes and ball joints"""
        return self.to_format("urdf")

    def to_osim(self) -> str:
        """The model as .osim, OpenSim 4's format. :raises Error: of kind input for what OpenSim cannot express, e.g. loops"""
        return self.to_format("osim")

    def __reduce__(self) -> tuple[Any, ...]:
        return _unpickle, (self._core.standalone(),)

    def __repr__(self) -> str:
        return f"<handsim.Scene: {self.title}; {self.engine}, {len(self.coordinates)} coordinates, {self.duration:g} s>"

    def _repr_html_(self) -> str:
        facts = rows_table(["scene", self.title], [
            ["hands", ", ".join(self.hands)], ["objects", ", ".join(self.objects)],
            ["coordinates", str(len(self.coordinates))], ["driven axes", str(len(self.axes))],
            ["bodies", str(len(self.bodies) - 1)], ["effects", ", ".join(self.effects)],
            ["engine", f"{self.engine}, {self.method}, step {1e3 * self.step:g} ms"],
            ["duration", f"{self.duration:g} s"]])
        notes = "".join(f"<p>{html.escape(text)}</p>" for text in self.warnings)
        return facts._repr_html_() + notes + (html_picture(self.draw(), 480) if _core.has_pictures() else "")


class Result:
    """What a run gave. Can be pickled, without its frames."""

    def __init__(self, scene: Scene, values: dict[str, Any], folder: Optional[Path] = None) -> None:
        self.scene = scene
        self.folder = folder
        """Of the run's files; None for a run in memory."""
        self.verdicts = verdicts_of(values["verdicts"])
        """Figures of the scene's criteria with their limits."""
        self.passed: bool = values["passed"]
        """The run did not diverge, and every criterion held."""
        self.fault = None if values["fault"] is None else Fault(*values["fault"])
        """Of a run that diverged."""
        self.simulated: float = values["simulated"]
        """[s]"""
        self.wall: float = values["wall"]
        """Of the loop [s]."""
        self.state_hash: str = values["state_hash"]
        """Of all states; equal motions have equal hashes."""
        self.warnings: list[str] = values["warnings"]
        self.missing: list[str] = values["missing"]
        """Pictures or plots that could not be made, with the reason."""
        of_verdicts = {f"{each.name}[{each.unit}]": each.measured for each in self.verdicts}
        self.figures = Quantities(values.get("figures", of_verdicts))
        """Every figure by name: ``joint_gap``, ``grasp_slip``, ...; ``figures.units`` has their units. Of a run with files
        those of `verdicts`."""
        self.frames: list[_core.Frame] = values.get("frames", [])
        """States of a run in memory for `draw`."""
        self._summary: str = values["summary"]
        self._columns: list[str] = values.get("columns", [])
        self._rows: Optional[NDArray[np.float64]] = values.get("rows")

    @property
    def summary(self) -> dict[str, Any]:
        """The content of summary.json: figures, grasps, climbs, tracking, CPU times, versions."""
        out: dict[str, Any] = json.loads(self._summary)
        return out

    @property
    def trajectory(self) -> Table:
        """Columns of trajectory.csv by name, each of shape (rows,): ``time``, coordinates (by their names) and rates
        (``NAME.rate``), and of each body ``NAME.x``, y, z and the quaternion ``NAME.qw``, qx, qy, qz. A row for each
        ``record.every`` of the scene."""
        if self._rows is None:
            assert self.folder is not None
            return read_csv(self.folder / "trajectory.csv")
        return Table({name: self._rows[:, k] for k, name in enumerate(self._columns)})

    @cached_property
    def table(self) -> Any:
        """The trajectory: a frame of pandas (units in ``attrs["units"]``) where pandas is installed, else `trajectory`."""
        return self.trajectory.shown()

    def __getitem__(self, name: str) -> Any:
        """A figure by name: ``result["grasp_slip"]``."""
        return self.figures[name]

    @property
    def units(self) -> dict[str, str]:
        """Units of the figures by name."""
        return self.figures.units

    def to_pandas(self) -> "pandas.DataFrame":
        """The trajectory as a frame. Needs pandas."""
        return self.trajectory.to_pandas()

    def report(self, path: Union[str, "PathLike[str]", None] = None) -> str:
        """The page of the run for a browser: motion in 3D, curves, verdicts; of a run in memory without contacts.

        :param path: where it is written, too
        :returns: its HTML
        :raises Error: of kind input in a build without three.js
        """
        with tempfile.TemporaryDirectory() as parent:
            text = run_page([self.folder or self._write_files(Path(parent) / "run_in_memory")]).replace(f"{parent}/", "")
        if path is not None:
            write_file(check_target("path", path, "html"), text.encode())
        return text

    def _write_files(self, folder: Path) -> Path:
        """The files from which a page is made."""
        for name, content in self.scene._core.standalone().items():
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_bytes(content)
        (folder / "summary.json").write_text(self._summary)
        assert self._rows is not None
        np.savetxt(folder / "trajectory.csv", self._rows, "%.17g", ",", header=",".join(self._columns), comments="")
        return folder

    def draw(self, *, size: Optional[tuple[int, int]] = None, view: Optional[str] = None,
             camera: Optional[Camera] = None) -> list[Picture]:
        """A picture of each of `frames`; options as in `Scene.draw`."""
        if not self.frames:
            raise input_error("frames", "none", "a run in memory with frames: scene.run(frames=12)")
        return self.scene.draw_frames(self.frames, size=size, view=view, camera=camera)

    def film_strip(self, *, size: tuple[int, int] = (480, 360), width: int = 1600) -> Picture:
        """All frames on one page, with their times."""
        return contact_sheet(self.draw(size=size), [f"t = {frame.time:.2f} s" for frame in self.frames],
                             self.scene.title, width)

    @property
    def verdict_table(self) -> Table:
        """The verdicts as a table."""
        rows = [[v.name, v.unit, v.measured, v.limit, "-" if v.limit is None else "held" if v.held else "FAILED",
                 v.where] for v in self.verdicts]
        return rows_table(["criterion", "unit", "measured", "limit", "verdict", "where"], rows)

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key != "table"} | {"frames": []}

    def __repr__(self) -> str:
        end = f"diverged: {self.fault}" if self.fault else "passed" if self.passed else "FAILED"
        return f"<handsim.Result: {self.scene.title}; {self.simulated:g} s in {self.wall:.3g} s, {end}>"

    def _repr_html_(self) -> str:
        picture = html_picture(self.film_strip(), 960) if self.frames and _core.has_pictures() else ""
        return f"<p>{html.escape(repr(self)[9:-1])}</p>{self.verdict_table._repr_html_()}{picture}{self._replay()}"

    def _replay(self) -> str:
        """The page of the run in a frame of its own; nothing where it cannot be made."""
        if not _core.has_reports or self.simulated == 0:
            return ""
        return ('<iframe title="the run in 3D" width="100%" height="760" style="border: 1px solid #ccc" '
                f'srcdoc="{html.escape(self.report())}"></iframe>')


def load(source: Source, overrides: Overrides = None, *, engine: Optional[str] = None) -> Scene:
    """Compiles a scene.

    :param source: path of a scene file, name of a shipped scene (`scenes()`), or a mapping with the keys of a scene
        file, whose paths (texts or `pathlib.Path`) start from the working directory
    :param overrides: values by dotted key, as ``--set`` of the command line: ``{"objects.0.mass": 0.4,
        "solver.step": "2 ms"}``. Numbers are SI; texts carry units.
    :param engine: ``ode``, ``articulated``, ``dae`` or ``auto``, in place of the scene's
    :raises Error: of kind input with every problem of the scene and the files that it names
    """
    changes = override_list(overrides, engine)
    scene = _compiled(source, changes)
    scene._origin = source, changes
    return scene


def _compiled(source: Source, changes: list[str]) -> Scene:
    if isinstance(source, Mapping):
        return Scene(_core.Scene.parse(json_text(source, "scene"), "scene", changes))
    return Scene(_core.Scene.load(find_file(source), changes))


def with_value(scene: Scene, key: str, value: float) -> Scene:
    """The scene compiled anew with a number of its file."""
    if scene._origin is None:
        raise input_error(key, "a scene that was not loaded here (unpickled, or of a batch)", "one of handsim.load")
    source, changes = scene._origin
    return _compiled(source, [*changes, f"{key}={value!r}"])


def _unpickle(files: dict[str, bytes]) -> Scene:
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files.items():
            path = Path(folder) / name
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(content)
        return Scene(_core.Scene.load(Path(folder) / "resolved.yaml", []))


def files_of(scene: Scene) -> list[Path]:
    """All that a scene was read from."""
    return _core.files_read(scene._core)


def standing_alone(scene: Scene) -> dict[str, bytes]:
    """By name: scene.yaml and what it reads."""
    files: dict[str, bytes] = scene._core.standalone()
    return {"scene.yaml" if name == "resolved.yaml" else name: content for name, content in files.items()}
