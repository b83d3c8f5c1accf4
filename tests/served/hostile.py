"""Campaign folders that somebody has made to harm: each is one row of the home page, and harms no other campaign."""

from __future__ import annotations

import json
import os
import shutil
import socket
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

TOML, TABLE, LIST = "campaign.toml", "tests.csv", "results/study.json"


def _socket(path: Path) -> None:
    """A socket, whose path may have only 107 characters: it is made under a short name."""
    with tempfile.TemporaryDirectory() as short, socket.socket(socket.AF_UNIX) as made:
        made.bind(f"{short}/s")
        shutil.move(f"{short}/s", path)


#: What stands in place of a file or folder of a campaign, by name.
STRANGE: dict[str, Callable[[Path], object]] = {
    "pipe": os.mkfifo,
    "socket": _socket,
    "folder": Path.mkdir,
    "no text": lambda path: path.write_bytes(bytes(range(256)) * 100),
}


def _instead(name: str, make: Callable[[Path], object]) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        place = folder / name
        if place.exists():
            place.rename(folder.with_name(f".{folder.name}-former"))
        make(place)

    return change


def _text(name: str, text: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        (folder / name).write_text(text)

    return change


def _record(**changed: Any) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        place = folder / LIST
        place.write_text(json.dumps({**json.loads(place.read_text()), **changed}))

    return change


def _sparse(name: str, size: int) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        (folder / name).write_text("{}")
        os.truncate(folder / name, size)

    return change


#: Changes of a good campaign by the name of its folder, and what its row of the home page says.
FAULTS: dict[str, tuple[Callable[[Path], None], str]] = {
    "nested statement": (_text(TOML, f"x = {'[' * 5000}"), "campaign.toml: not valid TOML: nests more than"),
    "nested statement of tables": (
        _text(TOML, "x = " + "{a = " * 5000),
        "campaign.toml: not valid TOML: nests more than",
    ),
    "long key": (_text(TOML, ".".join("a" * 400_000) + " = 1"), "campaign.toml: a key has more than"),
    "long title": (_text(TOML, f"title = '{'x' * 10_000_000}'"), "campaign.toml: has 10 MB"),
    "large integer": (_text(TOML, f"title = {'1' * 4000}"), "an integer has more than 64 bits"),
    "large statement": (_sparse(TOML, 3_000_000_000), "campaign.toml: has 3 GB"),
    "long cell": (_text(TABLE, f"test,file\nD1,{'x' * 200_000}\n"), "tests.csv row 2, column 2: a cell has more than"),
    "open quote": (_text(TABLE, 'test,file\nD1,"' + "x,\n" * 100_000), "a cell has more than"),
    "large table": (_sparse(TABLE, 1_500_000_000), "tests.csv: has 1.5 GB"),
    "nested record": (_text(LIST, "[" * 100_000), "study.json: nests more than"),
    "large record": (_sparse(LIST, 1_500_000_000), "study.json: has 1.5 GB"),
    "record of a list": (_text(LIST, "[1]"), "study.json is not one that fourpole wrote"),
    "record of no number": (_text(LIST, '{"verdicts": NaN}'), "study.json: is not valid JSON"),
    "half a title": (_record(title="\ud800"), "study.json: title: a text has half a character"),
    "half a key": (_record(**{"\udc00": 1}), "study.json: a text has half a character"),
    "half a record": (_text(LIST, '{"verdicts": {"ok"'), "study.json: is not valid JSON"),
    "a file for results": (_instead("results", Path.touch), "results: is no folder"),
    **{
        f"{what} for {name.rpartition('/')[2]}": (_instead(name, make), f"{name.rpartition('/')[2]}: is")
        for what, make in STRANGE.items()
        for name in (TOML, TABLE, LIST)
        if (what, name) not in {("no text", TABLE), ("no text", LIST)}
    },
    "no text for record": (_instead(LIST, STRANGE["no text"]), "study.json: is not valid JSON"),
    **{f"{what} for results": (_instead("results", STRANGE[what]), "results: is no") for what in ("pipe", "socket")},
}
#: Changes that leave a campaign with no fault on the home page, but with values of odd kinds.
ODD: dict[str, Callable[[Path], None]] = {
    "odd verdicts": _record(verdicts={"ok": "<b>7</b>", "warning": [1], "rejected": -1}),
    "listed verdicts": _record(verdicts=["ok"], sha256=["a"]),
    "odd hashes": _record(sha256={"campaign.toml": {"a": 1}, "tests.csv": 5}, results=7, sizes={"a": 1}),
    "odd title": _text(TOML, "title = [[1979-05-27, {a = 1}]]"),
    "empty statement": _text(TABLE, "test,file,kind\n"),
    "control \x01\x1b[2J\n": lambda _: None,
    "<script>alert(1)</script>": lambda _: None,
    os.fsdecode(b"half \xff\xfe"): lambda _: None,
    "\u202eleft to right \U0001f6de": lambda _: None,
    "x" * 255: lambda _: None,
}
#: Files and folders in whose place something strange stands; pages tell it, or do without.
ELSEWHERE = (
    "limits.toml", "recordings", "recordings/D1.csv", "results/.store", "results/cache", "results/dynamic.csv",
    "results/figures", "results/model.json", "results/report.html",
)  # fmt: skip
ODD |= {f"pipe for {name.replace('/', ' ')}": _instead(name, os.mkfifo) for name in ELSEWHERE}
