"""A verdict for each quantity, and one for the test on what was asked of it."""

from __future__ import annotations

import numpy as np
import pytest

from fourpole.study import analyse

RATE, HERTZ, AMPLITUDE = 2000.0, 5.0, 1e-3
CAMPAIGN = """
[rig]
output = "blocked"
[channels]
time = { column = "t", unit = "s" }
force_in = { column = "F", unit = "N" }
motion_in = { column = "x", unit = "mm" }
[specimens.mount]
"""


@pytest.fixture
def bench(tmp_path):
    """A mount of a stiffness K* on a bench whose far side does not move, written without the package."""

    def make(stiffness, k1="", further=""):
        turn = 2 * np.pi * HERTZ * np.arange(8000) / RATE
        rng = np.random.default_rng(3)
        force = AMPLITUDE * abs(stiffness) * np.sin(turn + np.angle(stiffness)) + rng.normal(size=turn.size)
        motion = 1e3 * AMPLITUDE * np.sin(turn) + 1e-3 * rng.normal(size=turn.size)
        columns = np.c_[np.arange(turn.size) / RATE, motion, force]
        np.savetxt(tmp_path / "D1.csv", columns, delimiter=",", header="t,x,F", comments="", fmt="%.9g")
        (tmp_path / "campaign.toml").write_text(CAMPAIGN + further)
        rows = "test,file,kind,specimen,frequency [Hz],K1 [N/m],u(K1) [N/m]"
        (tmp_path / "tests.csv").write_text(f"{rows}\nD1,D1.csv,dynamic,mount,{HERTZ:g},{k1},{k1 and 100}\n")
        study = analyse(tmp_path)
        (row,) = study.dynamic.rows(named=True)
        return row, study.checks

    return make


def verdicts(row):
    return [row[name] for name in ("verdict", "verdict K*", "verdict K2 C", "verdict TR")]


def test_without_k1_only_the_stiffness_is_asked(bench):
    row, checks = bench(2e5 + 3e4j)
    assert verdicts(row) == ["ok", "ok", "", ""]
    assert row["remarks"] == ""
    assert "K2 C" not in set(checks["quantity"])


def test_with_k1_the_arm_is_asked_too(bench):
    row, checks = bench(2e5 + 3e4j, k1="150000")
    assert verdicts(row) == ["ok", "ok", "ok", ""]
    assert set(checks["quantity"]) == {"K*", "K2 C"}


@pytest.mark.parametrize("stiffness", [2e5 + 3e4j, -5e4 + 3e4j])
def test_a_test_without_a_passive_arm_is_no_bad_test(bench, stiffness):
    """K' below K1, as by a belt or by a mass before the force cell, and K' below zero."""
    row, _ = bench(stiffness, k1="220000")
    assert verdicts(row) == ["ok", "ok", "rejected", ""]
    assert "no passive K2" in row["remarks"]
    assert row["Re K* [N/m]"] == pytest.approx(stiffness.real, rel=1e-2)


def test_it_is_rejected_where_k2_stands_in_the_statement(bench):
    row, _ = bench(2e5 + 3e4j, k1="220000", further='[analysis]\nasked = ["K*", "K2"]\n')
    assert verdicts(row) == ["rejected", "ok", "rejected", ""]


def test_what_is_not_asked_has_no_verdict(bench):
    row, _ = bench(2e5 + 3e4j, k1="220000", further='[analysis]\nasked = ["K*"]\n')
    assert verdicts(row) == ["ok", "ok", "", ""]


def test_a_k1_that_is_asked_for_and_lacks_is_said(bench):
    row, _ = bench(2e5 + 3e4j, further='[analysis]\nasked = ["C"]\n')
    assert verdicts(row) == ["warning", "", "warning", ""]
    assert "add one, or state K1" in row["remarks"]


def test_a_specimen_that_gives_energy_is_rejected_by_itself(bench):
    row, _ = bench(2e5 - 3e4j)
    assert verdicts(row) == ["rejected", "rejected", "", ""]
    assert "would give energy" in row["remarks"]


def test_one_reason_for_two_quantities_stands_once(bench):
    row, _ = bench(2e5 - 3e4j, k1="150000")
    assert verdicts(row) == ["rejected", "rejected", "rejected", ""]
    assert row["remarks"].count("would give energy") == 1


def test_a_spring_whose_loss_is_below_the_uncertainty_is_no_wrong_one(bench):
    row, _ = bench(2e5 - 1e2j)
    assert verdicts(row) == ["ok", "ok", "", ""]


def test_a_k1_that_is_much_too_large_is_a_doubt_on_k1_alone(bench):
    row, _ = bench(2e5 + 3e4j, k1="400000")
    assert verdicts(row) == ["warning", "ok", "rejected", ""]
    assert "K1 looks too large" in row["remarks"]
