"""The three spaces a point lives in, and what the inputs refuse."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.testing import assert_allclose
from scipy import stats

from maglev.uncertainty.distributions import Marginals

MARGINALS = Marginals(
    [stats.norm(6140.0, 614.0), stats.lognorm(0.3, scale=2.0), stats.uniform(1, 4)]
)
INSIDE = st.floats(1e-9, 1.0 - 1e-9)


@settings(deadline=None)
@given(hnp.arrays(float, (5, 3), elements=INSIDE))
def test_each_space_leads_back_to_where_it_came_from(c):
    x = MARGINALS.from_unit_cube(c)
    assert_allclose(MARGINALS.to_unit_cube(x), c, rtol=1e-6, atol=1e-12)
    assert_allclose(MARGINALS.from_standard(MARGINALS.to_standard(x)), x, rtol=1e-12)


def test_standard_form_of_a_normal_input_is_the_standard_normal():
    marginals = Marginals([stats.norm(6140.0, 614.0)])
    c = np.array([[0.001], [0.5], [0.8413447460685429]])
    u = marginals.to_standard(marginals.from_unit_cube(c))
    assert_allclose(u[:, 0], [-3.090232306167813, 0.0, 1.0], atol=1e-12)


def test_correlated_inputs_are_refused_and_the_identity_is_not():
    two = [stats.norm(), stats.norm()]
    assert Marginals(two, correlation=np.eye(2)).n == 2
    with pytest.raises(ValueError, match="inputs must be independent"):
        Marginals(two, correlation=[[1.0, 0.3], [0.3, 1.0]])
    with pytest.raises(ValueError, match=r"expected \(input, input\) = \(2, 2\)"):
        Marginals(two, correlation=np.eye(3))


@pytest.mark.parametrize(
    ("distributions", "sentence"),
    [
        ([], "at least one distribution"),
        ([stats.norm], "frozen continuous univariate"),
        ([stats.poisson(3.0)], "frozen continuous univariate"),
        ([stats.multivariate_normal([0.0, 0.0])], "frozen continuous univariate"),
        ([stats.cauchy()], "finite mean"),
        ([stats.norm(0.0, np.nan)], "finite mean"),
    ],
)
def test_unfit_distributions_are_refused(distributions, sentence):
    with pytest.raises(ValueError, match=sentence):
        Marginals(distributions)


def test_unfit_points_are_refused():
    with pytest.raises(ValueError, match=r"expected \(\.\.\., input = 3\)"):
        MARGINALS.to_standard(np.zeros((4, 2)))
    with pytest.raises(ValueError, match="must be finite, got 1 values of 3"):
        MARGINALS.to_standard([1.0, np.nan, 2.0])
    with pytest.raises(ValueError, match=r"must lie in \[0, 1\]"):
        MARGINALS.from_unit_cube([0.5, 1.5, 0.5])
    with pytest.raises(ValueError, match=r"inside \(0, 1\)"):
        MARGINALS.from_unit_cube([0.0, 0.5, 0.5])
