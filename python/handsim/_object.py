"""`Object`: a mesh as people have it, made an object of scenes."""
from __future__ import annotations

import hashlib
import json
import math
import os
import re
import tempfile
from contextlib import suppress
from copy import copy
from os import PathLike
from pathlib import Path
from typing import Any, Optional, Union

import numpy as np
from numpy.typing import NDArray

from ._errors import Error, Problem, input_error, real, whole
from ._files import check_target, path_of, write_file
from ._object_hulls import Gap, Hull, hulls_within
from ._object_mesh import METRES, UNITS, arrays_of, mass_at, mm, read_mesh, repaired

MARK = "# Made by handsim object"
FRICTIONS = {"foam": (0.54, "foam_die"), "metal": (0.54, "water_bottle_tall"), "plastic": (0.28, "plastic_cup_solo"), "wood": (0.376, "wood_block")}
"""Measured coefficients by a material's name, and the shipped object that has the source; `metal` is a painted bottle's."""
MASSES = (1e-6, 1e4)
HULL_NAME = re.compile(r"mesh: \"?([^\s\",}]+)\"?")


def axis_and_angle(rotation: NDArray[np.float64]) -> tuple[list[float], float]:
    """Of a rotation matrix; angle in degrees."""
    from scipy.spatial.transform import Rotation

    vector = Rotation.from_matrix(rotation).as_rotvec()
    angle = float(np.linalg.norm(vector))
    return ((vector / angle).tolist() if angle > 1e-12 else [0.0, 0.0, 1.0]), math.degrees(angle)


class Object:
    """A mesh as an object of scenes: repaired, as convex hulls within a stated error, with mass, inertia and friction.

    It stands wherever the path of an object file does: ``hs.load({"objects": [{"name": "handle", "file": handle}], ...})``,
    ``hs.load("grasp_power_can", {"objects.0.file": handle})``. Needs trimesh and SciPy; for surfaces that are not convex CoACD and
    fast-simplification, too (``pip install "handsim[object]"``). What was repaired, dropped or filled is in `notes`.
    """

    def __init__(self, source: Any, faces: Any = None, *, unit: Optional[str] = None, mass: Optional[float] = None,
                 density: Optional[float] = None, error: Optional[float] = None, hulls: int = 64, fill: Optional[float] = None,
                 drop: float = 0.0, largest: bool = False, material: Optional[str] = None, friction: Optional[float] = None,
                 color: Optional[str] = None) -> None:
        """
        :param source: path of a file, ``.stl``, ``.obj``, ``.ply``, ``.glb`` or ``.gltf``; or vertices, shape (n, 3)
        :param faces: of vertices: triangles, shape (m, 3), indices from 0
        :param unit: of the coordinates: ``um``, ``mm``, ``cm``, ``m`` or ``in``; required of STL, OBJ and PLY, which have none; of glTF
            and arrays m
        :param mass: [kg]; or `density`
        :param density: [kg/m^3]; the mass is this times the volume of the mesh
        :param error: largest distance between the mesh and the hulls [m]; None: 1 % of the mesh's longest edge
        :param hulls: at most so many, 1 to 200
        :param fill: holes up to this size are closed [m]; None: up to 2 % of the mesh's longest edge
        :param drop: separate parts up to this size are left out [m]
        :param largest: all parts but the largest are left out
        :param material: ``foam``, ``metal``, ``plastic`` or ``wood``: friction of a shipped object; or `friction`
        :param friction: Coulomb coefficient, 0 to 10
        :param color: ``#RRGGBB``, in pictures
        :raises Error: of kind input for a mesh that is no solid body, with the file, what is wrong, and where
        """
        problems = list[Problem]()

        def wrong(key: str, got: object, need: str) -> None:
            problems.append(Problem(None, None, None, key, str(got), need))

        self.name = "arrays"
        path: Optional[Path] = None
        if faces is None:
            path = path_of("source", source)
            self.name = str(path)
            if unit is None and path.suffix.lower() not in METRES:
                wrong("unit", "nothing", "the unit of the file, one of " + ", ".join(UNITS))
        unit = unit or "m"
        if unit not in UNITS:
            wrong("unit", unit, "one of " + ", ".join(UNITS))
        if (mass is None) == (density is None):
            wrong("mass", "neither a mass nor a density" if mass is None else "a mass and a density", "one of the two")
        for key, value, low, high in (("mass", mass, *MASSES), ("density", density, 1, 1e5), ("error", error, 1e-5, 1), ("fill", fill, 0, 10),
                                      ("drop", drop, 0, 10), ("friction", friction, 0, 10)):
            if value is not None and not low <= real(key, value) <= high:
                wrong(key, f"{value:g}", f"{low:g} to {high:g}")
        if material is not None and (material not in FRICTIONS or friction is not None):
            wrong("material", material if friction is None else "a material and a friction", "one of " + ", ".join(FRICTIONS) + ", or a friction")
        if color is not None and not re.fullmatch("#[0-9a-fA-F]{6}", str(color)):
            wrong("color", color, "six hexadecimal digits behind #")
        if problems:
            raise Error("\n".join(f"{each.key}: got {each.got}, need {each.need}" for each in problems), "input", problems)
        whole("hulls", hulls, 1, 200)
        vertices, corners = read_mesh(path) if path is not None else arrays_of(source, faces)
        surface = repaired(self.name, vertices * UNITS[unit], corners, unit, fill, drop, largest)
        self.vertices: NDArray[np.float64] = surface.vertices
        """Of the mesh as it was repaired [m], shape (n, 3)."""
        self.faces: NDArray[np.intp] = surface.faces
        """Triangles of the mesh, normals outward, shape (m, 3)."""
        self.notes: list[str] = surface.notes
        """What was repaired, dropped or filled, a sentence each."""
        at = mass_at(surface.vertices, surface.faces)
        self.volume: float = at.volume
        """Of the mesh [m^3]."""
        self.mass: float = float(mass) if mass is not None else float(density or 0) * at.volume
        """[kg]"""
        if not MASSES[0] <= self.mass <= MASSES[1]:
            raise input_error("density", f"a mass of {self.mass:.3g} kg", f"{MASSES[0]:g} to {MASSES[1]:g} kg")
        self.centre: NDArray[np.float64] = at.centre
        """Of mass, of a mesh of one density, in the file's axes [m], shape (3,)."""
        self.inertia: NDArray[np.float64] = self.mass * at.inertia
        """About the centre, in the file's axes [kg m^2], shape (3, 3)."""
        moments, axes = np.linalg.eigh(at.inertia)
        axes[:, 2] *= np.sign(np.linalg.det(axes))
        self.moments: NDArray[np.float64] = self.mass * moments
        """Principal ones, ascending [kg m^2], shape (3,)."""
        self.axes: NDArray[np.float64] = axes
        """Principal, a column each, right-handed, shape (3, 3)."""
        self.friction: Optional[float] = FRICTIONS[material][0] if material is not None else friction
        """Coulomb coefficient; None: that of scenes, 0.8."""
        self._origin = f"friction of {material}: config/objects/{FRICTIONS[material][1]}.yaml" if material is not None else ""
        self._color = color
        wanted = 0.01 * float(np.ptp(surface.vertices, axis=0).max()) if error is None else float(error)
        found: tuple[list[Hull], Gap] = hulls_within(self.name, surface, wanted, hulls)
        self._hulls, self._gap = found
        self._folder: Optional["tempfile.TemporaryDirectory[str]"] = None
        self._path: Optional[str] = None

    @property
    def hulls(self) -> list[tuple[NDArray[np.float64], NDArray[np.intp]]]:
        """Corners (n, 3) [m] and triangles (m, 3) of each convex hull."""
        return [(hull.vertices, hull.faces) for hull in self._hulls]

    @property
    def error(self) -> float:
        """Largest distance between mesh and hulls, both ways, as measured at `samples` points [m]."""
        return self._gap.hausdorff

    @property
    def samples(self) -> int:
        return self._gap.samples

    def thicker(self, factor: float) -> "Object":
        """The object across its longest axis, that of the least moment, times a factor: of the same length and density.

        :param factor: 0.1 to 10; below 1 it is thinner
        """
        if not 0.1 <= real("factor", factor) <= 10:
            raise input_error("factor", f"{factor:g}", "0.1 to 10")
        long, out = self.axes[:, 0], copy(self)
        scale = factor * np.eye(3) + (1 - factor) * np.outer(long, long)
        out.vertices, out.volume, out.mass = self.centre + (self.vertices - self.centre) @ scale, factor**2 * self.volume, factor**2 * self.mass
        # The second moments of mass change as squares of coordinates.
        second = factor**2 * scale @ (np.trace(self.inertia) / 2 * np.eye(3) - self.inertia) @ scale
        out.inertia = np.trace(second) * np.eye(3) - second
        out.moments, out.axes = np.linalg.eigh(out.inertia)
        out.axes[:, 2] *= np.sign(np.linalg.det(out.axes))
        out._hulls = [Hull(self.centre + (hull.vertices - self.centre) @ scale, hull.faces) for hull in self._hulls]
        most = max(1.0, factor)
        out._gap = Gap(most * self._gap.uncovered, most * self._gap.added, self._gap.samples)
        out.notes, out._folder, out._path = [*self.notes, f"{factor:g} times as thick"], None, None
        return out

    def summary(self) -> dict[str, Any]:
        """What `write` and the command tell, in SI."""
        return {"source": self.name, "triangles": len(self.faces), "size": np.ptp(self.vertices, axis=0).tolist(), "volume": self.volume, "mass": self.mass,
                "centre": self.centre.tolist(), "moments": self.moments.tolist(), "axes": self.axes.T.tolist(), "friction": self.friction,
                "hulls": len(self._hulls), "corners": sum(len(hull.vertices) for hull in self._hulls), "error": self.error, "uncovered": self._gap.uncovered,
                "added": self._gap.added, "samples": self.samples, "notes": self.notes}

    def write(self, path: Union[str, "PathLike[str]"]) -> Path:
        """Writes the object file, and its hulls in a folder beside it.

        The object file gets its name last: it is complete or not there. Hulls of an earlier one of its name go.

        :param path: ends in ``.yaml``
        :raises Error: of kind input where something else than an object of this kind has that name; of kind output on a full disk
        """
        target = path_of("path", path)
        if target.suffix != ".yaml":
            raise input_error("path", target, "a name that ends in .yaml")
        check_target("path", target, "object", [self.name] if self.name != "arrays" else [])
        meshes = [_obj_text(hull) for hull in self._hulls]
        digest = hashlib.sha256(b"".join(meshes)).hexdigest()[:8]
        folder = target.parent / f"{target.stem}_hulls"
        files = {folder / f"{digest}_{i:03d}.obj": content for i, content in enumerate(meshes)}
        before = _hulls_named(target)
        made = not os.path.lexists(folder)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise input_error("path", f"{folder} ({error.strerror})", "a folder that can be written") from None
        new = [each for each in files if not os.path.lexists(each)]
        try:
            for each in set(files) - set(new):
                check_target("path", each, "hull")
            for each, content in files.items():
                write_file(each, content)
            write_file(target, self._text([f"{folder.name}/{each.name}" for each in files]).encode())
        except Error:
            for each in new:
                with suppress(OSError):
                    each.unlink()
            if made:
                with suppress(OSError):
                    folder.rmdir()
            raise
        for each in before - set(files):
            with suppress(OSError):
                if each.read_bytes().startswith(MARK.encode()):
                    each.unlink()
        return target

    def _text(self, meshes: list[str]) -> str:
        axis, angle = axis_and_angle(self.axes)
        radii = np.sqrt(self.moments / self.mass).tolist()
        name = json.dumps(Path(self.name).name)
        lines = [f"{MARK} from {name}: {len(meshes)} convex hulls, at most {mm(self.error)} from its surface (measured at {self.samples} points).",
                 f"source: {json.dumps(f'mesh {Path(self.name).name}, mass as stated' + ('; ' + self._origin if self._origin else ''))}"]
        lines += [f'color: "{self._color}"'] if self._color else []
        lines += [f"mass: {self.mass!r}", f"inertia: {{centre: {self.centre.tolist()}, radii: {radii}, rotation: {{axis: {axis}, angle: \"{angle!r} deg\"}}}}"]
        lines += [f"friction: {self.friction!r}"] if self.friction is not None else []
        if len(meshes) == 1:
            lines += ["shape: convex_mesh", f"mesh: {json.dumps(meshes[0])}"]
        else:
            lines += ["parts:", *(f"  - {{shape: convex_mesh, mesh: {json.dumps(each)}}}" for each in meshes)]
        return "\n".join(lines) + "\n"

    def __fspath__(self) -> str:
        """The path of a file that is written once and lives as long as this object."""
        if self._path is None:
            self._folder = tempfile.TemporaryDirectory(prefix="handsim_object_")
            self._path = str(self.write(Path(self._folder.name) / "object.yaml"))
        return self._path

    def __repr__(self) -> str:
        return f"<handsim.Object: {Path(self.name).name}; {1e3 * self.mass:.4g} g, {len(self._hulls)} hulls within {mm(self.error)}>"


def _obj_text(hull: Hull) -> bytes:
    lines = [f"{MARK}: a convex hull [m]", *("v " + " ".join(f"{x:.9g}" for x in point) for point in hull.vertices),
             *("f " + " ".join(str(corner + 1) for corner in face) for face in hull.faces)]
    return ("\n".join(lines) + "\n").encode()


def _hulls_named(target: Path) -> set[Path]:
    """Meshes that an earlier object file names."""
    try:
        text = target.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return set()
    return {target.parent / name for name in HULL_NAME.findall(text) if text.startswith(MARK)}
