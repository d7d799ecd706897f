"""The same gains on many tracks: each run once, and what is made of them."""

import numpy as np
import pytest
import synthetic
import xarray as xr
from formula_train import MAPPING, config
from numpy.testing import assert_allclose, assert_array_equal
from scipy.stats import norm
from synthetic import CONFIG

from maglev.config import from_mapping
from maglev.datasets import check, describe
from maglev.stages import line, tables, tracks
from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.pointset import sobol_points
from maglev.vocabulary import PAPER_RESPONSES

SMALL = config(tracks={"n_tracks": 3, "n_gains": 16})


def test_every_track_meets_the_same_gains_and_is_run_once(train, tmp_path):
    found = tracks.dataset(SMALL, "validation", tmp_path)
    check(describe(found), "tracks")
    assert found["extreme"].shape == (3, 16, 6)
    assert found.attrs["track"] == "3 tracks"
    seeds = found["seed_of_track"].to_numpy()
    assert seeds[0] == SMALL.seed
    assert len(set(seeds)) == 3
    assert train.n_runs == 48
    more = tracks.dataset(config(tracks={"n_tracks": 4, "n_gains": 16}), "validation", tmp_path)
    assert train.n_runs == 64  # another track leaves the others alone
    assert_array_equal(more["extreme"][:3], found["extreme"])
    held = (found["status_on_track"] == 0).to_numpy().all(axis=0)
    moved = (found["extreme"][:, :, 0] - found["extreme"][0, :, 0])[:, held]
    expected = 1e-9 * (seeds % 1000 - seeds[0] % 1000)
    assert_allclose(moved, expected[:, None] * np.ones(held.sum()), atol=1e-15)


def test_a_track_that_is_not_drawn_has_no_others(tmp_path):
    smooth = from_mapping({**MAPPING, "irregularity": {"enabled": False}})
    with pytest.raises(ValueError, match="must be drawn from its spectra, got a smooth track"):
        tracks.dataset(smooth, "validation", tmp_path)


def made(n_tracks=12, n_gains=64, loses=False):
    """Extremes that a track shifts by twice the deviation due to the gains."""
    standard = sobol_points(Marginals([norm()] * 4), n_gains, np.random.default_rng(1)).standard
    values = synthetic.extremes(standard)
    rng = np.random.default_rng(2)
    shift = 2.0 * values.std(axis=0) * rng.standard_normal((n_tracks, 6))
    away = standard[:, 0] < synthetic.BORDER if loses else np.zeros(n_gains, bool)
    extreme = values + shift[:, None]
    extreme[:, away] = np.nan
    return xr.Dataset(
        {
            "standard": (("sample", "parameter"), standard),
            "seed_of_track": ("track", np.arange(n_tracks)),
            "extreme": (("track", "sample", "response"), extreme),
            "status_on_track": (("track", "sample"), np.tile(np.where(away, 1, 0), (n_tracks, 1))),
        },
        coords={
            "parameter": synthetic.keys(range(4)),
            "track": np.arange(n_tracks),
            "response": list(PAPER_RESPONSES),
        },
    )


@pytest.fixture(scope="module", params=[False, True], ids=["held", "some lost"])
def found(request):
    return describe(line.dataset(CONFIG, made(loses=request.param)))


def test_shares_of_the_line_are_those_of_a_sum(found):
    check(found, "line")
    assert (found["gains_share_low"] < 0.2).all() and (found["gains_share_high"] > 0.2).all()
    assert_allclose(found["interaction_share"], 0.0, atol=1e-9)
    spread = found["deviation_of_track"] / found["deviation_on_track"][0]
    assert ((spread > 1.0) & (spread < 3.5)).all()


def test_the_line_is_the_mean_of_its_tracks(found):
    step = np.diff(found["value"], axis=1)[:, :1]
    assert_allclose((found["density_of_line"] * step).sum("cell"), 1.0, rtol=1e-3)
    assert_allclose(found["density_of_track"].mean("track"), found["density_of_line"])


def test_limits_of_a_track_are_read_off_its_surrogate_and_those_of_the_line_need_tracks(found):
    normal = found.isel(response=0)  # 1.5e-3 + 6e-6 u_0 + 2e-6 u_1
    levels = found["failure_probability"].to_numpy()
    if not float(found["lost_share_on_track"].max()):
        sigma = np.hypot(6e-6, 2e-6)
        above = normal["held_limit_on_track"] - normal["mean_on_track"]
        expected = sigma * np.array([norm.isf(one) for one in levels])
        assert_allclose(above, np.tile(expected, (12, 1)), atol=0.1 * sigma)
        assert_allclose(normal["first_order_on_track"][:, 0], 0.9, atol=0.02)
    given = found["held_limit_of_line_status"].to_numpy() == 0
    assert_array_equal(given, np.tile(12 * levels >= 3.0, (6, 1)))
    assert np.isfinite(found["held_limit_of_line"].to_numpy()[~given]).sum() == 0


def test_the_table_says_what_is_of_a_track_and_what_of_the_line(found):
    named = found.assign_attrs(case="validation")
    rows, text = line.table(named)
    assert len(rows) == 18
    assert rows[0]["leading_gain"] == "suspension_proportional"
    assert rows[0]["n_tracks_where_it_leads"] == rows[0]["n_tracks_where_it_rises"] == 12
    assert "not carried by 12 tracks" in text
    assert "nan" not in tables.csv_text(rows).split("limit_of_line")[0]


def test_a_table_says_of_which_track_it_is():
    one = xr.Dataset(attrs={"track": "track of seed 7"})
    assert tables.of_track(one).startswith("Our numbers are of one track, the track of seed 7, not")
    assert tables.of_track(one.assign_attrs(track="32 tracks")) == "Our numbers are of: 32 tracks."
