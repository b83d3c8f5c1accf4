"""Slips as people make them: the first thing that the command says leads to the remedy."""

import re
import shutil

import pytest

from fourpole.app.group import REMOVED

ARM = ("--k2", "120 kN/m", "--c", "700 N s/m", "--mass", "15 kg", "--preload-stiffness", "12 kN/m")


@pytest.fixture(scope="module")
def analysed(run, small_campaign, tmp_path_factory):
    """The small campaign with its results and a model."""
    folder = shutil.copytree(small_campaign, tmp_path_factory.mktemp("slips") / "campaign")
    assert run("analyse", folder, "--tables-only").exit_code == 0
    assert run("fit", folder, "--model", "zener").exit_code == 0
    return folder


@pytest.fixture
def folder(analysed, tmp_path):
    """A copy to make slips in."""
    return shutil.copytree(analysed, tmp_path / "tyres")


def changed(name, *pairs):
    """A function that replaces texts in a file of the campaign."""

    def change(folder):
        path = folder / name
        text = path.read_text(encoding="utf-8")
        for old, new in pairs:
            assert old in text
            text = text.replace(old, new)
        path.write_text(text, encoding="utf-8")

    return change


def without(*names):
    """A function that removes files and folders of the campaign."""

    def remove(folder):
        for name in names:
            path = folder / name
            shutil.rmtree(path) if path.is_dir() else path.unlink()

    return remove


def renamed(folder):
    (folder / "recordings" / "D1.csv").rename(folder / "recordings" / "D1_.csv")


def another_rig(folder):
    changed("campaign.toml", ("[rig]", "[rigs.east]"))(folder)
    lines = (folder / "tests.csv").read_text(encoding="utf-8").splitlines()
    rows = [f"{lines[0]},rig", *(f"{line},esat" for line in lines[1:])]
    (folder / "tests.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")


#: What is done to the campaign, the command in its folder, and what the first message says.
SLIPS = {
    "a bare folder": (without("campaign.toml", "tests.csv", "results"), "analyse .", "fourpole init "),
    "an empty folder": (
        without("campaign.toml", "tests.csv", "results", "recordings"), "init .", "holds no recording that can be read",
    ),
    "no campaign.toml": (without("campaign.toml"), "check .", "it has no campaign.toml; fourpole init "),
    "no tests.csv": (without("tests.csv"), "analyse .", "has campaign.toml, but no tests.csv, which lists the tests"),
    "the results folder": (None, "analyse results", "holds results, not a campaign: name the campaign's folder"),
    "a folder of no results": (without("results"), "rig .", "run fourpole analyse "),
    "a file for a folder": (None, "analyse campaign.toml", "is a file: name its folder"),
    "a file for the results": (None, "rig results/dynamic.csv", "is a file: name its folder"),
    "a folder for a file": (None, "info .", "is a folder; name a file in it"),
    "old results": (
        changed("results/dynamic.csv", ("TR measured [1]", "TR [1]")), "rig .", "run fourpole analyse again",
    ),
    "a wrong column": (
        changed("campaign.toml", ('column = "V1"', 'column = "Vc"')), "analyse . --tables-only",
        "there is no column 'Vc'",
    ),
    "a wrong unit": (
        changed("campaign.toml", ('"V1", unit = "m/s"', '"V1", unit = "N"')), "analyse .",
        "motion_in: 'N' is a force; a displacement, a velocity or an acceleration is needed",
    ),
    "a unit that is none": (
        changed("campaign.toml", ('"F1", unit = "kN"', '"F1", unit = "kNn"')), "check .", "did you mean 'kN'?",
    ),
    "2 for 2 %": (
        changed("campaign.toml", ('std_gain = "0.02 %"', "std_gain = 2")), "check .",
        'A number alone is a ratio: if 2 % is meant, write "2 %".',
    ),
    "a typo in a key": (
        changed("campaign.toml", ("std_phase", "std_fase")), "analyse .", "unknown key; did you mean 'std_phase'?",
    ),
    "backslashes": (
        changed("tests.csv", ("recordings/", "recordings\\")), "analyse . --tables-only",
        "there is no such file; write 'recordings/",
    ),
    "a path of another machine": (
        changed("tests.csv", ("recordings/D1", "C:\\data\\D1")), "analyse . --tables-only",
        "name it from the campaign's folder, with / in place of \\",
    ),
    "backslashes in campaign.toml": (
        changed("campaign.toml", ('title = "', 'title = "C:\\data\\new ')), "check .",
        "not valid TOML: Unescaped '\\' in a string (at line 1, column 14); in a path write / in place of \\",
    ),
    "another name of a recording": (renamed, "analyse . --tables-only", "did you mean 'recordings/D1_.csv'?"),
    "a typo in a command": (None, "anaylse .", "Did you mean 'analyse'?"),
    "a typo in an option": (None, "analyse . --tabels-only", "--tables-only"),
    "a unit missing": (
        None, "query . --frequency 17_Hz --pressure 1.7", "--pressure: '1.7' has no unit; write it as in '1.7 bar'",
    ),
    "a frequency without a unit": (None, "query . --frequency 17", "write it as in '10:24:0.5 Hz'"),
    "a comma that may mean thousands": (
        None, "query . --frequency 17_Hz --preload 1,000_N", "may mean thousands or a decimal; write a decimal point",
    ),
    "a decimal comma between commas": (
        changed("tests.csv", ("1.7,", "1,7,")), "analyse . --tables-only", "decimal commas need ; between the cells",
    ),
    "kPa in a column of bar": (
        changed("tests.csv", (",1.7,", ",170,")), "check .", "if kPa is meant, write 'pressure [kPa]'",
    ),
    "kN in a column of N": (
        changed("tests.csv", (",1000,", ",1,")), "check .", "if kN is meant, write 'preload [kN]'",
    ),
    "a specimen that is not there": (
        changed("tests.csv", ("dynamic,radial-ply", "dynamic,radail-ply")), "analyse . --tables-only",
        "tyre 'radail-ply' is not in campaign.toml; did you mean 'radial-ply'?",
    ),
    "a specimen that the model has not": (
        None, "query . --frequency 17_Hz --tyre radial", "the file is of 'radial-ply', not of 'radial'",
    ),
    "a wrong name of a rig": (
        another_rig, "analyse . --tables-only", "rig 'esat' is not in campaign.toml; did you mean 'east'?",
    ),
    "a frequency outside": (
        None, "query . --frequency 100_Hz", "outside the measured band, 9.989 to 24.02 Hz: state a frequency inside it",
    ),
    "a pressure that was not tested": (
        None, "query . --frequency 17_Hz --pressure 3_bar", "the file has fits at 1.7 bar, 1000 N. State one of these",
    ),
    "a model that is none": (None, "fit . --model zenner", "no model 'zenner': choose one of"),
    "a query before a fit": (without("results/model.json"), "query . --frequency 17_Hz", "run fourpole fit "),
    "a stiffness without a unit": (
        None, "predict --k1 180 --frequency 10_Hz", "--k1: '180' has no unit; write it as in '12.44 kN/m'",
    ),
}  # fmt: skip


@pytest.mark.parametrize("slip", SLIPS)
@pytest.mark.sampled(6)
def test_the_first_message_leads_to_the_remedy(run, folder, monkeypatch, slip):
    change, command, remedy = SLIPS[slip]
    if change is not None:
        change(folder)
    monkeypatch.chdir(folder)
    words = [word.replace("_", " ") for word in command.split()]
    more = ARM if words[0] == "predict" else ()
    ran = run(*words, *more)
    said = [line for line in ran.stderr.splitlines() if not re.match(r"Usage:|Try |$|understood", line)]
    assert said, ran.stdout
    assert remedy in said[0]
    assert "Traceback" not in ran.output


@pytest.mark.parametrize("removed", REMOVED)
def test_an_option_that_was_removed_names_what_stands_in_its_place(run, removed, tmp_path):
    command, option = removed.split()
    for more in ([option, "x"], [f"{option}=x"]):
        ran = run(command, tmp_path, *more)
        assert (ran.exit_code, ran.stdout) == (2, "")
        assert ran.stderr == f"error: {option} was removed: state {REMOVED[removed]}\n"
