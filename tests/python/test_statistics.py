"""Shares, rank correlations and shares of variance."""
import math

import numpy as np
import pytest

from handsim._statistics import mean_of, owners_text, quantile, rank_correlation, ranks, share_of, uncertainty_of, variance_shares


# Oracle: Newcombe 1998 (Statistics in Medicine 17:857), table I, method 3.
@pytest.mark.parametrize("held, of, low, high", [(81, 263, 0.2553, 0.3662), (15, 148, 0.0624, 0.1605), (0, 20, 0, 0.1611), (1, 29, 0.0061, 0.1718)])
def test_a_share_has_wilsons_interval_as_published(held, of, low, high):
    found = share_of(held, of)
    assert found == pytest.approx((held / of, low, high), abs=5e-5) and found[0] == held / of
    assert share_of(0, 0) is None and share_of(5, 5)[2] == 1


# Oracle: the mean of 1, 2, 3, 4 is 2.5, its standard error sqrt(5 / 3 / 4).
def test_a_mean_has_the_interval_of_its_standard_error():
    half = 1.959963984540054 * math.sqrt(5 / 12)
    assert mean_of([1, 2, 3, 4]) == pytest.approx((2.5, 2.5 - half, 2.5 + half), rel=1e-15)
    assert mean_of([]) is None and mean_of([7.0]) == (7, 7, 7)


# Oracle: numpy's own linear quantile.
def test_a_quantile_is_linear_between_neighbours():
    values = np.sort(np.random.default_rng(3).normal(size=101))
    for part in (0, 0.05, 0.5, 0.333, 0.95, 1):
        assert quantile(values, part) == pytest.approx(np.quantile(values, part), rel=1e-14)


# Oracle: without ties 1 - 6 sum(d^2) / (n (n^2 - 1)).
def test_rank_correlation_is_its_closed_form():
    x = np.arange(1.0, 7)
    assert rank_correlation(x, [2, 1, 4, 3, 6, 5])[0] == pytest.approx(1 - 6 * 6 / (6 * 35), abs=1e-15)
    assert rank_correlation(x, np.exp(x)) == (1, 1, 1)


# Oracle: with ties Pearson's correlation of mean ranks: of x = 1, 2, 3, 4 and a verdict 0, 0, 1, 1 these are 1.5, 1.5, 3.5, 3.5, which gives
# 4 / sqrt(5 * 4) = 0.894.
def test_rank_correlation_gives_ties_their_mean_rank():
    assert ranks([3, 1, 3, 2]).tolist() == [3.5, 1, 3.5, 2]
    assert rank_correlation([1, 2, 3, 4], [0, 0, 1, 1])[0] == pytest.approx(4 / math.sqrt(20), abs=1e-15)


# Oracle: a figure that does not vary has no rank correlation.
def test_rank_correlation_is_nothing_where_one_does_not_vary():
    assert rank_correlation([1, 2, 3, 4], [1, 1, 1, 1]) is None
    assert rank_correlation([1, 2, 3], [1, 0, 1]) is None


# Oracle: Fisher's z with Bonett and Wright's variance, written out.
def test_rank_correlation_has_the_interval_of_bonett_and_wright():
    r, low, high = rank_correlation(range(103), [i * 37 % 103 for i in range(103)])
    half = 1.959963984540054 * math.sqrt((1 + r * r / 2) / 100)
    assert math.atanh(high) - math.atanh(r) == pytest.approx(half, abs=1e-12)
    assert math.atanh(r) - math.atanh(low) == pytest.approx(half, abs=1e-12)


def lattice(rows):
    """In the cube from -1 to 1, by the golden numbers of Roberts."""
    return [(name, 2 * np.fmod(np.arange(1.0, rows + 1) / 1.22074408460575947536 ** (k + 1), 1) - 1, False) for k, name in enumerate("abc")]


# Oracle: Sobol's indices in closed form. For a, b, c even from -1 to 1 the variances of 3a, 2ab and 4c^2 are 3, 4/9 and 64/45; c^2 is an
# inverted U without rank correlation.
def test_variance_shares_are_sobols_indices_of_independent_inputs():
    (_, a, _), (_, b, _), (_, c, _) = lattice(15000)
    y = 3 * a + 2 * a * b - 4 * c * c
    found = variance_shares([("a", np.exp(a), False), ("b", b, False), ("c", c, False)], y)  # ranks do not see the scale
    shares, every = dict(found), 3 + 4 / 9 + 64 / 45
    assert found[0][0] == "a" and list(shares) == [name for name, _ in sorted(found, key=lambda each: -each[1])]
    for name, share in (("a", 3 / every), ("c", 64 / 45 / every), ("a x b", 4 / 9 / every), ("b", 0), ("b x c", 0)):
        assert shares[name] == pytest.approx(share, abs=2e-3), name
    assert rank_correlation(c, y)[0] == pytest.approx(0, abs=0.03)
    assert owners_text(found) == "a 62 %, c 29 %, a x b 9 % (100 % explained)"


# Oracle: of categories the share is that between their means (eta squared): means 0, 1 and 5 have a variance of 14/3, the noise has 1/12 on 4
# times its range. Of an outcome that depends on nothing, no share is above what chance leaves.
def test_variance_shares_of_categories_and_of_nothing():
    kind = np.arange(3000) % 3
    noise = np.fmod(np.arange(1, 3001) * 0.7548776662466927, 1)
    inputs = [*lattice(3000), ("kind", kind.astype(float), True)]
    assert dict(variance_shares(inputs, np.array([0, 1, 5])[kind] + 4 * noise))["kind"] == pytest.approx(14 / 3 / (14 / 3 + 16 / 12), abs=5e-3)
    assert sum(share for _, share in variance_shares(inputs, noise)) == pytest.approx(0, abs=0.01)
    assert variance_shares(inputs, np.ones(3000)) == [] and variance_shares(inputs, np.full(3000, 0.1)) == []


# Oracle: symmetry: one input given twice owns as much as the two together.
def test_equal_inputs_share_what_one_owns():
    a, b, _ = lattice(2000)
    once = dict(variance_shares([a, b], 2 * a[1] + b[1]))
    twice = variance_shares([a, ("again", a[1], False), b], 2 * a[1] + b[1])
    assert dict(twice)["a"] == pytest.approx(dict(twice)["again"], abs=1e-9)
    assert dict(twice)["a"] + dict(twice)["again"] == pytest.approx(once["a"], abs=1e-2)


# Oracle: the figures of the hands that are left.
def test_hands_without_a_figure_do_not_count():
    a, values = np.arange(50.0), np.arange(50.0) ** 2
    values[::5] = np.nan
    there = np.isfinite(values)
    found = uncertainty_of([("a", a)], values)
    assert found.missing == 10 and found.mean == pytest.approx(values[there].mean(), rel=1e-15)
    assert (found.low, found.high) == pytest.approx(tuple(np.quantile(values[there], (0.05, 0.95))), rel=1e-14)
    assert found.variance == variance_shares([("a", a[there], False)], values[there])
