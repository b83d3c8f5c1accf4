"""Tables in a terminal: no number, unit or word is cut, whatever the width."""

import re

import pytest
from rich.console import Console

from fourpole.app import console

HEADS = ("value of", "unit", "as stated", "as found", "u after/before", "detection limit", "finding")
LONG = "found from your data; whatever gives way with the spring, such as the frame, is in it"
ROWS = [
    ("moving mass m", "kg", "15.000 ± 0.010", "15.0063 ± 0.0093", "0.931", "0.082 kg", "not determined by your data"),
    ("preload spring K3", "kN/m", "12.440 ± 0.020", "12.4082 ± 0.0095", "0.47", "0.068 kN/m", LONG),
]


@pytest.fixture
def printed(monkeypatch, capsys):
    def of(width, heads, rows, right):
        monkeypatch.setattr(console, "_tables", lambda: Console(width=width, highlight=False, markup=False))
        console.print_table(heads, rows, right=right)
        return capsys.readouterr().out

    return of


@pytest.mark.parametrize("width", [60, 80, 100, 120, 200])
def test_no_number_and_no_word_is_cut(printed, width):
    text = printed(width, HEADS, ROWS, HEADS[2:-1])
    assert max(map(len, text.splitlines())) <= width
    for cell in (cell for row in ROWS for cell in row[:-1] if re.search(r"\d", cell)):
        assert cell in text
    for word in (word for row in ROWS for cell in row for word in cell.split()):
        assert re.search(rf"(?<!\w){re.escape(word)}(?!\w)", text), word


@pytest.mark.parametrize("width", [50, 80])
def test_short_cells_stand_beside_each_other_with_the_columns_as_lines(printed, width):
    heads = ("model", "causal", *(f"figure {n} [1]" for n in range(8)))
    rows = [(f"model:{n}", "yes", *(f"{n}.{k}e+03" for k in range(8))) for n in range(6)]
    text = printed(width, heads, rows, heads[2:])
    assert max(map(len, text.splitlines())) <= width
    assert text.startswith("model")
    for row in rows:
        assert all(cell in text for cell in row)
    assert any(line.startswith("figure 3 [1]") for line in text.splitlines())


def test_a_row_with_the_name_of_a_group_is_a_line_of_its_own(printed):
    text = printed(60, HEADS, [("Rig",), *ROWS], HEADS[2:-1])
    assert text.splitlines()[0].rstrip() == "Rig"


def test_a_long_line_is_folded_between_words_and_keeps_its_indent():
    line = "  - " + " ".join(f"word{n} 12.5 kN/m" for n in range(12))
    folded = console._folded(line, 50).split("\n")
    assert max(map(len, folded)) <= 50
    assert all(part.startswith("    ") for part in folded[1:])
    assert " ".join(" ".join(folded).split()) == " ".join(line.split())
    assert console._folded("x" * 90, 50) == "x" * 90
