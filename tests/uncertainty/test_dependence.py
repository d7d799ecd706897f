"""Dependent quantities: their linear correlation and laws, by OpenTURNS and in closed form."""

import numpy as np
import openturns as ot
import pytest
from numpy.testing import assert_allclose
from scipy.stats import lognorm, norm, uniform

from maglev.errors import UserError
from maglev.uncertainty.dependence import nataf

LAWS = [norm(10.0, 2.0), lognorm(0.5), uniform(3.0, 4.0)]
TARGET = np.array([[1.0, 0.5, -0.3], [0.5, 1.0, 0.2], [-0.3, 0.2, 1.0]])
NAMES = ["a", "b", "c"]


def variates(transformation):
    """Correlation of the normal variates of a transformation."""
    return transformation.root @ transformation.root.T


def test_normal_quantities_need_no_adjusting():
    found = nataf([norm(1.0, 2.0), norm(3.0, 0.1)], [[1.0, 0.7], [0.7, 1.0]], NAMES)
    assert_allclose(variates(found), [[1.0, 0.7], [0.7, 1.0]], atol=1e-12)


def test_lognormal_and_uniform_quantities_have_the_correlations_of_their_closed_forms():
    pair = [[1.0, 0.4], [0.4, 1.0]]
    both = variates(nataf([lognorm(0.5), lognorm(0.8)], pair, NAMES))[0, 1]
    scale = np.sqrt(np.expm1(0.25) * np.expm1(0.64))
    assert_allclose(np.expm1(both * 0.4) / scale, 0.4, rtol=1e-6)
    flat = variates(nataf([uniform(), uniform(2.0, 5.0)], pair, NAMES))[0, 1]
    assert_allclose(6.0 / np.pi * np.arcsin(flat / 2.0), 0.4, rtol=1e-6)


def test_a_normal_and_a_lognormal_quantity_have_the_correlation_of_their_closed_form():
    found = variates(nataf(LAWS[:2], TARGET[:2, :2], NAMES))[0, 1]
    assert_allclose(found * 0.5 / np.sqrt(np.expm1(0.25)), 0.5, rtol=1e-9)


def test_another_library_finds_the_linear_correlation_that_was_asked_for():
    normal = variates(nataf(LAWS, TARGET, NAMES))
    joint = ot.JointDistribution(
        [ot.Normal(10.0, 2.0), ot.LogNormal(0.0, 0.5), ot.Uniform(3.0, 7.0)],
        ot.NormalCopula(ot.CorrelationMatrix(3, normal.ravel().tolist())),
    )
    ot.RandomGenerator.SetSeed(1)
    drawn = np.array(joint.getSample(400_000))
    assert_allclose(np.corrcoef(drawn.T), TARGET, atol=4e-3)  # three deviations of the sampling


def test_drawn_quantities_have_their_laws_and_correlations():
    u = norm.ppf(ot_sobol(2**16, 3))
    drawn = nataf(LAWS, TARGET, NAMES).physical(u)
    assert_allclose(np.corrcoef(drawn.T), TARGET, atol=3e-3)
    for law, column in zip(LAWS, drawn.T, strict=True):
        shares = np.array([0.01, 0.5, 0.99])
        assert_allclose(np.quantile(column, shares), law.ppf(shares), rtol=5e-3)


def ot_sobol(n, dimension):
    """Sobol' points inside the unit cube."""
    sequence = ot.LowDiscrepancyExperiment(
        ot.SobolSequence(dimension), ot.JointDistribution([ot.Uniform(0.0, 1.0)] * dimension), n
    )
    return np.clip(np.array(sequence.generate()), 1e-9, 1 - 1e-9)


def test_a_correlation_out_of_reach_is_refused_by_name():
    pair = [[1.0, -0.9], [-0.9, 1.0]]
    with pytest.raises(UserError, match=r"correlation of a and b: .* between -0\.368 and 1"):
        nataf([lognorm(1.0), lognorm(1.0)], pair, NAMES)
    contradictory = np.array([[1.0, 0.9, 0.0], [0.9, 1.0, 0.9], [0.0, 0.9, 1.0]])
    with pytest.raises(UserError, match=r"contradict each other.*a, b: 0\.9, b, c: 0\.9"):
        nataf([norm()] * 3, contradictory, NAMES)
