"""The train linearised about rest on a rigid track, its circuits closed by any control.

Its motion q obeys (M s² + C s + K + Σ h(s) G) q = 0, one term for each kind of magnet, where

    h(s) = (k_p + k_d s + k_a s² + k_i / s) exp(-T s) / (1 + τ s).

A train is symmetric from side to side and from end to end, so the equation falls apart into small
blocks.  Theory: docs/theory/control.md.
"""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import scipy.linalg
from scipy.optimize import brentq
from scipy.sparse.csgraph import connected_components

from maglev.arrays import ComplexArray, FloatArray, IntArray
from maglev.errors import UserError
from maglev.mechanics.car import N_BOGIES, N_C_FRAMES
from maglev.mechanics.control import circuits
from maglev.mechanics.train import TrainModel, pole_offsets, pole_static_force
from maglev.parameters import Circuit, Control

GAINS_OF_KIND = ((0, 1, 4, 5), (2, 3, 6, 7))
"""Columns of k_p, k_d, k_a, k_i among the eight gains: of suspension, of guidance."""

_IN_A_CAR = {
    "body": (1, 1),
    "bogie": (N_BOGIES, 1),
    "rod": (N_C_FRAMES, 1),
    "suspension": (N_C_FRAMES, 2),
    "guidance": (N_C_FRAMES, 2),
}
"""Bodies of a kind in a car and side; how much the number of the train's last is below that in all
its cars."""

_NOT_COUPLED = 1e-9  # of the largest of a matrix
_NODES, _MOST_NODES = 8, 128  # first and largest number of intervals along the delay
_MOST_STEPS = 20  # of Newton's method
_SAME_ROOT = 1e-3  # of the size of a root plus one: a collocated root that leads to this very root


@dataclass(frozen=True)
class Loop:
    """Circuits of one kind of magnet in the coordinates of a block of the train.

    Attributes
    ----------
    fed_by : (freedom,)
        Coordinates of the block that feed the signal.
    pull : (coordinate, freedom)
        Closing force [N, N m] per unit of current gain and of each of them: these columns of the
        matrix G.
    lag, delay
        Time constant τ of the current and delay T of the signal [s].
    """

    fed_by: IntArray
    pull: FloatArray
    lag: float
    delay: float


@dataclass(frozen=True)
class Block:
    """Coordinates of the train that are coupled with each other and with no others.

    Attributes
    ----------
    shape : (dof, coordinate)
        Motion of the train's degrees of freedom with each coordinate; orthonormal columns.
    mass : (coordinate,)
        Diagonal of the mass matrix M [kg, kg m²].
    damping, stiffness : (coordinate, coordinate)
        C and K: of the links; K includes the negative stiffness of the magnets.
    loops
        Of suspension and of guidance.
    """

    shape: FloatArray
    mass: FloatArray
    damping: FloatArray
    stiffness: FloatArray
    loops: tuple[Loop, Loop]


def closing_matrices(
    train: TrainModel, control: Control
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Stiffness of the magnets at constant current, and force of their circuits per unit of gain.

    Parameters
    ----------
    train
        Train with open magnets.
    control
        Sharing of circuits.

    Returns
    -------
    attraction : (dof, dof)
        Stiffness of the magnets at constant current, -2F₀/δ₀ of each pole.
    suspension, guidance : (dof, dof)
        Closing force per unit of current gain and of each degree of freedom: 2F₀/i₀ of each pole
        times the gap that feeds its circuit.

    References
    ----------
    docs/theory/control.md, eq. 3.

    Examples
    --------
    >>> from maglev.mechanics.train import build
    >>> from maglev.parameters import Config
    >>> config = Config.model_validate({"train": {"n_cars": 1}})
    >>> attraction, _, _ = closing_matrices(build(config.train), config.control)
    >>> bool(np.linalg.eigvalsh(attraction)[0] < 0)  # magnets alone are unstable
    True
    """
    n = train.mass.size
    attraction, drawn = np.zeros((n, n)), (np.zeros((n, n)), np.zeros((n, n)))
    table = train.magnets
    forces = pole_static_force(train.parameters, table)
    for is_guidance, (magnet, circuit) in enumerate(
        (
            (train.parameters.suspension_magnet, control.suspension),
            (train.parameters.guidance_magnet, control.guidance),
        )
    ):
        grouping = circuits(circuit, magnet.n_poles)
        offset = pole_offsets(magnet)
        # A place dx ahead of the centre moves by z - theta dx, or by y + psi dx.
        gap = np.column_stack([np.ones_like(offset), offset if is_guidance else -offset])
        fed = grouping.drive @ grouping.feed @ gap
        felt = gap
        if grouping.mean_gap_force:
            felt = np.broadcast_to(gap.mean(axis=0), gap.shape)
        for row in np.flatnonzero(table.is_guidance == bool(is_guidance)):
            pull = 2 * forces[row, : magnet.n_poles, None] * gap
            freedoms = [table.translation_dof[row], table.rotation_dof[row]]
            at = np.ix_(freedoms, freedoms)
            attraction[at] -= pull.T @ felt / magnet.gap_reference
            drawn[is_guidance][at] += pull.T @ fed / magnet.current_reference
    return attraction, *drawn


def closed_train(
    train: TrainModel, gains: FloatArray, control: Control | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mass, stiffness and damping of the train with its circuits closed, without lag and delay.

    Parameters
    ----------
    train
        Train with open magnets.
    gains : (8,)
        Suspension k_p [A/m], k_d [A s/m], guidance k_p, k_d, then k_a [A s²/m] and k_i [A/(m s)] of
        each; k_i does not enter.
    control
        Sharing of circuits; one circuit for each pole if not given.

    Returns
    -------
    mass, stiffness, damping : (dof, dof)

    Examples
    --------
    >>> from maglev.mechanics.train import build
    >>> from maglev.parameters import Config
    >>> config = Config.model_validate({"train": {"n_cars": 1}})
    >>> gains = np.append(config.gains.as_row, config.gains.further)
    >>> mass, stiffness, damping = closed_train(build(config.train), gains)
    >>> mass.shape == stiffness.shape == damping.shape
    True
    """
    attraction, *drawn = closing_matrices(train, control or Control())
    mass, damping = np.diag(train.mass), train.damping.toarray()
    stiffness = train.stiffness.toarray() + attraction
    for (k_p, k_d, k_a, _), pull in zip(of_kinds(gains), drawn, strict=True):
        mass += k_a * pull
        damping += k_d * pull
        stiffness += k_p * pull
    return mass, stiffness, damping


def of_kinds(gains: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gains k_p, k_d, k_a, k_i, first of the suspension, then of the guidance.

    Examples
    --------
    >>> of_kinds(np.arange(8.0))
    (array([0., 1., 4., 5.]), array([2., 3., 6., 7.]))
    """
    suspension, guidance = GAINS_OF_KIND
    return gains[list(suspension)], gains[list(guidance)]


def blocks(train: TrainModel, control: Control) -> tuple[Block, ...]:
    """The linearised train in uncoupled blocks.

    Parameters
    ----------
    train
        Train with open magnets.
    control
        Circuits of both kinds.

    Returns
    -------
    blocks
        Connected coordinates, even or odd from side to side and from end to end.

    Examples
    --------
    >>> from maglev.mechanics.train import build
    >>> from maglev.parameters import Config
    >>> config = Config.model_validate({"train": {"n_cars": 1}})
    >>> parts = blocks(build(config.train), config.control)
    >>> sum(part.mass.size for part in parts) == build(config.train).mass.size
    True
    """
    attraction, *drawn = closing_matrices(train, control)
    matrices = (train.stiffness.toarray() + attraction, train.damping.toarray(), *drawn)
    found = []
    for shape in _families(train):
        reduced = [shape.T @ matrix @ shape for matrix in matrices]
        coupled = sum(
            np.abs(one) > _NOT_COUPLED * np.abs(matrix).max()
            for one, matrix in zip(reduced, matrices, strict=True)
        )
        n_parts, part = connected_components(coupled, directed=False)
        for number in range(n_parts):
            chosen = np.flatnonzero(part == number)
            own_shape = shape[:, chosen]
            stiffness, damping, *pulls = (one[np.ix_(chosen, chosen)] for one in reduced)
            loops = [
                _loop(pull, _NOT_COUPLED * np.abs(whole).max(), circuit)
                for pull, whole, circuit in zip(
                    pulls, drawn, (control.suspension, control.guidance), strict=True
                )
            ]
            mass = np.square(own_shape).T @ train.mass
            found.append(Block(own_shape, mass, damping, stiffness, (loops[0], loops[1])))
    return tuple(found)


def _loop(pull: FloatArray, least: float, circuit: Circuit) -> Loop:
    fed_by = np.flatnonzero(np.abs(pull).max(axis=0) > least)
    return Loop(fed_by, pull[:, fed_by], circuit.lag, circuit.delay)


def state_matrix(block: Block, gains: FloatArray, n_nodes: int = 0) -> FloatArray:
    """Matrix A of the block's motion as ``dx/dt = A x``.

    The state is the motion and its rate, the integral of the signal where k_i is not zero, the
    current where it lags; then, where the signal is delayed, the signal at the Chebyshev nodes of
    the time since it was measured.

    Parameters
    ----------
    block
        Part of the train.
    gains : (8,)
        As in `closed_train`.
    n_nodes
        Intervals along the delay; at 0 there is no delay.

    References
    ----------
    Breda, Maset and Vermiglio, SIAM J. Sci. Comput. 27 (2005) 482, for the delay.

    Examples
    --------
    >>> from maglev.mechanics.train import build
    >>> from maglev.parameters import Config
    >>> config = Config.model_validate({"train": {"n_cars": 1}})
    >>> gains = np.append(config.gains.as_row, config.gains.further)
    >>> part = blocks(build(config.train), config.control)[0]
    >>> bool(np.linalg.eigvals(state_matrix(part, gains)).real.max() < 0)
    True
    """
    n = block.mass.size
    sizes = [n, n]
    integral: list[slice] = []
    current: list[slice] = []
    late: list[slice] = []
    for (_, _, _, k_i), loop in zip(of_kinds(gains), block.loops, strict=True):
        for places, wanted, times in (
            (integral, k_i != 0.0, 1),
            (current, loop.lag > 0.0, 1),
            (late, loop.delay > 0.0 and n_nodes > 0, n_nodes),
        ):
            size = loop.fed_by.size * times if wanted else 0
            places.append(slice(sum(sizes), sum(sizes) + size))
            sizes.append(size)
    n_state = sum(sizes)
    state = np.zeros((n_state, n_state))
    state[:n, n : 2 * n] = np.eye(n)
    state[n : 2 * n] = (
        np.hstack([-block.stiffness, -block.damping, np.zeros((n, n_state - 2 * n))])
        / block.mass[:, None]
    )
    for kind, (k, loop) in enumerate(zip(of_kinds(gains), block.loops, strict=True)):
        size = loop.fed_by.size
        k_p, k_d, k_a, k_i = k
        acts = -loop.pull / block.mass[:, None]  # acceleration per current
        # The signal is seen @ x + fed @ (the current, where that is no state).
        if loop.lag > 0.0:
            state[n : 2 * n, current[kind]] += acts
        seen, fed = k_a * state[n + loop.fed_by], np.zeros((size, size))
        seen[np.arange(size), loop.fed_by] += k_p
        seen[np.arange(size), n + loop.fed_by] += k_d
        if k_i != 0.0:
            state[integral[kind], :][np.arange(size), loop.fed_by] = 1.0
            seen[:, integral[kind]] += k_i * np.eye(size)
        if loop.lag == 0.0:
            fed = k_a * acts[loop.fed_by]
        # What the circuit follows, arrived @ x, is the signal of now or from the end of the delay.
        if late[kind].stop > late[kind].start:
            arrived = np.zeros((size, n_state))
            arrived[:, late[kind]][:, -size:] = np.eye(size)
            slope = _differentiation(n_nodes)[1:] * (2 / loop.delay)
            state[late[kind]] = np.kron(slope[:, :1], seen + fed @ arrived)
            state[late[kind], late[kind]] += np.kron(slope[:, 1:], np.eye(size))
        else:
            arrived = np.linalg.solve(np.eye(size) - fed, seen)
        if loop.lag > 0.0:
            state[current[kind]] = arrived / loop.lag
            state[current[kind], current[kind]] -= np.eye(size) / loop.lag
        else:
            state[n : 2 * n] += acts @ arrived
    return state


def characteristic(
    block: Block, gains: FloatArray, s: complex
) -> tuple[ComplexArray, ComplexArray]:
    """Characteristic matrix of a block at s, and its derivative by s; exact for any delay.

    Parameters
    ----------
    block
        Part of the train.
    gains : (8,)
        As in `closed_train`.
    s
        Complex frequency [1/s]; not zero where k_i is not.

    Returns
    -------
    matrix, slope : (coordinate, coordinate)
        Complex; s is a root where the matrix is singular.

    Examples
    --------
    >>> from maglev.mechanics.train import build
    >>> from maglev.parameters import Config
    >>> config = Config.model_validate({"train": {"n_cars": 1}})
    >>> gains = np.append(config.gains.as_row, config.gains.further)
    >>> part = blocks(build(config.train), config.control)[0]
    >>> matrix, _ = characteristic(part, gains, rightmost(part, gains))
    >>> bool(np.linalg.cond(matrix) > 1e8)  # singular at a root
    True
    """
    matrix = np.diag(block.mass * s**2) + block.damping * s + block.stiffness
    slope = np.diag(2 * block.mass * s) + block.damping + 0j
    for (k_p, k_d, k_a, k_i), loop in zip(of_kinds(gains), block.loops, strict=True):
        signal, signal_slope = k_p + k_d * s + k_a * s**2, k_d + 2 * k_a * s
        if k_i != 0.0:
            signal, signal_slope = signal + k_i / s, signal_slope - k_i / s**2
        follows = np.exp(-loop.delay * s) / (1 + loop.lag * s)
        follows_slope = -follows * (loop.delay + loop.lag / (1 + loop.lag * s))
        matrix[:, loop.fed_by] += signal * follows * loop.pull
        slope[:, loop.fed_by] += (signal_slope * follows + signal * follows_slope) * loop.pull
    return matrix, slope


def rightmost(block: Block, gains: FloatArray) -> complex:
    """Rightmost root of a block [1/s], of a complex pair the one with positive imaginary part.

    Without delay an eigenvalue.  With delay, the one of the collocated delay polished on the
    characteristic equation; the collocation is refined until it leads to that root.

    Parameters
    ----------
    block
        Part of the train.
    gains : (8,)
        As in `closed_train`.

    Raises
    ------
    RuntimeError
        If the collocation does not settle.

    Examples
    --------
    >>> from maglev.mechanics.train import build
    >>> from maglev.parameters import Config
    >>> config = Config.model_validate({"train": {"n_cars": 1}})
    >>> gains = np.append(config.gains.as_row, config.gains.further)
    >>> part = blocks(build(config.train), config.control)[0]
    >>> rightmost(part, gains).real < 0  # the part is stable
    True
    """
    if not _late(block):
        roots = scipy.linalg.eigvals(state_matrix(block, gains))
        return _rightmost(roots)
    n_nodes = _NODES
    while n_nodes <= _MOST_NODES:
        roots, shapes = scipy.linalg.eig(state_matrix(block, gains, n_nodes))
        first = _rightmost(roots)
        shape = shapes[: block.mass.size, int(np.abs(roots - first).argmin())]
        root = _polished(block, gains, first, shape)
        if abs(root - first) < _SAME_ROOT * (1 + abs(root)):
            return complex(root.real, abs(root.imag))
        n_nodes *= 2
    raise RuntimeError(
        f"the rightmost root of a train with delay does not settle with {_MOST_NODES} nodes: "
        f"{first:g} 1/s leads to {root:g} 1/s"
    )


def growth_rate(parts: tuple[Block, ...], gains: FloatArray) -> float:
    """Fastest growth of a motion of the levitated train on a rigid track [1/s].

    Parameters
    ----------
    parts
        The train, from `blocks`.
    gains : (8,)
        As in `closed_train`.

    Returns
    -------
    rate
        Largest real part of the roots; negative where every motion dies out.

    References
    ----------
    docs/theory/control.md.

    Examples
    --------
    >>> from maglev.mechanics.train import build
    >>> from maglev.parameters import Config
    >>> config = Config.model_validate({"train": {"n_cars": 1}})
    >>> gains = np.append(config.gains.as_row, config.gains.further)
    >>> growth_rate(blocks(build(config.train), config.control), gains) < 0
    True
    """
    return max(rightmost(block, gains).real for block in parts)


def modes(parts: tuple[Block, ...], gains: FloatArray) -> tuple[ComplexArray, ComplexArray]:
    """Oscillatory modes of the levitated train, from the slowest.

    With delay there are infinitely many, the fast ones of the circuits; as many of the slowest are
    kept as the train has without delay.

    Parameters
    ----------
    parts
        The train, from `blocks`.
    gains : (8,)
        As in `closed_train`.

    Returns
    -------
    root : (mode,)
        Roots with positive imaginary part [1/s]; the circular frequency is their size.
    shape : (mode, dof)
        Motion of the train's degrees of freedom, complex, without scale.

    Examples
    --------
    >>> from maglev.mechanics.train import build
    >>> from maglev.parameters import Config
    >>> config = Config.model_validate({"train": {"n_cars": 1}})
    >>> gains = np.append(config.gains.as_row, config.gains.further)
    >>> roots, shapes = modes(blocks(build(config.train), config.control), gains)
    >>> bool((roots.real < 0).all())
    True
    """
    found: list[tuple[complex, ComplexArray]] = []
    for block in parts:
        n = block.mass.size
        roots, shapes = scipy.linalg.eig(state_matrix(block, gains))
        pairs = int((roots.imag > 0).sum())
        if _late(block):
            longest = max(loop.delay for loop in block.loops)
            n_nodes = _NODES + int(np.abs(roots).max() * longest)
            roots, shapes = scipy.linalg.eig(state_matrix(block, gains, n_nodes))
        order = np.argsort(np.abs(roots))
        slowest = [k for k in order if roots[k].imag > 0][:pairs]
        for k in slowest:
            root = complex(roots[k])
            if _late(block):
                root = _polished(block, gains, root, shapes[:n, k])
            found.append((root, block.shape @ shapes[:n, k]))
    found.sort(key=lambda one: abs(one[0]))
    return np.array([root for root, _ in found]), np.array([shape for _, shape in found])


def border(
    parts: tuple[Block, ...], gains: FloatArray, gain: int, limit: float, n_steps: int = 24
) -> float:
    """Value of one gain at the border of stability.

    Parameters
    ----------
    parts
        The train, from `blocks`.
    gains : (8,)
        Where the search starts; the train must be stable there.
    gain
        Which of the eight is varied; the others stay.
    limit
        Its last value; it is reached in equal steps.  In the first step that makes the train
        unstable, the root of the growth rate is the border.
    n_steps
        Number of steps; a return to stability within one step goes unnoticed.

    Returns
    -------
    border
        Value of the gain; NaN if the train is stable up to the limit.

    Raises
    ------
    UserError
        If the train is not stable at the start.

    Examples
    --------
    >>> from maglev.mechanics.train import build
    >>> from maglev.parameters import Config
    >>> config = Config.model_validate({"train": {"n_cars": 1}})
    >>> gains = np.append(config.gains.as_row, config.gains.further)
    >>> parts = blocks(build(config.train), config.control)
    >>> static = config.train.suspension_magnet
    >>> limit = static.current_reference / static.gap_reference  # k_p that holds at rest
    >>> border(parts, gains, 0, 0.5 * limit) > limit
    True
    """

    def rate(value: float) -> float:
        moved = gains.copy()
        moved[gain] = value
        return growth_rate(parts, moved)

    values = np.linspace(gains[gain], limit, n_steps + 1)
    before = rate(values[0])
    if not before < 0:
        raise UserError(
            f"the train must be stable where the search starts, grows by {before:g} 1/s"
        )
    for inner, outer in itertools.pairwise(values):
        if rate(outer) >= 0:
            return float(brentq(rate, inner, outer, xtol=1e-9 * abs(outer - inner), rtol=1e-10))
    return float("nan")


def _late(block: Block) -> bool:
    return any(loop.delay > 0.0 and loop.fed_by.size for loop in block.loops)


def _rightmost(roots: ComplexArray) -> complex:
    return complex(max(roots[roots.imag >= 0], key=lambda root: root.real))


def _polished(block: Block, gains: FloatArray, root: complex, shape: ComplexArray) -> complex:
    """Root of the characteristic equation by Newton's method, from an eigenvalue and its shape."""
    kept = shape.conj() / (np.abs(shape) ** 2).sum()
    for _ in range(_MOST_STEPS):
        matrix, slope = characteristic(block, gains, root)
        try:
            shape = np.linalg.solve(matrix, slope @ shape)
        except np.linalg.LinAlgError:  # on the root itself
            return root
        step = 1 / (kept @ shape)
        shape *= step
        root -= step
        if abs(step) < 1e-13 * (1 + abs(root)):
            break
    return root


@lru_cache(maxsize=8)
def _differentiation(n: int) -> FloatArray:
    """Derivatives at the Chebyshev nodes cos(πk/n) of the polynomial through values there."""
    x = np.cos(np.pi * np.arange(n + 1) / n)
    weight = (-1.0) ** np.arange(n + 1)
    weight[[0, -1]] *= 2.0
    slope = np.outer(weight, 1 / weight) / (x[:, None] - x + np.eye(n + 1))
    np.fill_diagonal(slope, 0.0)
    np.fill_diagonal(slope, -slope.sum(axis=1))
    return slope


def _families(train: TrainModel) -> list[FloatArray]:
    """Motions even or odd from side to side and from end to end, in orthonormal columns."""
    n_cars = train.car_body_dof.shape[0]
    place = {name: dof for dof, name in enumerate(train.dof_names)}
    mirrors = []
    for mirrored, turned in ((_across, ("y", "phi", "psi")), (_along, ("theta", "psi"))):
        mirror = np.zeros((len(place), len(place)))
        for name, dof in place.items():
            direction = name.split(".")[2].split("_")[0]
            mirror[place[mirrored(name, n_cars)], dof] = -1.0 if direction in turned else 1.0
        mirrors.append(mirror)
    unit = np.eye(len(place))
    families = []
    for side, end in np.ndindex(2, 2):
        shapes = (unit + (-1) ** side * mirrors[0]) @ (unit + (-1) ** end * mirrors[1]) / 4
        first = np.abs(shapes).argmax(axis=0)  # the same for all that mirror one another
        size = np.linalg.norm(shapes, axis=0)
        _, columns = np.unique(np.where(size > 0.1, first, -1), return_index=True)
        columns = columns[size[columns] > 0.1]
        families.append(shapes[:, columns] / size[columns])
    return families


def _across(name: str, n_cars: int) -> str:
    """Mirror image of a degree of freedom from side to side."""
    return re.sub("right|left", lambda side: "left" if side[0] == "right" else "right", name)


def _along(name: str, n_cars: int) -> str:
    """Mirror image of a degree of freedom from end to end."""
    car, body, freedom = name.split(".")
    kind, number, side = re.fullmatch(r"([a-z]+)(\d*)(.*)", body).groups()  # type: ignore[union-attr]
    in_car, last = _IN_A_CAR[kind]
    of_train = in_car * n_cars - last - in_car * int(car.removeprefix("car")) - int(number or 0)
    new_car, new_number = divmod(of_train, in_car)
    freedom = re.sub("front|rear", lambda end: "rear" if end[0] == "front" else "front", freedom)
    return f"car{new_car}.{kind}{new_number if number else ''}{side}.{freedom}"
