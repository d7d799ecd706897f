"""The paper's numbers beside ours, and the reasons for differences."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import lost
from maglev.stages.tables import markdown, number, of_track
from maglev.vocabulary import DECISIONS, METHODS, SOURCES

RESPONSE = "girder_displacement_z"
"""Response of the paper's numbers."""

PAPER_PEAK = {"mcm": 6.37e4, "osm": 6.01e4, "asm_paper": 6.44e4}
"""Largest densities in the paper's Fig. 11 [1/m]."""

PAPER_PEAK_ERROR = {"osm": -0.0565, "asm_paper": 0.0110}
"""Errors of these as the paper states them [-], with the signs of the peaks."""

PAPER_RMSE = {"osm": 1.34e-5, "asm_paper": 1e-6}
"""Root mean square errors at 273 runs in the paper's Fig. 9 [m]; that of ASM is an upper bound."""

PAPER_RMSE_N_RUNS = 273
"""Number of runs of ``PAPER_RMSE``."""

PAPER_N_RUNS = {"mcm": 10_000, "osm": 363, "asm_paper": 363}
"""Runs of the model for the displacement in the paper."""

PAPER_DEVIATION = 1.0 / (np.sqrt(2.0 * np.pi) * PAPER_PEAK["mcm"])
"""Standard deviation [m] of a normal density with the paper's peak; the paper states none."""

_NORMAL_PEAK = 1.0 / np.sqrt(2.0 * np.pi)


def dataset(
    config: Config,
    density: Mapping[str, xr.Dataset],
    design: Mapping[str, xr.Dataset],
    accuracy: xr.Dataset,
) -> xr.Dataset:
    """Set our numbers of the validation case beside the paper's.

    Parameters
    ----------
    config
        The configuration, of which nothing is read.
    density
        Layout ``density``, by method; the baseline among them.
    design
        Layout ``design``, by method.
    accuracy
        Layout ``accuracy``, of these designs.

    Returns
    -------
    dataset
        Layout ``paper_and_ours``; the attribute ``why_different`` of each variable explains the
        difference by the numbers of these files.  NaN or 0 where there is no number.

    Raises
    ------
    UserError
        If there is no baseline among the densities.
    """
    if "mcm" not in density:
        raise UserError("the paper's numbers are compared with a baseline, got no 'mcm' density")
    names = list(METHODS)
    if RESPONSE not in density["mcm"]["response"]:
        raise UserError(
            f"the paper's numbers are of {RESPONSE}, which study.responses does not name"
        )
    own = {name: one.sel(response=RESPONSE) for name, one in density.items()}
    peaks = {name: _peak(one) for name, one in own.items()}
    errors = {name: peak / peaks["mcm"] - 1.0 for name, peak in peaks.items() if name != "mcm"}
    rmse, rmse_n_runs = _rmse(accuracy.sel(response=RESPONSE))
    n_runs = {name: int(one["n_runs"]) for name, one in own.items()}
    deviations = {name: float(one["standard_deviation"]) for name, one in own.items()}

    def pair(theirs: Mapping[str, float], ours: Mapping[str, float], none: float) -> tuple:
        table = [[one.get(name, none) for name in names] for one in (theirs, ours)]
        return (("source", "method"), np.array(table))

    paper_runs = dict.fromkeys(PAPER_RMSE, PAPER_RMSE_N_RUNS)
    result = xr.Dataset(
        {
            "paper_peak": pair(PAPER_PEAK, peaks, np.nan),
            "paper_peak_error": pair(PAPER_PEAK_ERROR, errors, np.nan),
            "paper_rmse": pair(PAPER_RMSE, rmse, np.nan),
            "paper_rmse_n_runs": pair(paper_runs, rmse_n_runs, 0),
            "paper_n_runs": pair(PAPER_N_RUNS, n_runs, 0),
            "paper_deviation": pair({"mcm": PAPER_DEVIATION}, deviations, np.nan),
        },
        coords={"source": np.arange(len(SOURCES), dtype=np.int8), "method": names},
    )
    sigma = deviations["mcm"]
    reasons = {
        "paper_peak": _why_peak(own["mcm"], peaks["mcm"], sigma),
        "paper_peak_error": _why_peak_error(own, peaks, errors),
        "paper_rmse": _why_rmse(rmse, rmse_n_runs, sigma, n_runs["mcm"]),
        "paper_n_runs": _why_n_runs(design),
        "paper_deviation": (
            "the paper states none: theirs is that of a normal density with its peak; ours is "
            f"{sigma / PAPER_DEVIATION:.2f} times as large, at other gains, irregularity and "
            "car parameters, which the paper does not give in full"
        ),
    }
    for name, reason in reasons.items():
        result[name].attrs["why_different"] = reason
    result["paper_rmse"].attrs["comment"] = "the paper's number of the ASM is an upper bound"
    return result


def rows(table: xr.Dataset) -> list[dict[str, object]]:
    """The table as rows of a CSV file: one per quantity and method."""
    found: list[dict[str, object]] = []
    for name in table.data_vars:
        column = table[name]
        if name == "paper_rmse_n_runs":
            continue  # stands with the errors
        for method in table["method"].to_numpy().tolist():
            paper, ours = (float(one) for one in column.sel({"method": method}))
            if not any(value == value and value != 0 for value in (paper, ours)):
                continue
            found.append(
                {
                    "track": str(table.attrs.get("track", "")),
                    "quantity": column.attrs["long_name"],
                    "unit": column.attrs["units"],
                    "method": method,
                    "paper": _or_none(paper),
                    "ours": _or_none(ours),
                    "why different": column.attrs["why_different"],
                }
            )
    return found


def text(table: xr.Dataset, heading: str) -> str:
    """The table in Markdown, its reasons below it, once for each quantity."""
    found = rows(table)
    reasons = list(dict.fromkeys(str(row["why different"]) for row in found))
    body = [
        [
            f"{row['quantity']} [{row['unit']}]",
            str(row["method"]),
            *(number(row[key]) if row[key] != "" else "–" for key in ("paper", "ours")),
            f"({reasons.index(str(row['why different'])) + 1})",
        ]
        for row in found
    ]
    header = ["quantity", "method", "paper", "ours", "why different"]
    notes = "\n".join(f"{k}. {reason}." for k, reason in enumerate(reasons, start=1))
    return (
        f"# {heading}\n\n{markdown(header, body)}\nWhy different:\n\n{notes}\n\n{of_track(table)}\n"
    )


def _or_none(value: float) -> float | str:
    return value if value == value and value != 0 else ""


def _peak(density: xr.Dataset) -> float:
    """Peak of the GDEE, or of the direct density where there is none."""
    evolved = float(density["peak"])
    return evolved if np.isfinite(evolved) else float(density["peak_direct"])


def _lowered(density: xr.Dataset) -> float:
    """Relative reduction of a normal density's peak by a kernel of the file's bandwidth."""
    ratio = float(density["bandwidth"]) / float(density["standard_deviation"])
    return 1.0 - 1.0 / np.sqrt(1.0 + ratio**2)


def _noise(density: xr.Dataset) -> float:
    """Relative standard error of the peak of a kernel density of independent runs.

    References
    ----------
    Silverman, Density Estimation (1986), eq. 3.9, for a Gaussian kernel.
    """
    n, h = float(density["n_runs"]), float(density["bandwidth"])
    return float(1.0 / np.sqrt(2.0 * np.sqrt(np.pi) * n * h * float(density["peak_direct"])))


def _why_peak(density: xr.Dataset, peak: float, sigma: float) -> str:
    return (
        "a peak goes with one over the standard deviation: peak times deviation is "
        f"{peak * sigma:.3f} for ours and {_NORMAL_PEAK:.3f} for a normal density; our deviation "
        f"is {sigma:.3g} m, {sigma / PAPER_DEVIATION:.2f} times that behind the paper's peak"
    )


def _why_peak_error(
    own: Mapping[str, xr.Dataset], peaks: Mapping[str, float], errors: Mapping[str, float]
) -> str:
    baseline = own["mcm"]
    noise = _noise(baseline)
    kernels = "; ".join(f"{name} by {100 * _lowered(one):.1f} %" for name, one in own.items())
    within = [name for name, error in errors.items() if abs(error) <= 2.0 * noise]
    return (
        f"the peak of {int(baseline['n_runs'])} runs has itself a standard error of "
        f"{100 * noise:.1f} %, and the kernel lowers the peak of a normal density: {kernels}; "
        f"within two standard errors of the baseline lie: {', '.join(within) or 'none'}"
    )


def _why_rmse(
    rmse: Mapping[str, float], n_runs: Mapping[str, int], sigma: float, n_baseline: int
) -> str:
    ours = "; ".join(
        f"{name} {value / sigma:.3f} at {n_runs[name]} runs" for name, value in rmse.items()
    )
    return (
        f"over the standard deviation, on {n_baseline} runs of the baseline that are not in the "
        f"designs: {ours or 'none'}; the paper's OSM has "
        f"{PAPER_RMSE['osm'] / PAPER_DEVIATION:.1f} deviations of its own, more than the 1 of no "
        "surrogate at all, its ASM less than "
        f"{PAPER_RMSE['asm_paper'] / PAPER_DEVIATION:.2f}; our one-stage set is a GF set, the "
        "paper does not say on which samples it judges"
    )


def _why_n_runs(designs: Mapping[str, xr.Dataset]) -> str:
    said = []
    for name, design in designs.items():
        n, n_lost = design.sizes["sample"], int(np.count_nonzero(lost(design)))
        ended = DECISIONS[int(design["decision"][-1])].replace("_", " ")
        why = f"ended by: {ended}" if design.sizes["round"] > 1 else "one stage"
        said.append(f"{name} {n} runs, {n_lost} of them lost, {why}")
    return "one set of runs serves all responses here, in the paper one response: " + "; ".join(
        said
    )


def _rmse(accuracy: xr.Dataset) -> tuple[dict[str, float], dict[str, int]]:
    """Errors at the step nearest to the paper's number of runs, and the number of that step."""
    errors, numbers = {}, {}
    for method in accuracy["method"].to_numpy().tolist():
        n_runs = accuracy["step_n_runs"].sel({"method": method}).to_numpy()
        found = accuracy["step_rmse"].sel({"method": method}).to_numpy()
        known = np.flatnonzero((n_runs > 0) & np.isfinite(found))
        if known.size:
            best = known[np.argmin(np.abs(n_runs[known] - PAPER_RMSE_N_RUNS))]
            errors[method] = float(found[best])
            numbers[method] = int(n_runs[best])
    return errors, numbers


def table(found: xr.Dataset) -> tuple[list[dict[str, object]], str]:
    """Rows and text of the table of a case."""
    heading = f"What survives of the paper, and ours, case '{found.attrs['case']}'"
    return rows(found), text(found, heading)


STAGE = Stage(
    name="paper_and_ours",
    of="case",
    reads=(),
    inputs={
        "density": Input("density", by=("method",)),
        "design": Input("design", by=("method",)),
        "accuracy": Input("accuracy"),
    },
    layout="paper_and_ours",
    compute=dataset,
    table=table,
)
