"""Probabilities of limit states: intervals that cover, and losses that count into each."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import binom, norm

from maglev.uncertainty.limit_states import (
    Probability,
    counted,
    error_growth,
    predicted,
    reliability_index,
    with_losses,
)


@pytest.mark.parametrize("confidence", [0.8, 0.95])
@pytest.mark.parametrize("truth", [0.002, 0.05, 0.5, 0.97])
def test_an_interval_by_counting_covers_as_often_as_it_says(truth, confidence):
    n = 200
    covers = np.empty(n + 1, dtype=bool)
    for k in range(n + 1):
        found = counted(np.arange(n) < k, confidence)
        assert found.low <= found.value == k / n <= found.high
        covers[k] = found.low <= truth <= found.high
    covered = binom.pmf(np.arange(n + 1), n, truth)[covers].sum()
    assert confidence <= covered < 1.0 or truth == 0.002


def test_what_nothing_exceeds_is_unknown_up_to_what_the_samples_carry():
    none = np.zeros(1000, dtype=bool)
    found = predicted(none, none, none, 0.95)
    assert (found.value, found.low) == (0.0, 0.0)
    assert_allclose(binom.pmf(0, 1000, found.high), 0.025)
    every = predicted(~none, ~none, ~none, 0.95)
    assert (every.value, every.high) == (1.0, 1.0)
    assert_allclose(1.0 - every.low, found.high)


def test_the_surrogates_error_widens_an_interval_on_its_side():
    sample = np.arange(1000)
    plain = counted(sample < 100)
    moved = predicted(sample < 100, sample < 60, sample < 130)
    assert moved.value == plain.value
    assert_allclose(moved.low, counted(sample < 60).low)
    assert_allclose(moved.high, counted(sample < 130).high)
    low = predicted(sample < 100, sample < 120, sample < 80)  # both errors to the other side
    assert low.low <= low.value <= low.high


def test_an_error_grows_where_the_surrogate_extrapolates_and_nowhere_else():
    training = np.array([0.0, 2.0, 4.0])
    found = error_growth(
        training.max() + training.std() * np.array([-9.0, 0.0, 1.0, 3.0]), training
    )
    assert_allclose(found, [1.0, 1.0, 4.0, 16.0])
    with pytest.raises(ValueError, match="must vary"):
        error_growth([1.0], [2.0, 2.0])


def test_a_lost_passage_exceeds_everything():
    held, lost = Probability(0.02, 0.01, 0.04), Probability(0.1, 0.05, 0.2)
    found = with_losses(held, lost)
    assert_allclose(1 - found.value, 0.98 * 0.9)
    assert_allclose(1 - found.low, 0.99 * 0.95)
    assert_allclose(1 - found.high, 0.96 * 0.8)


def test_the_reliability_index_is_the_distance_to_a_plane():
    assert_allclose(reliability_index(norm.sf([1.0, 4.0, -0.5])), [1.0, 4.0, -0.5])
    assert reliability_index(0.0) == np.inf and reliability_index(1.0) == -np.inf


def test_what_cannot_be_a_probability_is_refused():
    with pytest.raises(ValueError, match="need samples"):
        counted(np.zeros(0, dtype=bool))
    with pytest.raises(ValueError, match="as many with each error"):
        predicted(np.zeros(3, bool), np.zeros(2, bool), np.zeros(3, bool))
    with pytest.raises(ValueError, match="confidence must lie in"):
        counted([True, False], 1.0)
