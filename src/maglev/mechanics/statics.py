"""The guideway under the train at rest: reference deflection of the dynamic coefficient."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from scipy.sparse.linalg import splu

from maglev.arrays import FloatArray
from maglev.mechanics.guideway import GuidewayModel
from maglev.mechanics.train import TrainModel, pole_offsets, pole_static_force


def midspan_of_middle_span(guideway: GuidewayModel) -> float:
    """Midspan of the middle span [m]; of an even number, the span ahead of the middle.

    Examples
    --------
    >>> from maglev.mechanics.guideway import build
    >>> from maglev.parameters import Guideway
    >>> midspan_of_middle_span(build(Guideway(n_spans=1)))  # half of 24.768 m
    12.384
    """
    parameters = guideway.parameters
    return (parameters.n_spans // 2 + 0.5) * parameters.span_length


def deflection(guideway: GuidewayModel, train: TrainModel, nose: npt.ArrayLike) -> FloatArray:
    """Vertical deflection at midspan of the middle span under the suspension magnets at rest.

    The poles' static forces stand on both rails; by reciprocity one solution under a unit load at
    midspan gives the influence of a load at every point.

    Parameters
    ----------
    guideway, train
        The models.
    nose : (...)
        Positions of the train's nose [m].

    Returns
    -------
    deflection : (...)
        Downwards [m].

    Examples
    --------
    >>> from maglev.mechanics import guideway, train
    >>> from maglev.parameters import Guideway, Train
    >>> span, car = guideway.build(Guideway(n_spans=1)), train.build(Train(n_cars=1))
    >>> off, over = deflection(span, car, [-1.0, 24.768])  # before the span, all of it on the span
    >>> bool(off == 0.0 and 1e-3 < over < 2e-3)
    True
    """
    nose = np.asarray(nose, dtype=float)
    midspan, _ = guideway.girder_rows([midspan_of_middle_span(guideway)])
    influence = splu(guideway.stiffness.tocsc()).solve(midspan.toarray()[0])
    magnets = train.magnets
    force = pole_static_force(train.parameters, magnets)
    offsets = pole_offsets(train.parameters.suspension_magnet)
    total = np.zeros(nose.size)
    for side in np.unique(magnets.side):
        hung = ~magnets.is_guidance & (magnets.side == side)
        pole_x = (magnets.x[hung, None] + offsets).ravel()
        pole_force = force[hung, : offsets.size].ravel()
        at = nose.reshape(-1, 1) + pole_x
        u_z, _, _, _ = guideway.rail_rows(at.ravel(), int(side))
        total += (u_z @ influence).reshape(at.shape) @ pole_force
    return total.reshape(nose.shape)


def largest_deflection(guideway: GuidewayModel, train: TrainModel, step: float = 0.5) -> float:
    """Largest `deflection` [m] over all positions of the train on the middle span.

    Parameters
    ----------
    guideway, train
        The models.
    step
        Distance between positions of the nose [m]; at 0.5 m a parabola over one span of
        25 m misses its top by less than 2e-4 of it.

    Examples
    --------
    >>> from maglev.mechanics import guideway, train
    >>> from maglev.parameters import Guideway, Train
    >>> span, car = guideway.build(Guideway(n_spans=1)), train.build(Train(n_cars=1))
    >>> 1e-3 < largest_deflection(span, car, step=4.0) < 2e-3
    True
    """
    span, middle = guideway.parameters.span_length, midspan_of_middle_span(guideway)
    length = guideway.parameters.length + train.parameters.length
    nose = np.arange(0.0, length + step, step)
    on = (nose > middle - span / 2) & (nose < middle + span / 2 + train.parameters.length)
    return float(deflection(guideway, train, nose[on]).max())


def influence(guideway: GuidewayModel, train: TrainModel, step: float = 0.5) -> FloatArray:
    """Deflection at midspan of the middle span per unit force of each pole of the train.

    Parameters
    ----------
    guideway, train
        The models.
    step
        Distance of neighbouring places of the nose [m], as in `largest_deflection`.

    Returns
    -------
    influence : (nose, magnet, pole)
        Of the suspension magnets [m/N]; zero of the others.

    Examples
    --------
    >>> from maglev.mechanics import guideway, train
    >>> from maglev.parameters import Guideway, Train
    >>> models = guideway.build(Guideway(n_spans=1)), train.build(Train(n_cars=1))
    >>> found = influence(*models)
    >>> bool(0.0 < found.max() < 1e-8)  # metres a newton
    True
    """
    length = guideway.parameters.length + train.parameters.length
    nose = np.arange(0.0, length + step, step)
    midspan, _ = guideway.girder_rows([midspan_of_middle_span(guideway)])
    line = splu(guideway.stiffness.tocsc()).solve(midspan.toarray()[0])
    magnets = train.magnets
    offsets = pole_offsets(train.parameters.suspension_magnet)
    found = np.zeros((nose.size, magnets.x.size, offsets.size))
    for side in np.unique(magnets.side):
        hung = np.flatnonzero(~magnets.is_guidance & (magnets.side == side))
        at = nose[:, None, None] + magnets.x[hung, None] + offsets
        u_z, _, _, _ = guideway.rail_rows(at.ravel(), int(side))
        found[:, hung] = (u_z @ line).reshape(at.shape)
    return found
