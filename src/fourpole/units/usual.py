"""The units that most campaigns use, by pint's root units, so that pint is loaded for other units only.

Loading pint with its registry takes half a second, in every command and worker process. The tests compare each entry
with pint.
"""

from __future__ import annotations

from fractions import Fraction

Dimensions = tuple[tuple[str, int], ...]

_PI = Fraction("3.1415926535897932384626433832795028841971693993751")
_POUND, _GRAVITY, _INCH = Fraction("453.59237"), Fraction("9.80665"), Fraction("0.0254")
_PREFIXES = {
    prefix: Fraction(10) ** power
    for prefix, power in {"": 0, "M": 6, "k": 3, "h": 2, "da": 1, "c": -2, "m": -3, "µ": -6, "u": -6, "G": 9}.items()
}


def _powers(**powers: int) -> Dimensions:
    return tuple(sorted(powers.items()))


_LENGTH, _MASS, _TIME, _ANGLE = _powers(meter=1), _powers(gram=1), _powers(second=1), _powers(radian=1)
_FORCE = _powers(gram=1, meter=1, second=-2)
_PRESSURE = _powers(gram=1, meter=-1, second=-2)
#: Symbol -> its prefixes with blanks between them ("." is none), SI value in root units, dimensions.
_PREFIXED: dict[str, tuple[str, int | Fraction, Dimensions]] = {
    "m": (". k c m µ u", 1, _LENGTH),
    "g": (". k m", 1, _MASS),
    "s": (". m µ u", 1, _TIME),
    "N": (". M k da m", 1000, _FORCE),
    "Pa": (". G M k h", 1000, _PRESSURE),
    "bar": (". m", 10**8, _PRESSURE),
    "Hz": (". k m", 1, _powers(second=-1)),
    "rad": (". m", 1, _ANGLE),
    "J": (". k m", 1000, _powers(gram=1, meter=2, second=-2)),
    "V": (". k m µ u", 1000, _powers(gram=1, meter=2, second=-3, ampere=-1)),
}
_ALONE: dict[str, tuple[int | Fraction, Dimensions]] = {
    "micrometer": (Fraction(1, 10**6), _LENGTH),
    "in": (_INCH, _LENGTH),
    "ft": (12 * _INCH, _LENGTH),
    "mph": (5280 * 12 * _INCH / 3600, _powers(meter=1, second=-1)),
    "standard_gravity": (_GRAVITY, _powers(meter=1, second=-2)),
    "t": (10**6, _MASS),
    "lb": (_POUND, _MASS),
    "pound": (_POUND, _MASS),
    "kgf": (1000 * _GRAVITY, _FORCE),
    "kilogram_force": (1000 * _GRAVITY, _FORCE),
    "lbf": (_POUND * _GRAVITY, _FORCE),
    "psi": (_POUND * _GRAVITY / _INCH**2, _PRESSURE),
    "sec": (1, _TIME),
    "min": (60, _TIME),
    "h": (3600, _TIME),
    "rpm": (2 * _PI / 60, _powers(radian=1, second=-1)),
    "deg": (_PI / 180, _ANGLE),
    "degree": (_PI / 180, _ANGLE),
    "revolution": (2 * _PI, _ANGLE),
    "K": (1, _powers(kelvin=1)),
    "percent": (Fraction(1, 100), ()),
    "ppm": (Fraction(1, 10**6), ()),
}
#: Scale to root units and dimensions, by name.
USUAL: dict[str, tuple[Fraction, Dimensions]] = {
    **{
        prefix.strip(".") + symbol: (_PREFIXES[prefix.strip(".")] * scale, dimensions)
        for symbol, (prefixes, scale, dimensions) in _PREFIXED.items()
        for prefix in prefixes.split()
    },
    **{name: (Fraction(scale), dimensions) for name, (scale, dimensions) in _ALONE.items()},
}
