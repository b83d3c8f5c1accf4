"""From tables of isotherms to a master curve on disk, a fitted model with the law, and answers at a temperature."""

import json
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.models.isotherms import C1, C2, fractional_zener, isotherm, log_a

from fourpole.errors import ModelError
from fourpole.fitting.measured import read_measured
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.fitting.query import Query, ask
from fourpole.fitting.shifting import (
    _isotherm,
    law_document,
    law_file,
    laws_beside,
    master_tables,
    overlap_table,
    read_isotherms,
    shift_table,
    shift_tyres,
)
from fourpole.io.door import sha256_of
from fourpole.io.tables.kstar import TableOptions

T = (0.0, 10.0, 20.0, 35.0, 50.0)
HERTZ = "frequency [Hz]"


def table(path, temperatures=T, noise=0.01, seed=2, jitter=0.1, scale=1.0, heads=("Re K* [N/m]", "Im K* [N/m]")):
    rng = np.random.default_rng(seed)
    parts = []
    for t in temperatures:
        one = isotherm(t, int(rng.integers(2**32)), noise)
        columns = {HERTZ: one.frequency, heads[0]: one.stiffness.real / scale, heads[1]: one.stiffness.imag / scale}
        parts.append(pl.DataFrame({**columns, "temperature [degC]": t + jitter * rng.uniform(-1, 1, one.omega.size)}))
    pl.concat(parts).write_csv(path)
    return path


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("master")
    measured = read_isotherms([table(folder / "isotherms.csv")])
    (one,) = shift_tyres(measured, 20.0)
    master, covariance = master_tables([one])
    master.write_csv(folder / "master.csv")
    covariance.write_parquet(folder / "covariance.parquet")
    sha256 = sha256_of(folder / "master.csv", max_bytes=10**7, label="master.csv")
    (folder / "temperature.json").write_text(json.dumps(law_document([one], sha256)), encoding="utf-8")
    return folder, one, sha256


@pytest.fixture(scope="module")
def model(made):
    folder, _, sha256 = made
    measured = read_measured(folder / "master.csv")
    laws, note = laws_beside(folder / "master.csv", sha256)
    assert not note
    model_file(measured, fit_tyres(measured, "fractional"), laws=laws).write(folder / "model.json")
    return read_model_file(folder / "model.json")


def test_rows_within_a_kelvin_are_one_isotherm_and_the_table_has_every_shift_factor(made):
    _, one, _ = made
    assert one.found.temperatures == pytest.approx(T, abs=0.1)
    rows = shift_table([one])
    assert rows["log10 aT [1]"].to_numpy() == pytest.approx(log_a(one.found.temperatures) / np.log(10), abs=0.05)
    assert overlap_table([one]).height == len(T) - 1


def test_several_tables_are_the_same_as_one(made, tmp_path):
    _, one, _ = made
    every = pl.read_csv(made[0] / "isotherms.csv")
    paths = []
    for at, t in enumerate(T):
        paths.append(tmp_path / f"{at}.csv")
        every.filter((pl.col("temperature [degC]") - t).abs() < 1).write_csv(paths[-1])
    (again,) = shift_tyres(read_isotherms(paths), 20.0)
    assert again.found.log_a == pytest.approx(one.found.log_a, abs=1e-6)


def test_moduli_in_any_unit_are_read_and_become_a_stiffness(tmp_path):
    path = table(tmp_path / "g.csv", scale=1e6, heads=("G' [MPa]", "G'' [MPa]"))
    plain, shaped = read_isotherms([path]), read_isotherms([path], options=TableOptions(factor=0.05))
    first, second = (one.conditions[0].own.stiffness for one in (plain, shaped))
    assert second == pytest.approx(0.05 * first)


def test_a_table_without_a_temperature_is_refused(tmp_path):
    path = table(tmp_path / "t.csv")
    pl.read_csv(path).drop("temperature [degC]").write_csv(path)
    with pytest.raises(ModelError, match=r"t\.csv: has no temperature \[degC\]"):
        read_isotherms([path])


def test_a_query_at_a_temperature_covers_the_truth(model):
    """K* of the simulation at temperatures between the isotherms, and at each of them."""
    off = []
    for t in (0.5, 5.0, 15.0, 27.0, 45.0):
        for row in ask(model, Query([1.0, 10.0], {"temperature [degC]": t})):
            truth = fractional_zener(2 * np.pi * row[HERTZ] * np.exp(log_a(t)))
            off.append((row["Re K* [N/m]"] - truth.real) / row["u(Re K*) [N/m]"])
            off.append((row["Im K* [N/m]"] - truth.imag) / row["u(Im K*) [N/m]"])
            assert row["temperature [degC]"] == t
            assert row["reduced frequency [Hz]"] == pytest.approx(row[HERTZ] * np.exp(log_a(t)), rel=0.1)
            assert abs(row["Re K* [N/m]"] / truth.real - 1) < 0.05
    assert np.max(np.abs(off)) < 4


def test_without_the_factors_found_the_uncertainty_of_the_law_is_part_of_the_answer(made, model):
    at = Query([10.0], {"temperature [degC]": 45.0})
    entry = model.models[0]
    plain = entry.temperature.model_copy(update={"shifts": None})
    exact = plain.model_copy(update={"covariance": [[0.0, 0.0], [0.0, 0.0]]})
    files = (model.model_copy(update={"models": [entry.model_copy(update={"temperature": t})]}) for t in (plain, exact))
    whole, part = (ask(one, at)[0]["u(Re K*) [N/m]"] for one in files)
    law = law_file(made[1]).shift_law
    step = 1e-4
    reduced = 2 * np.pi * 10.0 * np.exp(law.log_a(45.0)[0])
    slope = (fractional_zener(reduced * (1 + step)) - fractional_zener(reduced * (1 - step))).real / (2 * step)
    assert np.sqrt(whole**2 - part**2) == pytest.approx(slope * law.log_a_std(45.0)[0], rel=0.05)


def test_a_temperature_outside_the_isotherms_is_refused_or_told(model):
    far = {"temperature [degC]": 75.0}
    with pytest.raises(ModelError, match="75 degC is outside the isotherms, by 1 half spans"):
        ask(model, Query([10.0], far))
    (row,) = ask(model, Query([10.0], far, beyond=True))
    assert "outside the isotherms" in row["remarks"]
    with pytest.raises(ModelError, match="the WLF law ends"):
        ask(model, Query([10.0], {"temperature [degC]": -200.0}, beyond=True))


def test_a_reduced_frequency_outside_the_master_curve_is_refused(model):
    with pytest.raises(ModelError, match="outside the measured band"):
        ask(model, Query([0.001], {"temperature [degC]": 50.0}))


def test_a_law_of_another_master_curve_is_not_taken(made):
    folder, _, _ = made
    laws, note = laws_beside(folder / "master.csv", "0" * 64)
    assert not laws
    assert "run fourpole shift again" in note
    assert laws_beside(folder / "isotherms.csv", "") == ({}, "")


def test_a_law_beside_a_master_curve_that_was_changed_is_not_taken(made, model, tmp_path):
    folder = made[0]
    document = json.loads((folder / "temperature.json").read_text(encoding="utf-8"))
    document["laws"][0]["temperature"]["constants"][0]["value"] *= 1.01
    (tmp_path / "temperature.json").write_text(json.dumps(document), encoding="utf-8")
    laws, note = laws_beside(tmp_path / "master.csv", document["master sha256"])
    assert laws == {}
    assert note.startswith("temperature.json: laws was changed: ")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda law: law["constants"].pop(), "has the constants C1"),
        (lambda law: law.update(reference=90.0), "outside the range"),
        (lambda law: law["constants"][1].update(value=5.0), "ends within its range"),
        (lambda law: law["covariance"][0].__setitem__(1, 1e9), "covariance"),
        (lambda law: law.update(law="VFT"), "WLF"),
    ],
)
def test_a_law_that_was_changed_is_refused(made, model, tmp_path, change, message):
    document = model.document
    change(document["models"][0]["temperature"])
    path = tmp_path / "model.json"
    path.write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ModelError, match=message):
        read_model_file(path)


def test_the_law_of_the_simulation_is_in_the_file(model):
    law = model.models[0].temperature
    assert law.law == "WLF"
    values, std = [one.value for one in law.constants], np.sqrt(np.diag(law.covariance))
    shifted = law.shift_law.at_reference(20.0)
    assert np.all(np.abs(shifted.values - [C1, C2]) < 4 * std)
    assert len(values) == 2


def test_errors_that_the_recordings_share_stay_in_the_master_curve(tmp_path):
    """A gain known to 2 % leaves every point of the master curve uncertain by 2 %, all together."""
    measured = read_isotherms([table(tmp_path / "isotherms.csv", noise=1e-3)], std=1e-3)
    gain = 0.02
    conditions = []
    for one in measured.conditions:
        along = gain * np.stack([one.own.stiffness.real, one.own.stiffness.imag], axis=1).reshape(-1, 1)
        conditions.append(replace(one, shared=along))
    (found,) = shift_tyres(replace(measured, conditions=tuple(conditions)), 20.0)
    master, covariance = master_tables([found])
    of_gain = np.array([row[-1] for row in covariance["shared Re K* [N/m]"].to_list()])
    assert of_gain == pytest.approx(gain * master["Re K* [N/m]"].to_numpy(), rel=0.01)
    assert np.all(master["u(Re K*) [N/m]"].to_numpy() > 0.99 * gain * master["Re K* [N/m]"].to_numpy())


def test_a_cell_that_is_no_number_is_named(tmp_path):
    cells = {HERTZ: ["1", "2", "3"], "E' [MPa]": ["1.0", "oops", "2"], "E'' [MPa]": ["0.1", "0.2", "0.3"]}
    pl.DataFrame(cells | {"T [K]": [293.15] * 3}).write_csv(tmp_path / "e.csv")
    measured = read_isotherms([tmp_path / "e.csv"])
    assert measured.conditions[0].state["temperature [degC]"] == pytest.approx(20.0)
    assert "row 3, column 'E'': 'oops' is no number: the row cannot be used" in measured.notes


def test_very_low_frequencies_stay_apart(tmp_path):
    rows = {HERTZ: [1e-14, 2e-14, 3e-14] * 2, "temperature [degC]": [0.0] * 3 + [20.0] * 3}
    rows |= {"Re K* [N/m]": [1e5, 1.1e5, 1.2e5] * 2, "Im K* [N/m]": [1e4] * 6}
    pl.DataFrame(rows).write_csv(tmp_path / "low.csv")
    (one, _) = read_isotherms([tmp_path / "low.csv"], std=0.01).conditions
    assert one.own.omega.size == _isotherm(one, known=True).frequency.size == 3
