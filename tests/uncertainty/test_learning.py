"""Scores and batches on cases worked by hand, and against brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from maglev.uncertainty import learning
from maglev.uncertainty.kriging import fit_kriging
from maglev.uncertainty.learning import (
    predicted_limits,
    tail_batch,
    taylor_batch,
    taylor_remainder,
    taylor_scores,
)
from maglev.uncertainty.rbf import fit_rbf


class Parabola:
    """y = u² and 10 u², known at −1, 0 and 2: a surrogate whose Taylor remainder is h², 10 h²."""

    points = np.array([[-1.0], [0.0], [2.0]])
    values = np.array([[1.0, 10.0], [0.0, 0.0], [4.0, 40.0]])

    def predict(self, points):
        return np.asarray(points) ** 2 * [1.0, 10.0]

    def gradient(self, points):
        return (2.0 * np.asarray(points) * [1.0, 10.0])[:, :, None]


CANDIDATES = np.array([[-0.75], [0.5], [1.0], [3.0]])


def test_remainder_is_that_of_a_parabola():
    # nearest samples −1, 0, 0 (a tie with 2: the same distance), 2: steps 0.25, 0.5, ±1, 1
    remainder = taylor_remainder(Parabola(), CANDIDATES)
    assert_allclose(remainder, np.outer([0.0625, 0.25, 1.0, 1.0], [1.0, 10.0]))


def test_scores_are_those_worked_by_hand():
    # L = 4 (from −1 to 3): w = 15/16, 7/8, 3/4, 3/4; J = D/1 + w R/1
    one = [0.25 + 15 / 16 * 0.0625, 0.5 + 7 / 8 * 0.25, 1.75, 1.75]
    distance, remainder = [0.25, 0.5, 1.0, 1.0], np.array([[0.0625], [0.25], [1.0], [1.0]])
    assert_allclose(taylor_scores(distance, remainder, 4.0), one)
    both = np.hstack([remainder, 10.0 * remainder[::-1]])
    other = [0.25 + 15 / 16, 0.5 + 7 / 8, 1.0 + 3 / 4 * 0.25, 1.0 + 3 / 4 * 0.0625]
    assert_allclose(taylor_scores(distance, both, 4.0, "sum"), np.add(one, other))
    assert_allclose(taylor_scores(distance, both, 4.0, "maximum"), np.maximum(one, other))


def test_batch_counts_the_chosen_as_a_sample():
    # first the tie at J = 1.75, of which the earlier: u = 1.  Then its remainder is zero and
    # D = 0.25, 0.5, 0, 1: u = 3 with J = 1.75.  Then D = 0.25, 0.5, 0, 0 (max 0.5) and the largest
    # remainder is 0.25: J = 0.5 + 15/16 · 0.25 and 1 + 7/8: u = 0.5.
    samples = Parabola.points
    assert_array_equal(taylor_batch(Parabola(), samples, CANDIDATES, 4), [2, 3, 1, 0])


class Bumps(Parabola):
    """Flat at its only sample, the origin; remainder 100, 1 and 4 at the candidates below."""

    points = np.zeros((1, 2))
    values = np.zeros((1, 1))

    def predict(self, points):
        return np.select([points[:, [0]] > 0.0, points[:, [1]] > 0.0], [100.0, 1.0], 4.0)

    def gradient(self, points):
        return np.zeros((len(points), 1, 2))


def test_batch_forgets_the_remainder_of_the_chosen():
    # L = √109: first J = 1.04, 0.31, 0.23.  Then max R is 4 and max D is 3: J = 1.18 for the second
    # and 1.47 for the third; with max R still 100 it would be 1.01 and 0.70.
    candidates = np.array([[10.0, 0.0], [0.0, 3.0], [0.0, -2.0]])
    assert_array_equal(taylor_batch(Bumps(), Bumps.points, candidates, 3), [0, 2, 1])


def test_lost_sample_keeps_others_away():
    occupied = np.vstack([Parabola.points, [[3.0]]])
    assert 3 not in taylor_batch(Parabola(), occupied, CANDIDATES, 3)
    with pytest.raises(ValueError, match="between 1 and 3 points"):
        taylor_batch(Parabola(), occupied, CANDIDATES, 4)


def test_what_would_be_lost_is_not_chosen():
    held = np.array([1.0, 1.0, 0.0, 1.0])
    assert taylor_batch(Parabola(), Parabola.points, CANDIDATES, 1, held_probability=held)[0] == 3


def test_linear_response_leaves_distance_alone():
    points = np.random.default_rng(1).standard_normal((12, 2))
    surrogate = fit_rbf(points, points @ [1.0, 2.0])
    candidates = np.random.default_rng(2).standard_normal((40, 2))
    assert_allclose(taylor_remainder(surrogate, candidates), 0.0, atol=1e-12)


@settings(deadline=None, max_examples=50)
@given(
    st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60),
    st.floats(0.001, 0.999),
)
def test_limit_is_the_smallest_value_exceeded_rarely_enough(values, exceedance):
    values = np.array(values)
    limit = predicted_limits(values[:, None], [exceedance])[0, 0]
    slack = 1e-6 / values.size
    assert limit in values
    assert np.mean(values > limit) <= exceedance + slack
    lower = values[values < limit]
    if lower.size:
        assert np.mean(values > lower.max()) > exceedance


def test_limits_count_losses():
    values, held = np.arange(1.0, 11.0)[:, None], np.ones(10)
    assert_array_equal(predicted_limits(values, [0.35, 0.2])[:, 0], [7.0, 8.0])
    held[0] = 0.0  # one in ten lost, whatever its prediction
    assert_array_equal(predicted_limits(values, [0.35, 0.2, 0.05], held)[:, 0], [8.0, 9.0, np.inf])


RNG = np.random.default_rng(5)
SAMPLES = RNG.standard_normal((25, 2))
POPULATION = RNG.standard_normal((600, 2))


def motion(u):
    return np.column_stack([u[:, 0] + 0.3 * np.sin(3.0 * u[:, 1]), np.exp(0.5 * u[:, 1])])


@pytest.fixture(scope="module")
def surrogate():
    return fit_kriging(SAMPLES, motion(SAMPLES))


def test_tail_batch_takes_away_most_variance_near_the_limits(surrogate):
    """Every choice against brute force: the process conditioned anew on each candidate."""
    candidates = POPULATION[:60]
    scale = motion(SAMPLES).std(axis=0)
    values, deviation = surrogate.predict(candidates), surrogate.standard_deviation(candidates)
    limits = predicted_limits(values, [0.1])[0]

    def remaining(run):
        """Mean variance near the limits once ``run`` is known, over that of each response."""
        total = 0.0
        for response in range(2):
            excess = values[:, response] - limits[response]
            width = np.hypot(deviation[:, response], learning.BAND * scale[response])
            weight = np.exp(-0.5 * (excess / width) ** 2) / width
            share = np.cumsum(weight) / weight.sum()
            nodes = candidates[np.searchsorted(share, (np.arange(256) + 0.5) / 256)]
            prior = np.diag(surrogate.covariance(response, nodes, nodes))
            between = surrogate.covariance(response, nodes, candidates[run])
            known = surrogate.covariance(response, candidates[run], candidates[run])
            explained = np.einsum("ij,ij->i", between, np.linalg.solve(known, between.T).T)
            total += np.mean(prior - explained) / scale[response] ** 2
        return total

    taken = []
    for choice in tail_batch(surrogate, SAMPLES, candidates, 4, exceedances=[0.1]):
        best = min(remaining([*taken, other]) for other in range(60) if other not in taken)
        taken.append(choice)
        assert_allclose(remaining(taken), best, rtol=1e-8)


def test_tail_batch_follows_the_limit(surrogate):
    values = motion(POPULATION)
    chosen = [tail_batch(surrogate, SAMPLES, POPULATION, 6, exceedances=[p]) for p in (0.02, 0.9)]
    assert (values[chosen[0]].mean(axis=0) > values[chosen[1]].mean(axis=0)).all()


@pytest.mark.parametrize("batch", [taylor_batch, tail_batch])
@pytest.mark.parametrize("aggregate", learning.AGGREGATES)
def test_batch_is_new_distinct_and_repeatable(surrogate, batch, aggregate):
    candidates = np.concatenate([SAMPLES, POPULATION[:200], POPULATION[:50]])
    chosen = batch(surrogate, SAMPLES, candidates, 10, aggregate=aggregate)
    assert np.unique(candidates[chosen], axis=0).shape[0] == 10
    assert (chosen >= 25).all()
    assert_array_equal(chosen, batch(surrogate, SAMPLES, candidates, 10, aggregate=aggregate))


def test_tail_batch_leaves_out_what_would_be_lost(surrogate):
    held = (POPULATION[:, 0] < 0.5).astype(float)
    chosen = tail_batch(surrogate, SAMPLES, POPULATION, 5, held_probability=held)
    assert (POPULATION[chosen, 0] < 0.5).all()


def test_losses_beyond_every_limit_still_leave_targets(surrogate):
    held = np.full(600, 0.8)
    chosen = tail_batch(surrogate, SAMPLES, POPULATION, 3, held_probability=held)
    assert_array_equal(chosen, tail_batch(surrogate, SAMPLES, POPULATION, 3))


@pytest.mark.parametrize("batch", [taylor_batch, tail_batch])
def test_unusable_requests_are_refused(surrogate, batch):
    with pytest.raises(ValueError, match="aggregate must be one of sum, maximum, got 'mean'"):
        batch(surrogate, SAMPLES, POPULATION, 2, aggregate="mean")
    with pytest.raises(ValueError, match="between 1 and 600 points"):
        batch(surrogate, SAMPLES, POPULATION, 0)
    with pytest.raises(ValueError, match="600 numbers between 0 and 1"):
        batch(surrogate, SAMPLES, POPULATION, 2, held_probability=np.full(600, 1.5))
    with pytest.raises(ValueError, match=r"= \(any, 2\)"):
        batch(surrogate, SAMPLES, POPULATION[:, :1], 2)


def test_unusable_scores_are_refused(surrogate):
    with pytest.raises(ValueError, match="all 2 candidates are samples already"):
        taylor_scores([0.0, 0.0], [[1.0], [2.0]], 1.0)
    with pytest.raises(ValueError, match="exceedances must lie between 0 and 1"):
        predicted_limits([[1.0]], [0.0])
    with pytest.raises(ValueError, match="1 numbers between 0 and 1, one per point"):
        predicted_limits([[1.0]], [0.1], [2.0])
    with pytest.raises(ValueError, match="needs a surrogate with a covariance, got RBF"):
        tail_batch(fit_rbf(SAMPLES, motion(SAMPLES)), SAMPLES, POPULATION, 2)
