"""Recordings written in every format and read back: the same samples, times and units, by our reader and by others."""

from __future__ import annotations

import warnings
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
KINDS = ("csv", "parquet", "mf4", "tdms", "uff", "mat", "h5", "wav", "tydex")
ENDINGS = {"tydex": ".tdx"}
SIGNALS = {"F1": "N", "V1": "m/s", "x": "µm"}

h5py = pytest.importorskip("h5py")
for library in ("asammdf", "nptdms", "pyuff"):
    pytest.importorskip(library)


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
    out = tmp_path / f"b{ENDINGS.get(kind, f'.{kind}')}"
    made = convert(source, out)
    before, after = read(source), read(out)
    by_name = {bare(name): found for name, found in after.items()}
    for number, name in enumerate(SIGNALS, 1):
        samples, unit, time, _ = by_name[str(number) if kind == "wav" else name]
        if kind == "tydex":
            np.testing.assert_allclose(samples, before[name][0], rtol=5e-13)
        else:
            np.testing.assert_array_equal(samples, before[name][0])
        if kind != "wav":
            assert unit == {"tydex": {"µm": "um"}}.get(kind, {}).get(before[name][1], before[name][1])
        shift = start if kind == "wav" else 0.0
        np.testing.assert_allclose(time, before[name][2] - shift, rtol=0, atol=1e-12)
    assert any("start" in said for said in made.lost) == (kind == "wav" and start != 0)
    assert sorted(tmp_path.iterdir()) == sorted([source, out])


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.sampled(2)
def test_missing_samples_stay_missing(tmp_path, kind):
    samples = noise()
    samples[100:140] = np.nan
    source = recording(tmp_path / "a.h5", samples=samples)
    out = tmp_path / f"b{ENDINGS.get(kind, f'.{kind}')}"
    convert(source, out)
    found = {bare(name): one[0] for name, one in read(out).items()}["1" if kind == "wav" else "V1"]
    np.testing.assert_array_equal(np.isnan(found), np.isnan(samples))


@pytest.mark.parametrize("kind", ["csv", "parquet", "mf4", "tdms", "uff", "mat", "h5", "tydex"])
@pytest.mark.sampled(2)
def test_uneven_times_are_kept(tmp_path, kind):
    time = 3.0 + np.cumsum(np.random.default_rng(3).uniform(0.5e-3, 1.5e-3, COUNT))
    source = recording(tmp_path / "a.h5", time=time)
    out = tmp_path / f"b{ENDINGS.get(kind, f'.{kind}')}"
    made = convert(source, out)
    assert made.groups[0].startswith("5000 samples at uneven times")
    _, _, found, _ = {bare(name): one for name, one in read(out).items()}["F1"]
    np.testing.assert_allclose(found, time, rtol=5e-13 if kind == "tydex" else 0)


def test_a_wav_file_has_no_uneven_times_and_no_broken_rates(tmp_path):
    time = np.cumsum(np.random.default_rng(3).uniform(0.5e-3, 1.5e-3, COUNT))
    with pytest.raises(TableError, match="needs a rate in place of times, and these are not even"):
        convert(recording(tmp_path / "a.h5", time=time), tmp_path / "b.wav")
    with pytest.raises(TableError, match=r"whole number of Hz, not 1000\.5"):
        convert(recording(tmp_path / "c.h5", rate=1000.5), tmp_path / "b.wav")
    assert not (tmp_path / "b.wav").exists()


@pytest.mark.parametrize("rate", [1000.0, 44100.0, 1234.56789, 1 / 3e-4])
def test_a_rate_of_many_digits_is_kept_by_uff(tmp_path, rate):
    out = tmp_path / "b.uff"
    convert(recording(tmp_path / "a.h5", rate=rate, start=0.1234567890123), out)
    np.testing.assert_allclose(read(out)["F1"][2], 0.1234567890123 + np.arange(COUNT) / rate, rtol=1e-15, atol=1e-13)


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


def test_tdms_is_read_by_nptdms(tmp_path):
    import nptdms

    convert(recording(tmp_path / "a.h5", start=0.5), tmp_path / "b.tdms")
    with nptdms.TdmsFile.open(tmp_path / "b.tdms") as file:
        one = file["recording"]["x"]
        assert one.properties["unit_string"] == "µm"
        np.testing.assert_array_equal(one[:], noise(seed=2))
        np.testing.assert_allclose(one.time_track(), 0.5 + np.arange(COUNT) / RATE, atol=1e-12)


@pytest.mark.parametrize("even", [True, False])
def test_uff_is_read_by_pyuff(tmp_path, even):
    import pyuff

    time = 1.0 + np.cumsum(np.random.default_rng(3).uniform(0.5e-3, 1.5e-3, COUNT))
    convert(recording(tmp_path / "a.h5", time=None if even else time), tmp_path / "b.uff")
    sets = pyuff.UFF(str(tmp_path / "b.uff")).read_sets()
    assert [one["id1"].strip() for one in sets] == list(SIGNALS)
    assert [one["ordinate_axis_units_lab"].strip() for one in sets] == list(SIGNALS.values())
    assert [one["ordinate_spec_data_type"] for one in sets] == [13, 11, 8]
    for seed, one in enumerate(sets):
        np.testing.assert_array_equal(one["data"], noise(seed=seed))
        # of the step the header has six digits
        np.testing.assert_allclose(one["x"], np.arange(COUNT) / RATE if even else time, rtol=5e-6 if even else 0)


def test_matlab_is_read_by_scipy(tmp_path):
    from scipy.io import loadmat

    convert(recording(tmp_path / "a.h5", start=2.0), tmp_path / "b.mat")
    found = loadmat(tmp_path / "b.mat", simplify_cells=True)
    np.testing.assert_array_equal(found["F1"], noise(seed=0))
    np.testing.assert_array_equal(found["t"], 2.0 + np.arange(COUNT) / RATE)
    assert list(zip(found["names"], found["units"], strict=True)) == [("t", "s"), *SIGNALS.items()]


def test_hdf5_is_read_by_h5py(tmp_path):
    convert(recording(tmp_path / "a.h5", start=2.0), tmp_path / "b.h5")
    with h5py.File(tmp_path / "b.h5") as file:
        np.testing.assert_array_equal(file["V1"][:], noise(seed=1))
        assert dict(file["V1"].attrs) == {"unit": "m/s", "rate": RATE, "start": 2.0}


def test_wav_is_read_by_scipy(tmp_path):
    from scipy.io import wavfile

    convert(recording(tmp_path / "a.h5"), tmp_path / "b.wav")
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # it warns of a file that ends early, and of what it does not know
        rate, samples = wavfile.read(tmp_path / "b.wav")
    assert rate == RATE
    np.testing.assert_array_equal(samples.T, [noise(seed=seed) for seed in range(3)])
    assert b"1 = F1 [N]; 2 = V1 [m/s]" in (tmp_path / "b.wav").read_bytes()[:300]


def test_tydex_is_what_the_standard_says(tmp_path):
    convert(recording(tmp_path / "a.h5"), tmp_path / "b.tdx")
    lines = (tmp_path / "b.tdx").read_text("ascii").splitlines()
    described = lines[lines.index("**MEASURCHANNELS") + 1 : lines.index("**MEASURDATA")]
    assert [(line[:10].strip(), line[40:50].strip()) for line in described] == [
        ("RUNTIME", "s"),
        ("F1", "N"),
        ("V1", "m/s"),
        ("x", "um"),
    ]
    row = lines[lines.index("**MEASURDATA") + 3].split()
    np.testing.assert_allclose([float(cell) for cell in row[1:]], [noise(seed=s)[2] for s in range(3)], rtol=5e-13)


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


@pytest.mark.parametrize("kind", ["mf4", "tdms", "uff", "mat", "h5"])
def test_groups_and_rates_are_kept_where_the_format_has_them(mixed, tmp_path, kind):
    out = tmp_path / f"out.{kind}"
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
    if kind in ("tdms", "h5"):
        assert set(after) == set(before)


@pytest.mark.parametrize("kind", ["csv", "parquet", "wav", "tydex"])
def test_where_it_has_not_the_groups_are_named(mixed, tmp_path, kind):
    out = tmp_path / f"out{ENDINGS.get(kind, f'.{kind}')}"
    with pytest.raises(TableError) as error:
        convert(mixed, out)
    for said in ("one group and one rate", "warm: 700 samples at 1000 Hz (F1)", "test: 9 samples at 10 Hz (T)"):
        assert said in str(error.value)
    assert "--channels" in str(error.value)
    assert list(tmp_path.iterdir()) == [mixed]
    made = convert(mixed, out, Choice(group="test", channels=("F1", "V1")))
    assert "the name of the group, test, is not kept" in made.lost
    found = {bare(name): one for name, one in read(out).items()}
    np.testing.assert_allclose(found["2" if kind == "wav" else "V1"][0], noise(900, seed=900), rtol=5e-13)


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
    out = tmp_path / f"b{ENDINGS.get(kind, f'.{kind}')}"
    convert(source, out, Choice(window=(0.5, 1.0), channels=("V1",)))
    samples, _, time, _ = {bare(name): one for name, one in read(out).items()}["1" if kind == "wav" else "V1"]
    assert samples.size == 1025  # 0.5 s and both ends
    np.testing.assert_allclose(samples, noise(seed=1)[512:1537], rtol=5e-13)
    np.testing.assert_allclose(time[[0, -1]], [0.0, 0.5] if kind == "wav" else [0.5, 1.0], atol=1e-12)


def test_a_window_of_a_table_with_rounded_times(tmp_path):
    """Times to three decimals of a rate of 1024 Hz: which samples are inside goes by what is written."""
    time = np.round(np.arange(4000) / 512, 4)
    pl.DataFrame({"t [s]": time, "F1 [N]": noise(4000)}).write_csv(tmp_path / "a.csv")
    made = convert(tmp_path / "a.csv", tmp_path / "b.tdms", Choice(window=(1.0, 2.0)))
    samples, _, times, signal = read(tmp_path / "b.tdms")["recording/F1"]
    np.testing.assert_array_equal(samples, noise(4000)[512:1025])
    assert signal.rate == 512.0
    np.testing.assert_allclose(times, np.arange(512, 1025) / 512, atol=1e-12)
    assert made.lost == ("the times are kept as a rate: 512 Hz from 1 s on, up to 5e-05 s off",)


def test_a_window_without_samples_is_told(tmp_path):
    with pytest.raises(TableError, match=r"no samples from 7 to 9 s; the recording runs 0 to 2\.4"):
        convert(recording(tmp_path / "a.h5"), tmp_path / "b.csv", Choice(window=(7.0, 9.0)))
    assert [path.name for path in tmp_path.iterdir()] == ["a.h5"]


@pytest.mark.parametrize("kind", ["mf4", "uff", "wav"])
def test_without_times_what_needs_them_is_refused(tmp_path, kind):
    (tmp_path / "a.csv").write_text("F1 [N],V1 [m/s]\n1,2\n3,4\n5,7\n")
    with pytest.raises(TableError, match=r"write \.csv or \.h5"):
        convert(tmp_path / "a.csv", tmp_path / f"b.{kind}")
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]


@pytest.mark.parametrize("kind", ["csv", "parquet", "tdms", "mat", "h5", "tydex"])
def test_without_times_the_others_hold_the_samples(tmp_path, kind):
    (tmp_path / "a.csv").write_text("F1 [N],V1 [m/s]\n1,2\n3,4\n5,7\n")
    out = tmp_path / f"b{ENDINGS.get(kind, f'.{kind}')}"
    convert(tmp_path / "a.csv", out)
    found = {bare(name): one for name, one in read(out).items()}
    assert set(found) == {"F1", "V1"}
    assert found["V1"][0].tolist() == [2, 4, 7]
    assert found["V1"][2] is None


def test_the_input_and_what_is_there_are_not_overwritten(tmp_path):
    source = recording(tmp_path / "a.h5")
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
    made = convert(tmp_path / "a.h5", tmp_path / f"b{ENDINGS.get(kind, f'.{kind}')}")
    renamed = [said for said in made.lost if "is called" in said]
    assert len(renamed) == {"mat": 2, "tydex": 2}.get(kind, 0)
    found = {bare(name): one[0] for name, one in read(tmp_path / f"b{ENDINGS.get(kind, f'.{kind}')}").items()}
    assert sum(np.allclose(one, noise(50), rtol=5e-13) for one in found.values() if one.size == 50) == 3


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
    ending = ENDINGS.get(kind, f".{kind}")
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
