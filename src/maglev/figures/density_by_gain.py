"""Densities of the six extremes with each gain random alone, and with all of them."""

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
        name, look = labels.case_style(labels.gains_of(design))
        looks.append(look)
        lost = labels.percent(float(one["lost_probability"]))
        words.append(f"{name}, {int(one['n_runs'])} runs, lost {lost}")
    fig, axes = style.panels(2, 3, style.PAGE, 4.7)
    for response, axis in enumerate(axes):
        curves.draw_densities(axis, found, response, looks)
        low, high = curves.body(found, response, 5e-3)
        scale = labels.SHOWN[response].scale
        axis.set_xlim(scale * low, scale * high)
        style.titled(axis, "abcdef"[response], labels.SHOWN[response].name)
    variation, n_spans = labels.settings(designs[0])
    style.below(
        fig,
        axes[0].get_lines(),
        words,
        ncols=3,
        title=f"random ({n_spans} spans, coefficient of variation {variation:.2f})",
        title_fontsize=7,
    )
    return fig, found
