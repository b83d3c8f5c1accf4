"""[report] of campaign.toml: the particulars of a test report, and its logo."""

import base64
import re
from pathlib import Path

import pytest

from fourpole.campaign.limits import read_limits
from fourpole.campaign.report import logo_of
from fourpole.campaign.schema import parse_campaign
from fourpole.errors import CampaignError
from fourpole.report.front import rated_load

BASE = '[channels]\nforce_in = { column = "F", unit = "N" }\n'
PNG = b"\x89PNG\r\n\x1a\n" + bytes(20)


def stated(text):
    return parse_campaign(f"{BASE}\n[report]\n{text}").summary().get("report", {})


def test_what_is_not_stated_stays_blank():
    assert parse_campaign(BASE).summary().get("report") is None
    assert stated("") == {}


def test_days_may_be_dates_or_spans_of_text():
    found = stated('received = 2026-11-01\ntested = "2026-11-02 to 2026-11-05"\nfrequency = "900 rpm"')
    assert found == {"received": "2026-11-01", "tested": "2026-11-02 to 2026-11-05", "frequency [Hz]": 15.0}


def test_equipment_is_a_list():
    found = stated('[[report.equipment]]\nname = "cell"\ndue = 2027-01-01\n[[report.equipment]]\nname = "meter"')
    assert found["equipment"] == [{"name": "cell", "due": "2027-01-01"}, {"name": "meter"}]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('custmer = "x"', "[report] custmer: unknown key; did you mean 'customer'?"),
        ("customer = 5", "[report] customer: must be a text in quotation marks, not 5"),
        (f'customer = "{"x" * 601}"', "has 601 characters, at most 600"),
        ('frequency = "0 Hz"', "must be positive"),
        ('frequency = "15 N"', "frequency"),
        ('equipment = "cell"', "[report] equipment: should be a list, in square brackets"),
        ('equipment = ["cell"]', "[report] equipment.0: should be a table, as in { key = value }"),
        ('[[report.equipment]]\nnme = "cell"', "unknown key; did you mean 'name'?"),
    ],
)
def test_a_slip_is_named(text, said):
    with pytest.raises(CampaignError) as raised:
        stated(text)
    assert said in str(raised.value)


@pytest.mark.parametrize(
    ("name", "content", "kind"),
    [("a.png", PNG, "png"), ("b.jpg", b"\xff\xd8\xff\xe0", "jpeg"), ("c.svg", b"<?xml?>\n<svg/>", "svg+xml")],
)
def test_a_logo_becomes_part_of_the_statement(tmp_path, name, content, kind):
    (tmp_path / name).write_bytes(content)
    address = logo_of(tmp_path, name)
    assert address.startswith(f"data:image/{kind};base64,")
    assert base64.b64decode(address.partition(",")[2]) == content


@pytest.mark.parametrize(
    ("name", "content"), [("a.png", b"MZ"), ("big.png", PNG + bytes(400_000)), ("../out.png", None), ("none.png", None)]
)
def test_another_file_is_no_logo(tmp_path, name, content):
    folder = tmp_path / "campaign"
    folder.mkdir()
    (tmp_path / "out.png").write_bytes(PNG)
    if content is not None:
        (folder / name).write_bytes(content)
    with pytest.raises(CampaignError, match=r"\[report\] logo"):
        logo_of(folder, name)


def test_the_examples_of_the_docs_are_read():
    page = (Path(__file__).resolve().parents[2] / "docs" / "report.md").read_text(encoding="utf-8")
    report, limits = re.findall(r"```toml\n(.*?)```", page, re.S)
    found = parse_campaign(f"{BASE}\n{report}").summary()
    assert found["report"]["equipment"][0]["name"] == "Force cell"
    assert found["report"]["frequency [Hz]"] == 15.0
    assert rated_load(found["specimens"]["A"]) == pytest.approx(615 * 9.80665)
    assert [one.quantity for one in read_limits(limits, ("A",)).limits] == ["k1", "loss_angle"]
