"""Responses over the time of a passage: mean and band, density, and failure by first passage."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from maglev.arrays import FloatArray
from maglev.figures import labels, style

_COLUMNS = 2
_DECADES = 3
"""Powers of ten of the density that are coloured."""

_BEYOND = 1.6
"""Height of a panel of the density over that of the band of the quantiles."""

_CIRCLE: style.Look = {"ls": "", "marker": "o", "ms": 3.5, "mfc": "white"}
_BARRIER_COLOURS = ("#56B4E9", "#0072B2", "#000000", "#D55E00", "#009E73")


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw for each response its course, the density about its mean, and 1 - R(t).

    Parameters
    ----------
    data
        Layout ``density_in_time``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    names = [str(name) for name in data["response"].to_numpy()]
    n_columns = min(_COLUMNS, len(names))
    n_rows = -(-len(names) // n_columns)
    width = style.PAGE if n_columns > 1 else style.COLUMN
    fig = Figure(figsize=(width, 5.6 * n_rows), layout="constrained")
    axes = fig.subplots(3 * n_rows, n_columns, squeeze=False, sharex=True)
    for place, name in enumerate(names):
        row, column = divmod(place, n_columns)
        own = axes[3 * row : 3 * row + 3, column]
        shown, at = labels.shown(name), data.sel(response=name)
        of_cars = ", largest of the cars" if name.startswith("car_body") else ""
        for k, (draw, words) in enumerate(
            (
                (_course, f"{shown.name}{of_cars}"),
                (_density, "density about the mean"),
                (_failure, "failure by first passage, 1 - R(t)"),
            )
        ):
            style.titled(own[k], "abcdefghijklmnopqr"[3 * place + k], words)
            draw(own[k], at, shown)
        own[2].set_xlabel("time [s]")
        own[2].tick_params(labelbottom=True)
    for axis in axes[3 * n_rows - 3 :, len(names) - n_columns * (n_rows - 1) :].flat:
        axis.remove()
    axes[0, 0].set_xlim(_first_motion(data), float(data["t"][-1]))
    return fig, data


def _first_motion(data: xr.Dataset) -> float:
    """Time before which no response spreads by a hundredth of its largest spread [s]."""
    deviation = data["deviation_in_time"]
    moves = (deviation > 0.01 * deviation.max("t")).any("response").to_numpy()
    return float(data["t"][max(int(moves.argmax()) - 1, 0)])


def _course(axis: Axes, at: xr.Dataset, shown: labels.Shown) -> None:
    """Draw mean and band, and when the train is on the guideway."""
    t = at["t"].to_numpy()
    band = shown.scale * at["quantile_in_time"].to_numpy()
    levels = at["quantile_level"].to_numpy()
    inside = f"{100 * (levels[-1] - levels[0]):g} % of the passages"
    axis.fill_between(t, band[:, 0], band[:, -1], color=style.MODEL, alpha=0.3, lw=0, label=inside)
    axis.plot(t, shown.scale * at["mean_in_time"], color=style.MODEL, lw=0.8, label="mean")
    on = np.interp([0.0, float(at["guideway_length"] + at["train_length"])], at["nose"], t)
    axis.axvspan(*on, color=style.QUIET, alpha=0.12, lw=0, label="train on the guideway")
    axis.set_ylabel(shown.axis)
    lost = 1.0 - float(at["held_in_time"][-1])
    title = f"{int(at['n_runs'])} runs, lost {labels.percent(lost)}"
    axis.legend(loc="best", fontsize=6, title=title, title_fontsize=6, alignment="left")
    speed = float(at["nose"][-1] - at["nose"][0]) / float(t[-1] - t[0])
    start = float(at["nose"][0]) - speed * t[0]
    above = axis.secondary_xaxis(
        "top",
        functions=(
            lambda time: start + speed * np.asarray(time, dtype=float),
            lambda nose: (np.asarray(nose, dtype=float) - start) / speed,
        ),
    )
    above.set_xlabel("nose of the train [m]", labelpad=2)


def _density(axis: Axes, at: xr.Dataset, shown: labels.Shown) -> None:
    """Draw the density about the mean in colours, with the quantiles as lines."""
    scale, unit = (1e6, "µm") if shown.unit == "mm" else (shown.scale, shown.unit)
    t, mean = at["t"].to_numpy(), at["mean_in_time"].to_numpy()[:, None]
    value = scale * (at["value_in_time"].to_numpy() - mean)
    density = at["density_in_time"].to_numpy() / scale
    lines = scale * (at["quantile_in_time"].to_numpy() - mean)
    reach = _BEYOND * max(np.abs(lines).max(), 1e-12)
    top = _top(density, scale * at["deviation_in_time"].to_numpy())
    mesh = axis.pcolormesh(
        np.broadcast_to(t[:, None], value.shape),
        value,
        np.maximum(density, 1e-6 * top),
        norm=LogNorm(vmin=top * 10.0**-_DECADES, vmax=top),
        cmap="viridis",
        shading="gouraud",
        rasterized=True,
    )
    for k in (0, -1):
        axis.plot(t, lines[:, k], color="white", lw=0.6, ls="--")
    axis.set_ylim(-reach, reach)
    axis.set_facecolor("#440154")  # the lowest colour of the map
    axis.set_ylabel(f"deviation [{unit}]")
    axis.grid(visible=False)
    bar = axis.figure.colorbar(mesh, ax=axis, extend="both", pad=0.02)
    bar.set_label("density [1/µm]" if unit == "µm" else shown.density_axis)


def _top(density: FloatArray, deviation: FloatArray) -> float:
    """Largest density at times at which the response spreads as much as at half of all times."""
    spread = deviation >= np.median(deviation[deviation > 0.0])
    return float(density[spread].max())


def _failure(axis: Axes, at: xr.Dataset, shown: labels.Shown) -> None:
    """Draw the probability that each barrier was reached or levitation lost."""
    t = at["t"].to_numpy()
    least = 0.3 * float(at["failure_probability"].min())
    for k, level in enumerate(at["failure_probability"].to_numpy()):
        one, colour = at.isel(failure_probability=k), _BARRIER_COLOURS[k % len(_BARRIER_COLOURS)]
        words = f"{shown.scale * float(one['barrier']):.4g} {shown.unit}"
        error = float(one["reliability_error"])
        failure, of_points = (
            np.maximum(1.0 - one[name].to_numpy(), 1e-12)
            for name in ("reliability", "reliability_of_points")
        )
        axis.plot(t, of_points, color=colour, lw=2.2, alpha=0.35)
        axis.plot(t, failure, color=colour, label=f"{words} ({level:g}), error {0.0 - error:+.1g}")
        of_extreme = 1.0 - float(one["reliability_of_extreme"])
        if of_extreme > least:
            look: style.Look = {**_CIRCLE, "color": colour}
            axis.plot(t[-1], of_extreme, clip_on=False, zorder=4, **look)
    axis.set_yscale("log")
    axis.set_ylim(least, 1.5)
    axis.set_ylabel("probability [-]")
    title = "barrier (probability); wide: points, circle: extreme"
    axis.legend(loc="upper left", fontsize=6, title=title, title_fontsize=6, alignment="left")
