"""Stability limit of the time step of the production solver.

The guideway's limit is that of its modes.  The train's is found from the step itself: the matrix
that takes the linearised train with its circuits from one step to the next, for any gains.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import scipy.linalg

from maglev.arrays import BoolArray, FloatArray
from maglev.mechanics import linear
from maglev.mechanics import train as train_model
from maglev.mechanics.activity import top_mass, top_stiffness
from maglev.mechanics.control import late_current
from maglev.mechanics.linear import Block
from maglev.mechanics.reduction import ReducedGuideway
from maglev.mechanics.trains import Rates
from maglev.parameters import Config

DAMPING_MARGIN = 1.4
"""Largest damping ratio of a component mode on its own over that of the guideway's modes [-];
measured 1.25 with the default parameters."""

GUIDEWAY_MARGIN = 0.92
"""Stable step of the whole guideway over that of its modes, which damping couples, each on its own
[-]; measured 0.93 or more."""

TRAIN_MARGIN = 0.88
"""Stable step of the train on the elastic guideway over that on rigid track [-]; measured 0.92 at
rising k_d of the suspension with the default parameters."""

GROWTH_OF_THE_STEP = 2.0
"""Numerical growth of a motion, beyond its physical growth, above which a step is too large [1/s];
assumed: in a passage of three seconds a motion then grows by a factor of 400."""


SAFE_MULTIPLES = (1.8, 1.4, 1.2, 1.0)
"""Trial multiples of the mean gains, from large to small [-]; assumed."""


def guideway_limit(config: Config, reduced: ReducedGuideway, time_step: float) -> float:
    """Largest step at which no mode of the guideway grows [s].

    Modes of the whole guideway with the mass of a step, made symmetric, and component modes on
    their own each have a limit that depends on their damping ratio: where the amplification of the
    scheme passes one (docs/theory/integration.md, eq. 5).

    Parameters
    ----------
    config
        Parameters of everything.
    reduced
        Guideway in component coordinates.
    time_step
        Δt [s], on which the mass of a step depends.
    """
    ratio = config.guideway.damping_ratio
    square = fastest_square(reduced, time_step)
    fastest = math.sqrt(reduced.stiffness.diagonal()[: reduced.n_modes].max(initial=1e-12))
    return min(
        GUIDEWAY_MARGIN * largest_phase(ratio) / math.sqrt(square),
        largest_phase(DAMPING_MARGIN * ratio, exact=True) / fastest,
    )


def fastest_square(reduced: ReducedGuideway, time_step: float) -> float:
    """Largest squared circular frequency of the guideway with the mass of a step [1/s²]."""
    inertia = stepped_inertia(reduced, time_step)
    return float(scipy.linalg.eigvalsh(stepped_stiffness(reduced), inertia)[-1])


def train_parts(config: Config) -> tuple[Block, ...]:
    """One car of the train, linearised with its circuits, in uncoupled blocks.

    The fast motions that limit the step are those of single magnets: more cars add none.
    """
    one_car = train_model.build(config.train.model_copy(update={"n_cars": 1}))
    return linear.blocks(one_car, config.control)


def train_limit(parts: tuple[Block, ...], gains: FloatArray, least: float = 1e-5) -> float:
    """Largest step at which no motion of the train grows numerically [s].

    Parameters
    ----------
    parts
        From `train_parts`.
    gains : (8,)
        Suspension k_p, k_d, guidance k_p, k_d, suspension k_a, k_i, guidance k_a, k_i.
    least
        Smallest step that is tried [s].
    """
    stable, too_large = least, 2 * least
    while step_holds(parts, gains, too_large) and too_large < 0.1:
        stable, too_large = too_large, 2 * too_large
    while too_large / stable > 1.01:
        middle = math.sqrt(stable * too_large)
        if step_holds(parts, gains, middle):
            stable = middle
        else:
            too_large = middle
    return stable


def step_holds(parts: tuple[Block, ...], gains: FloatArray, time_step: float) -> bool:
    """Whether each motion that decays in continuous time also decays in the scheme.

    The trial step is longer by a margin, because the limit on the elastic guideway is lower than on
    the rigid track of the linearised train.
    """
    tried = time_step / TRAIN_MARGIN
    for block in parts:
        matrix = _of_use(step_matrix(block, gains, tried))
        growth = math.log(np.abs(np.linalg.eigvals(matrix)).max()) / tried
        if growth > GROWTH_OF_THE_STEP and (
            growth > max(linear.rightmost(block, gains).real, 0.0) + GROWTH_OF_THE_STEP
        ):
            return False
    return True


def _of_use(matrix: FloatArray) -> FloatArray:
    """The matrix without the states that influence no other state."""
    while not (kept := matrix.any(axis=0)).all():
        matrix = matrix[np.ix_(kept, kept)]
    return matrix


def safe_gains(parts: tuple[Block, ...], mean: FloatArray, time_step: float) -> FloatArray:
    """Largest common multiple of the mean gains (8,) at which the step is stable."""
    for times in SAFE_MULTIPLES:
        if step_holds(parts, times * mean, time_step):
            return times * mean
    return np.zeros_like(mean)


def samples_too_fast(
    parts: tuple[Block, ...], gains: FloatArray, time_step: float, safe: FloatArray
) -> BoolArray:
    """Samples whose gains exceed the stability limit of the step.

    The limit falls as gains rise: a set of samples passes as a whole if its largest gains pass
    together; otherwise it is halved.

    Parameters
    ----------
    parts
        From `train_parts`.
    gains : (sample, 8)
        Of all samples.
    time_step
        Δt [s].
    safe : (8,)
        From `safe_gains`: samples with no gain above these pass.

    Returns
    -------
    too_fast : (sample,)
        True where the step is too large.
    """
    too_fast = np.zeros(gains.shape[0], dtype=bool)
    waiting = [np.flatnonzero((gains > safe).any(axis=1))]
    while waiting:
        which = waiting.pop()
        if which.size == 0:
            continue
        if step_holds(parts, gains[which].max(axis=0), time_step):
            continue
        if which.size == 1 or not step_holds(parts, gains[which].min(axis=0), time_step):
            too_fast[which] = True
            continue
        spread = np.ptp(gains[which], axis=0) / np.maximum(gains[which].max(axis=0), 1e-12)
        order = which[np.argsort(gains[which, int(spread.argmax())], kind="stable")]
        waiting += [order[: which.size // 2], order[which.size // 2 :]]
    return too_fast


HEADROOMS = (2.6, 2.2, 1.8, 1.4, 1.2, 1.0)
"""Multiples of all rates of the train and of its gains that are tried, from large to small [-];
assumed."""

SLOW_LAG = 10e-3
"""A lag beyond which the current takes no part in fast motions [s]; assumed."""


@dataclass(frozen=True)
class Headroom:
    """How much faster than the mean a train can be for the step.

    Attributes
    ----------
    times
        Common multiple of rates and gains at which the step is stable [-]; zero: none.
    gains : (8,)
        Mean gains, as in `train_limit`.
    rates
        Of the train of the configuration.
    time_step
        Δt [s].
    """

    times: float
    gains: FloatArray
    rates: Rates
    time_step: float


def headroom(
    parts: tuple[Block, ...], mean: FloatArray, rates: Rates, time_step: float
) -> Headroom:
    """Find how much faster a train can be, whatever its lags.

    Parameters
    ----------
    parts
        From `train_parts`.
    mean : (8,)
        Gains.
    rates
        Of the train of the configuration.
    time_step
        Δt [s].
    """
    times = next((f for f in HEADROOMS if _all_hold(parts, f, f * mean, time_step)), 0.0)
    return Headroom(times, mean, rates, time_step)


def _all_hold(parts: tuple[Block, ...], times: float, gains: FloatArray, time_step: float) -> bool:
    """Whether the step holds with rates so many times as fast, with the lags given and others."""
    faster = [
        replace(one, damping=times * one.damping, stiffness=times * one.stiffness) for one in parts
    ]
    lags = {None, 0.0, SLOW_LAG}
    return all(
        step_holds(tuple(_with_lag(one, lag) for one in faster), gains, time_step) for lag in lags
    )


def _with_lag(block: Block, lag: float | None) -> Block:
    """The block with another lag of all its circuits [s], if one is given."""
    if lag is None:
        return block
    first, second = (replace(loop, lag=lag) for loop in block.loops)
    return replace(block, loops=(first, second))


def trains_too_fast(
    config: Config,
    known: Headroom,
    rates: Rates,
    gains: FloatArray,
    values: Mapping[str, FloatArray],
) -> BoolArray:
    """Samples of trains of their own for which the step is too large.

    A train no rate or gain of which, per mass, is larger than `Headroom` allows needs no closer
    look; any other is linearised by itself.

    Parameters
    ----------
    config
        What samples share beyond the values.
    known
        From `headroom`.
    rates
        Of each sample's train; what stands behind them does not count.
    gains : (sample, 8)
        Of each sample.
    values : key of (sample,)
        Numbers of each sample by dotted keys.

    Returns
    -------
    too_fast : (sample,)
        True where the step is too large.
    """
    n_samples = gains.shape[0]
    faster = [
        _share(own[:n_samples], mean).max(axis=1)
        for own, mean in (
            (rates.stiffness, known.rates.stiffness),
            (rates.damping, known.rates.damping),
            (rates.pull[0], known.rates.pull[0]),
            (rates.pull[1], known.rates.pull[1]),
        )
    ]
    effective = gains.copy()
    for kind, places in enumerate(linear.GAINS_OF_KIND):
        effective[:, places] *= faster[2 + kind][:, None]
    closer = (np.maximum(faster[0], faster[1]) > known.times) | (
        effective > known.times * known.gains
    ).any(axis=1)
    too_fast = np.zeros(gains.shape[0], dtype=bool)
    for sample in np.flatnonzero(closer):
        own = config.with_numbers({key: float(of_all[sample]) for key, of_all in values.items()})
        too_fast[sample] = not step_holds(train_parts(own), gains[sample], known.time_step)
    return too_fast


def _share(own: FloatArray, mean: FloatArray) -> FloatArray:
    """Rates (sample, place) over those of the mean; infinite where it has none but a sample has."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(own == 0, 0.0, own / mean)


def step_matrix(block: Block, gains: FloatArray, time_step: float) -> FloatArray:
    """Transition matrix of a block of the linearised train over one step.

    The state is displacement, velocity half a step before, and the accelerations of the last two
    steps; of the magnets' freedoms also the memory of the circuits: the integral and the error, the
    command and the current where they lag, and the signals of the steps within the delay.  A
    circuit's gain on the acceleration acts on that of the same step.

    Parameters
    ----------
    block
        Part of the train.
    gains : (8,)
        As in `train_limit`.
    time_step
        Δt [s].

    References
    ----------
    docs/theory/integration.md, step; docs/theory/control.md.
    """
    n, dt = block.mass.size, time_step
    late = [late_current(loop.lag, loop.delay, dt) for loop in block.loops]
    fed = [loop.fed_by for loop in block.loops]
    remembered = [one.size * (4 + way.behind + 3) for one, way in zip(fed, late, strict=True)]
    n_state = 4 * n + sum(remembered)
    unit = np.eye(n_state)
    x, v, a, before = (unit[k * n : (k + 1) * n] for k in range(4))
    new_v = v + dt * a
    new_x = x + dt * new_v
    predicted = new_v + dt * (a - 0.5 * before)
    force = -block.stiffness @ new_x - block.damping @ predicted
    inertia = np.diag(block.mass)
    rows, start = [], 4 * n
    for kind, (loop, way, freedoms) in enumerate(zip(block.loops, late, fed, strict=True)):
        m = freedoms.size
        memory = unit[start : start + remembered[kind]].reshape(way.behind + 7, m, n_state)
        start += remembered[kind]
        k_p, k_d, k_a, k_i = linear.of_kinds(gains)[kind]
        integral = memory[0] + 0.5 * dt * (memory[1] + new_x[freedoms])
        signal = k_p * new_x[freedoms] + k_d * predicted[freedoms] + k_i * integral
        # without the acceleration of this step, which joins on the left; `direct` is its share
        signals = [signal, memory[4] + k_a * a[freedoms], *memory[5:-1]]
        command = sum(
            weight * signals[way.behind + j] for j, weight in enumerate(way.delayed) if weight
        )
        current = way.decay * memory[3] + way.before * memory[2] + way.now * command
        force = force - loop.pull @ current
        inertia[:, freedoms] += k_a * way.direct * loop.pull
        rows.append((freedoms, way, k_a, [integral, new_x[freedoms], command, current, *signals]))
    acceleration = np.linalg.solve(inertia, force)
    memories: list[FloatArray] = []
    for freedoms, way, k_a, kept in rows:
        answered = k_a * acceleration[freedoms]
        kept[2] = kept[2] + way.undelayed * answered
        kept[3] = kept[3] + way.direct * answered
        memories += kept
    return np.concatenate([new_x, new_v, acceleration, a, *memories])


@lru_cache(maxsize=256)
def largest_phase(ratio: float, *, exact: bool = False) -> float:
    """Largest stable ωΔt of an oscillator with this damping ratio [-].

    ``exact`` is for a component mode, which is stepped with its own response and damping.
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
    rows = [np.broadcast_to(row, shape) for row in (ahead, kicked, np.array([0.0, 0, 1, 0]))]
    step = np.stack([rows[0], rows[1], acceleration, rows[2]], axis=1)
    grows = np.abs(np.linalg.eigvals(step)).max(axis=1) > 1 + 1e-9
    return float(phases[grows.argmax()] - 0.02) if grows.any() else float(phases[-1])


def stepped_stiffness(reduced: ReducedGuideway) -> FloatArray:
    """Stiffness (coordinate, coordinate) with modes relative to the motion of the pier tops."""
    return scipy.linalg.block_diag(
        np.diag(reduced.stiffness.diagonal()[: reduced.n_modes]), top_stiffness(reduced).toarray()
    )


def stepped_inertia(reduced: ReducedGuideway, time_step: float) -> FloatArray:
    """Symmetric mass (coordinate, coordinate) of a time step, for `stepped_stiffness`.

    A component mode has the inverse of its response as its own mass; pier tops have a share of
    their stiffness added to their mass.  The step itself is not symmetric: pier
    tops feel the modes' forces without their response (docs/theory/integration.md, eq. 4).
    """
    carried = reduced.carried.toarray()
    own = np.diag(1 / step_response(reduced, time_step)[: reduced.n_modes])
    tops = top_mass(reduced, time_step).toarray() + carried.T @ carried
    return np.block([[own, carried], [carried.T, tops]])


def step_response(reduced: ReducedGuideway, time_step: float) -> FloatArray:
    """Factor on the acceleration of each component mode in a step; one for pier tops.

    Verlet's step with sinc²(ωΔt/2) times the acceleration is exact for an undamped mode of circular
    frequency ω on its own, whatever the force at the steps.  The mass of the pier tops serves the
    same end (`maglev.mechanics.activity.stepped_mass`).

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
