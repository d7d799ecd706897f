"""Predicted against computed extremes of every run of the baseline."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from maglev.figures import labels, style

_COLUMNS = 6
"""Panels side by side."""


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw a row of panels per method, runs as a density of points about the diagonal.

    Parameters
    ----------
    data
        Layout ``prediction``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    methods = data["method"].to_numpy().tolist()
    held = data["status"].to_numpy() == 0
    every = [labels.shown(str(one)) for one in data["response"].to_numpy()]
    columns = min(_COLUMNS, len(every))
    blocks = -(-len(every) // columns)
    n_rows = blocks * len(methods)
    fig = Figure(figsize=(style.PAGE, 1.6 + 0.93 * n_rows), layout="constrained")
    axes = fig.subplots(n_rows, columns, squeeze=False)
    for axis in axes[-len(methods) :, len(every) - columns * (blocks - 1) :].ravel():
        axis.remove()
    drawn = None
    for row in range(len(methods)):
        for response, shown in enumerate(every):
            block, column = divmod(response, columns)
            axis = axes[block * len(methods) + row, column]
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
            axis.tick_params(axis="x", labelrotation=45, labelbottom=row == len(methods) - 1)
            error = float(data["prediction_rmse"][row, response])
            style.note(axis, f"{error:.2f} σ", top=False)
            if row == 0:
                axis.set_title(f"{shown.name.replace(' ', chr(10), 1)}", fontsize=6)
            if row == len(methods) - 1:
                axis.set_xlabel(f"computed [{shown.unit}]", fontsize=6)
    for number, method in enumerate(blocks * methods):
        n_runs = int(data["method_n_runs"][number % len(methods)])
        axes[number, 0].set_ylabel(f"{labels.METHOD[method]}\n{n_runs} runs\npredicted", fontsize=7)
    fig.suptitle(
        "predicted against computed extremes; in the corners RMSE over the standard deviation",
        fontsize=8,
    )
    assert drawn is not None
    fig.colorbar(
        drawn,
        ax=fig.axes,
        location="bottom",
        shrink=0.4,
        aspect=40,
        pad=0.02,
        label="runs in a cell",
    )
    return fig, data
