"""Point sets of a case: as many as asked for, and the same whatever else is asked for."""

import numpy as np
import pytest
from formula_train import config, drawn
from numpy.testing import assert_allclose, assert_array_equal

from maglev import datasets
from maglev.config import from_mapping
from maglev.stages import baseline_points, points, representative_points
from maglev.vocabulary import GAIN_KEYS


def test_every_set_has_its_layout_and_its_size():
    parameters = config()
    sets = {
        "baseline": baseline_points.dataset(parameters, "validation"),
        "representative": representative_points.dataset(parameters, "validation"),
        **{f"osm {role}": one for role, one in drawn(parameters, "osm").items()},
        **{f"paper {role}": one for role, one in drawn(parameters, "asm_paper").items()},
        **{f"asm {role}": one for role, one in drawn(parameters, "asm").items()},
    }
    expected = {
        "baseline": 20, "representative": 64, "osm initial_points": 30,
        "paper initial_points": 16, "paper candidate_points": 200,
        "asm initial_points": 24, "asm candidate_points": 512,
    }  # fmt: skip
    assert set(sets) == set(expected)
    for name, n in expected.items():
        one = sets[name]
        datasets.check(datasets.describe(one), "points")
        assert one.sizes == {"sample": n, "parameter": 4}
        assert_allclose(one["probability"].sum(), 1.0, rtol=1e-12)


def test_gains_that_are_not_random_stay_at_their_means():
    one = drawn(config(), "osm", "only_guidance_proportional")["initial_points"]
    assert one["parameter"].to_numpy().tolist() == ["gains.guidance_proportional"]
    assert_array_equal(one["suspension_proportional_gain"], np.full(30, 3500.0))
    expected = 4500.0 * (1 + 0.1 * one["standard"].values[:, 0])
    assert_allclose(one["guidance_proportional_gain"], expected, rtol=1e-14)
    assert_allclose(one["standard"].std(), 1.0, atol=0.05)


def test_the_first_design_of_one_gain_is_smaller():
    one = drawn(config(), "asm", "only_guidance_proportional")["initial_points"]
    assert one.sizes == {"sample": 12, "parameter": 1}


def test_many_quantities_keep_a_first_design_of_two_runs_for_each():
    parts = [
        "car_body.mass",
        "bogie.mass",
        "rod.mass",
        "air_spring.stiffness",
        "air_spring.damping",
    ]
    keys = [*(f"gains.{name}" for name in GAIN_KEYS), *(f"train.{part}" for part in parts)]
    random = {key: {"coefficient_of_variation": 0.05} for key in keys}
    for method, n in (("asm", 18), ("asm_paper", 18)):
        few = {"n_initial": 12}
        case = {"random": random, "methods": [method]}
        many = from_mapping({"study": {method: few}, "cases": {"many": case}})
        one = drawn(many, method, "many")["initial_points"]
        assert one.sizes == {"sample": n, "parameter": 9}
        assert_allclose(one["probability"], 1 / n)
        assert_allclose(one["discrepancy"], 0.5 / n)


def test_a_sample_of_the_baseline_does_not_know_how_many_there_are():
    parameters = config()
    few = points.baseline(parameters, "validation", 10)
    many = points.baseline(parameters, "validation", 1000)
    assert_array_equal(many[:10], few)
    assert_allclose(many.std(axis=0), 1.0, atol=0.1)
    assert_array_equal(
        points.track_seeds(parameters, 1000)[:10], points.track_seeds(parameters, 10)
    )
    assert np.unique(points.track_seeds(parameters, 1000)).size == 1000


def test_cases_with_the_same_random_gains_have_the_same_standard_points():
    wide = drawn(config(), "asm", "cov_014")["initial_points"]
    narrow = drawn(config(), "asm", "cov_004")["initial_points"]
    assert_allclose(wide["standard"], narrow["standard"], rtol=1e-9, atol=1e-9)
    other_seed = from_mapping({"seed": 5, "study": {"n_counting": 16384}})
    other = drawn(other_seed, "asm", "cov_004")["initial_points"]
    assert np.abs(other["standard"].values[:24] - narrow["standard"].values).max() > 0.1


def test_an_unknown_case_is_refused():
    with pytest.raises(ValueError, match="there is no case 'al', known are: validation, only_"):
        drawn(config(), "osm", "al")
