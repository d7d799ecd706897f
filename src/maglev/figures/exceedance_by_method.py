"""Probability of exceedance of the extremes by every method, as far as the runs resolve it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from maglev.errors import UserError
from maglev.figures import curves, labels, style

_HELD = 0.45
"""Width of lines given that levitation holds [pt]."""


def figure(densities: Sequence[xr.Dataset]) -> tuple[Figure, xr.Dataset]:
    """Draw the exceedance of the responses, the baseline with its band.

    Thin lines are the exceedance given that levitation holds; the other ones end in the
    probability that levitation is lost.

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
    found["curve_held_exceedance"] = curves.held_exceedance(found)
    baseline = found.isel(curve=methods.index("mcm"))
    n = int(baseline["curve_n_runs"])
    fig, panels = labels.response_panels(found, 5.0)
    for response, axis, shown in panels:
        at = found.isel(response=response)
        _draw_band(axis, baseline.isel(response=response), shown.scale)
        for number, name in enumerate(methods):
            _draw_curve(axis, at.isel(curve=number), name, shown.scale)
        axis.set_yscale("log")
        axis.set_ylim(0.7 / n, 1.3)
        low, high = _span(found, methods.index("mcm"), response)
        axis.set_xlim(shown.scale * low, shown.scale * high)
        _name_plateau(axis, float(baseline["curve_lost_probability"]))
        axis.locator_params(axis="x", nbins=5)
        axis.set_xlabel(shown.axis)
        if response % labels.COLUMNS == 0:
            axis.set_ylabel("probability of exceedance [-]")
    handles, words = panels[0][1].get_legend_handles_labels()
    handles.append(Line2D([], [], color=style.QUIET, lw=_HELD))
    words.append("thin: given that levitation holds")
    title = f"band: {labels.confidence(densities[methods.index('mcm')])} interval of MCM"
    style.below(fig, handles, words, columns=3, title=title)
    return fig, found


def _draw_band(axis: Axes, baseline: xr.Dataset, scale: float) -> None:
    """Draw the interval of the exceedance by the baseline."""
    low, high = (baseline[f"curve_exceedance_{end}"].clip(min=1e-9) for end in ("low", "high"))
    axis.fill_between(scale * baseline["curve_value"], low, high, color="#000000", alpha=0.15, lw=0)


def _draw_curve(axis: Axes, one: xr.Dataset, method: str, scale: float) -> None:
    """Draw the exceedance by one method, and a thin line given that levitation holds."""
    value, lost = scale * one["curve_value"], one["curve_lost_probability"]
    words = labels.of_runs(labels.PDEM[method], one["curve_n_runs"], lost)
    exceedance, held = (
        one[name].where(one[name] > 0) for name in ("curve_exceedance", "curve_held_exceedance")
    )
    axis.plot(value, exceedance, **labels.method_line(method), label=words)
    thin: style.Look = {**labels.METHOD_STYLE[method], "lw": _HELD}
    axis.plot(value, held, **thin)


def _span(found: xr.Dataset, truth: int, response: int) -> tuple[float, float]:
    """First and last value at which the exceedance by the baseline says anything."""
    baseline = found.isel(curve=truth, response=response)
    held = (baseline["curve_exceedance"] - baseline["curve_lost_probability"]).to_numpy()
    resolved = held > 1.5 / int(baseline["curve_n_runs"])
    inside = baseline["curve_value"].to_numpy()[(held < 0.999 * held.max()) & resolved]
    if inside.size < 2:
        return curves.body(found.isel(curve=[truth]), response, 0.1)
    margin = 0.05 * np.ptp(inside)
    return float(inside.min() - margin), float(inside.max() + margin)


def _name_plateau(axis: Axes, lost: float) -> None:
    """Write the probability that levitation is lost where the curves level out at it."""
    if lost > axis.get_ylim()[0]:
        axis.axhline(lost, color="#000000", lw=0.5, ls=":")
        words = f"P(lost) = {labels.percent(lost)}"
        axis.annotate(
            words,
            (0.02, lost),
            xycoords=("axes fraction", "data"),
            xytext=(0, 2),
            textcoords="offset points",
            fontsize=6.5,
        )
