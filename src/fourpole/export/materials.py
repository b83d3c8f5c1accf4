"""Prony series of a model file as materials of FE programs, by a template each, and as a table.

Abaqus and ANSYS take normalised moduli, of the instantaneous moduli, which the elastic cards state as well: from the
moduli at rest Abaqus would divide by 1 - sum g_i, which loses the digits of a long spectrum. LS-DYNA takes the modulus
or the stiffness of each arm itself, in fields of 20 columns, which the plus sign behind a keyword says: fields of 10
columns hold six digits. Its term with beta = 0 is the modulus at rest. The table has stiffness, its uncertainty and
interval, and moduli of each arm.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue
from fourpole.errors import ModelError
from fourpole.export.source import accuracy_columns, ascii_line, filled
from fourpole.fitting.accuracy import accuracy_of
from fourpole.fitting.modelfile import ConditionFile, ModelEntry, ModelFile, model_of
from fourpole.io.write import write_table, write_text
from fourpole.models.interface import Arms
from fourpole.models.shape import Shape

#: Arms whose stiffness is a smaller fraction than this of that of all springs are left out.
_IDLE = 1e-16
#: Longest name of a material, and longest line of a sentence, which with its mark is within 80 columns.
_LONGEST_NAME, _LONGEST_LINE = 60, 76


class Term(NamedTuple):
    """A term of a Prony series: the stiffness at rest, or that of an arm, and what follows from it.

    Attributes
    ----------
    time, rate : float or None [s], [1/s]
        Relaxation time and its inverse; at rest there is no time, and the rate is 0.
    stiffness : float [N/m]
    share : float or None [1]
        Normalised modulus g: the stiffness over that of a sudden deflection; None at rest.
    young, shear, bulk : float or None [Pa]
        Moduli; None without a shape, or if Poisson's ratio, which they need, is not stated.
    """

    time: float | None
    rate: float | None
    stiffness: float
    share: float | None
    young: float | None
    shear: float | None
    bulk: float | None


def terms_of(arms: Arms, shape: Shape | None) -> list[Term]:
    """The term at rest, and that of each arm, in the order of the arms."""
    moduli = [_modulus(shape, name) for name in ("young", "shear", "bulk_modulus")]
    terms = []
    for time, stiffness in [(None, arms.rest), *zip(arms.times.tolist(), arms.springs.tolist(), strict=True)]:
        share = None if time is None else stiffness / arms.instantaneous
        rate = 0.0 if time is None else 1.0 / time if time else None
        terms.append(Term(time, rate, stiffness, share, *(one and one * stiffness for one in moduli)))
    return terms


def _modulus(shape: Shape | None, name: str) -> float | None:
    """A modulus over the stiffness [1/m]; None if it is not known."""
    try:
        return None if shape is None else float(getattr(shape, name))
    except ModelError:  # Poisson's ratio is not stated
        return None


@dataclass(frozen=True, eq=False)
class Material(ByValue):
    """The Prony series of one specimen at one condition.

    Attributes
    ----------
    name : str
        Name of letters, digits and underscores that no other material of the file has.
    about : tuple of str
        Specimen, condition, band, accuracy and stiffness in lines of ASCII.
    arms : Arms
        Arms with a stiffness above zero, in falling order of the relaxation time.
    shape : Shape or None
        Shape of the specimen, if it is stated.
    temperature : float or None [degC]
    """

    name: str
    about: tuple[str, ...]
    arms: Arms
    shape: Shape | None
    temperature: float | None

    @property
    def terms(self) -> list[Term]:
        """The term at rest and those of the arms."""
        return terms_of(self.arms, self.shape)

    @property
    def elastic(self) -> tuple[float, float] | None:
        """Instantaneous Young's modulus [Pa] and Poisson's ratio, if both the shape and that ratio are stated."""
        if self.shape is None or self.shape.poisson is None:
            return None
        return self.shape.young * self.arms.instantaneous, self.shape.poisson

    @property
    def relaxing_bulk(self) -> bool:
        """Whether the bulk modulus relaxes as the others do."""
        return self.shape is not None and self.shape.relaxing_bulk


def materials_of(file: ModelFile, shape: Shape | None = None) -> tuple[list[Material], tuple[str, ...]]:
    """The materials of a model file, and notes on models that are no Prony series and on missing shapes.

    `shape` replaces the shapes that the file states.

    Raises
    ------
    ModelError
        If no model of the file is a Prony series.
    """
    found: list[Material] = []
    notes: list[str] = []
    refused: list[str] = []
    for entry in file.models:
        model = model_of(entry)
        for at, one in enumerate(entry.conditions):
            try:
                arms = _used(model.prony(one.values))
            except ModelError as error:
                refused.append(str(error))
                continue
            name = _name(entry, at, [each.name for each in found])
            found.append(_material(file, entry, one, name, arms, shape or entry.shape))
    if not found:
        raise ModelError(f"{refused[0]}: fourpole fit RESULTS --model prony" if refused else "the file has no model")
    notes += dict.fromkeys(f"left out: {one}" for one in refused)
    if any(one.arms.rest == 0 for one in found):
        notes.append("K_inf is 0: the material flows at rest, which not every program accepts")
    return found, tuple(notes)


def no_moduli(materials: Sequence[Material]) -> tuple[str, ...]:
    """A note that the moduli of some materials are not known, with the remedy."""
    lacking = [one for one in materials if one.elastic is None]
    if not lacking:
        return ()
    what = "Poisson's ratio" if all(one.shape is not None for one in lacking) else "height, area, mode and poisson"
    note = (
        f"no elastic moduli for {len(lacking)} of {len(materials)} materials: state {what} of the specimen, in "
        "[specimens.NAME] of campaign.toml before fourpole analyse and fit, or as options of fourpole export"
    )
    return (note,)


def check_terms(materials: Sequence[Material], most: int, what: str) -> None:
    """ModelError if a material has more arms than a program takes."""
    for one in materials:
        count = one.arms.springs.size
        if count > most:
            decades = np.log10(one.arms.times.max() / one.arms.times.min())
            fewer = max(int((most - 1) / max(decades, 1e-9)), 0)
            how = f"fit --model prony:{fewer}" if fewer else f"fit --model maxwell:{most}, or a narrower --band"
            raise ModelError(f"{one.name}: {count} arms are more than the {most} that {what} takes: {how}")


def numbers(*values: float, digits: int = 15, between: str = ", ") -> str:
    """Numbers with so many significant digits; with 15 each has 20 characters, the most that Abaqus reads."""
    return between.join(f"{value:.{digits - 1}e}" for value in values)


def _used(arms: Arms) -> Arms:
    """The arms with a stiffness above zero and a relaxation time, the slowest first."""
    kept = (arms.springs > _IDLE * arms.instantaneous) & (arms.times > 0)
    if not kept.any():
        raise ModelError("the model has no arm with a stiffness above zero: it is elastic")
    order = np.argsort(-arms.times[kept], kind="stable")
    return Arms(arms.rest, arms.springs[kept][order], arms.times[kept][order])


def _material(
    file: ModelFile, entry: ModelEntry, one: ConditionFile, name: str, arms: Arms, shape: Shape | None
) -> Material:
    state = {each.column: each.value for each in one.state}
    place = ", ".join(f"{each.name} {each.value:.6g} {each.unit}" for each in one.state)
    where = f"{entry.tyre or 'specimen'}{f' at {place}' if place else ''}, {one.band[0]:.6g} to {one.band[1]:.6g} Hz"
    about = [f"{where}; model {entry.model} of {file.provenance.source}, by fourpole {file.provenance.fourpole}"]
    for text in accuracy_of(entry, one).sentences:
        about += textwrap.wrap(ascii_line(text), _LONGEST_LINE)
    sudden, rest = numbers(arms.instantaneous), numbers(arms.rest)
    about.append(f"stiffness: K_0 = {sudden} N/m (instantaneous), K_inf = {rest} N/m (at rest)")
    about += [] if shape is None else [_about_shape(shape)]
    return Material(name, tuple(map(ascii_line, about)), arms, shape, state.get(q.TEMPERATURE.head))


def _about_shape(shape: Shape) -> str:
    """The conversion from stiffness to modulus, with the sizes that were stated."""
    which = "E" if shape.mode == "compression" else "G"
    formula = f"{which} = K h/A"
    if shape.bonded:
        formula += f"/(1 + 2 k S^2), bonded disc, S = {shape.factor:.6g}, k = {shape.bonded_factor:g}"
    ratio = "not stated" if shape.poisson is None else f"{shape.poisson:g}"
    return f"{shape.mode}: {formula}, h = {shape.height:g} m, A = {shape.area:g} m^2, Poisson's ratio {ratio}"


def _name(entry: ModelEntry, at: int, taken: Sequence[str]) -> str:
    """A name of a material that is not taken yet."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", ascii_line(entry.tyre)).strip("_")[:_LONGEST_NAME] or "SPECIMEN"
    plain = (plain if plain[0].isalpha() else f"M_{plain}").upper()
    base = plain if len(entry.conditions) == 1 else f"{plain}_{at + 1}"
    return next(name for name in (base, *(f"{base}_{one}" for one in range(2, 10_000))) if name not in taken)


#: Largest number of pairs of ANSYS TB,PRONY since release 10.
_MOST_PAIRS = 100
#: Largest number of terms of *MAT_GENERAL_VISCOELASTIC (076); one of them is the modulus at rest.
_MOST_TERMS = 18
#: Columns of a field of LS-DYNA, and significant digits of a number, which leave a blank in front of it.
_WIDTH, _DIGITS = 20, 14


def write_abaqus(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a material with `*VISCOELASTIC, TIME=PRONY` per condition; returns notes on what is left out."""
    materials, notes = materials_of(source, shape)
    _write("abaqus.inp", path, materials)
    return (*notes, *no_moduli(materials))


def write_ansys(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a material with `TB,PRONY` per condition, numbered from 1; returns notes on what is left out."""
    materials, notes = materials_of(source, shape)
    check_terms(materials, _MOST_PAIRS, "TB,PRONY")
    _write("ansys.mac", path, materials)
    return (*notes, *no_moduli(materials))


def write_lsdyna(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a `*MAT_GENERAL_VISCOELASTIC` per condition, numbered from 1; returns notes on what is left out.

    Raises
    ------
    ModelError
        If the shape of the specimen is not stated, or there are more than 17 arms.
    """
    materials, notes = materials_of(source, shape)
    if lacking := no_moduli(materials):
        raise ModelError(f"{lacking[0]}; --to lsdyna-springs needs no shape")
    check_terms(materials, _MOST_TERMS - 1, "*MAT_GENERAL_VISCOELASTIC, beside the modulus at rest,")
    _write("lsdyna.k", path, materials)
    return (*notes, "the density is not known to Fourpole: set RO of each *MAT_GENERAL_VISCOELASTIC")


def write_springs(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write springs and dampers of the stiffness itself as discrete elements, to be set parallel; returns notes."""
    materials, notes = materials_of(source, shape)
    _write("springs.k", path, materials)
    return notes


def _write(template: str, path: Path, materials: Sequence[Material]) -> None:
    write_text(path, filled(template, materials=materials, numbers=numbers, card=_card))


def _card(*values: float) -> str:
    """A line of right-aligned fields; a whole number of the type int is written as such."""
    texts = (str(value) if isinstance(value, int) else numbers(value, digits=_DIGITS) for value in values)
    return "".join(text.rjust(_WIDTH) for text in texts)


#: Columns of a `Term`.
_HEADS = ("tau [s]", "beta [1/s]", "K [N/m]", "g [1]", "E [Pa]", "G [Pa]", "bulk modulus [Pa]")


def write_prony(source: ModelFile, path: Path, shape: Shape | None = None) -> tuple[str, ...]:
    """Write a row for K_inf and for each arm of each condition, arms at zero included; returns notes."""
    _, notes = materials_of(source, shape)
    rows = [row for entry in source.models for one in entry.conditions for row in _rows(entry, one, shape)]
    write_table(path, pl.DataFrame(rows, infer_schema_length=None))
    return notes


def _rows(entry: ModelEntry, one: ConditionFile, shape: Shape | None) -> list[dict[str, Any]]:
    """The rows of one condition; none if its model is no Prony series."""
    model = model_of(entry)
    try:
        terms = terms_of(model.prony(one.values), shape := shape or entry.shape)
    except ModelError:
        return []
    state = {each.column: each.value for each in one.state}
    heads = _HEADS[: 4 if shape is None else 7 if shape.relaxing_bulk else 6]
    accuracy = accuracy_columns(accuracy_of(entry, one))
    return [
        {"specimen": entry.tyre, **state, "arm": at, **_uncertain(one, model.symbols, at)}
        | dict(zip(heads, term, strict=False))
        | accuracy
        for at, term in enumerate(terms)
    ]


def _uncertain(one: ConditionFile, symbols: list[str], at: int) -> dict[str, float | None]:
    """Standard uncertainty and 95 % interval [N/m] of K_inf or of an arm; blank if the model has another parameter."""
    symbol = f"K_{at}" if at else "K_inf"
    if symbol not in symbols:
        return {"u(K) [N/m]": None, "95 % from [N/m]": None, "95 % to [N/m]": None}
    place = symbols.index(symbol)
    low, high = one.intervals[place]
    std = float(np.sqrt(max(one.covariance[place][place], 0.0)))
    return {"u(K) [N/m]": std, "95 % from [N/m]": low, "95 % to [N/m]": high}
