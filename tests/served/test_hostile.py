"""A campaign that cannot be read is a row with its fault; all other campaigns work, and the server ends when asked."""

from __future__ import annotations

import html
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from tests.selection import share
from tests.served.hostile import FAULTS, LIST, ODD
from tests.served.server import Server, serving

pytestmark = [
    pytest.mark.thorough,
    pytest.mark.skipif(sys.platform != "linux", reason="pipes, sockets and names of Linux"),
]

PAGES = (
    "", "/explore", "/tests", "/tests/D1", "/statement", "/model", "/plan", "/plan/expected", "/run", "/watch",
    "/columns", "/tests/D1/signals", "/tests/D1/residual", "/files/report.html", "/figure.svg", "/ask",
)  # fmt: skip
#: A page is asked of every third campaign, those of every n-th: what takes long seldom, where faults are told always.
SHARE = {**dict.fromkeys(("", "/explore", "/plan/expected", "/figure.svg", "/ask"), 6), "/run": 1}
#: Largest memory of the server after all of them [kB]; without any it takes about 200 MB.
MOST_MEMORY = 600_000


@pytest.fixture(scope="module")
def server(analysed: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A server of a good campaign among all the others."""
    root = tmp_path_factory.mktemp("hostile")
    shutil.copytree(analysed, root / "good")
    for name, change in {**{name: change for name, (change, _) in FAULTS.items()}, **ODD}.items():
        shutil.copytree(analysed, root / name, ignore=shutil.ignore_patterns("cache"))
        change(root / name)
    (root / "linked").mkdir()
    (root / "linked" / "campaign.toml").symlink_to(root / "good" / "campaign.toml")
    with serving(root) as running:  # which must end by Ctrl-C
        yield running


def rows_of(server: Server) -> dict[str, str]:
    """The rows of the home page, by the names of the campaigns."""
    status, content, _ = server.ask("/")
    assert status == 200
    rows = re.findall(r'<tr><th scope="row">.*?</tr>', content.decode(), re.DOTALL)
    return {html.unescape(re.findall("<bdi>(.*?)</bdi>", row, re.DOTALL)[0]): row for row in rows}


@pytest.mark.sampled(2)
def test_each_is_a_row_with_its_fault(server: Server) -> None:
    rows = rows_of(server)
    assert len(rows) == len(FAULTS) + len(ODD) + 2
    assert {name: said for name, (_, said) in FAULTS.items() if said not in html.unescape(rows[name])} == {}
    assert "campaign.toml is a link, which is not followed" in rows["linked"]
    assert "href" not in rows["linked"]
    assert ">20 ok<" in rows["good"]
    assert "up to date" in rows["good"]
    assert not any("<b>7" in row or "<script>" in row for row in rows.values())
    assert max(map(len, rows.values())) < 2000


@pytest.mark.sampled(2)
def test_no_page_of_them_is_a_fault_of_the_program(server: Server) -> None:
    addresses = {name: re.findall('href="(/c/[^"]+)"', row) for name, row in rows_of(server).items()}
    assert [name for name, found in addresses.items() if not found] == ["linked"]
    answers = {
        f"{name}{part}": server.ask(found[0] + part)
        for number, (name, found) in enumerate(sorted(addresses.items()))
        for part in PAGES
        if found and name != "good" and share(number + PAGES.index(part), SHARE.get(part, 3))
    }
    assert all(sum(page.endswith(part) for page in answers) > 6 for part in PAGES)
    assert {page: content for page, (status, content, _) in answers.items() if status >= 500} == {}
    for name, (_, said) in FAULTS.items():
        assert said in html.unescape(answers[f"{name}/run"][1].decode())
    memory = Path(f"/proc/{server.pid}/status").read_text()
    assert int(re.findall(r"VmHWM:\s+(\d+)", memory)[0]) < MOST_MEMORY


@pytest.mark.parametrize("address", [*(f"/c/good{part}" for part in PAGES), "/compare?a=good"])
@pytest.mark.sampled(3)
def test_the_good_campaign_works(server: Server, address: str) -> None:
    assert server.ask(address)[0] == 200


def test_the_statement_of_one_can_be_mended(server: Server, analysed: Path) -> None:
    address = re.findall('href="(/c/[^"]+)"', rows_of(server)["nested statement"])[0]
    page = server.ask(f"{address}/statement")[1].decode()
    version = re.findall('"version": ?"([0-9a-f]+)"', page)[0]
    text = (analysed / "campaign.toml").read_text()
    document = server.document(f"{address}/statement", "PUT", {"version": version, "text": text})
    assert document["problems"] == []
    assert "up to date" in rows_of(server)["nested statement"]
    (server.root / "nested statement" / "campaign.toml").write_text(f"x = {'[' * 5000}")


def test_results_that_cannot_be_read_are_told_with_what_to_do(server: Server) -> None:
    address = re.findall('href="(/c/[^"]+)"', rows_of(server)["half a record"])[0]
    assert not (server.root / "half a record" / LIST).read_text().endswith("}")
    page = server.ask(f"{address}/statement")[1].decode()
    assert "The results cannot be read: study.json" in page
    assert f'<a href="{address}/run">Analyse this campaign again</a>' in page
