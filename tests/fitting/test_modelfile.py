"""Model files: written and read back, of later versions refused, and whoever changed one is told."""

import contextlib
import json

import numpy as np
import polars as pl
import pytest

from fourpole.core.condition import AXES, Axis, Sameness
from fourpole.core.rig import Rig
from fourpole.errors import FileError, ModelError
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import ModelFile, map_of, read_model_file
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.fitting.query import Query, ask, response
from fourpole.models.families import model_named

FREQUENCIES = np.linspace(8.0, 26.0, 10)
PRESSURES, PRELOADS = (1.0e5, 1.35e5, 1.7e5, 2.05e5, 2.4e5), (1000.0, 2000.0)


def truth(pressure, preload):
    q, load = (pressure - 1.7e5) / 0.7e5, (preload - 1500.0) / 500.0
    return np.array([180e3 * np.exp(0.15 * q + 0.02 * load), 120e3 * np.exp(0.1 * q), 700.0 * np.exp(0.05 * load)])


def table(tyres=("a",), pressures=PRESSURES, preloads=PRELOADS, noise=1e-3, seed=0):
    rng = np.random.default_rng(seed)
    rows = []
    for tyre in tyres:
        for pressure in pressures:
            for preload in preloads:
                values = truth(pressure, preload)
                for frequency in FREQUENCIES:
                    clean = model_named("zener").stiffness(values, [2 * np.pi * frequency])[0]
                    std = noise * abs(clean)
                    seen = clean + std * complex(*rng.standard_normal(2))
                    k1 = values[0] * (1 + 0.003 * rng.standard_normal())
                    rows.append(
                        (
                            f"D{len(rows)}",
                            tyre,
                            pressure,
                            preload,
                            frequency,
                            seen.real,
                            seen.imag,
                            std,
                            std,
                            k1,
                            0.003 * k1,
                        )
                    )
    names = ("test", "tyre", "pressure [Pa]", "preload [N]", "frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]")
    return pl.DataFrame(
        rows, schema=[*names, "u(Re K*) [N/m]", "u(Im K*) [N/m]", "K1 [N/m]", "u(K1) [N/m]"], orient="row"
    )


@pytest.fixture(scope="module")
def fitted() -> ModelFile:
    measured = measured_of(table(("a", "b"), (1.7e5,), (1000.0, 2000.0)))
    return model_file(measured, fit_tyres(measured, "zener"))


@pytest.fixture(scope="module")
def mapped() -> ModelFile:
    measured = measured_of(table())
    return model_file(measured, maps=map_tyres(measured, "zener"))


def changed(file, tmp_path, change):
    document = file.model_dump(mode="json")
    change(document)
    place = tmp_path / "model.json"
    place.write_text(json.dumps(document))
    return place


def test_what_is_written_is_read_back(fitted, mapped, tmp_path):
    for file in (fitted, mapped):
        file.write(tmp_path / "model.json")
        assert read_model_file(tmp_path / "model.json") == file
    text = (tmp_path / "model.json").read_text()
    assert "NaN" not in text
    assert "Infinity" not in text


def test_the_fitted_condition_answers(fitted):
    entry = fitted.models[0]
    stiffness, covariance = response(entry, 0, FREQUENCIES)
    clean = model_named("zener").stiffness(truth(1.7e5, 1000.0), 2 * np.pi * FREQUENCIES)
    scores = np.stack([(stiffness - clean).real, (stiffness - clean).imag], axis=1)
    scores /= np.sqrt(np.diagonal(covariance, 0, 1, 2))
    assert np.abs(scores).max() < 4
    row = ask(fitted, Query([14.0], {"pressure [Pa]": 1.7e5, "preload [N]": 1000.0}, "a"))[0]
    one, spread = response(entry, 0, np.array([14.0]))
    assert row["Re K* [N/m]"] == pytest.approx(one[0].real, rel=1e-9)
    assert row["u(Re K*) [N/m]"] == pytest.approx(np.sqrt(spread[0, 0, 0]), rel=1e-6)
    assert row["K1 [N/m]"] == pytest.approx(entry.conditions[0].values[0])
    assert row["K2 [N/m]"] == pytest.approx(entry.conditions[0].values[1], rel=1e-6)
    assert row["C [N s/m]"] == pytest.approx(entry.conditions[0].values[2], rel=1e-6)
    assert row["TR [1]"] is None


def test_the_map_answers_at_a_point_between(mapped):
    state = {"pressure [Pa]": 1.85e5, "preload [N]": 1400.0}
    rig = Rig(15.0, 12440.0)
    row = ask(mapped, Query([13.7], state, rig=rig))[0]
    values = truth(1.85e5, 1400.0)
    clean = model_named("zener").stiffness(values, [27.4 * np.pi])[0]
    for name, true in (
        ("Re K* [N/m]", clean.real),
        ("Im K* [N/m]", clean.imag),
        ("K1 [N/m]", values[0]),
        ("K2 [N/m]", values[1]),
        ("C [N s/m]", values[2]),
        ("TR [1]", abs(clean / (clean + 12440.0 - (27.4 * np.pi) ** 2 * 15.0))),
        ("loss factor [1]", clean.imag / clean.real),
    ):
        std = row[f"u({name.partition(' [')[0]}) [{name.partition(' [')[2]}"]
        assert 0 < std < 0.02 * true
        assert abs(row[name] - true) < 3.5 * std, name
    assert row["outside [half spans]"] == 0


def test_at_a_tested_point_the_map_agrees_with_the_test(mapped):
    frame = table()
    inside = []
    for row in frame.to_dicts():
        state = {"pressure [Pa]": row["pressure [Pa]"], "preload [N]": row["preload [N]"]}
        told = ask(mapped, Query([row["frequency [Hz]"]], state))[0]
        for part in ("Re", "Im"):
            off = told[f"{part} K* [N/m]"] - row[f"{part} K* [N/m]"]
            inside.append(abs(off) < 1.96 * np.hypot(told[f"u({part} K*) [N/m]"], row[f"u({part} K*) [N/m]"]))
    assert np.mean(inside) > 0.9


@pytest.mark.parametrize(
    ("query", "said"),
    [
        (Query([13.7], {"pressure [Pa]": 1.85e5}), "state --preload: the map is over preload from 1000 N to 2000 N"),
        (Query([13.7], {"pressure [Pa]": 2.9e5, "preload [N]": 1400.0}), "outside what was measured, by 0.714 half"),
        (Query([53.7], {"pressure [Pa]": 1.85e5, "preload [N]": 1400.0}), "53.7 Hz is outside the measured band, 8"),
        (Query([13.7], {"camber [deg]": 2.0}), "do not state 'camber"),
        (Query([-1.0], {"pressure [Pa]": 1.85e5, "preload [N]": 1400.0}), "must be positive"),
        (Query([13.7], {}, "c"), "the file is of 'a', not of 'c'"),
    ],
)
def test_what_the_map_cannot_answer_is_refused(mapped, query, said):
    with pytest.raises(ModelError, match=said.replace("(", r"\(")):
        ask(mapped, query)


def test_beyond_it_says_how_far(mapped):
    state = {"pressure [Pa]": 2.9e5, "preload [N]": 1400.0}
    row = ask(mapped, Query([53.7], state, beyond=True))[0]
    assert row["outside [half spans]"] == pytest.approx(0.5 / 0.7, rel=1e-4)
    assert "the nearest point inside is 2.4 bar, 1400 N" in row["remarks"]
    assert "1.05 octaves" in row["remarks"]


def test_a_map_from_one_pressure_says_which_axes_it_answers():
    measured = measured_of(table(pressures=(1.7e5,), preloads=(1000.0, 1250.0, 1500.0, 2000.0)))
    file = model_file(measured, maps=map_tyres(measured, "zener"))
    assert [axis.name for axis in file.maps[0].axes] == ["preload"]
    row = ask(file, Query([13.7], {"pressure [Pa]": 1.71e5, "preload [N]": 1400.0}))[0]
    assert row["pressure [Pa]"] == pytest.approx(1.7e5)
    with pytest.raises(
        ModelError, match=r"all tests had the pressure 1\.7 bar, not 1\.85 bar: the map is over preload"
    ):
        ask(file, Query([13.7], {"pressure [Pa]": 1.85e5, "preload [N]": 1400.0}))


@pytest.mark.parametrize(("camber", "answered"), [(2.4, True), (2.6, False)])
def test_a_query_has_the_tolerances_of_the_axes_that_the_campaign_names(tmp_path, camber, answered):
    rows = table(pressures=(1.7e5,), preloads=(1000.0,)).with_columns(pl.lit(2.0).alias("camber [deg]"))
    measured = measured_of(rows, rule=Sameness((*AXES, Axis("camber [deg]", absolute=0.5))))
    model_file(measured, fit_tyres(measured, "zener")).write(tmp_path / "model.json")
    query = Query([13.7], {"camber [deg]": camber})
    with contextlib.nullcontext() if answered else pytest.raises(ModelError, match="no condition is the same"):
        assert ask(read_model_file(tmp_path / "model.json"), query)[0]["camber [deg]"] == 2.0


def test_a_file_without_own_axes_is_written_as_before(fitted):
    assert "axes" not in fitted.document


def test_a_condition_holds_the_points_of_tests_with_several(tmp_path):
    rows = table(pressures=(1.7e5,), preloads=(1000.0,))
    count = len(rows)
    swept = rows.with_columns(pl.lit("D1").alias("test"), pl.Series("point", range(1, count + 1)))
    for measured, points in ((measured_of(rows), []), (measured_of(swept), list(range(1, count + 1)))):
        file = model_file(measured, fit_tyres(measured, "zener"))
        (one,) = file.models[0].conditions
        assert (len(one.tests), one.points) == (count, points)
        assert ("points" in file.document["models"][0]["conditions"][0]) == bool(points)
        file.write(tmp_path / "model.json")
        assert read_model_file(tmp_path / "model.json") == file
    document = file.document
    document["models"][0]["conditions"][0]["points"] = [1]
    (tmp_path / "model.json").write_text(json.dumps(document))
    with pytest.raises(ModelError, match=f"1 points for {count} tests"):
        read_model_file(tmp_path / "model.json")


def test_a_fit_is_asked_at_its_conditions_only(fitted):
    with pytest.raises(ModelError, match="2 conditions are the same as the stated one"):
        ask(fitted, Query([13.7], {"pressure [Pa]": 1.7e5}, "a"))
    with pytest.raises(ModelError, match=r"no condition is the same .* fits at 1\.7 bar, 1000 N; 1\.7 bar, 2000 N"):
        ask(fitted, Query([13.7], {"pressure [Pa]": 1.9e5}, "a"))
    with pytest.raises(ModelError, match="has 2 specimens: state --specimen"):
        ask(fitted, Query([13.7]))


def _set(path, value):
    def change(document):
        *way, last = path
        for step in way:
            document = document[step]
        document[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_set(["version"], 2), "is of version 2, this Fourpole .* reads up to 1: update it"),
        (_set(["version"], "1"), "no version that is known"),
        (_set(["format"], "other"), "is no model file"),
        (_set(["models", 0, "parameters", 0, "unit"], "kN/m"), "K1 is in 'kN/m' there, the zener model has it in N/m"),
        (_set(["models", 0, "parameters", 0, "symbol"], "K9"), "has the parameters K1, K2, C"),
        (_set(["models", 0, "model"], "zenner"), "no model 'zenner'"),
        (_set(["models", 0, "conditions", 0, "values"], [1.0]), "1 values for 3 parameters"),
        (_set(["models", 0, "conditions", 0, "values"], [-1.0, 1.0, 1.0]), "outside 0 to inf"),
        (_set(["models", 0, "conditions", 0, "covariance", 0, 1], 1e12), "the covariance is none"),
        (_set(["models", 0, "conditions", 0, "covariance"], [[1.0]]), "the covariance is not 3 by 3"),
        (_set(["models", 0, "conditions", 0, "chi2"], "large"), "chi2"),
        (_set(["more"], 1), "'more'"),
    ],
)
def test_a_file_that_was_changed_is_refused(fitted, tmp_path, change, said):
    with pytest.raises(ModelError, match=said):
        read_model_file(changed(fitted, tmp_path, change))


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_set(["maps", 0, "terms", 0], [0]), "the terms do not fit the axes"),
        (_set(["maps", 0, "terms", 0], [0, 99]), "the terms do not fit the axes"),
        (_set(["maps", 0, "coefficients", 0], [1.0]), "the coefficients are not"),
        (_set(["maps", 0, "axes", 0, "values"], [1.0]), "different numbers of tested conditions"),
        (_set(["maps", 0, "covariance", 0, 0], -1.0), "the covariance is none"),
    ],
)
def test_a_map_that_was_changed_is_refused(mapped, tmp_path, change, said):
    with pytest.raises(ModelError, match=said):
        read_model_file(changed(mapped, tmp_path, change))


@pytest.mark.parametrize("content", [b"", b"{", b"[1]", b"\xff\xfe", b'{"format": "fourpole-model"}', b"[" * 100_000])
def test_files_that_are_none(tmp_path, content):
    place = tmp_path / "model.json"
    place.write_bytes(content)
    with pytest.raises(ModelError):
        read_model_file(place)
    with pytest.raises(FileError, match="no such file"):
        read_model_file(tmp_path / "none.json")


@pytest.mark.sampled(2)
def test_the_map_of_a_file_is_the_map(mapped):
    measured = measured_of(table())
    own = map_tyres(measured, "zener")[0].best
    read = map_of(mapped.maps[0])
    points = np.array([[1.85e5, 1400.0], [1.1e5, 1900.0]])
    mine, theirs = own.ask(points, [10.0, 20.0]), read.ask(points, [10.0, 20.0])
    np.testing.assert_allclose(theirs.stiffness, mine.stiffness, rtol=1e-12)
    np.testing.assert_allclose(theirs.covariance, mine.covariance, rtol=1e-12)


def test_between_two_levels_of_an_axis_a_bend_is_allowed_for(mapped):
    """At the tested loads nothing is added; half way between them what a slope 1.4 times as steep at one end makes."""
    found = map_of(mapped.maps[0])
    assert found.axes.straight == (1,)
    at_load, between = (found.ask([[1.7e5, load]], [14.0]).covariance[0, 0, 0] for load in (1000.0, 1500.0))
    change = np.diff([found.ask([[1.7e5, load]], [14.0]).stiffness[0].real for load in (1000.0, 2000.0)])[0]
    assert between - (change / 24) ** 2 == pytest.approx(at_load, rel=0.3)  # the rest is of the surfaces
    assert between > (change / 24) ** 2
    assert "between the two tested values of preload includes a bend" in mapped.maps[0].choice


def test_two_conditions_are_joined_by_a_straight_line_and_that_is_said():
    measured = measured_of(table(pressures=(1.0e5, 2.4e5), preloads=(1000.0,)))
    (made,) = map_tyres(measured, "zener")
    assert len(made.best.terms) == 2
    assert "too few for a leave-one-out error" in made.text
    file = model_file(measured, maps=[made])
    assert file.maps[0].leave_one_out == (None, None, None)
    row = ask(file, Query([14.0], {"pressure [Pa]": 1.7e5}))[0]
    clean = model_named("zener").stiffness(truth(1.7e5, 1000.0), [28 * np.pi])[0]
    assert abs(row["Re K* [N/m]"] - clean.real) < 2 * row["u(Re K*) [N/m]"] < 0.05 * clean.real


def test_conditions_without_a_common_frequency_make_no_map():
    frame = table(pressures=(1.0e5, 1.7e5, 2.4e5), preloads=(1000.0,))
    low = pl.col("frequency [Hz]") < 15.0
    apart = frame.filter(pl.when(pl.col("pressure [Pa]") < 1.2e5).then(low).otherwise(~low))
    with pytest.raises(
        ModelError, match=r"no frequency is common to all conditions: one begins at 16 Hz.* ends at 14 Hz"
    ):
        map_tyres(measured_of(apart), "zener")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (_set(["kind"], "model"), "is of kind model and has no entry of it"),
        (_set(["version"], True), "no version that is known"),
        (_set(["maps", 0, "band"], [20.0, 10.0]), "the band falls"),
        (_set(["maps", 0, "band"], [0.0, 10.0]), "band"),
        (_set(["maps", 0, "scatter"], [-1.0, 0.0, 0.0]), "scatter"),
        (_set(["maps", 0, "scatter"], [1e200, 0.0, 0.0]), "scatter"),
        (_set(["maps", 0, "axes", 1, "values"], [1000.0] * 10), "an axis has one value only"),
        (_set(["maps", 0, "coefficients", 0, 0], 1e300), "beyond all measure"),
        (_set(["maps", 0, "covariance", 0, 0], 1e300), "beyond all measure"),
        (_set(["maps", 0, "static", "terms"], [[0]]), "the surface of K1 does not fit"),
    ],
)
def test_a_map_that_makes_no_sense_is_refused(mapped, tmp_path, change, said):
    with pytest.raises(ModelError, match=said):
        read_model_file(changed(mapped, tmp_path, change))


LINEAR = (1.0e5, 1.7e5, 2.4e5)


@pytest.fixture(scope="module")
def linear() -> ModelFile:
    """A Zener tyre whose stiffness and damping rise linearly with the pressure, 1 % from mounting to mounting."""
    rng, rows = np.random.default_rng(2), []
    for pressure in LINEAR:
        for preload in (1000.0, 2000.0, 3000.0):
            factor = (1 + 0.4 * (pressure / 1e5 - 1.7)) * (1 + 0.01 * rng.standard_normal())
            for frequency in FREQUENCIES:
                jw = 2j * np.pi * frequency
                clean = factor * (180e3 + 120e3 * 700 * jw / (120e3 + 700 * jw))
                seen, std = clean + 1e-3 * abs(clean) * complex(*rng.standard_normal(2)), 1e-3 * abs(clean)
                rows.append(("t", pressure, preload, frequency, seen.real, seen.imag, std, std))
    names = ("tyre", "pressure [Pa]", "preload [N]", "frequency [Hz]", "Re K* [N/m]", "Im K* [N/m]")
    frame = pl.DataFrame(rows, schema=[*names, "u(Re K*) [N/m]", "u(Im K*) [N/m]"], orient="row")
    measured = measured_of(frame)
    return model_file(measured, maps=map_tyres(measured, "zener"))


def test_a_map_states_its_link_and_a_file_without_one_has_logarithms(linear, tmp_path):
    linear.write(tmp_path / "map.json")
    (entry,) = read_model_file(tmp_path / "map.json").maps
    assert entry.link == "identity"
    assert json.loads((tmp_path / "map.json").read_text())["maps"][0]["link"] == "identity"
    x = (2.2e5 - 1.7e5) / 0.7e5
    wanted = np.array(entry.coefficients) @ [x ** one[0] * (0.0 if one[1] else 1.0) for one in entry.terms]
    assert map_of(entry).parameters([[2.2e5, 2e3]])[0] == pytest.approx(wanted)  # the middle of the preloads
    older = entry.model_dump(by_alias=True, exclude={"link", "offsets"}) | {"scatter": entry.scatter[:3]}
    found = map_of(type(entry).model_validate(older))
    assert found.link == "log"
    assert found.scatter.condition == (entry.scatter[0],) * 2
    assert found.offsets is None


def test_a_query_states_what_its_interval_is_for(linear, fitted):
    state = {"pressure [Pa]": 1.7e5, "preload [N]": 2000.0}
    rows = {one: ask(linear, Query([14.0], state, purpose=one))[0] for one in ("mean", "next", "specimen", None)}
    assert rows[None] == rows["next"]
    for purpose, row in rows.items():
        assert row["interval for"] == purpose or purpose is None
        assert row["interval"].startswith("Intervals are for ")
    u = {one: row["u(Re K*) [N/m]"] for one, row in rows.items()}
    assert u["specimen"] < u["mean"] < u["next"]
    assert rows["specimen"]["Re K* [N/m]"] != rows["mean"]["Re K* [N/m]"] == rows["next"]["Re K* [N/m]"]
    with pytest.raises(ModelError, match="nothing was tested at this point"):
        ask(linear, Query([14.0], {**state, "pressure [Pa]": 2.0e5}, purpose="specimen"))
    (row,) = ask(fitted, Query([14.0], {**state, "preload [N]": 1000.0}, "a"))
    assert row["interval for"] == "specimen"
    with pytest.raises(ModelError, match="do not know the scatter between mountings"):
        ask(fitted, Query([14.0], {**state, "preload [N]": 1000.0}, "a", purpose="next"))
