"""The modes of the levitated train: damping against frequency, by the moving part."""

from __future__ import annotations

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from maglev.figures import style
from maglev.vocabulary import TRAIN_PARTS

_LOOK = {  # colour and marker of what moves
    "car_body": (style.MODEL, "o"),
    "bogies": (style.ACCENT, "s"),
    "rods": (style.QUIET, "x"),
    "suspension_magnets": (style.REFERENCE, "^"),
    "guidance_magnets": ("#CC79A7", "v"),
}


def figure(data: xr.Dataset) -> tuple[Figure, xr.Dataset]:
    """Draw damping over frequency of each mode; the car body's are named.

    Parameters
    ----------
    data
        Layout ``train_modes``.

    Returns
    -------
    figure, plotted
        The figure and the numbers in it.
    """
    frequency, ratio = data["train_frequency"].to_numpy(), 100 * data["damping_ratio"].to_numpy()
    moves = np.array([TRAIN_PARTS[code] for code in data["moves"].to_numpy()])
    fig, (axis, text) = style.panels(1, 2, style.PAGE, 3.1)
    of_body = np.char.startswith(moves, "car_body")
    for part, (colour, marker) in _LOOK.items():
        chosen = of_body if part == "car_body" else moves == part
        word = f"{part.replace('_', ' ')} ({chosen.sum()})"
        look: style.Look = {"ls": "", "marker": marker, "ms": 4, "mfc": "none", "color": colour}
        axis.plot(frequency[chosen], ratio[chosen], **look, label=word)
    named = np.flatnonzero(of_body)
    for number, k in enumerate(named, start=1):
        offset = (-9, -2.5) if number % 2 else (4.5, -2.5)
        axis.annotate(
            str(number),
            (frequency[k], ratio[k]),
            xytext=offset,
            textcoords="offset points",
            fontsize=7,
        )
    axis.set(xscale="log", xlabel="frequency [Hz]", ylabel="damping [% of critical]")
    axis.set_ylim(min(0.0, 1.1 * ratio.min()), None)
    axis.set_title(f"(a) {frequency.size} modes of one car", loc="left")
    style.below(fig, *axis.get_legend_handles_labels(), 5)

    rows: list[tuple[str, ...]] = [("", "what moves", "frequency", "damping", "share")]
    colours = [style.MODEL] * named.size
    largest = 100 * data["kinetic_share"].max("train_part").to_numpy()
    for number, k in enumerate(named, start=1):
        word = moves[k].replace("_", " ")
        numbers = (f"{frequency[k]:.3f} Hz", f"{ratio[k]:.1f} %", f"{largest[k]:.0f} %")
        rows.append((str(number), word, *numbers))
    for part, (colour, _) in _LOOK.items():
        chosen = moves == part
        if chosen.any():
            ranges = (
                f"{values[chosen].min():.{digits}f}–{values[chosen].max():.{digits}f} {unit}"
                for values, digits, unit in (
                    (frequency, 1, "Hz"),
                    (ratio, 1, "%"),
                    (largest, 0, "%"),
                )
            )
            rows.append(("", part.replace("_", " "), *ranges))
            colours.append(colour)
    style.table(text, rows, (0.0, 0.05, 0.38, 0.61, 0.84), colours, 0.095)
    text.set_title("(b) share of kinetic energy in what moves", loc="left")
    return fig, data
