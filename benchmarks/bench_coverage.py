"""How often stated intervals of limits hold the truth, and how wide they are.

    python benchmarks/bench_coverage.py                  # fifty seeds; stored, so it may be stopped
    python benchmarks/bench_coverage.py --seeds 4        # a quick look
    python benchmarks/bench_coverage.py --summary-only   # table and figure of what is stored

Eight functions with known answers (tests/uncertainty/known_functions.py), three designs of 104
runs, the intervals before and now, and the surrogate checked by 196 runs more.  Each function, seed
and method is one file in ``benchmarks/results/coverage``; docs/benchmarks/coverage.md follows.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np
from scipy.stats import norm

from maglev.figures import style
from maglev.uncertainty import checked as check
from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.exploration import empty_half_space, exploring_points
from maglev.uncertainty.failure_region import border_batch, fit_failure_region, learnt_loss
from maglev.uncertainty.intervals import joint_limits
from maglev.uncertainty.kriging import fit_kriging
from maglev.uncertainty.learning import tail_batch
from maglev.uncertainty.pointset import gf_points, sobol_points
from maglev.uncertainty.reliability import error_range_near
from maglev.uncertainty.samples import weighted_quantile

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests" / "uncertainty"))
from known_functions import KNOWN, Known  # noqa: E402

STORE = ROOT / "benchmarks" / "results" / "coverage"
PAGE = ROOT / "docs" / "benchmarks" / "coverage.md"
LEVELS = (1e-2, 1e-3, 1e-4)
N_FIRST, N_BATCH, N_BATCHES = 40, 16, 4
N_CHECKED = 300
N_CANDIDATES, N_COUNTING, N_POPULATION = 2**12, 2**12, 2**15
SETTLED = 1e-3
"""Level that the exploring runs are to visit."""

METHODS = {
    "one_stage": "one stage, range of residuals (before)",
    "tail": "led by the tail, range of residuals (before)",
    "joint": "explored, joint error (now)",
    "checked": "checked by 196 more runs (now)",
}

TITLES = {"one_stage": "one stage", "tail": "by the tail", "joint": "joint", "checked": "checked"}
"""The same in a figure."""

Array = np.ndarray


def generator(*key: str | int) -> np.random.Generator:
    """Random numbers that belong to this key alone."""
    words = [list(part.encode()) if isinstance(part, str) else [part] for part in key]
    return np.random.default_rng([number for word in words for number in word])


def normal(n: int) -> Marginals:
    return Marginals([norm(0.0, 1.0)] * n)


def one_stage(known: Known, name: str, seed: int) -> check.Runs:
    """A GF point set of all runs."""
    n = N_FIRST + N_BATCH * N_BATCHES
    points = gf_points(normal(known.n_inputs), n, generator(name, seed, "one stage"), N_COUNTING)
    return made(known, points.standard)


def adaptive(known: Known, name: str, seed: int, n_exploring: int) -> check.Runs:
    """The tail criterion, some runs of each batch exploring, one in eight at the border."""
    inputs = normal(known.n_inputs)
    first = gf_points(inputs, N_FIRST, generator(name, seed, "first"), N_COUNTING).standard
    candidates = sobol_points(inputs, N_CANDIDATES, generator(name, seed, "candidates")).standard
    runs = made(known, first)
    for batch in range(N_BATCHES):
        if n_exploring:
            rng = generator(name, seed, "explore", batch)
            far = exploring_points(runs.points, n_exploring, norm.isf(SETTLED), rng)
            runs = runs.and_of(made(known, far))
        rng = generator(name, seed, "border", batch)
        chosen = tail_chosen(runs, candidates, N_BATCH - n_exploring, rng)
        runs = runs.and_of(made(known, candidates[chosen]))
    return runs


def tail_chosen(runs: check.Runs, candidates: Array, n: int, rng: np.random.Generator) -> Array:
    """Candidates of a batch."""
    surrogate = fit_kriging(runs.points[~runs.lost], runs.values[~runs.lost])
    if not runs.lost.any():
        return tail_batch(surrogate, runs.points, candidates, n)
    region = fit_failure_region(runs.points, runs.lost, rng)
    border = border_batch(region, runs.points, candidates, n // 8)
    occupied = np.concatenate([runs.points, candidates[border]])
    held = 1.0 - region.lost_probability(candidates)
    rest = tail_batch(surrogate, occupied, candidates, n - n // 8, held_probability=held)
    return np.concatenate([border, rest])


def made(known: Known, points: Array) -> check.Runs:
    values, lost = known.run(points)
    return check.Runs(points=points, values=values, lost=lost)


def by_surrogate(runs: check.Runs, rng: np.random.Generator, joint: bool) -> tuple[Array, Array]:
    """Limit, lower and upper end (3, level), and P(lost) with its ends, of a design alone."""
    n_inputs = runs.points.shape[1]
    process = fit_kriging(runs.points[~runs.lost], runs.values[~runs.lost])
    asked = check.Asked(levels=LEVELS)
    plain = rng.standard_normal((N_POPULATION, n_inputs))
    loss = learnt_loss(runs.points, runs.lost, plain, rng)
    proxy = check.Proxy(
        predict=process.predict,
        deviation=process.standard_deviation,
        lost_probability=loss.lost_probability,
    )
    points, weight = check.tail_population(proxy, N_POPULATION, n_inputs, asked, rng)
    held = loss.lost_probability(points) <= 0.5
    known = (loss.probability, loss.lower, loss.upper)
    ends = known[1:] if loss.region is not None else (0.0, 0.0)
    if joint:
        found = joint_limits(
            process,
            0,
            points,
            LEVELS,
            weight=weight,
            held=held,
            lost_interval=ends,
            unvisited=empty_half_space(runs.points, rng).probability,
        )
        return np.array([found.limit, found.lower, found.upper]), np.array(known)
    share, levels = weight / weight.sum(), np.array(LEVELS)
    beyond, away = np.where(held, process.predict(points)[:, 0], np.inf), weight[~held].sum()
    away /= weight.sum()
    limit = weighted_quantile(beyond, share, levels)
    values, residuals = process.values[:, 0], process.leave_one_out()[:, 0]
    at = np.where(np.isfinite(limit), limit, values.max())
    low, high = error_range_near(at, values, residuals)
    less = levels + (away - ends[1])
    lower = weighted_quantile(beyond, share, levels + (away - ends[0])) + low
    upper = np.where(less > away, weighted_quantile(beyond, share, less) + high, np.inf)
    finite = np.isfinite(limit)
    return np.where(finite, [limit, lower, upper], np.nan), np.array(known)


def by_checking(known: Known, runs: check.Runs, seed: int) -> tuple[Array, Array]:
    """The same of a design that runs have checked."""
    found = check.checked(
        known.run,
        check.kriging_proxy,
        runs,
        check.Asked(levels=LEVELS, limit_half_width=1e-6),
        check.Settings(n_batch=98, n_largest=N_CHECKED, n_population=N_POPULATION),
        seed,
    )
    limits, lost = found.limits[0], found.lost
    ends = [lost.probability, lost.lower, lost.upper]
    return np.array([limits.limit, limits.lower, limits.upper]), np.array(ends)


def designs(name: str, seed: int) -> dict[str, check.Runs]:
    """The three designs of a function and seed, stored."""
    path, known = STORE / f"{name}_{seed}_designs.npz", KNOWN[name]
    if not path.is_file():
        runs = {
            "one_stage": one_stage(known, name, seed),
            "tail": adaptive(known, name, seed, 0),
            "explored": adaptive(known, name, seed, N_BATCH // 2),
        }
        keep(path, **{key: one.points for key, one in runs.items()})
    with np.load(path) as kept:
        return {key: made(known, kept[key]) for key in ("one_stage", "tail", "explored")}


def keep(path: Path, **arrays: Array) -> None:
    """Write arrays so that the file appears whole or not at all."""
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f"{os.getpid()}_{path.name}")
    np.savez(aside, **arrays)
    aside.replace(path)


def found(name: str, seed: int, method: str) -> dict[str, Array]:
    """Limits (limit and ends, level) and P(lost) of a method; kept once made."""
    path = STORE / f"{name}_{seed}_{method}.npz"
    if not path.is_file():
        start, made_by = time.perf_counter(), designs(name, seed)
        if method == "checked":
            limits, lost = by_checking(KNOWN[name], made_by["explored"], seed)
        else:
            key = "explored" if method == "joint" else method
            rng = generator(name, seed, method)
            limits, lost = by_surrogate(made_by[key], rng, method == "joint")
        keep(path, limits=limits, lost=lost)
        print(f"{name}, seed {seed}, {method}: {time.perf_counter() - start:.1f} s", flush=True)
    with np.load(path) as kept:
        return dict(kept)


class Score:
    """Counts of one function, method and level over the seeds that are stored."""

    def __init__(self, name: str, method: str, level: int, seeds: list[int]) -> None:
        exact, sigma = truth(name)
        kept = [found(name, seed, method)["limits"][:, level] for seed in seeds]
        limit, lower, upper = np.array(kept).T
        self.finite = np.isfinite(exact[level])
        given = np.isfinite(limit)
        self.n, self.n_given = len(seeds), int(given.sum())
        inside = (lower <= exact[level]) & (exact[level] <= upper)
        self.covered = int(inside[given].sum())
        bounded = given & np.isfinite(upper) & np.isfinite(lower)
        half = 0.5 * (upper - lower)[bounded] / sigma
        self.n_bounded = int(bounded.sum())
        self.covered_bounded = int(inside[bounded].sum())
        self.half = float(np.median(half)) if half.size else np.inf
        if half.size < 0.5 * self.n_given:
            self.half = np.inf
        error = np.abs(limit - exact[level])[given] / sigma
        self.error = float(np.median(error)) if error.size else np.nan

    def cell(self) -> str:
        """Covered of given, half width and error."""
        if not self.finite:
            return "–"
        half = "∞" if np.isinf(self.half) else f"{self.half:.3f}"
        return f"{self.covered}/{self.n_given}, {half} ({self.error:.3f})"


_TRUTH: dict[str, tuple[Array, float]] = {}


def truth(name: str) -> tuple[Array, float]:
    """Limits (level,) and deviation of a function."""
    if name not in _TRUTH:
        _TRUTH[name] = KNOWN[name].limits(np.array(LEVELS))
    return _TRUTH[name]


def stored_seeds(name: str, n_seeds: int) -> dict[str, list[int]]:
    """Seeds that are finished, by method."""
    return {
        method: [s for s in range(n_seeds) if (STORE / f"{name}_{s}_{method}.npz").is_file()]
        for method in METHODS
    }


def page(n_seeds: int) -> str:
    """The committed summary, in Markdown."""
    lines = [
        "# How often intervals hold the truth",
        "",
        "Written by `python benchmarks/bench_coverage.py`; do not edit.",
        "",
        "Limits of functions with known answers by 104 runs, and by 196 more that check them.",
        "Each cell: intervals that hold the limit, of those given; median half width (and median",
        "error), over the deviation of the response.  95 % is stated.  ∞: most intervals have no",
        "upper end, as what no run has visited is likelier than the level.  A limit not given",
        "is one of which the method says that it cannot conclude.  –: losses are likelier.",
        "",
    ]
    totals: dict[str, list[int]] = {method: [0] * 5 for method in METHODS}
    for name, known in KNOWN.items():
        seeds = stored_seeds(name, n_seeds)
        lines += [
            f"## {known.title[0].upper()}{known.title[1:]}",
            "",
            "| method | seeds | " + " | ".join(f"{level:g}" for level in LEVELS) + " |",
            "|---|---:|" + "---:|" * len(LEVELS),
        ]
        for method, words in METHODS.items():
            scores = [Score(name, method, k, seeds[method]) for k in range(len(LEVELS))]
            cells = " | ".join(score.cell() for score in scores)
            lines.append(f"| {words} | {len(seeds[method])} | {cells} |")
            for score in scores:
                if score.finite:
                    counts = [score.covered, score.n_given, score.n]
                    counts += [score.covered_bounded, score.n_bounded]
                    totals[method] = [a + b for a, b in zip(totals[method], counts, strict=True)]
        lines.append("")
    lines += [
        "## All together",
        "",
        "| method | hold, of given | hold, of those with both ends | given | with both ends |",
        "|---|---:|---:|---:|---:|",
    ]
    for method, (covered, given, n, inside, bounded) in totals.items():
        parts = ((covered, given), (inside, bounded), (given, n), (bounded, n))
        shares = " | ".join(f"{100 * part / max(whole, 1):.1f} %" for part, whole in parts)
        lines.append(f"| {METHODS[method]} | {shares} |")
    lines += [
        "",
        "Before and now differ in the design as well: half of each later batch explores.  Form and",
        "constants of the intervals now were chosen on seeds 0 to 14 of these functions, which are",
        "counted here too.",
    ]
    lines += ["", "## Probability of loss", "", *lost_lines(n_seeds), ""]
    lines += [f"![coverage and half width]({PAGE.with_suffix('.png').name})", ""]
    lines += [
        "A point is a function and a level; at 1000 stand intervals without an upper end.",
        "",
    ]
    return "\n".join(lines)


def lost_lines(n_seeds: int) -> list[str]:
    """Coverage of P(lost) on the functions with a cliff."""
    lines = [
        "| function | " + " | ".join(METHODS.values()) + " |",
        "|---|" + "---:|" * len(METHODS),
    ]
    for name in ("cliff", "two_cliffs"):
        exact, cells = KNOWN[name].lost_probability, []
        for method, seeds in stored_seeds(name, n_seeds).items():
            kept = np.array([found(name, seed, method)["lost"] for seed in seeds])
            if not len(kept):
                cells.append("–")
                continue
            inside = np.count_nonzero((kept[:, 1] <= exact) & (exact <= kept[:, 2]))
            half = np.median(kept[:, 2] - kept[:, 1]) / 2.0 / exact
            error = np.median(np.abs(kept[:, 0] - exact)) / exact
            cells.append(f"{inside}/{len(kept)}, {100 * half:.0f} % ({100 * error:.0f} %)")
        lines.append(f"| {KNOWN[name].title} | " + " | ".join(cells) + " |")
    return lines


def draw(n_seeds: int) -> None:
    """Figure: share that hold against half width over error, a point for each limit."""
    with style.page():
        figure, axes = style.panels(1, len(METHODS), style.PAGE, 2.4)
        for axis, (method, words) in zip(np.ravel(axes), TITLES.items(), strict=True):
            for k, level in enumerate(LEVELS):
                scores = [
                    Score(name, method, k, stored_seeds(name, n_seeds)[method]) for name in KNOWN
                ]
                shown = [one for one in scores if one.finite and one.n_given]
                axis.semilogx(
                    [min(one.half / max(one.error, 1e-6), 1e3) for one in shown],
                    [one.covered / one.n_given for one in shown],
                    ".",
                    color=f"C{k}",
                    label=f"{level:g}",
                )
            axis.axhspan(0.92, 0.99, color="0.9")
            axis.axvline(4.0, color="0.5", lw=0.7, ls=":")
            axis.set(title=words, xlabel="half width over error", ylim=(-0.02, 1.03))
        np.ravel(axes)[0].set_ylabel("intervals that hold")
        np.ravel(axes)[0].legend(fontsize=6)
        figure.savefig(PAGE.with_suffix(".png"), dpi=200)
        figure.savefig(PAGE.with_suffix(".pdf"))


def main() -> None:
    """Make what is not stored, write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=50)
    parser.add_argument("--first", type=int, default=0, help="seed to begin with")
    parser.add_argument("--methods", default=",".join(METHODS))
    parser.add_argument("--summary-only", action="store_true")
    arguments = parser.parse_args()
    if not arguments.summary_only:
        for seed in range(arguments.first, arguments.seeds):
            for name in KNOWN:
                for method in arguments.methods.split(","):
                    found(name, seed, method)
    draw(arguments.seeds)
    PAGE.write_text(page(arguments.seeds), encoding="utf-8")


if __name__ == "__main__":
    main()
