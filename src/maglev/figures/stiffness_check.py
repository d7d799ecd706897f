"""Static deflection against first frequency: the curve of a bridge of any stiffness."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from maglev.figures import style

_STIFFER = (0.8, 1.2, 1.5, 2.0)


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw deflection over frequency: model, measurement, and changes that would reconcile them.

    Parameters
    ----------
    data
        Layout ``stiffness_check``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    fig, (axis,) = style.panels(1, 1, style.COLUMN, 3.3)
    frequency = data["beam_frequency"].to_numpy()
    deflection = 1e3 * data["beam_deflection"].to_numpy()
    car, mass = 1e-3 * data["car_load"].item(), 1e-3 * data["mass_per_length"].item()
    axis.plot(
        frequency, deflection, color=style.MODEL,
        label=f"simply supported beams: {car:.1f} t a car, {mass:.1f} t/m",
    )  # fmt: skip
    first, static = data["model_frequency"].item(), 1e3 * data["static_deflection"].item()
    for times in _STIFFER:
        x = first * np.sqrt(times)
        if frequency[0] < x < frequency[-1]:
            y = float(np.interp(x, frequency, deflection))
            axis.plot(x, y, "|", color=style.MODEL, ms=7)
            axis.annotate(
                f"{times:g} EI", (x, y), (-4, -9), textcoords="offset points", fontsize=6.5,
                ha="right", color=style.MODEL,
            )  # fmt: skip
    axis.plot(
        first, static, "o", color=style.MODEL, mfc="white", ms=5,
        label=f"model: {first:.2f} Hz, {static:.3f} mm at rest",
    )  # fmt: skip
    title = "no measurement of this bridge"
    if "measured_frequency" in data:
        at, of = (
            data[name].item() for name in ("measured_frequency", "measured_static_deflection")
        )
        needed_car, needed_mass = (
            1e-3 * data[name].item() for name in ("needed_car_load", "needed_mass_per_length")
        )
        axis.plot(
            frequency, 1e3 * of * (at / frequency) ** 2, color=style.REFERENCE, ls="--",
            label=f"with {needed_car:.0f} t a car, or {needed_mass:.1f} t/m",
        )  # fmt: skip
        sure = data["measured_frequency"].attrs["confidence"]
        axis.plot(
            at, 1e3 * of, "D", color=style.MEASURED, ms=4.5,
            label=f"measured, without dynamic part ({sure} confidence)",
        )  # fmt: skip
        expected = 1e3 * of * needed_mass / mass
        title = f"at {at:.2f} Hz a beam has {expected:.2f} mm, measured {1e3 * of:.2f} mm"
        axis.set_ylim(top=1.35 * max(1e3 * of, deflection.max()))
    axis.set(xlabel="first vertical frequency [Hz]", ylabel="static midspan deflection [mm]")
    axis.set_ylim(bottom=0)
    axis.set_title(title, loc="left")
    style.below(fig, *axis.get_legend_handles_labels(), columns=1)
    return fig, data
