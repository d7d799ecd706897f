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
def evolve(
    courant: np.ndarray,
    substeps: int,
    start: np.ndarray,
    target: np.ndarray,
    probability: np.ndarray,
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
    courant : (sample, step)
        Increment of each point over each substep of an interval, in cells [-], ``<= 1`` in size.
    substeps
        Number of equal substeps in every interval.
    start, target : (sample,)
        Start of each point, and centre about which its kernel's spread is measured [cell]; whole
        numbers are cell centres.
    probability : (sample,)
        Assigned probabilities [-].
    limiter
        ``UPWIND``, ``MINMOD`` or ``SUPERBEE``.
    lower, upper
        Mass outside the cells ``lower <= j < upper`` is removed after each substep.
    work : (cell,)
        Scratch.
    total : (cell,)
        Receives, added, the probability in each cell at the end [-].
    survival : (step + 1,)
        Receives, added, the probability not yet removed after each interval [-].
    spread : (sample,)
        Receives the mean square distance of each point's remaining mass from its target
        [cell^2]; zero if none remains.
    """
    n_cells = work.size
    for q in range(courant.shape[0]):
        work[:] = 0.0
        first = int(np.floor(start[q]))
        share = start[q] - first
        work[first] = 1.0 - share
        work[first + 1] = share
        last = first + 1
        mass = 1.0
        survival[0] += probability[q]
        for k in range(courant.shape[1]):
            absorbed = False
            for _ in range(substeps):
                first = max(first - 1, 2)
                last = min(last + 1, n_cells - 3)
                tvd_step(work, courant[q, k], limiter, first, last)
                while first < lower and first < last:
                    absorbed = absorbed or work[first] > 0.0
                    work[first] = 0.0
                    first += 1
                while last >= upper and last > first:
                    absorbed = absorbed or work[last] > 0.0
                    work[last] = 0.0
                    last -= 1
                while work[first] < NEGLIGIBLE and first < last:
                    work[first + 1] += work[first]
                    work[first] = 0.0
                    first += 1
                while work[last] < NEGLIGIBLE and last > first:
                    work[last - 1] += work[last]
                    work[last] = 0.0
                    last -= 1
            if absorbed:
                mass = work[first : last + 1].sum()
            survival[k + 1] += probability[q] * mass
        square, remaining = 0.0, 0.0
        for j in range(first, last + 1):
            total[j] += probability[q] * work[j]
            remaining += work[j]
            square += work[j] * (j - target[q]) ** 2
        if remaining > 0.0:
            spread[q] = square / remaining
