"""One K* in every form, language, unit and format in which laboratories write it: the same numbers come back."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.io import savemat

from fourpole.core.reduced import coherence_std
from fourpole.errors import TableError
from fourpole.fitting.measured import read_measured
from fourpole.io.tables.kstar import KStarTable, TableOptions, read_k_star
from fourpole.models.shape import Shape

F = np.geomspace(0.1, 100.0, 7)
OMEGA = 2 * np.pi * F
K = 2e5 * (1 + (0.05j * OMEGA) ** 0.4)
#: Values in SI of each quantity, and how each is written: the head and the number of SI units in one unit.
VALUES = {
    "f": F, "storage": K.real, "loss": K.imag, "magnitude": abs(K), "angle": np.angle(K), "tan": K.imag / K.real,
    "damping": K.imag / OMEGA, "R": (1j * OMEGA / K).real, "I": (1j * OMEGA / K).imag, "force": 100.0 + F,
    "motion": (100.0 + F) / abs(K),
}  # fmt: skip
DEGREE, TURN = np.pi / 180, 1 / (2 * np.pi)
HEADS = {
    "f": [("f [Hz]", 1.0), ("Kreisfrequenz [rad/s]", TURN), ("ω", TURN), ("Ang. frequency (1/s)", TURN),
        ("频率 [Hz]", 1.0),
          ("Fréquence [kHz]", 1e3), ("周波数 [Hz]", 1.0), ("Frequenz in Hz", 1.0), ("角周波数 [rad/s]", TURN)],
    "storage": [("K' [N/mm]", 1e3), ("K′ [kN/m]", 1e3), ("k’ (N/m)", 1.0), ("Re(K*) [kN/mm]", 1e6),
        ("储能刚度 [N/mm]", 1e3),
                ("Speichersteifigkeit [N/mm]", 1e3), ("rigidité de conservation [N/mm]", 1e3),
                ("貯蔵ばね定数 [N/mm]", 1e3)],
    "loss": [("K'' [N/mm]", 1e3), ("K″ [kN/m]", 1e3), ("k’’ (N/m)", 1.0), ('K" [kN/m]', 1e3),
        ("损耗刚度 [N/mm]", 1e3),
             ("Verluststeifigkeit [N/mm]", 1e3), ("rigidité de perte [N/mm]", 1e3), ("損失ばね定数 [N/mm]", 1e3)],
    "magnitude": [("|K*| [N/mm]", 1e3), ("dynamic stiffness [kN/m]", 1e3), ("dynamische Steifigkeit [N/mm]", 1e3),
                  ("raideur dynamique [N/mm]", 1e3), ("动刚度 [N/mm]", 1e3), ("動ばね定数 [N/mm]", 1e3),
                  ("c_dyn [N/mm]", 1e3)],
    "angle": [("phase [deg]", DEGREE), ("Verlustwinkel [°]", DEGREE), ("loss angle [rad]", 1.0), ("δ [mrad]", 1e-3),
              ("angle de perte [deg]", DEGREE), ("损耗角 [deg]", DEGREE), ("位相差 [rad]", 1.0),
              ("delta (°)", DEGREE)],
    "tan": [("tan δ", 1.0), ("tan(delta)", 1.0), ("tan_delta [-]", 1.0), ("tand", 1.0), ("Verlustfaktor [%]", 0.01),
            ("facteur de perte", 1.0), ("损耗因子", 1.0), ("損失正接 []", 1.0), ("Loss Factor [1]", 1.0),
            ("tanδ", 1.0)],
    "damping": [("C [N s/m]", 1.0), ("Dämpfung [N s/mm]", 1e3), ("damping [kN s/m]", 1e3), ("阻尼系数 [N·s/m]", 1.0)],
    "R": [("R [m/(N s)]", 1.0), ("Re(V1/F1) [mm/(N s)]", 1e-3)],
    "I": [("I [m/(N s)]", 1.0), ("Im(V1/F1) [mm/(N s)]", 1e-3)],
    "force": [("F [N]", 1.0), ("Kraft [kN]", 1e3), ("荷重振幅 [N]", 1.0)],
    "motion": [("x [mm]", 1e-3), ("Weg [µm]", 1e-6), ("位移 [mm]", 1e-3), ("déplacement [m]", 1.0)],
}  # fmt: skip
FORMS = [("storage", "loss"), ("storage", "tan"), ("storage", "damping"), ("storage", "angle"), ("magnitude", "angle"),
         ("magnitude", "tan"), ("R", "I"), ("force", "motion", "angle")]  # fmt: skip
MODULI = {
    "storage": ["G' [{}]", "Storage modulus [{}]", "Speichermodul [{}]", "module de conservation [{}]", "储能模量 [{}]",
                "貯蔵弾性率 [{}]", "E'/{}", "E_stor [{}]", "Speichermodul G′ [{}]", "储能模量 E' [{}]"],
    "loss": ["G'' [{}]", "Loss modulus [{}]", "Verlustmodul [{}]", "module de perte [{}]", "损耗模量 [{}]",
             "損失弾性率 [{}]", "E''/{}", "E_loss [{}]", "Verlustmodul G″ [{}]", "损耗模量 E'' [{}]"],
}  # fmt: skip


def written(folder: Path, columns: dict[str, np.ndarray], separator: str = ";") -> Path:
    path = folder / "k.csv"
    rows = [separator.join(map(repr, row)) for row in zip(*(one.tolist() for one in columns.values()), strict=True)]
    path.write_text("\n".join([separator.join(columns), *rows]) + "\n", encoding="utf-8")
    return path


def stiffness(table: KStarTable) -> np.ndarray:
    frame = table.frame()
    return frame["Re K* [N/m]"].to_numpy() + 1j * frame["Im K* [N/m]"].to_numpy()


@settings(max_examples=150, deadline=None)
@given(data=st.data())
def test_one_stiffness_in_every_form_and_language(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    form = data.draw(st.sampled_from(FORMS))
    columns = {}
    for role in ("f", *form):
        head, scale = data.draw(st.sampled_from(HEADS[role]))
        columns[head] = VALUES[role] / scale
    order = data.draw(st.permutations(list(columns)))
    path = written(tmp_path_factory.getbasetemp(), {head: columns[head] for head in order})
    table = read_k_star(path, TableOptions(ratio="R" in form or "force" in form))
    np.testing.assert_allclose(table.frequency, F, rtol=1e-12)
    np.testing.assert_allclose(stiffness(table), K, rtol=1e-9)


@pytest.mark.parametrize("head", [(role, *one) for role, heads in HEADS.items() for one in heads])
def test_each_head_is_told(tmp_path: Path, head: tuple[str, str, float]) -> None:
    role, name, scale = head
    form = next(form for form in FORMS if role in form) if role != "f" else FORMS[0]
    columns = {name if one == role else HEADS[one][0][0]: VALUES[one] / (scale if one == role else HEADS[one][0][1])
               for one in ("f", *form)}  # fmt: skip
    table = read_k_star(written(tmp_path, columns), TableOptions(ratio="R" in form or "force" in form))
    np.testing.assert_allclose(stiffness(table), K, rtol=1e-9)


@pytest.mark.parametrize("at", range(10))
def test_a_modulus_becomes_a_stiffness_by_its_shape(tmp_path: Path, at: int) -> None:
    heads = [MODULI[role][at].format("kPa") for role in ("storage", "loss")]
    path = written(tmp_path, {"f [Hz]": F, heads[0]: K.real / 50, heads[1]: K.imag / 50})  # K = 50 mm times the modulus
    with pytest.raises(TableError, match=r"state --shape-factor"):
        read_k_star(path)
    np.testing.assert_allclose(read_k_star(path, TableOptions(factor=0.05)).stiffness, K, rtol=1e-12)
    mode = "shear" if "G" in heads[0] or "E" not in heads[0] else "compression"
    shape = Shape(mode, height=0.01, area=5e-4)
    np.testing.assert_allclose(read_k_star(path, TableOptions(shape=shape)).stiffness, K, rtol=1e-12)
    raw = read_k_star(path, TableOptions(moduli=True)).stiffness
    np.testing.assert_allclose(raw, K / 0.05, rtol=1e-12)


def test_a_modulus_of_shear_is_not_taken_in_compression(tmp_path: Path) -> None:
    path = written(tmp_path, {"f [Hz]": F, "G' [MPa]": F, "G'' [MPa]": F})
    with pytest.raises(TableError, match=r"G\* is a modulus of shear, and --mode is compression"):
        read_k_star(path, TableOptions(shape=Shape("compression", 0.01, 5e-4)))
    path = written(tmp_path, {"f [Hz]": F, "G' [MPa]": F, "G'' [MPa]": F, "E' [MPa]": 3 * F, "E'' [MPa]": 3 * F})
    with pytest.raises(TableError, match="are different moduli; say which"):
        read_k_star(path, TableOptions(factor=0.05))
    shear = read_k_star(path, TableOptions(shape=Shape("shear", 0.01, 5e-4))).stiffness
    np.testing.assert_allclose(shear, 0.05e6 * F * (1 + 1j))


def saved(folder: Path, form: str) -> Path:
    """The same table in a format of recordings."""
    path = folder / f"k{form}"
    named = {"f": F, "K1s": K.real, "K2s": K.imag}
    headed = {"f [Hz]": F, "K' [N/m]": K.real, "K'' [N/m]": K.imag}
    frame = pl.DataFrame(headed)
    if form == ".npz":
        np.savez(path, **named)
    elif form == ".mat":
        savemat(path, named)
    elif form == ".json":
        path.write_text(json.dumps({name: one.tolist() for name, one in headed.items()}))
    elif form == ".parquet":
        frame.write_parquet(path)
    elif form == ".arrow":
        frame.write_ipc(path)
    elif form == ".xlsx":
        frame.write_excel(path, column_formats=dict.fromkeys(headed, "0.0"))
    else:
        frame.write_csv(path)
    return path


@pytest.mark.parametrize("form", [".csv", ".npz", ".mat", ".json", ".parquet", ".arrow", ".xlsx"])
def test_every_format_of_recordings_is_one_of_tables(tmp_path: Path, form: str) -> None:
    stated = ("frequency=f [Hz]", "storage=K1s [N/m]", "loss=K2s [N/m]") if form in (".npz", ".mat") else ()
    table = read_k_star(saved(tmp_path, form), TableOptions(columns=stated))
    np.testing.assert_allclose(stiffness(table), K, rtol=1e-12)
    np.testing.assert_allclose(table.frequency, F, rtol=1e-12)


def test_the_fit_reads_the_same_of_every_form(tmp_path: Path) -> None:
    found = []
    for form in FORMS:
        columns = {HEADS[role][0][0]: VALUES[role] / HEADS[role][0][1] for role in ("f", *form)}
        path = written(tmp_path, columns)
        found.append(read_measured(path, std=0.01, options=TableOptions(ratio=True)).conditions[0].own.stiffness)
    for one in found:
        np.testing.assert_allclose(one, K, rtol=1e-9)


def test_columns_are_stated_by_name_number_and_unit(tmp_path: Path) -> None:
    path = written(tmp_path, {"a": F, "b": K.real / 1e3, "c [N/mm]": K.imag / 1e3})
    table = read_k_star(path, TableOptions(columns=["frequency=1 [Hz]", "storage=b [N/mm]", "loss=c"]))
    np.testing.assert_allclose(table.stiffness, K, rtol=1e-12)
    for columns, said in (
        (["storage=b [N/m]"], "no column is understood as the frequency among a, b, c"),
        (["frequency=1 [Hz]", "storage=b", "loss=c"], r"'b' states no unit: state it, as in --column \"storage=b"),
        (["frequency=1 [Hz]", "storage=b [kN]", "loss=c"], "--column storage=b [kN]: 'kN' is a force"),
        (["frequency=1 [Hz]", "storage=b [N/m]", "loss=c [N/m]"], "the column is in 'N/mm' by the file"),
        (["frequency=1 [Hz]", "storage=b [N/m]", "loss=d"], "there is no column 'd'"),
        (["frequency=1 [Hz]", "storage=b [N/m]", "tan=9"], "there is no column '9'"),
        (["stffness=b"], "'stffness=b' is not a role and a column"),
        (["storage=b", "storage=c"], "storage is stated twice"),
        (["frequency=1 [Hz]", "storage=b [N/m]", "tan=c"], "'N/mm' is a stiffness; a ratio is needed"),
    ):
        with pytest.raises(TableError) as caught:
            read_k_star(path, TableOptions(columns=columns))
        assert said.replace("\\", "") in str(caught.value)


def test_of_several_columns_the_one_that_is_stated(tmp_path: Path) -> None:
    columns = {
        "f [Hz]": F,
        "K' [N/m]": K.real,
        "K' raw [N/m]": 2 * K.real,
        "K'' [N/m]": K.imag,
        "tan δ": K.imag / K.real,
    }
    path = written(tmp_path, columns)
    table = read_k_star(path, TableOptions(columns=["storage=K' raw", "tan=tan δ"]))
    np.testing.assert_allclose(table.stiffness, 2 * K, rtol=1e-12)
    assert any("column 'K'' [N/m]' differs" in one for one in table.warnings)


def test_conditions_go_with_the_rows(tmp_path: Path) -> None:
    path = tmp_path / "k.csv"
    path.write_text(
        "Probe;T [K];Vorlast [kN];f [Hz];K' [N/m];tan δ;camber [deg];u(K') [kN/m];u(K'') [kN/m]\n"
        "A;293.15;1;10;2e5;0.1;0;1;2\nA;293.15;1;20;2.1e5;0.1;0;1;2\nB;303.15;1;10;3e5;0.1;2;1;2\n",
        encoding="utf-8",
    )
    measured = read_measured(path, over=["camber [deg]"])
    assert [(one.tyre, one.state) for one in measured.conditions] == [
        ("A", {"preload [N]": 1000.0, "temperature [degC]": 20.0, "camber [deg]": 0.0}),
        ("B", {"preload [N]": 1000.0, "temperature [degC]": 30.0, "camber [deg]": 2.0}),
    ]
    assert measured.known
    np.testing.assert_allclose(measured.conditions[0].own.covariance[0], np.diag([1e6, 4e6]))


def test_the_coherence_gives_the_uncertainty(tmp_path: Path) -> None:
    coherence = np.linspace(0.9, 0.99, 7)
    path = written(tmp_path, {"f [Hz]": F, "|K*| [N/m]": abs(K), "phase [rad]": np.angle(K), "coherence": coherence})
    assert any("state --averages" in one for one in read_k_star(path).warnings)
    frame = read_k_star(path, TableOptions(averages=50)).frame()
    std = abs(K) * np.sqrt((1 - coherence) / (2 * 50 * coherence))
    np.testing.assert_allclose(frame["u(Re K*) [N/m]"], std, rtol=1e-12)
    np.testing.assert_allclose(coherence_std(coherence, 50), std / abs(K), rtol=1e-12)
    wrong = written(
        tmp_path, {"f [Hz]": F, "|K*| [N/m]": abs(K), "phase [rad]": np.angle(K), "coherence": 100 * coherence}
    )
    with pytest.raises(TableError, match="lies outside 0 to 1"):
        read_k_star(wrong, TableOptions(averages=50))


def test_the_random_error_of_a_response_is_that_of_the_coherence() -> None:
    """White input, white noise at the output: the scatter of H1 of many simulated estimates."""
    rng = np.random.default_rng(1982)
    averages, trials, noise = 20, 20_000, 0.5

    def gaussian() -> np.ndarray:
        return (rng.normal(size=(trials, averages)) + 1j * rng.normal(size=(trials, averages))) / np.sqrt(2)

    x = gaussian()
    y = x + noise * gaussian()
    estimates = np.sum(x.conj() * y, axis=1) / np.sum(abs(x) ** 2, axis=1)
    scatter = estimates.real.std()
    # E(1/sum|x|²) exceeds 1/n by 1/(n - 1); the scatter of a standard deviation of 20 000 trials is 0.5 %
    expected = float(coherence_std(1 / (1 + noise**2), averages)) * np.sqrt(averages / (averages - 1))
    assert scatter == pytest.approx(expected, rel=5 / np.sqrt(2 * trials))


@pytest.mark.parametrize(
    ("header", "rows", "said"),
    [
        ("f [Hz];K' [N/m];K'' [N/m]", ["1;2;0", "2;2;0"], "column 'K''' is zero in all rows"),
        ("f [Hz];K' [N/m];tan δ", ["1;2;-0.1", "2;2;-0.1"], "column 'tan δ' makes the loss negative in all rows"),
        (
            "f [Hz];|K*| [N/m];phase",
            ["1;2;5", "2;2;6"],
            "'phase' states no unit: state it, as in --column \"angle=phase",
        ),
        ("f [Hz];|K*| [N/m];phase [rad]", ["1;2;5", "2;2;60"], "goes beyond a full turn"),
        ("ω [Hz];K' [N/m];K'' [N/m]", ["1;2;5"], "'ω' is an angular frequency by its head, and in Hz by its unit"),
        ("f [Hz];K' [Pa m];K'' [N/m]", ["1;2;5"], ""),
    ],
)
def test_what_cannot_be_is_refused(tmp_path: Path, header: str, rows: list[str], said: str) -> None:
    path = tmp_path / "k.csv"
    path.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    if not said:  # a pascal metre is a newton per metre
        np.testing.assert_allclose(read_k_star(path).stiffness, [2 + 5j])
        return
    with pytest.raises(TableError) as caught:
        read_k_star(path)
    assert said in str(caught.value)


@pytest.mark.parametrize("stiffness", [(2, 1, -1, -2), (-1, -2, -3, -4)])
def test_a_negative_stiffness_is_no_negative_loss(tmp_path: Path, stiffness: tuple[int, ...]) -> None:
    """A mass at the driven end, in some rows or in all."""
    path = tmp_path / "k.csv"
    rows = "".join(f"{at + 1};{real};0.5\n" for at, real in enumerate(stiffness))
    path.write_text("f [Hz];K' [N/m];K'' [N/m]\n" + rows, encoding="utf-8")
    measured = read_measured(path, std=0.01)
    assert "negative" not in " ".join(measured.notes)
    assert measured.conditions[0].own.stiffness.real.tolist() == list(stiffness)


def test_a_negative_loss_is_named_whatever_the_stiffness(tmp_path: Path) -> None:
    path = tmp_path / "k.csv"
    path.write_text("f [Hz];K' [N/m];K'' [N/m]\n1;2;0.5\n2;1;0.5\n3;-1;-0.5\n", encoding="utf-8")
    assert "the loss is negative in row 4" in " ".join(read_measured(path, std=0.01).notes)


def test_rows_that_cannot_be_used_are_named(tmp_path: Path) -> None:
    path = tmp_path / "k.csv"
    path.write_text(
        "f [Hz];K' [N/m];tan δ\n-1;2;0.1\n1;;0.1\n2;2;-0.1\n3;2;0.1\n3;2 kN/m;0.1\n3;2;0.1\n", encoding="utf-8"
    )
    measured = read_measured(path, std=0.01)
    text = " ".join(measured.notes)
    for said in (
        "the frequency is not positive in row 2",
        "a value is missing in rows 3, 6",
        "column 'tan δ': the loss is negative in row 4",
        "row 6, column 'K'': '2 kN/m' is no number",
        "1 rows of k.csv repeat a frequency of their condition",
        "understood frequency: column 'f' [Hz]; K', or the storage modulus: column 'K'' [N/m]; loss factor tan δ",
    ):
        assert said in text


def test_one_sheet_or_group_of_several_or_all(tmp_path: Path) -> None:
    frame = pl.DataFrame({"f [Hz]": F, "K' [N/m]": K.real, "K'' [N/m]": K.imag})
    with pytest.importorskip("xlsxwriter").Workbook(tmp_path / "k.xlsx") as book:
        for name, t in (("cold", 0.0), ("warm", 40.0)):
            frame.with_columns(pl.lit(t).alias("T [°C]")).write_excel(book, name)
        book.add_worksheet("notes").write_row(0, 0, ["who", "when"])
    with pytest.raises(TableError, match=r"2 sheets or groups hold K\*: 'cold', 'warm'; name one with --group"):
        read_k_star(tmp_path / "k.xlsx")
    assert read_k_star(tmp_path / "k.xlsx", TableOptions(group="warm")).frequency.size == 7
    measured = read_measured(tmp_path / "k.xlsx", options=TableOptions(group="*"))
    assert [one.state for one in measured.conditions] == [{"temperature [degC]": 0.0}, {"temperature [degC]": 40.0}]
    with pytest.raises(TableError, match="there is no group 'hot'"):
        read_k_star(tmp_path / "k.xlsx", TableOptions(group="hot"))


TRIOS = """[Version]
TA Instruments LIMS export format version\t0
[Step]
Step name\tFrequency sweep
Variables\tRun time\tTemperature\tAngular frequency\tStorage modulus\tLoss modulus\tTan(delta)
Units\ts\t°C\trad/s\tMPa\tMPa\t
Data point\t552.1\t149.9\t0.628318548\t0.004\t0.0004\t0.1
Data point\t566.6\t149.9\t6.28318548\t0.005\t0.0005\t0.1
Data point\t577.0\t149.9\t62.8318548\t0.006\t0.0006\t0.1
"""


def test_an_export_of_trios_for_lims(tmp_path: Path) -> None:
    path = tmp_path / "trios.txt"
    path.write_text(TRIOS, encoding="utf-8")
    table = read_k_star(path, TableOptions(factor=0.05))
    np.testing.assert_allclose(table.frequency, [0.1, 1.0, 10.0], rtol=1e-7)
    assert table.stiffness is not None
    np.testing.assert_allclose(table.stiffness, 0.05e6 * np.array([0.004, 0.005, 0.006]) * (1 + 0.1j), rtol=1e-12)
    assert table.further["temperature [degC]"].to_list() == [149.9] * 3
    assert table.lines == [7, 8, 9]


def test_a_header_that_does_not_fit_leaves_the_numbers_of_the_columns(tmp_path: Path) -> None:
    path = tmp_path / "rep.osc"
    head = "T=0;Mw=94.9;\nFreq\tG'\tG\"\tTemp\tStrain\tEta*\nrad/s\tPa\tPa\t°C\t%\tPa-s\n"
    path.write_text(head + "".join(f"   {10**at}   3.48E5   7.0E4   -0.01\n" for at in (2, 1, 0)), encoding="latin-1")
    with pytest.raises(TableError, match=r"rows 4 cells; .*; the columns are known by their numbers"):
        read_k_star(path, TableOptions(factor=0.05))
    columns = ["frequency=1 [rad/s]", "storage=2 [Pa]", "loss=3 [Pa]"]
    table = read_k_star(path, TableOptions(columns=columns, factor=0.05))
    np.testing.assert_allclose(table.frequency, np.array([100, 10, 1]) / (2 * np.pi))
    assert table.stiffness is not None
    np.testing.assert_allclose(table.stiffness, [0.05 * (3.48e5 + 7e4j)] * 3)


def test_a_text_in_utf_16_whose_last_line_end_is_one_byte(tmp_path: Path) -> None:
    path = tmp_path / "k.csv"
    path.write_bytes("f [Hz]\tK' [N/m]\tK'' [N/m]\n10\t2\t1\n20\t3\t1".encode("utf-16") + b"\n")
    np.testing.assert_allclose(read_k_star(path).stiffness, [2 + 1j, 3 + 1j])


def test_dyn_is_dynamic_and_a_word_beside_k_star_is_k_star(tmp_path):
    file = tmp_path / "bench.txt"
    file.write_text("Frequency [Hz]\tDyn. Stiffness K* [N/mm]\tLoss Angle [deg]\n10\t200\t90\n")
    assert read_k_star(file).stiffness == pytest.approx([2e5j])
    file.write_text("Frequenz [Hz];Dyn. Steifigkeit [N/mm];Verlustwinkel [°]\n10;200;90\n", encoding="utf-8")
    assert read_k_star(file).stiffness == pytest.approx([2e5j])


@pytest.mark.parametrize(
    ("heads", "motion", "phase"),
    [("V1 [m/s],phase F1-x1 [deg]", 2 * np.pi * 10 * 1e-3, 30.0), ("x1 [mm],phase F1-V1 [deg]", 1.0, -60.0),
     ("V1 [m/s],phase [deg]", 2 * np.pi * 10 * 1e-3, -60.0)],
)  # fmt: skip
def test_a_phase_is_that_of_the_motion_that_its_head_names(tmp_path, heads, motion, phase):
    file = tmp_path / "amplitudes.csv"
    file.write_text(f"f [Hz],F1 [N],{heads}\n10,200,{motion!r},{phase}\n")
    frame = read_k_star(file, TableOptions(ratio=True)).frame()
    assert frame["Re K* [N/m]"][0] + 1j * frame["Im K* [N/m]"][0] == pytest.approx(2e5 * np.exp(1j * np.pi / 6))


@pytest.mark.parametrize("rows", ["0,5;150.059,2;2.008,8", "0,5;150.059;2.009\n1,0;150.236;4.006"])
def test_thousands_are_named_where_they_hide_the_columns(tmp_path, rows):
    file = tmp_path / "bench.csv"
    file.write_text(f"Frequenz [Hz];K' [N/m];K'' [N/m]\n{rows}\n")
    with pytest.raises(TableError, match=r"no numbers, but cells as '.*separator of thousands"):
        read_k_star(file)


SNAKES = [
    ("freq_hz,K_storage_N_per_m,K_loss_N_per_m", 1.0),
    ("Frequency [Hz],Real [N/m],Imag [N/m]", 1.0),
    ("freq [Hz],dynamic_stiffness_real_kN_per_m,dynamic_stiffness_imag_kN_per_m", 1e-3),
    ("f [Hz],elastic stiffness [kN/m],viscous stiffness [kN/m]", 1e-3),
]


@pytest.mark.parametrize(("heads", "scale"), SNAKES)
def test_heads_are_understood_by_their_words(tmp_path, heads, scale):
    stiffness = np.array([2e5 + 3e4j, 2.2e5 + 3.5e4j])
    rows = [f"{f},{k.real * scale},{k.imag * scale},Meier" for f, k in zip((5, 10), stiffness, strict=True)]
    (tmp_path / "a.csv").write_text("\n".join([f"{heads},operator", *rows]) + "\n")
    np.testing.assert_allclose(read_k_star(tmp_path / "a.csv").stiffness, stiffness, rtol=1e-12)


@pytest.mark.parametrize("heads", ["Frequency [Hz],Real,Imag", "f [Hz],storage of run 2 [N/m],loss of run 2 [N/m]"])
def test_what_is_not_understood_is_asked_for(tmp_path, heads):
    (tmp_path / "a.csv").write_text(f"{heads}\n5,2e5,3e4\n10,2e5,3e4\n")
    with pytest.raises(TableError, match="state"):
        read_k_star(tmp_path / "a.csv")


@pytest.mark.parametrize(
    ("noun", "unit", "power"), [("Accelerance", "m/s2/N", 2), ("receptance", "m/N", 0), ("Mobility", "m/(N s)", 1)]
)
def test_ratios_of_motion_and_force_become_a_mobility(tmp_path, noun, unit, power):
    stiffness, hertz = np.array([2e5 + 3e4j, 2.2e5 + 3.5e4j]), np.array([5.0, 10.0])
    ratio = (2j * np.pi * hertz) ** power / stiffness
    rows = [f"{f},{x.real:.17g},{x.imag:.17g}" for f, x in zip(hertz, ratio, strict=True)]
    (tmp_path / "a.csv").write_text(f"f [Hz],{noun} real [{unit}],{noun} imag [{unit}]\n" + "\n".join(rows) + "\n")
    found = read_k_star(tmp_path / "a.csv", TableOptions(ratio=True))
    np.testing.assert_allclose(found.mobility, 2j * np.pi * hertz / stiffness, rtol=1e-12)
