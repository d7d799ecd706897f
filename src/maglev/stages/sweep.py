"""Limits, probabilities of limit states, and extremes at the mean along a swept key."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr

from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, extremes, responses_of
from maglev.stages.points import case_of
from maglev.stages.reads import RUNS_OF_CASE

_ENDS = ("", "_low", "_high")
_OF_LIMIT = tuple(f"{name}{end}" for name in ("limit", "held_limit") for end in (*_ENDS, "_status"))
_OF_STATE = ("definition", "origin", "state_response", "threshold", "target")
_PROBABILITIES = tuple(
    f"{name}{end}" for name in ("probability", "held_probability", "beta") for end in _ENDS
)


def dataset(
    config: Config,
    case: str,
    limits: Mapping[tuple[str, str], xr.Dataset],
    limit_states: Mapping[tuple[str, str], xr.Dataset],
    mean_run: Mapping[str, xr.Dataset],
) -> xr.Dataset:
    """Put what the cases of a sweep have found side by side, in the order of the sweep.

    Parameters
    ----------
    config
        The configuration.
    case
        Name of the case that is swept.
    limits, limit_states
        Layouts of these names, by case and method: one method for each case of the sweep.
    mean_run
        Layout ``runs``, by case.

    Returns
    -------
    dataset
        Layout ``sweep``; the extreme at the mean is NaN where levitation is lost.

    Raises
    ------
    UserError
        If the case is not swept, a file of one of its cases is missing, or files do not go
        together.
    """
    settings = case_of(config, case).settings()
    if not settings:
        raise UserError(f"the case '{case}' has no sweep; give it one, or take another case")
    names = [f"{case}_{number}" for number in settings]
    methods = {of_case: method for of_case, method in limits}
    found = [_of_names({one: limits[one, methods[one]] for one in methods}, names, "limits")]
    found.append(_of_names({one: file for (one, _), file in limit_states.items()}, names, "states"))
    found.append(_of_names(mean_run, names, "a run at the mean"))
    _refuse_others(found[0], ("response", "failure_probability"), names)
    _refuse_others(found[1], ("limit_state", *_OF_STATE), names)
    result = _side_by_side(*found).assign_coords(setting=names)
    result = result.assign(_swept(config, case)).assign_coords(
        swept_parameter=list(case_of(config, case).sweep)
    )
    result.attrs["method"] = ", ".join(dict.fromkeys(methods.values()))
    return result


def _of_names(files: Mapping[str, xr.Dataset], names: Sequence[str], what: str) -> list[xr.Dataset]:
    """Files in the order of the cases of a sweep."""
    missing = [name for name in names if name not in files]
    if missing:
        raise UserError(f"the sweep has no {what} of {', '.join(missing)}; compute them first")
    return [files[name] for name in names]


def _refuse_others(files: Sequence[xr.Dataset], same: Sequence[str], names: Sequence[str]) -> None:
    """Refuse files that are of other responses, levels or limit states than the first one."""
    for name, one in zip(names, files, strict=True):
        for variable in same:
            if not one[variable].equals(files[0][variable]):
                raise UserError(
                    f"the files of '{name}' and '{names[0]}' differ in {variable}; compute them "
                    "again"
                )


def _side_by_side(
    limits: Sequence[xr.Dataset], states: Sequence[xr.Dataset], mean_runs: Sequence[xr.Dataset]
) -> xr.Dataset:
    """What the files of a sweep hold, along ``setting``."""
    responses = responses_of(limits[0])
    dims = ("setting", "response", "failure_probability")
    along_states = ("setting", "limit_state")
    return xr.Dataset(
        {
            **{name: (dims, np.stack([one[name] for one in limits])) for name in _OF_LIMIT},
            **{name: states[0][name].drop_attrs() for name in _OF_STATE},
            **{
                name: (along_states, np.stack([one[name] for one in states]))
                for name in _PROBABILITIES
            },
            "extreme_at_mean": (
                dims[:2],
                np.concatenate([extremes(one, responses) for one in mean_runs]),
            ),
            "status_at_mean": (
                dims[:1],
                np.concatenate([one["status"].to_numpy() for one in mean_runs]),
            ),
            "n_runs": (dims[:1], [int(one["n_runs"]) for one in limits]),
        },
        coords=coordinates(
            responses,
            failure_probability=limits[0]["failure_probability"].to_numpy(),
            limit_state=states[0]["limit_state"].to_numpy(),
        ),
    )


def _swept(config: Config, case: str) -> dict[str, xr.DataArray]:
    """Values of the swept keys of each setting, in SI and as they are written."""
    settings = list(case_of(config, case).settings().values())
    found = [[config.swept_number(*pair) for pair in each.items()] for each in settings]
    values = [[number for number, _ in each] for each in found]
    units = {"units_by_swept_parameter": ", ".join(unit or "1" for _, unit in found[0])}
    words = [[str(value) for value in each.values()] for each in settings]
    dims = ("setting", "swept_parameter")
    return {
        "swept_value": xr.DataArray(values, dims=dims, attrs=units),
        "swept_text": xr.DataArray(words, dims=dims),
    }


STAGE = Stage(
    name="sweep",
    of="case",
    reads=(*RUNS_OF_CASE, "cases.{case}.sweep", "study.confidence"),
    inputs={
        "limits": Input("limits", by=("case", "method")),
        "limit_states": Input("limit_states", by=("case", "method")),
        "mean_run": Input("runs", by=("case",)),
    },
    takes={"case": str},
    layout="sweep",
    compute=dataset,
)
