"""Compiled: the passage of a row of samples, step by step.

Kernels take arrays and floats, write where they are told and check nothing: `integrate` has
checked.  All samples of a row share the train's place, the track and the matrices; only the gains
differ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from maglev.mechanics.lanes import LANES, choose, fma, load, maximum, minimum, store

COMPLETED, CONTACT, GAP_LOST, NOT_FINITE = 0, 1, 2, 3
"""How a passage ended: the values of ``status`` [-]."""


class Vehicle(NamedTuple):
    """Train with open magnets; links in rows of non-zero coefficients."""

    inverse_mass: np.ndarray  # (dof,)
    link_start: np.ndarray  # (link + 1,)
    link_dof: np.ndarray  # (non-zero,)
    link_coefficient: np.ndarray  # (non-zero,)
    link_stiffness: np.ndarray  # (link,)
    link_damping: np.ndarray  # (link,)
    body_z: np.ndarray  # (car,) degree of freedom
    body_y: np.ndarray  # (car,)


class MagnetRows(NamedTuple):
    """Magnets of one kind, right and left at the same place."""

    x: np.ndarray  # (row,) centre relative to the nose [m]
    number: np.ndarray  # (row, side) place in the train's table of magnets
    translation: np.ndarray  # (row, side) degree of freedom
    rotation: np.ndarray  # (row, side)
    static_force: np.ndarray  # (row, side) [N]
    static_moment: np.ndarray  # (row, side) [N m]
    constant: np.ndarray  # (row, side, pole) K of F = K (i/gap)^2 [N m^2/A^2]
    offset: np.ndarray  # (pole,) ahead of the centre [m]
    arm: np.ndarray  # (pole,) displacement of the pole per rotation [m]
    outward: np.ndarray  # (side,) sign of the displacement that opens the gap
    gap_reference: float  # [m]
    current_reference: float  # [A]
    current_max: float  # [A]
    is_guidance: bool


class Line(NamedTuple):
    """Guideway in component coordinates: modes of spans, modes of piers, pier tops."""

    n_spans: int
    span_length: float
    stride: int  # rows of rail coefficients a span
    n_units: int  # units of rail a span, each with as many rows, an even number
    upright_start: np.ndarray  # (span + 1,)
    upright: np.ndarray  # coordinates that move a span's rails up and down
    sideways_start: np.ndarray  # (span + 1,)
    sideways: np.ndarray  # coordinates that roll a span or move it sideways
    rail_z: np.ndarray  # (upright, stride)
    rail_roll: np.ndarray  # (sideways, stride)
    rail_y: np.ndarray  # (sideways, stride)
    n_modes: int
    row_start: np.ndarray  # (coordinate + 1,) stiffness
    column: np.ndarray
    stiffness: np.ndarray
    carried_start: np.ndarray  # (mode + 1,) what modes take along of the pier tops' motion
    carried_column: np.ndarray
    carried: np.ndarray
    damping_start: np.ndarray  # (coordinate + 1,) on relative rates
    damping_column: np.ndarray
    damping: np.ndarray
    response: np.ndarray  # (coordinate,) makes the step exact for a mode on its own [-]
    top_factor: np.ndarray  # (top, band) Cholesky rows of the pier tops' mass, diagonal inverted
    output_column: np.ndarray  # (output column,) coordinates that move midspan
    midspan: np.ndarray  # (2, output column) z and y
    midspan_acceleration: np.ndarray  # (2, output column) the same per stepped acceleration
    middle: int  # span that midspan is of
    rest: np.ndarray  # (3, stride) midspan z by z, y by roll and y of its left-out modes [m/N]


class Places(NamedTuple):
    """What a pole of one kind meets at every place it can be at after a whole number of steps."""

    number: np.ndarray  # (row, pole) place at time zero; each step moves on by one
    base: np.ndarray  # (place,) first of four rail coefficients, -1 off the guideway
    weight: np.ndarray  # (place, 4) of the coefficients in the rail's motion at the pole
    rise: np.ndarray  # (place, 4) of the coefficients in the rate of its motion at the pole [1/s]
    rail: np.ndarray  # (place, side, 1 or LANES) irregularity of all samples, or of each [m]
    ramp: np.ndarray  # (place, side, 1 or LANES) its rate at the pole [m/s]


class Run(NamedTuple):
    """One passage and how it is watched."""

    n_steps: int
    time_step: float
    speed: float
    start: float  # place of the nose at time zero [m]
    train_length: float
    gap_contact: float
    gap_lost: float
    sections: np.ndarray  # (section, 6) low-pass on guideway accelerations
    record_every: int  # steps between recorded rows; zero: none


class Outcome(NamedTuple):
    """What one row of samples leaves behind."""

    extreme: np.ndarray  # (4 + 2 car, LANES) girder z, y, acceleration z, y; bodies' z; bodies' y
    extreme_time: np.ndarray  # same
    gap_min: np.ndarray  # (kind, LANES)
    gap_max: np.ndarray
    current_max: np.ndarray
    status: np.ndarray  # (LANES,) int64
    lost_time: np.ndarray  # (LANES,)
    lost_magnet: np.ndarray  # (LANES,) int64
    history: np.ndarray  # (record, 4 + 2 car + 2 magnet, LANES)


@njit(cache=True, error_model="numpy")
def _gather(source, columns, start, stop, packed):
    """``packed[m] = source[columns[start + m]]``: the product reads rows that follow each other."""
    for m in range(start, stop):
        store(packed, m - start, load(source, columns[m]))


@njit(cache=True, error_model="numpy")
def _transform(matrix, start, stop, packed, left, right, target, first):
    """``target[first + k] = Σ_m matrix[start + m, k] packed[m]`` for ``left`` ≤ k < ``right``.

    Two rows at once fill the registers.
    """
    for k in range(left, right, 2):
        a = load(packed, 0) * 0.0
        b = a
        for m in range(stop - start):
            one = load(packed, m)
            a = fma(one, matrix[start + m, k], a)
            b = fma(one, matrix[start + m, k + 1], b)
        store(target, first + k, a)
        store(target, first + k + 1, b)


@njit(cache=True, error_model="numpy")
def _project(matrix, columns, start, stop, left, right, source, first, target):
    """``target[columns[m]] += Σ_k matrix[m, k] source[first + k]`` for ``left`` ≤ k < ``right``."""
    for m in range(start, stop - 1, 2):
        a = load(target, columns[m])
        b = load(target, columns[m + 1])
        for k in range(left, right):
            one = load(source, first + k)
            a = fma(one, matrix[m, k], a)
            b = fma(one, matrix[m + 1, k], b)
        store(target, columns[m], a)
        store(target, columns[m + 1], b)
    if (stop - start) % 2 == 1:
        a = load(target, columns[stop - 1])
        for k in range(left, right):
            a = fma(load(source, first + k), matrix[stop - 1, k], a)
        store(target, columns[stop - 1], a)


@njit(cache=True, error_model="numpy")
def _magnets(
    places,
    rows,
    step,
    gains,
    x,
    velocity,
    force,
    rail_motion,
    rail_velocity,
    rail_force,
    keep,
    outcome,
    magnet_min,
    magnet_max,
    magnet_gap,
    magnet_current,
):
    """Close all magnets of one kind: gaps, currents, forces on train and rails."""
    base, weight, rise, rail, ramp = (
        places.base,
        places.weight,
        places.rise,
        places.rail,
        places.ramp,
    )
    n_poles = rows.offset.size
    own_track = rail.shape[2] > 1
    kind = 1 if rows.is_guidance else 0
    proportional = load(gains, 2 * kind)
    derivative = load(gains, 2 * kind + 1)
    least = load(outcome.gap_min, kind)
    most = load(outcome.gap_max, kind)
    strongest = load(outcome.current_max, kind)
    at_rest = least * 0.0 + rows.current_reference
    for row in range(rows.x.size):
        for side in range(2):
            field = 2 if kind == 1 else side
            motion, motion_velocity, rail_pull = (
                rail_motion[field],
                rail_velocity[field],
                rail_force[field],
            )
            sign = rows.outward[side]
            translation = rows.translation[row, side]
            rotation = rows.rotation[row, side]
            shift = load(x, translation) * sign
            turn = load(x, rotation) * sign
            shift_velocity = load(velocity, translation) * sign
            turn_velocity = load(velocity, rotation) * sign
            total = shift * 0.0
            moment = total
            smallest = total + 1.0e9
            largest = total - 1.0e9
            gap_sum = total
            current_sum = total
            for p in range(n_poles):
                here = places.number[row, p] + step
                error = fma(turn, rows.arm[p], shift)
                rate = fma(turn_velocity, rows.arm[p], shift_velocity)
                if own_track:
                    error = fma(load(rail, 2 * here + side), -sign, error)
                    rate = fma(load(ramp, 2 * here + side), -sign, rate)
                else:
                    error = error - sign * rail[here, side, 0]
                    rate = rate - sign * ramp[here, side, 0]
                k = base[here]
                if k >= 0:
                    for j in range(4):
                        deflection = load(motion, k + j)
                        error = fma(deflection, -sign * weight[here, j], error)
                        rate = fma(deflection, -sign * rise[here, j], rate)
                        rate = fma(load(motion_velocity, k + j), -sign * weight[here, j], rate)
                gap = error + rows.gap_reference
                current = fma(proportional, error, fma(derivative, rate, at_rest))
                current = maximum(minimum(current, rows.current_max), 0.0)
                ratio = current / gap
                pull = ratio * ratio * rows.constant[row, side, p]
                total = total + pull
                moment = fma(pull, rows.arm[p], moment)
                if k >= 0:
                    for j in range(4):
                        store(
                            rail_pull,
                            k + j,
                            fma(pull, sign * weight[here, j], load(rail_pull, k + j)),
                        )
                smallest = minimum(smallest, gap)
                largest = maximum(largest, gap)
                strongest = maximum(strongest, current)
                if keep:
                    gap_sum = gap_sum + gap
                    current_sum = current_sum + current
            static_moment = rows.static_moment[row, side]
            store(
                force,
                translation,
                load(force, translation) - (total - rows.static_force[row, side]) * sign,
            )
            store(force, rotation, load(force, rotation) - (moment - static_moment) * sign)
            number = rows.number[row, side]
            store(magnet_min, number, smallest)
            store(magnet_max, number, largest)
            if keep:
                store(magnet_gap, number, gap_sum * (1.0 / n_poles))
                store(magnet_current, number, current_sum * (1.0 / n_poles))
            least = minimum(least, smallest)
            most = maximum(most, largest)
    store(outcome.gap_min, kind, least)
    store(outcome.gap_max, kind, most)
    store(outcome.current_max, kind, strongest)


@njit(cache=True, error_model="numpy")
def _links(vehicle, x, velocity, force):
    """Add the forces of springs and dampers to the train."""
    for link in range(vehicle.link_stiffness.size):
        start, stop = vehicle.link_start[link], vehicle.link_start[link + 1]
        stretch = load(x, vehicle.link_dof[start]) * vehicle.link_coefficient[start]
        rate = load(velocity, vehicle.link_dof[start]) * vehicle.link_coefficient[start]
        for k in range(start + 1, stop):
            stretch = fma(load(x, vehicle.link_dof[k]), vehicle.link_coefficient[k], stretch)
            rate = fma(load(velocity, vehicle.link_dof[k]), vehicle.link_coefficient[k], rate)
        pull = stretch * vehicle.link_stiffness[link] + rate * vehicle.link_damping[link]
        for k in range(start, stop):
            dof = vehicle.link_dof[k]
            store(force, dof, load(force, dof) - pull * vehicle.link_coefficient[k])


@njit(cache=True, error_model="numpy")
def _line_acceleration(line, x, velocity, relative, force):
    """Turn the forces on the guideway's coordinates into accelerations, in place."""
    n, n_modes = x.shape[0], line.n_modes
    for i in range(n):
        rate = load(velocity, i)
        if i < n_modes:
            for k in range(line.carried_start[i], line.carried_start[i + 1]):
                rate = fma(load(velocity, line.carried_column[k]), -line.carried[k], rate)
        store(relative, i, rate)
    for i in range(n):
        total = load(force, i)
        for k in range(line.row_start[i], line.row_start[i + 1]):
            total = fma(load(x, line.column[k]), -line.stiffness[k], total)
        drag = total * 0.0
        more = drag
        start, stop = line.damping_start[i], line.damping_start[i + 1]
        for k in range(start, stop - 1, 2):  # two sums: neither waits for the other
            drag = fma(load(relative, line.damping_column[k]), -line.damping[k], drag)
            at = line.damping_column[k + 1]
            more = fma(load(relative, at), -line.damping[k + 1], more)
        if (stop - start) % 2 == 1:
            at = line.damping_column[stop - 1]
            drag = fma(load(relative, at), -line.damping[stop - 1], drag)
        drag = drag + more
        store(force, i, (total + drag) * line.response[i])
        if i < n_modes:
            for k in range(line.carried_start[i], line.carried_start[i + 1]):
                top = line.carried_column[k]
                store(force, top, fma(drag, -line.carried[k], load(force, top)))
    band = line.top_factor.shape[1]
    n_top = n - n_modes
    for i in range(n_top):
        total = load(force, n_modes + i)
        for k in range(1, min(band, i + 1)):
            total = fma(load(force, n_modes + i - k), -line.top_factor[i, k], total)
        store(force, n_modes + i, total * line.top_factor[i, 0])
    for i in range(n_top - 1, -1, -1):
        total = load(force, n_modes + i)
        for k in range(1, min(band, n_top - i)):
            total = fma(load(force, n_modes + i + k), -line.top_factor[i + k, k], total)
        store(force, n_modes + i, total * line.top_factor[i, 0])


@njit(cache=True, error_model="numpy")
def _covered(line, span, tail, nose):
    """Rows of a span's rail coefficients, from and to, of the units that the train is on."""
    per_unit = line.stride // line.n_units
    unit = line.span_length / line.n_units
    start = span * line.span_length
    # A pole may stand a rounding error beyond the ends of the train.
    begin = int(np.floor((tail - start) / unit - 1.0e-6))
    end = int(np.floor((nose - start) / unit + 1.0e-6)) + 1
    return max(0, begin) * per_unit, min(line.n_units, end) * per_unit


@njit(cache=True, error_model="numpy")
def _keep_extreme(outcome, place, value, time):
    size = maximum(value, -1.0 * value)
    best = load(outcome.extreme, place)
    store(outcome.extreme_time, place, choose(size, best, time, load(outcome.extreme_time, place)))
    store(outcome.extreme, place, maximum(size, best))


@njit(cache=True, error_model="numpy")
def _note_lost(run, magnet_min, magnet_max, outcome, time):
    """Name the samples whose levitation is lost at this step; return how many still hold."""
    holding = 0
    for lane in range(LANES):
        if outcome.status[lane] != COMPLETED:
            continue
        for magnet in range(magnet_min.shape[0]):
            low, high = magnet_min[magnet, lane], magnet_max[magnet, lane]
            if low > run.gap_contact and high < run.gap_lost:
                continue
            if low <= run.gap_contact:
                outcome.status[lane] = CONTACT
            elif high >= run.gap_lost:
                outcome.status[lane] = GAP_LOST
            else:
                outcome.status[lane] = NOT_FINITE
            outcome.lost_time[lane] = time
            outcome.lost_magnet[lane] = magnet
            break
        if outcome.status[lane] == COMPLETED:
            holding += 1
    return holding


@njit(cache=True, error_model="numpy", nogil=True)
def passage(
    vehicle, suspension, guidance, suspension_places, guidance_places, line, run, gains, outcome
):
    """Take one row of samples over the guideway.

    Velocity Verlet with a predicted velocity in the forces: second order, one evaluation a step.

    Parameters
    ----------
    vehicle, suspension, guidance, suspension_places, guidance_places, line, run
        The system and the passage.
    gains : (4, LANES)
        Suspension k_p [A/m], k_d [A s/m], guidance k_p, k_d.
    outcome
        Receives the results; extremes start at zero, gaps at the reference.
    """
    n_dof, n_line = vehicle.inverse_mass.size, line.row_start.size - 1
    n_cars = vehicle.body_z.size
    n_magnets = 2 * (suspension.x.size + guidance.x.size)
    dt = run.time_step
    half, half_square, per_square = 0.5 * dt, 0.5 * dt * dt, 1.0 / (dt * dt)
    x = np.zeros((n_dof, LANES))
    velocity = np.zeros((n_dof, LANES))  # at the middle of the step
    predicted = np.zeros((n_dof, LANES))
    force = np.zeros((n_dof, LANES))
    line_x = np.zeros((n_line, LANES))
    line_velocity = np.zeros((n_line, LANES))
    line_predicted = np.zeros((n_line, LANES))
    line_acceleration = np.zeros((n_line, LANES))
    line_relative = np.zeros((n_line, LANES))
    stride = line.stride
    n_rail = line.n_spans * stride
    packed = np.zeros((max(line.upright.size, line.sideways.size), LANES))
    roll = np.zeros((stride, LANES))
    rail_motion = np.zeros((3, n_rail, LANES))  # right z, left z, y
    rail_velocity = np.zeros((3, n_rail, LANES))
    rail_force = np.zeros((3, n_rail, LANES))
    magnet_min = np.zeros((n_magnets, LANES))
    magnet_max = np.zeros((n_magnets, LANES))
    magnet_gap = np.zeros((n_magnets, LANES))
    magnet_current = np.zeros((n_magnets, LANES))
    left_out = np.zeros((4, LANES))  # motion of midspan by left-out modes, its last change; z, y
    n_sections = run.sections.shape[0]
    filtered = np.zeros((4 * n_sections, LANES))
    for step in range(1, run.n_steps + 1):
        time = step * dt
        nose = run.start + run.speed * time
        record = run.record_every > 0 and step % run.record_every == 0
        for i in range(n_dof):
            a = load(force, i) * vehicle.inverse_mass[i]
            v = fma(a, half, load(velocity, i))  # closes the last step
            store(x, i, fma(a, half_square, fma(v, dt, load(x, i))))
            store(predicted, i, fma(a, dt, v))
            store(velocity, i, fma(a, half, v))
            store(force, i, a * 0.0)
        reached = nose >= 0.0  # until then the guideway rests
        for i in range(n_line if reached else 0):
            a = load(line_acceleration, i)
            v = fma(a, half, load(line_velocity, i))
            store(line_x, i, fma(a, half_square, fma(v, dt, load(line_x, i))))
            store(line_predicted, i, fma(a, dt, v))
            store(line_velocity, i, fma(a, half, v))
            store(line_acceleration, i, a * 0.0)
        first = max(0, int(np.floor((nose - run.train_length) / line.span_length)))
        last = min(line.n_spans - 1, int(np.floor(nose / line.span_length)))
        for span in range(first, last + 1):
            at = span * stride
            begin, end = _covered(line, span, nose - run.train_length, nose)
            up, up_end = line.upright_start[span], line.upright_start[span + 1]
            out, out_end = line.sideways_start[span], line.sideways_start[span + 1]
            for quantity in range(2):
                source = line_x if quantity == 0 else line_predicted
                target = rail_motion if quantity == 0 else rail_velocity
                _gather(source, line.upright, up, up_end, packed)
                _transform(line.rail_z, up, up_end, packed, begin, end, target[0], at)
                _gather(source, line.sideways, out, out_end, packed)
                _transform(line.rail_roll, out, out_end, packed, begin, end, roll, 0)
                _transform(line.rail_y, out, out_end, packed, begin, end, target[2], at)
                for k in range(begin, end):
                    mean, turn = load(target[0], at + k), load(roll, k)
                    store(target[0], at + k, mean + turn)
                    store(target[1], at + k, mean - turn)
            for field in range(3):
                for k in range(begin, end):
                    store(rail_force[field], at + k, load(roll, k) * 0.0)
        _links(vehicle, x, predicted, force)
        _magnets(
            suspension_places, suspension, step, gains, x, predicted, force, rail_motion,
            rail_velocity, rail_force, record, outcome, magnet_min, magnet_max, magnet_gap,
            magnet_current,
        )  # fmt: skip
        _magnets(
            guidance_places, guidance, step, gains, x, predicted, force, rail_motion,
            rail_velocity, rail_force, record, outcome, magnet_min, magnet_max, magnet_gap,
            magnet_current,
        )  # fmt: skip
        rest_z = load(left_out, 0) * 0.0
        rest_y = rest_z
        for span in range(first, last + 1):
            at = span * stride
            up, up_end = line.upright_start[span], line.upright_start[span + 1]
            out, out_end = line.sideways_start[span], line.sideways_start[span + 1]
            begin, end = _covered(line, span, nose - run.train_length, nose)
            for k in range(begin, end):
                right, left = load(rail_force[0], at + k), load(rail_force[1], at + k)
                store(rail_force[0], at + k, right + left)
                store(roll, k, right - left)
            force_z, force_y = rail_force[0], rail_force[2]
            out_of = line_acceleration
            _project(line.rail_z, line.upright, up, up_end, begin, end, force_z, at, out_of)
            _project(line.rail_roll, line.sideways, out, out_end, begin, end, roll, 0, out_of)
            _project(line.rail_y, line.sideways, out, out_end, begin, end, force_y, at, out_of)
            if span == line.middle:
                for k in range(begin, end):
                    rest_z = fma(load(force_z, at + k), line.rest[0, k], rest_z)
                    rest_y = fma(load(roll, k), line.rest[1, k], rest_y)
                    rest_y = fma(load(force_y, at + k), line.rest[2, k], rest_y)
        if reached:
            _line_acceleration(line, line_x, line_predicted, line_relative, line_acceleration)
        row = step // run.record_every - 1 if record else 0
        for direction in range(2):
            shift = load(line_x, 0) * 0.0
            raw = shift
            for k in range(line.output_column.size):
                column = line.output_column[k]
                shift = fma(load(line_x, column), line.midspan[direction, k], shift)
                raw = fma(
                    load(line_acceleration, column), line.midspan_acceleration[direction, k], raw
                )
            # What left-out modes add follows the forces at once; its acceleration is that of the
            # step before, which the band does not see.
            rest = rest_z if direction == 0 else rest_y
            last_rest, last_change = (
                load(left_out, 2 * direction),
                load(left_out, 2 * direction + 1),
            )
            change = rest - last_rest
            store(left_out, 2 * direction, rest)
            store(left_out, 2 * direction + 1, change)
            shift = shift + rest
            smooth = fma(change - last_change, per_square, raw)
            for section in range(n_sections):
                b0, b1, b2, _, a1, a2 = run.sections[section]
                at = 2 * (direction * n_sections + section)
                incoming = smooth
                smooth = fma(incoming, b0, load(filtered, at))
                store(filtered, at, fma(incoming, b1, load(filtered, at + 1)) - smooth * a1)
                store(filtered, at + 1, incoming * b2 - smooth * a2)
            _keep_extreme(outcome, direction, shift, time)
            _keep_extreme(outcome, 2 + direction, smooth, time)
            if record:
                store(outcome.history[row], direction, shift)
                store(outcome.history[row], 2 + direction, smooth)
        for car in range(n_cars):
            vertical, lateral = vehicle.body_z[car], vehicle.body_y[car]
            up = load(force, vertical) * vehicle.inverse_mass[vertical]
            across = load(force, lateral) * vehicle.inverse_mass[lateral]
            _keep_extreme(outcome, 4 + car, up, time)
            _keep_extreme(outcome, 4 + n_cars + car, across, time)
            if record:
                store(outcome.history[row], 4 + car, up)
                store(outcome.history[row], 4 + n_cars + car, across)
        if record:
            at = 4 + 2 * n_cars
            for magnet in range(n_magnets):
                store(outcome.history[row], at + magnet, load(magnet_gap, magnet))
                store(outcome.history[row], at + n_magnets + magnet, load(magnet_current, magnet))
        suspicious = False
        for lane in range(LANES):
            low = min(outcome.gap_min[0, lane], outcome.gap_min[1, lane])
            high = max(outcome.gap_max[0, lane], outcome.gap_max[1, lane])
            if not (low > run.gap_contact and high < run.gap_lost):
                suspicious = True
        if suspicious and _note_lost(run, magnet_min, magnet_max, outcome, time) == 0:
            return
