"""Midspan deflection under the passing train, and how it grows with speed."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from maglev.figures import style


def _window(data: xr.Dataset) -> slice:
    """Times from a little before the load reaches the span to a little after it has left."""
    moving = np.abs(data["deflection_moving_load"].to_numpy())
    loaded = np.flatnonzero(moving > 0.02 * moving.max())
    time = data["t"].to_numpy()
    first, last = time[loaded[0]], time[loaded[-1]]
    margin = 0.15 * (last - first)
    return slice(first - margin, last + margin)


def figure(history: xr.Dataset, sweep: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw deflection against time, and dynamic coefficient and deflection against speed.

    Parameters
    ----------
    history
        Layout ``deflection``.
    sweep
        Layout ``dynamic_factor``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    fig, (time, factor, peak) = style.panels(1, 3, style.PAGE, 2.8)
    shown = history.sel(t=_window(history))
    speed = style.KMH * shown["passage_speed"].item()
    deflection = 1e3 * shown["deflection"]
    time.plot(shown.t, deflection, color=style.MODEL, label="train on guideway")
    time.plot(
        shown.t,
        1e3 * shown["deflection_moving_load"],
        color=style.REFERENCE,
        ls="--",
        label="moving load, closed form",
    )
    time.set(xlabel="time [s]", ylabel="midspan deflection, downwards [mm]")
    time.set_ylim(top=1.45 * float(deflection.max()))
    time.legend(loc="upper left")
    style.titled(time, "a", f"{deflection.max().item():.3f} mm at {speed:.0f} km/h")

    kmh = style.KMH * sweep["speed"].to_numpy()
    kept = sweep["passage_status"].to_numpy() == 0
    factor.plot(
        kmh,
        sweep["dynamic_factor"].where(kept),
        color=style.MODEL,
        marker="o",
        ms=2.5,
        label="train",
    )
    factor.plot(
        kmh,
        sweep["dynamic_factor_moving_load"],
        color=style.REFERENCE,
        ls="--",
        label="moving load",
    )
    factor.set(xlabel="speed [km/h]", ylabel="dynamic coefficient [-]")
    factor.margins(y=0.25)
    factor.legend(loc="upper left")
    fastest = sweep.isel(speed=-1)
    style.titled(factor, "b", f"{fastest['dynamic_factor'].item():.3f} at {kmh[-1]:.0f} km/h")
    style.note(factor, f"1.000 is {1e3 * sweep['static_deflection'].item():.3f} mm", top=False)

    peak.plot(
        kmh,
        1e3 * sweep["peak_deflection"].where(kept),
        color=style.MODEL,
        marker="o",
        ms=2.5,
        label="train",
    )
    top = f"{1e3 * sweep['peak_deflection'].where(kept).max().item():.3f} mm at most"
    if "measured_deflection" in sweep:
        measured = sweep["measured_deflection"]
        peak.plot(
            style.KMH * sweep["measured_speed"],
            1e3 * measured,
            ls="",
            color=style.MEASURED,
            marker="D",
            ms=4,
            label=f"measured ({measured.attrs['confidence']} confidence)",
        )
        top = f"measured {1e3 * measured.max().item():.3f} mm"
    peak.set(xlabel="speed [km/h]", ylabel="largest deflection [mm]")
    peak.margins(y=0.4)
    style.titled(peak, "c", top)
    peak.legend(loc="upper left")
    if not kept.all():
        for axis in (factor, peak):
            for lost in kmh[~kept]:
                axis.axvline(lost, color=style.QUIET, ls=":", lw=0.8)
        style.note(peak, "dotted: levitation lost", top=False)
    plotted = xr.merge([shown.drop_vars("static_deflection_moving_load"), sweep], join="outer")
    return fig, plotted
