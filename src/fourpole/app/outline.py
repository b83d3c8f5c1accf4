"""Outlines of recordings in signs that a terminal has: braille dots, or plain ASCII where it has no others."""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

__all__ = ["draws_dots", "line", "picture"]

FloatArray = NDArray[np.float64]

_BRAILLE = 0x2800
#: Bits of a braille sign's dots, by row from the top and by column.
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
#: One sign for where the outline is, by its lowest and highest third.
_THIRDS = {(0, 0): "_", (0, 1): ",", (0, 2): "|", (1, 1): "-", (1, 2): "'", (2, 2): '"'}


def draws_dots() -> bool:
    """Whether what reads standard output can show braille."""
    try:
        chr(_BRAILLE + 1).encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def line(outline: FloatArray, width: int, *, dots: bool) -> str:
    """Least and greatest value (places, 2) along a recording in one line of signs."""
    if dots:
        return picture(outline, width, 1, dots=True)[0]
    levels = _levels(_gathered(outline, width), 3)
    return "".join(" " if low < 0 else _THIRDS[int(low), int(high)] for low, high in levels).rstrip()


def picture(outline: FloatArray, width: int, height: int, *, dots: bool) -> list[str]:
    """The same in several lines, the greatest value at the top."""
    across, down = (2, 4) if dots else (1, 1)
    levels = _levels(_gathered(outline, width * across), height * down)
    grid = np.zeros((height * down, width * across), dtype=bool)
    for column, (low, high) in enumerate(levels):
        if low >= 0:
            grid[height * down - 1 - high : height * down - low, column] = True
    if not dots:
        return ["".join("#" if dot else " " for dot in row).rstrip() for row in grid]
    bits = np.zeros((height, width), dtype=int)
    for row, signs in enumerate(_DOTS):
        for column, bit in enumerate(signs):
            bits |= bit * grid[row::4, column::2]
    # a blank of braille is as wide as its other signs where a space may not be
    return ["".join(chr(_BRAILLE + one) for one in row) for row in bits]


def _gathered(outline: FloatArray, places: int) -> FloatArray:
    """The outline at so many places; of a short one, its values repeated."""
    edges = np.arange(places) * len(outline) // places
    if len(outline) < places:
        return outline[edges]
    return np.stack(
        [np.fmin.reduceat(outline[:, 0], edges), np.fmax.reduceat(outline[:, 1], edges)],
        axis=1,
    )


def _levels(outline: FloatArray, levels: int) -> NDArray[np.int64]:
    """Lowest and highest level (places, 2) of each place; -1 where nothing is."""
    known = np.isfinite(outline)
    if not known.any():
        return np.full(outline.shape, -1)
    bottom, top = outline[known].min(), outline[known].max()
    span = top - bottom
    share = (outline - bottom) / span if np.isfinite(span) and span > 0 else np.where(known, 0.5, np.nan)
    found = np.minimum(np.floor(np.where(known, share, 0.0) * levels), levels - 1).astype(np.int64)
    return np.where(known, found, -1)
