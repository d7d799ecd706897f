"""The stages beside the passage: irregularity, modes, deflection, each on a small case."""

import numpy as np
import pytest
import xarray as xr
from numpy.testing import assert_allclose

from maglev.config import from_mapping
from maglev.stages import deflection, guideway_modes, irregularity

SMALL = from_mapping(
    {
        "train": {"n_cars": 1},
        "guideway": {"n_spans": 2},
        "irregularity": {"n_harmonics": 200, "wavelength_max": "20 m"},
    }
)


pytestmark = pytest.mark.usefixtures("in_config_folder")


def test_the_spectrum_of_the_sample_lies_on_the_target():
    result = irregularity.dataset(SMALL)
    for direction in ("vertical", "lateral"):
        inside = slice(5, -5)
        ratio = result[f"spectrum_{direction}"] / result[f"target_{direction}"]
        assert_allclose(ratio[inside].mean(), 1, rtol=0.1)


def test_a_smooth_track_has_no_irregularity():
    smooth = SMALL.model_copy(
        update={"irregularity": SMALL.irregularity.model_copy(update={"enabled": False})}
    )
    result = irregularity.dataset(smooth)
    assert float(abs(result["irregularity_vertical"]).max()) == 0


def test_the_first_vertical_mode_is_a_little_below_that_of_a_simply_supported_beam():
    result = guideway_modes.dataset(SMALL)
    vertical = result["frequency"].where(result["direction"] == 2, drop=True)
    assert 8.3 < float(vertical[0]) < float(result["frequency_simply_supported"]) < 9.0
    assert float(abs(result["girder_shape_z"]).max()) <= 1 + 1e-12


def test_the_moving_load_enters_the_middle_span_with_the_nose():
    speed = SMALL.passage.speed
    entry = (SMALL.passage.approach + SMALL.guideway.span_length) / speed
    time = np.linspace(0, 2 * entry, 400)
    history = (("sample", "t"), np.zeros((1, time.size)))
    passage = xr.Dataset({"girder_displacement_z_history": history}, coords={"t": time})
    result = deflection.dataset(SMALL, passage)
    moving = result["deflection_moving_load"].to_numpy()
    assert np.all(moving[time <= entry] == 0)
    assert np.all(moving[(time > entry + 0.02) & (time < entry + 0.2)] > 0)


def test_a_passage_without_histories_has_no_deflection_to_show():
    with pytest.raises(ValueError, match="the passage has no histories"):
        deflection.dataset(SMALL, xr.Dataset())
