"""The self-test: it passes, it is a page to sign, and a small fault of any central function makes it fail."""

import csv
import hashlib
import io
import subprocess
import sys
from pathlib import Path

import pytest
from tests.report.mutants import mutated

from fourpole.report.selftest import (
    HEADS,
    Compared,
    campaign_names,
    cases,
    compared_campaign,
    compared_case,
    failed,
    number,
    reference,
    render_selftest,
    self_test,
    selftest_csv,
    word,
)

ROOT = Path(__file__).resolve().parents[2]

#: Faults that a slip of the pen makes: a function, the passage, and what stands in its place.
MUTANTS = [
    ("core.twoport:damper", "1.0 / np.asarray(coefficient), 1.0)", "np.asarray(coefficient), 1.0)"),
    ("core.twoport:inverse", "_fourpole(a22, -a12, -a21, a11)", "_fourpole(a22, a12, -a21, a11)"),
    ("core.tyre:zener_stiffness", "k1 + arm * k2", "k1 - arm * k2"),
    ("core.tyre:_rig_stiffness", "- omega**2", "+ omega**2"),
    ("core.tyre:energy_loss", "np.pi *", "2 * np.pi *"),
    ("core.rig:Rig.impedance", "self.moving_mass + self.tyre_mass +", "self.moving_mass +"),
    ("core.rig:Rig.impedance_gradient", "by_leaf * 1j", "by_leaf"),
    ("core.routes:mobility_route", " - np.asarray(rig_mobility)", " + np.asarray(rig_mobility)"),
    ("core.routes:relative_route", "(np.asarray(v1) - np.asarray(v2))", "(np.asarray(v1) + np.asarray(v2))"),
    ("core.routes:transmissibility_route", "t / (1 - t)", "t / (1 + t)"),
    ("core.routes:maxwell_arm", "(-1.0 / (np.asarray(omega)", "(1.0 / (np.asarray(omega)"),
    ("core.routes:arm_slopes", "(k2**2)", "(k2)"),
    ("core.reduced:_input_impedance", "1j * omega", "omega"),
    ("core.identify:ratio", "(by_over - value", "(by_over + value"),
    ("core.identify:Answers._identify", "_INPUT_MASS_AT] -= jw", "_INPUT_MASS_AT] -= 2 * jw"),
    ("core.channelerrors:ChannelUncertainty.errors", "1j * own.imag)", "0.5j * own.imag)"),
    ("core.chain:Delay.at", "-2j * np.pi", "2j * np.pi"),
    ("core.chain:Geophone.at", "2j * self.damping", "1j * self.damping"),
    ("core.loadcurve:LoadCurve.tangent", "0.5 * curve.slope_gap", "curve.slope_gap"),
    ("core.stats:share_within", "ends[1] - ends[0]", "ends[1]"),
    ("core.demodulation.demodulate:_to_velocity", "(1j * each)", "(-1j * each)"),
    ("models.maxwell:Zener.derivative", "(1 - share) ** 2", "(1 - share)"),
    ("models.fractional:FractionalZener.stiffness", "(high - low) * share", "high * share"),
    ("models.kraus:Kraus._law", "2.0 * np.sqrt", "np.sqrt"),
    ("models.shift_law:ShiftLaw.at_reference", "c1 * c2 / moved,", "c1 * moved / c2,"),
]

#: Faults that a whole campaign shows, with its name.
OF_CAMPAIGNS = [
    ("static", "core.loadcurve:Tangent.std_with_gains", "self.stiffness - self.load", "self.stiffness + self.load"),
    ("weighed-mass", "core.joint.outputs:outputs", "by_shared[:, 5] += direct", "by_shared[:, 5] -= direct"),
    ("weighed-mass", "core.joint.outputs:outputs", "-by_own @ slope", "by_own @ slope"),
    (
        "weighed-mass",
        "core.joint.outputs:_corrected_mobility",
        "gains[:, 0] / gains[:, 1]",
        "gains[:, 1] / gains[:, 0]",
    ),
    ("paper-route", "core.identify:variance_by_source", "slice(i, i + 1)", "slice(i, i + 2)"),
    ("bad-tests", "core.recordingchecks:check_lift_off", "0.9, 1.0", "0.9, 2.0"),
]


@pytest.fixture(scope="module")
def known():
    return cases()


@pytest.fixture(scope="module")
def tested():
    return self_test()


def test_every_value_passes_with_room(tested):
    assert [one for one in tested.values if not one.good] == []
    assert len(tested.values) > 600
    # what is round-off stays far below its tolerance, so that another machine passes as well
    rounded = [one for one in tested.summaries if not one.check.startswith(("campaign", "static curve"))]
    assert max(one.largest for one in rounded) < 0.5


def test_the_machine_the_program_and_the_data_are_named(tested):
    assert tested.origin.version
    assert set(tested.sha256) == {"vectors.json", *(f"campaigns/{name}" for name in campaign_names())}
    content = reference().joinpath("vectors.json").read_bytes()
    assert tested.sha256["vectors.json"] == hashlib.sha256(content).hexdigest()
    assert {"numpy", "scipy", "polars"} <= set(tested.packages)


def test_the_documentation_has_the_hashes_of_the_data(tested):
    page = (ROOT / "docs" / "selftest.md").read_text(encoding="utf-8")
    assert [name for name, sha in tested.sha256.items() if f"{name:<24} {sha}" not in page] == []


def test_the_page_has_lines_to_write_on_or_what_is_stated(tested):
    blank, filled = render_selftest(tested), render_selftest(tested, "North <b>hall</b>", "A. Tester")
    assert blank.count('class="blank"') == 3
    assert filled.count('class="blank"') == 1  # the signature
    assert "North &lt;b&gt;hall&lt;/b&gt;" in filled
    assert "A. Tester" in filled
    for one in (*tested.sha256.values(), tested.machine, tested.system):
        assert one in blank


def test_the_table_has_every_value_with_all_digits(tested):
    rows = list(csv.reader(io.StringIO(selftest_csv(tested))))
    assert rows[0] == list(HEADS)
    assert len(rows) == 1 + len(tested.values)
    assert {row[-1] for row in rows[1:]} == {"pass"}
    assert max(len(row[4]) for row in rows) > 50


@pytest.mark.parametrize(("place", "old", "new"), MUTANTS, ids=[place for place, _, _ in MUTANTS])
def test_a_small_fault_of_a_formula_is_caught(known, place, old, new):
    module = place.partition(":")[0]
    first = sorted(known, key=lambda one: not one["function"].startswith(module.rpartition(".")[0]))
    with mutated(place, old, new):
        assert any(not value.good for one in first for value in compared_case(one))


@pytest.mark.parametrize(("name", "place", "old", "new"), OF_CAMPAIGNS, ids=[place for _, place, _, _ in OF_CAMPAIGNS])
@pytest.mark.sampled(2)
def test_a_small_fault_of_the_analysis_is_caught(name, place, old, new):
    with mutated(place, old, new):
        assert any(not value.good for value in compared_campaign(name))


def test_a_value_passes_within_its_tolerance_only():
    assert number("a", "f", "K2", "N/m", "2.0", 2.1, 0.1000001).good
    assert not number("a", "f", "K2", "N/m", "2.0", 2.1, 0.0999).good
    assert not number("a", "f", "K2", "N/m", "2.0", float("nan"), 1.0).good
    assert number("a", "f", "K2", "N/m", "2.0", float("inf"), 1.0).share == float("inf")
    assert word("a", "f", "verdict", "ok", "ok").good
    assert not word("a", "f", "verdict", "ok", "warning").good
    assert failed("a", "f", "K2", "an error") == Compared("a", "f", "K2", "", "a value", "an error", None, None, False)


def test_a_function_that_ends_with_an_error_fails_and_does_not_stop_the_test(known, monkeypatch):
    def broken(*given):
        raise ZeroDivisionError("division by zero")

    monkeypatch.setattr("fourpole.core.polar.polar", broken)
    one = next(each for each in known if each["function"] == "core.polar.polar")
    (found,) = compared_case(one)
    assert (found.good, found.found) == (False, "ZeroDivisionError: division by zero")


@pytest.mark.thorough
@pytest.mark.sampled(8)
def test_the_data_are_what_the_script_makes(tmp_path):
    """The script shares no code with the package: it imports nothing of it."""
    pytest.importorskip("mpmath")
    script = ROOT / "tools" / "make_reference.py"
    assert not any("fourpole" in line for path in script.parent.rglob("*.py") for line in imports_of(path))
    subprocess.run([sys.executable, str(script), str(tmp_path)], check=True)
    made = {path.relative_to(tmp_path).as_posix(): path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    folder = Path(str(reference()))
    here = {path.relative_to(folder).as_posix(): path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert sorted(made) == sorted(here)
    assert [name for name in made if made[name] != here[name]] == []


def imports_of(path):
    return [line for line in path.read_text().splitlines() if line.startswith(("import ", "from "))]


def test_expected_values_have_fifty_digits(known):
    digits = [len(row["expected"].split("e")[0].replace(".", "").strip("-0")) for one in known for row in one["values"]]
    assert max(digits) == 50
    assert sum(count > 40 for count in digits) > 0.8 * len(digits)
