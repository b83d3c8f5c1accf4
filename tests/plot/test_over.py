"""Any quantity over any axis: each test once, at its values, with lines that join what differs in nothing else."""

from __future__ import annotations

import numpy as np
import pytest
from tests.plot.conftest import FREQUENCIES, PRESSURES, empty_results

from fourpole.errors import CampaignError
from fourpole.plot import draw, figure_data
from fourpole.plot.data import Role
from fourpole.plot.over import OVER, SHOWN, key_over, quantity_named
from fourpole.study.study import Study


def points(results: Study, key: str, role: Role = Role.POINTS) -> dict[str, tuple[float, float]]:
    """The tests of a figure with their values on both axes."""
    data = figure_data(results, key)
    assert data is not None
    found = {}
    for panel in data.panels:
        for one in panel.series:
            if one.role is role:
                found |= dict(zip(one.tests, zip(one.x.tolist(), one.y.tolist(), strict=True), strict=True))
    return found


@pytest.mark.parametrize(
    ("name", "axis", "x", "y"),
    [
        ("K2", "pressure", ("pressure [Pa]", 1e5), ("K2 [N/m]", 1e3)),
        ("C", "preload", ("preload [N]", 1.0), ("C [N s/m]", 1.0)),
        ("TR", "pressure", ("pressure [Pa]", 1e5), ("TR measured [1]", 1.0)),
        ("Re K*", "frequency", ("frequency [Hz]", 1.0), ("Re K* [N/m]", 1e3)),
    ],
)
def test_each_test_stands_at_its_values(
    study: Study, name: str, axis: str, x: tuple[str, float], y: tuple[str, float]
) -> None:
    table = study.dynamic.filter(study.dynamic["verdict"] != "rejected").drop_nulls([x[0], y[0]])
    expected = {row["test"]: (row[x[0]] / x[1], row[y[0]] / y[1]) for row in table.iter_rows(named=True)}
    found = points(study, key_over(name, axis))
    assert found
    assert found.keys() <= expected.keys()
    for test, values in found.items():
        assert values == pytest.approx(expected[test], rel=1e-12)


def test_a_line_joins_tests_of_one_frequency_over_pressure(study: Study) -> None:
    data = figure_data(study, "k2-over-pressure")
    assert data is not None
    lines = [one for panel in data.panels for one in panel.series if one.role is Role.LINE]
    assert lines
    for line in lines:
        assert line.x == pytest.approx(np.array(PRESSURES) / 1e5)
    assert data.scale is not None
    assert (data.scale.low, data.scale.high) == pytest.approx((min(FREQUENCIES), max(FREQUENCIES)), rel=0.01)


def test_static_quantities_come_from_the_static_tests(study: Study) -> None:
    found = points(study, key_over("K1", "pressure"))
    assert found.keys() == set(study.static["test"])
    assert points(study, key_over("K1", "frequency")).keys() <= set(study.dynamic["test"])
    assert figure_data(study, key_over("hysteresis loss", "frequency")) is None


def test_tests_are_counted_in_the_order_of_their_table(study: Study) -> None:
    found = points(study, key_over("K1", "order"))
    names = list(dict.fromkeys(study.static["test"]))
    assert found
    assert all(x == names.index(test) + 1 for test, (x, _) in found.items())


@pytest.mark.parametrize("axis", OVER)
@pytest.mark.sampled(3)
def test_every_quantity_can_be_drawn_or_is_not_there(study: Study, axis: str) -> None:
    for name in SHOWN:
        data = figure_data(study, key_over(name, axis))
        assert data is None or any(one.tests for panel in data.panels for one in panel.series)
    assert draw(study, key_over("K2", "pressure")) is not None


def test_names_are_those_that_people_write() -> None:
    assert [quantity_named(one).key for one in ("k2", "K'", "loss factor", "Im K*", "|K*|", "R")] == [
        "k2", "storage", "loss_factor", "loss", "modulus", "r",
    ]  # fmt: skip
    with pytest.raises(CampaignError, match="no quantity 'Kz'"):
        quantity_named("Kz")
    with pytest.raises(CampaignError, match="did you mean pressure"):
        key_over("K2", "presure")
    with pytest.raises(CampaignError, match="no figure 'k2-over-nothing'"):
        figure_data(Study(), "k2-over-nothing")


def test_nothing_to_show_is_no_figure() -> None:
    for axis in OVER:
        assert figure_data(empty_results(), key_over("K2", axis)) is None
