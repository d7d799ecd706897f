"""Densities of the extremes with each gain random alone, and with all of them."""

from __future__ import annotations

from collections.abc import Sequence

import xarray as xr
from matplotlib.figure import Figure

from maglev.figures import curves, labels, style


def figure(
    densities: Sequence[xr.Dataset], designs: Sequence[xr.Dataset]
) -> tuple[Figure, xr.Dataset]:
    """Draw the densities, a curve per case.

    Parameters
    ----------
    densities
        Layout ``density``, one per case.
    designs
        Layout ``design`` (or ``runs`` of a baseline), of the same cases in the same order.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    found = curves.densities(densities)
    looks, words = [], []
    for one, design in zip(densities, designs, strict=True):
        name, look = labels.case_style(labels.parameters_of(design))
        looks.append(look)
        words.append(labels.of_runs(name, one["n_runs"], one["lost_probability"]))
    fig, panels = labels.response_panels(found, 4.7)
    for response, axis, _ in panels:
        curves.draw_densities(axis, found, response, looks, curves.body(found, response, 5e-3))
    style.below(
        fig,
        panels[0][1].get_lines(),
        words,
        columns=3,
        title=labels.of_settings(designs[0]),
    )
    return fig, found
