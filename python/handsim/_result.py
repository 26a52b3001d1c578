"""The result of a run."""
from __future__ import annotations

import html
from functools import cached_property
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import NDArray

from . import _core
from ._errors import Fault, input_error
from ._files import check_target, write_file
from ._pictures import Picture, contact_sheet, html_picture
from ._table import Quantities, Table, rows_table

if TYPE_CHECKING:
    import pandas

    from ._scene import Camera, Scene


class Verdict(NamedTuple):
    """A figure and its limit."""

    name: str
    unit: str
    measured: Optional[float]
    """None: the run had nothing to measure."""
    limit: Optional[float]
    """None: the figure is measured, not judged."""
    least: bool
    """True for a lower limit."""
    held: bool
    """The limit holds; True without one."""
    time: float
    """Of the figure [s]."""
    where: str
    """Joint or body of the figure."""


def verdicts_of(rows: Sequence[Sequence[Any]]) -> list[Verdict]:
    return [Verdict(*row) for row in rows]


class Result:
    """What a run gave. Can be pickled, without its frames."""

    def __init__(self, scene: "Scene", values: dict[str, Any], folder: Optional[Path] = None) -> None:
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
        import json

        out: dict[str, Any] = json.loads(self._summary)
        return out

    @property
    def trajectory(self) -> Table:
        """Columns of trajectory.csv by name, each of shape (rows,): ``time``, coordinates (by their names) and rates
        (``NAME.rate``), and of each body ``NAME.x``, y, z and the quaternion ``NAME.qw``, qx, qy, qz. A row for each
        ``record.every`` of the scene."""
        if self._rows is None:
            from .study import read_csv

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
        from tempfile import TemporaryDirectory

        with TemporaryDirectory() as parent:
            page = Path(parent) / "page.html"
            _core.report([self.folder or self._write_files(Path(parent) / "run_in_memory")], page)
            text = page.read_text(encoding="utf-8").replace(f"{parent}/", "")
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
             camera: Optional["Camera"] = None) -> list[Picture]:
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
