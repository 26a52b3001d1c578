"""Objects that a recording has beside hands: what they are made of, and where they were.

An object is one rigid link, or two that a hinge joins. It is read from an object file of scenes, or from a URDF with meshes (.obj).
"""
from __future__ import annotations

import json
import math
import re
import tempfile
import xml.etree.ElementTree as xml
from array import array
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Iterator, Mapping, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._c3d import as_csv, is_c3d
from ._errors import Error, input_error
from ._model import IDENTITY, Shape, compose, matrices, surface, turn_of, turned
from ._scene import load
from ._shipped import find_file

Array = NDArray[np.float64]
SPACING = 1e-3
"""Between the points that stand for a surface [m]."""
MOST_POINTS = 400_000
"""Of the surface of an object; a large one has a wider spacing."""
PARTS = ("x", "y", "z", "qw", "qx", "qy", "qz", "angle")
COLUMN = re.compile(r"object\.([\w-]+)\.(x|y|z|qw|qx|qy|qz|angle)(?:\[(\w+)\])?")
UNITS: Mapping[str, float] = {"": 1.0, "m": 1.0, "mm": 1e-3, "cm": 1e-2, "rad": 1.0, "deg": math.pi / 180}


class Link(NamedTuple):
    """A rigid body; all in its own frame."""

    name: str
    mass: float
    centre: Array
    """Of mass [m]."""
    inertia: Array
    """About the centre of mass [kg m2], shape (3, 3)."""
    points: Array
    """On its surface [m], shape (n, 3)."""
    normals: Array
    """Outwards."""
    corners: list[Array]
    """Of the convex parts that it is for a simulation [m]."""
    triangles: Array
    """Of its surface [m], counter-clockwise seen from outside, shape (n, 3, 3); parts may lie within each other."""


class Hinge(NamedTuple):
    """Joins link 1 to link 0."""

    place: Array
    """In the frame of link 0: of link 1's frame at angle 0 (x y z, quaternion)."""
    axis: Array


class Thing(NamedTuple):
    """An object."""

    name: str
    file: Path
    links: list[Link]
    hinge: Optional[Hinge] = None

    @property
    def mass(self) -> float:
        return sum(link.mass for link in self.links)

    def of_mass(self, mass: float) -> "Thing":
        """The same with another mass [kg]; inertia grows with it."""
        share = mass / self.mass
        return self._replace(links=[link._replace(mass=share * link.mass, inertia=share * link.inertia) for link in self.links])

    def places(self, poses: Array, angles: Array) -> Array:
        """Poses of the links, shape (frames, links, 7), of poses of the object, shape (frames, 7), and angles of the hinge [rad]."""
        if self.hinge is None:
            return poses[:, None]
        open_ = np.array([compose(self.hinge.place, np.array([0, 0, 0, *turn_of(self.hinge.axis * angle)])) for angle in np.nan_to_num(angles)])
        return np.stack([poses, compose(poses, open_.reshape(len(poses), 7))], axis=1)


class Course(NamedTuple):
    """Where an object was."""

    times: Array
    """[s]"""
    poses: Array
    """Of its frame in the world: x y z [m] and quaternion w x y z, shape (frames, 7); NaN where it was not seen."""
    angles: Array
    """Of the hinge [rad]; zeros without one."""


def sampled(points: Array, faces: NDArray[Any], spacing: float) -> tuple[Array, Array]:
    """Points on triangles, about `spacing` apart, and the normals there."""
    a, b, c = (points[faces[:, k].astype(int)] for k in range(3))
    normals = np.cross(b - a, c - a)
    area = np.linalg.norm(normals, axis=1)
    whole = area > 1e-14
    a, b, c, normals = a[whole], b[whole], c[whole], normals[whole] / area[whole, None]
    steps = np.ceil(np.stack([np.linalg.norm(b - a, axis=1), np.linalg.norm(c - a, axis=1), np.linalg.norm(c - b, axis=1)]).max(axis=0) / spacing)
    out, along = [], []
    for n in np.unique(steps.astype(int)):
        i, j = (each.ravel() for each in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
        u, v = i[i + j <= n] / n, j[i + j <= n] / n
        which = steps == n
        out.append((a[which, None] + u[:, None] * (b - a)[which, None] + v[:, None] * (c - a)[which, None]).reshape(-1, 3))
        along.append(np.repeat(normals[which], len(u), axis=0))
    return np.concatenate(out), np.concatenate(along)


def _hull(points: Array) -> Any:
    try:
        from scipy.spatial import ConvexHull
    except ImportError:
        raise input_error("SciPy", "no Python module of this name", "it, for forces on objects: pip install scipy") from None
    return ConvexHull(points)


def hull_faces(corners: Array) -> NDArray[np.intp]:
    """Triangles of a convex part, outwards."""
    middle, faces = corners.mean(axis=0), np.array(_hull(corners).simplices, dtype=np.intp)
    a, b, c = (corners[faces[:, k]] for k in range(3))
    inward = ((a - middle) * np.cross(b - a, c - a)).sum(axis=1) < 0
    faces[inward] = faces[inward][:, [0, 2, 1]]
    return faces


def of_hulls(link: Link) -> Link:
    """With the surface of its convex parts, as a simulation has it."""
    faces = [hull_faces(corners) for corners in link.corners]
    made = [sampled(corners, each, SPACING) for corners, each in zip(link.corners, faces)]
    return link._replace(points=np.concatenate([points for points, _ in made]), normals=np.concatenate([normals for _, normals in made]),
                         triangles=np.concatenate([corners[each] for corners, each in zip(link.corners, faces)]))


def hull_text(corners: Array) -> str:
    """A convex part as a Wavefront file."""
    faces = hull_faces(corners)
    return "".join([f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in corners.tolist()] + [f"f {i + 1} {j + 1} {k + 1}\n" for i, j, k in faces.tolist()])


def spacing_of(triangles: Array) -> float:
    """Between the points that stand for a surface, at most [m]."""
    a, b, c = triangles.transpose(1, 0, 2)
    area = float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()) / 2
    return max(SPACING, math.sqrt(4 * area / MOST_POINTS))


def _of_shapes(shapes: Sequence[Shape], body: Array) -> tuple[Array, Array, list[Array], Array]:
    """The outside of convex parts, in the frame of which `body` is the pose of their body."""
    surfaces = []
    for shape in shapes:
        made = surface(shape)
        pose = compose(body, shape.pose)
        surfaces.append((turned(pose[3:], made.points) + pose[:3], made.faces))
    triangles = np.concatenate([points[faces.astype(int)] for points, faces in surfaces])
    spacing = spacing_of(triangles)
    hulls = [_hull(points) for points, _ in surfaces]
    points, normals = [], []
    for i, (corners, faces) in enumerate(surfaces):
        on, along = sampled(corners, faces, spacing)
        # What lies within another part, or where two parts touch, is no outside.
        inside = np.zeros(len(on), dtype=bool)
        for k, hull in enumerate(hulls):
            if k != i:
                inside |= ((on + 0.1 * spacing * along) @ hull.equations[:, :3].T + hull.equations[:, 3] < 0).all(axis=1)
        points.append(on[~inside])
        normals.append(along[~inside])
    return np.concatenate(points), np.concatenate(normals), [corners[hull.vertices] for (corners, _), hull in zip(surfaces, hulls)], triangles


def of_scene(name: str, file: Path) -> Thing:
    scene = load({"title": name, "objects": [{"name": name, "file": str(file.resolve()), "position": [0, 0, 0]}], "effects": ["gravity"], "duration": "1 s"})
    model = scene._model
    body = model.bodies[-1]
    own = [shape for shape in model.shapes if shape.body == len(model.bodies) - 1]
    if body.mass <= 0 or not own:
        raise input_error(str(file), "an object that does not move", "one with a mass")
    to = matrices(body.zero)[:3, :3]
    return Thing(name, file, [Link(name, body.mass, body.zero[:3], to @ body.inertia @ to.T, *_of_shapes(own, body.zero))])


def read_obj(path: Path) -> tuple[Array, NDArray[np.intp]]:
    """Points [m] and triangles of a Wavefront file. :raises Error: of kind input with the place"""
    points, faces = [], []
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise input_error(str(path), error.strerror or "no file", "a mesh (.obj)") from None
    for number, line in enumerate(lines, 1):
        words = line.split()
        try:
            if words[:1] == ["v"]:
                points.append([float(word) for word in words[1:4]])
            elif words[:1] == ["f"]:
                at = [int(word.partition("/")[0]) for word in words[1:]]
                corners = [k - 1 if k > 0 else len(points) + k for k in at]
                faces += [[corners[0], corners[k], corners[k + 1]] for k in range(1, len(corners) - 1)]
        except ValueError:
            raise input_error(f"{path}:{number}:1", repr(line[:60]), "v x y z, or f and numbers of points") from None
    if not faces or any(len(point) != 3 for point in points) or not all(0 <= k < len(points) for face in faces for k in face):
        raise input_error(str(path), f"{len(points)} points and {len(faces)} triangles", "triangles of points with three coordinates")
    return np.array(points), np.array(faces, dtype=np.intp)


def _numbers(text: Optional[str], count: int) -> Array:
    return np.array([float(word) for word in text.split()] if text else [0.0] * count)


def _origin(of: Optional[xml.Element]) -> Array:
    """The pose of an <origin>: roll, pitch and yaw about fixed axes."""
    if of is None:
        return IDENTITY
    roll, pitch, yaw = _numbers(of.get("rpy"), 3)
    x, y, z = (np.array([0, 0, 0, *turn_of(np.eye(3)[k] * angle)]) for k, angle in enumerate((roll, pitch, yaw)))
    out = compose(compose(z, y), x)
    out[:3] = _numbers(of.get("xyz"), 3)
    return out


def _link(of: xml.Element, folder: Path) -> Link:
    mesh, mass, inertia = of.find("collision/geometry/mesh"), of.find("inertial/mass"), of.find("inertial/inertia")
    if mesh is None or mass is None or inertia is None:
        raise ValueError(f"link {of.get('name')} without a mesh, a mass or an inertia")
    place = _origin(of.find("inertial/origin"))
    xx, xy, xz, yy, yz, zz = (float(inertia.get("i" + key, "0")) for key in ("xx", "xy", "xz", "yy", "yz", "zz"))
    to = matrices(place)[:3, :3]
    points, faces = read_obj(folder / str(mesh.get("filename")).rpartition("://")[2])
    points = points * _numbers(mesh.get("scale", "1 1 1"), 3)
    pose = _origin(of.find("collision/origin"))
    points = turned(pose[3:], points) + pose[:3]
    on, normals = sampled(points, faces, spacing_of(points[faces]))
    return Link(str(of.get("name")), float(mass.get("value", "nan")), place[:3], to @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ to.T, on, normals,
                [points[_hull(points).vertices]], points[faces])


def _of_urdf(name: str, file: Path) -> Thing:
    need = "a URDF of one link, or of two that a revolute joint joins, with meshes, masses and inertias"
    try:
        root = xml.parse(file).getroot()
        links = {str(each.get("name")): _link(each, file.parent) for each in root.findall("link")}
        joints = root.findall("joint")
        if not links or len(links) > 2 or len(joints) != len(links) - 1:
            raise ValueError(f"{len(links)} links and {len(joints)} joints")
        if not joints:
            return Thing(name, file, list(links.values()))
        parent, child = (str(found.get("link")) for found in map(joints[0].find, ("parent", "child")) if found is not None)
        axis = _numbers(found.get("xyz") if (found := joints[0].find("axis")) is not None else "1 0 0", 3)
        return Thing(name, file, [links[parent], links[child]], Hinge(_origin(joints[0].find("origin")), axis / np.linalg.norm(axis)))
    except (OSError, xml.ParseError, ValueError, KeyError) as error:
        if isinstance(error, Error):
            raise
        raise input_error(str(file), str(error), need) from None


def read_object(word: str) -> Thing:
    """:param word: NAME=FILE, the file one of objects, a shipped one by its name, or a URDF. :raises Error: of kind input"""
    name, equals, text = word.partition("=")
    if not equals or not re.fullmatch(r"[\w-]+", name) or not text:
        raise input_error("--object", word, "NAME=FILE, as can=tomato_soup_can")
    file = find_file(text, "--object", "config/objects")
    return _of_urdf(name, file) if file.suffix.lower() == ".urdf" else of_scene(name, file)


# Where they were.

def _refuse(path: Path, names: Sequence[str], name: str) -> Error:
    known = ", ".join(sorted(set(names))) or "none"
    columns = f"rigid body {name}" if is_c3d(path) else f"columns object.{name}.x[m] to object.{name}.qz"
    return input_error(str(path), f"no {columns}; objects that it has: {known}", "the place of every --object")


def _of_csv(path: Path) -> dict[str, Course]:
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        head = file.readline().strip().split(",")
        found = {i: match for i, label in enumerate(head) if (match := COLUMN.fullmatch(label.strip()))}
        if not found:
            return {}
        rows = array("d")
        wanted = [0, *found]
        for number, line in enumerate(file, 2):
            fields = line.rstrip("\r\n").split(",")
            if len(fields) == 1 and not fields[0].strip():
                continue
            try:
                rows.extend([float(fields[i]) if i < len(fields) and fields[i].strip() else math.nan for i in wanted])
            except ValueError:
                raise input_error(f"{path}:{number}:1", line[:60].strip(), "numbers, or nothing, in the columns of objects") from None
    table = np.array(rows).reshape(-1, len(wanted))
    out: dict[str, Course] = {}
    for name in dict.fromkeys(match[1] for match in found.values()):
        columns = {match[2]: UNITS.get(match[3] or "", math.nan) * table[:, 1 + k] for k, match in enumerate(found.values()) if match[1] == name}
        lost = [part for part in PARTS[:7] if part not in columns]
        if lost:
            raise input_error(str(path), f"object.{name} without {', '.join(lost)}", "x y z qw qx qy qz of an object")
        out[name] = Course(table[:, 0].copy(), np.stack([columns[part] for part in PARTS[:7]], axis=1), columns.get("angle", np.zeros(len(table))))
    return out


def _of_json(path: Path) -> dict[str, Course]:
    """``{"frames": [{"objects": [{"name": "can", "position": [x, y, z], "quaternion": [w, x, y, z], "angle": 0}]}]}``"""
    try:
        content = json.loads(path.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError):
        return {}
    frames = content.get("frames", []) if isinstance(content, dict) else []
    scale = {"m": 1.0, "mm": 1e-3, "cm": 1e-2}.get(str(content.get("unit", "m")) if isinstance(content, dict) else "m", 1.0)
    rate = content.get("rate") if isinstance(content, dict) else None
    times, rows = [], dict[str, dict[int, list[float]]]()
    for i, frame in enumerate(frames):
        times.append(float(frame["time"]) if "time" in frame else i / float(rate) if rate else math.nan)
        for each in frame.get("objects", []):
            place, turn = each.get("position"), each.get("quaternion")
            try:
                row = [*(scale * float(x) for x in place), *map(float, turn), float(each.get("angle", 0))]
            except (TypeError, ValueError):
                continue  # was not seen
            if len(row) == 8:
                rows.setdefault(str(each.get("name")), {})[i] = row
    out = {}
    for name, seen in rows.items():
        table = np.full((len(times), 8), math.nan)
        for i, row in seen.items():
            table[i] = row
        out[name] = Course(np.array(times), table[:, :7], table[:, 7])
    return out


def _of_c3d(path: Path, labels: Optional[Path], up: Optional[str]) -> dict[str, Course]:
    with as_csv(path, labels, up) as table:
        return _of_csv(table)


def read_courses(path: Path, names: Sequence[str], labels: Optional[Path] = None, up: Optional[str] = None) -> dict[str, Course]:
    """:param labels: file of names of a C3D file's labels
    :param up: axis that points up in it
    :raises Error: of kind input where one of the objects is not in the recording
    """
    kind = path.suffix.lower()
    found = _of_csv(path) if kind == ".csv" else _of_json(path) if kind == ".json" else _of_c3d(path, labels, up) if is_c3d(path) else {}
    for name in names:
        if name not in found:
            raise _refuse(path, list(found), name)
        course = found[name]
        norm = np.linalg.norm(course.poses[:, 3:], axis=1)
        if np.nanmax(np.abs(norm - 1), initial=0) > 0.05:
            raise input_error(str(path), f"quaternions of object.{name} of length {np.nanmin(norm):.3g} to {np.nanmax(norm):.3g}", "unit quaternions w x y z")
        course.poses[:, 3:] /= norm[:, None]
        if np.count_nonzero(np.isfinite(course.poses).all(axis=1)) < 4:
            raise input_error(str(path), f"object.{name} in fewer than four frames", "an object that was seen")
    return {name: found[name] for name in names}


@contextmanager
def without_objects(path: Path) -> Iterator[Path]:
    """A table without the columns of objects, for the reader of hands."""
    head = ""
    if path.suffix.lower() == ".csv":
        try:
            with open(path, encoding="utf-8-sig", errors="replace") as file:
                head = file.readline(1 << 20)
        except OSError:
            pass
    kept = [i for i, label in enumerate(head.strip().split(",")) if not COLUMN.fullmatch(label.strip())]
    if len(kept) == len(head.strip().split(",")):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="handsim_track_") as folder, open(path, encoding="utf-8-sig", errors="replace") as file:
        out = Path(folder) / path.name
        with open(out, "w", encoding="utf-8") as to:
            for line in file:
                fields = line.rstrip("\r\n").split(",")
                to.write(",".join(fields[i] for i in kept if i < len(fields)) + "\n")
        yield out
