"""The production solver: checks what it is given, runs rows of samples, names each outcome."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.linalg
import scipy.sparse as sp
from threadpoolctl import threadpool_limits

from maglev.mechanics import guideway as guideway_model
from maglev.mechanics import train as train_model
from maglev.mechanics._kernels import (
    COMPLETED,
    NOT_FINITE,
    Line,
    MagnetRows,
    Outcome,
    Places,
    Run,
    Stages,
    Vehicle,
    passage,
)
from maglev.mechanics.activity import Stage, stages, stepped_mass, top_mass, top_stiffness
from maglev.mechanics.course import first_step, n_steps, start, time_step, track_range
from maglev.mechanics.irregularity import Profile, displacement
from maglev.mechanics.lanes import LANES
from maglev.mechanics.reduction import (
    ReducedGuideway,
    rail_weights,
    reduce,
    standing_sag,
)
from maglev.mechanics.responses import Passages, acceleration_filter, checked_gains
from maglev.parameters import Config, Guideway, Magnet

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]


DAMPING_MARGIN = 1.4
"""Damping ratio of a component mode on its own over that of the guideway's modes, at most [-];
measured 1.25 with the default parameters."""


LINE_MARGIN = 0.92
"""Stable step of the whole guideway over that of its modes, which damping couples, each on its own
[-]; measured 0.93 or more."""


@dataclass(frozen=True)
class Ground:
    """Where poles of one kind can be after whole numbers of steps, and the sag of the rails there.

    Attributes
    ----------
    x : (place,)
        [m].
    sag, sag_slope : (place, side)
        Standing sag in the direction of the irregularity [m], and its derivative along travel [-].
    """

    x: Array
    sag: Array
    sag_slope: Array


@dataclass(frozen=True)
class System:
    """Everything a passage needs, as the kernels read it."""

    train: train_model.TrainModel
    reduced: ReducedGuideway
    vehicle: Vehicle
    suspension: MagnetRows
    guidance: MagnetRows
    suspension_places: Places
    guidance_places: Places
    grounds: tuple[Ground, Ground]
    line: Line
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
        Track irregularity over `track_range`; nothing before the fade-in, where the train rests.

    Returns
    -------
    system
        Ready for `integrate`.

    Raises
    ------
    ValueError
        If the time step exceeds the stability limit or the profile is shorter than the run.
    """
    train = train_model.build(config.train)
    guideway = guideway_model.build(config.guideway)
    reduced = reduce(
        guideway,
        config.passage.mode_cutoff,
        config.passage.mode_cutoff_elsewhere,
    )
    limit = stability_limit(config, train, reduced)
    if not time_step(config) < limit:
        raise ValueError(
            f"passage.time_step must be below the stability limit of {limit * 1e3:.3g} ms, "
            f"got {time_step(config) * 1e3:.3g} ms; take a smaller step or lower "
            "passage.mode_cutoff"
        )
    _check_reach(config, profile)
    suspension, guidance = (_magnet_rows(train, guidance=kind) for kind in (False, True))
    suspension_places, suspension_ground = _places(config, suspension, guideway, reduced)
    guidance_places, guidance_ground = _places(config, guidance, guideway, reduced)
    grounds = (suspension_ground, guidance_ground)
    tracks = _tracks(config, grounds, [profile])
    return System(
        train=train,
        reduced=reduced,
        vehicle=_vehicle(train),
        suspension=suspension,
        guidance=guidance,
        suspension_places=suspension_places._replace(rail=tracks[0][0], ramp=tracks[0][1]),
        guidance_places=guidance_places._replace(rail=tracks[1][0], ramp=tracks[1][1]),
        grounds=grounds,
        line=_line(reduced, config),
        config=config,
    )


def integrate(
    system: System,
    gains: Array,
    *,
    profile_of: Callable[[int], Profile] | None = None,
    record_every: int = 0,
    n_threads: int = 1,
    on_progress: Callable[[int], None] | None = None,
) -> Passages:
    """Run one passage per row of gains.

    A sample's numbers do not depend on its neighbours, on their number or on ``n_threads``.

    Parameters
    ----------
    system
        From `prepare`.
    gains : (sample, 4)
        Suspension k_p [A/m], k_d [A s/m], guidance k_p, k_d.
    profile_of
        Track irregularity of a sample by its number; the one that ``system`` was prepared with if
        not given.
    record_every
        Steps between recorded rows of the histories; zero records none.
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
    ValueError
        If the gains have the wrong shape or are not finite.
    """
    gains = checked_gains(gains)
    n_samples = gains.shape[0]
    n_rows = -(-n_samples // LANES)
    padded = np.empty((n_rows * LANES, 4))
    padded[:n_samples] = gains
    padded[n_samples:] = gains[-1]
    run = _run(system.config, record_every)

    def one_row(row: int) -> Outcome:
        outcome = _empty_outcome(system, run)
        lanes = np.ascontiguousarray(padded[row * LANES : (row + 1) * LANES].T)
        suspension_places, guidance_places = system.suspension_places, system.guidance_places
        if profile_of is not None:
            numbers = np.minimum(np.arange(row * LANES, (row + 1) * LANES), n_samples - 1)
            profiles = {int(k): profile_of(int(k)) for k in np.unique(numbers)}
            for profile in profiles.values():
                _check_reach(system.config, profile)
            of_kinds = _tracks(system.config, system.grounds, [profiles[int(k)] for k in numbers])
            suspension_places, guidance_places = (
                places._replace(rail=rail, ramp=ramp)
                for places, (rail, ramp) in zip(
                    (suspension_places, guidance_places), of_kinds, strict=True
                )
            )
        passage(
            system.vehicle,
            system.suspension,
            system.guidance,
            suspension_places,
            guidance_places,
            system.line,
            run,
            lanes,
            outcome,
        )
        if on_progress is not None:
            on_progress(min(LANES, n_samples - row * LANES))
        return outcome

    with ThreadPoolExecutor(max_workers=n_threads) as pool:
        outcomes = list(pool.map(one_row, range(n_rows)))
    return _gathered(outcomes, n_samples, system, run)


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
    for guidance in (False, True):
        rows = _magnet_rows(train, guidance=guidance)
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


def _vehicle(train: train_model.TrainModel) -> Vehicle:
    """Train for the kernels."""
    rows = train.link_rows.tocsr().sorted_indices()
    columns = rows.tocsc().sorted_indices()
    link = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
    hangs = np.column_stack([rows.indices, train.link_stiffness[link], train.link_damping[link]])
    scaled, number = np.unique(hangs, axis=0, return_inverse=True)
    return Vehicle(
        inverse_mass=1.0 / train.mass,
        scaled_dof=scaled[:, 0].astype(np.int64),
        scaled_stiffness=np.ascontiguousarray(scaled[:, 1]),
        scaled_damping=np.ascontiguousarray(scaled[:, 2]),
        link_start=rows.indptr.astype(np.int64),
        link_scaled=number.ravel().astype(np.int64),
        link_coefficient=rows.data.astype(np.float64),
        pull_start=columns.indptr.astype(np.int64),
        pull_link=columns.indices.astype(np.int64),
        pull_coefficient=columns.data.astype(np.float64),
        body_z=np.ascontiguousarray(train.car_body_dof[:, 1], dtype=np.int64),
        body_y=np.ascontiguousarray(train.car_body_dof[:, 0], dtype=np.int64),
    )


def _magnet_rows(train: train_model.TrainModel, *, guidance: bool) -> MagnetRows:
    magnet: Magnet = (
        train.parameters.guidance_magnet if guidance else train.parameters.suspension_magnet
    )
    table = train.magnets
    right, left = (
        np.flatnonzero((table.is_guidance == guidance) & (table.side == side)) for side in (1, -1)
    )
    right, left = right[np.argsort(-table.x[right])], left[np.argsort(-table.x[left])]
    if right.size != left.size or np.abs(table.x[right] - table.x[left]).max() > 1e-9:
        raise ValueError("magnets must stand in pairs, right and left at the same place")
    number = np.stack([right, left], axis=1)
    offset = train_model.pole_offsets(magnet)
    arm = offset if guidance else -offset
    rest = train_model.pole_static_force(train.parameters, table)[number][:, :, : offset.size]
    return MagnetRows(
        x=np.ascontiguousarray(table.x[right]),
        number=number.astype(np.int64),
        translation=table.translation_dof[number].astype(np.int64),
        rotation=table.rotation_dof[number].astype(np.int64),
        static_force=rest.sum(axis=2),
        static_moment=(rest * arm).sum(axis=2),
        constant=np.ascontiguousarray(
            rest * (magnet.gap_reference / magnet.current_reference) ** 2
        ),
        offset=offset,
        arm=arm,
        outward=np.array([1.0, -1.0 if guidance else 1.0]),
        gap_reference=magnet.gap_reference,
        current_reference=magnet.current_reference,
        current_max=magnet.current_max,
        is_guidance=guidance,
    )


def _stride(guideway: Guideway) -> int:
    """Rows of rail coefficients a span."""
    rail = guideway.rail
    return rail.units_per_span * 2 * (rail.connectors_per_unit + 2)


def _places(
    config: Config,
    rows: MagnetRows,
    guideway: guideway_model.GuidewayModel,
    reduced: ReducedGuideway,
) -> tuple[Places, Ground]:
    """Tabulate pieces of rail where the poles are after whole numbers of steps; no track yet."""
    advance = config.passage.speed * time_step(config)
    begins = (rows.x[:, None] + rows.offset + start(config)) / advance
    whole = np.floor(begins + 1e-6)
    beyond = np.round(begins - whole, 6)  # share of a step; places with the same one form a series
    series = np.unique(beyond)
    earliest = int(whole.min())
    count = int(whole.max()) - earliest + n_steps(config) + 1
    number = (whole - earliest).astype(np.int64) + count * np.searchsorted(series, beyond)
    x = ((earliest + np.arange(count) + series[:, None]) * advance).ravel()
    length, n_spans = config.guideway.span_length, config.guideway.n_spans
    on = (x >= -1e-9) & (x < length * n_spans - 1e-9)
    span = np.clip(np.floor(x / length + 1e-9), 0, n_spans - 1).astype(np.int64)
    first_coefficient, weight, slope = rail_weights(
        config.guideway, x - span * length, lateral=rows.is_guidance
    )
    sag, sag_slope = _standing_sag(config, rows, guideway, reduced, x)
    apart = np.array([1.0, -1.0 if rows.is_guidance else 1.0])
    nothing = np.zeros((x.size, 2, 1))
    places = Places(
        number=number,
        base=np.where(on, span * _stride(config.guideway) + first_coefficient, -1),
        weight=np.where(on[:, None], weight, 0.0),
        rise=np.where(on[:, None], slope * config.passage.speed, 0.0),
        rail=nothing,
        ramp=nothing,
    )
    return places, Ground(x=x, sag=sag[:, None] * apart, sag_slope=sag_slope[:, None] * apart)


def _tracks(
    config: Config, grounds: tuple[Ground, Ground], profiles: Sequence[Profile]
) -> list[tuple[Array, Array]]:
    """For each kind of pole what it meets at its places, and its rate (place, side, profile)."""
    tracks = []
    for ground, rows in zip(grounds, (slice(0, 2), slice(2, 4)), strict=True):
        rail, ramp = np.empty((2, *ground.sag.shape, len(profiles)))
        for k, profile in enumerate(profiles):
            value, slope = displacement(profile, ground.x)
            rail[..., k] = value[rows].T + ground.sag
            ramp[..., k] = (slope[rows].T + ground.sag_slope) * config.passage.speed
        tracks.append((rail, ramp))
    return tracks


def _check_reach(config: Config, profile: Profile) -> None:
    """Refuse a profile that is shorter than the run."""
    start, stop = track_range(config)
    grid_stop = profile.x0 + profile.dx * (profile.values.shape[1] - 1)
    if profile.x0 > start or grid_stop < stop:
        raise ValueError(
            f"the irregularity must reach from {start:.1f} m to {stop:.1f} m, "
            f"got {profile.x0:.1f} m to {grid_stop:.1f} m"
        )


def _standing_sag(
    config: Config,
    rows: MagnetRows,
    guideway: guideway_model.GuidewayModel,
    reduced: ReducedGuideway,
    x: Array,
) -> tuple[Array, Array]:
    """Sag of the rails under poles at ``x`` beyond that of the modes, and its slope along x."""
    length, n_spans = config.guideway.span_length, config.guideway.n_spans
    magnet = config.train.guidance_magnet if rows.is_guidance else config.train.suspension_magnet
    force = float(rows.constant.mean()) * (rows.current_reference / rows.gap_reference) ** 2
    sag, slope = np.zeros_like(x), np.zeros_like(x)
    for span in range(n_spans):
        inside = np.flatnonzero((x >= span * length) & (x < (span + 1) * length))
        places, of_span, its_slope = standing_sag(
            guideway,
            reduced,
            span,
            force,
            magnet.pole_pitch,
            lateral=rows.is_guidance,
        )
        at = x[inside] - span * length
        sag[inside] = np.interp(at, places, of_span)
        slope[inside] = np.interp(at, places, its_slope)
    return sag, slope


def _line(reduced: ReducedGuideway, config: Config) -> Line:
    """Guideway for the kernels."""
    columns, n = reduced.span_coordinates, reduced.n_modes
    rails = [
        [_relative(reduced, span, shapes[span]) for span in range(len(columns))]
        for shapes in (reduced.rail_z, reduced.rail_roll, reduced.rail_y)
    ]
    least = 1e-9 * max(np.abs(z).max() for z in rails[0])

    def moving(*kinds: list[Array]) -> list[IntArray]:
        """Columns of each span that move its rails."""
        return [
            np.flatnonzero(sum(np.abs(one).max(axis=1) for one in shapes) > least)
            for shapes in zip(*kinds, strict=True)
        ]

    def stacked(shapes: list[Array], chosen: list[IntArray]) -> Array:
        return np.concatenate([one[which] for one, which in zip(shapes, chosen, strict=True)])

    def numbered(chosen: list[IntArray]) -> tuple[IntArray, IntArray]:
        """Start of each span, and the coordinates."""
        numbers = [column[which] for column, which in zip(columns, chosen, strict=True)]
        return np.cumsum([0, *(number.size for number in numbers)]), np.concatenate(numbers)

    upright, sideways = moving(rails[0]), moving(*rails[1:])
    upright_start, upright_column = numbered(upright)
    sideways_start, sideways_column = numbered(sideways)
    response = step_response(reduced, time_step(config))
    middle = reduced.parameters.n_spans // 2
    midspan = np.stack(
        [_relative(reduced, middle, shape) for shape in (reduced.midspan_z, reduced.midspan_y)]
    )
    carried_start, carried_top, carried = _rows(reduced.carried)
    stiffness_start, stiffness_top, stiffness = _rows(top_stiffness(reduced))
    of_passage = stages(config, reduced)
    always = np.logical_and.reduce([stage.stepped for stage in of_passage])
    damping_start, damping_column, damping = _rows(
        _whole_and_short(_stepped_damping(reduced, time_step(config)), always)
    )
    taken_start, taken_mode, taken = _rows(
        _whole_and_short(reduced.carried.T.tocsr(), always[: reduced.n_modes])
    )
    return Line(
        n_spans=reduced.parameters.n_spans,
        span_length=reduced.parameters.span_length,
        stride=_stride(reduced.parameters),
        n_units=reduced.parameters.rail.units_per_span,
        upright_start=upright_start,
        upright=upright_column,
        sideways_start=sideways_start,
        sideways=sideways_column,
        rail_z=stacked(rails[0], upright),
        rail_roll=stacked(rails[1], sideways),
        rail_y=stacked(rails[2], sideways),
        square=reduced.stiffness.diagonal()[:n],
        response=response[:n],
        carried_start=carried_start,
        carried_top=carried_top + n,
        carried=carried,
        stiffness_start=stiffness_start,
        stiffness_top=stiffness_top + n,
        stiffness=stiffness,
        output_column=columns[middle],
        midspan=midspan,
        middle=middle,
        rest=np.stack([reduced.rest_z, reduced.rest_roll, reduced.rest_y]),
        damping_column=damping_column,
        damping=damping,
        taken_mode=taken_mode,
        taken=taken,
        stages=_stages(reduced, config, of_passage, damping_start, taken_start),
    )


def _relative(reduced: ReducedGuideway, span: int, shape: Array) -> Array:
    """Motion (column, …) in a span when its modes count from where the pier tops take them."""
    columns, own = reduced.span_coordinates[span], reduced.own_modes(span)
    tops = columns[own.size :] - reduced.n_modes
    carried = reduced.carried[own][:, tops]
    return np.concatenate([shape[: own.size], shape[own.size :] + carried.T @ shape[: own.size]])


def _stepped_damping(reduced: ReducedGuideway, time_step: float) -> sp.csr_array:
    """Damping on the rates of the coordinates as stepped.

    A mode's rate in a step, a central difference, is sinc(ωΔt) of its true one; its own damping
    makes up for that.
    """
    damping = reduced.relative_damping.copy()
    phase = np.sqrt(reduced.stiffness.diagonal()[: reduced.n_modes]) * time_step
    own = damping.diagonal()
    own[: reduced.n_modes] /= np.sinc(phase / np.pi)
    damping.setdiag(own)
    return damping


def _whole_and_short(matrix: sp.csr_array, always: npt.NDArray[np.bool_]) -> sp.csr_array:
    """The rows of a matrix, then the same without the columns that are not stepped in all stages.

    Short rows are those of quiet spans.
    """
    both = sp.vstack([matrix, matrix @ sp.diags_array(always.astype(float))]).tocsr()
    both.eliminate_zeros()
    return both


def _stages(
    reduced: ReducedGuideway,
    config: Config,
    of_passage: list[Stage],
    damping_start: IntArray,
    taken_start: IntArray,
) -> Stages:
    """What is stepped in each stage, and where its whole or short rows of damping and of what modes
    take along begin and end."""
    n = reduced.n_modes
    starts, tops_from, stepped, rows = [0], [], [], []
    factor_rows, factor_start, inverse = [], [0], []
    stilled = []
    before = np.zeros(reduced.n_coordinates, dtype=bool)
    for stage in of_passage:
        modes = np.flatnonzero(stage.stepped[:n])
        tops, factor = stepped_mass(reduced, stage.stepped, time_step(config))
        coordinates = np.concatenate([modes, tops])
        stepped.append(coordinates)
        rows.append(coordinates + np.where(stage.awake[coordinates], 0, reduced.n_coordinates))
        tops_from.append(starts[-1] + modes.size)
        starts.append(starts[-1] + coordinates.size)
        factor_start += [factor_start[-1]] * modes.size
        inverse.append(np.zeros(modes.size))
        inverse.append(1.0 / np.diagonal(factor))
        for k, row in enumerate(factor):
            met = np.flatnonzero(row[:k])
            factor_rows.append((tops[met], row[met]))
            factor_start.append(factor_start[-1] + met.size)
        stilled.append(np.flatnonzero(before & ~stage.stepped))
        before = stage.stepped
    row = np.concatenate(rows)
    top_row = np.maximum(row % reduced.n_coordinates - n, 0)
    top_row += np.where(row >= reduced.n_coordinates, reduced.n_coordinates - n, 0)
    return Stages(
        first_step=np.array([stage.first_step for stage in of_passage]),
        start=np.array(starts),
        tops=np.array(tops_from),
        stepped=np.concatenate(stepped),
        damping_from=damping_start[row],
        damping_to=damping_start[row + 1],
        taken_from=taken_start[top_row],
        taken_to=taken_start[top_row + 1],
        factor_start=np.array(factor_start),
        factor_top=np.concatenate([top for top, _ in factor_rows]),
        factor=np.concatenate([value for _, value in factor_rows]),
        factor_inverse=np.concatenate(inverse),
        stilled_start=np.cumsum([0, *(one.size for one in stilled)]),
        stilled=np.concatenate(stilled),
    )


def _rows(matrix: sp.csr_array) -> tuple[IntArray, IntArray, Array]:
    """Row starts, columns and values of a sparse matrix in order."""
    rows = matrix.tocsr().sorted_indices()
    return rows.indptr.astype(np.int64), rows.indices.astype(np.int64), rows.data


def _run(config: Config, record_every: int) -> Run:
    passage = config.passage
    dt = time_step(config)
    return Run(
        first_step=first_step(config),
        n_steps=n_steps(config),
        time_step=dt,
        speed=passage.speed,
        start=start(config),
        train_length=config.train.length,
        gap_contact=passage.gap_contact,
        gap_lost=passage.gap_lost,
        sections=np.ascontiguousarray(acceleration_filter(passage, dt)),
        record_every=record_every,
    )


def _empty_outcome(system: System, run: Run) -> Outcome:
    """Room for what a row of samples leaves behind, as for a train at rest."""
    n_cars = system.vehicle.body_z.size
    table = system.train.magnets
    n_magnets = table.x.size
    n_records = run.n_steps // run.record_every if run.record_every else 0
    kinds = (system.suspension, system.guidance)
    gap = np.array([[k.gap_reference] * LANES for k in kinds])
    current = np.array([[k.current_reference] * LANES for k in kinds])
    history = np.zeros((n_records, 4 + 2 * n_cars + 2 * n_magnets, LANES))
    of_kind = table.is_guidance.astype(np.int64)
    history[:, 4 + 2 * n_cars : -n_magnets] = gap[of_kind]
    history[:, -n_magnets:] = current[of_kind]
    return Outcome(
        extreme=np.zeros((4 + 2 * n_cars, LANES)),
        extreme_time=np.zeros((4 + 2 * n_cars, LANES)),
        gap_min=gap.copy(),
        gap_max=gap.copy(),
        current_max=current,
        status=np.zeros(LANES, np.int64),
        lost_time=np.full(LANES, np.nan),
        lost_magnet=np.full(LANES, -1, np.int64),
        at_loss=np.zeros((6, LANES)),
        history=history,
    )


def _gathered(outcomes: list[Outcome], n_samples: int, system: System, run: Run) -> Passages:
    n_cars = system.vehicle.body_z.size
    n_magnets = system.train.magnets.x.size

    def samples_first(name: str) -> npt.NDArray[np.float64]:
        rows = np.concatenate([getattr(outcome, name) for outcome in outcomes], axis=-1)
        return np.moveaxis(rows, -1, 0)[:n_samples]

    status = samples_first("status").astype(np.int64)
    extreme, when = samples_first("extreme").copy(), samples_first("extreme_time").copy()
    status[(status == COMPLETED) & ~np.isfinite(extreme).all(axis=1)] = NOT_FINITE
    extreme[status != COMPLETED] = np.nan
    when[status != COMPLETED] = np.nan
    # A lost sample goes on in its row as long as others hold; what it does then means nothing.
    lost_time, is_lost = samples_first("lost_time"), samples_first("lost_magnet") >= 0
    time = (np.arange(outcomes[0].history.shape[0]) + 1) * (run.record_every * run.time_step)
    history = np.moveaxis(samples_first("history"), 1, 2).copy()
    for sample in np.flatnonzero(is_lost):
        history[sample, :, time >= lost_time[sample] - 0.5 * run.time_step] = np.nan
    kept = ("gap_min", "gap_max", "current_max")  # in the order of `Outcome.at_loss`
    bounds = np.concatenate([samples_first(name) for name in kept], axis=1)
    bounds = np.where(is_lost[:, None], samples_first("at_loss"), bounds)
    at = 4 + 2 * n_cars
    return Passages(
        girder=extreme[:, :4],
        girder_time=when[:, :4],
        body_z=extreme[:, 4 : 4 + n_cars],
        body_y=extreme[:, 4 + n_cars :],
        body_z_time=when[:, 4 : 4 + n_cars],
        body_y_time=when[:, 4 + n_cars :],
        gap_min=bounds[:, 0:2],
        gap_max=bounds[:, 2:4],
        current_max=bounds[:, 4:6],
        status=status,
        lost_time=lost_time,
        lost_magnet=samples_first("lost_magnet").astype(np.int64),
        time=time,
        girder_history=history[:, :4],
        body_z_history=history[:, 4 : 4 + n_cars],
        body_y_history=history[:, 4 + n_cars : at],
        gap_history=history[:, at : at + n_magnets],
        current_history=history[:, at + n_magnets :],
    )
