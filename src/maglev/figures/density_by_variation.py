"""Densities of the extremes for growing coefficients of variation of the gains."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from maglev.figures import curves, labels, style

_TAILS = (5e-3, 1e-2, 2e-2, 4e-2)
"""Shares of a density that may lie off the panel on either side [-]."""

_NARROWEST = 0.1
"""Width of the narrowest density over that of the panel, at least [-]."""


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
        span = _span(found, response)
        curves.draw_densities(axis, found, response, looks, span)
        _say_strays(axis, found.isel(response=response), span, shown)
    n_spans = labels.settings(designs[0])[1]
    style.below(
        fig,
        panels[0][1].get_lines(),
        words,
        columns=3,
        title=f"coefficient of variation of the gains ({n_spans} spans)",
    )
    return fig, found


def _span(found: xr.Dataset, response: int) -> tuple[float, float]:
    """Range of a panel, with as much of the tails as leaves the narrowest density its width."""
    for tail in _TAILS:
        low, high = curves.body(found, response, tail)
        ends = [
            curves.body(found.isel(curve=[k]), response, 0.05) for k in range(found.sizes["curve"])
        ]
        if min(end - start for start, end in ends) > _NARROWEST * (high - low):
            break
    return low, high


def _say_strays(axis: Axes, at: xr.Dataset, span: tuple[float, float], shown: labels.Shown) -> None:
    """Note how much of the widest density lies off the panel, and how far it reaches."""
    held = at["curve_exceedance"] - at["curve_lost_probability"]
    inside = at["curve_value"].where((held > 1e-9) & (held < held.max("cell") - 1e-9))
    least, most = inside.min("cell").to_numpy(), inside.max("cell").to_numpy()
    k = int(np.argmax(most - least))
    share = np.interp(span, at["curve_value"][k], held[k])  # beyond either end
    margin = 0.25 * (span[1] - span[0])
    low, high = (f"{shown.scale * one[k]:.3g}" for one in (least, most))
    below, beyond = float(held[k].max()) - share[0], share[1]
    words = {
        (True, True): f"{labels.percent(below + beyond)} off the panel,\nfrom {low} to {high}",
        (True, False): f"{labels.percent(below)} below,\ndown to {low}",
        (False, True): f"{labels.percent(beyond)} beyond,\nup to {high}",
    }
    reaches = (bool(least[k] < span[0] - margin), bool(most[k] > span[1] + margin))
    if any(reaches):
        axis.set_ylim(top=1.3 * axis.get_ylim()[1])  # the note stands above the curves
        variation = float(at["curve_variation"][k])
        style.note(axis, f"at {variation:.2f}: {words[reaches]} {shown.unit}")
