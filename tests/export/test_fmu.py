"""FMUs as archives: what is inside, the same bytes again, C source without a warning, and what is refused."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import polars as pl
import pytest
from tests.export.fmus import BELT, MODELS, WITH_INERTIA, compiler, sources
from tests.export.vehicle import FREQUENCY, LOAD, PRESSURE, parameters, table

from fourpole.errors import CampaignError, ModelError
from fourpole.export import export_results
from fourpole.export.fmi.description import COMPILED, compiled_files
from fourpole.fitting.measured import measured_of
from fourpole.fitting.modelling import fit_tyres, model_file
from fourpole.models.families import model_named

MACHINE = platform.machine()
HERE = Path(__file__).parent
both = pytest.mark.parametrize("version", [2, 3])
on_linux = pytest.mark.skipif(sys.platform != "linux", reason="the folder of the binary has another name")


def start_of(path, name):
    """Start values of a variable, by its name, of the description inside an FMU."""
    with zipfile.ZipFile(path) as archive:
        root = ET.fromstring(archive.read("modelDescription.xml"))
    found = next(one for one in root.find("ModelVariables") if one.get("name") == name)
    return float((found if found.get("start") else found[0]).get("start"))


def description(path):
    with zipfile.ZipFile(path) as archive:
        return archive.read("modelDescription.xml").decode()


@on_linux
@pytest.mark.parametrize(("kind", "place"), [("fmu", "linux64"), ("fmu3", f"{MACHINE}-linux")])
@pytest.mark.sampled(2)
def test_an_fmu_has_description_sources_and_binary_and_is_the_same_again(files, tmp_path, kind, place):
    compiler()
    first = export_results(files / "model.json", kind, tmp_path / "a.fmu")
    assert first.notes == ()
    second = export_results(files / "model.json", kind, tmp_path / "b.fmu")
    assert first.path.read_bytes() == second.path.read_bytes()
    with zipfile.ZipFile(first.path) as archive:
        names = archive.namelist()
        assert archive.testzip() is None
        assert {one.date_time for one in archive.infolist()} == {(1980, 1, 1, 0, 0, 0)}
    sources = {name for name in names if name.endswith((".c", ".h"))}
    if kind == "fmu3":
        sources.add("sources/buildDescription.xml")
    assert set(names) == {"modelDescription.xml", f"binaries/{place}/tyre.so", *sources}
    assert {f"sources/{name}" for name in COMPILED[3 if kind == "fmu3" else 2]} < sources


@pytest.mark.sampled(2)
def test_each_condition_of_a_file_of_fits_is_an_operating_point(files, tmp_path):
    path = export_results(files / "model.json", "fmu", tmp_path / "a.fmu").path
    for at, (pressure, load) in enumerate([(1.7e5, 2e3), (1.7e5, 3.5e3), (1.7e5, 5e3), (2e5, 2e3)], start=1):
        k1, k2, c = parameters(pressure, load)
        assert start_of(path, f"points[{at}].stiffness_at_rest") == pytest.approx(k1, rel=1e-6)
        assert start_of(path, f"points[{at}].branches[1].stiffness") == pytest.approx(k2, rel=1e-6)
        assert start_of(path, f"points[{at}].branches[1].relaxation_time") == pytest.approx(c / k2, rel=1e-6)
    assert "4 = tyre, 2 bar, 2000 N" in description(path)


@pytest.mark.sampled(2)
def test_a_map_gives_the_points_that_are_asked(files, tmp_path):
    points = [{PRESSURE: 1.85e5, LOAD: 3e3}, {PRESSURE: 2.2e5, LOAD: 4e3}]
    path = export_results(files / "map.json", "fmu3", tmp_path / "a.fmu", points=points).path
    for at, point in enumerate(points, start=1):
        k1 = start_of(path, f"points[{at}].stiffness_at_rest")
        assert k1 == pytest.approx(parameters(point[PRESSURE], point[LOAD])[0], rel=2e-3)
    with pytest.raises(ModelError, match="state the operating point"):
        export_results(files / "map.json", "fmu", tmp_path / "b.fmu")
    with pytest.raises(ModelError, match="outside what was measured"):
        export_results(files / "map.json", "fmu", tmp_path / "b.fmu", points=[{PRESSURE: 9e5, LOAD: 3e3}])
    assert not (tmp_path / "b.fmu").exists()


def test_a_model_that_is_not_causal_is_refused_with_the_remedy(tmp_path):
    measured = measured_of(table(pressures=[2e5], loads=[2e3]), std=1e-3)
    model_file(measured, fit_tyres(measured, "structural")).write(tmp_path / "model.json")
    with pytest.raises(ModelError, match=r"not causal.*fit --model prony"):
        export_results(tmp_path / "model.json", "fmu")
    assert [one.name for one in tmp_path.iterdir()] == ["model.json"]


@pytest.mark.sampled(2)
def test_an_approximation_is_said_with_its_error(tmp_path):
    k = model_named("fractional").stiffness(MODELS["fractional"], 2 * np.pi * FREQUENCY)
    frame = table([2e5], [2e3]).with_columns(pl.Series("Re K* [N/m]", k.real), pl.Series("Im K* [N/m]", k.imag))
    measured = measured_of(frame, std=1e-3)
    model_file(measured, fit_tyres(measured, "fractional")).write(tmp_path / "model.json")
    (note,) = export_results(tmp_path / "model.json", "fmu").notes
    assert note.startswith("the file has an approximation of the fractional model: from 1 to 60 Hz")


def test_more_points_than_an_fmu_has_are_refused(files, tmp_path):
    points = [{PRESSURE: float(one), LOAD: 3e3} for one in np.linspace(1.7e5, 2.4e5, 101)]
    with pytest.raises(ModelError, match="101 operating points are more than 100"):
        export_results(files / "map.json", "fmu", tmp_path / "a.fmu", points=points)


@pytest.mark.sampled(2)
def test_names_of_any_letters_stay_text(tmp_path):
    frame = pl.concat([table([2e5], [2e3], tyre=name) for name in ('<b>"A" & co\u0007', "タイヤ 1")])
    measured = measured_of(frame, std=1e-3)
    model_file(measured, fit_tyres(measured, "zener")).write(tmp_path / "model.json")
    text = description(export_results(tmp_path / "model.json", "fmu").path)
    assert "1 = &lt;b&gt;&quot;A&quot; &amp; co?, 2 bar, 2000 N; 2 = タイヤ 1, 2 bar, 2000 N" in text
    one = export_results(tmp_path / "model.json", "fmu", specimen="タイヤ 1").path
    assert 'modelName="タイヤ 1"' in description(one)
    assert 'modelIdentifier="x1"' in description(one)


def test_without_a_compiler_the_sources_are_inside_and_it_is_said(files, tmp_path, monkeypatch):
    monkeypatch.setenv("PATH", str(tmp_path))
    exported = export_results(files / "model.json", "fmu", tmp_path / "a.fmu")
    assert len(exported.notes) == 1
    assert "has no binary, only sources" in exported.notes[0]
    assert "no C compiler was found" in exported.notes[0]
    with zipfile.ZipFile(exported.path) as archive:
        assert not [name for name in archive.namelist() if name.startswith("binaries")]
        assert "sources/fmi2.c" in archive.namelist()


@pytest.mark.skipif(os.name != "posix", reason="a script is no program there")
def test_what_a_compiler_says_when_it_fails_is_said(files, tmp_path, monkeypatch):
    program = tmp_path / "gcc"
    program.write_text("#!/bin/sh\necho 'cannot find crti.o' >&2\nexit 1\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    notes = export_results(files / "model.json", "fmu", tmp_path / "a.fmu").notes
    assert notes[0].endswith("gcc failed: cannot find crti.o")


def test_an_fmu_is_of_a_model(files, tmp_path):
    with pytest.raises(CampaignError, match="fmu has no use for a frequency"):
        export_results(files / "model.json", "fmu", tmp_path / "a.fmu", frequency=20.0)


#: Operating points without a state, and with branches and pairs of states.
SETS = {"damper": {"kelvin": [2e5, 300.0]}, "shell": WITH_INERTIA}
#: Each pair of version, models and belt is in one of these.
pairs = pytest.mark.parametrize(
    ("version", "models", "belt"), [(2, "damper", None), (2, "shell", BELT), (3, "damper", BELT), (3, "shell", None)]
)


@pytest.mark.thorough
@pairs
@pytest.mark.sampled(4)
def test_the_source_compiles_without_a_warning(tmp_path, version, models, belt):
    files = compiled_files(version, belted=belt is not None)
    command = [compiler(), "-std=c99", "-Wall", "-Wextra", "-pedantic", "-O2", "-c", *files]
    folder = sources(tmp_path, version, SETS[models], belt)
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")


def driven(tmp_path, version, models, *flags, belt=None):
    """The program that drives an FMU in C, compiled with its sources."""
    folder = sources(tmp_path, version, models, belt)
    program, driver = tmp_path / "drive", HERE / f"drive_fmi{version}.c"
    command = [
        compiler(),
        "-std=c99",
        "-g",
        *flags,
        "-I.",
        "-o",
        program,
        driver,
        *compiled_files(version, belted=belt is not None),
        "-lm",
    ]
    subprocess.run(command, cwd=folder, check=True)
    return program


@pytest.mark.thorough
@pairs
@pytest.mark.sampled(4)
def test_no_call_right_or_wrong_breaks_the_memory(tmp_path, version, models, belt):
    flags = ("-fsanitize=address,undefined", "-fno-sanitize-recover=all")
    program = driven(tmp_path, version, SETS[models], *flags, belt=belt)
    done = subprocess.run([program], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "as it should be\n", "")


@pytest.mark.thorough
@both
@pytest.mark.skipif(shutil.which("valgrind") is None, reason="valgrind is not installed")
@pytest.mark.sampled(2)
def test_valgrind_finds_nothing(tmp_path, version):
    command = ["valgrind", "--quiet", "--leak-check=full", "--error-exitcode=9", driven(tmp_path, version, MODELS)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "as it should be\n", "")
