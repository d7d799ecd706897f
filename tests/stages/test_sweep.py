"""Sweeps on a train that is a formula, and the table of limits for a person."""

import numpy as np
import pytest
import synthetic
from formula_train import MAPPING, FormulaTrain, made
from numpy.testing import assert_allclose, assert_array_equal

from maglev.config import config_text, from_mapping
from maglev.datasets import check, describe
from maglev.stage import named
from maglev.stages import limit_states, limits, limits_table, mean_run, runs, surrogate, sweep
from maglev.vocabulary import PAPER_RESPONSES

KEY = "gains.suspension_derivative"
ONE = {"gains.suspension_proportional": {"law": "lognormal", "coefficient_of_variation": 0.02}}


def swept(keys, **more):
    """A configuration with a case that is swept over some keys."""
    cases = {"mine": {"sweep": keys, "random": ONE, **more}}
    study = {**MAPPING["study"], "n_population": 2048, "failure_probability": [0.2, 0.1]}
    return from_mapping({**MAPPING, "study": study, "cases": cases, "only": ["mine"]})


def files_of(config, names, store):
    """What the cases of a sweep have found: limits, limit states, and runs at the mean."""
    found = {}
    for name in names:
        design = made(config, "asm", store, case=name)
        fitted = surrogate.dataset(config, "asm", design)
        found[name] = (
            describe(limits.of_surrogate(config, design, fitted)),
            describe(limit_states.of_surrogate(config, design, fitted)),
            describe(mean_run.dataset(config, name, store)),
        )
    return found


def by_method(found, number):
    return {(name, "asm"): files[number] for name, files in found.items()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A sweep of one key with its files."""
    store = tmp_path_factory.mktemp("store")
    config = swept({KEY: ["15 A s/m", "17.5 A s/m", "0.02 A s/mm"]})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(runs, "simulate", FormulaTrain())
        return config, files_of(config, ["mine_1", "mine_2", "mine_3"], store)


def put_together(config, found):
    mean = {name: files[2] for name, files in found.items()}
    made_of = sweep.dataset(config, "mine", by_method(found, 0), by_method(found, 1), mean)
    return describe(made_of)


def test_a_sweep_holds_what_its_cases_have_found(whole):
    config, same = whole
    found = {  # the formula gives all cases of the sweep the same numbers
        name: tuple(one.copy(deep=True) for one in files) for name, files in same.items()
    }
    for k, (limit, state, _) in enumerate(found.values()):
        limit["held_limit_high"][:] += k
        state["probability"][:] *= 0.5**k
    together = put_together(config, dict(reversed(found.items())))
    check(together, "sweep")
    assert together["setting"].to_numpy().tolist() == ["mine_1", "mine_2", "mine_3"]
    assert_allclose(together["swept_value"][:, 0], [15.0, 17.5, 20.0])
    assert together["swept_text"].to_numpy()[2, 0] == "0.02 A s/mm"
    assert together["swept_value"].attrs["units_by_swept_parameter"] == "A s/m"
    for name, (limit, state, mean) in found.items():
        at = together.sel(setting=name)
        assert_array_equal(at["held_limit_high"], limit["held_limit_high"])
        assert_array_equal(at["probability"], state["probability"])
        for response in PAPER_RESPONSES:
            assert at["extreme_at_mean"].sel(response=response) == mean[response].item()


def test_the_run_at_the_mean_has_the_median_of_what_is_random_and_the_swept_value(whole):
    config, found = whole
    for name, gain in (("mine_1", 15.0), ("mine_3", 20.0)):
        mean = found[name][2]
        assert mean.sizes["sample"] == 1
        assert mean["suspension_derivative_gain"].item() == gain
        median = config.gains.suspension_proportional / np.sqrt(1 + 0.02**2)
        assert_allclose(mean["suspension_proportional_gain"], median, rtol=1e-12)


def test_a_sweep_refuses_files_that_do_not_go_together(whole):
    config, found = whole
    with pytest.raises(ValueError, match="the sweep has no limits of mine_2; compute them first"):
        put_together(config, {name: files for name, files in found.items() if name != "mine_2"})
    other = found["mine_1"][0].isel(response=slice(3))
    with pytest.raises(ValueError, match="'mine_2' and 'mine_1' differ in response"):
        put_together(config, {**found, "mine_1": (other, *found["mine_1"][1:])})
    with pytest.raises(ValueError, match="the case 'mine_1' has no sweep"):
        sweep.dataset(config, "mine_1", {}, {}, {})


def test_two_keys_are_a_grid_and_words_have_no_value():
    keys = {"passage.speed": ["100 m/s", "360 km/h"], "control.suspension.group": ["pole", "ends"]}
    found = sweep._swept(swept(keys), "mine")
    assert found["swept_text"].to_numpy()[:, 1].tolist() == ["pole", "ends"] * 2
    assert_allclose(found["swept_value"][:, 0], 100.0)
    assert np.isnan(found["swept_value"][:, 1]).all()
    assert found["swept_value"].attrs["units_by_swept_parameter"] == "m/s, 1"


def test_what_a_sweep_reads_is_a_configuration_that_makes_the_same_values():
    config = swept({KEY: ["15 A s/m", "0.02 A s/mm"]}, set={"passage.approach": "160 m"})
    stage = named("sweep")
    part = from_mapping(stage.slice(config, "mine"))
    assert config_text(stage.slice(part, "mine")) == config_text(stage.slice(config, "mine"))
    view = stage.view(part, "mine")
    assert_allclose(sweep._swept(view, "mine")["swept_value"][:, 0], [15.0, 20.0])


@pytest.fixture(scope="module")
def table():
    """Two cases, one with a baseline."""
    config = synthetic.CONFIG

    def designed(**options):
        design = synthetic.design(**options)
        return limits.of_surrogate(config, design, surrogate.dataset(config, "asm", design))

    files = {
        ("mine", "mcm"): limits.of_baseline(config, synthetic.baseline(2000, loses=True)),
        ("mine", "asm"): designed(n=100, loses=True),
        ("other", "asm"): designed(),
    }
    return files, describe(limits_table.dataset(config, files))


def test_the_table_of_limits_holds_every_case_and_method_by_name(table):
    files, found = table
    check(found, "limits_table")
    for (case, method), one in files.items():
        at = found.sel({"case": case, "method": method})
        for name in ("limit", "held_limit_low", "limit_status", "lost_probability_high"):
            assert_array_equal(at[name], one[name])
    assert np.isnan(found["limit"].sel({"case": "other", "method": "mcm"})).all()
    differing = files | {("other", "asm"): files["other", "asm"].isel(response=slice(2))}
    with pytest.raises(ValueError, match="'other', asm, are of other responses"):
        limits_table.dataset(synthetic.CONFIG, differing)
    with pytest.raises(ValueError, match="needs a case with a method"):
        limits_table.dataset(synthetic.CONFIG, {})


def test_the_table_of_limits_is_in_the_units_of_a_person(table):
    files, found = table
    rows, text = limits_table.table(found)
    assert len(rows) == 3 * 6 * 3
    one = rows[0]
    assert (one["case"], one["method"], one["unit"]) == ("mine", "mcm", "mm")
    assert_allclose(one["held_limit"], 1e3 * files["mine", "mcm"]["held_limit"][0, 0])
    words = "vertical displacement of the girder at midspan of the middle span [mm]"
    line = next(line for line in text.splitlines() if line.startswith(f"| {words} | 0.2 |"))
    assert line.count(" [1.5") == 2
    assert "## mine" in text and "## other" in text
    assert "none, losses are likelier" in text  # at 0.01, as 3.6 % are lost
    assert "Given that levitation holds." in text


def test_numbers_for_a_person_have_three_digits():
    assert [limits_table.three_digits(one) for one in (1234.5, 0.012345, np.inf, np.nan)] == [
        "1230", "0.0123", "∞", "–",
    ]  # fmt: skip
