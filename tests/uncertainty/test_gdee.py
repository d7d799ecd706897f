"""PDEM on functions whose density is known, and the kernel that finite differences add."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats

from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.gdee import (
    direct_density,
    direct_density_band,
    evolved_density,
    first_passage,
    silverman_bandwidth,
)
from maglev.uncertainty.pointset import gf_points

DIRECTION = np.array([0.7, 0.5, 0.4, np.sqrt(0.1)])  # of length one


@pytest.fixture(scope="module")
def linear():
    """A linear function of four normals, itself normal with mean 1.5e-3 and deviation 2e-6."""
    found = gf_points(Marginals([stats.norm()] * 4), 400, np.random.default_rng(11), counting=2**17)
    return 1.5e-3 + 2e-6 * found.points @ DIRECTION, found.probability


def absolute_difference(evolved, distribution):
    exact = distribution.pdf(evolved.cell_centre)
    return np.abs(evolved.density - exact).sum() * evolved.mesh


def test_linear_function_of_normals_has_the_normal_density(linear):
    normal = stats.norm(1.5e-3, 2e-6)
    evolved = evolved_density(*linear, process="linear")
    assert absolute_difference(evolved, normal) < 0.09
    assert_allclose(evolved.density.max(), normal.pdf(1.5e-3), rtol=0.1)


def test_exponential_of_a_linear_function_has_the_lognormal_density(linear):
    values, probability = linear
    exponential = np.exp((values - 1.5e-3) / 2e-6 * 0.4)
    evolved = evolved_density(exponential, probability, process="linear")
    assert absolute_difference(evolved, stats.lognorm(0.4)) < 0.11


def test_both_processes_and_the_direct_kernel_agree_at_the_rule_mesh():
    values = stats.gumbel_r.ppf((np.arange(40) + 0.5) / 40)
    sine = evolved_density(values, process="sine")
    straight = evolved_density(values, process="linear")
    direct = direct_density(sine.cell_centre, values)
    other = np.interp(sine.cell_centre, straight.cell_centre, straight.density)
    assert np.abs(sine.density - direct).sum() * sine.mesh < 0.05
    assert np.abs(sine.density - other).sum() * sine.mesh < 0.05


@pytest.mark.parametrize("process", ["sine", "linear"])
@pytest.mark.parametrize("limiter", ["superbee", "minmod", "upwind"])
def test_mass_is_kept_to_rounding(linear, process, limiter):
    values, probability = linear[0][:60], linear[1][:60] / linear[1][:60].sum()
    evolved = evolved_density(values, probability, process=process, limiter=limiter, mesh=0.3)
    assert_allclose(evolved.density.sum() * evolved.mesh, 1.0, rtol=0, atol=1e-12)
    assert evolved.density.min() >= 0.0
    assert evolved.largest_courant <= 0.9


def test_mesh_rule_makes_the_kernel_as_wide_as_silverman_asks(linear):
    values = linear[0][:40]
    for process, limiter in (("linear", "superbee"), ("linear", "minmod"), ("sine", "superbee")):
        evolved = evolved_density(values, process=process, limiter=limiter)
        assert_allclose(evolved.bandwidth, silverman_bandwidth(values))
        assert_allclose(evolved.kernel_deviation, evolved.bandwidth, rtol=0.08)


@pytest.mark.parametrize("process", ["sine", "linear"])
def test_finite_differences_add_their_kernel_to_the_points_and_nothing_else(linear, process):
    # The mean stays; the variance of the density is that of the points plus that of the kernel.
    values, probability = linear[0][:60], linear[1][:60] / linear[1][:60].sum()
    evolved = evolved_density(values, probability, process=process, limiter="upwind", mesh=0.2)
    weight = evolved.density * evolved.mesh
    mean = probability @ values
    assert_allclose(weight @ evolved.cell_centre, mean, rtol=0, atol=1e-9 * 2e-6)
    variance = weight @ (evolved.cell_centre - mean) ** 2
    points = probability @ (values - mean) ** 2
    assert_allclose(variance, points + evolved.kernel_deviation**2, rtol=1e-9)


def test_start_among_the_values_leaves_a_spike_that_a_start_below_them_does_not(linear):
    peak = stats.norm(1.5e-3, 2e-6).pdf(1.5e-3)
    from_mean = evolved_density(*linear, process="linear", start=0.0)
    from_below = evolved_density(*linear, process="linear")
    assert from_below.density.max() < 1.1 * peak
    assert from_mean.density.max() > 1.3 * peak


def test_density_follows_the_values_through_a_change_of_unit(linear):
    values, probability = linear
    metres = evolved_density(values, probability, process="linear")
    microns = evolved_density(values * 1e6, probability, process="linear")
    assert_allclose(microns.cell_centre, metres.cell_centre * 1e6, rtol=1e-9)
    assert_allclose(microns.density, metres.density * 1e-6, rtol=1e-6, atol=1e-9)


def test_density_is_that_of_the_held_part():
    values = np.random.default_rng(0).normal(size=80)
    evolved = evolved_density(values, process="linear", lost_probability=0.07)
    at = np.linspace(-8.0, 8.0, 801)
    assert_allclose(evolved.density.sum() * evolved.mesh, 0.93, rtol=1e-12)
    assert_allclose(direct_density(at, values, lost_probability=0.07).sum() * 0.02, 0.93, rtol=1e-4)


def test_direct_density_of_two_points_is_two_normal_densities():
    at = np.linspace(-1.0, 4.0, 11)
    exact = 0.2 * stats.norm.pdf(at, 0.0, 0.5) + 0.8 * stats.norm.pdf(at, 3.0, 0.5)
    assert_allclose(direct_density(at, [0.0, 3.0], [0.2, 0.8], bandwidth=0.5), exact, rtol=1e-12)


def test_silverman_bandwidth_of_a_normal_sample():
    values = stats.norm.ppf((np.arange(4000) + 0.5) / 4000)
    assert_allclose(silverman_bandwidth(values), 0.9 * 4000**-0.2, rtol=0.01)
    # a tenth of the points carrying nothing does not count towards the size
    padded = np.concatenate((values, np.zeros(400)))
    weights = np.concatenate((np.full(4000, 1 / 4000), np.zeros(400)))
    assert_allclose(silverman_bandwidth(padded, weights), silverman_bandwidth(values), rtol=1e-3)


def test_first_passage_of_straight_histories_is_the_normal_distribution_function():
    # Z = V t with V ~ N(1, 0.3^2) reaches 1 before t when V > 1 / t.
    speed = 1.0 + 0.3 * stats.norm.ppf((np.arange(200) + 0.5) / 200)
    time = np.linspace(0.0, 1.5, 31)
    histories = speed[:, None] * time
    passage = first_passage(histories, mesh=0.02, upper=1.0)
    exact = np.append(1.0, stats.norm.cdf(1.0 / time[1:], 1.0, 0.3))
    assert_allclose(passage.exact_survival, exact, atol=0.006)
    assert_allclose(passage.survival, exact, atol=0.04)
    assert np.all(np.diff(passage.survival) <= 1e-12)
    assert_allclose(passage.density.sum() * passage.mesh, passage.survival[-1], rtol=1e-9)
    assert np.all(passage.density[passage.cell_centre > 1.0] == 0.0)


def test_first_passage_error_shrinks_with_the_mesh():
    amplitude = 1.0 + 0.3 * stats.norm.ppf((np.arange(100) + 0.5) / 100)
    histories = amplitude[:, None] * np.sin(2 * np.pi * np.linspace(0.0, 1.0, 41))
    found = [first_passage(histories, mesh=mesh, lower=-1.2, upper=1.0) for mesh in (0.1, 0.025)]
    errors = [np.abs(f.survival - f.exact_survival).max() for f in found]
    assert errors[1] < 0.4 * errors[0]
    # half pass +1 in the first quarter; -1.2 takes none of the rest, which stay below 1 in size
    assert_allclose(found[1].exact_survival[[10, -1]], 0.5)


def test_barriers_lie_on_faces_of_the_mesh():
    passage = first_passage(np.array([[0.0, 0.2], [0.0, 0.3]]), mesh=0.3, lower=-0.5, upper=0.6)
    faces = passage.cell_centre + 0.5 * passage.mesh
    assert passage.mesh <= 0.3
    for barrier in (-0.5, 0.6):
        assert np.abs(faces - barrier).min() < 1e-12


@pytest.mark.parametrize("evaluate", [evolved_density, silverman_bandwidth])
def test_faulty_samples_are_refused(evaluate):
    with pytest.raises(ValueError, match="constant response has no density"):
        evaluate(np.full(5, 1.5e-3))
    with pytest.raises(ValueError, match="got 1 of 3 that are not"):
        evaluate([1.0, np.nan, 2.0])
    with pytest.raises(ValueError, match="probabilities must sum to 1"):
        evaluate([1.0, 2.0], [0.5, 0.4])


def test_faulty_options_are_refused():
    values = [1.0, 2.0, 4.0]
    for options, sentence in (
        ({"process": "cosine"}, "process must be"),
        ({"limiter": "van_leer"}, "limiter must be one of"),
        ({"mesh": 0.0}, "mesh must be positive"),
        ({"start": np.inf}, "start must be finite"),
        ({"lost_probability": 1.0}, "lost probability must lie"),
    ):
        with pytest.raises(ValueError, match=sentence):
            evolved_density(values, **options)
    with pytest.raises(ValueError, match="bandwidth must be positive"):
        direct_density([1.0], values, bandwidth=-1.0)
    with pytest.raises(ValueError, match="values must be finite and have shape"):
        direct_density([np.nan], values)


def test_values_far_out_are_refused_rather_than_evolved_for_hours():
    values = np.append(np.random.default_rng(1).normal(size=200), 1e6)
    with pytest.raises(ValueError, match="take logarithms of the values, or use direct_density"):
        evolved_density(values)


def test_faulty_histories_are_refused():
    histories = np.array([[0.0, 0.2], [0.0, 0.3]])
    for faulty, options, sentence in (
        (histories, {}, "needs a barrier"),
        (histories, {"upper": 0.0}, "got 2 of 2 that do not"),
        (histories[0], {"upper": 1.0}, "two times or more"),
        (histories * np.nan, {"upper": 1.0}, "must be finite"),
    ):
        with pytest.raises(ValueError, match=sentence):
            first_passage(faulty, mesh=0.1, **options)
    with pytest.raises(ValueError, match="mesh must be positive"):
        first_passage(histories, mesh=-0.1, upper=1.0)


def test_the_band_of_a_density_is_that_of_repeated_samples():
    rng, n, lost = np.random.default_rng(2), 400, 0.1
    at, h = np.linspace(-2.5, 2.5, 9), 0.3
    made = []
    for _ in range(600):
        values = rng.standard_normal(rng.binomial(n, 1 - lost))
        share = 1 - values.size / n
        made.append(direct_density(at, values, bandwidth=h, lost_probability=share))
    sample = rng.standard_normal(40_000)  # what the band is estimated from, here without its noise
    density = np.mean(made, axis=0)
    low, high = direct_density_band(
        at, sample, n, density=density, bandwidth=h, lost_probability=lost
    )
    deviation = (high - density) / 1.959964
    assert (low >= 0).all()
    assert_allclose(deviation, np.std(made, axis=0), rtol=0.12)
    assert np.mean(deviation / np.std(made, axis=0)) == pytest.approx(1.0, abs=0.05)
