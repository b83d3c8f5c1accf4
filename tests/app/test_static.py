"""static: K1 at a load from a table of load and deflection."""

import json
import re

import numpy as np
import pytest


def tangent(load, a=100e3, b=1e6):
    return np.sqrt(a * a + 4 * b * load)


@pytest.fixture
def curve(tmp_path):
    """Three cycles of F = a x + b x² ± 50 N · 4u(1 - u) over 30 mm, written as asked for."""

    def writing(header="deflection [mm],load [N]", scales=(1e3, 1.0), rows=slice(None), order=(0, 1)):
        u = np.concatenate([np.linspace(0, 1, 101), np.linspace(1, 0, 101)[1:-1]])
        side = np.concatenate([np.ones(101), -np.ones(99)])
        x = 0.03 * np.append(np.tile(u, 3), 0.0)
        load = 100e3 * x + 1e6 * x**2 + 50.0 * np.append(np.tile(side * 4 * u * (1 - u), 3), 0.0)
        table = np.stack([scales[0] * x, scales[1] * load], axis=1)[rows][:, order]
        path = tmp_path / "curve.csv"
        path.write_text("\n".join([header, *(",".join(map(repr, map(float, row))) for row in table)]) + "\n")
        return path

    return writing


def test_it_prints_kilonewtons_per_metre_and_the_load_as_asked(run, curve):
    ran = run("static", curve(), "--load", "1 kN")
    assert ran.exit_code == 0
    lines = ran.stdout.splitlines()
    assert lines[0] == "curve.csv at 1 kN"
    k1, secant = tangent(1000.0) / 1e3, (100e3 + tangent(1000.0)) / 2e3
    assert re.fullmatch(rf"tangent K1 +{k1:.1f}0* kN/m; ± is U \(k = 2\)", lines[1])
    assert any(re.fullmatch(rf"secant +{secant:.4g} kN/m", line) for line in lines)
    assert any(re.fullmatch(r"hysteresis loss +2\.00\d* J", line) for line in lines)
    assert any("3 complete cycles" in line for line in lines)
    assert ran.stderr.splitlines() == [
        "understood deflection: column 'deflection' [mm]",
        "understood load: column 'load' [N]",
    ]


def test_json_is_si(run, curve):
    ran = run("static", curve(), "--load", "1 kN", "--json")
    assert (ran.exit_code, ran.stderr) == (0, "")
    said = json.loads(ran.stdout)
    assert said["load [N]"] == 1000.0
    assert said["K1 [N/m]"] == pytest.approx(tangent(1000.0), rel=1e-6)
    assert said["secant [N/m]"] == pytest.approx((100e3 + tangent(1000.0)) / 2, rel=1e-6)
    assert said["hysteresis loss [J]"] == pytest.approx(2 * 50 * (2 / 3) * 0.03, rel=1e-3)
    assert said["cycles [1]"] == 3
    assert said["remarks"] == []
    parts = [said[f"u(K1) from {part} [N/m]"] for part in ("fit", "cycles", "zero")]
    assert said["u(K1) [N/m]"] == pytest.approx(np.linalg.norm(parts))


@pytest.mark.parametrize(
    ("header", "scales", "order"),
    [
        ("x [m],F [kN]", (1.0, 1e-3), (0, 1)),
        ("Fz [lbf],z [in]", (1 / 0.0254, 1 / 4.4482216152605), (1, 0)),
        ("Weg [µm],Kraft [daN]", (1e6, 0.1), (0, 1)),
        ("Deflection (mm),Load (N)", (1e3, 1.0), (0, 1)),
        ("変位 [mm],荷重 [kN]", (1e3, 1e-3), (0, 1)),
    ],
)
def test_columns_are_understood_by_name_and_unit(run, curve, header, scales, order):
    ran = run("static", curve(header, scales, order=order), "--load", "1000 N", "--json")
    assert json.loads(ran.stdout)["K1 [N/m]"] == pytest.approx(tangent(1000.0), rel=1e-6)


def test_unusual_columns_are_named_by_options(run, curve):
    path = curve("gauge 3 [mm],channel 7 [N]")
    lacking = run("static", path, "--load", "1000 N")
    assert (lacking.exit_code, lacking.stdout) == (2, "")
    assert '--column "deflection=NAME [mm]"' in lacking.stderr
    for more in (
        ["--column", "load=channel 7", "--column", "deflection=gauge 3"],
        ["--column", "load=2", "--column", "deflection=gauge 3 [mm]"],
    ):
        ran = run("static", path, "--load", "1000 N", *more, "--json")
        assert json.loads(ran.stdout)["K1 [N/m]"] == pytest.approx(tangent(1000.0), rel=1e-6)


def test_a_wrong_column_is_named_with_those_there_are(run, curve):
    ran = run("static", curve(), "--load", "1000 N", "--column", "load=laod")
    assert ran.exit_code == 2
    assert "there is no column 'laod'; did you mean 'load'?" in ran.stderr


@pytest.mark.parametrize("load", ["4 kN", "3901 N", "-50 N"])
def test_a_load_outside_the_curve_is_refused(run, curve, load):
    ran = run("static", curve(), "--load", load)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert "curve.csv" in ran.stderr
    assert "lies outside the measured loads, 0 to 3900 N: no extrapolation" in ran.stderr


def test_no_load_is_a_load_like_any_other(run, curve):
    ran = run("static", curve(), "--load", "0 N", "--json")
    assert ran.exit_code in (0, 2)
    if ran.exit_code == 0:
        assert json.loads(ran.stdout)["K1 [N/m]"] == pytest.approx(100e3, rel=0.05)


@pytest.mark.parametrize(
    ("load", "said"),
    [
        ("1000", "--load: '1000' has no unit"),
        ("10 mm", "--load: 'mm' is a length; a force is needed"),
        ("much", "--load"),
    ],
)
def test_a_load_that_is_none_is_named_with_its_option(run, curve, load, said):
    ran = run("static", curve(), "--load", load)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in ran.stderr


def test_one_branch_is_a_warning(run, curve):
    ran = run("static", curve(rows=slice(0, 101)), "--load", "1000 N")
    assert ran.exit_code == 0
    assert "warning: K1 is the tangent of the loading branch alone, and K2 and C refer to it: " in ran.stderr
    assert re.search(r"hysteresis loss +none", ran.stdout)


def test_a_curve_that_is_none_is_refused(run, curve):
    for rows, said in ((slice(0, 3), "has 3 points, at least 5 are needed"), (slice(0, 0), "no row")):
        ran = run("static", curve(rows=rows), "--load", "1000 N")
        assert (ran.exit_code, ran.stdout) == (2, "")
        assert said in ran.stderr


def test_lines_that_are_no_data_are_said(run, curve):
    path = curve()
    path.write_text(path.read_text() + "checked by M.\n")
    ran = run("static", path, "--load", "1000 N")
    assert ran.exit_code == 0
    assert "warning: line 603 is not data and was left out: 'checked by M.'" in ran.stderr


def test_soft_things_keep_their_digits(run, curve):
    ran = run("static", curve(scales=(1e3, 1e-3)), "--load", "1 N")
    assert re.search(rf"tangent K1 +{tangent(1000.0) / 1e6:.3g}\d* kN/m", ran.stdout)
