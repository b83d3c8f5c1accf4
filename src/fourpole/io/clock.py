"""Times of day, with or without a date, as seconds from the first time."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import polars as pl

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
# Both `re` and polars use these patterns: a cell that `re` accepts can also be read by polars.
_MOMENTS = tuple(rf"^\s*(?:{date}[T ] *)?{_TIME}\s*$" for date in _DATES)
_KNOWN = tuple(re.compile(pattern) for pattern in _MOMENTS)
_UNDATED = re.compile(r"\s*[0-9]{1,2}:")
_DATE_ALONE = tuple(re.compile(rf"\s*{date}\s*") for date in _DATES)


def is_moment(cell: str) -> bool:
    """Whether a cell holds a time of day, to the second at least, with or without a date."""
    return ":" in cell and any(pattern.match(cell) for pattern in _KNOWN)


def is_date(cell: str) -> bool:
    """Whether a cell holds a date alone."""
    return any(pattern.fullmatch(cell) for pattern in _DATE_ALONE)


class Clock:
    """A column of times of day as seconds from its first time, one part of the column after the other.

    In dates with slashes the day comes first if `day_first`, otherwise the month. Times without a date continue after
    midnight.
    """

    def __init__(self, *, day_first: bool) -> None:
        self._day_first = day_first
        self._zero: str | None = None
        self.state = (0.0, np.nan)
        """Number of midnights passed, and the last time of day [s] from the first time."""

    def seconds(self, cells: pl.Series) -> NDArray[np.float64]:
        """Seconds from the first time of the column; not-a-number if a cell has no time in the same notation."""
        import polars as pl

        if self._zero is None:
            self._zero = next((cell for cell in cells if cell is not None and is_moment(cell)), None)
            if self._zero is None:
                return np.full(len(cells), np.nan)
        undated = _UNDATED.match(self._zero) is not None
        cells = pl.Series([self._zero], dtype=pl.String).append(cells)
        if undated:
            cells = "2000-01-01 " + cells.str.strip_chars()
        fitting = [pattern for pattern, known in zip(_MOMENTS, _KNOWN, strict=True) if known.match(cells[0])]
        # Only dates with slashes fit two patterns: first that with the day before the month, then the reverse.
        since = _read(cells, fitting[0 if self._day_first else -1])[1:]
        known = np.flatnonzero(np.isfinite(since))
        if undated and len(known):
            days, last = self.state
            passed = days + np.cumsum(np.diff(since[known], prepend=last) < -_DAY / 2)
            self.state = float(passed[-1]), float(since[known[-1]])
            since[known] += _DAY * passed
        return since


def _read(cells: pl.Series, pattern: str) -> NDArray[np.float64]:
    """Seconds from the first cell that fits the pattern; not-a-number for cells that do not fit."""
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
    real &= (hour < 24) & (minute < 60) & (second < 61)  # False also for not-a-number
    if not real.any():
        return np.full(len(cells), np.nan)
    whole = days * _DAY + hour * 3600 + minute * 60 + second - ahead
    first = int(np.argmax(real))
    return np.where(real, (whole - whole[first]) + (fraction - fraction[first]), np.nan)


def _days(
    year: NDArray[np.float64], month: NDArray[np.float64], day: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Number of the day, counted from a fixed day, and whether the calendar has this day."""
    months = (12 * (year - 1970) + month - 1).astype("datetime64[M]")
    first, after = (edge.astype("datetime64[D]").astype(np.float64) for edge in (months, months + 1))
    real = (month >= 1) & (month <= 12) & (day >= 1) & (day <= after - first)
    return first + day, real
