"""A study as people use it in a script: the tests of one state, fits by name, tables for pandas, recordings again."""

import shutil
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

import fourpole
from fourpole.core.rig import Rig
from fourpole.errors import CampaignError, ModelError, RigError, UnitError
from fourpole.models import Zener
from fourpole.study import analyse, read_results
from fourpole.study.tables import TABLES, read_table
from fourpole.virtual import simulate_campaign


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("campaign")
    simulate_campaign(
        place, pressures=[135e3, 205e3], preloads=[1000.0, 1500.0], frequencies=[10.0, 13.0, 16.0, 19.0], clean=True
    )
    return place


@pytest.fixture(scope="module")
def study(folder):
    made = analyse(folder)
    made.write(folder / "results")
    return made


@pytest.fixture(scope="module")
def again(study, folder):
    return read_results(folder)


def test_a_study_that_is_read_gives_what_the_analysis_gave(study, again):
    for name in ("static", "dynamic", "checks", "phasors", "covariance", "likelihood", "budget"):
        assert getattr(again, name).equals(getattr(study, name)), name
    assert again.counts == study.counts
    assert (again.route, again.notes, again.assumptions, again.sha256) == (
        study.route, study.notes, study.assumptions, study.sha256,
    )  # fmt: skip
    assert list(again.tests) == list(study.tests)
    one, other = again.tests["D1"], study.tests["D1"]
    assert (one.stated, one.kind, one.verdict, one.remarks) == (other.stated, other.kind, other.verdict, other.remarks)
    assert one.phasors == other.phasors


@pytest.mark.sampled(4)
def test_a_study_that_is_read_fits_and_maps_as_the_analysis_does(study, again):
    fits, others = again.fit("zener"), study.fit("zener")
    for fit, other in zip(fits, others, strict=True):
        for mine, theirs in zip(fit.chosen.fits, other.chosen.fits, strict=True):
            assert mine.values == pytest.approx(theirs.values, rel=1e-9)
    assert fits["radial-ply"] is fits[1]
    with pytest.raises(ModelError, match=r"no specimen 'radial_ply': did you mean 'radial-ply'"):
        fits["radial_ply"]


def test_a_recording_is_found_by_the_path_of_its_campaign(again, folder, tmp_path):
    recording = again.tests["D1"].recording()
    assert recording.duration == pytest.approx(4.1, abs=0.1)
    moved = tmp_path / "moved"
    shutil.copytree(folder / "results", moved)
    alone = read_results(moved).tests["D1"]
    with pytest.raises(CampaignError, match=r"pass the folder of the campaign: recording\(campaign=\.\.\.\)"):
        alone.recording()
    assert alone.recording(folder).duration == recording.duration


def test_some_tests_of_a_study(study):
    part = study.only(tyre="radial-ply", pressure="1.35 bar", preload=1000.0)
    assert part.dynamic["tyre"].unique().to_list() == ["radial-ply"]
    assert set(part.dynamic["pressure [Pa]"]) == {135e3}
    assert set(part.static["preload [N]"]) == {1000.0}
    assert part.dynamic.height == 4
    assert set(part.budget["test"]) == set(part.dynamic["test"])
    assert study.only().dynamic.equals(study.dynamic)
    assert study.plot("K2", tyre="radial-ply").key == "arm"
    assert part.likelihoods is study.likelihoods


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ({"tyre": "radail-ply"}, "no test has tyre 'radail-ply': did you mean 'radial-ply'?"),
        ({"tyre": "bias"}, "no test has tyre 'bias': there is cross-ply, radial-ply"),
        ({"presure": 1e5}, "no axis 'presure': did you mean 'pressure'?"),
        ({"pressure": "3 bar"}, "no test has pressure '3 bar': there is 1.35 bar, 2.05 bar"),
    ],
)
def test_a_state_that_is_not_there_is_said_with_what_there_is(study, where, said):
    with pytest.raises(CampaignError) as error:
        study.only(**where)
    assert str(error.value) == said


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"u": 0.0}, "finite values above 0 N/m"),
        ({"u": "-0.5 %"}, "finite values above 0 N/m"),
        ({"u": np.nan}, "finite values above 0 N/m"),
        ({"u": [500.0] * 3}, "5, 5 and 3 values"),
        ({"u": 500.0, "k1": 150e3}, "give u_k1"),
    ],
)
def test_uncertainties_that_cannot_be_are_refused(given, said):
    k_star = Zener().stiffness([150e3, 60e3, 300.0], 2 * np.pi * np.geomspace(5.0, 80.0, 5))
    with pytest.raises(ModelError, match=said):
        fourpole.fit(np.geomspace(5.0, 80.0, 5), k_star, model="zener", **given)


def test_a_table_for_pandas_needs_no_arrow(study, monkeypatch):
    made = {}
    monkeypatch.setitem(
        __import__("sys").modules, "pandas", type("pandas", (), {"DataFrame": staticmethod(made.update)})
    )
    study.to_pandas("dynamic")
    assert list(made) == study.dynamic.columns
    assert made["test"] == study.dynamic["test"].to_list()
    with pytest.raises(CampaignError, match="no table 'dynamics': did you mean 'dynamic'"):
        study.to_pandas("dynamics")


def test_results_of_an_older_version_have_their_tests_without_a_recording(study, tmp_path):
    record = {key: value for key, value in study.record.items() if key not in ("tests", "campaign")}
    old = fourpole.Study(record=record, tables=study.tables)
    assert set(old.tests) == set(study.tests)
    assert old.tests["D1"].verdict == "ok"
    with pytest.raises(CampaignError, match="an older version wrote these results"):
        old.tests["D1"].recording()


FREQUENCY = np.geomspace(1.0, 100.0, 20)
K_STAR = Zener().stiffness([180e3, 120e3, 700.0], 2 * np.pi * FREQUENCY)


@pytest.mark.parametrize("u", ["0.1 %", "200 N/m", 200.0, np.full(20, 200.0)])
def test_arrays_are_fitted(u):
    found = fourpole.fit(FREQUENCY, K_STAR, u=u, k1="180 kN/m", u_k1=500.0)
    assert found.model == "zener"
    assert found.params == pytest.approx({"K1": 180e3, "K2": 120e3, "C": 700.0}, rel=1e-6)
    assert found.units == {"K1": "N/m", "K2": "N/m", "C": "N s/m"}
    assert found.predict(FREQUENCY) == pytest.approx(K_STAR, rel=1e-6)
    low, high = found.interval("K2")
    assert low < 120e3 < high
    assert high - low == pytest.approx(2 * 1.96 * found.u["K2"], rel=0.02)


def test_a_parameter_that_is_not_there_is_said():
    found = fourpole.fit(FREQUENCY, K_STAR, u=200.0, model="zener")
    with pytest.raises(ModelError, match="zener has no parameter 'K3': did you mean"):
        found.interval("K3")
    with pytest.raises(UnitError):
        fourpole.fit(FREQUENCY, K_STAR, u="200 N")


def test_a_rig_takes_texts_with_their_units():
    rig = Rig(
        moving_mass="15 kg", preload_stiffness="12.44 kN/m", preload_damping="15 N s/m", std={"moving_mass": "100 g"}
    )
    assert rig == Rig(
        moving_mass=15.0, preload_stiffness=12440.0, preload_damping=15.0, std={"moving_mass": 0.1}
    )  # fmt: skip
    with pytest.raises(UnitError, match="mass"):
        Rig(moving_mass="15 N", preload_stiffness=1.0)
    with pytest.raises(RigError, match="it must be a finite, positive number"):
        Rig(moving_mass="0 kg", preload_stiffness=1.0)


def test_tables_of_a_folder_are_read_when_they_are_asked_for(again, monkeypatch):
    assert isinstance(again.phasors, pl.DataFrame)
    assert again.table("weather").is_empty()


def test_checks_of_an_older_version_have_blank_values(study):
    """checks.csv had no column of values."""
    text = study.checks.drop("values").write_csv()
    older = SimpleNamespace(has=lambda _: True, read=lambda _: text.encode())
    checks = read_table(older, TABLES["checks"])
    assert checks.columns[:7] == study.checks.columns[:7]
    assert set(checks["values"]) == {""}
    with pytest.raises(CampaignError, match="has no column 'code'"):
        read_table(SimpleNamespace(has=older.has, read=lambda _: b"test,verdict\nD1,ok\n"), TABLES["checks"])
