"""Each export of a model carries how near the model is to K* as measured: a model that fits, and one off by 30 %."""

from __future__ import annotations

import csv
import json
import re
import zipfile
from xml.etree import ElementTree as ET

import pytest
from scipy.io import loadmat
from tests.export.modelica import read_modelica
from tests.export.vehicle import LOAD, PRESSURE

from fourpole.export import KINDS, export_results
from fourpole.export.kinds import Takes
from fourpole.fitting.accuracy import POOR, WARNED, Accuracy, accuracy_of
from fourpole.fitting.modelfile import VerdictFile, read_model_file
from fourpole.fitting.query import Query, ask
from fourpole.models.ladder import Rung
from fourpole.models.shape import Shape

OF_MODELS = [name for name, kind in KINDS.items() if kind.takes in (Takes.MODEL, Takes.EITHER)]
ARGUMENTS = {"lsdyna": {"shape": Shape("shear", 0.01, 5e-4, poisson=0.49)}, "tir": {"frequency": 15.0}}
AT = {PRESSURE: 1.7e5, LOAD: 2e3}
OFF = (
    "K* of tyre, 1 to 60 Hz: the model is off by 30 % of |K*| (model discrepancy); u(K*) of the model is up to 30 % of"
)
IMPOSSIBLE = "No specimen, relaxing or with a mass or resonances, can have K* as measured."
FITS = "K* of tyre, 1 to 60 Hz: the model fits within u(K*); u(K*) of the model is up to"
POSSIBLE = "A massless, relaxing specimen can have K* as measured."


def with_discrepancy(path, share, folder):
    """The model file with another discrepancy and, if there is one, with verdicts that no specimen can have K*."""
    file = read_model_file(path)
    (entry,) = file.models
    verdict = VerdictFile(possible=not share, chance=0.0 if share else 0.5, misfit=share, impossible=[])
    conditions = [one.model_copy(update={"verdict": verdict}) for one in entry.conditions]
    entry = entry.model_copy(update={"discrepancy": share, "conditions": conditions})
    file.model_copy(update={"models": [entry]}).write(folder / "model.json")
    return folder / "model.json"


def text_of(path):
    """The text of an exported file in one line, without the marks of comments."""
    if path.suffix == ".fmu":
        with zipfile.ZipFile(path) as archive:
            return ET.fromstring(archive.read("modelDescription.xml")).get("description")
    if path.suffix == ".mat":
        return loadmat(path)["systems"][0, 0]["accuracy"][0]
    return " ".join(re.sub(r"^(\*\*|!|\$) ", "", path.read_text("utf-8"), flags=re.MULTILINE).split())


@pytest.mark.parametrize("kind", OF_MODELS)
@pytest.mark.sampled(4)
def test_a_model_that_is_off_says_so_in_each_kind(files, tmp_path, kind):
    exported = export_results(with_discrepancy(files / "model.json", 0.3, tmp_path), kind, **ARGUMENTS.get(kind, {}))
    text = text_of(exported.path)
    assert OFF in text
    assert IMPOSSIBLE in text
    assert exported.notes[0].startswith(OFF)


@pytest.mark.parametrize("kind", OF_MODELS)
@pytest.mark.sampled(4)
def test_a_model_that_fits_says_so_in_each_kind(files, tmp_path, kind):
    exported = export_results(with_discrepancy(files / "model.json", 0.0, tmp_path), kind, **ARGUMENTS.get(kind, {}))
    text = text_of(exported.path)
    assert FITS in text
    assert POSSIBLE in text
    assert not [note for note in exported.notes if "u(K*)" in note]


def test_the_discrepancy_is_a_number_where_a_format_has_numbers(files, tmp_path):
    model = with_discrepancy(files / "model.json", 0.3, tmp_path)
    for kind, tag in (("fmu", "Real"), ("fmu3", ".")):
        with zipfile.ZipFile(export_results(model, kind, tmp_path / "a.fmu").path) as archive:
            root = ET.fromstring(archive.read("modelDescription.xml"))
        (found,) = root.iterfind(".//*[@name='points[9].discrepancy']")
        assert (found.get("causality"), found.get("variability")) == ("parameter", "fixed")
        assert (found.find(tag).get("start"), found.find(tag).get("unit")) == ("0.3", "1")
    _, blocks = read_modelica(export_results(model, "modelica").path.read_text("utf-8"))
    assert {one.parameters["discrepancy"] for one in blocks.values()} == {0.3}
    systems = json.loads(export_results(model, "statespace").path.read_text("utf-8"))["systems"]
    assert {one["discrepancy"] for one in systems} == {0.3}
    for kind in ("table", "prony"):
        with export_results(model, kind).path.open(encoding="utf-8", newline="") as file:
            assert {row["discrepancy [1]"] for row in csv.DictReader(file)} == {"0.3"}


@pytest.mark.parametrize(("share", "warned"), [(0.99 * WARNED, False), (WARNED, True)])
def test_an_export_warns_from_a_limit_on(files, tmp_path, share, warned):
    notes = export_results(with_discrepancy(files / "model.json", share, tmp_path), "abaqus").notes
    assert any("(model discrepancy)" in note for note in notes) == warned


@pytest.mark.parametrize(("share", "remarked"), [(0.99 * POOR, False), (POOR, True)])
def test_a_query_remarks_on_it_from_a_limit_on(files, tmp_path, share, remarked):
    file = read_model_file(with_discrepancy(files / "model.json", share, tmp_path))
    (row,) = ask(file, Query([15.0], AT))
    assert row["remarks"] == ("the model is off by 1 % of |K*| (model discrepancy)" if remarked else "")


def test_a_map_has_the_scatter_about_it(files, tmp_path):
    file = read_model_file(files / "map.json")
    (entry,) = file.maps
    file.model_copy(update={"maps": [entry.model_copy(update={"scatter": [0.03, 0.04, 0.01]})]}).write(
        tmp_path / "map.json"
    )
    exported = export_results(tmp_path / "map.json", "modelica", points=[AT])
    assert "the model is off by 5 % of |K*| (scatter of the tests about the map)" in text_of(exported.path)
    assert "specimen can have" not in text_of(exported.path)
    assert "scatter of the tests" in exported.notes[0]


def test_the_accuracy_is_the_worst_of_all_conditions():
    one = Accuracy("the springs of a", (8.0, 20.0), 0.02, 0.03, Rung.RELAXING)
    other = Accuracy("the springs of a", (10.0, 24.0), 0.02, 0.05, Rung.MASS)
    joined = Accuracy.joined([one, other, Accuracy("the springs of a", (9.0, 21.0), 0.02, 0.01)])
    assert joined == Accuracy("the springs of a", (8.0, 24.0), 0.02, 0.05, Rung.MASS)
    assert joined.text.endswith(
        "specimen with a mass at its driven end can have K* as measured; the mass was taken off."
    )


def test_without_u_of_the_tests_no_model_is_said_to_fit_within_it(files):
    (entry,) = read_model_file(files / "model.json").models
    conditions = [one.model_copy(update={"verdict": None}) for one in entry.conditions]
    found = accuracy_of(entry.model_copy(update={"discrepancy": 0.0, "conditions": conditions}))
    assert found.misfit == "the model fits"
    assert found.sentences[1:] == ("The tests state no u(K*).",)
    u = accuracy_of(entry, entry.conditions[0]).u
    assert 0 < u <= accuracy_of(entry).u < 1e-3


def test_sentences_in_fe_cards_are_within_80_columns(files, tmp_path):
    lines = export_results(with_discrepancy(files / "model.json", 0.3, tmp_path), "lsdyna-springs").path.read_text()
    at = lines.splitlines().index(next(line for line in lines.splitlines() if line.startswith("$ K* of tyre")))
    assert all(len(line) <= 80 for line in lines.splitlines()[at : at + 3])
