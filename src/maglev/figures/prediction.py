"""Predicted against computed extremes of every run of the baseline."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from maglev.figures import labels, style
from maglev.vocabulary import METHODS


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw a row of six panels per method, runs as a density of points about the diagonal.

    Parameters
    ----------
    data
        Layout ``prediction``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    methods = [METHODS[code] for code in data["method"].to_numpy()]
    held = data["status"].to_numpy() == 0
    fig = Figure(figsize=(style.PAGE, 1.6 + 0.93 * len(methods)), layout="constrained")
    axes = fig.subplots(len(methods), len(labels.SHOWN), squeeze=False, sharex="col", sharey="col")
    drawn = None
    for row in range(len(methods)):
        for response, shown in enumerate(labels.SHOWN):
            axis = axes[row, response]
            computed = shown.scale * data["computed"].to_numpy()[held, response]
            predicted = shown.scale * data["predicted_by"].to_numpy()[row, held, response]
            low, high = np.quantile(computed, [0.0, 0.999])
            margin = 0.15 * (high - low)
            ends = (low - margin, high + margin)
            axis.plot(ends, ends, color="#000000", lw=0.5, zorder=3)
            drawn = axis.hexbin(
                computed,
                predicted,
                gridsize=36,
                extent=(*ends, *ends),
                norm=LogNorm(1, max(10, held.sum() / 20)),
                mincnt=1,
                cmap="viridis",
                linewidths=0.1,
                rasterized=True,
            )
            axis.set(xlim=ends, ylim=ends, box_aspect=1)
            axis.locator_params(axis="x", nbins=2)
            axis.locator_params(axis="y", nbins=3)
            axis.tick_params(labelsize=6)
            axis.tick_params(axis="x", labelrotation=45)
            error = float(data["prediction_rmse"][row, response])
            style.note(axis, f"{error:.2f} σ", top=False)
            if row == 0:
                axis.set_title(f"{shown.name.replace(' ', chr(10), 1)}", fontsize=6)
            if row == len(methods) - 1:
                axis.set_xlabel(f"computed [{shown.unit}]", fontsize=6)
    for row, method in enumerate(methods):
        n_runs = int(data["method_n_runs"][row])
        axes[row, 0].set_ylabel(f"{labels.METHOD[method]}\n{n_runs} runs\npredicted", fontsize=7)
    fig.suptitle(
        "predicted against computed extremes; in the corners RMSE over the standard deviation",
        fontsize=8,
    )
    assert drawn is not None
    fig.colorbar(
        drawn, ax=axes, location="bottom", shrink=0.4, aspect=40, pad=0.02, label="runs in a cell"
    )
    return fig, data
