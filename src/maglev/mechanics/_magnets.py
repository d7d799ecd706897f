"""Compiled: the magnets of one kind at one step, from the gaps to the forces.

A magnet's poles see the rail under their faces, its circuits make currents of those gaps, and the
poles pull at the magnet and at the rail.  Errors and rates count in the direction of the
displacement, z down or y to the right, whatever opens the gap; ``outward`` is the sign between
the two.
"""

from __future__ import annotations

from maglev.compiled import kernel
from maglev.mechanics._records import Circuits, Magnet
from maglev.mechanics._rows import zeros
from maglev.mechanics.lanes import (
    LANES,
    choose,
    entry,
    fma,
    load,
    maximum,
    met,
    minimum,
    own,
    own_of,
    store,
)


@kernel()
def empty_magnet(rows, law):
    """Empty record of one magnet."""
    n = rows.offset.size
    return Magnet(zeros(n), zeros(n), zeros(n), zeros(n), zeros(law.n_circuits))


@kernel()
def circuits_at_rest(rows, law):
    """Circuits at rest, with the currents that carry the train."""
    n = 2 * rows.x.size * law.n_circuits
    current, command = zeros(n), zeros(n)
    none = load(current, 0)
    for k in range(n):
        most = own_of(rows.current_max, rows.current_number, k // law.n_circuits)
        at_rest = minimum(none + own(rows.current_reference, 0), most)
        store(current, k, at_rest)
        store(command, k, at_rest)
    n_signals = law.ring * n if law.delays else 1
    signal = zeros(n_signals).reshape((max(1, n_signals // n), -1, LANES))
    return Circuits(current, command, zeros(n), zeros(n), signal)


@kernel()
def _look(footprints, rows, law, row, side, step, train, rails, magnet):
    """Compute the gap error of each pole of a magnet, and its rate where it feeds a circuit."""
    field = 2 if rows.is_guidance else side
    motion, motion_rate = rails.motion[field], rails.rate[field]
    own_track = footprints.rail.shape[2] > 1
    translation, rotation = rows.translation[row, side], rows.rotation[row, side]
    shift, turn = load(train.position, translation), load(train.position, rotation)
    shift_rate = load(train.predicted, translation)
    turn_rate = load(train.predicted, rotation)
    none = shift * 0.0
    n_poles = rows.offset.size
    for p in range(n_poles):
        here = entry(footprints.number, row * n_poles + p) + step
        at = 2 * here + side
        arm = entry(rows.arm, p)
        first = entry(footprints.first, here)
        begin, end = entry(footprints.start, here), entry(footprints.start, here + 1)
        rail = load(footprints.rail, at) if own_track else none + entry(footprints.rail, at)
        rail = met(rail, footprints.level, entry(footprints.sag, at), footprints.sagging)
        if entry(law.senses, p) > 0:
            rise = load(footprints.ramp, at) if own_track else none + entry(footprints.ramp, at)
            rise = met(rise, footprints.level, entry(footprints.sag_rise, at), footprints.sagging)
            for j in range(begin, end):
                weight = entry(footprints.weight, j)
                deflection = load(motion, first + j - begin)
                rail = fma(deflection, weight, rail)
                rise = fma(deflection, entry(footprints.rise, j), rise)
                rise = fma(load(motion_rate, first + j - begin), weight, rise)
            store(magnet.rate, p, fma(turn_rate, arm, shift_rate) - rise)
        else:
            for j in range(begin, end):
                rail = fma(load(motion, first + j - begin), entry(footprints.weight, j), rail)
        store(magnet.error, p, fma(turn, arm, shift) - rail)


@kernel()
def _control(rows, law, row, side, step, dt, gains, train, magnet, circuits):
    """Compute the currents of a magnet's circuits by the law of control, its delay and its lag.

    The delayed signal ``u = k_p e + k_d de/dt + k_a a + k_i ∫e dt`` is added to the current at
    rest, limited to the chopper's range and passed through the lag (docs/theory/control.md,
    eqs. 1 to 3).  The acceleration is that of the step before; `_answer_acceleration` corrects it.
    """
    kind = 1 if rows.is_guidance else 0
    sign = rows.outward[side]
    proportional = load(gains, 2 * kind) * sign
    derivative = load(gains, 2 * kind + 1) * sign
    none = proportional * 0.0
    at_rest = none + own(rows.current_reference, 0)
    most = own_of(rows.current_max, rows.current_number, 2 * row + side)
    first = (2 * row + side) * law.n_circuits
    n = circuits.signal.shape[1]
    last, now = ((step - 1) % law.ring) * n + first, (step % law.ring) * n + first
    latest = ((step - law.behind + law.ring) % law.ring) * n + first
    middle = ((step - law.behind - 1 + law.ring) % law.ring) * n + first
    oldest = ((step - law.behind - 2 + law.ring) % law.ring) * n + first
    for c in range(law.n_circuits):
        if law.own_gap:
            error, rate = load(magnet.error, c), load(magnet.rate, c)
        else:
            error, rate = none, none
            for j in range(entry(law.feed_start, c), entry(law.feed_start, c + 1)):
                pole, weight = entry(law.feed_pole, j), entry(law.feed_weight, j)
                error = fma(load(magnet.error, pole), weight, error)
                rate = fma(load(magnet.rate, pole), weight, rate)
        here = first + c
        if law.integrates:
            mean = load(circuits.error, here) + error
            store(circuits.integral, here, fma(mean, 0.5 * dt, load(circuits.integral, here)))
            store(circuits.error, here, error)
        if law.delays or law.accelerates or law.integrates:
            signal = fma(proportional, error, derivative * rate)
            if law.integrates:
                gain = load(gains, 5 + 2 * kind) * sign
                signal = fma(gain, load(circuits.integral, here), signal)
            fast = none
            if law.accelerates:
                shift = load(train.before, rows.translation[row, side])
                turn = load(train.before, rows.rotation[row, side])
                acceleration = fma(turn, entry(law.arm, c), shift)
                fast = load(gains, 4 + 2 * kind) * sign * acceleration
            if law.delays:
                if law.accelerates:  # that of the step before is known only now
                    known = load(circuits.signal, last + c) + fast
                    store(circuits.signal, last + c, known)
                store(circuits.signal, now + c, signal)
                signal = fast * law.undelayed
                past = load(circuits.signal, latest + c)
                signal = fma(past, entry(law.delayed, 0), signal)
                past = load(circuits.signal, middle + c)
                signal = fma(past, entry(law.delayed, 1), signal)
                past = load(circuits.signal, oldest + c)
                signal = fma(past, entry(law.delayed, 2), signal)
            else:
                signal = signal + fast
            command = at_rest + signal
        else:
            command = at_rest + fma(proportional, error, derivative * rate)  # the same bits
        command = maximum(minimum(command, most), 0.0)
        if law.lags:
            current = load(circuits.current, here) * own(law.decay, 0)
            current = fma(load(circuits.command, here), own(law.command_before, 0), current)
            current = fma(command, own(law.command_now, 0), current)
            store(circuits.command, here, command)
            store(circuits.current, here, current)
            command = current
        store(magnet.current, c, command)


@kernel()
def _attract(rows, law, row, side, gains, magnet):
    """Compute the pull of each pole; return total, moment, extreme gaps and largest current."""
    sign = rows.outward[side]
    n_poles = rows.offset.size
    none = load(magnet.error, 0) * 0.0
    reference = none + own(rows.gap_reference, 0)
    most = own_of(rows.current_max, rows.current_number, 2 * row + side)
    smallest, largest, strongest = none + 1.0e9, none - 1.0e9, none
    total, moment = none, none
    mean_gap = reference
    if law.mean_gap_force:
        for p in range(n_poles):
            mean_gap = fma(load(magnet.error, p), sign / n_poles, mean_gap)
    for p in range(n_poles):
        gap = fma(load(magnet.error, p), sign, reference)
        current = load(magnet.current, entry(law.first, p))
        if not law.own_gap:
            current = (current + load(magnet.current, entry(law.second, p))) * 0.5
        ratio = current / mean_gap if law.mean_gap_force else current / gap
        place = (2 * row + side) * n_poles + p
        constant = own_of(rows.constant, rows.constant_number, place)
        pull = ratio * ratio * (sign * constant)
        store(magnet.pull, p, pull)
        total = total + pull
        moment = fma(pull, entry(rows.arm, p), moment)
        if law.accelerates:
            by = mean_gap if law.mean_gap_force else gap
            direct = own(law.command_now, 0) * law.undelayed
            gain = load(gains, 4 + 2 * (1 if rows.is_guidance else 0)) * (2.0 * direct * constant)
            answer = ratio / by * gain
            store(magnet.stiffening, p, choose(most, current, answer, 0.0))
        smallest = minimum(smallest, gap)
        largest = maximum(largest, gap)
        strongest = maximum(strongest, current)
    return total, moment, smallest, largest, strongest


@kernel()
def _answer_acceleration(rows, law, row, side, gains, train, magnet, circuits, force_z, force_turn):
    """Correct the pulls for the acceleration of this step by one Newton step.

    `_control` knows only the acceleration of the step before.  Returns the additional forces on
    the magnet's two degrees of freedom.
    """
    n_poles = rows.offset.size
    none = force_z * 0.0
    mass, inertia = own(rows.mass, 0), own(rows.inertia, 0)
    most = own_of(rows.current_max, rows.current_number, 2 * row + side)
    a, b, c, d = none + mass, none, none, none + inertia
    for p in range(n_poles):
        g = load(magnet.stiffening, p)
        arm = entry(rows.arm, p)
        seen = 0.5 * (entry(law.arm, entry(law.first, p)) + entry(law.arm, entry(law.second, p)))
        a = a + g
        b = fma(g, seen, b)
        c = fma(g, arm, c)
        d = fma(g, arm * seen, d)
    before_z = load(train.before, rows.translation[row, side])
    before_turn = load(train.before, rows.rotation[row, side])
    missing_z = force_z - before_z * mass
    missing_turn = force_turn - before_turn * inertia
    determinant = a * d - b * c
    shift = (missing_z * d - missing_turn * b) / determinant
    turn = (missing_turn * a - missing_z * c) / determinant
    more_z, more_turn = none, none
    for p in range(n_poles):
        seen = 0.5 * (entry(law.arm, entry(law.first, p)) + entry(law.arm, entry(law.second, p)))
        more = load(magnet.stiffening, p) * fma(turn, seen, shift)
        store(magnet.pull, p, load(magnet.pull, p) + more)
        more_z = more_z - more
        more_turn = more_turn - more * entry(rows.arm, p)
    gain = load(gains, 4 + 2 * (1 if rows.is_guidance else 0))
    gain = gain * (rows.outward[side] * law.undelayed)
    first = (2 * row + side) * law.n_circuits
    for c in range(law.n_circuits):
        command, current = load(circuits.command, first + c), load(circuits.current, first + c)
        new = fma(gain, fma(turn, entry(law.arm, c), shift), command)
        new = maximum(minimum(new, most), 0.0)
        store(circuits.current, first + c, fma(new - command, own(law.command_now, 0), current))
        store(circuits.command, first + c, new)
    return more_z, more_turn


@kernel()
def _press(footprints, rows, row, side, step, rails, magnet):
    """Spread the pulls over the rail under the poles' faces."""
    pressed = rails.force[2 if rows.is_guidance else side]
    n_poles = rows.offset.size
    for p in range(n_poles):
        here = entry(footprints.number, row * n_poles + p) + step
        first = entry(footprints.first, here)
        begin, end = entry(footprints.start, here), entry(footprints.start, here + 1)
        pull = load(magnet.pull, p)
        for j in range(begin, end):
            at = first + j - begin
            store(pressed, at, fma(pull, entry(footprints.weight, j), load(pressed, at)))


@kernel()
def attract(
    footprints, rows, law, step, dt, gains, train, rails, magnet, circuits, keep, watch, outcome
):
    """Compute gaps, currents and forces of all magnets of one kind, and load train and rails.

    Parameters
    ----------
    footprints, rows, law
        Rail under the poles' faces, the magnets, and their law of control.
    step, dt
        Number of the step and its length [s].
    gains : (8, LANES)
        Suspension k_p, k_d, guidance k_p, k_d, suspension k_a, k_i, guidance k_a, k_i.
    train, rails
        Their motion; receive the forces.
    magnet, circuits
        Working record of one magnet, and the state of all circuits of the kind.
    keep
        Whether mean gaps and currents of each magnet are to be recorded.
    watch, outcome
        Receive gaps and currents.
    """
    kind = 1 if rows.is_guidance else 0
    least, most = load(outcome.gap_min, kind), load(outcome.gap_max, kind)
    strongest = load(outcome.current_max, kind)
    none = least * 0.0
    n_poles = rows.offset.size
    for row in range(rows.x.size):
        for side in range(2):
            sign = rows.outward[side]
            translation, rotation = rows.translation[row, side], rows.rotation[row, side]
            _look(footprints, rows, law, row, side, step, train, rails, magnet)
            _control(rows, law, row, side, step, dt, gains, train, magnet, circuits)
            total, moment, smallest, largest, strong = _attract(rows, law, row, side, gains, magnet)
            magnet_place = 2 * row + side
            static_force = own_of(rows.static_force, rows.force_number, magnet_place)
            static_moment = own_of(rows.static_moment, rows.moment_number, magnet_place)
            force = load(train.force, translation) - (total - static_force * sign)
            turn = load(train.force, rotation) - (moment - static_moment * sign)
            if law.accelerates:
                more, more_turn = _answer_acceleration(
                    rows, law, row, side, gains, train, magnet, circuits, force, turn
                )
                force, turn = force + more, turn + more_turn
            store(train.force, translation, force)
            store(train.force, rotation, turn)
            _press(footprints, rows, row, side, step, rails, magnet)
            number = rows.number[row, side]
            store(watch.magnet_min, number, smallest)
            store(watch.magnet_max, number, largest)
            if keep:
                gaps = none
                for p in range(n_poles):
                    gaps = fma(load(magnet.error, p), sign, gaps)
                mean_gap = gaps * (1.0 / n_poles) + own(rows.gap_reference, 0)
                store(watch.magnet_gap, number, mean_gap)
                currents = none
                for p in range(n_poles):
                    one = load(magnet.current, entry(law.first, p))
                    other = load(magnet.current, entry(law.second, p))
                    currents = currents + (one + other)
                store(watch.magnet_current, number, currents * (0.5 / n_poles))
            least, most = minimum(least, smallest), maximum(most, largest)
            strongest = maximum(strongest, strong)
    store(outcome.gap_min, kind, least)
    store(outcome.gap_max, kind, most)
    store(outcome.current_max, kind, strongest)
