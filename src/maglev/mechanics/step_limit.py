"""How long a step of the production solver may be: the limit beyond which a motion grows."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt
import scipy.linalg

from maglev.mechanics import train as train_model
from maglev.mechanics.activity import top_mass, top_stiffness
from maglev.mechanics.course import time_step
from maglev.mechanics.reduction import ReducedGuideway
from maglev.parameters import Config

Array = npt.NDArray[np.float64]


DAMPING_MARGIN = 1.4
"""Damping ratio of a component mode on its own over that of the guideway's modes, at most [-];
measured 1.25 with the default parameters."""


LINE_MARGIN = 0.92
"""Stable step of the whole guideway over that of its modes, which damping couples, each on its own
[-]; measured 0.93 or more."""


def stability_limit(
    config: Config, train: train_model.TrainModel, reduced: ReducedGuideway
) -> float:
    """Largest stable time step of the production solver's scheme [s].

    Modes of the whole guideway with the mass of a step, made symmetric, those of one car with its
    magnets closed linearly at the mean gains, and component modes on their own each have a limit
    that depends on their damping ratio: where the amplification of the scheme passes one
    (docs/theory/integration.md, eq. 5).
    """
    ratio, dt = config.guideway.damping_ratio, time_step(config)
    square = scipy.linalg.eigvalsh(stepped_stiffness(reduced), stepped_inertia(reduced, dt))[-1]
    fastest = math.sqrt(reduced.stiffness.diagonal()[: reduced.n_modes].max(initial=1e-12))
    limits = [
        LINE_MARGIN * _largest_phase(ratio) / math.sqrt(square),
        _largest_phase(DAMPING_MARGIN * ratio, exact=True) / fastest,
    ]
    one_car = train
    if config.train.n_cars > 1:
        one_car = train_model.build(config.train.model_copy(update={"n_cars": 1}))
    stiffness, damping = closed_train(one_car, np.array(config.gains.as_row))
    n = one_car.mass.size
    inverse = 1 / one_car.mass[:, None]
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse * stiffness, -inverse * damping]])
    poles = scipy.linalg.eigvals(state)
    size = np.abs(poles)
    moving = size > 1e-6
    zeta = np.clip(-poles.real[moving] / size[moving], 0.0, 1.0)
    ratios = np.linspace(0.0, 1.0, 21)
    phases = np.interp(zeta, ratios, [_largest_phase(one) for one in ratios])
    limits.append(float((phases / size[moving]).min()))
    return min(limits)


def _largest_phase(ratio: float, *, exact: bool = False) -> float:
    """Largest ωΔt at which a motion with this damping ratio does not grow [-].

    ``exact`` takes it as a component mode, which is stepped with its response and damping.
    """
    phases = np.arange(0.02, np.pi, 0.02)
    scale, rate = np.ones_like(phases), 2 * ratio * phases
    if exact:
        scale = np.sinc(phases / (2 * np.pi)) ** 2
        rate /= np.sinc(phases / np.pi)
    # Displacement, velocity half a step before, the last two accelerations; Δt = 1.
    kicked = np.array([0.0, 1.0, 1.0, 0.0])
    ahead = np.array([1.0, 1.0, 1.0, 0.0])
    predicted = kicked + np.array([0.0, 0.0, 1.0, -0.5])
    acceleration = -scale[:, None] * (phases[:, None] ** 2 * ahead + rate[:, None] * predicted)
    shape = acceleration.shape
    steps = [np.broadcast_to(row, shape) for row in (ahead, kicked, np.array([0.0, 0, 1, 0]))]
    steps = np.stack([steps[0], steps[1], acceleration, steps[2]], axis=1)
    grows = np.abs(np.linalg.eigvals(steps)).max(axis=1) > 1 + 1e-9
    return float(phases[grows.argmax()] - 0.02) if grows.any() else float(phases[-1])


def stepped_stiffness(reduced: ReducedGuideway) -> Array:
    """Stiffness (coordinate, coordinate) when modes count from where the pier tops take them."""
    return scipy.linalg.block_diag(
        np.diag(reduced.stiffness.diagonal()[: reduced.n_modes]), top_stiffness(reduced).toarray()
    )


def stepped_inertia(reduced: ReducedGuideway, time_step: float) -> Array:
    """Mass (coordinate, coordinate) to go with `stepped_stiffness`, as in a time step, symmetric.

    A component mode has the inverse of its response as the mass of its own motion, and the pier
    tops a share of their stiffness on top of their mass.  The step itself is not symmetric: pier
    tops feel the modes' forces without their response (docs/theory/integration.md, eq. 4).
    """
    carried = reduced.carried.toarray()
    own = np.diag(1 / step_response(reduced, time_step)[: reduced.n_modes])
    tops = top_mass(reduced, time_step).toarray() + carried.T @ carried
    return np.block([[own, carried], [carried.T, tops]])


def step_response(reduced: ReducedGuideway, time_step: float) -> Array:
    """Share of its acceleration with which each component mode is stepped; one for pier tops.

    Verlet's step with sinc²(ωΔt/2) times the acceleration is exact for an undamped mode of circular
    frequency ω on its own, whatever the force at the steps.  Pier tops have a mass for the same
    (`maglev.mechanics.activity.stepped_mass`).

    Parameters
    ----------
    reduced
        Guideway in component coordinates.
    time_step
        Δt [s].

    Returns
    -------
    response : (coordinate,)
        [-].

    References
    ----------
    Hairer, Lubich, Wanner, Geometric Numerical Integration (2006), ch. XIII (Gautschi).
    """
    response = np.ones(reduced.n_coordinates)
    omega = np.sqrt(reduced.stiffness.diagonal()[: reduced.n_modes])
    response[: reduced.n_modes] = np.sinc(omega * time_step / (2 * np.pi)) ** 2
    return response


def closed_train(train: train_model.TrainModel, gains: Array) -> tuple[Array, Array]:
    """Stiffness and damping of the train with its magnets closed linearly over a rigid track.

    Parameters
    ----------
    train
        Train with open magnets.
    gains : (4,)
        Suspension k_p [A/m], k_d [A s/m], guidance k_p, k_d.

    Returns
    -------
    stiffness, damping : (dof, dof)
        Each pole adds 2F₀(k_p/i₀ − 1/δ₀) and 2F₀ k_d/i₀ at its place.
    """
    stiffness, damping = train.stiffness.toarray(), train.damping.toarray()
    from maglev.mechanics.packing import magnet_rows

    for guidance in (False, True):
        rows = magnet_rows(train, guidance=guidance)
        k_p, k_d = gains[2 * guidance], gains[2 * guidance + 1]
        current, gap = rows.current_reference, rows.gap_reference
        force = rows.constant * (current / gap) ** 2
        shapes = np.stack([np.ones_like(rows.arm), rows.arm])  # (translation or rotation, pole)
        for row, side in np.ndindex(rows.number.shape):
            dof = np.array([rows.translation[row, side], rows.rotation[row, side]])
            at = np.ix_(dof, dof)
            pull = 2 * (shapes * force[row, side]) @ shapes.T
            stiffness[at] += pull * (k_p / current - 1 / gap)
            damping[at] += pull * (k_d / current)
    return stiffness, damping
