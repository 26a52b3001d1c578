"""Surfaces of objects from files and arrays: read, repaired where that is certain, and refused with the reason where it is not.

trimesh reads STL, OBJ, PLY and glTF; the repairs are here, because each is told with its size in mm.
"""
from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any, NamedTuple, NoReturn, Optional

import numpy as np
from numpy.typing import NDArray

from ._errors import Error, Problem, input_error, numbers

Floats = NDArray[np.float64]
Faces = NDArray[np.intp]
ENDINGS = (".stl", ".obj", ".ply", ".glb", ".gltf")
METRES = (".glb", ".gltf")
"""Formats that are in metres by their standard; the others have no unit."""
UNITS = {"um": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
"""Of coordinates."""
MOST_BYTES = 512 << 20
MOST_FACES = 2_000_000
LEAST_SIZE, MOST_SIZE = 1e-3, 10.0
THINNEST = 1e-4
"""[m], as of `shape: convex_mesh`."""
DOUBLE = 1e-6
"""Vertices nearer than this part of the size are one: single precision of a file in mm leaves less than a tenth of it."""
CROSSING = 1e-5
"""Surfaces that cross by less than this part of the size do not."""
LEAF = 8
"""Triangles in a leaf of the tree of boxes."""


class Surface(NamedTuple):
    """Closed, with normals away from the material: points (n, 3) [m], triangles (m, 3), and what was done to it, a sentence each."""

    vertices: Floats
    faces: Faces
    outside: int
    """So many of the triangles, the first ones, are not of a cavity."""
    notes: list[str]


class MassAt(NamedTuple):
    """Of a body of one density."""

    volume: float
    """[m^3]"""
    centre: Floats
    """[m]"""
    inertia: Floats
    """About the centre, per mass [m^2], shape (3, 3)."""


def needed(name: str, package: str, purpose: str) -> Any:
    """A module from PyPI. :raises Error: of kind input that says how to get it"""
    try:
        return importlib.import_module(name)
    except ImportError as error:
        reason = f"no Python module {name}" if isinstance(error, ModuleNotFoundError) and error.name == name else f"a module {name} that does not load ({error})"
        raise input_error(package, reason, f"it, for {purpose}: pip install {package}, or pip install 'handsim[object]'") from None


def refuse(file: str, key: str, got: str, need: str) -> NoReturn:
    raise Error(f"{file}: {key}: got {got}, need {need}", "input", [Problem(file, None, None, key, got, need)])


def mm(lengths: Any) -> str:
    """One length or the edges of a box [m], in mm."""
    return " x ".join(f"{round(1e3 * each, 9):.3g}" for each in np.atleast_1d(lengths)) + " mm"


def place(point: Floats) -> str:
    return "[" + ", ".join(f"{1e3 * each:.4g}" for each in point) + "] mm"


def edges_of(points: Floats) -> Floats:
    """Of the box around points [m]."""
    return np.asarray(np.ptp(points, axis=0))


def read_mesh(path: Path) -> tuple[Floats, Faces]:
    """Points in the file's unit and triangles. :raises Error: of kind input for what trimesh cannot read"""
    ending = path.suffix.lower()
    if ending not in ENDINGS:
        refuse(str(path), "file", f"a name that ends in {path.suffix or 'nothing'}", "one of " + ", ".join(ENDINGS))
    if not path.is_file():
        refuse(str(path), "file", "no regular file" if path.exists() else "no file of this name", "a file that can be read")
    if path.stat().st_size > MOST_BYTES:
        refuse(str(path), "file", f"{path.stat().st_size >> 20} MB", f"at most {MOST_BYTES >> 20} MB")
    trimesh = needed("trimesh", "trimesh", "meshes")
    try:
        found = trimesh.load_scene(str(path), process=False, **({"skip_materials": True} if ending == ".obj" else {})).to_mesh()
        vertices, faces = np.array(found.vertices, dtype=float).reshape(-1, 3), np.array(found.faces, dtype=np.intp).reshape(-1, 3)
    except MemoryError:
        raise
    except Exception as error:  # trimesh raises whatever its parts do
        refuse(str(path), "mesh", f"a file that trimesh cannot read ({type(error).__name__}: {str(error)[:200]})", "a whole file of this format")
    return vertices, faces


def arrays_of(vertices: Any, faces: Any) -> tuple[Floats, Faces]:
    """:raises Error: of kind input for arrays that are no mesh"""
    points, corners = numbers("vertices", vertices, "(n, 3)", 2), numbers("faces", faces, "(m, 3)", 2)
    for key, array in (("vertices", points), ("faces", corners)):
        if array.shape[1] != 3:
            raise input_error(key, f"shape {array.shape}", "three columns")
    if (corners != np.floor(corners)).any() or len(corners) and not (corners.min() >= 0 and corners.max() < len(points)):
        raise input_error("faces", "a number that is no index of a vertex", f"whole numbers, 0 to {len(points) - 1}")
    return points, corners.astype(np.intp)


def mass_at(vertices: Floats, faces: Faces) -> MassAt:
    """Exact integrals over the polyhedron: sums over tetrahedra between its faces and a point. Of an open surface they mean nothing."""
    middle = vertices.mean(axis=0)
    a, b, c = np.moveaxis(vertices[faces] - middle, 1, 0)
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6
    volume = float(volumes.sum())
    if volume == 0:
        return MassAt(0, middle, np.zeros((3, 3)))
    total = a + b + c
    centre = volumes @ total / 4 / volume
    # Of a tetrahedron with a corner at the origin: integral of x x^T = V/20 (sum of corners' squares + square of their sum).
    second = sum(np.einsum("i,ij,ik->jk", volumes, each, each) for each in (a, b, c, total)) / 20 / volume - np.outer(centre, centre)
    return MassAt(volume, middle + centre, np.trace(second) * np.eye(3) - second)


def repaired(file: str, vertices: Floats, faces: Faces, unit: str, fill: Optional[float], drop: float, largest: bool) -> Surface:
    """
    A closed surface of one solid body, from points in metres.

    :param file: what errors call it
    :param unit: of the file, for the message about a size
    :param fill: holes up to this size are closed [m]; None: up to 2 % of the mesh's size
    :param drop: separate parts up to this size are left out [m]
    :param largest: all parts but the largest are left out
    :raises Error: of kind input with the place of what cannot be repaired
    """
    notes: list[str] = []
    if not len(faces):
        refuse(file, "mesh", "no face", "the surface of a solid body")
    if len(faces) > MOST_FACES:
        refuse(file, "mesh", f"{len(faces)} triangles", f"at most {MOST_FACES}")
    used = np.unique(faces)
    if not np.isfinite(vertices[used]).all():
        refuse(file, "mesh", f"vertex {used[~np.isfinite(vertices[used]).all(axis=1)][0]} that is not finite", "finite coordinates")
    size = float(edges_of(vertices[used]).max())
    if not LEAST_SIZE <= size <= MOST_SIZE:
        fits = [name for name, scale in UNITS.items() if name != unit and 0.01 <= size / UNITS.get(unit, 1.0) * scale <= 1]
        refuse(file, "unit", f"a mesh of {size:.3g} m in {unit}", f"{LEAST_SIZE:g} to {MOST_SIZE:g} m" +
               (": --unit " + " or ".join(f"{name} ({size / UNITS.get(unit, 1.0) * UNITS[name]:.3g} m)" for name in fits) if fits else ""))
    if edges_of(vertices[used]).min() < THINNEST:
        refuse(file, "mesh", f"a flat mesh of {mm(edges_of(vertices[used]))}", f"a solid body, nowhere thinner than {mm(THINNEST)}")
    if np.abs(vertices[used]).max() > 1000:
        refuse(file, "mesh", f"a mesh {np.abs(vertices[used]).max():.3g} m away from its origin", "one within 1000 m")
    vertices, faces = _merged(vertices, faces, DOUBLE * size, notes)
    if not len(faces):
        refuse(file, "mesh", "triangles of no area", "the surface of a solid body")
    parts = _parts(file, vertices, faces, drop, largest, notes)
    whole = size if fill is None else 0.0
    closed, inward = list[tuple[Floats, Faces]](), list[bool]()
    for part in parts:
        points, corners = _closed(file, *part, 0.02 * whole if fill is None else fill, notes)
        closed.append((points, _turned(file, points, corners)))
        inward.append(closed[-1][1] is not corners)
    vertices, faces = _joined(closed)
    crossing = first_crossing(vertices, faces, CROSSING * size)
    if crossing is not None:
        refuse(file, "mesh", f"a surface that crosses itself near {place(crossing)}",
               "one that does not: unite its parts where it was made (boolean union, or remesh)")
    solid = _one_solid(file, closed, inward, notes)
    return Surface(*_joined(solid), len(solid[0][1]), notes)


def _joined(parts: list[tuple[Floats, Faces]]) -> tuple[Floats, Faces]:
    starts = np.cumsum([0, *(len(points) for points, _ in parts)])
    return np.vstack([points for points, _ in parts]), np.vstack([corners + start for (_, corners), start in zip(parts, starts)])


def _compact(vertices: Floats, faces: Faces) -> tuple[Floats, Faces]:
    used, at = np.unique(faces, return_inverse=True)
    return vertices[used], at.reshape(-1, 3)


def _merged(vertices: Floats, faces: Faces, near: float, notes: list[str]) -> tuple[Floats, Faces]:
    """Without doubles of vertices and faces, and without faces of fewer than three corners."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    vertices, faces = _compact(vertices, faces)
    points, at = np.unique(vertices, axis=0, return_inverse=True)
    faces = at.reshape(-1)[faces]  # equal ones are how STL is written: no word
    pairs = cKDTree(points).query_pairs(near, output_type="ndarray")
    if len(pairs):
        far = float(np.linalg.norm(points[pairs[:, 0]] - points[pairs[:, 1]], axis=1).max())
        count, group = connected_components(coo_matrix((np.ones(len(pairs)), pairs.T), shape=(len(points), len(points))), directed=False)
        notes.append(f"{len(points) - count} vertices were merged with others, at most {mm(far)} away")
        points, faces = points[np.unique(group, return_index=True)[1]], group[faces].astype(np.intp)
    flat = (faces[:, 0] == faces[:, 1]) | (faces[:, 1] == faces[:, 2]) | (faces[:, 2] == faces[:, 0])
    if flat.any():
        notes.append(f"{int(flat.sum())} triangles without area were dropped")
        faces = faces[~flat]
    kept = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)[1]
    if len(kept) < len(faces):
        notes.append(f"{len(faces) - len(kept)} double triangles were dropped")
        faces = faces[np.sort(kept)]
    return _compact(points, faces) if len(faces) else (points, faces)


def _half_edges(faces: Faces) -> Faces:
    """(3 m, 2): the three edges of each face in its direction; edge k is of face k // 3."""
    return np.asarray(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2))


def _groups(faces: Faces) -> tuple[int, Faces]:
    """Number of parts, and the part of each face: faces that share an edge are of one."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    edges = np.sort(_half_edges(faces), axis=1)
    order = np.lexsort(edges.T)
    same = (np.diff(edges[order], axis=0) == 0).all(axis=1)
    a, b = order[:-1][same] // 3, order[1:][same] // 3
    count, group = connected_components(coo_matrix((np.ones(len(a)), (a, b)), shape=(len(faces), len(faces))), directed=False)
    return int(count), group.astype(np.intp)


def _parts(file: str, vertices: Floats, faces: Faces, drop: float, largest: bool, notes: list[str]) -> list[tuple[Floats, Faces]]:
    count, group = _groups(faces)
    parts = [_compact(vertices, faces[group == i]) for i in range(count)] if count <= 1000 else None
    if parts is None:
        refuse(file, "mesh", f"{count} parts without a common edge", "a closed surface; its triangles may have lost each other: merge vertices where it was made")
    parts.sort(key=lambda part: -float(np.linalg.norm(edges_of(part[0]))))
    kept = [part for i, part in enumerate(parts) if i == 0 or not largest and edges_of(part[0]).max() > drop]
    for points, corners in parts:
        if not any(points is each for each, _ in kept):
            notes.append(f"a part of {mm(edges_of(points))} at {place(points.mean(axis=0))} was dropped ({len(corners)} triangles)")
    return kept


def _closed(file: str, vertices: Floats, faces: Faces, fill: float, notes: list[str]) -> tuple[Floats, Faces]:
    """One part with all faces in one direction, and without holes."""
    edges = _half_edges(faces)
    _, first, times = np.unique(np.sort(edges, axis=1), axis=0, return_index=True, return_counts=True)
    if (times > 2).any():
        at = vertices[edges[first[times > 2][0]]].mean(axis=0)
        refuse(file, "mesh", f"{int((times > 2).sum())} edges with more than two faces, the first at {place(at)}", "a surface whose edges have two faces each")
    faces = _in_one_direction(file, vertices, faces, notes)
    edges = _half_edges(faces)
    known = {(int(a), int(b)) for a, b in edges}
    rim = {b: a for a, b in known if (b, a) not in known}  # along the missing faces
    new, points = list[tuple[int, int, int]](), [vertices]
    count = len(vertices)
    open_edges = len(rim)
    while rim:
        start, at = next(iter(rim.items()))
        loop = [start]
        while at != start and at in rim:
            loop.append(at)
            at = rim[at]
        for each in loop:
            del rim[each]
        hole = vertices[loop]
        across = edges_of(hole)
        if at != start or len(loop) < 3 or across.max() > fill:
            refuse(file, "mesh", f"an open mesh: a hole of {mm(across)} at {place(hole.mean(axis=0))}, {open_edges} edges of one face in all",
                   f"a closed surface; holes up to {mm(fill)} are filled, larger ones by --fill {1e3 * across.max() * 1.01:.3g}mm; a thin wall needs its inside, too")
        points.append(hole.mean(axis=0)[None])
        new += [(loop[i], loop[(i + 1) % len(loop)], count) for i in range(len(loop))]
        count += 1
        notes.append(f"a hole of {mm(across)} at {place(hole.mean(axis=0))} was filled ({len(loop)} edges)")
    return np.vstack(points), np.vstack([faces, np.array(new, dtype=np.intp).reshape(-1, 3)])


def _in_one_direction(file: str, vertices: Floats, faces: Faces, notes: list[str]) -> Faces:
    """Neighbours run along their common edge in opposite directions."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import breadth_first_order

    edges = _half_edges(faces)
    order = np.lexsort(np.sort(edges, axis=1).T)
    ordered = np.sort(edges, axis=1)[order]
    same = (np.diff(ordered, axis=0) == 0).all(axis=1)
    a, b = order[:-1][same], order[1:][same]
    against = edges[a, 0] == edges[b, 0]  # both in the same direction: one is turned
    if not against.any():
        return faces
    weights = np.where(against, 2, 1)
    graph = coo_matrix((weights, (a // 3, b // 3)), shape=(len(faces), len(faces))).tocsr()
    graph = graph + graph.T
    walk, before = breadth_first_order(graph, 0, directed=False)
    turned = np.zeros(len(faces), dtype=bool)
    steps = np.asarray(graph[walk[1:], before[walk[1:]]]).reshape(-1)
    for face, parent, step in zip(walk[1:].tolist(), before[walk[1:]].tolist(), steps.tolist()):
        turned[face] = turned[parent] ^ (step == 2)
    if (turned[a // 3] ^ turned[b // 3] ^ against).any():
        at = vertices[edges[a[turned[a // 3] ^ turned[b // 3] ^ against][0]]].mean(axis=0)
        refuse(file, "mesh", f"a surface with one side only, as a Moebius strip, at {place(at)}", "the surface of a solid body")
    if turned.sum() > len(faces) / 2:
        turned = ~turned
    notes.append(f"the normals of {int(turned.sum())} triangles were turned")
    out = faces.copy()
    out[turned] = out[turned][:, ::-1]
    return out


def _turned(file: str, vertices: Floats, faces: Faces) -> Faces:
    """With normals outward."""
    volume, size = mass_at(vertices, faces).volume, edges_of(vertices)
    if not abs(volume) > THINNEST / 10 * float(np.sort(size)[1:].prod()) or size.min() < THINNEST:
        refuse(file, "mesh", f"a part of {mm(size)} with a volume of {1e9 * abs(volume):.3g} mm3", f"a solid body, nowhere thinner than {mm(THINNEST)}")
    return faces if volume > 0 else faces[:, ::-1]


def winding(point: Floats, vertices: Floats, faces: Faces) -> float:
    """How often a closed surface goes round a point: solid angles of its triangles over 4 pi (van Oosterom & Strackee 1983)."""
    a, b, c = np.moveaxis(vertices[faces] - point, 1, 0)
    la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    dots = [np.einsum("ij,ij->i", x, y) for x, y in ((a, b), (b, c), (c, a))]
    return float(np.arctan2(np.einsum("ij,ij->i", a, np.cross(b, c)), la * lb * lc + dots[0] * lc + dots[1] * la + dots[2] * lb).sum() / (2 * np.pi))


def _one_solid(file: str, parts: list[tuple[Floats, Faces]], inward: list[bool], notes: list[str]) -> list[tuple[Floats, Faces]]:
    """Parts that lie within one are cavities; a part outside is a second body."""
    depth = [sum(winding(parts[i][0][0], *other) > 0.5 for k, other in enumerate(parts) if k != i) for i in range(len(parts))]
    solids = [i for i, each in enumerate(depth) if each % 2 == 0]
    if len(solids) > 1:
        from scipy.spatial import cKDTree

        first, second = parts[solids[0]][0], parts[solids[1]][0]
        gap = float(cKDTree(first).query(second)[0].min())
        refuse(file, "mesh", f"{len(solids)} parts that do not touch: {' and '.join(f'{mm(edges_of(parts[i][0]))} at {place(parts[i][0].mean(axis=0))}' for i in solids[:3])}, "
               f"{mm(gap)} between vertices", "one body: --largest keeps the largest part, --drop LENGTH leaves out parts up to a size")
    out = list[tuple[Floats, Faces]]()
    for (points, corners), each, inside_out in zip(parts, depth, inward):
        if each % 2:
            notes.append(f"a cavity of {mm(edges_of(points))} at {place(points.mean(axis=0))} has no mass, and no contact: nothing can reach it")
        elif inside_out:
            notes.append(f"the mesh of {mm(edges_of(points))} was inside out: its normals were turned")
        out.append((points, corners[:, ::-1] if each % 2 else corners))
    out.insert(0, out.pop(solids[0]))
    return out


def first_crossing(vertices: Floats, faces: Faces, depth: float) -> Optional[Floats]:
    """
    A point where an edge goes through a triangle that it has no corner with; None where no edge does.

    :param depth: by which both ends of the edge are beyond the triangle's plane [m], at least
    """
    corners = vertices[faces]
    order = np.argsort(_morton(corners.mean(axis=1)), kind="stable")
    for a, b in _close_pairs(corners[order]):
        first, second = order[a], order[b]
        shared = (faces[first][:, :, None] == faces[second][:, None, :]).sum(axis=(1, 2))
        first, second = first[shared < 2], second[shared < 2]
        for one, other in ((first, second), (second, first)):
            found = _through(corners[one], corners[other], depth)
            if found is not None:
                return found
    return None


def _morton(points: Floats) -> NDArray[np.uint64]:
    """Order along a curve through space: 21 bits of each coordinate, interleaved."""
    low = points.min(axis=0)
    cells = ((points - low) / max(float(np.ptp(points, axis=0).max()), 1e-300) * (2**21 - 1)).astype(np.uint64)
    out = np.zeros(len(points), dtype=np.uint64)
    for bit in range(21):
        for axis in range(3):
            out |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return out


def _close_pairs(corners: Floats) -> Any:
    """Pairs of triangles whose boxes overlap, each once, some at a time: two trees of boxes are gone down together."""
    count = len(corners)
    levels = max(0, int(np.ceil(np.log2(max(1, count / LEAF)))))
    padded = 2**levels * LEAF
    low, high = np.full((padded, 3), np.inf), np.full((padded, 3), -np.inf)
    low[:count], high[:count] = corners.min(axis=1), corners.max(axis=1)
    boxes = [(low, high)]
    boxes.append((low.reshape(-1, LEAF, 3).min(axis=1), high.reshape(-1, LEAF, 3).max(axis=1)))
    while len(boxes[-1][0]) > 1:
        lows, highs = boxes[-1]
        boxes.append((lows.reshape(-1, 2, 3).min(axis=1), highs.reshape(-1, 2, 3).max(axis=1)))

    def overlapping(a: Faces, b: Faces, level: int) -> tuple[Faces, Faces]:
        lows, highs = boxes[level]
        keep = ((lows[a] <= highs[b]) & (lows[b] <= highs[a])).all(axis=1)
        return a[keep], b[keep]

    a = b = np.zeros(1, dtype=np.intp)
    for level in range(len(boxes) - 2, 0, -1):
        a, b = (np.concatenate([2 * a, 2 * a, 2 * a + 1, 2 * a + 1]), np.concatenate([2 * b, 2 * b + 1, 2 * b, 2 * b + 1]))
        a, b = overlapping(a[a <= b], b[a <= b], level)
    inner = np.arange(LEAF)
    for start in range(0, len(a), 20_000):
        one = (a[start:start + 20_000, None, None] * LEAF + inner[None, :, None] + 0 * inner[None, None, :]).reshape(-1)
        other = (b[start:start + 20_000, None, None] * LEAF + inner[None, None, :] + 0 * inner[None, :, None]).reshape(-1)
        keep = (one < other) & (other < count)
        yield overlapping(one[keep], other[keep], 0)


def _through(edges_of_these: Floats, these: Floats, depth: float) -> Optional[Floats]:
    """Where an edge of a triangle goes through the triangle of the same row."""
    a, b, c = np.moveaxis(these, 1, 0)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    heights = np.einsum("ikj,ij->ik", edges_of_these - a[:, None], normal)
    for k in range(3):
        h0, h1 = heights[:, k], heights[:, (k + 1) % 3]
        rows = np.flatnonzero((np.minimum(h0, h1) < -depth) & (np.maximum(h0, h1) > depth))
        if not len(rows):
            continue
        p, q = edges_of_these[rows, k], edges_of_these[rows, (k + 1) % 3]
        at = p + (h0[rows] / (h0[rows] - h1[rows]))[:, None] * (q - p)
        sides = [np.einsum("ij,ij->i", np.cross(end - start, at - start), normal[rows]) / np.maximum(np.linalg.norm(end - start, axis=1), 1e-300)
                 for start, end in ((a[rows], b[rows]), (b[rows], c[rows]), (c[rows], a[rows]))]
        found = np.flatnonzero(np.min(sides, axis=0) > depth)
        if len(found):
            return np.asarray(at[found[0]])
    return None
