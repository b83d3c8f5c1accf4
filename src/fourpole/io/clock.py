"""Times of day, with or without a date, as seconds from the first of them."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import polars as pl

__all__ = ["is_date", "is_moment", "seconds"]

_DAY = 86_400
_TIME = (
    r"(?P<H>[0-9]{1,2}):(?P<M>[0-9]{2}):(?P<S>[0-9]{2})(?:[.,:](?P<f>[0-9]{1,12}))?"
    r"(?: ?(?P<half>[AaPp][Mm]))?(?: ?(?P<zone>[Zz]|[+-][0-9]{2}:?[0-9]{2}))?"
)
_DATES = (
    r"(?P<y>[0-9]{4})[-/.](?P<m>[0-9]{1,2})[-/.](?P<d>[0-9]{1,2})",
    r"(?P<d>[0-9]{1,2})\.(?P<m>[0-9]{1,2})\.(?P<y>[0-9]{4}|[0-9]{2})",
    r"(?P<d>[0-9]{1,2})/(?P<m>[0-9]{1,2})/(?P<y>[0-9]{4})",
    r"(?P<m>[0-9]{1,2})/(?P<d>[0-9]{1,2})/(?P<y>[0-9]{4})",
)
# Both `re` and polars read these patterns, so that what is known as a moment can be read as one.
_MOMENTS = tuple(rf"^\s*(?:{date}[T ] *)?{_TIME}\s*$" for date in _DATES)
_KNOWN = tuple(re.compile(pattern) for pattern in _MOMENTS)
_DATE_ALONE = tuple(re.compile(rf"\s*{date}\s*") for date in _DATES)
_MONTH_DAYS = np.array([0, 31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31])
_BEFORE_MONTH = np.concatenate(([0, 0], np.cumsum(_MONTH_DAYS[1:])))


def is_moment(cell: str) -> bool:
    """Whether a cell holds a time of day, to the second at least, with or without a date."""
    return ":" in cell and any(pattern.match(cell) for pattern in _KNOWN)


def is_date(cell: str) -> bool:
    """Whether a cell holds a date alone."""
    return any(pattern.fullmatch(cell) for pattern in _DATE_ALONE)


def seconds(cells: pl.Series) -> NDArray[np.float64]:
    """Seconds from the first moment of a column of text; NaN where a cell holds none.

    A day may come before its month or, between slashes, after it. Times without a date go on after midnight.
    """
    first = next((cell for cell in cells if cell is not None and is_moment(cell)), "")
    fitting = [pattern for pattern, known in zip(_MOMENTS, _KNOWN, strict=True) if known.match(first)]
    if not fitting:
        return np.full(len(cells), np.nan)
    if "/" not in first:
        return _read(cells, fitting[0])
    # 01/02/2024 is in January or February: what reads more of the cells is right, else the shorter recording.
    return max((_read(cells, pattern) for pattern in fitting), key=_likely)


def _likely(values: NDArray[np.float64]) -> tuple[int, float]:
    known = values[np.isfinite(values)]
    return len(known), -float(np.ptp(known)) if len(known) else 0.0


def _read(cells: pl.Series, pattern: str) -> NDArray[np.float64]:
    """Seconds from the first cell that fits the pattern."""
    import polars as pl

    parts = cells.str.extract_groups(pattern).struct.unnest()

    def part(name: str, missing: float) -> NDArray[np.float64]:
        column = parts[name].replace("", None) if name in parts.columns else None
        return np.full(len(cells), missing) if column is None else column.cast(pl.Float64).fill_null(missing).to_numpy()

    hour, minute, second = part("H", np.nan), part("M", np.nan), part("S", np.nan)
    year, month, day = part("y", 0.0), part("m", 1.0), part("d", 1.0)
    fraction = ("0." + parts["f"].fill_null("0")).cast(pl.Float64).to_numpy()
    half = parts["half"].str.to_lowercase()
    hour = hour + 12.0 * ((half == "pm").fill_null(False).to_numpy() & (hour < 12))
    hour = hour - 12.0 * ((half == "am").fill_null(False).to_numpy() & (hour == 12))
    zone = parts["zone"].str.replace(":", "").replace(["Z", "z", ""], ["+0000", "+0000", None])
    ahead = zone.str.slice(0, 3).cast(pl.Float64).fill_null(0.0).to_numpy() * 3600
    minutes_ahead = zone.str.slice(3).cast(pl.Float64).fill_null(0.0).to_numpy() * 60
    ahead = ahead + np.where((zone.str.starts_with("-")).fill_null(False).to_numpy(), -minutes_ahead, minutes_ahead)

    year = year + 2000 * ((parts["y"].str.len_bytes() == 2).fill_null(False).to_numpy())
    days, real = _days(year, month, day)
    real &= (hour < 24) & (minute < 60) & (second < 61)  # false where it is not a number
    if not real.any():
        return np.full(len(cells), np.nan)
    whole = days * _DAY + hour * 3600 + minute * 60 + second - ahead
    first = int(np.argmax(real))
    since = np.where(real, (whole - whole[first]) + (fraction - fraction[first]), np.nan)
    if parts["y"].null_count() == len(cells):
        _pass_midnight(since)
    return since


def _days(
    year: NDArray[np.float64], month: NDArray[np.float64], day: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Days in the calendar from a fixed one on, and whether there is such a day."""
    leap = (year % 4 == 0) & ((year % 100 != 0) | (year % 400 == 0))
    at = np.clip(month, 1, 12).astype(np.intp)
    real = (month >= 1) & (month <= 12) & (day >= 1) & (day <= _MONTH_DAYS[at] + (leap & (at == 2)))
    before = year - 1
    days = before * 365 + before // 4 - before // 100 + before // 400 + _BEFORE_MONTH[at] + (leap & (at > 2)) + day
    return days, real


def _pass_midnight(since: NDArray[np.float64]) -> None:
    """Add a day, in place, wherever a time of day falls back by more than half of one."""
    known = np.flatnonzero(np.isfinite(since))
    steps = np.diff(since[known])
    since[known[1:]] += _DAY * np.cumsum(steps < -_DAY / 2)
