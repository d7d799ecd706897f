"""Trains of many samples at once: one shape, numbers of their own.

The bodies and links of `maglev.mechanics.train` are made once from arrays (sample,) in place of
numbers.  Theory: docs/theory/random_systems.md.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from maglev.arrays import FloatArray, IntArray
from maglev.mechanics import train as train_model
from maglev.mechanics.train import MagnetTable, TrainModel
from maglev.parameters import Magnet, Train


@dataclass(frozen=True)
class Trains:
    """Trains with open magnets, as `maglev.mechanics.train.TrainModel`, one a sample.

    Attributes
    ----------
    mass : (sample, dof)
        Diagonal of the mass matrix [kg, kg m²].
    link, dof : (entry,)
        Rows and columns of what is not zero among the links' strains, row by row.
    coefficient : (sample, entry)
        Strain of the link per unit of the degree of freedom.
    stiffness, damping : (sample, link)
        Of each link.
    pole_force : (sample, magnet, pole)
        At rest [N], as `maglev.mechanics.train.pole_static_force`.
    """

    mass: FloatArray
    link: IntArray
    dof: IntArray
    coefficient: FloatArray
    stiffness: FloatArray
    damping: FloatArray
    pole_force: FloatArray

    def on_the_diagonal(self, of_link: FloatArray) -> FloatArray:
        """Diagonal (sample, dof) of the matrix with these coefficients (sample, link)."""
        return _summed(self.dof, self.coefficient**2 * of_link[:, self.link], self.mass.shape[1])


@dataclass(frozen=True)
class Rates:
    """What a time step has to follow of trains with open magnets.

    Attributes
    ----------
    stiffness, damping : (sample, dof)
        On the diagonal, over the mass [1/s², 1/s].
    pull : kind of (sample, 2 pole)
        Force of each pole at rest over current at rest, and over the magnet's mass [m/(s² A)],
        then over its inertia [1/(kg m s² A)].
    """

    stiffness: FloatArray
    damping: FloatArray
    pull: tuple[FloatArray, FloatArray]


def own_rates(train: TrainModel) -> Rates:
    """Rates of one train (1, ...)."""
    return rates(build(train.parameters, train.magnets, 1), train.parameters, train.magnets)


def rates(trains: Trains, train: Train, magnets: MagnetTable) -> Rates:
    """Rates of trains.

    Parameters
    ----------
    trains, train, magnets
        As `build` gives and takes them.
    """

    def pull(kind: Magnet, *, guidance: bool) -> FloatArray:
        poles = trains.pole_force[:, magnets.is_guidance == guidance, : kind.n_poles]
        per_current = poles.reshape(poles.shape[0], -1) / np.reshape(
            kind.current_reference, (-1, 1)
        )
        inertias = (np.reshape(one, (-1, 1)) for one in (kind.mass, kind.inertia))
        return np.concatenate([per_current / one for one in inertias], axis=1)

    return Rates(
        stiffness=trains.on_the_diagonal(trains.stiffness) / trains.mass,
        damping=trains.on_the_diagonal(trains.damping) / trains.mass,
        pull=(
            pull(train.suspension_magnet, guidance=False),
            pull(train.guidance_magnet, guidance=True),
        ),
    )


def build(train: Train, magnets: MagnetTable, n_samples: int) -> Trains:
    """Assemble trains whose parameters are arrays (sample,) where they differ.

    Parameters
    ----------
    train
        Numbers, or arrays in their places.
    magnets
        Where magnets are, which all share.
    n_samples
        Number of trains.

    Raises
    ------
    UserError
        If a pole would have to push at rest.
    """
    assembly, _, _ = train_model.assemble(train)
    link = np.repeat(np.arange(len(assembly.links)), [len(one.motion) for one in assembly.links])
    dof = np.array([dof for one in assembly.links for dof in one.motion])
    order = np.lexsort((dof, link))
    strains = [factor for one in assembly.links for factor in one.motion.values()]
    found = Trains(
        mass=_columns(assembly.mass, n_samples),
        link=link[order],
        dof=dof[order],
        coefficient=_columns([strains[k] for k in order], n_samples),
        stiffness=_columns([one.stiffness for one in assembly.links], n_samples),
        damping=_columns([one.damping for one in assembly.links], n_samples),
        pole_force=np.zeros(0),
    )
    elastic = _elastic_at_rest(found, magnets, _columns(assembly.weight, n_samples))
    weight = _columns([assembly.weight[k] for k in magnets.translation_dof], n_samples)
    lifted = weight - elastic[:, magnets.translation_dof]
    preload = _columns([train.guidance_magnet.preload], n_samples)
    force = np.where(magnets.is_guidance, preload, lifted)
    moment = np.where(magnets.is_guidance, 0.0, elastic[:, magnets.rotation_dof])
    poles = train_model.pole_static_force(train, magnets, (force, moment))
    return Trains(**(found.__dict__ | {"pole_force": poles}))


def _columns(numbers: Sequence[float | FloatArray | None], n_samples: int) -> FloatArray:
    """Numbers, or arrays (sample,), side by side (sample, number)."""
    table = np.empty((len(numbers), n_samples))
    for row, number in zip(table, numbers, strict=True):
        row[:] = number
    return np.ascontiguousarray(table.T)


def _summed(place: IntArray, values: FloatArray, n_places: int) -> FloatArray:
    """Sums (sample, place) of values (sample, entry) that belong to the same place."""
    order = np.argsort(place, kind="stable")
    found, first = np.unique(place[order], return_index=True)
    total = np.zeros((values.shape[0], n_places))
    total[:, found] = np.add.reduceat(np.ascontiguousarray(values[:, order]), first, axis=1)
    return total


def _elastic_at_rest(trains: Trains, magnets: MagnetTable, weight: FloatArray) -> FloatArray:
    """Forces of the links (sample, dof) with the train's weight on it and all magnets held."""
    n_samples, n_dof = trains.mass.shape
    free = np.ones(n_dof, dtype=bool)
    free[magnets.translation_dof] = free[magnets.rotation_dof] = False
    sag = np.zeros((n_samples, n_dof))
    for part in _parts(trains, free):
        inside = np.flatnonzero(np.isin(trains.dof, part))
        links, row = np.unique(trains.link[inside], return_inverse=True)
        strain = np.zeros((n_samples, links.size, part.size))
        column = np.searchsorted(part, trains.dof[inside])
        strain[:, row, column] = trains.coefficient[:, inside]
        pulled = np.swapaxes(strain * trains.stiffness[:, links, None], 1, 2)
        sag[:, part] = np.linalg.solve(pulled @ strain, weight[:, part, None])[..., 0]
    entries = trains.coefficient * sag[:, trains.dof]
    pull = _summed(trains.link, entries, trains.stiffness.shape[1]) * trains.stiffness
    return _summed(trains.dof, trains.coefficient * pull[:, trains.link], n_dof)


def _parts(trains: Trains, free: np.ndarray) -> list[IntArray]:
    """Degrees of freedom that springs join, those that are held left out."""
    n_links, n_dof = trains.stiffness.shape[1], trains.mass.shape[1]
    pulls = free[trains.dof] & (trains.stiffness[:, trains.link] != 0).any(axis=0)
    ones = np.ones(int(pulls.sum()))
    rows = sp.csr_array((ones, (trains.link[pulls], trains.dof[pulls])), shape=(n_links, n_dof))
    n_parts, label = connected_components(rows.T @ rows, directed=False)
    label[~free] = -1
    return [part for k in range(n_parts) if (part := np.flatnonzero(label == k)).size]
