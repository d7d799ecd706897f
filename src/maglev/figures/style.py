"""Common style of all figures: sizes for print, colours safe for the colour-blind."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from string import ascii_lowercase
from typing import TypedDict

import matplotlib as mpl
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.typing import LineStyleType, MarkerType

COLUMN, PAGE = 3.5, 7.2
"""Widths of one column and of the page [inch]."""

MODEL, REFERENCE, MEASURED, ACCENT, QUIET = "#0072B2", "#D55E00", "#000000", "#009E73", "#999999"
"""Okabe and Ito's colours (2008) by what they stand for."""

KMH = 3.6
"""Kilometres per hour in one metre per second."""


class Look(TypedDict, total=False):
    """Keywords of matplotlib for a line and its markers."""

    color: str
    ls: LineStyleType
    lw: float
    marker: MarkerType
    ms: float
    mew: float
    mfc: str
    alpha: float
    rasterized: bool
    label: str
    zorder: float


@contextmanager
def page() -> Iterator[None]:
    """Set fonts and lines for a figure at column width."""
    with mpl.rc_context(
        {
            "font.size": 8,
            "axes.titlesize": 8,
            "axes.labelsize": 8,
            "legend.fontsize": 7,
            "legend.frameon": False,
            "xtick.labelsize": 7,
            "ytick.labelsize": 7,
            "lines.linewidth": 1.0,
            "axes.spines.top": False,
            "axes.spines.right": False,
            "axes.grid": True,
            "axes.axisbelow": True,
            "axes.formatter.useoffset": False,
            "grid.color": "#e5e5e5",
            "grid.linewidth": 0.5,
            "pdf.fonttype": 42,
            "svg.hashsalt": "maglev",
        }
    ):
        yield


def titled(axis: Axes, letter: str, text: str) -> None:
    """Write a panel's letter and its main number above its left edge."""
    axis.set_title(f"({letter}) {text}", loc="left")


def panels(rows: int, columns: int, width: float, height: float) -> tuple[Figure, list[Axes]]:
    """A figure of equal panels, lettered (a), (b) … from left to right; sizes in inches."""
    figure = Figure(figsize=(width, height), layout=ConstrainedLayoutEngine(w_pad=0.07))
    axes = list(figure.subplots(rows, columns, squeeze=False).ravel())
    for letter, axis in zip(ascii_lowercase, axes, strict=False):
        axis.set_title(f"({letter})", loc="left")
    return figure, axes


def note(
    axis: Axes, text: str, *, top: bool = True, right: bool = True, color: str = "#000000"
) -> None:
    """Write a note into a corner of a panel."""
    axis.text(
        0.98 if right else 0.02,
        0.97 if top else 0.03,
        text,
        transform=axis.transAxes,
        ha="right" if right else "left",
        va="top" if top else "bottom",
        fontsize=7,
        color=color,
        bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1.5},
        zorder=5,
    )


def table(
    axis: Axes,
    rows: Sequence[Sequence[str]],
    columns: Sequence[float],
    colours: Sequence[str],
    height: float,
) -> None:
    """Write a table in place of a panel: a heading, then a coloured row per line of the figure.

    Parameters
    ----------
    axis
        Panel, which loses its axes.
    rows
        The heading and the rows, a text per column.
    columns
        Left end of each column [share of the width].
    colours
        Colour of each row behind the heading.
    height
        Of a row [share of the height].
    """
    axis.axis("off")
    for number, row in enumerate(rows):
        y = 0.97 - height * number
        colour = "#000000" if number == 0 else colours[number - 1]
        for x, text in zip(columns, row, strict=True):
            axis.text(x, y, text, color=colour, fontsize=7, va="top", transform=axis.transAxes)
    y = 0.97 - height + 0.035
    axis.plot([0.0, 1.0], [y, y], color="#000000", lw=0.5, transform=axis.transAxes)


def below(
    figure: Figure, handles: Sequence[Artist], words: Sequence[str], columns: int, title: str = ""
) -> None:
    """Put a legend in columns below all panels."""
    figure.legend(
        handles,
        words,
        loc="outside lower center",
        ncols=columns,
        title=title or None,
        title_fontsize=7,
    )


def say_track(figure: Figure, words: str) -> None:
    """Write above a figure which track its numbers belong to."""
    figure.suptitle(words, x=0.995, ha="right", fontsize=6.5, color="#555555")


def mark_demonstration(figure: Figure) -> None:
    """Write 'demonstration' across a figure of a demonstration run."""
    figure.text(
        0.5,
        0.5,
        "demonstration",
        ha="center",
        va="center",
        rotation=25,
        fontsize=36,
        color="#CC0000",
        alpha=0.22,
        zorder=10,
    )


def save(figure: Figure, out: Path) -> None:
    """Write PNG and PDF, without the time of writing so that equal figures are equal files.

    The panels are laid out once, for the PNG, and keep their places in the PDF.
    """
    out.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(out.with_name(f"{out.name}.png"), dpi=300, metadata={"Software": None})
    figure.set_layout_engine(None)
    figure.savefig(out.with_name(f"{out.name}.pdf"), metadata={"CreationDate": None})
