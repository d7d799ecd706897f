"""One car: its bodies, their masses and the links between them, 101 degrees of freedom.

Positions are measured from the car's centre at deck level: x ahead, y to the right, z down.
C-frames and bogies are counted from the front.  Theory: docs/theory/train.md.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from maglev.mechanics.bodies import Body, Link, Motion, relative
from maglev.parameters import GRAVITY, Magnet, Train

N_BOGIES = 4  # per car; Train's check ties the car's length to them
N_C_FRAMES = 2 * N_BOGIES  # per car
RIGHT, LEFT = +1, -1


@dataclass
class Assembly:
    """Degrees of freedom and links of the train, collected car by car.

    Attributes
    ----------
    names
        Name of each degree of freedom.
    mass
        Mass [kg] or moment of inertia [kg m^2] of each degree of freedom.
    weight
        Weight on each degree of freedom [N], downwards.
    links
        Springs and dampers.
    """

    names: list[str] = field(default_factory=list)
    mass: list[float] = field(default_factory=list)
    weight: list[float] = field(default_factory=list)
    links: list[Link] = field(default_factory=list)

    def add_dof(self, name: str, mass: float, weight: float = 0.0) -> int:
        """Append one degree of freedom and return its index."""
        self.names.append(name)
        self.mass.append(mass)
        self.weight.append(weight)
        return len(self.names) - 1


@dataclass(frozen=True)
class CFrame:
    """A C-frame: its bogie's y, z, pitch and yaw, its own roll.

    Attributes
    ----------
    body
        Degrees of freedom.  The bogie's y and z are those of the centres of the mass that moves
        with it in each direction, and the roll is about the height of the C-frame's own, so that
        the mass matrix is diagonal.
    lateral_arm, vertical_arm
        Distance of the C-frame ahead of the centre of the lateral and of the vertical mass [m].
    roll_z
        Height of the roll's axis, below deck level [m].
    """

    body: Body
    lateral_arm: float
    vertical_arm: float
    roll_z: float

    def lateral(self, z: float) -> Motion:
        """Motion in y of the place ``z`` below deck level [m]."""
        return self.body.lateral(self.lateral_arm, z - self.roll_z)

    def vertical(self, y: float) -> Motion:
        """Motion in z of the place ``y`` right of the centre line [m]."""
        return self.body.vertical(self.vertical_arm, y)


@dataclass(frozen=True)
class Lump:
    """A pair of equal masses on a C-frame, and the directions in which they follow it.

    Attributes
    ----------
    mass
        Of each of the two [kg].
    y, z
        Place right of the centre line (and left of it) and below deck level [m].
    lateral, vertical
        Whether it follows the C-frame in that direction; else it has its own degree of freedom.
    """

    mass: float
    y: float
    z: float
    lateral: bool = True
    vertical: bool = True


@dataclass(frozen=True)
class HungMagnet:
    """A magnet between two neighbouring C-frames.

    Attributes
    ----------
    is_guidance
        Guidance (y, psi) or suspension (z, theta).
    side
        `RIGHT` or `LEFT`.
    station
        C-frame that carries its front end: 0 for a magnet between the first and the second, 7 for
        one between the last and the first of the next car.
    translation_dof, rotation_dof
        Indices of z and theta, or y and psi.
    """

    is_guidance: bool
    side: int
    station: int
    translation_dof: int
    rotation_dof: int


@dataclass(frozen=True)
class Car:
    """The bodies of one car that neighbouring cars and the responses refer to.

    Attributes
    ----------
    body_dof
        Indices of the car body's y, z, phi, theta, psi.
    c_frames
        The eight C-frames from the front.
    magnets
        The magnets inside the car.
    """

    body_dof: tuple[int, int, int, int, int]
    c_frames: tuple[CFrame, ...]
    magnets: tuple[HungMagnet, ...]


def station_x(train: Train) -> tuple[float, ...]:
    """Positions of a car's eight C-frames ahead of its centre, from the front [m]."""
    spacing = train.bogie.c_frame_spacing
    return tuple((0.5 * (N_C_FRAMES - 1) - k) * spacing for k in range(N_C_FRAMES))


def add_car(
    assembly: Assembly, train: Train, name: str, *, is_first: bool = True, is_last: bool = True
) -> Car:
    """Add one car: car body, four bogies, sixteen rods, fourteen magnets of each kind.

    Parameters
    ----------
    assembly
        Receives 101 degrees of freedom and their links.
    train
        Parameters of the train.
    name
        Prefix of the names of the degrees of freedom.
    is_first, is_last
        Whether no car is ahead or behind: the end C-frame then carries magnets on one side only.

    Returns
    -------
    car
        The bodies that neighbouring cars and the reported responses refer to.
    """
    p = train.car_body
    y = assembly.add_dof(f"{name}.body.y", p.mass)
    z = assembly.add_dof(f"{name}.body.z", p.mass, p.mass * GRAVITY)
    phi = assembly.add_dof(f"{name}.body.phi", p.roll_inertia)
    theta = assembly.add_dof(f"{name}.body.theta", p.pitch_inertia)
    psi = assembly.add_dof(f"{name}.body.psi", p.yaw_inertia)
    body = Body(y=y, z=z, phi=phi, theta=theta, psi=psi)
    c_frames = [
        c_frame
        for bogie in range(N_BOGIES)
        for c_frame in _add_bogie(
            assembly,
            train,
            f"{name}.bogie{bogie}",
            front_ends=1 if is_first and bogie == 0 else 2,
            rear_ends=1 if is_last and bogie == N_BOGIES - 1 else 2,
        )
    ]
    for station, (x, c_frame) in enumerate(zip(station_x(train), c_frames, strict=True)):
        for side in (RIGHT, LEFT):
            place = f"{name}.rod{station}_{_side_name(side)}"
            _add_support(assembly, train, place, body, x, c_frame, side)
    magnets = [
        add_magnet(
            assembly, train, name, is_guidance, side, station, *c_frames[station : station + 2]
        )
        for is_guidance in (False, True)
        for side in (RIGHT, LEFT)
        for station in range(N_C_FRAMES - 1)
    ]
    body_dof = (y, z, phi, theta, psi)
    return Car(body_dof=body_dof, c_frames=tuple(c_frames), magnets=tuple(magnets))


def add_magnet(
    assembly: Assembly,
    train: Train,
    name: str,
    is_guidance: bool,
    side: int,
    station: int,
    front: CFrame,
    rear: CFrame,
) -> HungMagnet:
    """Add one magnet, its ends hung on two neighbouring C-frames.

    Parameters
    ----------
    assembly
        Receives two degrees of freedom and two links.
    train
        Parameters of the train.
    name
        Prefix of the names of the degrees of freedom.
    is_guidance, side, station
        Which magnet, see `HungMagnet`.
    front, rear
        The C-frames that carry its ends.

    Returns
    -------
    magnet
        Where the magnet is and which degrees of freedom it has.
    """
    half = 0.5 * train.bogie.c_frame_spacing
    p = train.guidance_magnet if is_guidance else train.suspension_magnet
    kind = "guidance" if is_guidance else "suspension"
    translation, rotation = ("y", "psi") if is_guidance else ("z", "theta")
    prefix = f"{name}.{kind}{station}_{_side_name(side)}"
    # A guidance magnet has no vertical freedom: its weight hangs on the C-frames.
    weight = 0.0 if is_guidance else p.mass * GRAVITY
    translation_dof = assembly.add_dof(f"{prefix}.{translation}", p.mass, weight)
    rotation_dof = assembly.add_dof(f"{prefix}.{rotation}", p.inertia)
    for c_frame, dx in ((front, half), (rear, -half)):
        assembly.links.append(
            Link(
                _magnet_against_c_frame(
                    p, is_guidance, side, translation_dof, rotation_dof, c_frame, dx
                ),
                p.end_stiffness,
                p.end_damping,
            )
        )
    return HungMagnet(is_guidance, side, station, translation_dof, rotation_dof)


def _magnet_against_c_frame(
    p: Magnet,
    is_guidance: bool,
    side: int,
    translation_dof: int,
    rotation_dof: int,
    c_frame: CFrame,
    dx: float,
) -> Motion:
    """Motion of a magnet's end, ``dx`` ahead of its centre [m], against its C-frame."""
    if is_guidance:
        magnet = Body(y=translation_dof, psi=rotation_dof)
        return relative(magnet.lateral(dx, 0.0), c_frame.lateral(p.z))
    magnet = Body(z=translation_dof, theta=rotation_dof)
    return relative(magnet.vertical(dx, 0.0), c_frame.vertical(side * p.y))


def _lumps(train: Train, n_ends: int) -> tuple[Lump, ...]:
    """Masses on a C-frame besides its own.

    Parameters
    ----------
    train
        Parameters of the train.
    n_ends
        Magnets of each kind and side that end on the C-frame: two, one at the ends of the train.
    """
    rod, suspension, guidance = train.rod, train.suspension_magnet, train.guidance_magnet
    half = 0.5 * n_ends
    return (
        Lump(rod.mass, rod.pivot_y, rod.pivot_z),
        Lump(half * suspension.mass, suspension.y, suspension.z, vertical=False),
        Lump(half * guidance.mass, guidance.y, guidance.z, lateral=False),
    )


def _add_bogie(
    assembly: Assembly, train: Train, name: str, *, front_ends: int, rear_ends: int
) -> tuple[CFrame, CFrame]:
    """Add a bogie and the masses on it; return front and rear C-frame.

    Half of its own mass is at either C-frame, at deck level.  Rods add their mass at their pivots,
    magnets half their mass at each end, in every direction in which they have no degree of freedom
    of their own (along travel, none has).  About the centre of mass of each direction the products
    of inertia vanish.
    """
    p = train.bogie
    arms = (0.5 * p.c_frame_spacing, -0.5 * p.c_frame_spacing)
    ridden = (_lumps(train, front_ends), _lumps(train, rear_ends))
    lateral = [0.5 * p.mass + 2 * sum(m.mass for m in lumps if m.lateral) for lumps in ridden]
    vertical = [0.5 * p.mass + 2 * sum(m.mass for m in lumps if m.vertical) for lumps in ridden]
    lateral_x = sum(m * arm for m, arm in zip(lateral, arms, strict=True)) / sum(lateral)
    vertical_x = sum(m * arm for m, arm in zip(vertical, arms, strict=True)) / sum(vertical)
    roll_z = [
        2 * sum(m.mass * m.z for m in lumps if m.lateral) / mass
        for lumps, mass in zip(ridden, lateral, strict=True)
    ]
    riding = [(m, arm) for lumps, arm in zip(ridden, arms, strict=True) for m in lumps]
    pitch = p.pitch_inertia - sum(vertical) * vertical_x**2
    pitch += 2 * sum(m.mass * (m.vertical * arm**2 + m.z**2) for m, arm in riding)
    yaw = p.yaw_inertia - sum(lateral) * lateral_x**2
    yaw += 2 * sum(m.mass * (m.lateral * arm**2 + m.y**2) for m, arm in riding)
    roll = [
        p.c_frame_roll_inertia
        - mass * height**2
        + 2 * sum(m.mass * (m.vertical * m.y**2 + m.lateral * m.z**2) for m in lumps)
        for lumps, mass, height in zip(ridden, lateral, roll_z, strict=True)
    ]
    y = assembly.add_dof(f"{name}.y", sum(lateral))
    z = assembly.add_dof(f"{name}.z", sum(vertical), sum(vertical) * GRAVITY)
    theta = assembly.add_dof(f"{name}.theta", pitch)
    psi = assembly.add_dof(f"{name}.psi", yaw)
    phi_front = assembly.add_dof(f"{name}.phi_front", roll[0])
    phi_rear = assembly.add_dof(f"{name}.phi_rear", roll[1])
    assembly.links.append(
        Link({phi_front: 1.0, phi_rear: -1.0}, p.roll_stiffness, p.roll_damping),
    )
    front, rear = (
        CFrame(
            Body(y=y, z=z, phi=phi, theta=theta, psi=psi), arm - lateral_x, arm - vertical_x, height
        )
        for phi, arm, height in zip((phi_front, phi_rear), arms, roll_z, strict=True)
    )
    return front, rear


def _add_support(
    assembly: Assembly,
    train: Train,
    name: str,
    body: Body,
    x: float,
    c_frame: CFrame,
    side: int,
) -> None:
    """Carry the car body on one side of a C-frame: an air spring, a rod and a lateral damper."""
    spring, rod, damper = train.air_spring, train.rod, train.lateral_damper
    assembly.links.append(
        Link(
            relative(body.vertical(x, side * spring.y), c_frame.vertical(side * spring.y)),
            spring.stiffness,
            spring.damping,
        )
    )
    across = body.lateral(x, train.car_body.height + damper.z)
    assembly.links.append(Link(relative(across, c_frame.lateral(damper.z)), 0.0, damper.damping))
    phi = assembly.add_dof(f"{name}.phi", rod.inertia)
    end_z = rod.pivot_z + rod.length
    rod_end = relative(c_frame.lateral(rod.pivot_z), {phi: rod.length})
    body_place = body.lateral(x, train.car_body.height + end_z)
    share = train.car_body.mass * GRAVITY / (2 * N_C_FRAMES)
    assembly.links.append(Link(relative(rod_end, body_place), rod.end_stiffness, rod.end_damping))
    assembly.links.append(Link({phi: 1.0}, share * rod.length, 0.0))
    assembly.links.append(Link(relative({phi: 1.0}, c_frame.body.roll()), 0.0, rod.pivot_damping))


def _side_name(side: int) -> str:
    return "right" if side == RIGHT else "left"
