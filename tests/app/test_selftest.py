"""fourpole selftest: the table it prints, the files it writes, and its exit code."""

import json

import pytest

from fourpole.report.selftest import number


def test_the_command_prints_a_table_and_writes_what_is_wanted(run, tmp_path):
    done = run("selftest", "--out", tmp_path / "test.html", "--operator", "A. Tester")
    assert done.exit_code == 0
    assert "all pass" in done.output
    assert max(len(line) for line in done.stdout.splitlines() if not line.startswith("written")) <= 80
    assert sorted(path.name for path in tmp_path.iterdir()) == ["test.csv", "test.html"]
    assert "A. Tester" in (tmp_path / "test.html").read_text()
    done = run("selftest", "--out", tmp_path / "test.pdf")
    assert done.exit_code == 2
    assert "ends in .html" in done.output


@pytest.mark.parametrize(("content", "said"), [(None, "cannot be read"), ("{", "is damaged")])
def test_an_installation_without_its_data_is_said(run, monkeypatch, tmp_path, content, said):
    if content is not None:
        (tmp_path / "vectors.json").write_text(content)
    monkeypatch.setattr("fourpole.report.selftest.reference", lambda: tmp_path)
    done = run("selftest")
    assert done.exit_code == 2
    assert f"{said}" in done.output
    assert "install Fourpole again" in " ".join(done.output.split())


def test_the_command_fails_where_a_value_does(run, monkeypatch):
    bad = number("tyre", "core.tyre.mobility", "Re V1/F1", "m/(N s)", "1.0", 1.1, 1e-9)
    monkeypatch.setattr("fourpole.report.selftest.compared_campaign", lambda name: [bad])
    done = run("selftest")
    assert done.exit_code == 3
    assert "differs by 0.1 m/(N s), tolerance 1e-09" in done.output
    done = run("selftest", "--json")
    document = json.loads(done.stdout)
    assert (done.exit_code, document["good"]) == (3, False)
    assert document["failed"][0]["value"] == "Re V1/F1"
