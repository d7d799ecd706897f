"""Surrogates, densities, limits and what they are judged by, on extremes that are formulas."""

import numpy as np
import pytest
import synthetic
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import binom, norm
from synthetic import BORDER, CONFIG, P_LOST

from maglev.datasets import check, describe
from maglev.stages import (
    accuracy,
    density,
    eev,
    limits,
    paper_and_ours,
    statistics_check,
    surrogate,
    table1,
    tables,
    track_split,
)
from maglev.vocabulary import DENSITY_METHODS, LIMIT_STATUS, METHODS, PAPER_RESPONSES

LEVELS = np.array(CONFIG.study.failure_probability)


def chain(**options):
    """Every file of one method, by name."""
    n_parameters = options.get("n_parameters", 4)
    made = {"design": synthetic.design(**options)}
    made["surrogate"] = surrogate.dataset(CONFIG, "asm", made["design"])
    points = synthetic.representative(n_parameters=n_parameters)
    made["eev"] = eev.dataset(CONFIG, made["design"], made["surrogate"], points)
    made["density"] = density.of_surrogate(CONFIG, *made.values())
    made["limits"] = limits.of_surrogate(CONFIG, made["design"], made["surrogate"])
    return made


@pytest.fixture(scope="module")
def held():
    """The files of a design in which nothing is lost."""
    return chain()


@pytest.fixture(scope="module")
def losing():
    """The files of a design with lost runs."""
    return chain(n=100, loses=True)


@pytest.mark.parametrize("name", ["surrogate", "eev", "density", "limits"])
def test_files_are_what_their_layout_says(held, losing, name):
    for files in (held, losing):
        check(describe(files[name]), name)


def test_a_later_stage_predicts_what_the_surrogate_was(held):
    again = surrogate.stored_predictor(CONFIG, held["design"], held["surrogate"])
    first = surrogate.predictor(CONFIG, held["design"], "best", PAPER_RESPONSES)
    points = np.random.default_rng(1).standard_normal((50, 4))
    assert_array_equal(again.surrogate.predict(points), first.surrogate.predict(points))


def test_sobol_indices_of_a_linear_response_are_its_squared_slopes(held):
    found = held["surrogate"]
    exact = np.array([36, 4, 0, 0]) / 40
    for name in ("sobol_first", "sobol_total"):
        assert_allclose(found[name][0], exact, atol=0.02)
        assert (found[f"{name}_low"] <= found[name]).all()
        assert (found[f"{name}_high"] >= found[name]).all()


def test_predictions_at_the_representative_points_are_the_formula(held):
    exact = synthetic.extremes(held["eev"]["standard"].to_numpy())
    error = np.sqrt(((held["eev"]["predicted"] - exact) ** 2).mean("sample")) / exact.std(axis=0)
    assert (error < 0.1).all()
    assert (error[[0, 3]] < 1e-6).all()  # linear ones


def test_a_density_is_normal_and_integrates_to_one(held):
    found = held["density"].isel(response=0)
    sigma = np.hypot(6e-6, 2e-6)
    exact = norm(1.5e-3, sigma)
    for name in ("density", "density_direct"):
        assert_allclose(np.trapezoid(found[name], found["value"]), 1.0, atol=2e-3)
    # the kernel's own width lowers the peak
    kernel = float(found["bandwidth"])
    lowered = norm(1.5e-3, np.hypot(sigma, kernel)).pdf(1.5e-3)
    assert_allclose(found["peak"], lowered, rtol=0.05)
    assert_allclose(found["peak_direct"], lowered, rtol=0.05)
    assert_allclose(found["standard_deviation"], sigma, rtol=0.02)
    assert_allclose(found["exceedance"], exact.sf(found["value"]), atol=0.03)
    assert DENSITY_METHODS[int(found["density_method"])] == "gdee"


def test_exceedance_lies_in_its_interval_and_falls(held, losing):
    for files in (held, losing):
        for name in ("exceedance", "exceedance_low", "exceedance_high"):
            assert (files["density"][name].diff("cell") <= 1e-12).all(), name
        assert (files["density"]["exceedance_low"] <= files["density"]["exceedance"]).all()
        assert (files["density"]["exceedance_high"] >= files["density"]["exceedance"]).all()
        imperfect = files["density"].isel(response=5)  # its surrogate errs to both sides
        assert float((imperfect["exceedance"] - imperfect["exceedance_low"]).max()) > 1e-3
        assert float((imperfect["exceedance_high"] - imperfect["exceedance"]).max()) > 1e-3


def test_points_that_are_likely_lost_are_not_in_a_density(losing):
    found = losing["density"].isel(response=0)
    truncated = norm.pdf(BORDER) / norm.sf(BORDER)  # mean of the first coordinate that held
    assert_allclose(found["mean"], 1.5e-3 + 6e-6 * truncated, atol=2e-7)


def test_the_interval_of_a_limit_is_made_of_the_errors_near_it():
    predictions = np.random.default_rng(8).standard_normal(20_000)
    training = np.linspace(-3.0, 3.0, 200)
    size = np.where(training > 1.9, 0.5, 0.01)
    residuals = size * np.where(np.arange(200) % 2, 1.0, -1.0)
    found = limits.limits_off(CONFIG, predictions, training, residuals, {})
    half = 0.5 * (found.upper - found.lower)
    assert half[0] < 0.1 and half[2] > 0.5


def test_limits_of_a_surrogate_are_those_of_the_formula(held):
    found = held["limits"].isel(response=0)
    exact = norm(1.5e-3, np.hypot(6e-6, 2e-6)).isf(LEVELS)
    assert_allclose(found["limit"], exact, atol=2e-7)
    assert (found["limit_low"] <= exact).all() and (found["limit_high"] >= exact).all()
    assert (held["limits"]["limit_status"] == 0).all()


def test_a_lost_probability_is_learnt_and_enters_density_and_limits(losing):
    low, high = (float(losing["limits"][f"lost_probability_{end}"]) for end in ("low", "high"))
    assert low < P_LOST < high
    learnt = float(losing["limits"]["lost_probability"])
    assert_allclose(learnt, P_LOST, rtol=0.5)
    for response in range(6):
        one = losing["density"].isel(response=response)
        assert_allclose(np.trapezoid(one["density"], one["value"]), 1.0 - learnt, atol=5e-3)
        assert_allclose(one["exceedance"][-1], learnt)
    status = losing["limits"]["limit_status"].sel(failure_probability=0.01)
    assert (status == LIMIT_STATUS.index("infinite")).all()  # losses alone are likelier
    assert np.isinf(losing["limits"]["limit"].sel(failure_probability=0.01)).all()


def test_without_lost_runs_the_bound_of_the_lost_probability_is_binomial(held):
    found = held["limits"]
    assert found["lost_probability"] == 0 == found["lost_probability_low"]
    bound = float(found["lost_probability_high"])
    assert_allclose(binom.cdf(0, 60, bound), 0.025)
    assert np.isfinite(found["limit_high"]).all()


def test_a_baseline_has_counted_limits_and_no_gdee():
    runs = synthetic.baseline(3000, loses=True)
    found, shown = limits.of_baseline(CONFIG, runs), density.of_baseline(CONFIG, runs)
    check(describe(found), "limits")
    check(describe(shown), "density")
    n_lost = int((runs["standard"][:, 0] < BORDER).sum())
    assert_allclose(found["lost_probability"], n_lost / 3000)
    ranked = np.sort(np.where(runs["status"] == 0, runs[PAPER_RESPONSES[0]], np.inf))
    assert found["limit"][0, 1] == ranked[3000 - 300 - 1]
    assert np.isnan(shown["density"]).all() and np.isnan(shown["peak"]).all()
    assert (shown["density_method"] == DENSITY_METHODS.index("direct")).all()
    one = shown.isel(response=3)
    assert_allclose(np.trapezoid(one["density_direct"], one["value"]), 1 - n_lost / 3000, atol=3e-3)
    assert (one["exceedance_low"] < one["exceedance"]).all()


def test_one_random_gain_works_in_every_stage():
    files = chain(n=12, n_parameters=1)
    for name in ("surrogate", "eev", "density", "limits"):
        check(describe(files[name]), name)
    found = files["limits"].isel(response=0)
    exact = norm(1.5e-3, 6e-6).isf(LEVELS)
    assert_allclose(found["limit"], exact, atol=2e-7)
    assert_allclose(files["surrogate"]["sobol_total"], 1.0, atol=0.05)
    assert np.isfinite(found["limit_high"]).all()  # Student's interval of few residuals


def test_strays_make_the_gdee_go_by_the_logarithm_or_refuse(held):
    stray = held["eev"].copy(deep=True)
    stray["predicted"][5, 4] = 1.5
    stray["predicted"][5, 3] = 1e7
    stray["predicted"][6, 3] = -1.0  # no logarithm
    found = density.of_surrogate(CONFIG, held["design"], held["surrogate"], stray)
    kinds = [DENSITY_METHODS[number] for number in found["density_method"].to_numpy()]
    assert kinds == ["gdee"] * 3 + ["direct", "gdee_of_the_logarithm", "gdee"]
    one = found.isel(response=4)
    body = one["value"] < 1.0
    share = np.trapezoid(one["density"][body], one["value"][body])
    assert_allclose(share, 1.0 - stray["probability"][5], atol=0.02)
    assert_array_equal(found["density"][3], found["density_direct"][3])
    assert np.isnan(found["mesh_size"][3])


def test_accuracy_of_a_method_whose_surrogate_is_exact_is_that_of_the_baseline():
    runs = synthetic.baseline(1500)
    designs = {
        "osm": synthetic.design(60),
        "asm": synthetic.design(60, ends=[40, 48, 60]),
    }
    found = accuracy.dataset(CONFIG, runs, designs)
    check(describe(found), "accuracy")
    assert found["method"].to_numpy().tolist() == ["osm", "asm"]
    assert_array_equal(found["step_n_runs"][1, :3], [40, 48, 60])
    assert found["step_n_runs"][0, 0] == 40 and found["step_n_runs"][0].max() == 60
    assert (found["step_n_runs"][1, 3:] == 0).all()
    last = found.isel(method=1, step=2)
    linear = [0, 3]
    assert_allclose(last["step_limit_error"][linear], 0.0, atol=1e-3)
    assert (last["step_rmse"] < 0.1 * found["sigma"]).all()
    assert np.isnan(found["step_limit"][1, 3:]).all()
    assert (found["reference_half_width"] > 0).all()


def test_accuracy_counts_the_points_that_are_predicted_to_be_lost():
    runs = synthetic.baseline(1500, loses=True)
    found = accuracy.dataset(CONFIG, runs, {"osm": synthetic.design(100, loses=True)})
    error = found["step_limit_error"].isel(method=0, step=-1, response=3, failure_probability=1)
    without = limits.baseline_limits(
        CONFIG, synthetic.extremes(runs["standard"].to_numpy()), np.zeros(1500, bool)
    )[3].limit[1]
    gap = float(found["reference_limit"][3, 1] - without) / float(found["sigma"][3])
    assert gap > 0.1  # lost runs move the limit by far more
    assert abs(error) < 0.3 * gap


def test_shares_of_gains_and_track_are_those_of_a_sum():
    rng = np.random.default_rng(9)
    n = 800
    gain, other = rng.standard_normal((2, n, 4))
    track, another = rng.standard_normal((2, n))

    def made(u, t):
        values = 5.0 + 2.0 * u[:, [0]] + 1.0 * np.tile(t[:, None], 6)
        return synthetic.runs(u, values=values)

    parts = {
        "gains_only": made(gain, np.zeros(n)),
        "track_only": made(np.zeros((n, 4)), track),
        "other_track": made(gain, another),
        "other_gains": made(other, track),
    }
    found = track_split.dataset(CONFIG, made(gain, track), parts)
    check(describe(found), "track_split")
    assert (found["gains_share_low"] < 0.8).all() and (found["gains_share_high"] > 0.8).all()
    assert (found["track_share_low"] < 0.2).all() and (found["track_share_high"] > 0.2).all()
    assert_allclose(found["gains_share"] + found["track_share"] + found["interaction_share"], 1.0)
    assert float(found["gains_share_high"][0] - found["gains_share_low"][0]) < 0.15
    for key, sigma in (("both", 5**0.5), ("gains_only", 2.0), ("track_only", 1.0)):
        peak = float(found[f"density_{key}"][0].max())
        assert_allclose(peak, norm(0, sigma).pdf(0), rtol=0.12)
    with pytest.raises(ValueError, match="must have 800 samples"):
        track_split.dataset(
            CONFIG,
            made(gain, track),
            parts | {"other_gains": made(gain, track).isel(sample=slice(9))},
        )


def test_limits_given_that_levitation_holds_know_no_losses(losing):
    found = losing["limits"]
    population = np.random.default_rng(2).standard_normal((200_000, 4))
    population = population[population[:, 0] > BORDER]
    exact = np.quantile(synthetic.extremes(population)[:, 0], 1.0 - LEVELS)
    assert (found["held_limit_status"] == 0).all()
    assert_allclose(found["held_limit"][0], exact, atol=3e-7)
    assert (found["held_limit_low"] <= found["held_limit"]).all()
    assert (found["held_limit"] < found["limit"]).all()


@pytest.fixture(scope="module")
def by_method():
    """Baseline and limits of two methods, one of which is wrong by half a deviation."""
    runs = synthetic.baseline(4000, loses=True)
    truth, made = limits.of_baseline(CONFIG, runs), synthetic.design(100, loses=True)
    good = limits.of_surrogate(CONFIG, made, surrogate.dataset(CONFIG, "asm", made))
    bad = good.assign(
        {name: good[name] + 0.5 * good["sigma"] for name in ("limit", "held_limit")}
    ).assign(lost_probability=0.2)
    return runs, {"mcm": truth, "osm": bad, "asm": good}


def test_the_check_tells_a_good_method_from_a_bad_one(by_method):
    runs, found = by_method
    pairs = {("here", method): one for method, one in found.items()}
    made = describe(statistics_check.dataset(CONFIG, {"here": runs}, pairs))
    check(made, "statistics_check")
    assert set(made["check_case"].to_numpy()) == {"here"}

    def verdicts(kind, method):
        chosen = (made["check_kind"] == kind) & (made["check_method"] == method)
        return made["check_passed"].to_numpy()[chosen]

    yes, no = statistics_check.YES, statistics_check.NO
    for kind in (statistics_check.HALVES, statistics_check.HELD_HALVES):
        assert np.mean(verdicts(kind, "mcm") == yes) > 0.9
    for kind in (statistics_check.LIMIT, statistics_check.HELD_LIMIT):
        assert np.mean(verdicts(kind, "asm") == yes) > 0.8
    assert np.mean(verdicts(statistics_check.HELD_LIMIT, "osm") == no) > 0.9
    assert verdicts(statistics_check.LOSS, "asm") == [yes]
    assert verdicts(statistics_check.LOSS, "osm") == [no]
    infinite = made["check_failure_probability"] == 0.01  # for both, as losses are likelier
    both = infinite & (made["check_kind"] == statistics_check.LIMIT)
    assert (made["check_passed"].to_numpy()[both] == yes).all()


def test_halves_from_different_populations_disagree():
    runs = synthetic.baseline(2000)
    values = synthetic.extremes(runs["standard"].to_numpy())
    values[1000:] += 0.5 * values.std(axis=0)
    moved = synthetic.runs(runs["standard"].to_numpy(), values=values)
    made = statistics_check.dataset(CONFIG, {"here": moved}, {})
    halves = made["check_kind"] == statistics_check.HALVES
    at = halves & (made["check_failure_probability"] >= 0.1)
    assert (made["check_passed"].to_numpy()[at] == statistics_check.NO).all()
    assert (made["check_value"].to_numpy()[at] > 1.0).all()  # the second half lies higher


def test_a_level_that_a_half_cannot_carry_is_not_decided():
    made = statistics_check.dataset(CONFIG, {"here": synthetic.baseline(1000)}, {})
    at = made["check_failure_probability"] == 0.01  # five exceedances in each half
    assert (made["check_passed"].to_numpy()[at] == statistics_check.UNDECIDED).all()


def test_table_1_holds_every_limit_and_says_where_there_is_none(by_method):
    _, found = by_method
    table = describe(table1.dataset(CONFIG, found))
    check(table, "table1")
    rows = table1.rows(table)
    assert len(rows) == 6 * 3 * 3
    assert rows[1]["method"] == "osm" and rows[1]["failure_probability"] == 0.2
    assert rows[1]["limit"] == float(found["osm"]["limit"][0, 0])
    text = table1.text(table, "Table 1")
    assert "| girder_displacement_z [m] | 0.2 | " in text
    assert text.count("none, losses are likelier") == 6 * 3
    assert table1.dataset(CONFIG, {"asm": found["asm"]}).sizes["method"] == 1
    with pytest.raises(ValueError, match="same failure probabilities"):
        table1.dataset(CONFIG, found | {"asm": found["asm"].isel(failure_probability=slice(2))})


def test_the_papers_numbers_stand_beside_ours_with_reasons_from_the_files(held):
    runs = synthetic.baseline(1500)
    designs = {"osm": synthetic.design(60), "asm": held["design"]}
    judged = accuracy.dataset(CONFIG, runs, designs)
    shown = density.of_baseline(CONFIG, runs)
    densities = {"mcm": shown, "osm": held["density"], "asm": held["density"]}
    table = describe(paper_and_ours.dataset(CONFIG, densities, designs, judged))
    check(table, "paper_and_ours")
    peak = float(held["density"]["peak"][0])
    assert table["paper_peak"][1, METHODS.index("osm")] == peak
    assert_allclose(table["paper_peak_error"][1, 3], peak / shown["peak_direct"][0] - 1.0)
    assert table["paper_peak"][0, 0] == 6.37e4 and np.isnan(table["paper_peak"][0, 3])
    assert_allclose(table["paper_deviation"][0, 0], 6.26e-6, rtol=1e-3)
    reason = table["paper_rmse"].attrs["why_different"]
    assert "on 1500 runs of the baseline" in reason and "asm 0.000 at 60 runs" in reason
    assert "60 runs, 0 of them lost" in table["paper_n_runs"].attrs["why_different"]
    rows = paper_and_ours.rows(table)
    assert {row["method"] for row in rows} == set(METHODS)
    assert not any(value != value for row in rows for value in row.values())
    text = paper_and_ours.text(table, "Paper and ours")
    assert "| mcm | 63700 | " in text and "nan" not in text
    with pytest.raises(ValueError, match="compared with a baseline"):
        paper_and_ours.dataset(CONFIG, {"asm": held["density"]}, designs, judged)


def test_tables_are_marked_where_they_are_no_result(tmp_path):
    rows = [{"a": 1.0, "b": "x"}]
    tables.write(tmp_path / "t", rows, "# T\n", demonstration=True)
    assert (tmp_path / "t.csv").read_text() == "a,b,demonstration\n1.0,x,yes\n"
    assert (tmp_path / "t.md").read_text().startswith("*Demonstration, not a result.*")
    tables.write(tmp_path / "t", rows, "# T\n", demonstration=False)
    assert (tmp_path / "t.csv").read_text() == "a,b\n1.0,x\n"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["t.csv", "t.md"]
