"""The release script finds every statement that contradicts another, and tags only what passed."""

import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
STATEMENTS = ("CHANGELOG.md", "CITATION.cff", "docs/citing.md", "src/fourpole/version.py")
#: Keys that version 1.2.0 of the Citation File Format knows, and those that it requires.
KNOWN = {
    *("abstract", "authors", "cff-version", "commit", "contact", "date-released", "doi", "identifiers", "keywords"),
    *("license", "license-url", "message", "preferred-citation", "references", "repository", "repository-artifact"),
    *("repository-code", "title", "type", "url", "version"),
}
REQUIRED = {"authors", "cff-version", "message", "title"}


@pytest.fixture(scope="module")
def release():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT / "tools"))
        yield import_module("release")
    for name in ("release", "citation"):
        sys.modules.pop(name)


def git(root, *words):
    who = ("-c", "user.name=a", "-c", "user.email=a@b.invalid", "-c", "commit.gpgsign=false")
    subprocess.run(["git", *who, *words], cwd=root, check=True, capture_output=True)


@pytest.fixture
def checkout(release, tmp_path, monkeypatch):
    """A repository with the statements of a version, whose [Unreleased] is empty, all of it committed on main."""
    for name in STATEMENTS:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    version = release.stated_version(ROOT)
    day = release.citation.read_citation(ROOT)["date-released"]
    changes = f"## [Unreleased]\n\n## [{version}] - {day}\n\n### Added\n\n- A line.\n\n## [0.0.1] - 2020-01-01\n"
    (tmp_path / "CHANGELOG.md").write_text(changes)
    git(tmp_path, "init", "--initial-branch=main")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-m", "a")
    monkeypatch.setattr(release, "ROOT", tmp_path)
    return tmp_path


def change(root, name, old, new):
    text = (root / name).read_text()
    assert old in text
    (root / name).write_text(text.replace(old, new, 1))


def test_the_citation_of_this_checkout_is_in_step(release):
    assert release.citation_faults(ROOT, release.stated_version(ROOT)) == []


def test_the_citation_has_the_keys_of_the_format(release):
    said = release.citation.read_citation(ROOT)
    assert set(said) >= REQUIRED
    assert set(said) <= KNOWN
    assert said["cff-version"] == "1.2.0"
    assert all({"authors", "title", "type"} <= set(one) for one in said["references"])


def test_a_checkout_in_step_has_no_fault(release, checkout):
    assert release.statement_faults(checkout) == []
    assert release.tree_faults(checkout) == []


@pytest.mark.parametrize(
    ("name", "old", "new", "says"),
    [
        ("src/fourpole/version.py", 'VERSION = "', 'VERSION = "v', "is not of the form 1.2.3"),
        ("src/fourpole/version.py", 'VERSION = "', 'VERSION = "9', "CHANGELOG.md: the first sections must be"),
        ("CHANGELOG.md", "## [Unreleased]\n", "## [Unreleased]\n\n- More.\n", "[Unreleased] is not empty"),
        ("CHANGELOG.md", "## [Unreleased]\n", "", "CHANGELOG.md: the first sections must be"),
        ("CHANGELOG.md", "### Added\n\n- A line.\n", "", "is empty"),
        ("CHANGELOG.md", "] - 20", "] - x20", "needs its day"),
        ("CHANGELOG.md", "] - 20", "] - 19", "CITATION.cff: date-released is"),
        ("CITATION.cff", "\nversion: ", "\nversion: 7.", "CITATION.cff: version is 7."),
        ("docs/citing.md", "  version = {", "  version = {7.", "its entry is not that of CITATION.cff"),
    ],
)
def test_each_contradiction_is_named(release, checkout, name, old, new, says):
    change(checkout, name, old, new)
    assert any(says in fault for fault in release.statement_faults(checkout))


def test_a_tree_that_is_not_clean_is_named(release, checkout):
    (checkout / "new.txt").write_text("a")
    git(checkout, "tag", f"v{release.stated_version(checkout)}")
    git(checkout, "switch", "--create", "other")
    changed, branch, tag = release.tree_faults(checkout)
    assert "new.txt" in changed
    assert "the branch is other" in branch
    assert "exists" in tag


@pytest.fixture
def steps(release, monkeypatch):
    """The steps that take minutes only say their names."""
    done = []
    real = release.run

    def run(*words, cwd, **more):
        if words[0] == "git" and words[1] != "tag":
            return real(*words, cwd=cwd, **more)
        done.append(" ".join(map(str, words[:2])))
        if words[0] == "git":
            git(cwd, *words[1:])
        return ""

    monkeypatch.setattr(release, "run", run)
    monkeypatch.setattr(release, "build", lambda root: done.append("build") or root / "a.whl")
    monkeypatch.setattr(release, "try_wheel", lambda wheel, version: done.append(f"try {wheel.name} {version}"))
    return done


def tags(root):
    return subprocess.run(["git", "tag"], cwd=root, check=True, capture_output=True, text=True).stdout.split()


def test_a_release_tests_builds_tries_and_tags(release, checkout, steps):
    version = release.stated_version(checkout)
    assert release.main([]) == 0
    assert steps == ["git tag", "make test", "make every", "build", f"try a.whl {version}", "git tag"]
    assert tags(checkout) == [f"v{version}"]


def test_a_dry_run_neither_tests_nor_tags_and_allows_changes(release, checkout, steps):
    (checkout / "new.txt").write_text("a")
    assert release.main(["--dry-run"]) == 0
    assert steps == ["build", f"try a.whl {release.stated_version(checkout)}"]
    assert tags(checkout) == []


def test_a_fault_ends_the_release_before_anything_is_run(release, checkout, steps, capsys):
    (checkout / "new.txt").write_text("a")
    assert release.main([]) == 1
    assert "error: files are changed or new" in capsys.readouterr().err
    assert "build" not in steps
    assert tags(checkout) == []


def test_a_step_that_fails_ends_the_release(release, checkout, steps, monkeypatch, capsys):
    def broken(wheel, version):
        raise release.StepError("the wheel is broken")

    monkeypatch.setattr(release, "try_wheel", broken)
    assert release.main([]) == 1
    assert "error: the wheel is broken" in capsys.readouterr().err
    assert tags(checkout) == []


def test_a_command_that_fails_is_a_failed_step(release, tmp_path):
    with pytest.raises(release.StepError, match="exit code 3"):
        release.run(sys.executable, "-c", "raise SystemExit(3)", cwd=tmp_path)
