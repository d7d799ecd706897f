"""Which design finds the limits with the fewest calls: one-stage, adaptive, or led by the tail.

    python benchmarks/bench_designs.py                  # ten seeds, every function and design
    python benchmarks/bench_designs.py --seeds 2        # a quick look
    python benchmarks/bench_designs.py --summary-only   # table and figure of what is stored

Every finished combination of function, seed and design is one group of rows in
``benchmarks/results/designs.csv``; a later start goes on where the last one ended.  At the end come
``designs.nc`` beside it, and ``docs/benchmarks/designs.md`` with its figure.
"""

import argparse
import csv
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import xarray as xr
from scipy.stats import norm, uniform

from maglev.uncertainty.adaptive import AdaptiveState, absorb, propose
from maglev.uncertainty.distributions import Marginals
from maglev.uncertainty.failure_region import border_batch, fit_failure_region
from maglev.uncertainty.kriging import fit_kriging
from maglev.uncertainty.learning import EXCEEDANCES, predicted_limits, tail_batch, taylor_batch
from maglev.uncertainty.pointset import gf_points, sobol_points
from maglev.uncertainty.rbf import fit_rbf

try:  # a development extra, not on every platform
    import openturns as ot
    import openturns.experimental as otexp
except ImportError:
    ot = None

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "docs" / "benchmarks" / "designs.md"

N_FIRST, N_BATCH, N_LARGEST = 40, 8, 136  # the sizes of the trial in the design notes
CHECKED = range(N_FIRST, N_LARGEST + 1, 2 * N_BATCH)
N_POPULATION = 2**17  # 131 points beyond the limit at 1e-3, the same for truth and surrogate
N_CANDIDATES = 2**14
N_TAYLOR_CANDIDATES = 1000  # a GF point set, as Mo et al. take a space-filling one
N_COUNTING = 2**17
NOTICEABLE = 0.01  # a quarter of the noise that 10,000 plain samples leave in the limit at 1e-2

Array = np.ndarray


@dataclass(frozen=True)
class Problem:
    """A function of independent inputs whose limits are known.

    ``extreme`` gives the response, ``lost`` the samples that have none; both of physical inputs
    (sample, parameter).
    """

    title: str
    marginals: Marginals
    extreme: Callable[[Array], Array]
    lost: Callable[[Array], Array]


def never(x: Array) -> Array:
    return np.zeros(x.shape[0], dtype=bool)


def ishigami(x: Array) -> Array:
    """Ishigami & Homma (1990), a = 7, b = 0.1."""
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def borehole(x: Array) -> Array:
    """Flow through a borehole (Harper & Gupta 1983) [m³/yr]; four inputs, the others at mean."""
    radius, head_upper, head_lower, length = x.T
    influence, transmissivity_upper, transmissivity_lower = 7.71e3, 89335.0, 89.55
    conductivity = 10950.0
    log_ratio = np.log(influence / radius)
    leakage = 2.0 * length * transmissivity_upper / (log_ratio * radius**2 * conductivity)
    drop = 2.0 * np.pi * transmissivity_upper * (head_upper - head_lower)
    return drop / (log_ratio * (1.0 + leakage + transmissivity_upper / transmissivity_lower))


def kinked(x: Array) -> Array:
    """Largest absolute value over time of three sines, whose peaks take over from each other."""
    t = np.linspace(0.0, 2.0 * np.pi, 201)
    largest = np.empty(x.shape[0])
    for start in range(0, x.shape[0], 8192):
        a, b, c, d = (x[start : start + 8192, i, None] for i in range(4))
        motion = (1.0 + 0.1 * a) * np.sin(t)
        motion = motion + 0.4 * (1.0 + 0.2 * b) * np.sin(3.0 * t + 0.5 * c)
        motion = motion + 0.2 * np.sin(7.0 * t + 0.7 * d)
        largest[start : start + 8192] = np.abs(motion).max(axis=1)
    return largest


def cliff(x: Array) -> Array:
    """A response that grows towards the border beyond which samples are lost."""
    return np.exp(-0.4 * x[:, 0]) + 0.2 * np.sin(2.0 * x[:, 1]) + 0.1 * x[:, 2] * x[:, 3]


def beyond_cliff(x: Array) -> Array:
    """Lost below a curved border in the first input."""
    return x[:, 0] < -3.4 + 0.1 * x[:, 1] ** 2


NORMAL = Marginals([norm(0.0, 1.0)] * 4)
PROBLEMS = {
    "ishigami": Problem("Ishigami", Marginals([uniform(-np.pi, 2.0 * np.pi)] * 3), ishigami, never),
    "borehole": Problem(
        "borehole",
        Marginals(
            [norm(0.10, 0.0161812), uniform(990, 120), uniform(700, 120), uniform(1120, 560)]
        ),
        borehole,
        never,
    ),
    "kinked": Problem("kinked maximum of sines", NORMAL, kinked, never),
    "cliff": Problem("cliff", NORMAL, cliff, beyond_cliff),
}


@dataclass(frozen=True)
class Case:
    """One function and seed: what every design starts from, and the truth it is judged by."""

    problem: Problem
    seed: int
    first: Array
    population: Array
    limits: Array
    scale: float

    @classmethod
    def drawn(cls, name: str, seed: int) -> "Case":
        problem = PROBLEMS[name]
        first, population = generator(name, seed, "first"), generator(name, 0, "population")
        points = sobol_points(problem.marginals, N_POPULATION, population)
        held = ~problem.lost(points.points)
        extreme = problem.extreme(points.points)
        return cls(
            problem=problem,
            seed=seed,
            first=gf_points(problem.marginals, N_FIRST, first, N_COUNTING).standard,
            population=points.standard,
            limits=predicted_limits(extreme[:, None], EXCEEDANCES, held.astype(float))[:, 0],
            scale=float(extreme[held].std()),
        )

    def run(self, standard: Array) -> tuple[Array, Array]:
        """Responses (sample, 1), NaN where lost, and which samples were lost."""
        physical = self.problem.marginals.from_standard(standard)
        lost = self.problem.lost(physical)
        return np.where(lost, np.nan, self.problem.extreme(physical))[:, None], lost

    def error(self, surrogate, points: Array, lost: Array) -> Array:
        """Errors (level,) of the limits over the standard deviation of the response [-]."""
        held = 1.0 - region(points, lost).lost_probability(self.population) if lost.any() else None
        found = predicted_limits(surrogate.predict(self.population), EXCEEDANCES, held)[:, 0]
        return np.abs(found - self.limits) / self.scale


def generator(*key: str | int) -> np.random.Generator:
    """Random numbers that belong to this key alone."""
    words = [list(part.encode()) if isinstance(part, str) else [part] for part in key]
    return np.random.default_rng([number for word in words for number in word])


def region(points: Array, lost: Array):
    """Region of lost samples, the same for the same samples."""
    return fit_failure_region(points, lost, generator("border", lost.size))


def one_stage(case: Case, name: str, fit):
    """A fresh GF point set for every number of calls."""
    for n in CHECKED:
        rng = generator(name, case.seed, "one stage", n)
        points = gf_points(case.problem.marginals, n, rng, N_COUNTING).standard
        values, lost = case.run(points)
        yield n, fit(points[~lost], values[~lost]), points, lost


def adaptive(case: Case, name: str, fit, criterion, draw):
    """Batches chosen by ``criterion`` among candidates drawn once for the whole run."""
    candidates = draw(case.problem.marginals, generator(name, case.seed, "candidates")).standard
    state = AdaptiveState.empty(case.first.shape[1], 1)
    state = absorb(state, case.first, *case.run(case.first))
    while True:
        proposal = propose(state, fit, partial(criterion, state), candidates, N_BATCH)
        if state.lost.size in CHECKED:
            yield state.lost.size, proposal.surrogate, state.points, state.lost
        if state.lost.size >= N_LARGEST:
            return
        state = absorb(state, proposal.points, *case.run(proposal.points), proposal.predicted)


def taylor(state: AdaptiveState, surrogate, occupied: Array, candidates: Array, n_new: int):
    """The published criterion, told only where samples are likely to be lost."""
    held = None
    if state.lost.any():
        held = 1.0 - region(state.points, state.lost).lost_probability(candidates)
    return taylor_batch(surrogate, occupied, candidates, n_new, held_probability=held)


def tail(state: AdaptiveState, surrogate, occupied: Array, candidates: Array, n_new: int):
    """Our criterion; once a sample is lost, one point of each batch goes to the border."""
    if not state.lost.any():
        return tail_batch(surrogate, occupied, candidates, n_new)
    lost = region(state.points, state.lost)
    border = border_batch(lost, occupied, candidates, 1)
    occupied = np.concatenate([occupied, candidates[border]])
    held = 1.0 - lost.lost_probability(candidates)
    rest = tail_batch(surrogate, occupied, candidates, n_new - 1, held_probability=held)
    return np.concatenate([border, rest])


def lola_voronoi(case: Case, name: str, fit):
    """OpenTURNS' LOLA-Voronoi design; what is lost never reaches it."""
    ot.RandomGenerator.SetSeed(case.seed)
    marginals = [
        ot.Normal(0.0, 1.0) if d.dist.name == "norm" else ot.Uniform(-np.sqrt(3.0), np.sqrt(3.0))
        for d in case.problem.marginals.distributions
    ]
    points = case.first
    values, lost = case.run(points)
    design = otexp.LOLAVoronoi(points[~lost], values[~lost], ot.JointDistribution(marginals))
    while True:
        if lost.size in CHECKED:
            yield lost.size, fit(points[~lost], values[~lost]), points, lost
        if lost.size >= N_LARGEST:
            return
        new = np.array(design.generate(N_BATCH))
        new_values, new_lost = case.run(new)
        points, values = np.concatenate([points, new]), np.concatenate([values, new_values])
        lost = np.concatenate([lost, new_lost])
        design.update(new[~new_lost], new_values[~new_lost])


def taylor_candidates(marginals: Marginals, rng: np.random.Generator):
    return gf_points(marginals, N_TAYLOR_CANDIDATES, rng, N_COUNTING)


def tail_candidates(marginals: Marginals, rng: np.random.Generator):
    return sobol_points(marginals, N_CANDIDATES, rng)


TAYLOR = {"criterion": taylor, "draw": taylor_candidates}
TAIL = {"criterion": tail, "draw": tail_candidates}
DESIGNS = {
    "one-stage RBF": partial(one_stage, fit=fit_rbf),
    "one-stage Kriging": partial(one_stage, fit=fit_kriging),
    "TEAD-RBF": partial(adaptive, fit=fit_rbf, **TAYLOR),
    "TEAD-Kriging": partial(adaptive, fit=fit_kriging, **TAYLOR),
    "tail-Kriging": partial(adaptive, fit=fit_kriging, **TAIL),
}
if ot is not None:
    DESIGNS["LOLA-Voronoi-Kriging"] = partial(lola_voronoi, fit=fit_kriging)


COLUMNS = ("problem", "seed", "design", "calls", "lost", "exceedance", "error", "seconds")


def stored(path: Path) -> list[dict]:
    """Rows of what is finished."""
    if not path.exists():
        return []
    with path.open(newline="") as file:
        return [
            {
                "problem": row["problem"],
                "seed": int(row["seed"]),
                "design": row["design"],
                "calls": int(row["calls"]),
                "lost": int(row["lost"]),
                "exceedance": float(row["exceedance"]),
                "error": float(row["error"]),
                "seconds": float(row["seconds"]),
            }
            for row in csv.DictReader(file)
        ]


def run(path: Path, n_seeds: int) -> None:
    """Run what is not stored yet, seed by seed."""
    path.parent.mkdir(parents=True, exist_ok=True)
    done = {(row["problem"], row["seed"], row["design"]) for row in stored(path)}
    if not path.exists():
        path.write_text(",".join(COLUMNS) + "\n")
    for seed in range(n_seeds):
        for name in PROBLEMS:
            wanted = [design for design in DESIGNS if (name, seed, design) not in done]
            case = Case.drawn(name, seed) if wanted else None
            for design in wanted:
                start, rows = time.perf_counter(), []
                for calls, surrogate, points, lost in DESIGNS[design](case, name):
                    seconds = time.perf_counter() - start
                    errors = case.error(surrogate, points, lost)
                    rows += [
                        (name, seed, design, calls, lost.sum(), level, error, f"{seconds:.3f}")
                        for level, error in zip(EXCEEDANCES, errors, strict=True)
                    ]
                with path.open("a", newline="") as file:
                    csv.writer(file, lineterminator="\n").writerows(rows)
                print(f"{name}, seed {seed}, {design}: {seconds:.1f} s", flush=True)


def dataset(rows: list[dict]) -> xr.Dataset:
    """Stored rows as an array; seeds that are not finished for every design are left out."""
    seeds = [
        seed
        for seed in sorted({row["seed"] for row in rows})
        if {(row["problem"], row["design"]) for row in rows if row["seed"] == seed}
        >= {(problem, design) for problem in PROBLEMS for design in DESIGNS}
    ]
    if not seeds:
        raise SystemExit("no seed is finished for every function and design; run the benchmark")
    coords = {
        "problem": list(PROBLEMS),
        "design": list(DESIGNS),
        "seed": seeds,
        "calls": list(CHECKED),
        "exceedance": list(EXCEEDANCES),
    }
    index = {name: {value: i for i, value in enumerate(values)} for name, values in coords.items()}
    error = np.full([len(values) for values in coords.values()], np.nan)
    seconds = np.full(error.shape[:4], np.nan)
    for row in rows:
        if row["seed"] in index["seed"]:
            place = tuple(index[name][row[name]] for name in coords)
            error[place] = row["error"]
            seconds[place[:4]] = row["seconds"]
    described = {"long_name": "error of the limit over the standard deviation of the response"}
    return xr.Dataset(
        {
            "error": (list(coords), error, described | {"units": "1"}),
            "seconds": (list(coords)[:4], seconds, {"long_name": "time so far", "units": "s"}),
        },
        coords,
        {"title": "Error of limits against number of calls, by design"},
    )


def number(error: float) -> str:
    return "∞" if np.isinf(error) else f"{error:.3f}" if error < 9.9995 else f"{error:.1f}"


def page(results: xr.Dataset, figure: Path) -> str:
    """The committed summary, in Markdown."""
    seeds = results.sizes["seed"]
    shown = [72, 104, 136]
    lines = [
        "# Which design finds the limits with the fewest calls",
        "",
        "Written by `python benchmarks/bench_designs.py`; do not edit.",
        "",
        f"Error of the limit at a probability of exceedance, over the standard deviation of the "
        f"response: median / worst of {seeds} seeds.  Truth and surrogate are read off the same "
        f"{N_POPULATION} points, so the error is the surrogate's alone; adaptive designs start "
        f"from {N_FIRST} GF points and add {N_BATCH} at a time.  ∞: the estimated probability of "
        f"loss exceeds the level (a gap in the figure).  A design that met no lost sample "
        "takes that probability as 0: its limit on the cliff is finite, and too low.  The "
        "smallest median is bold.",
        "",
        f"![error of the limits against calls]({figure.name})",
        "",
        "Lines with markers are medians, thin lines worst cases.",
        "",
    ]
    for name, problem in PROBLEMS.items():
        lines += [
            f"## {problem.title[0].upper()}{problem.title[1:]}",
            "",
            "| design | "
            + " | ".join(
                f"{level:.0e}, {calls} calls".replace("e-0", "e-")
                for level in EXCEEDANCES
                for calls in shown
            )
            + " |",
            "|---" * (1 + len(EXCEEDANCES) * len(shown)) + "|",
        ]
        part = results["error"].sel(problem=name, calls=shown)
        middle, worst = part.median("seed"), part.max("seed")
        for design in DESIGNS:
            cells = []
            for level in EXCEEDANCES:
                for calls in shown:
                    here = {"exceedance": level, "calls": calls}
                    median = float(middle.sel(design=design, **here))
                    cell = f"{number(median)} / {number(float(worst.sel(design=design, **here)))}"
                    best = median == float(middle.sel(here).min())
                    cells.append(f"**{cell}**" if best and np.isfinite(median) else cell)
            lines.append(f"| {design} | " + " | ".join(cells) + " |")
        lines.append("")
    lines += [
        "## Where the tail criterion does not win",
        "",
        f"By more than {NOTICEABLE:g} in the median:",
        "",
    ]
    lines += losses(results["error"]) or ["nowhere."]
    last = results["seconds"].isel(calls=-1).median("seed").max("problem")
    lines += [
        "",
        "## Time",
        "",
        f"Wall seconds to {N_LARGEST} calls on one core of the machine of the last run, which "
        "other work may have shared; fits and choices together, median over seeds, slowest "
        "function; one-stage designs are fitted anew at every size: "
        + ", ".join(f"{design} {float(last.sel(design=design)):.1f}" for design in DESIGNS)
        + ".",
        "",
    ]
    return "\n".join(lines)


def losses(error: xr.DataArray) -> list[str]:
    """One line for each median, after the first design, by which another design is ahead."""
    middle = error.median("seed")
    lines = []
    for name in PROBLEMS:
        for level in EXCEEDANCES:
            for calls in list(CHECKED)[1:]:
                here = middle.sel(problem=name, exceedance=level, calls=calls)
                ours = float(here.sel(design="tail-Kriging"))
                best = int(np.argmin(here.values))
                if ours - here.values[best] > NOTICEABLE:
                    lines.append(
                        f"- {PROBLEMS[name].title}, {level:g}, {calls} calls: "
                        f"{here['design'].values[best]} {number(here.values[best])}, "
                        f"tail-Kriging {number(ours)}"
                    )
    return lines


# Okabe & Ito's palette, with a line style each, so that colour is not needed to tell them apart
STYLES = {
    "one-stage RBF": ("#999999", ":", "o"),
    "one-stage Kriging": ("#000000", ":", "s"),
    "TEAD-RBF": ("#E69F00", "--", "^"),
    "TEAD-Kriging": ("#D55E00", "--", "v"),
    "LOLA-Voronoi-Kriging": ("#009E73", "-.", "D"),
    "tail-Kriging": ("#0072B2", "-", "o"),
}


def draw(results: xr.Dataset, path: Path) -> None:
    """Median (line) and worst case (thin line above it) of every design, as PNG and PDF."""
    plt.rcParams.update({"font.size": 7, "axes.linewidth": 0.6, "pdf.fonttype": 42})
    n_problems, n_levels = len(PROBLEMS), len(EXCEEDANCES)
    figure, axes = plt.subplots(
        n_problems, n_levels, figsize=(7.0, 7.4), sharex=True, sharey="row", layout="constrained"
    )
    calls = results["calls"].values
    for row, (name, problem) in enumerate(PROBLEMS.items()):
        for column, level in enumerate(EXCEEDANCES):
            ax = axes[row, column]
            for design in results["design"].values:
                colour, line, marker = STYLES[design]
                part = results["error"].sel(problem=name, exceedance=level, design=design)
                style = {"color": colour, "linestyle": line}
                width = 1.6 if design == "tail-Kriging" else 1.0
                ax.semilogy(
                    calls,
                    part.median("seed"),
                    marker=marker,
                    markersize=2.8,
                    linewidth=width,
                    label=design,
                    **style,
                )
                ax.semilogy(calls, part.max("seed"), linewidth=0.5, alpha=0.6, **style)
            ax.grid(True, which="major", linewidth=0.3, color="0.85")
            ax.set_xticks(calls[::2])
            if row == 0:
                ax.set_title(f"limit at {level:g}", fontsize=7)
            if row == n_problems - 1:
                ax.set_xlabel("calls")
            if column == 0:
                ax.set_ylabel(f"{problem.title}\nerror / σ")
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False)
    figure.savefig(path.with_suffix(".png"), dpi=200)
    figure.savefig(path.with_suffix(".pdf"), metadata={"CreationDate": None})
    plt.close(figure)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=10, help="number of seeds (default 10)")
    parser.add_argument("--summary-only", action="store_true", help="run nothing, only summarise")
    options = parser.parse_args()
    path = RESULTS / "designs.csv"
    if not options.summary_only:
        run(path, options.seeds)
    results = dataset(stored(path))
    results.to_netcdf(path.with_suffix(".nc"))
    PAGE.parent.mkdir(parents=True, exist_ok=True)
    draw(results, PAGE.with_suffix(".png"))
    PAGE.write_text(page(results, PAGE.with_suffix(".png")))
    print(f"wrote {PAGE.relative_to(ROOT)} from {results.sizes['seed']} seeds")


if __name__ == "__main__":
    main()
