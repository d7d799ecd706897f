"""Limit states on a train that is a formula: exact probabilities, joined and with losses."""

import numpy as np
import pytest
import synthetic
from formula_train import MAPPING, made
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import multivariate_normal, norm
from synthetic import BORDER, CONFIG, P_LOST

from maglev.config import from_mapping
from maglev.datasets import check, describe
from maglev.parameters import Config, LimitState
from maglev.stages import density, eev, limit_state_table, limit_states, limits, surrogate
from maglev.uncertainty.reliability import binomial_interval
from maglev.vocabulary import PAPER_RESPONSES

DEFLECTION, SWAY = PAPER_RESPONSES[0], PAPER_RESPONSES[3]
SIGMA = np.hypot(6e-6, 2e-6)
"""Deviation of the first response; the fourth has 0.03 √2 and shares the first gain with it."""

HIGH = {"deflection": 1.5e-3 + 1.0 * SIGMA, "sway": 0.3 + 1.5 * 0.03 * 2**0.5}


def with_states(**more):
    """The configuration with limit states of two responses, and those given."""
    states = {
        "deflection": {"response": DEFLECTION, "limit": f"{1e3 * HIGH['deflection']:.17g} mm"},
        "sway": {"response": SWAY, "limit": f"{HIGH['sway']:.17g} m/s^2", "target": 0.2},
        "either": {"any_of": ["deflection", "sway", "lost"]},
        "both": {"all_of": ["deflection", "sway"], "target": 1e-4},
        **more,
    }
    whole = CONFIG.quantities()
    return Config.model_validate({**whole, "cases": {}, "limit_states": states})


STATES = with_states()
RHO = 6e-6 * 0.03 / (SIGMA * 0.03 * 2**0.5)
SLOPES = np.array([-1.0, 6e-6 / SIGMA, 0.5**0.5])  # of x0 in -x0, deflection, sway


def below(*limits):
    """Exact probability that minus the first gain, deflection and sway lie below limits [-]."""
    covariance = np.outer(SLOPES, SLOPES)
    covariance[1, 2] = covariance[2, 1] = RHO
    np.fill_diagonal(covariance, 1.0)
    return multivariate_normal(np.zeros(3), covariance).cdf(np.array(limits))


def exact(loses):
    """Exact probabilities of the limit states, levitation lost or not."""
    border, far = (-BORDER if loses else 8.0), 8.0
    held = below(border, far, far)
    none = {
        "lost": held,
        "deflection": below(border, 1.0, far),
        "sway": below(border, far, 1.5),
        "either": below(border, 1.0, 1.5),
    }
    none["both"] = none["deflection"] + none["sway"] - none["either"]
    return {name: 1.0 - one for name, one in none.items()}


def by_surrogate(config, **options):
    """Limit states of a design by its surrogate."""
    design = synthetic.design(**options)
    fitted = surrogate.dataset(config, "asm", design)
    return describe(limit_states.of_surrogate(config, design, fitted))


@pytest.mark.parametrize("loses", [False, True])
def test_a_baseline_counts_single_and_joined_limit_states(loses):
    runs = synthetic.baseline(6000, loses=loses)
    found = describe(limit_states.of_baseline(STATES, runs))
    check(found, "limit_states")
    u = runs["standard"].to_numpy()
    values = synthetic.extremes(u)
    away = (u[:, 0] < BORDER) & loses
    over = values[:, 0] > HIGH["deflection"], values[:, 3] > HIGH["sway"]
    for name, one in (
        ("lost", away), ("deflection", over[0] | away), ("sway", over[1] | away),
        ("either", over[0] | over[1] | away), ("both", (over[0] & over[1]) | away),
    ):  # fmt: skip
        at = found.sel(limit_state=name)
        assert_allclose(at["probability"], one.mean(), rtol=1e-12)
        low, high = binomial_interval(one.sum(), 6000, 0.95)
        assert_allclose([at["probability_low"], at["probability_high"]], [low, high])
        assert_allclose(at["held_probability"], one[~away].mean(), rtol=1e-12)
        truth = exact(loses)[name]
        assert abs(at["probability"] - truth) <= 4.0 * np.sqrt(truth / 6000)


@pytest.mark.parametrize("loses", [False, True])
def test_a_surrogate_joins_its_responses_and_its_interval_holds_the_truth(loses):
    found = by_surrogate(STATES, n=100 if loses else 60, loses=loses)
    check(found, "limit_states")
    for name, truth in exact(loses).items():
        at = found.sel(limit_state=name)
        assert at["probability_low"] <= truth + 1e-12 <= at["probability_high"], name
        assert_allclose(at["probability"], truth, rtol=0.3 if loses else 0.02, atol=1e-9)
        held = (truth - P_LOST) / (1.0 - P_LOST) if loses else truth
        assert_allclose(at["held_probability"], held, rtol=0.05, atol=1e-6)
    assert (found["beta_low"] <= found["beta"]).all()
    assert (found["beta"] <= found["beta_high"]).all()
    assert_allclose(found["beta"], -norm.ppf(found["probability"]))


def test_without_a_lost_run_what_is_not_known_of_losses_stands_in_every_upper_end():
    found = by_surrogate(STATES)
    bound = float(found["probability_high"].sel(limit_state="lost"))
    assert_allclose((1 - bound) ** 60, 0.025)
    assert (found["probability_high"] >= bound).all()
    held = found["held_probability_high"].sel(limit_state="both")
    assert held < 2.0 * found["held_probability"].sel(limit_state="both")


def test_given_that_levitation_holds_what_needs_a_loss_cannot_be():
    config = with_states(alas={"all_of": ["lost", "sway"]})
    runs = synthetic.baseline(500, loses=True)
    for found in (
        limit_states.of_baseline(config, runs), by_surrogate(config, n=100, loses=True),
    ):  # fmt: skip
        for name in ("lost", "alas"):
            assert found["held_probability_high"].sel(limit_state=name) == 0.0
            assert found["probability"].sel(limit_state=name) > 0.0
        probability = found["probability"]
        assert probability.sel(limit_state="alas") == probability.sel(limit_state="lost")


def test_a_level_that_the_population_does_not_carry_has_an_upper_end():
    far = {"response": DEFLECTION, "limit": "2 mm", "target": 1e-7}
    found = by_surrogate(with_states(far=far)).sel(limit_state="far")
    assert found["held_probability"] == found["held_probability_low"] == 0.0
    _, high = binomial_interval(0.0, 2 * CONFIG.study.n_population, 0.95)
    assert_allclose(found["held_probability_high"], high)
    assert found["beta"] == np.inf and np.isfinite(found["beta_low"])


def test_intervals_of_imperfect_surrogates_cover_the_truth():
    truth = synthetic.extremes(np.random.default_rng(3).standard_normal((400_000, 4)))
    levels, states = [], {}
    for k in (2, 4, 5):
        for level in (0.03, 1e-3):  # the rarer lies beyond every run
            limit = f"{np.quantile(truth[:, k], 1 - level):.17g} m/s^2"
            states[f"{k} at {level}"] = {"response": PAPER_RESPONSES[k], "limit": limit}
            levels.append(level)
    whole = CONFIG.quantities()
    study = {**whole["study"], "osm": {"n_runs": 30, "surrogate": "rbf"}}
    config = Config.model_validate({**whole, "cases": {}, "study": study, "limit_states": states})
    covered, off = [], []
    for seed in range(8):
        design = synthetic.design(30, seed=seed)
        fitted = surrogate.dataset(config, "osm", design)
        found = limit_states.of_surrogate(config, design, fitted).isel(limit_state=slice(1, None))
        low, high = found["held_probability_low"], found["held_probability_high"]
        covered.append((low <= levels) & (high >= levels))
        off.append(np.abs(found["held_probability"] / levels - 1.0))
    assert np.mean(covered) >= 0.9
    assert np.median(off) > 0.02  # there is an error to be covered


def test_no_run_that_held_leaves_what_holds_unknown():
    runs = synthetic.baseline(20)
    runs["status"] = runs["status"] + 1
    found = limit_states.of_baseline(STATES, runs)
    assert (found["probability"] == 1.0).all()
    assert np.isnan(found["held_probability"].sel(limit_state="sway"))


def test_the_study_predicts_its_responses_and_those_of_the_limit_states():
    narrow = STATES.model_copy(
        update={"study": STATES.study.model_copy(update={"responses": (PAPER_RESPONSES[5],)})}
    )
    expected = (PAPER_RESPONSES[5], DEFLECTION, SWAY)
    assert narrow.responses_of_study == expected
    design = synthetic.design(60)
    points = synthetic.representative()
    files = {}
    for name, of in (("narrow", narrow), ("whole", STATES)):
        fitted = surrogate.dataset(of, "asm", design)
        predicted = eev.dataset(of, design, fitted, points)
        files[name] = [
            fitted, predicted, density.of_surrogate(of, design, fitted, predicted),
            limits.of_surrogate(of, design, fitted),
        ]  # fmt: skip
    for one, whole in zip(*files.values(), strict=True):
        assert tuple(one["response"].to_numpy()) == expected
        for name in {"predicted", "value", "exceedance", "limit", "held_limit_high"} & set(one):
            same = whole[name].sel(response=list(expected))
            assert_allclose(one[name], same, rtol=1e-9, err_msg=name)


def test_a_limit_state_that_drives_is_reported_on_by_the_design(train, tmp_path):
    state = {"response": PAPER_RESPONSES[4], "limit": "0.3 m/s^2"}
    study = {**MAPPING["study"], "responses": [DEFLECTION]}
    without = from_mapping({**MAPPING, "study": study})
    quiet, loud = (
        without.model_copy(
            update={"limit_states": {"ride": LimitState.model_validate(state | {"drives": drives})}}
        )
        for drives in (False, True)
    )
    plain = made(without, "asm", tmp_path)
    one, other = (made(each, "asm", tmp_path) for each in (quiet, loud))
    assert_array_equal(one["standard"], plain["standard"])
    assert one["response"].to_numpy().tolist() == [DEFLECTION]
    assert other["response"].to_numpy().tolist() == [DEFLECTION, PAPER_RESPONSES[4]]
    assert not np.array_equal(other["standard"], plain["standard"])


@pytest.fixture(scope="module")
def table():
    """Two cases, one with a baseline."""
    files = {
        ("mine", "mcm"): limit_states.of_baseline(STATES, synthetic.baseline(2000, loses=True)),
        ("mine", "asm"): by_surrogate(STATES, n=100, loses=True),
        ("other", "asm"): by_surrogate(STATES),
    }
    return files, describe(limit_state_table.dataset(STATES, files))


def test_the_table_holds_every_case_and_method_by_name(table):
    files, found = table
    check(found, "limit_state_table")
    for (case, method), one in files.items():
        at = found.sel({"case": case, "method": method, "limit_state": "either"})
        assert at["probability"] == one["probability"].sel(limit_state="either")
        assert at["n_runs"] == one["n_runs"]
    assert np.isnan(found["beta"].sel({"case": "other", "method": "mcm"})).all()
    differing = files | {("other", "asm"): files["other", "asm"].isel(limit_state=slice(2))}
    with pytest.raises(ValueError, match="are others than those of mine mcm"):
        limit_state_table.dataset(STATES, differing)


def test_the_table_for_a_person_is_in_millimetres_and_per_cent(table):
    _, found = table
    rows, text = limit_state_table.table(found)
    assert len(rows) == 3 * 5
    one = next(row for row in rows if row["limit_state"] == "deflection")
    assert one["unit"] == "mm" and np.isclose(one["limit"], 1e3 * HIGH["deflection"])
    assert_allclose(one["probability_per_cent"], 100 * float(found["probability"][0, 0, 1]))
    assert "| mine" not in text and "## mine" in text and "## other" in text
    words = "vertical displacement of the girder at midspan of the middle span"
    assert f"| deflection | {words} > 1.50632 mm | – | – |" in text
    assert "| either | any of: deflection, sway, lost | – | – |" in text
    assert "| both | all of: deflection, sway | 0.01 | – |" in text
    cell = next(line for line in text.splitlines() if line.startswith("| both | ") and "[" in line)
    assert cell.count("missed") == 2  # likelier than 1e-4 by both methods
    assert {row["held_verdict"] for row in rows if row["limit_state"] == "sway"} == {"met"}
    assert "| sway | " in text and " met |" in text


def test_verdicts_are_as_far_as_the_interval_goes():
    assert limit_state_table.verdict(1e-6, 0.0, 1e-5) == "met"
    assert limit_state_table.verdict(1e-3, 0.0, 1e-5) == "open"
    assert limit_state_table.verdict(1e-3, 1e-4, 1e-5) == "missed"
    assert limit_state_table.verdict(1e-3, 1e-4, np.nan) == ""
