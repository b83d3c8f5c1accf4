"""Doubts of a guess go with the correction of their cell."""

from __future__ import annotations

import pytest

from fourpole.campaign.row import columns_in_doubt, doubts_cell, still_open

CELL = doubts_cell([("", "", "no such column"), ("tyre", "A [2]", "or B | C?"), ("preload", "", "not known")])


@pytest.mark.parametrize(
    ("cells", "columns"),
    [
        ({"tyre": "A [2]", "preload": ""}, ("other", "tyre", "preload")),
        ({"tyre": "A", "preload": ""}, ("other", "preload")),
        ({"tyre": "A [2]", "preload": "1000"}, ("other", "tyre")),
        ({}, ("other", "tyre", "preload")),
    ],
)
def test_a_doubt_goes_when_its_cell_is_another(cells, columns):
    assert columns_in_doubt(still_open(CELL, cells)) == columns


def test_a_cell_of_doubts_is_bounded():
    cell = doubts_cell([("tyre", "A", "x" * 1000)] * 9)
    assert len(cell) < 1500
    assert columns_in_doubt(cell) == ("tyre",)
    assert columns_in_doubt("") == ()
