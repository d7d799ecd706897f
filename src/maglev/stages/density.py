"""Density and exceedance of the extremes: of a surrogate, or of the baseline itself."""

from __future__ import annotations

import logging
from collections.abc import Sequence

import numpy as np
import xarray as xr

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, extremes, lost, responses_of
from maglev.stages.reads import PREDICTING, RESPONSES_OF_STUDY
from maglev.stages.surrogate import loss_comment, stored_predictor
from maglev.uncertainty.gdee import (
    density_with_strays,
    direct_density,
    direct_density_band,
    silverman_bandwidth,
)
from maglev.uncertainty.reliability import binomial_interval, error_range_near, exceedance
from maglev.uncertainty.samples import held_part
from maglev.vocabulary import BASELINE, DENSITY_METHODS, DESIGNED, Response

_LOG = logging.getLogger(__name__)

N_BODY, N_TAIL = 801, 200
"""Values at which a density is given: evenly over its body, and ever wider apart in its tail."""

REACH = 4.0
"""Bandwidths beyond the smallest and the largest value at which a density is still given; a
normal kernel has fallen to 3e-4 of its peak there."""

COMMENT = "density of the held part: it integrates to one less lost_probability"


def dataset(
    config: Config,
    baseline: xr.Dataset | None = None,
    design: xr.Dataset | None = None,
    surrogate: xr.Dataset | None = None,
    eev: xr.Dataset | None = None,
) -> xr.Dataset:
    """Density and exceedance of a baseline, or of what a surrogate predicts.

    Parameters
    ----------
    config
        The configuration.
    baseline
        Layout ``runs``; in its place the three others, as `of_surrogate` takes them.

    Returns
    -------
    dataset
        Layout ``density``.
    """
    if baseline is not None:
        return of_baseline(config, baseline)
    if design is None or surrogate is None or eev is None:
        raise UserError("density: needs a baseline, or a design with its surrogate and eev")
    return of_surrogate(config, design, surrogate, eev)


def of_baseline(config: Config, runs: xr.Dataset) -> xr.Dataset:
    """Direct density and counted exceedance of independent runs, with the binomial interval.

    Parameters
    ----------
    config
        The configuration.
    runs
        Layout ``runs``: the baseline.

    Returns
    -------
    dataset
        Layout ``density``; ``density``, ``mesh_size`` and ``peak`` of the GDEE are NaN.

    Raises
    ------
    UserError
        If no run held.
    """
    responses = config.responses_of_study
    values, away = extremes(runs, responses), lost(runs)
    n = away.size
    columns = []
    for response in range(len(responses)):
        held = held_part(values[:, response], away)
        column = _column(held.values, held.probability, held.lost_probability)
        n_beyond = np.round(column["exceedance"] * n)
        low, high = binomial_interval(n_beyond, n, config.study.confidence)
        band = direct_density_band(
            column["value"],
            held.values,
            n,
            density=column["density_direct"],
            bandwidth=column["bandwidth"],
            lost_probability=held.lost_probability,
            confidence=config.study.confidence,
        )
        columns.append(
            column
            | {"exceedance_low": low, "exceedance_high": high}
            | {"density_direct_low": band[0], "density_direct_high": band[1]}
        )
    result = _put_together(responses, columns, float(away.mean()), n)
    result["exceedance"].attrs["comment"] = "interval: exact binomial, at each value by itself"
    return result


def of_surrogate(
    config: Config, design: xr.Dataset, surrogate: xr.Dataset, eev: xr.Dataset
) -> xr.Dataset:
    """Density by the GDEE of the extremes predicted at the representative points.

    Points that are more likely lost than held are left out, the others keep their proportions;
    the probability of loss is that of the surrogate's file.  Exceedance is the exact weighted one.
    Its interval shifts the predictions by the range of leave-one-out residuals near each value,
    and, where runs were lost, the lost probability to the ends of its own interval.

    Parameters
    ----------
    config
        The configuration.
    design
        Layout ``design``.
    surrogate
        Layout ``surrogate``, of this design.
    eev
        Layout ``eev``, of this surrogate.

    Returns
    -------
    dataset
        Layout ``density``; ``density_method`` says where strays required the GDEE of the logarithm,
        or the direct density instead of any GDEE.

    Raises
    ------
    UserError
        If every representative point is likely lost.

    References
    ----------
    docs/theory/pdem.md; docs/theory/reliability.md, eqs. (2), (7) and (9).
    """
    found = stored_predictor(config, design, surrogate)
    training, residuals = found.surrogate.values, found.surrogate.leave_one_out()
    predicted, probability = eev["predicted"].to_numpy(), eev["probability"].to_numpy()
    likely_lost = eev["lost_probability_at"].to_numpy() >= 0.5
    loss = found.loss
    least, most = (loss.lower, loss.upper) if loss.region is not None else (0.0, 0.0)
    columns = []
    for response, name in enumerate(responses_of(eev)):
        held = held_part(predicted[:, response], likely_lost, probability)
        sample = (held.values, held.probability)
        column = _column(*sample, loss.probability)
        evolved = density_with_strays(*sample, lost_probability=loss.probability)
        if evolved is None:
            _LOG.warning("%s: strays, the GDEE was refused; the density is the direct one", name)
            column["density"] = column["density_direct"]
        else:
            density, logarithmic = evolved
            column |= {
                "density": np.interp(
                    column["value"], density.cell_centre, density.density, left=0.0, right=0.0
                ),
                "mesh_size": density.mesh,
                "peak": density.density.max(),
                "density_method": DENSITY_METHODS.index(
                    "gdee_of_the_logarithm" if logarithmic else "gdee"
                ),
            }
        low, high = error_range_near(
            column["value"], training[:, response], residuals[:, response], config.study.confidence
        )
        at = column["value"]
        lower = exceedance(at - low, *sample, lost_probability=least)
        upper = exceedance(at - high, *sample, lost_probability=most)
        columns.append(
            column
            | {
                "exceedance_low": np.minimum.accumulate(np.minimum(lower, column["exceedance"])),
                "exceedance_high": np.maximum.accumulate(
                    np.maximum(upper, column["exceedance"])[::-1]
                )[::-1],
            }
        )
    result = _put_together(responses_of(eev), columns, loss.probability, design.sizes["sample"])
    result["lost_probability"].attrs["comment"] = loss_comment(loss)
    result["exceedance"].attrs["comment"] = (
        "exact weighted distribution of the representative points; interval: leave-one-out "
        "residuals of the training samples near each value"
    )
    return result


def grid(values: FloatArray, probability: FloatArray, bandwidth: float) -> FloatArray:
    """Values (cell,) at which a density is given: dense around its body, sparse towards strays.

    Parameters
    ----------
    values, probability : (sample,)
        Weighted values [their unit].
    bandwidth
        Kernel deviation [unit].
    """
    first, last = values.min() - REACH * bandwidth, values.max() + REACH * bandwidth
    body = np.quantile(values, 0.99, weights=probability, method="inverted_cdf") + 8.0 * bandwidth
    body = min(body, first + 0.9 * (last - first))
    tail = body + (last - body) * (np.arange(1, N_TAIL + 1) / N_TAIL) ** 2
    return np.concatenate([np.linspace(first, body, N_BODY), tail])


def _column(values: FloatArray, probability: FloatArray, lost_probability: float) -> dict:
    """Variables of one response with a direct density."""
    bandwidth = silverman_bandwidth(values, probability)
    at = grid(values, probability, bandwidth)
    sample = (at, values, probability)
    direct = direct_density(*sample, bandwidth=bandwidth, lost_probability=lost_probability)
    mean = probability @ values
    deviation = np.sqrt(probability @ (values - mean) ** 2)
    return {
        "value": at,
        "density": np.full(at.size, np.nan),
        "density_direct": direct,
        "exceedance": exceedance(*sample, lost_probability=lost_probability),
        "bandwidth": bandwidth,
        "mesh_size": np.nan,
        "density_method": DENSITY_METHODS.index("direct"),
        "peak": np.nan,
        "peak_direct": direct.max(),
        "mean": mean,
        "standard_deviation": deviation,
        "skewness": probability @ (values - mean) ** 3 / deviation**3,
    }


def _put_together(
    responses: Sequence[Response], columns: list[dict], lost_probability: float, n_runs: int
) -> xr.Dataset:
    """Dataset of the file from the variables of each response."""
    variables = {}
    for name in columns[0]:
        stacked = np.array([column[name] for column in columns])
        variables[name] = (("response", "cell")[: stacked.ndim], stacked)
    n_cells = variables["value"][1].shape[1]
    result = xr.Dataset(
        {**variables, "lost_probability": ((), lost_probability), "n_runs": ((), n_runs)},
        coords=coordinates(responses, cell=np.arange(n_cells)),
    )
    for name in ("density", "density_direct"):
        result[name].attrs["comment"] = COMMENT
    return result


STAGE = Stage(
    name="density",
    of="method",
    reads=(*PREDICTING, *RESPONSES_OF_STUDY),
    inputs={
        "baseline": Input("runs", methods=(BASELINE,)),
        "design": Input("design", methods=DESIGNED),
        "surrogate": Input("surrogate", methods=DESIGNED),
        "eev": Input("eev", methods=DESIGNED),
    },
    layout="density",
    compute=dataset,
)
