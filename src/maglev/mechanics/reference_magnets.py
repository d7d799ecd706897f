"""Magnets of the reference solver: gaps under pole faces, and circuits.

Theory: docs/theory/control.md and docs/theory/integration.md, "Reference solver".
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from scipy.interpolate import CubicHermiteSpline, PPoly

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.mechanics import guideway as guideway_model
from maglev.mechanics import timoshenko
from maglev.mechanics import train as train_model
from maglev.mechanics.control import circuits as grouping_of
from maglev.mechanics.control import without_current
from maglev.mechanics.irregularity import Profile
from maglev.parameters import Config

_GAUSS = 0.5 + np.array([-0.5, 0.5]) / math.sqrt(3)  # exact for cubics, the shapes of a beam


@dataclass(frozen=True)
class Poles:
    """All poles of the train, magnet by magnet and from the front.

    Attributes
    ----------
    magnet : (pole,)
        Row in the train's table of magnets.
    x, face : (pole,)
        Centre relative to the train's nose, and length of the face [m].
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
    x: FloatArray
    face: FloatArray
    is_guidance: BoolArray
    side: IntArray
    opening: FloatArray
    opens: sp.csr_array
    static_force: FloatArray
    constant: FloatArray
    gap: FloatArray
    current: FloatArray
    current_max: FloatArray


def poles_of(train: train_model.TrainModel) -> Poles:
    """Poles of a train, and their gaps per unit of the train's motion."""
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

    def of_kind(name: str) -> FloatArray:
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
    """The rails as beam elements: mean deflection over a face, and its derivative along travel.

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

    def under(self, x: FloatArray, speed: float, step: float) -> tuple[sp.csr_array, sp.csr_array]:
        """Rows of the mean rail deflection under the faces of poles.

        Terms that jump at joints (the difference between the edges of a face, and all terms of a
        point) are averaged over one step, so that their impulse does not depend on where in the
        step the joint is met.  For smooth terms this is an error of second order, like the step's.

        Parameters
        ----------
        x : (time, pole)
            Positions of the poles' centres [m].
        speed, step
            Of the train [m/s], and Δt [s].

        Returns
        -------
        mean : csr (time pole, end)
            Mean deflection over each face, as share of the elements' ends [-, m].
        travel : csr (time pole, end)
            Part of its rate that is due to travel [1/s, m/s].
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
        shape: Callable[..., FloatArray],
        x: FloatArray,
        width: npt.ArrayLike,
        times: npt.ArrayLike = 1.0,
    ) -> sp.csr_array:
        """Rows (pole, end) of a mean over ``width`` around ``x`` [m]; zero off the guideway."""
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
    """Irregularity averaged over the faces of poles."""

    def __init__(self, profile: Profile, poles: Poles) -> None:
        grid = profile.x0 + profile.dx * np.arange(profile.values.shape[1])
        self.profiles: list[PPoly] = [
            CubicHermiteSpline(grid, value, slope)
            for value, slope in zip(profile.values, profile.slopes, strict=True)
        ]
        self.sums = [one.antiderivative() for one in self.profiles]
        self.profile = np.where(poles.is_guidance, 2, 0) + np.where(poles.side > 0, 0, 1)
        self.face = poles.face

    def under(self, x: FloatArray, speed: float) -> tuple[FloatArray, FloatArray]:
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
        Weight of each pole's gap in the gap that gives a pole's force [-].
    proportional, derivative, acceleration, integral : (circuit, sample)
        k_p [A/m], k_d [A s/m], k_a [A s²/m], k_i [A/(m s)].
    decay, newest : (circuit, 1)
        Weights of the last current and of the newest command in the new current [-]; the rest is
        the weight of the command before.
    taps
        Delay: weight (circuit, 1) of a signal by how many steps back it was stored [-].
    current, current_max : (circuit, 1)
        i₀ and largest command [A].
    step
        Δt [s].
    """

    feed: sp.csr_array
    drive: sp.csr_array
    force_gap: sp.csr_array
    proportional: FloatArray
    derivative: FloatArray
    acceleration: FloatArray
    integral: FloatArray
    decay: FloatArray
    newest: FloatArray
    taps: tuple[tuple[int, FloatArray], ...]
    current: FloatArray
    current_max: FloatArray
    step: float

    def delayed(self, signals: deque[FloatArray]) -> FloatArray:
        """Part of the delayed signal (circuit, sample) [A] due to earlier steps."""
        total = np.zeros_like(self.proportional)
        for back, weight in self.taps:
            if 0 < back <= len(signals):
                total += weight * signals[-back]
        return total

    @property
    def at_once(self) -> FloatArray:
        """Weight (circuit, 1) of the signal of this step in the delayed signal [-]."""
        return sum((weight for back, weight in self.taps if back == 0), np.zeros_like(self.current))


@dataclass
class Charge:
    """State of the circuits at the end of a step, each (circuit, sample).

    Attributes
    ----------
    error, integral
        Gap less its reference [m], and its integral over time [m s].
    command, current
        [A].
    signals
        u of the last steps, the latest last [A].
    """

    error: FloatArray
    integral: FloatArray
    command: FloatArray
    current: FloatArray
    signals: deque[FloatArray]


def delay_taps(delay: float, step: float) -> dict[int, float]:
    """Weights of stored signals in the delayed signal: a cubic through four of them.

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
    """`Circuits.decay` and `Circuits.newest`, exact for a command linear within the step.

    Parameters
    ----------
    lag, step
        Time constant and Δt [s].
    """
    if lag == 0:
        return 0.0, 1.0
    decay = math.exp(-step / lag)
    return decay, 1.0 + math.expm1(-step / lag) * lag / step


def circuits_of(config: Config, poles: Poles, gains: FloatArray, step: float) -> Circuits:
    """Circuits of every magnet of the train, in the order of its magnets."""
    magnets = (config.train.suspension_magnet, config.train.guidance_magnet)
    controls = (config.control.suspension, config.control.guidance)
    groups = [grouping_of(c, m.n_poles) for c, m in zip(controls, magnets, strict=True)]
    first = np.flatnonzero(np.diff(poles.magnet, prepend=-1))
    failed = failed_poles(config, poles)[first]
    kinds = poles.is_guidance[first].astype(int)
    same = [np.eye(m.n_poles) for m in magnets]
    mean = [np.full((m.n_poles, m.n_poles), 1 / m.n_poles) for m in magnets]
    by = [mean[k] if groups[k].mean_gap_force else same[k] for k in (0, 1)]
    kind = np.concatenate([np.full(groups[k].feed.shape[0], k) for k in kinds])
    works = ~np.repeat(failed, [groups[k].feed.shape[0] for k in kinds])[:, None]

    def blocks(each: list[FloatArray]) -> sp.csr_array:
        return sp.csr_array(sp.block_diag([each[k] for k in kinds], format="csr"))

    def column(suspension: float, guidance: float) -> FloatArray:
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
        current_max=works * column(*[magnet.current_max for magnet in magnets]),
        step=step,
    )


def failed_poles(config: Config, poles: Poles) -> BoolArray:
    """Which poles (pole,) belong to magnets without current."""
    first = np.flatnonzero(np.diff(poles.magnet, prepend=-1))
    failed = np.zeros(first.size, dtype=bool)
    for guidance, circuit in enumerate((config.control.suspension, config.control.guidance)):
        of_kind = np.flatnonzero(poles.is_guidance[first] == bool(guidance))
        x = np.array([poles.x[poles.magnet == poles.magnet[first[k]]].mean() for k in of_kind])
        side = poles.side[first[of_kind]]
        failed[of_kind] = without_current(circuit, x, side, guidance=bool(guidance))
    return failed[np.cumsum(np.diff(poles.magnet, prepend=poles.magnet[0]) != 0)]


def resting(circuits: Circuits) -> Charge:
    """State of the circuits before the passage: no signal, currents at their reference."""
    zero = np.zeros_like(circuits.proportional)
    depth = max(back for back, _ in circuits.taps) + 1
    rest = np.minimum(circuits.current, circuits.current_max) + zero
    return Charge(zero, zero.copy(), rest, rest.copy(), deque(maxlen=depth))


def charged(
    circuits: Circuits,
    before: Charge,
    known: FloatArray,
    error: FloatArray,
    rate: FloatArray,
    push: FloatArray,
) -> tuple[Charge, FloatArray]:
    """The law of control over one step, docs/theory/control.md.

    Parameters
    ----------
    circuits, before
        The circuits, and their state a step ago.
    known : (circuit, sample)
        From `Circuits.delayed` [A].
    error, rate, push : (circuit, sample)
        Signals now: gap error [m], its rate [m/s], acceleration that opens the gap [m/s²].

    Returns
    -------
    now
        New state of the circuits; its signals are those of ``before``.
    signal : (circuit, sample)
        u, to be stored once the step has converged [A].
    """
    integral = before.integral + 0.5 * circuits.step * (before.error + error)
    signal = circuits.proportional * error + circuits.derivative * rate
    signal += circuits.acceleration * push + circuits.integral * integral
    delayed = known + circuits.at_once * signal
    command = np.clip(circuits.current + delayed, 0.0, circuits.current_max)
    current = circuits.decay * before.current + circuits.newest * command
    current += (1.0 - circuits.decay - circuits.newest) * before.command
    return Charge(error, integral, command, current, before.signals), signal
