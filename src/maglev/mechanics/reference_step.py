"""One step of the reference solver: Newmark's rule, iterated until the pole forces converge.

Theory: docs/theory/integration.md, "Reference solver".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import SuperLU, splu

from maglev.arrays import BoolArray, FloatArray
from maglev.errors import UserError
from maglev.mechanics import guideway as guideway_model
from maglev.mechanics import train as train_model
from maglev.mechanics.course import course
from maglev.mechanics.irregularity import Profile
from maglev.mechanics.reference_magnets import (
    Charge,
    Circuits,
    Poles,
    Rails,
    Track,
    charged,
    circuits_of,
    failed_poles,
    poles_of,
    resting,
)
from maglev.parameters import Config

BETA, GAMMA = 0.25, 0.5
"""Newmark's parameters [-]: constant average acceleration, unconditionally stable."""

TOLERANCE = 1e-6
"""Largest change of any pole force in the last iteration, as a share of the static force [-].  Each
iteration leaves about a hundredth, so that what remains is some 1e-8."""

MOST_ITERATIONS = 30
"""Largest number of iterations of one step [-]; three or four are usual."""

BLOCK = 64
"""Steps whose view of the track is computed in one block [-]."""

FRESH_TANGENT_EVERY = 6
"""Iterations after which the tangent of the magnets is updated [-]."""


@dataclass
class Motion:
    """Displacement, velocity, acceleration of a structure, each (dof, sample)."""

    x: FloatArray
    v: FloatArray
    a: FloatArray

    @classmethod
    def at_rest(cls, n_dof: int, n_samples: int) -> Motion:
        """Motion of a structure at rest."""
        return cls(*(np.zeros((n_dof, n_samples)) for _ in range(3)))


@dataclass(frozen=True)
class Structure:
    """A linear structure and its equation of motion over one step, M a + C v + K x = f.

    Attributes
    ----------
    mass, damping, stiffness : (dof, dof)
        M, C, K, sparse.
    step
        Δt [s].
    effective : csc (dof, dof)
        M + γ Δt C + β Δt² K, the effective mass for an acceleration at the end of the step.
    factors
        Of the effective mass.
    modes, coefficient : (mode, dof), (mode, 1)
        Damping of low rank on top, Σ c_k m_k m_kᵀ with m_k = M φ_k.
    spread, gathered : (mode, dof), (mode, mode)
        Low-rank part of the inverse, by the formula of Sherman, Morrison and Woodbury.
    """

    mass: sp.csr_array
    damping: sp.csr_array
    stiffness: sp.csr_array
    step: float
    effective: sp.csc_array
    factors: SuperLU
    modes: FloatArray
    coefficient: FloatArray
    spread: FloatArray
    gathered: FloatArray

    def inner(self, motion: Motion) -> FloatArray:
        """C v + K x, (dof, sample) [N, N m]."""
        inner = self.damping @ motion.v + self.stiffness @ motion.x
        if self.coefficient.size:
            inner += self.modes.T @ (self.coefficient * (self.modes @ motion.v))
        return inner

    def acceleration(self, force: FloatArray) -> FloatArray:
        """Acceleration at the end of the step from the residual force of the predicted motion."""
        a = self.factors.solve(force)
        if self.coefficient.size:
            a -= self.spread.T @ (self.gathered @ (self.spread @ force))
        return a

    def dissipated(self, v: FloatArray) -> FloatArray:
        """Power dissipated by damping (sample,) [W]."""
        power = (v * (self.damping @ v)).sum(axis=0)
        if self.coefficient.size:
            power += (self.coefficient * (self.modes @ v) ** 2).sum(axis=0)
        return power

    def predicted(self, before: Motion) -> Motion:
        """Predictor: the motion a step later without its acceleration."""
        h = self.step
        x = before.x + h * before.v + h**2 * (0.5 - BETA) * before.a
        return Motion(x, before.v + h * (1 - GAMMA) * before.a, before.a)

    def moved(self, predicted: Motion, a: FloatArray) -> Motion:
        """Corrector: the motion a step later with its acceleration ``a`` (dof, sample)."""
        h = self.step
        return Motion(predicted.x + BETA * h**2 * a, predicted.v + GAMMA * h * a, a)


def structure(
    mass: sp.csr_array,
    damping: sp.csr_array,
    stiffness: sp.csr_array,
    step: float,
    modal: guideway_model.ModalDamping | None = None,
) -> Structure:
    """A structure with the factors of its effective mass; ``modal`` comes on top of ``damping``."""
    effective = sp.csc_array(mass + GAMMA * step * damping + BETA * step**2 * stiffness)
    factors, none = _factors(effective), np.zeros((0, mass.shape[0]))
    fixed = (mass, damping, stiffness, step, effective, factors)
    if modal is None or modal.coefficient.size == 0:
        return Structure(*fixed, none, np.zeros((0, 1)), none, np.zeros((0, 0)))
    modes = np.ascontiguousarray(modal.mass_shape.T)
    spread = factors.solve(modal.mass_shape)
    inverse = np.diag(1 / (GAMMA * step * modal.coefficient)) + modes @ spread
    spread = np.ascontiguousarray(spread.T)
    return Structure(*fixed, modes, modal.coefficient[:, None], spread, np.linalg.inv(inverse))


def _factors(matrix: sp.csc_array) -> SuperLU:
    """Factors of a matrix with a symmetric pattern and a strong diagonal."""
    options = {"SymmetricMode": True}
    return splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


# --- one step -------------------------------------------------------------------------------------


@dataclass(frozen=True)
class System:
    """Constant data of passages with one step length.

    Attributes
    ----------
    config
        Parameters of everything.
    step
        Δt [s].
    train, guideway
        The structures.
    poles, rails, track, circuits
        Poles of the magnets, rails and track under them, circuits.
    """

    config: Config
    step: float
    train: Structure
    guideway: Structure
    poles: Poles
    rails: Rails
    track: Track
    circuits: Circuits

    @property
    def n_samples(self) -> int:
        """Number of simultaneous passages."""
        return self.circuits.proportional.shape[1]


def system(
    config: Config,
    model: guideway_model.GuidewayModel,
    profile: Profile,
    gains: FloatArray,
    step: float,
) -> System:
    """Constant data of passages with one step length [s] and gains (sample, 8)."""
    train = train_model.build(config.train)
    poles = poles_of(train)
    mass = sp.csr_array(sp.diags_array(train.mass))
    ratio, cutoff = config.guideway.damping_ratio, config.passage.mode_cutoff
    modal = guideway_model.damping(model, ratio, cutoff)
    of_structure = modal.rate * model.mass + model.bearing_damping
    return System(
        config=config,
        step=step,
        train=structure(mass, train.damping, train.stiffness, step),
        guideway=structure(model.mass, of_structure, model.stiffness, step, modal),
        poles=poles,
        rails=Rails(model, poles),
        track=Track(profile, poles),
        circuits=circuits_of(config, poles, gains, step),
    )


@dataclass
class Magnets:
    """Gap [m], current [A] and force [N] of every pole, each (pole, sample)."""

    gap: FloatArray
    current: FloatArray
    force: FloatArray


@dataclass
class State:
    """State of all passages at the end of a step.

    Attributes
    ----------
    train, guideway
        Their motion.
    charge
        The circuits.
    magnets
        The poles.
    on_train, on_guideway : (dof, sample)
        Forces of the magnets beyond those at rest on the train, and of all on the guideway [N].
    before
        Pole forces and the train's accelerations a step ago, to start the iteration.
    tangents
        Factors of the train's effective mass with its magnets closed, one a sample.
    """

    train: Motion
    guideway: Motion
    charge: Charge
    magnets: Magnets
    on_train: FloatArray
    on_guideway: FloatArray
    before: tuple[FloatArray, FloatArray]
    tangents: list[SuperLU]


def at_rest(of: System) -> State:
    """The train in equilibrium on rigid straight track, the guideway unloaded."""
    n_samples = of.n_samples
    ones = np.ones((1, n_samples))
    works = ~failed_poles(of.config, of.poles)[:, None] * ones
    magnets = Magnets(of.poles.gap * ones, of.poles.current * works, of.poles.static_force * works)
    train = Motion.at_rest(of.train.mass.shape[0], n_samples)
    guideway = Motion.at_rest(of.guideway.mass.shape[0], n_samples)
    return State(
        train=train,
        guideway=guideway,
        charge=resting(of.circuits),
        magnets=magnets,
        on_train=np.zeros_like(train.x),
        on_guideway=np.zeros_like(guideway.x),
        before=(magnets.force, train.a),
        tangents=[closed_train(of, magnets, k) for k in range(n_samples)],
    )


def closed_train(of: System, magnets: Magnets, sample: int) -> SuperLU:
    """Factors of the effective mass of the train with its circuits closed, for one sample.

    The effective mass plus the derivative of the magnets' forces by the accelerations at the end
    of the step, at the present gaps.  It affects only the number of iterations.
    """
    h, circuits, opens = of.step, of.circuits, of.poles.opens
    gap, current, force = (x[:, sample] for x in (magnets.gap, magnets.current, magnets.force))
    gap = circuits.force_gap @ gap
    signal = (
        BETA * h**2 * (circuits.proportional + 0.5 * h * circuits.integral)
        + GAMMA * h * circuits.derivative
        + circuits.acceleration
    )[:, sample] * (circuits.newest * circuits.at_once)[:, 0]
    per_current = np.where(current > 0, 2 * force / np.where(current > 0, current, 1.0), 0.0)
    stiffening = sp.diags_array(per_current) @ circuits.drive @ sp.diags_array(signal)
    stiffening = stiffening @ circuits.feed
    softening = sp.diags_array(BETA * h**2 * 2 * force / gap) @ circuits.force_gap
    return _factors(sp.csc_array(of.train.effective + opens.T @ (stiffening - softening) @ opens))


def stepped(of: System, state: State, view: View, running: BoolArray) -> State:
    """One step of Newmark's rule, iterated until the pole forces converge.

    Parameters
    ----------
    of, state
        The system, and its state.
    view
        Rails and track under the poles at the end of the step.
    running : (sample,)
        Samples whose forces must converge.

    Raises
    ------
    UserError
        If the pole forces do not converge.
    """
    train, guideway = of.train.predicted(state.train), of.guideway.predicted(state.guideway)
    inner_train = of.train.inner(train)
    inner_guideway = of.guideway.inner(guideway) if view.reached else state.on_guideway
    known = of.circuits.delayed(state.charge.signals)
    force = 2 * state.magnets.force - state.before[0]
    a_t, a_g = 2 * state.train.a - state.before[1], state.guideway.a
    on_guideway = state.on_guideway
    before = (state.magnets.force, state.train.a)
    tangents = state.tangents
    for iteration in range(1, MOST_ITERATIONS + 1):
        on_train = -(of.poles.opens.T @ (force - of.poles.static_force))
        residual = on_train - inner_train - of.train.effective @ a_t
        a_t = a_t + np.column_stack([t.solve(residual[:, k]) for k, t in enumerate(tangents)])
        if view.reached:
            pull = view.mean.T @ (of.poles.opening[:, None] * force)
            on_guideway = of.rails.ends_transposed @ pull
            a_g = of.guideway.acceleration(on_guideway - inner_guideway)
        now_t, now_g = of.train.moved(train, a_t), of.guideway.moved(guideway, a_g)
        magnets, charge, signal = _magnets(of, state.charge, known, view, now_t, now_g)
        change = np.abs(magnets.force - force) / of.poles.static_force
        force = magnets.force
        if not (change[:, running & held(of, magnets)] > TOLERANCE).any():
            break
        if iteration % FRESH_TANGENT_EVERY == 0:
            tangents = [closed_train(of, magnets, k) for k in range(of.n_samples)]
    else:
        raise UserError(
            f"reference: the pole forces must converge in {MOST_ITERATIONS} iterations a step, and "
            f"did not at t = {view.time:.4f} s; take a smaller step or the production solver"
        )
    charge.signals.append(signal)
    return State(now_t, now_g, charge, magnets, on_train, on_guideway, before, state.tangents)


@dataclass(frozen=True)
class View:
    """Rails and track under the poles at one time.

    Attributes
    ----------
    time
        Time [s].
    bump, bump_rate : (pole, 1)
        Mean irregularity over the faces [m] and its rate [m/s].
    mean, travel : csr (pole, end)
        From `Rails.under`.
    reached
        Whether any face has reached the guideway, which rests until then.
    """

    time: float
    bump: FloatArray
    bump_rate: FloatArray
    mean: sp.csr_array
    travel: sp.csr_array
    reached: bool


def views(of: System, first: int, stop: int) -> Iterator[View]:
    """Rails and track under the poles after steps ``first`` to ``stop``, computed in blocks."""
    speed, n = of.config.passage.speed, of.poles.x.size
    for begin in range(first, stop, BLOCK):
        time = (np.arange(begin, min(begin + BLOCK, stop)) + 1) * of.step
        place = course(of.config).nose(time)[:, None] + of.poles.x
        reached = (place + 0.5 * (of.poles.face + speed * of.step)).max(axis=1) >= 0
        bump, bump_rate = of.track.under(place, speed)
        mean, travel = of.rails.under(place, speed, of.step)
        for k in range(time.size):
            rows = slice(k * n, (k + 1) * n)
            yield View(
                time=float(time[k]),
                bump=bump[k][:, None],
                bump_rate=bump_rate[k][:, None],
                mean=mean[rows],
                travel=travel[rows],
                reached=bool(reached[k]),
            )


def _magnets(
    of: System, before: Charge, known: FloatArray, view: View, train: Motion, guideway: Motion
) -> tuple[Magnets, Charge, FloatArray]:
    """Gaps, currents and forces of the poles under given motions, and the state of the circuits."""
    poles, circuits = of.poles, of.circuits
    opening = poles.opening[:, None]
    error, rate, push = _apart(poles.opens @ np.hstack([train.x, train.v, train.a]), 3)
    if view.reached:
        ends = of.rails.ends @ np.hstack([guideway.x, guideway.v])
        rail, rail_rate = _apart(view.mean @ ends, 2)
        rail_rate = rail_rate + view.travel @ _apart(ends, 2)[0]
        error, rate = error - opening * rail, rate - opening * rail_rate
    error, rate = error - opening * view.bump, rate - opening * view.bump_rate
    signals = _apart(circuits.feed @ np.hstack([error, rate, push]), 3)
    charge, signal = charged(circuits, before, known, *signals)
    gap = poles.gap + error
    current = circuits.drive @ charge.current
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        force = poles.constant * (current / (poles.gap + circuits.force_gap @ error)) ** 2
    return Magnets(gap, current, force), charge, signal


def _apart(side_by_side: FloatArray, n: int) -> list[FloatArray]:
    """Split the columns of one product with a sparse matrix, which is faster than several."""
    return np.split(side_by_side, n, axis=1)


def held(of: System, magnets: Magnets) -> BoolArray:
    """Which samples (sample,) have every gap between contact and loss."""
    passage = of.config.passage
    between = (magnets.gap > passage.gap_contact) & (magnets.gap < passage.gap_lost)
    return np.all(between & np.isfinite(magnets.force), axis=0)
