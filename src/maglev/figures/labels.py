"""Names, units and colours of responses, gains, methods and cases, the same in every figure."""

from __future__ import annotations

import json
import re
from dataclasses import dataclass
from typing import SupportsFloat, SupportsInt

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.typing import LineStyleType

from maglev.errors import UserError
from maglev.figures import style
from maglev.vocabulary import GAINS, METHODS, PAPER_RESPONSES


@dataclass(frozen=True, kw_only=True)
class Shown:
    """Name, symbol, scale and unit of a response in figures.

    Parameters
    ----------
    name
        For a panel's title.
    symbol
        Short, for an axis.
    scale
        Shown number over the one in SI [-].
    unit
        Of the shown number.
    """

    name: str
    symbol: str
    scale: float
    unit: str

    @property
    def axis(self) -> str:
        """Label of an axis of the response."""
        return f"{self.symbol} [{self.unit}]"

    @property
    def density_axis(self) -> str:
        """Label of an axis of its density."""
        return f"density [{'1/mm' if self.unit == 'mm' else 's²/m'}]"


_MM, _ACCELERATION = (1e3, "mm"), (1.0, "m/s²")
SHOWN = tuple(
    Shown(name=name, symbol=symbol, scale=scale, unit=unit)
    for name, symbol, (scale, unit) in (
        ("midspan displacement, vert.", "displacement", _MM),
        ("midspan displacement, lat.", "displacement", _MM),
        ("midspan acceleration, vert.", "acceleration", _ACCELERATION),
        ("midspan acceleration, lat.", "acceleration", _ACCELERATION),
        ("car-body acceleration, vert.", "acceleration", _ACCELERATION),
        ("car-body acceleration, lat.", "acceleration", _ACCELERATION),
    )
)
"""How each response is shown, in the order of `maglev.vocabulary.PAPER_RESPONSES`."""

assert len(SHOWN) == len(PAPER_RESPONSES)

GAIN = ("suspension $k_p$", "suspension $k_d$", "guidance $k_p$", "guidance $k_d$")
"""The gains in short, in the order of `maglev.vocabulary.GAINS`."""

GAIN_COLOUR = ("#0072B2", "#56B4E9", "#D55E00", "#E69F00")
"""Their colours: suspension blue, guidance orange."""

_DASHES: tuple[LineStyleType, ...] = ("--", "-.", (0, (4, 1, 1, 1, 1, 1)), ":")

METHOD = {"mcm": "MCM", "osm": "OSM", "asm_paper": "ASM (paper)", "asm": "ASM (ours)"}
"""The methods in short."""

PDEM = {"mcm": "MCM", "osm": "OSM-PDEM", "asm_paper": "ASM-PDEM (paper)", "asm": "ASM-PDEM (ours)"}
"""The methods in short, with the density evolution."""

METHOD_STYLE: dict[str, style.Look] = {
    "mcm": {"color": "#000000", "ls": "-"},
    "osm": {"color": "#D55E00", "ls": "--"},
    "asm_paper": {"color": "#009E73", "ls": "-."},
    "asm": {"color": "#0072B2", "ls": "-"},
}
"""Their lines; the dashes tell them apart without colour."""

METHOD_MARKER = {"mcm": "s", "osm": "s", "asm_paper": "^", "asm": "o"}
"""Their markers."""


def method_of(data: xr.Dataset) -> str:
    """Name of the method of a file.

    Raises
    ------
    UserError
        If the file does not say it.
    """
    name = data.attrs.get("method", "")
    if name not in METHODS:
        raise UserError(f"the file must say its method, one of {', '.join(METHODS)}, got '{name}'")
    return str(name)


def case_name(data: xr.Dataset) -> str:
    """Name of the case of a file."""
    return str(data.attrs.get("case", ""))


def settings(design: xr.Dataset) -> tuple[float, int]:
    """Coefficient of variation and number of spans of the case of a design or a set of runs.

    Raises
    ------
    UserError
        If the file does not say them.
    """
    try:
        of_case = json.loads(design.attrs["config"])["cases"][design.attrs["case"]]
        return float(of_case["coefficient_of_variation"]), int(of_case["n_spans"])
    except (KeyError, TypeError):
        raise UserError("the file must say its case and how it was configured") from None


def confidence(data: xr.Dataset) -> str:
    """Confidence of the intervals of a file as a percentage.

    Raises
    ------
    UserError
        If the file does not say it.
    """
    try:
        return f"{100 * json.loads(data.attrs['config'])['study']['confidence']:g} %"
    except (KeyError, TypeError):
        raise UserError("the file must say the confidence of its intervals") from None


def gains_of(data: xr.Dataset) -> list[int]:
    """Numbers of the random gains of a file."""
    return [int(number) for number in data["parameter"].to_numpy()]


def case_style(parameters: list[int]) -> tuple[str, style.Look]:
    """Name and line style of a case, from its random gains."""
    if len(parameters) == 1:
        number = parameters[0]
        return f"{GAIN[number]} alone", {"color": GAIN_COLOUR[number], "ls": _DASHES[number]}
    if len(parameters) == len(GAINS):
        return "all four gains", {"color": "#000000", "ls": "-"}
    return " and ".join(GAIN[number] for number in parameters), {"color": "#999999", "ls": "-"}


_GROUP = {
    "pole": "a circuit a pole",
    "ends": "two a magnet, fed at its ends",
    "half": "two a magnet, fed by the half's mean gap",
    "lumped": "one a magnet, one force",
}
_GROUP_COLOUR = {"pole": "#000000", "ends": "#0072B2", "half": "#D55E00", "lumped": "#009E73"}
_LATE_COLOUR = {"pole": "#CC79A7", "ends": "#56B4E9", "half": "#E69F00", "lumped": "#F0E442"}
_GROUP_DASHES: dict[str, LineStyleType] = {"pole": "-", "ends": "--", "half": "-.", "lumped": ":"}


def control_style(design: xr.Dataset) -> tuple[str, style.Look]:
    """Name and line style of a case, from the sharing of its circuits and their lag.

    Raises
    ------
    UserError
        If the file does not say how it was configured.
    """
    try:
        control = json.loads(design.attrs["config"])["control"]
        kinds = [control[kind] for kind in ("suspension", "guidance")]
        groups = [str(one["group"]) for one in kinds]
        times = [
            [f"{one[key]} of {key}" for key in ("lag", "delay") if float(one[key].split()[0])]
            for one in kinds
        ]
    except (KeyError, TypeError):
        raise UserError("the file must say how its circuits were configured") from None
    late = [_in_ms(", ".join(one)) for one in times]
    if groups[0] == groups[1] and late[0] == late[1]:
        words = ", ".join(filter(None, (_GROUP[groups[0]], late[0])))
    else:
        words = "; ".join(
            ", ".join(filter(None, (f"{kind} {group}", one)))
            for kind, group, one in zip(("suspension", "guidance"), groups, late, strict=True)
        )
    if any(late):
        return words, {"color": _LATE_COLOUR[groups[0]], "ls": (0, (5, 1))}
    return words, {"color": _GROUP_COLOUR[groups[0]], "ls": _GROUP_DASHES[groups[0]]}


def _in_ms(words: str) -> str:
    """Times in words as milliseconds."""
    return re.sub(r"([0-9.e+-]+) s\b", lambda found: f"{1e3 * float(found[1]):g} ms", words)


def response_panels(height: float) -> tuple[Figure, list[tuple[int, Axes, Shown]]]:
    """A figure of six titled panels; for each response its number, its panel and its labels.

    Parameters
    ----------
    height
        Of the figure [inch].
    """
    figure, axes = style.panels(2, 3, style.PAGE, height)
    for letter, axis, shown in zip("abcdef", axes, SHOWN, strict=True):
        style.titled(axis, letter, shown.name)
    return figure, list(zip(range(len(SHOWN)), axes, SHOWN, strict=True))


def of_runs(name: str, n_runs: SupportsInt, lost_probability: SupportsFloat) -> str:
    """Legend entry of a curve: name, number of runs, share of lost runs."""
    return f"{name}, {int(n_runs)} runs, lost {percent(float(lost_probability))}"


def of_settings(design: xr.Dataset) -> str:
    """Title of a legend: coefficient of variation and number of spans."""
    variation, n_spans = settings(design)
    return f"random ({n_spans} spans, coefficient of variation {variation:.2f})"


def percent(share: float) -> str:
    """A share as a percentage with two digits."""
    if share == 0.0:
        return "0 %"
    return f"{100 * share:.2g} %" if share >= 1e-5 else "< 0.001 %"
