"""Sobol' indices of the surrogate: the effect of each random quantity on each response."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from maglev.figures import labels, style


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw first-order and total indices of every quantity and response with their intervals.

    Parameters
    ----------
    data
        Layout ``surrogate``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    keys = labels.parameters_of(data)
    row = np.arange(len(keys))[::-1]
    colours = [labels.parameter_colour(key) for key in keys]
    fig, panels = labels.response_panels(data, 3.9 * max(1.0, len(keys) / 6))
    for response, axis, _ in panels:
        at = data.isel(response=response)
        for name, shift, filled in (("sobol_first", 0.2, True), ("sobol_total", -0.2, False)):
            middle = at[name].to_numpy()
            low, high = (at[f"{name}_{end}"].to_numpy() for end in ("low", "high"))
            reach = np.abs([middle - low, high - middle])
            axis.barh(
                row + shift,
                middle,
                height=0.36,
                color=colours if filled else "white",
                edgecolor=colours,
                lw=0.8,
                xerr=reach,
                error_kw={"elinewidth": 0.8, "capsize": 1.5, "ecolor": "#000000"},
            )
        axis.set_yticks(row, [labels.parameter_name(key) for key in keys])
        axis.grid(visible=False, axis="y")
        axis.set_xlim(0, 1.05)
        error = float(at["leave_one_out_error"])
        axis.annotate(
            f"surrogate's error {error:.2f} σ",
            (0.98, 0.03),
            xycoords="axes fraction",
            ha="right",
            fontsize=6.5,
        )
        if response % labels.COLUMNS:
            axis.set_yticklabels([])
        if labels.lowest(response, data):
            axis.set_xlabel("share of the variance [-]")
    handles = [
        Patch(facecolor=style.QUIET, edgecolor=style.QUIET),
        Patch(facecolor="white", edgecolor=style.QUIET),
    ]
    confidence = labels.confidence(data)
    words = ["first order: the quantity alone", "total: with all its interactions"]
    style.below(
        fig,
        handles,
        words,
        columns=2,
        title=f"bars: {confidence} intervals of the sampling, without the surrogate's error",
    )
    shown = [name for name in data.data_vars if str(name).startswith("sobol")]
    return fig, data[[*shown, "leave_one_out_error"]]
