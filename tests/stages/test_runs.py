"""Runs: each is computed once, whatever the chunk, the batch, or the moment of a kill."""

import signal

import numpy as np
import pytest
import xarray as xr
from formula_train import config, in_a_process, made, written
from numpy.testing import assert_array_equal

from maglev import datasets, simulate, vocabulary
from maglev.config import from_mapping
from maglev.stages import baseline, baseline_chunk, baseline_points, track_runs
from maglev.stages.runs import stored_runs


def test_a_stored_run_is_the_run_itself(tmp_path):
    tiny = from_mapping(
        {
            "train": {"n_cars": 1},
            "guideway": {"n_spans": 1},
            "irregularity": {"n_harmonics": 50, "wavelength_max": "20 m"},
        }
    )
    gains = np.array(tiny.gains.as_row) * np.array([[1.0], [1.05], [0.95]])
    direct = simulate(tiny, gains)
    for order in ([0, 1, 2], [2, 0, 0]):
        found = stored_runs(tiny, gains[order], tmp_path)
        for name in direct.data_vars:
            assert_array_equal(found[name].values, direct[name].values[order], err_msg=name)


def test_what_is_stored_is_not_computed_again(train, tmp_path):
    parameters = config()
    gains = np.array(parameters.gains.as_row) * np.random.default_rng(1).normal(
        1, 0.1, size=(20, 4)
    )
    first = stored_runs(parameters, gains, tmp_path)
    assert train.batches == [8, 8, 4]
    again = stored_runs(parameters, gains[::-1], tmp_path)
    assert train.n_runs == 20
    xr.testing.assert_equal(again.isel(sample=slice(None, None, -1)).drop_vars("sample"),
                            first.drop_vars("sample"))  # fmt: skip
    stored_runs(parameters, np.nextafter(gains[:1], 0.0), tmp_path)
    assert train.n_runs == 21  # found by its exact bytes
    stored_runs(parameters, np.repeat(gains[:1] + 1.0, 3, axis=0), tmp_path)
    assert train.n_runs == 22  # asked for three times, run once


def test_the_store_knows_what_decides_a_run(train, tmp_path):
    gains = np.array([config().gains.as_row])
    for mapping, n in [
        ({}, 1),
        ({"study": {"asm": {"batch_size": 5}}, "gains": {"guidance_derivative": "18 A s/m"}}, 1),
        ({"validation": {"speed_step": "20 km/h"}, "run": "other", "demonstration": True}, 1),
        ({"guideway": {"n_spans": 6}}, 2),
        ({"train": {"n_cars": 4}}, 3),
        ({"seed": 1}, 4),
        ({"passage": {"speed": "400 km/h"}}, 5),
    ]:
        stored_runs(from_mapping(mapping), gains, tmp_path)
        assert train.n_runs == n, mapping


def test_the_store_knows_the_track_of_a_run(train, tmp_path):
    gains = np.tile(config().gains.as_row, (3, 1))
    one = stored_runs(config(), gains, tmp_path, track_seeds=[5, 6, 5])
    assert train.n_runs == 2
    assert_array_equal(one["track_seed"], [5, 6, 5])
    assert_array_equal(
        one["girder_displacement_z"][[0, 1]] - one["girder_displacement_z"][2] != 0, [False, True]
    )
    stored_runs(config(), gains[:1], tmp_path)
    assert train.n_runs == 3  # the track of the configuration is another one


def test_a_file_of_the_store_that_was_replaced_is_read_again(train, tmp_path):
    gains = np.array([config().gains.as_row])
    for folder, scale in (("store", 1.0), ("other", 1.1)):
        stored_runs(config(), scale * gains, tmp_path / folder)
    (kept,), (other,) = (list((tmp_path / name).rglob("*.nc")) for name in ("store", "other"))
    other.replace(kept)
    stored_runs(config(), gains, tmp_path / "store")
    assert train.n_runs == 3


def test_growing_the_baseline_computes_only_the_new(train, tmp_path):
    ten = made(config(mcm={"n_samples": 10}), "mcm", tmp_path)
    assert train.n_runs == 10
    twenty = made(config(mcm={"n_samples": 20}), "mcm", tmp_path)
    assert train.n_runs == 20
    same = [name for name in ten.data_vars if name != "probability"]
    xr.testing.assert_equal(twenty.isel(sample=slice(10))[same], ten[same])
    assert_array_equal(twenty["probability"], np.full(20, 0.05))
    datasets.check(datasets.describe(twenty), "runs")


@pytest.mark.parametrize("size", [7, 20])
def test_no_number_depends_on_the_size_of_a_chunk(train, tmp_path, size):
    reference = made(config(), "mcm", tmp_path / "a")
    other = made(config(mcm={"chunk_size": size}), "mcm", tmp_path / "b")
    xr.testing.assert_identical(other, reference)


@pytest.mark.parametrize(
    ("kill", "n_done"), [(0, 0), (1, 8), (3, 18), ("write 0", 0), ("write 2", 10)]
)
def test_a_killed_baseline_resumes_to_the_same_bytes(train, tmp_path, kill, n_done):
    whole, resumed, store = tmp_path / "whole.nc", tmp_path / "resumed.nc", tmp_path / "store"
    written("mcm", tmp_path / "other", whole)
    assert train.batches == [8, 2, 8, 2]
    assert in_a_process("mcm", store, resumed, kill)[0] == -signal.SIGKILL
    assert not resumed.exists()
    assert in_a_process("mcm", store, resumed) == (0, 20 - n_done)
    assert resumed.read_bytes() == whole.read_bytes()


def test_parts_of_a_random_track_share_gains_and_tracks(train, tmp_path):
    parameters = config()
    both = made(parameters, "mcm", tmp_path, case="moving")
    part = {name: track_runs.dataset(parameters, "moving", name, tmp_path)
            for name in vocabulary.TRACK_PARTS}  # fmt: skip
    for one in part.values():
        datasets.check(datasets.describe(one), "runs")
        assert one.sizes["sample"] == 6
    for name in ("gains_only", "other_track"):
        assert_array_equal(part[name]["standard"], both["standard"])
        assert (part[name]["track_seed"] != both["track_seed"]).all()
    for name in ("track_only", "other_gains"):
        assert_array_equal(part[name]["track_seed"], both["track_seed"])
        assert (part[name]["standard"] != both["standard"]).all()
    assert_array_equal(part["track_only"]["standard"], np.zeros((6, 4)))
    assert_array_equal(part["gains_only"]["track_seed"], np.full(6, parameters.seed))
    assert train.n_runs == 30
    made(config(mcm={"n_samples": 6}), "mcm", tmp_path)  # without a random track
    assert train.n_runs == 30


def test_what_cannot_be_run_is_refused(train, tmp_path):
    drawn = baseline_points.dataset(config(), "validation")
    with pytest.raises(ValueError, match=r"samples must be numbered upwards from 0 or more, got"):
        baseline_chunk.dataset(config(), "validation", 5, 5, tmp_path)
    with pytest.raises(ValueError, match=r"gains have shape \(0, 4\), expected \(sample, 4\)"):
        stored_runs(config(), np.empty((0, 4)), tmp_path)
    with pytest.raises(ValueError, match=r"track_seeds have shape \(2,\), expected \(sample,\)"):
        stored_runs(config(), np.ones((1, 4)), tmp_path, track_seeds=[1, 2])
    with pytest.raises(ValueError, match=r"cases\.validation\.track must be random"):
        track_runs.dataset(config(), "validation", "track_only", tmp_path)
    with pytest.raises(ValueError, match="part must be one of gains_only, track_only"):
        track_runs.dataset(config(), "moving", "both", tmp_path)
    one = baseline_chunk.dataset(config(), "validation", 10, 20, tmp_path)
    with pytest.raises(ValueError, match="the chunks must hold the samples 0 to 19 once each"):
        baseline.dataset(config(), drawn, {(10, 20): one})
    whole = baseline_chunk.dataset(config(), "validation", 0, 20, tmp_path)
    with pytest.raises(ValueError, match="must have been run at the points of the baseline"):
        moved = whole.assign(standard=whole["standard"] + 1e-9)
        baseline.dataset(config(), drawn, {(0, 20): moved})
    assert train.n_runs == 20
