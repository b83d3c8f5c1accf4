"""The page Ask: a command with its options, started by the page, and its answer."""

from __future__ import annotations

import io
import json
import re
import time
import zipfile
from urllib.parse import quote

import pytest
from tests.served.server import Server


def page(server: Server) -> str:
    """The address of the page of the one campaign."""
    (campaign,) = set(re.findall('href="(/c/[^/"]+)"', server.ask("/")[1].decode()))
    return f"{campaign}/ask"


def asked(server: Server, command: str, **stated: str) -> str:
    """The page with the answer of a command."""
    address = page(server)
    status, content, _ = server.ask(address, "POST", {"command": command, **stated})
    assert status == 204, content
    query = "&".join(f"{name}={quote(value)}" for name, value in {"command": command, **stated}.items())
    for _ in range(600):
        _, content, _ = server.ask(f"{address}?{query}")
        if b"At work" not in content:
            return content.decode()
        time.sleep(0.1)
    raise AssertionError("no answer")


def test_a_question_is_answered_as_the_terminal_answers_it(server: Server) -> None:
    shown = asked(server, "rig", out="x.csv")  # which is no option of the page, and is left out
    assert "moving mass m [kg]" in shown
    assert '<th scope="rowgroup"' in shown
    assert "conditions are possible" in asked(server, "causality", tyre="radial-ply", std="1 %")


def test_a_mistake_is_a_message_on_the_page(server: Server) -> None:
    assert "no test of a specimen &#39;none&#39;" in asked(server, "causality", specimen="none")


@pytest.mark.parametrize(
    "body",
    [
        {"command": "analyse"},
        {"command": "plot", "out": "/tmp/x.svg"},
        {"command": "demo"},
        {"command": "causality", "std": "1\n--out=x"},
        {"command": "causality", "std": "1" * 300},
        ["rig"],
    ],
)
def test_nothing_else_is_started(server: Server, body: object) -> None:
    status, content, _ = server.ask(page(server), "POST", body)
    assert status == 400
    assert "error" in json.loads(content)


@pytest.mark.sampled(2)
def test_the_files_of_an_answer_are_offered(server: Server) -> None:
    """A folder is packed. Nothing is left in the results, nor of the former answer when the next one is there."""
    shown = asked(server, "export", to="tydex")
    assert "Save tydex" in shown
    status, content, headers = server.ask(f"{page(server)}/files/tydex")
    assert (status, headers["content-disposition"][-11:]) == (200, '-tydex.zip"')
    with zipfile.ZipFile(io.BytesIO(content)) as packed:
        assert packed.namelist()
    assert len(list(server.temporary.glob("fourpole-export-*"))) == 1
    assert "Save " not in asked(server, "rig")
    assert server.ask(f"{page(server)}/files/tydex")[0] == 400
    assert not list(server.temporary.glob("fourpole-export-*"))
    assert not list(server.root.rglob("tydex"))


def test_the_page_lists_what_may_be_asked(server: Server) -> None:
    status, content, _ = server.ask(page(server))
    assert status == 200
    for name in (b"rig", b"causality", b"check", b"verify", b"twoport", b"export", b"report"):
        assert b"?command=" + name in content
    assert server.ask(f"{page(server)}?command=analyse")[0] == 400
