"""One and two cars in the multibody program exudyn: what their magnets carry, and their modes.

Writes multibody.json beside this file.  Bodies are rigid bodies in space with finite rotations,
held to their freedoms by joints; every spring and damper joins two places given by coordinates.
Nothing is taken from the package but its parameters.  Run from anywhere:

    python tests/reference/make_multibody.py
"""

from __future__ import annotations

import json
from pathlib import Path

import exudyn as exu
import exudyn.itemInterface as eii
import numpy as np
import scipy.linalg
from exudyn.rigidBodyUtilities import RigidBodyInertia

from maglev.parameters import GRAVITY, Gains, Magnet, Train

PATH = Path(__file__).with_name("multibody.json")

HOLD = {"suspension": [1, 1, 0, 1, 0, 1], "guidance": [1, 0, 1, 1, 1, 0]}  # free: z, theta | y, psi
REVOLUTE_X = [1, 1, 1, 0, 1, 1]


class Cars:
    """Cars under construction; places: x ahead of the nose, y right, z below deck level."""

    def __init__(self, train: Train) -> None:
        self.train = train
        self.system = exu.SystemContainer().AddSystem()
        self.ground = self.system.AddObject(eii.ObjectGround())
        self.place_of = {self.ground: np.zeros(3)}
        self.magnets: list[tuple[str, int, float, int]] = []  # kind, side, x, body
        self.c_frames: list[tuple[float, int]] = []  # x, body
        self.n_frames = 8 * train.n_cars
        for number in range(train.n_cars):
            self._add_car(-24.768 * (number + 0.5))
        self._add_magnets()

    def body(self, place, mass, inertia, weight=0.0) -> int:
        number = self.system.CreateRigidBody(
            referencePosition=list(place),
            inertia=RigidBodyInertia(mass=mass, inertiaTensor=np.asarray(inertia)),
            nodeType=exu.NodeType.RotationRxyz,
            returnDict=True,
        )["bodyNumber"]
        self.place_of[number] = np.array(place, dtype=float)
        if weight:
            marker = self.marker(number, place)
            self.system.AddLoad(eii.LoadForceVector(markerNumber=marker, loadVector=[0, 0, weight]))
        return number

    def marker(self, body, place) -> int:
        local = np.asarray(place, dtype=float) - self.place_of[body]
        return self.system.AddMarker(
            eii.MarkerBodyRigid(bodyNumber=body, localPosition=local.tolist())
        )

    def joint(self, first, second, place, axes) -> int:
        return self.system.AddObject(
            eii.ObjectJointGeneric(
                markerNumbers=[self.marker(first, place), self.marker(second, place)],
                constrainedAxes=axes,
            )
        )

    def spring(self, first, second, place, axis, stiffness, damping) -> None:
        unit = np.eye(3)[axis]
        self.system.AddObject(
            eii.ObjectConnectorCartesianSpringDamper(
                markerNumbers=[self.marker(first, place), self.marker(second, place)],
                stiffness=(stiffness * unit).tolist(),
                damping=(damping * unit).tolist(),
            )
        )

    def roll_spring(self, first, second, place, stiffness, damping) -> None:
        only_roll = np.zeros((6, 6))
        only_roll[3, 3] = 1.0
        self.system.AddObject(
            eii.ObjectConnectorRigidBodySpringDamper(
                markerNumbers=[self.marker(first, place), self.marker(second, place)],
                stiffness=stiffness * only_roll,
                damping=damping * only_roll,
            )
        )

    def riding(self, half, place, mass, along, weight=0.0) -> None:
        """A mass that follows a C-frame in x and one other axis and stands still otherwise."""
        lump = self.body(place, mass, 1e-3 * np.eye(3), weight)
        self.joint(lump, half, place, [1, int(along == 1), int(along == 2), 0, 0, 0])
        self.joint(lump, self.ground, place, [0, int(along != 1), int(along != 2), 1, 1, 1])

    def _add_car(self, car_x: float) -> None:
        t = self.train
        bogie, rod, air = t.bogie, t.rod, t.air_spring
        p = t.car_body
        body_place = [car_x, 0, -p.height]
        body = self.body(
            body_place,
            p.mass,
            np.diag([p.roll_inertia, p.pitch_inertia, p.yaw_inertia]),
            p.mass * GRAVITY,
        )
        self.joint(body, self.ground, body_place, [1, 0, 0, 0, 0, 0])
        for bogie_x in (9.288, 3.096, -3.096, -9.288):
            centre = np.array([car_x + bogie_x, 0.0, 0.0])
            # A core without mass that does not roll; on it the two C-frames with half the bogie's
            # mass each, turning about the height of all that moves sideways with them.
            turning = 0.5 * bogie.c_frame_roll_inertia  # of each, in pitch and yaw
            of_both = 2 * turning + bogie.mass * 1.548**2
            inertia = np.diag([1.0, bogie.pitch_inertia - of_both, bogie.yaw_inertia - of_both])
            core = self.body(centre, 0.0, inertia)
            self.joint(core, self.ground, centre, [1, 0, 0, 1, 0, 0])
            halves = []
            for arm in (1.548, -1.548):
                place = centre + np.array([arm, 0, 0])
                half = self.body(
                    place,
                    0.5 * bogie.mass,
                    np.diag([bogie.c_frame_roll_inertia, turning, turning]),
                    0.5 * bogie.mass * GRAVITY,
                )
                halves.append(half)
                number = len(self.c_frames)
                ends = 1 if number in (0, self.n_frames - 1) else 2
                self.c_frames.append((place[0], half))
                of_magnets = t.suspension_magnet.mass * ends
                sideways = 0.5 * bogie.mass + 2 * rod.mass + of_magnets
                height = 2 * rod.mass * rod.pivot_z + of_magnets * t.suspension_magnet.z
                axis = place + np.array([0, 0, height / sideways])
                self.joint(half, core, axis, REVOLUTE_X)
            self.roll_spring(halves[0], halves[1], centre, bogie.roll_stiffness, bogie.roll_damping)
            for half, arm in zip(halves, (1.548, -1.548), strict=True):
                x = centre[0] + arm
                for side in (1, -1):
                    self.spring(half, body, [x, side * air.y, 0], 2, air.stiffness, air.damping)
                    pivot = np.array([x, side * rod.pivot_y, rod.pivot_z])
                    weight = rod.mass * GRAVITY
                    pendulum = self.body(pivot, rod.mass, rod.inertia * np.eye(3), weight)
                    self.joint(pendulum, half, pivot, [1, 1, 1, 0, 0, 0])
                    self.joint(pendulum, self.ground, pivot, [0, 0, 0, 0, 1, 1])
                    self.roll_spring(pendulum, half, pivot, 0.0, rod.pivot_damping)
                    hanging = p.mass * GRAVITY / 16 * rod.length
                    self.roll_spring(pendulum, self.ground, pivot, hanging, 0.0)
                    end = pivot + np.array([0, 0, rod.length])
                    self.spring(pendulum, body, end, 1, rod.end_stiffness, rod.end_damping)
                    beside = [x, side * rod.pivot_y, t.lateral_damper.z]
                    self.spring(half, body, beside, 1, 0.0, t.lateral_damper.damping)

    def _add_magnets(self) -> None:
        for kind in ("suspension", "guidance"):
            p: Magnet = getattr(self.train, f"{kind}_magnet")
            axis = 2 if kind == "suspension" else 1
            for side in (1, -1):
                for (x_front, front), (x_rear, rear) in zip(
                    self.c_frames[:-1], self.c_frames[1:], strict=True
                ):
                    x = 0.5 * (x_front + x_rear)
                    place = [x, side * p.y, p.z]
                    weight = p.mass * GRAVITY if axis == 2 else 0.0
                    magnet = self.body(place, p.mass, p.inertia * np.eye(3), weight)
                    for x_end, c_frame in ((x_front, front), (x_rear, rear)):
                        end = [x_end, side * p.y, p.z]
                        self.spring(c_frame, magnet, end, axis, p.end_stiffness, p.end_damping)
                        other = 1 if axis == 2 else 2
                        carried = 0.5 * p.mass * GRAVITY if other == 2 else 0.0
                        self.riding(c_frame, end, 0.5 * p.mass, other, carried)
                    self.magnets.append((kind, side, x, magnet))

    def static_forces(self) -> tuple[np.ndarray, np.ndarray]:
        """Force up [N] and moment sum(F dx) [N m] on each suspension magnet, magnets held."""
        sensors = []
        for kind, side, x, magnet in self.magnets:
            p = getattr(self.train, f"{kind}_magnet")
            joint = self.joint(magnet, self.ground, [x, side * p.y, p.z], [1] * 6)
            if kind == "suspension":
                sensors.append(
                    [
                        self.system.AddSensor(
                            eii.SensorObject(
                                objectNumber=joint, outputVariableType=variable, writeToFile=False
                            )
                        )
                        for variable in (
                            exu.OutputVariableType.ForceLocal,
                            exu.OutputVariableType.TorqueLocal,
                        )
                    ]
                )
        self.system.Assemble()
        settings = exu.SimulationSettings()
        settings.solution.file.write = False
        settings.linearSolver.solverType = exu.LinearSolverType.EigenSparse
        self.system.SolveStatic(settings)
        values = np.array([[self.system.GetSensorValues(s) for s in pair] for pair in sensors])
        return values[:, 0, 2], values[:, 1, 1]

    def matrices(self, pole_force: np.ndarray, gains: Gains) -> tuple[np.ndarray, ...]:
        """M, K, D on the free directions, each pole a linear spring and damper to the ground."""
        for (kind, side, x, magnet), forces in zip(self.magnets, pole_force, strict=True):
            p = getattr(self.train, f"{kind}_magnet")
            k_p, k_d = (getattr(gains, f"{kind}_{g}") for g in ("proportional", "derivative"))
            axis = 2 if kind == "suspension" else 1
            centre = [x, side * p.y, p.z]
            self.joint(magnet, self.ground, centre, HOLD[kind])
            for number, force in enumerate(forces):
                dx = ((p.n_poles - 1) / 2 - number) * p.pole_pitch
                stiffness = 2 * force * (k_p / p.current_reference - 1 / p.gap_reference)
                damping = 2 * force * k_d / p.current_reference
                place = [centre[0] + dx, centre[1], centre[2]]
                self.spring(magnet, self.ground, place, axis, stiffness, damping)
        self.system.Assemble()
        M, K, D, *_ = self.system.ComputeLinearizedSystem(
            projectIntoConstraintNullspace=True, singularValuesTolerance=1e-9
        )
        return np.asarray(M), np.asarray(K), np.asarray(D)


def modes(M, K, D) -> dict[str, list[float]]:
    """Undamped frequencies [Hz], and the damped modes' frequencies [Hz] and damping rates [1/s]."""
    undamped = np.sqrt(scipy.linalg.eigh(K, M, eigvals_only=True)) / (2 * np.pi)
    n = len(M)
    inverse = np.linalg.inv(M)
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K, -inverse @ D]])
    roots = np.linalg.eigvals(state)
    roots = roots[roots.imag >= 0]
    roots = roots[np.lexsort((roots.real, np.abs(roots)))]
    return {
        "frequency_undamped": undamped.tolist(),
        "root_real": roots.real.tolist(),
        "root_imag": roots.imag.tolist(),
    }


def reference(n_cars: int) -> dict[str, list[float]]:
    """Static forces and modes with the default parameters."""
    train, gains = Train(n_cars=n_cars), Gains()
    force, moment = Cars(train).static_forces()
    cars = Cars(train)
    poles = []
    for number, (kind, *_) in enumerate(cars.magnets):
        if kind == "guidance":
            preload, n = train.guidance_magnet.preload, train.guidance_magnet.n_poles
            poles.append(np.full(n, preload / n))
        else:
            # Front six poles a, rear six b: 6 (a + b) = force, (a - b) times the sum of the front
            # poles' distances from the centre = moment.
            total = force[number] / 6
            difference = moment[number] / (train.suspension_magnet.pole_pitch * 18)
            poles.append(np.repeat([(total + difference) / 2, (total - difference) / 2], 6))
    return {
        "static_force": force.tolist(),
        "static_moment": moment.tolist(),
        **modes(*cars.matrices(poles, gains)),
    }


def main() -> None:
    """Write the stored result."""
    content = {
        "made_by": "tests/reference/make_multibody.py",
        "program": f"exudyn {exu.__version__}",
        "case": "default parameters, mean gains, every pole its own controller; static forces of "
        "the suspension magnets on the right from the front, then on the left",
        "units": "static_force N, static_moment N m, frequency_undamped Hz, "
        "root_real 1/s, root_imag rad/s",
        "one_car": reference(1),
        "two_cars": reference(2),
    }
    PATH.write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
