"""Compiled: running weightings of the accelerations at the ends of the car bodies."""

from __future__ import annotations

from maglev.compiled import kernel
from maglev.mechanics._records import Weighing
from maglev.mechanics._rows import zeros
from maglev.mechanics.lanes import entry, fma, load, store


@kernel()
def empty_weighing(comfort, n_cars):
    """Room for the filters of all cars, at rest."""
    n_sections = comfort.start[comfort.start.size - 1]
    return Weighing(zeros(4 * n_cars), zeros(4 * n_cars * n_sections))


@kernel()
def _mean_acceleration(train, dof, before, place, rate):
    """Mean acceleration since the last reading: the change of the velocity, exactly."""
    now = load(train.velocity, dof)
    mean = (now - load(before, place)) * rate
    store(before, place, now)
    return mean


@kernel()
def _weighted(sections, first, last, state, at, incoming):
    """Pass a reading through the sections of a filter."""
    for section in range(first, last):
        here = at + 2 * (section - first)
        smooth = fma(incoming, entry(sections, 6 * section), load(state, here))
        along = fma(incoming, entry(sections, 6 * section + 1), load(state, here + 1))
        store(state, here, along - smooth * entry(sections, 6 * section + 4))
        along = incoming * entry(sections, 6 * section + 2)
        store(state, here + 1, along - smooth * entry(sections, 6 * section + 5))
        incoming = smooth
    return incoming


@kernel()
def weigh(comfort, vehicle, step, dt, train, weighing, outcome):
    """Read the accelerations of the cars' ends, weight them and add up their squares.

    Parameters
    ----------
    comfort
        The weightings and when they are read.
    vehicle
        The car bodies.
    step, dt
        Number of the step and its length [s].
    train
        Its motion; the velocities are read.
    weighing
        State of the filters.
    outcome
        Receives the squares.
    """
    if step % comfort.every != 0:
        return
    rate = 1.0 / (comfort.every * dt)
    n_cars = vehicle.body_z.size
    at = 0
    for car in range(n_cars):
        up = _mean_acceleration(train, vehicle.body_z[car], weighing.velocity, 4 * car, rate)
        turn = _mean_acceleration(
            train, vehicle.body_pitch[car], weighing.velocity, 4 * car + 1, rate
        )
        across = _mean_acceleration(
            train, vehicle.body_y[car], weighing.velocity, 4 * car + 2, rate
        )
        swing = _mean_acceleration(
            train, vehicle.body_yaw[car], weighing.velocity, 4 * car + 3, rate
        )
        counts = comfort.first[car] <= step and step <= comfort.last[car]
        for end in range(2):
            arm = (1 - 2 * end) * vehicle.end_distance
            vertical, lateral = fma(turn, -arm, up), fma(swing, arm, across)
            for weighting in range(comfort.start.size - 1):
                first, last = comfort.start[weighting], comfort.start[weighting + 1]
                heard = lateral if weighting % 2 == 1 else vertical
                heard = _weighted(comfort.sections, first, last, weighing.filtered, at, heard)
                at += 2 * (last - first)
                if counts:
                    place = (weighting * n_cars + car) * 2 + end
                    store(outcome.squares, place, fma(heard, heard, load(outcome.squares, place)))
