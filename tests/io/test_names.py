"""Channels by their names: which comparison decides, and the messages if a name is missing or ambiguous."""

from __future__ import annotations

import pytest

from fourpole.errors import TableError
from fourpole.io.layout import find_column
from fourpole.io.names import named, only

PLACES = [("run1", "F1 [N]"), ("run1", "f1"), ("run2", "Weg [mm]"), ("run2", "V1"), ("run1", "V1")]


@pytest.mark.parametrize(
    ("wanted", "found"),
    [
        ("f1", [1]),
        ("F1", [0]),
        ("F1 [N]", [0]),
        ("run1/V1", [4]),
        ("RUN2/v1", [3]),
        ("v1", [3, 4]),
        ("WEG", [2]),
        ("weg [m]", [2]),
        ("x", []),
    ],
)
def test_the_first_comparison_that_finds_a_channel_decides(wanted: str, found: list[int]) -> None:
    assert named(PLACES, range(len(PLACES)), wanted) == found


def test_a_column_of_a_table_is_found_as_a_channel_is() -> None:
    columns = [name for group, name in PLACES if group == "run1"]
    assert [find_column(columns, one, "a.csv") for one in ("f1", "F1", "v1")] == [1, 0, 2]


def test_a_channel_of_two_groups_needs_its_group() -> None:
    with pytest.raises(TableError, match=r"'V1' is in the groups 'run2', 'run1'; say which, as in a\.h5#run2"):
        only(PLACES, range(len(PLACES)), "V1", "a.h5")
