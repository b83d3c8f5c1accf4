"""The programs beside the package run: `make validate`, on a few campaigns."""

import importlib
import json
from pathlib import Path

import pytest

pytestmark = pytest.mark.thorough

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def validate(monkeypatch, tmp_path):
    """The module, writing to a folder of its own."""
    monkeypatch.syspath_prepend(str(ROOT / "validation"))
    module = importlib.import_module("validate")
    document = tmp_path / "validation.md"
    document.write_text(f"before\n{module.BEGIN}\nold\n{module.END}\nafter\n")
    monkeypatch.setattr(module, "ROOT", tmp_path)
    monkeypatch.setattr(module, "RESULTS", tmp_path / "results")
    monkeypatch.setattr(module, "DOCUMENT", document)
    monkeypatch.setattr(module, "_code", lambda: "code")
    return module


def test_validation_runs_and_writes_its_document(validate, monkeypatch):
    """Campaign 0 is also held against the Cramér-Rao bound; all that the campaigns share has a true value."""
    monkeypatch.setattr("sys.argv", ["validate.py", "--phasors", "2", "--recordings", "1"])
    assert validate.main() == 0

    first = json.loads((validate.RESULTS / "phasors.jsonl").read_text().splitlines()[1])
    assert {"moving_mass", "preload_stiffness", "gain F1", "phase V2"} <= first["z"].keys()
    assert {"K'", "K2", "C", "TR", "moving_mass"} <= first["bound"].keys()
    recorded = json.loads((validate.RESULTS / "recordings.jsonl").read_text().splitlines()[1])
    assert sum(recorded["verdicts"].values()) == recorded["tests"]

    text = validate.DOCUMENT.read_text()
    assert text.startswith("before\n")
    assert text.endswith("\nafter\n")
    assert "2 campaigns, numbers 0 to 1." in text
    assert "old" not in text.splitlines()
