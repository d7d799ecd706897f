"""The adaptive fold: what it keeps, when it stops, and that to resume is to read."""

from functools import partial

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maglev.uncertainty.adaptive import AdaptiveState, absorb, decision, propose
from maglev.uncertainty.kriging import fit_kriging
from maglev.uncertainty.learning import predicted_limits, tail_batch, taylor_batch
from maglev.uncertainty.rbf import fit_rbf

RNG = np.random.default_rng(8)
FIRST = RNG.standard_normal((20, 2))
CANDIDATES = RNG.standard_normal((400, 2))
NAN = np.full((1, 2), np.nan)


def model(u):
    """Two responses, and loss of the samples that stray below u₁ = −1.2."""
    lost = u[:, 0] < -1.2
    values = np.column_stack([u[:, 0] + np.sin(2.0 * u[:, 1]), 1e3 * np.exp(0.4 * u[:, 1])])
    return np.where(lost[:, None], np.nan, values), lost


def batches(fit, criterion, n_rounds):
    """The stored history of an adaptive run: one tuple per batch."""
    stored = [(FIRST, *model(FIRST), None)]
    state = absorb(AdaptiveState.empty(2, 2), *stored[0])
    for _ in range(n_rounds):
        proposal = propose(state, fit, criterion, CANDIDATES, 4)
        stored.append((proposal.points, *model(proposal.points), proposal.predicted))
        state = absorb(state, *stored[-1])
    return stored, state


def same(one, other):
    for name in AdaptiveState.__dataclass_fields__:
        assert_array_equal(getattr(one, name), getattr(other, name), err_msg=name)


@pytest.mark.parametrize(
    ("fit", "criterion"), [(fit_rbf, taylor_batch), (fit_kriging, tail_batch)], ids=["rbf", "krig"]
)
def test_to_resume_is_to_read(fit, criterion):
    stored, state = batches(fit, criterion, 4)
    assert state.lost.any()
    resumed = AdaptiveState.empty(2, 2)
    for batch in stored[:3]:
        resumed = absorb(resumed, *batch)
    for _ in range(2):
        proposal = propose(resumed, fit, criterion, CANDIDATES, 4)
        resumed = absorb(resumed, proposal.points, *model(proposal.points), proposal.predicted)
    same(state, resumed)


def test_absorbing_leaves_the_earlier_state_as_it_was():
    state = absorb(AdaptiveState.empty(2, 2), FIRST, *model(FIRST))
    before = {name: getattr(state, name).copy() for name in AdaptiveState.__dataclass_fields__}
    points, values = CANDIDATES[:1].copy(), np.ones((1, 2))
    after = absorb(state, points, values, None, values)
    points[:], values[:] = 99.0, 99.0
    for name, array in before.items():
        assert_array_equal(getattr(state, name), array)
    assert not (after.points == 99.0).any() and not (after.values == 99.0).any()


def test_error_is_the_largest_of_the_round_over_the_first_deviation():
    first = np.array([[0.0, 10.0], [2.0, 30.0]])  # standard deviations 1 and 10
    state = absorb(AdaptiveState.empty(1, 2), [[0.0], [1.0]], first)
    assert_array_equal(state.tested, [False])
    values, predicted = np.array([[5.0, 5.0], [6.0, 6.0]]), np.array([[5.5, 8.0], [5.8, 2.0]])
    state = absorb(state, [[2.0], [3.0]], values, None, predicted)
    assert_array_equal(state.tested, [False, True])
    assert_allclose(state.error[1], [0.5, 0.4])
    assert_array_equal(state.round_index, [0, 0, 1, 1])
    state = absorb(state, [[4.0]], [[7.0, 7.0]], None, [[7.3, 2.0]])  # the scale stays
    assert_allclose(state.error[2], [0.3, 0.5])


def test_lost_samples_poison_nothing():
    """The same design with and without lost samples: same surrogate, same error."""
    values, lost = model(FIRST)
    assert 0 < lost.sum() < 10
    with_lost = absorb(AdaptiveState.empty(2, 2), FIRST, values, lost)
    without = absorb(AdaptiveState.empty(2, 2), FIRST[~lost], values[~lost])
    for got, expected in zip(with_lost.training, without.training, strict=True):
        assert_array_equal(got, expected)
    proposal = propose(with_lost, fit_kriging, tail_batch, CANDIDATES, 4)
    assert np.isfinite(proposal.predicted).all()
    assert_array_equal(
        proposal.surrogate.predict(CANDIDATES), fit_kriging(*without.training).predict(CANDIDATES)
    )
    new = np.array([[-3.0, 0.0], [0.0, 0.0]])
    predicted = np.ones((2, 2))
    one = absorb(with_lost, new, np.vstack([NAN, [[1.5, 2.0]]]), np.array([True, False]), predicted)
    other = absorb(without, new[1:], [[1.5, 2.0]], None, predicted[1:])
    assert_array_equal(one.error[1], other.error[1])


def test_round_of_lost_samples_proves_nothing():
    state = absorb(AdaptiveState.empty(2, 2), FIRST, *model(FIRST))
    state = absorb(state, [[-4.0, 0.0]], NAN, np.array([True]), [[1.0, 1.0]])
    assert_array_equal(state.tested, [False, False])
    assert np.isnan(state.error[1]).all()
    assert decision(state, threshold=1e9, n_rounds=1, n_largest=1000) == "go_on"


def test_stops_only_after_successive_quiet_rounds():
    state = absorb(AdaptiveState.empty(2, 2), FIRST, *model(FIRST))
    scale = np.std(state.values[~state.lost], axis=0)
    quiet = partial(decision, threshold=0.1, n_rounds=2, n_largest=25)
    reasons = []
    for place, error in enumerate([0.05, 0.2, 0.05, 0.1 - 1e-9]):
        values = np.ones((1, 2))
        predicted = values + error * scale * [0.5, 1.0]
        state = absorb(state, CANDIDATES[[place]], values, None, predicted)
        reasons.append(quiet(state))
    assert reasons == ["go_on", "go_on", "go_on", "error_below_threshold"]
    state = absorb(state, CANDIDATES[[9]], np.ones((1, 2)), None, np.ones((1, 2)) + scale)
    assert quiet(state) == "largest_number_of_runs"


def test_adaptive_tail_limits_beat_the_first_design():
    """The whole loop on a known answer: limits of the held part at 1e-1 and 1e-2."""
    _, state = batches(fit_kriging, tail_batch, 6)
    population = np.random.default_rng(3).standard_normal((20000, 2))
    population = population[population[:, 0] > -1.2]
    exact = predicted_limits(model(population)[0], [0.1, 0.01])
    scale = model(population)[0].std(axis=0)
    errors = []
    for points, values in (model_training(FIRST), state.training):
        found = predicted_limits(fit_kriging(points, values).predict(population), [0.1, 0.01])
        errors.append(np.abs(found - exact) / scale)
    assert errors[1].max() < 0.03
    assert errors[1].max() < 0.3 * errors[0].max()


def model_training(points):
    values, lost = model(points)
    return points[~lost], values[~lost]


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ((np.empty((0, 2)), np.empty((0, 2))), "at least one point, got none"),
        (([[9.0, 9.0, 9.0]], [[1.0, 1.0]]), r"= \(any, 2\)"),
        (([[9.0, 9.0]], [[1.0]]), r"expected \(new, response\) = \(1, 2\)"),
        (([[9.0, 9.0]], [[1.0, 1.0]], [0]), "must be 1 booleans"),
        (([[9.0, 9.0]], NAN), "at point 0, expected finite values"),
        (([[9.0, 9.0]], [[1.0, np.nan]], [True]), "expected NaN in every response"),
        ((FIRST[:1], [[1.0, 1.0]]), "a run is never repeated"),
        (([[9.0, 9.0]], [[1.0, 1.0]], None, NAN), "predictions must be finite"),
    ],
)
def test_unusable_batches_are_refused(arguments, sentence):
    state = absorb(AdaptiveState.empty(2, 2), FIRST, *model(FIRST))
    with pytest.raises(ValueError, match=sentence):
        absorb(state, *arguments)


def test_unusable_histories_and_settings_are_refused():
    empty = AdaptiveState.empty(2, 2)
    with pytest.raises(ValueError, match="two samples of the first design that held, got 0"):
        absorb(empty, [[1.0, 1.0]], [[1.0, 1.0]], None, [[1.0, 1.0]])
    level = absorb(empty, [[1.0, 1.0], [2.0, 1.0]], np.ones((2, 2)))
    with pytest.raises(ValueError, match="response 0 must vary over the first design"):
        absorb(level, [[3.0, 1.0]], [[1.0, 1.0]], None, [[1.0, 1.0]])
    with pytest.raises(ValueError, match="must be positive, got"):
        decision(empty, threshold=0.0, n_rounds=2, n_largest=9)
