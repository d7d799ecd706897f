"""The guideway under the train at rest."""

import numpy as np
from numpy.testing import assert_allclose
from scipy.sparse.linalg import spsolve

from maglev.mechanics import guideway, statics, train
from maglev.parameters import Guideway, Train

GUIDEWAY = guideway.build(Guideway(n_spans=3))
TRAIN = train.build(Train(n_cars=2))


def test_influence_gives_what_the_loaded_guideway_deflects():
    nose = 60.0
    load = np.zeros(GUIDEWAY.n_dof)
    magnets = TRAIN.magnets
    force = train.pole_static_force(TRAIN.parameters, magnets)
    offsets = train.pole_offsets(TRAIN.parameters.suspension_magnet)
    for k in np.flatnonzero(~magnets.is_guidance):
        rows, _, _, _ = GUIDEWAY.rail_rows(nose + magnets.x[k] + offsets, int(magnets.side[k]))
        load += rows.T @ force[k, : offsets.size]
    u_z, _ = GUIDEWAY.girder_rows([1.5 * GUIDEWAY.parameters.span_length])
    expected = (u_z @ spsolve(GUIDEWAY.stiffness.tocsc(), load))[0]
    assert_allclose(statics.deflection(GUIDEWAY, TRAIN, nose), expected, rtol=1e-9)


def test_the_train_at_rest_bends_a_span_by_its_weight():
    """1.624 mm by an independent change of the matrices for the weight that was missing."""
    assert_allclose(statics.largest_deflection(GUIDEWAY, TRAIN), 1.624e-3, rtol=5e-3)


def test_a_train_off_the_guideway_bends_nothing():
    assert statics.deflection(GUIDEWAY, TRAIN, -1.0) == 0.0
