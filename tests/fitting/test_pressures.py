"""A shell fitted to several pressures, from the table to the answer at a pressure between, of a simulated ring."""

import json

import numpy as np
import polars as pl
import pytest
from tests.models.ring import ring

from fourpole.errors import ModelError
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.fitting.query import Query, ask
from fourpole.io.seal import sealed

FREQUENCY = np.linspace(8.0, 45.0, 8)
PRESSURES = (1.0e5, 1.6e5, 2.5e5)
GIVEN = {"beta": 1.0}
NOISE = 1e-3


def simulated(pressure, springs, frequency=FREQUENCY):
    return ring(2 * np.pi * frequency, pressure, 0.28, 0.11, 1e7, 10.0, springs, 16.0, 6e-4, 0.06)


def table(springs, preloads=(1000.0,)):
    rng, rows = np.random.default_rng(5), []
    for preload in preloads:
        for pressure in PRESSURES:
            clean, rest = simulated(pressure, springs(pressure) * preload / 1000.0)
            for frequency, one in zip(FREQUENCY, clean, strict=True):
                seen = one + NOISE * abs(one) * complex(*rng.standard_normal(2))
                names = {"test": f"D{len(rows)}", "tyre": "a", "pressure [Pa]": pressure, "preload [N]": preload}
                names |= {"frequency [Hz]": frequency, "Re K* [N/m]": seen.real, "Im K* [N/m]": seen.imag}
                names |= {"u(Re K*) [N/m]": NOISE * abs(one), "u(Im K*) [N/m]": NOISE * abs(one)}
                rows.append({**names, "K1 [N/m]": rest * 1.001, "u(K1) [N/m]": 0.003 * rest})
    return pl.DataFrame(rows)


@pytest.fixture(scope="module")
def fitted():
    """Two preloads, of which the second has stiffer springs, as a longer patch would."""
    measured = measured_of(table(lambda _: 8e6, (1000.0, 1500.0)))
    return model_file(measured, fit_tyres(measured, "shell", given=GIVEN))


@pytest.fixture(scope="module")
def stiffening():
    measured = measured_of(table(lambda pressure: 8e6 * (1 + 0.25 * (pressure / 1e5 - 1.7))))
    return model_file(measured, fit_tyres(measured, "shell", given=GIVEN))


def test_each_preload_has_one_set_of_parameters(fitted):
    (entry,) = fitted.models
    at = [one.symbol for one in entry.parameters].index("k")
    found = {}
    for one in entry.conditions:
        found.setdefault(one.state[1].value, set()).add(one.values[at])
    assert {preload: len(values) for preload, values in found.items()} == {1000.0: 1, 1500.0: 1}
    for preload, (value,) in found.items():
        std = np.sqrt(entry.conditions[0].covariance[at][at])
        assert abs(value - 8e6 * preload / 1000.0) < 4 * std * preload / 1000.0 + 3e-3 * value
    assert [sorted(one.conditions) for one in entry.pressures] == [[0, 2, 4], [1, 3, 5]]
    assert all(one.agrees and one.shared == ["k", "mu", "tau"] for one in entry.pressures)
    assert "At 1000 N, k, mu and tau have one value for 3 pressures from 1 to 2.5 bar" in entry.choice
    assert entry.choice.count("The effect of the pressure agrees with that of the shell") == 2


def test_a_pressure_between_is_answered_and_others_are_refused(fitted, tmp_path):
    fitted.write(tmp_path / "model.json")
    file = read_model_file(tmp_path / "model.json")
    assert file == fitted
    truth, rest = simulated(2.0e5, 8e6, np.array([12.0, 30.0]))
    state = {"pressure [Pa]": 2.0e5, "preload [N]": 1000.0}
    rows = ask(file, Query([12.0, 30.0], state))
    for row, clean in zip(rows, truth, strict=True):
        assert row["pressure [Pa]"] == 2.0e5
        for head, value in (("Re K*", clean.real), ("Im K*", clean.imag), ("K1", rest)):
            off, std = row[f"{head} [N/m]"] - value, row[f"u({head}) [N/m]"]
            assert abs(off) < 4 * std + 4e-4 * abs(clean), head  # 4e-4: the two discretisations
            assert std < 0.005 * abs(clean)
        assert (
            "no test at 2 bar: K* is what the shell predicts; at tested pressures that were left out" in row["remarks"]
        )
    at_test = ask(file, Query([12.0], {"pressure [Pa]": 1.6e5, "preload [N]": 1000.0}))[0]
    assert at_test["remarks"] == ""
    for wrong in ({"pressure [Pa]": 3.0e5, "preload [N]": 1000.0}, {**state, "preload [N]": 1200.0}):
        with pytest.raises(ModelError, match=r"no condition is the same .*, or a pressure between them, or make a map"):
            ask(file, Query([12.0], wrong))
    with pytest.raises(ModelError, match="no condition is the same"):
        ask(file, Query([12.0], {"pressure [Pa]": 2.0e5}))  # which preload?


def test_another_effect_of_the_pressure_is_said_and_is_in_the_uncertainty(stiffening):
    (entry,) = stiffening.models
    (found,) = entry.pressures
    assert not found.agrees
    assert "The effect of the pressure is NOT that of the shell" in entry.choice
    assert "% per bar more than the shell's. Intervals and queries include the scatter" in entry.choice
    pressure = 2.0e5
    truth, _ = simulated(pressure, 8e6 * (1 + 0.25 * 0.3), np.array([12.0]))
    row = ask(stiffening, Query([12.0], {"pressure [Pa]": pressure}))[0]
    std = row["u(Re K*) [N/m]"]
    assert 0.03 * truth[0].real < std < 0.6 * truth[0].real
    assert abs(row["Re K* [N/m]"] - truth[0].real) < 2 * std


def test_a_fixed_pressure_or_shared_parameters_stand_apart():
    measured = measured_of(table(lambda _: 8e6))
    (found,) = fit_tyres(measured, "shell", given={**GIVEN, "p": 1.5e5})
    assert found.pressures == ()
    assert len({one.values[5] for one in found.chosen.fits}) == 3
    with pytest.raises(ModelError, match="one set of parameters for all pressures: leave out --share"):
        fit_tyres(measured, "shell", given=GIVEN, share=["k"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda one: one.update(conditions=[0, 1, 9]), "conditions that are not there"),
        (lambda one: one.update(conditions=[0, 0, 1]), "one twice"),
        (lambda one: one.update(predicted=[0.1]), "not as many errors"),
        (lambda one: one.update(scatter=[]), "not as many errors"),
    ],
)
def test_a_record_that_makes_no_sense_is_refused(stiffening, tmp_path, change, said):
    document = stiffening.document
    change(document["models"][0]["pressures"][0])
    (tmp_path / "model.json").write_text(json.dumps(sealed(document)), encoding="utf-8")
    with pytest.raises(ModelError, match=said):
        read_model_file(tmp_path / "model.json")
