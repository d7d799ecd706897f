"""Names, units and colours of responses, gains, methods and cases, the same in every figure."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from string import ascii_lowercase
from typing import SupportsFloat, SupportsInt

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.typing import LineStyleType

from maglev.errors import UserError
from maglev.figures import style
from maglev.vocabulary import METHODS, RESPONSE_UNITS


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
        inverse = {"mm": "1/mm", "m/s²": "s²/m", "-": "-"}.get(self.unit, f"1/({self.unit})")
        return f"density [{inverse}]"


_AXIS = {
    "m": ("displacement", 1e3, "mm"),
    "m s-2": ("acceleration", 1.0, "m/s²"),
}
"""Symbol, scale and unit on an axis of responses of a unit; others are shown as they are."""

_NAMES: Mapping[str, str] = {
    "girder_displacement_z": "midspan displacement, vert.",
    "girder_displacement_y": "midspan displacement, lat.",
    "girder_acceleration_z": "midspan acceleration, vert.",
    "girder_acceleration_y": "midspan acceleration, lat.",
    "car_body_acceleration_z": "car-body acceleration, vert.",
    "car_body_acceleration_y": "car-body acceleration, lat.",
}
"""Titles of panels; of any other response its name in words."""


def shown(response: str) -> Shown:
    """How a response is shown.

    Examples
    --------
    >>> shown("girder_displacement_z").axis
    'displacement [mm]'
    """
    name = response.replace("_", " ").removesuffix(" z").removesuffix(" y")
    side = {"_z": ", vert.", "_y": ", lat."}.get(response[-2:], "")
    unit = RESPONSE_UNITS[response]
    symbol, scale, written = _AXIS.get(unit, (name, 1.0, unit.replace("1", "-")))
    if "displacement" not in response and symbol == "displacement":
        symbol = name
    title = _NAMES.get(response, f"{name}{side}")
    return Shown(name=title, symbol=symbol, scale=scale, unit=written)


GAIN = {
    "gains.suspension_proportional": "suspension $k_p$",
    "gains.suspension_derivative": "suspension $k_d$",
    "gains.guidance_proportional": "guidance $k_p$",
    "gains.guidance_derivative": "guidance $k_d$",
}
"""The gains in short, by their keys in the configuration."""

GAIN_COLOUR = dict(zip(GAIN, ("#0072B2", "#56B4E9", "#D55E00", "#E69F00"), strict=True))
"""Their colours: suspension blue, guidance orange."""


def parameter_name(key: str) -> str:
    """Name of a random quantity in short, from its dotted key.

    Examples
    --------
    >>> parameter_name("train.car_body.mass")
    'car body mass'
    """
    return GAIN.get(key, " ".join(key.split(".")[-2:]).replace("_", " "))


def parameter_colour(key: str) -> str:
    """Colour of a random quantity."""
    return GAIN_COLOUR.get(key, "#009E73")


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

_OVER: dict[str, style.Look] = {
    "mcm": {"lw": 1.1, "zorder": 2.2},
    "osm": {"lw": 1.0, "zorder": 2.4},
    "asm_paper": {"lw": 1.0, "zorder": 2.3},
    "asm": {"lw": 2.6, "alpha": 0.55, "zorder": 2.1},
}
"""What lets lines of several methods lie on each other: a broad pale one below, dashes on top."""


def method_line(name: str) -> style.Look:
    """Line style of a method in a panel where the lines of several methods lie on each other.

    Examples
    --------
    >>> method_line("mcm")["color"]
    '#000000'
    """
    return {**METHOD_STYLE[name], **_OVER[name]}


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

    The coefficient is NaN where the random quantities of the case have several or none.

    Raises
    ------
    UserError
        If the file does not say them.
    """
    try:
        config = json.loads(design.attrs["config"])
        laws = config["cases"][design.attrs["case"]]["random"].values()
        n_spans = int(config["guideway"]["n_spans"])
    except (KeyError, TypeError):
        raise UserError("the file must say its case and how it was configured") from None
    variations = {law.get("coefficient_of_variation") for law in laws}
    only = variations.pop() if len(variations) == 1 else None
    return float("nan") if only is None else float(only), n_spans


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


def parameters_of(data: xr.Dataset) -> list[str]:
    """Keys of the random quantities of a file."""
    return [str(key) for key in data["parameter"].to_numpy()]


def case_style(parameters: list[str]) -> tuple[str, style.Look]:
    """Name and line style of a case, from its random quantities."""
    if len(parameters) == 1:
        (key,) = parameters
        dashes = _DASHES[list(GAIN).index(key)] if key in GAIN else "-"
        return f"{parameter_name(key)} alone", {"color": parameter_colour(key), "ls": dashes}
    if set(parameters) == set(GAIN):
        return "all four gains", {"color": "#000000", "ls": "-"}
    words = " and ".join(parameter_name(key) for key in parameters)
    if len(parameters) > 3:
        words = f"{len(parameters)} random quantities"
    return words, {"color": "#999999", "ls": "-"}


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


COLUMNS = 3
"""Panels side by side."""


def response_panels(
    data: xr.Dataset, height: float
) -> tuple[Figure, list[tuple[int, Axes, Shown]]]:
    """A figure of titled panels; for each response its number, its panel and its labels.

    Parameters
    ----------
    data
        What is shown, along ``response``.
    height
        Of the figure with two rows of panels [inch].
    """
    names = [shown(str(one)) for one in data["response"].to_numpy()]
    columns = min(COLUMNS, len(names))
    rows = -(-len(names) // columns)
    figure, axes = style.panels(rows, columns, style.PAGE, height * (0.25 + 0.375 * rows))
    for letter, axis, one in zip(ascii_lowercase, axes, names, strict=False):
        style.titled(axis, letter, one.name)
    for axis in axes[len(names) :]:
        axis.remove()
    return figure, list(zip(range(len(names)), axes, names, strict=False))


def lowest(number: int, data: xr.Dataset) -> bool:
    """Whether no panel stands below that of a response."""
    return number >= data.sizes["response"] - COLUMNS


def of_runs(name: str, n_runs: SupportsInt, lost_probability: SupportsFloat) -> str:
    """Legend entry of a curve: name, number of runs, share of lost runs."""
    return f"{name}, {int(n_runs)} runs, lost {percent(float(lost_probability))}"


def of_settings(design: xr.Dataset) -> str:
    """Title of a legend: coefficient of variation and number of spans."""
    variation, n_spans = settings(design)
    by = "" if math.isnan(variation) else f", coefficient of variation {variation:.2f}"
    return f"random ({n_spans} spans{by})"


def percent(share: float) -> str:
    """A share as a percentage with two digits."""
    if share == 0.0:
        return "0 %"
    return f"{100 * share:.2g} %" if share >= 1e-5 else "< 0.001 %"
