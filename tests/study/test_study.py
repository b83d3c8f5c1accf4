"""What an analysis writes: the files, their columns and their order, the same whenever and however it is run."""

import csv
import hashlib
import json
import random
import re
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from fourpole import analyse
from fourpole.campaign import read_campaign

STATIC = [
    "test",
    "tyre",
    "construction",
    "pressure [Pa]",
    "preload [N]",
    "K1 [N/m]",
    "u(K1) [N/m]",
    "K1 of",
    "K1 loading [N/m]",
    "K1 unloading [N/m]",
    "branch gap [N]",
    "secant [N/m]",
    "hysteresis loss [J]",
    "u(hysteresis loss) [J]",
    "time per branch [s]",
    "cycle",
    "nonlinearity [1]",
    "verdict",
    "remarks",
]
DYNAMIC = [
    "test",
    "rig",
    "tyre",
    "construction",
    "pressure [Pa]",
    "preload [N]",
    "added mass [kg]",
    "temperature [degC]",
    "frequency [Hz]",
    "F1 [N]",
    "V1 [m/s]",
    "V2 [m/s]",
    "phase F1-V1 [rad]",
    "phase V2-V1 [rad]",
    "deflection amplitude [m]",
    "R [m/(N s)]",
    "I [m/(N s)]",
    "u(R) [m/(N s)]",
    "u(I) [m/(N s)]",
    "corr(R,I) [1]",
    "Re K* [N/m]",
    "Im K* [N/m]",
    "u(Re K*) [N/m]",
    "u(Im K*) [N/m]",
    "corr(Re,Im K*) [1]",
    "loss factor [1]",
    "u(loss factor) [1]",
    "K1 [N/m]",
    "u(K1) [N/m]",
    "K2 [N/m]",
    "C [N s/m]",
    "u(K2) [N/m]",
    "u(C) [N s/m]",
    "corr(K2,C) [1]",
    "TR measured [1]",
    "TR predicted [1]",
    "u(TR) [1]",
    "energy per cycle [J]",
    "u(energy per cycle) [J]",
    "route",
    "K* of",
    "verdict",
    "remarks",
    "verdict K*",
    "verdict K2 C",
    "verdict TR",
]
COVARIANCE = "covariance Re F1, Im F1, Re V1, Im V1, Re V2, Im V2"
FILES = {"static.csv", "dynamic.csv", "dynamic.parquet", "phasors.parquet", "study.json"}


def files(folder):
    """The bytes of each result; study.json without the path of the campaign, and the seal over it."""
    found = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    record = json.loads(found["study.json"])
    return {**found, "study.json": {key: value for key, value in record.items() if key not in ("campaign", "seal")}}


def rows_of(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def results(noisy_campaign, tmp_path_factory):
    from fourpole import analyse

    return analyse(noisy_campaign).write(tmp_path_factory.mktemp("results"))


def test_the_files_and_their_columns_are_the_contract(results):
    assert set(files(results)) >= FILES
    assert pl.read_csv(results / "static.csv").columns == STATIC
    assert pl.read_csv(results / "dynamic.csv").columns == DYNAMIC
    assert [row["test"] for row in rows_of(results / "static.csv")] == ["S1"]
    assert [row["test"] for row in rows_of(results / "dynamic.csv")] == ["D1", "D2", "D3", "D4"]


def test_a_good_campaign_has_no_blank_number_and_no_remark(results):
    for name in ("static.csv", "dynamic.csv"):
        for row in rows_of(results / name):
            assert row["verdict"] == "ok"
            assert {column for column, cell in row.items() if cell == ""} <= {"rig", "temperature [degC]", "remarks"}


def test_parquet_and_csv_say_the_same(results):
    parquet = pl.read_parquet(results / "dynamic.parquet")
    again = pl.read_csv(results / "dynamic.csv", schema=parquet.schema)
    blank = pl.col(pl.String).fill_null("")
    assert again.with_columns(blank).equals(parquet.with_columns(blank))
    numbers = [name for name in DYNAMIC if name.endswith("]")]
    assert {parquet.schema[name] for name in numbers} == {pl.Float64()}


def test_phasors_are_the_amplitudes_with_a_proper_covariance(results):
    phasors = pl.read_parquet(results / "phasors.parquet")
    dynamic = pl.read_parquet(results / "dynamic.parquet")
    assert phasors["test"].to_list() == dynamic["test"].to_list()
    parts = {
        name: phasors[f"Re {name} [{unit}]"].to_numpy() + 1j * phasors[f"Im {name} [{unit}]"].to_numpy()
        for name, unit in (("F1", "N"), ("V1", "m/s"), ("V2", "m/s"))
    }
    for name, unit in (("F1", "N"), ("V1", "m/s"), ("V2", "m/s")):
        np.testing.assert_allclose(abs(parts[name]), dynamic[f"{name} [{unit}]"], rtol=1e-14)
    np.testing.assert_allclose(np.angle(parts["F1"] / parts["V1"]), dynamic["phase F1-V1 [rad]"], rtol=1e-12)
    np.testing.assert_allclose(np.angle(parts["V2"] / parts["V1"]), dynamic["phase V2-V1 [rad]"], rtol=1e-12)
    moved = abs(parts["V1"] - parts["V2"]) / (2 * np.pi * dynamic["frequency [Hz]"])
    np.testing.assert_allclose(moved, dynamic["deflection amplitude [m]"], rtol=1e-12)
    mobility = dynamic["R [m/(N s)]"].to_numpy() + 1j * dynamic["I [m/(N s)]"].to_numpy()
    found = {row["value"]: row["found"] for row in rows_of(results / "rig.csv")}
    gain = float(found["gain F1/V1"]) * np.exp(1j * float(found["phase F1-V1"]))
    np.testing.assert_allclose(parts["V1"] / parts["F1"] * gain, mobility, rtol=1e-9)

    covariance = phasors[COVARIANCE].to_numpy().reshape(-1, 6, 6)
    variance = np.diagonal(covariance, axis1=1, axis2=2)
    assert (variance > 0).all()
    correlation = covariance / np.sqrt(variance[:, :, None] * variance[:, None, :])
    np.testing.assert_allclose(correlation, correlation.transpose(0, 2, 1), atol=1e-15)
    assert np.linalg.eigvalsh(correlation).min() > -1e-12


def test_study_json_holds_what_it_takes_to_repeat_the_run(results, noisy_campaign):
    study = json.loads((results / "study.json").read_text(encoding="utf-8"))
    assert study["title"] == "Radial-ply, virtual (seed 1982)"
    assert study["settings"] == {"route": "joint", "monte_carlo": 10_000, "seed": 1982}
    assert study["verdicts"] == {"ok": 5, "warning": 0, "rejected": 0}
    (assumed,) = study["assumptions"]
    assert assumed.startswith('[unstated] ordinary = "zero"')
    (rests,) = study["notes"]
    assert rests.startswith("[rig]: K' rests on ")
    assert {"python", "fourpole", "numpy", "scipy", "polars"} <= set(study["versions"])
    read = ["campaign.toml", "tests.csv", *(f"recordings/{test}.csv" for test in ("S1", "D1", "D2", "D3", "D4"))]
    assert study["sha256"] == {name: hashlib.sha256((noisy_campaign / name).read_bytes()).hexdigest() for name in read}


def test_hashes_are_of_the_statement_as_it_was_read(noisy):
    path = noisy.path / "campaign.toml"
    campaign, read = read_campaign(noisy.path), hashlib.sha256(path.read_bytes()).hexdigest()
    path.write_text(path.read_text(encoding="utf-8").replace("15.0", "16.0"), encoding="utf-8")
    assert analyse(campaign).record["sha256"]["campaign.toml"] == read


def test_results_do_not_say_where_or_when_they_were_made(noisy):
    for path in filter(Path.is_file, noisy.analyse().write(noisy.path / "results").rglob("*")):
        content = path.read_bytes()
        assert str(noisy.path).encode() not in content
        assert not re.search(rb"20\d\d-\d\d-\d\d", content)


def test_further_columns_pass_through_unchanged(noisy):
    noisy.add_column("operator", {"D1": '"Meier, A."', "D2": " 007 ", "D4": "Ö 1.50"})
    noisy.add_column("route", {}, default="north")
    noisy.add_column("torque [N m]", {"D3": "1e3"})
    rows = rows_of(noisy.analyse().write(noisy.path / "results") / "dynamic.csv")
    assert list(rows[0]) == [*DYNAMIC, "operator", "route (tests.csv)", "torque [N m]"]
    assert [row["operator"] for row in rows] == ["Meier, A.", "007", "", "Ö 1.50"]
    assert {row["route (tests.csv)"] for row in rows} == {"north"}
    assert {row["route"] for row in rows} == {"joint"}
    assert [row["torque [N m]"] for row in rows] == ["", "", "1e3", ""]


def test_rows_come_in_the_order_of_tests_csv_with_the_same_values(noisy, results):
    lines = (noisy.path / "tests.csv").read_text().splitlines()
    body = lines[1:]
    random.Random(4).shuffle(body)
    assert body != lines[1:]
    (noisy.path / "tests.csv").write_text("\n".join([lines[0], *body]) + "\n")
    shuffled = noisy.analyse().write(noisy.path / "results")
    assert [row["test"] for row in rows_of(shuffled / "dynamic.csv")] == [
        name for name in (line.partition(",")[0] for line in body) if name != "S1"
    ]
    for name in ("static.csv", "dynamic.csv"):
        assert sorted(map(str, rows_of(shuffled / name))) == sorted(map(str, rows_of(results / name)))


def test_columns_of_tests_csv_in_another_order_change_nothing(noisy, results):
    table = pl.read_csv(noisy.path / "tests.csv", infer_schema=False)
    table.select(reversed(table.columns)).write_csv(noisy.path / "tests.csv")
    again = noisy.analyse().write(noisy.path / "results")
    assert (again / "dynamic.csv").read_bytes() == (results / "dynamic.csv").read_bytes()


def test_running_again_gives_the_same_files_with_a_cache_or_without(noisy, results):
    first = files(noisy.analyse().write(noisy.path / "results"))
    assert first == files(results)
    for _ in range(2):
        assert files(noisy.analyse(cache=noisy.path / "cache").write(noisy.path / "results")) == first


def test_results_of_an_earlier_run_are_replaced_and_other_files_stay(noisy):
    out = noisy.path / "results"
    noisy.analyse().write(out)
    (out / "notes.txt").write_text("mine")
    noisy.edit("tests.csv", "D4,recordings/D4.csv,dynamic,radial-ply,1.7,1000,24\n", "")
    noisy.analyse(route="relative").write(out)
    assert [row["test"] for row in rows_of(out / "dynamic.csv")] == ["D1", "D2", "D3"]
    assert {row["route"] for row in rows_of(out / "dynamic.csv")} == {"relative"}
    assert set(files(out)) >= FILES | {"notes.txt"}


def test_a_campaign_of_static_tests_needs_no_rig_and_no_motion(noisy):
    text = (noisy.path / "campaign.toml").read_text()
    kept = [line for line in text.splitlines() if line.startswith(("load", "deflection"))]
    (noisy.path / "campaign.toml").write_text("\n".join(["[channels]", *kept, "[tyres.radial-ply]", ""]))
    (noisy.path / "tests.csv").write_text(
        "test,file,kind,tyre,pressure [bar],preload [N]\n"
        "A,recordings/S1.csv,static,radial-ply,1.7,1000\n"
        "B,recordings/S1.csv,static,radial-ply,,\n"
    )
    study = noisy.analyse()
    out = study.write(noisy.path / "results")
    assert set(files(out)) >= FILES
    assert study.counts == {"ok": 2, "warning": 0, "rejected": 0}
    a, b = rows_of(out / "static.csv")
    assert float(a["K1 [N/m]"]) == pytest.approx(109950, rel=1e-3)
    assert b["K1 [N/m]"] == ""
    assert "state one in this row" in b["remarks"]
    assert rows_of(out / "dynamic.csv") == []
    assert pl.read_csv(out / "dynamic.csv").columns == pl.read_parquet(out / "dynamic.parquet").columns == DYNAMIC
    assert pl.read_parquet(out / "phasors.parquet").is_empty()


def test_a_misspelt_kind_does_not_ask_for_a_rig(noisy):
    text = (noisy.path / "campaign.toml").read_text()
    kept = [line for line in text.splitlines() if line.startswith(("load", "deflection"))]
    (noisy.path / "campaign.toml").write_text("\n".join(["[channels]", *kept, "[tyres.radial-ply]", ""]))
    (noisy.path / "tests.csv").write_text(
        "test,file,kind,tyre,preload [N]\nA,recordings/S1.csv,static,radial-ply,1000\nB,x.csv,statik,radial-ply,\n"
    )
    study = noisy.analyse()
    assert study.counts == {"ok": 1, "warning": 0, "rejected": 1}


def test_counts_take_a_static_test_by_its_worst_preload(noisy):
    noisy.edit("tests.csv", "1.7,1000,24", "1.7,9000,24")
    study = noisy.analyse()
    assert study.static["verdict"].to_list() == ["ok", "rejected"]
    assert study.dynamic["verdict"].to_list() == ["ok", "ok", "ok", "warning"]
    assert study.counts == {"ok": 3, "warning": 1, "rejected": 1}
