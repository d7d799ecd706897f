"""Two-node Timoshenko beam element in space: stiffness, consistent mass, shape functions.

The element lies along x, y points right and z down.  Each node has six degrees of freedom in the
order x, y, z, roll φ, pitch θ, yaw ψ, all small and right-handed, so that a section a distance dx
further on moves by ``u_y = ψ dx`` and ``u_z = -θ dx``.  Deflection (cubic) and section rotation
(quadratic) are interpolated together from the homogeneous static solution: the element does not
lock, and it is exact for loads at its nodes.  Its shear strain is uniform, so frequencies converge
with the square of its length, and with the fourth power where shear is negligible.  Theory:
docs/theory/guideway.md.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from maglev.arrays import FloatArray
from maglev.errors import UserError
from maglev.parameters import BeamSection

X, Y, Z, ROLL, PITCH, YAW = range(6)
"""Indices of a node's degrees of freedom."""

_VERTICAL = np.array([Z, PITCH, 6 + Z, 6 + PITCH])
_VERTICAL_SIGN = np.array([1.0, -1.0, 1.0, -1.0])  # du_z/dx = -θ
_LATERAL = np.array([Y, YAW, 6 + Y, 6 + YAW])
_LATERAL_SIGN = np.ones(4)  # du_y/dx = ψ
_GAUSS_POINTS = 4  # exact to degree seven; the mass is of degree six


def shear_flexibility(section: BeamSection, length: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Shear over bending flexibility of an element, Φ = 12 E I / (κ G A L²), in both planes.

    Parameters
    ----------
    section
        Cross-section and material, constant along the element.
    length : (...)
        Element length [m].

    Returns
    -------
    vertical, lateral : (...)
        Φ for bending with deflection along z and along y [-].

    Raises
    ------
    UserError
        If a length is not positive.

    References
    ----------
    Przemieniecki, Theory of Matrix Structural Analysis (1968), sec. 5.6.

    Examples
    --------
    >>> from maglev.parameters import Guideway
    >>> vertical, lateral = shear_flexibility(Guideway().girder, 3.0)
    >>> print(f"{vertical:.2f}")
    6.02
    """
    L = np.asarray(length, dtype=float)
    if not np.all(L > 0):
        raise UserError(f"element length must be positive, got {np.min(L)} m")
    E, GA = section.elastic_modulus, section.shear_modulus * section.area
    vertical = 12 * E * section.second_moment_vertical / section.shear_coefficient_vertical
    lateral = 12 * E * section.second_moment_lateral / section.shear_coefficient_lateral
    return vertical / (GA * L**2), lateral / (GA * L**2)


def deflection_shape(length: npt.ArrayLike, phi: npt.ArrayLike, x: npt.ArrayLike) -> FloatArray:
    """Shape functions of the deflection in one plane.

    Parameters
    ----------
    length, phi : (...)
        Element length [m] and its shear over bending flexibility Φ [-].
    x : (...)
        Distance from the first node [m].

    Returns
    -------
    shape : (..., 4)
        Deflection [m] per deflection [m] and slope of the section [rad] of the first and the
        second node.

    References
    ----------
    Friedman and Kosmatka, Computers & Structures 47 (1993) 473-481, eq. 16.

    Examples
    --------
    >>> deflection_shape(2.0, 0.0, 1.0)  # half of each end's deflection at the middle
    array([ 0.5 ,  0.25,  0.5 , -0.25])
    """
    L, s = np.asarray(length, dtype=float), np.asarray(x) / length
    phi = np.asarray(phi)
    shape = (
        1 - 3 * s**2 + 2 * s**3 + phi * (1 - s),
        L * (s - 2 * s**2 + s**3 + phi / 2 * (s - s**2)),
        3 * s**2 - 2 * s**3 + phi * s,
        L * (s**3 - s**2 + phi / 2 * (s**2 - s)),
    )
    return np.stack(shape, axis=-1) / (1 + phi)[..., np.newaxis]


def slope_shape(length: npt.ArrayLike, phi: npt.ArrayLike, x: npt.ArrayLike) -> FloatArray:
    """Derivative of `deflection_shape` with respect to x: slope of the axis, shear included.

    Parameters
    ----------
    length, phi, x : (...)
        As in `deflection_shape`.

    Returns
    -------
    slope : (..., 4)
        Slope of the deflected axis [-] per nodal deflection [m] and slope of the section [rad].

    Examples
    --------
    >>> slope_shape(2.0, 0.0, 0.0)  # at its first node
    array([0., 1., 0., 0.])
    """
    L, s = np.asarray(length, dtype=float), np.asarray(x) / length
    phi = np.asarray(phi)
    slope = (
        (6 * s**2 - 6 * s - phi) / L,
        1 - 4 * s + 3 * s**2 + phi / 2 * (1 - 2 * s),
        (6 * s - 6 * s**2 + phi) / L,
        3 * s**2 - 2 * s + phi / 2 * (2 * s - 1),
    )
    return np.stack(slope, axis=-1) / (1 + phi)[..., np.newaxis]


def rotation_shape(length: npt.ArrayLike, phi: npt.ArrayLike, x: npt.ArrayLike) -> FloatArray:
    """Shape functions of the section's rotation in one plane, of the sign of dw/dx.

    Parameters
    ----------
    length, phi, x : (...)
        As in `deflection_shape`.

    Returns
    -------
    shape : (..., 4)
        Rotation of the section [rad] per nodal deflection [m] and slope of the section [rad].

    References
    ----------
    Friedman and Kosmatka, Computers & Structures 47 (1993) 473-481, eq. 16.

    Examples
    --------
    >>> rotation_shape(2.0, 0.5, 0.0)  # at its first node, whatever the shear
    array([0., 1., 0., 0.])
    """
    L, s = np.asarray(length, dtype=float), np.asarray(x) / length
    phi = np.asarray(phi)
    shape = (
        6 * (s**2 - s) / L,
        1 - 4 * s + 3 * s**2 + phi * (1 - s),
        6 * (s - s**2) / L,
        3 * s**2 - 2 * s + phi * s,
    )
    return np.stack(shape, axis=-1) / (1 + phi)[..., np.newaxis]


def displacement_shape(section: BeamSection, length: float, x: npt.ArrayLike) -> FloatArray:
    """Displacement of the axis from the twelve nodal motions.

    Parameters
    ----------
    section
        Cross-section and material.
    length
        Element length [m].
    x : (point,)
        Distance from the first node [m].

    Returns
    -------
    shape : (point, 3, 12)
        u_x, u_y, u_z [m] per nodal displacement [m] and rotation [rad].

    Raises
    ------
    UserError
        If ``length`` is not positive.

    Examples
    --------
    >>> from maglev.parameters import Guideway
    >>> rows = displacement_shape(Guideway().girder, 3.0, 1.5)
    >>> rows.shape
    (1, 3, 12)
    """
    vertical, lateral = shear_flexibility(section, length)
    x = np.asarray(x, dtype=float)
    shape = np.zeros((x.size, 3, 12))
    shape[:, X, X], shape[:, X, 6 + X] = 1 - x / length, x / length
    shape[:, Y, _LATERAL] = _LATERAL_SIGN * deflection_shape(length, lateral, x)
    shape[:, Z, _VERTICAL] = _VERTICAL_SIGN * deflection_shape(length, vertical, x)
    return shape


def stiffness(section: BeamSection, length: float) -> FloatArray:
    """Stiffness of the element: tension, Saint-Venant torsion, bending with shear in two planes.

    Parameters
    ----------
    section
        Cross-section and material, constant along the element.
    length
        Element length [m].

    Returns
    -------
    stiffness : (12, 12)
        Nodal force [N] and moment [N m] per nodal displacement [m] and rotation [rad].
        Symmetric, with six rigid-body motions.

    Raises
    ------
    UserError
        If ``length`` is not positive.

    References
    ----------
    Przemieniecki, Theory of Matrix Structural Analysis (1968), sec. 5.6.

    Examples
    --------
    >>> from maglev.parameters import Guideway
    >>> lifted = np.zeros(12)
    >>> lifted[[2, 8]] = 1.0  # both nodes by 1 m
    >>> bool(np.abs(stiffness(Guideway().girder, 3.0) @ lifted).max() < 1e-3)
    True
    """
    vertical, lateral = shear_flexibility(section, length)
    E, G, L = section.elastic_modulus, section.shear_modulus, length
    pair = np.array([[1.0, -1.0], [-1.0, 1.0]])
    matrix = np.zeros((12, 12))
    matrix[np.ix_([X, 6 + X], [X, 6 + X])] = E * section.area / L * pair
    matrix[np.ix_([ROLL, 6 + ROLL], [ROLL, 6 + ROLL])] = G * section.torsion_constant / L * pair
    for dof, sign, second_moment, phi in (
        (_VERTICAL, _VERTICAL_SIGN, section.second_moment_vertical, vertical),
        (_LATERAL, _LATERAL_SIGN, section.second_moment_lateral, lateral),
    ):
        # fmt: off
        plane = np.array([
            [12.0,    6 * L,              -12.0,   6 * L],
            [6 * L,  (4 + phi) * L**2,    -6 * L, (2 - phi) * L**2],
            [-12.0,  -6 * L,               12.0,  -6 * L],
            [6 * L,  (2 - phi) * L**2,    -6 * L, (4 + phi) * L**2],
        ])
        # fmt: on
        plane *= E * second_moment / (L**3 * (1 + phi))
        matrix[np.ix_(dof, dof)] = sign[:, np.newaxis] * plane * sign
    return matrix


def mass(section: BeamSection, length: float) -> FloatArray:
    """Consistent mass of the element, shear flexibility and rotary inertia included.

    The kinetic energy of the axis (ρA) and of the turning sections (ρI in bending, the section's
    own polar inertia in torsion) with the very interpolation behind `stiffness`.

    Parameters
    ----------
    section
        Cross-section and material, constant along the element.
    length
        Element length [m].

    Returns
    -------
    mass : (12, 12)
        Nodal force [N] and moment [N m] per acceleration [m/s^2] and angular acceleration
        [rad/s^2].  Symmetric and positive definite.

    Raises
    ------
    UserError
        If ``length`` is not positive.

    References
    ----------
    Friedman and Kosmatka, Computers & Structures 47 (1993) 473-481, eq. 20.

    Examples
    --------
    >>> from maglev.parameters import Guideway
    >>> girder, lifted = Guideway().girder, np.zeros(12)
    >>> lifted[[2, 8]] = 1.0
    >>> whole = lifted @ mass(girder, 3.0) @ lifted
    >>> bool(np.isclose(whole, 3.0 * girder.mass_per_length))
    True
    """
    vertical, lateral = shear_flexibility(section, length)
    abscissa, weight = np.polynomial.legendre.leggauss(_GAUSS_POINTS)
    x, weight = length * (abscissa + 1) / 2, length * weight / 2
    shape = displacement_shape(section, length, x)
    turn = np.zeros_like(shape)  # section rotations about x, y, z
    turn[:, 0, ROLL], turn[:, 0, 6 + ROLL] = 1 - x / length, x / length
    turn[:, 1, _VERTICAL] = -_VERTICAL_SIGN * rotation_shape(length, vertical, x)
    turn[:, 2, _LATERAL] = _LATERAL_SIGN * rotation_shape(length, lateral, x)
    inertia = np.array(
        [
            section.polar_inertia,
            section.density * section.second_moment_vertical,
            section.density * section.second_moment_lateral,
        ]
    )
    matrix = section.mass_per_length * np.einsum("g,gci,gcj->ij", weight, shape, shape)
    matrix += np.einsum("g,c,gci,gcj->ij", weight, inertia, turn, turn)
    return (matrix + matrix.T) / 2


def turned(matrix: npt.ArrayLike, axes: npt.ArrayLike) -> FloatArray:
    """Element matrix in global axes.

    Parameters
    ----------
    matrix : (12, 12)
        Stiffness or mass in the element's own axes.
    axes : (3, 3)
        The element's x, y, z axis as rows of global components [-], right-handed.

    Returns
    -------
    matrix : (12, 12)
        The same for nodal motions in global axes.

    Examples
    --------
    >>> axes = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]  # the element along global y
    >>> diagonal = np.diag(np.arange(12.0))
    >>> turned(diagonal, axes)[:2, :2]
    array([[1., 0.],
           [0., 0.]])
    """
    turn = np.kron(np.eye(4), np.asarray(axes, dtype=float))
    return turn.T @ np.asarray(matrix) @ turn
