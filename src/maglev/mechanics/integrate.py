"""The production solver: check the input, run rows of samples, collect their outcomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from threadpoolctl import threadpool_limits

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.errors import StepTooLarge, UserError
from maglev.mechanics import guideway as guideway_model
from maglev.mechanics import packing
from maglev.mechanics import train as train_model
from maglev.mechanics._kernels import cross
from maglev.mechanics._records import (
    COMPLETED,
    NOT_FINITE,
    STEP_TOO_LARGE,
    Footprints,
    Law,
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
from maglev.mechanics.own import (
    OwnTrains,
    Shape,
    own_footprints,
    own_law,
    own_timing,
    own_trains,
    shape_of,
)
from maglev.mechanics.own_spans import Frame, frame_of, guideways_of, own_spans
from maglev.mechanics.reduction import ReducedGuideway, reduce
from maglev.mechanics.responses import Passages, checked_gains, compared_with
from maglev.mechanics.statics import influence, largest_deflection
from maglev.mechanics.step_limit import (
    Headroom,
    guideway_limit,
    headroom,
    safe_gains,
    samples_too_fast,
    step_holds,
    train_limit,
    train_parts,
    trains_too_fast,
)
from maglev.mechanics.trains import own_rates
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
    headroom: Headroom
    profile: Profile
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
    StepTooLarge
        If the time step exceeds the stability limit.
    UserError
        If the profile does not cover the passage.
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
    suspension = packing.magnet_rows(train, config.control.suspension, guidance=False)
    guidance = packing.magnet_rows(train, config.control.guidance, guidance=True)
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
        headroom=headroom(parts, _mean_gains(config), own_rates(train), course(config).time_step),
        profile=profile,
        static_deflection=largest_deflection(guideway, train),
        config=config,
    )


@threadpool_limits.wrap(limits=1, user_api="blas")
def integrate(
    system: System,
    gains: FloatArray,
    *,
    values: Mapping[str, FloatArray] | None = None,
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
    values : key of (sample,)
        Numbers in SI of each sample in place of those of the configuration, by dotted keys whose
        cost is that of a sample (`maglev.mechanics.varied.cost_of`).
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
        If the gains have the wrong shape or are not finite, or a train of the samples' own cannot
        rest.
    """
    gains = checked_gains(gains, system.config.gains.further)
    batch = _batch(system, gains, values or {}, profile_of, record_every, with_magnets)
    found: list[tuple[Outcome, BoolArray, dict[str, FloatArray]]] = []
    n_rows = -(-gains.shape[0] // LANES)
    with ThreadPoolExecutor(max_workers=n_threads) as pool:
        for first in range(0, n_rows, BLOCK):
            rows = range(first, min(first + BLOCK, n_rows))
            of_row = _block(batch, rows)

            def one_row(
                row: int, of_row: RowOf = of_row
            ) -> tuple[Outcome, BoolArray, dict[str, FloatArray]]:
                arguments, too_fast, compared = of_row(row)
                cross(*arguments)
                if on_progress is not None:
                    on_progress(min(LANES, gains.shape[0] - row * LANES))
                return arguments[-1], too_fast, compared

            found += pool.map(one_row, rows)
    outcomes = [outcome for outcome, _, _ in found]
    too_fast = np.concatenate([flags for _, flags, _ in found])[: gains.shape[0]]
    compared = {
        name: np.concatenate([row[name] for _, _, row in found])[: gains.shape[0]]
        for name in found[0][2]
    }
    return _gathered(outcomes, gains.shape[0], system, batch.timing, too_fast, compared)


BLOCK = 16
"""Rows of samples whose own trains are made at once [-]; assumed: tables of some megabytes."""


@dataclass(frozen=True)
class _Batch:
    """Samples to run: a system, their gains and values, their tracks, and what all share."""

    system: System
    gains: FloatArray
    values: Mapping[str, FloatArray]
    profile_of: Callable[[int], Profile] | None
    laws: tuple[Law, Law]
    timing: Timing
    footprints: tuple[Footprints, Footprints]
    grounds: tuple[packing.Ground, packing.Ground]
    shape: Shape | None
    frame: Frame | None
    with_magnets: bool

    def samples(self, rows: range) -> IntArray:
        """Numbers of the samples in rows; the last stands wherever a row is not full."""
        numbers = np.arange(rows.start * LANES, rows.stop * LANES)
        return np.minimum(numbers, self.gains.shape[0] - 1)


@lru_cache(maxsize=2)
def influence_of(config: Config) -> FloatArray:
    """Deflection of midspan per force of each pole at rest, for all places of the train."""
    return influence(guideway_model.build(config.guideway), train_model.build(config.train))


def _batch(
    system: System,
    gains: FloatArray,
    values: Mapping[str, FloatArray],
    profile_of: Callable[[int], Profile] | None,
    record_every: int,
    with_magnets: bool,
) -> _Batch:
    """What all samples share."""
    config, kinds = system.config, (system.suspension, system.guidance)
    timing = packing.timing(config, record_every)
    circuits = (config.control.suspension, config.control.guidance)
    laws = [
        packing.law(circuit, rows, timing.time_step, gains)
        for circuit, rows in zip(circuits, kinds, strict=True)
    ]
    grounds = system.grounds
    footprints = (system.suspension_footprints, system.guidance_footprints)
    if any(key.endswith(".failed_magnets") for key in values):
        timing = timing._replace(first_step=1)
    if values:  # each sample's sag is its own: the shared track is the irregularity alone
        suspension, guidance = (
            replace(one, sag=0.0 * one.sag, sag_slope=0.0 * one.sag_slope) for one in grounds
        )
        grounds = (suspension, guidance)
        footprints = _on_tracks(footprints, packing.tracks(config, grounds, [system.profile]))
    of_guideway = tuple(key for key in values if key.startswith("guideway."))
    others = tuple(key for key in values if key not in of_guideway)
    shape = shape_of(config, system.train, kinds, others) if values else None
    frame = frame_of(config, of_guideway) if of_guideway else None
    return _Batch(
        system,
        gains,
        values,
        profile_of,
        (laws[0], laws[1]),
        timing,
        footprints,
        grounds,
        shape,
        frame,
        with_magnets,
    )


def _on_tracks(
    footprints: tuple[Footprints, Footprints], tracks: Sequence[tuple[FloatArray, FloatArray]]
) -> tuple[Footprints, Footprints]:
    """The footprints of both kinds with what the poles meet on other tracks."""
    first, second = (
        one._replace(rail=rail, ramp=ramp)
        for one, (rail, ramp) in zip(footprints, tracks, strict=True)
    )
    return first, second


RowOf = Callable[[int], tuple[tuple, BoolArray, dict[str, FloatArray]]]
"""Of a row by its number: arguments of the kernel, for which of its samples the step is too large
(LANES,), and what its responses are compared with."""


def _block(batch: _Batch, rows: range) -> RowOf:
    """What becomes of the rows of a block."""
    system, timing = batch.system, batch.timing
    numbers = batch.samples(rows)
    gains = batch.gains[numbers]

    def lanes(row: int) -> slice:
        return slice((row - rows.start) * LANES, (row - rows.start + 1) * LANES)

    if batch.shape is None:
        too_fast = samples_too_fast(system.parts, gains, timing.time_step, system.safe_gains)
        compared = compared_with(system.config, system.static_deflection, LANES)
        return lambda row: (_shared_arguments(batch, row), too_fast[lanes(row)], compared)
    values = {key: of_all[numbers] for key, of_all in batch.values.items()}
    others = {key: values[key] for key in batch.shape.keys}
    own = own_trains(batch.shape, others, numbers.size)
    influence = influence_of(system.config)
    too_fast = trains_too_fast(system.config, system.headroom, own.rates, gains, others)

    def of_row(row: int) -> tuple[tuple, BoolArray, dict[str, FloatArray]]:
        samples = lanes(row)
        spans, beyond = system.spans, np.zeros(LANES, dtype=bool)
        stiffer, softness = np.ones(LANES), np.ones(LANES)
        if batch.frame is not None:
            each = {key: one[samples] for key, one in values.items()}
            guideways = guideways_of(system.config, each, range(LANES))
            spans, beyond, softness = own_spans(batch.frame, guideways)
            modulus = [one.rail.section.elastic_modulus for one in guideways]
            stiffer = np.array(modulus) / system.config.guideway.rail.section.elastic_modulus
        arguments = _own_arguments(batch, own, row, samples, spans, 1.0 / stiffer)
        compared = own.compared_with(influence, system.config.guideway.span_length, samples)
        compared["static_deflection"] *= softness
        return arguments, too_fast[samples] | beyond, compared

    return of_row


def _shared_arguments(batch: _Batch, row: int) -> tuple:
    """Arguments of the kernel for a row of samples that share a train."""
    system = batch.system
    kinds = (system.suspension, system.guidance)
    return (
        system.vehicle,
        *kinds,
        *batch.laws,
        *_tracks_of_row(batch, row),
        system.spans,
        batch.timing,
        np.ascontiguousarray(batch.gains[batch.samples(range(row, row + 1))].T),
        packing.empty_outcome(system.train, kinds, batch.timing, with_magnets=batch.with_magnets),
    )


def _own_arguments(
    batch: _Batch, own: OwnTrains, row: int, samples: slice, spans: Spans, softer: FloatArray
) -> tuple:
    """Arguments of the kernel for a row of samples that have each a train of its own.

    The sag is that of the rail between its connectors: it goes with the rail's softness.
    """
    system, config = batch.system, batch.system.config
    kinds = (own.kind(0, samples), own.kind(1, samples))
    timing = own_timing(batch.timing, own, samples)
    circuits = (config.control.suspension, config.control.guidance)
    laws = [
        own_law(law, lag[samples], circuit.delay, timing.time_step)
        for law, lag, circuit in zip(batch.laws, own.lag, circuits, strict=True)
    ]
    footprints = [
        own_footprints(one, ground, level[samples], sagging[samples] * softer, config.passage.speed)
        for one, ground, level, sagging in zip(
            _tracks_of_row(batch, row), system.grounds, own.level, own.sagging, strict=True
        )
    ]
    return (
        own.vehicle(samples),
        *kinds,
        *laws,
        *footprints,
        spans,
        timing,
        np.ascontiguousarray(batch.gains[batch.samples(range(row, row + 1))].T),
        packing.empty_outcome(system.train, kinds, timing, with_magnets=batch.with_magnets),
    )


def _tracks_of_row(batch: _Batch, row: int) -> tuple[Footprints, Footprints]:
    """The footprints of both kinds on the track, or the tracks, of a row of samples."""
    if batch.profile_of is None:
        return batch.footprints
    numbers = batch.samples(range(row, row + 1))
    profiles = {int(k): batch.profile_of(int(k)) for k in np.unique(numbers)}
    config = batch.system.config
    for profile in profiles.values():
        _check_reach(config, profile)
    of_kinds = packing.tracks(config, batch.grounds, [profiles[int(k)] for k in numbers])
    return _on_tracks(batch.footprints, of_kinds)


def _check_step(config: Config, reduced: ReducedGuideway, parts: tuple[Block, ...]) -> None:
    """Refuse a step that is unstable for the guideway or for the train at its mean gains."""
    dt, gains = course(config).time_step, _mean_gains(config)
    limit = guideway_limit(config, reduced, dt)
    if not step_holds(parts, gains, dt):
        limit = min(limit, train_limit(parts, gains))
    if not dt < limit:
        raise StepTooLarge(
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
    compared: dict[str, FloatArray],
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
        **compared,
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
