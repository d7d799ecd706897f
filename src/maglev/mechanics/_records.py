"""What the kernels read and write: records of arrays, all samples of a row side by side.

Arrays that end in ``LANES`` hold one number for each sample of a row; all share the others.
Where "own" stands beside an array (n,) or a number, each sample may have its own: it is then a
table of distinct rows (distinct, LANES), and the array named there says which row is whose.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

COMPLETED, CONTACT, GAP_LOST, NOT_FINITE, STEP_TOO_LARGE = 0, 1, 2, 3, 4
"""End of a passage: the values of ``status`` [-]."""


class Terms(NamedTuple):
    """Sums over few columns whose coefficients each sample has of its own, for some places only."""

    place: np.ndarray  # (sum,) where the sum belongs
    start: np.ndarray  # (sum + 1,)
    column: np.ndarray  # (term,)
    number: np.ndarray  # (term,) row of the coefficient
    rows: np.ndarray  # (distinct, LANES)


class Vehicle(NamedTuple):
    """Train with open magnets; links in rows and columns of non-zero coefficients.

    A link pulls by ``stiffness * x + damping * velocity`` of its degrees of freedom; this sum is
    formed once for each degree of freedom and kind of link.
    """

    inverse_mass: np.ndarray  # (dof,) own by mass_number
    mass_number: np.ndarray
    scaled_dof: np.ndarray  # (scaled,) degree of freedom
    scaled_stiffness: np.ndarray  # (scaled,) own by stiffness_number
    stiffness_number: np.ndarray
    scaled_damping: np.ndarray  # (scaled,) own by damping_number
    damping_number: np.ndarray
    link_start: np.ndarray  # (link + 1,) first scaled degree of freedom of each link
    link_scaled: np.ndarray  # (non-zero,)
    link_coefficient: np.ndarray  # (non-zero,)
    pull_start: np.ndarray  # (dof + 1,) the links that pull at a degree of freedom
    pull_link: np.ndarray  # (non-zero,)
    pull_coefficient: np.ndarray  # (non-zero,)
    own_link: Terms  # what each sample has of its own in links beyond these, and in pulls
    own_pull: Terms
    body_z: np.ndarray  # (car,) degree of freedom
    body_y: np.ndarray  # (car,)
    body_pitch: np.ndarray  # (car,)
    body_yaw: np.ndarray  # (car,)
    end_distance: float  # of the ends of a car body's floor from its centre [m]


class MagnetRows(NamedTuple):
    """Magnets of one kind in rows, the right and the left one at the same x."""

    x: np.ndarray  # (row,) centre relative to the nose [m]
    number: np.ndarray  # (row, side) row in the train's table of magnets
    translation: np.ndarray  # (row, side) degree of freedom
    rotation: np.ndarray  # (row, side)
    static_force: np.ndarray  # (row side,) [N] own by force_number
    force_number: np.ndarray
    static_moment: np.ndarray  # (row side,) [N m] own by moment_number
    moment_number: np.ndarray
    constant: np.ndarray  # (row side pole,) K of F = K (i/gap)^2 [N m^2/A^2] own by constant_number
    constant_number: np.ndarray
    offset: np.ndarray  # (pole,) ahead of the centre [m]
    arm: np.ndarray  # (pole,) displacement of the pole per rotation [m]
    outward: np.ndarray  # (side,) sign of the displacement that opens the gap
    gap_reference: float | np.ndarray  # [m] own, one row
    current_reference: float | np.ndarray  # [A] own, one row
    current_max: np.ndarray  # (row side,) [A] own by current_number
    current_number: np.ndarray
    mass: float | np.ndarray  # [kg] own, one row
    inertia: float | np.ndarray  # [kg m^2] own, one row
    is_guidance: bool


class Law(NamedTuple):
    """Law of control of one kind of magnet: from gaps to currents."""

    n_circuits: int  # of one magnet
    own_gap: bool  # every pole has a circuit that its own gap feeds
    mean_gap_force: bool  # forces go by the magnet's mean gap
    feed_start: np.ndarray  # (circuit + 1,) poles that feed a circuit
    feed_pole: np.ndarray
    feed_weight: np.ndarray
    arm: np.ndarray  # (circuit,) displacement of the signal per rotation of the magnet [m]
    senses: np.ndarray  # (pole,) whether the pole's gap feeds a circuit
    first: np.ndarray  # (pole,) the two circuits whose mean is the current of a pole
    second: np.ndarray
    lags: bool  # some sample's current follows its command with a lag
    decay: float | np.ndarray  # of the current in a step; zero without a lag [-] own, one row
    command_now: float | np.ndarray  # weight of the command at this step in the current [-] own
    command_before: float | np.ndarray  # and at the last
    delays: bool
    ring: int  # signals of so many steps are kept
    behind: int  # steps back to the latest of the three signals that a delayed one is taken from
    delayed: np.ndarray  # (3,) their weights [-]
    undelayed: float  # weight of the signal at this step [-]
    accelerates: bool  # some sample has a gain on the acceleration
    integrates: bool  # some sample has an integral part


class Circuits(NamedTuple):
    """State of the circuits of one kind; those of a magnet are adjacent."""

    current: np.ndarray  # (circuit, LANES) [A]
    command: np.ndarray  # (circuit, LANES) at the step before [A]
    error: np.ndarray  # (circuit, LANES) at the step before [m]
    integral: np.ndarray  # (circuit, LANES) of the error over time [m s]
    signal: np.ndarray  # (ring, circuit, LANES) beyond the current at rest [A]


class Magnet(NamedTuple):
    """One magnet at one step: gap errors and pulls of its poles, currents of its circuits."""

    error: np.ndarray  # (pole, LANES) gap error, in the direction of the displacement [m]
    rate: np.ndarray  # (pole, LANES) [m/s]
    pull: np.ndarray  # (pole, LANES) force on the rail, in the direction of the displacement [N]
    stiffening: np.ndarray  # (pole, LANES) force per acceleration of the circuit's signal [kg]
    current: np.ndarray  # (circuit, LANES) [A]


class Motion(NamedTuple):
    """Degrees of freedom of the train, or coordinates of the guideway, at one step."""

    position: np.ndarray  # (dof, LANES) at the step
    velocity: np.ndarray  # (dof, LANES) half a step later
    before: np.ndarray  # (dof, LANES) acceleration of the step before
    predicted: np.ndarray  # (dof, LANES) velocity that the forces see
    force: np.ndarray  # (dof, LANES) or the acceleration that follows from it


class Rails(NamedTuple):
    """Coefficients of the rails' motion (right z, left z, y); those of a span are adjacent."""

    motion: np.ndarray  # (field, coefficient, LANES)
    rate: np.ndarray  # (field, coefficient, LANES)
    force: np.ndarray  # (field, coefficient, LANES)


class Watch(NamedTuple):
    """Memory of the watched responses: filter states, last values, gaps and currents."""

    left_out: np.ndarray  # (6, LANES) midspan by left-out modes, its change, acceleration; z, y
    bearing: np.ndarray  # (4, LANES) opening of the bearings by left-out modes, as `Spans.bearing`
    filtered: np.ndarray  # (4 section, LANES) state of the low-pass
    recent: np.ndarray  # (2 response, LANES) last two values of each response
    magnet_min: np.ndarray  # (magnet, LANES) smallest gap of each magnet at this step [m]
    magnet_max: np.ndarray  # (magnet, LANES)
    magnet_gap: np.ndarray  # (magnet, LANES) mean of its poles [m]
    magnet_current: np.ndarray  # (magnet, LANES) [A]


class Comfort(NamedTuple):
    """Weightings of the accelerations at the ends of the car bodies, and when they are read."""

    every: int  # steps between two readings
    start: np.ndarray  # (weighting + 1,) into the sections; vertical and lateral in turns
    sections: np.ndarray  # (section, 6)
    first: np.ndarray  # (car,) step of the first reading that counts
    last: np.ndarray  # (car,) step of the last


class Weighing(NamedTuple):
    """State of the filters of all cars."""

    velocity: np.ndarray  # (4 car, LANES) z, pitch, y, yaw of each body at the last reading
    filtered: np.ndarray  # (2 section of every end, LANES)


class Stretches(NamedTuple):
    """Stretches of a passage: the coordinates stepped in each, and the rows of their matrices.

    Before the first stretch the guideway rests.
    """

    first_step: np.ndarray  # (stretch,) number of a step
    start: np.ndarray  # (stretch + 1,) into ``stepped``
    tops: np.ndarray  # (stretch,) where in ``stepped`` pier tops follow modes
    stepped: np.ndarray  # coordinates that are stepped, of all stretches
    damping_from: np.ndarray  # (stepped,) row of `Spans.damping`
    damping_to: np.ndarray
    taken_from: np.ndarray  # (stepped,) row of `Spans.taken`
    taken_to: np.ndarray
    factor_start: np.ndarray  # (stepped + 1,) Cholesky rows of the mass of stepped pier tops
    factor_top: np.ndarray  # coordinate
    factor: np.ndarray  # own by the number of the entry
    factor_inverse: np.ndarray  # (stepped,) inverse of the diagonal, own likewise
    stilled_start: np.ndarray  # (stretch + 1,) coordinates that the stretch before stepped
    stilled: np.ndarray


class Spans(NamedTuple):
    """Guideway in component coordinates: modes of spans, modes of piers, pier tops.

    The coordinate of a mode is its motion relative to the pier tops.  In each stretch of a passage
    only some coordinates are stepped; the other modes follow the pier tops.

    Where samples have guideways of their own, the rails' shapes are those of a basis that all
    share, the same for each span, and a sample's coordinates change to it: ``change`` holds the
    matrix (upright of the basis, upright), then (sideways of the basis, sideways), row by row.
    """

    n_spans: int
    span_length: float
    stride: int  # rows of rail coefficients a span
    n_units: int  # units of rail a span, each with as many rows, an even number
    upright_start: np.ndarray  # (span + 1,)
    upright: np.ndarray  # coordinates that move a span's rails up and down
    sideways_start: np.ndarray  # (span + 1,)
    sideways: np.ndarray  # coordinates that roll a span or move it sideways
    rail_z: np.ndarray  # (upright, stride)
    rail_roll: np.ndarray  # (sideways, stride)
    rail_y: np.ndarray  # (sideways, stride)
    change: np.ndarray  # (0,) none; own (entry, LANES): see below
    change_start: np.ndarray  # (span,) where a span's changes begin
    square: np.ndarray  # (mode,) squared circular frequency [1/s^2] own by mode_number
    response: np.ndarray  # (mode,) makes the step exact for a mode on its own [-] own likewise
    mode_number: np.ndarray
    carried_start: np.ndarray  # (mode + 1,) what modes take along of the pier tops' motion
    carried_top: np.ndarray  # coordinate
    carried: np.ndarray  # own by carried_number
    carried_number: np.ndarray
    damping_column: np.ndarray  # coordinate, in rows that the stretches name
    damping: np.ndarray
    damping_root: np.ndarray  # (coordinate,) factors on row and column; own by root_number
    root_number: np.ndarray
    taken_mode: np.ndarray  # the same as carried by pier tops, in rows that the stretches name
    taken: np.ndarray  # own by taken_number
    taken_number: np.ndarray
    stiffness_start: np.ndarray  # (top + 1,) between pier tops
    stiffness_top: np.ndarray  # coordinate
    stiffness: np.ndarray  # own by stiffness_number
    stiffness_number: np.ndarray
    stretches: Stretches
    output_column: np.ndarray  # (output column,) coordinates that move midspan
    midspan: np.ndarray  # (2 output column,) z and y, own (2 output column, LANES)
    middle: int  # span that midspan is of
    rest: np.ndarray  # (3 stride,) midspan z by z, y by roll and y of its left-out modes [m/N] own
    in_order: np.ndarray  # 0, 1, 2, … as many as there are rows of any table here
    bearing: np.ndarray  # (4 output column,) opening at the first end, mean and half difference of
    # right and left, then at the last; own (4 output column, LANES)
    bearing_rest: (
        np.ndarray
    )  # (6 stride,) at each end mean by z, half difference by roll and y; own


class Footprints(NamedTuple):
    """Rail under a pole's face, wherever the face can be after a whole number of steps."""

    number: np.ndarray  # (row, pole) footprint at time zero; each step moves on by one
    first: np.ndarray  # (footprint,) first of the rail coefficients under the face
    start: np.ndarray  # (footprint + 1,) of their weights; none off the guideway
    weight: np.ndarray  # of the coefficients in the rail's mean motion under the face
    rise: np.ndarray  # of the coefficients in the mean rate over a step as the pole moves on [1/s]
    rail: np.ndarray  # (footprint, side, 1 or LANES) irregularity of all samples, or of each [m]
    ramp: np.ndarray  # (footprint, side, 1 or LANES) its rate at the pole [m/s]
    level: float | np.ndarray  # factor on both [-]; own, one row: then the sag is not in them
    sag: np.ndarray  # (footprint side,) standing sag [m], where levels are own
    sag_rise: np.ndarray  # (footprint side,) its rate at the pole [m/s]
    sagging: float | np.ndarray  # factor on the sag [-] own, one row


class Timing(NamedTuple):
    """Steps and speed of a passage, bounds of the gaps, and how responses are watched."""

    first_step: int  # until then the train rests
    n_steps: int
    time_step: float
    speed: float
    start: float  # position of the nose at time zero [m]
    train_length: float
    gap_contact: np.ndarray  # (LANES,) [m]
    gap_lost: np.ndarray  # (LANES,) [m]
    sections: np.ndarray  # (section, 6) low-pass on guideway accelerations
    record_every: int  # steps between recorded rows; zero: none
    comfort: Comfort


class Outcome(NamedTuple):
    """Results of one row of samples."""

    extreme: np.ndarray  # (5 + 4 car, LANES) girder z, y, acceleration z, y; bodies' z; bodies' y;
    # their ends' z; ends' y; lift off the bearings
    extreme_time: np.ndarray  # same
    signed: np.ndarray  # (8, LANES) girder's largest positive and largest negative, in turns
    squares: np.ndarray  # (2 car weighting, LANES) sum of weighted accelerations squared
    gap_min: np.ndarray  # (kind, LANES)
    gap_max: np.ndarray
    current_max: np.ndarray
    status: np.ndarray  # (LANES,) int64
    lost_time: np.ndarray  # (LANES,)
    lost_magnet: np.ndarray  # (LANES,) int64
    at_loss: np.ndarray  # (6, LANES) gap_min, gap_max, current_max of both kinds by then
    history: np.ndarray  # (record, 4 + 2 car + 2 magnet, LANES)
