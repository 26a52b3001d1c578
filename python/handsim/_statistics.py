"""Statistics of studies: intervals, rank correlation, and which inputs own an outcome's variance."""
from __future__ import annotations

import math
from typing import Any, Iterator, NamedTuple, Optional, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Estimate = Optional[tuple[float, float, float]]
"""A share or a mean with the ends of its 95 % interval; None of nothing."""
Input = tuple[str, ArrayLike, bool]
"""Of a study: name, values by row, and whether they are numbers of categories."""

NORMAL_95 = 1.959963984540054
"""Quantile 0.975 of the standard normal distribution."""
MOST_CATEGORIES = 50
"""An input with more terms is left out where variance is split."""
SMALLEST = 1e-9
"""Singular values below it, as shares of the largest, count as zero."""
ROWS = 10_000
"""Whose terms are in memory at once."""


def share_of(held: int, of: int) -> Estimate:
    """A share with Wilson's interval (1927)."""
    if of <= 0:
        return None
    p, zz = held / of, NORMAL_95 * NORMAL_95
    centre = (p + zz / (2 * of)) / (1 + zz / of)
    half = NORMAL_95 / (1 + zz / of) * math.sqrt(p * (1 - p) / of + zz / (4 * of * of))
    # The ends are 0 and 1 where none and all are held; rounding must not say otherwise.
    return p, 0.0 if held == 0 else centre - half, 1.0 if held == of else centre + half


def mean_of(values: ArrayLike) -> Estimate:
    """A mean with the normal interval of its standard error."""
    of = np.asarray(values, dtype=float)
    n = len(of)
    if n == 0:
        return None
    mean = float(np.sum(of)) / n
    half = NORMAL_95 * math.sqrt(float(np.sum((of - mean) ** 2)) / (n - 1) / n) if n > 1 else 0.0
    return mean, mean - half, mean + half


def quantile(ordered: Any, part: float) -> Any:
    """The value below which a part of the sorted values lies, linear between neighbours."""
    place = part * float(len(ordered) - 1)
    below = int(place)
    following = ordered[min(below + 1, len(ordered) - 1)]
    return ordered[below] + (place - float(below)) * (following - ordered[below])


def ranks(values: ArrayLike) -> Array:
    """Ranks from 1; equal values share their mean rank."""
    _, which, counts = np.unique(np.asarray(values, dtype=float), return_inverse=True, return_counts=True)
    out: Array = (np.cumsum(counts) - 0.5 * (counts - 1))[which.ravel()]
    return out


def rank_correlation(x: ArrayLike, y: ArrayLike) -> Estimate:
    """Spearman's rank correlation, ties with their mean rank, and its interval by Fisher's z with the variance of Bonett and Wright
    (2000). None of fewer than four pairs, or where one of the two does not vary."""
    a, b = ranks(x), ranks(y)
    n = len(a)
    if n < 4 or n != len(b):
        return None
    a, b = a - 0.5 * (n + 1), b - 0.5 * (n + 1)
    # Twice a rank is whole: these sums are exact.
    ab, aa, bb = (float(np.sum(left * right)) for left, right in ((a, b), (a, a), (b, b)))
    if aa == 0 or bb == 0:
        return None
    r = min(max(ab / math.sqrt(aa * bb), -1.0), 1.0)
    if abs(r) == 1:
        return r, r, r
    z, half = math.atanh(r), NORMAL_95 * math.sqrt((1 + 0.5 * r * r) / (n - 3))
    return r, math.tanh(z - half), math.tanh(z + half)


class _Basis(NamedTuple):
    """Of one input: its ranks from -1 to 1, or its categories, whose terms are their indicators."""

    name: str
    u: Array
    terms: int
    categories: bool

    def first(self, rows: slice) -> Array:
        """Legendre's polynomial of degree 1, with variance 1."""
        return math.sqrt(3) * self.u[rows]

    def columns(self, rows: slice) -> list[Array]:
        x = self.u[rows]
        if self.categories:
            return [(x == i).astype(float) for i in range(self.terms)]
        return [self.first(rows), math.sqrt(5) / 2 * (3 * x * x - 1), math.sqrt(7) / 2 * (5 * x * x - 3) * x][:self.terms]


def _basis(name: str, values: ArrayLike, categories: bool, degree: int) -> _Basis:
    of = np.asarray(values, dtype=float)
    terms = len(np.unique(of)) - 1
    if categories:
        return _Basis(name, of, terms, True)
    return _Basis(name, (2 * ranks(of) - 1) / max(1, len(of)) - 1, min(degree, terms), False)


class _Terms:
    """The regression's terms: of each input, and of each pair of numbers where there are ten rows for each term."""

    def __init__(self, inputs: Sequence[Input], rows: int, degree: int) -> None:
        found = [_basis(*each, degree) for each in inputs]
        self.bases = [each for each in found if 0 < each.terms <= MOST_CATEGORIES]
        self.groups = [(each.name, each.terms) for each in self.bases]
        numbers = [each for each in self.bases if not each.categories]
        pairs = [(a, b) for i, b in enumerate(numbers) for a in numbers[:i]]
        self.pairs = pairs if rows >= 10 * (self.size + len(pairs)) else []
        self.groups += [(f"{a.name} x {b.name}", 1) for a, b in self.pairs]

    @property
    def size(self) -> int:
        return sum(count for _, count in self.groups)

    def parts(self, rows: int) -> Iterator[tuple[slice, Array]]:
        """Rows, and their terms by row."""
        for begin in range(0, rows, ROWS):
            part = slice(begin, min(rows, begin + ROWS))
            columns = [column for each in self.bases for column in each.columns(part)]
            yield part, np.stack([*columns, *(a.first(part) * b.first(part) for a, b in self.pairs)], axis=1)


def variance_shares(inputs: Sequence[Input], outcome: ArrayLike) -> list[tuple[str, float]]:
    """The share of an outcome's variance that each input, or a pair as ``a x b``, explains: the largest first.

    Least squares on Legendre's polynomials of the inputs' ranks to degree 3 (lower with few rows) and products of the first ones; a
    term's share is its covariance with the outcome (Li et al. 2010, J Phys Chem A 114:6022), less what chance gives. Of independent
    inputs these are Sobol's indices. Pairs only with ten rows for each term. Nothing where the outcome does not vary or rows are too few.
    """
    y = np.asarray(outcome, dtype=float)
    every, rows = mean_of(y), len(y)
    if every is None or float(np.min(y)) == float(np.max(y)) or every[1] == every[2]:
        return []
    terms = _Terms(inputs, rows, 3)
    for degree in (2, 1):  # few rows get straight lines
        if rows < 3 * terms.size + 2:
            terms = _Terms(inputs, rows, degree)
    size = terms.size
    if size == 0 or rows < 2 * size + 2:
        return []
    normal, with_y, total = np.zeros((size, size)), np.zeros(size), np.zeros(size)
    off = y - every[0]
    for part, columns in terms.parts(rows):
        normal += columns.T @ columns
        with_y += columns.T @ off[part]
        total += columns.sum(axis=0)
    normal -= np.outer(total, total) / rows
    fitted = np.linalg.lstsq(normal, with_y, rcond=SMALLEST)[0] * with_y / float(np.sum(off * off))
    unexplained = 1 - float(np.sum(fitted))
    out, at = [], 0
    for name, count in terms.groups:
        out.append((name, float(np.sum(fitted[at:at + count])) - count * unexplained / (rows - size - 1)))
        at += count
    return sorted(out, key=lambda each: -each[1])


class Uncertainty(NamedTuple):
    """A figure of drawn hands, of those that have it."""

    missing: int
    mean: float
    low: float
    """5th percentile."""
    high: float
    """95th percentile."""
    variance: list[tuple[str, float]]
    """Inputs with their shares of the variance, the largest first."""


def uncertainty_of(inputs: Sequence[tuple[str, Array]], values: Array) -> Uncertainty:
    """:param values: NaN where a hand does not have the figure"""
    there = np.isfinite(values)
    found = values[there] if there.any() else np.full(2, np.nan)
    ordered = np.sort(found)
    return Uncertainty(int(np.count_nonzero(~there)), float(np.mean(found)), float(quantile(ordered, 0.05)), float(quantile(ordered, 0.95)),
                       variance_shares([(name, of[there], False) for name, of in inputs], found))


def owners_text(shares: Sequence[tuple[str, float]]) -> str:
    """The three largest of at least 1 %, and how much all explain."""
    told = [f"{of} {100 * share:.0f} %" for of, share in shares if share >= 0.01][:3]
    if not told:
        return "no input has 1 %" if shares else "-"
    every = 0.0
    for _, share in shares:
        every += share
    return f"{', '.join(told)} ({max(0.0, 100 * every):.0f} % explained)"
