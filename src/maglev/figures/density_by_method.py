"""Densities of midspan's motions by every method, and their peaks with their sampling noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from maglev.errors import UserError
from maglev.figures import curves, labels, style

_SHOWN = ("girder_displacement_z", "girder_acceleration_z")
"""The responses of the paper's figure; the first two of the files where they have not both."""


def figure(densities: Sequence[xr.Dataset]) -> tuple[Figure, xr.Dataset]:
    """Draw the densities, the baseline with its band, each above a table of its peaks.

    Parameters
    ----------
    densities
        Layout ``density``, of the methods of one case.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.

    Raises
    ------
    UserError
        If there is no baseline among them.
    """
    methods = [labels.method_of(one) for one in densities]
    if "mcm" not in methods:
        raise UserError("figure density_by_method: there is no baseline among the densities")
    found = curves.densities(densities)
    truth = methods.index("mcm")
    found["curve_peak_error"] = found["curve_peak"] / found["curve_peak"].isel(curve=truth) - 1.0
    names = found["response"].to_numpy().tolist()
    chosen = _SHOWN if set(_SHOWN) <= set(names) else tuple(names[:2])
    looks: list[style.Look] = [
        {**labels.method_line(name), "label": labels.PDEM[name]} for name in methods
    ]
    fig = Figure(figsize=(style.PAGE, 4.9), layout="constrained")
    axes = fig.subplots(2, len(chosen), height_ratios=[1.0, 0.8], squeeze=False)
    for column, name in enumerate(chosen):
        response = names.index(name)
        axis, below = axes[:, column]
        span = curves.body(found, response, 2e-3)
        curves.draw_densities(axis, found, response, looks, span)
        shown = labels.shown(name)
        style.titled(axis, "ab"[column], shown.name)
        _table(below, found.isel(response=response), methods, shown)
    handles, words = axes[0, 0].get_legend_handles_labels()
    style.below(
        fig,
        handles,
        words,
        columns=len(methods),
        title=f"band and ±: {labels.confidence(densities[truth])} sampling noise of MCM; "
        "h: bandwidth of the kernel; Δz: mesh of the GDEE, which acts as a bandwidth",
    )
    return fig, found


def _table(axis: Axes, at: xr.Dataset, methods: Sequence[str], shown: labels.Shown) -> None:
    """Write the peaks of one response by each method, and their errors, in place of a panel."""
    unit = shown.density_axis.removeprefix("density ")
    rows = [["", "runs", f"peak\n{unit}", "error\nof peak", "lost", "width"]]
    for number, name in enumerate(methods):
        one = at.isel(curve=number)
        error = 100 * float(one["curve_peak_error"])
        rows.append(
            [
                labels.PDEM[name].replace(" (", "\n("),
                f"{int(one['curve_n_runs'])}",
                f"{float(one['curve_peak']) / shown.scale:.3g}",
                f"± {100 * _noise(one):.1f} %" if name == "mcm" else f"{error:+.1f} %",
                labels.percent(float(one["curve_lost_probability"])),
                _width(one, name, shown),
            ]
        )
    colours = [labels.METHOD_STYLE[name]["color"] for name in methods]
    style.table(axis, rows, (0.0, 0.24, 0.365, 0.5, 0.64, 0.765), colours, 0.17)


def _noise(baseline: xr.Dataset) -> float:
    """Half the width of the band of a density at its peak, over the peak [-]."""
    best = int(np.nanargmax(baseline["curve_density"]))
    upper, middle = (
        float(baseline[name][best]) for name in ("curve_density_high", "curve_density")
    )
    return upper / middle - 1.0


def _width(one: xr.Dataset, method: str, shown: labels.Shown) -> str:
    """Bandwidth of a direct density, or mesh of one by the GDEE, in a thousandth of the unit."""
    evolved = method != "mcm" and not np.isfinite(one["curve_density_high"]).any()
    value = 1e3 * shown.scale * float(one["curve_width"])
    unit = {"mm": "µm", "m/s²": "mm/s²"}.get(shown.unit, f"1e-3 {shown.unit}")
    return f"{'Δz' if evolved else 'h'} {value:.2g} {unit}"
