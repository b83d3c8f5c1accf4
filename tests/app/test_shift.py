"""fourpole shift: what is printed, what is written, what is refused."""

import json

import pytest
from tests.fitting.test_shifting import table

from fourpole.app.group import show
from fourpole.app.options import ShiftOptions
from fourpole.app.tables import run_shift
from fourpole.errors import ModelError, UnitError

FILES = {"master.csv", "covariance.parquet", "temperature.json", "shifts.csv", "overlaps.csv", "shift.svg", "shift.png"}


@pytest.fixture(scope="module")
def isotherms(tmp_path_factory):
    return table(tmp_path_factory.mktemp("isotherms") / "isotherms.csv")


@pytest.mark.sampled(2)
def test_the_folder_has_every_file_and_the_text_has_shifts_overlaps_and_laws(isotherms, tmp_path, capsys):
    folder = tmp_path / "new" / "master"
    show(run_shift([isotherms], ShiftOptions(reference=20.0, folder=folder, constants_at=0.0)), as_json=False)
    said = capsys.readouterr()
    assert {path.name for path in folder.iterdir()} == FILES
    for text in (
        "log10 aT",
        "one curve",
        "WLF at",
        "Arrhenius at",
        "95 %",
        "fourpole query interpolates the shift factors found",
        "WLF with the reference 0 degC",
    ):
        assert text in said.out
    assert "the misfit of the overlaps is taken for it" in said.err


def test_the_document_for_programs_is_json_alone(isotherms, capsys):
    show(run_shift([isotherms], ShiftOptions(reference=20.0)), as_json=True)
    document = json.loads(capsys.readouterr().out)
    assert [one["temperature"]["law"] for one in document["laws"]] == ["WLF"]
    assert {one["verdict"] for one in document["overlaps"]} == {"one curve"}


def test_a_gap_is_told_with_what_to_measure(tmp_path, capsys):
    show(
        run_shift([table(tmp_path / "gap.csv", (-40.0, 10.0, 20.0, 35.0))], ShiftOptions(reference=20.0)), as_json=False
    )
    (line,) = [
        part for part in " ".join(capsys.readouterr().err.split()).split("warning: ") if "no shift factor" in part
    ]
    assert "isotherms at -39.9" in line or "isotherms at -40" in line
    assert "temperature between" in line


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        (ShiftOptions(reference=200.0), ModelError, "no isotherm at the reference temperature"),
        (ShiftOptions(apart="warm"), UnitError, "--apart"),
        (ShiftOptions(std=2.0), UnitError, "--std"),
        (ShiftOptions(tyre="other"), ModelError, "no test of a specimen 'other'"),
    ],
)
def test_a_mistake_is_one_sentence(isotherms, options, error, message):
    with pytest.raises(error, match=message):
        show(run_shift([isotherms], options), as_json=False)


@pytest.mark.sampled(4)
def test_the_figure_has_every_specimen(isotherms, tmp_path):
    rows = isotherms.read_text().splitlines()
    both = tmp_path / "both.csv"
    both.write_text(
        "\n".join([f"{rows[0]},tyre", *(f"{row},{name}" for name in ("first", "second") for row in rows[1:])])
    )
    show(run_shift([both], ShiftOptions(reference=20.0, folder=tmp_path / "master")), as_json=False)
    drawn = (tmp_path / "master" / "shift.svg").read_text()
    assert "first" in drawn
    assert "second" in drawn
    assert drawn.count("master curve") == 2
