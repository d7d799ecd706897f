"""Compiled: the passage of a row of samples, step by step.

Kernels take arrays and floats, write where they are told and check nothing: `integrate` has
checked.  All samples of a row share the train's place and what tables of the run stand on; the
gains differ, the track may, and so may the train (`maglev.mechanics.lanes.own`).
"""

from __future__ import annotations

import numpy as np

from maglev.compiled import kernel
from maglev.mechanics._comfort import empty_weighing, weigh
from maglev.mechanics._magnets import attract, circuits_at_rest, empty_magnet
from maglev.mechanics._records import (
    COMPLETED,
    CONTACT,
    GAP_LOST,
    NOT_FINITE,
    Motion,
    Rails,
    Watch,
)
from maglev.mechanics._rows import (
    add_terms,
    change,
    change_back,
    gather,
    own_sum,
    project,
    transform,
    transform_both,
    weighted_sum,
    zeros,
)
from maglev.mechanics.lanes import (
    LANES,
    choose,
    entry,
    fma,
    has_rows,
    load,
    maximum,
    own,
    own_of,
    store,
)


@kernel()
def at_rest(n_dof):
    """Motion record of degrees of freedom at rest."""
    return Motion(zeros(n_dof), zeros(n_dof), zeros(n_dof), zeros(n_dof), zeros(n_dof))


@kernel()
def _straight_rails(spans):
    """Record of straight, unloaded rails."""
    n = spans.n_spans * spans.stride
    shape = (3, n, LANES)
    return Rails(
        zeros(3 * n).reshape(shape), zeros(3 * n).reshape(shape), zeros(3 * n).reshape(shape)
    )


@kernel()
def _new_watch(n_magnets, n_sections, n_responses):
    """Empty memory of the watched responses."""
    return Watch(
        zeros(6),
        zeros(4),
        zeros(4 * n_sections),
        zeros(2 * n_responses),
        zeros(n_magnets),
        zeros(n_magnets),
        zeros(n_magnets),
        zeros(n_magnets),
    )


@kernel()
def _advance_train(vehicle, dt, train):
    """Finish the train's last velocity step and take its next displacement step.

    The velocity that the forces see is predicted from the last two accelerations.
    """
    half = 0.5 * dt
    for i in range(train.force.shape[0]):
        a = load(train.force, i) * own_of(vehicle.inverse_mass, vehicle.mass_number, i)
        v = fma(a, dt, load(train.velocity, i))
        store(train.position, i, fma(v, dt, load(train.position, i)))
        store(train.predicted, i, fma(load(train.before, i), -half, fma(a, dt, v)))
        store(train.velocity, i, v)
        store(train.before, i, a)


@kernel()
def _links(vehicle, train, scaled, pull):
    """Set the train's forces to those of its springs and dampers."""
    for k in range(vehicle.scaled_dof.size):
        i = entry(vehicle.scaled_dof, k)
        stiffness = own_of(vehicle.scaled_stiffness, vehicle.stiffness_number, k)
        along = load(train.position, i) * stiffness
        rate = load(train.predicted, i)
        damping = own_of(vehicle.scaled_damping, vehicle.damping_number, k)
        store(scaled, k, fma(rate, damping, along))
    coefficient, start = vehicle.link_coefficient, vehicle.link_start
    none = load(train.position, 0) * 0.0
    for i in range(start.size - 1):
        first, last = entry(start, i), entry(start, i + 1)
        total = weighted_sum(coefficient, vehicle.link_scaled, first, last, scaled, none)
        store(pull, i, total)
    add_terms(vehicle.own_link, 1.0, scaled, pull)
    coefficient, start = vehicle.pull_coefficient, vehicle.pull_start
    for i in range(start.size - 1):
        first, last = entry(start, i), entry(start, i + 1)
        total = weighted_sum(coefficient, vehicle.pull_link, first, last, pull, none)
        store(train.force, i, none - total)
    add_terms(vehicle.own_pull, -1.0, pull, train.force)


@kernel()
def _move_span(spans, span, begin, end, source, packed, motion):
    """Compute the motion of a span's rails, or its rate, from the relative coordinates."""
    at = span * spans.stride
    up, up_end = spans.upright_start[span], spans.upright_start[span + 1]
    out, out_end = spans.sideways_start[span], spans.sideways_start[span + 1]
    gather(source, spans.upright, up, up_end, packed, 0)
    gather(source, spans.sideways, out, out_end, packed, up_end - up)
    if has_rows(spans.change):
        n, m = spans.rail_z.shape[0], spans.rail_y.shape[0]
        changed, place = up_end - up + out_end - out, spans.change_start[span]
        change(spans.change, place, n, up_end - up, packed, 0, packed, changed)
        place += n * (up_end - up)
        change(
            spans.change, place, m, out_end - out, packed, up_end - up, packed, changed + n
        )  # fmt: skip
        gather(packed, spans.in_order, changed, changed + n + m, packed, 0)
        up, up_end, out, out_end = 0, n, 0, m
    transform_both(
        spans.rail_z, up, up_end, spans.rail_roll, out, out_end, packed, begin, end,
        motion[0], motion[1], at,
    )  # fmt: skip
    transform(spans.rail_y, out, out_end, packed, up_end - up, begin, end, motion[2], at)


@kernel()
def _move_rails(spans, first, last, tail, nose, guideway, packed, rails):
    """Compute motion and rate of the rails under the train, and clear the forces on them."""
    for span in range(first, last + 1):
        begin, end = _covered(spans, span, tail, nose)
        _move_span(spans, span, begin, end, guideway.position, packed, rails.motion)
        _move_span(spans, span, begin, end, guideway.predicted, packed, rails.rate)
        at = span * spans.stride
        for field in range(3):
            for k in range(begin, end):
                store(rails.force[field], at + k, 0.0)


@kernel()
def _load_span(spans, span, begin, end, rails, turn, packed, force):
    """Add the forces on a span's rails to the forces on its coordinates.

    Leaves the sum of right and left in ``rails.force[0]`` and the difference in ``turn``.
    """
    at = span * spans.stride
    up, up_end = spans.upright_start[span], spans.upright_start[span + 1]
    out, out_end = spans.sideways_start[span], spans.sideways_start[span + 1]
    for k in range(begin, end):
        right, left = load(rails.force[0], at + k), load(rails.force[1], at + k)
        store(rails.force[0], at + k, right + left)
        store(turn, k, right - left)
    if has_rows(spans.change):
        n, m = spans.rail_z.shape[0], spans.rail_y.shape[0]
        for k in range(n + m):
            store(packed, k, 0.0)
        order, of_y = spans.in_order, packed[n:]
        project(spans.rail_z, order, 0, n, begin, end, rails.force[0], at, packed)
        project(spans.rail_roll, order, 0, m, begin, end, turn, 0, of_y)
        project(spans.rail_y, order, 0, m, begin, end, rails.force[2], at, of_y)
        place = spans.change_start[span]
        change_back(spans.change, place, n, up_end - up, packed, 0, spans.upright, up, force)
        place += n * (up_end - up)
        change_back(spans.change, place, m, out_end - out, packed, n, spans.sideways, out, force)
        return
    project(spans.rail_z, spans.upright, up, up_end, begin, end, rails.force[0], at, force)
    project(spans.rail_roll, spans.sideways, out, out_end, begin, end, turn, 0, force)
    project(spans.rail_y, spans.sideways, out, out_end, begin, end, rails.force[2], at, force)


@kernel()
def _left_out_at_bearings(spans, begin, end, force, turn, across, at, watch):
    """Opening of the middle span's bearings by its left-out modes."""
    none = load(watch.bearing, 0) * 0.0
    for side in range(2):
        mean, half = none, none
        for k in range(begin, end):
            mean = fma(
                load(force, at + k), own(spans.bearing_rest, 3 * side * spans.stride + k), mean
            )
            half = fma(
                load(turn, k), own(spans.bearing_rest, (3 * side + 1) * spans.stride + k), half
            )
            half = fma(
                load(across, at + k),
                own(spans.bearing_rest, (3 * side + 2) * spans.stride + k),
                half,
            )
        store(watch.bearing, 2 * side, mean)
        store(watch.bearing, 2 * side + 1, half)


@kernel()
def _load_guideway(spans, first, last, tail, nose, rails, turn, packed, guideway, watch):
    """Transfer the forces on the rails under the train to the guideway's coordinates.

    Returns the midspan displacement, z and y, that these forces cause in the left-out modes.
    """
    rest_z = load(guideway.position, 0) * 0.0
    rest_y = rest_z
    for k in range(4):
        store(watch.bearing, k, 0.0)
    for span in range(first, last + 1):
        begin, end = _covered(spans, span, tail, nose)
        _load_span(spans, span, begin, end, rails, turn, packed, guideway.force)
        if span == spans.middle:
            at = span * spans.stride
            for k in range(begin, end):
                roll, y = spans.stride + k, 2 * spans.stride + k
                rest_z = fma(load(rails.force[0], at + k), own(spans.rest, k), rest_z)
                rest_y = fma(load(turn, k), own(spans.rest, roll), rest_y)
                rest_y = fma(load(rails.force[2], at + k), own(spans.rest, y), rest_y)
            _left_out_at_bearings(
                spans, begin, end, rails.force[0], turn, rails.force[2], at, watch
            )
    return rest_z, rest_y


@kernel()
def _still(stretches, stretch, rates, guideway):
    """Bring the coordinates that a new stretch no longer steps to rest."""
    for k in range(stretches.stilled_start[stretch], stretches.stilled_start[stretch + 1]):
        i = stretches.stilled[k]
        store(rates, i, 0.0)
        for state in guideway:
            store(state, i, 0.0)


@kernel()
def _advance_guideway(stretches, stretch, dt, guideway):
    """Advance the stepped coordinates of the guideway as `_advance_train`; clear their forces."""
    half = 0.5 * dt
    for n in range(stretches.start[stretch], stretches.start[stretch + 1]):
        i = entry(stretches.stepped, n)
        a = load(guideway.force, i)
        v = fma(a, dt, load(guideway.velocity, i))
        store(guideway.position, i, fma(v, dt, load(guideway.position, i)))
        store(guideway.predicted, i, fma(load(guideway.before, i), -half, fma(a, dt, v)))
        store(guideway.velocity, i, v)
        store(guideway.before, i, a)
        store(guideway.force, i, 0.0)


@kernel()
def _answer(spans, stretch, scaled, guideway):
    """Turn the forces on the stepped coordinates into accelerations, in place."""
    x, velocity, force = guideway.position, guideway.predicted, guideway.force
    n_modes, stretches = spans.carried_start.size - 1, spans.stretches
    start, tops, stop = (
        stretches.start[stretch],
        stretches.tops[stretch],
        stretches.start[stretch + 1],
    )
    none = load(force, 0) * 0.0
    damping, column = spans.damping, spans.damping_column
    if has_rows(spans.damping_root):
        velocity = scaled
        for n in range(start, stop):
            i = entry(stretches.stepped, n)
            root = own_of(spans.damping_root, spans.root_number, i)
            store(scaled, i, load(guideway.predicted, i) * root)
    for n in range(start, stop):
        i = entry(stretches.stepped, n)
        if n < tops:
            back = load(x, i) * own_of(spans.square, spans.mode_number, i)
        else:  # modes come first
            first, last = entry(stretches.taken_from, n), entry(stretches.taken_to, n)
            number = spans.taken_number
            back = own_sum(spans.taken, number, spans.taken_mode, first, last, force, none)
            first = entry(spans.stiffness_start, i - n_modes)
            last = entry(spans.stiffness_start, i - n_modes + 1)
            number = spans.stiffness_number
            back = own_sum(spans.stiffness, number, spans.stiffness_top, first, last, x, back)
        elastic = back
        if has_rows(spans.damping_root):
            back = none
        drag = none
        first, last = entry(stretches.damping_from, n), entry(stretches.damping_to, n)
        for k in range(first, last - 1, 2):  # two sums: neither waits for the other
            drag = fma(load(velocity, entry(column, k)), entry(damping, k), drag)
            back = fma(load(velocity, entry(column, k + 1)), entry(damping, k + 1), back)
        if (last - first) % 2 == 1:
            drag = fma(load(velocity, entry(column, last - 1)), entry(damping, last - 1), drag)
        if has_rows(spans.damping_root):
            root = own_of(spans.damping_root, spans.root_number, i)
            store(force, i, load(force, i) - fma(back + drag, root, elastic))
        else:
            store(force, i, load(force, i) - (back + drag))
    for n in range(tops, stop):
        i = entry(stretches.stepped, n)
        first, last = entry(stretches.factor_start, n), entry(stretches.factor_start, n + 1)
        total = load(force, i) - own_sum(
            stretches.factor, spans.in_order, stretches.factor_top, first, last, force, none
        )
        store(force, i, total * own(stretches.factor_inverse, n))
    for n in range(stop - 1, tops - 1, -1):
        i = entry(stretches.stepped, n)
        total = load(force, i) * own(stretches.factor_inverse, n)
        store(force, i, total)
        for k in range(entry(stretches.factor_start, n), entry(stretches.factor_start, n + 1)):
            at = entry(stretches.factor_top, k)
            store(force, at, load(force, at) - total * own(stretches.factor, k))
    for n in range(start, tops):
        i = entry(stretches.stepped, n)
        first, last = entry(spans.carried_start, i), entry(spans.carried_start, i + 1)
        number = spans.carried_number
        along = own_sum(spans.carried, number, spans.carried_top, first, last, force, none)
        response = own_of(spans.response, spans.mode_number, i)
        store(force, i, (load(force, i) - along) * response)


@kernel()
def _covered(spans, span, tail, nose):
    """First and last row of a span's rail coefficients on the units under the train."""
    per_unit = spans.stride // spans.n_units
    unit = spans.span_length / spans.n_units
    start = span * spans.span_length
    # A pole may stand a rounding error beyond the ends of the train.
    begin = int(np.floor((tail - start) / unit - 1.0e-6))
    end = int(np.floor((nose - start) / unit + 1.0e-6)) + 1
    return max(0, begin) * per_unit, min(spans.n_units, end) * per_unit


@kernel()
def _keep_largest(outcome, place, size, time):
    best = load(outcome.extreme, place)
    store(outcome.extreme_time, place, choose(size, best, time, load(outcome.extreme_time, place)))
    store(outcome.extreme, place, maximum(size, best))


@kernel()
def _peak(watch, place, value):
    """Vertex of the parabola through a motion's last three values, and twice how far back it is.

    A peak is such a vertex of which the middle value is the largest; the values themselves miss it
    by up to (ωΔt)²/8 of its size.  The way counts from the middle value [steps].
    """
    before, middle = load(watch.recent, 2 * place), load(watch.recent, 2 * place + 1)
    rise = value - before
    back = rise / (value - middle - middle + before)
    back = choose(1.0, maximum(back, -1.0 * back), back, 0.0)  # beyond 1 another value is nearer
    store(watch.recent, 2 * place, middle)
    store(watch.recent, 2 * place + 1, value)
    return fma(rise * back, -0.125, middle), back


@kernel()
def _keep_peak(outcome, watch, place, value, time, dt):
    """Keep the size of a motion's largest peak, and when it was; return the vertex of `_peak`."""
    peak, back = _peak(watch, place, value)
    when = back * (-0.5 * dt) + (time - dt)
    _keep_largest(outcome, place, maximum(peak, -1.0 * peak), when)
    # the last of all has none behind it
    _keep_largest(outcome, place, maximum(value, -1.0 * value), time)
    return peak


@kernel()
def _keep_signs(outcome, place, peak, value):
    """Keep the largest of a motion in its direction, and the largest against it."""
    up = maximum(maximum(peak, value), load(outcome.signed, 2 * place))
    down = maximum(maximum(-1.0 * peak, -1.0 * value), load(outcome.signed, 2 * place + 1))
    store(outcome.signed, 2 * place, up)
    store(outcome.signed, 2 * place + 1, down)


@kernel()
def _low_pass(sections, direction, watch, incoming):
    """Filter an acceleration of midspan by the low-pass."""
    n_sections = sections.shape[0]
    for section in range(n_sections):
        b0, b1, b2, _, a1, a2 = sections[section]
        at = 2 * (direction * n_sections + section)
        smooth = fma(incoming, b0, load(watch.filtered, at))
        store(watch.filtered, at, fma(incoming, b1, load(watch.filtered, at + 1)) - smooth * a1)
        store(watch.filtered, at + 1, incoming * b2 - smooth * a2)
        incoming = smooth
    return incoming


@kernel()
def _watch_midspan(spans, timing, step, direction, rest, guideway, watch, outcome):
    """Record the displacement of midspan at this step and its acceleration at the step before.

    The left-out modes follow the forces at once.  Their acceleration is a second difference and
    known one step late, so the acceleration of the kept modes waits for it.
    """
    dt = timing.time_step
    shift = rest * 0.0
    raw = shift
    n_columns = spans.output_column.size
    for k in range(n_columns):
        column = entry(spans.output_column, k)
        share = own(spans.midspan, direction * n_columns + k)
        shift = fma(load(guideway.position, column), share, shift)
        raw = fma(load(guideway.force, column), share, raw)
    change = rest - load(watch.left_out, 3 * direction)
    bend = change - load(watch.left_out, 3 * direction + 1)
    shift = shift + rest
    smooth = fma(bend, 1.0 / (dt * dt), load(watch.left_out, 3 * direction + 2))
    store(watch.left_out, 3 * direction, rest)
    store(watch.left_out, 3 * direction + 1, change)
    store(watch.left_out, 3 * direction + 2, raw)
    smooth = _low_pass(timing.sections, direction, watch, smooth)
    time = step * dt
    peak = _keep_peak(outcome, watch, direction, shift, time, dt)
    _keep_signs(outcome, direction, peak, shift)
    peak = _keep_peak(outcome, watch, 2 + direction, smooth, time - dt, dt)
    _keep_signs(outcome, 2 + direction, peak, smooth)
    every = timing.record_every
    if every > 0 and step % every == 0:
        store(outcome.history[step // every - 1], direction, shift)
        store(outcome.history[step // every - 1], 2 + direction, smooth)
    # accelerations come a step late, and the last of all is that of the step before
    if every > 0 and step > every and (step - 1) % every == 0:
        store(outcome.history[(step - 1) // every - 1], 2 + direction, smooth)


@kernel()
def _watch_bearings(spans, timing, step, place, guideway, watch, outcome):
    """Lift of the girder off the bearings of the middle span, the largest of the four."""
    n_columns = spans.output_column.size
    lift = load(watch.bearing, 0) * 0.0
    for side in range(2):
        mean, half = load(watch.bearing, 2 * side), load(watch.bearing, 2 * side + 1)
        for k in range(n_columns):
            motion = load(guideway.position, entry(spans.output_column, k))
            mean = fma(motion, own(spans.bearing, 2 * side * n_columns + k), mean)
            half = fma(motion, own(spans.bearing, (2 * side + 1) * n_columns + k), half)
        higher = mean + maximum(half, -1.0 * half)
        lift = higher if side == 0 else maximum(lift, higher)
    time, dt = step * timing.time_step, timing.time_step
    peak, back = _peak(watch, place, lift)
    _keep_largest(outcome, place, peak, back * (-0.5 * dt) + (time - dt))
    _keep_largest(outcome, place, lift, time)


@kernel()
def _watch_cars(vehicle, timing, step, train, watch, outcome):
    """Accelerations of the car bodies, and the larger of those at their two ends.

    Of ``up - arm turn`` and ``up + arm turn`` the larger size is ``|up| + arm |turn|``.
    """
    dt = timing.time_step
    n_cars = vehicle.body_z.size
    record = timing.record_every > 0 and step % timing.record_every == 0
    for car in range(n_cars):
        vertical, lateral = vehicle.body_z[car], vehicle.body_y[car]
        mass, number = vehicle.inverse_mass, vehicle.mass_number
        up = load(train.force, vertical) * own_of(mass, number, vertical)
        across = load(train.force, lateral) * own_of(mass, number, lateral)
        _keep_peak(outcome, watch, 4 + car, up, step * dt, dt)
        _keep_peak(outcome, watch, 4 + n_cars + car, across, step * dt, dt)
        pitch, yaw = vehicle.body_pitch[car], vehicle.body_yaw[car]
        turn = load(train.force, pitch) * (own_of(mass, number, pitch) * vehicle.end_distance)
        swing = load(train.force, yaw) * (own_of(mass, number, yaw) * vehicle.end_distance)
        end_z = maximum(up, -1.0 * up) + maximum(turn, -1.0 * turn)
        end_y = maximum(across, -1.0 * across) + maximum(swing, -1.0 * swing)
        _keep_peak(outcome, watch, 4 + 2 * n_cars + car, end_z, step * dt, dt)
        _keep_peak(outcome, watch, 4 + 3 * n_cars + car, end_y, step * dt, dt)
        if record:
            row = step // timing.record_every - 1
            store(outcome.history[row], 4 + car, up)
            store(outcome.history[row], 4 + n_cars + car, across)


@kernel()
def _record_magnets(timing, step, n_cars, watch, outcome):
    """Record mean gap and mean current of each magnet."""
    row, at, n = step // timing.record_every - 1, 4 + 2 * n_cars, watch.magnet_gap.shape[0]
    for magnet in range(n):
        store(outcome.history[row], at + magnet, load(watch.magnet_gap, magnet))
        store(outcome.history[row], at + n + magnet, load(watch.magnet_current, magnet))


@kernel()
def _note_lost(timing, watch, outcome, time):
    """Set the status of samples that lose levitation at this step; return how many still hold."""
    holding = 0
    for lane in range(LANES):
        if outcome.status[lane] != COMPLETED:
            continue
        for magnet in range(watch.magnet_min.shape[0]):
            low, high = watch.magnet_min[magnet, lane], watch.magnet_max[magnet, lane]
            if low > timing.gap_contact[lane] and high < timing.gap_lost[lane]:
                continue
            if low <= timing.gap_contact[lane]:
                outcome.status[lane] = CONTACT
            elif high >= timing.gap_lost[lane]:
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


@kernel()
def _all_lost(timing, watch, outcome, time):
    """Check the gaps at this step; return whether all samples have lost levitation."""
    for lane in range(LANES):
        low = min(outcome.gap_min[0, lane], outcome.gap_min[1, lane])
        high = max(outcome.gap_max[0, lane], outcome.gap_max[1, lane])
        if not (low > timing.gap_contact[lane] and high < timing.gap_lost[lane]):
            return _note_lost(timing, watch, outcome, time) == 0
    return False


@kernel(nogil=True)
def cross(
    vehicle, suspension, guidance, suspension_law, guidance_law, suspension_footprints,
    guidance_footprints, spans, timing, gains, outcome,
):  # fmt: skip
    """Take one row of samples over the guideway.

    Velocity Verlet with a predicted velocity in the forces: second order, one evaluation a step.

    Parameters
    ----------
    vehicle, suspension, guidance, suspension_law, guidance_law
        The train, its magnets and their circuits.
    suspension_footprints, guidance_footprints, spans, timing
        The rail under the poles' faces, the guideway, and steps and bounds of the passage.
    gains : (8, LANES)
        Suspension k_p [A/m], k_d [A s/m], guidance k_p, k_d, suspension k_a [A s²/m],
        k_i [A/(m s)], guidance k_a, k_i.
    outcome
        Receives the results; extremes start at zero, gaps at the reference.
    """
    n_cars, n_magnets = vehicle.body_z.size, 2 * (suspension.x.size + guidance.x.size)
    dt, stretches = timing.time_step, spans.stretches
    train = at_rest(vehicle.pull_start.size - 1)
    guideway = at_rest(spans.carried_start.size + spans.stiffness_start.size - 2)
    rates = zeros(guideway.force.shape[0])
    rails = _straight_rails(spans)
    scaled, pull = zeros(vehicle.scaled_dof.size), zeros(vehicle.link_start.size - 1)
    packed, turn = zeros(spans.in_order.size), zeros(spans.stride)
    lifting = empty_magnet(suspension, suspension_law)
    guiding = empty_magnet(guidance, guidance_law)
    lifting_circuits = circuits_at_rest(suspension, suspension_law)
    guiding_circuits = circuits_at_rest(guidance, guidance_law)
    watch = _new_watch(n_magnets, timing.sections.shape[0], outcome.extreme.shape[0])
    weighing = empty_weighing(timing.comfort, n_cars)
    with_magnets = timing.record_every > 0 and outcome.history.shape[1] > 4 + 2 * n_cars
    stretch = -1
    for step in range(timing.first_step, timing.n_steps + 1):
        nose = timing.start + timing.speed * (step * dt)
        tail = nose - timing.train_length
        first = max(0, int(np.floor(tail / spans.span_length)))
        last = min(spans.n_spans - 1, int(np.floor(nose / spans.span_length)))
        record = with_magnets and step % timing.record_every == 0
        _advance_train(vehicle, dt, train)
        while stretch + 1 < stretches.first_step.size and step >= stretches.first_step[stretch + 1]:
            stretch += 1
            _still(stretches, stretch, rates, guideway)
        if stretch >= 0:
            _advance_guideway(stretches, stretch, dt, guideway)
        _move_rails(spans, first, last, tail, nose, guideway, packed, rails)
        _links(vehicle, train, scaled, pull)
        attract(
            suspension_footprints, suspension, suspension_law, step, dt, gains, train, rails,
            lifting, lifting_circuits, record, watch, outcome,
        )  # fmt: skip
        attract(
            guidance_footprints, guidance, guidance_law, step, dt, gains, train, rails,
            guiding, guiding_circuits, record, watch, outcome,
        )  # fmt: skip
        rest_z, rest_y = _load_guideway(
            spans, first, last, tail, nose, rails, turn, packed, guideway, watch
        )
        if stretch >= 0:
            _answer(spans, stretch, rates, guideway)
        _watch_midspan(spans, timing, step, 0, rest_z, guideway, watch, outcome)
        _watch_midspan(spans, timing, step, 1, rest_y, guideway, watch, outcome)
        _watch_bearings(spans, timing, step, 4 + 4 * n_cars, guideway, watch, outcome)
        _watch_cars(vehicle, timing, step, train, watch, outcome)
        weigh(timing.comfort, vehicle, step, dt, train, weighing, outcome)
        if record:
            _record_magnets(timing, step, n_cars, watch, outcome)
        if _all_lost(timing, watch, outcome, step * dt):
            return
