"""Several who change a campaign at the same time: nothing that was accepted is lost."""

from __future__ import annotations

import csv
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest
from tests.served.server import Server, serving
from tests.served.test_editing import TESTS, TOML

from fourpole.campaign import read_campaign
from fourpole.guess.write import GuessedCampaign, Row
from fourpole.io.lock import campaign_lock
from fourpole.served.editing import read_statement, save
from fourpole.study.watch import add_rows

SIX = range(6)
#: Waits for the others at its input, and saves a title.
SAVE = """
import sys
from pathlib import Path
from fourpole.served.editing import ConflictError, save
folder, version, title = sys.argv[1:]
print("ready", flush=True)
sys.stdin.readline()
try:
    save(Path(folder), version, {"text": f"title = '{title}'\\n" + "# \\n" * 5000})
    print("accepted")
except ConflictError:
    print("told")
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "campaign.toml").write_text(TOML)
    rows = "".join(f"D{at};d{at}.csv;dynamic;a;1,7;1{at};x\n" for at in SIX)
    (tmp_path / "one" / "tests.csv").write_text(TESTS.split("\n", 1)[0] + "\n" + rows)
    return tmp_path / "one"


@pytest.fixture
def server(folder: Path) -> Iterator[Server]:
    with serving(folder.parent) as running:
        yield running


def at_once(call: Callable[[int], Any]) -> list[Any]:
    """What six threads get that start together."""
    together = threading.Barrier(len(SIX))

    def wait(number: int) -> Any:
        together.wait()
        return call(number)

    with ThreadPoolExecutor(len(SIX)) as threads:
        return list(threads.map(wait, SIX))


@pytest.mark.sampled(4)
def test_of_six_saves_at_once_one_is_accepted(server: Server, folder: Path) -> None:
    for attempt in range(10):
        version = read_statement(folder).version

        def keep(number: int, version: str = version, attempt: int = attempt) -> int:
            form = {"version": version, "text": f"title = '{attempt} {number}'\n{TOML.split(chr(10), 2)[2]}"}
            return server.ask("/c/one/statement", "PUT", form)[0]

        found = at_once(keep)
        assert sorted(found) == [200, 409, 409, 409, 409, 409]
        assert read_statement(folder).title == f"{attempt} {found.index(200)}"


@pytest.mark.sampled(4)
def test_six_tests_that_are_left_out_at_once_are_all_left_out(server: Server, folder: Path) -> None:
    found = at_once(lambda at: server.ask(f"/c/one/tests/D{at}/excluded", "PUT", {"reason": f"slipped {at}"})[0])
    assert found == [200] * len(SIX)
    with (folder / "tests.csv").open(newline="") as file:
        assert [row["excluded"] for row in csv.DictReader(file, delimiter=";")] == [f"slipped {at}" for at in SIX]


@pytest.mark.sampled(4)
def test_of_six_processes_that_save_one_is_accepted(folder: Path) -> None:
    version = read_statement(folder).version
    command = [sys.executable, "-c", SAVE, str(folder), version]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "text": True}
    savers = [subprocess.Popen([*command, str(at)], **pipes) for at in SIX]
    for one in savers:
        assert one.stdout.readline() == "ready\n"
    for one in savers:
        one.stdin.write("\n")
        one.stdin.flush()
    answers = [one.communicate(timeout=60)[0].strip() for one in savers]
    assert sorted(answers) == ["accepted", *["told"] * 5]
    assert read_statement(folder).title == str(answers.index("accepted"))


def test_writers_wait_for_each_other(folder: Path, tmp_path: Path) -> None:
    version, new = read_statement(folder).version, tmp_path / "new"
    new.mkdir()
    guess = GuessedCampaign(new, "t", (), {}, None, None, {}, {}, (), ())
    writers: dict[Path, list[Callable[[], Any]]] = {
        folder: [
            lambda: save(folder, version, {"text": TOML}),
            lambda: add_rows(folder, [Row("D9", "d9.csv", "dynamic")]),
        ],
        new: [guess.write],
    }
    for place, calls in writers.items():
        for call in calls:
            with campaign_lock(place):
                thread = threading.Thread(target=call)
                thread.start()
                thread.join(0.3)
                assert thread.is_alive()
            thread.join(30)
    assert len(read_campaign(folder).tests) == 7
    assert (new / "tests.csv").exists()


def test_rows_of_a_watch_are_added_to_the_table_as_it_is_now(folder: Path) -> None:
    added = [Row("D9", "d9.csv", "dynamic", "a"), Row("D0", "d0.csv", "dynamic", "a"), Row("D1", "e.csv", "dynamic")]
    add_rows(folder, added)
    assert [(test.name, test.file) for test in read_campaign(folder).tests[6:]] == [("D9", "d9.csv"), ("D1-2", "e.csv")]
    before = (folder / "tests.csv").read_bytes()
    assert add_rows(folder, added) == {}
    assert (folder / "tests.csv").read_bytes() == before
