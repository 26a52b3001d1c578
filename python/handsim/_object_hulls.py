"""A closed surface as convex hulls, as few as a stated error allows, and the error that they have. Needs SciPy, CoACD and fast-simplification.

CoACD (Wei et al. 2022, ACM Trans Graph 41(4):42) cuts until no hull stands off the surface by more than a bound, so that hollows which a hand
or a ball can enter stay open; V-HACD's bound is of volume, which closes thin walls first. The error is measured afterwards, here, between the
surface that was read and the hulls that are written.
"""
from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import NDArray

from ._errors import Error, input_error
from ._object_mesh import THINNEST, Faces, Floats, Surface, mm, needed, refuse

SAMPLES = 30_000
"""Points on each of the two surfaces between which the error is measured, at least."""
NEAREST = 8
"""Triangles that are tried for the nearest point, by their samples."""
BOUNDS = (1.0, 0.7, 0.5, 0.35)
"""Of CoACD, in shares of the error that is wanted, one after the other until the measured one keeps to it."""
THIN, JOIN, CORNERS, SLIT = 0.2, 0.6, 0.15, 0.3
"""Shares of the error: of fewer triangles before the cuts, of hulls that become one, of corners left out, and the gaps that are no surface."""
MOST_CORNERS = 1000
"""Of a hull, as the program takes."""
MOST_CUTS = 400
"""Hulls from CoACD that are joined again: a finer cut of all takes minutes and leaves gaps."""


@dataclass(frozen=True)
class Hull:
    """A convex body: corners (n, 3) and triangles (m, 3), normals outward."""

    vertices: Floats
    faces: Faces

    @cached_property
    def planes(self) -> Floats:
        """Rows of unit normal and offset: inside where normal . x + offset is below 0."""
        a, b, c = np.moveaxis(self.vertices[self.faces], 1, 0)
        normals = np.cross(b - a, c - a)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
        return np.column_stack([normals, -np.einsum("ij,ij->i", normals, a)])

    @cached_property
    def box(self) -> tuple[Floats, Floats]:
        return self.vertices.min(axis=0), self.vertices.max(axis=0)

    def heights(self, points: Floats) -> Floats:
        """Above each plane, shape (points, planes) [m]."""
        return np.asarray(points @ self.planes[:, :3].T + self.planes[:, 3])

    def highest(self, points: Floats) -> Floats:
        """Above the highest plane (n,), below 0 within the hull."""
        return above_highest(self.planes, points)[0]

    def within(self, points: Floats, reach: float) -> Faces:
        """Rows of the points up to so far [m] outside its box."""
        low, high = self.box
        return np.flatnonzero(((points > low - reach) & (points < high + reach)).all(axis=1))


def above_highest(planes: Floats, points: Floats) -> tuple[Floats, Faces]:
    """Heights above the highest of planes (n,) [m], and the planes' rows; a million numbers at a time."""
    heights, rows = np.zeros(len(points)), np.zeros(len(points), dtype=np.intp)
    some = max(1, 1_000_000 // len(planes))
    for i in range(0, len(points), some):
        each = points[i:i + some] @ planes[:, :3].T + planes[:, 3]
        rows[i:i + some] = each.argmax(axis=1)
        heights[i:i + some] = each.max(axis=1)
    return heights, rows


class Gap(NamedTuple):
    """Largest distances [m] from points of one surface to the other; the Hausdorff distance is the larger of the two."""

    uncovered: float
    """From the surface that was read to that of the hulls."""
    added: float
    """From the surface of the hulls to the one that was read."""
    samples: int

    @property
    def hausdorff(self) -> float:
        return max(self.uncovered, self.added)


def hull_of(points: Floats) -> Hull:
    """:raises Error: of kind input for points that span no volume"""
    from scipy.spatial import ConvexHull, QhullError

    try:
        found = ConvexHull(points)
    except QhullError:
        raise input_error("mesh", "a surface that is flat", "one of a solid body") from None
    corners, place = np.unique(found.simplices, return_inverse=True)
    vertices, faces = np.asarray(points[corners], dtype=float), place.reshape(-1, 3).astype(np.intp)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return Hull(vertices, faces)


def reduced(hull: Hull, error: float) -> Hull:
    """The hull of few of the corners, which keep all others within a distance of it [m]: the farthest one above each face next."""
    from scipy.spatial import ConvexHull, QhullError

    points = hull.vertices
    kept = list(dict.fromkeys(int(np.argmax(points @ axis)) for axis in np.vstack([np.eye(3), -np.eye(3)])))
    left = np.arange(len(points))  # what is near one hull is near all larger ones, but where edges are sharp: all are tried again at the end
    while len(kept) < len(points):
        try:
            planes = ConvexHull(points[kept]).equations
        except QhullError:  # they lie in a plane so far
            normal = np.linalg.svd(points[kept] - points[kept[0]], full_matrices=True)[2][-1]
            far, limit, above = np.abs((points[left] - points[kept[0]]) @ normal), 0.0, np.zeros(len(left), dtype=np.intp)
        else:
            limit = error
            far, above = above_highest(planes, points[left])
        far[np.isin(left, kept)] = -np.inf
        order = np.argsort(-far)
        order = order[far[order] > limit]
        if not len(order) and len(left) == len(points):
            break
        kept += left[order[np.unique(above[order], return_index=True)[1]]].tolist()
        left = left[order] if limit and len(order) else np.arange(len(points))
    return hull_of(points[kept])


def sampled(vertices: Floats, faces: Faces, count: int, rng: np.random.Generator) -> tuple[Floats, Faces]:
    """Points of a surface and the triangle of each: even in area, one in the middle of each triangle, and a row along long thin ones."""
    corners = vertices[faces]
    a, b, c = np.moveaxis(corners, 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    at = np.searchsorted(np.cumsum(areas), (np.arange(count) + rng.random(count)) / count * areas.sum()).clip(0, len(faces) - 1)
    u, v = rng.random((2, count))
    outside = u + v > 1
    u[outside], v[outside] = 1 - u[outside], 1 - v[outside]
    points = a[at] + u[:, None] * (b - a)[at] + v[:, None] * (c - a)[at]
    # From the middle of the shortest edge to the corner beyond it.
    shortest = np.argmin(np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2), axis=1)
    rows = np.arange(len(faces))
    start, end = (corners[rows, shortest] + corners[rows, (shortest + 1) % 3]) / 2, corners[rows, (shortest + 2) % 3]
    length, spacing = np.linalg.norm(end - start, axis=1), np.sqrt(areas.sum() / count)
    many = np.where(areas < length * spacing, np.ceil(length / spacing), 0).astype(np.intp)
    along = np.repeat(rows, many)
    share = (np.arange(len(along)) - np.repeat(np.cumsum(many) - many, many) + 0.5) / many[along]
    return np.vstack([points, (a + b + c) / 3, start[along] + share[:, None] * (end - start)[along]]), np.concatenate([at, rows, along])


def nearest(points: Floats, a: Floats, b: Floats, c: Floats) -> Floats:
    """Of each triangle, its point nearest to the point of the same row (Ericson 2005, Real-Time Collision Detection, 5.1.5)."""
    def dot(x: Floats, y: Floats) -> Floats:
        return np.asarray(np.einsum("...i,...i->...", x, y))

    def share(x: Floats, y: Floats) -> Floats:
        return np.clip(np.divide(x, y, out=np.zeros_like(x), where=y > 0), 0, 1)[..., None]

    ab, ac, bc = b - a, c - a, c - b
    on = [a + share(dot(points - a, ab), dot(ab, ab)) * ab, a + share(dot(points - a, ac), dot(ac, ac)) * ac,
          b + share(dot(points - b, bc), dot(bc, bc)) * bc]
    def cross(x: Floats, y: Floats) -> Floats:
        return np.stack([x[..., 1] * y[..., 2] - x[..., 2] * y[..., 1], x[..., 2] * y[..., 0] - x[..., 0] * y[..., 2],
                         x[..., 0] * y[..., 1] - x[..., 1] * y[..., 0]], axis=-1)

    normal = cross(ab, ac)
    square = dot(normal, normal)
    height = np.divide(dot(points - a, normal), square, out=np.zeros_like(square), where=square > 0)
    foot = points - height[..., None] * normal
    inside = (dot(cross(ab, foot - a), normal) >= 0) & (dot(cross(bc, foot - b), normal) >= 0) & (dot(cross(ac, foot - a), normal) <= 0)
    best = on[0]
    for each in on[1:]:
        nearer = dot(each - points, each - points) < dot(best - points, best - points)
        best = np.where(nearer[..., None], each, best)
    return np.where((inside & (square > 0))[..., None], foot, best)


class Target:
    """A surface to which distances are asked."""

    def __init__(self, vertices: Floats, faces: Faces, points: Floats, of: Faces) -> None:
        """
        :param points: samples, and `of` the triangle of each
        """
        from scipy.spatial import cKDTree

        self.faces = faces
        self.corners, self.of, self.tree = np.moveaxis(vertices[faces], 1, 0), of, cKDTree(points)

    def feet(self, points: Floats) -> tuple[Floats, Floats, Faces]:
        """Distances to the nearest sample (n,), and points of the nearest triangles (n, NEAREST, 3), with the triangles' numbers."""
        some = 50_000
        if len(points) > some:
            parts = [self.feet(points[i:i + some]) for i in range(0, len(points), some)]
            return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts]), np.concatenate([part[2] for part in parts])
        count = min(NEAREST, self.tree.n)
        far, at = self.tree.query(points, k=count, workers=-1)
        far, at = far.reshape(len(points), count), at.reshape(len(points), count)
        triangles = self.of[at]
        a, b, c = (each[triangles] for each in self.corners)
        return far[:, 0], nearest(np.repeat(points[:, None], count, axis=1), a, b, c), triangles

    def distances(self, points: Floats) -> Floats:
        """Of a closed surface: from the best of the triangles on to its neighbours, as long as they are nearer."""
        _, feet, triangles = self.feet(points)
        far = np.linalg.norm(feet - points[:, None], axis=2)
        best = far.argmin(axis=1)
        rows = np.arange(len(points))
        out, at = far[rows, best], triangles[rows, best]
        for _ in range(10):
            beside = self.neighbours[at[rows]]
            a, b, c = (each[beside] for each in self.corners)
            far = np.linalg.norm(nearest(np.repeat(points[rows, None], 3, axis=1), a, b, c) - points[rows, None], axis=2)
            best = far.argmin(axis=1)
            least = far[np.arange(len(rows)), best]
            nearer = least < out[rows] * (1 - 1e-9)
            rows, beside = rows[nearer], beside[nearer, best[nearer]]
            out[rows], at[rows] = least[nearer], beside
            if not len(rows):
                break
        return np.asarray(out)

    @cached_property
    def neighbours(self) -> Faces:
        """Of each triangle those across its edges, shape (m, 3); itself where there is none."""
        edges = np.sort(np.stack([self.faces, np.roll(self.faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        order = np.lexsort(edges.T)
        same = np.flatnonzero((np.diff(edges[order], axis=0) == 0).all(axis=1))
        first, second = order[same], order[same + 1]
        out = np.repeat(np.arange(len(self.faces)), 3)
        out[first], out[second] = second // 3, first // 3
        return out.reshape(-1, 3)


def inside_others(points: Floats, hulls: Sequence[Hull], own: Faces, depth: float) -> NDArray[np.bool_]:
    """Whether a point lies deeper than this [m] in a hull other than its own; below 0: up to so far outside."""
    out = np.zeros(len(points), dtype=bool)
    for i, hull in enumerate(hulls):
        rows = hull.within(points, -depth)
        rows = rows[~out[rows] & (own[rows] != i)]
        if len(rows):
            out[rows] = hull.highest(points[rows]) < -depth
    return out


def joined(hulls: Sequence[Hull], surface: "Target", error: float, slit: float) -> list[Hull]:
    """Fewer hulls: neighbours become one, those first whose hull in common stands off the surface least, up to the error [m].

    CoACD joins by a bound of its own, which leaves two to three times as many on walls that are bent.
    """
    rng = np.random.default_rng(0)
    alive = dict(enumerate(hulls))

    def price(a: Hull, b: Hull) -> tuple[float, Optional[Hull]]:
        if (np.maximum(a.box[0], b.box[0]) > np.minimum(a.box[1], b.box[1]) + slit).any():
            return np.inf, None
        both = hull_of(np.vstack([a.vertices, b.vertices]))
        points, _ = sampled(both.vertices, both.faces, 200, rng)
        for hull in (a, b, *alive.values()):
            points = points[~inside_others(points, [hull], np.full(len(points), -1), -slit)]
            if not len(points):
                return 0.0, both
        return float(surface.distances(points).max()), both

    prices = {(i, k): price(alive[i], alive[k]) for i in alive for k in alive if i < k}
    count = len(hulls)
    while prices:
        pair = min(prices, key=lambda each: prices[each][0])
        least, both = prices[pair]
        if least > error or both is None:
            break
        for each in pair:
            del alive[each]
        prices = {of: value for of, value in prices.items() if not set(of) & set(pair)}
        prices.update({(k, count): price(each, both) for k, each in alive.items()})
        alive[count] = both
        count += 1
    return list(alive.values())


def error_of(vertices: Floats, faces: Faces, hulls: Sequence[Hull], slit: float, count: int = SAMPLES) -> Gap:
    """Between a surface and that of hulls in union.

    :param slit: gaps between neighbouring hulls narrower than this [m] are no surface
    """
    rng = np.random.default_rng(0)
    corners = np.vstack([hull.vertices for hull in hulls])
    starts = np.cumsum([0, *(len(hull.vertices) for hull in hulls)])
    triangles = np.vstack([hull.faces + start for hull, start in zip(hulls, starts)])
    owner = np.repeat(np.arange(len(hulls)), [len(hull.faces) for hull in hulls])
    points, at = sampled(corners, triangles, count, rng)
    # A point of a hull is on the surface of all where no other hull is right above it.
    out = points + slit * np.vstack([hull.planes[:, :3] for hull in hulls])[at]
    bare = ~inside_others(out, hulls, owner[at], 0.0)
    points, at = points[bare], at[bare]
    read, read_at = sampled(vertices, faces, count, rng)
    added = Target(vertices, faces, read, read_at).distances(points)
    target = Target(corners, triangles, points, at)
    far, feet, of = target.feet(read)
    # What lies within another hull is no surface; then the nearest sample counts.
    covered = inside_others(feet.reshape(-1, 3), hulls, owner[of].reshape(-1), slit).reshape(feet.shape[:2])
    exact = np.where(covered, np.inf, np.linalg.norm(feet - read[:, None], axis=2)).min(axis=1)
    best = np.minimum(exact, far)
    for i, hull in enumerate(hulls):
        rows = hull.within(read, float(best.max()))
        if not len(rows):
            continue
        height, face = above_highest(hull.planes, read[rows])
        foot = read[rows] - height[:, None] * hull.planes[face, :3]
        on = (np.abs(height) < best[rows]) & (hull.highest(foot) < 1e-9)
        on[on] = ~inside_others(foot[on], hulls, np.full(int(on.sum()), i), slit)
        best[rows[on]] = np.abs(height[on])
    return Gap(float(best.max()), float(added.max()), len(read) + len(points))


def simplified(vertices: Floats, faces: Faces, error: float) -> tuple[Floats, Faces]:
    """A closed surface of fewer triangles, at most so far from the given one, both ways [m]; itself where there is none."""
    tool = needed("fast_simplification", "fast-simplification", "surfaces of many triangles")
    given, at = sampled(vertices, faces, SAMPLES // 2, np.random.default_rng(0))
    target = Target(vertices, faces, given, at)
    middle, size = vertices.mean(axis=0), float(np.ptp(vertices, axis=0).max())
    small = ((vertices - middle) / size).astype(np.float32)  # the tool counts in single precision
    for count in (500, 1000, 2000, 4000, 8000, 16000, 32000):
        if count > len(faces) / 2:
            break
        points, corners = tool.simplify(small, faces.astype(np.int32), target_count=count)
        points, corners = points.astype(float) * size + middle, corners.astype(np.intp)
        if not _is_closed(corners):
            continue
        own, own_at = sampled(points, corners, SAMPLES // 2, np.random.default_rng(1))
        if max(target.distances(own).max(), Target(points, corners, own, own_at).distances(given).max()) <= error:
            return points, corners
    return vertices, faces


def _is_closed(faces: Faces) -> bool:
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    return bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all() and (edges[:, 0] != edges[:, 1]).all())


def hulls_within(file: str, surface: Surface, error: float, most: int) -> tuple[list[Hull], Gap]:
    """
    Convex hulls whose union is nowhere farther than the error [m] from the surface, as measured.

    :param file: what errors call it
    :param most: hulls
    :raises Error: of kind input, with the least error that was reached, where there are none
    """
    used, faces = np.unique(surface.faces[:surface.outside], return_inverse=True)
    vertices, faces = surface.vertices[used], faces.reshape(-1, 3)
    slit = SLIT * error
    whole = [reduced(hull_of(vertices), 0.8 * error)]
    gap = error_of(vertices, faces, whole, slit)
    if gap.hausdorff <= error and len(whole[0].vertices) <= MOST_CORNERS:
        return whole, gap
    tool = needed("coacd", "coacd", "objects that are not convex")
    tool.set_log_level("error")
    target = Target(vertices, faces, *sampled(vertices, faces, SAMPLES // 2, np.random.default_rng(0)))
    fewer = simplified(vertices, faces, THIN * error)
    middle = vertices.mean(axis=0)
    reached: list[tuple[float, int]] = []
    for bound in BOUNDS:
        cut = tool.run_coacd(tool.Mesh(fewer[0] - middle, fewer[1]), threshold=bound * error, real_metric=True, mcts_nodes=10, mcts_iterations=40, merge=False, seed=0)
        parts = [hull for hull in (_solid(np.asarray(points, dtype=float) + middle) for points, _ in cut) if hull is not None]
        if not parts or len(parts) > MOST_CUTS:
            continue
        hulls = [reduced(hull, CORNERS * error) for hull in joined(parts, target, JOIN * error, slit)]
        hulls = [hull for hull in hulls if _solid(hull.vertices) is not None]
        gap = error_of(vertices, faces, hulls, slit)
        reached.append((gap.hausdorff, len(hulls)))
        if gap.hausdorff <= error and len(hulls) <= most and max(len(hull.vertices) for hull in hulls) <= MOST_CORNERS:
            return hulls, gap
    refuse(file, "error", f"{mm(error)}, which was not reached: " + ("; ".join(f"{mm(far)} with {count} hulls" for far, count in sorted(reached))
                                                                  or f"it takes more than {MOST_CUTS} hulls"),
           f"a larger --error, at most {most} hulls (--hulls)")


def _solid(points: Floats) -> Optional[Hull]:
    """None of points that the program calls flat."""
    try:
        hull = hull_of(points)
    except Error:
        return None
    return hull if min(-float(hull.heights(hull.vertices).min(axis=0).max()), 1.0) >= 1.1 * THINNEST else None
