"""The library in C and numpy give the same: on recordings, on random fits and tables, whatever the order in memory."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from fourpole.campaign import read_campaign
from fourpole.core import kernel
from fourpole.core.demodulation.demodulate import demodulate
from fourpole.core.recording import Channel, Recording
from fourpole.io.kernel import filled_by, place
from fourpole.study.reduce import demodulated, jobs_of
from fourpole.virtual import simulate_campaign

ROOT = Path(__file__).resolve().parents[2]
FUZZ = [sys.executable, str(ROOT / "fuzz" / "fuzz_kernel.py"), "--seconds"]
pytestmark = pytest.mark.usefixtures("library")


def by_both(make):
    """What a function gives with numpy, and with the library."""
    found = []
    for filling in ("numpy", "c"):
        with filled_by(filling):
            assert (kernel.library() is None) == (filling == "numpy")
            found.append(make())
    return found


def assert_same(one, other):
    """Amplitudes within 1e-5 u and the round-off of a signal without noise, statistics of checks within 1e-9."""
    assert [(check.code, check.channel, check.verdict) for check in one.checks] == [
        (check.code, check.channel, check.verdict) for check in other.checks
    ]
    for check, again in zip(one.checks, other.checks, strict=True):
        np.testing.assert_allclose(again.statistic, check.statistic, rtol=1e-9, atol=1e-12)
    if one.found is None:
        return
    was, now = one.found.phasors, other.found.phasors
    u = np.hypot(was.std[..., 0::2], was.std[..., 1::2])
    apart, size = np.abs(now.amplitudes - was.amplitudes), np.abs(was.amplitudes)
    assert np.all((apart <= 1e-5 * u + 1e-11 * size) | np.isnan(size))
    np.testing.assert_allclose(now.frequency, was.frequency, rtol=1e-10)
    for name in ("distortion", "noise_ratio", "changes"):
        if hasattr(one.found, name):
            np.testing.assert_allclose(getattr(other.found, name), getattr(one.found, name), rtol=1e-8, atol=1e-9)


@pytest.mark.parametrize("clean", [False, True])
def test_recordings_of_a_campaign(clean, tmp_path):
    """As a laboratory leaves them, and with the physics alone."""
    campaign = read_campaign(simulate_campaign(tmp_path, clean=clean, preloads=[1000.0], pressures=[170e3]).folder)
    for job in jobs_of(campaign, campaign.of_kind("dynamic"), "joint"):
        assert_same(*by_both(lambda job=job: demodulated([job])[0]))


def signals(count=2000, rate=500.0):
    time = np.arange(count) / rate
    rng = np.random.default_rng(1)
    waves = [np.cos(2 * np.pi * 11.3 * time + k) + 0.1 * np.cos(2 * np.pi * 50 * time) for k in range(3)]
    return time, np.array(waves) + 0.01 * rng.standard_normal((3, count))


@pytest.mark.parametrize(
    "order",
    {
        "strided": lambda rows: np.repeat(rows, 3, axis=1)[:, ::3],
        "reversed": lambda rows: rows[:, ::-1].copy()[:, ::-1],
        "columns": np.asfortranarray,
        "single": lambda rows: rows.astype(np.float32).astype(float),
        "float32": lambda rows: rows.astype(np.float32),
        "big-endian": lambda rows: rows.astype(">f8"),
    }.items(),
    ids=lambda item: item[0],
)
def test_any_order_and_precision_of_the_samples(order):
    _, rows = signals()
    rows, roles = order[1](rows), ("force_in", "motion_in", "motion_out")
    plain = np.array(rows, dtype=float, order="C")

    def found(rows):
        quantities = ("force", "velocity", "velocity")
        channels = {role: Channel(row, what) for role, row, what in zip(roles, rows, quantities, strict=True)}
        return demodulate(Recording(500.0, channels)).phasors.amplitudes

    by_numpy, by_library = by_both(lambda: found(rows))
    np.testing.assert_allclose(by_library, by_numpy, rtol=1e-12)
    np.testing.assert_allclose(by_library, found(plain), rtol=1e-12)


@pytest.mark.parametrize("kind", ["<f4", ">f8", "<i4", "|b1", "<c8"])
def test_structures_hold_contiguous_arrays_of_double_precision(kind):
    array = np.arange(24).astype(kind).reshape(4, 6)[::-2, ::2].T
    held = kernel.Layout(1, 2, 3, array).held[3]
    assert held.flags.c_contiguous
    assert held.dtype in (np.dtype(float), np.dtype(complex), np.dtype(np.int64))
    np.testing.assert_array_equal(held, array)
    assert kernel.Layout(1, 2, 3, held).held[3] is held


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("1;2\n3;4\n", [[1.0, 3.0], [2.0, 4.0]]),
        ("-1.5e-3;+2.\n.5;1E5", [[-1.5e-3, 0.5], [2.0, 1e5]]),
        ("9007199254740991e22;1e-22\n", [[9007199254740991e22], [1e-22]]),
        ("", [[], []]),
        ("9007199254740993;1\n", None),
        ("1e23;1\n", None),
        ("1;\n", None),
        ("1;nan\n", None),
        ("1\n", None),
        ("1;2;3\n", None),
        ("\n", None),
        ("1;2 \n", None),
        ("1;2\r", None),
        ("1;0x1\n", None),
        ("1;1e\n", None),
        ("1;12345678901234567890\n", None),
    ],
)
def test_cells(text, found):
    cells = kernel.cells(text.encode(), ";", b"\n", ".", [0, 1], 2)
    if found is None:
        assert cells is None
    else:
        np.testing.assert_array_equal(cells, np.array(found))


def test_columns_that_are_not_wanted_may_hold_anything_and_lines_end_as_they_do():
    np.testing.assert_array_equal(kernel.cells(b"a,1.5,\r\n,2.5,x y\r\n", ",", b"\n", ".", [1], 3), [[1.5, 2.5]])
    np.testing.assert_array_equal(
        kernel.cells(b"7\t1,5\r8\t2,5\r", "\t", b"\r", ",", [0, 1], 2), [[7.0, 8.0], [1.5, 2.5]]
    )


def test_random_fits_and_tables():
    subprocess.run([*FUZZ, "3"], check=True, capture_output=True, text=True)


@pytest.mark.sampled(2)
@pytest.mark.skipif(not sys.platform.startswith("linux") or shutil.which("gcc") is None, reason="needs gcc on Linux")
def test_random_fits_and_tables_with_sanitisers(tmp_path):
    """Memory beside an array, and what C does not define, end the process."""
    made = tmp_path / "kernel.so"
    flags = ["-O1", "-g", "-fPIC", "-shared", "-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    subprocess.run(["gcc", *flags, "-o", made, ROOT / "src/fourpole/core/kernel.c", "-lm"], check=True)
    libraries = [
        subprocess.run(
            ["gcc", f"-print-file-name=lib{name}.so"], check=True, capture_output=True, text=True
        ).stdout.strip()
        for name in ("asan", "ubsan")
    ]
    if not all(map(os.path.isabs, libraries)):
        pytest.skip("gcc has no sanitisers")
    environment = os.environ | {"LD_PRELOAD": " ".join(libraries), "ASAN_OPTIONS": "detect_leaks=0"}
    subprocess.run([*FUZZ, "3", "--library", made], check=True, env=environment, capture_output=True, text=True)


def test_the_library_is_found_by_its_source(monkeypatch, tmp_path):
    monkeypatch.setattr("fourpole.io.kernel._SOURCE", str(tmp_path / "kernel.c"))
    (tmp_path / "kernel.c").write_text("one", encoding="utf-8")
    first = place()
    (tmp_path / "kernel.c").write_text("another", encoding="utf-8")
    assert place() != first
