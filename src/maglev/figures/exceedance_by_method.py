"""Probability of exceedance of the extremes by every method, as far as the runs resolve it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from maglev.errors import UserError
from maglev.figures import curves, labels, style


def figure(densities: Sequence[xr.Dataset]) -> tuple[Figure, xr.Dataset]:
    """Draw the exceedance of the responses, the baseline with its band.

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
        raise UserError("figure exceedance_by_method: there is no baseline among the densities")
    found = curves.densities(densities)
    truth = methods.index("mcm")
    n = int(found["curve_n_runs"][truth])
    fig, panels = labels.response_panels(found, 4.6)
    for response, axis, shown in panels:
        at = found.isel(response=response)
        for number, name in enumerate(methods):
            one = at.isel(curve=number)
            value = shown.scale * one["curve_value"]
            if number == truth:
                axis.fill_between(
                    value,
                    one["curve_exceedance_low"].clip(min=1e-9),
                    one["curve_exceedance_high"],
                    color="#000000",
                    alpha=0.15,
                    lw=0,
                    label=f"MCM, {labels.confidence(densities[truth])} interval"
                    if response == 0
                    else None,
                )
            axis.plot(
                value,
                one["curve_exceedance"].where(one["curve_exceedance"] > 0),
                **labels.METHOD_STYLE[name],
                label=labels.of_runs(
                    labels.PDEM[name], one["curve_n_runs"], one["curve_lost_probability"]
                ),
            )
        axis.set_yscale("log")
        axis.set_ylim(0.7 / n, 1.3)
        baseline = at.isel(curve=truth)
        held = (baseline["curve_exceedance"] - baseline["curve_lost_probability"]).to_numpy()
        values = baseline["curve_value"].to_numpy()
        inside = values[(held < 0.999 * held.max()) & (held > 1.5 / n)]
        margin = 0.05 * np.ptp(inside)
        axis.set_xlim(shown.scale * (inside.min() - margin), shown.scale * (inside.max() + margin))
        axis.locator_params(axis="x", nbins=5)
        axis.set_xlabel(shown.axis)
        if response % labels.COLUMNS == 0:
            axis.set_ylabel("probability of exceedance [-]")
    style.below(fig, *panels[0][1].get_legend_handles_labels(), columns=3)
    return fig, found
