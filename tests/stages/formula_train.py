"""A train that is a formula, in place of the model: what it is asked for is counted.

As a script, ``formula_train.py FOLDER METHOD KILL …`` makes designs that are killed on the way and
resumed, beside undisturbed ones, and prints exit codes and numbers of runs.
"""

import json
import multiprocessing
import os
import signal
import sys
import warnings
from itertools import pairwise
from pathlib import Path

import numpy as np
import synthetic

from maglev.config import from_mapping
from maglev.datasets import VARIABLES, describe
from maglev.parameters import Config
from maglev.stages import (
    baseline,
    baseline_chunk,
    baseline_points,
    candidate_points,
    design,
    initial_points,
    runs,
)
from maglev.vocabulary import GAINS

MAPPING = {
    "study": {
        "n_representative": 64,
        "n_counting": 16384,
        "mcm": {"n_samples": 20, "chunk_size": 10},
        "osm": {"n_runs": 30},
        "asm_paper": {"n_initial": 16, "n_candidates": 200, "n_largest": 28, "batch_size": 3},
        "asm": {"n_initial": 24, "n_candidates": 512, "n_largest": 36, "batch_size": 4},
    },
    "cases": {
        "moving": {"methods": ["mcm"], "track": "random", "n_samples": 6},
        "same": {"methods": ["asm"]},
    },
    "limit_states": dict.fromkeys(Config().limit_states),
}


def config(**study):
    """The configuration, with other values in sections of the study."""
    own = {name: {**MAPPING["study"].get(name, {}), **one} for name, one in study.items()}
    return from_mapping({**MAPPING, "study": {**MAPPING["study"], **own}})


class FormulaTrain:
    """Stands in for `maglev.simulate`."""

    def __init__(self):
        self.batches = []

    @property
    def n_runs(self):
        return sum(self.batches)

    def __call__(
        self, config, gains, *, n_threads=1, track_seeds=None, values=None, histories=False
    ):
        self.batches.append(len(gains))
        gains = gains[:, : len(GAINS)]
        standard = (gains / np.array(config.gains.as_row) - 1) / 0.1
        made = synthetic.runs(standard, loses=True).drop_vars(
            ["standard", "parameter_value", "probability", "track_seed", "parameter"],
            errors="ignore",
        )
        for k, name in enumerate(GAINS):
            made[name] = ("sample", gains[:, k])
        seeds = np.zeros(len(gains)) if track_seeds is None else track_seeds % 1000
        made["girder_displacement_z"] = made["girder_displacement_z"] + 1e-9 * seeds
        for name, variable in made.data_vars.items():
            made[name] = variable.astype(VARIABLES[name].dtype)
        made.attrs = {"time_step": 1e-3, "n_steps": 10}
        return describe(made)


def drawn(parameters, method, case="validation"):
    """First points of a method, and the candidates of an adaptive one, by their roles."""
    sets = {"initial_points": initial_points.dataset(parameters, case, method)}
    if method != "osm":
        sets["candidate_points"] = candidate_points.dataset(parameters, case, method)
    return sets


def made(parameters, method, store, case="validation", truth=None):
    """A baseline in chunks, or a design."""
    if method == "mcm":
        points, size = baseline_points.dataset(parameters, case), parameters.study.mcm.chunk_size
        ends = np.minimum(np.arange(0, points.sizes["sample"] + size, size), points.sizes["sample"])
        parts = {
            (start, stop): baseline_chunk.dataset(parameters, case, start, stop, store)
            for start, stop in pairwise(ends.tolist())
        }
        return baseline.dataset(parameters, points, parts)
    sets = drawn(parameters, method, case)
    return design.dataset(parameters, case, method, **sets, baseline=truth, store=store)


def written(method, store, out):
    """Make a baseline or a design and write it."""
    parameters = config()
    result = made(parameters, method, store)
    if method == "mcm":
        baseline.STAGE.write(result, out, parameters, case="validation")
    else:
        design.STAGE.write(result, out, parameters, case="validation", method=method)


def _killed(method, store, out, kill, n_runs):
    train, replace, n_renamed = FormulaTrain(), os.replace, 0

    def dying(config, gains, **options):
        if kill == len(train.batches):
            os.kill(os.getpid(), signal.SIGKILL)
        made = train(config, gains, **options)
        n_runs.value = train.n_runs
        return made

    def renamed(source, target):
        nonlocal n_renamed
        if kill == f"write {n_renamed}":
            os.kill(os.getpid(), signal.SIGKILL)
        n_renamed += 1
        replace(source, target)

    runs.simulate, runs.BATCH, os.replace = dying, 8, renamed
    written(method, store, out)


def in_a_process(method, store, out, kill=None):
    """Make and write something in a process of its own: its exit code, and how many runs it made.

    It is killed before it computes batch ``kill``, or before it renames file N for ``"write N"``.
    """
    context = multiprocessing.get_context("fork")
    n_runs = context.Value("i", 0)
    process = context.Process(target=_killed, args=(method, store, out, kill, n_runs))
    with warnings.catch_warnings():  # threads that other tests have left are not used here
        warnings.simplefilter("ignore", DeprecationWarning)
        process.start()
    process.join()
    return process.exitcode, n_runs.value


def main(folder, *stories):
    # forked from a process that has computed nothing: threads do not outlive a fork
    told = []
    for method, kill in zip(stories[::2], stories[1::2], strict=True):
        own = Path(folder, f"{method} {kill}")
        kill = int(kill) if kill.isdigit() else kill
        told += [
            in_a_process(method, own / "other", own / "whole.nc"),
            in_a_process(method, own / "store", own / "resumed.nc", kill),
            in_a_process(method, own / "store", own / "resumed.nc"),
        ]
    print(json.dumps(told))


if __name__ == "__main__":
    main(*sys.argv[1:])
