"""The train: cars in a row, magnets shared by neighbours, and the force of each magnet at rest.

The train's nose is at x = 0, its cars at negative x, counted from the front like bogies, C-frames,
magnets and poles.  Displacements are measured from the static equilibrium on rigid straight track.
Magnets are open: their forces act on the matrices given here from outside.  Theory:
docs/theory/train.md.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from maglev.arrays import BoolArray, FloatArray, IntArray
from maglev.errors import UserError
from maglev.mechanics.bodies import assembled, link_rows
from maglev.mechanics.car import (
    LEFT,
    N_C_FRAMES,
    RIGHT,
    Assembly,
    Car,
    HungMagnet,
    add_car,
    add_magnet,
    station_x,
)
from maglev.parameters import Magnet, Train


@dataclass(frozen=True)
class MagnetTable:
    """All magnets: suspension, then guidance; of each kind right, then left; from the front.

    Attributes
    ----------
    is_guidance : (magnet,)
        Guidance (moves in y and psi) or suspension (z and theta).
    side : (magnet,)
        +1 right, -1 left.
    x : (magnet,)
        Centre relative to the train's nose [m], negative.
    translation_dof, rotation_dof : (magnet,)
        Indices of z and theta, or y and psi.
    static_force : (magnet,)
        Sum of the pole forces at rest [N]: upwards, or towards the guide rail.
    static_moment : (magnet,)
        Sum of pole force times its distance ahead of the centre at rest [N m]: positive where the
        front half carries more.  The generalised force of the poles on theta.
    car : (magnet,)
        Car of the magnet; one shared by two cars belongs to the car in front.
    """

    is_guidance: BoolArray
    side: IntArray
    x: FloatArray
    translation_dof: IntArray
    rotation_dof: IntArray
    static_force: FloatArray
    static_moment: FloatArray
    car: IntArray


@dataclass(frozen=True)
class TrainModel:
    """Mass, damping and stiffness of the train with its magnets open.

    Attributes
    ----------
    parameters
        Parameters of the train.
    mass : (dof,)
        Diagonal of the mass matrix [kg, kg m^2].
    stiffness : (dof, dof)
        Of the links [N/m, N, N m].
    damping : (dof, dof)
        Of the links [N s/m, N s, N m s].
    link_rows : (link, dof)
        Stretch [m] or twist [rad] of each link per unit of each degree of freedom.
    link_stiffness, link_damping : (link,)
        [N/m or N m/rad], [N s/m or N m s/rad]; ``stiffness = rows.T diag(link_stiffness) rows``.
    weight : (dof,)
        Weight on each degree of freedom, downwards [N].
    magnets
        Positions, degrees of freedom and static forces of the magnets.
    car_body_dof : (car, 5)
        Indices of each car body's y, z, phi, theta, psi.
    dof_names
        Name of each degree of freedom, such as ``car0.bogie3.phi_rear``.
    """

    parameters: Train
    mass: FloatArray
    stiffness: sp.csr_array
    damping: sp.csr_array
    link_rows: sp.csr_array
    link_stiffness: FloatArray
    link_damping: FloatArray
    weight: FloatArray
    magnets: MagnetTable
    car_body_dof: IntArray
    dof_names: tuple[str, ...]


def build(train: Train) -> TrainModel:
    """Assemble the train: 101 degrees of freedom a car and 8 for each coupling of two cars.

    Parameters
    ----------
    train
        Parameters of the train.

    Returns
    -------
    model
        Matrices, links and magnets.

    Raises
    ------
    UserError
        If the guidance magnets have no preload, the suspension magnets have one, or a pole would
        have to push at rest.

    References
    ----------
    docs/theory/train.md.

    Examples
    --------
    >>> build(Train(n_cars=1)).mass.size  # degrees of freedom
    101
    """
    preload = _checked_preload(train)
    assembly, cars, magnets = assemble(train)
    rows = link_rows(assembly.links, len(assembly.names))
    link_stiffness = np.array([link.stiffness for link in assembly.links])
    link_damping = np.array([link.damping for link in assembly.links])
    stiffness = assembled(rows, link_stiffness)
    weight = np.array(assembly.weight)
    table = _magnet_table(train, magnets, stiffness, weight, preload)
    pole_static_force(train, table)  # refuses a magnet whose poles cannot carry its load
    return TrainModel(
        parameters=train,
        mass=np.array(assembly.mass),
        stiffness=stiffness,
        damping=assembled(rows, link_damping),
        link_rows=rows,
        link_stiffness=link_stiffness,
        link_damping=link_damping,
        weight=weight,
        magnets=table,
        car_body_dof=np.array([car.body_dof for car in cars]),
        dof_names=tuple(assembly.names),
    )


def assemble(train: Train) -> tuple[Assembly, list[Car], list[tuple[int, HungMagnet]]]:
    """Bodies and links of the train, its cars, and the car and freedoms of each magnet.

    Magnets are in the order of `MagnetTable`.

    Examples
    --------
    >>> assembly, cars, magnets = assemble(Train(n_cars=2))
    >>> len(cars)
    2
    """
    assembly = Assembly()
    cars: list[Car] = []
    magnets: list[tuple[int, HungMagnet]] = []
    for number in range(train.n_cars):
        car = add_car(
            assembly,
            train,
            f"car{number}",
            is_first=number == 0,
            is_last=number == train.n_cars - 1,
        )
        if cars:
            magnets += [
                (
                    number - 1,
                    add_magnet(
                        assembly,
                        train,
                        f"car{number - 1}",
                        is_guidance,
                        side,
                        N_C_FRAMES - 1,
                        cars[-1].c_frames[-1],
                        car.c_frames[0],
                    ),
                )
                for is_guidance in (False, True)
                for side in (RIGHT, LEFT)
            ]
        magnets += [(number, magnet) for magnet in car.magnets]
        cars.append(car)
    magnets.sort(key=lambda item: (item[1].is_guidance, -item[1].side, item[0], item[1].station))
    return assembly, cars, magnets


def pole_offsets(magnet: Magnet) -> FloatArray:
    """Positions of a magnet's poles ahead of its centre, from the front.

    Parameters
    ----------
    magnet
        Parameters of the magnet.

    Returns
    -------
    offset : (pole,)
        x relative to the magnet's centre [m], falling.

    Examples
    --------
    >>> bool((np.diff(pole_offsets(Train().suspension_magnet)) < 0.0).all())  # from the front
    True
    """
    return (0.5 * (magnet.n_poles - 1) - np.arange(magnet.n_poles, dtype=float)) * magnet.pole_pitch


def pole_static_force(
    train: Train,
    magnets: MagnetTable,
    at_rest: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """Force of each pole at rest.

    The front and the rear half of a magnet each pull evenly; the difference of the halves carries
    the moment.  (A force linear in x would leave the innermost pole of an end magnet less than half
    of that: 0.8 kN beside 7.6 kN at the outermost.)  A middle pole takes the mean.

    Parameters
    ----------
    train
        Parameters of the train.
    magnets
        Static force and moment of each magnet.
    at_rest : (..., magnet), (..., magnet)
        Other forces [N] and moments [N m], such as those of many trains.

    Returns
    -------
    force : (..., magnet, pole)
        Attraction of each pole [N], poles from the front; where the two kinds differ in their
        number of poles, the rows of the kind with fewer end in zeros.

    Raises
    ------
    UserError
        If a pole would have to push, or a single pole to carry a moment.

    Examples
    --------
    >>> train = Train(n_cars=1)
    >>> model = build(train)
    >>> lifting = ~model.magnets.is_guidance
    >>> carried = pole_static_force(train, model.magnets)[lifting].sum()
    >>> bool(np.isclose(carried, model.weight.sum()))  # all of the weight
    True
    """
    kinds = (train.suspension_magnet, train.guidance_magnet)
    whole, turning = at_rest or (magnets.static_force, magnets.static_moment)
    force = np.zeros((*whole.shape, max(kind.n_poles for kind in kinds)))
    for is_guidance, kind in enumerate(kinds):
        rows = np.flatnonzero(magnets.is_guidance == bool(is_guidance))
        offset = pole_offsets(kind)
        lever = np.abs(offset).sum()
        moment = turning[..., rows, None]
        if lever == 0 and np.any(moment != 0):
            raise UserError(
                "train.suspension_magnet.n_poles must be at least 2 to carry a moment at rest, "
                f"got {kind.n_poles}"
            )
        uneven = moment * np.sign(offset) / lever if lever > 0 else 0.0
        force[..., rows, : kind.n_poles] = whole[..., rows, None] / kind.n_poles + uneven
        least = force[..., rows, : kind.n_poles].min()
        if not least > 0:
            raise UserError(
                f"each pole must attract at rest, got {least:g} N at a pole of a "
                f"{'guidance' if is_guidance else 'suspension'} magnet"
            )
    return force


def _checked_preload(train: Train) -> float:
    """Force of a guidance magnet at rest [N]; suspension magnets take theirs from the weight."""
    preload = train.guidance_magnet.preload
    if preload is None or not preload > 0:
        raise UserError(
            "train.guidance_magnet.preload must be a positive force, such as '10 kN', "
            f"got {preload}"
        )
    if train.suspension_magnet.preload is not None:
        raise UserError(
            "train.suspension_magnet.preload must be null, for the magnet carries its share of "
            f"the weight, got {train.suspension_magnet.preload:g} N"
        )
    return preload


def _magnet_table(
    train: Train,
    magnets: list[tuple[int, HungMagnet]],
    stiffness: sp.csr_array,
    weight: FloatArray,
    preload: float,
) -> MagnetTable:
    """Collect the magnets, and compute force and moment of each with all of them held still."""
    is_guidance = np.array([magnet.is_guidance for _, magnet in magnets])
    car = np.array([number for number, _ in magnets])
    station = np.array([magnet.station for _, magnet in magnets])
    translation = np.array([magnet.translation_dof for _, magnet in magnets])
    rotation = np.array([magnet.rotation_dof for _, magnet in magnets])
    front_end = np.array(station_x(train))[station]
    x = -(car + 0.5) * train.car_pitch + front_end - 0.5 * train.bogie.c_frame_spacing

    held = np.concatenate([translation, rotation])
    free = np.setdiff1d(np.arange(weight.size), held)
    sag = np.zeros(weight.size)
    sag[free] = spsolve(stiffness[free][:, free].tocsc(), weight[free])
    elastic = stiffness @ sag
    # Poles pull with sum(F) upwards and turn with sum(F dx): weight - K u - sum(F) = 0 on z,
    # - K u + sum(F dx) = 0 on theta.
    carried = weight[translation] - elastic[translation]
    return MagnetTable(
        is_guidance=is_guidance,
        side=np.array([magnet.side for _, magnet in magnets]),
        x=x,
        translation_dof=translation,
        rotation_dof=rotation,
        static_force=np.where(is_guidance, preload, carried),
        static_moment=np.where(is_guidance, 0.0, elastic[rotation]),
        car=car,
    )
