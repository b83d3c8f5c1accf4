"""Times of day and dates as loggers write them."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.io.clock import Clock, is_date, is_moment

NAN = float("nan")


@pytest.mark.parametrize(
    ("cells", "expected"),
    [
        (["01.02.2024 10:00:00,000", "1.2.2024 10:00:00,5"], [0.0, 0.5]),
        (["2024-02-28T23:59:59.5Z", "2024-03-01T00:00:00,25+00:00"], [0.0, 86400.75]),
        (["2024-06-01T10:00:00+02:00", "2024-06-01T10:00:00+01:30"], [0.0, 1800.0]),
        (["2024/06/01 10:00:00", "2024/06/01 10:00:01"], [0.0, 1.0]),
        (["1.2.24 09:00:00", "1.2.24 09:00:02"], [0.0, 2.0]),
        (["23:59:59.9", "00:00:00.1", None, "00:00:01"], [0.0, 0.2, NAN, 1.1]),
        (["10:00:00:250", "10:00:00:500"], [0.0, 0.25]),
        (["1/31/2024 11:59:59 AM", "1/31/2024 12:00:00 PM"], [0.0, 1.0]),
        (["1/31/2024 11:59:59 pm", "2/1/2024 12:00:00 am"], [0.0, 1.0]),
        (["01/02/2024 23:59:59", "02/02/2024 00:00:00"], [0.0, 1.0]),
        (["01/31/2024 23:59:59", "02/01/2024 00:00:00"], [0.0, 1.0]),
        (["28.02.2023 23:59:59", "29.02.2023 00:00:00", "01.03.2023 00:00:00"], [0.0, NAN, 1.0]),
        (["29.02.2000 00:00:00", "29.02.1900 00:00:00"], [0.0, NAN]),
        (["1.2.2024 10:00:00", "1.2.2024 24:00:00", "1.2.2024 10:60:00"], [0.0, NAN, NAN]),
        (["0001-01-01 00:00:00", "9999-12-31 00:00:00"], [0.0, 3652058 * 86400.0]),
        ([None, "x"], [NAN, NAN]),
    ],
)
def test_seconds_from_the_first(cells: list[str | None], expected: list[float]) -> None:
    clock = Clock(day_first="/31/" not in (cells[0] or ""))
    np.testing.assert_allclose(clock.seconds(pl.Series(cells, dtype=pl.String)), expected, rtol=0, atol=1e-11)


@given(
    st.datetimes(min_value=datetime(1900, 1, 1), max_value=datetime(2100, 1, 1)),  # noqa: DTZ001 - files have no zone
    st.timedeltas(min_value=timedelta(0), max_value=timedelta(400)),
)
@pytest.mark.sampled(4)
def test_it_agrees_with_the_calendar(first: datetime, step: timedelta) -> None:
    for pattern in ("%Y-%m-%dT%H:%M:%S.%f", "%d.%m.%Y %H:%M:%S,%f"):
        cells = [one.strftime(pattern) for one in (first, first + step)]
        assert all(map(is_moment, cells))
        since = Clock(day_first=True).seconds(pl.Series(cells))[1]
        np.testing.assert_allclose(since, step.total_seconds(), rtol=1e-15, atol=1e-11)


@pytest.mark.parametrize("cell", ["10", "1.5", "10:00", "a 10:00:00", "10:00:00 x", "2024-01-01", "1:2:3", "::", ""])
def test_what_is_no_moment(cell: str) -> None:
    assert not is_moment(cell)


def test_dates_alone() -> None:
    assert all(map(is_date, ("2024-01-31", "31.1.2024", "1/31/2024", " 31.01.24 ")))
    assert not any(map(is_date, ("1.5", "2024", "1-2-3", "2024-01-31 10:00:00")))
