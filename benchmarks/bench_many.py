"""Point sets, designs and indices of 4, 8, 12 and 20 random quantities: time and accuracy.

    python benchmarks/bench_many.py                            # all parts, ten seeds
    python benchmarks/bench_many.py --parts sets trains        # without the model
    python benchmarks/bench_many.py --parts model --threads 2  # the model alone, on an idle machine
    python benchmarks/bench_many.py --parts                    # the page of what is there

*sets*: errors of point sets on functions of known moments and probabilities.  *trains*: errors of
the limits of six responses that are formulas, by one adaptive design, and of its Sobol' indices.
*model*: the same limits for twelve random quantities of train, controllers and track, against a
baseline of its own.  What is finished is kept in ``benchmarks/results``, and a later start goes on
where the last one ended.  The page is docs/benchmarks/many.md.
"""

from __future__ import annotations

import argparse
import csv
import logging
import time
from collections.abc import Callable, Iterable
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pandas as pd
import xarray as xr
from scipy.stats import chi2, norm
from threadpoolctl import threadpool_limits

from maglev import datasets
from maglev.config import from_mapping
from maglev.figures import style
from maglev.fingerprint import code_of
from maglev.parameters import Config, TailDesign
from maglev.stages import (
    accuracy,
    baseline,
    baseline_chunk,
    baseline_points,
    candidate_points,
    design,
    initial_points,
)
from maglev.uncertainty import pointset
from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.kriging import fit_kriging
from maglev.uncertainty.learning import EXCEEDANCES, predicted_limits, tail_batch
from maglev.uncertainty.pointset import gf_points, rearranged, sobol_points, voronoi_probability
from maglev.uncertainty.sobol import sobol_indices
from maglev.vocabulary import PAPER_RESPONSES

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "benchmarks" / "results"
PAGE = ROOT / "docs" / "benchmarks" / "many.md"

QUANTITIES = (4, 8, 12, 20)
WITHIN = 0.15  # of a standard deviation: what is asked of twelve quantities by 250 runs

N_POINTS = 1000  # what a density stands on
N_COUNTING = 2**18  # counting points: 6 % on a cell of average probability
N_SCRAMBLINGS = 10

N_LARGEST = 248  # whole rounds of 8 after 40
CHECKED = (*range(40, N_LARGEST, 32), N_LARGEST)
N_POPULATION = 2**16  # 65 points beyond the limit at 1e-3, the same for truth and surrogate
N_TRUTH = 2**13  # points of each set of the true indices

Array = np.ndarray

# ---------------------------------------------------------------------------------- point sets


def known_functions(s: int) -> dict[str, tuple[Callable[[Array], Array], float, float, tuple]]:
    """Functions of s standard normal inputs: mean, variance, values exceeded at 0.1 and 0.01."""
    few = 0.5 ** np.arange(s)
    few /= np.linalg.norm(few)
    found = {}
    for name, w in (("few strong", few), ("all alike", np.full(s, s**-0.5))):
        normal, two_sided = norm.isf([0.1, 0.01]), norm.isf([0.05, 0.005])
        spread = np.exp(0.09)
        found[f"sum, {name}"] = (lambda u, w=w: u @ w, 0.0, 1.0, normal)
        found[f"exp, {name}"] = (
            lambda u, w=w: np.exp(0.3 * (u @ w)),
            np.sqrt(spread),
            spread * (spread - 1.0),
            np.exp(0.3 * normal),
        )
        found[f"size, {name}"] = (
            lambda u, w=w: np.abs(u @ w),
            np.sqrt(2.0 / np.pi),
            1.0 - 2.0 / np.pi,
            two_sided,
        )
    for n in (2, s):
        found[f"squares of {n}"] = (
            lambda u, n=n: (u[:, :n] ** 2).sum(axis=1),
            n,
            2.0 * n,
            chi2.isf([0.1, 0.01], n),
        )
    return found


def independent(inputs: Marginals, rng: np.random.Generator) -> tuple[Array, Array]:
    return rng.standard_normal((N_POINTS, inputs.n)), np.full(N_POINTS, 1.0 / N_POINTS)


def sobol(inputs: Marginals, rng: np.random.Generator) -> tuple[Array, Array]:
    found = sobol_points(inputs, N_POINTS, rng)
    return found.standard, found.probability


def once(inputs: Marginals, rng: np.random.Generator) -> tuple[Array, Array]:
    equal = np.full(N_POINTS, 1.0 / N_POINTS)
    return rearranged(sobol_points(inputs, N_POINTS, rng).points, equal, inputs), equal


def counted(inputs: Marginals, rng: np.random.Generator) -> tuple[Array, Array]:
    first, _ = once(inputs, rng)
    probability, _, _ = voronoi_probability(first, inputs, rng, N_COUNTING)
    return rearranged(first, probability, inputs), probability


SETS = {
    "independent": independent,
    "Sobol'": sobol,
    "Sobol', rearranged once": once,
    "GF, cells counted": counted,
}


def of_set(s: int, name: str, scrambling: int) -> list[dict]:
    """Errors of one set for every function, and what the set costs."""
    rng, inputs = np.random.default_rng([s, scrambling]), Marginals([norm()] * s)
    start = time.process_time()
    points, weights = SETS[name](inputs, rng)
    seconds = time.process_time() - start
    rows = []
    for function, (f, mean, variance, limits) in known_functions(s).items():
        y = f(points)
        found = weights @ y
        beyond = [weights @ (y > limit) for limit in limits]
        rows.append(
            {
                "quantities": s,
                "set": name,
                "scrambling": scrambling,
                "function": function,
                "mean": (found - mean) / np.sqrt(variance),
                "variance": weights @ (y - found) ** 2 / variance - 1.0,
                "tenth": beyond[0] / 0.1 - 1.0,
                "hundredth": beyond[1] / 0.01 - 1.0,
                "worth": 1.0 / (weights @ weights),
                "seconds": seconds,
            }
        )
    return rows


# ---------------------------------------------------------------------------- trains of formulas


def weights_of(s: int, first: int) -> Array:
    """Weights of a response: falling from its strongest quantity on, the rest weak, either sign."""
    w = np.maximum(0.6 ** np.arange(s), 0.08) * np.where(np.arange(s) % 2, -1.0, 1.0)
    return np.roll(w / np.linalg.norm(w), first)


def train(u: Array) -> Array:
    """Six responses (sample, 6) of standard normal quantities, each with strong ones of its own.

    Nearly a sum; lognormal with a ripple; a ratio with an interaction; a peak that takes over from
    another; a resonance whose frequency and damping vary; the largest of three sines over time.
    """
    s = u.shape[1]
    a, b, c, d, e, f = (u @ weights_of(s, k * max(s // 6, 1)) for k in range(6))
    ratio = (1.0 + 0.1 * c) / (1.0 + 0.1 * d + 0.02 * u[:, 0] * u[:, -1]) ** 2
    frequency, damping = 0.8 + 0.06 * e, 0.1 * np.exp(0.3 * f)
    t = np.linspace(0.0, 2.0 * np.pi, 101)
    largest = np.empty(u.shape[0])
    for start in range(0, u.shape[0], 8192):
        block = slice(start, start + 8192)
        a_, c_, d_, f_ = (one[block, None] for one in (a, c, d, f))
        motion = (1.0 + 0.1 * f_) * np.sin(t) + 0.4 * (1.0 + 0.2 * a_) * np.sin(3.0 * t + 0.5 * c_)
        largest[block] = np.abs(motion + 0.2 * np.sin(7.0 * t + 0.7 * d_)).max(axis=1)
    return np.column_stack(
        [
            1.0 + 0.05 * a + 0.01 * a * b + 0.005 * b * b,
            np.exp(0.3 * b + 0.05 * np.sin(2.0 * a)),
            ratio,
            np.maximum(1.0 + 0.1 * d, 1.05 - 0.1 * e + 0.03 * a),
            1.0 / np.hypot(1.0 - frequency**2, 2.0 * damping * frequency),
            largest,
        ]
    )


def of_train(s: int, seed: int) -> list[dict]:
    """Errors of the limits of one design, as it grows, and of the indices at its end."""
    settings, inputs = TailDesign(), Marginals([norm()] * s)
    rng = np.random.default_rng([s, seed])
    population = sobol_points(inputs, N_POPULATION, np.random.default_rng(s)).standard
    truth = train(population)
    limits, sigma = predicted_limits(truth, EXCEEDANCES), truth.std(axis=0)
    points = gf_points(inputs, settings.n_initial, rng, N_COUNTING).standard
    candidates = sobol_points(inputs, settings.n_candidates, rng).standard
    rows, fitting, choosing = [], 0.0, 0.0
    while True:
        start = time.process_time()
        surrogate = fit_kriging(points, train(points))
        fitting += time.process_time() - start
        if len(points) in CHECKED:
            found = predicted_limits(surrogate.predict(population), EXCEEDANCES)
            error = np.abs(found - limits) / sigma
            rows += [
                {
                    "quantities": s,
                    "seed": seed,
                    "runs": len(points),
                    "response": response,
                    "exceedance": level,
                    "error": error[k, response],
                    "fitting": fitting,
                    "choosing": choosing,
                }
                for k, level in enumerate(EXCEEDANCES)
                for response in range(error.shape[1])
            ]
        if len(points) >= N_LARGEST:
            indices = of_indices(surrogate, seed)
            return [row | indices for row in rows]
        start = time.process_time()
        chosen = tail_batch(surrogate, points, candidates, settings.batch_size)
        choosing += time.process_time() - start
        points = np.concatenate([points, candidates[chosen]])


def of_indices(surrogate, seed: int) -> dict:
    """Largest error of an index of any response and quantity, and time; of the first seed alone."""
    if seed > 0:
        return {"first": np.nan, "total": np.nan, "indices": np.nan}
    rng, unbounded = np.random.default_rng(0), np.array([[-np.inf], [np.inf]])
    exact = SimpleNamespace(
        points=surrogate.points,
        values=np.tile(unbounded, (1, surrogate.values.shape[1])),
        predict=train,
    )
    with mock.patch("maglev.uncertainty.sobol.N_POINTS", N_TRUTH):
        true_first, true_total = sobol_indices(exact, rng, 0.95)
    start = time.process_time()
    first, total = sobol_indices(surrogate, np.random.default_rng(1), 0.95)
    return {
        "first": np.abs(first[0] - true_first[0]).max(),
        "total": np.abs(total[0] - true_total[0]).max(),
        "indices": time.process_time() - start,
    }


# ------------------------------------------------------------------------------------- the model

NORMAL, LOGNORMAL = "normal", "lognormal"
RANDOM = {  # coefficients of variation recalled or assumed, as in config/examples
    "gains.suspension_proportional": (NORMAL, 0.10),
    "gains.suspension_derivative": (NORMAL, 0.10),
    "gains.guidance_proportional": (NORMAL, 0.10),
    "gains.guidance_derivative": (NORMAL, 0.10),
    "train.air_spring.stiffness": (LOGNORMAL, 0.10),
    "train.air_spring.damping": (LOGNORMAL, 0.20),
    "train.bogie.mass": (NORMAL, 0.04),
    "train.suspension_magnet.end_stiffness": (LOGNORMAL, 0.10),
    "train.lateral_damper.damping": (LOGNORMAL, 0.20),
    "irregularity.vertical.coefficient": (LOGNORMAL, 0.5),
}
BOUNDED = {  # the mass from empty to loaded; a lag of up to a tenth of the controllers' own time
    "train.car_body.mass": ("29 t", "39 t"),
    "control.suspension.lag": ("0.1 ms", "0.5 ms"),
}
CASE, METHOD = "many", "asm"
CHUNK = 1000
N_STEPS = len(CHECKED)


def of_model(n_cars: int, n_spans: int, n_samples: int) -> Config:
    """The configuration of twelve random quantities, whose design goes on to its largest number."""
    random = {key: {"law": law, "coefficient_of_variation": v} for key, (law, v) in RANDOM.items()}
    random |= {key: {"law": "uniform", "low": a, "high": b} for key, (a, b) in BOUNDED.items()}
    return from_mapping(
        {
            "run": CASE,
            "train": {"n_cars": n_cars},
            "guideway": {"n_spans": n_spans},
            "study": {
                "mcm": {"n_samples": n_samples, "chunk_size": CHUNK},
                "asm": {"n_largest": N_LARGEST, "threshold": 1e-9, "n_rounds": 99},
                "in_time": {"cases": []},
            },
            "only": [CASE],
            "cases": {CASE: {"random": random, "methods": ["mcm", METHOD]}},
            "limit_states": dict.fromkeys(Config().limit_states),
        }
    )


def own_baseline(config: Config, store: Path, n_threads: int) -> xr.Dataset:
    """The baseline of the case; runs that the store has are not computed again."""
    n = config.study.mcm.n_samples
    ends = sorted({*range(0, n, CHUNK), n})
    parts = {
        (start, stop): baseline_chunk.dataset(config, CASE, start, stop, store, n_threads)
        for start, stop in pairwise(ends)
    }
    return baseline.dataset(config, baseline_points.dataset(config, CASE), parts)


def judged_design(
    config: Config, seed: int, truth: xr.Dataset, store: Path, n_threads: int
) -> xr.Dataset:
    """Layout ``accuracy`` of the design that one seed of the points leads to."""
    drawn = config.model_copy(update={"seed": config.seed + seed})
    sets = {
        "initial_points": initial_points.dataset(drawn, CASE, METHOD),
        "candidate_points": candidate_points.dataset(drawn, CASE, METHOD),
    }
    made = design.dataset(config, CASE, METHOD, **sets, store=store, n_threads=n_threads)
    with mock.patch.object(accuracy, "N_STEPS", N_STEPS):
        return accuracy.dataset(config, truth, {METHOD: made})


def run_model(options: argparse.Namespace) -> None:
    """Baseline and designs that are not kept yet, seed by seed."""
    config = of_model(options.cars, options.spans, options.samples)
    size = f"{options.cars}_{options.spans}_{options.samples}"
    code = code_of("stages.design", "stages.accuracy")
    paths = [KEPT / f"many_{size}_{code}_{seed}.nc" for seed in range(options.seeds)]
    if all(path.is_file() for path in paths):
        return
    store = KEPT / "many_store"
    start = time.perf_counter()
    truth = own_baseline(config, store, options.threads)
    print(f"baseline of {options.samples}: {time.perf_counter() - start:.0f} s", flush=True)
    for seed, path in enumerate(paths):
        if path.is_file():
            continue
        start = time.perf_counter()
        judged = judged_design(config, seed, truth, store, options.threads)
        judged.attrs["size"] = f"Cars: {options.cars}, spans: {options.spans}"
        judged.attrs["n_samples"] = options.samples
        datasets.write_netcdf(judged, path)
        print(f"model, seed {seed}: {time.perf_counter() - start:.0f} s", flush=True)


# -------------------------------------------------------------------------------- what is kept


def stored(name: str) -> pd.DataFrame:
    path = KEPT / f"many_{name}.csv"
    return pd.read_csv(path) if path.is_file() else pd.DataFrame()


def keep(name: str, rows: list[dict]) -> None:
    """Append rows that belong together to a table."""
    path = KEPT / f"many_{name}.csv"
    KEPT.mkdir(parents=True, exist_ok=True)
    new = not path.is_file()
    with path.open("a", newline="") as file:
        writer = csv.DictWriter(file, rows[0], lineterminator="\n")
        if new:
            writer.writeheader()
        writer.writerows(rows)


def run_table(
    name: str, keys: tuple[str, ...], wanted: Iterable[tuple], make: Callable[..., list[dict]]
) -> None:
    """Compute and keep what a table lacks, group by group."""
    there = stored(name)
    done = set(there[list(keys)].itertuples(index=False, name=None)) if len(there) else set()
    for key in wanted:
        if key not in done:
            start = time.perf_counter()
            keep(name, make(*key))
            print(f"{name} {key}: {time.perf_counter() - start:.1f} s", flush=True)


# ------------------------------------------------------------------------------------ the page


def table(head: Iterable[str], rows: Iterable[Iterable[object]]) -> list[str]:
    head = list(head)
    lines = ["| " + " | ".join(head) + " |", "|---" * len(head) + "|"]
    return [*lines, *("| " + " | ".join(map(str, row)) + " |" for row in rows), ""]


def page_of_sets(rows: pd.DataFrame) -> list[str]:
    numbers = ["mean", "variance", "tenth", "hundredth"]
    squares = rows.assign(**{name: rows[name] ** 2 for name in numbers})
    of = squares.groupby(["quantities", "set"])[[*numbers, "worth", "seconds"]].mean()
    of[numbers] = np.sqrt(of[numbers])
    cells = [
        [s, name, *(f"{of.loc[(s, name), number]:.4f}" for number in numbers[:2])]
        + [f"{of.loc[(s, name), number]:.3f}" for number in numbers[2:]]
        + [f"{of.loc[(s, name), 'worth']:.0f}", f"{of.loc[(s, name), 'seconds']:.2f}"]
        for s in QUANTITIES
        for name in SETS
        if (s, name) in of.index
    ]
    head = [
        "quantities", "set", "mean [σ]", "variance", "P = 0.1", "P = 0.01", "points' worth", "s",
    ]  # fmt: skip
    return [
        "## Point sets",
        "",
        f"{N_POINTS} points, {rows['scrambling'].nunique()} scramblings: root mean square error of",
        "eight functions of known answers (sum, exponential and size of a sum, of few strong or of",
        "equal terms; squares of two and of all): of the mean in standard deviations, of the",
        "variance and of the probability beyond the exact limits as a share.  *Worth* is the",
        "number of equal weights with the same sum of squares, 1/Σ P².  Cells are counted with",
        f"{N_COUNTING} points (the study: {pointset.COUNTING_POINTS}).",
        "",
        *table(head, cells),
        f"So a set of up to {pointset.COUNTED_INPUTS} quantities has its cells counted, and one of",
        "more is rearranged once (`maglev.uncertainty.pointset.COUNTED_INPUTS`).",
        "",
    ]


def of_levels(rows: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Largest error of the six limits, by seed."""
    return rows.groupby([*by, "seed", "runs", "exceedance"])["error"].max()


def page_of_trains(rows: pd.DataFrame) -> list[str]:
    worst = of_levels(rows, ["quantities"])
    lines = [
        "## Designs on trains that are formulas",
        "",
        "Six responses of known limits, each with strong quantities of its own among many weak",
        "ones: nearly a sum, lognormal, a ratio, peaks that take over, a resonance, a largest",
        "value over time (`train` in the script).  One design of the shipped settings serves all;",
        "the error is that of Kriging on the same points as the truth, largest of the six, in",
        "standard deviations: median / worst of the seeds.  Trains of different sizes are",
        "different functions: strong quantities of the responses overlap where there are few.",
        "",
    ]
    for s, of in worst.groupby("quantities"):
        found = of.groupby(["runs", "exceedance"]).agg(["median", "max"])
        seeds = of.index.get_level_values("seed").nunique()
        lines += [f"**{s} quantities**, {seeds} seeds:", ""]
        lines += table(
            ["runs", *(f"{level:g}" for level in EXCEEDANCES)],
            [
                [n]
                + [
                    f"{found.loc[(n, level), 'median']:.3f} / {found.loc[(n, level), 'max']:.3f}"
                    for level in EXCEEDANCES
                ]
                for n in CHECKED
            ],
        )
    last = rows[rows["runs"] == N_LARGEST].groupby("quantities")
    seconds, first = last[["fitting", "choosing"]].median(), last[["first", "total", "indices"]]
    first = first.max()
    lines += [
        f"Process seconds of a design of {N_LARGEST} runs, and Sobol' indices at its end (largest",
        "error of an index of any response and quantity; first seed):",
        "",
        *table(
            ["quantities", "fits", "choices", "indices", "error of first order", "of total"],
            [
                [s, f"{seconds.loc[s, 'fitting']:.0f}", f"{seconds.loc[s, 'choosing']:.0f}"]
                + [f"{first.loc[s, 'indices']:.0f}"]
                + [f"{first.loc[s, name]:.3f}" for name in ("first", "total")]
                for s in seconds.index
            ],
        ),
    ]
    draw(worst, PAGE)
    return [*lines, "![errors of the limits against the number of runs](many.png)", ""]


def draw(worst: pd.Series, page: Path) -> None:
    """Figure: largest error of the six limits at the last level against the number of runs."""
    sizes = sorted(set(worst.index.get_level_values("quantities")))
    with style.page():
        figure, axes = style.panels(1, len(sizes), style.PAGE, 2.4)
        for axis, s in zip(np.atleast_1d(axes), sizes, strict=True):
            of = worst.loc[s].xs(EXCEEDANCES[-1], level="exceedance").unstack("seed")
            axis.semilogy(of.index, of, color="0.7", lw=0.7)
            axis.semilogy(of.index, of.median(axis=1), color="C0", lw=1.6, label="median")
            axis.axhline(WITHIN, color="C1", lw=1.0, ls="--", label=f"{WITHIN:g} σ")
            axis.set(title=f"{s} quantities", xlabel="runs of the model", ylim=(0.03, 4.0))
        np.atleast_1d(axes)[0].set_ylabel(f"largest error at {EXCEEDANCES[-1]:g} [σ]")
        np.atleast_1d(axes)[0].legend(fontsize=6)
        figure.savefig(page.with_suffix(".png"), dpi=200)
        figure.savefig(page.with_suffix(".pdf"))


def both(errors: Array) -> str:
    """Median and worst of the seeds; a dash where the baseline is too small for the limit."""
    if np.isnan(errors).any():
        return "—"
    return f"{np.median(errors):.3f} / {errors.max():.3f}"


def page_of_model(kept: list[Path]) -> list[str]:
    """Tables of the largest baseline whose designs are kept."""
    found = [xr.load_dataset(path) for path in kept]
    largest = max(one.attrs["n_samples"] for one in found)
    found = [one for one in found if one.attrs["n_samples"] == largest]
    levels, n_runs = (found[0][name].values for name in ("failure_probability", "step_n_runs"))
    error = np.abs(np.stack([one["step_held_limit_error"].values[0] for one in found]))
    rmse = np.stack([(one["step_rmse"] / one["sigma"]).values[0] for one in found])
    noise = found[0]["reference_held_half_width"].values[:, -1]
    worst = error.max(axis=2)
    quantities = ", ".join(f"`{key}`" for key in (*RANDOM, *BOUNDED))
    return [
        "## The model: twelve random quantities",
        "",
        f"{quantities}; laws as in the script.  {found[0].attrs['size']}, the track of the seed.",
        f"Seeds of the points: {len(found)}; baseline: {largest} runs, limits on its own points",
        "and given that levitation holds.  Error of the limits and root mean square error, largest",
        "of the six responses, in standard deviations: median / worst of the seeds.",
        "",
        *table(
            ["runs", *(f"{level:g}" for level in levels), "RMSE"],
            [
                [n, *map(both, worst[:, step].T), both(rmse[:, step].max(axis=1))]
                for step, n in enumerate(n_runs[0])
            ],
        ),
        f"By {n_runs[0, -1]} runs, each response at {levels[-1]:g}, and half the baseline's own",
        "interval there:",
        "",
        *table(
            ["response", "error [σ]", "baseline [σ]", "RMSE [σ]"],
            [
                [name.replace("_", " "), both(error[:, -1, k, -1]), f"{noise[k]:.2f}", both(one)]
                for k, (name, one) in enumerate(zip(PAPER_RESPONSES, rmse[:, -1].T, strict=True))
            ],
        ),
    ]


def write_page() -> None:
    """The committed summary of whatever is kept."""
    lines = [
        "# More than four random quantities",
        "",
        "Written by `python benchmarks/bench_many.py` from what it keeps; do not edit.",
        "",
    ]
    sets, trains, models = stored("sets"), stored("trains"), sorted(KEPT.glob("many_*_*_*_*_*.nc"))
    lines += page_of_sets(sets) if len(sets) else []
    lines += page_of_trains(trains) if len(trains) else []
    lines += page_of_model(models) if models else []
    PAGE.write_text("\n".join(lines), encoding="utf-8")


PARTS = ("sets", "trains", "model")


def main() -> None:
    """Compute what is not kept yet and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--parts", nargs="*", choices=PARTS, default=PARTS)
    parser.add_argument("--quantities", nargs="*", type=int, default=QUANTITIES)
    parser.add_argument("--seeds", type=int, default=10, help="of designs")
    parser.add_argument("--samples", type=int, default=10_000, help="runs of the model's baseline")
    parser.add_argument("--cars", type=int, default=5)
    parser.add_argument("--spans", type=int, default=5)
    parser.add_argument("--threads", type=int, default=1, help="rows of runs at the same time")
    options = parser.parse_args()
    logging.basicConfig(level=logging.WARNING)
    with threadpool_limits(1, "blas"):
        if "sets" in options.parts:
            wanted = (
                (s, name, k)
                for s in options.quantities
                for k in range(N_SCRAMBLINGS)
                for name in SETS
            )
            run_table("sets", ("quantities", "set", "scrambling"), wanted, of_set)
        if "trains" in options.parts:
            wanted = ((s, seed) for seed in range(options.seeds) for s in options.quantities)
            run_table("trains", ("quantities", "seed"), wanted, of_train)
        if "model" in options.parts:
            run_model(options)
    write_page()


if __name__ == "__main__":
    main()
