"""The kinds of quantity: their SI units, the scales of their other units, and the messages for a wrong unit."""

from __future__ import annotations

import re
from dataclasses import dataclass
from fractions import Fraction
from functools import lru_cache

from fourpole.errors import UnitError
from fourpole.units.grammar import SPELLINGS, Dimensions, add_up, lookup, nearest, parse, shown, spelled_out


@dataclass(frozen=True)
class UnitKind:
    """A kind of quantity: its SI unit, an example, and the spellings to suggest (the first few are shown)."""

    si: str
    example: str
    units: tuple[str, ...]


_LENGTHS = ("m", "mm", "µm", "cm", "in", "um", "ft", "km")
TABLE: dict[str, UnitKind] = {
    "mass": UnitKind("kg", "15 kg", ("kg", "g", "t", "lb")),
    "force": UnitKind("N", "1000 N", ("N", "kN", "kgf", "lbf", "mN", "daN", "MN")),
    "stiffness": UnitKind("N/m", "12.44 kN/m", ("N/m", "kN/m", "N/mm", "kN/mm", "MN/m", "lbf/in", "kgf/mm")),
    "damping": UnitKind("N s/m", "20 N s/m", ("N s/m", "kN s/m", "N s/mm", "lbf s/in", "Ns/m", "N·s/m", "kg/s")),
    "length": UnitKind("m", "0.5 mm", _LENGTHS),
    "area": UnitKind("m^2", "5 cm²", ("m²", "cm²", "mm²", "m^2", "cm^2", "mm^2", "in²")),
    "displacement": UnitKind("m", "0.5 mm", _LENGTHS),
    "velocity": UnitKind("m/s", "0.2 m/s", ("m/s", "mm/s", "in/s", "km/h", "cm/s", "µm/s", "mph")),
    "acceleration": UnitKind("m/s^2", "9.81 m/s²", ("m/s²", "g", "mm/s²", "m/s^2", "m/s2", "in/s²", "ft/s²")),
    "pressure": UnitKind("Pa", "1.7 bar", ("Pa", "kPa", "bar", "psi", "kgf/cm²", "MPa", "hPa", "mbar", "GPa")),
    "frequency": UnitKind("1/s", "18 Hz", ("Hz", "kHz", "rpm", "1/min", "rad/s", "1/s", "mHz")),
    "time": UnitKind("s", "0.2 ms", ("s", "ms", "µs", "min", "h", "us", "sec")),
    "temperature": UnitKind("degC", "20 °C", ("°C", "degC", "K", "°F", "degF")),
    "angle": UnitKind("rad", "0.2 deg", ("rad", "deg", "°", "mrad")),
    "ratio": UnitKind("1", "0.5 %", ("1", "%", "ppm", "-")),
    "mobility": UnitKind("m/(N s)", "0.001 m/(N s)", ("m/(N s)", "mm/(N s)", "m/(kN s)", "m/(Ns)", "s/kg")),
    "receptance": UnitKind("m/N", "0.001 mm/N", ("m/N", "mm/N", "µm/N", "in/lbf")),
    "compliance": UnitKind("1/Pa", "0.2 MPa^-1", ("1/Pa", "MPa^-1", "1/kPa", "1/MPa", "1/GPa")),
    "accelerance": UnitKind("m/(N s^2)", "0.5 (m/s²)/N", ("(m/s²)/N", "g/N", "(m/s^2)/N", "1/kg", "(in/s²)/lbf")),
    "voltage": UnitKind("V", "5 V", ("V", "mV", "µV", "kV")),
    "inertia": UnitKind("kg m^2", "1200 kg m²", ("kg m²", "kg m^2", "t m²", "g cm²")),
    "energy": UnitKind("J", "3 J", ("J", "kJ", "N m", "Nm", "mJ")),
}
KINDS: tuple[str, ...] = tuple(TABLE)
"""Names of the kinds of quantity, which the functions of this package take as `kind`."""
MOTIONS: tuple[str, ...] = ("displacement", "velocity", "acceleration")
"""The kinds of quantity that a motion channel may record."""
# Scale and offset of each unit: Celsius = scale * value + offset. pint is not used, for it refuses products of degC.
TEMPERATURES: dict[str, tuple[Fraction, Fraction]] = {
    **dict.fromkeys(("degC", "°C", "C", "celsius", "deg C", "° C"), (Fraction(1), Fraction(0))),
    **dict.fromkeys(("K", "kelvin"), (Fraction(1), Fraction(-27315, 100))),
    **dict.fromkeys(("degF", "°F", "F", "fahrenheit", "deg F", "° F"), (Fraction(5, 9), Fraction(-160, 9))),
}
SUGGESTED = frozenset(unit for kind in TABLE.values() for unit in kind.units)
COMMON = frozenset(unit.translate(SPELLINGS) for unit in SUGGESTED)


def kind_named(kind: str) -> UnitKind:
    """The kind of this name; ValueError if there is none."""
    try:
        return TABLE[kind]
    except KeyError:
        raise ValueError(f"{shown(kind)} is no kind of quantity; they are {', '.join(KINDS)}") from None


def affine(unit: str, kind: str) -> tuple[Fraction, Fraction]:
    """Scale and offset: SI value = scale * value + offset."""
    if kind == "temperature":
        scale = TEMPERATURES.get(spelled_out(unit))
        if scale is None:
            raise UnitError(_wrong(unit, None, (kind,)))
        return scale
    return scale_of(unit, (kind,))[1], Fraction(0)


@lru_cache(maxsize=1024)
def scale_of(unit: str, kinds: tuple[str, ...]) -> tuple[str, Fraction]:
    """The first of the kinds that has the unit's dimensions, and the scale of the unit to the SI unit of that kind."""
    spelled = spelled_out(unit)
    for kind in kinds:
        if spelled == kind_named(kind).si:  # this commonest case does not need pint
            return kind, Fraction(1)
    gravity = not {"acceleration", "accelerance"}.isdisjoint(kinds) and "mass" not in kinds
    try:
        scale, dimensions = parse(spelled, gravity)
    except UnitError as error:
        alike = _nearest(spelled, kinds)
        hint = f"; did you mean '{alike}'?" if alike else ""
        raise UnitError(f"{error}{hint} (known: {_usual(kinds)})") from None
    for kind in kinds:
        factor = _kind_scale(kind, dimensions)
        if factor is not None:
            return kind, scale * factor
    raise UnitError(_wrong(unit, dimensions, kinds))


def _kind_scale(kind: str, dimensions: Dimensions) -> Fraction | None:
    """Factor from pint's root units to the SI unit of the kind; None if the kind has other dimensions."""
    if kind == "temperature":
        return None
    si, wanted = parse(kind_named(kind).si, False)
    if dimensions == wanted:
        return 1 / si
    if kind == "frequency" and dimensions == add_up((wanted, 1), ((("radian", 1),), 1)):
        return 1 / lookup("revolution")[0]  # a radian per second is 1/(2 pi) Hz
    return None


def kind_of(dimensions: Dimensions) -> str | None:
    """The first kind that has these dimensions."""
    return next((kind for kind in KINDS if _kind_scale(kind, dimensions) is not None), None)


def _wrong(unit: str, dimensions: Dimensions | None, kinds: tuple[str, ...]) -> str:
    """The message for a unit that is known but not of these kinds."""
    other = kind_of(dimensions) if dimensions is not None else None
    what = f"{shown(unit)} is {_article(other)}" if other else f"{shown(unit)} is of another kind"
    wanted = ", ".join(map(_article, kinds[:-1])) + " or " * (len(kinds) > 1) + _article(kinds[-1])
    alike = _likely(spelled_out(unit), kinds)
    hint = f"; did you mean '{alike}'?" if alike else ""
    return f"{what}; {wanted} is needed: {_usual(kinds)}{hint}"


def _article(kind: str) -> str:
    return f"{'an' if kind[0] in 'aeiou' else 'a'} {kind}"


def _usual(kinds: tuple[str, ...]) -> str:
    """The usual units of some kinds, as a list to show."""
    most = 5 if len(kinds) == 1 else 3
    return ", ".join(dict.fromkeys(unit for kind in kinds for unit in kind_named(kind).units[:most]))


def _likely(spelled: str, kinds: tuple[str, ...]) -> str | None:
    """The unit that was meant, if only case, kgf for kg, lbf for lb or brackets after the solidus differ; else None."""
    known = [unit for kind in kinds for unit in kind_named(kind).units]
    forced = re.sub(r"^(kg|lb)(?=\s*/)", r"\1f", spelled)
    for unit in known:
        plain = unit.translate(SPELLINGS)
        if plain.casefold() == spelled.casefold() or plain.replace("*", "") == forced:
            return unit
    numerator, _, rest = spelled.partition("/")
    if re.search(r"[A-Za-z0-9]", rest) and "(" not in rest and re.search(r"[ */.-]", rest.strip()):
        bracketed = f"{numerator.strip()}/({rest.strip()})"
        try:
            _, dimensions = parse(bracketed, True)
        except UnitError:
            return None
        if any(_kind_scale(kind, dimensions) is not None for kind in kinds):
            return bracketed
    return None


def _nearest(spelled: str, kinds: tuple[str, ...]) -> str | None:
    known = [unit for kind in kinds for unit in kind_named(kind).units]
    return _likely(spelled, kinds) or nearest(spelled, known)
