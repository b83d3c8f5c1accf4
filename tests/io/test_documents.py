"""Documents that others wrote: bounded nesting, keys, integers and cells, in time and memory that grow as the text."""

from __future__ import annotations

import csv
import time
import tomllib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fourpole.errors import TableError
from fourpole.io.documents import json_of, rows_of, toml_of


@pytest.mark.parametrize("read", [json_of, toml_of])
@pytest.mark.parametrize("depth", [65, 5_000, 100_000])
def test_a_deep_nest_is_refused(read, depth: int) -> None:
    text = "[" * depth + "]" * depth
    with pytest.raises(TableError, match=r"a\.txt: (not valid TOML: )?nests more than 64 levels deep"):
        read(text if read is json_of else f"x = {text}", "a.txt")


@pytest.mark.parametrize(
    "text",
    [
        ".".join("a" * 17) + " = 1",
        " . ".join("a" * 17) + " = 1",
        ".".join(['"a b"'] * 17) + " = 1",
        "[" + ".".join(["'a'", '"b.c"'] * 9) + "]",
        'x = {y = """a"""", ' + ".".join("a" * 17) + " = 1}",
        "x = {y = '''a'''', " + ".".join("a" * 17) + " = 1}",
        'x = "a" # "\n' + ".".join("a" * 17) + " = 1",
        ".".join("a" * 200_000) + " = 1",
    ],
)
def test_a_long_key_is_refused_before_it_takes_memory(text: str) -> None:
    began = time.process_time()
    with pytest.raises(TableError, match="a key has more than 16 parts"):
        toml_of(text, "a.toml")
    assert time.process_time() - began < 1


@pytest.mark.parametrize(
    "text",
    [
        ".".join("a" * 16) + " = 1",
        'x = "' + ".".join("a" * 100) + '"',
        "x = '" + ".".join("a" * 100) + "'",
        'x = """\n' + ".".join("a" * 100) + '\n"" "\\""""',
        "# " + ".".join("a" * 100),
        "x = [" + ", ".join(["1.5"] * 100) + "]",
        "x = ''  # it's " + ".".join("a" * 100),
    ],
)
def test_what_is_no_long_key_is_read(text: str) -> None:
    assert toml_of(text, "a.toml") == tomllib.loads(text)


@given(st.text(alphabet="\"'\\#a.= \n[]{},1", max_size=60))
def test_what_is_toml_of_few_parts_is_read_as_it_is(text: str) -> None:
    try:
        expected = tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        return
    if text.count(".") < 16:
        assert toml_of(text, "a.toml") == expected


@pytest.mark.parametrize("part", ["[],", "{},", "1,"])
def test_a_document_of_too_many_values_is_refused(part: str) -> None:
    text = f"[{part * 4_000_000}0]"
    for content in (text, text.encode()):
        with pytest.raises(TableError, match="more than 4000000 values"):
            json_of(content, "a.json")


@pytest.mark.parametrize("text", ['{"a": ["\\ud800"]}', '{"\\udfff": 1}', '"a\\udc00\\ud800"'])
def test_half_a_character_is_refused(text: str) -> None:
    with pytest.raises(TableError, match="half a character"):
        json_of(text, "a.json")
    assert json_of('"\\ud83d\\ude00 ü"', "a.json") == "\U0001f600 ü"


def test_a_long_cell_is_told_with_its_row() -> None:
    with pytest.raises(TableError, match=r"tests.csv row 3, column 2: a cell has more than 131072 characters"):
        list(rows_of("test,file\nD1,a.csv\nD2," + "x" * 140_000, "tests.csv"))
    former = csv.field_size_limit(10**9)
    try:
        with pytest.raises(TableError, match=r"row 2, column 2: a cell has more than"):
            list(rows_of('test,file\nD2,"' + "x" * 140_000, "tests.csv"))
    finally:
        csv.field_size_limit(former)


def test_rows_are_read_by_their_delimiter() -> None:
    assert list(rows_of("\ufefftest;a,b;kind\n\nD1;1,5;x\n", "t")) == [
        (1, ["test", "a,b", "kind"]),
        (3, ["D1", "1,5", "x"]),
    ]
