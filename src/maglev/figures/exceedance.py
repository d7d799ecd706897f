"""Exceedance of the extremes of a case by every method, with the limit states on it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from maglev.errors import UserError
from maglev.figures import curves, labels, style

_ENDS = ("", "_low", "_high")
_LIMIT = "#CC79A7"
"""Colour of limits, which no method has."""

_LINE = 0.07
"""Height of a line of text over that of a panel."""

_WITHIN = 3.0
"""Widths of the curves within which a limit still widens a panel; one farther off is written."""


def figure(
    densities: Sequence[xr.Dataset], limit_states: Sequence[xr.Dataset]
) -> tuple[Figure, xr.Dataset]:
    """Draw the exceedance of every response, its limits, and their probability by each method.

    Parameters
    ----------
    densities
        Layout ``density``, of the methods of one case.
    limit_states
        Layout ``limit_states``, of the same methods in the same order.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.

    Raises
    ------
    UserError
        If the files are of other methods or limit states.
    """
    methods = [labels.method_of(one) for one in densities]
    if methods != [labels.method_of(one) for one in limit_states]:
        raise UserError("figure exceedance: densities and limit states must be of the same methods")
    found = _with_states(curves.densities(densities), limit_states)
    floor = _floor(found)
    fig, panels = labels.response_panels(found, 5.0)
    for response, axis, shown in panels:
        at = found.isel(response=response)
        for number, name in enumerate(methods):
            one = at.isel(curve=number)
            value = shown.scale * one["curve_value"]
            colour = labels.METHOD_STYLE[name]["color"]
            band = [one[f"curve_exceedance{end}"].clip(min=floor) for end in _ENDS[1:]]
            axis.fill_between(value, band[0], band[1], color=colour, alpha=0.12, lw=0)
            axis.plot(
                value,
                one["curve_exceedance"].where(one["curve_exceedance"] > 0),
                **labels.method_line(name),
                label=labels.of_runs(
                    labels.PDEM[name], one["curve_n_runs"], one["curve_lost_probability"]
                ),
            )
        axis.set_yscale("log")
        low, high = curves.body(found, response, 1e-3)
        axis.set_xlim(shown.scale * low, shown.scale * high)
        name = str(found["response"].to_numpy()[response])
        of_response = found.sel(limit_state=found["state_response"] == name)
        n_lines = _draw_limits(axis, of_response, shown, methods)
        _leave_room(axis, floor, n_lines)
        axis.locator_params(axis="x", nbins=5)
        axis.set_xlabel(shown.axis)
        if response % labels.COLUMNS == 0:
            axis.set_ylabel("probability of exceedance [-]")
    title = f"bands and brackets: {labels.confidence(densities[0])} intervals"
    style.below(fig, *panels[0][1].get_legend_handles_labels(), columns=2, title=title)
    return fig, found


def _with_states(found: xr.Dataset, limit_states: Sequence[xr.Dataset]) -> xr.Dataset:
    """The curves with the limit states and their probabilities by each method."""
    first = limit_states[0]
    if any(not one["limit_state"].equals(first["limit_state"]) for one in limit_states):
        raise UserError("figure exceedance: limit states differ; compute them again")
    for name in ("definition", "state_response", "threshold"):
        found[name] = first[name]
    for end in _ENDS:
        values = np.stack([one[f"probability{end}"].to_numpy() for one in limit_states])
        found[f"curve_state_probability{end}"] = (("curve", "limit_state"), values)
    return found


def _floor(found: xr.Dataset) -> float:
    """Smallest probability of the panels: below the rarest that a sample resolves."""
    exceedance = found["curve_exceedance"].to_numpy()
    return 0.7 * float(exceedance[exceedance > 0].min())


def _leave_room(axis: Axes, floor: float, n_lines: int) -> None:
    """Let probabilities end below some lines of text at the top of a panel."""
    share = min(0.03 + _LINE * n_lines, 0.7)
    decades = -np.log10(floor)
    axis.set_ylim(floor, 10.0 ** (0.08 * decades + decades * share / (1.0 - share)))
    axis.set_yticks([10.0**-k for k in range(int(decades) + 1)])
    axis.minorticks_off()


def _draw_limits(axis: Axes, states: xr.Dataset, shown: labels.Shown, methods: list[str]) -> int:
    """Draw the limits of a response, write their probability by each method; number of lines."""
    lines: list[tuple[str, str]] = []
    for number in range(states.sizes["limit_state"]):
        state = states.isel(limit_state=number)
        limit = shown.scale * float(state["threshold"])
        low, high = axis.get_xlim()
        if low <= limit <= high + _WITHIN * (high - low):
            axis.set_xlim(low, max(high, limit + 0.05 * (limit - low)))
            axis.axvline(limit, color=_LIMIT, lw=0.9, ls=":")
        inside = low <= limit <= axis.get_xlim()[1]
        value = f"{limit:.4g} {shown.unit.replace('-', '')}".rstrip()
        words = f"{state['limit_state'].item()}, {value}"
        lines.append((words if inside else f"← {words}" if limit < low else f"{words} →", _LIMIT))
        for curve, method in enumerate(methods):
            one = state.isel(curve=curve)
            ends = [float(one[f"curve_state_probability{end}"]) for end in _ENDS]
            colour = labels.METHOD_STYLE[method]["color"]
            lines.append((f"{labels.METHOD[method]} {_interval(*ends)}", colour))
            if inside and ends[0] > 0:
                axis.plot([limit], ends[:1], "o", ms=3, color=colour, zorder=4)
    for row, (words, colour) in enumerate(lines):
        axis.text(
            0.99,
            0.99 - _LINE * row,
            words,
            color=colour,
            transform=axis.transAxes,
            ha="right",
            va="top",
            fontsize=5.5,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.7, "pad": 0.3},
            zorder=5,
        )
    return len(lines)


def _interval(value: float, low: float, high: float) -> str:
    """A probability with its interval in per cent."""
    ends = (
        np.format_float_positional(float(f"{100 * one:.3g}"), trim="-")
        for one in (value, low, high)
    )
    return "P = {} [{}, {}] %".format(*ends)
