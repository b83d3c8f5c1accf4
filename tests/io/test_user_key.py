"""The user's folders and key: of the user alone, made once, and never in the way."""

import os
import subprocess
import sys

import pytest
from tests.processes import environment

from fourpole.errors import FileError
from fourpole.io import userfolders

pytestmark = [pytest.mark.thorough, pytest.mark.skipif(sys.platform == "win32", reason="files have no mode there")]

SHOW = "from fourpole.io.userfolders import user_key; print(user_key().hex())"


@pytest.fixture
def home(tmp_path, monkeypatch):
    """A home folder of one test, and no key in the memory of this process."""
    monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path))
    userfolders.user_key.cache_clear()
    yield tmp_path
    userfolders.user_key.cache_clear()


def key_now():
    """The key as another process would find it."""
    userfolders.user_key.cache_clear()
    return userfolders.user_key()


def test_folders_stand_where_the_user_has_such_folders_and_nobody_else_can_look_into_them(home, monkeypatch):
    folders = {userfolders.config_folder(): ".config", userfolders.cache_folder(): ".cache"}
    assert folders == {home / ".config" / "fourpole": ".config", home / ".cache" / "fourpole": ".cache"}
    assert {folder.stat().st_mode & 0o777 for folder in folders} == {0o700}
    monkeypatch.setenv("XDG_CONFIG_HOME", str(home / "mine"))
    assert userfolders.config_folder() == home / "mine" / "fourpole"
    monkeypatch.setenv("XDG_CONFIG_HOME", "relative")
    assert userfolders.config_folder() == home / ".config" / "fourpole"


@pytest.mark.parametrize("mode", [0o770, 0o707, 0o777])
def test_a_folder_that_others_may_write_into_is_not_the_users(home, mode):
    userfolders.config_folder().chmod(mode)
    with pytest.raises(FileError, match="chmod 700"):
        userfolders.config_folder()


@pytest.mark.parametrize("stated", [".", "campaign"])
def test_a_home_below_the_working_folder_gives_no_key_that_lies_there(home, monkeypatch, stated):
    """An archive may bring a key with it."""
    monkeypatch.chdir(home)
    planted = home / stated / ".config" / "fourpole"
    planted.mkdir(parents=True)
    (planted / "key").write_bytes(bytes(32))
    (planted / "key").chmod(0o600)
    monkeypatch.setenv("HOME", stated)
    assert key_now() != bytes(32)
    assert key_now() != key_now()


def test_the_key_is_made_once_for_the_user_alone(home):
    key = key_now()
    assert len(key) == 32
    assert key_now() == key
    (path,) = (home / ".config" / "fourpole").iterdir()
    assert (path.read_bytes(), path.stat().st_mode & 0o777) == (key, 0o600)


def test_several_processes_at_once_have_the_same_key(home):
    running = [
        subprocess.Popen([sys.executable, "-P", "-c", SHOW], stdout=subprocess.PIPE, text=True, env=environment())
        for _ in range(6)
    ]
    assert {process.communicate()[0].strip() for process in running} == {key_now().hex()}


@pytest.mark.parametrize(
    "spoil",
    [
        lambda path: path.chmod(0o640),
        lambda path: path.chmod(0o604),
        lambda path: path.write_bytes(b"short"),
        lambda path: path.write_bytes(bytes(33)),
        lambda path: path.write_bytes(b""),
        lambda path: (path.unlink(), os.mkfifo(path)),
    ],
)
def test_a_key_that_others_may_know_or_that_is_none_is_made_anew(home, spoil):
    key, path = key_now(), home / ".config" / "fourpole" / "key"
    spoil(path)
    new = key_now()
    assert new != key
    assert (path.read_bytes(), path.stat().st_mode & 0o777) == (new, 0o600)
    assert key_now() == new


def test_where_no_folder_can_be_made_each_process_has_a_key_of_its_own(home):
    (home / ".config").write_text("")
    assert len(key_now()) == 32
    assert key_now() != key_now()


def test_a_key_in_place_of_which_a_folder_stands_is_of_this_process(home):
    (userfolders.config_folder() / "key").mkdir()
    assert key_now() != key_now()


def test_a_signature_is_of_one_content_one_purpose_and_one_user(home):
    signed = userfolders.signature(b"content", "entry", "a")
    assert len(signed) == userfolders.SIGNATURE_LENGTH
    assert userfolders.is_signed(b"content", signed, "entry", "a")
    for content, *purpose in (
        (b"contenu", "entry", "a"),
        (b"content", "entry", "b"),
        (b"content", "entry"),
        (b"content", "entrya"),
        (b"content", "entry", "a", ""),
        (b"\0content", "entry", "a"),
    ):
        assert not userfolders.is_signed(content, signed, *purpose)
    for other in (b"", signed[:-1], signed + b"\0"):
        assert not userfolders.is_signed(b"content", other, "entry", "a")
    (home / ".config" / "fourpole" / "key").unlink()
    userfolders.user_key.cache_clear()
    assert not userfolders.is_signed(b"content", signed, "entry", "a")
