"""Compiled steps of the generalised density evolution equation.

Callers check the arguments.  Theory: docs/theory/pdem.md.
"""

import numpy as np
from numba import njit

UPWIND, MINMOD, SUPERBEE = 0, 1, 2
"""Codes of the flux limiters."""

NEGLIGIBLE = 1e-30
"""Probability of an outermost cell below which it is joined to its neighbour.

Fourteen orders below what a double can add to one; keeps the moving window short and its values
away from subnormal numbers.  Assumed.
"""


@njit(cache=True, error_model="numpy")
def limited_jump(jump: float, upwind_jump: float, limiter: int) -> float:
    """Jump across a face, limited by the jump across the next face upwind.

    Parameters
    ----------
    jump, upwind_jump
        Differences of neighbouring cells [unit of the density].
    limiter
        ``UPWIND`` (zero), ``MINMOD`` or ``SUPERBEE``.

    Returns
    -------
    limited
        psi(r) jump with r = upwind_jump / jump; zero where the two differ in sign.

    References
    ----------
    Roe, Annu. Rev. Fluid Mech. 18 (1986) 337-365; LeVeque, Finite Volume Methods for Hyperbolic
    Problems (2002), sec. 6.11 and 6.12; docs/theory/pdem.md, eq. (7).
    """
    if limiter == UPWIND or jump * upwind_jump <= 0.0:
        return 0.0
    a, b = abs(jump), abs(upwind_jump)
    if limiter == MINMOD:
        size = min(a, b)
    else:
        size = max(min(2.0 * a, b), min(a, 2.0 * b))
    return size if jump > 0.0 else -size


@njit(cache=True, error_model="numpy")
def tvd_step(density: np.ndarray, courant: float, limiter: int, first: int, last: int) -> None:
    """Advance ``dp/dt + v dp/dz = 0`` by one step in place, total variation diminishing.

    Lax-Wendroff flux with a limited correction: second order where the density is smooth, first
    order at its extrema, exact for ``|courant| = 1``.  No flux passes the outer faces of the
    window ``first`` to ``last``, so its sum is kept.

    Parameters
    ----------
    density : (cell,)
        Cell values [any unit], overwritten by those one step later.
    courant
        ``v dt / dz`` [-], uniform, of either sign, ``|courant| <= 1``.
    limiter
        ``UPWIND``, ``MINMOD`` or ``SUPERBEE``.
    first, last
        The cells that may change, both included; one more cell on either side is read.

    References
    ----------
    Li, Chen, Stochastic Dynamics of Structures (2009), ch. 7; LeVeque (2002), sec. 6.11;
    docs/theory/pdem.md, eq. (6).
    """
    correction = 0.5 * (abs(courant) - courant * courant)
    behind, here, flux_in = density[first - 1], density[first], 0.0
    for j in range(first, last):  # the face between cells j and j + 1
        ahead = density[j + 1]
        jump = ahead - here
        if courant >= 0.0:
            upwind, upwind_jump = here, here - behind
        else:
            upwind, upwind_jump = ahead, density[j + 2] - ahead
        flux = courant * upwind + correction * limited_jump(jump, upwind_jump, limiter)
        density[j] = here - (flux - flux_in)
        behind, here, flux_in = here, ahead, flux
    density[last] = here + flux_in


@njit(cache=True, error_model="numpy")
def shift(density: np.ndarray, cells: int, first: int, last: int) -> None:
    """Move a mass by whole cells, as that many steps at a Courant number of one would.

    Parameters
    ----------
    density : (cell,)
        Mass in each cell [-], overwritten.
    cells
        Distance, of either sign [cell].
    first, last
        Outermost cells that hold a mass.
    """
    if cells > 0:
        for j in range(last, first - 1, -1):
            density[j + cells] = density[j]
        density[first : min(first + cells, last + 1)] = 0.0
    elif cells < 0:
        for j in range(first, last + 1):
            density[j + cells] = density[j]
        density[max(last + cells + 1, first) : last + 1] = 0.0


@njit(cache=True, error_model="numpy")
def advance(
    density: np.ndarray,
    increment: float,
    limiter: int,
    lower: int,
    upper: int,
    first: int,
    last: int,
) -> tuple[int, int, bool]:
    """Move a mass by one increment: whole cells exactly, the rest by one step of the scheme.

    Parameters
    ----------
    density : (cell,)
        Mass in each cell [-], overwritten.
    increment
        Distance to go [cell].
    limiter
        ``UPWIND``, ``MINMOD`` or ``SUPERBEE``.
    lower, upper
        Mass outside the cells ``lower <= j < upper`` is removed afterwards.
    first, last
        Outermost cells that hold a mass.

    Returns
    -------
    first, last
        The same afterwards; ``last < first`` if nothing is left.
    absorbed
        Whether any mass was removed.
    """
    whole = int(increment)
    absorbed = False
    while last + whole >= upper and last >= first:  # beyond the barrier before the last step
        absorbed = absorbed or density[last] > 0.0
        density[last] = 0.0
        last -= 1
    while first + whole < lower and first <= last:
        absorbed = absorbed or density[first] > 0.0
        density[first] = 0.0
        first += 1
    if last < first:
        return first, last, absorbed
    shift(density, whole, first, last)
    first = max(first + whole - 1, 2)
    last = min(last + whole + 1, density.size - 3)
    tvd_step(density, increment - whole, limiter, first, last)
    while first < lower and first < last:
        absorbed = absorbed or density[first] > 0.0
        density[first] = 0.0
        first += 1
    while last >= upper and last > first:
        absorbed = absorbed or density[last] > 0.0
        density[last] = 0.0
        last -= 1
    while density[first] < NEGLIGIBLE and first < last:
        density[first + 1] += density[first]
        density[first] = 0.0
        first += 1
    while density[last] < NEGLIGIBLE and last > first:
        density[last - 1] += density[last]
        density[last] = 0.0
        last -= 1
    return first, last, absorbed


@njit(cache=True, error_model="numpy")
def place_unit_mass(density: np.ndarray, start: float) -> int:
    """Put a mass of one at a place between cell centres; return the first of its two cells.

    Parameters
    ----------
    density : (cell,)
        Empty.
    start
        The place [cell]; whole numbers are cell centres.
    """
    first = int(np.floor(start))
    share = start - first
    density[first] = 1.0 - share
    density[first + 1] = share
    return first


@njit(cache=True, error_model="numpy")
def evolve(
    increment: np.ndarray,
    start: np.ndarray,
    target: np.ndarray,
    probability: np.ndarray,
    until: np.ndarray,
    limiter: int,
    lower: int,
    upper: int,
    work: np.ndarray,
    total: np.ndarray,
    survival: np.ndarray,
    spread: np.ndarray,
) -> None:
    """Evolve a unit mass for every point and add the results up by their probabilities.

    Parameters
    ----------
    increment : (sample, interval)
        Distance that each point goes in each interval [cell].
    start, target : (sample,)
        Start of each point, and centre about which its kernel's spread is measured [cell]; whole
        numbers are cell centres.
    probability : (sample,)
        Assigned probabilities [-].
    until : (sample,)
        Intervals after which a point leaves with all its mass; their number or more for never.
    limiter
        ``UPWIND``, ``MINMOD`` or ``SUPERBEE``.
    lower, upper
        Mass outside the cells ``lower <= j < upper`` is removed after each step.
    work : (cell,)
        Zeros; scratch.
    total : (cell,)
        Receives, added, the probability in each cell at the end [-].
    survival : (interval + 1,)
        Receives, added, the probability not yet removed after each interval [-].
    spread : (sample,)
        Receives the mean square distance of each point's remaining mass from its target
        [cell^2]; zero if none remains.
    """
    n_intervals = increment.shape[1]
    for q in range(increment.shape[0]):
        first = place_unit_mass(work, start[q])
        last = first + 1
        mass = 1.0
        survival[0] += probability[q]
        for k in range(min(n_intervals, until[q])):
            first, last, absorbed = advance(
                work, increment[q, k], limiter, lower, upper, first, last
            )
            if absorbed:
                mass = work[first : last + 1].sum()
            if mass == 0.0:
                break
            survival[k + 1] += probability[q] * mass
        square, remaining = 0.0, 0.0
        if until[q] < n_intervals:
            work[first : last + 1] = 0.0
        for j in range(first, last + 1):
            total[j] += probability[q] * work[j]
            remaining += work[j]
            square += work[j] * (j - target[q]) ** 2
        work[first : last + 1] = 0.0
        if remaining > 0.0:
            spread[q] = square / remaining


@njit(cache=True, error_model="numpy")
def evolve_in_time(
    place: np.ndarray,
    probability: np.ndarray,
    until: np.ndarray,
    limiter: int,
    work: np.ndarray,
    total: np.ndarray,
    square: np.ndarray,
) -> None:
    """Evolve a unit mass along every history and add them up after every interval.

    Parameters
    ----------
    place : (sample, time)
        Place of every point [cell]; whole numbers are cell centres.
    probability : (sample,)
        Assigned probabilities [-].
    until : (sample,)
        Number of the last time at which a point is still there.
    limiter
        ``UPWIND``, ``MINMOD`` or ``SUPERBEE``.
    work : (cell,)
        Zeros; scratch.
    total : (time, cell)
        Receives, added, the probability in each cell [-].
    square : (time,)
        Receives, added, the mean square distance of the masses from the places of their points,
        each by its probability [cell^2].
    """
    n_times, n_cells = total.shape
    for q in range(place.shape[0]):
        first = place_unit_mass(work, place[q, 0])
        last = first + 1
        for k in range(min(n_times, until[q] + 1)):
            if k > 0:
                first, last, _ = advance(
                    work, place[q, k] - place[q, k - 1], limiter, 0, n_cells, first, last
                )
            for j in range(first, last + 1):
                total[k, j] += probability[q] * work[j]
                square[k] += probability[q] * work[j] * (j - place[q, k]) ** 2
        work[first : last + 1] = 0.0
