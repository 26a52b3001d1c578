"""The studies of the command line: each returns its table, its JSON and its printed text.

A study takes the path of its file or scene, or the name of a shipped one (`handsim.scenes`). With ``out`` its files are
kept in that folder, as the command writes them. ``progress``: None shows a bar in a notebook, True a bar on stderr
elsewhere, too, False none; a function is called with the share done, 0..1. Ctrl-C ends a study after the run that is under
way.
"""
from __future__ import annotations

from contextlib import contextmanager
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import Any, Iterable, Iterator, Optional, Sequence, Union

from . import _accuracy, _core, _effects, _forces_command, _grasps, _inverse, _rollouts, _rollouts_run, _track, _windows
from ._errors import Error, Problem, flags, input_error, real, whole
from ._files import PathText, path_of
from ._overrides import Overrides, Source, override_list
from ._progress import Progress, bar
from ._scene import Scene, load
from ._shipped import data_path, find_file
from ._table import Table
from ._table_files import read_csv, read_h5, read_json, read_sto

Out = Optional[PathText]
MOST_THREADS = 1024


class Study:
    """The result of a study. Can be pickled."""

    def __init__(self, name: str, folder: Path, text: str) -> None:
        self.name = name
        self.text = text
        """As the command prints it; may be empty."""
        self.tables: dict[str, Table] = {path.stem: read_csv(path) for path in sorted(folder.glob("*.csv"))}
        self.tables.update({path.stem: read_sto(path) for path in sorted([*folder.glob("*.sto"), *folder.glob("*.mot")])})
        """Every table of the study by name: dicts of columns, with their units."""
        self.summaries: dict[str, Any] = {path.stem: read_json(path) for path in sorted(folder.glob("*.json"))}
        """Every JSON file by name."""
        self.plots: dict[str, bytes] = {path.stem: path.read_bytes() for path in sorted(folder.glob("*.png"))}
        """Plots and pictures by name, as bytes of PNG files; plots need gnuplot."""

    @cached_property
    def table(self) -> Any:
        """The table of the study's own name, or the only one: a frame of pandas (units in ``attrs["units"]``) where pandas
        is installed, else the `Table` of `tables`."""
        return self._own.shown()

    @property
    def _own(self) -> Table:
        found = self.tables.get(self.name)
        return found if found is not None else next(iter(self.tables.values()), Table({}))

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key != "table"}

    @property
    def summary(self) -> Any:
        """The JSON of the study's own name, or ``summary.json``, or the only one."""
        return self.summaries.get(self.name) or self.summaries.get("summary") or next(iter(self.summaries.values()), {})

    def __repr__(self) -> str:
        return self.text or repr(self._own)

    def _repr_html_(self) -> str:
        import base64

        shown = "".join(f'<img width="720" src="data:image/png;base64,{base64.b64encode(data).decode()}">'
                        for data in self.plots.values())
        return self._own._repr_html_() + shown


def _path(key: str, path: Optional[PathText]) -> Optional[Path]:
    return None if path is None else path_of(key, path)


def _listed(key: str, given: Any) -> list[Any]:
    """One path or several."""
    if isinstance(given, (str, PathLike)):
        return [given]
    if not isinstance(given, Iterable) or isinstance(given, (bytes, bytearray, memoryview)):
        raise input_error(key, repr(given)[:200], "a path, or a list of them")
    return list(given)


@contextmanager
def _folder(out: Out) -> Iterator[Path]:
    if out is not None:
        yield path_of("out", out)
        return
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def accuracy(study: PathText = "accuracy_2017", *, out: Out = None, progress: Progress = None) -> Study:
    """Errors against a reference and CPU time of every method and step of an accuracy study."""
    with _folder(out) as folder, bar(progress, "accuracy") as told:
        found, _ = _accuracy.study(find_file(study), folder, told)
        return Study("accuracy", folder, _accuracy.screen_text(found))


def effects(scene: Union[Scene, Source], overrides: Overrides = None, *, repeats: int = 7, out: Out = None,
            progress: Progress = None) -> Study:
    """CPU time and influence of each effect of a scene. :param repeats: timed rounds, for the median"""
    whole("repeats", repeats, 1)
    of = scene if isinstance(scene, Scene) else load(scene, overrides)
    file = find_file(scene) if isinstance(scene, (str, PathLike)) else None
    with _folder(out) as folder, bar(progress, "effects") as told:
        return Study("effects", folder, _effects.study(of, file, override_list(overrides), repeats, folder, told).text)


def grasps(scenes: Union[PathText, Sequence[PathText]], overrides: Overrides = None, *, sides: Sequence[str] = (),
           friction: Optional[float] = None, friction_search: bool = False, margin: bool = False,
           confirm: bool = False, pictures: bool = False, uncertain: Optional[int] = None, threads: int = 0,
           client: Any = None, out: Out = None, progress: Progress = None) -> Study:
    """Grasp and climb scenes in one table of each: ``tables["grasps"]``, ``tables["climbs"]``.

    :param scenes: files, names of shipped scenes, or folders
    :param sides: ``right``, ``left`` for the first hand; empty: as the scenes have it
    :param friction: of every surface; None: the scenes'
    :param friction_search: the smallest friction that still holds each grasp
    :param margin: each grasp again with 5 % more and less friction and mass
    :param confirm: each grasp again at half the step
    :param uncertain: as many hands are drawn within what is uncertain, in place of the scenes' own, on ``threads`` cores
        (0: all) or by the workers of ``client`` (see `rollouts`): ``tables["uncertain"]`` has every figure with its interval
        and the owners of its variance
    """
    flags(friction_search=friction_search, margin=margin, pictures=pictures)
    if friction is not None:
        real("friction", friction)
    if uncertain is not None:
        whole("uncertain", uncertain, 2), whole("threads", threads, 0, MOST_THREADS)
        if friction is not None or friction_search or margin or confirm or pictures:
            raise input_error("uncertain", "options of one run of each scene", "scenes, overrides, sides and out alone")
    listed = [find_file(each) for each in _listed("scenes", scenes)]
    with _folder(out) as folder, bar(progress, "grasps") as told:
        asked = _grasps.Asked(listed, list(sides), [], override_list(overrides), folder)
        if uncertain is not None:
            with _rollouts.executor_of(client, threads) as executor:
                text = _rollouts_run.uncertain_grasps(*asked[:4], uncertain, folder, executor, told).text
            _core.finish_study(folder, f"{asked.command()} --uncertain {uncertain}", {}, {}, False)
            return Study("uncertain", folder, text)
        _grasps.study(asked, friction, search=friction_search, margin=margin, confirm=confirm, pictures=pictures, told=told)
        return Study("grasps", folder, "")


def _drawn(asked: _rollouts.Asked, client: Any, threads: int, out: Out, progress: Progress, **more: Any) -> Study:
    """A study of rollouts, or of uncertain hands."""
    whole("threads", threads, 0, MOST_THREADS)
    with _folder(out) as folder, bar(progress, "rollouts") as told, _rollouts.executor_of(client, threads) as executor:
        order = _rollouts_run.rollouts_order(asked, folder, **more)
        return Study("rollouts", folder, _rollouts_run.run(order, executor, told).text)


def rollouts(study: PathText, overrides: Overrides = None, *, count: Optional[int] = None,
             seed: Optional[int] = None, threads: int = 0, resume: bool = False, client: Any = None, out: Out = None,
             progress: Progress = None) -> Study:
    """Thousands of runs of a scene, each with its own person, mass, friction or pose.

    :param count: draws, in place of the study's
    :param seed: in place of the study's
    :param threads: of this machine; 0: one for each core
    :param resume: goes on with a study that was stopped, from the rows in ``out``
    :param client: a ``distributed.Client``, whose workers compute in place of this machine, or any executor whose ``submit`` is as
        in concurrent.futures
    """
    flags(resume=resume)
    for name, value, least in (("count", count, 1), ("seed", seed, 0)):
        if value is not None:
            whole(name, value, least)
    return _drawn(_rollouts.Asked(find_file(study), False, tuple(override_list(overrides)), count, seed), client, threads, out, progress, resume=resume)


def uncertain(scene: PathText, overrides: Overrides = None, *, count: int = 100, threads: int = 0, client: Any = None, out: Out = None,
              progress: Progress = None) -> Study:
    """Runs of a scene with hands drawn within what is uncertain of them: every figure with its interval, and the
    shares of the inputs in its variance (``study.summary["outcomes"]``).

    :param scene: path of a scene file, or the name of a shipped scene
    :param count: hands
    :param client: as in `rollouts`
    """
    whole("count", count, 2)
    return _drawn(_rollouts.Asked(find_file(scene), True, tuple(override_list(overrides)), count), client, threads, out, progress)


def inverse(scene: Union[Scene, Source], overrides: Overrides = None, *, motion: Optional[PathText] = None,
            names: Optional[PathText] = None, loads: Optional[PathText] = None, cutoff: Optional[float] = 6.0,
            clamp: bool = False, check: bool = True, muscles: bool = False, co_contraction: float = 0,
            uncertain: Optional[int] = None, threads: int = 0, client: Any = None, out: Out = None, progress: Progress = None) -> Study:
    """Inverse dynamics: the torques about every axis that make a motion: ``tables["torques"]`` over time, and
    ``tables["summary"]`` by axis.

    :param motion: joint angles, ``.csv``, ``.mot`` or ``.sto``; None: the programs of the scene's control
    :param names: file of the names that the motion's columns have
    :param loads: forces from outside: a table of loads, or the contacts.csv of a run
    :param cutoff: of the low-pass filter on the motion's angles [Hz]; None: no filter
    :param clamp: moves angles beyond a stop to it
    :param check: simulates with the torques
    :param muscles: activations by static optimisation as well, of a scene with muscles: tables ``activations``,
        ``excitations`` and ``reserves``, the torques that the muscles leave undone; the check is driven by these
    :param co_contraction: least activation of every muscle, 0 to 0.9
    :param uncertain: as many hands are drawn within what is uncertain, on ``threads`` cores (0: all) or by ``client``, without the check:
        figures with their intervals in ``summary["outcomes"]``, ``tables["bands"]`` over time; of a scene's file or name
    """
    flags(clamp=clamp, check=check, muscles=muscles)
    if not 0 <= real("co_contraction", co_contraction) <= 0.9:
        raise input_error("co_contraction", str(co_contraction), "0 to 0.9")
    if cutoff is not None:
        real("cutoff", cutoff)
    files = _path("motion", motion), _path("names", names), _path("loads", loads)
    least = float(co_contraction) if muscles else None
    if uncertain is not None:
        whole("uncertain", uncertain, 2)
        if not isinstance(scene, (str, PathLike)):
            raise input_error("scene", "a compiled scene beside uncertain", "its file, or the name of a shipped one")
        asked = _rollouts.Asked(find_file(scene), True, tuple(override_list(overrides)), uncertain, inverse=(*files, cutoff, clamp, least))
        return _drawn(asked, client, threads, out, progress)
    of = scene if isinstance(scene, Scene) else load(scene, overrides)
    with _folder(out) as folder, bar(progress, "inverse") as told:
        found, _, _ = _inverse.study(of, _inverse.Asked(*files, cutoff, clamp, least), check, folder, told)
        ended = f"the check ended early: {found.fault}\n" if found.fault else ""
        return Study("inverse", folder, _inverse.table_text(found) + ended)


def track(recording: PathText, *, person: Optional[PathText] = None, model: Optional[PathText] = None,
          markers: Optional[PathText] = None, truth: Optional[PathText] = None, fit_bones: bool = True,
          smooth: bool = True, noise: float = 0, seed: int = 1, names: Optional[PathText] = None, up: Optional[str] = None,
          points: Optional[PathText] = None, handedness: Optional[str] = None, object: Optional[str] = None, support: Optional[str] = None,
          friction: Optional[float] = None, mass: Union[None, float, str] = None, muscles: bool = False, uncertain: Optional[int] = None,
          replay: bool = False, out: Out = None, progress: Progress = None) -> Study:
    """Inverse kinematics: joint angles (``tables["right"]``) and wrist poses (``tables["right_wrist"]``) of recorded hands.

    :param recording: 21 keypoints, markers or sensors: ``.csv``, ``.json``, ``.trc``, or with ezc3d ``.c3d``
    :param person: person file; None: the median man
    :param model: hand model file; None: the anatomical hand
    :param markers: marker set file, for markers and sensors; None: 21 keypoints
    :param truth: known joint angles (``.mot``, ``.csv``), to compare with
    :param fit_bones: fits hand length, breadth and bones to keypoints
    :param noise: for trials: standard deviation of normal noise on every coordinate [m]
    :param seed: of the noise
    :param names: of C3D: a file of lines ``LABEL: NAME``, the names of its labels in the marker set, or of keypoints
    :param up: the axis that points up, y or z; None: as a C3D file or the convention says, else z
    :param points: convention of the tracker: a file, or the name of a shipped one (``mano``); None: joints' centres
    :param handedness: of the recording's axes, right or left; None: as the convention says, else right
    :param object: ``NAME=FILE`` of an object in the recording: forces on it (docs/forces.md) in ``tables["contact_forces"]``,
        ``tables["object"]``, ``summaries["forces"]``
    :param support: what it rests on: ``table`` (None, too), ``post`` or ``none``
    :param friction: of skin on it, where it was measured; None: 0.8
    :param mass: of it [kg], or ``"free"`` where nobody knows it: forces are for each kilogram; None: that of its file
    :param muscles: forces by least muscle activation
    :param uncertain: draws of what is uncertain, for bands
    :param replay: simulates each lift with the object free: ``summaries["forces"]["lifts"]``
    """
    recording = path_of("recording", recording)
    flags(fit_bones=fit_bones, smooth=smooth)
    real("noise", noise), whole("seed", seed, 0, 2**32 - 1)
    words = {"up": up, "handedness": handedness}
    side = _track.choice(words, "handedness", ("left", "right"))
    asked = _track.checked(_track.Asked(
        recording, _path("person", person), _path("model", model), _path("markers", markers), _path("truth", truth), fit_bones, smooth, noise, seed,
        _path("names", names), _track.choice(words, "up", ("y", "z")), None if points is None else find_file(points, "points", "handmodels/points"),
        None if side is None else side == "left"))
    flags(muscles=muscles, replay=replay)
    given = {"--object": object, "--support": support, "--friction": None if friction is None else str(real("friction", friction)),
             "--mass": None if mass is None else mass if isinstance(mass, str) else str(real("mass", mass)), "--names": names, "--up": up,
             "--uncertain": None if uncertain is None else str(whole("uncertain", uncertain, 2, 1000)), "--muscles": muscles or None, "--replay": replay or None}
    held = _forces_command.request({name: value for name, value in given.items() if value is not None}, recording)
    with _folder(out) as folder, bar(progress, "track") as told, _windows.opened(asked, replay) as work:
        found, _ = work.study(folder, told)
        if held is None or not any(len(hand.tracked) for hand in found.hands):
            return Study("track", folder, _track.screen_text(found))
        text, _ = work.forces(held, folder)
        made, forces = Study("track", folder, _track.screen_text(found) + text), Study("forces", folder / "forces", "")
        made.tables.update({**forces.tables, "contact_forces": read_csv(folder / "forces/contact_forces.csv")})
        made.summaries.update(forces.summaries)
        made.plots.update(forces.plots)
        return made


def validate(measurements: Optional[PathText] = None, *, uncertain: Optional[int] = None, client: Any = None, out: Out = None,
             progress: Progress = None) -> Study:
    """The hand beside measurements: moment arms, forces, moments, masses with their sources.

    :param measurements: file of measurements, or the name of a shipped one; None: config/validate.yaml
    :param uncertain: as many hands are drawn within what is uncertain: columns ``percentile_5``, ``percentile_95``
    :param client: whose workers measure these hands, as in `rollouts`; None: this process, one after the other
    :raises Error: of kind physics, with its name, for a row without a value: a hand that does not hold its posture
    """
    from ._validate_report import study

    file = data_path() / "config/validate.yaml" if measurements is None else find_file(measurements, "measurements")
    count = None if uncertain is None else whole("uncertain", uncertain, 2)
    if count is None and client is not None:
        raise input_error("client", "one without drawn hands", "uncertain beside it")
    with _folder(out) as folder, bar(progress, "validate") as told, _rollouts.executor_of(client, 1) as executor:
        return Study("validate", folder, study(file, folder, uncertain=count, told=told, executor=executor).text)


__all__ = ["Study", "accuracy", "effects", "grasps", "inverse", "read_csv", "read_h5",
           "read_sto", "rollouts", "track", "uncertain", "validate"]
