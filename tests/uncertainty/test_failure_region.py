"""The region of lost samples against borders whose posterior is known."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.special import expit, log_expit
from scipy.stats import norm

from maglev.uncertainty.failure_region import border_batch, fit_failure_region

POPULATION = np.random.default_rng(4).standard_normal((20000, 2))


def lost_below(u):
    """Lost below a slanted border at 2.33 standard deviations: one in a hundred."""
    return (u @ [0.8, 0.6]) < norm.ppf(0.01)


def learnt(n, seed, spread=1.5):
    points = spread * np.random.default_rng(seed).standard_normal((n, 2))
    return points, fit_failure_region(points, lost_below(points), np.random.default_rng(seed))


def test_single_input_border_lies_between_held_and_lost():
    """One input: with held samples down to −1 and lost ones up to −2, every border is between."""
    points = np.array([[-4.0], [-3.0], [-2.0], [-1.0], [0.0], [1.0], [2.0], [3.0]])
    region = fit_failure_region(points, points[:, 0] < -1.5, np.random.default_rng(0))
    assert (region.lost_probability(points[:3]) > 0.9).all()
    assert (region.lost_probability(points[3:]) < 0.1).all()
    middle = region.lost_probability(np.linspace(-1.9, -1.1, 5)[:, None])
    assert (np.diff(middle) < 0.0).all() and 0.25 < middle[2] < 0.75


def test_borders_are_draws_from_the_posterior():
    """One input, three coefficients: against the prior weighted by the likelihood."""
    points = np.array([-3.5, -2.6, -1.4, -0.8, -0.1, 0.3, 0.9, 1.6, 2.4])
    lost = points < -2.0
    population = norm.ppf((np.arange(400) + 0.5) / 400)
    prior = np.random.default_rng(11).standard_normal((200_000, 3)) * [6.0, 1.0, 0.1]
    logit = 20.0 * prior @ np.array([points**0, points, points**2])
    weight = np.exp(np.where(lost, log_expit(logit), log_expit(-logit)).sum(axis=1))
    likely = weight > 1e-6 * weight.max()
    prior, weight = prior[likely], weight[likely] / weight[likely].sum()
    total = expit(20.0 * prior @ np.array([population**0, population, population**2])).mean(axis=1)
    mean = weight @ total
    deviation = np.sqrt(weight @ (total - mean) ** 2)

    totals = [
        fit_failure_region(points[:, None], lost, np.random.default_rng(seed)).total_probability(
            population[:, None]
        )
        for seed in range(5)
    ]
    assert abs(np.mean(totals) - mean) < 0.15 * deviation
    assert abs(np.std(totals) / deviation - 1.0) < 0.1


def test_probability_and_its_interval_hold_the_truth():
    inside = []
    for seed in range(10):
        _, region = learnt(60, seed)
        lower, upper = np.quantile(region.total_probability(POPULATION), [0.025, 0.975])
        inside.append(lower <= lost_below(POPULATION).mean() <= upper)
    assert sum(inside) >= 9


def test_uncertainty_shrinks_with_samples():
    spread = [np.std(learnt(n, 3)[1].total_probability(POPULATION)) for n in (40, 300)]
    assert spread[1] < 0.4 * spread[0]


def test_total_probability_is_the_mean_of_the_pointwise_one():
    _, region = learnt(60, 1)
    total = region.total_probability(POPULATION).mean()
    assert abs(total - region.lost_probability(POPULATION).mean()) < 1e-12


def test_same_seed_same_region():
    assert_array_equal(learnt(40, 2)[1].borders, learnt(40, 2)[1].borders)


def test_border_batch_shrinks_the_uncertainty_fastest():
    points, region = learnt(60, 6)
    candidates = POPULATION[:4000]

    def spread_after(new):
        joint = np.concatenate([points, new])
        better = fit_failure_region(joint, lost_below(joint), np.random.default_rng(6))
        return np.std(better.total_probability(POPULATION))

    chosen = border_batch(region, points, candidates, 6)
    assert np.unique(chosen).size == 6
    doubt = region.lost_probability(candidates[chosen])
    assert ((doubt > 0.02) & (doubt < 0.98)).all()
    assert spread_after(candidates[chosen]) < 0.6 * np.std(region.total_probability(POPULATION))
    assert spread_after(candidates[chosen]) < 0.7 * spread_after(candidates[:6])


def test_border_batch_is_the_best_linear_predictor_of_the_probability():
    """Every choice against least squares: regression of P on the outcomes chosen so far."""
    points, region = learnt(60, 6)
    candidates = POPULATION[:300]
    total = region.total_probability(candidates)
    outcome = np.array([region._by_border(candidates[[c]])[0] for c in range(300)])
    open_question = np.flatnonzero(outcome.var(axis=1) > 1e-3)

    def unexplained(chosen):
        design = np.column_stack([np.ones(total.size), *outcome[chosen]])
        residual = total - design @ np.linalg.lstsq(design, total, rcond=None)[0]
        return residual @ residual

    taken = []
    for choice in border_batch(region, points, candidates, 3):
        best = min(unexplained([*taken, other]) for other in open_question)
        taken.append(choice)
        assert_allclose(unexplained(taken), best, rtol=1e-6)


def test_border_batch_takes_nothing_twice():
    points, region = learnt(30, 7)
    candidates = np.concatenate([points, POPULATION[:5]])
    assert sorted(border_batch(region, points, candidates, 5)) == list(range(30, 35))
    with pytest.raises(ValueError, match="between 1 and 5 points"):
        border_batch(region, points, candidates, 6)


def test_unusable_outcomes_are_refused():
    points, rng = POPULATION[:10], np.random.default_rng(0)
    with pytest.raises(ValueError, match="must be 10 booleans"):
        fit_failure_region(points, np.zeros(10), rng)
    with pytest.raises(ValueError, match="got 0 lost of 10"):
        fit_failure_region(points, np.zeros(10, dtype=bool), rng)
    with pytest.raises(ValueError, match="got 10 lost of 10"):
        fit_failure_region(points, np.ones(10, dtype=bool), rng)
    region = learnt(30, 7)[1]
    with pytest.raises(ValueError, match=r"= \(any, 2\)"):
        region.lost_probability(np.zeros((3, 4)))
    with pytest.raises(ValueError, match="at least one point, got none"):
        region.total_probability(np.empty((0, 2)))
