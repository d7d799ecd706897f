"""Exceedance, limits with their intervals, and distances, against SciPy and known answers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from maglev.uncertainty.gdee import evolved_density
from maglev.uncertainty.reliability import (
    density_distance,
    density_exceedance,
    error_range_near,
    exceedance,
    kolmogorov_distance,
    kolmogorov_noise,
    sample_limits,
    surrogate_limits,
    wasserstein_distance,
    weighted_limits,
)
from maglev.vocabulary import GIVEN, INFINITE, TOO_FEW

SAMPLE = np.random.default_rng(42).normal(size=2000)
VALUES = hnp.arrays(float, st.integers(1, 12), elements=st.floats(-5, 5))


def test_exceedance_of_a_hand_worked_case():
    at = [0.0, 1.0, 1.5, 3.0]
    assert_allclose(exceedance(at, [3.0, 1.0], [0.3, 0.7]), [1.0, 0.3, 0.3, 0.0])
    # with a tenth lost: 0.1 + 0.9 times that, and the lost ones exceed everything
    found = exceedance(at, [3.0, 1.0], [0.3, 0.7], lost_probability=0.1)
    assert_allclose(found, [1.0, 0.37, 0.37, 0.1])


def test_density_exceedance_agrees_with_the_points_it_came_from():
    evolved = evolved_density(SAMPLE[:300], process="linear", lost_probability=0.02)
    at = np.linspace(-4.0, 4.0, 33)
    from_density = density_exceedance(at, evolved.cell_centre, evolved.density)
    from_points = exceedance(at, SAMPLE[:300], lost_probability=0.02)
    assert np.abs(from_density - from_points).max() < 0.05
    assert_allclose(
        density_exceedance([-99.0, 99.0], evolved.cell_centre, evolved.density), [1, 0.02]
    )


def test_density_exceedance_of_a_uniform_density_is_a_straight_line():
    cells = np.arange(10) + 0.5
    assert_allclose(
        density_exceedance([0.0, 2.25, 10.0], cells, np.full(10, 0.1)), [1, 0.775, 0], atol=1e-15
    )


@settings(deadline=None)
@given(VALUES, st.floats(0.001, 0.999))
def test_limit_is_the_smallest_value_whose_exceedance_is_at_most_the_level(values, level):
    probability = np.random.default_rng(values.size).dirichlet(np.ones(values.size))
    many = np.repeat(values, 20000)  # so that ten exceedances are expected
    found = weighted_limits(many, np.repeat(probability / 20000, 20000), [level])
    assert found.status == (GIVEN,)
    limit = found.limit[0]
    assert exceedance([limit], values, probability)[0] <= level + 1e-9
    smaller = values[values < limit]
    assert np.all(exceedance(smaller, values, probability) > level - 1e-9) or smaller.size == 0


def test_equal_weights_give_the_limits_of_samples():
    levels = [0.5, 0.1, 0.05, 0.01]
    weighted = weighted_limits(SAMPLE, np.full(2000, 1 / 2000), levels)
    plain = sample_limits(SAMPLE, levels)
    assert_array_equal(weighted.limit, plain.limit)
    assert_array_equal(plain.limit, np.sort(SAMPLE)[[999, 1799, 1899, 1979]])
    assert weighted.lower is None
    assert weighted.confidence is None


def test_intervals_are_those_of_the_exact_binomial_quantile_test():
    levels = np.array([0.3, 0.1, 0.02, 0.006])
    found = sample_limits(SAMPLE, levels, confidence=0.9)
    for i, level in enumerate(levels):
        exact = stats.quantile_test(SAMPLE, q=0.0, p=1.0 - level).confidence_interval(0.9)
        assert (found.lower[i], found.upper[i]) == (exact.low, exact.high)


def test_intervals_hold_the_limit_as_often_as_they_say():
    rng = np.random.default_rng(7)
    exact = stats.expon.isf([0.2, 0.05])
    held = np.zeros(2)
    for _ in range(1000):
        found = sample_limits(rng.exponential(size=250), [0.2, 0.05])
        held += (found.lower <= exact) & (exact <= found.upper)
    assert np.all(held >= 950 - 3 * np.sqrt(1000 * 0.95 * 0.05))
    assert np.all(held <= 990)  # exact but for the steps of the binomial


def test_a_level_beyond_the_sample_is_said_to_be_so():
    found = sample_limits(SAMPLE, [1e-2, 4.8e-3, 4.7e-3, 1e-3])
    assert found.status == (GIVEN, GIVEN, TOO_FEW, TOO_FEW)
    assert_allclose(found.expected_exceedances, [20.0, 9.6, 9.4, 2.0])
    for numbers in (found.limit, found.lower, found.upper):
        assert_array_equal(np.isnan(numbers), [False, False, True, True])
    # a thousandth of the weight on most of the points: their size does not count
    weights = np.where(np.arange(2000) < 500, 1.0, 1e-3)
    lopsided = weighted_limits(SAMPLE, weights / weights.sum(), [0.1, 1e-2])
    assert lopsided.status == (GIVEN, TOO_FEW)


def test_lost_samples_stand_above_every_held_one():
    lost = sample_limits(SAMPLE[:1990], [0.1, 0.05, 0.012, 0.005, 0.001], n_lost=10)
    as_largest = np.sort(np.append(SAMPLE[:1990], np.full(10, 1e9)))
    assert_array_equal(lost.limit[:2], as_largest[[1799, 1899]])
    assert lost.status == (GIVEN, GIVEN, GIVEN, INFINITE, INFINITE)
    # with ten or so held samples expected beyond, the interval may reach into the lost ones
    assert sample_limits(SAMPLE[:1990], [0.0101], n_lost=10).upper[0] < np.inf
    assert sample_limits(SAMPLE[:1970], [0.0205], n_lost=30).upper[0] == np.inf
    weighted = weighted_limits(
        SAMPLE[:1990], np.full(1990, 1 / 1990), [0.1, 0.05], lost_probability=0.005
    )
    assert_array_equal(weighted.limit, lost.limit[:2])
    gone = weighted_limits(SAMPLE, np.full(2000, 1 / 2000), [0.1, 0.01], lost_probability=0.01)
    assert gone.status == (GIVEN, INFINITE)


def test_a_surrogate_without_error_has_the_limits_of_its_predictions():
    plain = sample_limits(SAMPLE, [0.1, 0.01])
    for error in ({"residuals": np.zeros(50)}, {"standard_deviation": np.zeros(2000)}):
        found = surrogate_limits(SAMPLE, [0.1, 0.01], **error)
        for name in ("limit", "lower", "upper"):
            assert_array_equal(getattr(found, name), getattr(plain, name))


def test_surrogate_error_moves_the_ends_by_its_quantiles():
    plain = sample_limits(SAMPLE, [0.1])
    deviation = surrogate_limits(SAMPLE, [0.1], standard_deviation=np.full(2000, 0.2))
    assert_allclose(deviation.lower, plain.lower - 1.959963984540054 * 0.2)
    assert_allclose(deviation.upper, plain.upper + 1.959963984540054 * 0.2)
    # of 39 residuals, ranks 1 and 39 bound 95 %; of 79, ranks 2 and 78
    for n, low, high in ((39, 1, 39), (79, 2, 78)):
        residuals = np.random.default_rng(0).permutation(np.arange(1.0, n + 1))
        found = surrogate_limits(SAMPLE, [0.1], residuals=residuals)
        assert_allclose(found.lower, plain.lower + low)
        assert_allclose(found.upper, plain.upper + high)


def test_surrogate_interval_holds_the_limit_of_what_it_approximates():
    # Y = u + e(u) with a smooth error e; residuals are e at 60 random training points.
    rng = np.random.default_rng(3)
    held = 0
    for _ in range(200):
        phase, size = rng.uniform(0, 2 * np.pi), 0.15
        u, trained = rng.normal(size=4000), rng.normal(size=60)
        truth = np.sort(
            stats.norm.ppf((np.arange(20000) + 0.5) / 20000)
            + size * np.sin(3 * stats.norm.ppf((np.arange(20000) + 0.5) / 20000) + phase)
        )
        exact = truth[20000 - 200 - 1]
        found = surrogate_limits(u, [0.01], residuals=size * np.sin(3 * trained + phase))
        held += found.lower[0] <= exact <= found.upper[0]
    assert held >= 180


def test_surrogate_limits_carry_the_lost_probability_and_its_interval():
    none = np.zeros(50)
    exact = surrogate_limits(SAMPLE, [0.1, 0.03], residuals=none, lost_probability=0.02)
    weights = np.full(2000, 1 / 2000)
    assert_array_equal(
        exact.limit, weighted_limits(SAMPLE, weights, [0.1, 0.03], lost_probability=0.02).limit
    )
    wide = surrogate_limits(
        SAMPLE, [0.1, 0.03], residuals=none, lost_probability=0.02, lost_interval=(0.0, 0.05)
    )
    assert_array_equal(wide.limit, exact.limit)
    assert np.all(wide.lower < exact.lower)
    assert wide.upper[0] > exact.upper[0]
    assert wide.upper[1] == np.inf  # losses alone may exceed this level


@settings(deadline=None)
@given(VALUES, VALUES, VALUES)
def test_distances_between_samples_are_metrics(a, b, c):
    for distance in (kolmogorov_distance, wasserstein_distance):
        assert distance(a, a) <= 1e-12
        assert_allclose(distance(a, b), distance(b, a), atol=1e-12)
        assert distance(a, c) <= distance(a, b) + distance(b, c) + 1e-12


def test_kolmogorov_distance_without_weights_is_the_two_sample_statistic():
    a, b = SAMPLE[:300], SAMPLE[300:1000] * 1.1
    assert_allclose(kolmogorov_distance(a, b), stats.ks_2samp(a, b).statistic, rtol=1e-12)


def test_weights_count_as_repeated_values():
    repeated = [0.0, 1.0, 1.0, 1.0]
    for distance in (kolmogorov_distance, wasserstein_distance):
        assert_allclose(distance([0.0, 1.0], repeated, [0.25, 0.75]), 0.0, atol=1e-15)
        other = distance(repeated, [0.4, 2.0])
        assert_allclose(distance([0.0, 1.0], [2.0, 0.4], [0.25, 0.75]), other, rtol=1e-12)


def test_kolmogorov_noise_is_exceeded_by_one_pair_in_twenty():
    noise = kolmogorov_noise(10_000, 10_000)
    assert_allclose(noise, 1.3581 * np.sqrt(2e-4), rtol=1e-4)  # Smirnov's table
    rng = np.random.default_rng(5)
    beyond = sum(
        kolmogorov_distance(rng.normal(size=400), rng.normal(size=500)) > kolmogorov_noise(400, 500)
        for _ in range(400)
    )
    assert 5 <= beyond <= 35


def test_wasserstein_distance_of_a_shift_is_the_shift():
    assert_allclose(wasserstein_distance(SAMPLE, SAMPLE + 0.25), 0.25, rtol=1e-12)


def test_density_distance_of_exact_cases():
    tent = ([-1.0, 0.0, 1.0], [0.0, 1.0, 0.0])
    assert density_distance(*tent, *tent) == 0.0
    assert_allclose(density_distance(*tent, [2.0, 3.0, 4.0], [0.0, 1.0, 0.0]), 2.0)
    # two tents one apart cross at a height of 1/2; they share an area of 1/4
    assert_allclose(density_distance(*tent, [0.0, 1.0, 2.0], [0.0, 1.0, 0.0]), 1.5)
    # uniform on [0, 1] and [0.5, 1.5]: the edges are steps, not slopes
    assert_allclose(density_distance([0.0, 1.0], [1.0, 1.0], [0.5, 1.5], [1.0, 1.0]), 1.0)


def test_density_distance_of_two_normals_is_that_of_their_distribution_functions():
    at = np.linspace(-8.0, 9.0, 4001)
    found = density_distance(at, stats.norm.pdf(at), at, stats.norm.pdf(at, 1.0))
    assert_allclose(found, 2 * (2 * stats.norm.cdf(0.5) - 1), atol=1e-5)


def test_faulty_input_is_refused_with_a_sentence():
    weights = np.full(2000, 1 / 2000)
    cells = np.arange(3.0)
    for call, sentence in (
        (lambda: exceedance([np.nan], SAMPLE), "not be NaN"),
        (lambda: exceedance([0.0], SAMPLE, lost_probability=1.0), "lost probability"),
        (lambda: exceedance([0.0], SAMPLE, 0.9 * weights), "must sum to 1"),
        (lambda: sample_limits([1.0, np.nan]), "got 1 of 2 that are not"),
        (lambda: sample_limits(SAMPLE, [0.0]), r"must lie in \(0, 1\)"),
        (lambda: sample_limits(SAMPLE, n_lost=-1), "zero or positive, got -1"),
        (lambda: sample_limits(SAMPLE, confidence=1.0), "confidence must lie"),
        (lambda: weighted_limits(SAMPLE, weights, [1.5]), r"must lie in \(0, 1\)"),
        (lambda: surrogate_limits(SAMPLE), "got neither"),
        (
            lambda: surrogate_limits(SAMPLE, residuals=weights, standard_deviation=weights),
            "got both",
        ),
        (lambda: surrogate_limits(SAMPLE, residuals=np.zeros(38)), "at least 39 residuals, got 38"),
        (lambda: surrogate_limits(SAMPLE, residuals=[np.nan] * 50), "residuals must be finite"),
        (lambda: surrogate_limits(SAMPLE, standard_deviation=[0.1]), "expected that of the"),
        (lambda: surrogate_limits(SAMPLE, standard_deviation=-weights), "zero or positive"),
        (
            lambda: surrogate_limits(
                SAMPLE, residuals=np.zeros(50), lost_probability=0.1, lost_interval=(0.2, 0.3)
            ),
            "must hold it",
        ),
        (lambda: kolmogorov_noise(0, 10), "must be positive, got 0 and 10"),
        (lambda: wasserstein_distance([np.inf], [1.0]), "got 1 of 1"),
        (lambda: density_distance([0.0], [1.0], [0.0], [1.0]), "two places or more"),
        (lambda: density_distance([1.0, 0.0], [1.0, 1.0], cells, cells), "finite and ascend"),
        (lambda: density_distance(cells, -cells, cells, cells), "zero or positive"),
        (lambda: density_exceedance([0.0], cells, cells), "integrate to 1 or less, got 3"),
        (lambda: density_exceedance([0.0], cells**2, cells / 9), "cells must have one width"),
    ):
        with pytest.raises(ValueError, match=sentence):
            call()


def test_the_range_of_errors_near_a_value_is_that_of_its_neighbours():
    values = np.arange(100.0)
    residuals = np.where(values > 60.0, 5.0, 1.0) * np.where(values % 2, 1.0, -1.0)
    low, high = error_range_near([0.0, 99.0, 45.0], values, residuals, 0.95)
    assert_allclose(low, [-1.0, -5.0, -5.0])  # 39 neighbours: 0-38, 61-99, 26-64
    assert_allclose(high, [1.0, 5.0, 5.0])


def test_the_range_of_few_errors_holds_one_more_as_often_as_the_confidence_says():
    rng = np.random.default_rng(3)
    hits = []
    for _ in range(2000):
        residuals = rng.standard_normal(9)
        low, high = error_range_near([0.0], np.zeros(8), residuals[:8], 0.8)
        hits.append(low[0] <= residuals[8] <= high[0])
    assert abs(np.mean(hits) - 0.8) < 0.03


def test_an_error_range_moves_both_ends_of_a_surrogate_limit():
    predictions = np.random.default_rng(4).standard_normal(5000)
    plain = surrogate_limits(predictions, [0.1], error_range=(0.0, 0.0))
    moved = surrogate_limits(predictions, [0.1], error_range=(-0.25, 0.5))
    assert moved.limit == plain.limit
    assert_allclose(moved.lower - plain.lower, -0.25)
    assert_allclose(moved.upper - plain.upper, 0.5)
    with pytest.raises(ValueError, match="must be finite and ascend"):
        surrogate_limits(predictions, [0.1], error_range=(1.0, 0.0))
