"""Weighted samples and the split of what is held from what is lost."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from maglev.uncertainty.samples import (
    deviation_interval,
    effective_size,
    held_part,
    weighted_sample,
)


def test_held_part_of_a_hand_worked_case():
    held = held_part([1.0, np.nan, 3.0], np.array([False, True, False]), [0.2, 0.5, 0.3])
    assert_array_equal(held.values, [1.0, 3.0])
    assert_allclose(held.probability, [0.4, 0.6])
    assert held.lost_probability == 0.5
    assert held.n_lost == 1


@settings(deadline=None)
@given(st.lists(st.booleans(), min_size=1, max_size=30).filter(lambda lost: not all(lost)))
def test_held_and_lost_probabilities_make_one(lost):
    probability = np.random.default_rng(len(lost)).dirichlet(np.ones(len(lost)))
    held = held_part(np.arange(float(len(lost))), np.array(lost), probability)
    assert_allclose(held.probability.sum(), 1.0)
    joint = (1 - held.lost_probability) * held.probability
    assert_allclose(joint, probability[~np.array(lost)], rtol=1e-9)


def test_effective_size_is_the_number_of_equal_weights():
    assert_allclose(effective_size(np.full(40, 1 / 40)), 40.0)
    assert_allclose(effective_size([0.5, 0.25, 0.25]), 1 / 0.375)


def test_faulty_samples_are_refused():
    lost = np.array([True, False])
    for call, sentence in (
        (lambda: weighted_sample([]), "with one or more"),
        (lambda: weighted_sample([1.0, np.inf]), "take lost samples out with held_part first"),
        (lambda: weighted_sample([1.0, 2.0], [0.5, 0.6]), "must sum to 1, got 1.1"),
        (lambda: weighted_sample([1.0, 2.0], [1.5, -0.5]), "zero or positive, got -0.5"),
        (lambda: weighted_sample([1.0, 2.0], [1.0]), r"expected \(sample,\) = \(2,\)"),
        (lambda: held_part([1.0, 2.0], [1, 0]), "expected .* bool"),
        (lambda: held_part([1.0, np.nan], lost), "got 1 of 1 that are not"),
        (lambda: held_part([1.0, 2.0], [True, True]), "got 2 lost of 2"),
        (lambda: held_part([1.0, 2.0], lost, [1.0, 0.0]), "positive probability, got 0 in total"),
        (lambda: held_part([1.0, 2.0], lost, [0.4, 0.4]), "must sum to 1, got 0.8"),
    ):
        with pytest.raises(ValueError, match=sentence):
            call()


@pytest.mark.parametrize("draw", ["standard_normal", "standard_exponential"])
def test_the_interval_of_a_deviation_holds_it_as_often_as_it_says(draw):
    rng = np.random.default_rng(5)
    found = [deviation_interval(getattr(rng, draw)(300), 0.9) for _ in range(300)]
    inside = [low <= 1.0 <= high for _, low, high in found]  # both have a deviation of 1
    assert 0.84 < np.mean(inside) < 0.96
    with pytest.raises(ValueError, match="at least 8 values, got 3"):
        deviation_interval([1.0, 2.0, 3.0])
