"""Columns of words of no known kind that tell rows of one condition and frequency apart become part of the name."""

from __future__ import annotations

from collections.abc import Sequence

import polars as pl

from fourpole.core.condition import AMPLITUDE, FREQUENCY, Sameness
from fourpole.fitting.rows import conditions_in
from fourpole.units import shown
from fourpole.words import first_of
from fourpole.words.heads import head_and_unit


def by_labels(frame: pl.DataFrame, labels: Sequence[str], rule: Sameness) -> tuple[pl.DataFrame, list[str]]:
    """The table with the labels that tell equal rows apart in the names of its specimens, and remarks on them.

    Rows are equal if they have one condition, amplitude and frequency.

    Examples
    --------
    >>> frame = pl.DataFrame({"frequency [Hz]": [5.0, 5.0], "way": ["axial", "radial"]})
    >>> found, remarks = by_labels(frame, ["way"], Sameness())
    >>> found["tyre"].to_list()
    ['axial', 'radial']
    """
    remarks, comments = [], {head for head, kind in frame.schema.items() if kind == pl.String} - {"tyre", *labels}
    whole = Sameness((*rule.axes, *(axis for axis in (AMPLITUDE, FREQUENCY) if axis not in rule.axes)))
    for head in labels:
        words = _words(frame[head])
        equal = whole.groups(conditions_in(frame, whole)).tolist()
        if len({pair for pair in zip(equal, words, strict=True) if pair[1]}) == len(set(equal)):
            continue
        names = frame["tyre"].to_list() if "tyre" in frame.columns else [""] * len(words)
        both = [", ".join(filter(None, pair)) for pair in zip(names, words, strict=True)]
        frame = frame.with_columns(pl.Series("tyre", both))
        known = first_of([*dict.fromkeys(filter(None, words))], 4)
        remarks.append(f"column {shown(head)} tells rows of one condition and frequency apart: specimens {known}")
    equal = whole.groups(conditions_in(frame, whole)).tolist() if comments else []
    for head in sorted(comments):
        words = frame[head].fill_null("").to_list()
        if len({*zip(equal, words, strict=True)}) > len({*equal}):
            remarks.append(
                f"rows of one condition and frequency differ in column {shown(head)} "
                f"({first_of([*dict.fromkeys(filter(None, words))], 3)}): they count as repeats"
            )
    return frame, remarks


def _words(column: pl.Series) -> list[str]:
    """The cells of a column as labels; a number with its name and unit."""
    if column.dtype == pl.String:
        return column.fill_null("").to_list()
    name, unit = head_and_unit(column.name)
    return ["" if one is None or one != one else f"{name} {one:g} {unit or ''}".strip() for one in column.to_list()]
