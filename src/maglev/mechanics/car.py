"""One car: its bodies, their masses and the links between them, 101 degrees of freedom.

Places are measured from the car's centre at deck level: x ahead, y to the right, z down.  C-frames
and bogies are counted from the front.  Theory: docs/theory/train.md.
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
    """Degrees of freedom and links as they are collected, car by car.

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
        Degrees of freedom, those of the bogie's centre at deck level and the roll.
    arm
        Distance ahead of the bogie's centre [m].
    """

    body: Body
    arm: float

    def lateral(self, z: float) -> Motion:
        """Motion in y of the place ``z`` below deck level [m]."""
        return self.body.lateral(self.arm, z)

    def vertical(self, y: float) -> Motion:
        """Motion in z of the place ``y`` right of the centre line [m]."""
        return self.body.vertical(self.arm, y)


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
        C-frame of its car that its front end hangs on: 0 on the first (and second), 7 on the last
        (and the first of the next car).
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
    """The bodies of one car that others hang on or look at.

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
    """Places of a car's eight C-frames ahead of its centre, from the front [m]."""
    spacing = train.bogie.c_frame_spacing
    return tuple((0.5 * (N_C_FRAMES - 1) - k) * spacing for k in range(N_C_FRAMES))


def add_car(assembly: Assembly, train: Train, name: str) -> Car:
    """Add one car: car body, four bogies, sixteen rods, fourteen magnets of each kind.

    Parameters
    ----------
    assembly
        Receives 101 degrees of freedom and their links.
    train
        Parameters of the train.
    name
        Prefix of the names of the degrees of freedom.

    Returns
    -------
    car
        The bodies that neighbouring cars and the reported responses refer to.
    """
    p = train.car_body
    body = Body(
        y=assembly.add_dof(f"{name}.body.y", p.mass),
        z=assembly.add_dof(f"{name}.body.z", p.mass, p.mass * GRAVITY),
        phi=assembly.add_dof(f"{name}.body.phi", p.roll_inertia),
        theta=assembly.add_dof(f"{name}.body.theta", p.pitch_inertia),
        psi=assembly.add_dof(f"{name}.body.psi", p.yaw_inertia),
    )
    c_frames = [
        c_frame
        for bogie in range(N_BOGIES)
        for c_frame in _add_bogie(assembly, train, f"{name}.bogie{bogie}")
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
    body_dof = (body.y, body.z, body.phi, body.theta, body.psi)
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
        The C-frames its ends hang on.

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
    # A guidance magnet has no vertical freedom: its weight is left out of the static state.
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


def _add_bogie(assembly: Assembly, train: Train, name: str) -> tuple[CFrame, CFrame]:
    """Add a bogie with the masses of its four rods at their pivots; return front and rear C-frame.

    The rods' parallel-axis terms about the bogie's centre go to pitch, yaw and the C-frames' roll.
    The products of inertia that a pivot above or below deck level brings (y-phi and phi-psi) are
    neglected: the mass matrix stays diagonal.
    """
    p, rod = train.bogie, train.rod
    arm = 0.5 * p.c_frame_spacing
    mass = p.mass + 4 * rod.mass
    pitch = p.pitch_inertia + 4 * rod.mass * (arm**2 + rod.pivot_z**2)
    yaw = p.yaw_inertia + 4 * rod.mass * (arm**2 + rod.pivot_y**2)
    roll = p.c_frame_roll_inertia + 2 * rod.mass * (rod.pivot_y**2 + rod.pivot_z**2)
    y = assembly.add_dof(f"{name}.y", mass)
    z = assembly.add_dof(f"{name}.z", mass, mass * GRAVITY)
    theta = assembly.add_dof(f"{name}.theta", pitch)
    psi = assembly.add_dof(f"{name}.psi", yaw)
    phi_front = assembly.add_dof(f"{name}.phi_front", roll)
    phi_rear = assembly.add_dof(f"{name}.phi_rear", roll)
    assembly.links.append(
        Link({phi_front: 1.0, phi_rear: -1.0}, p.roll_stiffness, p.roll_damping),
    )
    return (
        CFrame(Body(y=y, z=z, phi=phi_front, theta=theta, psi=psi), arm),
        CFrame(Body(y=y, z=z, phi=phi_rear, theta=theta, psi=psi), -arm),
    )


def _add_support(
    assembly: Assembly,
    train: Train,
    name: str,
    body: Body,
    x: float,
    c_frame: CFrame,
    side: int,
) -> None:
    """Carry the car body on one side of a C-frame: an air spring and a rod."""
    spring, rod = train.air_spring, train.rod
    assembly.links.append(
        Link(
            relative(body.vertical(x, side * spring.y), c_frame.vertical(side * spring.y)),
            spring.stiffness,
            spring.damping,
        )
    )
    phi = assembly.add_dof(f"{name}.phi", rod.inertia)
    end_z = rod.pivot_z + rod.length
    rod_end = relative(c_frame.lateral(rod.pivot_z), {phi: rod.length})
    body_place = body.lateral(x, train.car_body.height + end_z)
    share = train.car_body.mass * GRAVITY / (2 * N_C_FRAMES)
    assembly.links.append(Link(relative(rod_end, body_place), rod.end_stiffness, rod.end_damping))
    assembly.links.append(Link({phi: 1.0}, share * rod.length, 0.0))
    assembly.links.append(
        Link(relative({phi: 1.0}, {c_frame.body.phi: 1.0}), 0.0, rod.pivot_damping)
    )


def _side_name(side: int) -> str:
    return "right" if side == RIGHT else "left"
