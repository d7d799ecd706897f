"""One surrogate per response: chosen by leave-one-out, kept as a few numbers, made again."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from maglev.uncertainty import selection
from maglev.uncertainty.kriging import conditioned_kriging, fit_kriging
from maglev.uncertainty.rbf import fit_rbf, fit_scaled_rbf
from maglev.uncertainty.selection import CHOICES, fit_selected, rebuilt
from maglev.uncertainty.surrogate import relative_error
from maglev.vocabulary import SURROGATES

POINTS = np.random.default_rng(30).standard_normal((40, 2))
ELSEWHERE = np.random.default_rng(31).standard_normal((15, 2))
VALUES = np.column_stack(
    [
        1e-3 * (np.sin(3.0 * POINTS[:, 0]) + 0.01 * POINTS[:, 1]),  # one input alone
        np.linalg.norm(POINTS - 0.2, axis=1) ** 3,  # the cubic basis itself
        np.exp(0.4 * POINTS[:, 0]) * np.cos(POINTS[:, 1]),
    ]
)
SINGLE = {"rbf": fit_rbf, "scaled_rbf": fit_scaled_rbf, "kriging": fit_kriging}


@pytest.mark.parametrize("kind", SURROGATES)
def test_a_named_kind_is_that_surrogate(kind):
    chosen, alone = fit_selected(POINTS, VALUES, kind), SINGLE[kind](POINTS, VALUES)
    assert chosen.kinds == (kind,) * 3
    # a nearly singular matrix turns rounding into 1e-7 of a response
    scale = VALUES.std(axis=0)
    for name in ("predict", "gradient"):
        ours, theirs = getattr(chosen, name)(ELSEWHERE), getattr(alone, name)(ELSEWHERE)
        ours, theirs = np.moveaxis(ours, 1, -1), np.moveaxis(theirs, 1, -1)
        assert_allclose(ours / scale, theirs / scale, atol=1e-6)
    assert_allclose(chosen.leave_one_out() / scale, alone.leave_one_out() / scale, atol=1e-6)


def test_best_has_the_smallest_leave_one_out_error_of_all_in_every_response():
    best = fit_selected(POINTS, VALUES, "best")
    errors = np.array([relative_error(SINGLE[kind](POINTS, VALUES)) for kind in SURROGATES])
    assert best.kinds == tuple(SURROGATES[k] for k in errors.argmin(axis=0))
    assert len(set(best.kinds)) > 1  # else the responses say nothing about the choice
    assert_allclose(relative_error(best), errors.min(axis=0), rtol=1e-6)


def test_only_kriging_has_a_deviation():
    best = fit_selected(POINTS, VALUES, "best")
    deviation = best.standard_deviation(ELSEWHERE)
    assert_array_equal(np.isfinite(deviation).all(axis=0), [k == "kriging" for k in best.kinds])
    expected = fit_kriging(POINTS, VALUES).standard_deviation(ELSEWHERE)
    for response, kind in enumerate(best.kinds):
        if kind == "kriging":
            assert_allclose(deviation[:, response], expected[:, response], rtol=1e-9)


@pytest.mark.parametrize("choice", CHOICES)
def test_a_surrogate_is_made_again_bit_for_bit_without_a_search(choice, monkeypatch):
    first = fit_selected(POINTS, VALUES, choice)
    monkeypatch.setattr(selection, "_FITS", {})
    again = rebuilt(POINTS, VALUES, first.kinds, first.length, first.amplitude)
    assert_array_equal(again.predict(ELSEWHERE), first.predict(ELSEWHERE))


def test_conditioning_on_the_parameters_found_is_the_fit():
    fitted = fit_kriging(POINTS, VALUES)
    again = conditioned_kriging(POINTS, VALUES, length=fitted.length, amplitude=fitted.amplitude)
    assert_array_equal(again.predict(ELSEWHERE), fitted.predict(ELSEWHERE))


def test_best_leaves_out_a_kind_that_refuses_the_points():
    points = np.vstack([POINTS, POINTS[0] + 1e-9])  # too near for the cubic saddle matrix
    values = np.vstack([VALUES, VALUES[0] * (1.0 + 1e-9)])
    with pytest.raises(ValueError, match="condition number"):
        fit_selected(points, values, "rbf")
    assert set(fit_selected(points, values, "best").kinds) == {"kriging"}


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda: fit_selected(POINTS, VALUES, "spline"), "surrogate must be one of rbf, scaled"),
        (
            lambda: rebuilt(POINTS, VALUES, ("rbf", "spline", "rbf"), np.ones((3, 2)), np.ones(3)),
            "kinds must be 3 of rbf",
        ),
        (
            lambda: rebuilt(POINTS, VALUES, ("rbf",) * 3, np.ones((2, 3)), np.ones(3)),
            r"expected \(response, parameter\) = \(3, 2\)",
        ),
        (
            lambda: conditioned_kriging(POINTS, VALUES, length=np.zeros((3, 2)), amplitude=[1] * 3),
            "lengths must be positive",
        ),
    ],
)
def test_a_mistake_is_one_sentence(call, sentence):
    with pytest.raises(ValueError, match=sentence):
        call()
