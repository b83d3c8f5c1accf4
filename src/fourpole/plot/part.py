"""Some tests of the results, as a reader selects them for a figure; colours, markers and cards stay those of all."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches

import numpy as np
import polars as pl

from fourpole import quantities as q
from fourpole.core.arrays import ByValue, IntArray
from fourpole.core.condition import AXES, PRELOAD, PRESSURE, Axis
from fourpole.errors import CampaignError
from fourpole.fitting.modelfile import ModelFile
from fourpole.plot.data import counted, plain_text
from fourpole.quantities import ShownUnits
from fourpole.study.study import Study

_KEY = "part"
_TEMPERATURE = next(axis for axis in AXES if axis.column == q.TEMPERATURE.head)
#: Number of tested values that an error names.
_NAMED = 8


@dataclass(frozen=True)
class Selection:
    """The tests to show, each field a choice of which one must hold; an empty field chooses all.

    Attributes
    ----------
    specimens, tests : tuples of str
    pressures, preloads, temperatures : tuples of float [Pa], [N], [°C]
        Values that are the same within the tolerances of the conditions.
    labels : mapping of str to str
        Text in place of the name of a specimen.
    colours : mapping of str to str
        Colour of a specimen, as #rrggbb.
    """

    specimens: tuple[str, ...] = ()
    tests: tuple[str, ...] = ()
    pressures: tuple[float, ...] = ()
    preloads: tuple[float, ...] = ()
    temperatures: tuple[float, ...] = ()
    labels: Mapping[str, str] = field(default_factory=dict)
    colours: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Part(ByValue):
    """The rows of the whole results' dynamic.csv and static.csv that were selected, and how they are shown."""

    whole: Study
    rows: IntArray
    static_rows: IntArray
    selection: Selection


def part_of(results: Study) -> Part | None:
    """What was selected of these results; None if they are whole."""
    found: Part | None = results.derived.get(_KEY)
    return found


def select(results: Study, selection: Selection) -> Study:
    """The results with some of their tests.

    Parameters
    ----------
    results : Study
        Whole results.
    selection : Selection

    Returns
    -------
    Study
        Their tables, and models without conditions of other tests. Numbers of specimens and ids of cards are those of
        the whole results, so that a figure of them has the same colours, markers and links.

    Raises
    ------
    CampaignError
        If nothing has a stated name or value, with the nearest that there are, or no test has all that is stated.
    """
    dynamic, static = (results.tables[name] for name in ("dynamic", "static"))
    specimens = list(dict.fromkeys([*_texts(static, "tyre"), *_texts(dynamic, "tyre")]))
    for name in (*selection.specimens, *selection.labels, *selection.colours):
        _check_name(name, specimens, "specimen")
    rows, statics = (_chosen(table, selection, results.shown) for table in (dynamic, static))
    found = bool(rows.any())
    if selection.tests:
        tests = [*_texts(dynamic, "test"), *_texts(static, "test")]
        for name in selection.tests:
            _check_name(name, list(dict.fromkeys(tests)), "test")
        named = [np.isin(_texts(table, "test"), selection.tests) for table in (dynamic, static)]
        rows = rows & named[0]
        # K1 of dynamic tests comes from static tests, which stay if none of them is named.
        found = bool(rows.any() or (statics & named[1]).any())
        statics = statics & named[1] if named[1].any() else statics
    if not found:
        raise CampaignError("no test has all that is stated; leave out one of the options, or see fourpole check")
    return _parted(results, Part(results, np.flatnonzero(rows), np.flatnonzero(statics), selection))


def parted_rows(results: Study, made: Study, rows: IntArray) -> None:
    """Note that `made` has some rows of the dynamic table of results that may be a part themselves."""
    part = part_of(results)
    if part is not None:
        made.derived[_KEY] = replace(part, rows=part.rows[rows])


def _parted(results: Study, part: Part) -> Study:
    """The tables, models and rows of a part."""
    tables = dict(results.tables)
    tables["dynamic"], tables["static"] = results.dynamic[part.rows], results.static[part.static_rows]
    kept = [*_texts(tables["dynamic"], "test"), *_texts(tables["static"], "test")]
    for name, table in tables.items():
        if name not in ("dynamic", "static") and "test" in table.columns:
            tables[name] = table.filter(pl.col("test").is_in(kept))
    specimens = {*_texts(tables["dynamic"], "tyre"), *_texts(tables["static"], "tyre")}
    models, maps = _models(results.models, set(kept)), results.maps
    if maps is not None:
        maps = maps.model_copy(update={"maps": [one for one in maps.maps if _base(one.tyre, specimens) is not None]})
    made = replace(results, tables=tables, models=models, maps=maps)
    made.derived[_KEY] = part
    return made


def _models(file: ModelFile | None, tests: set[str]) -> ModelFile | None:
    """The models without the conditions of other tests."""
    if file is None:
        return None
    entries = []
    for entry in file.models:
        kept = [one for one in entry.conditions if not one.tests or tests & set(one.tests)]
        if kept:
            entries.append(entry.model_copy(update={"conditions": kept}))
    return file.model_copy(update={"models": entries})


def _texts(table: pl.DataFrame, column: str) -> list[str]:
    return [text or "" for text in table[column].to_list()] if column in table.columns else [""] * table.height


def _check_name(name: str, known: Sequence[str], what: str) -> None:
    if name in known:
        return
    near = get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f"did you mean {plain_text(near[0])!r}?" if near else f"choose of {_listed(known)}"
    raise CampaignError(f"no {what} {plain_text(name)!r}: {hint}")


def _listed(names: Sequence[str]) -> str:
    shown = ", ".join(plain_text(name) for name in names[:_NAMED])
    return f"{shown}, … ({len(names)} in all)" if len(names) > _NAMED else shown or "none"


def _chosen(table: pl.DataFrame, selection: Selection, units: ShownUnits) -> np.ndarray:
    """True for rows of a wanted specimen with one of the wanted values on each axis.

    A static test needs none of preload and temperature.
    """
    mask = np.array([not selection.specimens or name in selection.specimens for name in _texts(table, "tyre")], bool)
    dynamic = q.FREQUENCY.head in table.columns
    for axis, wanted in (
        (PRESSURE, selection.pressures),
        (PRELOAD, selection.preloads),
        (_TEMPERATURE, selection.temperatures),
    ):
        if wanted and (dynamic or axis is PRESSURE):
            mask &= _same(table, axis, wanted, units, must=dynamic)
    return mask


def _same(table: pl.DataFrame, axis: Axis, wanted: Sequence[float], units: ShownUnits, *, must: bool) -> np.ndarray:
    """True for rows with one of these values; with `must`, each of them has to be there."""
    known = axis.column in table.columns
    values = table[axis.column].cast(pl.Float64, strict=False).to_list() if known else [None] * table.height
    masks = [np.array([axis.same(own, one) for own in values], dtype=bool) for one in wanted]
    for one, mask in zip(wanted, masks, strict=True):
        if must and not mask.any():
            raise CampaignError(_no_value(axis, one, sorted({own for own in values if own is not None}), units))
    return np.asarray(np.any(masks, axis=0)).reshape(-1)


def _no_value(axis: Axis, wanted: float, tested: Sequence[float], units: ShownUnits) -> str:
    def text(value: float) -> str:
        return units.setting(axis.column, value)

    if not tested:
        return f"no test at {text(wanted)}: the tests state no {axis.name}"
    _, middles = axis.middles(np.array(tested))
    near = min(middles, key=lambda value: abs(value - wanted))
    tests = f"{counted(len(middles), axis.name)} from {text(middles[0])} to {text(middles[-1])}"
    return f"no test at {text(wanted)}: did you mean {text(near)}? There are tests at {tests}"


def shown_name(part: Part, name: str, usual: str) -> str:
    """The text of a specimen: the reader's, or else the usual one."""
    labels = part.selection.labels
    base = _base(name, labels)
    return usual if base is None else f"{labels[base]}{name[len(base) :]}"


def own_colours(part: Part, names: Sequence[str]) -> dict[int, str]:
    """The reader's colours of specimens by number."""
    colours = part.selection.colours
    return {at: colours[base] for at, name in enumerate(names) if (base := _base(name, colours)) is not None}


def _base(name: str, known: Iterable[str]) -> str | None:
    """The specimen whose name this is, also at one of several temperatures; None if it is not known."""
    found = [one for one in known if name == one or name.startswith((f"{one} at ", f"{one}, "))]
    return max(found, key=len, default=None)
