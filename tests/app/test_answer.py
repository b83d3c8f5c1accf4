"""One answer: on the terminal, as a document, as events for the app; and a command that is a single function."""

import json
from pathlib import Path
from typing import Annotated

import polars as pl
import pytest
import typer
from typer.testing import CliRunner

from fourpole.answer import Answer, Rows, Table
from fourpole.app import group
from fourpole.app.browse import catalogue
from fourpole.app.cli import app
from fourpole.app.group import show
from fourpole.quantities import ShownUnits

FRAME = pl.DataFrame({"frequency [Hz]": [10.0], "K1 [N/m]": [180e3], "u(K1) [N/m]": [900.0], "note": [""]})


@pytest.fixture
def added():
    """A command of one function, with all that it needs."""

    @group.registered(browser=True)
    def greet(
        folder: Annotated[Path, typer.Argument(help="The campaign's folder.")],
        often: Annotated[int, typer.Option(help="How often.")] = 1,
        loud: Annotated[bool, typer.Option("--loud", help="In capitals.")] = False,
        file: Annotated[Path | None, typer.Option("--out", help="A file.")] = None,
    ) -> Answer:
        """Greet a campaign."""
        said = f"hello {folder.name}"
        return Answer([said.upper() if loud else said] * often, lambda: {"said": said}, code=3 if loud else 0)

    yield greet
    del group._RUNS["greet"]
    group.BROWSER.remove("greet")


def test_an_added_command_is_on_the_terminal_in_json_in_the_help_and_in_the_app(added):
    run = CliRunner().invoke
    assert run(app, ["greet", "rig", "--often", "2"]).stdout == "hello rig\nhello rig\n"
    loud = run(app, ["greet", "rig", "--loud"])
    assert (loud.stdout, loud.exit_code) == ("HELLO RIG\n", 3)
    assert json.loads(run(app, ["greet", "rig", "--json"]).stdout) == {"said": "hello rig"}
    assert "Greet a campaign." in run(app, ["--help"]).stdout
    (asked,) = (one for one in catalogue() if one.name == "greet")
    assert asked.about == "Greet a campaign."
    assert [(one.name, one.help, one.flag) for one in asked.options] == [
        ("--often", "How often.", False), ("--loud", "In capitals.", True),
    ]  # fmt: skip
    assert asked.words({"often": " 2 ", "loud": "1", "out": "x"}) == ["--often=2", "--loud"]


def test_the_app_gets_the_parts_as_events(added, monkeypatch):
    monkeypatch.setenv("FOURPOLE_EVENTS", "answer")
    said = CliRunner().invoke(app, ["greet", "rig", "--json"])
    (event,) = (json.loads(line[1:]) for line in said.stderr.split("\n") if line.startswith("\x1e"))
    assert event == {"answer": ["hello rig"], "files": []}


def test_an_answer_is_shown_in_its_order_with_its_files(capsys):
    answer = Answer(
        iter(["first", Table(("name", "size"), [["a", "1"]], ("size",)), Rows(FRAME, ShownUnits())]),
        lambda: {"size": float("nan")}, [("written", Path("a.csv"))],
        then=lambda: [Answer(["last"]), Answer(["later"], lambda: {"later": [1]})],
    )  # fmt: skip
    assert show(answer, as_json=False) == 0
    lines = [line.rstrip() for line in capsys.readouterr().out.splitlines()]
    assert lines[0] == "first"
    assert lines[-5:] == [*FRAME.write_csv().splitlines(), "written: a.csv", "last", "later"]
    show(answer, as_json=True)
    said = capsys.readouterr()
    assert said.out == '{\n  "size": null\n}\n{"later": [1]}\n'
    assert said.err == "written: a.csv\n"


def test_files_are_the_document_where_no_other_is_stated(capsys):
    show(Answer(files=[("figure", Path("a.svg"))]), as_json=True)
    assert json.loads(capsys.readouterr().out) == {"figure": "a.svg"}
    show(Answer(["nothing for programs"]), as_json=True)
    assert capsys.readouterr().out == ""


def test_parts_are_plain_for_a_page():
    table = Table(("name", "size"), [["a group"], ["a", "1"]], ("size",), remarks=["small"], remark="finding")
    plain = Answer([table, Rows(FRAME, ShownUnits())]).plain()
    assert plain[0] == {
        "heads": ["name", "size"], "rows": [["a group"], ["a", "1"]], "right": ["size"], "remarks": ["small"],
    }  # fmt: skip
    assert plain[1]["heads"] == ["frequency [Hz]", "K1 [kN/m]"]
    assert plain[1]["rows"] == [["10", "180.0 ± 1.8"]]
    assert plain[2].startswith("±")


@pytest.mark.parametrize(("width", "beside"), [("120", False), ("40", True)])
def test_remarks_stand_below_their_rows_or_beside_them(width, beside, capsys, monkeypatch):
    monkeypatch.setattr("fourpole.app.group.table_width", lambda: int(width))
    table = Table(("name", "as found"), [["rig"], ["mass", "15.0 ± 0.2" * 4]], remarks=["found"], remark="finding")
    show(Answer([table]), as_json=False)
    text = capsys.readouterr().out
    assert ("finding" in text) is beside
    assert ("\n    found\n" in text) is not beside
