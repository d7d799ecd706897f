"""Effect of the sharing of circuits and of their lag on losses, deviations and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from maglev.parameters import Circuit, Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, extremes, lost, responses_of
from maglev.stages.tables import markdown, number, of_track
from maglev.uncertainty.samples import deviation_interval
from maglev.vocabulary import BASELINE, GROUPS, RESPONSE_UNITS, Response

KINDS = ("suspension", "guidance")
_ENDS = ("", "_low", "_high")
_OF_LIMITS = tuple(f"{name}{end}" for name in ("limit", "held_limit") for end in _ENDS)
_LOST = tuple(f"lost_probability{end}" for end in _ENDS)


def circuit(config: Config, case: str, kind: str) -> Circuit:
    """Circuits of a kind of magnet in a case, with the values that the case sets."""
    prefix = f"control.{kind}."
    own = {
        key.removeprefix(prefix): value
        for key, value in config.cases[case].set.items()
        if key.startswith(prefix)
    }
    common: Circuit = getattr(config.control, kind)
    return Circuit.model_validate({**common.quantities(), **own})


def dataset(
    config: Config,
    limits: Mapping[tuple[str, str], xr.Dataset],
    baseline: Mapping[str, xr.Dataset],
) -> xr.Dataset:
    """Put losses, deviations and limits of the cases side by side.

    Parameters
    ----------
    config
        The configuration.
    limits
        Layout ``limits``, by case and method.
    baseline
        Layout ``runs``, by case: deviations are those of these runs.

    Returns
    -------
    dataset
        Layout ``control_study``: one ``curve`` for each case and method; deviations are NaN for
        methods without a baseline of their own, or where fewer than eight runs held.
    """
    pairs = list(limits)
    responses = responses_of(limits[pairs[0]])
    columns: dict[str, list[Any]] = {}
    for case, method in pairs:
        one = limits[case, method]
        row: dict[str, Any] = {}
        for kind in KINDS:
            of_kind = circuit(config, case, kind)
            row[f"{kind}_group"] = GROUPS.index(of_kind.group)
            row[f"{kind}_lag"], row[f"{kind}_delay"] = of_kind.lag, of_kind.delay
        for name in (*_OF_LIMITS, *_LOST, "n_runs"):
            row[f"curve_{name}"] = one[name].to_numpy()
        runs = baseline.get(case) if method == BASELINE else None
        moments = _moments(runs, responses, config.study.confidence)
        row["curve_mean"] = moments[0]
        for end, values in zip(_ENDS, moments[1:], strict=True):
            row[f"curve_deviation{end}"] = values
        for name, value in row.items():
            columns.setdefault(name, []).append(value)
    dims = ("curve", "response", "failure_probability")
    variables = {}
    for name, values in columns.items():
        stacked = np.stack(values)
        variables[name] = (dims[: stacked.ndim], stacked)
    curve = np.arange(len(pairs), dtype=np.int32)
    result = xr.Dataset(
        variables,
        coords=coordinates(
            responses,
            curve=curve,
            failure_probability=limits[pairs[0]]["failure_probability"].to_numpy(),
        ),
    )
    result["curve"].attrs = {
        "flag_values": curve,
        "flag_meanings": " ".join("-".join(pair) for pair in pairs),
    }
    return result


def _moments(
    runs: xr.Dataset | None, responses: Sequence[Response], confidence: float
) -> np.ndarray:
    """Mean, standard deviation and its interval (moment, response) of the held runs."""
    if runs is None or np.count_nonzero(~lost(runs)) < 8:
        return np.full((4, len(responses)), np.nan)
    values = extremes(runs, responses)[~lost(runs)]
    ends = [deviation_interval(column, confidence) for column in values.T]
    return np.vstack([values.mean(axis=0), np.array(ends).T])


def named_curves(found: xr.Dataset) -> list[tuple[str, str]]:
    """Case and method of each curve of the file."""
    words = str(found["curve"].attrs["flag_meanings"]).split()
    return [(case, method) for case, _, method in (word.rpartition("-") for word in words)]


def rows(found: xr.Dataset) -> list[dict[str, object]]:
    """The table as rows of a CSV file: one per case, method, response and failure probability."""
    made: list[dict[str, object]] = []
    for k, (case, method) in enumerate(named_curves(found)):
        one = found.isel(curve=k)
        shared: dict[str, object] = {
            "case": case,
            "method": method,
            "track": str(found.attrs.get("track", "")),
            **{f"{kind}_group": GROUPS[int(one[f"{kind}_group"])] for kind in KINDS},
            **{
                f"{kind}_{late}_ms": 1e3 * float(one[f"{kind}_{late}"])
                for kind in KINDS
                for late in ("lag", "delay")
            },
            "n_runs": int(one["curve_n_runs"]),
            **{name: float(one[f"curve_{name}"]) for name in _LOST},
        }
        for r, response in enumerate(responses_of(found)):
            at = one.isel(response=r)
            for p, level in enumerate(found["failure_probability"].to_numpy()):
                made.append(
                    {
                        **shared,
                        "response": response,
                        "unit": RESPONSE_UNITS[response],
                        "mean": float(at["curve_mean"]),
                        **{f"deviation{end}": float(at[f"curve_deviation{end}"]) for end in _ENDS},
                        "failure_probability": float(level),
                        **{
                            name: float(at[f"curve_{name}"].isel(failure_probability=p))
                            for name in _OF_LIMITS
                        },
                    }
                )
    return made


def _with_ends(at: xr.Dataset, name: str) -> str:
    """A number of a file with its interval, or a dash where there is none."""
    middle, low, high = (float(at[f"curve_{name}{end}"]) for end in _ENDS)
    if np.isinf(middle):
        return "none, losses are likelier"
    return f"{number(middle)} [{number(low)}, {number(high)}]" if np.isfinite(middle) else "–"


def text(found: xr.Dataset) -> str:
    """The table in Markdown: losses, then means and deviations, then limits."""
    pairs = named_curves(found)

    def words(one: xr.Dataset, kind: str) -> str:
        late = [
            f"{1e3 * float(one[f'{kind}_{key}']):g} ms {key}"
            for key in ("lag", "delay")
            if float(one[f"{kind}_{key}"])
        ]
        return ", ".join([GROUPS[int(one[f"{kind}_group"])], *late])

    curves = [found.isel(curve=k) for k in range(len(pairs))]
    losses = [
        [
            case,
            method,
            *(words(one, kind) for kind in KINDS),
            str(int(one["curve_n_runs"])),
            _with_ends(one, "lost_probability"),
        ]
        for (case, method), one in zip(pairs, curves, strict=True)
    ]
    counted = [k for k, (_, method) in enumerate(pairs) if method == BASELINE]
    deviations = [
        [
            f"{response} [{RESPONSE_UNITS[response]}]",
            *(
                f"{number(curves[k]['curve_mean'][r])}; "
                f"{_with_ends(curves[k].isel(response=r), 'deviation')}"
                for k in counted
            ),
        ]
        for r, response in enumerate(responses_of(found))
    ]
    limits = [
        [
            f"{response} [{RESPONSE_UNITS[response]}]",
            f"{level:g}",
            *(
                _with_ends(one.isel(response=r, failure_probability=p), "held_limit")
                for one in curves
            ),
        ]
        for r, response in enumerate(responses_of(found))
        for p, level in enumerate(found["failure_probability"].to_numpy())
    ]
    heads = [f"{case}, {method}" for case, method in pairs]
    parts = [
        "# Who shares a circuit, and how late its current comes\n",
        markdown(
            ["case", "method", *KINDS, "runs", "P(levitation lost) [its interval]"],
            losses,
        ),
    ]
    if counted:
        parts += [
            "Mean; standard deviation [its interval] of the runs that held.\n",
            markdown(["response", *(heads[k] for k in counted)], deviations),
        ]
    parts += [
        "Limits given that levitation holds [their intervals]; a dash where the runs do not carry "
        "one.\n",
        markdown(["response", "failure probability", *heads], limits),
        f"{of_track(found)}\n",
    ]
    return "\n".join(parts)


def table(found: xr.Dataset) -> tuple[list[dict[str, object]], str]:
    """Rows and text of the table of the cases."""
    return rows(found), text(found)


STAGE = Stage(
    name="control_study",
    of="run",
    reads=("control", "cases", "study.confidence"),
    inputs={
        "limits": Input("limits", by=("case", "method")),
        "baseline": Input("runs", by=("case",)),
    },
    layout="control_study",
    compute=dataset,
    table=table,
)
