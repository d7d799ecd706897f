"""Predictions of the baseline run by run, the map of stable gains, and the band of a density."""

import numpy as np
import pytest
import synthetic
from numpy.testing import assert_allclose

from maglev.datasets import check, describe
from maglev.parameters import Config
from maglev.stages import prediction, stability, surrogate, train_modes
from maglev.vocabulary import TRAIN_PARTS

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


def test_the_map_grows_below_its_borders_and_dies_out_above(monkeypatch):
    monkeypatch.setattr(stability, "N_PROPORTIONAL", 5)
    monkeypatch.setattr(stability, "N_DERIVATIVE", 3)
    config = Config()
    found = describe(stability.dataset(config))
    check(found, "stability")
    magnet = config.train.suspension_magnet
    assert found["static_limit"] == magnet.current_reference / magnet.gap_reference
    # A root of the growth rate, not a line between two points of the map.
    assert_allclose(found["proportional_border_low"], 2500.0, atol=1e-3)
    assert_allclose(found["proportional_border"][0], 2500.0, atol=1e-3)
    assert np.isnan(found["derivative_border"][0]).all()
    assert found["mean_growth_rate"] < 0
    k_p, growth = found["grid_proportional"].to_numpy(), found["growth_rate"].to_numpy()
    assert (growth[:, k_p < 2500.0] > 0.0).all()
    assert (growth[:, k_p > 2500.0] < 0.0).all()
    late = found.sel(current_lag=2e-3)
    assert np.isnan(late["proportional_border"][0])  # no derivative gain
    assert_allclose(late["proportional_border"][1:], 2500.0, atol=1e-3)
    assert_allclose(late["derivative_border"].sel(grid_proportional=3500.0), 4.83, atol=0.01)


def test_the_map_follows_the_configured_control(monkeypatch):
    monkeypatch.setattr(stability, "N_PROPORTIONAL", 2)
    monkeypatch.setattr(stability, "N_DERIVATIVE", 2)
    half = Config(control={"suspension": {"group": "half", "lag": "2 ms"}})
    found = stability.dataset(half)
    assert_allclose(found["proportional_border_low"], 3115.2, atol=0.1)
    assert_allclose(found["derivative_border_low"], 4.74, atol=0.01)
    late = Config(control={"suspension": {"delay": "2 ms"}})
    assert_allclose(stability.dataset(late)["derivative_border_high"], 69.9, atol=0.1)


def test_lateral_and_yaw_modes_of_the_car_body_are_damped_as_a_secondary_suspension_is():
    found = describe(train_modes.dataset(Config()))
    check(found, "train_modes")
    assert_allclose(found["kinetic_share"].sum("train_part"), 1.0)
    assert (found["damping_ratio"] > 0).all()
    assert found.sizes["mode"] == 101
    body = found.isel(mode=slice(0, 5))  # below all others
    moves = [TRAIN_PARTS[code] for code in body["moves"].to_numpy()]
    assert sorted(moves) == sorted(TRAIN_PARTS[:5])
    assert (body["kinetic_share"].max("train_part") > 0.9).all()
    by_name = {
        name: (float(f), float(d))
        for name, f, d in zip(moves, body["train_frequency"], body["damping_ratio"], strict=True)
    }
    for name, frequency, ratio in (
        ("car_body_lateral", 0.523, 0.120),
        ("car_body_yaw", 0.608, 0.142),
        ("car_body_vertical", 1.388, 0.106),
    ):
        assert_allclose(by_name[name], (frequency, ratio), rtol=5e-3)
    for name in ("car_body_lateral", "car_body_yaw"):
        assert 0.10 < by_name[name][1] < 0.25
