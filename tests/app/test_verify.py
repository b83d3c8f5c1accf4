"""fourpole verify on results: what was changed, what is missing, and what a second run says."""

import json
import shutil

import polars as pl
import pytest

from fourpole.app.console import OK, SOME_REJECTED, UNREADABLE
from fourpole.io.kernel import filled_by, filling
from fourpole.io.seal import sealed
from fourpole.study import verified


@pytest.fixture(scope="module")
def analysed(noisy_campaign, run, tmp_path_factory):
    """A campaign with its results and a model."""
    folder = shutil.copytree(noisy_campaign, tmp_path_factory.mktemp("verify") / "campaign")
    assert run("analyse", folder, "--tables-only").exit_code == OK
    assert run("fit", folder, "--model", "zener").exit_code == OK
    return folder


@pytest.fixture
def mine(analysed, tmp_path):
    """A copy to change."""
    return shutil.copytree(analysed, tmp_path / "campaign")


def edited(folder, name="dynamic.csv", column="K2 [N/m]"):
    """Write a table again with one number 0.1 % larger."""
    table = pl.read_csv(folder / name, infer_schema_length=None)
    factor = pl.when(pl.col("test") == "D3").then(1.001).otherwise(1.0)
    table.with_columns(pl.col(column) * factor).write_csv(folder / name)


def changed_record(folder, change):
    """Change study.json, and seal it again, as one who knows how."""
    path = folder / "study.json"
    record = json.loads(path.read_text())
    change(record)
    path.write_text(json.dumps(sealed(record) if "seal" in record else record))


def test_results_are_verified_and_nothing_is_written(analysed, run):
    before = {path: path.stat().st_mtime_ns for path in analysed.rglob("*")}
    done = run("verify", analysed)
    assert done.exit_code == OK, done.output
    assert "to the last bit" in done.stdout
    assert done.stdout.endswith("Verified.\n")
    assert done.stderr == ""
    assert {path: path.stat().st_mtime_ns for path in analysed.rglob("*")} == before


@pytest.mark.parametrize("path", ["", "results", "results/study.json"])
def test_hashes_alone_open_no_recording(analysed, run, monkeypatch, path):
    monkeypatch.setattr("fourpole.study.verified.analyse", None)
    document = json.loads(run("verify", analysed / path, "--quick", "--json").stdout)
    assert (document["good"], document["complete"], document["run_again"]) == (True, True, [])
    assert {one["state"] for one in (*document["inputs"], *document["tables"], *document["models"])} <= {
        "same",
        "written since, with its own seal",
    }


@pytest.mark.usefixtures("library")
@pytest.mark.parametrize(("made", "wanted"), [("numpy", None), ("c", "numpy")])
def test_the_second_run_is_done_by_what_did_the_first_one(mine, run, monkeypatch, made, wanted):
    """The library in C, or numpy; whatever the variable wants now."""
    shutil.rmtree(mine / "results")
    with filled_by(made):
        assert run("analyse", mine, "--tables-only").exit_code == OK
    assert json.loads((mine / "results" / "study.json").read_text())["kernel"] == made
    again, fillings = verified.analyse, []
    monkeypatch.setattr(verified, "analyse", lambda *a, **b: fillings.append(filling()) or again(*a, **b))
    with filled_by(wanted or ""):
        done = run("verify", mine)
    assert done.exit_code == OK, done.output
    assert "to the last bit" in done.stdout
    assert fillings == [made]


def test_a_table_that_was_changed_by_hand(mine, run):
    edited(mine / "results")
    done = run("verify", mine)
    assert done.exit_code == UNREADABLE
    assert "dynamic.csv: has changed since" in done.stderr
    assert "dynamic.csv: K2 [N/m] in D3" in done.stderr
    assert done.stdout.endswith("Not verified.\n")


def test_a_table_that_was_changed_with_its_hash_is_found_by_the_second_run(mine, run):
    from fourpole.io.door import sha256_of

    edited(mine / "results")
    new = sha256_of(mine / "results" / "dynamic.csv", max_bytes=10**9)

    def forged(record):
        record["results"]["dynamic.csv"] = new
        for name in ("model.json", "figures/storage-loss.svg"):
            record["results"].pop(name, None)
            (mine / "results" / name).unlink(missing_ok=True)

    changed_record(mine / "results", forged)
    assert run("verify", mine, "--quick").exit_code == OK
    done = run("verify", mine)
    assert done.exit_code == UNREADABLE
    assert "K2 [N/m] in D3" in done.stderr


def test_an_input_that_has_changed(mine, run):
    with (mine / "recordings" / "D2.csv").open("a") as file:
        file.write("\n")
    done = run("verify", mine)
    assert done.exit_code == UNREADABLE
    assert "recordings/D2.csv: has changed since" in done.stderr
    assert "run again not done: recordings/D2.csv has changed" in done.stdout


def test_recordings_that_are_gone_leave_a_part_unchecked(mine, run):
    shutil.rmtree(mine / "recordings")
    done = run("verify", mine)
    assert done.exit_code == SOME_REJECTED
    assert "inputs are not there" in done.stdout
    edited(mine / "results")
    assert run("verify", mine).exit_code == UNREADABLE  # what is there is held against its hash all the same


@pytest.mark.parametrize("name", ["dynamic.csv", "rig.csv", "phasors.parquet"])
def test_results_that_are_not_complete(mine, run, name):
    (mine / "results" / name).unlink()
    done = run("verify", mine, "--quick")
    assert done.exit_code == UNREADABLE
    assert f"{name}: is not there" in done.stderr


def test_results_without_their_record(mine, run):
    (mine / "results" / "study.json").unlink()
    done = run("verify", mine)
    assert done.exit_code == UNREADABLE
    assert "not complete, study.json is not there" in done.stderr
    (mine / "results" / "study.json").write_text("[]")
    assert "cannot be read" in run("verify", mine).stderr


def test_a_table_that_does_not_belong_to_the_results(mine, run):
    (mine / "results" / "quantiles.csv").write_text("test\n")
    done = run("verify", mine, "--quick")
    assert done.exit_code == UNREADABLE
    assert "quantiles.csv: was not written with these results" in done.stderr


def test_a_model_that_was_changed_and_one_that_was_fitted_anew(mine, run):
    assert run("fit", mine, "--model", "spring").exit_code == OK
    assert run("verify", mine, "--quick").exit_code == OK
    model = mine / "results" / "model.json"
    model.write_text(model.read_text().replace('"spring"', '"kelvin"', 1))
    done = run("verify", mine, "--quick")
    assert done.exit_code == UNREADABLE
    assert "models[0].model was changed" in done.stderr


def test_results_of_another_version(mine, run):
    def older(record):
        record["versions"]["fourpole"] = "0.0.9"
        del record["origin"], record["results"], record["sizes"], record["seal"]

    changed_record(mine / "results", older)
    done = run("verify", mine, "--quick")
    assert done.exit_code == SOME_REJECTED
    assert "results of Fourpole 0.0.9" in done.stdout
    assert "an earlier version wrote them" in done.stdout
    assert run("verify", mine).exit_code == OK  # the second run is the same
    edited(mine / "results")
    done = run("verify", mine)
    assert done.exit_code == UNREADABLE
    assert "written by version 0.0.9: the difference may be that of the versions" in done.stderr


def test_results_in_another_folder_need_the_name_of_their_campaign(mine, run, tmp_path):
    elsewhere = shutil.move(mine / "results", tmp_path / "elsewhere")
    assert run("verify", elsewhere).exit_code == SOME_REJECTED
    assert run("verify", elsewhere, "--campaign", mine).exit_code == OK
    done = run("verify", elsewhere, "--campaign", tmp_path)
    assert done.exit_code == UNREADABLE
    assert "no campaign" in done.stderr


def test_names_in_a_record_lead_to_no_file_outside_the_campaign(mine, run):
    changed_record(mine / "results", lambda record: record["sha256"].update({"../../secret.csv": "0" * 64}))
    done = run("verify", mine, "--quick")
    assert "lies outside the campaign folder" in done.stderr


@pytest.mark.parametrize("key", ["notes", "settings", "verdicts"])
def test_a_line_taken_out_of_the_record_is_found(mine, run, key):
    path = mine / "results" / "study.json"
    record = json.loads(path.read_text())
    del record[key]
    path.write_text(json.dumps(record))
    done = run("verify", mine, "--quick")
    assert done.exit_code == UNREADABLE
    assert f"study.json: {key} was removed" in done.stderr


def test_the_record_has_the_hashes_of_all_files_as_they_are(analysed):
    from fourpole.io.door import sha256_of
    from fourpole.io.origin import origin

    record = json.loads((analysed / "results" / "study.json").read_text())
    paths = [path.relative_to(analysed / "results") for path in (analysed / "results").rglob("*") if path.is_file()]
    there = {path.as_posix() for path in paths if path.parts[0] not in ("cache", ".store", "study.json")}
    assert set(record["results"]) == there
    assert record["sizes"] == {name: (analysed / "results" / name).stat().st_size for name in there}
    assert all(
        sha256_of(analysed / "results" / name, max_bytes=10**9) == sha for name, sha in record["results"].items()
    )
    assert record["origin"] == origin().record
