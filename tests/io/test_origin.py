"""Which program runs: its commit is that of its own checkout, or none."""

import json
import shutil
import subprocess

import pytest

from fourpole.io.origin import Origin, origin_of
from fourpole.version import VERSION

COMMIT = "1a2b3c4d5e6f7a8b9c0d1a2b3c4d5e6f7a8b9c0d"
GIT = shutil.which("git")


def checkout(root, name="fourpole"):
    """A source tree whose package is in src/fourpole."""
    package = root / "src" / "fourpole"
    package.mkdir(parents=True)
    (root / "pyproject.toml").write_text(f'[project]\nname = "{name}"\n')
    (package / "version.py").write_text("VERSION = '0'\n")
    return package


def repository(root, head="ref: refs/heads/main\n", **files):
    """The files of a repository that say what is checked out."""
    for name, text in {"HEAD": head, **files}.items():
        place = root / ".git" / name.replace("__", "/")
        place.parent.mkdir(parents=True, exist_ok=True)
        place.write_text(text)


@pytest.mark.parametrize(
    ("head", "files"),
    [
        (f"{COMMIT}\n", {}),
        ("ref: refs/heads/main\n", {"refs__heads__main": f"{COMMIT}\n"}),
        ("ref: refs/heads/main\n", {"packed-refs": f"# pack-refs\n{COMMIT} refs/heads/main\n"}),
    ],
)
def test_the_commit_is_read_from_the_files_of_the_repository(tmp_path, monkeypatch, head, files):
    monkeypatch.setattr("fourpole.io.origin.program_path", lambda name: None)
    package = checkout(tmp_path)
    repository(tmp_path, head, **files)
    assert origin_of(package) == Origin(VERSION, COMMIT, None)
    assert "not known whether files changed" in origin_of(package).text


def test_a_further_work_tree_has_the_commit_of_its_own(tmp_path, monkeypatch):
    monkeypatch.setattr("fourpole.io.origin.program_path", lambda name: None)
    package = checkout(tmp_path / "second")
    repository(tmp_path / "first", refs__heads__side=f"{COMMIT}\n", worktrees__second__HEAD="ref: refs/heads/side\n")
    (tmp_path / "first" / ".git" / "worktrees" / "second" / "commondir").write_text("../..\n")
    (tmp_path / "second" / ".git").write_text(f"gitdir: {tmp_path}/first/.git/worktrees/second\n")
    assert origin_of(package).commit == COMMIT


@pytest.mark.parametrize("head", ["ref: refs/heads/../../../secret\n", "ref: refs/heads/none\n", "nothing\n", ""])
def test_a_repository_that_does_not_tell_gives_no_commit(tmp_path, head):
    (tmp_path / "secret").write_text(COMMIT)
    package = checkout(tmp_path)
    repository(tmp_path, head)
    assert origin_of(package) == Origin(VERSION)
    assert origin_of(package).text == VERSION


def test_the_repository_of_somebody_else_is_not_asked(tmp_path):
    repository(tmp_path, f"{COMMIT}\n")
    (tmp_path / "pyproject.toml").write_text('[project]\nname = "fourpole"\n')
    inside = tmp_path / ".venv" / "lib" / "python3.11" / "site-packages" / "fourpole"
    inside.mkdir(parents=True)
    assert origin_of(inside) == Origin(VERSION)
    other = checkout(tmp_path / "other", name="their-project")
    repository(tmp_path / "other", f"{COMMIT}\n")
    assert origin_of(other) == Origin(VERSION)


def test_pip_notes_the_commit_of_an_installation_from_a_repository(tmp_path):
    (tmp_path / "fourpole").mkdir()
    noted = tmp_path / f"fourpole-{VERSION}.dist-info" / "direct_url.json"
    noted.parent.mkdir()
    noted.write_text(
        json.dumps({"url": "https://example.org/fourpole", "vcs_info": {"vcs": "git", "commit_id": COMMIT}})
    )
    assert origin_of(tmp_path / "fourpole") == Origin(VERSION, COMMIT, False)
    for text in ('{"url": "file:///x", "dir_info": {}}', "[]", "{", '{"vcs_info": {"commit_id": 7}}'):
        noted.write_text(text)
        assert origin_of(tmp_path / "fourpole") == Origin(VERSION)


@pytest.mark.skipif(GIT is None, reason="git is not here")
def test_changes_of_the_package_are_seen_and_others_are_not(tmp_path, monkeypatch):
    package = checkout(tmp_path)

    def git(*words):
        identity = ("-c", "user.name=a", "-c", "user.email=a@example.org")
        subprocess.run([GIT, *identity, "-C", str(tmp_path), *words], check=True, capture_output=True)

    git("init", "-q")
    git("add", "-A")
    git("commit", "-q", "-m", "first")
    monkeypatch.setenv("GIT_DIR", str(tmp_path / "elsewhere"))  # as inside a hook of another repository
    (tmp_path / "notes.txt").write_text("not of the package\n")
    clean = origin_of(package)
    assert len(clean.commit) == 40
    assert clean.changed is False
    (package / "new.py").write_text("")
    assert origin_of(package).changed is True
    assert "files changed since" in origin_of(package).text
