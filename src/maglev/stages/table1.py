"""Table 1: limits of the responses at the failure probabilities, by every method of a case."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
import xarray as xr

from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, responses_of
from maglev.stages.tables import markdown, number, of_track
from maglev.vocabulary import GIVEN, INFINITE, LIMIT_STATUS, METHODS, RESPONSE_UNITS

_OF_METHOD = tuple(
    f"{name}{end}" for name in ("limit", "held_limit") for end in ("", "_low", "_high", "_status")
)
_LOST = ("lost_probability", "lost_probability_low", "lost_probability_high")


def dataset(config: Config, limits: Mapping[str, xr.Dataset]) -> xr.Dataset:
    """Put the limits of the methods of one case side by side.

    Parameters
    ----------
    config
        The configuration, of which nothing is read.
    limits
        Layout ``limits``, by method.

    Returns
    -------
    dataset
        Layout ``table1``.

    Raises
    ------
    UserError
        If there is no method, or their failure probabilities differ.
    """
    if not limits:
        raise UserError("table 1 needs the limits of at least one method, got none")
    names = sorted(limits, key=METHODS.index)
    levels = limits[names[0]]["failure_probability"].to_numpy()
    for name in names[1:]:
        others = limits[name]["failure_probability"].to_numpy()
        if not np.array_equal(others, levels):
            raise UserError(
                f"limits of '{names[0]}' and '{name}' must be at the same failure probabilities, "
                f"got {levels} and {others}; compute them again"
            )
    dims = ("method", "response", "failure_probability")
    variables: dict[str, tuple[tuple[str, ...], npt.ArrayLike]] = {
        f"table_{name}": (dims, np.stack([limits[one][name].to_numpy() for one in names]))
        for name in _OF_METHOD
    }
    variables |= {
        f"table_{name}": (dims[:1], np.array([float(limits[one][name]) for one in names]))
        for name in _LOST
    }
    variables["table_n_runs"] = (dims[:1], [int(limits[one]["n_runs"]) for one in names])
    result = xr.Dataset(
        variables,
        coords=coordinates(
            responses_of(limits[names[0]]), method=names, failure_probability=levels
        ),
    )
    for name in ("limit", "lost_probability"):
        said = {one: limits[one][name].attrs.get("comment", "") for one in names}
        result[f"table_{name}"].attrs["comment"] = "; ".join(
            f"{one}: {text}" for one, text in said.items() if text
        )
    return result


def rows(table: xr.Dataset) -> list[dict[str, object]]:
    """The table as rows of a CSV file: one per response, failure probability and method."""
    found: list[dict[str, object]] = []
    for r, response in enumerate(responses_of(table)):
        for p, level in enumerate(table["failure_probability"].to_numpy()):
            for m, method in enumerate(table["method"].to_numpy().tolist()):
                at = {"response": r, "failure_probability": p, "method": m}
                one = table.isel(at)
                found.append(
                    {
                        "response": response,
                        "track": str(table.attrs.get("track", "")),
                        "unit": RESPONSE_UNITS[response],
                        "failure_probability": float(level),
                        "method": method,
                        "n_runs": int(one["table_n_runs"]),
                        "limit": float(one["table_limit"]),
                        "limit_low": float(one["table_limit_low"]),
                        "limit_high": float(one["table_limit_high"]),
                        "status": LIMIT_STATUS[int(one["table_limit_status"])],
                        "held_limit": float(one["table_held_limit"]),
                        "held_limit_low": float(one["table_held_limit_low"]),
                        "held_limit_high": float(one["table_held_limit_high"]),
                        "held_status": LIMIT_STATUS[int(one["table_held_limit_status"])],
                    }
                )
    return found


def text(table: xr.Dataset, heading: str) -> str:
    """The table in Markdown: a row per response and failure probability, a column per method."""
    methods = table["method"].to_numpy().tolist()
    header = [
        "response",
        "failure probability",
        *(
            f"{method}, {int(n)} runs"
            for method, n in zip(methods, table["table_n_runs"], strict=True)
        ),
    ]
    by_place = {
        (row["response"], row["failure_probability"], row["method"]): row for row in rows(table)
    }

    def body(prefix: str) -> list[list[str]]:
        return [
            [
                f"{response} [{RESPONSE_UNITS[response]}]",
                f"{level:g}",
                *(_cell(by_place[response, float(level), one], prefix) for one in methods),
            ]
            for response in responses_of(table)
            for level in table["failure_probability"].to_numpy()
        ]

    lost = [
        f"{float(p):.2g} [{float(low):.2g}, {float(high):.2g}]"
        for p, low, high in zip(*(table[f"table_{name}"] for name in _LOST), strict=True)
    ]
    notes = [table[f"table_{name}"].attrs["comment"] for name in ("limit", "lost_probability")]
    return (
        f"# {heading}\n\nLimit [lower, upper end of its interval].  A passage that loses "
        "levitation exceeds every limit.\n\n"
        f"{markdown(header, [*body(''), ['levitation lost', '', *lost]])}\n"
        "The same given that levitation holds.\n\n"
        f"{markdown(header, body('held_'))}\n"
        f"Limits: {notes[0]}.\n\nLost levitation: {notes[1]}.\n\n{of_track(table)}\n"
    )


def _cell(row: Mapping[str, object], prefix: str) -> str:
    """A limit with its interval, or the reason for none."""
    status = row[f"{prefix}status"]
    if status == INFINITE:
        return "none, losses are likelier"
    if status != GIVEN:
        return str(status).replace("_", " ")
    limit, low, high = (number(row[f"{prefix}limit{end}"]) for end in ("", "_low", "_high"))
    return f"{limit} [{low}, {high}]"


def table(found: xr.Dataset) -> tuple[list[dict[str, object]], str]:
    """Rows and text of the table of a case."""
    return rows(found), text(found, f"Limits of the extremes, case '{found.attrs['case']}'")


STAGE = Stage(
    name="table1",
    of="case",
    reads=(),
    inputs={"limits": Input("limits", by=("method",))},
    layout="table1",
    compute=dataset,
    table=table,
)
