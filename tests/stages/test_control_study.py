"""Circuits in the study: cases of their own, many lost samples, and the table of them."""

import numpy as np
import pytest
import synthetic
from numpy.testing import assert_allclose
from scipy.stats import norm
from synthetic import CONFIG

from maglev.config import from_mapping
from maglev.datasets import check, describe
from maglev.parameters import Config
from maglev.stages import control_study, limits, surrogate
from maglev.uncertainty.reliability import binomial_interval

CASES = ("group_ends", "group_half", "group_lumped", "lag_2ms")


def test_every_sharing_of_circuits_and_a_lag_have_a_case():
    config = Config()
    for name in CASES:
        own, common = config.of_case(name).control, config.control
        assert own.suspension == own.guidance != common.suspension
    assert config.of_case("group_half").control.suspension.group == "half"
    assert config.of_case("lag_2ms").control.guidance.lag == 2e-3


def test_the_first_check_of_a_case_knows_that_circuits_on_a_mean_gap_need_more():
    config = Config()
    plain, half = (
        config.of_case(name).statically_stable(name) for name in ("validation", "group_half")
    )
    assert plain > 0.99
    expected = norm.cdf((3500 - 3115) / 350) * norm.cdf((4500 - 3490) / 450)
    assert_allclose(half, expected, atol=1e-3)
    soft = {"gains": {"suspension_proportional": "3000 A/m"}}
    with pytest.raises(ValueError, match=r"group_half.* statically stable"):
        from_mapping(soft)
    assert from_mapping({**soft, "cases": {"group_half": None}})


def many_lost(n, seed):
    """Runs of which one in eight is lost, where either of two gains is too small."""
    standard = np.random.default_rng(seed).standard_normal((n, 4))
    made = synthetic.runs(standard, loses=True)
    away = is_lost(standard)
    for name in synthetic.PAPER_RESPONSES:
        made[name] = made[name].where(~away)
    made["status"] = ("sample", np.where(away, 1, 0))
    return describe(made)


def is_lost(standard):
    return (standard[:, 0] < -1.1) | (standard[:, 2] < -2.2)


P_LOST = 1 - norm.sf(-1.1) * norm.sf(-2.2)


def test_designs_of_which_one_in_seven_is_lost_give_losses_and_limits():
    design = synthetic.design(104)
    away = is_lost(design["standard"].to_numpy())
    assert away.sum() > 8
    for name in synthetic.PAPER_RESPONSES:
        design[name] = design[name].where(~away)
    design["status"] = ("sample", np.where(away, 1, 0))
    fitted = describe(surrogate.dataset(CONFIG, "asm", design))
    found = limits.of_surrogate(CONFIG, design, fitted)
    assert float(found["lost_probability_low"]) < P_LOST < float(found["lost_probability_high"])
    assert (found["limit_status"][:, 1:] == 2).all()  # losses are likelier than 0.1 and 0.01
    assert (found["held_limit_status"] == 0).all()
    standard = np.random.default_rng(1).standard_normal((100_000, 4))
    truth = np.quantile(synthetic.extremes(standard[~is_lost(standard)])[:, 0], 0.9)
    assert_allclose(float(found["held_limit"][0, 1]), truth, atol=0.15 * 6e-6)


@pytest.fixture(scope="module")
def found():
    config = from_mapping(
        {"study": {"failure_probability": [0.2, 0.1, 0.01]}, "cases": {"group_ends": None}}
    )
    runs = {"validation": synthetic.baseline(400), "group_half": many_lost(400, 4)}
    by = {(case, "mcm"): limits.of_baseline(CONFIG, one) for case, one in runs.items()}
    made = control_study.dataset(config, by, runs)
    return describe(made)


def test_the_study_sets_losses_and_deviations_of_the_cases_side_by_side(found):
    check(found, "control_study")
    assert control_study.named_curves(found) == [("validation", "mcm"), ("group_half", "mcm")]
    assert found["suspension_group"].to_numpy().tolist() == [0, 2]
    n_lost = round(400 * float(found["curve_lost_probability"][1]))
    low, high = binomial_interval(n_lost, 400, 0.95)
    assert low < P_LOST < high
    assert_allclose(found["curve_lost_probability_low"][1], low)
    assert (found["curve_deviation_low"] < found["curve_deviation"]).all()
    assert (found["curve_deviation"] < found["curve_deviation_high"]).all()
    assert_allclose(found["curve_deviation"][0, 0], np.hypot(6e-6, 2e-6), rtol=0.1)


def test_its_table_gives_every_number_its_interval(found):
    rows, text = control_study.table(found.assign_attrs(track="track of seed 7"))
    assert len(rows) == 2 * 6 * 3
    assert {row["suspension_group"] for row in rows} == {"pole", "half"}
    assert "| group_half | mcm | half | half | 400 |" in text
    assert "of one track, the track of seed 7" in text
