"""The function that users of the model call: what it returns, for any train and guideway."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import maglev
from maglev import datasets
from maglev.config import from_mapping


def small(n_cars=1, n_spans=1, **passage):
    return from_mapping(
        {
            "train": {"n_cars": n_cars},
            "guideway": {"n_spans": n_spans},
            "irregularity": {"fade_in": "20 m"},
            "passage": {"approach": "20 m", "mode_cutoff": "300 Hz", **passage},
        }
    )


def mean_gains(config):
    return np.array([config.gains.as_row])


def test_a_passage_is_what_its_layout_says():
    config = small()
    found = maglev.simulate(config, mean_gains(config), histories=True)
    datasets.check(found, "passage")
    assert found.sizes["sample"] == 1
    assert found["status"].item() == 0


def test_histories_reach_the_extremes():
    config = small()
    found = maglev.simulate(config, mean_gains(config), histories=True)
    for name in datasets.RESPONSES[:2]:
        history = np.abs(found[f"{name}_history"].values).max()
        assert history <= found[name].item() * (1 + 1e-12)
        assert_allclose(history, found[name].item(), rtol=0.01)  # recorded every millisecond
    largest = found["car_body_acceleration_z_per_car"].max("car")
    assert_array_equal(largest, found["car_body_acceleration_z"])


def test_the_band_takes_away_pole_passing():
    banded, raw = small(), small(acceleration_band=None)
    gains = mean_gains(banded)
    in_band = maglev.simulate(banded, gains)["girder_acceleration_z"].item()
    unfiltered = maglev.simulate(raw, gains)["girder_acceleration_z"].item()
    assert unfiltered > 1.1 * in_band


@pytest.mark.parametrize(("n_cars", "n_spans"), [(1, 3), (2, 1), (6, 2)])
def test_any_number_of_cars_passes_any_number_of_spans(n_cars, n_spans):
    config = small(n_cars, n_spans)
    found = maglev.simulate(config, mean_gains(config))
    assert found["status"].item() == 0
    assert 1e-4 < found["girder_displacement_z"].item() < 3e-3  # m: some 1.5 mm under a car
    assert found.sizes["car"] == n_cars


def test_an_unknown_solver_is_refused():
    config = small()
    with pytest.raises(
        ValueError, match=r"^solver must be 'production' or 'reference', got 'fast'$"
    ):
        maglev.simulate(config, mean_gains(config), solver="fast")


def test_a_profile_file_that_is_too_short_is_refused_before_any_computing(tmp_path):
    path = tmp_path / "track.csv"
    path.write_text("x,vertical,lateral\n-60,0,0\n0,0.001,0\n10,0,0\n", encoding="utf-8")
    config = from_mapping({"irregularity": {"profile_file": str(path)}})
    with pytest.raises(ValueError, match="profile"):
        maglev.simulate(config, mean_gains(config))
