"""Magnets and their circuits in the kernels: the law of control, and what poles do to rails."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numba
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from maglev.mechanics import _kernels, _magnets, packing
from maglev.mechanics import train as train_model
from maglev.mechanics._records import Footprints
from maglev.mechanics.control import grouping
from maglev.mechanics.lanes import LANES
from maglev.mechanics.reduction import rail_nodes
from maglev.parameters import Circuit, Config
from passages import MEAN, half_size, passed, system_of

CONFIG = Config.model_validate({"train": {"n_cars": 1}, "guideway": {"n_spans": 1}})
TRAIN = train_model.build(CONFIG.train)
GROUPS = ("pole", "ends", "half", "lumped")


def first_pair(n_poles=None, *, guidance=False):
    """The first two magnets of a kind, right and left, with freedoms of their own; or one pole each
    that pulls as hard as all."""
    rows = packing.magnet_rows(TRAIN, Circuit(), guidance=guidance)
    rows = rows._replace(
        x=rows.x[:1],
        number=np.array([[0, 1]]),
        translation=np.array([[0, 2]]),
        rotation=np.array([[1, 3]]),
        static_force=rows.static_force[:2],
        static_moment=rows.static_moment[:2],
        constant=rows.constant[: 2 * rows.offset.size],
        current_max=rows.current_max[:2],
    )
    if n_poles == 1:
        whole = rows.constant.reshape(2, -1).sum(axis=1)
        rows = rows._replace(
            offset=np.zeros(1), arm=np.zeros(1), constant=whole, static_moment=np.zeros(2)
        )
    return rows


def over_rigid_track(rows, track, rate):
    """Footprints off the guideway, one after the other, the same for all poles (step, side)."""
    n_steps = track.shape[0]
    return Footprints(
        number=np.zeros((1, rows.offset.size), dtype=np.int64),
        first=np.zeros(n_steps, dtype=np.int64),
        start=np.zeros(n_steps + 1, dtype=np.int64),
        weight=np.zeros(0),
        rise=np.zeros(0),
        rail=track[..., None].copy(),
        ramp=rate[..., None].copy(),
        level=1.0,
        sag=np.zeros(2 * n_steps),
        sag_rise=np.zeros(2 * n_steps),
        sagging=1.0,
    )


@dataclass
class Stand:
    """Two magnets, right and left, stepped as in a passage; they carry what hangs on them by a
    constant force."""

    rows: object
    footprints: Footprints
    law: object
    dt: float
    gains: np.ndarray

    def __post_init__(self):
        rows = self.rows
        mass = [rows.mass, rows.inertia] * 2
        self.vehicle = packing.vehicle(TRAIN)._replace(inverse_mass=1 / np.array(mass))
        self.train = _kernels.at_rest(4)
        self.rails = _kernels._straight_rails(packed_spans())
        self.magnet = _magnets.empty_magnet(rows, self.law)
        self.circuits = _magnets.circuits_at_rest(rows, self.law)
        self.watch = _kernels._new_watch(2, 1, 1)
        timing = packing.timing(CONFIG, 0)
        kinds = (rows, rows)
        self.outcome = packing.empty_outcome(TRAIN, kinds, timing)

    def close(self, step):
        """Forces at a step, on magnets and rails."""
        for array in (self.train.force, self.rails.force):
            array[:] = 0.0
        _magnets.attract(
            self.footprints, self.rows, self.law, step, self.dt, self.gains, self.train, self.rails,
            self.magnet, self.circuits, True, self.watch, self.outcome,
        )  # fmt: skip

    def run(self, n_steps):
        """Displacement of the right magnet at every step (step, LANES)."""
        moved = [self.train.position[0].copy()]
        for step in range(1, n_steps + 1):
            _kernels._advance_train(self.vehicle, self.dt, self.train)
            self.close(step)
            moved.append(self.train.position[0].copy())
        return np.array(moved)


@lru_cache
def packed_spans():
    return system_of(CONFIG).spans


def all_lanes(gains):
    return np.repeat(np.asarray(gains, dtype=float)[:, None], LANES, axis=1)


K_P, K_D = CONFIG.gains.as_row[:2]
ONE = first_pair(1)
FORCE = float(ONE.static_force[0])
K_A = 0.4 * ONE.mass * ONE.current_reference / (2 * FORCE)  # adds 0.4 of the magnet's mass
K_I = 20.0 * K_P
HEIGHT, RISE = 0.5e-3, 20e-3  # m, s: the track's step


def track_step(time):
    """A step of the track that sets in and ends with no curvature, and its rate."""
    t = np.clip(np.asarray(time) / RISE, 0.0, 1.0)
    return (
        HEIGHT * t**3 * (10 + t * (6 * t - 15)),
        HEIGHT / RISE * 30 * t**2 * (1 - t) ** 2,
    )


def stepped(circuit, gains, dt, duration):
    n_steps = round(duration / dt)
    track, rate = (np.repeat(one[:, None], 2, axis=1) for one in
                   track_step(np.arange(n_steps + 1) * dt))  # fmt: skip
    law = packing.law(circuit, ONE, dt, np.asarray(gains)[None])
    stand = Stand(ONE, over_rigid_track(ONE, track, rate), law, dt, all_lanes(gains))
    return stand.run(n_steps)[:, 0]


def solved(circuit, gains, duration):
    """The same magnet by a Runge-Kutta method of eighth order, the delay by the method of steps."""
    k_p, k_d, k_a, k_i = gains[0], gains[1], gains[4], gains[5]
    rest, gap, mass = ONE.current_reference, ONE.gap_reference, ONE.mass
    constant = float(ONE.constant[0])
    known = []  # (begin, end, dense solution) of the intervals that are solved

    def clipped(signal):
        return min(max(rest + signal, 0.0), ONE.current_max[0])

    def parts(time, state):
        track, rate = track_step(time)
        return state[0] - track, state[1] - rate

    def acceleration(current, error):
        return (FORCE - constant * (current / (gap + error)) ** 2) / mass

    def slow(time, state):
        error, rate = parts(time, state)
        return k_p * error + k_d * rate + k_i * state[3]

    def current_of(time, state):
        """Without a lag the command itself, which the acceleration takes part in."""
        if circuit.lag > 0:
            return state[2]
        if circuit.delay > 0:
            return clipped(past(time - circuit.delay))
        error, _ = parts(time, state)
        current = rest
        for _ in range(200):
            new = clipped(slow(time, state) + k_a * acceleration(current, error))
            if abs(new - current) < 1e-13:
                break
            current = new
        return current

    def signal(time, state):
        if k_a == 0:
            return slow(time, state)
        error, _ = parts(time, state)
        return slow(time, state) + k_a * acceleration(current_of(time, state), error)

    def past(time):
        if time <= 0:
            return 0.0
        dense = next(dense for begin, _, dense in reversed(known) if begin <= time)
        return signal(time, dense(time))

    def motion(time, state):
        error, _ = parts(time, state)
        change = 0.0
        if circuit.lag > 0:
            command = past(time - circuit.delay) if circuit.delay > 0 else signal(time, state)
            change = (clipped(command) - state[2]) / circuit.lag
        return [state[1], acceleration(current_of(time, state), error), change, error]

    piece = circuit.delay if circuit.delay > 0 else RISE
    ends = np.unique([*np.arange(0, duration, piece), RISE, duration])
    state = np.array([0.0, 0.0, rest, 0.0])
    for begin, end in pairwise(ends):
        found = solve_ivp(motion, (begin, end), state, "DOP853", rtol=1e-9, atol=1e-12,
                          dense_output=True)  # fmt: skip
        known.append((begin, end, found.sol))
        state = found.y[:, -1]

    def displacement(times):
        return np.array([
            next(dense(t)[0] for begin, end, dense in known if begin <= t <= end + 1e-12)
            for t in times
        ])  # fmt: skip

    return displacement


CASES = {
    "plain": (Circuit(), (0.0, 0.0)),
    "lag": (Circuit(lag="1.3 ms"), (0.0, 0.0)),
    "delay": (Circuit(delay="1.7 ms"), (0.0, 0.0)),
    "delay below a step": (Circuit(delay="0.11 ms"), (0.0, 0.0)),
    "lag and delay": (Circuit(lag="0.8 ms", delay="0.9 ms"), (0.0, 0.0)),
    "acceleration": (Circuit(), (K_A, 0.0)),
    "acceleration with lag": (Circuit(lag="1.3 ms"), (K_A, 0.0)),
    "acceleration with delay": (Circuit(delay="1.7 ms"), (K_A, 0.0)),
    "integral": (Circuit(), (0.0, K_I)),
    "all": (Circuit(lag="0.8 ms", delay="0.9 ms"), (K_A, K_I)),
}


@pytest.mark.parametrize("case", CASES)
def test_one_magnet_over_a_step_of_the_track_moves_as_its_equation_says(case):
    circuit, (k_a, k_i) = CASES[case]
    gains, duration = [K_P, K_D, K_P, K_D, k_a, k_i, 0.0, 0.0], 0.06
    exact = solved(circuit, gains, duration)
    errors = []
    for dt in (0.5e-3, 0.25e-3):
        found = stepped(circuit, gains, dt, duration)
        time = np.arange(found.size) * dt
        errors.append(np.abs(found - exact(time)).max() / HEIGHT)
    assert errors[1] < 2e-3
    assert np.log2(errors[0] / errors[1]) > 1.7


def commanded(circuit, errors, dt):
    """Currents [A] of a lone pole's circuit whose gap errors are given, k_p = 1 A/m (step,)."""
    gains = np.array([1.0, 0, 1.0, 0, 0, 0, 0, 0])
    law = packing.law(circuit, ONE, dt, gains[None])
    magnet, circuits = _magnets.empty_magnet(ONE, law), _magnets.circuits_at_rest(ONE, law)
    train, found = _kernels.at_rest(4), []
    for step, error in enumerate(errors, start=1):
        magnet.error[:], magnet.rate[:] = error, 0.0
        _magnets._control(
            ONE, law, 0, 0, step, dt, all_lanes(gains), train, magnet, circuits
        )  # fmt: skip
        found.append(magnet.current[0, 0])
    return np.array(found)


def test_the_lag_follows_a_ramp_of_the_command_exactly():
    dt, lag, slope = 0.5e-3, 0.7e-3, 300.0  # s, s, A/s
    time = np.arange(1, 60) * dt
    found = commanded(Circuit(lag=f"{lag} s"), slope * time, dt)
    expected = slope * (time + lag * np.expm1(-time / lag))
    assert_allclose(found - ONE.current_reference, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("steps", [0.5, 1.0, 2.0, 3.3, 7.9])
def test_a_delayed_signal_is_that_of_a_parabola_through_three_steps(steps):
    """Exact where the signal is one, of third order where it is not, nothing before the start."""
    dt = 0.5e-3
    delay = steps * dt
    time = np.arange(1, 80) * dt
    inside = time - delay > 3 * dt

    def parabola(t):
        return 2.0 + 90 * t - 4e3 * t**2

    found = commanded(Circuit(delay=f"{delay} s"), parabola(time), dt) - ONE.current_reference
    assert_allclose(found[inside], parabola(time - delay)[inside], rtol=0, atol=1e-12)
    assert_allclose(found[time < delay - 2.001 * dt], 0.0, atol=1e-15)
    omega = 300.0
    found = commanded(Circuit(delay=f"{delay} s"), np.sin(omega * time), dt)
    error = found - ONE.current_reference - np.sin(omega * (time - delay))
    assert np.abs(error[inside]).max() <= 0.07 * (omega * dt) ** 3 + 1e-12


@pytest.mark.parametrize("guidance", [False, True], ids=["suspension", "guidance"])
@pytest.mark.parametrize("group", GROUPS[1:])
def test_poles_that_see_one_gap_pull_alike_however_they_share_circuits(group, guidance):
    """A magnet that cannot turn over a track that all its poles see at once."""
    dt, n_steps = 0.5e-3, 60
    rows = first_pair(guidance=guidance)._replace(inertia=1e15)
    track, rate = (np.repeat(one[:, None], 2, axis=1) for one in
                   track_step(np.arange(n_steps + 1) * dt))  # fmt: skip
    gains = np.array([K_P, K_D, K_P, K_D, 0.1, K_I, 0.1, K_I])
    forces = {}
    for name in ("pole", group):
        circuit = Circuit(group=name, lag="0.8 ms", delay="0.9 ms")
        law = packing.law(circuit, rows, dt, gains[None])
        stand = Stand(rows, over_rigid_track(rows, track, rate), law, dt, all_lanes(gains))
        stand.vehicle = stand.vehicle._replace(inverse_mass=np.array([1 / rows.mass, 0.0] * 2))
        stand.run(n_steps)
        forces[name] = stand.train.force.copy()
        assert np.abs(stand.train.position[0]).min() > 0.01 * HEIGHT
    assert_allclose(forces[group], forces["pole"], rtol=1e-9, atol=1e-7)


def shaken(system, kind, circuit, step, gains):
    """Magnets of a kind in the middle of a passage, everything moving at random."""
    rng = np.random.default_rng(8)
    rows, footprints = (
        (system.guidance, system.guidance_footprints)
        if kind
        else (system.suspension, system.suspension_footprints)
    )
    law = packing.law(circuit, rows, 0.5e-3, np.array([gains]))
    stand = Stand(rows, footprints, law, 0.5e-3, all_lanes(gains))
    stand.watch = _kernels._new_watch(system.train.magnets.x.size, 1, 1)
    stand.train = _kernels.at_rest(system.vehicle.inverse_mass.size)
    for motion in (stand.train.position, stand.rails.motion):
        motion[:] = 1e-4 * rng.standard_normal(motion.shape)
    for rate in (stand.train.predicted, stand.rails.rate):
        rate[:] = 1e-3 * rng.standard_normal(rate.shape)
    stand.train.before[:] = rng.standard_normal(stand.train.before.shape)
    stand.close(step)
    return stand


def middle_step(system):
    """A step at which the whole train is on the guideway."""
    config = system.config
    timing = packing.timing(config, 0)
    place = 0.5 * (config.guideway.length + config.train.length)
    return int((place - timing.start) / timing.speed / timing.time_step)


LONG = Config.model_validate({"train": {"n_cars": 1}, "guideway": {"n_spans": 3}})


@pytest.mark.parametrize("kind", [0, 1], ids=["suspension", "guidance"])
@pytest.mark.parametrize("group", GROUPS)
def test_train_and_rails_pull_at_each_other_with_one_force_and_one_moment(group, kind, monkeypatch):
    monkeypatch.setattr(f"{__name__}.packed_spans", lambda: system_of(LONG).spans)
    system = system_of(LONG)
    step = middle_step(system)
    gains = [K_P, K_D, K_P, K_D, 0.1, K_I, 0.1, K_I]
    stand = shaken(system, kind, Circuit(group=group, lag="0.8 ms", delay="0.4 ms"), step, gains)
    rows, rail = stand.rows, LONG.guideway.rail
    on_train = np.zeros(LANES)
    moment = np.zeros(LANES)  # about the first pier
    timing = packing.timing(LONG, 0)
    nose = timing.start + timing.speed * step * timing.time_step
    turned = (
        -1.0 if not kind else 1.0
    )  # the arm is the displacement ahead of the centre, or less it
    for row, side in np.ndindex(rows.number.shape):
        sign = rows.outward[side]
        force = -stand.train.force[rows.translation[row, side]]
        # what the kernel leaves out: the static force, which the train's weight balances
        static = sign * rows.static_force[2 * row + side]
        static_turn = sign * rows.static_moment[2 * row + side]
        turn = -stand.train.force[rows.rotation[row, side]]
        on_train += force + static
        moment += (nose + rows.x[row]) * (force + static) + turned * (turn + static_turn)
    spacing = LONG.guideway.span_length / (rail.units_per_span * rail.connectors_per_unit)
    unit = LONG.guideway.span_length / rail.units_per_span
    nodes = np.arange(3 * rail.units_per_span)[:, None] * unit
    nodes = (nodes + rail_nodes(rail.connectors_per_unit) * spacing).ravel()
    pressed = stand.rails.force.sum(axis=0)
    assert np.abs(on_train).min() > 1e3 or kind
    assert_allclose(pressed[::2].sum(axis=0), on_train, rtol=1e-9, atol=1e-4)
    about = nodes @ pressed[::2] + spacing * pressed[1::2].sum(axis=0)
    assert_allclose(about, moment, rtol=1e-9, atol=1e-2)


@pytest.mark.parametrize("kind", [0, 1], ids=["suspension", "guidance"])
def test_poles_give_the_rails_the_power_that_the_gaps_lose(kind, monkeypatch):
    """Force times rate of the mean motion under the face, less what goes with the pole's travel."""
    monkeypatch.setattr(f"{__name__}.packed_spans", lambda: system_of(LONG).spans)
    system = system_of(LONG)
    step = middle_step(system)
    stand = shaken(system, kind, Circuit(), step, [K_P, K_D, K_P, K_D, 0, 0, 0, 0])
    power = (stand.rails.force * stand.rails.rate).sum(axis=(0, 1))
    rates = []
    for factor in (1.0, 0.0):  # with the rails' rate and without, which leaves what travel gives
        stand.rails.rate[:] *= factor
        rates.append(gap_rates_and_pulls(stand, step))
    (rate, pull), (travel, _) = rates
    assert_allclose(((travel - rate) * pull).sum(axis=0), power, rtol=1e-9)


def gap_rates_and_pulls(stand, step):
    """Rate of every pole's gap error and its pull as the kernels have them (pole, LANES)."""
    rates, pulls = [], []
    for row, side in np.ndindex(stand.rows.number.shape):
        see_and_pull(
            stand.footprints, stand.rows, stand.law, row, side, step, stand.dt, stand.gains,
            stand.train, stand.rails, stand.magnet, stand.circuits,
        )  # fmt: skip
        rates.append(stand.magnet.rate.copy())
        pulls.append(stand.magnet.pull.copy())
    return np.concatenate(rates), np.concatenate(pulls)


@numba.njit(error_model="numpy")
def see_and_pull(footprints, rows, law, row, side, step, dt, gains, train, rails, magnet, circuits):
    _magnets._look(footprints, rows, law, row, side, step, train, rails, magnet)
    _magnets._control(rows, law, row, side, step, dt, gains, train, magnet, circuits)
    _magnets._attract(rows, law, row, side, gains, magnet)


def small(group="pole", lag="0 ms", delay="0 ms"):
    """Half size, with the same circuits on both kinds of magnet."""
    circuit = {"group": group, "lag": lag, "delay": delay}
    return half_size(
        passage={"time_step": "0.25 ms"}, control={"suspension": circuit, "guidance": circuit}
    )


@pytest.mark.parametrize("late", ["lag", "delay"])
def test_a_vanishing_lag_or_delay_is_none(late):
    plain = passed(small(), [MEAN], record_every=20).gap_history
    errors = [
        np.abs(
            passed(small(**{late: f"{time} ms"}), [MEAN], record_every=20).gap_history - plain
        ).max()
        for time in (0.04, 0.004, 0.0004)
    ]
    assert errors[0] > 1e-9
    assert_allclose(np.divide(errors[:2], errors[1:]), 10.0, rtol=0.1)


@pytest.mark.parametrize(("lag", "delay"), [("0 ms", "0 ms"), ("0.4 ms", "0.4 ms")])
@pytest.mark.parametrize("group", GROUPS)
def test_a_sample_does_not_know_what_others_feed_back(group, lag, delay):
    """Nor that one of them feeds back the acceleration or an integral."""
    config = small(group, lag, delay)
    own, changes = np.append(MEAN, np.zeros(4)), np.diag([100.0, 1, 1, 1, 0.2, 5e3, 0.2, 5e3])
    alone = passed(config, [own], record_every=20)
    assert not alone.status.any() or group == "half"
    for change in (changes.sum(axis=0), changes[4], changes[5], changes[6]):
        batch = [own + change, own]
        together = passed(config, batch, record_every=20)
        for name in ("girder", "body_z", "body_y", "gap_min", "gap_max", "current_max",
                     "status", "gap_history", "current_history", "girder_history"):  # fmt: skip
            mine, theirs = getattr(alone, name)[0], getattr(together, name)[1]
            assert_array_equal(mine, theirs, err_msg=name)


def test_grouping_of_the_kernels_is_that_of_the_law():
    rows = first_pair()
    for group in GROUPS:
        law, weights = (
            packing.law(Circuit(group=group), rows, 1e-3, np.zeros((1, 8))),
            grouping(group, rows.offset.size),
        )
        drive = np.zeros_like(weights.drive)
        for pole in range(rows.offset.size):
            for circuit in (law.first[pole], law.second[pole]):
                drive[pole, circuit] += 0.5
        assert_array_equal(drive, weights.drive)
