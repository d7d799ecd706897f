"""The table of responses, and the band of the girder's accelerations."""

from typing import get_args

import numpy as np
import pytest
import scipy.signal
from numpy.testing import assert_allclose

from maglev.datasets import VARIABLES
from maglev.mechanics.responses import _FOUND, acceleration_filter
from maglev.parameters import Config
from maglev.vocabulary import PAPER_RESPONSES, RESPONSE_TABLE, RESPONSES, Response


def test_every_response_of_the_table_is_found_and_described():
    assert tuple(_FOUND) == tuple(RESPONSE_TABLE) == RESPONSES == get_args(Response)
    assert RESPONSES[:6] == PAPER_RESPONSES
    for name, entry in RESPONSE_TABLE.items():
        assert VARIABLES[name].units == entry.unit
        assert (f"{name}_t" in VARIABLES) == entry.timed
        assert (f"{name}_per_car" in VARIABLES) == (entry.kind == "car")


def low_passes(order, step, frequency):
    """Response of the sections found, and of the analogue Butterworth filter of SciPy."""
    passage = Config.model_validate({"passage": {"acceleration_filter_order": order}}).passage
    sections = acceleration_filter(passage, step)
    assert_allclose(sections[:, 3], 1.0)
    edge = 2 * np.pi * passage.acceleration_band
    analogue = scipy.signal.butter(order, edge, analog=True, output="ba")
    _, expected = scipy.signal.freqs(*analogue, 2 * np.pi * frequency)
    _, found = scipy.signal.sosfreqz(sections, 2 * np.pi * frequency * step)
    return found, expected


@pytest.mark.parametrize("order", [2, 4, 8])
@pytest.mark.parametrize("step", [0.12e-3, 0.36e-3, 0.54e-3])
def test_gain_and_phase_are_those_of_the_analogue_filter_in_the_band(order, step):
    found, expected = low_passes(order, step, np.linspace(0.0, 100.0, 201))
    assert np.abs(found / expected - 1).max() < 1e-3 * (step / 0.54e-3) ** 4


@pytest.mark.parametrize("order", [2, 4, 8])
def test_the_error_in_the_band_falls_with_the_fourth_power_of_the_step(order):
    steps = np.array([0.15e-3, 0.3e-3, 0.6e-3])
    errors = []
    for step in steps:
        found, expected = low_passes(order, step, np.linspace(1.0, 100.0, 100))
        errors.append(np.abs(found / expected - 1).max())
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert 3.8 < slope < 4.2, slope


@pytest.mark.parametrize("step", [0.12e-3, 0.54e-3])
def test_pole_passing_is_as_far_down_as_in_the_analogue_filter(step):
    found, expected = low_passes(8, step, np.linspace(400.0, 0.45 / step, 50))
    assert np.abs(found).max() < 2e-5
    assert np.abs(found[0]) < 1.2 * np.abs(expected[0])
