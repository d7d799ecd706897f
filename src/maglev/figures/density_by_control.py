"""Densities of the extremes for each sharing of circuits, and with lag."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

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
    words = []
    looks: list[style.Look] = []
    for one, design in zip(densities, designs, strict=True):
        name, look = labels.control_style(design)
        looks.append(look)
        words.append(labels.of_runs(name, one["n_runs"], one["lost_probability"]))
    fig, panels = labels.response_panels(found, 4.7)
    for response, axis, _ in panels:
        far = curves.apart(found, response)
        near = found.isel(curve=~far)
        near_looks = [look for look, away in zip(looks, far, strict=True) if not away]
        curves.draw_densities(axis, near, response, near_looks, curves.body(near, response, 5e-3))
        for k in np.flatnonzero(far):
            curves.note_apart(axis, found.isel(curve=[k]), response, looks[k])
    style.below(
        fig,
        [Line2D([], [], **look) for look in looks],
        words,
        columns=2,
        title=f"gains {labels.of_settings(designs[0])}",
    )
    return fig, found
