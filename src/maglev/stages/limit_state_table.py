"""Table of the limit states: their probabilities by every case and method, for a person."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import xarray as xr

from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.tables import SHOWN, markdown, of_track
from maglev.vocabulary import METHODS, RESPONSE_UNITS, RESPONSE_WORDS

_ENDS = ("", "_low", "_high")
_OF_STATE = ("definition", "origin", "state_response", "threshold", "target")
_NAMES = tuple(
    f"{name}{end}" for name in ("probability", "held_probability", "beta") for end in _ENDS
)


def dataset(config: Config, limit_states: Mapping[tuple[str, str], xr.Dataset]) -> xr.Dataset:
    """Put the probabilities of the limit states of all cases and methods side by side.

    Parameters
    ----------
    config
        The configuration, of which nothing is read.
    limit_states
        Layout ``limit_states``, by case and method.

    Returns
    -------
    dataset
        Layout ``limit_state_table``; NaN where a case has no such method.

    Raises
    ------
    UserError
        If there is no file, or files have other limit states.
    """
    if not limit_states:
        raise UserError("the table of limit states needs a case with a method, got none")
    first = next(iter(limit_states.values()))
    for (case, method), one in limit_states.items():
        if not all(one[name].equals(first[name]) for name in ("limit_state", *_OF_STATE)):
            raise UserError(
                f"the limit states of '{case}', {method}, are others than those of "
                f"{' '.join(next(iter(limit_states)))}; compute them again"
            )
    cases = list(dict.fromkeys(case for case, _ in limit_states))
    methods: list[str] = [name for name in METHODS if any(name == one for _, one in limit_states)]
    shape = (len(cases), len(methods))
    columns = {name: np.full((*shape, first.sizes["limit_state"]), np.nan) for name in _NAMES}
    n_runs = np.zeros(shape, dtype=int)
    for (case, method), one in limit_states.items():
        at = cases.index(case), methods.index(method)
        n_runs[at] = int(one["n_runs"])
        for name, column in columns.items():
            column[at] = one[name].to_numpy()
    return xr.Dataset(
        {
            **{name: first[name].drop_attrs() for name in _OF_STATE},
            **{name: (("case", "method", "limit_state"), one) for name, one in columns.items()},
            "n_runs": (("case", "method"), n_runs),
        },
        coords={"case": cases, "method": methods, "limit_state": first["limit_state"].to_numpy()},
    )


def per_cent(probability: float) -> str:
    """A probability in per cent with three significant digits and no exponent; a dash for NaN.

    Examples
    --------
    >>> per_cent(2.74e-5), per_cent(0.5), per_cent(0.0)
    ('0.00274', '50', '0')
    """
    if np.isnan(probability):
        return "–"
    return np.format_float_positional(float(f"{100 * probability:.3g}"), trim="-")


def verdict(high: float, low: float, target: float) -> str:
    """Whether a probability with such ends meets its target; a word, empty without a target."""
    if np.isnan(target) or np.isnan(high):
        return ""
    return "met" if high <= target else "missed" if low > target else "open"


def limit_words(state: xr.Dataset) -> str:
    """The limit of a limit state in the unit of a person, or what it joins."""
    response = str(state["state_response"].item())
    if response == "none":
        return str(state["definition"].item())
    value, unit = _shown(state)
    return f"{RESPONSE_WORDS[response]} > {value:.6g} {unit}".rstrip()


def _shown(state: xr.Dataset) -> tuple[float, str]:
    """Limit and unit for a person; NaN where there is none."""
    response = str(state["state_response"].item())
    if response == "none":
        return np.nan, ""
    scale, unit = SHOWN[RESPONSE_UNITS[response]]
    return scale * float(state["threshold"]), unit


def rows(found: xr.Dataset) -> list[dict[str, object]]:
    """The table as rows of a CSV file: one per case, method and limit state."""
    made: list[dict[str, object]] = []
    for c, case in enumerate(found["case"].to_numpy().tolist()):
        for m, method in enumerate(found["method"].to_numpy().tolist()):
            of_method = found.isel(case=c, method=m)
            if not int(of_method["n_runs"]):
                continue
            for k, name in enumerate(found["limit_state"].to_numpy().tolist()):
                one = of_method.isel(limit_state=k)
                value, unit = _shown(one)
                number = {key: float(one[key]) for key in (*_NAMES, "target")}
                made.append(
                    {
                        "case": case,
                        "method": method,
                        "n_runs": int(one["n_runs"]),
                        "limit_state": name,
                        "definition": str(one["definition"].item()),
                        "origin": str(one["origin"].item()),
                        "limit": "" if np.isnan(value) else value,
                        "unit": unit,
                        **{
                            f"{key}_per_cent": 100 * number[key]
                            for key in (*_NAMES, "target")
                            if not key.startswith("beta")
                        },
                        **{key: number[key] for key in _NAMES if key.startswith("beta")},
                        **{
                            f"{prefix}verdict": verdict(
                                number[f"{prefix}probability_high"],
                                number[f"{prefix}probability_low"],
                                number["target"],
                            )
                            for prefix in ("", "held_")
                        },
                    }
                )
    return made


def text(found: xr.Dataset) -> str:
    """The table in Markdown: the limit states, then a section for each case."""
    names = found["limit_state"].to_numpy().tolist()
    states = [
        [
            name,
            limit_words(one),
            per_cent(float(one["target"])),
            str(one["origin"].item()) or "–",
        ]
        for name, one in ((name, found.isel(limit_state=k)) for k, name in enumerate(names))
    ]
    parts = [
        "# Limit states\n",
        "Probabilities per passage in per cent [lower, upper end of their interval].  A passage "
        "that loses levitation exceeds every limit state.  Against its target a probability is "
        "met, missed, or open where its interval holds the target.\n",
        markdown(["limit state", "what it says", "target", "source"], states),
    ]
    for case in found["case"].to_numpy().tolist():
        of_case = found.sel(case=case)
        of_case = of_case.isel(method=np.flatnonzero(of_case["n_runs"].to_numpy() > 0))
        header = [
            "limit state",
            *(
                f"{method}, {int(n)} runs"
                for method, n in zip(
                    of_case["method"].to_numpy(), of_case["n_runs"].to_numpy(), strict=True
                )
            ),
        ]
        parts.append(f"## {case}\n")
        for prefix, words in (("", ""), ("held_", "Given that levitation holds.\n")):
            body = [
                [name, *(_cell(one, prefix) for one in _by_method(of_case, k))]
                for k, name in enumerate(names)
            ]
            parts += [words] if words else []
            parts.append(markdown(header, body))
    return "\n".join([*parts, f"{of_track(found)}\n"])


def _by_method(found: xr.Dataset, state: int) -> list[xr.Dataset]:
    """One limit state by each method."""
    return [found.isel(method=m, limit_state=state) for m in range(found.sizes["method"])]


def _cell(one: xr.Dataset, prefix: str) -> str:
    """A probability with its interval, and whether it meets its target."""
    value, low, high = (float(one[f"{prefix}probability{end}"]) for end in _ENDS)
    judged = verdict(high, low, float(one["target"]))
    return " ".join(
        filter(None, (f"{per_cent(value)} [{per_cent(low)}, {per_cent(high)}]", judged))
    )


def table(found: xr.Dataset) -> tuple[list[dict[str, object]], str]:
    """Rows and text of the table of all cases."""
    return rows(found), text(found)


STAGE = Stage(
    name="limit_state_table",
    of="run",
    reads=(),
    inputs={"limit_states": Input("limit_states", by=("case", "method"))},
    layout="limit_state_table",
    compute=dataset,
    table=table,
)
