"""Designs and runs of a train that is a formula: six extremes of four gains, and a lost region."""

import numpy as np
import xarray as xr
from scipy.stats import norm

from maglev.datasets import LAYOUTS, VARIABLES, describe
from maglev.parameters import Config
from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.pointset import gf_points
from maglev.vocabulary import DECISIONS, GAIN_KEYS, GAINS, PAPER_RESPONSES

BORDER = -1.8
"""Gains below it in the first standard coordinate lose levitation."""

P_LOST = norm.cdf(BORDER)

CONFIG = Config.model_validate(
    {
        "study": {
            "n_population": 8192,
            "n_representative": 200,
            "n_counting": 65536,
            "failure_probability": [0.2, 0.1, 0.01],
        },
        "limit_states": {},
    }
)


def keys(parameters):
    """Keys of random gains by their numbers."""
    return [f"gains.{GAIN_KEYS[k]}" for k in parameters]


def extremes(u):
    """Six smooth extremes (sample, response) of standard gains (sample, parameter)."""
    x = np.zeros((len(u), 4))
    x[:, : u.shape[1]] = u
    return np.column_stack(
        [
            1.5e-3 + 6e-6 * x[:, 0] + 2e-6 * x[:, 1],  # normal
            1e-4 * np.exp(0.2 * x[:, 0]),  # lognormal
            0.5 + 0.05 * x[:, 0] + 0.02 * x[:, 2] ** 2,
            0.3 + 0.03 * x[:, 0] + 0.03 * x[:, 3],
            0.2 + 0.1 / (6.0 + np.maximum(x[:, 0], -5.0)),
            0.4 + 0.05 * np.sin(x[:, 0]) + 0.02 * x[:, 1],
        ]
    )


def runs(standard, probability=None, *, loses=False, parameters=(0, 1, 2, 3), values=None):
    """A dataset of the layout ``runs`` at standard points."""
    n = len(standard)
    away = standard[:, 0] < BORDER if loses else np.zeros(n, bool)
    y = np.where(away[:, None], np.nan, extremes(standard) if values is None else values)
    filled = {}
    for name in (*LAYOUTS["runs"].variables, "track_seed"):
        sizes = {"sample": n, "car": 1, "parameter": standard.shape[1]}
        filled[name] = (VARIABLES[name].dims, np.zeros([sizes[d] for d in VARIABLES[name].dims]))
    filled |= {name: ("sample", y[:, k]) for k, name in enumerate(PAPER_RESPONSES)}
    filled["status"] = ("sample", np.where(away, 2, 0))
    filled["standard"] = (("sample", "parameter"), standard)
    filled["probability"] = ("sample", np.full(n, 1 / n) if probability is None else probability)
    coords = {"sample": np.arange(n), "car": [0], "parameter": keys(parameters)}
    return describe(xr.Dataset(filled, coords=coords))


def baseline(n=1500, *, loses=False, seed=5, n_parameters=4):
    """Independent samples."""
    standard = np.random.default_rng(seed).standard_normal((n, n_parameters))
    return runs(standard, loses=loses, parameters=range(n_parameters))


def design(n=60, *, loses=False, seed=6, n_parameters=4, ends=None):
    """A GF set as a design, as if made in rounds that end at ``ends`` samples."""
    ends = [n] if ends is None else ends
    points = gf_points(
        Marginals([norm()] * n_parameters), n, np.random.default_rng(seed), counting=2**14
    )
    made = runs(points.standard, points.probability, loses=loses, parameters=range(n_parameters))
    added = {"round_n_runs": ("round", ends), "decision": ("round", [0] * (len(ends) - 1) + [3])}
    assert DECISIONS[3] == "largest_number_of_runs"
    sizes = {"round": len(ends), "sample": n, "response": 6, "failure_probability": 3}
    for name in LAYOUTS["design"].variables:
        if name not in made and name not in added:
            dims = VARIABLES[name].dims
            added[name] = (dims, np.zeros([sizes[d] for d in dims]))
    return describe(
        made.assign(added).assign_coords(
            round=np.arange(len(ends)),
            response=list(PAPER_RESPONSES),
            failure_probability=list(CONFIG.study.failure_probability),
        )
    )


def representative(n=200, *, n_parameters=4):
    """The representative points, layout ``points``."""
    marginals = Marginals([norm()] * n_parameters)
    points = gf_points(marginals, n, np.random.default_rng(7), counting=2**16)
    filled = {name: ("sample", np.zeros(n)) for name in GAINS}
    filled["standard"] = (("sample", "parameter"), points.standard)
    filled["probability"] = ("sample", points.probability)
    filled |= {"discrepancy": ((), points.discrepancy), "counting_error": ((), 0.0)}
    coords = {"sample": np.arange(n), "parameter": keys(range(n_parameters))}
    return describe(xr.Dataset(filled, coords=coords))
