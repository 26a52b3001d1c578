"""Non-negative least squares by an active set that is known from a problem alike: of the frame before, or of a first pass.

Minimises |Ax - b|^2 + r |x|^2 over x of 0 or more, after Lawson & Hanson (Solving Least Squares Problems, 1974). From a set that is nearly the right one
it takes a few steps in place of one for each unknown.
"""
from __future__ import annotations

from typing import Any, Optional

import numpy as np
from numpy.typing import NDArray

from ._errors import Error, input_error

Array = NDArray[np.float64]
Rows = NDArray[np.intp]
STEPS = 50
"""For each unknown, at most."""
TOGETHER = 8
"""Unknowns that enter the set at once, those of the steepest slopes; one after a step in which none of them moved. Chosen."""
ZERO = 1e-9
"""Of the largest slope at the start: one that counts as none."""


def lapack() -> Any:
    try:
        from scipy.linalg import lapack as found
    except ImportError:
        raise input_error("SciPy", "no Python module of this name", "it, for forces on objects: pip install scipy") from None
    return found


class Problem:
    """One."""

    def __init__(self, matrix: Array, goal: Array, ridge: Array, routines: Any = None) -> None:
        """:param matrix: A, shape (m, n)
        :param goal: b, shape (m,)
        :param ridge: r, shape (n,), above 0: of solutions alike the most even one is taken
        """
        # A column is a row in memory: columns are gathered often.
        self.columns, self.goal, self.ridge, self.lapack = np.ascontiguousarray(matrix.T), goal, ridge, routines or lapack()
        count = len(self.columns)
        self.pulls = self.columns @ goal
        # Products of columns, of unknowns that were once in the set.
        self.known, self.at = 0, np.full(count, -1, dtype=np.intp)
        self.part, self.products = np.empty_like(self.columns), np.empty((count, count))

    def _know(self, rows: Rows) -> Rows:
        """Places of the unknowns among the products."""
        new = rows[self.at[rows] < 0]
        if len(new):
            first, last = self.known, self.known + len(new)
            self.at[new], self.known = np.arange(first, last), last
            self.part[first:last] = self.columns[new]
            made = self.part[first:last] @ self.part[:last].T
            self.products[first:last, :last], self.products[:last, first:last] = made, made.T
        return np.asarray(self.at[rows])

    def _free(self, rows: Rows) -> Array:
        """Without the bounds, the other unknowns 0."""
        at = self._know(rows)
        square = self.products[at[:, None], at]
        square.flat[::len(rows) + 1] += self.ridge[rows]
        factor, status = self.lapack.dpotrf(square, overwrite_a=True)
        if status != 0:
            raise Error("forces on objects: least squares of a matrix that is not positive definite", "physics")
        return np.asarray(self.lapack.dpotrs(factor, self.pulls[rows])[0])

    def _slope(self, x: Array, rows: Rows) -> Array:
        at = self._know(rows)
        return np.asarray(self.columns @ (self.goal - x[rows] @ self.part[at]) - self.ridge * x)

    def solve(self, start: Optional[Rows] = None) -> tuple[Array, Rows]:
        """:param start: unknowns that are likely not 0
        :returns: x, and the unknowns that are not 0
        :raises Error: of kind physics where it does not converge
        """
        x = np.zeros(len(self.columns))
        rows = np.zeros(0, dtype=np.intp) if start is None else start
        none = ZERO * float(np.abs(self.pulls).max(initial=0))
        while len(rows):
            found = self._free(rows)
            if (found > 0).all():
                x[rows] = found
                break
            rows = rows[found > 0]
        # Unknowns that left at once: of rounding. They wait until another has moved.
        tried, together = np.zeros(len(x), dtype=bool), TOGETHER
        for _ in range(STEPS * len(x)):
            slope = self._slope(x, rows)
            slope[rows] = -np.inf
            slope[tried] = -np.inf
            best = np.argsort(slope)[-together:]
            best = best[slope[best] > none]
            if not len(best):
                return x, rows
            rows, moved = np.append(rows, best), False
            found = self._free(rows)
            while (found <= 0).any():
                # As far towards it as no unknown falls below 0; those that reach it leave the set.
                below, at = found <= 0, x[rows]
                part = np.full(len(rows), np.inf)
                part[below] = at[below] / (at[below] - found[below])
                way = float(part.min())
                moved |= way > 0
                x[rows] = at + way * (found - at)
                kept = part > way
                x[rows[~kept]] = 0
                rows = rows[kept]
                if not len(rows):
                    break
                found = self._free(rows)
            else:
                moved = moved or bool(np.isin(best, rows).any())
                x[rows] = found
            tried[:] = tried & (not moved)
            tried[best] = not moved and len(best) == 1
            together = TOGETHER if moved else 1
        raise Error("forces on objects: non-negative least squares do not converge", "physics")
