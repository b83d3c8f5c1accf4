"""Outlines of recordings as text: braille dots, or ASCII signs for an output that cannot show braille."""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_BRAILLE = 0x2800
#: Bit of each dot of a braille sign, by row from the top and by column.
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
#: ASCII sign for an outline, by the lowest and the highest third of the line that it touches.
_THIRDS = {(0, 0): "_", (0, 1): ",", (0, 2): "|", (1, 1): "-", (1, 2): "'", (2, 2): '"'}


def draws_dots() -> bool:
    """Whether the encoding of standard output has braille signs."""
    try:
        chr(_BRAILLE + 1).encode(getattr(sys.stdout, "encoding", None) or "utf-8")
    except (UnicodeEncodeError, LookupError):
        return False
    return True


def line(outline: FloatArray, width: int, *, dots: bool) -> str:
    """One line of signs for the least and greatest values (places, 2) along a recording."""
    if dots:
        return picture(outline, width, 1, dots=True)[0]
    levels = _levels(_resampled(outline, width), 3)
    return "".join(" " if low < 0 else _THIRDS[int(low), int(high)] for low, high in levels).rstrip()


def picture(outline: FloatArray, width: int, height: int, *, dots: bool) -> list[str]:
    """Several lines of signs for an outline (places, 2), with the greatest value at the top."""
    across, down = (2, 4) if dots else (1, 1)
    levels = _levels(_resampled(outline, width * across), height * down)
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
    # A blank is the empty braille sign, because a space may have another width.
    return ["".join(chr(_BRAILLE + one) for one in row) for row in bits]


def _resampled(outline: FloatArray, places: int) -> FloatArray:
    """The outline (places, 2) at another number of places; values of a short outline are repeated."""
    edges = np.arange(places) * len(outline) // places
    if len(outline) < places:
        return outline[edges]
    return np.stack([np.fmin.reduceat(outline[:, 0], edges), np.fmax.reduceat(outline[:, 1], edges)], axis=1)


def _levels(outline: FloatArray, levels: int) -> NDArray[np.int64]:
    """Lowest and highest level (places, 2) of each place; -1 at a place without a value."""
    known = np.isfinite(outline)
    if not known.any():
        return np.full(outline.shape, -1)
    bottom, top = outline[known].min(), outline[known].max()
    span = top - bottom
    share = (outline - bottom) / span if np.isfinite(span) and span > 0 else np.where(known, 0.5, np.nan)
    found = np.minimum(np.floor(np.where(known, share, 0.0) * levels), levels - 1).astype(np.int64)
    return np.where(known, found, -1)
