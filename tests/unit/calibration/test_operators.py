"""The genetic operators: probabilities, boxes, and which way they lean."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from legato.calibration.operators import (
    bias,
    crossover,
    difference,
    mutation,
    random_population,
    ranking,
    roulette,
    wrapped,
)

BOX = np.array([[0.0, -np.pi, 3.0], [10.0, np.pi, 3.0]])
WRAP = np.array([False, True, False])


@given(size=st.integers(1, 500), pressure=st.floats(1.01, 2.0))
def test_ranking_is_a_distribution_in_order(size: int, pressure: float) -> None:
    """Chances sum to one and fall linearly from pressure / N to (2 - pressure) / N."""
    chances = ranking(size, pressure)
    assert chances.sum() == pytest.approx(1.0)
    assert (chances >= -1e-15).all()
    if size > 1:
        assert (np.diff(chances) < 0.0).all()
        assert chances[0] == pytest.approx(pressure / size)
        assert chances[-1] == pytest.approx((2.0 - pressure) / size, abs=1e-12)
        np.testing.assert_allclose(np.diff(chances), np.diff(chances)[0], rtol=1e-6, atol=1e-12)


def test_roulette_draws_by_chance() -> None:
    """Frequencies follow the probabilities within four of their standard errors."""
    chances, n = ranking(10, 1.7), 200_000
    drawn = np.bincount(roulette(np.random.default_rng(1), chances, n), minlength=10) / n
    assert (np.abs(drawn - chances) < 4.0 * np.sqrt(chances * (1 - chances) / n)).all()


def test_roulette_never_draws_what_has_no_chance() -> None:
    """A probability of zero is never chosen, at either end of the wheel."""
    drawn = roulette(np.random.default_rng(2), np.array([0.0, 0.5, 0.5, 0.0]), 10_000)
    assert set(drawn) == {1, 2}


@settings(deadline=None)
@given(seed=st.integers(0, 10**6), progress=st.floats(0.0, 1.0))
def test_operators_stay_in_the_box(seed: int, progress: float) -> None:
    """No crossover or mutation leaves the bounds; a gene with equal bounds never moves."""
    rng = np.random.default_rng(seed)
    parents = random_population(rng, 31, BOX)
    costs = rng.exponential(size=31)
    children = crossover(rng, parents, costs, 1.0, WRAP)
    children = mutation(rng, children, BOX, progress, 0.5, scale=1.5)
    assert (children >= BOX[0] - 1e-12).all()
    assert (children <= BOX[1] + 1e-12).all()
    assert (children[:, 2] == 3.0).all()


def test_the_worse_parent_moves_further() -> None:
    """The better of a pair moves by the ratio of the costs of what the worse moves, at most."""
    rng = np.random.default_rng(5)
    parents = np.tile([[0.0, 0.0, 3.0], [10.0, 0.0, 3.0]], (500, 1))
    costs = np.tile([1.0, 4.0], 500)
    children = crossover(rng, parents, costs, 1.0, WRAP)
    better, worse = children[::2, 0], 10.0 - children[1::2, 0]
    assert better.max() <= 2.5
    np.testing.assert_allclose(better, worse / 4.0, atol=1e-12)
    assert worse.max() > 9.0


def test_crossover_rate_is_kept() -> None:
    """About the given share of pairs is crossed; the others pass unchanged."""
    rng = np.random.default_rng(6)
    parents = random_population(rng, 4000, BOX)
    children = crossover(rng, parents, np.ones(4000), 0.8, WRAP)
    changed = (children[::2] != parents[::2]).any(axis=1).mean()
    assert changed == pytest.approx(0.8, abs=0.04)


def test_bias_of_infinite_costs_is_a_number() -> None:
    """Parents behind the camera move fully, those before it not at all."""
    inf = np.inf
    np.testing.assert_array_equal(
        bias(np.array([inf, inf, 2.0, 0.0]), np.array([inf, 1.0, inf, 0.0])), [1, 1, 0, 1]
    )


def test_crossover_goes_the_short_way_round() -> None:
    """Children of 179 and -179 deg lie near 180 deg, not near zero."""
    turn = np.radians([179.0, -179.0])
    parents = np.tile(np.stack([[5.0, 5.0], turn, [3.0, 3.0]], axis=1), (50, 1))
    children = crossover(np.random.default_rng(7), parents, np.ones(100), 1.0, WRAP)
    assert (np.abs(children[:, 1]) >= np.radians(179.0) - 1e-12).all()


@given(a=st.floats(-3.14, 3.14), b=st.floats(-3.14, 3.14))
def test_differences_are_wrapped(a: float, b: float) -> None:
    """A plus the difference is b again, and the way is at most half a turn."""
    one, two = np.array([1.0, a, 3.0]), np.array([2.0, b, 3.0])
    d = difference(one, two, WRAP)
    assert abs(d[1]) <= np.pi + 1e-12
    turned = wrapped(one + d, WRAP)
    assert np.cos(turned[1] - b) == pytest.approx(1.0)


def test_mutation_shrinks_as_the_search_goes_on() -> None:
    """Steps are large in the first generation, smaller later, and none in the last (a = 1)."""
    start = np.tile([5.0, 0.0, 3.0], (4000, 1))
    moved = []
    for progress in (0.0, 0.5, 0.9, 1.0):
        mutants = mutation(np.random.default_rng(8), start, BOX, progress, 1.0)
        moved.append(np.abs(mutants[:, 0] - 5.0).mean())
    assert moved[0] > moved[1] > moved[2] > moved[3] == 0.0
    # r uniform: 1 - r is a half on average, of the 5 mm to either bound.
    assert moved[0] == pytest.approx(2.5, abs=0.1)


def test_mutation_goes_both_ways_at_its_rate() -> None:
    """The share of moved genes is the rate; up and down are equally likely."""
    start = np.tile([5.0, 0.0, 3.0], (20_000, 1))
    mutants = mutation(np.random.default_rng(9), start, BOX, 0.1, 0.1)[:, 0]
    assert (mutants != 5.0).mean() == pytest.approx(0.1, abs=0.01)
    assert (mutants > 5.0).sum() / (mutants != 5.0).sum() == pytest.approx(0.5, abs=0.04)
