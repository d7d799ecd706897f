"""Compiled: the passage of a row of samples, step by step.

Kernels take arrays and floats, write where they are told and check nothing: `integrate` has
checked.  All samples of a row share the train's place, the track and the matrices; only the gains
differ.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from maglev.mechanics.lanes import (
    LANES,
    WIDE,
    choose,
    entry,
    fma,
    load,
    maximum,
    minimum,
    store,
)

COMPLETED, CONTACT, GAP_LOST, NOT_FINITE = 0, 1, 2, 3
"""How a passage ended: the values of ``status`` [-]."""

CACHE_LINE = 8
"""Doubles in a line of the processor's cache [-]."""


class Vehicle(NamedTuple):
    """Train with open magnets; links in rows and columns of non-zero coefficients.

    Springs and dampers of a kind pull by ``stiffness * x + damping * velocity`` of what they hang
    on; each degree of freedom is scaled so once for every kind of link that it meets.
    """

    inverse_mass: np.ndarray  # (dof,)
    scaled_dof: np.ndarray  # (scaled,) degree of freedom
    scaled_stiffness: np.ndarray  # (scaled,)
    scaled_damping: np.ndarray  # (scaled,)
    link_start: np.ndarray  # (link + 1,) what pulls in a link
    link_scaled: np.ndarray  # (non-zero,)
    link_coefficient: np.ndarray  # (non-zero,)
    pull_start: np.ndarray  # (dof + 1,) the links that pull at a degree of freedom
    pull_link: np.ndarray  # (non-zero,)
    pull_coefficient: np.ndarray  # (non-zero,)
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


class Stages(NamedTuple):
    """What is stepped of the guideway when: stages of a passage, and the rows that they step with.

    Before the first stage the guideway rests.
    """

    first_step: np.ndarray  # (stage,) number of a step
    start: np.ndarray  # (stage + 1,) into ``stepped``
    tops: np.ndarray  # (stage,) where in ``stepped`` pier tops follow modes
    stepped: np.ndarray  # coordinates that are stepped, of all stages
    damping_from: np.ndarray  # (stepped,) row of the line's ``damping``
    damping_to: np.ndarray
    taken_from: np.ndarray  # (stepped,) row of the line's ``taken``
    taken_to: np.ndarray
    factor_start: np.ndarray  # (stepped + 1,) Cholesky rows of the mass of stepped pier tops
    factor_top: np.ndarray  # coordinate
    factor: np.ndarray
    factor_inverse: np.ndarray  # (stepped,) inverse of the diagonal
    stilled_start: np.ndarray  # (stage + 1,) coordinates that the stage before stepped
    stilled: np.ndarray


class Line(NamedTuple):
    """Guideway in component coordinates: modes of spans, modes of piers, pier tops.

    A mode counts from where the pier tops would take it if it were rigid.  While the train is where
    it is, only the coordinates of a stage are stepped; the other modes follow the pier tops.
    """

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
    square: np.ndarray  # (mode,) squared circular frequency [1/s^2]
    response: np.ndarray  # (mode,) makes the step exact for a mode on its own [-]
    carried_start: np.ndarray  # (mode + 1,) what modes take along of the pier tops' motion
    carried_top: np.ndarray  # coordinate
    carried: np.ndarray
    damping_column: np.ndarray  # coordinate, in rows that the stages name
    damping: np.ndarray
    taken_mode: np.ndarray  # the same as carried by pier tops, in rows that the stages name
    taken: np.ndarray
    stiffness_start: np.ndarray  # (top + 1,) between pier tops
    stiffness_top: np.ndarray  # coordinate
    stiffness: np.ndarray
    stages: Stages
    output_column: np.ndarray  # (output column,) coordinates that move midspan
    midspan: np.ndarray  # (2, output column) z and y
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

    first_step: int  # until then the train rests
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
    at_loss: (
        np.ndarray
    )  # (6, LANES) smallest gap, largest gap, largest current of both kinds by then
    history: np.ndarray  # (record, 4 + 2 car + 2 magnet, LANES)


@njit(cache=True, error_model="numpy")
def zeros(n_rows):
    """Rows of zeros ``(n_rows, LANES)`` that begin where a line of the processor's cache does.

    Elsewhere each register of a row is read from two lines, at twice the cost.
    """
    whole = np.zeros(n_rows * LANES + CACHE_LINE)
    start = -(whole.ctypes.data // 8) % CACHE_LINE
    return whole[start : start + n_rows * LANES].reshape((n_rows, LANES))


@njit(cache=True, error_model="numpy")
def _advance_train(vehicle, dt, x, velocity, before, predicted, force):
    """Close the last step of the train and open the next.

    Velocities are those half-way between steps; ``before`` holds the acceleration of the step
    before, from which and the last one the velocity is predicted that the forces see.
    """
    half = 0.5 * dt
    for i in range(vehicle.inverse_mass.size):
        a = load(force, i) * entry(vehicle.inverse_mass, i)
        v = fma(a, dt, load(velocity, i))
        store(x, i, fma(v, dt, load(x, i)))
        store(predicted, i, fma(load(before, i), -half, fma(a, dt, v)))
        store(velocity, i, v)
        store(before, i, a)


@njit(cache=True, error_model="numpy")
def _sum(coefficients, places, start, stop, source, total):
    """``total + Σ_k coefficients[k] source[places[k]]`` for ``start`` ≤ k < ``stop``."""
    for k in range(start, stop):
        total = fma(load(source, entry(places, k)), entry(coefficients, k), total)
    return total


@njit(cache=True, error_model="numpy")
def _links(vehicle, x, velocity, scaled, pull, force):
    """Put the forces of springs and dampers on the train."""
    for k in range(vehicle.scaled_dof.size):
        i = entry(vehicle.scaled_dof, k)
        along = load(x, i) * entry(vehicle.scaled_stiffness, k)
        store(scaled, k, fma(load(velocity, i), entry(vehicle.scaled_damping, k), along))
    coefficient, start = vehicle.link_coefficient, vehicle.link_start
    none = load(x, 0) * 0.0
    for i in range(start.size - 1):
        first, last = entry(start, i), entry(start, i + 1)
        store(pull, i, _sum(coefficient, vehicle.link_scaled, first, last, scaled, none))
    coefficient, start = vehicle.pull_coefficient, vehicle.pull_start
    for i in range(start.size - 1):
        first, last = entry(start, i), entry(start, i + 1)
        total = _sum(coefficient, vehicle.pull_link, first, last, pull, none)
        store(force, i, none - total)


@njit(cache=True, error_model="numpy")
def _gather(source, columns, start, stop, packed, first):
    """``packed[first + m] = source[columns[start + m]]``: products then read rows in a row."""
    for m in range(start, stop):
        store(packed, first + m - start, load(source, entry(columns, m)))


@njit(cache=True, error_model="numpy")
def _transform(matrix, start, stop, packed, at, left, right, target, first):
    """``target[first + k] = Σ_m matrix[start + m, k] packed[at + m]`` for ``left`` ≤ k < ``right``.

    As many rows at once as there are registers; the order of a sum does not depend on it.
    """
    none = load(packed, at) * 0.0
    width = matrix.shape[1]
    k = left
    while WIDE and k + 4 <= right:
        a, b, c, d = none, none, none, none
        place = start * width + k
        for m in range(at, at + stop - start):
            one = load(packed, m)
            a = fma(one, entry(matrix, place), a)
            b = fma(one, entry(matrix, place + 1), b)
            c = fma(one, entry(matrix, place + 2), c)
            d = fma(one, entry(matrix, place + 3), d)
            place += width
        store(target, first + k, a)
        store(target, first + k + 1, b)
        store(target, first + k + 2, c)
        store(target, first + k + 3, d)
        k += 4
    while k < right:
        a, b = none, none
        place = start * width + k
        for m in range(at, at + stop - start):
            one = load(packed, m)
            a = fma(one, entry(matrix, place), a)
            b = fma(one, entry(matrix, place + 1), b)
            place += width
        store(target, first + k, a)
        store(target, first + k + 1, b)
        k += 2


@njit(cache=True, error_model="numpy")
def _transform_both(
    mean, up, up_end, turn, out, out_end, packed, left, right, right_rail, left_rail, first
):
    """Motion of both rails from that of their mean and the roll, each as by `_transform`.

    ``packed`` holds what moves the mean, then what rolls it.
    """
    n = up_end - up
    none = load(packed, 0) * 0.0
    width = mean.shape[1]
    k = left
    while WIDE and k + 4 <= right:
        a, b, c, d = none, none, none, none
        e, f, g, h = none, none, none, none
        place = up * width + k
        for m in range(n):
            one = load(packed, m)
            a = fma(one, entry(mean, place), a)
            b = fma(one, entry(mean, place + 1), b)
            c = fma(one, entry(mean, place + 2), c)
            d = fma(one, entry(mean, place + 3), d)
            place += width
        place = out * width + k
        for m in range(n, n + out_end - out):
            one = load(packed, m)
            e = fma(one, entry(turn, place), e)
            f = fma(one, entry(turn, place + 1), f)
            g = fma(one, entry(turn, place + 2), g)
            h = fma(one, entry(turn, place + 3), h)
            place += width
        store(right_rail, first + k, a + e)
        store(left_rail, first + k, a - e)
        store(right_rail, first + k + 1, b + f)
        store(left_rail, first + k + 1, b - f)
        store(right_rail, first + k + 2, c + g)
        store(left_rail, first + k + 2, c - g)
        store(right_rail, first + k + 3, d + h)
        store(left_rail, first + k + 3, d - h)
        k += 4
    while k < right:
        a, b, e, f = none, none, none, none
        place = up * width + k
        for m in range(n):
            one = load(packed, m)
            a = fma(one, entry(mean, place), a)
            b = fma(one, entry(mean, place + 1), b)
            place += width
        place = out * width + k
        for m in range(n, n + out_end - out):
            one = load(packed, m)
            e = fma(one, entry(turn, place), e)
            f = fma(one, entry(turn, place + 1), f)
            place += width
        store(right_rail, first + k, a + e)
        store(left_rail, first + k, a - e)
        store(right_rail, first + k + 1, b + f)
        store(left_rail, first + k + 1, b - f)
        k += 2


@njit(cache=True, error_model="numpy")
def _project(matrix, columns, start, stop, left, right, source, first, target):
    """``target[columns[m]] += Σ_k matrix[m, k] source[first + k]`` for ``left`` ≤ k < ``right``."""
    width = matrix.shape[1]
    m = start
    while WIDE and m + 4 <= stop:
        a, b = load(target, entry(columns, m)), load(target, entry(columns, m + 1))
        c, d = load(target, entry(columns, m + 2)), load(target, entry(columns, m + 3))
        place = m * width
        for k in range(left, right):
            one = load(source, first + k)
            a = fma(one, entry(matrix, place + k), a)
            b = fma(one, entry(matrix, place + width + k), b)
            c = fma(one, entry(matrix, place + 2 * width + k), c)
            d = fma(one, entry(matrix, place + 3 * width + k), d)
        store(target, entry(columns, m), a)
        store(target, entry(columns, m + 1), b)
        store(target, entry(columns, m + 2), c)
        store(target, entry(columns, m + 3), d)
        m += 4
    while m + 2 <= stop:
        a, b = load(target, entry(columns, m)), load(target, entry(columns, m + 1))
        place = m * width
        for k in range(left, right):
            one = load(source, first + k)
            a = fma(one, entry(matrix, place + k), a)
            b = fma(one, entry(matrix, place + width + k), b)
        store(target, entry(columns, m), a)
        store(target, entry(columns, m + 1), b)
        m += 2
    if m < stop:
        a = load(target, entry(columns, m))
        for k in range(left, right):
            a = fma(load(source, first + k), entry(matrix, m * width + k), a)
        store(target, entry(columns, m), a)


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
    n_poles = rows.offset.size
    own_track = places.rail.shape[2] > 1
    kind = 1 if rows.is_guidance else 0
    least = load(outcome.gap_min, kind)
    most = load(outcome.gap_max, kind)
    strongest = load(outcome.current_max, kind)
    none = least * 0.0
    at_rest = none + rows.current_reference
    for row in range(rows.x.size):
        for side in range(2):
            field = 2 if kind == 1 else side
            motion, motion_velocity, rail_pull = (
                rail_motion[field],
                rail_velocity[field],
                rail_force[field],
            )
            sign = rows.outward[side]
            proportional = load(gains, 2 * kind) * sign
            derivative = load(gains, 2 * kind + 1) * sign
            translation = rows.translation[row, side]
            rotation = rows.rotation[row, side]
            shift, turn = load(x, translation), load(x, rotation)
            shift_velocity, turn_velocity = load(velocity, translation), load(velocity, rotation)
            total, moment = none, none
            smallest, largest = none + 1.0e9, none - 1.0e9
            gap_sum, current_sum = none, none
            for p in range(n_poles):
                here = entry(places.number, row * n_poles + p) + step
                arm = entry(rows.arm, p)
                if own_track:
                    rail = load(places.rail, 2 * here + side)
                    rise = load(places.ramp, 2 * here + side)
                else:
                    rail = none + entry(places.rail, 2 * here + side)
                    rise = none + entry(places.ramp, 2 * here + side)
                k = entry(places.base, here)
                if k >= 0:
                    for j in range(4):
                        weight = entry(places.weight, 4 * here + j)
                        deflection = load(motion, k + j)
                        rail = fma(deflection, weight, rail)
                        rise = fma(deflection, entry(places.rise, 4 * here + j), rise)
                        rise = fma(load(motion_velocity, k + j), weight, rise)
                error = fma(turn, arm, shift) - rail
                rate = fma(turn_velocity, arm, shift_velocity) - rise
                gap = fma(error, sign, none + rows.gap_reference)
                current = fma(proportional, error, fma(derivative, rate, at_rest))
                current = maximum(minimum(current, rows.current_max), 0.0)
                ratio = current / gap
                constant = entry(rows.constant, (2 * row + side) * n_poles + p)
                pull = ratio * ratio * (sign * constant)
                total = total + pull
                moment = fma(pull, arm, moment)
                if k >= 0:
                    for j in range(4):
                        weight = entry(places.weight, 4 * here + j)
                        store(rail_pull, k + j, fma(pull, weight, load(rail_pull, k + j)))
                smallest = minimum(smallest, gap)
                largest = maximum(largest, gap)
                strongest = maximum(strongest, current)
                if keep:
                    gap_sum = gap_sum + gap
                    current_sum = current_sum + current
            static_force = rows.static_force[row, side] * sign
            static_moment = rows.static_moment[row, side] * sign
            store(force, translation, load(force, translation) - (total - static_force))
            store(force, rotation, load(force, rotation) - (moment - static_moment))
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
def _move_rails(line, span, begin, end, source, packed, motion):
    """Motion (or its rate) of a span's rails from the relative motion of the coordinates."""
    at = span * line.stride
    up, up_end = line.upright_start[span], line.upright_start[span + 1]
    out, out_end = line.sideways_start[span], line.sideways_start[span + 1]
    _gather(source, line.upright, up, up_end, packed, 0)
    _gather(source, line.sideways, out, out_end, packed, up_end - up)
    _transform_both(
        line.rail_z, up, up_end, line.rail_roll, out, out_end, packed, begin, end,
        motion[0], motion[1], at,
    )  # fmt: skip
    _transform(line.rail_y, out, out_end, packed, up_end - up, begin, end, motion[2], at)


@njit(cache=True, error_model="numpy")
def _load_line(line, span, begin, end, rail_force, turn, force):
    """Add the forces on a span's rails to the coordinates that move them.

    Leaves the sum of right and left in ``rail_force[0]`` and the difference in ``turn``.
    """
    at = span * line.stride
    up, up_end = line.upright_start[span], line.upright_start[span + 1]
    out, out_end = line.sideways_start[span], line.sideways_start[span + 1]
    for k in range(begin, end):
        right, left = load(rail_force[0], at + k), load(rail_force[1], at + k)
        store(rail_force[0], at + k, right + left)
        store(turn, k, right - left)
    _project(line.rail_z, line.upright, up, up_end, begin, end, rail_force[0], at, force)
    _project(line.rail_roll, line.sideways, out, out_end, begin, end, turn, 0, force)
    _project(line.rail_y, line.sideways, out, out_end, begin, end, rail_force[2], at, force)


@njit(cache=True, error_model="numpy")
def _still(stages, stage, x, velocity, before, acceleration, rate):
    """Leave the coordinates alone that are no longer stepped: modes at rest."""
    for k in range(stages.stilled_start[stage], stages.stilled_start[stage + 1]):
        i = stages.stilled[k]
        store(x, i, 0.0)
        store(velocity, i, 0.0)
        store(before, i, 0.0)
        store(acceleration, i, 0.0)
        store(rate, i, 0.0)


@njit(cache=True, error_model="numpy")
def _advance_line(stages, stage, dt, x, velocity, before, acceleration, rate):
    """As `_advance_train` for what is stepped of the guideway; leaves no accelerations."""
    half = 0.5 * dt
    for n in range(stages.start[stage], stages.start[stage + 1]):
        i = entry(stages.stepped, n)
        a = load(acceleration, i)
        v = fma(a, dt, load(velocity, i))
        store(x, i, fma(v, dt, load(x, i)))
        store(rate, i, fma(load(before, i), -half, fma(a, dt, v)))
        store(velocity, i, v)
        store(before, i, a)
        store(acceleration, i, 0.0)


@njit(cache=True, error_model="numpy")
def _line_acceleration(line, stage, x, velocity, force):
    """Turn the forces on the coordinates that are stepped into accelerations, in place."""
    n_modes, stages = line.square.size, line.stages
    start, tops, stop = stages.start[stage], stages.tops[stage], stages.start[stage + 1]
    none = load(force, 0) * 0.0
    damping, column = line.damping, line.damping_column
    for n in range(start, stop):
        i = entry(stages.stepped, n)
        if n < tops:
            back = load(x, i) * entry(line.square, i)
        else:  # modes come first
            first, last = entry(stages.taken_from, n), entry(stages.taken_to, n)
            back = _sum(line.taken, line.taken_mode, first, last, force, none)
            first = entry(line.stiffness_start, i - n_modes)
            last = entry(line.stiffness_start, i - n_modes + 1)
            back = _sum(line.stiffness, line.stiffness_top, first, last, x, back)
        drag = none
        first, last = entry(stages.damping_from, n), entry(stages.damping_to, n)
        for k in range(first, last - 1, 2):  # two sums: neither waits for the other
            drag = fma(load(velocity, entry(column, k)), entry(damping, k), drag)
            back = fma(load(velocity, entry(column, k + 1)), entry(damping, k + 1), back)
        if (last - first) % 2 == 1:
            drag = fma(load(velocity, entry(column, last - 1)), entry(damping, last - 1), drag)
        store(force, i, load(force, i) - (back + drag))
    for n in range(tops, stop):
        i = entry(stages.stepped, n)
        first, last = entry(stages.factor_start, n), entry(stages.factor_start, n + 1)
        total = load(force, i) - _sum(stages.factor, stages.factor_top, first, last, force, none)
        store(force, i, total * entry(stages.factor_inverse, n))
    for n in range(stop - 1, tops - 1, -1):
        i = entry(stages.stepped, n)
        total = load(force, i) * entry(stages.factor_inverse, n)
        store(force, i, total)
        for k in range(entry(stages.factor_start, n), entry(stages.factor_start, n + 1)):
            at = entry(stages.factor_top, k)
            store(force, at, load(force, at) - total * entry(stages.factor, k))
    for n in range(start, tops):
        i = entry(stages.stepped, n)
        first, last = entry(line.carried_start, i), entry(line.carried_start, i + 1)
        along = _sum(line.carried, line.carried_top, first, last, force, none)
        store(force, i, (load(force, i) - along) * entry(line.response, i))


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
def _keep_peak(outcome, recent, place, value, time, dt):
    """Keep the size of a motion's largest peak, and when it was.

    A peak is the vertex of the parabola through three values in a row, of which the middle one is
    the largest; the values themselves miss it by up to (ωΔt)²/8 of its size.
    """
    before, middle = load(recent, 2 * place), load(recent, 2 * place + 1)
    rise = value - before
    # twice the way back from the middle to the vertex [steps]; beyond 1 another value is nearer
    back = rise / (value - middle - middle + before)
    back = choose(1.0, maximum(back, -1.0 * back), back, 0.0)
    _keep_extreme(
        outcome, place, fma(rise * back, -0.125, middle), back * (-0.5 * dt) + (time - dt)
    )
    _keep_extreme(outcome, place, value, time)  # the last of all has none behind it
    store(recent, 2 * place, middle)
    store(recent, 2 * place + 1, value)


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
            for kind in range(2):
                outcome.at_loss[kind, lane] = outcome.gap_min[kind, lane]
                outcome.at_loss[2 + kind, lane] = outcome.gap_max[kind, lane]
                outcome.at_loss[4 + kind, lane] = outcome.current_max[kind, lane]
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
    n_dof, n_modes = vehicle.inverse_mass.size, line.square.size
    n_line = n_modes + line.stiffness_start.size - 1
    n_cars = vehicle.body_z.size
    n_magnets = 2 * (suspension.x.size + guidance.x.size)
    dt = run.time_step
    per_square = 1.0 / (dt * dt)
    x = zeros(n_dof)
    velocity = zeros(n_dof)  # at the middle of the step
    before = zeros(n_dof)  # acceleration of the step before
    predicted = zeros(n_dof)
    force = zeros(n_dof)
    scaled = zeros(vehicle.scaled_dof.size)
    pull = zeros(vehicle.link_start.size - 1)
    line_x = zeros(n_line)
    line_velocity = zeros(n_line)
    line_before = zeros(n_line)
    line_acceleration = zeros(n_line)
    line_rate = zeros(n_line)
    stride = line.stride
    n_rail = line.n_spans * stride
    packed = zeros(line.upright.size + line.sideways.size)
    turn = zeros(stride)
    rail_motion = zeros(3 * n_rail).reshape((3, n_rail, LANES))  # right z, left z, y
    rail_velocity = zeros(3 * n_rail).reshape((3, n_rail, LANES))
    rail_force = zeros(3 * n_rail).reshape((3, n_rail, LANES))
    magnet_min = zeros(n_magnets)
    magnet_max = zeros(n_magnets)
    magnet_gap = zeros(n_magnets)
    magnet_current = zeros(n_magnets)
    # of midspan: motion by left-out modes, its last change, acceleration by the others; z, y
    left_out = zeros(6)
    n_sections = run.sections.shape[0]
    filtered = zeros(4 * n_sections)
    recent = zeros(2 * outcome.extreme.shape[0])  # last two values of each response
    stage = -1
    for step in range(run.first_step, run.n_steps + 1):
        time = step * dt
        nose = run.start + run.speed * time
        tail = nose - run.train_length
        record = run.record_every > 0 and step % run.record_every == 0
        _advance_train(vehicle, dt, x, velocity, before, predicted, force)
        while stage + 1 < line.stages.first_step.size and step >= line.stages.first_step[stage + 1]:
            stage += 1
            _still(
                line.stages, stage, line_x, line_velocity, line_before, line_acceleration, line_rate
            )
        if stage >= 0:
            _advance_line(
                line.stages,
                stage,
                dt,
                line_x,
                line_velocity,
                line_before,
                line_acceleration,
                line_rate,
            )
        first = max(0, int(np.floor(tail / line.span_length)))
        last = min(line.n_spans - 1, int(np.floor(nose / line.span_length)))
        for span in range(first, last + 1):
            at = span * stride
            begin, end = _covered(line, span, tail, nose)
            _move_rails(line, span, begin, end, line_x, packed, rail_motion)
            _move_rails(line, span, begin, end, line_rate, packed, rail_velocity)
            for field in range(3):
                for k in range(begin, end):
                    store(rail_force[field], at + k, 0.0)
        _links(vehicle, x, predicted, scaled, pull, force)
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
            begin, end = _covered(line, span, tail, nose)
            _load_line(line, span, begin, end, rail_force, turn, line_acceleration)
            if span == line.middle:
                at = span * stride
                for k in range(begin, end):
                    rest_z = fma(load(rail_force[0], at + k), line.rest[0, k], rest_z)
                    rest_y = fma(load(turn, k), line.rest[1, k], rest_y)
                    rest_y = fma(load(rail_force[2], at + k), line.rest[2, k], rest_y)
        if stage >= 0:
            _line_acceleration(line, stage, line_x, line_rate, line_acceleration)
        row = step // run.record_every - 1 if record else 0
        # girder accelerations come a step late, and the last of all is that of the step before
        late = run.record_every > 0 and step > run.record_every
        late = late and (step - 1) % run.record_every == 0
        row_before = (step - 1) // run.record_every - 1 if late else 0
        for direction in range(2):
            shift = load(line_x, 0) * 0.0
            raw = shift
            n_columns = line.output_column.size
            for k in range(n_columns):
                column = entry(line.output_column, k)
                share = entry(line.midspan, direction * n_columns + k)
                shift = fma(load(line_x, column), share, shift)
                raw = fma(load(line_acceleration, column), share, raw)
            # What left-out modes add follows the forces at once; its acceleration, a second
            # difference, is that of the step before, and so is what it joins.
            rest = rest_z if direction == 0 else rest_y
            change = rest - load(left_out, 3 * direction)
            bend = change - load(left_out, 3 * direction + 1)
            shift = shift + rest
            smooth = fma(bend, per_square, load(left_out, 3 * direction + 2))
            store(left_out, 3 * direction, rest)
            store(left_out, 3 * direction + 1, change)
            store(left_out, 3 * direction + 2, raw)
            for section in range(n_sections):
                b0, b1, b2, _, a1, a2 = run.sections[section]
                at = 2 * (direction * n_sections + section)
                incoming = smooth
                smooth = fma(incoming, b0, load(filtered, at))
                store(filtered, at, fma(incoming, b1, load(filtered, at + 1)) - smooth * a1)
                store(filtered, at + 1, incoming * b2 - smooth * a2)
            _keep_peak(outcome, recent, direction, shift, time, dt)
            _keep_peak(outcome, recent, 2 + direction, smooth, time - dt, dt)
            if record:
                store(outcome.history[row], direction, shift)
                store(outcome.history[row], 2 + direction, smooth)
            if late:
                store(outcome.history[row_before], 2 + direction, smooth)
        for car in range(n_cars):
            vertical, lateral = vehicle.body_z[car], vehicle.body_y[car]
            up = load(force, vertical) * vehicle.inverse_mass[vertical]
            across = load(force, lateral) * vehicle.inverse_mass[lateral]
            _keep_peak(outcome, recent, 4 + car, up, time, dt)
            _keep_peak(outcome, recent, 4 + n_cars + car, across, time, dt)
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
