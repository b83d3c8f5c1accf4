"""Data put back: each of them against what a query of the model answers at its own operating point."""

from dataclasses import replace

import numpy as np
import polars as pl
from tests.fitting.test_amplitude import table as levels
from tests.fitting.test_shifting import table as isotherms

from fourpole.core import stats
from fourpole.core.tyre import zener_stiffness
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelling import fit_tyres, map_tyres, model_file
from fourpole.fitting.modelparts import PutBackFile
from fourpole.fitting.putback import put_back
from fourpole.fitting.query import INTERVAL, Query, ask
from fourpole.fitting.shifting import law_file, master_tables, read_isotherms, shift_tyres, shifted_back
from fourpole.models import profile

F, P = np.linspace(8.0, 24.0, 9), np.array([1.0e5, 1.5e5, 2.0e5, 2.4e5])


def campaign(noise, wrong=()):
    """K* of a Zener tyre at four pressures, known to 0.5 %; the tests of `wrong` are off by a tenth."""
    rng, frequency, pressure = np.random.default_rng(1), np.tile(F, P.size), np.repeat(P, F.size)
    k = zener_stiffness(60e3 + 0.4 * pressure, 90e3, 700.0, 2 * np.pi * frequency)
    k = k + noise * abs(k) * (rng.normal(size=k.size) + 1j * rng.normal(size=k.size))
    k[list(wrong)] *= 1.1
    table = {"test": [f"D{at}" for at in range(k.size)], "tyre": ["a"] * k.size, "pressure [Pa]": pressure}
    table |= {"frequency [Hz]": frequency, "Re K* [N/m]": k.real, "Im K* [N/m]": k.imag}
    table |= {"u(Re K*) [N/m]": 0.005 * abs(k), "u(Im K*) [N/m]": 0.005 * abs(k)}
    k1 = 60e3 + 0.4 * pressure
    return measured_of(pl.DataFrame(table | {"K1 [N/m]": k1, "u(K1) [N/m]": 0.01 * k1}))


def fits(measured):
    return model_file(measured, fit_tyres(measured, "zener"))


def test_data_that_are_as_uncertain_as_stated_lie_inside_and_every_answer_says_so():
    for file in (fits(measured := campaign(0.005)), model_file(measured, maps=map_tyres(measured, "zener"))):
        (found,) = (one.put_back for one in (*file.models, *file.maps))
        assert found.values == 2 * F.size * P.size + P.size
        assert found.inside >= found.least
        assert not found.low
        (row,) = ask(file, Query([12.0], {"pressure [Pa]": P[1]}))
        assert row[INTERVAL].endswith(found.sentence)
        assert "Put back" not in row["remarks"]


def test_wrong_tests_are_named_worst_first_and_a_low_share_is_a_remark():
    measured = campaign(0.0, wrong=(3, 12, 20, 31))
    file = fits(measured)
    (entry,) = file.models
    wide = entry.model_copy(update={"discrepancy": 0.0})
    narrow = file.model_copy(update={"models": [wide]})
    found = put_back(narrow, "a", [(one, one.data) for one in measured.conditions])
    assert set(found.outside[:4]) == {"D3", "D12", "D20", "D31"}
    assert found.inside < found.values
    many = PutBackFile(inside=40, values=64, outside=found.outside)
    file = file.model_copy(update={"models": [entry.model_copy(update={"put_back": many})]})
    (row,) = ask(file, Query([12.0], {"pressure [Pa]": P[0]}))
    assert "40 of 64 data (K', K'', K1), 62 %, lie within" in row["remarks"]
    assert "at least 58" in row["remarks"]
    assert "Put back" not in row[INTERVAL]


def test_the_limit_is_the_binomial_quantile():
    """Just inside and just outside: fewer than the least have a chance below 5 %, the least has not."""
    for count in (1, 2, 20, 64, 1000):
        least = stats.binomial_least(count, 0.95)
        assert not PutBackFile(inside=least, values=count).low
        if least:
            assert PutBackFile(inside=least - 1, values=count).low
        draws = np.random.default_rng(0).binomial(count, 0.95, 100_000)
        assert np.mean(draws < least) < 0.05 + 4 * np.sqrt(0.05 * 0.95 / draws.size)
        assert np.mean(draws <= least) > 0.05 - 4 * np.sqrt(0.05 * 0.95 / draws.size)


def test_a_model_that_answers_something_else_gives_little_back():
    file = fits(measured := campaign(0.005))
    (entry,) = file.models
    moved = [one.model_copy(update={"values": [1.2 * each for each in one.values]}) for one in entry.conditions]
    wrong = file.model_copy(update={"models": [entry.model_copy(update={"conditions": moved})]})
    assert put_back(wrong, "a", [(one, one.data) for one in measured.conditions]).low


def test_a_datum_for_which_the_query_is_refused_is_outside():
    file, measured = fits(campaign(0.005)), campaign(0.005)
    (entry,) = file.models
    fewer = file.model_copy(update={"models": [entry.model_copy(update={"conditions": entry.conditions[:-1]})]})
    found = put_back(fewer, "a", [(one, one.data) for one in measured.conditions])
    assert found.values == 2 * F.size * P.size + P.size
    assert found.outside[0] in measured.conditions[-1].tests
    assert found.low


def test_a_master_curve_is_asked_at_the_temperature_of_each_isotherm(tmp_path):
    (one,) = shift_tyres(read_isotherms([isotherms(tmp_path / "isotherms.csv")]), 20.0)
    found = shifted_back(one)
    assert found.values == 2 * sum(each.omega.size for each in one.found.isotherms)
    assert not found.low
    measured = measured_of(*master_tables([one]), name="master.csv")
    file = model_file(measured, fit_tyres(measured, "prony"), laws={"": law_file(one)})
    off = [replace(one.data, stiffness=1.2 * one.data.stiffness) for one in measured.conditions]
    assert put_back(file, "", list(zip(measured.conditions, off, strict=True))).low


def test_a_model_of_the_amplitude_is_asked_at_that_of_each_test(monkeypatch):
    monkeypatch.setattr(profile, "_MOST_WORK", 0)  # intervals by profile likelihood would take seconds
    measured = measured_of(levels(), by_amplitude=True)
    (entry,) = model_file(measured, fit_tyres(measured, "kraus")).models
    assert entry.put_back.values == 2 * measured.conditions[0].own.count
    assert not entry.put_back.low
