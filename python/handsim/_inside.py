"""Whether places are inside a surface of triangles: by its generalised winding number.

That is the solid angle of the triangles seen from a place over the whole one (Jacobson, Kavan & Sorkine-Hornung 2013, ACM Trans Graph 32(4):33): 1 inside
a closed surface, 0 outside, 2 where two closed ones overlap, and between these near a hole. A normal of the nearest point says less: at an edge or a corner
it is one of several, and of a doubled surface it is that of either layer.
"""
from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
CELL = 4e-3
"""Of the grid in which cells that no triangle crosses are known to be inside or outside [m]."""
MOST_CELLS = 4_000_000
"""A large surface has wider ones."""
TOGETHER = 1 << 20
"""Places times triangles at once: memory."""
UNKNOWN, OUTSIDE, INSIDE, CROSSED = range(4)


class Inside:
    """Of triangles, counter-clockwise seen from outside."""

    def __init__(self, triangles: Array, tree: Any, spacing: float) -> None:
        """:param triangles: shape (n, 3, 3) [m]
        :param tree: of points on them
        :param spacing: from no place on them the next point is farther [m]
        """
        self.tree, self.spacing = tree, spacing
        corners, which = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
        self.corners, self.which = corners, which.reshape(-1, 3).T
        a, b, c = triangles.transpose(1, 0, 2)
        self.normals = np.cross(b - a, c - a)
        self.offsets = (a * self.normals).sum(axis=1)
        self.edges = [((x - y)**2).sum(axis=1) / 2 for x, y in ((a, b), (b, c), (c, a))]
        self.low, self.high = corners.min(axis=0), corners.max(axis=0)
        self.cell = max(CELL, float(np.prod(self.high - self.low + CELL) / MOST_CELLS)**(1 / 3))
        self.cells = np.full(np.ceil((self.high - self.low) / self.cell).astype(int) + 1, UNKNOWN, dtype=np.int8)

    def winding(self, places: Array) -> Array:
        """The generalised winding number of each place (van Oosterom & Strackee 1983, IEEE Trans Biomed Eng 30:125)."""
        step = max(1, TOGETHER // len(self.offsets))
        if len(places) > step:
            return np.concatenate([self.winding(places[i:i + step]) for i in range(0, len(places), step)])
        squares = ((places[:, None] - self.corners)**2).sum(axis=2)
        (la, lb, lc), (ha, hb, hc) = (tuple(values[:, own] for own in self.which) for values in (np.sqrt(squares), squares / 2))
        volume = self.offsets - places @ self.normals.T
        # A scalar product of two sides is half of their squares less that of the edge between their ends.
        around = la * lb * lc + (ha + hb - self.edges[0]) * lc + (hb + hc - self.edges[1]) * la + (hc + ha - self.edges[2]) * lb
        return np.asarray(np.arctan2(volume, around).sum(axis=1) / (2 * np.pi))

    def of(self, places: Array) -> NDArray[np.bool_]:
        """Of each place: it is inside."""
        out = np.zeros(len(places), dtype=bool)
        rows = np.flatnonzero(((places >= self.low) & (places <= self.high)).all(axis=1))
        if not len(rows):
            return out
        at = ((places[rows] - self.low) / self.cell).astype(int)
        cells = self.cells[tuple(at.T)]
        if (cells == UNKNOWN).any():
            self._learn(np.unique(at[cells == UNKNOWN], axis=0))
            cells = self.cells[tuple(at.T)]
        out[rows] = cells == INSIDE
        crossed = rows[cells == CROSSED]
        if len(crossed):
            out[crossed] = self.winding(places[crossed]) > 0.5
        return out

    def _learn(self, at: NDArray[np.intp]) -> None:
        middles = self.low + (at + 0.5) * self.cell
        away, _ = self.tree.query(middles)
        free = away > self.cell * np.sqrt(3) / 2 + self.spacing
        values = np.full(len(at), CROSSED, dtype=np.int8)
        values[free] = np.where(self.winding(middles[free]) > 0.5, INSIDE, OUTSIDE)
        self.cells[tuple(at.T)] = values
