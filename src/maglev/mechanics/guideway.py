"""The guideway as finite elements: girders, rails on rigid arms, bearings, shared piers.

Axes: x along travel from the first pier, y right, z down.  Every node has x, y, z, φ, θ, ψ; a point
(dx, dy, dz) from a node moves by ``u_x = x + θ dz - ψ dy``, ``u_y = y - φ dz + ψ dx`` and
``u_z = z + φ dy - θ dx``.  Rigid arms and fixed feet are eliminated.  Gravity does not enter: the
motion is counted from the state under dead weight.  Theory: docs/theory/guideway.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, SuperLU, eigsh, splu

from maglev.arrays import FloatArray, IntArray
from maglev.errors import UserError
from maglev.mechanics import timoshenko
from maglev.mechanics.timoshenko import PITCH, ROLL, YAW, X, Y, Z
from maglev.parameters import BeamSection, Guideway, Pier

RIGHT, LEFT = 1, -1
"""The two rails."""

PIER_ELEMENT = 1.0  # longest pier element at refinement 1 [m], assumed
PIER_AXES = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # downwards from the top
_TORSION_TERMS = 20  # odd terms of the series for a rectangle; the next is below 1e-8 of the first


@dataclass(frozen=True)
class BeamPlane:
    """One plane of bending of a row of beams: nodal motions from those of the guideway.

    Attributes
    ----------
    phi : (element,)
        Shear over bending flexibility Φ [-].
    dof, share : (element, 4, term)
        An element's deflection and slope at its first node, then at its second, as a sum of
        ``share`` [-, m] times the motion of degree of freedom ``dof``; unused terms have share 0.
    """

    phi: FloatArray
    dof: IntArray
    share: FloatArray


@dataclass(frozen=True)
class BeamLine:
    """Beams in a row along one axis: a rail, or the girders.

    Attributes
    ----------
    start, length : (element,)
        Place of an element's first node along the guideway, and its length [m]; ``start`` rises.
    vertical, lateral
        Bending with deflection along z and along y.
    """

    start: FloatArray
    length: FloatArray
    vertical: BeamPlane
    lateral: BeamPlane


@dataclass(frozen=True)
class GuidewayModel:
    """Matrices of the guideway, and rows of its motion at any position along it.

    Attributes
    ----------
    parameters
        Parameters of the guideway.
    mass, stiffness : csr (dof, dof)
        Of beams, connectors and bearings, after elimination of rigid arms and pier feet
        [kg, kg m, kg m^2] and [N/m, N, N m].  Symmetric and positive definite.
    bearing_damping : csr (dof, dof)
        Of the bearings alone [N s/m, N s, N m s]; damping of the structure is `damping`.
    span_dof : tuple of (dof of a span,)
        Degrees of freedom of each span, pier tops not among them.
    pier_top_dof : (pier, 6)
        Motion x, y, z, φ, θ, ψ of each pier top, which neighbouring spans share.
    pier_dof : tuple of (dof of a pier,)
        Degrees of freedom of each pier below its top.
    component : (dof,)
        Direction of each degree of freedom: 0 … 5 for x, y, z, φ, θ, ψ.
    place : (dof, 3)
        Position of its node [m]: x from the first pier, y, and z below the girder axis.
    rail_lines
        The right and the left rail.
    girder_line
        The girders.
    """

    parameters: Guideway
    mass: sparse.csr_array
    stiffness: sparse.csr_array
    bearing_damping: sparse.csr_array
    span_dof: tuple[IntArray, ...]
    pier_top_dof: IntArray
    pier_dof: tuple[IntArray, ...]
    component: IntArray
    place: FloatArray
    rail_lines: tuple[BeamLine, BeamLine]
    girder_line: BeamLine

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom."""
        return self.mass.shape[0]

    def rail_rows(
        self, x: npt.ArrayLike, side: int
    ) -> tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array, sparse.csr_array]:
        """Rows of the motion of a rail's axis; their transposes apply loads to it.

        Parameters
        ----------
        x : (point,)
            Places along the guideway [m], 0 at the first pier.  At the joint of two units the unit
            ahead counts; outside the guideway the rows are zero.
        side
            `RIGHT` or `LEFT`.

        Returns
        -------
        u_z, slope_z, u_y, slope_y : csr (point, dof)
            Displacement down [m] and right [m] and their derivatives along x [-].

        Raises
        ------
        UserError
            If ``side`` is neither.
        """
        if side not in (RIGHT, LEFT):
            raise UserError(f"side must be {RIGHT} (right) or {LEFT} (left), got {side}")
        return _line_rows(self.rail_lines[0 if side == RIGHT else 1], x, self.n_dof)

    def rail_section_rows(
        self, x: npt.ArrayLike, side: int
    ) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows of the rotation of a rail's section, without shear.

        Parameters
        ----------
        x, side
            As in `rail_rows`.

        Returns
        -------
        turn_z, turn_y : csr (point, dof)
            Slope of the section in the vertical and in the lateral plane, of the sign of
            the slope of the axis [rad].
        """
        line = self.rail_lines[0 if side == RIGHT else 1]
        return (
            _plane_rows(line, line.vertical, timoshenko.rotation_shape, x, self.n_dof),
            _plane_rows(line, line.lateral, timoshenko.rotation_shape, x, self.n_dof),
        )

    def girder_rows(self, x: npt.ArrayLike) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Rows of the motion of the girder's axis.

        Parameters
        ----------
        x : (point,)
            Places along the guideway [m], as in `rail_rows`; at a pier the span ahead counts.

        Returns
        -------
        u_z, u_y : csr (point, dof)
            Displacement down and right [m].
        """
        u_z, _, u_y, _ = _line_rows(self.girder_line, x, self.n_dof)
        return u_z, u_y

    def bearing_rows(self, span: int) -> sparse.csr_array:
        """Rows that give how far a span has lifted off its bearings.

        Parameters
        ----------
        span
            Number of the span.

        Returns
        -------
        opening : csr (4, dof)
            Motion of the pier top down less that of the girder end [m]: right and left at the first
            end, right and left at the last.
        """
        bearing, dof = self.parameters.bearing, self.span_dof[span]
        rows = np.zeros((4, self.n_dof))
        for end in range(2):
            x = (span + end) * self.parameters.span_length
            girder = dof[np.abs(self.place[dof] - [x, 0.0, 0.0]).max(axis=1) < 1e-6]
            girder = girder[np.argsort(self.component[girder])]
            for side, y in enumerate((bearing.y, -bearing.y)):
                rows[2 * end + side, girder] = -rigid_arm(y, bearing.z)[Z]
                rows[2 * end + side, self.pier_top_dof[span + end]] = rigid_arm(y, 0.0)[Z]
        return sparse.csr_array(rows)


@dataclass(frozen=True)
class ModalDamping:
    """C = a M + Σ c_k (M φ_k)(M φ_k)ᵀ: sparse, and of low rank.

    Attributes
    ----------
    rate
        a, the rate of every mode above the cut-off [1/s].
    mass : csr (dof, dof)
        M.
    frequency : (mode,)
        Undamped frequencies up to the cut-off, rising [Hz].
    shape : (dof, mode)
        Their shapes φ, of unit modal mass.
    mass_shape : (dof, mode)
        M φ.
    coefficient : (mode,)
        c_k = 2 ζ (ω_k - ω_c) [1/s], none positive.
    """

    rate: float
    mass: sparse.csr_array
    frequency: FloatArray
    shape: FloatArray
    mass_shape: FloatArray
    coefficient: FloatArray

    def matvec(self, velocity: FloatArray) -> FloatArray:
        """Damping force C v.

        Parameters
        ----------
        velocity : (dof,)
            Velocity of the degrees of freedom [m/s, rad/s].

        Returns
        -------
        force : (dof,)
            Force and moment [N, N m].
        """
        modal = self.coefficient * (self.mass_shape.T @ velocity)
        return self.rate * (self.mass @ velocity) + self.mass_shape @ modal


@dataclass(frozen=True)
class SpanModel:
    """Matrices and nodes of one span."""

    mass: sparse.csr_array
    stiffness: sparse.csr_array
    motion: sparse.csr_array  # (6 node, dof of a span)
    component: IntArray
    place: FloatArray
    girder: tuple[IntArray, IntArray]  # first and second node of its elements, in order of x
    rails: tuple[tuple[IntArray, IntArray], tuple[IntArray, IntArray]]  # right, left
    node_x: FloatArray


def build(guideway: Guideway) -> GuidewayModel:
    """Assemble the guideway.

    Girder nodes lie at the connectors, the ends and midspan, rail nodes at the connectors and the
    ends of each unit; ``refinement`` divides every element.  One span and one pier are made and
    repeated.

    Parameters
    ----------
    guideway
        Parameters of the guideway.

    Returns
    -------
    model
        Degrees of freedom in the order pier, span, pier, …; each span's sorted along x.

    Examples
    --------
    >>> model = build(Guideway(n_spans=1))
    >>> model.pier_top_dof.shape  # two piers
    (2, 6)
    """
    span, pier_mass, pier_stiffness, pier_depth = one_span(guideway), *one_pier(guideway)
    n_pier, n_span, n_spans = pier_mass.shape[0], span.mass.shape[0], guideway.n_spans
    pitch = n_pier + n_span
    pier_start = pitch * np.arange(n_spans + 1)
    span_start = pier_start[:-1] + n_pier

    def in_order(of_pier, of_span):
        return sparse.block_diag([of_pier, of_span] * n_spans + [of_pier], format="coo")

    n_dof = int(pier_start[-1]) + n_pier
    bearing_stiffness, bearing_damping = _bearings(guideway, span, pier_start, span_start, n_dof)
    mass = in_order(pier_mass, span.mass).tocsr()
    stiffness = in_order(pier_stiffness, span.stiffness).tocsr() + bearing_stiffness

    component = np.tile(np.arange(6), n_pier // 6)
    pier_place = np.zeros((n_pier, 3))
    pier_place[:, Z] = guideway.bearing.z + np.repeat(pier_depth, 6)
    places, components = [], []
    for j in range(n_spans + 1):
        shift = np.array([j * guideway.span_length, 0.0, 0.0])
        places.append(pier_place + shift)
        components.append(component)
        if j < n_spans:
            places.append(span.place + shift)
            components.append(span.component)

    return GuidewayModel(
        parameters=guideway,
        mass=mass,
        stiffness=stiffness,
        bearing_damping=bearing_damping,
        span_dof=tuple(start + np.arange(n_span) for start in span_start),
        pier_top_dof=pier_start[:, np.newaxis] + np.arange(6),
        pier_dof=tuple(start + np.arange(6, n_pier) for start in pier_start),
        component=np.concatenate(components),
        place=np.concatenate(places),
        rail_lines=(
            _line(guideway, guideway.rail.section, span, span.rails[0], span_start),
            _line(guideway, guideway.rail.section, span, span.rails[1], span_start),
        ),
        girder_line=_line(guideway, guideway.girder, span, span.girder, span_start),
    )


def modes(model: GuidewayModel, cutoff_hz: float) -> tuple[FloatArray, FloatArray]:
    """Every undamped mode of the whole guideway up to a frequency.

    The number of modes below the cut-off is the number of negative pivots of K - ω_c² M
    (Sylvester), so that none is missed; the modes themselves come from a Lanczos iteration on
    K⁻¹ M with a fixed start vector.

    Parameters
    ----------
    model
        The guideway.
    cutoff_hz
        Highest frequency wanted [Hz].

    Returns
    -------
    frequency : (mode,)
        Rising [Hz].
    shape : (dof, mode)
        Of unit modal mass, largest entry positive.

    Raises
    ------
    UserError
        If the cut-off is not positive or the model has no modes above it.
    RuntimeError
        If the iteration missed a mode.

    References
    ----------
    Parlett, The Symmetric Eigenvalue Problem (1998), ch. 3 and 13.

    Examples
    --------
    >>> frequency, shape = modes(build(Guideway(n_spans=1)), 20.0)
    >>> bool(frequency.size > 0 and frequency[-1] <= 20.0)
    True
    """
    if not cutoff_hz > 0:
        raise UserError(f"cutoff_hz must be positive, got {cutoff_hz} Hz")
    K, M = model.stiffness.tocsc(), model.mass.tocsc()
    squared = (2 * math.pi * cutoff_hz) ** 2
    pivots = _factors(K - squared * M).U.diagonal()
    n_modes = int(np.count_nonzero(pivots < 0))
    if n_modes >= model.n_dof - 1:
        raise UserError(
            f"cutoff_hz must lie below the model's highest mode, got {cutoff_hz} Hz; "
            "refine the model"
        )
    if n_modes == 0:
        return np.zeros(0), np.zeros((model.n_dof, 0))
    inverse = LinearOperator(K.shape, matvec=_factors(K).solve, dtype=float)
    start = np.random.default_rng(0).standard_normal(model.n_dof)  # fixed: the same modes each time
    value, shape = eigsh(K, k=n_modes, M=M, sigma=0.0, OPinv=inverse, v0=start, which="LM")
    order = np.argsort(value)
    value, shape = value[order], shape[:, order]
    if not value[-1] <= squared:
        raise RuntimeError(
            f"{n_modes} modes lie below {cutoff_hz} Hz, but the iteration found one at "
            f"{math.sqrt(value[-1]) / (2 * math.pi):.6g} Hz in their place"
        )
    largest = np.argmax(np.abs(shape), axis=0)
    shape = shape * np.sign(shape[largest, np.arange(n_modes)])
    return np.sqrt(value) / (2 * math.pi), shape


def damping(model: GuidewayModel, ratio: float, cutoff_hz: float) -> ModalDamping:
    """Damping of the structure: one ratio for every mode up to a frequency.

    Modes above the cut-off keep its absolute rate 2 ζ ω_c.  The bearings' own damping comes on top
    (`GuidewayModel.bearing_damping`).

    Parameters
    ----------
    model
        The guideway.
    ratio
        Share of critical damping ζ [-].
    cutoff_hz
        Frequency ω_c / 2π up to which the ratio holds [Hz].

    Returns
    -------
    damping
        C = 2 ζ ω_c M + Σ 2 ζ (ω_k - ω_c) M φ_k φ_kᵀ M over the modes below ω_c.

    Raises
    ------
    UserError
        If ``ratio`` is not in [0, 1), or for a cut-off that `modes` refuses.

    References
    ----------
    Wilson and Penzien, Int. J. Numer. Methods Eng. 4 (1972) 5-10.

    Examples
    --------
    >>> found = damping(build(Guideway(n_spans=1)), 0.02, 20.0)
    >>> bool((found.coefficient <= 0.0).all())
    True
    """
    if not 0 <= ratio < 1:
        raise UserError(f"damping ratio must lie in [0, 1), got {ratio}")
    frequency, shape = modes(model, cutoff_hz)
    return ModalDamping(
        rate=2 * ratio * 2 * math.pi * cutoff_hz,
        mass=model.mass,
        frequency=frequency,
        shape=shape,
        mass_shape=model.mass @ shape,
        coefficient=2 * ratio * 2 * math.pi * (frequency - cutoff_hz),
    )


def _factors(matrix: sparse.csc_array) -> SuperLU:
    """Factors of a symmetric matrix with pivots on the diagonal."""
    return splu(
        matrix,
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def rigid_arm(dy: float, dz: float) -> FloatArray:
    """Six motions at a point (0, dy, dz) from those of the node that carries it rigidly.

    Examples
    --------
    >>> float(rigid_arm(1.1, 0.0)[Z, ROLL])  # a turn to the right lowers the right rail
    1.1
    """
    arm = np.eye(6)
    arm[X, PITCH], arm[X, YAW] = dz, -dy
    arm[Y, ROLL] = -dz
    arm[Z, ROLL] = dy
    return arm


def _divided(x: FloatArray, refinement: int) -> FloatArray:
    """Each interval of ``x`` divided into ``refinement`` equal parts."""
    fine = np.arange((x.size - 1) * refinement + 1) / refinement
    return np.interp(fine, np.arange(x.size), x)


def _scattered(blocks: FloatArray, dof: IntArray, n: int) -> sparse.csr_array:
    """Sum of square blocks (block, k, k) at the rows and columns ``dof`` (block, k)."""
    row = np.repeat(dof, dof.shape[1], axis=1).ravel()
    column = np.tile(dof, (1, dof.shape[1])).ravel()
    return sparse.coo_array((blocks.ravel(), (row, column)), shape=(n, n)).tocsr()


def one_span(guideway: Guideway) -> SpanModel:
    """One span: girder and two rails, the arms between them eliminated.

    Examples
    --------
    >>> span = one_span(Guideway())
    >>> float(span.node_x.max())
    24.768
    """
    rail, r = guideway.rail, guideway.refinement
    n = rail.units_per_span * rail.connectors_per_unit
    half = guideway.span_length / (2 * n)  # half a connector spacing: every node is a multiple
    station = np.unique([0, n, 2 * n, *range(1, 2 * n, 2)])
    girder_x = _divided(half * station, r)
    connector_station = np.arange(1, 2 * n, 2)
    girder_node = r * np.searchsorted(station, connector_station)

    unit = 2 * rail.connectors_per_unit
    unit_station = np.array([0, *range(1, unit, 2), unit])
    unit_x = [_divided(half * (unit * u + unit_station), r) for u in range(rail.units_per_span)]
    side_x = np.concatenate(unit_x)
    unit_first = unit_x[0].size * np.arange(rail.units_per_span)[:, np.newaxis]
    connector = (unit_first + r * np.arange(1, rail.connectors_per_unit + 1)).ravel()
    element = (unit_first + np.arange(unit_x[0].size - 1)).ravel()

    n_girder, n_side = girder_x.size, side_x.size
    node_x = np.concatenate([girder_x, side_x, side_x])
    node_y = np.repeat([0.0, rail.y, -rail.y], [n_girder, n_side, n_side])
    node_z = np.repeat([0.0, rail.z, rail.z], [n_girder, n_side, n_side])
    first = np.arange(n_girder - 1)
    girder = (first, first + 1)
    right, left = (
        (begin + element, begin + element + 1) for begin in (n_girder, n_girder + n_side)
    )
    rails = (right, left)

    # Full matrices, node by node.
    n_full = 6 * node_x.size
    stiffness = sparse.csr_array((n_full, n_full))
    mass = sparse.csr_array((n_full, n_full))
    for section, (begin, end) in (
        (guideway.girder, girder),
        (rail.section, rails[0]),
        (rail.section, rails[1]),
    ):
        length = node_x[end] - node_x[begin]
        dof = np.hstack(
            [6 * begin[:, np.newaxis] + np.arange(6), 6 * end[:, np.newaxis] + np.arange(6)]
        )
        stiffness += _scattered(
            np.stack([timoshenko.stiffness(section, L) for L in length]), dof, n_full
        )
        mass += _scattered(np.stack([timoshenko.mass(section, L) for L in length]), dof, n_full)
    lumped = np.zeros((node_x.size, 6))
    tied = np.concatenate([n_girder + connector, n_girder + n_side + connector])
    lumped[tied, :3] = rail.connector_mass * 2 * half
    mass += sparse.diags_array(lumped.ravel())

    # What is free, in order of x, and how the tied rail nodes follow their girder node.
    free = np.ones((node_x.size, 6), dtype=bool)
    free[tied] = False
    if rail.connector_longitudinal == "sliding":
        anchored = np.arange(connector.size) % rail.connectors_per_unit == 0
        free[tied, X] = ~np.tile(anchored, 2)
    place = np.stack([node_x, node_y, node_z], axis=1)
    free_dof = np.flatnonzero(free.ravel())
    free_dof = free_dof[np.argsort(node_x[free_dof // 6], kind="stable")]
    number = np.full(n_full, -1)
    number[free_dof] = np.arange(free_dof.size)

    row, column, value = [free_dof], [np.arange(free_dof.size)], [np.ones(free_dof.size)]
    for node, leader in zip(tied, np.tile(girder_node, 2), strict=True):
        arm = rigid_arm(node_y[node], node_z[node])
        arm[free[node]] = 0.0
        i, j = np.nonzero(arm)
        row.append(6 * node + i)
        column.append(number[6 * leader + j])
        value.append(arm[i, j])
    motion = sparse.coo_array(
        (np.concatenate(value), (np.concatenate(row), np.concatenate(column))),
        shape=(n_full, free_dof.size),
    ).tocsr()
    return SpanModel(
        mass=(motion.T @ mass @ motion).tocsr(),
        stiffness=(motion.T @ stiffness @ motion).tocsr(),
        motion=motion,
        component=free_dof % 6,
        place=place[free_dof // 6],
        girder=girder,
        rails=rails,
        node_x=node_x,
    )


def pier_section(pier: Pier, width_y: float) -> BeamSection:
    """Section of a pier in the axes of a beam that runs downwards (its z is -x of the guideway).

    Examples
    --------
    >>> round(pier_section(Pier(), 1.8).area, 2)
    3.24
    """
    wx, wy = pier.width_x, width_y
    about_y, about_x = wy * wx**3 / 12, wx * wy**3 / 12
    return BeamSection.model_construct(
        elastic_modulus=pier.elastic_modulus,
        poisson_ratio=pier.poisson_ratio,
        density=pier.density,
        area=wx * wy,
        second_moment_vertical=about_y,
        second_moment_lateral=about_x,
        torsion_constant=rectangle_torsion_constant(wx, wy),
        polar_inertia=pier.density * (about_x + about_y),
        shear_coefficient_vertical=pier.shear_coefficient,
        shear_coefficient_lateral=pier.shear_coefficient,
    )


def rectangle_torsion_constant(width: float, depth: float) -> float:
    """Saint-Venant torsion constant of a rectangle.

    Parameters
    ----------
    width, depth
        Sides, in either order [m].

    Returns
    -------
    constant
        J = a b³ (1/3 - 64 b / (π⁵ a) Σ tanh(n π a / 2 b) / n⁵), n odd, with a ≥ b [m^4].

    Raises
    ------
    UserError
        If a side is not positive.

    References
    ----------
    Timoshenko and Goodier, Theory of Elasticity (1970), sec. 109.

    Examples
    --------
    >>> round(rectangle_torsion_constant(1.0, 1.0), 4)
    0.1406
    """
    if not (width > 0 and depth > 0):
        raise UserError(f"sides must be positive, got {width} m and {depth} m")
    a, b = max(width, depth), min(width, depth)
    n = np.arange(1, 2 * _TORSION_TERMS, 2)
    series = np.sum(np.tanh(n * math.pi * a / (2 * b)) / n**5.0)
    return float(a * b**3 * (1 / 3 - 64 * b / (math.pi**5 * a) * series))


def one_pier(guideway: Guideway) -> tuple[sparse.csr_array, sparse.csr_array, FloatArray]:
    """Mass, stiffness and depth below the top [m] of a pier's nodes, foot left out.

    Examples
    --------
    >>> mass, stiffness, depth = one_pier(Guideway())
    >>> mass.shape == stiffness.shape == (6 * depth.size, 6 * depth.size)
    True
    """
    pier, r = guideway.pier, guideway.refinement
    cap = math.ceil(pier.cap_height / PIER_ELEMENT - 1e-9) * r
    shaft = math.ceil((pier.height - pier.cap_height) / PIER_ELEMENT - 1e-9) * r
    depth = np.concatenate(
        [
            np.linspace(0.0, pier.cap_height, cap + 1),
            np.linspace(pier.cap_height, pier.height, shaft + 1)[1:],
        ]
    )
    section = [pier_section(pier, pier.cap_width_y)] * cap + [
        pier_section(pier, pier.width_y)
    ] * shaft
    pairs = list(zip(section, np.diff(depth), strict=True))
    dof = 6 * np.arange(cap + shaft)[:, np.newaxis] + np.arange(12)
    mass, stiffness = (
        _scattered(
            np.stack([timoshenko.turned(matrix(s, length), PIER_AXES) for s, length in pairs]),
            dof,
            6 * depth.size,
        )[:-6, :-6]
        for matrix in (timoshenko.mass, timoshenko.stiffness)
    )
    return mass, stiffness, depth[:-1]


def _bearings(
    guideway: Guideway, span: SpanModel, pier_start: IntArray, span_start: IntArray, n_dof: int
) -> tuple[sparse.csr_array, sparse.csr_array]:
    """Stiffness and damping of all bearings: girder end against pier top, in x, y and z."""
    bearing = guideway.bearing
    stretch = np.concatenate(
        [
            np.hstack([rigid_arm(y, bearing.z)[:3], -rigid_arm(y, 0.0)[:3]])
            for y in (bearing.y, -bearing.y)
        ]
    )  # (two bearings times x, y, z; girder end and pier top)
    last_node = span.girder[1][-1]
    end_dof = [
        np.array([span.motion.indices[span.motion.indptr[6 * node + i]] for i in range(6)])
        for node in (0, last_node)
    ]
    first = np.hstack(
        [span_start[:, np.newaxis] + end_dof[0], pier_start[:-1, np.newaxis] + np.arange(6)]
    )
    last = np.hstack(
        [span_start[:, np.newaxis] + end_dof[1], pier_start[1:, np.newaxis] + np.arange(6)]
    )

    def summed(
        at_first: float, at_last: float, lateral: float, vertical: float
    ) -> sparse.csr_array:
        blocks = []
        for longitudinal in (at_first, at_last):
            strength = np.tile([longitudinal, lateral, vertical], 2)
            blocks += [stretch.T @ (strength[:, np.newaxis] * stretch)] * guideway.n_spans
        return _scattered(np.stack(blocks), np.concatenate([first, last]), n_dof)

    return (
        summed(
            bearing.fixed_longitudinal_stiffness,
            bearing.free_longitudinal_stiffness,
            bearing.lateral_stiffness,
            bearing.vertical_stiffness,
        ),
        summed(*[bearing.damping] * 4),
    )


def _line(
    guideway: Guideway,
    section: BeamSection,
    span: SpanModel,
    element: tuple[IntArray, IntArray],
    span_start: IntArray,
) -> BeamLine:
    """One axis of a span, repeated along the guideway."""
    begin, end = element
    length = np.tile(span.node_x[end] - span.node_x[begin], guideway.n_spans)
    origin = guideway.span_length * np.arange(guideway.n_spans)[:, np.newaxis]
    vertical, lateral = timoshenko.shear_flexibility(section, length)

    def plane(phi: FloatArray, displacement: int, rotation: int, sign: float) -> BeamPlane:
        at_begin = (6 * begin + displacement, 6 * begin + rotation)
        at_end = (6 * end + displacement, 6 * end + rotation)
        row = np.stack([*at_begin, *at_end], axis=1)  # (element, 4) of span.motion
        first, count = span.motion.indptr[row], np.diff(span.motion.indptr)[row]
        term = np.arange(count.max())
        used = term < count[..., np.newaxis]
        entry = np.where(used, first[..., np.newaxis] + term, first[..., np.newaxis])
        share = np.where(used, span.motion.data[entry], 0.0)
        share[:, [1, 3]] *= sign
        dof = span.motion.indices[entry] + span_start[:, np.newaxis, np.newaxis, np.newaxis]
        return BeamPlane(
            phi=phi,
            dof=dof.reshape(-1, 4, term.size),
            share=np.tile(share, (guideway.n_spans, 1, 1)),
        )

    return BeamLine(
        start=(origin + span.node_x[begin]).ravel(),
        length=length,
        vertical=plane(vertical, Z, PITCH, -1.0),  # du_z/dx = -θ
        lateral=plane(lateral, Y, YAW, 1.0),  # du_y/dx = ψ
    )


def _line_rows(
    line: BeamLine, x: npt.ArrayLike, n_dof: int
) -> tuple[sparse.csr_array, sparse.csr_array, sparse.csr_array, sparse.csr_array]:
    """Rows of u_z, du_z/dx, u_y, du_y/dx at places along an axis; zero beyond its ends."""
    return (
        _plane_rows(line, line.vertical, timoshenko.deflection_shape, x, n_dof),
        _plane_rows(line, line.vertical, timoshenko.slope_shape, x, n_dof),
        _plane_rows(line, line.lateral, timoshenko.deflection_shape, x, n_dof),
        _plane_rows(line, line.lateral, timoshenko.slope_shape, x, n_dof),
    )


def _plane_rows(
    line: BeamLine,
    plane: BeamPlane,
    of_nodes: Callable[..., FloatArray],
    x: npt.ArrayLike,
    n_dof: int,
) -> sparse.csr_array:
    """Rows of one motion in one plane at places along an axis; zero beyond its ends."""
    x = np.atleast_1d(np.asarray(x, dtype=float))
    on = (x >= 0) & (x <= line.start[-1] + line.length[-1])
    e = np.clip(np.searchsorted(line.start, x, side="right") - 1, 0, None)
    at = np.where(on, x - line.start[e], 0.0)
    shape = of_nodes(line.length[e], plane.phi[e], at) * on[:, np.newaxis]
    entry = shape[:, :, np.newaxis] * plane.share[e]
    pointer = entry.shape[1] * entry.shape[2] * np.arange(x.size + 1)
    return sparse.csr_array((entry.ravel(), plane.dof[e].ravel(), pointer), shape=(x.size, n_dof))
