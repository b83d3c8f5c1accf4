"""`fourpole export`: results for other tools."""

from __future__ import annotations

import json
import re
import shutil

import numpy as np
import polars as pl
import pytest
from tests.unlisted import unlisted

from fourpole import analyse
from fourpole.export import KINDS


@pytest.fixture(scope="module")
def results(small_campaign, tmp_path_factory):
    return analyse(small_campaign, monte_carlo=0).write(tmp_path_factory.mktemp("export") / "results")


@pytest.mark.parametrize(
    ("kind", "name"),
    [
        ("xlsx", "results.xlsx"),
        ("mat", "results.mat"),
        ("tydex", "tydex"),
        ("uff", "results.uff"),
        ("netcdf", "results.nc"),
    ],
)
@pytest.mark.sampled(4)
def test_each_kind_is_written_and_its_path_printed(run, results, kind, name, tmp_path):
    folder = shutil.copytree(results, tmp_path / "results")
    ran = run("export", folder, "--to", kind)
    assert (ran.exit_code, ran.stderr) == (0, "")
    assert ran.stdout == f"{kind}: {folder / name}\n"
    told = json.loads(run("export", folder, "--to", kind, "--json").stdout)
    assert told == {"kind": kind, "file": str(folder / name), "notes": []}
    assert (folder / name).exists()


def test_a_place_can_be_named(run, results, tmp_path):
    ran = run("export", results, "--to", "mat", "--out", tmp_path / "a.mat")
    assert ran.stdout == f"mat: {tmp_path / 'a.mat'}\n"
    assert (tmp_path / "a.mat").read_bytes().startswith(b"MATLAB 5.0 MAT-file")


def test_what_is_left_out_is_said_beside_the_path(run, results, tmp_path):
    folder = unlisted(shutil.copytree(results, tmp_path / "results"))
    lines = (folder / "dynamic.csv").read_text("utf-8").splitlines(keepends=True)
    assert ",ok," in lines[1]
    lines[1] = lines[1].replace(",ok,", ",rejected,")
    (folder / "dynamic.csv").write_text("".join(lines), "utf-8")
    ran = run("export", folder, "--to", "uff")
    assert ran.exit_code == 0
    assert ran.stderr == "warning: 1 test rejected left out: D1\n"
    assert ran.stdout.startswith("uff: ")


def test_an_unknown_kind_and_no_results_are_one_line_each(run, results, tmp_path):
    ran = run("export", results, "--to", "xls")
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert ran.stderr == (f"error: no kind of file 'xls': did you mean xlsx? It is one of {', '.join(KINDS)}\n")
    ran = run("export", tmp_path, "--to", "mat")
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert "holds neither results nor a campaign" in ran.stderr


def test_a_model_is_exported_for_a_vehicle_simulation(run, results, tmp_path):
    folder = shutil.copytree(results, tmp_path / "results")
    assert run("fit", folder, "--model", "zener").exit_code == 0
    ran = run("export", folder, "--to", "tir")
    assert (ran.exit_code, ran.stdout) == (2, "")
    assert "state its frequency, --frequency" in ran.stderr
    ran = run("export", folder, "--to", "tir", "--frequency", "14 Hz", "--radius", "316 mm")
    assert ran.stdout == f"tir: {folder / 'specimen.tir'}\n"
    assert "stiffness and damping are those at 14 Hz" in ran.stderr
    for kind in ("statespace", "modelica", "table"):
        ran = run("export", folder, "--to", kind)
        assert (ran.exit_code, ran.stdout) == (0, f"{kind}: {folder / KINDS[kind].file}\n")
    ran = run("export", folder, "--to", "modelica", "--at", "pressure 1.7")
    assert ran.stderr.startswith("error: --at: 'pressure 1.7' is no operating point")


def test_a_model_that_is_off_is_named_by_export_and_query(run, tmp_path):
    frequency = np.linspace(10.0, 24.0, 8)
    columns = {"frequency [Hz]": frequency, "Re K* [N/m]": np.full(8, 2e5), "Im K* [N/m]": np.full(8, 6e4)}
    pl.DataFrame(columns).write_csv(tmp_path / "mount.csv")
    model = tmp_path / "model.json"
    assert run("fit", tmp_path / "mount.csv", "--model", "spring", "--std", "1 %", "--out", model).exit_code == 0
    off = r"the model is off by (\d+) % of \|K\*\| \(model discrepancy\)"
    ran = run("export", model, "--to", "statespace")
    (share,) = re.findall(rf"warning: K\* of the specimen, 10 to 24 Hz: {off}", " ".join(ran.stderr.split()))
    assert ran.exit_code == 0
    assert 15 < float(share) < 30
    ran = run("query", model, "--frequency", "15 Hz")
    assert re.findall(off, " ".join(ran.stderr.split())) == [share]
