"""Shares of the variance: exact for sums and products, intervals that hold them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from maglev.uncertainty.shares import crossed_shares, first_order, pick_freeze_shares


def runs(function, n, seed):
    """Pick-freeze runs of a function of two standard normal inputs."""
    a, b, new_a, new_b = np.random.default_rng(seed).standard_normal((4, n))
    return function(a, b), function(a, new_b), function(new_a, b)


def test_a_response_of_the_first_group_alone_is_all_its_share():
    shares = pick_freeze_shares(*runs(lambda a, b: 1e6 + a, 4000, 1), np.random.default_rng(0))
    assert_allclose(shares.first, 1.0, atol=1e-9)
    assert_allclose(shares.second[0], 0.0, atol=0.06)


@pytest.mark.parametrize(
    ("function", "exact"),
    [
        (lambda a, b: 3.0 * a + b, (0.9, 0.1, 0.0)),
        (lambda a, b: a * b, (0.0, 0.0, 1.0)),
        (lambda a, b: (1.0 + a) * (1.0 + b), (1 / 3, 1 / 3, 1 / 3)),
    ],
)
def test_intervals_hold_the_exact_share_as_often_as_the_confidence_says(function, exact):
    inside = []
    for seed in range(60):
        shares = pick_freeze_shares(
            *runs(function, 300, seed), np.random.default_rng(seed), confidence=0.9
        )
        found = np.array([shares.first, shares.second, shares.interaction])
        assert_allclose(found[:, 0].sum(), 1.0)
        inside.append((found[:, 1] <= exact) & (exact <= found[:, 2]))
    assert (np.mean(inside, axis=0) > 0.78).all()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda y: y[:, :1], "two or more"),
        (lambda y: np.where(y > 1.0, np.nan, y), "must be finite"),
        (np.zeros_like, "must differ"),
    ],
)
def test_a_mistake_is_one_sentence(change, sentence):
    made = change(np.array(runs(lambda a, b: a + b, 50, 2)))
    with pytest.raises(ValueError, match=sentence):
        pick_freeze_shares(*made, np.random.default_rng(0))


def crossed(function, n_second, n_first, seed):
    """Every first input on every second, both standard normal: (second, first)."""
    rng = np.random.default_rng(seed)
    return function(rng.standard_normal((1, n_first)), rng.standard_normal((n_second, 1)))


@pytest.mark.parametrize(
    ("function", "exact"),
    [
        (lambda a, b: 3.0 * a + b, (0.9, 0.1, 0.0)),
        (lambda a, b: 0.2 * a + b, (1 / 26, 25 / 26, 0.0)),
        (lambda a, b: (1.0 + a) * (1.0 + b), (1 / 3, 1 / 3, 1 / 3)),
    ],
)
def test_intervals_of_crossed_runs_hold_the_exact_share_as_often_as_they_say(function, exact):
    inside = []
    for seed in range(60):
        shares = crossed_shares(1e6 + crossed(function, 20, 64, seed), confidence=0.9)
        found = np.array([shares.first, shares.second, shares.interaction])
        assert_allclose(found[:, 0].sum(), 1.0)
        inside.append(
            (found[:, 1] <= np.array(exact) + 1e-9) & (np.array(exact) - 1e-9 <= found[:, 2])
        )
    assert (np.mean(inside, axis=0) > 0.78).all()


def test_components_of_crossed_runs_are_unbiased_and_those_of_no_track_vanish():
    rng = np.random.default_rng(8)
    found = [
        crossed_shares(rng.standard_normal((1, 64)) + rng.standard_normal((6, 64)))
        for _ in range(200)
    ]
    assert_allclose(np.mean([one.second[0] for one in found]), 0.0, atol=0.01)
    assert_allclose(np.mean([one.first[0] for one in found]), 0.5, atol=0.02)


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (np.ones((2, 9)), "at least three second"),
        (np.full((4, 9), np.nan), "must be finite"),
        (np.ones((4, 9)), "must differ"),
    ],
)
def test_a_mistake_in_crossed_runs_is_one_sentence(values, sentence):
    with pytest.raises(ValueError, match=sentence):
        crossed_shares(values)


def test_first_order_indices_by_bins_are_those_of_a_sum_and_a_product():
    points = np.random.default_rng(2).standard_normal((2**14, 3))
    values = np.column_stack([2 * points[:, 0] + points[:, 1], points[:, 1] * points[:, 2]])
    assert_allclose(first_order(points, values), [[0.8, 0.2, 0.0], [0.0, 0.0, 0.0]], atol=0.02)
