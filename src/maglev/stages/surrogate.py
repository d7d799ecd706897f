"""Surrogate of a design, fitted to the held runs, with the region of the lost ones."""

from __future__ import annotations

import logging
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from maglev.arrays import FloatArray
from maglev.parameters import Config
from maglev.stage import Input, Stage
from maglev.stages.extremes import coordinates, extremes, lost, population, responses_of
from maglev.stages.randomness import generator_of_statistics
from maglev.stages.reads import PREDICTING, RESPONSES_OF_STUDY, SURROGATE_OF_METHODS
from maglev.uncertainty.failure_region import Loss, learnt_loss
from maglev.uncertainty.selection import Selected, fit_selected, rebuilt
from maglev.uncertainty.sobol import sobol_indices
from maglev.uncertainty.surrogate import relative_error
from maglev.vocabulary import DESIGNED, SURROGATES, Response

_LOG = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Predictor:
    """Predictor of a design: extremes of held samples, and the region of lost ones.

    Parameters
    ----------
    surrogate
        Surrogate of the responses on the samples that held.
    loss
        Probability of loss, and the region of lost samples.
    """

    surrogate: Selected
    loss: Loss

    def held(self, points: FloatArray) -> np.ndarray:
        """Whether standardised points (point, parameter) are more likely held than lost."""
        return self.loss.lost_probability(points) < 0.5


def predictor(
    config: Config, design: xr.Dataset, choice: str, responses: Sequence[Response]
) -> Predictor:
    """Fit the surrogate of a design and the region of its lost samples.

    Parameters
    ----------
    config
        The configuration; of it ``seed`` and ``study``.
    design
        Layout ``design`` or ``runs``: all its samples are used.
    choice
        Kind of the surrogate, or ``"best"``.
    responses
        What it predicts.

    Raises
    ------
    UserError
        If no or too few samples held, or they cannot be fitted.
    """
    points, away = design["standard"].to_numpy(), lost(design)
    values = extremes(design, responses)
    surrogate = fit_selected(points[~away], values[~away], choice)
    return Predictor(surrogate=surrogate, loss=_loss(config, points, away))


def stored_predictor(config: Config, design: xr.Dataset, surrogate: xr.Dataset) -> Predictor:
    """Predictor from a file of the layout ``surrogate``, without a search for parameters.

    Parameters
    ----------
    config
        The configuration; of it ``seed`` and ``study``.
    design
        Layout ``design``.
    surrogate
        Layout ``surrogate``, of this design.
    """
    points, away = design["standard"].to_numpy(), lost(design)
    values = extremes(design, responses_of(surrogate))
    again = rebuilt(
        points[~away],
        values[~away],
        tuple(SURROGATES[number] for number in surrogate["kind"].to_numpy()),
        surrogate["length"].to_numpy(),
        surrogate["amplitude"].to_numpy(),
    )
    return Predictor(surrogate=again, loss=_loss(config, points, away))


def dataset(config: Config, method: str, design: xr.Dataset) -> xr.Dataset:
    """Fit the surrogate of a method's design.

    Parameters
    ----------
    config
        The configuration.
    method
        ``"osm"``, ``"asm_paper"`` or ``"asm"``: it decides the kind of surrogate.
    design
        Layout ``design``.

    Returns
    -------
    dataset
        Layout ``surrogate``.

    Raises
    ------
    UserError
        As `predictor`.

    References
    ----------
    `maglev.uncertainty.sobol.sobol_indices`.
    """
    responses = config.responses_of_study
    found = predictor(config, design, getattr(config.study, method).surrogate, responses)
    surrogate, loss = found.surrogate, found.loss
    rng = generator_of_statistics(config.seed, "Sobol' indices")
    first, total = sobol_indices(surrogate, rng, config.study.confidence)
    error = relative_error(surrogate)
    _LOG.info(
        "%d runs, %d lost; %s; leave-one-out error %s",
        design.sizes["sample"],
        np.count_nonzero(lost(design)),
        ", ".join(surrogate.kinds),
        ", ".join(f"{one:.3f}" for one in error),
    )
    by_gain = ("response", "parameter")
    result = xr.Dataset(
        {
            "kind": ("response", [SURROGATES.index(kind) for kind in surrogate.kinds]),
            "leave_one_out_error": ("response", error),
            "length": (by_gain, surrogate.length),
            "amplitude": ("response", surrogate.amplitude),
            "lost_probability": ((), loss.probability),
            "lost_probability_low": ((), loss.lower),
            "lost_probability_high": ((), loss.upper),
            "sobol_first": (by_gain, first[0]),
            "sobol_first_low": (by_gain, first[1]),
            "sobol_first_high": (by_gain, first[2]),
            "sobol_total": (by_gain, total[0]),
            "sobol_total_low": (by_gain, total[1]),
            "sobol_total_high": (by_gain, total[2]),
        },
        coords=coordinates(responses, parameter=design["parameter"].to_numpy()),
    )
    result["lost_probability"].attrs["comment"] = loss_comment(loss)
    result["sobol_first"].attrs["comment"] = result["sobol_total"].attrs["comment"] = (
        "of the surrogate within the range of its training values; intervals are those of the "
        "sampling, without the surrogate's error"
    )
    return result


def loss_comment(loss: Loss) -> str:
    """Sentence on the estimate of the probability of lost levitation."""
    if loss.region is None:
        return "no run was lost; the upper end is the exact binomial one, as if runs were drawn"
    return "from the region learnt from the lost runs; the interval is its credible one"


def _loss(config: Config, points: FloatArray, away: np.ndarray) -> Loss:
    everywhere = population(config.seed, config.study.n_population, points.shape[1])
    rng = generator_of_statistics(config.seed, "border of the lost region")
    return learnt_loss(points, away, everywhere, rng, config.study.confidence)


STAGE = Stage(
    name="surrogate",
    of="method",
    reads=(*PREDICTING, *RESPONSES_OF_STUDY, *SURROGATE_OF_METHODS),
    inputs={"design": Input("design")},
    takes={"method": str},
    methods=DESIGNED,
    layout="surrogate",
    compute=dataset,
)
