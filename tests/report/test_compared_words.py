"""Two results compared, in words: digits by the uncertainty of the difference."""

import polars as pl
import pytest

from fourpole import quantities as q
from fourpole.findings.compared import Comparison
from fourpole.report.compared import shown_rows


@pytest.mark.parametrize(
    ("values", "u", "shown"),
    [
        ((12345.0, 13001.3), 165.0, ("12300", "13000", "+700±300")),
        ((700.44, 698.31), 0.31, ("700.4", "698.3", "−2.1±0.6")),
        ((700.0, 800.0), 0.012, ("700.000", "800.000", "+100.000±0.024")),
    ],
)
def test_values_and_difference_have_the_digits_of_u(values, u, shown):
    first, second = values
    row = {
        "specimen": "A", **dict.fromkeys((q.PRESSURE.head, q.TEMPERATURE.head)), q.PRELOAD.head: 1000.0,
        q.FREQUENCY.head: 14.004, "quantity": q.C.column, "first": first, "second": second,
        "difference": second - first, "u(difference)": u, "z [1]": (second - first) / u,
    }  # fmt: skip
    (one,) = shown_rows(Comparison(("a", "b"), pl.DataFrame([row]), ()))
    assert (one.first, one.second, one.difference) == shown
    assert (one.where, one.quantity, one.seen) == ("1000 N, 14 Hz", "C N s/m", True)
