"""What sensors and filters do to an amplitude: declared, the same tyre is found; undeclared, what it costs."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from fourpole.errors import CampaignError

F = 14.0
CORNER = 0.5


def lead(frequency, corner=CORNER):
    """A first-order high-pass, written from its differential equation: tau y' + y = tau x'."""
    turn = 2j * np.pi * frequency / (2 * np.pi * corner)
    return turn / (1 + turn)


def seen(wave, factor):
    return replace(wave, amplitude=wave.amplitude * factor)


#: What [channels] adds to a role, and what its sensor makes of the wave at F.
CHAINS = {
    "high-pass": ("motion_in", 'high_pass = { corner = "0.5 Hz", order = 1 }', lead(F)),
    "high-pass in short": ("motion_in", 'high_pass = "0.5 Hz"', lead(F)),
    "two high-passes as one of second order": (
        "motion_out",
        'high_pass = { corner = "2 Hz", order = 2 }',
        # s² / (s² + sqrt2 s + 1), s = j f/fc: the Butterworth polynomial of second order as books print it
        (1j * F / 2.0) ** 2 / ((1j * F / 2.0) ** 2 + np.sqrt(2) * (1j * F / 2.0) + 1),
    ),
    "low-pass": (
        "force_in",
        'low_pass = { corner = "100 Hz", order = 3 }',
        # 1 / ((s + 1)(s² + s + 1))
        1 / ((1j * F / 100 + 1) * ((1j * F / 100) ** 2 + 1j * F / 100 + 1)),
    ),
    "geophone": (
        "motion_in",
        'geophone = { natural_frequency = "4.5 Hz", damping = 0.56 }',
        F**2 / (F**2 - 4.5**2 - 2j * 0.56 * 4.5 * F),
    ),
    "all at once": (
        "motion_in",
        'high_pass = "0.5 Hz", low_pass = "200 Hz", delay = "0.3 ms", response = "cal.csv"',
        lead(F) / (1 + 1j * F / 200) * np.exp(-2j * np.pi * F * 0.3e-3) * 0.97 * np.exp(1j * np.radians(-1.5)),
    ),
    "calibrated response": ("force_in", 'response = "cal.csv"', 0.97 * np.exp(1j * np.radians(-1.5))),
}
#: Straight between 10 and 20 Hz: at 14 Hz gain 0.97 and phase -1.5 degrees.
RESPONSE = "frequency [Hz];gain [1];phase [deg];u(gain) [%];u(phase) [deg]\n10;0,95;-0,5;0,2;0,1\n20;1,0;-3,0;0,4;0,2\n"


def with_chain(bench, case):
    role, said, factor = CHAINS[case]
    if "response" in said:
        (bench.path / "cal.csv").write_text(RESPONSE)
    f1, v1, v2 = bench.waves(F)
    waves = {"force_in": f1, "motion_in": v1, "motion_out": v2}
    waves[role] = seen(waves[role], factor)
    columns = dict(zip(("F1", "V1", "V2"), (wave(bench.time) for wave in waves.values()), strict=True))
    bench.row("D1", bench.record("D1", {"t": bench.time, **columns}), "1000,110000")
    plain = bench.channels[role]
    bench.channels[role] = plain.replace(" }", f", {said} }}")
    return plain, role


@pytest.mark.parametrize("case", CHAINS)
def test_what_a_sensor_does_is_undone_where_it_is_declared(bench, case):
    with_chain(bench, case)
    study = bench.analyse(route="relative")
    (row,) = study.dynamic.rows(named=True)
    assert row["verdict"] == "ok", row["remarks"]
    assert row["K2 [N/m]"] == pytest.approx(bench.k2, rel=1e-8)
    assert row["C [N s/m]"] == pytest.approx(bench.c, rel=1e-8)
    said = study.corrections.filter(pl.col("channel") == {"force": "F1", "in": "V1", "out": "V2"}[_short(case)])
    product = np.prod(said["gain [1]"].to_numpy() * np.exp(1j * said["phase [rad]"].to_numpy()))
    assert product == pytest.approx(CHAINS[case][2], rel=1e-12)


def _short(case):
    role = CHAINS[case][0]
    return "force" if role == "force_in" else role.partition("_")[2]


def test_an_undeclared_high_pass_costs_what_the_exact_model_says(bench):
    """K* by the mobility route from a mobility that is wrong by the filter's factor."""
    plain, role = with_chain(bench, "high-pass")
    bench.channels[role] = plain
    row = bench.found(route="mobility")
    f1, v1, _ = bench.waves(F)
    jw, beyond = 2j * np.pi * F, 1.0 / (2j * np.pi * F * 15.0 + bench.c3 + bench.k3 / (2j * np.pi * F))
    wrong = jw / (v1.amplitude * lead(F) / f1.amplitude - beyond)
    assert row["Re K* [N/m]"] == pytest.approx(wrong.real, rel=1e-8)
    assert row["Im K* [N/m]"] == pytest.approx(wrong.imag, rel=1e-8)
    assert abs(wrong / bench.stiffness(F) - 1) > 0.01  # two degrees of phase are no small thing


@pytest.mark.parametrize("route", ["mobility", "relative", "joint"])
def test_what_a_calibration_leaves_unknown_is_in_the_uncertainty(bench, route):
    """u(gain) 0.28 %, u(phase) 0.14° of F1 at 14 Hz, all else exact: K* by the relative route is proportional to F1."""
    with_chain(bench, "calibrated response")
    study = bench.analyse(route=route)
    (row,) = study.dynamic.rows(named=True)
    gain, phase = 0.0028, np.radians(0.14)
    if route == "relative":
        size = abs(complex(row["Re K* [N/m]"], row["Im K* [N/m]"]))
        found = np.hypot(row["u(Re K*) [N/m]"], row["u(Im K*) [N/m]"])
        assert found == pytest.approx(size * np.hypot(gain, phase), rel=1e-6)
    sources = set(study.budget["source"])
    assert {"response gain F1", "response phase F1"} <= sources


def test_a_delay_that_is_not_known_turns_the_phase_by_omega(bench):
    bench.dynamic("D1")
    bench.channels["force_in"] = (
        '{ column = "F1", unit = "N", std_gain = 0, std_phase = "0 deg", std_delay = "0.1 ms" }'
    )
    row = bench.found(route="relative")
    size = abs(complex(row["Re K* [N/m]"], row["Im K* [N/m]"]))
    found = np.hypot(row["u(Re K*) [N/m]"], row["u(Im K*) [N/m]"])
    assert found == pytest.approx(size * 2 * np.pi * F * 1e-4, rel=1e-6)


@pytest.mark.parametrize(
    ("role", "said", "mixed"),
    [
        ("force_in", 'crosstalk = { motion_in = "0.3 N/(m/s2)" }', lambda f1, v1, v2, jw: (f1 + 0.3 * jw * v1, v1, v2)),
        ("force_in", 'crosstalk = { motion_out = "0.3 kg" }', lambda f1, v1, v2, jw: (f1 + 0.3 * jw * v2, v1, v2)),
        ("motion_out", 'crosstalk = { motion_in = "2 %" }', lambda f1, v1, v2, jw: (f1, v1, v2 + 0.02 * v1)),
        (
            "motion_out",
            'crosstalk = { motion_in = "2 %", force_in = "-1e-5 (m/s)/N" }',
            lambda f1, v1, v2, jw: (f1, v1, v2 + 0.02 * v1 - 1e-5 * f1),
        ),
    ],
)
def test_declared_crosstalk_is_taken_out(bench, role, said, mixed):
    waves = bench.waves(F)
    amplitudes = mixed(*(wave.amplitude for wave in waves), 2j * np.pi * F)
    shown = [replace(wave, amplitude=a)(bench.time) for wave, a in zip(waves, amplitudes, strict=True)]
    columns = dict(zip(("F1", "V1", "V2"), shown, strict=True))
    bench.row("D1", bench.record("D1", {"t": bench.time, **columns}), "1000,110000")
    bench.channels[role] = bench.channels[role].replace(" }", f", {said} }}")
    row = bench.found(route="relative")
    assert row["K2 [N/m]"] == pytest.approx(bench.k2, rel=1e-8)
    assert row["C [N s/m]"] == pytest.approx(bench.c, rel=1e-8)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("frequency [Hz],gain [1]\n10,1\n20,1\n", "column 'phase' is missing"),
        ("frequency [Hz],gain [1],phase [deg]\n20,1,0\n10,1,0\n", "must be positive and rise"),
        ("frequency [Hz],gain [1],phase [deg]\n20,1,0\n30,1,0\n", "is known from 20 to 30 Hz, the test is at 14 Hz"),
        ("frequency [Hz],gain [1],phase [kg]\n10,1,0\n30,1,0\n", "column 'phase'"),
        ("frequency [Hz],gain [1],phase\n10,1,0\n30,1,0\n", "has no unit: write 'phase [rad]'"),
        ("frequency [Hz],gain [1],phase [deg]\n10,0,0\n30,1,0\n", "gains must be positive"),
        ("frequency [Hz],gain [1],phase [deg],u(gian) [%]\n10,1,0,1\n30,1,0,1\n", "did you mean 'u(gain)'"),
        ("frequency [Hz],gain [1],phase [deg],u(gain) [%]\n10,1,0,-5\n30,1,0,1\n", "negative uncertainty"),
    ],
)
def test_a_response_that_is_no_use_is_told(bench, text, said):
    with_chain(bench, "calibrated response")
    (bench.path / "cal.csv").write_text(text)
    row = bench.found(route="relative")
    assert row["verdict"] == "rejected"
    assert said in row["remarks"]


@pytest.mark.parametrize(
    ("name", "said"), [("../cal.csv", "outside the campaign"), ("none.csv", "there is no such file")]
)
def test_a_response_elsewhere_is_told(bench, name, said):
    bench.dynamic("D1")
    bench.channels["force_in"] = f'{{ column = "F1", unit = "N", response = "{name}" }}'
    row = bench.found(route="relative")
    assert row["verdict"] == "rejected"
    assert said in row["remarks"]


def test_a_changed_response_is_no_old_result(bench, tmp_path):
    with_chain(bench, "calibrated response")
    before = bench.found(route="relative", cache=tmp_path / "cache")
    (bench.path / "cal.csv").write_text(RESPONSE.replace("0,95", "0,94"))
    after = bench.found(route="relative", cache=tmp_path / "cache")
    assert after["F1 [N]"] / before["F1 [N]"] == pytest.approx(0.97 / 0.964, rel=1e-9)


@pytest.mark.parametrize(("unit", "scale"), [("V", 1.0), ("mV", 1e3)])
@pytest.mark.parametrize("stated", ["", ', unit = "N"'])
def test_a_sensitivity_counts_the_volts_that_the_file_states(bench, unit, scale, stated):
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(F))
    columns = {"t [s]": bench.time, f"F1 [{unit}]": 4e-3 * scale * f1, "V1 [m/s]": v1, "V2 [m/s]": v2}
    bench.row("D1", bench.record("D1", columns), "1000,110000")
    bench.channels["force_in"] = f'{{ column = "F1", sensitivity = "4 mV/N", exact = true{stated} }}'
    assert bench.found(route="relative")["K2 [N/m]"] == pytest.approx(bench.k2, rel=1e-8)


def test_a_sensitivity_on_newtons_is_an_error_with_both(bench):
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(F))
    bench.row("D1", bench.record("D1", {"t [s]": bench.time, "F1 [N]": f1, "V1 [m/s]": v1, "V2 [m/s]": v2}), "1000,1e5")
    bench.channels["force_in"] = '{ column = "F1", sensitivity = "0.9 V/N" }'
    row = bench.found(route="relative")
    assert row["verdict"] == "rejected"
    assert "'N' by the file, and sensitivity '0.9 V/N'" in row["remarks"]


@pytest.mark.parametrize("key", ['response = "cal.csv"', 'high_pass = "0.5 Hz"', 'std_delay = "1 ms"'])
def test_a_static_channel_has_no_chain(bench, key):
    bench.static("S1", "1000,")
    bench.channels["load"] = f'{{ column = "F", unit = "N", {key} }}'
    with pytest.raises(CampaignError, match="is for channels of dynamic tests"):
        bench.analyse()


def test_a_unit_may_be_left_to_the_file(bench):
    """F1 in kN by the header, none in campaign.toml; one that contradicts the header is an error with both."""
    f1, v1, v2 = (wave(bench.time) for wave in bench.waves(F))
    columns = {"t [s]": bench.time, "F1 [kN]": 1e-3 * f1, "V1 [m/s]": v1, "V2 [m/s]": v2}
    bench.row("D1", bench.record("D1", columns), "1000,110000")
    bench.channels["force_in"] = '{ column = "F1", exact = true }'
    assert bench.found(route="relative")["K2 [N/m]"] == pytest.approx(bench.k2, rel=1e-8)
    bench.channels["force_in"] = '{ column = "F1", unit = "N" }'
    row = bench.found(route="relative")
    assert row["verdict"] == "rejected"
    assert "'kN' by the file" in row["remarks"]
    assert "'N' by campaign.toml" in row["remarks"]
