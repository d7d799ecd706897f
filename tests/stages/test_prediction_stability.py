"""Predictions of the baseline run by run, the map of stable gains, and the band of a density."""

import numpy as np
import pytest
import synthetic
from numpy.testing import assert_allclose

from maglev.datasets import check, describe
from maglev.parameters import Config
from maglev.stages import prediction, stability, surrogate

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
