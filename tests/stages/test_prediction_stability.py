"""Predictions of the baseline run by run, the map of stable gains, and the band of a density."""

import numpy as np
import pytest
import synthetic
from numpy.testing import assert_allclose

from maglev.datasets import check, describe
from maglev.parameters import Config
from maglev.stages import density, prediction, stability, surrogate
from maglev.uncertainty.gdee import direct_density

CONFIG = synthetic.CONFIG


def test_predictions_of_known_formulas_meet_them_where_levitation_holds():
    design = synthetic.design(90, loses=True)
    baseline = synthetic.baseline(400, loses=True)
    fitted = surrogate.dataset(CONFIG, "asm", design)
    found = describe(prediction.dataset(CONFIG, baseline, {"asm": design}, {"asm": fitted}))
    check(found, "prediction")
    held = baseline["status"].to_numpy() == 0
    assert np.isnan(found["computed"].to_numpy()[~held]).all()
    error = (found["predicted_by"][0] - found["computed"]).to_numpy()[held] / found["sigma"].values
    assert_allclose(found["prediction_rmse"][0], np.sqrt((error**2).mean(axis=0)))
    assert found["prediction_rmse"][0, 0] < 0.02  # a plane
    agree = (found["lost_by"][0].to_numpy() == 0) == held
    assert agree.mean() > 0.97
    assert found["method_n_runs"][0] == 90


def test_a_design_without_its_surrogate_is_refused():
    with pytest.raises(ValueError, match="every method needs a design and a surrogate"):
        prediction.dataset(CONFIG, synthetic.baseline(50), {"asm": synthetic.design(40)}, {})


def test_the_map_grows_below_the_static_limit_and_dies_out_above(monkeypatch):
    monkeypatch.setattr(stability, "N_PROPORTIONAL", 5)
    monkeypatch.setattr(stability, "N_DERIVATIVE", 2)
    config = Config()
    found = describe(stability.dataset(config))
    check(found, "stability")
    magnet = config.train.suspension_magnet
    assert found["static_limit"] == magnet.current_reference / magnet.gap_reference
    k_p, growth = found["grid_proportional"].to_numpy(), found["growth_rate"].to_numpy()
    assert (growth[:, k_p < 0.95 * float(found["static_limit"])] > 1.0).all()
    assert (growth[:, k_p > 1.2 * float(found["static_limit"])] < 0.0).all()


def test_the_band_of_a_density_is_that_of_repeated_samples():
    rng, n, lost = np.random.default_rng(2), 400, 0.1
    at, h = np.linspace(-2.5, 2.5, 9), 0.3
    made = []
    for _ in range(600):
        values = rng.standard_normal(rng.binomial(n, 1 - lost))
        share = 1 - values.size / n
        made.append(direct_density(at, values, bandwidth=h, lost_probability=share))
    sample = rng.standard_normal(40_000)  # what the band is estimated from, here without its noise
    column = {
        "value": at,
        "density_direct": np.mean(made, axis=0),
        "bandwidth": h,
    }
    low, high = density.density_band(column, sample, lost, n, 0.95)
    deviation = (high - column["density_direct"]) / 1.959964
    assert (low >= 0).all()
    assert_allclose(deviation, np.std(made, axis=0), rtol=0.12)
    assert np.mean(deviation / np.std(made, axis=0)) == pytest.approx(1.0, abs=0.05)
