"""The sentences of checks and causes, and the file of their texts."""

import re
import tomllib
from importlib import resources

import numpy as np
import pytest

from fourpole.core.checks import (
    VERDICTS,
    Branch,
    Check,
    Code,
    Difficulty,
    Excitation,
    Looks,
    NoK1,
    Side,
    Steep,
    Verdict,
    reported,
)
from fourpole.core.components import COMPONENTS
from fourpole.core.sources import Kind, Role
from fourpole.words import interval_words, remark_of, template

TEXTS = tomllib.loads(resources.files("fourpole.words").joinpath("words.toml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("code", Code)
def test_every_code_says_what_it_looks_at_and_has_a_sentence(code):
    assert template(code, "about")
    for verdict in VERDICTS:
        cause, remedy = template(code, "cause", verdict), template(code, "remedy", verdict)
        assert cause
        assert not remedy or cause.endswith((": ", "; ", "{why}"))
        assert not remedy.endswith((".", " "))


def test_the_file_has_the_texts_of_the_codes_and_of_no_other():
    assert list(TEXTS["checks"]) == [code.text for code in Code]
    parts = {"about", "short", "cause", "remedy"}
    for texts in TEXTS["checks"].values():
        assert set(texts) - {"rejected", "lines", "nonlinear", "masses", "range", "blocked"} <= parts
        assert all(set(case) <= parts for case in texts.values() if isinstance(case, dict))


@pytest.mark.parametrize(
    ("group", "case"), [("looks", Looks), ("k1", Branch), ("k1", Side), ("excitation", Excitation), ("steep", Steep)]
)
def test_every_case_has_words(group, case):
    assert all(TEXTS[group][member.name.lower()] for member in case)


@pytest.mark.parametrize(("group", "cases"), [("no_k1", NoK1), ("difficulty", Difficulty)])
def test_every_lack_of_k1_and_every_difficulty_has_a_cause_and_a_remedy(group, cases):
    assert all(TEXTS[group][f"{case.name.lower()}_{part}"] for case in cases for part in ("why", "remedy"))


def test_every_text_is_named_in_the_program():
    source = resources.files("fourpole.words").joinpath("__init__.py").read_text(encoding="utf-8")
    for group in set(TEXTS) - {"checks", "causes", "looks", "excitation", "no_k1", "difficulty", "steep", "units"}:
        members = {member.name.lower() for case in (Branch, Side) for member in case}
        assert all(f'"{key}"' in source for key in TEXTS[group] if key not in members), group


def test_every_cause_of_a_misfit_is_made_somewhere():
    made = ("core/joint/misfit.py", "study/rig_read.py", "study/rig_solution.py")
    root = resources.files("fourpole")
    source = "".join(root.joinpath(*name.split("/")).read_text(encoding="utf-8") for name in made)
    by_kind = {kind.name.lower() for kind in Kind} | {row.group for row in COMPONENTS}
    assert {form for form in TEXTS["causes"] if not re.search(rf'"{form}"', source)} <= by_kind


def test_every_component_of_a_channel_or_a_specimen_has_words_as_a_cause():
    asked = [row for row in COMPONENTS if row.kind.role in (Role.CHANNEL, Role.MOUNTING, Role.SPECIMEN, Role.TEST)]
    named = {"delay": ("late", "early")}
    for row in [one for one in asked if one.group != "belt"]:  # a belt is an explanation, and no cause of a misfit
        forms = named.get(row.group, (row.kind.name.lower(), row.group))
        assert any(form in TEXTS["causes"] for form in forms), row.kind


def test_a_rejection_may_have_words_of_its_own():
    assert template(Code.LIFT_OFF, "short", "rejected") != template(Code.LIFT_OFF, "short", "warning")
    assert template(Code.CLIPPING, "short", "rejected") == template(Code.CLIPPING, "short", "warning")


def test_braces_in_a_file_name_stand_as_they_are():
    assert "{0} {x}.csv" in remark_of(reported(Code.MEMORY, Verdict.REJECTED, file="{0} {x}.csv"))


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (1e5, 2e5, " between 100 kN/m and 200 kN/m (95 % by Monte Carlo)"),
        (1e5, np.inf, " between 100 kN/m and no upper limit (95 % by Monte Carlo)"),
        (np.inf, np.inf, " without a limit"),
    ],
)
def test_an_interval_by_monte_carlo_in_words(low, high, said):
    assert interval_words(low, high, "N/m") == said


def test_the_parts_cut_off_in_words():
    start, both = (
        remark_of(reported(Code.STEADY, Verdict.OK, before=2.0, after=after, length=9.0)) for after in (0.0, 1.5)
    )
    assert start.startswith("the first 2 s (lead-in, run-up) of 9 s")
    assert both.startswith("the first 2 s (lead-in, run-up) and the last 1.5 s (run-down) of 9 s")


def test_a_rejection_that_may_pass_keeps_its_words():
    """A first part of a recording, before the drive starts, is a warning with the words of the rejection."""
    values = {"peak": 1500.0, "preload": 1000.0}
    rejected = Check(Code.LIFT_OFF, Verdict.REJECTED, 1.5, 1.0, values=values)
    later = Check(Code.LIFT_OFF, Verdict.WARNING, 1.5, 1.0, values={**values, "at_first": True})
    assert "the specimen lifts off" in remark_of(rejected)
    assert remark_of(later) == f"at first, {remark_of(rejected)}"
