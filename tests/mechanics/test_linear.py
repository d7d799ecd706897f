"""The linearised train against an assembly of its own, closed forms and an integration in time.

`Row` builds one car from the tables of its bodies, links and magnets: every mass a lump with the
motion of its place, bogies counted from their middles at deck level, a mass matrix that is not
diagonal, one current for each circuit.  Nothing comes from the package but what is tested.
"""

import functools

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose
from pydantic import ValidationError
from scipy.optimize import brentq

from maglev.mechanics import linear
from maglev.mechanics.train import build
from maglev.parameters import Circuit, Control, Train

G = 9.80665  # m/s²
SPACING = 3.096  # m, of C-frames
GAP, CURRENT = 0.010, 25.0  # m, A, at rest, of both kinds
MEAN = np.array([3500.0, 17.5, 4500.0, 17.5, 0.0, 0.0, 0.0, 0.0])
K_P, K_D, GUIDANCE_K_P, GUIDANCE_K_D = range(4)
K_A, K_I = [4, 6], [5, 7]


class Row:
    """One car from its tables, all motions as rows of one vector of coordinates."""

    def __init__(self):
        self.number = {}
        stations = [10.836 - SPACING * k for k in range(8)]
        masses, links, self.weight_rows = [], [], []
        body = functools.partial(self.motion, "body", (0.0, 0.0, -1.5), "body.phi", 0.0)
        masses += [(39_000, body((0, 0, -1.5))[1:]), (65e3, [self.unit("body.phi")])]
        masses += [(2e6, [self.unit("body.theta")]), (2e6, [self.unit("body.psi")])]
        self.weight_rows.append((39_000, body((0, 0, -1.5))[2]))
        frames = []
        for k, x in enumerate(stations):
            name, middle = f"bogie{k // 2}", (9.288 - 6.192 * (k // 2), 0.0, 0.0)
            # C-frames roll about the height of their own lateral mass: rods alone are off the deck.
            axis = -2 * 50 * 0.5 / (1100 + 2 * 50 + 2 * 600 * (0.5 if k in (0, 7) else 1.0))
            frame = functools.partial(self.motion, name, middle, f"{name}.phi{k % 2}", axis)
            frames.append(frame)
            own = 3500 - 1100 * (SPACING / 2) ** 2  # half a bogie's about its own C-frame
            masses += [
                (1100, frame((x, 0, 0))[1:]),
                (1000, [self.unit(f"{name}.phi{k % 2}")]),
                (own, [self.unit(f"{name}.theta")]),
                (own, [self.unit(f"{name}.psi")]),
            ]
            self.weight_rows.append((1100, frame((x, 0, 0))[2]))
            if k % 2:
                twist = self.unit(f"{name}.phi0") - self.unit(f"{name}.phi1")
                links.append((twist, 1e6, 1e3))
            for side in (1, -1):
                pivot, end = (x, 1.2 * side, -0.5), (x, 1.2 * side, 0.0)
                masses.append((50, frame(pivot)))
                self.weight_rows.append((50, frame(pivot)[2]))
                rod, hangs = self.unit(f"rod{k}{side}"), 39_000 * G / 16 * 0.5
                masses.append((8, [rod]))
                links += [
                    (body(end)[2] - frame(end)[2], 2e5, 5e3),
                    (frame(pivot)[1] - 0.5 * rod - body(end)[1], 2e5, 300.0),
                    (rod, hangs, 0.0),
                    (rod - self.unit(f"{name}.phi{k % 2}"), 0.0, 10.0),
                    (frame(pivot)[1] - body(pivot)[1], 0.0, 3e3),
                ]
        self.magnets = []
        for kind, y, z, mass, inertia, k_end in (
            (0, 1.1, 0.0, 600, 480, 1.2e7),
            (1, 1.465, 0.18, 390, 310, 5e6),
        ):
            for side in (1, -1):
                for k in range(7):
                    shift, turn = self.unit(f"m{kind}{side}{k}"), self.unit(f"turn{kind}{side}{k}")
                    masses += [(mass, [shift]), (inertia, [turn])]
                    if kind == 0:
                        self.weight_rows.append((mass, shift))
                    for frame, x, ahead in (
                        (frames[k], stations[k], SPACING / 2),
                        (frames[k + 1], stations[k + 1], -SPACING / 2),
                    ):
                        u_x, u_y, u_z = frame((x, side * y, z))
                        own = shift + ahead * turn if kind else shift - ahead * turn
                        links.append((own - (u_y if kind else u_z), k_end, 1e4))
                        carried = [u_x, u_z] if kind else [u_x, u_y]
                        masses.append((mass / 2, carried))
                        if kind == 1:
                            self.weight_rows.append((mass / 2, u_z))
                    self.magnets.append((kind, shift, turn))
        self.n = len(self.number)
        wide = self._wide
        self.mass = sum(m * np.outer(wide(r), wide(r)) for m, rows in masses for r in rows)
        self.stiffness = sum(k * np.outer(wide(r), wide(r)) for r, k, _ in links)
        self.damping = sum(c * np.outer(wide(r), wide(r)) for r, _, c in links)
        self.weight = sum(m * G * wide(r) for m, r in self.weight_rows)
        self.poles = [self._poles(kind, shift, turn) for kind, shift, turn in self._carrying()]

    def unit(self, name):
        row = np.zeros(150)
        row[self.number.setdefault(name, len(self.number))] = 1.0
        return row

    def motion(self, name, middle, phi, axis, place):
        """Motion in x, y, z of a place on a body with a middle, all three as rows."""
        dx, dy, dz = np.subtract(place, middle)
        y, z, theta, psi = (self.unit(f"{name}.{d}") for d in ("y", "z", "theta", "psi"))
        phi = self.unit(phi)
        return theta * dz - psi * dy, y - phi * (dz - axis) + psi * dx, z + phi * dy - theta * dx

    def _wide(self, row):
        return row[: self.n]

    def _carrying(self):
        """Magnets with what they carry at rest: hold all, hang the rest on them."""
        held = np.array([np.flatnonzero(r)[0] for _, s, t in self.magnets for r in (s, t)])
        free = np.setdiff1d(np.arange(self.n), held)
        sag = np.zeros(self.n)
        sag[free] = np.linalg.solve(self.stiffness[np.ix_(free, free)], self.weight[free])
        self.carried = self.weight - self.stiffness @ sag
        return self.magnets

    def _poles(self, kind, shift, turn):
        """Rows of the gaps of a magnet's poles and their forces at rest."""
        n, pitch = (3, 1.032) if kind else (12, 0.258)
        ahead = pitch * ((n - 1) / 2 - np.arange(n))
        gaps = np.array([self._wide(shift + a * turn if kind else shift - a * turn) for a in ahead])
        if kind:
            return kind, gaps, np.full(n, 10e3 / n)
        force = self.carried[np.flatnonzero(shift)[0]]
        moment = -self.carried[np.flatnonzero(turn)[0]]
        half = moment / np.abs(ahead).sum()
        return kind, gaps, force / n + half * np.sign(ahead)

    def closed(self, groups):
        """Attraction, and for each circuit its kind, signal row and forces by its current."""
        attraction, of_circuits = np.zeros((self.n, self.n)), []
        for kind, gaps, force in self.poles:
            n, group = len(force), groups[kind]
            felt = np.tile(gaps.mean(axis=0), (n, 1)) if group == "lumped" else gaps
            attraction -= gaps.T @ (2 * force[:, None] / GAP * felt)
            if group == "pole":
                members, signals = np.eye(n), gaps
            elif group in ("lumped", "magnet"):
                members, signals = np.ones((1, n)), gaps.mean(axis=0)[None]
            else:
                front = np.ones(n)
                front[n // 2 :] = 0.0
                if n % 2:
                    front[n // 2] = 0.5
                members = np.array([front, 1 - front])
                means = members @ gaps / members.sum(axis=1)[:, None]
                signals = gaps[[0, -1]] if group == "ends" else means
            for member, signal in zip(members, signals, strict=True):
                of_circuits.append((kind, signal, gaps.T @ (member * 2 * force / CURRENT)))
        return attraction, of_circuits

    def matrices(self, groups):
        """Stiffness with attraction; kinds, signals (circuit, n) and pulls (n, circuit)."""
        attraction, of_circuits = self.closed(groups)
        kinds, signals, pulls = (np.array(one) for one in zip(*of_circuits, strict=True))
        return self.stiffness + attraction, kinds, signals, pulls.T

    def growth(self, groups, gains, lags=None):
        """Rightmost real part; where currents lag, each circuit has a current of its own."""
        stiffness, kinds, signals, pulls = self.matrices(groups)
        k_p, k_d, k_a, k_i = (gains[[a, b]][kinds] for a, b in ((0, 2), (1, 3), K_A, K_I))
        n, m = self.n, len(kinds)
        fed = np.hstack([k_p[:, None] * signals, k_d[:, None] * signals])
        if lags is None:
            inverse = np.linalg.inv(self.mass + pulls @ (k_a[:, None] * signals))
            with_integral = [-inverse @ pulls * k_i]
            force = -np.hstack([stiffness, self.damping]) - pulls @ fed
            rows = [
                np.hstack([np.zeros((n, n)), np.eye(n), np.zeros((n, m))]),
                np.hstack([inverse @ force, *with_integral]),
                np.hstack([signals, np.zeros((m, n + m))]),
            ]
        else:
            inverse, lag = np.linalg.inv(self.mass), np.array(lags)[kinds][:, None]
            moved = np.hstack(
                [-inverse @ np.hstack([stiffness, self.damping, pulls]), np.zeros((n, m))]
            )
            command = np.hstack([fed, -np.eye(m), np.diag(k_i)]) + k_a[:, None] * (signals @ moved)
            rows = [
                np.hstack([np.zeros((n, n)), np.eye(n), np.zeros((n, 2 * m))]),
                moved,
                command / lag,
                np.hstack([signals, np.zeros((m, n + 2 * m))]),
            ]
        roots = np.linalg.eigvals(np.vstack(rows))
        # Integrals that no force goes by, or that others repeat, stay where they are.
        return roots[np.abs(roots) > 1e-4].real.max()

    def pushed_root(self, groups, gains, delay, dt=5e-5, duration=4.0):
        """Root of the motion that a push on the four outer magnets ends up in, stepped in time.

        The state goes by the exponential of its matrix, the delayed signal in straight lines.
        """
        stiffness, kinds, signals, pulls = self.matrices(groups)
        k_p, k_d = (gains[[a, b]][kinds][:, None] for a, b in ((0, 2), (1, 3)))
        n, m, late = self.n, len(kinds), round(delay / dt)
        inverse = np.linalg.inv(self.mass)
        whole = np.zeros((2 * n + 2 * m, 2 * n + 2 * m))
        whole[:n, n : 2 * n] = np.eye(n)
        whole[n : 2 * n, :n], whole[n : 2 * n, n : 2 * n] = (
            -inverse @ stiffness,
            -inverse @ self.damping,
        )
        whole[n : 2 * n, 2 * n : 2 * n + m] = -inverse @ pulls
        whole[2 * n : 2 * n + m, 2 * n + m :] = np.eye(m) / dt
        step = scipy.linalg.expm(whole * dt)[: 2 * n]
        fed = np.hstack([k_p * signals, k_d * signals])
        state, past = np.zeros(2 * n), np.zeros((late + 1, m))
        for magnet in ("m010", "m016", "m0-10", "m0-16"):
            state[n + self.number[magnet]] = 1.0
        seen, n_steps = [], round(duration / dt)
        for k in range(n_steps):
            past[k % (late + 1)] = fed @ state
            old, new = past[(k + 1) % (late + 1)], past[(k + 2) % (late + 1)]
            state = step @ np.concatenate([state, old, new - old])
            seen.append(state[self.number["m010"]])
        # A sum of six exponentials, every 2 ms, of which the largest is left.
        last = np.array(seen[n_steps // 2 :: 40])
        terms = np.column_stack([last[k : k - 6] for k in range(5, -1, -1)])
        recursion = np.linalg.lstsq(terms, last[6:], rcond=None)[0]
        turns = np.roots([1.0, *-recursion]).astype(complex)
        return np.log(turns[np.abs(turns).argmax()]) / (40 * dt)


@functools.cache
def row():
    return Row()


@functools.cache
def train(n_cars):
    return build(Train(n_cars=n_cars))


def control(suspension, guidance, lags=(0.0, 0.0), delays=(0.0, 0.0)):
    kinds = zip((suspension, guidance), lags, delays, strict=True)
    suspension, guidance = (
        Circuit(group=group, lag=f"{lag} s", delay=f"{delay} s") for group, lag, delay in kinds
    )
    return Control(suspension=suspension, guidance=guidance)


def moved(gains, **values):
    out = np.array(gains)
    for name, value in values.items():
        out[globals()[name]] = value
    return out


def one_magnet(force, mass, lag=0.0, delay=0.0):
    """One magnet that carries a force, between nothing but its track and its load."""
    loop = linear.Loop(np.array([0]), np.array([[2 * force / CURRENT]]), lag, delay)
    none = linear.Loop(np.zeros(0, dtype=int), np.zeros((1, 0)), 0.0, 0.0)
    shape, mass, still = np.eye(1), np.array([mass]), np.zeros((1, 1))
    return (linear.Block(shape, mass, still, np.array([[-2 * force / GAP]]), (loop, none)),)


FURTHER = np.array([3500.0, 17.5, 4500.0, 17.5, 0.05, 0.02, 2000.0, 3000.0])[
    [0, 1, 2, 3, 4, 6, 5, 7]
]


def test_masses_stiffness_and_damping_are_those_of_the_tables():
    attraction, kinds, signals, pulls = row().matrices(("pole", "pole"))
    k_p = MEAN[[K_P, GUIDANCE_K_P]][kinds]
    expected = scipy.linalg.eigh(attraction + pulls * k_p @ signals, row().mass, eigvals_only=True)
    mass, stiffness, _ = linear.closed_train(train(1), MEAN)
    assert_allclose(scipy.linalg.eigh(stiffness, mass, eigvals_only=True), expected, rtol=1e-9)


@pytest.mark.parametrize("lags", [None, (3e-3, 2e-3)], ids=["no lag", "lag"])
@pytest.mark.parametrize("gains", [MEAN, FURTHER], ids=["k_p, k_d", "k_a, k_i too"])
@pytest.mark.parametrize(
    "groups", [("ends", "pole"), ("half", "half"), ("lumped", "lumped")], ids="-".join
)
def test_rightmost_root_is_that_of_an_assembly_of_its_own(groups, gains, lags):
    parts = linear.blocks(train(1), control(*groups, lags or (0.0, 0.0)))
    assert_allclose(linear.growth_rate(parts, gains), row().growth(groups, gains, lags), rtol=1e-5)


@pytest.mark.parametrize("gains", [MEAN, moved(MEAN, K_P=2000.0)], ids=["holds", "falls"])
def test_every_pole_with_a_circuit_of_its_own_has_the_same_rightmost_root(gains):
    parts = linear.blocks(train(1), control("pole", "pole"))
    assert_allclose(
        linear.growth_rate(parts, gains), row().growth(("pole", "pole"), gains), rtol=1e-6
    )


@pytest.mark.parametrize("n_cars", [1, 2])
def test_blocks_have_the_roots_of_the_whole_train_and_no_others(n_cars):
    parts = linear.blocks(train(n_cars), control("half", "ends"))
    mass, stiffness, damping = linear.closed_train(train(n_cars), FURTHER, control("half", "ends"))
    n, inverse = len(mass), np.linalg.inv(mass)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    gains = moved(FURTHER, K_I=0.0)
    roots = np.concatenate([np.linalg.eigvals(linear.state_matrix(part, gains)) for part in parts])
    whole = np.linalg.eigvals(state)
    assert sum(part.mass.size for part in parts) == n
    for power in (1, 2, 3):  # sums of powers, as near roots have no order
        assert_allclose(
            (roots**power).sum(), np.trace(np.linalg.matrix_power(state, power)), rtol=1e-9
        )
    assert_allclose(roots.real.max(), whole.real.max(), rtol=1e-6)
    assert max(part.mass.size for part in parts) < 0.3 * n


@pytest.mark.parametrize("factor", [1.0, 1.4])
@pytest.mark.parametrize(
    ("groups", "growth"), [(("magnet", "pole"), 41.3), (("pole", "magnet"), 15.3)]
)
def test_one_signal_a_magnet_with_forces_pole_by_pole_grows_whatever_the_gains(
    groups, growth, factor
):
    assert_allclose(row().growth(groups, factor * MEAN), growth, rtol=5e-3)
    with pytest.raises(
        ValidationError, match="the motion grows by about 42 1/s whatever the gains"
    ):
        Circuit(group="magnet")


@pytest.mark.parametrize("n_cars", [1, 2])
@pytest.mark.parametrize(
    ("groups", "gain", "expected"),
    [
        (("pole", "pole"), K_P, 2500.0),
        (("ends", "ends"), K_P, 2500.0),
        (("lumped", "lumped"), K_P, 2500.0),
        (("pole", "pole"), GUIDANCE_K_P, 2500.0),
        (("ends", "ends"), GUIDANCE_K_P, 2500.0),
    ],
)
def test_static_border_is_the_current_over_the_gap(groups, gain, expected, n_cars):
    parts = linear.blocks(train(n_cars), control(*groups))
    assert_allclose(linear.border(parts, MEAN, gain, 1000.0), expected, atol=1e-3)


@pytest.mark.parametrize(
    ("gain", "expected"), [(K_P, (3115.2, 3097.4)), (GUIDANCE_K_P, (3489.9, 3508.8))]
)
def test_border_of_halves_lies_higher_and_is_that_of_an_assembly_of_its_own(gain, expected):
    groups = ("half", "half")
    for n_cars, value in zip((1, 2), expected, strict=True):
        parts = linear.blocks(train(n_cars), control(*groups))
        assert_allclose(linear.border(parts, MEAN, gain, 1000.0), value, atol=0.1)
    for factor, grows in ((1 - 1e-4, True), (1 + 1e-4, False)):
        gains = MEAN.copy()
        gains[gain] = factor * expected[0]
        assert (row().growth(groups, gains) > 0) == grows


@pytest.mark.parametrize(
    ("lag", "gain", "limit", "expected"),
    [(2e-3, K_D, 0.0, 4.83), (2e-3, K_P, 20e3, 13147.0), (3e-3, GUIDANCE_K_D, 0.0, 7.01)],
)
def test_lag_brings_a_second_border_of_the_gains(lag, gain, limit, expected):
    groups = ("pole", "pole")
    parts = linear.blocks(train(1), control(*groups, (lag, lag)))
    found = linear.border(parts, MEAN, gain, limit)
    assert_allclose(found, expected, rtol=2e-3)
    outwards = np.sign(limit - MEAN[gain])
    for side, grows in ((1e-3, True), (-1e-3, False)):
        gains = MEAN.copy()
        gains[gain] = found * (1 + outwards * side)
        rate = row().growth(groups, gains, (lag, lag))
        assert (rate > 0) == grows


def test_a_search_for_a_border_starts_where_the_train_is_stable_and_may_find_none():
    parts = linear.blocks(train(1), control("pole", "pole"))
    assert np.isnan(linear.border(parts, MEAN, K_D, 100.0))
    with pytest.raises(ValueError, match="must be stable where the search starts, grows by"):
        linear.border(parts, moved(MEAN, K_P=2000.0), K_P, 1000.0)


@pytest.mark.parametrize(("force", "mass"), [(600 * G, 600), (39.6e3, 600), (10e3, 390)])
@pytest.mark.parametrize(("k_p", "k_d"), [(3500.0, 17.5), (3500.0, 10.0), (4500.0, 17.5)])
def test_one_magnet_with_a_lag_is_stable_below_derivative_over_proportional_gain(
    force, mass, k_p, k_d
):
    # τ m s³ + m s² + 2F (k_d / i0 - τ / gap) s + 2F (k_p / i0 - 1 / gap): Routh's condition
    gains = moved(MEAN, K_P=k_p, K_D=k_d)
    for factor, grows in ((1 - 1e-6, False), (1 + 1e-6, True)):
        magnet = one_magnet(force, mass, lag=factor * k_d / k_p)
        assert (linear.growth_rate(magnet, gains) > 0) == grows


@pytest.mark.parametrize(
    ("k_p", "k_d", "k_a", "lag", "milliseconds"),
    [
        (3500.0, 17.5, 0.0, 0.0, 4.743),
        (3500.0, 10.0, 0.0, 0.0, 2.814),
        (3500.0, 17.5, 0.05, 0.0, 5.149),
        (3500.0, 17.5, 0.05, 2e-3, 3.157),
    ],
)
def test_one_magnet_with_a_delay_is_stable_up_to_the_crossing_of_the_axis(
    k_p, k_d, k_a, lag, milliseconds
):
    # m s² - 2F/gap + 2F/i0 (k_p + k_d s + k_a s²) exp(-T s) / (1 + τ s) = 0 at s = iω: its size
    # gives ω, its angle T.  With k_a and no lag the equation is neutral.
    force, mass = 39_557.0, 600.0

    def answer(w):
        return 2 * force / CURRENT * (k_p - k_a * w**2 + 1j * k_d * w) / (1 + 1j * lag * w)

    w = brentq(lambda w: abs(answer(w)) - (mass * w**2 + 2 * force / GAP), 20.0, 500.0)
    critical = np.angle(answer(w)) / w
    assert_allclose(1e3 * critical, milliseconds, atol=5e-3)
    gains = moved(MEAN, K_P=k_p, K_D=k_d, K_A=k_a)
    magnet = one_magnet(force, mass, lag, critical)
    assert_allclose(linear.rightmost(magnet[0], gains), 1j * w, atol=1e-9 * w)
    for factor, grows in ((1 - 1e-6, False), (1 + 1e-6, True)):
        magnet = one_magnet(force, mass, lag, factor * critical)
        assert (linear.growth_rate(magnet, gains) > 0) == grows


@pytest.mark.parametrize(("groups", "delay"), [(("pole", "pole"), 5e-3), (("ends", "ends"), 4e-3)])
def test_growth_with_a_delay_is_that_of_the_motion_in_time(groups, delay):
    parts = linear.blocks(train(1), control(*groups, delays=(delay, delay)))
    body_z = train(1).car_body_dof[0, 1]
    (heave,) = (part for part in parts if np.abs(part.shape[body_z]).max() > 0)
    found, stepped = linear.rightmost(heave, MEAN), row().pushed_root(groups, MEAN, delay)
    assert_allclose(found.imag, abs(stepped.imag), rtol=2e-5)
    assert_allclose(found.real, stepped.real, atol=0.01)
    assert found.real > 1.0  # 1/s, while the other roots of this block die out


def test_a_delay_as_long_as_the_signal_takes_more_nodes_and_meets_its_root():
    # A slow magnet: 80 ms of delay with a fast signal, many turns of the exponential.
    magnet = one_magnet(10e3, 390.0, delay=0.08)
    root = linear.rightmost(magnet[0], MEAN)
    matrix, _ = linear.characteristic(magnet[0], MEAN, root)
    assert abs(matrix[0, 0]) < 1e-9 * 390.0 * abs(root) ** 2
