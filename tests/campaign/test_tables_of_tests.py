"""tests.csv by German heads, and tests.xlsx in its place."""

import shutil

import openpyxl
import polars as pl
import pytest

from fourpole.campaign import read_campaign
from fourpole.campaign.schema import parse_campaign
from fourpole.errors import CampaignError
from fourpole.study.check import check_campaign
from fourpole.virtual import simulate_campaign

HEADS = {"test": "Prüfung", "file": "Datei", "kind": "Art", "tyre": "Probe", "pressure": "Druck", "preload": "Vorlast",
         "frequency": "Frequenz", "added_mass": "Zusatzmasse", "temperature": "Temperatur"}  # fmt: skip
KINDS = {"static": "statisch", "dynamic": "Sinus"}


@pytest.fixture(scope="module")
def one_pressure(tmp_path_factory):
    """A campaign of two tyres at one pressure."""
    folder = tmp_path_factory.mktemp("tables") / "campaign"
    return simulate_campaign(folder, pressures=[170e3], preloads=[1000.0], frequencies=[14.0], clean=True).folder


@pytest.fixture
def campaign(one_pressure, tmp_path):
    """A copy of a campaign."""
    return shutil.copytree(one_pressure, tmp_path / "c")


def table_of(folder):
    return pl.read_csv(folder / "tests.csv", infer_schema=False)


def in_german(table):
    names = {head: head.replace(head.split(" ")[0], HEADS[head.split(" ")[0]]) for head in table.columns}
    return table.rename(names).with_columns(pl.col("Art").replace(KINDS))


def workbook(folder, table):
    book = openpyxl.Workbook()
    sheet = book.active
    sheet.append(table.columns)
    for row in table.iter_rows():
        sheet.append([float(cell) if cell and cell.replace(".", "").isdigit() else cell for cell in row])
    book.save(folder / "tests.xlsx")


def told(campaign):
    return [(test.name, test.file, test.kind, test.tyre, test.values, test.problem) for test in campaign.tests]


def test_german_heads_and_kinds_are_read_as_the_english_ones(campaign):
    english = read_campaign(campaign)
    german = in_german(table_of(campaign))
    text = german.write_csv().replace(",", ";").replace("1.7", "1,7")
    (campaign / "tests.csv").write_text(text, encoding="cp1252")
    assert told(read_campaign(campaign)) == told(english)
    (campaign / "tests.csv").write_text(text.replace("Prüfung", "PRUEFUNG"))
    assert told(read_campaign(campaign)) == told(english)


def test_a_german_head_beside_the_english_one_is_a_column_of_ones_own(campaign):
    table = table_of(campaign).with_columns(pl.lit("A7").alias("Probe"), pl.lit("x").alias("Prüfer"))
    (campaign / "tests.csv").write_text(table.write_csv())
    found = read_campaign(campaign)
    assert found.extra_columns == ("Probe", "Prüfer")
    assert {test.tyre for test in found.tests} == {"radial-ply", "cross-ply"}


def test_two_heads_of_one_column_and_a_head_without_its_unit_are_told(campaign):
    table = in_german(table_of(campaign))
    (campaign / "tests.csv").write_text(table.with_columns(pl.lit("1.7").alias("Reifendruck [bar]")).write_csv())
    with pytest.raises(CampaignError, match=r"'pressure' stands twice, as .*: keep one of them"):
        read_campaign(campaign)
    (campaign / "tests.csv").write_text(table.write_csv().replace("Druck [bar]", "Druck"))
    with pytest.raises(CampaignError, match=r"column 'Druck' has no unit: write 'Druck \[bar\]'"):
        read_campaign(campaign)


@pytest.mark.parametrize("change", [lambda table: table, in_german])
def test_a_workbook_is_read_as_tests_csv_is(campaign, change):
    expected, table = told(read_campaign(campaign)), table_of(campaign)
    (campaign / "tests.csv").unlink()
    workbook(campaign, change(table))
    found = read_campaign(campaign)
    assert told(found) == expected
    assert list(found.sha256) == ["campaign.toml", "tests.xlsx"]


def test_messages_name_the_workbook_and_the_row(campaign):
    table = table_of(campaign)
    (campaign / "tests.csv").unlink()
    workbook(campaign, table.with_columns(pl.lit("radail").alias("tyre")))
    assert read_campaign(campaign).tests[0].problem.startswith("tests.xlsx row 2: tyre 'radail' is not in campaign")
    workbook(campaign, table.rename({"kind": "knd"}))
    with pytest.raises(CampaignError, match=r"tests.xlsx row 1: column 'kind' is missing; did you mean 'knd'"):
        read_campaign(campaign)


def test_both_tables_are_one_error_that_says_which_to_remove(campaign):
    workbook(campaign, table_of(campaign))
    with pytest.raises(CampaignError, match=r"both list tests: remove one; tests.csv was saved first, so remove that"):
        read_campaign(campaign)


def test_the_extra_is_named_where_it_is_not_installed(campaign, monkeypatch):
    workbook(campaign, table_of(campaign))
    (campaign / "tests.csv").unlink()
    monkeypatch.setattr("fourpole.io.child.is_guarded", lambda *_: False)
    monkeypatch.setitem(__import__("sys").modules, "fastexcel", None)
    with pytest.raises(CampaignError, match=r"tests.xlsx: .*fastexcel.*pip install 'fourpole\[formats\]'"):
        read_campaign(campaign)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("moving_mass = 12,4 kg", '12,4 kg has a decimal comma: write "12.4 kg"'),
        ("moving_mass = { value = 12,4, unit = 'kg' }", "12,4 has a decimal comma: write 12.4"),
        ("preload_stiffness = 0,5", "0,5 has a decimal comma: write 0.5"),
        ("moving_mass = 12.4 kg", '12.4 kg has a unit, so it is a text in quotation marks: write "12.4 kg"'),
    ],
)
def test_a_decimal_comma_in_campaign_toml_is_named_with_its_line(line, said):
    with pytest.raises(CampaignError) as told:
        parse_campaign(f"# 1\n[rig]\n{line}\n")
    assert str(told.value) == f"campaign.toml line 3: {said}"


def test_a_decimal_comma_in_quotation_marks_is_a_decimal_sign():
    rig = parse_campaign('[rig]\nmoving_mass = "12,4 kg"\npreload_stiffness = "1,2 kN/m"\n[channels]\n').rig
    assert rig.values["moving_mass"].value == 12.4


def test_a_decimal_comma_before_three_digits_is_one_where_another_cell_shows_it(campaign):
    table = table_of(campaign).with_columns(pl.lit("14.025").alias("frequency [Hz]"))
    text = table.write_csv().replace(",", ";").replace("14.025", "14,025")
    (campaign / "tests.csv").write_text(text)
    assert "may mean thousands or a decimal" in read_campaign(campaign).tests[-1].problem
    (campaign / "tests.csv").write_text(text.replace("1.7", "1,7"))
    assert read_campaign(campaign).tests[-1].values["frequency"] == 14.025


def test_a_file_whose_umlaut_is_two_characters_on_the_disk_is_told(campaign):
    (campaign / "recordings" / "D1.csv").rename(campaign / "recordings" / "Räder.csv".replace("ä", "a\u0308"))
    text = (campaign / "tests.csv").read_text().replace("recordings/D1.csv", "recordings/Räder.csv")
    (campaign / "tests.csv").write_text(text, encoding="utf-8")
    (problem,) = (one for one in check_campaign(read_campaign(campaign)).problems if one.test == "D1")
    assert problem.message.endswith("whose accents are characters of their own, as of macOS: rename it")


@pytest.mark.parametrize(
    ("line", "said"), [("[tyres.Prüfling-1]", '[tyres."Prüfling-1"]'), ('[tyres.Rad]\nGröße = "195"', '"Größe"')]
)
def test_a_name_with_an_umlaut_in_campaign_toml_needs_quotation_marks(line, said):
    with pytest.raises(CampaignError, match=r"a name with an umlaut or accent stands in quotation marks: ") as told:
        parse_campaign(f"title = 'x'\n{line}\n")
    assert str(told.value).endswith(said)
