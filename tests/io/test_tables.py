"""Columns understood by the names and units that people use, said, and refused where two readings are possible."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fourpole.errors import FileError, TableError
from fourpole.io.tables.kstar import KStarTable, TableOptions, read_k_star
from fourpole.io.tables.pair import CurveTable, read_curve

SHARED = Path(__file__).resolve().parents[3] / "shared" / "data"
F = np.array([10.0, 25.0])
STATED = TableOptions(ratio=True)
MOBILITY = np.array([2e-4 - 1e-3j, 3e-4 + 2e-4j])


def reduced(folder: Path, header: str, *columns: object, separator: str = ",") -> KStarTable:
    rows = zip(*(np.broadcast_to(np.asarray(column, dtype=float), 2).tolist() for column in columns), strict=True)
    path = folder / "bench.csv"
    path.write_text("\n".join([header, *(separator.join(map(repr, row)) for row in rows)]) + "\n", encoding="utf-8")
    return read_k_star(path, STATED)


def curve(folder: Path, content: str, *columns: str) -> CurveTable:
    path = folder / "curve.csv"
    path.write_text(content, encoding="utf-8")
    return read_curve(path, columns=columns)


@pytest.mark.parametrize(
    "header",
    [
        "frequency [Hz],R [m/(N s)],I [m/(N s)]",
        "Frequency (Hz),R [m/(N s)],I [m/(N s)]",
        "freq [Hz],Re(M) [s/kg],Im(M) [s/kg]",
        "f [1/s],Re M [s/kg],Im M [s/kg]",
        "Frequenz [Hz],Re(V1/F1) [m/(N s)],Im(V1/F1) [m/(N s)]",
    ],
)
def test_a_mobility_by_its_parts(tmp_path: Path, header: str) -> None:
    table = reduced(tmp_path, header, F, MOBILITY.real, MOBILITY.imag)
    np.testing.assert_array_equal(table.frequency, F)
    assert table.mobility is not None
    np.testing.assert_array_equal(table.mobility, MOBILITY)
    assert table.stiffness is None
    assert table.lines == [2, 3]
    assert len(table.understood) == 3
    assert table.warnings == []


@pytest.mark.parametrize(
    ("header", "scale"),
    [
        ("f [Hz],Re K* [N/m],Im K* [N/m]", 1.0),
        ("f [Hz],Re(K*) [N/m],Im(K*) [N/m]", 1.0),
        ("f [Hz],K' [kN/m],K'' [kN/m]", 1e3),
        ("f [Hz],k' [N/mm],k\" [N/mm]", 1e3),
        ("f [Hz],storage stiffness [kN/mm],loss stiffness [kN/mm]", 1e6),
    ],
)
def test_a_stiffness_by_its_parts(tmp_path: Path, header: str, scale: float) -> None:
    table = reduced(tmp_path, header, F, [2.0, 3.0], [0.5, 0.25])
    assert table.mobility is None
    assert table.stiffness is not None
    np.testing.assert_allclose(table.stiffness, scale * np.array([2 + 0.5j, 3 + 0.25j]), rtol=1e-15)


@pytest.mark.parametrize(
    ("header", "force", "motion", "order", "phase"),
    [
        ("f [Hz],F1 [N],V1 [m/s],phase [rad]", 1.0, 1.0, 0, 1.0),
        ("f [1/s],F [N],v [m/s],phi [rad]", 1.0, 1.0, 0, 1.0),
        ("f [Hz],Kraft [kN],V1 [mm/s],Phasenwinkel [°]", 1e-3, 1e3, 0, 180 / np.pi),
        ("f [Hz],F [N],x [mm],loss angle [deg]", 1.0, 1e3, -1, 180 / np.pi),
        ("f [Hz],force amplitude [N],displacement amplitude [µm],δ [mrad]", 1.0, 1e6, -1, 1e3),
        ("f [Hz],F [N],Amplitude [m],phase [rad]", 1.0, 1.0, -1, 1.0),
        ("f [Hz],F [lbf],a1 [g],phase [deg]", 1 / 4.4482216152605, 1 / 9.80665, 1, 180 / np.pi),
    ],
)
def test_amplitudes_and_a_phase_of_any_motion(
    tmp_path: Path, header: str, force: float, motion: float, order: int, phase: float
) -> None:
    """The phase is that of the force ahead of the motion in the same row, whichever that is."""
    amplitude = np.array([50.0, 80.0])
    recorded = MOBILITY * amplitude * (2j * np.pi * F) ** order  # the force at zero phase
    columns = force * amplitude, motion * abs(recorded), -phase * np.angle(recorded)
    table = reduced(tmp_path, header, F, *columns)
    assert table.mobility is not None
    np.testing.assert_allclose(table.mobility, MOBILITY, rtol=1e-12)
    assert len(table.understood) == 4


@pytest.mark.parametrize(
    ("header", "hertz"),
    [
        ("omega", 1 / (2 * np.pi)),
        ("ω [rad/s]", 1 / (2 * np.pi)),
        ("f [rpm]", 1 / 60),
        ("Kreisfrequenz", 1 / (2 * np.pi)),
    ],
)
def test_frequencies_of_every_kind_become_hertz(tmp_path: Path, header: str, hertz: float) -> None:
    table = reduced(tmp_path, f"{header},R [s/kg],I [s/kg]", [60.0, 120.0], 1e-3, 1e-3)
    np.testing.assert_allclose(table.frequency, [60 * hertz, 120 * hertz], rtol=1e-15)


def test_f_is_the_frequency_or_the_force_by_its_unit_or_its_case(tmp_path: Path) -> None:
    by_unit = reduced(tmp_path, "F [Hz],f [N],x [m],phase [rad]", F, 2.0, 1e-3, 0.0)
    by_case = reduced(tmp_path, "F [N],f [Hz],x [m],phase [rad]", 2.0, F, 1e-3, 0.0)
    for table in (by_unit, by_case):
        np.testing.assert_array_equal(table.frequency, F)
        assert table.mobility is not None
        np.testing.assert_allclose(table.mobility, 2j * np.pi * F * 1e-3 / 2.0, rtol=1e-12)


def test_how_a_column_was_read_is_said(tmp_path: Path) -> None:
    table = reduced(tmp_path, "f [Hz],F1 [kN],x1 [m],phase [deg]", F, 1.0, 1.0, 1.0)
    assert table.understood == [
        "frequency: column 'f' [Hz]",
        "force amplitude F1: column 'F1' [kN]",
        "motion amplitude: column 'x1' [m]",
        "phase of the force ahead of the motion, loss angle, or phase of a ratio: column 'phase' [deg]",
    ]


def test_units_that_are_not_stated_are_asked_for_all_at_once(tmp_path: Path) -> None:
    with pytest.raises(TableError) as caught:
        reduced(tmp_path, "f,F1 [kN],x1 [m],phase", F, 1.0, 1.0, 1.0)
    told = "'f', 'phase' state no unit: state it, as in --column \"frequency=f [Hz]\" --column \"angle=phase [deg]\""
    assert told in str(caught.value)


def test_a_phase_beyond_a_full_turn_is_not_in_radians(tmp_path: Path) -> None:
    with pytest.raises(TableError, match=r"column 'phase' \[rad\] goes beyond a full turn"):
        reduced(tmp_path, "f [Hz],F1 [N],V1 [m/s],phase [rad]", F, 1.0, 1.0, [-80.0, 3.0])


def test_columns_that_mean_nothing_here_are_passed_over(tmp_path: Path) -> None:
    table = reduced(
        tmp_path, "n [#],f [Hz],T [°C],R [s/kg],I [s/kg],remark [1]", [1, 2], F, 20.0, MOBILITY.real, MOBILITY.imag, 0.0
    )
    assert table.mobility is not None
    np.testing.assert_array_equal(table.mobility, MOBILITY)


def test_a_unit_of_another_kind_tells_that_a_column_is_another(tmp_path: Path) -> None:
    """A column R in ohm is no mobility; then the amplitudes are taken."""
    table = reduced(tmp_path, "f [Hz],R [Ω],F1 [N],V1 [m/s],phase [rad]", F, 5.0, 2.0, 1e-3, 0.0)
    assert table.mobility is not None
    np.testing.assert_allclose(table.mobility, 5e-4, rtol=1e-12)


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("g,R,I", "bench.csv: no column is understood as the frequency among g, R, I: name it 'frequency [Hz]'"),
        ("f [N],R,I", "no column is understood as the frequency among f [N], R, I"),
        ("f [Hz],R [s/kg],J", "of another ratio of motion and force: column 'R' [s/kg]; the columns are f [Hz], R"),
        ("f [Hz],F1,phase", "(|K*|, loss angle)"),
        ("f [Hz],freq [Hz],R [s/kg],I [s/kg]", "'f [Hz]' and 'freq [Hz]' could both be the frequency, and differ"),
        ("f [Hz],R [s/kg],r [s/kg],I [s/kg]", 'say which, as in --column "R=R [s/kg]", or by its number, --column R=2'),
        ("f [Hz],K [N/m],δ [deg]", "'K [N/m]' may be K' or |K*|: state --column"),
    ],
)
def test_what_cannot_be_understood_is_named_with_what_was(tmp_path: Path, header: str, said: str) -> None:
    columns = [F * (1 + at) for at in range(header.count(",") + 1)]
    with pytest.raises(TableError) as caught:
        reduced(tmp_path, header, *columns)
    assert said in str(caught.value)


def test_rows_that_are_no_numbers_are_kept_and_told(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv"
    path.write_text("f [Hz],R [s/kg],I [s/kg],who\n1,2,3,me\n2,,3,me\n3,4,x,me\n\n4,5,6,\nend of file\n")
    table = read_k_star(path, STATED)
    assert table.lines == [2, 3, 4, 6]
    assert table.mobility is not None
    np.testing.assert_array_equal(np.isnan(table.mobility), [False, True, True, False])
    assert table.warnings == [
        "line 7 is not data and was left out: 'end of file'",
        "row 4, column 'I': 'x' is no number: the row cannot be used",
        "a value is missing in rows 3, 4",
    ]


def test_the_name_in_messages_may_be_another(tmp_path: Path) -> None:
    with pytest.raises(FileError, match=r"^upload 3: there is no such file"):
        read_k_star(tmp_path / "x.csv", label="upload 3")
    with pytest.raises(FileError, match=r"^upload 4: there is no such file"):
        read_curve(tmp_path / "x.csv", label="upload 4")


@pytest.mark.parametrize(
    "content",
    [
        "deflection [mm],load [N]\n0,0\n10,1500\n20,3500\n",
        "load [kN],deflection [cm]\n0,0\n1.5,1\n3.5,2\n",
        "x [m],F [N]\n0,0\n0.01,1500\n0.02,3500\n",
        "z (mm);Fz (daN)\n0;0\n10;150\n20;350\n",
        "Einfederung [mm];Radlast;radial load [N]\n0;1;0\n10;1;1500\n20;1;3500\n",
        "t,Travel,Vertical_Load\ns,mm,kN\n0,0,0\n1,10,1.5\n2,20,3.5\n",
        "f [N],d [mm]\n0,0\n1500,10\n3500,20\n",
    ],
)
def test_a_curve_by_the_usual_names(tmp_path: Path, content: str) -> None:
    table = curve(tmp_path, content)
    np.testing.assert_allclose(table.deflection, [0.0, 0.01, 0.02], rtol=1e-15)
    np.testing.assert_allclose(table.load, [0.0, 1500.0, 3500.0], rtol=1e-15)
    assert len(table.understood) == 2
    assert table.warnings == []


def test_a_curve_by_names_that_are_given(tmp_path: Path) -> None:
    content = "x [mm],F [N],s2 [mm],ch7 [kN]\n0,0,0,0\n1,1,10,1.5\n"
    table = curve(tmp_path, content, "load=ch7", "deflection=S2 [mm]")
    assert table.deflection.tolist() == [0.0, 0.01]
    assert table.load.tolist() == [0.0, 1500.0]


def test_a_named_column_of_another_kind(tmp_path: Path) -> None:
    with pytest.raises(TableError, match="'mm' is a length; a force is needed") as caught:
        curve(tmp_path, "x [mm],F [N]\n0,0\n1,1\n", "load=x")
    assert "curve.csv" in str(caught.value)
    assert "--column load=x" in str(caught.value)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("t,F\n0,1\n1,2\n", "no column is understood as the deflection among t, F: name it 'x [mm]'"),
        ("x,t\n0,1\n1,2\n", "no column is understood as the load among x, t: name it 'F [N]'"),
        ("x [m],F [N],Fz [N]\n0,1,2\n1,2,3\n", "'F [N]' and 'Fz [N]' could both be the load, and differ"),
        ("x [m],z [m],F [N]\n0,1,2\n1,2,3\n", "'x [m]' and 'z [m]' could both be the deflection, and differ"),
        (
            "x,F\n0,1\n1,2\n",
            "'x', 'F' state no unit: state it, as in --column \"deflection=x [mm]\" --column \"load=F [N]\"",
        ),
    ],
)
def test_a_curve_that_cannot_be_understood(tmp_path: Path, content: str, said: str) -> None:
    with pytest.raises(TableError) as caught:
        curve(tmp_path, content)
    assert said in str(caught.value)


@settings(max_examples=40, deadline=None)
@given(
    frequency=st.floats(0.1, 1e3), force=st.floats(1e-3, 1e6), size=st.floats(1e-6, 1e-1), angle=st.floats(-1.57, 1.57)
)
def test_force_and_any_motion_say_the_same(
    tmp_path_factory: pytest.TempPathFactory, frequency: float, force: float, size: float, angle: float
) -> None:
    """One motion written as displacement, velocity and acceleration, its phase turned by a quarter each time."""
    folder, turning = tmp_path_factory.getbasetemp(), 2 * np.pi * frequency
    found = []
    for header, order in (("x1 [m]", -1), ("V1 [m/s]", 0), ("a1 [m/s^2]", 1)):
        table = reduced(
            folder,
            f"f [Hz],F1 [N],{header},phase [rad]",
            frequency,
            force,
            size * turning**order,
            angle - order * np.pi / 2,
        )
        assert table.mobility is not None
        found.append(table.mobility[0])
    expected = size / force * np.exp(-1j * angle)
    np.testing.assert_allclose(found, [expected] * 3, rtol=1e-9)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the real files are not here")
def test_real_curves() -> None:
    tyre = read_curve(SHARED / "truck-tyre-335-65R22.5-414kPa.csv")
    assert (tyre.load.size, tyre.load[-1], tyre.warnings) == (21, 54758.0, [])
    assert np.all(np.diff(tyre.deflection) > 0)
