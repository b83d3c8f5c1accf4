"""Units: what people write, and what must not get through."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.errors import UnitError
from fourpole.units import (
    KINDS,
    channel_scale,
    column_unit,
    frequency_band,
    frequency_grid,
    is_unit,
    kinds,
    quantity,
    sensitivity,
    shown,
    si_unit,
    to_si,
    unit_scale,
)
from fourpole.units.grammar import USUAL
from fourpole.units.grammar import _looked_up as from_pint

PI = 3.141592653589793
LBF = 4.4482216152605


@pytest.mark.parametrize(
    ("text", "kind", "expected"),
    [
        ("12.44 kN/m", "stiffness", 12440.0),
        ("1.85bar", "pressure", 185000.0),
        ("15kg", "mass", 15.0),
        ("21674N", "force", 21674.0),
        ("-21674 N", "force", -21674.0),
        ("1,5 kg", "mass", 1.5),
        ("0,500 kg", "mass", 0.5),
        ("5.1 mm", "length", 0.0051),
        (".5 m", "length", 0.5),
        ("2e3 N", "force", 2000.0),
        ("1.5 [kN]", "force", 1500.0),
        ("[12 N]", "force", 12.0),
        ("0.5 %", "ratio", 0.005),
        ("0.5 1", "ratio", None),
        ("20 N·s/m", "damping", 20.0),
        ("20 N⋅s/m", "damping", 20.0),
        ("20 Ns/m", "damping", 20.0),
        ("20 N*s/m", "damping", 20.0),
        ("20 N.s/m", "damping", 20.0),
        ("20 N s m^-1", "damping", 20.0),
        ("20 N s m⁻¹", "damping", 20.0),
        ("20 kNs/m", "damping", 20000.0),
        ("1 lbf-s/in", "damping", LBF / 0.0254),
        ("1 lbf/in", "stiffness", LBF / 0.0254),
        ("1 kN/mm", "stiffness", 1e6),
        ("1 MN/m", "stiffness", 1e6),
        ("1 kgf/cm²", "pressure", 98066.5),
        ("1 kgf/cm^2", "pressure", 98066.5),
        ("1 kgf/cm**2", "pressure", 98066.5),
        ("1 kgf/cm2", "pressure", 98066.5),
        ("1 psi", "pressure", LBF / 0.0254**2),
        ("1 g", "acceleration", 9.80665),
        ("1 g", "mass", 1e-3),
        ("2 m/s²", "acceleration", 2.0),
        ("2 m/s2", "acceleration", 2.0),
        ("2 m s-2", "acceleration", 2.0),
        ("3 µm", "length", 3e-6),
        ("3 μm", "length", 3e-6),
        ("3 um", "length", 3e-6),
        ("180 °", "angle", PI),
        ("180 deg", "angle", PI),
        ("20 °C", "temperature", 20.0),
        ("20 degC", "temperature", 20.0),
        ("293.15 K", "temperature", 20.0),
        ("68 °F", "temperature", 20.0),
        ("600 rpm", "frequency", 10.0),
        ("600 1/min", "frequency", 10.0),
        ("600/min", "frequency", 10.0),
        ("600 min⁻¹", "frequency", 10.0),
        ("600 U/min", "frequency", 10.0),
        ("600 rev/min", "frequency", 10.0),
        ("2 kHz", "frequency", 2000.0),
        ("1 rad/s", "frequency", 1 / (2 * PI)),
        ("0.2 ms", "time", 2e-4),
        ("1 m/(N s)", "mobility", 1.0),
        ("1 mm/(N·s)", "mobility", 1e-3),
        ("1 s/kg", "mobility", 1.0),
        ("1 N m", "energy", 1.0),
        ("1 Nm", "energy", 1.0),
        ("1 kJ", "energy", 1000.0),
        ("5 mV", "voltage", 5e-3),
        ("36 km/h", "velocity", 10.0),
    ],
)
def test_quantities_as_people_write_them(text: str, kind: str, expected: float | None) -> None:
    if expected is None:
        with pytest.raises(UnitError):
            quantity(text, kind)
    else:
        assert quantity(text, kind) == pytest.approx(expected, rel=4e-16)


def test_the_conversion_adds_no_rounding() -> None:
    assert quantity("5.1 mm", "length") == 0.0051
    assert quantity("0.3 %", "ratio") == 0.003
    assert quantity("1.7 bar", "pressure") == 170000.0


def test_a_bare_number_needs_a_default_unit() -> None:
    assert quantity("1,7", "pressure", default_unit="bar") == 170000.0
    assert quantity(np.float64(1.7), "pressure", default_unit="bar") == 170000.0
    assert quantity(15, "mass", default_unit="kg") == 15.0
    assert quantity("15 t", "mass", default_unit="kg") == 15000.0
    for text in ("15", 15, 15.0):
        with pytest.raises(UnitError, match="has no unit; write it as in '15 kg'"):
            quantity(text, "mass")


@pytest.mark.parametrize(
    ("text", "kind", "said"),
    [
        ("5 kg", "force", "'kg' is a mass; a force is needed: N, kN, kgf, lbf"),
        ("5 kn/m", "stiffness", "did you mean 'kN/m'"),
        ("5 Kg", "mass", "unknown unit 'Kg'; did you mean 'kg'"),
        ("5 RPM", "frequency", "did you mean 'rpm'"),
        ("5 pa", "pressure", "did you mean 'Pa'"),
        ("5 kg/cm2", "pressure", "did you mean 'kgf/cm²'"),
        ("5 lb/in", "stiffness", "did you mean 'lbf/in'"),
        ("5 m/N s", "mobility", r"did you mean 'm/\(N s\)'"),
        ("5 dB", "ratio", "unknown unit 'dB'"),
        ("5 degC", "ratio", "unknown unit"),
        ("5 bar", "temperature", "a temperature is needed: °C"),
        ("1,500 N", "force", "may mean thousands or a decimal"),
        ("1.234,5 N", "force", "two numbers or a thousands mark"),
        ("1 234 N", "force", "two numbers or a thousands mark"),
        ("1e308 kN", "force", "beyond the range"),
        ("1e999 N", "force", "beyond the range"),
        ("1e-400 N", "force", "beyond the range"),
        ("1.001e30 N", "force", "beyond the range"),
        ("-1.001e27 kN", "force", "beyond the range"),
        ("0.999e-30 N", "force", "beyond the range"),
        ("1e99999 N", "force", "is no unit"),
        ("inf N", "force", "does not begin with a number"),
        ("nan", "force", "does not begin with a number"),
        ("", "force", "does not begin with a number"),
        (float("nan"), "force", "not a finite number"),
        (float("inf"), "force", "not a finite number"),
        (True, "mass", "not a quantity"),
        (None, "mass", "not a quantity"),
        ("5 m \x1b[31m", "length", r"'5 m \\x1b\[31m' has a character that no unit has: '\\x1b'"),
        ("5 \u202em", "length", r"\\u202e"),
        ("5" * 200 + " m", "length", "too long"),
        ("9**9**9 m", "length", "is no unit"),
        ("9 m**9**9", "length", "is no unit"),
        ("9 m^99999999999999999999", "length", "out of range"),
        ("9 m^0", "length", "out of range"),
        ("9 m^0.5", "length", "is no unit"),
        ("9 " + "(" * 40 + "m" + ")" * 40, "length", "too many brackets"),
        ("9 " + "m/m*" * 20 + "m", "length", "too many parts"),
        ("9 m)", "length", "bracket"),
        ("9 (m", "length", "bracket"),
        ("9 m//s", "velocity", "is no unit"),
        ("9 m/", "velocity", "is no unit"),
        ("9 __import__", "length", "is no unit"),
        ("9 lambda", "length", "a length is needed"),
        ("9 m if 1 else s", "length", "unknown unit"),
    ],
)
def test_what_is_refused_and_why(text: str, kind: str, said: str) -> None:
    start = time.process_time()
    with pytest.raises(UnitError, match=said) as raised:
        quantity(text, kind)
    assert str(raised.value).isprintable()
    assert len(str(raised.value)) < 300
    assert time.process_time() - start < 5.0


def test_an_unknown_kind_is_the_callers_mistake() -> None:
    with pytest.raises(ValueError, match="no kind of quantity"):
        quantity("5 kg", "weight")


@pytest.mark.parametrize("kind", KINDS)
def test_every_suggested_unit_is_of_its_kind(kind: str) -> None:
    for unit in kinds.TABLE[kind].units:
        assert is_unit(unit)
        assert to_si([0.0, 1.0], unit, kind).shape == (2,)
    assert quantity(kinds.TABLE[kind].example, kind) == quantity(kinds.TABLE[kind].example.replace(" ", "", 1), kind)
    assert quantity("1.5", kind, default_unit=si_unit(kind)) == 1.5


PLAIN = [(kind, unit) for kind in KINDS if kind != "temperature" for unit in kinds.TABLE[kind].units if unit != "1"]


@pytest.mark.parametrize("text", ["1e30 N", "-1e27 kN", "1e-30 N", "0 N"])
def test_numbers_just_within_the_bounds_are_taken(text: str) -> None:
    assert abs(quantity(text, "force")) in (1e30, 1e-30, 0.0)


@given(st.floats(-1e15, 1e15), st.sampled_from(PLAIN), st.sampled_from([" ", "", "  ", "\u00a0"]))
def test_a_number_and_its_scale_make_the_quantity(value: float, unit: tuple[str, str], space: str) -> None:
    kind, name = unit
    if space == "" and not name[0].isalpha() and name[0] not in "µ%°":
        space = " "
    scale = kinds.affine(name, kind)[0]
    expected = Fraction(repr(value)) * scale
    if expected and abs(expected) < Fraction(1, 10**30):
        return
    found = quantity(f"{value!r}{space}{name}", kind)
    assert found == float(expected)
    assert found == pytest.approx(value * unit_scale(name, kind), rel=1e-15)
    assert to_si([value], name, kind)[0] == pytest.approx(found, rel=1e-15)


@given(st.floats(-200.0, 1e6))
def test_temperatures_go_there_and_back(celsius: float) -> None:
    assert quantity(f"{celsius + 273.15!r} K", "temperature") == pytest.approx(celsius, abs=1e-9)
    assert quantity(f"{celsius * 9 / 5 + 32!r} °F", "temperature") == pytest.approx(celsius, abs=1e-9)


def refusal_of(read: Callable[[], object]) -> str:
    try:
        read()
    except UnitError as error:
        return str(error)
    return ""


@given(st.text(max_size=120), st.sampled_from(KINDS))
def test_no_text_breaks_it(text: str, kind: str) -> None:
    for read in (lambda: quantity(text, kind), lambda: unit_scale(text, kind), lambda: sensitivity(text)):
        assert refusal_of(read).isprintable()
    assert column_unit(text)[0] == column_unit(text)[0].strip()


@given(st.text(alphabet="mNsgk/*^()-. 0123456789µ²°%", max_size=40))
def test_no_algebra_breaks_it(text: str) -> None:
    for read in (lambda: quantity("1 " + text, "force"), lambda: frequency_grid(text + " Hz")):
        assert refusal_of(read).isprintable()


@pytest.mark.parametrize(
    ("unit", "kind", "scale"),
    [
        ("m", "displacement", 1.0),
        ("mm", "displacement", 1e-3),
        ("µm", "displacement", 1e-6),
        ("\u03bcm", "displacement", 1e-6),
        ("um", "displacement", 1e-6),
        ("in", "displacement", 0.0254),
        ("m/s", "velocity", 1.0),
        ("mm/s", "velocity", 1e-3),
        ("in/s", "velocity", 0.0254),
        ("m/s²", "acceleration", 1.0),
        ("m/s^2", "acceleration", 1.0),
        ("m/s2", "acceleration", 1.0),
        ("mm/s²", "acceleration", 1e-3),
        ("g", "acceleration", 9.80665),
    ],
)
def test_motions(unit: str, kind: str, scale: float) -> None:
    assert channel_scale(unit) == (kind, scale)


@pytest.mark.parametrize("unit", ["N", "mg", "kg", "G", "", "foo", "V"])
def test_what_is_no_motion(unit: str) -> None:
    with pytest.raises(UnitError):
        channel_scale(unit)


def test_channels_of_several_kinds() -> None:
    assert channel_scale("kN", ("force", "voltage")) == ("force", 1000.0)
    assert channel_scale("mV", ("force", "voltage")) == ("voltage", 1e-3)
    assert channel_scale("g", ("mass", "acceleration")) == ("mass", 1e-3)
    assert channel_scale("°C", ("temperature",)) == ("temperature", 1.0)
    with pytest.raises(UnitError, match="a force or a voltage is needed"):
        channel_scale("mm", ("force", "voltage"))


def test_a_scale_alone_does_not_tell_kelvin() -> None:
    with pytest.raises(UnitError, match="another zero"):
        unit_scale("K", "temperature")


@pytest.mark.parametrize(
    ("text", "expected", "kind"),
    [
        ("98.3 mV/g", 0.0983 / 9.80665, "acceleration"),
        ("4 mV/N", 0.004, "force"),
        ("4 mV/kN", 4e-6, "force"),
        ("1 mV/lbf", 1e-3 / LBF, "force"),
        ("20 V/(m/s)", 20.0, "velocity"),
        ("20 V s/m", 20.0, "velocity"),
        ("10 mV/(m/s^2)", 0.01, "acceleration"),
        ("10 mV/(m/s²)", 0.01, "acceleration"),
        ("10 V/mm", 10000.0, "displacement"),
        ("1000 N/V", 0.001, "force"),
        ("2 mm/V", 500.0, "displacement"),
        ("10 g/V", 1 / 98.0665, "acceleration"),
    ],
)
def test_sensitivities(text: str, expected: float, kind: str) -> None:
    found, measured = sensitivity(text)
    assert measured == kind
    assert found == pytest.approx(expected, rel=4e-16)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("50 pC/N", "is a charge"),
        ("3.9 pC/g", "is a charge"),
        ("2 mV/V", "not volts per force or motion"),
        ("4 mV", "not volts per force or motion"),
        ("100 mV/m/s", r"write it as in .*'20 V/\(m/s\)'"),
        ("4", "has no unit"),
        (4.0, "has no unit"),
        ("0 mV/N", "not positive"),
        ("-4 mV/N", "invert = true"),
        ("mV/N", "does not begin with a number"),
    ],
)
def test_what_is_no_sensitivity(text: str, said: str) -> None:
    with pytest.raises(UnitError, match=said):
        sensitivity(text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("10:11:0.5 Hz", [10.0, 10.5, 11.0]),
        ("10:10.3:0.1 Hz", [10.0, 10.1, 10.2, 10.3]),
        ("10:11:0.3333333 Hz", [10.0, 10.3333333, 10.6666666, 10.9999999]),
        ("10:11:0.4 Hz", [10.0, 10.4, 10.8]),
        ("10:10:1 Hz", [10.0]),
        ("10,12,14 Hz", [10.0, 12.0, 14.0]),
        ("10, 12 , 14Hz", [10.0, 12.0, 14.0]),
        ("18 Hz", [18.0]),
        ("1e1 Hz", [10.0]),
        ("600:1200:300 rpm", [10.0, 15.0, 20.0]),
        ("1,10:12:1 Hz", [1.0, 10.0, 11.0, 12.0]),
    ],
)
def test_frequency_grids(text: str, expected: list[float]) -> None:
    assert frequency_grid(text) == expected


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("10:24:0.5", "lack numbers or a unit"),
        ("Hz", "lack numbers or a unit"),
        ("", "lack numbers or a unit"),
        ("24:10 Hz", "must rise"),
        ("10:24:2:1 Hz", "is no number or start:stop:step"),
        ("10,,12 Hz", "is no number or start:stop:step"),
        ("10:0.5:24 Hz", "must rise"),
        ("10:24:0 Hz", "must rise"),
        ("0:5:1 Hz", "not all positive"),
        ("-5 Hz", "not all positive"),
        ("1:1e99:1e-99 Hz", "more than 100000"),
        ("1:100001:1 Hz", "more than 100000"),
        ("10 kg", "a frequency is needed"),
        ("1," * 3000 + "1 Hz", "too long"),
    ],
)
def test_what_is_no_grid(text: str, said: str) -> None:
    with pytest.raises(UnitError, match=said):
        frequency_grid(text)


def test_a_range_without_a_step_is_even_in_its_logarithm() -> None:
    grid = frequency_grid("10:1000 Hz")
    assert (len(grid), grid[0], grid[-1]) == (25, 10.0, 1000.0)
    assert grid[12] == pytest.approx(100.0)


@pytest.mark.parametrize(
    ("text", "band"),
    [
        ("10:24 Hz", (10.0, 24.0)),
        ("1e-3:1e5 Hz", (1e-3, 1e5)),
        ("1E-12:1E+14Hz", (1e-12, 1e14)),
        ("10..24Hz", (10.0, 24.0)),
        ("10-24 Hz", (10.0, 24.0)),
        ("1e-3-1e5 Hz", (1e-3, 1e5)),
        ("10 to 24 Hz", (10.0, 24.0)),
        ("100 mHz : 1 kHz", (0.1, 1000.0)),
        ("600:1440 rpm", (10.0, 24.0)),
        ("10 Hz", (10.0, 10.0)),
    ],
)
def test_bands(text: str, band: tuple[float, float]) -> None:
    assert frequency_band(text) == pytest.approx(band, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("24:10 Hz", "rising"),
        ("10:10 Hz", "rising"),
        ("0:10 Hz", "positive"),
        ("-3:5 Hz", "positive"),
        ("10:24", "has no unit"),
        ("10:24 kg", "a frequency is needed"),
        ("Hz", "two rising frequencies"),
        ("10:20:30 Hz", "."),
        ("", "two rising frequencies"),
    ],
)
def test_what_is_no_band(text: str, said: str) -> None:
    with pytest.raises(UnitError, match=said):
        frequency_band(text)


def test_the_largest_grid() -> None:
    assert len(frequency_grid("1:100000:1 Hz")) == 100_000


@given(st.integers(1, 10**6), st.integers(0, 300), st.integers(1, 10**5))
def test_a_grid_ends_at_its_stop(start: int, steps: int, step: int) -> None:
    stop = start + steps * step
    grid = frequency_grid(f"{start / 1000!r}:{stop / 1000!r}:{step / 1000!r} Hz")
    assert len(grid) == steps + 1
    assert grid[0] == start / 1000
    assert grid[-1] == stop / 1000


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("pressure [bar]", ("pressure", "bar")),
        ("F1 (N)", ("F1", "N")),
        ("F1_[kN]", ("F1", "kN")),
        ("F1_(kN)", ("F1", "kN")),
        ("F1[kN]", ("F1", "kN")),
        ("F1(kN)", ("F1", "kN")),
        ("t(s)", ("t", "s")),
        (" F1 ", ("F1", None)),
        ("F(t)", ("F(t)", None)),
        ("u(K1)", ("u(K1)", None)),
        ("u(m)", ("u(m)", None)),
        ("u(K1) [N/m]", ("u(K1)", "N/m")),
        ("corr(Re,Im K*) [1]", ("corr(Re,Im K*)", "1")),
        ("phase F1-V1 [rad]", ("phase F1-V1", "rad")),
        ("R [m/(N s)]", ("R", "m/(N s)")),
        ("tan δ []", ("tan δ", "1")),
        ("tan δ [-]", ("tan δ", "1")),
        ("[N]", ("[N]", None)),
        ("", ("", None)),
    ],
)
def test_units_in_column_names(name: str, expected: tuple[str, str | None]) -> None:
    assert column_unit(name) == expected


def test_no_unit_in_a_very_long_name() -> None:
    assert column_unit("_ " * 100_000 + "[N]")[1] is None


def test_what_is_shown_is_printable_and_short() -> None:
    assert shown("a\nb\x00") == r"'a\nb\x00'"
    assert shown("µ²") == "'µ²'"
    assert len(shown("x" * 10_000_000)) == 62


def test_importing_loads_no_pint() -> None:
    code = "import sys, fourpole.units, fourpole.io.text; sys.exit('pint' in sys.modules or 'polars' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_the_usual_units_are_those_of_pint() -> None:
    """They stand in a table, since loading pint takes half a second."""
    assert {name: from_pint(name) for name in USUAL} == USUAL
