"""How many runs of the train it takes to know all limits: ten seeds of the adaptive design.

    snakemake results/paper/validation/mcm.nc
    python benchmarks/bench_limits.py            # ten seeds; --seeds 2 for a quick look

Every seed draws its own first design and candidates for the case `validation`; track, gains and
model stay those of the configuration.  After every second round the surrogate is asked for the six
limits at each probability on the baseline's own points, so that the baseline's sampling noise is in
both.  Runs and rounds are kept in the store of the workflow: a later start goes on where the last
one ended.  The table and its figure are written to docs/benchmarks/limits.md.
"""

from __future__ import annotations

import argparse
import logging
from pathlib import Path
from unittest import mock

import numpy as np
import xarray as xr

from maglev import datasets
from maglev.config import load_config
from maglev.figures import style
from maglev.fingerprint import code_of
from maglev.parameters import Config
from maglev.stages import accuracy, candidate_points, design, initial_points
from maglev.vocabulary import RESPONSES

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "benchmarks" / "results"
PAGE = ROOT / "docs" / "benchmarks" / "limits.md"
CASE, METHOD = "validation", "asm"
N_LARGEST = 136  # of the trial that the criterion comes from
WITHIN = 0.1  # of a standard deviation: the baseline's own noise at 1e-3
N_STEPS = 7  # after every second round


def patient(config: Config) -> Config:
    """The configuration whose design goes on to the largest number of runs."""
    asm = config.study.asm.model_copy(
        update={"n_largest": N_LARGEST, "threshold": 1e-9, "n_rounds": 99}
    )
    study = config.study.model_copy(update={"asm": asm})
    return config.model_copy(update={"study": study})


def of_seed(config: Config, seed: int, baseline: xr.Dataset, store: Path) -> xr.Dataset:
    """Layout ``accuracy`` of the design that one seed of the points leads to; kept once made."""
    kept = KEPT / f"limits_{code_of('stages.design', 'stages.accuracy')}_{seed}.nc"
    if kept.is_file():
        return xr.load_dataset(kept)
    drawn = config.model_copy(update={"seed": config.seed + seed})
    sets = {
        "initial_points": initial_points.dataset(drawn, CASE, METHOD),
        "candidate_points": candidate_points.dataset(drawn, CASE, METHOD),
    }
    made = design.dataset(config, CASE, METHOD, **sets, store=store)
    with mock.patch.object(accuracy, "N_STEPS", N_STEPS):
        judged = accuracy.dataset(config, baseline, {METHOD: made})
    KEPT.mkdir(parents=True, exist_ok=True)
    datasets.write_netcdf(judged, kept)
    return judged


def settled(error: np.ndarray, n_runs: np.ndarray, within: float) -> float:
    """First number of runs from which on all errors (step, response) stay within; inf if none."""
    bad = np.flatnonzero(~(np.abs(error).max(axis=1) <= within))
    if bad.size == 0:
        return float(n_runs[0])
    return float(n_runs[bad[-1] + 1]) if bad[-1] + 1 < n_runs.size else np.inf


def draw(n_runs: np.ndarray, error: np.ndarray, noise: np.ndarray, levels: np.ndarray) -> None:
    """Figure: largest error of the six limits against the number of runs, one line a seed."""
    with style.page():
        figure, axes = style.panels(1, levels.size, style.PAGE, 2.6)
        for axis, level, of_level, reach in zip(
            axes, levels, np.moveaxis(error, -1, 0), noise.max(axis=0), strict=True
        ):
            worst = np.abs(of_level).max(axis=-1)
            axis.semilogy(n_runs, worst.T, color="0.7", lw=0.7)
            axis.semilogy(n_runs, np.median(worst, axis=0), color="C0", lw=1.6, label="median")
            axis.axhline(WITHIN, color="C1", lw=1.0, ls="--", label=f"{WITHIN:g} σ")
            axis.axhline(reach, color="0.3", lw=1.0, ls=":", label="half the MCM's interval")
            axis.set(title=f"limits at {level:g}", xlabel="runs of the model")
        axes[0].set_ylabel("largest error of six limits [σ]")
        axes[0].legend(fontsize=6)
        figure.savefig(PAGE.with_suffix(".png"), dpi=200)
        figure.savefig(PAGE.with_suffix(".pdf"))


def main() -> None:
    """Make the designs, judge them, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first", type=int, default=0, help="seed to begin with; above 0: no page")
    parser.add_argument("--results", type=Path, default=ROOT / "results")
    arguments = parser.parse_args()
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(message)s")
    config = patient(load_config(ROOT / "config" / "config.yaml"))
    baseline = datasets.read(arguments.results / config.run / CASE / "mcm.nc", "runs")
    store = arguments.results / ".store" / config.run
    seeds = range(arguments.first, arguments.seeds)
    judged = [of_seed(config, seed, baseline, store) for seed in seeds]
    if arguments.first:
        return
    n_runs = judged[0]["step_n_runs"].values[0]
    levels = judged[0]["failure_probability"].values
    error = np.stack([one["step_held_limit_error"].values[0] for one in judged])
    noise = judged[0]["reference_held_half_width"].values
    draw(n_runs, error, noise, levels)
    lines = [
        "# How many runs it takes to know the limits",
        "",
        "Written by `python benchmarks/bench_limits.py`; do not edit.",
        "",
        f"Case `{CASE}` of `config/config.yaml`, adaptive sampling towards the limits of all six",
        f"responses, {arguments.seeds} seeds of the points.  Errors against the baseline of",
        f"{baseline.sizes['sample']} runs on its own points, in standard deviations of each:",
        "largest of the six, median and worst of the seeds.  Limits are given that levitation",
        "holds: it is lost more often than the rarest limit is exceeded.",
        "",
        "| runs | " + " | ".join(f"{level:g} median | worst" for level in levels) + " |",
        "|---|" + "---:|" * (2 * levels.size),
    ]
    worst = np.abs(error).max(axis=2)  # (seed, step, level)
    for step, n in enumerate(n_runs):
        cells = [
            f"{value:.3f}"
            for level in range(levels.size)
            for value in (np.median(worst[:, step, level]), worst[:, step, level].max())
        ]
        lines.append(f"| {n} | " + " | ".join(cells) + " |")
    last = levels.size - 1
    enough = [settled(one[:, :, last], n_runs, WITHIN) for one in error]
    held = ", ".join("none" if np.isinf(n) else f"{n:.0f}" for n in sorted(enough))
    lines += [
        "",
        f"Half the baseline's own interval is {noise[:, last].min():.2f} to",
        f"{noise[:, last].max():.2f} standard deviations at {levels[last]:g}.",
        f"Runs from which on all six limits at {levels[last]:g} stay within {WITHIN:g} standard",
        f"deviations, by seed: {held}.",
        "",
        f"Error of each limit at {levels[last]:g}, median and worst of the seeds:",
        "",
        "| runs | " + " | ".join(name.replace("_", " ") for name in RESPONSES) + " |",
        "|---|" + "---:|" * len(RESPONSES),
    ]
    for step, n in enumerate(n_runs):
        of_response = np.abs(error[:, step, :, last])
        lines.append(
            f"| {n} | "
            + " | ".join(f"{np.median(one):.3f} / {one.max():.3f}" for one in of_response.T)
            + " |"
        )
    lines += ["", "![errors of the limits against the number of runs](limits.png)", ""]
    PAGE.write_text("\n".join(lines), encoding="utf-8")


if __name__ == "__main__":
    main()
