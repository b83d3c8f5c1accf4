"""LS-DYNA keyword input: `*MAT_GENERAL_VISCOELASTIC` for solids, or springs and dampers of the stiffness itself.

A field has 20 columns, which the plus sign behind a keyword says: fields of 10 columns hold six digits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from fourpole.errors import ModelError
from fourpole.export.materials import Material, check_terms, materials_of, no_moduli, number
from fourpole.fitting.modelfile import ModelFile
from fourpole.io.write import write_text
from fourpole.models.shape import Shape

#: Largest number of terms of *MAT_GENERAL_VISCOELASTIC (076); one of them is the modulus at rest.
_MOST_TERMS = 18
#: Columns of a field, and significant digits of a number, which leave a blank in front of it.
_WIDTH, _DIGITS = 20, 14
#: Cut-off time of *MAT_SPRING_MAXWELL that is never reached [s].
_NEVER = 1e20


def write(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a solid material per condition, numbered from 1; returns notes on what is left out.

    Raises
    ------
    ModelError
        If the shape of the specimen is not stated, or there are more than 17 arms.
    """
    materials, notes = materials_of(source, shape)
    if lacking := no_moduli(materials):
        raise ModelError(f"{lacking[0]}; --to lsdyna-springs needs no shape")
    check_terms(materials, _MOST_TERMS - 1, "*MAT_GENERAL_VISCOELASTIC, beside the modulus at rest,")
    _write(path, [line for at, one in enumerate(materials, start=1) for line in _solid(at, one)])
    return (*notes, "the density is not known to Fourpole: set RO of each *MAT_GENERAL_VISCOELASTIC")


def write_springs(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write springs of discrete elements, to be set parallel to each other; returns notes on what is left out."""
    materials, notes = materials_of(source, shape)
    lines: list[str] = []
    first = 1
    for one in materials:
        lines += _springs(first, one)
        first += one.arms.springs.size + 1
    _write(path, lines)
    return notes


def _write(path: Path, lines: Sequence[str]) -> None:
    head = [
        "*KEYWORD",
        "$ units: SI (m, kg, s, N, Pa); beta = 1/tau in 1/s; fields of 20 columns where a keyword ends in +",
    ]
    write_text(path, "\n".join([*head, *lines, "*END"]) + "\n")


def _solid(at: int, one: Material) -> Iterator[str]:
    """Cards of *MAT_GENERAL_VISCOELASTIC: head, no curves, then a term per line; beta = 0 is the modulus at rest."""
    assert one.shape is not None
    arms, shape = one.arms, one.shape
    yield from (f"$ {line}" for line in (f"material {at}: {one.name}", *one.about))
    yield "*MAT_GENERAL_VISCOELASTIC+"
    yield _comment("mid", "ro", "bulk", "pcf", "ef", "tref", "a", "b")
    yield _card(at, 0.0, shape.bulk_modulus * arms.instantaneous, 0.0, 0.0, 0.0, 0.0, 0.0)
    yield _comment("lcid", "nt", "bstart", "tramp", "lcidk", "ntk", "bstartk", "trampk")
    yield " " * (8 * _WIDTH)
    yield _comment("gi", "betai", "ki", "betaki")
    terms = [(arms.rest, 0.0), *zip(arms.springs.tolist(), (1.0 / arms.times).tolist(), strict=True)]
    for stiffness, rate in terms:
        bulk = (shape.bulk_modulus * stiffness, rate) if shape.relaxing_bulk else ()
        yield _card(shape.shear * stiffness, rate, *bulk)


def _springs(first: int, one: Material) -> Iterator[str]:
    """A spring for K_inf and a spring and damper in series for each arm, with consecutive numbers."""
    arms = one.arms
    last = first + arms.springs.size
    yield from (f"$ {line}" for line in (f"materials {first} to {last}, parallel: {one.name}", *one.about))
    yield "*MAT_SPRING_ELASTIC+"
    yield _comment("mid", "k")
    yield _card(first, arms.rest)
    for at, (stiffness, time) in enumerate(zip(arms.springs.tolist(), arms.times.tolist(), strict=True), start=1):
        yield "*MAT_SPRING_MAXWELL+"
        yield _comment("mid", "k0", "ki", "beta", "tc", "fc", "copt")
        yield _card(first + at, stiffness, 0.0, 1.0 / time, _NEVER, 0.0, 0.0)


def _card(*values: float) -> str:
    """A line of right-aligned fields; a whole number of the type int is written as such."""
    return "".join((str(one) if isinstance(one, int) else number(one, _DIGITS)).rjust(_WIDTH) for one in values)


def _comment(*names: str) -> str:
    """The names of the fields above a card."""
    return "$#" + "".join(names[0].rjust(_WIDTH - 2) if not at else name.rjust(_WIDTH) for at, name in enumerate(names))
