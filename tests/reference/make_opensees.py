"""The guideway in the finite-element program OpenSees: frequencies, static bending, a row of loads.

Writes opensees.json beside this file.  Nothing is taken from the package but its parameters: own
mesh (every node half a connector spacing from the next, pier elements of half a metre from the foot
up), arms as rigid links to stiff springs, bearings as spring-dampers between points of their own,
loads shared between nodes by the lever rule.  Needs openseespy and, on Linux, the system libraries
libblas3 and liblapack3.  Run from anywhere:

    python tests/reference/make_opensees.py
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from itertools import pairwise, repeat
from pathlib import Path

import numpy as np
import openseespy.opensees as ops

from maglev.parameters import BeamSection, Guideway

PATH = Path(__file__).with_name("opensees.json")

HIGHEST = 60.0  # frequencies are stored up to here [Hz]
CAR_WEIGHT = 571e3  # one car's weight [N], spread evenly over its length in the static case
LOADS = 20  # of the moving row
SPACING = 24.768 / 4  # of the row [m]
LOAD = 571e3 / 4  # each load of the row, on both rails together [N]
RIGHT_SHARE = 0.6  # the right rail carries more, so that the girder also rolls and sways
SPEED = 430 / 3.6  # [m/s]
TIME_STEP = 5e-4  # [s]
EVERY = 4  # one step in so many is stored
LINK_STIFFNESS = 1e13  # stands for a rigid connection [N/m, N m/rad]; a thousand rail elements


class Model:
    """The guideway under construction; places as everywhere: x along, y right, z down."""

    def __init__(self, guideway: Guideway) -> None:
        self.guideway = guideway
        self.nodes = self.elements = self.materials = 0
        self.rail: dict[int, list[tuple[float, int]]] = {1: [], -1: []}  # side: (x, node)
        self.midspan: list[int] = []
        ops.wipe()
        ops.model("basic", "-ndm", 3, "-ndf", 6)
        ops.geomTransf("Linear", 1, 0, 0, 1)  # along the line
        ops.geomTransf("Linear", 2, 1, 0, 0)  # piers, from the foot up
        self.stiff = self._material(LINK_STIFFNESS)
        bearing = guideway.bearing
        self.lateral, self.vertical, self.fixed, self.free = (
            self._material(stiffness, bearing.damping)
            for stiffness in (
                bearing.lateral_stiffness,
                bearing.vertical_stiffness,
                bearing.fixed_longitudinal_stiffness,
                bearing.free_longitudinal_stiffness,
            )
        )
        tops = [self._pier(j * guideway.span_length) for j in range(guideway.n_spans + 1)]
        for j in range(guideway.n_spans):
            self._span(j * guideway.span_length, tops[j], tops[j + 1])
        ops.constraints("Transformation")
        ops.numberer("RCM")

    def _material(self, stiffness: float, damping: float = 0.0) -> int:
        self.materials += 1
        ops.uniaxialMaterial("Elastic", self.materials, stiffness, damping)
        return self.materials

    def _node(self, x: float, y: float, z: float) -> int:
        self.nodes += 1
        ops.node(self.nodes, x, y, z)
        return self.nodes

    def _beam(self, i: int, j: int, transform: int, s: BeamSection) -> None:
        """Add a beam element.

        OpenSees takes the torsional inertia as density times J; so J is given as what makes this
        the section's own, and the shear modulus and shear areas as what keep G J and κ G A.
        """
        self.elements += 1
        J = s.polar_inertia / s.density
        scale = s.torsion_constant / J
        ops.element(
            "ElasticTimoshenkoBeam",
            self.elements,
            i,
            j,
            s.elastic_modulus,
            s.shear_modulus * scale,
            s.area,
            J,
            s.second_moment_vertical,
            s.second_moment_lateral,
            s.area * s.shear_coefficient_lateral / scale,
            s.area * s.shear_coefficient_vertical / scale,
            transform,
            "-mass",
            s.density * s.area,
            "-cMass",
        )

    def _springs(self, i: int, j: int, material: dict[int, int]) -> None:
        """Join two nodes at one place by a spring in each direction named."""
        self.elements += 1
        ops.element(
            "zeroLength",
            self.elements,
            i,
            j,
            "-mat",
            *material.values(),
            "-dir",
            *material,
        )

    def _pier(self, x: float) -> int:
        """Stand a pier at ``x`` and return its top node."""
        pier, top = self.guideway.pier, self.guideway.bearing.z
        below = self._node(x, 0, top + pier.height)
        ops.fix(below, *[1] * 6)
        n = round(2 * pier.height)
        for k in range(1, n + 1):
            above = self._node(x, 0, top + pier.height - k * pier.height / n)
            in_cap = (k - 0.5) * pier.height / n > pier.height - pier.cap_height
            width_y = pier.cap_width_y if in_cap else pier.width_y
            self._beam(below, above, 2, rectangle(self.guideway, pier.width_x, width_y))
            below = above
        return below

    def _span(self, start: float, first_top: int, last_top: int) -> None:
        g, rail, bearing = self.guideway, self.guideway.rail, self.guideway.bearing
        per_unit = 2 * rail.connectors_per_unit  # half spacings
        n = per_unit * rail.units_per_span
        half = g.span_length / n
        girder = [self._node(start + k * half, 0, 0) for k in range(n + 1)]
        for i, j in pairwise(girder):
            self._beam(i, j, 1, g.girder)
        self.midspan.append(girder[n // 2])
        for end, top, longitudinal in (
            (girder[0], first_top, self.fixed),
            (girder[-1], last_top, self.free),
        ):
            x = ops.nodeCoord(end, 1)
            for y in (bearing.y, -bearing.y):
                above, below = self._node(x, y, bearing.z), self._node(x, y, bearing.z)
                ops.rigidLink("beam", end, above)
                ops.rigidLink("beam", top, below)
                self._springs(below, above, {1: longitudinal, 2: self.lateral, 3: self.vertical})
        for side in (1, -1):
            for unit in range(rail.units_per_span):
                behind = None
                for k in range(per_unit + 1):
                    at = unit * per_unit + k
                    x = start + at * half
                    node = self._node(x, side * rail.y, rail.z)
                    self.rail[side].append((x, node))
                    if behind is not None:
                        self._beam(behind, node, 1, rail.section)
                    behind = node
                    if k % 2:
                        arm = self._node(x, side * rail.y, rail.z)
                        ops.rigidLink("beam", girder[at], arm)
                        slides = rail.connector_longitudinal == "sliding" and k > 1
                        held = range(2 if slides else 1, 7)
                        self._springs(arm, node, dict.fromkeys(held, self.stiff))
                        ops.mass(node, *[rail.connector_mass * 2 * half] * 3, 0, 0, 0)

    def load_rails(self, loads: Iterable[tuple[int, float, float]]) -> None:
        """Put downward forces (side, x, force) on the rails, in the open load pattern."""
        places = {side: np.array([x for x, _ in rail]) for side, rail in self.rail.items()}
        for side, x, force in loads:
            rail = self.rail[side]
            ahead = int(np.clip(np.searchsorted(places[side], x), 1, len(rail) - 1))
            share = (x - rail[ahead - 1][0]) / (rail[ahead][0] - rail[ahead - 1][0])
            ops.load(rail[ahead - 1][1], 0, 0, force * (1 - share), 0, 0, 0)
            ops.load(rail[ahead][1], 0, 0, force * share, 0, 0, 0)

    def at_midspan(self, direction: int) -> list[float]:
        """Displacement of the girders at midspan along x, y, z = 1, 2, 3 [m]."""
        return [ops.nodeDisp(node, direction) for node in self.midspan]


def rectangle(guideway: Guideway, width_x: float, width_y: float) -> BeamSection:
    """Section of a pier; local z runs along the line, local y across it."""
    pier = guideway.pier
    about_y, about_x = width_y * width_x**3 / 12, width_x * width_y**3 / 12
    a, b = max(width_x, width_y), min(width_x, width_y)
    J = a * b**3 * (1 / 3 - 0.21 * b / a * (1 - (b / a) ** 4 / 12))  # Roark, table 10.7
    return BeamSection.model_construct(
        elastic_modulus=pier.elastic_modulus,
        poisson_ratio=pier.poisson_ratio,
        density=pier.density,
        area=width_x * width_y,
        second_moment_vertical=about_y,
        second_moment_lateral=about_x,
        torsion_constant=J,
        polar_inertia=pier.density * (about_x + about_y),
        shear_coefficient_vertical=pier.shear_coefficient,
        shear_coefficient_lateral=pier.shear_coefficient,
    )


def frequencies(guideway: Guideway) -> list[float]:
    """Frequencies up to `HIGHEST` [Hz]."""
    Model(guideway)
    n = 13 * guideway.n_spans + 6
    found = [math.sqrt(value) / (2 * math.pi) for value in ops.eigen("-genBandArpack", n)]
    if not found[-1] > HIGHEST:
        raise RuntimeError(f"{n} modes reach only {found[-1]:g} Hz of {HIGHEST:g} Hz")
    return [f for f in found if f <= HIGHEST]


def static(guideway: Guideway) -> dict[str, list[float]]:
    """Midspan deflections [m] of all spans: cars everywhere, and pushes on the middle span.

    ``train``: `CAR_WEIGHT` a car length on both rails, evenly along the line; displacement down.
    ``side_force``: 100 kN to the right on the girder at its middle; displacement right.
    ``torque``: 100 kN m about x at the same place; rotation [rad].
    """
    out = {}
    for case in ("train", "side_force", "torque"):
        model = Model(guideway)
        ops.timeSeries("Constant", 1)
        ops.pattern("Plain", 1, 1)
        middle = model.midspan[guideway.n_spans // 2]
        if case == "train":
            for side, rail in model.rail.items():
                x = np.array([place for place, _ in rail])
                middles, force = (x[1:] + x[:-1]) / 2, CAR_WEIGHT / 24.768 / 2 * np.diff(x)
                beams = np.diff(x) > 1e-6  # the others are joints
                model.load_rails(zip(repeat(side), middles[beams], force[beams], strict=False))
            direction = 3
        elif case == "side_force":
            ops.load(middle, 0, 1e5, 0, 0, 0, 0)
            direction = 2
        else:
            ops.load(middle, 0, 0, 0, 1e5, 0, 0)
            direction = 4
        ops.system("UmfPack")
        ops.integrator("LoadControl", 1.0)
        ops.algorithm("Linear")
        ops.analysis("Static")
        if ops.analyze(1) != 0:
            raise RuntimeError(f"static case {case} was not solved")
        out[case] = model.at_midspan(direction)
    return out


def passage(guideway: Guideway) -> dict[str, list[float]]:
    """A row of constant loads over the whole guideway, undamped but for the bearings.

    Newmark's average acceleration from rest; the first load is on the first pier at time zero.
    Returns time [s] and the middle span's midspan displacements ``down`` and ``right`` [m].
    """
    model = Model(guideway)
    middle = guideway.n_spans // 2
    ops.system("UmfPack")
    ops.integrator("Newmark", 0.5, 0.25)
    ops.algorithm("Linear", "-factorOnce")
    ops.analysis("Transient")
    ops.timeSeries("Constant", 1)
    n_steps = math.ceil((guideway.length + (LOADS - 1) * SPACING) / SPEED / TIME_STEP)
    out: dict[str, list[float]] = {"time": [0.0], "down": [0.0], "right": [0.0]}
    for step in range(1, n_steps + 1):
        places = SPEED * step * TIME_STEP - SPACING * np.arange(LOADS)
        ops.pattern("Plain", 1, 1)
        model.load_rails(
            (side, x, LOAD * share)
            for x in places[(places >= 0) & (places <= guideway.length)]
            for side, share in ((1, RIGHT_SHARE), (-1, 1 - RIGHT_SHARE))
        )
        if ops.analyze(1, TIME_STEP) != 0:
            raise RuntimeError(f"step {step} of the passage was not solved")
        ops.remove("loadPattern", 1)
        if step % EVERY == 0:
            out["time"].append(step * TIME_STEP)
            out["down"].append(model.at_midspan(3)[middle])
            out["right"].append(model.at_midspan(2)[middle])
    return out


def rounded(value):
    """Seven digits are plenty, and make a small file."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [rounded(item) for item in value]
    return float(f"{value:.7g}")


def main() -> None:
    """Run every case and write the file."""
    cases = {}
    for kind in ("sliding", "rigid"):
        default = Guideway()
        rail = default.rail.model_copy(update={"connector_longitudinal": kind})
        guideway = default.model_copy(update={"rail": rail})
        cases[kind] = {
            "guideway": guideway.quantities(),
            "frequency_hz": rounded(frequencies(guideway)),
            "static": rounded(static(guideway)),
        }
    cases["sliding"]["passage"] = rounded(passage(Guideway()))
    lines = ",\n".join(f'"{kind}": {json.dumps(case)}' for kind, case in cases.items())
    made_by = f"tests/reference/make_opensees.py with OpenSees {ops.version()}"
    PATH.write_text(f'{{"made_by": {json.dumps(made_by)},\n{lines}}}\n')


if __name__ == "__main__":
    main()
