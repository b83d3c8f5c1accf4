"""predict: the closed form, in a table."""

import csv
import io
import json
import os
import subprocess
import sys

import numpy as np
import pytest

TYRE = ["--k1", "180 kN/m", "--k2", "120 kN/m", "--c", "700 N s/m"]
RIG = ["--mass", "15 kg", "--preload-stiffness", "12.44 kN/m"]
HEADER = ["frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]", "loss factor [1]", "R [m/(N s)]", "I [m/(N s)]", "TR [1]"]


def closed_form(frequency, damping=0.0):
    jw = 2j * np.pi * np.asarray(frequency)
    stiffness = 180e3 + 1.0 / (1.0 / 120e3 + 1.0 / (jw * 700.0))
    impedance = 15.0 * jw + damping + 12440.0 / jw
    mobility = jw / stiffness + 1.0 / impedance
    tr = abs(stiffness / (stiffness + jw * impedance))
    return np.stack(
        [
            jw.imag / (2 * np.pi),
            stiffness.real,
            stiffness.imag,
            stiffness.imag / stiffness.real,
            mobility.real,
            mobility.imag,
            tr,
        ],
        axis=1,
    )


def table_of(text):
    rows = list(csv.reader(io.StringIO(text)))
    assert rows[0] == HEADER
    return np.array(rows[1:], dtype=float)


@pytest.mark.parametrize(
    ("said", "frequencies"),
    [
        ("10:24:0.5 Hz", np.arange(10.0, 24.25, 0.5)),
        ("10,12,14 Hz", [10.0, 12.0, 14.0]),
        ("600:900:60 rpm", [10.0, 11.0, 12.0, 13.0, 14.0, 15.0]),
        ("18 Hz", [18.0]),
    ],
)
def test_the_table_is_the_closed_form(run, said, frequencies):
    ran = run("predict", *TYRE, *RIG, "--frequency", said)
    assert (ran.exit_code, ran.stderr) == (0, "")
    np.testing.assert_allclose(table_of(ran.stdout), closed_form(frequencies), rtol=1e-10)


def test_a_damper_beside_the_preload_spring(run):
    ran = run("predict", *TYRE, *RIG, "--preload-damping", "0.05 N s/mm", "--frequency", "10,17 Hz")
    np.testing.assert_allclose(table_of(ran.stdout), closed_form([10.0, 17.0], damping=50.0), rtol=1e-10)


def test_json_and_a_file_say_the_same(run, tmp_path):
    printed = run("predict", *TYRE, *RIG, "--frequency", "10,12 Hz").stdout
    ran = run("predict", *TYRE, *RIG, "--frequency", "10,12 Hz", "--json", "--out", tmp_path / "p.csv")
    assert ran.exit_code == 0
    assert (tmp_path / "p.csv").read_text() == printed
    rows = json.loads(ran.stdout)["rows"]
    np.testing.assert_array_equal([list(row.values()) for row in rows], table_of(printed))
    assert [list(row) for row in rows] == [HEADER] * 2


def test_what_is_predicted_is_identified(run, tmp_path):
    predicted = table_of(run("predict", *TYRE, *RIG, "--frequency", "10:24:2 Hz").stdout)
    frequency, r, i, tr = predicted[:, [0, 4, 5, 6]].T
    lines = [f"{f!r},{a!r},{b!r}" for f, a, b in zip(frequency.tolist(), r.tolist(), i.tolist(), strict=True)]
    (tmp_path / "bench.csv").write_text("\n".join(["f [Hz],R [m/(N s)],I [m/(N s)]", *lines]) + "\n")
    ran = run("identify", tmp_path / "bench.csv", "--k1", "180 kN/m", *RIG)
    found = list(csv.DictReader(io.StringIO(ran.stdout)))
    for column, true in (("K2 [N/m]", 120e3), ("C [N s/m]", 700.0), ("TR [1]", tr)):
        np.testing.assert_allclose([float(row[column]) for row in found], np.broadcast_to(true, 8), rtol=1e-9)


@pytest.mark.parametrize(
    ("option", "value", "said"),
    [
        ("--k1", "0 N/m", "--k1: '0 N/m' must be positive"),
        ("--k2", "-1 N/m", "--k2: '-1 N/m' must be positive"),
        ("--c", "0 N s/m", "--c: '0 N s/m' must be positive"),
        ("--c", "700", "--c: '700' has no unit"),
        ("--k2", "120 kN", "--k2: 'kN' is a force; a stiffness is needed"),
        ("--mass", "0 kg", "moving_mass is 0 kg"),
        ("--mass", "15 m", "--mass: 'm' is a length; a mass is needed"),
        ("--preload-stiffness", "soft", "--preload-stiffness"),
        ("--frequency", "10:24:0.5", "--frequency"),
        ("--frequency", "24:10:1 Hz", "--frequency"),
        ("--frequency", "0,10 Hz", "--frequency"),
        ("--frequency", "1:1000000:0.001 Hz", "--frequency"),
    ],
)
def test_a_wrong_value_is_named_with_its_option(run, option, value, said):
    arguments = [*TYRE, *RIG, "--frequency", "10 Hz"]
    arguments[arguments.index(option) + 1] = value
    ran = run("predict", *arguments)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in ran.stderr
    assert len(ran.stderr.splitlines()) == 1


@pytest.mark.skipif(os.name != "posix", reason="pipes end in another way elsewhere")
@pytest.mark.sampled(2)
def test_a_reader_that_has_enough_is_no_fault(start):
    """As with `| head -1`: the reader closes the pipe before all is written."""
    process = start("predict", *TYRE, *RIG, "--frequency", "1:1000:0.2 Hz")
    assert process.stdout.readline().startswith("frequency [Hz],")
    process.stdout.close()
    err = process.stderr.read()
    process.stderr.close()
    process.wait(timeout=600)
    assert "Traceback" not in err
    assert "BrokenPipe" not in err
    assert process.returncode in (0, 141)


def test_python_finds_the_command_without_the_script(tmp_path):
    """The entry point is a plain function."""
    code = "import sys; from fourpole.app.cli import main; sys.argv[1:] = ['--version']; main()"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=tmp_path)
    assert done.stdout.startswith("fourpole ")
