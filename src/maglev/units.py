"""Quantities as a person writes them: a number with its unit, converted to SI once."""

from __future__ import annotations

import re
import tokenize
from functools import lru_cache
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pint


@lru_cache(maxsize=1)
def _units() -> pint.UnitRegistry:
    import pint  # half a second, spared where every unit is an SI unit already

    return pint.UnitRegistry()


_QUANTITY = re.compile(
    r"\s*(?P<number>[-+]?(\d+(\.\d*)?|\.\d+)([eE][-+]?\d+)?)\s*"
    r"(?P<unit>(?![eE][-+]?\d)[^\W\d].*?)\s*"
)
_FACTORS = {
    ("km/h", "m/s"): (1.0, 3.6),
    ("mm", "m"): (1.0, 1000.0),
    ("ms", "s"): (1.0, 1000.0),
    ("kN", "N"): (1000.0, 1.0),
}
"""What a number in the first unit is multiplied with and divided by for the second."""


def _unreadable() -> tuple[type[Exception], ...]:
    """Exceptions of pint for an unreadable unit."""
    import pint

    python = (ArithmeticError, AssertionError, SyntaxError, TypeError, ValueError)
    return (pint.errors.PintError, tokenize.TokenError, *python)


def in_unit(text: str, unit: str, key: str) -> float:
    """Convert a text such as ``"430 km/h"`` to a number in ``unit``.

    Parameters
    ----------
    text
        A number and its unit.
    unit
        SI unit of the result, in the notation of pint.
    key
        What the quantity is called in messages.

    Raises
    ------
    ValueError
        If the text is no number with a unit that converts.

    Examples
    --------
    >>> in_unit("360 km/h", "m/s", "speed")
    100.0
    """
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise ValueError(
            f"{key} must be a number with a unit of {unit}, such as '1.5 {unit}', got {text!r}"
        )
    number = float(match["number"])
    if match["unit"] == unit:
        return number
    if (match["unit"], unit) in _FACTORS:
        times, over = _FACTORS[match["unit"], unit]
        return number * times / over
    try:
        value = _units().Quantity(number, match["unit"])
    except _unreadable() as error:
        raise ValueError(
            f"{key} must be a number with a unit of {unit}, got {text!r}, whose unit is not known"
        ) from error
    if not value.is_compatible_with(unit):
        raise ValueError(
            f"{key} must be given in {unit} or a unit that converts to it, got {text!r}"
        )
    return float(value.to(unit).magnitude)
