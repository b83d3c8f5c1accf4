"""Recordings written in every format and read back: the same samples, times and units, by our reader and by others."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fourpole.errors import FileError, TableError
from fourpole.io import convert as converting
from fourpole.io import stream as streaming
from fourpole.io.convert import WRITERS, Choice, convert
from fourpole.io.recordings import survey

RATE = 2048.0
COUNT = 5000
KINDS = ("csv", "parquet", "mf4")
SIGNALS = {"F1": "N", "V1": "m/s", "x": "µm"}

h5py = pytest.importorskip("h5py")
pytest.importorskip("asammdf")


def noise(count=COUNT, seed=1):
    """Numbers with all their digits, of which some have no short decimal form."""
    return np.random.default_rng(seed).standard_normal(count) * 10.0 ** np.linspace(-9, 9, count)


def recording(path: Path, *, start=0.0, rate=RATE, time=None, samples=None) -> Path:
    """An HDF5 file of three channels with the same times."""
    with h5py.File(path, "w") as file:
        for seed, (name, unit) in enumerate(SIGNALS.items()):
            data = file.create_dataset(name, data=noise(seed=seed) if samples is None else samples)
            data.attrs["unit"] = unit
            if time is None:
                data.attrs["rate"], data.attrs["start"] = rate, start
            else:
                data.attrs["time"] = "t"
        if time is not None:
            file.create_dataset("t", data=time).attrs["unit"] = "s"
    return path


def read(path: Path):
    """All that our reader finds: signals by name, whole."""
    found = survey(path)
    run = streaming.surveyed_stream(path, found, range(len(found.signals)), label=path.name)
    parts = list(run.chunks)
    result = {}
    for at, info in enumerate(found.signals):
        samples = np.concatenate([part[at].samples for part in parts])
        first = parts[0][at]
        times = [streaming.times_of(part[at]) for part in parts]
        time = None if times[0] is None else np.concatenate(times)
        result[f"{info.group}/{info.name}" if info.group else info.name] = (samples, info.unit, time, first)
    return result


def bare(name: str) -> str:
    """Without group and unit."""
    return name.partition(" [")[0].rpartition("/")[2].rpartition(".")[2]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("start", [0.0, 0.25])
@pytest.mark.sampled(4)
def test_the_samples_come_back_to_the_last_bit(tmp_path, kind, start):
    source = recording(tmp_path / "a.h5", start=start)
    out = tmp_path / f"b.{kind}"
    made = convert(source, out)
    before, after = read(source), read(out)
    by_name = {bare(name): found for name, found in after.items()}
    for name in SIGNALS:
        samples, unit, time, _ = by_name[name]
        np.testing.assert_array_equal(samples, before[name][0])
        assert unit == before[name][1]
        np.testing.assert_allclose(time, before[name][2], rtol=0, atol=1e-12)
    assert made.lost == ()
    assert sorted(tmp_path.iterdir()) == sorted([source, out])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.sampled(2)
def test_missing_samples_stay_missing(tmp_path, kind):
    samples = noise()
    samples[100:140] = np.nan
    source = recording(tmp_path / "a.h5", samples=samples)
    out = tmp_path / f"b.{kind}"
    convert(source, out)
    found = {bare(name): one[0] for name, one in read(out).items()}["V1"]
    np.testing.assert_array_equal(np.isnan(found), np.isnan(samples))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.sampled(2)
def test_uneven_times_are_kept(tmp_path, kind):
    time = 3.0 + np.cumsum(np.random.default_rng(3).uniform(0.5e-3, 1.5e-3, COUNT))
    source = recording(tmp_path / "a.h5", time=time)
    out = tmp_path / f"b.{kind}"
    made = convert(source, out)
    assert made.groups[0].startswith("5000 samples at uneven times")
    _, _, found, _ = {bare(name): one for name, one in read(out).items()}["F1"]
    np.testing.assert_array_equal(found, time)


# What others read ------------------------------------------------------------------------------------------------


def test_csv_is_read_by_polars(tmp_path):
    source = recording(tmp_path / "a.h5")
    convert(source, tmp_path / "b.csv")
    table = pl.read_csv(tmp_path / "b.csv")
    assert table.columns == ["t [s]", "F1 [N]", "V1 [m/s]", "x [µm]"]
    np.testing.assert_array_equal(table["F1 [N]"], noise(seed=0))
    np.testing.assert_allclose(table["t [s]"], np.arange(COUNT) / RATE, rtol=1e-15)


def test_parquet_is_read_by_polars(tmp_path):
    convert(recording(tmp_path / "a.h5"), tmp_path / "b.parquet")
    table = pl.read_parquet(tmp_path / "b.parquet")
    assert table.columns == ["t [s]", "F1 [N]", "V1 [m/s]", "x [µm]"]
    np.testing.assert_array_equal(table["x [µm]"], noise(seed=2))


def test_mdf_is_read_by_asammdf(tmp_path):
    import asammdf

    convert(recording(tmp_path / "a.h5", start=0.5), tmp_path / "b.mf4")
    with asammdf.MDF(tmp_path / "b.mf4") as mdf:
        one = mdf.get("V1")
        assert one.unit == "m/s"
        np.testing.assert_array_equal(one.samples, noise(seed=1))
        np.testing.assert_array_equal(one.timestamps, 0.5 + np.arange(COUNT) / RATE)


# Several rates, several groups -----------------------------------------------------------------------------------


@pytest.fixture
def mixed(tmp_path):
    """Two groups with channels of the same names, one of them with two rates."""
    path = tmp_path / "mixed.h5"
    with h5py.File(path, "w") as file:
        for group, name, rate, count in (
            ("warm", "F1", 1000.0, 700),
            ("test", "F1", 1000.0, 900),
            ("test", "V1", 1000.0, 900),
            ("test", "T", 10.0, 9),
        ):
            data = file.create_dataset(f"{group}/{name}", data=noise(count, seed=count))
            data.attrs["unit"], data.attrs["rate"] = "N" if name == "F1" else "m/s", rate
    return path


def test_groups_and_rates_are_kept_where_the_format_has_them(mixed, tmp_path):
    out = tmp_path / "out.mf4"
    made = convert(mixed, out)
    assert len(made.groups) == 3
    before = read(mixed)
    after = {name: one for name, one in read(out).items() if bare(name) not in ("t", "time")}
    assert len(after) == 4
    for samples, unit, time, _ in after.values():
        same = [one for one in before.values() if one[0].size == samples.size and np.array_equal(one[0], samples)]
        assert same
        assert unit in {one[1] for one in same}
        np.testing.assert_allclose(time, same[0][2], rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_where_it_has_not_the_groups_are_named(mixed, tmp_path, kind):
    out = tmp_path / f"out.{kind}"
    with pytest.raises(TableError) as error:
        convert(mixed, out)
    for said in ("one group and one rate", "warm: 700 samples at 1000 Hz (F1)", "test: 9 samples at 10 Hz (T)"):
        assert said in str(error.value)
    assert "--channels" in str(error.value)
    assert list(tmp_path.iterdir()) == [mixed]
    made = convert(mixed, out, Choice(group="test", channels=("F1", "V1")))
    assert "the name of the group, test, is not kept" in made.lost
    found = {bare(name): one for name, one in read(out).items()}
    np.testing.assert_allclose(found["V1"][0], noise(900, seed=900), rtol=5e-13)


def test_of_many_groups_some_are_named(tmp_path):
    with h5py.File(tmp_path / "many.h5", "w") as file:
        for at in range(30):
            file.create_dataset(f"raster {at}/n", data=noise(50)).attrs["rate"] = 100.0
    with pytest.raises(TableError, match=r"there are 30: raster 0: .*; raster 15: .*; and 22 more\. Choose"):
        convert(tmp_path / "many.h5", tmp_path / "many.csv")


# What is chosen, and what is refused -----------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_a_window_is_cut_and_keeps_its_times(tmp_path, kind):
    source = recording(tmp_path / "a.h5", start=0.25)
    out = tmp_path / f"b.{kind}"
    convert(source, out, Choice(window=(0.5, 1.0), channels=("V1",)))
    samples, _, time, _ = {bare(name): one for name, one in read(out).items()}["V1"]
    assert samples.size == 1025  # 0.5 s and both ends
    np.testing.assert_allclose(samples, noise(seed=1)[512:1537], rtol=5e-13)
    np.testing.assert_allclose(time[[0, -1]], [0.5, 1.0], atol=1e-12)


def test_a_window_without_samples_is_told(tmp_path):
    with pytest.raises(TableError, match=r"no samples from 7 to 9 s; the recording runs 0 to 2\.4"):
        convert(recording(tmp_path / "a.h5"), tmp_path / "b.csv", Choice(window=(7.0, 9.0)))
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


def test_without_times_what_needs_them_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text("F1 [N],V1 [m/s]\n1,2\n3,4\n5,7\n")
    with pytest.raises(TableError, match=r"write \.csv"):
        convert(tmp_path / "a.csv", tmp_path / "b.mf4")
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_without_times_the_others_hold_the_samples(tmp_path, kind):
    (tmp_path / "a.csv").write_text("F1 [N],V1 [m/s]\n1,2\n3,4\n5,7\n")
    out = tmp_path / f"b.{kind}"
    convert(tmp_path / "a.csv", out)
    found = {bare(name): one for name, one in read(out).items()}
    assert set(found) == {"F1", "V1"}
    assert found["V1"][0].tolist() == [2, 4, 7]
    assert found["V1"][2] is None


def test_the_input_and_what_is_there_are_not_overwritten(tmp_path):
    source = tmp_path / "a.csv"
    convert(recording(tmp_path / "a.h5"), source)
    before = source.read_bytes()
    with pytest.raises(FileError, match="is the file that is read"):
        convert(source, source, Choice(force=True))
    other = tmp_path / "b.csv"
    other.write_text("mine")
    with pytest.raises(FileError, match="is there already; name another file, or replace it with --force"):
        convert(source, other)
    assert other.read_text() == "mine"
    convert(source, other, Choice(force=True))
    assert other.read_text().startswith("t [s],F1 [N]")
    assert source.read_bytes() == before


def test_what_fails_leaves_nothing(tmp_path):
    (tmp_path / "a.csv").write_text("t [s],F1 [N]\n" + "".join(f"{k / 1000},{k}\n" for k in range(50)) + "0.05,oops\n")
    with pytest.raises(TableError, match="oops"):
        convert(tmp_path / "a.csv", tmp_path / "b.mf4", Choice(channels=("F1",)))
    with pytest.raises(FileError, match="does its folder exist"):
        convert(recording(tmp_path / "c.h5"), tmp_path / "no" / "b.csv")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "c.h5"]


def test_channels_without_numbers_are_left_out_and_said(tmp_path):
    with h5py.File(recording(tmp_path / "a.h5"), "a") as file:
        file.create_dataset("z", data=np.zeros(COUNT, dtype="c16"))
    made = convert(tmp_path / "a.h5", tmp_path / "b.csv")
    assert pl.read_csv(tmp_path / "b.csv").columns == ["t [s]", "F1 [N]", "V1 [m/s]", "x [µm]"]
    assert made.groups == ("5000 samples at 2048 Hz (F1, V1, x)",)


@pytest.mark.parametrize("kind", KINDS)
def test_strange_names_are_changed_where_they_must_and_said(tmp_path, kind):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name in ("Force in contact 1", "Force in contact 2", "T"):
            file.create_dataset(name, data=noise(50)).attrs["rate"] = 100.0
    made = convert(tmp_path / "a.h5", tmp_path / f"b.{kind}")
    assert not [said for said in made.lost if "is called" in said]
    found = {bare(name): one[0] for name, one in read(tmp_path / f"b.{kind}").items()}
    assert sum(np.allclose(one, noise(50), rtol=5e-13) for one in found.values() if one.size == 50) == 3


@pytest.mark.parametrize(
    ("ending", "tool"),
    [(".tdms", "npTDMS"), (".mat", "savemat"), (".h5", "h5py"), (".uff", "pyuff"), (".wav", "soundfile")],
)
def test_a_format_that_is_read_alone_is_refused_with_the_tool_that_writes_it(tmp_path, ending, tool):
    with pytest.raises(TableError, match=rf"\(\.csv, \.parquet, \.pq, \.mf4\); it is written by .*{tool}"):
        convert(recording(tmp_path / "a.h5"), tmp_path / f"b{ending}")


def test_an_unknown_ending_is_told_with_the_known(tmp_path):
    with pytest.raises(TableError, match=r"ending is none of those that are written \(\.csv, \.parquet"):
        convert(recording(tmp_path / "a.h5"), tmp_path / "b.xls")
    with pytest.raises(TableError, match="--to 'xls' is no format that is written; known are csv, parquet"):
        convert(tmp_path / "a.h5", tmp_path / "b.csv", Choice(kind="xls"))
    convert(tmp_path / "a.h5", tmp_path / "b.dat", Choice(kind="csv"))
    assert (tmp_path / "b.dat").read_text().startswith("t [s]")


def test_all_kinds_are_tested():
    assert set(KINDS) == set(WRITERS)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.sampled(2)
def test_in_pieces_it_is_the_same_file(tmp_path, kind, monkeypatch):
    source = recording(tmp_path / "a.h5", start=0.25)
    ending = f".{kind}"
    convert(source, tmp_path / f"whole{ending}", Choice(window=(0.3, 2.5)))
    monkeypatch.setattr(streaming, "_AT_ONCE", 1)
    monkeypatch.setattr(streaming, "_LEAST_ROWS", 700)
    seen = []
    # In this process, where the size of a piece is changed.
    out = tmp_path / f"pieces{ending}"
    converting._convert(source, out, out, Choice(window=(0.3, 2.5)), progress=lambda *now: seen.append(now))
    assert len(seen) == 8
    assert seen[-1] == (15000, 15000)
    whole, pieces = read(tmp_path / f"whole{ending}"), read(tmp_path / f"pieces{ending}")
    assert set(whole) == set(pieces)
    for name in whole:
        np.testing.assert_array_equal(pieces[name][0], whole[name][0])
        np.testing.assert_allclose(pieces[name][2], whole[name][2], atol=1e-12)
