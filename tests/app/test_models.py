"""fit, causality, map and query, as users run them."""

import json
import shutil
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from tests.unlisted import unlisted

from fourpole.app.models import SHOWING, _fixed
from fourpole.models.families import model_named
from fourpole.plot import FIGURES
from fourpole.study.results import read_results
from fourpole.virtual import CROSS_PLY, RADIAL_PLY, simulate_campaign

pytestmark = pytest.mark.usefixtures("without_figures")


def told(ran):
    return " ".join(ran.stderr.split())


FREQUENCIES = np.geomspace(1.0, 100.0, 24)


def reduced(place, noise=1e-3, std=True, model="zener", values=(180e3, 120e3, 700.0)):
    """A table of one specimen, with or without uncertainties."""
    rng = np.random.default_rng(5)
    clean = model_named(model).stiffness(values, 2 * np.pi * FREQUENCIES)
    spread = noise * np.abs(clean)
    seen = clean + spread * (rng.standard_normal(24) + 1j * rng.standard_normal(24))
    frame = pl.DataFrame({"frequency [Hz]": FREQUENCIES, "Re K* [N/m]": seen.real, "Im K* [N/m]": seen.imag})
    if std:
        frame = frame.with_columns(pl.Series("u(Re K*) [N/m]", spread), pl.Series("u(Im K*) [N/m]", spread))
    frame.write_csv(place)
    return place


@pytest.fixture(scope="module")
def results(run, tmp_path_factory):
    """Two pressures and two preloads of a tyre, analysed, tables only."""
    folder = tmp_path_factory.mktemp("campaign")
    simulate_campaign(
        folder, tyres=[RADIAL_PLY], pressures=[1.5e5, 2.2e5], preloads=[1000.0, 2000.0],
        frequencies=[10.0, 16.0, 24.0],
    )  # fmt: skip
    assert run("analyse", folder, "--tables-only").exit_code == 0
    return folder / "results"


def test_fit_chooses_and_says_why(run, tmp_path):
    table, out = reduced(tmp_path / "k.csv"), tmp_path / "model.json"
    ran = run("fit", table, "--out", out)
    assert ran.exit_code == 0, ran.output
    said = " ".join(ran.stdout.split())
    assert "zener: 3 parameters, chi-square" in said
    assert "A massless, relaxing specimen can have this K*" in said
    assert "zener *" in said
    document = json.loads(out.read_text())
    entry = document["models"][0]
    found = dict(zip([one["symbol"] for one in entry["parameters"]], entry["conditions"][0]["values"], strict=True))
    ends = entry["conditions"][0]["intervals"]
    assert found == pytest.approx({"K1": 180e3, "K2": 120e3, "C": 700.0}, rel=0.01)
    assert all(low < value < high for (low, high), value in zip(ends, found.values(), strict=True))
    assert document["provenance"]["settings"] == {"model": "auto"}


@pytest.mark.sampled(2)
def test_without_uncertainties_they_are_found_and_that_is_said(run, tmp_path):
    ran = run("fit", reduced(tmp_path / "k.csv", noise=5e-3, std=False), "--json")
    assert ran.exit_code == 0, ran.output
    assert "states no uncertainty of K*" in ran.stderr
    entry = json.loads(ran.stdout)["models"][0]
    assert entry["model"] == "zener"
    assert entry["granted"] == pytest.approx(5e-3, rel=0.35)  # of 48 numbers: known to some 11 %
    assert entry["conditions"][0]["verdict"] is None


def test_a_model_by_name_on_a_band_with_a_known_parameter(run, tmp_path):
    table = reduced(tmp_path / "k.csv")
    ran = run("fit", table, "--model", "kelvin", "--band", "1:3 Hz", "--fix", "K=181 kN/m", "--json")
    entry = json.loads(ran.stdout)["models"][0]
    assert entry["model"] == "kelvin"
    assert entry["conditions"][0]["values"][0] == 181e3
    assert entry["conditions"][0]["intervals"][0] == [181e3, 181e3]
    assert entry["conditions"][0]["band"][1] <= 3.0
    assert entry["granted"] > 0  # it does not fit as it stands


def test_k1_is_a_datum(run, tmp_path):
    """K* from 30 Hz on hardly tells K1; a static test to 0.5 % does."""
    table = reduced(tmp_path / "k.csv", noise=1e-2)
    arguments = ("fit", table, "--model", "zener", "--band", "30:100 Hz", "--json")
    free = json.loads(run(*arguments).stdout)["models"][0]["conditions"][0]
    known = json.loads(run(*arguments, "--k1", "180 kN/m", "--std-k1", "0.5 %").stdout)["models"][0]["conditions"][0]
    assert known["covariance"][0][0] < 0.2 * free["covariance"][0][0]
    assert known["values"][0] == pytest.approx(180e3, rel=0.02)


@pytest.mark.sampled(8)
def test_causality_tells_possible_from_impossible(run, tmp_path):
    good = run("causality", reduced(tmp_path / "k.csv"))
    assert good.exit_code == 0
    assert "possible for a massless, relaxing specimen" in good.stdout
    assert "NOT" not in good.stdout
    table = reduced(tmp_path / "k.csv")
    frame = pl.read_csv(table)
    wrong = frame.with_columns(
        pl.when(pl.int_range(24) == 11).then(0.9).otherwise(1.0).mul(pl.col("Im K* [N/m]")).alias("Im K* [N/m]")
    )
    wrong.write_csv(table)
    bad = run("causality", table)
    assert "NOT possible" in bad.stdout
    assert f"with the others as they are: {FREQUENCIES[11]:.5g} Hz" in bad.stdout
    row = json.loads(run("causality", table, "--json").stdout)["conditions"][0]
    assert not row["possible"]
    assert row["impossible [Hz]"] == pytest.approx([FREQUENCIES[11]])
    assert 1e-3 < row["possible with an error of [1]"] < 0.02


def test_causality_assumes_an_uncertainty_where_none_is_stated(run, tmp_path):
    ran = run("causality", reduced(tmp_path / "k.csv", std=False), "--json")
    assert ran.exit_code == 0, ran.output
    assert "taken as 1 %" in ran.stderr
    assert json.loads(ran.stdout)["conditions"][0]["possible"]


@pytest.mark.sampled(4)
def test_a_k1_that_contradicts_is_named(run, tmp_path):
    ran = run("causality", reduced(tmp_path / "k.csv"), "--k1", "260 kN/m", "--std-k1", "1 %")
    assert "it is K1 of the static test" in ran.stdout


def shown_as(results):
    return ("query", results / "map.json", "--pressure", "1.85 bar", "--preload", "1400 N", "--frequency", "13.7 Hz")


@pytest.mark.sampled(8)
def test_results_to_model_map_and_query(run, results):
    fitted = run("fit", results, "--model", "zener")
    assert fitted.exit_code == 0, fitted.output
    assert (results / "model.json").is_file()
    assert not (results / "figures").exists()  # figures are drawn with the report
    mapped = run("map", results)
    assert mapped.exit_code == 0, mapped.output
    assert "leave-one-out error" in " ".join(mapped.stdout.split())
    asked = run(
        "query",
        results / "map.json",
        "--pressure",
        "1.85 bar",
        "--preload",
        "1400 N",
        "--frequency",
        "13.7 Hz",
        "--json",
    )
    row = json.loads(asked.stdout)["rows"][0]
    k2, c = float(RADIAL_PLY.k2(13.7, 1.85e5, 1400.0)), float(RADIAL_PLY.c(13.7, 1.85e5, 1400.0))
    assert abs(row["K2 [N/m]"] - k2) < 4 * row["u(K2) [N/m]"]
    assert abs(row["C [N s/m]"] - c) < 4 * row["u(C) [N s/m]"]
    # the arm of this tyre is a law of the frequency, which no causal model has: the uncertainty is large
    assert 0 < row["u(Re K*) [N/m]"] < row["Re K* [N/m]"]
    assert abs(row["TR [1]"] - 2.5) < 1.0 + 2 * row["u(TR) [1]"]
    shown = run(*shown_as(results))
    assert "K2" in shown.stdout
    assert "±" in shown.stdout
    assert "Intervals are for the next mounting" in " ".join(shown.stdout.split())
    asked = run(*shown_as(results), "--for", "mean", "--json")
    assert json.loads(asked.stdout)["rows"][0]["interval for"] == "mean"
    refused = run(*shown_as(results), "--for", "specimen")
    assert refused.exit_code == 2
    assert "nothing was tested at this point" in " ".join(refused.stderr.split())
    again = run("report", results)
    assert again.exit_code == 0, again.output
    assert again.stderr == "" or "left out" not in again.stderr


@pytest.mark.sampled(2)
def test_a_fit_renews_the_report_of_its_folder_and_says_so_last(run, results, tmp_path):
    folder = shutil.copytree(results, tmp_path / "results")
    (folder / "report.html").write_text("older")
    ran = run("fit", folder, "--model", "zener")
    assert ran.exit_code == 0, ran.output
    assert ran.stdout.splitlines()[-1] == f"report: {folder / 'report.html'}, renewed with this"
    assert "zener" in (folder / "report.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def two(run, tmp_path_factory):
    """Two tyres, analysed, tables only."""
    folder = tmp_path_factory.mktemp("two")
    simulate_campaign(
        folder, tyres=[RADIAL_PLY, CROSS_PLY], pressures=[1.5e5, 2.2e5], preloads=[1000.0],
        frequencies=[10.0, 16.0, 24.0],
    )  # fmt: skip
    assert run("analyse", folder, "--tables-only").exit_code == 0
    return folder / "results"


def models_in(folder, name="model.json"):
    document = json.loads((folder / name).read_text())
    return {one["tyre"]: one for one in document["models"] + document["maps"]}, document["provenance"]


@pytest.mark.sampled(8)
def test_a_fit_of_one_tyre_keeps_the_models_of_others(run, two, tmp_path):
    folder = shutil.copytree(two, tmp_path / "results")
    assert run("fit", folder, "--model", "zener").exit_code == 0
    before, _ = models_in(folder)
    ran = run("fit", folder, "--model", "spring", "--specimen", "radial-ply")
    assert ran.exit_code == 0, ran.output
    assert "model.json keeps 'cross-ply' of an earlier fit" in told(ran)
    after, made = models_in(folder)
    assert after["cross-ply"] == before["cross-ply"]
    assert after["radial-ply"]["model"] == "spring"
    assert list(after) == list(before)
    assert made["settings"] == {"model": "spring", "tyre": "radial-ply", "earlier": {"cross-ply": {"model": "zener"}}}
    assert "earlier   'cross-ply': model zener" in run("verify", folder / "model.json").stdout
    assert run("report", folder).exit_code == 0
    run("fit", folder, "--model", "kelvin", "--specimen", "cross-ply")
    _, made = models_in(folder)
    assert made["settings"]["earlier"] == {"radial-ply": {"model": "spring", "tyre": "radial-ply"}}
    ran = run("fit", folder, "--model", "zener")
    assert "earlier fit" not in ran.stderr
    found, made = models_in(folder)
    assert {one["model"] for one in found.values()} == {"zener"}
    assert made["settings"] == {"model": "zener"}


@pytest.mark.sampled(2)
def test_a_file_of_its_own_keeps_other_tyres_of_the_same_table(run, tmp_path):
    table, made = tmp_path / "k.csv", tmp_path / "own.json"
    rows = "".join(f"{t},{f},{200000 + 900 * f},{9000 + 300 * f}\n" for t in "AB" for f in range(5, 25, 4))
    table.write_text(f"tyre,frequency [Hz],Re K* [N/m],Im K* [N/m]\n{rows}")
    assert run("fit", table, "--std", "1 %", "--model", "kelvin", "--out", made).exit_code == 0
    ran = run("fit", table, "--std", "1 %", "--model", "spring", "--specimen", "B", "--out", made)
    assert "own.json keeps 'A' of an earlier fit" in told(ran)
    models = json.loads(made.read_text())["models"]
    assert {one["tyre"]: one["model"] for one in models} == {"A": "kelvin", "B": "spring"}
    table.write_text(table.read_text().replace("200900", "200901") + "A,30,230000,19000\n")
    assert "is replaced: it is of other results" in told(
        run("fit", table, "--std", "1 %", "--specimen", "B", "--out", made)
    )


@pytest.mark.sampled(2)
def test_the_model_file_of_a_folder_is_the_same_one_by_its_name(run, two, tmp_path):
    """--out RESULTS/model.json is what fit does without the option: the models of other tyres stay."""
    folder = shutil.copytree(two, tmp_path / "results")
    run("fit", folder, "--model", "kelvin")
    ran = run("fit", folder, "--model", "spring", "--specimen", "radial-ply", "--out", folder / "model.json")
    assert ran.exit_code == 0, ran.output
    found, _ = models_in(folder)
    assert {tyre: one["model"] for tyre, one in found.items()} == {"radial-ply": "spring", "cross-ply": "kelvin"}


@pytest.mark.sampled(4)
def test_a_map_of_one_tyre_keeps_the_maps_of_others(run, two, tmp_path):
    folder = shutil.copytree(two, tmp_path / "results")
    for model, tyre in (("zener", "radial-ply"), ("kelvin", "cross-ply")):
        assert run("map", folder, "--model", model, "--specimen", tyre).exit_code == 0
    found, _ = models_in(folder, "map.json")
    assert {tyre: one["model"] for tyre, one in found.items()} == {"radial-ply": "zener", "cross-ply": "kelvin"}


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"sha256": "', '"sha256": "0', "provenance.sha256 was changed"),
        ("fourpole-model", "other-model", "is no model file"),
        ("{", "", "not valid JSON"),
    ],
)
@pytest.mark.sampled(3)
def test_a_model_file_that_cannot_be_kept_is_named_and_replaced(run, two, tmp_path, old, new, said):
    folder = shutil.copytree(two, tmp_path / "results")
    run("fit", folder, "--model", "kelvin")
    unlisted(folder)
    text = (folder / "model.json").read_text()
    (folder / "model.json").write_text(text.replace(old, new, 1))
    ran = run("fit", folder, "--model", "spring", "--specimen", "radial-ply")
    assert ran.exit_code == 0, ran.output
    assert "the former model.json is replaced: " in told(ran)
    assert said in told(ran)
    assert list(models_in(folder)[0]) == ["radial-ply"]


@pytest.mark.sampled(2)
def test_a_model_file_of_other_results_is_replaced(run, two, results, tmp_path):
    folder = shutil.copytree(two, tmp_path / "results")
    run("fit", results, "--model", "kelvin", "--out", folder / "model.json")
    ran = run("fit", folder, "--model", "spring", "--specimen", "cross-ply")
    assert "the former model.json is replaced: it is of other results" in told(ran)
    assert list(models_in(folder)[0]) == ["cross-ply"]


@pytest.mark.sampled(4)
def test_a_fit_draws_nothing_that_no_report_shows(run, two, tmp_path, monkeypatch):
    """Figures of former models go; others, and those that the user draws of them, stay."""
    folder = shutil.copytree(two, tmp_path / "results")
    for key in ("stiffness", "static"):
        assert run("plot", folder, key).exit_code == 0
    monkeypatch.setattr("fourpole.plot.catalogue._drawing", None)
    ran = run("fit", folder, "--model", "zener")
    assert ran.exit_code == 0, ran.output
    assert [one.name for one in (folder / "figures").iterdir()] == ["static.svg"]
    assert ran.stdout.splitlines()[-1] == f"written: {folder / 'model.json'}"


@pytest.mark.sampled(4)
def test_the_figures_that_show_models_are_known(run, two, tmp_path):
    """Each figure whose data change with the models of the folder, or with its maps."""
    folder = shutil.copytree(two, tmp_path / "results")
    run("fit", folder, "--model", "prony")
    run("map", folder, "--model", "zener")
    study = read_results(folder)
    for kind, without in (("model", {"models": None}), ("map", {"maps": None})):
        bare = replace(study, **without)
        for key, spec in FIGURES.items():
            if spec.data is not None and repr(spec.data(study)) != repr(spec.data(bare)):
                assert key in SHOWING[kind], key
        assert set(SHOWING[kind]) <= set(FIGURES)


def test_one_condition_makes_a_map_over_frequency_alone(run, tmp_path):
    out = tmp_path / "map.json"
    ran = run("map", reduced(tmp_path / "k.csv"), "--model", "zener", "--out", out)
    assert ran.exit_code == 0, ran.output
    assert "over one condition" in ran.stdout
    row = json.loads(run("query", out, "--frequency", "14 Hz", "--json").stdout)["rows"][0]
    clean = model_named("zener").stiffness([180e3, 120e3, 700.0], [28 * np.pi])[0]
    assert abs(row["Re K* [N/m]"] - clean.real) < 4 * row["u(Re K*) [N/m]"]
    refused = run("query", out, "--frequency", "14 Hz", "--pressure", "1.7 bar")
    assert refused.exit_code == 2
    assert "do not state pressure" in refused.stderr


def test_on_a_cam_rig_the_payne_effect_has_no_numbers(run, results, tmp_path):
    for command in ("fit", "map"):
        ran = run(command, results, "--model", "kraus", "--out", tmp_path / "none.json")
        assert ran.exit_code == 2
        assert "amplitude and frequency cannot be told apart" in ran.stderr
        assert "variance inflation" in ran.stderr
    assert not (tmp_path / "none.json").exists()


def test_a_query_outside_is_refused_and_writes_nothing(run, results, tmp_path):
    if not (results / "map.json").is_file():
        run("map", results, "--model", "zener")
    ask = ("query", results / "map.json", "--preload", "1400 N", "--frequency", "12,14 Hz", "--out", tmp_path / "k.csv")
    ran = run(*ask, "--pressure", "3 bar")
    assert ran.exit_code == 2
    assert "outside what was measured, by 2.29 half spans" in " ".join(ran.stderr.split())
    assert not (tmp_path / "k.csv").exists()
    ran = run(*ask, "--pressure", "3 bar", "--beyond")
    assert ran.exit_code == 0
    assert "outside what was measured" in " ".join(ran.stderr.split())
    assert pl.read_csv(tmp_path / "k.csv")["outside [half spans]"].to_list() == pytest.approx([2.285714] * 2)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("fit", "none.csv"), "none.csv: there is no such file"),
        (("fit", "k.csv", "--model", "zenner"), "no model 'zenner': choose one of"),
        (("fit", "k.csv", "--model", "maxwell:99"), "1 to 60 arms"),
        (("fit", "k.csv", "--model", "maxwell:8", "--band", "1:2 Hz"), "too few for 17 free parameters"),
        (
            ("fit", "k.csv", "--band", "100:1 Hz"),
            "--band: band '100:1 Hz' is not two rising, positive frequencies, as in '10:24 Hz'",
        ),
        (("fit", "k.csv", "--band", "200:300 Hz"), "no test between 200 and 300 Hz"),
        (("fit", "k.csv", "--tyre", "x"), "no test of a specimen 'x'"),
        (("fit", "k.csv", "--fix", "K1=heavy"), "--fix K1:"),
        (("fit", "k.csv", "--fix", "K1=5 s"), "--fix K1:"),
        (("fit", "k.csv", "--fix", "K1=180"), "--fix: 'K1=180' has no unit: write --fix \"K1=180 kN/m\""),
        (("fit", "k.csv", "--model", "zener", "--fix", "C=700"), 'write --fix "C=700 N s/m"'),
        (("fit", "k.csv", "--model", "maxwell:1", "--fix", "tau_1=5e-3"), 'write --fix "tau_1=5e-3 s"'),
        (("fit", "k.csv", "--model", "shell", "--fix", "k=5 MN/m^3"), "'5 MN/m^3' is not a number in N/m^3"),
        (("fit", "k.csv", "--fix", "K9=5"), "'K9=5' is not a parameter and its value"),
        (("fit", "k.csv", "--model", "spring", "--fix", "K=5 N/m"), "leave at least one free"),
        (("fit", "k.csv", "--std", "200 %"), "between 0 and 100 %"),
        (("fit", "k.csv", "--std-k1", "2 %"), "--std-k1 is of --k1"),
        (("fit", "k.csv", "--over", "camber [deg]"), "no column 'camber [deg]'"),
        (("fit", "text.csv"), "text.csv: no column is understood as the frequency among a, b"),
        (("query", "k.csv", "--frequency", "10 Hz"), "is no model file"),
        (("query", "none.json", "--frequency", "10 Hz"), "there is no such file"),
        (("query", "none.json", "--frequency", "ten"), "--frequency: frequencies 'ten' lack"),
        (("query", "none.json", "--frequency", "10 Hz", "--pressure", "10 N"), "--pressure:"),
        (("query", "none.json", "--frequency", "10 Hz", "--at", "camber"), "--at:"),
        (("causality", "text.csv"), "no column is understood"),
    ],
)
def test_bad_input_is_told_in_one_message(run, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    reduced(tmp_path / "k.csv")
    (tmp_path / "text.csv").write_text("a,b\n1,2\n")
    before = sorted(tmp_path.iterdir())
    ran = run(*arguments)
    assert ran.exit_code == 2, ran.output
    assert said in " ".join(ran.stderr.split())
    assert "Traceback" not in ran.output
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.sampled(4)
def test_a_model_file_of_other_results_is_not_shown_as_theirs(run, results, tmp_path):
    folder = tmp_path / "results"
    shutil.copytree(results, folder, ignore=shutil.ignore_patterns("cache", "figures", "*.html"))
    run("fit", folder, "--model", "zener")
    unlisted(folder)
    whole = (folder / "model.json").read_text()
    (folder / "model.json").write_text(whole.replace('"causal": true', '"causal": false', 1))
    ran = run("report", folder)
    assert ran.exit_code == 0, ran.output
    assert "models[0].causal was changed" in " ".join(ran.stderr.split())
    (folder / "model.json").write_text(whole)
    table = (folder / "dynamic.csv").read_text().replace("radial-ply", "other")
    (folder / "dynamic.csv").write_text(table)
    ran = run("report", folder)
    assert ran.exit_code == 0, ran.output
    assert "model.json is of other results and left out: run fourpole fit again" in " ".join(ran.stderr.split())


@pytest.mark.parametrize(
    ("model", "text", "symbol", "expected"),
    [
        ("shell", "{symbol}=3 {unit}", "every", 3.0),
        ("zener", "C=0.7 kN s/m", "C", 700.0),
        ("zener", "K1=180 kN/m", "K1", 180e3),
        ("zener", "K1=180kN/m", "K1", 180e3),
        ("zener", "K1=180000N/m", "K1", 180e3),
        ("fractional", "alpha=0.4", "alpha", 0.4),
        ("fractional", "alpha=40 %", "alpha", 0.4),
        ("maxwell:1", "tau_1=5 ms", "tau_1", 5e-3),
    ],
)
def test_a_fixed_parameter_has_the_unit_of_its_family(model, text, symbol, expected):
    """The unit of each parameter comes from its family; every parameter can be stated with it."""
    for one in model_named(model).parameters:
        if symbol in ("every", one.symbol):
            assert _fixed([text.format(symbol=one.symbol, unit=one.unit)], model) == {one.symbol: expected}


@pytest.mark.sampled(2)
def test_a_static_test_joins_as_a_ramp_on_request(run, results, tmp_path):
    out = tmp_path / "model.json"
    ran = run("fit", results, "--model", "zener", "--static", "ramp", "--std-static", "4 %", "--out", out)
    assert ran.exit_code == 0, ran.output
    assert "(before the fit: 1 ± 0.04)" in " ".join(ran.stdout.split())
    document = json.loads(out.read_text())
    assert document["provenance"]["settings"]["static"] == "ramp"
    for one in document["models"][0]["conditions"]:
        assert one["static"]["branch_time"] == pytest.approx(10.0, rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--static", "slow"], "neither rest nor ramp"),
        (["--std-static", "5 %"], "is of --static ramp"),
        (["--static", "ramp", "--k1", "180 kN/m"], "--k1 states no time"),
        (["--static", "ramp", "--share", "K1"], "--share takes K1 at rest"),
        (["--static", "ramp", "--std-static", "200 %"], "between 0 and 100 %"),
    ],
)
def test_a_static_option_that_makes_no_sense_is_told(run, results, arguments, said):
    ran = run("fit", results, "--model", "zener", *arguments)
    assert ran.exit_code == 2
    assert said in " ".join(ran.stderr.split())


def test_a_table_without_static_tests_cannot_have_a_ramp(run, tmp_path):
    ran = run("fit", reduced(tmp_path / "k.csv"), "--static", "ramp")
    assert ran.exit_code == 2
    assert "has no static.csv" in ran.stderr
