"""The band of the girder's accelerations."""

import pytest
import scipy.signal
from numpy.testing import assert_allclose

from maglev.mechanics.responses import acceleration_filter
from maglev.parameters import Config


@pytest.mark.parametrize("order", [2, 4, 8])
@pytest.mark.parametrize("step", [0.12e-3, 0.36e-3, 2e-3])
def test_the_low_pass_is_that_of_scipy(order, step):
    passage = Config.model_validate({"passage": {"acceleration_filter_order": order}}).passage
    exact = scipy.signal.butter(order, passage.acceleration_band, fs=1 / step, output="sos")
    found = acceleration_filter(passage, step)
    _, expected = scipy.signal.sosfreqz(exact, 400)
    assert_allclose(scipy.signal.sosfreqz(found, 400)[1], expected, atol=1e-12)
    assert_allclose(found[:, 3], 1.0)
