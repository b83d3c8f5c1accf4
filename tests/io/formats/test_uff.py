"""UFF 58: what pyuff wrote comes back, in text and binary, and other functions are called what they are."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io.formats.uff import FORMAT
from fourpole.io.recordings import BEGINS
from fourpole.io.signals import Request

pyuff = pytest.importorskip("pyuff")
LIMIT = 10**9
FORCE = np.random.default_rng(1).normal(size=2000)
SPEED = np.random.default_rng(2).normal(size=500)


def asked(path: Path, *names: str, group: str = "", most: int = LIMIT) -> Request:
    return Request(path, names, group, path.name, most)


def signal(
    values: np.ndarray, rate: float, *, binary: int = 0, start: float = 0.0, **more: object
) -> dict[str, object]:
    fields: dict[str, object] = {
        "func_type": 1,
        "rsp_node": 12,
        "rsp_dir": -3,
        "ref_node": 0,
        "ref_dir": 0,
        "ordinate_spec_data_type": 13,
        "abscissa_spec_data_type": 17,
        "id1": "NONE",
    }
    fields |= {"abscissa_spacing": 1, "abscissa_min": start, "abscissa_inc": 1 / rate, "num_pts": len(values)}
    fields |= {"ord_data_type": 4, "orddenom_spec_data_type": 0, "binary": binary, "data": values}
    return pyuff.prepare_58(**(fields | {"x": start + np.arange(len(values)) / rate} | more))


def written(path: Path, *sets: dict[str, object]) -> Path:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the library leaves the file open where it writes binary
        for one in sets:
            pyuff.UFF(str(path)).write_sets(one, mode="add")
    return path


@pytest.mark.parametrize("binary", [0, 1])
def test_signals_come_back(tmp_path: Path, binary: int) -> None:
    path = written(
        tmp_path / "a.uff",
        pyuff.prepare_164(
            units_code=1, units_description="SI", temp_mode=1, length=1.0, force=1.0, temp=1.0, temp_offset=0.0
        ),
        signal(FORCE, 2048.0, binary=binary, id1="Force front"),
        signal(SPEED, 100.0, binary=binary, id1="Speed", ordinate_spec_data_type=11, start=0.5),
    )
    assert BEGINS["uff"](path.read_bytes()[:4096])
    info = FORMAT.survey(path, "a.uff", LIMIT)
    assert info.format == ("UFF 58b" if binary else "UFF 58")
    assert [(one.name, one.unit, one.count, one.rate) for one in info.signals] == [
        ("Force front", "N", 2000, 2048.0),
        ("Speed", "m/s", 500, 100.0),
    ]
    assert "12-Z" in info.signals[0].note
    speed, force = FORMAT.read(asked(path, "speed", "Force front"))
    np.testing.assert_allclose(force.samples, FORCE, rtol=1e-11, atol=1e-12)
    np.testing.assert_allclose(speed.samples, SPEED, rtol=1e-11, atol=1e-12)
    assert (force.rate, force.start, speed.rate, speed.start) == (2048.0, 0.0, 100.0, 0.5)


def test_names_by_node_and_stated_units(tmp_path: Path) -> None:
    path = written(
        tmp_path / "a.unv",
        signal(FORCE, 2000.0, ordinate_axis_units_lab="kN"),
        signal(SPEED, 2000.0, rsp_node=7, rsp_dir=1),
        signal(SPEED, 2000.0, rsp_node=7, rsp_dir=1),
    )
    info = FORMAT.survey(path, "a.unv", LIMIT)
    assert [(one.name, one.unit) for one in info.signals] == [("12-Z", "kN"), ("7+X (2)", None), ("7+X (3)", None)]


def test_other_functions_are_no_recordings(tmp_path: Path) -> None:
    lines = np.arange(20.0)
    response = pyuff.prepare_58(
        binary=0,
        func_type=4,
        rsp_node=1,
        rsp_dir=3,
        ref_node=2,
        ref_dir=3,
        data=lines + 1j,
        x=lines,
        id1="H",
        abscissa_spacing=1,
        abscissa_spec_data_type=18,
        ordinate_spec_data_type=12,
        orddenom_spec_data_type=13,
    )
    path = written(tmp_path / "a.uff", response, signal(FORCE, 2048.0, id1="Force"))
    info = FORMAT.survey(path, "a.uff", LIMIT)
    assert [one.name for one in info.signals] == ["1+Z", "Force"]
    assert "frequency response function" in info.signals[0].note
    with pytest.raises(TableError, match=r"'1\+Z' is a frequency response function, no recording"):
        FORMAT.read(asked(path, "1+Z"))
    with pytest.raises(TableError, match="no channel 'Forces'; did you mean 'Force'"):
        FORMAT.read(asked(path, "Forces"))


def test_memory_is_asked_for_before_it_is_used(tmp_path: Path) -> None:
    path = written(tmp_path / "a.uff", signal(FORCE, 2048.0))
    with pytest.raises(FileError, match=r"needs .* more than the"):
        FORMAT.read(asked(path, "12-Z", most=40_000))


@pytest.mark.parametrize("binary", [0, 1])
def test_what_is_cut_short_or_lies_is_refused(tmp_path: Path, binary: int, capfd: pytest.CaptureFixture[str]) -> None:
    whole = written(tmp_path / "a.uff", signal(FORCE, 2048.0, binary=binary)).read_bytes()
    count = b"      2000"
    at = whole.index(count)
    wrong = [
        whole[:-300],
        whole[:-10],
        whole[:700],
        whole[:20],
        whole[:at] + b"2000000000" + whole[at + 10 :],
        whole[:at] + b"     -2000" + whole[at + 10 :],
        whole[:at] + b"      abcd" + whole[at + 10 :],
        b"t,F1\n0,1\n",
    ]
    for content in wrong:
        (tmp_path / "b.uff").write_bytes(content)
        with pytest.raises((TableError, FileError), match=r"^b\.uff: "):
            FORMAT.read(asked(tmp_path / "b.uff", "12-Z"))
    assert capfd.readouterr() == ("", "")


def test_sets_without_signals_are_named(tmp_path: Path) -> None:
    nodes = "    -1\n    15\n" + "         1         0         0        11  0.0  0.0  0.0\n" + "    -1\n"
    modes = "    -1\n    55\nNONE\n" + "    -1\n"
    units = "    -1\n   164\n         1  SI\n    -1\n"
    path = tmp_path / "a.unv"
    path.write_text(units + nodes + nodes + modes + "    -1\n  9999\nx\n    -1\n")
    said = r"holds no function \(data set 58\), only data sets 164, 15, 55, 9999; export the time signals too"
    with pytest.raises(TableError, match=said):
        FORMAT.survey(path, "a.unv", 10**8)
