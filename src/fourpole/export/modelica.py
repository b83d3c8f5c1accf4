"""Modelica source: a package with a block for each model, from deflection and its rate to force.

The blocks use the language alone, not the Modelica Standard Library. Their connectors fit its inputs and outputs.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from fourpole.core.arrays import FloatArray
from fourpole.core.specimen import Specimen
from fourpole.export.source import identifiers
from fourpole.export.systems import Points, System, systems_of
from fourpole.fitting.modelfile import ModelFile
from fourpole.io.write import write_text
from fourpole.models.realised import Realised

#: Keywords of Modelica, names of its functions that the blocks use, and names of the package.
# fmt: off
_RESERVED = frozenset((
    "algorithm", "and", "annotation", "assert", "block", "break", "class", "connect", "connector", "constant",
    "constrainedby", "der", "discrete", "each", "else", "elseif", "elsewhen", "encapsulated", "end", "enumeration",
    "equation", "expandable", "extends", "external", "false", "final", "flow", "for", "function", "if", "import",
    "impure", "in", "initial", "inner", "input", "loop", "model", "not", "operator", "or", "outer", "output", "package",
    "parameter", "partial", "protected", "public", "pure", "record", "redeclare", "replaceable", "return", "stream",
    "then", "true", "type", "when", "while", "within", "Real", "Integer", "Boolean", "String", "time", "fill", "zeros",
    "RealInput", "RealOutput", "Modelica",
))
# fmt: on
#: Numbers in one line of an array.
_IN_LINE = 4
#: Variables between the ends of a specimen with a belt: name, unit, meaning.
_BETWEEN = (
    *(("x", "m", "Deflection"), ("v", "m/s", "Its rate")),
    *(("e", "m", "Mean displacement of both ends less that of the belt"), ("ve", "m/s", "Its rate")),
    *(("S", "N", "Force of the springs"), ("B", "N", "Force of the same springs by e")),
    ("Q", "N", "Force on the belt"),
)


def write(
    source: ModelFile, path: Path, points: Points = (), specimen: str | None = None, belt: Specimen | None = None
) -> tuple[str, ...]:
    """Write the package, whose name is that of the file; returns notes."""
    systems, notes = systems_of(source, points, specimen, belt=belt, reserved=_RESERVED)
    (package,) = identifiers([path.stem], {*_RESERVED, *(one.name for one in systems)})
    lines = [
        "within ;",
        f"package {package}",
        f"  {_string(f'Force over deflection of models of {systems[0].source}')}",
        "  connector RealInput = input Real;",
        "  connector RealOutput = output Real;",
    ]
    for one in systems:
        lines += ["", *(f"  {line}" for line in _block(one))]
    write_text(path, "\n".join([*lines, f"end {package};"]) + "\n")
    return notes


def _block(system: System) -> Iterator[str]:
    """A spring and a damper parallel to branches and to pairs of branches; see `Realised`.

    With a belt, the block has both ends and the same springs twice: between them, and around the belt.
    """
    one = system.realised
    yield f"block {system.name}"
    yield f"  {_string(f'{system.about}. {system.placed.accuracy.text}')}"
    if system.belted:
        yield '  RealInput x1(unit="m") "Displacement of the contact towards the wheel";'
        yield '  RealInput v1(unit="m/s") "Its rate, der(x1)";'
        yield '  RealInput x2(unit="m") "Displacement of the wheel in the same direction";'
        yield '  RealInput v2(unit="m/s") "Its rate, der(x2)";'
        yield '  RealOutput F1(unit="N") "Force into the contact, positive in compression";'
        yield '  RealOutput F2(unit="N") "Force on the wheel, positive in compression";'
        yield f'  parameter Real mb(unit="kg")={system.belt.mass!r} "Mass of the belt";'
        yield f'  parameter Real r(unit="1")={abs(system.belt.share)!r} "Spring at the contact over that at the rim";'
    else:
        yield '  RealInput x(unit="m") "Deflection, positive in compression";'
        yield '  RealInput v(unit="m/s") "Rate of the deflection, der(x)";'
        yield '  RealOutput F(unit="N") "Force, positive in compression";'
    yield f'  parameter Real discrepancy(unit="1")={system.placed.accuracy.discrepancy!r} "Relative error of K*";'
    yield f'  parameter Real K0(unit="N/m")={one.rest!r} "Stiffness at zero frequency";'
    yield f'  parameter Real C(unit="N.s/m")={one.damper!r} "Damper";'
    yield from _parameter("k", "N/m", one.springs, "Stiffness of each branch")
    yield from _parameter("tau", "s", one.times, "Relaxation time of each branch")
    yield from _parameter("kr", "N/m", one.pair_springs.real, "Stiffness of each pair, real part")
    yield from _parameter("ki", "N/m", one.pair_springs.imag, "Stiffness of each pair, imaginary part")
    yield from _parameter("lr", "1/s", one.pair_rates.real, "Decay of each pair")
    yield from _parameter("li", "1/s", one.pair_rates.imag, "Angular frequency of each pair")
    ends = ("", "b") if system.belted else ("",)
    states = [state for end in ends for state in _states(one, end)]
    for name, size, what in states:
        yield f'  Real {name}[{size}](each unit="m") "{what}";'
    if system.belted:
        yield '  Real xb(unit="m") "Displacement of the belt";'
        yield '  Real vb(unit="m/s") "Its rate";'
        for name, unit, what in _BETWEEN:
            yield f'  Real {name}(unit="{unit}") "{what}";'
    if states or system.belted:
        yield "initial equation"
        yield from (f"  der({name}) = zeros({size});" for name, size, _ in states)
        yield from ("  der(xb) = 0;", "  der(vb) = 0;") * system.belted
    yield "equation"
    if not system.belted:
        yield from _springs(one, "x", "v", "", "F = ")
    else:
        yield from ("  x = x1 - x2;", "  v = v1 - v2;")
        yield from ("  e = (r*x1 + x2)/(1 + r) - xb;", "  ve = (r*v1 + v2)/(1 + r) - vb;")
        yield from _springs(one, "x", "v", "", "S = ")
        yield from _springs(one, "e", "ve", "b", "B = ")
        yield "  Q = (1 + r)*(1 + r)/r*B;"
        yield from ("  der(xb) = vb;", "  der(vb) = Q/mb;", "  F1 = S + r/(1 + r)*Q;", "  F2 = S - Q/(1 + r);")
    yield f"end {system.name};"


def _states(one: Realised, end: str) -> list[tuple[str, int, str]]:
    """Name, size and meaning of the states of one set of springs."""
    count, pairs = one.springs.size, one.pair_springs.size
    states = [(f"z{end}", count, "Branches")] * bool(count)
    both = [(f"zr{end}", pairs, "Pairs, real part"), (f"zi{end}", pairs, "Pairs, imaginary part")]
    return states + both * bool(pairs)


def _springs(one: Realised, x: str, v: str, end: str, left: str) -> Iterator[str]:
    """The equations of one set of springs of this deflection and rate: its states, and its force."""
    count, pairs = one.springs.size, one.pair_springs.size
    z, zr, zi = f"z{end}", f"zr{end}", f"zi{end}"
    force = f"K0*{x} + C*{v}"
    if count:
        yield f"  der({z}) = (fill({x}, {count}) - {z})./tau;"
        force += f" + k*(fill({x}, {count}) - {z})"
    if pairs:
        yield f"  der({zr}) = lr.*(fill({x}, {pairs}) - {zr}) + li.*{zi};"
        yield f"  der({zi}) = li.*(fill({x}, {pairs}) - {zr}) - lr.*{zi};"
        force += f" + kr*(fill({x}, {pairs}) - {zr}) + ki*{zi}"
    yield f"  {left}{force};"


def _parameter(name: str, unit: str, values: FloatArray, what: str) -> Iterator[str]:
    """A parameter that is an array, unless it is empty."""
    numbers = [repr(float(one)) for one in np.asarray(values)]
    if not numbers:
        return
    lines = [", ".join(numbers[at : at + _IN_LINE]) for at in range(0, len(numbers), _IN_LINE)]
    yield f'  parameter Real {name}[{len(numbers)}](each unit="{unit}")={{'
    yield from (f"    {line}," for line in lines[:-1])
    yield f'    {lines[-1]}}} "{what}";'


def _string(text: str) -> str:
    """A text as a string of Modelica in one line."""
    plain = "".join(sign if sign.isprintable() else "?" for sign in " ".join(text.split()))
    escaped = plain.replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
