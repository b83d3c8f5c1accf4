"""Contents in one file: what is appended is found again, and what was cut or is another's is not."""

import os
import resource

import pytest
from tests.entries import NAME, entries_of

from fourpole.io.records import Records

A, B, C = ("a" * 40, "b" * 40, "c" * 40)


def records(folder):
    return Records(folder / NAME, "entry")


@pytest.fixture
def written(tmp_path):
    """A file with two contents, closed."""
    made = records(tmp_path)
    made.add(A, b"one" * 100)
    made.add(B, b"two" * 100)
    made.close()
    return tmp_path


def test_contents_are_found_at_once_and_in_the_next_run_and_the_last_of_a_name_counts(written):
    made = records(written)
    made.add(A, b"three")
    assert (made.content(A), made.content(B), made.content(C)) == (b"three", b"two" * 100, None)
    made.close()
    assert records(written).content(A) == b"three"
    assert records(written).sizes == {A: 5, B: 300}


@pytest.mark.parametrize("cut", [1, 299, 301, 363])
def test_a_torn_last_record_is_ignored_and_the_file_goes_on(written, cut):
    path = written / NAME
    path.write_bytes(path.read_bytes()[:-cut])
    made = records(written)
    assert (made.content(A), made.content(B)) == (b"one" * 100, None)
    made.add(C, b"new")
    made.close()
    again = records(written)
    assert (again.content(A), again.content(C)) == (b"one" * 100, b"new")
    assert list(entries_of(written)) == [A, C]


def test_a_changed_byte_costs_its_record_alone(written):
    path = written / NAME
    content = bytearray(path.read_bytes())
    content[70] ^= 1
    path.write_bytes(content)
    made = records(written)
    assert (made.content(A), made.content(B)) == (None, b"two" * 100)


def test_a_content_is_of_its_purpose_and_its_name(written):
    assert Records(written / NAME, "other").content(A) is None
    path = written / NAME
    path.write_bytes(path.read_bytes().replace(bytes.fromhex(A), bytes.fromhex(C)))
    assert records(written).content(C) is None


def test_a_file_with_another_name_is_not_appended(written):
    """As of a backup by hard links."""
    backup = written / "backup"
    backup.hardlink_to(written / NAME)
    before = backup.read_bytes()
    made = records(written)
    made.add(C, b"new")
    assert (made.content(A), made.content(C)) == (b"one" * 100, b"new")
    assert backup.read_bytes() == before


def test_what_is_kept_alone_is_all_that_stays(written):
    made = records(written)
    made.keep([B])
    assert (made.content(A), made.content(B)) == (None, b"two" * 100)
    made.add(C, b"new")
    made.close()
    assert records(written).sizes == {B: 300, C: 3}


def test_two_that_append_at_once_lose_no_record(written):
    first, second = records(written), records(written)
    first.add(C, b"new")
    second.add(A, b"other")
    for made in (first, second):
        made.close()
    assert [records(written).content(name) for name in (A, B, C)] == [b"other", b"two" * 100, b"new"]


@pytest.mark.skipif(os.name != "posix", reason="the limit is of POSIX")
def test_a_full_disk_keeps_what_was_there(written):
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    made = records(written)
    resource.setrlimit(resource.RLIMIT_FSIZE, ((written / NAME).stat().st_size + 100, before[1]))
    try:
        made.add(C, b"new" * 1000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert (made.content(A), made.content(C)) == (b"one" * 100, None)
    made.add(C, b"new")
    made.close()
    assert [records(written).content(name) for name in (A, B, C)] == [b"one" * 100, b"two" * 100, b"new"]
