"""K1: from which static test, at which load, how sure, and what is said where there is none."""

import numpy as np
import polars as pl
import pytest

pytestmark = pytest.mark.thorough

NOT_KNOWN = ["K1 [N/m]", "u(K1) [N/m]", "K2 [N/m]", "C [N s/m]", "u(K2) [N/m]", "u(C) [N s/m]", "corr(K2,C) [1]"]


def tangent(load, a=100e3, b=1e6):
    """Slope of F = a x + b x² at a load."""
    return np.sqrt(a * a + 4.0 * b * load)


@pytest.fixture
def bench(bench):
    bench.columns = ("pressure [bar]", "preload [N]")
    waves, calls = bench.waves, iter(range(100))

    def later(frequency, **state):
        """The waves of a drive that starts elsewhere, so that no recording is a copy of another."""
        delay = 0.0137 * next(calls)
        return [lambda time, wave=wave: wave(time + delay) for wave in waves(frequency, **state)]

    bench.waves = later
    return bench


def k1_of(study):
    return study.dynamic["K1 [N/m]"].to_list()


def is_without_k1(row, reason):
    """K* and what follows from it are there, K2 and C are not, and the row says why."""
    assert row["verdict"] == "warning"
    assert row["remarks"].startswith("K2 and C are left blank: ")
    assert reason in row["remarks"]
    assert {row[name] for name in NOT_KNOWN} == {None}
    assert all(
        row[name] is not None for name in row if name.startswith(("R ", "I ", "Re ", "Im ", "loss", "TR", "u(TR"))
    )


def test_k1_is_the_tangent_at_the_preload_of_each_test(bench):
    bench.static("S1", "1.7,")
    for name, preload in (("D1", 1000), ("D2", 500), ("D3", 1000)):
        bench.dynamic(name, f"1.7,{preload}")
    study = bench.analyse()
    assert study.static["preload [N]"].to_list() == [500.0, 1000.0]
    assert study.static["K1 [N/m]"].to_list() == pytest.approx([tangent(500.0), tangent(1000.0)], rel=1e-9)
    assert k1_of(study) == pytest.approx([tangent(1000.0), tangent(500.0), tangent(1000.0)], rel=1e-9)
    assert study.static["secant [N/m]"].to_list() == pytest.approx(
        [load / (2 * load / (100e3 + tangent(load))) for load in (500.0, 1000.0)], rel=1e-9
    )
    assert study.counts == {"ok": 4, "warning": 0, "rejected": 0}


def test_a_preload_of_its_own_is_evaluated_too(bench):
    bench.static("S1", "1.7,1500")
    bench.dynamic("D1", "1.7,1000")
    assert bench.analyse().static["preload [N]"].to_list() == [1000.0, 1500.0]


def test_the_loop_is_closed_and_its_area_is_the_loss(bench):
    bench.static("S1", "1.7,1000", gap=50.0)
    (row,) = bench.analyse().static.rows(named=True)
    # two branches, 50 N · 4u(1 - u) off the mean each, over 30 mm
    assert row["hysteresis loss [J]"] == pytest.approx(2 * 50.0 * (2 / 3) * 0.03, rel=1e-3)
    assert row["K1 [N/m]"] == pytest.approx(tangent(1000.0), rel=1e-6)
    # each branch differs from the mean by 50 N · 4u(1 - u) and its slope
    u = 2 * 1000.0 / (100e3 + tangent(1000.0)) / 0.03
    apart = 50.0 * 4 * (1 - 2 * u) / 0.03
    assert row["K1 loading [N/m]"] == pytest.approx(tangent(1000.0) + apart, rel=1e-6)
    assert row["K1 unloading [N/m]"] == pytest.approx(tangent(1000.0) - apart, rel=1e-6)
    assert row["branch gap [N]"] == pytest.approx(2 * 50.0 * 4 * u * (1 - u), rel=1e-6)
    assert row["u(K1) [N/m]"] < 1e-3 * row["K1 [N/m]"]  # the channels are exact, and the gap is no error
    assert (row["K1 of"], row["cycle"], row["time per branch [s]"]) == ("mean", 3, None)
    assert row["verdict"] == "ok"


@pytest.mark.parametrize(("pressure", "same"), [(1.7, True), (1.73, True), (1.67, True), (1.74, False), (1.66, False)])
def test_pressures_within_two_percent_are_the_same(bench, pressure, same):
    bench.static("S1", "1.7,")
    bench.dynamic("D1", f"{pressure},1000")
    study = bench.analyse()
    if same:
        assert k1_of(study) == [pytest.approx(tangent(1000.0))]
    else:
        reason = "no static test of specimen 'bush' at this pressure; static tests of it are at 1.7 bar"
        is_without_k1(study.dynamic.row(0, named=True), reason)
        assert "add one, or state K1 [N/m] in tests.csv" in study.dynamic["remarks"][0]


def test_all_static_tests_within_the_tolerance_are_repeats_whatever_their_order(bench):
    bench.static("S1", "1.70,", a=100e3)
    bench.static("S2", "1.72,", a=104e3)
    bench.dynamic("D1", "1.707,1000")
    mean = tangent(1000.0, a=np.array([100e3, 104e3])).mean()
    assert k1_of(bench.analyse()) == pytest.approx([mean])
    bench.rows.reverse()
    assert k1_of(bench.analyse()) == pytest.approx([mean])


def test_repeats_are_averaged_and_their_spread_is_an_uncertainty(bench):
    bench.static("S1", "1.7,", a=100e3)
    bench.static("S2", "1.7,", a=103e3)
    bench.dynamic("D1", "1.7,1000")
    (row,) = bench.analyse().dynamic.rows(named=True)
    pair = tangent(1000.0, a=np.array([100e3, 103e3]))
    assert row["K1 [N/m]"] == pytest.approx(pair.mean())
    assert row["u(K1) [N/m]"] == pytest.approx(np.ptp(pair) / 2, rel=1e-3)


def test_another_specimen_or_a_blank_pressure_is_another_condition(bench):
    bench.specimens += "[specimens.mount]\n"
    bench.static("S1", "1.7,")
    bench.static("S2", ",")
    bench.dynamic("D1", ",1000")
    bench.dynamic("D2", "1.7,1000")
    bench.dynamic("D3", "1.7,1000")
    bench.rows[-1] = bench.rows[-1].replace(",bush,", ",mount,")
    study = bench.analyse()
    assert k1_of(study) == [pytest.approx(tangent(1000.0)), pytest.approx(tangent(1000.0)), None]
    assert study.static["pressure [Pa]"].to_list() == [pytest.approx(170e3), None]
    is_without_k1(study.dynamic.row(2, named=True), "no static test of specimen 'mount' at this pressure")


def test_k1_of_the_row_comes_before_that_of_a_static_test(bench):
    bench.columns = (*bench.columns, "K1 [kN/m]", "u(K1) [N/m]")
    bench.static("S1", "1.7,,,")
    bench.dynamic("D1", "1.7,1000,110,250")
    bench.dynamic("D2", "1.7,1000,110,")
    bench.dynamic("D3", "1.7,1000,,")
    bench.dynamic("D4", "1.7,1000,110 kN/m,0")
    study = bench.analyse()
    assert k1_of(study) == pytest.approx([110e3, 110e3, tangent(1000.0), 110e3])
    # what is not stated is not zero
    assert study.dynamic["u(K1) [N/m]"].to_list() == [250.0, pytest.approx(2200.0), pytest.approx(0.0, abs=1.0), 0.0]
    assert study.dynamic["K2 [N/m]"][0] == pytest.approx(bench.k2, rel=1e-6)


def test_without_a_static_test_k_star_is_found_all_the_same(bench):
    bench.dynamic("D1", "1.7,1000")
    (row,) = bench.analyse().dynamic.rows(named=True)
    assert row["verdict"] == row["verdict K*"] == "ok"
    assert row["verdict K2 C"] == row["remarks"] == ""
    stiffness = bench.stiffness(14.0)
    assert row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"] == pytest.approx(stiffness, rel=1e-7)


def test_without_a_preload_there_is_no_k1_to_read_off(bench):
    bench.static("S1", "1.7,")
    bench.dynamic("D1", "1.7,")
    study = bench.analyse()
    is_without_k1(study.dynamic.row(0, named=True), "no preload is stated, so K1 cannot be read off the static curve")
    assert study.static["preload [N]"].to_list() == [None]


def test_a_preload_beyond_the_curve_is_not_extrapolated_to(bench):
    bench.static("S1", "1.7,")
    bench.dynamic("D1", "1.7,1000")
    bench.dynamic("D2", "1.7,5000")
    study = bench.analyse()
    assert study.static["verdict"].to_list() == ["ok", "rejected"]
    assert "5000 N lies outside the measured loads, 0 to 3900 N" in study.static["remarks"][1]
    assert "record the static test past the preload" in study.static["remarks"][1]
    assert study.dynamic["verdict"].to_list() == ["ok", "warning"]
    is_without_k1(study.dynamic.row(1, named=True), "no K1 at 5000 N: static test 'S1' was rejected")


SENSORS = {
    "kgf and inches": (
        {"load": 'column = "F", unit = "kgf"', "deflection": 'column = "x", unit = "in"'},
        {"F": lambda f: f / 9.80665, "x": lambda x: x / 25.4},
    ),
    "inverted, with offsets": (
        {
            "load": 'column = "F", unit = "kN", invert = true, offset = "-20 N"',
            "deflection": 'column = "x", unit = "mm", gain = 2, offset = 5.5',
        },
        {"F": lambda f: -1e-3 * f - 0.02, "x": lambda x: x / 2 + 5.5},
    ),
    "volts": (
        {
            "load": 'column = "F", unit = "mV", sensitivity = "2 mV/N"',
            "deflection": 'column = "x", sensitivity = "50 mm/V"',
        },
        {"F": lambda f: 2 * f, "x": lambda x: x / 50.0},
    ),
}


@pytest.mark.parametrize("case", SENSORS)
def test_whatever_the_sensors_of_a_static_test_its_k1_is_the_same(bench, case):
    said, made = SENSORS[case]
    bench.channels |= {role: f"{{ {text}, exact = true }}" for role, text in said.items()}
    bench.static("S1", "1.7,1000", gap=20.0)
    path = bench.path / "recordings" / "S1.csv"
    pl.read_csv(path).with_columns(*(make(pl.col(name)).alias(name) for name, make in made.items())).write_csv(path)
    (row,) = bench.analyse().static.rows(named=True)
    assert row["K1 [N/m]"] == pytest.approx(tangent(1000.0), rel=1e-6)
    assert row["hysteresis loss [J]"] == pytest.approx(2 * 20.0 * (2 / 3) * 0.03, rel=1e-3)


def test_the_gains_of_load_and_deflection_are_uncertain_too(bench):
    bench.channels |= {
        "load": '{ column = "F", unit = "N", exact = true }',
        "deflection": '{ column = "x", unit = "mm", std_gain = "0.5 %" }',
    }
    bench.static("S1", "1.7,1000")
    study = bench.analyse()
    (zero,) = study.notes
    assert zero.startswith("[unstated]")
    assert study.static["u(K1) [N/m]"][0] == pytest.approx(0.005 * tangent(1000.0), rel=1e-3)
    bench.channels["load"] = '{ column = "F", unit = "N" }'
    study = bench.analyse()
    assert study.notes == ("[channels] load: no std_gain stated, taken as 1 % (exact = true if exact)", zero)
    # a gain g of the load: g F = a g x + b g x², whose tangent at a load P is g·K1 at P/g
    by_gain = (1.01 * tangent(1000.0 / 1.01) - 0.99 * tangent(1000.0 / 0.99)) / 0.02
    expected = np.hypot(0.005 * tangent(1000.0), 0.01 * by_gain)
    assert study.static["u(K1) [N/m]"][0] == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("keys", [("0.1 %", "0.3 %"), ("0.1 %", None), (None, None)])
def test_the_linearity_of_load_and_deflection_reaches_k2_and_c(bench, keys):
    """Beside the gains, which have 1 %; with [unstated] ordinary = "zero" one that is not stated is none."""
    for role, column, unit, key in zip(("load", "deflection"), ("F", "x"), ("N", "mm"), keys, strict=True):
        more = f', linearity = "{key}"' if key else ""
        bench.channels[role] = f'{{ column = "{column}", unit = "{unit}", std_gain = "1 %"{more} }}'
    bench.static("S1", "1.7,")
    bench.dynamic("D1", "1.7,1000")
    study = bench.analyse()
    sizes = [float(key[:-2]) / 100 if key else 0.0 for key in keys]
    expected = np.pi * np.hypot(*sizes) * tangent(1000.0)
    budget = {(row["source"], row["quantity"]): row["u"] for row in study.budget.iter_rows(named=True)}
    assert (("K1 linearity", "K2") in budget) == any(sizes)
    parts = [name for name in ("K1 fit", "K1 cycles", "K1 zero", "K1 gains", "K1 linearity") if (name, "K2") in budget]
    for quantity in ("K2", "C"):
        whole = np.linalg.norm([budget[name, quantity] for name in parts])
        share = budget.get(("K1 linearity", quantity), 0.0) / whole
        assert share == pytest.approx(expected / study.dynamic["u(K1) [N/m]"][0], rel=1e-6)
        assert budget["K1 gains", quantity] > 0.0
    assert ("K1 linearity", "Re K*") not in budget or budget["K1 linearity", "Re K*"] == 0.0


def test_a_curve_of_one_branch_is_used_with_a_warning(bench):
    bench.static("S1", "1.7,", gap=50.0)
    bench.dynamic("D1", "1.7,1000")
    path = bench.path / "recordings" / "S1.csv"
    pl.read_csv(path).head(101).write_csv(path)
    study = bench.analyse()
    (row,) = study.static.rows(named=True)
    assert row["verdict"] == "warning"
    assert "K1 is the tangent of the loading branch alone, and K2 and C refer to it: record" in row["remarks"]
    assert (row["hysteresis loss [J]"], row["K1 unloading [N/m]"], row["cycle"]) == (None, None, None)
    assert k1_of(study) == [row["K1 [N/m]"]]
    (used,) = study.dynamic.rows(named=True)
    assert used["verdict"] == "warning"
    assert "K1 from S1 is the tangent of the loading branch alone, and K2 and C refer to it: " in used["remarks"]
    checks = study.checks.filter(pl.col("test") == "D1", pl.col("code") == "K1 of one branch")
    assert checks["remedy"].to_list() == [
        "record complete cycles of loading and unloading, or state K1 [N/m] in tests.csv"
    ]


def test_k1_of_one_branch_is_the_tangent_of_that_branch(bench):
    """F = a x + b x² + 50 N · 4u(1 - u) loads alone: its tangent, which is 4 % above that of the mean."""
    bench.static("S1", "1.7,", gap=50.0)
    bench.dynamic("D1", "1.7,1000")
    path = bench.path / "recordings" / "S1.csv"
    pl.read_csv(path).head(101).write_csv(path)
    (row,) = bench.analyse().static.rows(named=True)
    a, b = 100e3 + 200.0 / 0.03, 1e6 - 200.0 / 0.03**2
    assert row["K1 of"] == "loading"
    assert row["K1 [N/m]"] == row["K1 loading [N/m]"] == pytest.approx(tangent(1000.0, a, b), rel=1e-6)


def test_a_doubtful_k1_is_said_where_it_is_used(bench):
    bench.static("S1", "1.7,", gap=50.0)
    bench.dynamic("D1", "1.7,1000")
    path = bench.path / "recordings" / "S1.csv"
    pl.read_csv(path).head(101).write_csv(path)
    assert "S1" in bench.analyse().dynamic["remarks"][0]


@pytest.mark.parametrize(("offset", "said"), [(0.0, False), (-10.0, False), (500.0, True), (-200.0, True)])
def test_a_load_before_contact_that_is_not_zero_is_a_warning(bench, offset, said):
    """10 mm of free travel before the curve: there the load cell shows its zero."""
    bench.static("S1", "1.7,", gap=50.0)
    bench.dynamic("D1", "1.7,1000")
    path = bench.path / "recordings" / "S1.csv"
    table = pl.read_csv(path)
    load, deflection = "F", "x"
    free = [np.linspace(-10.0, -0.1, 40), np.linspace(-0.1, -10.0, 40)]
    pl.DataFrame(
        {
            load: np.concatenate([np.zeros(40), table[load].to_numpy(), np.zeros(40)]) + offset,
            deflection: np.concatenate([free[0], table[deflection].to_numpy(), free[1]]),
        }
    ).write_csv(path)
    study = bench.analyse()
    (row,) = study.static.rows(named=True)
    found = study.checks.filter(pl.col("test") == "S1", pl.col("code") == "zero of the load")
    assert len(found) == int(said)
    assert row["verdict"] == ("warning" if said else "ok")
    assert ("the load before contact is" in study.dynamic["remarks"][0]) == said
    if said:
        assert found["limit"].to_list() == [0.01]
        # K1 was read at a load that is off by the offset
        assert abs(row["K1 [N/m]"] - tangent(1000.0)) < 2.0 * row["u(K1) [N/m]"]


def test_an_uncertainty_of_k1_that_is_assumed_is_noted(bench):
    bench.columns = (*bench.columns, "K1 [N/m]")
    bench.dynamic("D1", "1.7,1000,110000")
    study = bench.analyse()
    assert any("K1" in text and "2 %" in text for text in (*study.notes, *study.dynamic["remarks"]))


def test_a_curve_that_does_not_reach_zero_load_has_no_secant(bench):
    bench.static("S1", "1.7,1000", gap=20.0)
    path = bench.path / "recordings" / "S1.csv"
    pl.read_csv(path).filter(pl.col("F") > 400.0).write_csv(path)
    (row,) = bench.analyse().static.rows(named=True)
    assert row["secant [N/m]"] is None
    assert "no secant: the curve starts at" in row["remarks"]
    assert row["K1 [N/m]"] == pytest.approx(tangent(1000.0), rel=1e-6)


def test_a_window_of_a_static_test_is_heeded(bench):
    bench.columns = (*bench.columns, "window [s]")
    bench.static("S1", "1.7,1000,0..4")
    path = bench.path / "recordings" / "S1.csv"
    # cycles of 2 s, and in the third one the amplifier was set to another range
    table = pl.read_csv(path).with_row_index("t").with_columns(t=0.01 * pl.col("t"))
    table.with_columns(F=pl.col("F") * pl.when(pl.col("t") > 4.0).then(1.3).otherwise(1.0)).write_csv(path)
    (row,) = bench.analyse().static.rows(named=True)
    assert row["K1 [N/m]"] == pytest.approx(tangent(1000.0), rel=1e-6)


STATIC_HURTS = {
    "missing": (lambda path: path.unlink(), "recordings/S1.csv: there is no such file; check its name"),
    "empty": (lambda path: path.write_bytes(b""), "recordings/S1.csv: is empty"),
    "header only": (lambda path: path.write_text("x,F\n"), "has a header (line 1) but no row below it"),
    "no load": (lambda path: path.write_text("x,G\n1,2\n2,3\n"), "there is no column 'F'"),
    "text": (
        lambda path: path.write_text("x,F\n1,2\n2,over\n"),
        "recordings/S1.csv row 3, column 'F': 'over' is no number",
    ),
    "few points": (lambda path: path.write_text("x,F\n1,2\n2,3\n"), "the curve has 2 points, at least 5 are needed"),
    "no number": (lambda path: path.write_text("x,F\n" + "1,\n" * 50), "has 0 points"),
    "constant load": (
        lambda path: pl.read_csv(path).with_columns(F=pl.lit(3.0)).write_csv(path),
        "load or deflection does not change: a sensor was off, or another column is meant",
    ),
    "constant deflection": (
        lambda path: pl.read_csv(path).with_columns(x=pl.lit(3.0)).write_csv(path),
        "load or deflection does not change: a sensor was off, or another column is meant",
    ),
    "inverted": (
        lambda path: pl.read_csv(path).with_columns(F=-pl.col("F")).write_csv(path),
        "one of the channels is inverted (state invert = true)",
    ),
    "folder": (lambda path: (path.unlink(), path.mkdir()), "recordings/S1.csv: is a folder"),
    "binary": (lambda path: path.write_bytes(b"\x00\x01" * 99), "is binary, not text; export it as CSV"),
}


@pytest.mark.parametrize("hurt", STATIC_HURTS)
@pytest.mark.sampled(2)
def test_a_static_test_that_cannot_be_used_is_a_row_and_the_others_go_on(bench, hurt):
    make, remark = STATIC_HURTS[hurt]
    bench.static("S1", "1.7,")
    bench.static("S2", "2.4,", a=120e3)
    bench.dynamic("D1", "1.7,1000")
    bench.dynamic("D2", "2.4,1000")
    make(bench.path / "recordings" / "S1.csv")
    study = bench.analyse()
    assert study.static["verdict"].to_list() == ["rejected", "ok"]
    assert remark in study.static["remarks"][0]
    assert study.static["K1 [N/m]"].to_list() == [None, pytest.approx(tangent(1000.0, a=120e3))]
    is_without_k1(study.dynamic.row(0, named=True), "no K1 at 1000 N: static test 'S1' was rejected: ")
    assert remark in study.dynamic["remarks"][0]
    assert k1_of(study)[1] == pytest.approx(tangent(1000.0, a=120e3))


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_trigger_signal_in_place_of_a_curve_does_not_stop_the_others(bench):
    bench.static("S1", "1.7,")
    bench.static("S2", "2.4,", a=120e3)
    bench.dynamic("D1", "1.7,1000")
    bench.dynamic("D2", "2.4,1000")
    on = np.random.default_rng(0).integers(0, 2, 4000).astype(float)
    bench.record("S1", {"x": on, "F": on})
    study = bench.analyse()
    assert study.static["verdict"].to_list() == ["rejected", "ok"]
    assert k1_of(study) == [None, pytest.approx(tangent(1000.0, a=120e3))]


@pytest.fixture
def warm(bench):
    bench.columns = (*bench.columns, "temperature [degC]")
    return bench


def test_each_test_takes_k1_at_its_own_temperature(warm):
    for name, cells, a in (("S1", "1.7,,20", 104e3), ("S2", "1.7,,21", 105e3), ("S3", "1.7,,60", 100e3)):
        warm.static(name, cells, a=a)
    for name, degrees in (("D1", 20), ("D2", 60), ("D3", 62)):
        warm.dynamic(name, f"1.7,1000,{degrees}")
    study = warm.analyse()
    cold, hot = tangent(1000.0, a=np.array([104e3, 105e3])).mean(), tangent(1000.0, a=100e3)
    assert k1_of(study) == pytest.approx([cold, hot, hot])
    assert not any("K1" in remark for remark in study.dynamic["remarks"])
    assert study.static["temperature [degC]"].to_list() == [20.0, 21.0, 60.0]


@pytest.mark.parametrize(("degrees", "same"), [(24.99, True), (25.01, False), (15.01, True), (14.99, False)])
def test_beyond_five_kelvin_the_nearest_k1_is_taken_with_a_warning(warm, degrees, same):
    warm.static("S1", "1.7,,20", a=104e3)
    warm.static("S2", "1.7,,-20", a=96e3)
    warm.dynamic("D1", f"1.7,1000,{degrees}")
    (row,) = warm.analyse().dynamic.rows(named=True)
    assert row["K1 [N/m]"] == pytest.approx(tangent(1000.0, a=104e3))
    if same:
        assert "K1" not in row["remarks"]
    else:
        side = "below" if degrees > 20 else "above"
        assert row["verdict"] == "warning"
        assert f"K1 is that of S1 at 20 °C, 5.01 K {side} this test: add a static test at" in row["remarks"]


def test_repeats_nearest_in_temperature_are_all_averaged(warm):
    warm.static("S1", "1.7,,20", a=104e3)
    warm.static("S2", "1.7,,22", a=105e3)
    warm.dynamic("D1", "1.7,1000,61")
    (row,) = warm.analyse().dynamic.rows(named=True)
    assert row["K1 [N/m]"] == pytest.approx(tangent(1000.0, a=np.array([104e3, 105e3])).mean())
    assert "K1 is that of S1, S2 at 21 °C, 40 K below this test" in row["remarks"]


@pytest.mark.parametrize(("static", "dynamic", "side"), [("", "20", "this test"), ("20", "", "the static test")])
def test_a_temperature_that_one_side_states_is_the_same_with_a_remark(warm, static, dynamic, side):
    warm.static("S1", f"1.7,,{static}")
    warm.dynamic("D1", f"1.7,1000,{dynamic}")
    (row,) = warm.analyse().dynamic.rows(named=True)
    assert row["K1 [N/m]"] == pytest.approx(tangent(1000.0))
    assert f"K1 from S1: the temperature is stated of {side} only and taken as the same" in row["remarks"]


def test_a_blank_pressure_is_the_same_for_k1_with_a_remark(bench):
    bench.static("S1", ",")
    bench.dynamic("D1", "1.7,1000")
    (row,) = bench.analyse().dynamic.rows(named=True)
    assert row["K1 [N/m]"] == pytest.approx(tangent(1000.0))
    assert "the pressure is stated of this test only" in row["remarks"]


def test_who_states_the_temperature_comes_before_who_does_not(warm):
    warm.static("S1", "1.7,,", a=100e3)
    warm.static("S2", "1.7,,20", a=104e3)
    warm.dynamic("D1", "1.7,1000,20")
    warm.dynamic("D2", "1.7,1000,60")
    study = warm.analyse()
    assert k1_of(study) == pytest.approx([tangent(1000.0, a=104e3), tangent(1000.0, a=100e3)])


def test_a_blank_temperature_between_two_that_differ_is_a_warning(warm):
    warm.static("S1", "1.7,,20", a=104e3)
    warm.static("S2", "1.7,,60", a=100e3)
    warm.dynamic("D1", "1.7,1000,")
    (row,) = warm.analyse().dynamic.rows(named=True)
    assert row["verdict"] == "warning"
    assert "K1 is the mean of static tests that differ in temperature: state that of this test, or" in row["remarks"]


def test_static_tests_on_both_sides_of_a_pressure_that_differ_are_a_warning(bench):
    """1.70 and 1.76 bar are each within 2 % of 1.73 bar, but not of each other."""
    bench.static("S1", "1.70,", a=104e3)
    bench.static("S2", "1.76,", a=100e3)
    bench.dynamic("D1", "1.73,1000")
    (row,) = bench.analyse().dynamic.rows(named=True)
    assert row["verdict"] == "warning"
    assert "K1 is the mean of static tests that differ in pressure" in row["remarks"]


def test_k1_is_that_of_the_same_batch_and_an_axis_of_dynamic_tests_alone_does_not_matter(bench):
    bench.columns = (*bench.columns, "batch", "amplitude [mm]")
    bench.specimens += '[conditions]\naxes = ["batch", { column = "amplitude [mm]", relative = "5 %" }]\n'
    bench.static("S1", "1.7,,A,", a=100e3)
    bench.static("S2", "1.7,,B,", a=120e3)
    for name, batch in (("D1", "A"), ("D2", "B"), ("D3", "C")):
        bench.dynamic(name, f"1.7,1000,{batch},0.5")
    study = bench.analyse()
    assert k1_of(study) == [pytest.approx(tangent(1000.0)), pytest.approx(tangent(1000.0, a=120e3)), None]
    assert not any("amplitude" in remark for remark in study.dynamic["remarks"][:2])
    is_without_k1(study.dynamic.row(2, named=True), "no static test of specimen 'bush' at this pressure, batch")
    assert study.static["batch"].to_list() == ["A", "B"]
    assert "amplitude [mm]" not in study.static.columns
