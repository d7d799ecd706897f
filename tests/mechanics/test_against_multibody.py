"""Static forces and modes of one and two cars against the multibody program exudyn.

The stored result comes from tests/reference/make_multibody.py; where exudyn is installed it is also
made afresh.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import scipy.linalg
from numpy.testing import assert_allclose
from scipy.optimize import linear_sum_assignment

from maglev.mechanics.train import build, pole_offsets, pole_static_force
from maglev.parameters import Gains, Train

REFERENCE = Path(__file__).parents[1] / "reference"
STORED = json.loads((REFERENCE / "multibody.json").read_text())
CASES = {"one_car": 1, "two_cars": 2}
TOLERANCE = 1e-4  # of a frequency or force; the two programs differ by less than 1e-5


@pytest.fixture(scope="module")
def make_multibody():
    pytest.importorskip("exudyn")
    import make_multibody

    return make_multibody


def closed_matrices(model, gains):
    """Mass, stiffness and damping with every pole a linear spring and damper of its own."""
    train, magnets = model.parameters, model.magnets
    stiffness, damping = model.stiffness.toarray(), model.damping.toarray()
    for number, forces in enumerate(pole_static_force(train, magnets)):
        guidance = magnets.is_guidance[number]
        p = train.guidance_magnet if guidance else train.suspension_magnet
        k_p, k_d = gains.as_row[2:] if guidance else gains.as_row[:2]
        dofs = [magnets.translation_dof[number], magnets.rotation_dof[number]]
        for dx, force in zip(pole_offsets(p), forces, strict=False):
            row = np.array([1.0, dx if guidance else -dx])
            share = 2 * force * np.outer(row, row)
            stiffness[np.ix_(dofs, dofs)] += share * (
                k_p / p.current_reference - 1 / p.gap_reference
            )
            damping[np.ix_(dofs, dofs)] += share * k_d / p.current_reference
    return np.diag(model.mass), stiffness, damping


def upper_roots(mass, stiffness, damping):
    """Eigenvalues of the damped system with imaginary part not negative."""
    n = len(mass)
    inverse = np.linalg.inv(mass)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ stiffness, -inverse @ damping]])
    roots = np.linalg.eigvals(system)
    return roots[roots.imag >= 0]


def assert_same(result, case):
    model = build(Train(n_cars=CASES[case]))
    suspension = ~model.magnets.is_guidance
    force, moment = model.magnets.static_force[suspension], model.magnets.static_moment[suspension]
    assert_allclose(force, result["static_force"], rtol=TOLERANCE)
    assert_allclose(moment, result["static_moment"], rtol=TOLERANCE, atol=TOLERANCE * force.min())

    mass, stiffness, damping = closed_matrices(model, Gains())
    frequency = np.sqrt(scipy.linalg.eigh(stiffness, mass, eigvals_only=True)) / (2 * np.pi)
    assert_allclose(frequency, result["frequency_undamped"], rtol=TOLERANCE)

    roots = upper_roots(mass, stiffness, damping)
    expected = np.array(result["root_real"]) + 1j * np.array(result["root_imag"])
    assert roots.size == expected.size
    distance = np.abs(roots[:, None] - expected) / np.abs(expected)
    assert distance[linear_sum_assignment(distance)].max() < TOLERANCE


@pytest.mark.parametrize("case", CASES)
def test_static_forces_and_modes_agree_with_stored_exudyn_result(case):
    assert_same(STORED[case], case)


def test_static_forces_and_modes_agree_with_exudyn_run_now(make_multibody):
    assert_same(make_multibody.reference(1), "one_car")
