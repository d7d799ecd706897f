"""Density of one response by every method, and its peaks with their sampling noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from maglev.errors import UserError
from maglev.figures import curves, labels, style

_RESPONSE = "girder_displacement_z"
"""The response of the paper's figure; the first of the files where they have it not."""


def figure(densities: Sequence[xr.Dataset]) -> tuple[Figure, xr.Dataset]:
    """Draw the densities, the baseline with its band, and a table of their peaks.

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
    peak = found["curve_peak"]
    names = found["response"].to_numpy().tolist()
    response = names.index(_RESPONSE) if _RESPONSE in names else 0
    shown = labels.shown(names[response])
    found["curve_peak_error"] = peak / peak.isel(curve=truth) - 1.0

    fig = Figure(figsize=(style.PAGE, 2.9), layout="constrained")
    axis, table = fig.subplots(1, 2, width_ratios=[1.0, 1.05])
    looks: list[style.Look] = [
        {**labels.METHOD_STYLE[name], "label": labels.PDEM[name], "lw": 1.6 - 0.3 * (name != "mcm")}
        for name in methods
    ]
    curves.draw_densities(axis, found, response, looks, curves.body(found, response, 2e-3))
    style.titled(axis, "a", shown.name)

    at = found.isel(response=response)
    rows = [
        [
            "",
            "runs",
            f"peak\n[1/{shown.unit}]" if shown.unit == "mm" else "peak",
            "error\nof peak",
            "lost",
            "width",
        ]
    ]
    best = int(np.nanargmax(at["curve_density"].isel(curve=truth)))
    upper, middle = (
        float(at[name].isel(curve=truth, cell=best))
        for name in ("curve_density_high", "curve_density")
    )
    noise = upper / middle - 1.0
    for number, name in enumerate(methods):
        one = at.isel(curve=number)
        error = (
            f"± {100 * noise:.1f} %"
            if number == truth
            else f"{100 * float(one['curve_peak_error']):+.1f} %"
        )
        evolved = not np.isfinite(one["curve_density_high"]).any() and name != "mcm"
        wide = shown.scale * float(one["curve_width"])
        size = f"{1e3 * wide:.2g} µm" if shown.unit == "mm" else f"{wide:.2g} {shown.unit}"
        width = f"{'Δz' if evolved else 'h'} {size}"
        rows.append(
            [
                labels.PDEM[name].replace(" (", "\n("),
                f"{int(one['curve_n_runs'])}",
                f"{float(one['curve_peak']) / shown.scale:.3g}",
                error,
                labels.percent(float(one["curve_lost_probability"])),
                width,
            ]
        )
    style.table(
        table,
        rows,
        (0.0, 0.24, 0.37, 0.51, 0.67, 0.82),
        [look["color"] for look in looks],
        0.155,
    )
    style.titled(table, "b", "peaks against the noise of MCM")
    table.text(
        0.0,
        0.0,
        f"band and ±: {labels.confidence(densities[truth])} sampling noise of MCM; "
        "h: bandwidth of the kernel;\n"
        "Δz: mesh of the GDEE, which acts as a bandwidth",
        transform=table.transAxes,
        fontsize=6.5,
        va="bottom",
    )
    axis.set_ylim(top=1.25 * axis.get_ylim()[1])
    axis.legend(loc="upper left", fontsize=6.5, ncols=2)
    return fig, found
