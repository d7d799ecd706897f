"""Exceedance, limits with their intervals, and distances, against SciPy and known answers."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_allclose, assert_array_equal
from scipy import stats

from maglev.uncertainty.reliability import (
    clustered_limits,
    error_range_near,
    exceedance,
    sample_limits,
    surrogate_limits,
)
from maglev.uncertainty.samples import weighted_quantile
from maglev.vocabulary import GIVEN, INFINITE, TOO_FEW

SAMPLE = np.random.default_rng(42).normal(size=2000)
VALUES = hnp.arrays(float, st.integers(1, 12), elements=st.floats(-5, 5))


def test_exceedance_of_a_hand_worked_case():
    at = [0.0, 1.0, 1.5, 3.0]
    assert_allclose(exceedance(at, [3.0, 1.0], [0.3, 0.7]), [1.0, 0.3, 0.3, 0.0])
    # with a tenth lost: 0.1 + 0.9 times that, and the lost ones exceed everything
    found = exceedance(at, [3.0, 1.0], [0.3, 0.7], lost_probability=0.1)
    assert_allclose(found, [1.0, 0.37, 0.37, 0.1])


@settings(deadline=None)
@given(VALUES, st.floats(0.001, 0.999))
def test_quantile_is_the_smallest_value_whose_exceedance_is_at_most_the_level(values, level):
    probability = np.random.default_rng(values.size).dirichlet(np.ones(values.size))
    (limit,) = weighted_quantile(values, probability, [level])
    assert exceedance([limit], values, probability)[0] <= level + 1e-9
    smaller = values[values < limit]
    assert np.all(exceedance(smaller, values, probability) > level - 1e-9) or smaller.size == 0


def test_equal_weights_give_the_limits_of_samples():
    levels = [0.5, 0.1, 0.05, 0.01]
    plain = sample_limits(SAMPLE, levels)
    quantiles = weighted_quantile(SAMPLE, np.full(2000, 1 / 2000), levels)
    assert_array_equal(quantiles, plain.limit)
    assert_array_equal(plain.limit, np.sort(SAMPLE)[[999, 1799, 1899, 1979]])


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


def test_lost_samples_stand_above_every_held_one():
    lost = sample_limits(SAMPLE[:1990], [0.1, 0.05, 0.012, 0.005, 0.001], n_lost=10)
    as_largest = np.sort(np.append(SAMPLE[:1990], np.full(10, 1e9)))
    assert_array_equal(lost.limit[:2], as_largest[[1799, 1899]])
    assert lost.status == (GIVEN, GIVEN, GIVEN, INFINITE, INFINITE)
    # with ten or so held samples expected beyond, the interval may reach into the lost ones
    assert sample_limits(SAMPLE[:1990], [0.0101], n_lost=10).upper[0] < np.inf
    assert sample_limits(SAMPLE[:1970], [0.0205], n_lost=30).upper[0] == np.inf


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
    held_level = (np.array([0.1, 0.03]) - 0.02) / 0.98
    weights = np.full(2000, 1 / 2000)
    assert_array_equal(exact.limit, weighted_quantile(SAMPLE, weights, held_level))
    wide = surrogate_limits(
        SAMPLE, [0.1, 0.03], residuals=none, lost_probability=0.02, lost_interval=(0.0, 0.05)
    )
    assert_array_equal(wide.limit, exact.limit)
    assert np.all(wide.lower < exact.lower)
    assert wide.upper[0] > exact.upper[0]
    assert wide.upper[1] == np.inf  # losses alone may exceed this level


def test_faulty_input_is_refused_with_a_sentence():
    weights = np.full(2000, 1 / 2000)
    for call, sentence in (
        (lambda: exceedance([np.nan], SAMPLE), "not be NaN"),
        (lambda: exceedance([0.0], SAMPLE, lost_probability=1.0), "lost probability"),
        (lambda: exceedance([0.0], SAMPLE, 0.9 * weights), "must sum to 1"),
        (lambda: sample_limits([1.0, np.nan]), "got 1 of 2 that are not"),
        (lambda: sample_limits(SAMPLE, [0.0]), r"must lie in \(0, 1\)"),
        (lambda: sample_limits(SAMPLE, n_lost=-1), "zero or positive, got -1"),
        (lambda: sample_limits(SAMPLE, confidence=1.0), "confidence must lie"),
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


@pytest.mark.parametrize("within", [0.1, 1.0])
def test_a_limit_over_clusters_knows_that_clusters_are_few(within):
    rng = np.random.default_rng(6)
    exact = stats.norm.isf(0.1) * np.hypot(1.0, within)
    inside, widths = [], []
    for _ in range(150):
        values = rng.standard_normal((32, 1)) + within * rng.standard_normal((32, 64))
        found = clustered_limits(values, [0.1, 0.01])
        assert found.status == ("given", "too_few_exceedances")
        inside.append(found.lower[0] <= exact <= found.upper[0])
        widths.append(found.upper[0] - found.lower[0])
    assert np.mean(inside) > 0.91  # 0.95 is claimed
    assert np.mean(widths) < 2.0


def test_a_limit_over_equal_clusters_is_that_of_all_samples():
    values = np.random.default_rng(7).standard_normal((40, 500))
    found, plain = clustered_limits(values, [0.1]), sample_limits(values.ravel(), [0.1])
    assert_allclose(found.limit, plain.limit)
    assert_allclose(found.upper - found.lower, plain.upper - plain.lower, rtol=0.6)
    with pytest.raises(ValueError, match="at least two clusters"):
        clustered_limits(values[:1], [0.1])
