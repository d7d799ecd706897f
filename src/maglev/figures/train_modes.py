"""The modes of the levitated train: frequency against damping, by what moves."""

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
        look = {"ls": "", "marker": marker, "ms": 4, "mfc": "none", "color": colour}
        axis.plot(frequency[chosen], ratio[chosen], **look, label=word)
    named = np.flatnonzero(of_body)
    for number, k in enumerate(named, start=1):
        place = {"xytext": (3, 4 if number % 2 else -8), "textcoords": "offset points"}
        axis.annotate(str(number), (frequency[k], ratio[k]), **place, fontsize=7)
    axis.set(xscale="log", xlabel="frequency [Hz]", ylabel="damping [% of critical]")
    axis.set_ylim(min(0.0, 1.1 * ratio.min()), None)
    axis.set_title(f"(a) {frequency.size} modes of one car", loc="left")
    style.below(fig, *axis.get_legend_handles_labels(), ncols=5)

    rows = [("", "car body", "frequency", "damping", "share")]
    for number, k in enumerate(named, start=1):
        share = data["kinetic_share"].to_numpy()[k].max()
        word = moves[k].removeprefix("car_body_")
        rows.append(
            (
                str(number),
                word,
                f"{frequency[k]:.3f} Hz",
                f"{ratio[k]:.1f} %",
                f"{100 * share:.0f} %",
            )
        )
    style.table(text, rows, (0.0, 0.07, 0.33, 0.6, 0.83), [style.MODEL] * named.size, 0.11)
    text.set_title("(b) its modes, and their kinetic energy in the named motion", loc="left")
    return fig, data
