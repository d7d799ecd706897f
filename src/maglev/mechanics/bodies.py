"""Rigid bodies with small rotations and the spring-damper links between them.

A body is the set of its degrees of freedom; a point of it moves by a linear combination of them.
A link is a linear combination, its strain, with a stiffness and a damping.  A number may be
an array (sample,) of those of many trains.  Theory: docs/theory/train.md.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from maglev.arrays import FloatArray

Motion = Mapping[int, float]
"""Motion of a point in one direction: metres (or radians) per unit of each degree of freedom."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """Degrees of freedom of a rigid body: y to the right, z down, phi, theta, psi about x, y, z.

    A body that is held in a direction has ``None`` there.  Bodies may share degrees of freedom,
    as the two C-frames of one bogie do.
    """

    y: int | None = None
    z: int | None = None
    phi: int | None = None
    theta: int | None = None
    psi: int | None = None

    def lateral(self, dx: float, dz: float) -> Motion:
        """Motion in y of the point ``dx`` ahead of and ``dz`` below the centre [m].

        u_y = y - phi dz + psi dx.
        """
        return _combination((self.y, 1.0), (self.phi, -dz), (self.psi, dx))

    def vertical(self, dx: float, dy: float) -> Motion:
        """Motion in z of the point ``dx`` ahead of and ``dy`` to the right of the centre [m].

        u_z = z + phi dy - theta dx.
        """
        return _combination((self.z, 1.0), (self.phi, dy), (self.theta, -dx))

    def roll(self) -> Motion:
        """Rotation about x."""
        return _combination((self.phi, 1.0))


@dataclass(frozen=True)
class Link:
    """Spring and damper in parallel on one relative motion.

    Attributes
    ----------
    motion
        Strain of the link: stretch [m] or twist [rad] per unit of each degree of freedom.
    stiffness
        [N/m] or [N m/rad].
    damping
        [N s/m] or [N m s/rad].
    """

    motion: Motion
    stiffness: float
    damping: float


def relative(first: Motion, second: Motion) -> Motion:
    """Relative motion ``first - second``, such as that of a magnet's end against its C-frame.

    Examples
    --------
    >>> relative({0: 1.0, 2: 0.5}, {0: 1.0, 1: 1.0})  # what both share drops out
    {2: 0.5, 1: -1.0}
    """
    return _combination(*first.items(), *((dof, -value) for dof, value in second.items()))


def link_rows(links: Iterable[Link], n_dof: int) -> sp.csr_array:
    """Strain of each link per unit of each degree of freedom.

    Parameters
    ----------
    links
        The links, one row each.
    n_dof
        Number of degrees of freedom.

    Returns
    -------
    rows : (link, dof)
        Stretch [m] or twist [rad] per displacement [m] or rotation [rad].

    Examples
    --------
    >>> spring = Link({0: 1.0, 1: -1.0}, stiffness=2.0, damping=0.0)
    >>> link_rows([spring], n_dof=3).toarray()
    array([[ 1., -1.,  0.]])
    """
    motions = [link.motion for link in links]
    row = np.repeat(np.arange(len(motions)), [len(motion) for motion in motions])
    column = [dof for motion in motions for dof in motion]
    value = [factor for motion in motions for factor in motion.values()]
    return sp.csr_array((value, (row, column)), shape=(len(motions), n_dof), dtype=float)


def assembled(rows: sp.csr_array, coefficient: FloatArray) -> sp.csr_array:
    """Symmetric matrix ``rows.T diag(coefficient) rows`` of all links together.

    Parameters
    ----------
    rows : (link, dof)
        Strain per unit of each degree of freedom [m or rad].
    coefficient : (link,)
        Stiffness [N/m, N m/rad] or damping [N s/m, N m s/rad] of each link.

    Returns
    -------
    matrix : (dof, dof)
        Stiffness or damping matrix; its pattern holds no explicit zeros.

    Examples
    --------
    >>> spring = Link({0: 1.0, 1: -1.0}, stiffness=2.0, damping=0.0)
    >>> assembled(link_rows([spring], n_dof=2), [spring.stiffness]).toarray()
    array([[ 2., -2.],
           [-2.,  2.]])
    """
    matrix = sp.csr_array(rows.T @ sp.diags_array(coefficient) @ rows)
    matrix.eliminate_zeros()
    matrix.sort_indices()
    return matrix


def _combination(*terms: tuple[int | None, float]) -> Motion:
    """Sum of ``factor`` times degree of freedom; held directions and zero factors drop out."""
    motion: dict[int, float] = {}
    for dof, factor in terms:
        if dof is not None:
            motion[dof] = motion.get(dof, 0.0) + factor
    return {dof: factor for dof, factor in motion.items() if np.any(factor != 0.0)}
