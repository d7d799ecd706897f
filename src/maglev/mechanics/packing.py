"""Arrays for the kernels: train, magnets, circuits, footprints and guideway."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.mechanics import guideway as guideway_model
from maglev.mechanics import train as train_model
from maglev.mechanics._records import (
    Comfort,
    Footprints,
    Law,
    MagnetRows,
    Outcome,
    Spans,
    Stretches,
    Terms,
    Timing,
    Vehicle,
)
from maglev.mechanics.activity import Stretch, stepped_mass, stretches, top_stiffness
from maglev.mechanics.comfort import WEIGHTINGS, readings
from maglev.mechanics.control import first_moving_step, grouping, late_current, without_current
from maglev.mechanics.course import course
from maglev.mechanics.irregularity import Profile, mean_displacement
from maglev.mechanics.lanes import LANES
from maglev.mechanics.reduction import ReducedGuideway, face_weights, standing_sag
from maglev.mechanics.responses import acceleration_filter
from maglev.mechanics.step_limit import step_response
from maglev.parameters import Circuit, Config, Guideway, Magnet

_SHARED = np.zeros(0, dtype=np.int64)
"""Numbers of rows where all samples share one number."""


@dataclass(frozen=True)
class Ground:
    """Positions of the faces of one kind of pole after whole numbers of steps, and the sag there.

    Attributes
    ----------
    x : (footprint,)
        Middle of a pole's face [m].
    pole_length
        Of the face [m].
    sag, sag_slope : (footprint, side)
        Standing sag in the direction of the irregularity [m], and its derivative along travel [-].
    """

    x: FloatArray
    pole_length: float
    sag: FloatArray
    sag_slope: FloatArray


def vehicle(train: train_model.TrainModel) -> Vehicle:
    """Train with open magnets for the kernels."""
    rows = train.link_rows.tocsr().sorted_indices()
    columns = rows.tocsc().sorted_indices()
    link = np.repeat(np.arange(rows.shape[0]), np.diff(rows.indptr))
    hangs = np.column_stack([rows.indices, train.link_stiffness[link], train.link_damping[link]])
    scaled, number = np.unique(hangs, axis=0, return_inverse=True)
    return Vehicle(
        inverse_mass=1.0 / train.mass,
        mass_number=_SHARED,
        scaled_dof=scaled[:, 0].astype(np.int64),
        scaled_stiffness=np.ascontiguousarray(scaled[:, 1]),
        stiffness_number=_SHARED,
        scaled_damping=np.ascontiguousarray(scaled[:, 2]),
        damping_number=_SHARED,
        link_start=rows.indptr.astype(np.int64),
        link_scaled=number.ravel().astype(np.int64),
        link_coefficient=rows.data.astype(np.float64),
        pull_start=columns.indptr.astype(np.int64),
        pull_link=columns.indices.astype(np.int64),
        pull_coefficient=columns.data.astype(np.float64),
        own_link=no_terms(),
        own_pull=no_terms(),
        body_z=np.ascontiguousarray(train.car_body_dof[:, 1], dtype=np.int64),
        body_y=np.ascontiguousarray(train.car_body_dof[:, 0], dtype=np.int64),
        body_pitch=np.ascontiguousarray(train.car_body_dof[:, 3], dtype=np.int64),
        body_yaw=np.ascontiguousarray(train.car_body_dof[:, 4], dtype=np.int64),
        end_distance=train.parameters.end_distance,
    )


def no_terms() -> Terms:
    """No sum in which a sample has anything of its own."""
    return Terms(_SHARED, np.zeros(1, np.int64), _SHARED, _SHARED, np.zeros((0, LANES)))


def magnet_rows(train: train_model.TrainModel, circuit: Circuit, *, guidance: bool) -> MagnetRows:
    """Magnets of one kind for the kernels; those that carry no current have a largest of zero."""
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
    of_kind = np.flatnonzero(table.is_guidance == guidance)
    failed = np.zeros(table.x.size, dtype=bool)
    failed[of_kind] = without_current(
        circuit, table.x[of_kind], table.side[of_kind], guidance=guidance
    )
    offset = train_model.pole_offsets(magnet)
    arm = offset if guidance else -offset
    rest = train_model.pole_static_force(train.parameters, table)[number][:, :, : offset.size]
    return MagnetRows(
        x=np.ascontiguousarray(table.x[right]),
        number=number.astype(np.int64),
        translation=table.translation_dof[number].astype(np.int64),
        rotation=table.rotation_dof[number].astype(np.int64),
        static_force=rest.sum(axis=2).ravel(),
        force_number=_SHARED,
        static_moment=(rest * arm).sum(axis=2).ravel(),
        moment_number=_SHARED,
        constant=(rest * (magnet.gap_reference / magnet.current_reference) ** 2).ravel(),
        constant_number=_SHARED,
        offset=offset,
        arm=arm,
        outward=np.array([1.0, -1.0 if guidance else 1.0]),
        gap_reference=magnet.gap_reference,
        current_reference=magnet.current_reference,
        current_max=np.where(failed[number].ravel(), 0.0, magnet.current_max),
        current_number=_SHARED,
        mass=magnet.mass,
        inertia=magnet.inertia,
        is_guidance=guidance,
    )


def law(circuit: Circuit, rows: MagnetRows, time_step: float, gains: FloatArray) -> Law:
    """Circuits of one kind of magnet for the kernels.

    Parameters
    ----------
    circuit
        Sharing of circuits, and lag and delay of their current.
    rows
        The magnets.
    time_step
        Δt [s].
    gains : (sample, 8)
        Gains of all samples; terms whose gains are all zero are skipped.

    Returns
    -------
    law
        The lag is exact for a command that is linear within a step; the delayed signal is
        interpolated by a parabola through three steps.

    References
    ----------
    docs/theory/control.md, eqs. 1 to 3.
    """
    n_poles = rows.offset.size
    group = grouping(circuit.group, n_poles)
    feed = sp.csr_array(group.feed)
    pairs = [np.flatnonzero(row) for row in group.drive]
    late = late_current(circuit.lag, circuit.delay, time_step)
    kind = 2 if rows.is_guidance else 0
    return Law(
        n_circuits=group.feed.shape[0],
        own_gap=circuit.group == "pole",
        mean_gap_force=group.mean_gap_force,
        feed_start=feed.indptr.astype(np.int64),
        feed_pole=feed.indices.astype(np.int64),
        feed_weight=feed.data.astype(np.float64),
        arm=group.feed @ rows.arm,
        senses=np.any(group.feed, axis=0).astype(np.int64),
        first=np.array([pair[0] for pair in pairs], dtype=np.int64),
        second=np.array([pair[-1] for pair in pairs], dtype=np.int64),
        lags=circuit.lag > 0,
        decay=late.decay,
        command_now=late.now,
        command_before=late.before,
        delays=circuit.delay > 0,
        ring=late.behind + 3,
        behind=late.behind,
        delayed=late.delayed,
        undelayed=late.undelayed,
        accelerates=bool(np.any(gains[:, 4 + kind])),
        integrates=bool(np.any(gains[:, 5 + kind])),
    )


def _stride(guideway: Guideway) -> int:
    """Rows of rail coefficients a span."""
    rail = guideway.rail
    return rail.units_per_span * 2 * (rail.connectors_per_unit + 2)


def footprints(
    config: Config,
    rows: MagnetRows,
    guideway: guideway_model.GuidewayModel,
    reduced: ReducedGuideway,
) -> tuple[Footprints, Ground]:
    """Tabulate rails and sag under the poles after whole numbers of steps; no track yet."""
    way = course(config)
    begins = (rows.x[:, None] + rows.offset + way.start) / way.advance
    whole = np.floor(begins + 1e-6)
    beyond = np.round(
        begins - whole, 6
    )  # share of a step; footprints with the same share form a series
    series = np.unique(beyond)
    earliest = int(whole.min())
    count = int(whole.max()) - earliest + way.n_steps + 1
    number = (whole - earliest).astype(np.int64) + count * np.searchsorted(series, beyond)
    x = ((earliest + np.arange(count) + series[:, None]) * way.advance).ravel()
    magnet = _magnet(config, rows)
    faces = face_weights(
        config.guideway, x, magnet.pole_length, lateral=rows.is_guidance, advance=way.advance
    )
    sag, sag_slope = _standing_sag(config, rows, guideway, reduced, x, way.advance)
    apart = np.array([1.0, -1.0 if rows.is_guidance else 1.0])
    flat = np.zeros((x.size, 2, 1))
    tabulated = Footprints(
        number=number,
        first=faces.first,
        start=faces.start,
        weight=faces.weight,
        rise=faces.slope * config.passage.speed,
        rail=flat,
        ramp=flat,
        level=1.0,
        sag=np.zeros(2 * x.size),
        sag_rise=np.zeros(2 * x.size),
        sagging=1.0,
    )
    ground = Ground(
        x=x,
        pole_length=magnet.pole_length,
        sag=sag[:, None] * apart,
        sag_slope=sag_slope[:, None] * apart,
    )
    return tabulated, ground


def _magnet(config: Config, rows: MagnetRows) -> Magnet:
    return config.train.guidance_magnet if rows.is_guidance else config.train.suspension_magnet


def tracks(
    config: Config, grounds: tuple[Ground, Ground], profiles: Sequence[Profile]
) -> list[tuple[FloatArray, FloatArray]]:
    """Irregularity under each kind of pole, and its rate (footprint, side, profile)."""
    met = []
    one_each = list({id(profile): profile for profile in profiles}.values())
    column = [next(k for k, one in enumerate(one_each) if one is profile) for profile in profiles]
    for ground, rows in zip(grounds, (slice(0, 2), slice(2, 4)), strict=True):
        rail, ramp = np.empty((2, *ground.sag.shape, len(one_each)))
        for k, profile in enumerate(one_each):
            value, slope = mean_displacement(profile, ground.x, ground.pole_length)
            rail[..., k] = value[rows].T + ground.sag
            ramp[..., k] = (slope[rows].T + ground.sag_slope) * config.passage.speed
        rail, ramp = (np.ascontiguousarray(one[..., column]) for one in (rail, ramp))
        met.append((rail, ramp))
    return met


def mean_pole_force(rows: MagnetRows) -> float:
    """Force of a pole at rest, mean over those of a kind [N]."""
    return float(rows.constant.mean() * np.square(rows.current_reference / rows.gap_reference))


def _standing_sag(
    config: Config,
    rows: MagnetRows,
    guideway: guideway_model.GuidewayModel,
    reduced: ReducedGuideway,
    x: FloatArray,
    advance: float,
) -> tuple[FloatArray, FloatArray]:
    """Sag of the rails at poles at ``x`` that the modes leave out, and its slope along x.

    The slope under a face is its mean over a step, as that of `face_weights`.
    """
    length, n_spans = config.guideway.span_length, config.guideway.n_spans
    magnet = _magnet(config, rows)
    force = mean_pole_force(rows)
    sag, slope = np.zeros_like(x), np.zeros_like(x)
    for span in range(n_spans):
        inside = np.flatnonzero((x >= span * length) & (x < (span + 1) * length))
        along, of_span, its_slope = standing_sag(
            guideway,
            reduced,
            span,
            force,
            magnet.pole_pitch,
            lateral=rows.is_guidance,
            pole_length=magnet.pole_length,
        )
        at = x[inside] - span * length
        sag[inside] = np.interp(at, along, of_span)
        if magnet.pole_length == 0:
            slope[inside] = np.interp(at, along, its_slope)
            continue
        ends = [np.clip(at + part * advance, 0.0, length) for part in (-0.5, 0.5)]
        rise = np.subtract(*(np.interp(end, along, of_span) for end in ends[::-1]))
        slope[inside] = rise / (ends[1] - ends[0])
    return sag, slope


def spans(reduced: ReducedGuideway, config: Config) -> Spans:
    """Guideway for the kernels."""
    way = course(config)
    columns, n = reduced.span_coordinates, reduced.n_modes
    rails = [
        [_relative(reduced, span, shapes[span]) for span in range(len(columns))]
        for shapes in (reduced.rail_z, reduced.rail_roll, reduced.rail_y)
    ]
    least = 1e-9 * max(np.abs(z).max() for z in rails[0])

    def moving(*kinds: list[FloatArray]) -> list[IntArray]:
        """Columns of each span that move its rails."""
        return [
            np.flatnonzero(sum(np.abs(one).max(axis=1) for one in shapes) > least)
            for shapes in zip(*kinds, strict=True)
        ]

    def stacked(shapes: list[FloatArray], chosen: list[IntArray]) -> FloatArray:
        return np.concatenate([one[which] for one, which in zip(shapes, chosen, strict=True)])

    def numbered(chosen: list[IntArray]) -> tuple[IntArray, IntArray]:
        """Start of each span, and the coordinates."""
        numbers = [column[which] for column, which in zip(columns, chosen, strict=True)]
        return np.cumsum([0, *(number.size for number in numbers)]), np.concatenate(numbers)

    upright, sideways = moving(rails[0]), moving(*rails[1:])
    upright_start, upright_column = numbered(upright)
    sideways_start, sideways_column = numbered(sideways)
    response = step_response(reduced, way.time_step)
    middle = reduced.parameters.n_spans // 2
    midspan = np.stack(
        [_relative(reduced, middle, shape) for shape in (reduced.midspan_z, reduced.midspan_y)]
    )
    carried_start, carried_top, carried = _rows(reduced.carried)
    stiffness_start, stiffness_top, stiffness = _rows(top_stiffness(reduced))
    of_passage = stretches(config, reduced)
    always = np.logical_and.reduce([stretch.stepped for stretch in of_passage])
    damping_start, damping_column, damping = _rows(
        whole_and_short(_stepped_damping(reduced, way.time_step), always)
    )
    taken_start, taken_mode, taken = _rows(
        whole_and_short(reduced.carried.T.tocsr(), always[: reduced.n_modes])
    )
    return Spans(
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
        change=np.zeros(0),
        change_start=_SHARED,
        square=reduced.stiffness.diagonal()[:n],
        response=response[:n],
        mode_number=_SHARED,
        carried_start=carried_start,
        carried_top=carried_top + n,
        carried=carried,
        carried_number=_SHARED,
        stiffness_start=stiffness_start,
        stiffness_top=stiffness_top + n,
        stiffness=stiffness,
        stiffness_number=_SHARED,
        output_column=columns[middle],
        midspan=midspan.ravel(),
        middle=middle,
        rest=np.concatenate([reduced.rest_z, reduced.rest_roll, reduced.rest_y]),
        in_order=np.arange(upright_column.size + sideways_column.size),
        bearing=np.concatenate([_relative(reduced, middle, one) for one in reduced.bearing]),
        bearing_rest=reduced.bearing_rest.ravel(),
        damping_column=damping_column,
        damping=damping,
        damping_root=np.zeros(0),
        root_number=_SHARED,
        taken_mode=taken_mode,
        taken=taken,
        taken_number=_SHARED,
        stretches=_stretches(reduced, config, of_passage, damping_start, taken_start),
    )


def _relative(reduced: ReducedGuideway, span: int, shape: FloatArray) -> FloatArray:
    """Shapes (column, …) of a span whose modes are relative to the pier tops."""
    columns, own = reduced.span_coordinates[span], reduced.own_modes(span)
    tops = columns[own.size :] - reduced.n_modes
    carried = reduced.carried[own][:, tops]
    return np.concatenate([shape[: own.size], shape[own.size :] + carried.T @ shape[: own.size]])


def _stepped_damping(reduced: ReducedGuideway, time_step: float) -> sp.csr_array:
    """Damping matrix for the rates of a step.

    The rate of a mode in a step, a central difference, is sinc(ωΔt) times the true one; its own
    damping is divided by this factor.
    """
    damping = reduced.relative_damping.copy()
    phase = np.sqrt(reduced.stiffness.diagonal()[: reduced.n_modes]) * time_step
    own = damping.diagonal()
    own[: reduced.n_modes] /= np.sinc(phase / np.pi)
    damping.setdiag(own)
    return damping


def whole_and_short(matrix: sp.csr_array, always: BoolArray) -> sp.csr_array:
    """The rows of a matrix, then the same rows without columns that some stretch does not step.

    The short rows are those of quiet spans.
    """
    both = sp.vstack([matrix, matrix @ sp.diags_array(always.astype(float))]).tocsr()
    both.eliminate_zeros()
    return both


def _stretches(
    reduced: ReducedGuideway,
    config: Config,
    of_passage: list[Stretch],
    damping_start: IntArray,
    taken_start: IntArray,
) -> Stretches:
    """Active coordinates of each stretch, and the ends of their rows in the matrices.

    Rows, whole or short, of the damping and of the modes carried by pier tops.
    """
    n = reduced.n_modes
    dt = course(config).time_step
    starts, tops_from, stepped, rows = [0], [], [], []
    factor_rows, factor_start, inverse = [], [0], []
    stilled = []
    before = np.zeros(reduced.n_coordinates, dtype=bool)
    for stretch in of_passage:
        modes = np.flatnonzero(stretch.stepped[:n])
        tops, factor = stepped_mass(reduced, stretch.stepped, dt)
        coordinates = np.concatenate([modes, tops])
        stepped.append(coordinates)
        rows.append(coordinates + np.where(stretch.awake[coordinates], 0, reduced.n_coordinates))
        tops_from.append(starts[-1] + modes.size)
        starts.append(starts[-1] + coordinates.size)
        factor_start += [factor_start[-1]] * modes.size
        inverse.append(np.zeros(modes.size))
        inverse.append(1.0 / np.diagonal(factor))
        for k, row in enumerate(factor):
            met = np.flatnonzero(row[:k])
            factor_rows.append((tops[met], row[met]))
            factor_start.append(factor_start[-1] + met.size)
        stilled.append(np.flatnonzero(before & ~stretch.stepped))
        before = stretch.stepped
    row = np.concatenate(rows)
    top_row = np.maximum(row % reduced.n_coordinates - n, 0)
    top_row += np.where(row >= reduced.n_coordinates, reduced.n_coordinates - n, 0)
    return Stretches(
        first_step=np.array([stretch.first_step for stretch in of_passage]),
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


def _rows(matrix: sp.csr_array) -> tuple[IntArray, IntArray, FloatArray]:
    """Row starts, columns and values of a sparse matrix in order."""
    rows = matrix.tocsr().sorted_indices()
    return rows.indptr.astype(np.int64), rows.indices.astype(np.int64), rows.data


def timing(config: Config, record_every: int) -> Timing:
    passage = config.passage
    way = course(config)
    return Timing(
        first_step=first_moving_step(config.control, way.first_step),
        n_steps=way.n_steps,
        time_step=way.time_step,
        speed=passage.speed,
        start=way.start,
        train_length=config.train.length,
        gap_contact=np.full(LANES, passage.gap_contact),
        gap_lost=np.full(LANES, passage.gap_lost),
        sections=np.ascontiguousarray(acceleration_filter(passage, way.time_step)),
        record_every=record_every,
        comfort=_comfort(config),
    )


def _comfort(config: Config) -> Comfort:
    """Weightings of the cars' accelerations for the kernels."""
    read = readings(config)
    filters = [one.sections(read.every * course(config).time_step) for one in WEIGHTINGS]
    return Comfort(
        every=read.every,
        start=np.cumsum([0, *(len(one) for one in filters)]),
        sections=np.concatenate(filters),
        first=read.first,
        last=read.last,
    )


def empty_outcome(
    train: train_model.TrainModel,
    kinds: tuple[MagnetRows, MagnetRows],
    timing: Timing,
    *,
    with_magnets: bool = True,
) -> Outcome:
    """Results of a row of samples before the first step: those of a train at rest.

    Without the magnets, histories have no room for their gaps and currents.
    """
    n_cars = train.parameters.n_cars
    table = train.magnets
    n_magnets = table.x.size
    n_records = timing.n_steps // timing.record_every if timing.record_every else 0
    gap, current = (
        np.concatenate([np.broadcast_to(one, (1, LANES)) for one in of_kinds])
        for of_kinds in (
            [kind.gap_reference for kind in kinds],
            [kind.current_reference for kind in kinds],
        )
    )
    history = np.zeros((n_records, 4 + 2 * n_cars + 2 * n_magnets * with_magnets, LANES))
    if with_magnets:
        of_kind = table.is_guidance.astype(np.int64)
        history[:, 4 + 2 * n_cars : -n_magnets] = gap[of_kind]
        history[:, -n_magnets:] = current[of_kind]
    return Outcome(
        extreme=np.zeros((5 + 4 * n_cars, LANES)),
        extreme_time=np.zeros((5 + 4 * n_cars, LANES)),
        signed=np.zeros((8, LANES)),
        squares=np.zeros((2 * n_cars * len(WEIGHTINGS), LANES)),
        gap_min=gap.copy(),
        gap_max=gap.copy(),
        current_max=current,
        status=np.zeros(LANES, np.int64),
        lost_time=np.full(LANES, np.nan),
        lost_magnet=np.full(LANES, -1, np.int64),
        at_loss=np.zeros((6, LANES)),
        history=history,
    )
