"""The help: commands in groups, and of each an example that its command takes."""

import shlex

import pytest
import typer

from fourpole.app.cli import app
from fourpole.app.group import EXAMPLES, GROUPS, groups_of
from fourpole.plot.catalogue import FIGURES

GROUP = typer.main.get_command(app)
NAMES = GROUP.list_commands(None)


def test_each_command_is_in_one_group():
    assert sorted(name for members in GROUPS.values() for name in members) == sorted(NAMES)
    assert groups_of([*NAMES, "new"])["Further commands"] == ["new"]


@pytest.mark.parametrize("name", NAMES)
def test_the_example_of_a_command_is_one_that_it_takes(name):
    program, command, *arguments = shlex.split(EXAMPLES[name])
    assert (program, command) == ("fourpole", name)
    context = GROUP.get_command(None, name).make_context(name, arguments)
    assert context.params


def test_names_in_examples_are_there():
    assert shlex.split(EXAMPLES["plot"])[3] in FIGURES


def test_the_help_of_a_command_ends_with_its_example(run):
    assert run("query", "--help").stdout.rstrip().endswith(EXAMPLES["query"])


def test_the_help_lists_the_groups_in_order(run):
    said = run("--help").stdout
    places = [said.index(f"\n{head}:\n") for head in GROUPS]
    assert places == sorted(places)
    assert list(GROUPS["Start here"]) == ["demo", "init", "check", "analyse", "open", "app"]
    assert all(head.startswith("More ") for head in [*GROUPS][1:])


@pytest.mark.parametrize(("typo", "meant"), [("anaylse", "analyse"), ("repport", "report"), ("chek", "check")])
def test_a_typo_in_a_command_leads_to_the_nearest_one(run, typo, meant):
    ran = run(typo, "folder")
    assert ran.exit_code == 2
    assert f"Did you mean '{meant}'" in ran.stderr
