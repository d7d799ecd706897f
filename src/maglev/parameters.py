"""Parameters: every physical quantity in SI with its meaning, source and confidence.

One frozen class per physical thing.  The configuration file writes a quantity with its unit
(``"24.768 m"``, ``"430 km/h"``); it is converted to SI once, here, and a wrong dimension, an
unknown key or a value out of range is refused.  The configuration file, its JSON schema and the
parameter tables of the documentation are made from these classes.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from itertools import pairwise, product
from typing import Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)
from pydantic.fields import FieldInfo

from maglev import laws
from maglev.errors import UserError
from maglev.units import in_unit
from maglev.vocabulary import (
    GAIN_KEYS,
    GROUPS,
    LOST,
    PAPER_RESPONSES,
    RESPONSE_UNITS,
    RESPONSES,
    Gain,
    Group,
    Method,
    RecordedResponse,
    Response,
    Surrogate,
)

GRAVITY = 9.80665  # m/s^2, standard gravity (CGPM 1901)

SOURCES = {
    "P": "adaptive-surrogate and PDEM paper, J. Low Freq. Noise Vib. Act. Control (2024), "
    "doi 10.1177/14613484241279033",
    "S1": "sister paper on controller gains, J. Southwest Jiaotong Univ. (2024), "
    "doi 10.3969/j.issn.0258-2724.20230534, abstract",
    "W": "Wang, Xu et al., Veh. Syst. Dyn. 58(2):161-191 (2020), abstract",
    "M": "public Shanghai Transrapid parameter set and 600 km/h multibody car, repository "
    "PPKKIO/maglev-project-based-on-deep-learning, numbers only",
    "H": "High-speed Railway 4 (2026) 124-129, second-hand",
    "D": "derived from the other sources",
    "A": "assumed",
}
"""Meaning of the source letters in the parameter tables."""

CONFIDENCE = {"H": "high", "M": "medium", "L": "low"}
"""Meaning of the letters of confidence."""


def quantity(
    unit: str,
    meaning: str,
    default: float | str | None,
    *,
    source: str,
    confidence: Literal["H", "M", "L"],
    minimum: float | None = None,
    above: float | None = None,
    below: float | None = None,
) -> Any:
    """Describe a dimensioned parameter: its SI unit, meaning, default, source and confidence.

    Parameters
    ----------
    unit
        SI unit of the stored number, in the notation of pint; ``""`` for a pure number.
    meaning
        Meaning of the number, with its symbol.
    default
        Value in ``unit``, or a text with its own unit such as ``"430 km/h"``.
    source
        Letters of `SOURCES`, separated by ``", "``.
    confidence
        A letter of `CONFIDENCE`.
    minimum, above, below
        Bounds in ``unit``: at least, strictly more than, strictly less than.

    Returns
    -------
    field
        A pydantic field that carries all this for the check, the schema and the tables.
    """
    extra: dict[str, Any] = {"unit": unit, "source": source, "confidence": confidence}
    if isinstance(default, str):
        extra["written"] = default
    bounds: dict[str, Any] = {}
    if minimum is not None:
        bounds["ge"] = minimum
    if above is not None:
        bounds["gt"] = above
    if below is not None:
        bounds["lt"] = below
    if isinstance(default, str):
        default = in_unit(default, unit, "default")
    elif default is not None:
        default = float(default)
    return Field(
        default, description=meaning, json_schema_extra=extra, allow_inf_nan=False, **bounds
    )


def _lists(value: Any) -> Any:
    """A value with lists in place of tuples, as a file has them."""
    return [_lists(one) for one in value] if isinstance(value, list | tuple) else value


_IN_SI = {"numbers": "SI"}
"""Context of a validation whose numbers are in SI and carry no unit."""


class Parameters(BaseModel):
    """Base of all parameter classes: frozen, no unknown keys, quantities read with their unit."""

    model_config = ConfigDict(frozen=True, extra="forbid", validate_default=False)

    @model_validator(mode="before")
    @classmethod
    def _read_units(cls, data: Any, info: ValidationInfo) -> Any:
        if not isinstance(data, dict) or info.context is _IN_SI:
            return data
        converted = dict(data)
        for name, value in data.items():
            field = cls.model_fields.get(name)
            extra = field.json_schema_extra if field else None
            if not isinstance(extra, dict) or "unit" not in extra or value is None:
                continue
            unit = str(extra["unit"])
            if isinstance(value, bool):
                raise ValueError(f"{name} must be a number, got {value}")
            if unit and isinstance(value, str):
                converted[name] = in_unit(value, unit, name)
            elif unit and isinstance(value, int | float):
                raise ValueError(f"{name} must carry its unit, such as '{value} {unit}'")
            elif unit:
                raise ValueError(f"{name} must be a number with a unit of {unit}, got {value!r}")
        return converted

    def field_named(self, name: str) -> FieldInfo:
        """Return a field by its name.

        Raises
        ------
        KeyError
            If there is none of that name.
        """
        return type(self).model_fields[name]

    def quantities(self) -> dict[str, Any]:
        """Return the class as the configuration file would write it, units included."""
        out: dict[str, Any] = {}
        for name, field in type(self).model_fields.items():
            value = getattr(self, name)
            extra = field.json_schema_extra
            if isinstance(value, Parameters):
                out[name] = value.quantities()
            elif isinstance(value, tuple) and value and isinstance(value[0], Parameters):
                out[name] = [item.quantities() for item in value]
            elif isinstance(value, Mapping):
                out[name] = {
                    key: item.quantities() if isinstance(item, Parameters) else _lists(item)
                    for key, item in value.items()
                }
            elif isinstance(extra, dict) and extra.get("unit") and value is not None:
                out[name] = f"{value!r} {extra['unit']}"
            elif isinstance(value, tuple):
                out[name] = _lists(value)
            else:
                out[name] = value
        return out


class CarBody(Parameters):
    """The car body, a rigid body with y, z, roll, pitch and yaw."""

    mass: float = quantity(
        "kg", "mass, loaded (empty 29 000 kg)", 39_000, source="M", confidence="M", above=0
    )
    roll_inertia: float = quantity(
        "kg m^2", "moment of inertia about x, I_x", 6.5e4, source="M", confidence="M", above=0
    )
    pitch_inertia: float = quantity(
        "kg m^2", "moment of inertia about y, I_y", 2.0e6, source="M", confidence="M", above=0
    )
    yaw_inertia: float = quantity(
        "kg m^2", "moment of inertia about z, I_z", 2.0e6, source="M", confidence="M", above=0
    )
    height: float = quantity(
        "m", "centre of mass above the deck level", 1.5, source="M", confidence="L"
    )
    end_distance: float | None = quantity(
        "m",
        "distance of the floor's ends from the centre, where accelerations are watched; "
        "null: half the car pitch",
        None,
        source="A",
        confidence="L",
        above=0,
    )


class Bogie(Parameters):
    """Two C-frames at the bogie's ends that share y, z, pitch and yaw and roll on their own."""

    mass: float = quantity(
        "kg", "mass of the whole bogie", 2200, source="M", confidence="M", above=0
    )
    c_frame_roll_inertia: float = quantity(
        "kg m^2", "roll inertia of each C-frame", 1000, source="M, A", confidence="L", above=0
    )
    pitch_inertia: float = quantity(
        "kg m^2", "moment of inertia about y", 7000, source="M, A", confidence="L", above=0
    )
    yaw_inertia: float = quantity(
        "kg m^2", "moment of inertia about z", 7000, source="M, A", confidence="L", above=0
    )
    c_frame_spacing: float = quantity(
        "m", "distance of neighbouring C-frames", 3.096, source="P", confidence="H", above=0
    )
    roll_stiffness: float = quantity(
        "N m/rad", "C-frame to C-frame, relative roll", 1e6, source="A", confidence="L", minimum=0
    )
    roll_damping: float = quantity(
        "N m s/rad", "C-frame to C-frame, relative roll", 1e3, source="A", confidence="L", minimum=0
    )


class Rod(Parameters):
    """A pendulum on a C-frame that carries the car body; its lower end pushes the body sideways."""

    mass: float = quantity(
        "kg", "mass, moving with the pivot", 50, source="A", confidence="L", above=0
    )
    inertia: float = quantity(
        "kg m^2", "moment of inertia about the pivot", 8, source="A", confidence="L", above=0
    )
    length: float = quantity("m", "pivot to lower end, l", 0.5, source="A", confidence="L", above=0)
    pivot_y: float = quantity(
        "m",
        "distance of the pivot from the car's centre line",
        1.2,
        source="A",
        confidence="L",
        above=0,
    )
    pivot_z: float = quantity(
        "m", "pivot below the deck level (negative: above)", -0.5, source="A", confidence="L"
    )
    pivot_damping: float = quantity(
        "N m s/rad", "rod against C-frame, relative roll", 10, source="A", confidence="L", minimum=0
    )
    end_stiffness: float = quantity(
        "N/m", "lower end to car body, lateral", 2e5, source="M, A", confidence="L", above=0
    )
    end_damping: float = quantity(
        "N s/m",
        "lower end to car body, lateral, in series with the pendulum; keeps the rod from ringing",
        300,
        source="A",
        confidence="L",
        minimum=0,
    )


class LateralDamper(Parameters):
    """Damper between car body and C-frame, lateral, beside each rod."""

    damping: float = quantity(
        "N s/m", "lateral damping", 3e3, source="M", confidence="L", minimum=0
    )
    z: float = quantity(
        "m", "below the deck level (negative: above)", -0.5, source="A", confidence="L"
    )


class AirSpring(Parameters):
    """Air spring between car body and C-frame, vertical."""

    stiffness: float = quantity(
        "N/m", "vertical stiffness", 2.0e5, source="M", confidence="M", above=0
    )
    damping: float = quantity(
        "N s/m", "vertical damping", 5e3, source="M", confidence="M", minimum=0
    )
    y: float = quantity(
        "m", "distance from the car's centre line", 1.2, source="M", confidence="M", above=0
    )


class Magnet(Parameters):
    """A row of poles on one rigid magnet body, its suspension on the C-frames and its currents.

    The magnet hangs with both ends on neighbouring C-frames.  The gap of a pole is the mean over
    its face, and so is its force on the rail.  ``control`` says which poles share a circuit.
    """

    mass: float = quantity("kg", "mass", 600, source="H", confidence="M", above=0)
    inertia: float = quantity(
        "kg m^2",
        "moment of inertia in the plane of its motion",
        480,
        source="H",
        confidence="M",
        above=0,
    )
    y: float = quantity(
        "m", "distance from the car's centre line", 1.1, source="H", confidence="M", above=0
    )
    z: float = quantity(
        "m", "below the deck level (negative: above)", 0.0, source="A", confidence="L"
    )
    end_stiffness: float = quantity(
        "N/m", "each end to its C-frame", 1.2e7, source="M", confidence="M", above=0
    )
    end_damping: float = quantity(
        "N s/m",
        "each end to its C-frame (sources span 2.5e3 to 5e4)",
        1e4,
        source="M",
        confidence="L",
        minimum=0,
    )
    n_poles: int = Field(
        12,
        description="poles of one magnet",
        ge=1,
        json_schema_extra={"unit": "", "source": "P", "confidence": "H"},
    )
    pole_pitch: float = quantity(
        "m", "distance of neighbouring poles", 0.258, source="P", confidence="H", above=0
    )
    pole_length: float = quantity(
        "m",
        "length of a pole's face along the rail; 0: a point",
        0.17,
        source="H, A",
        confidence="L",
        minimum=0,
    )
    gap_reference: float = quantity(
        "m", "gap at rest, δ₀", "10 mm", source="H", confidence="H", above=0
    )
    current_reference: float = quantity(
        "A", "current at rest, i₀", 25, source="M", confidence="M", above=0
    )
    current_max: float = quantity(
        "A", "largest current the chopper gives, i_max", 120, source="A", confidence="L", above=0
    )
    preload: float | None = quantity(
        "N",
        "force at rest; null: the magnet's part of the train's weight",
        None,
        source="A",
        confidence="L",
    )

    @model_validator(mode="after")
    def _check(self) -> Magnet:
        if not self.current_max > self.current_reference:
            raise ValueError(
                f"current_max must exceed current_reference = {self.current_reference:g} A, "
                f"got {self.current_max:g} A"
            )
        if self.pole_length > self.pole_pitch * (1 + 1e-12):
            raise ValueError(
                f"pole_length must not exceed pole_pitch = {self.pole_pitch:g} m, "
                f"got {self.pole_length:g} m"
            )
        return self


class Train(Parameters):
    """Cars of one kind in a row, nose at the front, with shared magnets between neighbours."""

    n_cars: int = Field(
        5,
        description="number of cars",
        ge=1,
        json_schema_extra={"unit": "", "source": "P", "confidence": "H"},
    )
    car_pitch: float = quantity(
        "m", "distance of neighbouring cars", 24.768, source="P", confidence="H", above=0
    )
    car_body: CarBody = CarBody()
    bogie: Bogie = Bogie()
    rod: Rod = Rod()
    lateral_damper: LateralDamper = LateralDamper()
    air_spring: AirSpring = AirSpring()
    suspension_magnet: Magnet = Magnet()
    guidance_magnet: Magnet = Field(
        Magnet(
            mass="390 kg",
            inertia="310 kg m^2",
            y="1.465 m",
            z="0.18 m",
            end_stiffness="5e6 N/m",
            end_damping="1e4 N s/m",
            n_poles=3,
            pole_pitch="1.032 m",
            pole_length="0.516 m",
            gap_reference="10 mm",
            current_reference="25 A",
            preload="10 kN",
        ),
        json_schema_extra={
            "origins": {
                "z": ["H", "M"],
                "pole_length": ["A", "L"],
                "gap_reference": ["A", "L"],
                "current_reference": ["A", "L"],
            }
        },
    )

    @model_validator(mode="after")
    def _check(self) -> Train:
        expected = 8 * self.bogie.c_frame_spacing
        if not math.isclose(self.car_pitch, expected, rel_tol=1e-9):
            raise ValueError(
                f"car_pitch must be eight C-frame spacings = {expected:g} m, "
                f"got {self.car_pitch:g} m"
            )
        return self

    @property
    def length(self) -> float:
        """Length of the train from nose to tail [m]."""
        return self.n_cars * self.car_pitch

    @property
    def end_distance(self) -> float:
        """Distance of the ends of a car body's floor from its centre [m]."""
        given = self.car_body.end_distance
        return 0.5 * self.car_pitch if given is None else given


class BeamSection(Parameters):
    """Cross-section and material of a prismatic beam along its own axis.

    ``vertical`` bending is about y (displacement z), ``lateral`` bending about z (displacement y).
    """

    elastic_modulus: float = quantity(
        "Pa", "Young's modulus E", 4.85e10, source="P", confidence="H", above=0
    )
    poisson_ratio: float = quantity(
        "", "Poisson's ratio ν", 0.2, source="P", confidence="H", minimum=0, below=0.5
    )
    density: float = quantity("kg/m^3", "density ρ", 2551, source="P", confidence="H", above=0)
    area: float = quantity("m^2", "area A", 2.352, source="M", confidence="M", above=0)
    second_moment_vertical: float = quantity(
        "m^4",
        "second moment of area for vertical bending",
        1.769,
        source="M",
        confidence="M",
        above=0,
    )
    second_moment_lateral: float = quantity(
        "m^4", "second moment of area for lateral bending", 1.2, source="A", confidence="L", above=0
    )
    torsion_constant: float = quantity(
        "m^4", "Saint-Venant torsion constant J", 1.5, source="A", confidence="L", above=0
    )
    polar_inertia: float = quantity(
        "kg m",
        "mass moment of inertia about the axis per length",
        1967,
        source="D",
        confidence="L",
        above=0,
    )
    shear_coefficient_vertical: float = quantity(
        "", "shear coefficient κ for vertical bending", 0.4, source="A", confidence="L", above=0
    )
    shear_coefficient_lateral: float = quantity(
        "", "shear coefficient κ for lateral bending", 0.4, source="A", confidence="L", above=0
    )

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G = E / (2 (1 + ν)) [Pa]."""
        return self.elastic_modulus / (2 * (1 + self.poisson_ratio))

    @property
    def mass_per_length(self) -> float:
        """Mass per length ρA [kg/m]."""
        return self.density * self.area


class Rail(Parameters):
    """The functional units of one side: steel beams, ends free, on rigid arms from the girder."""

    section: BeamSection = Field(
        BeamSection(
            elastic_modulus="2.06e11 Pa",
            poisson_ratio=0.3,
            density="7850 kg/m^3",
            area="0.045 m^2",
            second_moment_vertical="5e-4 m^4",
            second_moment_lateral="1e-3 m^4",
            torsion_constant="1e-3 m^4",
            polar_inertia="11.775 kg m",
            shear_coefficient_vertical=0.4,
            shear_coefficient_lateral=0.4,
        ),
        json_schema_extra={
            "origins": {
                name: ["A", "L"]
                for name in (
                    "area",
                    "second_moment_vertical",
                    "second_moment_lateral",
                    "torsion_constant",
                )
            }
        },
    )
    units_per_span: int = Field(
        8,
        description="functional units a span and side",
        ge=1,
        json_schema_extra={"unit": "", "source": "P", "confidence": "H"},
    )
    connectors_per_unit: int = Field(
        4,
        description="pairs of connectors a unit, evenly spaced, half a spacing from its ends",
        ge=2,
        json_schema_extra={"unit": "", "source": "P", "confidence": "H"},
    )
    y: float = quantity(
        "m",
        "rail axis (stator line) from the centre line",
        1.1,
        source="M",
        confidence="M",
        above=0,
    )
    z: float = quantity(
        "m", "rail axis below the girder axis (negative: above)", -1.0, source="A", confidence="L"
    )
    connector_mass: float = quantity(
        "kg/m",
        "connectors' mass per length of one rail: girder, rails and connectors weigh 7000 kg/m",
        146.8,
        source="D",
        confidence="M",
        minimum=0,
    )
    connector_longitudinal: Literal["sliding", "rigid"] = Field(
        "sliding",
        description="whether a connector carries force along the rail; "
        "sliding: only the first of each unit does",
        json_schema_extra={"source": "A", "confidence": "L"},
    )


class Bearing(Parameters):
    """One laminated bearing between girder end and pier top, a spring-damper in each direction."""

    y: float = quantity(
        "m", "distance from the centre line", 0.9, source="M, A", confidence="L", above=0
    )
    z: float = quantity("m", "below the girder axis", 1.2, source="A", confidence="L")
    vertical_stiffness: float = quantity(
        "N/m", "vertical", 1.0e10, source="A", confidence="L", above=0
    )
    lateral_stiffness: float = quantity(
        "N/m", "lateral, keyed", 1e9, source="A", confidence="L", above=0
    )
    fixed_longitudinal_stiffness: float = quantity(
        "N/m",
        "longitudinal at the span's fixed (first) end",
        1e9,
        source="A",
        confidence="L",
        above=0,
    )
    free_longitudinal_stiffness: float = quantity(
        "N/m",
        "longitudinal at the span's free (last) end: shear of the rubber",
        6.3e6,
        source="D",
        confidence="L",
        above=0,
    )
    damping: float = quantity("N s/m", "each direction", 1e5, source="A", confidence="L", minimum=0)


class Pier(Parameters):
    """A pier, its foot fixed, with a wider cap at the top."""

    height: float = quantity(
        "m", "foot to top, cap included", 10, source="P", confidence="H", above=0
    )
    cap_height: float = quantity("m", "height of the cap", 1, source="A", confidence="L", above=0)
    width_x: float = quantity("m", "along the guideway", 1.8, source="P", confidence="H", above=0)
    width_y: float = quantity(
        "m", "across the guideway, shaft", 1.8, source="P", confidence="H", above=0
    )
    cap_width_y: float = quantity(
        "m", "across the guideway, cap", 3.0, source="P", confidence="H", above=0
    )
    elastic_modulus: float = quantity(
        "Pa", "Young's modulus E", 3.0e10, source="P", confidence="H", above=0
    )
    poisson_ratio: float = quantity(
        "", "Poisson's ratio ν", 0.2, source="P", confidence="H", minimum=0, below=0.5
    )
    density: float = quantity("kg/m^3", "density ρ", 2551, source="P", confidence="H", above=0)
    shear_coefficient: float = quantity(
        "", "shear coefficient κ of a rectangle, 5/6", 5 / 6, source="D", confidence="H", above=0
    )

    @model_validator(mode="after")
    def _check(self) -> Pier:
        if not self.cap_height < self.height:
            raise ValueError(
                f"cap_height must be less than height = {self.height:g} m, "
                f"got {self.cap_height:g} m"
            )
        return self


class Guideway(Parameters):
    """Simply supported spans in a row on shared piers."""

    n_spans: int = Field(
        5,
        description="number of spans",
        ge=1,
        json_schema_extra={"unit": "", "source": "P", "confidence": "H"},
    )
    span_length: float = quantity("m", "pier to pier", 24.768, source="P", confidence="H", above=0)
    girder: BeamSection = BeamSection()
    rail: Rail = Rail()
    bearing: Bearing = Bearing()
    pier: Pier = Pier()
    damping_ratio: float = quantity(
        "",
        "share of critical damping in every retained mode",
        0.025,
        source="M",
        confidence="M",
        minimum=0,
        below=1,
    )
    refinement: int = Field(
        1,
        description="beam elements between neighbouring nodes of girder, rail and pier",
        ge=1,
        json_schema_extra={"unit": "", "source": "D", "confidence": "H"},
    )

    @property
    def length(self) -> float:
        """Length from the first pier to the last [m]."""
        return self.n_spans * self.span_length


class PowerLaw(Parameters):
    """S(n) = coefficient · n^(-exponent), one-sided, n = 1/λ in 1/m, S in m³."""

    law: Literal["power"] = Field("power", description="a power of the wavenumber")
    coefficient: float = Field(
        2.3e-8,
        description="S at n = 1/m [SI: m³ (1/m)^exponent]",
        gt=0,
        json_schema_extra={"unit": "", "source": "M", "confidence": "L"},
    )
    exponent: float = Field(
        1.5,
        description="exponent [-]",
        ge=0,
        json_schema_extra={"unit": "", "source": "M", "confidence": "L"},
    )


class RationalLaw(Parameters):
    """S(n) = Σ a_j n^j / Σ b_j n^j, one-sided, rising order, S in m³ for n in 1/m."""

    law: Literal["rational"] = Field(description="a ratio of two polynomials")
    numerator: tuple[float, ...] = Field(description="a_j in rising order [SI]", min_length=1)
    denominator: tuple[float, ...] = Field(description="b_j in rising order [SI]", min_length=1)


class GermanLaw(Parameters):
    """German railway spectrum S(Ω) = A Ω_c² / ((Ω² + Ω_r²)(Ω² + Ω_c²)), Ω = 2πn; S(n) = 2π S(Ω)."""

    law: Literal["german"] = Field(description="the German railway form")
    roughness: float = quantity("m^2 rad/m", "A", 4.032e-7, source="A", confidence="M", above=0)
    corner_c: float = quantity("rad/m", "Ω_c", 0.8246, source="A", confidence="M", above=0)
    corner_r: float = quantity("rad/m", "Ω_r", 0.0206, source="A", confidence="M", above=0)


Spectrum = PowerLaw | RationalLaw | GermanLaw


class Irregularity(Parameters):
    """Track irregularity: spectra in both directions, or a measured profile."""

    enabled: bool = Field(True, description="false: a perfectly smooth track")
    vertical: Spectrum = Field(
        PowerLaw(), discriminator="law", description="one-sided spectrum of the vertical profile"
    )
    lateral: Spectrum = Field(
        PowerLaw(coefficient=3.2e-8, exponent=1.6),
        discriminator="law",
        description="one-sided spectrum of the lateral profile",
    )
    wavelength_min: float = quantity(
        "m", "shortest wavelength", 1, source="M", confidence="M", above=0
    )
    wavelength_max: float = quantity(
        "m", "longest wavelength", 100, source="M", confidence="M", above=0
    )
    n_harmonics: int = Field(
        1000,
        description="cosines in the sum",
        ge=1,
        json_schema_extra={"unit": "", "source": "A", "confidence": "H"},
    )
    fade_in: float = quantity(
        "m",
        "length before the guideway over which the irregularity grows from zero",
        50,
        source="A",
        confidence="L",
        above=0,
    )
    sides: Literal["shared", "independent"] = Field(
        "shared", description="whether left and right rail share one profile"
    )
    profile_file: str | None = Field(
        None,
        description="measured profile (CSV or NetCDF with x, vertical, lateral [m]) instead of "
        "the spectra; path relative to the configuration file",
        json_schema_extra={"file": True},
    )

    @model_validator(mode="after")
    def _check(self) -> Irregularity:
        if not self.wavelength_min < self.wavelength_max:
            raise ValueError(
                f"wavelength_min must be less than wavelength_max = {self.wavelength_max:g} m, "
                f"got {self.wavelength_min:g} m"
            )
        return self


class Gains(Parameters):
    """Mean gains of the controllers: current per gap error, its rate, and two more, unused at zero.

    i = i₀ + k_p e + k_d de/dt + k_a a + k_i ∫e dt, with the error e of the gap and the acceleration
    a of the magnet in the direction that opens the gap.
    """

    suspension_proportional: float = quantity(
        "A/m", "suspension k_p, mean", 3500, source="D, S1", confidence="M", above=0
    )
    suspension_derivative: float = quantity(
        "A s/m", "suspension k_d, mean", 17.5, source="D, S1", confidence="M", minimum=0
    )
    guidance_proportional: float = quantity(
        "A/m", "guidance k_p, mean", 4500, source="D, S1", confidence="M", above=0
    )
    guidance_derivative: float = quantity(
        "A s/m", "guidance k_d, mean", 17.5, source="D, S1", confidence="M", minimum=0
    )
    suspension_acceleration: float = quantity(
        "A s^2/m",
        "suspension k_a, feedback of the magnet's acceleration",
        0.0,
        source="A",
        confidence="L",
        minimum=0,
    )
    suspension_integral: float = quantity(
        "A/(m s)", "suspension k_i, integral part", 0.0, source="A", confidence="L", minimum=0
    )
    guidance_acceleration: float = quantity(
        "A s^2/m",
        "guidance k_a, feedback of the magnet's acceleration",
        0.0,
        source="A",
        confidence="L",
        minimum=0,
    )
    guidance_integral: float = quantity(
        "A/(m s)", "guidance k_i, integral part", 0.0, source="A", confidence="L", minimum=0
    )

    @property
    def as_row(self) -> tuple[float, float, float, float]:
        """The four gains in the order of the ``gain`` dimension."""
        return (
            self.suspension_proportional,
            self.suspension_derivative,
            self.guidance_proportional,
            self.guidance_derivative,
        )

    @property
    def further(self) -> tuple[float, float, float, float]:
        """Suspension k_a, k_i, guidance k_a, k_i: columns 4 to 7 where gains have eight."""
        return (
            self.suspension_acceleration,
            self.suspension_integral,
            self.guidance_acceleration,
            self.guidance_integral,
        )


_GROUP_OF_A_MAGNET = (
    "group 'magnet', one signal for the whole magnet with forces pole by pole, cannot hold the "
    "train: the bogies zigzag, the mean gap does not see it, and the motion grows by about 42 1/s "
    "whatever the gains; use 'pole', 'ends', 'half' or 'lumped'"
)


class Circuit(Parameters):
    """One kind of control circuit: its poles, the gap that feeds it, and the lag of its current.

    ``pole``: every pole has a circuit of its own, fed by its own gap.  ``ends``: two a magnet, each
    fed by the gap at the outermost pole of its half.  ``half``: two a magnet, each fed by the mean
    gap of its half.  ``lumped``: one a magnet, fed by the mean gap, from which its forces follow
    too.
    """

    group: Group = Field(
        "pole",
        description="sharing of circuits: each pole its own, each half fed at the magnet's end "
        "(ends), each half fed by its mean gap (half), a magnet with one force (lumped)",
        json_schema_extra={"source": "A", "confidence": "L"},
    )
    lag: float = quantity(
        "s",
        "time constant of the lag of the current behind its command",
        "0 ms",
        source="A",
        confidence="L",
        minimum=0,
        below=1.0,
    )
    delay: float = quantity(
        "s", "pure delay of the signal", "0 ms", source="A", confidence="L", minimum=0, below=0.1
    )
    failed_magnets: int = Field(
        0,
        description="magnets of the kind that carry no current from the start, spread over the "
        "train from its middle",
        ge=0,
        json_schema_extra={"unit": "", "source": "A", "confidence": "H"},
    )

    @field_validator("group", mode="before")
    @classmethod
    def _refuse_magnet(cls, value: Any) -> Any:
        if value == "magnet":
            raise ValueError(_GROUP_OF_A_MAGNET)
        return value


class Control(Parameters):
    """The circuits of suspension and guidance magnets."""

    suspension: Circuit = Circuit()
    guidance: Circuit = Circuit()


class Passage(Parameters):
    """One passage of the train over the guideway and how it is computed."""

    speed: float = quantity(
        "m/s", "constant speed of the train, v", "430 km/h", source="P", confidence="H", above=0
    )
    approach: float = quantity(
        "m",
        "rigid track before the first pier, at the start of the run",
        150,
        source="A",
        confidence="H",
        above=0,
    )
    time_step: float = quantity("s", "Δt", "0.54 ms", source="D", confidence="M", above=0)
    mode_cutoff: float = quantity(
        "Hz",
        "highest mode of the middle span, where responses are taken, in the production solver; "
        "damping is a share of critical up to here",
        300,
        source="D",
        confidence="M",
        above=0,
    )
    mode_cutoff_elsewhere: float = quantity(
        "Hz",
        "highest mode of piers and other spans in the production solver",
        300,
        source="D",
        confidence="M",
        above=0,
    )
    acceleration_band: float | None = quantity(
        "Hz",
        "corner of the Butterworth low-pass on guideway accelerations; null: raw",
        100,
        source="A",
        confidence="M",
        above=0,
    )
    acceleration_filter_order: int = Field(
        8,
        description="order of that low-pass, even; with 2 the pole passing above the band leaks "
        "through and decides the extreme",
        ge=2,
        multiple_of=2,
        json_schema_extra={"unit": "", "source": "A", "confidence": "M"},
    )
    gap_contact: float = quantity(
        "m", "gap at which magnet and rail touch", "0.5 mm", source="A", confidence="M", above=0
    )
    gap_lost: float = quantity(
        "m", "gap beyond which levitation is lost", "40 mm", source="A", confidence="M", above=0
    )

    @model_validator(mode="after")
    def _check(self) -> Passage:
        if not self.gap_contact < self.gap_lost:
            raise ValueError(
                f"gap_contact must be less than gap_lost = {self.gap_lost:g} m, "
                f"got {self.gap_contact:g} m"
            )
        return self


class Validation(Parameters):
    """Validation: the range of speeds of the dynamic coefficient, and the measurements."""

    speed_min: float = quantity(
        "m/s", "slowest passage", "50 km/h", source="P", confidence="H", above=0
    )
    speed_max: float = quantity(
        "m/s", "fastest passage", "430 km/h", source="P", confidence="H", above=0
    )
    speed_step: float = quantity(
        "m/s", "between neighbouring speeds", "10 km/h", source="P", confidence="H", above=0
    )
    measurements: str | None = Field(
        "measurements/shanghai.yaml",
        description="measured values; path relative to the configuration file; null: none",
        json_schema_extra={"file": True},
    )
    measured_here: bool = Field(
        True,
        description="whether they are of the bridge that guideway describes; if not, or if the "
        "file's span has another length, no figure shows them",
    )

    @model_validator(mode="after")
    def _check(self) -> Validation:
        if not self.speed_min <= self.speed_max:
            raise ValueError(
                f"speed_min must not exceed speed_max = {self.speed_max:g} m/s, "
                f"got {self.speed_min:g} m/s"
            )
        return self


SurrogateKind = Literal[Surrogate, "best"]
"""A surrogate; ``best``: for each response the one with the least leave-one-out error."""

LARGEST_AT_LEAST, LARGEST_PER_QUANTITY = 104, 20
"""Largest number of runs of an adaptive design of ours where none is given: at least, and for each
random quantity.  Limits of twelve are within 0.15 σ by it (docs/benchmarks/many.md); that it serves
more as well is assumed."""

_COUNTED = 2**14
"""Largest GF point set, and smallest number of points that count its Voronoi cells; assumed."""


def _count(default: int, meaning: str, *, minimum: int = 1, maximum: int | None = None) -> Any:
    """Describe a whole number that the user chooses."""
    return Field(default, description=meaning, ge=minimum, le=maximum)


class MonteCarlo(Parameters):
    """The baseline: independent random gains, one run each."""

    n_samples: int = _count(10_000, "number of runs, unless the case says another", minimum=2)
    chunk_size: int = _count(1000, "runs in one file and job; no number depends on it")


class OneStage(Parameters):
    """One-stage sampling (OSM): all runs on one GF point set."""

    n_runs: int = _count(363, "number of runs", minimum=8, maximum=_COUNTED)
    surrogate: SurrogateKind = Field("rbf", description="surrogate of the runs")


class PaperDesign(Parameters):
    """Adaptive sampling as published (ASM): RBF and Taylor expansion, driven by one response."""

    n_initial: int = _count(50, "runs of the first design, at most", minimum=8, maximum=_COUNTED)
    initial_per_gain: int = _count(
        15, "runs of the first design for each random quantity, at most", minimum=8
    )
    n_candidates: int = _count(
        1000, "GF points that rounds choose from", minimum=8, maximum=_COUNTED
    )
    batch_size: int = _count(4, "runs of one round")
    response: Response = Field("girder_displacement_z", description="response that drives")
    threshold: float = Field(
        0.02,
        description="error of a round that counts as small, in standard deviations of the response",
        gt=0,
    )
    n_rounds: int = _count(5, "rounds in a row whose error must be small to stop")
    n_largest: int = _count(363, "largest number of runs", minimum=8)
    surrogate: SurrogateKind = Field("rbf", description="surrogate of the runs")


class TailDesign(Parameters):
    """Adaptive sampling towards the limits of all responses, on one set of runs."""

    n_initial: int = _count(40, "runs of the first design, at most", minimum=8, maximum=_COUNTED)
    initial_per_gain: int = _count(
        12, "runs of the first design for each random quantity, at most", minimum=8
    )
    n_candidates: int = _count(16_384, "Sobol' points that rounds choose from", minimum=8)
    batch_size: int = _count(8, "runs of one round")
    aggregate: Literal["sum", "maximum"] = Field(
        "sum", description="combination of the gains of several limits to one score"
    )
    threshold: float = Field(
        0.02,
        description="largest change of a limit in a round, in standard deviations of the response, "
        "that counts as settled",
        gt=0,
    )
    n_rounds: int = _count(3, "rounds in a row in which the limits must be settled to stop")
    n_largest: int | None = Field(
        None,
        description="largest number of runs; null: 20 for each random quantity, 104 at least",
        ge=8,
    )
    responses: tuple[Response, ...] | None = Field(
        None,
        description="responses whose limits drive; null: study.responses and those of the limit "
        "states that drive",
        min_length=1,
    )
    surrogate: SurrogateKind = Field("best", description="surrogate of the finished design")

    def largest(self, n_quantities: int) -> int:
        """Largest number of runs of a case with so many random quantities.

        Examples
        --------
        >>> TailDesign().largest(4), TailDesign().largest(12)
        (104, 240)
        """
        return self.n_largest or max(LARGEST_AT_LEAST, LARGEST_PER_QUANTITY * n_quantities)


class Tracks(Parameters):
    """The line: one set of gains on each of many tracks of the same spectra."""

    n_tracks: int = _count(
        32, "number of tracks; the first is that of the seed of the configuration", minimum=3
    )
    n_gains: int = _count(
        256, "Sobol' points of the gains, the same on every track; a power of two", minimum=16
    )
    surrogate: SurrogateKind = Field(
        "kriging", description="surrogate of the runs on each track, for its limits"
    )

    @model_validator(mode="after")
    def _check(self) -> Tracks:
        if self.n_gains & (self.n_gains - 1):
            raise ValueError(f"n_gains must be a power of two, got {self.n_gains}")
        return self


class InTime(Parameters):
    """Densities over the time of a passage: real histories at the representative points."""

    cases: tuple[str, ...] = Field(
        ("validation",), description="cases whose responses are followed; [] for none"
    )
    responses: tuple[RecordedResponse, ...] = Field(
        ("girder_displacement_z", "car_body_acceleration_z"),
        description="responses that are followed; that of the car body is its size, largest over "
        "the cars",
        min_length=1,
    )
    n_times: int = _count(
        600, "times at which densities are given, from start to end of a passage", minimum=3
    )

    @model_validator(mode="after")
    def _check(self) -> InTime:
        for key, names in (("cases", self.cases), ("responses", self.responses)):
            if len(set(names)) < len(names):
                raise ValueError(f"{key} must not name anything twice, got {', '.join(names)}")
        return self


class Study(Parameters):
    """Settings of densities and limits, for all cases."""

    failure_probability: tuple[float, ...] = Field(
        (0.1, 0.01, 0.001),
        description="probabilities of exceedance whose limits are given, from large to small",
        min_length=1,
    )
    responses: tuple[Response, ...] = Field(
        PAPER_RESPONSES,
        description="responses that are predicted, beside those of the limit states",
        min_length=1,
    )
    confidence: float = Field(
        0.95, description="probability that an interval covers the truth", gt=0, lt=1
    )
    n_representative: int = _count(
        1000, "GF points that a density stands on", minimum=8, maximum=_COUNTED
    )
    n_population: int = _count(131_072, "Sobol' points at which limits are read off", minimum=8)
    n_counting: int = _count(
        1_048_576, "Sobol' points that count Voronoi cells, a power of two", minimum=_COUNTED
    )
    mcm: MonteCarlo = MonteCarlo()
    osm: OneStage = OneStage()
    asm_paper: PaperDesign = PaperDesign()
    asm: TailDesign = TailDesign()
    tracks: Tracks = Tracks()
    in_time: InTime = InTime()

    @model_validator(mode="after")
    def _check(self) -> Study:
        levels = self.failure_probability
        if not all(0 < level < 1 for level in levels):
            raise ValueError(f"failure_probability must lie between 0 and 1, got {list(levels)}")
        for key, names in (("responses", self.responses), ("asm.responses", self.asm.responses)):
            if names is not None and len(set(names)) < len(names):
                raise ValueError(f"{key} must not name anything twice, got {', '.join(names)}")
        if any(high <= low for high, low in pairwise(levels)):
            raise ValueError(
                f"failure_probability must fall from value to value, got {list(levels)}"
            )
        if self.n_counting & (self.n_counting - 1):
            raise ValueError(f"n_counting must be a power of two, got {self.n_counting}")
        of_designs = (
            ("asm_paper", self.asm_paper, self.asm_paper.n_largest),
            ("asm", self.asm, self.asm.largest(1)),
        )
        for name, design, largest in of_designs:
            if design.n_candidates < largest:
                raise ValueError(
                    f"{name}.n_candidates must be at least {name}.n_largest = {largest}, "
                    f"got {design.n_candidates}: rounds cannot choose more runs than there are "
                    "candidates"
                )
            if largest < design.n_initial:
                raise ValueError(
                    f"{name}.n_largest must be at least {name}.n_initial = {design.n_initial}, "
                    f"got {largest}"
                )
        return self


def _pint_unit(unit: str) -> str:
    """A unit of a response in the notation of the configuration, such as ``m/s^2``."""
    return {"1": "", "m s-2": "m/s^2"}.get(unit, unit)


class LimitState(Parameters):
    """One limit state: a response and its limit, or several limit states together.

    A passage that loses levitation exceeds every one.
    """

    response: Response | None = Field(None, description="response that must not exceed the limit")
    limit: str | float | None = Field(
        None,
        description="largest value that the response may have, with a unit of the response; "
        "a plain number where it has none",
    )
    any_of: tuple[str, ...] = Field(
        (), description="limit states of which one is enough, by name; lost: levitation is lost"
    )
    all_of: tuple[str, ...] = Field((), description="limit states that must all be exceeded")
    target: float | None = Field(
        None, description="probability that it may have in a passage", gt=0, lt=1
    )
    drives: bool = Field(
        True,
        description="whether adaptive designs choose runs for its response, or those of its parts",
    )
    source: str = Field("", description="where limit and target come from")
    confidence: Literal["high", "medium", "low"] | None = Field(
        None, description="how far the limit can be trusted"
    )

    @field_validator("limit", mode="before")
    @classmethod
    def _read_number(cls, limit: Any) -> Any:
        """Take a plain number that YAML leaves as text, such as 25e-5."""
        if isinstance(limit, str) and re.fullmatch(r"[-+]?[0-9.]+([eE][-+]?[0-9]+)?", limit):
            return float(limit)
        return limit

    @property
    def threshold(self) -> float:
        """The limit in the SI unit of the response; NaN where there is none."""
        if self.response is None or self.limit is None:
            return math.nan
        if isinstance(self.limit, str):
            return in_unit(self.limit, _pint_unit(RESPONSE_UNITS[self.response]), "limit")
        return self.limit

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the limit states that it joins."""
        return (*self.any_of, *self.all_of)

    @property
    def definition(self) -> str:
        """What it says, in words."""
        if self.response is not None:
            return f"{self.response} > {self.limit}"
        return f"{'any' if self.any_of else 'all'} of: {', '.join(self.parts)}"

    @property
    def origin(self) -> str:
        """Source of limit and target, and confidence; empty if none is stated."""
        confidence = f"confidence: {self.confidence}" if self.confidence else ""
        return "; ".join(filter(None, (self.source, confidence)))

    @model_validator(mode="after")
    def _check(self) -> LimitState:
        said = [
            key
            for key in ("response", "limit", "any_of", "all_of")
            if getattr(self, key) not in (None, ())
        ]
        if self.parts and len(said) > 1:
            raise ValueError(
                f"{said[0]} cannot stand beside {said[-1]}: a limit state has a response with its "
                "limit, or any_of, or all_of"
            )
        if not said:
            raise ValueError(
                "response is missing: a limit state has a response with its limit, or any_of, or "
                "all_of"
            )
        if len(set(self.parts)) < len(self.parts):
            raise ValueError(f"{said[0]} must not name anything twice, got {', '.join(self.parts)}")
        if (self.response is None) != (self.limit is None):
            missing = "limit" if self.limit is None else "response"
            raise ValueError(f"{missing} is missing: a response needs a limit, a limit a response")
        if self.response is not None:
            self._check_limit(RESPONSE_UNITS[self.response])
        return self

    def _check_limit(self, unit: str) -> None:
        """Refuse a limit of another unit than the response's, or one that is not positive."""
        shown = _pint_unit(unit)
        if isinstance(self.limit, str) and not shown:
            raise ValueError(
                f"limit must be a plain number, as {self.response} has no unit, got {self.limit!r}"
            )
        if not isinstance(self.limit, str) and shown:
            raise ValueError(f"limit must carry its unit, such as '{self.limit:g} {shown}'")
        if not 0 < self.threshold < math.inf:
            raise ValueError(f"limit must be greater than 0 and finite, got {self.limit!r}")


ONCE_A_YEAR = 2.74e-5
"""Probability per passage of once a year with 36,500 trains, a hundred a day; assumed."""


def _limit_states() -> dict[str, LimitState]:
    """The limit states that are shipped: those whose response there is."""
    once = "; target: once a year with 36,500 trains, assumed"
    shipped: tuple[tuple[str, str, str | float, str, str], ...] = (
        (
            "suspension gap",
            "suspension_gap_excursion",
            "4 mm",
            "customary for a gap of 8 to 10 mm, recalled; assumed here",
            "medium",
        ),
        (
            "guidance gap",
            "guidance_gap_excursion",
            "4 mm",
            "as the suspension gap; assumed",
            "low",
        ),
        (
            "ride",
            "car_body_acceleration_z",
            "1.0 m/s^2",
            "EN 1990:2002/A1, table A2.9, very good comfort, recalled",
            "medium",
        ),
        (
            "Sperling, vertical",
            "sperling_index_z",
            2.5,
            "GB/T 5599, excellent up to 2.5",
            "high",
        ),
        (
            "Sperling, lateral",
            "sperling_index_y",
            2.5,
            "GB/T 5599, excellent up to 2.5",
            "high",
        ),
        (
            "ISO 2631, vertical",
            "iso2631_rms_z",
            "0.315 m/s^2",
            "ISO 2631-1:1997, annex C, not uncomfortable below",
            "high",
        ),
        (
            "ISO 2631, lateral",
            "iso2631_rms_y",
            "0.315 m/s^2",
            "ISO 2631-1:1997, annex C, not uncomfortable below",
            "high",
        ),
        (
            "deflection",
            "deflection_over_span",
            1 / 4000,
            "L/4000, customary for high-speed guideways, recalled; assumed here",
            "low",
        ),
        ("dynamic factor", "dynamic_coefficient", 1.2, "assumed", "low"),
    )
    return {
        name: LimitState.model_validate(
            {
                "response": response,
                "limit": limit,
                "target": ONCE_A_YEAR,
                "drives": False,
                "source": f"{source}{once}",
                "confidence": confidence,
            }
        )
        for name, response, limit, source, confidence in shipped
        if response in RESPONSES
    }


_RESERVED = ("config", "track", "guideway", "train", "figures", "tables", "checks", "report")
"""Folders beside those of the cases."""


class Law(Parameters):
    """Law of one random quantity: mean and deviation, bounds, or a table."""

    law: laws.Name = Field("normal", description="name of the law")
    mean: float | str | None = Field(
        None, description="mean, with its unit; left out: the configured value"
    )
    coefficient_of_variation: float | None = Field(
        None, description="standard deviation over the mean [-]", gt=0, allow_inf_nan=False
    )
    deviation: float | str | None = Field(None, description="standard deviation, with its unit")
    low: float | str | None = Field(None, description="lower bound, with its unit")
    high: float | str | None = Field(None, description="upper bound, with its unit")
    mode: float | str | None = Field(
        None, description="likeliest value of a triangular law; left out: the configured value"
    )
    quantiles: tuple[tuple[float, float | str], ...] | None = Field(
        None, description="table of [probability, value] from 0 to 1, linear between its rows"
    )
    values: tuple[float | str, ...] | None = Field(
        None, description="values of a discrete law or of a sample, with their units"
    )
    probabilities: tuple[float, ...] | None = Field(
        None, description="probability of each value of a discrete law; left out: all alike"
    )
    file: str | None = Field(
        None,
        description="CSV file with the values of a sample in its first column, the unit in the "
        "heading in brackets; path relative to the configuration file",
        json_schema_extra={"file": True},
    )

    @field_validator("law", mode="before")
    @classmethod
    def _as_one_word(cls, value: Any) -> Any:
        return value.replace(" ", "_") if isinstance(value, str) else value

    def quantities(self) -> dict[str, Any]:
        """Return what the law says, as the configuration file would write it."""
        said = {name: value for name, value in super().quantities().items() if value is not None}
        return said


def _all_gains(variation: float = 0.10, among: tuple[Gain, ...] = GAIN_KEYS) -> dict[str, Law]:
    """Independent normal gains of one coefficient of variation."""
    return {f"gains.{gain}": Law(coefficient_of_variation=variation) for gain in among}


WHY_NO_DESIGN = (
    "a surrogate of the random quantities does not know the track of a passage, which decides more "
    "of its extremes than they do; mcm counts over all tracks"
)
"""Reason why no method with a surrogate is carried out where tracks differ."""


class Case(Parameters):
    """One case: what is random in it and how, its own values, and the methods."""

    n_spans: int | None = Field(
        None, description="number of spans of this case; null: guideway.n_spans", ge=1
    )
    set: Mapping[str, Any] = Field(
        {},
        description="values of this case alone by the dotted keys of train, guideway, "
        "irregularity, gains, control and passage, such as {control.suspension.group: ends}",
    )
    sweep: Mapping[str, tuple[Any, ...]] = Field(
        {},
        description="one or two dotted keys with the values that make cases of this one, such as "
        "{passage.speed: [300 km/h, 400 km/h]}; they are called by its name and a number",
    )
    random: Mapping[str, Law] = Field(
        _all_gains(),
        description="what is random, by its dotted key, and its law; all else has its configured "
        "value; null makes a key fixed that a file below makes random",
        json_schema_extra={"names": r"^[a-z_0-9]+(\.[a-z_0-9]+)+$"},
    )
    correlation: tuple[tuple[str, str, float], ...] = Field(
        (),
        description="linear correlation of pairs of random quantities: [key, key, coefficient]; "
        "pairs left out are uncorrelated",
    )
    track: Literal["fixed", "random"] | int = Field(
        "fixed",
        description="fixed: the track of the seed; random: each run has a track of its own; or a "
        "number of tracks that the runs share in turns",
    )
    methods: tuple[Method, ...] = Field(
        ("asm",), description="methods that the target `all` runs", min_length=1
    )
    n_samples: int | None = Field(
        None, description="runs of its baseline; null: study.mcm.n_samples", ge=2
    )

    def __hash__(self) -> int:
        return hash(repr(self))

    @property
    def possible_methods(self) -> tuple[Method, ...]:
        """Methods of the case that can be carried out.

        A surrogate of the random quantities does not know the track of a passage: where tracks
        differ, only the baseline is left (`WHY_NO_DESIGN`).
        """
        fixed = self.track == "fixed"
        return tuple(name for name in self.methods if fixed or name == "mcm")

    @model_validator(mode="before")
    @classmethod
    def _refuse_old_keys(cls, data: Any) -> Any:
        if not isinstance(data, Mapping):
            return data
        for old, new in _NEW_FORM.items():
            if old in data:
                raise ValueError(f"{old} is no longer a key: write {new}")
        track = data.get("track", "fixed")
        if track not in ("fixed", "random") and not (type(track) is int and track >= 2):
            raise ValueError(
                f"track must be fixed, random or a number of tracks from 2, got {track!r}"
            )
        random = data.get("random")
        if not isinstance(random, Mapping):
            return data
        return {**data, "random": {key: law for key, law in random.items() if law is not None}}

    @model_validator(mode="after")
    def _check(self) -> Case:
        if len(set(self.methods)) < len(self.methods):
            raise ValueError(f"methods must not name anything twice, got {', '.join(self.methods)}")
        if not self.random:
            raise ValueError(
                "random must name at least one quantity, such as "
                "{gains.suspension_proportional: {law: normal, coefficient_of_variation: 0.1}}"
            )
        if self.n_spans is not None and "guideway.n_spans" in {
            *self.set,
            *self.random,
            *self.sweep,
        }:
            raise ValueError("n_spans says what guideway.n_spans says too; leave one of them out")
        for key in self.random:
            if key in self.set:
                raise ValueError(f"{key} is both set and random; leave one of them out")
        self._check_sweep()
        self._check_correlation()
        return self

    def _check_sweep(self) -> None:
        """Refuse a sweep over too many keys, over too few values, or over what is given already."""
        if len(self.sweep) > 2:
            raise ValueError(f"sweep takes one or two keys, got {', '.join(self.sweep)}")
        for key, values in self.sweep.items():
            for other, given in (("random", self.random), ("set", self.set)):
                if key in given:
                    raise ValueError(f"{key} is both swept and {other}; leave one of them out")
            if len(values) < 2:
                raise ValueError(f"sweep of {key} needs at least two values, got {len(values)}")

    def settings(self) -> dict[str, dict[str, Any]]:
        """Values of the swept keys of each case that the sweep makes, by what follows its name."""
        keys, lists = list(self.sweep), list(self.sweep.values())
        numbers = product(*(range(len(values)) for values in lists))
        return {
            "_".join(str(k + 1) for k in chosen): {
                key: values[k] for key, values, k in zip(keys, lists, chosen, strict=True)
            }
            for chosen in (numbers if keys else ())
        }

    def _check_correlation(self) -> None:
        """Refuse pairs that are not two random quantities, and coefficients that cannot be."""
        seen = set()
        for one, other, coefficient in self.correlation:
            for key in (one, other):
                if key not in self.random:
                    raise ValueError(
                        f"correlation: {key} is not random; the random ones are "
                        f"{', '.join(self.random)}"
                    )
            pair = frozenset((one, other))
            if len(pair) < 2 or pair in seen:
                raise ValueError(
                    f"correlation: {one} and {other} must be two quantities, named once"
                )
            seen.add(pair)
            if not abs(coefficient) < 1:
                raise ValueError(
                    f"correlation of {one} and {other} must lie between -1 and 1, "
                    f"got {coefficient:g}"
                )
        if seen and min(_eigenvalues(self.correlation_matrix)) <= 0:
            pairs = ", ".join(f"{one}, {other}: {r:g}" for one, other, r in self.correlation)
            raise ValueError(
                "correlation: these coefficients contradict each other, their matrix is not "
                f"positive definite: {pairs}"
            )

    @property
    def correlation_matrix(self) -> tuple[tuple[float, ...], ...]:
        """Linear correlation of the random quantities, in their order [-]."""
        keys = list(self.random)
        rows = [[float(j == k) for k in range(len(keys))] for j in range(len(keys))]
        for one, other, coefficient in self.correlation:
            j, k = keys.index(one), keys.index(other)
            rows[j][k] = rows[k][j] = coefficient
        return tuple(tuple(row) for row in rows)


_NEW_FORM = {
    "random_gains": "the gains with their laws under random, such as "
    "random: {gains.suspension_proportional: {law: normal, coefficient_of_variation: 0.1}}",
    "coefficient_of_variation": "it into the law of each quantity, such as "
    "random: {gains.suspension_proportional: {law: normal, coefficient_of_variation: 0.1}}",
    "random_track": "track: random",
}
"""What stands in place of keys of earlier versions."""


def _eigenvalues(matrix: tuple[tuple[float, ...], ...]) -> list[float]:
    import numpy as np

    return list(np.linalg.eigvalsh(np.array(matrix)))


def _cases() -> dict[str, Case]:
    """The cases of the paper, and those of who shares a circuit and how late its current comes."""
    cases = {"validation": Case(n_spans=5, methods=("mcm", "osm", "asm_paper", "asm"))}
    for gain in GAIN_KEYS:
        cases[f"only_{gain}"] = Case(n_spans=20, random=_all_gains(among=(gain,)))
    cases["all_gains"] = Case(n_spans=20)
    for percent in range(4, 16, 2):
        cases[f"cov_{percent:03d}"] = Case(n_spans=5, random=_all_gains(percent / 100))
    for name, key, value in (
        *((f"group_{group}", "group", group) for group in GROUPS if group != "pole"),
        ("lag_2ms", "lag", "2 ms"),
    ):
        cases[name] = Case(
            n_spans=5,
            set={f"control.{kind}.{key}": value for kind in ("suspension", "guidance")},
            methods=("mcm", "asm"),
            n_samples=2000,
        )
    return cases


def _swept(cases: Mapping[str, Any]) -> dict[str, Any]:
    """Cases that the sweeps among some cases make, as a file would write them."""
    made: dict[str, Any] = {}
    for name, case in cases.items():
        sweep = case.get("sweep") if isinstance(case, Mapping) else None
        if not isinstance(sweep, Mapping) or not sweep:
            continue
        try:
            settings = Case.model_validate(case).settings()
        except ValidationError:
            continue  # said when the case itself is checked
        plain = {key: value for key, value in case.items() if key != "sweep"}
        for number, values in settings.items():
            one = {**plain, "set": {**(case.get("set") or {}), **values}}
            taken = cases.get(f"{name}_{number}", one)
            if taken is not None and not isinstance(taken, Case) and dict(taken) != one:
                made_by = Case.model_validate(one)
                if Case.model_validate(taken) != made_by:
                    raise ValueError(
                        f"cases.{name}.sweep makes a case {name}_{number}, which there is already; "
                        "give one of them another name"
                    )
            made[f"{name}_{number}"] = one
    return made


class PaperFigures(Parameters):
    """Cases that the numbered figures and tables of the paper compare, in the order of legends."""

    compared: str = Field(
        "validation", description="case by every method: figures 9 to 12, tables, the line"
    )
    by_gain: tuple[str, ...] = Field(
        (*(f"only_{gain}" for gain in GAIN_KEYS), "all_gains"),
        description="cases with each gain random alone, and with all: figures 13 and 14",
    )
    by_variation: tuple[str, ...] = Field(
        tuple(f"cov_{percent:03d}" for percent in range(4, 16, 2)),
        description="cases whose gains vary ever more: figures 15 and 16",
    )
    by_control: tuple[str, ...] = Field(
        ("validation", *(f"group_{group}" for group in GROUPS if group != "pole"), "lag_2ms"),
        description="cases of who shares a circuit and how late its current comes",
    )


_OF_A_CASE = ("train", "guideway", "irregularity", "gains", "control", "passage")
"""Sections in which a case may have values of its own."""


def _with_value(section: Any, keys: list[str], value: Any) -> Any:
    """Copy of a section with another value at nested keys, checked like a value from a file."""
    first, *rest = keys
    if not isinstance(section, Parameters) or first not in type(section).model_fields:
        raise KeyError(first)
    if not rest:
        return type(section).model_validate(section.quantities() | {first: value})
    inner = _with_value(getattr(section, first), rest, value)
    return section.model_copy(update={first: inner})


def _field_at(section: Any, keys: list[str]) -> tuple[FieldInfo, Any]:
    """Field and value at nested keys of a section.

    Raises
    ------
    KeyError
        With the first key that there is not.
    """
    first, *rest = keys
    if not hasattr(section, "field_named"):
        raise KeyError(first)
    field, value = section.field_named(first), getattr(section, first)
    return _field_at(value, rest) if rest else (field, value)


TAIL = 1e-6
"""Probability of a law that may lie where the model makes no sense [-]; assumed: far below what a
study with such a law can tell."""


def _with_numbers(section: Parameters, nested: Mapping[str, Any], place: str) -> Any:
    """Copy of a section with other numbers in SI, all of its checks made once."""
    fields = dict(section.__dict__)
    for name, value in nested.items():
        inner = fields.get(name)
        if isinstance(inner, Parameters) != isinstance(value, Mapping) or (
            not isinstance(value, Mapping)
            and (isinstance(inner, bool) or not isinstance(inner, int | float))
        ):
            raise UserError(f"{place}{name} is no number of the configuration")
        if isinstance(value, Mapping):
            value = _with_numbers(fields[name], value, f"{place}{name}.")
        fields[name] = value
    try:
        return type(section).model_validate(fields, context=_IN_SI)
    except ValidationError as error:
        found = error.errors()[0]
        why = found["msg"].removeprefix("Value error, ")
        if not found["loc"]:  # of the section as a whole: the sentence begins with a key of it
            raise UserError(f"{place}{why}") from None
        raise UserError(f"{place}{found['loc'][0]}: {why}, got {found['input']!r}") from None


BORDER_OF_HALF = {"suspension": 1.246, "guidance": 1.396}
"""Least stable k_p over i0/delta0 where circuits are fed by the mean gap of their half: of one
linearised car with the default masses and springs (docs/theory/control.md); of the other groups it
is 1.  Another train has other values; these serve for a first check only."""


RAW_CUTOFF, RAW_STEP = 2000.0, 0.06e-3
"""Mode cut-off [Hz] and step [s] from which raw girder accelerations are within 1 % of their limit;
measured, docs/convergence.md."""


class Config(Parameters):
    """All parameters of a run."""

    run: str = Field(
        "paper",
        description="name of the run: its results lie in results/<run>",
        pattern=r"^[A-Za-z0-9_-]+$",
    )
    demonstration: bool = Field(
        False, description="mark all files and figures as a demonstration, not a result"
    )
    seed: int = Field(20240919, description="seed of everything random", ge=0)
    train: Train = Train()
    guideway: Guideway = Guideway()
    irregularity: Irregularity = Irregularity()
    gains: Gains = Gains()
    control: Control = Control()
    passage: Passage = Passage()
    validation: Validation = Validation()
    study: Study = Study()
    figures: PaperFigures = PaperFigures()
    only: tuple[str, ...] | None = Field(
        None, description="names of the cases that are run, in their order; null: all"
    )
    limit_states: Mapping[str, LimitState] = Field(
        _limit_states(),
        description="the limit states by name; lost, levitation is lost, is always there; null "
        "removes one that a file below names",
        json_schema_extra={"names": r"^\S(.*\S)?$"},
    )
    cases: Mapping[str, Case] = Field(
        _cases(),
        description="the cases by name; null removes a case that a file below names",
        json_schema_extra={"names": r"^[a-z][a-z0-9_]*$"},
    )

    def __hash__(self) -> int:
        return hash(
            tuple(
                frozenset(value.items()) if isinstance(value, Mapping) else value
                for value in self.__dict__.values()
            )
        )

    def quantities(self) -> dict[str, Any]:
        """Return the class as the configuration file would write it, units included."""
        whole = super().quantities()
        for key, shipped in (("limit_states", _limit_states()), ("cases", _cases())):
            kept = getattr(self, key)
            whole[key] |= {name: None for name in shipped if name not in kept}
        return whole

    @model_validator(mode="before")
    @classmethod
    def _arrange_cases(cls, data: Any) -> Any:
        """Leave the cases away that are not among those of ``only``, and add those of sweeps."""
        cases = data.get("cases", _cases()) if isinstance(data, Mapping) else None
        if not isinstance(cases, Mapping) or not cases:
            return data
        only = data.get("only")
        if isinstance(only, list | tuple):
            for name in only:
                if cases.get(name) is None:
                    known = ", ".join(key for key, one in cases.items() if one is not None)
                    raise ValueError(f"only names '{name}', which is no case; there are: {known}")
            cases = {name: cases[name] for name in only}
        return {**data, "cases": {**cases, **_swept(cases)}}

    @field_validator("cases", mode="before")
    @classmethod
    def _drop_removed(cls, cases: Any) -> Any:
        if not isinstance(cases, Mapping):
            return cases
        for name in cases:
            if not re.fullmatch(r"[a-z][a-z0-9_]*", str(name)) or name in _RESERVED:
                raise ValueError(
                    f"{name} cannot name a case: use small letters, digits and underscores, and "
                    f"none of {', '.join(_RESERVED)}"
                )
        return {name: case for name, case in cases.items() if case is not None}

    @field_validator("limit_states", mode="before")
    @classmethod
    def _drop_removed_states(cls, states: Any) -> Any:
        if not isinstance(states, Mapping):
            return states
        for name in states:
            if not re.fullmatch(r"\S(.*\S)?", str(name)) or name == LOST:
                raise ValueError(
                    f"{name} cannot name a limit state: use a line of text that neither begins nor "
                    f"ends with a space; {LOST} is always there and means lost levitation"
                )
        return {name: state for name, state in states.items() if state is not None}

    @model_validator(mode="after")
    def _check_limit_states(self) -> Config:
        known = (*self.limit_states, LOST)
        for name, state in self.limit_states.items():
            key = "any_of" if state.any_of else "all_of"
            for part in state.parts:
                if part not in known:
                    raise ValueError(
                        f"limit_states.{name}.{key} names no limit state: there is no '{part}', "
                        f"known are: {', '.join(known)}"
                    )
        for name in self.limit_states:
            self._responses_of_state(name)
        return self

    def _responses_of_state(self, name: str, above: tuple[str, ...] = ()) -> tuple[Response, ...]:
        """Responses that a limit state and the parts of it limit.

        Raises
        ------
        ValueError
            If it contains itself.
        """
        if name in above:
            circle = " -> ".join((*above[above.index(name) :], name))
            raise ValueError(f"limit_states.{above[0]} goes in a circle: {circle}")
        if name == LOST:
            return ()
        state = self.limit_states[name]
        own = () if state.response is None else (state.response,)
        within = (*above, name)
        return own + tuple(
            one for part in state.parts for one in self._responses_of_state(part, within)
        )

    @property
    def responses_of_study(self) -> tuple[Response, ...]:
        """Responses that are predicted: those of the study, then those of the limit states.

        Examples
        --------
        >>> Config().responses_of_study[0]
        'girder_displacement_z'
        """
        of_states = (one for name in self.limit_states for one in self._responses_of_state(name))
        return tuple(dict.fromkeys((*self.study.responses, *of_states)))

    @property
    def responses_of_designs(self) -> tuple[Response, ...]:
        """Responses that drive adaptive designs, and that every design reports on."""
        chosen = self.study.asm.responses
        if chosen is None:
            driving = (
                one
                for name, state in self.limit_states.items()
                if state.drives
                for one in self._responses_of_state(name)
            )
            chosen = (*self.study.responses, *driving)
        return tuple(dict.fromkeys(chosen))

    def with_responses(self) -> Config:
        """Return the configuration whose study names all responses, its limit states' included."""
        asm = self.study.asm.model_copy(update={"responses": self.responses_of_designs})
        study = self.study.model_copy(update={"responses": self.responses_of_study, "asm": asm})
        return self.model_copy(update={"study": study})

    def with_values(self, values: Mapping[str, Any], prefix: str = "") -> Config:
        """Return the configuration with other values at dotted keys, written as in a file.

        Parameters
        ----------
        values
            Such as ``{"passage.speed": "500 km/h"}``.
        prefix
            Text before each key in messages.

        Raises
        ------
        UserError
            If a case cannot set the key, or the value is refused.
        """
        changed = self
        for dotted, value in values.items():
            keys = dotted.split(".")
            if keys[0] not in _OF_A_CASE or len(keys) < 2:
                raise UserError(
                    f"{prefix}{dotted} cannot be set for a case alone; the sections that can are "
                    f"{', '.join(_OF_A_CASE)}, such as passage.speed"
                )
            try:
                changed = _with_value(changed, keys, value)
            except ValidationError as error:
                why = error.errors()[0]["msg"].removeprefix("Value error, ")
                raise UserError(f"{prefix}{dotted}: {why}") from None
            except KeyError as error:
                raise UserError(
                    f"{prefix}{dotted} is no key of the configuration: "
                    f"there is no {error.args[0]!r}"
                ) from None
        return changed

    def number_at(self, key: str) -> tuple[float, str]:
        """Return the number at a dotted key, in SI, and its unit.

        Parameters
        ----------
        key
            Such as ``"train.car_body.mass"``.

        Returns
        -------
        number, unit
            The unit in the notation of pint; empty for a count or a pure number.

        Raises
        ------
        UserError
            If there is no such key, or no number at it.

        Examples
        --------
        >>> Config().number_at("train.car_body.mass")
        (39000.0, 'kg')
        """
        section: Any = self
        *outer, last = key.split(".")
        for name in [*outer, last]:
            if not isinstance(section, Parameters) or name not in type(section).model_fields:
                raise UserError(f"{key} is no key of the configuration: there is no {name!r}")
            parent, section = section, getattr(section, name)
        if isinstance(section, bool) or not isinstance(section, int | float):
            raise UserError(f"{key} must be a number to be given in numbers, it is {section!r}")
        extra = type(parent).model_fields[last].json_schema_extra
        unit = extra.get("unit") if isinstance(extra, dict) else None
        return float(section), str(unit or "")

    def with_numbers(self, numbers: Mapping[str, float], place: str = "") -> Config:
        """Return the configuration with other numbers at dotted keys, in SI.

        The same checks are made as of a file; the cases are left as they are.

        Parameters
        ----------
        numbers
            In SI, such as ``{"passage.speed": 120.0}``.
        place
            What they belong to, for messages.

        Raises
        ------
        UserError
            If there is no number at a key, or a number will not do.

        Examples
        --------
        >>> Config().with_numbers({"guideway.pier.height": 12.0}).guideway.pier.height
        12.0
        """
        nested: dict[str, Any] = {}
        for key, number in numbers.items():
            *outer, last = key.split(".")
            inner = nested
            for name in outer:
                inner = inner.setdefault(name, {})
            inner[last] = number
        for name, value in nested.items():
            section = self.__dict__.get(name)
            if not isinstance(section, Parameters) or not isinstance(value, Mapping):
                raise UserError(f"{place}{name} is no section of numbers of the configuration")
            nested[name] = _with_numbers(section, value, f"{place}{name}.")
        config = self.model_copy(update=nested)
        try:
            config._check_sections()
        except ValueError as error:
            raise UserError(f"{place}{error}") from None
        return config

    def with_case_set(self, name: str) -> Config:
        """Return the configuration in which a case's own values are those of all.

        The case then sets nothing any more.
        """
        case = self.cases[name]
        if not case.set:
            return self
        plain = case.model_copy(update={"set": {}})
        changed = self.with_values(case.set, f"cases.{name}.set: ")
        return changed.model_copy(update={"cases": {**self.cases, name: plain}})

    def of_case(self, name: str) -> Config:
        """Return the configuration with a case's own values and its guideway.

        Raises
        ------
        UserError
            If there is no such case.
        """
        if name not in self.cases:
            raise UserError(f"there is no case '{name}', known are: {', '.join(self.cases)}")
        own = self.with_case_set(name)
        n_spans = own.cases[name].n_spans
        if n_spans is None:
            return own
        guideway = own.guideway.model_copy(update={"n_spans": n_spans})
        return own.model_copy(update={"guideway": guideway})

    def unit_of(self, key: str) -> str:
        """SI unit of a quantity by its dotted key; empty for a pure number.

        Raises
        ------
        UserError
            If the key is none of a case's, or its value is no number.
        """
        keys = key.split(".")
        if keys[0] not in _OF_A_CASE or len(keys) < 2:
            raise UserError(
                f"{key} cannot be random; the sections whose numbers can are "
                f"{', '.join(_OF_A_CASE)}, such as train.car_body.mass"
            )
        try:
            field, value = _field_at(self, keys)
        except KeyError as error:
            raise UserError(
                f"{key} is no key of the configuration: there is no {error.args[0]!r}"
            ) from None
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise UserError(f"{key} cannot be random: its value is no number, but {value!r}")
        extra = field.json_schema_extra
        return str(extra.get("unit", "")) if isinstance(extra, dict) else ""

    def swept_number(self, key: str, value: Any) -> tuple[float, str]:
        """Number in SI, and its unit, that a value of a swept key stands for.

        Parameters
        ----------
        key
            Dotted key.
        value
            As a file writes it.

        Returns
        -------
        number, unit
            NaN and an empty text for a value that is no number, such as the group of a circuit.

        Examples
        --------
        >>> Config().swept_number("passage.speed", "360 km/h")
        (100.0, 'm/s')
        """
        first, *keys = key.split(".")
        field, number = _field_at(_with_value(getattr(self, first), keys, value), keys)
        if isinstance(number, bool) or not isinstance(number, int | float):
            return math.nan, ""
        extra = field.json_schema_extra
        return float(number), str(extra.get("unit", "")) if isinstance(extra, dict) else ""

    def value_of(self, key: str) -> float:
        """Number at a dotted key, in SI."""
        return float(_field_at(self, key.split("."))[1])

    def distribution(self, name: str, key: str) -> laws.Distribution:
        """Distribution of a random quantity of a case, in SI.

        Parameters
        ----------
        name
            Name of the case, whose own values are those of all already.
        key
            Dotted key of the quantity.

        Raises
        ------
        UserError
            If the key is no number of the configuration, or there is no such law.
        """
        unit = self.unit_of(key)
        try:
            return laws.distribution(self.cases[name].random[key], self.value_of(key), unit, key)
        except ValueError as error:
            raise UserError(str(error)) from None

    def statically_stable(self, name: str) -> float:
        """Probability that the gains of a case can hold the train statically [-].

        A magnet pulls more the closer it is, so its k_p must exceed i₀/δ₀, times `BORDER_OF_HALF`
        for the group ``half``, and its k_d must not be negative.  What lag and delay take away is
        not in it; gains count as independent.

        References
        ----------
        docs/theory/train.md, the linearised magnet.
        """
        probability = 1.0
        for kind in ("suspension", "guidance"):
            magnet = getattr(self.train, f"{kind}_magnet")
            half = getattr(self.control, kind).group == "half"
            factor = BORDER_OF_HALF[kind] if half else 1.0
            for gain, least in (
                (f"{kind}_proportional", factor * magnet.current_reference / magnet.gap_reference),
                (f"{kind}_derivative", 0.0),
            ):
                if f"gains.{gain}" in self.cases[name].random:
                    of_gain = self.distribution(name, f"gains.{gain}")
                    probability *= 1.0 - float(of_gain.cdf(least))
                elif getattr(self.gains, gain) < least:
                    return 0.0
        return probability

    @model_validator(mode="after")
    def _check_followed(self) -> Config:
        for name in self.study.in_time.cases:
            if self.cases and name not in self.cases and name not in _cases():
                raise ValueError(
                    f"study.in_time.cases: there is no case '{name}', known are: "
                    f"{', '.join(self.cases)}"
                )
        return self

    @model_validator(mode="after")
    def _check(self) -> Config:
        self._check_sections()
        return self

    @model_validator(mode="after")
    def _check_cases(self) -> Config:
        for name, case in self.cases.items():
            if case.set:
                own = self.with_case_set(name)
                type(self).model_validate(own.quantities() | {"cases": {}})
                own._check_case(name)
            else:
                self._check_case(name)
        return self

    def _check_case(self, name: str) -> None:
        """Refuse a case whose laws make no sense or whose gains hardly ever hold the train."""
        place = f"cases.{name}.random."
        for key in self.cases[name].random:
            try:
                self._check_law(name, key)
            except UserError as error:
                raise ValueError(f"{place}{error}") from None
        stable = self.statically_stable(name)
        if stable < 0.5:
            raise ValueError(
                f"cases.{name}.random leaves only {100 * stable:.0f} % of the gains statically "
                "stable (k_p > i0/delta0, more for the group half, k_d >= 0), expected at least "
                "half; lower the variation, raise the mean gains or take the case away with null"
            )
        asm, n_quantities = self.study.asm, len(self.cases[name].random)
        largest = asm.largest(n_quantities)
        if "asm" in self.cases[name].methods and asm.n_candidates < largest:
            raise ValueError(
                f"study.asm.n_candidates must be at least {largest}, the largest number of runs of "
                f"the {n_quantities} random quantities of cases.{name}, got {asm.n_candidates}; "
                "set more, or study.asm.n_largest"
            )

    def _check_law(self, name: str, key: str) -> None:
        """Refuse a law with mass where the configuration would be refused."""
        law = self.distribution(name, key)
        whole = isinstance(_field_at(self, key.split("."))[1], int)
        if whole:
            values = law.values if isinstance(law, laws.Discrete) else ()
            if not values or any(value != round(value) for value in values):
                raise UserError(f"{key}: it counts, so that its law must be discrete, of integers")
        if isinstance(law, laws.Discrete):
            for value in law.values:
                why = self._why_not(key, value)
                if why:
                    raise UserError(f"{key}: its value {value:g} makes no sense: {why}")
            return
        for quantile in (law.ppf, law.isf):
            why = self._why_not(key, float(quantile(TAIL)))
            if why:
                share = self._share_refused(key, quantile)
                raise UserError(
                    f"{key}: {100 * share:.2g} % of the law lies where the model makes no sense "
                    f"({why}); narrow the law, or take one with bounds, such as lognormal or "
                    "truncated_normal"
                )

    def _why_not(self, key: str, value: float) -> str:
        """Why a value will not do; empty if it will."""
        if key.startswith("gains.") and value > 0:  # nothing else is asked of a gain
            return ""
        try:
            self.with_numbers({key: value})
        except UserError as error:
            return str(error).removeprefix(f"{key}: ").replace("Input should be", "it must be")
        return ""

    def _share_refused(self, key: str, quantile: Callable[[float], Any]) -> float:
        """Probability, from one end of a law on, of values that will not do."""
        low, high = TAIL, 1.0
        for _ in range(30):
            share = math.sqrt(low * high)
            low, high = (
                (share, high) if self._why_not(key, float(quantile(share))) else (low, share)
            )
        return low

    def _check_sections(self) -> None:
        """Refuse sections that do not fit each other."""
        for kind in ("suspension", "guidance"):
            magnet = getattr(self.train, f"{kind}_magnet")
            if not self.passage.gap_contact < magnet.gap_reference < self.passage.gap_lost:
                raise ValueError(
                    f"train.{kind}_magnet.gap_reference must lie between passage.gap_contact = "
                    f"{self.passage.gap_contact:g} m and passage.gap_lost = "
                    f"{self.passage.gap_lost:g} m, got {magnet.gap_reference:g} m"
                )
            if magnet.pole_length == 0 and self.passage.acceleration_band is None:
                raise ValueError(
                    "passage.acceleration_band: null (raw accelerations) needs poles with a "
                    f"length, got train.{kind}_magnet.pole_length = 0 m: points step on and off "
                    "the rail's joints, and the raw acceleration has no limit as step and cut-off "
                    "are refined; give a pole_length or a band"
                )
        passage = self.passage
        if passage.acceleration_band is None and (
            passage.mode_cutoff < RAW_CUTOFF or passage.time_step > RAW_STEP * (1 + 1e-9)
        ):
            raise ValueError(
                "passage.acceleration_band: null (raw accelerations) needs passage.mode_cutoff of "
                f"at least {RAW_CUTOFF:g} Hz and passage.time_step of at most "
                f"{RAW_STEP * 1e3:g} ms, got {passage.mode_cutoff:g} Hz and "
                f"{passage.time_step * 1e3:g} ms: coarser, they are a property of the cut-off and "
                "the step, not of the bridge; refine both or give a band"
            )
        if self.irregularity.fade_in > self.passage.approach:
            raise ValueError(
                f"irregularity.fade_in must not exceed passage.approach = "
                f"{self.passage.approach:g} m, got {self.irregularity.fade_in:g} m"
            )
