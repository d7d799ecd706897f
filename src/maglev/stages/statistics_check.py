"""Checks of the statistics: halves of a baseline, methods against it, lost runs."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import xarray as xr

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import extremes, lost
from maglev.stages.limits import baseline_limits, status_numbers
from maglev.stages.reads import RESPONSES_OF_STUDY
from maglev.uncertainty.reliability import binomial_interval
from maglev.vocabulary import LIMIT_STATUS

_LOG = logging.getLogger(__name__)

HALVES, LIMIT, LOSS, HELD_HALVES, HELD_LIMIT = range(5)
"""Codes of ``check_kind``."""

NO, YES, UNDECIDED = range(3)
"""Codes of ``check_passed``."""

_GIVEN, _, _INFINITE = range(len(LIMIT_STATUS))


@dataclass(frozen=True, kw_only=True)
class Check:
    """One check: its value and the range in which it passes.

    Parameters
    ----------
    kind
        ``HALVES``, ``LIMIT``, ``LOSS``, ``HELD_HALVES`` or ``HELD_LIMIT``.
    case, method
        Checked case and method.
    response
        Name of the response, or ``"none"``.
    level
        Failure probability, 0 for none [-].
    value, low, high
        Value and ends of the range that passes [-]; NaN where the check cannot be decided.
    passed
        ``NO``, ``YES`` or ``UNDECIDED``.
    """

    kind: int
    case: str
    method: str
    response: str
    level: float
    value: float
    low: float
    high: float
    passed: int


def dataset(
    config: Config,
    baseline: Mapping[str, xr.Dataset],
    limits: Mapping[tuple[str, str], xr.Dataset],
) -> xr.Dataset:
    """Check every case that has a baseline.

    There are three kinds.  The limits of the baseline's two halves: their difference over the sum
    of the facing parts of their intervals passes if the intervals meet.  Each method's limit: its
    difference from the baseline's over half the interval of the latter passes within one.  Each
    method's probability of loss: it passes within the binomial interval of the baseline's count.
    The first two are repeated for limits given that levitation holds.

    Parameters
    ----------
    config
        The configuration.
    baseline
        Layout ``runs``, by case.
    limits
        Layout ``limits``, by case and method, of these cases.

    Returns
    -------
    dataset
        Layout ``statistics_check``.  A check of a limit that the sample does not carry is
        undecided; one that fails is reported, not raised.

    Raises
    ------
    UserError
        If there is no baseline, or a case has limits and no baseline.
    """
    if not baseline:
        raise UserError("the check of the statistics needs at least one baseline, got none")
    strange = sorted({case for case, _ in limits} - set(baseline))
    if strange:
        raise UserError(f"the case '{strange[0]}' has limits and no baseline; run its baseline")
    responses = config.responses_of_study
    checks: list[Check] = []
    for case, runs in baseline.items():
        values, away = extremes(runs, responses), lost(runs)
        checks += _halves(config, case, HALVES, values, away)
        checks += _halves(config, case, HELD_HALVES, values[~away], away[~away])
        for (of_case, method), found in limits.items():
            if of_case == case and method != "mcm":
                checks += _against(config, case, method, values, away, found)
    words_of = {
        HALVES: "limits of halves agree",
        HELD_HALVES: "limits of halves, given that levitation holds, agree",
        LIMIT: "limits agree with the baseline",
        HELD_LIMIT: "limits, given that levitation holds, agree with the baseline",
        LOSS: "probabilities of loss agree with the baseline",
    }
    for kind, words in words_of.items():
        passed = [one.passed for one in checks if one.kind == kind]
        _LOG.info(
            "%s: %d yes, %d no, %d cannot be decided",
            words,
            *(passed.count(code) for code in (YES, NO, UNDECIDED)),
        )
    return _dataset(checks)


def _halves(
    config: Config, case: str, kind: int, values: FloatArray, away: np.ndarray
) -> list[Check]:
    """Limits of the first and the second half of a baseline, or of its runs that held."""
    middle = away.size // 2
    parts = [slice(0, middle), slice(middle, 2 * middle)]
    if middle == 0 or any(away[part].all() for part in parts):
        raise UserError(f"a half of the baseline of '{case}' has no run that held")
    first, second = (baseline_limits(config, values[part], away[part]) for part in parts)
    checks = []
    for response, a, b in zip(config.responses_of_study, first, second, strict=True):
        codes = zip(status_numbers(a), status_numbers(b), strict=True)
        for k, (level, code) in enumerate(zip(a.failure_probability, codes, strict=True)):
            lower, upper = (a, b) if a.limit[k] <= b.limit[k] else (b, a)
            reach = lower.interval[1][k] - lower.limit[k] + upper.limit[k] - upper.interval[0][k]
            value = _ratio(b.limit[k] - a.limit[k], reach)
            checks.append(_judged(kind, case, "mcm", response, level, value, -1.0, 1.0, code))
    return checks


def _against(
    config: Config,
    case: str,
    method: str,
    values: FloatArray,
    away: np.ndarray,
    found: xr.Dataset,
) -> list[Check]:
    """Limits and losses of a method against those of the baseline."""
    checks = []
    for kind, name, truths in (
        (LIMIT, "limit", baseline_limits(config, values, away)),
        (HELD_LIMIT, "held_limit", baseline_limits(config, values[~away], away[~away])),
    ):
        for response, truth in zip(config.responses_of_study, truths, strict=True):
            limit, status = (
                found[key].sel(response=response).to_numpy() for key in (name, f"{name}_status")
            )
            codes = zip(status_numbers(truth), status, strict=True)
            for k, (level, code) in enumerate(zip(truth.failure_probability, codes, strict=True)):
                half = truth.half_width[k]
                value = _ratio(limit[k] - truth.limit[k], half)
                checks.append(_judged(kind, case, method, response, level, value, -1.0, 1.0, code))
    low, high = binomial_interval(float(np.count_nonzero(away)), away.size, config.study.confidence)
    value = float(found["lost_probability"])
    none = (_GIVEN, _GIVEN)
    checks.append(_judged(LOSS, case, method, "none", 0.0, value, float(low), float(high), none))
    return checks


def _ratio(difference: float, reach: float) -> float:
    """A difference over a reach: 0 for an infinite reach, NaN without one."""
    if np.isnan(difference) or np.isnan(reach) or reach == 0.0:
        return 0.0 if difference == 0.0 else np.nan
    return float(difference / reach)


def _judged(
    kind: int,
    case: str,
    method: str,
    response: str,
    level: float,
    value: float,
    low: float,
    high: float,
    codes: tuple[int, int],
) -> Check:
    """A check with its verdict, from the status of the two compared limits."""
    infinite = [code == _INFINITE for code in codes]
    if all(infinite):
        value, passed = 0.0, YES  # both say that no limit exists
    elif any(infinite) and _GIVEN in codes:
        value, passed = np.nan, NO
    elif codes != (_GIVEN, _GIVEN) or np.isnan(value):
        value, passed = np.nan, UNDECIDED
    else:
        passed = YES if low <= value <= high else NO
    return Check(
        kind=kind,
        case=case,
        method=method,
        response=response,
        level=float(level),
        value=value,
        low=low,
        high=high,
        passed=passed,
    )


def _dataset(checks: list[Check]) -> xr.Dataset:
    columns = {
        "check_kind": [one.kind for one in checks],
        "check_case": [one.case for one in checks],
        "check_method": [one.method for one in checks],
        "check_response": [one.response for one in checks],
        "check_failure_probability": [one.level for one in checks],
        "check_value": [one.value for one in checks],
        "check_low": [one.low for one in checks],
        "check_high": [one.high for one in checks],
        "check_passed": [one.passed for one in checks],
    }
    return xr.Dataset(
        {name: (("check",), np.array(column)) for name, column in columns.items()},
        coords={"check": np.arange(len(checks))},
    )


STAGE = Stage(
    name="statistics_check",
    of="run",
    reads=("study.confidence", "study.failure_probability", *RESPONSES_OF_STUDY),
    inputs={
        "baseline": Input("runs", by=("case",)),
        "limits": Input("limits", by=("case", "method")),
    },
    layout="statistics_check",
    compute=dataset,
)
