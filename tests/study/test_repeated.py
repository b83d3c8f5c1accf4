"""Tables compared cell by cell: what counts as the same, and what is said of the rest."""

import polars as pl
import pytest

from fourpole.study.repeated import OF_ITSELF, OF_UNCERTAINTY, differences, on_limit

K2, U = "K2 [N/m]", "u(K2) [N/m]"
TABLE = pl.DataFrame(
    {"test": ["D1", "D2"], K2: [120e3, 130e3], U: [50.0, 60.0], "remarks": ["", "K'' = 3.21 kN/m is low"]}
)
KEY = ("test", "point")


def changed(column, value, row=1):
    cells = TABLE[column].to_list()
    cells[row] = value
    return TABLE.with_columns(pl.Series(column, cells))


@pytest.mark.parametrize(
    ("column", "value"),
    [
        (K2, 130e3 + 0.99 * OF_UNCERTAINTY * 60.0),
        (U, 60.0 * (1 + 0.99 * OF_ITSELF)),
        ("remarks", "K'' = 3.22 kN/m is low"),
    ],
)
def test_round_off_does_not_count(column, value):
    assert differences(TABLE, changed(column, value), KEY) == []


@pytest.mark.parametrize(
    ("column", "value"),
    [
        (K2, 130e3 + 1.01 * OF_UNCERTAINTY * 60.0),
        (U, 60.0 * (1 + 1.01 * OF_ITSELF)),
        (K2, None),
        ("remarks", "K'' = 3.24 kN/m is low"),
        ("remarks", "K'' = 3.21 kN/m is high"),
        ("remarks", ""),
    ],
)
def test_more_than_that_is_named_with_its_row_and_column(column, value):
    (found,) = differences(TABLE, changed(column, value), KEY)
    assert (found.column, found.row, found.count) == (column, "D2", 1)
    assert found.share > 1


def test_the_largest_of_several_differences_is_the_one_that_is_named():
    (found,) = differences(TABLE, TABLE.with_columns(pl.col(K2) + pl.Series([1.0, 3.0])), KEY)
    assert (found.row, found.count, found.size) == ("D2", 2, pytest.approx(3.0))


def test_rows_and_columns_that_only_one_table_has():
    assert [(one.row, one.now) for one in differences(TABLE, TABLE[:1], KEY)] == [("D2", "no such row")]
    assert [(one.row, one.was) for one in differences(TABLE[:1], TABLE, KEY)] == [("D2", "no such row")]
    assert [one.column for one in differences(TABLE, TABLE.drop(U), KEY)] == [U]


def test_a_text_in_place_of_a_number_is_one_cell_that_differs():
    texts = TABLE.with_columns(pl.col(K2).cast(pl.String))
    (found,) = differences(texts.with_columns(pl.Series(K2, ["120000.0", "abc"])), texts, KEY)
    assert (found.row, found.was) == ("D2", "abc")


def test_order_does_not_matter_where_rows_have_names_and_does_where_they_have_none():
    assert differences(TABLE, TABLE.reverse(), KEY) == []
    assert differences(TABLE, TABLE.reverse(), ()) != []


def test_lists_are_compared_by_their_largest_part_and_turned_parts_by_their_sum():
    lists = pl.DataFrame({"test": ["D1"], "V1": [[1.0, 2.0, float("nan")]]})
    other = pl.DataFrame({"test": ["D1"], "V1": [[1.0, 2.0 + 1e-3, float("nan")]]})
    assert differences(lists, lists, KEY) == []
    assert [one.column for one in differences(lists, other, KEY)] == ["V1"]
    head = "shared Re K* [N/m]"
    parts, turned, less = (
        pl.DataFrame({"test": ["D1"], head: [cells]}) for cells in ([3.0, 4.0], [-5.0, 0.0], [5.1, 0.0])
    )
    assert differences(parts, turned, KEY) == []
    assert len(differences(parts, less, KEY)) == 1


def test_texts_of_a_test_on_the_limit_of_a_check_may_differ():
    """Round-off decides there; a number that differs counts as elsewhere."""
    checks = pl.DataFrame(
        {"test": ["D1", "D2", "D3"], "statistic": [0.03 + 2e-8, 0.03 + 4e-8, 0.0], "limit": [0.03] * 2 + [0.0]}
    )
    assert on_limit(checks) == {"D1"}
    was, now = (
        pl.DataFrame({"test": ["D1", "D2"], "verdict": [one, "ok"], "C": [1.0, 2.0]}) for one in ("ok", "warning")
    )
    assert differences(was, now, ["test"], {"D1"}) == []
    assert len(differences(was, now, ["test"], {"D2"})) == 1
    assert len(differences(was, now.with_columns(C=pl.col("C") * 1.01), ["test"], {"D1", "D2"})) == 1
