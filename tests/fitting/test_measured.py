"""K* condition by condition: which tests are one condition, and the covariance that they share."""

import numpy as np
import polars as pl
import pytest

from fourpole.core.condition import AXES, Axis, Sameness
from fourpole.errors import ModelError, TableError
from fourpole.fitting.likelihood import COVARIANCE_COLUMNS
from fourpole.fitting.measured import measured_of, read_measured, table_of
from fourpole.study.analysis import analyse
from fourpole.study.study import Study

FREQUENCY, RE, IM = "frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]"


def table(**more):
    base = {
        "test": ["D1", "D2", "D3", "D4"],
        "tyre": ["a", "a", "a", "b"],
        "pressure [Pa]": [1.7e5, 1.705e5, 2.0e5, 1.7e5],
        FREQUENCY: [12.0, 10.0, 10.0, 10.0],
        RE: [200e3, 190e3, 195e3, 150e3],
        IM: [40e3, 38e3, 39e3, 30e3],
    }
    return pl.DataFrame({**base, **more})


def test_tests_of_one_pressure_are_one_condition_rising_in_frequency():
    found = measured_of(table())
    assert [(one.tyre, one.tests) for one in found.conditions] == [("a", ("D2", "D1")), ("a", ("D3",)), ("b", ("D4",))]
    first = found.conditions[0]
    assert first.frequency.tolist() == pytest.approx([10.0, 12.0])
    assert first.state["pressure [Pa]"] == pytest.approx(1.7025e5)
    assert not found.known
    assert "states no uncertainty" in found.notes[0]
    assert first.label == "1.702 bar"
    assert found.tyres == ("a", "b")


def test_rows_without_k_are_left_out_and_counted():
    found = measured_of(table(**{RE: [200e3, None, 195e3, 150e3]}))
    assert found.conditions[0].tests == ("D1",)
    assert "1 of 4 rows" in found.notes[0]


def test_a_test_without_k_parts_conditions_as_it_does_where_tests_are_identified():
    """1.70 and 1.73 bar are one condition, 1.76 bar another; without the tests at 1.70 bar, 1.76 would be as 1.73."""
    pressures = {"pressure [Pa]": [1.70e5, 1.73e5, 1.76e5, 1.70e5], "tyre": ["a"] * 4}
    found = measured_of(table(**pressures, **{RE: [None, 190e3, 195e3, None]}))
    assert [one.tests for one in found.conditions] == [("D2",), ("D3",)]


def test_text_on_an_axis_of_numbers_matters_only_where_k_is_known():
    rule, cells = Sameness((*AXES, Axis("camber [deg]", absolute=0.5))), ["five", "1", "1", "2"]
    found = measured_of(table(**{"camber [deg]": cells, RE: [None, 190e3, 195e3, 150e3]}), rule=rule)
    assert {one.state["camber [deg]"] for one in found.conditions} == {1.0, 2.0}
    with pytest.raises(TableError, match=r"row 2, column 'camber \[deg\]': 'five' is no number"):
        measured_of(table(**{"camber [deg]": cells}), rule=rule)


def test_uncertainties_of_the_table_are_taken_with_their_correlation():
    u = {"u(Re K*) [N/m]": [100.0] * 4, "u(Im K*) [N/m]": [50.0] * 4, "corr(Re,Im K*) [1]": [0.5] * 4}
    found = measured_of(table(**u))
    assert found.known
    np.testing.assert_allclose(found.conditions[1].own.covariance[0], [[1e4, 2500.0], [2500.0, 2500.0]])
    assert "independent" in found.notes[0]
    forced = measured_of(table(**u), std=0.01)
    assert np.sqrt(forced.conditions[1].own.covariance[0, 0, 0]) == pytest.approx(0.01 * abs(195e3 + 39e3j))


@pytest.mark.parametrize("cells", [[1.2] * 4, [-1.01] * 4])
def test_a_correlation_beyond_one_is_no_covariance(cells):
    with pytest.raises(ModelError, match="no covariance"):
        measured_of(table(**{"u(Re K*) [N/m]": [1.0] * 4, "u(Im K*) [N/m]": [1.0] * 4, "corr(Re,Im K*) [1]": cells}))


def test_a_negative_uncertainty_is_named_with_its_column_and_frequency():
    u = {"u(Re K*) [N/m]": [1.0] * 4, "u(Im K*) [N/m]": [1.0, 1.0, -2.0, 1.0]}
    with pytest.raises(ModelError, match=r"u\(Im K\*\) \[N/m\]' at 10 Hz is -2"):
        measured_of(table(**u))


def test_shared_errors_and_tests_of_one_condition():
    """D1 and D2 have one K* (two masses, say): one frequency, its own part not halved; the rigs' errors are apart."""
    own = [[4.0, 0.0, 0.0, 9.0]] * 4
    covariance = pl.DataFrame(
        dict(
            zip(
                COVARIANCE_COLUMNS,
                (
                    ["D1", "D2", "D3", "D4"],
                    ["", "", "", "two"],
                    [0, 0, 1, 0],
                    own,
                    [[1.0, 2.0], [1.0, 2.0], [3.0, 0.0], [5.0]],
                    [[0.0, 1.0], [0.0, 1.0], [0.0, 0.0], [7.0]],
                ),
                strict=True,
            )
        )
    )
    found = measured_of(table(**{FREQUENCY: [10.0, 10.02, 10.0, 10.0]}), covariance)
    first, second, other = found.conditions
    assert first.frequency.tolist() == pytest.approx([10.01])
    assert first.own.covariance[0].tolist() == [[4.0, 0.0], [0.0, 9.0]]
    assert first.shared.tolist() == [[1.0, 2.0, 0.0], [0.0, 1.0, 0.0]]
    assert other.shared.tolist() == [[0.0, 0.0, 5.0], [0.0, 0.0, 7.0]]
    np.testing.assert_allclose(first.data.covariance, [[4 + 5, 2.0], [2.0, 9 + 1]])
    assert second.own.stiffness[0] == 195e3 + 39e3j


def test_a_further_column_tells_conditions_apart_where_it_is_asked_to():
    frame = table(**{"camber [deg]": ["0", "2", "0", "0"]})
    assert len(measured_of(frame).conditions) == 3
    found = measured_of(frame, over=["camber [deg]"])
    assert [one.state["camber [deg]"] for one in found.conditions] == [0.0, 2.0, 0.0, 0.0]
    with pytest.raises(TableError, match=r"row 3.*'two' is no number"):
        measured_of(table(**{"camber [deg]": ["0", "two", "0", "0"]}), over=["camber [deg]"])
    with pytest.raises(ModelError, match="no column 'toe"):
        measured_of(frame, over=["toe [deg]"])


def test_parts_of_it():
    found = measured_of(table())
    assert found.only("b").tyres == ("b",)
    assert found.only(None, (11.0, 13.0)).conditions[0].tests == ("D1",)
    with pytest.raises(ModelError, match="there are 'a', 'b'"):
        found.only("c")
    with pytest.raises(ModelError, match="no test between 1 and 2 Hz"):
        found.only(None, (1.0, 2.0))


def test_files_that_are_no_results(tmp_path):
    place = tmp_path / "dynamic.csv"
    for text, said in (
        ("a,b\n1,2\n", "no column 'frequency"),
        (f'{FREQUENCY},"{RE}","{IM}"\n', "nothing can be fitted"),
    ):
        place.write_text(text)
        with pytest.raises(ModelError, match=said):
            read_measured(place)
    table().write_csv(place)
    (tmp_path / "covariance.parquet").write_bytes(b"no parquet")
    with pytest.raises(TableError, match=r"covariance\.parquet: cannot be read"):
        read_measured(tmp_path)


def test_the_conditions_as_a_table_are_read_back_as_they_were():
    u = {"u(Re K*) [N/m]": [100.0] * 4, "u(Im K*) [N/m]": [50.0] * 4, "corr(Re,Im K*) [1]": [0.5] * 4}
    first = measured_of(table(**u, **{"K1 [N/m]": [1e5] * 4, "u(K1) [N/m]": [1e3] * 4}))
    again = measured_of(table_of(first))
    for one, other in zip(first.conditions, again.conditions, strict=True):
        assert (one.tyre, one.tests, one.state) == (other.tyre, other.tests, other.state)
        np.testing.assert_allclose(other.own.covariance, one.own.covariance, rtol=1e-12)
        assert other.own.k1 == 1e5
    assert "u(Re K*) [N/m]" not in table_of(measured_of(table())).columns


@pytest.mark.parametrize("route", ["joint", "mobility"])
def test_the_covariance_on_disk_is_that_of_the_table(noisy_campaign, tmp_path, route):
    """Own and shared parts add up to the uncertainties of dynamic.csv, and gains make tests agree in their errors."""
    study: Study = analyse(noisy_campaign, route=route)
    study.write(tmp_path)
    found = read_measured(tmp_path)
    assert found.notes == ()
    rows = {row["test"]: row for row in study.dynamic.to_dicts()}
    for one in found.conditions:
        std = np.sqrt(np.diag(one.data.covariance)).reshape(-1, 2)
        for at, test in enumerate(one.tests):
            assert std[at].tolist() == pytest.approx(
                [rows[test]["u(Re K*) [N/m]"], rows[test]["u(Im K*) [N/m]"]], rel=1e-9
            )
        own = np.linalg.eigvalsh(one.own.covariance)
        assert np.all(own >= -1e-9 * own.max())
    assert study.measured.conditions[0].tests == found.conditions[0].tests


def test_round_off_beside_a_large_variance_is_no_asymmetry():
    own = [[1.3e5, 5.1e-9, 4.6e-9, 1.3e5]] * 4
    names = (["D1", "D2", "D3", "D4"], [""] * 4, [0, 1, 2, 3], own, [[1.0]] * 4, [[0.0]] * 4)
    found = measured_of(table(), pl.DataFrame(dict(zip(COVARIANCE_COLUMNS, names, strict=True))))
    assert found.known


def test_rows_that_state_no_uncertainty_among_others_that_do_are_left_out():
    u = {"u(Re K*) [N/m]": [100.0, None, 100.0, 100.0], "u(Im K*) [N/m]": [50.0] * 4}
    found = measured_of(table(**u))
    assert found.known
    assert found.conditions[0].tests == ("D1",)
    assert "1 rows of dynamic state no uncertainty" in found.notes[0]


def test_a_stiffness_below_zero_is_data_and_zero_is_none():
    found = measured_of(table(**{RE: [-200e3, 190e3, 195e3, 150e3]}))
    assert set(found.conditions[0].tests) == {"D1", "D2"}
    none = measured_of(table(**{RE: [0.0, 190e3, 195e3, 150e3], IM: [0.0, 20e3, 20e3, 20e3]}))
    assert none.conditions[0].tests == ("D2",)
    assert "a K* that is zero" in none.notes[0]


def test_the_table_of_the_conditions_has_the_points_of_tests_with_several():
    rows = {"tyre": ["a"] * 3, "frequency [Hz]": [10.0, 12.0, 14.0], "Re K* [N/m]": [2e5] * 3, "Im K* [N/m]": [2e4] * 3}
    single = measured_of(pl.DataFrame({"test": ["D1", "D2", "D3"], **rows}), std=0.01)
    assert "point" not in table_of(single).columns
    swept = measured_of(pl.DataFrame({"test": ["D1"] * 3, "point": [1, 2, 3], **rows}), std=0.01)
    assert table_of(swept)["point"].to_list() == [1, 2, 3]
    assert swept.only(None, (11.0, 15.0)).conditions[0].keys == (("D1", 2), ("D1", 3))
