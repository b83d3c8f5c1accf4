"""A form changes what it shows, and nothing else."""

from __future__ import annotations

from pathlib import Path

import pytest

from fourpole.campaign import read_campaign
from fourpole.errors import CampaignError, FourpoleError
from fourpole.served.editing import ConflictError, doubts_left, exclude, problems_of, read_statement, save
from fourpole.served.workspace import version_of

TOML = """# kept: why this rig
title = "A"   # kept beside

[rig]
moving_mass       = { value = 15.0, unit = "kg", std = 0.15 }  # weighed
preload_stiffness = "12.44 kN/m"

[channels]
sample_rate = "1000 Hz"
# doubt: force_in, column F1: in kN?
force_in   = { column = "F1", unit = "N", high_pass = { corner = "0.5 Hz", order = 1 } }
motion_in  = { column = "V1", unit = "mm/s", invert = true }

[tyres.a]
"""
TESTS = 'test;file;kind;tyre;pressure [bar];frequency [Hz];note\nD1;d1.csv;dynamic;a;1,7;10;"with ; inside"\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "campaign.toml").write_text(TOML)
    (tmp_path / "tests.csv").write_text(TESTS)
    return tmp_path


def form(folder: Path, **changed: object) -> dict:
    """What the page sends where nothing is changed, but for `changed`."""
    now = read_statement(folder)
    clock = {key: now.clock[key] for key in ("column", "unit", "sample_rate")}
    return {
        "title": now.title,
        "channels": now.channels,
        "clock": clock,
        "rig": now.rig,
        "blocked": now.blocked,
        "heads": now.heads,
        "rows": now.rows,
        "settled": [],
        **changed,
    }


def test_a_form_that_changes_nothing_leaves_every_letter(folder: Path) -> None:
    save(folder, read_statement(folder).version, form(folder))
    assert (folder / "campaign.toml").read_text() == TOML
    assert (folder / "tests.csv").read_text() == TESTS


def test_a_changed_entry_keeps_comments_and_what_is_not_shown(folder: Path) -> None:
    now = read_statement(folder)
    channels = {**now.channels, "force_in": {**now.channels["force_in"], "unit": "kN", "std_gain": "1 %"}}
    save(folder, now.version, form(folder, channels=channels))
    text = (folder / "campaign.toml").read_text()
    for kept in ("# kept: why this rig", "# kept beside", "# weighed", 'high_pass = { corner = "0.5 Hz", order = 1 }'):
        assert kept in text
    stated = read_campaign(folder).stated.channels
    assert (stated.force_in.unit, stated.force_in.std_gain) == ("kN", pytest.approx(0.01))


def test_a_value_of_the_rig_gets_an_uncertainty_and_loses_it(folder: Path) -> None:
    now = read_statement(folder)
    save(folder, now.version, form(folder, rig={**now.rig, "preload_stiffness": ("12.5", "kN/m", "0.1")}))
    values = read_campaign(folder).stated.all_rigs[""].values
    assert (values["preload_stiffness"].value, values["preload_stiffness"].std) == (12500.0, 100.0)
    now = read_statement(folder)
    save(folder, now.version, form(folder, rig={**now.rig, "preload_stiffness": ("12.5", "kN/m", "")}))
    assert 'preload_stiffness = "12.5 kN/m"' in (folder / "campaign.toml").read_text()


def test_a_held_far_side_is_stated_and_taken_back(folder: Path) -> None:
    now = read_statement(folder)
    save(folder, now.version, form(folder, blocked=True))
    assert read_campaign(folder).stated.all_rigs[""].output == "blocked"
    save(folder, read_statement(folder).version, form(folder, blocked=False))
    assert read_campaign(folder).stated.all_rigs[""].output is None


def test_a_settled_doubt_goes(folder: Path) -> None:
    now = read_statement(folder)
    assert now.doubts == (("force_in, column F1: in kN?", "channels.force_in"),)
    save(folder, now.version, form(folder, settled=[doubt for doubt, _ in now.doubts]))
    assert read_statement(folder).doubts == ()


def test_who_saves_an_old_page_is_told(folder: Path) -> None:
    former = read_statement(folder).version
    (folder / "tests.csv").write_text(TESTS + "D2;d2.csv;dynamic;a;1,7;12;\n")
    with pytest.raises(ConflictError, match="load it again"):
        save(folder, former, form(folder))
    assert "D2" in (folder / "tests.csv").read_text()


@pytest.mark.parametrize("wrong", [{"channels": 3}, {"rows": 5}, {"rig": {"moving_mass": "x"}}, {"clock": []}])
def test_a_form_that_is_not_whole_changes_nothing(folder: Path, wrong: dict) -> None:
    with pytest.raises(CampaignError, match="not whole"):
        save(folder, read_statement(folder).version, form(folder, **wrong))
    assert (folder / "campaign.toml").read_text() == TOML


def test_text_that_is_no_toml_is_refused_with_its_line(folder: Path) -> None:
    with pytest.raises(CampaignError, match=r"no TOML.*line 1"):
        save(folder, read_statement(folder).version, {"text": "[rig"})


@pytest.mark.parametrize("large", [{"rows": [["a" * 140_000, *[""] * 6]]}, {"text": f"# {'x' * 1_000_000}"}])
def test_what_could_not_be_read_again_is_not_written(folder: Path, large: dict) -> None:
    with pytest.raises(FourpoleError, match=r"131072 characters|at most 1 MB are read"):
        save(folder, read_statement(folder).version, {**form(folder), **large})
    assert ((folder / "campaign.toml").read_text(), (folder / "tests.csv").read_text()) == (TOML, TESTS)


def test_faults_are_told_at_their_places(folder: Path) -> None:
    now = read_statement(folder)
    rows = [["D1", "d1.csv", "dynamik", "a", "much", "10", ""]]
    save(folder, now.version, form(folder, rows=rows))
    found = {(one.row, one.column) for one in problems_of(folder)}
    assert found == {(2, "pressure"), (2, "kind")}
    now = read_statement(folder)
    save(folder, now.version, form(folder, channels={**now.channels, "motion_in": {"column": "V1", "unit": "N"}}))
    assert problems_of(folder)[0].path == "channels.motion_in.unit"


def test_all_faults_are_told_at_once_without_saving(folder: Path) -> None:
    """Those of campaign.toml, and of rows, which may name what only it states."""
    now = read_statement(folder)
    channels = {
        **now.channels,
        "force_in": {"column": "F1", "unit": "furlong", "delay": "5"},
        "motion_in": {"column": "V1", "unit": "N"},
    }
    rig = {"moving_mass": ("much", "kg", ""), "preload_stiffness": ("12", "kN/m", "more")}
    rows = [["D1", "d1.csv", "dynamik", "b", "1,7", "10", ""], ["D1", "", "dynamic", "a", "x", "10", ""]]
    found = problems_of(folder, form(folder, channels=channels, rig=rig, rows=rows))
    assert {one.path for one in found if one.row is None} == {
        "rig.moving_mass", "rig.preload_stiffness.std", "channels.force_in.delay", "channels.motion_in.unit",
    }  # fmt: skip
    assert {(one.row, one.column) for one in found if one.row is not None} == {
        (2, "kind"), (2, "tyre"), (3, "file"), (3, "pressure"), (3, "test"),
    }  # fmt: skip
    assert (folder / "campaign.toml").read_text() == TOML


def test_a_doubt_of_a_row_goes_with_the_cell_that_it_is_about(folder: Path) -> None:
    heads, doubt = ["test", "pressure [bar]", "doubts"], "pressure [1.7]: '1p7' taken as bar | preload []: not known"
    rows = [["D1", "1.7", doubt], ["D2", "1.8", doubt]]
    assert doubts_left(heads, rows) == [doubt, "preload []: not known"]
    save(folder, read_statement(folder).version, form(folder, heads=heads, rows=rows))
    assert [row[2] for row in read_statement(folder).rows] == [doubt, "preload []: not known"]
    assert doubts_left(["test"], [["D1"]]) == []


def test_a_doubt_stands_above_what_it_is_about(folder: Path) -> None:
    text = "# doubt: a\ntitle = 'x'\n# doubt: b\n# [rig]\n# doubt: c\n# output = 'blocked'\n[channels]\n# doubt: d\n"
    more = "# doubt: e\n# sample_rate = '1 kHz'\n# doubt: f\nmotion_in = { column = 'V1' }\n"
    more += "# doubt: g\n[tyres.a]\n# doubt: h\n"
    (folder / "campaign.toml").write_text(text + more)
    places = ["", "rig", "rig", "channels.time", "channels.time", "channels.motion_in", "tyres", ""]
    assert read_statement(folder).doubts == tuple(zip("abcdefgh", places, strict=True))


def test_a_test_is_excluded_and_taken_in_again(folder: Path) -> None:
    exclude(folder, "D1", "slipped;  on the\nrim")
    (test,) = read_campaign(folder).tests
    assert test.excluded
    assert test.problem.endswith("excluded: slipped; on the rim")
    exclude(folder, "D1", "")
    assert not read_campaign(folder).tests[0].excluded
    with pytest.raises(CampaignError, match="no such test"):
        exclude(folder, "D9", "x")


def test_a_table_in_several_parts_is_filled_in(folder: Path) -> None:
    first = "[channels.force_in]\ncolumn = 'F1'\nunit = 'N'\n\n[rig]\noutput = 'blocked'\n"
    other = "[channels.motion_in]\ncolumn = 'V1'\nunit = 'mm'\n[channels.time]\ncolumn = 't'\n[tyres.a]\n"
    (folder / "campaign.toml").write_text(f"{first}\n{other}")
    stated = form(folder)
    stated["channels"]["force_in"]["unit"] = "kN"
    save(folder, read_statement(folder).version, stated)
    assert read_campaign(folder).stated.channels.force_in.unit == "kN"


@pytest.mark.parametrize("text", ["channels = 3\n", "rig = 4\n", "[channels]\nforce_in = 'F1'\n"])
def test_a_value_in_place_of_a_table_is_told(folder: Path, text: str) -> None:
    stated = form(folder)
    stated["rig"]["moving_mass"] = ["15", "kg", ""]
    (folder / "campaign.toml").write_text(text)
    with pytest.raises(CampaignError, match="must be a table"):
        save(folder, read_statement(folder).version, stated)
    assert (folder / "campaign.toml").read_text() == text


def test_half_a_character_is_refused(folder: Path) -> None:
    with pytest.raises(CampaignError, match="not whole"):
        save(folder, read_statement(folder).version, {"text": "title = '\ud800'"})
    assert (folder / "campaign.toml").read_text() == TOML


def test_a_table_without_the_column_test_is_told(folder: Path) -> None:
    (folder / "tests.csv").write_text("name;file\nD1;d1.csv\n")
    with pytest.raises(CampaignError, match="no column test"):
        exclude(folder, "D1", "slipped")


def test_one_file_is_saved_beside_another_that_is_broken(folder: Path) -> None:
    now = form(folder)
    (folder / "campaign.toml").write_text("[rig\n")
    save(folder, read_statement(folder).version, {"heads": now["heads"], "rows": now["rows"]})
    (folder / "tests.csv").write_text("test;" + "n" * 140_000)
    save(folder, version_of(folder), {"text": TOML})
    assert (folder / "campaign.toml").read_text() == TOML
