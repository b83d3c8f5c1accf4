"""A campaign whose recordings are in another format gives the same numbers as in text."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fourpole.study import analyse

RATE = 1000.0
SIGNALS = (("F1", "N"), ("V1", "m/s"), ("V2", "m/s"))


def as_mdf(path: Path, table: pl.DataFrame) -> str:
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF(version="4.10")
    times = table["t"].to_numpy()
    file.append([asammdf.Signal(table[name].to_numpy(), times, unit=unit, name=name) for name, unit in SIGNALS])
    file.save(path.with_suffix(".mf4"))
    return path.with_suffix(".mf4").name


def as_tdms(path: Path, table: pl.DataFrame) -> str:
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path.with_suffix(".tdms")) as file:
        for group in ("before", "test"):
            channels = [
                nptdms.ChannelObject(
                    group,
                    name,
                    table[name].to_numpy() * (1.0 if group == "test" else 0.0),
                    {"wf_increment": 1 / RATE, "wf_start_offset": 0.0, "unit_string": unit},
                )
                for name, unit in SIGNALS
            ]
            file.write_segment(channels)
    return path.with_suffix(".tdms").name + "#test"


def as_hdf5(path: Path, table: pl.DataFrame) -> str:
    h5py = pytest.importorskip("h5py")
    with h5py.File(path.with_suffix(".h5"), "w") as file:
        for name, unit in SIGNALS:
            data = file.create_dataset(f"test/{name}", data=table[name].to_numpy())
            data.attrs["unit"], data.attrs["rate"] = unit, RATE
    return path.with_suffix(".h5").name


def as_matlab(path: Path, table: pl.DataFrame) -> str:
    from scipy.io import savemat

    savemat(path.with_suffix(".mat"), {name: table[name].to_numpy() for name in ("t", "F1", "V1", "V2")})
    return path.with_suffix(".mat").name


def as_tydex(path: Path, table: pl.DataFrame) -> str:
    lines = ["**HEADER", "RELEASE   Release of TYDEX-Format                   1.3", "**MEASURCHANNELS"]
    names = (("RUNTIME", "s", "t"), ("F1", "N", "F1"), ("V1", "m/s", "V1"), ("V2", "m/s", "V2"))
    lines += [f"{name:10}{'as recorded':30}{unit:10}{'1':10}{'0':10}{'0':10}" for name, unit, _ in names]
    rows = table.select([column for _, _, column in names]).rows()
    lines += ["**MEASURDATA", *(" ".join(f"{value!r}" for value in row) for row in rows), "**END"]
    path.with_suffix(".tdx").write_text("\n".join(lines) + "\n")
    return path.with_suffix(".tdx").name


@pytest.mark.parametrize("write", [as_mdf, as_tdms, as_hdf5, as_matlab, as_tydex])
@pytest.mark.sampled(4)
def test_the_same_numbers_come_out_of_every_format(clean, write):
    before = analyse(clean.path, route="relative").dynamic
    text = (clean.path / "tests.csv").read_text()
    for test in before["test"]:
        path = clean.path / "recordings" / f"{test}.csv"
        name = write(path, pl.read_csv(path))
        path.unlink()
        text = text.replace(f"recordings/{test}.csv", f"recordings/{name}")
    (clean.path / "tests.csv").write_text(text)
    after = analyse(clean.path, route="relative").dynamic
    assert after["verdict"].to_list() == before["verdict"].to_list()
    for column in ("Re K* [N/m]", "Im K* [N/m]", "TR measured [1]", "frequency [Hz]"):
        np.testing.assert_allclose(after[column], before[column], rtol=1e-9)


def test_a_group_that_is_not_there_is_told(clean):
    path = clean.path / "recordings" / "D1.csv"
    name = as_tdms(path, pl.read_csv(path))
    text = (clean.path / "tests.csv").read_text()
    (clean.path / "tests.csv").write_text(text.replace("recordings/D1.csv", f"recordings/{name[:-4]}nowhere"))
    row = analyse(clean.path).dynamic.row(0, named=True)
    assert row["verdict"] == "rejected"
    assert "nowhere" in row["remarks"]
    assert "test" in row["remarks"]


def test_channels_at_different_rates_are_each_demodulated_on_their_own_times(clean):
    """V2 at half the rate and from half a second on, F1 from a quarter of a second on: the same K*."""
    h5py = pytest.importorskip("h5py")
    before = analyse(clean.path, route="relative").dynamic
    path = clean.path / "recordings" / "D1.csv"
    table = pl.read_csv(path)
    with h5py.File(path.with_suffix(".h5"), "w") as file:
        for name, unit in SIGNALS:
            every, first = {"V2": (2, 500), "F1": (1, 250)}.get(name, (1, 0))
            data = file.create_dataset(f"test/{name}", data=table[name].to_numpy()[first::every])
            data.attrs["unit"], data.attrs["rate"], data.attrs["start"] = unit, RATE / every, first / RATE
    text = (clean.path / "tests.csv").read_text()
    (clean.path / "tests.csv").write_text(text.replace("recordings/D1.csv", "recordings/D1.h5"))
    after = analyse(clean.path, route="relative").dynamic
    assert after["verdict"][0] == before["verdict"][0]
    for column in ("Re K* [N/m]", "Im K* [N/m]", "TR measured [1]", "frequency [Hz]"):
        np.testing.assert_allclose(after[column][0], before[column][0], rtol=1e-9)
