"""Densities of the extremes for growing coefficients of variation of the gains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from maglev.figures import curves, labels, style


def figure(
    densities: Sequence[xr.Dataset], designs: Sequence[xr.Dataset]
) -> tuple[Figure, xr.Dataset]:
    """Draw the densities, a curve per coefficient of variation, and note the mass off the panel.

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
    variations = np.array([labels.settings(design)[0] for design in designs])
    order = np.argsort(variations, kind="stable")
    found = curves.densities([densities[k] for k in order])
    found["curve_variation"] = ("curve", variations[order])
    colours = colormaps["viridis"](np.linspace(0.0, 0.88, order.size))
    looks: list[style.Look] = [
        {"color": "#" + "".join(f"{round(255 * part):02x}" for part in colour[:3])}
        for colour in colours
    ]
    words = [
        labels.of_runs(f"{variation:.2f}", n, lost)
        for variation, n, lost in zip(
            variations[order], found["curve_n_runs"], found["curve_lost_probability"], strict=True
        )
    ]
    fig, panels = labels.response_panels(found, 4.7)
    for response, axis, shown in panels:
        curves.draw_densities(axis, found, response, looks)
        low, high = curves.body(found, response, 5e-3)
        axis.set_xlim(shown.scale * low, shown.scale * high)
        _say_strays(axis, found.isel(response=response), high, shown)
    n_spans = labels.settings(designs[0])[1]
    style.below(
        fig,
        panels[0][1].get_lines(),
        words,
        columns=3,
        title=f"coefficient of variation of the gains ({n_spans} spans)",
    )
    return fig, found


def _say_strays(axis: Axes, at: xr.Dataset, high: float, shown: labels.Shown) -> None:
    """Note how much of the widest density lies right of the panel, and how far it reaches."""
    held = at["curve_exceedance"] - at["curve_lost_probability"]
    farthest = at["curve_value"].where(held > 1e-9).max("cell")
    most = int(np.argmax(farthest.to_numpy()))
    reach = float(farthest[most])
    low = axis.get_xlim()[0] / shown.scale
    if reach > high + 0.25 * (high - low):
        axis.set_ylim(top=1.3 * axis.get_ylim()[1])  # the note stands above the curves
        beyond = float(np.interp(high, at["curve_value"][most], held[most]))
        variation = float(at["curve_variation"][most])
        style.note(
            axis,
            f"at {variation:.2f}: {labels.percent(beyond)} beyond,\n"
            f"up to {shown.scale * reach:.3g} {shown.unit}",
        )
