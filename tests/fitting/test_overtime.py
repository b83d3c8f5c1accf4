"""Tables of relaxation and creep become ordinary model files, which queries and exports take."""

import numpy as np
import pytest

from fourpole.app.group import show
from fourpole.app.models import run_fit
from fourpole.app.options import FitOptions
from fourpole.errors import FourpoleError, ModelError, TableError, UnitError
from fourpole.export.kinds import export_results
from fourpole.fitting.measured import read_measured
from fourpole.fitting.modelfile import read_model_file
from fourpole.fitting.overtime import fit_over_time
from fourpole.fitting.query import Query, ask
from fourpole.io.tables.kstar import TableOptions
from fourpole.io.tables.pair import read_over_time

REST, SPRING, TAU = 1e5, 5e4, 0.5
TIME = np.geomspace(0.01, 100.0, 50)
STIFFNESS = REST + SPRING * np.exp(-TIME / TAU)
COMPLIANCE = 1 / REST - (1 / REST - 1 / (REST + SPRING)) * np.exp(-TIME / (TAU * (REST + SPRING) / REST))


def table(path, *columns):
    """A table of columns, each a head and numbers or words."""
    heads, rows = zip(*columns, strict=True)
    lines = [",".join(heads), *(",".join(map(str, row)) for row in zip(*rows, strict=True))]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("column", "options"),
    [
        (("K(t) [N/mm]", STIFFNESS / 1e3), {}),
        (("E(t) [MPa]", STIFFNESS / 5e4), {"factor": 0.05}),
        (("relaxation modulus [kPa]", STIFFNESS / 50), {"factor": 0.05}),
        (("Relaxation modulus G(t) [MPa]", STIFFNESS / 5e4), {"factor": 0.05}),
        (("J(t) [mm/N]", COMPLIANCE * 1e3), {}),
        (("creep compliance [1/MPa]", COMPLIANCE * 5e4), {"factor": 0.05}),
    ],
)
def test_a_model_of_any_form_answers_in_frequency(tmp_path, column, options):
    path = table(tmp_path / "t.csv", ("time [s]", TIME), column)
    made = fit_over_time(path, options=TableOptions(**options), std=1e-3)
    made.write(tmp_path / "model.json")
    for row in ask(read_model_file(tmp_path / "model.json"), Query([0.1, 0.318, 3.0])):
        omega = 2j * np.pi * row["frequency [Hz]"]
        truth = REST + SPRING * omega * TAU / (1 + omega * TAU)
        assert abs(row["Re K* [N/m]"] + 1j * row["Im K* [N/m]"] - truth) < 5e-3 * abs(truth)


@pytest.mark.sampled(4)
def test_several_conditions_share_an_entry_and_an_export_takes_it(tmp_path):
    both = [("time [min]", np.tile(TIME / 60, 2)), ("J(t) [mm/N]", np.concatenate([COMPLIANCE, 2 * COMPLIANCE]) * 1e3)]
    both.append(("temperature [degC]", np.repeat([0.0, 40.0], TIME.size)))
    path = table(tmp_path / "t.csv", *both)
    show(run_fit(path, "prony:6", options=FitOptions(std="0.1 %", file=tmp_path / "model.json")), as_json=False)
    file = read_model_file(tmp_path / "model.json")
    (entry,) = file.models
    assert entry.model == "prony:6"
    cold, warm = (ask(file, Query([1.0], {"temperature [degC]": t}))[0]["Re K* [N/m]"] for t in (0.0, 40.0))
    assert cold == pytest.approx(2 * warm, rel=1e-3)
    export_results(tmp_path / "model.json", "prony", tmp_path / "prony.csv")
    export_results(tmp_path / "model.json", "fmu", tmp_path / "specimen.fmu", points=[{"temperature [degC]": 0.0}])


def test_a_stated_uncertainty_is_taken_and_zero_times_are_data(tmp_path):
    time, values = np.append(0.0, TIME), np.append(REST + SPRING, STIFFNESS)
    columns = [("time [s]", time), ("K(t) [N/m]", values), ("u(K(t)) [N/m]", 1e-3 * values)]
    made = fit_over_time(table(tmp_path / "t.csv", *columns))
    (condition,) = made.models[0].conditions
    assert condition.verdict.possible
    assert condition.band[1] == pytest.approx(1 / (2 * np.pi * 0.01))


@pytest.mark.parametrize(
    ("columns", "options", "message"),
    [
        ([("time [s]", TIME), ("E(t) [MPa]", STIFFNESS)], {}, "shape-factor"),
        ([("time", TIME), ("K(t) [N/m]", STIFFNESS)], {}, "no unit"),
        ([("time [s]", TIME), ("K(t) [N/m]", STIFFNESS), ("J(t) [m/N]", COMPLIANCE)], {}, "relaxation and creep"),
        ([("time [s]", TIME), ("K(t) [N/m]", -STIFFNESS)], {}, "nothing can be fitted"),
    ],
)
def test_a_table_that_lacks_something_says_what(tmp_path, columns, options, message):
    with pytest.raises(FourpoleError, match=message):
        fit_over_time(table(tmp_path / "t.csv", *columns), options=TableOptions(**options))


def test_tables_over_frequency_are_none_and_others_say_where_time_belongs(tmp_path):
    path = table(tmp_path / "k.csv", ("f [Hz]", TIME), ("K' [N/m]", STIFFNESS), ("K'' [N/m]", STIFFNESS))
    assert read_over_time(path) is None
    path = table(tmp_path / "t.csv", ("time [s]", TIME), ("K(t) [N/m]", STIFFNESS))
    with pytest.raises(TableError, match="over time are for fourpole fit"):
        read_measured(path)
    with pytest.raises(ModelError, match="prony"):
        fit_over_time(path, "zener")
    with pytest.raises(UnitError, match="leave out --band"):
        show(run_fit(path, "auto", options=FitOptions(band="1:2 Hz")), as_json=False)
