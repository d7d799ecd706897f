"""Densities, exceedances and limits of several files: collect them and draw them as curves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from maglev.arrays import BoolArray, FloatArray
from maglev.datasets import VARIABLES
from maglev.errors import UserError
from maglev.figures import labels, style
from maglev.figures.style import Look
from maglev.vocabulary import GIVEN, INFINITE, LIMIT_STATUS

_ENDS = ("", "_low", "_high")
_INFINITE = LIMIT_STATUS.index(INFINITE)
_GIVEN = LIMIT_STATUS.index(GIVEN)


def named(data: Sequence[xr.Dataset]) -> xr.DataArray:
    """The coordinate ``curve``: case and method of each file."""
    names = [f"{labels.case_name(one)}-{labels.method_of(one)}" for one in data]
    flags = {"flag_values": np.arange(len(names), dtype="int32"), "flag_meanings": " ".join(names)}
    return xr.DataArray(np.arange(len(names), dtype="int32"), dims="curve", attrs=flags)


def densities(data: Sequence[xr.Dataset]) -> xr.Dataset:
    """Put files of the layout ``density`` side by side along ``curve``.

    A density is that of the GDEE, or the direct one with its band where there is none.
    """
    columns: dict[str, list[FloatArray]] = {}

    def add(name: str, values: xr.DataArray | FloatArray) -> None:
        columns.setdefault(name, []).append(np.asarray(values, dtype=float))

    for one in data:
        evolved = np.isfinite(one["peak"].to_numpy())
        nothing = xr.full_like(one["density_direct"], np.nan)
        add("value", one["value"])
        add("density", np.where(evolved[:, None], one["density"], one["density_direct"]))
        for end in _ENDS[1:]:
            band = one.get(f"density_direct{end}", nothing)
            add(f"density{end}", np.where(evolved[:, None], np.nan, band))
        for end in _ENDS:
            add(f"exceedance{end}", one[f"exceedance{end}"])
        add("peak", np.where(evolved, one["peak"], one["peak_direct"]))
        add("width", np.where(evolved, one["mesh_size"], one["bandwidth"]))
        add("lost_probability", one["lost_probability"])
        add("n_runs", one["n_runs"])
    return _gathered(data, columns, ("cell",))


def limits(data: Sequence[xr.Dataset]) -> xr.Dataset:
    """Put files of the layout ``limits`` side by side along ``curve``.

    Raises
    ------
    UserError
        If their failure probabilities differ.
    """
    levels = data[0]["failure_probability"].to_numpy()
    columns: dict[str, list[FloatArray]] = {}
    for one in data:
        if not np.array_equal(one["failure_probability"].to_numpy(), levels):
            raise UserError("all limits must be at the same failure probabilities")
        for name in ("limit", "held_limit"):
            given = one[f"{name}_status"].to_numpy() == _GIVEN
            infinite = one[f"{name}_status"].to_numpy() == _INFINITE
            for end in _ENDS:
                values = np.where(given, one[f"{name}{end}"], np.nan)
                values = np.where(infinite, np.inf, values)
                columns.setdefault(f"{name}{end}", []).append(values)
        for end in _ENDS:
            value = one[f"lost_probability{end}"].to_numpy()
            columns.setdefault(f"lost_probability{end}", []).append(value)
        columns.setdefault("n_runs", []).append(one["n_runs"].to_numpy())
    found = _gathered(data, columns, ("failure_probability",))
    return found.assign_coords(failure_probability=levels)


def _gathered(
    data: Sequence[xr.Dataset], columns: dict[str, list[FloatArray]], last: tuple[str, ...]
) -> xr.Dataset:
    for one in data[1:]:
        if not np.array_equal(one["response"], data[0]["response"]):
            raise UserError("all files must be of the same responses; compute them again")
    dims = ("curve", "response", *last)
    variables = {}
    for name, values in columns.items():
        stacked = np.stack(values).astype(VARIABLES[f"curve_{name}"].dtype)
        variables[f"curve_{name}"] = (dims[: stacked.ndim], stacked)
    return xr.Dataset(variables, coords={"curve": named(data), "response": data[0]["response"]})


def held_exceedance(curves: xr.Dataset) -> xr.DataArray:
    """Exceedance of the curves of `densities` given that levitation holds [-].

    A passage that loses levitation exceeds every value, so that P(x | held) is
    (P(x) - P(lost)) / (1 - P(lost)).
    """
    lost = curves["curve_lost_probability"]
    return ((curves["curve_exceedance"] - lost) / (1.0 - lost)).clip(min=0.0)


def body(curves: xr.Dataset, response: int, tail: float) -> tuple[float, float]:
    """Range of values that leaves out at most ``tail`` of each held density on either side."""
    low, high = [], []
    for number in range(curves.sizes["curve"]):
        one = curves.isel(curve=number, response=response)
        held = one["curve_exceedance"].to_numpy() - float(one["curve_lost_probability"])
        value = one["curve_value"].to_numpy()
        inside = value[(held < (1 - tail) * held.max()) & (held > tail * held.max())]
        low.append(inside.min() if inside.size else value.min())
        high.append(inside.max() if inside.size else value.max())
    margin = 0.12 * (max(high) - min(low))
    return min(low) - margin, max(high) + margin


_FAR = 2.0
"""Distance of a curve from all others, over their range, at which it would squeeze them [-]."""


def apart(curves: xr.Dataset, response: int) -> BoolArray:
    """Curves (curve,) whose densities lie so far from all others that they would squeeze them."""
    spans = np.array(
        [body(curves.isel(curve=[k]), response, 5e-3) for k in range(curves.sizes["curve"])]
    )
    far = np.zeros(len(spans), dtype=bool)
    for k, (low, high) in enumerate(spans if len(spans) > 2 else []):
        others = np.delete(spans, k, axis=0)
        least, most = others[:, 0].min(), others[:, 1].max()
        far[k] = max(low - most, least - high) > _FAR * (most - least)
    return far


def note_apart(axis: Axes, curve: xr.Dataset, response: int, look: Look) -> None:
    """Write peak and range of a single curve that lies off the panel into its corner."""
    shown = labels.shown(str(curve["response"].values[response]))
    at = curve.isel(curve=0, response=response)
    peak = int(at["curve_density"].argmax("cell"))
    low, high = (shown.scale * end for end in body(curve, response, 5e-3))
    style.note(
        axis,
        f"off the panel: {low:.3g} to {high:.3g} {shown.unit},\n"
        f"peak {float(at['curve_density'][peak]) / shown.scale:.3g} "
        f"at {shown.scale * float(at['curve_value'][peak]):.3g}",
        color=look["color"],
    )
    axis.set_ylim(top=1.3 * axis.get_ylim()[1])  # the note stands above the curves


def draw_densities(
    axis: Axes,
    curves: xr.Dataset,
    response: int,
    styles: Sequence[Look],
    span: tuple[float, float],
) -> None:
    """Draw the densities of a response, each with its band if it has one.

    Curves far higher than the widest ones leave the panel; their peaks are then written, in their
    colours, into the upper corner that is farther from them.

    Parameters
    ----------
    axis
        Where to draw.
    curves
        From `densities`.
    response
        Number of the response.
    styles
        Line style of each curve.
    span
        First and last value shown [unit of the response], as from `body`.
    """
    shown = labels.shown(str(curves["response"].to_numpy()[response]))
    at = curves.isel(response=response)
    peaks = at["curve_density"].max("cell").to_numpy() / shown.scale
    top = 1.12 * peaks[peaks <= 5.0 * peaks.min()].max()
    for number, look in enumerate(styles):
        one = at.isel(curve=number)
        value = shown.scale * one["curve_value"]
        low, high = (one[f"curve_density{end}"].to_numpy() / shown.scale for end in _ENDS[1:])
        if np.isfinite(low).any():
            axis.fill_between(value, low, high, color=look["color"], alpha=0.18, lw=0)
        axis.plot(value, one["curve_density"] / shown.scale, **look)
    beyond = [k for k in range(len(styles)) if peaks[k] > top]
    if beyond:
        top *= 1.0 + 0.1 * len(beyond)
    highest = at["curve_value"].to_numpy()[beyond, at["curve_density"].argmax("cell")[beyond]]
    right = bool(np.mean(highest - span[0]) < 0.6 * (span[1] - span[0])) if beyond else True
    for row, k in enumerate(sorted(beyond, key=lambda k: -peaks[k])):
        axis.text(
            0.98 if right else 0.02,
            0.97 - 0.1 * row,
            f"peak {peaks[k]:,.0f}" if peaks[k] >= 1e3 else f"peak {peaks[k]:.3g}",
            color=styles[k]["color"],
            transform=axis.transAxes,
            ha="right" if right else "left",
            va="top",
            fontsize=6.5,
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.9, "pad": 0.5},
            zorder=5,
        )
    axis.set_xlim(shown.scale * span[0], shown.scale * span[1])
    axis.set_ylim(0, top)
    axis.locator_params(axis="x", nbins=5)
    axis.set_xlabel(shown.axis)
    axis.set_ylabel(shown.density_axis)


def draw_limits(axis: Axes, x: FloatArray, at: xr.Dataset, look: Look) -> None:
    """Draw limits and their intervals against another quantity.

    The line and hollow markers are the limits given that levitation holds, filled markers those of
    all passages, missing where losses alone are likelier than the failure probability.  An arrow
    stands for an interval without an upper end.

    Parameters
    ----------
    axis
        Where to draw.
    x : (point,)
        Abscissae.
    at
        ``curve_limit`` and ``curve_held_limit`` with their ends, on one dimension (point,), in
        the unit of the axis.
    look
        Line style with ``color`` and ``marker``.
    """
    unmarked: Look = {**look, "marker": ""}
    for name, hollow in (("held_limit", True), ("limit", False)):
        middle, low, high = (at[f"curve_{name}{end}"].to_numpy() for end in _ENDS)
        kept = np.isfinite(middle)
        if hollow:
            axis.plot(x[kept], middle[kept], **unmarked)
        if not kept.any():
            continue
        reach = np.abs(np.stack([middle[kept] - low[kept], high[kept] - middle[kept]]))
        axis.errorbar(
            x[kept],
            middle[kept],
            yerr=np.where(np.isfinite(reach), reach, 0.0),
            ls="",
            marker=look["marker"],
            ms=3.5,
            color=look["color"],
            mfc="white" if hollow else look["color"],
            capsize=1.5,
            elinewidth=0.7,
            capthick=0.7,
            lw=0.7,
        )
        for k in np.flatnonzero(kept & np.isinf(high)):
            arrow = {"arrowstyle": "<-", "color": look["color"], "lw": 0.7, "shrinkA": 0}
            axis.annotate(
                "",
                xy=(x[k], middle[k]),
                xytext=(0, 13),
                textcoords="offset points",
                arrowprops=arrow,
            )


def levels_along(axis: Axes, levels: FloatArray) -> None:
    """Let failure probabilities (level,) run along a panel, the rarest at its right end."""
    axis.set_xscale("log")
    axis.set_xlim(1.7 * levels.max(), levels.min() / 1.7)
    axis.set_xticks(levels, [f"{level:g}" for level in levels], minor=False)
    axis.minorticks_off()
    axis.set_xlabel("failure probability [-]")


def limits_apart(at: xr.Dataset) -> BoolArray:
    """Curves (curve,) whose limits lie so far above or below all others that they squeeze them."""
    held = at["curve_held_limit"].to_numpy()
    far = np.zeros(len(held), dtype=bool)
    for k in range(len(held) if len(held) > 2 else 0):
        others = np.delete(held, k, axis=0)
        if np.isfinite(held[k]).any() and np.isfinite(others).any():
            least, most = np.nanmin(others), np.nanmax(others)
            gap = max(np.nanmin(held[k]) - most, least - np.nanmax(held[k]))
            far[k] = gap > _FAR * (most - least)
    return far


def in_shown_unit(found: xr.Dataset, response: int) -> xr.Dataset:
    """Limits of a response in the unit in which it is shown."""
    names = [f"curve_{name}{end}" for name in ("limit", "held_limit") for end in _ENDS]
    scale = labels.shown(str(found["response"].to_numpy()[response])).scale
    return scale * found[names].isel(response=response).drop_vars("response")


def differ(found: xr.Dataset) -> bool:
    """Whether any limit differs from that given that levitation holds."""
    limit, held_limit = (found[f"curve_{name}limit"].to_numpy() for name in ("", "held_"))
    return not np.array_equal(limit, held_limit, equal_nan=True)
