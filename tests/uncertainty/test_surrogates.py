"""Surrogates against SciPy, scikit-learn and OpenTURNS, brute force and finite differences."""

import numpy as np
import openturns as ot
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import RBFInterpolator
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, Matern

from maglev.uncertainty import kriging
from maglev.uncertainty.kriging import Kriging, fit_kriging
from maglev.uncertainty.rbf import BASES, RBF, SHAPED, fit_rbf, fit_scaled_rbf
from maglev.uncertainty.surrogate import best_by_leave_one_out, relative_error

POINTS = np.random.default_rng(20).standard_normal((30, 3))
ELSEWHERE = np.random.default_rng(21).standard_normal((17, 3))
SHAPE = {"multiquadric": 0.7, "gaussian": 0.6}


def responses(u):
    """Two smooth responses of very different size; the third input hardly matters."""
    return np.column_stack(
        [
            1e-3 * (np.sin(u[:, 0]) + 0.3 * u[:, 1] ** 2 + 0.01 * u[:, 2]),
            50.0 + 10.0 * np.exp(0.3 * u[:, 1]) + 2.0 * u[:, 0] * u[:, 1],
        ]
    )


VALUES = responses(POINTS)


def gaussian_processes(points, values):
    """Kriging with given parameters, so that the formulas are tested and not the search."""
    length = np.array([[1.5, 2.0, 9.0], [3.0, 1.2, 7.0]])
    amplitude = np.array([2.0, 5.0])
    mean, deviation = VALUES.mean(axis=0), VALUES.std(axis=0)
    weights, factor = [], []
    for response in range(2):
        process = kriging._process(amplitude[response], length[response])
        process.fit(points, (values[:, response] - mean[response]) / deviation[response])
        weights.append(process.alpha_)
        factor.append(process.L_)
    return Kriging(
        points=points,
        values=values,
        mean=mean,
        deviation=deviation,
        length=length,
        amplitude=amplitude,
        weights=np.column_stack(weights),
        factor=np.array(factor),
    )


FITS = {
    basis: lambda points, values, basis=basis: fit_rbf(
        points, values, basis=basis, shape=SHAPE.get(basis), length=[1.0, 2.0, 0.8]
    )
    for basis in BASES
} | {"kriging": gaussian_processes}
SEARCHES = {"rbf": fit_rbf, "scaled_rbf": fit_scaled_rbf, "kriging": fit_kriging}


@pytest.mark.parametrize("basis", BASES)
def test_values_are_those_of_scipy(basis):
    ours = fit_rbf(POINTS, VALUES, basis=basis, shape=SHAPE.get(basis))
    kernel = {"thin_plate": "thin_plate_spline"}.get(basis, basis)
    theirs = RBFInterpolator(POINTS, VALUES, kernel=kernel, epsilon=ours.shape, degree=1)
    assert_allclose(ours.predict(ELSEWHERE), theirs(ELSEWHERE), rtol=1e-9, atol=1e-10)


@pytest.mark.parametrize("name", FITS)
def test_surrogate_passes_through_its_training_points(name):
    surrogate = FITS[name](POINTS, VALUES)
    assert_allclose(
        surrogate.predict(POINTS) / VALUES.std(axis=0), VALUES / VALUES.std(axis=0), atol=1e-7
    )


@pytest.mark.parametrize("name", FITS)
def test_gradient_is_the_finite_difference(name):
    surrogate = FITS[name](POINTS, VALUES)
    step, places = 1e-5, np.concatenate([ELSEWHERE, POINTS[:3]])
    gradient = surrogate.gradient(places)
    assert gradient.shape == (20, 2, 3)
    for d in range(3):
        move = step * np.eye(3)[d]
        difference = surrogate.predict(places + move) - surrogate.predict(places - move)
        tolerance = 1e-4 if name == "thin_plate" else 2e-6  # φ″ of the thin plate grows as ln r
        scale = VALUES.std(axis=0)
        assert_allclose(
            gradient[:, :, d] / scale, difference / (2 * step) / scale, atol=tolerance, rtol=1e-5
        )


@pytest.mark.parametrize("name", FITS)
def test_leave_one_out_is_brute_force(name):
    surrogate = FITS[name](POINTS, VALUES)
    brute = np.empty_like(VALUES)
    for k in range(POINTS.shape[0]):
        without = FITS[name](np.delete(POINTS, k, 0), np.delete(VALUES, k, 0))
        brute[k] = VALUES[k] - without.predict(POINTS[[k]])[0]
    scale = VALUES.std(axis=0)
    assert_allclose(surrogate.leave_one_out() / scale, brute / scale, rtol=1e-5, atol=1e-8)


def test_leave_one_out_deviation_is_brute_force():
    brute = np.empty_like(VALUES)
    for k in range(POINTS.shape[0]):
        without = gaussian_processes(np.delete(POINTS, k, 0), np.delete(VALUES, k, 0))
        brute[k] = without.standard_deviation(POINTS[[k]])[0]
    deviation = gaussian_processes(POINTS, VALUES).leave_one_out_deviation()
    assert_allclose(deviation, brute, rtol=1e-5)


@pytest.mark.parametrize("name", SEARCHES)
def test_several_responses_are_fitted_as_each_alone(name):
    together = SEARCHES[name](POINTS, VALUES).predict(ELSEWHERE)
    for response in range(2):
        alone = SEARCHES[name](POINTS, VALUES[:, response]).predict(ELSEWHERE)
        assert_allclose(together[:, [response]], alone, rtol=1e-6)


@settings(deadline=None, max_examples=25)
@given(
    slope=st.lists(st.floats(-5, 5), min_size=3, max_size=3).filter(
        lambda s: max(abs(x) for x in s) > 0.1
    ),
    constant=st.floats(-100, 100),
    basis=st.sampled_from(sorted(BASES)),
)
def test_linear_functions_are_reproduced_everywhere(slope, constant, basis):
    surrogate = fit_rbf(POINTS, POINTS @ slope + constant, basis=basis, shape=SHAPE.get(basis))
    far = 5.0 * ELSEWHERE
    scale = 1.0 + abs(constant) + np.abs(slope).sum()
    assert_allclose(
        surrogate.predict(far)[:, 0] / scale, (far @ slope + constant) / scale, atol=1e-8
    )
    assert_allclose(
        surrogate.gradient(far)[:, 0] / scale, np.tile(slope, (17, 1)) / scale, atol=1e-8
    )


@pytest.mark.parametrize("basis", SHAPED)
def test_shape_found_has_no_better_neighbour(basis):
    found = fit_rbf(POINTS, VALUES, basis=basis)
    assert found.condition <= 1e14
    best = np.sum(relative_error(found) ** 2)
    for factor in (0.9, 1.1):
        other = fit_rbf(POINTS, VALUES, basis=basis, shape=found.shape * factor)
        assert np.sum(relative_error(other) ** 2) >= best


def test_lengths_found_have_no_better_neighbour_and_know_which_input_matters():
    found = fit_scaled_rbf(POINTS, VALUES)
    assert (found.length[:, 2] > 2.0 * found.length[:, :2].max(axis=1)).all()
    best = relative_error(found)
    assert (best < relative_error(fit_rbf(POINTS, VALUES))).all()
    for response in range(2):
        for d in range(3):
            for factor in (0.9, 1.1):
                length = found.responses[response].length * np.where(np.arange(3) == d, factor, 1)
                other = fit_rbf(POINTS, VALUES[:, response], length=length)
                assert relative_error(other)[0] >= best[response] * (1 - 1e-3)


def test_kriging_is_scikit_learns_with_the_same_parameters():
    ours = fit_kriging(POINTS, VALUES)
    for response in range(2):
        kernel = ConstantKernel(ours.amplitude[response]) * Matern(ours.length[response], nu=2.5)
        theirs = GaussianProcessRegressor(
            kernel, alpha=kriging.NUGGET, optimizer=None, normalize_y=True
        ).fit(POINTS, VALUES[:, response])
        value, deviation = theirs.predict(ELSEWHERE, return_std=True)
        _, covariance = theirs.predict(ELSEWHERE, return_cov=True)
        assert_allclose(ours.predict(ELSEWHERE)[:, response], value, rtol=1e-6)
        variance = ours.standard_deviation(ELSEWHERE)[:, response] ** 2
        # a small one is a difference of large numbers
        assert_allclose(variance, deviation**2, rtol=1e-4, atol=1e-6 * covariance.max())
        assert_allclose(
            ours.covariance(response, ELSEWHERE[:5], ELSEWHERE),
            covariance[:5],
            atol=1e-6 * covariance.max(),
        )


def test_kriging_likelihood_is_at_least_that_of_openturns():
    """The search, against another library's: its likeliest parameters are no likelier."""
    standardised = (VALUES - VALUES.mean(axis=0)) / VALUES.std(axis=0)
    ours = fit_kriging(POINTS, VALUES)
    for response in range(2):
        model = ot.MaternModel([1.0] * 3, [1.0], 2.5)
        fitter = ot.GaussianProcessFitter(POINTS, standardised[:, [response]], model, ot.Basis([]))
        fitter.setOptimizationBounds(ot.Interval([0.1] * 3, [1e3] * 3))
        fitter.run()
        covariance = fitter.getResult().getCovarianceModel()
        theirs = np.log([covariance.getAmplitude()[0] ** 2, *np.array(covariance.getScale())])
        process = kriging._process(1.0, np.ones(3)).fit(POINTS, standardised[:, response])
        found = np.log([ours.amplitude[response], *ours.length[response]])
        likelihood = process.log_marginal_likelihood
        assert likelihood(found) >= likelihood(theirs) - 1e-3


@pytest.mark.parametrize("theta", [np.zeros(8), np.log([30.0, *np.linspace(1.0, 20.0, 7)])])
def test_likelihood_of_many_inputs_and_its_slope_are_scikit_learns(theta):
    points = np.random.default_rng(3).standard_normal((60, 7))
    values = np.sin(points[:, 0]) + 0.3 * points[:, 1] * points[:, 6]
    theirs = kriging._likelihood_by_library(points, values)(theta)
    ours = kriging._likelihood(points, values)(theta)
    assert_allclose(ours[0], theirs[0], rtol=1e-10)
    assert_allclose(ours[1], theirs[1], atol=1e-9 * np.abs(theirs[1]).max())


def test_four_inputs_are_searched_by_scikit_learn_bit_by_bit(monkeypatch):
    points = np.random.default_rng(6).standard_normal((30, 4))
    found = fit_kriging(points, responses(points))
    monkeypatch.setattr(kriging, "_likelihood", None)
    again = fit_kriging(points, responses(points))
    assert_array_equal(again.length, found.length)
    with pytest.raises(TypeError):
        fit_kriging(np.random.default_rng(6).standard_normal((30, 5)), responses(points))


def test_search_in_many_inputs_ends_where_that_of_scikit_learn_does(monkeypatch):
    points = np.random.default_rng(4).standard_normal((60, 6))
    values = responses(points)
    ours = fit_kriging(points, values)
    monkeypatch.setattr(kriging, "SEARCHED_BY_LIBRARY", 6)
    theirs = fit_kriging(points, values)
    scale = values.std(axis=0)
    elsewhere = np.random.default_rng(5).standard_normal((17, 6))
    assert (np.abs(ours.predict(elsewhere) - theirs.predict(elsewhere)) < 1e-3 * scale).all()
    assert_allclose(np.log(ours.length[:, :2]), np.log(theirs.length[:, :2]), atol=0.02)


def test_kriging_deviation_is_zero_at_samples_and_covers_the_error():
    surrogate = fit_kriging(POINTS, VALUES)
    scale = VALUES.std(axis=0)
    assert (surrogate.standard_deviation(POINTS) / scale < 1e-4).all()
    error = np.abs(surrogate.predict(ELSEWHERE) - responses(ELSEWHERE))
    assert (error <= 5.0 * surrogate.standard_deviation(ELSEWHERE) + 1e-4 * scale).all()


def test_prediction_does_not_depend_on_its_company():
    for fit in SEARCHES.values():
        surrogate = fit(POINTS, VALUES)
        together = surrogate.predict(ELSEWHERE)
        assert_array_equal(surrogate.predict(ELSEWHERE[4:6]), together[4:6])


def test_best_surrogate_is_chosen_for_each_response():
    surrogates = {name: fit(POINTS, VALUES) for name, fit in SEARCHES.items()}
    errors = {name: relative_error(surrogate) for name, surrogate in surrogates.items()}
    for response, name in enumerate(best_by_leave_one_out(surrogates)):
        assert errors[name][response] == min(error[response] for error in errors.values())
    with pytest.raises(ValueError, match="must share their training data"):
        best_by_leave_one_out({"a": surrogates["rbf"], "b": fit_rbf(POINTS[:20], VALUES[:20])})
    with pytest.raises(ValueError, match="needs at least one, got none"):
        best_by_leave_one_out({})


@pytest.mark.parametrize("fit", SEARCHES.values(), ids=SEARCHES)
@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda u, y: (u.ravel(), y), r"expected \(point, parameter\)"),
        (lambda u, y: (u, y[:-1]), r"expected \(sample, response\) = \(30, at least 1\)"),
        (lambda u, y: (np.where(u == u[4], np.nan, u), y), "first is point 4"),
        (lambda u, y: (u, np.where(y == y[7], np.nan, y)), "first is sample 7"),
        (lambda u, y: (u[:3], y[:3]), "needs at least 4 points, got 3"),
        (lambda u, y: (np.vstack([u, u[5]]), np.vstack([y, y[5]])), "as samples 5 and 30"),
        (lambda u, y: (u * [1.0, 1.0, 0.0], y), "points that span only 2"),
        (lambda u, y: (u, y * [1.0, 0.0]), "for response 1"),
    ],
    ids=["shape", "rows", "point NaN", "value NaN", "few", "duplicate", "plane", "constant"],
)
def test_unusable_training_data_are_refused(fit, change, sentence):
    with pytest.raises(ValueError, match=sentence):
        fit(*change(POINTS.copy(), VALUES.copy()))


def test_unusable_settings_are_refused():
    with pytest.raises(ValueError, match="must be one of cubic"):
        fit_rbf(POINTS, VALUES, basis="quintic")
    with pytest.raises(ValueError, match="has no shape parameter"):
        fit_rbf(POINTS, VALUES, shape=1.0)
    with pytest.raises(ValueError, match="shape parameter must be positive"):
        fit_rbf(POINTS, VALUES, basis="gaussian", shape=-1.0)
    with pytest.raises(ValueError, match="3 positive numbers"):
        fit_rbf(POINTS, VALUES, length=[1.0, 0.0, 1.0])


def test_nearly_singular_systems_are_refused():
    with pytest.raises(ValueError, match="condition number of the gaussian"):
        fit_rbf(POINTS, VALUES, basis="gaussian", shape=1e-3)
    close = np.vstack([POINTS, POINTS[0] + 1e-15])
    with pytest.raises(ValueError, match="remove points that nearly coincide"):
        fit_rbf(close, responses(close))


def test_leave_one_out_needs_a_point_to_spare():
    surrogate = fit_rbf(POINTS[:4], VALUES[:4])
    with pytest.raises(ValueError, match="needs at least 5 points, got 4"):
        surrogate.leave_one_out()
    with pytest.raises(ValueError, match="needs at least 5 points, got 4"):
        fit_scaled_rbf(POINTS[:4], VALUES[:4])
    flat = np.vstack([POINTS[:8] * [1.0, 1.0, 0.0], POINTS[8]])
    with pytest.raises(ValueError, match="sample 8 alone off a plane"):
        fit_rbf(flat, VALUES[:9]).leave_one_out()


def test_prediction_wants_points_of_the_same_kind():
    for fit in SEARCHES.values():
        surrogate = fit(POINTS, VALUES)
        with pytest.raises(ValueError, match=r"= \(any, 3\)"):
            surrogate.predict(ELSEWHERE[:, :2])
        with pytest.raises(ValueError, match="first is point 0"):
            surrogate.gradient(np.full((1, 3), np.inf))


def test_one_factorisation_serves_all_responses(monkeypatch):
    from maglev.uncertainty import rbf

    calls = []
    original = rbf.lu_factor
    monkeypatch.setattr(rbf, "lu_factor", lambda matrix: calls.append(1) or original(matrix))
    assert isinstance(fit_rbf(POINTS, VALUES), RBF)
    assert len(calls) == 1
