"""The production solver: check the input, run rows of samples, collect their outcomes."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from threadpoolctl import threadpool_limits

from maglev.arrays import BoolArray, FloatArray
from maglev.errors import UserError
from maglev.mechanics import guideway as guideway_model
from maglev.mechanics import packing
from maglev.mechanics import train as train_model
from maglev.mechanics._kernels import cross
from maglev.mechanics._records import (
    COMPLETED,
    NOT_FINITE,
    STEP_TOO_LARGE,
    Footprints,
    MagnetRows,
    Outcome,
    Spans,
    Timing,
    Vehicle,
)
from maglev.mechanics.comfort import WEIGHTINGS, readings
from maglev.mechanics.course import course, track_range
from maglev.mechanics.irregularity import Profile
from maglev.mechanics.lanes import LANES
from maglev.mechanics.linear import Block
from maglev.mechanics.reduction import ReducedGuideway, reduce
from maglev.mechanics.responses import Passages, checked_gains, compared_with
from maglev.mechanics.statics import largest_deflection
from maglev.mechanics.step_limit import (
    guideway_limit,
    safe_gains,
    samples_too_fast,
    step_holds,
    train_limit,
    train_parts,
)
from maglev.parameters import Config


@dataclass(frozen=True)
class System:
    """Train, guideway, magnets and track as arrays for the kernels.

    ``static_deflection`` is the largest of midspan under the train at rest [m].
    """

    train: train_model.TrainModel
    reduced: ReducedGuideway
    vehicle: Vehicle
    suspension: MagnetRows
    guidance: MagnetRows
    suspension_footprints: Footprints
    guidance_footprints: Footprints
    grounds: tuple[packing.Ground, packing.Ground]
    spans: Spans
    parts: tuple[Block, ...]
    safe_gains: FloatArray
    static_deflection: float
    config: Config


@threadpool_limits.wrap(limits=1, user_api="blas")
def prepare(config: Config, profile: Profile) -> System:
    """Build train, guideway and track for the kernels and check that they can be integrated.

    Linear algebra is done on one core: on several it rounds otherwise, and a passage would depend
    on the number of cores.

    Parameters
    ----------
    config
        Parameters of everything.
    profile
        Track irregularity over `track_range`, zero before the fade-in, where the train rests.

    Returns
    -------
    system
        Ready for `integrate`.

    Raises
    ------
    UserError
        If the time step exceeds the stability limit or the profile does not cover the passage.
    """
    train = train_model.build(config.train)
    guideway = guideway_model.build(config.guideway)
    reduced = reduce(
        guideway,
        config.passage.mode_cutoff,
        config.passage.mode_cutoff_elsewhere,
    )
    parts = train_parts(config)
    _check_step(config, reduced, parts)
    _check_reach(config, profile)
    suspension, guidance = (packing.magnet_rows(train, guidance=kind) for kind in (False, True))
    suspension_footprints, suspension_ground = packing.footprints(
        config, suspension, guideway, reduced
    )
    guidance_footprints, guidance_ground = packing.footprints(config, guidance, guideway, reduced)
    grounds = (suspension_ground, guidance_ground)
    tracks = packing.tracks(config, grounds, [profile])
    return System(
        train=train,
        reduced=reduced,
        vehicle=packing.vehicle(train),
        suspension=suspension,
        guidance=guidance,
        suspension_footprints=suspension_footprints._replace(rail=tracks[0][0], ramp=tracks[0][1]),
        guidance_footprints=guidance_footprints._replace(rail=tracks[1][0], ramp=tracks[1][1]),
        grounds=grounds,
        spans=packing.spans(reduced, config),
        parts=parts,
        safe_gains=safe_gains(parts, _mean_gains(config), course(config).time_step),
        static_deflection=largest_deflection(guideway, train),
        config=config,
    )


def integrate(
    system: System,
    gains: FloatArray,
    *,
    profile_of: Callable[[int], Profile] | None = None,
    record_every: int = 0,
    with_magnets: bool = True,
    n_threads: int = 1,
    on_progress: Callable[[int], None] | None = None,
) -> Passages:
    """Run one passage per row of gains.

    A sample for whose gains the step is unstable is not judged: its status says so.  A sample's
    numbers do not depend on its neighbours, on their number or on ``n_threads``.

    Parameters
    ----------
    system
        From `prepare`.
    gains : (sample, 4) or (sample, 8)
        Suspension k_p [A/m], k_d [A s/m], guidance k_p, k_d; then suspension k_a [A s²/m],
        k_i [A/(m s)], guidance k_a, k_i, those of the configuration if left out.
    profile_of
        Track irregularity of a sample by its number; the one that ``system`` was prepared with if
        not given.
    record_every
        Steps between recorded rows of the histories; zero records none.
    with_magnets
        Whether histories have the gaps and currents of the magnets, most of their size.
    n_threads
        Rows of samples that run at the same time.
    on_progress
        Called with the number of samples that have just finished.

    Returns
    -------
    passages
        Extremes, outcomes and histories.

    Raises
    ------
    UserError
        If the gains have the wrong shape or are not finite.
    """
    config = system.config
    gains = checked_gains(gains, config.gains.further)
    n_samples = gains.shape[0]
    n_rows = -(-n_samples // LANES)
    padded = np.empty((n_rows * LANES, 8))
    padded[:n_samples] = gains
    padded[n_samples:] = gains[-1]
    timing = packing.timing(config, record_every)
    kinds = (system.suspension, system.guidance)
    suspension_law, guidance_law = (
        packing.law(circuit, rows, timing.time_step, gains)
        for circuit, rows in zip(
            (config.control.suspension, config.control.guidance), kinds, strict=True
        )
    )

    def one_row(row: int) -> Outcome:
        outcome = packing.empty_outcome(system.train, kinds, timing, with_magnets=with_magnets)
        lanes = np.ascontiguousarray(padded[row * LANES : (row + 1) * LANES].T)
        suspension_footprints, guidance_footprints = (
            system.suspension_footprints,
            system.guidance_footprints,
        )
        if profile_of is not None:
            numbers = np.minimum(np.arange(row * LANES, (row + 1) * LANES), n_samples - 1)
            profiles = {int(k): profile_of(int(k)) for k in np.unique(numbers)}
            for profile in profiles.values():
                _check_reach(config, profile)
            of_kinds = packing.tracks(config, system.grounds, [profiles[int(k)] for k in numbers])
            suspension_footprints, guidance_footprints = (
                footprints._replace(rail=rail, ramp=ramp)
                for footprints, (rail, ramp) in zip(
                    (suspension_footprints, guidance_footprints), of_kinds, strict=True
                )
            )
        cross(
            system.vehicle,
            system.suspension,
            system.guidance,
            suspension_law,
            guidance_law,
            suspension_footprints,
            guidance_footprints,
            system.spans,
            timing,
            lanes,
            outcome,
        )
        if on_progress is not None:
            on_progress(min(LANES, n_samples - row * LANES))
        return outcome

    with ThreadPoolExecutor(max_workers=n_threads) as pool:
        outcomes = list(pool.map(one_row, range(n_rows)))
    too_fast = samples_too_fast(system.parts, gains, timing.time_step, system.safe_gains)
    return _gathered(outcomes, n_samples, system, timing, too_fast)


def _check_step(config: Config, reduced: ReducedGuideway, parts: tuple[Block, ...]) -> None:
    """Refuse a step that is unstable for the guideway or for the train at its mean gains."""
    dt, gains = course(config).time_step, _mean_gains(config)
    limit = guideway_limit(config, reduced, dt)
    if not step_holds(parts, gains, dt):
        limit = min(limit, train_limit(parts, gains))
    if not dt < limit:
        raise UserError(
            f"passage.time_step must be below the stability limit of {limit * 1e3:.3g} ms, "
            f"got {dt * 1e3:.3g} ms; take a smaller step or lower passage.mode_cutoff"
        )


def _mean_gains(config: Config) -> FloatArray:
    return np.array([*config.gains.as_row, *config.gains.further])


def _check_reach(config: Config, profile: Profile) -> None:
    """Refuse a profile that does not cover the passage."""
    start, stop = track_range(config)
    grid_stop = profile.x0 + profile.dx * (profile.values.shape[1] - 1)
    if profile.x0 > start or grid_stop < stop:
        raise UserError(
            f"the irregularity must reach from {start:.1f} m to {stop:.1f} m, "
            f"got {profile.x0:.1f} m to {grid_stop:.1f} m"
        )


def _gathered(
    outcomes: list[Outcome],
    n_samples: int,
    system: System,
    timing: Timing,
    too_fast: BoolArray,
) -> Passages:
    n_cars = system.vehicle.body_z.size
    n_magnets = system.train.magnets.x.size

    def samples_first(name: str) -> FloatArray:
        rows = np.concatenate([getattr(outcome, name) for outcome in outcomes], axis=-1)
        return np.moveaxis(rows, -1, 0)[:n_samples]

    status = samples_first("status").astype(np.int64)
    extreme, when = samples_first("extreme").copy(), samples_first("extreme_time").copy()
    status[(status == COMPLETED) & ~np.isfinite(extreme).all(axis=1)] = NOT_FINITE
    status[too_fast] = STEP_TOO_LARGE
    extreme[status != COMPLETED] = np.nan
    when[status != COMPLETED] = np.nan
    # A lost sample goes on in its row as long as others hold; what it does then means nothing.
    lost_time, is_lost = samples_first("lost_time"), samples_first("lost_magnet") >= 0
    number = np.arange(1.0, outcomes[0].history.shape[0] + 1)
    time = number * (timing.record_every * timing.time_step)
    history = np.moveaxis(samples_first("history"), 1, 2).copy()
    for sample in np.flatnonzero(is_lost):
        history[sample, :, time >= lost_time[sample] - 0.5 * timing.time_step] = np.nan
    kept = ("gap_min", "gap_max", "current_max")  # in the order of `Outcome.at_loss`
    bounds = np.concatenate([samples_first(name) for name in kept], axis=1)
    bounds = np.where(is_lost[:, None], samples_first("at_loss"), bounds)
    bounds[too_fast], history[too_fast] = np.nan, np.nan
    at = 4 + 2 * n_cars
    ends = extreme[:, at : at + 2 * n_cars]
    ends_time = when[:, at : at + 2 * n_cars]
    signed = samples_first("signed")
    squares = samples_first("squares").reshape(n_samples, len(WEIGHTINGS), n_cars, 2)
    weighted = np.sqrt(squares.max(axis=3) / readings(system.config).count)
    for of_sample in (signed, weighted):
        of_sample[status != COMPLETED] = np.nan
    return Passages(
        girder=extreme[:, :4],
        girder_time=when[:, :4],
        body_z=extreme[:, 4 : 4 + n_cars],
        body_y=extreme[:, 4 + n_cars : at],
        body_z_time=when[:, 4 : 4 + n_cars],
        body_y_time=when[:, 4 + n_cars : at],
        girder_positive=signed[:, 0::2],
        girder_negative=signed[:, 1::2],
        end_z=ends[:, :n_cars],
        end_y=ends[:, n_cars:],
        end_z_time=ends_time[:, :n_cars],
        end_y_time=ends_time[:, n_cars:],
        weighted=weighted,
        lift=extreme[:, -1],
        lift_time=when[:, -1],
        **compared_with(system.config, system.static_deflection, n_samples),
        gap_min=bounds[:, 0:2],
        gap_max=bounds[:, 2:4],
        current_max=bounds[:, 4:6],
        status=status,
        lost_time=np.where(too_fast, np.nan, lost_time),
        lost_magnet=np.where(too_fast, -1, samples_first("lost_magnet")).astype(np.int64),
        time=time,
        girder_history=history[:, :4],
        body_z_history=history[:, 4 : 4 + n_cars],
        body_y_history=history[:, 4 + n_cars : at],
        gap_history=history[:, at : at + n_magnets],
        current_history=history[:, at + n_magnets :],
    )
