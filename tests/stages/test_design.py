"""Designs: they resume bit by bit, stop for a reason, and never run anything twice."""

import json
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from formula_train import config, drawn, made
from numpy.testing import assert_allclose, assert_array_equal

from maglev import datasets, parameters
from maglev.stages import design
from maglev.vocabulary import DECISIONS, PAPER_RESPONSES


def values(dataset):
    return np.stack([dataset[name].values for name in PAPER_RESPONSES], axis=1)


def test_a_killed_design_resumes_to_the_same_bytes(tmp_path):
    stories = [
        ("asm_paper", "4", 22),  # batches of 8, 8, then rounds of 3: killed in round 3
        ("asm", "write 5", 28),  # the runs of round 1 are stored, the round itself is not
    ]
    command = [sys.executable, Path(__file__).with_name("formula_train.py"), tmp_path]
    command += [word for method, kill, _ in stories for word in (method, kill)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    told = iter(json.loads(done.stdout))
    for method, kill, n_done in stories:
        (whole, n_runs), (killed, _), (resumed, n_resumed) = next(told), next(told), next(told)
        assert (whole, killed, resumed) == (0, -signal.SIGKILL, 0)
        assert n_resumed == n_runs - n_done, (method, kill)
        folder = tmp_path / f"{method} {kill}"
        assert (folder / "resumed.nc").read_bytes() == (folder / "whole.nc").read_bytes()


@pytest.mark.parametrize(("method", "largest"), [("asm_paper", (22, 28)), ("asm", (28, 36))])
def test_another_largest_number_of_runs_continues_or_shortens(train, tmp_path, method, largest):
    few = made(config(**{method: {"n_largest": largest[0]}}), method, tmp_path)
    n = train.n_runs
    many = made(config(**{method: {"n_largest": largest[1]}}), method, tmp_path)
    assert train.n_runs == many.sizes["sample"] > n == few.sizes["sample"]
    again = made(config(**{method: {"n_largest": largest[0]}}), method, tmp_path)
    assert train.n_runs == many.sizes["sample"]
    xr.testing.assert_identical(again, few)
    shortened = many.isel(sample=slice(n), round=slice(few.sizes["round"]))
    xr.testing.assert_equal(shortened.drop_vars("decision"), few.drop_vars("decision"))
    assert len(list(tmp_path.glob("rounds/validation/*/*"))) == 1  # one and the same history
    assert few.attrs["stopped"] == "largest number of runs"
    assert_array_equal(few["decision"], [0] * (few.sizes["round"] - 1) + [3])


@pytest.mark.parametrize(("at_least", "for_each"), [(48, 2), (40, 12)])
def test_without_a_largest_number_runs_are_so_many_for_each_quantity(
    train, tmp_path, monkeypatch, at_least, for_each
):
    monkeypatch.setattr(parameters, "LARGEST_AT_LEAST", at_least)
    monkeypatch.setattr(parameters, "LARGEST_PER_QUANTITY", for_each)
    one = made(config(asm={"n_largest": None, "n_initial": 40}), "asm", tmp_path)
    assert one.sizes["sample"] == train.n_runs == 48


def test_rounds_are_those_asked_for(train, tmp_path):
    parameters = config()
    one = made(parameters, "asm", tmp_path)
    datasets.check(datasets.describe(one), "design")
    assert_array_equal(one["round_n_runs"], [24, 28, 32, 36])
    assert_array_equal(one["round_index"], np.repeat([0, 1, 2, 3], [24, 4, 4, 4]))
    assert len(np.unique(one["standard"].values, axis=0)) == 36
    sets = drawn(parameters, "asm")
    assert_array_equal(one["standard"][:24], sets["initial_points"]["standard"])
    candidates = {tuple(row) for row in sets["candidate_points"]["standard"].values}
    assert {tuple(row) for row in one["standard"].values[24:]} <= candidates
    assert np.isnan(one["score"][:24]).all()
    assert (one["score"][24:] >= 0).all()


def test_the_error_of_a_round_is_that_of_its_predictions_before_the_runs(train, tmp_path):
    one = made(config(), "asm", tmp_path)
    held = one["status"].values == 0
    scale = values(one)[held & (one["round_index"].values == 0)].std(axis=0)
    assert (~held).any()
    for number in (1, 2, 3):
        of_round = held & (one["round_index"].values == number)
        off = np.abs(one["predicted"].values - values(one))[of_round].max(axis=0) / scale
        assert_allclose(one["error"][number], off, rtol=1e-12)
    assert np.isnan(one["error"][0]).all()


def test_the_rmse_is_that_against_the_baseline_given(train, tmp_path):
    parameters = config()
    without = made(parameters, "osm", tmp_path)
    assert np.isnan(without["rmse"]).all()
    baseline = made(parameters, "mcm", tmp_path)
    one = made(parameters, "osm", tmp_path, truth=baseline)
    held, kept = (each["status"].values == 0 for each in (one, baseline))
    surrogate = design.fit_selected(one["standard"].values[held], values(one)[held], "rbf")
    off = surrogate.predict(baseline["standard"].values[kept]) - values(baseline)[kept]
    assert_allclose(one["rmse"][0], np.sqrt(np.mean(off**2, axis=0)), rtol=1e-9)
    grown = made(config(mcm={"n_samples": 40}), "mcm", tmp_path)
    assert (made(parameters, "osm", tmp_path, truth=grown)["rmse"] != one["rmse"]).all()


def test_no_run_is_made_twice_in_cases_that_are_alike(train, tmp_path):
    made(config(), "asm", tmp_path)
    n = train.n_runs
    made(config(), "asm", tmp_path, case="same")
    assert train.n_runs == n


def test_a_small_error_over_several_rounds_stops_the_published_method(train, tmp_path):
    # the first response is linear in the gains, so that its surrogate is exact
    one = made(config(asm_paper={"n_rounds": 2, "threshold": 1e-6}), "asm_paper", tmp_path)
    assert [DECISIONS[code] for code in one["decision"].values] == [
        "go_on", "go_on", "error_below_threshold",
    ]  # fmt: skip
    assert one.attrs["stopped"] == "error below threshold"


def test_settled_limits_stop_the_tail_method(train, tmp_path):
    settings = {"n_rounds": 2, "threshold": 1e3, "n_initial": 40, "n_largest": 80}
    one = made(config(asm=settings), "asm", tmp_path, case="cov_004")  # none is lost
    assert [DECISIONS[code] for code in one["decision"].values] == [
        "go_on", "go_on", "limits_settled",
    ]  # fmt: skip
    limits, change = one["round_limit"].values, one["limit_change"].values
    scale = values(one)[:40].std(axis=0)
    assert_allclose(change[1:], (np.abs(np.diff(limits, axis=0)) / scale[:, None]).max((1, 2)))


def test_what_cannot_be_designed_is_refused(train, tmp_path):
    initial, case = drawn(config(), "asm")["initial_points"], "validation"
    with pytest.raises(ValueError, match="method must be osm, asm_paper or asm, got 'mcm'"):
        design.dataset(config(), case, "mcm", initial, store=tmp_path)
    with pytest.raises(ValueError, match="the method 'asm' needs the points candidates"):
        design.dataset(config(), case, "asm", initial, store=tmp_path)
    with pytest.raises(ValueError, match="have 4 random gains, expected 1 as in the case"):
        design.dataset(config(), "only_guidance_derivative", "osm", initial, store=tmp_path)
    assert train.n_runs == 0
