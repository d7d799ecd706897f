"""The beam element against exact solutions of Timoshenko's beam."""

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose

from maglev.mechanics import timoshenko
from maglev.mechanics.timoshenko import PITCH, ROLL, YAW, X, Y, Z
from maglev.parameters import BeamSection

GIRDER = BeamSection()
LENGTH = 24.768  # of a span [m]
SLENDER = BeamSection(
    second_moment_vertical="1e-4 m^4",
    second_moment_lateral="2e-4 m^4",
    shear_coefficient_vertical=1e6,
    shear_coefficient_lateral=1e6,
)  # rotary inertia and shear count for nothing: Euler's beam


def row_of_elements(section, length, n):
    """Stiffness and mass of a straight beam of n elements, (6 (n + 1), 6 (n + 1)) each."""
    stiffness, mass = np.zeros((2, 6 * (n + 1), 6 * (n + 1)))
    for e in range(n):
        dof = slice(6 * e, 6 * e + 12)
        stiffness[dof, dof] += timoshenko.stiffness(section, length / n)
        mass[dof, dof] += timoshenko.mass(section, length / n)
    return stiffness, mass


def supported_frequencies(section, length, n, deflection, rotation):
    """Frequencies [rad/s] of one plane of bending, deflection held at both ends."""
    stiffness, mass = row_of_elements(section, length, n)
    plane = np.sort(np.concatenate([6 * np.arange(n + 1) + c for c in (deflection, rotation)]))
    free = plane[~np.isin(plane, [deflection, 6 * n + deflection])]
    grid = np.ix_(free, free)
    return np.sqrt(scipy.linalg.eigh(stiffness[grid], mass[grid], eigvals_only=True))


def exact_frequency(section, length, n, second_moment, shear_coefficient):
    """Lower root of Timoshenko's frequency equation for a simply supported beam [rad/s]."""
    k = n * np.pi / length
    m, EI = section.density * section.area, section.elastic_modulus * second_moment
    shear = shear_coefficient * section.shear_modulus * section.area
    turning = section.density * second_moment
    a = m * turning / shear
    b = m + m * EI * k**2 / shear + turning * k**2
    return np.sqrt(2 * EI * k**4 / (b + np.sqrt(b**2 - 4 * a * EI * k**4)))


PLANES = {
    "vertical": (Z, PITCH, "second_moment_vertical", "shear_coefficient_vertical"),
    "lateral": (Y, YAW, "second_moment_lateral", "shear_coefficient_lateral"),
}


@pytest.mark.parametrize("plane", PLANES)
def test_cantilever_tip_deflection_is_bending_plus_shear(plane):
    deflection, rotation, second_moment, shear_coefficient = PLANES[plane]
    section = GIRDER.model_copy(update={"shear_coefficient_lateral": 0.3})
    length, load = 3.096, 1.0e5
    stiffness, _ = row_of_elements(section, length, 3)
    force = np.zeros(24)
    force[18 + deflection] = load
    tip = np.linalg.solve(stiffness[6:, 6:], force[6:])[12:]
    EI = section.elastic_modulus * getattr(section, second_moment)
    shear = getattr(section, shear_coefficient) * section.shear_modulus * section.area
    assert_allclose(tip[deflection], load * length**3 / (3 * EI) + load * length / shear, rtol=1e-9)
    sign = {PITCH: -1.0, YAW: 1.0}[rotation]  # the tip dips, the nose pitches down; right, it yaws
    assert_allclose(tip[rotation], sign * load * length**2 / (2 * EI), rtol=1e-9)


@pytest.mark.parametrize("component", [X, ROLL])
def test_tension_and_torsion_are_exact(component):
    length = 3.096
    rigidity = {
        X: GIRDER.elastic_modulus * GIRDER.area,
        ROLL: GIRDER.shear_modulus * GIRDER.torsion_constant,
    }[component]
    stiffness = timoshenko.stiffness(GIRDER, length)[6:, 6:]
    assert_allclose(np.linalg.inv(stiffness)[component, component], length / rigidity, rtol=1e-12)


def rigid_motions(length):
    """Nodal motions (12, 6) for unit motion x, y, z, roll, pitch, yaw of the first node."""
    motions = np.vstack([np.eye(6), np.eye(6)])
    motions[6 + Z, PITCH] = -length
    motions[6 + Y, YAW] = length
    return motions


def test_rigid_motions_strain_nothing():
    stiffness = timoshenko.stiffness(GIRDER, 0.774)
    assert_allclose(stiffness @ rigid_motions(0.774), 0.0, atol=1e-9 * np.abs(stiffness).max())
    assert np.linalg.matrix_rank(stiffness, tol=1e-6 * np.linalg.norm(stiffness)) == 6


def test_rigid_motions_carry_the_inertia_of_a_rod():
    L = 0.774
    inertia = rigid_motions(L).T @ timoshenko.mass(GIRDER, L) @ rigid_motions(L)
    m, rho = GIRDER.density * GIRDER.area, GIRDER.density
    assert_allclose(
        np.diag(inertia),
        [
            m * L,
            m * L,
            m * L,
            GIRDER.polar_inertia * L,
            m * L**3 / 3 + rho * GIRDER.second_moment_vertical * L,
            m * L**3 / 3 + rho * GIRDER.second_moment_lateral * L,
        ],
        rtol=1e-12,
    )
    assert_allclose([inertia[Z, PITCH], inertia[Y, YAW]], [-m * L**2 / 2, m * L**2 / 2], rtol=1e-12)


def test_mass_without_shear_is_the_tabulated_one_of_a_slender_beam():
    L = 3.096
    slender = SLENDER.model_copy(
        update={"second_moment_vertical": 1e-12, "second_moment_lateral": 1e-12}
    )
    mass = timoshenko.mass(slender, L)
    # Przemieniecki, Theory of Matrix Structural Analysis (1968), eq. 11.30.
    # fmt: off
    table = slender.density * slender.area * L / 420 * np.array([
        [156.0,    22 * L,     54.0,    -13 * L],
        [22 * L,    4 * L**2,  13 * L,   -3 * L**2],
        [54.0,     13 * L,    156.0,    -22 * L],
        [-13 * L,  -3 * L**2, -22 * L,    4 * L**2],
    ])
    # fmt: on
    for dof, sign in (([Y, YAW, 6 + Y, 6 + YAW], 1), ([Z, PITCH, 6 + Z, 6 + PITCH], -1)):
        turn = np.array([1, sign, 1, sign])
        assert_allclose(mass[np.ix_(dof, dof)], turn[:, np.newaxis] * table * turn, rtol=1e-9)


def test_matrices_are_symmetric_and_the_mass_positive():
    stiffness, mass = timoshenko.stiffness(GIRDER, 0.387), timoshenko.mass(GIRDER, 0.387)
    assert_allclose(stiffness, stiffness.T, rtol=1e-14)
    assert_allclose(mass, mass.T, rtol=1e-14)
    assert np.linalg.eigvalsh(mass).min() > 0


@pytest.mark.parametrize("plane", PLANES)
def test_euler_limit_reproduces_the_closed_form(plane):
    deflection, rotation, second_moment, _ = PLANES[plane]
    found = supported_frequencies(SLENDER, LENGTH, 24, deflection, rotation)[:4]
    EI = SLENDER.elastic_modulus * getattr(SLENDER, second_moment)
    n = np.arange(1, 5)
    closed = (n * np.pi / LENGTH) ** 2 * np.sqrt(EI / (SLENDER.density * SLENDER.area))
    assert_allclose(found, closed, rtol=5e-5)


@pytest.mark.parametrize("plane", PLANES)
@pytest.mark.parametrize(("shear", "order"), [(True, 2.0), (False, 4.0)])
def test_frequencies_converge_to_the_exact_solution(plane, shear, order):
    deflection, rotation, second_moment, shear_coefficient = PLANES[plane]
    section = GIRDER if shear else GIRDER.model_copy(update={shear_coefficient: 1e9})
    exact = exact_frequency(
        section, LENGTH, 3, getattr(section, second_moment), getattr(section, shear_coefficient)
    )
    sizes = np.array([12, 16, 24, 32])
    error = [
        supported_frequencies(section, LENGTH, n, deflection, rotation)[2] / exact - 1
        for n in sizes
    ]
    assert min(error) > 0  # a consistent mass never underestimates
    assert_allclose(-np.polyfit(np.log(sizes), np.log(error), 1)[0], order, atol=0.15)
    assert error[-1] < 1.5e-3  # third bending mode, elements one connector spacing long


def test_shear_strain_is_uniform_and_balances_the_end_force():
    length, phi = 0.774, timoshenko.shear_flexibility(GIRDER, 0.774)[0]
    x = np.linspace(0, length, 7)
    motion = np.array([1e-3, 2e-4, -3e-4, 5e-4])  # deflection and slope of either end
    strain = (
        timoshenko.slope_shape(length, phi, x) - timoshenko.rotation_shape(length, phi, x)
    ) @ motion
    nodal = np.zeros(12)
    nodal[[Z, PITCH, 6 + Z, 6 + PITCH]] = motion * [1, -1, 1, -1]
    end_force = timoshenko.stiffness(GIRDER, length)[6 + Z] @ nodal
    rigidity = GIRDER.shear_coefficient_vertical * GIRDER.shear_modulus * GIRDER.area
    assert_allclose(rigidity * strain, end_force, rtol=1e-9)


def test_slope_is_the_derivative_of_deflection():
    length, phi, step = 0.774, 5.8, 1e-5
    x = np.array([0.1, 0.387, 0.6])
    ahead = timoshenko.deflection_shape(length, phi, x + step)
    behind = timoshenko.deflection_shape(length, phi, x - step)
    assert_allclose(
        timoshenko.slope_shape(length, phi, x), (ahead - behind) / (2 * step), atol=1e-9
    )


def test_displacement_shape_moves_points_of_a_rigid_element_rigidly():
    x = np.array([0.0, 0.2, 0.774])
    motion = timoshenko.displacement_shape(GIRDER, 0.774, x) @ rigid_motions(0.774)
    expected = np.zeros((3, 3, 6))
    expected[:, [0, 1, 2], [X, Y, Z]] = 1.0
    expected[:, 1, YAW], expected[:, 2, PITCH] = x, -x
    assert_allclose(motion, expected, atol=1e-13)


def test_a_turned_element_bends_about_its_own_axes():
    column = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])  # x down, z backwards
    length = 10.0
    stiffness = timoshenko.turned(timoshenko.stiffness(GIRDER, length), column)
    flexibility = np.linalg.inv(stiffness[:6, :6])  # foot held
    E, GA = GIRDER.elastic_modulus, GIRDER.shear_modulus * GIRDER.area
    along = length**3 / (3 * E * GIRDER.second_moment_vertical) + length / (0.4 * GA)
    across = length**3 / (3 * E * GIRDER.second_moment_lateral) + length / (0.4 * GA)
    assert_allclose(
        np.diag(flexibility)[[X, Y, Z]], [along, across, length / (E * GIRDER.area)], rtol=1e-9
    )
    # Pushed forwards, the top of a column pitches backwards: its foot is below (z down).
    assert flexibility[PITCH, X] < 0 < flexibility[ROLL, Y]


def test_a_length_that_is_not_positive_is_refused():
    for compute in (timoshenko.stiffness, timoshenko.mass):
        with pytest.raises(ValueError, match="length must be positive, got -1"):
            compute(GIRDER, -1.0)
