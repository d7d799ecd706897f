"""Densities of the extremes of a case by every method, over each other."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr
from matplotlib.figure import Figure

from maglev.figures import curves, labels, style

_TAIL = 2e-3
"""Share of a density on either side that may lie off its panel."""


def figure(densities: Sequence[xr.Dataset]) -> tuple[Figure, xr.Dataset]:
    """Draw the density of every response by each method, that of a baseline with its band.

    Parameters
    ----------
    densities
        Layout ``density``, of the methods of one case.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    methods = [labels.method_of(one) for one in densities]
    found = curves.densities(densities)
    looks: list[style.Look] = [
        {
            **labels.method_line(name),
            "label": labels.of_runs(labels.PDEM[name], one["n_runs"], one["lost_probability"]),
        }
        for name, one in zip(methods, densities, strict=True)
    ]
    fig, panels = labels.response_panels(found, 4.6)
    for response, axis, _ in panels:
        span = curves.body(found, response, _TAIL)
        curves.draw_densities(axis, found, response, looks, span)
        axis.locator_params(axis="x", nbins=4)
    band = "band: {} sampling noise of MCM" if "mcm" in methods else ""
    style.below(
        fig,
        *panels[0][1].get_legend_handles_labels(),
        columns=2,
        title=band.format(labels.confidence(densities[0])),
    )
    return fig, found
