"""The reference solver: every degree of freedom, Newmark's rule, iteration on the pole forces.

Written to be read and believed, not to be fast.  It shares with the production solver the physical
models of train, guideway and track, and no line of the time integration, the magnets or the
coupling.  Theory: docs/theory/integration.md, "Reference solver".
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.interpolate import CubicHermiteSpline, CubicSpline, PPoly
from scipy.signal import sosfilt
from scipy.sparse.linalg import SuperLU, splu
from tqdm import tqdm

from maglev.mechanics import guideway as guideway_model
from maglev.mechanics import timoshenko
from maglev.mechanics import train as train_model
from maglev.mechanics.control import circuits as grouping_of
from maglev.mechanics.course import first_step, nose, time_step
from maglev.mechanics.course import n_steps as whole_steps
from maglev.mechanics.irregularity import Profile
from maglev.mechanics.responses import (
    GIRDER_RESPONSES,
    Passages,
    acceleration_filter,
    checked_gains,
)
from maglev.parameters import Config

Array = npt.NDArray[np.float64]
IntArray = npt.NDArray[np.int64]

BETA, GAMMA = 0.25, 0.5
"""Newmark's parameters [-]: constant average acceleration, unconditionally stable."""

TOLERANCE = 1e-6
"""Largest change of any pole force in the last iteration, as a share of the static force [-].  Each
iteration leaves about a hundredth, so that what remains is some 1e-8."""

MOST_ITERATIONS = 30
"""Iterations of one step after which the run is given up [-]; three or four are usual."""

BLOCK = 64
"""Steps whose view of the track is found at once [-]."""

FRESH_TANGENT_EVERY = 6
"""Iterations after which the tangent of the magnets is taken anew, where they are [-]."""

FIRST_STEP = 0.36e-3
"""Longest first step [s]: 100 Hz, the upper end of the band, turn by 0.23 in it, which lengthens
their period by 0.4 %; half of it leaves 0.1 %, the tolerance, before extrapolation."""

MOST_HALVINGS = 5
"""Halvings of the first step after which a passage is given up [-]."""

ERROR = 1e-3
"""Largest estimated error of an extreme, as a share of it [-]."""

NEGLIGIBLE = 1e-3
"""Share of the vertical extreme below which a lateral one is not resolved for its own sake [-]."""

RESPONSES = (*GIRDER_RESPONSES, "car_body_acceleration_z", "car_body_acceleration_y")
"""The six responses whose error is estimated."""

_LOG = logging.getLogger(__name__)

_GAUSS = 0.5 + np.array([-0.5, 0.5]) / math.sqrt(3)  # exact for cubics, the shapes of a beam


# --- what the magnets see -------------------------------------------------------------------------


@dataclass(frozen=True)
class Poles:
    """All poles of the train, magnet by magnet and from the front.

    Attributes
    ----------
    magnet : (pole,)
        Number in the train's table of magnets.
    x, face : (pole,)
        Place of the centre relative to the train's nose, and length of the face [m].
    is_guidance, side : (pole,)
        Kind, and +1 right or -1 left.
    opening : (pole,)
        Change of the gap per displacement of the magnet, z or y [-].
    opens : csr (pole, train dof)
        Change of the gap per degree of freedom of the train [-, m].
    static_force, constant : (pole, 1)
        F₀ [N] and K = F₀ (δ₀ / i₀)² [N m²/A²].
    gap, current, current_max : (pole, 1)
        δ₀ [m], i₀ and largest current [A].
    """

    magnet: IntArray
    x: Array
    face: Array
    is_guidance: npt.NDArray[np.bool_]
    side: IntArray
    opening: Array
    opens: sp.csr_array
    static_force: Array
    constant: Array
    gap: Array
    current: Array
    current_max: Array


def poles_of(train: train_model.TrainModel) -> Poles:
    """Every pole of a train and how its gap follows the train's motion."""
    magnets, parameters = train.magnets, train.parameters
    static = train_model.pole_static_force(parameters, magnets)
    kinds = (parameters.suspension_magnet, parameters.guidance_magnet)
    kind = [kinds[int(guides)] for guides in magnets.is_guidance]
    magnet = np.repeat(np.arange(magnets.x.size), [k.n_poles for k in kind])
    ahead = np.concatenate([train_model.pole_offsets(k) for k in kind])
    is_guidance, side = magnets.is_guidance[magnet], magnets.side[magnet]
    opening = np.where(is_guidance, side, 1.0)
    arm = np.where(is_guidance, ahead, -ahead)  # u_y = y + psi dx, u_z = z - theta dx
    number = np.arange(magnet.size)
    dof = np.concatenate([magnets.translation_dof[magnet], magnets.rotation_dof[magnet]])
    opens = sp.csr_array(
        (np.concatenate([opening, opening * arm]), (np.concatenate([number, number]), dof)),
        shape=(number.size, train.mass.size),
    )

    def of_kind(name: str) -> Array:
        return np.where(is_guidance, getattr(kinds[1], name), getattr(kinds[0], name))[:, None]

    static_force = np.concatenate([static[m, : k.n_poles] for m, k in enumerate(kind)])[:, None]
    gap, current = of_kind("gap_reference"), of_kind("current_reference")
    return Poles(
        magnet=magnet,
        x=magnets.x[magnet] + ahead,
        face=of_kind("pole_length")[:, 0],
        is_guidance=is_guidance,
        side=side,
        opening=opening,
        opens=opens,
        static_force=static_force,
        constant=static_force * (gap / current) ** 2,
        gap=gap,
        current=current,
        current_max=of_kind("current_max"),
    )


class Rails:
    """The rails as beam elements: mean of their deflection over a face, and its rate of travel.

    Deflections are written in the elements' own ends: four numbers an element, deflection and turn
    of the section at either end, for both planes of both rails (`ends` reads them off the
    guideway's motion).  Faces are split at the ends of elements, so that joints of units count.
    """

    def __init__(self, model: guideway_model.GuidewayModel, poles: Poles) -> None:
        lines = [
            (line, plane) for line in model.rail_lines for plane in (line.vertical, line.lateral)
        ]
        self.start, self.length = lines[0][0].start, lines[0][0].length
        self.end = model.parameters.length
        self.line = np.where(poles.side > 0, 0, 2) + poles.is_guidance  # as in `lines`
        self.phi = np.stack([plane.phi for _, plane in lines])
        self.face = poles.face
        terms = [plane.dof.shape[2] for _, plane in lines]
        n_rows = sum(4 * plane.phi.size for _, plane in lines)
        row = np.repeat(np.arange(n_rows), np.repeat(terms, [4 * p.phi.size for _, p in lines]))
        share = np.concatenate([plane.share.ravel() for _, plane in lines])
        dof = np.concatenate([plane.dof.ravel() for _, plane in lines])
        self.ends = sp.csr_array((share, (row, dof)), shape=(n_rows, model.n_dof))
        self.ends_transposed = self.ends.T.tocsr()

    def under(self, x: Array, speed: float, step: float) -> tuple[sp.csr_array, sp.csr_array]:
        """Rows of what the faces of poles see of the rails.

        What jumps where a joint passes counts with its mean over one step, so that its impulse does
        not hang on where in a step the joint is met: the difference of a face's edges, and all that
        a point sees.  For what does not jump that is an error of second order, like the step's.

        Parameters
        ----------
        x : (time, pole)
            Places of the poles' centres [m].
        speed, step
            Of the train [m/s], and Δt [s].

        Returns
        -------
        mean : csr (time pole, end)
            Mean deflection over each face, as share of the elements' ends [-, m].
        travel : csr (time pole, end)
            What its rate has because the pole travels [1/s, m/s].
        """
        deflection, slope = timoshenko.deflection_shape, timoshenko.slope_shape
        face, advance = np.tile(self.face, x.shape[0]), speed * step
        x = x.ravel()
        front, rear, point = x + 0.5 * face, x - 0.5 * face, face == 0
        mean = self._mean(deflection, x, np.where(point, advance, face))
        rate = speed / np.where(point, np.inf, face)
        travel = self._mean(deflection, front, advance, rate)
        travel = travel - self._mean(deflection, rear, advance, rate)
        if point.any():
            travel = travel + self._mean(slope, x, advance, np.where(point, speed, 0.0))
        return mean, travel

    def _mean(
        self,
        shape: Callable[..., Array],
        x: Array,
        width: npt.ArrayLike,
        times: npt.ArrayLike = 1.0,
    ) -> sp.csr_array:
        """Rows (pole, end) of a mean over ``width`` around ``x`` [m], nothing off the guideway."""
        width = np.broadcast_to(width, x.shape)
        low, high = (np.clip(x + side * width, 0.0, self.end) for side in (-0.5, 0.5))
        first = np.clip(np.searchsorted(self.start, low, side="right") - 1, 0, None)
        n_pieces = int((np.searchsorted(self.start, high) - first).max(initial=1))
        element = first[:, None] + np.arange(n_pieces)
        inside = element < self.start.size
        element = np.minimum(element, self.start.size - 1)
        origin, L = self.start[element], self.length[element]
        begin = np.clip(origin, low[:, None], high[:, None]) - origin
        piece = np.clip(origin + L, low[:, None], high[:, None]) - origin - begin
        weight = np.where(inside, piece / width[:, None], 0.0)
        weight *= np.broadcast_to(times, x.shape)[:, None]
        line = np.tile(self.line, x.size // self.line.size)[:, None]
        phi = self.phi[line, element]
        share = sum(0.5 * shape(L, phi, begin + at * piece) for at in _GAUSS) * weight[..., None]
        end = 4 * (line * self.start.size + element)[..., None] + np.arange(4)
        pointer = share[0].size * np.arange(x.size + 1)
        return sp.csr_array(
            (share.ravel(), end.ravel(), pointer), shape=(x.size, self.ends.shape[0])
        )


class Track:
    """Irregularity as the faces of the poles see it."""

    def __init__(self, profile: Profile, poles: Poles) -> None:
        grid = profile.x0 + profile.dx * np.arange(profile.values.shape[1])
        self.profiles: list[PPoly] = [
            CubicHermiteSpline(grid, value, slope)
            for value, slope in zip(profile.values, profile.slopes, strict=True)
        ]
        self.sums = [one.antiderivative() for one in self.profiles]
        self.profile = np.where(poles.is_guidance, 2, 0) + np.where(poles.side > 0, 0, 1)
        self.face = poles.face

    def under(self, x: Array, speed: float) -> tuple[Array, Array]:
        """Mean irregularity [m] over each face centred at ``x`` [m] and its rate [m/s].

        All are (time, pole).
        """
        mean, rate = np.empty(x.shape), np.empty(x.shape)
        for number, (profile, total) in enumerate(zip(self.profiles, self.sums, strict=True)):
            at = (self.profile == number) & (self.face == 0)
            mean[:, at], rate[:, at] = profile(x[:, at]), speed * profile(x[:, at], 1)
            at = (self.profile == number) & (self.face > 0)
            place, face = x[:, at], self.face[at]
            front, rear = place + 0.5 * face, place - 0.5 * face
            mean[:, at] = (total(front) - total(rear)) / face
            rate[:, at] = speed * (profile(front) - profile(rear)) / face
        return mean, rate


# --- what the circuits do -------------------------------------------------------------------------


@dataclass(frozen=True)
class Circuits:
    """All circuits of the train for one step length: from gaps to currents.

    Attributes
    ----------
    feed : csr (circuit, pole)
        Weight of each pole's gap in a circuit's signal [-].
    drive : csr (pole, circuit)
        Weight of each circuit's current in a pole's [-].
    force_gap : csr (pole, pole)
        Weight of each pole's gap in the gap that a pole's force goes by [-].
    proportional, derivative, acceleration, integral : (circuit, sample)
        k_p [A/m], k_d [A s/m], k_a [A s²/m], k_i [A/(m s)].
    decay, newest : (circuit, 1)
        A current after a step: ``decay`` times the last, ``newest`` times the newest command, the
        rest times the command before [-].
    taps
        Delay: how many steps back, and with which weight (circuit, 1), a signal counts [-].
    current, current_max : (circuit, 1)
        i₀ and largest command [A].
    step
        Δt [s].
    """

    feed: sp.csr_array
    drive: sp.csr_array
    force_gap: sp.csr_array
    proportional: Array
    derivative: Array
    acceleration: Array
    integral: Array
    decay: Array
    newest: Array
    taps: tuple[tuple[int, Array], ...]
    current: Array
    current_max: Array
    step: float

    def delayed(self, signals: deque[Array]) -> Array:
        """The part of the delayed signal (circuit, sample) [A] that earlier steps decide."""
        total = np.zeros_like(self.proportional)
        for back, weight in self.taps:
            if 0 < back <= len(signals):
                total += weight * signals[-back]
        return total

    @property
    def at_once(self) -> Array:
        """Weight (circuit, 1) of a signal of this step in the delayed signal of this step [-]."""
        return sum((weight for back, weight in self.taps if back == 0), np.zeros_like(self.current))


@dataclass
class Charge:
    """Where the circuits are: each (circuit, sample), at the end of a step.

    Attributes
    ----------
    error, integral
        Gap less its reference [m], and its integral over time [m s].
    command, current
        [A].
    signals
        u of the last steps, the latest last [A].
    """

    error: Array
    integral: Array
    command: Array
    current: Array
    signals: deque[Array]


def delay_taps(delay: float, step: float) -> dict[int, float]:
    """Weights of stored signals that give the signal a delay ago: a cubic through four of them.

    Parameters
    ----------
    delay, step
        Delay and Δt [s].

    Returns
    -------
    taps
        Weight [-] by how many steps back; 0 is the signal of this step.
    """
    back = delay / step
    nodes = max(math.floor(back) - 1, 0) + np.arange(4)
    weights = {}
    for k, node in enumerate(nodes):
        others = np.delete(nodes, k)
        weight = float(np.prod((back - others) / (node - others)))
        if weight != 0.0:
            weights[int(node)] = weight
    return weights


def lag_weights(lag: float, step: float) -> tuple[float, float]:
    """`Circuits.decay` and `Circuits.newest`: exact for a command that is linear within the step.

    Parameters
    ----------
    lag, step
        Time constant and Δt [s].
    """
    if lag == 0:
        return 0.0, 1.0
    decay = math.exp(-step / lag)
    return decay, 1.0 + math.expm1(-step / lag) * lag / step


def circuits_of(config: Config, poles: Poles, gains: Array, step: float) -> Circuits:
    """Circuits of every magnet of the train, in the order of its magnets."""
    magnets = (config.train.suspension_magnet, config.train.guidance_magnet)
    controls = (config.control.suspension, config.control.guidance)
    groups = [grouping_of(c, m.n_poles) for c, m in zip(controls, magnets, strict=True)]
    first = np.flatnonzero(np.diff(poles.magnet, prepend=-1))
    kinds = poles.is_guidance[first].astype(int)
    same = [np.eye(m.n_poles) for m in magnets]
    mean = [np.full((m.n_poles, m.n_poles), 1 / m.n_poles) for m in magnets]
    by = [mean[k] if groups[k].mean_gap_force else same[k] for k in (0, 1)]
    kind = np.concatenate([np.full(groups[k].feed.shape[0], k) for k in kinds])

    def blocks(each: list[Array]) -> sp.csr_array:
        return sp.csr_array(sp.block_diag([each[k] for k in kinds], format="csr"))

    def column(suspension: float, guidance: float) -> Array:
        return np.where(kind == 0, suspension, guidance)[:, None]

    lags = [lag_weights(control.lag, step) for control in controls]
    taps = [delay_taps(control.delay, step) for control in controls]
    of_kind = {"p": gains[:, [0, 2]], "d": gains[:, [1, 3]], "a": gains[:, [4, 6]]}
    of_kind["i"] = gains[:, [5, 7]]
    return Circuits(
        feed=blocks([group.feed for group in groups]),
        drive=blocks([group.drive for group in groups]),
        force_gap=blocks(by),
        proportional=of_kind["p"].T[kind],
        derivative=of_kind["d"].T[kind],
        acceleration=of_kind["a"].T[kind],
        integral=of_kind["i"].T[kind],
        decay=column(lags[0][0], lags[1][0]),
        newest=column(lags[0][1], lags[1][1]),
        taps=tuple(
            (back, column(taps[0].get(back, 0.0), taps[1].get(back, 0.0)))
            for back in sorted(set(taps[0]) | set(taps[1]))
        ),
        current=column(*[magnet.current_reference for magnet in magnets]),
        current_max=column(*[magnet.current_max for magnet in magnets]),
        step=step,
    )


def resting(circuits: Circuits) -> Charge:
    """The circuits before the run: no signal, the currents at their reference."""
    zero = np.zeros_like(circuits.proportional)
    depth = max(back for back, _ in circuits.taps) + 1
    rest = circuits.current + zero
    return Charge(zero, zero.copy(), rest, rest.copy(), deque(maxlen=depth))


def charged(
    circuits: Circuits, before: Charge, known: Array, error: Array, rate: Array, push: Array
) -> tuple[Charge, Array]:
    """The law of control over one step, docs/theory/control.md.

    Parameters
    ----------
    circuits, before
        The circuits, and where they were a step ago.
    known : (circuit, sample)
        From `Circuits.delayed` [A].
    error, rate, push : (circuit, sample)
        Signals now: gap error [m], its rate [m/s], acceleration that opens the gap [m/s²].

    Returns
    -------
    now
        Where the circuits are; its signals are those of ``before``.
    signal : (circuit, sample)
        u, to be stored once the step is found [A].
    """
    integral = before.integral + 0.5 * circuits.step * (before.error + error)
    signal = circuits.proportional * error + circuits.derivative * rate
    signal += circuits.acceleration * push + circuits.integral * integral
    delayed = known + circuits.at_once * signal
    command = np.clip(circuits.current + delayed, 0.0, circuits.current_max)
    current = circuits.decay * before.current + circuits.newest * command
    current += (1.0 - circuits.decay - circuits.newest) * before.command
    return Charge(error, integral, command, current, before.signals), signal


# --- Newmark's rule -------------------------------------------------------------------------------


@dataclass
class Motion:
    """Displacement, velocity, acceleration of a structure, each (dof, sample)."""

    x: Array
    v: Array
    a: Array

    @classmethod
    def at_rest(cls, n_dof: int, n_samples: int) -> Motion:
        """A structure that does not move."""
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
        M + γ Δt C + β Δt² K: what an acceleration at the end of the step meets.
    factors
        Of the effective mass.
    modes, coefficient : (mode, dof), (mode, 1)
        Damping of low rank on top, Σ c_k m_k m_kᵀ with m_k = M φ_k.
    spread, gathered : (mode, dof), (mode, mode)
        What the low rank adds to the inverse, by the formula of Sherman, Morrison and Woodbury.
    """

    mass: sp.csr_array
    damping: sp.csr_array
    stiffness: sp.csr_array
    step: float
    effective: sp.csc_array
    factors: SuperLU
    modes: Array
    coefficient: Array
    spread: Array
    gathered: Array

    def inner(self, motion: Motion) -> Array:
        """C v + K x, (dof, sample) [N, N m]."""
        inner = self.damping @ motion.v + self.stiffness @ motion.x
        if self.coefficient.size:
            inner += self.modes.T @ (self.coefficient * (self.modes @ motion.v))
        return inner

    def acceleration(self, force: Array) -> Array:
        """Acceleration at the end of the step under what the predicted motion leaves over."""
        a = self.factors.solve(force)
        if self.coefficient.size:
            a -= self.spread.T @ (self.gathered @ (self.spread @ force))
        return a

    def dissipated(self, v: Array) -> Array:
        """Power lost to damping (sample,) [W]."""
        lost = (v * (self.damping @ v)).sum(axis=0)
        if self.coefficient.size:
            lost += (self.coefficient * (self.modes @ v) ** 2).sum(axis=0)
        return lost

    def predicted(self, before: Motion) -> Motion:
        """The motion a step later as far as the last acceleration decides it."""
        h = self.step
        x = before.x + h * before.v + h**2 * (0.5 - BETA) * before.a
        return Motion(x, before.v + h * (1 - GAMMA) * before.a, before.a)

    def moved(self, predicted: Motion, a: Array) -> Motion:
        """The motion a step later with the acceleration ``a`` (dof, sample) at its end."""
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
    """All that does not change during a run with one step length.

    Attributes
    ----------
    config
        Parameters of everything.
    step
        Δt [s].
    train, guideway
        The structures.
    poles, rails, track, circuits
        What the magnets are, see and do.
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
        """Passages at the same time."""
        return self.circuits.proportional.shape[1]


def system(
    config: Config,
    model: guideway_model.GuidewayModel,
    profile: Profile,
    gains: Array,
    step: float,
) -> System:
    """Everything for runs with one step length [s] and gains (sample, 8)."""
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

    gap: Array
    current: Array
    force: Array


@dataclass
class State:
    """Where a run is, at the end of a step.

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
    on_train: Array
    on_guideway: Array
    before: tuple[Array, Array]
    tangents: list[SuperLU]


def at_rest(of: System) -> State:
    """The train in equilibrium on rigid straight track, the guideway unloaded."""
    n_samples = of.n_samples
    ones = np.ones((1, n_samples))
    magnets = Magnets(of.poles.gap * ones, of.poles.current * ones, of.poles.static_force * ones)
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
    """Factors of what the train's accelerations meet with the magnets closed, for one sample.

    The effective mass plus the derivative of the magnets' forces to the accelerations at the end of
    the step, where the magnets are; only the way to a step's solution depends on it.
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


def stepped(of: System, state: State, view: View, running: npt.NDArray[np.bool_]) -> State:
    """One step of Newmark's rule, iterated until the pole forces stay.

    Parameters
    ----------
    of, state
        The system, and where it is.
    view
        What the poles see at the end of the step.
    running : (sample,)
        Samples whose forces must stay.

    Raises
    ------
    RuntimeError
        If the forces do not stay.
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
        if not (change[:, running & _held(of, magnets)] > TOLERANCE).any():
            break
        if iteration % FRESH_TANGENT_EVERY == 0:
            tangents = [closed_train(of, magnets, k) for k in range(of.n_samples)]
    else:
        raise RuntimeError(
            f"the pole forces did not converge within {MOST_ITERATIONS} iterations at "
            f"t = {view.time:.4f} s; take a smaller passage.time_step"
        )
    charge.signals.append(signal)
    return State(now_t, now_g, charge, magnets, on_train, on_guideway, before, state.tangents)


@dataclass(frozen=True)
class View:
    """What the poles see at one time.

    Attributes
    ----------
    time
        Which [s].
    bump, bump_rate : (pole, 1)
        Mean irregularity over the faces [m] and its rate [m/s].
    mean, travel : csr (pole, end)
        From `Rails.under`.
    reached
        Whether any face has come to the guideway, which rests until then.
    """

    time: float
    bump: Array
    bump_rate: Array
    mean: sp.csr_array
    travel: sp.csr_array
    reached: bool


def views(of: System, first: int, stop: int) -> Iterator[View]:
    """What the poles see at the end of each step from ``first`` to ``stop``, found in blocks."""
    speed, n = of.config.passage.speed, of.poles.x.size
    for begin in range(first, stop, BLOCK):
        time = (np.arange(begin, min(begin + BLOCK, stop)) + 1) * of.step
        place = nose(of.config, time)[:, None] + of.poles.x
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
    of: System, before: Charge, known: Array, view: View, train: Motion, guideway: Motion
) -> tuple[Magnets, Charge, Array]:
    """Gaps, currents and forces of the poles with given motions, and the circuits behind them."""
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


def _apart(side_by_side: Array, n: int) -> list[Array]:
    """The arrays that stand side by side: one product with a sparse matrix is faster than many."""
    return np.split(side_by_side, n, axis=1)


def _held(of: System, magnets: Magnets) -> npt.NDArray[np.bool_]:
    """Which samples (sample,) have every gap between contact and loss."""
    passage = of.config.passage
    held = (magnets.gap > passage.gap_contact) & (magnets.gap < passage.gap_lost)
    return held.all(axis=0) & np.isfinite(magnets.force).all(axis=0)


# --- a passage ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Energy:
    """Energy account of each passage [J], all from zero at the start.

    Attributes
    ----------
    time : (step,)
    work_on_train, work_on_guideway : (step, sample)
        Work of the magnets' forces beyond those at rest on the train, and of all on the rails.
    dissipated : (step, sample)
        In links, bearings and the guideway's damping.
    stored : (step, sample)
        Kinetic and strain energy of train and guideway.
    """

    time: Array
    work_on_train: Array
    work_on_guideway: Array
    dissipated: Array
    stored: Array


@dataclass
class Fate:
    """How each passage ends, as in `maglev.mechanics.responses.Passages`."""

    status: IntArray
    lost_time: Array
    lost_magnet: IntArray

    @classmethod
    def open(cls, n_samples: int) -> Fate:
        """All running."""
        return cls(
            np.zeros(n_samples, dtype=np.int64),
            np.full(n_samples, np.nan),
            np.full(n_samples, -1, dtype=np.int64),
        )


@dataclass
class Record:
    """Histories of one run, step by step, and how it ended.

    Attributes
    ----------
    time : (step,)
        End of each step [s].
    girder : (step, 4, sample)
        In the order of `GIRDER_RESPONSES` [m, m/s²]; accelerations in their band once finished.
    body_z, body_y : (step, car, sample)
        Accelerations of the car bodies [m/s²].
    gap_min, gap_max, current_max : (step, kind, sample)
        Over all poles of a kind [m, m, A].
    gap, current : (record, magnet, sample)
        Means of magnets, every so many steps [m, A].
    power : (step, 3, sample)
        On the train, on the guideway, and what is dissipated [W].
    stored : (step, sample)
        Energy [J].
    fate
        How it ended.
    """

    time: Array
    girder: Array
    body_z: Array
    body_y: Array
    gap_min: Array
    gap_max: Array
    current_max: Array
    gap: Array
    current: Array
    power: Array
    stored: Array
    fate: Fate


def _blank(of: System, n_steps: int, n_records: int) -> Record:
    """A record of a train at rest."""
    train, n_samples = of.config.train, of.n_samples
    kinds = (train.suspension_magnet, train.guidance_magnet)
    first = np.flatnonzero(np.diff(of.poles.magnet, prepend=-1))
    gap, current = (
        np.array([getattr(kind, name) for kind in kinds])[:, None]
        for name in ("gap_reference", "current_reference")
    )

    def filled(n: int, value: npt.ArrayLike) -> Array:
        value = np.asarray(value)
        return np.zeros((n, value.shape[0], n_samples)) + value

    nothing = np.zeros((train.n_cars, 1))
    return Record(
        time=(np.arange(n_steps) + 1) * of.step,
        girder=filled(n_steps, np.zeros((4, 1))),
        body_z=filled(n_steps, nothing),
        body_y=filled(n_steps, nothing),
        gap_min=filled(n_steps, gap),
        gap_max=filled(n_steps, gap),
        current_max=filled(n_steps, current),
        gap=filled(n_records, of.poles.gap[first]),
        current=filled(n_records, of.poles.current[first]),
        power=filled(n_steps, np.zeros((3, 1))),
        stored=np.zeros((n_steps, n_samples)),
        fate=Fate.open(n_samples),
    )


@dataclass(frozen=True)
class Watch:
    """Where responses are read.

    Attributes
    ----------
    midspan : csr (2, guideway dof)
        Displacement of midspan of the middle span, down and right [-].
    body_z, body_y : (car,)
        Degrees of freedom of the car bodies.
    per_magnet : csr (magnet, pole)
        Mean of the poles of each magnet [-].
    """

    midspan: sp.csr_array
    body_z: IntArray
    body_y: IntArray
    per_magnet: sp.csr_array


def watch(config: Config, model: guideway_model.GuidewayModel, poles: Poles) -> Watch:
    """What is read of a train over a guideway."""
    middle = (config.guideway.n_spans // 2 + 0.5) * config.guideway.span_length
    body = train_model.build(config.train).car_body_dof
    share = 1 / np.bincount(poles.magnet)[poles.magnet]
    return Watch(
        midspan=sp.csr_array(sp.vstack(model.girder_rows(np.array([middle])))),
        body_z=body[:, 1],
        body_y=body[:, 0],
        per_magnet=sp.csr_array((share, (poles.magnet, np.arange(poles.magnet.size)))),
    )


def _note(record: Record, step: int, every: int, of: System, at: Watch, state: State) -> None:
    """Write down what a step has brought."""
    record.girder[step, :2] = at.midspan @ state.guideway.x
    record.girder[step, 2:] = at.midspan @ state.guideway.a
    record.body_z[step], record.body_y[step] = state.train.a[at.body_z], state.train.a[at.body_y]
    gap, current = state.magnets.gap, state.magnets.current
    for kind in range(2):
        of_kind = of.poles.is_guidance == bool(kind)
        record.gap_min[step, kind] = gap[of_kind].min(axis=0)
        record.gap_max[step, kind] = gap[of_kind].max(axis=0)
        record.current_max[step, kind] = current[of_kind].max(axis=0)
    if every and (step + 1) % every == 0:
        row = (step + 1) // every - 1
        record.gap[row], record.current[row] = at.per_magnet @ gap, at.per_magnet @ current


def _power(of: System, state: State) -> Array:
    """Power of the magnets on train and guideway, and what is dissipated [W], (3, sample)."""
    v_t, v_g = state.train.v, state.guideway.v
    lost = of.train.dissipated(v_t) + of.guideway.dissipated(v_g)
    on_train, on_guideway = (
        (state.on_train * v_t).sum(axis=0),
        (state.on_guideway * v_g).sum(axis=0),
    )
    return np.stack([on_train, on_guideway, lost])


def _stored(of: System, state: State) -> Array:
    """Kinetic and strain energy [J], (sample,)."""
    total = np.zeros(of.n_samples)
    for part, motion in ((of.train, state.train), (of.guideway, state.guideway)):
        total += 0.5 * (motion.v * (part.mass @ motion.v)).sum(axis=0)
        total += 0.5 * (motion.x * (part.stiffness @ motion.x)).sum(axis=0)
    return total


def _judge(fate: Fate, of: System, state: State, time: float) -> None:
    """Note which samples lose levitation; what is lost rests from then on."""
    gap, passage = state.magnets.gap, of.config.passage
    lost = (fate.status == 0) & ~_held(of, state.magnets)
    for sample in np.flatnonzero(lost):
        here = gap[:, sample]
        outside = ~((here > passage.gap_contact) & (here < passage.gap_lost))
        pole = int(np.flatnonzero(outside)[0]) if outside.any() else 0
        fate.lost_time[sample], fate.lost_magnet[sample] = time, of.poles.magnet[pole]
        finite = bool(np.isfinite(here).all() and outside.any())
        fate.status[sample] = (1 if here[pole] <= passage.gap_contact else 2) if finite else 3
    if lost.any():
        _rest(state, of, lost)


def _rest(state: State, of: System, which: npt.NDArray[np.bool_]) -> None:
    """Put samples back to rest."""
    still = at_rest(of)
    pairs = [
        (getattr(getattr(state, part), name), getattr(getattr(still, part), name))
        for part, names in (
            ("train", ("x", "v", "a")),
            ("guideway", ("x", "v", "a")),
            ("charge", ("error", "integral", "command", "current")),
            ("magnets", ("gap", "current", "force")),
        )
        for name in names
    ]
    pairs += list(zip(state.before, still.before, strict=True))
    pairs += [(signal, np.zeros_like(signal)) for signal in state.charge.signals]
    for array, rest in pairs:
        array[:, which] = rest[:, which]


def passed(
    config: Config,
    profile: Profile,
    gains: Array,
    step: float,
    n_steps: int,
    *,
    record_every: int = 0,
    energy: bool = False,
    progress: bool = False,
) -> Record:
    """Run one passage per row of gains, all at the same time, with one step length.

    Parameters
    ----------
    config, profile
        Parameters of everything, and the track.
    gains : (sample, 8)
        From `checked_gains`.
    step
        Δt [s].
    n_steps
        Steps from the start of `maglev.mechanics.course` to the end [-].
    record_every
        Steps between recorded gaps and currents of magnets; zero records none.
    energy
        Keep the account of the energy.
    progress
        Show a progress bar.
    """
    model = guideway_model.build(config.guideway)
    of = system(config, model, profile, gains, step)
    at = watch(config, model, of.poles)
    record = _blank(of, n_steps, n_steps // record_every if record_every else 0)
    state, fate = at_rest(of), record.fate
    first = int((first_step(config) - 1) * time_step(config) / step)  # until then nothing moves
    bar = tqdm(total=n_steps - first, disable=not progress, desc="reference", unit="step")
    for number, view in enumerate(views(of, first, n_steps), start=first):
        state = stepped(of, state, view, fate.status == 0)
        _judge(fate, of, state, view.time)
        if fate.status.all():
            break
        _note(record, number, record_every, of, at, state)
        if energy:
            record.power[number], record.stored[number] = _power(of, state), _stored(of, state)
        bar.update()
    bar.close()
    band = acceleration_filter(config.passage, step)
    record.girder[:, 2:] = sosfilt(band, record.girder[:, 2:], axis=0)
    return record


def energy_of(record: Record) -> Energy:
    """The energy account of a run."""
    step = record.time[0]
    before = np.concatenate([np.zeros_like(record.power[:1]), record.power[:-1]])
    work = np.cumsum(0.5 * step * (before + record.power), axis=0)
    return Energy(record.time, *np.moveaxis(work, 1, 0), record.stored)


def integrate(
    config: Config,
    profile: Profile,
    gains: npt.ArrayLike,
    *,
    record_every: int = 0,
    progress: bool = False,
) -> tuple[Passages, Energy]:
    """Run one passage per row of gains with the step of the configuration, its error unknown.

    Parameters
    ----------
    config
        Parameters of everything; the step is `maglev.mechanics.course.time_step`.
    profile
        Track irregularity.
    gains : (sample, 4) or (sample, 8)
        As `maglev.mechanics.responses.checked_gains` takes them.
    record_every
        Steps between recorded rows of the histories; zero records none.
    progress
        Show a progress bar.

    Returns
    -------
    passages
        Extremes, outcomes and histories.
    energy
        Where the energy went.

    Raises
    ------
    ValueError
        If the gains have the wrong shape or are not finite.
    RuntimeError
        If a step does not converge.

    References
    ----------
    Newmark, J. Eng. Mech. Div. ASCE 85(EM3):67-94 (1959).
    """
    gains = checked_gains(gains, config.gains.further)
    record = passed(
        config,
        profile,
        gains,
        time_step(config),
        whole_steps(config),
        record_every=record_every,
        energy=True,
        progress=progress,
    )
    return passages_of(record, record_every), energy_of(record)


@dataclass(frozen=True)
class Effort:
    """What a passage of known error has taken.

    Attributes
    ----------
    step, n_steps
        The shortest step [s], and how many of them a passage has.
    error : (sample, response)
        Estimated error of the extremes, as a share of them [-]; NaN for lost samples.
    seconds
        Time on the clock [s].
    """

    step: float
    n_steps: int
    error: Array
    seconds: float

    @property
    def attributes(self) -> dict[str, float | int]:
        """For a dataset: the step, how many, the largest estimated error, the seconds."""
        return {
            "time_step": self.step,
            "n_steps": self.n_steps,
            "estimated_error": float(_worst(self.error).max()),
            "seconds": self.seconds,
        }


def solve(
    config: Config,
    profile: Profile,
    gains: npt.ArrayLike,
    *,
    tolerance: float = ERROR,
    record_interval: float | None = None,
    progress: bool = False,
) -> tuple[Passages, Effort]:
    """Run one passage per row of gains with steps halved until the extremes stay.

    Newmark's rule is of second order, and so are the histories of a run: of two runs, with Δt and
    Δt/2, a third of the difference is the error of the finer one and is taken off it.  That third
    is also the estimate of what is left, until there are three runs: then what the third run has
    changed is.

    Parameters
    ----------
    config
        Parameters of everything; ``passage.time_step`` only decides where the run starts.
    profile
        Track irregularity.
    gains : (sample, 4) or (sample, 8)
        As `maglev.mechanics.responses.checked_gains` takes them.
    tolerance
        Largest estimated error of an extreme, as a share of it [-].
    record_interval
        Time between recorded rows of the histories, at most [s]; none if not given.
    progress
        Show progress bars.

    Returns
    -------
    passages
        Extremes, outcomes and histories.
    effort
        The step it took, the estimated errors, the seconds.

    Raises
    ------
    ValueError
        If the gains have the wrong shape or are not finite.
    RuntimeError
        If a step does not converge, or if the error is above the tolerance with the shortest step.

    References
    ----------
    Richardson, Phil. Trans. R. Soc. A 210:307-357 (1911).
    """
    began, gains = perf_counter(), checked_gains(gains, config.gains.further)
    own = config.passage.model_copy(update={"time_step": FIRST_STEP})
    step = time_step(config.model_copy(update={"passage": own}))
    n_steps = math.ceil(whole_steps(config) * time_step(config) / step)
    every = max(1, int(record_interval / step * (1 + 1e-9))) if record_interval else 0
    coarse = passed(config, profile, gains, step, n_steps, record_every=every, progress=progress)
    before = None
    for halving in range(1, MOST_HALVINGS + 1):
        n, h, rows = n_steps * 2**halving, step / 2**halving, every * 2**halving
        fine = passed(config, profile, gains, h, n, record_every=rows, progress=progress)
        better = extrapolated(coarse, fine)
        error = _estimated_error(six_extremes(better), six_extremes(fine), before)
        effort = Effort(h, n, error, perf_counter() - began)
        _LOG.info("reference: %s", _told(effort))
        if not (error > tolerance).any():
            return passages_of(better, rows), effort
        coarse, before = fine, six_extremes(better)
    raise RuntimeError(
        f"reference: expected errors of at most {100 * tolerance:g} %, got {_told(effort)}; "
        "raw accelerations may have no limit: give passage.acceleration_band"
    )


def extrapolated(coarse: Record, fine: Record) -> Record:
    """The responses of a run less a third of what they differ from a run with twice its step."""

    def better(name: str) -> Array:
        one, other = getattr(coarse, name), getattr(fine, name)
        correction = (other[1::2] - one) / 3
        return other + CubicSpline(coarse.time, correction)(fine.time)

    lost = np.where(coarse.fate.status != 0, coarse.fate.status, fine.fate.status)
    fate = replace(fine.fate, status=lost) if (lost != fine.fate.status).any() else fine.fate
    changed = {name: better(name) for name in ("girder", "body_z", "body_y")}
    return replace(fine, fate=fate, **changed)


def six_extremes(record: Record) -> Array:
    """Extremes (sample, response): girder as in `GIRDER_RESPONSES`, then largest of the cars."""
    status = record.fate.status
    girder, z, y = (
        extremes(history, record.time, status)[0]
        for history in (record.girder, record.body_z, record.body_y)
    )
    return np.column_stack([girder, z.max(axis=1), y.max(axis=1)])


def _estimated_error(better: Array, fine: Array, before: Array | None) -> Array:
    """Error of extrapolated extremes (sample, response), as a share of them.

    Parameters
    ----------
    better, fine
        With and without extrapolation.
    before
        Extrapolated from steps twice as long, if there were any.
    """
    error = np.abs(better - fine)
    if before is not None:
        error = np.maximum(error / 4, np.abs(better - before))
    companion = better[:, [0, 0, 2, 2, 4, 4]]  # on smooth track nothing moves sideways
    return error / np.maximum(better, NEGLIGIBLE * companion)


def _told(effort: Effort) -> str:
    """An effort in words."""
    shares = ", ".join(
        f"{name} {100 * worst:.2g} %"
        for name, worst in zip(RESPONSES, _worst(effort.error), strict=True)
    )
    return (
        f"estimated errors with a step of {1e3 * effort.step:.4g} ms: {shares} "
        f"({effort.seconds:.0f} s)"
    )


def _worst(error: Array) -> Array:
    """Largest error of each response over the samples that were not lost; 0 if all were."""
    return np.where(np.isnan(error), 0.0, error).max(axis=0)


def passages_of(record: Record, every: int) -> Passages:
    """Extremes, outcomes and every so many steps of the histories of a run."""
    status = record.fate.status
    girder, girder_time = extremes(record.girder, record.time, status)
    body_z, body_z_time = extremes(record.body_z, record.time, status)
    body_y, body_y_time = extremes(record.body_y, record.time, status)
    kept = slice(every - 1, None, every) if every else slice(0, 0)

    def samples_first(history: Array) -> Array:
        return np.moveaxis(history, (0, 1, 2), (2, 1, 0))

    return Passages(
        girder=girder,
        girder_time=girder_time,
        body_z=body_z,
        body_y=body_y,
        body_z_time=body_z_time,
        body_y_time=body_y_time,
        gap_min=record.gap_min.min(axis=0).T,
        gap_max=record.gap_max.max(axis=0).T,
        current_max=record.current_max.max(axis=0).T,
        status=status,
        lost_time=record.fate.lost_time,
        lost_magnet=record.fate.lost_magnet,
        time=record.time[kept],
        girder_history=samples_first(record.girder[kept]),
        body_z_history=samples_first(record.body_z[kept]),
        body_y_history=samples_first(record.body_y[kept]),
        gap_history=samples_first(record.gap),
        current_history=samples_first(record.current),
    )


def extremes(history: Array, time: Array, status: IntArray) -> tuple[Array, Array]:
    """Largest absolute values: vertices of parabolas through three steps.

    Parameters
    ----------
    history : (step, ..., sample)
        What is watched.
    time : (step,)
        Of the steps [s].
    status : (sample,)
        Not zero where levitation was lost.

    Returns
    -------
    value, when : (sample, ...)
        Largest absolute value, and its time [s]; NaN for lost samples.
    """
    size = np.abs(history)
    at = np.clip(size.argmax(axis=0), 1, time.size - 2)[None]
    left, middle, right = (
        np.take_along_axis(history, at + shift, axis=0)[0] for shift in (-1, 0, 1)
    )
    bend, slope = left - 2 * middle + right, 0.5 * (right - left)
    peak = bend != 0
    shift = np.clip(np.where(peak, -slope / np.where(peak, bend, 1.0), 0.0), -1.0, 1.0)
    value = np.abs(middle + shift * (slope + 0.5 * shift * bend)).T.copy()
    when = (time[at[0]] + shift * (time[1] - time[0])).T.copy()
    value[status != 0], when[status != 0] = np.nan, np.nan
    return value, when
