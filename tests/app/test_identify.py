"""identify: four ways to write the same bench results, and one table of K*, K2, C and TR out of each."""

import csv
import io
import json

import numpy as np
import pytest

HEADER = [
    "frequency [Hz]",
    "R [m/(N s)]",
    "I [m/(N s)]",
    "d [1]",
    "Re K* [N/m]",
    "Im K* [N/m]",
    "loss factor [1]",
    "K2 [N/m]",
    "C [N s/m]",
    "TR [1]",
    "verdict",
    "remarks",
]
SHARED = [
    "u(Re K*) with shared errors [N/m]", "u(Im K*) with shared errors [N/m]", "u(K2) [N/m]", "u(C) [N s/m]",
]  # fmt: skip
K1, K2, C, MASS, K3 = 180e3, 120e3, 700.0, 15.0, 12440.0
RIG = ["--mass", "15 kg", "--preload-stiffness", "12.44 kN/m"]
F = np.array([10.0, 14.0, 18.0, 24.0])
JW = 2j * np.pi * F
STIFFNESS = K1 + 1.0 / (1.0 / K2 + 1.0 / (JW * C))
BEYOND = 1.0 / (JW * MASS + K3 / JW)
MOBILITY = JW / STIFFNESS + BEYOND
TR = abs(1.0 / (1.0 + JW / (STIFFNESS * BEYOND)))
FORCE = np.array([60.0, 100.0, 80.0, 200.0])
MOTION = FORCE * abs(MOBILITY)  # velocity
AHEAD = -np.angle(MOBILITY)  # of the force, of the velocity


def text(header, *columns, separator=",", decimal="."):
    rows = [
        separator.join(repr(float(cell)).replace(".", decimal) for cell in row) for row in zip(*columns, strict=True)
    ]
    return "\n".join([*([header] if isinstance(header, str) else header), *rows]) + "\n"


FORMS = {
    "R, I": text("frequency [Hz],R [m/(N s)],I [m/(N s)]", F, MOBILITY.real, MOBILITY.imag),
    "R, I in mm": text("f [1/min],R [mm/(N s)],I [mm/(N s)]", 60 * F, 1e3 * MOBILITY.real, 1e3 * MOBILITY.imag),
    "F1, V1, phase": text("f [Hz],F1 [N],V1 [m/s],phase [deg]", F, FORCE, MOTION, np.degrees(AHEAD)),
    "rad/s, mN": text("ω [rad/s],F1 [mN],V1 [m/s],φ [rad]", JW.imag, 1e3 * FORCE, MOTION, AHEAD),
    "F1, x1, phase": text(
        "f [Hz],F [kN],x1 [mm],phase [rad]", F, 1e-3 * FORCE, 1e3 * MOTION / abs(JW), AHEAD + np.pi / 2
    ),
    "F1, a1, phase": text("f [Hz],F [N],a1 [g],phase [rad]", F, FORCE, MOTION * abs(JW) / 9.80665, AHEAD - np.pi / 2),
    "Re K*, Im K*": text("f [Hz],Re K* [kN/m],Im K* [kN/m]", F, 1e-3 * STIFFNESS.real, 1e-3 * STIFFNESS.imag),
    "K', K''": text("omega [rad/s],K' [N/mm],K'' [N/mm]", JW.imag, 1e-3 * STIFFNESS.real, 1e-3 * STIFFNESS.imag),
    "white space": text("f[Hz] R[s/kg] I[s/kg]", F, MOBILITY.real, MOBILITY.imag, separator="   "),
    "a row of units": text(["f,F1,V1,phase", "Hz,N,mm/s,deg"], F, FORCE, 1e3 * MOTION, np.degrees(AHEAD)),
    "other columns too": text("n,f [Hz],T [degC],R [s/kg],I [s/kg]", F, F, F, MOBILITY.real, MOBILITY.imag),
    "continental, Latin-1": text(
        ["Prüfling 7, Öl", "f;F1;x1;Phase", "Hz;N;µm;°"],
        F,
        FORCE,
        1e6 * MOTION / abs(JW),
        np.degrees(AHEAD) + 90.0,
        separator=";",
        decimal=",",
    ).encode("latin-1"),
}


@pytest.fixture
def bench(tmp_path):
    """Write a table, and say where."""

    def writing(content):
        path = tmp_path / "bench.csv"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return writing


def table_of(ran):
    rows = list(csv.DictReader(io.StringIO(ran.stdout)))
    return rows, {name: np.array([float(row[name]) if row[name] else np.nan for row in rows]) for name in HEADER[:10]}


@pytest.mark.parametrize("form", FORMS)
def test_every_form_gives_the_same_tyre(run, bench, form):
    ran = run("identify", bench(FORMS[form]), "--k1", "180 kN/m", *RIG)
    assert ran.exit_code == 0
    assert ran.stdout.splitlines()[0].split(",")[:3] == HEADER[:3]
    rows, found = table_of(ran)
    assert list(rows[0])[:12] == HEADER
    for name, true in (
        ("frequency [Hz]", F),
        ("R [m/(N s)]", MOBILITY.real),
        ("I [m/(N s)]", MOBILITY.imag),
        ("d [1]", K1 * (1.0 / STIFFNESS).real),
        ("Re K* [N/m]", STIFFNESS.real),
        ("Im K* [N/m]", STIFFNESS.imag),
        ("loss factor [1]", STIFFNESS.imag / STIFFNESS.real),
        ("K2 [N/m]", K2),
        ("C [N s/m]", C),
        ("TR [1]", TR),
    ):
        np.testing.assert_allclose(found[name], np.broadcast_to(true, 4), rtol=1e-9, err_msg=name)
    assert {row["verdict"] for row in rows} == {"ok"}
    assert {row["remarks"] for row in rows} == {""}
    *lines, shared, most, counted = ran.stderr.splitlines()
    understood = [line for line in lines if line.startswith("understood ")]
    assert lines == understood
    assert shared.startswith("u of K*, K2 and C has ")
    assert "moves C most: by up to " in most
    assert len(understood) == 3 + ("phase" in "".join(understood)) + ("temperature" in "".join(understood))
    assert counted.startswith("4 rows: 4 with K2 and C, 0 rejected")


def test_a_damper_beside_the_preload_spring_is_taken_away_too(run, bench):
    mobility = JW / STIFFNESS + 1.0 / (JW * MASS + 20.0 + K3 / JW)
    content = text("f [Hz],R [s/kg],I [s/kg]", F, mobility.real, mobility.imag)
    ran = run("identify", bench(content), "--k1", "180 kN/m", *RIG, "--preload-damping", "20 N s/m")
    np.testing.assert_allclose(table_of(ran)[1]["C [N s/m]"], C, rtol=1e-9)


def test_without_a_rig_there_is_no_transmissibility(run, bench):
    ran = run("identify", bench(FORMS["Re K*, Im K*"]), "--k1", "180 kN/m")
    assert ran.exit_code == 0
    rows, found = table_of(ran)
    assert {row["TR [1]"] for row in rows} == {""}
    np.testing.assert_allclose(found["K2 [N/m]"], K2, rtol=1e-9)
    # what a force cell under the specimen itself would have seen
    mobility = JW / STIFFNESS
    np.testing.assert_allclose(found["R [m/(N s)]"] + 1j * found["I [m/(N s)]"], mobility, rtol=1e-9)


def test_a_far_side_that_does_not_move_has_nothing_to_take_away(run, bench):
    mobility = JW / STIFFNESS
    ran = run(
        "identify",
        bench(text("f [Hz],R [s/kg],I [s/kg]", F, mobility.real, mobility.imag)),
        "--k1",
        "180 kN/m",
        "--no-rig",
    )
    assert ran.exit_code == 0
    rows, found = table_of(ran)
    assert {row["TR [1]"] for row in rows} == {""}
    np.testing.assert_allclose(found["Re K* [N/m]"] + 1j * found["Im K* [N/m]"], STIFFNESS, rtol=1e-9)


def test_a_mobility_needs_the_rig_to_be_stated(run, bench):
    ran = run("identify", bench(FORMS["R, I"]), "--k1", "180 kN/m")
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert "state --no-rig where its far side does not move, or the rig's values" in ran.stderr


HURT_ROWS = """\
frequency [Hz],R [m/(N s)],I [m/(N s)]
10,6.211446949e-05,-1.032080825615e-03
0,1e-4,1e-4
-12,1e-4,1e-4
14,,1e-4
15,x,1e-4
16,1e-3,-1e-4
17,-1e-4,-1e-4
4.5834,1e-4,1e-4
end of the test
"""


def test_rows_that_cannot_be_used_are_rows_with_a_reason(run, bench):
    ran = run("identify", bench(HURT_ROWS), "--k1", "180 kN/m", *RIG)
    assert ran.exit_code == 3
    rows, found = table_of(ran)
    assert [row["verdict"] for row in rows] == ["ok"] + ["rejected"] * 7
    for row, part in zip(
        rows[1:],
        [
            "row 3: the frequency is 0 Hz, it must be positive",
            "row 4: the frequency is -12 Hz, it must be positive",
            "row 5: a value is missing or no number",
            "row 6: a value is missing or no number",
            "no passive K2 exists: K' = ",
            "no passive",
            "the rig's own resonance",
        ],
        strict=True,
    ):
        assert part in row["remarks"]
    assert found["K2 [N/m]"][0] == pytest.approx(K2, rel=1e-6)
    assert np.isnan(found["K2 [N/m]"][1:]).all()
    assert np.isnan(found["C [N s/m]"][1:]).all()
    assert "warning: line 10 is not data and was left out: 'end of the test'" in ran.stderr
    assert "warning: row 6, column 'R': 'x' is no number: the row cannot be used" in ran.stderr
    assert "8 rows: 1 with K2 and C, 7 rejected" in ran.stderr


def test_amplitudes_of_zero_are_rows_without_an_answer(run, bench):
    content = "f [Hz],F1 [N],a1 [m/s²],phase [deg]\n10,0,1,0\n0,10,1,0\n12,10,0,0\n"
    ran = run("identify", bench(content), "--k1", "180 kN/m", *RIG)
    assert ran.exit_code == 3
    assert {row["verdict"] for row in table_of(ran)[0]} == {"rejected"}


def test_one_json_document_for_programs(run, bench):
    ran = run("identify", bench(HURT_ROWS), "--k1", "180 kN/m", *RIG, "--json")
    assert ran.exit_code == 3
    rows = json.loads(ran.stdout)["rows"]
    assert [list(row) for row in rows] == [[*HEADER, *SHARED]] * 8
    assert rows[0]["K2 [N/m]"] == pytest.approx(K2, rel=1e-6)
    assert rows[1]["K2 [N/m]"] is None
    assert (rows[0]["verdict"], rows[0]["remarks"], rows[1]["verdict"]) == ("ok", "", "rejected")


def test_the_table_goes_where_out_says(run, bench, tmp_path):
    path = bench(FORMS["R, I"])
    printed = run("identify", path, "--k1", "180 kN/m", *RIG).stdout
    ran = run("identify", path, "--k1", "180 kN/m", *RIG, "--out", tmp_path / "found.csv")
    assert (ran.exit_code, ran.stdout) == (0, "")
    assert f"written: {tmp_path / 'found.csv'}" in ran.stderr
    assert (tmp_path / "found.csv").read_text() == printed


def test_the_file_written_is_the_one_that_is_said(run, bench, tmp_path):
    ran = run("identify", bench(FORMS["R, I"]), "--k1", "180 kN/m", *RIG, "--out", tmp_path / "found")
    said = ran.stderr.partition("written: ")[2].splitlines()[0]
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith("found")] == [said.rpartition("/")[2]]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--k1", "180", *RIG], "--k1: '180' has no unit; write it as in '12.44 kN/m'"),
        (["--k1", "180 kN", *RIG], "--k1: 'kN' is a force; a stiffness is needed"),
        (["--k1", "-180 kN/m", *RIG], "--k1"),
        (["--k1", "0 N/m", *RIG], "--k1"),
        (["--k1", "180 kN/m", "--mass", "15 kg"], "the rig needs both --mass and --preload-stiffness"),
        (["--k1", "180 kN/m", *RIG, "--no-rig"], "--no-rig and the rig's values contradict each other"),
        (["--k1", "180 kN/m", "--mass", "-1 kg", "--preload-stiffness", "1 kN/m"], "moving_mass is -1 kg"),
        (["--k1", "180 kN/m", *RIG, "--out", "nowhere/found.csv"], "nowhere/found.csv: cannot be written"),
        (["--k1", "180 kN/m", *RIG, "--out", "found.txt"], "a table is written as .csv or .parquet"),
    ],
)
def test_a_wrong_value_is_named_with_its_option(run, bench, arguments, said):
    ran = run("identify", bench(FORMS["R, I"]), *arguments)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in ran.stderr.splitlines()[-1]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "bench.csv: is empty"),
        (b"\x00\x01\x02", "bench.csv: is binary"),
        ("f,R,I\n", "has a header (line 1) but no row"),
        ("R,I\n1,2\n", "no column is understood as the frequency among R, I: name it 'frequency [Hz]'"),
        ("f,R\n1,2\n", "beside the frequency one of (K', K''), (K', tan δ), (K', C), (|K*|, loss angle)"),
        ("f,F1,V1 [m/s],x1 [m],phase\n1,2,3,4,5\n", "'V1 [m/s]' and 'x1 [m]' could both be the motion amplitude"),
        ("f,R,I\n1,2,3\n", 'state no unit: state it, as in --column "frequency=f [Hz]" --column "R=R [m/(N s)]"'),
    ],
)
def test_a_table_that_cannot_be_understood_is_exit_2(run, bench, content, said):
    ran = run("identify", bench(content), "--k1", "180 kN/m", *RIG)
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert said in ran.stderr
    assert len(ran.stderr.splitlines()) == 1


def test_a_missing_file_and_a_folder(run, tmp_path):
    assert "there is no such file" in run("identify", tmp_path / "x.csv", "--k1", "1 N/m", "--no-rig").stderr
    assert "is a folder" in run("identify", tmp_path, "--k1", "1 N/m", "--no-rig").stderr


@pytest.mark.sampled(4)
def test_the_process_prints_the_table_alone_on_stdout(fourpole, bench):
    ran = fourpole("identify", bench(HURT_ROWS), "--k1", "180 kN/m", *RIG)
    assert ran.returncode == 3
    assert ran.stdout.splitlines()[0] == ",".join([*HEADER, *SHARED])
    assert len(list(csv.DictReader(io.StringIO(ran.stdout)))) == 8
    assert "Traceback" not in ran.stderr


def test_an_error_of_the_mass_is_what_makes_c_uncertain(run, bench):
    """u is what an error of this size changes: here 1 % of m alone, by the same formulas with m 1 % larger."""
    alone = ("--std-gain", "0 %", "--std-phase", "0 deg", "--std-k1", "0 %")
    path = bench(FORMS["R, I"])
    ran = run("identify", path, "--k1", "180 kN/m", *RIG, "--std-rig", "0.01 %", *alone)
    rows = list(csv.DictReader(io.StringIO(ran.stdout)))
    for head, u_head in zip(("Re K* [N/m]", "Im K* [N/m]", "K2 [N/m]", "C [N s/m]"), SHARED, strict=True):
        moved = []
        for rig in (("15.0015 kg", "12.44 kN/m"), ("15 kg", "12.441244 kN/m")):
            other = run("identify", path, "--k1", "180 kN/m", "--mass", rig[0], "--preload-stiffness", rig[1])
            moved.append(table_of(other)[1][head] - table_of(ran)[1][head])
        np.testing.assert_allclose([float(row[u_head]) for row in rows], np.hypot(*moved), rtol=0.05)
    assert "u of K*, K2 and C has m and K3 0.010 %;" in ran.stderr
    assert "the uncertainty of moving mass moves C most" in ran.stderr


def test_the_u_of_a_table_is_taken_for_all_of_it_but_k1(run, bench):
    content = text("f [Hz],K' [N/m],K'' [N/m],u(K') [N/m],u(K'') [N/m]", F, STIFFNESS.real, STIFFNESS.imag, F, F)
    rows = list(csv.DictReader(io.StringIO(run("identify", bench(content), "--k1", "180 kN/m").stdout)))
    np.testing.assert_allclose([float(row[SHARED[0]]) for row in rows], F, rtol=1e-9)
    assert all(float(row["u(C) [N s/m]"]) > 0 for row in rows)
    assert list(rows[0])[-4:] == SHARED


def test_a_fit_does_not_take_shared_errors_for_those_of_each_row(run, bench, tmp_path):
    run("identify", bench(FORMS["R, I"]), "--k1", "180 kN/m", *RIG, "--out", tmp_path / "found.csv")
    assert "states no uncertainty of K*" in run("causality", tmp_path / "found.csv").stderr
