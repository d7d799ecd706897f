"""Stability over the gains of the suspension: the linearised train, and the lost runs."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.contour import QuadContourSet
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Polygon

from maglev.figures import labels, style
from maglev.vocabulary import STATUS, STEP_TOO_LARGE

_LOST = "#D55E00"
_COLOURS, _LINES = (_LOST, "#CC79A7"), ("-", ":")  # without lag, with lag
_MARKERS = {1: "x", 2: "+", 3: "*", STEP_TOO_LARGE: "s"}


def figure(stability: xr.Dataset, runs: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw growth rate, its border and the static limit, with the runs on them.

    Parameters
    ----------
    stability
        Layout ``stability``.
    runs
        Layout ``runs``: the baseline of a case.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    status = runs["status"].to_numpy()
    k_p, k_d = (
        runs[f"suspension_{kind}_gain"].to_numpy() for kind in ("proportional", "derivative")
    )
    x, y = stability["grid_proportional"].to_numpy(), stability["grid_derivative"].to_numpy()
    growth = stability["growth_rate"].to_numpy()
    static = float(stability["static_limit"])

    fig, (chart, count) = style.panels(1, 2, style.PAGE, 3.1)
    left = _around(np.append(k_p, static), x)[0] - (x[1] - x[0])
    fastest = max(float(growth[:, x >= left].max()), 1e-3)
    levels = np.linspace(0.0, fastest, 9)
    filled = chart.contourf(x, y, growth, levels=levels, cmap="Oranges", alpha=0.8)
    _end_at_border(filled, stability)
    fig.colorbar(filled, ax=chart, label="growth rate [1/s]", shrink=0.9, format="%.2g")
    size = 1.2 if status.size > 2000 else 2.5
    held = status == 0
    look: style.Look = {"ms": size, "mew": 0, "color": "#0072B2", "alpha": 0.5, "rasterized": True}
    chart.plot(k_p[held], k_d[held], ".", **look)
    for code, marker in _MARKERS.items():
        chosen = status == code
        if chosen.any():
            what = "not judged" if code == STEP_TOO_LARGE else "lost"
            word = f"{what}: {STATUS[code].replace('_', ' ')}"
            look = {"ls": "", "marker": marker, "ms": 4, "mew": 0.8, "color": "#000000"}
            look |= {"mfc": "none"} if code == STEP_TOO_LARGE else {}
            chart.plot(k_p[chosen], k_d[chosen], **look, label=word)
    lags = stability["current_lag"].to_numpy()
    for lag, line, colour in zip(lags, _LINES, _COLOURS, strict=True):
        of_lag = stability.sel(current_lag=lag)
        by_k_d = (of_lag["proportional_border"].to_numpy()[::-1], y[::-1])
        by_k_p = (x, of_lag["derivative_border"].to_numpy())
        whole = np.hstack([by_k_d, by_k_p])
        whole = whole[:, np.isfinite(whole).all(axis=0)]  # straight between points of the map
        chart.plot(*whole, line, color=colour, lw=1.2, zorder=3)
    chart.axvline(static, color="#000000", ls="--", lw=0.9, zorder=4)
    chart.plot(
        float(stability["mean_proportional"]), float(stability["mean_derivative"]), "P",
        color="white", mec="#000000", mew=0.6, ms=6,
    )  # fmt: skip
    chart.set(xlabel="suspension $k_p$ [A/m]", ylabel="suspension $k_d$ [A s/m]")
    chart.set(xlim=_around(np.append(k_p, static), x), ylim=(y.min(), _around(k_d, y)[1]))
    chart.grid(visible=False)

    edges = np.linspace(k_p.min(), k_p.max(), 41)
    away = ~held & (status != STEP_TOO_LARGE)
    held_count, lost_count = (np.histogram(k_p[chosen], edges)[0] for chosen in (held, away))
    count.stairs(held_count, edges, color="#0072B2", fill=True, alpha=0.5, label="held")
    count.stairs(lost_count, edges, color="#000000", fill=True, label="lost")
    count.axvline(static, color="#000000", ls="--", lw=0.9, zorder=4)
    border = float(stability["proportional_border_low"])
    count.axvline(border, color=_LOST, lw=1.2)
    count.set(yscale="log", ylim=(0.7, None), xlim=_around(np.append(k_p, static), x))
    count.set(xlabel="suspension $k_p$ [A/m]", ylabel="runs")
    count.legend(loc="upper right")

    variation, _ = labels.settings(runs)
    n, n_lost = status.size, int(away.sum())
    style.titled(chart, "a", f"{n} runs, coefficient of variation {variation:.2f}")
    style.titled(count, "b", f"lost {n_lost} of {n} ({labels.percent(n_lost / n)})")
    handles, words = chart.get_legend_handles_labels()
    handles += [
        Line2D([], [], color="#0072B2", ls="", marker=".", ms=4),
        Line2D([], [], color="#000000", ls="--", lw=0.9),
        *(Line2D([], [], color=c, ls=s, lw=1.2) for c, s in zip(_COLOURS, _LINES, strict=True)),
        Line2D([], [], color="white", mec="#000000", mew=0.6, ls="", marker="P", ms=6),
    ]
    words += [
        "held",
        f"static limit $i_0/\\delta_0$ = {static:.0f} A/m",
        f"border of the linearised train, {border:.1f} A/m at the mean $k_d$",
        *(f"border with {1e3 * lag:g} ms of lag" for lag in lags[1:]),
        "mean gains",
    ]
    style.below(fig, handles, words, columns=3)
    gains = runs[["suspension_proportional_gain", "suspension_derivative_gain", "status"]]
    return fig, xr.merge([stability, gains])


def _end_at_border(filled: QuadContourSet, stability: xr.Dataset) -> None:
    """Let the shading end at a drawn border that parts the map, not between points of the map."""
    x, y = stability["grid_proportional"].to_numpy(), stability["grid_derivative"].to_numpy()
    grows = stability["growth_rate"].to_numpy() > 0
    for border in stability["proportional_border"].to_numpy():
        if np.array_equal(grows, x < border[:, None]):
            left = np.column_stack([np.full(y.size, x[0]), y])
            inside = np.vstack([left, np.column_stack([border, y])[::-1]])
            filled.set_clip_path(Polygon(inside, transform=filled.axes.transData))
            return


def _around(gains: np.ndarray, grid: np.ndarray) -> tuple[float, float]:
    """Range of the runs with a margin, cut off at the edge of the map."""
    margin = 0.06 * np.ptp(gains)
    return max(gains.min() - margin, grid.min()), min(gains.max() + margin, grid.max())
