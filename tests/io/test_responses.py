"""Frequency responses in UFF 58: every ratio of force and motion, either way up, is the same K*."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from fourpole.errors import TableError
from fourpole.fitting.measured import read_measured
from fourpole.io.tables.kstar import TableOptions, read_k_star
from fourpole.io.tables.pair import read_curve

pyuff = pytest.importorskip("pyuff")

F = 1.5 + 0.5 * np.arange(40)
JW = 2j * np.pi * F
K = 2e5 * (1 + 0.1j * (F / 10) ** 0.3)
BLOCKED = TableOptions(ratio=True)
DISPLACEMENT, FORCE, VELOCITY, ACCELERATION, UNKNOWN = 8, 13, 11, 12, 0
#: Values in SI, data types and units of the ordinate and its denominator, and SI value of the unit.
FORMS: dict[str, tuple[np.ndarray, int, int, str, str, float]] = {
    "accelerance": (JW**2 / K, ACCELERATION, FORCE, "m/s^2", "N", 1.0),
    "accelerance in g": (JW**2 / K, ACCELERATION, FORCE, "g", "N", 9.80665),
    "mobility": (JW / K, VELOCITY, FORCE, "mm/s", "N", 1e-3),
    "receptance": (1 / K, DISPLACEMENT, FORCE, "mm", "kN", 1e-6),
    "dynamic stiffness": (K, FORCE, DISPLACEMENT, "N", "mm", 1e3),
    "impedance": (K / JW, FORCE, VELOCITY, "N", "m/s", 1.0),
    "apparent mass": (K / JW**2, FORCE, ACCELERATION, "N", "m/s^2", 1.0),
    "in one label": (JW**2 / K, UNKNOWN, UNKNOWN, "(1/N)*(m/s^2)", "NONE", 1.0),
    "dynamic stiffness in one label": (K, UNKNOWN, UNKNOWN, "N/mm", "", 1e3),
}


def function(values: np.ndarray, types: tuple[int, int], units: tuple[str, str], **more: Any) -> dict[str, Any]:
    head = {
        "type": 58, "binary": 0, "func_type": 4, "rsp_node": 1, "rsp_dir": 3, "ref_node": 1, "ref_dir": 3,
        "abscissa_spacing": 1, "abscissa_min": F[0], "abscissa_inc": 0.5, "abscissa_spec_data_type": 18,
        "num_pts": F.size, "x": F, "ord_data_type": 6, "ordinate_spec_data_type": types[0],
        "orddenom_spec_data_type": types[1], "ordinate_axis_units_lab": units[0], "orddenom_axis_units_lab": units[1],
        "z_axis_spec_data_type": 0, "id1": "NONE", "rsp_ent_name": "NONE", "ref_ent_name": "NONE",
        "data": values,
    }  # fmt: skip
    return head | more


def test_a_ratio_of_two_motions_is_a_transmissibility(written: Callable[..., Path]) -> None:
    expected = K / (K + 20 * JW**2)
    one = function(expected, (ACCELERATION, ACCELERATION), ("g", "g"), rsp_node=2)
    found = read_k_star(written(one), TableOptions(ratio=True, rig=True))
    np.testing.assert_allclose(found.transmissibility, expected, rtol=1e-5)
    with pytest.raises(TableError, match="state the rig's values"):
        read_k_star(written(one), TableOptions(ratio=True))


@pytest.fixture
def written(tmp_path: Path) -> Callable[..., Path]:
    def writing(*sets: dict[str, Any]) -> Path:
        path = tmp_path / "frf.uff"
        file = pyuff.UFF(str(path))
        for at, one in enumerate(sets):
            file.write_sets(one, "overwrite" if at == 0 else "add")
        return path

    return writing


def of(form: str, **more: Any) -> dict[str, Any]:
    values, *types, unit, per, scale = FORMS[form]
    return function(values / scale, (types[0], types[1]), (unit, per), **more)


@pytest.mark.parametrize("form", FORMS)
def test_every_ratio_is_the_same_stiffness(written: Callable[..., Path], form: str) -> None:
    table = read_k_star(written(of(form)), BLOCKED)
    np.testing.assert_allclose(table.frequency, F, rtol=1e-6)
    assert table.mobility is not None
    np.testing.assert_allclose(table.mobility, JW / K, rtol=2e-5)  # the file has six digits


def test_a_transfer_stiffness_is_k_star_itself(written: Callable[..., Path]) -> None:
    table = read_k_star(written(of("dynamic stiffness", rsp_node=2)))
    assert table.stiffness is not None
    np.testing.assert_allclose(table.stiffness, K, rtol=2e-5)
    with pytest.raises(TableError, match="a motion at another node than the force"):
        read_k_star(written(of("receptance", rsp_node=2)), BLOCKED)


def test_directions_say_the_sign(written: Callable[..., Path]) -> None:
    values = -FORMS["accelerance"][0]
    opposite = function(values, (ACCELERATION, FORCE), ("m/s^2", "N"), ref_dir=-3)
    table = read_k_star(written(opposite), BLOCKED)
    np.testing.assert_allclose(table.frame()["Re K* [N/m]"], K.real, rtol=2e-5)
    assert any("opposite directions" in one for one in table.warnings)
    with pytest.raises(TableError, match="across two directions"):
        read_k_star(written(of("accelerance", ref_dir=1)), BLOCKED)
    with pytest.raises(TableError, match="has a rotation"):
        read_k_star(written(of("accelerance", ref_dir=6, rsp_dir=6)), BLOCKED)


def test_the_rig_is_stated_or_there_is_none(written: Callable[..., Path]) -> None:
    with pytest.raises(TableError, match="accelerance, driving point: it is of the specimen and what is behind it"):
        read_k_star(written(of("accelerance")))


def test_one_of_several_is_stated(written: Callable[..., Path]) -> None:
    path = written(of("accelerance", rsp_node=5, ref_node=5), of("receptance"))
    with pytest.raises(TableError, match=r"has 2 frequency responses \(1 5\+Z/5\+Z, 2 1\+Z/1\+Z\): state one by"):
        read_k_star(path, BLOCKED)
    for name in ("1+Z/1+Z", "2"):
        table = read_k_star(path, TableOptions(columns=[f"frf={name}"], ratio=True))
        assert table.understood == ["frequency response '1+Z/1+Z': receptance, driving point"]
    with pytest.raises(TableError, match="has no frequency responses '3'"):
        read_k_star(path, TableOptions(columns=["frf=3"], ratio=True))


def test_a_unit_that_is_not_stated_is_asked_for(written: Callable[..., Path]) -> None:
    bare = function(JW**2 / K / 9.80665, (ACCELERATION, FORCE), ("NONE", "NONE"))
    path = written(bare)
    with pytest.raises(TableError, match=r"states no unit: state it, as in --column \"frf=1\+Z/1\+Z \[\(m"):
        read_k_star(path, BLOCKED)
    table = read_k_star(path, TableOptions(columns=["frf=1 [g/N]"], ratio=True))
    np.testing.assert_allclose(table.frame()["Im K* [N/m]"], K.imag, rtol=1e-4)
    with pytest.raises(TableError, match="is acceleration over force by its types, but in m/N"):
        read_k_star(path, TableOptions(columns=["frf=1 [m/N]"], ratio=True))


def test_coherence_and_averages_are_the_uncertainty(written: Callable[..., Path]) -> None:
    coherence = np.linspace(0.8, 0.99, F.size)
    beside = function(coherence, (UNKNOWN, UNKNOWN), ("NONE", "NONE"), func_type=6, ord_data_type=4)
    path = written(of("mobility"), beside)
    assert any("state --averages" in one for one in read_k_star(path, BLOCKED).warnings)
    measured = read_measured(path, options=TableOptions(ratio=True, averages=40))
    assert measured.known
    std = np.sqrt(measured.conditions[0].own.covariance[:, 0, 0]) / abs(K)
    np.testing.assert_allclose(std, np.sqrt((1 - coherence) / (80 * coherence)), rtol=1e-4)


def test_signals_are_no_responses(written: Callable[..., Path]) -> None:
    path = written(function(F, (ACCELERATION, UNKNOWN), ("g", "NONE"), func_type=1, ord_data_type=4,
                            abscissa_spec_data_type=17))  # fmt: skip
    with pytest.raises(TableError, match="holds no frequency response; time signals are recordings"):
        read_k_star(path)
    with pytest.raises(TableError, match="no column is understood as the deflection"):
        read_curve(path)
