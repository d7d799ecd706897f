"""Table of the limits: those of the extremes by every case and method, for a person."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, responses_of
from maglev.stages.tables import SHOWN, markdown, of_track
from maglev.vocabulary import (
    GIVEN,
    INFINITE,
    LIMIT_STATUS,
    METHODS,
    RESPONSE_UNITS,
    RESPONSE_WORDS,
)

_ENDS = ("", "_low", "_high")
_OF_LIMIT = tuple(f"{name}{end}" for name in ("limit", "held_limit") for end in (*_ENDS, "_status"))
_OF_METHOD = tuple(f"lost_probability{end}" for end in _ENDS)


def dataset(config: Config, limits: Mapping[tuple[str, str], xr.Dataset]) -> xr.Dataset:
    """Put the limits of all cases and methods side by side.

    Parameters
    ----------
    config
        The configuration, of which nothing is read.
    limits
        Layout ``limits``, by case and method.

    Returns
    -------
    dataset
        Layout ``limits_table``; NaN where a case has no such method.

    Raises
    ------
    UserError
        If there is no file, or files are of other responses or failure probabilities.
    """
    if not limits:
        raise UserError("the table of limits needs a case with a method, got none")
    names, first = next(iter(limits.items()))
    for (case, method), one in limits.items():
        if not all(one[name].equals(first[name]) for name in ("response", "failure_probability")):
            raise UserError(
                f"the limits of '{case}', {method}, are of other responses or failure "
                f"probabilities than those of {' '.join(names)}; compute them again"
            )
    cases = list(dict.fromkeys(case for case, _ in limits))
    methods: list[str] = [name for name in METHODS if any(name == one for _, one in limits)]
    shape = (len(cases), len(methods))
    levels = (first.sizes["response"], first.sizes["failure_probability"])
    columns = {name: np.full((*shape, *levels), np.nan) for name in _OF_LIMIT}
    columns |= {name: np.full(shape, np.nan) for name in _OF_METHOD}
    n_runs = np.zeros(shape, dtype=int)
    for (case, method), one in limits.items():
        at = cases.index(case), methods.index(method)
        n_runs[at] = int(one["n_runs"])
        for name, column in columns.items():
            column[at] = one[name].to_numpy()
    too_few = LIMIT_STATUS.index("too_few_exceedances")
    dims = ("case", "method", "response", "failure_probability")
    return xr.Dataset(
        {
            name: (
                dims[: column.ndim],
                np.nan_to_num(column, nan=too_few).astype(int) if "status" in name else column,
            )
            for name, column in columns.items()
        }
        | {"n_runs": (dims[:2], n_runs)},
        coords=coordinates(
            responses_of(first),
            case=cases,
            method=methods,
            failure_probability=first["failure_probability"].to_numpy(),
        ),
    )


def three_digits(value: float) -> str:
    """A number with three significant digits and no exponent; a word for NaN and infinity.

    Examples
    --------
    >>> three_digits(1.72249), three_digits(0.0004), three_digits(float("inf"))
    ('1.72', '0.0004', '∞')
    """
    if not np.isfinite(value):
        return "–" if np.isnan(value) else "∞"
    return np.format_float_positional(float(f"{value:.3g}"), trim="-")


def rows(found: xr.Dataset) -> list[dict[str, object]]:
    """The table as rows of a CSV file: one per case, method, response and failure probability."""
    made: list[dict[str, object]] = []
    for of_case in _along(found, "case"):
        for of_method in _methods_of(of_case):
            for of_response in _along(of_method, "response"):
                scale, unit = _shown(of_response)
                for one in _along(of_response, "failure_probability"):
                    made.append(
                        {
                            "case": one["case"].item(),
                            "method": one["method"].item(),
                            "n_runs": int(one["n_runs"]),
                            "response": one["response"].item(),
                            "unit": unit,
                            "failure_probability": float(one["failure_probability"]),
                            **_numbers(one, "", scale),
                            **_numbers(one, "held_", scale),
                        }
                    )
    return made


def _along(found: xr.Dataset, dim: str) -> list[xr.Dataset]:
    """The parts of a file along a dimension."""
    return [found.isel({dim: k}) for k in range(found.sizes[dim])]


def _methods_of(of_case: xr.Dataset) -> list[xr.Dataset]:
    """The parts of a case by the methods that it has."""
    return [one for one in _along(of_case, "method") if int(one["n_runs"])]


def _shown(of_response: xr.Dataset) -> tuple[float, str]:
    """Scale and unit for a person of a response."""
    return SHOWN[RESPONSE_UNITS[of_response["response"].item()]]


def _numbers(one: xr.Dataset, prefix: str, scale: float) -> dict[str, object]:
    """A limit with its interval in the unit of a person, and its status."""
    found: dict[str, object] = {
        f"{prefix}limit{end}": scale * float(one[f"{prefix}limit{end}"]) for end in _ENDS
    }
    return found | {f"{prefix}status": LIMIT_STATUS[int(one[f"{prefix}limit_status"])]}


def text(found: xr.Dataset) -> str:
    """The table in Markdown: a section for each case, of all passages and of those that hold."""
    parts = [
        "# Limits of the extremes\n",
        "Limit [lower, upper end of its interval] that the largest value of a response in a "
        "passage exceeds with the failure probability.  A passage that loses levitation exceeds "
        "every limit.\n",
    ]
    for of_case in _along(found, "case"):
        methods = _methods_of(of_case)
        header = [
            "response",
            "failure probability",
            *(f"{one['method'].item()}, {int(one['n_runs'])} runs" for one in methods),
        ]
        lost = ["levitation lost [%]", "", *(_lost(one) for one in methods)]
        parts.append(f"## {of_case['case'].item()}\n")
        parts.append(markdown(header, [*_body(methods, ""), lost]))
        parts.append("Given that levitation holds.\n")
        parts.append(markdown(header, _body(methods, "held_")))
    return "\n".join([*parts, f"{of_track(found)}\n"])


def _body(methods: list[xr.Dataset], prefix: str) -> list[list[str]]:
    """Rows of a case, a cell by each of its methods."""
    made = []
    for response, of_response in enumerate(_along(methods[0], "response")):
        scale, unit = _shown(of_response)
        words = RESPONSE_WORDS[of_response["response"].item()]
        for level, one in enumerate(_along(of_response, "failure_probability")):
            at = {"response": response, "failure_probability": level}
            cells = [_cell(_numbers(each.isel(at), prefix, scale), prefix) for each in methods]
            name = f"{words} [{unit or '-'}]" if level == 0 else ""
            made.append([name, f"{float(one['failure_probability']):g}", *cells])
    return made


def _cell(numbers: Mapping[str, object], prefix: str) -> str:
    """A limit with its interval, or the reason for none."""
    status = str(numbers[f"{prefix}status"])
    if status == INFINITE:
        return "none, losses are likelier"
    if status != GIVEN:
        return status.replace("_", " ")
    value, low, high = (three_digits(float(str(numbers[f"{prefix}limit{end}"]))) for end in _ENDS)
    return f"{value} [{low}, {high}]"


def _lost(one: xr.Dataset) -> str:
    """Probability in per cent that levitation is lost, with its interval."""
    value, low, high = (three_digits(100 * float(one[name])) for name in _OF_METHOD)
    return f"{value} [{low}, {high}]"


def table(found: xr.Dataset) -> tuple[list[dict[str, object]], str]:
    """Rows and text of the table of all cases."""
    return rows(found), text(found)


STAGE = Stage(
    name="limits_table",
    of="run",
    reads=(),
    inputs={"limits": Input("limits", by=("case", "method"))},
    layout="limits_table",
    compute=dataset,
    table=table,
)
