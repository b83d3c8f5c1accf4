"""Tables as scripts of other people write them: right, or asked for by name and role; never silently wrong."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.io import savemat

from fourpole.core.reduced import identify_transmissibility
from fourpole.core.rig import Rig
from fourpole.errors import TableError
from fourpole.fitting.measured import read_measured
from fourpole.io.tables.kstar import TableOptions, read_k_star
from fourpole.io.tables.pair import read_curve, read_over_time

F = np.array([2.0, 5.0, 10.0, 20.0, 40.0])
W = 2 * np.pi * F
K = 2e5 * (F / 10) ** 0.06 * np.exp(0.1j)
#: Receptance, mobility, accelerance and transmissibility to a mass of 20 kg.
H, Y, A, T = 1 / K, 1j * W / K, -(W**2) / K, K / (K - 20 * W**2)


def written(path: Path, heads: list[str], *columns: object, sep: str = ",", comma: bool = False) -> Path:
    rows = [sep.join(f"{cell:.12g}" if not isinstance(cell, str) else cell for cell in row) for row in zip(*columns)]  # noqa: B905
    text = "\n".join(rows)
    path.write_text(sep.join(heads) + "\n" + (text.replace(".", ",") if comma else text) + "\n", encoding="utf-8")
    return path


def degrees(value: np.ndarray) -> np.ndarray:
    return np.degrees(np.angle(value))


HABITS = [
    (["freq_hz", "k_storage_n_per_mm", "k_loss_n_per_mm"], (F, K.real / 1e3, K.imag / 1e3)),
    (["frequency_hz", "dyn_stiffness_N_mm", "loss_angle_deg"], (F, abs(K) / 1e3, degrees(K))),
    (["freq_hz", "kdyn_kn_m", "tan_delta"], (F, abs(K) / 1e3, K.imag / K.real)),
    (["Freq. [Hz]", "|c*| [N/mm]", "phi [°]"], (F, abs(K) / 1e3, degrees(K))),
    (["Frequenz [Hz]", "cdyn [N/mm]", "Dämpfung [Ns/m]"], (F, abs(K) / 1e3, K.imag / W)),
    (["频率/Hz", "储能刚度/(N/mm)", "损耗因子"], (F, K.real / 1e3, K.imag / K.real)),
    (["Hz", "Mobility (m/s/N)", "Phase (°)"], (F, abs(Y), degrees(Y))),
    (["Frequency (Hz)", "Receptance magnitude (mm/N)", "Phase (deg)"], (F, abs(H) * 1e3, degrees(H))),
    (["freq_hz", "accelerance_mag_ms2_per_n", "accelerance_phase_deg"], (F, abs(A), degrees(A))),
    (["Frequency [Hz]", "Inertance [g/N]", "Phase [rad]"], (F, abs(A) / 9.80665, np.angle(A))),
    (["Frequenz [Hz]", "Nachgiebigkeit Realteil [mm/N]", "Nachgiebigkeit Imaginärteil [mm/N]"],
     (F, H.real * 1e3, H.imag * 1e3)),
    (["Frequency [Hz]", "Real impedance [N s/m]", "Imag impedance [N s/m]"], (F, (1 / Y).real, (1 / Y).imag)),
    (["频率(Hz)", "机械阻抗幅值(N s/m)", "机械阻抗相位(deg)"], (F, abs(1 / Y), degrees(1 / Y))),
    (["Frequency [Hz]", "Apparent mass [kg]", "Phase [deg]"], (F, abs(1 / A), degrees(1 / A))),
    (["Frequency (Hz)", "FRF Magnitude (m/s^2/N)", "FRF Phase (deg)"], (F, abs(A), degrees(A))),
    (["freq_hz", "force_amp_n", "disp_amp_mm", "phase_deg"], (F, abs(K) * 1e-3, 0 * F + 1.0, degrees(K))),
]  # fmt: skip


@pytest.mark.parametrize(("heads", "columns"), HABITS, ids=[heads[1] for heads, _ in HABITS])
def test_a_head_says_quantity_part_and_unit(tmp_path, heads, columns):
    found = read_k_star(written(tmp_path / "t.csv", heads, *columns, sep=";"), TableOptions(ratio=True)).frame()
    np.testing.assert_allclose(found["Re K* [N/m]"], K.real, rtol=1e-9)
    np.testing.assert_allclose(found["Im K* [N/m]"], K.imag, rtol=1e-9)


@pytest.mark.parametrize("heads", [
    ["Frequency [Hz]", "Transmissibility", "Phase [deg]"], ["Frequenz [Hz]", "Übertragbarkeit [-]", "Phase [°]"],
    ["freq_hz", "transmissibility_re", "transmissibility_im"], ["频率(Hz)", "传递率", "相位(deg)"]])  # fmt: skip
def test_a_transmissibility_gives_the_stiffness_on_its_rig(tmp_path, heads):
    columns = (T.real, T.imag) if "re" in heads[1] else (abs(T), degrees(T))
    path = written(tmp_path / "t.csv", heads, F, *columns)
    found = read_k_star(path, TableOptions(ratio=True, rig=True))
    result = identify_transmissibility(F, found.transmissibility, np.nan, Rig(moving_mass=20.0, preload_stiffness=0.0))
    np.testing.assert_allclose(result.stiffness, K, rtol=1e-8)
    with pytest.raises(TableError, match="give V2/V1, of specimen and rig"):
        read_k_star(path, TableOptions())


@pytest.mark.parametrize(("heads", "columns", "said"), [
    (["f [Hz]", "Receptance [mm/N]", "Phase [deg]"], (F, abs(H) * 1e3, degrees(K)), "negative in all rows"),
    (["f [Hz]", "Magnitude [dB]", "Phase [deg]"], (F, 20 * np.log10(abs(A)), degrees(A)), "levels in dB"),
    (["freq", "K_storage", "K_loss"], (F, K.real, K.imag), "state no unit"),
])  # fmt: skip
def test_what_is_not_clear_is_asked_for(tmp_path, heads, columns, said):
    with pytest.raises(TableError, match=said):
        read_k_star(written(tmp_path / "t.csv", heads, *columns), TableOptions(ratio=True))


def of_two(path: Path, head: str, words: list[str], second: float = 2.0) -> Path:
    both = np.concatenate([K, second * K])
    heads = [head, "freq_hz", "k_storage_n_mm", "k_loss_n_mm"]
    return written(path, heads, words, np.tile(F, 2), both.real / 1e3, both.imag / 1e3)


@pytest.mark.parametrize(
    ("head", "names"),
    [("sample", "A B"), ("Richtung", "axial radial"), ("material", "NR SBR"), ("Charge", "17 18"), ("x-code", "u v")],
)
def test_labels_tell_rows_apart(tmp_path, head, names):
    first, second = names.split()
    found = read_measured(of_two(tmp_path / "t.csv", head, [first] * F.size + [second] * F.size))
    assert found.tyres == (first, second)
    np.testing.assert_allclose(found.conditions[1].own.stiffness, 2 * K, rtol=1e-9)


@pytest.mark.parametrize("head", ["run", "Bemerkung", "Wdh."])
def test_repeats_and_comments_tell_no_rows_apart(tmp_path, head):
    found = read_measured(of_two(tmp_path / "t.csv", head, ["r1"] * F.size + ["r2"] * F.size, second=1.02))
    assert len(found.conditions) == 1
    np.testing.assert_allclose(found.conditions[0].own.stiffness.mean(), 1.01 * K.mean(), rtol=0.01)


@pytest.mark.parametrize("heads", [("quantity", "value", "unit"), ("Größe", "Wert", ""), ("parameter", "值", "单位")])
def test_a_table_in_long_form_is_read_as_columns(tmp_path, heads):
    parts = (("K'", K.real / 1e3, "N/mm"), ("tan delta", K.imag / K.real, "1"))
    rows = [(f, name, value, unit) for name, values, unit in parts for f, value in zip(F, values, strict=True)]
    columns = [list(one) for one in zip(*rows, strict=True)]
    if not heads[2]:
        columns[1] = [f"{name} [{unit}]" for name, unit in zip(columns[1], columns.pop(), strict=True)]
    path = written(tmp_path / "t.csv", ["frequency_hz", *filter(None, heads)], *columns)
    found = read_k_star(path)
    np.testing.assert_allclose(found.stiffness, K, rtol=1e-9)
    assert any("long form" in one for one in found.warnings)


def test_curves_of_several_specimens_are_asked_for(tmp_path):
    x, load = np.linspace(0, 20, 21), 200 * np.linspace(0, 20, 21)
    heads = ["specimen", "deflection_mm", "load_n"]
    columns = (["A"] * 21 + ["B"] * 21, np.tile(x, 2), np.concatenate([load, 2 * load]))
    path = written(tmp_path / "t.csv", heads, *columns)
    with pytest.raises(TableError, match="name one of them with --group: A, B"):
        read_curve(path)
    np.testing.assert_allclose(read_curve(path, group="B").load, 2 * load)


def test_a_loaded_radius_and_a_negative_load_are_a_curve(tmp_path):
    """Heads and signs of a public tyre machine: FZ is negative in compression, RL the loaded radius in cm."""
    x = np.linspace(0, 20, 21)
    heads = ["ET [sec]", "V [km/h]", "SA [deg]", "IA [deg]", "RL [cm]", "P [kPa]", "FX [N]", "FY [N]", "FZ [N]"]
    still = 0 * x
    found = read_curve(written(tmp_path / "t.csv", heads, x, still, still, still, 31 - x / 10, still + 83, still, still,
                               -200 * x))  # fmt: skip
    np.testing.assert_allclose(found.deflection, x * 1e-3, atol=1e-9)
    np.testing.assert_allclose(found.load, 200 * x)
    assert sum("negative" in one or "falls with the load" in one for one in found.warnings) == 2


@pytest.mark.parametrize("made", [
    {"frequency_hz": F.tolist(), "Kstar_n_per_m": {"re": K.real.tolist(), "im": K.imag.tolist()}},
    {"bench": {"freq_hz": F.tolist(), "k_storage_n_per_m": K.real.tolist(), "k_loss_n_per_m": K.imag.tolist()}},
])  # fmt: skip
def test_nested_variables_are_heads(tmp_path, made):
    (tmp_path / "t.json").write_text(json.dumps(made), encoding="utf-8")
    np.testing.assert_allclose(read_k_star(tmp_path / "t.json").stiffness, K, rtol=1e-9)


def test_complex_arrays_of_matlab(tmp_path):
    savemat(tmp_path / "t.mat", {"bench": {"freq_hz": F, "accelerance_ms2_per_n": A}})
    found = read_k_star(tmp_path / "t.mat", TableOptions(ratio=True))
    np.testing.assert_allclose(found.mobility, Y, rtol=1e-9)


def test_moduli_over_time_in_snake_case(tmp_path):
    t = np.geomspace(0.1, 1e3, 12)
    modulus = 1e6 * (1 + 0.5 * np.exp(-t / 10))
    creep = read_over_time(
        written(tmp_path / "c.csv", ["time_s", "creep_compliance_per_mpa"], t, 1e6 / modulus), TableOptions(factor=0.05)
    )
    np.testing.assert_allclose(1 / creep.values, 0.05 * modulus, rtol=1e-9)


@pytest.mark.parametrize(
    ("heads", "sizes"),
    [
        (["Force RMS (N)", "Displacement peak (mm)"], (np.sqrt(0.5), 1)),
        (["Force (N rms)", "Displacement (mm pk-pk)"], (np.sqrt(0.5), 2)),
        (["Kraft Spitze-Spitze (N)", "Weg Amplitude (mm)"], (2, 1)),
        (["F_pp_N", "x_pk_mm"], (2, 1)),
        (["Kraftamplitude (N)", "Schwingbreite (mm)"], (1, 2)),
        (["Force (N)", "Displacement (mm)"], (1, 1)),
    ],
)
def test_amplitudes_are_taken_as_their_heads_state_them(tmp_path, heads, sizes):
    columns = (F, sizes[0] * abs(K) * 1e-3, sizes[1] + 0 * F, degrees(K))
    path = written(tmp_path / "t.csv", ["f [Hz]", *heads, "Phase [deg]"], *columns)
    np.testing.assert_allclose(read_k_star(path, TableOptions(ratio=True)).frame()["Re K* [N/m]"], K.real, rtol=1e-9)


def test_an_amplitude_of_one_kind_beside_one_of_no_kind_is_asked_for(tmp_path):
    path = written(tmp_path / "t.csv", ["f [Hz]", "Force p-p [N]", "x [mm]", "Phase [deg]"], F, F, F, degrees(K))
    with pytest.raises(TableError, match="states how its amplitude is meant"):
        read_k_star(path, TableOptions(ratio=True))


@pytest.mark.parametrize("words", [("Mean", "Std"), ("Mittelwert", "Standardabweichung"), ("平均值", "标准偏差")])
def test_rows_of_means_and_deviations_are_left_out(tmp_path, words):
    rows = [
        [*map(str, range(1, 6)), *words],
        *([*one, one.mean(), one.std()] for one in (F, K.real / 1e3, K.imag / 1e3)),
    ]
    path = written(tmp_path / "t.csv", ["No.", "f [Hz]", "K' [N/mm]", "K'' [N/mm]"], *rows)
    found = read_k_star(path)
    np.testing.assert_allclose(found.stiffness, K, rtol=1e-9)
    assert any("left out: " + words[0].casefold() in one for one in found.warnings)


def test_a_mean_has_its_deviation_as_uncertainty(tmp_path):
    heads = ["f [Hz]", "K'_mean [N/mm]", "K'_std [N/mm]", "K''_mean [N/mm]", "K''_std [N/mm]"]
    path = written(tmp_path / "t.csv", heads, F, K.real / 1e3, 0.01 * K.real / 1e3, K.imag / 1e3, 0.02 * K.imag / 1e3)
    found = read_k_star(path).frame()
    np.testing.assert_allclose(found["u(Re K*) [N/m]"], 0.01 * K.real, rtol=1e-9)
    np.testing.assert_allclose(found["u(Im K*) [N/m]"], 0.02 * K.imag, rtol=1e-9)


def test_merged_names_and_stepped_conditions_tell_rows_apart(tmp_path):
    names = ["A", *[""] * (F.size - 1), "B", *[""] * (F.size - 1)]
    assert read_measured(of_two(tmp_path / "t.csv", "specimen", names)).tyres == ("A", "B")
    found = read_measured(of_two(tmp_path / "u.csv", "Ageing [h]", [0.0] * F.size + [168.0] * F.size))
    assert found.tyres == ("Ageing 0 h", "Ageing 168 h")


@pytest.mark.parametrize("words", [("Belastung", "Entlastung"), ("up", "down"), ("加载", "卸载")])
def test_branches_are_one_curve(tmp_path, words):
    x = np.linspace(0, 20, 21)
    columns = (
        np.concatenate([x, x[::-1]]),
        np.concatenate([200 * x, 190 * x[::-1]]),
        [words[0]] * 21 + [words[1]] * 21,
    )
    found = read_curve(written(tmp_path / "t.csv", ["Weg [mm]", "Kraft [N]", "Richtung"], *columns))
    assert found.load.size == 42
    beside = written(tmp_path / "u.csv", ["x [mm]", "Load loading [N]", "Load unloading [N]"], x, 200 * x, 190 * x)
    np.testing.assert_allclose(read_curve(beside).load, found.load)


def test_a_sign_is_reversed_where_it_is_stated(tmp_path):
    path = written(tmp_path / "t.csv", ["f [Hz]", "|K*| [N/mm]", "Phase [deg]"], F, abs(K) / 1e3, -degrees(K))
    with pytest.raises(TableError, match="angle=-Phase"):
        read_k_star(path)
    np.testing.assert_allclose(read_k_star(path, TableOptions(columns=["angle=-Phase"])).stiffness, K, rtol=1e-9)


def test_complex_cells_are_two_columns(tmp_path):
    cells = [f"({one.real:.9f}{one.imag:+.9f}j)" for one in K]
    found = read_k_star(written(tmp_path / "t.csv", ["f [Hz]", "Kstar [N/m]"], F, cells))
    np.testing.assert_allclose(found.stiffness, K, rtol=1e-9)


@pytest.mark.parametrize("form", ["records", "columns", "split", "npz", "mat", "h5", "parquet"])
def test_labels_of_other_formats_tell_rows_apart(tmp_path, form):
    names, both = ["A"] * F.size + ["B"] * F.size, np.concatenate([K, 2 * K])
    columns = {
        "sample": names,
        "freq_hz": np.tile(F, 2),
        "k_storage_n_mm": both.real / 1e3,
        "k_loss_n_mm": both.imag / 1e3,
    }
    path = tmp_path / f"t.{form if form in ('npz', 'mat', 'h5', 'parquet') else 'json'}"
    frame = pl.DataFrame(columns)
    if form == "npz":
        np.savez(path, **columns)
    elif form == "mat":
        savemat(path, {**columns, "sample": np.array(names, dtype=object)})
    elif form == "h5":
        with pytest.importorskip("h5py").File(path, "w") as file:
            for key, values in columns.items():
                file[key] = values
    elif form == "parquet":
        frame.write_parquet(path)
    else:
        split = {"columns": frame.columns, "data": frame.rows()}
        made = {"records": frame.to_dicts(), "columns": frame.to_dict(as_series=False), "split": split}[form]
        path.write_text(json.dumps(made), encoding="utf-8")
    found = read_measured(path)
    assert found.tyres == ("A", "B")
    np.testing.assert_allclose(found.conditions[1].own.stiffness, 2 * K, rtol=1e-9)


def test_complex_arrays_of_matlab_of_version_7_3(tmp_path):
    h5py = pytest.importorskip("h5py")
    cells = np.zeros((1, F.size), dtype=[("real", "f8"), ("imag", "f8")])
    cells["real"], cells["imag"] = K.real, K.imag
    with h5py.File(tmp_path / "t.mat", "w", userblock_size=512) as file:
        for name, values in (("freq_hz", F[None]), ("K_n_per_m", cells)):
            file[name] = values
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    with (tmp_path / "t.mat").open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, made by a test".ljust(124) + bytes([0, 2]) + b"IM")
    np.testing.assert_allclose(read_k_star(tmp_path / "t.mat").stiffness, K, rtol=1e-9)


def test_thousands_apart_by_a_narrow_blank(tmp_path):
    (tmp_path / "t.csv").write_text(
        "f [Hz];K' [N/m];K'' [N/m]\n1;200\u202f490,94;20\u00a0000,5\n2;201\u202f000,5;20\u00a0100,5\n"
    )
    np.testing.assert_allclose(read_k_star(tmp_path / "t.csv").stiffness[0], 200490.94 + 20000.5j)


def test_a_number_or_name_of_each_row_is_no_label(tmp_path):
    names = [f"p{at}" for at in range(F.size)]
    for head, cells in (("id", 1.0 + np.arange(F.size)), ("name", names)):
        path = written(tmp_path / "t.csv", [head, "f [Hz]", "K' [N/m]", "K'' [N/m]"], cells, F, K.real, K.imag)
        assert len(read_measured(path).conditions) == 1


def test_the_unit_of_a_loaded_radius_is_stated(tmp_path):
    x = np.linspace(0, 20, 21)
    path = written(tmp_path / "t.csv", ["RL", "FZ"], 31 - x / 10, -200 * x)
    with pytest.raises(TableError, match="radius=RL"):
        read_curve(path)
    found = read_curve(path, columns=["radius=RL [cm]", "load=FZ [N]"])
    np.testing.assert_allclose(found.deflection, x * 1e-3, atol=1e-9)
