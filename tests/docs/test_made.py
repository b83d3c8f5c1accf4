"""Figures and tables of the documentation are those that the scripts of docs/build make now."""

import re
import sys
from pathlib import Path

import pytest

pytestmark = pytest.mark.thorough

DOCS = Path(__file__).resolve().parents[2] / "docs"
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e-?\d+)?")
#: Distances in a figure that no eye sees [pt], and the round-off of a number that is shown with its last digit.
UNSEEN = 0.05


@pytest.fixture(scope="module")
def figures():
    sys.path.insert(0, str(DOCS / "build"))
    try:
        import figures
    finally:
        sys.path.pop(0)
    return figures


NAMES = (
    "mobility", "masses", "curvature", "ramp", "relaxation", "prony", "leakage", "faults-in-c", "faults-in-k2",
    "twoport",
)  # fmt: skip


def test_each_figure_is_listed_once(figures):
    assert sorted(NAMES) == sorted(figures.FIGURES)
    assert {path.stem for path in figures.MADE.glob("*.svg")} >= set(NAMES)


def differs(kept, made, tolerance):
    """Where two texts differ in a word, or in a number by more than a tolerance; empty if they do not."""
    if NUMBER.sub("#", kept) != NUMBER.sub("#", made):
        return "other words"
    pairs = zip(NUMBER.findall(kept), NUMBER.findall(made), strict=True)
    return [(one, other) for one, other in pairs if abs(float(one) - float(other)) > tolerance(one)]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.sampled(4)
def test_a_figure_is_what_its_script_makes(figures, name):
    kept = (figures.MADE / f"{name}.svg").read_text(encoding="utf-8")
    assert not differs(kept, figures.svg(name).decode(), lambda _: UNSEEN), f"run: make figures ({name})"


@pytest.mark.parametrize(
    "name", ["c-by-fault", "k2-by-fault", "where-it-turns", "of-random-tyres", "over-pressure", "claims", "components"]
)  # fmt: skip
@pytest.mark.sampled(2)
def test_a_table_is_what_its_script_makes(figures, name):
    page, text = figures.written(name)

    def last_digit(number):
        return 1.01 * 10.0 ** -len(number.partition(".")[2])

    assert not differs(page.read_text(encoding="utf-8"), text, last_digit), f"run: make figures ({name})"


def test_a_changed_figure_and_a_changed_table_are_seen(figures):
    kept = (figures.MADE / "ramp.svg").read_text(encoding="utf-8")
    at = list(re.finditer(r"L (\d+\.\d+) ", kept))[10]
    moved = f"{kept[: at.start(1)]}{float(at[1]) + 0.2:.2f}{kept[at.end(1) :]}"
    assert differs(kept, moved, lambda _: UNSEEN)
    page, text = figures.written("claims")
    assert differs(page.read_text(encoding="utf-8"), text.replace("rises with frequency", "falls"), lambda _: 1e9)
